/* spring: a spring and a parallel damper between a point of body 1 and a point of body 2.
 *
 *   d = r1 + R(phi1) s1 - r2 - R(phi2) s2,  l = |d|,  e = d / l       (points.h)
 *   F = k (l - l0) e + c l' e                 -F acts on body 1 at its point, F on body 2
 *   f = -D^T F,  D = dd/dq;  (X, Y): arms in world axes
 *   V = k (l - l0)^2 / 2,  loss = c l'^2
 *
 * (Shabana 2001, Computational Dynamics, section 6.5.)
 * If l = 0, or 1 / l overflows, the direction is undefined: e = 0 and the force is zero.  For l0 = 0 this is the limit
 * of the smooth spring force k d; for l0 > 0 the ends should not meet. */
#include "points.h"

typedef struct {
  points points;
  double k, c, l0; /* stiffness [N/m], damping [N s/m], free length [m] */
} spring;

/* A spring in the current state. */
typedef struct {
  const spring *k;
  points_state p;
  double D[12];       /* 2 x 6 */
  double e[2], l, il; /* direction, length, 1 / length; direction and 1 / length are 0 if the length is */
  double speed;       /* l' */
  double F[2];        /* pull */
} spring_state;

static inline spring_state spring_at (const pw_batch *b, int e) {
  const spring *k = (const spring *)b->element + e;
  spring_state x = { .k = k, .p = points_of (&k->points, b, e) };
  points_J_one (x.p, x.D);
  x.l = hypot (x.p.d[0], x.p.d[1]);
  x.il = x.l > 1e-150 ? 1 / x.l : 0;
  x.e[0] = x.p.d[0] * x.il, x.e[1] = x.p.d[1] * x.il;
  x.speed = x.e[0] * x.p.rate[0] + x.e[1] * x.p.rate[1];
  double pull = k->k * (x.l - k->l0) + k->c * x.speed;
  x.F[0] = pull * x.e[0], x.F[1] = pull * x.e[1];
  return x;
}

PREPARE (spring_prepare, pw_spring, spring) {
  *k = (spring){ points_make (d->at), d->stiffness, d->damping, d->length };
  return PW_OK;
}

PER_ELEMENT (spring_force, spring, 6) {
  out[0] = -x.F[0], out[1] = -x.F[1], out[2] = x.F[0] * x.p.S1[1] - x.F[1] * x.p.S1[0];
  out[3] = x.F[0], out[4] = x.F[1], out[5] = x.F[1] * x.p.S2[0] - x.F[0] * x.p.S2[1];
}

/* out = -D^T K D, 6 x 6; K = dF/dd or dF/dd'. */
static inline void spring_product (const spring_state *s, double K[2][2], double *out) {
  for (int j = 0; j < 6; j++) {
    double x = K[0][0] * s->D[j] + K[0][1] * s->D[6 + j], y = K[1][0] * s->D[j] + K[1][1] * s->D[6 + j];
    for (int i = 0; i < 6; i++) out[6 * i + j] = -s->D[i] * x - s->D[6 + i] * y;
  }
}

/* Includes the rotation of the arms: d^2d/dphi1^2 = -(X1, Y1), d^2d/dphi2^2 = (X2, Y2), dd'/dphi = -w (X, Y).
 * K = dF/dd = (k (1 - l0/l) + c l'/l) (1 - e e^T) + k e e^T + (c/l) e (d' - l' e)^T */
PER_ELEMENT (spring_force_q, spring, 36) {
  const spring *k = x.k;
  const double *S1 = x.p.S1, *S2 = x.p.S2, w1 = x.p.A->omega, w2 = x.p.B->omega;
  double across = x.il > 0 ? k->k * (1 - k->l0 * x.il) + k->c * x.speed * x.il : k->k, K[2][2];
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++)
      K[i][j] = across * (i == j) + (k->k - across) * x.e[i] * x.e[j] +
                k->c * x.il * x.e[i] * (x.p.rate[j] - x.speed * x.e[j]);
  spring_product (&x, K, out);
  double turn1 = -w1 * (x.e[0] * S1[0] + x.e[1] * S1[1]), turn2 = w2 * (x.e[0] * S2[0] + x.e[1] * S2[1]);
  for (int i = 0; i < 6; i++) {
    double along = k->c * (x.D[i] * x.e[0] + x.D[6 + i] * x.e[1]);
    out[6 * i + 2] -= along * turn1;
    out[6 * i + 5] -= along * turn2;
  }
  out[14] += x.F[0] * S1[0] + x.F[1] * S1[1];
  out[35] -= x.F[0] * S2[0] + x.F[1] * S2[1];
}

PER_ELEMENT (spring_force_v, spring, 36) {
  const double c = x.k->c, *e = x.e;
  double K[2][2] = { { c * e[0] * e[0], c * e[0] * e[1] }, { c * e[1] * e[0], c * e[1] * e[1] } };
  spring_product (&x, K, out);
}

PER_ELEMENT (spring_energy, spring, 1) {
  *out = x.k->k * (x.l - x.k->l0) * (x.l - x.k->l0) / 2;
}

PER_ELEMENT (spring_loss, spring, 1) {
  *out = x.k->c * x.speed * x.speed;
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
  DEFINITION (pw_spring, spring_fields),
  ELEMENT (spring, spring_prepare),
  .bodies = 2,
  FORCE (spring),
  .energy = spring_energy,
  .loss = spring_loss,
};
