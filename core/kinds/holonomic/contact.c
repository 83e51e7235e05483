/* contact: a disc of body 1 with the radius R, or a point, R = 0, stays on the left of a line of body 2, or outside
 * of a disc of body 2 with the radius R2.
 *
 *   g = n . D - c - R >= 0                                line.h                        (1 holonomic equation, which
 *   g = (d.d - L^2) / (2 L) >= 0,  L = R + R2             rod.h                          holds while they touch)
 *
 * Friction is the equation u = 0, with u the velocity of the material point of body 1 in contact relative to that of
 * body 2, along the tangent e: the heading of the line; of discs the normal turned by -90 degrees.  Where g = 0,
 *
 *   u = d/dt (e.D) + R (omega1 - omega2)                  line.h, of the perpendicular line
 *   u = e.d' + R omega1 + R2 omega2,  e = (dy, -dx) / L   points.h               (1 nonholonomic equation, which holds
 *   S = e^T D + [ 0 0 R | 0 0 R2 ],  gamma = e.c          by e'.d' = 0            while it sticks)
 *   c = (X1, Y1) omega1^2 - (X2, Y2) omega2^2
 *
 * N = -lambda >= 0 [N] acts on body 1 along the normal, away from body 2; T = -lambda along e, with |T| <= mu N
 * (Coulomb), opposite to u where they slide; both at the point of contact.  Body 2 receives the opposite. */
#include "line.h"
#include "rod.h"

typedef struct {
  line line; /* of friction: the perpendicular one */
  rod rod;
  double radius, other; /* R, R2 [m] */
  double is_disc;       /* 1: of two discs, 0: of a line; the other one of these is not used */
} touch;

/* A contact in the current state. */
typedef struct {
  const touch *element;
  line_state line;
  rod_state rod;
} touch_state;

static inline touch_state touch_at (const pw_batch *batch, int e) {
  const touch *element = (const touch *)batch->element + e;
  return (touch_state){ element, line_of (&element->line, batch, e), rod_of (&element->rod, batch, e) };
}

static int touch_make (const pw_contact *definition, double turn, touch *element, pw_error *error) {
  const double length = definition->radius + definition->other_radius;
  *element = (touch){ line_make (definition->at, definition->heading + turn),
                      { points_make (definition->at), length > 0 ? length : 1 },
                      definition->radius,
                      definition->other_radius,
                      definition->other_radius > 0 };
  if (element->is_disc != 0 && definition->heading != 0)
    return pw_fail (error, PW_INPUT, "heading = %g: expected none: with other_radius, body 2 has a disc, not a line",
                    definition->heading);
  if (definition->mu_sliding > definition->mu)
    return pw_fail (error, PW_INPUT, "mu_sliding = %g: expected at most the mu, %g", definition->mu_sliding,
                    definition->mu);
  return PW_OK;
}

/* ---- The gap ---- */

PREPARE (touch_prepare, pw_contact, touch) {
  return touch_make (definition, 0, element, error);
}

PER_ELEMENT (touch_g, touch, 1) {
  now.element->is_disc != 0 ? rod_g_one (now.rod, out) : line_g_one (now.line, out);
  if (now.element->is_disc == 0) *out -= now.element->radius;
}

PER_ELEMENT (touch_g_size, touch, 1) {
  now.element->is_disc != 0 ? rod_g_size_one (now.rod, out) : line_g_size_one (now.line, out);
  if (now.element->is_disc == 0) *out += now.element->radius;
}

#define TOUCH_GAP(function, size)                                                                            \
  PER_ELEMENT (touch_##function, touch, size) {                                                              \
    now.element->is_disc != 0 ? rod_##function##_one (now.rod, out) : line_##function##_one (now.line, out); \
  }
TOUCH_GAP (J, 6)
TOUCH_GAP (gamma, 1)
TOUCH_GAP (jw_q, 6)
TOUCH_GAP (gamma_q, 6)
TOUCH_GAP (gamma_v, 6)

static void touch_limits (const void *definition, pw_bounds *limit) {
  limit->most = 0;
  limit->restitution = ((const pw_contact *)definition)->restitution;
}

/* ---- Friction ---- */

static int touch_has_friction (const void *definition) {
  return ((const pw_contact *)definition)->mu > 0;
}

PREPARE (rub_prepare, pw_contact, touch) {
  return touch_make (definition, -PW_PI / 2, element, error);
}

typedef touch_state rub_state;
#define rub_at touch_at

/* L e, e: tangent of the discs */
static inline void rub_tangent (const rod_state *of, double e[2]) {
  e[0] = of->ends.d[1], e[1] = -of->ends.d[0];
}

PER_ELEMENT (rub_J, rub, 6) {
  double e[2];
  rub_tangent (&now.rod, e);
  now.element->is_disc != 0 ? rod_multiply_D (&now.rod, e, out) : line_J_one (now.line, out);
  out[2] += now.element->radius;
  out[5] += now.element->is_disc != 0 ? now.element->other : -now.element->radius;
}

PER_ELEMENT (rub_gamma, rub, 1) {
  double e[2], c[2];
  if (now.element->is_disc == 0) {
    line_gamma_one (now.line, out);
    return;
  }
  rub_tangent (&now.rod, e);
  points_gamma_one (now.rod.ends, c);
  *out = rod_dot (e, c) / now.rod.L;
}

/* ((D w) turned^T D + e^T (D w)_q) / L, as rod_jw_q */
PER_ELEMENT (rub_jw_q, rub, 6) {
  const points_state *ends = &now.rod.ends;
  double e[2], Dw[2] = { 0, 0 };
  if (now.element->is_disc == 0) {
    line_jw_q_one (now.line, out);
    return;
  }
  rub_tangent (&now.rod, e);
  for (int j = 0; j < 6; j++) Dw[0] -= now.rod.D[6 + j] * ends->w[j], Dw[1] += now.rod.D[j] * ends->w[j];
  rod_multiply_D (&now.rod, Dw, out);
  out[2] -= rod_dot (e, ends->S1) * ends->w[2] / now.rod.L;
  out[5] += rod_dot (e, ends->S2) * ends->w[5] / now.rod.L;
}

/* (c turned^T D + e^T c_q) / L, as rod_gamma_q */
PER_ELEMENT (rub_gamma_q, rub, 6) {
  const rod_state *of = &now.rod;
  double e[2], c[2];
  if (now.element->is_disc == 0) {
    line_gamma_q_one (now.line, out);
    return;
  }
  rub_tangent (of, e);
  points_gamma_one (of->ends, c);
  rod_multiply_D (of, (const double[2]){ -c[1], c[0] }, out);
  out[2] += of->omega1 * of->omega1 * (e[0] * of->D[2] + e[1] * of->D[8]) / of->L;
  out[5] += of->omega2 * of->omega2 * (e[0] * of->D[5] + e[1] * of->D[11]) / of->L;
}

PER_ELEMENT (rub_gamma_v, rub, 6) {
  double e[2];
  if (now.element->is_disc == 0) {
    line_gamma_v_one (now.line, out);
    return;
  }
  rub_tangent (&now.rod, e);
  memset (out, 0, 6 * sizeof *out);
  out[2] = 2 * now.rod.omega1 * rod_dot (e, now.rod.ends.S1) / now.rod.L;
  out[5] = -2 * now.rod.omega2 * rod_dot (e, now.rod.ends.S2) / now.rod.L;
}

static void rub_loss (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) {
    const pw_configuration *body1 = batch_body (batch, 2 * e), *body2 = batch_body (batch, 2 * e + 1);
    const double v[6] = { body1->vx, body1->vy, body1->omega, body2->vx, body2->vy, body2->omega };
    double S[6];
    rub_J_one (rub_at (batch, e), S);
    out[e] = 0;
    for (int i = 0; i < 6; i++) out[e] += batch->lambda[e] * S[i] * v[i];
  }
}

static void rub_limits (const void *definition, pw_bounds *limit) {
  const pw_contact *x = definition;
  const double sliding = x->mu_sliding > 0 ? x->mu_sliding : x->mu;
  if (x->mu == 0) return;
  *limit = (pw_bounds){ -x->mu, x->mu, { -sliding, sliding }, .initially_slides = 1, .relative = 1 };
}

static const pw_field touch_fields[] = {
  { PW_AT (pw_contact, body), PW_BODY, .count = 2, .required = 1,
    .about = "the body with the point or disc, and the body with the line or disc; one may be ground" },
  { PW_AT (pw_contact, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the point or centre in the first body's frame; a point of the line, or the centre, in the second's" },
  { PW_AT (pw_contact, heading), PW_NUMBER, .unit = "rad",
    .about = "direction of the line in the second body's frame, along its x axis if 0; the first body is on its left" },
  { PW_AT (pw_contact, radius), PW_NUMBER, .unit = "m", .domain = PW_NONNEGATIVE,
    .about = "of the first body's disc; 0: a point" },
  { PW_AT (pw_contact, other_radius), PW_NUMBER, .unit = "m", .domain = PW_NONNEGATIVE,
    .about = "of the second body's disc; 0: a line" },
  { PW_AT (pw_contact, restitution), PW_NUMBER, .domain = PW_FRACTION,
    .about = "normal velocity after an impact over that before it" },
  { PW_AT (pw_contact, mu), PW_NUMBER, .domain = PW_NONNEGATIVE,
    .about = "largest friction over normal force; 0: no friction" },
  { PW_AT (pw_contact, mu_sliding), PW_NUMBER, .domain = PW_NONNEGATIVE,
    .about = "the same while it slides, at most mu; 0: mu" },
  { .name = NULL },
};

const pw_kind pw_kind_contact = {
  .name = "contact",
  .about = "a point or disc of one body does not enter the half plane or disc of another, where it bounces",
  .symbol = "d 0 radius; d 1 other_radius; other_radius=0: 1 -inf 0 1 inf 0; other_radius=0: h 0",
  TYPE (touch, pw_contact, touch),
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  REACTION ("N", "N", "force on the first body along the normal, away from the second"),
  POSITION (touch),
  CONSTRAINT (touch),
  .limits = touch_limits,
  .companion = &pw_kind_contact_friction,
  .has_companion = touch_has_friction,
};

const pw_kind pw_kind_contact_friction = {
  .name = "contact",
  .about = "the friction of a contact",
  .definition = sizeof (pw_contact),
  .fields = touch_fields,
  .element = sizeof (touch),
  .prepare = rub_prepare,
  .bodies = 2,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("T", "N",
            "friction on the first body, along the heading of the line or, of discs, the normal turned by -90 deg"),
  CONSTRAINT (rub),
  .loss = rub_loss,
  .limits = rub_limits,
};
