/* Shared by opening and advancing a run; see run.c. */
#ifndef PW_RUN_PARTS_H
#define PW_RUN_PARTS_H

#include "method.h"

/* Adds the name of the signal that failed in the last attempted step, if any, to the error.  Returns status. */
int pw_run_annotate_error (const pw_run *r, int status, pw_error *error);

/* Replaces the saddle by one for the active rows.  PW_OK or PW_RESOURCE. */
int pw_run_open_saddle (pw_run *r, pw_error *error);

/* Evaluates accelerations, multipliers and the ledger's rates at the state reached; errors have the reason. */
int pw_run_evaluate (pw_run *r, pw_error *error);

/* Takes reference values for nearness to a singular configuration from the state reached, which must be regular. */
void pw_run_watch (pw_run *r);

/* Finds the next discontinuity after the state reached. */
int pw_run_look_ahead (pw_run *r, pw_error *error);

/* Takes the accelerations of this state as the reference level for later ones. */
void pw_run_reference_level (pw_run *r);

#endif
