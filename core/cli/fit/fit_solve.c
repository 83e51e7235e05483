/* The solution of a least-squares fit, by GSL's Levenberg-Marquardt method.
 *
 * Bounds: the method varies u, and x = low + (high - low) (1 + sin u) / 2 between two bounds, x = low + s (sqrt (1 +
 * u^2) - 1) above one (James & Roos 1975, MINUIT), with s the scale of the unknown. */
#define _POSIX_C_SOURCE 200809L
#include <gsl/gsl_blas.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_linalg.h>
#include <gsl/gsl_multifit_nlinear.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fit.h"

#define SOLVE_GRADIENT 1e-4 /* largest cosine between the residual and a column of the Jacobian at a minimum */
#define SOLVE_RANK 1e-6     /* smallest singular value of the scaled Jacobian, relative to the largest one */
#define SOLVE_EFFECT 1e-9   /* smallest effect of an unknown, relative to the largest one */
enum { SOLVE_ITERATIONS = 100 };

typedef struct {
  pw_fit *x;
  double *u;                     /* where a search begins and ends */
  double *at, *model, *jacobian; /* unknowns of the last run; its values; derivatives */
  int known, status;
  double worst; /* largest residual norm of a run that succeeded */
  double least; /* sum of squares at the best minimum so far; its values are x->estimate and x->model */
  int before;   /* iterations of earlier searches */
  pw_error *error;
} solution;

/* ---- Bounds ---- */

static double solve_unknown (const pw_unknown *k, double u) {
  if (isfinite (k->low) && isfinite (k->high)) return k->low + (k->high - k->low) * (1 + sin (u)) / 2;
  if (isfinite (k->low)) return k->low + k->scale * (sqrt (1 + u * u) - 1);
  return u * k->scale;
}

static double solve_slope (const pw_unknown *k, double u) {
  if (isfinite (k->low) && isfinite (k->high)) return (k->high - k->low) * cos (u) / 2;
  if (isfinite (k->low)) return k->scale * u / sqrt (1 + u * u);
  return k->scale;
}

/* The slope is not 0 there. */
static double solve_start (const pw_unknown *k, double value) {
  double part = isfinite (k->high) ? (value - k->low) / (k->high - k->low) : (value - k->low) / k->scale;
  part = fmax (part, PW_FIT_INSIDE);
  if (isfinite (k->low) && isfinite (k->high)) return asin (2 * fmin (part, 1 - PW_FIT_INSIDE) - 1);
  return isfinite (k->low) ? sqrt ((1 + part) * (1 + part) - 1) : value / k->scale;
}

/* ---- Residuals ---- */

static int solve_at (solution *p, const gsl_vector *u) {
  pw_fit *x = p->x;
  int n = x->unknowns.count, same = p->known;
  pw_error own = { 0 };
  for (int i = 0; i < n; i++) {
    double value = solve_unknown (x->unknowns.list + i, gsl_vector_get (u, (size_t)i));
    same &= value == p->at[i];
    p->at[i] = value;
  }
  if (same) return PW_OK;
  p->known = 0;
  int status = pw_fit_run (x, p->at, p->model, &own);
  x->runs++;
  p->known = status == PW_OK;
  if (status == PW_RETRY || status == PW_RESOURCE || x->runs == 1) {
    p->status = status;
    if (status != PW_OK) *p->error = own;
  }
  return status;
}

/* A run that fails is far from the data, so that the step is repeated with a smaller one. */
static int solve_residuals (const gsl_vector *u, void *context, gsl_vector *f) {
  solution *p = context;
  const pw_fit *x = p->x;
  double sum = 0;
  int failed = solve_at (p, u) != PW_OK;
  if (p->status != PW_OK) return GSL_EBADFUNC;
  for (int i = 0, k = 0; i < x->columns * x->rows; i++) {
    if (isnan (x->value[i])) continue;
    double residual = failed ? 10 * p->worst + 1 : (p->model[i] - x->value[i]) / x->sigma[i];
    sum += residual * residual;
    gsl_vector_set (f, (size_t)k++, residual);
  }
  if (!isfinite (sum)) return GSL_EBADFUNC;
  if (!failed) p->worst = fmax (p->worst, sqrt (sum));
  return GSL_SUCCESS;
}

/* Derivatives of the residuals by u, or by x if u is NULL. */
static int solve_derivatives (const gsl_vector *u, void *context, gsl_matrix *J) {
  solution *p = context;
  pw_fit *x = p->x;
  int cells = x->columns * x->rows;
  if (u && solve_at (p, u) != PW_OK) return GSL_EBADFUNC;
  p->status = pw_fit_jacobian (x, p->at, p->model, p->jacobian, p->error);
  if (p->status != PW_OK) return GSL_EBADFUNC;
  for (int j = 0; j < x->unknowns.count; j++) {
    double slope = u ? solve_slope (x->unknowns.list + j, gsl_vector_get (u, (size_t)j)) : 1;
    for (int i = 0, k = 0; i < cells; i++)
      if (!isnan (x->value[i]))
        gsl_matrix_set (J, (size_t)k++, (size_t)j,
                        p->jacobian[(size_t)j * (size_t)cells + (size_t)i] * slope / x->sigma[i]);
  }
  return GSL_SUCCESS;
}

/* ---- Minimum ---- */

/* Until a search has ended, the values that the first one has reached are the result. */
static void solve_reached (const solution *p, const gsl_vector *u, double size) {
  pw_fit *x = p->x;
  if (isfinite (p->least) || !p->known) return;
  x->chi2 = size * size;
  for (int i = 0; i < x->unknowns.count; i++)
    x->estimate[i] = solve_unknown (x->unknowns.list + i, gsl_vector_get (u, (size_t)i));
  memcpy (x->model, p->model, (size_t)x->columns * (size_t)x->rows * sizeof *x->model);
}

static void solve_progress (const size_t iteration, void *context, const gsl_multifit_nlinear_workspace *w) {
  solution *p = context;
  double size = gsl_blas_dnrm2 (gsl_multifit_nlinear_residual (w));
  if (p->status != PW_OK) return;
  if (iteration == 0 && p->before == 0) p->x->initial_chi2 = size * size;
  p->x->iterations = p->before + (int)iteration;
  solve_reached (p, gsl_multifit_nlinear_position (w), size);
  snprintf (p->x->progress.note, sizeof p->x->progress.note, "residual %.6g", size);
  pw_progress_at (&p->x->progress, p->x->iterations);
}

/* Stores the minimum that a search has reached. */
static void solve_keep (solution *p, double *minimum) {
  pw_fit *x = p->x;
  size_t n = (size_t)x->unknowns.count, cells = (size_t)x->columns * (size_t)x->rows;
  *minimum = 0;
  for (size_t i = 0; i < cells; i++)
    if (!isnan (x->value[i])) *minimum += pow ((p->model[i] - x->value[i]) / x->sigma[i], 2);
  memcpy (minimum + 1, p->at, n * sizeof *p->at);
  if (!(*minimum < p->least)) return;
  x->chi2 = p->least = *minimum;
  memcpy (x->estimate, p->at, n * sizeof *p->at);
  memcpy (x->model, p->model, cells * sizeof *p->model);
}

/* A search; without a result, only that from the initial values fails. */
static int solve_minimum (solution *p, gsl_multifit_nlinear_workspace *w, double *minimum) {
  pw_fit *x = p->x;
  size_t n = (size_t)x->unknowns.count;
  gsl_multifit_nlinear_fdf f = {
    .f = solve_residuals, .df = solve_derivatives, .n = (size_t)x->residuals, .p = n, .params = p
  };
  gsl_vector_view view = gsl_vector_view_array (p->u, n);
  gsl_vector *u = &view.vector;
  int info;
  for (size_t i = 0; i < n; i++) p->u[i] = solve_start (x->unknowns.list + i, minimum[1 + i]);
  *minimum = INFINITY;
  p->worst = 0;
  int first = x->runs == 0, status = solve_at (p, u) == PW_OK ? gsl_multifit_nlinear_init (u, &f, w) : GSL_EBADFUNC;
  if (status == GSL_SUCCESS)
    status = gsl_multifit_nlinear_driver (SOLVE_ITERATIONS, 1e-10, 1e-10, 0, solve_progress, p, &info, w);
  if (p->status == PW_OK && (status == GSL_SUCCESS || status == GSL_EMAXITER || status == GSL_ENOPROG)) {
    gsl_vector_memcpy (u, gsl_multifit_nlinear_position (w));
    x->iterations = p->before += (int)gsl_multifit_nlinear_niter (w);
    if (solve_at (p, u) == PW_OK) solve_keep (p, minimum);
  } else if (p->status == PW_OK && first)
    p->status = pw_fail (p->error, PW_METHOD, "least squares: %s", gsl_strerror (status));
  return p->status;
}

/* Searches from all starts. */
static int solve_minima (solution *p, gsl_multifit_nlinear_workspace *w) {
  pw_fit *x = p->x;
  size_t n = (size_t)x->unknowns.count, starts = (size_t)x->starts;
  double *point = pw_unknowns_starts (&x->unknowns, x->starts, 1);
  x->minimum = malloc (starts * (1 + n) * sizeof *x->minimum);
  if (point == NULL || x->minimum == NULL) p->status = pw_fail (p->error, PW_RESOURCE, "out of memory");
  p->least = INFINITY;
  for (size_t i = 0; i < starts && p->status == PW_OK; i++) {
    x->minimum[i * (1 + n)] = INFINITY;
    memcpy (x->minimum + i * (1 + n) + 1, point + i * n, n * sizeof *point);
  }
  for (size_t i = 0; i < starts && p->status == PW_OK; i++) solve_minimum (p, w, x->minimum + i * (1 + n));
  free (point);
  if (p->status == PW_OK && !isfinite (p->least))
    p->status =
        pw_fail (p->error, PW_METHOD, "no search ended at a motion; begin nearer to the data, by --set or --start");
  return p->status;
}

/* ---- Errors of the estimates ---- */

/* Makes the lengths of columns 1, or 0 without effect. */
static void solve_scale (pw_fit *x, gsl_matrix *J) {
  double largest = 0, *size = x->length;
  int n = x->unknowns.count;
  for (int j = 0; j < n; j++) {
    gsl_vector_view c = gsl_matrix_column (J, (size_t)j);
    size[j] = gsl_blas_dnrm2 (&c.vector);
    largest = fmax (largest, size[j] * x->unknowns.list[j].scale);
  }
  for (int j = 0; j < n; j++) {
    gsl_vector_view c = gsl_matrix_column (J, (size_t)j);
    if (!(size[j] * x->unknowns.list[j].scale > SOLVE_EFFECT * largest)) size[j] = 0;
    gsl_vector_scale (&c.vector, size[j] > 0 ? 1 / size[j] : 0);
  }
}

/* The residual is orthogonal to all columns of length 1 at a minimum; unknowns at a bound do not count. */
static int solve_converged (const pw_fit *x, const gsl_matrix *J) {
  double size = sqrt (x->chi2), worst = 0, noise = fmax (SOLVE_GRADIENT, pw_fit_noise (x));
  for (int j = 0; j < x->unknowns.count; j++) {
    const pw_unknown *u = x->unknowns.list + j;
    double dot = 0, near = PW_FIT_INSIDE * u->scale;
    if (x->estimate[j] - u->low < near || u->high - x->estimate[j] < near) continue;
    for (int i = 0, k = 0; i < x->columns * x->rows; i++)
      if (!isnan (x->value[i]))
        dot += gsl_matrix_get (J, (size_t)k++, (size_t)j) * (x->model[i] - x->value[i]) / x->sigma[i];
    worst = fmax (worst, fabs (dot));
  }
  return worst <= noise * size || size < 1e-8 * sqrt (x->initial_chi2);
}

/* J = U S V^T with columns of length 1: the covariance is V S^-2 V^T, over the singular values that differ from 0. */
static void solve_covariance (pw_fit *x) {
  const double *size = x->length;
  int n = x->unknowns.count;
  double least = fmax (SOLVE_RANK, 10 * pw_fit_noise (x)) * x->singular[0];
  for (x->rank = 0; x->rank < n && x->singular[x->rank] > least;) x->rank++;
  int freedom = pw_fit_freedom (x);
  double factor = x->weighted ? 1 : freedom > 0 ? x->chi2 / freedom : NAN;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double sum = 0;
      for (int k = 0; k < x->rank; k++)
        sum += x->vectors[i * n + k] * x->vectors[j * n + k] / (x->singular[k] * x->singular[k]);
      x->covariance[i * n + j] = size[i] > 0 && size[j] > 0 ? factor * sum / (size[i] * size[j]) : 0;
    }
  for (int i = 0; i < n; i++) {
    x->deviation[i] = sqrt (x->covariance[i * n + i]);
    for (int k = x->rank; k < n; k++)
      if (fabs (x->vectors[i * n + k]) > PW_FIT_PART) x->deviation[i] = INFINITY;
  }
}

static int solve_errors (solution *p) {
  pw_fit *x = p->x;
  size_t n = (size_t)x->unknowns.count;
  gsl_matrix *J = gsl_matrix_alloc ((size_t)x->residuals, n);
  gsl_matrix_view V = gsl_matrix_view_array (x->vectors, n, n);
  gsl_vector_view S = gsl_vector_view_array (x->singular, n);
  if (J == NULL) return pw_fail (p->error, PW_RESOURCE, "out of memory");
  solve_derivatives (NULL, p, J);
  if (p->status == PW_OK) {
    solve_scale (x, J);
    x->converged = solve_converged (x, J);
    gsl_linalg_SV_decomp_jacobi (J, &V.matrix, &S.vector);
    solve_covariance (x);
  }
  gsl_matrix_free (J);
  return p->status;
}

/* ---- All of it ---- */

static int solve_open (solution *p) {
  pw_fit *x = p->x;
  size_t n = (size_t)x->unknowns.count, cells = (size_t)x->columns * (size_t)x->rows;
  p->at = calloc (2 * n + (1 + n) * cells, sizeof *p->at);
  x->estimate = calloc (4 * n + 2 * n * n + cells, sizeof *x->estimate);
  if (p->at == NULL || x->estimate == NULL) return pw_fail (p->error, PW_RESOURCE, "out of memory");
  p->u = p->at + n, p->model = p->u + n, p->jacobian = p->model + cells;
  x->deviation = x->estimate + n, x->singular = x->deviation + n, x->length = x->singular + n,
  x->covariance = x->length + n;
  x->vectors = x->covariance + n * n, x->model = x->vectors + n * n;
  return PW_OK;
}

int pw_fit_solve (pw_fit *x, pw_error *error) {
  solution p = { .x = x, .error = error };
  gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters ();
  p.status = solve_open (&p);
  gsl_multifit_nlinear_workspace *w = p.status == PW_OK
                                          ? gsl_multifit_nlinear_alloc (gsl_multifit_nlinear_trust, &parameters,
                                                                        (size_t)x->residuals, (size_t)x->unknowns.count)
                                          : NULL;
  if (p.status == PW_OK && w == NULL) p.status = pw_fail (error, PW_RESOURCE, "out of memory");
  if (p.status == PW_OK) solve_minima (&p, w);
  if (p.status == PW_OK) {
    memcpy (p.at, x->estimate, (size_t)x->unknowns.count * sizeof *x->estimate);
    memcpy (p.model, x->model, (size_t)x->columns * (size_t)x->rows * sizeof *x->model);
    p.status = solve_errors (&p);
  }
  if (w) gsl_multifit_nlinear_free (w);
  free (p.at);
  return p.status;
}
