/* Signals that are narrow in time, or along the motion, compared with steps (narrow.c). */
#ifndef PW_NARROW_H
#define PW_NARROW_H

#include "pinwheel-solvers.h"

typedef struct pw_narrow pw_narrow;

/* Sets r->narrow, NULL if no signal can be narrow.  Errors: PW_RESOURCE. */
int pw_narrow_open (pw_run *r, pw_error *error);

/* At restarts: forgets what is known of other times, since the caller's functions may have changed. */
void pw_narrow_forget (pw_run *r);
void pw_narrow_serialise (pw_run *r, pw_archive *a);

/* Adaptive methods, before each attempted step: its end, t1 or earlier, so that it resolves all signals. */
double pw_narrow_end (pw_run *r, double t1);

/* The same for a multistep method that announces a next step of size h, after one of size `last` (0: after a restart):
 * reduces *stop to where it must stop.  1 if the step would be much shorter than the last one: then the method must
 * restart and ask again, since its error estimate would rely on what was before. */
int pw_narrow_stop (pw_run *r, double h, double last, double *stop);

/* Steps of fixed size, before they are made: counts the one to t1, or `count` ones of size h, of which it returns how
 * many may be made at once: 0 if a signal that depends on states must be checked before each. */
void pw_narrow_count (pw_run *r, double t1);
int pw_narrow_count_several (pw_run *r, double h, int count);

#endif
