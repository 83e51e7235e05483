/* Breakpoints that move with a parameter.  At a breakpoint t_b the accelerations jump from a- to a+ and the states do
 * not; the derivatives of the states at constant time therefore jump by
 *
 *     dv+ = dv- + (a- - a+) dt_b/dp,
 *
 * and those of work and losses by (P- - P+) dt_b/dp, with their powers P (Rozenvasser 1967; Hairer, Norsett & Wanner
 * 1993, section I.14, for smooth problems).  dt_b/dp comes from the breakpoints of the neighbouring runs. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "variation_parts.h"

/* The breakpoints of the neighbours may deviate from a linear function of p by this part of their movement; curvature
 * over a step is far smaller. */
static const double BREAKPOINT_SMOOTH = 1e-3;

/* The derivative of a breakpoint by p, or its error (c = 1); exactly 0 if the breakpoint does not move. */
static double breakpoint_derivative (const pw_direction_copy *d, int c) {
  double sum = 0;
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS; i++)
    sum += pw_direction_weight (&d->given, c, i) * (d->breakpoint[i] - d->breakpoint[1]);
  return sum;
}

/* 1 if the neighbours' breakpoints lie smoothly around the run's: they surround it evenly (unless one_sided), and the
 * derivatives with the two steps, whose difference is 3 times the error, agree. */
static int breakpoint_smooth (const pw_direction_copy *d, double next) {
  double most = 0, mean = 0, step = fabs (d->given.step), round = 64 * DBL_EPSILON * (1 + fabs (next));
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS; i++) {
    most = fmax (most, fabs (d->breakpoint[i] - next));
    mean += (d->breakpoint[i] - next) / PW_VARIATION_NEIGHBOURS;
  }
  double allowed = BREAKPOINT_SMOOTH * most + round;
  if (!d->given.one_sided && !(fabs (mean) <= allowed)) return 0;
  return 3 * fabs (breakpoint_derivative (d, 1)) * step <= allowed;
}

int pw_variation_look_ahead (pw_variation *x, pw_direction_copy *d, double next, pw_error *error) {
  int infinite = 0;
  d->first = d->given.initial ? -INFINITY : d->breakpoint[0];
  d->last = INFINITY;
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS && d->given.initial == NULL; i++) {
    d->first = fmax (d->first, d->breakpoint[i]);
    d->breakpoint[i] = pw_run_next_breakpoint (d->given.neighbour[i], d->breakpoint[i]);
    if (isnan (d->breakpoint[i])) return pw_fail (error, PW_METHOD, "a signal has no next breakpoint");
    infinite += isinf (d->breakpoint[i]) != 0;
    d->last = fmin (d->last, d->breakpoint[i]);
  }
  if (d->given.initial || (infinite == PW_VARIATION_NEIGHBOURS && isinf (next))) return PW_OK;
  if (infinite == 0 && isfinite (next) && breakpoint_smooth (d, next)) return PW_OK;
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the order of breakpoints changes with the parameter of direction %d: the motion is not "
                  "differentiable",
                  x->t, (int)(d - x->direction) + 1);
}

/* Prescribed velocities jump if the residual of velocity constraints grows by more than this, in units of the scene. */
static const double BREAKPOINT_VELOCITY = 1e-6;

/* The residual of velocity constraints at the state evaluated. */
static double breakpoint_residual (pw_variation *x) {
  pw_residuals now;
  if (pw_evaluate_J_at (x->r->w, x->at, x->q, x->v) != PW_OK) return NAN;
  pw_evaluate_velocity_residual (x->r->w, x->r->active, &now);
  return now.velocity;
}

/* Accelerations at the state evaluated and, with the ledger, powers. */
static int breakpoint_rates (pw_variation *x, double *rates) {
  memcpy (rates, x->linear.a, (size_t)x->n * sizeof *rates);
  if (!x->ledger) return PW_OK;
  if (pw_evaluate_J_at (x->r->w, x->at, x->q, x->v) != PW_OK) return PW_METHOD;
  pw_ledger_rates (x->r, x->linear.lambda, rates + x->n);
  return PW_OK;
}

int pw_variation_jump (pw_variation *x, double t, const double *state, pw_error *error) {
  int n = x->n, status = PW_OK;
  double *before = x->values, *after = before + n + x->entries;
  if (breakpoint_rates (x, before) != PW_OK) return pw_fail_signal (x->t, error);
  memcpy (x->q, state, (size_t)n * sizeof *x->q);
  memcpy (x->v, state + n, (size_t)n * sizeof *x->v);
  status = pw_variation_evaluate (x, t, error);
  if (status != PW_OK) return status;
  if (breakpoint_rates (x, after) != PW_OK) return pw_fail_signal (t, error);
  PW_EACH_COLUMN (c, x) {
    memcpy (c->trial, c->Y, (size_t)x->size * sizeof *c->Y);
    for (int j = n; j < x->size; j++) c->trial[j] += (before[j - n] - after[j - n]) * c->slope;
  }
  x->t = t;
  return pw_variation_restart (x, error);
}

int pw_variation_pass_breakpoint (pw_variation *x, pw_error *error) {
  double next = pw_run_next_breakpoint (x->r, x->t), residual = breakpoint_residual (x);
  int status = PW_OK;
  PW_EACH_COLUMN (c, x) c->slope = d->given.initial ? 0 : breakpoint_derivative (d, pw_variation_column_index (c));
  for (int i = 0; i < x->count && status == PW_OK; i++)
    status = pw_variation_look_ahead (x, &x->direction[i], next, error);
  if (status == PW_OK) status = pw_variation_jump (x, x->t, x->point[0].x, error);
  if (status == PW_OK && !(breakpoint_residual (x) <= 2 * residual + BREAKPOINT_VELOCITY))
    status =
        pw_fail (error, PW_METHOD, "t = %.6g s: prescribed velocities jump: the motion is not differentiable", x->t);
  if (status == PW_OK) memcpy (x->point[0].x + 2 * x->n, x->linear.a, (size_t)x->n * sizeof (double));
  if (status == PW_OK) x->passed = x->t;
  return status;
}

double pw_variation_breakpoint (const pw_variation *x, int i, double *slope) {
  const pw_direction_copy *d = &x->direction[i];
  *slope = d->given.initial == NULL && isfinite (d->breakpoint[0]) ? breakpoint_derivative (d, 0) : 0;
  return pw_run_next_breakpoint (x->r, x->t);
}
