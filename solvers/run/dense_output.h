/* The last step of a method that keeps both of its ends: what it was between them. */
#ifndef PW_DENSE_OUTPUT_H
#define PW_DENSE_OUTPUT_H

#include "method.h"

typedef struct {
  double t0;                                        /* the beginning of the last step */
  double *q0, *v0, *a0, *lambda0, *ledger0, *rate0; /* the state there; lambda: all rows */
  int rates;                                        /* 1: the method has J v = eta; -1: it has no constraints */
  pw_projector projector;
  char *memory;
} pw_dense_output;

/* rates: what it says above.  Errors: PW_RESOURCE. */
int pw_dense_output_open (pw_dense_output *b, pw_run *r, int rates, pw_error *error);
void pw_dense_output_close (pw_dense_output *b);

/* The state reached is now the beginning of a step. */
void pw_dense_output_keep (pw_dense_output *b, const pw_run *r);

/* The ledger goes on to the end of the step, where the state is placed and r->lambda known: trapezoidal rule. */
void pw_dense_output_count (pw_dense_output *b, pw_run *r);

/* Says that t is not inside the last step, which begins at t0 (NaN: where is not known).  PW_INPUT. */
int pw_fail_outside (const pw_run *r, double t0, double t, pw_error *error);

/* The state at t into the run's sample arrays, placed there with J swept: a method's `at`. */
int pw_dense_output_at (pw_dense_output *b, pw_run *r, double t, pw_error *error);

#endif
