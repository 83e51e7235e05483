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
 * mechanical system dynamics.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "rk.h"
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
  b->active_index = malloc ((all + 1) * sizeof *b->active_index);
  if (b->memory == NULL || b->active_index == NULL) return pw_fail_memory (s, error);
  for (int i = 0, count = 0; i < s->rows; i++) b->active_index[i] = r->active && !r->active[i] ? -1 : count++;
  return PW_OK;
}

void pw_nullspace_close (pw_nullspace *b) {
  free (b->memory);
  free (b->active_index);
  *b = (pw_nullspace){ 0 };
}

/* ---- K mu = eta - J w ---- */

/* Computes K and mu = eta - J w with the J last evaluated. */
static void nullspace_assemble (pw_nullspace *b, pw_run *r, const double *w) {
  const pw_system *s = r->s;
  const int m = b->rows;
  memset (b->K, 0, (size_t)(m * m) * sizeof *b->K);
  if (s->rheonomic) pw_evaluate_eta (r->w, b->eta); /* else it stays 0 */
  PW_EACH_CONSTRAINT (k, r->w)
    for (int n = 0; n < k->b.count * k->kind->rows; n++) {
      int i = b->active_index[k->row + n];
      if (i < 0) continue;
      b->mu[i] = b->eta[k->row + n];
      for (int c = 0; c < k->b.cols; c++) {
        int j = pw_global (k, n / k->kind->rows, c);
        double J = k->J[n * k->b.cols + c];
        if (j >= s->coords) continue; /* the ground */
        b->mu[i] -= J * w[j];
        pw_add_scaled (b->K + i * m, b->W_inv_J0T + j * m, J, m);
      }
    }
}

/* Exchanges rows i and k. */
static void nullspace_exchange (double *K, double *mu, int m, int i, int k) {
  for (int j = 0; j < m; j++) {
    double x = K[i * m + j];
    K[i * m + j] = K[k * m + j], K[k * m + j] = x;
  }
  double x = mu[i];
  mu[i] = mu[k], mu[k] = x;
}

/* mu = K^-1 mu by Gaussian elimination with pivoting; row i is scaled to the largest entry 1.  PW_RETRY if a pivot is
 * round-off, as for dependent constraint equations, or a row is 0 or not finite. */
static int nullspace_eliminate (double *K, double *mu, int m) {
  const double least = 1e-13; /* some 500 eps */
  for (int i = 0; i < m; i++) {
    double most = 0;
    for (int j = 0; j < m; j++) most = pw_larger_or_nan (most, fabs (K[i * m + j]));
    if (!(most > 0 && isfinite (most))) return PW_RETRY;
    for (int j = 0; j < m; j++) K[i * m + j] *= 1 / most;
    mu[i] /= most;
  }
  for (int p = 0; p < m; p++) {
    int pivot = p;
    for (int i = p + 1; i < m; i++)
      if (fabs (K[i * m + p]) > fabs (K[pivot * m + p])) pivot = i;
    if (!(fabs (K[pivot * m + p]) > least)) return PW_RETRY;
    if (pivot != p) nullspace_exchange (K, mu, m, p, pivot);
    double inverse = K[p * m + p] = 1 / K[p * m + p];
    for (int i = p + 1; i < m; i++) {
      double factor = K[i * m + p] * inverse;
      if (factor == 0) continue; /* K is sparse: in chains it is banded */
      pw_add_scaled (&K[i * m + p + 1], &K[p * m + p + 1], -factor, m - p - 1);
      mu[i] -= factor * mu[p];
    }
  }
  for (int i = m - 1; i >= 0; i--) {
    for (int j = i + 1; j < m; j++) mu[i] -= K[i * m + j] * mu[j];
    mu[i] *= K[i * m + i];
  }
  return PW_OK;
}

/* ---- A step ---- */

int pw_nullspace_begin (pw_nullspace *b, pw_run *r) {
  const pw_system *s = r->s;
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  if (status != PW_OK) return status;
  PW_EACH_CONSTRAINT (k, r->w)
    for (int n = 0; n < k->b.count * k->kind->rows; n++)
      for (int i = b->active_index[k->row + n], c = i < 0 ? k->b.cols : 0; c < k->b.cols; c++) {
        int j = pw_global (k, n / k->kind->rows, c);
        if (j < s->coords) b->W_inv_J0T[j * b->rows + i] = k->J[n * k->b.cols + c] / s->metric[j];
      }
  return PW_OK;
}

/* Corrects v with the J last evaluated; updates the velocity kinematics.  Returns as pw_nullspace_velocities. */
static int nullspace_correct_velocities (pw_nullspace *b, pw_run *r, double *v) {
  const double *row = b->W_inv_J0T;
  nullspace_assemble (b, r, v);
  if (nullspace_eliminate (b->K, b->mu, b->rows) != PW_OK) return PW_RETRY;
  for (int j = 0; j < r->s->coords; j++, row += b->rows)
    for (int n = 0; n < b->rows; n++) v[j] += row[n] * b->mu[n];
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
