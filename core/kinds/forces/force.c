/* force: an external force on a point of a body; two signals give its components along world or body axes.
 *
 *   F = (ux, uy) or R(phi) (ux, uy)
 *   f = (Fx, Fy, X Fy - Y Fx),  (X, Y) = R(phi) s
 *   power = F . v_P = Fx vx + Fy vy + (X Fy - Y Fx) w
 *
 * (Shabana 2001, Computational Dynamics, section 5.3.) It has no reaction on another body. */
#include <string.h>
#include "pinwheel.h"

typedef struct {
  double at[2]; /* in the body's frame [m] */
  int turns;    /* 1: components along the body's axes */
} force;

/* A force in the current state: world components and moment; c, s: cosine and sine of the angle of its axes. */
typedef struct {
  double c, s, X, Y, Fx, Fy, M;
} force_state;

static inline force_state force_at (const force *k, const pw_configuration *A, const double *u) {
  force_state x = { .c = k->turns ? A->cos : 1, .s = k->turns ? A->sin : 0 };
  x.X = A->cos * k->at[0] - A->sin * k->at[1], x.Y = A->sin * k->at[0] + A->cos * k->at[1];
  x.Fx = x.c * u[0] - x.s * u[3], x.Fy = x.s * u[0] + x.c * u[3];
  x.M = x.X * x.Fy - x.Y * x.Fx;
  return x;
}

#define FORCE_PARTS                                          \
  const force *k = (const force *)b->element + e;            \
  const pw_configuration *A = &b->configuration[b->body[e]]; \
  const force_state x = force_at (k, A, b->u + 6 * e)

static int force_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                          pw_error *error) {
  const pw_force *d = definition;
  *(force *)element = (force){ { d->at[0], d->at[1] }, d->axes == PW_AXES_BODY };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void force_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    FORCE_PARTS;
    out[0] = x.Fx, out[1] = x.Fy, out[2] = x.M;
  }
}

static void force_force_u (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    FORCE_PARTS;
    out[0] = x.c, out[1] = -x.s;
    out[2] = x.s, out[3] = x.c;
    out[4] = x.X * x.s - x.Y * x.c, out[5] = x.X * x.c + x.Y * x.s;
  }
}

/* A force that turns with the body has a constant moment. */
static void force_force_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 9) {
    FORCE_PARTS;
    memset (out, 0, 9 * sizeof *out);
    if (k->turns)
      out[2] = -x.Fy, out[5] = x.Fx;
    else
      out[8] = -x.X * x.Fx - x.Y * x.Fy;
  }
}

static void force_power (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    FORCE_PARTS;
    out[e] = x.Fx * A->vx + x.Fy * A->vy + x.M * A->omega;
  }
}

static const char *const force_axes[] = { "world", "body", NULL };

static const pw_field force_fields[] = {
  { PW_AT (pw_force, body), PW_BODY, .required = 1, .about = "the body it acts on" },
  { PW_AT (pw_force, at), PW_POINT, .unit = "m", .about = "where it acts, in the body's frame" },
  { PW_AT (pw_force, axes), PW_CHOICE, .choices = force_axes,
    .about = "the axes its components are along; the body's turn with it" },
  { PW_AT (pw_force, fx), PW_SIGNAL, .unit = "N", .about = "component along x" },
  { PW_AT (pw_force, fy), PW_SIGNAL, .unit = "N", .about = "component along y" },
  { .name = NULL },
};

const pw_kind pw_kind_force = {
  .name = "force",
  .about = "a force from outside on a point of a body, along world or body axes",
  .definition = sizeof (pw_force),
  .element = sizeof (force),
  .fields = force_fields,
  .bodies = 1,
  .signals = 2,
  .level = PW_FORCE,
  .prepare = force_prepare,
  .force = force_force,
  .force_u = force_force_u,
  .force_q = force_force_q,
  .power = force_power,
};
