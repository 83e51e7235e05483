/* Assembly, elimination, solution, order and layout of the block L D L^T; see block_ldl.h.
 *
 *   for each body:      K_ba += J_b W^-1 J_a^T  for its contributions a, and b from a on
 *   for each column j:  D = K_jj,  L_pj = K_pj D^-1,  K_pq -= L_pj K_qj^T  for all p >= q below j
 *
 * The elimination is right-looking, with all positions known in advance.  The rows p are in descending order, so that
 * the K_qj that they need have not been replaced by L_qj yet.  D is stored as its factors. */
#include <amd.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "block_ldl.h"

/* This file reads pairs of numbers shortly after storing them one by one: a vector load would stall until both stores
 * are complete. */
#ifndef __clang__
#pragma GCC optimize("no-tree-slp-vectorize")
#endif

/* Calls f with a constant in place of a size that is 1 or 2, or of a width that is 1 or 3; below, kj is the size of
 * column j, and so on. */
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

/* (x, y) divided by a diagonal block of k unknowns with the factors 1 / d_1, l_21, 1 / d_2 in D. */
static inline block_pair block_divide (int k, const double *D, double x, double y) {
  if (k == 1) return (block_pair){ .x = x * D[0] };
  double z = (y - D[1] * x) * D[2];
  return (block_pair){ x * D[0] - D[1] * z, z };
}

/* (x, y) times a row A of kj entries. */
static inline double block_dot (int kj, double x, double y, const double *A) {
  return kj == 2 ? x * A[0] + y * A[1] : x * A[0];
}

/* Chains.  Each elimination waits for the one before it.  A chain that can be eliminated from both ends (includes_last)
 * is therefore swept in the two lanes of vector registers, from the ends to the middle; in any other chain both lanes
 * do the same, from the first pin to the last. */

enum { CHAIN_BLOCK = 5 }; /* values of a diagonal block of 2 unknowns */

/* GNU C's vectors: operations work on both lanes. */
typedef double chain_lanes __attribute__ ((vector_size (2 * sizeof (double))));

/* In each lane a body of the chain, one of whose pins is eliminated. */
typedef struct {
  const double *J[2], *J_next[2]; /* J at this pin, and at the next one */
  double *factor[2];              /* of this pin's diagonal block */
  ptrdiff_t j[2], unknown[2];     /* the body's first coordinate; index in y of this pin's first unknown */
  ptrdiff_t J_stride, j_stride, unknown_stride; /* from body to body in lane 0; in lane 1 times 1 or -1, `direction` */
  ptrdiff_t row_stride;                         /* from row to row of J */
} chain_sweep;

/* J of a pin in a body's columns: the unit matrix times `sign`, then the angle's column (x, y). */
typedef struct {
  chain_lanes sign, x, y;
} chain_jacobian;

/* A body: J at the pin that is eliminated, and at the next one; the inverses of its mass and inertia. */
typedef struct {
  chain_jacobian a, b;
  chain_lanes m, i;
} chain_body;

typedef struct {
  chain_lanes x, y;
} chain_pair;

typedef struct {
  chain_lanes x, y, angle;
} chain_vector;

typedef struct {
  chain_lanes xx, xy, yx, yy;
} chain_square;

/* Entry i of two arrays, one for each lane. */
PW_INLINE chain_lanes chain_load (const double *a, const double *b, ptrdiff_t i) {
  return (chain_lanes){ a[i], b[i] };
}

PW_INLINE void chain_store (double *a, double *b, ptrdiff_t i, chain_lanes value) {
  a[i] = value[0], b[i] = value[1];
}

/* Moves both lanes on by some bodies. */
PW_INLINE void chain_move (chain_sweep *s, ptrdiff_t bodies, int direction) {
  PW_UNROLL for (int k = 0; k < 2; k++, bodies *= direction) {
    s->J[k] += bodies * s->J_stride, s->J_next[k] += bodies * s->J_stride, s->factor[k] += 3 * bodies;
    s->j[k] += bodies * s->j_stride, s->unknown[k] += bodies * s->unknown_stride;
  }
}

/* Both lanes begin at the first pin, or the second one at the last pin if the chain includes it. */
static chain_sweep chain_begin (const pw_block_ldl *l, const pw_chain *c) {
  const ptrdiff_t more = c->includes_last ? c->bodies - 1 : 0, pin = c->includes_last ? c->bodies : 0;
  const double *first = c->J_first + more * c->J_stride, *second = c->J_second + more * c->J_stride;
  double *factor = l->chain_factor + c->first_factor;
  return (chain_sweep){ .J = { c->J_first, c->includes_last ? second : first },
                        .J_next = { c->J_second, c->includes_last ? first : second },
                        .factor = { factor, factor + 3 * pin },
                        .j = { c->j, c->j + more * c->j_stride },
                        .unknown = { c->unknown, c->unknown + pin * c->unknown_stride },
                        .J_stride = c->J_stride,
                        .j_stride = c->j_stride,
                        .unknown_stride = c->unknown_stride,
                        .row_stride = c->row_stride };
}

PW_INLINE chain_jacobian chain_read_J (const chain_sweep *s, const double *const *J) {
  return (chain_jacobian){ chain_load (J[0], J[1], 0), chain_load (J[0], J[1], 2),
                           chain_load (J[0], J[1], s->row_stride + 2) };
}

PW_INLINE chain_body chain_read (const pw_block_ldl *l, const chain_sweep *s) {
  const double *first = l->inverse_weight + s->j[0], *second = l->inverse_weight + s->j[1];
  return (chain_body){ chain_read_J (s, s->J), chain_read_J (s, s->J_next), chain_load (first, second, 0),
                       chain_load (first, second, 2) };
}

/* y of the pins that are eliminated. */
PW_INLINE chain_pair chain_unknowns (const chain_sweep *s, const double *y) {
  const double *first = y + s->unknown[0], *second = y + s->unknown[1];
  return (chain_pair){ chain_load (first, second, 0), chain_load (first, second, 1) };
}

PW_INLINE void chain_store_unknowns (const chain_sweep *s, double *y, chain_pair value) {
  double *first = y + s->unknown[0], *second = y + s->unknown[1];
  chain_store (first, second, 0, value.x);
  chain_store (first, second, 1, value.y);
}

PW_INLINE chain_vector chain_forces (const chain_sweep *s, const double *f) {
  const double *first = f + s->j[0], *second = f + s->j[1];
  return (chain_vector){ chain_load (first, second, 0), chain_load (first, second, 1), chain_load (first, second, 2) };
}

/* K of block_ldl.h: rows of the next pin, columns of the one that is eliminated. */
PW_INLINE chain_square chain_coupling (chain_body p) {
  const chain_lanes mass = p.m * p.a.sign * p.b.sign, x = p.i * p.b.x, y = p.i * p.b.y;
  return (chain_square){ mass + x * p.a.x, x * p.a.y, y * p.a.x, mass + y * p.a.y };
}

/* (x, y) divided by a block with the factors d, e, f, as in block_divide. */
PW_INLINE chain_pair chain_divide (chain_lanes d, chain_lanes e, chain_lanes f, chain_lanes x, chain_lanes y) {
  const chain_lanes z = (y - e * x) * f;
  return (chain_pair){ x * d - e * z, z };
}

/* The same by the stored factors of the pins that are eliminated. */
PW_INLINE chain_pair chain_divide_stored (const chain_sweep *s, chain_lanes x, chain_lanes y) {
  const double *a = s->factor[0], *b = s->factor[1];
  return chain_divide (chain_load (a, b, 0), chain_load (a, b, 1), chain_load (a, b, 2), x, y);
}

/* Factorises the diagonal block of each lane as block_pivot does.  D: as in pw_block_column: xx, yx, yy, then xx and yy
 * before elimination.  The smallest pivot rarely changes, so one test of both lanes comes first. */
PW_INLINE void chain_pivot (chain_lanes *D, pw_block_ldl *l, const chain_sweep *s) {
  const chain_lanes a = D[0], minor = a * D[2] - D[1] * D[1], least = { l->least_pivot, l->least_pivot };
  const chain_lanes bound = least * D[3], minor_bound = least * a * D[4];
  const int larger = a[0] > bound[0] && a[1] > bound[1] && minor[0] > minor_bound[0] && minor[1] > minor_bound[1];
  for (int k = 0; k < 2 && !larger; k++) {
    block_track_pivot (l, a[k], D[3][k], (int)s->unknown[k]);
    block_track_pivot (l, minor[k], fabs (a[k]) * D[4][k], (int)s->unknown[k] + 1);
  }
  D[0] = 1 / a;
  D[1] = D[1] * D[0], D[2] = a / minor;
}

/* Eliminates the pins.  D: their diagonal blocks without the contributions of the bodies of s, which are added; then
 * those of the next pins, without the contributions of the next bodies. */
PW_INLINE void chain_eliminate (pw_block_ldl *l, chain_sweep *s, int direction, chain_lanes *D) {
  const chain_body p = chain_read (l, s);
  const chain_square K = chain_coupling (p);
  const chain_lanes ax = p.i * p.a.x, ay = p.i * p.a.y, xx = p.m + ax * p.a.x, yy = p.m + ay * p.a.y;
  D[0] += xx, D[1] += ax * p.a.y, D[2] += yy, D[3] += xx, D[4] += yy;
  chain_pivot (D, l, s);
  for (int n = 0; n < 3; n++) chain_store (s->factor[0], s->factor[1], n, D[n]);
  /* The rows of L = K D^-1. */
  const chain_pair x = chain_divide (D[0], D[1], D[2], K.xx, K.xy), y = chain_divide (D[0], D[1], D[2], K.yx, K.yy);
  const chain_lanes bx = p.i * p.b.x, by = p.i * p.b.y;
  D[3] = p.m + bx * p.b.x, D[4] = p.m + by * p.b.y;
  D[0] = D[3] - (x.x * K.xx + x.y * K.xy);
  D[1] = bx * p.b.y - (y.x * K.xx + y.y * K.xy);
  D[2] = D[4] - (y.x * K.yx + y.y * K.yy);
  chain_move (s, 1, direction);
}

/* The second lane joins the first one. */
static inline void chain_meet (chain_sweep *s) {
  s->J[1] = s->J[0], s->J_next[1] = s->J_next[0], s->factor[1] = s->factor[0];
  s->j[1] = s->j[0], s->unknown[1] = s->unknown[0];
}

/* Without includes_last, eliminates all pins but the last, one by one.  With includes_last, eliminates pairs of pins
 * from both ends, then the pin before the middle body if the number of bodies is odd, and finally the remaining middle
 * pin. */
static void chain_factor (pw_block_ldl *l, const pw_chain *c) {
  const int pairs = c->includes_last ? c->bodies / 2 : 0, singles = c->bodies - 2 * pairs;
  const double *first = l->value + l->column[c->first_column].first_value;
  double *last = l->value + l->column[c->first_column + c->bodies].first_value;
  chain_sweep s = chain_begin (l, c);
  chain_lanes D[CHAIN_BLOCK];
  double other[CHAIN_BLOCK]; /* the second lane's contribution to the middle pin */
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] = (chain_lanes){ first[n], c->includes_last ? last[n] : first[n] };
  for (int n = pairs; n > 0 && l->least_pivot > 0; n--) chain_eliminate (l, &s, -1, D);
  for (int n = 0; n < CHAIN_BLOCK && c->includes_last; n++) other[n] = D[n][1], D[n][1] = D[n][0];
  chain_meet (&s);
  for (int n = singles; n > 0 && l->least_pivot > 0; n--) chain_eliminate (l, &s, 1, D);
  if (!(l->least_pivot > 0)) return;
  if (!c->includes_last) {
    for (int n = 0; n < CHAIN_BLOCK; n++) last[n] += D[n][0];
    return;
  }
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] += other[n];
  chain_pivot (D, l, &s);
  for (int n = 0; n < 3; n++) s.factor[0][n] = D[n][0];
}

/* Subtracts J W^-1 f from y of both pins of the body, then K D^-1 y_c from y_(c+1).  at: y of the pins that are
 * eliminated.  Returns y of the next ones. */
PW_INLINE chain_pair chain_forward_body (const pw_block_ldl *l, chain_sweep *s, int direction, const double *f,
                                         double *y, chain_pair at) {
  const chain_body p = chain_read (l, s);
  const chain_lanes mass = p.m * p.a.sign * p.b.sign;
  const double *first = y + s->unknown[0] + s->unknown_stride,
               *second = y + s->unknown[1] + direction * s->unknown_stride;
  chain_pair next = { chain_load (first, second, 0), chain_load (first, second, 1) };
  if (f) {
    const chain_vector force = chain_forces (s, f);
    const chain_lanes ax = p.m * force.x, ay = p.m * force.y, angular = p.i * force.angle;
    at.x -= p.a.sign * ax + p.a.x * angular, at.y -= p.a.sign * ay + p.a.y * angular;
    next.x -= p.b.sign * ax + p.b.x * angular, next.y -= p.b.sign * ay + p.b.y * angular;
  }
  chain_store_unknowns (s, y, at);
  const chain_pair z = chain_divide_stored (s, at.x, at.y);
  const chain_lanes turn = p.i * (p.a.x * z.x + p.a.y * z.y);
  next.x -= mass * z.x + turn * p.b.x;
  next.y -= mass * z.y + turn * p.b.y;
  chain_move (s, 1, direction);
  return next;
}

/* A chain's part of pw_block_solve, forwards. */
PW_SELDOM void chain_forward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y) {
  const int pairs = c->includes_last ? c->bodies / 2 : 0, singles = c->bodies - 2 * pairs;
  chain_sweep s = chain_begin (l, c);
  chain_pair at = chain_unknowns (&s, y);
  double change_x = 0, change_y = 0; /* by the second lane to the middle pin */
  if (c->includes_last) {
    for (int n = pairs; n > 0; n--) at = chain_forward_body (l, &s, -1, f, y, at);
    change_x = at.x[1] - y[s.unknown[1]], change_y = at.y[1] - y[s.unknown[1] + 1];
    chain_meet (&s);
    at.x[1] = at.x[0], at.y[1] = at.y[0];
  }
  for (int n = singles; n > 0; n--) at = chain_forward_body (l, &s, 1, f, y, at);
  y[s.unknown[0]] = at.x[0] + change_x;
  y[s.unknown[0] + 1] = at.y[0] + change_y;
}

/* Goes back to the pins before; returns their lambda, from that of the next ones, `next`, and stores it in y; also
 * stores the accelerations a of the bodies between them. */
PW_INLINE chain_pair chain_backward_body (const pw_block_ldl *l, chain_sweep *s, int direction, const double *f,
                                          double *y, double *a, chain_pair next) {
  chain_move (s, -1, direction);
  const chain_body p = chain_read (l, s);
  const chain_square K = chain_coupling (p);
  const chain_pair own = chain_unknowns (s, y);
  const chain_pair z =
      chain_divide_stored (s, own.x + (K.xx * next.x + K.yx * next.y), own.y + (K.xy * next.x + K.yy * next.y));
  const chain_pair at = { -z.x, -z.y };
  chain_store_unknowns (s, y, at);
  /* f - J^T lambda */
  chain_vector net = { -(p.b.sign * next.x + p.a.sign * at.x), -(p.b.sign * next.y + p.a.sign * at.y),
                       -(p.b.x * next.x + p.b.y * next.y + (p.a.x * at.x + p.a.y * at.y)) };
  if (f) {
    const chain_vector force = chain_forces (s, f);
    net.x += force.x, net.y += force.y, net.angle += force.angle;
  }
  double *first = a + s->j[0], *second = a + s->j[1];
  chain_store (first, second, 0, p.m * net.x);
  chain_store (first, second, 1, p.m * net.y);
  chain_store (first, second, 2, p.i * net.angle);
  return at;
}

/* The same backwards, with the accelerations of the chain's bodies. */
PW_SELDOM void chain_backward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y, double *a) {
  const int pairs = c->includes_last ? c->bodies / 2 : 0, singles = c->bodies - 2 * pairs;
  chain_sweep ends = chain_begin (l, c);
  chain_move (&ends, pairs, -1);
  chain_sweep middle = ends; /* where chain_forward ended */
  chain_meet (&middle);
  chain_move (&middle, singles, 1);
  chain_pair at = chain_unknowns (&middle, y);
  if (c->includes_last) {
    const chain_pair z = chain_divide_stored (&middle, at.x, at.y);
    at = (chain_pair){ -z.x, -z.y };
    y[middle.unknown[0]] = at.x[0], y[middle.unknown[0] + 1] = at.y[0];
  }
  const chain_pair lambda = at;
  for (int n = singles; n > 0; n--) at = chain_backward_body (l, &middle, 1, f, y, a, at);
  at.x[1] = lambda.x[1], at.y[1] = lambda.y[1];
  for (int n = pairs; n > 0; n--) at = chain_backward_body (l, &ends, -1, f, y, a, at);
}

/* K += B R^T, kb x ka, with B = J_b, whose rows are `stride` apart, and R = J_a W^-1. */
PW_INLINE void block_couple (int kb, int ka, int width, double *K, const block_row *R, const double *B, int stride) {
  K[0] += block_product (width, R[0], B);
  if (ka == 2) K[1] += block_product (width, R[1], B);
  if (kb == 2) K[ka] += block_product (width, R[0], B + stride);
  if (ka == 2 && kb == 2) K[3] += block_product (width, R[1], B + stride);
}

/* Adds the products of a contribution of ka rows with itself and with those after it; coupling: indices in `value` of
 * the latter. */
PW_INLINE void block_contribute (int ka, int width, const pw_block_ldl *l, const pw_group_block *p,
                                 const pw_contribution *a, const int *coupling) {
  const double *A = a->J, *w = l->inverse_weight + p->j;
  double *D = l->value + a->diagonal;
  block_row R[2] = { block_weigh (width, A, w) };
  if (ka == 2) R[1] = block_weigh (width, A + a->row_stride, w);
  D[0] += block_product (width, R[0], A);
  if (ka == 2) D[1] += block_product (width, R[1], A), D[2] += block_product (width, R[1], A + a->row_stride);
  D[ka == 2 ? 3 : 1] = D[0];
  if (ka == 2) D[4] = D[2];
  for (const pw_contribution *b = a + 1; b < l->contribution + p[1].first_contribution; b++)
    BLOCK_SIZE (b->size, block_couple, ka, width, l->value + *coupling++, R, b->J, b->row_stride);
}

/* The pivot of an acceleration in -W_k; -1 of one that is 0 or massless, whose column of J is left out. */
static inline double block_inertia (double inverse_weight) {
  return inverse_weight > 0 ? -1 / inverse_weight : -1;
}

/* Adds an uncondensed body: -W_k, and its columns of J.  The original diagonal entries of the equations eliminated
 * after the body grow as if it were condensed. */
static void block_uncondensed (const pw_block_ldl *l, const pw_group_block *p) {
  const pw_contribution *own = l->contribution + p[1].first_contribution - 2;
  const double *w = l->inverse_weight + p->j;
  const int *coupling = l->coupling + p->first_coupling;
  double *D = l->value + own[0].diagonal, *inertia = l->value + own[1].diagonal;
  D[0] = D[3] = block_inertia (w[0]), D[2] = D[4] = block_inertia (w[1]),
  inertia[0] = inertia[1] = block_inertia (w[2]);
  for (const pw_contribution *a = l->contribution + p->first_contribution; a < own; a++)
    for (int n = 0; n < 3; n += 2) { /* its first node has the columns 0 and 1, its second one column 2 */
      double *K = l->value + *coupling++, *original = l->value + a->diagonal + a->size * (a->size + 1) / 2;
      int later = a->diagonal > own->diagonal, size = n == 0 ? 2 : 1;
      for (int i = 0; i < a->size; i++)
        for (int c = 0; c < size; c++) {
          double J = w[n + c] > 0 ? a->J[i * a->row_stride + n + c] : 0;
          K[later ? i * size + c : c * a->size + i] = J;
          if (later) original[i] += J * w[n + c] * J;
        }
    }
}

static void block_assemble (const pw_block_ldl *l) {
  memset (l->value, 0, (size_t)l->values * sizeof *l->value);
  for (const pw_group_block *p = l->group, *last = p + l->groups; p < last; p++) {
    const int *coupling = l->coupling + p->first_coupling;
    const pw_contribution *a = l->contribution + p->first_contribution,
                          *end = l->contribution + p[1].first_contribution;
    if (p->uncondensed)
      block_uncondensed (l, p);
    else if (p->width == 3)
      for (; a < end; coupling += end - ++a) BLOCK_SIZE (a->size, block_contribute, 3, l, p, a, coupling);
    else
      for (; a < end; coupling += end - ++a) BLOCK_SIZE (a->size, block_contribute, 1, l, p, a, coupling);
  }
}

typedef struct {
  double xx, xy, yx, yy;
} block_square;

/* Replaces the lower triangle of a diagonal block of k unknowns by its factors L D L^T: 1 / d_1, l_21, 1 / d_2. */
static inline void block_pivot (int k, double *D, pw_block_ldl *l, int unknown) {
  double a = D[0], b = D[1], minor = k == 2 ? a * D[2] - b * b : 0;
  block_track_pivot (l, a, D[k == 2 ? 3 : 1], unknown);
  D[0] = 1 / a;
  if (k == 1) return;
  block_track_pivot (l, minor, fabs (a) * D[4], unknown + 1);
  D[1] = b * D[0], D[2] = a / minor;
}

/* L = A D^-1: A ki x kj. */
static inline block_square block_scale (int ki, int kj, const double *A, const double *D) {
  block_pair x = block_divide (kj, D, A[0], kj == 2 ? A[1] : 0), y = { 0 };
  if (ki == 2) y = block_divide (kj, D, A[kj], kj == 2 ? A[3] : 0);
  return (block_square){ x.x, x.y, y.x, y.y };
}

/* D -= L A^T for the lower triangle of a diagonal block: L ki x kj, A ki x kj. */
static inline void block_subtract_diagonal (int ki, double *D, block_square L, const double *A, int kj) {
  D[0] -= block_dot (kj, L.xx, L.xy, A);
  if (ki == 2) D[1] -= block_dot (kj, L.yx, L.yy, A), D[2] -= block_dot (kj, L.yx, L.yy, A + kj);
}

/* T -= L A^T: L ki x kj, A kq x kj. */
static inline void block_subtract (int kq, double *T, block_square L, const double *A, int ki, int kj) {
  T[0] -= block_dot (kj, L.xx, L.xy, A);
  if (kq == 2) T[1] -= block_dot (kj, L.xx, L.xy, A + kj);
  if (ki == 2) T[kq] -= block_dot (kj, L.yx, L.yy, A);
  if (ki == 2 && kq == 2) T[3] -= block_dot (kj, L.yx, L.yy, A + kj);
}

/* Eliminates row p of a column j: subtracts L_pj K_qj^T from the blocks K_pq, then replaces K_pj by L_pj.  A: K_pj; B:
 * the column's first block below the diagonal; target: indices in `value` of K_pq. */
PW_INLINE void block_eliminate_row (int ki, const pw_block_ldl *l, const pw_block_column *c, int p, double *A,
                                    const double *B, const double *D, const int *target, int kj) {
  const pw_block_column *column = l->column;
  block_square L = block_scale (ki, kj, A, D);
  for (int q = c->first_below; q < p; q++) {
    int kq = column[l->below[q]].size;
    BLOCK_SIZE (kq, block_subtract, l->value + *target++, L, B, ki, kj);
    B += kq * kj;
  }
  block_subtract_diagonal (ki, l->value + column[l->below[p]].first_value, L, A, kj);
  A[0] = L.xx;
  if (kj == 2) A[1] = L.xy;
  if (ki == 2) A[kj] = L.yx;
  if (ki == 2 && kj == 2) A[3] = L.yy;
}

/* Finds the targets of row p of a long column; to be called for its rows in descending order. */
static const int *block_find_targets (const pw_block_ldl *l, const pw_block_column *c, int p) {
  int *at = l->cursor, *row = at + (c[1].first_below - c->first_below);
  for (int q = c->first_below; q < p; q++, at++, row++) {
    const pw_block_column *d = &l->column[l->below[q]];
    if (p + 1 == c[1].first_below) *at = d[1].first_value, *row = d[1].first_below;
    do *at -= d->size * l->column[l->below[--*row]].size;
    while (l->below[*row] != l->below[p]);
  }
  return l->cursor;
}

/* Eliminates a column of kj unknowns; returns the next column's targets. */
PW_INLINE const int *block_eliminate (int kj, pw_block_ldl *l, const pw_block_column *c, const int *target) {
  double *D = l->value + c->first_value, *B = D + pw_block_diagonal_values (kj), *A = l->value + c[1].first_value;
  const int is_long = c[1].first_below - c->first_below > PW_BLOCK_LISTED;
  block_pivot (kj, D, l, c->unknown);
  for (int p = c[1].first_below - 1; p >= c->first_below; p--) {
    int ki = l->column[l->below[p]].size;
    A -= ki * kj;
    BLOCK_SIZE (ki, block_eliminate_row, l, c, p, A, B, D, is_long ? block_find_targets (l, c, p) : target, kj);
    if (!is_long) target += p - c->first_below;
  }
  return target;
}

void pw_block_factor (pw_block_ldl *l) {
  const pw_chain *chain = l->chain;
  const int *target = l->target;
  l->least_pivot = INFINITY;
  l->least_unknown = -1;
  block_assemble (l);
  for (int j = 0; j < l->nodes && l->least_pivot > 0;)
    if (chain->first_column == j) {
      chain_factor (l, chain);
      j += chain->bodies + chain->includes_last;
      chain++;
    } else {
      const pw_block_column *c = &l->column[j++];
      target = BLOCK_SIZE (c->size, block_eliminate, l, c, target);
    }
}

/* Solution.  Of an uncondensed body k, y_k begins as -f_k and becomes -a_k.
 *
 *   for each body:                y_p -= J_p W^-1 f
 *   for each column j:            y_p -= L_pj y_j
 *   for each column j backwards:  y_j = -D^-1 y_j - sum_p L_pj^T y_p
 *   for each body:                a = W^-1 (f - sum_p J_p^T y_p) */

/* y -= J z */
PW_INLINE void block_gather (int size, int width, double *y, const double *J, int row_stride, block_row z) {
  y[0] -= block_product (width, z, J);
  if (size == 2) y[1] -= block_product (width, z, J + row_stride);
}

/* z - J^T y */
PW_INLINE block_row block_scatter (int size, int width, const double *y, const double *J, int row_stride, block_row z) {
  const double *second = J + row_stride;
  z.x -= size == 2 ? J[0] * y[0] + second[0] * y[1] : J[0] * y[0];
  if (width == 3) z.y -= size == 2 ? J[1] * y[0] + second[1] * y[1] : J[1] * y[0];
  if (width == 3) z.angle -= size == 2 ? J[2] * y[0] + second[2] * y[1] : J[2] * y[0];
  return z;
}

/* y -= J W^-1 f for a body. */
PW_INLINE void block_right_of (int width, const pw_block_ldl *l, const pw_group_block *p, const double *f, double *y) {
  const block_row z = block_weigh (width, f + p->j, l->inverse_weight + p->j);
  for (const pw_contribution *a = l->contribution + p->first_contribution;
       a < l->contribution + p[1].first_contribution; a++)
    BLOCK_SIZE (a->size, block_gather, width, y + a->unknown, a->J, a->row_stride, z);
}

/* a = W^-1 (f - J^T y) for a body. */
PW_INLINE void block_accelerate (int width, const pw_block_ldl *l, const pw_group_block *p, const double *f,
                                 const double *y, double *a) {
  const double *w = l->inverse_weight + p->j;
  block_row z = { 0 };
  if (f) z = width == 3 ? (block_row){ f[p->j], f[p->j + 1], f[p->j + 2] } : (block_row){ .x = f[p->j] };
  for (const pw_contribution *x = l->contribution + p->first_contribution;
       x < l->contribution + p[1].first_contribution; x++)
    z = BLOCK_SIZE (x->size, block_scatter, width, y + x->unknown, x->J, x->row_stride, z);
  a[p->j] = w[0] * z.x;
  if (width == 3) a[p->j + 1] = w[1] * z.y, a[p->j + 2] = w[2] * z.angle;
}

/* to -= L from, L: ki x kj, its rows kj apart */
PW_INLINE void block_forward (int ki, double *to, const double *L, const double *from, int kj) {
  to[0] -= block_dot (kj, from[0], from[kj - 1], L);
  if (ki == 2) to[1] -= block_dot (kj, from[0], from[kj - 1], L + kj);
}

PW_INLINE void block_forward_column (int kj, const pw_block_ldl *l, const pw_block_column *c, double *y) {
  const double *L = l->value + c->first_value + pw_block_diagonal_values (kj);
  for (int p = c->first_below; p < c[1].first_below; p++) {
    const pw_block_column *row = l->column + l->below[p];
    BLOCK_SIZE (row->size, block_forward, y + row->unknown, L, y + c->unknown, kj);
    L += row->size * kj;
  }
}

/* sum -= L^T x */
PW_INLINE void block_backward (int ki, double *sum, const double *L, const double *x, int kj) {
  sum[0] -= ki == 2 ? L[0] * x[0] + L[kj] * x[1] : L[0] * x[0];
  if (kj == 2) sum[1] -= ki == 2 ? L[1] * x[0] + L[3] * x[1] : L[1] * x[0];
}

PW_INLINE void block_backward_column (int kj, const pw_block_ldl *l, const pw_block_column *c, double *y) {
  const double *D = l->value + c->first_value, *L = D + pw_block_diagonal_values (kj);
  double *to = y + c->unknown;
  block_pair own = block_divide (kj, D, to[0], kj == 2 ? to[1] : 0);
  double sum[2] = { -own.x, -own.y };
  for (int p = c->first_below; p < c[1].first_below; p++) {
    const pw_block_column *row = l->column + l->below[p];
    BLOCK_SIZE (row->size, block_backward, sum, L, y + row->unknown, kj);
    L += row->size * kj;
  }
  to[0] = sum[0];
  if (kj == 2) to[1] = sum[1];
}

void pw_block_solve (const pw_block_ldl *l, const double *f, double *y, double *a) {
  const pw_chain *chain = l->chain;
  const pw_block_column *c = l->column;
  const pw_group_block *p, *last = l->group + l->groups;
  for (p = l->group; f && p < last; p++)
    if (p->uncondensed)
      for (int n = 0; n < 3; n++)
        y[l->contribution[p[1].first_contribution - 2].unknown + n] -=
            l->inverse_weight[p->j + n] > 0 ? f[p->j + n] : 0;
    else
      BLOCK_WIDTH (p->width, block_right_of, l, p, f, y);
  for (int j = 0; j < l->nodes;)
    if (chain->first_column == j) {
      chain_forward (l, chain, f, y);
      j += chain->bodies + chain->includes_last;
      chain++;
    } else {
      BLOCK_SIZE (c[j].size, block_forward_column, l, c + j, y);
      j++;
    }
  for (int j = l->nodes; j > 0;)
    if (chain > l->chain && chain[-1].first_column + chain[-1].bodies + chain[-1].includes_last == j) {
      chain_backward (l, --chain, f, y, a);
      j = chain->first_column;
    } else {
      j--;
      BLOCK_SIZE (c[j].size, block_backward_column, l, c + j, y);
    }
  for (p = l->group; p < last; p++)
    if (p->uncondensed)
      for (int n = 0; n < 3; n++) a[p->j + n] = -y[l->contribution[p[1].first_contribution - 2].unknown + n];
    else
      BLOCK_WIDTH (p->width, block_accelerate, l, p, f, y, a);
}

typedef struct {
  int nodes;
  const pw_plan_node *node;
  long pairs;
  const int *pair;
  int *first, *list;   /* neighbours of node n, with repetition: list[first[n]] to list[first[n + 1] - 1] */
  int *order, *column; /* node of each column; column of each node */
  int *first_below;    /* as in pw_block_column */
  int *parent;         /* of each column in the elimination tree, or -1 */
  int *visited;        /* the last row whose paths in this tree have visited the column */
  int *next;           /* of each node or column: its number of entries, then where the next one is listed */
  char *memory;
} order_search;

/* Gives each list as many entries as x->next has counted: first[c] and x->next[c] become its beginning. */
static void order_begin_lists (order_search *x, int *first) {
  first[0] = 0;
  for (int c = 0; c < x->nodes; c++) {
    first[c + 1] = first[c] + x->next[c];
    x->next[c] = first[c];
  }
}

/* Lists the neighbours of each node in the graph of the nodes of at most this rank. */
static void order_list_neighbours (order_search *x, int rank) {
  memset (x->next, 0, (size_t)x->nodes * sizeof *x->next);
  for (int listing = 0; listing < 2; listing++) { /* counts, then lists */
    for (long i = 0; i < 2 * x->pairs; i++) {
      int c = x->pair[i], r = x->pair[i ^ 1];
      if (c == r || x->node[c].rank > rank || x->node[r].rank > rank) continue;
      if (listing) x->list[x->next[c]] = r;
      x->next[c]++;
    }
    if (!listing) order_begin_lists (x, x->first);
  }
}

/* Passes through the rows of L.  Row i has entries in the columns on the paths to i in the elimination tree that begin
 * at the columns in which row i of the matrix has entries (Davis 2005, Algorithm 849: LDL).  Counts them in
 * x->next of each column or, if `below` is not NULL, lists them there.  PW_RETRY if there are more than `most`. */
static int order_pass (const order_search *x, int most, int *below) {
  long count = 0;
  for (int i = 0; i < x->nodes; i++) x->visited[i] = x->parent[i] = -1;
  for (int i = 0; i < x->nodes && count <= most; i++) {
    int node = x->order[i];
    x->visited[i] = i;
    for (int k = x->first[node]; k < x->first[node + 1]; k++)
      for (int j = x->column[x->list[k]]; j < i && x->visited[j] != i; j = x->parent[j]) {
        if (x->parent[j] < 0) x->parent[j] = i;
        x->visited[j] = i;
        count++;
        if (below) below[x->next[j]] = i;
        x->next[j]++;
      }
  }
  return count <= most ? PW_OK : PW_RETRY;
}

/* Appends the body of link, after that of last, if it continues the chain at the same strides; returns whether it
 * does. */
static int chain_add (pw_chain *chain, const pw_chain *last, const pw_chain *link) {
  int J_stride = (int)(link->J_first - last->J_first), j_stride = link->j - last->j;
  if (link->J_second - last->J_second != J_stride || link->unknown_stride != chain->unknown_stride) return 0;
  if (chain->bodies > 1 && (J_stride != chain->J_stride || j_stride != chain->j_stride)) return 0;
  chain->J_stride = J_stride;
  chain->j_stride = j_stride;
  chain->bodies++;
  return 1;
}

int pw_block_join_chains (pw_block_ldl *l, pw_chain_between *between, pw_chain *chain, unsigned char *is_linked) {
  int chains = 0, factors = 0;
  /* fill-in: by columns eliminated earlier that have both a column and the next one below them */
  for (int p = 0; p < l->nodes; p++)
    for (int i = l->column[p].first_below + 1; i < l->column[p + 1].first_below; i++)
      if (l->below[i] == l->below[i - 1] + 1) between[l->below[i - 1]].sources++;
  for (int p = 0; p < l->nodes;) {
    const pw_chain_between *b = &between[p++];
    if (b->sources != 1 || b->link.bodies == 0) continue;
    pw_chain *to = &chain[chains++];
    *to = b->link;
    to->first_factor = factors;
    is_linked[b->link.j / 3] = 1;
    for (; p < l->nodes && between[p].sources == 1 && between[p].contributions == 2; p++) {
      if (between[p].link.bodies == 0) break;
      if (!chain_add (to, &between[p - 1].link, &between[p].link)) break;
      is_linked[between[p].link.j / 3] = 1;
      l->column[p].in_chain = 1;
    }
    const pw_block_column *last = &l->column[to->first_column + to->bodies];
    to->includes_last = to->bodies > 1 && last[1].first_below == last->first_below;
    factors += 3 * (to->bodies + 1);
  }
  return chains;
}

void pw_block_close (pw_block_ldl *l) {
  if (l == NULL) return;
  free (l->numbers);
  free (l->pattern);
  free (l->memory);
  free (l);
}

/* A matrix with the columns x->order, the rows below their diagonals not yet listed; NULL if out of memory. */
static pw_block_ldl *order_allocate (const order_search *x) {
  size_t n = (size_t)x->nodes;
  pw_block_ldl *l = calloc (1, sizeof *l);
  if (l)
    l->pattern = PW_ALLOC_ARRAYS (PW_ARRAY (l->column, n + 1), PW_ARRAY (l->below, x->first_below[n]),
                                  PW_ARRAY (l->column_of_node, n));
  if (l == NULL || l->pattern == NULL) return free (l), NULL;
  l->nodes = x->nodes;
  memcpy (l->column_of_node, x->column, n * sizeof *l->column_of_node);
  for (int j = 0; j <= l->nodes; j++) l->column[j].first_below = x->first_below[j];
  for (int j = 0; j < l->nodes; j++) {
    const pw_plan_node *node = &x->node[x->order[j]];
    l->column[j].unknown = node->unknown, l->column[j].size = (unsigned char)node->size;
  }
  return l;
}

/* Sorts x->order by rank and determines the pattern of L, fill-in included.  *status: PW_OK, PW_RESOURCE, or PW_RETRY
 * if there are more than `most` blocks below the diagonal. */
static pw_block_ldl *order_fill (order_search *x, int most, int *status) {
  int at = 0;
  for (int rank = 0; rank < PW_BLOCK_RANKS; rank++)
    for (int j = 0; j < x->nodes; j++)
      if (x->node[x->order[j]].rank == rank) x->column[x->order[j]] = at++;
  for (int n = 0; n < x->nodes; n++) x->order[x->column[n]] = n;
  memset (x->next, 0, (size_t)x->nodes * sizeof *x->next);
  *status = order_pass (x, most, NULL);
  if (*status != PW_OK) return NULL;
  order_begin_lists (x, x->first_below);
  pw_block_ldl *l = order_allocate (x);
  *status = l ? order_pass (x, most, l->below) : PW_RESOURCE;
  return l;
}

/* In the natural order or, if that has less fill-in, minimum degree in rank 0; NULL if out of memory or L is too
 * large. */
static pw_block_ldl *order_choose (order_search *x) {
  const int n = x->nodes + 1;
  x->memory = PW_ALLOC_ARRAYS (PW_ARRAY (x->list, 2 * x->pairs), PW_ARRAY (x->first, n), PW_ARRAY (x->order, n),
                               PW_ARRAY (x->column, n), PW_ARRAY (x->first_below, n), PW_ARRAY (x->parent, n),
                               PW_ARRAY (x->visited, n), PW_ARRAY (x->next, n));
  int status;
  if (x->memory == NULL) return NULL;
  order_list_neighbours (x, 0);
  if (x->nodes > 0 && amd_order (x->nodes, x->first, x->list, x->order, NULL, NULL) < 0) return NULL;
  order_list_neighbours (x, PW_BLOCK_RANKS - 1);
  pw_block_ldl *minimum_degree = order_fill (x, INT_MAX / 2, &status);
  if (minimum_degree == NULL) return NULL;
  for (int i = 0; i < x->nodes; i++) x->order[i] = i;
  pw_block_ldl *natural = order_fill (x, minimum_degree->column[x->nodes].first_below, &status);
  if (status == PW_RETRY) return minimum_degree;
  pw_block_close (minimum_degree);
  return natural;
}

int pw_block_find (const pw_block_ldl *l, int a, int b) {
  const int row = l->column_of_node[a], column = l->column_of_node[b];
  if (row < column) return pw_block_find (l, b, a);
  const pw_block_column *c = &l->column[column];
  int at = c->first_value + pw_block_diagonal_values (c->size);
  for (int i = c->first_below; l->below[i] != row; i++) at += c->size * l->column[l->below[i]].size;
  return at;
}

/* For each column, for its q-th row below: walks once down the column of that row, where the targets of the rows p > q
 * are in ascending order. */
static void order_place_targets (pw_block_ldl *l) {
  int *target = l->target;
  for (const pw_block_column *c = l->column; c < l->column + l->nodes; c++) {
    int n = c[1].first_below - c->first_below;
    const int *below = l->below + c->first_below;
    if (n > PW_BLOCK_LISTED) continue;
    for (int q = 0; q < n; q++) {
      const pw_block_column *d = &l->column[below[q]];
      int at = d->first_value + pw_block_diagonal_values (d->size), i = d->first_below;
      for (int p = q + 1; p < n; p++, i++) {
        for (; l->below[i] != below[p]; i++) at += d->size * l->column[l->below[i]].size;
        /* rows p descending, each with p entries: those of rows n - 1 .. p + 1 come first */
        target[(n - 1 - p) * (n + p) / 2 + q] = at;
        at += d->size * l->column[below[p]].size;
      }
    }
    target += n * (n - 1) / 2;
  }
}

int pw_block_lay_out (pw_block_ldl *l) {
  size_t at = 0, targets = 0, longest = 0;
  for (pw_block_column *c = l->column; c < l->column + l->nodes; c++) {
    size_t rows = (size_t)(c[1].first_below - c->first_below);
    c->first_value = (int)at;
    if (!c->in_chain) at += (size_t)pw_block_diagonal_values (c->size);
    for (int i = c->first_below; i < c[1].first_below && !c->in_chain; i++)
      at += (size_t)(c->size * l->column[l->below[i]].size);
    if (at > INT_MAX) return PW_RESOURCE;
    if (rows <= PW_BLOCK_LISTED)
      targets += rows * (rows - 1) / 2; /* one for each pair of rows of the column */
    else if (rows > longest)
      longest = rows;
  }
  l->column[l->nodes].first_value = l->values = (int)at;
  l->numbers = PW_ALLOC_ARRAYS (PW_ARRAY (l->value, l->values), PW_ARRAY (l->target, targets),
                                PW_ARRAY (l->cursor, 2 * longest));
  if (l->numbers == NULL) return PW_RESOURCE;
  order_place_targets (l);
  return PW_OK;
}

pw_block_ldl *pw_block_open (int nodes, const pw_plan_node *node, long pairs, const int *pair) {
  order_search x = { .nodes = nodes, .node = node, .pairs = pairs, .pair = pair };
  pw_block_ldl *l = order_choose (&x);
  free (x.memory);
  return l;
}
