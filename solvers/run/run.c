/* A run: its steps, samples, restarts and end; for its opening see run_open.c. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "rank.h"
#include "method.h"
#include "util.h"

int pw_run_annotate_error (const pw_run *r, int status, pw_error *error) {
  char signal[PW_NAME_BYTES];
  if (status == PW_OK || error == NULL || *pw_failed_signal (r->w, signal, sizeof signal) == 0) return status;
  if (strstr (error->text, signal)) return status;
  size_t n = strlen (error->text);
  const char *link = strstr (error->text, "a signal failed") ? ":"
                     : status == PW_INITIAL                  ? "; in an attempt,"
                                                             : "; in the attempted step,";
  const char *derivative = r->w->failed->of_force ? "" : ", or a derivative of it,"; /* no time derivatives of those */
  const pw_signal *failed = &r->w->failed->signal;
  const char *failure = failed->type == PW_FUNCTION && failed->function.text == NULL ? ", or its function failed" : "";
  snprintf (error->text + n, sizeof error->text - n, "%s %s%s is not a finite number%s", link, signal, derivative,
            failure);
  return status;
}

int pw_run_open_saddle (pw_run *r, pw_error *error) {
  pw_error cause = { 0 };
  pw_saddle_close (r->saddle);
  r->saddle = pw_saddle_open (r->w, r->s->mass, r->s->rows, r->active, &cause);
  if (r->saddle == NULL) return pw_fail (error, cause.status, "%s", cause.text);
  pw_specialised_select (r);
  return pw_watchdog_open (r, error);
}

int pw_run_evaluate (pw_run *r, pw_error *error) {
  int status = pw_run_accelerate (r, r->t, r->q, r->v, r->a, r->lambda);
  if (status > 0) return pw_fail_singular (r, r->t, error);
  if (status < 0) return pw_fail_signal (r->t, error);
  pw_ledger_rates (r, r->lambda, r->rate);
  pw_bound_tolerances (r);
  return PW_OK;
}

void pw_run_set_references (pw_run *r) {
  pw_watchdog_begin (r);
  if (r->redundant == 0) return;
  r->independence = pw_rank_independence (r);
  r->reselect_below = fmin (r->thresholds.reselect_ratio * r->independence, r->thresholds.reselect_below);
}

int pw_run_look_ahead (pw_run *r, pw_error *error) {
  char signal[PW_NAME_BYTES];
  double next = pw_run_next_breakpoint (r, r->t);
  if (!isnan (next)) {
    r->breakpoint = next;
    return PW_OK;
  }
  pw_failed_signal (r->w, signal, sizeof signal);
  r->w->failed = NULL;
  return pw_fail (error, PW_METHOD, "t = %.17g s: %s: its breakpoint function returned a time that is not later", r->t,
                  signal);
}

void pw_run_set_reference_level (pw_run *r) {
  r->previous_norm = pw_run_acceleration_norm (r);
  r->reference_level = fmax (1, r->previous_norm);
}

static void run_close_method (pw_run *r) {
  if (r->data) r->method->close (r);
  r->data = NULL;
}

char *pw_run_source (const pw_run *r, pw_error *error) {
  return pw_require (r, "a run", error) == PW_OK ? pw_system_source (r->s, r->active, error) : NULL;
}

void pw_run_close (pw_run *r) {
  if (r == NULL) return;
  run_close_method (r);
  pw_saddle_close (r->saddle);
  pw_saddle_close (r->watchdog.saddle);
  pw_workspace_free (r->w);
  free (r->memory);
  free (r->origin);
  pw_arena_free (&r->arena);
  free (r);
}

/* Restarts the method after a discontinuity, where accelerations change, or a step that was interrupted. */
static int run_restart_method (pw_run *r, pw_error *error) {
  int status = pw_run_look_ahead (r, error);
  if (status == PW_OK) status = pw_run_evaluate (r, error);
  return status == PW_OK ? r->method->restart (r, error) : status;
}

int pw_run_renew (pw_run *r, pw_error *error) {
  int status = pw_run_open_saddle (r, error);
  r->watchdog.singular_ahead = 1;
  if (status == PW_OK) status = pw_run_evaluate (r, error);
  if (status == PW_OK) pw_watchdog_begin (r);
  run_close_method (r); /* it may use the previous saddle */
  if (status == PW_RESOURCE || r->saddle == NULL) return status;
  int opened = r->method->open (r, error);
  if (opened != PW_OK) run_close_method (r);
  return status == PW_OK ? opened : status;
}

/* 1 if the saddle or the method could not be reopened: the run can only be closed. */
static int run_has_no_method (const pw_run *r, pw_error *error) {
  if (r->data) return 0;
  pw_fail (error, PW_RESOURCE, "model %s: t = %.6g s: the method could not be reopened", r->s->model, r->t);
  return 1;
}

/* If the active rows have become nearly dependent, looks for another set that is not, with which the method is
 * reopened.  This is done only before the next step or in a restart, since until then the last step may be sampled. */
static int run_reselect (pw_run *r, pw_error *error) {
  if (r->redundant == 0 || r->independence >= r->reselect_below) return PW_OK;
  r->reselect_below = r->independence / 2; /* if no other set is better, the next search is at half the independence */
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  int other = pw_rank_reselect (r);
  if (other < 0) return pw_fail_memory (r->s, error);
  if (other == 0) return PW_OK;
  int status = pw_run_renew (r, error);
  if (status == PW_OK) status = pw_run_evaluate (r, error); /* a method's `open` may have evaluated another state */
  if (status == PW_OK) pw_run_set_references (r);
  return status;
}

/* Computes r->independence with the J last evaluated. */
static void run_measure_independence (pw_run *r) {
  if (r->redundant) r->independence = pw_saddle_factor (r->saddle) == PW_OK ? pw_rank_independence (r) : 0;
}

/* 1 if t is the time reached, up to round-off.  No step is made to such a time, since methods divide by its length.  It
 * may be that of a discontinuity meant to coincide with another one, at 0.3 and 0.1 + 0.2. */
static int run_is_at (const pw_run *r, double t) {
  return t - r->t <= 8 * DBL_EPSILON * fmax (fabs (r->t), r->w->scale.time);
}

/* If an evaluation fails at the next time, SUNDIALS repeats steps below the round-off of time endlessly.  Fixed steps
 * may be that short. */
static int run_check_progress (pw_run *r, double before, pw_error *error) {
  double least = 64 * DBL_EPSILON * fabs (r->t);
  if (r->fixed_steps) least = fmin (least, r->settings.step / 2);
  r->stalled = r->t - before > least ? 0 : r->stalled + 1;
  if (r->stalled < r->thresholds.stalled) return PW_OK;
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: no step succeeds, however small: the next state cannot be evaluated, or not to within "
                  "the tolerances",
                  r->t);
}

int pw_run_advance (pw_run *r, double t_end, pw_error *error) {
  int status = pw_require (r, "a run", error);
  if (status != PW_OK) return status;
  double before = r->t;
  if (isnan (t_end)) return pw_fail (error, PW_INPUT, "t_end = nan: expected a time");
  if (!(r->t < t_end)) return PW_OK;
  if (run_has_no_method (r, error)) return PW_RESOURCE;
  r->stopped = 0;
  status = pw_run_check_limits (r, error);
  if (status == PW_METHOD) return pw_dead_point_explain (r, error);
  if (status != PW_OK) return status;
  pw_forget_residuals (r);
  if (r->stalled == 0) r->w->failed = NULL; /* otherwise it is the signal that stops the run */
  r->interrupted |= r->t >= r->breakpoint;
  if (r->interrupted) status = run_restart_method (r, error);
  if (status == PW_OK) r->interrupted = 0;
  if (status == PW_OK) status = run_reselect (r, error);
  const double stop = fmin (t_end, r->breakpoint);
  if (status == PW_OK && run_is_at (r, stop)) {
    if (r->t != r->moved_to) r->moved_from = r->t;
    r->moved_to = r->t = stop;
    return run_check_progress (r, before, error);
  }
  r->near_singular = 0;
  if (status == PW_OK) status = r->method->advance (r, t_end, error);
  if (status == PW_STOPPED) return status;
  if (status == PW_OK) status = pw_run_watchdog (r, error);
  if (status == PW_OK) status = pw_run_check_resolution (r, error);
  if (status == PW_OK) pw_ledger_record (r);
  if (status == PW_OK) status = run_check_progress (r, before, error);
  if (status == PW_METHOD) status = pw_dead_point_explain (r, error);
  if (status != PW_OK) return pw_run_annotate_error (r, status, error);
  run_measure_independence (r);
  return PW_OK;
}

double pw_run_time (const pw_run *r) {
  return r->t;
}

/* Energies and ledger of the sample, at which kinematics must be evaluated. */
static void run_fill_energies (pw_run *r, pw_sample *sample) {
  const pw_system *s = r->s;
  sample->kinetic = pw_kinetic (s, r->v_at);
  sample->potential = pw_potential (r->w);
  for (int i = 0; i < s->entries; i++)
    *(s->entry[i].type == PW_WORK ? &sample->work : &sample->loss) += r->ledger_at[i];
  if (r->settings.ledger) sample->ledger = r->ledger_at, sample->projection = r->projected_at;
  if (r->settings.integrals) sample->integral = r->ledger_at + s->entries;
  sample->balance = sample->kinetic + sample->potential - r->energy0 - sample->work + sample->loss - sample->projection;
}

int pw_run_sample (pw_run *r, double t, pw_sample *sample, pw_error *error) {
  pw_residuals now;
  if (pw_require (r, "a run", error) != PW_OK || pw_require (sample, "a sample", error) != PW_OK) return PW_INPUT;
  if (run_has_no_method (r, error)) return PW_RESOURCE;
  if (isnan (t)) return pw_fail (error, PW_INPUT, "t = nan: expected a time inside the last step");
  r->stopped = 0;
  if (t < r->t && pw_run_stop_requested (r)) return PW_STOPPED;
  const pw_source *failed = r->w->failed;
  const int is_reached = r->t == r->moved_to && t >= r->moved_from && t < r->t;
  r->w->failed = NULL;
  int status = pw_run_annotate_error (r, r->method->at (r, is_reached ? r->t : t, error), error);
  r->w->failed = failed;
  if (status != PW_OK) return status;
  *sample = (pw_sample){ .t = t, .q = r->q_at, .v = r->v_at, .a = r->a_at, .lambda = r->lambda_at };
  if (r->redundant && pw_saddle_factor (r->saddle) == PW_OK) pw_rank_least_norm (r, r->lambda_at);
  run_fill_energies (r, sample);
  pw_evaluate_residuals (r->w, NULL, &now);
  sample->position = now.position;
  sample->velocity = now.velocity;
  return PW_OK;
}

/* ---- Restart ---- */

/* Checks given positions or velocities x, whose states begin at `first`; NULL: none are given. */
static int run_check_given (const pw_run *r, const double *x, int first, pw_error *error) {
  for (int j = 0, n = r->s->coords; x && j < n; j++)
    if (!(fabs (x[j]) < r->thresholds.extreme))
      return pw_fail (error, PW_INPUT, "model %s: restart with %s = %g: expected a magnitude below %g", r->s->model,
                      PW_NAME (pw_system_state_name, r->s, first + j), x[j], r->thresholds.extreme);
  return PW_OK;
}

/* Makes (q, v) the state reached; moves the previous one to the sample arrays and the values given before to
 * r->given_before.  q and v may be in the sample arrays; NULL: unchanged. */
static void run_exchange (pw_run *r, const double *q, const double *v) {
  size_t n = (size_t)r->s->coords, bytes = n * sizeof *q;
  double *given = r->scratch;
  memcpy (given, q ? q : r->q, bytes);
  memcpy (given + n, v ? v : r->v, bytes);
  memcpy (r->q_at, r->q, pw_state_length (r->s) * sizeof *q);
  memcpy (r->given_before, r->q_given, 2 * (n + 3) * sizeof *q);
  memcpy (r->q, given, bytes);
  memcpy (r->v, given + n, bytes);
}

/* Makes rows active that are independent at the state reached. */
static int run_select_rows (pw_run *r, pw_error *error) {
  if (r->redundant == 0) return PW_OK;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  run_measure_independence (r);
  return run_reselect (r, error);
}

static int run_energy (pw_run *r, double *energy, pw_error *error) {
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  *energy = pw_energy (r, r->v);
  return PW_OK;
}

/* Continues from r->q and r->v, made consistent; *energy: that of the state reached. */
static int run_continue_at (pw_run *r, double *energy, pw_error *error) {
  r->near_singular = 0;
  r->watchdog.singular_ahead = 1;
  int status = run_select_rows (r, error);
  if (status == PW_OK) status = pw_run_make_consistent (r, NULL, error);
  if (status == PW_OK) status = pw_run_evaluate (r, error);
  if (status == PW_OK) status = run_energy (r, energy, error);
  if (status != PW_OK) return status;
  status = r->method->restart (r, error);
  r->interrupted = status != PW_OK; /* then the method is restarted before the next step */
  return status;
}

/* A change of energy by the caller is not an error of the method: it is added to the initial energy.  The caller's
 * functions may return other values and breakpoints than before. */
int pw_run_restart (pw_run *r, const double *q, const double *v, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  double before = 0, after = 0;
  if (run_has_no_method (r, error)) return PW_RESOURCE;
  if (run_check_given (r, q, 0, error) != PW_OK || run_check_given (r, v, r->s->coords, error) != PW_OK)
    return PW_INPUT;
  r->w->failed = NULL;
  r->interrupted |= r->t >= r->breakpoint; /* and remains so if the restart is refused */
  int status = run_energy (r, &before, error);
  if (status == PW_OK) status = pw_run_look_ahead (r, error);
  if (status != PW_OK) return pw_run_annotate_error (r, status, error);
  const double reselect_below = r->reselect_below;
  const pw_initial_report initial = r->initial;
  r->w->t_signal = NAN;
  run_exchange (r, q, v);
  status = run_continue_at (r, &after, error);
  if (status == PW_OK) {
    r->moved_from = r->t;
    pw_run_count_moved (r);
    pw_watchdog_begin (r);
    if (!r->near_singular)
      pw_run_set_reference_level (r); /* accelerations near a singular configuration are no reference */
    r->energy0 += after - before;
    return PW_OK;
  }
  pw_run_annotate_error (r, status, error);
  memcpy (r->q, r->q_at, pw_state_length (r->s) * sizeof *r->q);
  memcpy (r->q_given, r->given_before, 2 * ((size_t)r->s->coords + 3) * sizeof *r->q);
  r->reselect_below = reselect_below, r->initial = initial;
  if (run_select_rows (r, NULL) == PW_OK && pw_run_evaluate (r, NULL) == PW_OK && r->redundant) pw_watchdog_begin (r);
  r->interrupted |= r->redundant > 0; /* run_select_rows may have opened the method at the refused state */
  return status;
}

int pw_run_redundant (const pw_run *r) {
  return r->redundant;
}

const pw_statistics *pw_run_statistics (const pw_run *r) {
  return &r->statistics;
}

const pw_initial_report *pw_run_initial (const pw_run *r) {
  return &r->initial;
}

const pw_scale *pw_run_scale (const pw_run *r) {
  return &r->w->scale;
}
