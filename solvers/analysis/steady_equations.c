/* The equations of steady motions.
 *
 * With the symmetries S_k (q) of the system, displacements of the whole and of angles on which nothing depends, a steady
 * motion has the velocities v = xi_1 S_1 (q) + xi_2 S_2 (q) + ... with constant xi, which in the frame that moves with it
 * is at rest: with the angular velocity w of the whole and W (x, y, phi) = w (-y, x, 0) for each body,
 *
 *     g (q, t) = 0,   J v = eta,   a (q, v) = W v,   and what is held.
 *
 * These are more equations than the unknowns q, xi and depend on each other, since symmetries and conservation laws make
 * steady motions families; continuation.h solves them by least squares.  Exact derivatives are those of the linearisation
 * (linear_variation.c) for the variations dq, dv = W dq + dxi_k S_k.  On a branch, corrections are orthogonal to the
 * symmetries that leave what is held unchanged.
 *
 * (Relative equilibria: Marsden & Ratiu 1999, Introduction to Mechanics and Symmetry.) */
#include <lapacke.h>
#include <math.h>
#include <string.h>
#include "rank.h"
#include "steady_parts.h"

/* STEADY_DIFFERENCE: half the distance of differences by a parameter of the model, relative to its range: round-off of
 * 1e-11, and an error of 1e-10 for an effect of that size in the third derivative. */
static const double STEADY_DIFFERENCE = 1e-5;

double pw_steady_parameter (const pw_steady *x, const double *u) {
  return x->set.first + (x->set.last - x->set.first) * u[x->n + x->group];
}

void pw_steady_state (pw_steady *x, const double *u) {
  for (int j = 0; j < x->n; j++) x->q[j] = u[j] * pw_unit (x->s, j);
  pw_steady_combine (x, u + x->n, x->T, x->rates);
  pw_steady_field (x, x->rates, x->q, x->v);
  if (x->set.vary >= 0) x->hold[x->set.vary].value = pw_steady_parameter (x, u);
}

int pw_steady_again (void *steady, const double *u, const double *other) {
  pw_steady *x = steady;
  size_t n = (size_t)x->n;
  double *q = x->null, *v = q + n;
  pw_steady_state (x, u);
  memcpy (q, x->q, n * sizeof *q), memcpy (v, x->v, n * sizeof *v);
  pw_steady_state (x, other);
  return pw_steady_distance (x, q, v, x->q, x->v) <= PW_BRANCH_SAME;
}

int pw_steady_guess (pw_steady *x, const double *q, const double *v, double *u, pw_error *error) {
  int n = x->n, group = x->group, rank;
  double *S = x->F, *right = S + n * group, *work = right + n + group; /* enough: see steady_arrays */
  memset (x->branch.pivot, 0, (size_t)group * sizeof *x->branch.pivot);
  for (int j = 0; j < n; j++) u[j] = q[j] / pw_unit (x->s, j), right[j] = v[j] / pw_unit (x->s, j) * x->T;
  for (int k = 0; k < group; k++) {
    pw_steady_field (x, x->axis + k * pw_steady_rates (x->s), q, S + k * n);
    for (int j = 0; j < n; j++) S[k * n + j] /= pw_unit (x->s, j);
  }
  if (group && LAPACKE_dgelsy_work (LAPACK_COL_MAJOR, n, group, 1, S, n, right, n > group ? n : group, x->branch.pivot,
                                    1e-9, &rank, work, 40 * (n + group)))
    return pw_fail (error, PW_METHOD, "the symmetries cannot be separated");
  memcpy (u + n, right, (size_t)group * sizeof *u);
  return PW_OK;
}

/* ---- Residuals ---- */

/* Those of the system at[k] in the state x->q, x->v, whose accelerations are evaluated: g, J v - eta, a - W v. */
static void steady_residual (pw_steady *x, int k, double *F) {
  pw_linearisation *l = &x->at[k].x;
  pw_workspace *w = x->at[k].r->w;
  double acceleration = x->T * x->T / x->L;
  pw_evaluate_g (w, F);
  for (int i = 0; i < x->holonomic; i++) F[i] /= x->norm[i] * x->L;
  F += x->holonomic;
  pw_mul_J (w, x->v, F);
  if (x->s->rheonomic) pw_evaluate_eta (w, l->row_scratch);
  for (int i = 0; i < x->m; i++) F[i] = (F[i] - (x->s->rheonomic ? l->row_scratch[i] : 0)) * x->T / (x->norm[i] * x->L);
  F += x->m;
  memcpy (F, l->a, (size_t)x->n * sizeof *F);
  pw_linear_turn (l, -x->rates[2], x->v, F);
  for (int j = 0; j < x->n; j++) F[j] *= pw_length_factor (x->s, j) * acceleration;
}

/* ---- Derivatives ---- */

/* The change by (dq, dv) and the angular velocity dw. */
static void steady_change (pw_steady *x, double dw, double *F) {
  pw_linearisation *l = &x->at[0].x;
  int n = x->n;
  double *dq = l->dx, *dv = l->dx + n;
  pw_mul_J (x->at[0].r->w, dq, l->row_scratch);
  for (int i = 0; i < x->holonomic; i++) *F++ = l->row_scratch[i] / (x->norm[i] * x->L);
  pw_linear_vary (l);
  pw_mul_J (x->at[0].r->w, dv, l->row_scratch);
  for (int i = 0; i < x->m; i++) *F++ = (l->row_scratch[i] + l->product[n + x->m + i]) * x->T / (x->norm[i] * x->L);
  pw_linear_turn (l, -x->rates[2], dv, l->da);
  pw_linear_turn (l, -dw, x->v, l->da);
  for (int j = 0; j < n; j++) *F++ = l->da[j] * pw_length_factor (x->s, j) * x->T * x->T / x->L;
  for (int i = 0; i < x->set.holds; i++)
    *F++ = pw_hold_change (x->s, x->hold + i, x->q, x->v, dq, dv) / pw_hold_unit (x, x->hold + i);
}

/* The conditions that dq is orthogonal to symmetries. */
static void steady_conditions (pw_steady *x, double *dF) {
  int equations = pw_steady_equations (x);
  dF += equations - x->group;
  for (int i = 0; i < x->gauge; i++) {
    double square = 0;
    pw_steady_combine (x, x->fixed + i * x->group, 1, x->sum);
    pw_steady_field (x, x->sum, x->q, x->dq);
    for (int j = 0; j < x->n; j++) x->dq[j] /= pw_unit (x->s, j), square += x->dq[j] * x->dq[j];
    for (int j = 0; j < x->n; j++) dF[j * equations + i] = x->dq[j] / sqrt (square);
  }
}

static void steady_columns (pw_steady *x, double *dF) {
  pw_linearisation *l = &x->at[0].x;
  int n = x->n, equations = pw_steady_equations (x);
  for (int c = 0; c < pw_steady_unknowns (x); c++, dF += equations) {
    const double *axis = x->axis + (c - n) * pw_steady_rates (x->s);
    memset (l->dx, 0, 2 * (size_t)n * sizeof *l->dx);
    if (c < n) {
      l->dx[c] = pw_unit (x->s, c);
      pw_linear_turn (l, x->rates[2], l->dx, l->dx + n);
    } else {
      pw_steady_field (x, axis, x->q, l->dx + n);
      for (int j = n; j < 2 * n; j++) l->dx[j] /= x->T;
    }
    steady_change (x, c < n ? 0 : axis[2] / x->T, dF);
  }
}

/* Column of a parameter of the model, by central differences, or on one side at the end of its domain. */
static int steady_by_parameter (pw_steady *x, double value, const double *F, double *dF) {
  double h = STEADY_DIFFERENCE * (x->set.last - x->set.first), distance = 0;
  int length = x->holonomic + x->m + x->n, sides = 0;
  for (int side = 1; side >= -1; side -= 2) {
    int status = pw_steady_at (x, 1, value + side * h);
    if (status < 0) return status;
    pw_linearisation *l = &x->at[1].x;
    if (status != PW_OK || pw_run_accelerate (x->at[1].r, x->set.t, x->q, x->v, l->a, l->lambda) != PW_OK) continue;
    steady_residual (x, 1, x->F);
    for (int i = 0; i < length; i++) dF[i] += side * x->F[i];
    distance += STEADY_DIFFERENCE;
    sides += side;
  }
  for (int i = 0; i < length; i++) dF[i] = (dF[i] - sides * F[i]) / distance;
  return distance > 0 ? PW_OK : PW_RETRY;
}

int pw_steady_evaluate (void *steady, const double *u, double *F, double *dF, pw_error *error) {
  pw_steady *x = steady;
  int equations = pw_steady_equations (x), unknowns = pw_steady_unknowns (x);
  double value = pw_steady_parameter (x, u), *held = F + equations - x->group - x->set.holds;
  int status = pw_steady_at (x, 0, value);
  if (status < 0) *error = x->why;
  if (status != PW_OK) return status;
  pw_linearisation *l = &x->at[0].x;
  pw_steady_state (x, u);
  status = dF ? pw_linear_evaluate (l, x->set.t, x->q, x->v)
              : pw_run_accelerate (x->at[0].r, x->set.t, x->q, x->v, l->a, l->lambda);
  if (status != PW_OK) {
    x->why = (pw_error){ 0 };
    if (status > 0) pw_fail_singular (x->at[0].r, x->set.t, &x->why);
    return PW_RETRY;
  }
  steady_residual (x, 0, F);
  for (int i = 0; i < x->set.holds; i++)
    held[i] = pw_hold_residual (x->s, x->hold + i, x->q, x->v) / pw_hold_unit (x, x->hold + i);
  if (dF == NULL) return PW_OK;
  steady_columns (x, dF);
  steady_conditions (x, dF);
  dF += (size_t)unknowns * (size_t)equations;
  if (x->set.vary >= 0)
    dF[equations - x->group - x->set.holds + x->set.vary] = pw_hold_slope (x->s, x->hold + x->set.vary, x->q, x->v) *
                                                            (x->set.last - x->set.first) /
                                                            pw_hold_unit (x, x->hold + x->set.vary);
  status = x->set.compile ? steady_by_parameter (x, value, F, dF) : PW_OK;
  if (status < 0) *error = x->why;
  return status;
}
