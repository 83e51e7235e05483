/* Continuously variable transmission, and the contact oscillator: a carriage sets the ratio of two discs.
 *
 * At the carriage's position x the discs have the radii a1 + b1 x and a2 + b2 x and roll on a common belt:
 *
 *   (a1 + b1 x) y' = (a2 + b2 x) z'                               y, z: angles of the discs
 *
 * With radii x and 1 (a1 = 0) this is the contact oscillator z' = x y'; a1 = a2 = 1, b1 = 0.3, b2 = -0.3 is a
 * transmission with two cones.  With beta = 0 the motion is reversible, without eccentricity also integrable; both
 * favour symmetric methods.  A gyroscopic coupling beta of the first disc and the carriage destroys these properties
 * and conserves the energy.  (Modin & Verdier 2014, "Integrability of nonholonomically coupled oscillators"; Modin &
 * Verdier 2020, Numer. Math. 145, "What makes nonholonomic integrators work?", on perturbed problems.) */
#include <math.h>
#include "pinwheel.h"

/* ---- belt: discs 1 and 2 roll on a belt whose position is x of body 3 ----
 *
 *   r1 w1 - r2 w2 = 0,  r1 = a1 + b1 x3,  r2 = a2 + b2 x3              (1 nonholonomic equation)
 *   gamma = -(b1 w1 - b2 w2) vx3
 *
 * The belt's tension -lambda acts on the discs by the moments -lambda r1 and lambda r2. */

typedef struct {
  const char *name;
  const char *body[3];
  double a[2], b[2];
} belt;

static const pw_field belt_fields[] = {
  { PW_AT (belt, body), PW_BODY, .count = 3, .required = 1, .about = "two discs and the carriage" },
  { PW_AT (belt, a), PW_NUMBER, .count = 2, .unit = "m", .about = "radii with the carriage at x = 0" },
  { PW_AT (belt, b), PW_NUMBER, .count = 2, .about = "their slopes" },
  { .name = NULL },
};

static const pw_quantity belt_reaction[] = { { "T", "N", NULL, "tension of the belt" } };

typedef struct {
  double a[2], b[2];
} belt_element;

static int belt_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                         pw_error *error) {
  const belt *d = definition;
  (void)bodies, (void)internal, (void)error;
  *(belt_element *)element = (belt_element){ { d->a[0], d->a[1] }, { d->b[0], d->b[1] } };
  return PW_OK;
}

typedef struct {
  const double *b;
  double r1, r2, w1, w2, vx;
} belt_state;

static belt_state belt_at (const pw_batch *b, int e) {
  const belt_element *k = (const belt_element *)b->element + e;
  const pw_configuration *A = &b->configuration[b->body[3 * e]], *B = &b->configuration[b->body[3 * e + 1]];
  const pw_configuration *C = &b->configuration[b->body[3 * e + 2]];
  return (belt_state){ k->b, k->a[0] + k->b[0] * C->x, k->a[1] + k->b[1] * C->x, A->omega, B->omega, C->vx };
}

static void belt_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    belt_state s = belt_at (b, e);
    for (int i = 0; i < 9; i++) out[i] = 0;
    out[2] = s.r1, out[5] = -s.r2;
  }
}

static void belt_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    belt_state s = belt_at (b, e);
    out[e] = -(s.b[0] * s.w1 - s.b[1] * s.w2) * s.vx;
  }
}

static void belt_jw_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    const belt_element *k = (const belt_element *)b->element + e;
    for (int i = 0; i < 9; i++) out[i] = 0;
    out[6] = k->b[0] * b->w[9 * e + 2] - k->b[1] * b->w[9 * e + 5];
  }
}

static void belt_gamma_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    belt_state s = belt_at (b, e);
    for (int i = 0; i < 9; i++) out[i] = 0;
    out[2] = -s.b[0] * s.vx, out[5] = s.b[1] * s.vx, out[6] = -(s.b[0] * s.w1 - s.b[1] * s.w2);
  }
}

static const pw_kind belt_kind = {
  .name = "belt",
  .about = "two discs roll on a belt; the position of a carriage sets their radii",
  .definition = sizeof (belt),
  .element = sizeof (belt_element),
  .fields = belt_fields,
  .bodies = 3,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  .reaction = belt_reaction,
  .prepare = belt_prepare,
  .J = belt_J,
  .gamma = belt_gamma,
  .jw_q = belt_jw_q,
  .gamma_v = belt_gamma_v,
};

/* ---- gyro: force -beta w1 along x on body 2, moment beta vx2 on body 1; their total power is zero ---- */

typedef struct {
  const char *name;
  const char *body[2];
  double beta;
} gyro;

static const pw_field gyro_fields[] = {
  { PW_AT (gyro, body), PW_BODY, .count = 2, .required = 1, .about = "the disc and the carriage" },
  { PW_AT (gyro, beta), PW_NUMBER, .unit = "N s", .about = "gyroscopic coupling" },
  { .name = NULL },
};

static int gyro_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                         pw_error *error) {
  (void)bodies, (void)internal, (void)error;
  *(double *)element = ((const gyro *)definition)->beta;
  return PW_OK;
}

static void gyro_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    double beta = ((const double *)b->element)[e];
    for (int i = 0; i < 6; i++) out[i] = 0;
    out[2] = beta * b->configuration[b->body[2 * e + 1]].vx;
    out[3] = -beta * b->configuration[b->body[2 * e]].omega;
  }
}

static void gyro_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 36) {
    for (int i = 0; i < 36; i++) out[i] = 0;
    out[6 * 2 + 3] = ((const double *)b->element)[e];
    out[6 * 3 + 2] = -((const double *)b->element)[e];
  }
}

static const pw_kind gyro_kind = {
  .name = "gyro",
  .about = "gyroscopic coupling of a disc and a carriage",
  .definition = sizeof (gyro),
  .element = sizeof (double),
  .fields = gyro_fields,
  .bodies = 2,
  .level = PW_FORCE,
  .prepare = gyro_prepare,
  .force = gyro_force,
  .force_v = gyro_force_v,
};

/* ---- The model ---- */

typedef struct {
  double a1, b1, a2, b2, beta, x, y, rate, k, k1, k2, rest, off, g;
} model;

static const pw_parameter parameters[] = {
  { PW_AT (model, a1), 0.2, "m", "radius of the first disc at x = 0", PW_REAL },
  { PW_AT (model, b1), 1, "", "its slope", PW_REAL },
  { PW_AT (model, a2), 1, "m", "radius of the second disc at x = 0", PW_REAL },
  { PW_AT (model, b2), 0, "", "its slope", PW_REAL },
  { PW_AT (model, beta), 0.3, "N s", "gyroscopic coupling", PW_REAL },
  { PW_AT (model, x), 0.8, "m", "initial position of the carriage", PW_REAL },
  { PW_AT (model, y), 0.5, "rad", "initial angle of the first disc", PW_REAL },
  { PW_AT (model, rate), 0.6, "rad/s", "its initial angular velocity", PW_REAL },
  { PW_AT (model, k), 1, "N/m", "stiffness of the spring of the carriage (mass 1 kg)", PW_POSITIVE },
  { PW_AT (model, k1), 1.7, "N m/rad", "stiffness of the spring of the first disc (1 kg m^2 about its axle)",
    PW_NONNEGATIVE },
  { PW_AT (model, k2), 2.3, "N m/rad", "stiffness of the spring of the second disc (1 kg m^2)", PW_NONNEGATIVE },
  { PW_AT (model, rest), 0.3, "rad", "angle of the first disc without load", PW_REAL },
  { PW_AT (model, off), 0.1, "m", "eccentricity of the first disc (mass 1 kg), from -1 to 1", PW_REAL },
  { PW_AT (model, g), 9.81, "m/s^2", "gravity, along -y", PW_REAL },
  { .name = NULL },
};

/* The spring of the carriage has the free length 0: its force -k x is linear on both sides. */
static void build (pw_model *m, const void *parameter) {
  const model *p = parameter;
  double r1 = p->a1 + p->b1 * p->x, r2 = p->a2 + p->b2 * p->x, c = cos (p->y), s = sin (p->y), w = p->rate;
  if (r2 == 0) {
    pw_model_refuse (m, "a2 + b2 x = 0: the second disc has no radius at x = %g", p->x);
    return;
  }
  if (fabs (p->off) > 1) pw_model_refuse (m, "off = %g: expected a number from -1 to 1", p->off);
  pw_add_body (m, &(pw_body){ .name = "carriage", .mass = 1, .start = { p->x, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "first",
                              .mass = 1,
                              .inertia = 1 - p->off * p->off,
                              .start = { p->off * c, p->off * s, p->y },
                              .rate = { -p->off * s * w, p->off * c * w, w } });
  pw_add_body (m, &(pw_body){ .name = "second", .inertia = 1, .rate = { 0, 0, r1 * w / r2 } });
  pw_add_slider (m, &(pw_slider){ .name = "rail", .body = { "carriage", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "axle1", .body = { "first", "ground" }, .at = { { -p->off, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "axle2", .body = { "second", "ground" } });
  pw_add (
      m, &belt_kind,
      &(belt){
          .name = "belt", .body = { "first", "second", "carriage" }, .a = { p->a1, p->a2 }, .b = { p->b1, p->b2 } });
  pw_add (m, &gyro_kind, &(gyro){ .name = "gyro", .body = { "first", "carriage" }, .beta = p->beta });
  pw_add_spring (m, &(pw_spring){ .name = "carriage-spring", .body = { "carriage", "ground" }, .stiffness = p->k });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){
             .name = "spring1", .body = { "first", "ground" }, .stiffness = p->k1, .angle = p->rest });
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){ .name = "spring2", .body = { "second", "ground" }, .stiffness = p->k2 });
  pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -p->g } });
}

PW_MODEL (.about = "two discs on a belt that a carriage shifts: contact oscillator or variable transmission",
          .parameters = parameters, .parameters_size = sizeof (model),
          .run = { .t_end = 10, .step = 1e-2, .method = "rk4+projection" }, .build = build);
