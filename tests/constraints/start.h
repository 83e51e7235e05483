/* Runs that begin at given initial values. */
#ifndef START_H
#define START_H

#include "pinwheel-solvers.h"

#define START_ROUND_OFF (64 * CHECK_EPS)
#define START_REASON "64 eps of the row's terms: round-off"

/* Opens a run of the EzyRoller with these initial values; names end with NULL, or `name` is NULL.  Checks the
 * constraints.  Close it with runs_close. */
pw_run *start_open (pw_system **system, const char *const *name, const double *value);

#endif
