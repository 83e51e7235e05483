/* Modes of constraint equations whose multipliers have limits, and the events at which they change (events.c). */
#ifndef PW_EVENTS_H_
#define PW_EVENTS_H_
#include "method.h"

/* Opens r->events, and makes the initial state consistent: equations that the described state cannot satisfy begin at
 * a limit.  As pw_run_make_consistent, which it calls, also where the scene has no limits. */
int pw_events_open (pw_run *r, pw_error *error);

/* After pw_run_evaluate and the choice of the scales: decides the modes at the initial state, before the method is
 * opened.  Errors: as pw_run_evaluate. */
int pw_events_begin (pw_run *r, pw_error *error);

/* pw_run.advance: decides the modes, if an event has been located or multipliers have jumped beyond their limits, and
 * makes a step; if there is an event in it, the state there becomes the state reached. */
int pw_events_advance (pw_run *r, double t_end, pw_error *error);

/* Saves or loads the modes and the events so far. */
void pw_events_serialise (pw_run *r, pw_archive *a);

#endif
