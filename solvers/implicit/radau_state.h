/* Private to radau: the data that the method (radau.c) and the stages of a step (radau_stages.c) share. */
#ifndef PW_RADAU_STATE_H
#define PW_RADAU_STATE_H

#include "implicit.h"

/* Coefficients of the Radau IIA method of order 5 (Hairer & Wanner 1996, section IV.8); A and gamma were computed with
 * 60 digits from the nodes c. */
enum { PW_RADAU_STAGES = 3 };

static const double radau_c[PW_RADAU_STAGES] = { 0.15505102572168219018, 0.64494897427831780982, 1 };
static const double radau_A[PW_RADAU_STAGES][PW_RADAU_STAGES] = {
  { 0.19681547722366042587, -0.06553542585019838811, 0.02377097434822015242 },
  { 0.39442431473908727700, 0.29207341166522846302, -0.04154875212599793020 },
  { 0.37640306270046727505, 0.51248582618842161384, 0.11111111111111111111 },
};
/* The real eigenvalue of A^-1, and the weights of the stages in the error estimate. */
static const double radau_gamma = 3.63783425274449573221;
static const double radau_e[PW_RADAU_STAGES] = { -10.04880939982741556, 1.38214273316074889, -1. / 3 };

enum { PW_RADAU_MOST = 7 }; /* Newton corrections after the first in an adaptive step; RADAU5 makes 6 */

/* A step of size h from t; h = 0: there is none. */
typedef struct {
  double t, h;
  double *y, *Z[PW_RADAU_STAGES];                  /* unknowns: at t; their changes up to the stages */
  double *ledger, *ledger_change[PW_RADAU_STAGES]; /* entries: the same of work and losses */
  double *a;                                       /* coords: accelerations at t */
} radau_step;

struct pw_method_data {
  pw_dae dae;                         /* the matrix in dae.tangent.scatter is -F_y */
  pw_sparse real, complex;            /* factors of gamma/h B - F_y and (alpha + i beta)/h B - F_y */
  double *value;                      /* of the real matrix; of the complex one, in pairs */
  double *row_factor, *column_factor; /* unknowns: by which rows and columns of both are multiplied */
  int64_t *diagonal;                  /* 2 coords: index in -F_y of the diagonal entry, to which B is added */
  double *B;                          /* 2 coords: diagonal of B */
  double factored_h;                  /* step size for which both are factorised; 0: none */
  int choose_pivots;                  /* 1: select pivots anew */
  int F_y_at_state;                   /* 1: F_y has been evaluated at the state reached */
  int renew_F_y;                      /* 1: F_y must be evaluated before the next iteration */
  double *W[PW_RADAU_STAGES], *F[PW_RADAU_STAGES]; /* unknowns: T^-1 Z; F at the stages, then corrections of W */
  double *Y;                                       /* unknowns: at a stage */
  double *complex_x;                               /* unknowns: scratch, complex numbers as pairs */
  double *rate;                                    /* entries: scratch */
  double *unit;                                    /* 2 coords: units of the states */
  double *tolerance, *newton_tolerance;            /* 2 coords: of the error test; of corrections */
  double *round_off;                               /* 2 coords: of the states */
  double contraction;                              /* mean ratio of successive corrections, when last known */
  double remaining;                                /* remaining error over the last correction */
  int iterations;                                  /* of the last step */
  double reduction;                                /* factor of the step size if the iteration does not converge */
  radau_step now, last;                            /* the step being made; the last one */
  double *a_end;                                   /* coords: accelerations at the end of the last step */
  int near_singular;                               /* 1: the state reached is near a singular configuration */
  double noise;                      /* at the state reached: of corrections that do not shrink, in round_off */
  pw_step_counter counter;           /* of fixed steps */
  double h;                          /* adaptive: size of the next step */
  double previous_h, previous_error; /* adaptive: size and error of the last step; 0: there is none */
  pw_projector projector;
  char *memory;
};

/* Determines the pattern of F_y and opens both matrices.  PW_OK or PW_RESOURCE. */
int pw_radau_open_matrices (pw_run *r);

/* The relative tolerance of the error estimate, 0.05 rtol^(2/3); see radau.c. */
double pw_radau_rtol (const pw_run *r);

/* Solves for the stages of the step to t1 = t + h.  PW_RETRY if Newton's iteration does not converge, PW_SINGULAR if
 * its matrix is, PW_METHOD if a signal failed, PW_RESOURCE. */
int pw_radau_solve (pw_run *r, double h, double t1);

/* y + the weighted sum of entry i of Z at the stages. */
static inline double pw_radau_sum (double y, const double *weight, double *const *Z, int i) {
  return y + weight[0] * Z[0][i] + weight[1] * Z[1][i] + weight[2] * Z[2][i];
}

/* Stores the unknowns at stage k in d->Y. */
void pw_radau_stage (const pw_method_data *d, int k);

/* Weights of the values at the nodes c_i in the value at x of the polynomial through them that is 0 at 0. */
void pw_radau_basis (double x, double *weight);

/* The error of the states in units of their tolerances.  filter_twice: 1 to filter an error that is too large a second
 * time, as is needed in initial transients (Hairer & Wanner 1996, section IV.8).  PW_OK or PW_RESOURCE. */
int pw_radau_estimate (pw_run *r, double h, int filter_twice, double *error);

/* Work and losses up to the stages; *error becomes their error, in units of their tolerance, if that is larger.
 * Returns as pw_update_kinematics. */
int pw_radau_work (pw_run *r, double h, double t1, double *error);

#endif
