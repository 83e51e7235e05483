/* The functions of pinwheel-method.h for one-step methods of users, and dense output; pw_run_option, pw_run_accelerate:
 * dynamics.c. */
#include <stdlib.h>
#include <string.h>
#include "dense_output.h"

struct pw_method_data {
  pw_dense_output last;
  int projects;       /* with the projector of `last` */
  double end;         /* of the step whose size was last requested */
  int whole;          /* 1: that end is a multiple of the step size */
  double *a, *lambda; /* of the new state */
  size_t length;      /* of each of the method's arrays */
  double *array;      /* all of them, one after the other */
};

pw_reached pw_run_state (const pw_run *r) {
  return (pw_reached){ r->s, &r->settings, r->t, r->breakpoint, r->q, r->v, r->a, r->lambda };
}

double pw_stage_time (const pw_run *r, double t) {
  return pw_before_breakpoint (r, t);
}

int pw_step_restart (pw_run *r, pw_error *error) {
  pw_dense_output *b = (pw_dense_output *)r->data;
  (void)error;
  r->counter = (pw_step_counter){ .base = r->t };
  b->start.t = r->t;
  b->h = 0;
  return PW_OK;
}

int pw_step_open (pw_run *r, int arrays, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  struct pw_method_data *d = r->data = calloc (1, sizeof *d);
  size_t n = (size_t)r->s->coords + 3, rows = (size_t)r->s->rows;
  if (d == NULL) return pw_fail_memory (r->s, error);
  d->length = n > rows ? n : rows;
  d->last.arrays =
      PW_ALLOC_ARRAYS (PW_ARRAY (d->a, n), PW_ARRAY (d->lambda, rows), PW_ARRAY (d->array, (size_t)arrays * d->length));
  d->projects = pw_stabilised_by (r, PW_PROJECTION);
  return pw_dense_output_open (r, d->projects ? PW_DENSE_POSITIONS_AND_VELOCITIES : PW_DENSE_UNPROJECTED, error);
}

void pw_step_close (pw_run *r) {
  pw_dense_output *b = (pw_dense_output *)r->data;
  pw_projector_close (&b->projector);
  free (b->memory);
  free (b->arrays);
  free (b);
}

void pw_step_serialise (pw_run *r, pw_archive *a) {
  pw_archive_bytes (a, &r->counter.base, sizeof r->counter.base);
  pw_archive_count (a, &r->counter.count);
}

double *pw_step_array (pw_run *r, int i) {
  return r->data->array + (size_t)i * r->data->length;
}

double pw_step_size (pw_run *r, double t_end) {
  struct pw_method_data *d = r->data;
  d->end = pw_step_end (r, t_end, &d->whole);
  return d->end - r->t;
}

/* Projects the new state if the method does, and evaluates its accelerations; at a discontinuity, those before it. */
static int step_evaluate (pw_run *r, double t, double *q, double *v, double *added_energy) {
  struct pw_method_data *d = r->data;
  if (!pw_is_finite_state (r, q, v)) return PW_RETRY;
  t = pw_before_breakpoint (r, t);
  if (!d->projects) return pw_run_accelerate (r, t, q, v, d->a, d->lambda);
  return pw_project_state (&d->last.projector, r, t, q, v, d->a, d->lambda, r->settings.ledger ? added_energy : NULL);
}

static int step_fail (pw_run *r, int status, double h, pw_error *error) {
  if (status < 0) return pw_fail_signal (r->t, error);
  if (pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the step of %.6g s is too large: its end cannot be evaluated, or not be projected", r->t,
                  h);
}

int pw_step_accept (pw_run *r, int status, double h, double *q, double *v, pw_error *error) {
  struct pw_method_data *d = r->data;
  size_t n = (size_t)r->s->coords * sizeof *q;
  int requested = fabs (r->t + h - d->end) <= 1e-9 * h; /* 0: the caller chose another size */
  double t1 = requested ? d->end : r->t + h, added_energy = 0;
  if (status == PW_OK) status = step_evaluate (r, t1, q, v, &added_energy);
  if (status != PW_OK) return step_fail (r, status, h, error);
  pw_store_start (&d->last.start, r);
  r->t = t1;
  r->projected += added_energy;
  memcpy (r->q, q, n);
  memcpy (r->v, v, n);
  memcpy (r->a, d->a, n);
  memcpy (r->lambda, d->lambda, (size_t)r->s->rows * sizeof *r->lambda);
  pw_dense_output_integrate_ledger (&d->last, r);
  r->statistics.steps++;
  pw_count_step (r, requested && d->whole, t1);
  return PW_OK;
}

/* Dense output: positions and velocities by cubic Hermite interpolation, of order 4, projected onto the constraints as
 * pw_dense_projection says; accelerations, multipliers, the ledger's rates and the energy added by projections by
 * linear interpolation, with errors of order h^2. */

int pw_dense_output_open (pw_run *r, pw_dense_projection projection, pw_error *error) {
  pw_dense_output *b = (pw_dense_output *)r->data;
  size_t state = pw_state_length (r->s), entries = (size_t)r->entries;
  b->projection = projection;
  b->memory = PW_ALLOC_ARRAYS (PW_ARRAY (b->start.q, state), PW_ARRAY (b->start.ledger, entries),
                               PW_ARRAY (b->start.rate, entries));
  if (b->memory == NULL || b->arrays == NULL) return pw_fail_memory (r->s, error);
  int status = projection == PW_DENSE_UNPROJECTED ? PW_OK : pw_projector_open (&b->projector, r, NULL, NULL, error);
  return status == PW_OK ? pw_step_restart (r, error) : status;
}

void pw_store_start (pw_step_start *x, const pw_run *r) {
  size_t entries = (size_t)r->entries * sizeof (double);
  x->t = r->t, x->projected = r->projected;
  memcpy (x->q, r->q, pw_state_length (r->s) * sizeof *r->q);
  memcpy (x->ledger, r->ledger, entries);
  memcpy (x->rate, r->rate, entries);
}

void pw_dense_output_integrate_ledger (pw_dense_output *b, pw_run *r) {
  pw_ledger_rates (r, r->lambda, r->rate);
  for (int i = 0; i < r->entries; i++) r->ledger[i] += 0.5 * (r->t - b->start.t) * (b->start.rate[i] + r->rate[i]);
}

/* Cubic Hermite interpolation at x in [0, 1] in a step of size h: values y0, y1 and derivatives dy0, dy1 at its
 * ends. */
static double dense_hermite (double x, double h, double y0, double dy0, double y1, double dy1) {
  double blend = x * x * (3 - 2 * x);
  return y0 + blend * (y1 - y0) + h * x * (1 - x) * ((1 - x) * dy0 - x * dy1);
}

static int dense_interpolate (pw_run *r, double t) {
  pw_dense_output *b = (pw_dense_output *)r->data;
  const pw_step_start *start = &b->start;
  const pw_system *s = r->s;
  const double *q0 = start->q, *v0 = q0 + (r->v - r->q), *a0 = q0 + (r->a - r->q), *lambda0 = q0 + (r->lambda - r->q);
  double h = r->t - start->t, x = (t - start->t) / h;
  for (int j = 0; j < s->coords; j++) {
    r->q_at[j] = dense_hermite (x, h, q0[j], v0[j], r->q[j], r->v[j]);
    r->v_at[j] = dense_hermite (x, h, v0[j], a0[j], r->v[j], r->a[j]);
    r->a_at[j] = (1 - x) * a0[j] + x * r->a[j];
  }
  for (int i = 0; i < s->rows; i++) r->lambda_at[i] = (1 - x) * lambda0[i] + x * r->lambda[i];
  for (int i = 0; i < r->entries; i++)
    r->ledger_at[i] = start->ledger[i] + h * x * (start->rate[i] + 0.5 * x * (r->rate[i] - start->rate[i]));
  r->projected_at = (1 - x) * start->projected + x * r->projected;
  if (b->projection == PW_DENSE_UNPROJECTED) return pw_evaluate_J_at (r->w, t, r->q_at, r->v_at);
  int status = pw_project_positions (&b->projector, r, t, r->q_at, r->v_at);
  if (status != PW_OK || b->projection == PW_DENSE_POSITIONS) return status;
  return pw_project_velocities (&b->projector, r, r->v_at);
}

int pw_step_at (pw_run *r, double t, pw_error *error) {
  return pw_sample_last_step (r, ((pw_dense_output *)r->data)->start.t, t, dense_interpolate, error);
}

int pw_fail_outside (const pw_run *r, double t0, double t, pw_error *error) {
  if (isnan (t0))
    return pw_fail (error, PW_INPUT, "t = %.17g s lies outside the last step, which ends at %.17g s", t, r->t);
  return pw_fail (error, PW_INPUT, "t = %.17g s lies outside the last step, %.17g to %.17g s", t, t0, r->t);
}

int pw_sample_last_step (pw_run *r, double t0, double t, pw_interpolate *interpolate, pw_error *error) {
  if (t > r->t || t < t0) return pw_fail_outside (r, t0, t, error);
  if (t == r->t) {
    pw_sample_reached (r);
    return PW_OK;
  }
  const pw_statistics statistics = r->statistics;
  r->projected_at = r->projected;
  int status = interpolate (r, t);
  r->statistics = statistics;
  if (status == PW_OK) return PW_OK;
  if (status == PW_METHOD) return pw_fail_signal (t, error);
  if (r->near_singular) return pw_fail_singular (r, t, error);
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: no state near the interpolated one satisfies the constraints; "
                  "the step of %.6g s may be too large",
                  t, r->t - t0);
}
