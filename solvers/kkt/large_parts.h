/* What the numbers of a large scene consist of: the parts of large.c (down) and large_solve.c (up), inline in both; see
 * large.h.
 *
 * The patches of two pins, and patches and columns of nodes of 1 or 2 rows and the 3 columns of a body, are written out;
 * sizes are constants where these functions are called, so that the tests vanish.  What else there is goes through
 * loops, in the functions called ..._any. */
#ifndef PW_LARGE_PARTS_H
#define PW_LARGE_PARTS_H

#include <math.h>
#include <string.h>
#include "large.h"

/* What a patch is asked for. */
enum { LARGE_MATRIX = 1, LARGE_RIGHT = 2 };

/* Calls f with a constant in place of a size that is 1 or 2. */
#define LARGE_SHORT(size, f, ...) ((size) == 2 ? f (2, __VA_ARGS__) : f (1, __VA_ARGS__))

static inline double *large_at (double *value, int at) {
  return value + (at < 0 ? ~at : at);
}

static inline const double *large_J (const pw_large *l, const pw_piece *p) {
  return l->base[p->other] + p->J;
}

/* ---- Patches of a body whose nodes have 1 or 2 rows ---- */

typedef struct {
  double x, y, z;
} large_three;

static inline large_three large_weigh (const double *J, const double *w) {
  return (large_three){ J[0] * w[0], J[1] * w[1], J[2] * w[2] };
}

static inline double large_dot (large_three a, const double *b) {
  return a.x * b[0] + a.y * b[1] + a.z * b[2];
}

/* One or two rows of J W^-1. */
typedef struct {
  large_three first, second;
} large_rows;

static inline large_rows large_weigh_rows (int size, const double *A, int step, const double *w) {
  large_rows a = { .first = large_weigh (A, w) };
  if (size == 2) a.second = large_weigh (A + step, w);
  return a;
}

static inline void large_gather (int size, double *y, large_rows a, const double *f) {
  y[0] -= large_dot (a.first, f);
  if (size == 2) y[1] -= large_dot (a.second, f);
}

/* The diagonal block of a piece, and once more its diagonal; stored where `at` is a complement, else added. */
static inline void large_diagonal (int size, double *value, int at, large_rows a, const double *A, int step) {
  double *D = large_at (value, at), xx = large_dot (a.first, A), yx = 0, yy = 0;
  if (size == 2) yx = large_dot (a.second, A), yy = large_dot (a.second, A + step);
  if (at >= 0) {
    xx += D[0];
    if (size == 2) yx += D[1], yy += D[2];
  }
  if (size == 2)
    D[0] = D[3] = xx, D[1] = yx, D[2] = D[4] = yy;
  else
    D[0] = D[1] = xx;
}

/* The block of two pieces, a the one whose column comes first: ka x kb rows of a against rows of b. */
static inline void large_block (int ka, int kb, double *value, int at, large_rows a, const double *B, int step) {
  double *K = large_at (value, at), xx = large_dot (a.first, B), xy = 0, yx = 0, yy = 0;
  if (ka == 2) xy = large_dot (a.second, B);
  if (kb == 2) yx = large_dot (a.first, B + step);
  if (ka == 2 && kb == 2) yy = large_dot (a.second, B + step);
  if (at >= 0) {
    xx += K[0];
    if (ka == 2) xy += K[1];
    if (kb == 2) yx += K[ka];
    if (ka == 2 && kb == 2) yy += K[3];
  }
  K[0] = xx;
  if (ka == 2) K[1] = xy;
  if (kb == 2) K[ka] = yx;
  if (ka == 2 && kb == 2) K[3] = yy;
}

/* A piece of ka rows, with those that come after it in its patch; block: of this piece and the next one. */
static inline void large_piece (int ka, const pw_large *l, const pw_patch *p, const pw_piece *a, const int *block,
                                const double *f, double *y, int what) {
  const double *A = large_J (l, a), *w = l->inverse + p->j;
  double *value = l->ldl->value;
  large_rows R = large_weigh_rows (ka, A, a->step, w);
  if (what & LARGE_RIGHT) large_gather (ka, y + a->y, R, f + p->j);
  if (!(what & LARGE_MATRIX)) return;
  large_diagonal (ka, value, a->D, R, A, a->step);
  for (const pw_piece *b = a + 1; b < l->piece + p[1].first; b++, block++)
    if (b->size == 2)
      large_block (ka, 2, value, *block, R, large_J (l, b), b->step);
    else
      large_block (ka, 1, value, *block, R, large_J (l, b), b->step);
}

/* ---- The patch of two pins ---- */

/* Two rows of a body: the unit matrix times s, then the angle's column. */
typedef struct {
  double s, x, y;
} large_arm;

static inline large_arm large_read_arm (const double *J, ptrdiff_t step) {
  return (large_arm){ J[0], J[2], J[step + 2] };
}

/* y -= J W^-1 f at both arms. */
static inline void large_gather_arms (double *ya, double *yb, large_arm a, large_arm b, const double *f, double m,
                                      double i) {
  const double X = m * f[0], Y = m * f[1], T = i * f[2];
  ya[0] -= a.s * X + a.x * T, ya[1] -= a.s * Y + a.y * T;
  yb[0] -= b.s * X + b.x * T, yb[1] -= b.s * Y + b.y * T;
}

/* D += m s^2 + i (x, y) (x, y)^T with 1/mass m and 1/inertia i. */
static inline void large_arm_diagonal (double *value, int at, large_arm a, double m, double i) {
  double *D = large_at (value, at), ix = i * a.x, mass = m * a.s * a.s;
  double xx = mass + ix * a.x, yx = ix * a.y, yy = mass + i * a.y * a.y;
  if (at >= 0) xx += D[0], yx += D[1], yy += D[2];
  D[0] = D[3] = xx, D[1] = yx, D[2] = D[4] = yy;
}

static inline void large_link (const pw_large *l, const pw_patch *p, const double *f, double *y, int what) {
  const pw_piece *pa = l->piece + p->first, *pb = pa + 1;
  const double m = l->inverse[p->j], i = l->inverse[p->j + 2];
  const large_arm a = large_read_arm (large_J (l, pa), pa->step), b = large_read_arm (large_J (l, pb), pb->step);
  if (what & LARGE_RIGHT) large_gather_arms (y + pa->y, y + pb->y, a, b, f + p->j, m, i);
  if (!(what & LARGE_MATRIX)) return;
  double *value = l->ldl->value, mass = m * a.s * b.s, x = i * b.x, z = i * b.y;
  const int at = l->block[p->block];
  large_arm_diagonal (value, pa->D, a, m, i);
  large_arm_diagonal (value, pb->D, b, m, i);
  double *K = large_at (value, at), xx = mass + x * a.x, xy = x * a.y, yx = z * a.x, yy = mass + z * a.y;
  if (at >= 0) xx += K[0], xy += K[1], yx += K[2], yy += K[3];
  K[0] = xx, K[1] = xy, K[2] = yx, K[3] = yy;
}

/* ---- Any patch ---- */

static inline void large_piece_any (const pw_large *l, const pw_patch *p, const pw_piece *a, const int *block,
                                    const double *f, double *y, int what) {
  const double *A = large_J (l, a), *w = l->inverse + p->j;
  double R[PW_LDL_NODE * 3], *value = l->ldl->value;
  for (int i = 0; i < a->size; i++)
    for (int n = 0; n < p->width; n++) R[3 * i + n] = A[i * a->step + n] * w[n];
  for (int i = 0; i < a->size && (what & LARGE_RIGHT); i++)
    for (int n = 0; n < p->width; n++) y[a->y + i] -= R[3 * i + n] * f[p->j + n];
  if (!(what & LARGE_MATRIX)) return;
  double *T = large_at (value, a->D), *was = T + pw_ldl_triangle (a->size);
  for (int i = 0; i < a->size; was[i] = T[-1], i++)
    for (int q = 0; q <= i; q++, T++) {
      double sum = a->D < 0 ? 0 : *T;
      for (int n = 0; n < p->width; n++) sum += R[3 * i + n] * A[q * a->step + n];
      *T = sum;
    }
  for (const pw_piece *b = a + 1; b < l->piece + p[1].first; b++, block++) {
    const double *B = large_J (l, b);
    T = large_at (value, *block);
    for (int i = 0; i < b->size; i++)
      for (int q = 0; q < a->size; q++, T++) {
        double sum = *block < 0 ? 0 : *T;
        for (int n = 0; n < p->width; n++) sum += R[3 * q + n] * B[i * b->step + n];
        *T = sum;
      }
  }
}

/* A body that is kept: its mass, its columns of J, and what later rows would have on the diagonal if it were not. */
static inline void large_keep (const pw_large *l, const pw_patch *p, const double *f, double *y, int what) {
  const pw_piece *own = l->piece + p[1].first - 1;
  const double *w = l->inverse + p->j;
  const int *block = l->block + p->block;
  for (int n = 0; n < 3 && (what & LARGE_RIGHT); n++) y[own->y + n] -= f[p->j + n];
  if (!(what & LARGE_MATRIX)) return;
  double *value = l->ldl->value, *D = large_at (value, own->D);
  for (int i = 0, at = 0; i < 3; i++)
    for (int q = 0; q <= i; q++) D[at++] = q < i ? 0 : -1 / w[i];
  for (int n = 0; n < 3; n++) D[6 + n] = -1 / w[n];
  for (const pw_piece *a = l->piece + p->first; a < own; a++, block++) {
    const double *A = large_J (l, a);
    double *K = large_at (value, *block), *T = large_at (value, a->D), *was = T + pw_ldl_triangle (a->size);
    int later = T > D;
    for (int i = 0; i < a->size; i++)
      for (int n = 0; n < 3; n++) K[later ? 3 * i + n : a->size * n + i] = A[i * a->step + n];
    if (a->D < 0) memset (T, 0, (size_t)(pw_ldl_triangle (a->size) + a->size) * sizeof *T);
    for (int i = 0; i < a->size && later; i++)
      for (int n = 0; n < 3; n++) was[i] += A[i * a->step + n] * w[n] * A[i * a->step + n];
  }
}

static inline void large_patch (const pw_large *l, const pw_patch *p, const double *f, double *y, int what) {
  if (p->shape == PW_LINK) {
    large_link (l, p, f, y, what);
    return;
  }
  if (p->shape == PW_KEPT) {
    large_keep (l, p, f, y, what);
    return;
  }
  const int *block = l->block + p->block;
  for (const pw_piece *a = l->piece + p->first, *end = l->piece + p[1].first; a < end; block += end - ++a)
    if (p->shape == PW_ANY)
      large_piece_any (l, p, a, block, f, y, what);
    else
      LARGE_SHORT (a->size, large_piece, l, p, a, block, f, y, what);
}

/* ---- Pieces of an elimination ---- */

/* The smallest pivot relative to its diagonal entry, without dividing as long as it stays the smallest; what is not a
 * number is taken for smaller, and so is 0 out of 0.  `was` is not negative, or else a pivot below 0 could make up for the
 * one before it. */
static inline void large_judge (pw_large *l, double pivot, double was, int y) {
  if (pivot > l->pivot * was) return;
  l->pivot = pivot / was;
  l->row = y;
}

/* A block of up to 2 x 2. */
typedef struct {
  double xx, xy, yx, yy;
} large_square;

/* Inverts a diagonal block in place. */
static inline large_square large_invert (int k, double *D, pw_large *l, int y) {
  if (k == 1) {
    large_judge (l, D[0], D[1], y);
    D[0] = 1 / D[0];
    return (large_square){ .xx = D[0] };
  }
  double a = D[0], b = D[1], c = D[2], minor = a * c - b * b, f = 1 / minor;
  large_judge (l, a, D[3], y);
  large_judge (l, minor, fabs (a) * D[4], y + 1);
  D[0] = c * f, D[1] = -b * f, D[2] = a * f;
  return (large_square){ D[0], D[1], D[1], D[2] };
}

/* L = A D^-1: A ki x kj. */
static inline large_square large_scale (int ki, int kj, const double *A, large_square D) {
  large_square L = { .xx = A[0] * D.xx };
  if (kj == 2) L.xx += A[1] * D.yx, L.xy = A[0] * D.xy + A[1] * D.yy;
  if (ki == 2) L.yx = A[kj] * D.xx;
  if (ki == 2 && kj == 2) L.yx += A[3] * D.yx, L.yy = A[2] * D.xy + A[3] * D.yy;
  return L;
}

static inline double large_dot_pair (int kj, double x, double y, const double *A) {
  return kj == 2 ? x * A[0] + y * A[1] : x * A[0];
}

/* D -= L A^T, of a diagonal block, of which there is the lower triangle: L ki x kj, A ki x kj. */
static inline void large_subtract_diagonal (int ki, double *D, large_square L, const double *A, int kj) {
  D[0] -= large_dot_pair (kj, L.xx, L.xy, A);
  if (ki == 2) D[1] -= large_dot_pair (kj, L.yx, L.yy, A), D[2] -= large_dot_pair (kj, L.yx, L.yy, A + kj);
}

/* ---- Pieces of a solution ---- */

/* y_p -= L y_j */
static inline void large_forward (int ki, double *to, const double *L, const double *from, int kj) {
  to[0] -= large_dot_pair (kj, from[0], from[kj - 1], L);
  if (ki == 2) to[1] -= large_dot_pair (kj, from[0], from[kj - 1], L + kj);
}

/* to -= L from, L ki x kj */
static inline void large_forward_any (int ki, double *to, const double *L, const double *from, int kj) {
  for (int i = 0; i < ki; i++)
    for (int j = 0; j < kj; j++) to[i] -= L[i * kj + j] * from[j];
}

/* Entry (i, j) of a lower triangle by rows. */
static inline double large_entry (const double *D, int i, int j) {
  return i < j ? D[j * (j + 1) / 2 + i] : D[i * (i + 1) / 2 + j];
}

/* The second half of a solve, when y has gone down: the rest of the solution, and the accelerations. */
void pw_large_up (const pw_large *l, const double *f, double *y, double *a);

/* ---- Chains: what patches and columns do elsewhere, for all of its bodies; y or f may be NULL ---- */

/* Assembly and elimination; stops at a pivot that is not positive. */
void pw_large_chain_down (pw_large *l, const pw_chain *c, const double *f, double *y);
/* The right-hand side alone. */
void pw_large_chain_forward (const pw_large *l, const pw_chain *c, const double *f, double *y);
void pw_large_chain_up (const pw_large *l, const pw_chain *c, const double *f, double *y, double *a);

#endif
