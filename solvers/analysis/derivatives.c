/* Derivatives of the outputs of runs by differences of whole runs.
 *
 * At x + k h, k = -3 ... 3, central differences have the orders 2, 4, 6; beside a bound k = 0 ... 6.  The error of the
 * last one is at most about its difference from the one before, plus the errors of the runs over h.  The latter are
 * measured at x by runs with larger tolerances, and by the sixth difference.  Steps h, by factors of ten, become larger
 * while the errors of the runs dominate, smaller while the formulas disagree or one-sided formulas show that the
 * derivative jumps.  The result is the one of least error, which grows by as much as it contradicts smaller steps. */
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include "pinwheel-analysis.h"
#include "util.h"

enum {
  MOST = 6,    /* neighbours */
  FIRST = 2,   /* the first steps are 10^-2 and 10^-3 of the size */
  LEAST = -14, /* steps are at most 10^14 ... */
  FINEST = 12, /* ... and at least 10^-12 of the size */
  LEVELS = 12, /* steps that are tried for a parameter, at most */
  SKIPPED = 3  /* decades to the next larger step where there is no effect */
};
static const double ENOUGH = 1e-8, /* relative error of a derivative that needs no better step */
    NO_EFFECT = 1e-9,              /* likewise its error relative to output / parameter, if it may be 0 */
    UNKNOWN = 0.01,                /* of an error relative to output / parameter, or ... */
    UNKNOWN_SI = 1e-6;             /* ... of output, that makes a derivative unknown if it exceeds half of it */

/* Weights of values at nodes, whole numbers, in the derivative at 0 of the polynomial through them. */
static void difference_weights (const int *node, int count, double *weight) {
  for (int i = 0; i < count; i++) {
    double sum = 0, denominator = 1;
    for (int j = 0; j < count; j++) {
      double product = 1;
      if (j == i) continue;
      for (int k = 0; k < count; k++)
        if (k != i && k != j) product *= -node[k];
      sum += product, denominator *= node[i] - node[j];
    }
    weight[i] = sum / denominator;
  }
}

/* Node i of `neighbours`: central ones in pairs, or on one side. */
static int difference_node (int side, int i) {
  return side ? side * (i + 1) : (i % 2 ? 1 : -1) * (i / 2 + 1);
}

/* The derivative times the step by the formula of this order through the first nodes; f0: the value at 0, f: at the
 * nodes, `stride` apart.  *size: the sum of the absolute weights. */
static double difference_formula (int side, int order, double f0, const double *f, int stride, double *size) {
  int node[MOST + 1] = { 0 }, count = 0, with_zero = side != 0;
  double weight[MOST + 1], sum = 0;
  count = with_zero;
  for (int i = 0; i < order; i++) node[count++] = difference_node (side, i);
  difference_weights (node, count, weight);
  *size = 0;
  for (int i = 0; i < count; i++) {
    /* differences from f0, so that a large constant does not matter */
    if (i >= with_zero) sum += weight[i] * (f[(i - with_zero) * stride] - f0);
    *size += fabs (weight[i]);
  }
  return sum;
}

/* A step that is tried. */
typedef struct {
  int decade, side; /* step 10^-decade of the size; 0: central; 1, -1: the side of the neighbours */
  double step;
  double *value; /* neighbours x outputs */
  int failed[2]; /* 1: a neighbour below, above could not be run */
} difference_level;

/* A derivative at a level. */
typedef struct {
  double derivative, error; /* error INFINITY: none */
  double noise;             /* the part of the error that is due to the runs */
  double below, above;      /* one-sided ones if they differ by more than their errors; else NaN */
  double jump;              /* of the one-sided derivatives at the smallest step where they differ; 0: nowhere */
  int same;                 /* 1: all values are the same */
} difference_estimate;

typedef struct {
  struct difference *x;
  int parameter; /* its index */
  double size;
  difference_level level[LEVELS];
  int levels, wanted; /* wanted: those that have not been run yet, the last ones */
} difference_parameter;

/* A run: at x (parameter AT_X); with a larger tolerance (AT_X_LOOSE, of index `neighbour`); or a neighbour. */
enum { AT_X = -1, AT_X_LOOSE = -2, LOOSE = 3 };
static const double loose[LOOSE] = { 10, 30, 100 }; /* larger tolerances that show the errors of runs */
typedef struct {
  int parameter, level, neighbour;
} difference_task;

typedef struct difference {
  const pw_difference_settings *d;
  difference_parameter *parameter;
  double *value, *loose; /* outputs: at x; LOOSE x outputs: with larger tolerances */
  double *run_error;     /* outputs */
  difference_task *task;
  int tasks;
  size_t task_room;
  atomic_int next, status;
  pthread_mutex_t lock;
  pw_error *error, first; /* first: of the first run that failed */
} difference;

static double difference_bound (const double *bound, int j, double otherwise) {
  return bound ? bound[j] : otherwise;
}

/* Adds a level to those wanted: central, or beside a bound on its inner side.  0 if there is no room for its
 * neighbours, or it is there. */
static int difference_want (difference_parameter *p, int decade, int side) {
  const pw_difference_settings *d = p->x->d;
  const double x = d->x[p->parameter], low = difference_bound (d->low, p->parameter, -INFINITY),
               high = difference_bound (d->high, p->parameter, INFINITY);
  int half = d->neighbours / 2;
  double step = exp2 (round (log2 (p->size * pow (10, -decade))));
  if (p->levels == LEVELS || decade > FINEST || decade < LEAST || !(x + step != x)) return 0;
  if (side == 0 && !(x - half * step >= low && x + half * step <= high)) side = x - low < high - x ? 1 : -1;
  if (side) step /= 2;
  if (!(x + 2 * half * step <= high) && side > 0) return 0;
  if (!(x - 2 * half * step >= low) && side < 0) return 0;
  for (int i = 0; i < p->levels; i++)
    if (p->level[i].decade == decade && p->level[i].side == side) return 0;
  double *value = malloc ((size_t)d->neighbours * (size_t)d->outputs * sizeof *value);
  if (value == NULL) {
    p->x->status = pw_fail (p->x->error, PW_RESOURCE, "out of memory");
    return 0;
  }
  p->level[p->levels++] = (difference_level){ .decade = decade, .side = side, .step = step, .value = value };
  p->wanted++;
  return 1;
}

static difference_estimate difference_at (const difference *x, const difference_level *l, int i) {
  const int n = x->d->outputs, most = x->d->neighbours;
  const double f0 = x->value[i], *f = l->value + i, h = l->step;
  difference_estimate e = { .derivative = NAN, .error = INFINITY, .noise = INFINITY, .below = NAN, .above = NAN };
  double size, least, noise = x->run_error[i], sixth = -20 * f0;
  static const int binomial[] = { 15, -6, 1 };
  if (l->failed[0] || l->failed[1]) return e;
  e.same = 1;
  for (int k = 0; k < most; k++) e.same &= f[k * n] == f0;
  if (e.same) noise = 4 * DBL_EPSILON * fabs (f0);
  for (int k = 0; k < MOST && most == MOST && l->side == 0; k++) sixth += binomial[k / 2] * f[k * n];
  const double fine = difference_formula (l->side, most, f0, f, n, &size),
               coarse = most > 2 ? difference_formula (l->side, most - 2, f0, f, n, &least) : fine,
               coarsest = most > 4 ? difference_formula (l->side, most - 4, f0, f, n, &least) : coarse;
  double remainder = fabs (fine - coarse);
  /* formulas whose remainders do not decrease do not converge yet */
  if (most > 4 && remainder > noise * size && remainder > 0.1 * fabs (coarse - coarsest)) remainder *= 10;
  e.derivative = fine / h, e.noise = noise * size / fabs (h);
  e.error = remainder / fabs (h) + e.noise;
  if (most == MOST && l->side == 0) e.error = fmax (e.error, fabs (sixth) / 10 * size / fabs (h));
  if (!isfinite (e.error)) return e.derivative = NAN, e.error = INFINITY, e;
  if (l->side || most < MOST) return e;
  double own[2], error = 16 * noise;
  for (int k = 0; k < 2; k++) { /* with the central nodes on one side, orders 3 and 2 */
    own[k] = difference_formula (k ? 1 : -1, 3, f0, f + k * n, 2 * n, &least);
    error += fabs (own[k] - difference_formula (k ? 1 : -1, 2, f0, f + k * n, 2 * n, &least));
  }
  if (fabs (own[1] - own[0]) > 2 * error) e.below = own[0] / h, e.above = own[1] / h, e.error = INFINITY;
  return e;
}

/* A run of a neighbour or with larger tolerances may fail; others end everything, as do memory and stops. */
static void difference_failed (difference *x, const difference_task *task, int status, const pw_error *own) {
  pthread_mutex_lock (&x->lock);
  if (x->first.status == PW_OK) x->first = *own, x->first.status = status;
  if (status == PW_RETRY || status == PW_RESOURCE || status == PW_STOPPED || task->parameter == AT_X) {
    if (x->status == PW_OK && x->error) *x->error = *own;
    x->status = status;
  } else if (task->parameter == AT_X_LOOSE) {
    for (int i = 0; i < x->d->outputs; i++) x->loose[task->neighbour * x->d->outputs + i] = NAN;
  } else {
    difference_level *l = &x->parameter[task->parameter].level[task->level];
    l->failed[difference_node (l->side, task->neighbour) > 0] = 1;
  }
  pthread_mutex_unlock (&x->lock);
}

static void difference_do (difference *x, const difference_task *task) {
  const pw_difference_settings *d = x->d;
  const int j = task->parameter;
  double *y = malloc ((size_t)d->parameters * sizeof *y), *value = x->value;
  pw_error own = { 0 };
  int status = y ? PW_OK : pw_fail (&own, PW_RESOURCE, "out of memory");
  if (y) memcpy (y, d->x, (size_t)d->parameters * sizeof *y);
  if (y && j >= 0) {
    const difference_level *l = &x->parameter[j].level[task->level];
    y[j] += difference_node (l->side, task->neighbour) * l->step;
    value = l->value + task->neighbour * d->outputs;
  }
  if (j == AT_X_LOOSE) value = x->loose + task->neighbour * d->outputs;
  if (y) status = d->evaluate (d->context, y, (j == AT_X_LOOSE ? loose[task->neighbour] : 1) * d->rtol, value, &own);
  if (status != PW_OK) difference_failed (x, task, status, &own);
  free (y);
}

static void *difference_thread (void *argument) {
  difference *x = argument;
  for (int i; x->status == PW_OK && (i = atomic_fetch_add (&x->next, 1)) < x->tasks;) difference_do (x, &x->task[i]);
  return NULL;
}

static int difference_add (difference *x, int parameter, int level, int neighbour) {
  if (pw_grow (&x->task, (size_t)x->tasks, &x->task_room, sizeof *x->task) != PW_OK) {
    x->status = PW_RESOURCE;
    return pw_fail (x->error, PW_RESOURCE, "out of memory");
  }
  x->task[x->tasks++] = (difference_task){ parameter, level, neighbour };
  return PW_OK;
}

/* Makes the runs of the tasks and of all levels that are wanted, in several threads, of which the caller is one. */
static int difference_evaluate (difference *x) {
  if (x->status != PW_OK) return x->status;
  for (int j = 0; j < x->d->parameters; j++)
    for (difference_parameter *p = &x->parameter[j]; p->wanted > 0; p->wanted--)
      for (int k = 0; k < x->d->neighbours; k++)
        if (difference_add (x, j, p->levels - p->wanted, k) != PW_OK) return x->status;
  int threads = x->d->jobs < x->tasks ? x->d->jobs : x->tasks, started = 0;
  pthread_t *thread = calloc ((size_t)(threads > 0 ? threads : 1), sizeof *thread);
  x->next = 0;
  while (thread && started < threads - 1 && pthread_create (thread + started, NULL, difference_thread, x) == 0)
    started++;
  difference_thread (x); /* does what other threads do not */
  while (started > 0) pthread_join (thread[--started], NULL);
  free (thread);
  x->tasks = 0;
  return x->status;
}

/* What is added to the error of level a: by how much it contradicts estimates with smaller steps, which are nearer to a
 * derivative.  That with the smallest step must agree with one of a larger step that has two digits or a similar error;
 * otherwise its error may be small by chance. */
static double difference_contradiction (const difference_parameter *p, const difference_estimate *e, int a) {
  double most = 0;
  int finest = 1, agrees = 0;
  for (int b = 0; b < p->levels; b++) {
    if (b == a || !isfinite (e[b].error)) continue;
    const double off = fabs (e[a].derivative - e[b].derivative);
    if (p->level[b].decade > p->level[a].decade) finest = 0, most = fmax (most, off - e[b].error);
    agrees |=
        off <= e[a].error + e[b].error && (e[b].error < 0.01 * fabs (e[b].derivative) || e[b].error <= 30 * e[a].error);
  }
  return finest && !agrees ? 9 * e[a].error : most;
}

/* The estimate of output i by parameter p: that of the level of least error, contradictions included; *best: this
 * level, or -1. */
static difference_estimate difference_best (const difference *x, const difference_parameter *p, int i, int *best) {
  difference_estimate found = { .derivative = NAN, .error = INFINITY, .noise = INFINITY, .below = NAN, .above = NAN },
                      e[LEVELS];
  int jump = -1;
  *best = -1;
  for (int a = 0; a < p->levels; a++) {
    e[a] = difference_at (x, &p->level[a], i);
    if (!isnan (e[a].below) && (jump < 0 || p->level[a].decade > p->level[jump].decade)) jump = a;
  }
  /* one-sided derivatives must agree at three steps; of these, the largest one is the most accurate */
  int same = 0, coarsest = jump;
  for (int a = 0; a < p->levels && jump >= 0; a++) {
    const double near = 0.02 * fabs (e[jump].above - e[jump].below);
    if (!(fabs (e[a].below - e[jump].below) < near && fabs (e[a].above - e[jump].above) < near)) continue;
    same++;
    if (p->level[a].decade < p->level[coarsest].decade) coarsest = a;
  }
  if (jump >= 0) found.jump = fabs (e[jump].above - e[jump].below);
  if (same >= 3) found.below = e[coarsest].below, found.above = e[coarsest].above;
  for (int a = 0; a < p->levels; a++) {
    const double error = e[a].error + difference_contradiction (p, e, a);
    if (!(error < found.error)) continue;
    found.derivative = e[a].derivative, found.error = error, found.noise = e[a].noise, found.same = e[a].same;
    *best = a;
  }
  found.error *= 2; /* the least of several estimates may be too small by chance: 1.5 times, in one of 2768 cases */
  return found;
}

/* The size of an output, for what counts as an effect. */
static double difference_output_size (const difference *x, const difference_parameter *p, int i) {
  double size = fabs (x->value[i]);
  for (int a = 0; a < p->levels; a++)
    for (int k = 0; k < x->d->neighbours && !p->level[a].failed[0] && !p->level[a].failed[1]; k++)
      if (isfinite (p->level[a].value[k * x->d->outputs + i]))
        size = fmax (size, fabs (p->level[a].value[k * x->d->outputs + i]));
  return size;
}

static void difference_improve (const difference *x, difference_parameter *p, int i) {
  /* decades of the largest step that could be run, and of the smallest one, even if it failed */
  int best, coarsest = FINEST + 1, finest = LEAST - 1, has_failed = 0;
  const difference_estimate e = difference_best (x, p, i, &best);
  const double natural = fmax (fabs (x->d->x[p->parameter]), 1), size = difference_output_size (x, p, i);
  if (!isfinite (x->value[i])) return;
  if (isfinite (e.error) && e.error <= ENOUGH * fabs (e.derivative)) return;
  if (isfinite (e.error) && e.error * natural <= NO_EFFECT * size && fabs (e.derivative) * natural <= NO_EFFECT * size)
    return;
  for (int a = 0; a < p->levels; a++) {
    const int failed = p->level[a].failed[0] || p->level[a].failed[1], decade = p->level[a].decade;
    has_failed |= failed;
    if (decade > finest) finest = decade;
    if (!failed && decade < coarsest) coarsest = decade;
  }
  if (best < 0) {                                        /* no level is consistent, or all have failed */
    for (int a = 0, levels = p->levels; a < levels; a++) /* neighbours on the other side of those that fail */
      if (p->level[a].failed[0] != p->level[a].failed[1] && p->level[a].side == 0)
        difference_want (p, p->level[a].decade, p->level[a].failed[0] ? 1 : -1);
    if (e.jump > 0 ? x->run_error[i] / (p->size * pow (10, -finest)) * 400 < e.jump : finest < FINEST / 2)
      difference_want (p, finest + 1, 0);
    return;
  }
  const double noise = e.noise * pow (10, finest + 1 - p->level[best].decade); /* at the next smaller step */
  if (p->level[best].decade == coarsest && !has_failed && e.noise > e.error / 4)
    difference_want (p, coarsest - (e.same || e.noise > fabs (e.derivative) ? SKIPPED : 1), 0);
  if (noise < e.error / 4) difference_want (p, finest + 1, 0);
}

static pw_derivative difference_result (const difference *x, const difference_parameter *p, int i) {
  int best;
  const difference_estimate e = difference_best (x, p, i, &best);
  const double size = fmax (fabs (x->d->x[p->parameter]), p->size);
  pw_derivative out = { PW_UNKNOWN, NAN, NAN, NAN, NAN };
  if (!isnan (e.below) && !(e.error < fabs (e.above - e.below) / 8))
    return (pw_derivative){ PW_NO_DERIVATIVE, NAN, NAN, e.below, e.above };
  if (best < 0) return out;
  out = (pw_derivative){ PW_DERIVATIVE, e.derivative, e.error, NAN, NAN };
  if (e.error > fabs (e.derivative) / 2 &&
      e.error * size > fmax (UNKNOWN * difference_output_size (x, p, i), UNKNOWN_SI))
    out.type = PW_UNKNOWN, out.value = out.error = NAN;
  return out;
}

/* Steps at which the error of the formula and that of the runs are about equal.  Neighbours that fail on one side are
 * replaced by those on the other. */
static int difference_fixed (difference *x) {
  const pw_difference_settings *d = x->d;
  for (int j = 0; j < d->parameters; j++) {
    const double range = difference_bound (d->high, j, INFINITY) - difference_bound (d->low, j, -INFINITY);
    x->parameter[j].size =
        fmin (x->parameter[j].size * pow (d->rtol, 1. / (d->neighbours + 1)), range / (4 * d->neighbours));
    if (!difference_want (&x->parameter[j], 0, 0) && x->status == PW_OK)
      return pw_fail (x->error, PW_METHOD, "parameter %d: its bounds leave no room for differences", j);
  }
  int status = difference_evaluate (x);
  for (int j = 0; j < d->parameters && status == PW_OK; j++) {
    const difference_level *l = &x->parameter[j].level[0];
    if (l->failed[0] != l->failed[1] && l->side == 0) difference_want (&x->parameter[j], 0, l->failed[0] ? 1 : -1);
  }
  if (status == PW_OK) status = difference_evaluate (x);
  for (int j = 0; j < d->parameters && status == PW_OK; j++) {
    const difference_level *l = &x->parameter[j].level[x->parameter[j].levels - 1];
    if (l->failed[0] || l->failed[1]) status = pw_fail (x->error, x->first.status, "%s", x->first.text);
  }
  return status;
}

static pw_derivative difference_of_fixed (const difference *x, const difference_parameter *p, int i) {
  const difference_estimate e = difference_at (x, &p->level[p->levels - 1], i);
  return (pw_derivative){ isnan (e.derivative) ? PW_UNKNOWN : PW_DERIVATIVE, e.derivative,
                          x->d->neighbours == 2 ? NAN : e.error, NAN, NAN };
}

static int difference_check (const pw_difference_settings *d, const pw_derivative *out, pw_error *error) {
  int status = pw_require (d, "a difference", error);
  if (status == PW_OK) status = pw_require (out, "room for derivatives", error);
  if (status != PW_OK) return status;
  if (d->evaluate == NULL || d->x == NULL || d->parameters < 1 || d->outputs < 1 ||
      (d->neighbours != 2 && d->neighbours != 4 && d->neighbours != 6) || !(d->rtol > 0))
    return pw_fail (error, PW_INPUT,
                    "a difference: expected a function, parameters, outputs, 2, 4 or 6 neighbours, and rtol > 0");
  return PW_OK;
}

static int difference_open (difference *x) {
  const pw_difference_settings *d = x->d;
  const size_t n = (size_t)d->outputs;
  x->parameter = calloc ((size_t)d->parameters, sizeof *x->parameter);
  x->value = calloc ((2 + LOOSE) * n, sizeof *x->value);
  if (x->parameter == NULL || x->value == NULL) return pw_fail (x->error, PW_RESOURCE, "out of memory");
  x->run_error = x->value + n, x->loose = x->run_error + n;
  for (int j = 0; j < d->parameters; j++) {
    const double size = d->size ? fabs (d->size[j]) : fabs (d->x[j]);
    x->parameter[j] = (difference_parameter){ .x = x, .parameter = j, .size = size > 0 ? size : 1 };
  }
  if (d->value) memcpy (x->value, d->value, n * sizeof *x->value);
  if (d->value == NULL) (void)difference_add (x, AT_X, 0, 0);
  for (int k = 0; k < LOOSE && d->neighbours == MOST; k++) (void)difference_add (x, AT_X_LOOSE, 0, k);
  return x->status;
}

/* Starts with two steps, together with the runs at x.  The error of an output of a run: tolerance by tolerance the
 * change by a larger one, which is about that many times the error, but at events may be small by chance; at least that
 * of one decade. */
static int difference_controlled (difference *x) {
  const int steering = x->d->steering > 0 ? x->d->steering : x->d->outputs;
  for (int j = 0; j < x->d->parameters; j++)
    for (int k = 0, found = 0; k <= FINEST && found < 2; k++) found += difference_want (&x->parameter[j], FIRST + k, 0);
  int status = difference_evaluate (x);
  for (int i = 0; i < x->d->outputs && status == PW_OK; i++) {
    const double f = x->value[i];
    x->run_error[i] = x->d->rtol * fabs (f);
    for (int k = 0; k < LOOSE; k++) {
      double change = fabs (x->loose[k * x->d->outputs + i] - f);
      x->run_error[i] =
          fmax (x->run_error[i], isnan (change) && isfinite (f) ? INFINITY : change / loose[k] * loose[0]);
    }
  }
  for (int more = 1; more && status == PW_OK;) {
    more = 0;
    for (int j = 0; j < x->d->parameters; j++) {
      for (int i = 0; i < steering; i++) difference_improve (x, &x->parameter[j], i);
      more |= x->parameter[j].wanted > 0;
    }
    status = more ? difference_evaluate (x) : x->status;
  }
  return status;
}

int pw_differentiate (const pw_difference_settings *d, pw_derivative *out, double *value, pw_error *error) {
  if (difference_check (d, out, error) != PW_OK) return PW_INPUT;
  difference x = { .d = d, .error = error };
  pthread_mutex_init (&x.lock, NULL);
  int status = difference_open (&x);
  if (status == PW_OK) status = d->neighbours < MOST ? difference_fixed (&x) : difference_controlled (&x);
  for (int j = 0; j < d->parameters && status == PW_OK; j++)
    for (int i = 0; i < d->outputs; i++)
      out[j * d->outputs + i] =
          (d->neighbours < MOST ? difference_of_fixed : difference_result) (&x, &x.parameter[j], i);
  if (value && status == PW_OK) memcpy (value, x.value, (size_t)d->outputs * sizeof *value);
  for (int j = 0; x.parameter && j < d->parameters; j++)
    for (int a = 0; a < x.parameter[j].levels; a++) free (x.parameter[j].level[a].value);
  free (x.parameter);
  free (x.value);
  free (x.task);
  pthread_mutex_destroy (&x.lock);
  return status;
}

const char *pw_accurate_method (const pw_system *s, const pw_settings *settings, double t_end, long *most_steps,
                                pw_error *error) {
  static const char *const method[] = { "erk8+projection", "radau" };
  static const long most[] = { 200000, 20000 };
  const double few = 2000, ratio = 20; /* a step of radau costs as much as 2 to 10 of erk8; it has a lower order */
  const double more = 200; /* steps at 1e-12 over those at 1e-6: 6 by erk8, 16 by radau, and more at neighbours */
  pw_error own[2] = { 0 };
  double steps[2] = { INFINITY, INFINITY }; /* of a run with the tolerance 1e-6; INFINITY: it fails */
  if (pw_require (s, "a system", error) != PW_OK || pw_require (settings, "settings", error) != PW_OK) return NULL;
  for (int i = 0; i < 2 && !(steps[0] < few); i++) {
    pw_settings at = *settings;
    at.rtol = 1e-6, at.atol = 0, at.max_steps = most[i];
    pw_run *r = pw_run_open (s, method[i], &at, &own[i]);
    int status = r ? PW_OK : own[i].status;
    while (status == PW_OK && pw_run_time (r) < t_end) status = pw_run_advance (r, t_end, &own[i]);
    if (status == PW_OK) steps[i] = (double)pw_run_statistics (r)->steps;
    pw_run_close (r);
    if (status == PW_RESOURCE) pw_fail (error, PW_RESOURCE, "%s", own[i].text);
    if (status == PW_RESOURCE || status == PW_STOPPED) return NULL;
  }
  const int best = ratio * steps[1] < steps[0];
  *most_steps = (long)fmin (more * (steps[best] + 1000), 1e9);
  if (isfinite (steps[best])) return method[best];
  pw_fail (error, PW_METHOD, "no method is accurate enough for derivatives: %s", own[0].text);
  return NULL;
}
