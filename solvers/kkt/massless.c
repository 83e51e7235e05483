/* Elimination of coordinates without weight; see massless.h. */
#include <math.h>
#include <string.h>
#include "massless.h"
#include "unroll.h"

PW_ONE_BY_ONE

/* ---- P = L U; n, the number of pivots, is a constant where it is usual ---- */

/* Returns 0 if a pivot has become too small, or is NaN. */
PW_INLINE int massless_lu (pw_component *c, int n) {
  int good = 1;
  double worst = 1, P[9], *LU = n == 3 ? P : c->P;
  PW_UNROLL for (int i = 0; i < n * n; i++) LU[i] = *c->from[i];
  PW_UNROLL for (int p = 0; p < n; p++) {
    double relative = fabs (LU[p * n + p]) * c->scale[p], inverse = 1 / LU[p * n + p];
    good &= relative >= c->least[p];
    if (!(relative >= worst)) worst = relative;
    LU[p * n + p] = inverse;
    PW_UNROLL for (int i = p + 1; i < n; i++) {
      double l = LU[i * n + p] *= inverse;
      PW_UNROLL for (int j = p + 1; j < n; j++) LU[i * n + j] -= l * LU[p * n + j];
    }
  }
  if (LU != c->P) memcpy (c->P, LU, sizeof P);
  c->worst = worst;
  return good;
}

/* x = P^-1 x */
PW_INLINE void massless_solve (const double *P, double *x, int n) {
  PW_UNROLL for (int i = 1; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[i * n + j] * x[j];
  }
  PW_UNROLL for (int i = n - 1; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[i * n + j] * x[j];
    x[i] *= P[i * n + i];
  }
}

/* x = P^-T x */
PW_INLINE void massless_solve_transposed (const double *P, double *x, int n) {
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[j * n + i] * x[j];
    x[i] *= P[i * n + i];
  }
  PW_UNROLL for (int i = n - 2; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[j * n + i] * x[j];
  }
}

/* Adds factor J to row i of Z~; returns the square of what it adds, angles in units of length, where there is
 * weight. */
static double massless_add_run (pw_component *c, const pw_massive_block *x, int i, double factor) {
  double square = 0;
  for (int n = 0; n < x->width; n++) {
    double add = factor * x->J[n], scaled = add / c->unit[x->column + n];
    c->Z[i * c->cols + x->column + n] += add;
    if (!c->massless[x->column + n]) square += scaled * scaled;
  }
  return square;
}

/* Y and Z~ of the unmatched rows.  A vanishing row leaves round-off of any direction, so its size is compared with
 * those of Z, Y H, and K: for a row without weight, Y H may be round-off, too. */
static void massless_left_over (pw_component *c) {
  const pw_massive_block *h = c->massive;
  c->left = 1;
  for (int i = c->pivots; i < c->rows; i++) {
    double *Y = c->Y + i * c->pivots, *Z = c->Z + i * c->cols, all = 0, left = 0;
    for (int p = 0; p < c->pivots; p++) {
      double scaled = *c->from[i * c->pivots + p] / c->unit[c->pivot[p]];
      Y[p] = *c->from[i * c->pivots + p];
      all += scaled * scaled;
    }
    massless_solve_transposed (c->P, Y, c->pivots);
    for (int n = 0; n < c->cols; n++) Z[n] = 0;
    for (const pw_massive_block *x = h + c->massives_h; x < h + c->massives; x++)
      if (x->slot == i) all += massless_add_run (c, x, i, 1);
    for (const pw_massive_block *x = h; x < h + c->massives_h; x++) all += massless_add_run (c, x, i, -Y[x->slot]);
    for (int n = 0; n < c->cols; n++)
      if (!c->massless[n]) left += Z[n] * Z[n] / (c->unit[n] * c->unit[n]);
    left = all > 0 ? sqrt (left / all) : 0;
    if (!(left >= c->left)) c->left = left, c->left_row = i;
  }
}

int pw_massless_weakest (const pw_massless *r) {
  double least = INFINITY;
  int row = -1;
  for (const pw_component *c = r->component; c < r->end; c++) {
    for (int p = 0; p < c->pivots; p++) {
      double pivot = c->scale[p] / fabs (c->P[p * (c->pivots + 1)]);
      if (!(pivot >= least)) least = pivot, row = c->row[p];
    }
    if (c->rows > c->pivots && !(c->left >= least)) least = c->left, row = c->row[c->left_row];
  }
  return row;
}

double pw_massless_factor (pw_massless *r) {
  double least = 1;
  for (pw_component *c = r->component, *end = r->end; c < end; c++) {
    for (int again = 0; !(c->pivots == 3 ? massless_lu (c, 3) : massless_lu (c, c->pivots)); again = 1)
      if (again || pw_massless_match (c) < c->pivots) return 0;
    if (c->rows > c->pivots) massless_left_over (c);
    if (!(c->worst >= least)) least = c->worst;
    if (c->rows > c->pivots && !(c->left >= least)) least = c->left;
  }
  return least * least;
}

/* ---- Solving ---- */

PW_INLINE void massless_forward (pw_component *c, const double *gamma, double *f, int n) {
  double *mu = c->lambda;
  PW_UNROLL for (int p = 0; p < n; p++) c->gamma[p] = gamma[c->row[p]], mu[p] = f[c->massless_j[p]];
  for (int i = n; i < c->rows; i++) {
    c->gamma[i] = gamma[c->row[i]];
    for (int p = 0; p < n; p++) c->gamma[i] -= c->Y[i * n + p] * c->gamma[p];
  }
  massless_solve_transposed (c->P, mu, n);
  for (const pw_massive_block *h = c->massive, *end = h + c->massives_h; h < end; h++) { /* f -= H^T mu */
    double *to = f + h->j, l = mu[h->slot];
    to[0] -= h->J[0] * l;
    if (h->width == 3) to[1] -= h->J[1] * l, to[2] -= h->J[2] * l;
  }
}

void pw_massless_forward (pw_massless *r, const double *gamma, double *f) {
  for (pw_component *c = r->component, *end = r->end; c < end; c++)
    c->pivots == 3 ? massless_forward (c, gamma, f, 3) : massless_forward (c, gamma, f, c->pivots);
}

PW_INLINE void massless_backward (pw_component *c, double *rates, double *lambda, int n) {
  double *x = c->gamma;
  for (const pw_massive_block *h = c->massive, *end = h + c->massives_h; h < end; h++) { /* x -= H a */
    const double *a = rates + h->j;
    x[h->slot] -= h->width == 3 ? h->J[0] * a[0] + h->J[1] * a[1] + h->J[2] * a[2] : h->J[0] * a[0];
  }
  massless_solve (c->P, x, n);
  for (int i = n; i < c->rows; i++) {
    lambda[c->row[i]] = c->lambda[i];
    for (int p = 0; p < n; p++) c->lambda[p] -= c->Y[i * n + p] * c->lambda[i];
  }
  PW_UNROLL for (int p = 0; p < n; p++) rates[c->massless_j[p]] = x[p], lambda[c->row[p]] = c->lambda[p];
}

void pw_massless_backward (pw_massless *r, double *a, double *lambda) {
  for (pw_component *c = r->component, *end = r->end; c < end; c++)
    c->pivots == 3 ? massless_backward (c, a, lambda, 3) : massless_backward (c, a, lambda, c->pivots);
}
