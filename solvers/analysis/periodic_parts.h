/* The search for relative periodic motions; for periodic*.c only. */
#ifndef PW_PERIODIC_PARTS_H
#define PW_PERIODIC_PARTS_H

#include "continuation.h"
#include "steady_parts.h"

/* A flow alone; with derivatives accurate enough for Newton's method; with accurate ones. */
typedef enum { PW_FLOW, PW_FLOW_DERIVATIVES, PW_FLOW_MULTIPLIERS } pw_flow_accuracy;

struct pw_periodic {
  const pw_system *s; /* as described */
  pw_periodic_settings set;
  pw_steady *scene; /* scales and symmetries */
  int n, group;     /* coordinates; symmetries */
  double L, T;      /* scales */
  /* Systems at two values of the parameter: of the motion, and for differences. */
  struct {
    double value;   /* of the parameter */
    pw_system *own; /* NULL: s serves */
    double period;  /* of its signals, verified; 0: not yet */
  } at[2];
  pw_branch branch;
  double *u;    /* 2 n, group, 1: state and displacement in units of the scene, period [T]; then the parameter */
  double about; /* the last free period known */
  /* Of the last flow: state at the begin and the end, with accelerations there. */
  double *y0, *y1, *a0, *a1; /* 2 n, 2 n, n, n */
  double *moved, *change;    /* 2 n: scratch */
  double *Phi, *basis;       /* 2 n x size, by columns: derivative at the end, at the begin */
  double *dual;              /* size x 2 n, by columns: minimal coordinates of changes of the state */
  long steps;                /* of the last motion at a solution or a step of Newton's method; 0: not yet known */
  int size;                  /* minimal coordinates of changes of the state */
  double *M, *re, *im;       /* size x size: derivative of the return map; its eigenvalues */
  double *work, *there;      /* scratch: rates; unknowns and residuals beside a point */
  pw_error why;              /* the last reason why a motion could not be computed */
  int unstable;              /* multipliers outside the unit circle at the last point; -1: not known */
  int sought;                /* index of the multiplier whose crossing of the unit circle is located */
  int along;                 /* 1: it moves along the circle before it leaves it */
  char *memory;
};

static inline int pw_periodic_unknowns (const pw_periodic *x) {
  return 2 * x->n + x->group + x->set.free;
}
/* The unit of entry j of a state. */
static inline double pw_periodic_unit (const pw_periodic *x, int j) {
  return j < x->n ? pw_unit (x->s, j) : pw_unit (x->s, j - x->n) / x->T;
}
/* The difference of entry j of two states; without whole turns, if it is an angle that no symmetry changes. */
double pw_periodic_difference (const pw_periodic *x, int j, double a, double b);
static inline double pw_periodic_parameter (const pw_periodic *x, const double *u) {
  return x->set.first + u[pw_periodic_unknowns (x)] * (x->set.last - x->set.first);
}

/* ---- periodic_flow.c ---- */

/* A run at a value of the parameter, from a state made consistent (NULL: the initial one); its period in x->at[which].
 * NULL and x->why. */
pw_run *pw_periodic_run (pw_periodic *x, int which, double value, double rtol, const double *y);
/* Integrates one period from the state of u.  A status; PW_RETRY with x->why. */
int pw_periodic_flow (pw_periodic *x, const double *u, pw_flow_accuracy accuracy, int which, pw_error *error);
/* The state after some periods, into x->moved, and with a free period a guess of it.  PW_RETRY with x->why. */
int pw_periodic_settle (pw_periodic *x, double value, int periods);

/* ---- periodic_equations.c ---- */

/* For pw_branch_equations. */
int pw_periodic_evaluate (void *periodic, const double *u, double *F, double *dF, pw_error *error);
/* Fills x->re, x->im with the multipliers of u after a flow with derivatives, the largest first, then with the
 * `trivial` ones.  PW_OK or PW_METHOD; PW_RETRY with x->why: with a free period, the motion is steady. */
int pw_periodic_multipliers (pw_periodic *x, const double *u, int *trivial);

#endif
