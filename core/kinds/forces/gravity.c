/* gravity: the same acceleration a for every body that has mass.
 *
 *   f = (m ax, m ay, 0),  V = -m (ax x + ay y)                    (V = 0 at the origin) */
#include "batch.h"

typedef struct {
  double fx, fy; /* weight [N] */
} gravity;

typedef struct {
  const gravity *k;
  const pw_configuration *A;
} gravity_state;

static inline gravity_state gravity_at (const pw_batch *b, int e) {
  return (gravity_state){ (const gravity *)b->element + e, batch_body (b, e, 1, 0) };
}

PREPARE (gravity_prepare, pw_gravity, gravity) {
  double m = bodies[0]->mass;
  *k = (gravity){ m * d->acceleration[0], m * d->acceleration[1] };
  return PW_OK;
}

PER_ELEMENT (gravity_force, gravity, 3) {
  out[0] = x.k->fx, out[1] = x.k->fy, out[2] = 0;
}

PER_ELEMENT (gravity_energy, gravity, 1) {
  *out = -x.k->fx * x.A->x - x.k->fy * x.A->y;
}

static const pw_field gravity_fields[] = {
  { PW_AT (pw_gravity, acceleration), PW_VECTOR, .unit = "m/s^2", .required = 1,
    .about = "in the world frame; (0, -9.81) in a vertical plane" },
  { .name = NULL },
};

const pw_kind pw_kind_gravity = {
  .name = "gravity",
  .about = "the same acceleration for every body that has mass",
  DEFINITION (pw_gravity, gravity_fields),
  ELEMENT (gravity, gravity_prepare),
  .bodies = 1,
  .each_body = 1,
  .constant = 1,
  .force = gravity_force,
  .energy = gravity_energy,
};
