/* Private to radau: the method (radau.c), the stages of a step (radau_stages.c). */
#ifndef PW_RADAU_STATE_H
#define PW_RADAU_STATE_H

#include "implicit.h"
#include "radau_coefficients.h"

/* A step from y at t; of the last one, the polynomial through its stages. */
typedef struct {
  double t, h;                         /* h = 0: there is none */
  double *y, *Z[PW_RADAU_STAGES];      /* unknowns */
  double *ledger, *w[PW_RADAU_STAGES]; /* entries: at t; their changes up to the stages */
  double *a;                           /* coords: accelerations at t */
} radau_step;

struct pw_method_data {
  pw_dae dae;
  pw_sparse real, complex;
  double *matrix;                                          /* -F_y */
  double *value;                                           /* of the real matrix; of the complex one, in pairs */
  int64_t *diagonal;                                       /* 2 n: where B is added */
  double *B;                                               /* 2 n: diagonal of B */
  double *unit;                                            /* 2 n: units of the states */
  double *tolerance, *enough, *floor;                      /* 2 n: of the error test, of corrections; round-off */
  double *row, *column;                                    /* scales of the matrices */
  double *W[PW_RADAU_STAGES], *F[PW_RADAU_STAGES], *x, *Y; /* unknowns; x: twice */
  double *rates;                                           /* entries */
  radau_step now, last;
  double *a1;                /* coords: accelerations at the end of the last step */
  pw_step_counter counter;   /* of fixed steps */
  double h;                  /* the next step */
  double last_h, last_error; /* size and error of the last one, 0: none */
  double factored;           /* step for which the matrices are factorised; 0: none */
  int forget;                /* 1: select pivots anew */
  int current, outdated;     /* F_y was evaluated at y; it must be evaluated again */
  double rate, left;         /* of the last iteration: contraction rate, remaining error over the last correction */
  double shorter;            /* factor of the step if the iteration does not converge */
  int iterations;
  int near; /* 1: the state reached is near a singular configuration */
  pw_projector projector;
  char *memory;
};

typedef struct pw_method_data radau;

/* Records the pattern of F_y at the initial conditions and opens both matrices.  PW_OK or PW_RESOURCE. */
int pw_radau_open_matrices (pw_run *r);

/* The relative tolerance of the error estimate, whose order is 3. */
double pw_radau_rtol (const pw_run *r);

/* Solves for the stages of the step to t1 = t + h.  PW_RETRY if Newton's iteration does not converge, PW_INPUT if its
 * matrix is singular, PW_METHOD if a signal failed, PW_RESOURCE. */
int pw_radau_solve (pw_run *r, double h, double t1);

/* y + the weighted sum of the values of entry i at the stages. */
static inline double pw_radau_sum (double y, const double *weight, double *const *Z, int i) {
  return y + weight[0] * Z[0][i] + weight[1] * Z[1][i] + weight[2] * Z[2][i];
}

/* Stores the unknowns at stage k in d->Y. */
void pw_radau_stage (const radau *d, int k);

/* Weights of the values at the nodes c_i in the polynomial that is 0 at 0, at x. */
void pw_radau_basis (double x, double *weight);

/* The error of the states in units of their tolerances.  again: filtered twice if it is too large, as is needed in
 * initial transients.  PW_OK or PW_RESOURCE. */
int pw_radau_estimate (pw_run *r, double h, int again, double *error);

/* Work and losses up to the stages; *error grows to theirs, in units of their tolerance.  Returns as
 * pw_update_kinematics. */
int pw_radau_work (pw_run *r, double h, double t1, double *error);

#endif
