/* Events: the times at which the modes of constraint equations change (modes.c).
 *
 * An event is a root of a multiplier less a limit, or of u.  After each step it is sought in the dense output; the
 * state there becomes the state reached.  Before the next step the modes are decided and the method begins anew. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "crossing.h"
#include "decision.h"
#include "events.h"
#include "modes.h"
#include "rank.h"
#include "util.h"

#define EVENTS_ROUND_OFF 1e-14 /* of an event function that has been farther from its root: some tens of eps */
/* Longest first step after an event [T]: before it neither an error nor a bend of multipliers is known, and 1e-3 T
 * resolves what the scene's own time scale does. */
#define EVENTS_FIRST 1e-3
/* Of multipliers in a step [limits]: the parabolas by which roots are suspected then err by less than the distance of a
 * typical multiplier from its limit (events_longest). */
#define EVENTS_BEND 0.1
/* Distance of a multiplier [limits], or of u [units], from the boundary of a mode that is not round-off, nor that of
 * initial values with 6 digits. */
#define EVENTS_BOUNDARY 1e-6
#define EVENTS_STRAIGHT 40 /* bends by which a function increases in a step that surely has one root at most */
#define EVENTS_PARTED 1e-9 /* u [units] of an equation that no longer depends on those that hold: more than round-off */
enum { EVENTS_PASSES = 10 }; /* most decisions at one instant: each but the first follows from a root at that instant */
/* Most decisions in sequence that change no mode, each within EVENTS_IDLE_TIME [T] of the one before: u does not
 * leave 0, and round-off decides on its sign. */
enum { EVENTS_IDLE = 1000 };
#define EVENTS_IDLE_TIME 1e-4

static int events_allocate (pw_run *r) {
  const pw_system *s = r->s;
  const size_t n = (size_t)s->limited, rows = (size_t)s->rows, coords = (size_t)s->coords + 3;
  pw_events *x = r->events = pw_arena_alloc (&r->arena, sizeof *x);
  if (x == NULL) return PW_RESOURCE;
  r->events_memory = PW_ALLOC_ARRAYS (
      PW_ARRAY (x->limit, n), PW_ARRAY (x->force_unit, n), PW_ARRAY (x->unit, n), PW_ARRAY (x->u, n),
      PW_ARRAY (x->u_before, n), PW_ARRAY (x->impulse, n), PW_ARRAY (x->offset, n), PW_ARRAY (x->d.b, n),
      PW_ARRAY (x->d.x, n), PW_ARRAY (x->d.lo, n), PW_ARRAY (x->d.hi, n), PW_ARRAY (x->direction, n),
      PW_ARRAY (x->bias, n), PW_ARRAY (x->reach, n), PW_ARRAY (x->rate, n), PW_ARRAY (x->d.towards, n),
      PW_ARRAY (x->mean, n), PW_ARRAY (x->start, 2 * n), PW_ARRAY (x->end, 2 * n), PW_ARRAY (x->now, 2 * n),
      PW_ARRAY (x->previous, 2 * n), PW_ARRAY (x->mode, n), PW_ARRAY (x->before, n), PW_ARRAY (x->d.trial, n),
      PW_ARRAY (x->armed, n), PW_ARRAY (x->away, n), PW_ARRAY (x->triggered, n), PW_ARRAY (x->rests, n),
      PW_ARRAY (x->struck, n), PW_ARRAY (x->still, n), PW_ARRAY (x->d.blocked, n), PW_ARRAY (x->spare, n),
      PW_ARRAY (x->d.fixed, n), PW_ARRAY (x->d.redundant, n), PW_ARRAY (x->row, n), PW_ARRAY (x->d.list, n),
      PW_ARRAY (x->d.held, n), PW_ARRAY (x->partner, n), PW_ARRAY (x->place, n), PW_ARRAY (x->d.normal, n),
      PW_ARRAY (r->coupling, n), PW_ARRAY (r->coupling_memory, 2 * coords + rows + n * (n + 1)),
      PW_ARRAY (x->enforced, rows), PW_ARRAY (x->other, rows), PW_ARRAY (x->d.choice, 2 * n), PW_ARRAY (x->d.A, n * n),
      PW_ARRAY (x->d.factor, n * (n + 1)), PW_ARRAY (x->f, coords), PW_ARRAY (x->a, coords), PW_ARRAY (x->gamma, rows),
      PW_ARRAY (x->lambda, 2 * rows), PW_ARRAY (x->memory, 2 * n * (PW_CROSSING_DEPTH + 2)),
      PW_ARRAY (r->reaction, rows), PW_ARRAY (r->given, rows));
  x->d.limit = x->limit;
  return r->events_memory ? PW_OK : PW_RESOURCE;
}

/* ---- Event functions, positive beyond an event: two for each equation ---- */

/* Below this u [units] of equation i counts as 0 after its root: the error of the method; of velocities in index 3 at
 * least the round-off of positions over a step. */
static double events_tolerance (const pw_run *r, int i) {
  const double T = r->w->scale.time, h = r->fixed_steps ? r->settings.step : EVENTS_FIRST * T;
  const int rounded = pw_stabilised_by (r, PW_INDEX3) && r->events->row[i] >= r->s->holonomic;
  return fmax (rounded ? 1024 * DBL_EPSILON * T / h : 1e-13, r->fixed_steps ? 0 : 10 * r->settings.rtol);
}

/* Event functions where J is evaluated, from the multipliers and velocities. */
static void events_values (pw_run *r, const double *v, const double *lambda, double *value) {
  pw_events *x = r->events;
  pw_modes_u (r, v, 1, x->u);
  pw_modes_set_limits (r);
  for (int i = 0; i < x->count; i++) {
    const pw_bounds *limit = &x->limit[i];
    const double tolerance = events_tolerance (r, i);
    double y = lambda[x->row[i]], size = x->partner[i] < 0 ? 1 : fabs (lambda[x->row[x->partner[i]]]);
    value[2 * i] = isinf (limit->most) ? -1 : (y - size * limit->most) / x->force_unit[i] - EVENTS_ROUND_OFF;
    value[2 * i + 1] = isinf (limit->least) ? -1 : (size * limit->least - y) / x->force_unit[i] - EVENTS_ROUND_OFF;
    double u = x->mode[i] * x->u[i];
    if (limit->circle == 1) {
      value[2 * i] = (hypot (y, lambda[x->row[i + 1]]) - limit->most) / x->force_unit[i] - EVENTS_ROUND_OFF;
      u = x->u[i] * x->direction[i] + x->u[i + 1] * x->direction[i + 1];
    }
    if (limit->circle == 2) value[2 * i] = -1;
    if (limit->circle) value[2 * i + 1] = -1;
    if ((x->spare[i] && !limit->circle) || pw_mode_apart (x, i)) value[2 * i] = value[2 * i + 1] = -1;
    if (pw_mode_depends (x, i))
      value[2 * i + (limit->circle == 1)] = fabs (x->u[i]) / x->unit[i] - EVENTS_PARTED - tolerance / 10;
    if (x->mode[i] == 0 || limit->circle == 2 || pw_mode_apart (x, i) || (x->still[i] && !limit->circle)) continue;
    const double least = x->row[i] < r->s->holonomic ? 0 : EVENTS_ROUND_OFF; /* a penetration would add energy */
    value[2 * i] = -u / x->unit[i] - (x->armed[i] ? least : tolerance + x->offset[i]);
    value[2 * i + 1] = -1;
    if (x->still[i] && x->armed[i]) /* of a circle whose first u others keep at 0: u passes beside 0 */
      value[2 * i + 1] = PW_MODES_SMALL / 2 - hypot (x->u[i], x->u[i + 1]) / x->unit[i];
    else if (x->still[i])
      value[2 * i] = fmin (value[2 * i], -2 * EVENTS_ROUND_OFF);
  }
}

/* 1 if the method leaves the multipliers of the state reached in r->lambda, without Baumgarte's terms. */
static int events_knows_multipliers (const pw_run *r) {
  static const pw_stabilisation_kind kinds[] = { PW_UNSTABILISED, PW_PROJECTION, PW_NULLSPACE };
  for (size_t i = 0; i < sizeof kinds / sizeof *kinds && r->method->order > 0; i++) /* not of multistep methods */
    if (pw_stabilised_by (r, kinds[i])) return 1;
  return 0;
}

/* Where friction and normal forces that depend on each other do not determine the motion. */
static int events_fail_friction (pw_run *r, double t, pw_error *error) {
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the friction of %s and its normal force depend on each other: there is no "
                  "solution, or there are several (Painleve)",
                  t, PW_NAME (pw_system_row_name, r->s, r->coupling->row));
}

/* pw_crossing_search.at.  Otherwise multipliers are computed from the state: those of some methods are interpolated,
 * and modes are decided with these. */
static int events_at (void *context, double t, double *value, pw_error *error) {
  pw_run *r = context;
  const pw_statistics statistics = r->statistics;
  const double alpha = r->alpha, beta = r->beta;
  const int near_singular = r->near_singular;
  if (t == r->t && r->events->at_end) return events_values (r, r->v, r->lambda, value), PW_OK;
  r->events->samples = 1;
  r->located = t;
  int status = r->method->at (r, t, error);
  r->alpha = r->beta = 0;
  if (status == PW_OK && pw_saddle_factor (r->saddle) == PW_OK)
    pw_run_accelerate_updated (r, r->v_at, r->a_at, r->lambda_at);
  r->alpha = alpha, r->beta = beta;
  r->statistics = statistics, r->near_singular = near_singular;
  if (status == PW_OK) events_values (r, r->v_at, r->lambda_at, value);
  return status == PW_OK && r->couplings > 0 && r->coupling_lost ? events_fail_friction (r, t, error) : status;
}

/* The same without the ledger, of which only the state reached needs a sample. */
static int events_search_at (void *context, double t, double *value, pw_error *error) {
  pw_run *r = context;
  const int entries = r->entries, ledger = r->settings.ledger;
  r->entries = r->settings.ledger = 0;
  const int status = events_at (r, t, value, error);
  r->entries = entries, r->settings.ledger = ledger;
  return status;
}

/* Marks functions of u that have left their root. */
static void events_arm (pw_run *r, const double *value) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count; i++)
    x->armed[i] |= x->mode[i] && value[2 * i] < -2 * events_tolerance (r, i) - x->offset[i];
}

/* Marks the equations at their roots; 1 if there are any. */
static int events_trigger (pw_run *r, const double *value) {
  pw_events *x = r->events;
  int any = 0;
  for (int i = 0; i < x->count; i++) any |= x->triggered[i] = value[2 * i] > 0 || value[2 * i + 1] > 0;
  return any;
}

/* Projects the state reached onto the equations that hold so far, unless it satisfies them to round-off: not all
 * samples do. */
static int events_project (pw_run *r, pw_error *error) {
  pw_projector p;
  pw_residuals now;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  pw_evaluate_residuals (r->w, r->enforced, &now);
  if (r->redundant == 0 && now.position <= PW_RESIDUAL_CONVERGED && now.velocity <= PW_RESIDUAL_CONVERGED) return PW_OK;
  int status = pw_projector_open (&p, r, NULL, NULL, error);
  if (status != PW_OK) return status;
  double before = 0; /* a sample may have moved the bodies of the workspace */
  if (r->settings.ledger && pw_update_kinematics (r->w, r->t, r->q, r->v) == PW_OK) before = pw_energy (r, r->v);
  status = pw_project_positions (&p, r, r->t, r->q, r->v);
  if (status == PW_OK) status = pw_project_velocities (&p, r, r->v);
  pw_projector_close (&p);
  if (status != PW_OK) return pw_fail_singular (r, r->t, error);
  if (r->settings.ledger) r->projected += pw_energy (r, r->v) - before;
  return PW_OK;
}

/* ---- In a run ---- */

/* After a decision.  g of an equation that holds from now on becomes 0; u of one that does not is 0 or leaves it, but g
 * may have drifted. */
static int events_leave (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  int closes = 0, status = PW_OK;
  for (int i = 0; i < x->count; i++) closes |= (x->row[i] < r->s->holonomic) && x->mode[i] == 0 && x->before[i] != 0;
  if (closes) status = events_project (r, error);
  if (status == PW_OK && closes) status = pw_run_evaluate (r, error);
  if (status == PW_OK && closes) status = r->method->restart (r, error);
  if (status != PW_OK) return status;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  pw_modes_u (r, r->v, 1, x->u);
  for (int i = 0; i < x->count; i++)
    x->offset[i] = x->limit[i].circle ? 0 : fmax (0, -x->mode[i] * x->u[i] / x->unit[i]);
  return PW_OK;
}

/* PW_METHOD if decisions go on that change nothing; known: events before the last one. */
static int events_check_idle (pw_run *r, long known, pw_error *error) {
  pw_events *x = r->events;
  int i = 0;
  x->idle = r->event_count == known && r->t - x->decided_t < EVENTS_IDLE_TIME * r->w->scale.time ? x->idle + 1 : 0;
  x->decided_t = r->t;
  if (x->idle < EVENTS_IDLE) return PW_OK;
  for (int k = 1; k < x->count; k++)
    if (x->mode[k] && (x->mode[i] == 0 || fabs (x->u[k]) / x->unit[k] < fabs (x->u[i]) / x->unit[i])) i = k;
  return pw_fail (
      error, PW_METHOD,
      "t = %.6g s: whether %s slides is decided by round-off, in ever more decisions that change nothing; use "
      "another step or an adaptive method",
      r->t, PW_NAME (pw_system_row_name, r->s, x->row[i]));
}

static int events_prepare (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  int status = PW_OK;
  if (r->jumped) x->start_t = NAN;
  r->jumped = 0;
  for (int pass = 0; status == PW_OK && (x->pending || x->start_t != r->t); pass++) {
    if (pass == EVENTS_PASSES) {
      int i = 0;
      while (i < x->count - 1 && !x->triggered[i]) i++;
      return pw_fail (error, PW_METHOD, "t = %.6g s: modes change endlessly: %s", r->t,
                      PW_NAME (pw_system_row_name, r->s, x->row[i]));
    }
    if (x->pending) {
      x->previous_t = NAN, x->longest = EVENTS_FIRST * r->w->scale.time, x->roughness = 0;
      memset (x->armed, 0, (size_t)x->count);
      status = events_project (r, error);
      const long known = r->event_count;
      if (status == PW_OK) status = pw_modes_decide (r, 0, error);
      if (status == PW_OK) status = events_check_idle (r, known, error);
      r->watchdog.largest_sine = 0;
      pw_run_fix_sides (r); /* what sticks has the velocity 0 */
      if (status == PW_OK) status = pw_run_renew (r, error);
      if (status == PW_OK) pw_run_set_reference_level (r);
      if (status == PW_OK) status = events_leave (r, error);
    }
    if (status == PW_OK) status = events_at (r, r->t, x->start, error);
    x->start_t = r->t;
    events_arm (r, x->start);
    x->pending = status == PW_OK && events_trigger (r, x->start);
  }
  return status == PW_OK && pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK ? pw_fail_signal (r->t, error) : status;
}

/* Twice the distance of a function from its chord in the last step, from t0, by its values at the ends and one step
 * earlier; NaN: that one is not known. */
static double events_bend (const pw_run *r, double t0, int i) {
  const pw_events *x = r->events;
  const double h = r->t - t0, before = t0 - x->previous_t;
  return fabs ((x->end[i] - x->start[i]) / h - (x->start[i] - x->previous[i]) / before) / (h + before) * h * h / 2;
}

/* 1 if no function comes near its root in the last step, from t0, but those that increase by more than `straight`
 * bends.  One that falls by more than four bends is largest at t0: a parabola, by more than two. */
static int events_far (const pw_run *r, double t0, double straight) {
  const pw_events *x = r->events;
  for (int i = 0; i < 2 * x->count; i++) {
    const double bend = events_bend (r, t0, i), change = x->end[i] - x->start[i];
    if (!(fmax (x->start[i], x->end[i]) + 4 * bend < 0 || -change > 4 * bend || change > straight * bend)) return 0;
  }
  return 1;
}

/* The functions at the beginning of the last step; NaN: of u that is at its root there, and leaves it. */
static const double *events_left (pw_events *x) {
  for (int i = 0; i < 2 * x->count; i++)
    x->now[i] = i % 2 == 0 && x->mode[i / 2] && !x->armed[i / 2] && x->end[i] < 0 ? NAN : x->start[i];
  return x->now;
}

/* The longest next adaptive step: multipliers that signals of time change must be resolved even where nothing moves,
 * and an error estimate would permit any step.  Multistep methods grow by up to 10, and lose their order if they are
 * interrupted more often. */
static double events_longest (pw_run *r, double t0) {
  pw_events *x = r->events;
  const double growth = r->method->order > 0 ? 2 : 10;
  double most = 0, last = x->roughness;
  int held = 0;
  for (int i = 0; i < 2 * x->count; i++) {
    if (x->mode[i / 2]) continue;
    held = 1;
    if (!isnan (x->previous_t)) most = fmax (most, events_bend (r, t0, i) / (EVENTS_BEND * (1 + fabs (x->end[i]))));
  }
  x->roughness = most;
  return held ? (r->t - t0) * fmin (growth, fmax (0.2, 1 / sqrt (fmax (most, last)))) : INFINITY;
}

/* The root of functions of u that have not left their root at t0, but do so before `root`, where they return to it. */
static int events_refine (pw_run *r, pw_crossing_search *search, double t0, double *root) {
  static const double part[] = { 0.5, 0.75, 0.25, 0.875, 0.125, 0.97, 0.03 };
  pw_events *x = r->events;
  int unarmed = 0;
  for (int i = 0; i < x->count; i++) unarmed |= x->triggered[i] && x->mode[i] && !x->armed[i];
  x->fell = unarmed;
  for (size_t p = 0; p < sizeof part / sizeof *part && x->fell; p++) {
    const double t = t0 + part[p] * (*root - t0);
    const int status = events_at (r, t, x->now, search->error);
    if (status != PW_OK) return status;
    events_arm (r, x->now);
    for (int i = 0; i < x->count; i++)
      if (x->triggered[i] && x->mode[i] && x->armed[i]) x->fell = 0;
    if (x->fell) continue;
    memcpy (x->start, x->now, 2 * (size_t)x->count * sizeof *x->start);
    search->status = events_at (r, *root, x->now, search->error);
    const double first = search->status == PW_OK ? pw_first_crossing (search, t, x->start, *root, x->now) : NAN;
    if (!isnan (first)) *root = first;
    return search->status == PW_OK ? events_at (r, *root, x->now, search->error) : search->status;
  }
  return PW_OK;
}

/* Makes the sample at t, in x->now if it is the last one, the state reached. */
static int events_stop_at (pw_run *r, double t, pw_error *error) {
  pw_events *x = r->events;
  int status = t == r->located ? PW_OK : events_at (r, t, x->now, error);
  if (status != PW_OK) return status;
  events_trigger (r, x->now);
  for (int i = 0; i < x->count; i++) /* velocities that reach 0 together do so within the error of the method */
    x->triggered[i] |= x->mode[i] && x->armed[i] && x->row[i] >= r->s->holonomic && !x->limit[i].circle &&
                       x->now[2 * i] > -events_tolerance (r, i);
  x->pending = 1, x->start_t = NAN;
  for (int i = 0; i < x->count && !x->fell; i++) x->struck[i] &= x->mode[i] != 0 && !x->armed[i];
  if (t == r->t) return PW_OK;
  memcpy (r->q, r->q_at, pw_state_length (r->s) * sizeof *r->q);
  memcpy (r->ledger, r->ledger_at, (size_t)r->entries * sizeof *r->ledger);
  r->projected = r->projected_at;
  r->t = t;
  pw_ledger_rates (r, r->lambda, r->rate);
  return PW_OK;
}

static int events_follow (pw_run *r, double t0, pw_error *error) {
  pw_events *x = r->events;
  const size_t bytes = 2 * (size_t)x->count * sizeof *x->start;
  pw_crossing_search search = { .count = 2 * x->count,
                                .at = events_search_at,
                                .context = r,
                                .memory = x->memory,
                                .width = 4 * DBL_EPSILON * fmax (fabs (r->t), r->w->scale.time),
                                .small = EVENTS_ROUND_OFF / 4,
                                .error = error };
  x->at_end = r->t < r->breakpoint && events_knows_multipliers (r), x->samples = 0;
  int status = events_at (r, r->t, x->end, error);
  x->at_end = 0;
  double root = NAN;
  if (status == PW_OK && (events_trigger (r, x->end) || !events_far (r, t0, INFINITY))) {
    if (events_far (r, t0, EVENTS_STRAIGHT)) search.before = x->previous_t, search.at_before = x->previous;
    root = pw_first_crossing (&search, t0, events_left (x), r->t, x->end);
  }
  search.at_before = NULL;
  if (status == PW_OK) status = search.status;
  if (status == PW_OK && !isnan (root)) {
    status = events_at (r, root, x->now, error);
    if (status == PW_OK && events_trigger (r, x->now)) status = events_refine (r, &search, t0, &root);
    if (status == PW_OK) status = events_stop_at (r, root, error);
  } else {
    events_arm (r, x->end);
    x->longest = events_longest (r, t0);
    memcpy (x->previous, x->start, bytes);
    memcpy (x->start, x->end, bytes);
    x->previous_t = t0, x->start_t = r->t;
  }
  if (x->samples == 0) return status;
  pw_forget_residuals (r);
  if (status == PW_OK && pw_evaluate_J_at (r->w, pw_before_breakpoint (r, r->t), r->q, r->v) != PW_OK)
    return pw_fail_signal (r->t, error);
  return status;
}

void pw_events_forget (pw_run *r) {
  pw_events *x = r->events; /* u that has been away from 0 remains armed: it may be about to return */
  x->pending = x->fell = 0, x->start_t = x->previous_t = NAN;
}

int pw_events_advance (pw_run *r, double t_end, pw_error *error) {
  int status = events_prepare (r, error);
  const double t0 = r->t;
  double longest = r->fixed_steps ? INFINITY : r->events->longest;
  if (status == PW_OK) longest = fmin (longest, pw_modes_begin_step (r));
  if (status == PW_OK) status = r->method->advance (r, fmin (t_end, t0 + longest), error);
  return status == PW_OK ? events_follow (r, t0, error) : status;
}

/* ---- Opening ---- */

/* Units of multipliers and of u; needs the scales. */
static void events_units (pw_run *r) {
  pw_events *x = r->events;
  const double T = r->w->scale.time, L = r->s->scale.length;
  double force = 0;
  pw_modes_set_limits (r);
  for (int j = 0; j < r->s->mechanical; j++)
    force = fmax (force, r->s->mass[j] * pw_unit (r->s, j) * pw_unit (r->s, j) / (L * T * T));
  for (int i = 0; i < x->count; i++) {
    const double arm = pw_rank_multiplier_unit (r->w, x->row[i]), least = x->limit[i].least, most = x->limit[i].most;
    const double largest = fmax (isinf (least) ? 0 : -least, isinf (most) ? 0 : most);
    const double scale = force > 0 ? force * arm : 1;
    x->force_unit[i] = r->s->limit_source[x->row[i]][0] >= 0 ? fmax (largest, scale) : largest > 0 ? largest : scale;
    if (x->partner[i] >= 0) x->force_unit[i] = x->force_unit[x->partner[i]];
    x->unit[i] = L / arm / ((x->row[i] < r->s->holonomic) ? 1 : T);
  }
}

/* Modes for the search of consistent positions and velocities: equations that may be free on one side are, unless that
 * side is left, and friction is. */
static void events_initial (pw_run *r) {
  pw_events *x = r->events;
  events_units (r);
  pw_modes_u (r, r->v, 1, x->u);
  for (int i = 0; i < x->count; i++) {
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    const signed char off = pw_mode_off (x, i, 0);
    x->mode[i] =
        one_sided && (!(x->row[i] < r->s->holonomic) || off * x->u[i] >= -PW_MODES_SMALL * x->unit[i]) ? off : 0;
    if (x->limit[i].initially_slides) x->mode[i] = 1;
  }
  pw_modes_apply (r);
}

/* 1 if a velocity that the model specifies or the user gives was not kept. */
static int events_moved (const pw_run *r) {
  for (int state = r->s->coords; state < 2 * r->s->coords; state++)
    if (pw_initial_specified (&r->initial, state) && pw_initial_moved (r->s, &r->initial, state)) return 1;
  return 0;
}

/* Makes the described state (in r->q_at, r->v_at) consistent with the present modes. */
static int events_consistent (pw_run *r, pw_error *error) {
  pw_modes_apply (r);
  memcpy (r->q, r->q_at, 2 * ((size_t)r->s->coords + 3) * sizeof *r->q);
  return pw_run_make_consistent (r, r->events->origin, error);
}

/* 1 if the initial velocities do not satisfy an equation. */
static int events_slides (const pw_events *x, int i) {
  return fabs (x->u_before[i]) > 1e-9 * x->unit[i];
}

/* Friction holds if the velocities, consistent without it, satisfy its equation, else it slides. */
static int events_initial_friction (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  int holds = 0;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  pw_modes_u (r, r->v, 0, x->u_before);
  for (int i = 0; i < x->count; i++) {
    if (!x->limit[i].initially_slides || x->partner[i] >= 0) continue; /* contacts are not closed yet */
    x->mode[i] = events_slides (x, i) ? pw_mode_off (x, i, x->u_before[i]) : 0;
    holds |= x->mode[i] == 0;
  }
  pw_modes_apply (r);
  return holds ? events_consistent (r, error) : PW_OK;
}

/* Velocities of which some are not kept if all equations with two limits hold: as many hold as keep them. */
static int events_initial_sliding (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  for (int i = 0; i < x->count; i++)
    if (x->mode[i] == 0 && !(x->row[i] < r->s->holonomic)) x->mode[i] = 1, x->direction[i] = 0;
  int status = events_consistent (r, error);
  for (int i = 0; i < x->count && status == PW_OK; i++) {
    pw_error own = { 0 };
    const int circle = x->limit[i].circle;
    if (pw_is_one_sided (&x->limit[i]) || x->limit[i].initially_slides || circle == 2) continue;
    if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
    pw_modes_u (r, r->v, 0, x->u_before);
    x->mode[i] = 0;
    if (circle) x->mode[i + 1] = 0;
    if (!events_slides (x, i) && !(circle && events_slides (x, i + 1))) continue;
    status = events_consistent (r, &own);
    if (status == PW_STOPPED || status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
    if (status == PW_OK && !events_moved (r)) continue;
    pw_mode_slide (x, i, x->u_before);
    status = events_consistent (r, error);
  }
  if (status != PW_OK) return status;
  return events_consistent (r, error);
}

int pw_events_open (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  pw_error own = { 0 };
  r->forces = s->forces > 0;
  if (s->limit == NULL) return pw_run_make_consistent (r, r->origin, error);
  if (events_allocate (r) != PW_OK) return pw_fail_memory (s, error);
  pw_events *x = r->events;
  for (int i = 0; i < s->rows; i++)
    if (pw_is_limited (s, i) && pw_can_hold (&s->limit[i])) x->row[x->count] = i, x->limit[x->count++] = s->limit[i];
  for (int i = 0; i < x->count; i++) {
    x->partner[i] = x->limit[i].relative ? 0 : -1;
    while (x->limit[i].relative && x->row[x->partner[i]] != x->limit[i].partner) x->partner[i]++;
  }
  x->start_t = x->previous_t = NAN, x->origin = r->origin;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  events_initial (r);
  memcpy (r->q_at, r->q, 2 * ((size_t)s->coords + 3) * sizeof *r->q);
  int status = events_consistent (r, &own);
  if (status == PW_STOPPED || status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
  if (status != PW_OK || events_moved (r)) status = events_initial_sliding (r, error);
  return status == PW_OK ? events_initial_friction (r, error) : status;
}

int pw_events_spare (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  x->d.n = 0;
  for (int i = 0; i < x->count; i++)
    if (x->mode[i] == 0 && x->partner[i] < 0) pw_modes_add (x, i, -INFINITY, INFINITY, 0);
  pw_saddle *saddle = pw_modes_open_decision (r, 1, error);
  if (saddle == NULL) return error && error->status == PW_RESOURCE ? PW_RESOURCE : PW_RETRY;
  (void)pw_decision_solve (&x->d, 1);
  for (int k = 0; k < x->d.n; k++) x->spare[x->d.list[k]] = x->d.redundant[k];
  pw_saddle_close (saddle);
  pw_modes_apply (r);
  return PW_OK;
}

int pw_events_begin (pw_run *r, pw_error *error) {
  if (r->events == NULL) return PW_OK;
  events_units (r);
  r->events->longest = EVENTS_FIRST * r->w->scale.time, r->events->stride = INFINITY;
  int status = pw_modes_decide (r, 1, error);
  if (status == PW_OK) status = pw_run_open_saddle (r, error);
  if (status == PW_OK) status = pw_run_evaluate (r, error);
  if (status == PW_OK) pw_run_set_references (r);
  return status;
}

int pw_run_mode (const pw_run *r, int row) {
  const pw_events *x = r ? r->events : NULL;
  for (int i = 0; x && i < x->count; i++)
    if (x->row[i] == row) return pw_mode_shown (x, i);
  return 0;
}

int pw_events_restart (pw_run *r, double *energy, pw_error *error) {
  pw_events *x = r->events;
  x->start_t = x->previous_t = NAN, x->roughness = 0, x->origin = NULL;
  x->stepping = x->pending = x->fell = 0;
  memset (x->triggered, 0, (size_t)x->count);
  memset (x->armed, 0, (size_t)x->count);
  for (int i = 0; i < x->count; i++) x->limit[i].initially_slides = !pw_is_one_sided (&x->limit[i]);
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  events_initial (r);
  memcpy (r->q_at, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *r->q);
  int status = events_consistent (r, error);
  if (status == PW_OK) status = events_initial_friction (r, error);
  if (status != PW_OK) return status;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  *energy = pw_energy (r, r->v);
  status = pw_events_begin (r, error);
  return status == PW_OK ? pw_run_renew (r, error) : status;
}

int pw_events_check_modes (pw_run *r, const double *v, const double *lambda, pw_error *error) {
  pw_events *x = r->events;
  if (x == NULL) return PW_OK;
  pw_modes_u (r, v, 1, x->u);
  for (int i = 0; i < x->count; i++) {
    const char *name = PW_NAME (pw_system_row_name, r->s, x->row[i]);
    const pw_bounds *limit = &x->limit[i];
    const double y = lambda[x->row[i]], u = x->mode[i] * x->u[i];
    const double size = x->partner[i] < 0 ? 1 : fabs (lambda[x->row[x->partner[i]]]);
    const double least = y - size * limit->least, most = size * limit->most - y;
    const double unit = x->mode[i] ? x->unit[i] : x->force_unit[i], margin = x->mode[i] ? u : fmin (least, most);
    const int changes = margin > -EVENTS_BOUNDARY * unit;
    if (margin > EVENTS_BOUNDARY * unit || x->spare[i] || pw_mode_depends (x, i) || pw_mode_apart (x, i)) continue;
    if (x->mode[i] == 0)
      return pw_fail (error, PW_METHOD, "t = %.6g s: %s is %s a limit of its reaction: %.9g, limit %.9g", r->t, name,
                      changes ? "at" : "beyond", -y, -(least < most ? limit->least : limit->most));
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s %s: its %s is %.3g", r->t, name,
                    changes ? "begins or ceases to hold" : "is on the wrong side of its limit",
                    x->row[i] < r->s->holonomic ? "distance" : "velocity", u);
  }
  return PW_OK;
}

/* ---- Impulses of a step (moreau.c): no event is located ----
 *
 * None of the equations is enforced by others: all have given multipliers, in x->mean.  During a step these are
 * predicted ones; afterwards, with the impulses that correct them at its end, the mean of the step.  Mode 0: u is 0 at
 * the end of the step. */

int pw_impulses_open (pw_run *r, pw_error *error) {
  pw_events *x = r->events;
  if (x == NULL || x->stepping) return PW_OK;
  for (int i = 0; i < x->count; i++)
    if (x->partner[i] >= 0)
      return pw_fail (error, PW_INPUT, "%s: the friction of %s depends on a reaction: use rk4 or radau",
                      r->method->name, PW_NAME (pw_system_row_name, r->s, x->row[i]));
    else if (x->limit[i].circle)
      return pw_fail (error, PW_INPUT, "%s: the grip of %s limits a resultant: use rk4, erk8 or radau", r->method->name,
                      PW_NAME (pw_system_row_name, r->s, x->row[i]));
  for (int i = 0; i < x->count; i++) x->mean[i] = x->mode[i] ? pw_mode_given (x, i) : r->lambda[x->row[i]];
  x->stepping = 1;
  r->event_count = 0;
  pw_modes_apply (r);
  const int status = pw_run_open_saddle (r, error);
  return status == PW_OK ? pw_run_evaluate (r, error) : status;
}

int pw_impulses_predict (pw_run *r) {
  pw_events *x = r->events;
  int changed = 0;
  for (int i = 0; x && i < x->count; i++) {
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    const double next = x->mode[i] ? pw_mode_given (x, i) : x->jumped && one_sided ? 0 : x->mean[i];
    changed |= next != x->mean[i];
    x->mean[i] = next;
  }
  if (changed) pw_modes_apply (r);
  return changed;
}

/* Lists D, with the limits of impulses in a step, those of the predicted multipliers included: equations that held at
 * the beginning of the step, those of velocities, and those of positions whose g has left its side. */
static void impulses_list (pw_run *r, double h, const double *g) {
  pw_events *x = r->events;
  x->d.n = x->jumped = 0;
  pw_modes_set_limits (r);
  for (int i = 0; i < x->count; i++) {
    const int side = pw_mode_off (x, i, 0), is_position = x->row[i] < r->s->holonomic;
    const double before = side * x->u_before[i] / x->unit[i];
    const int one_sided = pw_is_one_sided (&x->limit[i]);
    x->rests[i] = 1;
    if (is_position && x->mode[i] && side * g[i] > PW_MODES_SMALL * x->unit[i]) continue;
    if (one_sided && x->mode[i] && before < -PW_MODES_SMALL) {
      x->jumped = 1;
      x->rests[i] = before > -PW_MODES_SLOW || x->limit[i].restitution == 0;
    }
    x->d.b[x->d.n] = x->u[i] + (x->rests[i] ? 0 : x->limit[i].restitution * x->u_before[i]);
    /* friction that slides has its sliding limit from the beginning: others need not balance the larger one */
    const int slides = one_sided || fabs (before) <= PW_MODES_SMALL ? 0 : x->mode[i];
    const double lo = slides < 0 ? x->limit[i].sliding[0] : x->limit[i].least;
    const double hi = slides > 0 ? x->limit[i].sliding[1] : x->limit[i].most;
    pw_modes_add (x, i, h * lo, h * hi, x->mode[i]);
  }
}

int pw_impulses_solve (pw_run *r, pw_projector *p, double h, double t, const double *q, double *v, double *before,
                       pw_error *error) {
  pw_events *x = r->events;
  memcpy (before, r->v, (size_t)r->s->coords * sizeof *before);
  if (pw_evaluate_J_at (r->w, t, q, before) != PW_OK) return pw_fail_signal (t, error);
  if (pw_project_velocities (p, r, before) != PW_OK) return pw_fail_singular (r, t, error);
  pw_modes_u (r, before, 1, x->now);
  pw_modes_u (r, before, 0, x->u_before);
  if (pw_update_velocities (r->w, v) != PW_OK) return pw_fail_signal (t, error);
  pw_modes_u (r, v, 0, x->u);
  impulses_list (r, h, x->now);
  pw_modes_matrix (r, r->saddle);
  int count = -1;
  for (int k = 0; k < x->d.n; k++) /* impulses include those of the predicted multipliers, which u already has */
    for (int i = 0; i < x->d.n; i++) x->d.b[k] += x->d.A[k * x->d.n + i] * h * x->mean[x->d.list[i]];
  if (pw_modes_decide_sliding (x, h, &count) != PW_OK) return pw_modes_fail (r, r->saddle, count, error);
  for (int k = 0; k < x->d.n; k++) x->d.x[k] -= h * x->mean[x->d.list[k]];
  pw_modes_push (r, r->saddle, v);
  if (pw_update_velocities (r->w, v) != PW_OK) return pw_fail_signal (t, error);
  pw_modes_end_impact (r, v);
  for (int i = 0; i < x->count; i++) x->mode[i] = x->mode[i] ? x->mode[i] : pw_mode_off (x, i, 0);
  for (int k = 0; k < x->d.n; k++) {
    const int i = x->d.list[k];
    x->mean[i] += x->d.x[k] / h;
    x->mode[i] = x->rests[i] ? x->d.trial[k] : pw_mode_off (x, i, 0);
  }
  pw_modes_apply (r);
  return PW_OK;
}

/* Lists the equations of positions that must be corrected by dq: those that hold, and those that are violated.
 * Returns 1 if one of them is violated. */
static int impulses_violated (pw_run *r, const double *g) {
  pw_events *x = r->events;
  int any = x->d.n = 0;
  for (int i = 0; i < x->count && x->row[i] < r->s->holonomic; i++) {
    const int side = pw_mode_off (x, i, 0), holds = x->mode[i] == 0;
    const double off = (holds ? -fabs (g[i]) : side * g[i]) / x->unit[i];
    if (!holds && !(off < -PW_MODES_SMALL)) continue;
    any |= off < -PW_MODES_SMALL;
    x->d.b[x->d.n] = g[i];
    pw_modes_add (x, i, holds || side > 0 ? -INFINITY : 0, holds || side < 0 ? INFINITY : 0, 0);
  }
  return any;
}

int pw_impulses_project (pw_run *r, pw_projector *p, double t, double *q, const double *v) {
  pw_events *x = r->events;
  for (int pass = 0; pass < 3 * EVENTS_PASSES; pass++) {
    int status = pw_project_positions (p, r, t, q, v);
    if (status != PW_OK || x == NULL) return status;
    pw_modes_u (r, v, 1, x->now);
    if (!impulses_violated (r, x->now)) return PW_OK;
    if (pw_saddle_factor (p->position) != PW_OK) return PW_RETRY;
    pw_modes_matrix (r, p->position);
    if (pw_decision_pivot (&x->d, 0) != PW_OK) return PW_RETRY;
    pw_modes_push (r, p->position, q);
  }
  return PW_RETRY;
}

void pw_events_serialise (pw_run *r, pw_archive *a) {
  pw_events *x = r->events;
  if (x == NULL) return;
  pw_archive_bytes (a, x->mode, (size_t)x->count);
  pw_archive_bytes (a, x->triggered, (size_t)x->count);
  pw_archive_bytes (a, x->spare, (size_t)x->count);
  pw_archive_bytes (a, x->still, (size_t)x->count);
  pw_archive_bytes (a, x->struck, (size_t)x->count);
  pw_archive_bytes (a, x->armed, (size_t)x->count);
  pw_archive_bytes (a, x->offset, (size_t)x->count * sizeof *x->offset);
  pw_archive_bytes (a, x->direction, (size_t)x->count * sizeof *x->direction);
  pw_archive_bytes (a, x->bias, (size_t)x->count * sizeof *x->bias);
  pw_archive_bytes (a, x->reach, (size_t)x->count * sizeof *x->reach);
  pw_archive_bytes (a, &x->stride, sizeof x->stride);
  pw_archive_bytes (a, x->away, (size_t)x->count);
  pw_archive_bytes (a, &x->pending, sizeof x->pending);
  pw_archive_bytes (a, &x->fell, sizeof x->fell);
  pw_archive_bytes (a, x->mean, (size_t)x->count * sizeof *x->mean);
  pw_archive_bytes (a, &x->jumped, sizeof x->jumped);
  pw_archive_bytes (a, &x->stepping, sizeof x->stepping);
  pw_archive_count (a, &r->event_count);
  for (long i = 0; i < r->event_count && !a->failed; i++) {
    a->failed |= a->loading && pw_grow (&r->event, (size_t)i, &r->event_room, sizeof *r->event) != PW_OK;
    pw_archive_bytes (a, r->event + i, sizeof *r->event);
  }
  for (int i = 0; i < x->count; i++) {
    const signed char mode = x->mode[i];
    const double given = mode ? pw_mode_given (x, i) : 0;
    a->failed |= mode < -1 || mode > 1 || !isfinite (given) || !(x->offset[i] >= 0);
  }
  if (a->failed) r->event_count = 0;
  x->start_t = x->previous_t = NAN, x->longest = EVENTS_FIRST * r->w->scale.time, x->roughness = 0;
  if (!a->failed) pw_modes_apply (r);
}
