/* Runge-Kutta methods: fixed steps, and samples inside the last step.
 *
 * Fixed steps end at multiples of the step size, at t_end and at breakpoints.  A sample is a step from the beginning of
 * the last step, as accurate as the method.  If a stage of a step or sample lands near a singular configuration, its
 * accelerations are inaccurate.  Then the step, unless it follows a divided one, is divided in two parts, at different
 * times, until two results agree. */
#include <math.h>
#include <string.h>
#include "dense_output.h"
#include "rk_step.h"

/* A step to t from the state `from`, which temporarily replaces the state reached: computes the new state, and its
 * ledger in r->ledger_at; with_energy: 1 to compute r->projected_at, too. */
static int fixed_step_from (pw_run *r, const pw_step_start *from, double t, int project, int with_energy) {
  const double h = t - from->t, t_reached = r->t;
  double *const q = r->q, *const v = r->v, *const a = r->a, *const rate = r->rate;
  double added_energy = 0;
  const size_t n = (size_t)r->s->coords + 3;
  r->t = from->t, r->q = from->q, r->v = from->q + n, r->a = from->q + 2 * n, r->rate = from->rate;
  int status = pw_rk_step (r, h, t, project, with_energy ? &added_energy : NULL);
  r->t = t_reached, r->q = q, r->v = v, r->a = a, r->rate = rate;
  pw_rk_ledger (r, r->ledger_at, from->ledger, h);
  r->projected_at = from->projected + added_energy;
  return status;
}

/* The same in two parts, with the energy, the first one up to the time `between`. */
static int fixed_two_parts (pw_run *r, const pw_step_start *from, double between, double t, int project) {
  pw_method_data *d = r->data;
  int status = fixed_step_from (r, from, between, project, 1);
  if (status != PW_OK) return status;
  d->second.t = between, d->second.projected = r->projected_at;
  memcpy (d->second.q, d->q, pw_state_length (r->s) * sizeof *d->q);
  memcpy (d->second.ledger, r->ledger_at, (size_t)r->entries * sizeof (double));
  pw_ledger_rates (r, d->lambda, d->second.rate);
  return fixed_step_from (r, &d->second, t, project, 1);
}

/* Divides the step to t1 at several times after `earliest`, until two successive results differ by at most `best`;
 * *between: the time of division with the least difference.  PW_RETRY if that exceeds `acceptable`; PW_STOPPED or
 * PW_METHOD.  status: of the undivided step, whose result is in d->q.  In a step from the state reached, energy added
 * by projections is an error, too. */
static int fixed_divide (pw_run *r, const pw_step_start *from, int status, double t1, int project, double earliest,
                         double *between) {
  /* fractions of the step; irregular, since configurations may recur */
  static const double part[] = { 0.382, 0.681, 0.209, 0.847, 0.127, 0.541, 0.943, 0.302, 0.764, 0.891 };
  const pw_method_data *d = r->data;
  const size_t bytes = pw_state_length (r->s) * sizeof *d->q;
  double least = INFINITY, energy = fmax (r->scene_energy, r->exchanged);
  int has_result = status == PW_OK, is_step = from->q == r->q; /* otherwise it is a sample */
  const double best = is_step ? r->thresholds.agree_best : r->thresholds.sample_best;
  const double acceptable = is_step ? r->thresholds.agree : r->thresholds.sample;
  if (has_result) memcpy (r->q_at, d->q, bytes);
  for (size_t i = 0; i < sizeof part / sizeof *part && least > best; i++) {
    double t = from->t + part[i] * (t1 - from->t);
    if (t <= earliest) continue;
    if (is_step && pw_run_stop_requested (r)) return PW_STOPPED;
    status = fixed_two_parts (r, from, t, t1, project);
    r->statistics.rejected++;
    if (status < 0) return status;
    if (status != PW_OK) continue;
    double difference = pw_rk_distance (r);
    if (is_step) difference = fmax (difference, fabs (r->projected_at - from->projected) / energy);
    if (has_result && difference < least) least = difference, *between = t;
    memcpy (r->q_at, d->q, bytes);
    has_result = 1;
  }
  return least <= acceptable ? PW_OK : PW_RETRY;
}

int pw_rk_at (pw_run *r, double t, pw_error *error) {
  pw_method_data *d = r->data;
  const pw_step_start *from = &d->last;
  if (t > r->t || t < from->t) return pw_fail_outside (r, from->t, t, error);
  if (t == r->t) {
    pw_sample_reached (r);
    return PW_OK;
  }
  const pw_statistics statistics = r->statistics;
  const double refused_sine = r->refused_sine;
  const int near_singular = r->near_singular;
  double between;
  r->near_singular = 0;
  r->refused_sine = 0; /* a sample is divided, not refused, near a singular configuration */
  int status = fixed_step_from (r, from, t, d->projects, r->settings.ledger), divided = r->near_singular && status >= 0;
  if (divided) {
    status = fixed_divide (r, from, status, t, d->projects, from->t, &between);
    if (status == PW_OK) status = fixed_two_parts (r, from, between, t, d->projects);
  }
  memcpy (r->q_at, d->q, pw_state_length (r->s) * sizeof *d->q);
  r->statistics = statistics, r->refused_sine = refused_sine, r->near_singular = near_singular;
  if (status < 0) return pw_fail_signal (t, error);
  return status == PW_OK ? PW_OK : pw_rk_fail (r, status, from->t, t - from->t, divided, error);
}

/* Replaces a step to t1 near a singular configuration, which returned `status`, by the first part of a divided step,
 * and accepts that part; *t: its end.
 *
 * Accelerations at the end of a step, with which the next one begins, have the error of the state over the sine.  So if
 * the step ends at the singular configuration (singular: 1), longer ones, up to `stop`, are tried first, whose
 * first part ends after t1; otherwise they are tried if no division of the step to t1 is accurate. */
static int fixed_step_around (pw_run *r, int status, int singular, double t1, double stop, int project, double *t) {
  static const double beyond[] = { 0.62, 2.62, 7.62 }; /* in step sizes; irregular, since configurations may recur */
  const pw_step_start from = { .t = r->t, .projected = r->projected, .q = r->q, .ledger = r->ledger, .rate = r->rate };
  double added_energy = 0;
  if (!singular) status = fixed_divide (r, &from, status, t1, project, r->t, t);
  if (singular && status == PW_OK) status = PW_RETRY;
  for (size_t i = 0; i < sizeof beyond / sizeof *beyond && status == PW_RETRY && t1 < stop; i++)
    status = fixed_divide (r, &from, status, fmin (t1 + beyond[i] * r->settings.step, stop), project, t1, t);
  if (singular && status == PW_RETRY) status = fixed_divide (r, &from, status, t1, project, r->t, t);
  if (status == PW_OK) status = pw_rk_step (r, *t - r->t, *t, project, &added_energy);
  if (status == PW_OK) pw_rk_accept (r, *t - r->t, *t, r->settings.ledger ? added_energy : 0);
  return status;
}

int pw_rk_advance_fixed (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  int whole, project = pw_rk_projects_next (r);
  const int was_off_grid = d->off_grid;
  double added_energy = 0, t1 = pw_step_end (r, &d->counter, t_end, &whole);
  double h = whole && !was_off_grid ? r->settings.step : t1 - r->t;
  int status = pw_rk_step (r, h, t1, project, r->settings.ledger ? &added_energy : NULL);
  int ends_singular =
      r->near_singular && r->watchdog.evaluated_sine < r->thresholds.ends_singular * r->watchdog.checked_sine;
  d->off_grid = r->near_singular && !was_off_grid;
  double stop = whole ? fmin (t_end, r->breakpoint) : t1, t = t1;
  if (d->off_grid) status = fixed_step_around (r, status, ends_singular, t1, stop, project, &t);
  if (status != PW_OK) {
    if (status != PW_STOPPED) status = pw_rk_fail (r, status, r->t, r->settings.step, d->off_grid, error);
    d->off_grid = was_off_grid;
    return status;
  }
  r->statistics.steps++;
  if (d->off_grid) { /* `counter` counts it with the next step, to the next multiple */
    if (t > t1) d->counter.count = (long)floor ((t - d->counter.base) / r->settings.step);
    return PW_OK;
  }
  pw_rk_accept (r, h, t1, added_energy);
  pw_count_step (&d->counter, whole, t1);
  return PW_OK;
}
