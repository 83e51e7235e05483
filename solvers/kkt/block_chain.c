/* Chains, from the first pin to the last and back; see block_ldl.h. */
#include <stddef.h>
#include "block_parts.h"
#include "unroll.h"

PW_ONE_BY_ONE

enum { CHAIN_BLOCK = 5 }; /* values of a diagonal block of 2 unknowns */

/* Two rows of a body: the unit matrix times s, then the angle's column. */
typedef struct {
  double s, x, y;
} chain_arm;

static inline chain_arm chain_read (const double *J, ptrdiff_t step) {
  return (chain_arm){ J[0], J[2], J[step + 2] };
}

/* m 1 + i a a^T */
static inline block_square chain_diagonal (chain_arm a, double m, double i) {
  const double x = i * a.x, y = i * a.y;
  return (block_square){ m + x * a.x, x * a.y, x * a.y, m + y * a.y };
}

/* K, rows of the second pin b, columns of the first a. */
static inline block_square chain_coupling (chain_arm a, chain_arm b, double m, double i) {
  const double mass = m * a.s * b.s, x = i * b.x, y = i * b.y;
  return (block_square){ mass + x * a.x, x * a.y, y * a.x, mass + y * a.y };
}

void pw_chain_factor (pw_block_ldl *l, const pw_chain *c) {
  const ptrdiff_t next_J = c->next_J, next_j = c->next_j, step = c->step;
  const double *A = c->A, *B = c->B, *w = l->inverse + c->j;
  const double *before = l->value + l->column[c->column].at;
  double *after = l->value + l->column[c->column + c->bodies].at, *keep = l->chain_factor + c->factor;
  double D[CHAIN_BLOCK];
  for (int n = 0; n < CHAIN_BLOCK; n++) D[n] = before[n];
  for (int n = 0, row = c->y; n < c->bodies; n++, A += next_J, B += next_J, w += next_j, row += c->next_y, keep += 3) {
    const chain_arm a = chain_read (A, step), b = chain_read (B, step);
    const double m = w[0], i = w[2];
    const block_square coupling = chain_coupling (a, b, m, i);
    const double K[] = { coupling.xx, coupling.xy, coupling.yx, coupling.yy };
    const block_square P = chain_diagonal (a, m, i), Q = chain_diagonal (b, m, i);
    D[0] += P.xx, D[1] += P.xy, D[2] += P.yy, D[3] += P.xx, D[4] += P.yy;
    block_pivot (2, D, l, row);
    keep[0] = D[0], keep[1] = D[1], keep[2] = D[2];
    const block_square L = block_scale (2, 2, K, D);
    D[0] = D[3] = Q.xx, D[1] = Q.xy, D[2] = D[4] = Q.yy;
    block_subtract_diagonal (2, D, L, K, 2);
    if (!(l->pivot > 0)) return;
  }
  for (int n = 0; n < CHAIN_BLOCK; n++) after[n] += D[n];
}

/* y_(c+1) -= K D^-1 y_c */
void pw_chain_forward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y) {
  const ptrdiff_t next_J = c->next_J, next_y = c->next_y, step = c->step;
  const double *A = c->A, *B = c->B, *keep = l->chain_factor + c->factor;
  double *from = y + c->y;
  for (ptrdiff_t n = 0, j = c->j; n < c->bodies; n++, j += c->next_j, A += next_J, B += next_J, keep += 3) {
    const chain_arm a = chain_read (A, step), b = chain_read (B, step);
    const double m = l->inverse[j], i = l->inverse[j + 2], mass = m * a.s * b.s;
    double *to = from + next_y;
    if (f) {
      const double X = m * f[j], Y = m * f[j + 1], T = i * f[j + 2];
      from[0] -= a.s * X + a.x * T, from[1] -= a.s * Y + a.y * T;
      to[0] -= b.s * X + b.x * T, to[1] -= b.s * Y + b.y * T;
    }
    const block_pair z = block_divide (2, keep, from[0], from[1]);
    const double turn = i * (a.x * z.x + a.y * z.y);
    to[0] -= mass * z.x + turn * b.x;
    to[1] -= mass * z.y + turn * b.y;
    from = to;
  }
}

/* From the last pin to the first, each with the body after it. */
void pw_chain_backward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y, double *a) {
  const ptrdiff_t next_J = c->next_J, next_j = c->next_j, next_y = c->next_y, step = c->step;
  const double *last = y + c->y + c->bodies * next_y;
  double x = last[0], z = last[1]; /* y of the pin after */
  for (ptrdiff_t n = c->bodies; n-- > 0;) {
    const ptrdiff_t j = c->j + n * next_j;
    const chain_arm u = chain_read (c->A + n * next_J, step), v = chain_read (c->B + n * next_J, step);
    const double m = l->inverse[j], i = l->inverse[j + 2], *keep = l->chain_factor + c->factor + 3 * n;
    const block_square K = chain_coupling (u, v, m, i);
    double *own = y + c->y + n * next_y, X = v.s * x, Y = v.s * z, T = v.x * x + v.y * z;
    const double right = own[0] + (K.xx * x + K.yx * z), up = own[1] + (K.xy * x + K.yy * z);
    const block_pair own_z = block_divide (2, keep, right, up);
    own[0] = x = -own_z.x;
    own[1] = z = -own_z.y;
    X += u.s * x, Y += u.s * z, T += u.x * x + u.y * z;
    if (f)
      a[j] = m * (f[j] - X), a[j + 1] = m * (f[j + 1] - Y), a[j + 2] = i * (f[j + 2] - T);
    else
      a[j] = -m * X, a[j + 1] = -m * Y, a[j + 2] = -i * T;
  }
}
