/* Derivatives of the equations of motion in a sparse matrix; see tangent.h. */
#include <stdlib.h>
#include "tangent.h"

int pw_tangent_open (pw_tangent *x, pw_run *r) {
  const pw_system *s = r->s;
  size_t block = 1, direction = 1; /* the largest block of a batch, and the largest count x cols */
  *x = (pw_tangent){ .run = r };
  r->uses_derivatives = 1;
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++) {
    const size_t columns = (size_t)k->b.count * (size_t)k->b.cols,
                 widths[] = { (size_t)k->b.cols, (size_t)k->kind->rows, (size_t)k->kind->signals }; /* last: force_u */
    if (columns > direction) direction = columns;
    for (int i = 0; i < 3; i++)
      if (columns * widths[i] > block) block = columns * widths[i];
  }
  x->memory =
      PW_ALLOC_ARRAYS (PW_ARRAY (x->row_index, s->rows), PW_ARRAY (x->row, s->rows), PW_ARRAY (x->lambda, s->rows),
                       PW_ARRAY (x->D, s->coords), PW_ARRAY (x->block, block), PW_ARRAY (x->direction, direction),
                       PW_ARRAY (x->gradient, s->feedback ? 4 * (size_t)s->reads : 0));
  if (x->memory == NULL) return PW_RESOURCE;
  for (int i = 0; i < s->sources; i++) r->w->source[i].gradient = r->w->source[i].reads > 0;
  if (s->reads > 0) (void)pw_update_kinematics (r->w, r->t, r->q, r->v); /* with gradients from now on */
  for (int j = 0; j < s->coords; j++) x->D[j] = pw_is_angle (s, j) ? 1 / (s->scale.length * s->scale.length) : 1;
  for (int i = 0; i < s->rows; i++) {
    int active = r->active == NULL || r->active[i];
    x->row_index[i] = active ? x->rows : -1;
    if (!active) continue;
    x->holonomic += i < s->holonomic;
    x->row[x->rows++] = i;
  }
  return PW_OK;
}

void pw_tangent_close (pw_tangent *x) {
  pw_scatter_close (&x->scatter);
  free (x->memory);
}

const double *pw_tangent_expand (const pw_tangent *x, const double *active, int count, double *all) {
  memset (all, 0, (size_t)x->run->s->rows * sizeof *all);
  for (int i = 0; i < count; i++) all[x->row[i]] = active[i];
  return all;
}

void pw_tangent_compress (const pw_tangent *x, const double *all, int count, double *active) {
  for (int i = 0; i < count; i++) active[i] = all[x->row[i]];
}

/* What a batch adds: its rows of J, or their transpose; blocks whose rows are its constraint equations, or its
 * coordinates. */
typedef enum { TANGENT_J, TANGENT_JT, TANGENT_EQUATIONS, TANGENT_COORDINATES } tangent_part;

/* 1 for an entry of a pin that is always zero: in columns of x and y its rows of J are constant, multiples of unit
 * vectors, so that their derivatives are in columns of angles only, and those of J^T lambda in rows of angles only. */
static inline int tangent_is_zero (tangent_part part, int r, int c) {
  if (part == TANGENT_J || part == TANGENT_JT) return c % 3 != 2 && c % 3 == 1 - r;
  return c % 3 != 2 || (part == TANGENT_COORDINATES && r % 3 != 2);
}

/* Adds the values of a batch, rows x columns of each element. */
static void tangent_put (pw_tangent *x, const pw_element_batch *k, tangent_part part, const double *value,
                         const pw_placement *put) {
  const pw_system *s = x->run->s;
  pw_scatter_map *t = &x->scatter;
  const int of_coordinates = part == TANGENT_COORDINATES, rows = of_coordinates ? k->b.cols : k->kind->rows,
            transposed = part == TANGENT_JT, is_pin = k->kind == &pw_kind_pin;
  const double factor = !of_coordinates && k->row >= s->holonomic ? put->factor_nonholonomic : put->factor;
  for (int e = 0; e < k->b.count; e++)
    for (int r = 0; r < rows; r++) {
      int i = of_coordinates ? pw_global (k, e, r) : k->row + e * rows + r;
      if (!of_coordinates && put->row_index) i = put->row_index[i];
      for (int c = 0; c < k->b.cols; c++, value++) {
        int j = pw_global (k, e, c), row = transposed ? j : i;
        if (j >= s->coords || i < 0 || (of_coordinates && i >= s->coords)) continue;
        if (is_pin && tangent_is_zero (part, r, c)) continue;
        double scale = put->row_scale ? put->row_scale[row] : 1;
        pw_scatter_add (t, put->row + row, put->col + (transposed ? i : j), t->recording ? 0 : factor * *value * scale);
      }
    }
}

void pw_tangent_add_block (pw_tangent *x, pw_block block, const pw_placement *put) {
  pw_workspace *w = x->run->w;
  for (pw_element_batch *k = w->batch; k < w->batch + w->s->batches; k++) {
    int of_equations = block == PW_JW_Q || block == PW_ETA_Q || block == PW_GAMMA_Q || block == PW_GAMMA_V;
    if ((of_equations || block == PW_JTL_Q) && (k->kind->rows == 0 || k->row >= put->rows)) continue;
    if (pw_block_function (k->kind, block) == NULL) continue;
    double *to = x->direction;
    for (int e = 0; put->direction && e < k->b.count; e++)
      for (int c = 0; c < k->b.cols; c++) {
        const int j = pw_global (k, e, c);
        *to++ = j < w->s->coords ? put->direction[j] : 0; /* 0 for the ground */
      }
    k->b.w = x->direction;
    k->b.lambda = put->lambda ? put->lambda + k->row : NULL;
    if (!x->scatter.recording) pw_evaluate_block (w, k, block, x->block);
    tangent_put (x, k, of_equations ? TANGENT_EQUATIONS : TANGENT_COORDINATES, x->block, put);
  }
}

static void tangent_put_J (pw_tangent *x, tangent_part part, const pw_placement *put) {
  const pw_workspace *w = x->run->w;
  for (const pw_element_batch *k = w->batch; k < w->batch + w->s->constraints && k->row < put->rows; k++)
    tangent_put (x, k, part, k->J, put);
}

void pw_tangent_add_JT (pw_tangent *x, const pw_placement *put) {
  tangent_put_J (x, TANGENT_JT, put);
}

void pw_tangent_add_signals (pw_tangent *x, int row, int col_q, int col_v) {
  pw_workspace *w = x->run->w;
  pw_scatter_map *t = &x->scatter;
  const pw_system *s = w->s;
  for (pw_element_batch *k = w->batch; s->state_dependent > 0 && k < w->batch + s->batches; k++) {
    int signals = k->kind->signals, cols = k->b.cols;
    if (signals == 0 || k->kind->force_u == NULL) continue;
    if (!t->recording) k->kind->force_u (&k->b, x->block);
    for (int e = 0; e < k->b.count; e++)
      for (int u = 0; u < signals; u++) {
        const pw_source *source = &k->source[e * signals + u];
        for (int read = 0; read < source->reads; read++) { /* source->x: values of the states read, derivatives */
          int j = source->state[read], col = j < s->coords ? col_q + j : col_v + j - s->coords;
          double slope = source->x[source->reads + read];
          for (int c = 0; c < cols; c++) {
            int i = pw_global (k, e, c);
            if (i >= s->coords) continue;
            pw_scatter_add (t, row + i, col, t->recording ? 0 : -x->block[(e * cols + c) * signals + u] * slope);
          }
        }
      }
  }
}

/* Adds value times row i of J of a batch, transposed, to a column. */
static void given_add (pw_tangent *x, const pw_element_batch *k, int i, int row, int col, double value) {
  for (int c = 0; c < k->b.cols; c++) {
    const int j = pw_global (k, i / k->kind->rows, c);
    if (j < x->run->s->coords)
      pw_scatter_add (&x->scatter, row + j, col, x->scatter.recording ? 0 : k->J[i * k->b.cols + c] * value);
  }
}

/* Evaluates (J v)_q of a batch into the block, and stores v in the direction. */
static void given_velocities (pw_tangent *x, pw_element_batch *k) {
  double *to = x->direction;
  for (int e = 0; e < k->b.count; e++) {
    for (int n = 0; n < k->kind->bodies; n++) {
      const pw_configuration *p = k->b.configuration + k->b.body[e * k->kind->bodies + n];
      *to++ = p->vx, *to++ = p->vy, *to++ = p->omega;
    }
    for (int n = 0; n < k->kind->internal; n++) *to++ = k->b.v[e * k->kind->internal + n];
  }
  k->b.w = x->direction;
  if (!x->scatter.recording) pw_evaluate_block (x->run->w, k, PW_JW_Q, x->block);
}

/* Row i of those of a batch, if its multiplier is given: its derivatives by the signals and velocities it follows. */
static void given_add_row (pw_tangent *x, pw_element_batch *k, int i, int row, int col_q, int col_v) {
  const pw_run *r = x->run;
  const int n = r->s->coords;
  const pw_given by = r->given[k->row + i];
  for (int m = 0; m < 2 && by.is_given; m++) {
    const pw_source *source = by.source[m] < 0 ? NULL : r->w->source + by.source[m];
    for (int read = 0; source && read < source->reads; read++) {
      const int j = source->state[read];
      given_add (x, k, i, row, j < n ? col_q + j : col_v + j - n, by.by_source[m] * source->x[source->reads + read]);
    }
    for (int c = 0; by.first >= 0 && c < k->b.cols; c++) {
      const int j = pw_global (k, i / k->kind->rows, c), at = (by.first - k->row + m) * k->b.cols + c;
      if (j >= n) continue;
      given_add (x, k, i, row, col_v + j, by.by_u[m] * k->J[at]);
      given_add (x, k, i, row, col_q + j, by.by_u[m] * x->block[at]);
    }
  }
}

static void feedback_add_gradient (pw_tangent *x, const pw_source *source, double coefficient, int row,
                                   const pw_feedback *put) {
  const int n = x->run->s->coords;
  for (int r = 0; r < source->reads; r++) {
    const int j = source->state[r];
    const double slope = x->scatter.recording ? 0 : coefficient * source->x[source->reads + r];
    pw_scatter_add (&x->scatter, row, j < n ? put->q + j : put->v + j - n, slope * (j < n ? put->q_part : 1));
  }
}

static void feedback_add_rate (pw_tangent *x, const pw_source *source, double coefficient, int row,
                               const pw_feedback *put) {
  const int n = x->run->s->coords, recording = x->scatter.recording;
  for (int r = 0; r < source->reads; r++) {
    const int j = source->state[r];
    const double slope = recording ? 0 : coefficient * source->x[source->reads + r];
    pw_scatter_add (&x->scatter, row, j < n ? put->q + j : put->v + j - n,
                    recording ? 0 : coefficient * x->gradient[r]);
    if (j < n)
      pw_scatter_add (&x->scatter, row, put->v + j, slope);
    else
      feedback_add_gradient (x, pw_rate_source (x->run->w, j - n), slope, row, put);
  }
}

static void feedback_add (pw_tangent *x, const pw_element_batch *k, int e, int u, const pw_feedback *put) {
  const pw_source *source = &k->source[e * k->kind->signals + u];
  const int n = x->run->s->coords;
  pw_by_signal by;
  pw_evaluate_by_signal (k, e, u, &by);
  if (put->a && !x->scatter.recording) pw_feedback_rate_gradient (x->run->w, source, put->w, x->gradient);
  for (int c = 0; put->lambda && c < k->b.cols; c++) {
    double sum = 0;
    for (int r = 0; r < k->kind->rows; r++)
      sum += by.J[r * k->b.cols + c] * put->lambda[k->row + e * k->kind->rows + r];
    const int j = pw_global (k, e, c);
    if (j < n) feedback_add_gradient (x, source, put->factor * sum, put->row + j, put);
  }
  for (int r = 0; !put->lambda && r < k->kind->rows; r++) {
    double Jw = -by.eta[r], Ja = -by.gamma[r];
    int i = k->row + e * k->kind->rows + r;
    if (put->row_index) i = put->row_index[i];
    for (int c = 0; c < k->b.cols; c++) {
      const int j = pw_global (k, e, c);
      if (j >= n) continue;
      Jw += by.J[r * k->b.cols + c] * put->w[j];
      if (put->a) Ja += by.J[r * k->b.cols + c] * put->a[j];
    }
    if (i < 0) continue;
    feedback_add_gradient (x, source, put->factor * (put->a ? Ja : Jw), put->row + i, put);
    if (put->a) feedback_add_rate (x, source, put->factor * Jw, put->row + i, put);
  }
}

void pw_tangent_add_feedback (pw_tangent *x, const pw_feedback *put) {
  const pw_workspace *w = x->run->w;
  for (const pw_element_batch *k = w->batch; w->s->feedback > 0 && k < w->batch + w->s->constraints; k++)
    for (int i = 0; i < k->b.count * k->kind->signals; i++)
      if (k->source[i].feedback) feedback_add (x, k, i / k->kind->signals, i % k->kind->signals, put);
}

void pw_tangent_add_equations (pw_tangent *x, pw_block block, int row, int col, const double *w, double holonomic,
                               double nonholonomic) {
  const pw_placement put = { row,           col, x->run->s->rows, holonomic, nonholonomic, .row_index = x->row_index,
                             .direction = w };
  pw_tangent_add_block (x, block, &put);
}

void pw_tangent_add_J (pw_tangent *x, int rows, int row, int col, double holonomic, double nonholonomic) {
  tangent_put_J (x, TANGENT_J, &(pw_placement){ row, col, rows, holonomic, nonholonomic, .row_index = x->row_index });
}

/* (J^T lambda)_q - f_q; -f_v; M; J^T: the derivatives with respect to q, v, a, lambda */
void pw_tangent_add_momentum (pw_tangent *x, const pw_tangent_layout *to, const double *lambda) {
  const pw_system *s = x->run->s;
  pw_workspace *w = x->run->w;
  if (x->run->forces == PW_FORCES_AT_LIMITS) {
    if (lambda != x->lambda) memcpy (x->lambda, lambda, (size_t)s->rows * sizeof *lambda);
    pw_fill_given (x->run, x->lambda);
    lambda = x->lambda;
  }
  pw_placement put = {
    .row = to->momentum, .col = to->q, .rows = s->rows, .factor = 1, .row_index = x->row_index, .lambda = lambda
  };
  pw_tangent_add_block (x, PW_JTL_Q, &put);
  put.factor = -1;
  pw_tangent_add_block (x, PW_FORCE_Q, &put);
  put.col = to->v;
  pw_tangent_add_block (x, PW_FORCE_V, &put);
  pw_tangent_add_signals (x, to->momentum, to->q, to->v);
  for (pw_element_batch *k = w->batch; x->run->update_given && k < w->batch + s->constraints; k++) {
    if (!k->kind->limits) continue;
    given_velocities (x, k); /* J^T d lambda/d(q, v) of the equations whose given multipliers depend on states */
    for (int i = 0; i < k->b.count * k->kind->rows; i++) given_add_row (x, k, i, to->momentum, to->q, to->v);
  }
  for (int j = 0; j < s->coords; j++)
    pw_scatter_add (&x->scatter, to->momentum + j, to->a + j, to->a_factor * s->mass[j]);
  pw_tangent_add_feedback (x, &(pw_feedback){ to->momentum, to->q, to->v, 1, 1, .lambda = lambda });
  put.factor = put.factor_nonholonomic = to->lambda_factor;
  put.col = to->lambda;
  pw_tangent_add_JT (x, &put);
  for (const pw_coupling *c = x->run->coupling; c < x->run->coupling + x->run->couplings; c++) {
    int e; /* the multiplier of row c->row is a multiple of that of row c->on */
    const double *J;
    const pw_element_batch *k = pw_find_row (w, c->row, &e, &J);
    for (int i = 0; i < k->b.cols; i++)
      if (pw_global (k, e, i) < s->coords)
        pw_scatter_add (&x->scatter, put.row + pw_global (k, e, i), put.col + x->row_index[c->on],
                        x->scatter.recording ? 0 : put.factor * c->ratio * J[i]);
  }
}

/* (J a)_q - gamma_q + 2 alpha ((J v)_q - eta_q) + beta^2 J (holonomic); 2 alpha J - gamma_v; J */
void pw_tangent_add_accelerations (pw_tangent *x, const pw_tangent_layout *to, const double *v, const double *a) {
  const pw_run *r = x->run;
  const int rows = r->s->rows, row = to->constraint;
  const double alpha = r->alpha, a_in_v = to->a == to->v ? to->a_factor : 0; /* what a adds to the columns of v */
  pw_tangent_add_equations (x, PW_JW_Q, row, to->q, a, 1, 1);
  pw_tangent_add_equations (x, PW_JW_Q, row, to->q, v, 2 * alpha, alpha);
  pw_tangent_add_equations (x, PW_ETA_Q, row, to->q, NULL, -2 * alpha, -alpha);
  pw_tangent_add_equations (x, PW_GAMMA_Q, row, to->q, NULL, -1, -1);
  pw_tangent_add_equations (x, PW_GAMMA_V, row, to->v, NULL, -1, -1);
  pw_tangent_add_feedback (x, &(pw_feedback){ row, to->q, to->v, 1, 1, x->row_index, .w = v, .a = a });
  pw_tangent_add_feedback (x, &(pw_feedback){ row, to->q, to->v, alpha, 1, x->row_index, .w = v });
  pw_tangent_add_J (x, rows, row, to->v, a_in_v + 2 * alpha, a_in_v + alpha);
  pw_tangent_add_J (x, r->s->holonomic, row, to->q, r->beta * r->beta, 0);
  if (to->a != to->v) pw_tangent_add_J (x, rows, row, to->a, to->a_factor, to->a_factor);
}

int pw_dae_open (pw_dae *x, pw_run *r) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords, m = (size_t)s->rows;
  const pw_stabilisation_kind kind = r->method->stabilisations[r->stabilisation].kind;
  *x = (pw_dae){ .integrates_multipliers = kind == PW_SI1, .n = s->coords };
  x->enforces_positions = kind == PW_GGL || kind == PW_SI1 || kind == PW_INDEX3 || kind == PW_RATTLE;
  x->enforces_velocities = kind == PW_GGL || kind == PW_SI1 || kind == PW_INDEX2;
  x->memory = PW_ALLOC_ARRAYS (PW_ARRAY (x->reaction, n + 3), PW_ARRAY (x->force, n + 3), PW_ARRAY (x->residual, m),
                               PW_ARRAY (x->scratch, m));
  if (x->memory == NULL || pw_tangent_open (&x->tangent, r) != PW_OK) return PW_RESOURCE;
  x->rows = x->tangent.rows;
  x->mu_count = x->enforces_positions && x->enforces_velocities ? x->tangent.holonomic : 0;
  x->size = 2 * x->n + x->rows + x->mu_count;
  return PW_OK;
}

void pw_dae_close (pw_dae *x) {
  pw_tangent_close (&x->tangent);
  free (x->memory);
}

/* out (coords + 3) = J^T times the multipliers of the first `count` active equations, with the J last evaluated.
 * Overwrites x->lambda. */
static void dae_multiply_JT (const pw_tangent *x, const double *active, int count, double *out) {
  memset (out, 0, ((size_t)x->run->s->coords + 3) * sizeof *out);
  if (count > 0) pw_add_JT (x->run->w, pw_tangent_expand (x, active, count, x->lambda), out);
}

/* The residuals of the constraint equations that lambda enforces, then of g = 0 if mu enforces it. */
static void dae_constraints (pw_dae *x, const double *v, const double *a, double *F) {
  pw_run *r = x->tangent.run;
  pw_workspace *w = r->w;
  const int accelerations = !x->enforces_velocities && !x->enforces_positions;
  pw_mul_J (w, accelerations ? a : v, x->residual);
  if (accelerations)
    pw_run_gamma (r, v, x->scratch);
  else
    pw_evaluate_eta (w, x->scratch);
  for (int i = 0; i < r->s->rows; i++) x->residual[i] -= x->scratch[i];
  if (x->enforces_positions) pw_evaluate_g (w, x->enforces_velocities ? x->scratch : x->residual);
  pw_tangent_compress (&x->tangent, x->residual, x->rows, F);
  pw_tangent_compress (&x->tangent, x->scratch, x->mu_count, F + x->rows);
}

void pw_dae_residual (pw_dae *x, const double *v, const double *a, const double *lambda, double *F) {
  pw_run *r = x->tangent.run;
  int n = x->n;
  dae_multiply_JT (&x->tangent, lambda + x->rows, x->mu_count, x->reaction);
  for (int j = 0; j < n; j++) F[j] = x->tangent.D[j] * x->reaction[j];
  dae_multiply_JT (&x->tangent, lambda, x->rows, x->reaction);
  pw_evaluate_force (r->w, x->force);
  if (r->couplings > 0) pw_couple (r, x->tangent.lambda);
  if (r->forces == PW_FORCES_AT_LIMITS) pw_add_given_forces (r, x->force);
  for (int j = 0; j < n; j++) F[n + j] = (a ? r->s->mass[j] * a[j] : 0) + x->reaction[j] - x->force[j];
  dae_constraints (x, v, a, F + 2 * n);
}

/* The derivatives of the kinematics with respect to q: q_dot_factor I + D (G^T mu)_q; v: -I; mu: mu_factor D G^T. */
static void dae_add_kinematics (pw_dae *x, const double *mu, double q_dot_factor, double mu_factor) {
  pw_tangent *t = &x->tangent;
  for (int j = 0; j < x->n; j++) {
    pw_scatter_add (&t->scatter, j, j, q_dot_factor);
    pw_scatter_add (&t->scatter, j, x->n + j, -1);
  }
  if (x->mu_count == 0) return;
  mu = pw_tangent_expand (t, mu, x->mu_count, t->lambda);
  pw_placement put = {
    .rows = t->run->s->holonomic, .factor = 1, .row_scale = t->D, .row_index = t->row_index, .lambda = mu
  };
  pw_tangent_add_block (t, PW_JTL_Q, &put);
  put.col = 2 * x->n + x->rows;
  put.factor = mu_factor;
  pw_tangent_add_JT (t, &put);
}

/* The derivatives of J v - eta, where it is enforced, with respect to q: (J v)_q - eta_q; v: J; and of g, q: G. */
static void dae_add_constraints (pw_dae *x, const double *v) {
  pw_tangent *t = &x->tangent;
  const pw_system *s = t->run->s;
  const int n = x->n, g_row = x->enforces_velocities ? 2 * n + x->rows : 2 * n;
  const double holonomic_factor = x->enforces_velocities ? 1 : 0; /* 0: g replaces J v - eta of holonomic equations */
  pw_tangent_add_equations (t, PW_JW_Q, 2 * n, 0, v, holonomic_factor, 1);
  pw_tangent_add_equations (t, PW_ETA_Q, 2 * n, 0, NULL, -holonomic_factor, -1);
  pw_tangent_add_J (t, s->rows, 2 * n, n, holonomic_factor, 1);
  pw_tangent_add_feedback (t, &(pw_feedback){ 2 * n, 0, n, 1, 1, t->row_index, .w = v });
  if (x->enforces_positions) pw_tangent_add_J (t, s->holonomic, g_row, 0, 1, 0);
}

void pw_dae_matrix (pw_dae *x, const double *v, const double *a, const double *lambda, double q_dot_factor,
                    double v_dot_factor) {
  const int n = x->n;
  pw_tangent *t = &x->tangent;
  const double multiplier_factor = x->integrates_multipliers ? v_dot_factor : 1;
  const pw_tangent_layout to = { .momentum = n,
                                 .constraint = 2 * n,
                                 .v = n,
                                 .a = n,
                                 .lambda = 2 * n,
                                 .a_factor = v_dot_factor,
                                 .lambda_factor = multiplier_factor };
  dae_add_kinematics (x, lambda + x->rows, q_dot_factor, multiplier_factor);
  pw_tangent_add_momentum (t, &to, pw_tangent_expand (t, lambda, x->rows, t->lambda));
  if (x->enforces_velocities || x->enforces_positions)
    dae_add_constraints (x, v);
  else
    pw_tangent_add_accelerations (t, &to, v, a);
}

int pw_dae_lay_out (pw_dae *x, const double *v, const double *a, const double *lambda) {
  pw_tangent *t = &x->tangent;
  pw_scatter_begin_record (&t->scatter);
  pw_dae_matrix (x, v, a, lambda, 1, 1);
  return pw_scatter_lay_out (&t->scatter, x->size);
}

void pw_scatter_record_entry (pw_scatter_map *t, int row, int col) {
  t->failed |= pw_grow (&t->entry, t->count, &t->room, sizeof *t->entry) != PW_OK;
  if (t->failed) return;
  t->entry[t->count] = (struct pw_scatter_entry){ row, col, t->count };
  t->count++;
}

/* Copies the entries from one array to another, sorted by columns or by rows; those of one column or row keep their
 * order.  first: n + 1 zeros, overwritten. */
static void scatter_sort (const pw_scatter_map *t, const struct pw_scatter_entry *from, struct pw_scatter_entry *to,
                          int by_columns, size_t *first, int n) {
  for (size_t i = 0; i < t->count; i++) first[(by_columns ? from[i].col : from[i].row) + 1]++;
  for (int c = 0; c < n; c++) first[c + 1] += first[c];
  for (size_t i = 0; i < t->count; i++) to[first[by_columns ? from[i].col : from[i].row]++] = from[i];
}

int pw_scatter_lay_out (pw_scatter_map *t, int n) {
  struct pw_scatter_entry *by_rows = malloc ((t->count + 1) * sizeof *by_rows);
  size_t *first = calloc (2 * ((size_t)n + 1), sizeof *first);
  t->place = malloc ((t->count + 1) * sizeof *t->place);
  t->colptr = malloc (((size_t)n + 1) * sizeof *t->colptr);
  t->rowind = malloc ((t->count + 1) * sizeof *t->rowind);
  const int failed = t->failed || !by_rows || !first || !t->place || !t->colptr || !t->rowind;
  if (!failed && t->count > 0) {
    scatter_sort (t, t->entry, by_rows, 0, first, n);
    scatter_sort (t, by_rows, t->entry, 1, first + n + 1, n);
  }
  free (by_rows);
  free (first);
  if (failed) return PW_RESOURCE;
  size_t entry = 0;
  for (int c = 0; c < n; c++) {
    t->colptr[c] = (int64_t)t->nonzeros;
    for (int last_row = -1; entry < t->count && t->entry[entry].col == c; entry++) {
      const struct pw_scatter_entry *e = &t->entry[entry];
      if (e->row != last_row) t->rowind[t->nonzeros++] = last_row = e->row;
      t->place[e->number] = t->nonzeros - 1;
    }
  }
  t->colptr[n] = (int64_t)t->nonzeros;
  free (t->entry);
  t->entry = NULL;
  t->recording = 0;
  t->value = malloc ((t->nonzeros + 1) * sizeof *t->value);
  return t->value ? PW_OK : PW_RESOURCE;
}

void pw_scatter_close (pw_scatter_map *t) {
  free (t->entry);
  free (t->place);
  free (t->colptr);
  free (t->rowind);
  free (t->value);
  *t = (pw_scatter_map){ 0 };
}
