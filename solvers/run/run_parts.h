/* What opening a run and going on with it share; see run.c. */
#ifndef PW_RUN_PARTS_H
#define PW_RUN_PARTS_H

#include "method.h"

/* Where a signal failed in the step tried last, this adds which one, whatever the method makes of it.  Returns status. */
int pw_run_annotate_error (const pw_run *r, int status, pw_error *error);

/* A saddle for the rows in use, in place of the one there was.  PW_OK or PW_RESOURCE. */
int pw_run_open_saddle (pw_run *r, pw_error *error);

/* Accelerations, multipliers and the ledger's rates of the state reached, anew; says why if that fails. */
int pw_run_evaluate (pw_run *r, pw_error *error);

/* What near a singular configuration means: a small part of the pivot at a good one, which the state reached is. */
void pw_run_watch (pw_run *r);

/* Finds the next discontinuity behind the state reached. */
int pw_run_look_ahead (pw_run *r, pw_error *error);

/* The accelerations of this state are what those to come are held against. */
void pw_run_reference_level (pw_run *r);

#endif
