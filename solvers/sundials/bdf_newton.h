/* The data of adams and bdf (multistep.c), and Newton's iteration of bdf (bdf_newton.c). */
#ifndef PW_BDF_NEWTON_H
#define PW_BDF_NEWTON_H

#include "sundials.h"
#include "tangent.h"

/* Named as at the top of bdf_newton.c. */
typedef struct {
  pw_tangent tangent;     /* the matrix in tangent.scatter is T */
  double gamma;           /* that of the matrix last set up */
  pw_scatter_map scatter; /* from the entries of T, in order, to the matrix */
  double *right;          /* coords and rows: right-hand side, then da, dlambda */
} pw_bdf_newton;

struct pw_method_data {
  pw_sun sun; /* first */
  void *cvode;
  int n;        /* coordinates */
  int projects; /* 1: coordinate projection, by `projector` */
  pw_projector projector;
  pw_bdf_newton newton; /* only of bdf */
  double *q, *v;        /* coords + 3: scratch */
  double *a, *lambda;   /* coords + 3, rows: of the last evaluation */
  double *error;        /* 2 coords: scratch */
  int evaluated;        /* 1: r->a, r->lambda are those of the state reached, not of the last iterate */
  char *memory;
};

/* Stores accelerations and multipliers at y in d->a and d->lambda.  Returns what CVODES expects: 0; > 0: a smaller step
 * may succeed; < 0: a signal failed. */
int pw_multistep_accelerate (pw_method_data *d, double t, const double *y);

/* Opens the Newton matrix and attaches it to CVODES.  PW_OK or PW_RESOURCE. */
int pw_bdf_open_newton (pw_method_data *d);
void pw_bdf_close_newton (pw_method_data *d);

#endif
