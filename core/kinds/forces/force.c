/* force: an external force on a point of a body; two signals give its components along world or body axes.
 *
 *   F = (ux, uy) or R(phi) (ux, uy)
 *   f = (Fx, Fy, X Fy - Y Fx),  (X, Y) = R(phi) s
 *   power = F . v_P = Fx vx + Fy vy + (X Fy - Y Fx) omega
 *
 * (Shabana 2001, Computational Dynamics, section 5.3.)
 * There is no reaction on another body. */
#include <string.h>
#include "batch.h"

typedef struct {
  double at[2];     /* in the body's frame [m] */
  double body_axes; /* 1: components along the body's axes; 0: along the world's */
} force;

/* A force in the current state. */
typedef struct {
  const force *element;
  const pw_configuration *body;
  double cos, sin;  /* of the angle of the axes of ux, uy */
  double arm[2];    /* (X, Y) */
  double Fx, Fy, M; /* components in the world, moment */
} force_state;

static inline force_state force_at (const pw_batch *batch, int e) {
  const force *element = (const force *)batch->element + e;
  const pw_configuration *body = batch_body (batch, e);
  const double *ux = batch->u + 6 * e, *uy = ux + 3; /* three numbers for each signal, the first is its value */
  force_state now = { element, body, .cos = element->body_axes > 0 ? body->cos : 1,
                      .sin = element->body_axes > 0 ? body->sin : 0 };
  to_world (body, element->at, now.arm);
  now.Fx = now.cos * ux[0] - now.sin * uy[0], now.Fy = now.sin * ux[0] + now.cos * uy[0];
  now.M = now.arm[0] * now.Fy - now.arm[1] * now.Fx;
  return now;
}

PREPARE (force_prepare, pw_force, force) {
  *element = (force){ { definition->at[0], definition->at[1] }, definition->axes == PW_AXES_BODY };
  return PW_OK;
}

PER_ELEMENT (force_force, force, 3) {
  out[0] = now.Fx, out[1] = now.Fy, out[2] = now.M;
}

PER_ELEMENT (force_force_u, force, 6) {
  out[0] = now.cos, out[1] = -now.sin;
  out[2] = now.sin, out[3] = now.cos;
  out[4] = now.arm[0] * now.sin - now.arm[1] * now.cos, out[5] = now.arm[0] * now.cos + now.arm[1] * now.sin;
}

/* A force that turns with the body has a constant moment. */
PER_ELEMENT (force_force_q, force, 9) {
  memset (out, 0, 9 * sizeof *out);
  if (now.element->body_axes > 0)
    out[2] = -now.Fy, out[5] = now.Fx;
  else
    out[8] = -now.arm[0] * now.Fx - now.arm[1] * now.Fy;
}

PER_ELEMENT (force_power, force, 1) {
  *out = now.Fx * now.body->vx + now.Fy * now.body->vy + now.M * now.body->omega;
}

static const char *const force_axes[] = { "world", "body", NULL };

static const pw_field force_fields[] = {
  { PW_AT (pw_force, body), PW_BODY, .required = 1, .about = "the body on which it acts" },
  { PW_AT (pw_force, at), PW_POINT, .unit = "m", .about = "point of application in the body's frame" },
  { PW_AT (pw_force, axes), PW_CHOICE, .choices = force_axes, .turn = PW_TURN_WORLD,
    .about = "axes of the components; body axes rotate with the body" },
  { PW_AT (pw_force, fx), PW_SIGNAL, .unit = "N", .about = "component along x" },
  { PW_AT (pw_force, fy), PW_SIGNAL, .unit = "N", .about = "component along y" },
  { .name = NULL },
};

const pw_kind pw_kind_force = {
  .name = "force",
  .about = "an external force on a point of a body, given along world or body axes",
  TYPE (force, pw_force, force),
  .bodies = 1,
  .signals = 2,
  .force = force_force,
  .force_u = force_force_u,
  .force_q = force_force_q,
  .power = force_power,
};
