/* force: an external force on a point of a body; two signals give its components along world or body axes.
 *
 *   F = (ux, uy) or R(phi) (ux, uy)
 *   f = (Fx, Fy, X Fy - Y Fx),  (X, Y) = R(phi) s
 *   power = F . v_P = Fx vx + Fy vy + (X Fy - Y Fx) w
 *
 * (Shabana 2001, Computational Dynamics, section 5.3.) It has no reaction on another body. */
#include <string.h>
#include "batch.h"

typedef struct {
  double at[2]; /* in the body's frame [m] */
  double turns; /* 1: components along the body's axes */
} force;

/* A force in the current state: cosine and sine of the angle of its axes, arm, world components, moment. */
typedef struct {
  const force *k;
  const pw_configuration *A;
  double cos, sin, X, Y, Fx, Fy, M;
} force_state;

static inline force_state force_at (const pw_batch *b, int e) {
  const force *k = (const force *)b->element + e;
  const pw_configuration *A = batch_body (b, e, 1, 0);
  const double *u = b->u + 6 * e;
  force_state x = { k, A, .cos = k->turns > 0 ? A->cos : 1, .sin = k->turns > 0 ? A->sin : 0 };
  x.X = A->cos * k->at[0] - A->sin * k->at[1], x.Y = A->sin * k->at[0] + A->cos * k->at[1];
  x.Fx = x.cos * u[0] - x.sin * u[3], x.Fy = x.sin * u[0] + x.cos * u[3];
  x.M = x.X * x.Fy - x.Y * x.Fx;
  return x;
}

PREPARE (force_prepare, pw_force, force) {
  *k = (force){ { d->at[0], d->at[1] }, d->axes == PW_AXES_BODY };
  return PW_OK;
}

PER_ELEMENT (force_force, force, 3) {
  out[0] = x.Fx, out[1] = x.Fy, out[2] = x.M;
}

PER_ELEMENT (force_force_u, force, 6) {
  out[0] = x.cos, out[1] = -x.sin;
  out[2] = x.sin, out[3] = x.cos;
  out[4] = x.X * x.sin - x.Y * x.cos, out[5] = x.X * x.cos + x.Y * x.sin;
}

/* A force that turns with the body has a constant moment. */
PER_ELEMENT (force_force_q, force, 9) {
  memset (out, 0, 9 * sizeof *out);
  if (x.k->turns > 0)
    out[2] = -x.Fy, out[5] = x.Fx;
  else
    out[8] = -x.X * x.Fx - x.Y * x.Fy;
}

PER_ELEMENT (force_power, force, 1) {
  *out = x.Fx * x.A->vx + x.Fy * x.A->vy + x.M * x.A->omega;
}

static const char *const force_axes[] = { "world", "body", NULL };

static const pw_field force_fields[] = {
  { PW_AT (pw_force, body), PW_BODY, .required = 1, .about = "the body on which it acts" },
  { PW_AT (pw_force, at), PW_POINT, .unit = "m", .about = "point of application in the body's frame" },
  { PW_AT (pw_force, axes), PW_CHOICE, .choices = force_axes,
    .about = "axes of the components; body axes rotate with the body" },
  { PW_AT (pw_force, fx), PW_SIGNAL, .unit = "N", .about = "component along x" },
  { PW_AT (pw_force, fy), PW_SIGNAL, .unit = "N", .about = "component along y" },
  { .name = NULL },
};

const pw_kind pw_kind_force = {
  .name = "force",
  .about = "an external force on a point of a body, given along world or body axes",
  DEFINITION (pw_force, force_fields),
  ELEMENT (force, force_prepare),
  .bodies = 1,
  .signals = 2,
  .force = force_force,
  .force_u = force_force_u,
  .force_q = force_force_q,
  .power = force_power,
};
