/* rotational-spring: a spring and a parallel damper between the angles of two bodies.
 *
 *   T = k (phi1 - phi2 - beta) + c (w1 - w2)
 *   f = (0, 0, -T | 0, 0, T)
 *   V = k (phi1 - phi2 - beta)^2 / 2,  loss = c (w1 - w2)^2
 *
 * (Shabana 2001, Computational Dynamics, section 6.5.)
 * Angles accumulate over full turns. */
#include <string.h>
#include "pinwheel.h"

typedef struct {
  double k, c, beta; /* stiffness [N m/rad], damping [N m s/rad], free angle [rad] */
} twist;

#define TWIST_PARTS                                                                                          \
  const twist *k = (const twist *)b->element + e;                                                            \
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]]; \
  const double angle = A->phi - B->phi - k->beta, rate = A->omega - B->omega;                                \
  (void)angle, (void)rate

static int twist_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                          pw_error *error) {
  const pw_rotational_spring *d = definition;
  *(twist *)element = (twist){ d->stiffness, d->damping, d->angle };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void twist_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    TWIST_PARTS;
    double T = k->k * angle + k->c * rate;
    out[0] = out[1] = out[3] = out[4] = 0, out[2] = -T, out[5] = T;
  }
}

/* The four angle entries of a 6 x 6 block. */
static inline void twist_block (double *out, double x) {
  memset (out, 0, 36 * sizeof *out);
  out[14] = out[35] = -x, out[17] = out[32] = x;
}

static void twist_force_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) twist_block (out + 36 * e, ((const twist *)b->element + e)->k);
}

static void twist_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) twist_block (out + 36 * e, ((const twist *)b->element + e)->c);
}

static void twist_energy (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    TWIST_PARTS;
    out[e] = k->k * angle * angle / 2;
  }
}

static void twist_loss (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    TWIST_PARTS;
    out[e] = k->c * rate * rate;
  }
}

static const pw_field twist_fields[] = {
  { PW_AT (pw_rotational_spring, body), PW_BODY, .count = 2, .required = 1,
    .about = "the two bodies, or ground for one of them" },
  { PW_AT (pw_rotational_spring, stiffness), PW_NUMBER, .unit = "N m/rad", .required = 1, .domain = PW_NONNEGATIVE,
    .about = "torque per angle" },
  { PW_AT (pw_rotational_spring, damping), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per rate" },
  { PW_AT (pw_rotational_spring, angle), PW_NUMBER, .unit = "rad",
    .about = "free angle, of the first body relative to the second" },
  { .name = NULL },
};

const pw_kind pw_kind_rotational_spring = {
  .name = "rotational-spring",
  .about = "a spring, with a damper beside it, between the angles of two bodies",
  .definition = sizeof (pw_rotational_spring),
  .element = sizeof (twist),
  .fields = twist_fields,
  .bodies = 2,
  .level = PW_FORCE,
  .prepare = twist_prepare,
  .force = twist_force,
  .force_q = twist_force_q,
  .force_v = twist_force_v,
  .energy = twist_energy,
  .loss = twist_loss,
};
