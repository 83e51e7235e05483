/* Null-space velocities u = B^T W v.  The columns of B are a basis of ker J0, with J0 the constraint matrix at the
 * beginning of the step, constant over the step.  W is the metric of positions: the mass matrix, with small weights for
 * massless coordinates.  The equations integrated are
 *
 *   q' = v(t, q, u),    u' = B^T W a(t, q, v),      v:  J(t, q) v = eta,  B^T W v = u
 *
 * so that all velocity constraints hold at every stage, for any step size.  u has as many entries as there are degrees
 * of freedom.  Since B is constant, a Runge-Kutta stage of u is B^T W w, with w the stage of v by the same formula.
 * Then B^T W (v - w) = 0, which puts v - w in the range of W^-1 J0^T.  So no basis is formed, and the result is
 * independent of its choice:
 *
 *   v = w + W^-1 J0^T mu,    K mu = eta - J w,    K = J W^-1 J0^T
 *
 * The next step uses another basis; v, and with it the motion, does not change.  With this W a body made of two welded
 * parts moves like one body, up to round-off, and massless coordinates follow the massive ones.  (Kim & Vanderploeg
 * 1986, QR decomposition for state space representation of constrained mechanical dynamic systems: a basis kept while
 * it is well conditioned; Mani, Haug & Atkinson 1985, Application of singular value decomposition for analysis of
 * mechanical system dynamics.)
 *
 * At the beginning of the step K is symmetric positive definite, and its factorisation needs no pivoting; it is
 * repeated with pivoting if a pivot becomes small. */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "rk_step.h"
#include "unroll.h"
#include "util.h"

/* ---- Opening ---- */

int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  *b = (pw_nullspace){ .rows = s->rows - r->redundant };
  if (b->rows > PW_NULLSPACE_MOST)
    return pw_fail (error, PW_INPUT,
                    "model %s: stabilisation nullspace works with dense matrices, for up to %d constraint rows, and "
                    "this scene has %d; use %s+projection",
                    s->model, PW_NULLSPACE_MOST, b->rows, r->method->name);
  const size_t m = (size_t)b->rows, all = (size_t)s->rows, n = (size_t)s->coords;
  const pw_array array[] = {
    { &b->W_inv_J0T, n * m }, { &b->K, m * m }, { &b->mu, m }, { &b->eta, all }, { &b->v, n + 3 }
  };
  b->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  b->active_index = malloc ((2 * all + 1) * sizeof *b->active_index);
  if (b->memory == NULL || b->active_index == NULL) return pw_fail_memory (s, error);
  b->pivot = b->active_index + all;
  for (int i = 0, count = 0; i < s->rows; i++) b->active_index[i] = r->active && !r->active[i] ? -1 : count++;
  return PW_OK;
}

void pw_nullspace_close (pw_nullspace *b) {
  free (b->memory);
  free (b->active_index);
  *b = (pw_nullspace){ 0 };
}

/* ---- K mu = eta - J w; m: number of rows, a constant in the most frequent case, 4, so that loops are unrolled ---- */

/* K_i += J_i W^-1 J0^T, mu_i -= J_i w, for the entries J of row i in columns j to j + width - 1: 3 of a body, or 1. */
PW_INLINE void nullspace_gather (pw_nullspace *b, int i, int j, int width, const double *J, const double *w, int m) {
  double *restrict K = b->K + i * m;
  const double *restrict x = b->W_inv_J0T + (size_t)j * (size_t)m, *restrict y = x + m, *restrict phi = y + m;
  if (width == 1) {
    PW_UNROLL for (int n = 0; n < m; n++) K[n] += J[0] * x[n];
    b->mu[i] -= J[0] * w[j];
  } else {
    const double J_x = J[0], J_y = J[1], J_phi = J[2];
    PW_UNROLL for (int n = 0; n < m; n++) K[n] += J_x * x[n] + J_y * y[n] + J_phi * phi[n];
    b->mu[i] -= J_x * w[j] + J_y * w[j + 1] + J_phi * w[j + 2];
  }
}

/* Assembles K and mu = eta - J w with the J last evaluated. */
PW_INLINE void nullspace_assemble (pw_nullspace *b, pw_run *r, const double *w, int m) {
  const pw_system *s = r->s;
  memset (b->K, 0, (size_t)(m * m) * sizeof *b->K);
  if (s->rheonomic) pw_evaluate_eta (r->w, b->eta); /* else it stays 0 */
  for (int i = 0; i < s->rows; i++)
    if (b->active_index[i] >= 0) b->mu[b->active_index[i]] = b->eta[i];
  for (const pw_element_batch *k = r->w->batch; k < r->w->batch + s->constraints; k++) {
    const int cols = k->b.cols, of_bodies = 3 * k->kind->bodies;
    const double *J = k->J;
    for (int n = 0; n < k->b.count * k->kind->rows; n++, J += cols)
      for (int i = b->active_index[k->row + n], c = i < 0 ? cols : 0, width; c < cols; c += width) {
        int j = pw_global (k, n / k->kind->rows, c);
        width = c < of_bodies ? 3 : 1;
        if (j < s->coords) nullspace_gather (b, i, j, width, J + c, w, m); /* else: the ground */
      }
  }
}

/* mu = K^-1 mu without pivoting; K is factorised in place.  Returns 0 if a pivot is not positive, or smaller than
 * `least` times its diagonal entry. */
PW_INLINE int nullspace_eliminate (double *restrict K, double *restrict mu, int m) {
  const double least = 0.01; /* two decimal digits are lost */
  PW_UNROLL for (int p = 0; p < m; p++) {
    double diagonal = K[p * m + p];
    PW_UNROLL for (int i = 0; i < p; i++) {
      double factor = K[p * m + i] * K[i * m + i];
      PW_UNROLL for (int j = i + 1; j < m; j++) K[p * m + j] -= factor * K[i * m + j];
      mu[p] -= factor * mu[i];
    }
    if (!(K[p * m + p] > least * fabs (diagonal))) return 0;
    K[p * m + p] = 1 / K[p * m + p];
  }
  PW_UNROLL for (int i = m - 1; i >= 0; i--) {
    PW_UNROLL for (int j = i + 1; j < m; j++) mu[i] -= K[i * m + j] * mu[j];
    mu[i] *= K[i * m + i];
  }
  return 1;
}

/* The same by LAPACK, with scaled rows and pivoting.  PW_RETRY if a pivot is round-off, as for dependent constraint
 * equations, or a row is 0 or not finite. */
static int nullspace_eliminate_pivoted (pw_nullspace *b) {
  const double least = 1e-13; /* some 500 eps; the largest entry of a row is 1 */
  int m = b->rows;
  double *K = b->K;
  for (int i = 0; i < m; i++) {
    double most = 0;
    for (int j = 0; j < m; j++) most = pw_larger_or_nan (most, fabs (K[i * m + j]));
    if (!(most > 0 && isfinite (most))) return PW_RETRY;
    for (int j = 0; j < m; j++) K[i * m + j] /= most;
    b->mu[i] /= most;
  }
  for (int i = 0; i < m; i++) /* transpose: LAPACK stores columns */
    for (int j = 0; j < i; j++) {
      double below = K[i * m + j];
      K[i * m + j] = K[j * m + i], K[j * m + i] = below;
    }
  LAPACKE_dgetrf_work (LAPACK_COL_MAJOR, m, m, K, m, b->pivot);
  for (int p = 0; p < m; p++)
    if (!(fabs (K[p * m + p]) > least)) return PW_RETRY;
  LAPACKE_dgetrs_work (LAPACK_COL_MAJOR, 'N', m, 1, K, m, b->pivot, b->mu, m);
  return PW_OK;
}

/* v += W^-1 J0^T mu */
PW_INLINE void nullspace_add (const pw_nullspace *b, int coords, double *v, int m) {
  const double *row = b->W_inv_J0T;
  for (int j = 0; j < coords; j++, row += m) {
    double sum = 0;
    PW_UNROLL for (int n = 0; n < m; n++) sum += row[n] * b->mu[n];
    v[j] += sum;
  }
}

/* ---- A step ---- */

int pw_nullspace_begin (pw_nullspace *b, pw_run *r) {
  const pw_system *s = r->s;
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  if (status != PW_OK) return status;
  for (const pw_element_batch *k = r->w->batch; k < r->w->batch + s->constraints; k++)
    for (int n = 0; n < k->b.count * k->kind->rows; n++)
      for (int i = b->active_index[k->row + n], c = i < 0 ? k->b.cols : 0; c < k->b.cols; c++) {
        int j = pw_global (k, n / k->kind->rows, c);
        if (j < s->coords) b->W_inv_J0T[j * b->rows + i] = k->J[n * k->b.cols + c] / s->metric[j];
      }
  return PW_OK;
}

/* v += W^-1 J0^T mu, with mu found without pivoting from w = v; returns 0 if a pivot is too small. */
PW_INLINE int nullspace_solve (pw_nullspace *b, pw_run *r, double *v, int m) {
  nullspace_assemble (b, r, v, m);
  if (!nullspace_eliminate (b->K, b->mu, m)) return 0;
  nullspace_add (b, r->s->coords, v, m);
  return 1;
}

/* The same, if necessary with pivoting, at the J last evaluated.  Updates the velocity kinematics.  Returns as
 * pw_nullspace_velocities. */
static int nullspace_correct_velocities (pw_nullspace *b, pw_run *r, double *v) {
  const int m = b->rows;
  if (!(m == 4 ? nullspace_solve (b, r, v, 4) : nullspace_solve (b, r, v, m))) {
    nullspace_assemble (b, r, v, m);
    if (nullspace_eliminate_pivoted (b) != PW_OK) return PW_RETRY;
    nullspace_add (b, r->s->coords, v, m);
  }
  return pw_update_velocities (r->w, v);
}

int pw_nullspace_velocities (pw_nullspace *b, pw_run *r, double t, const double *q, double *v) {
  int status = pw_evaluate_J_at (r->w, t, q, v);
  return status == PW_OK ? nullspace_correct_velocities (b, r, v) : status;
}

int pw_nullspace_accelerate (pw_run *r, const double *v, double *a, double *lambda) {
  int status = pw_run_accelerate_evaluated (r, v, a, lambda);
  if (pw_watchdog_near (r)) r->near_singular = 1;
  return status;
}

int pw_nullspace_finalise (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v,
                           double *added_energy) {
  int status = PW_OK;
  double before = 0;
  if (p == NULL || r->s->holonomic == 0) return pw_nullspace_velocities (b, r, t, q, v);
  if (added_energy) { /* before the projection, with the same null-space velocities */
    memcpy (b->v, v, (size_t)r->s->coords * sizeof *v);
    status = pw_nullspace_velocities (b, r, t, q, b->v);
    if (status == PW_OK) before = pw_energy (r, b->v);
  }
  if (status == PW_OK) status = pw_project_positions (p, r, t, q, v);
  if (status == PW_OK) status = nullspace_correct_velocities (b, r, v);
  if (status == PW_OK && added_energy) *added_energy += pw_energy (r, v) - before;
  return status;
}
