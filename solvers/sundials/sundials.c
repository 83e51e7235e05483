/* What adams, bdf and ida share: unknowns, linear solver, test of convergence, messages of SUNDIALS; see sundials.h. */
#include <assert.h>
#include <cvodes/cvodes.h>
#include <idas/idas.h>
#include <lapacke.h>
#include <stdlib.h>
#include <sundials/sundials_version.h>
#include "sundials.h"

static_assert (sizeof (sunindextype) == sizeof (int64_t), "SUNDIALS with 64-bit indices is expected");
static_assert (CV_ERR_FAILURE == IDA_ERR_FAIL && CV_CONV_FAILURE == IDA_CONV_FAIL && CV_RHSFUNC_FAIL == IDA_RES_FAIL &&
                   CV_LSETUP_FAIL == IDA_LSETUP_FAIL && CV_TOO_MUCH_ACC == IDA_TOO_MUCH_ACC,
               "CVODES and IDAS have the same flags");

/* Serial vectors with faster operations than those of SUNDIALS: a step of high order adds dozens of vectors of a dozen
 * entries, in libraries that distributions may build without optimisation.  They round like those of SUNDIALS, except
 * that SUNDIALS computes a x + a y as a (x + y) and a x - a y as a (x - y). */

static void vectors_linear_sum (realtype a, N_Vector vx, realtype b, N_Vector vy, N_Vector vz) {
  const sunindextype n = NV_LENGTH_S (vz);
  const double *x = NV_DATA_S (vx), *y = NV_DATA_S (vy);
  double *z = NV_DATA_S (vz);
  sunindextype i = 0;
  for (; i + 1 < n; i += 2) *(pw_pair *)(z + i) = a * PW_PAIR (x, i) + b * PW_PAIR (y, i);
  if (i < n) z[i] = a * x[i] + b * y[i];
}

static void vectors_scale (realtype c, N_Vector vx, N_Vector vz) {
  const sunindextype n = NV_LENGTH_S (vz);
  const double *x = NV_DATA_S (vx);
  double *z = NV_DATA_S (vz);
  sunindextype i = 0;
  for (; i + 1 < n; i += 2) *(pw_pair *)(z + i) = c * PW_PAIR (x, i);
  if (i < n) z[i] = c * x[i];
}

/* z = sum_k c_k x_k */
static int vectors_combine (int count, realtype *c, N_Vector *x, N_Vector vz) {
  const sunindextype n = NV_LENGTH_S (vz);
  double *z = NV_DATA_S (vz);
  sunindextype i = 0;
  for (; i + 3 < n; i += 4) {
    pw_pair sum = { 0 }, next = { 0 };
    for (int k = 0; k < count; k++) {
      const double *y = NV_DATA_S (x[k]);
      sum += c[k] * PW_PAIR (y, i);
      next += c[k] * PW_PAIR (y, i + 2);
    }
    *(pw_pair *)(z + i) = sum;
    *(pw_pair *)(z + i + 2) = next;
  }
  for (; i < n; i++) {
    double sum = 0;
    for (int k = 0; k < count; k++) sum += c[k] * NV_DATA_S (x[k])[i];
    z[i] = sum;
  }
  return 0;
}

static void vectors_fill (realtype c, N_Vector vz) {
  double *z = NV_DATA_S (vz);
  for (sunindextype i = 0, n = NV_LENGTH_S (vz); i < n; i++) z[i] = c;
}

/* sqrt (sum (x_i w_i)^2 / n), with the n of all entries; unless id is NULL, the sum is over id_i > 0 only. */
static double vectors_root_mean_square (N_Vector vx, N_Vector vw, const double *id) {
  const sunindextype n = NV_LENGTH_S (vx);
  const double *x = NV_DATA_S (vx), *w = NV_DATA_S (vw);
  double sum = 0;
  for (sunindextype i = 0; i < n; i++)
    if (id == NULL || id[i] > 0) sum += x[i] * w[i] * (x[i] * w[i]);
  return sqrt (sum / (double)n);
}

static realtype vectors_norm (N_Vector x, N_Vector w) {
  return vectors_root_mean_square (x, w, NULL);
}

static realtype vectors_norm_masked (N_Vector x, N_Vector w, N_Vector id) {
  return vectors_root_mean_square (x, w, NV_DATA_S (id));
}

N_Vector pw_sun_vector (sunindextype length, SUNContext context) {
  N_Vector v = N_VNew_Serial (length, context);
  if (v == NULL) return NULL;
  v->ops->nvlinearsum = vectors_linear_sum;
  v->ops->nvscale = vectors_scale;
  v->ops->nvlinearcombination = vectors_combine;
  v->ops->nvconst = vectors_fill;
  v->ops->nvwrmsnorm = vectors_norm;
  v->ops->nvwrmsnormmask = vectors_norm_masked;
  return v;
}

static void quadrature_store_rates (pw_sun *x) {
  x->t[0] = x->run->t;
  memcpy (x->rate[0], x->run->rate, (size_t)x->run->entries * sizeof (double));
}

void pw_sun_restart (pw_sun *x) {
  const pw_run *r = x->run;
  double *y = N_VGetArrayPointer (x->y);
  memcpy (y, r->q, (size_t)r->s->coords * sizeof *y);
  memcpy (y + r->s->coords, r->v, (size_t)r->s->coords * sizeof *y);
  x->t0 = r->t;
  x->before = r->statistics;
  x->points = 1;
  x->energy = pw_energy (r, r->v);
  quadrature_store_rates (x);
}

/* SUNDIALS 6.4 dereferences vectors and loggers whose allocation failed, so it is tested first whether there is enough
 * memory: for at most 60 vectors (13 of a Nordsieck array of order 12, a dozen more, as many for quadratures, and those
 * of a restart), each with a table of operations, and for the rest. */
int pw_sun_open (pw_sun *x, pw_run *r, int unknowns, pw_rates_at *rates) {
  enum { VECTORS = 60, TABLE = 1024, REST = 1 << 17 };
  const size_t entries = (size_t)r->entries;
  double *rate;
  x->run = r, x->rates = rates;
  x->memory =
      PW_ALLOC_ARRAYS (PW_ARRAY (x->ledger0, entries), PW_ARRAY (x->integral, entries), PW_ARRAY (x->finer, entries),
                       PW_ARRAY (x->node, entries), PW_ARRAY (rate, PW_SUN_POINTS * entries));
  for (int i = 0; x->memory && i < PW_SUN_POINTS; i++) x->rate[i] = rate + i * r->entries;
  if (x->memory == NULL || pw_check_memory (VECTORS * (TABLE + (size_t)unknowns * sizeof (double)) + REST) != PW_OK ||
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
  free (x->memory);
}

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

/* Work and losses along the steps: the integral of a polynomial through the rates at the states reached, of a degree
 * one above the order of the step if enough are stored, at negligible cost; where that is not accurate enough, of the
 * rates that the method interpolates at nodes inside the step.
 *
 * The difference from the polynomial of the next lower degree estimates the error.  Powers may vanish at the ends of
 * all steps but not between them, so the work and losses of a step are also compared with the change of energy. */

/* Gauss quadrature with four nodes, exact up to degree 7: the outer and the inner ones. */
static const double quadrature_node[] = { 0.8611363115940526, 0.3399810435848563 },
                    quadrature_weight[] = { 0.3478548451374538, 0.6521451548625461 };

/* x->integral: between two times, of the polynomial of this degree through the rates at the newest states (Lagrange's
 * formula); x->node: less that of the polynomial of the next lower degree (Newton's formula). */
static void quadrature_polynomial (const pw_sun *x, int degree, double from, double to) {
  const int entries = x->run->entries;
  const double half = (to - from) / 2;
  double last = 0;                      /* integral of the product of t - t_j, j < degree */
  const int pairs = degree > 7 ? 4 : 2; /* of nodes; eight are exact up to degree 15 */
  const double *node = degree > 7 ? pw_gauss_node : quadrature_node,
               *weight = degree > 7 ? pw_gauss_weight : quadrature_weight;
  pw_pair at[4], product[4]; /* nodes, from `from` on; there, the product of all t - t_j, weighted */
  memset (x->integral, 0, (size_t)entries * sizeof *x->integral);
  memset (x->node, 0, (size_t)entries * sizeof *x->node);
  for (int k = 0; k < pairs; k++) {
    at[k] = half * (pw_pair){ 1 - node[k], 1 + node[k] };
    product[k] = (pw_pair){ half, half } * weight[k];
    for (int j = 0; j <= degree; j++) product[k] *= at[k] - (x->t[j] - from);
  }
  for (int i = degree; i >= 0; i--) {
    const double t = x->t[i] - from;
    double sum = 0, at_node = 1;
    for (int k = 0; k < pairs; k++) {
      const pw_pair part = product[k] / (at[k] - t);
      sum += part[0] + part[1];
    }
    for (int j = 0; j <= degree; j++) at_node *= j == i ? 1 : x->t[i] - x->t[j];
    if (i == degree) last = sum;
    pw_add_scaled (x->integral, x->rate[i], sum / at_node, entries);
    pw_add_scaled (x->node, x->rate[i], last / at_node, entries);
  }
}

/* The integrals, in x->finer, between two times of the rates that the method interpolates, in each of equal parts. */
static int quadrature_gauss (const pw_sun *x, double from, double to, int parts) {
  pw_run *r = x->run;
  double half = (to - from) / parts / 2;
  memset (x->finer, 0, (size_t)r->entries * sizeof *x->finer);
  for (int i = 0; i < 4 * parts; i++) {
    double middle = from + (2 * (i / 4) + 1) * half, side = i % 4 < 2 ? -1 : 1;
    int status = x->rates (r, middle + side * quadrature_node[i % 2] * half, x->node);
    if (status != PW_OK) return status;
    pw_add_scaled (x->finer, x->node, half * quadrature_weight[i % 2], r->entries);
  }
  return PW_OK;
}

/* Halves the parts until the integrals, in x->integral, converge; stops if powers cannot be evaluated. */
static void quadrature_refine (pw_sun *x, double from, double to) {
  pw_run *r = x->run;
  const int most = 64; /* 256 nodes */
  double change = INFINITY;
  for (int parts = 1; parts <= most && change > 1; parts *= 2) {
    if (quadrature_gauss (x, from, to, parts) != PW_OK) return;
    for (int e = 0; e < r->entries; e++) x->node[e] = x->finer[e] - x->integral[e];
    change = pw_ledger_norm (r, x->t[0] - x->t[1], x->node);
    memcpy (x->integral, x->finer, (size_t)r->entries * sizeof *x->integral);
  }
}

static int quadrature_degree (const pw_sun *x, int order) {
  return order + 1 < x->points ? order + 1 : x->points - 1;
}

int pw_sun_integrate_ledger (pw_sun *x, int order) {
  pw_run *r = x->run;
  const double method_defect = 100; /* energy defect that the method itself may cause in a step, in tolerances */
  int entries = r->entries, last = PW_SUN_POINTS - 1;
  double *oldest = x->rate[last], h = r->t - x->t[0];
  memcpy (x->ledger0, r->ledger, (size_t)entries * sizeof (double));
  if (!(h > 0)) return PW_OK;
  memmove (x->t + 1, x->t, (size_t)last * sizeof *x->t);
  memmove (x->rate + 1, x->rate, (size_t)last * sizeof *x->rate);
  x->rate[0] = oldest;
  quadrature_store_rates (x);
  if (x->points <= last) x->points++;
  x->order = order;
  quadrature_polynomial (x, quadrature_degree (x, order), x->t[1], x->t[0]);
  const double error = pw_ledger_norm (r, h, x->node), before = x->energy;
  x->energy = pw_energy (r, r->v);
  double defect = x->energy - before; /* of the energy: its change, less work, plus losses */
  for (int e = 0; e < r->s->entries; e++) defect -= r->s->entry[e].type == PW_WORK ? x->integral[e] : -x->integral[e];
  /* the polynomial of a step much longer than those stored before it, together, depends almost only on its ends */
  const int is_long = x->points > 2 && x->t[0] - x->t[1] > 10 * (x->t[1] - x->t[x->points - 1]);
  x->refined = fabs (defect) > method_defect * pw_ledger_tolerance (r, h) || error > 1 || is_long;
  if (x->refined) quadrature_refine (x, x->t[1], x->t[0]);
  for (int e = 0; e < entries; e++) r->ledger[e] += x->integral[e];
  return x->refined ? pw_evaluate_J_at (r->w, pw_before_breakpoint (r, r->t), r->q, r->v) : PW_OK;
}

void pw_sun_ledger_at (pw_sun *x, double t) {
  pw_run *r = x->run;
  int entries = r->entries;
  if (t == x->t[0] || x->points < 2) {
    memcpy (r->ledger_at, r->ledger, (size_t)entries * sizeof (double));
    return;
  }
  quadrature_polynomial (x, quadrature_degree (x, x->order), x->t[1], t);
  if (x->refined) quadrature_refine (x, x->t[1], t);
  for (int e = 0; e < entries; e++) r->ledger_at[e] = x->ledger0[e] + x->integral[e];
}
