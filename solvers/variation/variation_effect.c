/* The linearised equations at a state: effects of the state, exact, and of parameters, by differences of neighbours. */
#include <math.h>
#include <string.h>
#include "util.h"
#include "rank.h"
#include "variation_parts.h"

/* Weight of neighbour i in the difference with `step` (which = 0) or twice that. */
static double effect_weight (const pw_direction *d, int which, int i) {
  static const double central[2][PW_VARIATION_NEAR] = { { 0, -0.5, 0.5, 0 }, { -0.25, 0, 0, 0.25 } };
  static const double one_sided[2][PW_VARIATION_NEAR] = { { -1.5, 2, -0.5, 0 }, { -0.75, 0, 1, -0.25 } };
  return (d->one_sided ? one_sided : central)[which][i] / d->step;
}

double pw_direction_weight (const pw_direction *d, int of_error, int i) {
  return ((of_error ? 1 : 4) * effect_weight (d, 0, i) - effect_weight (d, 1, i)) / 3;
}

double pw_direction_offset (const pw_direction *d, int i) {
  static const double offset[2][PW_VARIATION_NEAR] = { { -2, -1, 1, 2 }, { 0, 1, 2, 4 } };
  return offset[d->one_sided][i] * d->step;
}

/* ---- Effects of parameters ---- */

static void effect_add (double *to, const double *from, double weight, int n) {
  for (int i = 0; i < n; i++) to[i] += weight * from[i];
}

/* The rows of a batch of a neighbour. */
static void effect_rows (pw_variation *x, double *effect, double *row, pw_element_batch *k, double weight) {
  const pw_linearisation *l = &x->linear;
  int rows = k->kind->rows, n = x->n, m = x->m;
  double *gamma = l->z, *g = gamma + m, *eta = g + m;
  memset (gamma, 0, 3 * (size_t)m * sizeof *gamma);
  k->kind->J (&k->b, k->J);
  if (k->kind->gamma) k->kind->gamma (&k->b, gamma);
  if (k->kind->g) k->kind->g (&k->b, g);
  if (k->kind->eta) k->kind->eta (&k->b, eta);
  const double *J = k->J;
  for (int r = 0; r < k->b.count * rows; r++) {
    int i = k->row + r;
    double acceleration = gamma[r], velocity = -eta[r];
    for (int c = 0; c < k->b.cols; c++, J++) {
      int j = pw_global (k, r / rows, c);
      if (j >= n) continue;
      acceleration -= *J * l->a[j];
      velocity += *J * x->v[j];
      effect[j] -= weight * *J * l->lambda[i];
    }
    effect[n + i] += weight * acceleration;
    row[i] += weight * g[r];
    row[m + i] += weight * velocity;
  }
}

static void effect_force (pw_variation *x, double *effect, pw_element_batch *k, double weight) {
  const double *f = k->block;
  k->kind->force (&k->b, k->block);
  for (int e = 0; e < k->b.count; e++)
    for (int c = 0; c < k->b.cols; c++, f++) {
      int j = pw_global (k, e, c);
      if (j < x->n) effect[j] += weight * *f;
    }
}

/* Adds f - M a - J^T lambda, gamma - J a; g and J v - eta of a neighbour's system at the state of the run to one of the
 * differences, without the elements that are the same in all neighbours. */
static void effect_add_to (pw_variation *x, pw_direction_copy *d, pw_workspace *w, int which, double weight) {
  const pw_system *s = w->s;
  for (int i = 0; i < s->batches; i++) {
    const pw_kind *kind = w->batch[i].kind;
    if (!d->changes[i]) continue;
    if (kind->rows > 0) effect_rows (x, d->effect[which], d->row[which], &w->batch[i], weight);
    if (kind->force && !kind->constant) effect_force (x, d->effect[which], &w->batch[i], weight);
  }
  for (int j = 0; j < x->n && d->changes[s->batches]; j++)
    d->effect[which][j] += weight * (s->constant[j] - s->mass[j] * x->linear.a[j]);
}

/* The time and the state at which neighbours are evaluated. */
typedef struct {
  double t;
  const double *q, *v;
  int held; /* 1: not those of the run */
} effect_place;

/* Between the breakpoints of the neighbours, of which one may be passed slightly before that of the run; likewise at jumps. */
static effect_place effect_at (const pw_variation *x, const pw_direction_copy *d) {
  for (const pw_variation_hold *h = x->hold; h < x->hold + 2; h++)
    if (h->from <= x->at && x->at <= h->to) return (effect_place){ h->t, h->state, h->state + x->n, 1 };
  double t = fmax (d->first, fmin (x->at, nextafter (d->last, -INFINITY)));
  return (effect_place){ t, x->q, x->v, 0 };
}

/* Kinematics and signals of a neighbour; those of the run where they are the same. */
static int effect_kinematics (pw_variation *x, const pw_direction_copy *d, pw_workspace *w) {
  effect_place at = effect_at (x, d);
  if (at.held) return pw_update_kinematics (w, at.t, at.q, at.v);
  memcpy (w->configuration, x->r->w->configuration, (size_t)w->s->bodies * sizeof *w->configuration);
  pw_point_to_internal (w, x->q, x->v);
  if (d->signals) return pw_update_signals (w, at.t, x->q, x->v);
  memcpy (w->u, x->r->w->u, 3 * (size_t)w->s->sources * sizeof *w->u);
  w->t_signal = x->r->w->t_signal;
  return PW_OK;
}

static int effect_neighbour (pw_variation *x, pw_direction_copy *d, int i) {
  pw_workspace *w = d->given.neighbour[i]->w;
  if (effect_kinematics (x, d, w) != PW_OK) return PW_METHOD;
  for (int which = 0; which < 2; which++) {
    double weight = effect_weight (&d->given, which, i);
    if (weight != 0) effect_add_to (x, d, w, which, weight);
  }
  return PW_OK;
}

/* The two differences become the extrapolated one and its error, as in pw_direction_weight. */
static void effect_extrapolate (double *one, double *two, int n) {
  for (int i = 0; i < n; i++) {
    double error = (one[i] - two[i]) / 3;
    one[i] += error;
    two[i] = error;
  }
}

static int effect_direction (pw_variation *x, pw_direction_copy *d) {
  int length = x->n + x->m, rows = 2 * x->m, status = PW_OK;
  if (d->given.initial) return PW_OK;
  for (int which = 0; which < 2; which++) {
    memset (d->effect[which], 0, (size_t)length * sizeof (double));
    memset (d->row[which], 0, (size_t)rows * sizeof (double));
  }
  for (int i = 0; i < PW_VARIATION_NEAR && status == PW_OK; i++) status = effect_neighbour (x, d, i);
  effect_extrapolate (d->effect[0], d->effect[1], length);
  effect_extrapolate (d->row[0], d->row[1], rows);
  return status;
}

int pw_variation_evaluate (pw_variation *x, double t, pw_error *error) {
  pw_statistics before = x->r->statistics;
  int near = x->r->near_singular, status = pw_linear_evaluate (&x->linear, t, x->q, x->v);
  x->at = t;
  for (int i = 0; i < x->count && status == PW_OK; i++) status = effect_direction (x, &x->direction[i]);
  x->r->statistics = before;
  if (status > 0) status = pw_fail_singular (x->r, t, error);
  x->r->near_singular = near;
  return status < 0 ? pw_fail_signal (t, error) : status;
}

int pw_variation_evaluate_at (pw_variation *x, double t, pw_error *error) {
  double *state = x->scratch;
  pw_variation_state (x, t, state);
  memcpy (x->q, state, (size_t)x->n * sizeof *x->q);
  memcpy (x->v, state + x->n, (size_t)x->n * sizeof *x->v);
  return pw_variation_evaluate (x, pw_before_breakpoint (x->r, t), error);
}

/* ---- Derivatives of energies, powers, least-norm multipliers ---- */

/* The values at a state of a run. */
static int effect_values (pw_run *r, double t, const double *q, const double *v, const double *lambda, double *out) {
  int status = pw_evaluate_J_at (r->w, t, q, v), entries = r->s->entries;
  if (status != PW_OK) return status;
  out[0] = pw_kinetic (r->s, v);
  out[1] = pw_potential (r->w);
  memcpy (out + 2 + entries, lambda, (size_t)r->s->rows * sizeof *lambda);
  pw_ledger_rates (r, lambda, out + 2);
  if (r->redundant && pw_saddle_factor (r->saddle) == PW_OK) pw_rank_least_norm (r, out + 2 + entries);
  return PW_OK;
}

double pw_variation_step_along (const pw_variation_column *c) {
  return 1e-5 / (c->largest > 0 ? c->largest : 1);
}

/* By the state: central differences. */
static int effect_by_state (pw_variation *x, const pw_variation_column *c, effect_place at, const double *Y,
                            double *out) {
  int n = x->n, m = x->m, status = PW_OK;
  double step = pw_variation_step_along (c);
  double *q = x->values + 2 + x->entries + m, *v = q + n + 3, *lambda = v + n + 3;
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    for (int j = 0; j < n; j++) q[j] = at.q[j] + side * step * Y[j], v[j] = at.v[j] + side * step * Y[n + j];
    for (int i = 0; i < m; i++) lambda[i] = x->linear.lambda[i] + side * step * c->lambda[i];
    status = effect_values (x->r, at.held ? at.t : x->at, q, v, lambda, x->values);
    effect_add (out, x->values, side / (2 * step), 2 + x->entries + m);
  }
  return status;
}

int pw_variation_outputs (pw_variation *x, const pw_variation_column *c, const double *Y, double *out) {
  const pw_direction_copy *d = c->direction;
  effect_place at = effect_at (x, d);
  int length = 2 + x->entries + x->m, status = PW_OK;
  memset (out, 0, (size_t)length * sizeof *out);
  for (int i = 0; i < PW_VARIATION_NEAR && status == PW_OK && d->given.initial == NULL; i++) {
    double weight = pw_direction_weight (&d->given, pw_variation_index (c), i);
    if (weight == 0) continue;
    status = effect_values (d->given.neighbour[i], at.t, at.q, at.v, x->linear.lambda, x->values);
    effect_add (out, x->values, weight, length);
  }
  if (status == PW_OK) status = effect_by_state (x, c, at, Y, out);
  if (!x->r->redundant) memcpy (out + 2 + x->entries, c->lambda, (size_t)x->m * sizeof *out);
  return status;
}

/* ---- Columns ---- */

double pw_variation_norm (const pw_variation *x, const double *Y) {
  const pw_system *s = x->r->s;
  double most = 0;
  for (int j = 0; j < x->n; j++)
    most = pw_larger_or_nan (most,
                             pw_larger_or_nan (fabs (Y[j]), fabs (Y[x->n + j]) * x->r->w->scale.time) / pw_unit (s, j));
  return most;
}

/* d a and d lambda of a column with the derivatives Y of the state. */
static void effect_accelerations (pw_variation *x, const pw_variation_column *c, double *da) {
  pw_linearisation *l = &x->linear;
  const double *effect = c->direction->effect[pw_variation_index (c)];
  memcpy (l->x, c->trial, 2 * (size_t)x->n * sizeof *l->x);
  pw_linear_multiply (l);
  for (int j = 0; j < x->n; j++) l->da[j] = effect[j] - l->y[j];
  for (int i = 0; i < x->m; i++) l->z[i] = effect[x->n + i] + l->y[x->n + i];
  pw_saddle_solve (x->r->saddle, l->da, l->z, l->da, c->lambda);
  memcpy (da, l->da, (size_t)x->n * sizeof *da);
}

void pw_variation_accelerate (pw_variation *x, int c, int k) {
  for (pw_direction_copy *d = x->direction; d < x->direction + x->count; d++) {
    pw_variation_column *to = &d->column[c];
    if (c >= d->columns) continue;
    memcpy (to->K[k], to->trial + x->n, (size_t)x->n * sizeof (double));
    effect_accelerations (x, to, to->K[k] + x->n);
  }
}

int pw_variation_ledger_rates (pw_variation *x, int k) {
  int status = PW_OK;
  if (!x->ledger) return PW_OK;
  PW_EACH_COLUMN (c, x) {
    if (status == PW_OK) status = pw_variation_outputs (x, c, c->trial, x->output);
    memcpy (c->K[k] + 2 * x->n, x->output + 2, (size_t)x->entries * sizeof (double));
  }
  /* J and its factors are again those of the state */
  if (pw_evaluate_J_at (x->r->w, x->at, x->q, x->v) == PW_OK) pw_saddle_factor (x->r->saddle);
  return status;
}

int pw_variation_rates (pw_variation *x, int k, pw_error *error) {
  memcpy (x->a[k], x->linear.a, (size_t)x->n * sizeof *x->q);
  pw_variation_accelerate (x, 0, k);
  pw_variation_accelerate (x, 1, k);
  return pw_variation_ledger_rates (x, k) == PW_OK ? PW_OK : pw_fail_signal (x->at, error);
}

/* Positions first; the velocities' equations contain them. */
void pw_variation_project (pw_variation *x, pw_variation_column *c) {
  pw_linearisation *l = &x->linear;
  int n = x->n, m = x->m, holonomic = x->r->s->holonomic;
  const double *row = c->direction->row[pw_variation_index (c)];
  pw_mul_J (x->r->w, c->trial, l->z);
  for (int i = 0; i < m; i++) l->z[i] = i < holonomic ? -l->z[i] - row[i] : 0;
  pw_saddle_solve (x->r->saddle, NULL, l->z, l->da, l->z);
  effect_add (c->trial, l->da, 1, n);
  memcpy (l->x, c->trial, 2 * (size_t)n * sizeof *l->x);
  pw_linear_multiply (l);
  pw_mul_J (x->r->w, c->trial + n, l->z);
  for (int i = 0; i < m; i++) l->z[i] = -l->z[i] - l->y[n + m + i] - row[m + i];
  pw_saddle_solve (x->r->saddle, NULL, l->z, l->da, l->z);
  effect_add (c->trial + n, l->da, 1, n);
}
