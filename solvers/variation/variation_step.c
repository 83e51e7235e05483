/* Error control of the derivatives' steps: explicit ones, and implicit ones if the motion is stiff. */
#include <math.h>
#include <string.h>
#include "variation_parts.h"

/* Permitted error of a step, relative to the largest derivative; at least a tenth of the rtol of a run that adapts its
 * steps.  STEP_LOOSE applies where the derivatives would need more than one linearisation per fixed step of the run:
 * the run's steps, too, are large for such a fast motion. */
static const double STEP_TOLERANCE = 1e-9, STEP_LOOSE = 1e-7;
enum { STEP_LINEARISATIONS = 5 }; /* in an explicit step of the derivatives */

/* Least value of step_motion_tolerance. */
static const double STEP_MOTION = 1e-8;

/* Round-off of positions, relative to the scene or themselves, which interpolation between fixed steps turns into
 * errors of velocities. */
static const double STEP_ROUND = 1e-14;

/* Errors of derivatives of the state by a parameter p are relative to the largest of these, or to STEP_LEAST_DERIVATIVE
 * / |p| in units of the scene if that is larger; the step of the differences is about STEP_OF_PARAMETER |p|.  Errors of
 * derivatives of work and losses are relative to the largest of these, or to STEP_LEAST_ENERGY times the energy (the
 * larger of `exchanged` and `scene_energy` of the run) times what those of the state are relative to. */
static const double STEP_LEAST_DERIVATIVE = 0.1, STEP_OF_PARAMETER = 1e-5, STEP_LEAST_ENERGY = 1e-3;

/* The least step is this multiple of the scale of time T, or pw_least_step if that is larger. */
static const double STEP_SMALLEST = 1e-12;

/* Sine between constraint equations below which the round-off of accelerations prevents steps. */
static const double STEP_SINGULAR = 0.01;

/* Let z be the size of a step times the rate at which the fastest component of the derivatives decays.  x->stiff grows
 * by 1 after a step with z > STEP_FAST and falls by 1, not below 0, after any other; at STEP_STIFF the motion is stiff.
 * z is about 0.2 where a tolerance of 1e-9 limits the step, 3.3 where stability does (Hairer & Wanner 1996, IV.2). */
enum { STEP_STIFF = 100 };
static const double STEP_FAST = 1;

/* Largest derivative of work and losses. */
static double step_largest_energy (const pw_variation *x, const double *Y) {
  double most = 0;
  for (int i = 2 * x->n; i < x->size; i++) most = pw_larger_or_nan (most, fabs (Y[i]));
  return most;
}

/* The largest velocity in units of the scene. */
static double step_largest_velocity (const pw_variation *x, const double *v) {
  double most = 0;
  for (int j = 0; j < x->n; j++)
    most = pw_larger_or_nan (most, fabs (v[j]) * x->r->w->scale.time / pw_unit (x->r->s, j));
  return most;
}

/* The error with which the formula of the derivatives' step integrates the run's accelerations, relative to the largest
 * velocity: a short phase of the motion, such as a reversal of friction, may not show in the derivatives' errors. */
static double step_motion_error (const pw_variation *x) {
  return step_largest_velocity (x, x->motion_error) / fmax (1, x->speed);
}

/* The run's error: that of the change of its velocities over a step, in units of the scene.  With adaptive steps,
 * interpolation gives each of two velocities to a tenth of rtol (pw_variation_refine). */
static double step_run_error (const pw_variation *x) {
  double most = 1;
  if (!x->r->fixed_steps) return 2 * 0.1 * x->r->settings.rtol * fmax (1, x->speed);
  for (int j = 0; j < x->n; j++) most = fmax (most, fabs (x->q[j]) / pw_unit (x->r->s, j));
  return STEP_ROUND * most * x->r->w->scale.time / fmin (x->r->settings.step, x->r->w->scale.time);
}

/* The permitted step_motion_error: STEP_MOTION, or the run's error times x->reversal if that is larger; x->reversal is
 * small in motions with forces that reverse fast, where smaller errors matter. */
static double step_motion_tolerance (const pw_variation *x) {
  return fmax (STEP_MOTION, step_run_error (x) * x->reversal / fmax (1, x->speed));
}

/* The defect is relative to at least STEP_CHANGE, or STEP_CHANGE_RTOL rtol, times the largest velocity: the round-off
 * of a body in free flight, whose velocity does not change, is no defect. */
static const double STEP_CHANGE = 1e-6, STEP_CHANGE_RTOL = 1000;

/* The difference between the change of the run's velocities and the integral of its accelerations over a step, relative
 * to h times the largest acceleration, at most 1: large where the run does not resolve the motion.  The error of the
 * formula (x->motion_error), and the run's error times x->reversal, are subtracted. */
static double step_defect (const pw_variation *x, double h) {
  int stages = x->implicit ? 1 + PW_VARIATION_STAGES : PW_VARIATION_RATES - 1;
  double most = fmax (STEP_CHANGE, x->r->fixed_steps ? 0 : STEP_CHANGE_RTOL * x->r->settings.rtol) * fmax (1, x->speed);
  for (int k = 0; k < stages; k++) most = fmax (most, h * step_largest_velocity (x, x->a[k]));
  double defect = step_largest_velocity (x, x->motion_defect) - step_run_error (x) * x->reversal -
                  step_largest_velocity (x, x->motion_error);
  return defect > 0 ? fmin (1, defect / most) : 0;
}

/* What the errors of a derivative are relative to. */
static double step_reference (const pw_variation *x, const pw_direction_copy *d) {
  double size = fmax (d->column->largest, pw_variation_norm (x, d->column->trial));
  return d->given.initial ? size : fmax (size, STEP_LEAST_DERIVATIVE * STEP_OF_PARAMETER / fabs (d->given.step));
}

static double step_energy_reference (const pw_variation *x, const pw_direction_copy *d) {
  double energy = fmax (d->column->energy, step_largest_energy (x, d->column->trial));
  return fmax (energy, STEP_LEAST_ENERGY * fmax (x->r->exchanged, x->r->scene_energy) * step_reference (x, d));
}

/* The largest relative error of all derivatives. */
static double step_error (const pw_variation *x) {
  double most = 0;
  for (const pw_direction_copy *d = x->direction; d < x->direction + x->count; d++) {
    double size = step_reference (x, d), energy = step_energy_reference (x, d);
    if (size > 0) most = pw_larger_or_nan (most, pw_variation_norm (x, d->local_error) / size);
    if (energy > 0) most = pw_larger_or_nan (most, step_largest_energy (x, d->local_error) / energy);
  }
  return most;
}

/* Adds to the errors of derivatives those of the step, and the part of the derivatives' change that the run does not
 * resolve, step_defect. */
static void step_add_errors (pw_variation *x, double defect) {
  for (pw_direction_copy *d = x->direction; d < x->direction + x->count; d++) {
    const pw_variation_column *derivative = &d->column[0];
    double *error = d->column[1].trial;
    for (int j = 0; j < x->size && d->columns > 1; j++) {
      error[j] += d->local_error[j];
      error[j] += copysign (defect * (derivative->trial[j] - derivative->Y[j]), error[j]);
    }
  }
}

/* Scales an estimate of order h^4 and magnitude r = `relative` to (10 r)^(3/2), of order h^6 like the error of the
 * step, if that is smaller.  It meets a tolerance tol if r <= 0.1 tol^(2/3), which is the test of RADAU5. */
static void step_scale_error (double *error, double relative, int n) {
  double factor = fmin (1, sqrt (1000 * relative));
  for (int j = 0; j < n && relative > 0; j++) error[j] *= factor;
}

static void step_implicit_errors (pw_variation *x) {
  for (pw_direction_copy *d = x->direction; d < x->direction + x->count; d++) {
    step_scale_error (d->local_error, pw_variation_norm (x, d->local_error) / step_reference (x, d), 2 * x->n);
    step_scale_error (d->local_error + 2 * x->n, step_largest_energy (x, d->local_error) / step_energy_reference (x, d),
                      x->size - 2 * x->n);
  }
  step_scale_error (x->motion_error, step_motion_error (x), x->n);
}

/* Computes the stages, the new derivatives into `trial`, their time derivatives and errors.  The errors follow from the
 * time derivatives of column 0, and are added to column 1 before the time derivatives there are evaluated. */
static int step_stages (pw_variation *x, double h, double t1, pw_error *error) {
  int last = PW_VARIATION_RATES - 1;
  pw_variation_state (x, x->t, x->scratch);
  pw_variation_state (x, t1, x->values);
  for (int j = x->n; j < 2 * x->n; j++) x->motion_defect[j - x->n] = x->scratch[j] - x->values[j];
  int status =
      x->implicit ? pw_variation_implicit_stages (x, h, t1, error) : pw_variation_explicit_stages (x, h, t1, error);
  if (status != PW_OK) return status;
  memcpy (x->a[last], x->linear.a, (size_t)x->n * sizeof *x->q);
  status = pw_variation_time_derivatives (x, 0, last, error);
  if (status != PW_OK) return status;
  if (x->implicit)
    step_implicit_errors (x);
  else
    pw_variation_explicit_errors (x, h);
  step_add_errors (x, step_defect (x, h));
  return pw_variation_time_derivatives (x, 1, last, error);
}

/* The end of the step becomes the beginning of the next one. */
static void step_accept (pw_variation *x) {
  memcpy (x->a[0], x->a[PW_VARIATION_RATES - 1], (size_t)x->n * sizeof *x->q);
  x->speed = fmax (x->speed, step_largest_velocity (x, x->v));
  PW_EACH_COLUMN (c, x) {
    double *first = c->K[0];
    memcpy (c->Y, c->trial, (size_t)x->size * sizeof *c->Y);
    c->K[0] = c->K[PW_VARIATION_RATES - 1];
    c->K[PW_VARIATION_RATES - 1] = first;
    c->largest = fmax (c->largest, pw_variation_norm (x, c->Y));
    c->energy = fmax (c->energy, step_largest_energy (x, c->Y));
  }
}

int pw_variation_restart (pw_variation *x, pw_error *error) {
  PW_EACH_COLUMN (c, x) {
    pw_variation_project (x, c);
    c->largest = fmax (c->largest, pw_variation_norm (x, c->trial));
  }
  int status = pw_variation_all_time_derivatives (x, PW_VARIATION_RATES - 1, error);
  if (status == PW_OK) step_accept (x);
  return status;
}

/* The size of the next step divided by that of one with the error `off`.  The error of the last accepted step, counted
 * as at least 1e-4 of the tolerance since the first step has none before, damps oscillations of the step size at the
 * limit of stability (Hairer & Wanner 1996, section IV.2: exponents 1 / order - 0.75 b and b, b = 0.04). */
static double step_factor (const pw_variation *x, double off, double tolerance) {
  double factor = 0.9 * pow (off / tolerance, -0.17) * pow (fmax (x->last_error, 1e-4 * tolerance) / tolerance, 0.04);
  return fmin (5, fmax (0.2, factor));
}

/* The size of the step after one of size h with the error `off`: the larger of those for `tolerance`, and for
 * STEP_LOOSE but at most loose_size. */
static double step_next_size (const pw_variation *x, double h, double off, double tolerance, double loose_size) {
  if (!isfinite (off)) return h / 10;
  return fmax (h * step_factor (x, off, tolerance), fmin (h * step_factor (x, off, STEP_LOOSE), loose_size));
}

/* The end of the next step; the last two steps to t1 have the same size. */
static double step_end (const pw_variation *x, double t1) {
  double rest = t1 - x->t;
  if (!(x->h < rest * (1 - 1e-9))) return fmin (t1, x->r->t);
  return fmin (x->t + (2 * x->h > rest ? rest / 2 : x->h), x->r->t);
}

/* The error if steps have become too small. */
static int step_fail (pw_variation *x, pw_error *error) {
  int J_known = pw_evaluate_J_at (x->r->w, x->at, x->q, x->v) == PW_OK;
  return pw_fail (
      error, PW_METHOD, "t = %.6g s: %s", x->t,
      J_known && pw_watchdog_sine (x->r, NULL) < STEP_SINGULAR
          ? "the derivatives cannot be computed near a singular configuration, where constraints are nearly "
            "dependent"
          : "no step of the derivatives meets their tolerance, however small: the motion is too stiff, or "
            "not differentiable");
}

/* Changes to implicit steps if stability limited many steps. */
static int step_check_stiffness (pw_variation *x, double h, pw_error *error) {
  if (x->implicit || x->n > PW_VARIATION_DENSE) return PW_OK;
  x->stiff = pw_variation_stiffness (x, h) > STEP_FAST ? x->stiff + 1 : x->stiff > 0 ? x->stiff - 1 : 0;
  if (x->stiff < STEP_STIFF) return PW_OK;
  x->implicit = pw_variation_implicit_open (x);
  return x->implicit ? PW_OK : pw_fail_memory (x->r->s, error);
}

int pw_variation_step (pw_variation *x, double t1, pw_error *error) {
  int fixed = x->r->fixed_steps;
  double tolerance = fixed ? STEP_TOLERANCE : fmax (STEP_TOLERANCE, 0.1 * x->r->settings.rtol),
         loose_size = fixed && x->implicit == NULL ? STEP_LINEARISATIONS * x->r->settings.step : 0;
  if (x->h <= fmax (STEP_SMALLEST * x->r->w->scale.time, pw_least_step (x->r))) return step_fail (x, error);
  double end = step_end (x, t1), h = end - x->t, allowed = h <= loose_size ? STEP_LOOSE : tolerance;
  int status = step_stages (x, h, end, error);
  if (status != PW_OK) return status;
  double off = pw_larger_or_nan (step_error (x), step_motion_error (x) * allowed / step_motion_tolerance (x));
  double next = step_next_size (x, h, off, tolerance, loose_size);
  if (off <= allowed) {
    status = step_check_stiffness (x, h, error);
    x->h = h < x->h ? fmax (x->h, next) : next;
    x->t = end, x->last_error = off;
    step_accept (x);
  } else
    x->h = fmin (next, 0.9 * h);
  return status;
}
