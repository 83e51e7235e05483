/* torque: the signal u acts on body 1, -u on body 2.
 *
 *   f = (0, 0, u | 0, 0, -u),  power = u (omega1 - omega2) */
#include "batch.h"

static void torque_force (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) opposite_moments (batch->u[3 * e], out + 6 * e);
}

static void torque_force_u (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++) opposite_moments (1, out + 6 * e);
}

static void torque_power (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++)
    out[e] = batch->u[3 * e] * (batch_body (batch, 2 * e)->omega - batch_body (batch, 2 * e + 1)->omega);
}

static const pw_field torque_fields[] = {
  { PW_AT (pw_torque, body), PW_BODY, .count = 2, .required = 1,
    .about = "the body on which it acts and the body with the reaction; one may be ground" },
  { PW_AT (pw_torque, value), PW_SIGNAL, .unit = "N m", .required = 1, .about = "torque on the first body" },
  { .name = NULL },
};

const pw_kind pw_kind_torque = {
  .name = "torque",
  .about = "a torque on one body and the opposite torque on another",
  .symbol = "0 .9 -.5 0 1 0 0 .7 .7 0 0 1 0 -.7 .7 0 -.2 .8 0 -.7 .7 0 -.6 1.2",
  .definition = sizeof (pw_torque),
  .fields = torque_fields,
  .bodies = 2,
  .signals = 1,
  .force = torque_force,
  .force_u = torque_force_u,
  .power = torque_power,
};
