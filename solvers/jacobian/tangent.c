/* Derivatives of the equations of motion; see tangent.h. */
#include <stdlib.h>
#include <string.h>
#include "tangent.h"
#include "util.h"

static void tangent_number_rows (pw_tangent *x) {
  const pw_run *r = x->run;
  for (int i = 0; i < r->s->rows; i++) {
    int active = r->active == NULL || r->active[i];
    x->map[i] = active ? x->rows : -1;
    if (!active) continue;
    x->holonomic += i < r->s->holonomic;
    x->row[x->rows++] = i;
  }
}

int pw_tangent_open (pw_tangent *x, pw_run *r) {
  *x = (pw_tangent){ .run = r };
  r->uses_derivatives = 1;
  const pw_system *s = r->s;
  for (pw_layout l = { 0 }; pw_layout_pass (&l, &x->memory);) {
    x->map = pw_layout_alloc (&l, (size_t)s->rows, sizeof *x->map);
    x->row = pw_layout_alloc (&l, (size_t)s->rows, sizeof *x->row);
    x->lambda = pw_layout_alloc (&l, (size_t)s->rows, sizeof *x->lambda);
    x->mu = pw_layout_alloc (&l, (size_t)s->rows, sizeof *x->mu);
    x->D = pw_layout_alloc (&l, (size_t)s->coords, sizeof *x->D);
  }
  if (x->memory == NULL) return PW_RESOURCE;
  for (int j = 0; j < s->coords; j++) x->D[j] = pw_is_angle (s, j) ? 1 / (s->scale.length * s->scale.length) : 1;
  tangent_number_rows (x);
  return pw_newton_open (&x->newton, r->s);
}

void pw_tangent_close (pw_tangent *x) {
  pw_scatter_close (&x->scatter);
  pw_newton_close (&x->newton);
  free (x->memory);
  free (x->colptr);
  free (x->rowind);
}

/* Values of all equations from those of the first `count` active ones; `all` is scratch for the result. */
static const double *tangent_expand (const pw_tangent *x, const double *used, int count, double *all) {
  if (count == x->run->s->rows) return used;
  for (int i = 0; i < count; i++) all[x->row[i]] = used[i];
  return all;
}

const double *pw_tangent_lambda (const pw_tangent *x, const double *used) {
  return tangent_expand (x, used, x->rows, x->lambda);
}

const double *pw_tangent_mu (const pw_tangent *x, const double *used, int count) {
  return count > 0 ? tangent_expand (x, used, count, x->mu) : NULL;
}

void pw_tangent_store (const pw_tangent *x, const double *used, double *all) {
  memset (all, 0, (size_t)x->run->s->rows * sizeof *all);
  for (int i = 0; i < x->rows; i++) all[x->row[i]] = used[i];
}

void pw_tangent_pull (const pw_tangent *x, const double *used, int count, double *out) {
  memset (out, 0, (size_t)x->run->s->coords * sizeof *out);
  if (count > 0) pw_add_JT (x->run->w, tangent_expand (x, used, count, count == x->rows ? x->lambda : x->mu), out);
}

void pw_tangent_compress (const pw_tangent *x, const double *all, int count, double *used) {
  for (int i = 0; i < count; i++) used[i] = all[x->row[i]];
}

/* Adds a block of the constraint equations, with factors of holonomic and nonholonomic ones; w: direction of jw_q. */
static void tangent_equations (pw_tangent *x, pw_block block, int row, int col, const double *w, double holonomic,
                               double nonholonomic) {
  const pw_placement put = { row, col, x->run->s->rows, holonomic, nonholonomic, .map = x->map, .w = w };
  pw_newton_block (&x->newton, x->run->w, &x->scatter, block, &put);
}

/* Adds J of the first `rows` equations, with these factors. */
static void tangent_J (pw_tangent *x, int rows, int row, int col, double holonomic, double nonholonomic) {
  pw_newton_J (x->run->w, &x->scatter, 0, &(pw_placement){ row, col, rows, holonomic, nonholonomic, .map = x->map });
}

/* of_q I + D (G^T mu)_q, -I, D G^T */
void pw_tangent_kinematics (pw_tangent *x, const pw_tangent_layout *to, const double *mu) {
  const pw_system *s = x->run->s;
  for (int j = 0; j < s->coords; j++) {
    pw_scatter_add (&x->scatter, j, to->q + j, to->of_q);
    pw_scatter_add (&x->scatter, j, to->v + j, -1);
  }
  if (mu == NULL) return;
  pw_placement put = {
    .col = to->q, .rows = s->holonomic, .factor = 1, .row_scale = x->D, .map = x->map, .lambda = mu
  };
  pw_newton_block (&x->newton, x->run->w, &x->scatter, PW_JTL_Q, &put);
  put.col = to->mu;
  put.factor = to->of_lambda;
  pw_newton_J (x->run->w, &x->scatter, 1, &put);
}

/* (J v)_q - eta_q, J */
void pw_tangent_velocities (pw_tangent *x, const pw_tangent_layout *to, const double *v, double of_holonomic) {
  tangent_equations (x, PW_JW_Q, to->constraint, to->q, v, of_holonomic, 1);
  tangent_equations (x, PW_ETA_Q, to->constraint, to->q, NULL, -of_holonomic, -1);
  tangent_J (x, x->run->s->rows, to->constraint, to->v, of_holonomic, 1);
}

/* G */
void pw_tangent_positions (pw_tangent *x, const pw_tangent_layout *to, int row) {
  tangent_J (x, x->run->s->holonomic, row, to->q, 1, 0);
}

/* (J^T lambda)_q - f_q, -f_v, M, J^T */
void pw_tangent_momentum (pw_tangent *x, const pw_tangent_layout *to, const double *lambda) {
  const pw_system *s = x->run->s;
  pw_placement put = {
    .row = to->momentum, .col = to->q, .rows = s->rows, .factor = 1, .map = x->map, .lambda = lambda
  };
  pw_newton_block (&x->newton, x->run->w, &x->scatter, PW_JTL_Q, &put);
  put.factor = -1;
  pw_newton_block (&x->newton, x->run->w, &x->scatter, PW_FORCE_Q, &put);
  put.col = to->v;
  pw_newton_block (&x->newton, x->run->w, &x->scatter, PW_FORCE_V, &put);
  pw_newton_signals (&x->newton, x->run->w, &x->scatter, to->momentum, to->q, to->v);
  for (int j = 0; j < s->coords; j++) pw_scatter_add (&x->scatter, to->momentum + j, to->a + j, to->of_a * s->mass[j]);
  put.factor = put.factor_nonholonomic = to->of_lambda;
  put.col = to->lambda;
  pw_newton_J (x->run->w, &x->scatter, 1, &put);
}

/* (J a)_q - gamma_q + 2 alpha ((J v)_q - eta_q) + beta^2 G, 2 alpha J - gamma_v, J */
void pw_tangent_accelerations (pw_tangent *x, const pw_tangent_layout *to, const double *v, const double *a) {
  const pw_run *r = x->run;
  const int rows = r->s->rows, row = to->constraint;
  const double alpha = r->alpha, with_v = to->a == to->v ? to->of_a : 0;
  tangent_equations (x, PW_JW_Q, row, to->q, a, 1, 1);
  tangent_equations (x, PW_JW_Q, row, to->q, v, 2 * alpha, alpha);
  tangent_equations (x, PW_ETA_Q, row, to->q, NULL, -2 * alpha, -alpha);
  tangent_equations (x, PW_GAMMA_Q, row, to->q, NULL, -1, -1);
  tangent_equations (x, PW_GAMMA_V, row, to->v, NULL, -1, -1);
  tangent_J (x, rows, row, to->v, with_v + 2 * alpha, with_v + alpha);
  tangent_J (x, r->s->holonomic, row, to->q, r->beta * r->beta, 0);
  if (to->a != to->v) tangent_J (x, rows, row, to->a, to->of_a, to->of_a);
}
