/* Equations of ida, and the data they share with its driver, ida.c. */
#ifndef PW_IDA_EQUATIONS_H
#define PW_IDA_EQUATIONS_H

#include "sundials.h"
#include "tangent.h"

struct pw_method_data {
  pw_sun sun;   /* first */
  void *memory; /* IDA's */
  /* how the constraints are enforced */
  int velocities; /* 1: J v = eta; 0: acceleration level */
  int positions;  /* 1: g = 0 as well, with mu */
  int impulses;   /* 1: the unknowns are the integrals of lambda and mu */
  pw_tangent tangent;
  int n, rows, mus, size; /* coordinates, independent equations, multipliers mu, unknowns */
  N_Vector yp, id;
  double *given; /* scratch: 2 (coords + 3) + 2 rows */
  double *unit;  /* rows: 1 for a force, L for a moment */
};

typedef struct pw_method_data ida_data;

/* Updates kinematics and J at the unknowns.  0, or -1 if a signal failed. */
int pw_ida_update (ida_data *d, double t, const double *y);

/* The multipliers of the independent equations, among the unknowns or among their derivatives. */
static inline const double *pw_ida_lambda (const ida_data *d, const double *y, const double *yp) {
  return (d->impulses ? yp : y) + 2 * d->n;
}

/* Called by IDA: F (t, y, y') and dF/dy + c dF/dy'. */
int pw_ida_residual (pw_real t, N_Vector y, N_Vector yp, N_Vector out, void *data);
int pw_ida_matrix (pw_real t, pw_real c, N_Vector y, N_Vector yp, N_Vector residual, SUNMatrix matrix, void *data,
                   N_Vector t1, N_Vector t2, N_Vector t3);

/* Records the pattern by filling the matrix once at y, y', and allocates it.  PW_OK or PW_RESOURCE. */
int pw_ida_open_matrix (ida_data *d);

#endif
