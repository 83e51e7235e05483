/* Derivatives of outputs along a run.
 *
 * An output is a function of functionals of columns.  The derivative of the final value of a column is that of the
 * last sample.  That of an extremum is the derivative of the column at the time of the extremum, since inside a step a
 * shift of that time has no effect of first order.  That of an integral is the integral of the derivative of the
 * column, by Gauss' formula with 5 nodes over intervals of a few steps of the derivatives, which end at rows of the
 * table and at breakpoints; the shift of a jump adds to it (sensitivity_jump). */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "sensitivity.h"

enum {
  SENSITIVITY_PARTS = 20, /* of the run, between rows of the table, if row_interval is not given */
  /* of the derivatives in an interval of Gauss' formula, whose 5 nodes integrate even squares of columns (rms) */
  SENSITIVITY_STEPS = 2
};

int pw_sensitivity_in_table (const pw_sensitivity *sens, int output) {
  const pw_outcome *o = &sens->outcomes.outcome[output];
  for (int i = 0; i < o->terms; i++)
    if (sens->outcomes.functional[o->term[i]].type != PW_FINAL) return 0;
  return 1;
}

double pw_sensitivity_derivative (const pw_sensitivity *sens, int output, int unknown, const double *slope) {
  const pw_outcome *o = &sens->outcomes.outcome[output];
  double sum = 0;
  pw_outcome_value (&sens->outcomes, output, sens->gradient);
  for (int i = 0; i < o->terms; i++)
    sum += sens->gradient[o->term[i]] * slope[o->term[i] * sens->unknowns.count + unknown];
  return sum;
}

/* ---- Columns at a time ---- */

enum { OF_DERIVATIVE, OF_ERROR }; /* arguments of pw_direction_weight */

/* Column `index` of the contact points (see pw_column) of a workspace's system, at q + factor dq. */
static int sensitivity_contact (pw_sensitivity *sens, pw_workspace *w, int index, const pw_sample *s, const double *dq,
                                double factor, double *value, pw_error *error) {
  for (int j = 0; j < pw_system_coordinates (sens->base.m.system); j++) sens->q[j] = s->q[j] + factor * dq[j];
  int status = pw_workspace_contact_points (w, s->t, sens->q, s->v, sens->outcomes.contact, error);
  if (status == PW_OK) *value = sens->outcomes.contact[index / 2][index % 2];
  return status;
}

/* The derivative of a coordinate of a contact point, a function of positions and parameters: differences in both at
 * once.  dq, eq: derivatives of the positions, and their errors. */
static int sensitivity_contact_slope (pw_sensitivity *sens, int unknown, int index, const pw_sample *s,
                                      const double *dq, const double *eq, double *slope, double *slope_error,
                                      pw_error *error) {
  const pw_direction *d = &sens->direction[unknown];
  double value = 0;
  int status = PW_OK;
  *slope = *slope_error = 0;
  for (int k = 0; k < 4 && status == PW_OK; k++) {
    pw_unknown_run *near = &sens->neighbours[4 * unknown + k];
    if (near->workspace == NULL) near->workspace = pw_workspace_new (near->m.system, error);
    if (near->workspace == NULL) return error->status;
    status = sensitivity_contact (sens, near->workspace, index, s, dq, pw_direction_offset (d, k), &value, error);
    *slope += pw_direction_weight (d, OF_DERIVATIVE, k) * value;
    *slope_error += pw_direction_weight (d, OF_ERROR, k) * value;
  }
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    status = sensitivity_contact (sens, sens->outcomes.workspace, index, s, eq, side, &value, error);
    *slope_error += side * value / 2;
  }
  return status;
}

int pw_sensitivity_at (pw_sensitivity *sens, double t, pw_error *error) {
  pw_sample s, derivative, slope_error;
  const int P = sens->unknowns.count;
  int status = pw_variation_advance (sens->variation, t, sens->unknowns.t_end, error);
  if (status == PW_OK && sens->sampled) status = pw_run_advance_to (sens->sampled, t, sens->unknowns.t_end, error);
  if (status == PW_OK) status = pw_run_sample (sens->sampled ? sens->sampled : sens->base.run, t, &s, error);
  if (status == PW_OK) status = pw_outcomes_read (&sens->outcomes, &s, 0, error);
  for (int p = 0; p < P && status == PW_OK; p++) {
    status = pw_variation_sample (sens->variation, p, &derivative, &slope_error, error);
    for (int i = 0; i < sens->outcomes.functionals && status == PW_OK; i++) {
      pw_column c = sens->outcomes.functional[i].column;
      derivative.t = slope_error.t = 0; /* the column t does not depend on anything */
      sens->slope[i * P + p] = pw_column_value (sens->base.m.system, c, &derivative);
      sens->slope_error[i * P + p] = pw_column_value (sens->base.m.system, c, &slope_error);
      if (c.type == PW_COLUMN_CONTACT)
        status = sensitivity_contact_slope (sens, p, c.index, &s, derivative.q, slope_error.q, &sens->slope[i * P + p],
                                            &sens->slope_error[i * P + p], error);
    }
  }
  return status;
}

/* ---- Functionals ---- */

/* Derivatives before and after a jump count as equal up to this relative difference. */
#define SENSITIVITY_SAME 1e-5

/* Adds the current derivatives of columns, times the weight of a node, to the derivatives of integrals. */
static void sensitivity_add_node (pw_sensitivity *sens, double weight) {
  for (int i = 0; i < sens->outcomes.functionals; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    double factor = f->type == PW_INTEGRAL ? weight : weight / sens->unknowns.t_end;
    if (!pw_is_integral (f->type)) continue;
    if (f->type == PW_RMS) factor *= f->value > 0 ? f->values[0] / f->value : 0;
    for (int p = i * sens->unknowns.count; p < (i + 1) * sens->unknowns.count; p++) {
      sens->run_slope[p] += factor * sens->slope[p];
      sens->run_slope_error[p] += factor * sens->slope_error[p];
    }
  }
}

/* The derivative of the time of the breakpoint or jump last passed; with passed = 0, of the next breakpoint. */
static double sensitivity_jump_slope (const pw_sensitivity *sens, int unknown, int passed) {
  double slope;
  if (passed) return pw_variation_jump_slope (sens->variation, unknown);
  pw_variation_breakpoint (sens->variation, unknown, &slope);
  return slope;
}

/* Makes the current derivatives of the column of functional i those of the functional, unless these are NaN: they do
 * not exist. */
static void sensitivity_keep (pw_sensitivity *sens, int i) {
  for (int at = i * sens->unknowns.count; at < (i + 1) * sens->unknowns.count; at++)
    if (!isnan (sens->run_slope[at]))
      sens->run_slope[at] = sens->slope[at], sens->run_slope_error[at] = sens->slope_error[at];
}

/* The same for all extrema in (t0, t1]; the derivatives of one do not exist if it is at a breakpoint whose time depends
 * on the unknown.  at_next: 1: they are known to be at the next breakpoint. */
static void sensitivity_keep_extrema (pw_sensitivity *sens, double t0, double t1, int at_next) {
  double slope, next = pw_variation_breakpoint (sens->variation, 0, &slope);
  for (int i = 0; i < sens->outcomes.functionals; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    const double near = 2 * PW_FUNCTIONAL_INSET * f->step; /* extrema are sought beside the ends of a step */
    const int before = at_next || next - f->t <= near, after = f->t - sens->last_breakpoint <= near;
    if (!pw_is_extremum (f->type) || f->t <= t0 || f->t > t1) continue;
    sensitivity_keep (sens, i);
    for (int p = 0; p < sens->unknowns.count && (before || after); p++)
      if (sensitivity_jump_slope (sens, p, !before) != 0) sens->run_slope[i * sens->unknowns.count + p] = NAN;
  }
}

/* Drops derivatives of extrema that do not exist: those in the step of the run in which accelerations jump at a
 * state, reached at t, if the derivative of the column jumps there; before: derivatives before the jump. */
static void sensitivity_drop_extrema (pw_sensitivity *sens, double t, const double *before) {
  for (int i = 0; i < sens->outcomes.functionals; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    for (int at = i * sens->unknowns.count; at < (i + 1) * sens->unknowns.count && pw_is_extremum (f->type); at++)
      if (fabs (f->t - t) <= f->step && fabs (sens->slope[at] - before[at]) > SENSITIVITY_SAME * fabs (before[at]))
        sens->run_slope[at] = NAN;
  }
}

/* Sets the values of final columns, and adds a row to the table: the time, then each output in it, with its
 * derivatives. */
static int sensitivity_add_row (pw_sensitivity *sens, double t, pw_error *error) {
  if (pw_grow (&sens->row, (size_t)sens->rows, &sens->room, (size_t)sens->columns * sizeof *sens->row) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  double *out = sens->row + (size_t)sens->rows++ * (size_t)sens->columns;
  *out++ = t;
  for (pw_functional *f = sens->outcomes.functional; f < sens->outcomes.functional + sens->outcomes.functionals; f++)
    if (f->type == PW_FINAL) f->value = f->values[0];
  for (int o = 0; o < sens->outcomes.outcomes; o++) {
    if (!pw_sensitivity_in_table (sens, o)) continue;
    *out++ = pw_outcome_value (&sens->outcomes, o, NULL);
    for (int p = 0; p < sens->unknowns.count; p++) *out++ = pw_sensitivity_derivative (sens, o, p, sens->slope);
  }
  return PW_OK;
}

/* ---- Along the run ---- */

/* Advances from t0, where the columns have been evaluated, to t1, with Gauss' formula for the integrals. */
static int sensitivity_integrate (pw_sensitivity *sens, double t0, double t1, pw_error *error) {
  int status = PW_OK, integrals = 0;
  for (int i = 0; i < sens->outcomes.functionals; i++) integrals |= pw_is_integral (sens->outcomes.functional[i].type);
  for (int k = 0; k < PW_GAUSS_NODES && integrals && status == PW_OK; k++) {
    status = pw_sensitivity_at (sens, pw_gauss_time (t0, t1, k), error);
    if (status == PW_OK) sensitivity_add_node (sens, pw_gauss_w[k] * (t1 - t0) / 2);
  }
  return status == PW_OK ? pw_sensitivity_at (sens, t1, error) : status;
}

/* The same, in parts that end at extrema. */
static int sensitivity_interval (pw_sensitivity *sens, double t0, double t1, pw_error *error) {
  int status;
  do {
    double end = t1;
    for (int i = 0; i < sens->outcomes.functionals; i++) {
      const pw_functional *f = &sens->outcomes.functional[i];
      if (pw_is_extremum (f->type) && f->t > t0) end = fmin (end, f->t);
    }
    status = sensitivity_integrate (sens, t0, end, error);
    if (status == PW_OK) sensitivity_keep_extrema (sens, t0, end, 0);
    t0 = end;
  } while (status == PW_OK && t0 < t1);
  return status;
}

/* Advances from t0 to t, from just before to just after a breakpoint, or a jump at a state, at a time tb that depends
 * on the unknown p.  Where a column jumps from x- to x+, this adds (x- - x+) dtb/dp to the derivative of its
 * integral. */
static int sensitivity_jump (pw_sensitivity *sens, double t0, double t, int at_state, pw_error *error) {
  const size_t F = (size_t)sens->outcomes.functionals, P = (size_t)sens->unknowns.count;
  double *slope = sens->before + F;                                           /* before the jump */
  const double split = at_state ? t0 : nextafter (sens->last_breakpoint, t0); /* extrema up to it are before the jump */
  sensitivity_keep_extrema (sens, t0, split, 1);
  for (size_t i = 0; i < F; i++) sens->before[i] = sens->outcomes.functional[i].values[0];
  memcpy (slope, sens->slope, F * P * sizeof *slope);
  int status = pw_sensitivity_at (sens, t, error);
  if (status == PW_OK && at_state) sensitivity_drop_extrema (sens, t, slope);
  if (status == PW_OK) sensitivity_keep_extrema (sens, split, t, 0);
  for (int i = 0; i < sens->outcomes.functionals && status == PW_OK; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    double jump = sens->before[i] - f->values[0];
    if (!pw_is_integral (f->type) || jump == 0) continue;
    if (f->type != PW_INTEGRAL) jump /= sens->unknowns.t_end;
    if (f->type == PW_RMS) jump *= (sens->before[i] + f->values[0]) / (2 * f->value);
    for (int p = 0; p < sens->unknowns.count; p++)
      sens->run_slope[i * sens->unknowns.count + p] += jump * pw_variation_jump_slope (sens->variation, p);
  }
  return status;
}

/* A jump of accelerations at the time of a breakpoint, or at a state, when the motion reaches it. */
typedef enum { NO_JUMP, JUMP_AT_BREAKPOINT, JUMP_AT_STATE } sensitivity_jump_type;

/* The end of the next interval from t towards `to`, in which derivatives are smooth; the type of the jump at its end is
 * stored; NO_JUMP without extrema and integrals, to which alone jumps matter.  NAN as pw_variation_next_jump. */
static double sensitivity_next (pw_sensitivity *sens, double t, double to, sensitivity_jump_type *jump,
                                pw_error *error) {
  double slope, breakpoint = pw_variation_breakpoint (sens->variation, 0, &slope);
  *jump = NO_JUMP;
  if (!sens->outcomes.along_run) return fmin (to, breakpoint);
  double next = fmin (fmin (to, breakpoint), t + SENSITIVITY_STEPS * pw_variation_step_size (sens->variation));
  double at_state = pw_variation_next_jump (sens->variation, next, sens->unknowns.t_end, error);
  if (isnan (at_state)) return NAN;
  *jump = at_state < next ? JUMP_AT_STATE : next == breakpoint ? JUMP_AT_BREAKPOINT : NO_JUMP;
  return fmin (next, at_state);
}

/* Advances from t to `to`: in intervals without jumps, and across jumps from just before to just after them. */
static int sensitivity_advance (pw_sensitivity *sens, double t, double to, pw_progress *progress, pw_error *error) {
  /* from a jump to the evaluations of columns before it and, at a breakpoint, after it [s] */
  const double aside = 1e-9 * fmin (sens->row_interval, sens->unknowns.t_end / SENSITIVITY_PARTS);
  sensitivity_jump_type jump;
  int status = PW_OK;
  while (t < to && status == PW_OK) {
    double next = sensitivity_next (sens, t, to, &jump, error);
    if (isnan (next)) return error->status != PW_OK ? error->status : PW_STOPPED;
    double end = jump ? next - fmin (aside, next - t) : next;
    status = sensitivity_interval (sens, t, end, error);
    if (jump == JUMP_AT_BREAKPOINT) sens->last_breakpoint = next, next = fmin (next + aside, sens->unknowns.t_end);
    if (status == PW_OK && jump) status = sensitivity_jump (sens, end, next, jump == JUMP_AT_STATE, error);
    pw_progress_at (progress, t = next);
  }
  return status;
}

/* Advances to the end, with a row of the table at the beginning and after every row_interval. */
static int sensitivity_advance_to_end (pw_sensitivity *sens, pw_progress *progress, pw_error *error) {
  const double t_end = sens->unknowns.t_end;
  double t = 0, to;
  sens->last_breakpoint = -INFINITY;
  int status = pw_sensitivity_at (sens, 0, error);
  if (status == PW_OK) status = sensitivity_add_row (sens, 0, error);
  if (status == PW_OK) sensitivity_keep_extrema (sens, -INFINITY, 0, 0);
  for (long k = 1; t < t_end && status == PW_OK; k++, t = to) {
    to = (double)k * sens->row_interval;
    if (to >= t_end * (1 - 1e-12)) to = t_end; /* no row beside the last one due to round-off */
    status = sensitivity_advance (sens, t, to, progress, error);
    if (status == PW_OK) status = sensitivity_add_row (sens, to, error);
  }
  for (int i = 0; i < sens->outcomes.functionals; i++)
    if (sens->outcomes.functional[i].type == PW_FINAL) sensitivity_keep (sens, i);
  return status;
}

/* ---- Opening ---- */

/* Sets the defaults and the values of the unknowns. */
static int sensitivity_prepare (pw_sensitivity *sens, const double *values, pw_error *error) {
  size_t P = (size_t)sens->unknowns.count;
  if (sens->row_interval == 0) sens->row_interval = sens->unknowns.t_end / SENSITIVITY_PARTS;
  sens->unknown_value = pw_arena_alloc (&sens->arena, P * sizeof *sens->unknown_value);
  sens->neighbours = pw_arena_alloc (&sens->arena, 4 * P * sizeof *sens->neighbours);
  sens->direction = pw_arena_alloc (&sens->arena, P * sizeof *sens->direction);
  if (sens->unknown_value == NULL || sens->neighbours == NULL || sens->direction == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  for (size_t p = 0; p < P; p++) sens->unknown_value[p] = values ? values[p] : sens->unknowns.list[p].value;
  return PW_OK;
}

static int sensitivity_arrays (pw_sensitivity *sens, pw_error *error) {
  const size_t F = (size_t)sens->outcomes.functionals, P = (size_t)sens->unknowns.count;
  const pw_array array[] = { { &sens->gradient, F },
                             { &sens->slope, F * P },
                             { &sens->slope_error, F * P },
                             { &sens->run_slope, F * P },
                             { &sens->run_slope_error, F * P },
                             { &sens->before, F + F * P },
                             { &sens->q, (size_t)pw_system_coordinates (sens->base.m.system) } };
  sens->columns = 1;
  for (int o = 0; o < sens->outcomes.outcomes; o++)
    if (pw_sensitivity_in_table (sens, o)) sens->columns += 1 + sens->unknowns.count;
  sens->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  return sens->memory ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
}

/* Refuses initial values that the constraints determine: then making the state of a neighbour consistent changes them
 * back, by much more than 1 % of the step. */
static int sensitivity_check_independence (const pw_sensitivity *sens, pw_error *error) {
  int n = pw_system_coordinates (sens->base.m.system);
  for (int p = 0; p < sens->unknowns.count; p++) {
    const pw_unknown *u = &sens->unknowns.list[p];
    const pw_direction *d = &sens->direction[p];
    if (u->state < 0) continue;
    const pw_initial_report *initial = pw_run_initial (d->neighbour[0]);
    double value = u->state < n ? initial->q[u->state] : initial->v[u->state - n];
    if (fabs (value - sens->unknown_value[p] - pw_direction_offset (d, 0)) > 0.01 * fabs (d->step))
      return pw_fail (
          error, PW_INPUT,
          "--by %s: it cannot change while the other initial values of --by and --start are kept: constraints "
          "determine it",
          u->name);
  }
  return PW_OK;
}

/* Opens the run, with the ledger if outputs need it; the one of which samples are taken where base.run is ahead of the
 * derivatives (pw_variation_advance); and the neighbours. */
static int sensitivity_open_runs (pw_sensitivity *sens, pw_error *error) {
  int count = 0;
  while (sens->of[count]) count++;
  int status = pw_unknown_run_prepare (&sens->base, &sens->unknowns, sens->unknown_value, error);
  if (status == PW_OK) status = pw_outcomes_open (&sens->outcomes, sens->base.m.system, "--of", sens->of, count, error);
  if (status != PW_OK) return status;
  sens->base.settings.ledger = sens->outcomes.ledger;
  sens->base.run = pw_limit_open (sens->base.m.system, sens->unknowns.method, &sens->base.settings, error);
  if (sens->base.run && pw_system_may_jump (sens->base.m.system))
    sens->sampled = pw_limit_open (sens->base.m.system, sens->unknowns.method, &sens->base.settings, error);
  if (error->status != PW_OK) return error->status;
  status = pw_unknowns_directions (sens->direction, &sens->unknowns, sens->unknown_value, &sens->base, sens->neighbours,
                                   error);
  for (int p = 0; p < sens->unknowns.count; p++) sens->direction[p].no_error = sens->no_error;
  return status == PW_OK && !sens->no_error ? sensitivity_check_independence (sens, error) : status;
}

int pw_sensitivity_start (pw_sensitivity *sens, const double *values, pw_error *error) {
  int status = sensitivity_prepare (sens, values, error);
  if (status == PW_OK) status = sensitivity_open_runs (sens, error);
  if (status == PW_OK) status = sensitivity_arrays (sens, error);
  pw_limit_start (&sens->base.limit); /* without the time to open the neighbours */
  if (status != PW_OK) return status;
  sens->variation =
      pw_variation_open (sens->base.run, sens->direction, sens->unknowns.count, sens->outcomes.ledger, error);
  return sens->variation ? PW_OK : error->status;
}

int pw_sensitivity_compute (pw_sensitivity *sens, const double *values, pw_progress *progress, pw_error *error) {
  int status = pw_sensitivity_start (sens, values, error);
  /* Another run determines the values of extrema and integrals, and the times of extrema. */
  if (status == PW_OK && sens->outcomes.along_run)
    status =
        pw_outcomes_run (&sens->outcomes, sens->unknowns.method, &sens->base.settings, sens->unknowns.t_end, error);
  if (status != PW_OK) return status;
  status = sensitivity_advance_to_end (sens, progress, error);
  sens->stopped = status == PW_STOPPED;
  return sens->stopped ? PW_OK : status;
}

void pw_sensitivity_close (pw_sensitivity *sens) {
  pw_variation_close (sens->variation);
  pw_run_close (sens->sampled);
  pw_outcomes_close (&sens->outcomes);
  for (int i = 0; sens->neighbours && i < 4 * sens->unknowns.count; i++) pw_unknown_run_close (&sens->neighbours[i]);
  pw_unknown_run_close (&sens->base);
  pw_arena_free (&sens->arena);
  free (sens->memory);
  free (sens->row);
}
