/* The tables of `pinwheel run --profile`. */
#ifndef PW_PROFILE_H
#define PW_PROFILE_H

#include <stdio.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* Measures a finished run (pw_run_profile) and prints the cost of each element type and of each stage of an evaluation.
 * cpu: processor time of the run [s].  Errors: PW_RESOURCE. */
int pw_print_profile (const pw_system *s, pw_run *r, double cpu, FILE *out, pw_error *error);

#endif
