/* Checks that every element type must pass in a scene, for the tests of element types. */
#ifndef TRIAL_H
#define TRIAL_H

#include "runs.h"

/* Runs a scene to t_end by rk4+projection and by implicit methods.  Checks that they agree, that the energy balance
 * closes, that the final state satisfies the equations of the independent verifier, and that few steps are rejected. */
void trial (const pw_plugin_table *table, double t_end);

/* Checks the scaled residuals of the equations in a sample, by the independent verifier. */
void trial_verify (const pw_system *s, const pw_run *r, const pw_sample *x, double bound, const char *reason);

/* A state ("cart.x", "cart.vx") or a reaction ("motor.F") of a sample, by name. */
double trial_state (const pw_system *s, const pw_sample *x, const char *name);
double trial_reaction (const pw_system *s, const pw_sample *x, const char *name);

/* The table of a model, whose bodies and elements the function `build` adds: without parameters; with a list of
 * parameters that are members of a structure of `bytes` bytes. */
#define TRIAL_TABLE(build) TRIAL_TABLE_WITH (build, NULL, 0)
#define TRIAL_TABLE_WITH(build_, list, bytes) \
  { .abi = PW_ABI, .size = sizeof (pw_plugin_table), .parameters = list, .parameters_size = bytes, .build = build_ }

#endif
