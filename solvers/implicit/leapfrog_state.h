/* What a step of leapfrog (leapfrog.c) and the equations of its first half (leapfrog_drift.c) share.  For these only. */
#ifndef PW_LEAPFROG_STATE_H
#define PW_LEAPFROG_STATE_H

#include "implicit.h"
#include "method.h"

struct pw_method_data {
  double base;             /* time from which steps are counted */
  long count;              /* steps since then */
  double *u, *q1, *v1;     /* rates at half the step, and the successor; coords + 3, as the next line */
  double *middle, *dv, *f; /* mean of positions, a correction of rates, forces */
  double *off, *mu, *eta;  /* all rows: what is left of them, multipliers of a correction, right-hand side */
  double *z;               /* coords and rows in use: a correction of u and its multipliers */
  pw_implicit work;
};

typedef struct pw_method_data leapfrog;

/* How an iteration fares, from the sizes of its corrections. */
typedef struct {
  double size;   /* of the last one, the largest of its coordinates, each over what it was before */
  double large;  /* the largest coordinate, in units of the scene: round-off of one may show in another */
  double before; /* size of the one before */
  double rate;   /* of the last to the one before */
  int done;      /* corrections before the last one */
} leapfrog_progress;

/* Takes the correction of one coordinate into the sizes, which are 0 and 1 at first; its value does not iterate, so that
 * divergence shows. */
static inline void leapfrog_measure (leapfrog_progress *p, double correction, double value, double unit) {
  double size = fabs (correction) / (fabs (value) + unit);
  if (!(size <= p->size)) p->size = size;
  p->large = fmax (p->large, fabs (value) / unit);
}

/* 1: round-off is reached, or would be with the next one; 0: go on; -1: it does not converge. */
int pw_leapfrog_judge (leapfrog_progress *p);

/* Plans Newton's matrix.  PW_OK or PW_MACHINE. */
int pw_leapfrog_open_matrix (pw_run *r);

/* The first half of a step from t to t1 = t + h: u and q'.  PW_RETRY if Newton's iteration does not converge or its matrix
 * is singular; PW_METHOD if a signal failed. */
int pw_leapfrog_drift (pw_run *r, double h, double t1);

#endif
