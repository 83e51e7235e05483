/* Derivatives of a run in progress; for variation*.c only.  Equations in variation.c.  n coordinates, m constraint
 * equations. */
#ifndef PW_VARIATION_H
#define PW_VARIATION_H

#include "linear.h"

enum {
  PW_VARIATION_NEIGHBOURS = 4, /* neighbouring runs of a direction */
  PW_VARIATION_STAGES = 3,     /* of an implicit step */
  PW_VARIATION_RATES = 7,      /* stages of a step, and the derivative at its end */
  PW_VARIATION_POINTS = 256,   /* most states of the run between the derivatives' time and its own */
  PW_VARIATION_DENSE = 100     /* most coordinates for implicit steps, which need dense matrices */
};

/* The derivative along a direction, or its error. */
typedef struct {
  const struct pw_direction_copy *direction;
  double *Y;                     /* size: dq, dv, d ledger, the latter only with `ledger` */
  double *K[PW_VARIATION_RATES]; /* size: time derivatives of Y at the stages; implicit steps: F_i, then Y_i */
  double *lambda;                /* m: d lambda at the state last evaluated */
  double *trial;                 /* size: Y at a stage, or at the end of a step */
  double slope;                  /* derivative of the breakpoint being passed */
  double largest;                /* norm of Y so far, in units of the scene */
  double energy;                 /* largest derivative of work and losses so far */
} pw_variation_column;

/* Sums of the magnitudes, in units of the scene, of differences, of their errors, and of the round-off in these. */
typedef struct {
  double all, error, round;
} pw_difference_sums;

typedef struct pw_direction_copy {
  pw_direction given;
  int columns; /* 2, or 1 with `no_error` */
  pw_variation_column column[2];
  double breakpoint[PW_VARIATION_NEIGHBOURS]; /* of the neighbours: the next one */
  double first, last;                         /* times between which no neighbour has a breakpoint */
  /* of each column, n + 3 m: derivatives of f - M a - J^T lambda, gamma - J a, g, J v - eta by the parameter */
  double *effect[2];
  double *terms;                     /* n + 3 m: magnitudes of the terms of these differences */
  pw_difference_sums start, effects; /* of the initial state; of the effects at all evaluations */
  double *local_error;               /* size: error of the derivative in the last step */
  int signals;                       /* 1: some signals differ in the neighbours */
  /* batches + 1: 1 if the batch differs in the neighbours; the last one: masses or constant forces */
  unsigned char *changes;
  char *memory;
} pw_direction_copy;

/* A state of the run: t, q, v, a. */
typedef struct {
  double t, *x; /* 3 n */
  int jumps;    /* 1: accelerations jump between this state and the next one, at the same time but for round-off */
} pw_variation_point;

/* Times on one side of a jump at which neighbours of the state of the run may be on the other side.  They are
 * evaluated near the state of another time instead; the interval is so short that this changes their effect by
 * round-off. */
typedef struct {
  double from, to;
  double t, *state; /* q, v */
} pw_variation_hold;

struct pw_variation {
  pw_run *r;
  int n, m, entries, size, count; /* size: 2 n + entries; count: directions */
  int ledger;
  pw_direction_copy *direction;           /* count */
  pw_linearisation linear;                /* at the state last evaluated */
  double t;                               /* of the derivatives */
  double at;                              /* time of the state last evaluated */
  double h;                               /* next step [s] */
  double last_error;                      /* of the last accepted step, relative */
  int stiff;                              /* number of steps whose size stability limited */
  struct pw_variation_implicit *implicit; /* implicit steps; NULL: explicit ones */
  double *q, *v;                          /* n + 3: the state last evaluated */
  double *a[PW_VARIATION_RATES];          /* n: accelerations of the run at the stages */
  /* n: errors of the run's velocities in the last step: the estimate of the method, and the difference from the run's
   * own */
  double *motion_error, *motion_defect;
  double speed;             /* largest velocity of the run so far, in units of the scene */
  double reversal;          /* change of a velocity over which a force reverses, at most 1, in units of the scene */
  double *scratch, *output; /* k = 3 n + 4 m + entries + 9 each; results of pw_variation_outputs */
  double *values;           /* 2 k: scratch */
  int elements;
  double *element_energy; /* 2 elements: potential energies at two states */
  double *sample[2];      /* 3 n + m + entries: results */
  int may_jump;           /* 1: accelerations may jump with the state */
  double begun;           /* the beginning of the run's last step */
  int points, room;
  pw_variation_point *point; /* room: states of the run from t on */
  double passed;             /* the last breakpoint that the derivatives have passed */
  pw_variation_hold hold[2]; /* before the next jump, after the last one */
  char *memory;
};

#define PW_EACH_COLUMN(c, x)                                                        \
  for (pw_direction_copy *d = (x)->direction; d < (x)->direction + (x)->count; d++) \
    for (pw_variation_column *c = d->column; c < d->column + d->columns; c++)

/* The time and the state at which neighbours are evaluated. */
typedef struct {
  double t;
  const double *q, *v;
  int held; /* 1: not those of the run */
} pw_variation_place;

static inline void pw_variation_add (double *restrict to, const double *restrict from, double weight, int n) {
  for (int i = 0; i < n; i++) to[i] += weight * from[i];
}

/* ---- variation_path.c ---- */

/* Appends the state of the run at time t, in its last step.  A status. */
int pw_variation_append (pw_variation *x, double t, pw_error *error);
/* Inserts states between point i and the last one, in the last step of a run that adapts its steps, until
 * interpolation is as good as a tenth of its tolerance.  A status. */
int pw_variation_refine (pw_variation *x, int i, pw_error *error);
/* A new last point, without a state. */
int pw_variation_add_point (pw_variation *x, pw_error *error);
/* Accelerations of the run's equations at a state; just before a breakpoint.  A status. */
int pw_variation_accelerations (pw_variation *x, double t, const double *q, const double *v, double *a,
                                pw_error *error);
/* Discards states before t. */
void pw_variation_discard_points (pw_variation *x);
/* The state at a time, q and v, by Hermite interpolation. */
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
/* Where to evaluate neighbours: at the state evaluated, at a time between their breakpoints, one of which they may
 * pass slightly before the run; near a jump, at the state held. */
pw_variation_place pw_variation_place_of (const pw_variation *x, const pw_direction_copy *d);

/* The least effect of a unit of p that counts, in units of the scene. */
double pw_variation_least_effect (const pw_direction_copy *d);

/* ---- variation_outputs.c ---- */

/* The step of differences along a column: the state changes by at most 1e-5 in units of the scene. */
double pw_variation_step_along (const pw_variation_column *c);
/* Derivatives of kinetic and potential energy, the ledger's rates, least-norm multipliers along a column: 2 + entries
 * + m numbers.  Non-zero if a signal fails. */
int pw_variation_outputs (pw_variation *x, const pw_variation_column *c, const double *Y, double *out);
/* Time derivatives of the columns' ledgers into K[k].  Non-zero if a signal fails. */
int pw_variation_ledger_rates (pw_variation *x, int k);
/* All time derivatives into K[k]; accelerations of the run into a[k].  A status. */
int pw_variation_time_derivatives (pw_variation *x, int k, pw_error *error);

/* ---- variation_step.c ---- */

/* Makes every column's `trial`, projected, its derivatives at the state evaluated. */
int pw_variation_restart (pw_variation *x, pw_error *error);
/* Tries a step that does not pass t1 or the state that the run has reached; the next one is smaller if it fails. */
int pw_variation_step (pw_variation *x, double t1, pw_error *error);

/* ---- variation_explicit.c ---- */

/* The columns after a step from x->t to t1 = x->t + h into `trial`, with the state there evaluated; `motion_error`;
 * adds the integral of accelerations to `motion_defect`. */
int pw_variation_explicit_stages (pw_variation *x, double h, double t1, pw_error *error);
/* Entries from `first` to `end` - 1 of `local_error`, when the last time derivatives are known. */
void pw_variation_explicit_errors (pw_variation *x, double h, int first, int end);
/* h times the rate of the fastest component of the derivatives. */
double pw_variation_stiffness (const pw_variation *x, double h);

/* ---- variation_implicit.c ---- */

typedef struct pw_variation_implicit pw_variation_implicit;
/* NULL without memory. */
pw_variation_implicit *pw_variation_implicit_open (const pw_variation *x);
void pw_variation_implicit_close (pw_variation_implicit *p);
/* As pw_variation_explicit_stages, and `local_error`; all errors are estimates of order h^4. */
int pw_variation_implicit_stages (pw_variation *x, double h, double t1, pw_error *error);

/* ---- variation_breakpoint.c ---- */

/* Index of a column in its direction. */
static inline int pw_variation_column_index (const pw_variation_column *c) {
  return (int)(c - c->direction->column);
}

/* Finds the neighbours' breakpoints that correspond to the next one of the run. */
int pw_variation_look_ahead (pw_variation *x, pw_direction_copy *d, double next, pw_error *error);
/* Passes the breakpoint at which run and derivatives have arrived. */
int pw_variation_pass_breakpoint (pw_variation *x, pw_error *error);
/* To the state q, v at time t, at which accelerations jump from those at the state evaluated: `trial` becomes every
 * column after the jump, whose time has the derivative `slope`. */
int pw_variation_jump (pw_variation *x, double t, const double *state, pw_error *error);

/* ---- variation_jump.c ---- */

/* Finds jumps between the points from `first` on, and inserts the states on both sides.  A status. */
int pw_variation_find_jumps (pw_variation *x, int first, pw_error *error);
/* The time of the first of these jumps that has not been passed, or INFINITY. */
double pw_variation_recorded_jump (const pw_variation *x);
/* Prepares the steps up to the first of these jumps. */
int pw_variation_approach_jump (pw_variation *x, pw_error *error);
/* Passes the jump at which the derivatives have arrived. */
int pw_variation_pass_jump (pw_variation *x, pw_error *error);

#endif
