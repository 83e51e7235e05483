/* gear: the angles of two bodies relative to a third, the carrier, keep a ratio i.
 *
 *   g = (phi1 - phi3) - i (phi2 - phi3) - c = 0                    (1 holonomic equation, linear)
 *   G = [ 0 0 1 | 0 0 -i | 0 0 i-1 ],  gamma = 0
 *
 * (Willis 1870, Principles of Mechanism.)  External gears of radii R1 and R2 have i = -R2 / R1, a gear inside a ring
 * i = R2 / R1.  Pins define the axles.  The moments are -lambda on body 1, i lambda on body 2, (1 - i) lambda on the
 * carrier. */
#include <math.h>
#include <string.h>
#include "batch.h"

typedef struct {
  double ratio;  /* i */
  double offset; /* c [rad] */
} gear;

PREPARE (gear_prepare, pw_gear, gear) {
  double phi[3];
  for (int n = 0; n < 3; n++) phi[n] = bodies[n]->start[2];
  double start = phi[0] - phi[2] - d->ratio * (phi[1] - phi[2]);
  *k = (gear){ d->ratio, d->from == PW_GEAR_START ? start : d->offset };
  if (d->ratio == 0) return pw_fail (error, PW_INPUT, "ratio = 0: expected another number, positive or negative");
  return PW_OK;
}

typedef struct {
  const gear *k;
  double phi1, phi2, phi3;
} gear_state;

static inline gear_state gear_at (const pw_batch *b, int e) {
  return (gear_state){ (const gear *)b->element + e, batch_body (b, e, 3, 0)->phi, batch_body (b, e, 3, 1)->phi,
                       batch_body (b, e, 3, 2)->phi };
}

PER_ELEMENT (gear_g, gear, 1) {
  *out = x.phi1 - x.phi3 - x.k->ratio * (x.phi2 - x.phi3) - x.k->offset;
}

PER_ELEMENT (gear_g_size, gear, 1) {
  *out = fabs (x.phi1) + fabs (x.phi3) + fabs (x.k->ratio) * (fabs (x.phi2) + fabs (x.phi3)) + fabs (x.k->offset);
}

PER_ELEMENT (gear_J, gear, 9) {
  memset (out, 0, 9 * sizeof *out);
  out[2] = 1, out[5] = -x.k->ratio, out[8] = x.k->ratio - 1;
}

static const char *const gear_from[] = { "start", "offset", NULL };

static const pw_field gear_fields[] = {
  { PW_AT (pw_gear, body), PW_BODY, .count = 3, .required = 1,
    .about = "the two gears and their carrier; one may be ground" },
  { PW_AT (pw_gear, ratio), PW_NUMBER, .required = 1,
    .about =
        "angular velocity of the first over that of the second, relative to the carrier; negative: opposite rotation" },
  { PW_AT (pw_gear, from), PW_CHOICE, .choices = gear_from,
    .about = "whether the offset follows from the initial angles or is given" },
  { PW_AT (pw_gear, offset), PW_NUMBER, .unit = "rad",
    .about = "angle of the first minus ratio times that of the second, relative to the carrier" },
  { .name = NULL },
};

static const pw_quantity gear_reaction[] = { { "M", "N m", NULL, "moment on the first body" } };

const pw_kind pw_kind_gear = {
  .name = "gear",
  .about = "the angles of two bodies relative to a third have a fixed ratio",
  .symbol = "g1; g2",
  DEFINITION (pw_gear, gear_fields),
  ELEMENT (gear, gear_prepare),
  .bodies = 3,
  .rows = 1,
  .level = PW_HOLONOMIC,
  .reaction = gear_reaction,
  POSITION (gear),
  .J = gear_J,
};
