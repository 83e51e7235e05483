/* Checks that every element type must pass in a scene, for the tests of element types. */
#ifndef TRIAL_H
#define TRIAL_H

#include "runs.h"
#include "scene.h"

/* Runs a scene to t_end by rk4+projection and by implicit methods.  Checks that they agree, that the energy balance
 * closes, that the final state satisfies the equations of the independent verifier, and that few steps are rejected. */
void trial (const pw_plugin_table *table, double t_end);

/* Checks the scaled residuals of the equations in a sample, by the independent verifier. */
void trial_verify (const pw_system *s, const pw_run *r, const pw_sample *x, double bound, const char *reason);

/* A state ("cart.x", "cart.vx") or a reaction ("motor.F") of a sample, by name. */
double trial_state (const pw_system *s, const pw_sample *x, const char *name);
double trial_reaction (const pw_system *s, const pw_sample *x, const char *name);

#endif
