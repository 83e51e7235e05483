/* Checks after each step that the run still follows the motion: that constraints are neither lost nor contradictory,
 * and that the motion has not jumped to another branch at a singular configuration.
 *
 * The sine (method.h) changes by at most a multiple of the motion of the bodies (`lipschitz`), so it is computed
 * again only when the motion since could have made it small. */
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* Residuals are scaled; lengths and motions are in units of L and rad; a relative sine is the sine over the largest one
 * of the run.  s: the sine; d: the residual; eps: the machine precision.  Where branches cross, the constraints are
 * x y = 0 in suitable coordinates, and s = |(x, y)|; with a residual d, x y = d: each branch turns, most sharply where
 * s^2 = 2 d. */
const pw_thresholds pw_watchdog_thresholds = {
  /* Residuals above which constraints count as lost: a motion with residuals of 1 % is wrong; without stabilisation
   * some drift is expected. */
  .lost = 1e-2,
  .lost_unstabilised = 0.1,

  /* A redundant row follows from the others up to a round-off of some 5e6 eps, or up to their residuals times this
   * ratio, for a sine as small as 1e-4. */
  .redundant_residual = 1e-9,
  .redundant_ratio = 1e4,

  /* Sines below which J has lost rank (rank_lost); the rank is computed (rank_suspect); or, where the scene is too
   * large for that, the configuration is refused (rank_refused).  Round-off leaves sqrt (eps) = 1.5e-8 of a row that
   * depends on others; below 1e-6 accelerations, with an error of eps / s after refinement, are wrong by more than
   * 1e-10.  Round-off leaves up to 1e-5 of a row that depends on rows which are nearly dependent themselves.
   * rank_suspect: a hundred times rank_refused. */
  .rank_lost = 1e-6,
  .rank_suspect = 1e-3,
  .rank_refused = 1e-5,

  /* Sine above which a row counts as independent: residuals of 1e-16 leave an error of 1e-8; ten times that. */
  .independent = 1e-7,

  /* Another set of active rows is sought where their independence (rank.h) is below both 0.6 of its initial value and
   * 0.7, where a coefficient exceeds 1 / 0.7. */
  .reselect_ratio = 0.6,
  .reselect_below = 0.7,

  /* near: relative sine below which a configuration is near a singular one.  refine: sine in the metric of a saddle
   * (saddle.h) below which its solutions are refined.  A stage of a step by an angle h has a residual of about h^2 / 8,
   * which decides on the branch unless s^2 is much larger: with steps of 1e-3 s at a few rad/s, up to s of 0.02.  A
   * factorisation has an error of eps / s^2, 5e-13 at 0.02. */
  .near = 0.02,
  .refine = 0.02,

  /* Drift: measured on four-bar linkages and slider-cranks, d / s^2 is 0.08 to 0.34 where the turn is sharpest;
   * accelerations, at least turn_reference L / T^2, have grown by a factor of 3 (turn_growth) when it is 0.02 to 0.07
   * (drift_turn).  From half of that on (drift_near) they are no reference for later ones.  Where d itself counts as
   * lost (drift_far), d / s^2 must be below its value in the sharpest turn (drift_any), whatever the accelerations.
   * Where the relative sine is above `regular`, the configuration is not singular, however large the drift. */
  .regular = 0.6,
  .turn_growth = 3,
  .turn_reference = 0.1,
  .drift_turn = 0.02,
  .drift_near = 0.01,
  .drift_far = 1e-2,
  .drift_any = 0.1,

  /* Growth of the accelerations in a jump.  Nonholonomic rows: accelerations do not grow when the motion passes a
   * singular configuration; in a jump at the sine s they reach 1 / s: 100 at half of `near`. */
  .jump_growth = 100,

  /* Change of the relative sine per unit of motion: the direction of a row of length 1 turns by at most an angle of 1
   * per rad, and that of the rows before it, too.  No step is taken to be more than twice as long as the last one. */
  .lipschitz = 2,
  .step_growth = 2,

  /* Change points: a sine within a step below an eighth of those at its ends (unresolved) belongs to a
   * turn that the step cannot resolve; below half of them, or a relative sine below half (low), there may be a change
   * point.  Strides of 0.3 times the sine stay on a curve whose radius is the sine.  A stride that approaches its
   * destination by less than a tenth of its length (progress) leads elsewhere. */
  .unresolved = 0.125,
  .low = 0.5,
  .stride = 0.3,
  .progress = 0.1,

  /* The projection leaves residuals of 1e-14, which leave an error of 1e-7 in the sine: below `floor`, ten times that,
   * also the shortest stride, it cannot be distinguished from 0 (`crossing`: twice that, since a stride ends within
   * `floor` of its destination).  Such a point must be left straight on, within 60 degrees of the direction in which it
   * was entered: the cosine `straight`. */
  .floor = 1e-6,
  .crossing = 2e-6,
  .straight = 0.5,

  /* Length of a step over the distance of branches that it resolves: methods of order 2 have an error of
   * (0.4)^2 / 12 = 1 % at a turn that takes 1 / 0.4 steps. */
  .resolved = 0.4,

  /* Differences between results of the same step divided into parts, differently each time: acceptable, and aimed at.
   * Near a singular configuration most agree to 1e-11; those that differ by more than the error of a good step, 1e-7,
   * do not agree.  A sample does not affect the next step: an error of 0.01 L or 0.01 rad is acceptable. */
  .agree = 1e-7,
  .agree_best = 1e-11,
  .sample = 1e-2,
  .sample_best = 1e-9,

  /* Sine at the end of a step over that at its beginning.  If it ends within a tenth of its length from a singular
   * configuration, the accelerations, whose error is that of the state over the sine, are ten times less accurate than
   * at its beginning. */
  .ends_singular = 0.1,

  /* The largest mass, and one over the smallest [kg]; the largest initial value.  Products of three masses must neither
   * overflow nor underflow. */
  .extreme = 1e100,

  /* Consecutive steps that do not advance.  Libraries reduce a step by factors of 4 to 10: it is below round-off after
   * 25 reductions; a thousand steps that do not advance are no search for a step size. */
  .stalled = 1000,
};

double pw_run_acceleration_norm (const pw_run *r) {
  const double per_angle = r->w->scale.time * r->w->scale.time, per_length = per_angle / r->s->scale.length, *a = r->a;
  const int bodies = 3 * r->s->bodies;
  double norm = 0;
  for (int j = 0; j < bodies; j += 3) {
    norm = pw_larger_or_nan (norm, fabs (a[j]) * per_length);
    norm = pw_larger_or_nan (norm, fabs (a[j + 1]) * per_length);
    norm = pw_larger_or_nan (norm, fabs (a[j + 2]) * per_angle);
  }
  for (int j = bodies; j < r->s->mechanical; j++) norm = pw_larger_or_nan (norm, fabs (a[j]) * per_angle);
  return norm;
}

/* Change points: configurations at which branches of a motion cross, or nearly do.
 *
 * In suitable coordinates the constraints near one are x y = e; the sine (method.h) is |(x, y)|.  For e = 0 the
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
  for (int j = 0; j < s->mechanical; j++) {
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

static change_verdict change_follow (change_walk *walk) {
  pw_run *r = walk->r;
  const pw_watchdog *watch = &r->watchdog;
  const pw_thresholds *limit = &r->thresholds;
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
    if (distance <= limit->floor) return walk->turned ? CHANGE_OTHER_BRANCH : CHANGE_SAME_BRANCH;
    /* a part of the distance at which the sine could vanish */
    double length = fmax (limit->stride * fmin (walk->sine / walk->sine_slope, 1), limit->floor);
    double part = fmin (1, length / distance);
    if (change_stride (walk, part) != PW_OK) return CHANGE_UNKNOWN;
    if (change_distance (r->s, walk->q, walk->target) <= distance * (1 - limit->progress * part)) continue;
    if (walk->least_sine > limit->low * watch->largest_sine) return CHANGE_UNKNOWN;
    return CHANGE_OTHER_BRANCH;
  }
  return CHANGE_UNKNOWN;
}

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

/* The sine on the straight line between the ends of the last step, at this share of it.  r->q_at is scratch. */
static double change_sine_between (pw_run *r, double share) {
  const double *from = r->watchdog.previous_q, t = r->watchdog.previous_t;
  for (int j = 0; j < r->s->coords; j++) r->q_at[j] = from[j] + share * (r->q[j] - from[j]);
  return change_sine_at (r, t + share * (r->t - t), r->q_at);
}

/* 1 if the sine is low somewhere on this line in a long step. */
static int change_low_between (pw_run *r, double length) {
  const pw_watchdog *watch = &r->watchdog;
  int parts = (int)fmin (length / r->thresholds.stride, CHANGE_EVALUATIONS) + 1;
  for (int i = 1; i < parts; i++)
    if (change_sine_between (r, (double)i / parts) < r->thresholds.low * watch->largest_sine) return 1;
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
  if (!suspect) return PW_OK;
  double low = r->thresholds.unresolved * fmin (watch->previous_sine, sine);
  watch->may_have_crossed |= verdict == CHANGE_UNKNOWN || walk.least_sine <= r->thresholds.crossing;
  const char *found = verdict == CHANGE_OTHER_BRANCH ? "the motion has left its branch" : NULL;
  if (verdict == CHANGE_SAME_BRANCH && !watch->may_have_crossed && walk.least_sine < low)
    found = "the step does not resolve it";
  return found ? change_fail (r, walk.least_row, walk.least_sine / walk.sine_slope, found, length, error) : PW_OK;
}

/* Checks that a step of fixed size resolves a change point that the motion has passed at a small distance; last_sine:
 * that one state earlier, NaN if it was not computed.  Adaptive methods have error control instead. */
static int change_resolve (pw_run *r, double last_sine, pw_error *error) {
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

/* Dead points: states beyond which prescribed motions cannot go on, whatever the method.
 *
 * The least velocities x that satisfy the constraints, min |x| with J x = eta, grow without bound before a dead point:
 * n^T J vanishes there for some n with n^T eta != 0.  (Where n^T eta vanishes, too, x remains bounded and the motion
 * may pass.)  |x| grows like (t* - t)^-p, with p = 1/2 where a linkage reaches the end of its range, and p = 1 where a
 * steered wheel blocks.  So a walk on the constraint manifold follows the motion from the state last checked, in steps
 * proportional to an estimate of 2 p (t* - t), until |x| has grown by orders of magnitude. */

enum { DEAD_STEPS = 600, DEAD_STARTS = 24 }; /* the most steps of a walk, and states at which it tries to begin */
enum { DEAD_PARTS = 16 };                    /* most parts of a step in which the sine is evaluated, */
static const double DEAD_SAMPLES = 0.6;      /* their number over the change of the sine; above 1/2 */
static const double DEAD_STRIDE = 0.3;       /* the longest step, and the largest correction, in units of the scene */
/* |x| over the largest prescribed velocity: a typical value, and the growth above it that counts as unbounded. */
static const double DEAD_RATIO = 100, DEAD_GROWTH = 100;
static const double DEAD_SHARE = 0.1; /* of the largest power, or force, from which on an element takes part */

typedef struct {
  pw_run *r;
  pw_projector projector;
  double *row_length, *eta, *mu;  /* rows: lengths of the rows of J; eta; multipliers of x */
  double *x;                      /* coords: scratch */
  double *state, *next, *start;   /* (q, v, a, lambda): where the walk is; scratch for the next; where it begins */
  double t, ratio;                /* of `state`; |x| over `prescribed` there, 0: no velocities are prescribed */
  double prescribed;              /* the largest prescribed velocity so far: it may vanish where a drive reverses */
  double unbounded;               /* the ratio from which on |x| is unbounded */
  double ahead, step, last_ahead; /* estimated 2 p (t* - t), INFINITY: |x| does not grow; the last step; ahead before */
} dead_walk;

/* The ratio where J is evaluated, with row lengths, eta and mu.  Columns of angles are divided by L. */
static double dead_ratio (dead_walk *walk) {
  pw_run *r = walk->r;
  double square = 0, *prescribed = &walk->prescribed;
  pw_evaluate_eta (r->w, walk->eta);
  (void)pw_saddle_factor (r->watchdog.saddle); /* its smallest pivot may be near round-off */
  pw_saddle_solve (r->watchdog.saddle, NULL, walk->eta, walk->x, walk->mu);
  for (int i = 0; i < r->s->rows; i++) {
    square -= walk->mu[i] * walk->eta[i], walk->row_length[i] = pw_rank_norm (r->w, i);
    if (walk->row_length[i] > 0) *prescribed = fmax (*prescribed, fabs (walk->eta[i]) / walk->row_length[i]);
  }
  return *prescribed > 0 ? sqrt (square) / *prescribed : 0;
}

/* Projects walk->next at time t and makes it the state, unless that moves it by more than `most`, in units of the
 * scene: perhaps to another branch. */
static int dead_move (dead_walk *walk, double t, double most) {
  const pw_system *s = walk->r->s;
  const size_t n = (size_t)s->coords + 3;
  double *q = walk->next, *v = q + n, *a = v + n, moved = 0;
  memcpy (walk->x, q, (size_t)s->coords * sizeof *q);
  if (!pw_is_finite_state (walk->r, q, v)) return PW_RETRY;
  if (pw_project_state (&walk->projector, walk->r, t, q, v, a, a + n, NULL) != PW_OK) return PW_RETRY;
  for (int j = 0; j < s->mechanical; j++) moved = fmax (moved, fabs (q[j] - walk->x[j]) / pw_unit (s, j));
  double ratio = moved <= most ? dead_ratio (walk) : NAN;
  if (!isfinite (ratio)) return PW_RETRY;
  walk->next = walk->state, walk->state = q;
  walk->t = t, walk->ratio = ratio;
  return PW_OK;
}

/* Begins at the state last checked.  If that has drifted to or beyond the dead point, where the constraints cannot be
 * satisfied, the walk begins as little earlier as possible, at most by `most`; the distance to such a state grows with
 * the square root of the time.  Earlier states show what is bounded.  still: 1 to begin with the least velocities, in
 * the metric M, in place of the last ones, which may be far off near the dead point. */
static int dead_begin (dead_walk *walk, double most, int still) {
  const pw_run *r = walk->r;
  const int coords = r->s->coords;
  const double *q = r->watchdog.previous_q, *v = q + coords + 3;
  double back = 0, speed = 0, t = NAN, least = INFINITY;
  for (int j = 0; j < r->s->mechanical; j++) speed = fmax (speed, fabs (v[j]) / pw_unit (r->s, j));
  for (int i = 0; i < DEAD_STARTS && !(least <= DEAD_RATIO); i++) {
    double away = speed > 0 ? DEAD_STRIDE * sqrt (back / most) / speed : 0;
    memcpy (walk->next, q, 2 * ((size_t)coords + 3) * sizeof *q);
    for (int j = 0; j < coords; j++) walk->next[j] -= away * v[j];
    if (still) memset (walk->next + coords + 3, 0, (size_t)coords * sizeof *q);
    if (dead_move (walk, r->watchdog.previous_t - back, DEAD_STRIDE) == PW_OK) {
      if (isnan (t)) t = walk->t, memcpy (walk->start, walk->state, pw_state_length (r->s) * sizeof *q);
      least = fmin (least, walk->ratio);
    }
    back = most * pow (0.25, DEAD_STARTS - 1 - i);
  }
  walk->unbounded = DEAD_GROWTH * fmax (DEAD_RATIO, least);
  if (isnan (t)) return PW_RETRY;
  memcpy (walk->next, walk->start, pw_state_length (r->s) * sizeof *q);
  (void)dead_move (walk, t, DEAD_STRIDE); /* if it fails, it is too near the dead point: the earlier state remains */
  return PW_OK;
}

/* A step of second order, of a length up to `most`: the free motions are smooth, the projection determines others. */
static int dead_step (dead_walk *walk, double h, double most) {
  const pw_system *s = walk->r->s;
  const size_t n = (size_t)s->coords + 3;
  const double *q = walk->state, *v = q + n, *a = v + n, before = walk->ratio;
  double length = 0;
  for (int j = 0; j < s->coords; j++) {
    walk->next[j] = q[j] + h * (v[j] + h / 2 * a[j]);
    walk->next[n + (size_t)j] = v[j] + h * a[j];
    if (j < s->mechanical) length = fmax (length, fabs (walk->next[j] - q[j]) / pw_unit (s, j));
  }
  if (!(length <= most) || dead_move (walk, walk->t + h, length / 2) != PW_OK) return PW_RETRY;
  walk->step = h, walk->last_ahead = walk->ahead;
  walk->ahead = walk->ratio > before ? h / (pow (walk->ratio / before, 2) - 1) : INFINITY;
  return PW_OK;
}

/* The time of the dead point, INFINITY if there is none up to t_end; NAN: not known. */
static double dead_find (dead_walk *walk, double t_end) {
  const double least = 4 * DBL_EPSILON * fmax (fabs (walk->t), walk->r->w->scale.time);
  double h = (t_end - walk->t) / 100;
  walk->ahead = walk->last_ahead = INFINITY;
  for (int i = 0; i < DEAD_STEPS && h >= least && !(walk->ratio > walk->unbounded); i++) {
    /* the dead point may be at a distance of about 1 / ratio */
    double most = isfinite (walk->ahead) ? DEAD_STRIDE : DEAD_STRIDE / fmax (1, walk->ratio);
    if (walk->ratio == 0 || walk->t >= t_end) return INFINITY;
    h = dead_step (walk, h, most) == PW_OK ? fmin (2 * h, walk->ahead / 4) : h / 4;
  }
  if (!(walk->ratio > walk->unbounded)) return NAN;
  if (!isfinite (walk->ahead)) return walk->t;
  double rate = walk->ahead < walk->last_ahead ? (walk->last_ahead - walk->ahead) / walk->step : 1; /* 1 / (2 p) */
  double t = walk->t + walk->ahead / (isfinite (rate) ? rate : 1);
  return t <= t_end ? t : INFINITY;
}

static int dead_fail (dead_walk *walk, double t, pw_error *error) {
  const pw_system *s = walk->r->s;
  char drives[180], elements[180];
  unsigned char *which = (unsigned char *)walk->next; /* 1: a drive that takes part; 2: another element */
  double power = 0, force = 0;
  int digits = 6; /* fewer for drives on velocities, whose positions have the errors of the method */
  for (int i = 0; i < s->rows; i++) {
    power -= walk->mu[i] * walk->eta[i];
    force = fmax (force, fabs (walk->mu[i]) * walk->row_length[i]);
  }
  for (int i = 0; i < s->rows; i++) {
    int drives_it = -walk->mu[i] * walk->eta[i] > DEAD_SHARE * power;
    if (drives_it && i >= s->holonomic) digits = 4;
    which[i] = drives_it ? 1 : fabs (walk->mu[i]) * walk->row_length[i] > DEAD_SHARE * force ? 2 : 0;
  }
  pw_list_elements (s, which, 1, drives, sizeof drives);
  pw_list_elements (s, which, 2, elements, sizeof elements);
  if (error) *error = (pw_error){ 0 };
  return pw_fail (error, PW_METHOD,
                  "t = %.*g s: dead point: %s cannot go on: at the limit of %s, it requires unbounded velocities",
                  digits, t, drives, *elements ? elements : "its motion");
}

/* PW_METHOD if a dead point follows the state last checked, up to t_end.  The run stays as it is. */
static int dead_check (pw_run *r, double t_end, pw_error *error) {
  const pw_watchdog *watch = &r->watchdog;
  const size_t n = pw_state_length (r->s), rows = (size_t)r->s->rows;
  dead_walk walk = { .r = r };
  if (watch->saddle == NULL || r->saddle == NULL || r->s->rheonomic == 0 || r->w->failed) return PW_OK;
  char *memory = PW_ALLOC_ARRAYS (PW_ARRAY (walk.state, n), PW_ARRAY (walk.next, n), PW_ARRAY (walk.start, n),
                                  PW_ARRAY (walk.row_length, rows), PW_ARRAY (walk.eta, rows), PW_ARRAY (walk.mu, rows),
                                  PW_ARRAY (walk.x, r->s->coords + 3));
  if (memory == NULL) return PW_OK;
  const pw_statistics statistics = r->statistics;
  const pw_residuals residuals = r->residuals;
  const double refused_sine = r->refused_sine, evaluated_sine = watch->evaluated_sine;
  double t = NAN;
  int status = PW_OK;
  r->refused_sine = 0;
  if (pw_evaluate_J_at (r->w, watch->previous_t, watch->previous_q, r->v) == PW_OK &&
      pw_projector_open (&walk.projector, r, NULL, NULL, NULL) == PW_OK) {
    for (int still = 0; still < 2 && isnan (t); still++)
      if (dead_begin (&walk, t_end - watch->previous_t, still) == PW_OK)
        t = dead_find (&walk, fmin (t_end, r->breakpoint));
    if (isfinite (t)) status = dead_fail (&walk, t, error);
    pw_projector_close (&walk.projector);
  }
  free (memory);
  r->statistics = statistics, r->residuals = residuals, r->w->failed = NULL;
  r->refused_sine = refused_sine, r->watchdog.evaluated_sine = evaluated_sine;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  return status;
}

/* 1 if the last step may have passed a dead point, where the sine vanishes.  K: its largest change per unit of motion.
 * It is positive within a distance of sine / K from the end of the step.  Where it is nowhere low, the step is close to
 * the motion, here to a straight line, and the sine is positive between two places whose sines exceed K times their
 * distance in sum.  start: a lower bound of the sine at the beginning. */
static int dead_may_be_passed (pw_run *r, double start) {
  const pw_watchdog *watch = &r->watchdog;
  const double change = r->thresholds.lipschitz * watch->largest_sine * watch->step_length, end = watch->checked_sine;
  const double low = r->thresholds.low * watch->largest_sine;
  if (r->s->rheonomic == 0 || r->w->failed || end > change) return 0;
  const int parts = 1 + (int)fmin (DEAD_SAMPLES * change / end, DEAD_PARTS);
  int may = 0;
  for (int i = 1; i <= parts && !may; i++) {
    const double sine = i < parts ? change_sine_between (r, (double)i / parts) : end;
    may = !(fmin (start, sine) > low && start + sine > change / parts);
    start = sine;
  }
  r->w->failed = NULL;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  return may;
}

int pw_dead_point_explain (pw_run *r, pw_error *error) {
  double step = r->fixed_steps ? r->settings.step : r->t - r->watchdog.previous_t;
  (void)dead_check (r, r->watchdog.previous_t + fmax (10 * step, 0.5 * r->w->scale.time), error);
  return PW_METHOD;
}

static void watchdog_record_sine (pw_run *r, double sine) {
  pw_watchdog *watch = &r->watchdog;
  watch->checked_sine = sine;
  watch->moved = 0;
  watch->largest_sine = fmax (watch->largest_sine, sine);
}

/* 1 if the sine may be below this value at the state reached or after a motion of this length from there. */
static int watchdog_reaches (const pw_run *r, double sine, double length) {
  const pw_watchdog *watch = &r->watchdog;
  return watch->saddle &&
         !(watch->checked_sine - r->thresholds.lipschitz * watch->largest_sine * (watch->moved + length) > sine);
}

/* The typical sine: the largest at a few irregular configurations, which need not satisfy the constraints. */
static void watchdog_sample_sines (pw_run *r) {
  const pw_system *s = r->s;
  pw_watchdog *watch = &r->watchdog;
  for (int n = 1; n <= 4; n++) {
    for (int j = 0; j < s->coords; j++)
      watch->previous_q[j] = r->q[j] + 0.5 * pw_unit (s, j) * pw_irregular (n, (j + 1) * n);
    if (pw_evaluate_J_at (r->w, r->t, watch->previous_q, r->v) != PW_OK) break;
    watch->largest_sine = fmax (watch->largest_sine, pw_watchdog_sine (r, NULL));
  }
  r->w->failed = NULL;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
}

void pw_watchdog_begin (pw_run *r) {
  pw_watchdog *watch = &r->watchdog;
  if (watch->saddle == NULL) return;
  if (watch->largest_sine == 0) watchdog_sample_sines (r);
  watchdog_record_sine (r, pw_watchdog_sine (r, NULL));
  watch->previous_t = r->t;
  watch->previous_sine = watch->checked_sine;
  watch->step_length = watch->sine_slope = 0;
  watch->sine_before_checked = NAN;
  watch->may_have_crossed = 0;
  watch->singular_ahead = 1;
  memcpy (watch->previous_q, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *watch->previous_q);
}

/* Checks the step to the state reached, where J is evaluated.  PW_METHOD if it has left its branch, or passed a change
 * point without resolving it; PW_RESOURCE. */
static int watchdog_follow (pw_run *r, pw_error *error) {
  pw_watchdog *watch = &r->watchdog;
  int status = PW_OK;
  if (watch->saddle == NULL) return PW_OK;
  const double *q = r->q, *before = watch->previous_q;
  double length = 0, angle = 0; /* the largest change of a body's coordinate in the step */
  for (int n = r->s->bodies; n > 0; n--, q += 3, before += 3) {
    length = pw_larger (fabs (q[0] - before[0]), pw_larger (fabs (q[1] - before[1]), length));
    angle = pw_larger (fabs (q[2] - before[2]), angle);
  }
  watch->step_length = pw_larger (length / r->s->scale.length, angle);
  watch->moved += watch->step_length;
  double near = r->thresholds.near * watch->largest_sine, ahead = r->thresholds.step_growth * watch->step_length;
  int may_be_near = watchdog_reaches (r, near, ahead);
  if (may_be_near) {
    const double earlier = watch->moved - watch->step_length, last = earlier > 0 ? NAN : watch->checked_sine;
    const double start = watch->checked_sine - r->thresholds.lipschitz * watch->largest_sine * earlier;
    watchdog_record_sine (r, pw_watchdog_sine (r, &watch->dependent_row));
    status = pw_change_point_check (r, watch->checked_sine, error);
    if (status == PW_OK) status = change_resolve (r, last, error);
    if (status == PW_OK && dead_may_be_passed (r, start)) status = dead_check (r, r->t, error);
    if (status != PW_OK) return status;
    watch->sine_before_checked = last;
  } else
    watch->sine_before_checked = NAN, watch->sine_slope = 0, watch->may_have_crossed = 0;
  if (may_be_near && watch->checked_sine < near) r->near_singular = 1;
  watch->singular_ahead = may_be_near && watchdog_reaches (r, near, ahead);
  watch->previous_t = r->t;
  watch->previous_sine = may_be_near ? watch->checked_sine : NAN;
  memcpy (watch->previous_q, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *watch->previous_q);
  return status;
}

static int watchdog_fail_lost (pw_run *r, int contradicts, pw_error *error) {
  pw_residuals now;
  char cause[60] = "constraint drift";
  pw_evaluate_residuals (r->w, r->enforced, &now);
  int in_position = isnan (now.position) || now.position > now.velocity;
  int row = in_position ? now.row_position : now.row_velocity;
  const char *element = row >= 0 ? PW_NAME (pw_system_row_name, r->s, row) : "a constraint", *advice = "";
  if (contradicts) {
    snprintf (cause, sizeof cause, "constraints contradict each other");
    if (row >= 0) advice = pw_advice_on_wheel (r->s, row);
  } else if (pw_stabilised_by (r, PW_UNSTABILISED))
    advice = r->fixed_steps ? "; a smaller step or a stabilisation reduces it"
                            : "; a smaller tolerance or a stabilisation reduces it";
  else if (r->fixed_steps)
    snprintf (cause, sizeof cause, "the step of %.6g s is too large", r->settings.step);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s: %s is violated by %.3g in %s (scaled)%s", r->t, cause, element,
                  in_position ? now.position : now.velocity, in_position ? "position" : "velocity", advice);
}

static int watchdog_exceeds (double position, double velocity, double limit) {
  return !(position <= limit && velocity <= limit);
}

/* 1 if a redundant row is violated by more than the residuals of the others explain: it contradicts them. */
static int watchdog_contradicts (pw_run *r) {
  pw_residuals all, enforced;
  pw_evaluate_residuals (r->w, r->enforced, &all);
  if (!watchdog_exceeds (all.position, all.velocity, r->thresholds.redundant_residual)) return 0;
  pw_evaluate_residuals (r->w, r->active, &enforced);
  double explained =
      r->thresholds.redundant_residual + r->thresholds.redundant_ratio * fmax (enforced.position, enforced.velocity);
  return watchdog_exceeds (all.position, all.velocity, explained);
}

/* The residual of positions in units of L. */
static double watchdog_residual (const pw_run *r) {
  return r->residuals.g / r->s->scale.length;
}

/* 1 if a constraint residual d may decide which branch is followed: if the sine s is below its regular value, and s^2
 * below d / ratio.  Drifted constraints, x y = d in place of x y = 0, connect branches that cross by a
 * turn, which a method follows however small its steps. */
static int watchdog_unresolved (pw_run *r, double residual, double ratio) {
  int row;
  const double lost = r->thresholds.rank_lost;
  if (residual <= ratio * lost * lost) return 0;
  double bound = fmin (sqrt (residual / ratio), r->thresholds.regular * r->watchdog.largest_sine);
  return bound > lost && watchdog_reaches (r, bound, 0) && pw_watchdog_sine (r, &row) < bound && row < r->s->holonomic;
}

/* Fails where residuals may decide the branch and accelerations have grown, or residuals are large: the turn is then a
 * corner whose radius grows with the residual, so that its accelerations need not grow. */
static int watchdog_check_turn (pw_run *r, double norm, pw_error *error) {
  const pw_thresholds *limit = &r->thresholds;
  double residual = watchdog_residual (r), before = fmax (r->previous_norm, limit->turn_reference);
  if (!(norm <= limit->turn_growth * before) && watchdog_unresolved (r, residual, limit->drift_turn))
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: lost at a singular configuration: constraint residuals of %.2g (scaled) may lead to "
                    "another branch, with accelerations %.3g times those before; methods with projection pass",
                    r->t, residual, norm / before);
  if (!(residual <= limit->drift_far) && watchdog_unresolved (r, residual, limit->drift_any))
    return pw_fail (
        error, PW_METHOD,
        "t = %.6g s: lost at a singular configuration: constraint residuals of %.2g (scaled) do not tell one branch "
        "from another; methods with projection pass",
        r->t, residual);
  return PW_OK;
}

/* Accelerations of the physical motion do not grow at a singular configuration; in a jump to another branch they do, if
 * the dependent row is nonholonomic. */
static int watchdog_check_jump (pw_run *r, pw_error *error) {
  int row = -1;
  double norm = pw_run_acceleration_norm (r);
  if (r->near_singular) pw_watchdog_sine (r, &row);
  int may_jump = r->near_singular && (row < 0 || row >= r->s->holonomic || !isfinite (norm));
  if (may_jump && !(norm <= r->thresholds.jump_growth * r->reference_level))
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: lost at a singular configuration: the accelerations are %.3g times those before", r->t,
                    norm / r->reference_level);
  if (r->near_singular || watchdog_unresolved (r, watchdog_residual (r), r->thresholds.drift_near))
    return watchdog_check_turn (r, norm, error);
  r->reference_level = pw_larger (norm, r->reference_level);
  r->previous_norm = norm;
  return PW_OK;
}

int pw_run_watchdog (pw_run *r, pw_error *error) {
  pw_record_residuals (r);
  double lost = pw_lost_residual (r);
  int contradicts = r->redundant && watchdog_contradicts (r);
  if (contradicts || watchdog_exceeds (r->residuals.position, r->residuals.velocity, lost))
    return watchdog_fail_lost (r, contradicts, error);
  int status = watchdog_follow (r, error);
  return status == PW_OK ? watchdog_check_jump (r, error) : status;
}
