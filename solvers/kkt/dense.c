/* Scenes of few constraint equations; see dense.h.
 *
 * Dense L D L^T by rows (Golub & Van Loan 2013, Matrix Computations, algorithm 4.1.1), two at a time:
 *
 *   c_ij = S_ij - sum_{k < j} c_ik L_jk,   L_ij = c_ij / d_j,   d_i = S_ii - sum_{k < i} c_ik L_ik
 *   i, i + 1:  det = d_i s - c c,   1 / d_{i+1} = d_i / det,    c = c_{i+1 i},  s = S_{i+1 i+1} - sum_{k < i} ...
 *
 * so that the two divisions of a pair do not wait for each other. */
#include "dense.h"
#include "unroll.h"

PW_ONE_BY_ONE

/* ---- Body blocks; their width is a constant where these are inlined ---- */

/* S += J W^-1 J^T over one block, in S of n columns its lower triangle. */
PW_INLINE void dense_add (const pw_dense_block *p, double *S, int n, int width) {
  for (int r = 0; r < p->rows; r++) {
    double B[3], *Si = S + p->at[r] * n;
    PW_UNROLL for (int c = 0; c < width; c++) B[c] = p->J[r][c] * p->w[c];
    for (int q = 0; q <= r; q++) {
      double dot = 0;
      PW_UNROLL for (int c = 0; c < width; c++) dot += B[c] * p->J[q][c];
      Si[p->at[q]] += dot;
    }
  }
}

/* y += J W^-1 f over one block. */
PW_INLINE void dense_add_right (const pw_dense_block *p, const double *f, double *y, int width) {
  double z[3];
  PW_UNROLL for (int c = 0; c < width; c++) z[c] = p->w[c] * f[p->j + c];
  for (int r = 0; r < p->rows; r++) {
    double sum = 0;
    PW_UNROLL for (int c = 0; c < width; c++) sum += p->J[r][c] * z[c];
    y[p->at[r]] += sum;
  }
}

/* a = W^-1 (f - J^T y) over one block. */
PW_INLINE void dense_accelerate (const pw_dense_block *p, const double *f, const double *y, double *a, int width) {
  double sum[3];
  PW_UNROLL for (int c = 0; c < width; c++) sum[c] = f ? f[p->j + c] : 0;
  for (int r = 0; r < p->rows; r++) {
    double l = y[p->at[r]];
    PW_UNROLL for (int c = 0; c < width; c++) sum[c] -= p->J[r][c] * l;
  }
  PW_UNROLL for (int c = 0; c < width; c++) a[p->j + c] = p->w[c] * sum[c];
}

/* Calls f with the width, a constant, after its arguments, for each body block. */
#define DENSE_EACH(f, ...)                                    \
  for (const pw_dense_block *p = k->block; p < k->end; p++) { \
    if (p->width == 3)                                        \
      f (p, __VA_ARGS__, 3);                                  \
    else                                                      \
      f (p, __VA_ARGS__, 1);                                  \
  }

/* ---- L D L^T ---- */

/* c = the remainder of row i in the first m columns, L = its entries there. */
PW_INLINE void dense_row (const double *S, double *L, double *c, int i, int m, int n) {
  PW_UNROLL for (int j = 0; j < m; j++) {
    double sum = S[i * n + j];
    PW_UNROLL for (int k = 0; k < j; k++) sum -= c[k] * L[j * n + k];
    c[j] = sum;
  }
  PW_UNROLL for (int j = 0; j < m; j++) L[i * n + j] = c[j] * L[j * n + j];
}

PW_INLINE double dense_left (double S, const double *L, const double *c, int m) {
  PW_UNROLL for (int j = 0; j < m; j++) S -= c[j] * L[j];
  return S;
}

/* Returns 0 if a pivot is not above `least` times its diagonal entry; after a zero pivot the factors are invalid. */
PW_INLINE int dense_factor (const double *S, double *L, double least, int n) {
  int good = 1;
  PW_UNROLL for (int i = 0; i < n; i += 2) {
    double c[PW_DENSE];
    dense_row (S, L, c, i, i, n);
    double d = dense_left (S[i * n + i], L + i * n, c, i);
    L[i * n + i] = 1 / d;
    good &= d > least * S[i * n + i];
    if (i + 1 == n) break;
    int k = i + 1;
    dense_row (S, L, c, k, i, n);
    double off = dense_left (S[k * n + i], L + i * n, c, i), s = dense_left (S[k * n + k], L + k * n, c, i);
    double det = d * s - off * off;
    L[k * n + i] = off * L[i * n + i];
    L[k * n + k] = d / det;
    good &= det > least * (d * S[k * n + k]);
  }
  return good;
}

PW_INLINE void dense_back (const double *L, double *y, int n) {
  PW_UNROLL for (int i = 1; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) y[i] -= L[i * n + j] * y[j];
  }
  PW_UNROLL for (int i = 0; i < n; i++) y[i] *= L[i * n + i];
  PW_UNROLL for (int i = n - 1; i > 0; i--) {
    PW_UNROLL for (int j = 0; j < i; j++) y[j] -= L[i * n + j] * y[i];
  }
}

double pw_dense_pivot (const pw_dense *k, int *place) {
  double worst = 1;
  *place = -1;
  for (int i = 0; i < k->n && worst > k->guard; i++) {
    double pivot = 1 / (k->L[i * (k->n + 1)] * k->S[i * (k->n + 1)]);
    if (!(pivot >= worst)) worst = pivot, *place = i;
  }
  return worst;
}

/* ---- For each number of equations ---- */

PW_INLINE void dense_factor_of (pw_dense *k, int n) {
  double L[PW_DENSE * PW_DENSE];
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j <= i; j++) k->S[i * n + j] = 0;
  }
  DENSE_EACH (dense_add, k->S, n)
  k->low = !dense_factor (k->S, L, PW_DENSE_WATCH, n);
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j <= i; j++) k->L[i * n + j] = L[i * n + j];
  }
}

PW_INLINE void dense_solve_of (const pw_dense *k, const double *f, const double *gamma, double *a, double *lambda,
                               int n) {
  double y[PW_DENSE];
  PW_UNROLL for (int i = 0; i < n; i++) y[i] = -gamma[k->row[i]];
  if (f) DENSE_EACH (dense_add_right, f, y)
  dense_back (k->L, y, n);
  PW_UNROLL for (int i = 0; i < n; i++) lambda[k->row[i]] = y[i];
  DENSE_EACH (dense_accelerate, f, y, a)
}

#define DENSE_SIZES DENSE (0) DENSE (1) DENSE (2) DENSE (3) DENSE (4) DENSE (5) DENSE (6) DENSE (7) DENSE (8)

int pw_dense_factor (pw_dense *k) {
  int place;
  switch (k->n) {
#define DENSE(n)            \
  case n:                   \
    dense_factor_of (k, n); \
    break;
    DENSE_SIZES
#undef DENSE
  }
  return !k->low || pw_dense_pivot (k, &place) > k->guard;
}

void pw_dense_solve (const pw_dense *k, const double *f, const double *gamma, double *a, double *lambda) {
  switch (k->n) {
#define DENSE(n)                                \
  case n:                                       \
    dense_solve_of (k, f, gamma, a, lambda, n); \
    break;
    DENSE_SIZES
#undef DENSE
  }
}
