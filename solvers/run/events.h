/* Modes of constraint equations whose multipliers have limits, and the events at which they change (events.c). */
#ifndef PW_EVENTS_H_
#define PW_EVENTS_H_
#include "method.h"

/* Opens r->events, and makes the initial state consistent: equations that the described state cannot satisfy begin at
 * a limit.  As pw_run_make_consistent, which it calls, also where the scene has no limits. */
int pw_events_open (pw_run *r, pw_error *error);

/* Leaves out equations with limits that depend on others that hold: their multipliers are 0 as long as those of the
 * others are within their limits.  PW_RETRY if equations without limits depend on each other. */
int pw_events_spare (pw_run *r, pw_error *error);

/* After pw_run_evaluate and the choice of the scales: decides the modes at the initial state, before the method is
 * opened.  Errors: as pw_run_evaluate. */
int pw_events_begin (pw_run *r, pw_error *error);

/* Makes the state in r->q, r->v consistent at r->t, decides the modes there and opens the method anew.  Friction and
 * wheels hold if the velocities satisfy their equations, else they slide.  *energy: that of the consistent state,
 * before impacts.  Errors: as pw_run_make_consistent, pw_run_renew. */
int pw_events_restart (pw_run *r, double *energy, pw_error *error);

/* PW_METHOD if the modes of the run are not those at a state, where J is evaluated, or about to change: accelerations
 * jump or bend there.  PW_OK without events. */
int pw_events_check_modes (pw_run *r, const double *v, const double *lambda, pw_error *error);

/* pw_run.advance: decides the modes, if an event has been located or multipliers have jumped beyond their limits, and
 * makes a step; if there is an event in it, the state there becomes the state reached. */
int pw_events_advance (pw_run *r, double t_end, pw_error *error);

/* After the last step has been shortened: events found in it have not been reached. */
void pw_events_forget (pw_run *r);

/* ---- For moreau, which decides impulses of whole steps in place of events ---- */

/* From now on no equation with limits is enforced; multipliers are given ones, at first those of the initial state.
 * r->saddle is that of the others.  Without events it does nothing, as pw_impulses_predict.  Errors: as
 * pw_run_open_saddle, pw_run_evaluate. */
int pw_impulses_open (pw_run *r, pw_error *error);

/* Predicts the multipliers of the next step; 1 if they are not those of the last one. */
int pw_impulses_predict (pw_run *r);

/* The end (t, q, v) of a step of size h from the state reached, made with the predicted multipliers: corrects v by
 * impulses there, and the multipliers to the mean of the step; adds to r->ledger what the impulses dissipate, with the
 * mean of the velocities at both ends, and what constraints supply in them.  p: with the mass matrix; before: scratch
 * for coords numbers.  Errors: PW_METHOD. */
int pw_impulses_solve (pw_run *r, pw_projector *p, double h, double t, const double *q, double *v, double *before,
                       pw_error *error);

/* As pw_project_positions, with limited equations that hold, and those whose g is on the wrong side of its limit. */
int pw_impulses_project (pw_run *r, pw_projector *p, double t, double *q, const double *v);

/* ---- Conditions on states in signals (sides.c) ---- */

/* Opens r->sides; it stays NULL where no signal has conditions. */
int pw_sides_open (pw_run *r, pw_error *error);

/* Before a step: fixes the sides, unless they are, and refuses to slide along a condition. */
int pw_sides_begin (pw_run *r, pw_error *error);

/* After a step from t0: if a condition changes its side in it, the state there becomes the state reached, from which
 * the method restarts. */
int pw_sides_follow (pw_run *r, double t0, pw_error *error);

/* ---- Checkpoints ---- */

/* Saves or loads the modes and the events so far. */
void pw_events_serialise (pw_run *r, pw_archive *a);

#endif
