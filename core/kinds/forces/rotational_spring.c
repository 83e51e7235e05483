/* rotational-spring: a spring and a parallel damper between the angles of two bodies; beta: free value of phi1 - phi2.
 *
 *   T = k (phi1 - phi2 - beta) + c (omega1 - omega2)
 *   f = (0, 0, -T | 0, 0, T)
 *   V = k (phi1 - phi2 - beta)^2 / 2,  loss = c (omega1 - omega2)^2
 *
 * (Shabana 2001, Computational Dynamics, section 6.5.)
 * A full turn changes phi1 - phi2 by 2 pi. */
#include "batch.h"

typedef struct {
  double stiffness, damping, free_angle; /* k [N m/rad], c [N m s/rad], beta [rad] */
} torsion;

typedef struct {
  const torsion *element;
  double angle, rate; /* phi1 - phi2 - beta, omega1 - omega2 */
} torsion_state;

static inline torsion_state torsion_at (const pw_batch *batch, int e) {
  const torsion *element = (const torsion *)batch->element + e;
  const pw_configuration *body1 = batch_body (batch, 2 * e), *body2 = batch_body (batch, 2 * e + 1);
  return (torsion_state){ element, body1->phi - body2->phi - element->free_angle, body1->omega - body2->omega };
}

PREPARE (torsion_prepare, pw_rotational_spring, torsion) {
  *element = (torsion){ definition->stiffness, definition->damping, definition->angle };
  return PW_OK;
}

PER_ELEMENT (torsion_force, torsion, 6) {
  opposite_moments (-(now.element->stiffness * now.angle + now.element->damping * now.rate), out);
}

PER_ELEMENT (torsion_force_q, torsion, 36) {
  opposite_moments_block (now.element->stiffness, out);
}

PER_ELEMENT (torsion_force_v, torsion, 36) {
  opposite_moments_block (now.element->damping, out);
}

PER_ELEMENT (torsion_energy, torsion, 1) {
  *out = now.element->stiffness * now.angle * now.angle / 2;
}

PER_ELEMENT (torsion_loss, torsion, 1) {
  *out = now.element->damping * now.rate * now.rate;
}

static const pw_field torsion_fields[] = {
  BODIES_FIELD (pw_rotational_spring),
  { PW_AT (pw_rotational_spring, stiffness), PW_NUMBER, .unit = "N m/rad", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "torque per angle" },
  { PW_AT (pw_rotational_spring, damping), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per angular velocity" },
  { PW_AT (pw_rotational_spring, angle), PW_NUMBER, .unit = "rad",
    .about = "free value of phi1 - phi2, the angle of the first body relative to the second" },
  { .name = NULL },
};

const pw_kind pw_kind_rotational_spring = {
  .name = "rotational-spring",
  .about = "a torsion spring and a parallel damper between two bodies",
  .symbol = "0 .4 0 0 .3 .4 0 -.2 .5 0 -.6 0 0 -.3 -.7 0 .4 -.8 0 .9 0 0 .7 .8 0 0 1.1 0 -.8 .9",
  TYPE (torsion, pw_rotational_spring, torsion),
  .bodies = 2,
  FORCE (torsion),
  .energy = torsion_energy,
  .loss = torsion_loss,
};
