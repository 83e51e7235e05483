/* What the integrators of SUNDIALS share, and the one place that knows its version.  Built and tested with 6.4; what 7.x
 * renames is written below and marked unverified. */
#ifndef PW_SUNDIALS_H
#define PW_SUNDIALS_H

#include <stdint.h>
#include <sundials/sundials_config.h>
#include <sundials/sundials_types.h>
#include <sundials/sundials_context.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include "quadrature.h"

#if SUNDIALS_VERSION_MAJOR >= 7 /* unverified */
#define PW_SUN_NO_COMM SUN_COMM_NULL
typedef sunrealtype pw_real;
#else
#define PW_SUN_NO_COMM NULL
typedef realtype pw_real;
#endif

/* How often a step is retaken, at about a quarter of its size, because Newton's iteration does not converge or the error is too
 * large: from 1 s down to the round-off of time.  SUNDIALS' own 10 times, a millionth, do not resolve where friction brings a body to rest. */
enum { PW_SUN_ATTEMPTS = 27 };

typedef struct {
  pw_run *run;
  SUNContext context;
  N_Vector y;                   /* unknowns: q, v, what else there is */
  SUNMatrix matrix;             /* of Newton's iteration */
  SUNLinearSolver klu, solver;  /* KLU on the matrix; what the integrator sees */
  SUNNonlinearSolver iteration; /* NULL: the integrator's own */
  double correction;            /* of a Newton iteration: the last one */
  pw_quadrature quadrature;     /* of work and losses */
  double stop;                  /* the stop time the integrator knows */
  double t0;                    /* of the initial conditions or the last restart */
  pw_statistics before;         /* what was counted until then: the integrator counts from there */
  char message[256];            /* its last one, instead of its printing */
} pw_sun;

/* Context and unknowns, filled with the state reached.  PW_OK or PW_RESOURCE, as all that open something. */
int pw_sun_open (pw_sun *x, pw_run *r, int unknowns);
void pw_sun_close (pw_sun *x);

/* Begins at the state reached. */
void pw_sun_restart (pw_sun *x);

/* A vector whose operations, and those of its clones, are ours (vectors.c); NULL: out of memory. */
N_Vector pw_sun_vector (sunindextype length, SUNContext context);

/* The matrix of this pattern, in compressed columns, and a linear solver that refuses to use an outdated matrix, so that the
 * integrator asks for a new one; `solve` (NULL: KLU's) is what it does otherwise, with `content`. */
typedef int pw_sun_solve (SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, pw_real tolerance);
int pw_sun_open_matrix (pw_sun *x, int size, const int64_t *colptr, const int64_t *rowind);
int pw_sun_open_solver (pw_sun *x, N_Vector right, void *content, pw_sun_solve *solve);

/* All values 0, and the pattern anew: SUNDIALS clears it together with the values. */
void pw_sun_clear (SUNMatrix matrix, const int64_t *colptr, const int64_t *rowind);

/* Makes the corrections of a Newton iteration count as they are: SUNDIALS' own test multiplies the first one by the rate at
 * which steps before have converged, which says nothing where a force saturates in between.  To be called when the integrator
 * has the solver; `size` is scratch that lives as long.  Returns as SUNDIALS. */
int pw_sun_test_newton (SUNNonlinearSolver newton, double *size);

/* Error weights of q and v, from their tolerances. */
void pw_sun_weigh (const pw_sun *x, const double *y, double *w);

/* Collects the messages of an integrator: `x` is a pw_sun. */
void pw_sun_message (int code, const char *module, const char *function, char *text, void *x);

/* Errors: why the integrator fails with this flag, and why it cannot begin anew.  singular: the configuration is the reason;
 * why: what flags of its own mean, or NULL. */
int pw_sun_fail (pw_sun *x, int flag, int singular, const char *why, pw_error *error);
int pw_sun_fail_restart (pw_sun *x, int flag, pw_error *error);
int pw_sun_no_memory (const pw_run *r, pw_error *error);
int pw_sun_fail_signal (double t, pw_error *error);

#endif
