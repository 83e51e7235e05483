/* The states of a run that its derivatives still need. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "variation_parts.h"

/* The shortest interval that is bisected, as a fraction of the run's step: 1/32 is, 1/64 is not. */
static const double PATH_SHORTEST = 1. / 50;

/* Hermite interpolation between two points, at t = t_0 + u h: q of degree 5 from q, v, a at both ends.  In a run with
 * fixed steps v is the derivative of q.  Otherwise the errors of q and v may differ, and v is of degree 3 from v and a
 * at both ends; the points are dense enough. */
static void path_interpolate (const pw_variation *x, const pw_variation_point *p, double t, double *out) {
  int n = x->n, fixed = x->r->fixed_steps;
  double h = p[1].t - p[0].t, u = (t - p[0].t) / h, up = u * u * (3 - 2 * u), w = u * (1 - u);
  for (int j = 0; j < n; j++) {
    const double *l = p[0].x + j, *r = p[1].x + j;
    double v0 = h * l[n], a0 = h * h * l[2 * n] / 2, v1 = h * r[n], a1 = h * h * r[2 * n] / 2;
    double d = r[0] - l[0] - v0 - a0, e = v1 - v0 - 2 * a0, f = a1 - a0;
    double c3 = 10 * d - 4 * e + f, c4 = -15 * d + 7 * e - 2 * f, c5 = 6 * d - 3 * e + f;
    out[j] = l[0] + u * (v0 + u * (a0 + u * (c3 + u * (c4 + u * c5))));
    out[n + j] = fixed ? (v0 + u * (2 * a0 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))) / h
                       : l[n] + up * (r[n] - l[n]) + h * w * ((1 - u) * l[2 * n] - u * r[2 * n]);
  }
}

void pw_variation_state (const pw_variation *x, double t, double *out) {
  int i = 0;
  while (i + 2 < x->points && x->point[i + 1].t < t) i++;
  if (x->points > 1 && t < x->point[i + 1].t)
    path_interpolate (x, x->point + i, t, out);
  else
    memcpy (out, x->point[x->points > 1 ? i + 1 : 0].x, 2 * (size_t)x->n * sizeof *out);
}

void pw_variation_discard_points (pw_variation *x) {
  int gone = 0;
  while (gone + 1 < x->points && x->point[gone + 1].t <= x->t) gone++;
  x->points -= gone;
  for (int i = 0; i < x->points; i++) {
    pw_variation_point discarded = x->point[i]; /* whose array x serves later points */
    x->point[i] = x->point[i + gone];
    x->point[i + gone] = discarded;
  }
}

static int path_grow (pw_variation *x) {
  int room = 2 * x->room + 16;
  size_t length = 3 * (size_t)x->n;
  pw_variation_point *more = realloc (x->point, (size_t)room * sizeof *more);
  if (more == NULL) return PW_RESOURCE;
  x->point = more;
  for (; x->room < room; x->room++)
    if ((more[x->room].x = malloc ((length + 3) * sizeof (double))) == NULL) return PW_RESOURCE;
  return PW_OK;
}

int pw_variation_add_point (pw_variation *x, pw_error *error) {
  if (x->points == x->room && path_grow (x) != PW_OK) return pw_fail_memory (x->r->s, error);
  x->point[x->points++].jumps = 0;
  return PW_OK;
}

int pw_variation_accelerations (pw_variation *x, double t, const double *q, const double *v, double *a,
                                pw_error *error) {
  pw_run *r = x->r;
  pw_statistics before = r->statistics;
  int near = r->near_singular, status = pw_run_accelerate (r, pw_before_breakpoint (r, t), q, v, a, x->linear.scratch);
  r->statistics = before;
  if (status > 0) return pw_fail_singular (r, t, error);
  r->near_singular = near;
  return status < 0 ? pw_fail_signal (t, error) : PW_OK;
}

/* Fraction of the run's step over which its velocities are differentiated. */
static const double PATH_PART = 1e-3;

/* Accelerations of a point in the run's last step, of size h, by differences of its dense output, central, or backward
 * at the end of the step: in stiff motions those by the equations magnify the errors of the states. */
static int path_differentiate (pw_variation *x, const pw_variation_point *p, double h, pw_error *error) {
  double d = PATH_PART * h, *a = p->x + 2 * x->n;
  int inside = p->t + d <= x->r->t, status = PW_OK;
  const double weight[2][2] = { { 0.5, -2 }, { -0.5, 0.5 } }, at[2][2] = { { -2, -1 }, { -1, 1 } };
  for (int j = 0; j < x->n; j++) a[j] = inside ? 0 : 1.5 * p->x[x->n + j] / d;
  for (int k = 0; k < 2 && status == PW_OK; k++) {
    pw_sample s;
    status = pw_run_sample (x->r, p->t + at[inside][k] * d, &s, error);
    if (status == PW_OK) pw_add_scaled (a, s.v, weight[inside][k] / d, x->n);
  }
  return status;
}

int pw_variation_append (pw_variation *x, double t, pw_error *error) {
  pw_sample s;
  double h = x->r->t - x->begun;
  size_t n = (size_t)x->n;
  int status = pw_run_sample (x->r, t, &s, error);
  if (status == PW_OK) status = pw_variation_add_point (x, error);
  if (status != PW_OK) return status;
  pw_variation_point *p = x->point + x->points - 1;
  p->t = t;
  memcpy (p->x, s.q, n * sizeof (double));
  memcpy (p->x + n, s.v, n * sizeof (double));
  memcpy (p->x + 2 * n, s.a, n * sizeof (double));
  /* differences are wrong across a jump of accelerations; steps of fixed size have no error to magnify */
  if (x->implicit && h > 0 && !x->r->fixed_steps && !x->may_jump) return path_differentiate (x, p, h, error);
  /* at a breakpoint just reached, the run's accelerations may be those after it */
  return t < x->r->breakpoint ? PW_OK : pw_variation_accelerations (x, t, s.q, s.v, p->x + 2 * n, error);
}

/* 1 if interpolation between points i and i + 1 gives the last point to a tenth of the run's tolerance. */
static int path_is_accurate (const pw_variation *x, int i) {
  const pw_variation_point *at = x->point + x->points - 1;
  double *guess = x->scratch;
  path_interpolate (x, x->point + i, at->t, guess);
  for (int j = 0; j < x->n; j++)
    if (fabs (guess[j] - at->x[j]) > 0.1 * pw_tolerance (x->r, j, at->x[j]) ||
        fabs (guess[x->n + j] - at->x[x->n + j]) > 0.1 * pw_tolerance (x->r, x->n + j, at->x[x->n + j]))
      return 0;
  return 1;
}

/* Inserts the state at the midpoint; if interpolation was not accurate there, does so in both halves, too. */
int pw_variation_refine (pw_variation *x, int i, pw_error *error) {
  double t0 = x->point[i].t, t1 = x->point[i + 1].t, middle = t0 + (t1 - t0) / 2;
  if (x->r->fixed_steps || t1 - t0 < PATH_SHORTEST * (x->r->t - x->begun) || !(t0 < middle && middle < t1))
    return PW_OK;
  int status = pw_variation_append (x, middle, error);
  if (status != PW_OK) return status;
  int good = path_is_accurate (x, i);
  pw_variation_point kept = x->point[x->points - 1];
  memmove (x->point + i + 2, x->point + i + 1, (size_t)(x->points - i - 2) * sizeof kept);
  x->point[i + 1] = kept;
  if (good) return PW_OK;
  status = pw_variation_refine (x, i + 1, error);
  return status == PW_OK ? pw_variation_refine (x, i, error) : status;
}
