/* Runs of a fit, which give the model's values at the times of the data, and derivatives of these values. */
#include <math.h>
#include <stdlib.h>
#include "fit.h"

#define FIT_RTOL 1e-8 /* largest relative tolerance of runs that are compared */

/* Runs the model with its own settings, or if rtol > 0 with this tolerance. */
static int fit_run (const pw_fit *fit, const double *unknowns, double rtol, double *out, pw_error *error) {
  const pw_run_outputs outputs = { .unknowns = &fit->unknowns,
                                   .method = rtol > 0 ? fit->unknowns.method : NULL,
                                   .rtol = rtol,
                                   .option = "--columns",
                                   .of = fit->column_name,
                                   .count = fit->columns,
                                   .t = fit->t,
                                   .rows = fit->rows };
  return pw_run_outputs_at (&outputs, unknowns, NULL, out, error);
}

int pw_fit_run (const pw_fit *fit, const double *unknowns, double *out, pw_error *error) {
  return fit_run (fit, unknowns, 0, out, error);
}

static int fit_own (void *fit, const double *x, double rtol, double *value, pw_error *error) {
  (void)rtol;
  return fit_run (fit, x, 0, value, error);
}

static int fit_accurate (void *fit, const double *x, double rtol, double *value, pw_error *error) {
  return fit_run (fit, x, rtol, value, error);
}

int pw_fit_jacobian (pw_fit *fit, const double *unknowns, const double *values, double *jacobian, pw_error *error) {
  const int n = fit->unknowns.count, cells = fit->columns * fit->rows;
  const double own = pw_unknowns_noise (&fit->unknowns), noise = fmin (own, FIT_RTOL);
  pw_derivative *derivative = malloc ((size_t)n * (size_t)cells * sizeof *derivative);
  const pw_difference_settings d = { .evaluate = noise < own ? fit_accurate : fit_own,
                                     .context = fit,
                                     .outputs = cells,
                                     .rtol = noise,
                                     .neighbours = 2,
                                     .value = noise < own ? NULL : values,
                                     .jobs = fit->jobs };
  int status = derivative ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = pw_unknowns_differentiate (&fit->unknowns, unknowns, d, derivative, error);
  for (int i = 0; i < n * cells && status == PW_OK; i++) jacobian[i] = derivative[i].value;
  for (int j = 0; j < n; j++) fit->derivative_error[j] = pow (noise, 2. / 3);
  fit->runs += 2 * (long)n;
  free (derivative);
  return status;
}
