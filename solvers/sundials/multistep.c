/* BDF and Adams by CVODES; see multistep.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <cvodes/cvodes.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include "between.h"
#include "multistep_state.h"

/* What Newton's iteration may leave, as a part of the tolerance, where the error test sees only what the projection leaves:
 * less than CVODES' own 0.1.  Under stiff damping what it leaves is energy. */
#define MULTISTEP_ITERATED 0.01

/* ---- What CVODES asks for ---- */

int pw_multistep_accelerate (multistep_data *d, double t, const double *y) {
  pw_run *r = d->run;
  int status = pw_accelerate (r, pw_before_breakpoint (r, t), y, y + d->n, d->a, d->lambda);
  return status == PW_OK ? 0 : status > 0 ? 1 : -1;
}

static int multistep_rates (pw_real t, N_Vector vy, N_Vector rates, void *data) {
  multistep_data *d = data;
  const double *y = N_VGetArrayPointer (vy);
  double *out = N_VGetArrayPointer (rates);
  size_t bytes = (size_t)d->n * sizeof *out;
  if (pw_run_asked (d->run)) return -1;
  int flag = pw_multistep_accelerate (d, t, y);
  memcpy (out, y + d->n, bytes);
  memcpy (out + d->n, d->a, bytes);
  return flag;
}

/* Error weights, by unit. */
static int multistep_weights (N_Vector vy, N_Vector weights, void *data) {
  const multistep_data *d = data;
  const pw_run *r = d->run;
  const double *y = N_VGetArrayPointer (vy);
  double *w = N_VGetArrayPointer (weights);
  for (int j = 0; j < d->n; j++) {
    w[j] = 1 / pw_tolerance (r, j, y[j]);
    w[d->n + j] = 1 / pw_tolerance_rate (r, j, y[d->n + j]);
  }
  return 0;
}

/* ---- Projection ---- */

/* Projects (t, q, v): a part of the step, and of its energy.  Returns as pw_project_positions. */
static int multistep_project (multistep_data *d, double t, double *q, double *v) {
  pw_run *r = d->run;
  pw_system *s = r->s;
  int row, status = pw_place (s, t, q, v);
  if (status != PW_OK) return status;
  double worst;
  status = pw_project_positions (&d->projector, r, t, q, v, &row, &worst);
  if (status == PW_OK) status = pw_project_velocities (&d->projector, r, v);
  return status;
}

/* Of the error the part along the constraints counts (Eich 1993), found in the metric of the projection; and, as in
 * rk_adapt.c, a little of the whole: of what is far off the constraints more moves along them than the estimate can tell. */
static void multistep_project_error (multistep_data *d, double *e) {
  pw_run *r = d->run;
  double *whole = d->error, little = sqrt (r->settings.rtol);
  memcpy (whole, e, 2 * (size_t)d->n * sizeof *e);
  pw_project_error (r, d->projector.velocity, e, r->s->holonomic);
  pw_project_error (r, d->projector.velocity, e + d->n, r->s->rows);
  for (int j = 0; j < 2 * d->n; j++) e[j] += little * (whole[j] - e[j]);
}

/* The projection as CVODES calls it. */
static int multistep_correct (pw_real t, N_Vector vy, N_Vector change, pw_real enough, N_Vector error, void *data) {
  multistep_data *d = data;
  const double *y = N_VGetArrayPointer (vy);
  double *out = N_VGetArrayPointer (change);
  size_t bytes = (size_t)d->n * sizeof *y;
  (void)enough; /* to round-off, whatever the tolerance */
  memcpy (d->q, y, bytes);
  memcpy (d->v, y + d->n, bytes);
  int status = multistep_project (d, t, d->q, d->v);
  for (int j = 0; j < d->n; j++) {
    out[j] = d->q[j] - y[j];
    out[d->n + j] = d->v[j] - y[d->n + j];
  }
  if (status == PW_OK && error) multistep_project_error (d, N_VGetArrayPointer (error));
  return status == PW_OK ? 0 : status > 0 ? 1 : -1;
}

/* ---- Accelerations of the state reached, and inside the last step ---- */

/* Accelerations and multipliers of the state reached; no part of the run's cost. */
static int multistep_settle (multistep_data *d) {
  pw_run *r = d->run;
  if (d->settled) return PW_OK;
  pw_statistics keep = r->statistics;
  int near = r->near;
  r->refuse = 0;
  int status = pw_accelerate (r, pw_before_breakpoint (r, r->t), r->q, r->v, r->a, r->lambda);
  r->refuse = r->limits.rank;
  r->statistics = keep;
  r->near = near;
  d->settled = status == PW_OK;
  return status;
}

/* Of the polynomial's value at t, projected where the method projects, the rest of the sample. */
static int multistep_complete (multistep_data *d, double t) {
  pw_run *r = d->run;
  int status = PW_OK;
  pw_statistics keep = r->statistics;
  r->refuse = 0;
  if (d->projects) status = multistep_project (d, t, r->q_at, r->v_at);
  if (status == PW_OK) status = pw_accelerate (r, t, r->q_at, r->v_at, r->a_at, r->lambda_at);
  r->refuse = r->limits.rank;
  r->statistics = keep;
  return status;
}

/* The polynomial's value at t, into the sample arrays.  CV_SUCCESS or CV_BAD_T. */
static int multistep_interpolate (multistep_data *d, double t) {
  pw_run *r = d->run;
  int flag = t < r->t ? CVodeGetDky (d->cvode, t, 0, d->y) : CV_BAD_T;
  const double *y = N_VGetArrayPointer (d->y);
  if (flag != CV_SUCCESS) return flag;
  memcpy (r->q_at, y, (size_t)d->n * sizeof *y);
  memcpy (r->v_at, y + d->n, (size_t)d->n * sizeof *y);
  return flag;
}

static int multistep_power (pw_run *r, double t, double *rate) {
  int near = r->near, status = multistep_interpolate (r->data, t) == CV_SUCCESS ? PW_OK : PW_RETRY;
  if (status == PW_OK) status = multistep_complete (r->data, t);
  r->near = near;
  if (status == PW_OK) pw_sweep_ledger (r->s, r->lambda_at, rate);
  return status;
}

/* ---- Opening ---- */

static void multistep_fill (multistep_data *d) {
  const pw_run *r = d->run;
  size_t bytes = (size_t)d->n * sizeof (double);
  double *y = N_VGetArrayPointer (d->y);
  memcpy (y, r->q, bytes);
  memcpy (y + d->n, r->v, bytes);
  d->stop = NAN;
  d->settled = 1;
  d->begun = r->t;
  d->steps = r->statistics.steps;
  d->rejected = r->statistics.rejected;
}

static int multistep_no_memory (const pw_run *r, pw_error *error) {
  return pw_fail (error, PW_MACHINE, "model %s: out of memory in %s", r->s->model, r->method->name);
}

static int multistep_open_arrays (multistep_data *d) {
  const pw_run *r = d->run;
  const pw_system *s = r->s;
  size_t n = (size_t)d->n + 3;
  if (pw_sun_open (&d->context, 2 * d->n) != PW_OK) return PW_MACHINE;
  d->y = pw_sun_vector (2 * d->n, d->context);
  d->q = calloc (5 * n + (size_t)s->rows, sizeof *d->q);
  if (!d->y || !d->q) return PW_MACHINE;
  d->v = d->q + n, d->a = d->v + n, d->error = d->a + n, d->lambda = d->error + 2 * n;
  memcpy (d->v, r->v, (size_t)d->n * sizeof *d->v);
  memcpy (d->a, r->a, (size_t)d->n * sizeof *d->a);
  memcpy (d->lambda, r->lambda, (size_t)s->rows * sizeof *d->lambda);
  multistep_fill (d);
  return PW_OK;
}

static int multistep_open_iteration (multistep_data *d, int formula) {
  int newton = formula == CV_BDF;
  if (newton && pw_multistep_open_newton (d) != PW_OK) return PW_MACHINE;
  if (newton && !d->run->s->saturates) return PW_OK;
  d->iteration = newton ? SUNNonlinSol_Newton (d->y, d->context) : SUNNonlinSol_FixedPoint (d->y, 0, d->context);
  if (d->iteration == NULL || CVodeSetNonlinearSolver (d->cvode, d->iteration) != CV_SUCCESS) return PW_MACHINE;
  if (newton && pw_sun_test_newton (d->iteration, &d->correction) != SUN_NLS_SUCCESS) return PW_MACHINE;
  return PW_OK;
}

static int multistep_open_solver (multistep_data *d, int formula) {
  pw_run *r = d->run;
  int flag = 0;
  d->cvode = CVodeCreate (formula, d->context);
  if (d->cvode == NULL) return PW_MACHINE;
  if (flag == CV_SUCCESS) flag = CVodeSetErrHandlerFn (d->cvode, pw_sun_message, &d->said);
  if (flag == CV_SUCCESS) flag = CVodeSetUserData (d->cvode, d);
  if (flag == CV_SUCCESS) flag = CVodeInit (d->cvode, multistep_rates, r->t, d->y);
  if (flag == CV_SUCCESS) flag = CVodeWFtolerances (d->cvode, multistep_weights);
  if (flag == CV_SUCCESS) flag = CVodeSetMaxNumSteps (d->cvode, -1);
  if (flag == CV_SUCCESS) flag = CVodeSetMaxConvFails (d->cvode, PW_SUN_ATTEMPTS);
  if (flag == CV_SUCCESS) flag = CVodeSetMaxErrTestFails (d->cvode, PW_SUN_ATTEMPTS);
  if (flag == CV_SUCCESS) flag = CVodeSetInitStep (d->cvode, pw_first_step (r));
  if ((d->projects || r->s->saturates) && flag == CV_SUCCESS)
    flag = CVodeSetNonlinConvCoef (d->cvode, MULTISTEP_ITERATED);
  if (d->projects) {
    if (flag == CV_SUCCESS) flag = CVodeSetProjFn (d->cvode, multistep_correct);
    if (flag == CV_SUCCESS) flag = CVodeSetProjFrequency (d->cvode, (long)pw_option_value (r, "every"));
  }
  return flag == 0 ? multistep_open_iteration (d, formula) : PW_MACHINE;
}

int pw_multistep_open (pw_run *r, int formula, pw_error *error) {
  multistep_data *d = r->data = calloc (1, sizeof *d);
  if (d == NULL) return pw_fail (error, PW_MACHINE, "model %s: out of memory", r->s->model);
  d->run = r;
  d->n = r->s->coords;
  d->projects = pw_stabilised_by (r, PW_PROJECTION);
  pw_read_baumgarte (r);
  int status = d->projects ? pw_projector_open_asked (&d->projector, r, error) : PW_OK;
  if (status != PW_OK) return status;
  if (multistep_open_arrays (d) == PW_OK && multistep_open_solver (d, formula) == PW_OK &&
      pw_quadrature_open (&d->quadrature, r, multistep_power) == PW_OK)
    return PW_OK;
  return multistep_no_memory (r, error);
}

void pw_multistep_close (pw_run *r) {
  multistep_data *d = r->data;
  if (d->cvode) CVodeFree (&d->cvode);
  if (d->iteration) SUNNonlinSolFree (d->iteration);
  pw_multistep_close_newton (d);
  if (d->y) N_VDestroy (d->y);
  if (d->context) SUNContext_Free (&d->context);
  if (d->projects) pw_projector_close (&d->projector);
  pw_quadrature_close (&d->quadrature);
  free (d->q);
  free (d);
}

/* ---- Advancing ---- */

static void multistep_count (multistep_data *d) {
  pw_statistics *s = &d->run->statistics;
  long steps = 0, tests = 0, iterations = 0, projections = 0;
  CVodeGetNumSteps (d->cvode, &steps);
  CVodeGetNumErrTestFails (d->cvode, &tests);
  CVodeGetNumNonlinSolvConvFails (d->cvode, &iterations);
  if (d->projects) CVodeGetNumProjFails (d->cvode, &projections);
  s->steps = d->steps + steps;
  s->rejected = d->rejected + tests + iterations + projections;
}

static int multistep_fail (multistep_data *d, int flag, pw_error *error) {
  pw_run *r = d->run;
  char element[120];
  if (d->run->stopped) return d->run->interrupted = 1, PW_STOPPED;
  int singular = flag == CV_FIRST_RHSFUNC_ERR || flag == CV_REPTD_RHSFUNC_ERR || flag == CV_UNREC_RHSFUNC_ERR;
  multistep_count (d);
  if (flag == CV_REPTD_PROJFUNC_ERR && d->projector.against >= 0)
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s contradicts the other constraints", r->t,
                    pw_row_element (r->s, d->projector.against, element, sizeof element));
  if (flag == CV_LSETUP_FAIL && pw_sun_lacks_memory (d->newton.klu)) return multistep_no_memory (r, error);
  if (singular || pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  const char *why = flag == CV_ERR_FAILURE          ? "the error test fails however small the step"
                    : flag == CV_CONV_FAILURE       ? "the iteration does not converge however small the step"
                    : flag == CV_LSETUP_FAIL        ? "the Newton matrix is singular"
                    : flag == CV_RHSFUNC_FAIL       ? "a signal failed"
                    : flag == CV_PROJFUNC_FAIL      ? "a signal failed"
                    : flag == CV_REPTD_PROJFUNC_ERR ? "the projection does not converge however small the step"
                    : flag == CV_TOO_MUCH_ACC       ? "the tolerance is beyond the accuracy of the machine"
                                                    : pw_sun_reason (&d->said, flag);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s (rtol %.3g)", r->t, why, r->settings.rtol);
}

/* The same where the system is placed, J swept.  In a singular pose multipliers stay those of the last iterate. */
static void multistep_settle_placed (multistep_data *d) {
  pw_run *r = d->run;
  pw_statistics keep = r->statistics;
  r->refuse = 0;
  pw_sweep_gamma (r->s, r->lambda);
  d->settled = pw_accelerate_swept (r, r->v, r->a, r->lambda) == PW_OK;
  if (!d->settled) memcpy (r->lambda, d->lambda, (size_t)r->s->rows * sizeof *r->lambda);
  r->refuse = r->limits.rank;
  r->statistics = keep;
}

/* Work and losses up to the state reached.  Multipliers of Newton's last iterate, which may be the first, are not good enough
 * for them. */
static int multistep_work (multistep_data *d) {
  pw_run *r = d->run;
  int order = 1;
  if (d->newton.klu && pw_ledger_reacts (r->s)) multistep_settle_placed (d);
  pw_sweep_ledger (r->s, r->lambda, r->rate);
  CVodeGetLastOrder (d->cvode, &order);
  if (!pw_quadrature_step (&d->quadrature, r, order)) return PW_OK;
  int status = pw_place (r->s, pw_before_breakpoint (r, r->t), r->q, r->v);
  pw_sweep_J (r->s);
  return status;
}

/* The state reached, out of y, and the ledger.  Its accelerations are those of the last iterate until they are asked for
 * (multistep_settle): one evaluation in three. */
static int multistep_reach (multistep_data *d, double t, pw_error *error) {
  pw_run *r = d->run;
  const double *y = N_VGetArrayPointer (d->y);
  memcpy (r->q, y, (size_t)d->n * sizeof *y);
  memcpy (r->v, y + d->n, (size_t)d->n * sizeof *y);
  memcpy (r->a, d->a, (size_t)d->n * sizeof *y);
  memcpy (r->lambda, d->lambda, (size_t)r->s->rows * sizeof *y);
  r->t = t;
  pw_forget_residuals (r);
  d->settled = 0;
  if (pw_place (r->s, pw_before_breakpoint (r, t), r->q, r->v) != PW_OK)
    return multistep_fail (d, CV_RHSFUNC_FAIL, error);
  pw_sweep_J (r->s);
  pw_bound_tolerances (r);
  if (r->s->entries > 0 && multistep_work (d) != PW_OK) return multistep_fail (d, CV_RHSFUNC_FAIL, error);
  return PW_OK;
}

int pw_multistep_advance (pw_run *r, double t_end, pw_error *error) {
  multistep_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), t = r->t;
  int flag = stop != d->stop ? CVodeSetStopTime (d->cvode, stop) : CV_SUCCESS;
  d->stop = stop;
  r->near = 0;
  if (flag >= 0) flag = CVode (d->cvode, stop, d->y, &t, CV_ONE_STEP);
  if (flag < 0) return multistep_fail (d, flag, error);
  if (flag == CV_TSTOP_RETURN) d->stop = NAN;
  multistep_count (d);
  return multistep_reach (d, flag == CV_TSTOP_RETURN ? stop : t, error);
}

/* ---- Looking into the last step ---- */

static int multistep_at_fails (pw_run *r, int status, double t, pw_error *error) {
  if (status > 0) return pw_fail_singular (r, t, error);
  return status == PW_OK ? PW_OK : pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", t);
}

int pw_multistep_at (pw_run *r, double t, pw_error *error) {
  multistep_data *d = r->data;
  if (t == r->t) {
    int status = multistep_settle (d);
    if (status == PW_OK) pw_show_reached (r);
    return multistep_at_fails (r, status, t, error);
  }
  if (t < r->t && r->s->entries > 0) pw_quadrature_at (&d->quadrature, r, t);
  int flag = multistep_interpolate (d, t);
  if (flag == CV_BAD_T) return pw_fail_outside (r, NAN, t, error);
  if (flag != CV_SUCCESS) return multistep_fail (d, flag, error);
  return multistep_at_fails (r, multistep_complete (d, t), t, error);
}

int pw_multistep_restart (pw_run *r, pw_error *error) {
  multistep_data *d = r->data;
  multistep_fill (d);
  int flag = CVodeReInit (d->cvode, r->t, d->y);
  if (flag == CV_SUCCESS) flag = CVodeSetInitStep (d->cvode, pw_first_step (r));
  pw_quadrature_restart (&d->quadrature, r);
  if (flag == CV_SUCCESS) return PW_OK;
  return pw_fail (error, PW_METHOD, "t = %.6g s: restart: %s", r->t, pw_sun_reason (&d->said, flag));
}
