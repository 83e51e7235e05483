/* Derivatives of energies, powers and multipliers along a column: exact, or by differences along the derivative of the
 * state and between the neighbours. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "rank.h"
#include "variation_parts.h"

/* ---- Energies ---- */

/* sum m v dv + sum dm/dp v^2 / 2 */
static double output_kinetic (const pw_variation *x, const pw_variation_column *c, const double *v, const double *dv) {
  const pw_direction *d = &c->direction->given;
  const double *mass = x->r->s->M;
  double sum = 0;
  for (int j = 0; j < x->n; j++) sum += mass[j] * v[j] * dv[j];
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS && d->initial == NULL; i++) {
    double weight = pw_direction_weight (d, pw_variation_column_index (c), i);
    const double *other = d->neighbour[i]->s->M;
    for (int j = 0; j < x->n; j++) sum += weight * (other[j] - mass[j]) * v[j] * v[j] / 2;
  }
  return sum;
}

/* The potential energy minus that at the state evaluated, summed by element: elements whose energy does not change must
 * not contribute round-off. */
static double output_potential (pw_variation *x, pw_workspace *w) {
  double sum = 0;
  pw_evaluate_energies (w, x->element_energy + x->elements);
  for (int i = 0; i < x->elements; i++) sum += x->element_energy[x->elements + i] - x->element_energy[i];
  return sum;
}

/* Round-off of the last output_potential: of the energies that were not those at the state evaluated. */
static double output_round (const pw_variation *x) {
  double sum = 0;
  for (int i = 0; i < x->elements; i++)
    if (x->element_energy[x->elements + i] != x->element_energy[i]) sum += DBL_EPSILON * fabs (x->element_energy[i]);
  return sum;
}

/* ---- All outputs ---- */

/* The outputs at a state of a run, into x->values, in the order of pw_variation_outputs; 0 for the kinetic energy. */
static int output_values (pw_variation *x, pw_run *r, double t, const double *q, const double *v,
                          const double *lambda) {
  double *out = x->values;
  int status = pw_evaluate_J_at (r->w, t, q, v), entries = r->s->entries;
  if (status != PW_OK) return status;
  out[0] = 0;
  out[1] = output_potential (x, r->w);
  memcpy (out + 2 + entries, lambda, (size_t)r->s->rows * sizeof *lambda);
  pw_ledger_rates (r, lambda, out + 2);
  if (r->redundant && pw_saddle_factor (r->saddle) == PW_OK) pw_rank_least_norm (r, out + 2 + entries);
  return PW_OK;
}

double pw_variation_step_along (const pw_variation_column *c) {
  return 1e-5 / (c->largest > 0 ? c->largest : 1);
}

/* Adds the effect of the derivative Y of the state, by central differences along Y. */
static int output_by_state (pw_variation *x, const pw_variation_column *c, pw_variation_place at, const double *Y,
                            double *out) {
  int n = x->n, m = x->m, status = PW_OK;
  double step = pw_variation_step_along (c);
  double *q = x->values + 2 + x->entries + m, *v = q + n + 3, *lambda = v + n + 3;
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    for (int j = 0; j < n; j++) q[j] = at.q[j] + side * step * Y[j], v[j] = at.v[j] + side * step * Y[n + j];
    for (int i = 0; i < m; i++) lambda[i] = x->linear.lambda[i] + side * step * c->lambda[i];
    status = output_values (x, x->r, at.held ? at.t : x->at, q, v, lambda);
    pw_add_scaled (out, x->values, side / (2 * step), 2 + x->entries + m);
  }
  if (pw_variation_column_index (c) == 1) /* round-off of the differences of the derivative itself */
    out[1] += copysign (output_round (x) / pw_variation_step_along (c->direction->column), out[1]);
  return status;
}

int pw_variation_outputs (pw_variation *x, const pw_variation_column *c, const double *Y, double *out) {
  const pw_direction_copy *d = c->direction;
  pw_variation_place at = pw_variation_place_of (x, d);
  int length = 2 + x->entries + x->m, status = PW_OK;
  memset (out, 0, (size_t)length * sizeof *out);
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS && status == PW_OK && d->given.initial == NULL; i++) {
    double weight = pw_direction_weight (&d->given, pw_variation_column_index (c), i);
    if (weight == 0) continue;
    status = output_values (x, d->given.neighbour[i], at.t, at.q, at.v, x->linear.lambda);
    pw_add_scaled (out, x->values, weight, length);
  }
  if (status == PW_OK) status = output_by_state (x, c, at, Y, out);
  out[0] = output_kinetic (x, c, at.v, Y + x->n);
  if (!x->r->redundant) memcpy (out + 2 + x->entries, c->lambda, (size_t)x->m * sizeof *out);
  return status;
}

int pw_variation_time_derivatives (pw_variation *x, int c, int k, pw_error *error) {
  int status = PW_OK, evaluated = 0;
  pw_variation_accelerate (x, c, k);
  if (!x->ledger) return PW_OK;
  for (pw_direction_copy *d = x->direction; d < x->direction + x->count && status == PW_OK; d++) {
    if (c >= d->columns) continue;
    status = pw_variation_outputs (x, &d->column[c], d->column[c].trial, x->output);
    memcpy (d->column[c].K[k] + 2 * x->n, x->output + 2, (size_t)x->entries * sizeof (double));
    evaluated = 1;
  }
  /* J and its factors are again those of the state */
  if (evaluated && pw_evaluate_J_at (x->r->w, x->at, x->q, x->v) == PW_OK) pw_saddle_factor (x->r->saddle);
  return status == PW_OK ? PW_OK : pw_fail_signal (x->at, error);
}

int pw_variation_all_time_derivatives (pw_variation *x, int k, pw_error *error) {
  memcpy (x->a[k], x->linear.a, (size_t)x->n * sizeof *x->q);
  int status = pw_variation_time_derivatives (x, 0, k, error);
  return status == PW_OK ? pw_variation_time_derivatives (x, 1, k, error) : status;
}
