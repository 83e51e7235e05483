/* adams, bdf: the multistep methods of CVODES, an integrator of SUNDIALS, on the accelerations.
 *
 *   y = (q, v),   y' = (v, a (t, q, v)),   a from  M a + J^T lambda = f,  J a = gamma,
 *
 * with Baumgarte's terms if selected.
 *
 * adams: Adams-Moulton formulas of orders 1 to 12, for non-stiff scenes.  The fixed-point iteration needs no matrix
 * and converges only if the step resolves every motion.  bdf: backward differentiation formulas of orders 1 to 5, for
 * stiff scenes (Curtiss & Hirschfelder 1952; Gear 1971).  It uses Newton's iteration with an exact matrix;
 * steps and their errors may be projected (Eich 1993).  (Hindmarsh et al. 2005, SUNDIALS: Suite of
 * nonlinear and differential/algebraic equation solvers.) */
#include <cvodes/cvodes.h>
#include <stdlib.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include "sundials.h"
#include "dense_output.h"

/* Newton's iteration of bdf; see below. */
typedef struct {
  pw_tangent tangent;     /* the matrix in tangent.scatter is T */
  double gamma;           /* that of the matrix last set up */
  pw_scatter_map scatter; /* from the entries of T, in order, to the matrix */
  double *right;          /* coords and rows: right-hand side, then da, dlambda */
} bdf_newton;

struct pw_method_data {
  pw_sun sun; /* first */
  void *cvode;
  int n;        /* coordinates */
  int projects; /* 1: coordinate projection, by `projector` */
  pw_projector projector;
  bdf_newton newton;  /* only of bdf */
  double *q, *v;      /* coords + 3: scratch */
  double *a, *lambda; /* coords + 3, rows: of the last evaluation */
  double *error;      /* 2 coords: scratch */
  int evaluated;      /* 1: r->a, r->lambda are those of the state reached, not of the last iterate */
  char *memory;
};

/* The error that may remain after the iteration, over the tolerance of the error test, if only the projected error is
 * tested or forces saturate: less than CVODES' default of 0.1, since with stiff damping that error changes the
 * energy. */
#define MULTISTEP_CONVERGENCE 0.01

/* Stores accelerations and multipliers at y in d->a and d->lambda.  Returns what CVODES expects: 0; > 0: a smaller step
 * may succeed; < 0: a signal failed. */
static int multistep_accelerate (pw_method_data *d, double t, const double *y) {
  pw_run *r = d->sun.run;
  int status = pw_run_accelerate (r, pw_before_breakpoint (r, t), y, y + d->n, d->a, d->lambda);
  return status == PW_OK ? 0 : status > 0 ? 1 : -1;
}

/* Newton's iteration for BDF, (I - gamma df/dy) x = b, without forming the dense df/dy:
 * y = (q, v), y' = (v, a), and gamma is CVODES' coefficient of the step.  With T = (T_q, T_v, T_a, T_lambda), the
 * sparse derivatives of the equations of motion (tangent.c), a change of the state changes a and lambda so that T (dq,
 * dv, da, dlambda) = 0.  With
 *
 *   x_q = b_q + gamma x_v,   x_v = b_v + gamma da
 *
 * only da and dlambda are unknown, with a matrix like that of the accelerations:
 *
 *   (T_a + gamma T_v + gamma^2 T_q) da + T_lambda dlambda = - T_q (b_q + gamma b_v) - T_v b_v
 *
 * T is evaluated when CVODES asks for a new Jacobian; gamma changes more often. */

/* Adds all entries of T, in the columns q, v, a, lambda. */
static void newton_fill_T (pw_method_data *d) {
  int n = d->n;
  const pw_tangent_layout to = {
    .momentum = 0, .constraint = n, .q = 0, .v = n, .a = 2 * n, .lambda = 3 * n, .a_factor = 1, .lambda_factor = 1
  };
  pw_tangent_add_momentum (&d->newton.tangent, &to, d->lambda);
  pw_tangent_add_accelerations (&d->newton.tangent, &to, d->v, d->a);
}

/* Adds all entries of the matrix (T_a + gamma T_v + gamma^2 T_q, T_lambda) from those of T. */
static void newton_fill_matrix (bdf_newton *w, int n) {
  const pw_scatter_map *T = &w->tangent.scatter;
  const double power[] = { w->gamma * w->gamma, w->gamma, 1 };
  for (int c = 0; c < 3 * n + w->tangent.rows; c++) {
    int part = c < 2 * n ? c / n : 2, column = c < 2 * n ? c % n : c - 2 * n; /* parts: q; v; a and lambda */
    for (int64_t i = T->colptr[c]; i < T->colptr[c + 1]; i++)
      pw_scatter_add (&w->scatter, (int)T->rowind[i], column, w->scatter.recording ? 0 : power[part] * T->value[i]);
  }
}

/* Called by CVODES: evaluates T, unless CVODES proposes to `reuse` the last one and that is still valid, then forms the
 * matrix with gamma.  *evaluated: 1 if T was evaluated. */
static int newton_set_up (realtype t, N_Vector y, N_Vector derivative, SUNMatrix matrix, booleantype reuse,
                          booleantype *evaluated, realtype gamma, void *data, N_Vector tmp1, N_Vector tmp2,
                          N_Vector tmp3) {
  pw_method_data *d = data;
  bdf_newton *w = &d->newton;
  (void)derivative, (void)matrix, (void)tmp1, (void)tmp2, (void)tmp3;
  *evaluated = !reuse || d->sun.run->matrix_outdated;
  if (*evaluated) {
    int status = multistep_accelerate (d, t, N_VGetArrayPointer (y));
    if (status != 0) return status;
    memcpy (d->v, N_VGetArrayPointer (y) + d->n, (size_t)d->n * sizeof *d->v);
    pw_scatter_begin_fill (&w->tangent.scatter, w->tangent.scatter.value);
    newton_fill_T (d);
    pw_matrix_evaluated (d->sun.run, N_VGetArrayPointer (y), d->v);
    d->sun.run->statistics.jacobians++;
  }
  w->gamma = gamma;
  pw_scatter_begin_fill (&w->scatter, w->scatter.value);
  newton_fill_matrix (w, d->n);
  d->sun.run->statistics.factorisations++; /* CVODES factorises next */
  return 0;
}

static int newton_solve (SUNLinearSolver solver, SUNMatrix matrix, N_Vector vx, N_Vector vb, realtype tolerance) {
  pw_method_data *d = solver->content;
  bdf_newton *w = &d->newton;
  const pw_scatter_map *T = &w->tangent.scatter;
  const double *b = N_VGetArrayPointer (vb), *da = w->right;
  double *x = N_VGetArrayPointer (vx);
  int n = d->n;
  (void)matrix, (void)tolerance;
  if (d->sun.run->matrix_outdated) return SUNLS_PACKAGE_FAIL_REC; /* CVODES then requests a new matrix */
  memset (w->right, 0, (size_t)(n + w->tangent.rows) * sizeof *w->right);
  for (int c = 0; c < 2 * n; c++) { /* - T_q (b_q + gamma b_v) - T_v b_v */
    double factor = c < n ? b[c] + w->gamma * b[n + c] : b[c];
    for (int64_t i = T->colptr[c]; i < T->colptr[c + 1]; i++) w->right[T->rowind[i]] -= T->value[i] * factor;
  }
  if (pw_sparse_solve (&d->sun.sparse, w->right) != PW_OK) return SUNLS_PACKAGE_FAIL_UNREC;
  for (int j = 0; j < n; j++) {
    x[n + j] = b[n + j] + w->gamma * da[j];
    x[j] = b[j] + w->gamma * x[n + j];
  }
  return SUNLS_SUCCESS;
}

static int newton_open (pw_method_data *d) {
  bdf_newton *w = &d->newton;
  pw_sun *x = &d->sun;
  if (pw_tangent_open (&w->tangent, x->run) != PW_OK) return PW_RESOURCE;
  const int size = d->n + w->tangent.rows;
  pw_scatter_begin_record (&w->tangent.scatter); /* the patterns of T and of the matrix; there are no values yet */
  newton_fill_T (d);
  if (pw_scatter_lay_out (&w->tangent.scatter, 2 * d->n + size) != PW_OK) return PW_RESOURCE;
  pw_scatter_begin_record (&w->scatter);
  newton_fill_matrix (w, d->n);
  if (pw_scatter_lay_out (&w->scatter, size) != PW_OK ||
      pw_sun_open_solver (x, size, &w->scatter, d, newton_solve) != PW_OK)
    return PW_RESOURCE;
  int failed = CVodeSetLinearSolver (d->cvode, x->solver, x->matrix) || CVodeSetLinSysFn (d->cvode, newton_set_up);
  return failed ? PW_RESOURCE : PW_OK;
}

static int multistep_derivative (realtype t, N_Vector vy, N_Vector derivative, void *data) {
  pw_method_data *d = data;
  const double *y = N_VGetArrayPointer (vy);
  double *out = N_VGetArrayPointer (derivative);
  size_t bytes = (size_t)d->n * sizeof *out;
  if (pw_run_stop_requested (d->sun.run)) return -1;
  int flag = multistep_accelerate (d, t, y);
  memcpy (out, y + d->n, bytes);
  memcpy (out + d->n, d->a, bytes);
  return flag;
}

static int multistep_weigh (N_Vector y, N_Vector weights, void *data) {
  pw_sun_weigh (&((pw_method_data *)data)->sun, N_VGetArrayPointer (y), N_VGetArrayPointer (weights));
  return 0;
}

/* Projects q and v at t.  Returns as pw_project_positions. */
static int multistep_project (pw_method_data *d, double t, double *q, double *v) {
  int status = pw_project_positions (&d->projector, d->sun.run, t, q, v);
  return status == PW_OK ? pw_project_velocities (&d->projector, d->sun.run, v) : status;
}

/* Called by CVODES: the change of y by the projection.  Unless `error` is NULL, leaves of this estimate the part
 * tangential to the constraints (Eich 1993), in the metric of the projection, plus a small part of the whole, so that
 * the displacement off the constraints is at most rtol^(3/4) as in rk.c.  That displacement has tangential effects that
 * the estimate misses: the accelerations of the step are those of the displaced state. */
static int multistep_correct (realtype t, N_Vector vy, N_Vector change, realtype tolerance, N_Vector error,
                              void *data) {
  pw_method_data *d = data;
  pw_run *r = d->sun.run;
  const double *y = N_VGetArrayPointer (vy), share = sqrt (sqrt (r->settings.rtol));
  double *out = N_VGetArrayPointer (change), *e = error ? N_VGetArrayPointer (error) : NULL;
  size_t bytes = (size_t)d->n * sizeof *y;
  (void)tolerance; /* projections are accurate to round-off */
  memcpy (d->q, y, bytes);
  memcpy (d->v, y + d->n, bytes);
  int status = multistep_project (d, t, d->q, d->v);
  for (int j = 0; j < d->n; j++) {
    out[j] = d->q[j] - y[j];
    out[d->n + j] = d->v[j] - y[d->n + j];
  }
  if (status != PW_OK) return status > 0 ? 1 : -1;
  if (e == NULL) return 0;
  memcpy (d->error, e, 2 * bytes);
  pw_project_error (r, d->projector.velocity, e, r->s->holonomic);
  pw_project_error (r, d->projector.velocity, e + d->n, r->s->rows);
  for (int j = 0; j < 2 * d->n; j++) e[j] += share * (d->error[j] - e[j]);
  return 0;
}

/* Accelerations and multipliers at (t, q, v), projected first if `project` is 1.  No configuration is refused as too
 * nearly singular, and the statistics do not change. */
static int multistep_complete (pw_method_data *d, double t, int project, double *q, double *v, double *a,
                               double *lambda) {
  pw_run *r = d->sun.run;
  const int near_singular = r->near_singular;
  const pw_statistics statistics = r->statistics;
  r->refused_sine = 0;
  int status = project ? multistep_project (d, t, q, v) : PW_OK;
  if (status == PW_OK) status = pw_run_accelerate (r, t, q, v, a, lambda);
  r->refused_sine = r->thresholds.rank_lost;
  r->statistics = statistics;
  r->near_singular = near_singular;
  return status;
}

/* Interpolates the state at t into the sample arrays.  CV_SUCCESS or CV_BAD_T. */
static int multistep_interpolate (pw_method_data *d, double t) {
  pw_run *r = d->sun.run;
  int flag = t < r->t ? CVodeGetDky (d->cvode, t, 0, d->sun.y) : CV_BAD_T;
  const double *y = N_VGetArrayPointer (d->sun.y);
  if (flag != CV_SUCCESS) return flag;
  memcpy (r->q_at, y, (size_t)d->n * sizeof *y);
  memcpy (r->v_at, y + d->n, (size_t)d->n * sizeof *y);
  return flag;
}

static int multistep_power (pw_run *r, double t, double *rate) {
  pw_method_data *d = r->data;
  int status = multistep_interpolate (d, t) == CV_SUCCESS ? PW_OK : PW_RETRY;
  if (status == PW_OK) status = multistep_complete (d, t, d->projects, r->q_at, r->v_at, r->a_at, r->lambda_at);
  if (status == PW_OK) pw_ledger_rates (r, r->lambda_at, rate);
  return status;
}

static int multistep_open_solver (pw_method_data *d, int formula) {
  pw_sun *x = &d->sun;
  pw_run *r = x->run;
  const int newton = formula == CV_BDF;
  void *m = d->cvode = CVodeCreate (formula, d->sun.context);
  if (m == NULL || CVodeSetErrHandlerFn (m, pw_sun_message, &d->sun) || CVodeSetUserData (m, d) ||
      CVodeInit (m, multistep_derivative, r->t, d->sun.y) || CVodeWFtolerances (m, multistep_weigh) ||
      CVodeSetMaxNumSteps (m, -1) || CVodeSetMaxConvFails (m, PW_SUN_ATTEMPTS) ||
      CVodeSetMaxErrTestFails (m, PW_SUN_ATTEMPTS) || CVodeSetInitStep (m, pw_first_step (r)))
    return PW_RESOURCE;
  if ((d->projects || r->s->saturates) && CVodeSetNonlinConvCoef (m, MULTISTEP_CONVERGENCE)) return PW_RESOURCE;
  if (d->projects &&
      (CVodeSetProjFn (m, multistep_correct) || CVodeSetProjFrequency (m, (long)pw_run_option (r, "every"))))
    return PW_RESOURCE;
  if (newton && newton_open (d) != PW_OK) return PW_RESOURCE;
  if (newton && !r->s->saturates) return PW_OK;
  x->iteration = newton ? SUNNonlinSol_Newton (x->y, x->context) : SUNNonlinSol_FixedPoint (x->y, 0, x->context);
  if (x->iteration == NULL || CVodeSetNonlinearSolver (m, x->iteration)) return PW_RESOURCE;
  return newton ? pw_sun_test_newton (x) : PW_OK;
}

static int multistep_open (pw_run *r, int formula, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  if (d == NULL) return pw_sun_no_memory (r, error);
  d->n = r->s->coords;
  d->projects = pw_stabilised_by (r, PW_PROJECTION);
  int status = d->projects ? pw_projector_open_by_options (&d->projector, r, error) : PW_OK;
  if (status != PW_OK) return status;
  size_t n = (size_t)d->n + 3, rows = (size_t)r->s->rows;
  d->memory = PW_ALLOC_ARRAYS (PW_ARRAY (d->q, n), PW_ARRAY (d->v, n), PW_ARRAY (d->a, n), PW_ARRAY (d->error, 2 * n),
                               PW_ARRAY (d->lambda, rows), PW_ARRAY (d->newton.right, n + rows));
  d->evaluated = 1;
  if (d->memory == NULL || pw_sun_open (&d->sun, r, 2 * d->n, multistep_power) != PW_OK ||
      multistep_open_solver (d, formula) != PW_OK)
    return pw_sun_no_memory (r, error);
  return PW_OK;
}

static void multistep_close (pw_run *r) {
  pw_method_data *d = r->data;
  if (d->cvode) CVodeFree (&d->cvode);
  pw_scatter_close (&d->newton.scatter);
  pw_tangent_close (&d->newton.tangent);
  pw_sun_close (&d->sun);
  if (d->projects) pw_projector_close (&d->projector);
  free (d->memory);
  free (d);
}

static void multistep_count (pw_method_data *d) {
  pw_statistics *s = &d->sun.run->statistics;
  long steps = 0, tests = 0, iterations = 0, projections = 0; /* steps; failed tests, iterations, projections */
  CVodeGetNumSteps (d->cvode, &steps);
  CVodeGetNumErrTestFails (d->cvode, &tests);
  CVodeGetNumNonlinSolvConvFails (d->cvode, &iterations);
  if (d->projects) CVodeGetNumProjFails (d->cvode, &projections);
  s->steps = d->sun.before.steps + steps;
  s->rejected = d->sun.before.rejected + tests + iterations + projections;
}

static int multistep_fail (pw_method_data *d, int flag, pw_error *error) {
  pw_run *r = d->sun.run;
  int singular = flag == CV_FIRST_RHSFUNC_ERR || flag == CV_REPTD_RHSFUNC_ERR || flag == CV_UNREC_RHSFUNC_ERR;
  if (!r->stopped) multistep_count (d);
  if (!r->stopped && flag == CV_REPTD_PROJFUNC_ERR && d->projector.contradictory_row >= 0)
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s contradicts the other constraints", r->t,
                    PW_NAME (pw_system_row_name, r->s, d->projector.contradictory_row));
  if (flag == CV_PROJFUNC_FAIL) flag = CV_RHSFUNC_FAIL; /* a signal failed */
  return pw_sun_fail (&d->sun, flag, singular,
                      flag == CV_REPTD_PROJFUNC_ERR ? "the projection does not converge however small the step" : NULL,
                      error);
}

/* Accelerations and multipliers of the state reached, unless they are known.  In a singular configuration those of the
 * last iterate remain.  Returns as pw_run_accelerate. */
static int multistep_evaluate (pw_method_data *d) {
  pw_run *r = d->sun.run;
  if (d->evaluated) return PW_OK;
  int status = multistep_complete (d, pw_before_breakpoint (r, r->t), 0, r->q, r->v, r->a, r->lambda);
  d->evaluated = status == PW_OK;
  if (d->evaluated) return PW_OK;
  memcpy (r->a, d->a, (size_t)d->n * sizeof *r->a);
  memcpy (r->lambda, d->lambda, (size_t)r->s->rows * sizeof *r->lambda);
  return status;
}

/* Makes y the state reached at t and updates the ledger.  Accelerations and multipliers remain those of the last
 * iterate until multistep_at or multistep_evaluate computes them, which saves one evaluation in three. */
static int multistep_reach (pw_method_data *d, double t, pw_error *error) {
  pw_run *r = d->sun.run;
  const double *y = N_VGetArrayPointer (d->sun.y);
  memcpy (r->q, y, (size_t)d->n * sizeof *y);
  memcpy (r->v, y + d->n, (size_t)d->n * sizeof *y);
  memcpy (r->a, d->a, (size_t)d->n * sizeof *y);
  memcpy (r->lambda, d->lambda, (size_t)r->s->rows * sizeof *y);
  r->t = t;
  d->evaluated = 0;
  if (pw_evaluate_J_at (r->w, pw_before_breakpoint (r, t), r->q, r->v) != PW_OK)
    return multistep_fail (d, CV_RHSFUNC_FAIL, error);
  pw_bound_tolerances (r);
  if (r->entries > 0) {
    int order = 1; /* multipliers of the last Newton iterate, which may be the prediction, are not accurate enough */
    if (d->sun.solver && pw_ledger_uses_multipliers (r)) (void)multistep_evaluate (d);
    pw_ledger_rates (r, r->lambda, r->rate);
    CVodeGetLastOrder (d->cvode, &order);
    if (pw_sun_integrate_ledger (&d->sun, order) != PW_OK) return multistep_fail (d, CV_RHSFUNC_FAIL, error);
  }
  pw_forget_residuals (r); /* those of projections before and inside the step */
  return PW_OK;
}

static int multistep_advance (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), t = r->t;
  int flag = CVodeSetStopTime (d->cvode, stop);
  if (flag >= 0) flag = CVode (d->cvode, stop, d->sun.y, &t, CV_ONE_STEP);
  if (flag < 0) return multistep_fail (d, flag, error);
  multistep_count (d);
  return multistep_reach (d, flag == CV_TSTOP_RETURN ? stop : t, error);
}

static int multistep_at (pw_run *r, double t, pw_error *error) {
  pw_method_data *d = r->data;
  int status = PW_OK;
  if (t == r->t) {
    status = multistep_evaluate (d);
    if (status == PW_OK) pw_sample_reached (r);
  } else {
    if (t < r->t && r->entries > 0) pw_sun_ledger_at (&d->sun, t);
    int flag = multistep_interpolate (d, t);
    if (flag == CV_BAD_T) return pw_fail_outside (r, NAN, t, error);
    if (flag != CV_SUCCESS) return multistep_fail (d, flag, error);
    status = multistep_complete (d, t, d->projects, r->q_at, r->v_at, r->a_at, r->lambda_at);
  }
  if (status > 0) return pw_fail_singular (r, t, error);
  return status == PW_OK ? PW_OK : pw_fail_signal (t, error);
}

static int multistep_restart (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data;
  pw_sun_restart (&d->sun);
  d->evaluated = 1;
  int flag = CVodeReInit (d->cvode, r->t, d->sun.y);
  if (flag == CV_SUCCESS) flag = CVodeSetInitStep (d->cvode, pw_first_step (r));
  return flag == CV_SUCCESS ? PW_OK : pw_sun_fail_restart (&d->sun, flag, error);
}

static int adams_open (pw_run *r, pw_error *error) {
  return multistep_open (r, CV_ADAMS, error);
}

static int bdf_open (pw_run *r, pw_error *error) {
  return multistep_open (r, CV_BDF, error);
}

/* Measured on the EzyRoller at rtol 1e-6: with a restart after each projection there are 100 times as many steps.
 * Projections only within evaluations do not stop the drift of y, and made errors 7 times larger on a pendulum. */
static const pw_stabilisation adams_refused[] = {
  { .name = "projection",
    .about = "CVODES projects with bdf only, and restarts after each projection would leave order 1; "
             "use bdf+projection or erk8+projection" },
  { .name = NULL },
};

static const pw_stabilisation bdf_stabilisations[] = {
  PW_ACCELERATION_STABILISATIONS,
  { "projection", "projection onto the constraints after each step (Lubich 1991, Eich 1993)", PW_PROJECTION },
  { .name = NULL },
};

#define MULTISTEP_FUNCTIONS                                                                      \
  .adaptive = 1, .advance = multistep_advance, .at = multistep_at, .restart = multistep_restart, \
  .close = multistep_close

const pw_method pw_method_adams = {
  .name = "adams",
  .about = "variable-order Adams on the accelerations, where nothing is stiff, SUNDIALS CVODES (Hindmarsh et al. 2005)",
  .stabilisations = (const pw_stabilisation[]){ PW_ACCELERATION_STABILISATIONS, { .name = NULL } },
  .options = (const pw_option[]){ PW_BAUMGARTE_OPTIONS, { .name = NULL } },
  .refused = adams_refused,
  .open = adams_open,
  MULTISTEP_FUNCTIONS,
};

const pw_method pw_method_bdf = {
  .name = "bdf",
  .about =
      "variable-order BDF on the accelerations, for stiff scenes, SUNDIALS CVODES with KLU (Hindmarsh et al. 2005)",
  .stabilisations = bdf_stabilisations,
  .options = (const pw_option[]){ PW_BAUMGARTE_OPTIONS, PW_PROJECTION_OPTIONS, { .name = NULL } },
  .open = bdf_open,
  MULTISTEP_FUNCTIONS,
};
