/* Conditions on states at which signals jump or have kinks: comparisons, abs, floor and others (evaluation.c).  Their
 * switching functions are negative on the side of a condition that is fixed, and positive beyond.
 *
 * In a step all sides are fixed.  Accelerations are then smooth and the method keeps its order, even if stages lie
 * beyond a condition.  After the step the first root is located in the dense output.  The state there becomes the state
 * reached, the sides are fixed anew, and the method restarts.  If accelerations on both sides lead back to the
 * condition, the motion could only slide along it (Filippov 1988, Differential Equations with Discontinuous Righthand
 * Sides): the run stops. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "crossing.h"
#include "events.h"
#include "util.h"

#define SIDES_SLIDE 1e-9      /* [T] a condition that would return to its root within this time slides along it */
#define SIDES_DIFFERENCE 1e-6 /* of the step, for rates of switching functions by forward differences */
#define SIDES_ROUND_OFF 1e-10 /* of the size of a condition of an output, below which it keeps its side */

/* ---- Values ---- */

/* The switching functions at the state reached, and their rates there. */
static void sides_evaluate_rates (pw_run *r, double h, double *beyond, double *rate) {
  const double s = SIDES_DIFFERENCE * h, t = pw_before_breakpoint (r, r->t);
  double *q = r->scratch, *v = q + r->s->coords + 3;
  pw_run_evaluate_sides (r, t, r->q, r->v, beyond);
  for (int j = 0; j < r->s->coords; j++) q[j] = r->q[j] + s * r->v[j], v[j] = r->v[j] + s * r->a[j];
  pw_run_evaluate_sides (r, t + s, q, v, rate);
  for (int i = 0; i < r->sides->count; i++) rate[i] = (rate[i] - beyond[i]) / s;
}

/* Errors of the method in condition i of an output. */
static double sides_small (const pw_run *r, int i) {
  return fmax (SIDES_ROUND_OFF, r->fixed_steps ? 0 : r->settings.rtol) * r->sides->size[i];
}

/* pw_crossing_search.at.  Keeps the earliest sample beyond a side.  It must not be computed again: methods interpolate
 * between samples (rk.c), so that a second one at its time may differ by the tolerance. */
static int sides_at (void *context, double t, double *value, pw_error *error) {
  pw_run *r = context;
  pw_sides *x = r->sides;
  const pw_statistics statistics = r->statistics;
  const int near_singular = r->near_singular, status = r->method->at (r, t, error);
  r->statistics = statistics, r->near_singular = near_singular;
  if (status != PW_OK) return status;
  pw_run_evaluate_sides (r, t, r->q_at, r->v_at, value);
  int beyond = 0;
  for (int i = 0; i < x->count; i++) {
    if (x->start[i] == -INFINITY && !(value[i] > sides_small (r, i))) value[i] = -INFINITY;
    beyond |= value[i] > 0;
  }
  if (!beyond || !(t < x->found.t)) return PW_OK;
  x->found.t = t, x->found.projected = r->projected_at;
  memcpy (x->found.q, r->q_at, pw_state_length (r->s) * sizeof *r->q);
  memcpy (x->found.ledger, r->ledger_at, (size_t)r->entries * sizeof *r->ledger);
  memcpy (x->now, value, (size_t)x->count * sizeof *value);
  return PW_OK;
}

/* ---- Steps ---- */

/* The signal that has condition i. */
static const pw_source *sides_source (const pw_run *r, int i) {
  const pw_source *x = r->w->source;
  for (;; x++) {
    if (!pw_source_has_conditions (x)) continue;
    i -= x->signal.function.sides (x->signal.function.context, 0, NULL, r->sides->now);
    if (i < 0) return x;
  }
}

static int sides_fail (pw_run *r, int i, pw_error *error) {
  char signal[PW_NAME_BYTES];
  r->w->failed = sides_source (r, i);
  pw_failed_signal (r->w, signal, sizeof signal);
  r->w->failed = NULL;
  return pw_fail (
      error, PW_METHOD,
      "t = %.6g s: %s: on both sides of a condition it leads back to it, so that the motion slides along it "
      "in infinitely many steps; use friction or sliding-friction, which stick, or a smooth function, such "
      "as tanh (x/0.001) in place of sign (x)",
      r->t, signal);
}

int pw_sides_begin (pw_run *r, pw_error *error) {
  pw_sides *x = r->sides;
  const double T = r->w->scale.time;
  if (!x->fixed) pw_run_fix_sides (r);
  sides_evaluate_rates (r, x->h > 0 ? x->h : 1e-3 * T, x->start, x->start_rate);
  for (int i = 0; i < x->signals; i++)
    if (x->changed[i] && x->start_rate[i] > 0 && -x->start[i] < SIDES_SLIDE * T * x->start_rate[i])
      return sides_fail (r, i, error);
  memset (x->changed, 0, (size_t)x->count);
  return PW_OK;
}

/* 1 if no cubic of the end values and rates comes near 0: `bend` is four times its deviation from the chord or more. */
static int sides_far (const pw_run *r, double h) {
  const pw_sides *x = r->sides;
  for (int i = 0; i < x->count; i++) {
    const int small = x->start[i] == -INFINITY;
    const double chord = small ? 0 : x->end[i] - x->start[i], most = fmax (x->start[i], x->end[i]);
    const double bend = fabs (h * x->start_rate[i] - chord) + fabs (h * x->end_rate[i] - chord);
    if (!((small ? -sides_small (r, i) : most) + bend < 0)) return 0;
  }
  return 1;
}

/* Passes over conditions of outputs that are 0 at both ends of the step but for errors of the method, unless a sample
 * between them exceeds these errors. */
static void sides_skip (pw_run *r) {
  pw_sides *x = r->sides;
  for (int i = x->signals; i < x->count; i++) {
    if (isfinite (x->end[i])) x->size[i] = fmax (x->size[i], fabs (x->end[i]));
    if (fmax (fabs (x->start[i]), fabs (x->end[i])) < sides_small (r, i)) x->start[i] = x->end[i] = -INFINITY;
  }
}

/* Makes the earliest sample beyond a side the state reached, unless that is the end of the step. */
static void sides_stop (pw_run *r) {
  pw_sides *x = r->sides;
  const double *beyond = x->found.t < r->t ? x->now : x->end;
  for (int i = 0; i < x->count; i++) x->changed[i] = beyond[i] > 0;
  r->interrupted = 1;
  r->statistics.conditions++;
  if (!(x->found.t < r->t)) return;
  memcpy (r->q, x->found.q, pw_state_length (r->s) * sizeof *r->q);
  memcpy (r->ledger, x->found.ledger, (size_t)r->entries * sizeof *r->ledger);
  r->projected = x->found.projected, r->t = x->found.t;
  if (r->events && !r->method->locates_no_events) pw_events_forget (r);
}

int pw_sides_follow (pw_run *r, double t0, pw_error *error) {
  pw_sides *x = r->sides;
  pw_crossing_search search = { .count = x->count,
                                .at = sides_at,
                                .context = r,
                                .memory = x->memory,
                                .width = 4 * DBL_EPSILON * fmax (fabs (r->t), r->w->scale.time),
                                .error = error };
  x->h = r->t - t0;
  sides_evaluate_rates (r, x->h, x->end, x->end_rate);
  sides_skip (r);
  if (sides_far (r, x->h)) return PW_OK;
  x->found.t = INFINITY;
  const double root = pw_first_crossing (&search, t0, x->start, r->t, x->end);
  if (search.status != PW_OK) return search.status;
  if (!isnan (root)) sides_stop (r);
  pw_forget_residuals (r); /* the search has evaluated other states */
  if (pw_evaluate_J_at (r->w, pw_before_breakpoint (r, r->t), r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  if (r->t == x->found.t) pw_ledger_rates (r, r->lambda, r->rate);
  return PW_OK;
}

/* ---- Opening ---- */

/* Adds a function that has conditions, unless there is no room yet; reads: states that it reads. */
static void sides_add (pw_sides *x, const pw_function *function, int reads, const int *state) {
  if (x->of)
    x->of[x->functions] = (pw_source){ { PW_FUNCTION, .function = *function }, .reads = reads, .state = state };
  x->functions++;
  x->count += function->sides (function->context, 0, NULL, NULL);
}

/* Lists the functions that have conditions: signals; with integrals, outputs that are functions of states and time.
 * Stores the indices of their states in `state` unless it is NULL. */
static void sides_list (pw_run *r, pw_sides *x, int *state) {
  const pw_compiled_output *o = r->w->output;
  x->functions = x->count = 0;
  for (const pw_source *of = r->w->source; of < r->w->source + r->s->sources; of++)
    if (pw_source_has_conditions (of)) sides_add (x, &of->signal.function, of->reads, of->state);
  x->signals = x->count;
  for (; r->settings.integrals > 0 && o < r->w->output + r->s->outputs; o++) {
    if (!o->function.sides || o->types & ~(1u << PW_COLUMN_STATE)) continue;
    for (int k = 0; state && k < o->reads; k++) state[k] = o->read[k].index;
    sides_add (x, &o->function, o->reads, state);
    if (state) state += o->reads;
  }
}

int pw_sides_open (pw_run *r, pw_error *error) {
  const size_t states = pw_state_length (r->s);
  pw_sides list = { 0 }, *x;
  int *state;
  sides_list (r, &list, NULL);
  const int count = list.count, reads = PW_OUTPUT_READS + 2 * r->s->coords;
  if (count == 0) return PW_OK;
  x = r->sides = pw_arena_alloc (&r->arena, sizeof *x);
  if (x == NULL ||
      !PW_ARENA_ARRAYS (&r->arena, PW_ARRAY (x->start, count), PW_ARRAY (x->end, count),
                        PW_ARRAY (x->start_rate, count), PW_ARRAY (x->end_rate, count), PW_ARRAY (x->now, count),
                        PW_ARRAY (x->size, count), PW_ARRAY (x->memory, (PW_CROSSING_DEPTH + 2) * count),
                        PW_ARRAY (x->read, reads), PW_ARRAY (x->state, 2 * r->s->coords), PW_ARRAY (x->found.q, states),
                        PW_ARRAY (x->found.ledger, r->entries), PW_ARRAY (x->of, list.functions),
                        PW_ARRAY (state, PW_OUTPUT_READS * list.functions), PW_ARRAY (x->changed, count)))
    return r->sides = NULL, pw_fail_memory (r->s, error);
  sides_list (r, x, state);
  double *q = r->scratch, *v = q + r->s->coords;
  for (int j = 0; j < r->s->coords; j++) { /* by different changes, so that differences of states have a size, too */
    const double part = 2 + cos (j);
    q[j] = r->q[j] + part * pw_unit (r->s, j), v[j] = part * pw_velocity_unit (r, j, 0);
  }
  pw_run_evaluate_sides (r, r->t, q, v, NULL);
  pw_run_evaluate_sides (r, r->t, q, v, x->size);
  for (int i = 0; i < count; i++) x->size[i] = isfinite (x->size[i]) ? fabs (x->size[i]) : 0;
  pw_run_free_sides (r);
  return PW_OK;
}
