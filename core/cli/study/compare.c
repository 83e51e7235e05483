/* pinwheel compare: what accuracy costs.  One model by several methods, each over a ladder of tolerances or steps,
 * against the truth: a row for each rung, failures included. */
#include <math.h>
#include <stdlib.h>
#include <unistd.h>
#include "compare.h"
#include "figure.h"
#include "stop.h"
#include "text.h"

/* ---- Before it begins ---- */

/* The table is written as rows come, under the name it keeps if something stops it. */
static int compare_open_csv (pw_compare *x, pw_error *error) {
  static const char *const names[] = { ".dat", ".gp", ".svg", ".png", "compare.csv", "truth.csv", NULL };
  char path[FIGURE_PATH];
  if (x->folder == NULL) return PW_OK;
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--truth", x->truth_path, PW_READS, NULL },
                   { "-o", x->folder, PW_WRITES_INTO, names } };
  if (pw_cli_uses (&x->line, x->m.file, use, sizeof use / sizeof *use, error) != PW_OK) return error->status;
  x->lock = pw_figure_folder (x->folder, error);
  if (x->lock < 0) return error->status;
  snprintf (path, sizeof path, "%s/compare.csv", x->folder);
  x->csv = pw_output_open (path, error);
  return x->csv ? pw_compare_csv_head (x, error) : error->status;
}

static int compare_open (pw_compare *x, pw_error *error) {
  int status = pw_cli_open (&x->m, &x->line, error);
  if (status != PW_OK) return status;
  x->t_end = pw_cli_defaults (pw_file_table (x->m.file)).t_end;
  x->limit = 10;
  x->repeats = 9;
  status = pw_cli_number ("--t-end", x->line.t_end, PW_POSITIVE, &x->t_end, error);
  if (status == PW_OK) status = pw_cli_number ("--limit", x->line.limit, PW_POSITIVE, &x->limit, error);
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
  char part[FIGURE_PATH + 16] = "";
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
    pw_text_abandon (x->csv, x->rows, (char[FIGURE_PATH + 16]){ 0 }, FIGURE_PATH + 16);
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
  free (x->row);
  pw_contestants_close (&x->list);
}

static int compare_command (void *options, pw_error *error) {
  pw_compare *x = options;
  x->lock = -1;
  int status = compare_open (x, error);
  if (status == PW_OK) status = compare_run (x, error);
  status = compare_finish (x, status, error);
  if (status == PW_OK) status = compare_verdict (x, error);
  compare_close (x);
  return status == PW_INTERRUPTED ? status : error->status;
}

static const struct poptOption compare_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_TEXT_OPTION (pw_compare, methods_text, "methods", 'm', "A,B,...|all",
                  "Methods, separated by commas; all: every integrator with every stabilisation (default)"),
  PW_TEXT_OPTION (pw_compare, rtol_text, "rtol-ladder", 0, "FROM:TO",
                  "Tolerances of adaptive methods, by decades (default 1e-3:1e-12)"),
  PW_TEXT_OPTION (pw_compare, step_text, "step-ladder", 0, "FROM:TO",
                  "Step sizes of fixed-step methods [s], halved each time (default 0.1:1e-4)"),
  PW_TEXT_OPTION (pw_cli_line, limit, "limit", 0, "SECONDS",
                  "Processor time of a single run; runs expected to take longer are skipped (default 10)"),
  PW_TEXT_OPTION (
      pw_compare, repeats_text, "repeats", 0, "N",
      "Timed repetitions of each run, at most 99, of which the median is reported (default 9, or those that "
      "fit into half a second)"),
  PW_TEXT_OPTION (pw_cli_line, t_end, "t-end", 't', "T", "Final time [s]"),
  PW_TEXT_OPTION (
      pw_compare, truth_path, "truth", 0, "FILE.csv",
      "Measure errors against this table, with columns as in run -o, instead of the model's exact solution or a "
      "computed reference"),
  PW_TEXT_OPTION (pw_compare, folder, "output", 'o', "DIR", "Write tables and work-precision diagrams into a folder"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_compare = {
  .name = "compare",
  .synopsis = "MODEL [OPTION...]",
  .summary = "compare the accuracy and cost of methods against a reference solution",
  .help = "Run a model by several methods, each with a ladder of tolerances or step sizes, and compare their errors "
          "against "
          "a reference solution with their processor times.",
  .least = 1,
  .most = 1,
  .size = sizeof (pw_compare),
  .function = compare_command,
  .options = compare_options,
};
