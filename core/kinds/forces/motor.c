/* motor: a torque of limited size that drives the relative angle and angular velocity of two bodies to signals u1, u2.
 *
 *   y = k (u1 - phi1 + phi2) + c (u2 - omega1 + omega2)
 *   T = L tanh (y / L);  T = y without a limit L
 *   f = (0, 0, T | 0, 0, -T),  power = T (omega1 - omega2)
 *
 * (Spong, Hutchinson & Vidyasagar 2006, Robot Modeling and Control, section 6.3, for the law; tanh keeps it smooth.)
 * All of its power counts as work, not as loss or potential energy; it is negative when the motor brakes. */
#include <string.h>
#include "batch.h"

typedef struct {
  double stiffness, damping; /* k [N m/rad], c [N m s/rad] */
  double limit;              /* L [N m]; 0: no limit */
} motor;

/* A motor in the current state. */
typedef struct {
  const motor *element;
  const pw_configuration *body1, *body2;
  double y, T, slope; /* slope: dT/dy */
} motor_state;

static inline motor_state motor_at (const pw_batch *batch, int e) {
  const motor *element = (const motor *)batch->element + e;
  const pw_configuration *body1 = batch_body (batch, 2 * e), *body2 = batch_body (batch, 2 * e + 1);
  const double *angle = batch->u + 6 * e, *rate = angle + 3; /* signals u1, u2: of three numbers each, the value */
  motor_state now = { element, body1, body2,
                      .y = element->stiffness * (angle[0] - body1->phi + body2->phi) +
                           element->damping * (rate[0] - body1->omega + body2->omega) };
  now.T = limited_force (now.y, element->limit, &now.slope);
  return now;
}

PREPARE (motor_prepare, pw_motor, motor) {
  *element = (motor){ definition->stiffness, definition->damping, definition->limit };
  return PW_OK;
}

PER_ELEMENT (motor_force, motor, 6) {
  opposite_moments (now.T, out);
}

PER_ELEMENT (motor_force_u, motor, 12) {
  memset (out, 0, 12 * sizeof *out);
  out[4] = now.slope * now.element->stiffness, out[5] = now.slope * now.element->damping;
  out[10] = -out[4], out[11] = -out[5];
}

PER_ELEMENT (motor_force_q, motor, 36) {
  opposite_moments_block (now.slope * now.element->stiffness, out);
}

PER_ELEMENT (motor_force_v, motor, 36) {
  opposite_moments_block (now.slope * now.element->damping, out);
}

/* Changes of angles and angular velocities that change y by |y| + L: T goes to L tanh 1 = 0.76 L the other way. */
PER_ELEMENT (motor_saturation, motor, 12) {
  double limit = now.element->limit, stiffness = now.element->stiffness, damping = now.element->damping;
  if (limit > 0 && stiffness > 0) out[2] = out[5] = (limit + fabs (now.y)) / stiffness;
  if (limit > 0 && damping > 0) out[8] = out[11] = (limit + fabs (now.y)) / damping;
}

PER_ELEMENT (motor_power, motor, 1) {
  *out = now.T * (now.body1->omega - now.body2->omega);
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
  .symbol = "0 .9 -.5 0 1 0 0 .7 .7 0 0 1 0 -.7 .7 0 -.2 .8 0 -.7 .7 0 -.6 1.2", /* an arc with an arrow head */
  TYPE (motor, pw_motor, motor),
  .bodies = 2,
  .signals = 2,
  FORCE (motor),
  .force_u = motor_force_u,
  .saturation = motor_saturation,
  .power = motor_power,
};
