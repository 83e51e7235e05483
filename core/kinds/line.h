/* A point of body 1 on a line of body 2: the constraint equation shared by slot, slider and drive.
 *
 *   g     = n . D - c = 0,  D = r1 + R(phi1) s1 - r2,  c = n . R(phi2) s2           (1 holonomic equation)
 *   G     = [ n  t.a | -n  -t.D ]             t: along the line, n: t turned by +90 degrees, a = R(phi1) s1
 *   gamma = -v.H v = 2 w2 t.(r1' - r2') + w1 (w1 - 2 w2) n.a + w2^2 n.D             so that G a = gamma
 *
 * With dn/dphi2 = -t and dt/dphi2 = n, the entries of H = d2g/dq2 are -t and t over (r1, phi2) and (r2, phi2), -n.a
 * over (phi1, phi1), n.a over (phi1, phi2) and -n.D over (phi2, phi2).
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3.) */
#ifndef PW_LINE_H
#define PW_LINE_H

#include <math.h>
#include <string.h>
#include "batch.h"

typedef struct {
  double s1[2]; /* the point in body 1's frame [m] */
  double n[2];  /* normal of the line in body 2's frame */
  double c;     /* offset of the line along n [m] */
  double angle; /* slider: phi1 - phi2 [rad]; drive: 1 if it prescribes an angle (then n = 0), else 0 */
} line;

/* A line in the current state: n, t, the arm a = (X, Y) and D in world axes, and their dot products. */
typedef struct {
  const line *k;
  const pw_configuration *A, *B;
  const double *w, *u;
  double nx, ny, tx, ty, X, Y, Dx, Dy;
  double na, nD, ta, tD;
} line_state;

static inline line line_make (const double at[2][2], double heading) {
  line k = { { at[0][0], at[0][1] }, { -pw_sin (heading), pw_cos (heading) }, 0, 0 };
  k.c = k.n[0] * at[1][0] + k.n[1] * at[1][1];
  return k;
}

/* The line k of element e of a batch of elements with two bodies and at most one signal. */
static inline line_state line_of (const line *k, const pw_batch *b, int e) {
  const pw_configuration *A = batch_body (b, e, 2, 0), *B = batch_body (b, e, 2, 1);
  line_state s = { .k = k, .A = A, .B = B, .w = batch_w (b, e), .u = b->u + 3 * e };
  s.nx = B->cos * k->n[0] - B->sin * k->n[1], s.ny = B->sin * k->n[0] + B->cos * k->n[1];
  s.tx = s.ny, s.ty = -s.nx;
  s.X = A->cos * k->s1[0] - A->sin * k->s1[1], s.Y = A->sin * k->s1[0] + A->cos * k->s1[1];
  s.Dx = A->x + s.X - B->x, s.Dy = A->y + s.Y - B->y;
  s.na = s.nx * s.X + s.ny * s.Y, s.nD = s.nx * s.Dx + s.ny * s.Dy;
  s.ta = s.tx * s.X + s.ty * s.Y, s.tD = s.tx * s.Dx + s.ty * s.Dy;
  return s;
}

static inline line_state line_at (const pw_batch *b, int e) {
  return line_of ((const line *)b->element + e, b, e);
}

PER_ELEMENT (line_g, line, 1) {
  *out = x.nD - x.k->c;
}

PER_ELEMENT (line_g_size, line, 1) {
  *out = fabs (x.nx) * (fabs (x.A->x) + fabs (x.X) + fabs (x.B->x)) +
         fabs (x.ny) * (fabs (x.A->y) + fabs (x.Y) + fabs (x.B->y)) + fabs (x.k->c);
}

PER_ELEMENT (line_J, line, 6) {
  out[0] = x.nx, out[1] = x.ny, out[2] = x.ta, out[3] = -x.nx, out[4] = -x.ny, out[5] = -x.tD;
}

PER_ELEMENT (line_gamma, line, 1) {
  double w1 = x.A->omega, w2 = x.B->omega, tV = x.tx * (x.A->vx - x.B->vx) + x.ty * (x.A->vy - x.B->vy);
  *out = 2 * w2 * tV + w1 * (w1 - 2 * w2) * x.na + w2 * w2 * x.nD;
}

/* out = factor H w */
static inline void line_multiply_H (const line_state *s, double factor, const double w[6], double *out) {
  out[0] = -factor * s->tx * w[5];
  out[1] = -factor * s->ty * w[5];
  out[2] = factor * s->na * (w[5] - w[2]);
  out[3] = -out[0];
  out[4] = -out[1];
  out[5] = factor * (s->na * w[2] - s->nD * w[5] - s->tx * (w[0] - w[3]) - s->ty * (w[1] - w[4]));
}

/* out = l H, 6 x 6 */
static inline void line_jtl_q (const line_state *s, double l, double *out) {
  memset (out, 0, 36 * sizeof *out);
  out[5] = out[30] = -l * s->tx, out[11] = out[31] = -l * s->ty;
  out[23] = out[33] = l * s->tx, out[29] = out[34] = l * s->ty;
  out[14] = -l * s->na, out[17] = out[32] = l * s->na, out[35] = -l * s->nD;
}

PER_ELEMENT (line_jw_q, line, 6) {
  line_multiply_H (&x, 1, x.w, out);
}

PER_ELEMENT (line_gamma_q, line, 6) {
  double w1 = x.A->omega, w2 = x.B->omega, nV = x.nx * (x.A->vx - x.B->vx) + x.ny * (x.A->vy - x.B->vy);
  out[0] = w2 * w2 * x.nx;
  out[1] = w2 * w2 * x.ny;
  out[2] = (w1 - w2) * (w1 - w2) * x.ta;
  out[3] = -out[0];
  out[4] = -out[1];
  out[5] = 2 * w2 * nV - w1 * (w1 - 2 * w2) * x.ta - w2 * w2 * x.tD;
}

PER_ELEMENT (line_gamma_v, line, 6) {
  const double v[6] = { x.A->vx, x.A->vy, x.A->omega, x.B->vx, x.B->vy, x.B->omega };
  line_multiply_H (&x, -2, v, out);
}

#endif
