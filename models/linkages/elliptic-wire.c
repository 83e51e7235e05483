/* Bead on an elliptic wire, attracted by a focus of the ellipse: a model that defines two element types, a force and a
 * constraint.
 *
 * At Kepler's speed v_K, that of a planet at the bead's position (factor = 1), the reaction of the wire is zero.  At
 * any other speed v the difference v^2 - v_K^2 is constant and the reaction, positive towards the inside, is m (v^2 -
 * v_K^2) / rho = m (factor^2 - 1) v_K(0)^2 / rho, with the initial v_K(0) and the radius of curvature rho.  The output
 * `orbit.multiplier` is this force times -1 / sqrt ((X/a)^2 + (Y a/b^2)^2). (Bonnet's theorem, 1844; Whittaker 1937,
 * Analytical Dynamics, section 51.) */
#include <math.h>
#include "pinwheel.h"

/* ---- attraction: gravitation between body 1 and body 2 ----
 *
 * With d from body 2 to body 1 and r = |d|: force -k d / r^3 on body 1, k d / r^3 on body 2; energy -k / r. */

typedef struct {
  const char *name;
  const char *body[2]; /* the two bodies, or "ground": its origin */
  double strength;     /* k [N m^2], >= 0 */
} attraction;

static const pw_field attraction_fields[] = {
  { PW_AT (attraction, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies, or ground: its origin" },
  { PW_AT (attraction, strength), PW_NUMBER, .unit = "N m^2", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "force times square of the distance" },
  { .name = NULL },
};

static int attraction_prepare (const void *definition, const pw_body *const *bodies, void *element,
                               pw_internal *internal, pw_error *error) {
  (void)bodies, (void)internal, (void)error;
  *(double *)element = ((const attraction *)definition)->strength;
  return PW_OK;
}

static double attraction_distance (const pw_batch *batch, int e, double d[2]) {
  const pw_configuration *body1 = &batch->configuration[batch->body[2 * e]],
                         *body2 = &batch->configuration[batch->body[2 * e + 1]];
  d[0] = body1->x - body2->x, d[1] = body1->y - body2->y;
  return hypot (d[0], d[1]);
}

static void attraction_force (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++, out += 6) {
    double d[2], r = attraction_distance (batch, e, d), pull = -((const double *)batch->element)[e] / (r * r * r);
    out[0] = pull * d[0], out[1] = pull * d[1], out[2] = 0;
    out[3] = -out[0], out[4] = -out[1], out[5] = 0;
  }
}

static void attraction_energy (const pw_batch *batch, double *out) {
  double d[2];
  for (int e = 0; e < batch->count; e++)
    out[e] = -((const double *)batch->element)[e] / attraction_distance (batch, e, d);
}

static const pw_kind attraction_kind = {
  .name = "attraction",
  .about = "two bodies attract each other with the inverse square of their distance",
  .definition = sizeof (attraction),
  .element = sizeof (double),
  .fields = attraction_fields,
  .bodies = 2,
  .level = PW_FORCE,
  .prepare = attraction_prepare,
  .force = attraction_force,
  .force_q = PW_BY_DIFFERENCES,
  .energy = attraction_energy,
};

/* ---- wire: a body's centre of mass stays on an ellipse of the ground ----
 *
 * With (X, Y) from the ellipse's centre: g = ((X/a)^2 + (Y/b)^2 - 1) a/2 = 0,  G = (X/a, Y a/b^2, 0),
 * gamma = -(vx^2/a + vy^2 a/b^2).  The force on the body is -lambda (X/a, Y a/b^2). */

typedef struct {
  const char *name;
  const char *body;
  double centre[2]; /* in the world [m] */
  double axis[2];   /* semi-axes along x and y [m], > 0 */
} wire;

static const pw_field wire_fields[] = {
  { PW_AT (wire, body), PW_BODY, .required = 1, .about = "the body on the wire" },
  { PW_AT (wire, centre), PW_VECTOR, .unit = "m", .about = "centre of the ellipse, in the world" },
  { PW_AT (wire, axis), PW_NUMBER, .count = 2, .unit = "m", .required = 1, .domain = PW_POSITIVE,
    .about = "semi-axes along x and y" },
  { .name = NULL },
};

static const pw_quantity wire_reaction[] = {
  { "multiplier", "N", NULL, "times (X/a, Y a/b^2), outwards: the force on the body; X, Y: from the centre" }
};

/* Parameters of a wire: centre, a; J = (J_x X, J_y Y, 0) with J_x = 1/a, J_y = a/b^2. */
typedef struct {
  double x, y, a, J_x, J_y;
} wire_element;

static int wire_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                         pw_error *error) {
  const wire *d = definition;
  double a = d->axis[0], b = d->axis[1];
  (void)bodies, (void)internal, (void)error;
  *(wire_element *)element = (wire_element){ d->centre[0], d->centre[1], a, 1 / a, a / (b * b) };
  return PW_OK;
}

/* A wire in the current state: position of the body relative to the centre, its velocity; parameters. */
typedef struct {
  double X, Y, vx, vy, a, J_x, J_y;
} wire_state;

static wire_state wire_at (const pw_batch *batch, int e) {
  const wire_element *element = (const wire_element *)batch->element + e;
  const pw_configuration *body = &batch->configuration[batch->body[e]];
  return (wire_state){ body->x - element->x, body->y - element->y, body->vx,    body->vy,
                       element->a,           element->J_x,         element->J_y };
}

static void wire_g (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) {
    wire_state now = wire_at (batch, e);
    out[e] = (now.J_x * now.X * now.X + now.J_y * now.Y * now.Y - now.a) / 2;
  }
}

static void wire_g_size (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) {
    wire_state now = wire_at (batch, e);
    out[e] = (now.J_x * now.X * now.X + now.J_y * now.Y * now.Y + now.a) / 2;
  }
}

static void wire_J (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++, out += 3) {
    wire_state now = wire_at (batch, e);
    out[0] = now.J_x * now.X, out[1] = now.J_y * now.Y, out[2] = 0;
  }
}

static void wire_gamma (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) {
    wire_state now = wire_at (batch, e);
    out[e] = -(now.J_x * now.vx * now.vx + now.J_y * now.vy * now.vy);
  }
}

static void wire_jw_q (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++, out += 3) {
    wire_state now = wire_at (batch, e);
    out[0] = now.J_x * batch->w[3 * e], out[1] = now.J_y * batch->w[3 * e + 1], out[2] = 0;
  }
}

static void wire_gamma_v (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++, out += 3) {
    wire_state now = wire_at (batch, e);
    out[0] = -2 * now.J_x * now.vx, out[1] = -2 * now.J_y * now.vy, out[2] = 0;
  }
}

static const pw_kind wire_kind = {
  .name = "wire",
  .about = "the centre of mass of a body stays on an ellipse",
  .definition = sizeof (wire),
  .element = sizeof (wire_element),
  .fields = wire_fields,
  .bodies = 1,
  .rows = 1,
  .level = PW_HOLONOMIC,
  .reaction = wire_reaction,
  .prepare = wire_prepare,
  .g = wire_g,
  .g_size = wire_g_size,
  .J = wire_J,
  .gamma = wire_gamma,
  .jw_q = wire_jw_q,
  .gamma_v = wire_gamma_v,
};

/* ---- The model ---- */

typedef struct {
  double m, mu, a, e, factor;
} model;

static const pw_parameter parameters[] = {
  { PW_AT (model, m), 1, "kg", "mass of the bead", PW_POSITIVE },
  { PW_AT (model, mu), 1, "m^3/s^2", "strength of the attraction divided by the mass", PW_POSITIVE },
  { PW_AT (model, a), 1, "m", "long semi-axis of the wire", PW_POSITIVE },
  { PW_AT (model, e), 0.6, "", "its eccentricity, below 1", PW_NONNEGATIVE },
  { PW_AT (model, factor), 1, "", "initial speed divided by that of a planet", PW_REAL },
  { .name = NULL },
};

/* The attracting focus is the origin of the ground; the bead starts at the nearest point of the wire.  Its moment of
 * inertia has no effect. */
static void build (pw_model *m, const void *parameter) {
  const model *p = parameter;
  if (p->e >= 1) {
    pw_model_refuse (m, "e = %g: an ellipse has an eccentricity below 1", p->e);
    return;
  }
  double b = p->a * sqrt (1 - p->e * p->e), v = sqrt (p->mu / p->a * (1 + p->e) / (1 - p->e));
  pw_add_body (m, &(pw_body){ .name = "bead",
                              .mass = p->m,
                              .inertia = 1e-3 * p->m * p->a * p->a,
                              .start = { p->a * (1 - p->e), 0, 0 },
                              .rate = { 0, p->factor * v, 0 } });
  pw_add (m, &attraction_kind, &(attraction){ .name = "sun", .body = { "bead", "ground" }, .strength = p->m * p->mu });
  pw_add (m, &wire_kind,
          &(wire){ .name = "orbit", .body = "bead", .centre = { -p->a * p->e, 0 }, .axis = { p->a, b } });
}

PW_MODEL (.about = "bead on an elliptic wire, attracted by a focus; defines two element types",
          .parameters = parameters, .parameters_size = sizeof (model),
          .run = { .t_end = 6, .step = 1e-3, .method = "rk4+projection" }, .build = build);
