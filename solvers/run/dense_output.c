/* Dense output: positions and velocities by cubic Hermite interpolation, of order 4, projected onto the constraints
 * that the method enforces; accelerations, multipliers and the ledger's rates by linear interpolation, with errors
 * of order h^2. */
#include <stdlib.h>
#include <string.h>
#include "dense_output.h"
#include "util.h"

int pw_dense_output_open (pw_dense_output *b, pw_run *r, int velocities, pw_error *error) {
  size_t entries = (size_t)r->s->entries;
  *b = (pw_dense_output){ .t0 = r->t, .velocities = velocities };
  const pw_array array[] = { { &b->q0, pw_state_length (r->s) }, { &b->ledger0, entries }, { &b->rate0, entries } };
  b->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  if (b->memory == NULL) return pw_fail_memory (r->s, error);
  return velocities < 0 ? PW_OK : pw_projector_open (&b->projector, r, NULL, NULL, error);
}

void pw_dense_output_close (pw_dense_output *b) {
  pw_projector_close (&b->projector);
  free (b->memory);
}

void pw_dense_output_keep (pw_dense_output *b, const pw_run *r) {
  size_t entries = (size_t)r->s->entries * sizeof (double);
  b->t0 = r->t;
  memcpy (b->q0, r->q, pw_state_length (r->s) * sizeof *r->q);
  memcpy (b->ledger0, r->ledger, entries);
  memcpy (b->rate0, r->rate, entries);
}

void pw_dense_output_count (pw_dense_output *b, pw_run *r) {
  pw_ledger_rates (r, r->lambda, r->rate);
  for (int i = 0; i < r->s->entries; i++) r->ledger[i] += 0.5 * (r->t - b->t0) * (b->rate0[i] + r->rate[i]);
}

/* Cubic Hermite interpolation of y with slopes s at x in [0, 1], for a step of size h. */
static double dense_hermite (double x, double h, double y0, double s0, double y1, double s1) {
  double up = x * x * (3 - 2 * x);
  return y0 + up * (y1 - y0) + h * x * (1 - x) * ((1 - x) * s0 - x * s1);
}

static int dense_inside (pw_dense_output *b, pw_run *r, double t) {
  const pw_system *s = r->s;
  const double *q0 = b->q0, *v0 = q0 + (r->v - r->q), *a0 = q0 + (r->a - r->q), *lambda0 = q0 + (r->lambda - r->q);
  double h = r->t - b->t0, x = (t - b->t0) / h;
  for (int j = 0; j < s->coords; j++) {
    r->q_at[j] = dense_hermite (x, h, q0[j], v0[j], r->q[j], r->v[j]);
    r->v_at[j] = dense_hermite (x, h, v0[j], a0[j], r->v[j], r->a[j]);
    r->a_at[j] = (1 - x) * a0[j] + x * r->a[j];
  }
  for (int i = 0; i < s->rows; i++) r->lambda_at[i] = (1 - x) * lambda0[i] + x * r->lambda[i];
  for (int i = 0; i < s->entries; i++)
    r->ledger_at[i] = b->ledger0[i] + h * x * (b->rate0[i] + 0.5 * x * (r->rate[i] - b->rate0[i]));
  if (b->velocities < 0) return pw_evaluate_J_at (r->w, t, r->q_at, r->v_at);
  int status = pw_project_positions (&b->projector, r, t, r->q_at, r->v_at);
  return status == PW_OK && b->velocities ? pw_project_velocities (&b->projector, r, r->v_at) : status;
}

int pw_fail_outside (const pw_run *r, double t0, double t, pw_error *error) {
  if (isnan (t0))
    return pw_fail (error, PW_INPUT, "t = %.17g s lies outside the last step, which ends at %.17g s", t, r->t);
  return pw_fail (error, PW_INPUT, "t = %.17g s lies outside the last step, %.17g to %.17g s", t, t0, r->t);
}

int pw_dense_output_at (pw_dense_output *b, pw_run *r, double t, pw_error *error) {
  if (t > r->t || t < b->t0) return pw_fail_outside (r, b->t0, t, error);
  if (t == r->t) {
    pw_show_reached (r);
    return PW_OK;
  }
  pw_statistics keep = r->statistics;
  int status = dense_inside (b, r, t);
  r->statistics = keep;
  if (status == PW_OK) return PW_OK;
  if (status == PW_METHOD) return pw_fail_signal (t, error);
  if (r->near_singular) return pw_fail_singular (r, t, error);
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: no state near the interpolated one satisfies the constraints; "
                  "the step of %.6g s may be too large",
                  t, r->t - b->t0);
}
