/* The workspace of a run: kinematics, evaluation of all batches, products with J, second-order blocks, ledger. */
#include <stdlib.h>
#include "system.h"
#include "sine.h"

void pw_evaluate_J (pw_workspace *w) {
  PW_EACH_CONSTRAINT (k, w) k->kind->J (&k->b, k->J);
}

/* Fills the equations of a batch in an array over constraint equations; f NULL: zeros. */
static inline void evaluate_batch_rows (const pw_element_batch *k, pw_batch_function *f, double *out) {
  if (f)
    f (&k->b, out + k->row);
  else
    for (int i = k->row; i < k->row + k->b.count * k->kind->rows; i++) out[i] = 0;
}

/* Fills an array over constraint equations by the function at this offset of each type's table. */
PW_INLINE void evaluate_rows (pw_workspace *w, size_t function, int batches, double *out) {
  for (const pw_element_batch *k = w->batch, *end = k + batches; k < end; k++)
    evaluate_batch_rows (k, pw_kind_function (k->kind, function), out);
}

void pw_evaluate_g (pw_workspace *w, double *g) {
  evaluate_rows (w, offsetof (pw_kind, g), w->s->positions, g);
}

void pw_evaluate_g_size (pw_workspace *w, double *size) {
  evaluate_rows (w, offsetof (pw_kind, g_size), w->s->positions, size);
  for (int i = 0; i < w->s->holonomic; i++) size[i] = pw_larger (size[i], w->scale.length);
}

void pw_evaluate_eta (pw_workspace *w, double *eta) {
  evaluate_rows (w, offsetof (pw_kind, eta), w->s->constraints, eta);
}

void pw_evaluate_gamma (pw_workspace *w, double *gamma) {
  evaluate_rows (w, offsetof (pw_kind, gamma), w->s->constraints, gamma);
}

void pw_evaluate_J_gamma (pw_workspace *w, double *gamma) {
  PW_EACH_CONSTRAINT (k, w)
    if (k->kind->J_gamma)
      k->kind->J_gamma (&k->b, k->J, gamma + k->row);
    else
      k->kind->J (&k->b, k->J), evaluate_batch_rows (k, k->kind->gamma, gamma);
}

/* Calls f (..., bodies, internal) for a batch, with constants for the commonest numbers, so that its loops over the
 * columns of an element are unrolled. */
#define EVALUATE_UNROLLED(k, f, ...)            \
  ((k)->unrolled == 2   ? f (__VA_ARGS__, 2, 0) \
   : (k)->unrolled == 1 ? f (__VA_ARGS__, 1, 0) \
                        : f (__VA_ARGS__, (k)->kind->bodies, (k)->kind->internal))

PW_INLINE void evaluate_add_blocks (const pw_element_batch *k, double *f, int bodies, int internal) {
  const double *block = k->block;
  const int *column = k->column;
  double *own = f + k->internal;
  for (int e = k->b.count; e > 0; e--) {
    PW_UNROLL for (int n = 0; n < bodies; n++, block += 3) {
      double *to = f + *column++;
      to[0] += block[0], to[1] += block[1], to[2] += block[2];
    }
    for (int n = 0; n < internal; n++) *own++ += *block++;
  }
}

PW_INLINE void evaluate_add_force (const pw_element_batch *k, double *f) {
  k->kind->force (&k->b, k->block);
  EVALUATE_UNROLLED (k, evaluate_add_blocks, k, f);
}

void pw_add_constant_forces (const pw_workspace *w, double *f) {
  PW_EACH_BATCH (k, w)
    if (k->kind->force && k->kind->constant) evaluate_add_force (k, f);
}

void pw_evaluate_force (pw_workspace *w, double *f) {
  memcpy (f, w->s->constant, (size_t)w->s->coords * sizeof *f);
  for (const pw_element_batch *k = w->batch + w->s->first_force, *end = w->batch + w->s->batches; k < end; k++)
    if (k->adds_force) evaluate_add_force (k, f);
}

double pw_potential (pw_workspace *w) {
  double sum = 0;
  PW_EACH_BATCH (k, w) {
    if (k->kind->energy == NULL) continue;
    k->kind->energy (&k->b, k->block);
    for (int e = 0; e < k->b.count; e++) sum += k->block[e];
  }
  return sum;
}

double pw_kinetic (const pw_system *s, const double *v) {
  double sum = 0;
  for (int j = 0; j < s->coords; j++) sum += s->M[j] * v[j] * v[j];
  return sum / 2;
}

/* out = J x for a batch; x NULL: the velocities of the workspace. */
PW_INLINE void evaluate_J_x (const pw_element_batch *k, const pw_workspace *w, const double *x, double *out, int rows,
                             int bodies, int internal) {
  static const double ground[3] = { 0, 0, 0 };
  const double *J = k->J, *X[PW_MAX_BODIES] = { NULL }, *y = x ? x + k->internal : k->b.v;
  const int *column = k->column, *body = k->b.body, coords = w->s->coords;
  for (int e = k->b.count; e > 0; e--, column += bodies, body += bodies, y += internal) {
    PW_UNROLL for (int n = 0; n < bodies; n++) {
      const double *velocity = &k->b.configuration[body[n]].vx; /* vx, vy, omega */
      X[n] = x == NULL ? velocity : column[n] < coords ? x + column[n] : ground;
    }
    PW_UNROLL for (int r = 0; r < rows; r++) {
      double sum = 0;
      PW_UNROLL for (int n = 0; n < bodies; n++, J += 3) {
        const double term = J[0] * X[n][0] + J[1] * X[n][1] + J[2] * X[n][2];
        sum = n == 0 ? term : sum + term;
      }
      for (int n = 0; n < internal; n++, J++) sum += *J * y[n];
      *out++ = sum;
    }
  }
}

/* Calls it for all batches, with constants for the commonest types. */
PW_INLINE void evaluate_J_all (const pw_workspace *w, const double *x, double *out) {
  PW_EACH_CONSTRAINT (k, w) {
    double *to = out + k->row;
    const int rows = k->kind->rows;
    if (k->unrolled == 2 && rows == 2)
      evaluate_J_x (k, w, x, to, 2, 2, 0);
    else if (k->unrolled == 1 && rows == 1)
      evaluate_J_x (k, w, x, to, 1, 1, 0);
    else if (k->unrolled == 2 && rows == 1)
      evaluate_J_x (k, w, x, to, 1, 2, 0);
    else
      evaluate_J_x (k, w, x, to, rows, k->kind->bodies, k->kind->internal);
  }
}

void pw_mul_J (const pw_workspace *w, const double *x, double *out) {
  evaluate_J_all (w, x, out);
}

void pw_add_JT (const pw_workspace *w, const double *lambda, double *out) {
  PW_EACH_CONSTRAINT (k, w) {
    const double *J = k->J;
    for (int e = 0; e < k->b.count; e++)
      for (int r = 0; r < k->kind->rows; r++, lambda++) {
        for (int n = 0; n < k->kind->bodies; n++, J += 3) {
          double *to = out + k->column[e * k->kind->bodies + n];
          to[0] += J[0] * *lambda;
          to[1] += J[1] * *lambda;
          to[2] += J[2] * *lambda;
        }
        for (int n = 0; n < k->kind->internal; n++) out[k->internal + e * k->kind->internal + n] += *J++ * *lambda;
      }
  }
}

/* Updates the largest scaled residual and its constraint equation.  NaN is the largest, hence the negation. */
static inline void evaluate_update_worst (int i, double ratio, double *scaled, int *row) {
  if (!(ratio <= *scaled) && !isnan (*scaled)) *scaled = ratio, *row = i;
}

/* The largest magnitude of enforced residuals; NaN if one is. */
static double evaluate_largest (const double *residual, int rows, const unsigned char *enforced) {
  double largest = 0, sum = 0; /* NaN if one is */
  for (int i = 0; i < rows; i++) {
    if (enforced && !enforced[i]) continue;
    largest = pw_larger (fabs (residual[i]), largest);
    sum += fabs (residual[i]);
  }
  return isnan (sum) ? NAN : largest;
}

void pw_worst_position (pw_workspace *w, const double *g, double *size, const unsigned char *enforced, double known,
                        pw_residuals *r) {
  r->position = known, r->g = evaluate_largest (g, w->s->holonomic, enforced), r->row_position = -1;
  if (r->g <= known * w->scale.length) return;
  pw_evaluate_g_size (w, size);
  for (int i = 0; i < w->s->holonomic; i++)
    if (enforced == NULL || enforced[i])
      evaluate_update_worst (i, fabs (g[i]) / size[i], &r->position, &r->row_position);
}

/* Updates the worst scaled residual with those of a batch: the residual over the sum of L / T, the unit, and the
 * magnitudes of the equation's terms; eta NULL: zero. */
PW_SELDOM void evaluate_scale_velocities (const pw_element_batch *k, const double *residual, const double *eta,
                                          const unsigned char *enforced, double unit, pw_residuals *r) {
  const int bodies = k->kind->bodies, internal = k->kind->internal, rows = k->kind->rows;
  for (int n = 0, i = k->row; n < k->b.count * rows; n++, i++) {
    const int e = n / rows;
    const double *J = k->J + n * k->b.cols, error = fabs (residual[i]);
    double size = unit;
    if ((enforced && !enforced[i]) || error <= r->velocity * unit) continue;
    for (int m = 0; m < bodies; m++, J += 3) {
      const pw_configuration *p = &k->b.configuration[k->b.body[e * bodies + m]];
      size += fabs (J[0] * p->vx) + fabs (J[1] * p->vy) + fabs (J[2] * p->omega);
    }
    for (int m = 0; m < internal; m++) size += fabs (J[m] * k->b.v[e * internal + m]);
    if (eta) size += fabs (eta[i]);
    evaluate_update_worst (i, error / size, &r->velocity, &r->row_velocity);
  }
}

void pw_evaluate_velocity_residual (pw_workspace *w, const unsigned char *enforced, double known, pw_residuals *r) {
  double *value = w->scratch, *eta = w->s->rheonomic ? value + w->s->rows : NULL,
         unit = w->scale.length / w->scale.time;
  evaluate_J_all (w, NULL, value);
  if (eta) {
    pw_evaluate_eta (w, eta);
    for (int i = 0; i < w->s->rows; i++) value[i] -= eta[i];
  }
  r->velocity = known, r->jv = evaluate_largest (value, w->s->rows, enforced), r->row_velocity = -1;
  if (r->jv <= known * unit) return;
  PW_EACH_CONSTRAINT (k, w) evaluate_scale_velocities (k, value, eta, enforced, unit, r);
}

void pw_evaluate_position_residual (pw_workspace *w, const unsigned char *enforced, double known, pw_residuals *r) {
  double *value = w->scratch, *size = value + w->s->rows;
  pw_evaluate_g (w, value);
  pw_worst_position (w, value, size, enforced, known, r);
}

void pw_evaluate_residuals (pw_workspace *w, const unsigned char *enforced, pw_residuals *r) {
  pw_evaluate_position_residual (w, enforced, 0, r);
  pw_evaluate_velocity_residual (w, enforced, 0, r);
}

void pw_point_to_internal (pw_workspace *w, const double *q, const double *v) {
  for (pw_element_batch *k = w->batch; k < w->batch + w->s->batches; k++) {
    if (q) k->b.q = q + k->internal;
    k->b.v = v + k->internal;
  }
}

/* Two bodies at a time; singly the last of an odd number, and all from a pair with an angle beyond the limit on. */
__attribute__ ((always_inline)) static inline void update_configurations (pw_workspace *w, const double *q,
                                                                          const double *v) {
  if (w->s->coords > 3 * w->s->bodies) pw_point_to_internal (w, q, v);
  pw_configuration *p = w->configuration, *end = p + w->s->bodies;
  _Static_assert(PW_SINE_LANES == 2, "bodies are evaluated in pairs");
  for (; p + 1 < end; p += 2, q += 6, v += 6) {
    pw_lanes c, s;
    if (!(fabs (q[2]) < PW_SINE_LIMIT && fabs (q[5]) < PW_SINE_LIMIT)) break;
    pw_sin_cos_lanes ((pw_lanes){ q[2], q[5] }, &s, &c);
    p[0] = (pw_configuration){ q[0], q[1], q[2], c[0], s[0], v[0], v[1], v[2] };
    p[1] = (pw_configuration){ q[3], q[4], q[5], c[1], s[1], v[3], v[4], v[5] };
  }
  for (; p < end; p++, q += 3, v += 3) {
    double c, s;
    pw_sin_cos (q[2], &s, &c);
    *p = (pw_configuration){ q[0], q[1], q[2], c, s, v[0], v[1], v[2] };
  }
}

double pw_read_rate (const pw_workspace *w, int j, const double *v) {
  return j < w->s->coords ? v[j] : pw_rate_source (w, j - w->s->coords)->u[0];
}

int pw_update_signals (pw_workspace *w, double t, const double *q, const double *v) {
  int new_time = t != w->t_signal && !isnan (t); /* NaN: pw_update_velocities, after a failure */
  if (!new_time && w->s->state_dependent == 0) return PW_OK;
  if (new_time) w->t_signal = NAN; /* if a signal fails, others have changed already */
  for (pw_source *source = w->source, *end = source + w->s->sources; source < end; source++) {
    if (source->held) continue;
    int copied = 0; /* states that a function reads; q NULL: only velocities */
    for (int r = 0; r < source->reads; r++) {
      const int j = source->state[r], velocity = j >= w->s->coords;
      if (q == NULL && !velocity) continue;
      source->x[r] = velocity ? v[j - w->s->coords] : q[j];
      copied++;
    }
    if (copied == 0 && !(new_time && source->reads == 0)) continue;
    if (pw_signal_eval (source, copied && source->of_coordinate ? *source->x : t) == 0) continue;
    w->failed = source;
    return PW_METHOD;
  }
  w->t_signal = t; /* unchanged unless the time is new */
  for (const pw_source *source = w->source, *end = source + w->s->sources; w->s->feedback && source < end; source++) {
    if (!source->feedback || source->held) continue;
    double rate = source->u[2]; /* after all signals have been evaluated */
    for (int r = 0; r < source->reads; r++)
      rate += source->x[source->reads + r] * pw_read_rate (w, source->state[r], v);
    source->u[1] = rate;
  }
  return PW_OK;
}

int pw_update_kinematics (pw_workspace *w, double t, const double *q, const double *v) {
  update_configurations (w, q, v);
  return t == w->t_signal && w->s->state_dependent == 0 ? PW_OK : pw_update_signals (w, t, q, v);
}

int pw_update_velocities (pw_workspace *w, const double *v) {
  const double *from = v;
  for (pw_configuration *p = w->configuration, *end = p + w->s->bodies; p < end; p++, from += 3)
    p->vx = from[0], p->vy = from[1], p->omega = from[2];
  if (w->s->coords > 3 * w->s->bodies) pw_point_to_internal (w, NULL, v);
  return w->s->state_dependent > 0 ? pw_update_signals (w, w->t_signal, NULL, v) : PW_OK;
}

void pw_hold_signals (pw_workspace *w, pw_hold hold) {
  const pw_source *rates = pw_rate_source (w, w->s->mechanical);
  for (pw_source *source = w->source, *end = source + w->s->sources; source < end; source++)
    source->held = !source->of_coordinate && hold >= (source >= rates    ? PW_HOLD_FORCES
                                                      : source->of_force ? PW_HOLD_INPUTS
                                                                         : PW_HOLD_ALL);
  w->hold = hold;
  w->t_signal = NAN;
}

double pw_next_breakpoint (pw_workspace *w, int kinks, double t) {
  double next = INFINITY;
  for (const pw_source *source = w->source, *end = source + w->s->sources; source < end; source++) {
    if (source->of_coordinate) continue;
    double breakpoint = pw_signal_breakpoint (&source->signal, kinks && !source->of_force, t);
    if (breakpoint < next) next = breakpoint;
    if (breakpoint > t) continue;
    w->failed = source;
    return NAN;
  }
  return next;
}

/* Second-order blocks, by formulas or by differences.  Central differences with step h = eps^(1/3) in units of the
 * scene (more for values above 1, see blocks_step): truncation and round-off are both of the order eps^(2/3) (Dennis &
 * Schnabel 1983, section 5.6). */

/* Each block is the derivative of `original` of the type's table, or of its product with w or lambda.  `function`: the
 * type's function for it; for PW_JTL_Q jw_q, from which blocks_transpose computes the block. */
#define BLOCKS_ENTRY(f, g) .function = offsetof (pw_kind, f), .original = offsetof (pw_kind, g)
static const struct {
  size_t function, original;
  enum { BLOCKS_NONE, BLOCKS_J_W, BLOCKS_JT_LAMBDA } product;
  int velocity; /* 1: derivative with respect to v; 0: to q */
  int square;   /* 1: it has as many rows as local columns; 0: kind->rows */
} blocks_table[] = {
  [PW_JW_Q] = { BLOCKS_ENTRY (jw_q, J), .product = BLOCKS_J_W },
  [PW_JTL_Q] = { BLOCKS_ENTRY (jw_q, J), .product = BLOCKS_JT_LAMBDA, .square = 1 },
  [PW_ETA_Q] = { BLOCKS_ENTRY (eta_q, eta) },
  [PW_GAMMA_Q] = { BLOCKS_ENTRY (gamma_q, gamma) },
  [PW_GAMMA_V] = { BLOCKS_ENTRY (gamma_v, gamma), .velocity = 1 },
  [PW_FORCE_Q] = { BLOCKS_ENTRY (force_q, force), .square = 1 },
  [PW_FORCE_V] = { BLOCKS_ENTRY (force_v, force), .velocity = 1, .square = 1 },
  [PW_G_Q] = { BLOCKS_ENTRY (J, g) },
};

pw_batch_function *pw_block_function (const pw_kind *kind, pw_block block) {
  return pw_kind_function (kind, blocks_table[block].function);
}

int pw_block_rows (const pw_kind *kind, pw_block block) {
  return blocks_table[block].square ? 3 * kind->bodies + kind->internal : kind->rows;
}

/* A batch of one element with a copy of its configurations, which can be changed without affecting other elements. */
typedef struct {
  pw_batch b;
  int body[PW_MAX_BODIES];
  pw_configuration configuration[PW_MAX_BODIES];
  double q[PW_MAX_INTERNAL], v[PW_MAX_INTERNAL];
  const pw_source *source;      /* of its signals */
  double u[3 * PW_MAX_SIGNALS]; /* those of an internal coordinate */
} blocks_single;

static void blocks_isolate (const pw_element_batch *k, int e, blocks_single *one) {
  const pw_kind *kind = k->kind;
  one->b = k->b;
  one->b.count = 1;
  one->b.element = (const char *)k->b.element + (size_t)e * kind->element;
  for (int n = 0; n < kind->bodies; n++) {
    one->configuration[n] = k->b.configuration[k->b.body[e * kind->bodies + n]];
    one->body[n] = n;
  }
  for (int n = 0; n < kind->internal; n++) {
    one->q[n] = k->b.q[e * kind->internal + n];
    one->v[n] = k->b.v[e * kind->internal + n];
  }
  one->b.body = one->body;
  one->b.configuration = one->configuration;
  one->b.q = one->q;
  one->b.v = one->v;
  one->b.u = k->b.u + 3 * e * kind->signals;
  one->source = k->source + e * kind->signals;
  if (k->b.w) one->b.w = k->b.w + e * k->b.cols;
  if (k->b.lambda) one->b.lambda = k->b.lambda + e * kind->rows;
}

static double *blocks_variable (const pw_kind *kind, blocks_single *one, int c, int velocity) {
  if (c >= 3 * kind->bodies) return (velocity ? one->v : one->q) + c - 3 * kind->bodies;
  pw_configuration *p = &one->configuration[c / 3];
  double *const q[] = { &p->x, &p->y, &p->phi }, *const v[] = { &p->vx, &p->vy, &p->omega };
  return velocity ? v[c % 3] : q[c % 3];
}

/* y = the function or product whose derivative the block is. */
static void blocks_value (const pw_kind *kind, pw_block block, blocks_single *one, double *y) {
  pw_batch_function *original = pw_kind_function (kind, blocks_table[block].original);
  int rows = kind->rows, cols = one->b.cols;
  double J[PW_MAX_ROWS * PW_MAX_COLS] = { 0 };
  memset (y, 0, PW_MAX_COLS * sizeof *y);
  for (int n = 0; n < kind->bodies; n++) {
    pw_configuration *p = &one->configuration[n];
    pw_sin_cos (p->phi, &p->sin, &p->cos);
  }
  for (int n = 0; kind->of_coordinate && n < kind->signals; n++) {
    pw_source moved = one->source[n];
    moved.u = one->u + 3 * n, one->b.u = one->u;
    (void)pw_signal_eval (&moved, one->q[0]); /* fails where the signal itself does */
  }
  if (original == NULL) return;
  if (blocks_table[block].product == BLOCKS_NONE) {
    original (&one->b, y);
    return;
  }
  original (&one->b, J);
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < cols; c++) {
      if (blocks_table[block].product == BLOCKS_J_W)
        y[r] += J[r * cols + c] * one->b.w[c];
      else
        y[c] += J[r * cols + c] * one->b.lambda[r];
    }
}

/* The scene's unit of a local column, or of its velocity. */
static double blocks_unit (const pw_workspace *w, const pw_kind *kind, int c, int velocity) {
  double unit = c < 3 * kind->bodies && c % 3 < 2 ? w->scale.length : 1;
  return velocity ? unit / w->scale.time : unit;
}

void pw_evaluate_by_signal (const pw_element_batch *k, int e, int u, pw_by_signal *out) {
  const pw_kind *kind = k->kind;
  const int signals = kind->signals, numbers = kind->rows * k->b.cols;
  const struct {
    pw_batch_function *function;
    double *to;
    int count;
  } part[] = { { kind->J_u, out->J, numbers },
               { kind->eta_u, out->eta, kind->rows },
               { kind->gamma_u, out->gamma, kind->rows } };
  double all[PW_MAX_ROWS * PW_MAX_COLS * PW_MAX_SIGNALS];
  blocks_single one;
  blocks_isolate (k, e, &one);
  for (int p = 0; p < 3; p++) {
    memset (all, 0, sizeof all);
    if (part[p].function) part[p].function (&one.b, all);
    for (int i = 0; i < part[p].count; i++) part[p].to[i] = all[i * signals + u];
  }
}

void pw_feedback_rate_gradient (const pw_workspace *w, const pw_source *source, const double *v, double *out) {
  const int reads = source->reads;
  double u[3], *x = out + reads, *rate = x + 2 * reads;
  pw_source at = *source;
  at.x = x, at.u = u;
  for (int r = 0; r < reads; r++) rate[r] = pw_read_rate (w, source->state[r], v);
  for (int r = 0; r < reads; r++) {
    double side[2] = { 0 }, h = 6e-6 * (fabs (source->x[r]) + 1);
    for (int k = 0; k < 2; k++) {
      memcpy (x, source->x, (size_t)reads * sizeof *x);
      x[r] += k ? h : -h;
      if (pw_signal_eval (&at, w->t_signal) != 0) { /* at the end of its domain */
        side[0] = side[1] = 0;
        break;
      }
      side[k] = u[1];
      for (int i = 0; i < reads; i++) side[k] += x[reads + i] * rate[i];
    }
    out[r] = (side[1] - side[0]) / (2 * h);
  }
}

/* An exactly representable step h that balances truncation, (h / unit)^2, and round-off, eps x / h, eps = 2.3e-16. */
static double blocks_step (const pw_workspace *w, const pw_kind *kind, int c, int velocity, double x) {
  double unit = blocks_unit (w, kind, c, velocity);
  volatile double moved = x + unit * cbrt (2.3e-16 * fmax (1, fabs (x) / unit));
  return moved - x;
}

void pw_difference (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block, double *out) {
  const pw_kind *kind = k->kind;
  int velocity = blocks_table[block].velocity, rows = pw_block_rows (kind, block), cols = k->b.cols;
  blocks_single one;
  blocks_isolate (k, e, &one);
  for (int c = 0; c < cols; c++) {
    double plus[PW_MAX_COLS], minus[PW_MAX_COLS], *x = blocks_variable (kind, &one, c, velocity), x0 = *x;
    double h = blocks_step (w, kind, c, velocity, x0);
    *x = x0 + h;
    blocks_value (kind, block, &one, plus);
    *x = x0 - h;
    blocks_value (kind, block, &one, minus);
    *x = x0;
    int ground = c < 3 * kind->bodies && k->column[e * kind->bodies + c / 3] >= w->s->coords;
    for (int r = 0; r < rows; r++) out[r * cols + c] = ground ? 0 : (plus[r] - minus[r]) / (2 * h);
  }
}

/* A derivative per unit of the variable is taken for 0 if it is at most this part of the function's value; that of a
 * constant function is round-off, eps / h = 4e-11 of the value. */
#define BLOCKS_ZERO 1e-6

int pw_block_missing (const pw_workspace *w, const pw_element_batch *k, int e, pw_block block) {
  double value[PW_MAX_COLS], slope[PW_MAX_COLS * PW_MAX_COLS], most = 0;
  const pw_kind *kind = k->kind;
  int rows = pw_block_rows (kind, block), cols = k->b.cols;
  blocks_single one;
  if (pw_block_function (kind, block) || pw_kind_function (kind, blocks_table[block].original) == NULL) return 0;
  blocks_isolate (k, e, &one);
  blocks_value (kind, block, &one, value);
  for (int r = 0; r < rows; r++) most = fmax (most, fabs (value[r]));
  pw_difference (w, k, e, block, slope);
  for (int i = 0; i < rows * cols; i++)
    if (fabs (slope[i]) * blocks_unit (w, kind, i % cols, blocks_table[block].velocity) > BLOCKS_ZERO * most) return 1;
  return 0;
}

/* Moves an element to an irregular state, with other angle and angular velocity of its body n if `turned`. */
static void blocks_scatter (const pw_workspace *w, const pw_element_batch *k, int e, int n, int turned,
                            blocks_single *one, double *u) {
  const pw_kind *kind = k->kind;
  double L = w->scale.length;
  int i = 1;
  blocks_isolate (k, e, one);
  for (int b = 0; b < kind->bodies; b++) {
    pw_configuration *p = &one->configuration[b];
    double turn = turned && b == n ? 1.1 : 0;
    if (k->column[e * kind->bodies + b] >= w->s->coords) continue;
    p->x = L * pw_sin (2.4 * i++), p->y = L * pw_sin (2.4 * i++), p->phi = pw_sin (2.4 * i++) + turn;
    p->vx = L * pw_sin (2.4 * i++), p->vy = L * pw_sin (2.4 * i++), p->omega = pw_sin (2.4 * i++) + turn;
    pw_sin_cos (p->phi, &p->sin, &p->cos);
  }
  for (int c = 0; c < kind->internal; c++) one->q[c] = pw_sin (2.4 * i++), one->v[c] = pw_sin (2.4 * i++);
  for (int c = 0; c < 3 * kind->signals; c++) u[c] = pw_sin (2.4 * i++);
  one->b.u = u;
}

int pw_uses_angle (const pw_workspace *w, const pw_element_batch *k, int e, int n) {
  const pw_kind *kind = k->kind;
  const int cols = k->b.cols, column = 3 * n + 2;
  const struct {
    pw_batch_function *function;
    int size, width; /* entries; those of each local column in a row, 0: they do not belong to columns */
  } part[] = { { kind->g, kind->rows, 0 },     { kind->eta, kind->rows, 0 },
               { kind->gamma, kind->rows, 0 }, { kind->J, kind->rows * cols, 1 },
               { kind->force, cols, 1 },       { kind->force_u, cols * kind->signals, kind->signals } };
  blocks_single one, other;
  double u[3 * PW_MAX_SIGNALS], x[PW_MAX_COLS * PW_MAX_ROWS], y[PW_MAX_COLS * PW_MAX_ROWS];
  blocks_scatter (w, k, e, n, 0, &one, u);
  blocks_scatter (w, k, e, n, 1, &other, u);
  for (size_t f = 0; f < sizeof part / sizeof *part; f++) {
    if (part[f].function == NULL) continue;
    part[f].function (&one.b, x);
    part[f].function (&other.b, y);
    for (int i = 0; i < part[f].size; i++)
      if (x[i] != y[i] || (part[f].width && i / part[f].width % cols == column && x[i] != 0)) return 1;
  }
  return 0;
}

/* d(J^T lambda)/dq of element e from its d(J w)/dq: entry (r, c) is sum_i lambda_i dJ_ir/dq_c, where w = e_r gives
 * column r of J. */
static void blocks_transpose (const pw_element_batch *k, int e, pw_batch_function *jw_q, double *out) {
  double w[PW_MAX_COLS] = { 0 }, slope[PW_MAX_ROWS * PW_MAX_COLS];
  int cols = k->b.cols;
  blocks_single one;
  blocks_isolate (k, e, &one);
  one.b.w = w;
  memset (out, 0, (size_t)(cols * cols) * sizeof *out);
  for (int r = 0; r < cols; r++) {
    w[r] = 1;
    jw_q (&one.b, slope);
    w[r] = 0;
    for (int i = 0; i < k->kind->rows; i++)
      for (int c = 0; c < cols; c++) out[r * cols + c] += k->b.lambda[e * k->kind->rows + i] * slope[i * cols + c];
  }
}

int pw_evaluate_block (const pw_workspace *w, const pw_element_batch *k, pw_block block, double *out) {
  pw_batch_function *function = pw_block_function (k->kind, block);
  if (function == NULL) return 0;
  if (function != pw_by_differences && block != PW_JTL_Q) {
    function (&k->b, out);
    return 1;
  }
  for (int e = 0, size = pw_block_rows (k->kind, block) * k->b.cols; e < k->b.count; e++, out += size)
    if (function == pw_by_differences)
      pw_difference (w, k, e, block, out);
    else
      blocks_transpose (k, e, function, out);
  return 1;
}

/* ---- Changes that reverse saturating forces, such as friction (pw_kind.saturation) ---- */

/* Fills the batch's block, 2 cols per element, if its forces saturate.  Returns the number of entries. */
static int saturation_fill (const pw_element_batch *k) {
  int n = k->kind->saturation ? k->b.count * 2 * k->b.cols : 0;
  for (int i = 0; i < n; i++) k->block[i] = INFINITY;
  if (n > 0) k->kind->saturation (&k->b, k->block);
  return n;
}

/* The state of entry i of the block, numbered as in pw_system_find_state; -1: the ground's. */
static int saturation_state (const pw_system *s, const pw_element_batch *k, int i) {
  int cols = k->b.cols, c = i % (2 * cols), j = pw_global (k, i / (2 * cols), c % cols);
  return j >= s->coords ? -1 : c < cols ? j : s->coords + j;
}

/* Loops over the entries i of the blocks of saturating batches k. */
#define EACH_SATURATION(k, i, w) \
  PW_EACH_BATCH (k, w)           \
    for (int i = 0, n = saturation_fill (k); i < n; i++)

void pw_evaluate_saturation (pw_workspace *w, double *least) {
  for (int j = 0; j < 2 * w->s->coords; j++) least[j] = INFINITY;
  EACH_SATURATION (k, i, w) {
    int state = saturation_state (w->s, k, i);
    if (state >= 0) least[state] = fmin (least[state], k->block[i]);
  }
}

int pw_find_saturation (pw_workspace *w, double *least, char *element, size_t size) {
  int found = -1;
  *least = INFINITY;
  EACH_SATURATION (k, i, w) {
    int state = saturation_state (w->s, k, i);
    if (state < w->s->coords || !(k->block[i] < *least)) continue;
    *least = k->block[i], found = state;
    snprintf (element, size, "%s %s", k->kind->name, k->name[i / (2 * k->b.cols)]);
  }
  return found;
}

int pw_find_nonfinite (pw_workspace *w, char *buffer, size_t size) {
  PW_EACH_BATCH (k, w) {
    const int rows = k->kind->rows, cols = k->b.cols;
    const struct {
      const char *name;
      pw_batch_function *function;
      double *value;
      int each; /* numbers of an element */
    } part[] = { { "force", k->kind->force, k->block, cols },
                 { "J", rows ? k->kind->J : NULL, k->J, rows * cols },
                 { "gamma", rows ? k->kind->gamma : NULL, w->scratch + k->row, rows } };
    for (int p = 0; p < 3; p++) {
      if (part[p].function) part[p].function (&k->b, part[p].value);
      for (int i = 0; part[p].function && i < k->b.count * part[p].each; i++) {
        if (isfinite (part[p].value[i])) continue;
        snprintf (buffer, size, "%s of %s %s", part[p].name, k->kind->name, k->name[i / part[p].each]);
        return 1;
      }
    }
  }
  return 0;
}

void pw_evaluate_ledger (pw_workspace *w, const double *lambda, double *rate) {
  for (const pw_entry *entry = w->s->entry, *end = entry + w->s->powers; entry < end;) {
    const pw_entry *first = entry;
    pw_element_batch *k = &w->batch[first->batch];
    pw_batch_function *power = first->type == PW_WORK ? k->kind->power : k->kind->loss; /* NULL: by eta */
    k->b.lambda = lambda + k->row;
    if (first->whole > 0) {
      power (&k->b, rate);
      entry += first->whole, rate += first->whole;
      continue;
    }
    double *value = power ? k->block : w->scratch;
    (power ? power : k->kind->eta) (&k->b, value);
    for (; entry < end && entry->batch == first->batch && entry->type == first->type; entry++, rate++) {
      const int rows = k->kind->rows, i = entry->element * rows;
      *rate = power ? value[entry->element] : 0;
      for (int r = i; r < i + rows && !power; r++) /* the constraint force -J^T lambda has the power -lambda . J v */
        *rate -= k->b.lambda[r] * value[r];
    }
  }
}

/* Copies batches and signals of the system, with arrays of the workspace; x: for the states that signals read. */
static void workspace_fill (pw_workspace *w, double *x) {
  const pw_system *s = w->s;
  double *J = w->J;
  for (int i = 0; i < s->batches; i++) {
    pw_element_batch *k = &w->batch[i];
    *k = s->batch[i];
    k->J = J, k->block = w->block;
    J += k->b.count * k->kind->rows * k->b.cols;
    k->source = w->source + (k->source - s->source);
    k->b.u = w->u + 3 * (k->source - w->source);
    k->b.configuration = w->configuration;
    k->b.q = s->q0 + k->internal, k->b.v = s->v0 + k->internal; /* until kinematics are updated */
  }
  for (int i = 0; i < s->sources; i++) {
    w->source[i] = s->source[i];
    w->source[i].u = w->u + 3 * i;
    w->source[i].x = x;
    x += 2 * s->source[i].reads; /* values, gradient */
  }
  for (int i = 0; i < s->outputs; i++) w->output[i] = s->output[i];
  w->configuration[s->bodies].cos = 1;
}

void pw_open_function (pw_function *f, int *status) {
  if (f->open == NULL) return;
  f->context = *status == PW_OK ? f->open (f->context) : NULL;
  if (f->context) return;
  *status = PW_RESOURCE;
  f->close = NULL;
}

void pw_close_functions (const pw_source *source, int sources, const pw_compiled_output *output, int outputs) {
  for (int i = 0; i < sources + outputs; i++) {
    const pw_function *f = i < sources ? &source[i].signal.function : &output[i - sources].function;
    if (i < sources && source[i].signal.type != PW_FUNCTION) continue;
    if (f->open && f->close) f->close (f->context);
  }
}

pw_workspace *pw_workspace_new (const pw_system *s, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK) return NULL;
  pw_workspace all = { .s = s, .scale = s->scale, .t_signal = NAN }, *w = NULL;
  double *x = NULL;
  PW_ALLOC_ARRAYS (/* w is the first: it is what pw_workspace_free frees */
                   PW_ARRAY (w, 1), PW_ARRAY (all.batch, s->batches), PW_ARRAY (all.source, s->sources),
                   PW_ARRAY (all.configuration, s->bodies + 1),
                   PW_ARRAY (all.scratch, (size_t)(3 * s->rows + s->coords) + 3),
                   PW_ARRAY (all.u, 3 * (size_t)s->sources), PW_ARRAY (all.J, s->jacobian),
                   PW_ARRAY (all.block, s->block), PW_ARRAY (all.contact, pw_system_contacts (s)),
                   PW_ARRAY (all.output, s->outputs), PW_ARRAY (all.output_value, s->outputs),
                   PW_ARRAY (x, 2 * (size_t)s->reads));
  if (w) {
    *w = all;
    workspace_fill (w, x);
    int status = PW_OK;
    for (pw_source *source = w->source; source < w->source + s->sources; source++)
      if (source->signal.type == PW_FUNCTION) pw_open_function (&source->signal.function, &status);
    for (int i = 0; i < s->outputs; i++) pw_open_function (&w->output[i].function, &status);
    if (status == PW_OK) return w;
  }
  pw_workspace_free (w);
  pw_fail_memory (s, error);
  return NULL;
}

void pw_workspace_free (pw_workspace *w) {
  if (w) pw_close_functions (w->source, w->s->sources, w->output, w->s->outputs);
  free (w);
}

int pw_system_elements (const pw_system *s) {
  int count = 0;
  for (int i = 0; i < s->batches; i++) count += s->batch[i].b.count;
  return count;
}

pw_element_info pw_system_element (const pw_system *s, int element) {
  pw_element_info info = { .contact = 0 };
  const pw_element_batch *k = s->batch;
  for (; element >= k->b.count; element -= k++->b.count) {
    info.contact += k->kind->contact ? k->b.count : 0;
    info.force += 3 * k->b.count * k->kind->bodies;
  }
  info.kind = k->kind;
  info.name = k->name[element];
  info.body = k->b.body + element * k->kind->bodies;
  info.row = k->row + element * k->kind->rows;
  info.coordinate = k->internal + element * k->kind->internal;
  info.contact = k->kind->contact ? info.contact + element : -1;
  info.force += 3 * element * k->kind->bodies;
  return info;
}

static int elements_update (pw_workspace *w, double t, const double *q, const double *v, pw_error *error) {
  if (pw_require (w, "a workspace", error) != PW_OK) return PW_INPUT;
  return pw_update_kinematics (w, t, q, v) == PW_OK ? PW_OK : pw_fail_evaluation (w, t, error);
}

void pw_evaluate_contacts (const pw_workspace *w, double (*out)[3]) {
  PW_EACH_BATCH (k, w) {
    if (k->kind->contact == NULL) continue;
    k->kind->contact (&k->b, out[0]);
    out += k->b.count;
  }
}

int pw_workspace_contact_points (pw_workspace *w, double t, const double *q, const double *v, double (*out)[3],
                                 pw_error *error) {
  int status = elements_update (w, t, q, v, error);
  if (status == PW_OK) pw_evaluate_contacts (w, out);
  return status;
}

/* The value of a column; output, ledger: values of those, NULL: unknown.  Contact points are in w->contact. */
static double elements_column (const pw_workspace *w, const pw_sample *x, const double *output, const double *ledger,
                               pw_column c) {
  const int n = w->s->coords;
  switch (c.type) {
  case PW_COLUMN_STATE:
    return c.index < n ? x->q[c.index] : x->v[c.index - n];
  case PW_COLUMN_CONTACT:
    return w->contact[c.index / 2][c.index % 2];
  case PW_COLUMN_REACTION:
    return 0 - x->lambda[c.index]; /* the reaction is -lambda; not -0 */
  case PW_COLUMN_LEDGER:
    return ledger ? ledger[c.index] : NAN;
  case PW_COLUMN_OUTPUT:
    return output ? output[c.index] : NAN;
  default:
    return *(const double *)(const void *)((const char *)x + pw_column_offset (c.type));
  }
}

int pw_workspace_columns (pw_workspace *w, const pw_sample *x, const pw_column *c, int count, double *value,
                          pw_error *error) {
  int contacts = 0;
  for (int i = 0; i < count; i++) contacts |= c[i].type == PW_COLUMN_CONTACT;
  int status = contacts ? elements_update (w, x->t, x->q, x->v, error) : pw_require (w, "a workspace", error);
  if (status != PW_OK) return status;
  if (contacts) pw_evaluate_contacts (w, w->contact);
  for (int i = 0; i < count; i++) value[i] = elements_column (w, x, x->output, x->ledger, c[i]);
  return PW_OK;
}

void pw_evaluate_outputs (pw_workspace *w, const pw_sample *x, const double *ledger) {
  if (w->s->output_types >> PW_COLUMN_CONTACT & 1) pw_evaluate_contacts (w, w->contact);
  for (int i = 0; i < w->s->outputs; i++) {
    const pw_compiled_output *o = &w->output[i];
    double read[PW_OUTPUT_READS + 1], value[3] = { NAN };
    for (int k = 0; k < o->reads; k++) read[k] = elements_column (w, x, w->output_value, ledger, o->read[k]);
    const int status = o->function.eval (o->function.context, x->t, read, value, NULL);
    w->output_value[i] = status == 0 ? value[0] : NAN;
  }
}

int pw_system_force_size (const pw_system *s) {
  int size = 0;
  for (int i = 0; i < s->batches; i++) size += 3 * s->batch[i].b.count * s->batch[i].kind->bodies;
  return size;
}

int pw_workspace_forces (pw_workspace *w, double t, const double *q, const double *v, const double *lambda, double *out,
                         pw_error *error) {
  int status = elements_update (w, t, q, v, error);
  if (status != PW_OK) return status;
  memset (out, 0, (size_t)pw_system_force_size (w->s) * sizeof *out);
  pw_evaluate_J (w);
  PW_EACH_BATCH (k, w) { /* force - J^T lambda of each element, only the components of bodies */
    const int rows = k->kind->rows, cols = 3 * k->kind->bodies;
    if (k->kind->force) k->kind->force (&k->b, k->block);
    for (int e = 0; e < k->b.count; e++, out += cols) {
      for (int i = e * rows; i < (e + 1) * rows; i++)
        for (int c = 0; c < cols; c++) out[c] -= k->J[i * k->b.cols + c] * lambda[k->row + i];
      for (int c = 0; c < cols && k->kind->force; c++) out[c] += k->block[e * k->b.cols + c];
    }
  }
  return PW_OK;
}

static int elements_allocate (const pw_system *s, pw_equations *out, pw_error *error) {
  size_t n = (size_t)s->coords, rows = (size_t)s->rows;
  out->coordinates = s->coords, out->rows = s->rows, out->holonomic = s->holonomic;
  /* mass is the first: it is what pw_equations_free frees; three more entries of the forces: the ground's */
  if (PW_ALLOC_ARRAYS (PW_ARRAY (out->mass, n), PW_ARRAY (out->force, n + 3), PW_ARRAY (out->g, rows),
                       PW_ARRAY (out->eta, rows), PW_ARRAY (out->gamma, rows), PW_ARRAY (out->value, s->jacobian),
                       PW_ARRAY (out->row, s->jacobian), PW_ARRAY (out->column, s->jacobian)) == NULL)
    return pw_fail_memory (s, error);
  return PW_OK;
}

static int elements_evaluate (pw_workspace *w, double t, const double *q, const double *v, pw_equations *out,
                              pw_error *error) {
  if (elements_update (w, t, q, v, error) != PW_OK) return PW_METHOD;
  pw_evaluate_J (w);
  PW_EACH_CONSTRAINT (k, w)
    for (int i = 0; i < k->b.count * k->kind->rows; i++)
      for (int c = 0; c < k->b.cols; c++) {
        int column = pw_global (k, i / k->kind->rows, c);
        if (column >= w->s->coords) continue;
        out->row[out->entries] = k->row + i;
        out->column[out->entries] = column;
        out->value[out->entries++] = k->J[i * k->b.cols + c];
      }
  for (int j = 0; j < w->s->coords; j++) out->mass[j] = pw_is_hidden (w->s, j) ? 1 : w->s->M[j];
  pw_evaluate_force (w, out->force);
  pw_evaluate_g (w, out->g);
  pw_evaluate_eta (w, out->eta);
  pw_evaluate_gamma (w, out->gamma);
  return PW_OK;
}

int pw_system_equations (const pw_system *s, double t, const double *q, const double *v, pw_equations *out,
                         pw_error *error) {
  *out = (pw_equations){ .rows = 0 };
  pw_workspace *w = pw_workspace_new (s, error);
  int status = w ? elements_allocate (s, out, error) : s ? PW_RESOURCE : PW_INPUT;
  if (status == PW_OK) status = elements_evaluate (w, t, q, v, out, error);
  pw_workspace_free (w);
  return status;
}

void pw_equations_free (pw_equations *e) {
  free (e->mass);
  *e = (pw_equations){ .rows = 0 };
}
