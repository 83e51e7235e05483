/* Factorisation and solution along chains; see block_ldl.h.  Each elimination waits for the one before it.  A chain
 * that can be eliminated from both ends (includes_last) is therefore swept in the two lanes of vector registers, from
 * the ends to the middle; in any other chain both lanes do the same, from the first pin to the last. */
#include <stddef.h>
#include "block_parts.h"
#include "unroll.h"

PW_ONE_BY_ONE

enum { CHAIN_BLOCK = 5 }; /* values of a diagonal block of 2 unknowns */

/* GNU C's vectors: operations work on both lanes. */
typedef double chain_lanes __attribute__ ((vector_size (2 * sizeof (double))));

/* A body of the chain, one of whose pins is eliminated. */
typedef struct {
  const double *J_eliminated, *J_next; /* J at this pin, and at the next one */
  double *factor;                      /* of this pin's diagonal block */
  ptrdiff_t j;                         /* first coordinate of the body */
  ptrdiff_t unknown;                   /* index in y of this pin's first unknown */
} chain_lane;

typedef struct {
  chain_lane first, second;
  ptrdiff_t J_stride, j_stride, unknown_stride; /* from body to body in the first lane; in the second one times
                                                 * 1 or -1, the argument `direction` of functions */
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

/* ---- Lanes ---- */

PW_INLINE void chain_advance (chain_lane *x, const chain_sweep *s, ptrdiff_t bodies) {
  x->J_eliminated += bodies * s->J_stride, x->J_next += bodies * s->J_stride, x->factor += 3 * bodies;
  x->j += bodies * s->j_stride, x->unknown += bodies * s->unknown_stride;
}

/* direction: 1, both lanes begin at the first pin; -1, the second lane begins at the last pin. */
static chain_sweep chain_begin (const pw_block_ldl *l, const pw_chain *c, int direction) {
  chain_sweep s = {
    .J_stride = c->J_stride, .j_stride = c->j_stride, .unknown_stride = c->unknown_stride, .row_stride = c->row_stride
  };
  s.first = s.second = (chain_lane){ c->J_first, c->J_second, l->chain_factor + c->first_factor, c->j, c->unknown };
  if (direction > 0) return s;
  chain_advance (&s.second, &s, c->bodies - 1);
  const double *J = s.second.J_eliminated;
  s.second.J_eliminated = s.second.J_next, s.second.J_next = J;
  s.second.factor += 3, s.second.unknown += s.unknown_stride;
  return s;
}

/* Moves both lanes on by some bodies. */
PW_INLINE void chain_move (chain_sweep *s, ptrdiff_t bodies, int direction) {
  chain_advance (&s->first, s, bodies);
  chain_advance (&s->second, s, direction * bodies);
}

/* Entry i of two arrays, one for each lane. */
PW_INLINE chain_lanes chain_load (const double *a, const double *b, ptrdiff_t i) {
  return (chain_lanes){ a[i], b[i] };
}

PW_INLINE void chain_store (double *a, double *b, ptrdiff_t i, chain_lanes value) {
  a[i] = value[0], b[i] = value[1];
}

PW_INLINE chain_jacobian chain_read_J (const chain_sweep *s, const double *a, const double *b) {
  return (chain_jacobian){ chain_load (a, b, 0), chain_load (a, b, 2), chain_load (a, b, s->row_stride + 2) };
}

PW_INLINE chain_body chain_read (const pw_block_ldl *l, const chain_sweep *s) {
  const double *first = l->inverse_weight + s->first.j, *second = l->inverse_weight + s->second.j;
  return (chain_body){ chain_read_J (s, s->first.J_eliminated, s->second.J_eliminated),
                       chain_read_J (s, s->first.J_next, s->second.J_next), chain_load (first, second, 0),
                       chain_load (first, second, 2) };
}

/* y of the pins that are eliminated. */
PW_INLINE chain_pair chain_unknowns (const chain_sweep *s, const double *y) {
  const double *first = y + s->first.unknown, *second = y + s->second.unknown;
  return (chain_pair){ chain_load (first, second, 0), chain_load (first, second, 1) };
}

PW_INLINE void chain_store_unknowns (const chain_sweep *s, double *y, chain_pair value) {
  double *first = y + s->first.unknown, *second = y + s->second.unknown;
  chain_store (first, second, 0, value.x);
  chain_store (first, second, 1, value.y);
}

/* The forces on the bodies. */
PW_INLINE chain_vector chain_forces (const chain_sweep *s, const double *f) {
  const double *first = f + s->first.j, *second = f + s->second.j;
  return (chain_vector){ chain_load (first, second, 0), chain_load (first, second, 1), chain_load (first, second, 2) };
}

/* K of block_ldl.h: rows of the next pin, columns of the one that is eliminated. */
PW_INLINE chain_square chain_coupling (chain_body p) {
  const chain_lanes mass = p.m * p.a.sign * p.b.sign, x = p.i * p.b.x, y = p.i * p.b.y;
  return (chain_square){ mass + x * p.a.x, x * p.a.y, y * p.a.x, mass + y * p.a.y };
}

/* (x, y) divided by a block with the factors d, e, f, as block_divide (block_parts.h). */
PW_INLINE chain_pair chain_divide (chain_lanes d, chain_lanes e, chain_lanes f, chain_lanes x, chain_lanes y) {
  const chain_lanes z = (y - e * x) * f;
  return (chain_pair){ x * d - e * z, z };
}

/* The same by the stored factors of the pins that are eliminated. */
PW_INLINE chain_pair chain_divide_stored (const chain_sweep *s, chain_lanes x, chain_lanes y) {
  const double *a = s->first.factor, *b = s->second.factor;
  return chain_divide (chain_load (a, b, 0), chain_load (a, b, 1), chain_load (a, b, 2), x, y);
}

/* ---- Factorisation ---- */

/* Factorises the diagonal block of each lane as block_pivot (block_factor.c).  D: as in pw_block_column: xx, yx, yy,
 * then xx and yy before elimination.  The smallest pivot rarely changes, so one test of both lanes comes first. */
PW_INLINE void chain_pivot (chain_lanes *D, pw_block_ldl *l, const chain_sweep *s) {
  const chain_lanes a = D[0], minor = a * D[2] - D[1] * D[1], least = { l->least_pivot, l->least_pivot };
  const chain_lanes bound = least * D[3], minor_bound = least * a * D[4];
  const int larger = a[0] > bound[0] && a[1] > bound[1] && minor[0] > minor_bound[0] && minor[1] > minor_bound[1];
  for (int k = 0; k < 2 && !larger; k++) {
    const int unknown = (int)(k ? s->second.unknown : s->first.unknown);
    block_track_pivot (l, a[k], D[3][k], unknown);
    block_track_pivot (l, minor[k], fabs (a[k]) * D[4][k], unknown + 1);
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
  for (int n = 0; n < 3; n++) chain_store (s->first.factor, s->second.factor, n, D[n]);
  /* The rows of L = K D^-1. */
  const chain_pair x = chain_divide (D[0], D[1], D[2], K.xx, K.xy), y = chain_divide (D[0], D[1], D[2], K.yx, K.yy);
  const chain_lanes bx = p.i * p.b.x, by = p.i * p.b.y;
  D[3] = p.m + bx * p.b.x, D[4] = p.m + by * p.b.y;
  D[0] = D[3] - (x.x * K.xx + x.y * K.xy);
  D[1] = bx * p.b.y - (y.x * K.xx + y.y * K.xy);
  D[2] = D[4] - (y.x * K.yx + y.y * K.yy);
  chain_move (s, 1, direction);
}

/* Without includes_last, eliminates all pins but the last, one by one.  With includes_last, eliminates pairs of pins
 * from both ends, then the pin before the middle body if the number of bodies is odd, and finally the remaining middle
 * pin. */
void pw_chain_factor (pw_block_ldl *l, const pw_chain *c) {
  const int pairs = c->includes_last ? c->bodies / 2 : 0, singles = c->bodies - 2 * pairs;
  const double *first = l->value + l->column[c->first_column].first_value;
  double *last = l->value + l->column[c->first_column + c->bodies].first_value;
  chain_sweep s = chain_begin (l, c, c->includes_last ? -1 : 1);
  chain_lanes D[CHAIN_BLOCK];
  double other[CHAIN_BLOCK]; /* the second lane's contribution to the middle pin */
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] = (chain_lanes){ first[n], c->includes_last ? last[n] : first[n] };
  for (int n = pairs; n > 0 && l->least_pivot > 0; n--) chain_eliminate (l, &s, -1, D);
  for (int n = 0; n < CHAIN_BLOCK && c->includes_last; n++) other[n] = D[n][1], D[n][1] = D[n][0];
  if (c->includes_last) s.second = s.first;
  for (int n = singles; n > 0 && l->least_pivot > 0; n--) chain_eliminate (l, &s, 1, D);
  if (!(l->least_pivot > 0)) return;
  if (!c->includes_last) {
    for (int n = 0; n < CHAIN_BLOCK; n++) last[n] += D[n][0];
    return;
  }
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] += other[n];
  chain_pivot (D, l, &s);
  for (int n = 0; n < 3; n++) s.first.factor[n] = D[n][0];
}

/* ---- Solution ---- */

/* Subtracts J W^-1 f from y of both pins of the body, then K D^-1 y_c from y_(c+1).  at: y of the pins that are
 * eliminated.  Returns y of the next ones. */
PW_INLINE chain_pair chain_forward (const pw_block_ldl *l, chain_sweep *s, int direction, const double *f, double *y,
                                    chain_pair at) {
  const chain_body p = chain_read (l, s);
  const chain_lanes mass = p.m * p.a.sign * p.b.sign;
  const double *first = y + s->first.unknown + s->unknown_stride,
               *second = y + s->second.unknown + direction * s->unknown_stride;
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

void pw_chain_forward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y) {
  const int pairs = c->includes_last ? c->bodies / 2 : 0, singles = c->bodies - 2 * pairs;
  chain_sweep s = chain_begin (l, c, c->includes_last ? -1 : 1);
  chain_pair at = chain_unknowns (&s, y);
  double change_x = 0, change_y = 0; /* by the second lane to the middle pin */
  if (c->includes_last) {
    for (int n = pairs; n > 0; n--) at = chain_forward (l, &s, -1, f, y, at);
    change_x = at.x[1] - y[s.second.unknown], change_y = at.y[1] - y[s.second.unknown + 1];
    s.second = s.first;
    at.x[1] = at.x[0], at.y[1] = at.y[0];
  }
  for (int n = singles; n > 0; n--) at = chain_forward (l, &s, 1, f, y, at);
  y[s.first.unknown] = at.x[0] + change_x;
  y[s.first.unknown + 1] = at.y[0] + change_y;
}

/* Goes back to the pins before; returns their lambda, from that of the next ones, `next`, and stores it in y; also
 * stores the accelerations of the bodies between them. */
PW_INLINE chain_pair chain_backward (const pw_block_ldl *l, chain_sweep *s, int direction, const double *f, double *y,
                                     double *acceleration, chain_pair next) {
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
  double *first = acceleration + s->first.j, *second = acceleration + s->second.j;
  chain_store (first, second, 0, p.m * net.x);
  chain_store (first, second, 1, p.m * net.y);
  chain_store (first, second, 2, p.i * net.angle);
  return at;
}

void pw_chain_backward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y, double *a) {
  const int pairs = c->includes_last ? c->bodies / 2 : 0, singles = c->bodies - 2 * pairs;
  chain_sweep ends = chain_begin (l, c, c->includes_last ? -1 : 1);
  chain_move (&ends, pairs, -1);
  chain_sweep middle = ends; /* where pw_chain_forward ended */
  middle.second = middle.first;
  chain_move (&middle, singles, 1);
  chain_pair at = chain_unknowns (&middle, y);
  if (c->includes_last) {
    const chain_pair z = chain_divide_stored (&middle, at.x, at.y);
    at = (chain_pair){ -z.x, -z.y };
    y[middle.first.unknown] = at.x[0], y[middle.first.unknown + 1] = at.y[0];
  }
  const chain_pair lambda = at;
  for (int n = singles; n > 0; n--) at = chain_backward (l, &middle, 1, f, y, a, at);
  at.x[1] = lambda.x[1], at.y[1] = lambda.y[1];
  for (int n = pairs; n > 0; n--) at = chain_backward (l, &ends, -1, f, y, a, at);
}
