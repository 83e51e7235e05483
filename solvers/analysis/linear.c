/* The equations of motion linearised on the constraints, in a frame that moves with the motion: degrees of freedom,
 * eigenvalues, the step RK4 can take.
 *
 * A state obeys g (q, t) = 0 and J v = eta, so that variations obey  G dq = 0,  J dv = -B dq,  B = (J v)_q - eta_q.
 * With orthonormal bases N_q of the null space of G and N_v of that of J (both from one QR factorisation of J^T, holonomic
 * rows first, in units of the scene) they are
 *
 *     dq = N_q z,   dv = N_v u / T - J^+ B N_q z,
 *
 * T the scene's time scale, and z and u are minimal coordinates of the states around this one.  Accelerations vary by the saddle point,
 *
 *     [ M J^T ; J 0 ] (da, dlambda) = ( (f_q - (J^T lambda)_q) dq + f_v dv,  (gamma_q - (J a)_q) dq + gamma_v dv ),
 *
 * time held still.  In a steady motion every body moves with the twist (vx, vy, w) of one frame: seen from there the state
 * rests, and so does the manifold of the constraints.  Components of vectors in that frame turn at -w, hence
 *
 *     z' = N_q^T (dv - W dq),   u' = T N_v^T (da - W dv),   W (x, y, phi) = w (-y, x, 0) for each body.
 *
 * The eigenvalues of this matrix A are the exponents of disturbances of a steady motion; linear_frame.c finds the frame,
 * and whether the motion is steady.  (Null-space form: Garcia de Jalon & Bayo 1994, Kinematic and Dynamic Simulation of
 * Multibody Systems.  Relative equilibria: Marsden & Ratiu 1999, Introduction to Mechanics and Symmetry.) */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "eigen.h"
#include "linear.h"
#include "rank.h"
#include "util.h"

/* ---- Derivatives ---- */

/* Rows of -F = (J^T lambda)_q - f_q, -f_v; of gamma_q - (J a)_q, gamma_v; of B. */
static void linear_put (pw_linearisation *x, const double *v) {
  pw_run *r = x->r;
  pw_system *s = r->s;
  int n = x->n;
  pw_put put = { .rows = x->m, .factor = 1, .factor_nonholonomic = 1, .lambda = x->lambda };
  pw_newton_block (&x->newton, s, &x->tape, PW_JTL_Q, &put);
  put.factor = -1;
  pw_newton_block (&x->newton, s, &x->tape, PW_FORCE_Q, &put);
  put.col = n;
  pw_newton_block (&x->newton, s, &x->tape, PW_FORCE_V, &put);
  pw_newton_readers (&x->newton, s, &x->tape, 0, 0, n);
  put = (pw_put){ .row = n, .rows = x->m, .factor = 1, .factor_nonholonomic = 1 };
  pw_newton_block (&x->newton, s, &x->tape, PW_GAMMA_Q, &put);
  put.col = n;
  pw_newton_block (&x->newton, s, &x->tape, PW_GAMMA_V, &put);
  put = (pw_put){ .row = n, .rows = x->m, .factor = -1, .factor_nonholonomic = -1, .w = x->a };
  pw_newton_block (&x->newton, s, &x->tape, PW_JW_Q, &put);
  put = (pw_put){ .row = n + x->m, .rows = x->m, .factor = 1, .factor_nonholonomic = 1, .w = v };
  pw_newton_block (&x->newton, s, &x->tape, PW_JW_Q, &put);
  put = (pw_put){ .row = n + x->m, .rows = x->m, .factor = -1, .factor_nonholonomic = -1 };
  pw_newton_block (&x->newton, s, &x->tape, PW_ETA_Q, &put);
}

static int linear_derivatives (pw_linearisation *x) {
  if (pw_newton_open (&x->newton, x->r->s) != PW_OK) return PW_MACHINE;
  pw_tape_record (&x->tape);
  linear_put (x, x->r->v);
  int size = 2 * x->n > x->n + 2 * x->m ? 2 * x->n : x->n + 2 * x->m;
  if (pw_tape_lay_out (&x->tape, size, &x->colptr, &x->rowind) != PW_OK) return PW_MACHINE;
  x->value = calloc ((size_t)x->colptr[size] + 1, sizeof *x->value);
  return x->value ? PW_OK : PW_MACHINE;
}

int pw_linear_evaluate (pw_linearisation *x, double t, const double *q, const double *v) {
  int status = pw_accelerate (x->r, t, q, v, x->a, x->lambda);
  if (status != PW_OK) return status;
  memset (x->value, 0, ((size_t)x->colptr[2 * x->n] + 1) * sizeof *x->value);
  pw_tape_fill (&x->tape, x->value);
  linear_put (x, v);
  return PW_OK;
}

void pw_linear_vary (pw_linearisation *x) {
  memset (x->y, 0, ((size_t)x->n + 2 * (size_t)x->m) * sizeof *x->y);
  for (int j = 0; j < 2 * x->n; j++)
    for (int64_t i = x->colptr[j]; i < x->colptr[j + 1]; i++) x->y[x->rowind[i]] += x->value[i] * x->x[j];
  for (int j = 0; j < x->n; j++) x->da[j] = -x->y[j];
  pw_saddle_solve (x->r->saddle, x->da, x->y + x->n, x->da, x->z);
}

/* ---- Bases ---- */

/* x += beta w (w . x) for all but the first `from` entries; w as it lies in a column. */
static void linear_reflect (int n, int from, const double *w, double beta, double *x) {
  double dot = 0;
  for (int i = from; i < n; i++) dot += w[i] * x[i];
  for (int i = from; i < n; i++) x[i] -= beta * dot * w[i];
}

/* Householder's QR factorisation of the independent rows as columns; the reflections stay below R's diagonal, which goes
 * to x->z. */
static void linear_factor (pw_linearisation *x) {
  int n = x->n;
  double *beta = x->da;
  for (int k = 0; k < x->rank; k++) {
    double *c = x->R + (size_t)k * (size_t)n, square = 0;
    for (int i = k; i < n; i++) square += c[i] * c[i];
    x->z[k] = c[k] > 0 ? -sqrt (square) : sqrt (square);
    beta[k] = square > 0 ? 1 / (square + fabs (c[k] * x->z[k])) : 0;
    c[k] -= x->z[k];
    for (int j = k + 1; j < x->rank; j++) linear_reflect (n, k, c, beta[k], x->R + (size_t)j * (size_t)n);
  }
  for (int j = 0; j < n; j++) {
    double *e = x->Q + (size_t)j * (size_t)n;
    memset (e, 0, (size_t)n * sizeof *e);
    e[j] = 1;
    for (int k = x->rank - 1; k >= 0; k--) linear_reflect (n, k, x->R + (size_t)k * (size_t)n, beta[k], e);
  }
  for (int k = 0; k < x->rank; k++) { /* R, rank long each, in the same place */
    memmove (x->R + (size_t)k * (size_t)x->rank, x->R + (size_t)k * (size_t)n, (size_t)k * sizeof *x->R);
    x->R[(size_t)k * (size_t)x->rank + (size_t)k] = x->z[k];
    for (int i = k + 1; i < x->rank; i++) x->R[(size_t)k * (size_t)x->rank + (size_t)i] = 0;
  }
}

/* The independent rows, one behind the other in x->R, are factorised. */
static void linear_bases (pw_linearisation *x) {
  pw_rank_rows (x->r->s, x->R, x->norm);
  for (int k = 0; k < x->rank; k++)
    if (x->row[k] != k)
      memcpy (x->R + (size_t)k * (size_t)x->n, x->R + (size_t)x->row[k] * (size_t)x->n, (size_t)x->n * sizeof *x->R);
  linear_factor (x);
}

/* Singular values of J^T = Q R are those of R, which stays. */
static int linear_singular (const pw_linearisation *x, double *least) {
  size_t k = (size_t)x->rank;
  if (k == 0) return PW_OK;
  double *copy = malloc ((k * k + k) * sizeof *copy);
  if (copy == NULL) return PW_MACHINE;
  memcpy (copy, x->R, k * k * sizeof *copy);
  pw_singular_values (x->rank, x->rank, copy, copy + k * k);
  *least = INFINITY;
  for (size_t i = 0; i < k; i++) *least = fmin (*least, copy[k * k + i]);
  free (copy);
  return PW_OK;
}

/* ---- The reduced system ---- */

static const double *linear_column (const pw_linearisation *x, int j) {
  return x->Q + (size_t)j * (size_t)x->n;
}

static double linear_R (const pw_linearisation *x, int i, int j) {
  return x->R[(size_t)j * (size_t)x->rank + (size_t)i];
}

/* dv -= J^+ B dq: solves R^T b = B dq, dv -= Q b. */
static void linear_follow (pw_linearisation *x) {
  double *b = x->c;
  for (int i = 0; i < x->rank; i++) {
    b[i] = x->y[x->n + x->m + x->row[i]] / x->norm[x->row[i]];
    for (int j = 0; j < i; j++) b[i] -= linear_R (x, j, i) * b[j];
    b[i] /= linear_R (x, i, i);
  }
  for (int i = 0; i < x->rank; i++)
    for (int j = 0; j < x->n; j++) x->x[x->n + j] -= b[i] * linear_column (x, i)[j] / pw_rank_unit (x->r->s, j);
}

void pw_linear_tangent (pw_linearisation *x, int c) {
  int velocity = c >= x->positions, column = velocity ? x->rank + c - x->positions : x->holonomic + c;
  double T = x->r->s->scale.time;
  memset (x->x, 0, 2 * (size_t)x->n * sizeof *x->x);
  for (int j = 0; j < x->n; j++)
    x->x[velocity ? x->n + j : j] = linear_column (x, column)[j] / pw_rank_unit (x->r->s, j) / (velocity ? T : 1);
  if (velocity) return;
  pw_linear_vary (x);
  linear_follow (x);
}

/* Component of a vector over the coordinates along a column of Q. */
static double linear_along (const pw_linearisation *x, int column, const double *vector) {
  double sum = 0;
  for (int j = 0; j < x->n; j++) sum += linear_column (x, column)[j] * vector[j] * pw_rank_unit (x->r->s, j);
  return sum;
}

void pw_linear_coordinates (const pw_linearisation *x, const double *dq, const double *dv, int stride, double *out) {
  for (int i = 0; i < x->positions; i++, out += stride) *out = linear_along (x, x->holonomic + i, dq);
  for (int i = 0; i < x->velocities; i++, out += stride) *out = linear_along (x, x->rank + i, dv) * x->r->s->scale.time;
}

void pw_linear_turn (const pw_linearisation *x, double w, const double *in, double *out) {
  for (int j = 0; j < 3 * x->r->s->bodies; j += 3) {
    out[j] -= w * in[j + 1];
    out[j + 1] += w * in[j];
  }
}

/* Column c of A: what follows from a variation along one of the minimal coordinates. */
static void linear_unknown (pw_linearisation *x, int c) {
  double *dq = x->x, *dv = x->x + x->n, w = x->frame.twist[2];
  pw_linear_tangent (x, c);
  pw_linear_vary (x);
  pw_linear_turn (x, -w, dv, x->da);
  pw_linear_turn (x, -w, dq, dv);
  pw_linear_coordinates (x, dv, x->da, x->size, x->A + c);
}

/* ---- Eigenvalues ---- */

/* The size of the errors tried, relative to what is added up to an entry of A, and to the largest one of the balanced matrix:
 * a hundred times round-off, as much as derivatives and QR algorithm lose; and what an eigenvalue must exceed of the shift they
 * cause. */
static const double LINEAR_ROUND = 100 * DBL_EPSILON, LINEAR_CERTAIN = 10;

/* Whether i comes before k: the one that grows more; of equally growing ones the faster; of a pair that with im > 0. */
static int linear_before (const pw_linear *l, int i, int k) {
  if (l->re[i] != l->re[k]) return l->re[i] > l->re[k];
  if (fabs (l->im[i]) != fabs (l->im[k])) return fabs (l->im[i]) > fabs (l->im[k]);
  return l->im[i] > l->im[k];
}

static void linear_swap (pw_linear *l, int i, int k) {
  double re = l->re[i], im = l->im[i];
  unsigned char rigid = l->rigid[i];
  l->re[i] = l->re[k], l->im[i] = l->im[k], l->rigid[i] = l->rigid[k];
  l->re[k] = re, l->im[k] = im, l->rigid[k] = rigid;
}

/* Adds errors to B of the size of round-off in each row, of which 1 / T is the least. */
static void linear_disturb (int n, double rate, double *B) {
  for (int i = 0; i < n; i++, B += n) {
    double most = rate;
    for (int k = 0; k < n; k++) most = fmax (most, fabs (B[k]));
    for (int k = 0; k < n; k++) B[k] += LINEAR_ROUND * most * sin (1.7 + 2.39996 * (double)(i * n + k + 1));
  }
}

static int linear_ascending (const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* How far each eigenvalue moves: to the nearest one of the disturbed matrix, and in modulus to the one of its rank there, for
 * among many defective ones the nearest says little; `least` in any case.  The moduli of the disturbed ones replace them. */
static void linear_shift (int n, const double *re, const double *im, double *re2, const double *im2, double least,
                          double *shift) {
  for (int i = 0; i < n; i++) {
    shift[i] = INFINITY;
    for (int k = 0; k < n; k++) shift[i] = fmin (shift[i], hypot (re[i] - re2[k], im[i] - im2[k]));
    shift[i] = fmax (shift[i], least);
  }
  for (int k = 0; k < n; k++) re2[k] = hypot (re2[k], im2[k]);
  qsort (re2, (size_t)n, sizeof *re2, linear_ascending);
  for (int i = 0; i < n; i++) {
    double size = hypot (re[i], im[i]);
    int rank = 0;
    for (int k = 0; k < n; k++) rank += hypot (re[k], im[k]) < size || (hypot (re[k], im[k]) == size && k < i);
    shift[i] = fmax (shift[i], fabs (size - re2[rank]));
  }
}

/* What is less than its uncertainty is 0, in the same way for both eigenvalues of a pair. */
static void linear_clean (int n, double *re, double *im, const double *shift) {
  for (int i = 0, pair; i < n; i += 1 + pair) {
    pair = im[i] > 0;
    double uncertain = LINEAR_CERTAIN * fmax (shift[i], shift[i + pair]);
    for (int k = i; k <= i + pair; k++) {
      if (!(fabs (re[k]) > uncertain)) re[k] = 0;
      if (!(fabs (im[k]) > uncertain)) im[k] = 0;
    }
  }
}

/* The eigenvalues that follow the first k, of B, and those of the same matrix with errors, which tell how far they are
 * certain.  Behind B there is room for as much again and three vectors. */
static int linear_solve (const pw_linearisation *x, pw_linear *l, int k, double *B) {
  int n = l->unknowns - k;
  size_t cells = (size_t)n * (size_t)n;
  double *other = B + cells, most = 1 / x->r->s->scale.time;
  memcpy (other, B, cells * sizeof *B);
  linear_disturb (n, most, other);
  pw_eigen_balance (n, other);
  for (size_t i = 0; i < cells; i++) most = fmax (most, fabs (other[i]));
  linear_disturb (n, most, other);
  double *re = other + cells, *im = re + n, *shift = im + n;
  if (pw_eigenvalues (n, B, l->re + k, l->im + k) != PW_OK || pw_eigenvalues (n, other, re, im) != PW_OK)
    return PW_RETRY;
  linear_shift (n, l->re + k, l->im + k, re, im, LINEAR_ROUND * most, shift);
  linear_clean (n, l->re + k, l->im + k, shift);
  return PW_OK;
}

/* Displacements of the whole, which the symmetry maps into each other, are split off: what is left has no defective zeros
 * because of them.  In a turning frame a displaced motion goes round at -w. */
static int linear_eigenvalues (pw_linearisation *x, pw_linear *l, pw_error *error) {
  int n = l->unknowns, k = l->symmetries;
  size_t cells = (size_t)n * (size_t)n;
  double *B = malloc ((2 * cells + 3 * (size_t)n + 1) * sizeof *B);
  if (B == NULL) return PW_MACHINE;
  memcpy (B, x->A, cells * sizeof *B);
  if (!pw_linear_split (x, k, B)) {
    memcpy (B, x->A, cells * sizeof *B);
    k = l->symmetries = 0;
  }
  for (int i = k; k > 0 && i < n; i++)
    memmove (B + (size_t)(i - k) * (size_t)(n - k), B + (size_t)i * (size_t)n + k, (size_t)(n - k) * sizeof *B);
  for (int i = 0; i < k; i++) l->rigid[i] = 1;
  if (k >= 2) l->im[0] = fabs (l->twist[2]), l->im[1] = -l->im[0];
  int status = linear_solve (x, l, k, B);
  free (B);
  for (int i = 1; i < n; i++)
    for (int j = i; j > 0 && linear_before (l, j, j - 1); j--) linear_swap (l, j, j - 1);
  if (status == PW_OK) return PW_OK;
  return pw_fail (error, PW_METHOD, "t = %.6g s: the eigenvalues of the linearisation cannot be computed", x->r->t);
}

/* ---- Opening and closing ---- */

static int linear_open (pw_linearisation *x, int all) {
  size_t n = (size_t)x->n, m = (size_t)x->m, size = (size_t)x->size;
  const pw_array array[] = {
    { &x->a, n + 3 },
    { &x->lambda, m },
    { &x->norm, m },
    { &x->R, m * n },
    { &x->Q, n * n },
    { &x->A, size * size },
    { &x->x, 2 * n },
    { &x->y, n + 2 * m },
    { &x->da, n + 3 },
    { &x->z, n + m + 3 },
    { &x->c, m },
    { &x->S, 3 * size },
    { &x->a0, n },
    { &x->there, 2 * n + 6 },
    { &x->along, 2 * n },
    { &x->response, n },
    { &x->residual, 3 * (2 * m + n) },
  };
  x->memory = pw_take_arrays (array, all ? sizeof array / sizeof *array : 0);
  return x->memory ? PW_OK : PW_MACHINE;
}

static void linear_close (pw_linearisation *x) {
  pw_newton_close (&x->newton);
  pw_tape_close (&x->tape);
  free (x->colptr);
  free (x->rowind);
  free (x->value);
  free (x->row);
  free (x->memory);
}

/* The independent rows; holonomic ones stand first in J. */
static int linear_rows (pw_linearisation *x) {
  x->row = malloc (((size_t)x->m + 1) * sizeof *x->row);
  for (int i = 0; x->row && i < x->m; i++) {
    if (x->r->active && !x->r->active[i]) continue;
    x->holonomic += i < x->r->s->holonomic;
    x->row[x->rank++] = i;
  }
  x->positions = x->n - x->holonomic;
  x->velocities = x->n - x->rank;
  x->size = x->positions + x->velocities;
  return x->row ? PW_OK : PW_MACHINE;
}

static int linear_results (const pw_linearisation *x, pw_linear *l) {
  size_t size = (size_t)x->size;
  l->A = malloc ((size * size + 1) * sizeof *l->A);
  l->re = calloc (2 * size + 1, sizeof *l->re);
  l->rigid = calloc (size + 1, 1);
  if (l->A == NULL || l->re == NULL || l->rigid == NULL) return PW_MACHINE;
  l->im = l->re + size;
  memcpy (l->A, x->A, size * size * sizeof *l->A);
  return PW_OK;
}

/* The state reached is evaluated last: there the system stays. */
static int linear_compute (pw_linearisation *x, pw_linear *l, pw_error *error) {
  pw_run *r = x->r;
  if (linear_derivatives (x) != PW_OK) return PW_MACHINE;
  int status = pw_linear_evaluate (x, r->t, r->q, r->v);
  if (status != PW_OK)
    return status > 0 ? pw_fail_singular (r, r->t, error) : pw_fail (error, PW_METHOD, "a signal failed");
  linear_bases (x);
  if (linear_singular (x, &l->least) != PW_OK) return PW_MACHINE;
  pw_linear_choose_frame (x);
  for (int c = 0; c < x->size; c++) linear_unknown (x, c);
  l->symmetries = pw_linear_symmetries (x);
  if (linear_results (x, l) != PW_OK) return PW_MACHINE;
  memcpy (l->twist, x->frame.twist, sizeof l->twist);
  l->acceleration = x->frame.acceleration;
  status = linear_eigenvalues (x, l, error);
  if (status == PW_OK) l->steady = pw_linear_steady (x);
  return status;
}

int pw_linearise (pw_run *r, int most, pw_linear *l, pw_error *error) {
  pw_linearisation x = { .r = r, .n = r->s->coords, .m = r->s->rows };
  pw_statistics before = r->statistics;
  int near = r->near, status = linear_rows (&x), all = x.n <= most;
  *l = (pw_linear){ .coordinates = x.n, .least = NAN };
  l->rank = x.rank;
  l->positions = x.positions;
  l->velocities = x.velocities;
  l->unknowns = x.size;
  if (status == PW_OK) status = linear_open (&x, all);
  if (status == PW_OK && all) status = linear_compute (&x, l, error);
  linear_close (&x);
  r->statistics = before;
  r->near = near;
  return status == PW_MACHINE ? pw_fail (error, PW_MACHINE, "model %s: out of memory", r->s->model) : status;
}

void pw_linear_close (pw_linear *l) {
  free (l->A);
  free (l->re);
  free (l->rigid);
  l->A = l->re = l->im = NULL;
  l->rigid = NULL;
}

/* ---- RK4 ---- */

/* |1 + z + z^2/2 + z^3/6 + z^4/24| <= 1 for z = h mu (Hairer & Wanner 1996, section IV.2).  Where the solution grows, the
 * growth is not to be damped: only its turning counts. */
static int linear_stable (double re, double im, double h) {
  double x = h * fmin (re, 0), y = h * im, u = 1, v = 0;
  for (int k = 4; k > 0; k--) { /* u + i v = 1 + z (u + i v) / k */
    double real = x * u - y * v;
    v = (x * v + y * u) / k;
    u = 1 + real / k;
  }
  return hypot (u, v) <= 1 + 1e-12;
}

double pw_rk4_limit (double re, double im) {
  double size = hypot (fmin (re, 0), im), low = 0, high = 0;
  if (!(size > 0)) return INFINITY;
  while (linear_stable (re, im, high) && high * size < 4) low = high, high += 0.01 / size;
  for (int i = 0; i < 50; i++) {
    double middle = (low + high) / 2;
    *(linear_stable (re, im, middle) ? &low : &high) = middle;
  }
  return low;
}
