/* ida: the variable-order BDF code IDAS of SUNDIALS (Hindmarsh et al. 2005), on the equations of tangent.h.
 *
 * The Newton matrix is exact and sparse, factorised by KLU.  The error test covers positions and velocities, including
 * those of massless coordinates; in si1 it covers all unknowns. */
#include <stdlib.h>
#include <idas/idas.h>
#include "dense_output.h"
#include "rank.h"
#include "sundials.h"

struct pw_method_data {
  pw_sun sun; /* first */
  void *ida;
  pw_dae dae;
  N_Vector yp, id; /* y'; 1 for unknowns that are in the error test */
  double *unit;    /* active rows: 1 for a force, L for a moment */
};

static int ida_update (pw_method_data *d, double t, const double *y) {
  return pw_evaluate_J_at (d->sun.run->w, pw_before_breakpoint (d->sun.run, t), y, y + d->dae.n);
}

/* The multipliers of the independent equations, among the unknowns or among their derivatives. */
static const double *ida_lambda (const pw_method_data *d, const double *y, const double *yp) {
  return (d->dae.integrates_multipliers ? yp : y) + 2 * d->dae.n;
}

/* Called by IDA: F (t, y, y'). */
static int ida_residual (realtype t, N_Vector vy, N_Vector vyp, N_Vector out, void *data) {
  pw_method_data *d = data;
  int n = d->dae.n;
  const double *y = N_VGetArrayPointer (vy), *yp = N_VGetArrayPointer (vyp);
  double *F = N_VGetArrayPointer (out);
  if (pw_run_stop_requested (d->sun.run) || ida_update (d, t, y) != PW_OK) return -1;
  pw_dae_residual (&d->dae, y + n, yp + n, ida_lambda (d, y, yp), F);
  for (int j = 0; j < n; j++) F[j] += yp[j] - y[n + j];
  return 0;
}

/* Called by IDA: dF/dy + c dF/dy'. */
static int ida_matrix (realtype t, realtype c, N_Vector vy, N_Vector vyp, N_Vector residual, SUNMatrix matrix,
                       void *data, N_Vector tmp1, N_Vector tmp2, N_Vector tmp3) {
  pw_method_data *d = data;
  pw_tangent *x = &d->dae.tangent;
  const double *y = N_VGetArrayPointer (vy), *yp = N_VGetArrayPointer (vyp), *v = y + d->dae.n;
  (void)residual, (void)matrix, (void)tmp1, (void)tmp2, (void)tmp3;
  if (ida_update (d, t, y) != PW_OK) return -1;
  pw_scatter_begin_fill (&x->scatter, x->scatter.value);
  pw_dae_matrix (&d->dae, v, yp + d->dae.n, ida_lambda (d, y, yp), c, c);
  pw_matrix_evaluated (d->sun.run, y, v);
  return 0;
}

/* The scale of forces [N]: from the masses, else from the multipliers, else 1. */
static double ida_force_scale (const pw_run *r) {
  const pw_system *s = r->s;
  double L = s->scale.length, T = r->w->scale.time, force = 0;
  for (int j = 0; j < s->coords; j++) force = fmax (force, s->M[j] / (T * T) * (pw_is_angle (s, j) ? 1 / L : L));
  if (force > 0) return force;
  for (int i = 0; i < s->rows; i++) force = fmax (force, fabs (r->lambda[i]));
  return force > 0 ? force : 1;
}

/* Called by IDA: error weights.  Those of lambda and mu use the scales of forces and of velocities, times L where the
 * equation is one of angles.
 *
 * Where J v = eta is enforced, corrections of lambda and mu are those of v and q divided by the step.  Outside the
 * error test, their tolerances are therefore multiplied by c T, for the test of convergence, with the c of the matrix
 * dF/dy + c dF/dy' of the current step, 1 / h before the first, but at least 1 / T.  In si1 the unknowns are
 * the integrals of the multipliers, whose tolerances are those of the multipliers times T, with lambda of the previous
 * step. */
static int ida_weigh (N_Vector vy, N_Vector weights, void *data) {
  pw_method_data *d = data;
  const pw_run *r = d->sun.run;
  const pw_settings *set = &r->settings;
  const double *y = N_VGetArrayPointer (vy);
  int relaxed = d->dae.enforces_velocities && !d->dae.integrates_multipliers;
  double *w = N_VGetArrayPointer (weights), force = ida_force_scale (r);
  double L = r->s->scale.length, T = r->w->scale.time, c = 0;
  int is_known = relaxed && r->t != d->sun.t0 && IDAGetCurrentCj (d->ida, &c) == IDA_SUCCESS && c != 0;
  if (relaxed && !is_known) c = 1 / pw_first_step (r);
  double relax = d->dae.integrates_multipliers ? T : fmax (c, 1 / T) * T,
         mu = (set->atol > 0 ? set->atol : set->rtol * L / T) * relax;
  pw_sun_weigh (&d->sun, y, w);
  for (int i = 0; i < d->dae.rows; i++) {
    double lambda = d->dae.integrates_multipliers ? r->lambda[d->dae.tangent.row[i]] : y[2 * d->dae.n + i];
    w[2 * d->dae.n + i] = 1 / (relax * set->rtol * (fabs (lambda) + force * d->unit[i]));
  }
  for (int i = 0; i < d->dae.mu_count; i++) w[2 * d->dae.n + d->dae.rows + i] = 1 / (mu * d->unit[i]);
  return 0;
}

static void ida_fill_vectors (pw_method_data *d) {
  const pw_run *r = d->sun.run;
  size_t n = (size_t)d->dae.n;
  double *y = N_VGetArrayPointer (d->sun.y), *yp = N_VGetArrayPointer (d->yp);
  memset (y, 0, (size_t)d->dae.size * sizeof *y);
  memset (yp, 0, (size_t)d->dae.size * sizeof *y);
  memcpy (y, r->q, n * sizeof *y);
  memcpy (y + n, r->v, n * sizeof *y);
  pw_tangent_compress (&d->dae.tangent, r->lambda, d->dae.rows, (d->dae.integrates_multipliers ? yp : y) + 2 * n);
  memcpy (yp, r->v, n * sizeof *y);
  memcpy (yp + n, r->a, n * sizeof *y);
}

/* Copies (q, v, a, lambda) from y and y'. */
static void ida_read (const pw_method_data *d, double *q, double *v, double *a, double *lambda) {
  size_t n = (size_t)d->dae.n;
  const double *y = N_VGetArrayPointer (d->sun.y), *yp = N_VGetArrayPointer (d->yp);
  memcpy (q, y, n * sizeof *q);
  memcpy (v, y + n, n * sizeof *v);
  memcpy (a, yp + n, n * sizeof *a);
  pw_tangent_expand (&d->dae.tangent, ida_lambda (d, y, yp), d->dae.rows, lambda);
}

/* Interpolates the state at t into the sample arrays and updates kinematics and J.  Accelerations and multipliers are
 * computed from the state, since IDA's error test does not control those of IDA, which remain only in singular
 * configurations.  Returns an IDA flag. */
static int ida_interpolate (pw_method_data *d, double t) {
  pw_run *r = d->sun.run;
  long steps = 0;
  int flag = IDAGetNumSteps (d->ida, &steps);
  if (flag == IDA_SUCCESS && (steps == 0 ? t != r->t : t > r->t)) flag = IDA_BAD_T;
  if (steps == 0) ida_fill_vectors (d); /* the state at the start or the last restart */
  if (flag == IDA_SUCCESS && steps > 0) flag = IDAGetDky (d->ida, t, 1, d->yp);
  if (flag == IDA_SUCCESS && steps > 0) flag = IDAGetDky (d->ida, t, 0, d->sun.y);
  if (flag != IDA_SUCCESS) return flag;
  ida_read (d, r->q_at, r->v_at, r->a_at, r->lambda_at);
  if (ida_update (d, t, N_VGetArrayPointer (d->sun.y)) != PW_OK) return IDA_RES_FAIL;
  const pw_statistics statistics = r->statistics;
  if (pw_saddle_factor (r->saddle) == PW_OK) pw_run_accelerate_updated (r, r->v_at, r->a_at, r->lambda_at);
  r->statistics = statistics;
  return IDA_SUCCESS;
}

static int ida_power (pw_run *r, double t, double *rate) {
  int flag = ida_interpolate (r->data, t);
  if (flag == IDA_SUCCESS) pw_ledger_rates (r, r->lambda_at, rate);
  return flag == IDA_SUCCESS ? PW_OK : PW_RETRY;
}

static int ida_open_vectors (pw_method_data *d, pw_run *r) {
  if (pw_sun_open (&d->sun, r, d->dae.size, ida_power) != PW_OK) return PW_RESOURCE;
  d->yp = pw_sun_vector (d->dae.size, d->sun.context);
  d->id = pw_sun_vector (d->dae.size, d->sun.context);
  d->unit = calloc ((size_t)d->dae.rows + 1, sizeof *d->unit);
  if (!d->yp || !d->id || !d->unit) return PW_RESOURCE;
  for (int i = 0; i < d->dae.rows; i++) d->unit[i] = pw_rank_multiplier_unit (d->sun.run->w, d->dae.tangent.row[i]);
  for (int i = 0; i < d->dae.size; i++)
    N_VGetArrayPointer (d->id)[i] = i < 2 * d->dae.n || d->dae.integrates_multipliers;
  ida_fill_vectors (d);
  return PW_OK;
}

/* Where positions and velocities are enforced: the least factor by which a step grows, while IDA only doubles it by
 * default.  The estimates of the error then need more accurate Newton iterations (the error that may remain, over the
 * tolerance of the error test) and more matrices (the relative change of c from which on there is a new one).  Growth
 * by 1.1 is unstable. */
#define IDA_GROWTH 1.3
#define IDA_CONVERGENCE 0.1
#define IDA_CHANGE 0.1

static int ida_open_integrator (pw_method_data *d) {
  pw_sun *x = &d->sun;
  void *m = d->ida = IDACreate (x->context);
  if (m == NULL || IDASetErrHandlerFn (m, pw_sun_message, x) || IDASetUserData (m, d) ||
      IDAInit (m, ida_residual, x->run->t, x->y, d->yp) || IDAWFtolerances (m, ida_weigh) || IDASetId (m, d->id) ||
      IDASetSuppressAlg (m, 1) || IDASetMaxNumSteps (m, -1) || IDASetMaxConvFails (m, PW_SUN_ATTEMPTS) ||
      IDASetMaxErrTestFails (m, PW_SUN_ATTEMPTS) || IDASetInitStep (m, pw_first_step (x->run)) ||
      IDASetLinearSolver (m, x->solver, x->matrix) || IDASetJacFn (m, ida_matrix))
    return PW_RESOURCE;
  if (d->dae.enforces_positions && d->dae.enforces_velocities &&
      (IDASetEtaFixedStepBounds (m, 1, IDA_GROWTH) || IDASetNonlinConvCoef (m, IDA_CONVERGENCE) ||
       IDASetDeltaCjLSetup (m, IDA_CHANGE)))
    return PW_RESOURCE;
  if (!x->run->s->saturates) return PW_OK;
  x->iteration = SUNNonlinSol_Newton (x->y, x->context);
  if (x->iteration == NULL || IDASetNonlinearSolver (m, x->iteration)) return PW_RESOURCE;
  return pw_sun_test_newton (x);
}

static int ida_open (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  if (d == NULL) return pw_sun_no_memory (r, error);
  if (pw_dae_open (&d->dae, r) != PW_OK || ida_open_vectors (d, r) != PW_OK) return pw_sun_no_memory (r, error);
  const double *y = N_VGetArrayPointer (d->sun.y), *yp = N_VGetArrayPointer (d->yp);
  if (pw_dae_lay_out (&d->dae, y + d->dae.n, yp + d->dae.n, ida_lambda (d, y, yp)) != PW_OK ||
      pw_sun_open_solver (&d->sun, d->dae.size, &d->dae.tangent.scatter, d, NULL) != PW_OK ||
      ida_open_integrator (d) != PW_OK)
    return pw_sun_no_memory (r, error);
  if (r->statistics.steps == 0)
    d->sun.before = (pw_statistics){ 0 }; /* without evaluations of the initial conditions */
  return PW_OK;
}

static void ida_close (pw_run *r) {
  pw_method_data *d = r->data;
  if (d->ida) IDAFree (&d->ida);
  if (d->yp) N_VDestroy (d->yp);
  if (d->id) N_VDestroy (d->id);
  pw_sun_close (&d->sun);
  pw_dae_close (&d->dae);
  free (d->unit);
  free (d);
}

static void ida_statistics (pw_method_data *d) {
  pw_statistics *s = &d->sun.run->statistics, now = { 0 };
  const pw_statistics *before = &d->sun.before;
  long tests = 0, newton = 0; /* failed */
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

static int ida_fail (pw_method_data *d, int flag, pw_error *error) {
  if (!d->sun.run->stopped) ida_statistics (d);
  return pw_sun_fail (&d->sun, flag, 0, NULL, error);
}

static int ida_restart (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data;
  pw_sun_restart (&d->sun);
  ida_fill_vectors (d);
  int flag = IDASetInitStep (d->ida, pw_first_step (r));
  if (flag == IDA_SUCCESS) flag = IDAReInit (d->ida, r->t, d->sun.y, d->yp);
  return flag == IDA_SUCCESS ? PW_OK : pw_sun_fail_restart (&d->sun, flag, error);
}

/* Makes (y, y') the state reached and updates the ledger.  With J v = eta, the multipliers are IDA's.  On acceleration
 * level, only the Newton iteration determines those of prescribed motions, and they may drift without effect on the
 * motion: there all are recomputed.  For the ledger they are, too: those of IDA are not accurate enough to be
 * integrated.  PW_METHOD if a signal failed. */
static int ida_reach (pw_method_data *d) {
  pw_run *r = d->sun.run;
  ida_read (d, r->q, r->v, r->a, r->lambda);
  int status = ida_update (d, r->t, N_VGetArrayPointer (d->sun.y));
  if (status != PW_OK) return status;
  pw_bound_tolerances (r);
  status = pw_saddle_factor (r->saddle);
  if (status < 0) return status;
  if (status == PW_OK && !d->dae.enforces_velocities) pw_run_accelerate_updated (r, r->v, r->a_at, r->lambda);
  r->near_singular = status != PW_OK || pw_watchdog_near (r);
  if (r->entries == 0) return PW_OK;
  const int recomputes = status == PW_OK && d->dae.enforces_velocities && pw_ledger_uses_multipliers (r);
  int order = 1;
  if (recomputes) pw_run_accelerate_updated (r, r->v, r->a_at, r->lambda_at);
  pw_ledger_rates (r, recomputes ? r->lambda_at : r->lambda, r->rate);
  IDAGetLastOrder (d->ida, &order);
  return pw_sun_integrate_ledger (&d->sun, order);
}

static int ida_advance (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  double stop = fmin (t_end, r->breakpoint), t = r->t;
  int flag = IDASetStopTime (d->ida, stop);
  if (flag >= 0) flag = IDASolve (d->ida, stop, &t, d->sun.y, d->yp, IDA_ONE_STEP);
  if (flag < 0) return ida_fail (d, flag, error);
  r->t = flag == IDA_TSTOP_RETURN ? stop : t;
  if (ida_reach (d) != PW_OK) return ida_fail (d, IDA_RES_FAIL, error);
  ida_statistics (d);
  return PW_OK;
}

static int ida_at (pw_run *r, double t, pw_error *error) {
  pw_method_data *d = r->data;
  if (t <= r->t && r->entries > 0) pw_sun_ledger_at (&d->sun, t);
  int flag = ida_interpolate (d, t);
  if (flag == IDA_BAD_T) return pw_fail_outside (r, NAN, t, error);
  if (flag == IDA_RES_FAIL) return pw_fail_signal (t, error);
  return flag == IDA_SUCCESS ? PW_OK : ida_fail (d, flag, error);
}

static const pw_stabilisation ida_stabilisations[] = {
  { "none", "acceleration level: the constraints drift", PW_UNSTABILISED },
  { "baumgarte", "feedback of the residuals into the accelerations (Baumgarte 1972)", PW_BAUMGARTE },
  { "index2", "velocities enforced, positions drift", PW_INDEX2 },
  { "ggl", "stabilised index 2: positions and velocities both enforced (Gear, Gupta & Leimkuhler 1985)", PW_GGL },
  { "si1", "stabilised index 1: the same, with the multipliers as derivatives of states, in the error test (Gear 1988)",
    PW_SI1 },
  { .name = NULL },
};

static const pw_option ida_options[] = { PW_BAUMGARTE_OPTIONS, { .name = NULL } };

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
