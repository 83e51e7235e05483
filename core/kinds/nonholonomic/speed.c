/* speed: the speed of a point P along a direction fixed in its body follows a signal u (contact.h).
 *
 *   e . v_P = u,  e = (cos, sin)(phi + psi)           psi: heading in the body          (1 nonholonomic equation)
 *   S     = [ cos(theta)  sin(theta)  -m ]      theta = phi + psi; m: the arm of P to the left of e
 *   eta   = u
 *   gamma = u' + omega (sin(theta) vx - cos(theta) vy)            so that S v' = gamma
 *
 * The force on the body at P, along e, is F = -lambda; its power is F u. */
#include "contact.h"

PREPARE (speed_prepare, pw_speed, contact) {
  *element = contact_along (definition->at, definition->heading);
  return PW_OK;
}

static void speed_gamma (const pw_batch *batch, double *out) {
  contact_gamma (batch, out);
  for (int e = 0; e < batch->count; e++) out[e] += batch->u[3 * e + 1];
}

static const pw_field speed_fields[] = {
  { PW_AT (pw_speed, body), PW_BODY, .required = 1, .about = "the body with the point" },
  { PW_AT (pw_speed, at), PW_POINT, .unit = "m", .about = "the point in the body's frame" },
  { PW_AT (pw_speed, heading), PW_NUMBER, .unit = "rad", .about = "the direction in the body's frame; 0: along its x" },
  { PW_AT (pw_speed, value), PW_SIGNAL, .unit = "m/s", .required = 1,
    .about = "velocity component, a signal with its derivative" },
  { .name = NULL },
};

const pw_kind pw_kind_speed = {
  .name = "speed",
  .symbol = "0 .6 0 0 2.2 0 0 1.7 .3 0 2.2 0 0 1.7 -.3",
  .about = "the velocity component of a point along a direction fixed in its body follows a signal",
  TYPE (speed, pw_speed, contact),
  .bodies = 1,
  .rows = 1,
  .signals = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("F", "N", "force on the body along the direction"),
  .eta = batch_signal,
  .eta_u = batch_signal_u,
  .J = contact_J,
  .gamma = speed_gamma,
  DERIVATIVES (contact),
};
