/* Scenes of few constraint equations; see small.h.
 *
 * Dense L D L^T by rows (Golub & Van Loan 2013, Matrix Computations, algorithm 4.1.1), two at a time:
 *
 *   c_ij = S_ij - sum_{k < j} c_ik L_jk,   L_ij = c_ij / d_j,   d_i = S_ii - sum_{k < i} c_ik L_ik
 *   i, i + 1:  det = d_i s - c c,   1 / d_{i+1} = d_i / det,    c = c_{i+1 i},  s = S_{i+1 i+1} - sum_{k < i} ...
 *
 * so that the two divisions of a pair do not wait for each other.  The functions are written once and compiled for each
 * constant size, so that their loops vanish. */
#include "skyline.h"
#include "small.h"
#include "unroll.h"

PW_ONE_BY_ONE

/* ---- Body blocks; their width is a constant where these are inlined ---- */

/* S += J W^-1 J^T over one block (in S of n columns its lower triangle); y += J W^-1 f unless there is no f. */
PW_INLINE void small_add (const pw_body_block *p, const double *f, double *S, double *y, int n, int width) {
  for (int r = 0; r < p->rows; r++) {
    const double *J = p->J[r];
    double B[3], *Si = S + p->at[r] * n;
    PW_UNROLL for (int c = 0; c < width; c++) B[c] = J[c] * p->w[c];
    if (f) {
      double sum = 0;
      PW_UNROLL for (int c = 0; c < width; c++) sum += B[c] * f[p->j + c];
      y[p->at[r]] += sum;
    }
    for (int q = 0; q <= r; q++) {
      double dot = 0;
      PW_UNROLL for (int c = 0; c < width; c++) dot += B[c] * p->J[q][c];
      Si[p->at[q]] += dot;
    }
  }
}

/* y += J W^-1 f over one block. */
PW_INLINE void small_add_right (const pw_body_block *p, const double *f, double *y, int width) {
  double z[3];
  PW_UNROLL for (int c = 0; c < width; c++) z[c] = p->w[c] * f[p->j + c];
  for (int r = 0; r < p->rows; r++) {
    double sum = 0;
    PW_UNROLL for (int c = 0; c < width; c++) sum += p->J[r][c] * z[c];
    y[p->at[r]] += sum;
  }
}

/* a = W^-1 (f - J^T y) over one block. */
PW_INLINE void small_accelerate (const pw_body_block *p, const double *f, const double *y, double *a, int width) {
  double sum[3];
  PW_UNROLL for (int c = 0; c < width; c++) sum[c] = f ? f[p->j + c] : 0;
  for (int r = 0; r < p->rows; r++) {
    double l = y[p->at[r]];
    PW_UNROLL for (int c = 0; c < width; c++) sum[c] -= p->J[r][c] * l;
  }
  PW_UNROLL for (int c = 0; c < width; c++) a[p->j + c] = p->w[c] * sum[c];
}

PW_INLINE void small_gather (pw_small *k, const double *f, int n) {
  for (const pw_body_block *p = k->block; p < k->end; p++) {
    if (p->width == 3)
      small_add (p, f, k->S, k->y, n, 3);
    else
      small_add (p, f, k->S, k->y, n, 1);
  }
}

static void small_gather_right (pw_small *k, const double *f) {
  for (const pw_body_block *p = k->block; p < k->end; p++) {
    if (p->width == 3)
      small_add_right (p, f, k->y, 3);
    else
      small_add_right (p, f, k->y, 1);
  }
}

static void small_scatter (const pw_small *k, const double *f, double *a) {
  for (const pw_body_block *p = k->block; p < k->end; p++) {
    if (p->width == 3)
      small_accelerate (p, f, k->y, a, 3);
    else
      small_accelerate (p, f, k->y, a, 1);
  }
}

/* ---- L D L^T ---- */

/* c = what is left of row i in the first m columns, L = its entries there; returns what is left in column m, which
 * may be a further row's. */
PW_INLINE void small_row (const double *S, double *L, double *c, int i, int m, int n) {
  PW_UNROLL for (int j = 0; j < m; j++) {
    double sum = S[i * n + j];
    PW_UNROLL for (int k = 0; k < j; k++) sum -= c[k] * L[j * n + k];
    c[j] = sum;
  }
  PW_UNROLL for (int j = 0; j < m; j++) L[i * n + j] = c[j] * L[j * n + j];
}

PW_INLINE double small_left (double S, const double *L, const double *c, int m) {
  PW_UNROLL for (int j = 0; j < m; j++) S -= c[j] * L[j];
  return S;
}

/* Returns 0 if a pivot is not above so much of its diagonal entry; if it is 0, what comes after it is of no use. */
PW_INLINE int small_factor (const double *S, double *L, double least, int n) {
  int good = 1;
  PW_UNROLL for (int i = 0; i < n; i += 2) {
    double c[PW_SMALL];
    small_row (S, L, c, i, i, n);
    double d = small_left (S[i * n + i], L + i * n, c, i);
    L[i * n + i] = 1 / d;
    good &= d > least * S[i * n + i];
    if (i + 1 == n) break;
    int k = i + 1;
    small_row (S, L, c, k, i, n);
    double off = small_left (S[k * n + i], L + i * n, c, i), s = small_left (S[k * n + k], L + k * n, c, i);
    double det = d * s - off * off;
    L[k * n + i] = off * L[i * n + i];
    L[k * n + k] = d / det;
    good &= det > least * (d * S[k * n + k]);
  }
  return good;
}

PW_INLINE void small_back (const double *L, double *y, int n) {
  PW_UNROLL for (int i = 1; i < n; i++) {
    PW_UNROLL for (int j = 0; j < i; j++) y[i] -= L[i * n + j] * y[j];
  }
  PW_UNROLL for (int i = 0; i < n; i++) y[i] *= L[i * n + i];
  PW_UNROLL for (int i = n - 1; i > 0; i--) {
    PW_UNROLL for (int j = 0; j < i; j++) y[j] -= L[i * n + j] * y[i];
  }
}

double pw_small_pivot (const pw_small *k, int *place) {
  double worst = 1;
  *place = -1;
  for (int i = 0; i < k->n && worst > k->guard; i++) {
    double pivot = 1 / (k->L[i * (k->n + 1)] * k->S[i * (k->n + 1)]);
    if (!(pivot >= worst)) worst = pivot, *place = i;
  }
  return worst;
}

/* A pivot is low: 1 if it is above the guard all the same. */
static int small_judge (const pw_small *k) {
  int place;
  return pw_small_pivot (k, &place) > k->guard;
}

/* Assembly and factorisation, with the right-hand side if there is one; L is kept. */
PW_INLINE int small_assemble (pw_small *k, const double *f, double *L, int n) {
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j <= i; j++) k->S[i * n + j] = 0;
  }
  small_gather (k, f, n);
  k->low = !small_factor (k->S, L, PW_SMALL_WATCH, n);
  PW_UNROLL for (int i = 0; i < n; i++) {
    PW_UNROLL for (int j = 0; j <= i; j++) k->L[i * n + j] = L[i * n + j];
  }
  return !k->low || small_judge (k);
}

PW_INLINE void small_right (pw_small *k, const double *gamma, int n) {
  PW_UNROLL for (int i = 0; i < n; i++) k->y[i] = -gamma[k->row[i]];
}

/* From the right-hand side in k->y: lambda, which stays there too. */
PW_INLINE void small_lambda (pw_small *k, const double *L, double *lambda, int n) {
  double y[PW_SMALL];
  PW_UNROLL for (int i = 0; i < n; i++) y[i] = k->y[i];
  small_back (L, y, n);
  PW_UNROLL for (int i = 0; i < n; i++) k->y[i] = lambda[k->row[i]] = y[i];
}

/* ---- For each size ---- */

PW_INLINE int small_factor_of (pw_small *k, int n) {
  double L[PW_SMALL * PW_SMALL];
  return small_assemble (k, 0, L, n);
}

PW_INLINE void small_solve_of (pw_small *k, const double *f, const double *gamma, double *lambda, int n) {
  small_right (k, gamma, n);
  if (f) small_gather_right (k, f);
  small_lambda (k, k->L, lambda, n);
}

PW_INLINE int small_both_of (pw_small *k, const double *f, const double *gamma, double *lambda, int n) {
  double L[PW_SMALL * PW_SMALL];
  small_right (k, gamma, n);
  if (!small_assemble (k, f, L, n)) return 0;
  small_lambda (k, L, lambda, n);
  return 1;
}

/* The same for any number of rows, within the skyline of S. */
static int small_assemble_any (pw_small *k, const double *f) {
  int n = k->n;
  for (int i = 0; i < n; i++)
    for (int j = k->begin[i]; j <= i; j++) k->S[i * n + j] = 0;
  small_gather (k, f, n);
  k->low = !pw_skyline_factor (k->S, k->L, k->begin, PW_SMALL_WATCH, n);
  return !k->low || small_judge (k);
}

static void small_lambda_any (pw_small *k, double *lambda) {
  pw_skyline_solve (k->L, k->begin, k->y, k->n);
  for (int i = 0; i < k->n; i++) lambda[k->row[i]] = k->y[i];
}

static void small_solve_any (pw_small *k, const double *f, const double *gamma, double *lambda) {
  small_right (k, gamma, k->n);
  if (f) small_gather_right (k, f);
  small_lambda_any (k, lambda);
}

static int small_both_any (pw_small *k, const double *f, const double *gamma, double *lambda) {
  small_right (k, gamma, k->n);
  if (!small_assemble_any (k, f)) return 0;
  small_lambda_any (k, lambda);
  return 1;
}

#define SMALL_SIZES SMALL (1) SMALL (2) SMALL (3) SMALL (4) SMALL (5) SMALL (6) SMALL (7) SMALL (8)

int pw_small_factor (pw_small *k) {
  switch (k->n) {
#define SMALL(n) \
  case n:        \
    return small_factor_of (k, n);
    SMALL_SIZES
#undef SMALL
  default:
    return small_assemble_any (k, 0);
  }
}

void pw_small_solve (pw_small *k, const double *f, const double *gamma, double *a, double *lambda) {
  switch (k->n) {
#define SMALL(n)                             \
  case n:                                    \
    small_solve_of (k, f, gamma, lambda, n); \
    break;
    SMALL_SIZES
#undef SMALL
  default:
    small_solve_any (k, f, gamma, lambda);
  }
  small_scatter (k, f, a);
}

int pw_small_both (pw_small *k, const double *f, const double *gamma, double *a, double *lambda) {
  switch (k->n) {
#define SMALL(n)                                           \
  case n:                                                  \
    if (!small_both_of (k, f, gamma, lambda, n)) return 0; \
    break;
    SMALL_SIZES
#undef SMALL
  default:
    if (!small_both_any (k, f, gamma, lambda)) return 0;
  }
  small_scatter (k, f, a);
  return 1;
}
