/* What adams, bdf and ida share: they use integrators of SUNDIALS, version 6 (tested with 6.4). */
#ifndef PW_SUNDIALS_H_
#define PW_SUNDIALS_H_
#include <sundials/sundials_types.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_linearsolver.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>
#include "tangent.h"
#include "sparse.h"

enum { PW_SUN_POINTS = 14 }; /* at most: those of a polynomial of a degree above the order 12 */

/* The rates of the ledger's entries at a time inside the last step, by the method's interpolation; changes the run's
 * sample arrays, the kinematics, J and the saddle's factors.  PW_OK, or another status if they cannot be evaluated. */
typedef int pw_rates_at (pw_run *r, double t, double *rate);

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
  double t0;                    /* of the initial state or the last restart */
  pw_statistics before;         /* counts at t0, where those of the integrator begin */
  char message[256];            /* the last message of the integrator */
  /* work and losses along the steps, from their rates at the states reached */
  pw_rates_at *rates;
  int points;                  /* states whose rates are known: at most those since the last restart */
  int order;                   /* of the last step */
  int refined;                 /* 1: the last step was integrated by nodes inside it */
  double t[PW_SUN_POINTS];     /* times of these states, newest first */
  double *rate[PW_SUN_POINTS]; /* entries: rates there */
  double *ledger0;             /* entries: at the beginning of the last step */
  double *integral;            /* entries: over the last step, or a part of it */
  double *finer, *node;        /* entries: scratch: the same with more nodes; rates at a node, or a difference */
  double energy;               /* kinetic + potential energy of the state reached [J] */
  char *memory;
} pw_sun;

/* Opens the context, the unknowns, of which q and v are those of the state reached, and the quadrature of work and
 * losses.  Returns PW_OK or PW_RESOURCE, as all functions here that open. */
int pw_sun_open (pw_sun *x, pw_run *r, int unknowns, pw_rates_at *rates);
void pw_sun_close (pw_sun *x);

/* Stores the state reached, where kinematics and r->rate must be up to date, in y, t0 and `before`, and restarts the
 * quadrature; the method then restarts its integrator. */
void pw_sun_restart (pw_sun *x);

/* Integrates the ledger over the step, of this order, to the state reached, where kinematics, J and r->rate must be up
 * to date, and stay so.  Returns as pw_update_kinematics. */
int pw_sun_integrate_ledger (pw_sun *x, int order);

/* Stores the ledger at a time inside the last step in r->ledger_at; call it before the interpolation of the sample,
 * since pw_rates_at may overwrite the other sample arrays and the kinematics. */
void pw_sun_ledger_at (pw_sun *x, double t);

/* A vector with the operations of sundials.c, as have its clones; NULL: out of memory. */
N_Vector pw_sun_vector (sunindextype length, SUNContext context);

/* Opens x->solver for the matrix of this size that a scatter map fills.  It refuses an outdated matrix (run.c)
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
