/* ida: the variable-order BDF code IDAS of SUNDIALS (Hindmarsh et al. 2005), on the equations of ida_equations.c.
 *
 * The Newton matrix is exact and sparse, factorised by KLU.  lambda and mu are kept out of the error test, and only
 * they: rates of massless coordinates are in it.  In si1 all are in it. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <idas/idas.h>
#include "between.h"
#include "ida_state.h"
#include "rank.h"

/* ---- What IDA asks for besides ---- */

/* Multipliers of a placed state, J swept.  Those of IDA are good where J v = eta is solved.  On the level of
 * accelerations nothing but Newton's iteration holds them where the motion is prescribed, and they may wander off
 * without harm to the motion: there they are computed anew.  Factorises the saddle in any case. */
static int ida_multipliers (const ida_data *d, const double *v, double *a, double *lambda) {
  pw_run *r = d->run;
  int status = pw_saddle_factor (r->saddle);
  if (status == PW_OK && !d->form.rates) pw_accelerate_placed (r, v, a, lambda);
  return status;
}

/* The coefficient c of the current step, 1 / h before there is one; not below 1 / T. */
static double ida_leading (const ida_data *d) {
  pw_real c = 0;
  if (d->run->t == d->begun || IDAGetCurrentCj (d->ida, &c) != IDA_SUCCESS || c == 0) c = 1 / pw_first_step (d->run);
  return fmax (c, 1 / d->run->s->scale.time);
}

/* Error weights of the multipliers: by the scale of the forces and rates, times L for moments and what goes with angles.
 *
 * Where they are unknowns the error test does not see them, and a correction of them is as large as one of v or q
 * divided by the step: if J v = eta is solved, the convergence test sees them divided by c.  Where they are rates, it
 * is their integrals over T that are weighted; lambda itself is that of the step before. */
static void ida_weigh_multipliers (const ida_data *d, const double *y, double force, double *w) {
  const pw_run *r = d->run;
  const pw_settings *set = &r->settings;
  int impulses = d->form.impulses, stiff = d->form.rates && !impulses;
  double L = r->s->scale.length, T = r->s->scale.time, c = stiff ? ida_leading (d) : 1 / T;
  double relax = impulses ? T : c * T, mu = (set->atol > 0 ? set->atol : set->rtol * L / T) * relax;
  for (int i = 0; i < d->rows; i++) {
    double lambda = impulses ? r->lambda[d->tangent.map ? d->tangent.row[i] : i] : y[2 * d->n + i];
    w[2 * d->n + i] = 1 / (relax * set->rtol * (fabs (lambda) + force * d->lever[i]));
  }
  for (int i = 0, first = 2 * d->n + d->rows; first + i < d->size; i++) w[first + i] = 1 / (mu * d->lever[i]);
}

/* The scale of forces: that of the masses, else that of the multipliers; 1 where nothing has mass and nothing pulls. */
static double ida_force (const pw_run *r) {
  const pw_system *s = r->s;
  double L = s->scale.length, T = s->scale.time, force = 0;
  for (int j = 0; j < s->coords; j++) force = fmax (force, s->mass[j] / (T * T) * (pw_is_angle (s, j) ? 1 / L : L));
  if (force > 0) return force;
  for (int i = 0; i < s->rows; i++) force = fmax (force, fabs (r->lambda[i]));
  return force > 0 ? force : 1;
}

/* Error weights: by unit for q and v. */
static int ida_weights (N_Vector vy, N_Vector weights, void *user) {
  ida_data *d = user;
  const pw_run *r = d->run;
  const double *y = N_VGetArrayPointer (vy);
  double *w = N_VGetArrayPointer (weights);
  for (int j = 0; j < d->n; j++) {
    w[j] = 1 / pw_tolerance (r, j, y[j]);
    w[d->n + j] = 1 / pw_tolerance_rate (r, j, y[d->n + j]);
  }
  ida_weigh_multipliers (d, y, ida_force (r), w);
  return 0;
}

/* ---- Inside the last step ---- */

static void ida_fill_vectors (ida_data *d) {
  const pw_run *r = d->run;
  size_t n = (size_t)d->n;
  double *y = N_VGetArrayPointer (d->y), *yp = N_VGetArrayPointer (d->yp), *id = N_VGetArrayPointer (d->id);
  for (int i = 0; i < d->size; i++) {
    y[i] = yp[i] = 0;
    id[i] = i < 2 * d->n || d->form.impulses;
  }
  memcpy (y, r->q, n * sizeof *y);
  memcpy (y + n, r->v, n * sizeof *y);
  pw_tangent_compress (&d->tangent, r->lambda, d->rows, (d->form.impulses ? yp : y) + 2 * n);
  memcpy (yp, r->v, n * sizeof *y);
  memcpy (yp + n, r->a, n * sizeof *y);
}

/* Reads (q, v, a, lambda) out of y and y'. */
static void ida_read (const ida_data *d, double *q, double *v, double *a, double *lambda) {
  size_t n = (size_t)d->n;
  const double *y = N_VGetArrayPointer (d->y), *yp = N_VGetArrayPointer (d->yp);
  memcpy (q, y, n * sizeof *q);
  memcpy (v, y + n, n * sizeof *v);
  memcpy (a, yp + n, n * sizeof *a);
  for (int i = 0; i < d->run->s->rows; i++) lambda[i] = 0;
  const double *used = pw_ida_lambda (d, y, yp);
  for (int i = 0; i < d->rows; i++) lambda[d->tangent.map ? d->tangent.row[i] : i] = used[i];
}

/* The state at t, into the sample arrays, where the system is placed.  Accelerations and multipliers are those that go with
 * it, rather than the last iterate's: IDA's error test does not see them.  In a singular pose those of IDA stay.  Returns a
 * flag of IDA's. */
static int ida_interpolate (ida_data *d, double t) {
  pw_run *r = d->run;
  int flag = t > r->t ? IDA_BAD_T : IDA_SUCCESS;
  if (t == d->begun && t == r->t)
    ida_fill_vectors (d);
  else {
    if (flag == IDA_SUCCESS) flag = IDAGetDky (d->ida, t, 1, d->yp);
    if (flag == IDA_SUCCESS) flag = IDAGetDky (d->ida, t, 0, d->y);
  }
  if (flag != IDA_SUCCESS) return flag;
  ida_read (d, r->q_at, r->v_at, r->a_at, r->lambda_at);
  if (pw_ida_place (d, t, N_VGetArrayPointer (d->y)) != 0) return IDA_RES_FAIL;
  pw_statistics keep = r->statistics;
  if (pw_saddle_factor (r->saddle) == PW_OK) pw_accelerate_placed (r, r->v_at, r->a_at, r->lambda_at);
  r->statistics = keep;
  return IDA_SUCCESS;
}

/* ---- Work and losses ---- */

static int ida_power (pw_run *r, double t, double *rate) {
  int flag = ida_interpolate (r->data, t);
  if (flag == IDA_SUCCESS) pw_sweep_ledger (r->s, r->lambda_at, rate);
  return flag == IDA_SUCCESS ? PW_OK : PW_RETRY;
}

/* Work and losses up to the state reached, where the saddle is factorised if `status` says so.  Multipliers that the error
 * test has not seen are not good enough for them.  0, or -1 if a signal failed. */
static int ida_work (ida_data *d, int status) {
  pw_run *r = d->run;
  int order = 1;
  const double *lambda = r->lambda;
  if (status == PW_OK && d->form.rates && pw_ledger_reacts (r->s)) {
    pw_accelerate_placed (r, r->v, r->a_at, r->lambda_at);
    lambda = r->lambda_at;
  }
  pw_sweep_ledger (r->s, lambda, r->rate);
  IDAGetLastOrder (d->ida, &order);
  if (!pw_quadrature_step (&d->quadrature, r, order)) return 0;
  memcpy (N_VGetArrayPointer (d->y), r->q, (size_t)d->n * sizeof (double));
  memcpy (N_VGetArrayPointer (d->y) + d->n, r->v, (size_t)d->n * sizeof (double));
  return pw_ida_place (d, r->t, N_VGetArrayPointer (d->y));
}

/* ---- Opening ---- */

static int ida_no_memory (const pw_run *r, pw_error *error) {
  return pw_fail (error, PW_MACHINE, "model %s: out of memory in ida", r->s->model);
}

static int ida_open_vectors (ida_data *d) {
  const pw_system *s = d->run->s;
  if (pw_sun_open (&d->context, d->size) != PW_OK) return PW_MACHINE;
  d->y = pw_sun_vector (d->size, d->context);
  d->yp = pw_sun_vector (d->size, d->context);
  d->id = pw_sun_vector (d->size, d->context);
  d->scale = calloc ((size_t)(3 * d->n + 6 + 3 * s->rows), sizeof *d->scale);
  if (!d->y || !d->yp || !d->id || !d->scale) return PW_MACHINE;
  d->given = d->scale + d->n;
  d->lever = d->given + 2 * d->n + 6 + 2 * s->rows;
  for (int i = 0; i < d->rows; i++) d->lever[i] = pw_rank_size (s, d->tangent.map ? d->tangent.row[i] : i);
  for (int j = 0; j < d->n; j++) d->scale[j] = pw_is_angle (s, j) ? 1 / (s->scale.length * s->scale.length) : 1;
  ida_fill_vectors (d);
  return PW_OK;
}

/* ---- The linear solver that IDA sees: KLU, unless the matrix is outdated ---- */

static SUNLinearSolver_Type ida_solver_type (SUNLinearSolver solver) {
  (void)solver;
  return SUNLINEARSOLVER_DIRECT;
}

static int ida_solver_begin (SUNLinearSolver solver) {
  return SUNLinSolInitialize (((ida_data *)solver->content)->klu);
}

static int ida_factorise (SUNLinearSolver solver, SUNMatrix matrix) {
  return SUNLinSolSetup (((ida_data *)solver->content)->klu, matrix);
}

static int ida_solve (SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, pw_real tolerance) {
  ida_data *d = solver->content;
  if (d->run->outdated) return SUNLS_PACKAGE_FAIL_REC; /* IDA then asks for a new one */
  return SUNLinSolSolve (d->klu, matrix, x, b, tolerance);
}

static int ida_wrap_solver (ida_data *d) {
  d->klu = SUNLinSol_KLU (d->y, d->matrix, d->context);
  d->solver = SUNLinSolNewEmpty (d->context);
  if (d->klu == NULL || d->solver == NULL) return PW_MACHINE;
  d->solver->content = d;
  d->solver->ops->gettype = ida_solver_type;
  d->solver->ops->initialize = ida_solver_begin;
  d->solver->ops->setup = ida_factorise;
  d->solver->ops->solve = ida_solve;
  return PW_OK;
}

static int ida_open_solver (ida_data *d) {
  pw_run *r = d->run;
  int flag = 0;
  d->ida = IDACreate (d->context);
  if (d->ida == NULL || ida_wrap_solver (d) != PW_OK) return PW_MACHINE;
  if (flag == IDA_SUCCESS) flag = IDASetErrHandlerFn (d->ida, pw_sun_message, &d->said);
  if (flag == IDA_SUCCESS) flag = IDASetUserData (d->ida, d);
  if (flag == IDA_SUCCESS) flag = IDAInit (d->ida, pw_ida_residual, r->t, d->y, d->yp);
  if (flag == IDA_SUCCESS) flag = IDAWFtolerances (d->ida, ida_weights);
  if (flag == IDA_SUCCESS) flag = IDASetId (d->ida, d->id);
  if (flag == IDA_SUCCESS) flag = IDASetSuppressAlg (d->ida, 1);
  if (flag == IDA_SUCCESS) flag = IDASetMaxNumSteps (d->ida, -1);
  if (flag == IDA_SUCCESS) flag = IDASetMaxConvFails (d->ida, PW_SUN_ATTEMPTS);
  if (flag == IDA_SUCCESS) flag = IDASetMaxErrTestFails (d->ida, PW_SUN_ATTEMPTS);
  if (flag == IDA_SUCCESS) flag = IDASetInitStep (d->ida, pw_first_step (d->run));
  if (flag == IDA_SUCCESS) flag = IDASetLinearSolver (d->ida, d->solver, d->matrix);
  if (flag == IDA_SUCCESS) flag = IDASetJacFn (d->ida, pw_ida_matrix);
  if (r->s->saturates) {
    d->newton = SUNNonlinSol_Newton (d->y, d->context);
    if (d->newton == NULL) return PW_MACHINE;
    if (flag == IDA_SUCCESS) flag = IDASetNonlinearSolver (d->ida, d->newton);
    if (flag == IDA_SUCCESS) flag = pw_sun_test_newton (d->newton, &d->correction);
  }
  return flag == 0 ? PW_OK : PW_MACHINE;
}

static int ida_open (pw_run *r, pw_error *error) {
  ida_data *d = r->data = calloc (1, sizeof *d);
  if (d == NULL) return ida_no_memory (r, error);
  d->run = r;
  d->form = pw_ida_choose_form (r);
  pw_read_baumgarte (r);
  if (pw_tangent_open (&d->tangent, r) != PW_OK) return ida_no_memory (r, error);
  d->n = r->s->coords;
  d->rows = d->tangent.rows;
  d->positions = d->form.positions ? d->tangent.holonomic : 0;
  d->size = 2 * d->n + d->rows + d->positions;
  d->stop = NAN;
  d->begun = r->t;
  if (r->statistics.steps > 0) d->before = r->statistics;
  if (ida_open_vectors (d) != PW_OK || pw_ida_open_matrix (d) != PW_OK || ida_open_solver (d) != PW_OK ||
      pw_quadrature_open (&d->quadrature, r, ida_power) != PW_OK)
    return ida_no_memory (r, error);
  return PW_OK;
}

static void ida_close (pw_run *r) {
  ida_data *d = r->data;
  if (d->ida) IDAFree (&d->ida);
  if (d->solver) SUNLinSolFreeEmpty (d->solver);
  if (d->klu) SUNLinSolFree (d->klu);
  if (d->newton) SUNNonlinSolFree (d->newton);
  if (d->matrix) SUNMatDestroy (d->matrix);
  N_Vector const vector[] = { d->y, d->yp, d->id };
  for (size_t i = 0; i < sizeof vector / sizeof *vector; i++)
    if (vector[i]) N_VDestroy (vector[i]);
  if (d->context) SUNContext_Free (&d->context);
  pw_tangent_close (&d->tangent);
  pw_quadrature_close (&d->quadrature);
  free (d->scale);
  free (d);
}

/* ---- Advancing ---- */

static void ida_statistics (ida_data *d) {
  pw_statistics *s = &d->run->statistics, now = { 0 };
  const pw_statistics *before = &d->before;
  long tests = 0, newton = 0;
  IDAGetNumSteps (d->ida, &now.steps);
  IDAGetNumErrTestFails (d->ida, &tests);
  IDAGetNumNonlinSolvConvFails (d->ida, &newton);
  IDAGetNumResEvals (d->ida, &now.rhs);
  IDAGetNumJacEvals (d->ida, &now.jacobians);
  IDAGetNumLinSolvSetups (d->ida, &now.factorisations);
  s->steps = before->steps + now.steps;
  s->rejected = before->rejected + tests + newton;
  s->rhs = before->rhs + now.rhs;
  s->jacobians = before->jacobians + now.jacobians;
  s->factorisations = before->factorisations + now.factorisations;
}

static int ida_fail (ida_data *d, int flag, pw_error *error) {
  const char *why = flag == IDA_ERR_FAIL       ? "the error test fails however small the step"
                    : flag == IDA_CONV_FAIL    ? "Newton's iteration does not converge however small the step"
                    : flag == IDA_LSETUP_FAIL  ? "the Newton matrix is singular"
                    : flag == IDA_RES_FAIL     ? "a signal failed"
                    : flag == IDA_TOO_MUCH_ACC ? "the tolerance is beyond the accuracy of the machine"
                                               : pw_sun_reason (&d->said, flag);
  if (d->run->stopped) return d->run->interrupted = 1, PW_STOPPED;
  ida_statistics (d);
  if (flag == IDA_LSETUP_FAIL && pw_sun_lacks_memory (d->klu)) return ida_no_memory (d->run, error);
  if (flag != IDA_RES_FAIL && pw_watchdog_near_state (d->run)) return pw_fail_singular (d->run, d->run->t, error);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s (rtol %.3g)", d->run->t, why, d->run->settings.rtol);
}

static int ida_restart (pw_run *r, pw_error *error);

/* IDA does not begin where it is to stop within the round-off of time.  Nothing moves there. */
static int ida_skip (pw_run *r, double stop, pw_error *error) {
  r->t = stop;
  r->statistics.steps++;
  if (pw_ida_place (r->data, stop, N_VGetArrayPointer (r->data->y)) != 0)
    return ida_fail (r->data, IDA_RES_FAIL, error);
  return ida_restart (r, error);
}

static int ida_advance (pw_run *r, double t_end, pw_error *error) {
  ida_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), t = r->t;
  if (t == d->begun && stop - t <= 8 * DBL_EPSILON * fabs (t)) return ida_skip (r, stop, error);
  int flag = stop != d->stop ? IDASetStopTime (d->ida, stop) : IDA_SUCCESS;
  d->stop = stop;
  if (flag >= 0) flag = IDASolve (d->ida, stop, &t, d->y, d->yp, IDA_ONE_STEP);
  if (flag < 0) return ida_fail (d, flag, error);
  r->t = flag == IDA_TSTOP_RETURN ? stop : t;
  if (flag == IDA_TSTOP_RETURN) d->stop = NAN;
  ida_read (d, r->q, r->v, r->a, r->lambda);
  if (pw_ida_place (d, r->t, N_VGetArrayPointer (d->y)) != 0) return ida_fail (d, IDA_RES_FAIL, error);
  pw_bound_tolerances (r);
  int status = ida_multipliers (d, r->v, r->a_at, r->lambda);
  if (status < 0) return ida_fail (d, IDA_RES_FAIL, error);
  r->near = status != PW_OK || pw_watchdog_near (r);
  if (r->s->entries > 0 && ida_work (d, status) != 0) return ida_fail (d, IDA_RES_FAIL, error);
  ida_statistics (d);
  return PW_OK;
}

static int ida_at (pw_run *r, double t, pw_error *error) {
  ida_data *d = r->data;
  if (t <= r->t && r->s->entries > 0) pw_quadrature_at (&d->quadrature, r, t);
  int flag = ida_interpolate (d, t);
  if (flag == IDA_BAD_T) return pw_fail_outside (r, NAN, t, error);
  if (flag == IDA_RES_FAIL) return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", t);
  return flag == IDA_SUCCESS ? PW_OK : ida_fail (d, flag, error);
}

static int ida_restart (pw_run *r, pw_error *error) {
  ida_data *d = r->data;
  int flag = IDA_SUCCESS;
  pw_quadrature_restart (&d->quadrature, r);
  ida_fill_vectors (d);
  d->stop = NAN;
  d->begun = r->t;
  d->before = r->statistics;
  if (flag == IDA_SUCCESS) flag = IDASetInitStep (d->ida, pw_first_step (d->run));
  if (flag == IDA_SUCCESS) flag = IDAReInit (d->ida, r->t, d->y, d->yp);
  if (flag == IDA_SUCCESS) return PW_OK;
  return pw_fail (error, PW_METHOD, "t = %.6g s: restart: %s", r->t, pw_sun_reason (&d->said, flag));
}

static const pw_stabilisation ida_stabilisations[] = {
  { "none", "acceleration level: the constraints drift", PW_UNSTABILISED },
  { "baumgarte", "feedback of the residuals into the accelerations (Baumgarte 1972)", PW_BAUMGARTE },
  { "index2", "rates enforced, positions drift", PW_INDEX2 },
  { "ggl", "stabilised index 2: positions and rates both enforced (Gear, Gupta & Leimkuhler 1985)", PW_GGL },
  { "si1", "stabilised index 1: the same, with the multipliers as rates of states in the error test (Gear 1988)",
    PW_SI1 },
  { .name = NULL },
};

static const pw_option ida_options[] = {
  PW_BAUMGARTE_OPTIONS,
  { .name = NULL },
};

const pw_method pw_method_ida = {
  .name = "ida",
  .about = "variable-order BDF on the differential-algebraic equations, SUNDIALS IDAS with KLU (Hindmarsh et al. 2005)",
  .adaptive = 1,
  .stabilisations = ida_stabilisations,
  .options = ida_options,
  .open = ida_open,
  .advance = ida_advance,
  .at = ida_at,
  .restart = ida_restart,
  .close = ida_close,
};
