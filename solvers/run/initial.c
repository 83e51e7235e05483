/* Makes the initial state of a run consistent with the constraints: positions, then velocities.
 *
 * Values given by the user or specified by the model are candidates; those left out are free.  Positions:
 *
 * 1. All candidates are prescribed, and the free values solve the constraint equations by Levenberg and Marquardt's
 *    method.  If they have to turn far, or do not converge, further searches begin elsewhere; the nearest solution is
 *    taken.  A search that cannot satisfy all candidates goes on with their changes minimised.
 * 2. If candidates had to change, as many as possible are prescribed exactly, from that solution, in the order of their
 *    importance.  Those that the others determine follow.
 *
 * Velocities are linear: the same two parts, without searches.  All free values change as little as possible in the
 * metric.  A state that is consistent to round-off is left unchanged, bit for bit.
 *
 * One step solves   [ W  G^T ] [ dq ]   [ force ]
 *                   [ G  -D  ] [ mu ] = [  -g   ]
 *
 * with the damping D: the step of Levenberg and Marquardt for g = 0, which dependent equations do not disturb.  (More
 * 1978, The Levenberg-Marquardt algorithm: implementation and theory.) */
#include <stdlib.h>
#include "rank.h"
#include "tangent.h"
#include "sparse.h"

/* Importance of a value. */
enum {
  INITIAL_FREE,
  INITIAL_MASS,          /* left out, of a coordinate with mass, where massless ones can move instead */
  INITIAL_SPECIFIED = 2, /* 0; one more: not 0.  From here on: candidates */
  INITIAL_ZERO = 4,      /* as INITIAL_MASS, a position 0 in C, which may be specified */
  INITIAL_GIVEN = 5,     /* 0; one more: not 0 */
  INITIAL_KEPT = 7       /* prescribed */
};

/* Stages of a search: the least importance of values that are prescribed, and the weights of free values relative to
 * other candidates (0: the metric).  A stage with another set of prescribed values begins anew, except the last set; it
 * and the others go on where the stage before has failed.  Large scenes skip stages in which free values weigh little,
 * since these need many iterations. */
static const struct initial_stage {
  int prescribed;
  double weight_of_free;
} initial_stage[] = {
  { INITIAL_MASS, 0 },  { INITIAL_SPECIFIED, 0 }, { INITIAL_GIVEN, 1e-6 }, { INITIAL_GIVEN, 1e-3 },
  { INITIAL_GIVEN, 1 }, { INITIAL_KEPT, 1e-6 },   { INITIAL_KEPT, 1e-3 },  { INITIAL_KEPT, 1 },
};
static const int INITIAL_STAGES = sizeof initial_stage / sizeof *initial_stage;
static const struct initial_stage initial_least_change = { INITIAL_KEPT, 1e-6 };

/* Searches: the distances at which they begin [units of L and rad]; their number in a scene of at most 100 coordinates;
 * where they end: the changes of candidates and the turn of free angles of a solution that is near enough. */
static const double initial_start[] = { 0, 0.1, 0.3, 0.6, 1, 1.5, 2, 2, 3 };
enum { INITIAL_STARTS = 20, INITIAL_STARTS_TO_TURN_LESS = 10, INITIAL_STARTS_FOUND = 10 };
static const double INITIAL_UNCHANGED = 1e-4, INITIAL_TURNED = 0.2;
/* How much less a turned angle counts than a changed candidate, squares compared. */
static const double INITIAL_LESS = 1e-9;

/* Iterations of a search; those that may hardly reduce the residual; the scaled residual from which Newton's method
 * converges; damping relative to the largest diagonal entry of G W^-1 G^T. */
enum {
  INITIAL_ITERATIONS = 60,
  INITIAL_ITERATIONS_LARGE = 30,
  INITIAL_SLOW = 5,
  INITIAL_RELAXATIONS = 12,
  INITIAL_QUADRATIC = 15
};
static const double INITIAL_NEAR = 1e-9, INITIAL_LEAST_DAMPING = DBL_EPSILON / 2, INITIAL_MOST_DAMPING = 1e3,
                    INITIAL_SMALL_DAMPING = 1e-12, INITIAL_LEAST_SQUARES = 1e-8;
/* Largest turn in a step towards a nearer solution, and towards prescribed values; the smallest part of the way in such
 * a step, alone and together with other values. */
static const double INITIAL_RELAXED = 0.3, INITIAL_STEP = 0.7, INITIAL_PART = 1. / 32, INITIAL_PART_OF_MANY = 1. / 4;

/* How far prescribed values may change others: multiples of the least change, or a distance [units of L and rad]. */
static const double INITIAL_AMPLIFIED = 10, INITIAL_CHANGE = 0.1;
/* How much more than in the least change of all velocities change if the specified ones depend on the others. */
static const double INITIAL_DEPENDENT = 1e7;
/* Changes that may be due to the round-off of other values, relative. */
static const double INITIAL_ROUND = 1e-10;
/* Smaller changes, in units of the scene, are those of a value that was rounded. */
static const double INITIAL_ROUNDED = 1e-2;
/* The most attempts to keep values.  In scenes of more coordinates than this, attempts and searches are fewer in
 * inverse proportion to them, so that the costs do not grow faster than those of one search. */
enum { INITIAL_ATTEMPTS = 200, INITIAL_SMALL = 100 };
/* Below this share of them, values are prescribed in one step, and the residual may grow by this factor in an
 * iteration. */
static const double INITIAL_SMALL_SHARE = 0.1, INITIAL_GROWTH = 100;

typedef enum { INITIAL_POSITIONS, INITIAL_VELOCITIES } initial_level;

typedef struct {
  pw_run *r;
  const pw_system *s;
  initial_level level;
  int rows;                             /* equations of the level */
  const unsigned char *origin;          /* coords, of the level; NULL: nothing is given or specified */
  double *value, *given;                /* coords, of the level: r->q or r->v, and as described */
  unsigned char *importance;            /* coords; changed in the course of the work */
  unsigned char *described;             /* coords: as it was first */
  unsigned char *basis;                 /* coords: 1 for values that the others determine */
  unsigned char *unused;                /* coords: 1 for those in no equation of the level */
  int *list;                            /* coords: values to be kept */
  double *weight;                       /* coords: INFINITY for prescribed values */
  double *target;                       /* coords: prescribed values go there */
  double *from, *last, *nearest, *best; /* coords: where a part of the work began, or the best of its results */
  double *step;                         /* coords + rows: right-hand side and solution of a linear system */
  double *residual, *unit, *diagonal;   /* rows; unit: L or 1 rad; diagonal: of G W^-1 G^T */
  double damping_unit;                  /* the largest diagonal entry of G W^-1 G^T in these units */
  pw_scatter_map map;                   /* of the matrix */
  pw_sparse matrix;
  double least; /* the largest change of a candidate in the least change of all */
  double share; /* of the most attempts and searches: less than 1 in large scenes */
  int attempts, most_attempts, out_of_memory;
  int failed_row;   /* the equation that remains violated; -1: unknown */
  double failed_by; /* [m, rad, m/s, rad/s] */
  char *memory;
} initial_search;

/* 1 if an equation is not enforced, its multiplier being at a limit. */
static int initial_is_free (const initial_search *x, int row) {
  return x->r->enforced && !x->r->enforced[row];
}

/* Residuals of such equations count as 0. */
static void initial_release (initial_search *x) {
  for (int i = 0; i < x->rows; i++)
    if (initial_is_free (x, i)) x->residual[i] = 0;
}

/* The matrix, or its pattern while the map is recorded; columns of prescribed values are those of the identity.
 * damping: relative to the largest diagonal entry of G W^-1 G^T, for all equations alike; 0: for Newton's method, to
 * the round-off of each entry, so that dependent equations have a solution. */
static void initial_fill (initial_search *x, double damping) {
  const int n = x->s->coords;
  pw_scatter_map *map = &x->map;
  if (!map->recording) pw_scatter_begin_fill (map, map->value);
  for (int j = 0; j < n; j++) pw_scatter_add (map, j, j, isinf (x->weight[j]) ? 1 : x->weight[j]);
  PW_EACH_CONSTRAINT (k, x->r->w)
    for (int i = 0; k->row < x->rows && i < k->b.count * k->kind->rows; i++)
      for (int c = 0; c < k->b.cols; c++) {
        const int j = pw_global (k, i / k->kind->rows, c);
        if (j >= n) continue;
        const double J = isinf (x->weight[j]) || initial_is_free (x, k->row + i) ? 0 : k->J[i * k->b.cols + c];
        pw_scatter_add (map, n + k->row + i, j, J);
        pw_scatter_add (map, j, n + k->row + i, J);
      }
  for (int i = 0; i < x->rows; i++)
    pw_scatter_add (map, n + i, n + i,
                    damping == 0 ? -INITIAL_LEAST_DAMPING * x->diagonal[i]
                                 : -damping * x->damping_unit * x->unit[i] * x->unit[i]);
}

/* Solves for x->step with x->residual and force (coords; NULL: 0), at the J last evaluated. */
static int initial_solve (initial_search *x, double damping, const double *force) {
  const int n = x->s->coords;
  int status;
  do {
    initial_fill (x, damping);
    x->r->statistics.factorisations++;
    status = pw_sparse_factor (&x->matrix, x->map.value);
    damping = damping == 0 ? INITIAL_SMALL_DAMPING : 100 * damping;
  } while (status == PW_SINGULAR && damping < INITIAL_MOST_DAMPING); /* pivots may cancel to 0 */
  x->out_of_memory |= status == PW_RESOURCE;
  if (status != PW_OK) return PW_RETRY;
  for (int j = 0; j < n; j++) x->step[j] = force && !isinf (x->weight[j]) ? force[j] : 0;
  for (int i = 0; i < x->rows; i++) x->step[n + i] = -x->residual[i];
  status = pw_sparse_solve (&x->matrix, x->step);
  x->out_of_memory |= status == PW_RESOURCE;
  return status == PW_OK ? PW_OK : PW_RETRY;
}

/* The unit of each equation, the diagonal of G W^-1 G^T (without massless coordinates of weight 0) and its largest
 * entry in these units, at the J last evaluated. */
static void initial_units (initial_search *x) {
  const pw_system *s = x->s;
  x->damping_unit = 0;
  PW_EACH_CONSTRAINT (k, x->r->w)
    for (int i = 0; k->row < x->rows && i < k->b.count * k->kind->rows; i++) {
      double sum = 0;
      int length = 0;
      for (int c = 0; c < k->b.cols; c++) {
        const int j = pw_global (k, i / k->kind->rows, c);
        const double J = initial_is_free (x, k->row + i) ? 0 : k->J[i * k->b.cols + c];
        if (c < 3 * k->kind->bodies && c % 3 < 2) length |= J != 0;
        if (j < s->coords && x->weight[j] > 0) sum += J * J / x->weight[j];
      }
      const double unit = x->unit[k->row + i] = length ? s->scale.length : 1;
      x->diagonal[k->row + i] = sum;
      x->damping_unit = fmax (x->damping_unit, sum / (unit * unit));
    }
  if (!(x->damping_unit > 0)) x->damping_unit = 1;
  for (int i = 0; i < x->rows; i++)
    if (x->diagonal[i] == 0) x->diagonal[i] = x->damping_unit * x->unit[i] * x->unit[i];
}

/* Factor of the metric of massless coordinates, by which it becomes 1e-6 of the least entry of the mass matrix (angles
 * in units of L), but at least 1e-12 of the largest.  (In the system's metric it refers to the mean entry, which
 * unrelated massive bodies may determine.) */
static double initial_massless_scale (const pw_system *s) {
  double least = INFINITY, most = 0, massless = 0;
  for (int j = 0; j < s->coords; j++) {
    double length = pw_length_factor (s, j), entry = s->metric[j] / (length * length);
    if (s->mass[j] > 0)
      least = fmin (least, entry), most = fmax (most, entry);
    else
      massless = entry;
  }
  return massless > 0 && most > 0 ? fmax (1e-6 * least, 1e-12 * most) / massless : 1;
}

/* The weights of a metric; values of at least this importance are prescribed as described.  If `metric` is the mass
 * matrix, the equations determine massless velocities. */
static void initial_weights (initial_search *x, const double *metric, int importance) {
  const pw_system *s = x->s;
  const double scale = initial_massless_scale (s);
  for (int j = 0; j < s->coords; j++) {
    x->weight[j] = x->importance[j] >= importance ? INFINITY : s->mass[j] > 0 ? metric[j] : scale * metric[j];
    x->target[j] = x->given[j];
  }
}

static void initial_stage_weights (initial_search *x, const struct initial_stage *stage) {
  initial_weights (x, x->s->metric, stage->prescribed);
  for (int j = 0; j < x->s->coords && stage->weight_of_free > 0; j++) {
    const double length = pw_length_factor (x->s, j);
    const int free = x->importance[j] < INITIAL_SPECIFIED;
    if (!isinf (x->weight[j])) x->weight[j] = length * length * (free ? stage->weight_of_free : 1);
  }
}

/* 1 if a stage differs from the ones before it, in the n-th search. */
static int initial_uses_stage (const initial_search *x, const struct initial_stage *stage, int n) {
  int mass = 0, given = 0;
  for (int j = 0; j < x->s->coords; j++) {
    mass |= x->importance[j] == INITIAL_MASS;
    given |= x->importance[j] >= INITIAL_GIVEN;
  }
  if (x->share < INITIAL_SMALL_SHARE && stage->weight_of_free > 0 && stage->weight_of_free < 1) return 0;
  return stage->prescribed == INITIAL_MASS ? n == 0 && mass : stage->prescribed != INITIAL_GIVEN || given;
}

typedef struct {
  double candidate; /* the largest change of a candidate [units of L and rad, per s] */
  double angle;     /* the largest turn of a free angle [rad] */
  double sum;       /* sum of squares of the former and, with INITIAL_LESS, of the latter */
} initial_change;

static initial_change initial_changes (const initial_search *x) {
  initial_change change = { 0 };
  for (int j = 0; j < x->s->coords; j++) {
    const double relative = fabs (x->value[j] - x->given[j]) / pw_unit (x->s, j);
    if (x->origin && x->origin[j] & (PW_GIVEN | PW_SPECIFIED))
      change.candidate = fmax (change.candidate, relative), change.sum += relative * relative;
    else if (pw_is_angle (x->s, j))
      change.angle = fmax (change.angle, relative), change.sum += INITIAL_LESS * relative * relative;
  }
  return change;
}

/* The sum of squares of x->residual in its units at the positions x->value, and the worst one; INFINITY if it is not
 * finite, or if a signal failed. */
static double initial_objective (initial_search *x, pw_residuals *now) {
  pw_run *r = x->r;
  double sum = 0, *size = r->scratch;
  if (pw_update_kinematics (r->w, r->t, r->q, r->v) != PW_OK) return INFINITY;
  pw_evaluate_g (r->w, x->residual);
  initial_release (x);
  for (int i = 0; i < x->rows; i++) sum += x->residual[i] / x->unit[i] * (x->residual[i] / x->unit[i]);
  pw_worst_position (r->w, x->residual, size, NULL, 0, now);
  return isfinite (sum) ? sum : INFINITY;
}

/* 1 if the caller requests a stop while the run is opened: all work then fails. */
static int initial_is_stopped (initial_search *x) {
  return x->origin && pw_run_stop_opening (x->r);
}

/* A step from x->last, at the J there, and the objective at its end; INFINITY if there is no step. */
static double initial_step (initial_search *x, double damping, pw_residuals *now) {
  const int n = x->s->coords;
  memcpy (x->value, x->last, (size_t)n * sizeof (double));
  if (initial_solve (x, damping, NULL) != PW_OK) return INFINITY;
  for (int j = 0; j < n; j++) x->value[j] += x->step[j];
  return initial_objective (x, now);
}

/* Levenberg and Marquardt's method from the positions x->value, with those of infinite weight at their targets, to
 * round-off.  1 if it converges within the number of iterations given; 0: x->failed_row, and where it ends. */
static int initial_converge (initial_search *x, int iterations) {
  pw_run *r = x->r;
  const size_t bytes = (size_t)x->s->coords * sizeof (double), rows = (size_t)x->rows * sizeof (double);
  double *before = r->scratch + x->s->rows; /* residuals at x->last */
  pw_residuals now = { 0 };
  int slow = 0, n = 0;
  for (int j = 0; j < x->s->coords; j++)
    if (isinf (x->weight[j])) x->value[j] = x->target[j];
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK) return 0;
  initial_units (x);
  const double accepted = PW_RESIDUAL_ACCEPTED * pw_largest_angle (x->s, r->q);
  double sum = initial_objective (x, &now), previous = INFINITY;
  /* In long chains damping slows the iteration down: Newton's method, whose residual may grow at first, begins. */
  const int is_large = x->share < INITIAL_SMALL_SHARE;
  const double growth = is_large ? INITIAL_GROWTH : 1;
  double damping = is_large ? INITIAL_LEAST_DAMPING : fmin (1e-2, now.position);
  for (; n < iterations && isfinite (sum) && now.position > PW_RESIDUAL_CONVERGED && slow < INITIAL_SLOW; n++) {
    const int near = now.position <= INITIAL_NEAR;
    if (initial_is_stopped (x)) return 0;
    if (now.position <= accepted && now.position > previous / 4) break; /* at round-off: convergence is quadratic */
    previous = near ? now.position : INFINITY;
    pw_evaluate_J (r->w);
    memcpy (x->last, x->value, bytes);
    memcpy (before, x->residual, rows);
    double next = initial_step (x, near ? 0 : damping, &now);
    while (!near && !(next < growth * sum) && damping < INITIAL_MOST_DAMPING) {
      memcpy (x->residual, before, rows);
      damping = fmax (4 * damping, 1e-12);
      next = initial_step (x, damping, &now);
    }
    if (!near && !(next < growth * sum)) {
      memcpy (x->value, x->last, bytes);
      (void)initial_objective (x, &now);
      break;
    }
    slow = !near && next > 0.99 * sum ? slow + 1 : 0;
    damping = fmax (damping * (next < 0.1 * sum ? 0.01 : 0.1), INITIAL_LEAST_DAMPING);
    sum = next;
  }
  if (now.position <= accepted) return 1;
  x->failed_row = now.row_position;
  if (now.row_position >= 0) x->failed_by = fabs (x->residual[now.row_position]);
  return 0;
}

static double initial_distance (const initial_search *x) {
  double sum = 0;
  for (int j = 0; j < x->s->coords; j++)
    if (!isinf (x->weight[j])) sum += x->weight[j] * (x->value[j] - x->given[j]) * (x->value[j] - x->given[j]);
  return sum;
}

/* Moves consistent positions along the constraints to nearer ones, by Gauss-Newton steps in the weights of a stage. */
static void initial_relax (initial_search *x) {
  pw_run *r = x->r;
  const int n = x->s->coords;
  double *force = x->from;
  for (int i = 0; i < INITIAL_RELAXATIONS; i++) {
    double most = INITIAL_RELAXED, before = initial_distance (x);
    memcpy (x->nearest, x->value, (size_t)n * sizeof (double));
    for (int j = 0; j < n; j++) force[j] = isinf (x->weight[j]) ? 0 : x->weight[j] * (x->given[j] - x->value[j]);
    memset (x->residual, 0, (size_t)x->rows * sizeof (double));
    if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) != PW_OK || initial_solve (x, INITIAL_SMALL_DAMPING, force) != PW_OK)
      return;
    for (int j = 0; j < n; j++)
      if (pw_is_angle (x->s, j)) most = fmax (most, fabs (x->step[j]));
    for (int j = 0; j < n; j++) x->value[j] += INITIAL_RELAXED / most * x->step[j];
    if (initial_converge (x, INITIAL_ITERATIONS) && initial_distance (x) < 0.9999 * before) continue;
    memcpy (x->value, x->nearest, (size_t)n * sizeof (double));
    return;
  }
}

/* Takes whole turns out of the changes of free angles, if the constraints allow it. */
static void initial_unwind (initial_search *x) {
  const size_t bytes = (size_t)x->s->coords * sizeof (double);
  const double before = initial_changes (x).sum;
  int turns = 0;
  memcpy (x->nearest, x->value, bytes);
  for (int j = 0; j < x->s->coords; j++) {
    const double change = x->value[j] - x->given[j];
    if (!pw_is_angle (x->s, j) || x->importance[j] >= INITIAL_SPECIFIED || fabs (change) <= PW_PI) continue;
    x->value[j] = x->given[j] + remainder (change, 2 * PW_PI);
    turns = 1;
  }
  if (turns && !(initial_converge (x, INITIAL_ITERATIONS) && initial_changes (x).sum < before))
    memcpy (x->value, x->nearest, bytes);
}

/* Consistent positions in x->value: the nearest ones that the searches find.  PW_OK or PW_RETRY. */
static int initial_search_positions (initial_search *x) {
  const pw_system *s = x->s;
  const size_t bytes = (size_t)s->coords * sizeof (double);
  const int starts = (int)fmax (2, INITIAL_STARTS * x->share);
  int free = 0, found = 0, failed_row = -1;
  double failed_by = 0;
  initial_change best = { .sum = INFINITY };
  for (int j = 0; j < s->coords; j++) free += x->importance[j] < INITIAL_SPECIFIED && !x->unused[j];
  for (int n = 0; n < starts && !(found && (free == 0 || n > INITIAL_STARTS_FOUND)); n++) {
    const int near = (int)(sizeof initial_start / sizeof *initial_start);
    const int all = free == 0 || (n >= near && n % 2 == 1); /* 1: candidates are moved, too, not free values alone */
    int converged = 0, begun = INITIAL_FREE;
    for (const struct initial_stage *stage = initial_stage; stage < initial_stage + INITIAL_STAGES && !converged;
         stage++) {
      if (!initial_uses_stage (x, stage, n)) continue;
      for (int j = 0; j < s->coords && stage->prescribed != begun && stage->prescribed < INITIAL_KEPT; j++) {
        const int moves = !x->unused[j] && (all || x->importance[j] < INITIAL_SPECIFIED);
        const double distance = initial_start[n < near ? n : near - 1] * pw_unit (s, j) * pw_irregular (n, j + 1);
        x->value[j] = x->given[j] + (moves ? distance : 0);
      }
      begun = stage->prescribed;
      initial_stage_weights (x, stage);
      converged = initial_converge (x, INITIAL_ITERATIONS);
    }
    if (n == 0) failed_row = x->failed_row, failed_by = x->failed_by;
    if (converged) initial_unwind (x);
    if (converged && n > 0) initial_relax (x);
    const initial_change change = initial_changes (x);
    if (converged && change.sum < 0.99 * best.sum) {
      found = 1, best = change;
      memcpy (x->best, x->value, bytes);
    }
    const int turned = best.angle > INITIAL_TURNED && n < INITIAL_STARTS_TO_TURN_LESS;
    if (found && best.candidate <= INITIAL_UNCHANGED && !turned) break;
  }
  x->failed_row = failed_row, x->failed_by = failed_by;
  x->least = best.candidate;
  if (found) memcpy (x->value, x->best, bytes);
  return found ? PW_OK : PW_RETRY;
}

/* Moves the positions kept to their values, in steps, from the consistent ones x->value.  PW_RETRY: they cannot be
 * reached with turns of at most INITIAL_STEP in a step, and steps of at least this part of the way. */
static int initial_reach (initial_search *x, double least_part) {
  const int n = x->s->coords;
  const size_t bytes = (size_t)n * sizeof (double);
  double done = 0, part = 1;
  initial_weights (x, x->s->metric, INITIAL_KEPT);
  memcpy (x->from, x->value, bytes);
  memcpy (x->nearest, x->value, bytes);
  while (done < 1 && part >= least_part) {
    const double to = fmin (1, done + part);
    double most = 0;
    for (int j = 0; j < n; j++) x->target[j] = to == 1 ? x->given[j] : x->from[j] + to * (x->given[j] - x->from[j]);
    const int converged =
        initial_converge (x, x->share < INITIAL_SMALL_SHARE ? INITIAL_ITERATIONS_LARGE : INITIAL_QUADRATIC);
    for (int j = 0; j < n; j++)
      if (pw_is_angle (x->s, j)) most = fmax (most, fabs (x->value[j] - x->nearest[j]));
    if (converged && most <= INITIAL_STEP) {
      done = to, part *= 2;
      memcpy (x->nearest, x->value, bytes);
    } else {
      part /= 2;
      memcpy (x->value, x->nearest, bytes);
    }
  }
  return done == 1 ? PW_OK : PW_RETRY;
}

/* x->residual = J v - eta, of equations that are enforced, at the kinematics and J last evaluated. */
static void initial_velocity_residual (initial_search *x, const double *v) {
  double *eta = x->r->scratch;
  pw_mul_J (x->r->w, v, x->residual);
  pw_evaluate_eta (x->r->w, eta);
  for (int i = 0; i < x->rows; i++) x->residual[i] -= eta[i];
  initial_release (x);
}

/* Velocities nearest to the described ones in the weights, at the kinematics and J last evaluated. */
static int initial_project_velocities (initial_search *x) {
  pw_run *r = x->r;
  const int n = x->s->coords;
  double previous = INFINITY;
  pw_residuals now;
  memcpy (x->value, x->given, (size_t)n * sizeof (double));
  initial_units (x);
  for (;;) {
    if (pw_update_velocities (r->w, x->value) != PW_OK) return PW_METHOD;
    pw_evaluate_residuals (r->w, r->enforced, &now);
    initial_velocity_residual (x, x->value);
    if (now.velocity <= PW_RESIDUAL_CONVERGED) return PW_OK;
    if (!(now.velocity <= previous / 4) || initial_solve (x, 0, NULL) != PW_OK) break;
    previous = now.velocity;
    for (int j = 0; j < n; j++) x->value[j] += x->step[j];
  }
  x->failed_row = now.row_velocity;
  if (now.row_velocity >= 0) x->failed_by = fabs (x->residual[now.row_velocity]);
  return now.velocity <= PW_RESIDUAL_ACCEPTED ? PW_OK : PW_RETRY;
}

/* As initial_project_velocities, with those of this importance prescribed.  The metric is the mass matrix or, if that
 * does not determine massless velocities, that of positions. */
static int initial_prescribe_velocities (initial_search *x, int importance) {
  initial_weights (x, x->s->mass, importance);
  int status = initial_project_velocities (x);
  if (status != PW_RETRY) return status;
  initial_weights (x, x->s->metric, importance);
  return initial_project_velocities (x);
}

/* Columns of L of a decomposition of G by columns, divided by their pivots. */
typedef struct {
  int rank;
  int *pivot_of, *pivot_row; /* rows: number of the pivot of a row, or -1; row of a pivot */
  size_t *first;             /* rows + 1: first entry of a column */
  struct initial_entry {
    int row;
    double value;
  } * entry;
  size_t entries, room;
  double *column; /* rows: the column in progress; 0 between uses */
  double *norm;   /* rows: of G, angles as lengths */
} initial_factors;

/* Takes column j into the basis if it is independent of those before it: 1, 0, or PW_RESOURCE.  (Gilbert & Peierls
 * 1988, Sparse partial pivoting in time proportional to arithmetic operations.) */
static int initial_enter (const initial_search *x, initial_factors *f, int j, double independent) {
  const int n = x->s->coords;
  int first = f->rank, best = -1;
  double most = independent;
  const size_t begin = f->entries; /* of the list of its rows without a pivot, each once or more */
  for (int64_t p = x->map.colptr[j]; p < x->map.colptr[j + 1]; p++) {
    const int i = (int)x->map.rowind[p] - n;
    if (i < 0) continue;
    f->column[i] = x->map.value[p] / f->norm[i] / pw_length_factor (x->s, j);
    if (f->pivot_of[i] >= 0)
      first = f->pivot_of[i] < first ? f->pivot_of[i] : first;
    else if (pw_grow (&f->entry, f->entries, &f->room, sizeof *f->entry) == PW_OK)
      f->entry[f->entries++].row = i;
    else
      return PW_RESOURCE;
  }
  for (int k = first; k < f->rank; k++) {
    const double u = f->column[f->pivot_row[k]];
    f->column[f->pivot_row[k]] = 0;
    for (size_t p = f->first[k]; u != 0 && p < f->first[k + 1]; p++) {
      const struct initial_entry e = f->entry[p];
      if (f->column[e.row] == 0 && f->pivot_of[e.row] < 0) {
        if (pw_grow (&f->entry, f->entries, &f->room, sizeof *f->entry) != PW_OK) return PW_RESOURCE;
        f->entry[f->entries++].row = e.row;
      }
      f->column[e.row] -= u * e.value;
    }
  }
  for (size_t p = begin; p < f->entries; p++)
    if (fabs (f->column[f->entry[p].row]) > most) most = fabs (f->column[f->entry[p].row]), best = f->entry[p].row;
  const double pivot = best >= 0 ? f->column[best] : 1;
  size_t end = begin;
  for (size_t p = begin; p < f->entries; p++) {
    const int i = f->entry[p].row;
    if (best >= 0 && i != best && f->column[i] != 0)
      f->entry[end++] = (struct initial_entry){ i, f->column[i] / pivot };
    f->column[i] = 0;
  }
  f->entries = end;
  if (best < 0) return 0;
  f->pivot_of[best] = f->rank;
  f->pivot_row[f->rank++] = best;
  f->first[f->rank] = f->entries;
  return 1;
}

/* The m-th coordinate in the order of the file; of those of a body, the angle comes first. */
static int initial_order (const initial_search *x, int m) {
  return m >= 3 * x->s->bodies ? m : m % 3 == 0 ? m + 2 : m - 1;
}

/* The order in which columns of these importances enter the basis, if a part longer than this is left of them (rows of
 * G have length 1).  Among values of one origin, those that the others determine well come first. */
static const struct {
  int first, last;
  double independent;
} initial_pass[] = {
  { INITIAL_FREE, INITIAL_MASS, 1e-7 },      { INITIAL_SPECIFIED, INITIAL_ZERO, 1e-2 },
  { INITIAL_SPECIFIED, INITIAL_ZERO, 1e-7 }, { INITIAL_GIVEN, INITIAL_KEPT - 1, 1e-2 },
  { INITIAL_GIVEN, INITIAL_KEPT - 1, 1e-7 }, { INITIAL_KEPT, INITIAL_KEPT, 1e-7 },
};

/* Sets x->basis to 1 for a maximal set of coordinates that the equations determine, given the others, at the J last
 * evaluated.  The least important ones enter it first, so that the others are those of most importance that can be
 * prescribed together.  (Oxley 2011, Matroid Theory, section 1.8: the greedy algorithm; section 2.1: duals.) */
static int initial_select (initial_search *x) {
  const int n = x->s->coords;
  const size_t rows = (size_t)x->rows;
  initial_factors f = { 0 };
  char *memory;
  int status = PW_OK;
  memory = PW_ALLOC_ARRAYS (PW_ARRAY (f.column, rows), PW_ARRAY (f.norm, rows), PW_ARRAY (f.first, rows + 1),
                            PW_ARRAY (f.pivot_of, rows), PW_ARRAY (f.pivot_row, rows));
  if (memory == NULL) return PW_RESOURCE;
  for (int j = 0; j < n; j++) x->weight[j] = 1, x->basis[j] = 0;
  initial_fill (x, 0);
  for (int j = 0; j < n; j++)
    for (int64_t p = x->map.colptr[j]; p < x->map.colptr[j + 1]; p++)
      if (x->map.rowind[p] >= n) f.norm[x->map.rowind[p] - n] += pow (x->map.value[p] / pw_length_factor (x->s, j), 2);
  for (int i = 0; i < x->rows; i++) f.norm[i] = f.norm[i] > 0 ? sqrt (f.norm[i]) : 1, f.pivot_of[i] = -1;
  for (size_t i = 0; i < sizeof initial_pass / sizeof *initial_pass; i++)
    for (int importance = initial_pass[i].first; importance <= initial_pass[i].last; importance++)
      for (int m = n - 1; m >= 0 && f.rank < x->rows && status >= 0; m--) {
        const int j = initial_order (x, m);
        if (x->importance[j] != importance || x->basis[j]) continue;
        status = initial_enter (x, &f, j, initial_pass[i].independent);
        x->basis[j] = status > 0;
      }
  free (f.entry);
  free (memory);
  return status < 0 ? PW_RESOURCE : PW_OK;
}

/* Prescribes list[first] .. list[end - 1] and what is kept already.  PW_RETRY, with nothing changed, if that is
 * impossible or changes other candidates too much. */
static int initial_try (initial_search *x, int first, int end) {
  const size_t bytes = (size_t)x->s->coords * sizeof (double);
  memcpy (x->best, x->value, bytes);
  for (int i = first; i < end; i++) x->importance[x->list[i]] = INITIAL_KEPT;
  x->attempts++;
  const double part = x->share < INITIAL_SMALL_SHARE ? 1 : end - first > 1 ? INITIAL_PART_OF_MANY : INITIAL_PART;
  int status =
      x->level == INITIAL_VELOCITIES ? initial_prescribe_velocities (x, INITIAL_KEPT) : initial_reach (x, part);
  if (status == PW_OK && x->level == INITIAL_POSITIONS &&
      !(initial_changes (x).candidate <= fmax (INITIAL_AMPLIFIED * x->least, INITIAL_CHANGE)))
    status = PW_RETRY;
  if (status != PW_RETRY) return status;
  memcpy (x->value, x->best, bytes);
  for (int i = first; i < end; i++) x->importance[x->list[i]] = x->described[x->list[i]];
  return PW_RETRY;
}

/* Keeps as many of the values list[0] .. list[count - 1] as possible, the first ones first; the others become free.
 * All are tried at once, then few, and twice as many after each success.  Returns the number of the others, or an
 * error. */
static int initial_keep_list (initial_search *x, int count) {
  int released = 0, status = PW_OK, first = 0;
  for (int size = count; first < count && status >= 0;) {
    if (size > count - first) size = count - first;
    status = x->attempts < x->most_attempts ? initial_try (x, first, first + size) : PW_RETRY;
    if (status == PW_OK) {
      first += size, size *= 2;
    } else if (status == PW_RETRY && size > 1 && x->attempts < x->most_attempts) {
      size = first == 0 && size == count ? 1 : size / 2;
    } else if (status == PW_RETRY) {
      x->importance[x->list[first++]] = INITIAL_FREE;
      released++;
    }
  }
  return status < 0 ? status : released;
}

/* Lists candidates that differ from their values by round-off alone. */
static int initial_list_round (initial_search *x) {
  int count = 0, differ = 0;
  for (int j = 0; j < x->s->coords; j++) {
    const double change = fabs (x->value[j] - x->given[j]),
                 rate = x->level == INITIAL_VELOCITIES ? x->r->w->scale.time : 1;
    if (x->described[j] < INITIAL_SPECIFIED || x->importance[j] == INITIAL_KEPT) continue;
    if (!(change <= INITIAL_ROUND * (fabs (x->given[j]) + pw_unit (x->s, j) / rate))) continue;
    x->list[count++] = j, differ |= change > 0;
  }
  return differ ? count : 0;
}

/* Keeps as many candidates as possible, from the least change of all. */
static int initial_keep (initial_search *x) {
  int released = 1, status = PW_OK, mass = 0;
  while (released > 0 && x->attempts < x->most_attempts) {
    if (x->level == INITIAL_POSITIONS && pw_evaluate_J_at (x->r->w, x->r->t, x->r->q, x->r->v) != PW_OK)
      return PW_METHOD;
    if (initial_select (x) != PW_OK) return PW_RESOURCE;
    int count = 0; /* candidates that can be prescribed with those kept, the most important ones first */
    for (int importance = INITIAL_KEPT - 1; importance >= INITIAL_SPECIFIED; importance--)
      for (int m = 0; m < x->s->coords; m++) {
        const int j = initial_order (x, m);
        if (x->importance[j] == importance && !x->basis[j]) x->list[count++] = j;
      }
    released = initial_keep_list (x, count);
    if (released < 0) return released;
  }
  for (int j = 0; j < x->s->coords; j++)
    if (x->importance[j] == INITIAL_MASS) x->list[mass++] = j;
  if (mass > 0) status = initial_try (x, 0, mass);
  if (status >= 0) status = initial_keep_list (x, initial_list_round (x));
  return status < 0 ? status : PW_OK;
}

/* origin: of all positions and velocities, or NULL. */
static void initial_rank (initial_search *x, const unsigned char *origin) {
  const pw_system *s = x->s;
  const int is_position = x->level == INITIAL_POSITIONS;
  int massless = 0, massless_free = 0;
  x->origin = origin == NULL ? NULL : is_position ? origin : origin + s->coords;
  for (int j = 0; j < s->coords; j++) {
    const int from = x->origin ? x->origin[j] : 0, nonzero = x->given[j] != 0;
    x->importance[j] = (unsigned char)(from & PW_GIVEN       ? INITIAL_GIVEN + nonzero
                                       : from & PW_SPECIFIED ? INITIAL_SPECIFIED + nonzero
                                                             : INITIAL_FREE);
    massless |= s->mass[j] == 0 && x->importance[j] < INITIAL_GIVEN;
    massless_free |= s->mass[j] == 0 && x->importance[j] == INITIAL_FREE;
  }
  for (int j = 0; j < s->coords && is_position; j++) {
    if (x->importance[j] != INITIAL_FREE || s->mass[j] == 0) continue;
    const int zero = x->origin && x->origin[j] & PW_ZERO_POSITION;
    if (zero ? massless : massless_free) x->importance[j] = zero ? INITIAL_ZERO : INITIAL_MASS;
  }
  memcpy (x->described, x->importance, (size_t)s->coords);
}

/* Opens the search for the equations of a level, at the J last evaluated.  PW_OK or PW_RESOURCE. */
static int initial_open (initial_search *x, pw_run *r, initial_level level, const unsigned char *origin) {
  const pw_system *s = r->s;
  const size_t n = (size_t)s->coords, rows = (size_t)s->rows;
  *x = (initial_search){ .r = r, .s = s, .level = level, .failed_row = -1 };
  x->share = fmin (1, (double)INITIAL_SMALL / s->coords);
  x->most_attempts = (int)fmax (8, INITIAL_ATTEMPTS * x->share);
  x->rows = level == INITIAL_VELOCITIES ? s->rows : s->holonomic;
  x->value = level == INITIAL_VELOCITIES ? r->v : r->q;
  x->given = level == INITIAL_VELOCITIES ? r->v_given : r->q_given;
  x->memory = PW_ALLOC_ARRAYS (PW_ARRAY (x->weight, n), PW_ARRAY (x->target, n), PW_ARRAY (x->from, n),
                               PW_ARRAY (x->last, n), PW_ARRAY (x->nearest, n), PW_ARRAY (x->best, n),
                               PW_ARRAY (x->step, n + rows), PW_ARRAY (x->residual, rows), PW_ARRAY (x->unit, rows),
                               PW_ARRAY (x->diagonal, rows), PW_ARRAY (x->list, n), PW_ARRAY (x->importance, n),
                               PW_ARRAY (x->described, n), PW_ARRAY (x->basis, n), PW_ARRAY (x->unused, n));
  if (x->memory == NULL) return PW_RESOURCE;
  initial_rank (x, origin);
  pw_scatter_begin_record (&x->map);
  initial_fill (x, 0);
  if (pw_scatter_lay_out (&x->map, s->coords + x->rows) != PW_OK) return PW_RESOURCE;
  for (int j = 0; j < s->coords; j++) x->unused[j] = x->map.colptr[j + 1] - x->map.colptr[j] == 1;
  return pw_sparse_open (&x->matrix, PW_SPARSE_REAL, s->coords + x->rows, x->map.colptr, x->map.rowind);
}

/* The largest change of a velocity, and the largest one described [units of L and rad, per s]. */
static double initial_velocity_change (const initial_search *x, double *described) {
  double change = *described = 0;
  for (int j = 0; j < x->s->coords; j++) {
    change = fmax (change, fabs (x->value[j] - x->given[j]) / pw_unit (x->s, j));
    *described = fmax (*described, fabs (x->given[j]) / pw_unit (x->s, j));
  }
  return change;
}

/* Finds consistent values, by the least change of all where not all candidates can be kept; keeps what it can. */
static int initial_find (initial_search *x) {
  const size_t bytes = (size_t)x->s->coords * sizeof (double);
  double described;
  int status;
  if (x->level == INITIAL_POSITIONS) {
    status = initial_search_positions (x);
    return status == PW_OK && initial_changes (x).candidate > 0 ? initial_keep (x) : status;
  }
  status = initial_prescribe_velocities (x, INITIAL_SPECIFIED);
  const double change = status == PW_OK ? initial_velocity_change (x, &described) : INFINITY;
  if (status < 0 || (status == PW_OK && change <= described)) return status;
  memcpy (x->last, x->value, bytes);
  initial_stage_weights (x, &initial_least_change);
  const int least = initial_project_velocities (x);
  if (status == PW_OK && !(least == PW_OK && change > INITIAL_DEPENDENT * initial_velocity_change (x, &described))) {
    memcpy (x->value, x->last, bytes);
    return PW_OK;
  }
  x->least = initial_changes (x).candidate;
  return least == PW_OK ? initial_keep (x) : least;
}

/* Writes the elements whose equations for velocities contradict each other: those that the least squares of all leave
 * violated, since a combination of these equations has no velocity in it.  0 if there is none. */
static int initial_contradiction (initial_search *x, char *text, size_t size) {
  const pw_system *s = x->s;
  double *Jv = x->r->scratch + s->rows, most = 0;
  unsigned char *violated = (unsigned char *)x->r->scratch;
  memset (x->importance, INITIAL_FREE, (size_t)s->coords);
  initial_stage_weights (x, &initial_least_change);
  initial_units (x);
  initial_velocity_residual (x, x->given);
  if (initial_solve (x, INITIAL_LEAST_SQUARES, NULL) != PW_OK) return 0;
  pw_mul_J (x->r->w, x->step, Jv);
  for (int i = 0; i < s->rows; i++) {
    x->residual[i] = initial_is_free (x, i) ? 0 : fabs (x->residual[i] + Jv[i]) / x->unit[i];
    most = fmax (most, x->residual[i]);
  }
  for (int i = 0; i < s->rows; i++) violated[i] = x->residual[i] > 1e-3 * most;
  pw_list_elements (s, violated, 1, text, size);
  return *text != 0;
}

static const char *initial_unit (const pw_system *s, int row) {
  return strcmp (pw_system_reaction_unit (s, row), "N m") == 0 ? "rad" : "m";
}

static int initial_fail (initial_search *x, pw_error *error) {
  const pw_system *s = x->s;
  char elements[300];
  if (x->out_of_memory) return pw_fail_memory (s, error);
  if (x->level == INITIAL_VELOCITIES && initial_contradiction (x, elements, sizeof elements))
    return pw_fail (error, PW_INITIAL, "model %s: no velocities satisfy the constraints: %s contradict%s", s->model,
                    elements, strchr (elements, ',') ? " each other" : "s itself");
  if (x->failed_row < 0)
    return pw_fail (error, PW_INITIAL, "model %s: the initial state cannot be made consistent", s->model);
  return pw_fail (
      error, PW_INITIAL,
      "model %s: the initial state cannot be made consistent: %s is open by %.6g %s; if it can close, begin "
      "nearer to where it does",
      s->model, PW_NAME (pw_system_row_name, s, x->failed_row), x->failed_by, initial_unit (s, x->failed_row));
}

static int initial_level_consistent (pw_run *r, initial_level level, const unsigned char *origin, pw_error *error) {
  initial_search x;
  if (r->inconsistent) return PW_OK;
  int status = initial_open (&x, r, level, origin);
  if (status == PW_OK) status = initial_find (&x);
  if (status == PW_RETRY && initial_is_stopped (&x)) status = PW_STOPPED;
  if (status == PW_RETRY || x.out_of_memory) status = initial_fail (&x, error);
  if (status == PW_RESOURCE) status = pw_fail_memory (r->s, error);
  pw_sparse_close (&x.matrix);
  pw_scatter_close (&x.map);
  free (x.memory);
  return status;
}

int pw_initial_moved (const pw_system *s, const pw_initial_report *report, int state) {
  int is_velocity = state >= s->coords, j = is_velocity ? state - s->coords : state;
  double unit = pw_unit (s, j) / (is_velocity ? report->time : 1);
  double from = is_velocity ? report->v_given[j] : report->q_given[j], to = is_velocity ? report->v[j] : report->q[j];
  if (fabs (to - from) <= 16 * DBL_EPSILON * (fabs (to) + unit)) return 0;
  if (is_velocity && report->speed > 0) unit = report->speed / pw_length_factor (s, j);
  return fabs (to - from) < INITIAL_ROUNDED * unit ? 1 : 2;
}

void pw_run_count_moved (pw_run *r) {
  pw_initial_report *report = &r->initial;
  report->moved = report->changed = report->rounded = 0;
  report->q = r->q, report->v = r->v; /* a method that has been reopened since had lent them */
  report->time = r->w->scale.time;
  report->speed = 0;
  for (int j = 0; j < r->s->coords; j++)
    report->speed = fmax (report->speed, fabs (report->v_given[j]) * pw_length_factor (r->s, j));
  for (int j = 0; j < 2 * r->s->coords; j++) {
    const int moved = pw_initial_moved (r->s, report, j), origin = r->origin[j] & (PW_GIVEN | PW_SPECIFIED);
    report->moved += moved > 0;
    report->changed += moved > 0 && origin == PW_SPECIFIED;
    report->rounded += moved == 1 && origin != 0;
  }
}

char *pw_run_initial_reason (pw_run *r, int state, char *buffer, size_t size) {
  const pw_system *s = r->s;
  const int is_velocity = state >= s->coords, j = is_velocity ? state - s->coords : state;
  double *value = is_velocity ? r->v + j : r->q + j, kept = *value, *Jv = r->scratch, *eta = Jv + s->rows;
  pw_residuals now = { .row_position = -1, .row_velocity = -1 };
  *buffer = 0;
  *value = is_velocity ? r->v_given[j] : r->q_given[j];
  if (pw_evaluate_J_at (r->w, r->t, r->q, r->v) == PW_OK) {
    pw_evaluate_residuals (r->w, r->enforced, &now);
    if (is_velocity) {
      pw_mul_J (r->w, r->v, Jv);
      pw_evaluate_eta (r->w, eta);
    } else {
      pw_evaluate_g (r->w, Jv);
      memset (eta, 0, (size_t)s->rows * sizeof *eta);
    }
    const int row = is_velocity ? now.row_velocity : now.row_position;
    const double by = row < 0 ? 0 : fabs (Jv[row] - eta[row]);
    if (by > 0 && (is_velocity ? now.velocity : now.position) > PW_RESIDUAL_ACCEPTED)
      snprintf (buffer, size, "%s would be %s by %.3g %s%s", PW_NAME (pw_system_row_name, s, row),
                is_velocity || pw_is_limited (s, row) ? "violated" : "open", by, initial_unit (s, row),
                is_velocity ? "/s" : "");
  }
  *value = kept;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  return buffer;
}

int pw_initial_specified (const pw_initial_report *report, int state) {
  return (report->origin[state] & (PW_GIVEN | PW_SPECIFIED)) != 0;
}

int pw_initial_given (const pw_initial_report *report, int state) {
  return (report->origin[state] & PW_GIVEN) != 0;
}

/* Fails if less than 1e-10 of the given velocities is left, in the norm of the metric, and nonholonomic equations are
 * among those that they violate.  Velocities given as 0 alone ask for rest. */
static int initial_locked (pw_run *r, const unsigned char *origin, pw_error *error) {
  const pw_system *s = r->s;
  double given = 0, left = 0, speed = 0, *Jv = r->scratch, *eta = Jv + s->rows;
  unsigned char *violated = (unsigned char *)(eta + s->rows);
  char elements[300];
  int rest = 0, motion = 0, last = 0;
  for (int j = 0; j < s->coords; j++) {
    if (origin[s->coords + j] & PW_GIVEN) *(r->v_given[j] == 0 ? &rest : &motion) = 1;
    given += s->metric[j] * r->v_given[j] * r->v_given[j];
    left += s->metric[j] * r->v[j] * r->v[j];
    speed = fmax (speed, fabs (r->v_given[j]) * pw_length_factor (s, j));
  }
  if (s->rows == s->holonomic || given == 0 || left > 1e-20 * given || rest > motion) return PW_OK;
  pw_mul_J (r->w, r->v_given, Jv);
  pw_evaluate_eta (r->w, eta);
  for (int i = 0; i < s->rows; i++) {
    violated[i] = i >= s->holonomic && !(r->enforced && !r->enforced[i]) && !(fabs (Jv[i] - eta[i]) <= 1e-10 * speed);
    if (violated[i]) last = i;
  }
  pw_list_elements (s, violated, 1, elements, sizeof elements);
  if (*elements == 0) return PW_OK;
  return pw_fail (error, PW_INITIAL,
                  "model %s: the given velocities would have to be removed entirely: %s allow%s no such motion%s",
                  s->model, elements, strchr (elements, ',') ? "" : "s",
                  strchr (elements, ',') ? pw_advice_on_wheel (s, last) : "");
}

int pw_run_make_consistent (pw_run *r, const unsigned char *origin, pw_error *error) {
  const pw_system *s = r->s;
  const size_t bytes = (size_t)s->coords * sizeof (double);
  pw_residuals before, now;
  memcpy (r->q_given, r->q, bytes);
  memcpy (r->v_given, r->v, bytes);
  int status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  if (status != PW_OK) return pw_fail_signal (r->t, error);
  pw_evaluate_residuals (r->w, r->enforced, &before);
  if (!(before.position <= 2 * PW_RESIDUAL_CONVERGED)) {
    status = initial_level_consistent (r, INITIAL_POSITIONS, origin, error);
    if (status == PW_OK) status = pw_evaluate_J_at (r->w, r->t, r->q, r->v);
  }
  pw_evaluate_residuals (r->w, r->enforced, &now);
  if (status == PW_OK && !(now.velocity <= 2 * PW_RESIDUAL_CONVERGED))
    status = initial_level_consistent (r, INITIAL_VELOCITIES, origin, error);
  r->initial = (pw_initial_report){ .q_given = r->q_given,
                                    .v_given = r->v_given,
                                    .q = r->q,
                                    .v = r->v,
                                    .origin = r->origin,
                                    .position = before.position,
                                    .velocity = before.velocity,
                                    .time = r->w->scale.time };
  for (int j = 0; j < 2 * s->coords && origin && status == PW_OK; j++)
    r->initial.released |= origin[j] & PW_GIVEN && pw_initial_moved (s, &r->initial, j);
  if (status == PW_OK && origin)
    status = initial_locked (r, origin, error); /* wheels may absorb the impulse of a restart */
  return status == PW_METHOD ? pw_fail_signal (r->t, error) : status;
}
