/* wheel: a knife edge; the contact point P has no velocity perpendicular to the heading (contact.h).
 *
 *   n . v_P = 0,  n = (-sin, cos)(phi + psi)          psi: heading in the body          (1 nonholonomic equation)
 *   S     = [ -sin(theta)  cos(theta)  l ]      theta = phi + psi; l: arm of P along the heading
 *   gamma = omega (cos(theta) vx + sin(theta) vy)                 so that S v' = gamma
 *
 * The lateral force on the body, along n, is N = -lambda.  With a grip, |lambda| is at most the grip; beyond it the
 * wheel slides and loses lambda n . v_P. */
#include "contact.h"

PREPARE (wheel_prepare, pw_wheel, contact) {
  *element = contact_across (definition->at, definition->heading);
  return limit_check ("grip", &definition->grip, &definition->grip_sliding, error);
}

GRIP (wheel, pw_wheel, contact_at (batch, e))

static const pw_field wheel_fields[] = {
  { PW_AT (pw_wheel, body), PW_BODY, .required = 1, .about = "the body with the wheel" },
  CONTACT_FIELDS (pw_wheel),
  GRIP_FIELDS (pw_wheel),
  { .name = NULL },
};

const pw_kind pw_kind_wheel = {
  .name = "wheel",
  .about = "a knife edge: a point of the body moves only along a heading fixed in the body",
  .symbol = "0 -1.6 -.2 0 1.6 -.2 0 1.6 .2 0 -1.6 .2 0 -1.6 -.2",
  TYPE (wheel, pw_wheel, contact),
  .bodies = 1,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("N", "N", "lateral force on the body, to the left of the heading"),
  CONSTRAINT (contact),
  .J_gamma = contact_J_gamma,
  .limits = wheel_limits,
  .loss = wheel_loss,
  .contact = contact_place,
};
