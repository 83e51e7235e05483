/* Derivatives of outputs along a run.
 *
 * An output is a function of functionals of columns.  At a time, the derivative of a column is that of the sample.
 * That of an extremum is the column's at its time, since inside a step the effect of a shift of time vanishes; that
 * of an integral is the integral of the column's, by Gauss' formula with 5 nodes over a few steps of the derivatives,
 * up to rows of the table and breakpoints. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "sensitivity.h"
#include "util.h"

/* Rows if their distance is not given; steps of the derivatives in an interval of integrals, in which the square of a
 * column is smooth enough for 5 nodes. */
enum { SENSITIVITY_PARTS = 20, SENSITIVITY_STEPS = 2 };

int pw_sensitivity_in_table (const pw_sensitivity *sens, int output) {
  const pw_outcome *o = &sens->outcomes.outcome[output];
  for (int i = 0; i < o->terms; i++)
    if (sens->outcomes.functional[o->term[i]].type != PW_FINAL) return 0;
  return 1;
}

double pw_sensitivity_derivative (const pw_sensitivity *sens, int output, int unknown, const double *slope) {
  const pw_outcome *o = &sens->outcomes.outcome[output];
  double *gradient = sens->value + sens->outcomes.functionals, sum = 0;
  pw_outcome_value (&sens->outcomes, output, gradient);
  for (int i = 0; i < o->terms; i++) sum += gradient[o->term[i]] * slope[o->term[i] * sens->unknowns.count + unknown];
  return sum;
}

/* ---- Columns at a time ---- */

/* Coordinate `index` of the contact points in a workspace's system, at the positions q + by dq. */
static int sensitivity_contact (const pw_sensitivity *sens, pw_workspace *w, int index, const pw_sample *s,
                                const double *dq, double by, double *value, pw_error *error) {
  const pw_system *system = sens->base.m.system;
  int n = pw_system_coordinates (system), contacts = pw_system_contacts (system), status;
  double *q = malloc ((size_t)n * sizeof *q), (*at)[3] = malloc (((size_t)contacts + 1) * sizeof *at);
  for (int j = 0; q && j < n; j++) q[j] = s->q[j] + by * dq[j];
  status = q && at ? pw_workspace_contact_points (w, s->t, q, s->v, at, error)
                   : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) *value = at[index / 2][index % 2];
  free (q);
  free (at);
  return status;
}

/* Contact points are functions of positions and parameters: differences in both, with the derivatives of positions
 * and their errors. */
static int sensitivity_contact_slope (const pw_sensitivity *sens, int unknown, int index, const pw_sample *s,
                                      const double *dq, const double *eq, double *slope, double *error_of,
                                      pw_error *error) {
  const pw_direction *d = &sens->direction[unknown];
  double value = 0;
  int status = PW_OK;
  *slope = *error_of = 0;
  for (int k = 0; k < 4 && status == PW_OK; k++) {
    pw_unknown_run *near = &sens->near[4 * unknown + k];
    if (near->workspace == NULL) near->workspace = pw_workspace_new (near->m.system, error);
    if (near->workspace == NULL) return error->status;
    status = sensitivity_contact (sens, near->workspace, index, s, dq, pw_direction_offset (d, k), &value, error);
    *slope += pw_direction_weight (d, 0, k) * value;
    *error_of += pw_direction_weight (d, 1, k) * value;
  }
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    status = sensitivity_contact (sens, sens->outcomes.workspace, index, s, eq, side, &value, error);
    *error_of += side * value / 2;
  }
  return status;
}

/* A sample of the run at a time that the derivatives have reached. */
static int sensitivity_sample (pw_sensitivity *sens, double t, pw_sample *s, pw_error *error) {
  int status = sens->sampled ? pw_run_advance_to (sens->sampled, t, sens->unknowns.t_end, error) : PW_OK;
  return status == PW_OK ? pw_run_sample (sens->sampled ? sens->sampled : sens->base.run, t, s, error) : status;
}

int pw_sensitivity_at (pw_sensitivity *sens, double t, pw_error *error) {
  pw_sample s, d, e;
  int status = pw_variation_advance (sens->variation, t, sens->unknowns.t_end, error), P = sens->unknowns.count;
  if (status == PW_OK) status = sensitivity_sample (sens, t, &s, error);
  if (status == PW_OK) status = pw_outcomes_read (&sens->outcomes, &s, sens->value, error);
  for (int p = 0; p < P && status == PW_OK; p++) {
    status = pw_variation_sample (sens->variation, p, &d, &e, error);
    for (int i = 0; i < sens->outcomes.functionals && status == PW_OK; i++) {
      pw_column c = sens->outcomes.functional[i].column;
      d.t = e.t = 0; /* the column t does not depend on anything */
      sens->slope[i * P + p] = pw_column_value (sens->base.m.system, c, &d);
      sens->error[i * P + p] = pw_column_value (sens->base.m.system, c, &e);
      if (c.type == PW_COLUMN_CONTACT)
        status = sensitivity_contact_slope (sens, p, c.index, &s, d.q, e.q, &sens->slope[i * P + p],
                                            &sens->error[i * P + p], error);
    }
  }
  return status;
}

/* ---- Functionals ---- */

/* Relative difference of derivatives before and after a jump that are the same. */
static const double SENSITIVITY_SAME = 1e-5;

/* Adds the current columns to the integrals, with a weight. */
static void sensitivity_add (pw_sensitivity *sens, double weight) {
  for (int i = 0; i < sens->outcomes.functionals; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    double factor = f->type == PW_INTEGRAL ? weight : weight / sens->unknowns.t_end;
    if (!pw_is_integral (f->type)) continue;
    if (f->type == PW_RMS) factor *= f->value > 0 ? sens->value[i] / f->value : 0;
    for (int p = i * sens->unknowns.count; p < (i + 1) * sens->unknowns.count; p++) {
      sens->end_slope[p] += factor * sens->slope[p];
      sens->end_error[p] += factor * sens->error[p];
    }
  }
}

/* The derivative of the time of the next breakpoint, or of the last breakpoint or jump that has been passed. */
static double sensitivity_moves (const pw_sensitivity *sens, int unknown, int passed) {
  double slope;
  if (passed) return pw_variation_jump_slope (sens->variation, unknown);
  pw_variation_breakpoint (sens->variation, unknown, &slope);
  return slope;
}

/* Keeps the current derivatives of functional i that exist. */
static void sensitivity_keep (pw_sensitivity *sens, int i) {
  for (int at = i * sens->unknowns.count; at < (i + 1) * sens->unknowns.count; at++)
    if (!isnan (sens->end_slope[at])) sens->end_slope[at] = sens->slope[at], sens->end_error[at] = sens->error[at];
}

/* Keeps those of an extremum; at a breakpoint that moves, and just after it, they do not exist.  reached: 1 if the
 * extremum is at a breakpoint that is not passed yet. */
static void sensitivity_keep_extremum (pw_sensitivity *sens, int i, int reached) {
  const pw_functional *f = &sens->outcomes.functional[i];
  double slope, next = pw_variation_breakpoint (sens->variation, 0, &slope);
  int before = reached || fabs (f->t - next) < 1e-9 * (1 + fabs (next)),
      after = f->t - sens->passed <= 2 * PW_FUNCTIONAL_INSET * f->step;
  sensitivity_keep (sens, i);
  for (int p = 0; p < sens->unknowns.count && (before || after); p++)
    if (sensitivity_moves (sens, p, !before) != 0) sens->end_slope[i * sens->unknowns.count + p] = NAN;
}

/* Drops derivatives of extrema in the step of the run that passes a jump with the state at t, if those of the column
 * jump there from `before`: they do not exist. */
static void sensitivity_drop (pw_sensitivity *sens, double t, const double *before) {
  for (int i = 0; i < sens->outcomes.functionals; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    for (int at = i * sens->unknowns.count; at < (i + 1) * sens->unknowns.count && pw_is_extremum (f->type); at++)
      if (fabs (f->t - t) <= f->step && fabs (sens->slope[at] - before[at]) > SENSITIVITY_SAME * fabs (before[at]))
        sens->end_slope[at] = NAN;
  }
}

/* Row of the table: time, then each output that has columns, with its derivatives. */
static int sensitivity_row (pw_sensitivity *sens, double t, pw_error *error) {
  if (pw_grow (&sens->row, (size_t)sens->rows, &sens->room, (size_t)sens->columns * sizeof *sens->row) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  double *out = sens->row + (size_t)sens->rows++ * (size_t)sens->columns;
  *out++ = t;
  for (int i = 0; i < sens->outcomes.functionals; i++)
    if (sens->outcomes.functional[i].type == PW_FINAL) sens->outcomes.functional[i].value = sens->value[i];
  for (int o = 0; o < sens->outcomes.outcomes; o++) {
    if (!pw_sensitivity_in_table (sens, o)) continue;
    *out++ = pw_outcome_value (&sens->outcomes, o, NULL);
    for (int p = 0; p < sens->unknowns.count; p++) *out++ = pw_sensitivity_derivative (sens, o, p, sens->slope);
  }
  return PW_OK;
}

/* ---- Along the run ---- */

typedef struct {
  double t, weight; /* of a node */
  int extremum;     /* functional, or -1 */
} sensitivity_event;

static int sensitivity_earlier (const void *a, const void *b) {
  double x = ((const sensitivity_event *)a)->t, y = ((const sensitivity_event *)b)->t;
  return (x > y) - (x < y);
}

/* The nodes and extrema in (t0, t1]. */
static int sensitivity_events (const pw_sensitivity *sens, double t0, double t1, sensitivity_event *list) {
  int count = 0, integrals = 0;
  for (int i = 0; i < sens->outcomes.functionals; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    integrals |= pw_is_integral (f->type);
    if (pw_is_extremum (f->type) && f->t > t0 && f->t <= t1) list[count++] = (sensitivity_event){ f->t, 0, i };
  }
  for (int k = 0; k < PW_GAUSS_NODES && integrals; k++)
    list[count++] =
        (sensitivity_event){ (t0 + t1) / 2 + pw_gauss_x[k] * (t1 - t0) / 2, pw_gauss_w[k] * (t1 - t0) / 2, -1 };
  qsort (list, (size_t)count, sizeof *list, sensitivity_earlier);
  return count;
}

/* From t0, where the columns are evaluated, to t1. */
static int sensitivity_interval (pw_sensitivity *sens, double t0, double t1, sensitivity_event *list, pw_error *error) {
  int count = sensitivity_events (sens, t0, t1, list), status = PW_OK;
  for (int i = 0; i < count && status == PW_OK; i++) {
    double t = list[i].t;
    status = pw_sensitivity_at (sens, t, error);
    if (status != PW_OK) break;
    if (list[i].extremum < 0)
      sensitivity_add (sens, list[i].weight);
    else
      sensitivity_keep_extremum (sens, list[i].extremum, 0);
  }
  return status == PW_OK ? pw_sensitivity_at (sens, t1, error) : status;
}

/* Past a breakpoint t_b, or a jump with the state, from just before it.  The integral of a column that jumps there
 * from x- to x+ has the derivative (x- - x+) dt_b/dp.  A breakpoint at the end of the run is only reached. */
static int sensitivity_jump (pw_sensitivity *sens, double t0, double t, int with_state, pw_error *error) {
  int passed = with_state || t > sens->passed;
  size_t F = (size_t)sens->outcomes.functionals, P = (size_t)sens->unknowns.count;
  double *slope = sens->before + F;
  memcpy (sens->before, sens->value, F * sizeof *sens->before);
  memcpy (slope, sens->slope, F * P * sizeof *slope);
  int status = pw_sensitivity_at (sens, t, error);
  if (status == PW_OK && with_state) sensitivity_drop (sens, t, slope);
  for (int i = 0; i < sens->outcomes.functionals && status == PW_OK; i++) {
    const pw_functional *f = &sens->outcomes.functional[i];
    double jump = sens->before[i] - sens->value[i];
    if (pw_is_extremum (f->type) && f->t > t0 && f->t <= t) sensitivity_keep_extremum (sens, i, !passed);
    if (!pw_is_integral (f->type) || jump == 0) continue;
    if (f->type != PW_INTEGRAL) jump /= sens->unknowns.t_end;
    if (f->type == PW_RMS) jump *= (sens->before[i] + sens->value[i]) / (2 * f->value);
    for (int p = 0; p < sens->unknowns.count; p++)
      sens->end_slope[i * sens->unknowns.count + p] += jump * sensitivity_moves (sens, p, passed);
  }
  return status;
}

/* The end of the next interval, in which derivatives are smooth, unless it ends at a jump.  *jump: 0, or 1 at a
 * breakpoint, 2 at a jump with the state.  NAN and the error. */
static double sensitivity_next (pw_sensitivity *sens, double t, double to, int *jump, pw_error *error) {
  double slope, breakpoint = pw_variation_breakpoint (sens->variation, 0, &slope);
  *jump = 0;
  if (!sens->along) return fmin (to, breakpoint);
  double next = fmin (fmin (to, breakpoint), t + SENSITIVITY_STEPS * pw_variation_step_size (sens->variation));
  double with_state = pw_variation_next_jump (sens->variation, next, sens->unknowns.t_end, error);
  if (isnan (with_state)) return NAN;
  *jump = with_state < next ? 2 : next == breakpoint;
  return fmin (next, with_state);
}

static int sensitivity_advance (pw_sensitivity *sens, double t, double to, sensitivity_event *list,
                                pw_progress *progress, pw_error *error) {
  const double near =
      1e-9 * fmin (sens->dt, sens->unknowns.t_end / SENSITIVITY_PARTS); /* distance of states beside a jump from it */
  int jump, status = PW_OK;
  while (t < to && status == PW_OK) {
    double next = sensitivity_next (sens, t, to, &jump, error);
    if (isnan (next)) return error->status;
    double end = jump ? next - fmin (near, next - t) : next;
    if (jump == 1) sens->passed = next, next = fmin (next + near, sens->unknowns.t_end);
    status = sensitivity_interval (sens, t, end, list, error);
    if (status == PW_OK && jump) status = sensitivity_jump (sens, end, next, jump == 2, error);
    pw_progress_at (progress, t = next);
  }
  return status;
}

static int sensitivity_along (pw_sensitivity *sens, sensitivity_event *list, pw_progress *progress, pw_error *error) {
  double t = 0, to;
  sens->passed = -INFINITY;
  int status = pw_sensitivity_at (sens, 0, error);
  if (status == PW_OK) status = sensitivity_row (sens, 0, error);
  for (int i = 0; i < sens->outcomes.functionals && status == PW_OK; i++)
    if (pw_is_extremum (sens->outcomes.functional[i].type)) sensitivity_keep (sens, i);
  for (long k = 1; t < sens->unknowns.t_end && status == PW_OK; k++, t = to) {
    to = (double)k * sens->dt < sens->unknowns.t_end * (1 - 1e-12) ? (double)k * sens->dt : sens->unknowns.t_end;
    status = sensitivity_advance (sens, t, to, list, progress, error);
    if (status == PW_OK) status = sensitivity_row (sens, to, error);
  }
  for (int i = 0; i < sens->outcomes.functionals; i++)
    if (sens->outcomes.functional[i].type == PW_FINAL) sensitivity_keep (sens, i);
  return status;
}

static int sensitivity_integrate (pw_sensitivity *sens, pw_progress *progress, pw_error *error) {
  sensitivity_event *list = malloc (((size_t)sens->outcomes.functionals + PW_GAUSS_NODES) * sizeof *list);
  if (list == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = sensitivity_along (sens, list, progress, error);
  free (list);
  sens->stopped = status == PW_STOPPED;
  return sens->stopped ? PW_OK : status;
}

/* ---- Opening ---- */

int pw_sensitivity_open (pw_sensitivity *sens, const double *at, pw_error *error) {
  size_t P = (size_t)sens->unknowns.count;
  if (sens->dt == 0) sens->dt = sens->unknowns.t_end / SENSITIVITY_PARTS;
  sens->limit.seconds = sens->unknowns.limit;
  sens->unknowns.settings.stop = pw_limit_over;
  sens->unknowns.settings.stop_context = &sens->limit;
  sens->at = malloc (P * sizeof *sens->at);
  sens->near = calloc (4 * P, sizeof *sens->near);
  sens->direction = calloc (P, sizeof *sens->direction);
  for (size_t p = 0; p < P && sens->at; p++) sens->at[p] = at ? at[p] : sens->unknowns.list[p].value;
  return sens->at && sens->near && sens->direction ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
}

static int sensitivity_arrays (pw_sensitivity *sens, pw_error *error) {
  size_t F = (size_t)sens->outcomes.functionals, P = (size_t)sens->unknowns.count;
  sens->value = calloc (3 * F + 5 * F * P + 1, sizeof *sens->value);
  sens->columns = 1;
  for (int o = 0; o < sens->outcomes.outcomes; o++)
    if (pw_sensitivity_in_table (sens, o)) sens->columns += 1 + sens->unknowns.count;
  if (sens->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  sens->slope = sens->value + 2 * F, sens->error = sens->slope + F * P;
  sens->end_slope = sens->error + F * P, sens->end_error = sens->end_slope + F * P;
  sens->before = sens->end_error + F * P;
  return PW_OK;
}

/* Work and losses need a run with the ledger. */
static int sensitivity_ledger (pw_sensitivity *sens, pw_error *error) {
  if (!sens->outcomes.ledger) return PW_OK;
  sens->unknowns.settings.ledger = 1;
  pw_run_close (sens->base.run);
  sens->base.run = pw_run_open (sens->base.m.system, sens->unknowns.method, &sens->unknowns.settings, error);
  return sens->base.run ? PW_OK : error->status;
}

/* The values of extrema and integrals, and the times of extrema, from a run of its own. */
static int sensitivity_functionals (pw_sensitivity *sens, pw_error *error) {
  for (int i = 0; i < sens->outcomes.functionals; i++) sens->along |= sens->outcomes.functional[i].type != PW_FINAL;
  return sens->along ? pw_outcomes_run (&sens->outcomes, sens->unknowns.method, &sens->unknowns.settings,
                                        sens->unknowns.t_end, error)
                     : PW_OK;
}

/* The run of which samples are taken, where the derivatives' is ahead. */
static int sensitivity_sampled (pw_sensitivity *sens, pw_error *error) {
  if (!pw_system_may_jump (sens->base.m.system)) return PW_OK;
  sens->sampled = pw_run_open (sens->base.m.system, sens->unknowns.method, &sens->unknowns.settings, error);
  return sens->sampled ? PW_OK : error->status;
}

/* Initial values can only change by themselves if the constraints permit it. */
static int sensitivity_independent (const pw_sensitivity *sens, pw_error *error) {
  int n = pw_system_coordinates (sens->base.m.system);
  for (int p = 0; p < sens->unknowns.count; p++) {
    const pw_unknown *u = &sens->unknowns.list[p];
    const pw_direction *d = &sens->direction[p];
    if (u->state < 0) continue;
    const pw_initial_report *s = pw_run_initial (d->neighbour[0]);
    double value = u->state < n ? s->q[u->state] : s->v[u->state - n];
    if (fabs (value - sens->at[p] - pw_direction_offset (d, 0)) > 1e-2 * fabs (d->step))
      return pw_fail (
          error, PW_INPUT,
          "--by %s: it cannot change while the other initial values of --by and --start are kept: constraints "
          "determine it",
          u->name);
  }
  return PW_OK;
}

/* The run and its neighbours. */
static int sensitivity_runs (pw_sensitivity *sens, pw_error *error) {
  int count = 0;
  while (sens->of[count]) count++;
  int status = pw_unknown_run_open (&sens->base, &sens->unknowns, sens->at, error);
  if (status == PW_OK) status = pw_outcomes_open (&sens->outcomes, sens->base.m.system, "--of", sens->of, count, error);
  if (status == PW_OK) status = sensitivity_ledger (sens, error);
  if (status == PW_OK)
    status = pw_unknowns_directions (sens->direction, &sens->unknowns, sens->at, &sens->base, sens->near, error);
  for (int p = 0; p < sens->unknowns.count; p++) sens->direction[p].no_error = sens->no_error;
  return status == PW_OK && !sens->no_error ? sensitivity_independent (sens, error) : status;
}

int pw_sensitivity_start (pw_sensitivity *sens, pw_error *error) {
  int status = sensitivity_runs (sens, error);
  if (status == PW_OK) status = sensitivity_arrays (sens, error);
  if (status == PW_OK) status = sensitivity_sampled (sens, error);
  pw_limit_start (&sens->limit);
  if (status != PW_OK) return status;
  sens->variation =
      pw_variation_open (sens->base.run, sens->direction, sens->unknowns.count, sens->outcomes.ledger, error);
  return sens->variation ? PW_OK : error->status;
}

int pw_sensitivity_compute (pw_sensitivity *sens, pw_progress *progress, pw_error *error) {
  int status = pw_sensitivity_start (sens, error);
  if (status == PW_OK) status = sensitivity_functionals (sens, error);
  return status == PW_OK ? sensitivity_integrate (sens, progress, error) : status;
}

void pw_sensitivity_close (pw_sensitivity *sens) {
  pw_variation_close (sens->variation);
  pw_run_close (sens->sampled);
  if (sens->outcomes.system) pw_outcomes_close (&sens->outcomes);
  for (int i = 0; sens->near && i < 4 * sens->unknowns.count; i++) pw_unknown_run_close (&sens->near[i]);
  pw_unknown_run_close (&sens->base);
  free (sens->near);
  free (sens->direction);
  free (sens->at);
  free (sens->value);
  free (sens->row);
}
