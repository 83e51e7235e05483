/* Dense LDL^T for small scenes (Golub & Van Loan 2013, Matrix Computations, algorithm 4.1.1), by rows:
 *
 *   c_ij = S_ij - sum_{k < j} c_ik L_jk,   L_ij = c_ij / d_j,   d_i = S_ii - sum_{k < i} c_ik L_ik
 *
 * The functions are written once and compiled for each size, so that all loops vanish. */
#include "ldl_small.h"

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

SMALL_INLINE double small_factor (double *S, int n, int *place) {
  double worst = 2, c[PW_LDL_SMALL], inverse[PW_LDL_SMALL];
  *place = -1;
  SMALL_UNROLL for (int i = 0; i < n; i++) {
    double was = S[i * n + i], d = was;
    SMALL_UNROLL for (int j = 0; j < i; j++) {
      double sum = S[i * n + j];
      SMALL_UNROLL for (int k = 0; k < j; k++) sum -= c[k] * S[j * n + k];
      c[j] = sum;
    }
    SMALL_UNROLL for (int j = 0; j < i; j++) {
      double l = c[j] * inverse[j];
      d -= c[j] * l;
      S[i * n + j] = l;
    }
    if (!(d >= worst * was)) worst = d / was, *place = i;
    if (!(d > 0)) return worst;
    S[i * n + i] = inverse[i] = 1 / d;
  }
  return worst;
}

SMALL_INLINE void small_solve (const double *S, int n, double *y) {
  SMALL_UNROLL for (int i = 1; i < n; i++) {
    SMALL_UNROLL for (int j = 0; j < i; j++) y[i] -= S[i * n + j] * y[j];
  }
  SMALL_UNROLL for (int i = 0; i < n; i++) y[i] *= S[i * n + i];
  SMALL_UNROLL for (int i = n - 1; i > 0; i--) {
    SMALL_UNROLL for (int j = 0; j < i; j++) y[j] -= S[i * n + j] * y[i];
  }
}

#define SMALL_SIZES SMALL (1) SMALL (2) SMALL (3) SMALL (4) SMALL (5) SMALL (6) SMALL (7) SMALL (8)

double pw_ldl_small_factor (double *S, int n, int *place) {
  switch (n) {
#define SMALL(m)                                                                                                       \
  case m: return small_factor (S, m, place);
    SMALL_SIZES
#undef SMALL
  default: *place = -1; return 1;
  }
}

void pw_ldl_small_solve (const double *S, int n, double *y) {
  switch (n) {
#define SMALL(m)                                                                                                       \
  case m: small_solve (S, m, y); break;
    SMALL_SIZES
#undef SMALL
  default: break;
  }
}
