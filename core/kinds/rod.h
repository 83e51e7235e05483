/* The distance of a point of body 1 from a point of body 2: the equation of rod, rope and contact.
 *
 *   g     = (d.d - L^2) / (2 L) = 0                               (1 holonomic equation); d, D: points.h
 *   G     = d^T D / L
 *   gamma = ( d.((X1, Y1) omega1^2 - (X2, Y2) omega2^2) - d'.d' ) / L      so that G v' = gamma
 *
 * with (X, Y): arms in world axes (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section
 * 3.3, with d.d - L^2 divided by 2 L: near the constraint g is the distance minus L, without a square root). */
#ifndef PW_ROD_H
#define PW_ROD_H

#include "points.h"

typedef struct {
  points points;
  double length; /* [m] */
} rod;

/* A rod in the current state. */
typedef struct {
  points_state ends;
  double D[12];          /* 2 x 6 */
  double omega1, omega2; /* angular velocities of the bodies */
  double L;
} rod_state;

/* The rod of an element with two bodies that contains one among other data. */
static inline rod_state rod_of (const rod *element, const pw_batch *batch, int e) {
  rod_state now = { .ends = points_of (&element->points, batch, e), .L = element->length };
  points_J_one (now.ends, now.D);
  now.omega1 = now.ends.body1->omega, now.omega2 = now.ends.body2->omega;
  return now;
}

static inline rod_state rod_at (const pw_batch *batch, int e) {
  return rod_of ((const rod *)batch->element + e, batch, e);
}

static inline double rod_dot (const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1];
}

/* out = y^T D / L */
static inline void rod_multiply_D (const rod_state *now, const double y[2], double *out) {
  for (int j = 0; j < 6; j++) out[j] = (y[0] * now->D[j] + y[1] * now->D[6 + j]) / now->L;
}

PER_ELEMENT (rod_g, rod, 1) {
  *out = (rod_dot (now.ends.d, now.ends.d) - now.L * now.L) / (2 * now.L);
}

/* A change dd of d changes g by d^T dd / L; dd is proportional to the size of d, and L / 2 is the second term of g. */
PER_ELEMENT (rod_g_size, rod, 1) {
  double size[2];
  points_g_size_one (now.ends, size);
  *out = (fabs (now.ends.d[0]) * size[0] + fabs (now.ends.d[1]) * size[1]) / now.L + now.L / 2;
}

PER_ELEMENT (rod_J, rod, 6) {
  rod_multiply_D (&now, now.ends.d, out);
}

PER_ELEMENT (rod_gamma, rod, 1) {
  double d_c = now.omega1 * now.omega1 * rod_dot (now.ends.d, now.ends.S1) -
               now.omega2 * now.omega2 * rod_dot (now.ends.d, now.ends.S2); /* d.c, see rod_gamma_q */
  *out = (d_c - rod_dot (now.ends.rate, now.ends.rate)) / now.L;
}

J_GAMMA (rod, 6, 1)

/* ((D w)^T D + d^T (D w)_q) / L; the columns of (D w)_q: -(X1, Y1) w[2] for phi1, (X2, Y2) w[5] for phi2. */
PER_ELEMENT (rod_jw_q, rod, 6) {
  double Dw[2] = { 0, 0 };
  for (int j = 0; j < 6; j++) Dw[0] += now.D[j] * now.ends.w[j], Dw[1] += now.D[6 + j] * now.ends.w[j];
  rod_multiply_D (&now, Dw, out);
  out[2] -= rod_dot (now.ends.d, now.ends.S1) * now.ends.w[2] / now.L;
  out[5] += rod_dot (now.ends.d, now.ends.S2) * now.ends.w[5] / now.L;
}

/* (c^T D + d^T c_q - 2 d'^T d'_q) / L with c = (X1, Y1) omega1^2 - (X2, Y2) omega2^2.  Columns for phi1, phi2: of c_q
 * those of D times omega1^2, omega2^2; of d'_q -omega1 (X1, Y1), omega2 (X2, Y2). */
PER_ELEMENT (rod_gamma_q, rod, 6) {
  const double square1 = now.omega1 * now.omega1, square2 = now.omega2 * now.omega2, *d = now.ends.d;
  double c[2];
  points_gamma_one (now.ends, c);
  rod_multiply_D (&now, c, out);
  out[2] +=
      (square1 * (d[0] * now.D[2] + d[1] * now.D[8]) + 2 * now.omega1 * rod_dot (now.ends.rate, now.ends.S1)) / now.L;
  out[5] +=
      (square2 * (d[0] * now.D[5] + d[1] * now.D[11]) - 2 * now.omega2 * rod_dot (now.ends.rate, now.ends.S2)) / now.L;
}

PER_ELEMENT (rod_gamma_v, rod, 6) {
  const double minus_twice[2] = { -2 * now.ends.rate[0], -2 * now.ends.rate[1] };
  rod_multiply_D (&now, minus_twice, out);
  out[2] += 2 * now.omega1 * rod_dot (now.ends.d, now.ends.S1) / now.L;
  out[5] -= 2 * now.omega2 * rod_dot (now.ends.d, now.ends.S2) / now.L;
}

#endif
