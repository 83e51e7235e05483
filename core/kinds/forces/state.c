/* state: a first-order state z,  z' = u.
 *
 * z is the velocity of an internal coordinate s of mass 1, without constraints, on which the force u acts: s' = z,
 * s'' = u.  So every method integrates it like other velocities.  Nothing depends on s, which the error control leaves
 * out, and the kinetic energy does not contain z (compile.c). */
#include "batch.h"

static int state_prepare (const void *definition, const pw_body *const *bodies, void *element, pw_internal *internal,
                          pw_error *error) {
  const pw_state *state = definition;
  (void)bodies, (void)element, (void)error;
  internal[0] = (pw_internal){ .mass = 1, .rate = state->start, .specified = { 1, 1 } };
  return PW_OK;
}

static const pw_field state_fields[] = {
  { PW_AT (pw_state, rate), PW_SIGNAL, .required = 1, .about = "time derivative of the state, in its unit per second" },
  { PW_AT (pw_state, start), PW_NUMBER, .about = "initial value, in its unit" },
  { PW_AT (pw_state, unit), PW_TEXT, .about = "unit of the state, for tables" },
  { PW_AT (pw_state, about), PW_TEXT, .about = "what it means, in a few words" },
  { .name = NULL },
};

static const pw_quantity state_coordinate[] = {
  { "integral", "rad", "", "the time integral of the state, which nothing uses" },
};

const pw_kind pw_kind_state = {
  .name = "state",
  .about = "a first-order state of a controller, an actuator or a motor, given by its rate",
  .definition = sizeof (pw_state),
  .fields = state_fields,
  .prepare = state_prepare,
  .internal = 1,
  .first_order = 1,
  .signals = 1,
  .coordinate = state_coordinate,
  .force = batch_signal,
  .force_u = batch_signal_u,
};
