/* Checkpoints of a run: their contents, when they are due, and how a run continues from one.
 *
 * A checkpoint is saved after the step that reaches a multiple of the interval, when the step's rows are written.  The
 * table is written to the disk first, so that a resumed run finds at least the rows that the checkpoint counts. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "run_command.h"
#include "fingerprint.h"

static const char checkpoints_key[] = "checkpoint-every", checkpoints_engine[] = "engine";

/* ---- Before the run ---- */

/* The interval from the file that is resumed. */
static void checkpoints_interval (pw_checkpoints *c) {
  char text[40];
  size_t size;
  const char *value = pw_fingerprint_value (c->from.text, c->from.head_end, checkpoints_key, &size);
  if (value == NULL || size >= sizeof text) return;
  memcpy (text, value, size);
  text[size] = 0;
  if (pw_read_number (text, &c->every) != PW_OK || !(c->every > 0)) c->every = 0;
}

/* Reads the options and the file to be resumed.  Without checkpoints `every` stays 0. */
static int checkpoints_read (pw_checkpoints *c, double t_end, pw_error *error) {
  c->due = INFINITY;
  if (c->resume && c->path == NULL) c->path = c->resume;
  if (c->path == NULL && c->every_text == NULL) return PW_OK;
  if (c->path == NULL)
    return pw_fail (error, PW_INPUT, "--checkpoint-every %s: --checkpoint FILE is needed to save to", c->every_text);
  if (c->resume && pw_checkpoint_read (c->resume, &c->from, error) != PW_OK) return error->status;
  c->every = t_end / 10;
  if (c->resume) checkpoints_interval (c);
  return pw_cli_number ("--checkpoint-every", c->every_text, PW_POSITIVE, &c->every, error);
}

int pw_checkpoints_open (pw_run_command *x, pw_specialise *when, pw_error *error) {
  pw_checkpoints *c = &x->check;
  size_t size;
  int status = checkpoints_read (c, x->t_end, error);
  if (status == PW_OK && c->resume && *when == PW_SPECIALISE_AUTO)
    *when = pw_fingerprint_value (c->from.text, c->from.head_end, checkpoints_engine, &size) ? PW_SPECIALISE_ALWAYS
                                                                                             : PW_SPECIALISE_NEVER;
  return status;
}

static int checkpoints_lock (pw_checkpoints *c, pw_error *error) {
  c->lock = pw_output_open (c->path, error);
  if (c->lock == NULL) return error->status;
  if (pw_output_is_file (c->lock)) return PW_OK;
  return pw_fail (error, PW_INPUT, "%s: a checkpoint needs a regular file, which can be read again and replaced",
                  c->path);
}

/* The head: everything that determines the results. */
static int checkpoints_head (pw_run_command *x, pw_error *error) {
  const unsigned short order = 1;
  char numbers[60];
  pw_text *t = &x->check.head;
  const pw_model *m = x->m.model;
  if (pw_fingerprint_run (t, PW_CHECKPOINT_MAGIC, x->m.file, pw_fingerprint_tables (0, m), x->method, &x->settings,
                          error) != PW_OK)
    return error->status;
  if (x->engine.code) pw_fingerprint_line (t, checkpoints_engine, NULL, "specialised");
  for (const pw_parameter *q = pw_model_table (m)->parameters; q && q->name; q++)
    pw_fingerprint_number (t, "parameter", q->name, pw_model_parameter (m, q));
  pw_fingerprint_initial (t, x->line.starts);
  pw_fingerprint_line (t, "table", NULL, x->csv_path ? "written" : "not written");
  pw_fingerprint_number (t, "every", NULL, x->every);
  pw_fingerprint_line (t, "energy", NULL, x->energy ? "kept" : "not kept");
  pw_fingerprint_line (t, "plots", NULL, x->plots_path ? "drawn" : "not drawn");
  pw_fingerprint_line (t, "animation", NULL, x->animate_path ? "written" : "not written");
  if (x->reference_path == NULL)
    pw_fingerprint_line (t, "reference", NULL, "the model's");
  else if (pw_fingerprint_file (t, "reference", x->reference_path, x->reference_path, error) != PW_OK)
    return error->status;
  pw_fingerprint_number (t, checkpoints_key, NULL, x->check.every);
  snprintf (numbers, sizeof numbers, "%s endian, %zu bytes", *(const unsigned char *)&order ? "little" : "big",
            sizeof (long));
  pw_fingerprint_line (t, "numbers", NULL, numbers);
  pw_text_add (t, "end\n");
  return t->failed ? pw_fail (error, PW_RESOURCE, "out of memory") : PW_OK;
}

/* Refuses a checkpoint of another run. */
static int checkpoints_match (const pw_checkpoints *c, pw_error *error) {
  const pw_fingerprint there = { c->from.text, c->from.head_end, "there" },
                       here = { c->head.chars, c->head.chars + c->head.length, "here" };
  char what[300];
  if (c->resume && pw_fingerprint_differ (there, here, NULL, what, sizeof what))
    return pw_fail (error, PW_INPUT, "the checkpoint %.100s belongs to another run: %.300s", c->resume, what);
  return PW_OK;
}

int pw_checkpoints_prepare (pw_run_command *x, pw_error *error) {
  pw_checkpoints *c = &x->check;
  if (c->path == NULL) return PW_OK;
  if (x->csv_path && strcmp (x->csv_path, "-") == 0)
    return pw_fail (error, PW_INPUT,
                    "--checkpoint: a table on standard output cannot be continued; write it to a file");
  int status = checkpoints_lock (c, error);
  if (status == PW_OK) status = checkpoints_head (x, error);
  if (status == PW_OK) status = checkpoints_match (c, error);
  if (status != PW_OK || x->csv_path == NULL) return status;
  pw_mark mark = { 0 };
  if (c->resume == NULL)
    return pw_output_mark (x->output[PW_RUN_TABLE], &mark, error); /* fails if it cannot be continued */
  pw_archive_bytes (&c->from.state, &mark, sizeof mark);
  x->output[PW_RUN_TABLE] = pw_output_continue (x->csv_path, &mark, error);
  return x->output[PW_RUN_TABLE] ? PW_OK : error->status;
}

void pw_checkpoints_close (pw_checkpoints *c) {
  if (c->lock) pw_output_discard (c->lock);
  pw_text_free (&c->head);
  pw_archive_free (&c->state);
  pw_checkpoint_free (&c->from);
}

/* ---- Saving and resuming ---- */

/* The first multiple of the interval after t is due next; every step, if t has 2^53 intervals, where n + 1 is n. */
static void checkpoints_next (pw_checkpoints *c, double t) {
  if (c->every == 0) return;
  double n = fmin (floor (t / c->every), 0x1p53);
  while (n * c->every <= t && n < 0x1p53) n++;
  c->due = n * c->every;
}

/* Serialises the state of the program besides that of the run. */
static void checkpoints_serialise (pw_run_command *x, pw_archive *a) {
  pw_archive_bytes (a, &x->row, sizeof x->row);
  pw_archive_bytes (a, &x->cpu, sizeof x->cpu);
  pw_archive_bytes (a, x->engine.reason, sizeof x->engine.reason);
  x->engine.reason[sizeof x->engine.reason - 1] = 0;
  if (x->plots) pw_plots_serialise (x->plots, a);
  pw_comparison_serialise (&x->comparison, a);
}

/* A checkpoint must lie within the run and have the rows up to its time. */
static int checkpoints_plausible (const pw_run_command *x) {
  double t = pw_run_time (x->r), rows = x->csv && x->every > 0 ? floor (t / x->every) + 1 : (double)x->row;
  return t <= x->t_end && x->row >= 0 && fabs ((double)x->row - rows) <= 1 && isfinite (x->cpu) && x->cpu >= 0;
}

int pw_checkpoints_resume (pw_run_command *x, pw_error *error) {
  pw_checkpoints *c = &x->check;
  char t[32];
  if (c->resume) {
    checkpoints_serialise (x, &c->from.state);
    if (pw_run_load (x->r, &c->from.state, error) != PW_OK) return error->status;
    if (!checkpoints_plausible (x))
      return pw_fail (error, PW_INPUT,
                      "the checkpoint %s is not that of a run: time, number of rows or processor time "
                      "are impossible",
                      c->resume);
    x->resumed = 1;
    pw_cli_say ("pinwheel: resumed at t = %s s\n", pw_format (t, pw_run_time (x->r), 6));
  }
  checkpoints_next (c, pw_run_time (x->r));
  return PW_OK;
}

int pw_checkpoints_save (pw_run_command *x, pw_error *error) {
  pw_checkpoints *c = &x->check;
  double t = pw_run_time (x->r);
  pw_mark mark = { 0 };
  if (t >= x->t_end) return PW_OK;
  if (x->output[PW_RUN_TABLE] && pw_output_mark (x->output[PW_RUN_TABLE], &mark, error) != PW_OK) return error->status;
  pw_archive_clear (&c->state);
  if (x->output[PW_RUN_TABLE]) pw_archive_bytes (&c->state, &mark, sizeof mark);
  checkpoints_serialise (x, &c->state);
  int status = pw_run_save (x->r, &c->state, error);
  if (status != PW_OK) return status > 0 ? PW_OK : status;
  checkpoints_next (c, t);
  if (c->state.failed) return pw_fail (error, PW_RESOURCE, "out of memory while saving a checkpoint");
  pw_output *o = pw_output_open_as (c->path, ".next", error);
  status = o ? pw_checkpoint_put (o, c->head.chars, &c->state, error) : error->status;
  if (status == PW_OK) c->saved = t;
  return status;
}
