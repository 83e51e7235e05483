/* Jumps of the accelerations at a surface in the space of states, such as vx = 0 of a force sign (vx).
 *
 * Where the motion crosses the surface s (y, t, p) = 0, y = (q, v), and y' jumps from y'- to y'+, derivatives jump by
 *
 *     dy+ = dy- + (y'- - y'+) dt_s/dp
 *
 * as at breakpoints (variation_breakpoint.c), with the time t_s at which the motion meets the surface (Aizerman &
 * Gantmakher 1958; Leine & Nijmeijer 2004).  Neither the surface nor its gradient is known.  Bisection finds t_s of the
 * run, and of motions nearby, y + step dy + (t - t_s) y'-, with the equations of the run or of its neighbours: the
 * accelerations are nearer to those of one side or of the other. */
#include <math.h>
#include <string.h>
#include "variation_parts.h"

enum { JUMP_MANY = 8 }; /* jumps in one step of a run: more are chatter */

/* The interval of time at which bisection ends, in units of the scene. */
static const double JUMP_ZERO = 1e-20;

/* Accelerations jump if they change over the last interval of the bisection by more than JUMP_PART of their largest
 * change over an interval before, and by more than JUMP_LEAST in units of the scene. */
static const double JUMP_PART = 0.25, JUMP_LEAST = 1e-6;

/* An interval is searched if accelerations at its middle differ from the mean of those at its ends by more than this
 * part of their change. */
static const double JUMP_BEND = 0.1;

/* The first and the largest interval of time in which a motion nearby is searched for the surface, in units of the
 * scene; JUMP_NEAR is also the time after which the run must have left it. */
static const double JUMP_NEAR = 1e-9, JUMP_FAR = 1e-2;

/* Largest difference of accelerations, in units of the scene. */
static double jump_distance (const pw_variation *x, const double *a, const double *b) {
  double most = 0, T = x->r->w->scale.time;
  for (int j = 0; j < x->n; j++) most = pw_larger_or_nan (most, fabs (a[j] - b[j]) * T * T / pw_unit (x->r->s, j));
  return most;
}

/* ---- Jumps of the run ---- */

/* The state and the accelerations between recorded ones. */
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
  while (*t1 - *t0 > JUMP_ZERO * x->r->w->scale.time && (t = *t0 + (*t1 - *t0) / 2) > *t0 && t < *t1) {
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

/* *suspected: 1 if accelerations between points i and i + 1 may jump: they are not linear in time.  state: 3 n */
static int jump_suspected (pw_variation *x, int i, double *state, int *suspected, pw_error *error) {
  const double *left = x->point[i].x + 2 * x->n, *right = x->point[i + 1].x + 2 * x->n;
  double t = x->point[i].t + (x->point[i + 1].t - x->point[i].t) / 2, *a = state + 2 * x->n;
  int status = jump_state (x, t, state, error);
  double most = fmax (jump_distance (x, left, a), jump_distance (x, a, right));
  for (int j = 0; j < x->n; j++) a[j] -= left[j] / 2, state[j] = right[j] / 2; /* the distance from the mean */
  *suspected = jump_distance (x, a, state) > fmax (JUMP_LEAST, JUMP_BEND * most);
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
  double t0 = x->point[i].t, t1 = x->point[i + 1].t, *left = x->values, *right = left + 3 * x->n;
  int status = jump_suspected (x, i, left, found, error);
  if (status != PW_OK || !*found) return status;
  *found = 0;
  status = jump_state (x, t0, left, error);
  if (status == PW_OK) status = jump_state (x, t1, right, error);
  if (status == PW_OK) status = jump_bisect (x, &t0, &t1, left, right, found, error);
  if (status != PW_OK || !*found || jump_extend (x, i, t0, t1, left, right)) return status;
  if (t0 > x->point[i].t)
    status = jump_insert (x, i++, t0, left, error);
  else
    memcpy (x->point[i].x + 2 * x->n, left + 2 * x->n, (size_t)x->n * sizeof *left);
  x->point[i].jumps = 1;
  return status == PW_OK && t1 < x->point[i + 1].t ? jump_insert (x, i, t1, right, error) : status;
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

/* ---- Derivatives of their times ---- */

static int jump_fail (double t, pw_error *error) {
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the motion touches, slides along, or starts at states where accelerations jump: "
                  "it is not differentiable",
                  t);
}

/* A motion near that of the run, y + step dy + (t - t_s) y'-. */
typedef struct {
  pw_variation *x;
  pw_run *r;                    /* its equations: those of the run or of a neighbouring one */
  double t, t_after;            /* t_s, and the recorded time after it */
  const double *before, *after; /* q, v, a of the run at t_s, on both sides */
  const double *dy;
  double step;
} jump_neighbour;

/* The run at the recorded jump at time t. */
static jump_neighbour jump_of (pw_variation *x, double t) {
  const pw_variation_point *p = x->point;
  while (!(p->jumps && p->t == t)) p++;
  return (jump_neighbour){ .x = x, .r = x->r, .t = t, .t_after = p[1].t, .before = p[0].x, .after = p[1].x };
}

/* n + 3: where jump_side leaves the accelerations. */
static double *jump_scratch_a (const pw_variation *x) {
  return x->scratch + 2 * (x->n + 3);
}

/* *after: 1 if the accelerations of the motion at time t_s + delay are nearer to those after the jump than to those
 * before it.  A status. */
static int jump_side (const jump_neighbour *k, double delay, int *after) {
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
static double jump_time (const jump_neighbour *k) {
  double T = k->x->r->w->scale.time, lo, hi, middle;
  int before = 1, after = 0, side;
  for (double near = JUMP_NEAR; (before || !after) && near <= JUMP_FAR; near *= 10) {
    lo = -near * T, hi = near * T;
    if (jump_side (k, lo, &before) != PW_OK || jump_side (k, hi, &after) != PW_OK) return NAN;
  }
  if (before || !after) return NAN;
  while ((middle = lo + (hi - lo) / 2) > lo && middle < hi) {
    if (jump_side (k, middle, &side) != PW_OK) return NAN;
    *(side ? &hi : &lo) = middle;
    if (hi - lo < fmax (1e-12 * fabs (middle), JUMP_ZERO * T)) break;
  }
  return fabs (middle) > 2 * JUMP_ZERO * T ? middle : 0;
}

/* The directional derivative of t_s along the change of state c->Y. */
static double jump_along (const pw_variation_column *c, jump_neighbour k) {
  double step = pw_variation_step_along (c);
  k.dy = c->Y;
  k.step = step;
  double later = jump_time (&k);
  k.step = -step;
  return (later - jump_time (&k)) / (2 * step);
}

/* The derivative of t_s, or its error, the sum of those due to the state's error and to the differences' one. */
static double jump_slope (const pw_variation_column *c, jump_neighbour k) {
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

/* 1 if the motion leaves the surface after the jump, instead of sliding along it: with the velocities and accelerations
 * after it (dy adds their difference to those before, times step), it is on that side a short time later. */
static int jump_leaves (jump_neighbour k) {
  int n = k.x->n, side;
  double *dy = k.x->output;
  for (int j = 0; j < n; j++) dy[j] = 0, dy[n + j] = k.after[2 * n + j] - k.before[2 * n + j];
  k.dy = dy, k.step = JUMP_NEAR * k.x->r->w->scale.time;
  return jump_side (&k, k.step, &side) == PW_OK && side;
}

/* 1 if the motion has not started at the jump: at an earlier state, accelerations are those before the jump. */
static int jump_arrives (jump_neighbour k) {
  int n = k.x->n, side;
  double delay = -JUMP_NEAR * k.x->r->w->scale.time, *a = jump_scratch_a (k.x);
  k.dy = k.before; /* without effect: step is 0 */
  return jump_side (&k, delay, &side) == PW_OK &&
         jump_distance (k.x, a, k.before + 2 * n) < JUMP_PART * jump_distance (k.x, k.before + 2 * n, k.after + 2 * n);
}

/* The largest difference between t_s and the times at which motions nearby meet the surface: those of the neighbouring
 * runs from the state of the run, and with the ledger those of the run from states displaced along each column, at
 * which powers are differentiated. */
static double jump_width (pw_variation *x, jump_neighbour k) {
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

/* Holds the state at t_side + delay, linearly from that at t_side, on one side of the jump. */
static void jump_hold (pw_variation_hold *h, const double *state, double t_side, double delay, int n) {
  for (int j = 0; j < 2 * n; j++) h->state[j] = state[j] + delay * state[n + j];
  h->t = t_side + delay;
  h->from = fmin (t_side, h->t), h->to = fmax (t_side, h->t);
}

int pw_variation_approach_jump (pw_variation *x, pw_error *error) {
  double t = pw_variation_recorded_jump (x);
  if (isinf (t) || t == x->hold[0].to) return PW_OK;
  jump_neighbour k = jump_of (x, t);
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
  jump_neighbour k = jump_of (x, x->t);
  int time_varies = 0, smooth = jump_leaves (k);
  PW_EACH_COLUMN (c, x) {
    c->slope = jump_slope (c, k);
    smooth &= isfinite (c->slope);
    time_varies |= c->slope != 0;
  }
  /* a motion may start at the jump if t_s does not depend on the parameters */
  if (!smooth || (time_varies && !jump_arrives (k))) return jump_fail (x->t, error);
  return pw_variation_jump (x, k.t_after, k.after, error);
}
