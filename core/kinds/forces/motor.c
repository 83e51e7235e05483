/* motor: a saturating torque between body 1 and body 2 that tracks a relative angle u1 and angular velocity u2
 * (signals).
 *
 *   y = k (u1 - phi1 + phi2) + c (u2 - w1 + w2)
 *   T = L tanh (y / L);  T = y without a limit L
 *   f = (0, 0, T | 0, 0, -T),  power = T (w1 - w2)
 *
 * (Spong, Hutchinson & Vidyasagar 2006, Robot Modeling and Control, section 6.3, for the law; tanh keeps it smooth.)
 * All of its power counts as work, not as loss or potential energy; it is negative when the motor brakes. */
#include <math.h>
#include <string.h>
#include "batch.h"

typedef struct {
  double k, c;  /* [N m/rad], [N m s/rad] */
  double limit; /* L [N m]; 0: no limit */
} motor;

/* A motor in the current state: the torque, its slope dT/dy, and y. */
typedef struct {
  const motor *k;
  const pw_configuration *A, *B;
  double T, slope, y;
} motor_state;

static inline motor_state motor_at (const pw_batch *b, int e) {
  const motor *k = (const motor *)b->element + e;
  const pw_configuration *A = batch_body (b, e, 2, 0), *B = batch_body (b, e, 2, 1);
  const double *u = b->u + 6 * e;
  double y = k->k * (u[0] - A->phi + B->phi) + k->c * (u[3] - A->omega + B->omega);
  double tanh_y = WHERE (k->limit > 0, tanh (y / k->limit));
  return (motor_state){ k, A, B, k->limit > 0 ? k->limit * tanh_y : y, k->limit > 0 ? 1 - tanh_y * tanh_y : 1, y };
}

PREPARE (motor_prepare, pw_motor, motor) {
  *k = (motor){ d->stiffness, d->damping, d->limit };
  return PW_OK;
}

PER_ELEMENT (motor_force, motor, 6) {
  opposite_moments (x.T, out);
}

PER_ELEMENT (motor_force_u, motor, 12) {
  memset (out, 0, 12 * sizeof *out);
  out[4] = x.slope * x.k->k, out[5] = x.slope * x.k->c;
  out[10] = -out[4], out[11] = -out[5];
}

PER_ELEMENT (motor_force_q, motor, 36) {
  opposite_moments_block (x.slope * x.k->k, out);
}

PER_ELEMENT (motor_force_v, motor, 36) {
  opposite_moments_block (x.slope * x.k->c, out);
}

PER_ELEMENT (motor_saturation, motor, 12) {
  if (x.k->limit > 0 && x.k->k > 0) out[2] = out[5] = (x.k->limit + fabs (x.y)) / x.k->k;
  if (x.k->limit > 0 && x.k->c > 0) out[8] = out[11] = (x.k->limit + fabs (x.y)) / x.k->c;
}

PER_ELEMENT (motor_power, motor, 1) {
  *out = x.T * (x.A->omega - x.B->omega);
}

static const pw_field motor_fields[] = {
  { PW_AT (pw_motor, body), PW_BODY, .count = 2, .required = 1,
    .about = "the driven body and the body with the reaction; one may be ground" },
  { PW_AT (pw_motor, stiffness), PW_NUMBER, .unit = "N m/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per angle error; 0: only the angular velocity is controlled" },
  { PW_AT (pw_motor, damping), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per angular velocity error" },
  { PW_AT (pw_motor, limit), PW_NUMBER, .unit = "N m", .domain = PW_NONNEGATIVE,
    .about = "largest torque; 0: no limit" },
  { PW_AT (pw_motor, angle), PW_SIGNAL, .unit = "rad",
    .about = "target angle of the first body relative to the second" },
  { PW_AT (pw_motor, rate), PW_SIGNAL, .unit = "rad/s",
    .about = "target angular velocity of the first body relative to the second" },
  { .name = NULL },
};

const pw_kind pw_kind_motor = {
  .name = "motor",
  .about = "a limited torque that drives the relative angle and angular velocity of two bodies to target values",
  .symbol = "0 .9 -.5 0 1 0 0 .7 .7 0 0 1 0 -.7 .7 0 -.2 .8 0 -.7 .7 0 -.6 1.2",
  DEFINITION (pw_motor, motor_fields),
  ELEMENT (motor, motor_prepare),
  .bodies = 2,
  .signals = 2,
  FORCE (motor),
  .force_u = motor_force_u,
  .saturation = motor_saturation,
  .power = motor_power,
};
