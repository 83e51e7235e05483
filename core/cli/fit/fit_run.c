/* Runs of a fit at the times of the data, and its statistics. */
#include <gsl/gsl_cdf.h>
#include <math.h>
#include <stdlib.h>
#include "fit_parts.h"

/* ---- Runs ---- */

/* Samples at the times of the data, after each other. */
static int fit_sample (const pw_fit *x, pw_outcomes *o, pw_run *r, double *out, double *row, pw_error *error) {
  int status = PW_OK;
  for (int k = 0; k < x->rows && status == PW_OK; k++) {
    status = pw_run_advance_to (r, x->t[k], x->unknowns.t_end, error);
    if (status == PW_OK) status = pw_outcomes_sample (o, r, x->t[k], row, error);
    for (int i = 0; i < x->columns && status == PW_OK; i++) out[i * x->rows + k] = row[i];
  }
  return status;
}

int pw_fit_run (const pw_fit *x, const double *unknowns, double *out, pw_error *error) {
  pw_outcomes o = { .system = NULL };
  pw_cli_model m;
  pw_settings settings;
  pw_limit limit;
  double *row = calloc ((size_t)x->columns, sizeof *row);
  int status = row ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status != PW_OK) return status;
  status = pw_unknowns_system (&x->unknowns, unknowns, &m, &settings, &limit, error);
  if (status == PW_OK) status = pw_outcomes_open (&o, m.system, "--columns", x->name, x->columns, error);
  settings.ledger = o.ledger;
  pw_run *r = status == PW_OK ? pw_run_open (m.system, x->unknowns.method, &settings, error) : NULL;
  if (status == PW_OK) status = r ? fit_sample (x, &o, r, out, row, error) : error->status;
  if (status == PW_STOPPED) status = pw_limit_fail (&limit, pw_run_time (r), error);
  if (r) pw_run_close (r);
  pw_outcomes_close (&o);
  pw_cli_close_model (&m);
  free (row);
  return status;
}

/* ---- Statistics ---- */

int pw_fit_freedom (const pw_fit *x) {
  return x->residuals - x->unknowns.count;
}

double pw_fit_quantile (const pw_fit *x) {
  double tail = (1 - x->confidence) / 2;
  return x->weighted ? gsl_cdf_gaussian_Qinv (tail, 1) : gsl_cdf_tdist_Qinv (tail, fmax (pw_fit_freedom (x), 1));
}
