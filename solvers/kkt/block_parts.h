/* Operations on blocks of up to 2 x 2 and on rows of a body's columns, for block_*.c; see block_ldl.h.  Sizes are
 * constants where these functions are inlined; kj is the size of column j, and so on. */
#ifndef PW_BLOCK_PARTS_H
#define PW_BLOCK_PARTS_H

#include <math.h>
#include "block_ldl.h"

/* Calls f with a constant in place of a size that is 1 or 2, or of a width that is 1 or 3. */
#define BLOCK_SIZE(size, f, ...) ((size) == 2 ? f (2, __VA_ARGS__) : f (1, __VA_ARGS__))
#define BLOCK_WIDTH(width, f, ...) ((width) == 3 ? f (3, __VA_ARGS__) : f (1, __VA_ARGS__))

/* Three numbers of a body; of an internal coordinate x alone. */
typedef struct {
  double x, y, angle;
} block_row;

/* A row of J, or the forces f on a body, times W^-1: `width` numbers; w: diagonal of W^-1. */
static inline block_row block_weigh (int width, const double *J, const double *w) {
  return width == 3 ? (block_row){ J[0] * w[0], J[1] * w[1], J[2] * w[2] } : (block_row){ .x = J[0] * w[0] };
}

static inline double block_product (int width, block_row a, const double *b) {
  return width == 3 ? a.x * b[0] + a.y * b[1] + a.angle * b[2] : a.x * b[0];
}

/* Updates l->least_pivot, dividing the pivot by its original diagonal entry only if that makes it smaller; NaN counts
 * as the smallest.  The entry is negative only for uncondensed bodies, which do not count. */
static inline void block_track_pivot (pw_block_ldl *l, double pivot, double original, int unknown) {
  if (pivot > l->least_pivot * original || original < 0 || isnan (l->least_pivot)) return;
  l->least_pivot = pivot / original;
  l->least_unknown = unknown;
}

typedef struct {
  double x, y;
} block_pair;

/* (x, y) divided by a diagonal block of k unknowns with the factors 1 / d_1, l_21, 1 / d_2 of block_factor.c in D. */
static inline block_pair block_divide (int k, const double *D, double x, double y) {
  if (k == 1) return (block_pair){ .x = x * D[0] };
  double z = (y - D[1] * x) * D[2];
  return (block_pair){ x * D[0] - D[1] * z, z };
}

/* (x, y) times a row A of kj entries. */
static inline double block_dot (int kj, double x, double y, const double *A) {
  return kj == 2 ? x * A[0] + y * A[1] : x * A[0];
}

#endif
