/* Runs of a fit at the times of the data; derivatives of its model values, by the variational equations, or if these
 * cannot be used by differences; its statistics. */
#define _POSIX_C_SOURCE 200809L
#include <float.h>
#include <gsl/gsl_cdf.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fit.h"
#include "parallel.h"

#define JACOBIAN_EXACT 1e-8 /* relative error of derivatives by the variational equations */

/* ---- Runs ---- */

/* Samples at the times of the data, after each other. */
static int fit_sample (const pw_fit *x, pw_outcomes *o, pw_run *r, double *out, double *row, pw_error *error) {
  pw_sample s;
  int status = PW_OK;
  for (int k = 0; k < x->rows && status == PW_OK; k++) {
    status = pw_run_advance_to (r, x->t[k], x->unknowns.t_end, error);
    if (status == PW_OK) status = pw_run_sample (r, x->t[k], &s, error);
    if (status == PW_OK) status = pw_outcomes_read (o, &s, row, error);
    for (int i = 0; i < x->columns && status == PW_OK; i++) out[i * x->rows + k] = row[i];
  }
  return status;
}

int pw_fit_run (const pw_fit *x, const double *unknowns, double *out, pw_error *error) {
  pw_outcomes o = { .system = NULL };
  pw_unknown_run r;
  double *row = calloc ((size_t)x->columns, sizeof *row);
  if (row == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_unknown_run_prepare (&r, &x->unknowns, unknowns, error);
  if (status == PW_OK) status = pw_outcomes_open (&o, r.m.system, "--columns", x->name, x->columns, error);
  r.settings.ledger = o.ledger;
  if (status == PW_OK) r.run = pw_run_open (r.m.system, x->unknowns.method, &r.settings, error);
  if (status == PW_OK) status = r.run ? fit_sample (x, &o, r.run, out, row, error) : error->status;
  if (status == PW_STOPPED) status = pw_limit_status (&r.limit, pw_run_time (r.run), error);
  pw_outcomes_close (&o);
  pw_unknown_run_close (&r);
  free (row);
  return status;
}

/* ---- Statistics ---- */

int pw_fit_freedom (const pw_fit *x) {
  return x->residuals - x->rank;
}

double pw_fit_quantile (const pw_fit *x) {
  double tail = (1 - x->confidence) / 2;
  return x->weighted ? gsl_cdf_gaussian_Qinv (tail, 1) : gsl_cdf_tdist_Qinv (tail, fmax (pw_fit_freedom (x), 1));
}

/* ---- Differences ---- */

/* Values of an adaptive method are smooth up to its tolerance, those of fixed steps up to round-off. */
static double jacobian_smooth (const pw_fit *x) {
  if (pw_cli_adaptive (x->unknowns.method) != 1) return DBL_EPSILON;
  return x->unknowns.settings.rtol > 0 ? x->unknowns.settings.rtol : 1e-6;
}

double pw_fit_noise (const pw_fit *x) {
  double smooth = jacobian_smooth (x);
  return x->by_differences ? pow (smooth, 2. / 3) : fmax (smooth, JACOBIAN_EXACT);
}

/* Runs on both sides of each unknown: task 2 j below, 2 j + 1 above. */
typedef struct {
  const pw_fit *x;
  double *at, *run, *step; /* of each task: unknowns, values of the run, distance from the middle */
  pw_error *error;
} jacobian_differences;

/* The step balances the truncation error, proportional to its square, and the noise, divided by the step. */
static int jacobian_side (void *context, int task, pw_error *error) {
  jacobian_differences *d = context;
  const pw_fit *x = d->x;
  const pw_unknown *u = x->unknowns.list + task / 2;
  double *at = d->at + task * x->unknowns.count, *value = at + task / 2, middle = *value;
  double size = fmax (fabs (middle), 1e-2 * u->scale) * cbrt (jacobian_smooth (x));
  *value = fmin (fmax (middle + (task % 2 ? size : -size), u->low), u->high);
  d->step[task] = *value - middle;
  (void)error;
  d->error[task].status =
      pw_fit_run (x, at, d->run + (size_t)task * (size_t)x->columns * (size_t)x->rows, d->error + task);
  return PW_OK; /* one side is enough */
}

/* One side is enough, if the other one fails. */
static int jacobian_column (const jacobian_differences *d, int j, const double *model, double *out, pw_error *error) {
  size_t cells = (size_t)d->x->columns * (size_t)d->x->rows;
  const double *side[2];
  double step[2];
  for (int k = 0; k < 2; k++) {
    int failed = d->error[2 * j + k].status != PW_OK;
    if (failed && (d->error[2 * j + k].status == PW_RETRY || d->error[2 * j + k].status == PW_RESOURCE ||
                   d->error[2 * j + !k].status != PW_OK))
      return *error = d->error[2 * j + k], error->status;
    side[k] = failed ? model : d->run + (size_t)(2 * j + k) * cells;
    step[k] = failed ? 0 : d->step[2 * j + k];
  }
  for (size_t i = 0; i < cells; i++) out[i] = (side[1][i] - side[0][i]) / (step[1] - step[0]);
  return PW_OK;
}

static int jacobian_by_differences (pw_fit *x, const double *at, const double *model, double *jacobian,
                                    pw_error *error) {
  size_t n = (size_t)x->unknowns.count, cells = (size_t)x->columns * (size_t)x->rows;
  jacobian_differences d = { .x = x, .at = malloc (2 * n * (n + cells + 1) * sizeof *d.at) };
  d.error = calloc (2 * n, sizeof *d.error);
  int status = d.at && d.error ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) {
    d.run = d.at + 2 * n * n, d.step = d.run + 2 * n * cells;
    for (size_t task = 0; task < 2 * n; task++) memcpy (d.at + task * n, at, n * sizeof *at);
    status = pw_parallel (x->jobs, (int)(2 * n), jacobian_side, &d, error);
    x->runs += 2 * (long)n;
  }
  for (int j = 0; j < x->unknowns.count && status == PW_OK; j++)
    status = jacobian_column (&d, j, model, jacobian + (size_t)j * cells, error);
  free (d.at);
  free (d.error);
  return status;
}

/* ---- Variational equations ---- */

/* Derivatives at the time of a row. */
static int jacobian_row (pw_sensitivity *s, const pw_fit *x, int row, double *jacobian, pw_error *error) {
  const int n = x->unknowns.count;
  int status = pw_sensitivity_at (s, x->t[row], error);
  for (int i = 0; i < x->columns && status == PW_OK; i++) {
    const double *slope = s->slope + s->outcomes.outcome[i].term[0] * n;
    for (int j = 0; j < n; j++) {
      if (!isfinite (slope[j])) return pw_fail (error, PW_METHOD, "%s has no derivative", x->name[i]);
      jacobian[((size_t)j * (size_t)x->columns + (size_t)i) * (size_t)x->rows + (size_t)row] = slope[j];
    }
  }
  return status;
}

static int jacobian_by_variation (const pw_fit *x, const double *at, double *jacobian, pw_error *error) {
  pw_sensitivity s = { .of = x->name, .unknowns = x->unknowns, .no_error = 1 };
  int status = pw_sensitivity_open (&s, at, error);
  if (status == PW_OK) status = pw_sensitivity_start (&s, error);
  for (int row = 0; row < x->rows && status == PW_OK; row++) status = jacobian_row (&s, x, row, jacobian, error);
  if (status == PW_STOPPED) status = pw_limit_status (&s.limit, pw_run_time (s.base.run), error);
  pw_sensitivity_close (&s);
  return status;
}

/* Motions that are not differentiable have differences from then on. */
int pw_fit_jacobian (pw_fit *x, const double *at, const double *model, double *jacobian, pw_error *error) {
  pw_error own = { 0 };
  int status = x->by_differences ? PW_METHOD : jacobian_by_variation (x, at, jacobian, &own);
  if (status == PW_OK || status == PW_RETRY || status == PW_RESOURCE) {
    if (status == PW_RESOURCE) *error = own;
    return status;
  }
  x->by_differences = 1;
  return jacobian_by_differences (x, at, model, jacobian, error);
}
