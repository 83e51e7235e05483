/* drive: a coordinate of a point of body 1 in the frame of body 2, or the angle between the two, follows a signal u.
 *
 *   g = e . D - c - u = 0           x, y: e = R(phi2) (1, 0) or R(phi2) (0, 1), D = r1 + R(phi1) s1 - r2,
 *                                   c: the component of s2 along x or y                 (1 holonomic equation)
 *   g = phi1 - phi2 - u = 0         angle: G = [ 0 0 1 | 0 0 -1 ]
 *
 * For x and y, G is that of line.h with the normal e, and gamma is that of line.h plus u''; for an angle gamma = u''.
 * eta = u'.
 *
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, sections 3.3 and 3.5.)
 * The drive acts on body 1 with -lambda: along e at its point, or as a moment; on body 2 with the opposite. */
#include "line.h"

/* A drive in the current state. */
typedef struct {
  line_state line;
  const double *u; /* the signal, with two time derivatives */
} drive_state;

static inline drive_state drive_at (const pw_batch *batch, int e) {
  return (drive_state){ line_at (batch, e), batch->u + 3 * e };
}

PREPARE (drive_prepare, pw_drive, line) {
  *element = line_of_coordinate (definition->at, definition->what);
  return PW_OK;
}

PER_ELEMENT (drive_g, drive, 1) {
  coordinate_g_one (now.line, out);
  *out -= now.u[0];
}

PER_ELEMENT (drive_g_size, drive, 1) {
  coordinate_g_size_one (now.line, out);
  *out += fabs (now.u[0]);
}

static void drive_eta (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) out[e] = batch->u[3 * e + 1];
}

PER_ELEMENT (drive_gamma, drive, 1) {
  line_gamma_one (now.line, out);
  *out += now.u[2];
}

static const pw_field drive_fields[] = {
  { PW_AT (pw_drive, body), PW_BODY, .count = 2, .required = 1,
    .about = "the driven body and the reference body; one may be ground" },
  COORDINATE_FIELDS (pw_drive),
  { PW_AT (pw_drive, value), PW_SIGNAL, .unit = "m or rad", .required = 1,
    .about = "value as a function of time, with two derivatives" },
  { .name = NULL },
};

const pw_kind pw_kind_drive = {
  .name = "drive",
  .about = "a relative coordinate or angle of two bodies follows a signal of time",
  .symbol = "what=0: 0 .6 0 0 2.2 0 0 1.7 .3 0 2.2 0 0 1.7 -.3; "
            "what=1: 0 0 .6 0 0 2.2 0 .3 1.7 0 0 2.2 0 -.3 1.7; "
            "what=2: 0 .9 -.5 0 1 0 0 .7 .7 0 0 1 0 -.7 .7 0 -.2 .8 0 -.7 .7 0 -.6 1.2",
  TYPE (drive, pw_drive, line),
  .bodies = 2,
  .rows = 1,
  .signals = 1,
  .level = PW_HOLONOMIC,
  REACTION ("F", "N or N m", "force on the first body at its point along the prescribed coordinate, or moment on it"),
  .reaction_unit = coordinate_unit,
  POSITION (drive),
  .eta = drive_eta,
  .J = coordinate_J,
  .gamma = drive_gamma,
  DERIVATIVES (line),
};
