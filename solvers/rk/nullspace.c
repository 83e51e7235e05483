/* Minimal velocities u = B^T W v.  The columns of B are a basis of ker J0, with J0 the constraint matrix at the
 * beginning of the step, constant over the step.  W is the metric of positions: the mass matrix, with small weights for
 * massless coordinates.  The equations integrated are
 *
 *   q' = v(t, q, u),    u' = B^T W a(t, q, v),      v:  J(t, q) v = eta,  B^T W v = u
 *
 * so that all velocity constraints hold at every stage, for any step size.  u has as many entries as there are degrees
 * of freedom.  A Runge-Kutta stage of u is B^T W times the same stage w of v, since B is constant, and B^T W (v - w) =
 * 0 puts v - w in the range of W^-1 J0^T.  So no basis is formed, and the result is independent of its choice:
 *
 *   v = w + W^-1 J0^T mu,    K mu = eta - J w,    K = J W^-1 J0^T
 *
 * The next step uses another basis; v, and with it the motion, does not change.  With this W a body made of two welded
 * parts moves like one body, to round-off, and massless coordinates follow the massive ones. (Kim & Vanderploeg 1986,
 * QR decomposition for state space representation of constrained mechanical dynamic systems: a basis kept while it is
 * well conditioned; Mani, Haug & Atkinson 1985, Application of singular value decomposition for analysis of mechanical
 * system dynamics.)
 *
 * J is evaluated in body blocks: the constraint equations that involve one body or internal coordinate.  At the
 * beginning of the step K is symmetric positive definite, and its factorisation needs no pivoting; it is repeated with
 * pivoting if a pivot becomes small. */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "nullspace.h"
#include "unroll.h"
#include "util.h"

/* ---- Opening ---- */

/* Appends the entries of equation `row` at the coordinates from j on to their body block; counts them if J is NULL. */
static void nullspace_add_piece (pw_nullspace *b, const pw_system *s, int j, int row, const double *J) {
  if (j >= s->coords || row < 0) return;
  int n = j < 3 * s->bodies ? j / 3 : j - 2 * s->bodies;
  if (J)
    b->piece[b->panel[n + 1].first++] = (pw_nullspace_piece){ .row = row, .J = J };
  else
    b->panel[n + 2].first++;
}

/* Fills in the entries of every body block, or counts them, those of block n in panel[n + 2].first. */
static void nullspace_list_pieces (pw_nullspace *b, const pw_workspace *w, int fill) {
  const pw_system *s = w->s;
  for (const pw_element_batch *k = w->batch; k < w->batch + s->constraints; k++)
    for (int e = 0; e < k->b.count; e++)
      for (int i = 0, n = e * k->kind->rows; i < k->kind->rows; i++, n++) {
        const double *J = k->J + n * k->b.cols;
        int row = b->place[k->row + n], bodies = k->kind->bodies, own = k->kind->own;
        for (int c = 0; c < bodies; c++)
          nullspace_add_piece (b, s, k->column[e * bodies + c], row, fill ? J + 3 * c : NULL);
        for (int c = 0; c < own; c++)
          nullspace_add_piece (b, s, k->own + e * own + c, row, fill ? J + 3 * bodies + c : NULL);
      }
}

static int nullspace_allocate (pw_nullspace *b, const pw_system *s) {
  size_t m = (size_t)b->rows, all = (size_t)s->rows, panels = (size_t)b->panels + 2, pieces = 0;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->constraints; k++)
    pieces += (size_t)(k->b.count * k->kind->rows * (k->kind->bodies + k->kind->own));
  pw_layout l = { NULL, 0 };
  for (int pass = 0; pass < 2; pass++) {
    b->place = pw_take (&l, all, sizeof (int));
    b->pivot = pw_take (&l, m, sizeof (int));
    b->panel = pw_take (&l, panels, sizeof *b->panel);
    b->piece = pw_take (&l, pieces, sizeof *b->piece);
    b->K = pw_take (&l, m * m, sizeof (double));
    b->inverse = pw_take (&l, (size_t)s->coords, sizeof (double));
    b->mu = pw_take (&l, m, sizeof (double));
    b->eta = pw_take (&l, all, sizeof (double));
    b->v = pw_take (&l, (size_t)s->coords + 3, sizeof (double));
    if (pass == 1) break;
    b->memory = calloc (1, l.used + 1);
    if (b->memory == NULL) return PW_RESOURCE;
    l = (pw_layout){ b->memory, 0 };
  }
  return PW_OK;
}

/* The entries of panel n are those from its `first` up to the `first` of panel n + 1. */
static void nullspace_plan (pw_nullspace *b, const pw_workspace *w) {
  const pw_system *s = w->s;
  nullspace_list_pieces (b, w, 0);
  for (int n = 0; n <= b->panels; n++) b->panel[n + 1].first += b->panel[n].first;
  nullspace_list_pieces (b, w, 1);
  for (int n = 0; n < b->panels; n++) {
    b->panel[n].j = n < s->bodies ? 3 * n : n + 2 * s->bodies;
    b->panel[n].width = n < s->bodies ? 3 : 1;
  }
}

int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  *b = (pw_nullspace){ .rows = s->rows - r->redundant, .panels = s->coords - 2 * s->bodies };
  if (b->rows > PW_NULLSPACE_MOST)
    return pw_fail (error, PW_INPUT,
                    "model %s: stabilisation nullspace works with dense matrices, for up to %d constraint rows, and "
                    "this scene has %d; take %s+projection",
                    s->model, PW_NULLSPACE_MOST, b->rows, r->method->name);
  if (nullspace_allocate (b, s) != PW_OK) return pw_fail (error, PW_RESOURCE, "model %s: out of memory", s->model);
  for (int i = 0, n = 0; i < s->rows; i++) b->place[i] = r->active && !r->active[i] ? -1 : n++;
  nullspace_plan (b, r->w);
  for (int j = 0; j < s->coords; j++) b->inverse[j] = 1 / s->metric[j];
  return PW_OK;
}

void pw_nullspace_close (pw_nullspace *b) {
  free (b->memory);
  *b = (pw_nullspace){ 0 };
}

/* ---- K mu = eta - J w ---- */

PW_INLINE double nullspace_dot (const double *x, const double *y, int width) {
  return width == 1 ? x[0] * y[0] : x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

/* K += J W^-1 J0^T, mu -= J w for one panel; `width` is a constant in each inlined copy. */
PW_INLINE void nullspace_gather (pw_nullspace *b, const pw_nullspace_block *p, const double *w, int width) {
  const pw_nullspace_piece *from = b->piece + p->first, *end = b->piece + p[1].first;
  for (const pw_nullspace_piece *x = from; x < end; x++) {
    double J[3] = { x->J[0], width > 1 ? x->J[1] : 0, width > 1 ? x->J[2] : 0 }, *K = b->K + x->row * b->rows;
    for (const pw_nullspace_piece *y = from; y < end; y++) K[y->row] += nullspace_dot (J, y->reference, width);
    b->mu[x->row] -= nullspace_dot (J, w + p->j, width);
  }
}

/* Assembles K, and the right-hand side in mu. */
static void nullspace_assemble (pw_nullspace *b, pw_run *r, const double *w) {
  int m = b->rows;
  memset (b->K, 0, (size_t)m * (size_t)m * sizeof *b->K);
  memset (b->mu, 0, (size_t)m * sizeof *b->mu);
  if (r->s->rheonomic) {
    pw_evaluate_eta (r->w, b->eta);
    for (int i = 0; i < r->s->rows; i++)
      if (b->place[i] >= 0) b->mu[b->place[i]] = b->eta[i];
  }
  for (const pw_nullspace_block *p = b->panel, *end = p + b->panels; p < end; p++)
    if (p->width == 3)
      nullspace_gather (b, p, w, 3);
    else
      nullspace_gather (b, p, w, 1);
}

/* mu = K^-1 mu without pivoting; K is factorised in place.  Returns 0 if a pivot is smaller than `least` times its
 * diagonal entry. */
static int nullspace_eliminate (double *K, double *mu, int m) {
  const double least = 0.01;
  for (int p = 0; p < m; p++) {
    double diagonal = K[p * m + p];
    for (int i = 0; i < p; i++) {
      double f = K[p * m + i] * K[i * m + i];
      for (int j = i + 1; j < m; j++) K[p * m + j] -= f * K[i * m + j];
      mu[p] -= f * mu[i];
    }
    if (!(K[p * m + p] > least * diagonal)) return 0;
    K[p * m + p] = 1 / K[p * m + p];
  }
  for (int i = m - 1; i >= 0; i--) {
    for (int j = i + 1; j < m; j++) mu[i] -= K[i * m + j] * mu[j];
    mu[i] *= K[i * m + i];
  }
  return 1;
}

/* The same with scaled rows and pivoting.  PW_RETRY if a pivot is round-off: dependent constraint equations. */
static int nullspace_pivot (pw_nullspace *b) {
  const double least = 1e-13;
  int m = b->rows;
  double *K = b->K;
  for (int i = 0; i < m; i++) {
    double most = 0;
    for (int j = 0; j < m; j++) most = pw_largest (most, fabs (K[i * m + j]));
    if (!(most > 0 && isfinite (most))) return PW_RETRY;
    for (int j = 0; j < m; j++) K[i * m + j] /= most;
    b->mu[i] /= most;
  }
  for (int i = 0; i < m; i++) /* transpose: LAPACK stores columns */
    for (int j = 0; j < i; j++) {
      double x = K[i * m + j];
      K[i * m + j] = K[j * m + i], K[j * m + i] = x;
    }
  LAPACKE_dgetrf_work (LAPACK_COL_MAJOR, m, m, K, m, b->pivot);
  for (int p = 0; p < m; p++)
    if (!(fabs (K[p * m + p]) > least)) return PW_RETRY;
  LAPACKE_dgetrs_work (LAPACK_COL_MAJOR, 'N', m, 1, K, m, b->pivot, b->mu, m);
  return PW_OK;
}

/* ---- A step ---- */

int pw_nullspace_begin (pw_nullspace *b, pw_run *r) {
  int status = pw_update_kinematics (r->w, r->t, r->q, r->v);
  if (status != PW_OK) return status;
  pw_evaluate_J (r->w);
  for (const pw_nullspace_block *p = b->panel, *end = p + b->panels; p < end; p++)
    for (pw_nullspace_piece *x = b->piece + p->first; x < b->piece + p[1].first; x++)
      for (int c = 0; c < p->width; c++) x->reference[c] = x->J[c] * b->inverse[p->j + c];
  return PW_OK;
}

/* Solves K mu = eta - J w; PW_RETRY if K is singular. */
static int nullspace_multipliers (pw_nullspace *b, pw_run *r, const double *w) {
  nullspace_assemble (b, r, w);
  if (nullspace_eliminate (b->K, b->mu, b->rows)) return PW_OK;
  nullspace_assemble (b, r, w);
  return nullspace_pivot (b);
}

/* Velocities at the current kinematics; J must be up to date. */
static int nullspace_correct (pw_nullspace *b, pw_run *r, double *v) {
  if (nullspace_multipliers (b, r, v) != PW_OK) return PW_RETRY;
  for (const pw_nullspace_block *p = b->panel, *end = p + b->panels; p < end; p++)
    for (const pw_nullspace_piece *x = b->piece + p->first; x < b->piece + p[1].first; x++)
      for (int c = 0; c < p->width; c++) v[p->j + c] += x->reference[c] * b->mu[x->row];
  return pw_update_velocities (r->w, v);
}

int pw_nullspace_velocities (pw_nullspace *b, pw_run *r, double t, const double *q, double *v) {
  int status = pw_update_kinematics (r->w, t, q, v);
  if (status != PW_OK) return status;
  pw_evaluate_J (r->w);
  return nullspace_correct (b, r, v);
}

int pw_nullspace_accelerate (pw_run *r, const double *v, double *a, double *lambda) {
  pw_evaluate_gamma (r->w, lambda);
  int status = pw_run_accelerate_evaluated (r, v, a, lambda);
  if (pw_watchdog_near (r)) r->near = 1;
  return status;
}

/* The energy at (t, q) with the minimal velocities of w. */
static int nullspace_energy (pw_nullspace *b, pw_run *r, double t, const double *q, const double *w, double *energy) {
  const pw_system *s = r->s;
  memcpy (b->v, w, (size_t)s->coords * sizeof *w);
  int status = pw_nullspace_velocities (b, r, t, q, b->v);
  if (status == PW_OK) *energy = pw_kinetic (s, b->v) + pw_potential (r->w);
  return status;
}

int pw_nullspace_finalise (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v, double *added) {
  const pw_system *s = r->s;
  int row, status = PW_OK;
  double worst, before = 0;
  if (p == NULL || s->holonomic == 0) return pw_nullspace_velocities (b, r, t, q, v);
  if (added) status = nullspace_energy (b, r, t, q, v, &before);
  if (status == PW_OK) status = pw_project_positions (p, r, t, q, v, &row, &worst);
  if (status == PW_OK) status = nullspace_correct (b, r, v);
  if (status == PW_OK && added) *added += pw_kinetic (s, v) + pw_potential (r->w) - before;
  return status;
}
