/* contact: a disc of body 1 with the radius R, or a point, R = 0, stays on the left of a line or a path of body 2, or
 * outside of a disc of body 2 with the radius R2.
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
 * A path is a line that turns: n and e are those of the place nearest to the centre, of all places.  With its distance
 * d = R + g from there, the curvature k, b = k / (1 - k d) and D' = J v of the lines along n and e,
 *
 *   e' = b (e.D') n,  n' = -b (e.D') e,  b' = (dk/ds) e.D' / (1 - k d)^3 + b^2 n.D'
 *
 * so that gamma of the line is increased by b (e.D')^2, of friction decreased by b (e.D') (n.D').  Where they
 * touch, 1 - k d > 0, since a disc that does not fit everywhere is refused; only one place can then be touched.
 *
 * N = -lambda >= 0 [N] acts on body 1 along the normal, away from body 2; T = -lambda along e, with |T| <= mu N
 * (Coulomb), opposite to u where they slide; both at the point of contact.  Body 2 receives the opposite. */
#include "line.h"
#include "rod.h"

typedef struct {
  line line; /* of friction: the perpendicular one */
  rod rod;
  double radius, other;       /* R, R2 [m] */
  double is_disc;             /* 1: of two discs, 0: of a line; the other one of these is not used */
  const pw_path *path;        /* NULL: none; it takes the place of the line */
  double origin[2], cos, sin; /* of the path in body 2's frame; of its angle there */
  int rubs;                   /* 1: friction; 0: the gap */
} touch;

/* A contact in the current state. */
typedef struct {
  const touch *element;
  line_state line;
  rod_state rod;
  line_state other;    /* of a path: the line at right angles to `line` */
  pw_path_place place; /* of a path: the nearest one */
} touch_state;

/* Turns the lines to the normal and the tangent of a path at the place nearest to the centre. */
static inline void touch_find_place (touch_state *now) {
  const touch *element = now->element;
  const pw_configuration *body = now->line.body2;
  const double *D = now->line.D, x = body->cos * D[0] + body->sin * D[1] - element->origin[0],
               y = body->cos * D[1] - body->sin * D[0] - element->origin[1];
  double in_body[2], e[2];
  pw_path_nearest (element->path, element->cos * x + element->sin * y, element->cos * y - element->sin * x, INFINITY,
                   &now->place);
  in_body[0] = element->cos * now->place.cos - element->sin * now->place.sin;
  in_body[1] = element->sin * now->place.cos + element->cos * now->place.sin;
  to_world (body, in_body, e);
  now->other = now->line;
  line_set_normal (element->rubs ? &now->line : &now->other, e[0], e[1]);
  line_set_normal (element->rubs ? &now->other : &now->line, -e[1], e[0]);
}

static inline touch_state touch_at (const pw_batch *batch, int e) {
  const touch *element = (const touch *)batch->element + e;
  touch_state now = { element, line_of (&element->line, batch, e), rod_of (&element->rod, batch, e), .place = { 0 } };
  if (element->path) touch_find_place (&now);
  return now;
}

static int touch_check_path (const pw_contact *definition, pw_error *error) {
  if (definition->other_radius > 0) return pw_fail (error, PW_INPUT, "path and other_radius: expected one of them");
  if (!pw_path_is_smooth (definition->path))
    return pw_fail (error, PW_INPUT, "path: a polyline: expected a cubic path, which has a normal everywhere");
  const double s = pw_path_tight (definition->path, definition->radius);
  if (isnan (s)) return PW_OK;
  return pw_fail (
      error, PW_INPUT,
      "radius = %g: the disc does not fit at s = %.6g m of the path: expected a radius with which it touches "
      "only one place at a time",
      definition->radius, s);
}

static int touch_make (const pw_contact *definition, int rubs, touch *element, pw_error *error) {
  const double length = definition->radius + definition->other_radius, turn = rubs ? -PW_PI / 2 : 0;
  *element = (touch){ line_make (definition->at, definition->heading + turn),
                      { points_make (definition->at), length > 0 ? length : 1 },
                      definition->radius,
                      definition->other_radius,
                      definition->other_radius > 0,
                      definition->path,
                      { definition->at[1][0], definition->at[1][1] },
                      pw_cos (definition->heading),
                      pw_sin (definition->heading),
                      rubs };
  if (element->path && !rubs && touch_check_path (definition, error) != PW_OK) return PW_INPUT;
  if (element->is_disc != 0 && definition->heading != 0)
    return pw_fail (error, PW_INPUT, "heading = %g: expected none: with other_radius, body 2 has a disc, not a line",
                    definition->heading);
  if (definition->mu_sliding > definition->mu)
    return pw_fail (error, PW_INPUT, "mu_sliding = %g: expected at most the mu, %g", definition->mu_sliding,
                    definition->mu);
  return PW_OK;
}

/* A path that turns adds terms to the functions of a line.  They consist of the lines along its tangent and its normal
 * in a state, and of multiples of these. */
typedef struct {
  const line_state *along, *across;
  double Je[6], Jn[6], ve, vn; /* of e and n: J, J v */
  double b, b_e, b_n;          /* b_q = b_e Je + b_n Jn */
  double v[6];
  double side; /* 1: friction; -1: the gap */
} bend_state;

static inline bend_state bend_of (const touch_state *now) {
  const int rubs = now->element->rubs;
  const double k = now->place.curvature[0], room = fmax (1 - k * now->place.offset, 1e-12);
  bend_state out = { rubs ? &now->line : &now->other, rubs ? &now->other : &now->line, .b = k / room,
                     .side = rubs ? 1 : -1 };
  out.b_e = now->place.curvature[1] / (room * room * room), out.b_n = out.b * out.b;
  velocities_of (now->line.body1, now->line.body2, out.v);
  line_J_one (*out.along, out.Je);
  line_J_one (*out.across, out.Jn);
  for (int j = 0; j < 6; j++) out.ve += out.Je[j] * out.v[j], out.vn += out.Jn[j] * out.v[j];
  return out;
}

/* n.D' of friction, e.D' of the gap */
static inline double bend_other_rate (const bend_state *of) {
  return of->side > 0 ? of->vn : of->ve;
}

static inline void bend_gamma (const touch_state *now, double *out) {
  const bend_state of = bend_of (now);
  *out -= of.side * of.b * of.ve * bend_other_rate (&of);
}

static inline void bend_jw_q (const touch_state *now, double *out) {
  const bend_state of = bend_of (now);
  const double *J = of.side > 0 ? of.Jn : of.Je;
  double Jw = 0;
  for (int j = 0; j < 6; j++) Jw += J[j] * now->line.w[j];
  for (int j = 0; j < 6; j++) out[j] += of.side * of.b * Jw * of.Je[j];
}

static inline void bend_gamma_v (const touch_state *now, double *out) {
  const bend_state of = bend_of (now);
  const double *J = of.side > 0 ? of.Jn : of.Je, other = bend_other_rate (&of);
  for (int j = 0; j < 6; j++) out[j] -= of.side * of.b * (other * of.Je[j] + of.ve * J[j]);
}

static inline void bend_gamma_q (const touch_state *now, double *out) {
  const bend_state of = bend_of (now);
  const double other = bend_other_rate (&of);
  double line_gamma, ve_q[6], vn_q[6];
  line_gamma_one (of.side > 0 ? *of.across : *of.along, &line_gamma);
  line_multiply_H (of.along, 1, of.v, ve_q);
  line_multiply_H (of.across, 1, of.v, vn_q);
  for (int j = 0; j < 6; j++) ve_q[j] += of.b * of.vn * of.Je[j], vn_q[j] -= of.b * of.ve * of.Je[j];
  for (int j = 0; j < 6; j++)
    out[j] += of.side * (of.b * line_gamma * of.Je[j] - (of.b_e * of.Je[j] + of.b_n * of.Jn[j]) * of.ve * other -
                         of.b * (ve_q[j] * other + of.ve * (of.side > 0 ? vn_q[j] : ve_q[j])));
}

#define bend_J(now, out) (void)0

PREPARE (touch_prepare, pw_contact, touch) {
  return touch_make (definition, 0, element, error);
}

PER_ELEMENT (touch_g, touch, 1) {
  now.element->is_disc != 0 ? rod_g_one (now.rod, out) : line_g_one (now.line, out);
  if (now.element->path) *out = now.place.offset;
  if (now.element->is_disc == 0) *out -= now.element->radius;
}

PER_ELEMENT (touch_g_size, touch, 1) {
  now.element->is_disc != 0 ? rod_g_size_one (now.rod, out) : line_g_size_one (now.line, out);
  if (now.element->is_disc == 0) *out += now.element->radius;
  if (now.element->path)
    *out += fabs (now.element->origin[0]) + fabs (now.element->origin[1]) + fabs (now.place.x) + fabs (now.place.y);
}

/* type: touch, the gap, or rub, friction; disc: of the functions for two discs. */
#define TOUCH(type, disc, function, size)                                                                       \
  PER_ELEMENT (type##_##function, type, size) {                                                                 \
    now.element->is_disc != 0 ? disc##_##function##_one (now.rod, out) : line_##function##_one (now.line, out); \
    if (now.element->path) bend_##function (&now, out);                                                         \
  }
TOUCH (touch, rod, J, 6)
TOUCH (touch, rod, gamma, 1)
TOUCH (touch, rod, jw_q, 6)
TOUCH (touch, rod, gamma_q, 6)
TOUCH (touch, rod, gamma_v, 6)

J_GAMMA (touch, 6, 1)

static void touch_limits (const void *definition, pw_bounds *limit) {
  limit->most = 0;
  limit->restitution = ((const pw_contact *)definition)->restitution;
}

static int touch_has_friction (const void *definition) {
  return ((const pw_contact *)definition)->mu > 0;
}

PREPARE (rub_prepare, pw_contact, touch) {
  return touch_make (definition, 1, element, error);
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

static inline void discs_gamma_one (rod_state of, double *out) {
  double e[2], c[2];
  rub_tangent (&of, e);
  points_gamma_one (of.ends, c);
  *out = rod_dot (e, c) / of.L;
}

/* ((D w) turned^T D + e^T (D w)_q) / L, as rod_jw_q */
static inline void discs_jw_q_one (rod_state of, double *out) {
  const points_state *ends = &of.ends;
  double e[2], Dw[2] = { 0, 0 };
  rub_tangent (&of, e);
  for (int j = 0; j < 6; j++) Dw[0] -= of.D[6 + j] * ends->w[j], Dw[1] += of.D[j] * ends->w[j];
  rod_multiply_D (&of, Dw, out);
  out[2] -= rod_dot (e, ends->S1) * ends->w[2] / of.L;
  out[5] += rod_dot (e, ends->S2) * ends->w[5] / of.L;
}

/* (c turned^T D + e^T c_q) / L, as rod_gamma_q */
static inline void discs_gamma_q_one (rod_state of, double *out) {
  double e[2], c[2];
  rub_tangent (&of, e);
  points_gamma_one (of.ends, c);
  rod_multiply_D (&of, (const double[2]){ -c[1], c[0] }, out);
  out[2] += of.omega1 * of.omega1 * (e[0] * of.D[2] + e[1] * of.D[8]) / of.L;
  out[5] += of.omega2 * of.omega2 * (e[0] * of.D[5] + e[1] * of.D[11]) / of.L;
}

static inline void discs_gamma_v_one (rod_state of, double *out) {
  double e[2];
  rub_tangent (&of, e);
  memset (out, 0, 6 * sizeof *out);
  out[2] = 2 * of.omega1 * rod_dot (e, of.ends.S1) / of.L;
  out[5] = -2 * of.omega2 * rod_dot (e, of.ends.S2) / of.L;
}

TOUCH (rub, discs, gamma, 1)
TOUCH (rub, discs, jw_q, 6)
TOUCH (rub, discs, gamma_q, 6)
TOUCH (rub, discs, gamma_v, 6)
J_GAMMA (rub, 6, 1)

static void rub_loss (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) {
    double S[6], v[6];
    velocities_of (batch_body (batch, 2 * e), batch_body (batch, 2 * e + 1), v);
    rub_J_one (rub_at (batch, e), S);
    out[e] = 0;
    for (int i = 0; i < 6; i++) out[e] += batch->lambda[e] * S[i] * v[i];
  }
}

static void rub_limits (const void *definition, pw_bounds *limit) {
  const pw_contact *x = definition;
  const double sliding = x->specified || x->mu_sliding > 0 ? x->mu_sliding : x->mu;
  if (x->mu == 0) return;
  *limit = (pw_bounds){ -x->mu, x->mu, { -sliding, sliding }, .initially_slides = 1, .relative = 1 };
}

static const pw_field touch_fields[] = {
  { PW_AT (pw_contact, body), PW_BODY, .count = 2, .required = 1,
    .about = "the body with the point or disc, and the body with the line, disc or path; one may be ground" },
  { PW_AT (pw_contact, at), PW_POINT, .count = 2, .unit = "m", .required = 1,
    .about = "the point or centre in the first body's frame; in the second's a point of the line, the centre, or the "
             "origin of the path" },
  { PW_AT (pw_contact, heading), PW_NUMBER, .unit = "rad",
    .about =
        "direction of the line, or of the x axis of the path, in the second body's frame; the first body is on the "
        "left of the line or path" },
  { PW_AT (pw_contact, radius), PW_NUMBER, .unit = "m", .domain = PW_NONNEGATIVE,
    .about = "of the first body's disc; 0: a point" },
  { PW_AT (pw_contact, other_radius), PW_NUMBER, .unit = "m", .domain = PW_NONNEGATIVE,
    .about = "of the second body's disc; 0: a line" },
  { PW_AT (pw_contact, path), PW_TRACK,
    .about = "a cubic path in place of the line; the disc must fit everywhere on its left" },
  { PW_AT (pw_contact, restitution), PW_NUMBER, .domain = PW_FRACTION,
    .about = "normal velocity after an impact over that before it" },
  { PW_AT (pw_contact, mu), PW_NUMBER, .domain = PW_NONNEGATIVE,
    .about = "largest friction over normal force; 0: no friction" },
  { PW_AT (pw_contact, mu_sliding), PW_NUMBER, .domain = PW_NONNEGATIVE, .given = offsetof (pw_contact, specified),
    .about = "the same while it slides, at most mu; left out: mu" },
  { .name = NULL },
};

const pw_kind pw_kind_contact = {
  .name = "contact",
  .about = "a point or disc of one body does not enter the half plane or disc of another, or cross its path",
  .symbol = "d 0 radius; d 1 other_radius; path=0: other_radius=0: 1 -inf 0 1 inf 0; path=0: other_radius=0: h 0; p",
  TYPE (touch, pw_contact, touch),
  .bodies = 2,
  .rows = 1,
  .level = PW_HOLONOMIC,
  REACTION ("N", "N", "force on the first body along the normal, away from the second"),
  POSITION (touch),
  CONSTRAINT (touch),
  .J_gamma = touch_J_gamma,
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
  .J_gamma = rub_J_gamma,
  .loss = rub_loss,
  .limits = rub_limits,
};
