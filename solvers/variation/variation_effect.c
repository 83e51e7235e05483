/* The linearised equations at a state: effects of the state, exact, and of parameters, by differences of neighbours. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "variation_parts.h"

/* Weight of neighbour i in the difference with `step` (which = 0) or with twice that (which = 1). */
static double effect_weight (const pw_direction *d, int which, int i) {
  static const double central[2][PW_VARIATION_NEIGHBOURS] = { { 0, -0.5, 0.5, 0 }, { -0.25, 0, 0, 0.25 } };
  static const double one_sided[2][PW_VARIATION_NEIGHBOURS] = { { -1.5, 2, -0.5, 0 }, { -0.75, 0, 1, -0.25 } };
  return (d->one_sided ? one_sided : central)[which][i] / d->step;
}

double pw_direction_weight (const pw_direction *d, int of_error, int i) {
  return ((of_error ? 1 : 4) * effect_weight (d, 0, i) - effect_weight (d, 1, i)) / 3;
}

double pw_direction_offset (const pw_direction *d, int i) {
  static const double offset[2][PW_VARIATION_NEIGHBOURS] = { { -2, -1, 1, 2 }, { 0, 1, 2, 4 } };
  return offset[d->one_sided][i] * d->step;
}

/* ---- Effects of parameters ---- */

/* A difference of f - M a - J^T lambda (n) and of gamma - J a, g, J v - eta (m each) in progress: a neighbour adds
 * `weight` times these to `sum` and, unless it is NULL, the magnitudes of their terms to `terms`. */
typedef struct {
  double *sum, weight, *terms;
} effect_difference;

static void effect_add_term (const effect_difference *to, int i, double value, double size) {
  to->sum[i] += to->weight * value;
  if (to->terms) to->terms[i] += size;
}

/* Adds the constraint equations of a neighbour's batch: -J^T lambda, gamma - J a, g, J v - eta. */
static void effect_rows (pw_variation *x, const effect_difference *to, pw_element_batch *k) {
  const pw_linearisation *l = &x->linear;
  int rows = k->kind->rows, n = x->n, m = x->m;
  double *gamma = l->scratch, *g = gamma + m, *eta = g + m;
  memset (gamma, 0, 3 * (size_t)m * sizeof *gamma);
  k->kind->J (&k->b, k->J);
  if (k->kind->gamma) k->kind->gamma (&k->b, gamma);
  if (k->kind->g) k->kind->g (&k->b, g);
  if (k->kind->eta) k->kind->eta (&k->b, eta);
  const double *J = k->J;
  for (int row = 0; row < k->b.count * rows; row++) {
    int i = k->row + row;
    double acceleration = gamma[row], velocity = -eta[row],
           size[3] = { fabs (gamma[row]), fabs (g[row]), fabs (eta[row]) };
    for (int c = 0; c < k->b.cols; c++, J++) {
      int j = pw_global (k, row / rows, c);
      if (j >= n) continue;
      acceleration -= *J * l->a[j];
      velocity += *J * x->v[j];
      size[0] += fabs (*J * l->a[j]), size[1] += fabs (*J * x->q[j]), size[2] += fabs (*J * x->v[j]);
      effect_add_term (to, j, -*J * l->lambda[i], fabs (*J * l->lambda[i]));
    }
    effect_add_term (to, n + i, acceleration, size[0]);
    effect_add_term (to, n + m + i, g[row], size[1]);
    effect_add_term (to, n + 2 * m + i, velocity, size[2]);
  }
}

/* Adds the forces of a neighbour's batch. */
static void effect_force (pw_variation *x, const effect_difference *to, pw_element_batch *k) {
  const double *f = k->block;
  k->kind->force (&k->b, k->block);
  for (int e = 0; e < k->b.count; e++)
    for (int c = 0; c < k->b.cols; c++, f++) {
      int j = pw_global (k, e, c);
      if (j < x->n) effect_add_term (to, j, *f, fabs (*f));
    }
}

/* Adds a neighbour's system at the state of the run, without the elements that are the same in all neighbours. */
static void effect_add_system (pw_variation *x, const pw_direction_copy *d, const effect_difference *to,
                               pw_workspace *w) {
  const pw_system *s = w->s;
  for (int i = 0; i < s->batches; i++) {
    const pw_kind *kind = w->batch[i].kind;
    if (!d->changes[i]) continue;
    if (kind->rows > 0) effect_rows (x, to, &w->batch[i]);
    if (kind->force && !kind->constant) effect_force (x, to, &w->batch[i]);
  }
  for (int j = 0; j < x->n && d->changes[s->batches]; j++) {
    double inertial = s->mass[j] * x->linear.a[j];
    effect_add_term (to, j, s->constant[j] - inertial, fabs (s->constant[j]) + fabs (inertial));
  }
}

pw_variation_place pw_variation_place_of (const pw_variation *x, const pw_direction_copy *d) {
  for (const pw_variation_hold *h = x->hold; h < x->hold + 2; h++)
    if (h->from <= x->at && x->at <= h->to) return (pw_variation_place){ h->t, h->state, h->state + x->n, 1 };
  double t = fmax (d->first, fmin (x->at, nextafter (d->last, -INFINITY)));
  return (pw_variation_place){ t, x->q, x->v, 0 };
}

/* Kinematics and signals of a neighbour; those of the run where they are the same. */
static int effect_kinematics (pw_variation *x, const pw_direction_copy *d, pw_workspace *w) {
  pw_variation_place at = pw_variation_place_of (x, d);
  if (at.held) return pw_update_kinematics (w, at.t, at.q, at.v);
  memcpy (w->configuration, x->r->w->configuration, (size_t)w->s->bodies * sizeof *w->configuration);
  pw_point_to_internal (w, x->q, x->v);
  if (d->signals) return pw_update_signals (w, at.t, x->q, x->v);
  memcpy (w->u, x->r->w->u, 3 * (size_t)w->s->sources * sizeof *w->u);
  w->t_signal = x->r->w->t_signal;
  return PW_OK;
}

/* Adds neighbour i to the two differences, in effect[0] and effect[1]. */
static int effect_neighbour (pw_variation *x, pw_direction_copy *d, int i) {
  pw_workspace *w = d->given.neighbour[i]->w;
  if (effect_kinematics (x, d, w) != PW_OK) return PW_METHOD;
  for (int which = 0; which < 2; which++) {
    double *terms = which == 0 && i == 1 ? d->terms : NULL; /* this neighbour has the largest weight */
    const effect_difference to = { d->effect[which], effect_weight (&d->given, which, i), terms };
    if (to.weight != 0) effect_add_system (x, d, &to, w);
  }
  return PW_OK;
}

/* The factor that makes entry i of an effect dimensionless: of forces, in units of the accelerations that they cause,
 * 0 without mass; of residuals, in units of the scene as if all were of lengths. */
static double effect_unit (const pw_variation *x, int i) {
  double T = x->r->w->scale.time;
  if (i < x->n) return x->r->s->mass[i] > 0 ? T * T / x->r->s->mass[i] / pw_unit (x->r->s, i) : 0;
  return (i < x->n + x->m ? T * T : i < x->n + 2 * x->m ? 1 : T) / x->r->s->scale.length;
}

double pw_variation_least_effect (const pw_direction_copy *d) {
  return fmin (1, 1e-5 / fabs (d->given.step));
}

/* The two differences become the extrapolated one and its error, as in pw_direction_weight, plus round-off. */
static void effect_extrapolate (const pw_variation *x, pw_direction_copy *d) {
  double *one = d->effect[0], *two = d->effect[1], all = 0;
  double round = 4 * DBL_EPSILON * fabs (effect_weight (&d->given, 0, 1));
  for (int i = 0; i < x->n + 3 * x->m; i++) {
    double error = (one[i] - two[i]) / 3, per_unit = effect_unit (x, i);
    one[i] += error;
    double noise = one[i] != 0 || error != 0 ? round * d->terms[i] : 0; /* 0: no effect */
    two[i] = error + copysign (noise, error);
    all += fabs (one[i]) * per_unit;
    d->effects.error += fabs (two[i]) * per_unit;
    d->effects.round += noise * per_unit;
  }
  d->effects.all += fmax (all, pw_variation_least_effect (d));
}

/* The step of the differences is kept while their relative error is below EFFECT_ROUND if it is round-off, else, if it
 * is the remainder of the differences, below EFFECT_REMAINDER, whose square is about the remainder of the extrapolated
 * one.  A better step aims at EFFECT_AIM times these. */
static const double EFFECT_ROUND = 1e-7, EFFECT_REMAINDER = 1e-4, EFFECT_AIM = 0.1;

/* With a smaller step an effect may be 0 only because the step is lost in the rounding of numbers of the order of 1. */
static const double EFFECT_LOST = 1e-10;

/* The factor for the step with which these differences would be accurate; 1 if they are. */
static double effect_factor (const pw_difference_sums *s) {
  int rounds = s->round > 0.1 * s->error;
  double off = s->all > 0 ? s->error / s->all / (rounds ? EFFECT_ROUND : EFFECT_REMAINDER) : 0;
  if (off <= 1) return 1;
  return rounds ? fmin (1000, off / EFFECT_AIM) : fmax (0.001, sqrt (EFFECT_AIM / off));
}

double pw_variation_better_step (const pw_variation *x, int i) {
  const pw_direction_copy *d = &x->direction[i];
  double step = d->given.step, start = effect_factor (&d->start), effects = effect_factor (&d->effects);
  if (d->given.initial) return step;
  if (d->column->largest == 0) return fabs (step) < EFFECT_LOST ? 1000 * step : step;
  return step * (start == 1 ? effects : effects == 1 ? start : fmin (start, effects));
}

/* The effects of one direction at the state evaluated. */
static int effect_direction (pw_variation *x, pw_direction_copy *d) {
  size_t bytes = ((size_t)x->n + 3 * (size_t)x->m) * sizeof (double);
  int status = PW_OK;
  if (d->given.initial) return PW_OK;
  memset (d->effect[0], 0, bytes);
  memset (d->effect[1], 0, bytes);
  memset (d->terms, 0, bytes);
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS && status == PW_OK; i++) status = effect_neighbour (x, d, i);
  effect_extrapolate (x, d);
  return status;
}

/* Not counted in the statistics of the run. */
int pw_variation_evaluate (pw_variation *x, double t, pw_error *error) {
  pw_statistics before = x->r->statistics;
  int near = x->r->near_singular, status = pw_linear_evaluate (&x->linear, t, x->q, x->v);
  pw_evaluate_energies (x->r->w, x->element_energy);
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

/* ---- Columns ---- */

double pw_variation_norm (const pw_variation *x, const double *Y) {
  const pw_system *s = x->r->s;
  double most = 0;
  for (int j = 0; j < x->n; j++)
    most = pw_larger_or_nan (most,
                             pw_larger_or_nan (fabs (Y[j]), fabs (Y[x->n + j]) * x->r->w->scale.time) / pw_unit (s, j));
  return most;
}

/* d a, and d lambda into c->lambda, of a column at its `trial`. */
static void effect_accelerations (pw_variation *x, const pw_variation_column *c, double *da) {
  pw_linearisation *l = &x->linear;
  const double *effect = c->direction->effect[pw_variation_column_index (c)];
  memcpy (l->dx, c->trial, 2 * (size_t)x->n * sizeof *l->dx);
  pw_linear_multiply (l);
  for (int j = 0; j < x->n; j++) l->da[j] = effect[j] - l->product[j];
  for (int i = 0; i < x->m; i++) l->scratch[i] = effect[x->n + i] + l->product[x->n + i];
  pw_saddle_solve (x->r->saddle, l->da, l->scratch, l->da, c->lambda);
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

/* Positions first, by a correction that leaves S dq as it is; the velocities' equations contain them. */
void pw_variation_project (pw_variation *x, pw_variation_column *c) {
  pw_linearisation *l = &x->linear;
  int n = x->n, m = x->m, holonomic = x->r->s->holonomic;
  const double *row = c->direction->effect[pw_variation_column_index (c)] + n + m;
  pw_mul_J (x->r->w, c->trial, l->scratch);
  for (int i = 0; i < m; i++) l->scratch[i] = i < holonomic ? -l->scratch[i] - row[i] : 0;
  pw_saddle_solve (x->r->saddle, NULL, l->scratch, l->da, l->scratch);
  pw_add_scaled (c->trial, l->da, 1, n);
  memcpy (l->dx, c->trial, 2 * (size_t)n * sizeof *l->dx);
  pw_linear_multiply (l);
  pw_mul_J (x->r->w, c->trial + n, l->scratch);
  for (int i = 0; i < m; i++) l->scratch[i] = -l->scratch[i] - l->product[n + m + i] - row[m + i];
  pw_saddle_solve (x->r->saddle, NULL, l->scratch, l->da, l->scratch);
  pw_add_scaled (c->trial + n, l->da, 1, n);
}
