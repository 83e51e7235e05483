/* The equations of motion linearised on the constraints, in a frame that moves with the motion.
 *
 * A state obeys g (q, t) = 0 and J v = eta, so that variations obey  G dq = 0,  J dv = -B dq,  B = (J v)_q - eta_q.
 * With orthonormal bases N_q of the null space of G and N_v of that of J (both from one QR factorisation of J^T,
 * holonomic equations first, angles times L) the variations are
 *
 *     dq = N_q z,   dv = N_v u / T - J^+ B N_q z,
 *
 * with T the time scale of the scene; z and u are the minimal coordinates of the variation.  The variations of
 * the accelerations follow from the saddle-point system
 *
 *     [ M J^T ; J 0 ] (da, dlambda) = ( (f_q - (J^T lambda)_q) dq + f_v dv,  (gamma_q - (J a)_q) dq + gamma_v dv ),
 *
 * at constant time.  In a steady motion every body moves with the twist (vx, vy, w) of one frame (exceptions:
 * linear_frame.c), in which the state and the constraint manifold are at rest.  The components of vectors in that frame
 * rotate at -w, hence
 *
 *     z' = N_q^T (dv - W dq),   u' = T N_v^T (da - W dv),   W (x, y, phi) = w (-y, x, 0) for each body.
 *
 * Perturbations of a steady motion grow as exp (mu t) with the eigenvalues mu of this matrix A; linear_frame.c finds
 * the frame, and whether the motion is steady.  (Null-space form: Garcia de Jalon & Bayo 1994, Kinematic and Dynamic
 * Simulation of Multibody Systems.  Relative equilibria: Marsden & Ratiu 1999, Introduction to Mechanics and
 * Symmetry.) */
#include <lapacke.h>
#include <math.h>
#include <string.h>
#include "linear.h"
#include "rank.h"

/* ---- Derivatives ---- */

/* Adds the derivatives with respect to q and v, by rows: (J^T lambda)_q - f_q and -f_v; gamma_q - (J a)_q and gamma_v;
 * B and 0. */
static void linear_put (pw_linearisation *x, const double *v) {
  const int n = x->n, of_J = n + x->m;
  const struct {
    pw_block block;
    int row, col;
    double factor;
    const double *w;
  } part[] = { { PW_JTL_Q, 0, 0, 1, NULL },   { PW_FORCE_Q, 0, 0, -1, NULL }, { PW_FORCE_V, 0, n, -1, NULL },
               { PW_GAMMA_Q, n, 0, 1, NULL }, { PW_GAMMA_V, n, n, 1, NULL },  { PW_JW_Q, n, 0, -1, x->a },
               { PW_JW_Q, of_J, 0, 1, v },    { PW_ETA_Q, of_J, 0, -1, NULL } };
  for (size_t i = 0; i < sizeof part / sizeof *part; i++)
    pw_tangent_add_block (&x->tangent, part[i].block,
                          &(pw_placement){ .row = part[i].row,
                                           .col = part[i].col,
                                           .rows = x->m,
                                           .factor = part[i].factor,
                                           .factor_nonholonomic = part[i].factor,
                                           .direction = part[i].w,
                                           .lambda = x->lambda });
  pw_tangent_add_signals (&x->tangent, 0, 0, n);
}

int pw_linear_derivatives (pw_linearisation *x) {
  pw_scatter_map *t = &x->tangent.scatter;
  pw_scatter_begin_record (t);
  linear_put (x, x->r->v);
  int size = 2 * x->n > x->n + 2 * x->m ? 2 * x->n : x->n + 2 * x->m;
  return pw_scatter_lay_out (t, size);
}

int pw_linear_evaluate (pw_linearisation *x, double t, const double *q, const double *v) {
  int status = pw_run_accelerate (x->r, t, q, v, x->a, x->lambda);
  if (status != PW_OK) return status;
  pw_scatter_begin_fill (&x->tangent.scatter, x->tangent.scatter.value);
  linear_put (x, v);
  return PW_OK;
}

void pw_linear_multiply (pw_linearisation *x) {
  const pw_scatter_map *t = &x->tangent.scatter;
  memset (x->product, 0, ((size_t)x->n + 2 * (size_t)x->m) * sizeof *x->product);
  for (int j = 0; j < 2 * x->n; j++)
    for (int64_t i = t->colptr[j]; i < t->colptr[j + 1]; i++) x->product[t->rowind[i]] += t->value[i] * x->dx[j];
}

void pw_linear_vary (pw_linearisation *x) {
  pw_linear_multiply (x);
  for (int j = 0; j < x->n; j++) x->da[j] = -x->product[j];
  pw_saddle_solve (x->r->saddle, x->da, x->product + x->n, x->da, x->scratch);
}

/* ---- Bases ---- */

/* Column j of Q without those of the unturned angles. */
static double *linear_column (const pw_linearisation *x, int j) {
  return x->Q + (size_t)(x->unturned + j) * (size_t)x->n;
}

/* The rows of J of the independent equations, of length 1, to Q. */
static void linear_independent_rows (pw_linearisation *x) {
  size_t n = (size_t)x->n;
  pw_rank_rows (x->r->w, x->R, x->norm);
  for (int k = 0; k < x->rank; k++) memcpy (linear_column (x, k), x->R + (size_t)x->row[k] * n, n * sizeof *x->R);
}

double pw_linear_least (pw_linearisation *x) {
  int n = x->n, rank = x->rank;
  double least = INFINITY;
  linear_independent_rows (x);
  int failed = rank && LAPACKE_dgesvj_work (LAPACK_COL_MAJOR, 'G', 'N', 'N', n, rank, linear_column (x, 0), n,
                                            x->row_scratch, 0, NULL, 1, x->scratch, n + x->m + 3) != 0;
  for (int k = 0; k < rank; k++) least = fmin (least, x->scratch[0] * x->row_scratch[k]);
  return rank && !failed ? least : NAN;
}

void pw_linear_bases (pw_linearisation *x) {
  int n = x->n, rank = x->rank;
  double *tau = x->da, *unit = x->Q;
  linear_independent_rows (x);
  memset (x->Q, 0, (size_t)x->unturned * (size_t)n * sizeof *x->Q);
  for (int j = 0; j < n; j++)
    if (pw_is_unturned (x->r->s, j)) unit[j] = 1, unit += n;
  LAPACKE_dgeqrf_work (LAPACK_COL_MAJOR, n, x->unturned + rank, x->Q, n, tau, x->scratch, n);
  for (int k = 0; k < rank; k++)
    memcpy (x->R + (size_t)k * (size_t)rank, linear_column (x, k) + x->unturned, (size_t)(k + 1) * sizeof *x->R);
  LAPACKE_dorgqr_work (LAPACK_COL_MAJOR, n, n, x->unturned + rank, x->Q, n, tau, x->scratch, n);
}

/* ---- The reduced system ---- */

/* dv -= J^+ B dq, with B dq in `product`: solves R^T b = B dq, dv -= Q b. */
static void linear_follow (pw_linearisation *x) {
  double *b = x->row_scratch;
  const int stride = x->rank > 1 ? x->rank : 1; /* LAPACK refuses 0 */
  for (int i = 0; i < x->rank; i++) b[i] = x->product[x->n + x->m + x->row[i]] / x->norm[x->row[i]];
  LAPACKE_dtrtrs_work (LAPACK_COL_MAJOR, 'U', 'T', 'N', x->rank, 1, x->R, stride, b, stride);
  for (int i = 0; i < x->rank; i++)
    for (int j = 0; j < x->n; j++) x->dx[x->n + j] -= b[i] * linear_column (x, i)[j] / pw_length_factor (x->r->s, j);
}

void pw_linear_tangent (pw_linearisation *x, int c) {
  int velocity = c >= x->positions, column = velocity ? x->rank + c - x->positions : x->holonomic + c;
  double T = x->r->w->scale.time;
  memset (x->dx, 0, 2 * (size_t)x->n * sizeof *x->dx);
  for (int j = 0; j < x->n; j++)
    x->dx[velocity ? x->n + j : j] = linear_column (x, column)[j] / pw_length_factor (x->r->s, j) / (velocity ? T : 1);
  if (velocity) return;
  pw_linear_multiply (x);
  linear_follow (x);
}

/* Component of a vector over the coordinates along a column of Q. */
static double linear_along (const pw_linearisation *x, int column, const double *vector) {
  double sum = 0;
  for (int j = 0; j < x->n; j++) sum += linear_column (x, column)[j] * vector[j] * pw_length_factor (x->r->s, j);
  return sum;
}

void pw_linear_coordinates (const pw_linearisation *x, const double *dq, const double *dv, int stride, double *out) {
  for (int i = 0; i < x->positions; i++, out += stride) *out = linear_along (x, x->holonomic + i, dq);
  for (int i = 0; i < x->velocities; i++, out += stride) *out = linear_along (x, x->rank + i, dv) * x->r->w->scale.time;
}

void pw_linear_turn (const pw_linearisation *x, double w, const double *in, double *out) {
  for (int j = 0; j < 3 * x->r->s->bodies; j += 3) {
    out[j] -= w * in[j + 1];
    out[j + 1] += w * in[j];
  }
}

void pw_linear_rotate (const pw_linearisation *x, double angle, const double *in, double *out) {
  double c = pw_cos (angle), s = pw_sin (angle);
  memcpy (out, in, (size_t)x->n * sizeof *out);
  for (int j = 0; j < 3 * x->r->s->bodies; j += 3) {
    out[j] = c * in[j] - s * in[j + 1];
    out[j + 1] = s * in[j] + c * in[j + 1];
  }
}
