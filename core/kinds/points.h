/* Kinematics of a point of body 1 and a point of body 2, shared by pin, weld, rod and spring.
 *
 *   d     = r1 + R(phi1) s1 - r2 - R(phi2) s2                     from point 2 to point 1
 *   D     = dd/dq = [ 1 0 -Y1 | -1 0  Y2 ]       with (X, Y) = R(phi) s, the arm in world axes
 *                   [ 0 1  X1 |  0 -1 -X2 ]
 *   d'    = D v,  d'' = D v' - gamma,  gamma = (X1, Y1) omega1^2 - (X2, Y2) omega2^2
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3.) */
#ifndef PW_POINTS_H
#define PW_POINTS_H

#include "batch.h"

typedef struct {
  double s1[2], s2[2]; /* the points in the bodies' frames [m] */
} points;

/* Two points in the current state; vectors in world axes. */
typedef struct {
  const pw_configuration *body1, *body2;
  const double *w;      /* the vector w of jw_q, else NULL */
  double S1[2], S2[2];  /* arms (X1, Y1), (X2, Y2) */
  double d[2], rate[2]; /* d, d' */
} points_state;

static inline points points_make (const double at[2][2]) {
  return (points){ { at[0][0], at[0][1] }, { at[1][0], at[1][1] } };
}

/* The points of element e of a batch of elements with two bodies. */
static inline points_state points_of (const points *constants, const pw_batch *batch, int e) {
  const pw_configuration *body1 = batch_body (batch, 2 * e), *body2 = batch_body (batch, 2 * e + 1);
  points_state now = { .body1 = body1, .body2 = body2, .w = batch_w (batch, e) };
  to_world (body1, constants->s1, now.S1);
  to_world (body2, constants->s2, now.S2);
  now.d[0] = body1->x + now.S1[0] - body2->x - now.S2[0], now.d[1] = body1->y + now.S1[1] - body2->y - now.S2[1];
  now.rate[0] = body1->vx - body1->omega * now.S1[1] - body2->vx + body2->omega * now.S2[1];
  now.rate[1] = body1->vy + body1->omega * now.S1[0] - body2->vy - body2->omega * now.S2[0];
  return now;
}

static inline points_state points_at (const pw_batch *batch, int e) {
  return points_of ((const points *)batch->element + e, batch, e);
}

PER_ELEMENT (points_g, points, 2) {
  out[0] = now.d[0], out[1] = now.d[1];
}

PER_ELEMENT (points_g_size, points, 2) {
  out[0] = fabs (now.body1->x) + fabs (now.S1[0]) + fabs (now.body2->x) + fabs (now.S2[0]);
  out[1] = fabs (now.body1->y) + fabs (now.S1[1]) + fabs (now.body2->y) + fabs (now.S2[1]);
}

PER_ELEMENT (points_J, points, 12) {
  out[0] = 1, out[1] = 0, out[2] = -now.S1[1], out[3] = -1, out[4] = 0, out[5] = now.S2[1];
  out[6] = 0, out[7] = 1, out[8] = now.S1[0], out[9] = 0, out[10] = -1, out[11] = -now.S2[0];
}

PER_ELEMENT (points_gamma, points, 2) {
  double square1 = now.body1->omega * now.body1->omega, square2 = now.body2->omega * now.body2->omega;
  out[0] = now.S1[0] * square1 - now.S2[0] * square2;
  out[1] = now.S1[1] * square1 - now.S2[1] * square2;
}

J_GAMMA (points, 12, 2)

/* Sets the two angle columns of a 2 x 6 block, the others to zero. */
static inline void points_angles (double *out, double x1, double y1, double x2, double y2) {
  for (int i = 0; i < 12; i++) out[i] = 0;
  out[2] = x1, out[8] = y1, out[5] = x2, out[11] = y2;
}

PER_ELEMENT (points_jw_q, points, 12) {
  double w_phi1 = now.w[2], w_phi2 = now.w[5];
  points_angles (out, -now.S1[0] * w_phi1, -now.S1[1] * w_phi1, now.S2[0] * w_phi2, now.S2[1] * w_phi2);
}

PER_ELEMENT (points_gamma_q, points, 12) {
  double square1 = now.body1->omega * now.body1->omega, square2 = now.body2->omega * now.body2->omega;
  points_angles (out, -now.S1[1] * square1, now.S1[0] * square1, now.S2[1] * square2, -now.S2[0] * square2);
}

PER_ELEMENT (points_gamma_v, points, 12) {
  double twice1 = 2 * now.body1->omega, twice2 = 2 * now.body2->omega;
  points_angles (out, now.S1[0] * twice1, now.S1[1] * twice1, -now.S2[0] * twice2, -now.S2[1] * twice2);
}

#endif
