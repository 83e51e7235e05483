/* Modes of constraint equations whose multipliers have limits (modes.c), and what events.c knows of them.
 *
 * Mode 0: the equation holds.  Mode 1: its multiplier lambda is given, at its largest value, and u >= 0; mode -1: at
 * its smallest value, and u <= 0.  u is J v - eta or, of a holonomic equation, g. */
#ifndef PW_MODES_H_
#define PW_MODES_H_
#include "decision.h"
#include "method.h"

/* Velocities [units] that count as 0 where modes are decided: a hundred times the error, 1e-13, to which a root of u is
 * located (events_tolerance), so that friction that has stopped is found at rest. */
#define PW_MODES_SMALL 1e-11
/* Impacts below this velocity [units] do not bounce: the next ones, in sum, would move nothing by more than v^2 /
 * acceleration, 1e-12 units. */
#define PW_MODES_SLOW 1e-6

typedef struct pw_events {
  int count;                            /* equations with limits; arrays of this length, unless said otherwise */
  int *row;                             /* their indices */
  pw_bounds *limit;                     /* their limits */
  double *force_unit, *unit;            /* of the multiplier; of u */
  signed char *mode, *before;           /* before: those before a decision */
  unsigned char *away;                  /* 1: u of a circle has left 0 by more than 4 e0 since it slides */
  unsigned char *armed;                 /* 1: u has left its root, so that it may return there */
  unsigned char *triggered;             /* 1: at the root that is the state reached */
  unsigned char *rests;                 /* 1: u is 0 after an impact */
  unsigned char *struck;                /* 1: it has had an impact since the last motion that was not too short */
  unsigned char *spare;                 /* 1: it holds since others do, on which it depends: its multiplier is 0 */
  unsigned char *still;                 /* 1: at its limit, but u, of a circle the first one, is 0 since others hold */
  int *partner;                         /* of friction: its normal equation; -1: none */
  int *place;                           /* in D; -1: not in it */
  unsigned char *enforced;              /* rows: what r->enforced points to */
  unsigned char *other;                 /* rows: active equations of the saddle of a decision */
  double *start, *end, *previous, *now; /* 2 count: event functions at the ends of the last step, before it, anywhere */
  double start_t, previous_t;           /* NaN: not known */
  double longest, roughness; /* next adaptive step [s]; the bend of multipliers in the last one over EVENTS_BEND */
  double stride;             /* longest next fixed step [s] where a circle has begun to slide, and u is small */
  double *memory;            /* of pw_first_crossing */
  double *u, *u_before, *impulse;
  const unsigned char *origin;             /* of initial values: of the run; NULL in a restart */
  double *direction, *bias, *reach, *rate; /* d, e, e0 and A L of circles */
  double *offset;   /* by which u [units] was on the wrong side of its root when it began to leave it: drift */
  int at_end;       /* 1: the state reached, its multipliers and its J are known */
  int samples;      /* 1: J has been evaluated elsewhere since */
  int idle;         /* decisions in sequence that changed no mode; */
  double decided_t; /* the time of the last one */
  int pending;      /* 1: modes must be decided at the state reached */
  int fell;         /* 1: u has changed its sign without having left its root: too short a motion to be resolved */
  int stepping;     /* 1: events are not located; impulses of whole steps are decided (moreau) */
  int jumped;       /* 1: there was an impact in the last step */
  double *mean;     /* multipliers of the last step: its impulses over its length */

  pw_decision d;                  /* of the last decision; D: by their number among those with limits */
  double *f, *a, *gamma, *lambda; /* coords + 3; the same; rows; 2 rows */
} pw_events;

/* The multiplier of an equation at a limit; on a circle, at the beginning of the step. */
double pw_mode_given (const pw_events *x, int i);

/* 1 for friction of a contact that is open: it is off, whatever its mode. */
int pw_mode_apart (const pw_events *x, int i);

/* 1 if u is 0 since others hold, on which the equation depends. */
int pw_mode_depends (const pw_events *x, int i);

/* The mode that users see. */
signed char pw_mode_shown (const pw_events *x, int i);

/* The mode of an equation that does not hold: of one with two finite limits by the sign of u. */
signed char pw_mode_off (const pw_events *x, int i, double u);

/* An equation slides, or both of a circle, of which i is the first, with these u. */
void pw_mode_slide (pw_events *x, int i, const double *u);

/* Sets the limits that vary, where kinematics are up to date. */
void pw_modes_set_limits (pw_run *r);

/* u of the equations with limits at velocities v, where J is evaluated; of holonomic equations their rate, unless g is
 * 1. */
void pw_modes_u (pw_run *r, const double *v, int g, double *u);

/* Makes the modes those of the run: r->enforced, and the given multipliers of the other equations. */
void pw_modes_apply (pw_run *r);

/* Before a step: the direction of the forces on circles, from the state reached.  Returns the longest step that
 * follows it; INFINITY: any. */
double pw_modes_begin_step (pw_run *r);

/* ---- Decisions at an instant ---- */

/* Decides the modes at the state reached.  jumps: 1 for initial velocities.  Errors: PW_METHOD, as of pw_modes_fail. */
int pw_modes_decide (pw_run *r, int jumps, pw_error *error);

/* Adds an equation to D, with the limits of its multiplier or, of friction, of the multiple of the normal one. */
void pw_modes_add (pw_events *x, int i, double lo, double hi, signed char trial);

/* The saddle without the equations D (impact: without all that have limits), A, and b: of accelerations; of velocities
 * in an impact.  NULL on errors. */
pw_saddle *pw_modes_open_decision (pw_run *r, int impact, pw_error *error);

/* Evaluates A with the saddle of the other equations, which must be factorised. */
void pw_modes_matrix (pw_run *r, pw_saddle *saddle);

/* pw_decide, where an equation that slides may have a smaller multiplier than one that holds.  x are `unit` times
 * multipliers. */
int pw_modes_decide_sliding (pw_events *x, double unit, int *count);

/* Adds to v the velocities of the impulses -x on D; impulses of the other equations in x->lambda. */
void pw_modes_push (pw_run *r, pw_saddle *saddle, double *v);

/* After pw_modes_push: u from the velocities v, and the ledger. */
void pw_modes_end_impact (pw_run *r, const double *v);

/* Fails with the equations of D.  count: of solutions, -1: not known. */
int pw_modes_fail (pw_run *r, pw_saddle *saddle, int count, pw_error *error);

#endif
