/* Rows of a body's columns and blocks of up to 2 x 2; see block_ldl.h.  Sizes are constants where these functions are
 * inlined. */
#ifndef PW_BLOCK_PARTS_H
#define PW_BLOCK_PARTS_H

#include <math.h>
#include "block_ldl.h"

/* Calls f with a constant in place of a size that is 1 or 2. */
#define BLOCK_SIZE(size, f, ...) ((size) == 2 ? f (2, __VA_ARGS__) : f (1, __VA_ARGS__))

typedef struct {
  double x, y, z;
} block_row;

/* A row of J W^-1 of 3 columns, or 1. */
static inline block_row block_weigh (int width, const double *J, const double *w) {
  return width == 3 ? (block_row){ J[0] * w[0], J[1] * w[1], J[2] * w[2] } : (block_row){ .x = J[0] * w[0] };
}

static inline double block_product (int width, block_row a, const double *b) {
  return width == 3 ? a.x * b[0] + a.y * b[1] + a.z * b[2] : a.x * b[0];
}

typedef struct {
  double xx, xy, yx, yy;
} block_square;

/* The smallest pivot relative to its diagonal entry, without dividing as long as it stays the smallest; what is not a
 * number is taken for smaller, and so is 0 out of 0.  `was` is not negative, or else a pivot below 0 could make up for the
 * one before it; that of an uncondensed body is, and does not count. */
static inline void block_judge (pw_block_ldl *l, double pivot, double was, int y) {
  if (pivot > l->pivot * was || was < 0) return;
  l->pivot = pivot / was;
  l->row = y;
}

/* Inverts a diagonal block in place. */
static inline block_square block_invert (int k, double *D, pw_block_ldl *l, int y) {
  if (k == 1) {
    block_judge (l, D[0], D[1], y);
    D[0] = 1 / D[0];
    return (block_square){ .xx = D[0] };
  }
  double a = D[0], b = D[1], c = D[2], minor = a * c - b * b, f = 1 / minor;
  block_judge (l, a, D[3], y);
  block_judge (l, minor, fabs (a) * D[4], y + 1);
  D[0] = c * f, D[1] = -b * f, D[2] = a * f;
  return (block_square){ D[0], D[1], D[1], D[2] };
}

/* L = A D^-1: A ki x kj. */
static inline block_square block_scale (int ki, int kj, const double *A, block_square D) {
  block_square L = { .xx = A[0] * D.xx };
  if (kj == 2) L.xx += A[1] * D.yx, L.xy = A[0] * D.xy + A[1] * D.yy;
  if (ki == 2) L.yx = A[kj] * D.xx;
  if (ki == 2 && kj == 2) L.yx += A[3] * D.yx, L.yy = A[2] * D.xy + A[3] * D.yy;
  return L;
}

static inline double block_dot (int kj, double x, double y, const double *A) {
  return kj == 2 ? x * A[0] + y * A[1] : x * A[0];
}

/* D -= L A^T, of a diagonal block, of which there is the lower triangle: L ki x kj, A ki x kj. */
static inline void block_subtract_diagonal (int ki, double *D, block_square L, const double *A, int kj) {
  D[0] -= block_dot (kj, L.xx, L.xy, A);
  if (ki == 2) D[1] -= block_dot (kj, L.yx, L.yy, A), D[2] -= block_dot (kj, L.yx, L.yy, A + kj);
}

#endif
