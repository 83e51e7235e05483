/* The element types of toys.h. */
#include <math.h>
#include "toys.h"

/* ---- spring: V = k (l - l0)^2 / 2, force -(k (l - l0) + c l') along the line, l its length ---- */

typedef struct {
  double s[2][2], k, l0, c; /* ends in the frames of the bodies [m], [N/m], [m], [N s/m] */
} spring;

typedef struct {
  double X[2], Y[2];  /* arms in world axes */
  double ex, ey, l;   /* direction from point 2 to point 1, length */
  double rate, force; /* l', force that pulls the points together */
} spring_state;

static spring_state spring_at (const pw_batch *b, int e) {
  const spring *p = (const spring *)b->element + e;
  const pw_configuration *A[2] = { &b->configuration[b->body[2 * e]], &b->configuration[b->body[2 * e + 1]] };
  spring_state s;
  double px[2], py[2], vx[2], vy[2];
  for (int i = 0; i < 2; i++) {
    s.X[i] = A[i]->cos * p->s[i][0] - A[i]->sin * p->s[i][1];
    s.Y[i] = A[i]->sin * p->s[i][0] + A[i]->cos * p->s[i][1];
    px[i] = A[i]->x + s.X[i], py[i] = A[i]->y + s.Y[i];
    vx[i] = A[i]->vx - A[i]->omega * s.Y[i], vy[i] = A[i]->vy + A[i]->omega * s.X[i];
  }
  s.l = hypot (px[0] - px[1], py[0] - py[1]);
  s.ex = (px[0] - px[1]) / s.l, s.ey = (py[0] - py[1]) / s.l;
  s.rate = s.ex * (vx[0] - vx[1]) + s.ey * (vy[0] - vy[1]);
  s.force = p->k * (s.l - p->l0) + p->c * s.rate;
  return s;
}

static int spring_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                           pw_error *error) {
  const toy_spring *d = definition;
  *(spring *)element =
      (spring){ { { d->at[0][0], d->at[0][1] }, { d->at[1][0], d->at[1][1] } }, d->stiffness, d->length, d->damping };
  (void)bodies, (void)internal;
  if (d->length > 1.2) return pw_fail (error, PW_INPUT, "a length of %g is too long", d->length);
  return PW_OK;
}

/* dl/dq, q: x, y, phi of both bodies. */
static void spring_gradient (const spring_state *s, double d[6]) {
  d[0] = s->ex, d[1] = s->ey, d[2] = -s->ex * s->Y[0] + s->ey * s->X[0];
  d[3] = -s->ex, d[4] = -s->ey, d[5] = s->ex * s->Y[1] - s->ey * s->X[1];
}

static void spring_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    spring_state s = spring_at (b, e);
    spring_gradient (&s, out);
    for (int c = 0; c < 6; c++) out[c] *= -s.force;
  }
}

static void spring_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 36) {
    spring_state s = spring_at (b, e);
    double d[6];
    spring_gradient (&s, d);
    for (int i = 0; i < 36; i++) out[i] = -((const spring *)b->element)[e].c * d[i / 6] * d[i % 6];
  }
}

static void spring_energy (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    const spring *p = (const spring *)b->element + e;
    double stretch = spring_at (b, e).l - p->l0;
    out[e] = p->k * stretch * stretch / 2;
  }
}

static void spring_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    double rate = spring_at (b, e).rate;
    out[e] = ((const spring *)b->element)[e].c * rate * rate;
  }
}

static const pw_field spring_fields[] = {
  { PW_AT (toy_spring, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies" },
  { PW_AT (toy_spring, at), PW_POINT, .count = 2, .unit = "m", .about = "its ends" },
  { PW_AT (toy_spring, stiffness), PW_NUMBER, .unit = "N/m", .domain = PW_NONNEGATIVE, .about = "stiffness" },
  { PW_AT (toy_spring, length), PW_NUMBER, .unit = "m", .domain = PW_POSITIVE, .about = "length at rest" },
  { PW_AT (toy_spring, damping), PW_NUMBER, .unit = "N s/m", .domain = PW_NONNEGATIVE, .about = "damping" },
  { .name = NULL },
};

const pw_kind toy_kind_spring = {
  .name = "spring",
  .about = "a spring with a damper",
  .definition = sizeof (toy_spring),
  .element = sizeof (spring),
  .fields = spring_fields,
  .bodies = 2,
  .level = PW_FORCE,
  .prepare = spring_prepare,
  .force = spring_force,
  .force_q = PW_BY_DIFFERENCES,
  .force_v = spring_force_v,
  .energy = spring_energy,
  .loss = spring_loss,
};

/* ---- drive: g = phi1 - phi2 - u ---- */

static void drive_g (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++)
    out[e] = b->configuration[b->body[2 * e]].phi - b->configuration[b->body[2 * e + 1]].phi - b->u[3 * e];
}

static void drive_g_size (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++)
    out[e] = fabs (b->configuration[b->body[2 * e]].phi) + fabs (b->configuration[b->body[2 * e + 1]].phi) +
             fabs (b->u[3 * e]);
}

static void drive_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) out[0] = out[1] = out[3] = out[4] = 0, out[2] = 1, out[5] = -1;
}

static void drive_eta (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) out[e] = b->u[3 * e + 1];
}

static void drive_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) out[e] = b->u[3 * e + 2];
}

static const pw_field drive_fields[] = {
  { PW_AT (toy_drive, body), PW_BODY, .count = 2, .required = 1, .about = "the two bodies" },
  { PW_AT (toy_drive, angle), PW_SIGNAL, .unit = "rad", .required = 1, .about = "the angle between them" },
  { .name = NULL },
};

static const pw_quantity drive_reaction[] = { { "M", "N m", NULL, "moment on the first body" } };

const pw_kind toy_kind_drive = {
  .name = "drive",
  .about = "the angle between two bodies follows a signal",
  .definition = sizeof (toy_drive),
  .fields = drive_fields,
  .bodies = 2,
  .rows = 1,
  .signals = 1,
  .level = PW_HOLONOMIC,
  .reaction = drive_reaction,
  .g = drive_g,
  .g_size = drive_g_size,
  .eta = drive_eta,
  .J = drive_J,
  .gamma = drive_gamma,
};

/* ---- roller: n . v_P = 0 and d . v_P = r s', with d = (cos, sin) phi the heading and s its spin ---- */

typedef struct {
  double at[2], r; /* contact point, radius [m] */
} roller;

static int roller_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                           pw_error *error) {
  const toy_roller *d = definition;
  *(roller *)element = (roller){ { d->at[0], d->at[1] }, d->radius };
  internal[0].mass = d->inertia;
  (void)bodies, (void)error;
  return PW_OK;
}

static void roller_J (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 8) {
    const roller *p = (const roller *)b->element + e;
    const pw_configuration *A = &b->configuration[b->body[e]];
    out[0] = -A->sin, out[1] = A->cos, out[2] = p->at[0], out[3] = 0;
    out[4] = A->cos, out[5] = A->sin, out[6] = -p->at[1], out[7] = -p->r;
  }
}

static void roller_gamma (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 2) {
    const pw_configuration *A = &b->configuration[b->body[e]];
    out[0] = A->omega * (A->cos * A->vx + A->sin * A->vy);
    out[1] = A->omega * (A->sin * A->vx - A->cos * A->vy);
  }
}

static const pw_field roller_fields[] = {
  { PW_AT (toy_roller, body), PW_BODY, .required = 1, .about = "the body that carries it" },
  { PW_AT (toy_roller, at), PW_POINT, .unit = "m", .required = 1, .about = "contact point" },
  { PW_AT (toy_roller, radius), PW_NUMBER, .unit = "m", .required = 1, .domain = PW_POSITIVE, .about = "radius" },
  { PW_AT (toy_roller, inertia), PW_NUMBER, .unit = "kg m^2", .domain = PW_NONNEGATIVE, .about = "about its axle" },
  { .name = NULL },
};

static const pw_quantity roller_reaction[] = {
  { "N", "N", NULL, "lateral force on the body" },
  { "T", "N", NULL, "force on the body along the heading" },
};

static const pw_quantity roller_coordinate[] = { { "spin", "rad", "spinrate", "angle about its axle" } };

const pw_kind toy_kind_roller = {
  .name = "roller",
  .about = "a wheel that rolls without slip",
  .definition = sizeof (toy_roller),
  .element = sizeof (roller),
  .fields = roller_fields,
  .bodies = 1,
  .internal = 1,
  .rows = 2,
  .level = PW_NONHOLONOMIC,
  .reaction = roller_reaction,
  .coordinate = roller_coordinate,
  .prepare = roller_prepare,
  .J = roller_J,
  .gamma = roller_gamma,
  .jw_q = PW_BY_DIFFERENCES,
  .gamma_q = PW_BY_DIFFERENCES,
  .gamma_v = PW_BY_DIFFERENCES,
};

/* ---- weight: f = m g, V = -m g . r ---- */

typedef struct {
  double f[2]; /* [N] */
} weight;

static int weight_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                           pw_error *error) {
  const toy_weight *d = definition;
  *(weight *)element = (weight){ { bodies[0]->mass * d->g[0], bodies[0]->mass * d->g[1] } };
  (void)internal, (void)error;
  return PW_OK;
}

static void weight_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    const weight *p = (const weight *)b->element + e;
    out[0] = p->f[0], out[1] = p->f[1], out[2] = 0;
  }
}

static void weight_energy (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    const weight *p = (const weight *)b->element + e;
    const pw_configuration *A = &b->configuration[b->body[e]];
    out[e] = -p->f[0] * A->x - p->f[1] * A->y;
  }
}

static const pw_field weight_fields[] = {
  { PW_AT (toy_weight, g), PW_VECTOR, .unit = "m/s^2", .required = 1, .about = "acceleration of free fall" },
  { .name = NULL },
};

const pw_kind toy_kind_weight = {
  .name = "weight",
  .about = "the weight of every body",
  .definition = sizeof (toy_weight),
  .element = sizeof (weight),
  .fields = weight_fields,
  .bodies = 1,
  .each_body = 1,
  .constant = 1,
  .level = PW_FORCE,
  .prepare = weight_prepare,
  .force = weight_force,
  .energy = weight_energy,
};

const pw_kind *const toy_kinds[] = { &toy_kind_spring, &toy_kind_drive, &toy_kind_roller, &toy_kind_weight, NULL };
