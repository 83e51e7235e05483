/* The first half of a step of leapfrog, by Newton's iteration.  Unknown are u and L = h/2 (lambda+ - lambda):
 *
 *   M (u - v - h/2 a) + J (q)^T L = 0        a, lambda: accelerations and multipliers at (t, q, v)
 *   g (t', q + h u) / h = 0                  S (t*, q*) u - b (t*, q*) = 0,   q* = q + h/2 u
 *
 * The first line is linear: it holds for u = v + h/2 a with L = 0, and after every correction. */
#include <float.h>
#include <stdlib.h>
#include <string.h>
#include "leapfrog_state.h"

enum { DRIFT_MOST = 30 }; /* iterations */

/* ---- Poses: the beginning, the middle, the end ---- */

static int drift_place (pw_run *r, double t, const double *q, const double *v) {
  int status = pw_place (r->w, t, q, v);
  if (status == PW_OK) pw_sweep_J (r->w);
  return status;
}

static int drift_place_middle (pw_run *r, double h) {
  return drift_place (r, r->t + 0.5 * h, r->data->middle, r->data->u);
}

static int drift_place_end (pw_run *r, double t1) {
  return drift_place (r, pw_before_breakpoint (r, t1), r->data->q1, r->data->u);
}

static void drift_move (pw_run *r, double h) {
  leapfrog *d = r->data;
  for (int j = 0; j < r->s->coords; j++) {
    d->q1[j] = r->q[j] + h * d->u[j];
    d->middle[j] = r->q[j] + 0.5 * h * d->u[j];
  }
}

/* ---- Matrix ---- */

/* M and J^T of the beginning, where the system is placed. */
static void drift_put_momentum (pw_run *r) {
  pw_tangent *x = &r->data->work.tangent;
  const pw_system *s = r->s;
  for (int j = 0; j < s->coords; j++) pw_tape_put (&x->tape, j, j, s->mass[j]);
  pw_newton_JT (r->w, &x->tape,
                &(pw_put){ .col = s->coords, .rows = s->rows, .factor = 1, .factor_nonholonomic = 1, .map = x->map });
}

/* S + h/2 ((S u)_q - b_q) of the middle, where the system is placed. */
static void drift_put_middle (pw_run *r, double h) {
  pw_tangent *x = &r->data->work.tangent;
  const pw_system *s = r->s;
  pw_put put = { .row = s->coords, .rows = s->rows, .factor_nonholonomic = 0.5 * h, .map = x->map, .w = r->data->u };
  pw_newton_block (&x->newton, r->w, &x->tape, PW_JW_Q, &put);
  put.factor_nonholonomic = -0.5 * h;
  pw_newton_block (&x->newton, r->w, &x->tape, PW_ETA_Q, &put);
  put.factor_nonholonomic = 1;
  pw_newton_J (r->w, &x->tape, &put);
}

/* G of the end, where the system is placed. */
static void drift_put_end (pw_run *r) {
  pw_tangent *x = &r->data->work.tangent;
  pw_newton_J (r->w, &x->tape, &(pw_put){ .row = r->s->coords, .rows = r->s->holonomic, .factor = 1, .map = x->map });
}

int pw_leapfrog_open_matrix (pw_run *r) {
  leapfrog *d = r->data;
  pw_tape_record (&d->work.tangent.tape);
  drift_put_momentum (r);
  drift_put_middle (r, 1);
  drift_put_end (r);
  return pw_implicit_lay_out (&d->work, r->s->coords + d->work.tangent.rows);
}

static int drift_factor (pw_run *r, double h, double t1) {
  leapfrog *d = r->data;
  pw_tangent *x = &d->work.tangent;
  memset (d->work.value, 0, (size_t)x->colptr[r->s->coords + x->rows] * sizeof *d->work.value);
  pw_tape_fill (&x->tape, d->work.value);
  int status = drift_place (r, r->t, r->q, r->v);
  if (status != PW_OK) return status;
  drift_put_momentum (r);
  status = drift_place_middle (r, h);
  if (status != PW_OK) return status;
  drift_put_middle (r, h);
  status = drift_place_end (r, t1);
  if (status != PW_OK) return status;
  drift_put_end (r);
  r->statistics.jacobians++;
  r->statistics.factorisations++;
  return pw_sparse_factor (&d->work.sparse, d->work.value);
}

/* ---- Iteration ---- */

/* What is left of the rows. */
static int drift_rows (pw_run *r, double h, double t1) {
  leapfrog *d = r->data;
  const pw_system *s = r->s;
  int status = PW_OK;
  if (s->rows > s->holonomic) {
    status = drift_place_middle (r, h);
    if (status != PW_OK) return status;
    pw_mul_J (r->w, d->u, d->off);
    pw_sweep_eta (r->w, d->eta);
    for (int i = s->holonomic; i < s->rows; i++) d->off[i] -= d->eta[i];
  }
  if (s->holonomic > 0) {
    status = pw_place (r->w, pw_before_breakpoint (r, t1), d->q1, d->u);
    if (status != PW_OK) return status;
    pw_sweep_g (r->w, d->eta);
    for (int i = 0; i < s->holonomic; i++) d->off[i] = d->eta[i] / h;
  }
  r->statistics.rhs++;
  return PW_OK;
}

/* One correction of u, measured in positions. */
static int drift_correct (pw_run *r, double h, leapfrog_progress *p) {
  leapfrog *d = r->data;
  int n = r->s->coords;
  memset (d->z, 0, (size_t)n * sizeof *d->z);
  for (int i = 0; i < r->s->rows; i++) d->off[i] = -d->off[i];
  pw_tangent_compress (&d->work.tangent, d->off, d->work.tangent.rows, d->z + n);
  if (pw_sparse_solve (&d->work.sparse, d->z) != PW_OK) return PW_MACHINE;
  p->size = 0, p->large = 1;
  for (int j = 0; j < n; j++) {
    d->u[j] += d->z[j];
    leapfrog_measure (p, h * d->z[j], r->q[j], pw_unit (r->s, j));
  }
  drift_move (r, h);
  return PW_OK;
}

/* The matrix is evaluated at the prediction, and again where corrections do not shrink well. */
int pw_leapfrog_drift (pw_run *r, double h, double t1) {
  leapfrog *d = r->data;
  leapfrog_progress p = { .rate = 1 };
  for (int j = 0; j < r->s->coords; j++) d->u[j] = r->v[j] + 0.5 * h * r->a[j];
  drift_move (r, h);
  for (int i = 0, good = r->s->rows == 0; !good; i++) {
    int fresh = i == 0 || (i > 1 && p.rate > 0.02), status = fresh ? drift_factor (r, h, t1) : PW_OK;
    if (status == PW_OK) status = drift_rows (r, h, t1);
    if (status == PW_OK) status = drift_correct (r, h, &p);
    if (status != PW_OK) return status;
    good = i < DRIFT_MOST ? pw_leapfrog_judge (&p) : -1;
    if (good < 0) return PW_RETRY;
  }
  return PW_OK;
}
