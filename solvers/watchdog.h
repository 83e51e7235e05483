/* The watchdog checks that the computed states still follow the motion of the mechanism, for all methods.
 *
 * All thresholds are dimensionless and in one table: positions in units of the scene's length L, angles in radians.
 * Singular configurations are a property of J alone, with rows of length 1 and columns of angles divided by L: neither
 * masses nor the initial configuration matter.  The distance from them is measured by the smallest sine of the angle
 * between a row of J and the space of those before it, called the sine below.  Branches are the motions between which a
 * closed loop can change in a singular configuration, a change point. */
#ifndef PW_WATCHDOG_H
#define PW_WATCHDOG_H

#include "saddle.h"

struct pw_run;

/* The thresholds; a run has a copy.  Values and derivations are in singular.c. */
typedef struct {
  double lost, lost_unstabilised;  /* residuals above which constraints count as lost */
  double follows, magnified;       /* residual with which a redundant row follows; its ratio to those of the others */
  double rank, suspect, dependent; /* sines: rank lost; rank is examined; refused if the scene is too large for that */
  double independent;              /* sine above which a row counts as independent */
  double near, refine;     /* sines: near a singular configuration, relative to the largest; solutions are refined */
  double regular;          /* sine that counts as regular, relative to the largest */
  double turn, least_turn; /* growth of the accelerations where a branch turns; least value before it */
  double drift_turn, drift_near; /* residual over squared sine: where accelerations grow; where they are no reference */
  double drift_far, drift_any;   /* residual that is suspect without such growth; it over the squared sine */
  double jump;                   /* growth of the accelerations in a jump */
  double lipschitz, growth; /* largest change of the sine per unit of motion; of step sizes, from one to the next */
  double unresolved, low;   /* sine within a step over those at its ends: corner not resolved; to be examined */
  double stride, progress;  /* of walks past a change point: length over the sine; least gain of a stride */
  double floor, crossing, straight; /* sines where branches cross; cosine of the angle of a straight passage */
  double resolved;                  /* step over the distance of branches */
  double ends_singular;             /* sine at the end of a step over that at its beginning */
  double agree, agree_best;         /* acceptable and best difference between two divisions of a step */
  double sample, sample_best;       /* the same for a sample inside a step */
  double loosened, loose; /* independence below which other active rows are tried: over the reference; in all cases */
  double extreme;         /* the largest mass, and one over the smallest [kg]; the largest initial value */
  double stalled;         /* consecutive steps that do not advance */
} pw_watchdog;

extern const pw_watchdog pw_watchdog_limits;

/* Geometry of the constraints along a run. */
typedef struct {
  pw_saddle *saddle; /* of weights 1 and L^2: its pivots are sines; NULL: a tree of holonomic joints, never singular */
  int loops;         /* 1: bodies form closed loops, whose branches can meet */
  double sine, typical; /* the last sine computed; the largest at a state reached */
  double state_sine;    /* the sine at the last accepted state for which it was computed */
  double moved;         /* motion since then [units of L, rad] */
  int alert;            /* 1: a singular configuration may be within the next step */
  double step;          /* length of the last step, in the units of `moved` */
  double t, start_sine; /* the previous state: time, sine (NaN: not computed) */
  double *q;            /* and coordinates */
  double before, slope; /* the sine one state before `state_sine`, or NaN; its fastest recent change */
  int row;              /* the row that is most nearly dependent */
  int crossed;          /* 1: a point where branches cross was passed recently */
} pw_geometry;

int pw_watchdog_open (struct pw_run *r, pw_error *error);
void pw_watchdog_close (struct pw_run *r);

/* Restarts at the state reached, where J is evaluated. */
void pw_watchdog_begin (struct pw_run *r);

/* The sine with the J last evaluated; *row (if not NULL): the row that forms this angle, or -1. */
double pw_watchdog_sine (struct pw_run *r, int *row);

/* pw_watchdog_near at the state reached, which it evaluates. */
int pw_watchdog_near_state (struct pw_run *r);

/* Rejects initial values and, in scenes with constraints, masses and inertias whose products overflow.  Errors:
 * PW_INPUT. */
int pw_watchdog_check_values (const struct pw_run *r, pw_error *error);

/* 1 if the J last evaluated is near a singular configuration; geometry.sine is then its sine. */
int pw_watchdog_near (struct pw_run *r);

/* Checks that the motion has come from geometry.q to the state reached without leaving its branch (change_point.c). */
int pw_change_point_check (struct pw_run *r, double sine, pw_error *error);

/* Checks that a step of fixed size resolves a change point that the motion has passed at a small distance; `last`:
 * the sine one state earlier.  Adaptive methods have error control instead. */
int pw_change_point_resolve (struct pw_run *r, double last, pw_error *error);

#endif
