/* friction: a torque against the turning of body 1 on body 2, as in a pin; viscous, and Coulomb smoothed at rest.
 *
 *   T = c w + L tanh (w / w0),  w = w1 - w2
 *   f = (0, 0, -T | 0, 0, T),  loss = T w >= 0
 *
 * (Andersson, Soderberg & Bjorklund 2007, Tribology International 40, 580-587, for the smoothing by tanh.)
 * The limit L is a number, a Coulomb coefficient times radius times load: forces do not see multipliers.  Being smooth,
 * it does not stick; under a torque M < L the bodies creep at w0 atanh (M / L). */
#include <math.h>
#include <string.h>
#include "pinwheel.h"

typedef struct {
  double viscous, limit; /* [N m s/rad], [N m] */
  double inverse;        /* 1 / w0 [s/rad]; 0 without a limit */
} friction;

#define FRICTION_PARTS                                                            \
  const friction *k = (const friction *)b->element + e;                           \
  const pw_pose *A = &b->pose[b->body[2 * e]], *B = &b->pose[b->body[2 * e + 1]]; \
  const double w = A->omega - B->omega, y = tanh (w * k->inverse)

static int friction_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_own *own,
                             pw_error *error) {
  const pw_friction *d = definition;
  *(friction *)element = (friction){ d->viscous, d->limit, d->limit > 0 ? 1 / d->speed : 0 };
  (void)bodies, (void)own;
  if (d->limit > 0 && !(d->speed > 0))
    return pw_fail (error, PW_INPUT, "speed = %g: expected > 0, since below it the limit is smoothed", d->speed);
  return PW_OK;
}

static void friction_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    FRICTION_PARTS;
    double T = k->viscous * w + k->limit * y;
    out[0] = out[1] = out[3] = out[4] = 0, out[2] = -T, out[5] = T;
  }
}

static void friction_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 36) {
    FRICTION_PARTS;
    double slope = k->viscous + k->limit * k->inverse * (1 - y * y);
    memset (out, 0, 36 * sizeof *out);
    out[14] = out[35] = -slope, out[17] = out[32] = slope;
  }
}

static void friction_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    FRICTION_PARTS;
    out[e] = (k->viscous * w + k->limit * y) * w;
  }
}

static const pw_field friction_fields[] = {
  { PW_AT (pw_friction, body), PW_BODY, .count = 2, .required = 1,
    .about = "the two bodies, or ground for one of them" },
  { PW_AT (pw_friction, viscous), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per rate" },
  { PW_AT (pw_friction, limit), PW_NUMBER, .unit = "N m", .domain = PW_NONNEGATIVE, .about = "Coulomb torque" },
  { PW_AT (pw_friction, speed), PW_NUMBER, .unit = "rad/s", .domain = PW_NONNEGATIVE,
    .about = "below about this rate the Coulomb torque is smoothed; needed with a limit" },
  { .name = NULL },
};

const pw_kind pw_kind_friction = {
  .name = "friction",
  .about = "a viscous and a Coulomb torque against the turning of a body on another",
  .definition = sizeof (pw_friction),
  .element = sizeof (friction),
  .fields = friction_fields,
  .bodies = 2,
  .level = PW_FORCE,
  .prepare = friction_prepare,
  .force = friction_force,
  .force_v = friction_force_v,
  .loss = friction_loss,
};
