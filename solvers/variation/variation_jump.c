/* Jumps of the accelerations at a surface in the space of states, such as vx = 0 of a force sign (vx).
 *
 * Let dy be the derivative of y = (q, v) by a parameter p at constant time.  If the motion meets a surface
 * s (y, t, p) = 0 at a time t_s, where y' jumps from y'- to y'+, dy jumps, too, as at breakpoints
 * (variation_breakpoint.c; Aizerman & Gantmakher 1958; Leine & Nijmeijer 2004):
 *
 *     dy+ = dy- + (y'- - y'+) dt_s/dp
 *
 * Neither the surface nor its gradient is known.  Bisection finds t_s of the run, and of motions nearby,
 * y + step dy + (t - t_s) y'-, by the equations of the run or of a neighbour: a state is on the side, before or after
 * the jump, to whose accelerations its own are nearer. */
#include <math.h>
#include <string.h>
#include "variation_parts.h"

enum { JUMP_MANY = 8 }; /* jumps in one step of a run: more are chatter */

/* Bisection ends at this interval of time, in units of the scene. */
static const double JUMP_SHORTEST = 1e-20;

/* Accelerations jump if they change over the last interval of the bisection by more than JUMP_PART of their largest
 * change over an interval before, and by more than JUMP_LEAST in units of the scene. */
static const double JUMP_PART = 0.25, JUMP_LEAST = 1e-6;

/* Accelerations that differ from those before a jump by less than this part of the jump belong to that side. */
static const double JUMP_BEFORE = 0.25;

/* An interval is searched if accelerations at its middle differ from the mean of those at its ends by more than this
 * part of their change. */
static const double JUMP_BEND = 0.1;

/* Times in units of the scene: motions nearby are searched for the surface within JUMP_NEAR of t_s, then ten times as
 * far, up to JUMP_FAR.  The run must be on one side JUMP_NEAR before t_s, on the other JUMP_NEAR after. */
static const double JUMP_NEAR = 1e-9, JUMP_FAR = 1e-2;

/* Largest difference of accelerations, in units of the scene. */
static double jump_distance (const pw_variation *x, const double *a, const double *b) {
  double most = 0, T = x->r->w->scale.time;
  for (int j = 0; j < x->n; j++) most = pw_larger_or_nan (most, fabs (a[j] - b[j]) * T * T / pw_unit (x->r->s, j));
  return most;
}

/* ---- Jumps of the run ---- */

/* The state between recorded ones, interpolated, and its accelerations by the equations; 3 n + 3. */
static int jump_state (pw_variation *x, double t, double *state, pw_error *error) {
  int n = x->n;
  pw_variation_state (x, t, state);
  return pw_variation_accelerations (x, t, state, state + n, state + 2 * n, error);
}

static void jump_replace (pw_variation *x, int i, double t, const double *state) {
  x->point[i].t = t;
  memcpy (x->point[i].x, state, 3 * (size_t)x->n * sizeof *state);
}

/* Inserts a state between points i and i + 1. */
static int jump_insert (pw_variation *x, int i, double t, const double *state, pw_error *error) {
  if (pw_variation_add_point (x, error) != PW_OK) return PW_RESOURCE;
  pw_variation_point p = x->point[x->points - 1];
  memmove (x->point + i + 2, x->point + i + 1, (size_t)(x->points - i - 2) * sizeof p);
  x->point[i + 1] = p;
  jump_replace (x, i + 1, t, state);
  return PW_OK;
}

/* Bisects the interval from t0 to t1, with the states `left` and `right`, towards the larger change of the
 * accelerations. *found: 1 if they jump between the times t0 and t1 that remain. */
static int jump_bisect (pw_variation *x, double *t0, double *t1, double *left, double *right, int *found,
                        pw_error *error) {
  double *middle = x->scratch, largest = jump_distance (x, left + 2 * x->n, right + 2 * x->n), t;
  size_t bytes = 3 * (size_t)x->n * sizeof *left;
  while (*t1 - *t0 > JUMP_SHORTEST * x->r->w->scale.time && (t = *t0 + (*t1 - *t0) / 2) > *t0 && t < *t1) {
    int status = jump_state (x, t, middle, error);
    if (status != PW_OK) return status;
    double before = jump_distance (x, left + 2 * x->n, middle + 2 * x->n),
           after = jump_distance (x, middle + 2 * x->n, right + 2 * x->n);
    largest = fmax (largest, fmax (before, after));
    if (!(fmax (before, after) > fmax (JUMP_LEAST, JUMP_PART * largest))) return PW_OK;
    memcpy (before < after ? left : right, middle, bytes);
    *(before < after ? t0 : t1) = t;
  }
  *found = 1;
  return PW_OK;
}

/* *suspected: 1 if accelerations between points i and i + 1 are not linear in time.  state: scratch, 3 n + 3 */
static int jump_suspected (pw_variation *x, int i, double *state, int *suspected, pw_error *error) {
  const double *left = x->point[i].x + 2 * x->n, *right = x->point[i + 1].x + 2 * x->n;
  double t = x->point[i].t + (x->point[i + 1].t - x->point[i].t) / 2, *a = state + 2 * x->n;
  int status = jump_state (x, t, state, error);
  double most = fmax (jump_distance (x, left, a), jump_distance (x, a, right));
  double *mean = state;
  for (int j = 0; j < x->n; j++) mean[j] = left[j] / 2 + right[j] / 2;
  *suspected = jump_distance (x, a, mean) > fmax (JUMP_LEAST, JUMP_BEND * most);
  return status;
}

/* Extends a recorded jump by one that adjoins it: a state may lie on the surface, where sign (0) = 0. */
static int jump_extend (pw_variation *x, int i, double t0, double t1, const double *left, const double *right) {
  if (i > 0 && x->point[i - 1].jumps && t0 == x->point[i].t)
    jump_replace (x, i, t1, right);
  else if (x->point[i + 1].jumps && t1 == x->point[i + 1].t)
    jump_replace (x, i + 1, t0, left);
  else
    return 0;
  return 1;
}

/* *found: 1 if a jump between points i and i + 1 has been found and recorded, with the states on both sides. */
static int jump_find (pw_variation *x, int i, int *found, pw_error *error) {
  double t0 = x->point[i].t, t1 = x->point[i + 1].t, *left = x->values, *right = left + 3 * x->n + 3;
  int status = jump_suspected (x, i, left, found, error);
  if (status != PW_OK || !*found) return status;
  *found = 0;
  status = jump_state (x, t0, left, error);
  if (status == PW_OK) status = jump_state (x, t1, right, error);
  if (status == PW_OK) status = jump_bisect (x, &t0, &t1, left, right, found, error);
  if (status != PW_OK || !*found || jump_extend (x, i, t0, t1, left, right)) return status;
  int before = t0 > x->point[i].t ? i + 1 : i; /* the point just before the jump */
  if (before > i)
    status = jump_insert (x, i, t0, left, error);
  else
    memcpy (x->point[i].x + 2 * x->n, left + 2 * x->n, (size_t)x->n * sizeof *left);
  x->point[before].jumps = 1;
  return status == PW_OK && t1 < x->point[before + 1].t ? jump_insert (x, before, t1, right, error) : status;
}

int pw_variation_find_jumps (pw_variation *x, int first, pw_error *error) {
  int found, status = PW_OK, many = 0;
  if (!x->may_jump) return PW_OK;
  for (int i = first; i + 1 < x->points && status == PW_OK; i += !found) {
    found = 0;
    if (x->point[i].jumps) continue;
    status = jump_find (x, i, &found, error);
    many += found;
    if (status == PW_OK && many > JUMP_MANY)
      return pw_fail (error, PW_METHOD,
                      "t = %.6g s: accelerations jump more than %d times in one step of the run: the "
                      "motion is not differentiable",
                      x->point[i].t, JUMP_MANY);
  }
  return status;
}

double pw_variation_recorded_jump (const pw_variation *x) {
  for (int i = 0; i < x->points; i++)
    if (x->point[i].jumps && x->point[i].t >= x->t) return x->point[i].t;
  return INFINITY;
}

/* ---- Derivatives of the times of jumps ---- */

static int jump_fail (double t, pw_error *error) {
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the motion touches, slides along, or starts at states where accelerations jump: "
                  "it is not differentiable",
                  t);
}

/* A motion y + step dy + (t - t_s) y'- near that of the run, or, with step 0, the run itself. */
typedef struct {
  pw_variation *x;
  pw_run *r;                    /* whose equations it has: the run or a neighbouring one */
  double t, t_after;            /* t_s, and the recorded time after it */
  const double *before, *after; /* q, v, a of the run at t_s, on both sides */
  const double *dy;             /* 2 n: for q, v */
  double step;                  /* step dy has the units of q, v */
} jump_motion;

/* The run at the recorded jump at time t. */
static jump_motion jump_of (pw_variation *x, double t) {
  const pw_variation_point *p = x->point;
  while (!(p->jumps && p->t == t)) p++;
  return (jump_motion){ .x = x, .r = x->r, .t = t, .t_after = p[1].t, .before = p[0].x, .after = p[1].x };
}

/* n + 3: where jump_side leaves the accelerations. */
static double *jump_scratch_a (const pw_variation *x) {
  return x->scratch + 2 * (x->n + 3);
}

/* *after: 1 if the accelerations of the motion at time t_s + delay are nearer to those after the jump than to those
 * before it.  A status. */
static int jump_side (const jump_motion *k, double delay, int *after) {
  pw_variation *x = k->x;
  int n = x->n;
  double *q = x->scratch, *v = q + n + 3, *a = jump_scratch_a (x), *lambda = a + n + 3;
  for (int j = 0; j < n; j++) {
    q[j] = k->before[j] + k->step * k->dy[j] + delay * k->before[n + j];
    v[j] = k->before[n + j] + k->step * k->dy[n + j] + delay * k->before[2 * n + j];
  }
  pw_statistics statistics = k->r->statistics;
  int near = k->r->near_singular, status = pw_run_accelerate (k->r, k->t + delay, q, v, a, lambda);
  k->r->statistics = statistics;
  k->r->near_singular = near;
  *after = jump_distance (x, a, k->after + 2 * n) < jump_distance (x, a, k->before + 2 * n);
  return status;
}

/* The time at which the motion meets the surface, minus t_s, to 12 digits; NaN: never, or it cannot be evaluated. */
static double jump_time (const jump_motion *k) {
  double T = k->x->r->w->scale.time, lo, hi, middle;
  int lo_is_after = 1, hi_is_after = 0, is_after;
  for (double near = JUMP_NEAR; (lo_is_after || !hi_is_after) && near <= JUMP_FAR; near *= 10) {
    lo = -near * T, hi = near * T;
    if (jump_side (k, lo, &lo_is_after) != PW_OK || jump_side (k, hi, &hi_is_after) != PW_OK) return NAN;
  }
  if (lo_is_after || !hi_is_after) return NAN;
  while ((middle = lo + (hi - lo) / 2) > lo && middle < hi) {
    if (jump_side (k, middle, &is_after) != PW_OK) return NAN;
    *(is_after ? &hi : &lo) = middle;
    if (hi - lo < fmax (1e-12 * fabs (middle), JUMP_SHORTEST * T)) break;
  }
  return fabs (middle) > 2 * JUMP_SHORTEST * T ? middle : 0;
}

/* The directional derivative of t_s along the change of state c->Y. */
static double jump_along (const pw_variation_column *c, jump_motion k) {
  double step = pw_variation_step_along (c);
  k.dy = c->Y;
  k.step = step;
  double forward = jump_time (&k);
  k.step = -step;
  return (forward - jump_time (&k)) / (2 * step);
}

/* The derivative of t_s or, of column 1, its error: due to that of the state's derivative and that of differences. */
static double jump_slope (const pw_variation_column *c, jump_motion k) {
  const pw_direction *d = &c->direction->given;
  int index = pw_variation_column_index (c);
  double slope = d->initial || index == 1 ? jump_along (c, k) : 0;
  k.dy = c->direction->column[0].Y;
  for (int i = 0; i < PW_VARIATION_NEIGHBOURS && d->initial == NULL; i++) {
    double weight = pw_direction_weight (d, index, i);
    k.r = d->neighbour[i];
    k.step = pw_direction_offset (d, i);
    if (weight != 0) slope += weight * jump_time (&k);
  }
  return slope;
}

/* 1 if the motion leaves the surface after the jump, instead of sliding along it: with the accelerations after the jump
 * (step dy replaces those before, which jump_side uses) the motion is on that side a short time later. */
static int jump_leaves (jump_motion k) {
  int n = k.x->n, is_after;
  double *dy = k.x->output;
  for (int j = 0; j < n; j++) dy[j] = 0, dy[n + j] = k.after[2 * n + j] - k.before[2 * n + j];
  k.dy = dy, k.step = JUMP_NEAR * k.x->r->w->scale.time;
  return jump_side (&k, k.step, &is_after) == PW_OK && is_after;
}

/* 1 if the motion has not started at the jump: at an earlier state, accelerations are those before the jump. */
static int jump_arrives (jump_motion k) {
  int n = k.x->n, is_after;
  double delay = -JUMP_NEAR * k.x->r->w->scale.time, *a = jump_scratch_a (k.x);
  k.dy = k.before; /* without effect: step is 0 */
  return jump_side (&k, delay, &is_after) == PW_OK &&
         jump_distance (k.x, a, k.before + 2 * n) <
             JUMP_BEFORE * jump_distance (k.x, k.before + 2 * n, k.after + 2 * n);
}

/* The largest difference between t_s and the times at which motions nearby meet the surface: by the neighbours'
 * equations from the state of the run; with the ledger, also by the run's equations from the states, displaced along
 * each column, between which powers are differentiated. */
static double jump_width (pw_variation *x, jump_motion k) {
  double most = 0;
  PW_EACH_COLUMN (c, x)
  for (int sign = -1; sign <= 1 && x->ledger; sign += 2) {
    k.dy = c->Y, k.step = sign * pw_variation_step_along (c);
    most = pw_larger_or_nan (most, fabs (jump_time (&k)));
  }
  k.dy = k.before, k.step = 0; /* dy is without effect */
  for (pw_direction_copy *d = x->direction; d < x->direction + x->count; d++)
    for (int i = 0; i < PW_VARIATION_NEIGHBOURS && d->given.initial == NULL; i++) {
      k.r = d->given.neighbour[i];
      most = pw_larger_or_nan (most, fabs (jump_time (&k)));
    }
  return most;
}

/* Stores the state at t_side + delay, extrapolated linearly from `state`, that at t_side on one side of the jump. */
static void jump_hold (pw_variation_hold *h, const double *state, double t_side, double delay, int n) {
  for (int j = 0; j < 2 * n; j++) h->state[j] = state[j] + delay * state[n + j];
  h->t = t_side + delay;
  h->from = fmin (t_side, h->t), h->to = fmax (t_side, h->t);
}

int pw_variation_approach_jump (pw_variation *x, pw_error *error) {
  double t = pw_variation_recorded_jump (x);
  if (isinf (t) || t == x->hold[0].to) return PW_OK;
  jump_motion k = jump_of (x, t);
  double width = 2 * jump_width (x, k);
  if (!isfinite (width)) return jump_fail (t, error);
  jump_hold (&x->hold[0], k.before, t, -width, x->n);
  jump_hold (&x->hold[1], k.after, k.t_after, width, x->n);
  if (x->t < x->hold[0].from) return PW_OK;
  /* the derivatives are already within the interval: their rates are those at the held state */
  PW_EACH_COLUMN (c, x) memcpy (c->trial, c->Y, (size_t)x->size * sizeof *c->Y);
  int status = pw_variation_evaluate_at (x, x->t, error);
  return status == PW_OK ? pw_variation_restart (x, error) : status;
}

int pw_variation_pass_jump (pw_variation *x, pw_error *error) {
  jump_motion k = jump_of (x, x->t);
  int time_varies = 0, smooth = jump_leaves (k);
  PW_EACH_COLUMN (c, x) {
    c->slope = jump_slope (c, k);
    smooth &= isfinite (c->slope) != 0;
    time_varies |= c->slope != 0;
  }
  /* a motion may start at the jump if t_s does not depend on the parameters */
  if (!smooth || (time_varies && !jump_arrives (k))) return jump_fail (x->t, error);
  return pw_variation_jump (x, k.t_after, k.after, error);
}
