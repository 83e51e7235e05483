/* spring: a spring and a parallel damper between a point of body 1 and a point of body 2.
 *
 *   d = r1 + R(phi1) s1 - r2 - R(phi2) s2,  l = |d|,  e = d / l
 *   F = k (l - l0) e + c l' e                 -F acts on body 1 at its point, F on body 2
 *   f = -D^T F,  D = dd/dq = [ 1 0 -Y1 | -1 0 Y2 ; 0 1 X1 | 0 -1 -X2 ],  (X, Y) = R(phi) s
 *   V = k (l - l0)^2 / 2,  loss = c l'^2
 *
 * (Shabana 2001, Computational Dynamics, section 6.5.)
 * If l = 0, or 1 / l overflows, the direction is undefined: e = 0 and the force is zero.  For l0 = 0 this is the limit
 * of the smooth spring force k d; for l0 > 0 the ends should not meet. */
#include <math.h>
#include "batch.h"

typedef struct {
  double s1[2], s2[2]; /* ends in the bodies' frames [m] */
  double k, c, l0;     /* stiffness [N/m], damping [N s/m], free length [m] */
} spring;

/* A spring in the current state. */
typedef struct {
  const spring *k;
  const pw_configuration *A, *B;
  double X1, Y1, X2, Y2; /* arms in world axes */
  double d[2], rate[2];  /* from end 2 to end 1, and its velocity */
  double e[2], l, il;    /* direction, length, 1 / length; direction and 1 / length are 0 if the length is */
  double speed;          /* l' */
  double F[2];           /* pull */
} spring_state;

static inline spring_state spring_at (const pw_batch *b, int e) {
  const spring *k = (const spring *)b->element + e;
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]];
  spring_state s = { .k = k, .A = A, .B = B };
  s.X1 = A->cos * k->s1[0] - A->sin * k->s1[1], s.Y1 = A->sin * k->s1[0] + A->cos * k->s1[1];
  s.X2 = B->cos * k->s2[0] - B->sin * k->s2[1], s.Y2 = B->sin * k->s2[0] + B->cos * k->s2[1];
  s.d[0] = A->x + s.X1 - B->x - s.X2, s.d[1] = A->y + s.Y1 - B->y - s.Y2;
  s.rate[0] = A->vx - A->omega * s.Y1 - B->vx + B->omega * s.Y2;
  s.rate[1] = A->vy + A->omega * s.X1 - B->vy - B->omega * s.X2;
  s.l = hypot (s.d[0], s.d[1]);
  s.il = s.l > 1e-150 ? 1 / s.l : 0;
  s.e[0] = s.d[0] * s.il, s.e[1] = s.d[1] * s.il;
  s.speed = s.e[0] * s.rate[0] + s.e[1] * s.rate[1];
  double pull = k->k * (s.l - k->l0) + k->c * s.speed;
  s.F[0] = pull * s.e[0], s.F[1] = pull * s.e[1];
  return s;
}

PREPARE (spring_prepare, pw_spring, spring) {
  *k = (spring){ { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] }, d->stiffness, d->damping, d->length };
}

PER_ELEMENT (spring_force, spring, 6) {
  out[0] = -x.F[0], out[1] = -x.F[1], out[2] = x.F[0] * x.Y1 - x.F[1] * x.X1;
  out[3] = x.F[0], out[4] = x.F[1], out[5] = x.F[1] * x.X2 - x.F[0] * x.Y2;
}

/* out = -D^T K W, 6 x 6; K = dF/dd or dF/dd', W = Jacobian of d or d'. */
static void spring_product (double *out, const double D[2][6], const double K[2][2], const double W[2][6]) {
  for (int j = 0; j < 6; j++) {
    double x = K[0][0] * W[0][j] + K[0][1] * W[1][j], y = K[1][0] * W[0][j] + K[1][1] * W[1][j];
    for (int i = 0; i < 6; i++) out[6 * i + j] = -D[0][i] * x - D[1][i] * y;
  }
}

/* dF/dd = (k (1 - l0/l) + c l'/l) (1 - e e^T) + k e e^T + (c/l) e (d' - l' e)^T */
static void spring_slope (const spring_state *s, double K[2][2]) {
  const spring *k = s->k;
  double across = s->il > 0 ? k->k * (1 - k->l0 * s->il) + k->c * s->speed * s->il : k->k;
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++)
      K[i][j] = across * (i == j) + (k->k - across) * s->e[i] * s->e[j] +
                k->c * s->il * s->e[i] * (s->rate[j] - s->speed * s->e[j]);
}

/* Includes the rotation of the arms: d^2d/dphi1^2 = -(X1, Y1), d^2d/dphi2^2 = (X2, Y2), dd'/dphi = -w (X, Y). */
PER_ELEMENT (spring_force_q, spring, 36) {
  double w1 = x.A->omega, w2 = x.B->omega;
  double K[2][2], turn[2] = { -w1 * (x.e[0] * x.X1 + x.e[1] * x.Y1), w2 * (x.e[0] * x.X2 + x.e[1] * x.Y2) };
  const double D[2][6] = { { 1, 0, -x.Y1, -1, 0, x.Y2 }, { 0, 1, x.X1, 0, -1, -x.X2 } };
  spring_slope (&x, K);
  spring_product (out, D, (const double (*)[2])K, D);
  for (int i = 0; i < 6; i++) {
    double along = x.k->c * (D[0][i] * x.e[0] + D[1][i] * x.e[1]);
    out[6 * i + 2] -= along * turn[0];
    out[6 * i + 5] -= along * turn[1];
  }
  out[14] += x.F[0] * x.X1 + x.F[1] * x.Y1;
  out[35] -= x.F[0] * x.X2 + x.F[1] * x.Y2;
}

PER_ELEMENT (spring_force_v, spring, 36) {
  const double D[2][6] = { { 1, 0, -x.Y1, -1, 0, x.Y2 }, { 0, 1, x.X1, 0, -1, -x.X2 } }, c = x.k->c;
  const double K[2][2] = { { c * x.e[0] * x.e[0], c * x.e[0] * x.e[1] }, { c * x.e[1] * x.e[0], c * x.e[1] * x.e[1] } };
  spring_product (out, D, K, D);
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
  .force = spring_force,
  .force_q = spring_force_q,
  .force_v = spring_force_v,
  .energy = spring_energy,
  .loss = spring_loss,
};
