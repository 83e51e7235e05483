/* A chain of pendulums by hand: uniform rods pinned end to end, redundant coordinates, linear time.
 *
 * With n = (-s, c) of a rod and r = length / 2 the pin between rods i - 1 and i says
 *
 *   v_(i-1) + r n_(i-1) w_(i-1) - v_i + r n_i w_i = 0,      gamma_i = r e_(i-1) w_(i-1)^2 + r e_i w_i^2
 *
 * so that S = J M^-1 J^T is block tridiagonal with 2 x 2 blocks,
 *
 *   S_ii = 2 / m + r^2 / I (n_(i-1) n_(i-1)^T + n_i n_i^T),      S_(i,i+1) = -1 / m + r^2 / I n_i n_i^T
 *
 * (the ground's parts missing at i = 0), and one sweep down and one up solve for the multipliers. */
#include <math.h>
#include <stdlib.h>
#include "baseline.h"

int chain_open (chain *c, int links) {
  *c = (chain){ .links = links, .mass = 1, .inertia = 1.0 / 12, .length = 1, .gravity = 9.81 };
  c->scratch = malloc ((size_t)links * 8 * sizeof *c->scratch);
  return c->scratch == NULL;
}

void chain_close (chain *c) {
  free (c->scratch);
}

/* The sweep up: multipliers from the last pin to the first, then the accelerations of the rod between two pins. */
static void chain_back (const chain *c, double *a, double *lambda) {
  double im = 1 / c->mass, r = c->length / 2, k = r / c->inertia, g = c->gravity, xn = 0, yn = 0;
  for (int i = c->links - 1; i >= 0; i--) {
    const double *w = c->scratch + 8 * i;
    double C = w[5], S = w[6], nk = k * r;
    double dot = nk * (C * yn - S * xn), bx = w[3] + im * xn + S * dot, by = w[4] + im * yn - C * dot;
    double x = w[0] * bx + w[1] * by, y = w[1] * bx + w[2] * by;
    lambda[2 * i] = x;
    lambda[2 * i + 1] = y;
    a[3 * i] = im * (x - xn);
    a[3 * i + 1] = im * (y - yn) - g;
    a[3 * i + 2] = k * (S * (x + xn) - C * (y + yn));
    xn = x, yn = y;
  }
}

/* The sweep down: D_i = S_ii - S_(i,i-1) D_(i-1)^-1 S_(i-1,i); kept are its inverse, the right-hand side and the rod's
 * direction. */
void chain_accelerate (chain *c, const double *q, const double *v, double *a, double *lambda) {
  double im = 1 / c->mass, r = c->length / 2, k = r * r / c->inertia;
  double cx = 0, cy = -c->gravity, Dxx = 0, Dxy = 0, Dyy = 0, bx = 0, by = 0, C = 0, S = 0, w2 = 0, kb = 0, ib = 0;
  for (int i = 0; i < c->links; i++) {
    double *keep = c->scratch + 8 * i, Cn = cos (q[3 * i + 2]), Sn = sin (q[3 * i + 2]), wn = v[3 * i + 2];
    double wn2 = wn * wn;
    /* the rod before: n n^T = (S S, -S C; -S C, C C); its block couples this pin to the one before */
    double nxx = kb * S * S, nxy = -kb * S * C, nyy = kb * C * C, oxx = nxx - ib, oyy = nyy - ib;
    double Pxx = Dxx * oxx + Dxy * nxy, Pxy = Dxx * nxy + Dxy * oyy;
    double Pyx = Dxy * oxx + Dyy * nxy, Pyy = Dxy * nxy + Dyy * oyy;
    double xx = ib + im + nxx + k * Sn * Sn - oxx * Pxx - nxy * Pyx;
    double xy = nxy - k * Sn * Cn - oxx * Pxy - nxy * Pyy;
    double yy = ib + im + nyy + k * Cn * Cn - nxy * Pxy - oyy * Pyy;
    double rx = -r * (C * w2 + Cn * wn2) - cx, ry = -r * (S * w2 + Sn * wn2) - cy;
    double tx = rx - Pxx * bx - Pyx * by, ty = ry - Pxy * bx - Pyy * by;
    double det = 1 / (xx * yy - xy * xy);
    keep[0] = Dxx = yy * det;
    keep[1] = Dxy = -xy * det;
    keep[2] = Dyy = xx * det;
    keep[3] = bx = tx;
    keep[4] = by = ty;
    keep[5] = C = Cn;
    keep[6] = S = Sn;
    w2 = wn2, kb = k, ib = im;
    cx = cy = 0;
  }
  chain_back (c, a, lambda);
}
