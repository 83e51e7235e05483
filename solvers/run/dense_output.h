/* Dense output of a one-step method: states inside the last step, from its two ends. */
#ifndef PW_DENSE_OUTPUT_H
#define PW_DENSE_OUTPUT_H

#include "method.h"

typedef struct {
  double t0;                    /* the beginning of the last step */
  double *q0, *ledger0, *rate0; /* the state there, laid out as in pw_run */
  int velocities;               /* 1: project velocities; 0: positions only; -1: neither */
  pw_projector projector;       /* unless velocities is -1 */
  char *memory;
} pw_dense_output;

/* velocities: as in pw_dense_output.  Errors: PW_RESOURCE. */
int pw_dense_output_open (pw_dense_output *b, pw_run *r, int velocities, pw_error *error);
void pw_dense_output_close (pw_dense_output *b);

/* Stores the state reached as the beginning of a step. */
void pw_dense_output_keep (pw_dense_output *b, const pw_run *r);

/* Integrates the ledger to the end of the step by the trapezoidal rule; kinematics and r->lambda must be up to date
 * there. */
void pw_dense_output_count (pw_dense_output *b, pw_run *r);

/* Reports that t is outside the last step, which begins at t0 (NaN: unknown).  PW_INPUT. */
int pw_fail_outside (const pw_run *r, double t0, double t, pw_error *error);

/* A method's `at`: the state at t in the run's sample arrays, with kinematics and J evaluated. */
int pw_dense_output_at (pw_dense_output *b, pw_run *r, double t, pw_error *error);

#endif
