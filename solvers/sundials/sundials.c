/* What adams, bdf and ida share: unknowns, linear solver, test of convergence, messages of SUNDIALS; see sundials.h. */
#include <assert.h>
#include <cvodes/cvodes.h>
#include <idas/idas.h>
#include <lapacke.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sundials/sundials_version.h>
#include "sundials.h"
#include "util.h"

static_assert (sizeof (sunindextype) == sizeof (int64_t), "SUNDIALS with 64-bit indices is expected");
static_assert (CV_ERR_FAILURE == IDA_ERR_FAIL && CV_CONV_FAILURE == IDA_CONV_FAIL && CV_RHSFUNC_FAIL == IDA_RES_FAIL &&
                   CV_LSETUP_FAIL == IDA_LSETUP_FAIL && CV_TOO_MUCH_ACC == IDA_TOO_MUCH_ACC,
               "CVODES and IDAS have the same flags");

/* SUNDIALS 6.4 dereferences vectors and loggers whose allocation failed, so it is tested first whether there is enough
 * memory: for at most 60 vectors (13 of a Nordsieck array of order 12, a dozen more, as many for quadratures, and those
 * of a restart), each with a table of operations, and for the rest. */
int pw_sun_open (pw_sun *x, pw_run *r, int unknowns) {
  enum { VECTORS = 60, TABLE = 1024, REST = 1 << 17 };
  x->run = r;
  if (pw_check_memory (VECTORS * (TABLE + (size_t)unknowns * sizeof (double)) + REST) != PW_OK ||
      SUNContext_Create (NULL, &x->context) != 0)
    return PW_RESOURCE;
  x->y = pw_sun_vector (unknowns, x->context);
  if (x->y) pw_sun_restart (x);
  return x->y ? PW_OK : PW_RESOURCE;
}

void pw_sun_close (pw_sun *x) {
  if (x->solver) SUNLinSolFreeEmpty (x->solver);
  if (x->iteration) SUNNonlinSolFree (x->iteration);
  if (x->matrix) SUNMatFreeEmpty (x->matrix);
  pw_sparse_close (&x->sparse);
  if (x->y) N_VDestroy (x->y);
  if (x->context) SUNContext_Free (&x->context);
  pw_quadrature_close (&x->quadrature);
}

void pw_sun_restart (pw_sun *x) {
  const pw_run *r = x->run;
  double *y = N_VGetArrayPointer (x->y);
  memcpy (y, r->q, (size_t)r->s->coords * sizeof *y);
  memcpy (y + r->s->coords, r->v, (size_t)r->s->coords * sizeof *y);
  x->t0 = r->t;
  x->before = r->statistics;
}

/* ---- Linear solver ---- */

static SUNLinearSolver_Type sun_solver_type (SUNLinearSolver solver) {
  (void)solver;
  return SUNLINEARSOLVER_DIRECT;
}

static int sun_clear (SUNMatrix matrix) {
  (void)matrix; /* the method clears the values */
  return 0;
}

/* The content of each solver begins with its pw_sun.  Called at the start and at each restart. */
static int sun_initialise (SUNLinearSolver solver) {
  pw_sparse_forget_pivots (&((pw_sun *)solver->content)->sparse);
  return SUNLS_SUCCESS;
}

static int sun_factorise (SUNLinearSolver solver, SUNMatrix matrix) {
  pw_sun *x = solver->content;
  (void)matrix;
  x->factorised = pw_sparse_factor (&x->sparse, x->value);
  return x->factorised == PW_OK ? SUNLS_SUCCESS : x->factorised < 0 ? SUNLS_PACKAGE_FAIL_UNREC : SUNLS_PACKAGE_FAIL_REC;
}

static int sun_solve (SUNLinearSolver solver, SUNMatrix matrix, N_Vector result, N_Vector b, realtype tolerance) {
  pw_sun *x = solver->content;
  (void)matrix, (void)tolerance;
  if (x->run->matrix_outdated) return SUNLS_PACKAGE_FAIL_REC;
  N_VScale (1, b, result);
  return pw_sparse_solve (&x->sparse, N_VGetArrayPointer (result)) == PW_OK ? SUNLS_SUCCESS : SUNLS_PACKAGE_FAIL_UNREC;
}

int pw_sun_open_solver (pw_sun *x, int size, pw_scatter_map *map, void *content, pw_sun_solve *solve) {
  x->value = map->value;
  x->matrix = SUNMatNewEmpty (x->context);
  x->solver = SUNLinSolNewEmpty (x->context);
  if (x->matrix == NULL || x->solver == NULL) return PW_RESOURCE;
  x->matrix->ops->zero = sun_clear;
  x->solver->content = content;
  x->solver->ops->gettype = sun_solver_type;
  x->solver->ops->initialize = sun_initialise;
  x->solver->ops->setup = sun_factorise;
  x->solver->ops->solve = solve ? solve : sun_solve;
  return pw_sparse_open (&x->sparse, PW_SPARSE_REAL, size, map->colptr, map->rowind);
}

/* ---- Newton's iteration, error weights ---- */

/* Called by SUNDIALS: tests the size of the correction, or of the error that remains after it at the current rate of
 * convergence, whichever is smaller; data: size of the previous correction. */
static int sun_test_convergence (SUNNonlinearSolver newton, N_Vector y, N_Vector correction, realtype tolerance,
                                 N_Vector weights, void *data) {
  double *previous = data, size = N_VWrmsNorm (correction, weights), rate = size / *previous;
  int iteration = 0;
  (void)y;
  SUNNonlinSolGetCurIter (newton, &iteration);
  *previous = size;
  if (iteration > 0 && !(rate < 0.9)) /* too slow */
    return size <= tolerance ? SUN_NLS_SUCCESS : SUN_NLS_CONV_RECVR;
  double remaining = iteration == 0 ? 1 : rate / (1 - rate); /* error, over the size of this correction */
  return size * fmin (1, remaining) <= tolerance ? SUN_NLS_SUCCESS : SUN_NLS_CONTINUE;
}

int pw_sun_test_newton (pw_sun *x) {
  return SUNNonlinSolSetConvTestFn (x->iteration, sun_test_convergence, &x->correction) ? PW_RESOURCE : PW_OK;
}

void pw_sun_weigh (const pw_sun *x, const double *y, double *w) {
  for (int j = 0, n = x->run->s->coords; j < n; j++) {
    w[j] = 1 / pw_tolerance (x->run, j, y[j]);
    w[n + j] = 1 / pw_tolerance (x->run, n + j, y[n + j]);
  }
}

/* ---- Errors ---- */

void pw_sun_message (int code, const char *module, const char *function, char *text, void *sun) {
  pw_sun *x = sun;
  (void)code, (void)module, (void)function;
  snprintf (x->message, sizeof x->message, "%s", text);
}

/* The integrator's message, or the flag if there was none. */
static const char *sun_reason (pw_sun *x, int flag) {
  if (*x->message == 0) snprintf (x->message, sizeof x->message, "SUNDIALS fails with the flag %d", flag);
  return x->message;
}

int pw_sun_no_memory (const pw_run *r, pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "model %s: out of memory in %s", r->s->model, r->method->name);
}

int pw_sun_fail_restart (pw_sun *x, int flag, pw_error *error) {
  return pw_fail (error, PW_METHOD, "t = %.6g s: restart: %s", x->run->t, sun_reason (x, flag));
}

int pw_sun_fail (pw_sun *x, int flag, int singular, const char *why, pw_error *error) {
  pw_run *r = x->run;
  if (r->stopped) return r->interrupted = 1, PW_STOPPED;
  if (flag == CV_LSETUP_FAIL && x->factorised == PW_RESOURCE) return pw_sun_no_memory (r, error);
  if (flag == CV_RHSFUNC_FAIL || flag == CV_LSETUP_FAIL) return pw_fail_signal (r->t, error);
  if (singular || pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  if (why == NULL)
    why = flag == CV_ERR_FAILURE         ? "the error test fails however small the step"
          : flag == CV_TOO_MUCH_ACC      ? "the tolerance is beyond the accuracy of the machine"
          : flag != CV_CONV_FAILURE      ? sun_reason (x, flag)
          : x->factorised == PW_SINGULAR ? "the Newton matrix is singular however small the step"
                                         : "the iteration does not converge however small the step";
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s (rtol %.3g)", r->t, why, r->settings.rtol);
}

char *pw_library_versions (char *buffer, size_t size) {
  char sundials[30];
  lapack_int v[3];
  SUNDIALSGetVersion (sundials, sizeof sundials);
  LAPACKE_ilaver (v, v + 1, v + 2);
  snprintf (buffer, size, "SUNDIALS %s, KLU %d.%d.%d, LAPACK %d.%d.%d", sundials, KLU_MAIN_VERSION, KLU_SUB_VERSION,
            KLU_SUBSUB_VERSION, (int)v[0], (int)v[1], (int)v[2]);
  return buffer;
}
