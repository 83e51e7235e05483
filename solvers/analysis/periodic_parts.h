/* The search for relative periodic motions; for periodic.c and its tests.  Units of the scene: steady_parts.h. */
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
  pw_parametric parametric;
  double period; /* of the parametric system, verified; free: during which signals are constant [s]; 0: not yet */
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
