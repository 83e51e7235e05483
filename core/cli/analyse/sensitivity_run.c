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

int pw_sensitivity_in_table (const pw_sensitivity *x, int output) {
  const pw_outcome *o = &x->outcomes.outcome[output];
  for (int i = 0; i < o->terms; i++)
    if (x->outcomes.functional[o->term[i]].type != PW_FINAL) return 0;
  return 1;
}

double pw_sensitivity_derivative (const pw_sensitivity *x, int output, int unknown, const double *slope) {
  const pw_outcome *o = &x->outcomes.outcome[output];
  double *gradient = x->value + x->outcomes.functionals, sum = 0;
  pw_outcome_value (&x->outcomes, output, gradient);
  for (int i = 0; i < o->terms; i++) sum += gradient[o->term[i]] * slope[o->term[i] * x->unknowns.count + unknown];
  return sum;
}

/* ---- Columns at a time ---- */

/* Coordinate `index` of the contact points in a workspace's system, at the positions q + by dq. */
static int sensitivity_contact (const pw_sensitivity *x, pw_workspace *w, int index, const pw_sample *s,
                                const double *dq, double by, double *value, pw_error *error) {
  const pw_system *system = x->base.m.system;
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
static int sensitivity_contact_slope (const pw_sensitivity *x, int unknown, int index, const pw_sample *s,
                                      const double *dq, const double *eq, double *slope, double *error_of,
                                      pw_error *error) {
  const pw_direction *d = &x->direction[unknown];
  double value = 0;
  int status = PW_OK;
  *slope = *error_of = 0;
  for (int k = 0; k < 4 && status == PW_OK; k++) {
    pw_unknown_run *near = &x->near[4 * unknown + k];
    if (near->workspace == NULL) near->workspace = pw_workspace_new (near->m.system, error);
    if (near->workspace == NULL) return error->status;
    status = sensitivity_contact (x, near->workspace, index, s, dq, pw_direction_offset (d, k), &value, error);
    *slope += pw_direction_weight (d, 0, k) * value;
    *error_of += pw_direction_weight (d, 1, k) * value;
  }
  for (int side = -1; side <= 1 && status == PW_OK; side += 2) {
    status = sensitivity_contact (x, x->outcomes.workspace, index, s, eq, side, &value, error);
    *error_of += side * value / 2;
  }
  return status;
}

/* A sample of the run at a time that the derivatives have reached. */
static int sensitivity_sample (pw_sensitivity *x, double t, pw_sample *s, pw_error *error) {
  int status = x->sampled ? pw_run_advance_to (x->sampled, t, x->unknowns.t_end, error) : PW_OK;
  return status == PW_OK ? pw_run_sample (x->sampled ? x->sampled : x->base.run, t, s, error) : status;
}

int pw_sensitivity_at (pw_sensitivity *x, double t, pw_error *error) {
  pw_sample s, d, e;
  int status = pw_variation_advance (x->variation, t, x->unknowns.t_end, error), P = x->unknowns.count;
  if (status == PW_OK) status = sensitivity_sample (x, t, &s, error);
  if (status == PW_OK) status = pw_outcomes_read (&x->outcomes, &s, x->value, error);
  for (int p = 0; p < P && status == PW_OK; p++) {
    status = pw_variation_sample (x->variation, p, &d, &e, error);
    for (int i = 0; i < x->outcomes.functionals && status == PW_OK; i++) {
      pw_column c = x->outcomes.functional[i].column;
      d.t = e.t = 0; /* the column t does not depend on anything */
      x->slope[i * P + p] = pw_column_value (x->base.m.system, c, &d);
      x->error[i * P + p] = pw_column_value (x->base.m.system, c, &e);
      if (c.type == PW_COLUMN_CONTACT)
        status =
            sensitivity_contact_slope (x, p, c.index, &s, d.q, e.q, &x->slope[i * P + p], &x->error[i * P + p], error);
    }
  }
  return status;
}

/* ---- Functionals ---- */

/* Relative difference of derivatives before and after a jump that are the same. */
static const double SENSITIVITY_SAME = 1e-5;

/* Adds the current columns to the integrals, with a weight. */
static void sensitivity_add (pw_sensitivity *x, double weight) {
  for (int i = 0; i < x->outcomes.functionals; i++) {
    const pw_functional *f = &x->outcomes.functional[i];
    double factor = f->type == PW_INTEGRAL ? weight : weight / x->unknowns.t_end;
    if (!pw_is_integral (f->type)) continue;
    if (f->type == PW_RMS) factor *= f->value > 0 ? x->value[i] / f->value : 0;
    for (int p = i * x->unknowns.count; p < (i + 1) * x->unknowns.count; p++) {
      x->end_slope[p] += factor * x->slope[p];
      x->end_error[p] += factor * x->error[p];
    }
  }
}

/* The derivative of the time of the next breakpoint, or of the last breakpoint or jump that has been passed. */
static double sensitivity_moves (const pw_sensitivity *x, int unknown, int passed) {
  double slope;
  if (passed) return pw_variation_jump_slope (x->variation, unknown);
  pw_variation_breakpoint (x->variation, unknown, &slope);
  return slope;
}

/* Keeps the current derivatives of functional i that exist. */
static void sensitivity_keep (pw_sensitivity *x, int i) {
  for (int at = i * x->unknowns.count; at < (i + 1) * x->unknowns.count; at++)
    if (!isnan (x->end_slope[at])) x->end_slope[at] = x->slope[at], x->end_error[at] = x->error[at];
}

/* Keeps those of an extremum; at a breakpoint that moves, and just after it, they do not exist.  reached: 1 if the
 * extremum is at a breakpoint that is not passed yet. */
static void sensitivity_keep_extremum (pw_sensitivity *x, int i, int reached) {
  const pw_functional *f = &x->outcomes.functional[i];
  double slope, next = pw_variation_breakpoint (x->variation, 0, &slope);
  int before = reached || fabs (f->t - next) < 1e-9 * (1 + fabs (next)),
      after = f->t - x->passed <= 2 * PW_FUNCTIONAL_INSET * f->step;
  sensitivity_keep (x, i);
  for (int p = 0; p < x->unknowns.count && (before || after); p++)
    if (sensitivity_moves (x, p, !before) != 0) x->end_slope[i * x->unknowns.count + p] = NAN;
}

/* Drops derivatives of extrema in the step of the run that passes a jump with the state at t, if those of the column
 * jump there from `before`: they do not exist. */
static void sensitivity_drop (pw_sensitivity *x, double t, const double *before) {
  for (int i = 0; i < x->outcomes.functionals; i++) {
    const pw_functional *f = &x->outcomes.functional[i];
    for (int at = i * x->unknowns.count; at < (i + 1) * x->unknowns.count && pw_is_extremum (f->type); at++)
      if (fabs (f->t - t) <= f->step && fabs (x->slope[at] - before[at]) > SENSITIVITY_SAME * fabs (before[at]))
        x->end_slope[at] = NAN;
  }
}

/* Row of the table: time, then each output that has columns, with its derivatives. */
static int sensitivity_row (pw_sensitivity *x, double t, pw_error *error) {
  if (pw_grow (&x->row, (size_t)x->rows, &x->room, (size_t)x->columns * sizeof *x->row) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  double *out = x->row + (size_t)x->rows++ * (size_t)x->columns;
  *out++ = t;
  for (int i = 0; i < x->outcomes.functionals; i++)
    if (x->outcomes.functional[i].type == PW_FINAL) x->outcomes.functional[i].value = x->value[i];
  for (int o = 0; o < x->outcomes.outcomes; o++) {
    if (!pw_sensitivity_in_table (x, o)) continue;
    *out++ = pw_outcome_value (&x->outcomes, o, NULL);
    for (int p = 0; p < x->unknowns.count; p++) *out++ = pw_sensitivity_derivative (x, o, p, x->slope);
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
static int sensitivity_events (const pw_sensitivity *x, double t0, double t1, sensitivity_event *list) {
  int count = 0, integrals = 0;
  for (int i = 0; i < x->outcomes.functionals; i++) {
    const pw_functional *f = &x->outcomes.functional[i];
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
static int sensitivity_interval (pw_sensitivity *x, double t0, double t1, sensitivity_event *list, pw_error *error) {
  int count = sensitivity_events (x, t0, t1, list), status = PW_OK;
  for (int i = 0; i < count && status == PW_OK; i++) {
    double t = list[i].t;
    status = pw_sensitivity_at (x, t, error);
    if (status != PW_OK) break;
    if (list[i].extremum < 0)
      sensitivity_add (x, list[i].weight);
    else
      sensitivity_keep_extremum (x, list[i].extremum, 0);
  }
  return status == PW_OK ? pw_sensitivity_at (x, t1, error) : status;
}

/* Past a breakpoint t_b, or a jump with the state, from just before it.  The integral of a column that jumps there
 * from x- to x+ has the derivative (x- - x+) dt_b/dp.  A breakpoint at the end of the run is only reached. */
static int sensitivity_jump (pw_sensitivity *x, double t0, double t, int with_state, pw_error *error) {
  int passed = with_state || t > x->passed;
  size_t F = (size_t)x->outcomes.functionals, P = (size_t)x->unknowns.count;
  double *slope = x->before + F;
  memcpy (x->before, x->value, F * sizeof *x->before);
  memcpy (slope, x->slope, F * P * sizeof *slope);
  int status = pw_sensitivity_at (x, t, error);
  if (status == PW_OK && with_state) sensitivity_drop (x, t, slope);
  for (int i = 0; i < x->outcomes.functionals && status == PW_OK; i++) {
    const pw_functional *f = &x->outcomes.functional[i];
    double jump = x->before[i] - x->value[i];
    if (pw_is_extremum (f->type) && f->t > t0 && f->t <= t) sensitivity_keep_extremum (x, i, !passed);
    if (!pw_is_integral (f->type) || jump == 0) continue;
    if (f->type != PW_INTEGRAL) jump /= x->unknowns.t_end;
    if (f->type == PW_RMS) jump *= (x->before[i] + x->value[i]) / (2 * f->value);
    for (int p = 0; p < x->unknowns.count; p++)
      x->end_slope[i * x->unknowns.count + p] += jump * sensitivity_moves (x, p, passed);
  }
  return status;
}

/* The end of the next interval, in which derivatives are smooth, unless it ends at a jump.  *jump: 0, or 1 at a
 * breakpoint, 2 at a jump with the state.  NAN and the error. */
static double sensitivity_next (pw_sensitivity *x, double t, double to, int *jump, pw_error *error) {
  double slope, breakpoint = pw_variation_breakpoint (x->variation, 0, &slope);
  *jump = 0;
  if (!x->along) return fmin (to, breakpoint);
  double next = fmin (fmin (to, breakpoint), t + SENSITIVITY_STEPS * pw_variation_step_size (x->variation));
  double with_state = pw_variation_next_jump (x->variation, next, x->unknowns.t_end, error);
  if (isnan (with_state)) return NAN;
  *jump = with_state < next ? 2 : next == breakpoint;
  return fmin (next, with_state);
}

static int sensitivity_advance (pw_sensitivity *x, double t, double to, sensitivity_event *list, pw_progress *progress,
                                pw_error *error) {
  const double near =
      1e-9 * fmin (x->dt, x->unknowns.t_end / SENSITIVITY_PARTS); /* distance of states beside a jump from it */
  int jump, status = PW_OK;
  while (t < to && status == PW_OK) {
    double next = sensitivity_next (x, t, to, &jump, error);
    if (isnan (next)) return error->status;
    double end = jump ? next - fmin (near, next - t) : next;
    if (jump == 1) x->passed = next, next = fmin (next + near, x->unknowns.t_end);
    status = sensitivity_interval (x, t, end, list, error);
    if (status == PW_OK && jump) status = sensitivity_jump (x, end, next, jump == 2, error);
    pw_progress_at (progress, t = next);
  }
  return status;
}

static int sensitivity_along (pw_sensitivity *x, sensitivity_event *list, pw_progress *progress, pw_error *error) {
  double t = 0, to;
  x->passed = -INFINITY;
  int status = pw_sensitivity_at (x, 0, error);
  if (status == PW_OK) status = sensitivity_row (x, 0, error);
  for (int i = 0; i < x->outcomes.functionals && status == PW_OK; i++)
    if (pw_is_extremum (x->outcomes.functional[i].type)) sensitivity_keep (x, i);
  for (long k = 1; t < x->unknowns.t_end && status == PW_OK; k++, t = to) {
    to = (double)k * x->dt < x->unknowns.t_end * (1 - 1e-12) ? (double)k * x->dt : x->unknowns.t_end;
    status = sensitivity_advance (x, t, to, list, progress, error);
    if (status == PW_OK) status = sensitivity_row (x, to, error);
  }
  for (int i = 0; i < x->outcomes.functionals; i++)
    if (x->outcomes.functional[i].type == PW_FINAL) sensitivity_keep (x, i);
  return status;
}

static int sensitivity_integrate (pw_sensitivity *x, pw_progress *progress, pw_error *error) {
  sensitivity_event *list = malloc (((size_t)x->outcomes.functionals + PW_GAUSS_NODES) * sizeof *list);
  if (list == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = sensitivity_along (x, list, progress, error);
  free (list);
  x->stopped = status == PW_STOPPED;
  return x->stopped ? PW_OK : status;
}

/* ---- Opening ---- */

int pw_sensitivity_open (pw_sensitivity *x, const double *at, pw_error *error) {
  size_t P = (size_t)x->unknowns.count;
  if (x->dt == 0) x->dt = x->unknowns.t_end / SENSITIVITY_PARTS;
  x->limit.seconds = x->unknowns.limit;
  x->unknowns.settings.stop = pw_limit_over;
  x->unknowns.settings.stop_context = &x->limit;
  x->at = malloc (P * sizeof *x->at);
  x->near = calloc (4 * P, sizeof *x->near);
  x->direction = calloc (P, sizeof *x->direction);
  for (size_t p = 0; p < P && x->at; p++) x->at[p] = at ? at[p] : x->unknowns.list[p].value;
  return x->at && x->near && x->direction ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
}

static int sensitivity_arrays (pw_sensitivity *x, pw_error *error) {
  size_t F = (size_t)x->outcomes.functionals, P = (size_t)x->unknowns.count;
  x->value = calloc (3 * F + 5 * F * P + 1, sizeof *x->value);
  x->columns = 1;
  for (int o = 0; o < x->outcomes.outcomes; o++)
    if (pw_sensitivity_in_table (x, o)) x->columns += 1 + x->unknowns.count;
  if (x->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  x->slope = x->value + 2 * F, x->error = x->slope + F * P;
  x->end_slope = x->error + F * P, x->end_error = x->end_slope + F * P;
  x->before = x->end_error + F * P;
  return PW_OK;
}

/* Work and losses need a run with the ledger. */
static int sensitivity_ledger (pw_sensitivity *x, pw_error *error) {
  if (!x->outcomes.ledger) return PW_OK;
  x->unknowns.settings.ledger = 1;
  pw_run_close (x->base.run);
  x->base.run = pw_run_open (x->base.m.system, x->unknowns.method, &x->unknowns.settings, error);
  return x->base.run ? PW_OK : error->status;
}

/* The values of extrema and integrals, and the times of extrema, from a run of its own. */
static int sensitivity_functionals (pw_sensitivity *x, pw_error *error) {
  for (int i = 0; i < x->outcomes.functionals; i++) x->along |= x->outcomes.functional[i].type != PW_FINAL;
  return x->along ? pw_outcomes_run (&x->outcomes, x->unknowns.method, &x->unknowns.settings, x->unknowns.t_end, error)
                  : PW_OK;
}

/* The run of which samples are taken, where the derivatives' is ahead. */
static int sensitivity_sampled (pw_sensitivity *x, pw_error *error) {
  if (!pw_system_may_jump (x->base.m.system)) return PW_OK;
  x->sampled = pw_run_open (x->base.m.system, x->unknowns.method, &x->unknowns.settings, error);
  return x->sampled ? PW_OK : error->status;
}

/* Initial values can only change by themselves if the constraints permit it. */
static int sensitivity_independent (const pw_sensitivity *x, pw_error *error) {
  int n = pw_system_coordinates (x->base.m.system);
  for (int p = 0; p < x->unknowns.count; p++) {
    const pw_unknown *u = &x->unknowns.list[p];
    const pw_direction *d = &x->direction[p];
    if (u->state < 0) continue;
    const pw_initial_report *s = pw_run_initial (d->neighbour[0]);
    double value = u->state < n ? s->q[u->state] : s->v[u->state - n];
    if (fabs (value - x->at[p] - pw_direction_offset (d, 0)) > 1e-2 * fabs (d->step))
      return pw_fail (
          error, PW_INPUT,
          "--by %s: it cannot change while the other initial values of --by and --start are kept: constraints "
          "determine it",
          u->name);
  }
  return PW_OK;
}

/* The run and its neighbours. */
static int sensitivity_runs (pw_sensitivity *x, pw_error *error) {
  int count = 0;
  while (x->of[count]) count++;
  int status = pw_unknown_run_open (&x->base, &x->unknowns, x->at, error);
  if (status == PW_OK) status = pw_outcomes_open (&x->outcomes, x->base.m.system, "--of", x->of, count, error);
  if (status == PW_OK) status = sensitivity_ledger (x, error);
  if (status == PW_OK) status = pw_unknowns_directions (x->direction, &x->unknowns, x->at, &x->base, x->near, error);
  for (int p = 0; p < x->unknowns.count; p++) x->direction[p].no_error = x->no_error;
  return status == PW_OK && !x->no_error ? sensitivity_independent (x, error) : status;
}

int pw_sensitivity_start (pw_sensitivity *x, pw_error *error) {
  int status = sensitivity_runs (x, error);
  if (status == PW_OK) status = sensitivity_arrays (x, error);
  if (status == PW_OK) status = sensitivity_sampled (x, error);
  pw_limit_start (&x->limit);
  if (status != PW_OK) return status;
  x->variation = pw_variation_open (x->base.run, x->direction, x->unknowns.count, x->outcomes.ledger, error);
  return x->variation ? PW_OK : error->status;
}

int pw_sensitivity_compute (pw_sensitivity *x, pw_progress *progress, pw_error *error) {
  int status = pw_sensitivity_start (x, error);
  if (status == PW_OK) status = sensitivity_functionals (x, error);
  return status == PW_OK ? sensitivity_integrate (x, progress, error) : status;
}

void pw_sensitivity_close (pw_sensitivity *x) {
  pw_variation_close (x->variation);
  pw_run_close (x->sampled);
  if (x->outcomes.system) pw_outcomes_close (&x->outcomes);
  for (int i = 0; x->near && i < 4 * x->unknowns.count; i++) pw_unknown_run_close (&x->near[i]);
  pw_unknown_run_close (&x->base);
  free (x->near);
  free (x->direction);
  free (x->at);
  free (x->value);
  free (x->row);
}
