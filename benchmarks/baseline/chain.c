/* The accelerations of a chain of pendulums by hand: uniform rods pinned end to end, redundant coordinates, linear
 * time.
 *
 * With e = (c, s) and n = (-s, c) of a rod, w its angular velocity and r = length / 2, the pin between rods i - 1 and i
 * requires
 *
 *   v_(i-1) + r n_(i-1) w_(i-1) - v_i + r n_i w_i = 0,      gamma_i = r e_(i-1) w_(i-1)^2 + r e_i w_i^2
 *
 * so that S = J M^-1 J^T is block tridiagonal with 2 x 2 blocks,
 *
 *   S_ii = 2 / m + r^2 / I (n_(i-1) n_(i-1)^T + n_i n_i^T),      S_(i,i+1) = -1 / m + r^2 / I n_i n_i^T
 *
 * (without the terms of rod i - 1 at i = 0), and block elimination solves for the multipliers in a forward and a
 * backward sweep. */
#include <math.h>
#include <stdlib.h>
#include "baseline.h"

/* The forward sweep at one pin: the inverse of D, the right-hand side, the direction of the rod behind it. */
struct chain_pin {
  double xx, xy, yy, bx, by, cos, sin;
};

int chain_open (chain *c, int links) {
  *c = (chain){ .links = links, .mass = 1, .inertia = 1.0 / 12, .length = 1, .gravity = 9.81 };
  c->pin = malloc ((size_t)links * sizeof *c->pin);
  return c->pin == NULL;
}

void chain_close (chain *c) {
  free (c->pin);
}

/* The backward sweep: multipliers from the last pin to the first, and the accelerations of the rods between them. */
static void chain_back (const chain *c, double *a, double *lambda) {
  double im = 1 / c->mass, r = c->length / 2, turn = r / c->inertia, xn = 0, yn = 0; /* xn, yn: of the next pin */
  for (int i = c->links - 1; i >= 0; i--) {
    const struct chain_pin *p = &c->pin[i];
    double C = p->cos, S = p->sin, dot = turn * r * (C * yn - S * xn);
    double bx = p->bx + im * xn + S * dot, by = p->by + im * yn - C * dot;
    double x = p->xx * bx + p->xy * by, y = p->xy * bx + p->yy * by;
    lambda[2 * i] = x;
    lambda[2 * i + 1] = y;
    a[3 * i] = im * (x - xn);
    a[3 * i + 1] = im * (y - yn) - c->gravity;
    a[3 * i + 2] = turn * (S * (x + xn) - C * (y + yn));
    xn = x, yn = y;
  }
}

/* The forward sweep: D_i = S_ii - S_(i,i-1) D_(i-1)^-1 S_(i-1,i).  kb, ib: r^2/I and 1/m of the rod before the pin,
 * which has the cosine C, the sine S and w2 = w^2; Cn, Sn, wn2: of the rod behind it.  J M^-1 f is zero at all pins
 * but the first. */
void chain_accelerate (chain *c, const double *q, const double *v, double *a, double *lambda) {
  double im = 1 / c->mass, r = c->length / 2, k = r * r / c->inertia;
  double fy = c->gravity, Dxx = 0, Dxy = 0, Dyy = 0, bx = 0, by = 0, C = 0, S = 0, w2 = 0, kb = 0, ib = 0;
  for (int i = 0; i < c->links; i++) {
    struct chain_pin *p = &c->pin[i];
    double Cn = cos (q[3 * i + 2]), Sn = sin (q[3 * i + 2]), wn2 = v[3 * i + 2] * v[3 * i + 2];
    /* nxx, nxy, nyy: kb n n^T of the rod before; oxx, nxy, oyy: S_(i,i-1); P = D_(i-1)^-1 S_(i-1,i) */
    double nxx = kb * S * S, nxy = -kb * S * C, nyy = kb * C * C, oxx = nxx - ib, oyy = nyy - ib;
    double Pxx = Dxx * oxx + Dxy * nxy, Pxy = Dxx * nxy + Dxy * oyy;
    double Pyx = Dxy * oxx + Dyy * nxy, Pyy = Dxy * nxy + Dyy * oyy;
    double xx = ib + im + nxx + k * Sn * Sn - oxx * Pxx - nxy * Pyx;
    double xy = nxy - k * Sn * Cn - oxx * Pxy - nxy * Pyy;
    double yy = ib + im + nyy + k * Cn * Cn - nxy * Pxy - oyy * Pyy;
    double rx = -r * (C * w2 + Cn * wn2), ry = fy - r * (S * w2 + Sn * wn2);
    double tx = rx - Pxx * bx - Pyx * by, ty = ry - Pxy * bx - Pyy * by;
    double det = 1 / (xx * yy - xy * xy);
    p->xx = Dxx = yy * det;
    p->xy = Dxy = -xy * det;
    p->yy = Dyy = xx * det;
    p->bx = bx = tx;
    p->by = by = ty;
    p->cos = C = Cn;
    p->sin = S = Sn;
    w2 = wn2, kb = k, ib = im, fy = 0;
  }
  chain_back (c, a, lambda);
}
