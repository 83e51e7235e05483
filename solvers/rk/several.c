/* Several steps of fixed size in one call of specialised code.
 *
 * The bits are those of single steps.  What a run does less often than every step (limits.c, ledger.c) is done after the last of
 * them, so there are never more than PW_SEVERAL_STEPS. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "rk_step.h"

/* 1 if all that a step consists of is part of `steps`. */
static int several_suits (const pw_run *r) {
  const struct pw_method_data *d = r->data;
  if (r->method->advance != pw_rk_advance || d == NULL || d->adaptive || d->held || d->null_space || d->split) return 0;
  if (d->projects && !(d->every == 1 && d->projector.by_mass && !d->projector.alone)) return 0;
  return pw_specialised_suits (r) && r->redundant == 0 && r->alpha + r->beta == 0 && !r->settings.ledger &&
         !r->interrupted && r->stalled == 0 && !(r->geometry.saddle && r->geometry.alert) &&
         r->statistics.steps >= PW_SEVERAL_STEPS;
}

/* The number of steps before one that ends at t_end or at a breakpoint, up to the first that reaches t. */
static int several_count (const pw_run *r, double t, double t_end) {
  const struct pw_method_data *d = r->data;
  const double h = r->settings.step, stop = fmin (t_end, r->breakpoint) - 1e-9 * h, tiny = 128 * DBL_EPSILON;
  int most = PW_SEVERAL_STEPS - (int)(r->statistics.steps % PW_SEVERAL_STEPS), n = 0;
  double reached = r->t;
  while (n < most && reached < t && reached - r->settings.t < 2 * r->mark_time) {
    double next = d->base + (double)(d->count + n + 1) * h;
    if (!(next <= stop && h > tiny * fabs (next))) break;
    reached = next, n++;
  }
  return n;
}

static void several_watch (const pw_run *r, pw_scene_steps *x) {
  const pw_watchdog *limit = &r->limits;
  const pw_geometry *g = &r->geometry;
  double per = r->w->scale.time * r->w->scale.time;
  x->lost = pw_stabilised_by (r, PW_UNSTABILISED) ? limit->lost_unstabilised : limit->lost;
  x->sine = g->saddle ? g->state_sine : INFINITY; /* a tree is never singular */
  x->reach = g->saddle ? limit->lipschitz * g->typical : 0;
  x->near_sine = g->saddle ? limit->near * g->typical : 0;
  x->growth = limit->growth;
  x->rank = limit->rank, x->regular = limit->regular * g->typical, x->drift = limit->drift_near;
  x->no_branch = 0.5 * x->drift * x->rank * x->rank;
  x->length = r->s->scale.length, x->per_length = per / r->s->scale.length, x->per_angle = per;
  x->moved = g->moved, x->reference = r->reference_level;
}

static void several_report (pw_run *r, const pw_scene_steps *x) {
  struct pw_method_data *d = r->data;
  pw_statistics *s = &r->statistics;
  pw_geometry *g = &r->geometry;
  r->t = x->t;
  d->t0 = x->t0, d->projected0 = r->projected;
  d->count += x->done;
  r->near = 0, r->w->failed = NULL;
  r->reference_level = x->reference, r->previous_norm = x->norm;
  s->steps += x->done;
  s->position = pw_larger (s->position, x->position), s->g = pw_larger (s->g, x->g);
  s->velocity = pw_larger (s->velocity, x->velocity), s->jv = pw_larger (s->jv, x->jv);
  pw_specialised_count (r, (long)x->stages * x->done, x->iterations);
  if (g->saddle == NULL) return;
  g->step = x->step, g->moved = x->moved, g->alert = 0;
  g->before = NAN, g->slope = 0, g->crossed = 0;
  g->t = r->t, g->start_sine = NAN;
  memcpy (g->q, r->q, (size_t)r->s->coords * sizeof *g->q);
}

int pw_several_plan (pw_run *r, double t, double t_end, pw_scene_steps *x) {
  struct pw_method_data *d = r->data;
  int count = several_suits (r) ? several_count (r, t, t_end) : 0;
  if (count < 2) return 0;
  *x = (pw_scene_steps){ .count = count,
                         .project = d->projects,
                         .stages = d->tableau->stages,
                         .row = d->row,
                         .c = d->tableau->c,
                         .h = r->settings.step,
                         .base = d->base,
                         .number = d->count,
                         .t = r->t,
                         .state = r->q,
                         .state0 = d->q0,
                         .ledger = r->ledger,
                         .ledger0 = d->ledger0,
                         .rate = r->rate,
                         .rate0 = d->rate0,
                         .V = d->V,
                         .A = d->A,
                         .R = d->R,
                         .configuration = r->w->configuration,
                         .J = r->w->J };
  several_watch (r, x);
  pw_specialised_scale (r);
  return count;
}

int pw_several_finish (pw_run *r, const pw_scene_steps *x, pw_error *error) {
  if (x->done > 0) several_report (r, x);
  if (x->done < x->count && pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  if (x->done == 0) return PW_OK;
  int status = pw_run_resolve (r, error);
  if (status == PW_OK) pw_ledger_note (r);
  return status;
}

int pw_run_advance_towards (pw_run *r, double t, double t_end, pw_error *error) {
  pw_scene_steps x;
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  if (pw_several_plan (r, t, t_end, &x) == 0) return pw_run_advance (r, t_end, error);
  r->stopped = 0;
  if (pw_run_stop_requested (r)) return PW_STOPPED;
  r->specialised->steps (r->scene, &x);
  int status = pw_several_finish (r, &x, error);
  return status == PW_OK && x.done == 0 ? pw_run_advance (r, t_end, error) : status;
}

int pw_run_advance_to (pw_run *r, double t, double t_end, pw_error *error) {
  if (pw_require (r, "a run", error) != PW_OK) return PW_INPUT;
  while (r->t < t && r->t < t_end) {
    int status = pw_run_advance_towards (r, t, t_end, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}
