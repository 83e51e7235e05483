/* The search for steady motions; for steady*.c only.  Index names: n coordinates, m constraint equations, `group`
 * symmetries; equations in steady_equations.c. */
#ifndef PW_STEADY_H
#define PW_STEADY_H

#include "continuation.h"
#include "linear.h"

struct pw_steady {
  const pw_system *s; /* as described */
  pw_steady_settings set;
  pw_initial_value *hold; /* those of the settings */
  int n, m, holonomic, group;
  double L, T;             /* scales at the initial state */
  double origin[2], *axis; /* group x pw_steady_rates: symmetries as rates (steady_group.c) */
  unsigned char *cyclic;   /* n: 1 for angles on which nothing depends */
  int gauge;               /* symmetries that leave what is held unchanged; 0 before a solution is found */
  double *fixed;           /* gauge x group: combinations of symmetries */
  double *norm;            /* m: lengths of the rows of J */

  /* [0]: the system at a value of the parameter, a run, and its linearisation; [1]: the same, for differences. */
  struct {
    double value;
    pw_system *own; /* by settings.compile */
    pw_run *r;      /* NULL: none */
    pw_linearisation x;
  } at[2];
  pw_initial_value *known; /* 2 n: the last solution, where runs are opened */
  int solved;              /* 1: there is one */

  double *start;                              /* 2 n: initial state */
  double *q, *v, *rates, *u;                  /* the state of u; rates of displacement */
  double *F, *q0, *v0, *dq, *dv, *sum, *null; /* scratch; null: unknowns x unknowns */
  pw_branch branch;
  pw_linear linear; /* of the state q, v */
  pw_error why;     /* the last reason why a system could not be evaluated */

  int unstable, neutral; /* eigenvalues at the point reached: growing, with real part 0 */
  int sought, compare;   /* for branch_test */
  char *memory;
};

/* ---- steady_group.c ---- */

/* Rates of displacements: x and y [L], rotation about the origin, of the whole; then the angle of each body; then each
 * internal coordinate. */
static inline int pw_steady_rates (const pw_system *s) {
  return 3 + s->bodies + s->coords - 3 * s->bodies;
}
/* The rates of a combination of symmetries: `group` numbers, divided by a unit. */
void pw_steady_combine (const pw_steady *x, const double *part, double unit, double *rates);
/* The velocities that rates cause at a configuration. */
void pw_steady_field (const pw_steady *x, const double *rates, const double *q, double *v);
/* Orthonormal rows of the null space of M (rows x n, by columns, destroyed; rows >= n), within a tolerance, at least
 * round-off.  Returns their number, or a status. */
int pw_steady_null (int rows, int n, double *M, double tolerance, double *out);
/* Finds the symmetries of the system.  PW_OK, PW_RESOURCE or PW_RETRY. */
int pw_steady_find_group (pw_steady *x);
/* Finds those that what is held leaves free, at the state u. */
int pw_steady_find_gauge (pw_steady *x);
/* The largest difference of two states in units of the scene, or relative to large numbers; but for symmetries and whole
 * turns. */
double pw_steady_distance (pw_steady *x, const double *q1, const double *v1, const double *q2, const double *v2);
/* Displaces a state by symmetries to one that equivalent states share. */
void pw_steady_canonical (const pw_steady *x, double *q, double *v);
/* Displaces a state so that the first body is where it was initially, if the whole can be displaced freely. */
void pw_steady_home (const pw_steady *x, double *q, double *v);

/* ---- steady_equations.c ---- */

/* Numbers of unknowns without the parameter, and of equations. */
static inline int pw_steady_unknowns (const pw_steady *x) {
  return x->n + x->group;
}
static inline int pw_steady_equations (const pw_steady *x) {
  return x->holonomic + x->m + x->n + x->set.holds + x->group;
}
/* For pw_branch_equations. */
int pw_steady_evaluate (void *steady, const double *u, double *F, double *dF, pw_error *error);
/* The same: whether u and other are the same motion. */
int pw_steady_again (void *steady, const double *u, const double *other);
/* The state q, v of unknowns u. */
void pw_steady_state (pw_steady *x, const double *u);
/* The unknowns of the steady motion nearest to the velocities v at q.  PW_METHOD if LAPACK fails. */
int pw_steady_guess (pw_steady *x, const double *q, const double *v, double *u, pw_error *error);
double pw_steady_parameter (const pw_steady *x, const double *u);

/* ---- steady_systems.c ---- */

enum { PW_STEADY_MOST = 400 }; /* coordinates, since the cost is cubic */

/* Opens at[k] for a parameter value.  A status; PW_RETRY with x->why. */
int pw_steady_at (pw_steady *x, int k, double value);
void pw_steady_leave (pw_steady *x, int k); /* frees it */

/* ---- steady_hold.c ---- */

/* The unit of A in terms of those of the scene. */
double pw_hold_unit (const pw_steady *x, const pw_initial_value *hold);
/* A - value B, of what is held (steady_hold.c), and its change by a variation (dq, dv). */
double pw_hold_residual (const pw_system *s, const pw_initial_value *hold, const double *q, const double *v);
double pw_hold_change (const pw_system *s, const pw_initial_value *hold, const double *q, const double *v,
                       const double *dq, const double *dv);
/* The derivative of the residual with respect to its value. */
double pw_hold_slope (const pw_system *s, const pw_initial_value *hold, const double *q, const double *v);

/* ---- steady_start.c ---- */

/* The unknowns with which attempt k begins: 0, those of the initial state; 1, of a state to which forces lead from there;
 * then random states, near and far, every other pair of them consistent, half of these relaxed. */
int pw_steady_start (pw_steady *x, int k, double *u, pw_error *error);

/* ---- steady.c ---- */

/* *changed: the first signal that differs, in the run's state or one near it, between times t and t + part of the span; with
 * a period, between times in the span after t and one period later.  -1: none.  A status. */
int pw_signals_change (pw_run *r, double t, double period, double span, int *changed, pw_error *error);

/* Scales and symmetries at time t of a system whose signals may change with time; for other searches. */
pw_steady *pw_steady_open_scene (const pw_system *s, double t, double span, pw_error *error);

/* The motion of the unknowns u, a solution, with its linearisation. */
int pw_steady_motion_at (pw_steady *x, const double *u, pw_steady_motion *out, pw_error *error);

#endif
