/* Elimination of coordinates without weight; see reduce.h. */
#include <math.h>
#include "reduce.h"
#include "unroll.h"

PW_ONE_BY_ONE

/* ---- Matching ---- */

/* Copies the rows of J into Z. */
static void reduce_copy (pw_component *c) {
  double *row = c->Z;
  const pw_reduce_piece *piece = c->piece;
  for (int n = 0; n < c->rows * c->cols; n++) row[n] = 0;
  for (int i = 0; i < c->rows; i++, row += c->cols, piece += PW_REDUCE_PIECES)
    for (const pw_reduce_piece *p = piece; p < piece + PW_REDUCE_PIECES && p->width; p++) {
      double *to = row + p->column;
      to[0] = p->J[0];
      if (p->width == 3) to[1] = p->J[1], to[2] = p->J[2];
    }
}

/* Subtracts the pivot row from row i so that its entry under the pivot vanishes. */
static void reduce_eliminate (pw_component *c, int p, int i) {
  double *row = c->Z + i * c->cols, *pivot = c->Z + p * c->cols;
  double f = row[c->pivot[p]] / pivot[c->pivot[p]];
  for (int n = 0; n < c->cols; n++) row[n] -= f * pivot[n];
  row[c->pivot[p]] = 0;
}

static void reduce_swap (pw_component *c, int a, int b) {
  if (a == b) return;
  int row = c->row[a];
  c->row[a] = c->row[b];
  c->row[b] = row;
  for (int i = 0; i < PW_REDUCE_PIECES; i++) {
    pw_reduce_piece piece = c->piece[a * PW_REDUCE_PIECES + i];
    c->piece[a * PW_REDUCE_PIECES + i] = c->piece[b * PW_REDUCE_PIECES + i];
    c->piece[b * PW_REDUCE_PIECES + i] = piece;
  }
  for (int n = 0; n < c->cols; n++) {
    double z = c->Z[a * c->cols + n];
    c->Z[a * c->cols + n] = c->Z[b * c->cols + n];
    c->Z[b * c->cols + n] = z;
  }
}

/* Where the entries of P, K, H and Z are, for the matching found. */
static void reduce_plan_copies (pw_component *c) {
  static const double zero = 0;
  c->heavies = 0;
  for (int i = 0; i < c->rows; i++) {
    const pw_reduce_piece *piece = c->piece + i * PW_REDUCE_PIECES;
    for (int p = 0; p < c->pivots; p++) c->from[i * c->pivots + p] = &zero;
    for (const pw_reduce_piece *x = piece; x < piece + PW_REDUCE_PIECES && x->width; x++) {
      int heavy = 0;
      for (int n = 0; n < x->width; n++) heavy |= !c->massless[x->column + n];
      for (int p = 0; p < c->pivots; p++)
        if (c->pivot[p] >= x->column && c->pivot[p] < x->column + x->width)
          c->from[i * c->pivots + p] = x->J + c->pivot[p] - x->column;
      if (heavy) c->heavy[c->heavies++] = (pw_reduce_heavy){ x->J, i, c->global[x->column], x->width, x->column };
    }
    if (i < c->pivots) c->heavies_h = c->heavies, c->light[i] = c->global[c->pivot[i]];
  }
}

/* Gaussian elimination; angles in units of length, rows scaled by their largest entry. */
int pw_reduce_match (pw_component *c) {
  const double guard = 0.1;
  reduce_copy (c);
  c->worst = INFINITY;
  for (int p = 0; p < c->pivots; p++) {
    int row = -1, column = -1;
    double best = 1e-12;
    for (int i = p; i < c->rows; i++) {
      double most = 0;
      for (int n = 0; n < c->cols; n++) most = fmax (most, fabs (c->Z[i * c->cols + n]) / c->unit[n]);
      for (int n = 0; n < c->cols; n++) {
        double scaled = c->massless[n] ? fabs (c->Z[i * c->cols + n]) / c->unit[n] / most : 0;
        if (scaled > best) best = scaled, row = i, column = n;
      }
    }
    if (row < 0) return p;
    reduce_swap (c, p, row);
    c->pivot[p] = column;
    c->least[p] = guard * fabs (c->Z[p * c->cols + column]);
    c->worst = fmin (c->worst, best);
    for (int i = p + 1; i < c->rows; i++) reduce_eliminate (c, p, i);
  }
  reduce_plan_copies (c);
  return c->pivots;
}

/* ---- P = L U, the number of pivots a constant where it is usual ---- */

/* Returns 0 if a pivot has become too small, or is not a number. */
PW_INLINE int reduce_lu (pw_component *c, int n) {
  double *P = c->P;
  int good = 1;
  PW_UNROLL for (int i = 0; i < n * n; i++) P[i] = *c->from[i];
  PW_UNROLL for (int p = 0; p < n; p++) {
    double pivot = P[p * n + p], inverse = 1 / pivot;
    good &= fabs (pivot) >= c->least[p];
    P[p * n + p] = inverse;
    PW_UNROLL for (int i = p + 1; i < n; i++) {
      double l = P[i * n + p] * inverse;
      P[i * n + p] = l;
      PW_UNROLL for (int j = p + 1; j < n; j++) P[i * n + j] -= l * P[p * n + j];
    }
  }
  return good;
}

/* x = P^-1 x */
PW_INLINE void reduce_solve (const double *P, double *x, int n) {
  PW_UNROLL for (int i = 1; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[i * n + j] * x[j];
  }
  PW_UNROLL for (int i = n - 1; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[i * n + j] * x[j];
    x[i] *= P[i * n + i];
  }
}

/* x = P^-T x */
PW_INLINE void reduce_solve_transposed (const double *P, double *x, int n) {
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) x[i] -= P[j * n + i] * x[j];
    x[i] *= P[i * n + i];
  }
  PW_UNROLL for (int i = n - 2; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < n; j++) x[i] -= P[j * n + i] * x[j];
  }
}

/* Y and Z~ of the rows left over. */
static void reduce_left_over (pw_component *c) {
  const pw_reduce_heavy *h = c->heavy;
  for (int i = c->pivots; i < c->rows; i++) {
    double *Y = c->Y + i * c->pivots, *Z = c->Z + i * c->cols;
    for (int p = 0; p < c->pivots; p++) Y[p] = *c->from[i * c->pivots + p];
    reduce_solve_transposed (c->P, Y, c->pivots);
    for (int n = 0; n < c->cols; n++) Z[n] = 0;
    for (const pw_reduce_heavy *x = h + c->heavies_h; x < h + c->heavies; x++)
      for (int n = 0; x->slot == i && n < x->width; n++) Z[x->column + n] = x->J[n];
    for (const pw_reduce_heavy *x = h; x < h + c->heavies_h; x++)
      for (int n = 0; n < x->width; n++) Z[x->column + n] -= Y[x->slot] * x->J[n];
  }
}

static inline int reduce_run (pw_component *c) {
  return c->pivots == 3 ? reduce_lu (c, 3) : reduce_lu (c, c->pivots);
}

double pw_reduce_factor (pw_reduce *r) {
  double worst = INFINITY;
  for (pw_component *c = r->component, *last = c + r->components; c < last; c++) {
    if (!reduce_run (c) && (pw_reduce_match (c) < c->pivots || !reduce_run (c))) return 0;
    if (c->rows > c->pivots) reduce_left_over (c);
    if (c->worst < worst) worst = c->worst;
  }
  return worst * worst;
}

/* ---- Solving ---- */

/* f -= J^T l over one of H's runs. */
static inline void reduce_pull (const pw_reduce_heavy *h, double *f, double l) {
  f += h->j;
  f[0] -= h->J[0] * l;
  if (h->width == 3) f[1] -= h->J[1] * l, f[2] -= h->J[2] * l;
}

/* J a over one. */
static inline double reduce_row (const pw_reduce_heavy *h, const double *a) {
  a += h->j;
  return h->width == 3 ? h->J[0] * a[0] + h->J[1] * a[1] + h->J[2] * a[2] : h->J[0] * a[0];
}

/* Of one component with n pivots. */
PW_INLINE void reduce_forward (pw_component *c, const double *gamma, double *f, int n) {
  double *mu = c->lambda;
  PW_UNROLL for (int p = 0; p < n; p++) c->gamma[p] = gamma[c->row[p]], mu[p] = f[c->light[p]];
  for (int i = n; i < c->rows; i++) {
    c->gamma[i] = gamma[c->row[i]];
    for (int p = 0; p < n; p++) c->gamma[i] -= c->Y[i * n + p] * c->gamma[p];
  }
  reduce_solve_transposed (c->P, mu, n);
  for (const pw_reduce_heavy *h = c->heavy, *end = h + c->heavies_h; h < end; h++) reduce_pull (h, f, mu[h->slot]);
}

PW_INLINE void reduce_backward (pw_component *c, double *a, double *lambda, int n) {
  double *x = c->gamma;
  for (const pw_reduce_heavy *h = c->heavy, *end = h + c->heavies_h; h < end; h++) x[h->slot] -= reduce_row (h, a);
  reduce_solve (c->P, x, n);
  for (int i = n; i < c->rows; i++) {
    lambda[c->row[i]] = c->lambda[i];
    for (int p = 0; p < n; p++) c->lambda[p] -= c->Y[i * n + p] * c->lambda[i];
  }
  PW_UNROLL for (int p = 0; p < n; p++) a[c->light[p]] = x[p], lambda[c->row[p]] = c->lambda[p];
}

void pw_reduce_forward (pw_reduce *r, const double *gamma, double *f) {
  for (pw_component *c = r->component, *last = c + r->components; c < last; c++)
    c->pivots == 3 ? reduce_forward (c, gamma, f, 3) : reduce_forward (c, gamma, f, c->pivots);
}

void pw_reduce_backward (pw_reduce *r, double *a, double *lambda) {
  for (pw_component *c = r->component, *last = c + r->components; c < last; c++)
    c->pivots == 3 ? reduce_backward (c, a, lambda, 3) : reduce_backward (c, a, lambda, c->pivots);
}
