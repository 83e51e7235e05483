/* gear: the angles of two bodies relative to a third, the carrier, keep a ratio i.
 *
 *   g = (phi1 - phi3) - i (phi2 - phi3) - c = 0                    (1 holonomic equation, linear)
 *   G = [ 0 0 1 | 0 0 -i | 0 0 i-1 ],  gamma = 0
 *
 * (Willis 1870, Principles of Mechanism.)
 * External gears of radii R1 and R2 have i = -R2 / R1, a gear inside a ring i = R2 / R1.  The axles need pins.  The
 * moments are -lambda on body 1, i lambda on body 2, (1 - i) lambda on the carrier. */
#include <string.h>
#include "batch.h"

typedef struct {
  double ratio;  /* i */
  double offset; /* c [rad] */
} gear;

PREPARE (gear_prepare, pw_gear, gear) {
  double phi3 = bodies[2]->start[2];
  double initial = bodies[0]->start[2] - phi3 - definition->ratio * (bodies[1]->start[2] - phi3);
  *element = (gear){ definition->ratio, definition->from == PW_GEAR_START ? initial : definition->offset };
  if (definition->ratio == 0)
    return pw_fail (error, PW_INPUT, "ratio = 0: expected another number, positive or negative");
  if (definition->offset != 0 && definition->from == PW_GEAR_START)
    return pw_fail (error, PW_INPUT, "offset = %g: has no effect without from: offset", definition->offset);
  return PW_OK;
}

typedef struct {
  const gear *element;
  double phi1, phi2, phi3;
} gear_state;

static inline gear_state gear_at (const pw_batch *batch, int e) {
  return (gear_state){ (const gear *)batch->element + e, batch_body (batch, 3 * e)->phi,
                       batch_body (batch, 3 * e + 1)->phi, batch_body (batch, 3 * e + 2)->phi };
}

PER_ELEMENT (gear_g, gear, 1) {
  *out = now.phi1 - now.phi3 - now.element->ratio * (now.phi2 - now.phi3) - now.element->offset;
}

PER_ELEMENT (gear_g_size, gear, 1) {
  *out = fabs (now.phi1) + fabs (now.phi3) + fabs (now.element->ratio) * (fabs (now.phi2) + fabs (now.phi3)) +
         fabs (now.element->offset);
}

PER_ELEMENT (gear_J, gear, 9) {
  memset (out, 0, 9 * sizeof *out);
  out[2] = 1, out[5] = -now.element->ratio, out[8] = now.element->ratio - 1;
}

static const char *const gear_from[] = { "start", "offset", NULL };

static const pw_field gear_fields[] = {
  { PW_AT (pw_gear, body), PW_BODY, .count = 3, .required = 1,
    .about = "the two gears and their carrier; one may be ground" },
  { PW_AT (pw_gear, ratio), PW_NUMBER, .required = 1,
    .about =
        "angular velocity of the first over that of the second, relative to the carrier; negative: opposite rotation" },
  { PW_AT (pw_gear, from), PW_CHOICE, .choices = gear_from, .turn = PW_TURN_OFFSET,
    .about = "whether the offset follows from the initial angles or is given" },
  { PW_AT (pw_gear, offset), PW_NUMBER, .unit = "rad",
    .about = "with from: offset; angle of the first minus ratio times that of the second, relative to the carrier" },
  { .name = NULL },
};

const pw_kind pw_kind_gear = {
  .name = "gear",
  .about = "the angles of two bodies relative to a third have a fixed ratio",
  .symbol = "g1; g2",
  TYPE (gear, pw_gear, gear),
  .bodies = 3,
  .rows = 1,
  .level = PW_HOLONOMIC,
  REACTION ("M", "N m", "moment on the first body"),
  POSITION (gear),
  .J = gear_J,
};
