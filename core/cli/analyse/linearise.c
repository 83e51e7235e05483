/* pinwheel linearise: the linearised equations of motion x' = A x + B u, y = C x + D u at a time of a run. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linearise.h"
#include "plot.h"
#include "progress.h"
#include "report.h"
#include "states.h"

enum { LINEARISE_MOST = 400 }; /* coordinates: the cost is cubic */

/* ---- Inputs and outputs ---- */

/* Numbers of the names of a list, each once, by `find`. */
static int linearise_find (const pw_system *s, const char **name, int *list, int *count,
                           int (*find) (const pw_system *s, const char *name, pw_error *error), pw_error *error) {
  for (; *name; name++) {
    int index = find (s, *name, error), known = 0;
    if (index < 0) return index;
    for (int i = 0; i < *count; i++) known |= list[i] == index;
    if (!known) list[(*count)++] = index;
  }
  return PW_OK;
}

/* Signals of constraints enter with their first and second derivatives. */
static int linearise_check_inputs (const pw_linearise *x, pw_error *error) {
  char name[200];
  for (int i = 0; i < x->inputs; i++)
    if (!pw_system_signal_forced (x->m.system, x->input[i]))
      return pw_fail (error, PW_INPUT, "--input %s is the signal of a constraint; only signals of forces can be inputs",
                      pw_system_signal_name (x->m.system, x->input[i], name, sizeof name));
  return PW_OK;
}

/* By default all signals of forces, and all states. */
static int linearise_select (pw_linearise *x, pw_error *error) {
  const pw_system *s = x->m.system;
  int states = 2 * pw_system_coordinates (s), signals = pw_system_signals (s);
  x->input = malloc (((size_t)signals + 1) * sizeof *x->input);
  x->output = malloc (((size_t)states + 1) * sizeof *x->output);
  if (x->input == NULL || x->output == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; x->input_names == NULL && i < signals; i++)
    if (pw_system_signal_forced (s, i)) x->input[x->inputs++] = i;
  for (int i = 0; x->output_names == NULL && i < states; i++) x->output[x->outputs++] = i;
  if (x->input_names && linearise_find (s, x->input_names, x->input, &x->inputs, pw_system_find_signal, error) != PW_OK)
    return error->status;
  if (x->output_names &&
      linearise_find (s, x->output_names, x->output, &x->outputs, pw_system_find_state, error) != PW_OK)
    return error->status;
  return linearise_check_inputs (x, error);
}

/* ---- The run ---- */

static int linearise_advance (pw_linearise *x, pw_error *error) {
  pw_progress progress;
  int status = PW_OK;
  pw_stop_catch ();
  pw_progress_start (&progress, pw_file_name (x->m.file), x->t);
  while (status == PW_OK && pw_run_time (x->r) < x->t) {
    status = pw_run_advance (x->r, x->t, error);
    pw_progress_at (&progress, pw_run_time (x->r));
  }
  pw_progress_end (&progress);
  pw_stop_release ();
  return status == PW_STOPPED ? pw_limit_status (&x->limit, pw_run_time (x->r), error) : status;
}

/* Finds the steady motion nearest to the initial state. */
static int linearise_seek (pw_linearise *x, pw_steady *steady, pw_error *error) {
  int n = pw_system_coordinates (x->m.system);
  pw_steady_motion m;
  int status = steady ? pw_steady_solve (steady, 0, 0, &m, error) : error->status;
  if (status == PW_RETRY) status = pw_steady_solve (steady, 1, 0, &m, error);
  if (status == PW_RETRY)
    return pw_fail (error, PW_METHOD,
                    "%s: no steady motion near the initial state: the residual ends at %.2g, in units of the scene; "
                    "`pinwheel steady` also begins at random states",
                    pw_file_name (x->m.file), m.residual);
  if (status != PW_OK) return status;
  x->initial = malloc (2 * (size_t)n * sizeof *x->initial);
  if (x->initial == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < 2 * n; i++) x->initial[i] = (pw_initial_value){ i, i < n ? m.q[i] : m.v[i - n] };
  return PW_OK;
}

static int linearise_steady (pw_linearise *x, double span, pw_error *error) {
  pw_initial_value hold[PW_HOLDS];
  pw_steady_settings set = { .hold = hold, .t = x->t, .span = span, .vary = -1 };
  int status = PW_OK;
  for (const char **text = x->hold_texts; status == PW_OK && text && *text; text++)
    status = pw_hold_read (x->m.system, "--hold", *text, hold, &set.holds, error);
  if (status != PW_OK) return status;
  pw_steady *steady = pw_steady_open (x->m.system, &set, error);
  status = linearise_seek (x, steady, error);
  pw_steady_close (steady);
  return status;
}

/* A run by the model's method to the time; its state there is made consistent. */
static int linearise_run (pw_linearise *x, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  pw_settings settings;
  double t_end;
  if (pw_cli_settings (&x->line, &d, &t_end, &settings, &x->limit, error) != PW_OK) return error->status;
  settings.span = fmax (t_end, x->t);
  pw_limit_start (&x->limit);
  if (x->steady) {
    if (linearise_steady (x, t_end, error) != PW_OK) return error->status;
    settings.t = x->t;
    settings.initial = x->initial;
    settings.initials = 2 * pw_system_coordinates (x->m.system);
  }
  x->r = pw_run_open (x->m.system, d.method, &settings, error);
  if (x->r == NULL) return error->status;
  if (x->t == 0 || x->steady) return PW_OK;
  int status = linearise_advance (x, error);
  return status == PW_OK ? pw_run_restart (x->r, NULL, NULL, error) : status;
}

static int linearise_compute (pw_linearise *x, pw_error *error) {
  const char *model = pw_file_name (x->m.file);
  int coordinates = pw_system_coordinates (x->m.system);
  if (coordinates > LINEARISE_MOST)
    return pw_fail (error, PW_INPUT, "%s has %d coordinates; linearise takes at most %d", model, coordinates,
                    LINEARISE_MOST);
  int status = linearise_run (x, error);
  if (status == PW_OK) status = pw_run_linear_modes (x->r, LINEARISE_MOST, &x->linear, error);
  if (status == PW_OK && x->linear.unknowns == 0)
    return pw_fail (error, PW_INPUT, "%s has no degrees of freedom: there is nothing to linearise", model);
  return status;
}

/* ---- Files ---- */

enum { LINEARISE_JSON = 1, LINEARISE_CSV, LINEARISE_NPZ, LINEARISE_PAGE, LINEARISE_FILES };

/* Opens NAME.json, .csv, .npz, and the page, before anything is computed. */
static int linearise_open_files (pw_linearise *x, pw_error *error) {
  static const char *const ending[] = { [LINEARISE_JSON] = "json", "csv", "npz" };
  char path[LINEARISE_PAGE][4096];
  pw_use use[LINEARISE_FILES] = { PW_CLI_MODEL_USE, [LINEARISE_PAGE] = { "--animate", x->animate, PW_WRITES, NULL } };
  for (int i = LINEARISE_JSON; i < LINEARISE_PAGE && x->name; i++) {
    if (snprintf (path[i], sizeof path[i], "%s.%s", x->name, ending[i]) >= (int)sizeof path[i])
      return pw_fail (error, PW_INPUT, "-o: the name is too long");
    use[i] = (pw_use){ "-o", path[i], PW_WRITES, NULL };
  }
  if (x->animate && pw_animation_check ("--animate", x->animate, error) != PW_OK) return error->status;
  return pw_files_open (&x->files, &x->line, &x->m, use, LINEARISE_FILES, error);
}

static int linearise_write (pw_linearise *x, pw_error *error) {
  int status = PW_OK;
  if (x->name) {
    pw_linearise_json (x, &(pw_json){ .f = pw_files_stream (&x->files, LINEARISE_JSON), .lines = 1 });
    status = pw_linearise_csv (x, pw_files_stream (&x->files, LINEARISE_CSV), error);
    if (status == PW_OK) status = pw_linearise_npz (x, pw_files_stream (&x->files, LINEARISE_NPZ), error);
  }
  if (status == PW_OK && x->animate) status = pw_linearise_page (x, pw_files_stream (&x->files, LINEARISE_PAGE), error);
  return status == PW_OK ? pw_files_finish (&x->files, error) : status;
}

static void linearise_close (pw_linearise *x) {
  pw_linear_free (&x->linear);
  pw_files_close (&x->files);
  pw_run_close (x->r);
  free (x->initial);
  free (x->input);
  free (x->output);
  pw_cli_close_model (&x->m);
}

static int linearise_command (void *options, pw_error *error) {
  pw_linearise *x = options;
  int status = pw_cli_number ("--at", x->at, PW_NONNEGATIVE, &x->t, error);
  if (status == PW_OK && x->hold_texts && !x->steady) status = pw_fail (error, PW_INPUT, "--hold needs --steady");
  if (status == PW_OK) status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = linearise_select (x, error);
  if (status == PW_OK) status = linearise_open_files (x, error);
  if (status == PW_OK) pw_report_model (x->m.model);
  if (status == PW_OK) status = linearise_compute (x, error);
  if (status == PW_OK) pw_linearise_print (x);
  if (status == PW_OK) status = linearise_write (x, error);
  linearise_close (x);
  if (status == PW_RETRY) pw_cli_say ("pinwheel: interrupted\n");
  return status == PW_RETRY ? PW_INTERRUPTED : status;
}

static const struct poptOption linearise_options[] = {
  PW_OPTION_GROUP ("Linearisation"),
  PW_TEXT_OPTION (pw_linearise, at, "at", 0, "T", "At time T [s] of a run with the model's default method (default 0)"),
  PW_FLAG_OPTION (pw_linearise, steady, "steady",
                  "At the steady motion nearest to the initial state; --at is the time of its signals"),
  PW_HOLD_OPTION (pw_linearise, hold_texts),
  PW_LIST_OPTION (pw_linearise, input_names, "input", 0, "SIGNAL",
                  "Input u: the signal of a force, ELEMENT or ELEMENT.FIELD; repeatable (default all)"),
  PW_LIST_OPTION (pw_linearise, output_names, "output", 0, "STATE",
                  "Output y: a state, BODY.x, .y, .phi, .vx, .vy or .omega; repeatable (default all)"),
  PW_TEXT_OPTION (pw_linearise, name, "name", 'o', "NAME",
                  "Write NAME.json (everything), NAME.csv (the matrix [A B; C D]) and NAME.npz for NumPy"),
  PW_TEXT_OPTION (pw_linearise, animate, "animate", 0, "FILE.html", "Write a page in which the modes are animated"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_linearise = {
  .name = "linearise",
  .synopsis = "MODEL [OPTION...]",
  .summary = "linearise a model: matrices, eigenvalues and mode shapes",
  .help = "Linearise the equations of motion in minimal coordinates on the constraints, in a frame that moves with the "
          "motion: x' = A x + B u, y = C x + D u. Prints eigenvalues with frequency, damping and time to double or "
          "halve, and mode shapes.",
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_linearise),
  .function = linearise_command,
  .options = linearise_options,
};
