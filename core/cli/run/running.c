/* Checkpoints of a run: what they consist of, and going on from one.
 *
 * A checkpoint is saved after the step that reaches a multiple of the interval, when the step's rows are written.  Its
 * table is brought to the disk first, so that a resumed run finds at least what the checkpoint counts on. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "fingerprint.h"
#include "running.h"

/* All that decides what is computed and written. */
static int running_print (pw_running *x, pw_error *error) {
  pw_text *t = &x->check.head;
  const pw_model *m = x->m.model;
  pw_print_line (t, "version", NULL, PW_VERSION);
  if (pw_print_model (t, x->m.file, pw_check_tables (0, m), error) != PW_OK) return error->status;
  pw_print_line (t, "method", NULL, x->method);
  pw_print_number (t, "t-end", NULL, x->t_end);
  pw_print_number (t, "step", NULL, x->settings.step);
  pw_print_number (t, "rtol", NULL, x->settings.rtol);
  pw_print_number (t, "atol", NULL, x->settings.atol);
  for (const pw_parameter *q = pw_model_table (m)->parameters; q && q->name; q++)
    pw_print_number (t, "parameter", q->name, pw_model_parameter (m, q));
  pw_print_starts (t, x->line.starts);
  pw_print_line (t, "table", NULL, x->csv_path ? "written" : "not written");
  pw_print_number (t, "every", NULL, x->every);
  pw_print_line (t, "energy", NULL, x->energy ? "kept" : "not kept");
  pw_print_line (t, "plots", NULL, x->plots_path ? "drawn" : "not drawn");
  pw_print_line (t, "animation", NULL, x->animate_path ? "written" : "not written");
  if (x->reference_path) return pw_print_file (t, "truth", x->reference_path, x->reference_path, error);
  pw_print_line (t, "truth", NULL, "the model's");
  return PW_OK;
}

int pw_running_prepare (pw_running *x, pw_error *error) {
  pw_checkpoints *c = &x->check;
  int status = pw_checkpoints_open (c, x->t_end, error);
  if (status != PW_OK || c->path == NULL) return status;
  if (x->csv_path && strcmp (x->csv_path, "-") == 0)
    return pw_fail (error, PW_INPUT,
                    "--checkpoint: a table on standard output cannot be continued; write it to a file");
  status = pw_checkpoints_reserve (c, error);
  if (status == PW_OK) status = running_print (x, error);
  if (status == PW_OK) status = pw_checkpoints_match (c, error);
  if (status != PW_OK || x->csv_path == NULL) return status;
  pw_mark mark = { 0 };
  if (c->resume == NULL) return pw_output_mark (x->csv_output, &mark, error); /* it must be one that can be continued */
  pw_carry (&c->from.state, &mark, sizeof mark);
  x->csv_output = pw_output_continue (x->csv_path, &mark, error);
  return x->csv_output ? PW_OK : error->status;
}

/* What the program adds to the state of the run. */
static void running_carry (pw_running *x, pw_archive *a) {
  pw_carry (a, &x->row, sizeof x->row);
  pw_carry (a, &x->cpu, sizeof x->cpu);
  if (x->plots) pw_plots_carry (x->plots, a);
  pw_watch_carry (&x->watch, a);
}

/* A checkpoint is within the run, and has the rows up to its time. */
static int running_plausible (const pw_running *x) {
  double t = pw_time (x->r), rows = x->csv && x->every > 0 ? floor (t / x->every) + 1 : (double)x->row;
  return t <= x->t_end && x->row >= 0 && fabs ((double)x->row - rows) <= 1 && isfinite (x->cpu) && x->cpu >= 0;
}

int pw_running_resume (pw_running *x, pw_error *error) {
  pw_checkpoints *c = &x->check;
  char t[32];
  if (c->resume) {
    running_carry (x, &c->from.state);
    if (pw_run_load (x->r, &c->from.state, error) != PW_OK) return error->status;
    if (!running_plausible (x))
      return pw_fail (error, PW_INPUT,
                      "the checkpoint %s is not that of a run: time, number of rows or processor time "
                      "are impossible",
                      c->resume);
    x->resumed = 1;
    pw_cli_say ("pinwheel: resumed at t = %s s\n", pw_format (t, pw_time (x->r), 6));
  }
  pw_checkpoints_pass (c, pw_time (x->r));
  return PW_OK;
}

int pw_running_save (pw_running *x, pw_error *error) {
  pw_checkpoints *c = &x->check;
  double t = pw_time (x->r);
  pw_mark mark = { 0 };
  if (t >= x->t_end) return PW_OK;
  if (x->csv_output && pw_output_mark (x->csv_output, &mark, error) != PW_OK) return error->status;
  pw_archive_clear (&c->state);
  if (x->csv_output) pw_carry (&c->state, &mark, sizeof mark);
  running_carry (x, &c->state);
  int status = pw_run_save (x->r, &c->state, error);
  if (status != PW_OK) return status > 0 ? PW_OK : status;
  pw_checkpoints_pass (c, t);
  return pw_checkpoints_write (c, t, error);
}

void pw_running_hint (const pw_running *x, int stopped) {
  char t[32];
  if (stopped && x->check.saved > 0)
    pw_cli_say ("pinwheel: --resume %s goes on from t = %s s\n", x->check.path, pw_format (t, x->check.saved, 6));
}
