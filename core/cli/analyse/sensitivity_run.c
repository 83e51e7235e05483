/* Outputs of runs as functions of unknowns, and their derivatives by differences of runs (pw_differentiate). */
#define _POSIX_C_SOURCE 200809L
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include "sensitivity.h"

static const double SENSITIVITY_RTOL = 1e-12, /* of the runs that are compared */
    SENSITIVITY_PROBE = 1e-5;                 /* change that shows what an unknown changes, relative to its size */

/* ---- Outputs of a run ---- */

int pw_run_outputs_at (const pw_run_outputs *outputs, const double *x, double *value, double *table, pw_error *error) {
  pw_outcomes outcomes = { .system = NULL };
  pw_unknown_run run;
  const pw_outcome_table rows = { outputs->t, outputs->rows, table };
  int status = pw_unknown_run_prepare (&run, outputs->unknowns, x, error);
  if (status == PW_OK)
    status = pw_outcomes_open (&outcomes, run.m.system, outputs->option, outputs->of, outputs->count, error);
  if (outputs->method) run.settings.rtol = outputs->rtol, run.settings.atol = 0;
  if (outputs->max_steps) run.settings.max_steps = outputs->max_steps;
  if (status == PW_OK)
    status = pw_outcomes_run (&outcomes, outputs->method ? outputs->method : outputs->unknowns->method, &run.settings,
                              outputs->unknowns->t_end, outputs->t ? &rows : NULL, error);
  for (int i = 0; status == PW_OK && value && i < outputs->count; i++) value[i] = pw_outcome_value (&outcomes, i);
  pw_outcomes_close (&outcomes);
  pw_unknown_run_close (&run);
  return status;
}

double pw_unknowns_noise (const pw_unknowns *u) {
  return pw_cli_adaptive (u->method) == 1 ? u->settings.rtol : DBL_EPSILON;
}

/* ---- What can be differentiated ---- */

/* Opens a run with unknown p changed by `by`. */
static int sensitivity_neighbour (const pw_sensitivity *sens, const double *values, int p, double by,
                                  pw_unknown_run *run, pw_error *error) {
  const pw_unknowns *u = sens->outputs.unknowns;
  double *x = malloc ((size_t)u->count * sizeof *x);
  if (x == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  memcpy (x, values, (size_t)u->count * sizeof *x);
  x[p] += by;
  int status = pw_unknown_run_prepare (run, u, x, error);
  free (x);
  if (status != PW_OK) return status;
  run->run = pw_limit_open (run->m.system, u->method, &run->settings, error);
  return run->run ? PW_OK : error->status;
}

static int sensitivity_same_size (const pw_system *a, const pw_system *b) {
  return pw_system_elements (a) == pw_system_elements (b) && pw_system_coordinates (a) == pw_system_coordinates (b) &&
         pw_system_rows (a) == pw_system_rows (b);
}

/* Refuses parameters that change the number of bodies or elements, and initial values that the constraints determine:
 * then making the state of a neighbour consistent changes them back, by much more than 1 % of the step. */
static int sensitivity_check (const pw_sensitivity *sens, const double *values, int p, pw_error *error) {
  const pw_unknowns *u = sens->outputs.unknowns;
  const pw_unknown *unknown = &u->list[p];
  const pw_system *s = sens->outcomes.system;
  const int n = pw_system_coordinates (s);
  const double step = SENSITIVITY_PROBE * unknown->size;
  int status = PW_OK;
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    pw_unknown_run run = { .run = NULL };
    pw_error own = { 0 };
    int opened = sensitivity_neighbour (sens, values, p, side * step, &run, &own);
    if (opened == PW_RESOURCE) status = pw_fail (error, opened, "%s", own.text);
    if (opened == PW_OK && !sensitivity_same_size (s, run.m.system))
      status = pw_fail (error, PW_INPUT,
                        "%s changes the number of bodies or elements: derivatives with respect to it do not exist",
                        unknown->name);
    else if (opened == PW_OK && unknown->state >= 0) {
      const pw_initial_report *initial = pw_run_initial (run.run);
      double value = unknown->state < n ? initial->q[unknown->state] : initial->v[unknown->state - n];
      if (fabs (value - values[p] - side * step) > 0.01 * step)
        status = pw_fail (error, PW_INPUT,
                          "--by %s: it cannot change while the other initial values of --by and --start are kept: "
                          "constraints determine it",
                          unknown->name);
    }
    pw_unknown_run_close (&run);
  }
  return status;
}

/* ---- Derivatives ---- */

/* pw_difference_settings.evaluate. */
static int sensitivity_evaluate (void *context, const double *x, double rtol, double *value, pw_error *error) {
  pw_sensitivity *sens = context;
  pw_run_outputs outputs = sens->outputs;
  outputs.rtol = rtol;
  int status = pw_run_outputs_at (&outputs, x, value, value + outputs.count, error);
  pthread_mutex_lock (&sens->lock);
  if (sens->progress) pw_progress_at (sens->progress, fmin (++sens->runs, sens->progress->last));
  pthread_mutex_unlock (&sens->lock);
  return status;
}

static int sensitivity_differentiate (pw_sensitivity *sens, const double *values, pw_error *error) {
  const pw_unknowns *u = sens->outputs.unknowns;
  const int outputs = sens->outputs.count * (1 + sens->outputs.rows);
  sens->derivative = pw_arena_alloc (&sens->arena, (size_t)u->count * (size_t)outputs * sizeof *sens->derivative);
  if (sens->derivative == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const pw_difference_settings d = { .evaluate = sensitivity_evaluate,
                                     .context = sens,
                                     .outputs = outputs,
                                     .steering = sens->outputs.count,
                                     .rtol = SENSITIVITY_RTOL,
                                     .neighbours = 6,
                                     .jobs = sens->jobs };
  return pw_unknowns_differentiate (u, values, d, sens->derivative, error);
}

/* The method of the runs that are compared, and the sizes of the unknowns. */
static int sensitivity_prepare (pw_sensitivity *sens, const double *values, pw_error *error) {
  const pw_unknowns *u = sens->outputs.unknowns;
  pw_unknown_run run;
  pw_run *r = NULL;
  int status = pw_unknown_run_prepare (&run, u, values, error);
  if (status == PW_OK) r = run.run = pw_limit_open (run.m.system, u->method, &run.settings, error);
  if (status == PW_OK && r == NULL) status = error->status;
  for (int p = 0; p < u->count && status == PW_OK; p++) pw_unknown_measure (&u->list[p], values[p], r);
  if (status == PW_OK) {
    sens->outputs.method = pw_accurate_method (run.m.system, &run.settings, u->t_end, &sens->outputs.max_steps, error);
    if (sens->outputs.method == NULL && error->status == PW_OK)
      status = pw_limit_status (&run.limit, pw_run_time (r), error);
    else if (sens->outputs.method == NULL)
      status = error->status;
  }
  pw_unknown_run_close (&run);
  return status;
}

int pw_sensitivity_compute (pw_sensitivity *sens, pw_error *error) {
  const pw_unknowns *u = sens->outputs.unknowns;
  const size_t count = (size_t)sens->outputs.count, rows = (size_t)sens->outputs.rows;
  double *values = pw_arena_alloc (&sens->arena, (size_t)u->count * sizeof *values);
  sens->value = pw_arena_alloc (&sens->arena, count * (1 + rows) * sizeof *sens->value);
  if (values == NULL || sens->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  sens->table = sens->value + count;
  for (int p = 0; p < u->count; p++) values[p] = u->list[p].value;
  int status = pw_outcomes_open (&sens->outcomes, u->m->system, sens->outputs.option, sens->outputs.of,
                                 sens->outputs.count, error);
  if (status == PW_OK) status = pw_run_outputs_at (&sens->outputs, values, sens->value, sens->table, error);
  if (status == PW_OK) status = sensitivity_prepare (sens, values, error);
  for (int p = 0; p < u->count && status == PW_OK; p++) status = sensitivity_check (sens, values, p, error);
  for (int i = 0; i < sens->outputs.count && status == PW_OK; i++)
    if (!isfinite (sens->value[i]))
      status = pw_fail (error, PW_METHOD, "%.300s is not a finite number at the end of the run", sens->outputs.of[i]);
  if (status != PW_OK) return status;
  pthread_mutex_init (&sens->lock, NULL);
  status = sensitivity_differentiate (sens, values, error);
  pthread_mutex_destroy (&sens->lock);
  return status;
}

const pw_derivative *pw_sensitivity_of (const pw_sensitivity *sens, int output, int unknown, int row) {
  const int count = sens->outputs.count, rows = sens->outputs.rows;
  const pw_derivative *of = sens->derivative + unknown * count * (1 + rows);
  return of + (row < 0 ? output : count + output * rows + row);
}

void pw_sensitivity_close (pw_sensitivity *sens) {
  pw_outcomes_close (&sens->outcomes);
  pw_arena_free (&sens->arena);
}
