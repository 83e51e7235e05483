/* friction: a torque opposing the rotation of body 1 relative to body 2, as in a pin.
 *
 *   f = (0, 0, -T | 0, 0, T) = -T S,  S = [ 0 0 1 | 0 0 -1 ],  loss = T v >= 0       v = omega1 - omega2, T = F(v)
 *
 * F(v) as in coulomb.h; its limit is the friction coefficient times radius times load.  Exact friction is the
 * nonholonomic equation S q' = 0 and the viscous torque. */
#include "coulomb.h"

/* Friction in the current state; dv/dq = 0. */
typedef struct {
  const coulomb *law;
  double v, S[6], v_q[6];
} friction_state;

static inline friction_state friction_at (const pw_batch *batch, int e) {
  return (friction_state){ (const coulomb *)batch->element + e,
                           batch_body (batch, 2 * e)->omega - batch_body (batch, 2 * e + 1)->omega,
                           .S = { [2] = 1, [5] = -1 } };
}

PREPARE (friction_prepare, pw_friction, coulomb) {
  return coulomb_make_smooth (definition->viscous, &definition->limit, &definition->limit_sliding, definition->speed,
                              element, error);
}

PREPARE (friction_prepare_exact, pw_friction, coulomb) {
  return coulomb_make_exact (definition->viscous, &definition->limit, &definition->limit_sliding, element, error);
}

COULOMB (friction, 6)
EXACT_COULOMB (friction, pw_friction)

static const pw_field friction_fields[] = {
  BODIES_FIELD (pw_friction),
  { PW_AT (pw_friction, viscous), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per angular velocity" },
  { PW_AT (pw_friction, speed), PW_NUMBER, .unit = "rad/s", .domain = PW_NONNEGATIVE,
    .about = "below about this angular velocity the Coulomb torque is smoothed; left out: it is exact, and holds" },
  { PW_AT (pw_friction, limit), PW_SIGNAL, .limit = 1, .unit = "N m", .about = "Coulomb torque" },
  { PW_AT (pw_friction, limit_sliding), PW_SIGNAL, .limit = 1, .unit = "N m",
    .about = "exact Coulomb torque while sliding, at most the limit; left out: the limit" },
  { .name = NULL },
};

const pw_kind pw_kind_friction = {
  .name = "friction",
  .about = "a viscous and a Coulomb torque that oppose the rotation of one body relative to another",
  TYPE (friction, pw_friction, coulomb),
  .bodies = 2,
  .force = friction_force,
  .force_v = friction_force_v,
  .saturation = friction_saturation,
  .loss = friction_loss,
  .exact = &pw_kind_dry_friction,
  .is_exact = friction_is_exact,
};

const pw_kind pw_kind_dry_friction = {
  .name = "friction",
  .about = "a viscous torque, and a Coulomb torque that holds two bodies together up to a limit",
  .definition = sizeof (pw_friction),
  .fields = friction_fields,
  .element = sizeof (coulomb),
  .prepare = friction_prepare_exact,
  .bodies = 2,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("T", "N m", "Coulomb torque on the first body"),
  .J = friction_exact_J,
  .limits = friction_limits,
  .force = friction_force,
  .force_v = friction_force_v,
  .loss = friction_exact_loss,
};
