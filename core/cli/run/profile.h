/* What `pinwheel run --profile` says: where the time goes. */
#ifndef PW_PROFILE_H
#define PW_PROFILE_H

#include <stdio.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* Measures, at the last state of a run that is over, what each kind costs per evaluation of the accelerations, and what
 * each stage costs per evaluation and per step; prints two tables.  Takes a second or a few.  The run is of no use
 * afterwards but to be closed.  `cpu` is its processor time [s].  Errors: PW_MACHINE. */
int pw_profile (pw_run *r, const pw_sample *last, double cpu, FILE *out, pw_error *error);

#endif
