/* rotational-spring: a spring and a parallel damper between the angles of two bodies.
 *
 *   T = k (phi1 - phi2 - beta) + c (w1 - w2)
 *   f = (0, 0, -T | 0, 0, T)
 *   V = k (phi1 - phi2 - beta)^2 / 2,  loss = c (w1 - w2)^2
 *
 * (Shabana 2001, Computational Dynamics, section 6.5.)
 * Angles accumulate over full turns. */
#include "batch.h"

typedef struct {
  double k, c, beta; /* stiffness [N m/rad], damping [N m s/rad], free angle [rad] */
} twist;

/* A spring in the current state: twist and its rate. */
typedef struct {
  const twist *k;
  double angle, rate;
} twist_state;

static inline twist_state twist_at (const pw_batch *b, int e) {
  const twist *k = (const twist *)b->element + e;
  const pw_configuration *A = batch_body (b, e, 2, 0), *B = batch_body (b, e, 2, 1);
  return (twist_state){ k, A->phi - B->phi - k->beta, A->omega - B->omega };
}

PREPARE (twist_prepare, pw_rotational_spring, twist) {
  *k = (twist){ d->stiffness, d->damping, d->angle };
  return PW_OK;
}

PER_ELEMENT (twist_force, twist, 6) {
  opposite_moments (-(x.k->k * x.angle + x.k->c * x.rate), out);
}

PER_ELEMENT (twist_force_q, twist, 36) {
  opposite_moments_block (x.k->k, out);
}

PER_ELEMENT (twist_force_v, twist, 36) {
  opposite_moments_block (x.k->c, out);
}

PER_ELEMENT (twist_energy, twist, 1) {
  *out = x.k->k * x.angle * x.angle / 2;
}

PER_ELEMENT (twist_loss, twist, 1) {
  *out = x.k->c * x.rate * x.rate;
}

static const pw_field twist_fields[] = {
  { PW_AT (pw_rotational_spring, body), PW_BODY, .count = 2, .required = 1,
    .about = "the two bodies; one may be ground" },
  { PW_AT (pw_rotational_spring, stiffness), PW_NUMBER, .unit = "N m/rad", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "torque per angle" },
  { PW_AT (pw_rotational_spring, damping), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per angular velocity" },
  { PW_AT (pw_rotational_spring, angle), PW_NUMBER, .unit = "rad",
    .about = "free angle, of the first body relative to the second" },
  { .name = NULL },
};

const pw_kind pw_kind_rotational_spring = {
  .name = "rotational-spring",
  .about = "a torsion spring and a parallel damper between two bodies",
  .symbol = "0 .4 0 0 .3 .4 0 -.2 .5 0 -.6 0 0 -.3 -.7 0 .4 -.8 0 .9 0 0 .7 .8 0 0 1.1 0 -.8 .9",
  DEFINITION (pw_rotational_spring, twist_fields),
  ELEMENT (twist, twist_prepare),
  .bodies = 2,
  FORCE (twist),
  .energy = twist_energy,
  .loss = twist_loss,
};
