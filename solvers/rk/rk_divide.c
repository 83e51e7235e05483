/* Runge-Kutta methods: fixed steps, and samples inside the last step.
 *
 * Fixed steps end at multiples of the step size, at t_end and at breakpoints.  A sample is a step from the beginning of
 * the last one, as accurate as the method.  A stage that lands on a singular configuration spoils either of them.  Then
 * several divisions in two parts are tried until the results of two of them agree. */
#include <math.h>
#include <string.h>
#include "dense_output.h"
#include "rk_step.h"

/* A step to t: state in d->q, ledger in ledger_at; energy: 1 to compute projected_at. */
static int divide_step (pw_run *r, const pw_rk_begin *from, double t, int project, int energy) {
  const double h = t - from->t, reached = r->t;
  double *const q = r->q, *const v = r->v, *const a = r->a, *const rate = r->rate, added = 0;
  const size_t n = (size_t)r->s->coords + 3;
  r->t = from->t, r->q = from->q, r->v = from->q + n, r->a = from->q + 2 * n, r->rate = from->rate;
  int status = pw_rk_step (r, h, t, project, energy ? &added : NULL);
  r->t = reached, r->q = q, r->v = v, r->a = a, r->rate = rate;
  pw_rk_ledger (r, r->ledger_at, from->ledger, h);
  r->projected_at = from->projected + added;
  return status;
}

/* The same in two parts, by way of the time `by`. */
static int divide_two_parts (pw_run *r, const pw_rk_begin *from, double by, double t, int project) {
  struct pw_method_data *d = r->data;
  int status = divide_step (r, from, by, project, 1);
  if (status != PW_OK) return status;
  d->middle.t = by, d->middle.projected = r->projected_at;
  memcpy (d->middle.q, d->q, pw_rk_block (r, 0));
  memcpy (d->middle.ledger, r->ledger_at, (size_t)r->s->entries * sizeof (double));
  pw_ledger_rates (r, d->lambda, d->middle.rate);
  return divide_step (r, &d->middle, t, project, 1);
}

/* Tries divisions of the step to t1 in two parts of irregular sizes, the first one longer than to `least`, until two
 * results are closer than `best`; *by: that of the closest, which must be closer than `enough`.  status: of the undivided
 * step, whose result is in d->q.  In a step from the state reached, energy added by projections is an error, too. */
static int divide (pw_run *r, const pw_rk_begin *from, int status, double t1, int project, double least, double *by) {
  static const double part[] = { 0.382, 0.681, 0.209, 0.847, 0.127, 0.541, 0.943, 0.302, 0.764, 0.891 };
  const struct pw_method_data *d = r->data;
  double closest = INFINITY, energy = fmax (r->energy_scene, r->exchanged);
  int known = status == PW_OK, is_step = from->q == r->q; /* otherwise it is a sample */
  const double best = is_step ? r->limits.agree_best : r->limits.sample_best;
  const double enough = is_step ? r->limits.agree : r->limits.sample;
  if (known) memcpy (r->q_at, d->q, pw_rk_block (r, 1));
  for (size_t i = 0; i < sizeof part / sizeof *part && closest > best; i++) {
    double t = from->t + part[i] * (t1 - from->t);
    if (t <= least) continue;
    if (is_step && pw_run_stop_requested (r)) return PW_STOPPED;
    status = divide_two_parts (r, from, t, t1, project);
    r->statistics.rejected++;
    if (status < 0) return status;
    if (status != PW_OK) continue;
    double off = pw_rk_distance (r);
    if (is_step) off = fmax (off, fabs (r->projected_at - from->projected) / energy);
    if (known && off < closest) closest = off, *by = t;
    memcpy (r->q_at, d->q, pw_rk_block (r, 1));
    known = 1;
  }
  return closest <= enough ? PW_OK : PW_RETRY;
}

/* ---- Samples ---- */

int pw_rk_at (pw_run *r, double t, pw_error *error) {
  struct pw_method_data *d = r->data;
  const pw_rk_begin *from = &d->last;
  if (t > r->t || t < from->t) return pw_fail_outside (r, from->t, t, error);
  if (t == r->t) {
    pw_show_reached (r);
    return PW_OK;
  }
  const pw_statistics statistics = r->statistics;
  const double refuse = r->refuse;
  const int near = r->near_singular;
  double by;
  r->near_singular = 0;
  r->refuse = 0;
  int status = divide_step (r, from, t, d->projects, r->settings.ledger);
  if (r->near_singular && status >= 0) {
    status = divide (r, from, status, t, d->projects, from->t, &by);
    if (status == PW_OK) status = divide_two_parts (r, from, by, t, d->projects);
  }
  memcpy (r->q_at, d->q, pw_rk_block (r, 1));
  r->statistics = statistics, r->refuse = refuse, r->near_singular = near;
  if (status < 0) return pw_fail_signal (t, error);
  return status == PW_OK ? PW_OK : pw_rk_fail (r, status, t - from->t, error);
}

/* ---- Fixed steps ---- */

/* If the end of the step to t1 lands on a singular configuration, a longer one, up to `stop`, is divided so that the
 * first part ends after t1.  The error of the accelerations there, with which the next step would begin, is that of the
 * state over the sine: `lands` 1: the step to t1 is used only if no longer one can be.  Accepts the first part, which ends at
 * *t. */
static int fixed_step_around (pw_run *r, int status, int lands, double t1, double stop, int project, double *t) {
  static const double beyond[] = { 0.62, 2.62, 7.62 };
  const pw_rk_begin from = { r->t, r->q, r->ledger, r->rate, r->projected };
  double added = 0;
  if (!lands) status = divide (r, &from, status, t1, project, r->t, t);
  if (lands && status == PW_OK) status = PW_RETRY;
  for (size_t i = 0; i < sizeof beyond / sizeof *beyond && status == PW_RETRY && t1 < stop; i++)
    status = divide (r, &from, status, fmin (t1 + beyond[i] * r->settings.step, stop), project, t1, t);
  if (lands && status == PW_RETRY) status = divide (r, &from, status, t1, project, r->t, t);
  if (status == PW_OK) status = pw_rk_step (r, *t - r->t, *t, project, &added);
  if (status == PW_OK) pw_rk_accept (r, *t - r->t, *t, r->settings.ledger ? added : 0);
  return status;
}

int pw_rk_advance_fixed (pw_run *r, double t_end, pw_error *error) {
  struct pw_method_data *d = r->data;
  int whole, project = d->projects && (r->statistics.steps + 1) % d->every == 0;
  double added = 0, t1 = pw_step_end (r, d->base, d->count, t_end, &whole),
         h = whole && !d->split ? r->settings.step : t1 - r->t;
  const int split = d->split;
  r->near_singular = 0;
  int status = pw_rk_step (r, h, t1, project, r->settings.ledger ? &added : NULL);
  int lands = r->near_singular && r->geometry.evaluated_sine < r->limits.lands * r->geometry.checked_sine;
  d->split = r->near_singular && !d->split;
  double stop = whole ? fmin (t_end, r->breakpoint) : t1, t = t1;
  if (d->split) status = fixed_step_around (r, status, lands, t1, stop, project, &t);
  if (r->stopped) {
    d->split = split;
    return PW_STOPPED;
  }
  if (status != PW_OK) return pw_rk_fail (r, status, r->settings.step, error);
  r->statistics.steps++;
  if (d->split) {
    if (t > t1) d->count = (long)floor ((t - d->base) / r->settings.step);
    return PW_OK;
  }
  pw_rk_accept (r, h, t1, added);
  d->count++;
  if (!whole) d->base = t1, d->count = 0;
  return PW_OK;
}
