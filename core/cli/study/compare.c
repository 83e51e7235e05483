/* pinwheel compare: what accuracy costs.  One model by several methods, each over a ladder of tolerances or steps,
 * against the truth: a row for each rung, failures included. */
#include <math.h>
#include <stdlib.h>
#include <unistd.h>
#include "compare.h"
#include "plot.h"
#include "stop.h"
#include "text.h"

/* ---- Before it begins ---- */

static int compare_read (pw_compare *x, int argc, const char **argv, pw_error *error) {
  const struct poptOption options[] = {
    { "methods", 'm', POPT_ARG_STRING, &x->methods_text, 0,
      "Methods, separated by commas; all: every integrator with every stabilisation (default)", "A,B,...|all" },
    { "rtol-ladder", 0, POPT_ARG_STRING, &x->rtol_text, 0,
      "Tolerances of adaptive methods, by decades (default 1e-3:1e-12)", "FROM:TO" },
    { "step-ladder", 0, POPT_ARG_STRING, &x->step_text, 0, "Steps of the others [s], by halves (default 0.1:1e-4)",
      "FROM:TO" },
    { "limit", 0, POPT_ARG_STRING, &x->limit_text, 0,
      "Processor time a single run may take [s]; what would take longer is not run (default 10)", "SECONDS" },
    { "repeats", 0, POPT_ARG_STRING, &x->repeats_text, 0,
      "Runs of each rung on the clock, of which the median counts, at most 99 (default 9); half a second of them is "
      "enough",
      "N" },
    { "t-end", 't', POPT_ARG_STRING, &x->t_end_text, 0, "Time to run to [s]", "T" },
    PW_CLI_MODEL_OPTIONS (&x->sets, &x->starts),
    { "truth", 0, POPT_ARG_STRING, &x->truth_path, 0,
      "Take errors against this table, with columns as run writes them, instead of the model's own truth or one made "
      "by methods",
      "FILE.csv" },
    { "output", 'o', POPT_ARG_STRING, &x->folder, 0, "Write tables and work-precision diagrams into a folder", "DIR" },
    POPT_TABLEEND,
  };
  return pw_cli_read (&x->line, argc, argv, options, "MODEL [OPTION...]", 1, 1, error);
}

/* The table is written as rows come, under the name it keeps if something stops it. */
static int compare_open_csv (pw_compare *x, pw_error *error) {
  static const char *const names[] = { ".dat", ".gp", ".svg", ".png", "compare.csv", "truth.csv", NULL };
  char path[PLOT_PATH];
  if (x->folder == NULL) return PW_OK;
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--truth", x->truth_path, PW_READS, NULL },
                   { "-o", x->folder, PW_WRITES_INTO, names } };
  if (pw_cli_uses (&x->line, x->m.file, use, sizeof use / sizeof *use, error) != PW_OK) return error->status;
  x->lock = pw_plot_folder (x->folder, error);
  if (x->lock < 0) return error->status;
  snprintf (path, sizeof path, "%s/compare.csv", x->folder);
  x->csv = pw_output_open (path, error);
  return x->csv ? pw_compare_csv_head (x, error) : error->status;
}

static int compare_open (pw_compare *x, pw_error *error) {
  int status = pw_cli_open (&x->m, &x->line, (const char *const *)x->sets, (const char *const *)x->starts, error);
  if (status != PW_OK) return status;
  x->t_end = pw_cli_defaults (pw_file_table (x->m.file)).t_end;
  x->limit = 10;
  x->repeats = 9;
  status = pw_cli_number ("--t-end", x->t_end_text, PW_POSITIVE, &x->t_end, error);
  if (status == PW_OK) status = pw_cli_number ("--limit", x->limit_text, PW_POSITIVE, &x->limit, error);
  if (status == PW_OK) status = pw_cli_number ("--repeats", x->repeats_text, PW_COUNT, &x->repeats, error);
  if (status == PW_OK && x->repeats > COMPARE_REPEATS)
    return pw_fail (error, PW_INPUT, "--repeats %s: at most %d", x->repeats_text, COMPARE_REPEATS);
  if (status == PW_OK) status = pw_compare_methods (x, error);
  return status == PW_OK ? compare_open_csv (x, error) : status;
}

/* ---- Rows ---- */

/* What the next rung will take, from those before: each halving doubles; what a decade costs more is learnt from the
 * last one, or guessed for a method of order 5. */
static double compare_predict (const pw_compare *x, int first, int adaptive) {
  const pw_rung *last = &x->row[x->rows - 1];
  if (x->rows == first || last->state == COMPARE_FAILED || last->state == COMPARE_REFUSED) return 0;
  if (last->state != COMPARE_DONE) return INFINITY;
  if (!adaptive) return 2 * last->cpu;
  if (x->rows < first + 2 || last[-1].state != COMPARE_DONE) return 1.6 * last->cpu;
  return fmax (last->cpu / last[-1].cpu, 1) * last->cpu;
}

static void compare_too_slow (const pw_compare *x, pw_rung *r, double predicted) {
  char limit[32], about[60] = "";
  for (int i = 0; i < MOTION_ERRORS; i++) r->error[i] = NAN;
  r->state = COMPARE_SLOW;
  if (isfinite (predicted)) snprintf (about, sizeof about, ", about %.2g s", predicted);
  snprintf (r->reason, sizeof r->reason, "too slow%s; the limit is %s s", about, pw_format (limit, x->limit, 4));
}

/* The rungs of a method. */
static int compare_ladder (pw_compare *x, const pw_contestant *method, pw_motion *scratch, pw_error *error) {
  int first = x->rows, status = PW_OK;
  double rung;
  for (int k = 0; status == PW_OK && (rung = pw_compare_rung (&x->ladder[method->adaptive], method->adaptive, k)) > 0;
       k++) {
    pw_rung *r = &x->row[x->rows];
    double predicted = compare_predict (x, first, method->adaptive);
    *r = (pw_rung){ .method = method, .rung = rung };
    if (predicted > x->limit)
      compare_too_slow (x, r, predicted);
    else
      status = pw_compare_row (x, r, scratch, error);
    if (status != PW_OK) break;
    r->order = pw_compare_order (x, r, x->rows - first);
    x->rows++;
    pw_progress_end (&x->progress);
    pw_compare_line (x, r, stdout);
    fflush (stdout);
    if (x->csv) status = pw_compare_csv_line (x, r, error);
  }
  return status;
}

static int compare_rows (pw_compare *x, pw_error *error) {
  pw_motion scratch;
  int status = pw_motion_open (&scratch, x->m.system, x->truth.known ? x->truth.motion.samples : MOTION_SAMPLES, error);
  if (status != PW_OK) return status;
  pw_motion_times (&scratch, x->t_end);
  for (int k = 0; x->truth.known && k < scratch.samples; k++) scratch.t[k] = x->truth.motion.t[k];
  pw_compare_truth_line (x, stdout);
  fputc ('\n', stdout);
  pw_compare_head (x, stdout);
  pw_progress_count (&x->progress, pw_file_name (x->m.file), "rows", 0, x->rungs);
  for (int i = 0; status == PW_OK && i < x->list.count; i++)
    status = compare_ladder (x, &x->list.method[i], &scratch, error);
  pw_progress_end (&x->progress);
  pw_motion_close (&scratch);
  return status;
}

static int compare_run (pw_compare *x, pw_error *error) {
  pw_stop_catch ();
  int status = pw_truth_find (x, error);
  if (status == PW_OK && x->folder) status = pw_compare_csv_truth (x, error);
  if (status == PW_OK) status = compare_rows (x, error);
  pw_stop_release ();
  return status;
}

/* ---- After it ---- */

static int compare_interrupted (pw_compare *x) {
  char part[PLOT_PATH + 16] = "";
  if (x->csv) pw_text_abandon (x->csv, x->rows, part, sizeof part);
  if (x->rows == 0)
    fputs ("pinwheel: interrupted before the first row was done\n", stderr);
  else
    pw_cli_say ("pinwheel: interrupted; %d of %d rows are done%s%s\n", x->rows, x->rungs, *part ? ", and kept in " : "",
                part);
  return PW_INTERRUPTED;
}

/* Diagrams are drawn of the rows there are. */
static int compare_finish (pw_compare *x, int status, pw_error *error) {
  if (status == PW_RETRY && pw_stop) return compare_interrupted (x);
  if (x->csv == NULL) return status;
  if (status != PW_OK) {
    pw_text_abandon (x->csv, x->rows, (char[PLOT_PATH + 16]){ 0 }, PLOT_PATH + 16);
    return status;
  }
  pw_output *csv = x->csv;
  x->csv = NULL;
  status = pw_output_finish (csv, error);
  return status == PW_OK ? pw_compare_plot (x, error) : status;
}

/* A comparison in which nothing has worked is a failure. */
static int compare_verdict (const pw_compare *x, pw_error *error) {
  const pw_rung *failed = NULL;
  for (int i = 0; i < x->rows; i++) {
    if (x->row[i].state == COMPARE_DONE) return PW_OK;
    if (x->row[i].state == COMPARE_FAILED || x->row[i].state == COMPARE_REFUSED) failed = &x->row[i];
  }
  return failed ? pw_fail (error, PW_METHOD, "no method has reached the end; the last of them: %s", failed->reason)
                : pw_fail (error, PW_METHOD, "no method has reached the end within the limit; see --limit");
}

static void compare_close (pw_compare *x) {
  if (x->lock >= 0) close (x->lock);
  pw_truth_close (&x->truth);
  pw_cli_close_model (&x->m);
  pw_cli_close (&x->line);
  free (x->row);
  pw_contestants_close (&x->list);
}

int pw_cli_compare (int argc, const char **argv) {
  pw_compare x = { .lock = -1 };
  pw_error error = { 0 };
  int status = compare_read (&x, argc, argv, &error);
  if (status == PW_OK) {
    status = compare_open (&x, &error);
    if (status == PW_OK) status = compare_run (&x, &error);
    status = compare_finish (&x, status, &error);
    if (status == PW_OK) status = compare_verdict (&x, &error);
  }
  compare_close (&x);
  return status == PW_INTERRUPTED ? status : pw_cli_end (&error);
}
