/* Dead points: states beyond which prescribed motions cannot go on, whatever the method.
 *
 * The least velocities x that satisfy the constraints, min |x| with J x = eta, grow without bound before a dead point:
 * n^T J vanishes there for some n with n^T eta != 0.  (Where n^T eta vanishes, too, x remains bounded and the motion
 * may pass.)  |x| grows like (t* - t)^-p, with p = 1/2 where a linkage reaches the end of its range, and p = 1 where a
 * steered wheel blocks.  So a walk on the constraint manifold follows the motion from the state last checked, in steps
 * proportional to an estimate of 2 p (t* - t), until |x| has grown by orders of magnitude. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "method.h"
#include "rank.h"

enum { DEAD_STEPS = 600, DEAD_STARTS = 24 }; /* the most steps of a walk, and states at which it tries to begin */
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
  memset (walk->row_length, 0, (size_t)r->s->rows * sizeof *walk->row_length);
  PW_EACH_CONSTRAINT (k, r->w)
    for (int i = 0; i < k->b.count * k->kind->rows; i++)
      for (int c = 0; c < k->b.cols; c++) {
        int j = pw_global (k, i / k->kind->rows, c);
        double *length = &walk->row_length[k->row + i];
        if (j < r->s->coords) *length = hypot (*length, k->J[i * k->b.cols + c] / pw_length_factor (r->s, j));
      }
  pw_evaluate_eta (r->w, walk->eta);
  (void)pw_saddle_factor (r->watchdog.saddle); /* its smallest pivot may be near round-off */
  pw_saddle_solve (r->watchdog.saddle, NULL, walk->eta, walk->x, walk->mu);
  for (int i = 0; i < r->s->rows; i++) {
    square -= walk->mu[i] * walk->eta[i];
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
  for (int j = 0; j < s->coords; j++) moved = fmax (moved, fabs (q[j] - walk->x[j]) / pw_unit (s, j));
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
  for (int j = 0; j < coords; j++) speed = fmax (speed, fabs (v[j]) / pw_unit (r->s, j));
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
    length = fmax (length, fabs (walk->next[j] - q[j]) / pw_unit (s, j));
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

/* Names the elements of the rows with which[i] = wanted. */
static void dead_list (const pw_system *s, const unsigned char *which, int wanted, char *list, size_t size) {
  char element[PW_NAME_BYTES], previous[PW_NAME_BYTES] = "";
  int named = 0, more = 0;
  *list = 0;
  for (int i = 0; i < s->rows; i++) {
    size_t length = strlen (list);
    if (which[i] != wanted || strcmp (pw_system_row_name (s, i, element, sizeof element), previous) == 0) continue;
    strcpy (previous, element);
    if (named < 4 && length + strlen (element) + 16 < size)
      named++, snprintf (list + length, size - length, "%s%s", length ? ", " : "", element);
    else
      more++;
  }
  size_t length = strlen (list);
  if (more > 0) snprintf (list + length, size - length, "%s%d more", length ? " and " : "", more);
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
  dead_list (s, which, 1, drives, sizeof drives);
  dead_list (s, which, 2, elements, sizeof elements);
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
  const pw_array array[] = { { &walk.state, n },
                             { &walk.next, n },
                             { &walk.start, n },
                             { &walk.row_length, rows },
                             { &walk.eta, rows },
                             { &walk.mu, rows },
                             { &walk.x, (size_t)r->s->coords + 3 } };
  char *memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
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

int pw_dead_point_passed (pw_run *r, pw_error *error) {
  const pw_watchdog *watch = &r->watchdog;
  if (watch->checked_sine > r->thresholds.lipschitz * watch->largest_sine * watch->step_length) return PW_OK;
  return dead_check (r, r->t, error);
}

int pw_dead_point_explain (pw_run *r, pw_error *error) {
  double step = r->fixed_steps ? r->settings.step : r->t - r->watchdog.previous_t;
  (void)dead_check (r, r->watchdog.previous_t + fmax (10 * step, 0.5 * r->w->scale.time), error);
  return PW_METHOD;
}
