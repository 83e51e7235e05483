/* spring: a spring and a parallel damper between a point of body 1 and a point of body 2.
 *
 *   d = r1 + R(phi1) s1 - r2 - R(phi2) s2,  l = |d|,  e = d / l       (points.h)
 *   F = k (l - l0) e + c l' e                 -F acts on body 1 at its point, F on body 2
 *   f = -D^T F,  D = dd/dq;  (X, Y): arms in world axes
 *   V = k (l - l0)^2 / 2,  loss = c l'^2
 *
 * (Shabana 2001, Computational Dynamics, section 6.5.)
 * If the ends meet, the direction is undefined: e = 0 and the force is zero.  For l0 = 0 this is the limit of the
 * smooth spring force k d; for l0 > 0 the ends should not meet. */
#include "points.h"

#define SPRING_SHORTEST 1e-150 /* [m]; for smaller lengths products with 1 / l could overflow */

typedef struct {
  points points;
  double stiffness, damping, free_length; /* k [N/m], c [N s/m], l0 [m] */
} spring;

/* A spring in the current state. */
typedef struct {
  const spring *element;
  points_state ends;
  double D[12];            /* 2 x 6 */
  double e[2], l, inverse; /* inverse: 1 / l; it and e are 0 for l <= SPRING_SHORTEST */
  double speed;            /* l' */
  double F[2];
} spring_state;

static inline spring_state spring_at (const pw_batch *batch, int e) {
  const spring *element = (const spring *)batch->element + e;
  spring_state now = { .element = element, .ends = points_of (&element->points, batch, e) };
  points_J_one (now.ends, now.D);
  now.l = hypot (now.ends.d[0], now.ends.d[1]);
  now.inverse = now.l > SPRING_SHORTEST ? 1 / now.l : 0;
  now.e[0] = now.ends.d[0] * now.inverse, now.e[1] = now.ends.d[1] * now.inverse;
  now.speed = now.e[0] * now.ends.rate[0] + now.e[1] * now.ends.rate[1];
  double pull = element->stiffness * (now.l - element->free_length) + element->damping * now.speed;
  now.F[0] = pull * now.e[0], now.F[1] = pull * now.e[1];
  return now;
}

PREPARE (spring_prepare, pw_spring, spring) {
  *element = (spring){ points_make (definition->at), definition->stiffness, definition->damping, definition->length };
  return PW_OK;
}

PER_ELEMENT (spring_force, spring, 6) {
  out[0] = -now.F[0], out[1] = -now.F[1], out[2] = now.F[0] * now.ends.S1[1] - now.F[1] * now.ends.S1[0];
  out[3] = now.F[0], out[4] = now.F[1], out[5] = now.F[1] * now.ends.S2[0] - now.F[0] * now.ends.S2[1];
}

/* out = -D^T K D, 6 x 6 */
static inline void spring_product (const spring_state *s, double K[2][2], double *out) {
  for (int j = 0; j < 6; j++) {
    double KD[2] = { K[0][0] * s->D[j] + K[0][1] * s->D[6 + j], K[1][0] * s->D[j] + K[1][1] * s->D[6 + j] };
    for (int i = 0; i < 6; i++) out[6 * i + j] = -s->D[i] * KD[0] - s->D[6 + i] * KD[1];
  }
}

/* -D^T K D and terms of the rotating arms: d^2d/dphi1^2 = -(X1, Y1), d^2d/dphi2^2 = (X2, Y2), dd'/dphi1 =
 * -omega1 (X1, Y1), dd'/dphi2 = omega2 (X2, Y2).
 * K = dF/dd = (k (1 - l0/l) + c l'/l) (I - e e^T) + k e e^T + (c/l) e (d' - l' e)^T; if the ends meet, K = k I */
PER_ELEMENT (spring_force_q, spring, 36) {
  const double k = now.element->stiffness, c = now.element->damping, l0 = now.element->free_length;
  const double *S1 = now.ends.S1, *S2 = now.ends.S2, omega1 = now.ends.body1->omega, omega2 = now.ends.body2->omega;
  double across = now.inverse > 0 ? k * (1 - l0 * now.inverse) + c * now.speed * now.inverse : k, K[2][2];
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++)
      K[i][j] = across * (i == j) + (k - across) * now.e[i] * now.e[j] +
                c * now.inverse * now.e[i] * (now.ends.rate[j] - now.speed * now.e[j]);
  spring_product (&now, K, out);
  double speed_phi1 = -omega1 * (now.e[0] * S1[0] + now.e[1] * S1[1]);
  double speed_phi2 = omega2 * (now.e[0] * S2[0] + now.e[1] * S2[1]);
  for (int i = 0; i < 6; i++) {
    double along = c * (now.D[i] * now.e[0] + now.D[6 + i] * now.e[1]);
    out[6 * i + 2] -= along * speed_phi1;
    out[6 * i + 5] -= along * speed_phi2;
  }
  out[14] += now.F[0] * S1[0] + now.F[1] * S1[1];
  out[35] -= now.F[0] * S2[0] + now.F[1] * S2[1];
}

/* -D^T K D with K = dF/dd' = c e e^T */
PER_ELEMENT (spring_force_v, spring, 36) {
  const double c = now.element->damping, *e = now.e;
  double K[2][2] = { { c * e[0] * e[0], c * e[0] * e[1] }, { c * e[1] * e[0], c * e[1] * e[1] } };
  spring_product (&now, K, out);
}

PER_ELEMENT (spring_energy, spring, 1) {
  *out = now.element->stiffness * (now.l - now.element->free_length) * (now.l - now.element->free_length) / 2;
}

PER_ELEMENT (spring_loss, spring, 1) {
  *out = now.element->damping * now.speed * now.speed;
}

static const pw_field spring_fields[] = {
  { PW_AT (pw_spring, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies; one may be ground" },
  { PW_AT (pw_spring, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the end points in the bodies' frames" },
  { PW_AT (pw_spring, stiffness), PW_NUMBER, .unit = "N/m", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "force per elongation" },
  { PW_AT (pw_spring, damping), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE,
    .about = "force per rate of elongation" },
  { PW_AT (pw_spring, length), PW_NUMBER, .unit = "m", .domain = PW_NONNEGATIVE, .about = "free length" },
  { .name = NULL },
};

const pw_kind pw_kind_spring = {
  .name = "spring",
  .about = "a spring and a parallel damper between a point of one body and a point of another",
  .symbol = "stiffness: 0 0 0 .2 0 0 .23 0 .7 .29 0 -.7 .35 0 .7 .41 0 -.7 .47 0 .7 .53 0 -.7 "
            ".59 0 .7 .65 0 -.7 .71 0 .7 .77 0 -.7 .8 0 0 1 0 0; "
            "damping: 0 0 0 .1 0 0 .1 0 -1.2 .35 0 -1.2 .35 0 -.7 .7 0 -.7 .35 0 -.7 .35 0 -1.7 .7 0 -1.7; "
            "damping: .5 0 -.8 .5 0 -1.6 .5 0 -1.2 .9 0 -1.2 .9 0 0 1 0 0",
  TYPE (spring, pw_spring, spring),
  .bodies = 2,
  FORCE (spring),
  .energy = spring_energy,
  .loss = spring_loss,
};
