/* gravity: the same acceleration a for every body that has mass.
 *
 *   f = (m ax, m ay, 0),  V = -m (ax x + ay y)                    (V = 0 at the origin) */
#include "pinwheel.h"

typedef struct {
  double fx, fy; /* weight [N] */
} gravity;

static int gravity_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                            pw_error *error) {
  const pw_gravity *d = definition;
  double m = bodies[0]->mass;
  *(gravity *)element = (gravity){ m * d->acceleration[0], m * d->acceleration[1] };
  (void)own, (void)error;
  return PW_OK;
}

static void gravity_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 3) {
    const gravity *k = (const gravity *)b->element + e;
    out[0] = k->fx, out[1] = k->fy, out[2] = 0;
  }
}

static void gravity_energy (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    const gravity *k = (const gravity *)b->element + e;
    const pw_configuration *A = &b->configuration[b->body[e]];
    out[e] = -k->fx * A->x - k->fy * A->y;
  }
}

static const pw_field gravity_fields[] = {
  { PW_AT (pw_gravity, acceleration), PW_VECTOR, .unit = "m/s^2", .required = 1,
    .about = "in the world; (0, -9.81) for a plane that stands upright" },
  { .name = NULL },
};

const pw_kind pw_kind_gravity = {
  .name = "gravity",
  .about = "the same acceleration for every body that has mass",
  .definition = sizeof (pw_gravity),
  .element = sizeof (gravity),
  .fields = gravity_fields,
  .bodies = 1,
  .each_body = 1,
  .constant = 1,
  .level = PW_FORCE,
  .prepare = gravity_prepare,
  .force = gravity_force,
  .energy = gravity_energy,
};
