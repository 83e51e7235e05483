/* Chains, from the first pin to the last and back; see chain.h. */
#include "large_parts.h"
#include "unroll.h"

PW_ONE_BY_ONE

enum { CHAIN_BLOCK = 5 }; /* values of a diagonal block of 2 unknowns */

/* m 1 + i a a^T: its lower triangle */
static inline large_three chain_part (large_arm a, double m, double i) {
  const double x = i * a.x, y = i * a.y;
  return (large_three){ m + x * a.x, x * a.y, m + y * a.y };
}

/* K, rows of the second pin b, columns of the first a. */
static inline large_square chain_coupling (large_arm a, large_arm b, double m, double i) {
  const double mass = m * a.s * b.s, x = i * b.x, y = i * b.y;
  return (large_square){ mass + x * a.x, x * a.y, y * a.x, mass + y * a.y };
}

/* The first block as the rest of the matrix leaves it. */
static inline void chain_begin (const double *value, int at, double *D) {
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] = at < 0 ? 0 : value[at + n];
}

/* What is left goes to the column behind. */
static inline void chain_end (double *value, int at, const double *D) {
  double *to = large_at (value, at);
  for (int n = 0; n < CHAIN_BLOCK; n++) to[n] = at < 0 ? D[n] : to[n] + D[n];
}

/* to -= L from */
static inline void chain_eliminate (double *to, large_square L, const double *from) {
  to[0] -= L.xx * from[0] + L.xy * from[1];
  to[1] -= L.yx * from[0] + L.yy * from[1];
}

void pw_large_chain_down (pw_large *l, const pw_chain *c, const double *f, double *y) {
  const ptrdiff_t next_J = c->next_J, next_j = c->next_j, next_y = c->next_y, step = c->step;
  const double *A = l->base[0] + c->A, *B = l->base[0] + c->B, *w = l->inverse + c->j;
  double D[CHAIN_BLOCK], *keep = l->keep + c->keep;
  ptrdiff_t j = c->j, row = c->y;
  chain_begin (l->ldl->value, c->first, D);
  for (int n = 0; n < c->bodies; n++, A += next_J, B += next_J, w += next_j, j += next_j, row += next_y, keep += 3) {
    const large_arm a = large_read_arm (A, step), b = large_read_arm (B, step);
    const double m = w[0], i = w[2];
    const large_square coupling = chain_coupling (a, b, m, i);
    const double K[] = { coupling.xx, coupling.xy, coupling.yx, coupling.yy };
    const large_three P = chain_part (a, m, i), Q = chain_part (b, m, i);
    D[0] += P.x, D[1] += P.y, D[2] += P.z, D[3] += P.x, D[4] += P.z;
    const large_square inverse = large_invert (2, D, l, (int)row), L = large_scale (2, 2, K, inverse);
    keep[0] = inverse.xx, keep[1] = inverse.yx, keep[2] = inverse.yy;
    D[0] = D[3] = Q.x, D[1] = Q.y, D[2] = D[4] = Q.z;
    large_subtract_diagonal (2, D, L, K, 2);
    if (y && f) large_gather_arms (y + row, y + row + next_y, a, b, f + j, m, i);
    if (y) chain_eliminate (y + row + next_y, L, y + row);
    if (!(l->pivot > 0)) return;
  }
  chain_end (l->ldl->value, c->last, D);
}

/* y_(c+1) -= K D^-1 y_c */
void pw_large_chain_forward (const pw_large *l, const pw_chain *c, const double *f, double *y) {
  const ptrdiff_t next_J = c->next_J, next_y = c->next_y, step = c->step;
  const double *A = l->base[0] + c->A, *B = l->base[0] + c->B, *keep = l->keep + c->keep;
  double *from = y + c->y;
  for (ptrdiff_t n = 0, j = c->j; n < c->bodies; n++, j += c->next_j, A += next_J, B += next_J, keep += 3) {
    const large_arm a = large_read_arm (A, step), b = large_read_arm (B, step);
    const double m = l->inverse[j], i = l->inverse[j + 2], mass = m * a.s * b.s;
    double *to = from + next_y;
    if (f) large_gather_arms (from, to, a, b, f + j, m, i);
    const double x = keep[0] * from[0] + keep[1] * from[1], z = keep[1] * from[0] + keep[2] * from[1];
    const double turn = i * (a.x * x + a.y * z);
    to[0] -= mass * x + turn * b.x;
    to[1] -= mass * z + turn * b.y;
    from = to;
  }
}

/* From the last pin to the first, each with the body behind it. */
void pw_large_chain_up (const pw_large *l, const pw_chain *c, const double *f, double *y, double *a) {
  const ptrdiff_t next_J = c->next_J, next_j = c->next_j, next_y = c->next_y, step = c->step;
  const double *J = l->base[0], *last = y + c->y + c->bodies * next_y;
  double x = last[0], z = last[1]; /* y of the pin behind */
  for (ptrdiff_t n = c->bodies; n-- > 0;) {
    const ptrdiff_t j = c->j + n * next_j;
    const large_arm u = large_read_arm (J + c->A + n * next_J, step), v = large_read_arm (J + c->B + n * next_J, step);
    const double m = l->inverse[j], i = l->inverse[j + 2], *keep = l->keep + c->keep + 3 * n;
    const large_square K = chain_coupling (u, v, m, i);
    double *own = y + c->y + n * next_y, X = v.s * x, Y = v.s * z, T = v.x * x + v.y * z;
    const double right = own[0] + (K.xx * x + K.yx * z), up = own[1] + (K.xy * x + K.yy * z);
    own[0] = x = -(keep[0] * right + keep[1] * up);
    own[1] = z = -(keep[1] * right + keep[2] * up);
    X += u.s * x, Y += u.s * z, T += u.x * x + u.y * z;
    if (f)
      a[j] = m * (f[j] - X), a[j + 1] = m * (f[j + 1] - Y), a[j + 2] = i * (f[j + 2] - T);
    else
      a[j] = -m * X, a[j + 1] = -m * Y, a[j + 2] = -i * T;
  }
}
