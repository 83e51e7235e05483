/* gravity: the same acceleration a for every body that has mass.
 *
 *   f = (m ax, m ay, 0),  V = -m (ax x + ay y)                    (V = 0 at the origin) */
#include "batch.h"

typedef struct {
  double fx, fy; /* m a [N] */
} gravity;

typedef struct {
  const gravity *element;
  const pw_configuration *body;
} gravity_state;

static inline gravity_state gravity_at (const pw_batch *batch, int e) {
  return (gravity_state){ (const gravity *)batch->element + e, batch_body (batch, e) };
}

PREPARE (gravity_prepare, pw_gravity, gravity) {
  double m = bodies[0]->mass;
  *element = (gravity){ m * definition->acceleration[0], m * definition->acceleration[1] };
  return PW_OK;
}

PER_ELEMENT (gravity_force, gravity, 3) {
  out[0] = now.element->fx, out[1] = now.element->fy, out[2] = 0;
}

PER_ELEMENT (gravity_energy, gravity, 1) {
  *out = -now.element->fx * now.body->x - now.element->fy * now.body->y;
}

static const pw_field gravity_fields[] = {
  { PW_AT (pw_gravity, acceleration), PW_VECTOR, .unit = "m/s^2", .required = 1,
    .about = "in the world frame; (0, -9.81) in a vertical plane" },
  { .name = NULL },
};

const pw_kind pw_kind_gravity = {
  .name = "gravity",
  .about = "the same acceleration for every body that has mass",
  TYPE (gravity, pw_gravity, gravity),
  .bodies = 1,
  .each_body = 1,
  .constant = 1,
  .force = gravity_force,
  .energy = gravity_energy,
};
