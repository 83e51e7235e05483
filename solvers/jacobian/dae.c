/* The equations of motion as differential-algebraic equations; see dae.h. */
#include <stdlib.h>
#include "dae.h"
#include "util.h"

int pw_dae_open (pw_dae *x, pw_run *r) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords + 3, rows = (size_t)s->rows;
  const pw_stabilisation_kind kind = r->method->stabilisations[r->stabilisation].kind;
  *x = (pw_dae){ .impulses = kind == PW_SI1, .n = s->coords };
  x->positions = kind == PW_GGL || kind == PW_SI1 || kind == PW_STABILISED_OTHERWISE; /* index3, rattle */
  x->velocities = kind == PW_GGL || kind == PW_SI1 || kind == PW_INDEX2;
  const pw_array array[] = { { &x->pull, n }, { &x->f, n }, { &x->jv, rows }, { &x->other, rows } };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  if (x->memory == NULL || pw_tangent_open (&x->tangent, r) != PW_OK) return PW_RESOURCE;
  x->rows = x->tangent.rows;
  x->mus = x->positions && x->velocities ? x->tangent.holonomic : 0;
  x->size = 2 * x->n + x->rows + x->mus;
  return PW_OK;
}

void pw_dae_close (pw_dae *x) {
  pw_tangent_close (&x->tangent);
  free (x->memory);
}

/* ---- Residual ---- */

/* jv becomes J a - gamma + 2 alpha jv + beta^2 g, of nonholonomic equations J a - gamma + alpha jv. */
static void dae_stabilise (pw_dae *x, const double *a) {
  const pw_run *r = x->tangent.run;
  const pw_system *s = r->s;
  for (int i = 0; i < s->rows; i++) x->jv[i] *= (i < s->holonomic ? 2 : 1) * r->alpha;
  pw_mul_J (r->w, a, x->other);
  for (int i = 0; i < s->rows; i++) x->jv[i] += x->other[i];
  pw_evaluate_gamma (r->w, x->other);
  for (int i = 0; i < s->rows; i++) x->jv[i] -= x->other[i];
  if (r->beta == 0) return;
  pw_evaluate_g (r->w, x->other);
  for (int i = 0; i < s->holonomic; i++) x->jv[i] += r->beta * r->beta * x->other[i];
}

static void dae_constraints (pw_dae *x, const double *v, const double *a, double *F) {
  pw_workspace *w = x->tangent.run->w;
  pw_mul_J (w, v, x->jv);
  pw_evaluate_eta (w, x->other);
  for (int i = 0; i < x->tangent.run->s->rows; i++) x->jv[i] -= x->other[i];
  if (!x->velocities && !x->positions) dae_stabilise (x, a);
  if (x->positions) pw_evaluate_g (w, x->velocities ? x->other : x->jv);
  pw_tangent_compress (&x->tangent, x->jv, x->rows, F);
  pw_tangent_compress (&x->tangent, x->other, x->mus, F + x->rows);
}

void pw_dae_residual (pw_dae *x, const double *v, const double *a, const double *lambda, double *F) {
  const pw_run *r = x->tangent.run;
  int n = x->n;
  pw_tangent_pull (&x->tangent, lambda + x->rows, x->mus, x->pull);
  for (int j = 0; j < n; j++) F[j] = x->tangent.D[j] * x->pull[j];
  pw_tangent_pull (&x->tangent, lambda, x->rows, x->pull);
  pw_evaluate_force (r->w, x->f);
  for (int j = 0; j < n; j++) F[n + j] = (a ? r->s->mass[j] * a[j] : 0) + x->pull[j] - x->f[j];
  dae_constraints (x, v, a, F + 2 * n);
}

/* ---- Matrix ---- */

void pw_dae_matrix (pw_dae *x, const double *v, const double *a, const double *lambda, double of_q, double of_a) {
  int n = x->n, mu = 2 * n + x->rows;
  pw_tangent *t = &x->tangent;
  const pw_tangent_layout to = { .momentum = n,
                                 .constraint = 2 * n,
                                 .v = n,
                                 .a = n,
                                 .lambda = 2 * n,
                                 .mu = mu,
                                 .of_q = of_q,
                                 .of_a = of_a,
                                 .of_lambda = x->impulses ? of_a : 1 };
  pw_tangent_kinematics (t, &to, pw_tangent_mu (t, lambda + x->rows, x->mus));
  pw_tangent_momentum (t, &to, pw_tangent_lambda (t, lambda));
  if (x->velocities || x->positions)
    pw_tangent_velocities (t, &to, v, x->velocities);
  else
    pw_tangent_accelerations (t, &to, v, a);
  if (x->positions) pw_tangent_positions (t, &to, x->velocities ? mu : 2 * n);
}

int pw_dae_lay_out (pw_dae *x, const double *v, const double *a, const double *lambda) {
  pw_tangent *t = &x->tangent;
  pw_scatter_record (&t->scatter);
  pw_dae_matrix (x, v, a, lambda, 1, 1);
  return pw_scatter_lay_out (&t->scatter, x->size, &t->colptr, &t->rowind);
}
