/* Checkpoints of `pinwheel run`: their contents, when they are due, and how a run continues from one.
 *
 * A checkpoint is saved after the step that reaches a multiple of the interval, once that step's rows have been
 * written.  The table is flushed to the disk first, so that a resumed run finds at least the rows that the checkpoint
 * counts. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "run_command.h"
#include "fingerprint.h"

/* keys of the fingerprint that are also read */
static const char checkpoints_interval_key[] = "checkpoint-every", checkpoints_engine_key[] = "engine";

/* ---- Before the run ---- */

/* The value of a key of the checkpoint that is resumed, up to the end of its line; NULL if there is none. */
static const char *checkpoints_value (const pw_checkpoints *checkpoints, const char *key) {
  size_t size;
  return pw_fingerprint_value (checkpoints->resumed.text, checkpoints->resumed.head_end, key, &size);
}

int pw_checkpoints_open (pw_run_cli *command, pw_specialise *specialise, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  checkpoints->next_time = INFINITY;
  if (checkpoints->path == NULL) checkpoints->path = checkpoints->resume_path;
  if (checkpoints->path == NULL && checkpoints->interval_text == NULL) return PW_OK;
  if (checkpoints->path == NULL)
    return pw_fail (error, PW_INPUT, "--checkpoint-every %s: --checkpoint FILE is needed to save to",
                    checkpoints->interval_text);
  checkpoints->interval = command->t_end / 10;
  if (checkpoints->resume_path) {
    if (pw_checkpoint_read (checkpoints->resume_path, &checkpoints->resumed, error) != PW_OK) return error->status;
    const char *interval = checkpoints_value (checkpoints, checkpoints_interval_key);
    const char *engine = checkpoints_value (checkpoints, checkpoints_engine_key);
    if (interval) checkpoints->interval = fmax (strtod (interval, NULL), 0);
    if (*specialise == PW_SPECIALISE_AUTO) *specialise = engine ? PW_SPECIALISE_ALWAYS : PW_SPECIALISE_NEVER;
  }
  return pw_cli_number ("--checkpoint-every", checkpoints->interval_text, PW_POSITIVE, &checkpoints->interval, error);
}

/* Everything that determines the results. */
static int checkpoints_fingerprint (pw_run_cli *command, pw_error *error) {
  const unsigned short order = 1;
  pw_text *text = &command->checkpoints.fingerprint;
  const pw_model *model = command->compiled.model;
  if (pw_fingerprint_run (text, PW_CHECKPOINT_MAGIC, command->compiled.file, pw_fingerprint_tables (0, model),
                          command->method, &command->settings, error) != PW_OK)
    return error->status;
  if (command->engine.code) pw_fingerprint_line (text, checkpoints_engine_key, NULL, "specialised");
  for (const pw_parameter *parameter = pw_model_table (model)->parameters; parameter && parameter->name; parameter++)
    pw_fingerprint_number (text, "parameter", parameter->name, pw_model_parameter (model, parameter));
  pw_fingerprint_initial (text, command->line.starts);
  pw_fingerprint_line (text, "table", NULL, command->table_path ? "written" : "not written");
  pw_fingerprint_number (text, "every", NULL, command->row_interval);
  pw_fingerprint_line (text, "energy", NULL, command->with_energies ? "kept" : "not kept");
  pw_fingerprint_line (text, "plots", NULL, command->plots_path ? "drawn" : "not drawn");
  pw_fingerprint_line (text, "animation", NULL, command->page_path ? "written" : "not written");
  if (command->reference_path == NULL)
    pw_fingerprint_line (text, "reference", NULL, "the model's");
  else if (pw_fingerprint_file (text, "reference", command->reference_path, command->reference_path, error) != PW_OK)
    return error->status;
  pw_fingerprint_number (text, checkpoints_interval_key, NULL, command->checkpoints.interval);
  const char *numbers =
      PW_PRINTED (60, "%s endian, %zu bytes", *(const unsigned char *)&order ? "little" : "big", sizeof (long));
  pw_fingerprint_line (text, "numbers", NULL, numbers);
  pw_text_add (text, "end\n");
  return text->failed ? pw_fail (error, PW_RESOURCE, "out of memory") : PW_OK;
}

/* Refuses a checkpoint of another run. */
static int checkpoints_check_fingerprint (const pw_checkpoints *checkpoints, pw_error *error) {
  const pw_text *own = &checkpoints->fingerprint;
  const pw_fingerprint there = { checkpoints->resumed.text, checkpoints->resumed.head_end, "there" };
  const pw_fingerprint here = { own->chars, own->chars + own->length, "here" };
  char difference[300];
  if (checkpoints->resume_path && pw_fingerprint_differ (there, here, NULL, difference, sizeof difference))
    return pw_fail (error, PW_INPUT, "the checkpoint %.100s belongs to another run: %.300s", checkpoints->resume_path,
                    difference);
  return PW_OK;
}

int pw_checkpoints_prepare (pw_run_cli *command, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  if (checkpoints->path == NULL) return PW_OK;
  if (command->table_path && strcmp (command->table_path, "-") == 0)
    return pw_fail (error, PW_INPUT,
                    "--checkpoint: a table on standard output cannot be continued; write it to a file");
  checkpoints->lock = pw_output_open (checkpoints->path, error);
  if (checkpoints->lock == NULL) return error->status;
  if (!pw_output_is_file (checkpoints->lock))
    return pw_fail (error, PW_INPUT, "%s: a checkpoint needs a regular file, which can be read again and replaced",
                    checkpoints->path);
  int status = checkpoints_fingerprint (command, error);
  if (status == PW_OK) status = checkpoints_check_fingerprint (checkpoints, error);
  if (status != PW_OK || command->table_path == NULL) return status;
  pw_output **table = &command->output[PW_RUN_TABLE];
  pw_mark mark = { 0 };
  if (checkpoints->resume_path == NULL)
    return pw_output_mark (*table, &mark, error); /* fails for a table that cannot be continued */
  pw_archive_bytes (&checkpoints->resumed.state, &mark, sizeof mark);
  *table = pw_output_continue (command->table_path, &mark, error);
  return *table ? PW_OK : error->status;
}

void pw_checkpoints_close (pw_checkpoints *checkpoints) {
  if (checkpoints->lock) pw_output_discard (checkpoints->lock);
  pw_text_free (&checkpoints->fingerprint);
  pw_archive_free (&checkpoints->state);
  pw_checkpoint_free (&checkpoints->resumed);
}

/* ---- Saving and resuming ---- */

/* The next checkpoint is due at the first multiple of the interval after t; after every step if t has 2^53 intervals,
 * since then n + 1 is n in double precision. */
static void checkpoints_schedule (pw_checkpoints *checkpoints, double t) {
  if (checkpoints->interval == 0) return;
  double n = fmin (floor (t / checkpoints->interval), 0x1p53);
  while (n * checkpoints->interval <= t && n < 0x1p53) n++;
  checkpoints->next_time = n * checkpoints->interval;
}

/* Saves or loads the state of the command besides that of the run. */
static void checkpoints_serialise (pw_run_cli *command, pw_archive *archive) {
  pw_archive_bytes (archive, &command->rows, sizeof command->rows);
  pw_archive_bytes (archive, &command->cpu, sizeof command->cpu);
  pw_archive_bytes (archive, command->engine.reason, sizeof command->engine.reason);
  command->engine.reason[sizeof command->engine.reason - 1] = 0;
  if (command->plots) pw_plots_serialise (command->plots, archive);
  pw_comparison_serialise (&command->comparison, archive);
}

/* 1 if the checkpoint that was loaded lies within the run and has the rows up to its time. */
static int checkpoints_plausible (const pw_run_cli *command) {
  double t = pw_run_time (command->run), rows = (double)command->rows, expected = rows, cpu = command->cpu;
  if (command->table && command->row_interval > 0) expected = floor (t / command->row_interval) + 1;
  return t <= command->t_end && rows >= 0 && fabs (rows - expected) <= 1 && isfinite (cpu) && cpu >= 0;
}

int pw_checkpoints_resume (pw_run_cli *command, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  if (checkpoints->resume_path) {
    checkpoints_serialise (command, &checkpoints->resumed.state);
    if (pw_run_load (command->run, &checkpoints->resumed.state, error) != PW_OK) return error->status;
    if (!checkpoints_plausible (command))
      return pw_fail (error, PW_INPUT,
                      "the checkpoint %s is not that of a run: its time, number of rows or processor time "
                      "is impossible",
                      checkpoints->resume_path);
    command->loaded = 1;
    checkpoints->last_path = checkpoints->resume_path, checkpoints->last_time = pw_run_time (command->run);
    pw_cli_say ("pinwheel: resumed at t = %s s\n", PW_DIGITS (pw_run_time (command->run), 6));
  }
  checkpoints_schedule (checkpoints, pw_run_time (command->run));
  return PW_OK;
}

int pw_checkpoints_save (pw_run_cli *command, pw_error *error) {
  pw_checkpoints *checkpoints = &command->checkpoints;
  pw_output *table = command->output[PW_RUN_TABLE];
  double t = pw_run_time (command->run);
  pw_mark mark = { 0 };
  if (t >= command->t_end) return PW_OK;
  if (table && pw_output_mark (table, &mark, error) != PW_OK) return error->status;
  pw_archive_clear (&checkpoints->state);
  if (table) pw_archive_bytes (&checkpoints->state, &mark, sizeof mark);
  checkpoints_serialise (command, &checkpoints->state);
  int status = pw_run_save (command->run, &checkpoints->state, error); /* reopens the method, as resuming does */
  if (status > 0) return PW_OK; /* near a singular configuration: still due, so the next batch tries again */
  if (status != PW_OK) return status;
  checkpoints_schedule (checkpoints, t);
  if (checkpoints->state.failed) return pw_fail (error, PW_RESOURCE, "out of memory while saving a checkpoint");
  pw_output *output = pw_output_open_as (checkpoints->path, ".next", error);
  status =
      output ? pw_checkpoint_put (output, checkpoints->fingerprint.chars, &checkpoints->state, error) : error->status;
  if (status == PW_OK) checkpoints->last_path = checkpoints->path, checkpoints->last_time = t;
  return status;
}
