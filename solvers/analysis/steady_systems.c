/* The systems and runs of a search for steady motions, at values of the parameter. */
#include <string.h>
#include "steady_parts.h"

void pw_steady_close_system (pw_steady *x) {
  pw_linear_close (&x->system.linearisation);
  if (x->system.run) pw_run_close (x->system.run);
  pw_system_free (x->system.own);
  memset (&x->system, 0, sizeof x->system);
}

int pw_steady_same_sizes (const pw_system *a, const pw_system *b, pw_error *why) {
  if (b->coords == a->coords && b->rows == a->rows && b->holonomic == a->holonomic && b->bodies == a->bodies)
    return PW_OK;
  return pw_fail (why, PW_INPUT, "model %s: the parameter changes the number of bodies or constraint equations",
                  b->model);
}

/* Opens a run at the last solution, or if that cannot be made consistent, at rest in its configuration. */
static int steady_open_run (pw_steady *x, const pw_system *s) {
  const pw_settings settings = {
    .t = x->settings.t, .span = x->settings.span, .initial = x->solution, .initials = x->solved ? 2 * x->n : 0
  };
  x->system.run = pw_run_open (s, "rk4+projection", &settings, &x->why);
  if (x->system.run == NULL && x->why.status == PW_INITIAL && x->solved) {
    for (int j = x->n; j < 2 * x->n; j++) x->solution[j].value = 0;
    x->why = (pw_error){ 0 };
    x->system.run = pw_run_open (s, "rk4+projection", &settings, &x->why);
  }
  if (x->system.run == NULL) return x->why.status;
  int status = pw_linear_open (&x->system.linearisation, x->system.run, PW_LINEAR_BASES);
  return status == PW_OK ? PW_OK : pw_fail_memory (s, &x->why);
}

pw_system *pw_compile_at (pw_system *(*compile) (void *context, double value, pw_error *error), void *context,
                          double value, pw_error *why) {
  *why = (pw_error){ 0 };
  pw_system *s = compile (context, value, why);
  if (s && why->status == PW_OK) return s;
  pw_fail (why, PW_INPUT, "there is no system at %.9g", value);
  pw_system_free (s);
  return NULL;
}

int pw_steady_open_system (pw_steady *x, double value) {
  const pw_system *s = x->s;
  if (x->system.run && (x->settings.compile == NULL || x->system.value == value)) return PW_OK;
  pw_steady_close_system (x);
  x->why = (pw_error){ 0 };
  x->system.value = value;
  if (x->settings.compile) s = x->system.own = pw_compile_at (x->settings.compile, x->settings.context, value, &x->why);
  int refused = s && pw_steady_same_sizes (x->s, s, &x->why) != PW_OK;
  int status = s && !refused ? steady_open_run (x, s) : x->why.status;
  if (status != PW_OK) pw_steady_close_system (x);
  return status == PW_OK || status == PW_RESOURCE || refused ? status : PW_RETRY;
}
