/* freewheel: body 1 does not turn more slowly than body 2, as in a ratchet or one-way clutch.
 *
 *   v = omega1 - omega2 >= 0,  S = [ 0 0 1 | 0 0 -1 ],  gamma = 0    (1 nonholonomic equation; it holds while engaged)
 *
 * The torque on body 1 is T = -lambda >= 0; body 2 receives the opposite.  lambda v is 0 but for round-off; its sign
 * lets the self-test verify that of S. */
#include "batch.h"

typedef struct {
  int unused; /* all freewheels are alike */
} freewheel_state;

static inline freewheel_state freewheel_at (const pw_batch *batch, int e) {
  (void)batch, (void)e;
  return (freewheel_state){ 0 };
}

PER_ELEMENT (freewheel_J, freewheel, 6) {
  (void)now;
  opposite_moments (1, out);
}

static void freewheel_loss (const pw_batch *batch, double *out) {
  for (int e = 0; e < batch->count; e++)
    out[e] = batch->lambda[e] * (batch_body (batch, 2 * e)->omega - batch_body (batch, 2 * e + 1)->omega);
}

static void freewheel_limits (const void *definition, pw_bounds *limit) {
  (void)definition;
  limit->most = 0;
}

static const pw_field freewheel_fields[] = {
  { PW_AT (pw_freewheel, body), PW_BODY, .count = 2, .required = 1,
    .about = "the body that may turn faster, and the one that drives it; one may be ground" },
  { .name = NULL },
};

const pw_kind pw_kind_freewheel = {
  .name = "freewheel",
  .about = "a body does not turn more slowly than another one, as in a ratchet",
  .definition = sizeof (pw_freewheel),
  .fields = freewheel_fields,
  .bodies = 2,
  .rows = 1,
  .level = PW_NONHOLONOMIC,
  REACTION ("T", "N m", "torque on the first body"),
  .J = freewheel_J,
  .limits = freewheel_limits,
  .loss = freewheel_loss,
};
