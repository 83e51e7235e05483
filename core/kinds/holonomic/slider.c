/* slider: a prismatic joint; a point of body 1 stays on a line of body 2 at a constant relative angle
 * beta = phi1 - phi2.
 *
 *   g     = ( n . (r1 + R(phi1) s1 - r2 - R(phi2) s2),  phi1 - phi2 - beta ) = 0      (2 holonomic equations)
 *   gamma = ( as in line.h,  0 )                         n: normal of the line, to the left of its heading
 *
 * line.h has the derivatives of the first equation.  The force -lambda(1) along n, at the point, and the moment
 * -lambda(2) act on body 1; the opposites act on body 2. */
#include "line.h"

PREPARE (slider_prepare, pw_slider, line) {
  *element = line_make (definition->at, definition->heading);
  element->angle = definition->angle;
  return PW_OK;
}

PER_ELEMENT (slider_g, line, 2) {
  line_g_one (now, out);
  out[1] = now.body1->phi - now.body2->phi - now.constants->angle;
}

PER_ELEMENT (slider_g_size, line, 2) {
  line_g_size_one (now, out);
  out[1] = fabs (now.body1->phi) + fabs (now.body2->phi) + fabs (now.constants->angle);
}

PER_ELEMENT (slider_J, line, 12) {
  line_J_one (now, out);
  out[6] = out[7] = out[9] = out[10] = 0, out[8] = 1, out[11] = -1;
}

PER_ELEMENT (slider_gamma, line, 2) {
  line_gamma_one (now, out);
  out[1] = 0;
}

/* Defines slider_jw_q, ...: the first row is that of line.h, the second is 0. */
#define SLIDER_DERIVATIVE(member)           \
  PER_ELEMENT (slider_##member, line, 12) { \
    line_##member##_one (now, out);         \
    memset (out + 6, 0, 6 * sizeof *out);   \
  }
EACH_DERIVATIVE (SLIDER_DERIVATIVE)

static const pw_field slider_fields[] = {
  { PW_AT (pw_slider, body), PW_BODY, .count = 2, .required = 1,
    .about = "the sliding body and the body with the line; one may be ground" },
  LINE_FIELDS (pw_slider),
  { PW_AT (pw_slider, angle), PW_NUMBER, .unit = "rad",
    .about = "phi1 - phi2, of the first body relative to the second" },
  { .name = NULL },
};

static const pw_quantity slider_reaction[] = {
  { "N", "N", NULL, "force on the first body at its point, to the left of the line's heading" },
  { "M", "N m", NULL, "moment on the first body" },
};

const pw_kind pw_kind_slider = {
  .name = "slider",
  .about = "a body slides along a line of another without rotating relative to it (prismatic joint)",
  .symbol = "ground: h 0; 1 -inf 0 1 inf 0; 0 -1.2 -.7 0 1.2 -.7 0 1.2 .7 0 -1.2 .7 0 -1.2 -.7",
  TYPE (slider, pw_slider, line),
  .bodies = 2,
  .rows = 2,
  .level = PW_HOLONOMIC,
  .reaction = slider_reaction,
  POSITION (slider),
  CONSTRAINT (slider),
};
