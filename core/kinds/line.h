/* A point of body 1 on a line of body 2: the equation of slot and slider.  Drive and stop subtract a value from this g,
 * or from the angle phi1 - phi2 in its place.  sliding-friction, which has no constraint, uses g, G and H of the
 * perpendicular line, whose g is the position along its own line.
 *
 *   g     = n . D - c = 0,  D = r1 + R(phi1) s1 - r2,  c = n . R(phi2) s2           (1 holonomic equation)
 *   G     = [ n  t.a | -n  -t.D ]             t: along the line, n: t turned by +90 degrees, a = R(phi1) s1
 *   gamma = -v.H v = 2 omega2 t.(r1' - r2') + omega1 (omega1 - 2 omega2) n.a + omega2^2 n.D      so that G v' = gamma
 *
 * By dn/dphi2 = -t and dt/dphi2 = n, the non-zero blocks of the symmetric H = d2g/dq2 are H(r1, phi2) = -t,
 * H(r2, phi2) = t, H(phi1, phi1) = -n.a, H(phi1, phi2) = n.a and H(phi2, phi2) = -n.D.
 * (Haug 1989, Computer Aided Kinematics and Dynamics of Mechanical Systems, section 3.3.) */
#ifndef PW_LINE_H
#define PW_LINE_H

#include <string.h>
#include "batch.h"

typedef struct {
  double s1[2];    /* the point in body 1's frame [m] */
  double n[2];     /* normal of the line in body 2's frame */
  double c;        /* offset of the line along n [m] */
  double angle;    /* of a slider: phi1 - phi2 [rad] */
  double is_angle; /* 1: phi1 - phi2 takes the place of the position along n, where n and c are 0; else 0 */
} line;

/* A line in the current state. */
typedef struct {
  const line *constants;
  const pw_configuration *body1, *body2;
  const double *w;               /* the vector w of jw_q, else NULL */
  double n[2], t[2], a[2], D[2]; /* in world axes */
  double na, nD, ta, tD;         /* n.a, n.D, t.a, t.D */
} line_state;

static inline line line_make (const double at[2][2], double heading) {
  line out = { { at[0][0], at[0][1] }, { -pw_sin (heading), pw_cos (heading) }, .c = 0 };
  out.c = out.n[0] * at[1][0] + out.n[1] * at[1][1];
  return out;
}

/* Sets the normal, in world axes, and what depends on it. */
static inline void line_set_normal (line_state *now, double x, double y) {
  now->n[0] = x, now->n[1] = y, now->t[0] = y, now->t[1] = -x;
  now->na = now->n[0] * now->a[0] + now->n[1] * now->a[1], now->nD = now->n[0] * now->D[0] + now->n[1] * now->D[1];
  now->ta = now->t[0] * now->a[0] + now->t[1] * now->a[1], now->tD = now->t[0] * now->D[0] + now->t[1] * now->D[1];
}

/* The line of an element with two bodies that contains a line among other data. */
static inline line_state line_of (const line *constants, const pw_batch *batch, int e) {
  const pw_configuration *body1 = batch_body (batch, 2 * e), *body2 = batch_body (batch, 2 * e + 1);
  line_state now = { constants, body1, body2, .w = batch_w (batch, e) };
  double n[2];
  to_world (body2, constants->n, n);
  to_world (body1, constants->s1, now.a);
  now.D[0] = body1->x + now.a[0] - body2->x, now.D[1] = body1->y + now.a[1] - body2->y;
  line_set_normal (&now, n[0], n[1]);
  return now;
}

/* The same of an element that is a line. */
static inline line_state line_at (const pw_batch *batch, int e) {
  return line_of ((const line *)batch->element + e, batch, e);
}

PER_ELEMENT (line_g, line, 1) {
  *out = now.nD - now.constants->c;
}

PER_ELEMENT (line_g_size, line, 1) {
  *out = fabs (now.n[0]) * (fabs (now.body1->x) + fabs (now.a[0]) + fabs (now.body2->x)) +
         fabs (now.n[1]) * (fabs (now.body1->y) + fabs (now.a[1]) + fabs (now.body2->y)) + fabs (now.constants->c);
}

PER_ELEMENT (line_J, line, 6) {
  out[0] = now.n[0], out[1] = now.n[1], out[2] = now.ta, out[3] = -now.n[0], out[4] = -now.n[1], out[5] = -now.tD;
}

PER_ELEMENT (line_gamma, line, 1) {
  double omega1 = now.body1->omega, omega2 = now.body2->omega,
         tV = now.t[0] * (now.body1->vx - now.body2->vx) + now.t[1] * (now.body1->vy - now.body2->vy);
  *out = 2 * omega2 * tV + omega1 * (omega1 - 2 * omega2) * now.na + omega2 * omega2 * now.nD;
}

J_GAMMA (line, 6, 1)

/* out = factor H w */
static inline void line_multiply_H (const line_state *now, double factor, const double w[6], double *out) {
  out[0] = -factor * now->t[0] * w[5];
  out[1] = -factor * now->t[1] * w[5];
  out[2] = factor * now->na * (w[5] - w[2]);
  out[3] = -out[0];
  out[4] = -out[1];
  out[5] = factor * (now->na * w[2] - now->nD * w[5] - now->t[0] * (w[0] - w[3]) - now->t[1] * (w[1] - w[4]));
}

/* out = factor H, 6 x 6: entry (i, j) is out[6 i + j]; coordinates x1, y1, phi1, x2, y2, phi2 */
static inline void line_scaled_H (const line_state *now, double factor, double *out) {
  memset (out, 0, 36 * sizeof *out);
  out[5] = out[30] = -factor * now->t[0], out[11] = out[31] = -factor * now->t[1];
  out[23] = out[33] = factor * now->t[0], out[29] = out[34] = factor * now->t[1];
  out[14] = -factor * now->na, out[17] = out[32] = factor * now->na, out[35] = -factor * now->nD;
}

PER_ELEMENT (line_jw_q, line, 6) {
  line_multiply_H (&now, 1, now.w, out);
}

PER_ELEMENT (line_gamma_q, line, 6) {
  double omega1 = now.body1->omega, omega2 = now.body2->omega,
         nV = now.n[0] * (now.body1->vx - now.body2->vx) + now.n[1] * (now.body1->vy - now.body2->vy);
  out[0] = omega2 * omega2 * now.n[0];
  out[1] = omega2 * omega2 * now.n[1];
  out[2] = (omega1 - omega2) * (omega1 - omega2) * now.ta;
  out[3] = -out[0];
  out[4] = -out[1];
  out[5] = 2 * omega2 * nV - omega1 * (omega1 - 2 * omega2) * now.ta - omega2 * omega2 * now.tD;
}

PER_ELEMENT (line_gamma_v, line, 6) {
  double v[6];
  velocities_of (now.body1, now.body2, v);
  line_multiply_H (&now, -2, v, out);
}

/* A coordinate of body 1 in the frame of body 2: x or y of a point, or the angle; what: PW_DRIVE_... */
static inline line line_of_coordinate (const double at[2][2], int what) {
  line out = { .s1 = { at[0][0], at[0][1] }, .is_angle = what == PW_DRIVE_ANGLE };
  if (what == PW_DRIVE_ANGLE) return out;
  out.n[what] = 1;
  out.c = at[1][what];
  return out;
}

PER_ELEMENT (coordinate_g, line, 1) {
  line_g_one (now, out);
  *out += now.constants->is_angle * (now.body1->phi - now.body2->phi);
}

PER_ELEMENT (coordinate_g_size, line, 1) {
  line_g_size_one (now, out);
  *out += now.constants->is_angle * (fabs (now.body1->phi) + fabs (now.body2->phi));
}

PER_ELEMENT (coordinate_J, line, 6) {
  line_J_one (now, out);
  out[2] += now.constants->is_angle, out[5] -= now.constants->is_angle;
}

/* Names of PW_DRIVE_...; the unit of the multiplier. */
static const char *const coordinate_what[] MAYBE_UNUSED = { "x", "y", "angle", NULL };

MAYBE_UNUSED static const char *coordinate_unit (const void *element, int row) {
  (void)row;
  return ((const line *)element)->is_angle != 0 ? "N m" : "N";
}

/* Fields of a definition: the arguments of line_of_coordinate. */
#define COORDINATE_FIELDS(type)                                                                                       \
  { PW_AT (type, at), PW_POINT, .count = 2, .unit = "m",                                                              \
    .about = "a point in each body's frame; for an angle it serves figures and the length scale only" },              \
  {                                                                                                                   \
    PW_AT (type, what), PW_CHOICE, .required = 1, .choices = coordinate_what,                                         \
                                   .about = "the coordinate, from point 2 to point 1 in the frame of body 2, or the " \
                                            "relative angle"                                                          \
  }

/* Fields of a definition: the arguments of line_make. */
#define LINE_FIELDS(type)                                                                                              \
  { PW_AT (type, at), PW_POINT,                                                                                        \
    .count = 2,       .unit = "m",                                                                                     \
    .required = 1,    .about = "the point in the first body's frame, and a point of the line in the second's" },       \
  {                                                                                                                    \
    PW_AT (type, heading), PW_NUMBER, .unit = "rad",                                                                   \
                                      .about = "direction of the line in the second body's frame; 0: along its x axis" \
  }

#endif
