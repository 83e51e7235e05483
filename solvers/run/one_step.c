/* The functions of pinwheel-method.h for one-step methods of users; pw_run_option: options.c; pw_run_accelerate:
 * dynamics.c. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "dense_output.h"
#include "pinwheel-method.h"
#include "util.h"

struct pw_method_data {
  pw_dense_output last;
  int projects; /* with the projector of `last` */
  pw_step_counter counter;
  double end;         /* of the step whose size was last requested */
  int whole;          /* 1: that end is a multiple of the step size */
  double *a, *lambda; /* of the new state */
  size_t length;      /* of each of the method's arrays */
  double *array;      /* all of them, one after the other */
  char *memory;
};

pw_state pw_run_state (const pw_run *r) {
  return (pw_state){ r->s, &r->settings, r->t, r->breakpoint, r->q, r->v, r->a, r->lambda };
}

double pw_stage_time (const pw_run *r, double t) {
  return pw_before_breakpoint (r, t);
}

/* ---- Opening ---- */

int pw_step_restart (pw_run *r, pw_error *error) {
  struct pw_method_data *d = r->data;
  (void)error;
  d->counter = (pw_step_counter){ .base = r->t };
  d->last.start.t = r->t;
  return PW_OK;
}

int pw_step_open (pw_run *r, int arrays, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  struct pw_method_data *d = r->data = calloc (1, sizeof *d);
  size_t n = (size_t)r->s->coords + 3, rows = (size_t)r->s->rows;
  if (d == NULL) return pw_fail_memory (r->s, error);
  d->length = n > rows ? n : rows;
  const pw_array array[] = { { &d->a, n }, { &d->lambda, rows }, { &d->array, (size_t)arrays * d->length } };
  d->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  if (d->memory == NULL) return pw_fail_memory (r->s, error);
  d->projects = pw_stabilised_by (r, PW_PROJECTION);
  pw_dense_projection projection = d->projects ? PW_DENSE_POSITIONS_AND_VELOCITIES : PW_DENSE_UNPROJECTED;
  int status = pw_dense_output_open (&d->last, r, projection, error);
  return status == PW_OK ? pw_step_restart (r, error) : status;
}

void pw_step_close (pw_run *r) {
  pw_dense_output_close (&r->data->last);
  free (r->data->memory);
  free (r->data);
}

void pw_step_serialise (pw_run *r, pw_archive *a) {
  pw_serialise_counter (&r->data->counter, a);
}

double *pw_step_array (pw_run *r, int i) {
  return r->data->array + (size_t)i * r->data->length;
}

/* ---- Steps ---- */

double pw_step_size (pw_run *r, double t_end) {
  struct pw_method_data *d = r->data;
  d->end = pw_step_end (r, &d->counter, t_end, &d->whole);
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
  pw_count_step (&d->counter, requested && d->whole, t1);
  return PW_OK;
}

int pw_step_at (pw_run *r, double t, pw_error *error) {
  return pw_dense_output_at (&r->data->last, r, t, error);
}
