/* Functionals of columns, evaluated along a run.
 *
 * Each step is sampled at its middle and end.  If a column is nearly parabolic there, |x0 - 2 xm + x1| < 1e-4 max |x|, its
 * integral is that of Simpson's formula: for x = cos (w t) the first is (w h)^2 / 4, the relative error (w h)^4 / 2880,
 * so 6e-11.  If it is nearly linear, |x0 - 2 xm + x1| < |x1 - x0| / 5, its slope has one sign in the parabola through
 * the three values, and the extremum is at an end.
 *
 * Otherwise the step is sampled at the 5 nodes of the Gauss-Legendre formula.  Integrals: the step is divided until the
 * interpolatory formula of nodes 1, 3 and 5 agrees to 1e-3 of the largest value.  For cos (w t) in a part of length h
 * Gauss' formula has the relative error 4e-10 (w h / 2)^10, the other one 3e-3 (w h / 2)^4: agreement to 1e-3 makes the
 * integral accurate to 3e-11.  Extrema: the largest value at the nodes and ends, refined by Brent's method between its
 * neighbours.  Values jump at breakpoints, where steps end: a step before a jump is always sampled at the nodes. */
#include <gsl/gsl_errno.h>
#include <gsl/gsl_min.h>
#include <math.h>
#include <stdlib.h>
#include "cli.h"
#include "outcome.h"

#define FUNCTIONAL_PARABOLA 1e-4
#define FUNCTIONAL_LINEAR 0.2
#define FUNCTIONAL_AGREE 1e-3
#define FUNCTIONAL_WIDTH 1e-8 /* of the interval that contains an extremum, relative to the first one */
enum {
  FUNCTIONAL_TIMES = PW_FUNCTIONAL_TIMES,
  FUNCTIONAL_MIDDLE = 4,
  FUNCTIONAL_DEPTH = 4,
  FUNCTIONAL_ITERATIONS = 60
};

/* Abramowitz and Stegun, table 25.4; the weights of the second formula are 1 / (3 x^2) and 2 - 2 / (3 x^2). */
const double pw_gauss_x[] = { -0.90617984593866399, -0.53846931010568309, 0, 0.53846931010568309, 0.90617984593866399 },
             pw_gauss_w[] = { 0.23692688505618909, 0.47862867049936647, 0.56888888888888889, 0.47862867049936647,
                              0.23692688505618909 };
static const double functional_rough[] = { 0.40592924385869443, 0, 1.18814151228261114, 0, 0.40592924385869443 };

/* A step of a run. */
typedef struct {
  pw_outcomes *x;
  pw_run *r;
  double t0, t1;
  int status;
  pw_error *error;
} functional_step;

/* ---- Values ---- */

static int functional_prepare (pw_outcomes *x, const pw_sample *s, pw_error *error) {
  int contacts = 0;
  for (int i = 0; i < x->functionals; i++) contacts |= x->functional[i].column.type == PW_COLUMN_CONTACT;
  return contacts ? pw_workspace_contact_points (x->workspace, s->t, s->q, s->v, x->contact, error) : PW_OK;
}

static double functional_read (const pw_outcomes *x, const pw_functional *f, const pw_sample *s) {
  if (f->column.type == PW_COLUMN_CONTACT) return x->contact[f->column.index / 2][f->column.index % 2];
  return pw_column_value (x->system, f->column, s);
}

/* Samples the run at time t in the step; 0 and the status if that fails. */
static int functional_sample (functional_step *p, double t, pw_sample *s) {
  if (p->status == PW_OK) p->status = pw_run_sample (p->r, t, s, p->error);
  if (p->status == PW_OK) p->status = functional_prepare (p->x, s, p->error);
  return p->status == PW_OK;
}

/* The value of a column at time t in the step; NaN if that fails. */
static double functional_at (functional_step *p, const pw_functional *f, double t) {
  pw_sample s;
  return functional_sample (p, t, &s) ? functional_read (p->x, f, &s) : NAN;
}

/* ---- Integrals ---- */

static double functional_time (double t0, double t1, int node) {
  return (t0 + t1) / 2 + pw_gauss_x[node] * (t1 - t0) / 2;
}

/* Adds the integral of the column, or of its square, over [t0, t1] with values at the nodes; divides it if necessary. */
static void functional_integrate (functional_step *p, pw_functional *f, double t0, double t1, const double *value,
                                  int depth) {
  double fine = 0, rough = 0, largest = 0, h = (t1 - t0) / 2;
  for (int i = 0; i < PW_GAUSS_NODES; i++) {
    double y = f->type == PW_RMS ? value[i] * value[i] : value[i];
    fine += pw_gauss_w[i] * y;
    rough += functional_rough[i] * y;
    largest = fmax (largest, fabs (y));
  }
  if (fabs (fine - rough) > FUNCTIONAL_AGREE * 2 * largest && depth < FUNCTIONAL_DEPTH) {
    for (int half = 0; half < 2 && p->status == PW_OK; half++) {
      double from = half ? t0 + h : t0, to = half ? t1 : t0 + h, again[PW_GAUSS_NODES];
      for (int i = 0; i < PW_GAUSS_NODES; i++) again[i] = functional_at (p, f, functional_time (from, to, i));
      functional_integrate (p, f, from, to, again, depth + 1);
    }
    return;
  }
  f->value += h * fine;
}

/* Mean and root mean square of a run of length `span`. */
static void functional_average (pw_functional *f, double span) {
  if (f->type == PW_MEAN) f->value /= span;
  if (f->type == PW_RMS) f->value = sqrt (f->value / span);
}

/* ---- Extrema ---- */

static void functional_better (const functional_step *p, pw_functional *f, double t, double value) {
  if (f->type == PW_MAX ? value > f->value : value < f->value) f->value = value, f->t = t, f->step = p->t1 - p->t0;
}

typedef struct {
  functional_step *step;
  const pw_functional *f;
  double t; /* from which the time is counted, since Brent's method takes its tolerance relative to it */
} functional_search;

/* The column, or minus it for a maximum. */
static double functional_goal (double t, void *context) {
  functional_search *x = context;
  double value = functional_at (x->step, x->f, x->t + t);
  return x->f->type == PW_MAX ? -value : value;
}

/* Refines an extremum between the first and the last of three times; value: as of functional_goal. */
static void functional_refine (functional_step *p, pw_functional *f, const double t[3], const double value[3]) {
  functional_search search = { p, f, t[1] };
  gsl_function g = { functional_goal, &search };
  gsl_min_fminimizer *m = gsl_min_fminimizer_alloc (gsl_min_fminimizer_brent);
  if (m == NULL) {
    p->status = pw_fail (p->error, PW_RESOURCE, "out of memory");
    return;
  }
  int status = gsl_min_fminimizer_set_with_values (m, &g, 0, value[1], t[0] - t[1], value[0], t[2] - t[1], value[2]);
  for (int i = 0; i < FUNCTIONAL_ITERATIONS && status == GSL_SUCCESS; i++) {
    status = gsl_min_fminimizer_iterate (m);
    if (gsl_min_fminimizer_x_upper (m) - gsl_min_fminimizer_x_lower (m) < FUNCTIONAL_WIDTH * (t[2] - t[0])) break;
  }
  double least = gsl_min_fminimizer_f_minimum (m);
  if (p->status == PW_OK)
    functional_better (p, f, t[1] + gsl_min_fminimizer_x_minimum (m), f->type == PW_MAX ? -least : least);
  gsl_min_fminimizer_free (m);
}

/* Values at all times of the step. */
static void functional_extremum (functional_step *p, pw_functional *f, const double *t, const double *value) {
  double y[FUNCTIONAL_TIMES], range = 0;
  int best = 0;
  for (int i = 0; i < FUNCTIONAL_TIMES; i++) {
    y[i] = f->type == PW_MAX ? -value[i] : value[i];
    if (y[i] < y[best]) best = i;
  }
  for (int i = 0; i < FUNCTIONAL_TIMES; i++) range = fmax (range, y[i] - y[best]);
  int inside = best > 0 && best < FUNCTIONAL_TIMES - 1 && y[best] < y[best - 1] && y[best] < y[best + 1];
  int leads = y[best] - range < (f->type == PW_MAX ? -f->value : f->value);
  functional_better (p, f, t[best], value[best]);
  if (inside && leads) functional_refine (p, f, t + best - 1, y + best - 1);
}

/* ---- Along the run ---- */

static int functional_begin (pw_outcomes *x, pw_run *r, pw_error *error) {
  pw_sample s;
  x->t0 = x->t = pw_run_time (r);
  int status = pw_run_sample (r, x->t, &s, error);
  if (status == PW_OK) status = functional_prepare (x, &s, error);
  for (pw_functional *f = x->functional; f < x->functional + x->functionals && status == PW_OK; f++) {
    f->at[0] = functional_read (x, f, &s);
    f->value = pw_is_integral (f->type) ? 0 : f->at[0];
    f->t = x->t;
  }
  return status;
}

/* Times in a step: the ends, times just inside them, the nodes. */
static void functional_times (const functional_step *p, double t[FUNCTIONAL_TIMES]) {
  const double h = p->t1 - p->t0;
  t[0] = p->t0, t[1] = p->t0 + PW_FUNCTIONAL_BEFORE * h;
  for (int i = 0; i < PW_GAUSS_NODES; i++) t[2 + i] = functional_time (p->t0, p->t1, i);
  t[FUNCTIONAL_TIMES - 2] = p->t1 - PW_FUNCTIONAL_BEFORE * h, t[FUNCTIONAL_TIMES - 1] = p->t1;
}

static void functional_take (functional_step *p, double t, int i) {
  pw_sample s;
  if (!functional_sample (p, t, &s)) return;
  for (pw_functional *f = p->x->functional; f < p->x->functional + p->x->functionals; f++)
    f->at[i] = functional_read (p->x, f, &s);
}

/* 1 if the values at the ends and in the middle do not suffice. */
static int functional_needs_nodes (const pw_functional *f) {
  double x0 = f->at[0], xm = f->at[FUNCTIONAL_MIDDLE], x1 = f->at[FUNCTIONAL_TIMES - 1], bend = fabs (x0 - 2 * xm + x1),
         largest = fmax (fabs (x0), fmax (fabs (xm), fabs (x1)));
  if (pw_is_integral (f->type)) return bend > FUNCTIONAL_PARABOLA * largest;
  double lead = f->type == PW_MAX ? fmax (x0, fmax (xm, x1)) - f->value : f->value - fmin (x0, fmin (xm, x1));
  return pw_is_extremum (f->type) && bend > FUNCTIONAL_LINEAR * fabs (x1 - x0) && lead + bend + fabs (x1 - x0) > 0;
}

/* Simpson's formula. */
static void functional_simpson (functional_step *p, pw_functional *f) {
  static const int at[] = { 0, FUNCTIONAL_MIDDLE, FUNCTIONAL_TIMES - 1 };
  const double h = p->t1 - p->t0;
  for (int i = 0; i < 3; i++) {
    double value = f->at[at[i]];
    f->value += (i == 1 ? 4 : 1) * h / 6 * (f->type == PW_RMS ? value * value : value);
  }
}

static int functional_advance (pw_outcomes *x, pw_run *r, pw_error *error) {
  functional_step p = { x, r, x->t, pw_run_time (r), PW_OK, error };
  double t[FUNCTIONAL_TIMES];
  int any = 0, nodes = pw_system_jumps (x->system, p.t1);
  pw_functional *const end = x->functional + x->functionals;
  for (const pw_functional *f = x->functional; f < end; f++) any |= f->type != PW_FINAL;
  x->t = p.t1;
  if (!any) return PW_OK;
  functional_times (&p, t);
  functional_take (&p, t[FUNCTIONAL_MIDDLE], FUNCTIONAL_MIDDLE);
  functional_take (&p, p.t1, FUNCTIONAL_TIMES - 1);
  for (const pw_functional *f = x->functional; f < end; f++) nodes |= functional_needs_nodes (f);
  for (int i = 1; nodes && i < FUNCTIONAL_TIMES - 1; i++)
    if (i != FUNCTIONAL_MIDDLE) functional_take (&p, t[i], i);
  for (pw_functional *f = x->functional; f < end && p.status == PW_OK; f++) {
    if (pw_is_integral (f->type) && nodes) functional_integrate (&p, f, p.t0, p.t1, f->at + 2, 0);
    if (pw_is_integral (f->type) && !nodes) functional_simpson (&p, f);
    if (pw_is_extremum (f->type) && nodes) functional_extremum (&p, f, t, f->at);
    if (pw_is_extremum (f->type) && !nodes) functional_better (&p, f, p.t1, f->at[FUNCTIONAL_TIMES - 1]);
    f->at[0] = f->at[FUNCTIONAL_TIMES - 1];
  }
  return p.status;
}

static int functional_end (pw_outcomes *x, pw_run *r, pw_error *error) {
  functional_step p = { x, r, x->t, pw_run_time (r), PW_OK, error };
  for (pw_functional *f = x->functional; f < x->functional + x->functionals && p.status == PW_OK; f++) {
    if (pw_is_integral (f->type)) functional_average (f, x->t - x->t0);
    if (f->type == PW_FINAL) f->value = functional_at (&p, f, f->t = p.t1);
  }
  return p.status;
}

int pw_outcomes_read (pw_outcomes *x, const pw_sample *s, double *value, pw_error *error) {
  int status = functional_prepare (x, s, error);
  for (int i = 0; status == PW_OK && i < x->functionals; i++) value[i] = functional_read (x, x->functional + i, s);
  return status;
}

int pw_outcomes_run (pw_outcomes *x, const char *method, const pw_settings *settings, double t_end, pw_error *error) {
  pw_run *r = pw_run_open (x->system, method, settings, error);
  if (r == NULL) return error->status;
  int status = functional_begin (x, r, error);
  while (status == PW_OK && pw_run_time (r) < t_end) {
    status = pw_run_advance (r, t_end, error);
    if (status == PW_OK) status = functional_advance (x, r, error);
  }
  if (status == PW_OK) status = functional_end (x, r, error);
  if (status == PW_STOPPED) status = pw_limit_fail (settings->stop_context, pw_run_time (r), error);
  pw_run_close (r);
  return status;
}
