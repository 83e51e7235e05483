/* Explicit steps of the derivatives, by the pair of orders 5 and 4 of Dormand & Prince (erk5.c); the equations are in
 * variation.c. */
#include <math.h>
#include <string.h>
#include "rk.h"
#include "variation_parts.h"

/* Adds the first `length` entries of h sum weight_k K_k to `out`. */
static void explicit_combine (const pw_variation_column *c, const double *weight, int count, double h, int length,
                              double *out) {
  for (int k = 0; k < count; k++) pw_add_scaled (out, c->K[k], h * weight[k], length);
}

/* `trial` = Y + h sum weight_k K_k of every column, over `count` stages. */
static void explicit_stage (pw_variation *x, const double *weight, int count, double h) {
  PW_EACH_COLUMN (c, x) {
    memcpy (c->trial, c->Y, (size_t)x->size * sizeof *c->Y);
    explicit_combine (c, weight, count, h, x->size, c->trial);
  }
}

int pw_variation_explicit_stages (pw_variation *x, double h, double t1, pw_error *error) {
  const pw_tableau *b = &pw_erk5_tableau;
  const double *weight = b->A;
  int status = PW_OK;
  for (int k = 1; k < b->stages && status == PW_OK; weight += k++) {
    explicit_stage (x, weight, k, h);
    status = pw_variation_evaluate_at (x, k + 1 < b->stages ? x->t + b->c[k] * h : t1, error);
    if (status == PW_OK) status = pw_variation_all_time_derivatives (x, k, error);
  }
  if (status != PW_OK) return status;
  explicit_stage (x, b->b, b->stages, h); /* the last stage has evaluated the state at t1 */
  PW_EACH_COLUMN (c, x) pw_variation_project (x, c);
  memset (x->motion_error, 0, (size_t)x->n * sizeof *x->motion_error);
  for (int k = 0; k < PW_VARIATION_RATES; k++) {
    const double *a = k < b->stages ? x->a[k] : x->linear.a;
    pw_add_scaled (x->motion_error, a, h * b->e[k], x->n);
    if (k < b->stages) pw_add_scaled (x->motion_defect, a, h * b->b[k], x->n);
  }
  return PW_OK;
}

void pw_variation_explicit_errors (pw_variation *x, double h) {
  for (pw_direction_copy *d = x->direction; d < x->direction + x->count; d++) {
    memset (d->local_error, 0, (size_t)x->size * sizeof *d->local_error);
    explicit_combine (&d->column[0], pw_erk5_tableau.e, PW_VARIATION_RATES, h, x->size, d->local_error);
  }
}

/* |F_new - F_last| / |Y_new - Y_last| of the result of the step and its last stage, both at its end, is about the rate
 * of the fastest component (Hairer & Wanner 1996, section IV.2). */
double pw_variation_stiffness (const pw_variation *x, double h) {
  const pw_tableau *b = &pw_erk5_tableau;
  const double *row = b->A + (b->stages - 1) * (b->stages - 2) / 2;
  double most = 0, weight[PW_VARIATION_RATES], *change = x->values, *rate = change + 2 * x->n;
  for (int k = 0; k < b->stages; k++) weight[k] = b->b[k] - (k + 1 < b->stages ? row[k] : 0);
  for (const pw_direction_copy *d = x->direction; d < x->direction + x->count; d++) {
    const pw_variation_column *c = d->column;
    memset (change, 0, 2 * (size_t)x->n * sizeof *change);
    explicit_combine (c, weight, b->stages, h, 2 * x->n, change);
    for (int j = 0; j < 2 * x->n; j++) rate[j] = h * (c->K[b->stages][j] - c->K[b->stages - 1][j]);
    if (pw_variation_norm (x, change) > 0)
      most = fmax (most, pw_variation_norm (x, rate) / pw_variation_norm (x, change));
  }
  return most;
}
