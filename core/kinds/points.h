/* Kinematics of a point of body 1 and a point of body 2, shared by pin, weld, rod and spring.
 *
 *   d     = r1 + R(phi1) s1 - r2 - R(phi2) s2                     from point 2 to point 1
 *   D     = dd/dq = [ 1 0 -Y1 | -1 0  Y2 ]       with (X, Y) = R(phi) s, the arm in world axes
 *                   [ 0 1  X1 |  0 -1 -X2 ]
 *   d'    = D v,  d'' = D v' - gamma,  gamma = (X1, Y1) w1^2 - (X2, Y2) w2^2
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3.) */
#ifndef PW_POINTS_H
#define PW_POINTS_H

#include <math.h>
#include "batch.h"

typedef struct {
  double s1[2], s2[2]; /* the points in the bodies' frames [m] */
} points;

/* Two points in the current state. */
typedef struct {
  const pw_configuration *A, *B;
  const double *w;      /* the vector w of jw_q, else NULL */
  double S1[2], S2[2];  /* arms in world axes */
  double d[2], rate[2]; /* d, d' */
} points_state;

static inline points points_make (const double at[2][2]) {
  return (points){ { at[0][0], at[0][1] }, { at[1][0], at[1][1] } };
}

/* The points k of element e of a batch of elements with two bodies. */
static inline points_state points_of (const points *k, const pw_batch *b, int e) {
  const pw_configuration *A = batch_body (b, e, 2, 0), *B = batch_body (b, e, 2, 1);
  points_state x = { .A = A, .B = B, .w = batch_w (b, e) };
  to_world (A, k->s1, x.S1);
  to_world (B, k->s2, x.S2);
  x.d[0] = A->x + x.S1[0] - B->x - x.S2[0], x.d[1] = A->y + x.S1[1] - B->y - x.S2[1];
  x.rate[0] = A->vx - A->omega * x.S1[1] - B->vx + B->omega * x.S2[1];
  x.rate[1] = A->vy + A->omega * x.S1[0] - B->vy - B->omega * x.S2[0];
  return x;
}

static inline points_state points_at (const pw_batch *b, int e) {
  return points_of ((const points *)b->element + e, b, e);
}

PER_ELEMENT (points_g, points, 2) {
  out[0] = x.d[0], out[1] = x.d[1];
}

PER_ELEMENT (points_g_size, points, 2) {
  out[0] = fabs (x.A->x) + fabs (x.S1[0]) + fabs (x.B->x) + fabs (x.S2[0]);
  out[1] = fabs (x.A->y) + fabs (x.S1[1]) + fabs (x.B->y) + fabs (x.S2[1]);
}

PER_ELEMENT (points_J, points, 12) {
  out[0] = 1, out[1] = 0, out[2] = -x.S1[1], out[3] = -1, out[4] = 0, out[5] = x.S2[1];
  out[6] = 0, out[7] = 1, out[8] = x.S1[0], out[9] = 0, out[10] = -1, out[11] = -x.S2[0];
}

PER_ELEMENT (points_gamma, points, 2) {
  double square1 = x.A->omega * x.A->omega, square2 = x.B->omega * x.B->omega;
  out[0] = x.S1[0] * square1 - x.S2[0] * square2;
  out[1] = x.S1[1] * square1 - x.S2[1] * square2;
}

/* Sets the two angle columns of a 2 x 6 block, the others to zero. */
static inline void points_angles (double *out, double x1, double y1, double x2, double y2) {
  for (int i = 0; i < 12; i++) out[i] = 0;
  out[2] = x1, out[8] = y1, out[5] = x2, out[11] = y2;
}

PER_ELEMENT (points_jw_q, points, 12) {
  double w1 = x.w[2], w2 = x.w[5];
  points_angles (out, -x.S1[0] * w1, -x.S1[1] * w1, x.S2[0] * w2, x.S2[1] * w2);
}

PER_ELEMENT (points_gamma_q, points, 12) {
  double square1 = x.A->omega * x.A->omega, square2 = x.B->omega * x.B->omega;
  points_angles (out, -x.S1[1] * square1, x.S1[0] * square1, x.S2[1] * square2, -x.S2[0] * square2);
}

PER_ELEMENT (points_gamma_v, points, 12) {
  double twice1 = 2 * x.A->omega, twice2 = 2 * x.B->omega;
  points_angles (out, x.S1[0] * twice1, x.S1[1] * twice1, -x.S2[0] * twice2, -x.S2[1] * twice2);
}

#endif
