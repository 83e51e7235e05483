/* Derivatives of the equations of motion with the active rows, shared by the Newton matrices of implicit methods.
 *
 *   kinematics      q' - v + D G^T mu                                       by (q, v, mu)
 *   momentum        M a + J^T lambda - f                                    by (q, v, a, lambda)
 *   velocities      J v - eta                                               by (q, v)
 *   positions       g                                                       by q
 *   accelerations   J a - gamma + 2 alpha (J v - eta) + beta^2 g            by (q, v, a)
 *                   (nonholonomic: + alpha (J v - eta)) */
#ifndef PW_TANGENT_H
#define PW_TANGENT_H

#include "method.h"
#include "newton.h"

typedef struct {
  pw_run *run;
  int rows, holonomic; /* active equations */
  int *map;            /* all equations: index among the active ones, or -1 */
  int *row;            /* rows: index among all equations */
  double *lambda, *mu; /* all equations: values of the unknowns last expanded */
  double *D;           /* coords: 1 for lengths, 1/L^2 for angles, so that mu has one unit */
  pw_newton newton;
  pw_scatter_map scatter;
  int64_t *colptr, *rowind; /* the pattern, in compressed columns */
  char *memory;
} pw_tangent;

int pw_tangent_open (pw_tangent *x, pw_run *r); /* PW_OK or PW_RESOURCE */
void pw_tangent_close (pw_tangent *x);

/* Multipliers of all equations from those of the active ones, valid until the next call: lambda; the first `count` of
 * mu, NULL if there are none. */
const double *pw_tangent_lambda (const pw_tangent *x, const double *used);
const double *pw_tangent_mu (const pw_tangent *x, const double *used, int count);
/* The same lambda in an array of all equations. */
void pw_tangent_store (const pw_tangent *x, const double *used, double *all);
/* out (coords + 3) = J^T times the multipliers of the first `count` active equations, with the J last evaluated. */
void pw_tangent_pull (const pw_tangent *x, const double *used, int count, double *out);
/* Values of the first `count` active equations from those of all. */
void pw_tangent_compress (const pw_tangent *x, const double *all, int count, double *used);

/* Positions of the parts in the matrix. a may share its columns with v: derivatives with respect to a are multiplied by
 * `of_a`, those by q' by `of_q` in the columns of q, those by lambda and mu by `of_lambda`. */
typedef struct {
  int momentum, constraint; /* first row of each; that of the kinematics is 0 */
  int q, v, a, lambda, mu;  /* first column of each */
  double of_q, of_a, of_lambda;
} pw_tangent_layout;

/* Adds these rows at the current configuration with J evaluated; lambda and mu (NULL: there are none): all equations,
 * v and a: coords. */
void pw_tangent_momentum (pw_tangent *x, const pw_tangent_layout *to, const double *lambda);
void pw_tangent_kinematics (pw_tangent *x, const pw_tangent_layout *to, const double *mu);
void pw_tangent_accelerations (pw_tangent *x, const pw_tangent_layout *to, const double *v, const double *a);
/* Holonomic rows are multiplied by a factor: 0 leaves their rows to pw_tangent_positions, which starts at `row`. */
void pw_tangent_velocities (pw_tangent *x, const pw_tangent_layout *to, const double *v, double of_holonomic);
void pw_tangent_positions (pw_tangent *x, const pw_tangent_layout *to, int row);

#endif
