/* Derivatives of a run with respect to p, a parameter or initial value, while it proceeds; for variation*.c only.  The
 * equations are in variation.c.  Comments of arrays begin with their lengths; n, m, entries, size: see pw_variation. */
#ifndef PW_VARIATION_H
#define PW_VARIATION_H

#include "linear.h"

enum {
  PW_VARIATION_NEIGHBOURS = 4, /* neighbouring runs of a direction */
  PW_VARIATION_STAGES = 3,     /* of an implicit step */
  PW_VARIATION_RATES = 7,      /* 6 stages of an explicit step, and its end */
  PW_VARIATION_POINTS = 256,   /* number of recorded states at which the run waits for the derivatives */
  PW_VARIATION_DENSE = 100     /* most coordinates for implicit steps, which need dense matrices */
};

/* The derivative along a direction, or its error. */
typedef struct {
  const struct pw_direction_copy *direction;
  double *Y; /* size: derivatives of q, v and, with `ledger`, of work and losses */
  /* size: F, the time derivative of Y: K[0] at the beginning of a step, K[6] at its end, others at its stages.  Within
   * an implicit step K[1..3] are F_i, K[4..6] the stages Y_i themselves. */
  double *K[PW_VARIATION_RATES];
  double *lambda; /* m: d lambda at the state last evaluated */
  double *trial;  /* size: Y at a stage, or at the end of a step */
  double slope;   /* derivative of the time of the last breakpoint or jump, set before pw_variation_jump */
  double largest; /* norm of Y up to now, in units of the scene */
  double energy;  /* largest derivative of work and losses up to now */
} pw_variation_column;

/* Sums of magnitudes, in units of the scene: of differences, of their errors, and of the round-off in the errors. */
typedef struct {
  double all, error, round;
} pw_difference_sums;

typedef struct pw_direction_copy {
  pw_direction given;
  int columns;                                /* 2, or 1 with `no_error` */
  pw_variation_column column[2];              /* [0]: the derivative, [1]: its error */
  double breakpoint[PW_VARIATION_NEIGHBOURS]; /* the next one of each neighbour */
  double first, last;                         /* times between which no neighbour has a breakpoint */
  /* of each column, n + 3 m: effects of p, d/dp of f - M a - J^T lambda, gamma - J a, g, J v - eta at a fixed state */
  double *effect[2];
  double *terms;                     /* n + 3 m: magnitudes of the terms whose differences the effects are */
  pw_difference_sums start, effects; /* of the initial state; of the effects at all evaluations */
  double *local_error;               /* size: error of the derivative in the last step */
  int signals;                       /* 1: some signals may differ in the neighbours */
  /* batches + 1: 1 if the batch may differ in the neighbours; the last one: masses or constant forces */
  unsigned char *changes;
  char *memory;
} pw_direction_copy;

/* A state of the run. */
typedef struct {
  double t, *x; /* 3 n + 3: q, v, a, the ground's entries of a, which are unused */
  int jumps;    /* 1: accelerations jump between this state and the next one, whose times are equal up to round-off */
} pw_variation_point;

/* Times [from, to] on one side of a jump at which neighbouring runs may be on the other side.  There, neighbours are
 * evaluated at the held time t and state; the interval is so short that this changes effects of p by round-off only. */
typedef struct {
  double from, to;
  double t, *state; /* 2 n: q, v */
} pw_variation_hold;

struct pw_variation {
  pw_run *r;
  int n, m, entries, size, count;         /* coordinates, constraint equations, of the ledger, of Y, directions */
  int ledger;                             /* 1: with derivatives of work and losses */
  pw_direction_copy *direction;           /* count */
  pw_linearisation linear;                /* at the state last evaluated */
  double t;                               /* time reached by the derivatives */
  double at;                              /* time of the state last evaluated */
  double h;                               /* size of the next step [s] */
  double last_error;                      /* relative error of the last accepted step */
  int stiff;                              /* number of steps that stability has limited, less that of others; >= 0 */
  struct pw_variation_implicit *implicit; /* implicit steps; NULL: explicit ones */
  double *q, *v;                          /* n + 3: the state last evaluated */
  double *a[PW_VARIATION_RATES];          /* n: accelerations of the run at the stages */
  /* n, of the last step: error of its integral of the run's accelerations; that integral less the run's change of v */
  double *motion_error, *motion_defect;
  double speed;              /* largest velocity of the run up to now, in units of the scene */
  double reversal;           /* change of a velocity over which a force reverses, at most 1, in units of the scene */
  double *scratch, *output;  /* k = 3 n + 4 m + entries + 9 each: overwritten, as `values`, by steps and jumps; */
  double *values;            /* 2 k; `scratch` also by evaluate_at, `values` by outputs, `output` by samples */
  int elements;              /* number of elements */
  double *element_energy;    /* 2 x elements: potential energies at the state evaluated, then at another one */
  double *sample[2];         /* 3 n + m + entries: of the last sample; its error */
  int may_jump;              /* 1: accelerations may jump with the state */
  double begun;              /* time at which the run's last step has begun */
  int points, room;          /* recorded states, allocated ones */
  pw_variation_point *point; /* room: the last state of the run up to t, and all later ones */
  double passed;             /* the last breakpoint that the derivatives have passed */
  pw_variation_hold hold[2]; /* just before and just after the jump approached last */
  char *memory;
};

/* For each column c of each direction d; declares both. */
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

/* Appends the state of the run at time t, which lies in the run's last step.  A status. */
int pw_variation_append (pw_variation *x, double t, pw_error *error);
/* Inserts states between points i and i + 1, both in the run's last step, until the error of interpolation is at most a
 * tenth of the run's tolerance; none if its steps are fixed.  A status. */
int pw_variation_refine (pw_variation *x, int i, pw_error *error);
/* Adds a last point, whose state the caller stores.  PW_OK or PW_RESOURCE. */
int pw_variation_add_point (pw_variation *x, pw_error *error);
/* Accelerations (a: n + 3) by the run's equations at a state; at a breakpoint, as just before it.  A status. */
int pw_variation_accelerations (pw_variation *x, double t, const double *q, const double *v, double *a,
                                pw_error *error);
/* Discards the points before the last one at or before x->t. */
void pw_variation_discard_points (pw_variation *x);
/* The state (q, v) of the run at a time, by Hermite interpolation between recorded ones; 2 n numbers. */
void pw_variation_state (const pw_variation *x, double t, double *out);

/* ---- variation_effect.c ---- */

/* Evaluates the linearised equations and the effects of p at (t, x->q, x->v): "the state evaluated".  A status. */
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

/* The least reference for relative errors of effects of p: 1 or, for p > 1, 1/p, in units of the scene per unit of p; a
 * step of the differences is about 1e-5 p. */
double pw_variation_least_effect (const pw_direction_copy *d);

/* ---- variation_outputs.c ---- */

/* The step of differences along a column: the state changes by at most 1e-5 in units of the scene. */
double pw_variation_step_along (const pw_variation_column *c);
/* Derivatives of kinetic and potential energy, the ledger's rates, multipliers (of least norm) along a column whose
 * state is Y: 2 + entries + m numbers.  J is left at another state.  Non-zero if a signal fails. */
int pw_variation_outputs (pw_variation *x, const pw_variation_column *c, const double *Y, double *out);
/* Time derivatives of column c of each direction at its `trial`, into K[k]; of every column, with accelerations of the
 * run into a[k].  Return a status. */
int pw_variation_time_derivatives (pw_variation *x, int c, int k, pw_error *error);
int pw_variation_all_time_derivatives (pw_variation *x, int k, pw_error *error);

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
/* `local_error`, when the last time derivatives of column 0 are known. */
void pw_variation_explicit_errors (pw_variation *x, double h);
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
 * evaluates the latter and continues there.  The caller has set the `slope` of every column.  A status. */
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
