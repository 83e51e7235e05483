/* rod: a massless bar keeps a point of body 1 and a point of body 2 at the distance L.
 *
 *   g     = (d.d - L^2) / (2 L) = 0                               (1 holonomic equation); d, D: points.h
 *   G     = d^T D / L
 *   gamma = ( d.((X1, Y1) w1^2 - (X2, Y2) w2^2) - d'.d' ) / L     so that G a = gamma; (X, Y): arms in world axes
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3, with d.d - L^2 divided by
 * 2 L: near the constraint g is the distance minus L, without a square root.)
 * The force on body 1 is -lambda d / L, away from body 2; body 2 receives the opposite. */
#include "points.h"

typedef struct {
  points points;
  double length; /* [m] */
} rod;

/* A rod in the current state. */
typedef struct {
  points_state p;
  double D[12];  /* 2 x 6 */
  double w1, w2; /* angular velocities of the bodies */
  double L;
} rod_state;

static inline rod_state rod_at (const pw_batch *b, int e) {
  const rod *k = (const rod *)b->element + e;
  rod_state x = { .p = points_of (&k->points, b, e), .L = k->length };
  points_J_one (x.p, x.D);
  x.w1 = x.p.A->omega, x.w2 = x.p.B->omega;
  return x;
}

static inline double rod_dot (const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1];
}

/* out = y^T D / L */
static inline void rod_through (const rod_state *x, const double y[2], double *out) {
  for (int j = 0; j < 6; j++) out[j] = (y[0] * x->D[j] + y[1] * x->D[6 + j]) / x->L;
}

PREPARE (rod_prepare, pw_rod, rod) {
  *k = (rod){ points_make (d->at), d->length };
  return PW_OK;
}

PER_ELEMENT (rod_g, rod, 1) {
  *out = (rod_dot (x.p.d, x.p.d) - x.L * x.L) / (2 * x.L);
}

PER_ELEMENT (rod_g_size, rod, 1) {
  double size[2];
  points_g_size_one (x.p, size);
  *out = (fabs (x.p.d[0]) * size[0] + fabs (x.p.d[1]) * size[1]) / x.L + x.L / 2;
}

PER_ELEMENT (rod_J, rod, 6) {
  rod_through (&x, x.p.d, out);
}

PER_ELEMENT (rod_gamma, rod, 1) {
  double turn = x.w1 * x.w1 * rod_dot (x.p.d, x.p.S1) - x.w2 * x.w2 * rod_dot (x.p.d, x.p.S2);
  *out = (turn - rod_dot (x.p.rate, x.p.rate)) / x.L;
}

/* ((D w)^T D + d^T d(D w)/dq) / L with d(D w)/dphi1 = -(X1, Y1) w_2, d(D w)/dphi2 = (X2, Y2) w_5. */
PER_ELEMENT (rod_jw_q, rod, 6) {
  double Dw[2] = { 0, 0 };
  for (int j = 0; j < 6; j++) Dw[0] += x.D[j] * x.p.w[j], Dw[1] += x.D[6 + j] * x.p.w[j];
  rod_through (&x, Dw, out);
  out[2] -= rod_dot (x.p.d, x.p.S1) * x.p.w[2] / x.L;
  out[5] += rod_dot (x.p.d, x.p.S2) * x.p.w[5] / x.L;
}

/* dd'/dphi1 = -w1 (X1, Y1), dd'/dphi2 = w2 (X2, Y2); derivatives of the arms are columns of D, for arm 2 negated. */
PER_ELEMENT (rod_gamma_q, rod, 6) {
  const double square1 = x.w1 * x.w1, square2 = x.w2 * x.w2, *d = x.p.d;
  double turn[2];
  points_gamma_one (x.p, turn);
  rod_through (&x, turn, out);
  out[2] += (square1 * (d[0] * x.D[2] + d[1] * x.D[8]) + 2 * x.w1 * rod_dot (x.p.rate, x.p.S1)) / x.L;
  out[5] += (square2 * (d[0] * x.D[5] + d[1] * x.D[11]) - 2 * x.w2 * rod_dot (x.p.rate, x.p.S2)) / x.L;
}

PER_ELEMENT (rod_gamma_v, rod, 6) {
  const double minus_twice[2] = { -2 * x.p.rate[0], -2 * x.p.rate[1] };
  rod_through (&x, minus_twice, out);
  out[2] += 2 * x.w1 * rod_dot (x.p.d, x.p.S1) / x.L;
  out[5] -= 2 * x.w2 * rod_dot (x.p.d, x.p.S2) / x.L;
}

static const pw_field rod_fields[] = {
  { PW_AT (pw_rod, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies; one may be ground" },
  { PW_AT (pw_rod, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the end points in the bodies' frames" },
  { PW_AT (pw_rod, length), PW_NUMBER, .unit = "m", .required = 1, .domain = PW_POSITIVE,
    .about = "distance between the end points" },
  { .name = NULL },
};

static const pw_quantity rod_reaction[] = {
  { "F", "N", NULL, "force on the first body, away from the second; negative: tension" },
};

const pw_kind pw_kind_rod = {
  .name = "rod",
  .about = "a massless bar keeps a point of one body at a fixed distance from a point of another",
  .symbol = "0 0 0 1 0 0; o 0 0 0 .3; o 1 0 0 .3",
  DEFINITION (pw_rod, rod_fields),
  ELEMENT (rod, rod_prepare),
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  .reaction = rod_reaction,
  POSITION (rod),
  CONSTRAINT (rod),
};
