/* The search for relative periodic motions, and their branches; equations in periodic_equations.c. */
#include "periodic_parts.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "util.h"

enum {
  PERIODIC_MAX_COORDINATES = 100, /* since the cost is cubic */
  PERIODIC_POINTS = 20,           /* of a branch, by default */
  PERIODIC_MAX_POINTS = 50        /* of a branch, as a multiple of those that the settings ask for */
};
static const double PERIODIC_EXACT = 1e-9, /* largest residual of a solution, in units of the scene */
    PERIODIC_RANK = 1e-7,                  /* smaller singular values of the derivatives count as 0 */
    PERIODIC_CIRCLE = 1e-6,                /* distance from the unit circle that is not round-off */
    PERIODIC_MIN_STEP = 1e-5,              /* in scaled unknowns; the range of the parameter is 1 */
    PERIODIC_EVENT = 1e-7,                 /* accuracy of events, relative to the step */
    PERIODIC_REAL = 1e-3;                  /* imaginary part, after location, of a pair that is about to become real */

/* pw_branch_problem.same: up to symmetries, but not up to a shift in time. */
static int periodic_same (void *periodic, const double *u, const double *other) {
  pw_periodic *x = periodic;
  for (int j = 0; j < 2 * x->n; j++) {
    x->state[j] = u[j] * pw_periodic_unit (x, j);
    x->change[j] = other[j] * pw_periodic_unit (x, j);
  }
  return pw_steady_distance (x->steady, x->state, x->state + x->n, x->change, x->change + x->n) <= PW_BRANCH_SAME;
}

/* ---- Opening ---- */

static int periodic_arrays (pw_periodic *x) {
  size_t n = (size_t)x->n, states = 2 * n, all = states + (size_t)x->symmetries + 2; /* of u */
  const pw_array array[] = {
    { &x->u, all },
    { &x->y0, states },
    { &x->y1, states },
    { &x->a0, n },
    { &x->a1, n },
    { &x->state, states },
    { &x->change, states },
    { &x->Phi, states * states },
    { &x->basis, states * states },
    { &x->dual, states * states },
    { &x->monodromy, (2 * states + 1 + PW_PERIODIC_WORK) * states },
    { &x->re, states },
    { &x->im, states },
    { &x->work, (size_t)pw_steady_rate_count (x->s) + all },
  };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  return x->memory ? PW_OK : PW_RESOURCE;
}

/* The period of the signals where the range of the parameter begins, or if none has one there, where their amplitudes
 * may be 0, within the range; 0 without one.  Sets x->last_period to `periods` of these. */
static int periodic_signal_period (pw_periodic *x, double *period) {
  const double value[] = { x->settings.first, pw_value_within (x->settings.first, x->settings.last) };
  *period = 0;
  for (int i = 0; i < 2 && *period == 0; i++) {
    const pw_system *s = pw_periodic_system (x, value[i]);
    if (s == NULL && i > 0 && x->why.status != PW_RESOURCE) return x->why = (pw_error){ 0 }, PW_OK;
    if (s == NULL) return x->why.status;
    *period = pw_system_period (s);
  }
  if (!(*period >= 0)) *period = 0;
  x->last_period = x->settings.periods * *period;
  return PW_OK;
}

static int periodic_check_settings (const pw_periodic_settings *set, pw_error *error) {
  if (!isfinite (set->rtol) || set->rtol < 0) /* 0 selects the default, here and below */
    return pw_fail (error, PW_INPUT, "setting rtol = %g: expected a number > 0", set->rtol);
  if (!isfinite (set->period) || set->period < 0)
    return pw_fail (error, PW_INPUT, "setting period = %g: expected a number > 0", set->period);
  if (set->periods < 0) return pw_fail (error, PW_INPUT, "setting periods = %d: expected a number > 0", set->periods);
  return pw_check_search (set->first, set->last, set->points, error);
}

static int periodic_open (pw_periodic *x, pw_error *error) {
  const pw_system *s = x->s;
  const pw_method *integrator;
  int stabilisation;
  if (pw_method_parse (x->settings.method, &integrator, &stabilisation, error) != PW_OK) return error->status;
  if (!pw_method_adaptive (integrator, x->settings.method))
    return pw_fail (error, PW_INPUT,
                    "method %s: periodic motions need one that controls its steps, such as erk8+projection",
                    x->settings.method);
  if (x->n > PERIODIC_MAX_COORDINATES)
    return pw_fail (error, PW_INPUT, "model %s has %d coordinates; periodic motions are sought with at most %d",
                    s->model, x->n, PERIODIC_MAX_COORDINATES);
  double period = x->settings.period;
  if (period == 0 && !x->settings.free && periodic_signal_period (x, &period) != PW_OK)
    return pw_fail (error, x->why.status, "%s", x->why.text);
  /* At a time at which no signal is likely to vanish: then the system would have more symmetries. */
  const pw_steady_settings settings = { .t = x->settings.t + 0.317 * period,
                                        .span = period > 0 ? period : 1,
                                        .first = x->settings.first,
                                        .last = x->settings.last,
                                        .vary = -1,
                                        .compile = x->settings.compile,
                                        .context = x->settings.context };
  x->steady = pw_steady_open_symmetries (s, &settings, error);
  if (x->steady == NULL) return error->status;
  x->symmetries = x->steady->free_symmetries = x->steady->symmetries, x->L = x->steady->L, x->T = x->steady->T;
  const pw_branch_problem problem = { .unknowns = pw_periodic_unknowns (x),
                                      .equations = pw_periodic_unknowns (x) + 2 * x->n,
                                      .tolerance = PERIODIC_EXACT,
                                      .rank_tolerance = PERIODIC_RANK,
                                      .evaluate = pw_periodic_evaluate,
                                      .same = periodic_same,
                                      .context = x };
  if (periodic_arrays (x) != PW_OK) return pw_fail_memory (s, error);
  int status = pw_branch_open (&x->branch, &problem, error);
  if (status != PW_OK) return status;
  pw_run *r = pw_periodic_run (x, x->settings.first, 0, NULL); /* verifies the signals */
  if (r == NULL) return pw_fail (error, x->why.status, "%s", x->why.text);
  pw_run_close (r);
  return PW_OK;
}

pw_periodic *pw_periodic_open (const pw_system *s, const pw_periodic_settings *settings, pw_error *error) {
  pw_error ignored = { 0 };
  if (error == NULL) error = &ignored;
  if (pw_require (s, "a system", error) != PW_OK || pw_require (settings, "settings", error) != PW_OK) return NULL;
  if (periodic_check_settings (settings, error) != PW_OK) return NULL;
  pw_periodic *x = calloc (1, sizeof *x);
  if (x == NULL) return pw_fail_memory (s, error), NULL;
  x->s = s, x->settings = *settings, x->n = s->coords;
  if (x->settings.method == NULL) x->settings.method = "erk8+projection";
  if (x->settings.rtol == 0) x->settings.rtol = 1e-12;
  if (x->settings.points == 0) x->settings.points = PERIODIC_POINTS;
  if (x->settings.periods == 0) x->settings.periods = 1;
  if (periodic_open (x, error) == PW_OK) return x;
  pw_periodic_close (x);
  return NULL;
}

void pw_periodic_close (pw_periodic *x) {
  if (x == NULL) return;
  pw_system_free (x->system.own);
  pw_branch_close (&x->branch);
  pw_steady_close (x->steady);
  free (x->memory);
  free (x);
}

const char *pw_periodic_reason (const pw_periodic *x) {
  return x ? x->why.text : "";
}

int pw_periodic_symmetries (const pw_periodic *x) {
  return x ? x->symmetries : 0;
}

/* ---- Motions ---- */

/* PW_RETRY if forces depend on the number of whole turns of a body: then the accelerations do not repeat. */
static int periodic_turns (pw_periodic *x) {
  double off = 0, most = 0;
  int turns = 0;
  for (int j = 0; j < x->n; j++) {
    double unit = pw_unit (x->s, j);
    if (fabs (pw_periodic_difference (x, j, x->y1[j], x->y0[j]) - (x->y1[j] - x->y0[j])) > PW_PI) turns = 1;
    off = fmax (off, fabs (x->a1[j] - x->a0[j]) / unit);
    most = fmax (most, fabs (x->a1[j]) / unit);
  }
  if (turns == 0 || off <= PERIODIC_CIRCLE * fmax (most, 1 / (x->T * x->T))) return PW_OK;
  pw_fail (&x->why, PW_METHOD, "bodies make whole turns in a period, on whose number forces depend");
  return PW_RETRY;
}

/* The motion of u, with its multipliers. */
static int periodic_orbit (pw_periodic *x, const double *u, pw_periodic_orbit *out, pw_error *error) {
  int status = pw_periodic_flow (x, u, PW_FLOW_MULTIPLIERS, error);
  if (status == PW_OK) status = pw_periodic_multipliers (x, u, &out->trivial);
  if (status == PW_METHOD) return pw_fail (error, status, "model %s: no multipliers: LAPACK failed", x->s->model);
  out->rotation = x->work[PW_RATE_TURN]; /* the multipliers have set x->work */
  if (status == PW_OK) status = pw_periodic_flow (x, u, PW_FLOW, error);
  if (status == PW_OK) status = periodic_turns (x);
  if (status != PW_OK) return status;
  out->parameter = pw_periodic_parameter (x, u);
  out->period = x->last_period = x->settings.free ? u[pw_periodic_unknowns (x) - 1] * x->T : x->system.period;
  out->q = x->y0, out->v = x->y0 + x->n, out->end = x->y1;
  out->multipliers = x->size;
  out->re = x->re, out->im = x->im;
  out->unstable = 0;
  for (int i = 0; i < x->size - out->trivial; i++) out->unstable += hypot (x->re[i], x->im[i]) > 1 + PERIODIC_CIRCLE;
  return PW_OK;
}

/* Sets x->u to the unknowns at x->state. */
static void periodic_set_unknowns (pw_periodic *x, double parameter) {
  int unknowns = pw_periodic_unknowns (x);
  memset (x->u, 0, ((size_t)unknowns + 1) * sizeof *x->u);
  for (int j = 0; j < 2 * x->n; j++) x->u[j] = x->state[j] / pw_periodic_unit (x, j);
  if (x->settings.free) x->u[unknowns - 1] = x->last_period / x->T;
  if (x->settings.last != x->settings.first)
    x->u[unknowns] = (parameter - x->settings.first) / (x->settings.last - x->settings.first);
}

int pw_periodic_solve (pw_periodic *x, int settle, double parameter, pw_periodic_orbit *out, pw_error *error) {
  *out = (pw_periodic_orbit){ .residual = INFINITY };
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  x->begin_period = 0;
  if (settle < 0) return pw_fail (error, PW_INPUT, "settle = %d: expected a number >= 0", settle);
  if (pw_check_parameter (parameter, error) != PW_OK) return PW_INPUT;
  if (x->settings.free) x->last_period = x->settings.period > 0 ? x->settings.period : 2 * PW_PI * x->T;
  int status = pw_periodic_settle (x, parameter, settle);
  if (status < 0) return pw_fail (error, status, "%s", x->why.text);
  if (status != PW_OK) return status;
  periodic_set_unknowns (x, parameter);
  x->steps = 0;
  status = pw_periodic_guess_displacement (x, x->u, error);
  if (status != PW_OK) return status;
  status = pw_branch_solve (&x->branch, x->u, error);
  if (status == PW_OK) status = periodic_orbit (x, x->u, out, error);
  if (status == PW_OK) x->begin_period = out->period;
  out->residual = x->branch.residual;
  out->iterations = x->branch.iterations;
  return status;
}

/* ---- Branches ---- */

int pw_periodic_follow (pw_periodic *x, int direction, pw_error *error) {
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  pw_branch_end (&x->branch);
  if (pw_check_branch (direction, x->settings.first, x->settings.last, error) != PW_OK) return PW_INPUT;
  if (!(x->begin_period > 0))
    return pw_fail (error, PW_INPUT, "no motion has been found from which to follow a branch");
  x->last_period = x->begin_period, x->steps = 0;
  pw_branch *b = &x->branch;
  b->max_change = 1.0 / x->settings.points, b->step = b->max_change / 4, b->min_step = PERIODIC_MIN_STEP;
  b->event_accuracy = PERIODIC_EVENT, b->max_points = PERIODIC_MAX_POINTS * x->settings.points;
  x->unstable = -1;
  int status = pw_branch_start (b, x->u, direction, error);
  return status == PW_RETRY ? pw_fail (error, PW_METHOD, "the branch cannot be followed from here") : status;
}

/* pw_branch_test: the distance of multiplier number `sought` from the unit circle, positive outside; if it moves on the
 * circle before it leaves it, +-1. */
static int periodic_test (void *periodic, const pw_branch_point *point, double *value, pw_error *error) {
  pw_periodic *x = periodic;
  pw_periodic_orbit o;
  int status = periodic_orbit (x, point->u, &o, error);
  *value = hypot (x->re[x->sought], x->im[x->sought]) - 1;
  if (x->on_circle) *value = *value > PERIODIC_CIRCLE ? 1 : -1;
  return status;
}

/* pw_branch_locate_mode: where a multiplier crosses the unit circle. */
static int periodic_crossing (void *periodic, int mode, int change, int *event, int *modes, pw_error *error) {
  pw_periodic *x = periodic;
  pw_branch *b = &x->branch;
  double value;
  x->sought = mode, x->on_circle = 0;
  int status = periodic_test (x, change < 0 ? &b->reached : &b->previous, &value, error); /* not outside the circle */
  x->on_circle = fabs (value) < PERIODIC_CIRCLE;
  if (status == PW_OK) status = pw_branch_locate (b, periodic_test, x, error);
  if (status == PW_OK) status = periodic_test (x, &b->found, &value, error);
  *event = fabs (x->im[mode]) > PERIODIC_REAL ? PW_PERIODIC_TORUS
           : x->re[mode] > 0                  ? PW_PERIODIC_REAL
                                              : PW_PERIODIC_FLIP;
  *modes = *event == PW_PERIODIC_TORUS ? 2 : 1;
  return status;
}

/* pw_branch_find_events: multipliers that cross the unit circle. */
static int periodic_events (void *periodic, pw_error *error) {
  pw_periodic *x = periodic;
  pw_periodic_orbit o;
  int before = x->unstable, status = periodic_orbit (x, x->branch.reached.u, &o, error);
  if (status != PW_OK) return status;
  x->unstable = o.unstable;
  return before < 0 ? PW_OK : pw_branch_find_changes (&x->branch, before, o.unstable, periodic_crossing, error);
}

int pw_periodic_next (pw_periodic *x, pw_periodic_orbit *out, pw_error *error) {
  *out = (pw_periodic_orbit){ .event = PW_PERIODIC_END };
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  const pw_branch_event *next;
  int status = pw_branch_next (&x->branch, periodic_events, &x->why, &next, error);
  if (next == NULL) return status;
  status = periodic_orbit (x, next->point.u, out, error);
  if (status != PW_OK) return status;
  if (x->unstable < 0) x->unstable = out->unstable;
  out->event = (pw_periodic_event)next->event;
  out->iterations = x->branch.iterations;
  out->residual = next->point.residual;
  return status;
}
