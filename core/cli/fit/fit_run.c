/* Runs of a fit, which give the model's values at the times of the data; derivatives of these values with respect to
 * the unknowns, from the variational equations or else from differences. */
#define _POSIX_C_SOURCE 200809L
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fit.h"
#include "parallel.h"

#define JACOBIAN_ERROR 1e-8 /* least relative error of derivatives from the variational equations */

/* ---- Runs ---- */

/* Stores the columns at the times of the data in `out`, columns x rows. */
static int fit_sample (const pw_fit *fit, pw_outcomes *outcomes, pw_run *run, double *out, pw_error *error) {
  pw_sample sample;
  int status = PW_OK;
  for (int k = 0; k < fit->rows && status == PW_OK; k++) {
    status = pw_run_advance_to (run, fit->t[k], fit->unknowns.t_end, error);
    if (status == PW_OK) status = pw_run_sample (run, fit->t[k], &sample, error);
    if (status == PW_OK) status = pw_outcomes_read (outcomes, &sample, 0, error);
    for (int i = 0; i < fit->columns && status == PW_OK; i++)
      out[i * fit->rows + k] = outcomes->functional[outcomes->outcome[i].term[0]].values[0];
  }
  return status;
}

int pw_fit_run (const pw_fit *fit, const double *unknowns, double *out, pw_error *error) {
  pw_outcomes outcomes = { .system = NULL };
  pw_unknown_run run;
  int status = pw_unknown_run_prepare (&run, &fit->unknowns, unknowns, error);
  if (status == PW_OK)
    status = pw_outcomes_open (&outcomes, run.m.system, "--columns", fit->column_name, fit->columns, error);
  run.settings.ledger = outcomes.ledger;
  if (status == PW_OK) run.run = pw_run_open (run.m.system, fit->unknowns.method, &run.settings, error);
  if (status == PW_OK) status = run.run ? fit_sample (fit, &outcomes, run.run, out, error) : error->status;
  if (status == PW_STOPPED) status = pw_limit_status (&run.limit, pw_run_time (run.run), error);
  pw_outcomes_close (&outcomes);
  pw_unknown_run_close (&run);
  return status;
}

/* ---- Differences ---- */

/* Relative noise of the model's values as functions of the unknowns: the tolerance of an adaptive method, or round-off
 * with fixed steps. */
static double jacobian_noise (const pw_fit *fit) {
  return pw_cli_adaptive (fit->unknowns.method) == 1 ? fit->unknowns.settings.rtol : DBL_EPSILON;
}

double pw_fit_derivative_error (const pw_fit *fit) {
  double noise = jacobian_noise (fit);
  return fit->by_differences ? pow (noise, 2. / 3) : fmax (noise, JACOBIAN_ERROR);
}

/* Runs on both sides of each unknown: task 2 j is the run below unknown j, task 2 j + 1 that above it. */
typedef struct {
  const pw_fit *fit;
  double *unknowns, *values, *step; /* of each task: unknowns, values of the model, signed step */
  pw_error *error;                  /* of each task */
} jacobian_differences;

/* The step h, relative to the value or, if that is larger, to a hundredth of the scale, is the cube root of the noise:
 * the truncation error of central differences, of order h^2, and noise / h are both noise^(2/3). */
static int jacobian_side (void *context, int task, pw_error *error) {
  jacobian_differences *d = context;
  const pw_fit *fit = d->fit;
  const pw_unknown *unknown = fit->unknowns.list + task / 2;
  double *unknowns = d->unknowns + task * fit->unknowns.count, *value = unknowns + task / 2, middle = *value;
  double size = fmax (fabs (middle), 1e-2 * unknown->scale) * cbrt (jacobian_noise (fit));
  *value = fmin (fmax (middle + (task % 2 ? size : -size), unknown->low), unknown->high);
  d->step[task] = *value - middle;
  (void)error;
  double *values = d->values + (size_t)task * (size_t)fit->columns * (size_t)fit->rows;
  d->error[task].status = pw_fit_run (fit, unknowns, values, d->error + task);
  return PW_OK; /* see jacobian_column */
}

/* Derivatives with respect to unknown j by central differences; by one-sided ones if the run on one side failed and no
 * bound leaves less than a tenth of the step on the other side.  middle: the values of the model between both sides. */
static int jacobian_column (const jacobian_differences *d, int j, const double *middle, double *out, pw_error *error) {
  size_t cells = (size_t)d->fit->columns * (size_t)d->fit->rows;
  const double *side[2];
  double step[2];
  for (int k = 0; k < 2; k++) {
    const pw_error *own = d->error + 2 * j + k, *other = d->error + 2 * j + !k;
    int failed = own->status != PW_OK, pinched = fabs (d->step[2 * j + !k]) < fabs (d->step[2 * j + k]) / 10;
    if (failed && (own->status == PW_RETRY || own->status == PW_RESOURCE || other->status != PW_OK || pinched))
      return *error = *own, error->status;
    side[k] = failed ? middle : d->values + (size_t)(2 * j + k) * cells;
    step[k] = failed ? 0 : d->step[2 * j + k];
  }
  for (size_t i = 0; i < cells; i++) out[i] = (side[1][i] - side[0][i]) / (step[1] - step[0]);
  return PW_OK;
}

static int jacobian_by_differences (pw_fit *fit, const double *unknowns, const double *values, double *jacobian,
                                    pw_error *error) {
  size_t n = (size_t)fit->unknowns.count, cells = (size_t)fit->columns * (size_t)fit->rows;
  jacobian_differences d = { .fit = fit, .unknowns = malloc (2 * n * (n + cells + 1) * sizeof *d.unknowns) };
  d.error = calloc (2 * n, sizeof *d.error);
  int status = d.unknowns && d.error ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) {
    d.values = d.unknowns + 2 * n * n, d.step = d.values + 2 * n * cells;
    for (size_t task = 0; task < 2 * n; task++) memcpy (d.unknowns + task * n, unknowns, n * sizeof *unknowns);
    status = pw_parallel (fit->jobs, (int)(2 * n), jacobian_side, &d, error);
    fit->runs += 2 * (long)n;
  }
  for (int j = 0; j < fit->unknowns.count && status == PW_OK; j++)
    status = jacobian_column (&d, j, values, jacobian + (size_t)j * cells, error);
  free (d.unknowns);
  free (d.error);
  return status;
}

/* ---- Variational equations ---- */

/* Stores the derivatives at the time of a row of the data. */
static int jacobian_row (pw_sensitivity *s, const pw_fit *fit, int row, double *jacobian, pw_error *error) {
  const int n = fit->unknowns.count;
  int status = pw_sensitivity_at (s, fit->t[row], error);
  for (int i = 0; i < fit->columns && status == PW_OK; i++) {
    const double *slope = s->slope + s->outcomes.outcome[i].term[0] * n;
    for (int j = 0; j < n; j++) {
      if (!isfinite (slope[j])) return pw_fail (error, PW_METHOD, "%s has no derivative", fit->column_name[i]);
      jacobian[((size_t)j * (size_t)fit->columns + (size_t)i) * (size_t)fit->rows + (size_t)row] = slope[j];
    }
  }
  return status;
}

static int jacobian_by_variation (const pw_fit *fit, const double *unknowns, double *jacobian, pw_error *error) {
  pw_sensitivity s = { .of = fit->column_name, .unknowns = fit->unknowns, .no_error = 1 };
  int status = pw_sensitivity_start (&s, unknowns, error);
  for (int row = 0; row < fit->rows && status == PW_OK; row++) status = jacobian_row (&s, fit, row, jacobian, error);
  if (status == PW_STOPPED) status = pw_limit_status (&s.base.limit, pw_run_time (s.base.run), error);
  pw_sensitivity_close (&s);
  return status;
}

int pw_fit_jacobian (pw_fit *fit, const double *unknowns, const double *values, double *jacobian, pw_error *error) {
  pw_error own = { 0 };
  int status = fit->by_differences ? PW_METHOD : jacobian_by_variation (fit, unknowns, jacobian, &own);
  if (status == PW_RESOURCE) *error = own;
  if (status == PW_OK || status == PW_RETRY || status == PW_RESOURCE) return status;
  fit->by_differences = 1;
  return jacobian_by_differences (fit, unknowns, values, jacobian, error);
}
