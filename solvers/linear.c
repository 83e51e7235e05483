/* The equations of motion linearised on the constraints: degrees of freedom, eigenvalues, the step RK4 can take.
 *
 * A state obeys g (q, t) = 0 and J v = eta, so that variations obey  G dq = 0,  J dv = -B dq,  B = (J v)_q - eta_q.
 * With orthonormal bases N_q of the null space of G and N_v of that of J (both from one QR factorisation of J^T, holonomic
 * rows first, in units of the scene) they are
 *
 *     dq = N_q z,   dv = N_v u - J^+ B N_q z,
 *
 * and z and u are coordinates of the states around this one.  Accelerations vary by the saddle point,
 *
 *     [ M J^T ; J 0 ] (da, dlambda) = ( (f_q - (J^T lambda)_q) dq + f_v dv,  (gamma_q - (J a)_q) dq + gamma_v dv ),
 *
 * and so do z and u, where the bases follow the motion without turning in their own spaces (N^T N' = 0):
 *
 *     z' = N_q^T dv,   u' = N_v^T da + (J' N_v)^T (J J^T)^-1 B dq,   J' N_v = -(gamma_v + B) N_v,
 *
 * time held still in the rest.  At rest the eigenvalues are those of small vibrations, in a steady motion those about it;
 * else they say how fast the solutions nearby come and go.  (For the null-space form: Garcia de Jalon & Bayo 1994,
 * Kinematic and Dynamic Simulation of Multibody Systems.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "eigen.h"
#include "method.h"
#include "newton.h"
#include "util.h"

typedef struct {
  pw_run *r;
  int n, m;               /* coordinates, rows */
  int holonomic, rank;    /* independent rows, those of positions first */
  int *row;               /* rank: which rows they are */
  double *a, *lambda;     /* coords + 3, rows: at the state */
  double *norm;           /* rows: lengths of the rows of J in units of the scene */
  double *R;              /* rank x rank: J^T = Q R, column after column; first the rows themselves, n long each */
  double *Q;              /* n x n, column after column */
  double *K;              /* unknowns x unknowns */
  double *turn;           /* velocities x rank: J' N_v, column after column */
  double *x, *y, *z, *da; /* 2 n; n + 2 m; n + m + 3; n + 3 */
  double *c;              /* rank: (J J^T)^-1 B dq */
  pw_newton newton;
  pw_tape tape;
  int64_t *colptr, *rowind; /* the derivatives: columns q, v; rows -F, gamma - J a, J v - eta */
  double *value;
  char *memory;
} linear;

/* ---- Derivatives ---- */

/* Rows of -F = (J^T lambda)_q - f_q, -f_v; of gamma_q - (J a)_q, gamma_v; of B. */
static void linear_put (linear *x) {
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
  put = (pw_put){ .row = n + x->m, .rows = x->m, .factor = 1, .factor_nonholonomic = 1, .w = r->v };
  pw_newton_block (&x->newton, s, &x->tape, PW_JW_Q, &put);
  put = (pw_put){ .row = n + x->m, .rows = x->m, .factor = -1, .factor_nonholonomic = -1 };
  pw_newton_block (&x->newton, s, &x->tape, PW_ETA_Q, &put);
}

static int linear_derivatives (linear *x) {
  if (pw_newton_open (&x->newton, x->r->s) != PW_OK) return PW_MACHINE;
  pw_tape_record (&x->tape);
  linear_put (x);
  int size = 2 * x->n > x->n + 2 * x->m ? 2 * x->n : x->n + 2 * x->m;
  if (pw_tape_lay_out (&x->tape, size, &x->colptr, &x->rowind) != PW_OK) return PW_MACHINE;
  x->value = calloc ((size_t)x->colptr[size] + 1, sizeof *x->value);
  if (x->value == NULL) return PW_MACHINE;
  pw_tape_fill (&x->tape, x->value);
  linear_put (x);
  return PW_OK;
}

/* y = all derivatives times the variation x = (dq, dv). */
static void linear_vary (linear *x) {
  memset (x->y, 0, ((size_t)x->n + 2 * (size_t)x->m) * sizeof *x->y);
  for (int j = 0; j < 2 * x->n; j++)
    for (int64_t i = x->colptr[j]; i < x->colptr[j + 1]; i++) x->y[x->rowind[i]] += x->value[i] * x->x[j];
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
static void linear_factor (linear *x) {
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
static void linear_bases (linear *x) {
  pw_rank_rows (x->r->s, x->R, x->norm);
  for (int k = 0; k < x->rank; k++)
    if (x->row[k] != k)
      memcpy (x->R + (size_t)k * (size_t)x->n, x->R + (size_t)x->row[k] * (size_t)x->n, (size_t)x->n * sizeof *x->R);
  linear_factor (x);
}

/* Singular values of J^T = Q R are those of R, which stays. */
static int linear_singular (const linear *x, double *least) {
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

static const double *linear_column (const linear *x, int j) {
  return x->Q + (size_t)j * (size_t)x->n;
}

static double linear_R (const linear *x, int i, int j) {
  return x->R[(size_t)j * (size_t)x->rank + (size_t)i];
}

/* The variation is a column of Q: of the coordinates, or of the rates. */
static void linear_set (linear *x, int column, int rate) {
  memset (x->x, 0, 2 * (size_t)x->n * sizeof *x->x);
  for (int j = 0; j < x->n; j++) x->x[rate ? x->n + j : j] = linear_column (x, column)[j] / pw_rank_unit (x->r->s, j);
}

/* dv -= J^+ B dq: solves R^T b = B dq, dv -= Q b; then R c = b. */
static void linear_follow (linear *x) {
  int k = x->rank;
  double *b = x->c;
  for (int i = 0; i < k; i++) {
    b[i] = x->y[x->n + x->m + x->row[i]] / x->norm[x->row[i]];
    for (int j = 0; j < i; j++) b[i] -= linear_R (x, j, i) * b[j];
    b[i] /= linear_R (x, i, i);
  }
  for (int i = 0; i < k; i++)
    for (int j = 0; j < x->n; j++) x->x[x->n + j] -= b[i] * linear_column (x, i)[j] / pw_rank_unit (x->r->s, j);
  for (int i = k - 1; i >= 0; i--) {
    for (int j = i + 1; j < k; j++) b[i] -= linear_R (x, i, j) * b[j];
    b[i] /= linear_R (x, i, i);
  }
}

/* J' N_v: how the rows turn under the rates they allow. */
static void linear_turn (linear *x) {
  for (int c = 0; c < x->n - x->rank; c++) {
    linear_set (x, x->rank + c, 1);
    linear_vary (x);
    double *turn = x->turn + (size_t)c * (size_t)x->rank;
    for (int k = 0; k < x->rank; k++) turn[k] = -x->y[x->n + x->row[k]] / x->norm[x->row[k]];
    linear_set (x, x->rank + c, 0);
    linear_vary (x);
    for (int k = 0; k < x->rank; k++) turn[k] -= x->y[x->n + x->m + x->row[k]] / x->norm[x->row[k]];
  }
}

/* Component of a vector over the coordinates along a column of Q. */
static double linear_along (const linear *x, int column, const double *vector) {
  double sum = 0;
  for (int j = 0; j < x->n; j++) sum += linear_column (x, column)[j] * vector[j] * pw_rank_unit (x->r->s, j);
  return sum;
}

/* Column c of the reduced system: what follows from a variation along one of its unknowns. */
static void linear_unknown (linear *x, int c) {
  int n = x->n, positions = n - x->holonomic, velocities = n - x->rank, size = positions + velocities;
  int rate = c >= positions;
  linear_set (x, rate ? x->rank + c - positions : x->holonomic + c, rate);
  if (!rate) {
    linear_vary (x);
    linear_follow (x);
  }
  linear_vary (x);
  for (int j = 0; j < n; j++) x->da[j] = -x->y[j];
  pw_saddle_solve (x->r->saddle, x->da, x->y + n, x->da, x->z);
  double *column = x->K + c;
  for (int i = 0; i < positions; i++) column[(size_t)i * (size_t)size] = linear_along (x, x->holonomic + i, x->x + n);
  for (int i = 0; i < velocities; i++) {
    double *entry = column + (size_t)(positions + i) * (size_t)size;
    *entry = linear_along (x, x->rank + i, x->da);
    for (int k = 0; !rate && k < x->rank; k++) *entry += x->turn[(size_t)i * (size_t)x->rank + (size_t)k] * x->c[k];
  }
}

/* ---- Opening and closing ---- */

static int linear_open (linear *x, int all) {
  size_t n = (size_t)x->n, m = (size_t)x->m, size = n - (size_t)x->holonomic + n - (size_t)x->rank;
  const pw_array array[] = {
    { &x->a, n + 3 },
    { &x->lambda, m },
    { &x->norm, m },
    { &x->R, m * n },
    { &x->Q, n * n },
    { &x->K, size * size },
    { &x->turn, (n - (size_t)x->rank) * (size_t)x->rank },
    { &x->x, 2 * n },
    { &x->y, n + 2 * m },
    { &x->z, n + m + 3 },
    { &x->da, n + 3 },
    { &x->c, m },
  };
  x->memory = pw_take_arrays (array, all ? sizeof array / sizeof *array : 0);
  return x->memory ? PW_OK : PW_MACHINE;
}

static void linear_close (linear *x) {
  pw_newton_close (&x->newton);
  pw_tape_close (&x->tape);
  free (x->colptr);
  free (x->rowind);
  free (x->value);
  free (x->row);
  free (x->memory);
}

/* The independent rows; holonomic ones stand first in J. */
static int linear_rows (linear *x) {
  x->row = malloc (((size_t)x->m + 1) * sizeof *x->row);
  for (int i = 0; x->row && i < x->m; i++) {
    if (x->r->active && !x->r->active[i]) continue;
    x->holonomic += i < x->r->s->holonomic;
    x->row[x->rank++] = i;
  }
  return x->row ? PW_OK : PW_MACHINE;
}

static int linear_compute (linear *x, pw_linear *l, pw_error *error) {
  pw_run *r = x->r;
  int status = pw_accelerate (r, r->t, r->q, r->v, x->a, x->lambda);
  if (status != PW_OK)
    return status > 0 ? pw_fail_singular (r, r->t, error) : pw_fail (error, PW_METHOD, "a signal failed");
  linear_bases (x);
  if (linear_singular (x, &l->least) != PW_OK || linear_derivatives (x) != PW_OK) return PW_MACHINE;
  linear_turn (x);
  for (int c = 0; c < l->unknowns; c++) linear_unknown (x, c);
  l->re = malloc (((size_t)l->unknowns + 1) * sizeof *l->re);
  l->im = malloc (((size_t)l->unknowns + 1) * sizeof *l->im);
  if (l->re == NULL || l->im == NULL) return PW_MACHINE;
  if (pw_eigenvalues (l->unknowns, x->K, l->re, l->im) == PW_OK) return PW_OK;
  return pw_fail (error, PW_METHOD, "t = %.6g s: the eigenvalues of the linearisation cannot be computed", r->t);
}

int pw_linearise (pw_run *r, int most, pw_linear *l, pw_error *error) {
  linear x = { .r = r, .n = r->s->coords, .m = r->s->rows };
  *l = (pw_linear){ .coordinates = x.n, .least = NAN };
  int status = linear_rows (&x), all = x.n <= most;
  l->rank = x.rank;
  l->positions = x.n - x.holonomic;
  l->velocities = x.n - x.rank;
  l->unknowns = l->positions + l->velocities;
  if (status == PW_OK) status = linear_open (&x, all);
  if (status == PW_OK && all) status = linear_compute (&x, l, error);
  linear_close (&x);
  return status == PW_MACHINE ? pw_fail (error, PW_MACHINE, "model %s: out of memory", r->s->model) : status;
}

void pw_linear_close (pw_linear *l) {
  free (l->re);
  free (l->im);
  l->re = l->im = NULL;
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
