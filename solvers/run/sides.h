/* Conditions on states in signals, and the events at which their sides change (sides.c). */
#ifndef PW_SIDES_H_
#define PW_SIDES_H_
#include "method.h"

/* Opens r->sides; it stays NULL where no signal has conditions. */
int pw_sides_open (pw_run *r, pw_error *error);

/* Before a step: fixes the sides, unless they are, and refuses to slide along a condition. */
int pw_sides_begin (pw_run *r, pw_error *error);

/* After a step from t0: if a condition changes its side in it, the state there becomes the state reached, from which
 * the method restarts. */
int pw_sides_follow (pw_run *r, double t0, pw_error *error);

#endif
