/* What the equations shown to IDA (ida_equations.c) and the run of the method (ida.c) share.  For these files only. */
#ifndef PW_IDA_STATE_H
#define PW_IDA_STATE_H

#include "quadrature.h"
#include "sundials.h"
#include "tangent.h"

/* How a form encloses the constraints. */
typedef struct {
  int rates;     /* 1: J v = eta; 0: on the level of accelerations */
  int positions; /* 1: g = 0 as well, with mu */
  int impulses;  /* 1: the unknowns are the integrals of lambda and mu */
} pw_ida_form;

struct pw_method_data {
  pw_run *run;
  pw_ida_form form;
  pw_tangent tangent;
  int n, rows, positions, size; /* coordinates, rows in use, of these those with mu, unknowns */
  SUNContext context;
  void *ida;
  N_Vector y, yp, id;
  pw_quadrature quadrature; /* of work and losses */
  SUNMatrix matrix;
  SUNLinearSolver klu, solver; /* KLU on the matrix; what IDA sees */
  SUNNonlinearSolver newton;   /* where a force saturates */
  double correction;           /* its last one */
  double *scale;               /* D: coords */
  double *given;               /* scratch: 2 (coords + 3) + 2 rows */
  double *lever;               /* rows: 1 for a force, L for a moment */
  double stop;                 /* the stop time IDA knows */
  double begun;                /* time of the start or the last restart */
  pw_statistics before;        /* what was counted up to then: IDA counts from there */
  pw_sun_said said;
};

typedef struct pw_method_data ida_data;

/* The form of the run's stabilisation. */
pw_ida_form pw_ida_choose_form (const pw_run *r);

/* Places the system at the unknowns and sweeps J.  0, or -1 if a signal failed. */
int pw_ida_place (ida_data *d, double t, const double *y);

/* Where the multipliers of the rows in use are: among the unknowns, or among their rates. */
static inline const double *pw_ida_lambda (const ida_data *d, const double *y, const double *yp) {
  return (d->form.impulses ? yp : y) + 2 * d->n;
}

/* What IDA calls: F (t, y, y') and dF/dy + c dF/dy'. */
int pw_ida_residual (pw_real t, N_Vector y, N_Vector yp, N_Vector out, void *data);
int pw_ida_matrix (pw_real t, pw_real c, N_Vector y, N_Vector yp, N_Vector residual, SUNMatrix matrix, void *data,
                   N_Vector t1, N_Vector t2, N_Vector t3);

/* Lays out the pattern by recording one filling at y, y', and makes the matrix.  PW_OK or PW_MACHINE. */
int pw_ida_open_matrix (ida_data *d);

#endif
