/* The search for relative periodic motions; for periodic*.c only.  Units of the scene: steady_parts.h. */
#ifndef PW_PERIODIC_PARTS_H
#define PW_PERIODIC_PARTS_H

#include "continuation.h"
#include "steady_parts.h"

/* What pw_periodic_flow computes: the motion; or its derivatives only, accurate enough for Newton's method, or for
 * multipliers. */
typedef enum { PW_FLOW, PW_FLOW_DERIVATIVES, PW_FLOW_MULTIPLIERS } pw_flow_accuracy;

struct pw_periodic {
  const pw_system *s; /* as described */
  pw_periodic_settings settings;
  pw_steady *steady; /* of pw_steady_open_symmetries */
  int n, symmetries; /* number of coordinates; of symmetries */
  double L, T;       /* scales [m, s] */
  struct {
    double value;   /* of the parameter */
    pw_system *own; /* by settings.compile; NULL: s serves */
    double period;  /* verified; free: during which signals are constant [s]; 0: not yet */
  } system;
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
/* a - b for entry j of two states; of the angle of a body that no symmetry changes, without whole turns. */
double pw_periodic_difference (const pw_periodic *x, int j, double a, double b);
static inline double pw_periodic_parameter (const pw_periodic *x, const double *u) {
  return x->settings.first + u[pw_periodic_unknowns (x)] * (x->settings.last - x->settings.first);
}

/* ---- periodic.c ---- */

/* The system at a value of the parameter.  NULL, with x->why, if there is none. */
const pw_system *pw_periodic_system (pw_periodic *x, double value);
/* Opens a run, which the caller closes, at a value of the parameter from the consistent state nearest to y, or if that
 * is NULL from the initial state, and determines the period of x->system.  rtol 0: the default of pw_settings.
 * NULL, with x->why, if it fails. */
pw_run *pw_periodic_run (pw_periodic *x, double value, double rtol, const double *y);
/* Integrates one period from the state of u: sets y0, a0, and then y1, a1, or with derivatives instead of these size,
 * basis, dual, Phi.  A status; PW_RETRY: there is no such motion, perhaps with x->why, or the search was stopped. */
int pw_periodic_flow (pw_periodic *x, const double *u, pw_flow_accuracy accuracy, pw_error *error);
/* Sets x->state to the state after some periods of the motion from the initial state, displaced as by
 * pw_steady_move_to_start, and a free period that is not given to a guess.  A status; x->why contains the reason of a
 * failure. */
int pw_periodic_settle (pw_periodic *x, double value, int periods);

/* ---- periodic.c ---- */

enum { PW_PERIODIC_WORK = 34 }; /* numbers of work space of LAPACK per minimal coordinate */
/* Sets the displacement in u to the one that agrees best with a flow of one period from the state of u.  A status. */
int pw_periodic_guess_displacement (pw_periodic *x, double *u, pw_error *error);
/* pw_branch_problem.evaluate. */
int pw_periodic_evaluate (void *periodic, const double *u, double *F, double *dF, pw_error *error);
/* Fills x->re, x->im with the multipliers of u, after a flow with derivatives: those that are not trivial, the largest
 * first, then the trivial ones; x->work with the rates of the displacement in a period.  PW_OK; PW_METHOD if LAPACK
 * fails; PW_RETRY with x->why: with a free period, the motion is steady. */
int pw_periodic_multipliers (pw_periodic *x, const double *u, int *trivial);

#endif
