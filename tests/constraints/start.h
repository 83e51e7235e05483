/* Runs that begin at given initial values. */
#ifndef START_H
#define START_H

#include "pinwheel-solvers.h"

#define START_ROUND_OFF (64 * CHECK_EPS)
#define START_REASON "64 eps of the row's terms: round-off"

/* Opens a run on the EzyRoller with initial values, NULL-terminated names and values, and checks the constraints. */
pw_run *start_open (pw_system **system, const char *const *name, const double *value);
void start_close (pw_run *r, pw_system *s);

#endif
