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
#include "pinwheel.h"

typedef struct {
  double s1[2], s2[2]; /* arms in the bodies' frames [m] */
} pin;

/* Both arms in world axes. */
typedef struct {
  double X1, Y1, X2, Y2;
} pin_arms;

static inline pin_arms pin_turn (const pin *p, const pw_configuration *A, const pw_configuration *B) {
  return (pin_arms){ A->cos * p->s1[0] - A->sin * p->s1[1], A->sin * p->s1[0] + A->cos * p->s1[1],
                     B->cos * p->s2[0] - B->sin * p->s2[1], B->sin * p->s2[0] + B->cos * p->s2[1] };
}

/* Element e: both configurations and arms. */
#define PIN_PARTS                                                                                            \
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]]; \
  const pin_arms s = pin_turn ((const pin *)b->element + e, A, B);                                           \
  (void)A, (void)B, (void)s

static int pin_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                        pw_error *error) {
  const pw_pin *d = definition;
  *(pin *)element = (pin){ { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] } };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void pin_g (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 2) {
    PIN_PARTS;
    out[0] = A->x + s.X1 - B->x - s.X2;
    out[1] = A->y + s.Y1 - B->y - s.Y2;
  }
}

static void pin_g_size (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 2) {
    PIN_PARTS;
    out[0] = fabs (A->x) + fabs (s.X1) + fabs (B->x) + fabs (s.X2);
    out[1] = fabs (A->y) + fabs (s.Y1) + fabs (B->y) + fabs (s.Y2);
  }
}

static void pin_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 12) {
    PIN_PARTS;
    out[0] = 1, out[1] = 0, out[2] = -s.Y1, out[3] = -1, out[4] = 0, out[5] = s.Y2;
    out[6] = 0, out[7] = 1, out[8] = s.X1, out[9] = 0, out[10] = -1, out[11] = -s.X2;
  }
}

static void pin_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 2) {
    PIN_PARTS;
    double w1 = A->omega * A->omega, w2 = B->omega * B->omega;
    out[0] = s.X1 * w1 - s.X2 * w2;
    out[1] = s.Y1 * w1 - s.Y2 * w2;
  }
}

/* Sets the two angle columns of a 2 x 6 block, the others to zero. */
static inline void pin_angles (double *out, double x1, double y1, double x2, double y2) {
  for (int i = 0; i < 12; i++) out[i] = 0;
  out[2] = x1, out[8] = y1, out[5] = x2, out[11] = y2;
}

static void pin_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 12) {
    PIN_PARTS;
    double w1 = b->w[6 * e + 2], w2 = b->w[6 * e + 5];
    pin_angles (out, -s.X1 * w1, -s.Y1 * w1, s.X2 * w2, s.Y2 * w2);
  }
}

static void pin_gamma_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 12) {
    PIN_PARTS;
    double w1 = A->omega * A->omega, w2 = B->omega * B->omega;
    pin_angles (out, -s.Y1 * w1, s.X1 * w1, s.Y2 * w2, -s.X2 * w2);
  }
}

static void pin_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 12) {
    PIN_PARTS;
    double w1 = 2 * A->omega, w2 = 2 * B->omega;
    pin_angles (out, s.X1 * w1, s.Y1 * w1, -s.X2 * w2, -s.Y2 * w2);
  }
}

static const pw_field pin_fields[] = {
  { PW_AT (pw_pin, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies, or ground for one of them" },
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
  .definition = sizeof (pw_pin),
  .element = sizeof (pin),
  .fields = pin_fields,
  .bodies = 2,
  .rows = 2,
  .level = PW_HOLONOMIC,
  .reaction = pin_reaction,
  .prepare = pin_prepare,
  .g = pin_g,
  .g_size = pin_g_size,
  .J = pin_J,
  .gamma = pin_gamma,
  .jw_q = pin_jw_q,
  .gamma_q = pin_gamma_q,
  .gamma_v = pin_gamma_v,
};
