/* The watchdog: is what a method has reached still the motion of this mechanism?
 *
 * All its thresholds are in one table, dimensionless: positions are in units of the scene's length L, angles in radians.
 * Singular configurations are a property of J alone: rows of length 1, columns of angles divided by L, so that neither
 * masses nor the initial configuration matter. */
#ifndef PW_WATCHDOG_H
#define PW_WATCHDOG_H

#include "saddle.h"

struct pw_run;

/* The thresholds; a run has a copy.  Values and derivations are in watchdog.c. */
typedef struct {
  double lost, lost_unstabilised;  /* residual at which constraints count as lost */
  double follows, magnified;       /* residual of a redundant row: round-off, and over that of the others */
  double rank, suspect, dependent; /* sines: rank lost; rows are looked into; refused where that is too large a task */
  double independent;              /* sine of a row that counts as independent of those kept */
  double near, refine;     /* sines: near a singular configuration, as a part of the largest; solutions are refined */
  double regular;          /* sine that is not singular, as a part of the largest */
  double turn, least_turn; /* growth of the accelerations in a turn; least level */
  double drift_turn, drift_near, drift_far, drift_any; /* residual over the squared sine; drift_any above drift_far */
  double jump;                                         /* growth of the accelerations in a jump */
  double lipschitz, growth;                            /* change of the sine per unit of motion; of step sizes */
  double dip, sag, stride, progress;                   /* steps past a change point */
  double floor, met, ahead;                            /* sines where branches meet; cosine of the angle */
  double resolved;                                     /* step over the distance of branches */
  double agree, agree_best;                            /* difference of two divisions of a step */
  double sample, sample_best;                          /* the same inside a step, of a sample */
  double loosened, loose;                              /* grip of the active rows on redundant ones */
  double extreme; /* the largest mass, and one over the smallest [kg]; the largest initial value */
  double stalled; /* steps in a row that do not advance */
} pw_watchdog;

extern const pw_watchdog pw_watchdog_limits;

/* What a run knows of the geometry of its constraints. */
typedef struct {
  pw_saddle *saddle;    /* weights 1 and L^2: its pivots are the sines; NULL: bodies form a tree, nothing can happen */
  int fixed;            /* 1: steps are of a given size, so that stages matter */
  int loops;            /* 1: bodies form closed loops, whose branches can meet */
  double sine, typical; /* the last one computed; the largest at a state reached */
  double known, moved;  /* at the last state it was computed for, and the way since [units of L, rad] */
  int alert;            /* 1: a singular configuration may be within the next step */
  double step;          /* length of the last step, as `moved` */
  double t, begun, *q;  /* the last state: time, sine (NaN: not known), coords */
  double before, slope; /* the sine one state earlier, NaN if not known; the fastest it has changed near by */
  int row;              /* that is nearly dependent on others */
  int crossed;          /* 1: branches that meet were crossed near by */
} pw_geometry;

int pw_watchdog_open (struct pw_run *r, pw_error *error);
void pw_watchdog_close (struct pw_run *r);

/* The motion begins anew at the state reached, where J is evaluated. */
void pw_watchdog_begin (struct pw_run *r);

/* The smallest sine of the angle between a constraint row and those before it, with the J last evaluated; *row (if not
 * NULL): which, or -1. */
double pw_watchdog_sine (struct pw_run *r, int *row);

/* The same for the state reached. */
int pw_watchdog_near_state (struct pw_run *r);

/* Refuses initial values whose products overflow, and, in scenes with constraints, such masses and inertias.  Errors: PW_INPUT. */
int pw_watchdog_check_values (const pw_system *s, const pw_watchdog *limits, pw_error *error);

/* 1 if the sine may be below this one, or a motion of this length from the state reached may bring it there. */
int pw_watchdog_reaches (const struct pw_run *r, double sine, double length);

/* 1 if the J last evaluated is near a singular configuration; geometry.sine is then its sine. */
int pw_watchdog_near (struct pw_run *r);

/* Follows the state reached, where J is evaluated.  PW_METHOD if the step has passed a change point that it does not
 * resolve. */
int pw_watchdog_follow (struct pw_run *r, pw_error *error);

/* Has the motion come from geometry.q to the state reached without leaving its branch?  (change_point.c) */
int pw_change_point_check (struct pw_run *r, double sine, pw_error *error);

/* Does the step resolve a change point that the motion has passed at a small distance, with the sine `last` one state ago?  For
 * steps of a given size; others have an error control. */
int pw_change_point_resolve (struct pw_run *r, double last, pw_error *error);

#endif
