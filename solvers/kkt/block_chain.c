/* Chains; see block_ldl.h.  Each elimination waits for the one before it.  A chain from whose both ends it can proceed
 * is therefore swept in the two lanes of vector registers, from either end to the middle; any other chain in both lanes
 * alike, from the first pin to the last. */
#include <stddef.h>
#include "block_parts.h"
#include "unroll.h"

PW_ONE_BY_ONE

enum { CHAIN_BLOCK = 5 }; /* values of a diagonal block of 2 unknowns */

/* GNU C's vectors: operations work on both lanes. */
typedef double chain_lanes __attribute__ ((vector_size (2 * sizeof (double))));

/* A body: J at the pin that is eliminated and at the next one, factors of the former. */
typedef struct {
  const double *from, *to;
  double *keep;
  ptrdiff_t j, y; /* first coordinate; of the pin eliminated in the right-hand side */
} chain_lane;

typedef struct {
  chain_lane a, b;
  ptrdiff_t next_J, next_j, next_y, step; /* those of b are the same times `sign`, an argument */
} chain_sweep;

/* Two rows of a body: the unit matrix times s, then the angle's column. */
typedef struct {
  chain_lanes s, x, y;
} chain_arm;

typedef struct {
  chain_lanes x, y;
} chain_point;

typedef struct {
  chain_lanes xx, xy, yx, yy;
} chain_square;

/* ---- Lanes ---- */

PW_INLINE void chain_advance (chain_lane *x, const chain_sweep *s, ptrdiff_t bodies) {
  x->from += bodies * s->next_J, x->to += bodies * s->next_J, x->keep += 3 * bodies;
  x->j += bodies * s->next_j, x->y += bodies * s->next_y;
}

/* sign: 1, both lanes from the first pin; -1, the second one from the last. */
static chain_sweep chain_begin (const pw_block_ldl *l, const pw_chain *c, int sign) {
  chain_sweep s = { .next_J = c->next_J, .next_j = c->next_j, .next_y = c->next_y, .step = c->step };
  s.a = s.b = (chain_lane){ c->A, c->B, l->chain_factor + c->factor, c->j, c->y };
  if (sign > 0) return s;
  chain_advance (&s.b, &s, c->bodies - 1);
  const double *B = s.b.from;
  s.b.from = s.b.to, s.b.to = B;
  s.b.keep += 3, s.b.y += s.next_y;
  return s;
}

PW_INLINE void chain_move (chain_sweep *s, ptrdiff_t bodies, int sign) {
  chain_advance (&s->a, s, bodies);
  chain_advance (&s->b, s, sign * bodies);
}

/* Entries of arrays. */
PW_INLINE chain_lanes chain_load (const double *a, const double *b, ptrdiff_t i) {
  return (chain_lanes){ a[i], b[i] };
}

PW_INLINE void chain_store (double *a, double *b, ptrdiff_t i, chain_lanes value) {
  a[i] = value[0], b[i] = value[1];
}

PW_INLINE chain_arm chain_read (const double *a, const double *b, ptrdiff_t step) {
  return (chain_arm){ chain_load (a, b, 0), chain_load (a, b, 2), chain_load (a, b, step + 2) };
}

/* K, rows of the pin b, columns of the pin a. */
PW_INLINE chain_square chain_coupling (chain_arm a, chain_arm b, chain_lanes m, chain_lanes i) {
  const chain_lanes mass = m * a.s * b.s, x = i * b.x, y = i * b.y;
  return (chain_square){ mass + x * a.x, x * a.y, y * a.x, mass + y * a.y };
}

/* (x, y) divided by a factorised block. */
PW_INLINE chain_point chain_divide (chain_lanes d, chain_lanes e, chain_lanes f, chain_lanes x, chain_lanes y) {
  const chain_lanes z = (y - e * x) * f;
  return (chain_point){ x * d - e * z, z };
}

PW_INLINE chain_point chain_divide_kept (const chain_sweep *s, chain_lanes x, chain_lanes y) {
  const double *a = s->a.keep, *b = s->b.keep;
  return chain_divide (chain_load (a, b, 0), chain_load (a, b, 1), chain_load (a, b, 2), x, y);
}

/* ---- Factorisation ---- */

/* As block_pivot (block_factor.c); the smallest pivot changes rarely. */
PW_INLINE void chain_pivot (chain_lanes *D, pw_block_ldl *l, const chain_sweep *s) {
  const chain_lanes a = D[0], minor = a * D[2] - D[1] * D[1], least = { l->pivot, l->pivot };
  const chain_lanes first = least * D[3], second = least * a * D[4];
  const int good = a[0] > first[0] && a[1] > first[1] && minor[0] > second[0] && minor[1] > second[1];
  for (int k = 0; k < 2 && !good; k++) {
    const int y = (int)(k ? s->b.y : s->a.y);
    block_track_pivot (l, a[k], D[3][k], y);
    block_track_pivot (l, minor[k], fabs (a[k]) * D[4][k], y + 1);
  }
  D[0] = 1 / a;
  D[1] = D[1] * D[0], D[2] = a / minor;
}

/* Eliminates the pins with the diagonal blocks D, which become those of the next ones. */
PW_INLINE void chain_eliminate (pw_block_ldl *l, chain_sweep *s, int sign, chain_lanes *D) {
  const chain_arm a = chain_read (s->a.from, s->b.from, s->step), b = chain_read (s->a.to, s->b.to, s->step);
  const double *one = l->inverse + s->a.j, *other = l->inverse + s->b.j;
  const chain_lanes m = chain_load (one, other, 0), i = chain_load (one, other, 2);
  const chain_square K = chain_coupling (a, b, m, i);
  const chain_lanes x = i * a.x, y = i * a.y, xx = m + x * a.x, yy = m + y * a.y;
  D[0] += xx, D[1] += x * a.y, D[2] += yy, D[3] += xx, D[4] += yy;
  chain_pivot (D, l, s);
  for (int n = 0; n < 3; n++) chain_store (s->a.keep, s->b.keep, n, D[n]);
  const chain_point p = chain_divide (D[0], D[1], D[2], K.xx, K.xy), q = chain_divide (D[0], D[1], D[2], K.yx, K.yy);
  const chain_lanes u = i * b.x, v = i * b.y;
  D[3] = m + u * b.x, D[4] = m + v * b.y;
  D[0] = D[3] - (p.x * K.xx + p.y * K.xy);
  D[1] = u * b.y - (q.x * K.xx + q.y * K.xy);
  D[2] = D[4] - (q.x * K.yx + q.y * K.yy);
  chain_move (s, 1, sign);
}

/* Along the chain to the next column; or, if it is `whole`, from both ends to the pin in the middle, which of an odd
 * number of bodies is that after the body in the middle. */
void pw_chain_factor (pw_block_ldl *l, const pw_chain *c) {
  const double *first = l->value + l->column[c->column].at;
  double *last = l->value + l->column[c->column + c->bodies].at;
  chain_sweep s = chain_begin (l, c, c->whole ? -1 : 1);
  chain_lanes D[CHAIN_BLOCK];
  double other[CHAIN_BLOCK]; /* of the pin in the middle, from the second lane */
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] = (chain_lanes){ first[n], c->whole ? last[n] : first[n] };
  for (int n = c->whole ? c->bodies / 2 : 0; n > 0; n--) {
    chain_eliminate (l, &s, -1, D);
    if (!(l->pivot > 0)) return;
  }
  for (int n = 0; n < CHAIN_BLOCK && c->whole; n++) other[n] = D[n][1], D[n][1] = D[n][0];
  if (c->whole) s.b = s.a;
  for (int n = c->whole ? c->bodies % 2 : c->bodies; n > 0; n--) {
    chain_eliminate (l, &s, 1, D);
    if (!(l->pivot > 0)) return;
  }
  if (!c->whole) {
    for (int n = 0; n < CHAIN_BLOCK; n++) last[n] += D[n][0];
    return;
  }
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] += other[n];
  chain_pivot (D, l, &s);
  for (int n = 0; n < 3; n++) s.a.keep[n] = D[n][0];
}

/* ---- Solution ---- */

/* y_(c+1) -= K D^-1 y_c; at: y of the pins that are eliminated, then of the next ones. */
PW_INLINE chain_point chain_forward (const pw_block_ldl *l, chain_sweep *s, int sign, const double *f, double *y,
                                     chain_point at) {
  const chain_arm a = chain_read (s->a.from, s->b.from, s->step), b = chain_read (s->a.to, s->b.to, s->step);
  const double *one = l->inverse + s->a.j, *other = l->inverse + s->b.j;
  const chain_lanes m = chain_load (one, other, 0), i = chain_load (one, other, 2), mass = m * a.s * b.s;
  double *p = y + s->a.y, *q = y + s->b.y;
  const double *next_p = p + s->next_y, *next_q = q + sign * s->next_y;
  chain_point to = { chain_load (next_p, next_q, 0), chain_load (next_p, next_q, 1) };
  if (f) {
    const double *g = f + s->a.j, *h = f + s->b.j;
    const chain_lanes X = m * chain_load (g, h, 0), Y = m * chain_load (g, h, 1), T = i * chain_load (g, h, 2);
    at.x -= a.s * X + a.x * T, at.y -= a.s * Y + a.y * T;
    to.x -= b.s * X + b.x * T, to.y -= b.s * Y + b.y * T;
  }
  chain_store (p, q, 0, at.x);
  chain_store (p, q, 1, at.y);
  const chain_point z = chain_divide_kept (s, at.x, at.y);
  const chain_lanes turn = i * (a.x * z.x + a.y * z.y);
  to.x -= mass * z.x + turn * b.x;
  to.y -= mass * z.y + turn * b.y;
  chain_move (s, 1, sign);
  return to;
}

PW_INLINE chain_point chain_point_at (const chain_sweep *s, const double *y) {
  return (chain_point){ chain_load (y + s->a.y, y + s->b.y, 0), chain_load (y + s->a.y, y + s->b.y, 1) };
}

void pw_chain_forward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y) {
  chain_sweep s = chain_begin (l, c, c->whole ? -1 : 1);
  chain_point at = chain_point_at (&s, y);
  double x = 0, z = 0; /* changes by the second lane */
  if (c->whole) {
    for (int n = 0; n < c->bodies / 2; n++) at = chain_forward (l, &s, -1, f, y, at);
    x = at.x[1] - y[s.b.y], z = at.y[1] - y[s.b.y + 1];
    s.b = s.a;
    at.x[1] = at.x[0], at.y[1] = at.y[0];
  }
  for (int n = c->whole ? c->bodies % 2 : c->bodies; n > 0; n--) at = chain_forward (l, &s, 1, f, y, at);
  y[s.a.y] = at.x[0] + x;
  y[s.a.y + 1] = at.y[0] + z;
}

/* lambda of the pins before, from `at` of the next ones, and the accelerations of the bodies between them. */
PW_INLINE chain_point chain_backward (const pw_block_ldl *l, chain_sweep *s, int sign, const double *f, double *y,
                                      double *a, chain_point at) {
  chain_move (s, -1, sign);
  const chain_arm u = chain_read (s->a.from, s->b.from, s->step), v = chain_read (s->a.to, s->b.to, s->step);
  const double *one = l->inverse + s->a.j, *other = l->inverse + s->b.j;
  const chain_lanes m = chain_load (one, other, 0), i = chain_load (one, other, 2);
  const chain_square K = chain_coupling (u, v, m, i);
  const chain_point own = chain_point_at (s, y);
  chain_lanes X = v.s * at.x, Y = v.s * at.y, T = v.x * at.x + v.y * at.y;
  const chain_point z = chain_divide_kept (s, own.x + (K.xx * at.x + K.yx * at.y), own.y + (K.xy * at.x + K.yy * at.y));
  at = (chain_point){ -z.x, -z.y };
  chain_store (y + s->a.y, y + s->b.y, 0, at.x);
  chain_store (y + s->a.y, y + s->b.y, 1, at.y);
  X += u.s * at.x, Y += u.s * at.y, T += u.x * at.x + u.y * at.y;
  const double *g = f ? f + s->a.j : NULL, *h = f ? f + s->b.j : NULL;
  chain_store (a + s->a.j, a + s->b.j, 0, m * (f ? chain_load (g, h, 0) - X : -X));
  chain_store (a + s->a.j, a + s->b.j, 1, m * (f ? chain_load (g, h, 1) - Y : -Y));
  chain_store (a + s->a.j, a + s->b.j, 2, i * (f ? chain_load (g, h, 2) - T : -T));
  return at;
}

void pw_chain_backward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y, double *a) {
  chain_sweep s = chain_begin (l, c, c->whole ? -1 : 1), along;
  chain_move (&s, c->whole ? c->bodies / 2 : 0, -1);
  along = s;
  along.b = along.a;
  chain_move (&along, c->whole ? c->bodies % 2 : c->bodies, 1);
  chain_point at = chain_point_at (&along, y);
  if (c->whole) {
    const chain_point z = chain_divide_kept (&along, at.x, at.y);
    at = (chain_point){ -z.x, -z.y };
    y[along.a.y] = at.x[0], y[along.a.y + 1] = at.y[0];
  }
  const chain_point middle = at;
  for (int n = c->whole ? c->bodies % 2 : c->bodies; n > 0; n--) at = chain_backward (l, &along, 1, f, y, a, at);
  at.x[1] = middle.x[1], at.y[1] = middle.y[1];
  for (int n = c->whole ? c->bodies / 2 : 0; n > 0; n--) at = chain_backward (l, &s, -1, f, y, a, at);
}
