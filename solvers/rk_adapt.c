/* Runge-Kutta with steps that follow the tolerances.
 *
 *   h_new = 0.9 h err^-(k - 3 m / 4) err_before^m,  within a fifth and five times of h
 *
 * with k the tableau's exponent and m its memory (Gustafsson 1991; Hairer, Norsett & Wanner 1993, section II.4).  The
 * error e is that of positions and rates in units of the tolerances.  Of what a projection takes away from it, e', only
 * the part along the constraints is left (Eich 1993; Hindmarsh et al., CVODE) and a little of the whole:
 *
 *   e = sqrt (e'^2 + rtol^(1/2) e_before^2)      so that the displacement, e_before rtol, is at most rtol^(3/4)
 *
 * The displacement acts along the constraints by its square, through their curvature; without a limit the steps of a
 * motion that is mostly prescribed would grow until that counts.  It serves two estimates as DOP853 does. */
#include <float.h>
#include <math.h>
#include "rk_state.h"

void pw_rk_begin_adaptive (pw_run *r) {
  struct pw_method_data *d = r->data;
  d->h = 0.1 * r->s->scale.time * pow (r->settings.rtol, d->tableau->exponent);
  d->before = 1e-4;
}

/* out = sum_j w_j K_j, two entries at a time. */
static void adapt_estimate (const pw_rk_row *w, double *const *K, int n, double *out) {
  int i = 0;
  for (; i + 1 < n; i += 2) {
    double even = 0, odd = 0;
    for (int j = 0; j < w->count; j++) {
      const double *k = K[w->stage[j]];
      even += w->weight[j] * k[i];
      odd += w->weight[j] * k[i + 1];
    }
    out[i] = even, out[i + 1] = odd;
  }
  if (i == n) return;
  out[i] = 0;
  for (int j = 0; j < w->count; j++) out[i] += w->weight[j] * K[w->stage[j]][i];
}

/* Mean square of positions' and rates' errors in units of the tolerances. */
static double adapt_norm (const pw_run *r, const double *eq, const double *ev) {
  const struct pw_method_data *d = r->data;
  const pw_system *s = r->s;
  double sum = 0, rtol = r->settings.rtol;
  for (int j = 0; j < s->coords; j++) {
    double q = eq[j] / (pw_atol (r, j) + rtol * fmax (fabs (r->q[j]), fabs (d->q[j])));
    double v = ev[j] / (pw_atol_rate (r, j) + rtol * fmax (fabs (r->v[j]), fabs (d->v[j])));
    sum += q * q + v * v;
  }
  return sum / (2 * s->coords);
}

static double adapt_one (pw_run *r, const pw_rk_row *e, int projected) {
  struct pw_method_data *d = r->data;
  double *eq = r->q_at, *ev = r->v_at;
  adapt_estimate (e, d->V, r->s->coords, eq);
  adapt_estimate (e, d->A, r->s->coords, ev);
  if (!projected && !d->minimal) return adapt_norm (r, eq, ev);
  double before = adapt_norm (r, eq, ev);
  if (projected || d->closes) pw_project_error (r, eq, r->s->holonomic);
  pw_project_error (r, ev, r->s->rows);
  return adapt_norm (r, eq, ev) + sqrt (r->settings.rtol) * before;
}

/* The error of the step just computed; at most 1 is good. */
static double adapt_error (pw_run *r, double h, int projected) {
  struct pw_method_data *d = r->data;
  const pw_tableau *b = d->tableau;
  d->V[b->stages] = d->v, d->A[b->stages] = d->a;
  double e = adapt_one (r, &d->estimate[0], projected);
  if (b->e3 == NULL) return h * sqrt (e);
  double e3 = adapt_one (r, &d->estimate[1], projected);
  return e + e3 > 0 ? h * e / sqrt (e + 0.01 * e3) : 0;
}

/* 0.2 to 5 times the step. */
static double adapt_factor (const struct pw_method_data *d, double error) {
  const pw_tableau *b = d->tableau;
  if (error == 0) return 5;
  double f = 0.9 * pow (error, -(b->exponent - 0.75 * b->memory)) * pow (d->before, b->memory);
  return fmin (5, fmax (0.2, f));
}

/* The step to t1.  Where signals are discontinuous there its error is judged by the new state's derivative before that:
 * the jump is no error of the step. */
static int adapt_step (pw_run *r, double h, double t1, int project, double *added, double *off) {
  struct pw_method_data *d = r->data;
  double before = pw_before_breakpoint (r, t1);
  r->near = 0;
  int status = pw_rk_step (r, h, t1, project, added);
  if (status == PW_OK && before < t1) status = pw_accelerate (r, before, d->q, d->v, d->a, d->lambda);
  *off = status == PW_OK ? adapt_error (r, h, project) : INFINITY;
  if (status == PW_OK && before < t1) status = pw_accelerate (r, t1, d->q, d->v, d->a, d->lambda);
  if (status != PW_OK) *off = INFINITY;
  return status;
}

/* A step that was cut short says little about the next one, other than that it may be as large as it was to be. */
static void adapt_accept (pw_run *r, double h, double t1, double added, double off, double most, int cut) {
  struct pw_method_data *d = r->data;
  double next = h * fmin (most, adapt_factor (d, off));
  pw_rk_accept (r, h, t1, added);
  d->h = cut ? fmax (next, d->h) : next;
  if (!cut || h > 0.5 * d->h) d->before = fmax (off, 1e-4);
  r->statistics.steps++;
}

static int adapt_fail (pw_run *r, int status, double h, pw_error *error) {
  if (status != PW_OK) return pw_rk_fail (r, status, h, error);
  return pw_fail (error, PW_METHOD, "t = %.6g s: the tolerances ask for a step below %.3g s", r->t, h);
}

int pw_rk_advance_adaptive (pw_run *r, double t_end, pw_error *error) {
  struct pw_method_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), most = 5;
  double least = 16 * DBL_EPSILON * fmax (fabs (r->t), 1e-6 * fabs (stop - r->t));
  int status = PW_OK, project = d->projects && (r->statistics.steps + 1) % d->every == 0;
  for (;;) {
    double t1 = r->t + d->h, added = 0, off;
    int cut = t1 > stop - 0.01 * d->h;
    if (cut) t1 = stop;
    double h = t1 - r->t;
    if (!cut && !(h > least)) return adapt_fail (r, status, h, error);
    status = adapt_step (r, h, t1, project, r->settings.ledger ? &added : NULL, &off);
    if (status < 0) return pw_rk_fail (r, status, h, error);
    if (off <= 1) {
      adapt_accept (r, h, t1, added, off, most, cut);
      return PW_OK;
    }
    r->statistics.rejected++;
    d->h = h * (isfinite (off) ? fmin (0.9, adapt_factor (d, off)) : 0.2);
    most = 1; /* no growth right after a rejection */
  }
}
