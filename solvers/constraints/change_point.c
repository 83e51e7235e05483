/* Change points: configurations at which branches of a motion cross, or nearly do.
 *
 * In suitable coordinates the constraints near one are x y = e; the sine of the smallest angle between their rows
 * (watchdog.h) is |(x, y)|.  For e = 0 the branches cross and the motion goes straight on; for e != 0 it turns within a
 * distance of sqrt (e), and a step that is longer than that can go straight on to the other branch, where all
 * constraints hold again.  Neither residuals nor energies reveal this.
 *
 * So where the sine may have had a minimum within a step, a walk on the constraint manifold leads from its beginning to
 * its end, in strides proportional to the sine, each followed by a projection.  If the walk does not get closer to the
 * end, that is on another branch.  Where the sine falls below the threshold `floor`, the branches cross to round-off:
 * the walk steps over such a point, and the motion must continue straight on.  (Following a solution curve by predictor
 * and projection: Allgower & Georg 2003, Introduction to numerical continuation methods, chapters 2 and 8.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* Strides of a walk, and evaluations between the ends of a step, at most; a stride that fails is made longer by the
 * factor CHANGE_LONGER, which in all attempts is 1.7^7 = 41 times. */
enum { CHANGE_STRIDES = 1000, CHANGE_ATTEMPTS = 8 };
static const double CHANGE_LONGER = 1.7;

typedef enum { CHANGE_SAME_BRANCH, CHANGE_OTHER_BRANCH, CHANGE_UNKNOWN } change_verdict;

typedef struct {
  pw_run *r;
  pw_projector projector;
  double t, *q, *next; /* time and coordinates that the walk has reached; its next coordinates */
  double *target;      /* the end of the step */
  double *entry;       /* 2 coords: the last coordinates before a crossing of branches, and the first ones in it */
  double sine;         /* at q */
  double sine_slope;   /* fastest change of the sine per unit of motion */
  double least_sine;   /* smallest sine so far */
  int least_row;       /* the row that had it */
  int in_crossing;     /* 1: stepping over a crossing of branches */
  int turned;          /* 1: a crossing was not left straight on */
} change_walk;

/* Scalar product (a - b) . (c - d), lengths in units of L. */
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
  *sine = pw_saddle_sine (w->projector.position, &row);
  if (status != PW_OK) *sine = 0;
  if (*sine < w->least_sine) w->least_sine = *sine, w->least_row = row;
  return PW_OK;
}

/* For a stride from q to next, where the sine is `sine`: records where a crossing of branches is entered, and checks
 * that it is left in about the same direction. */
static void change_watch_crossing (change_walk *w, double sine) {
  const pw_system *s = w->r->s;
  const int in_crossing = sine < w->r->limits.crossing;
  size_t bytes = (size_t)s->coords * sizeof (double);
  if (!w->in_crossing && in_crossing) {
    memcpy (w->entry, w->q, bytes);
    memcpy (w->entry + s->coords, w->next, bytes);
  } else if (w->in_crossing && !in_crossing) {
    const double *from = w->entry, *to = from + s->coords;
    double along = change_dot (s, to, from, w->next, w->q);
    w->turned |= !(along > w->r->limits.straight * change_distance (s, to, from) * change_distance (s, w->next, w->q));
  }
  w->in_crossing = in_crossing;
}

/* Steps to q + part (target - q), projected; tries longer strides if that fails.  PW_RETRY if all fail. */
static int change_stride (change_walk *w, double part) {
  const pw_system *s = w->r->s;
  double sine, t, *swap = w->next;
  for (int attempt = 0; attempt < CHANGE_ATTEMPTS; attempt++, part *= CHANGE_LONGER) {
    for (int j = 0; j < s->coords; j++) w->next[j] = w->q[j] + part * (w->target[j] - w->q[j]);
    t = w->t + fmin (1, part) * (w->r->t - w->t);
    if (change_project (w, t, w->next, &sine) != PW_OK) continue;
    double length = change_distance (s, w->next, w->q);
    change_watch_crossing (w, sine);
    w->sine_slope = fmax (w->sine_slope, fabs (sine - w->sine) / fmax (length, w->r->limits.floor));
    w->next = w->q, w->q = swap;
    w->t = t, w->sine = sine;
    return PW_OK;
  }
  return PW_RETRY;
}

/* Length of the next stride: a part of the distance at which the sine could vanish. */
static double change_length (const change_walk *w) {
  const pw_thresholds *limit = &w->r->limits;
  return fmax (fmin (limit->stride * w->sine / w->sine_slope, limit->stride), limit->floor);
}

/* Walks from the beginning of the step to its end. */
static change_verdict change_follow (change_walk *w) {
  pw_run *r = w->r;
  const pw_geometry *g = &r->geometry;
  double sine;
  w->t = g->previous_t;
  w->least_sine = INFINITY;
  w->sine_slope = g->largest_sine;
  memcpy (w->q, g->previous_q, (size_t)r->s->coords * sizeof *w->q);
  memcpy (w->target, r->q, (size_t)r->s->coords * sizeof *w->q);
  if (change_project (w, r->t, w->target, &sine) != PW_OK || change_project (w, w->t, w->q, &w->sine) != PW_OK)
    return CHANGE_UNKNOWN;
  for (int i = 0; i < CHANGE_STRIDES; i++) {
    double distance = change_distance (r->s, w->q, w->target);
    if (distance <= r->limits.floor) return w->turned ? CHANGE_OTHER_BRANCH : CHANGE_SAME_BRANCH;
    double part = fmin (1, change_length (w) / distance);
    if (change_stride (w, part) != PW_OK) return CHANGE_UNKNOWN;
    if (change_distance (r->s, w->q, w->target) <= distance * (1 - r->limits.progress * part)) continue;
    if (w->least_sine > r->limits.low * g->largest_sine) return CHANGE_UNKNOWN;
    return CHANGE_OTHER_BRANCH;
  }
  return CHANGE_UNKNOWN;
}

/* ---- The check ---- */

/* Walks along the last step; the run's residuals and statistics stay as they are. */
static change_verdict change_walk_step (pw_run *r, change_walk *w, pw_error *error) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords + 3;
  double *memory = malloc (5 * n * sizeof *memory);
  const pw_residuals known = r->residuals;
  const pw_statistics statistics = r->statistics;
  change_verdict verdict = CHANGE_UNKNOWN;
  *w = (change_walk){ .r = r, .least_row = -1 };
  if (memory == NULL) {
    pw_fail_memory (s, error);
    return verdict;
  }
  w->q = memory, w->next = w->q + n, w->target = w->next + n, w->entry = w->target + n;
  pw_length_weights (s, w->entry);
  if (pw_projector_open (&w->projector, r, w->entry, NULL, error) == PW_OK) {
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

/* 1 if the sine is low somewhere on the straight line between the ends of a long step.  The sample arrays are
 * scratch. */
static int change_low_between (pw_run *r, double length) {
  const pw_geometry *g = &r->geometry;
  int parts = (int)fmin (length / r->limits.stride, CHANGE_STRIDES) + 1;
  for (int i = 1; i < parts; i++) {
    double part = (double)i / parts, t = g->previous_t + part * (r->t - g->previous_t);
    for (int j = 0; j < r->s->coords; j++) r->q_at[j] = g->previous_q[j] + part * (r->q[j] - g->previous_q[j]);
    if (change_sine_at (r, t, r->q_at) < r->limits.low * g->largest_sine) return 1;
  }
  return 0;
}

/* 1 if the sine may have a minimum within the step that is low enough to matter. */
static int change_may_be_low (pw_run *r, double previous_sine, double sine, double length) {
  double low = r->limits.low * fmin (previous_sine, sine);
  if (previous_sine + sine - r->limits.lipschitz * r->geometry.largest_sine * length > 2 * low) return 0;
  return length <= r->limits.stride || change_low_between (r, length);
}

/* apart: distance of the branches, estimated as the sine over its change per unit of motion. */
static int change_fail (pw_run *r, int row, double apart, const char *finding, double length, pw_error *error) {
  char element[120] = "the constraints";
  if (row >= 0) pw_system_row_name (r->s, row, element, sizeof element);
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: change point at %s: %s; branches come within %.2g of each other, the step is "
                  "%.2g long (scaled); use a smaller %s",
                  r->t, element, finding, apart, length, pw_fixed_steps (r) ? "step" : "tolerance");
}

int pw_change_point_resolve (pw_run *r, double last_sine, pw_error *error) {
  pw_geometry *g = &r->geometry;
  if (isnan (last_sine) || g->step_length == 0) return PW_OK;
  g->sine_slope = fmax (g->sine_slope, fabs (g->checked_sine - last_sine) / g->step_length);
  if (!g->loops || !pw_fixed_steps (r) || g->crossed || g->dependent_row >= r->s->holonomic) return PW_OK;
  const int is_minimum = last_sine < g->sine_before_checked && last_sine < g->checked_sine;
  if (!is_minimum || g->step_length * g->sine_slope <= r->limits.resolved * last_sine) return PW_OK;
  return change_fail (r, g->dependent_row, last_sine / g->sine_slope, "the step does not resolve it", g->step_length,
                      error);
}

/* Reports the result of a walk. */
static int change_report (pw_run *r, const change_walk *w, change_verdict verdict, double sine, double length,
                          pw_error *error) {
  pw_geometry *g = &r->geometry;
  double low = r->limits.unresolved * fmin (g->previous_sine, sine);
  g->crossed |= verdict == CHANGE_UNKNOWN || w->least_sine <= r->limits.crossing;
  const char *finding = verdict == CHANGE_OTHER_BRANCH ? "the motion has left its branch" : NULL;
  if (verdict == CHANGE_SAME_BRANCH && !g->crossed && w->least_sine < low) finding = "the step does not resolve it";
  return finding ? change_fail (r, w->least_row, w->least_sine / w->sine_slope, finding, length, error) : PW_OK;
}

int pw_change_point_check (pw_run *r, double sine, pw_error *error) {
  pw_geometry *g = &r->geometry;
  change_walk w;
  pw_error cause = { 0 };
  const pw_source *failed = r->w->failed;
  double length = change_distance (r->s, r->q, g->previous_q);
  if (!g->loops || length == 0) return PW_OK;
  if (isnan (g->previous_sine)) g->previous_sine = change_sine_at (r, g->previous_t, g->previous_q);
  int suspect = change_may_be_low (r, g->previous_sine, sine, length);
  change_verdict verdict = suspect ? change_walk_step (r, &w, &cause) : CHANGE_UNKNOWN;
  r->w->failed = failed;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  if (cause.status != PW_OK) return pw_fail (error, cause.status, "%s", cause.text);
  return suspect ? change_report (r, &w, verdict, sine, length, error) : PW_OK;
}
