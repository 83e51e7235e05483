/* A run: its steps, samples, restarts and end; for its opening see run_open.c. */
#include <stdlib.h>
#include <string.h>
#include "rank.h"
#include "method.h"

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
  /* with kinks for methods of order > 2: lower orders do not suffer from a kink inside a step, and multistep methods
   * (order 0) lose more by a restart */
  double next = pw_next_breakpoint (r->w, r->method->order > 2, r->t);
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
  free (r->event);
  free (r->events_memory);
  free (r->memory);
  pw_arena_free (&r->arena);
  free (r);
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

int pw_run_has_no_method (const pw_run *r, pw_error *error) {
  if (r->data) return 0;
  pw_fail (error, PW_RESOURCE, "model %s: t = %.6g s: the method could not be reopened", r->s->model, r->t);
  return 1;
}

/* Restarts the method after a discontinuity, where accelerations change, or a step that was interrupted. */
int pw_run_settle (pw_run *r, pw_error *error) {
  if (!r->interrupted) return PW_OK;
  if (pw_run_has_no_method (r, error)) return PW_RESOURCE;
  int status = pw_run_look_ahead (r, error);
  r->jumped = 1;
  r->predicted = 0;
  pw_run_fix_sides (r);
  if (status == PW_OK) status = pw_run_evaluate (r, error);
  if (status == PW_OK) status = r->method->restart (r, error);
  if (status == PW_OK) r->interrupted = 0;
  return status;
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

static void run_measure_independence (pw_run *r) {
  if (r->redundant) r->independence = pw_saddle_factor (r->saddle) == PW_OK ? pw_rank_independence (r) : 0;
}

/* 1 if t is the time reached, up to round-off.  No step is made to such a time, since methods divide by its length.  It
 * may be that of a discontinuity meant to coincide with another one, at 0.3 and 0.1 + 0.2. */
static int run_is_at (const pw_run *r, double t) {
  return t - r->t <= 8 * DBL_EPSILON * pw_larger (fabs (r->t), r->w->scale.time);
}

/* If an evaluation fails at the next time, SUNDIALS repeats steps below the round-off of time endlessly.  Fixed steps
 * may be that short. */
static int run_check_progress (pw_run *r, double before, pw_error *error) {
  double least = 64 * DBL_EPSILON * fabs (r->t);
  if (r->fixed_steps && least > r->settings.step / 2) least = r->settings.step / 2;
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
  if (pw_run_has_no_method (r, error)) return PW_RESOURCE;
  r->stopped = 0;
  status = pw_run_check_limits (r, error);
  if (status == PW_METHOD) return pw_dead_point_explain (r, error);
  if (status != PW_OK) return status;
  pw_forget_residuals (r);
  if (r->stalled == 0) r->w->failed = NULL; /* otherwise it is the signal that stops the run */
  r->interrupted |= r->t >= r->breakpoint;
  if (r->interrupted) status = pw_run_settle (r, error);
  if (status == PW_OK && r->redundant > 0) status = run_reselect (r, error);
  const double stop = t_end < r->breakpoint ? t_end : r->breakpoint;
  if (status == PW_OK && run_is_at (r, stop)) {
    if (r->t != r->moved_to) r->moved_from = r->t;
    r->moved_to = r->t = stop;
    return run_check_progress (r, before, error);
  }
  r->near_singular = 0;
  if (status == PW_OK) status = r->advance (r, t_end, error);
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

/* Energies, ledger and outputs of the sample, at which kinematics must be evaluated. */
static void run_fill_energies (pw_run *r, pw_sample *sample) {
  const pw_system *s = r->s;
  sample->kinetic = pw_kinetic (s, r->v_at);
  sample->potential = pw_potential (r->w);
  for (int i = 0; i < s->entries; i++)
    *(s->entry[i].type == PW_WORK ? &sample->work : &sample->loss) += r->ledger_at[i];
  if (r->settings.ledger) sample->ledger = r->ledger_at, sample->projection = r->projected_at;
  if (r->settings.integrals) sample->integral = r->ledger_at + s->entries;
  sample->balance = sample->kinetic + sample->potential - r->energy0 - sample->work + sample->loss - sample->projection;
  if (s->outputs > 0) pw_evaluate_outputs (r->w, sample, r->ledger_at);
  sample->output = r->w->output_value;
}

int pw_run_sample (pw_run *r, double t, pw_sample *sample, pw_error *error) {
  pw_residuals now;
  if (pw_require (r, "a run", error) != PW_OK || pw_require (sample, "a sample", error) != PW_OK) return PW_INPUT;
  if (pw_run_has_no_method (r, error)) return PW_RESOURCE;
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
  if (r->enforced) pw_fill_given (r, r->lambda_at);
  run_fill_energies (r, sample);
  pw_evaluate_residuals (r->w, r->enforced, &now);
  sample->position = now.position;
  sample->velocity = now.velocity;
  return PW_OK;
}

int pw_run_select_rows (pw_run *r, pw_error *error) {
  if (r->redundant == 0) return PW_OK;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  run_measure_independence (r);
  return run_reselect (r, error);
}

int pw_run_redundant (const pw_run *r) {
  return r->redundant;
}

const pw_event *pw_run_events (const pw_run *r, int *count) {
  *count = r ? (int)r->event_count : 0;
  return *count > 0 ? r->event : NULL;
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

/* Limits that end a run: the caller's request, the number of attempted steps of an adaptive method, coordinates too
 * large for double precision to resolve the scene.
 *
 * With the unit u of a coordinate (L, or 1 rad) and the round-off eps, q has an error of eps |q|.  From eps |q| = 0.01
 * u on, round-off alone violates a constraint by a residual with which it counts as lost (1e-2, scaled), and changes
 * directions of forces by 0.01 rad. */

#define LIMITS_RESOLVED 1e-2 /* in u: error eps |q| beyond which a run fails */

int pw_run_check_limits (pw_run *r, pw_error *error) {
  const pw_statistics *now = &r->statistics;
  if (pw_run_stop_requested (r)) return PW_STOPPED;
  if (now->steps + now->rejected < r->settings.max_steps || r->fixed_steps) return PW_OK;
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the limit max-steps is reached: %ld attempted steps, %ld of them rejected", r->t,
                  now->steps + now->rejected, now->rejected);
}

PW_SELDOM int limits_resolution (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  r->checked_span = r->t - r->settings.t;
  for (int j = 0; j < s->mechanical; j++) {
    double round_off = fabs (r->q[j]) * DBL_EPSILON;
    if (!(round_off > LIMITS_RESOLVED * pw_unit (s, j))) continue;
    if (r->fixed_steps && fabs (r->v[j]) * r->settings.step > 0.1 * fabs (r->q[j])) /* within a few steps */
      return pw_fail (error, PW_METHOD,
                      "t = %.6g s: the step of %.6g s is too large: the state grows beyond all bounds", r->t,
                      r->settings.step);
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: the motion has grown beyond what numbers resolve: %s = %.3g %s, known to %.2g only",
                    r->t, PW_NAME (pw_system_state_name, s, j), r->q[j], pw_system_state_unit (s, j), round_off);
  }
  return PW_OK;
}

int pw_run_check_resolution (pw_run *r, pw_error *error) {
  const int is_due = r->t - r->settings.t >= 2 * r->checked_span || r->statistics.steps % PW_CHECK_INTERVAL == 0;
  return is_due ? limits_resolution (r, error) : PW_OK;
}

/* The energy of a run and its ledger of work, losses and integrals: scales, tolerance, energy defect.  Every run keeps
 * a ledger, since samples contain the total work and loss; in adaptive Runge-Kutta methods, radau included, its error
 * takes part in step-size control. */

/* Kinetic energy [J] of the scene moving by L and turning by 1 rad in the span of the run. */
static double ledger_scene_energy (const pw_run *r) {
  const pw_system *s = r->s;
  double sum = 0;
  for (int j = 0; j < s->coords; j++) sum += 0.5 * s->M[j] * pw_unit (s, j) * pw_unit (s, j);
  return sum / (r->settings.span * r->settings.span);
}

/* Evaluates kinematics at an arbitrary state: displaced by about L and 1 rad, at velocities of about L / T and 1 / T,
 * at the time t.  A status. */
static int ledger_displace (pw_run *r, double t) {
  double *q = r->scratch, *v = q + r->s->coords + 3;
  for (int j = 0; j < r->s->coords; j++) {
    double displacement = pw_unit (r->s, j) * (1 + 0.37 * (j % 5)) / 2;
    q[j] = r->q[j] + displacement;
    v[j] = displacement / r->w->scale.time;
  }
  return pw_update_kinematics (r->w, t, q, v);
}

static void ledger_return (pw_run *r) {
  r->w->failed = NULL;
  pw_update_kinematics (r->w, r->t, r->q, r->v);
}

/* Energy scale [J] of a massless scene: work and losses in a time T at the velocities of an arbitrary state, and the
 * change of potential energy. */
static double ledger_massless_energy (pw_run *r) {
  const pw_system *s = r->s;
  double *lambda = r->lambda_at, T = r->w->scale.time, sum = 0;
  memset (lambda, 0, (size_t)s->rows * sizeof *lambda);
  if (ledger_displace (r, r->t) == PW_OK) {
    pw_evaluate_ledger (r->w, lambda, r->ledger_at);
    for (int i = 0; i < s->entries; i++) sum += T * fabs (r->ledger_at[i]);
    sum += fabs (pw_potential (r->w) - r->potential0);
  }
  ledger_return (r);
  return sum;
}

/* Evaluates the integrands at the state of the workspace; power: those of the ledger's entries. */
static void ledger_integrands (pw_run *r, const double *lambda, const double *power, double *value) {
  const pw_system *s = r->s;
  double *q = r->integrand_state, *v = q + s->coords;
  for (int b = 0; b < s->bodies; b++) {
    const pw_configuration *c = &r->w->configuration[b];
    q[3 * b] = c->x, q[3 * b + 1] = c->y, q[3 * b + 2] = c->phi;
    v[3 * b] = c->vx, v[3 * b + 1] = c->vy, v[3 * b + 2] = c->omega;
  }
  for (const pw_element_batch *k = r->w->batch; k < r->w->batch + s->batches; k++)
    for (int j = 0; j < k->b.count * k->kind->internal; j++)
      q[k->internal + j] = k->b.q[j], v[k->internal + j] = k->b.v[j];
  pw_sample state = { .t = r->w->t_signal,
                      .q = q,
                      .v = v,
                      .lambda = lambda,
                      .kinetic = pw_kinetic (s, v),
                      .potential = pw_potential (r->w),
                      .ledger = power };
  if (s->outputs > 0) { /* works and losses are not known there, only their rates */
    state.work = state.loss = NAN;
    pw_evaluate_outputs (r->w, &state, NULL);
    state.work = state.loss = 0, state.output = r->w->output_value;
  }
  for (int i = 0; i < s->entries; i++) *(s->entry[i].type == PW_WORK ? &state.work : &state.loss) += power[i];
  r->settings.integrand (r->settings.integrand_context, &state, value);
}

static void ledger_record_integrands (pw_run *r, const double *value) {
  for (int i = 0; i < r->settings.integrals; i++)
    if (isfinite (value[i])) r->integrand_size[i] = fmax (r->integrand_size[i], fabs (value[i]));
}

/* Sizes of integrands that may be zero on the way: those at an arbitrary state after a time T, with multipliers that
 * accelerate the scene by L / T^2. */
static void ledger_measure_integrands (pw_run *r) {
  const pw_system *s = r->s;
  double *lambda = r->lambda_at, T = r->w->scale.time, energy = 0;
  for (int j = 0; j < s->mechanical; j++) energy += s->mass[j] * pw_unit (s, j) * pw_unit (s, j) / (T * T);
  for (int i = 0; i < s->rows; i++) lambda[i] = energy / s->scale.length * pw_rank_multiplier_unit (r->w, i);
  if (ledger_displace (r, r->t + T) == PW_OK) {
    pw_evaluate_ledger (r->w, lambda, r->ledger_at);
    ledger_integrands (r, lambda, r->ledger_at, r->ledger_at + s->entries);
    ledger_record_integrands (r, r->ledger_at + s->entries);
  }
  ledger_return (r);
}

void pw_ledger_begin (pw_run *r) {
  r->potential0 = pw_potential (r->w);
  r->exchanged = pw_kinetic (r->s, r->v);
  r->energy0 = r->exchanged + r->potential0;
  r->scene_energy = ledger_scene_energy (r);
  if (r->scene_energy == 0 && r->s->entries > 0) r->scene_energy = ledger_massless_energy (r);
  if (r->settings.integrals) ledger_measure_integrands (r);
  ledger_record_integrands (r, r->rate + r->s->entries);
}

PW_SELDOM void ledger_record_energies (pw_run *r) {
  double power = 0, exchanged = fmax (pw_kinetic (r->s, r->v), fabs (pw_potential (r->w) - r->potential0));
  for (int i = 0; i < r->s->entries; i++) power += fabs (r->rate[i]);
  if (exchanged > r->exchanged && isfinite (exchanged)) r->exchanged = exchanged;
  if (power > r->power && isfinite (power)) r->power = power;
}

/* Samples the first PW_CHECK_INTERVAL steps and every PW_CHECK_INTERVAL-th: sufficient for a scale, at negligible
 * cost. */
void pw_ledger_record (pw_run *r) {
  if (r->settings.integrals) ledger_record_integrands (r, r->rate + r->s->entries);
  if (r->statistics.steps <= PW_CHECK_INTERVAL || r->statistics.steps % PW_CHECK_INTERVAL == 0)
    ledger_record_energies (r);
}

static const double *ledger_multipliers (pw_run *r, const double *lambda) {
  double *all = r->enforced ? r->scratch : r->least_norm;
  if (r->enforced == NULL && pw_saddle_factor (r->saddle) != PW_OK) return lambda;
  memcpy (all, lambda, (size_t)r->s->rows * sizeof *lambda);
  r->enforced ? pw_fill_given (r, all) : pw_rank_least_norm (r, all);
  return all;
}

void pw_ledger_all_rates (pw_run *r, const double *lambda, double *rate) {
  const int integrals = r->settings.integrals;
  if (r->redundant_drive || (integrals && r->redundant)) lambda = ledger_multipliers (r, lambda);
  pw_evaluate_ledger (r->w, lambda, rate);
  if (integrals) ledger_integrands (r, lambda, rate, rate + r->s->entries);
}

int pw_ledger_uses_multipliers (const pw_run *r) {
  const pw_system *s = r->s;
  int reacts = r->settings.integrals > 0 && s->rows > 0;
  for (int i = 0; i < s->entries; i++) reacts |= s->batch[s->entry[i].batch].kind->rows > 0;
  return reacts;
}

/* If kinetic and potential energies are negligible, as for light bodies against friction, the scale is the work done,
 * which grows without bound; so that of a time T at the most. */
static const double ledger_share =
                        5,    /* sqrt (25): the error of one of 25 states whose root mean square is 1 tolerance */
    ledger_round_off = 1e-11; /* of powers and integrands, due to multipliers */

double pw_ledger_tolerance (const pw_run *r, double h) {
  const pw_settings *settings = &r->settings;
  double work = 0, rtol = fmax (settings->rtol, settings->atol > 0 ? settings->atol / fmax (r->s->scale.length, 1) : 0);
  for (int i = 0; i < r->s->entries; i++) work += fabs (r->ledger[i]);
  double energy = fmax (fmax (r->scene_energy, r->exchanged), fmin (work, r->power * r->w->scale.time));
  double tolerance = ledger_share * rtol * energy + ledger_round_off * fabs (h) * r->power + 16 * DBL_EPSILON * work;
  return tolerance > 0 && isfinite (tolerance) ? tolerance : DBL_MAX;
}

double pw_ledger_norm (const pw_run *r, double h, const double *change) {
  const double tolerance = pw_ledger_tolerance (r, h), T = r->w->scale.time;
  double sum = 0;
  for (int i = 0; i < r->entries; i++) {
    const int k = i - r->s->entries;
    double own = k < 0 ? tolerance
                       : r->integrand_size[k] * (ledger_share * r->settings.rtol * T + ledger_round_off * fabs (h)) +
                             16 * DBL_EPSILON * fabs (r->ledger[i]);
    if (own > 0) sum += change[i] / own * (change[i] / own);
  }
  return sqrt (sum);
}

double pw_run_energy_defect (const pw_run *r, const pw_sample *sample) {
  double defect = sample->kinetic + sample->potential - r->energy0 - sample->work + sample->loss;
  double scale = fmax (r->exchanged, fmax (sample->kinetic, fabs (sample->potential - r->potential0)));
  scale = fmax (scale, ledger_scene_energy (r));
  if (scale == 0) scale = fmax (fabs (sample->work), sample->loss); /* no masses, no stored energy */
  return defect == 0 ? 0 : fabs (defect) / scale;
}

const char *pw_run_energy_advice (const pw_run *r, double defect) {
  const double least_rtol = 1e-12; /* smaller ones gain little over round-off */
  const double per_step = 10;      /* acceptable defect of a step over rtol */
  const pw_statistics *now = &r->statistics;
  int projects = pw_stabilised_by (r, PW_PROJECTION);
  if (!projects && fmax (now->position, now->velocity) > 0.1 * defect)
    return "the constraints have drifted; a method with projection satisfies them";
  if (r->fixed_steps) return "a smaller step, or another method, follows the motion better";
  if (r->settings.rtol <= least_rtol) return "the tolerance cannot be much smaller; compare with another method";
  if (defect > per_step * r->settings.rtol * (double)now->steps)
    return "that is more than the tolerance explains; compare with another method";
  return "a smaller tolerance, or another method, follows the motion better";
}

/* Saturating forces, such as friction, which change by their own magnitude within a small range of velocities: bounds
 * on tolerances and on the use of Newton matrices.
 *
 * With a Newton matrix evaluated inside that range, at rest, where the force is steep, and used where it has saturated,
 * corrections are about as small as the range, however large the residual is: the iteration would seem to converge with
 * the force of another state.  So tolerances stay below the range, and a matrix is reused only while no state has moved
 * by more than the range of the state where it was evaluated. */

#define TOLERANCES_PART 0.1 /* largest error of a state over its change that changes a force by the force itself */

/* The root mean square of n errors in units of their tolerances may be 1, so a single error may be sqrt (n) times its
 * tolerance. */
void pw_bound_tolerances (pw_run *r) {
  int coords = r->s->coords, n = 2 * coords;
  if (!r->s->saturates) return;
  pw_evaluate_saturation (r->w, r->tolerance_bound);
  for (int j = 0; j < n; j++) {
    double y = j < coords ? r->q[j] : r->v[j - coords];
    r->matrix_outdated |= fabs (y - r->matrix_state[j]) > r->matrix_range[j];
    r->tolerance_bound[j] *= TOLERANCES_PART / sqrt (n);
  }
}

double pw_saturation_range (const pw_run *r, int state) {
  return r->tolerance_bound[state] * sqrt (2 * r->s->coords) / TOLERANCES_PART;
}

void pw_matrix_evaluated (pw_run *r, const double *q, const double *v) {
  int coords = r->s->coords;
  r->matrix_outdated = 0;
  if (!r->s->saturates) return;
  memcpy (r->matrix_state, q, (size_t)coords * sizeof *q);
  memcpy (r->matrix_state + coords, v, (size_t)coords * sizeof *v);
  pw_evaluate_saturation (r->w, r->matrix_range);
}

double pw_first_step (const pw_run *r) {
  double T = r->w->scale.time, h = 0.5 * T * sqrt (r->settings.rtol);
  for (int j = 0, n = r->s->coords; j < n; j++) {
    if (r->v[j] != 0) h = fmin (h, fmax (r->tolerance_bound[j] / fabs (r->v[j]), 1e-9 * T));
    if (r->a[j] != 0) h = fmin (h, fmax (r->tolerance_bound[n + j] / fabs (r->a[j]), 1e-9 * T));
  }
  return h;
}

int pw_run_saturation (pw_run *r, double *least, char *element, size_t size) {
  if (!r->s->saturates) return -1;
  double *at_rest = r->scratch;
  for (int j = 0; j < r->s->coords; j++) at_rest[j] = 0;
  (void)pw_update_kinematics (r->w, r->t, r->q, r->v); /* since a sample, the workspace may be at another state */
  pw_hold_signals (r->w, PW_HOLD_FORCES);              /* a signal that reads velocities may have no value at rest */
  (void)pw_update_kinematics (r->w, r->t, r->q, at_rest);
  int state = pw_find_saturation (r->w, least, element, size);
  pw_hold_signals (r->w, PW_HOLD_NONE);
  (void)pw_update_kinematics (r->w, r->t, r->q, r->v);
  return state;
}
