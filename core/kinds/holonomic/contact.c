/* contact: a disc of body 1 with the radius R, or a point, R = 0, stays on the left of a line of body 2, or outside
 * of a disc of body 2 with the radius R2.
 *
 *   g = n . D - c - R >= 0                                line.h                        (1 holonomic equation, which
 *   g = (d.d - L^2) / (2 L) >= 0,  L = R + R2             rod.h                          holds while they touch)
 *
 * N = -lambda >= 0 [N] acts on body 1 along the normal, away from body 2, at the point of contact; body 2 receives the
 * opposite. */
#include "line.h"
#include "rod.h"

typedef struct {
  line line;
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

PREPARE (touch_prepare, pw_contact, touch) {
  const double length = definition->radius + definition->other_radius;
  *element = (touch){ line_make (definition->at, definition->heading),
                      { points_make (definition->at), length > 0 ? length : 1 },
                      definition->radius,
                      definition->other_radius,
                      definition->other_radius > 0 };
  if (element->is_disc && definition->heading != 0)
    return pw_fail (error, PW_INPUT, "heading = %g: expected none: with other_radius, body 2 has a disc, not a line",
                    definition->heading);
  return PW_OK;
}

PER_ELEMENT (touch_g, touch, 1) {
  now.element->is_disc ? rod_g_one (now.rod, out) : line_g_one (now.line, out);
  if (!now.element->is_disc) *out -= now.element->radius;
}

PER_ELEMENT (touch_g_size, touch, 1) {
  now.element->is_disc ? rod_g_size_one (now.rod, out) : line_g_size_one (now.line, out);
  if (!now.element->is_disc) *out += now.element->radius;
}

#define TOUCH_GAP(function, size)                                                                       \
  PER_ELEMENT (touch_##function, touch, size) {                                                         \
    now.element->is_disc ? rod_##function##_one (now.rod, out) : line_##function##_one (now.line, out); \
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
  { .name = NULL },
};

const pw_kind pw_kind_contact = {
  .name = "contact",
  .about = "a point or disc of one body does not enter the half plane or disc of another, where it bounces",
  TYPE (touch, pw_contact, touch),
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  REACTION ("N", "N", "force on the first body along the normal, away from the second"),
  POSITION (touch),
  CONSTRAINT (touch),
  .limits = touch_limits,
};
