/* The equations of steady motions.
 *
 * The system has symmetries: displacements of the whole, and of angles on which nothing depends.  S_k (q) is the
 * velocity of a displacement along the k-th one at unit rate.  A steady motion has the velocities v = xi_1 S_1 (q) +
 * xi_2 S_2 (q) + ... with constant xi.  In the frame that moves with it its velocities are constant: with the angular
 * velocity w of the whole and W (x, y, phi) = w (-y, x, 0) for each body,
 *
 *     g (q, t) = 0,   J v = eta,   a (q, v) = W v,   A - value B = 0 for what is held (steady_hold.c).
 *
 * The unknowns are u = (q, xi), both scaled by units of the scene, and on a branch the parameter.  There are more
 * equations than unknowns, and they depend on each other, since symmetries and conservation laws make steady motions
 * families; continuation.h solves them by least squares.  Their exact derivatives are those of the linearisation
 * (linear_variation.c) for the variations dq, dv = W dq + dxi_k S_k.  On a branch, corrections are orthogonal to the
 * symmetries that leave what is held unchanged.
 *
 * (Relative equilibria: Marsden & Ratiu 1999, Introduction to Mechanics and Symmetry.) */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "rank.h"
#include "steady_parts.h"

double pw_steady_parameter (const pw_steady *x, const double *u) {
  return x->settings.first + (x->settings.last - x->settings.first) * u[x->n + x->symmetries];
}

void pw_steady_state (pw_steady *x, const double *u) {
  for (int j = 0; j < x->n; j++) x->q[j] = u[j] * pw_unit (x->s, j);
  pw_steady_combine (x, u + x->n, x->T, x->rates);
  pw_steady_velocities (x, x->rates, x->q, x->v);
  if (x->settings.vary >= 0) x->hold[x->settings.vary].value = pw_steady_parameter (x, u);
}

int pw_steady_same_motion (void *steady, const double *u, const double *other) {
  pw_steady *x = steady;
  size_t n = (size_t)x->n;
  double *q = x->null_space, *v = q + n;
  pw_steady_state (x, u);
  memcpy (q, x->q, n * sizeof *q), memcpy (v, x->v, n * sizeof *v);
  pw_steady_state (x, other);
  return pw_steady_distance (x, q, v, x->q, x->v) <= PW_BRANCH_SAME;
}

int pw_steady_nearest (pw_steady *x, const double *q, const double *v, double *u, pw_error *error) {
  int n = x->n, columns = x->symmetries, rank;
  double *S = x->F, *right = S + n * columns, *work = right + n + columns;
  memset (x->branch.pivot, 0, (size_t)columns * sizeof *x->branch.pivot);
  for (int j = 0; j < n; j++) u[j] = q[j] / pw_unit (x->s, j), right[j] = v[j] / pw_unit (x->s, j) * x->T;
  for (int k = 0; k < columns; k++) {
    pw_steady_velocities (x, x->symmetry + k * pw_steady_rate_count (x->s), q, S + k * n);
    for (int j = 0; j < n; j++) S[k * n + j] /= pw_unit (x->s, j);
  }
  if (columns && LAPACKE_dgelsy_work (LAPACK_COL_MAJOR, n, columns, 1, S, n, right, n > columns ? n : columns,
                                      x->branch.pivot, PW_STEADY_RANK, &rank, work, PW_STEADY_WORK * (n + columns)))
    return pw_fail (error, PW_METHOD, "the symmetries cannot be separated");
  memcpy (u + n, right, (size_t)columns * sizeof *u);
  return PW_OK;
}

/* ---- Residuals ---- */

/* The residuals g, J v - eta, a - W v of x->system in the state x->q, x->v, at which its accelerations have been
 * evaluated. */
static void steady_residual (pw_steady *x, double *F) {
  pw_linearisation *l = &x->system.linearisation;
  pw_workspace *w = x->system.run->w;
  double acceleration = x->T * x->T / x->L;
  pw_evaluate_g (w, F);
  for (int i = 0; i < x->holonomic; i++) F[i] /= x->norm[i] * x->L;
  F += x->holonomic;
  pw_mul_J (w, x->v, F);
  if (x->s->rheonomic) pw_evaluate_eta (w, l->row_scratch);
  for (int i = 0; i < x->m; i++) F[i] = (F[i] - (x->s->rheonomic ? l->row_scratch[i] : 0)) * x->T / (x->norm[i] * x->L);
  F += x->m;
  memcpy (F, l->a, (size_t)x->n * sizeof *F);
  pw_linear_turn (l, -x->rates[PW_RATE_TURN], x->v, F);
  for (int j = 0; j < x->n; j++) F[j] *= pw_length_factor (x->s, j) * acceleration;
}

/* ---- Derivatives ---- */

/* The change of the residuals by the variation (dq, dv) in l->dx and the change dw of the angular velocity w. */
static void steady_change (pw_steady *x, double dw, double *F) {
  pw_linearisation *l = &x->system.linearisation;
  int n = x->n;
  double *dq = l->dx, *dv = l->dx + n;
  pw_mul_J (x->system.run->w, dq, l->row_scratch);
  for (int i = 0; i < x->holonomic; i++) *F++ = l->row_scratch[i] / (x->norm[i] * x->L);
  pw_linear_vary (l);
  pw_mul_J (x->system.run->w, dv, l->row_scratch);
  for (int i = 0; i < x->m; i++) *F++ = (l->row_scratch[i] + l->product[n + x->m + i]) * x->T / (x->norm[i] * x->L);
  pw_linear_turn (l, -x->rates[PW_RATE_TURN], dv, l->da);
  pw_linear_turn (l, -dw, x->v, l->da);
  for (int j = 0; j < n; j++) *F++ = l->da[j] * pw_length_factor (x->s, j) * x->T * x->T / x->L;
  for (int i = 0; i < x->settings.holds; i++) *F++ = pw_hold_residual (x, x->hold + i, dq, dv);
}

/* The conditions that dq is orthogonal to the free symmetries. */
static void steady_conditions (pw_steady *x, double *dF) {
  int equations = pw_steady_equations (x);
  dF += equations - x->symmetries;
  for (int i = 0; i < x->free_symmetries; i++) {
    double square = 0;
    pw_steady_combine (x, x->free_symmetry + i * x->symmetries, 1, x->combined);
    pw_steady_velocities (x, x->combined, x->q, x->dq);
    for (int j = 0; j < x->n; j++) x->dq[j] /= pw_unit (x->s, j), square += x->dq[j] * x->dq[j];
    for (int j = 0; j < x->n; j++) dF[j * equations + i] = x->dq[j] / sqrt (square);
  }
}

/* Derivatives with respect to the unknowns q and xi. */
static void steady_columns (pw_steady *x, double *dF) {
  pw_linearisation *l = &x->system.linearisation;
  int n = x->n, equations = pw_steady_equations (x);
  for (int c = 0; c < pw_steady_unknowns (x); c++, dF += equations) {
    const double *symmetry = x->symmetry + (c < n ? 0 : c - n) * pw_steady_rate_count (x->s); /* only for c >= n */
    memset (l->dx, 0, 2 * (size_t)n * sizeof *l->dx);
    if (c < n) {
      l->dx[c] = pw_unit (x->s, c);
      pw_linear_turn (l, x->rates[PW_RATE_TURN], l->dx, l->dx + n);
    } else {
      pw_steady_velocities (x, symmetry, x->q, l->dx + n);
      for (int j = n; j < 2 * n; j++) l->dx[j] /= x->T;
    }
    steady_change (x, c < n ? 0 : symmetry[PW_RATE_TURN] / x->T, dF);
  }
}

int pw_steady_evaluate (void *steady, const double *u, double *F, double *dF, pw_error *error) {
  pw_steady *x = steady;
  int first_held = pw_steady_equations (x) - x->symmetries - x->settings.holds;
  int status = pw_steady_open_system (x, pw_steady_parameter (x, u));
  if (status < 0) pw_fail (error, status, "%s", x->why.text);
  if (status != PW_OK) return status;
  pw_linearisation *l = &x->system.linearisation;
  pw_steady_state (x, u);
  status = dF ? pw_linear_evaluate (l, x->settings.t, x->q, x->v)
              : pw_run_accelerate (x->system.run, x->settings.t, x->q, x->v, l->a, l->lambda);
  if (status != PW_OK) {
    x->why = (pw_error){ 0 };
    if (status > 0) pw_fail_singular (x->system.run, x->settings.t, &x->why);
    return PW_RETRY;
  }
  steady_residual (x, F);
  for (int i = 0; i < x->settings.holds; i++) F[first_held + i] = pw_hold_residual (x, x->hold + i, NULL, NULL);
  if (dF == NULL) return PW_OK;
  steady_columns (x, dF);
  steady_conditions (x, dF);
  return PW_OK;
}

/* ---- Singular constraints ---- */

/* Evaluates the rows of J at u, of length 1 (m x n); active (m, or NULL): 1 for independent ones. */
static int steady_rows (pw_steady *x, const double *u, double *rows, unsigned char *active, pw_error *error) {
  int status = pw_steady_open_system (x, pw_steady_parameter (x, u));
  if (status < 0) pw_fail (error, status, "%s", x->why.text);
  if (status != PW_OK) return status;
  pw_run *r = x->system.run;
  pw_steady_state (x, u);
  if (pw_evaluate_J_at (r->w, x->settings.t, x->q, x->v) != PW_OK) return PW_RETRY;
  pw_rank_rows (r->w, rows, NULL);
  for (int i = 0; active && i < x->m; i++) active[i] = r->active == NULL || r->active[i];
  return PW_OK;
}

/* 1 if det (A B^T) < 0 for the active rows of A and B (m x n): between them, J has lost rank.  G: m x m, scratch. */
static int steady_loses_rank (const pw_steady *x, const unsigned char *active, const double *A, const double *B,
                              double *G, int *pivot) {
  int rank = 0, negative = 0;
  for (int i = 0; i < x->m; i++) rank += active[i];
  for (int i = 0, row = 0; i < x->m; i++) {
    for (int k = 0, column = 0; active[i] && k < x->m; k++) {
      double sum = 0;
      for (int j = 0; active[k] && j < x->n; j++) sum += A[i * x->n + j] * B[k * x->n + j];
      if (active[k]) G[row * rank + column++] = sum;
    }
    row += active[i];
  }
  if (rank == 0 || LAPACKE_dgetrf (LAPACK_ROW_MAJOR, rank, rank, G, rank, pivot) != 0) return rank > 0;
  for (int i = 0; i < rank; i++) negative ^= (G[i * rank + i] < 0) ^ (pivot[i] != i + 1);
  return negative;
}

int pw_steady_check_step (void *steady, const double *from, const double *to, pw_error *error) {
  pw_steady *x = steady;
  const size_t m = (size_t)x->m, entries = m * (size_t)x->n;
  double *A = malloc ((2 * entries + m * m + 1) * sizeof *A + m * (1 + sizeof (int)));
  if (A == NULL) return pw_fail_memory (x->s, error);
  double *B = A + entries, *G = B + entries;
  int *pivot = (int *)(G + m * m), row = -1;
  unsigned char *active = (unsigned char *)(pivot + m);
  int status = steady_rows (x, from, A, active, error), redundant = status == PW_OK ? x->system.run->redundant : 0;
  if (status == PW_OK) status = steady_rows (x, to, B, NULL, error);
  pw_run *r = x->system.run;
  if (status == PW_OK && (r->redundant > redundant || steady_loses_rank (x, active, A, B, G, pivot))) {
    status = PW_RETRY;
    if (r->redundant > redundant)
      row = r->redundant_row[0];
    else
      pw_watchdog_sine (r, &row);
    x->why = (pw_error){ 0 };
    pw_fail (&x->why, PW_METHOD, "the constraints become singular: %s depends on other constraints",
             row >= 0 ? PW_NAME (pw_system_row_name, x->s, row) : "one of them");
  }
  free (A);
  return status;
}
