/* The equations of a step of galpha, solved by Newton's iteration.  The unknowns are q', v', lambda' and mu; w' and a' follow
 * from v'.  With c = gamma / (h beta) and e = (1 - alpha_m) / ((1 - alpha_f) h gamma):
 *
 *   c (q' - q - h v - h^2 (1/2 - beta) w - h^2 beta w') + D G^T mu = 0          dw' = dv' / (h gamma)
 *   M a' + J^T lambda' - f = 0                                                 da' = e dv'
 *   J v' - eta = 0,  g = 0
 *
 * so the matrix is that of ida with c and e as the coefficients of dF/dy'.  Corrections of v', lambda', mu are in units
 * of c, c e m, c, and the equations are divided by c, c e m, c, with m a mass: then all entries are of the same size
 * for every h. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "galpha_state.h"

static int galpha_update (pw_run *r, double t1) {
  return pw_evaluate_J_at (r->w, pw_before_breakpoint (r, t1), r->data->work.q1, r->data->work.v1);
}

/* ---- Residual ---- */

static void galpha_kinematics (pw_run *r, double h, double *out) {
  galpha *d = r->data;
  double c = d->gamma / (h * d->beta);
  pw_tangent_pull (&d->work.tangent, d->mu1, d->positions, d->pull);
  for (int j = 0; j < d->n; j++) {
    double dq = h * (d->v[j] + h * ((0.5 - d->beta) * d->w[j] + d->beta * d->w1[j]));
    out[j] = c * (d->work.q1[j] - r->q[j] - dq) + d->work.tangent.D[j] * d->pull[j];
  }
}

static void galpha_momentum (pw_run *r, double *out) {
  galpha *d = r->data;
  pw_tangent_pull (&d->work.tangent, d->lambda1, d->rows, d->pull);
  pw_evaluate_force (r->w, d->f);
  for (int j = 0; j < d->n; j++) out[j] = r->s->mass[j] * d->a1[j] + d->pull[j] - d->f[j];
}

/* ggl: J v - eta, then g.  index3: J v - eta, with g in place of the holonomic equations. */
static void galpha_constraints (pw_run *r, double *out) {
  galpha *d = r->data;
  const pw_system *s = r->s;
  pw_mul_J (r->w, d->work.v1, d->jv);
  pw_evaluate_eta (r->w, d->eta);
  for (int i = 0; i < s->rows; i++) d->jv[i] -= d->eta[i];
  if (d->ggl) pw_tangent_compress (&d->work.tangent, d->jv, d->rows, out);
  pw_evaluate_g (r->w, d->ggl ? d->eta : d->jv);
  if (d->ggl)
    pw_tangent_compress (&d->work.tangent, d->eta, d->positions, out + d->rows);
  else
    pw_tangent_compress (&d->work.tangent, d->jv, d->rows, out);
}

static int galpha_residual (pw_run *r, double h, double t1) {
  galpha *d = r->data;
  int status = galpha_update (r, t1);
  if (status != PW_OK) return status;
  galpha_kinematics (r, h, d->z);
  galpha_momentum (r, d->z + d->n);
  galpha_constraints (r, d->z + 2 * d->n);
  r->statistics.rhs++;
  return PW_OK;
}

/* ---- Matrix ---- */

static void galpha_fill (pw_run *r, double h) {
  galpha *d = r->data;
  int n = d->n;
  const pw_tangent_layout to = { .momentum = n,
                                 .constraint = 2 * n,
                                 .v = n,
                                 .a = n,
                                 .lambda = 2 * n,
                                 .mu = 2 * n + d->rows,
                                 .of_q = d->gamma / (h * d->beta),
                                 .of_a = (1 - d->alpha_m) / ((1 - d->alpha_f) * h * d->gamma),
                                 .of_lambda = 1 };
  pw_tangent_kinematics (&d->work.tangent, &to, pw_tangent_mu (&d->work.tangent, d->mu1, d->positions));
  pw_tangent_momentum (&d->work.tangent, &to, pw_tangent_lambda (&d->work.tangent, d->lambda1));
  pw_tangent_velocities (&d->work.tangent, &to, d->work.v1, d->ggl);
  pw_tangent_positions (&d->work.tangent, &to, d->ggl ? 2 * n + d->rows : 2 * n);
}

int pw_galpha_open_matrix (pw_run *r) {
  galpha *d = r->data;
  pw_scatter_record (&d->work.tangent.scatter);
  galpha_fill (r, 1);
  return pw_implicit_lay_out (&d->work, d->size);
}

static int galpha_factor (pw_run *r, double h) {
  galpha *d = r->data;
  const pw_tangent *x = &d->work.tangent;
  pw_implicit_fill (&d->work, d->size);
  galpha_fill (r, h);
  for (int c = 0; c < d->size; c++)
    for (int64_t i = x->colptr[c]; i < x->colptr[c + 1]; i++) d->work.value[i] *= d->row[x->rowind[i]] * d->column[c];
  r->statistics.jacobians++;
  r->statistics.factorisations++;
  return pw_sparse_factor (&d->work.sparse, d->work.value);
}

/* ---- Iteration ---- */

/* The prediction: the accelerations stay constant. */
static void galpha_predict (pw_run *r, double h) {
  galpha *d = r->data;
  for (int j = 0; j < d->n; j++) {
    d->a1[j] = d->a[j];
    d->w1[j] = (d->a[j] - d->alpha_m * d->w[j]) / (1 - d->alpha_m);
    d->work.v1[j] = d->v[j] + h * ((1 - d->gamma) * d->w[j] + d->gamma * d->w1[j]);
    d->work.q1[j] = r->q[j] + h * (d->v[j] + h * ((0.5 - d->beta) * d->w[j] + d->beta * d->w1[j]));
  }
  pw_tangent_compress (&d->work.tangent, r->lambda, d->rows, d->lambda1);
  memset (d->mu1, 0, (size_t)r->s->rows * sizeof *d->mu1);
}

/* Solves for the correction and applies it.  *most: its size, the largest of q and h v in units of the scene; *floor:
 * their round-off.  PW_OK or PW_RESOURCE. */
static int galpha_correct (pw_run *r, double h, double *most, double *floor) {
  galpha *d = r->data;
  int n = d->n;
  double large = 1, e = (1 - d->alpha_m) / ((1 - d->alpha_f) * h * d->gamma);
  for (int i = 0; i < d->size; i++) d->z[i] *= -d->row[i];
  if (pw_sparse_solve (&d->work.sparse, d->z) != PW_OK) return PW_RESOURCE;
  *most = 0;
  for (int j = 0; j < n; j++) {
    double unit = pw_unit (r->s, j), size = pw_larger_or_nan (fabs (d->z[j]), fabs (d->z[n + j])) / unit;
    *most = pw_larger_or_nan (*most, size);
    d->z[n + j] *= d->column[n + j];
    d->work.q1[j] += d->z[j];
    d->w1[j] += d->z[n + j] / (h * d->gamma);
    d->a1[j] += e * d->z[n + j];
    d->work.v1[j] = d->v[j] + h * ((1 - d->gamma) * d->w[j] + d->gamma * d->w1[j]);
    large = fmax (large, fmax (fabs (d->work.q1[j]), h * fabs (d->work.v1[j])) / unit);
  }
  for (int i = 0; i < d->rows; i++) d->lambda1[i] += d->column[2 * n + i] * d->z[2 * n + i];
  for (int i = 0; i < d->positions; i++) d->mu1[i] += d->column[2 * n + d->rows + i] * d->z[2 * n + d->rows + i];
  *floor = 4 * DBL_EPSILON * large;
  return PW_OK;
}

/* The matrix is evaluated at the prediction, and again while convergence is slow.  The remaining error must be small
 * against the method's error in multipliers, which is of order h^2; a correction changes the multipliers by 1/h^2 times
 * its size. */
int pw_galpha_solve (pw_run *r, double h, double t1) {
  const int most = 20;
  galpha *d = r->data;
  double before = INFINITY, size, floor, good = fmin (1e-9, 1e-3 * pow (h / r->w->scale.time, 4)), rate = 1;
  if (h != d->work.h)
    pw_implicit_scale (&d->work.tangent, d->positions, d->ggl ? 0 : d->work.tangent.holonomic, d->gamma / (h * d->beta),
                       (1 - d->alpha_m) / ((1 - d->alpha_f) * h * d->gamma), d->row, d->column);
  galpha_predict (r, h);
  for (int i = 0, fresh = 1; i < most; i++) {
    int status = galpha_residual (r, h, t1);
    if (status == PW_OK && fresh) status = galpha_factor (r, h);
    if (status == PW_OK) status = galpha_correct (r, h, &size, &floor);
    if (status != PW_OK) return status;
    double enough = fmax (good, floor);
    if (!isfinite (size)) return PW_RETRY;
    if (i > 0) rate = size / before;
    int stalled = rate > 0.25 && size <= 32 * floor;
    if (size <= enough || stalled || (rate < 1 && size * rate / (1 - rate) <= enough)) return galpha_update (r, t1);
    if (rate > 2 && i > 3) return PW_RETRY;
    fresh = i > 0 && rate > 0.02;
    if (fresh) pw_sparse_forget (&d->work.sparse);
    before = size;
  }
  return PW_RETRY;
}
