/* Numbers of a large scene; see large.h.
 *
 *   for each column j in order:
 *     for the patches needed from here on:  K_ab += J_a W^-1 J_b^T,   y_a += J_a W^-1 f
 *     D = K_jj,  L_pj = K_pj D^-1,  K_pq -= L_pj K_qj^T  for all p >= q below j,   y_p -= L_pj y_j
 *   for each column j backwards:   y_j = D^-1 y_j - sum_p L_pj^T y_p
 *   for each patch:                a = W^-1 (f - sum_a J_a^T y_a)
 *
 * Right-looking, every place known in advance (Duff, Erisman & Reid 2017, Direct Methods for Sparse Matrices, chapters
 * 5 and 12).  D^-1 is kept explicitly: a node has at most 3 unknowns.
 *
 * The patches and columns of chains, and those of nodes of 1 or 2 rows and the 3 columns of a body, are written out; sizes are constants where these functions are
 * called, so that the tests vanish.  What else there is goes through loops, in the functions called ..._any. */
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
  y[0] += large_dot (a.first, f);
  if (size == 2) y[1] += large_dot (a.second, f);
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

/* ---- The patch of a chain ---- */

/* Two rows of a body: the unit matrix times s, then the angle's column. */
typedef struct {
  double s, x, y;
} large_arm;

static inline large_arm large_read_arm (const pw_large *l, const pw_piece *p) {
  const double *J = l->base[0] + p->J;
  return (large_arm){ J[0], J[2], J[p->step + 2] };
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
  const large_arm a = large_read_arm (l, pa), b = large_read_arm (l, pb);
  if (what & LARGE_RIGHT) {
    const double X = m * f[p->j], Y = m * f[p->j + 1], T = i * f[p->j + 2];
    double *ya = y + pa->y, *yb = y + pb->y;
    ya[0] += a.s * X + a.x * T, ya[1] += a.s * Y + a.y * T;
    yb[0] += b.s * X + b.x * T, yb[1] += b.s * Y + b.y * T;
  }
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

static void large_piece_any (const pw_large *l, const pw_patch *p, const pw_piece *a, const int *block, const double *f,
                             double *y, int what) {
  const double *A = large_J (l, a), *w = l->inverse + p->j;
  double R[PW_LDL_NODE * 3], *value = l->ldl->value;
  for (int i = 0; i < a->size; i++)
    for (int n = 0; n < p->width; n++) R[3 * i + n] = A[i * a->step + n] * w[n];
  for (int i = 0; i < a->size && (what & LARGE_RIGHT); i++)
    for (int n = 0; n < p->width; n++) y[a->y + i] += R[3 * i + n] * f[p->j + n];
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
static void large_keep (const pw_large *l, const pw_patch *p, const double *f, double *y, int what) {
  const pw_piece *own = l->piece + p[1].first - 1;
  const double *w = l->inverse + p->j;
  const int *block = l->block + p->block;
  for (int n = 0; n < 3 && (what & LARGE_RIGHT); n++) y[own->y + n] += f[p->j + n];
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

/* ---- Elimination of columns of 1 or 2 unknowns with such rows below ---- */

/* The smallest pivot relative to its diagonal entry, without dividing as long as it stays the smallest; what is not a
 * number is taken for smaller. */
static inline void large_judge (pw_large *l, double pivot, double was, int y) {
  if (pivot >= l->pivot * was) return;
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
  large_judge (l, minor, a * D[4], y + 1);
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

/* T -= L A^T: L ki x kj, A kq x kj. */
static inline void large_subtract (int kq, double *T, large_square L, const double *A, int ki, int kj) {
  T[0] -= large_dot_pair (kj, L.xx, L.xy, A);
  if (kq == 2) T[1] -= large_dot_pair (kj, L.xx, L.xy, A + kj);
  if (ki == 2) T[kq] -= large_dot_pair (kj, L.yx, L.yy, A);
  if (ki == 2 && kq == 2) T[3] -= large_dot_pair (kj, L.yx, L.yy, A + kj);
}

/* The same for a diagonal block, of which there is the lower triangle. */
static inline void large_subtract_diagonal (int ki, double *D, large_square L, const double *A, int kj) {
  D[0] -= large_dot_pair (kj, L.xx, L.xy, A);
  if (ki == 2) D[1] -= large_dot_pair (kj, L.yx, L.yy, A), D[2] -= large_dot_pair (kj, L.yx, L.yy, A + kj);
}

/* y_p -= L y_j */
static inline void large_forward (int ki, double *to, const double *L, const double *from, int kj) {
  to[0] -= large_dot_pair (kj, from[0], from[kj - 1], L);
  if (ki == 2) to[1] -= large_dot_pair (kj, from[0], from[kj - 1], L + kj);
}

/* Row p of a column c: its updates, then L in place of K.  A: its block; B: the column's first block. */
static inline void large_row (int ki, const pw_large *l, const pw_column *c, int p, double *A, const double *B,
                              large_square D, const int *target, double *y, int kj) {
  double *value = l->ldl->value;
  const pw_column *column = l->ldl->column, *row = column + l->ldl->below[p];
  large_square L = large_scale (ki, kj, A, D);
  for (int q = c->first; q < p; q++) {
    int kq = column[l->ldl->below[q]].size;
    LARGE_SHORT (kq, large_subtract, value + *target++, L, B, ki, kj);
    B += kq * kj;
  }
  large_subtract_diagonal (ki, value + row->at, L, A, kj);
  A[0] = L.xx;
  if (kj == 2) A[1] = L.xy;
  if (ki == 2) A[kj] = L.yx;
  if (ki == 2 && kj == 2) A[3] = L.yy;
  if (y) large_forward (ki, y + row->y, A, y + c->y, kj);
}

/* A column of kj unknowns; returns the next column's targets. */
static inline const int *large_column (int kj, pw_large *l, const pw_column *c, const int *target, double *y) {
  double *D = l->ldl->value + c->at, *B = D + pw_ldl_triangle (kj) + kj, *A = l->ldl->value + c[1].at;
  large_square inverse = large_invert (kj, D, l, c->y);
  for (int p = c[1].first - 1; p >= c->first; target += p-- - c->first) {
    int ki = l->ldl->column[l->ldl->below[p]].size;
    A -= ki * kj;
    LARGE_SHORT (ki, large_row, l, c, p, A, B, inverse, target, y, kj);
  }
  return target;
}

/* The column of a chain: 2 unknowns, with one row of 2 below. */
static inline void large_column_link (pw_large *l, const pw_column *c, double *y) {
  double *value = l->ldl->value, *D = value + c->at, *K = D + 5;
  const pw_column *row = l->ldl->column + l->ldl->below[c->first];
  double *T = value + row->at;
  const large_square inverse = large_invert (2, D, l, c->y), L = large_scale (2, 2, K, inverse);
  large_subtract_diagonal (2, T, L, K, 2);
  if (y) {
    const double x = y[c->y], z = y[c->y + 1];
    double *to = y + row->y;
    to[0] -= L.xx * x + L.xy * z;
    to[1] -= L.yx * x + L.yy * z;
  }
  K[0] = L.xx, K[1] = L.xy, K[2] = L.yx, K[3] = L.yy;
}

/* ---- Any column ---- */

/* Entry (i, j) of a lower triangle by rows. */
static inline double large_entry (const double *D, int i, int j) {
  return i < j ? D[j * (j + 1) / 2 + i] : D[i * (i + 1) / 2 + j];
}

static void large_invert_any (pw_large *l, const pw_column *c) {
  double *D = l->ldl->value + c->at;
  if (c->size < 3) {
    (void)LARGE_SHORT (c->size, large_invert, D, l, c->y);
    return;
  }
  double a = D[0], b = D[1], c1 = D[2], d = D[3], e = D[4], g = D[5];
  double A = c1 * g - e * e, B = d * e - b * g, C = b * e - c1 * d, minor = a * c1 - b * b;
  double determinant = a * A + b * B + d * C, f = 1 / determinant;
  if (D[6] > 0) { /* not a body: those are negative */
    large_judge (l, a, D[6], c->y);
    large_judge (l, minor, a * D[7], c->y + 1);
    large_judge (l, determinant, minor * D[8], c->y + 2);
  }
  D[0] = A * f, D[1] = B * f, D[2] = (a * g - d * d) * f, D[3] = C * f, D[4] = (b * d - a * e) * f, D[5] = minor * f;
}

/* to -= L from, L ki x kj */
static void large_forward_any (int ki, double *to, const double *L, const double *from, int kj) {
  for (int i = 0; i < ki; i++)
    for (int j = 0; j < kj; j++) to[i] -= L[i * kj + j] * from[j];
}

static const int *large_column_any (pw_large *l, const pw_column *c, const int *target, double *y) {
  const pw_column *column = l->ldl->column;
  int kj = c->size;
  double *value = l->ldl->value, *D = value + c->at, *A = value + c[1].at, L[PW_LDL_NODE * PW_LDL_NODE];
  large_invert_any (l, c);
  for (int p = c[1].first - 1; p >= c->first; p--) {
    const pw_column *row = column + l->ldl->below[p];
    const double *B = D + pw_ldl_triangle (kj) + kj;
    int ki = row->size;
    A -= ki * kj;
    for (int i = 0; i < ki; i++)
      for (int j = 0; j < kj; j++) {
        L[i * kj + j] = 0;
        for (int k = 0; k < kj; k++) L[i * kj + j] += A[i * kj + k] * large_entry (D, k, j);
      }
    for (int q = c->first; q <= p; q++) {
      int kq = column[l->ldl->below[q]].size;
      double *T = value + (q < p ? *target++ : row->at);
      for (int i = 0; i < ki; i++)
        for (int n = 0; n < (q < p ? kq : i + 1); n++, T++)
          for (int j = 0; j < kj; j++) *T -= L[i * kj + j] * B[n * kj + j];
      B += kq * kj;
    }
    memcpy (A, L, (size_t)(ki * kj) * sizeof *A);
    if (y) large_forward_any (ki, y + row->y, L, y + c->y, kj);
  }
  return target;
}

/* ---- Down ---- */

/* Assembly, elimination and, if there is a right-hand side y, that of y.  Returns 0 at a pivot that is not positive. */
static inline int large_down (pw_large *l, const double *f, double *y, int what) {
  const pw_ldl *ldl = l->ldl;
  const pw_patch *p = l->patch, *last = p + l->patches;
  const int *target = ldl->target;
  l->pivot = INFINITY;
  l->row = -1;
  for (const pw_gap *g = l->gap; g < l->gap + l->gaps; g++)
    memset (ldl->value + g->at, 0, (size_t)g->count * sizeof (double));
  for (int j = 0; j < ldl->nodes; j++) {
    const pw_column *c = &ldl->column[j];
    for (; p < last && p->column <= j; p++) large_patch (l, p, f, y, what);
    if (c->shape == PW_LINK)
      large_column_link (l, c, y);
    else if (c->shape == PW_ANY)
      target = large_column_any (l, c, target, y);
    else
      target = LARGE_SHORT (c->size, large_column, l, c, target, y);
    if (!(l->pivot > 0)) return 0;
  }
  return 1;
}

void pw_large_factor (pw_large *l) {
  large_down (l, NULL, NULL, LARGE_MATRIX);
}

/* ---- Solving ---- */

static void large_forward_column (const pw_large *l, const pw_column *c, double *y) {
  const pw_column *column = l->ldl->column;
  const double *L = l->ldl->value + c->at + pw_ldl_triangle (c->size) + c->size;
  for (int p = c->first; p < c[1].first; p++) {
    const pw_column *row = column + l->ldl->below[p];
    if (c->shape == PW_LINK)
      large_forward (2, y + row->y, L, y + c->y, 2);
    else
      large_forward_any (row->size, y + row->y, L, y + c->y, c->size);
    L += row->size * c->size;
  }
}

/* sum -= L^T x */
static inline void large_backward (int ki, double *sum, const double *L, const double *x, int kj) {
  sum[0] -= ki == 2 ? L[0] * x[0] + L[kj] * x[1] : L[0] * x[0];
  if (kj == 2) sum[1] -= ki == 2 ? L[1] * x[0] + L[3] * x[1] : L[1] * x[0];
}

static inline void large_backward_column (int kj, const pw_large *l, const pw_column *c, double *y) {
  const pw_column *column = l->ldl->column;
  const double *D = l->ldl->value + c->at, *L = D + pw_ldl_triangle (kj) + kj;
  double *to = y + c->y, sum[2] = { D[0] * to[0], 0 };
  if (kj == 2) sum[0] += D[1] * to[1], sum[1] = D[1] * to[0] + D[2] * to[1];
  if (c->shape == PW_LINK)
    large_backward (2, sum, L, y + column[l->ldl->below[c->first]].y, kj);
  else
    for (int p = c->first; p < c[1].first; p++) {
      const pw_column *row = column + l->ldl->below[p];
      LARGE_SHORT (row->size, large_backward, sum, L, y + row->y, kj);
      L += row->size * kj;
    }
  to[0] = sum[0];
  if (kj == 2) to[1] = sum[1];
}

static void large_backward_any (const pw_large *l, const pw_column *c, double *y) {
  const pw_column *column = l->ldl->column;
  int kj = c->size;
  const double *D = l->ldl->value + c->at, *L = D + pw_ldl_triangle (kj) + kj;
  double *to = y + c->y, sum[PW_LDL_NODE] = { 0 };
  for (int i = 0; i < kj; i++)
    for (int n = 0; n < kj; n++) sum[i] += large_entry (D, i, n) * to[n];
  for (int p = c->first; p < c[1].first; p++) {
    const pw_column *row = column + l->ldl->below[p];
    for (int i = 0; i < row->size; i++)
      for (int j = 0; j < kj; j++) sum[j] -= *L++ * y[row->y + i];
  }
  memcpy (to, sum, (size_t)kj * sizeof *to);
}

/* force -= J^T y */
static inline large_three large_scatter (int size, large_three force, const double *J, int step, const double *y) {
  const double *K = J + step;
  if (size == 1) return (large_three){ force.x - J[0] * y[0], force.y - J[1] * y[0], force.z - J[2] * y[0] };
  return (large_three){ force.x - (J[0] * y[0] + K[0] * y[1]), force.y - (J[1] * y[0] + K[1] * y[1]),
                        force.z - (J[2] * y[0] + K[2] * y[1]) };
}

static inline void large_accelerate_link (const pw_large *l, const pw_patch *p, const double *f, const double *y,
                                          double *a) {
  const pw_piece *pu = l->piece + p->first, *pv = pu + 1;
  const double *w = l->inverse + p->j, *yu = y + pu->y, *yv = y + pv->y;
  const large_arm u = large_read_arm (l, pu), v = large_read_arm (l, pv);
  double X = -(u.s * yu[0] + v.s * yv[0]), Y = -(u.s * yu[1] + v.s * yv[1]);
  double T = -(u.x * yu[0] + u.y * yu[1] + v.x * yv[0] + v.y * yv[1]);
  if (f) X += f[p->j], Y += f[p->j + 1], T += f[p->j + 2];
  a += p->j;
  a[0] = X * w[0], a[1] = Y * w[1], a[2] = T * w[2];
}

static inline void large_accelerate (const pw_large *l, const pw_patch *p, const double *f, const double *y,
                                     double *a) {
  const double *w = l->inverse + p->j;
  large_three force = { 0 };
  if (f) force = (large_three){ f[p->j], f[p->j + 1], f[p->j + 2] };
  for (const pw_piece *x = l->piece + p->first; x < l->piece + p[1].first; x++)
    force = LARGE_SHORT (x->size, large_scatter, force, large_J (l, x), x->step, y + x->y);
  a += p->j;
  a[0] = force.x * w[0], a[1] = force.y * w[1], a[2] = force.z * w[2];
}

static void large_accelerate_any (const pw_large *l, const pw_patch *p, const double *f, const double *y, double *a) {
  for (int n = 0; n < 3 && p->shape == PW_KEPT; n++) a[p->j + n] = -y[l->piece[p[1].first - 1].y + n];
  if (p->shape == PW_KEPT) return;
  for (int n = 0; n < p->width; n++) {
    double force = f ? f[p->j + n] : 0;
    for (const pw_piece *x = l->piece + p->first; x < l->piece + p[1].first; x++)
      for (int i = 0; i < x->size; i++) force -= large_J (l, x)[i * x->step + n] * y[x->y + i];
    a[p->j + n] = l->inverse[p->j + n] * force;
  }
}

/* The rest of the solution, then the accelerations. */
static void large_up (const pw_large *l, const double *f, double *y, double *a) {
  const pw_ldl *ldl = l->ldl;
  for (const pw_column *c = ldl->column + ldl->nodes; c-- > ldl->column;)
    if (c->shape == PW_ANY)
      large_backward_any (l, c, y);
    else
      LARGE_SHORT (c->size, large_backward_column, l, c, y);
  for (const pw_patch *p = l->patch; p < l->patch + l->patches; p++)
    if (p->shape == PW_LINK)
      large_accelerate_link (l, p, f, y, a);
    else if (p->shape != PW_SHORT)
      large_accelerate_any (l, p, f, y, a);
    else
      large_accelerate (l, p, f, y, a);
}

void pw_large_solve (const pw_large *l, const double *f, double *y, double *a) {
  const pw_ldl *ldl = l->ldl;
  if (f)
    for (const pw_patch *p = l->patch; p < l->patch + l->patches; p++) large_patch (l, p, f, y, LARGE_RIGHT);
  for (const pw_column *c = ldl->column; c < ldl->column + ldl->nodes; c++) large_forward_column (l, c, y);
  large_up (l, f, y, a);
}

void pw_large_both (pw_large *l, const double *f, double *y, double *a) {
  if (large_down (l, f, y, f ? LARGE_MATRIX | LARGE_RIGHT : LARGE_MATRIX)) large_up (l, f, y, a);
}
