/* rod: a massless bar keeps a point of body 1 and a point of body 2 at the distance L.  rope: at most at L.
 *
 * rod.h has the equation.  -lambda [N] acts on body 1, positive away from body 2; body 2 receives the opposite. */
#include "rod.h"

PREPARE (rod_prepare, pw_rod, rod) {
  *element = (rod){ points_make (definition->at), definition->length };
  return PW_OK;
}

PREPARE (rope_prepare, pw_rope, rod) {
  *element = (rod){ points_make (definition->at), definition->length };
  return PW_OK;
}

/* Fields of both definitions; what: the meaning of the length. */
#define ROD_FIELDS(type, what)                                                                               \
  BODIES_FIELD (type), { PW_AT (type, at), PW_POINT,      .count = 2,                                        \
                         .unit = "m",      .required = 1, .about = "the end points in the bodies' frames" }, \
  {                                                                                                          \
    PW_AT (type, length), PW_NUMBER, .unit = "m", .required = 1, .domain = PW_POSITIVE, .about = what        \
  }

static void rope_limits (const void *definition, pw_bounds *limit) {
  limit->least = 0;
  limit->restitution = ((const pw_rope *)definition)->restitution;
}

static const pw_field rope_fields[] = {
  ROD_FIELDS (pw_rope, "largest distance between the end points"),
  { PW_AT (pw_rope, restitution), PW_NUMBER, .domain = PW_FRACTION,
    .about = "velocity after the rope has become taut over that before it" },
  { .name = NULL },
};

static const pw_field rod_fields[] = {
  ROD_FIELDS (pw_rod, "distance between the end points"),
  { .name = NULL },
};

const pw_kind pw_kind_rod = {
  .name = "rod",
  .about = "a massless bar keeps a point of one body at a fixed distance from a point of another",
  .symbol = "0 0 0 1 0 0; o 0 0 0 .3; o 1 0 0 .3",
  TYPE (rod, pw_rod, rod),
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  REACTION ("F", "N", "force on the first body, away from the second; negative: tension"),
  POSITION (rod),
  CONSTRAINT (rod),
  .J_gamma = rod_J_gamma,
};

const pw_kind pw_kind_rope = {
  .name = "rope",
  .about = "a massless rope: a point of one body is at most at a given distance from a point of another",
  .symbol = "0 0 0 1 0 0",
  TYPE (rope, pw_rope, rod),
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  REACTION ("F", "N", "force on the first body, away from the second: minus the tension"),
  POSITION (rod),
  CONSTRAINT (rod),
  .J_gamma = rod_J_gamma,
  .limits = rope_limits,
};
