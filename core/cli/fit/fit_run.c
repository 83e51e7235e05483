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
  if (status == PW_OK) run.run = pw_limit_open (run.m.system, fit->unknowns.method, &run.settings, error);
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

/* The arguments of pw_fit_jacobian. */
typedef struct {
  const pw_fit *fit;
  const double *unknowns, *values;
  double *jacobian;
} jacobian_differences;

/* Derivatives with respect to unknown j by central differences; bounds shorten the step on their side, down to 0.  If
 * the run on one side fails, by one-sided differences, provided that the step on the other side is at least a tenth of
 * the failed one.  The step h, relative to the value or, if that is larger, to a hundredth of the scale, is the cube
 * root of the noise: with equal steps the truncation error, of order h^2, and noise / h are both noise^(2/3).  Unequal
 * steps add an error of half their difference, relative to the same quantity. */
static int jacobian_column (void *context, int j, pw_error *error) {
  const jacobian_differences *d = context;
  const pw_unknown *unknown = d->fit->unknowns.list + j;
  const size_t n = (size_t)d->fit->unknowns.count, cells = (size_t)d->fit->columns * (size_t)d->fit->rows;
  const double middle = d->unknowns[j], noise = jacobian_noise (d->fit),
               unit = fmax (fabs (middle), 1e-2 * unknown->scale), size = unit * cbrt (noise);
  double *x = malloc ((n + cells) * sizeof *x), *out = d->jacobian + (size_t)j * cells, step[2];
  if (x == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const double *side[2] = { out, x + n };
  pw_error own[2] = { 0 };
  memcpy (x, d->unknowns, n * sizeof *x);
  for (int k = 0; k < 2; k++) {
    x[j] = fmin (fmax (middle + (k ? size : -size), unknown->low), unknown->high);
    step[k] = x[j] - middle;
    own[k].status = pw_fit_run (d->fit, x, k ? x + n : out, &own[k]);
    if (own[k].status == PW_RETRY || own[k].status == PW_RESOURCE) *error = own[k];
  }
  for (int k = 0; k < 2 && error->status == PW_OK; k++) {
    if (own[k].status == PW_OK) continue;
    if (own[!k].status != PW_OK || fabs (step[!k]) < fabs (step[k]) / 10) *error = own[k];
    side[k] = d->values, step[k] = 0;
  }
  for (size_t i = 0; i < cells; i++) out[i] = (side[1][i] - side[0][i]) / (step[1] - step[0]);
  d->fit->derivative_error[j] = fmax (pow (noise, 2. / 3), fabs (step[0] + step[1]) / (2 * unit));
  free (x);
  return error->status;
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
  if (!fit->by_differences) {
    pw_error own = { 0 };
    int status = jacobian_by_variation (fit, unknowns, jacobian, &own);
    if (status == PW_RESOURCE) *error = own;
    for (int j = 0; j < fit->unknowns.count; j++)
      fit->derivative_error[j] = fmax (jacobian_noise (fit), JACOBIAN_ERROR);
    if (status == PW_OK || status == PW_RETRY || status == PW_RESOURCE) return status;
    fit->by_differences = 1;
  }
  fit->runs += 2 * (long)fit->unknowns.count;
  return pw_parallel (fit->jobs, fit->unknowns.count, jacobian_column,
                      &(jacobian_differences){ fit, unknowns, values, jacobian }, error);
}
