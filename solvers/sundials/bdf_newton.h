/* Newton matrix of BDF, and the data it shares with the driver of CVODES, multistep.c. */
#ifndef PW_BDF_NEWTON_H
#define PW_BDF_NEWTON_H

#include "sundials.h"
#include "tangent.h"

/* Newton's iteration; see bdf_newton.c. */
typedef struct {
  pw_tangent tangent;     /* its matrix is T */
  double *value;          /* of T */
  double gamma;           /* of the matrix last set up */
  pw_scatter_map scatter; /* from the entries of T, in order, to the matrix */
  int64_t *colptr, *rowind;
  N_Vector right, change; /* coords and independent equations */
} pw_bdf_newton;

struct pw_method_data {
  pw_sun sun; /* first */
  void *cvode;
  int n; /* coordinates */
  int projects;
  pw_projector projector;
  pw_bdf_newton newton;       /* BDF */
  double *q, *v, *a, *lambda; /* scratch: coords + 3 each, rows */
  double *error;              /* scratch: 2 coords */
  int evaluated;              /* 1: the accelerations of the current state have been evaluated */
  char *memory;
};

typedef struct pw_method_data multistep_data;

/* Accelerations and multipliers at y, into d->a and d->lambda.  0; > 0: a smaller step may succeed; < 0: a signal
 * failed. */
int pw_multistep_accelerate (multistep_data *d, double t, const double *y);

/* Opens the Newton matrix and attaches it to CVODES.  PW_OK or PW_RESOURCE. */
int pw_bdf_open_newton (multistep_data *d);
void pw_bdf_close_newton (multistep_data *d);

#endif
