/* The watchdog checks that the states of a run follow the motion of the mechanism: constraints are not lost, and the
 * motion does not jump to another branch at a singular configuration.
 *
 * Singular configurations are a property of J alone, with rows of length 1 and columns of angles divided by L: neither
 * masses nor the initial configuration matter.  "The sine" measures the distance from them: it is that of the smallest
 * angle between a row of J and the space spanned by the rows before it.  Branches are the motions between which a
 * closed loop can change in a singular configuration, a change point. */
#ifndef PW_WATCHDOG_H
#define PW_WATCHDOG_H

#include "saddle.h"

struct pw_run;

/* The thresholds, of which a run has a copy; definitions, values and derivations are in thresholds.c. */
typedef struct {
  double lost, lost_unstabilised, redundant_residual, redundant_ratio;
  double rank_lost, rank_suspect, rank_refused, independent, reselect_ratio, reselect_below;
  double near, regular, refine;
  double turn_growth, turn_reference, drift_turn, drift_near, drift_far, drift_any, jump_growth;
  double lipschitz, step_growth;
  double unresolved, low, stride, progress, floor, crossing, straight, resolved;
  double ends_singular, agree, agree_best, sample, sample_best;
  double extreme, stalled;
} pw_thresholds;

extern const pw_thresholds pw_watchdog_thresholds;

/* The sine along a run, at the states reached. */
typedef struct {
  pw_saddle *saddle;          /* of weights 1 and L^2, as in rank.h; NULL: a tree of holonomic joints, never singular */
  int loops;                  /* 1: bodies form closed loops, whose branches can meet */
  double evaluated_sine;      /* of the J last checked by pw_watchdog_near, perhaps of a stage */
  double largest_sine;        /* 0: not known yet */
  double checked_sine;        /* at the last state for which it was computed */
  double moved;               /* motion since then [units of L, rad] */
  double sine_before_checked; /* one state before that; NaN: not computed */
  double sine_slope;          /* fastest recent change of the sine per unit of motion */
  int dependent_row;          /* the row that is most nearly dependent */
  int singular_ahead;         /* 1: a singular configuration may be within the next step */
  int may_have_crossed;       /* 1: the motion may recently have passed a point where branches cross */
  double step_length;         /* of the last step, in the units of `moved` */
  double previous_t;          /* at the state last checked, the beginning of the step to be checked: the time, */
  double *previous_q;         /* the coordinates and, from number coords + 3 on, the velocities, */
  double previous_sine;       /* and the sine; NaN: not computed */
} pw_watchdog;

/* Opens r->watchdog.saddle anew for the active rows.  Errors: PW_RESOURCE. */
int pw_watchdog_open (struct pw_run *r, pw_error *error);

/* Restarts at the state reached, where J is evaluated. */
void pw_watchdog_begin (struct pw_run *r);

/* The smallest sine of the angle between a row of the J last evaluated and those before it, 1 without a saddle; *row
 * (unless NULL): that row, or -1. */
double pw_watchdog_sine (struct pw_run *r, int *row);

/* pw_watchdog_near at the state reached, where it evaluates J, factorises r->saddle and sets singular_ahead to 1. */
int pw_watchdog_near_state (struct pw_run *r);

/* Rejects initial values and, in scenes with constraints, masses and inertias whose products overflow.  Errors:
 * PW_INPUT. */
int pw_watchdog_check_values (const struct pw_run *r, pw_error *error);

/* 1 if watchdog.singular_ahead and the J last evaluated, for which r->saddle must be factorised, is near a singular
 * configuration; watchdog.evaluated_sine is then its sine.  Adaptive methods: only where solutions are refined. */
int pw_watchdog_near (struct pw_run *r);

/* Checks that the motion has come from watchdog.previous_q to the state reached without leaving its branch; sine: that
 * at the state reached (change_point.c).  PW_METHOD; PW_RESOURCE. */
int pw_change_point_check (struct pw_run *r, double sine, pw_error *error);

/* Checks that a step of fixed size resolves a change point that the motion has passed at a small distance; last_sine:
 * that one state earlier, NaN if it was not computed.  Adaptive methods have error control instead. */
int pw_change_point_resolve (struct pw_run *r, double last_sine, pw_error *error);

/* PW_METHOD if the last step has passed a dead point, from which prescribed motions cannot go on (dead_point.c). */
int pw_dead_point_passed (struct pw_run *r, pw_error *error);

/* After a step that has failed with PW_METHOD: if a dead point follows the state last checked, `error` says so.
 * Returns PW_METHOD. */
int pw_dead_point_explain (struct pw_run *r, pw_error *error);

#endif
