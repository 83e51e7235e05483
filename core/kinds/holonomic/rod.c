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
#include "pinwheel.h"

typedef struct {
  double s1[2], s2[2]; /* ends in the bodies' frames [m] */
  double length;       /* [m] */
} rod;

/* A rod in the current state. */
typedef struct {
  double D[2][6];
  double S1[2], S2[2];  /* arms in world axes */
  double d[2], rate[2]; /* from end 2 to end 1, and its velocity */
  double w1, w2;        /* angular velocities of the bodies */
  double L;
} rod_state;

static inline rod_state rod_at (const rod *k, const pw_configuration *A, const pw_configuration *B) {
  rod_state s = { .w1 = A->omega, .w2 = B->omega, .L = k->length };
  s.S1[0] = A->cos * k->s1[0] - A->sin * k->s1[1], s.S1[1] = A->sin * k->s1[0] + A->cos * k->s1[1];
  s.S2[0] = B->cos * k->s2[0] - B->sin * k->s2[1], s.S2[1] = B->sin * k->s2[0] + B->cos * k->s2[1];
  s.D[0][0] = s.D[1][1] = 1, s.D[0][3] = s.D[1][4] = -1;
  s.D[0][2] = -s.S1[1], s.D[1][2] = s.S1[0], s.D[0][5] = s.S2[1], s.D[1][5] = -s.S2[0];
  s.d[0] = A->x + s.S1[0] - B->x - s.S2[0], s.d[1] = A->y + s.S1[1] - B->y - s.S2[1];
  s.rate[0] = A->vx - s.w1 * s.S1[1] - B->vx + s.w2 * s.S2[1];
  s.rate[1] = A->vy + s.w1 * s.S1[0] - B->vy - s.w2 * s.S2[0];
  return s;
}

#define ROD_PARTS                                                                                            \
  const rod *k = (const rod *)b->element + e;                                                                \
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]]; \
  const rod_state s = rod_at (k, A, B)

static inline double rod_dot (const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1];
}

/* out = x^T D / L */
static inline void rod_through (const rod_state *s, const double x[2], double *out) {
  for (int j = 0; j < 6; j++) out[j] = (x[0] * s->D[0][j] + x[1] * s->D[1][j]) / s->L;
}

static int rod_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                        pw_error *error) {
  const pw_rod *d = definition;
  *(rod *)element = (rod){ { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] }, d->length };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void rod_g (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    ROD_PARTS;
    out[e] = (rod_dot (s.d, s.d) - s.L * s.L) / (2 * s.L);
  }
}

static void rod_g_size (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    ROD_PARTS;
    double x = fabs (A->x) + fabs (s.S1[0]) + fabs (B->x) + fabs (s.S2[0]);
    double y = fabs (A->y) + fabs (s.S1[1]) + fabs (B->y) + fabs (s.S2[1]);
    out[e] = (fabs (s.d[0]) * x + fabs (s.d[1]) * y) / s.L + s.L / 2;
  }
}

static void rod_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    ROD_PARTS;
    rod_through (&s, s.d, out);
  }
}

static void rod_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    ROD_PARTS;
    double turn = s.w1 * s.w1 * rod_dot (s.d, s.S1) - s.w2 * s.w2 * rod_dot (s.d, s.S2);
    out[e] = (turn - rod_dot (s.rate, s.rate)) / s.L;
  }
}

/* ((D w)^T D + d^T d(D w)/dq) / L with d(D w)/dphi1 = -(X1, Y1) w(phi1), d(D w)/dphi2 = (X2, Y2) w(phi2). */
static void rod_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    ROD_PARTS;
    const double *w = b->w + 6 * e;
    double Dw[2] = { 0, 0 };
    for (int j = 0; j < 6; j++) Dw[0] += s.D[0][j] * w[j], Dw[1] += s.D[1][j] * w[j];
    rod_through (&s, Dw, out);
    out[2] -= rod_dot (s.d, s.S1) * w[2] / s.L;
    out[5] += rod_dot (s.d, s.S2) * w[5] / s.L;
  }
}

/* dd'/dphi1 = -w1 (X1, Y1), dd'/dphi2 = w2 (X2, Y2); the derivatives of the arms are columns of D, for arm 2 negated.
 * */
static void rod_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    ROD_PARTS;
    double w1 = s.w1 * s.w1, w2 = s.w2 * s.w2;
    const double turn[2] = { s.S1[0] * w1 - s.S2[0] * w2, s.S1[1] * w1 - s.S2[1] * w2 };
    rod_through (&s, turn, out);
    out[2] += (w1 * (s.d[0] * s.D[0][2] + s.d[1] * s.D[1][2]) + 2 * s.w1 * rod_dot (s.rate, s.S1)) / s.L;
    out[5] += (w2 * (s.d[0] * s.D[0][5] + s.d[1] * s.D[1][5]) - 2 * s.w2 * rod_dot (s.rate, s.S2)) / s.L;
  }
}

static void rod_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    ROD_PARTS;
    const double twice[2] = { -2 * s.rate[0], -2 * s.rate[1] };
    rod_through (&s, twice, out);
    out[2] += 2 * s.w1 * rod_dot (s.d, s.S1) / s.L;
    out[5] -= 2 * s.w2 * rod_dot (s.d, s.S2) / s.L;
  }
}

static const pw_field rod_fields[] = {
  { PW_AT (pw_rod, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies, or ground for one of them" },
  { PW_AT (pw_rod, at), PW_POINT, .count = 2, .unit = "m", .required = 1, .about = "the ends in each body's frame" },
  { PW_AT (pw_rod, length), PW_NUMBER, .unit = "m", .required = 1, .domain = PW_POSITIVE,
    .about = "distance of the ends" },
  { .name = NULL },
};

static const pw_quantity rod_reaction[] = {
  { "F", "N", NULL, "force on the first body, away from the second: negative where the rod is pulled" },
};

const pw_kind pw_kind_rod = {
  .name = "rod",
  .about = "a massless bar keeps a point of one body and a point of another at a distance",
  .definition = sizeof (pw_rod),
  .element = sizeof (rod),
  .fields = rod_fields,
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  .reaction = rod_reaction,
  .prepare = rod_prepare,
  .g = rod_g,
  .g_size = rod_g_size,
  .J = rod_J,
  .gamma = rod_gamma,
  .jw_q = rod_jw_q,
  .gamma_q = rod_gamma_q,
  .gamma_v = rod_gamma_v,
};
