/* pin: a point of body 1 and a point of body 2 coincide.
 *
 *   g = d = r1 + R(phi1) s1 - r2 - R(phi2) s2 = 0                 (2 holonomic equations, world x and y)
 *
 * points.h has the derivatives; G = D.  The force in world axes is -lambda on body 1, lambda on body 2. */
#include "points.h"

PREPARE (pin_prepare, pw_pin, points) {
  *element = points_make (definition->at);
  return PW_OK;
}

static const pw_field pin_fields[] = {
  BODIES_FIELD (pw_pin),
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
  TYPE (pin, pw_pin, points),
  .bodies = 2,
  .rows = 2,
  .level = PW_HOLONOMIC,
  .reaction = pin_reaction,
  POSITION (points),
  CONSTRAINT (points),
  .J_gamma = points_J_gamma,
};
