/* Derivatives of a run in progress; for variation*.c only.  Equations in variation.c.  Comments of arrays begin with
 * their lengths: n coordinates, m constraint equations, `entries` of the ledger. */
#ifndef PW_VARIATION_H
#define PW_VARIATION_H

#include "linear.h"

enum {
  PW_VARIATION_NEIGHBOURS = 4, /* neighbouring runs of a direction */
  PW_VARIATION_STAGES = 3,     /* of an implicit step */
  PW_VARIATION_RATES = 7,      /* stages of an explicit step, and the time derivative at its end */
  PW_VARIATION_POINTS = 256,   /* recorded states of the run at which it waits for the derivatives */
  PW_VARIATION_DENSE = 100     /* most coordinates for implicit steps, which need dense matrices */
};

/* The derivative along a direction, or its error. */
typedef struct {
  const struct pw_direction_copy *direction;
  double *Y;                     /* size: dq, dv, d ledger, the latter only with `ledger` */
  double *K[PW_VARIATION_RATES]; /* size: F = Y' at stages and end; implicit steps: F, F_i, Y_i (Y_3, then F at end) */
  double *lambda;                /* m: d lambda at the state last evaluated */
  double *trial;                 /* size: Y at a stage, or at the end of a step */
  double slope;                  /* derivative of the time of the breakpoint or jump passed last */
  double largest;                /* norm of Y so far, in units of the scene */
  double energy;                 /* largest derivative of work and losses so far */
} pw_variation_column;

/* Sums of magnitudes, in units of the scene: of differences, of their errors, and of the round-off in the errors. */
typedef struct {
  double all, error, round;
} pw_difference_sums;

typedef struct pw_direction_copy {
  pw_direction given;
  int columns;                                /* 2, or 1 with `no_error` */
  pw_variation_column column[2];              /* the derivative, its error */
  double breakpoint[PW_VARIATION_NEIGHBOURS]; /* the next one of each neighbour */
  double first, last;                         /* times between which no neighbour has a breakpoint */
  /* of each column, n + 3 m: d/dp of f - M a - J^T lambda, gamma - J a, g, J v - eta */
  double *effect[2];
  double *terms;                     /* n + 3 m: magnitudes of the terms of which these are differences */
  pw_difference_sums start, effects; /* of the initial state; of the effects at all evaluations */
  double *local_error;               /* size: error of the derivative in the last step */
  int signals;                       /* 1: some signals may differ in the neighbours */
  /* batches + 1: 1 if the batch may differ in the neighbours; the last one: masses or constant forces */
  unsigned char *changes;
  char *memory;
} pw_direction_copy;

/* A state of the run. */
typedef struct {
  double t, *x; /* 3 n + 3: q, v, a, and room for the ground's entries of a */
  int jumps;    /* 1: accelerations jump between this state and the next one, at the same time up to round-off */
} pw_variation_point;

/* Times [from, to] on one side of a jump at which motions nearby may be on the other side.  Neighbours are evaluated at
 * the held time t and state instead; the interval is so short that their effects change by round-off. */
typedef struct {
  double from, to;
  double t, *state; /* 2 n: q, v */
} pw_variation_hold;

struct pw_variation {
  pw_run *r;
  int n, m, entries, size, count;         /* size: of Y; count: number of directions */
  int ledger;                             /* 1: with derivatives of work and losses */
  pw_direction_copy *direction;           /* count */
  pw_linearisation linear;                /* at the state last evaluated */
  double t;                               /* time reached by the derivatives */
  double at;                              /* time of the state last evaluated */
  double h;                               /* size of the next step [s] */
  double last_error;                      /* relative error of the last accepted step */
  int stiff;                              /* steps whose size stability limited, minus others; >= 0 */
  struct pw_variation_implicit *implicit; /* implicit steps; NULL: explicit ones */
  double *q, *v;                          /* n + 3: the state last evaluated */
  double *a[PW_VARIATION_RATES];          /* n: accelerations of the run at the stages */
  /* n, of the last step: error with which its formula integrates accelerations; this integral less the change of v */
  double *motion_error, *motion_defect;
  double speed;              /* largest velocity of the run so far, in units of the scene */
  double reversal;           /* change of a velocity over which a force reverses, at most 1, in units of the scene */
  double *scratch, *output;  /* k = 3 n + 4 m + entries + 9 each; `output`: of pw_variation_outputs */
  double *values;            /* 2 k: scratch */
  int elements;              /* number of elements */
  double *element_energy;    /* 2 elements: potential energies at the state evaluated, and at another one */
  double *sample[2];         /* 3 n + m + entries: of the last sample; its error */
  int may_jump;              /* 1: accelerations may jump with the state */
  double begun;              /* the beginning of the run's last step */
  int points, room;          /* recorded states, allocated ones */
  pw_variation_point *point; /* room: the last state of the run up to t, and all later ones */
  double passed;             /* the last breakpoint that the derivatives have passed */
  pw_variation_hold hold[2]; /* just before and just after the jump approached last */
  char *memory;
};

#define PW_EACH_COLUMN(c, x)                                                        \
  for (pw_direction_copy *d = (x)->direction; d < (x)->direction + (x)->count; d++) \
    for (pw_variation_column *c = d->column; c < d->column + d->columns; c++)

/* The time and the state at which neighbours are evaluated. */
typedef struct {
  double t;
  const double *q, *v;
  int held; /* 1: time and state of a pw_variation_hold */
} pw_variation_place;

/* ---- variation_path.c ---- */

/* Appends the state of the run at time t, in its last step.  A status. */
int pw_variation_append (pw_variation *x, double t, pw_error *error);
/* Inserts states between points i and i + 1, both in the last step of a run that adapts its steps, until interpolation
 * is as good as a tenth of its tolerance.  A status. */
int pw_variation_refine (pw_variation *x, int i, pw_error *error);
/* Adds a last point, whose state the caller stores.  PW_OK or PW_RESOURCE. */
int pw_variation_add_point (pw_variation *x, pw_error *error);
/* Accelerations (a: n + 3) by the run's equations at a state; at a breakpoint, those before it.  A status. */
int pw_variation_accelerations (pw_variation *x, double t, const double *q, const double *v, double *a,
                                pw_error *error);
/* Discards the states that precede the last one up to x->t. */
void pw_variation_discard_points (pw_variation *x);
/* The state (q, v) of the run at a time, by Hermite interpolation between recorded ones; 2 n numbers. */
void pw_variation_state (const pw_variation *x, double t, double *out);

/* ---- variation_effect.c ---- */

/* Evaluates the linearised equations, and the effects of parameters, at (t, x->q, x->v).  A status. */
int pw_variation_evaluate (pw_variation *x, double t, pw_error *error);
/* The same at the state of the run at time t. */
int pw_variation_evaluate_at (pw_variation *x, double t, pw_error *error);
/* The largest of the derivatives of a state, Y, in units of the scene. */
double pw_variation_norm (const pw_variation *x, const double *Y);
/* Time derivatives of dq and dv, of column c of each direction, at its `trial` and the state evaluated, into K[k]. */
void pw_variation_accelerate (pw_variation *x, int c, int k);
/* Projects a column's `trial` onto the linearised constraints at the state evaluated. */
void pw_variation_project (pw_variation *x, pw_variation_column *c);
/* Where to evaluate neighbours: at the state evaluated, and a time between d->first and d->last, since their
 * breakpoints differ slightly from the run's; near a jump, at the held time and state. */
pw_variation_place pw_variation_place_of (const pw_variation *x, const pw_direction_copy *d);

/* Smaller effects of p count as this large: 1 or, for p > 1, 1/p, in units of the scene per unit of p; a step of the
 * differences is about 1e-5 p. */
double pw_variation_least_effect (const pw_direction_copy *d);

/* ---- variation_outputs.c ---- */

/* The step of differences along a column: the state changes by at most 1e-5 in units of the scene. */
double pw_variation_step_along (const pw_variation_column *c);
/* Derivatives of kinetic and potential energy, the ledger's rates, multipliers (of least norm) along a column whose
 * state is Y: 2 + entries + m numbers.  J is left at another state.  Non-zero if a signal fails. */
int pw_variation_outputs (pw_variation *x, const pw_variation_column *c, const double *Y, double *out);
/* Time derivatives of the work and losses of every column at its `trial`, into K[k].  Non-zero if a signal fails. */
int pw_variation_ledger_rates (pw_variation *x, int k);
/* All time derivatives of every column at its `trial`, into K[k]; accelerations of the run into a[k].  A status. */
int pw_variation_time_derivatives (pw_variation *x, int k, pw_error *error);

/* ---- variation_step.c ---- */

/* Continues from `trial` of every column, projected, at the state evaluated.  A status. */
int pw_variation_restart (pw_variation *x, pw_error *error);
/* Tries a step that passes neither t1 nor the time that the run has reached.  If its error is too large, it is not
 * made: PW_OK, and the next call tries a smaller one.  A status. */
int pw_variation_step (pw_variation *x, double t1, pw_error *error);

/* ---- variation_explicit.c ---- */

/* Computes the columns after a step from x->t to t1 = x->t + h into `trial`, evaluates the state there, estimates
 * `motion_error` and adds the integral of the accelerations to `motion_defect`.  A status. */
int pw_variation_explicit_stages (pw_variation *x, double h, double t1, pw_error *error);
/* Entries from `first` to `end` - 1 of `local_error`, when the last time derivatives are known. */
void pw_variation_explicit_errors (pw_variation *x, double h, int first, int end);
/* h times the rate of the fastest component of the derivatives. */
double pw_variation_stiffness (const pw_variation *x, double h);

/* ---- variation_implicit.c ---- */

typedef struct pw_variation_implicit pw_variation_implicit;
/* NULL if out of memory. */
pw_variation_implicit *pw_variation_implicit_open (const pw_variation *x);
void pw_variation_implicit_close (pw_variation_implicit *p);
/* As pw_variation_explicit_stages, and `local_error`; all errors are estimates of order h^4. */
int pw_variation_implicit_stages (pw_variation *x, double h, double t1, pw_error *error);

/* ---- variation_breakpoint.c ---- */

/* Index of a column in its direction. */
static inline int pw_variation_column_index (const pw_variation_column *c) {
  return (int)(c - c->direction->column);
}

/* Finds the neighbours' breakpoints that correspond to `next`, the next one of the run.  PW_METHOD if they do not. */
int pw_variation_look_ahead (pw_variation *x, pw_direction_copy *d, double next, pw_error *error);
/* Passes the breakpoint at which run and derivatives have arrived.  A status. */
int pw_variation_pass_breakpoint (pw_variation *x, pw_error *error);
/* Passes a jump of the accelerations, from those at the state evaluated to those at `state` (q, v) and time t:
 * evaluates the latter and continues there, with the derivative `slope` of the time of the jump.  A status. */
int pw_variation_jump (pw_variation *x, double t, const double *state, pw_error *error);

/* ---- variation_jump.c ---- */

/* Finds jumps between the points from `first` on, and records the states on both sides of each.  A status. */
int pw_variation_find_jumps (pw_variation *x, int first, pw_error *error);
/* The time of the first of these jumps that has not been passed, or INFINITY. */
double pw_variation_recorded_jump (const pw_variation *x);
/* Determines the times around the first of these jumps at which neighbours are held; restarts if the derivatives are
 * within them.  A status. */
int pw_variation_approach_jump (pw_variation *x, pw_error *error);
/* Passes the jump at which the derivatives have arrived.  A status. */
int pw_variation_pass_jump (pw_variation *x, pw_error *error);

#endif
