/* Elimination of coordinates without weight; see reduce.h. */
#include <math.h>
#include "reduce.h"
#include "unroll.h"

PW_ONE_BY_ONE

/* ---- P = L U ---- */

/* n, the number of pivots, is a constant where it is usual; so is `unit`, 1 if the first two are a unit matrix. */
PW_INLINE int reduce_zero (int i, int j, int unit) {
  return unit && i < 2 && j < 2 && i != j;
}

/* Returns 0 if a pivot has become too small, or is not a number. */
PW_INLINE int reduce_lu (pw_component *c, double *P, int n, int unit) {
  int good = 1;
  double worst = 1;
  PW_UNROLL for (int i = 0; i < n * n; i++) if (!reduce_zero (i / n, i % n, unit)) P[i] = *c->from[i];
  PW_UNROLL for (int p = 0; p < n; p++) {
    double pivot = P[p * n + p], inverse = unit && p < 2 ? pivot : 1 / pivot; /* 1 / 1 or 1 / -1 */
    if (!unit || p == 2) {
      double relative = fabs (pivot) * c->scale[p];
      good &= relative >= c->least[p];
      if (!(relative >= worst)) worst = relative;
    }
    P[p * n + p] = inverse;
    PW_UNROLL for (int i = p + 1; i < n; i++) {
      if (reduce_zero (i, p, unit)) continue;
      double l = P[i * n + p] * inverse;
      P[i * n + p] = l;
      PW_UNROLL for (int j = p + 1; j < n; j++) if (!reduce_zero (p, j, unit)) P[i * n + j] -= l * P[p * n + j];
    }
  }
  c->worst = worst;
  return good;
}

/* x = P^-1 x */
PW_INLINE void reduce_solve (const double *P, double *x, int n, int unit) {
  PW_UNROLL for (int i = 1; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) if (!reduce_zero (i, j, unit)) x[i] -= P[i * n + j] * x[j];
  }
  PW_UNROLL for (int i = n - 1; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) if (!reduce_zero (i, j, unit)) x[i] -= P[i * n + j] * x[j];
    x[i] *= P[i * n + i];
  }
}

/* x = P^-T x */
PW_INLINE void reduce_solve_transposed (const double *P, double *x, int n, int unit) {
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) if (!reduce_zero (j, i, unit)) x[i] -= P[j * n + i] * x[j];
    x[i] *= P[i * n + i];
  }
  PW_UNROLL for (int i = n - 2; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) if (!reduce_zero (j, i, unit)) x[i] -= P[j * n + i] * x[j];
  }
}

/* Adds factor J to row i of Z~; returns the square of what it adds, angles in units of length, where there is weight. */
static double reduce_add_run (pw_component *c, const pw_reduce_heavy *x, int i, double factor) {
  double square = 0;
  for (int n = 0; n < x->width; n++) {
    double add = factor * x->J[n], scaled = add / c->unit[x->column + n];
    c->Z[i * c->cols + x->column + n] += add;
    if (!c->massless[x->column + n]) square += scaled * scaled;
  }
  return square;
}

/* Y and Z~ of the rows left over.  What should be nothing is round-off, of any direction: only its size tells, beside
 * Z, Y H, and K: of a row that touches no weight Y H may be round-off, too. */
static void reduce_left_over (pw_component *c) {
  const pw_reduce_heavy *h = c->heavy;
  c->left = 1;
  for (int i = c->pivots; i < c->rows; i++) {
    double *Y = c->Y + i * c->pivots, *Z = c->Z + i * c->cols, all = 0, left = 0;
    for (int p = 0; p < c->pivots; p++) {
      double scaled = *c->from[i * c->pivots + p] / c->unit[c->pivot[p]];
      Y[p] = *c->from[i * c->pivots + p];
      all += scaled * scaled;
    }
    reduce_solve_transposed (c->P, Y, c->pivots, 0);
    for (int n = 0; n < c->cols; n++) Z[n] = 0;
    for (const pw_reduce_heavy *x = h + c->heavies_h; x < h + c->heavies; x++)
      if (x->slot == i) all += reduce_add_run (c, x, i, 1);
    for (const pw_reduce_heavy *x = h; x < h + c->heavies_h; x++) all += reduce_add_run (c, x, i, -Y[x->slot]);
    for (int n = 0; n < c->cols; n++)
      if (!c->massless[n]) left += Z[n] * Z[n] / (c->unit[n] * c->unit[n]);
    left = all > 0 ? sqrt (left / all) : 0;
    if (!(left >= c->left)) c->left = left, c->left_row = i;
  }
}

/* ---- Solving ---- */

/* f -= H^T mu */
static inline void reduce_pull (const pw_component *c, double *force) {
  const double *mu = c->lambda;
  for (const pw_reduce_pair *h = c->pair, *end = h + c->pairs; h < end; h++) {
    double *f = force + h->j, x = mu[h->slot_x], y = mu[h->slot_y];
    f[0] -= h->x[0] * x;
    f[1] -= h->y[1] * y;
    f[2] -= h->x[2] * x + h->y[2] * y;
  }
  for (const pw_reduce_heavy *h = c->single, *end = h + c->singles; h < end; h++) {
    double *f = force + h->j, l = mu[h->slot];
    f[0] -= h->J[0] * l;
    if (h->width == 3) f[1] -= h->J[1] * l, f[2] -= h->J[2] * l;
  }
}

/* x -= H a */
static inline void reduce_rows (const pw_component *c, const double *rates, double *x) {
  for (const pw_reduce_pair *h = c->pair, *end = h + c->pairs; h < end; h++) {
    const double *a = rates + h->j;
    x[h->slot_x] -= h->x[0] * a[0] + h->x[2] * a[2];
    x[h->slot_y] -= h->y[1] * a[1] + h->y[2] * a[2];
  }
  for (const pw_reduce_heavy *h = c->single, *end = h + c->singles; h < end; h++) {
    const double *a = rates + h->j;
    x[h->slot] -= h->width == 3 ? h->J[0] * a[0] + h->J[1] * a[1] + h->J[2] * a[2] : h->J[0] * a[0];
  }
}

PW_INLINE void reduce_forward (pw_component *c, const double *P, const double *gamma, double *f, int n, int unit) {
  double *mu = c->lambda;
  PW_UNROLL for (int p = 0; p < n; p++) c->gamma[p] = gamma[c->row[p]], mu[p] = f[c->light[p]];
  for (int i = n; i < c->rows; i++) {
    c->gamma[i] = gamma[c->row[i]];
    for (int p = 0; p < n; p++) c->gamma[i] -= c->Y[i * n + p] * c->gamma[p];
  }
  reduce_solve_transposed (P, mu, n, unit);
  reduce_pull (c, f);
}

PW_INLINE void reduce_backward (pw_component *c, double *a, double *lambda, int n, int unit) {
  double *x = c->gamma;
  reduce_rows (c, a, x);
  reduce_solve (c->P, x, n, unit);
  for (int i = n; i < c->rows; i++) {
    lambda[c->row[i]] = c->lambda[i];
    for (int p = 0; p < n; p++) c->lambda[p] -= c->Y[i * n + p] * c->lambda[i];
  }
  PW_UNROLL for (int p = 0; p < n; p++) a[c->light[p]] = x[p], lambda[c->row[p]] = c->lambda[p];
}

/* Eliminates if `fresh`, solves if there is a gamma.  Returns 0 if a pivot has become too small. */
PW_INLINE int reduce_first_half (pw_component *c, int fresh, const double *gamma, double *f, int n, int unit) {
  if (fresh && !reduce_lu (c, c->P, n, unit)) return 0;
  if (fresh && c->rows > n) reduce_left_over (c);
  if (gamma) reduce_forward (c, c->P, gamma, f, n, unit);
  return 1;
}

/* The same for three pivots: what comes next does not wait for P to be written. */
PW_INLINE int reduce_first_half_of_3 (pw_component *c, int fresh, const double *gamma, double *f, int unit) {
  double P[9];
  if (!fresh) return reduce_first_half (c, fresh, gamma, f, 3, unit);
  if (!reduce_lu (c, P, 3, unit)) return 0;
  PW_UNROLL for (int i = 0; i < 9; i++) if (!reduce_zero (i / 3, i % 3, unit)) c->P[i] = P[i];
  if (c->rows > 3) reduce_left_over (c);
  if (gamma) reduce_forward (c, P, gamma, f, 3, unit);
  return 1;
}

static inline int reduce_try (pw_component *c, int fresh, const double *gamma, double *f) {
  return c->pinned        ? reduce_first_half_of_3 (c, fresh, gamma, f, 1)
         : c->pivots == 3 ? reduce_first_half_of_3 (c, fresh, gamma, f, 0)
                          : reduce_first_half (c, fresh, gamma, f, c->pivots, 0);
}

double pw_reduce_forward (pw_reduce *r, int fresh, const double *gamma, double *f) {
  double least = 1;
  for (pw_component *c = r->component, *end = r->end; c < end; c++) {
    for (int again = 0; !reduce_try (c, fresh, gamma, f); again = 1)
      if (again || pw_reduce_match (c) < c->pivots) return 0;
    if (!(c->worst >= least)) least = c->worst;
    if (c->rows > c->pivots && !(c->left >= least)) least = c->left;
  }
  return least * least;
}

int pw_reduce_weakest (const pw_reduce *r) {
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

void pw_reduce_backward (pw_reduce *r, double *a, double *lambda) {
  for (pw_component *c = r->component, *end = r->end; c < end; c++)
    c->pinned        ? reduce_backward (c, a, lambda, 3, 1)
    : c->pivots == 3 ? reduce_backward (c, a, lambda, 3, 0)
                     : reduce_backward (c, a, lambda, c->pivots, 0);
}
