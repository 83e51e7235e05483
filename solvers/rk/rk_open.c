/* Explicit Runge-Kutta methods: options, opening and closing, choice between fixed steps (rk_fixed.c) and step-size
 * control (rk_adapt.c). */
#include <stdlib.h>
#include <string.h>
#include "rk_step.h"
#include "util.h"

static const char *const rk_steps[] = { "adaptive", "fixed", NULL };
static const char *const rk_positions[] = { "projected", "drift", NULL };
static const char *const rk_inputs[] = { "stage", "held", NULL };

const pw_stabilisation pw_rk_stabilisations[] = {
  PW_ACCELERATION_STABILISATIONS,
  { "projection", "projection onto the constraints after each step (Lubich 1991, Eich 1993)", PW_PROJECTION },
  { "nullspace",
    "velocities in a basis of the null space of J: velocities obey all constraints at every stage "
    "(Kim & Vanderploeg 1986)",
    PW_NULLSPACE },
  { .name = NULL },
};

#define RK_OPTIONS                                                                              \
  { .name = "inputs",                                                                           \
    .choices = rk_inputs,                                                                       \
    .about = "signals of forces at stage times, or held from the step's start (first order)" }, \
      PW_BAUMGARTE_OPTIONS, PW_PROJECTION_OPTIONS, {                                            \
    .name = "positions", .with = "nullspace", .choices = rk_positions,                          \
    .about = "positions projected after each step, or left to drift at the order of the method" \
  }

const pw_option pw_rk_fixed_options[] = { RK_OPTIONS, { .name = NULL } };
const pw_option pw_rk_adaptive_options[] = {
  { .name = "steps", .choices = rk_steps, .about = "steps that follow the tolerances, or of the given size" },
  RK_OPTIONS,
  { .name = NULL },
};

static pw_rk_row rk_nonzero_weights (const double *weight, int stages) {
  pw_rk_row row = { 0 };
  for (int j = 0; j < stages; j++)
    if (weight[j] != 0) {
      row.stage[row.count] = j;
      row.weight[row.count++] = weight[j];
    }
  return row;
}

static void rk_list_weights (pw_method_data *d) {
  const pw_tableau *tableau = d->tableau;
  const double *A = tableau->A, *const estimate[] = { tableau->e, tableau->e3, tableau->e6 };
  d->row[0] = rk_nonzero_weights (tableau->b, tableau->stages);
  for (int i = 1; i < tableau->stages; A += i++) d->row[i] = rk_nonzero_weights (A, i); /* row i has i entries */
  for (int k = 0; k < 3; k++)
    if (estimate[k]) d->estimate[k] = rk_nonzero_weights (estimate[k], tableau->stages + 1);
}

static int rk_allocate (pw_method_data *d, const pw_run *r) {
  enum { ONCE = 8 }; /* arrays that exist once, not for each stage */
  size_t n = (size_t)r->s->coords + 3, state = pw_state_length (r->s), entries = (size_t)r->entries, count = ONCE;
  int stages = d->tableau->stages;
  pw_array array[ONCE + 3 * PW_RK_STAGES] = {
    { &d->q, state },           { &d->weight, 2 * n },   { &d->last.q, state },          { &d->last.ledger, entries },
    { &d->last.rate, entries }, { &d->second.q, state }, { &d->second.ledger, entries }, { &d->second.rate, entries }
  };
  for (int i = 1; i <= stages; i++) { /* stage 0 has r->v, r->a and r->rate */
    array[count++] = (pw_array){ &d->stage_rate[i], entries };
    if (i == stages) break; /* velocities and accelerations of the new state are in d->v, d->a */
    array[count++] = (pw_array){ &d->stage_v[i], n };
    array[count++] = (pw_array){ &d->stage_a[i], n };
  }
  d->memory = pw_alloc_arrays (array, count);
  if (d->memory == NULL) return PW_RESOURCE;
  d->v = d->q + n, d->a = d->v + n, d->lambda = d->a + n;
  return PW_OK;
}

int pw_rk_open (pw_run *r, const pw_tableau *tableau, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  if (d == NULL) return pw_fail_memory (r->s, error);
  d->tableau = tableau;
  rk_list_weights (d);
  d->holds_signals = pw_run_option (r, "inputs") != 0;
  d->projects = pw_stabilised_by (r, PW_PROJECTION);
  d->uses_nullspace = pw_stabilised_by (r, PW_NULLSPACE);
  d->nullspace_projects = d->uses_nullspace && pw_run_option (r, "positions") == 0;
  d->every = (int)pw_run_option (r, "every");
  if (rk_allocate (d, r) != PW_OK) return pw_fail_memory (r->s, error);
  int status = d->projects || d->nullspace_projects ? pw_projector_open_by_options (&d->projector, r, error) : PW_OK;
  if (status == PW_OK && d->uses_nullspace) status = pw_nullspace_open (&d->nullspace, r, error);
  return status == PW_OK ? pw_rk_restart (r, error) : status;
}

void pw_rk_close (pw_run *r) {
  pw_projector_close (&r->data->projector);
  pw_nullspace_close (&r->data->nullspace);
  free (r->data->memory);
  free (r->data);
}

int pw_rk_restart (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data;
  (void)error;
  d->counter = (pw_step_counter){ .base = r->t };
  d->off_grid = 0;
  if (!r->fixed_steps) pw_rk_reset_step_size (r);
  pw_store_start (&d->last, r);
  return PW_OK;
}

void pw_rk_serialise (pw_run *r, pw_archive *a) {
  pw_method_data *d = r->data;
  pw_serialise_counter (&d->counter, a);
  pw_archive_bytes (a, &d->off_grid, sizeof d->off_grid);
  pw_archive_bytes (a, &d->h, sizeof d->h);
  pw_archive_bytes (a, &d->last_error, sizeof d->last_error);
}

int pw_rk_advance (pw_run *r, double t_end, pw_error *error) {
  return r->fixed_steps ? pw_rk_advance_fixed (r, t_end, error) : pw_rk_advance_adaptive (r, t_end, error);
}
