/* `run --error`: the repetition of the run, in another thread, and the errors that follow from it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "run_command.h"

enum { ERROR_BODIES = 20, ERROR_COLUMNS = 24, ERROR_WIDTH = 12, ERROR_DIGITS = 2 };

static int error_stop (void *context) {
  pw_error_run *e = context;
  return e->cancelled || pw_limit_over (&e->limit);
}

static void *error_repeat (void *argument) {
  pw_error_run *e = argument;
  pw_limit_start (&e->limit);
  e->status = pw_repetition_run (e->repetition, 0, &e->failure);
  if (e->status == PW_STOPPED) pw_fail (&e->failure, PW_STOPPED, "stopped by %s", pw_stop ? "a signal" : "--limit");
  return NULL;
}

int pw_error_run_start (pw_run_cli *command, pw_error *error) {
  pw_error_run *e = &command->stated;
  if (!command->with_error) return PW_OK;
  if (command->checkpoints.resume_path)
    return pw_fail (error, PW_INPUT,
                    "--error compares the run from its beginning on: it cannot be combined with --resume");
  pw_equal_times (command->settings.span, MOTION_SAMPLES, e->t);
  e->settings = command->settings, e->limit = command->limit;
  e->settings.stop = error_stop, e->settings.stop_context = e;
  e->width = pw_run_record_width (command->run);
  e->repetition =
      pw_repetition_open (command->line.m.system, command->method, &e->settings, e->t, MOTION_SAMPLES, error);
  if (e->repetition == NULL) return error->status;
  e->rows = calloc ((MOTION_SAMPLES + 2) * (size_t)e->width, sizeof *e->rows);
  if (e->rows == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  e->result = (pw_stated_error){ .columns = e->width, .name = pw_system_record_name };
  e->end = e->rows + MOTION_SAMPLES * e->width;
  e->result.end = e->end, e->result.largest = e->end + e->width;
  e->started = pthread_create (&e->thread, NULL, error_repeat, e) == 0;
  return e->started ? PW_OK : pw_fail (error, PW_RESOURCE, "a thread for --error cannot be started");
}

double pw_error_run_next (const pw_error_run *e) {
  return e->started && e->taken < MOTION_SAMPLES ? e->t[e->taken] : INFINITY;
}

int pw_error_run_add (pw_error_run *e, pw_run *run, pw_error *error) {
  long recorded;
  const int k = e->taken++;
  return pw_run_record (run, e->t[k], e->t + k, 1, 0, e->rows + k * e->width, &recorded, error);
}

int pw_error_run_finish (pw_error_run *e, int complete, pw_error *error) {
  if (!e->started) return PW_OK;
  e->cancelled = !complete;
  pthread_join (e->thread, NULL);
  e->started = 0;
  if (!complete) return PW_OK;
  pw_error reason = e->failure;
  int status = e->status, repeated = status == PW_OK;
  if (repeated) status = pw_repetition_error (e->repetition, e->rows, e->taken, e->end, e->end + e->width, &reason);
  if (status == PW_RESOURCE) return pw_fail (error, PW_RESOURCE, "%s", reason.text);
  e->result.t = e->t[e->taken - 1];
  e->result.repeated = pw_repetition_text (e->repetition);
  e->known = 1;
  if (status == PW_OK) return PW_OK;
  snprintf (e->unknown, sizeof e->unknown, "%s%s", repeated ? "" : "the repetition failed: ",
            status == PW_STOPPED && repeated ? "a second repetition was stopped" : reason.text);
  e->result.unknown = e->unknown;
  return PW_OK;
}

void pw_error_run_close (pw_error_run *e) {
  pw_error_run_finish (e, 0, &(pw_error){ 0 });
  pw_repetition_close (e->repetition);
  free (e->rows);
}

/* Stated errors of the bodies at the end; those of x and y are the error of a length. */
static void error_bodies (const pw_stated_error *e, const pw_system *s, FILE *f) {
  static const char *const head[] = { "body", "position [m]", "phi [rad]", "velocity [m/s]", "omega [rad/s]", NULL };
  const int bodies = pw_system_bodies (s), n = pw_system_coordinates (s);
  for (pw_table table = { .f = f }; pw_table_pass (&table);) {
    pw_head (&table, -5, ERROR_WIDTH, head);
    for (int b = 0; b < bodies && b < ERROR_BODIES; b++) {
      const double *q = e->end + PW_RECORD_STATES + 3 * b, *v = q + n;
      pw_cell (&table, -5, pw_system_body_name (s, b));
      for (int i = 0; i < 4; i++)
        pw_cell_number (&table, ERROR_WIDTH,
                        i % 2 ? (i < 2 ? q : v)[2] : hypot ((i < 2 ? q : v)[0], (i < 2 ? q : v)[1]), ERROR_DIGITS);
      pw_row_end (&table);
    }
  }
  if (bodies > ERROR_BODIES) fprintf (f, "  and %d more: --json FILE has them all\n", bodies - ERROR_BODIES);
}

/* The largest errors of the other columns of the table: energies, contact points, reactions, ledger. */
static void error_columns (const pw_stated_error *e, const pw_system *s, int energies, FILE *f) {
  const int n = pw_system_coordinates (s), first = PW_RECORD_STATES, end = first + 3 * n;
  int shown = 0, all = 0;
  fprintf (f, "  largest error of a column\n");
  for (pw_table table = { .f = f }; pw_table_pass (&table);) {
    shown = all = 0;
    for (int i = 0; i < e->columns; i++) {
      const int is_state = i >= first + n && pw_system_state_hidden (s, i - first - n);
      if (isnan (e->largest[i]) || (first <= i && i < end && !is_state) || (i < first && !energies)) continue;
      if (++all > ERROR_COLUMNS) continue;
      shown++;
      pw_cell (&table, -8, PW_NAME (pw_system_record_name, s, i));
      pw_cell_number (&table, ERROR_WIDTH, e->largest[i], ERROR_DIGITS);
      pw_cell (&table, -1, pw_system_record_unit (s, i));
      pw_row_end (&table);
    }
  }
  if (all > shown) fprintf (f, "  and %d more: --json FILE has them all\n", all - shown);
}

void pw_report_stated (const pw_run_cli *command, FILE *f) {
  const pw_stated_error *e = &command->stated.result;
  if (!command->stated.known) return;
  if (e->unknown) {
    pw_cli_print (f, "\n  the error is unknown: %s\n", e->unknown);
    return;
  }
  pw_cli_print (f, "\n  stated error at %s s, from a repetition with %s\n", PW_DIGITS (e->t, 6), e->repeated);
  error_bodies (e, command->line.m.system, f);
  error_columns (e, command->line.m.system, command->with_energies, f);
}
