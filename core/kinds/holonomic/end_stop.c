/* stop: a coordinate of a point of body 1 in the frame of body 2, or the angle between the two, stays within limits.
 *
 *   g1 = x - low >= 0,  g2 = x - high <= 0      (2 holonomic equations, each of which holds while its limit is reached)
 *
 * x, G and gamma: those of a drive (drive.c) whose signal is 0.  A limit acts on body 1 with -lambda, on body 2 with
 * the opposite: along the coordinate at its point, or as a moment; at low it is >= 0, at high <= 0. */
#include "line.h"

typedef struct {
  line line;       /* the first member: see coordinate_unit */
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

/* 1 if there is a limit: low (0), high (1). */
static int stop_has (const pw_end_stop *definition, int limit) {
  return definition->specified[limit] || (limit ? definition->high : definition->low) != 0;
}

PREPARE (stop_prepare, pw_end_stop, stop) {
  *element = (stop){ .line = line_of_coordinate (definition->at, definition->what),
                     .limit = { definition->low, definition->high } };
  if (!stop_has (definition, 0) && !stop_has (definition, 1))
    return pw_fail (error, PW_INPUT, "neither low nor high is given: expected one or both");
  if (stop_has (definition, 0) && stop_has (definition, 1) && !(definition->low < definition->high))
    return pw_fail (error, PW_INPUT, "low = %g, high = %g: expected low < high", definition->low, definition->high);
  return PW_OK;
}

PER_ELEMENT (stop_g, stop, 2) {
  coordinate_g_one (now.line, out);
  out[1] = out[0] - now.element->limit[1], out[0] -= now.element->limit[0];
}

PER_ELEMENT (stop_g_size, stop, 2) {
  coordinate_g_size_one (now.line, out);
  out[1] = out[0] + fabs (now.element->limit[1]), out[0] += fabs (now.element->limit[0]);
}

PER_ELEMENT (stop_J, stop, 12) {
  coordinate_J_one (now.line, out);
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
  COORDINATE_FIELDS (pw_end_stop),
  { PW_AT (pw_end_stop, low), PW_NUMBER, .unit = "m or rad", .given = offsetof (pw_end_stop, specified[0]),
    .about = "its least value; left out: there is none" },
  { PW_AT (pw_end_stop, high), PW_NUMBER, .unit = "m or rad", .given = offsetof (pw_end_stop, specified[1]),
    .about = "its largest value; left out: there is none" },
  { PW_AT (pw_end_stop, restitution), PW_NUMBER, .domain = PW_FRACTION,
    .about = "velocity after an impact over that before it" },
  { .name = NULL },
};

const pw_kind pw_kind_end_stop = {
  .name = "stop",
  .about = "a relative coordinate or angle of two bodies stays within limits, where it bounces",
  .symbol = "low: what=0: 1 @low -1 1 @low 1; high: what=0: 1 @high -1 1 @high 1; "
            "low: what=1: 1 -1 @low 1 1 @low; high: what=1: 1 -1 @high 1 1 @high",
  TYPE (stop, pw_end_stop, stop),
  .bodies = 2,
  .rows = 2,
  .level = PW_HOLONOMIC,
  .reaction =
      (const pw_quantity[]){
          { "low", "N or N m", NULL, "force on the first body at its point along the coordinate, or moment, at low" },
          { "high", "N or N m", NULL, "the same at high" },
      },
  .reaction_unit = coordinate_unit,
  POSITION (stop),
  CONSTRAINT (stop),
  .limits = stop_limits,
};
