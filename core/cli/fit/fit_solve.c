/* The solution of a least-squares fit, by GSL's Levenberg-Marquardt method, and the errors of the estimate.
 *
 * The method does not know bounds: it varies a vector u, and the value of an unknown is (James & Roos 1975, MINUIT)
 *
 *   low + (high - low) (1 + sin u) / 2      between two bounds
 *   low + scale (sqrt (1 + u^2) - 1)        above a lower bound
 *   scale u                                 without bounds */
#define _POSIX_C_SOURCE 200809L
#include <gsl/gsl_blas.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_linalg.h>
#include <gsl/gsl_multifit_nlinear.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fit.h"

/* An unknown has no effect if the norm of its column of the Jacobian, times its scale, relative to the largest such
 * product, is below this. */
#define SOLVE_EFFECT 1e-9
#define SOLVE_GRADIENT 1e-4 /* largest cosine between the residuals and a column of the Jacobian at a minimum */
#define SOLVE_RANK 1e-6  /* singular values of the scaled Jacobian count as 0 below it, relative to the largest one */
#define SOLVE_EXACT 1e-8 /* norm of the residuals of an exact fit, relative to the initial one */
#define SOLVE_ROUND_OFF 1e-12 /* the same, relative to the norm of the data: round-off of a run */
#define SOLVE_TOLERANCE 1e-10 /* of GSL: relative step in u, and gradient */
enum { SOLVE_ITERATIONS = 100 /* of a search, at most */, SOLVE_USUAL = 20 /* to show progress */ };

typedef struct {
  pw_fit *fit;
  double *u;          /* unknowns: where a search begins and ends */
  double *last_value; /* unknowns: in the last run */
  double *values;     /* columns x rows: of the model, in the last run */
  double *jacobian;   /* unknowns x (columns x rows) */
  int known;          /* 1: the last run succeeded */
  int status;         /* PW_OK, or else the fit ends, with `error` */
  pw_error *error;
  int searches; /* that have ended */
  double worst; /* largest norm of the residuals of the runs of this search that succeeded */
  double least; /* sum of squares at the best end of a search, fit->estimate; INFINITY: none is completed yet */
} fit_solver;

/* ---- Bounds: an unknown with an upper bound has a lower one, too ---- */

static double solve_value (const pw_unknown *unknown, double u) {
  if (isfinite (unknown->high)) return unknown->low + (unknown->high - unknown->low) * (1 + sin (u)) / 2;
  if (isfinite (unknown->low)) return unknown->low + unknown->scale * (sqrt (1 + u * u) - 1);
  return u * unknown->scale;
}

/* The derivative of the value with respect to u. */
static double solve_slope (const pw_unknown *unknown, double u) {
  if (isfinite (unknown->high)) return (unknown->high - unknown->low) * cos (u) / 2;
  if (isfinite (unknown->low)) return unknown->scale * u / sqrt (1 + u * u);
  return unknown->scale;
}

/* u of a value where a search begins, moved away from bounds, at which solve_slope is 0. */
static double solve_start (const pw_unknown *unknown, double value) {
  double range = isfinite (unknown->high) ? unknown->high - unknown->low : unknown->scale,
         part = fmax ((value - unknown->low) / range, PW_FIT_MARGIN);
  if (isfinite (unknown->high)) return asin (2 * fmin (part, 1 - PW_FIT_MARGIN) - 1);
  return isfinite (unknown->low) ? sqrt ((1 + part) * (1 + part) - 1) : value / unknown->scale;
}

/* ---- Residuals ---- */

/* Ends the fit if memory is short, after Ctrl-C, or if what failed is `essential`: no search can do without it. */
static void solve_fail (fit_solver *solver, int essential, const pw_error *error, int status) {
  if (status == PW_OK || !(essential || status == PW_RETRY || status == PW_RESOURCE)) return;
  solver->status = status;
  *solver->error = *error;
}

/* The sum of squares of (values - data) / sigma, or of data / sigma if `values` is NULL. */
static double solve_sum (const pw_fit *fit, const double *values) {
  double sum = 0;
  for (int i = 0; i < fit->columns * fit->rows; i++)
    if (!isnan (fit->data[i])) sum += pow (((values ? values[i] : 0) - fit->data[i]) / fit->sigma[i], 2);
  return sum;
}

/* Runs the model at u, unless the last run was there.  If the first run of the fit fails, the fit ends.  A status. */
static int solve_run (fit_solver *solver, const gsl_vector *u) {
  pw_fit *fit = solver->fit;
  int same = solver->known;
  pw_error own = { 0 };
  for (int i = 0; i < fit->unknowns.count; i++) {
    double value = solve_value (fit->unknowns.list + i, gsl_vector_get (u, (size_t)i));
    same &= value == solver->last_value[i];
    solver->last_value[i] = value;
  }
  if (same) return PW_OK;
  int status = pw_fit_run (fit, solver->last_value, solver->values, &own);
  if (status == PW_OK && !isfinite (solve_sum (fit, solver->values)))
    status = pw_fail (&own, PW_METHOD, "the sum of the squares of the residuals is not finite");
  solver->known = status == PW_OK;
  fit->runs++;
  solve_fail (solver, fit->runs == 1, &own, status);
  return status;
}

/* The residuals (model - data) / sigma.  They are large for a run that failed, so that GSL tries a shorter step. */
static int solve_residuals (const gsl_vector *u, void *context, gsl_vector *f) {
  fit_solver *solver = context;
  const pw_fit *fit = solver->fit;
  int failed = solve_run (solver, u) != PW_OK;
  if (solver->status != PW_OK) return GSL_EBADFUNC;
  for (int i = 0, k = 0; i < fit->columns * fit->rows; i++) {
    if (isnan (fit->data[i])) continue;
    double residual = failed ? 10 * solver->worst + 1 : (solver->values[i] - fit->data[i]) / fit->sigma[i];
    gsl_vector_set (f, (size_t)k++, residual);
  }
  if (!failed) solver->worst = fmax (solver->worst, sqrt (solve_sum (fit, solver->values)));
  return GSL_SUCCESS;
}

/* Derivatives of the residuals with respect to u at u; or if u is NULL, with respect to the unknowns at the estimate.
 * Without derivatives a search ends; the fit ends if no search is completed. */
static int solve_derivatives (const gsl_vector *u, void *context, gsl_matrix *J) {
  fit_solver *solver = context;
  pw_fit *fit = solver->fit;
  int cells = fit->columns * fit->rows;
  pw_error own = { 0 };
  if (u && solve_run (solver, u) != PW_OK) return GSL_EBADFUNC;
  const double *value = u ? solver->last_value : fit->estimate, *values = u ? solver->values : fit->fitted;
  int status = pw_fit_jacobian (fit, value, values, solver->jacobian, &own);
  solve_fail (solver, u == NULL || !isfinite (solver->least), &own, status);
  if (status != PW_OK) return GSL_EBADFUNC;
  for (int j = 0; j < fit->unknowns.count; j++) {
    double slope = u ? solve_slope (fit->unknowns.list + j, gsl_vector_get (u, (size_t)j)) : 1;
    for (int i = 0, k = 0; i < cells; i++)
      if (!isnan (fit->data[i]))
        gsl_matrix_set (J, (size_t)k++, (size_t)j,
                        solver->jacobian[(size_t)j * (size_t)cells + (size_t)i] * slope / fit->sigma[i]);
  }
  return GSL_SUCCESS;
}

/* ---- Minimum ---- */

/* Makes the last run the result. */
static void solve_store (fit_solver *solver, double chi2) {
  pw_fit *fit = solver->fit;
  fit->chi2 = chi2;
  memcpy (fit->estimate, solver->last_value, (size_t)fit->unknowns.count * sizeof *fit->estimate);
  memcpy (fit->fitted, solver->values, (size_t)fit->columns * (size_t)fit->rows * sizeof *fit->fitted);
}

/* The part of a search that is done after i iterations, of which SOLVE_USUAL are usual. */
static double solve_part (double i) {
  return i < SOLVE_USUAL ? 0.9 * i / SOLVE_USUAL : 1 - 0.1 * SOLVE_USUAL / i;
}

/* After iteration i.  `moved`: 1 if the last run is the position reached, the result if Ctrl-C comes before a search is
 * completed. */
static void solve_progress (fit_solver *solver, int i, int moved, const gsl_multifit_nlinear_workspace *w) {
  double norm = gsl_blas_dnrm2 (gsl_multifit_nlinear_residual (w));
  if (isnan (solver->fit->initial_chi2)) solver->fit->initial_chi2 = norm * norm;
  if (!isfinite (solver->least) && moved) solve_store (solver, norm * norm);
  snprintf (solver->fit->progress.note, sizeof solver->fit->progress.note, "iteration %d, residual %.6g",
            solver->fit->iterations, norm);
  pw_progress_at (&solver->fit->progress, (solver->searches + solve_part (i)) / solver->fit->starts);
}

/* Iterates from u, where the last run was made.  Unlike gsl_multifit_nlinear_driver, it ends when derivatives cannot be
 * evaluated (GSL_EBADFUNC).  An iteration that rejects many steps (GSL_ENOPROG) ends the search only if it is the
 * first: the next one begins with a new damping parameter. */
static int solve_iterate (fit_solver *solver, gsl_vector *u, gsl_multifit_nlinear_fdf *f,
                          gsl_multifit_nlinear_workspace *w) {
  int info, status = gsl_multifit_nlinear_init (u, f, w), more = status == GSL_SUCCESS;
  if (more) solve_progress (solver, 0, 1, w);
  for (int i = 1; i <= SOLVE_ITERATIONS && more; i++) {
    status = gsl_multifit_nlinear_iterate (w);
    if (solver->status != PW_OK) break;
    solver->fit->iterations++;
    if (status != GSL_SUCCESS && (status != GSL_ENOPROG || i == 1)) break;
    solve_progress (solver, i, status == GSL_SUCCESS, w);
    more = gsl_multifit_nlinear_test (SOLVE_TOLERANCE, SOLVE_TOLERANCE, 0, &info, w) == GSL_CONTINUE;
  }
  return status;
}

/* Stores where a search has ended, perhaps without converging: sum of squares, values.  The best end is the result. */
static void solve_keep (fit_solver *solver, double *end) {
  *end = solve_sum (solver->fit, solver->values);
  memcpy (end + 1, solver->last_value, (size_t)solver->fit->unknowns.count * sizeof *solver->last_value);
  if (!(*end < solver->least)) return;
  solver->least = *end;
  solve_store (solver, *end);
}

/* A search from the values in end + 1, which its result replaces, see fit->ends; *end is INFINITY without a result. */
static void solve_search (fit_solver *solver, gsl_multifit_nlinear_workspace *w, double *end) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count;
  gsl_multifit_nlinear_fdf f = {
    .f = solve_residuals, .df = solve_derivatives, .n = (size_t)fit->residuals, .p = n, .params = solver
  };
  gsl_vector_view view = gsl_vector_view_array (solver->u, n);
  gsl_vector *u = &view.vector;
  for (size_t i = 0; i < n; i++) solver->u[i] = solve_start (fit->unknowns.list + i, end[1 + i]);
  *end = INFINITY;
  solver->worst = 0;
  if (solve_run (solver, u) != PW_OK) return;
  int status = solve_iterate (solver, u, &f, w);
  if (solver->status != PW_OK) return;
  if (status != GSL_SUCCESS && status != GSL_ENOPROG) return;
  gsl_vector_memcpy (u, gsl_multifit_nlinear_position (w));
  if (solve_run (solver, u) == PW_OK) solve_keep (solver, end);
}

/* Searches from all starts. */
static void solve_searches (fit_solver *solver) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count, starts = (size_t)fit->starts;
  const gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters ();
  gsl_multifit_nlinear_workspace *w =
      gsl_multifit_nlinear_alloc (gsl_multifit_nlinear_trust, &parameters, (size_t)fit->residuals, n);
  double *start = pw_unknowns_starts (&fit->unknowns, fit->starts, 1);
  fit->ends = pw_arena_alloc (&fit->arena, starts * (1 + n) * sizeof *fit->ends);
  if (w == NULL || start == NULL || fit->ends == NULL)
    solver->status = pw_fail (solver->error, PW_RESOURCE, "out of memory");
  solver->least = INFINITY;
  for (size_t i = 0; i < starts && solver->status == PW_OK; i++) {
    fit->ends[i * (1 + n)] = INFINITY;
    memcpy (fit->ends + i * (1 + n) + 1, start + i * n, n * sizeof *start);
  }
  for (; solver->searches < fit->starts && solver->status == PW_OK; solver->searches++)
    solve_search (solver, w, fit->ends + (size_t)solver->searches * (1 + n));
  free (start);
  if (w) gsl_multifit_nlinear_free (w);
  if (solver->status == PW_OK && !isfinite (solver->least))
    solver->status = pw_fail (solver->error, PW_METHOD,
                              "no search could be completed; begin nearer to a minimum, by --set or --start");
}

/* ---- Errors of the estimates ---- */

/* Scales the columns of J to length 1, or to 0 for an unknown without effect. */
static void solve_scale (pw_fit *fit, gsl_matrix *J) {
  double largest = 0, *length = fit->column_length;
  int n = fit->unknowns.count;
  for (int j = 0; j < n; j++) {
    gsl_vector_view column = gsl_matrix_column (J, (size_t)j);
    length[j] = gsl_blas_dnrm2 (&column.vector);
    largest = fmax (largest, length[j] * fit->unknowns.list[j].scale);
  }
  for (int j = 0; j < n; j++) {
    gsl_vector_view column = gsl_matrix_column (J, (size_t)j);
    if (!(length[j] * fit->unknowns.list[j].scale > SOLVE_EFFECT * largest)) length[j] = 0;
    gsl_vector_scale (&column.vector, length[j] > 0 ? 1 / length[j] : 0);
  }
}

/* At a minimum the residuals are very small or orthogonal to the columns of J, which have length 1; unknowns at a bound
 * do not count. */
static int solve_converged (const pw_fit *fit, const gsl_matrix *J) {
  double norm = sqrt (fit->chi2);
  int orthogonal = 1;
  for (int j = 0; j < fit->unknowns.count; j++) {
    const pw_unknown *unknown = fit->unknowns.list + j;
    double dot = 0, near = PW_FIT_MARGIN * unknown->scale;
    if (fit->estimate[j] - unknown->low < near || unknown->high - fit->estimate[j] < near) continue;
    for (int i = 0, k = 0; i < fit->columns * fit->rows; i++)
      if (!isnan (fit->data[i]))
        dot += gsl_matrix_get (J, (size_t)k++, (size_t)j) * (fit->fitted[i] - fit->data[i]) / fit->sigma[i];
    orthogonal &= fabs (dot) <= fmax (SOLVE_GRADIENT, fit->derivative_error[j]) * norm;
  }
  return orthogonal ||
         norm < fmax (SOLVE_EXACT * sqrt (fit->initial_chi2), SOLVE_ROUND_OFF * sqrt (solve_sum (fit, NULL)));
}

/* J D^-1 = U S V^T, where D has the lengths of the columns of J: the covariance of the unknowns is
 * variance D^-1 V S^-2 V^T D^-1, over the singular values that differ from 0.  The variance of the residuals is 1 if
 * standard deviations are given, else it is estimated. */
static void solve_covariance (pw_fit *fit) {
  const double *length = fit->column_length;
  int n = fit->unknowns.count;
  double error = 0;
  for (int j = 0; j < n; j++) error = fmax (error, fit->derivative_error[j]);
  double least = fmax (SOLVE_RANK, 10 /* a margin */ * error) * fit->singular_value[0];
  for (fit->rank = 0; fit->rank < n && fit->singular_value[fit->rank] > least;) fit->rank++;
  int freedom = pw_fit_degrees_of_freedom (fit);
  double variance = fit->weighted ? 1 : freedom > 0 ? fit->chi2 / freedom : NAN;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double sum = 0;
      for (int k = 0; k < fit->rank; k++)
        sum += fit->singular_vector[i * n + k] * fit->singular_vector[j * n + k] /
               (fit->singular_value[k] * fit->singular_value[k]);
      fit->covariance[i * n + j] = length[i] > 0 && length[j] > 0 ? variance * sum / (length[i] * length[j]) : 0;
    }
  for (int i = 0; i < n; i++) {
    fit->standard_error[i] = sqrt (fit->covariance[i * n + i]);
    for (int k = fit->rank; k < n; k++)
      if (fabs (fit->singular_vector[i * n + k]) > PW_FIT_COMPONENT) fit->standard_error[i] = INFINITY;
  }
}

/* Covariance and standard errors of the estimate. */
static void solve_errors (fit_solver *solver) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count;
  gsl_matrix *J = gsl_matrix_alloc ((size_t)fit->residuals, n);
  gsl_matrix_view V = gsl_matrix_view_array (fit->singular_vector, n, n);
  gsl_vector_view S = gsl_vector_view_array (fit->singular_value, n);
  if (J == NULL) solver->status = pw_fail (solver->error, PW_RESOURCE, "out of memory");
  if (J && solve_derivatives (NULL, solver, J) == GSL_SUCCESS) {
    solve_scale (fit, J);
    fit->converged = solve_converged (fit, J);
    gsl_linalg_SV_decomp_jacobi (J, &V.matrix, &S.vector);
    solve_covariance (fit);
  }
  if (J) gsl_matrix_free (J);
}

/* ---- The fit ---- */

static int solve_open (fit_solver *solver) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count, cells = (size_t)fit->columns * (size_t)fit->rows;
  solver->last_value = pw_arena_alloc (&fit->arena, (2 * n + (1 + n) * cells) * sizeof *solver->last_value);
  fit->estimate = pw_arena_alloc (&fit->arena, (5 * n + 2 * n * n + cells) * sizeof *fit->estimate);
  if (solver->last_value == NULL || fit->estimate == NULL) return pw_fail (solver->error, PW_RESOURCE, "out of memory");
  solver->u = solver->last_value + n, solver->values = solver->u + n, solver->jacobian = solver->values + cells;
  fit->standard_error = fit->estimate + n, fit->singular_value = fit->standard_error + n,
  fit->column_length = fit->singular_value + n, fit->derivative_error = fit->column_length + n;
  fit->covariance = fit->derivative_error + n;
  fit->singular_vector = fit->covariance + n * n, fit->fitted = fit->singular_vector + n * n;
  /* the errors are not known until solve_covariance; nor are combinations of unknowns that are not determined */
  for (size_t i = 0; i < n; i++) fit->standard_error[i] = NAN;
  for (size_t i = 0; i < n * n; i++) fit->covariance[i] = NAN;
  fit->rank = fit->unknowns.count;
  return PW_OK;
}

int pw_fit_solve (pw_fit *fit, pw_error *error) {
  fit_solver solver = { .fit = fit, .error = error };
  fit->initial_chi2 = NAN;
  solver.status = solve_open (&solver);
  if (solver.status == PW_OK) solve_searches (&solver);
  if (solver.status == PW_OK) solve_errors (&solver);
  return solver.status;
}
