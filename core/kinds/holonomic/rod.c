/* rod: a massless bar keeps a point of body 1 and a point of body 2 at the distance L.
 *
 *   g     = (d.d - L^2) / (2 L) = 0,  d = r1 + R(phi1) s1 - r2 - R(phi2) s2             (1 holonomic equation)
 *   G     = d^T D / L,  D = dd/dq = [ 1 0 -Y1 | -1 0 Y2 ; 0 1 X1 | 0 -1 -X2 ],  (X, Y) = R(phi) s
 *   gamma = ( d.((X1, Y1) w1^2 - (X2, Y2) w2^2) - d'.d' ) / L                           so that G a = gamma
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3, with d.d - L^2 divided by
 * 2 L: near the constraint g is the distance minus L, without a square root.)
 * The force on body 1 is -lambda d / L, away from body 2; body 2 receives the opposite. */
#include <math.h>
#include "batch.h"

typedef struct {
  double s1[2], s2[2]; /* ends in the bodies' frames [m] */
  double length;       /* [m] */
} rod;

/* A rod in the current state. */
typedef struct {
  const pw_configuration *A, *B;
  const double *w; /* that J is multiplied by, for jw_q only */
  double D[2][6];
  double S1[2], S2[2];  /* arms in world axes */
  double d[2], rate[2]; /* from end 2 to end 1, and its velocity */
  double w1, w2;        /* angular velocities of the bodies */
  double L;
} rod_state;

static inline rod_state rod_at (const pw_batch *b, int e) {
  const rod *k = (const rod *)b->element + e;
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]];
  rod_state s = { A, B, batch_w (b, e), .w1 = A->omega, .w2 = B->omega, .L = k->length };
  s.S1[0] = A->cos * k->s1[0] - A->sin * k->s1[1], s.S1[1] = A->sin * k->s1[0] + A->cos * k->s1[1];
  s.S2[0] = B->cos * k->s2[0] - B->sin * k->s2[1], s.S2[1] = B->sin * k->s2[0] + B->cos * k->s2[1];
  s.D[0][0] = s.D[1][1] = 1, s.D[0][3] = s.D[1][4] = -1;
  s.D[0][2] = -s.S1[1], s.D[1][2] = s.S1[0], s.D[0][5] = s.S2[1], s.D[1][5] = -s.S2[0];
  s.d[0] = A->x + s.S1[0] - B->x - s.S2[0], s.d[1] = A->y + s.S1[1] - B->y - s.S2[1];
  s.rate[0] = A->vx - s.w1 * s.S1[1] - B->vx + s.w2 * s.S2[1];
  s.rate[1] = A->vy + s.w1 * s.S1[0] - B->vy - s.w2 * s.S2[0];
  return s;
}

static inline double rod_dot (const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1];
}

/* out = x^T D / L */
static inline void rod_through (const rod_state *s, const double x[2], double *out) {
  for (int j = 0; j < 6; j++) out[j] = (x[0] * s->D[0][j] + x[1] * s->D[1][j]) / s->L;
}

PREPARE (rod_prepare, pw_rod, rod) {
  *k = (rod){ { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] }, d->length };
}

PER_ELEMENT (rod_g, rod, 1) {
  *out = (rod_dot (x.d, x.d) - x.L * x.L) / (2 * x.L);
}

PER_ELEMENT (rod_g_size, rod, 1) {
  double dx = fabs (x.A->x) + fabs (x.S1[0]) + fabs (x.B->x) + fabs (x.S2[0]);
  double dy = fabs (x.A->y) + fabs (x.S1[1]) + fabs (x.B->y) + fabs (x.S2[1]);
  *out = (fabs (x.d[0]) * dx + fabs (x.d[1]) * dy) / x.L + x.L / 2;
}

PER_ELEMENT (rod_J, rod, 6) {
  rod_through (&x, x.d, out);
}

PER_ELEMENT (rod_gamma, rod, 1) {
  double turn = x.w1 * x.w1 * rod_dot (x.d, x.S1) - x.w2 * x.w2 * rod_dot (x.d, x.S2);
  *out = (turn - rod_dot (x.rate, x.rate)) / x.L;
}

/* ((D w)^T D + d^T d(D w)/dq) / L with d(D w)/dphi1 = -(X1, Y1) w_2, d(D w)/dphi2 = (X2, Y2) w_5. */
PER_ELEMENT (rod_jw_q, rod, 6) {
  double Dw[2] = { 0, 0 };
  for (int j = 0; j < 6; j++) Dw[0] += x.D[0][j] * x.w[j], Dw[1] += x.D[1][j] * x.w[j];
  rod_through (&x, Dw, out);
  out[2] -= rod_dot (x.d, x.S1) * x.w[2] / x.L;
  out[5] += rod_dot (x.d, x.S2) * x.w[5] / x.L;
}

/* dd'/dphi1 = -w1 (X1, Y1), dd'/dphi2 = w2 (X2, Y2); derivatives of the arms are columns of D, for arm 2 negated. */
PER_ELEMENT (rod_gamma_q, rod, 6) {
  const double square1 = x.w1 * x.w1, square2 = x.w2 * x.w2;
  const double turn[2] = { x.S1[0] * square1 - x.S2[0] * square2, x.S1[1] * square1 - x.S2[1] * square2 };
  rod_through (&x, turn, out);
  out[2] += (square1 * (x.d[0] * x.D[0][2] + x.d[1] * x.D[1][2]) + 2 * x.w1 * rod_dot (x.rate, x.S1)) / x.L;
  out[5] += (square2 * (x.d[0] * x.D[0][5] + x.d[1] * x.D[1][5]) - 2 * x.w2 * rod_dot (x.rate, x.S2)) / x.L;
}

PER_ELEMENT (rod_gamma_v, rod, 6) {
  const double minus_twice[2] = { -2 * x.rate[0], -2 * x.rate[1] };
  rod_through (&x, minus_twice, out);
  out[2] += 2 * x.w1 * rod_dot (x.d, x.S1) / x.L;
  out[5] -= 2 * x.w2 * rod_dot (x.d, x.S2) / x.L;
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
  .g = rod_g,
  .g_size = rod_g_size,
  .J = rod_J,
  .gamma = rod_gamma,
  .jw_q = rod_jw_q,
  .gamma_q = rod_gamma_q,
  .gamma_v = rod_gamma_v,
};
