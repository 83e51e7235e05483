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
#include "pinwheel.h"

typedef struct {
  double k, c;  /* [N m/rad], [N m s/rad] */
  double limit; /* L [N m]; 0: no limit */
} motor;

/* The torque, its slope dT/dy, and y. */
typedef struct {
  double T, slope, y;
} motor_state;

static inline motor_state motor_at (const motor *k, const pw_configuration *A, const pw_configuration *B,
                                    const double *u) {
  double y = k->k * (u[0] - A->phi + B->phi) + k->c * (u[3] - A->omega + B->omega);
  if (k->limit == 0) return (motor_state){ y, 1, y };
  double x = tanh (y / k->limit);
  return (motor_state){ k->limit * x, 1 - x * x, y };
}

#define MOTOR_PARTS                                                                                          \
  const motor *k = (const motor *)b->element + e;                                                            \
  const pw_configuration *A = &b->configuration[b->body[2 * e]], *B = &b->configuration[b->body[2 * e + 1]]; \
  const motor_state x = motor_at (k, A, B, b->u + 6 * e)

static int motor_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *own,
                          pw_error *error) {
  const pw_motor *d = definition;
  *(motor *)element = (motor){ d->stiffness, d->damping, d->limit };
  (void)bodies, (void)own, (void)error;
  return PW_OK;
}

static void motor_force (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 6) {
    MOTOR_PARTS;
    out[0] = out[1] = out[3] = out[4] = 0, out[2] = x.T, out[5] = -x.T;
  }
}

static void motor_force_u (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 12) {
    MOTOR_PARTS;
    memset (out, 0, 12 * sizeof *out);
    out[4] = x.slope * k->k, out[5] = x.slope * k->c;
    out[10] = -out[4], out[11] = -out[5];
  }
}

/* The four angle entries of a 6 x 6 block. */
static inline void motor_block (double *out, double x) {
  memset (out, 0, 36 * sizeof *out);
  out[14] = out[35] = -x, out[17] = out[32] = x;
}

static void motor_force_q (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 36) {
    MOTOR_PARTS;
    motor_block (out, x.slope * k->k);
  }
}

static void motor_force_v (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 36) {
    MOTOR_PARTS;
    motor_block (out, x.slope * k->c);
  }
}

static void motor_saturation (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++, out += 12) {
    MOTOR_PARTS;
    if (k->limit > 0 && k->k > 0) out[2] = out[5] = (k->limit + fabs (x.y)) / k->k;
    if (k->limit > 0 && k->c > 0) out[8] = out[11] = (k->limit + fabs (x.y)) / k->c;
  }
}

static void motor_power (const pw_batch *b, double *out) {
  for (int e = 0; e < b->count; e++) {
    MOTOR_PARTS;
    out[e] = x.T * (A->omega - B->omega);
  }
}

static const pw_field motor_fields[] = {
  { PW_AT (pw_motor, body), PW_BODY, .count = 2, .required = 1,
    .about = "what it turns, and what it reacts on; ground for one of them" },
  { PW_AT (pw_motor, stiffness), PW_NUMBER, .unit = "N m/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per error of the angle; 0: the rate alone counts" },
  { PW_AT (pw_motor, damping), PW_NUMBER, .unit = "N m s/rad", .domain = PW_NONNEGATIVE,
    .about = "torque per error of the rate" },
  { PW_AT (pw_motor, limit), PW_NUMBER, .unit = "N m", .domain = PW_NONNEGATIVE,
    .about = "the torque saturates here; 0: no limit" },
  { PW_AT (pw_motor, angle), PW_SIGNAL, .unit = "rad", .about = "target angle, of the first body from the second" },
  { PW_AT (pw_motor, rate), PW_SIGNAL, .unit = "rad/s", .about = "target rate, of the first body from the second" },
  { .name = NULL },
};

const pw_kind pw_kind_motor = {
  .name = "motor",
  .about = "a torque of limited size that turns a body against another to an angle and a rate",
  .definition = sizeof (pw_motor),
  .element = sizeof (motor),
  .fields = motor_fields,
  .bodies = 2,
  .signals = 2,
  .level = PW_FORCE,
  .prepare = motor_prepare,
  .force = motor_force,
  .force_u = motor_force_u,
  .force_q = motor_force_q,
  .force_v = motor_force_v,
  .saturation = motor_saturation,
  .power = motor_power,
};
