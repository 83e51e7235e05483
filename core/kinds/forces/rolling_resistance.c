/* rolling-resistance: a force along a heading that opposes the velocity of the contact point P in that direction.
 *
 *   F = -L tanh (v_e / v0),  v_e = E . (vx, vy, w)                v_e: speed of P along the heading (coulomb.h)
 *   E = [ cos(theta)  sin(theta)  -m ]          theta = phi + psi; m: the arm of P to the left of the heading
 *   f = F E,  loss = -F v_e >= 0
 *
 * (Wong 2008, Theory of Ground Vehicles, section 1.2.)
 * It has no lateral component; a wheel at the same point provides that. */
#include <string.h>
#include "contact.h"
#include "coulomb.h"

typedef struct {
  contact point; /* direction: the heading */
  coulomb law;
} resistance;

/* An element in the current state: E and the speed along it. */
typedef struct {
  const resistance *k;
  const pw_configuration *A;
  double E[3], ve;
} resistance_state;

static inline resistance_state resistance_at (const pw_batch *b, int e) {
  const resistance *k = (const resistance *)b->element + e;
  contact_state d = contact_of (k->point, b, e);
  resistance_state x = { k, d.A, .ve = contact_speed (&d) };
  contact_J_one (d, x.E);
  return x;
}

PREPARE (resistance_prepare, pw_rolling_resistance, resistance) {
  k->point = contact_along (d->at, d->heading);
  return coulomb_make (0, d->limit, d->speed, &k->law, error);
}

PER_ELEMENT (resistance_force, resistance, 3) {
  double F = -coulomb_force (&x.k->law, x.ve);
  for (int i = 0; i < 3; i++) out[i] = F * x.E[i];
}

/* d(F E)/dphi with dE/dphi = (-s, c, 0) and dv_e/dphi = c vy - s vx. */
PER_ELEMENT (resistance_force_q, resistance, 9) {
  double F = -coulomb_force (&x.k->law, x.ve),
         turn = -coulomb_slope (&x.k->law, x.ve) * (x.E[0] * x.A->vy - x.E[1] * x.A->vx);
  memset (out, 0, 9 * sizeof *out);
  out[2] = turn * x.E[0] - F * x.E[1];
  out[5] = turn * x.E[1] + F * x.E[0];
  out[8] = turn * x.E[2];
}

PER_ELEMENT (resistance_force_v, resistance, 9) {
  double slope = -coulomb_slope (&x.k->law, x.ve);
  for (int i = 0; i < 9; i++) out[i] = slope * x.E[i / 3] * x.E[i % 3];
}

PER_ELEMENT (resistance_saturation, resistance, 6) {
  out[2] = coulomb_saturation (&x.k->law, x.ve, x.E[0] * x.A->vy - x.E[1] * x.A->vx);
  for (int i = 0; i < 3; i++) out[3 + i] = coulomb_saturation (&x.k->law, x.ve, x.E[i]);
}

PER_ELEMENT (resistance_loss, resistance, 1) {
  *out = coulomb_force (&x.k->law, x.ve) * x.ve;
}

static const pw_field resistance_fields[] = {
  { PW_AT (pw_rolling_resistance, body), PW_BODY, .required = 1, .about = "the body that rolls" },
  { PW_AT (pw_rolling_resistance, at), PW_POINT, .unit = "m", .required = 1,
    .about = "contact point in the body's frame" },
  { PW_AT (pw_rolling_resistance, heading), PW_NUMBER, .unit = "rad",
    .about = "rolling direction in the body's frame; 0: along its x" },
  { PW_AT (pw_rolling_resistance, limit), PW_NUMBER, .unit = "N", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "the force while rolling: coefficient times normal load" },
  { PW_AT (pw_rolling_resistance, speed), PW_NUMBER, .unit = "m/s", .required = 1, .domain = PW_POSITIVE,
    .about = "below about this speed the force is smoothed" },
  { .name = NULL },
};

const pw_kind pw_kind_rolling_resistance = {
  .name = "rolling-resistance",
  .about = "a force of given magnitude that opposes the motion of a point along a heading",
  DEFINITION (pw_rolling_resistance, resistance_fields),
  ELEMENT (resistance, resistance_prepare),
  .bodies = 1,
  FORCE (resistance),
  .saturation = resistance_saturation,
  .loss = resistance_loss,
};
