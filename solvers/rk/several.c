/* Several steps of fixed size in one call of specialised code.
 *
 * Results are bit-identical to those of single steps.  What a run does less often than every step (limits.c, ledger.c)
 * is done after the last of them, so there are never more than PW_CHECK_INTERVAL. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "rk_step.h"

/* 1 if the specialised function `steps` does everything that a step of this run needs.  The ledger records the first
 * steps one by one (ledger.c). */
static int several_possible (const pw_run *r) {
  const pw_method_data *d = r->data;
  if (r->method->advance != pw_rk_advance || d == NULL || !r->fixed_steps || d->holds_signals || d->uses_nullspace ||
      d->off_grid)
    return 0;
  if (d->projects && (d->every > 1 || d->projector.owns_velocity)) return 0;
  return pw_specialised_suits (r) && r->redundant == 0 && r->alpha + r->beta == 0 && !r->settings.ledger &&
         !r->interrupted && r->stalled == 0 && !(r->watchdog.saddle && r->watchdog.singular_ahead) &&
         r->statistics.steps >= PW_CHECK_INTERVAL;
}

/* The number of whole steps that can be taken at once: up to t_end and the next breakpoint, with the tolerance of
 * pw_step_end; up to the first that reaches t; up to a multiple of PW_CHECK_INTERVAL and the next record of speeds
 * (limits.c).  Each must be twice as long as a step that counts as stalled (run.c). */
static int several_count (const pw_run *r, double t, double t_end) {
  const pw_method_data *d = r->data;
  const double h = r->settings.step, stop = fmin (t_end, r->breakpoint) - PW_STEP_LONGER * h,
               shortest = 128 * DBL_EPSILON;
  int most = PW_CHECK_INTERVAL - (int)(r->statistics.steps % PW_CHECK_INTERVAL), n = 0;
  double reached = r->t;
  while (n < most && reached < t && reached < t_end && reached - r->settings.t < 2 * r->speed_record.time) {
    double next = d->counter.base + (double)(d->counter.count + n + 1) * h;
    if (!(next <= stop && h > shortest * fabs (next))) break;
    reached = next, n++;
  }
  return n;
}

/* The watchdog's data in the form that specialised code uses. */
static pw_scene_watch several_watchdog (const pw_run *r) {
  const pw_thresholds *limit = &r->thresholds;
  const pw_watchdog *watch = &r->watchdog;
  const double T = r->w->scale.time, L = r->s->scale.length, largest = watch->largest_sine;
  pw_scene_watch x = { .sine = INFINITY, .moved = watch->moved, .reference = r->reference_level };
  x.lost = pw_stabilised_by (r, PW_UNSTABILISED) ? limit->lost_unstabilised : limit->lost;
  if (watch->saddle) /* else a tree of holonomic joints, never singular */
    x.sine = watch->checked_sine, x.reach = limit->lipschitz * largest, x.near_sine = limit->near * largest;
  x.growth = limit->step_growth, x.rank_lost = limit->rank_lost, x.regular = limit->regular * largest;
  x.drift = limit->drift_near;
  x.no_branch = 0.5 * limit->drift_near * limit->rank_lost * limit->rank_lost; /* 0.5: a margin for round-off */
  x.length = L, x.per_length = T * T / L, x.per_angle = T * T;
  return x;
}

/* Updates the run's data after the steps taken. */
static void several_record (pw_run *r, const pw_scene_steps *x) {
  pw_method_data *d = r->data;
  pw_statistics *now = &r->statistics;
  pw_watchdog *watch = &r->watchdog;
  r->t = x->t;
  d->last.t = x->t0, d->last.projected = r->projected;
  d->counter.count += x->done;
  r->near_singular = 0, r->w->failed = NULL;
  r->reference_level = x->watch.reference, r->previous_norm = x->watch.norm;
  now->steps += x->done;
  now->position = pw_larger (now->position, x->watch.position), now->g = pw_larger (now->g, x->watch.g);
  now->velocity = pw_larger (now->velocity, x->watch.velocity), now->jv = pw_larger (now->jv, x->watch.jv);
  pw_specialised_count (r, (long)x->stages * x->done, x->iterations);
  if (watch->saddle == NULL) return; /* else: what watchdog_follow stores where the sine need not be computed */
  watch->step_length = x->watch.step, watch->moved = x->watch.moved, watch->singular_ahead = 0;
  watch->sine_before_checked = NAN, watch->sine_slope = 0, watch->may_have_crossed = 0;
  watch->previous_t = r->t, watch->previous_sine = NAN;
  memcpy (watch->previous_q, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *watch->previous_q);
}

/* Fills x for the next steps, up to the first that reaches t, and returns their number; 0: fewer than two can be taken
 * at once. */
static int several_plan (pw_run *r, double t, double t_end, pw_scene_steps *x) {
  pw_method_data *d = r->data;
  int count = several_possible (r) ? several_count (r, t, t_end) : 0;
  if (count < 2) return 0;
  *x = (pw_scene_steps){ .count = count, .project = d->projects, .watch = several_watchdog (r) };
  x->stages = d->tableau->stages, x->row = d->row, x->c = d->tableau->c;
  x->h = r->settings.step, x->base = d->counter.base, x->number = d->counter.count;
  x->t = r->t, x->state = r->q, x->ledger = r->ledger, x->rate = r->rate;
  x->state0 = d->last.q, x->ledger0 = d->last.ledger, x->rate0 = d->last.rate;
  x->V = d->stage_v, x->A = d->stage_a, x->R = d->stage_rate;
  x->configuration = r->w->configuration, x->J = r->w->J;
  return count;
}

/* Makes the result of the steps the state reached.  Errors: PW_METHOD. */
static int several_finish (pw_run *r, const pw_scene_steps *x, pw_error *error) {
  int status = PW_OK;
  if (r->s->coords > 3 * r->s->bodies) pw_point_to_internal (r->w, r->q, r->v);
  if (x->done > 0) {
    several_record (r, x);
    pw_saddle_postpone (r->saddle, PW_SCENE_PIVOT);
  }
  /* A step that was refused has left its own configurations and J. */
  if (x->done < x->count && pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) status = pw_fail_signal (r->t, error);
  if (x->done > 0 && status == PW_OK) {
    status = pw_run_check_resolution (r, error);
    if (status == PW_OK) pw_ledger_record (r);
  }
  return pw_run_annotate_error (r, status, error);
}

int pw_run_advance_towards (pw_run *r, double t, double t_end, pw_error *error) {
  pw_scene_steps x;
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (several_plan (r, t, t_end, &x) == 0) return pw_run_advance (r, t_end, error);
  r->stopped = 0;
  if (pw_run_stop_requested (r)) return PW_STOPPED;
  r->specialised->steps (r->scene, &x);
  int status = several_finish (r, &x, error);
  return status == PW_OK && x.done == 0 ? pw_run_advance (r, t_end, error) : status;
}

/* ---- Several runs ---- */

/* Runs whose next steps can be taken together: those with the step size, method and stabilisation of the first. */
typedef struct {
  pw_run *const *run;
  int used, index[PW_LANES_MOST];      /* number of lanes with a run; index in `run` of each lane's run */
  pw_scene_steps steps[PW_LANES_MOST]; /* of each lane */
} several_lanes;

/* Plans the next steps of run i, if it can share lanes with the first. */
static void several_add (several_lanes *x, int i, double t_end) {
  const pw_run *first = x->used > 0 ? x->run[x->index[0]] : NULL, *r = x->run[i];
  if (first && (r->method != first->method || r->stabilisation != first->stabilisation ||
                r->settings.step != first->settings.step))
    return;
  if (several_plan (x->run[i], t_end, t_end, &x->steps[x->used]) > 0) x->index[x->used++] = i;
}

/* Takes the steps of all lanes; empty lanes repeat those of the first lane. */
static void several_take (several_lanes *x, const pw_specialised_lanes *code, void *memory) {
  pw_scene_steps *steps[PW_LANES_MOST];
  pw_scene *scene[PW_LANES_MOST];
  for (int k = 0; k < code->lanes; k++) {
    if (k >= x->used) x->steps[k] = x->steps[0], x->index[k] = x->index[0];
    steps[k] = &x->steps[k], scene[k] = x->run[x->index[k]]->scene;
  }
  code->steps (scene, steps, memory);
}

void pw_runs_advance (pw_run *const *runs, int count, double t_end, const pw_specialised_lanes *code, void *memory,
                      int *status, pw_error *error) {
  several_lanes x = { .run = runs };
  int done[PW_LANES_MOST] = { 0 };
  for (int i = 0; i < count && code && count <= code->lanes; i++) {
    if (runs[i] == NULL) continue; /* refused below */
    runs[i]->stopped = 0;
    if (pw_run_stop_requested (runs[i]))
      status[i] = PW_STOPPED, done[i] = 1;
    else
      several_add (&x, i, t_end);
  }
  if (x.used > 0 && 2 * x.used > code->lanes) { /* with half of them empty, one run after the other is faster */
    several_take (&x, code, memory);
    for (int k = 0; k < x.used; k++) {
      int i = x.index[k];
      status[i] = several_finish (runs[i], &x.steps[k], error ? &error[i] : NULL);
      done[i] = x.steps[k].done > 0 || status[i] != PW_OK;
    }
  }
  for (int i = 0; i < count; i++)
    if (i >= PW_LANES_MOST || !done[i])
      status[i] = pw_run_advance_towards (runs[i], t_end, t_end, error ? &error[i] : NULL);
}

int pw_run_advance_to (pw_run *r, double t, double t_end, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  while (r->t < t && !(r->t >= t_end)) {
    int status = pw_run_advance_towards (r, t, t_end, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}
