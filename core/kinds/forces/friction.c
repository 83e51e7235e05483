/* friction: a torque opposing the rotation of body 1 relative to body 2, as in a pin.
 *
 *   f = (0, 0, -T | 0, 0, T),  loss = T w >= 0,  w = w1 - w2            T(w) as F in coulomb.h
 *
 * The limit is the friction coefficient times radius times load. */
#include "coulomb.h"

/* Friction in the current state: its law and the relative angular velocity. */
typedef struct {
  const coulomb *k;
  double w;
} friction_state;

static inline friction_state friction_at (const pw_batch *b, int e) {
  return (friction_state){ (const coulomb *)b->element + e,
                           batch_body (b, e, 2, 0)->omega - batch_body (b, e, 2, 1)->omega };
}

PREPARE (friction_prepare, pw_friction, coulomb) {
  return coulomb_make (d->viscous, d->limit, d->speed, k, error);
}

PER_ELEMENT (friction_force, friction, 6) {
  opposite_moments (-coulomb_force (x.k, x.w), out);
}

PER_ELEMENT (friction_force_v, friction, 36) {
  opposite_moments_block (coulomb_slope (x.k, x.w), out);
}

PER_ELEMENT (friction_saturation, friction, 12) {
  out[8] = out[11] = coulomb_saturation (x.k, x.w, 1);
}

PER_ELEMENT (friction_loss, friction, 1) {
  *out = coulomb_force (x.k, x.w) * x.w;
}

static const pw_field friction_fields[] = {
  { PW_AT (pw_friction, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies; one may be ground" },
  { PW_AT (pw_friction, viscous), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per angular velocity" },
  { PW_AT (pw_friction, limit), PW_NUMBER, .unit = "N m", .domain = PW_NONNEGATIVE, .about = "Coulomb torque" },
  { PW_AT (pw_friction, speed), PW_NUMBER, .unit = "rad/s", .domain = PW_NONNEGATIVE,
    .about = "below about this angular velocity the Coulomb torque is smoothed; required with a limit" },
  { .name = NULL },
};

const pw_kind pw_kind_friction = {
  .name = "friction",
  .about = "a viscous and a Coulomb torque that oppose the rotation of one body relative to another",
  DEFINITION (pw_friction, friction_fields),
  ELEMENT (coulomb, friction_prepare),
  .bodies = 2,
  .force = friction_force,
  .force_v = friction_force_v,
  .saturation = friction_saturation,
  .loss = friction_loss,
};
