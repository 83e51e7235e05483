/* Runge-Kutta methods with step-size control.
 *
 *   h_new = 0.9 h err^(3 m / 4 - k) err_last^m,  limited to h/5 ... 5 h; after a rejection to 0.9 h
 *
 * with k the tableau's exponent and m its memory (Gustafsson 1991; Hairer, Norsett & Wanner 1993, section II.4).  err
 * is the root mean square error of positions and velocities in units of the tolerances.  A projection leaves the part
 * of the error tangential to the constraints (Eich 1993; Hindmarsh et al., CVODE), to which a small part of the whole
 * error is added:
 *
 *   err = sqrt (tangential^2 + rtol^(1/2) whole^2)   so that the displacement by the projection is at most rtol^(3/4)
 *
 * Through the curvature of the constraints, the square of the displacement adds to the tangential error; without this
 * limit the steps of a mostly prescribed motion would grow until that square dominates.
 *
 * Where a force reverses within a step, such as friction, estimates of any order may miss it.  The largest change of
 * the acceleration at the stages, h |a_i - a| / 2, therefore counts like the error before a projection, so that a body
 * stopped by friction oscillates at speeds of at most rtol^(3/4).
 *
 * With estimates of the orders 3, 5 and 6, e5 is combined with e3 as in DOP853, and e6 guards both:
 *
 *   max (e5^2 / sqrt (e5^2 + e3^2 / 100), e6^3 / (e6^2 + e5^2))      of order h^8 and h^9 for smooth motions
 *
 * At the stability limit of a damped motion e5 may be blind to the instability while e3 is large for other reasons:
 * without e6 the error may then be many times the tolerances and remain undetected. */
#include <math.h>
#include <string.h>
#include "rk_step.h"

#define ADAPT_SAFETY 0.9       /* in the factor from one step size to the next */
#define ADAPT_GROWTH 5.        /* upper bound of that factor */
#define ADAPT_REDUCTION 0.2    /* its lower bound */
#define ADAPT_LEAST_ERROR 1e-4 /* least err_last: smaller errors are accidental and would predict too small a step */

void pw_rk_reset_step_size (pw_run *r) {
  pw_method_data *d = r->data;
  d->h = 0.1 * r->w->scale.time * pow (r->settings.rtol, d->tableau->exponent);
  d->last_error = ADAPT_LEAST_ERROR;
}

/* out = sum_j weight_j slope_j: an error estimate from n derivatives at the stages, over h. */
static void adapt_estimate (const pw_rk_row *e, double *const *slope, int n, double *out) {
  memset (out, 0, (size_t)n * sizeof *out);
  for (int j = 0; j < e->count; j++) pw_add_scaled (out, slope[e->stage[j]], e->weight[j], n);
}

/* Reciprocal tolerances for the step from the state reached to the new state: for each coordinate those of its position
 * and its velocity. */
static void adapt_weigh (const pw_run *r) {
  const pw_method_data *d = r->data;
  double *w = d->weight, rtol = r->settings.rtol;
  for (int j = 0, n = r->s->coords; j < n; j++) {
    *w++ = 1 / (pw_atol (r, j) + rtol * fmax (fabs (r->q[j]), fabs (d->q[j])));
    *w++ = 1 / (pw_atol (r, n + j) + rtol * fmax (fabs (r->v[j]), fabs (d->v[j])));
  }
}

/* Mean square of the errors of positions and velocities in units of the tolerances. */
static double adapt_mean_square (const pw_run *r, const double *eq, const double *ev) {
  const double *w = r->data->weight;
  int coords = r->s->coords;
  double sum = 0;
  for (int j = 0; j < coords; j++, w += 2) {
    double q = eq[j] * w[0], v = ev[j] * w[1];
    sum += q * q + v * v;
  }
  return sum / (2 * coords);
}

/* Mean square of an estimate before a projection, divided by h^2; stores its errors in r->q_at and r->v_at. */
static double adapt_whole (pw_run *r, const pw_rk_row *e) {
  pw_method_data *d = r->data;
  adapt_estimate (e, d->stage_v, r->s->coords, r->q_at);
  adapt_estimate (e, d->stage_a, r->s->coords, r->v_at);
  return adapt_mean_square (r, r->q_at, r->v_at);
}

/* Mean square of what a projection leaves of the errors in r->q_at and r->v_at, plus a small part of that before the
 * projection, `whole`; projected: 1 if the new state was. */
static double adapt_remaining (pw_run *r, double whole, int projected) {
  pw_method_data *d = r->data;
  if (!projected && !d->uses_nullspace) return whole;
  if (projected || d->nullspace_projects) pw_project_error (r, r->saddle, r->q_at, r->s->holonomic);
  pw_project_error (r, r->saddle, r->v_at, r->s->rows);
  return adapt_mean_square (r, r->q_at, r->v_at) + sqrt (r->settings.rtol) * whole;
}

/* The two errors of which the larger one counts (see the top of this file), from the squares of e3, e5, e6. */
static double adapt_combine (double square5, double square3) {
  return square5 == 0 ? 0 : square5 / sqrt (square5 + 0.01 * square3);
}

static double adapt_guard (double square6, double square5) {
  return square6 == 0 ? 0 : square6 * sqrt (square6) / (square6 + square5);
}

/* The error of the new state, divided by h. */
static double adapt_state (pw_run *r, int projected) {
  pw_method_data *d = r->data;
  const pw_tableau *tableau = d->tableau;
  d->stage_v[tableau->stages] = d->v, d->stage_a[tableau->stages] = d->a;
  adapt_weigh (r);
  double square5 = adapt_remaining (r, adapt_whole (r, &d->estimate[0]), projected);
  if (tableau->e3 == NULL) return sqrt (square5);
  double square3 = adapt_remaining (r, adapt_whole (r, &d->estimate[1]), projected);
  double square6 = adapt_whole (r, &d->estimate[2]), err = adapt_combine (square5, square3);
  if (adapt_guard (square6, square5) > err) /* otherwise the projection of e6, which mostly reduces it, is not needed */
    err = fmax (err, adapt_guard (adapt_remaining (r, square6, projected), square5));
  return err;
}

/* The error of work and losses, which projections do not change, divided by h. */
static double adapt_ledger (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const pw_tableau *tableau = d->tableau;
  double square[3] = { 0 }; /* of e5, e3, e6 */
  pw_ledger_rates (r, d->lambda, d->stage_rate[tableau->stages]);
  for (int k = 0; k < (tableau->e3 ? 3 : 1); k++) {
    adapt_estimate (&d->estimate[k], d->stage_rate, r->entries, r->ledger_at);
    square[k] = pow (pw_ledger_norm (r, h, r->ledger_at), 2);
  }
  double err =
      tableau->e3 ? fmax (adapt_combine (square[0], square[1]), adapt_guard (square[2], square[0])) : sqrt (square[0]);
  return isfinite (err) ? err : 0;
}

/* Half the root mean square of the largest changes of accelerations at the stages, over the tolerances of velocities.
 * Only coordinates count whose velocity changes, at one of the stages, by more than the range in which a force
 * saturates. */
static double adapt_reversal (const pw_run *r) {
  const pw_method_data *d = r->data;
  int n = r->s->coords, stages = d->tableau->stages;
  double sum = 0;
  for (int j = 0; j < n; j++) {
    double range = pw_saturation_range (r, n + j), moved = 0, change = 0;
    for (int i = 1; i <= stages && isfinite (range); i++) {
      moved = fmax (moved, fabs (d->stage_v[i][j] - r->v[j]));
      change = fmax (change, fabs (d->stage_a[i][j] - r->a[j]));
    }
    change *= moved > range ? 0.5 * d->weight[2 * j + 1] : 0;
    sum += change * change;
  }
  return sqrt (sum / (2 * n));
}

/* The factor from this step size to the next; see the top of this file. */
static double adapt_factor (const pw_method_data *d, double err) {
  const pw_tableau *tableau = d->tableau;
  if (err == 0) return ADAPT_GROWTH;
  double exponent = tableau->exponent - 0.75 * tableau->memory;
  double factor = ADAPT_SAFETY * pow (err, -exponent) * pow (d->last_error, tableau->memory);
  return fmin (ADAPT_GROWTH, fmax (ADAPT_REDUCTION, factor));
}

/* The step to t1 = t + h; *err: its error, accepted up to 1; INFINITY if the step fails.  If a signal jumps at t1, the
 * estimate uses the accelerations just before t1, since the jump is not an error of the step. */
static int adapt_step (pw_run *r, double h, double t1, int project, double *added_energy, double *err) {
  pw_method_data *d = r->data;
  double before = pw_before_breakpoint (r, t1);
  r->near_singular = 0;
  int status = pw_rk_step (r, h, t1, project, added_energy);
  if (status == PW_OK && before < t1) status = pw_run_accelerate (r, before, d->q, d->v, d->a, d->lambda);
  *err = status == PW_OK ? h * adapt_state (r, project) : INFINITY;
  if (r->entries > 0 && *err <= 1) *err = fmax (*err, h * adapt_ledger (r, h)); /* else it is rejected anyway */
  if (r->s->saturates && *err <= 1) *err = hypot (*err, pow (r->settings.rtol, 0.25) * h * adapt_reversal (r));
  if (status == PW_OK && before < t1) status = pw_run_accelerate (r, t1, d->q, d->v, d->a, d->lambda);
  if (status != PW_OK) *err = INFINITY;
  return status;
}

/* After a step that was shortened to end at t_end or a breakpoint, the next one has at least the size planned before,
 * and the error is remembered only if the step was long enough to predict that of the next one. */
static void adapt_accept (pw_run *r, double h, double t1, double added_energy, double err, double most_growth,
                          int shortened) {
  pw_method_data *d = r->data;
  double next = h * fmin (most_growth, adapt_factor (d, err));
  pw_rk_accept (r, h, t1, added_energy);
  pw_bound_tolerances (r);
  d->h = shortened ? fmax (next, d->h) : next;
  if (!shortened || h > 0.5 * d->h) d->last_error = fmax (err, ADAPT_LEAST_ERROR);
  r->statistics.steps++;
}

int pw_rk_advance_adaptive (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), most_growth = ADAPT_GROWTH;
  int status = PW_OK, project = pw_rk_projects_next (r);
  for (;;) {
    double t1 = r->t + d->h, added_energy = 0, err;
    int shortened = t1 > stop - 0.01 * d->h; /* or lengthened by up to 1 %, so that no tiny step remains */
    if (shortened) t1 = stop;
    double h = t1 - r->t;
    if (!shortened && !(h > pw_least_step (r))) {
      if (status != PW_OK) return pw_rk_fail (r, status, r->t, h, 0, error);
      return pw_fail (error, PW_METHOD, "t = %.6g s: the tolerances require a step below %.3g s", r->t, h);
    }
    if (most_growth < ADAPT_GROWTH && (status = pw_run_check_limits (r, error)) != PW_OK) return status;
    status = adapt_step (r, h, t1, project, r->settings.ledger ? &added_energy : NULL, &err);
    if (status < 0) return pw_fail_signal (r->t, error);
    if (err <= 1) {
      adapt_accept (r, h, t1, added_energy, err, most_growth, shortened);
      return PW_OK;
    }
    r->statistics.rejected++;
    d->h = h * (isfinite (err) ? fmin (0.9, adapt_factor (d, err)) : ADAPT_REDUCTION);
    most_growth = 1; /* no growth right after a rejection */
  }
}
