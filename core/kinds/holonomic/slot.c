/* slot: a point of body 1 stays on a line of body 2.
 *
 *   g = n . (r1 + R(phi1) s1 - r2 - R(phi2) s2) = 0,  n: normal of the line, to the left of its heading  (1 holonomic)
 *
 * line.h has the derivatives.  The force on body 1 is -lambda along n, at its point; body 2 receives the opposite. */
#include "line.h"

PREPARE (slot_prepare, pw_slot, line) {
  *element = line_make (definition->at, definition->heading);
  return PW_OK;
}

static const pw_field slot_fields[] = {
  { PW_AT (pw_slot, body), PW_BODY, .count = 2, .required = 1,
    .about = "the body with the point and the body with the line; one may be ground" },
  LINE_FIELDS (pw_slot),
  { .name = NULL },
};

const pw_kind pw_kind_slot = {
  .name = "slot",
  .about = "a point of one body stays on a line of another",
  .symbol = "1 -inf .4 1 inf .4; 1 -inf -.4 1 inf -.4; o 0 0 0 .3; ground: h -.4",
  TYPE (slot, pw_slot, line),
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  REACTION ("N", "N", "force on the first body, to the left of the line's heading"),
  POSITION (line),
  CONSTRAINT (line),
  .J_gamma = line_J_gamma,
};
