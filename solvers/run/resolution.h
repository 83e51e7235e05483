/* The longest step in which signals are seen (resolution.c). */
#ifndef PW_RESOLUTION_H_
#define PW_RESOLUTION_H_
#include "method.h"

/* Opens r->resolution at the initial state, whose kinematics must be up to date; it stays NULL where no signal needs
 * it. */
int pw_resolution_open (pw_run *r, pw_error *error);

/* The time at which the next adaptive step must end at the latest; INFINITY with fixed steps, which are counted if they
 * do not resolve a signal.  Sets r->resolved_until, which is INFINITY before. */
double pw_resolution_end (pw_run *r);

#endif
