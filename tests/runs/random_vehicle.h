/* Random vehicles with events, and the events of a run. */
#ifndef RANDOM_VEHICLE_H
#define RANDOM_VEHICLE_H

#include "pinwheel-solvers.h"

enum { RANDOM_EVENTS = 400 }; /* that are stored, at most */

/* A vehicle of two segments with random masses, places, grips of both wheels, friction in the hinge, and stops without
 * restitution: how many bounces accumulate, each with new events of the wheels, depends on the tolerance.  rolls: 1:
 * the second wheel rolls, and slides on a circle; half of the limits oscillate.  The seed becomes that of the next. */
pw_system *random_vehicle (unsigned *seed, int rolls);

/* The number of events of a run; of RANDOM_EVENTS at most, times, and 8 times the equation plus the mode after it. */
int random_vehicle_events (pw_system *s, const char *method, double step, double t, double *time, int *row);

#endif
