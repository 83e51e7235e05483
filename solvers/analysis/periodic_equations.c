/* Equations of relative periodic motions, by single shooting; multipliers.
 *
 * P (y) is the consistent state nearest to y, phi (y) the state one period after y, and D (d) y the state y displaced
 * by the symmetries of the system, by the k-th one at its rates for the time d_k.  The unknowns are y, d and, if it is
 * free, the period:
 *
 *     phi (P (y)) - D (d) P (y) = 0,    y - P (y) = 0,
 *
 * and corrections are orthogonal to symmetries and, with a free period, to the motion.  Derivatives of phi are
 * differences of runs (derivatives.c), along a basis B of perturbations on the constraints (x->basis).  P' = B B^+
 * (x->dual: B^+) is exact for such perturbations; on branches, whose tangents need all others, P' is computed by
 * differences.
 *
 * Multipliers are the eigenvalues of the monodromy matrix D (d)^-1 phi' in minimal coordinates of perturbations, in
 * the frame that has moved with the whole.  (Wulff & Schebesch 2008, Numerical continuation of symmetric periodic
 * orbits.) */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "periodic_parts.h"

/* Speed along the orbit, after removal of symmetries, below which a motion is steady, in units of the scene. */
static const double EQUATIONS_STEADY = 1e-4;

/* ---- Displacements ---- */

/* x->work = the rates of the displacement d, x->state = D (d) y at the initial state y = x->y0. */
static void equations_displace (pw_periodic *x, const double *d) {
  pw_steady_combine (x->steady, d, 1, x->work);
  memcpy (x->state, x->y0, 2 * (size_t)x->n * sizeof *x->state);
  pw_steady_displace (x->steady, x->work, 1, x->state, x->state + x->n);
}

/* ---- Equations ---- */

/* After a flow from the state of u. */
static void equations_residual (pw_periodic *x, const double *u, double *F) {
  int states = 2 * x->n;
  equations_displace (x, u + states);
  for (int j = 0; j < states; j++) {
    F[j] = pw_periodic_difference (x, j, x->y1[j], x->state[j]) / pw_periodic_unit (x, j);
    F[states + j] = u[j] - x->y0[j] / pw_periodic_unit (x, j);
  }
}

/* Adds the derivatives of -D (d) y with respect to d, by differences. */
static void equations_by_displacement (pw_periodic *x, const double *u, int rows, double *column) {
  const double h = 1e-6;
  int states = 2 * x->n;
  double *d = x->work + pw_steady_rate_count (x->s);
  for (int k = 0; k < x->symmetries; k++, column += rows)
    for (int side = -1; side <= 1; side += 2) {
      memcpy (d, u + states, (size_t)x->symmetries * sizeof *d);
      d[k] += side * h;
      equations_displace (x, d);
      for (int j = 0; j < states; j++) column[j] -= side * x->state[j] / (2 * h) / pw_periodic_unit (x, j);
    }
}

/* The change of D (d) y by a change of y: positions and velocities rotate by the angle w. */
static void equations_rotate (const pw_periodic *x, double w, const double *in, double *out) {
  pw_linear_rotate (&x->steady->system.linearisation, w, in, out);
  pw_linear_rotate (&x->steady->system.linearisation, w, in + x->n, out + x->n);
}

/* The angle by which the whole turns in the last flow: that of the first body whose angle no symmetry changes except by
 * turning the whole, or 0. */
static double equations_turn (const pw_periodic *x) {
  int rates = pw_steady_rate_count (x->s);
  for (int b = 0; b < x->s->bodies; b++) {
    int others = 0;
    for (int k = 0; k < x->symmetries; k++) others += x->steady->symmetry[k * rates + PW_RATE_ANGLES + b] != 0;
    if (others == 0) return x->y1[3 * b + 2] - x->y0[3 * b + 2];
  }
  return 0;
}

int pw_periodic_guess_displacement (pw_periodic *x, double *u, pw_error *error) {
  enum { CORRECTIONS = 3 }; /* the rotation is known; for a given one translations are linear */
  int states = 2 * x->n, count = x->symmetries, rates = pw_steady_rate_count (x->s), rank;
  size_t rows = 2 * (size_t)states, work_size = rows + (size_t)(PW_PERIODIC_WORK * (states + count));
  int status = count ? pw_periodic_flow (x, u, PW_FLOW, error) : PW_OK;
  if (status != PW_OK || count == 0) return status;
  double *F = calloc (rows + rows * (size_t)count + work_size, sizeof *F), *M = F + rows,
         *work = M + rows * (size_t)count;
  if (F == NULL) return pw_fail_memory (x->s, error);
  for (int k = 0; k < count; k++) {
    double turn = x->steady->symmetry[k * rates + PW_RATE_TURN];
    if (turn != 0) u[states + k] = equations_turn (x) / turn;
  }
  for (int i = 0; i < CORRECTIONS; i++) {
    equations_residual (x, u, F);
    memset (M, 0, rows * (size_t)count * sizeof *M);
    memset (x->branch.pivot, 0, (size_t)count * sizeof *x->branch.pivot);
    equations_by_displacement (x, u, (int)rows, M);
    if (LAPACKE_dgelsy_work (LAPACK_COL_MAJOR, states, count, 1, M, (int)rows, F, (int)rows, x->branch.pivot,
                             PW_STEADY_RANK, &rank, work, (int)work_size))
      break;
    for (int k = 0; k < count; k++) u[states + k] -= F[k];
  }
  free (F);
  return PW_OK;
}

/* Adds the derivatives with respect to y. */
static void equations_by_state (pw_periodic *x, const double *u, int rows, double *dF) {
  int states = 2 * x->n, size = x->size;
  pw_steady_combine (x->steady, u + states, 1, x->work);
  for (int c = 0; c < size; c++) {
    const double *B = x->basis + states * c, *Phi = x->Phi + states * c;
    equations_rotate (x, x->work[PW_RATE_TURN], B, x->state);
    for (int i = 0; i < states; i++) {
      double unit = pw_periodic_unit (x, i), by = (Phi[i] - x->state[i]) / unit, own = B[i] / unit;
      for (int j = 0; j < states; j++) {
        dF[j * rows + i] += by * x->dual[j * size + c];
        dF[j * rows + states + i] -= own * x->dual[j * size + c];
      }
    }
  }
  for (int j = 0; j < states; j++) dF[j * rows + states + j] += 1;
}

/* Direction k in which solutions can be shifted, along symmetries and in time, into x->change. */
static void equations_shift (pw_periodic *x, int k) {
  const size_t n = (size_t)x->n, bytes = n * sizeof *x->change;
  if (k == x->symmetries) { /* in time */
    memcpy (x->change, x->y0 + n, bytes), memcpy (x->change + n, x->a0, bytes);
    return;
  }
  const double *symmetry = x->steady->symmetry + k * pw_steady_rate_count (x->s);
  pw_steady_velocities (x->steady, symmetry, x->y0, x->change);
  memset (x->change + n, 0, bytes);
  pw_linear_turn (&x->steady->system.linearisation, symmetry[PW_RATE_TURN], x->y0 + n, x->change + n);
}

/* The conditions that corrections are orthogonal to these directions. */
static void equations_orthogonal (pw_periodic *x, int rows, double *dF) {
  int states = 2 * x->n;
  for (int k = 0; k < x->symmetries + x->settings.free; k++) {
    double sum = 0;
    equations_shift (x, k);
    for (int j = 0; j < states; j++) sum += pow (x->change[j] / pw_periodic_unit (x, j), 2);
    for (int j = 0; j < states && sum > 0; j++)
      dF[j * rows + 2 * states + k] = x->change[j] / pw_periodic_unit (x, j) / sqrt (sum);
  }
}

/* The derivatives with respect to the period. */
static void equations_by_period (pw_periodic *x, double *column) {
  for (int j = 0; j < x->n; j++) {
    column[j] = x->y1[x->n + j] * x->T / pw_periodic_unit (x, j);
    column[x->n + j] = x->a1[j] * x->T / pw_periodic_unit (x, x->n + j);
  }
}

/* The flow without derivatives comes last: the equations need its x->y0 to x->a1. */
int pw_periodic_evaluate (void *periodic, const double *u, double *F, double *dF, pw_error *error) {
  pw_periodic *x = periodic;
  int rows = x->branch.problem.equations, states = 2 * x->n;
  int status = dF ? pw_periodic_flow (x, u, PW_FLOW_DERIVATIVES, error) : PW_OK;
  if (status == PW_OK) status = pw_periodic_flow (x, u, PW_FLOW, error);
  if (status != PW_OK) return status;
  equations_residual (x, u, F);
  if (dF == NULL) return PW_OK;
  equations_by_state (x, u, rows, dF);
  equations_by_displacement (x, u, rows, dF + states * rows);
  if (x->settings.free) equations_by_period (x, dF + (pw_periodic_unknowns (x) - 1) * rows);
  equations_orthogonal (x, rows, dF);
  return PW_OK;
}

/* ---- Multipliers ---- */

/* Minimal coordinates of a change of the initial state. */
static void equations_coordinates (const pw_periodic *x, const double *change, double *out) {
  memset (out, 0, (size_t)x->size * sizeof *out);
  for (int j = 0; j < 2 * x->n; j++)
    for (int c = 0; c < x->size; c++) out[c] += x->dual[j * x->size + c] * change[j] / pw_periodic_unit (x, j);
}

/* Sorts multipliers by modulus, the largest first; of a pair that with im > 0 first. */
static void equations_sort (int count, double *re, double *im) {
  for (int i = 1; i < count; i++)
    for (int k = i; k > 0; k--) {
      double before = hypot (re[k - 1], im[k - 1]), here = hypot (re[k], im[k]);
      if (!(here > before * (1 + 1e-12) || (here > before * (1 - 1e-12) && im[k] > im[k - 1]))) break;
      double swap = re[k];
      re[k] = re[k - 1], re[k - 1] = swap;
      swap = im[k], im[k] = im[k - 1], im[k - 1] = swap;
    }
}

/* The shifts in minimal coordinates, by columns of S.  Returns their number. */
static int equations_shifts (pw_periodic *x, double *S) {
  int k = 0;
  for (; k < x->symmetries + x->settings.free && k < x->size; k++) {
    equations_shift (x, k);
    equations_coordinates (x, x->change, S + k * x->size);
  }
  return k;
}

/* The eigenvalues of the diagonal block from row `first` of x->monodromy, into x->re and x->im from entry `to`. */
static int equations_block (pw_periodic *x, int first, int count, int to, double *block, double *work) {
  for (int c = 0; c < count; c++)
    memcpy (block + c * count, x->monodromy + (first + c) * x->size + first, (size_t)count * sizeof *block);
  if (count && LAPACKE_dgeev_work (LAPACK_COL_MAJOR, 'N', 'N', count, block, count, x->re + to, x->im + to, NULL, 1,
                                   NULL, 1, work, PW_PERIODIC_WORK * x->size))
    return PW_METHOD;
  equations_sort (count, x->re + to, x->im + to);
  return PW_OK;
}

/* In coordinates that begin with the shifts, the monodromy matrix is block triangular: the first block is trivial. */
int pw_periodic_multipliers (pw_periodic *x, const double *u, int *trivial) {
  int n = x->n, size = x->size, lwork = PW_PERIODIC_WORK * size;
  double *S = x->monodromy + size * size, *tau = S + size * size, *work = tau + size;
  int k = *trivial = equations_shifts (x, S);
  pw_steady_combine (x->steady, u + 2 * n, 1, x->work);
  if (size == 0) return PW_OK;
  for (int c = 0; c < size; c++) {
    equations_rotate (x, -x->work[PW_RATE_TURN], x->Phi + 2 * n * c, x->change);
    equations_coordinates (x, x->change, x->monodromy + c * size);
  }
  LAPACKE_dgeqrf_work (LAPACK_COL_MAJOR, size, k, S, size, tau, work, lwork);
  if (x->settings.free && k > x->symmetries && fabs (S[(k - 1) * size + k - 1]) * x->T < EQUATIONS_STEADY * x->L) {
    pw_fail (&x->why, PW_METHOD, "Newton's method leads to a steady motion or an equilibrium");
    return PW_RETRY;
  }
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'L', 'T', size, size, k, S, size, tau, x->monodromy, size, work, lwork);
  LAPACKE_dormqr_work (LAPACK_COL_MAJOR, 'R', 'N', size, size, k, S, size, tau, x->monodromy, size, work, lwork);
  int status = equations_block (x, k, size - k, 0, S, work);
  return status == PW_OK ? equations_block (x, 0, k, size - k, S, work) : status;
}
