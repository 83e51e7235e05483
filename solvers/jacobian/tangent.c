/* Derivatives of the equations of motion in a sparse matrix; see tangent.h. */
#include <stdlib.h>
#include <string.h>
#include "tangent.h"
#include "util.h"

/* Numbers the active equations. */
static void tangent_number_rows (pw_tangent *x) {
  const pw_run *r = x->run;
  for (int i = 0; i < r->s->rows; i++) {
    int active = r->active == NULL || r->active[i];
    x->row_index[i] = active ? x->rows : -1;
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
    x->row_index = pw_layout_alloc (&l, (size_t)s->rows, sizeof *x->row_index);
    x->row = pw_layout_alloc (&l, (size_t)s->rows, sizeof *x->row);
    x->lambda = pw_layout_alloc (&l, (size_t)s->rows, sizeof *x->lambda);
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
}

const double *pw_tangent_expand (const pw_tangent *x, const double *active, int count, double *all) {
  memset (all, 0, (size_t)x->run->s->rows * sizeof *all);
  for (int i = 0; i < count; i++) all[x->row[i]] = active[i];
  return all;
}

void pw_tangent_multiply_JT (const pw_tangent *x, const double *active, int count, double *out) {
  memset (out, 0, ((size_t)x->run->s->coords + 3) * sizeof *out);
  if (count > 0) pw_add_JT (x->run->w, pw_tangent_expand (x, active, count, x->lambda), out);
}

void pw_tangent_compress (const pw_tangent *x, const double *all, int count, double *active) {
  for (int i = 0; i < count; i++) active[i] = all[x->row[i]];
}

void pw_tangent_add_equations (pw_tangent *x, pw_block block, int row, int col, const double *w, double holonomic,
                               double nonholonomic) {
  const pw_placement put = { row,           col, x->run->s->rows, holonomic, nonholonomic, .row_index = x->row_index,
                             .direction = w };
  pw_newton_add_block (&x->newton, x->run->w, &x->scatter, block, &put);
}

void pw_tangent_add_J (pw_tangent *x, int count, int row, int col, double holonomic, double nonholonomic) {
  pw_newton_add_J (x->run->w, &x->scatter,
                   &(pw_placement){ row, col, count, holonomic, nonholonomic, .row_index = x->row_index });
}

/* (J^T lambda)_q - f_q; -f_v; M; J^T: the derivatives with respect to q, v, a, lambda */
void pw_tangent_add_momentum (pw_tangent *x, const pw_tangent_layout *to, const double *lambda) {
  const pw_system *s = x->run->s;
  pw_placement put = {
    .row = to->momentum, .col = to->q, .rows = s->rows, .factor = 1, .row_index = x->row_index, .lambda = lambda
  };
  pw_newton_add_block (&x->newton, x->run->w, &x->scatter, PW_JTL_Q, &put);
  put.factor = -1;
  pw_newton_add_block (&x->newton, x->run->w, &x->scatter, PW_FORCE_Q, &put);
  put.col = to->v;
  pw_newton_add_block (&x->newton, x->run->w, &x->scatter, PW_FORCE_V, &put);
  pw_newton_add_signals (&x->newton, x->run->w, &x->scatter, to->momentum, to->q, to->v);
  for (int j = 0; j < s->coords; j++)
    pw_scatter_add (&x->scatter, to->momentum + j, to->a + j, to->a_factor * s->mass[j]);
  put.factor = put.factor_nonholonomic = to->lambda_factor;
  put.col = to->lambda;
  pw_newton_add_JT (x->run->w, &x->scatter, &put);
}

/* (J a)_q - gamma_q + 2 alpha ((J v)_q - eta_q) + beta^2 G; 2 alpha J - gamma_v; J */
void pw_tangent_add_accelerations (pw_tangent *x, const pw_tangent_layout *to, const double *v, const double *a) {
  const pw_run *r = x->run;
  const int rows = r->s->rows, row = to->constraint;
  const double alpha = r->alpha, a_in_v = to->a == to->v ? to->a_factor : 0; /* what a adds to the columns of v */
  pw_tangent_add_equations (x, PW_JW_Q, row, to->q, a, 1, 1);
  pw_tangent_add_equations (x, PW_JW_Q, row, to->q, v, 2 * alpha, alpha);
  pw_tangent_add_equations (x, PW_ETA_Q, row, to->q, NULL, -2 * alpha, -alpha);
  pw_tangent_add_equations (x, PW_GAMMA_Q, row, to->q, NULL, -1, -1);
  pw_tangent_add_equations (x, PW_GAMMA_V, row, to->v, NULL, -1, -1);
  pw_tangent_add_J (x, rows, row, to->v, a_in_v + 2 * alpha, a_in_v + alpha);
  pw_tangent_add_J (x, r->s->holonomic, row, to->q, r->beta * r->beta, 0);
  if (to->a != to->v) pw_tangent_add_J (x, rows, row, to->a, to->a_factor, to->a_factor);
}
