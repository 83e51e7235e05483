/* Newton's method by least squares, and tangents of branches; see continuation.h. */
#include <lapacke.h>
#include <math.h>
#include <string.h>
#include "continuation.h"

enum {
  NEWTON_MOST = 60,     /* iterations of a solution */
  NEWTON_HALVINGS = 10, /* of a correction */
  NEWTON_SLOW = 4       /* an iteration that divides |F| by less has reached round-off, below the tolerance */
};
static const double NEWTON_DAMPING = 0.1, /* factor of |F| in the square of the damping */
    /* Of p.  The error is 2e-11 of the third derivative, and that of F divided by this: 1e-11 for round-off. */
    NEWTON_DIFFERENCE = 1e-5;

/* The largest |F_i|; NaN if one is NaN. */
static double newton_residual (const pw_branch *b) {
  double most = 0;
  for (int i = 0; i < b->problem.equations; i++)
    if (fabs (b->F[i]) > most || isnan (b->F[i])) most = fabs (b->F[i]);
  return most;
}

static double newton_norm (int n, const double *x) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * x[i];
  return sqrt (sum);
}

/* Evaluates F and, unless J is NULL, its derivatives with respect to x. */
static int newton_evaluate (pw_branch *b, const double *u, double *J, pw_error *error) {
  size_t m = (size_t)b->problem.equations;
  memset (b->F, 0, m * sizeof *b->F);
  if (J) memset (J, 0, m * (size_t)b->problem.unknowns * sizeof *J);
  return b->problem.evaluate (b->problem.context, u, b->F, J, error);
}

/* Evaluates F and all derivatives: those by p by central differences, at the end of its domain by one-sided
 * ones.  The evaluation at u is the last one. */
static int newton_linearise (pw_branch *b, const double *u, pw_error *error) {
  int m = b->problem.equations, p = b->problem.unknowns, sum = 0, count = 0;
  double *by_p = b->J + m * p;
  memset (by_p, 0, (size_t)m * sizeof *by_p);
  memcpy (b->trial, u, b->bytes);
  for (int side = -1; side <= 1; side += 2) {
    b->trial[p] = u[p] + side * NEWTON_DIFFERENCE;
    int status = newton_evaluate (b, b->trial, NULL, error);
    if (status != PW_OK && status != PW_RETRY) return status;
    if (status != PW_OK) continue;
    for (int i = 0; i < m; i++) by_p[i] += side * b->F[i];
    sum += side, count++;
  }
  if (count == 0) return PW_RETRY;
  int status = newton_evaluate (b, u, b->J, error);
  for (int i = 0; i < m; i++) by_p[i] = (by_p[i] - sum * b->F[i]) / (count * NEWTON_DIFFERENCE);
  return status;
}

/* Adds `extra` rows to the n columns of J: the row c, or if c is NULL rows with `diagonal` on their diagonal. */
static void newton_extend (pw_branch *b, int n, int extra, const double *c, double diagonal) {
  size_t m = (size_t)b->problem.equations, rows = m + (size_t)extra;
  for (size_t j = (size_t)n; j-- > 0;) {
    double *column = b->J + j * rows;
    memmove (column, b->J + j * m, m * sizeof *column);
    memset (column + m, 0, (size_t)extra * sizeof *column);
    column[m + (c ? 0 : j)] = c ? c[j] : diagonal;
  }
}

/* du = the shortest least-squares solution of J du = right and c . du = value.  If c is NULL, p is constant, and
 * damping^2 |du|^2 is added to the sum of squares.  J is destroyed. */
static int newton_least_squares (pw_branch *b, const double *right, const double *c, double value, double damping) {
  int m = b->problem.equations, n = b->problem.unknowns + (c != NULL), extra = c ? 1 : damping > 0 ? n : 0;
  int rows = m + extra, large = rows > n ? rows : n, rank;
  if (extra) newton_extend (b, n, extra, c, damping);
  for (int i = 0; i < large; i++) b->du[i] = i < m ? right[i] : 0;
  if (c) b->du[m] = value;
  for (int i = 0; i < rows * n; i++)
    if (!isfinite (b->J[i])) return PW_RETRY;
  memset (b->pivot, 0, (size_t)n * sizeof *b->pivot);
  if (LAPACKE_dgelsy_work (LAPACK_COL_MAJOR, rows, n, 1, b->J, rows, b->du, large, b->pivot, b->problem.rank_tolerance,
                           &rank, b->work, b->work_size))
    return PW_RETRY;
  if (!c) b->du[n] = 0;
  return PW_OK;
}

/* Moves u along du by the largest of the factors 1, 1/2, ... with which |F| decreases by at least a tenth of what the
 * linear equations predict. */
static int newton_descend (pw_branch *b, double *u, pw_error *error) {
  int n = b->problem.unknowns + 1;
  double before = newton_norm (b->problem.equations, b->F), factor = 1;
  for (int i = 0; i < NEWTON_HALVINGS; i++, factor /= 2) {
    for (int j = 0; j < n; j++) b->trial[j] = u[j] + factor * b->du[j];
    int status = newton_evaluate (b, b->trial, NULL, error);
    if (status != PW_OK && status != PW_RETRY) return status;
    if (status != PW_OK || !(newton_norm (b->problem.equations, b->F) < before * (1 - factor / 10))) continue;
    memcpy (u, b->trial, b->bytes);
    return PW_OK;
  }
  return PW_RETRY;
}

int pw_branch_iterate (pw_branch *b, double *u, const double *c, double damping, pw_error *error) {
  int n = b->problem.unknowns + 1, status;
  double before = b->residual = INFINITY;
  for (b->iterations = 0;; b->iterations++) {
    status = c ? newton_linearise (b, u, error) : newton_evaluate (b, u, b->J, error);
    if (status != PW_OK) return status;
    b->residual = newton_residual (b);
    int slow = b->residual > before / NEWTON_SLOW;
    if (b->residual <= b->problem.tolerance && (slow || b->residual <= b->problem.tolerance * PW_BRANCH_EXACT))
      return PW_OK;
    if (b->iterations >= (c ? PW_BRANCH_MOST : NEWTON_MOST) || !isfinite (b->residual)) return PW_RETRY;
    before = b->residual;
    for (int i = 0; i < b->problem.equations; i++) b->F[i] = -b->F[i];
    status = newton_least_squares (b, b->F, c, 0, sqrt (damping * fmin (b->residual, 1)));
    if (status != PW_OK) return status;
    if (!c && b->residual > b->problem.tolerance)
      status = newton_descend (b, u, error);
    else
      for (int j = 0; j < n; j++) u[j] += b->du[j];
    if (status != PW_OK) return status;
  }
}

int pw_branch_residual (pw_branch *b, const double *u, double *residual, pw_error *error) {
  int status = newton_evaluate (b, u, NULL, error);
  *residual = newton_residual (b);
  return status;
}

int pw_branch_solve (pw_branch *b, double *u, pw_error *error) {
  memcpy (b->next.u, u, b->bytes);
  int status = pw_branch_iterate (b, u, NULL, NEWTON_DAMPING, error);
  if (status != PW_RETRY) return status;
  memcpy (u, b->next.u, b->bytes);
  return pw_branch_iterate (b, u, NULL, 0, error);
}

int pw_branch_tangent (pw_branch *b, const double *u, const double *c, double *tangent, pw_error *error) {
  int n = b->problem.unknowns + 1;
  double dot = 0;
  int status = newton_linearise (b, u, error);
  if (status != PW_OK) return status;
  b->residual = newton_residual (b);
  memset (b->F, 0, (size_t)b->problem.equations * sizeof *b->F);
  status = newton_least_squares (b, b->F, c, 1, 0);
  if (status != PW_OK) return status;
  double norm = newton_norm (n, b->du);
  for (int j = 0; j < n; j++) tangent[j] = b->du[j] / norm, dot += b->du[j] * c[j];
  return isfinite (norm) && norm > 0 && fabs (dot - 1) < 1e-3 ? PW_OK : PW_RETRY;
}
