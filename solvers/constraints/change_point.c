/* Change points: configurations at which branches of a motion cross, or nearly do.
 *
 * In suitable coordinates the constraints near one are x y = e; the sine (watchdog.h) is |(x, y)|.  For e = 0 the
 * branches cross and the motion goes straight on; for e != 0 it turns within a distance of sqrt (|e|), and a step that
 * is longer than that can go straight on to the other branch, where all constraints hold again.  Neither residuals nor
 * energies reveal this.
 *
 * So where the sine may have had a minimum within a step, a walk on the constraint manifold leads from its beginning to
 * its end, in strides proportional to the sine, each followed by a projection.  If the walk does not get closer to the
 * end after a low sine, the end is on another branch.  Where the sine is below the threshold `crossing`, the branches
 * cross to round-off: the walk steps over such a point, and the motion must continue straight on.  (Following a
 * solution curve by predictor and projection: Allgower & Georg 2003, Introduction to numerical continuation methods,
 * chapters 2 and 8.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* The most strides of a walk, evaluations between the ends of a step, and attempts at a stride.  Each further attempt
 * is longer by the factor CHANGE_LONGER: the last one 1.7^7 = 41 times as long as the first. */
enum { CHANGE_STRIDES = 1000, CHANGE_EVALUATIONS = 1000, CHANGE_ATTEMPTS = 8 };
static const double CHANGE_LONGER = 1.7;

typedef enum {
  CHANGE_SAME_BRANCH,
  CHANGE_OTHER_BRANCH,
  CHANGE_UNKNOWN /* the walk did not reach the end of the step, perhaps since branches cross */
} change_verdict;

typedef struct {
  pw_run *r;
  pw_projector projector;
  double t, *q, *next; /* time and coordinates that the walk has reached; scratch for its next coordinates */
  double *target;      /* the end of the step */
  double *entry;       /* 2 coords: the last coordinates before a crossing of branches, and the first ones in it */
  double sine;         /* at q */
  double sine_slope;   /* fastest change of the sine per unit of motion so far, at least largest_sine */
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

/* Projects q onto the constraints; *sine: that of the holonomic rows there, 0 if they are dependent. */
static int change_project (change_walk *walk, double t, double *q, double *sine) {
  pw_run *r = walk->r;
  int row, status = pw_project_positions (&walk->projector, r, t, q, r->v);
  if (status != PW_OK) return status;
  status = pw_saddle_factor (walk->projector.position);
  *sine = pw_saddle_sine (walk->projector.position, &row);
  if (status != PW_OK) *sine = 0;
  if (*sine < walk->least_sine) walk->least_sine = *sine, walk->least_row = row;
  return PW_OK;
}

/* For a stride from q to next, where the sine is `sine`: records where a crossing of branches is entered, and checks
 * that it is left in about the same direction. */
static void change_watch_crossing (change_walk *walk, double sine) {
  const pw_system *s = walk->r->s;
  const int in_crossing = sine < walk->r->thresholds.crossing;
  size_t bytes = (size_t)s->coords * sizeof (double);
  if (!walk->in_crossing && in_crossing) {
    memcpy (walk->entry, walk->q, bytes);
    memcpy (walk->entry + s->coords, walk->next, bytes);
  } else if (walk->in_crossing && !in_crossing) {
    const double *from = walk->entry, *to = from + s->coords;
    double along = change_dot (s, to, from, walk->next, walk->q);
    walk->turned |= !(along > walk->r->thresholds.straight * change_distance (s, to, from) *
                                  change_distance (s, walk->next, walk->q));
  }
  walk->in_crossing = in_crossing;
}

/* Steps to q + part (target - q), projected; tries longer strides if that fails.  PW_RETRY if all fail. */
static int change_stride (change_walk *walk, double part) {
  const pw_system *s = walk->r->s;
  double sine, t, *swap = walk->next;
  for (int attempt = 0; attempt < CHANGE_ATTEMPTS; attempt++, part *= CHANGE_LONGER) {
    for (int j = 0; j < s->coords; j++) walk->next[j] = walk->q[j] + part * (walk->target[j] - walk->q[j]);
    t = walk->t + fmin (1, part) * (walk->r->t - walk->t);
    if (change_project (walk, t, walk->next, &sine) != PW_OK) continue;
    double length = change_distance (s, walk->next, walk->q);
    change_watch_crossing (walk, sine);
    walk->sine_slope = fmax (walk->sine_slope, fabs (sine - walk->sine) / fmax (length, walk->r->thresholds.floor));
    walk->next = walk->q, walk->q = swap;
    walk->t = t, walk->sine = sine;
    return PW_OK;
  }
  return PW_RETRY;
}

/* Length of the next stride: a part of the distance at which the sine could vanish. */
static double change_length (const change_walk *walk) {
  const pw_thresholds *limit = &walk->r->thresholds;
  return fmax (fmin (limit->stride * walk->sine / walk->sine_slope, limit->stride), limit->floor);
}

/* Walks from the beginning of the step to its end. */
static change_verdict change_follow (change_walk *walk) {
  pw_run *r = walk->r;
  const pw_watchdog *watch = &r->watchdog;
  double sine;
  walk->t = watch->previous_t;
  walk->least_sine = INFINITY;
  walk->sine_slope = watch->largest_sine;
  memcpy (walk->q, watch->previous_q, (size_t)r->s->coords * sizeof *walk->q);
  memcpy (walk->target, r->q, (size_t)r->s->coords * sizeof *walk->q);
  if (change_project (walk, r->t, walk->target, &sine) != PW_OK ||
      change_project (walk, walk->t, walk->q, &walk->sine) != PW_OK)
    return CHANGE_UNKNOWN;
  for (int i = 0; i < CHANGE_STRIDES; i++) {
    double distance = change_distance (r->s, walk->q, walk->target);
    if (distance <= r->thresholds.floor) return walk->turned ? CHANGE_OTHER_BRANCH : CHANGE_SAME_BRANCH;
    double part = fmin (1, change_length (walk) / distance);
    if (change_stride (walk, part) != PW_OK) return CHANGE_UNKNOWN;
    if (change_distance (r->s, walk->q, walk->target) <= distance * (1 - r->thresholds.progress * part)) continue;
    if (walk->least_sine > r->thresholds.low * watch->largest_sine) return CHANGE_UNKNOWN;
    return CHANGE_OTHER_BRANCH;
  }
  return CHANGE_UNKNOWN;
}

/* ---- The check ---- */

/* Walks along the last step; the run's residuals and statistics stay as they are. */
static change_verdict change_walk_step (pw_run *r, change_walk *walk, pw_error *error) {
  const pw_system *s = r->s;
  size_t n = (size_t)s->coords + 3;
  double *memory = malloc (5 * n * sizeof *memory);
  const pw_residuals known = r->residuals;
  const pw_statistics statistics = r->statistics;
  change_verdict verdict = CHANGE_UNKNOWN;
  *walk = (change_walk){ .r = r, .least_row = -1 };
  if (memory == NULL) {
    pw_fail_memory (s, error);
    return verdict;
  }
  walk->q = memory, walk->next = walk->q + n, walk->target = walk->next + n, walk->entry = walk->target + n;
  pw_length_weights (s, walk->entry);
  if (pw_projector_open (&walk->projector, r, walk->entry, NULL, error) == PW_OK) {
    verdict = change_follow (walk);
    pw_projector_close (&walk->projector);
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
  const pw_watchdog *watch = &r->watchdog;
  int parts = (int)fmin (length / r->thresholds.stride, CHANGE_EVALUATIONS) + 1;
  for (int i = 1; i < parts; i++) {
    double part = (double)i / parts, t = watch->previous_t + part * (r->t - watch->previous_t);
    for (int j = 0; j < r->s->coords; j++) r->q_at[j] = watch->previous_q[j] + part * (r->q[j] - watch->previous_q[j]);
    if (change_sine_at (r, t, r->q_at) < r->thresholds.low * watch->largest_sine) return 1;
  }
  return 0;
}

/* 1 if the sine may have a minimum within the step that is low enough to matter.  With K the largest change of the sine
 * per unit of motion, no sine in the step is below (previous_sine + sine - K length) / 2. */
static int change_may_be_low (pw_run *r, double previous_sine, double sine, double length) {
  double low = r->thresholds.low * fmin (previous_sine, sine);
  double K = r->thresholds.lipschitz * r->watchdog.largest_sine;
  if (previous_sine + sine - K * length > 2 * low) return 0;
  return length <= r->thresholds.stride || change_low_between (r, length);
}

/* row: the most nearly dependent one, or -1; apart: distance of the branches, estimated as the sine over its change per
 * unit of motion; length: of the step. */
static int change_fail (pw_run *r, int row, double apart, const char *finding, double length, pw_error *error) {
  const char *element = row >= 0 ? PW_NAME (pw_system_row_name, r->s, row) : "the constraints";
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: change point at %s: %s; branches come within %.2g of each other, the step is "
                  "%.2g long (scaled); use a smaller %s",
                  r->t, element, finding, apart, length, r->fixed_steps ? "step" : "tolerance");
}

int pw_change_point_resolve (pw_run *r, double last_sine, pw_error *error) {
  pw_watchdog *watch = &r->watchdog;
  if (isnan (last_sine) || watch->step_length == 0) return PW_OK;
  watch->sine_slope = fmax (watch->sine_slope, fabs (watch->checked_sine - last_sine) / watch->step_length);
  if (!watch->loops || !r->fixed_steps || watch->may_have_crossed || watch->dependent_row >= r->s->holonomic)
    return PW_OK;
  const int is_minimum = last_sine < watch->sine_before_checked && last_sine < watch->checked_sine;
  if (!is_minimum || watch->step_length * watch->sine_slope <= r->thresholds.resolved * last_sine) return PW_OK;
  return change_fail (r, watch->dependent_row, last_sine / watch->sine_slope, "the step does not resolve it",
                      watch->step_length, error);
}

static int change_report (pw_run *r, const change_walk *walk, change_verdict verdict, double sine, double length,
                          pw_error *error) {
  pw_watchdog *watch = &r->watchdog;
  double low = r->thresholds.unresolved * fmin (watch->previous_sine, sine);
  watch->may_have_crossed |= verdict == CHANGE_UNKNOWN || walk->least_sine <= r->thresholds.crossing;
  const char *found = verdict == CHANGE_OTHER_BRANCH ? "the motion has left its branch" : NULL;
  if (verdict == CHANGE_SAME_BRANCH && !watch->may_have_crossed && walk->least_sine < low)
    found = "the step does not resolve it";
  return found ? change_fail (r, walk->least_row, walk->least_sine / walk->sine_slope, found, length, error) : PW_OK;
}

int pw_change_point_check (pw_run *r, double sine, pw_error *error) {
  pw_watchdog *watch = &r->watchdog;
  change_walk walk;
  pw_error cause = { 0 };
  const pw_source *failed = r->w->failed;
  double length = change_distance (r->s, r->q, watch->previous_q);
  if (!watch->loops || length == 0) return PW_OK;
  if (isnan (watch->previous_sine)) watch->previous_sine = change_sine_at (r, watch->previous_t, watch->previous_q);
  int suspect = change_may_be_low (r, watch->previous_sine, sine, length);
  change_verdict verdict = suspect ? change_walk_step (r, &walk, &cause) : CHANGE_UNKNOWN;
  r->w->failed = failed;
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return pw_fail_signal (r->t, error);
  if (cause.status != PW_OK) return pw_fail (error, cause.status, "%s", cause.text);
  return suspect ? change_report (r, &walk, verdict, sine, length, error) : PW_OK;
}
