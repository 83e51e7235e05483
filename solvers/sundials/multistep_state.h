/* What the driver (multistep.c), its projection and its Newton matrix share.  For these files only. */
#ifndef PW_MULTISTEP_STATE_H
#define PW_MULTISTEP_STATE_H

#include "multistep.h"
#include "quadrature.h"
#include "sundials.h"
#include "tangent.h"

/* Newton's iteration for BDF; see multistep_newton.c. */
typedef struct {
  pw_tangent tangent; /* its matrix is T */
  double *value;      /* of T */
  double gamma;       /* of the matrix last set up */
  pw_tape tape;       /* from the entries of T, in their order, into the matrix */
  int64_t *colptr, *rowind;
  SUNMatrix matrix;
  SUNLinearSolver klu, solver; /* KLU on the matrix; what CVODES sees */
  N_Vector right, change;      /* coords and rows in use */
} pw_multistep_newton;

struct pw_method_data {
  pw_run *run;
  int n; /* coordinates */
  int projects;
  pw_projector projector;
  SUNContext context;
  void *cvode;
  N_Vector y;
  pw_quadrature quadrature;     /* of work and losses */
  SUNNonlinearSolver iteration; /* Adams; BDF where a force saturates */
  double correction;            /* its last one, of BDF */
  pw_multistep_newton newton;   /* BDF */
  double *q, *v, *a, *lambda;   /* scratch: coords + 3 each, rows */
  double *error;                /* scratch: 2 coords */
  int settled;                  /* 1: the accelerations of the state reached are its own */
  double stop;                  /* the stop time CVODES knows */
  double begun;                 /* time of the start or the last restart */
  long steps, rejected;         /* counted up to then: CVODES counts from there */
  pw_sun_said said;
};

typedef struct pw_method_data multistep_data;

/* Accelerations of an unknown y, into d->a and d->lambda: 0; above: a smaller step may do; below: a signal failed. */
int pw_multistep_accelerate (multistep_data *d, double t, const double *y);

/* Opens the Newton matrix and tells CVODES of it.  PW_OK or PW_MACHINE. */
int pw_multistep_open_newton (multistep_data *d);
void pw_multistep_close_newton (multistep_data *d);

#endif
