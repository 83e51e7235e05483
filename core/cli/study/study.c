/* Common parts of compare and drift; see study.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "figure.h"
#include "study.h"

#define STUDY_SHORT 0.005 /* batches of steps that took less CPU time [s] become longer */
#define STUDY_LONG 0.02   /* and those that took more become shorter */

/* ---- A run ---- */

/* In batches, so that clocks are read seldom. */
static int study_steps (pw_study *x, pw_row *r, pw_run *run, pw_study_visitor *v, pw_error *error) {
  int status = PW_OK;
  long batch = 8;
  while (status == PW_OK && pw_run_time (run) < x->t_end) {
    double start = pw_cpu_clock ();
    long n = 0;
    do {
      status = pw_run_advance (run, x->t_end, error);
      if (status == PW_OK && v && pw_run_time (run) >= v->due) status = v->visit (v, run, error);
    } while (status == PW_OK && ++n < batch && pw_run_time (run) < x->t_end);
    double used = pw_cpu_clock () - start;
    r->cpu += used;
    if (used < STUDY_SHORT && n == batch && batch < 65536) batch *= 2;
    if (used > STUDY_LONG && batch > 1) batch /= 2;
    pw_progress_at (&x->progress, x->done + x->share * fmin (pw_run_time (run) / x->t_end, 1));
    if (status == PW_STOPPED) return pw_limit_fail (&x->limit, pw_run_time (run), error);
    if (status == PW_OK && r->cpu > x->cpu_end && pw_run_time (run) < x->t_end) {
      r->state = ROW_STOPPED;
      return PW_RETRY;
    }
  }
  return status;
}

int pw_study_run (pw_study *x, pw_row *r, pw_study_visitor *v, pw_error *error) {
  r->cpu = 0;
  pw_limit_start (&x->limit);
  pw_run *run = pw_run_open (x->m.system, r->method, &x->settings, error);
  if (run == NULL) return error->status;
  int status = study_steps (x, r, run, v, error);
  r->t = pw_run_time (run);
  r->statistics = *pw_run_statistics (run);
  pw_run_close (run);
  return status;
}

int pw_study_outcome (pw_row *r, int status, const pw_error *run_error, pw_error *error) {
  if (status == PW_OK || r->state == ROW_STOPPED) return PW_OK;
  if (status == PW_RESOURCE || status == PW_INITIAL) return pw_fail (error, status, "%s", run_error->text);
  if (pw_stop) return PW_RETRY;
  r->state = status == PW_INPUT ? ROW_REFUSED : ROW_FAILED;
  snprintf (r->reason, sizeof r->reason, "%s", run_error->status ? run_error->text : "the method gave up");
  return PW_OK;
}

int pw_study_allocate (pw_study *x, int rows, pw_error *error) {
  x->row = calloc ((size_t)rows + 1, sizeof *x->row);
  return x->row ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
}

/* ---- The tables ---- */

pw_output *pw_study_open (const pw_study *x, const char *name, pw_error *error) {
  char path[FIGURE_PATH + 16];
  snprintf (path, sizeof path, "%s/%s", x->folder, name);
  return pw_output_open (path, error);
}

const char *pw_study_status (const pw_row *r) {
  static const char *const status[] = { "ok", "failed", "refused", "stopped", "not run" };
  return status[r->state];
}

/* The CSV gets rows as they come, under the name NAME.part, which it keeps if the study is stopped. */
static int study_open_folder (pw_study *x, pw_error *error) {
  const char *const *tables = x->type->tables;
  const char *const names[] = { ".dat", ".gp", ".svg", ".png", tables[0], tables[1], NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--truth", x->reference_path, PW_READS, NULL },
                   { "-o", x->folder, PW_WRITES_INTO, names } };
  if (x->folder == NULL) return PW_OK;
  if (pw_cli_uses (&x->line, x->m.file, use, sizeof use / sizeof *use, error) != PW_OK) return error->status;
  x->lock = pw_figure_folder (x->folder, error);
  if (x->lock < 0) return error->status;
  x->csv = pw_study_open (x, tables[0], error);
  if (x->csv == NULL) return error->status;
  pw_text t = { .at = NULL };
  x->type->names (&t);
  pw_text_cell (&t, "reason");
  return pw_text_line (&t, pw_output_stream (x->csv), x->folder, error);
}

static int study_width (const pw_study *x) {
  size_t width = 6;
  for (int i = 0; i < x->rows; i++) {
    size_t n = strlen (x->row[i].method);
    if (n > width) width = n;
  }
  return (int)width;
}

/* Prints the completed row. */
static int study_write (pw_study *x, pw_error *error) {
  const pw_row *r = &x->row[x->done];
  char t[32];
  int width = study_width (x);
  if (x->done == 0 || r->group != r[-1].group) x->type->head (x, r->group, width, stdout);
  printf ("%-*s", width, r->method);
  x->type->line (x, r, stdout);
  if (r->state != ROW_DONE) {
    printf ("  %s", pw_study_status (r));
    if (r->state == ROW_FAILED && strncmp (r->reason, "t = ", 4) != 0) printf (" at t = %s s", pw_format (t, r->t, 4));
    printf (": %s", r->reason);
  }
  putchar ('\n');
  fflush (stdout);
  if (x->csv == NULL) return PW_OK;
  pw_text cells = { .at = NULL };
  x->type->cells (x, r, &cells);
  pw_text_quoted (&cells, r->reason);
  return pw_text_line (&cells, pw_output_stream (x->csv), x->folder, error);
}

/* ---- The command ---- */

static int study_open (pw_study *x, pw_error *error) {
  x->share = 1;
  x->cpu_end = INFINITY;
  int status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = x->type->plan (x, error);
  return status == PW_OK ? study_open_folder (x, error) : status;
}

static int study_rows (pw_study *x, pw_error *error) {
  pw_stop_catch ();
  int status = x->type->begin (x, error);
  if (status == PW_OK) pw_progress_count (&x->progress, pw_file_name (x->m.file), x->type->unit, 0, x->rows);
  for (x->done = 0; status == PW_OK && x->done < x->rows; x->done++) {
    status = x->type->measure (x, &x->row[x->done], error);
    pw_progress_end (&x->progress);
    if (status == PW_OK) status = study_write (x, error);
    if (status != PW_OK) break;
  }
  pw_stop_release ();
  return status;
}

/* A complete CSV gets its final name; the figures show all of its rows. */
static int study_finish (pw_study *x, int status, pw_error *error) {
  char part[FIGURE_PATH + 16] = "";
  pw_output *csv = x->csv;
  if (csv && status == PW_OK)
    status = pw_output_finish (csv, error);
  else if (csv)
    pw_text_abandon (csv, x->done, part, sizeof part);
  if (status == PW_RETRY && pw_stop) {
    pw_cli_say ("pinwheel: interrupted; %d of %d %s are done%s%s\n", x->done, x->rows, x->type->unit,
                *part ? ", and kept in " : "", part);
    return PW_INTERRUPTED;
  }
  return csv && status == PW_OK ? x->type->figures (x, error) : status;
}

/* A study in which no run has reached the end is a failure. */
static int study_verdict (const pw_study *x, pw_error *error) {
  const pw_row *failed = NULL;
  for (const pw_row *r = x->row; r < x->row + x->rows; r++) {
    if (r->state == ROW_DONE) return PW_OK;
    if (r->state == ROW_FAILED || r->state == ROW_REFUSED) failed = r;
  }
  return failed ? pw_fail (error, PW_METHOD, "no method has reached the end; the last of them: %s", failed->reason)
                : pw_fail (error, PW_METHOD, "no method has reached the end within the limit; see --limit");
}

int pw_study_command (pw_study *x, const pw_study_type *type, pw_error *error) {
  x->type = type;
  x->lock = -1;
  int status = study_open (x, error);
  if (status == PW_OK) status = study_rows (x, error);
  status = study_finish (x, status, error);
  if (status == PW_OK) status = study_verdict (x, error);
  if (x->lock >= 0) close (x->lock);
  type->close (x);
  free (x->row);
  free (x->methods.method);
  pw_cli_close_model (&x->m);
  return status == PW_INTERRUPTED ? status : error->status;
}
