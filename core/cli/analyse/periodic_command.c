/* The command `periodic`: relative periodic motions, and their branches over a parameter. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "periodic_report.h"
#include "report.h"

enum { PERIODIC_PERIODS = 100000 }; /* of the signals in one period of the motion, at most */
#define PERIODIC_LEAST 1e-100       /* shortest period that is sought [s] */

/* Periods of the run that precedes each attempt, in which the motion approaches a stable periodic one. */
static const int periodic_settling[] = { 0, 10, 100 };
_Static_assert(sizeof periodic_settling / sizeof *periodic_settling == PW_PERIODIC_ATTEMPTS, "one for each attempt");

/* ---- Options ---- */

static int periodic_read_period (pw_periodic_command *cmd, pw_error *error) {
  double periods = 1;
  cmd->settings.free = cmd->period_text && strcmp (cmd->period_text, "free") == 0;
  cmd->source = cmd->settings.free ? "found" : cmd->period_text ? "--period" : "of the signals";
  if (cmd->guess_text && !cmd->settings.free)
    return pw_fail (error, PW_INPUT, "--guess %s: only with --period free", cmd->guess_text);
  if (cmd->periods_text && cmd->period_text)
    return pw_fail (error, PW_INPUT, "--periods %s: not together with --period", cmd->periods_text);
  int status = pw_cli_number ("--guess", cmd->guess_text, PW_POSITIVE, &cmd->settings.period, error);
  if (status == PW_OK) status = pw_cli_number ("--periods", cmd->periods_text, PW_COUNT, &periods, error);
  if (status == PW_OK && !cmd->settings.free)
    status = pw_cli_number ("--period", cmd->period_text, PW_POSITIVE, &cmd->settings.period, error);
  if (status == PW_OK && cmd->settings.period > 0 && cmd->settings.period < PERIODIC_LEAST)
    status = pw_fail (error, PW_INPUT, "%s: expected at least %g s", cmd->guess_text ? "--guess" : "--period",
                      PERIODIC_LEAST);
  if (status == PW_OK && periods > PERIODIC_PERIODS)
    status = pw_fail (error, PW_INPUT, "--periods %s: expected at most %d", cmd->periods_text, PERIODIC_PERIODS);
  if (status != PW_OK) return status;
  cmd->settings.periods = (int)periods;
  double period = pw_system_period (cmd->m.system);
  if (cmd->period_text || cmd->vary_text || period > 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s: %s", pw_file_name (cmd->m.file),
                  isnan (period) ? "the periods of its signals have no common multiple: give --period T"
                                 : "no signal has a known period (those of expressions and tables are not known): "
                                   "give --period T, or --period free if no signal changes with time");
}

static int periodic_read_options (pw_periodic_command *cmd, pw_error *error) {
  pw_settings settings = { .rtol = 0 };
  pw_run_defaults d = pw_cli_defaults (pw_file_table (cmd->m.file));
  d.rtol = 1e-12;
  double t_end;
  int status = pw_cli_settings (&cmd->line, &d, &t_end, &settings, &cmd->limit, error);
  cmd->settings.method = cmd->line.method ? cmd->line.method : "erk8+projection";
  cmd->settings.rtol = settings.rtol;
  cmd->vary.name = cmd->vary.unit = "";
  cmd->settings.stop = pw_limit_over, cmd->settings.stop_context = &cmd->limit;
  if (status == PW_OK) status = periodic_read_period (cmd, error);
  if (status != PW_OK || cmd->vary_text == NULL) return status;
  if (pw_vary_read (&cmd->vary, &cmd->line, &cmd->m, cmd->vary_text, error) != PW_OK) return PW_INPUT;
  cmd->settings.first = cmd->vary.first, cmd->settings.last = cmd->vary.last;
  cmd->settings.compile = pw_vary_compile, cmd->settings.context = &cmd->vary;
  if (cmd->vary.parameter == NULL) /* fails with the nearest name */
    return pw_model_set (cmd->m.model, cmd->vary.name, cmd->settings.first, error);
  return PW_OK;
}

/* ---- The search ---- */

static int periodic_set_stopped (pw_periodic_command *cmd) {
  return cmd->stopped |= pw_limit_over (&cmd->limit) != 0;
}

static int periodic_add (pw_periodic_command *cmd, const pw_periodic_orbit *o, pw_error *error) {
  const size_t n = (size_t)pw_system_coordinates (cmd->m.system), multipliers = (size_t)o->multipliers;
  int status = pw_grow (&cmd->point, (size_t)cmd->points, &cmd->room, sizeof *cmd->point);
  double *at = status == PW_OK ? malloc ((4 * n + 2 * multipliers + 1) * sizeof *at) : NULL;
  if (at == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  pw_periodic_point *p = cmd->point + cmd->points++;
  *p = (pw_periodic_point){ .orbit = *o, .state = at };
  p->orbit.q = memcpy (at, o->q, n * sizeof *at);
  p->orbit.v = memcpy (at += n, o->v, n * sizeof *at);
  p->orbit.end = memcpy (at += n, o->end, 2 * n * sizeof *at);
  p->orbit.re = memcpy (at += 2 * n, o->re, multipliers * sizeof *at);
  p->orbit.im = memcpy (at + multipliers, o->im, multipliers * sizeof *at);
  return PW_OK;
}

/* Finds a periodic motion by one of the attempts.  PW_RETRY if none succeeds or the search is stopped. */
static int periodic_find (pw_periodic_command *cmd, pw_periodic_orbit *o, pw_error *error) {
  pw_progress progress;
  double best = INFINITY;
  int status = PW_RETRY;
  pw_progress_start (&progress, pw_file_name (cmd->m.file), "attempts", 0, PW_PERIODIC_ATTEMPTS);
  for (int k = 0; status == PW_RETRY && k < PW_PERIODIC_ATTEMPTS && !periodic_set_stopped (cmd); k++) {
    status = pw_periodic_solve (cmd->search, periodic_settling[k], cmd->settings.first, o, error);
    cmd->residual[k] = o->residual;
    if (o->residual <= best) snprintf (cmd->reason, sizeof cmd->reason, "%s", pw_periodic_reason (cmd->search));
    best = fmin (best, o->residual);
    pw_progress_at (&progress, k + 1);
  }
  pw_progress_end (&progress);
  return status;
}

/* The error if no attempt succeeded. */
static int periodic_fail (pw_periodic_command *cmd, pw_error *error) {
  char period[60] = "a free period", tried[200] = "";
  pw_error ignored = { 0 };
  pw_system *first = cmd->vary_text ? pw_vary_compile (&cmd->vary, cmd->settings.first, &ignored) : NULL;
  double signals = pw_system_period (first ? first : cmd->m.system);
  double T = cmd->settings.period > 0 ? cmd->settings.period : cmd->settings.periods * signals;
  pw_system_free (first);
  if (!cmd->settings.free) snprintf (period, sizeof period, "period %.9g s", T);
  for (int k = 0; k < PW_PERIODIC_ATTEMPTS; k++) {
    size_t used = strlen (tried);
    snprintf (tried + used, sizeof tried - used, isfinite (cmd->residual[k]) ? "%s%d (%.2g)" : "%s%d (not begun)",
              k ? ", " : "", periodic_settling[k], cmd->residual[k]);
  }
  return pw_fail (
      error, PW_METHOD,
      "%s: no periodic motion with %s found: Newton's method, begun after this many periods of a run, ends at this "
      "residual (in units of the scene, L and L/T): %s%s%s; begin nearer to one (--start)%s",
      pw_file_name (cmd->m.file), period, tried, *cmd->reason ? "; " : "", cmd->reason,
      cmd->settings.free ? ", or give --guess"
                         : ", or add losses if the motion grows in every period, as that of a vehicle without any");
}

/* Follows the branch from the first to the last value of the range, and adds its points. */
static int periodic_follow (pw_periodic_command *cmd, pw_error *error) {
  pw_periodic_orbit o;
  pw_progress progress = { .title = NULL };
  pw_vary_progress (&cmd->vary, &progress, cmd->settings.first, cmd->settings.first, cmd->settings.last);
  int status = pw_periodic_follow (cmd->search, 1, error); /* towards the last value */
  while (status == PW_OK && !periodic_set_stopped (cmd)) {
    status = pw_periodic_next (cmd->search, &o, error);
    if (status != PW_OK || o.event == PW_PERIODIC_END) break;
    status = periodic_add (cmd, &o, error);
    pw_vary_progress (&cmd->vary, &progress, cmd->settings.first, o.parameter, cmd->settings.last);
  }
  pw_progress_end (&progress);
  if (!periodic_set_stopped (cmd) || status != PW_METHOD) return status;
  *error = (pw_error){ .status = PW_OK }; /* the limit or Ctrl-C prevented the first step */
  return PW_OK;
}

static int periodic_compute (pw_periodic_command *cmd, pw_error *error) {
  pw_periodic_orbit o;
  pw_limit_start (&cmd->limit);
  cmd->search = pw_periodic_open (cmd->m.system, &cmd->settings, error);
  if (cmd->search == NULL && error->status == PW_METHOD && periodic_set_stopped (cmd)) *error = (pw_error){ 0 };
  if (cmd->search == NULL) return error->status;
  pw_stop_catch ();
  int status = periodic_find (cmd, &o, error);
  if (status == PW_RETRY && !periodic_set_stopped (cmd)) status = periodic_fail (cmd, error);
  if (status == PW_OK) status = cmd->vary_text ? periodic_follow (cmd, error) : periodic_add (cmd, &o, error);
  pw_stop_release ();
  return status == PW_RETRY ? PW_OK : status;
}

/* ---- The command ---- */

static int periodic_command (void *options, pw_error *error) {
  pw_periodic_command *cmd = options;
  int status = pw_cli_open (&cmd->m, &cmd->line, error);
  if (status == PW_OK) status = periodic_read_options (cmd, error);
  if (status == PW_OK)
    status = pw_figure_lock_folder (&cmd->line, &cmd->m, cmd->folder, "periodic", &cmd->files, error);
  if (status == PW_OK) pw_report_model (&cmd->m), pw_cli_report_tables (cmd->m.system, cmd->settings.period);
  if (status == PW_OK) status = periodic_compute (cmd, error);
  if (status == PW_OK && cmd->points) pw_periodic_print (cmd);
  if (status == PW_OK && cmd->points && cmd->folder) status = pw_periodic_write (cmd, error);
  pw_files_close (&cmd->files);
  for (int i = 0; i < cmd->points; i++) free (cmd->point[i].state);
  free (cmd->point);
  pw_periodic_close (cmd->search);
  pw_cli_close_model (&cmd->m);
  return status == PW_OK && cmd->stopped ? pw_cli_incomplete (&cmd->line, error) : status;
}

static const struct poptOption periodic_options_table[] = {
  PW_OPTION_GROUP ("Periodic motions"),
  PW_TEXT_OPTION (pw_periodic_command, period_text, "period", 0, "T|free",
                  "Period [s] (default that of the signals); free: sought, if no signal changes with time"),
  PW_TEXT_OPTION (pw_periodic_command, periods_text, "periods", 0, "N",
                  "Repeat after N periods of the signals (default 1)"),
  PW_TEXT_OPTION (pw_periodic_command, guess_text, "guess", 0, "T",
                  "First guess of a free period [s] (default: the time of the first return)"),
  PW_TEXT_OPTION (pw_periodic_command, vary_text, "vary", 0, "PARAM=FIRST:LAST", "Follow the motion over a parameter"),
  PW_TEXT_OPTION (pw_periodic_command, folder, "output", 'o', "DIR",
                  "Write periodic.csv, periodic.json and a figure into a folder"),
  PW_WIDTH_OPTION,
  PW_TEXT_OPTION (pw_cli_line, method, "method", 'm', "METHOD", "Adaptive integrator (default erk8+projection)"),
  PW_TEXT_OPTION (pw_cli_line, rtol, "rtol", 0, "R", "Relative tolerance (default 1e-12)"),
  PW_LIMIT_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_periodic = {
  .name = "periodic",
  .synopsis = "MODEL [OPTION...]",
  .summary = "find periodic motions, and follow them over a parameter",
  .help = "Find a motion that repeats after one period but for a displacement in the plane, such as a gait, with the "
          "displacement per period and Floquet multipliers, which say how perturbations change in one period; with "
          "--vary, follow it over a parameter.",
  .options_size = sizeof (pw_periodic_command),
  .function = periodic_command,
  .options = periodic_options_table,
};
