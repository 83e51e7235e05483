/* What adams, bdf and ida share: they use integrators of SUNDIALS, version 6 (tested with 6.4). */
#ifndef PW_SUNDIALS_H
#define PW_SUNDIALS_H

#include <stdint.h>
#include <sundials/sundials_types.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_linearsolver.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include "quadrature.h"
#include "scatter.h"
#include "sparse.h"

/* Attempts at a step, each about a quarter of the one before, if the iteration does not converge or the error is too
 * large: from 1 s down to the round-off of the time.  SUNDIALS' defaults of 7 and 10, down to a millionth of the
 * step, do not resolve the moment at which friction stops a body. */
enum { PW_SUN_ATTEMPTS = 27 };

typedef struct {
  pw_run *run;
  SUNContext context;
  N_Vector y;       /* unknowns: q, v, then those of the method */
  pw_sparse sparse; /* factors of the matrix of Newton's iteration; not in adams, as the next four */
  double *value;    /* of the matrix */
  int factorised;   /* status of the last factorisation */
  SUNMatrix matrix; /* empty: the integrators require one */
  SUNLinearSolver solver;
  SUNNonlinearSolver iteration; /* NULL: the default of the integrator */
  double correction;            /* size of the last Newton correction, for pw_sun_test_newton */
  pw_quadrature quadrature;     /* of work and losses */
  double t0;                    /* of the initial state or the last restart */
  pw_statistics before;         /* counts at t0, where those of the integrator begin */
  char message[256];            /* the last message of the integrator */
} pw_sun;

/* Opens the context and the unknowns, of which q and v are those of the state reached.  Returns PW_OK or PW_RESOURCE,
 * as all functions here that open. */
int pw_sun_open (pw_sun *x, pw_run *r, int unknowns);
void pw_sun_close (pw_sun *x);

/* Stores the state reached in y, t0 and `before`; the method then restarts its integrator. */
void pw_sun_restart (pw_sun *x);

/* A vector with the operations of vectors.c, as have its clones; NULL: out of memory. */
N_Vector pw_sun_vector (sunindextype length, SUNContext context);

/* Opens x->solver for the matrix of this size that a scatter map fills.  It refuses an outdated matrix (tolerances.c)
 * so that the integrator requests a new one.  content: the method's data, beginning with x, which `solve` finds in its
 * solver; solve: NULL for that of the matrix; any other must itself refuse an outdated matrix. */
typedef int pw_sun_solve (SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, realtype tolerance);
int pw_sun_open_solver (pw_sun *x, int size, pw_scatter_map *map, void *content, pw_sun_solve *solve);

/* Replaces the convergence test of x->iteration, a Newton iteration that the integrator uses already.  The test of
 * SUNDIALS multiplies the first correction by the convergence rate of previous steps, which is meaningless if a force
 * saturates in between.  PW_OK or PW_RESOURCE. */
int pw_sun_test_newton (pw_sun *x);

/* Error weights w of the states q and v in y: one over their tolerances. */
void pw_sun_weigh (const pw_sun *x, const double *y, double *w);

/* Called by an integrator: stores its message in `sun`, a pw_sun. */
void pw_sun_message (int code, const char *module, const char *function, char *text, void *sun);

/* Report why the integrator failed with this flag, or cannot restart, or that memory is exhausted.  singular: 1 if the
 * configuration is singular; why: the meaning of a flag specific to the integrator, or NULL.  If the caller has
 * requested a stop: PW_STOPPED, without a report. */
int pw_sun_fail (pw_sun *x, int flag, int singular, const char *why, pw_error *error);
int pw_sun_fail_restart (pw_sun *x, int flag, pw_error *error);
int pw_sun_no_memory (const pw_run *r, pw_error *error);

#endif
