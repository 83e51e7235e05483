/* Dense output by cubic interpolation: states inside the last step, from the states at its ends. */
#ifndef PW_DENSE_OUTPUT_H
#define PW_DENSE_OUTPUT_H

#include "method.h"

/* The state at the beginning of a step. */
typedef struct {
  double t, projected;       /* as in pw_run */
  double *q, *ledger, *rate; /* as in pw_run, too: v, a and lambda follow q at the same distances */
} pw_step_start;

/* Stores the state reached. */
void pw_store_start (pw_step_start *x, const pw_run *r);

/* What is projected onto the constraints inside a step. */
typedef enum { PW_DENSE_UNPROJECTED, PW_DENSE_POSITIONS, PW_DENSE_POSITIONS_AND_VELOCITIES } pw_dense_projection;

/* The data of a method begin with this if it uses pw_step_at, pw_step_restart or pw_step_close. */
typedef struct {
  double h;            /* size of the last step; 0: there is none, or it failed; only galpha and leapfrog set it */
  pw_step_start start; /* of the last step */
  pw_dense_projection projection;
  pw_projector projector; /* unless the projection is PW_DENSE_UNPROJECTED */
  char *memory, *arrays;  /* `arrays`: those of the method, released with its data */
} pw_dense_output;

/* With a projection, J must be evaluated at a typical configuration.  PW_OK or PW_RESOURCE, also if `arrays` is NULL:
 * their allocation failed. */
int pw_dense_output_open (pw_run *r, pw_dense_projection projection, pw_error *error);

/* Integrates the ledger over the last step by the trapezoidal rule.  Kinematics, J and r->lambda must be those of its
 * end; updates r->rate. */
void pw_dense_output_integrate_ledger (pw_dense_output *b, pw_run *r);

/* Reports that t is outside the last step, which begins at t0 (NaN: unknown).  PW_INPUT. */
int pw_fail_outside (const pw_run *r, double t0, double t, pw_error *error);

/* Computes the state at t inside the last step, in the run's sample arrays, with kinematics and J evaluated.  The
 * caller has set r->projected_at to r->projected; change it if it differs at t.  Returns as pw_project_positions. */
typedef int pw_interpolate (pw_run *r, double t);

/* A method's `at`: the state at t in the sample arrays; inside the last step, which begins at t0, by `interpolate`,
 * whose evaluations do not count in the statistics. */
int pw_sample_last_step (pw_run *r, double t0, double t, pw_interpolate *interpolate, pw_error *error);

#endif
