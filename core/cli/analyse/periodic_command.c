/* pinwheel periodic: relative periodic motions, and their branches over a parameter. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "periodic_report.h"
#include "progress.h"
#include "report.h"
#include "util.h"

enum { PERIODIC_MOST = 100000 }; /* periods of the signals in one of the motion */

/* Periods of a run before each attempt. */
static const int periodic_settle[PW_PERIODIC_ATTEMPTS] = { 0, 10, 100 };

/* ---- Options ---- */

static int periodic_period (pw_periodic_cli *x, pw_error *error) {
  double periods = 1;
  x->set.free = x->period_text && strcmp (x->period_text, "free") == 0;
  x->source = x->set.free ? "found" : x->period_text ? "--period" : "of the signals";
  if (x->guess_text && !x->set.free)
    return pw_fail (error, PW_INPUT, "--guess %s: only with --period free", x->guess_text);
  if (x->periods_text && x->period_text)
    return pw_fail (error, PW_INPUT, "--periods %s: not together with --period", x->periods_text);
  int status = pw_cli_number ("--guess", x->guess_text, PW_POSITIVE, &x->set.period, error);
  if (status == PW_OK) status = pw_cli_number ("--periods", x->periods_text, PW_COUNT, &periods, error);
  if (status == PW_OK && !x->set.free)
    status = pw_cli_number ("--period", x->period_text, PW_POSITIVE, &x->set.period, error);
  if (status == PW_OK && periods > PERIODIC_MOST)
    status = pw_fail (error, PW_INPUT, "--periods %s: expected at most %d", x->periods_text, PERIODIC_MOST);
  if (status != PW_OK) return status;
  x->set.periods = (int)periods;
  double signals = pw_system_period (x->m.system);
  if (x->period_text || signals > 0) return PW_OK;
  if (isnan (signals))
    return pw_fail (error, PW_INPUT, "%s: the periods of its signals have no common multiple: give --period T",
                    pw_file_name (x->m.file));
  return pw_fail (
      error, PW_INPUT,
      "%s: no signal has a known period (those of expressions and tables are not known): give --period T, or "
      "--period free if no signal changes with time",
      pw_file_name (x->m.file));
}

static int periodic_options (pw_periodic_cli *x, pw_error *error) {
  pw_settings settings = { .rtol = 0 };
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  d.rtol = 1e-12;
  double t_end;
  int status = pw_cli_settings (&x->line, &d, &t_end, &settings, &x->limit, error);
  x->set.method = x->line.method ? x->line.method : "erk8+projection";
  x->set.rtol = settings.rtol;
  x->vary.name = x->vary.unit = "";
  x->set.stop = pw_limit_over, x->set.stop_context = &x->limit;
  if (status == PW_OK) status = periodic_period (x, error);
  if (status != PW_OK || x->vary_text == NULL) return status;
  if (pw_vary_read (&x->vary, &x->line, &x->m, x->vary_text, error) != PW_OK) return PW_INPUT;
  x->set.first = x->vary.first, x->set.last = x->vary.last;
  x->set.compile = pw_vary_compile;
  x->set.context = &x->vary;
  return x->vary.parameter ? PW_OK : pw_model_set (x->m.model, x->vary.name, x->set.first, error);
}

/* ---- The search ---- */

static int periodic_stop (pw_periodic_cli *x) {
  return x->stopped |= pw_limit_over (&x->limit) != 0;
}

static int periodic_add (pw_periodic_cli *x, const pw_periodic_orbit *o, pw_error *error) {
  size_t n = (size_t)pw_system_coordinates (x->m.system), k = (size_t)o->multipliers;
  int status = pw_grow (&x->point, (size_t)x->points, &x->room, sizeof *x->point);
  double *a = status == PW_OK ? malloc ((4 * n + 2 * k + 1) * sizeof *a) : NULL;
  if (a == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  pw_periodic_point *p = x->point + x->points++;
  *p = (pw_periodic_point){ .orbit = *o, .state = a };
  memcpy (a, o->q, n * sizeof *a);
  memcpy (a + n, o->v, n * sizeof *a);
  memcpy (a + 2 * n, o->end, 2 * n * sizeof *a);
  memcpy (a + 4 * n, o->re, k * sizeof *a);
  memcpy (a + 4 * n + k, o->im, k * sizeof *a);
  p->orbit.q = a, p->orbit.v = a + n, p->orbit.end = a + 2 * n, p->orbit.re = a + 4 * n, p->orbit.im = a + 4 * n + k;
  return PW_OK;
}

static int periodic_find (pw_periodic_cli *x, pw_periodic_orbit *o, pw_error *error) {
  pw_progress progress;
  double best = INFINITY;
  int status = PW_RETRY;
  pw_progress_count (&progress, pw_file_name (x->m.file), "attempts", 0, PW_PERIODIC_ATTEMPTS);
  for (int k = 0; status == PW_RETRY && k < PW_PERIODIC_ATTEMPTS && !periodic_stop (x); k++) {
    status = pw_periodic_solve (x->search, periodic_settle[k], x->set.first, o, error);
    x->nearest[k] = o->residual;
    if (o->residual <= best) snprintf (x->reason, sizeof x->reason, "%s", pw_periodic_reason (x->search));
    best = fmin (best, o->residual);
    pw_progress_at (&progress, k + 1);
  }
  pw_progress_end (&progress);
  return status;
}

static int periodic_fail (const pw_periodic_cli *x, pw_error *error) {
  char period[60] = "a free period", tried[200] = "";
  double T = x->set.period > 0 ? x->set.period : x->set.periods * pw_system_period (x->m.system);
  if (!x->set.free) snprintf (period, sizeof period, "period %.9g s", T);
  for (int k = 0; k < PW_PERIODIC_ATTEMPTS; k++) {
    size_t used = strlen (tried);
    snprintf (tried + used, sizeof tried - used, isfinite (x->nearest[k]) ? "%s%d (%.2g)" : "%s%d (not begun)",
              k ? ", " : "", periodic_settle[k], x->nearest[k]);
  }
  return pw_fail (
      error, PW_METHOD,
      "%s: no periodic motion with %s found by Newton's method from the states after this many periods (where it "
      "ends at a residual in units of the scene, L and L/T): %s%s%s; begin nearer to one (--start)%s",
      pw_file_name (x->m.file), period, tried, *x->reason ? "; " : "", x->reason,
      x->set.free ? ", or give --guess"
                  : ", or add losses if the motion grows in every period, as that of a vehicle without any");
}

/* Follows the branch to the end of the range. */
static int periodic_branch (pw_periodic_cli *x, pw_error *error) {
  pw_periodic_orbit o;
  pw_progress progress = { .title = NULL };
  pw_vary_progress (&x->vary, &progress, x->set.first, x->set.first, x->set.last);
  int status = pw_periodic_follow (x->search, 1, error);
  while (status == PW_OK && !periodic_stop (x)) {
    status = pw_periodic_next (x->search, &o, error);
    if (status != PW_OK || o.event == PW_PERIODIC_END) break;
    status = periodic_add (x, &o, error);
    pw_vary_progress (&x->vary, &progress, x->set.first, o.parameter, x->set.last);
  }
  pw_progress_end (&progress);
  periodic_stop (x);
  return status;
}

static int periodic_compute (pw_periodic_cli *x, pw_error *error) {
  pw_periodic_orbit o;
  pw_limit_start (&x->limit);
  x->search = pw_periodic_open (x->m.system, &x->set, error);
  if (x->search == NULL) return error->status;
  pw_stop_catch ();
  int status = periodic_find (x, &o, error);
  if (status == PW_RETRY && !periodic_stop (x)) status = periodic_fail (x, error);
  if (status == PW_OK) status = x->vary_text ? periodic_branch (x, error) : periodic_add (x, &o, error);
  pw_stop_release ();
  return status == PW_RETRY ? PW_OK : status;
}

/* ---- The command ---- */

static int periodic_command (void *options, pw_error *error) {
  pw_periodic_cli *x = options;
  int status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = periodic_options (x, error);
  if (status == PW_OK) status = pw_figure_results (&x->line, &x->m, x->folder, "periodic", &x->files, error);
  if (status == PW_OK) pw_report_model (x->m.model);
  if (status == PW_OK) status = periodic_compute (x, error);
  if (status == PW_OK && x->points) pw_periodic_print (x);
  if (status == PW_OK && x->points && x->folder) status = pw_periodic_write (x, error);
  pw_files_close (&x->files);
  for (int i = 0; i < x->points; i++) free (x->point[i].state);
  free (x->point);
  pw_periodic_close (x->search);
  pw_cli_close_model (&x->m);
  return status == PW_OK && x->stopped ? pw_cli_incomplete (&x->line, error) : status;
}

static const struct poptOption periodic_options_table[] = {
  PW_OPTION_GROUP ("Periodic motions"),
  PW_TEXT_OPTION (pw_periodic_cli, period_text, "period", 0, "T|free",
                  "Period [s] (default that of the signals); free: sought, if no signal changes with time"),
  PW_TEXT_OPTION (pw_periodic_cli, periods_text, "periods", 0, "N",
                  "Repeat after N periods of the signals (default 1)"),
  PW_TEXT_OPTION (pw_periodic_cli, guess_text, "guess", 0, "T",
                  "Begin with this free period [s] (default: after which the motion returns)"),
  PW_TEXT_OPTION (pw_periodic_cli, vary_text, "vary", 0, "PARAM=FIRST:LAST", "Follow the motion over a parameter"),
  PW_TEXT_OPTION (pw_periodic_cli, folder, "output", 'o', "DIR",
                  "Write periodic.csv, periodic.json and a figure into a folder"),
  PW_WIDTH_OPTION,
  PW_TEXT_OPTION (pw_cli_line, method, "method", 'm', "METHOD", "Adaptive integrator (default erk8+projection)"),
  PW_TEXT_OPTION (pw_cli_line, rtol, "rtol", 0, "R", "Relative tolerance (default 1e-12)"),
  PW_TEXT_OPTION (pw_cli_line, limit, "limit", 0, "SECONDS", "Stop after this much processor time (default unlimited)"),
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
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_periodic_cli),
  .function = periodic_command,
  .options = periodic_options_table,
};
