/* Functionals of columns, evaluated along a run.
 *
 * Each step, of size h, is sampled at its middle and end: with its beginning, a column has the values x0, xm and x1.
 * Where its bend |x0 - 2 xm + x1| is below 1e-4 max |x|, Simpson's formula gives its integral: for x = cos (w t) the
 * bend is at most (w h)^2 / 4, and the relative error of the formula (w h)^4 / 2880, so 6e-11; 1e-9 for x^2.  Where
 * the bend is below |x1 - x0| / 5, the parabola through the three values is monotonic: the extremum is at an end.
 *
 * Otherwise the step is sampled at the 5 nodes of the Gauss-Legendre formula, for all columns.  Integrals: the step is
 * halved, at most 4 times, until the interpolatory formula of nodes 1, 3 and 5 agrees to 1e-3 of the largest value.
 * For cos (w t) in a part of length h Gauss' formula has the relative error 4e-10 (w h / 2)^10, the other one 3e-3
 * (w h / 2)^4: agreement to 1e-3 makes the integral accurate to 3e-11.  Extrema: the largest or least value at the
 * nodes and ends, refined by Brent's method between its neighbours.  Values jump at breakpoints, where steps end: a
 * step before a jump is always sampled at the nodes. */
#include <gsl/gsl_errno.h>
#include <gsl/gsl_min.h>
#include <math.h>
#include "cli.h"
#include "outcome.h"

#define FUNCTIONAL_SIMPSON 1e-4 /* largest bend for Simpson's formula, relative to max |x| */
#define FUNCTIONAL_LINEAR 0.2   /* largest bend of a column that counts as monotonic, relative to |x1 - x0| */
#define FUNCTIONAL_AGREE 1e-3   /* largest difference of two formulas that agree, relative to the largest value */
/* Brent's method ends when its interval has shrunk by this factor: nearer to the extremum, the column changes by less
 * than round-off. */
#define FUNCTIONAL_WIDTH 1e-8
enum {
  FUNCTIONAL_MIDDLE = 4,                    /* index of the time in the middle of a step, see functional_times */
  FUNCTIONAL_END = PW_FUNCTIONAL_TIMES - 1, /* and at its end */
  FUNCTIONAL_OTHER = PW_FUNCTIONAL_TIMES,   /* index of any other time */
  FUNCTIONAL_DIVISIONS = 4,                 /* of a step into halves, at most */
  FUNCTIONAL_ITERATIONS = 60                /* of Brent's method, at most; golden sections alone would need 39 */
};

/* Nodes and weights of Gauss' formula (Abramowitz and Stegun, table 25.4), and weights of the interpolatory formula of
 * nodes 1, 3 and 5, which are 1 / (3 x^2) and 2 - 2 / (3 x^2), x node 5. */
const double pw_gauss_x[] = { -0.90617984593866399, -0.53846931010568309, 0, 0.53846931010568309, 0.90617984593866399 },
             pw_gauss_w[] = { 0.23692688505618909, 0.47862867049936647, 0.56888888888888889, 0.47862867049936647,
                              0.23692688505618909 };
static const double functional_coarse_w[] = { 0.40592924385869443, 0, 1.18814151228261114, 0, 0.40592924385869443 };

/* A step of a run. */
typedef struct {
  pw_outcomes *set;
  pw_run *run;
  double t0, t1; /* its beginning and end [s] */
  int status;
  pw_error *error;
} functional_step;

/* ---- Values ---- */

int pw_outcomes_read (pw_outcomes *set, const pw_sample *s, int at, pw_error *error) {
  int contacts = 0, status = PW_OK;
  for (int i = 0; i < set->functionals; i++) contacts |= set->functional[i].column.type == PW_COLUMN_CONTACT;
  if (contacts) status = pw_workspace_contact_points (set->workspace, s->t, s->q, s->v, set->contact, error);
  for (pw_functional *f = set->functional; f < set->functional + set->functionals && status == PW_OK; f++) {
    const pw_column c = f->column;
    f->values[at] =
        c.type == PW_COLUMN_CONTACT ? set->contact[c.index / 2][c.index % 2] : pw_column_value (set->system, c, s);
  }
  return status;
}

/* Stores the columns at t, a time in the step, as values[at], unless that or an earlier sample fails. */
static void functional_sample (functional_step *step, double t, int at) {
  pw_sample s;
  if (step->status == PW_OK) step->status = pw_run_sample (step->run, t, &s, step->error);
  if (step->status == PW_OK) step->status = pw_outcomes_read (step->set, &s, at, step->error);
}

/* The column of a functional at time t in the step; NaN if that fails. */
static double functional_at (functional_step *step, const pw_functional *f, double t) {
  functional_sample (step, t, FUNCTIONAL_OTHER);
  return step->status == PW_OK ? f->values[FUNCTIONAL_OTHER] : NAN;
}

/* ---- Integrals ---- */

/* Adds the integral of the column, or of its square, over [t0, t1], a part of the step, from its values at the nodes,
 * or from those in the halves if the two formulas do not agree.  depth: number of divisions so far. */
static void functional_integrate (functional_step *step, pw_functional *f, double t0, double t1, const double *value,
                                  int depth) {
  double fine = 0, coarse = 0, largest = 0, h = (t1 - t0) / 2;
  for (int i = 0; i < PW_GAUSS_NODES; i++) {
    double y = f->type == PW_RMS ? value[i] * value[i] : value[i];
    fine += pw_gauss_w[i] * y;
    coarse += functional_coarse_w[i] * y;
    largest = fmax (largest, fabs (y));
  }
  if (fabs (fine - coarse) > FUNCTIONAL_AGREE * 2 * largest && depth < FUNCTIONAL_DIVISIONS) {
    for (int half = 0; half < 2 && step->status == PW_OK; half++) {
      double from = half ? t0 + h : t0, to = half ? t1 : t0 + h, inside[PW_GAUSS_NODES];
      for (int i = 0; i < PW_GAUSS_NODES; i++) inside[i] = functional_at (step, f, pw_gauss_time (from, to, i));
      functional_integrate (step, f, from, to, inside, depth + 1);
    }
    return;
  }
  f->value += h * fine;
}

/* ---- Extrema ---- */

/* Keeps a value if it is beyond the extremum so far. */
static void functional_update_extremum (const functional_step *step, pw_functional *f, double t, double value) {
  if (f->type == PW_MAX ? value > f->value : value < f->value)
    f->value = value, f->t = t, f->step = step->t1 - step->t0;
}

typedef struct {
  functional_step *step;
  const pw_functional *f;
  double origin; /* of GSL's times [s]: their tolerance is relative, and t may be large */
} functional_search;

/* What is minimised at a time after the origin: the column, or for a maximum its negative. */
static double functional_signed (double after, void *context) {
  functional_search *search = context;
  double value = functional_at (search->step, search->f, search->origin + after);
  return search->f->type == PW_MAX ? -value : value;
}

/* Refines an extremum that lies between the first and the last of three times; value: what is minimised, at each of
 * them, the least at the second one. */
static void functional_refine (functional_step *step, pw_functional *f, const double t[3], const double value[3]) {
  functional_search search = { step, f, t[1] };
  gsl_function minimised = { functional_signed, &search };
  gsl_min_fminimizer *m = gsl_min_fminimizer_alloc (gsl_min_fminimizer_brent);
  if (m == NULL) {
    step->status = pw_fail (step->error, PW_RESOURCE, "out of memory");
    return;
  }
  int status =
      gsl_min_fminimizer_set_with_values (m, &minimised, 0, value[1], t[0] - t[1], value[0], t[2] - t[1], value[2]);
  for (int i = 0; i < FUNCTIONAL_ITERATIONS && status == GSL_SUCCESS; i++) {
    status = gsl_min_fminimizer_iterate (m);
    if (gsl_min_fminimizer_x_upper (m) - gsl_min_fminimizer_x_lower (m) < FUNCTIONAL_WIDTH * (t[2] - t[0])) break;
  }
  double least = gsl_min_fminimizer_f_minimum (m);
  if (step->status == PW_OK)
    functional_update_extremum (step, f, t[1] + gsl_min_fminimizer_x_minimum (m), f->type == PW_MAX ? -least : least);
  gsl_min_fminimizer_free (m);
}

/* The extremum over the step from values at all of its times.  It is refined if it is inside the step and may be beyond
 * the extremum so far: by assumption it is beyond these values by their range at most. */
static void functional_extremum (functional_step *step, pw_functional *f, const double *t, const double *value) {
  double y[PW_FUNCTIONAL_TIMES], range = 0;
  int best = 0;
  for (int i = 0; i < PW_FUNCTIONAL_TIMES; i++) {
    y[i] = f->type == PW_MAX ? -value[i] : value[i];
    if (y[i] < y[best]) best = i;
  }
  for (int i = 0; i < PW_FUNCTIONAL_TIMES; i++) range = fmax (range, y[i] - y[best]);
  int inside = best > 0 && best < FUNCTIONAL_END && y[best] < y[best - 1] && y[best] < y[best + 1];
  int may_lead = y[best] - range < (f->type == PW_MAX ? -f->value : f->value);
  functional_update_extremum (step, f, t[best], value[best]);
  if (inside && may_lead) functional_refine (step, f, t + best - 1, y + best - 1);
}

/* ---- Along the run ---- */

static void functional_begin (functional_step *step) {
  functional_sample (step, step->t1, 0);
  for (pw_functional *f = step->set->functional; f < step->set->functional + step->set->functionals; f++) {
    f->value = pw_is_integral (f->type) ? 0 : f->values[0];
    f->t = step->t1;
  }
}

/* Times in a step: its beginning, just after it, the nodes of Gauss' formula, just before the end, the end. */
static void functional_times (const functional_step *step, double t[PW_FUNCTIONAL_TIMES]) {
  const double h = step->t1 - step->t0;
  t[0] = step->t0, t[1] = step->t0 + PW_FUNCTIONAL_INSET * h;
  for (int i = 0; i < PW_GAUSS_NODES; i++) t[2 + i] = pw_gauss_time (step->t0, step->t1, i);
  t[FUNCTIONAL_END - 1] = step->t1 - PW_FUNCTIONAL_INSET * h, t[FUNCTIONAL_END] = step->t1;
}

/* 1 if the values at the ends and in the middle do not suffice: the column of an integral bends too much; or that of an
 * extremum is not nearly linear, and in the step may be beyond the extremum so far. */
static int functional_needs_nodes (const pw_functional *f) {
  double x0 = f->values[0], xm = f->values[FUNCTIONAL_MIDDLE], x1 = f->values[FUNCTIONAL_END],
         bend = fabs (x0 - 2 * xm + x1), largest = fmax (fabs (x0), fmax (fabs (xm), fabs (x1)));
  if (pw_is_integral (f->type)) return bend > FUNCTIONAL_SIMPSON * largest;
  double lead = f->type == PW_MAX ? fmax (x0, fmax (xm, x1)) - f->value : f->value - fmin (x0, fmin (xm, x1));
  return pw_is_extremum (f->type) && bend > FUNCTIONAL_LINEAR * fabs (x1 - x0) && lead + bend + fabs (x1 - x0) > 0;
}

static void functional_simpson (const functional_step *step, pw_functional *f) {
  static const int time[] = { 0, FUNCTIONAL_MIDDLE, FUNCTIONAL_END };
  const double h = step->t1 - step->t0;
  for (int i = 0; i < 3; i++) {
    double value = f->values[time[i]];
    f->value += (i == 1 ? 4 : 1) * h / 6 * (f->type == PW_RMS ? value * value : value);
  }
}

static void functional_advance (functional_step *step) {
  double t[PW_FUNCTIONAL_TIMES];
  int nodes = pw_system_jumps (step->set->system, step->t1);
  pw_functional *const begin = step->set->functional, *const end = begin + step->set->functionals;
  functional_times (step, t);
  functional_sample (step, t[FUNCTIONAL_MIDDLE], FUNCTIONAL_MIDDLE);
  functional_sample (step, step->t1, FUNCTIONAL_END);
  for (const pw_functional *f = begin; f < end; f++) nodes |= functional_needs_nodes (f);
  for (int i = 1; nodes && i < FUNCTIONAL_END; i++)
    if (i != FUNCTIONAL_MIDDLE) functional_sample (step, t[i], i);
  for (pw_functional *f = begin; f < end && step->status == PW_OK; f++) {
    if (pw_is_integral (f->type) && nodes) functional_integrate (step, f, step->t0, step->t1, f->values + 2, 0);
    if (pw_is_integral (f->type) && !nodes) functional_simpson (step, f);
    if (pw_is_extremum (f->type) && nodes) functional_extremum (step, f, t, f->values);
    if (pw_is_extremum (f->type) && !nodes) functional_update_extremum (step, f, step->t1, f->values[FUNCTIONAL_END]);
    f->values[0] = f->values[FUNCTIONAL_END];
  }
}

/* span: the duration of the run [s]. */
static void functional_end (functional_step *step, double span) {
  for (pw_functional *f = step->set->functional; f < step->set->functional + step->set->functionals; f++) {
    if (f->type == PW_MEAN) f->value /= span;
    if (f->type == PW_RMS) f->value = sqrt (f->value / span);
    if (f->type == PW_FINAL) f->value = functional_at (step, f, step->t1);
  }
}

int pw_outcomes_run (pw_outcomes *set, const char *method, const pw_settings *settings, double t_end, pw_error *error) {
  pw_run *r = pw_limit_open (set->system, method, settings, error);
  if (r == NULL) return error->status;
  const double begin = pw_run_time (r);
  functional_step step = { set, r, begin, begin, PW_OK, error };
  functional_begin (&step);
  while (step.status == PW_OK && step.t1 < t_end) {
    step.status = pw_run_advance (r, t_end, error);
    step.t0 = step.t1, step.t1 = pw_run_time (r);
    if (step.status == PW_OK && set->along_run) functional_advance (&step);
  }
  functional_end (&step, step.t1 - begin);
  if (step.status == PW_STOPPED) step.status = pw_limit_status (settings->stop_context, step.t1, error);
  pw_run_close (r);
  return step.status;
}
