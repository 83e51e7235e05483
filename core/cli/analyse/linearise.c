/* The command `linearise`: x' = A x + B u, y = C x + D u, linearised at a time of a run or at a steady motion. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "linearise.h"
#include "plot.h"
#include "report.h"
#include "states.h"

enum { LINEARISE_COORDINATES = 400 }; /* at most: the cost is cubic */

/* ---- Inputs and outputs ---- */

/* Adds the indices of the names, which end with NULL, each once; `find` returns that of one name. */
static int linearise_find_all (const pw_system *s, const char **name, int *list, int *count,
                               int (*find) (const pw_system *s, const char *name, pw_error *error), pw_error *error) {
  for (; *name; name++) {
    int index = find (s, *name, error), repeated = 0;
    if (index < 0) return index;
    for (int i = 0; i < *count; i++) repeated |= list[i] == index;
    if (!repeated) list[(*count)++] = index;
  }
  return PW_OK;
}

/* Selects inputs and outputs: those named; by default all signals of forces, and all states.  Signals of constraints
 * are refused: their first and second time derivatives would be inputs as well. */
static int linearise_select (pw_linearise_command *cmd, pw_error *error) {
  const pw_system *s = cmd->m.system;
  int states = 2 * pw_system_coordinates (s), signals = pw_system_signals (s);
  cmd->input = malloc (((size_t)signals + 1) * sizeof *cmd->input);
  cmd->output = malloc (((size_t)states + 1) * sizeof *cmd->output);
  if (cmd->input == NULL || cmd->output == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; cmd->input_names == NULL && i < signals; i++)
    if (pw_system_signal_of_force (s, i)) cmd->input[cmd->inputs++] = i;
  for (int i = 0; cmd->output_names == NULL && i < states; i++) cmd->output[cmd->outputs++] = i;
  int status = PW_OK;
  if (cmd->input_names)
    status = linearise_find_all (s, cmd->input_names, cmd->input, &cmd->inputs, pw_system_find_signal, error);
  if (status == PW_OK && cmd->output_names)
    status = linearise_find_all (s, cmd->output_names, cmd->output, &cmd->outputs, pw_system_find_state, error);
  for (int i = 0; i < cmd->inputs && status == PW_OK; i++)
    if (!pw_system_signal_of_force (s, cmd->input[i]))
      status =
          pw_fail (error, PW_INPUT, "--input %s is the signal of a constraint; only signals of forces can be inputs",
                   PW_NAME (pw_system_signal_name, s, cmd->input[i]));
  return status;
}

/* ---- The run ---- */

static int linearise_advance (pw_linearise_command *cmd, pw_error *error) {
  pw_progress progress;
  int status = PW_OK;
  pw_stop_catch ();
  pw_progress_start (&progress, pw_file_name (cmd->m.file), "s", 0, cmd->t);
  while (status == PW_OK && pw_run_time (cmd->r) < cmd->t) {
    status = pw_run_advance (cmd->r, cmd->t, error);
    pw_progress_at (&progress, pw_run_time (cmd->r));
  }
  pw_progress_end (&progress);
  pw_stop_release ();
  return status == PW_STOPPED ? pw_limit_status (&cmd->limit, pw_run_time (cmd->r), error) : status;
}

/* Newton's method from the initial state, then from one to which forces lead; the quantities of --hold are held. */
static int linearise_solve_steady (pw_linearise_command *cmd, pw_steady *steady, pw_error *error) {
  int n = pw_system_coordinates (cmd->m.system);
  pw_steady_motion motion;
  int status = steady ? PW_RETRY : error->status, changes = 0;
  for (int attempt = 0; status == PW_RETRY && attempt < PW_STEADY_NOT_RANDOM && !pw_limit_over (&cmd->limit);
       attempt++) {
    status = pw_steady_solve (steady, attempt, 0 /* no parameter */, &motion, error);
    if (status == PW_OK && motion.linear->steady == PW_CHANGING) status = PW_RETRY, changes = 1;
  }
  if (status == PW_RETRY && pw_limit_over (&cmd->limit)) return pw_limit_status (&cmd->limit, cmd->t, error);
  if (status == PW_RETRY)
    return pw_fail (
        error, PW_METHOD,
        "%s: no steady motion is reached from the initial state: %s; `pinwheel steady` also begins at random states",
        pw_file_name (cmd->m.file),
        changes ? "the solutions found are not steady, as the equations change with time or along the motion"
                : PW_PRINTED (70, "the last residual is %.2g, in units of the scene", motion.residual));
  if (status != PW_OK) return status;
  cmd->initial = malloc (2 * (size_t)n * sizeof *cmd->initial);
  if (cmd->initial == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < 2 * n; i++) cmd->initial[i] = (pw_initial_value){ i, i < n ? motion.q[i] : motion.v[i - n] };
  return PW_OK;
}

static int linearise_find_steady (pw_linearise_command *cmd, double span, pw_error *error) {
  pw_initial_value hold[PW_HOLDS];
  pw_steady_settings set = { .hold = hold, .t = cmd->t, .span = span, .vary = -1 /* none of them */ };
  if (pw_hold_read (cmd->m.system, cmd->hold_texts, hold, &set.holds, error) != PW_OK) return error->status;
  pw_steady *steady = pw_steady_open (cmd->m.system, &set, error);
  int status = linearise_solve_steady (cmd, steady, error);
  pw_steady_close (steady);
  return status;
}

/* Runs the model to the time of --at, and makes the state reached consistent; or opens a run at the steady motion. */
static int linearise_run (pw_linearise_command *cmd, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (cmd->m.file));
  pw_settings settings;
  double t_end;
  if (pw_cli_settings (&cmd->line, &d, &t_end, &settings, &cmd->limit, error) != PW_OK) return error->status;
  settings.span = cmd->steady ? t_end /* after --at: signals are constant in it */ : fmax (t_end, cmd->t);
  pw_limit_start (&cmd->limit);
  if (cmd->steady) {
    if (linearise_find_steady (cmd, settings.span, error) != PW_OK) return error->status;
    settings.t = cmd->t;
    settings.initial = cmd->initial;
    settings.initials = 2 * pw_system_coordinates (cmd->m.system);
  }
  cmd->r = pw_limit_open (cmd->m.system, d.method, &settings, error);
  if (cmd->r == NULL) return error->status;
  if (cmd->steady) return PW_OK;
  int status = pw_report_initial_state (&cmd->m, cmd->limit.seconds, error);
  if (cmd->t == 0 || status != PW_OK) return status;
  pw_cli_report_tables (cmd->m.system, cmd->t);
  status = linearise_advance (cmd, error);
  return status == PW_OK ? pw_run_restart (cmd->r, NULL, NULL, error) : status;
}

static int linearise_compute (pw_linearise_command *cmd, pw_error *error) {
  const char *model = pw_file_name (cmd->m.file);
  int coordinates = pw_system_coordinates (cmd->m.system);
  if (coordinates > LINEARISE_COORDINATES)
    return pw_fail (error, PW_INPUT, "%s has %d coordinates; linearise takes at most %d", model, coordinates,
                    LINEARISE_COORDINATES);
  int status = linearise_run (cmd, error);
  if (status == PW_OK) status = pw_run_linear_modes (cmd->r, LINEARISE_COORDINATES, &cmd->linear, error);
  if (status == PW_OK && cmd->linear.unknowns == 0)
    return pw_fail (error, PW_INPUT, "%s has no degrees of freedom: there is nothing to linearise", model);
  return status;
}

/* ---- Files ---- */

/* Indices in the list of files of linearise_open_files; 0 is the model. */
enum { LINEARISE_JSON = 1, LINEARISE_CSV, LINEARISE_NPZ, LINEARISE_PAGE };

/* Opens NAME.json, .csv, .npz, and the page, before anything is computed. */
static int linearise_open_files (pw_linearise_command *cmd, pw_error *error) {
  enum { PATH = 4096 };
  const char *name = cmd->name, *slash = name ? strrchr (name, '/') : NULL, *last = slash ? slash + 1 : name;
  if (last && (*last == 0 || strcmp (last, ".") == 0 || strcmp (last, "..") == 0 || pw_cli_names_file (last)))
    return pw_fail (error, PW_INPUT, "-o %s: expected a NAME, for NAME.json, NAME.csv and NAME.npz", name);
  if (name && strlen (name) + sizeof ".json" > PATH) return pw_fail (error, PW_INPUT, "-o: the name is too long");
  if (cmd->page_path && pw_animation_check ("--animate", cmd->page_path, error) != PW_OK) return error->status;
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "-o", name ? PW_PRINTED (PATH, "%s.json", name) : NULL, PW_WRITES, NULL },
                   { "-o", name ? PW_PRINTED (PATH, "%s.csv", name) : NULL, PW_WRITES, NULL },
                   { "-o", name ? PW_PRINTED (PATH, "%s.npz", name) : NULL, PW_WRITES, NULL },
                   { "--animate", cmd->page_path, PW_WRITES, NULL } };
  return pw_files_open (&cmd->files, &cmd->line, &cmd->m, use, sizeof use / sizeof *use, error);
}

static int linearise_write (pw_linearise_command *cmd, pw_error *error) {
  int status = PW_OK;
  if (cmd->name) {
    pw_linearise_json (cmd, &(pw_json){ .f = pw_files_stream (&cmd->files, LINEARISE_JSON), .lines = 1 });
    status = pw_linearise_csv (cmd, pw_files_stream (&cmd->files, LINEARISE_CSV), error);
    if (status == PW_OK) status = pw_linearise_npz (cmd, pw_files_stream (&cmd->files, LINEARISE_NPZ), error);
  }
  if (status == PW_OK && cmd->page_path)
    status = pw_linearise_page (cmd, pw_files_stream (&cmd->files, LINEARISE_PAGE), error);
  return status == PW_OK ? pw_files_finish (&cmd->files, error) : status;
}

static int linearise_command (void *options, pw_error *error) {
  pw_linearise_command *cmd = options;
  int status = pw_cli_number ("--at", cmd->t_text, PW_NONNEGATIVE, &cmd->t, error);
  if (status == PW_OK && cmd->hold_texts && !cmd->steady) status = pw_fail (error, PW_INPUT, "--hold needs --steady");
  if (status == PW_OK)
    status = pw_cli_requires ("--limit", cmd->line.limit, "--at or --steady", cmd->t_text || cmd->steady, error);
  if (status == PW_OK) status = pw_cli_open (&cmd->m, &cmd->line, error);
  if (status == PW_OK) status = linearise_select (cmd, error);
  if (status == PW_OK) status = linearise_open_files (cmd, error);
  if (status == PW_OK) pw_report_model (&cmd->m);
  if (status == PW_OK) status = linearise_compute (cmd, error);
  if (status == PW_OK) pw_linearise_print (cmd);
  if (status == PW_OK) status = linearise_write (cmd, error);
  pw_linear_free (&cmd->linear);
  pw_files_close (&cmd->files);
  pw_run_close (cmd->r);
  free (cmd->initial);
  free (cmd->input);
  free (cmd->output);
  pw_cli_close_model (&cmd->m);
  if (status == PW_RETRY) pw_cli_say ("pinwheel: interrupted\n");
  return status == PW_RETRY ? PW_INTERRUPTED : status;
}

static const struct poptOption linearise_options[] = {
  PW_OPTION_GROUP ("Linearisation"),
  PW_TEXT_OPTION (pw_linearise_command, t_text, "at", 0, "T",
                  "At time T [s] of a run with the model's default method (default 0)"),
  PW_FLAG_OPTION (pw_linearise_command, steady, "steady",
                  "At the steady motion that is reached from the initial state; signals are those of --at"),
  PW_HOLD_OPTION (pw_linearise_command, hold_texts),
  PW_LIST_OPTION (pw_linearise_command, input_names, "input", 0, "SIGNAL",
                  "Input u: the signal of a force, ELEMENT or ELEMENT.FIELD; repeatable (default all)"),
  PW_LIST_OPTION (pw_linearise_command, output_names, "output", 0, "STATE",
                  "Output y: a state, BODY.x, .y, .phi, .vx, .vy or .omega; repeatable (default all)"),
  PW_TEXT_OPTION (pw_linearise_command, name, "name", 'o', "NAME",
                  "Write NAME.json (everything), NAME.csv (the matrix [A B; C D]) and NAME.npz for NumPy"),
  PW_TEXT_OPTION (pw_linearise_command, page_path, "animate", 0, "FILE.html",
                  "Write a page in which the modes are animated"),
  PW_LIMIT_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_linearise = {
  .name = "linearise",
  .synopsis = "MODEL [OPTION...]",
  .summary = "linearise a model: matrices, eigenvalues and mode shapes",
  .help = "Linearise the equations of motion in minimal coordinates, which satisfy the constraints, in a frame that "
          "moves with the motion: x' = A x + B u, y = C x + D u. Prints eigenvalues with frequency, damping and time "
          "to double or halve, and mode shapes.",
  .options_size = sizeof (pw_linearise_command),
  .function = linearise_command,
  .options = linearise_options,
};
