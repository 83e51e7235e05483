/* What adams, bdf and ida share, the methods that use integrators of SUNDIALS: version 6 (tested with 6.4). */
#ifndef PW_SUNDIALS_H
#define PW_SUNDIALS_H

#include <stdint.h>
#include <sundials/sundials_types.h>
#include <sundials/sundials_context.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include "quadrature.h"

/* Attempts at a step, each about a quarter of the previous one, if Newton's iteration does not converge or the error is
 * too large: from 1 s down to the round-off of the time.  SUNDIALS' default of 10, a millionth of the step, does not
 * resolve the moment at which friction stops a body. */
enum { PW_SUN_ATTEMPTS = 27 };

typedef struct {
  pw_run *run;
  SUNContext context;
  N_Vector y;                   /* unknowns: q, v, then those of the method */
  SUNMatrix matrix;             /* of Newton's iteration */
  SUNLinearSolver klu, solver;  /* KLU; the solver that the integrator calls, which calls KLU */
  SUNNonlinearSolver iteration; /* NULL: the default of the integrator */
  double correction;            /* size of the last Newton correction */
  pw_quadrature quadrature;     /* of work and losses */
  double t0;                    /* of the initial state or the last restart */
  pw_statistics before;         /* counts at t0, where those of the integrator begin */
  char message[256];            /* the last message of the integrator */
} pw_sun;

/* Opens the context and the unknowns, of which q and v are those of the state reached.  Returns PW_OK or PW_RESOURCE,
 * as all functions here that open. */
int pw_sun_open (pw_sun *x, pw_run *r, int unknowns);
void pw_sun_close (pw_sun *x);

/* Restarts at the state reached. */
void pw_sun_restart (pw_sun *x);

/* A vector with the operations of vectors.c, as have its clones; NULL: out of memory. */
N_Vector pw_sun_vector (sunindextype length, SUNContext context);

/* A matrix of this pattern, in compressed columns, and a linear solver, which refuses an outdated matrix (tolerances.c)
 * so that the integrator requests a new one.  `solve` (NULL: that of KLU) finds the data `content` in its solver;
 * `content` begins with x; `right` is a vector of the size of the matrix. */
typedef int pw_sun_solve (SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, realtype tolerance);
int pw_sun_open_matrix (pw_sun *x, int size, const int64_t *colptr, const int64_t *rowind);
int pw_sun_open_solver (pw_sun *x, N_Vector right, void *content, pw_sun_solve *solve);

/* Sets all values to 0 and restores the pattern, which SUNDIALS clears together with the values. */
void pw_sun_clear (SUNMatrix matrix, const int64_t *colptr, const int64_t *rowind);

/* Replaces SUNDIALS' convergence test, which multiplies the first correction by the convergence rate of previous steps;
 * that is meaningless if a force saturates in between.  Call it after the solver is attached to the integrator; `size`
 * is scratch with the lifetime of the solver.  Returns as SUNDIALS. */
int pw_sun_test_newton (SUNNonlinearSolver newton, double *size);

/* Error weights of q and v, from their tolerances. */
void pw_sun_weigh (const pw_sun *x, const double *y, double *w);

/* Called by an integrator: stores its message in `sun`, a pw_sun. */
void pw_sun_message (int code, const char *module, const char *function, char *text, void *sun);

/* Report why the integrator failed with this flag, or cannot restart.  singular: 1 if the configuration is singular;
 * why: the meaning of a flag specific to the integrator, or NULL. */
int pw_sun_fail (pw_sun *x, int flag, int singular, const char *why, pw_error *error);
int pw_sun_fail_restart (pw_sun *x, int flag, pw_error *error);
int pw_sun_no_memory (const pw_run *r, pw_error *error);

#endif
