/* Change points: configurations at which branches of a motion cross, or nearly do.
 *
 * In suitable coordinates the constraints near one are x y = e, with the sine |(x, y)|.  For e = 0 the branches
 * cross and the motion goes straight on; for e != 0 it turns within a distance of sqrt (e), and a step that is
 * longer than that can go straight on to the other branch, where all constraints hold again.  Neither residuals nor
 * energies reveal this.
 *
 * So where the sine may have had a minimum within a step, a walk on the constraint manifold leads from its beginning
 * to its end, in strides proportional to the sine, each followed by a projection.  If the walk stalls, the end is on
 * another branch.  Where the sine falls below `floor`, the branches cross to round-off: the walk steps over such a
 * point, and the motion must continue straight on.  (Following a solution curve by predictor and projection: Allgower
 * & Georg 2003, Introduction to numerical continuation methods, chapters 2 and 8.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* Strides of a walk, and evaluations between the ends of a step, at most; a stride that fails is made longer, up to
 * 1.7^7 = 41 times. */
enum { CHANGE_STRIDES = 1000, CHANGE_TRIES = 8 };

typedef enum { CHANGE_SAME, CHANGE_OTHER, CHANGE_UNKNOWN } change_verdict;

typedef struct {
  pw_run *r;
  pw_projector projector;
  double t, *q, *next;       /* position of the walk, and a candidate for the next */
  double *end, *in;          /* end of the walk; the last position before a crossing, and the first one inside */
  double sine, least, slope; /* sine at q; smallest sine; its fastest change per unit of motion */
  int inside, turned;        /* 1: stepping over a crossing of branches; one was not left straight on */
  int row;                   /* where the sine was smallest */
} change_walk;

/* (a - b) . (c - d), lengths in units of L. */
static double change_dot (const pw_system *s, const double *a, const double *b, const double *c, const double *d) {
  double sum = 0;
  for (int j = 0; j < s->coords; j++) {
    double unit = pw_unit (s, j);
    sum += (a[j] - b[j]) / unit * ((c[j] - d[j]) / unit);
  }
  return sum;
}

static double change_distance (const pw_system *s, const double *a, const double *b) {
  return sqrt (change_dot (s, a, b, a, b));
}

/* Projects q onto the constraints; *sine: the sine there. */
static int change_project (change_walk *w, double t, double *q, double *sine) {
  pw_run *r = w->r;
  int row, status = pw_project_positions (&w->projector, r, t, q, r->v);
  if (status != PW_OK) return status;
  status = pw_saddle_factor (w->projector.position);
  *sine = pw_saddle_pivot (w->projector.position, &row);
  if (status != PW_OK) *sine = 0;
  if (*sine < w->least) w->least = *sine, w->row = row;
  return PW_OK;
}

/* Records where a crossing of branches is entered; checks that each is left straight on. */
static void change_straight (change_walk *w, double sine) {
  const pw_system *s = w->r->s;
  const double inside = w->r->limits.crossing;
  size_t n = (size_t)s->coords * sizeof (double);
  if (!w->inside && sine < inside) {
    memcpy (w->in, w->q, n);
    memcpy (w->in + s->coords, w->next, n);
  } else if (w->inside && sine >= inside) {
    const double *from = w->in, *to = from + s->coords;
    double along = change_dot (s, to, from, w->next, w->q);
    w->turned |= !(along > w->r->limits.straight * change_distance (s, to, from) * change_distance (s, w->next, w->q));
  }
  w->inside = sine < inside;
}

/* Steps to q + part (to - q), projected; tries longer strides if that fails.  PW_RETRY if all fail. */
static int change_stride (change_walk *w, const double *to, double t1, double part) {
  const pw_system *s = w->r->s;
  double sine, t, *swap = w->next;
  for (int tries = 0; tries < CHANGE_TRIES; tries++, part *= 1.7) {
    for (int j = 0; j < s->coords; j++) w->next[j] = w->q[j] + part * (to[j] - w->q[j]);
    t = w->t + fmin (1, part) * (t1 - w->t);
    if (change_project (w, t, w->next, &sine) != PW_OK) continue;
    double length = change_distance (s, w->next, w->q);
    change_straight (w, sine);
    w->slope = fmax (w->slope, fabs (sine - w->sine) / fmax (length, w->r->limits.floor));
    w->next = w->q, w->q = swap;
    w->t = t, w->sine = sine;
    return PW_OK;
  }
  return PW_RETRY;
}

/* Length of the next stride: a part of the distance at which the sine could vanish. */
static double change_length (const change_walk *w) {
  const pw_watchdog *limit = &w->r->limits;
  return fmax (fmin (limit->stride * w->sine / w->slope, limit->stride), limit->floor);
}

static change_verdict change_follow (change_walk *w) {
  pw_run *r = w->r;
  const pw_geometry *g = &r->geometry;
  double sine, end = r->t;
  w->t = g->t;
  w->least = INFINITY;
  w->slope = g->typical;
  memcpy (w->q, g->q, (size_t)r->s->coords * sizeof *w->q);
  memcpy (w->end, r->q, (size_t)r->s->coords * sizeof *w->q);
  if (change_project (w, end, w->end, &sine) != PW_OK || change_project (w, w->t, w->q, &w->sine) != PW_OK)
    return CHANGE_UNKNOWN;
  for (int i = 0; i < CHANGE_STRIDES; i++) {
    double distance = change_distance (r->s, w->q, w->end);
    if (distance <= r->limits.floor) return w->turned ? CHANGE_OTHER : CHANGE_SAME;
    double part = fmin (1, change_length (w) / distance);
    if (change_stride (w, w->end, end, part) != PW_OK) return CHANGE_UNKNOWN;
    if (change_distance (r->s, w->q, w->end) <= distance * (1 - r->limits.progress * part)) continue;
    if (w->least > r->limits.low * g->typical) return CHANGE_UNKNOWN;
    return CHANGE_OTHER;
  }
  return CHANGE_UNKNOWN;
}

/* ---- The check ---- */

static change_verdict change_walk_there (pw_run *r, change_walk *w, pw_error *error) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords + 3;
  double *memory = malloc (5 * n * sizeof *memory);
  const pw_residuals known = r->residuals;
  const pw_statistics statistics = r->statistics;
  change_verdict verdict = CHANGE_UNKNOWN;
  *w = (change_walk){ .r = r, .row = -1 };
  if (memory == NULL) {
    pw_fail_memory (s, error);
    return verdict;
  }
  w->q = memory, w->next = w->q + n, w->end = w->next + n, w->in = w->end + n;
  pw_rank_weights (s, w->in);
  if (pw_projector_open (&w->projector, r, w->in, NULL, error) == PW_OK) {
    verdict = change_follow (w);
    pw_projector_close (&w->projector);
  }
  free (memory);
  r->residuals = known;
  r->statistics = statistics;
  return verdict;
}

static double change_sine_at (pw_run *r, double t, const double *q) {
  if (pw_evaluate_J_at (r->w, t, q, r->v) != PW_OK) return 0;
  return pw_watchdog_sine (r, NULL);
}

/* 1 if the sine is low somewhere on the straight line between the ends of a long step. */
static int change_low_between (pw_run *r, double length) {
  const pw_geometry *g = &r->geometry;
  int parts = (int)fmin (length / r->limits.stride, CHANGE_STRIDES) + 1;
  for (int i = 1; i < parts; i++) {
    double x = (double)i / parts;
    for (int j = 0; j < r->s->coords; j++) r->q_at[j] = g->q[j] + x * (r->q[j] - g->q[j]);
    if (change_sine_at (r, g->t + x * (r->t - g->t), r->q_at) < r->limits.low * g->typical) return 1;
  }
  return 0;
}

/* 1 if the sine may have a minimum within the step that is low enough to matter. */
static int change_may_be_low (pw_run *r, double start_sine, double sine, double length) {
  double low = r->limits.low * fmin (start_sine, sine);
  if (start_sine + sine - r->limits.lipschitz * r->geometry.typical * length > 2 * low) return 0;
  return length <= r->limits.stride || change_low_between (r, length);
}

/* apart: distance of the branches, estimated as the sine over its change per unit of motion. */
static int change_fail (pw_run *r, int row, double apart, const char *what, double length, pw_error *error) {
  char element[120] = "the constraints";
  if (row >= 0) pw_system_row_name (r->s, row, element, sizeof element);
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: change point at %s: %s; branches come within %.2g of each other, the step is "
                  "%.2g long (scaled); use a smaller %s",
                  r->t, element, what, apart, length, pw_fixed_steps (r) ? "step" : "tolerance");
}

int pw_change_point_resolve (pw_run *r, double last, pw_error *error) {
  pw_geometry *g = &r->geometry;
  if (isnan (last) || g->step == 0) return PW_OK;
  g->slope = fmax (g->slope, fabs (g->state_sine - last) / g->step);
  if (!g->loops || !pw_fixed_steps (r) || g->crossed || g->row >= r->s->holonomic) return PW_OK;
  if (!(last < g->before && last < g->state_sine) || g->step * g->slope <= r->limits.resolved * last) return PW_OK;
  return change_fail (r, g->row, last / g->slope, "the step does not resolve it", g->step, error);
}

/* Reports the result of a walk. */
static int change_report (pw_run *r, const change_walk *w, change_verdict verdict, double sine, double length,
                          pw_error *error) {
  pw_geometry *g = &r->geometry;
  double low = r->limits.unresolved * fmin (g->start_sine, sine);
  g->crossed |= verdict == CHANGE_UNKNOWN || w->least <= r->limits.crossing;
  if (verdict == CHANGE_OTHER)
    return change_fail (r, w->row, w->least / w->slope, "the motion has left its branch", length, error);
  if (verdict == CHANGE_SAME && !g->crossed && w->least < low)
    return change_fail (r, w->row, w->least / w->slope, "the step does not resolve it", length, error);
  return PW_OK;
}

int pw_change_point_check (pw_run *r, double sine, pw_error *error) {
  pw_geometry *g = &r->geometry;
  change_walk w;
  pw_error why = { 0 };
  double length = change_distance (r->s, r->q, g->q);
  if (!g->loops || length == 0) return PW_OK;
  if (isnan (g->start_sine)) g->start_sine = change_sine_at (r, g->t, g->q);
  int suspect = change_may_be_low (r, g->start_sine, sine, length);
  change_verdict verdict = suspect ? change_walk_there (r, &w, &why) : CHANGE_UNKNOWN;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  if (why.status != PW_OK) return pw_fail (error, why.status, "%s", why.text);
  return suspect ? change_report (r, &w, verdict, sine, length, error) : PW_OK;
}
