/* Private to galpha: the step (galpha.c) and its equations (galpha_newton.c). */
#ifndef PW_GALPHA_STATE_H
#define PW_GALPHA_STATE_H

#include "implicit.h"
#include "method.h"

struct pw_method_data {
  pw_implicit work;             /* first */
  int ggl;                      /* stabilised index 2, else index 3 */
  int n, rows, positions, size; /* coordinates, independent equations, those with mu, unknowns */
  double alpha_m, alpha_f, beta, gamma;
  double *v, *a, *w;               /* velocities, accelerations and w at the beginning of the next step */
  double *a1, *w1, *lambda1, *mu1; /* the new state; lambda, mu: independent equations */
  double *z, *row, *column;        /* size: residual, then correction; scales of the matrix */
  double *pull, *f, *jv, *eta;     /* scratch: coords + 3, coords + 3, all rows, all rows */
};

typedef struct pw_method_data galpha;

/* Records the pattern and makes room for the matrix.  PW_OK or PW_RESOURCE. */
int pw_galpha_open_matrix (pw_run *r);

/* Computes the new state at t1 = t + h with its accelerations and multipliers; kinematics and J are left there.
 * PW_RETRY if Newton's iteration does not converge, PW_INPUT if its matrix is singular, PW_METHOD if a signal
 * failed. */
int pw_galpha_solve (pw_run *r, double h, double t1);

#endif
