/* pin: a point of body 1 and a point of body 2 coincide.
 *
 *   g     = r1 + R(phi1) s1 - r2 - R(phi2) s2 = 0                 (2 holonomic equations, world x and y)
 *   G     = [ 1 0 -Y1 | -1 0  Y2 ]       with (X, Y) = R(phi) s, the arm in world axes
 *           [ 0 1  X1 |  0 -1 -X2 ]
 *   gamma = (X1, Y1) w1^2 - (X2, Y2) w2^2                         so that G a = gamma
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3.)
 * The force in world axes is -lambda on body 1, lambda on body 2. */
#include <math.h>
#include "batch.h"

typedef struct {
  double s1[2], s2[2]; /* arms in the bodies' frames [m] */
} pin;

/* A pin in the current state: both arms in world axes. */
typedef struct {
  const pw_configuration *A, *B;
  const double *w;
  double X1, Y1, X2, Y2;
} pin_state;

static inline pin_state pin_at (const pw_batch *b, int e) {
  const pin *k = (const pin *)b->element + e;
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]];
  pin_state x = { .A = A, .B = B, .w = batch_w (b, e) };
  x.X1 = A->cos * k->s1[0] - A->sin * k->s1[1], x.Y1 = A->sin * k->s1[0] + A->cos * k->s1[1];
  x.X2 = B->cos * k->s2[0] - B->sin * k->s2[1], x.Y2 = B->sin * k->s2[0] + B->cos * k->s2[1];
  return x;
}

PREPARE (pin_prepare, pw_pin, pin) {
  *k = (pin){ { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] } };
}

PER_ELEMENT (pin_g, pin, 2) {
  out[0] = x.A->x + x.X1 - x.B->x - x.X2;
  out[1] = x.A->y + x.Y1 - x.B->y - x.Y2;
}

PER_ELEMENT (pin_g_size, pin, 2) {
  out[0] = fabs (x.A->x) + fabs (x.X1) + fabs (x.B->x) + fabs (x.X2);
  out[1] = fabs (x.A->y) + fabs (x.Y1) + fabs (x.B->y) + fabs (x.Y2);
}

PER_ELEMENT (pin_J, pin, 12) {
  out[0] = 1, out[1] = 0, out[2] = -x.Y1, out[3] = -1, out[4] = 0, out[5] = x.Y2;
  out[6] = 0, out[7] = 1, out[8] = x.X1, out[9] = 0, out[10] = -1, out[11] = -x.X2;
}

PER_ELEMENT (pin_gamma, pin, 2) {
  double w1 = x.A->omega * x.A->omega, w2 = x.B->omega * x.B->omega;
  out[0] = x.X1 * w1 - x.X2 * w2;
  out[1] = x.Y1 * w1 - x.Y2 * w2;
}

/* Sets the two angle columns of a 2 x 6 block, the others to zero. */
static inline void pin_angles (double *out, double x1, double y1, double x2, double y2) {
  for (int i = 0; i < 12; i++) out[i] = 0;
  out[2] = x1, out[8] = y1, out[5] = x2, out[11] = y2;
}

PER_ELEMENT (pin_jw_q, pin, 12) {
  double w1 = x.w[2], w2 = x.w[5];
  pin_angles (out, -x.X1 * w1, -x.Y1 * w1, x.X2 * w2, x.Y2 * w2);
}

PER_ELEMENT (pin_gamma_q, pin, 12) {
  double w1 = x.A->omega * x.A->omega, w2 = x.B->omega * x.B->omega;
  pin_angles (out, -x.Y1 * w1, x.X1 * w1, x.Y2 * w2, -x.X2 * w2);
}

PER_ELEMENT (pin_gamma_v, pin, 12) {
  double w1 = 2 * x.A->omega, w2 = 2 * x.B->omega;
  pin_angles (out, x.X1 * w1, x.Y1 * w1, -x.X2 * w2, -x.Y2 * w2);
}

static const pw_field pin_fields[] = {
  { PW_AT (pw_pin, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies; one may be ground" },
  { PW_AT (pw_pin, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the common point in each body's frame" },
  { .name = NULL },
};

static const pw_quantity pin_reaction[] = {
  { "Fx", "N", NULL, "force on the first body, world x" },
  { "Fy", "N", NULL, "force on the first body, world y" },
};

const pw_kind pw_kind_pin = {
  .name = "pin",
  .about = "a point of one body and a point of another coincide (revolute joint, hinge)",
  .symbol = "o 0 0 0 .4",
  DEFINITION (pw_pin, pin_fields),
  ELEMENT (pin, pin_prepare),
  .bodies = 2,
  .rows = 2,
  .level = PW_HOLONOMIC,
  .reaction = pin_reaction,
  .g = pin_g,
  .g_size = pin_g_size,
  .J = pin_J,
  .gamma = pin_gamma,
  .jw_q = pin_jw_q,
  .gamma_q = pin_gamma_q,
  .gamma_v = pin_gamma_v,
};
