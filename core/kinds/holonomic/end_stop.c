/* stop: a coordinate of a point of body 1 in the frame of body 2, or the angle between the two, stays within limits.
 *
 *   g1 = x - low >= 0,  g2 = x - high <= 0      (2 holonomic equations, each of which holds while its limit is reached)
 *
 * x, G and gamma: those of a drive (drive.c) whose signal is 0.  A limit acts on body 1 with -lambda, on body 2 with
 * the opposite: along the coordinate at its point, or as a moment; at low it is >= 0, at high <= 0. */
#include "line.h"

typedef struct {
  line line;
  double limit[2]; /* low, high; 0 for one that does not exist */
} stop;

typedef struct {
  const stop *element;
  line_state line;
} stop_state;

static inline stop_state stop_at (const pw_batch *batch, int e) {
  const stop *element = (const stop *)batch->element + e;
  return (stop_state){ element, line_of (&element->line, batch, e) };
}

static const char *const stop_what[] = { "x", "y", "angle", NULL }, *const stop_sides[] = { "both", "low", "high",
                                                                                            NULL };

/* 1 if there is a limit: low (0), high (1). */
static int stop_has (const pw_end_stop *definition, int limit) {
  return definition->sides != (limit ? PW_STOP_LOW : PW_STOP_HIGH);
}

PREPARE (stop_prepare, pw_end_stop, stop) {
  const int angle = definition->what == PW_DRIVE_ANGLE;
  *element = (stop){ .line = { .s1 = { definition->at[0][0], definition->at[0][1] }, .prescribes_angle = angle },
                     .limit = { definition->low, definition->high } };
  for (int i = 0; i < 2; i++)
    if (!stop_has (definition, i) && element->limit[i] != 0)
      return pw_fail (error, PW_INPUT, "%s = %g with sides: %s: expected no such limit", i ? "high" : "low",
                      element->limit[i], stop_sides[definition->sides]);
  if (definition->sides == PW_STOP_BOTH && !(definition->low < definition->high))
    return pw_fail (error, PW_INPUT, "low = %g, high = %g: expected low < high, or sides: low or high", definition->low,
                    definition->high);
  if (angle) return PW_OK;
  element->line.n[definition->what] = 1;
  element->line.c = definition->at[1][definition->what];
  return PW_OK;
}

PER_ELEMENT (stop_g, stop, 2) {
  const line *constants = now.line.constants;
  line_g_one (now.line, out);
  out[1] = out[0] += constants->prescribes_angle * (now.line.body1->phi - now.line.body2->phi);
  out[0] -= now.element->limit[0], out[1] -= now.element->limit[1];
}

PER_ELEMENT (stop_g_size, stop, 2) {
  line_g_size_one (now.line, out);
  out[0] += now.line.constants->prescribes_angle * (fabs (now.line.body1->phi) + fabs (now.line.body2->phi));
  out[1] = out[0] + fabs (now.element->limit[1]), out[0] += fabs (now.element->limit[0]);
}

PER_ELEMENT (stop_J, stop, 12) {
  line_J_one (now.line, out);
  out[2] += now.line.constants->prescribes_angle, out[5] -= now.line.constants->prescribes_angle;
  memcpy (out + 6, out, 6 * sizeof *out);
}

PER_ELEMENT (stop_gamma, stop, 2) {
  line_gamma_one (now.line, out);
  out[1] = out[0];
}

#define STOP_DERIVATIVE(block)              \
  PER_ELEMENT (stop_##block, stop, 12) {    \
    line_##block##_one (now.line, out);     \
    memcpy (out + 6, out, 6 * sizeof *out); \
  }
EACH_DERIVATIVE (STOP_DERIVATIVE)

static void stop_limits (const void *definition, pw_bounds *limit) {
  limit[0].most = limit[1].least = 0;
  if (!stop_has (definition, 0)) limit[0].least = 0;
  if (!stop_has (definition, 1)) limit[1].most = 0;
  limit[0].restitution = limit[1].restitution = ((const pw_end_stop *)definition)->restitution;
}

static const pw_field stop_fields[] = {
  { PW_AT (pw_end_stop, body), PW_BODY, .count = 2, .required = 1,
    .about = "the stopped body and the reference body; one may be ground" },
  { PW_AT (pw_end_stop, at), PW_POINT, .count = 2, .unit = "m",
    .about = "a point in each body's frame; for an angle it serves figures and the length scale only" },
  { PW_AT (pw_end_stop, what), PW_CHOICE, .required = 1, .choices = stop_what,
    .about = "the coordinate, from point 2 to point 1 in the frame of body 2, or the relative angle" },
  { PW_AT (pw_end_stop, low), PW_NUMBER, .unit = "m or rad", .about = "its least value" },
  { PW_AT (pw_end_stop, high), PW_NUMBER, .unit = "m or rad", .about = "its largest value" },
  { PW_AT (pw_end_stop, sides), PW_CHOICE, .choices = stop_sides, .about = "which of these exist" },
  { PW_AT (pw_end_stop, restitution), PW_NUMBER, .domain = PW_FRACTION,
    .about = "velocity after an impact over that before it" },
  { .name = NULL },
};

static const char *stop_unit (const void *element, int row) {
  (void)row;
  return ((const stop *)element)->line.prescribes_angle != 0 ? "N m" : "N";
}

const pw_kind pw_kind_end_stop = {
  .name = "stop",
  .about = "a relative coordinate or angle of two bodies stays within limits, where it bounces",
  TYPE (stop, pw_end_stop, stop),
  .bodies = 2,
  .rows = 2,
  .level = PW_HOLONOMIC,
  .reaction =
      (const pw_quantity[]){
          { "low", "N or N m", NULL, "force on the first body at its point along the coordinate, or moment, at low" },
          { "high", "N or N m", NULL, "the same at high" },
      },
  .reaction_unit = stop_unit,
  POSITION (stop),
  CONSTRAINT (stop),
  .limits = stop_limits,
};
