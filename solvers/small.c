/* Small scenes; see small.h.
 *
 * Dense L D L^T by rows (Golub & Van Loan 2013, Matrix Computations, algorithm 4.1.1):
 *
 *   c_ij = S_ij - sum_{k < j} c_ik L_jk,   L_ij = c_ij / d_j,   d_i = S_ii - sum_{k < i} c_ik L_ik
 *
 * The functions are written once for a constant size and compiled for each, so that their loops vanish. */
#include "small.h"

#if defined(__GNUC__) && !defined(__clang__)
#define SMALL_UNROLL _Pragma ("GCC unroll 8")
#else
#define SMALL_UNROLL
#endif
#if defined(__GNUC__)
#define SMALL_INLINE static inline __attribute__ ((always_inline))
#else
#define SMALL_INLINE static inline
#endif

/* ---- Panels of 3 columns, the number of rows a constant ---- */

SMALL_INLINE double small_dot (const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* S += J W^-1 J^T over one panel (S n x n, lower triangle), y += J W^-1 f; either may be left out. */
SMALL_INLINE void small_add (const pw_panel *p, const double *inverse, const double *f, double *S, double *y, int n, int rows) {
  const double *w = inverse + p->j;
  double J[PW_SMALL][3];
  int at[PW_SMALL];
  SMALL_UNROLL for (int r = 0; r < rows; r++) {
    at[r] = p->y[r];
    J[r][0] = p->J[r][0], J[r][1] = p->J[r][1], J[r][2] = p->J[r][2];
  }
  if (f) {
    const double z[3] = { w[0] * f[p->j], w[1] * f[p->j + 1], w[2] * f[p->j + 2] };
    SMALL_UNROLL for (int r = 0; r < rows; r++) y[at[r]] += small_dot (J[r], z);
  }
  SMALL_UNROLL for (int r = 0; S && r < rows; r++) {
    const double B[3] = { J[r][0] * w[0], J[r][1] * w[1], J[r][2] * w[2] };
    SMALL_UNROLL for (int q = 0; q <= r; q++) S[at[r] * n + at[q]] += small_dot (B, J[q]);
  }
}

/* a = W^-1 (f - J^T y) over one panel. */
SMALL_INLINE void small_take (const pw_panel *p, const double *inverse, const double *f, const double *y, double *a, int rows) {
  const int j = p->j;
  double x0 = f ? f[j] : 0, x1 = f ? f[j + 1] : 0, x2 = f ? f[j + 2] : 0;
  SMALL_UNROLL for (int r = 0; r < rows; r++) {
    const double *J = p->J[r], l = y[p->y[r]];
    x0 -= J[0] * l;
    x1 -= J[1] * l;
    x2 -= J[2] * l;
  }
  a[j] = inverse[j] * x0;
  a[j + 1] = inverse[j + 1] * x1;
  a[j + 2] = inverse[j + 2] * x2;
}

/* The same for any number of rows and columns. */
static void small_add_any (const pw_panel *p, const double *inverse, const double *f, double *S, double *y, int n) {
  for (int r = 0; r < p->rows; r++)
    for (int c = 0; c < p->width; c++) {
      double scaled = p->J[r][c] * inverse[p->j + c];
      if (f) y[p->y[r]] += scaled * f[p->j + c];
      for (int q = 0; S && q <= r; q++) S[p->y[r] * n + p->y[q]] += scaled * p->J[q][c];
    }
}

static void small_take_any (const pw_panel *p, const double *inverse, const double *f, const double *y, double *a) {
  for (int c = 0; c < p->width; c++) {
    double sum = f ? f[p->j + c] : 0;
    for (int r = 0; r < p->rows; r++) sum -= p->J[r][c] * y[p->y[r]];
    a[p->j + c] = inverse[p->j + c] * sum;
  }
}

/* Over all panels; the usual numbers of rows on a body are compiled apart. */
#define SMALL_PANELS(k, call, any)                                                                                     \
  for (const pw_panel *p = (k)->panel; p < (k)->panel + (k)->panels; p++) {                                            \
    if (p->shape == 3)                                                                                                 \
      call (3);                                                                                                        \
    else if (p->shape == 2)                                                                                            \
      call (2);                                                                                                        \
    else if (p->shape == 1)                                                                                            \
      call (1);                                                                                                        \
    else if (p->shape == 4)                                                                                            \
      call (4);                                                                                                        \
    else                                                                                                               \
      any;                                                                                                             \
  }

/* ---- L D L^T of constant size ---- */

SMALL_INLINE void small_factor (pw_small *k, const double *S, int n) {
  double c[PW_SMALL], worst = 2, *L = k->L;
  k->place = -1;
  SMALL_UNROLL for (int i = 0; i < n; i++) {
    double was = S[i * n + i], d = was;
    SMALL_UNROLL for (int j = 0; j < i; j++) {
      double sum = S[i * n + j];
      SMALL_UNROLL for (int m = 0; m < j; m++) sum -= c[m] * L[j * n + m];
      c[j] = sum;
    }
    SMALL_UNROLL for (int j = 0; j < i; j++) {
      double l = c[j] * L[j * n + j];
      d -= c[j] * l;
      L[i * n + j] = l;
    }
    if (!(d >= worst * was)) worst = d / was, k->place = i;
    if (!(d > 0)) break;
    L[i * n + i] = 1 / d;
  }
  k->pivot = worst;
}

SMALL_INLINE void small_back (const double *L, double *y, int n) {
  SMALL_UNROLL for (int i = 1; i < n; i++) {
    SMALL_UNROLL for (int j = 0; j < i; j++) y[i] -= L[i * n + j] * y[j];
  }
  SMALL_UNROLL for (int i = 0; i < n; i++) y[i] *= L[i * n + i];
  SMALL_UNROLL for (int i = n - 1; i > 0; i--) {
    SMALL_UNROLL for (int j = 0; j < i; j++) y[j] -= L[i * n + j] * y[i];
  }
}

/* Assembly and factorisation, with the right-hand side if there is one. */
SMALL_INLINE void small_assemble (pw_small *k, const double *f, double *y, int n) {
  double S[PW_SMALL * PW_SMALL];
  const double *inverse = k->inverse;
  SMALL_UNROLL for (int i = 0; i < n; i++) {
    SMALL_UNROLL for (int j = 0; j <= i; j++) S[i * n + j] = 0;
  }
#define SMALL_CALL(rows) small_add (p, inverse, f, S, y, n, rows)
  SMALL_PANELS (k, SMALL_CALL, small_add_any (p, inverse, f, S, y, n))
#undef SMALL_CALL
  small_factor (k, S, n);
}

SMALL_INLINE void small_gather (const pw_small *k, const double *f, double *y, int n) {
  const double *inverse = k->inverse;
#define SMALL_CALL(rows) small_add (p, inverse, f, 0, y, n, rows)
  if (f) SMALL_PANELS (k, SMALL_CALL, small_add_any (p, inverse, f, 0, y, n))
#undef SMALL_CALL
}

static void small_scatter (const pw_small *k, const double *f, const double *y, double *a) {
  const double *inverse = k->inverse;
#define SMALL_CALL(rows) small_take (p, inverse, f, y, a, rows)
  SMALL_PANELS (k, SMALL_CALL, small_take_any (p, inverse, f, y, a))
#undef SMALL_CALL
}

/* ---- For each size ---- */

#define SMALL_SIZES SMALL (1) SMALL (2) SMALL (3) SMALL (4) SMALL (5) SMALL (6) SMALL (7) SMALL (8)

void pw_small_factor (pw_small *k) {
  switch (k->n) {
#define SMALL(n)                                                                                                       \
  case n: small_assemble (k, 0, 0, n); break;
    SMALL_SIZES
#undef SMALL
  default: k->pivot = 1, k->place = -1;
  }
}

void pw_small_solve (const pw_small *k, const double *f, double *y, double *a) {
  switch (k->n) {
#define SMALL(n)                                                                                                       \
  case n:                                                                                                              \
    small_gather (k, f, y, n);                                                                                         \
    small_back (k->L, y, n);                                                                                           \
    break;
    SMALL_SIZES
#undef SMALL
  default: break;
  }
  small_scatter (k, f, y, a);
}

void pw_small_both (pw_small *k, const double *f, double *y, double *a) {
  switch (k->n) {
#define SMALL(n)                                                                                                       \
  case n:                                                                                                              \
    small_assemble (k, f, y, n);                                                                                       \
    if (k->pivot > 0) small_back (k->L, y, n);                                                                         \
    break;
    SMALL_SIZES
#undef SMALL
  default: k->pivot = 1, k->place = -1;
  }
  small_scatter (k, f, y, a);
}
