/* Chooses what evaluates the equations of runs: the general engine, or code compiled for the scene. */
#include <stdlib.h>
#include <string.h>
#include "cli.h"

char *pw_cli_source (const pw_system *s, pw_error *error) {
  if (pw_system_check_source (s, error) != PW_OK) return NULL;
  pw_run *r = pw_run_open (s, "rk4+none", NULL, NULL); /* makes no step: any method will do */
  char *text = r ? pw_run_source (r, error) : pw_system_source (s, NULL, error);
  pw_run_close (r);
  return text;
}

void pw_cli_engine_open (pw_cli_engine *e, const pw_system *s, pw_specialise when, double steps) {
  pw_error own = { 0 };
  *e = (pw_cli_engine){ .code = NULL };
  /* a short run uses it even if the cache has the code: results of the engines differ by round-off */
  const char *unwanted = when == PW_SPECIALISE_NEVER                                     ? "--specialise never"
                         : when == PW_SPECIALISE_AUTO && !(steps >= PW_SPECIALISE_STEPS) ? "short run"
                                                                                         : NULL;
  if (unwanted) {
    strcpy (e->reason, unwanted);
    return;
  }
  char *text = pw_cli_source (s, &own);
  int has_text = text != NULL;
  if (text) e->code = pw_scene_code_open (text, s, &own);
  free (text);
  if (e->code && *pw_scene_code_notice (e->code)) pw_cli_say ("pinwheel: %s\n", pw_scene_code_notice (e->code));
  if (e->code) return;
  /* in a few words why: the error without the model's name or, with a C text, the meaning of its status */
  const char *model = PW_PRINTED (300, "model %s: ", pw_system_name (s)), *reason = own.text;
  if (strncmp (reason, model, strlen (model)) == 0) reason += strlen (model);
  if (has_text)
    reason = own.status == PW_INPUT    ? "no C compiler or no pinwheel.h"
             : own.status == PW_METHOD ? "the generated code does not compile"
                                       : "the generated code cannot be compiled or loaded";
  snprintf (e->reason, sizeof e->reason, "%.190s", reason);
  /* errors of a generated text, or those of --specialise always */
  if (has_text || when == PW_SPECIALISE_ALWAYS) pw_cli_say ("pinwheel: general engine: %s\n", own.text);
}

/* Why runs cannot be in lanes; NULL if they can.  r: a run at the initial state; NULL if that was refused. */
static const char *engine_lanes_obstacle (const pw_cli_engine *e, const pw_system *s, const char *method,
                                          const pw_run *r) {
  if (e->code == NULL) return "the general engine is in use, see --specialise";
  const int adaptive = pw_cli_adaptive (NULL, method);
  if (adaptive != 0) return adaptive > 0 ? "the method controls its step size" : "the method is not built-in";
  if (r == NULL) return "the scene's initial state is refused";
  if (pw_run_redundant (r) > 0) return "the scene has redundant constraint equations";
  return pw_system_has_lanes (s) ? NULL : "the scene has element types of its own, or signals that depend on the state";
}

pw_scene_code *pw_cli_engine_lanes (const pw_cli_engine *e, const pw_system *s, const char *method, int lanes,
                                    double steps) {
  const int requested = lanes > 1;
  pw_error own = { 0 };
  if (lanes == 0 && e->code) lanes = pw_processor_lanes ();
  if (lanes <= 1) return NULL;
  pw_run *r = pw_run_open (s, "rk4+none", NULL, NULL); /* makes no step: any method will do */
  const char *reason = engine_lanes_obstacle (e, s, method, r);
  char *text = reason ? NULL : pw_run_source (r, &own);
  const int wanted = requested || steps >= PW_LANES_STEPS || pw_scene_lanes_cached (text, lanes);
  pw_scene_code *code = text && wanted ? pw_scene_lanes_open (text, s, lanes, &own) : NULL;
  const int failed = wanted && reason == NULL && code == NULL; /* also by Ctrl-C, which ends the compiler, too */
  if (failed) reason = own.text;
  if (code && pw_scene_code_lanes (code) == NULL) {
    pw_scene_code_close (code);
    code = NULL, reason = "clang does not vectorise loops over runs; gcc does";
  }
  if (reason && (requested || failed) && pw_stop == 0) pw_cli_say ("pinwheel: one run after the other: %s\n", reason);
  free (text);
  pw_run_close (r);
  return code;
}

void pw_cli_engine_close (pw_cli_engine *e) {
  pw_scene_code_close (e->code);
  e->code = NULL;
}
