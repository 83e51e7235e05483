/* Minimal velocities: u = B^T W v, with the columns of B a basis of ker J0, J0 the constraint matrix at the step's start,
 * held over the step; W = 1 for lengths, L^2 for angles.  Integrated are
 *
 *   q' = v(t, q, u),    u' = B^T W a(t, q, v),      v:  J(t, q) v = eta,  B^T W v = u
 *
 * so that all rows hold on the level of rates, at every stage, however large the step.  For d freedoms u has d entries.
 * A Runge-Kutta stage of u is B^T W times the same stage w of v, since B is constant, and B^T W (v - w) = 0 means that
 * v - w is in the range of W^-1 J0^T.  So no basis has to be formed, and the result depends on none:
 *
 *   v = w + W^-1 J0^T mu,    K mu = eta - J w,    K = J W^-1 J0^T
 *
 * The next step has a basis of its own; v, and with it the motion, is the same in both.
 * (Kim & Vanderploeg 1986, QR decomposition for state space representation of constrained mechanical dynamic systems: a
 * basis held while it is good; Mani, Haug & Atkinson 1985, Application of singular value decomposition for analysis of
 * mechanical system dynamics.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "nullspace.h"
#include "util.h"

/* ---- Opening ---- */

static int nullspace_allocate (pw_nullspace *b, const pw_system *s) {
  size_t m = (size_t)b->rows, all = (size_t)s->rows;
  pw_layout l = { NULL, 0 };
  for (int pass = 0; pass < 2; pass++) {
    b->place = pw_take (&l, all, sizeof (int));
    b->pivot = pw_take (&l, m, sizeof (int));
    b->reference = pw_take (&l, (size_t)s->coords * m, sizeof (double));
    b->K = pw_take (&l, m * m, sizeof (double));
    b->scale = pw_take (&l, m, sizeof (double));
    b->mu = pw_take (&l, m, sizeof (double));
    b->jv = pw_take (&l, all, sizeof (double));
    b->eta = pw_take (&l, all, sizeof (double));
    if (pass == 1) break;
    b->memory = calloc (1, l.used + 1);
    if (b->memory == NULL) return PW_MACHINE;
    l = (pw_layout){ b->memory, 0 };
  }
  return PW_OK;
}

int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  *b = (pw_nullspace){ .rows = s->rows - r->redundant };
  if (b->rows > PW_NULLSPACE_MOST)
    return pw_fail (error, PW_INPUT,
                    "model %s: stabilisation nullspace works with dense matrices, for up to %d constraint rows, and "
                    "this scene has %d; take %s+projection",
                    s->model, PW_NULLSPACE_MOST, b->rows, r->method->name);
  if (nullspace_allocate (b, s) != PW_OK) return pw_fail (error, PW_MACHINE, "model %s: out of memory", s->model);
  for (int i = 0, n = 0; i < s->rows; i++) b->place[i] = r->active && !r->active[i] ? -1 : n++;
  return PW_OK;
}

void pw_nullspace_close (pw_nullspace *b) {
  free (b->memory);
  *b = (pw_nullspace){ 0 };
}

/* ---- K ---- */

/* The entries of J last swept, of the active rows. */
typedef void nullspace_visit (pw_nullspace *b, const pw_system *s, int row, int j, double value);

static inline void nullspace_each (pw_nullspace *b, const pw_system *s, nullspace_visit *visit) {
  for (const pw_slab *k = s->slab; k < s->slab + s->constraints; k++) {
    const double *J = k->J;
    for (int e = 0; e < k->b.count; e++)
      for (int i = 0; i < k->kind->rows; i++) {
        int row = b->place[k->row + e * k->kind->rows + i];
        for (int c = 0; c < k->b.cols; c++, J++) {
          int j = pw_global (k, e, c);
          if (row >= 0 && j < s->coords && *J != 0) visit (b, s, row, j, *J);
        }
      }
  }
}

static inline void nullspace_refer (pw_nullspace *b, const pw_system *s, int row, int j, double value) {
  double unit = pw_is_angle (s, j) ? s->scale.length : 1;
  b->reference[j * b->rows + row] += value / (unit * unit);
}

static inline void nullspace_multiply (pw_nullspace *b, const pw_system *s, int row, int j, double value) {
  const double *from = b->reference + j * b->rows;
  double *to = b->K + row * b->rows;
  (void)s;
  for (int i = 0; i < b->rows; i++) to[i] += value * from[i];
}

static void nullspace_swap (pw_nullspace *b, int p, int q) {
  int m = b->rows;
  double scale = b->scale[p];
  b->scale[p] = b->scale[q], b->scale[q] = scale;
  for (int j = 0; j < m; j++) {
    double x = b->K[p * m + j];
    b->K[p * m + j] = b->K[q * m + j], b->K[q * m + j] = x;
  }
}

/* K = P L U, partial pivoting by scaled rows.  PW_RETRY if a pivot is what round-off leaves of a dependent row. */
static int nullspace_factor (pw_nullspace *b) {
  const double least = 1e-13;
  int m = b->rows;
  double *K = b->K;
  for (int i = 0; i < m; i++) {
    b->scale[i] = 0;
    for (int j = 0; j < m; j++) b->scale[i] = fmax (b->scale[i], fabs (K[i * m + j]));
  }
  for (int p = 0; p < m; p++) {
    int best = p;
    for (int i = p + 1; i < m; i++)
      if (fabs (K[i * m + p]) * b->scale[best] > fabs (K[best * m + p]) * b->scale[i]) best = i;
    if (!(fabs (K[best * m + p]) > least * b->scale[best])) return PW_RETRY;
    b->pivot[p] = best;
    if (best != p) nullspace_swap (b, p, best);
    for (int i = p + 1; i < m; i++) {
      double f = K[i * m + p] /= K[p * m + p];
      for (int j = p + 1; f != 0 && j < m; j++) K[i * m + j] -= f * K[p * m + j];
    }
  }
  return PW_OK;
}

/* mu = K^-1 mu */
static void nullspace_solve (pw_nullspace *b) {
  int m = b->rows;
  const double *K = b->K;
  double *mu = b->mu;
  for (int p = 0; p < m; p++) {
    double x = mu[b->pivot[p]];
    mu[b->pivot[p]] = mu[p], mu[p] = x;
  }
  for (int i = 0; i < m; i++)
    for (int j = 0; j < i; j++) mu[i] -= K[i * m + j] * mu[j];
  for (int i = m - 1; i >= 0; i--) {
    for (int j = i + 1; j < m; j++) mu[i] -= K[i * m + j] * mu[j];
    mu[i] /= K[i * m + i];
  }
}

/* ---- A step ---- */

int pw_nullspace_begin (pw_nullspace *b, pw_run *r) {
  int status = pw_place (r->s, r->t, r->q, r->v);
  if (status != PW_OK) return status;
  pw_sweep_J (r->s);
  memset (b->reference, 0, (size_t)r->s->coords * (size_t)b->rows * sizeof *b->reference);
  nullspace_each (b, r->s, nullspace_refer);
  return PW_OK;
}

int pw_nullspace_rates (pw_nullspace *b, pw_run *r, double t, const double *q, double *v) {
  pw_system *s = r->s;
  int m = b->rows, status = pw_place (s, t, q, v);
  if (status != PW_OK) return status;
  pw_sweep_J (s);
  pw_mul_J (s, v, b->jv);
  pw_sweep_eta (s, b->eta);
  for (int i = 0; i < s->rows; i++)
    if (b->place[i] >= 0) b->mu[b->place[i]] = b->eta[i] - b->jv[i];
  memset (b->K, 0, (size_t)m * (size_t)m * sizeof *b->K);
  nullspace_each (b, s, nullspace_multiply);
  if (nullspace_factor (b) != PW_OK) return PW_RETRY;
  nullspace_solve (b);
  for (int j = 0; j < s->coords; j++)
    for (int i = 0; i < m; i++) v[j] += b->reference[j * m + i] * b->mu[i];
  pw_place_rates (s, v);
  return PW_OK;
}

int pw_nullspace_settle (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v, double *added) {
  pw_system *s = r->s;
  int row, status = pw_nullspace_rates (b, r, t, q, v);
  if (status != PW_OK || p == NULL || s->holonomic == 0) return status;
  double worst, before = added ? pw_kinetic (s, v) + pw_potential (s) : 0;
  status = pw_project_positions (p, r, t, q, v, &row, &worst);
  if (status == PW_OK) status = pw_nullspace_rates (b, r, t, q, v);
  if (status == PW_OK && added) *added += pw_kinetic (s, v) + pw_potential (s) - before;
  return status;
}
