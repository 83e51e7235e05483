/* rolling-resistance: a force along a heading that opposes the velocity of the contact point P in that direction.
 *
 *   F = -L tanh (v_e / v0),  v_e = E . (vx, vy, w)                v_e: speed of P along the heading (coulomb.h)
 *   E = [ cos(theta)  sin(theta)  -m ]          theta = phi + psi; m: the arm of P to the left of the heading
 *   f = F E,  loss = -F v_e >= 0
 *
 * (Wong 2008, Theory of Ground Vehicles, section 1.2.)
 * It has no lateral component; a wheel at the same point provides that. */
#include "contact.h"
#include "coulomb.h"

typedef struct {
  contact point; /* direction: the heading */
  coulomb law;
} resistance;

/* Element e: E and the speed along it. */
#define RESISTANCE_PARTS                                                                        \
  const resistance *k = (const resistance *)b->element + e;                                     \
  const contact *P = &k->point;                                                                 \
  const pw_configuration *A = &b->configuration[b->body[e]];                                    \
  const double E[3] = { A->cos * P->a - A->sin * P->b, A->sin * P->a + A->cos * P->b, P->arm }; \
  const double ve = E[0] * A->vx + E[1] * A->vy + E[2] * A->omega

static int resistance_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                               pw_error *error) {
  const pw_rolling_resistance *d = definition;
  resistance *k = element;
  k->point = contact_make (d->at, d->heading, pw_cos (d->heading), pw_sin (d->heading));
  (void)bodies, (void)own;
  return coulomb_make (0, d->limit, d->speed, &k->law, error);
}

static void resistance_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    RESISTANCE_PARTS;
    double F = -coulomb_force (&k->law, ve);
    for (int i = 0; i < 3; i++) out[i] = F * E[i];
  }
}

/* d(F E)/dphi with dE/dphi = (-s, c, 0) and dv_e/dphi = c vy - s vx. */
static void resistance_force_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    RESISTANCE_PARTS;
    double F = -coulomb_force (&k->law, ve), turn = -coulomb_slope (&k->law, ve) * (E[0] * A->vy - E[1] * A->vx);
    memset (out, 0, 9 * sizeof *out);
    out[2] = turn * E[0] - F * E[1];
    out[5] = turn * E[1] + F * E[0];
    out[8] = turn * E[2];
  }
}

static void resistance_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    RESISTANCE_PARTS;
    double slope = -coulomb_slope (&k->law, ve);
    for (int i = 0; i < 9; i++) out[i] = slope * E[i / 3] * E[i % 3];
  }
}

static void resistance_saturation (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    RESISTANCE_PARTS;
    out[2] = coulomb_range (&k->law, ve, E[0] * A->vy - E[1] * A->vx);
    for (int i = 0; i < 3; i++) out[3 + i] = coulomb_range (&k->law, ve, E[i]);
  }
}

static void resistance_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    RESISTANCE_PARTS;
    out[e] = coulomb_force (&k->law, ve) * ve;
  }
}

static const pw_field resistance_fields[] = {
  { PW_AT (pw_rolling_resistance, body), PW_BODY, .required = 1, .about = "the body that rolls" },
  { PW_AT (pw_rolling_resistance, at), PW_POINT, .unit = "m", .required = 1,
    .about = "contact point in the body's frame" },
  { PW_AT (pw_rolling_resistance, heading), PW_NUMBER, .unit = "rad",
    .about = "rolling direction in the body's frame; 0: along its x" },
  { PW_AT (pw_rolling_resistance, limit), PW_NUMBER, .unit = "N", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "the force when it rolls: coefficient times normal load" },
  { PW_AT (pw_rolling_resistance, speed), PW_NUMBER, .unit = "m/s", .required = 1, .domain = PW_POSITIVE,
    .about = "below about this speed the force is smoothed" },
  { .name = NULL },
};

const pw_kind pw_kind_rolling_resistance = {
  .name = "rolling-resistance",
  .about = "a force of given size along a heading against the motion of its point",
  .definition = sizeof (pw_rolling_resistance),
  .element = sizeof (resistance),
  .fields = resistance_fields,
  .bodies = 1,
  .level = PW_FORCE,
  .prepare = resistance_prepare,
  .force = resistance_force,
  .force_q = resistance_force_q,
  .force_v = resistance_force_v,
  .saturation = resistance_saturation,
  .loss = resistance_loss,
};
