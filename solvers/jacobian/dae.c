/* Residual and Newton matrix of the equations of motion as differential-algebraic equations; see dae.h. */
#include <stdlib.h>
#include "dae.h"
#include "util.h"

int pw_dae_open (pw_dae *x, pw_run *r) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords, m = (size_t)s->rows;
  const pw_stabilisation_kind kind = r->method->stabilisations[r->stabilisation].kind;
  *x = (pw_dae){ .integrates_multipliers = kind == PW_SI1, .n = s->coords };
  x->enforces_positions = kind == PW_GGL || kind == PW_SI1 || kind == PW_INDEX3 || kind == PW_RATTLE;
  x->enforces_velocities = kind == PW_GGL || kind == PW_SI1 || kind == PW_INDEX2;
  const pw_array array[] = { { &x->reaction, n + 3 }, { &x->force, n + 3 }, { &x->residual, m }, { &x->scratch, m } };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
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

/* ---- Residual ---- */

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
  const pw_run *r = x->tangent.run;
  int n = x->n;
  pw_tangent_multiply_JT (&x->tangent, lambda + x->rows, x->mu_count, x->reaction);
  for (int j = 0; j < n; j++) F[j] = x->tangent.D[j] * x->reaction[j];
  pw_tangent_multiply_JT (&x->tangent, lambda, x->rows, x->reaction);
  pw_evaluate_force (r->w, x->force);
  for (int j = 0; j < n; j++) F[n + j] = (a ? r->s->mass[j] * a[j] : 0) + x->reaction[j] - x->force[j];
  dae_constraints (x, v, a, F + 2 * n);
}

/* ---- Matrix ---- */

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
