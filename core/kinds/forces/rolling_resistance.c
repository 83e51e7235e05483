/* rolling-resistance: a force along a heading, against the motion of its contact point P along it.
 *
 *   F = -L tanh (v_e / v0),  v_e = E . (vx, vy, w)                v_e: speed of P along the heading
 *   E = [ cos(theta)  sin(theta)  -m ]          theta = phi + psi; m: the arm of P to the left of the heading
 *   f = F E,  loss = -F v_e >= 0
 *
 * (Wong 2008, Theory of Ground Vehicles, section 1.2; Andersson, Soderberg & Bjorklund 2007, Tribology International
 * 40, 580-587, for the smoothing by tanh.)
 * It is all along the heading: a wheel at the same point holds it sideways. */
#include <math.h>
#include <string.h>
#include "pinwheel.h"

typedef struct {
  double cos, sin; /* of the heading in the body */
  double aside;    /* m [m] */
  double limit;    /* L [N] */
  double speed;    /* v0 [m/s] */
} resistance;

/* Names the parts of element e: heading in the world, the speed along it, the force and its slope. */
#define RESISTANCE_PARTS                                                                     \
  const resistance *k = (const resistance *)b->element + e;                                  \
  const pw_pose *A = &b->pose[b->body[e]];                                                   \
  const double c = A->cos * k->cos - A->sin * k->sin, s = A->sin * k->cos + A->cos * k->sin; \
  const double ve = c * A->vx + s * A->vy - k->aside * A->omega, y = tanh (ve / k->speed);   \
  const double F = -k->limit * y, slope = -k->limit * (1 - y * y) / k->speed;                \
  (void)F, (void)slope

static int resistance_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_own *own,
                               pw_error *error) {
  const pw_rolling_resistance *d = definition;
  double c = cos (d->heading), s = sin (d->heading);
  *(resistance *)element = (resistance){ c, s, d->at[1] * c - d->at[0] * s, d->limit, d->speed };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void resistance_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    RESISTANCE_PARTS;
    out[0] = F * c, out[1] = F * s, out[2] = -F * k->aside;
  }
}

/* F E by phi: dE/dphi = (-s, c, 0), so v_e changes by c vy - s vx. */
static void resistance_force_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    RESISTANCE_PARTS;
    double turn = slope * (c * A->vy - s * A->vx);
    memset (out, 0, 9 * sizeof *out);
    out[2] = turn * c - F * s;
    out[5] = turn * s + F * c;
    out[8] = -turn * k->aside;
  }
}

static void resistance_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    RESISTANCE_PARTS;
    const double E[3] = { c, s, -k->aside };
    for (int i = 0; i < 9; i++) out[i] = slope * E[i / 3] * E[i % 3];
  }
}

static void resistance_saturation (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    RESISTANCE_PARTS;
    const double per[6] = { 0, 0, c * A->vy - s * A->vx, c, s, -k->aside };
    for (int i = 0; i < 6; i++)
      if (per[i] != 0 && k->limit > 0) out[i] = (k->speed + fabs (ve)) / fabs (per[i]);
  }
}

static void resistance_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    RESISTANCE_PARTS;
    out[e] = -F * ve;
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
