/* rolling-resistance: a force along a heading that opposes the velocity of the contact point P in that direction.
 *
 *   F = L tanh (v / v0),  v = S (vx, vy, omega)                    v: speed of P along the heading (coulomb.h)
 *   S = [ cos(theta)  sin(theta)  -m ]          theta = phi + psi, psi: heading in the body; m: arm of P to its left
 *   f = -F S,  loss = F v >= 0
 *
 * (Wong 2008, Theory of Ground Vehicles, section 1.2.)
 * A wheel at the same point provides the lateral force. */
#include <string.h>
#include "contact.h"
#include "coulomb.h"

typedef struct {
  contact along;
  coulomb law;
} resistance;

/* An element in the current state; v_q = dv/dq. */
typedef struct {
  const coulomb *law;
  double v, S[3], v_q[3];
} resistance_state;

static inline resistance_state resistance_at (const pw_batch *batch, int e) {
  const resistance *element = (const resistance *)batch->element + e;
  contact_state along = contact_of (element->along, batch, e);
  resistance_state now = { &element->law, .v = contact_speed (&along) };
  contact_J_one (along, now.S);
  now.v_q[2] = contact_speed_phi (&along);
  return now;
}

PREPARE (resistance_prepare, pw_rolling_resistance, resistance) {
  element->along = contact_along (definition->at, definition->heading);
  return coulomb_make (0, definition->limit, definition->speed, &element->law, error);
}

/* -d(F S)/dphi with dS/dphi = (-sin(theta), cos(theta), 0). */
PER_ELEMENT (resistance_force_q, resistance, 9) {
  double F = coulomb_force (now.law, now.v), F_phi = coulomb_slope (now.law, now.v) * now.v_q[2];
  memset (out, 0, 9 * sizeof *out);
  out[2] = F * now.S[1] - F_phi * now.S[0];
  out[5] = -F * now.S[0] - F_phi * now.S[1];
  out[8] = -F_phi * now.S[2];
}

COULOMB (resistance, 3)

static const pw_field resistance_fields[] = {
  { PW_AT (pw_rolling_resistance, body), PW_BODY, .required = 1, .about = "the body that rolls" },
  CONTACT_FIELDS (pw_rolling_resistance),
  { PW_AT (pw_rolling_resistance, limit), PW_NUMBER, .unit = "N", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "the force while rolling: coefficient times normal load" },
  { PW_AT (pw_rolling_resistance, speed), PW_NUMBER, .unit = "m/s", .required = 1, .domain = PW_POSITIVE,
    .about = "below about this speed the force is smoothed" },
  { .name = NULL },
};

const pw_kind pw_kind_rolling_resistance = {
  .name = "rolling-resistance",
  .about = "a force of given magnitude that opposes the motion of a point along a heading",
  TYPE (resistance, pw_rolling_resistance, resistance),
  .bodies = 1,
  FORCE (resistance),
  .saturation = resistance_saturation,
  .loss = resistance_loss,
};
