/* The searches for steady and for periodic motions; for steady.c, steady_symmetries.c and periodic.c.
 *
 * Names: n coordinates, m constraint equations.  "Units of the scene" are L for lengths, 1 rad for angles, T for times
 * (pw_scale); pw_unit is that of a coordinate.  The unknowns u are q in units of the scene, then the coefficients xi of
 * the symmetries times T (steady.c), then the parameter, from 0 to 1 over its range. */
#ifndef PW_SEARCH_H
#define PW_SEARCH_H

#include "continuation.h"
#include "linear.h"

/* The system at a value of the parameter. */
typedef struct {
  const pw_system *described;
  pw_system *(*compile) (void *context, double value, pw_error *error); /* NULL: the described one serves */
  void *context;
  double value;   /* the last one */
  pw_system *own; /* compiled for it; NULL: none */
} pw_parametric;
/* That system, compiled unless it is the last one.  NULL, and the reason, if there is none or, with `own`, if it has
 * another number of bodies, coordinates or constraint equations. */
const pw_system *pw_parametric_at (pw_parametric *x, double value, pw_error *why);

/* Systems that stay open: a derivative by the parameter needs one on each side, a check of a step that at its start. */
enum { PW_STEADY_RECENT = 3 };

/* A system open at a value of the parameter. */
typedef struct {
  double value;
  pw_system *own; /* compiled for it; NULL: the described one serves */
  pw_run *run;    /* NULL: not open */
  pw_linearisation linearisation;
} pw_steady_system;

struct pw_steady {
  const pw_system *s; /* as described */
  pw_steady_settings settings;
  pw_initial_value *hold; /* those of the settings, with the value that varies */
  int n, m, holonomic;
  double L, T;   /* scales at the initial state [m, s] */
  double *start; /* 2 n: initial state */
  double *norm;  /* m: lengths of the rows of J near the initial state, by which residuals are divided */

  /* Displacements are given by their rates: pw_steady_rate_count. */
  int symmetries;
  double origin[2];      /* about which rates of rotation turn the whole [m] */
  double *symmetry;      /* symmetries x rates: a basis of the symmetries */
  int free_symmetries;   /* those that leave what is held unchanged; 0 before a solution is found */
  double *free_symmetry; /* free_symmetries x symmetries: their coefficients in that basis; scratch */

  pw_parametric parametric;
  pw_steady_system system, recent[PW_STEADY_RECENT]; /* the one in use; those before it, the last one first */
  pw_initial_value *solution; /* 2 n: the last solution, where runs are opened; or that configuration at rest */
  int solved;                 /* 1: there is one */

  double *q, *v, *rates, *u;      /* state, rates of displacement [1/s] at the last evaluation; unknowns */
  double *F, *dq, *dv, *combined; /* scratch: residuals, a variation, rates */
  double *scratch[3];             /* n each */
  double *null_space;             /* unknowns x unknowns: directions of a family; scratch */
  pw_branch branch;
  pw_linear linear; /* of the last motion */
  pw_error why;     /* the last reason why a system could not be evaluated, or why a branch ended */

  int unstable, neutral; /* eigenvalues at the point reached: growing, with real part 0 */
  int sought;            /* index of the eigenvalue whose change of sign is located */
  int neutral_at_ends;   /* `neutral` at both ends of the step; -1: they differ */
  char *memory;
};

/* The rates of a displacement [L/s, rad/s]: of the whole along x and y, its rotation about the origin; then of the
 * angle of each body alone; then of each internal coordinate [its unit/s]. */
enum { PW_RATE_X, PW_RATE_Y, PW_RATE_TURN, PW_RATE_ANGLES };
static inline int pw_steady_rate_count (const pw_system *s) {
  return PW_RATE_ANGLES + s->coords - 2 * s->bodies;
}
/* The index of the rate that changes alone the angle of the body with coordinate j, or internal coordinate j. */
static inline int pw_steady_angle_rate (const pw_system *s, int j) {
  return PW_RATE_ANGLES + (j < 3 * s->bodies ? j / 3 : j - 2 * s->bodies);
}
/* The number of symmetries that shift the integral of a first-order state: the first ones of x->symmetry, since each of
 * these integrals is a pivot.  They are none of the motion. */
static inline int pw_steady_hidden_symmetries (const pw_steady *x) {
  return x->symmetries ? x->s->coords - x->s->mechanical : 0;
}
/* rates = sum of coefficient[k] / unit times the rates of symmetry k. */
void pw_steady_combine (const pw_steady *x, const double *coefficient, double unit, double *rates);
/* The velocities that rates cause at a configuration. */
void pw_steady_velocities (const pw_steady *x, const double *rates, const double *q, double *v);
/* Displaces a state at these rates for a time. */
void pw_steady_displace (const pw_steady *x, const double *rates, double time, double *q, double *v);
/* A state at most `distance` units of the scene from the run's, perhaps off the constraints: an irregular one for each
 * `number`. */
void pw_irregular_state (const pw_run *r, double distance, int number, double *q, double *v);
/* Finds the symmetries of the system.  A status; PW_RETRY and PW_METHOD: the equations are singular. */
int pw_steady_find_symmetries (pw_steady *x);
/* Removes the symmetries under which the equations at x->q, x->v are not invariant; then x->symmetries decreases, and
 * unknowns lose their meaning.  A status. */
int pw_steady_keep_symmetries (pw_steady *x);
/* Finds the symmetries that leave what is held unchanged, at the state x->q, x->v.  A status. */
int pw_steady_find_free_symmetries (pw_steady *x);
/* The largest difference of two states up to symmetries and whole turns, in units of the scene; of numbers above 1 in
 * these units, except angles of bodies, relative to them. */
double pw_steady_distance (pw_steady *x, const double *q1, const double *v1, const double *q2, const double *v2);
/* Displaces a state by symmetries, to the same state for all that differ by symmetries only. */
void pw_steady_canonical (const pw_steady *x, double *q, double *v);
/* Displaces a state so that the first body is where it was initially, if the whole can be displaced freely. */
void pw_steady_move_to_start (const pw_steady *x, double *q, double *v);

static const double PW_STEADY_RANK = 1e-9; /* singular values up to it count as 0 */

/* What can be held is numbered: the states, then PW_HOLD_OF_BODY quantities of each body. */
enum { PW_HOLD_SPEED, PW_HOLD_RADIUS, PW_HOLD_CURVATURE, PW_HOLD_OF_BODY };
/* The residual A - value B of what is held (steady_symmetries.c) in the state x->q, x->v, or if dq is not NULL its
 * change by the variation (dq, dv); divided by the unit of A. */
double pw_hold_residual (const pw_steady *x, const pw_initial_value *hold, const double *dq, const double *dv);

/* *changed: the first signal that (or a derivative of which) changes within the span after time t, or if period > 0,
 * differs between times in this span and one period later; -1: none.  Signals are compared in the run's state and in
 * one up to a unit of the scene away.  A status. */
int pw_signals_change (pw_run *r, double t, double period, double span, int *changed, pw_error *error);

/* PW_INPUT, with the name, unless these settings of a search for steady or periodic motions are valid. */
int pw_check_search (double first, double last, int points, pw_error *error);
/* PW_INPUT unless the parameter is finite; unless the direction is 1 or -1 and the range is not empty. */
static inline int pw_check_parameter (double parameter, pw_error *error) {
  if (isfinite (parameter)) return PW_OK;
  return pw_fail (error, PW_INPUT, "parameter = %g: expected a finite number", parameter);
}
static inline int pw_check_branch (int direction, double first, double last, pw_error *error) {
  if (direction != 1 && direction != -1)
    return pw_fail (error, PW_INPUT, "direction = %d: expected 1 or -1", direction);
  return first == last ? pw_fail (error, PW_INPUT, "first = last = %.9g: expected a range", first) : PW_OK;
}

/* As pw_steady_open, for searches that need only scales and symmetries: signals may change. */
pw_steady *pw_steady_open_symmetries (const pw_system *s, const pw_steady_settings *settings, pw_error *error);

/* What pw_periodic_flow computes: the motion; or its derivatives only, accurate enough for Newton's method, or for
 * multipliers. */
typedef enum { PW_FLOW, PW_FLOW_DERIVATIVES, PW_FLOW_MULTIPLIERS } pw_flow_accuracy;

struct pw_periodic {
  const pw_system *s; /* as described */
  pw_periodic_settings settings;
  pw_steady *steady; /* of pw_steady_open_symmetries */
  int n, symmetries; /* number of coordinates; of symmetries */
  double L, T;       /* scales [m, s] */
  pw_parametric parametric;
  double period; /* of the system at that value, verified; free: during which signals are constant [s]; 0: not yet */
  pw_branch branch;
  double *u;           /* scaled: 2 n of the state, displacement along symmetries in a period, free period; parameter */
  double last_period;  /* the period of the last motion, or a guess of a free one [s] */
  double begin_period; /* the period of the motion that pw_periodic_solve has found, at x->u [s]; 0: none */
  /* Of the last flow: state at its beginning and end, with accelerations there. */
  double *y0, *y1, *a0, *a1; /* 2 n, 2 n, n, n */
  double *state, *change;    /* 2 n: a state that a run begins with, a change of a state; scratch */
  int size;                  /* number of minimal coordinates of changes of the initial state */
  double *basis, *Phi; /* 2 n x size, by columns: changes of the initial state, of the state after a period, by each */
  double *dual;        /* size x 2 n, by columns: minimal coordinates of a change of each entry by its unit */
  long steps;          /* of the run at the last iterate of Newton's method; 0: not yet known */
  double *monodromy;   /* size x size, by columns: the monodromy matrix; then scratch */
  double *re, *im;     /* size: its eigenvalues, the multipliers */
  double *work;        /* scratch: rates, unknowns */
  pw_error why;        /* the last reason why a motion could not be computed, or why a branch ended */
  int unstable;        /* multipliers outside the unit circle at the last point; -1: not known */
  int sought;          /* index of the multiplier whose crossing of the unit circle is located */
  int on_circle;       /* 1: this multiplier moves on the unit circle until it leaves it */
  char *memory;
};

/* The number of unknowns, without the parameter. */
static inline int pw_periodic_unknowns (const pw_periodic *x) {
  return 2 * x->n + x->symmetries + x->settings.free;
}
/* The unit of entry j of a state. */
static inline double pw_periodic_unit (const pw_periodic *x, int j) {
  return j < x->n ? pw_unit (x->s, j) : pw_unit (x->s, j - x->n) / x->T;
}
static inline double pw_periodic_parameter (const pw_periodic *x, const double *u) {
  return x->settings.first + u[pw_periodic_unknowns (x)] * (x->settings.last - x->settings.first);
}

/* Integrates one period from the state of u: sets y0, a0, and then y1, a1, or with derivatives instead of these size,
 * basis, dual, Phi.  A status; PW_RETRY: there is no such motion, perhaps with x->why, or the search was stopped. */
int pw_periodic_flow (pw_periodic *x, const double *u, pw_flow_accuracy accuracy, pw_error *error);

#endif
