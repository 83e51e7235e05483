/* The tables of `pinwheel run --profile`. */
#ifndef PW_PROFILE_H
#define PW_PROFILE_H

#include <stdio.h>
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"

/* Measures a run that is over (pw_run_profile) and prints two tables: what each kind of element and what each stage of an
 * evaluation costs.  `cpu` is the run's processor time [s].  Errors: PW_RESOURCE. */
int pw_print_profile (const pw_system *s, pw_run *r, double cpu, FILE *out, pw_error *error);

#endif
