/* Newton's method by least squares, pseudo-arclength steps along a branch, and the location of events; see
 * continuation.h. */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "continuation.h"
#include "util.h"

enum {
  NEWTON_MOST = 60,     /* iterations of a solution */
  NEWTON_BRANCH = 8,    /* of a point of a branch: a shorter step is the better remedy */
  NEWTON_HALVINGS = 10, /* of a correction */
  NEWTON_SLOW = 4       /* an iteration that divides |F| by less has reached round-off, below the tolerance */
};
static const double NEWTON_EXACT = 1e-4, /* |F| relative to the tolerance that needs no further iteration */
    NEWTON_DAMPING = 0.1,                /* factor of |F| in the square of the damping */
    /* Of p.  The error is 2e-11 of the third derivative, and that of F divided by this: 1e-11 for round-off. */
    NEWTON_DIFFERENCE = 1e-5;

/* The largest |F_i|; NaN if one is NaN. */
static double newton_residual (const pw_branch *b) {
  double most = 0;
  for (int i = 0; i < b->problem.equations; i++)
    if (fabs (b->F[i]) > most || isnan (b->F[i])) most = fabs (b->F[i]);
  return most;
}

static double newton_norm (int n, const double *x) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * x[i];
  return sqrt (sum);
}

/* Evaluates F and, unless J is NULL, its derivatives with respect to x. */
static int newton_evaluate (pw_branch *b, const double *u, double *J, pw_error *error) {
  size_t m = (size_t)b->problem.equations;
  memset (b->F, 0, m * sizeof *b->F);
  if (J) memset (J, 0, m * (size_t)b->problem.unknowns * sizeof *J);
  return b->problem.evaluate (b->problem.context, u, b->F, J, error);
}

/* Evaluates F and all derivatives: those by p by central differences, at the end of its domain by one-sided
 * ones.  The evaluation at u is the last one. */
static int newton_linearise (pw_branch *b, const double *u, pw_error *error) {
  int m = b->problem.equations, p = b->problem.unknowns, sum = 0, count = 0;
  double *by_p = b->J + m * p;
  memset (by_p, 0, (size_t)m * sizeof *by_p);
  memcpy (b->trial, u, b->bytes);
  for (int side = -1; side <= 1; side += 2) {
    b->trial[p] = u[p] + side * NEWTON_DIFFERENCE;
    int status = newton_evaluate (b, b->trial, NULL, error);
    if (status != PW_OK && status != PW_RETRY) return status;
    if (status != PW_OK) continue;
    for (int i = 0; i < m; i++) by_p[i] += side * b->F[i];
    sum += side, count++;
  }
  if (count == 0) return PW_RETRY;
  int status = newton_evaluate (b, u, b->J, error);
  for (int i = 0; i < m; i++) by_p[i] = (by_p[i] - sum * b->F[i]) / (count * NEWTON_DIFFERENCE);
  return status;
}

/* du = the shortest least-squares solution of J du = right and c . du = value.  If c is NULL, p is constant, and
 * damping^2 |du|^2 is added to the sum of squares.  J is destroyed. */
static int newton_least_squares (pw_branch *b, const double *right, const double *c, double value, double damping) {
  int m = b->problem.equations, n = b->problem.unknowns + (c != NULL), extra = c ? 1 : damping > 0 ? n : 0;
  int rows = m + extra, large = rows > n ? rows : n, rank;
  for (int j = n; extra && j-- > 0;) { /* J gets the row c, or rows with the damping on their diagonal */
    double *column = b->J + j * rows;
    memmove (column, b->J + j * m, (size_t)m * sizeof *column);
    memset (column + m, 0, (size_t)extra * sizeof *column);
    column[m + (c ? 0 : j)] = c ? c[j] : damping;
  }
  for (int i = 0; i < large; i++) b->du[i] = i < m ? right[i] : 0;
  if (c) b->du[m] = value;
  for (int i = 0; i < rows * n; i++)
    if (!isfinite (b->J[i])) return PW_RETRY;
  memset (b->pivot, 0, (size_t)n * sizeof *b->pivot);
  if (LAPACKE_dgelsy_work (LAPACK_COL_MAJOR, rows, n, 1, b->J, rows, b->du, large, b->pivot, b->problem.rank_tolerance,
                           &rank, b->work, b->work_size))
    return PW_RETRY;
  if (!c) b->du[n] = 0;
  return PW_OK;
}

/* Moves u along du by the largest of the factors 1, 1/2, ... with which |F| decreases by at least a tenth of what the
 * linear equations predict. */
static int newton_descend (pw_branch *b, double *u, pw_error *error) {
  int n = b->problem.unknowns + 1;
  double before = newton_norm (b->problem.equations, b->F), factor = 1;
  for (int i = 0; i < NEWTON_HALVINGS; i++, factor /= 2) {
    for (int j = 0; j < n; j++) b->trial[j] = u[j] + factor * b->du[j];
    int status = newton_evaluate (b, b->trial, NULL, error);
    if (status != PW_OK && status != PW_RETRY) return status;
    if (status != PW_OK || !(newton_norm (b->problem.equations, b->F) < before * (1 - factor / 10))) continue;
    memcpy (u, b->trial, b->bytes);
    return PW_OK;
  }
  return PW_RETRY;
}

/* Newton's method at constant c . u, or if c is NULL at constant p, then with the Levenberg-Marquardt parameter
 * damping min (|F|, 1), which leads to the nearest of solutions that are not isolated (Yamashita & Fukushima 2001). */
static int newton_iterate (pw_branch *b, double *u, const double *c, double damping, pw_error *error) {
  int n = b->problem.unknowns + 1, status;
  double before = b->residual = INFINITY;
  for (b->iterations = 0;; b->iterations++) {
    status = c ? newton_linearise (b, u, error) : newton_evaluate (b, u, b->J, error);
    if (status != PW_OK) return status;
    b->residual = newton_residual (b);
    int slow = b->residual > before / NEWTON_SLOW;
    if (b->residual <= b->problem.tolerance && (slow || b->residual <= b->problem.tolerance * NEWTON_EXACT))
      return PW_OK;
    if (b->iterations >= (c ? NEWTON_BRANCH : NEWTON_MOST) || !isfinite (b->residual)) return PW_RETRY;
    before = b->residual;
    for (int i = 0; i < b->problem.equations; i++) b->F[i] = -b->F[i];
    status = newton_least_squares (b, b->F, c, 0, sqrt (damping * fmin (b->residual, 1)));
    if (status != PW_OK) return status;
    if (!c && b->residual > b->problem.tolerance)
      status = newton_descend (b, u, error);
    else
      for (int j = 0; j < n; j++) u[j] += b->du[j];
    if (status != PW_OK) return status;
  }
}

int pw_branch_solve (pw_branch *b, double *u, pw_error *error) {
  memcpy (b->next.u, u, b->bytes);
  int status = newton_iterate (b, u, NULL, NEWTON_DAMPING, error);
  if (status != PW_RETRY) return status;
  memcpy (u, b->next.u, b->bytes);
  return newton_iterate (b, u, NULL, 0, error);
}

/* The unit tangent t at u with c . t > 0.  PW_RETRY if c is orthogonal to the branch. */
static int newton_tangent (pw_branch *b, const double *u, const double *c, double *tangent, pw_error *error) {
  int n = b->problem.unknowns + 1;
  double dot = 0;
  int status = newton_linearise (b, u, error);
  if (status != PW_OK) return status;
  b->residual = newton_residual (b);
  memset (b->F, 0, (size_t)b->problem.equations * sizeof *b->F);
  status = newton_least_squares (b, b->F, c, 1, 0);
  if (status != PW_OK) return status;
  double norm = newton_norm (n, b->du);
  for (int j = 0; j < n; j++) tangent[j] = b->du[j] / norm, dot += b->du[j] * c[j];
  return isfinite (norm) && norm > 0 && fabs (dot - 1) < 1e-3 ? PW_OK : PW_RETRY;
}

enum { LOCATE_MOST = 60 };               /* iterations that locate an event */
static const double BRANCH_STEEP = 1e-3, /* smallest slope of p along a branch that limits steps by max_change */
    BRANCH_GROW = 1.5,                   /* factor of the next step, if half of NEWTON_BRANCH iterations were enough */
    BRANCH_TURN = 0.96,   /* cosine of the largest angle between the tangents of successive points, 16 degrees */
    BRANCH_APART = 0.3,   /* largest correction of a predictor, relative to the step */
    BRANCH_ASIDE = 0.002, /* largest correction of an interpolated point, relative to the distance of the two points */
    BRANCH_FOLD = 1e-3,   /* largest distance of a fold from the change of a mode there, relative to the step */
    BRANCH_FINE = 1e-3, /* relative to max_change: so short a step may pass p of the first point twice beside a fold */
    /* Largest difference of the unit vectors along a chord and along the sum of the tangents at its ends: on a smooth
     * branch it is of second order in the step, from one branch to another it is not. */
    BRANCH_BENT = 0.02;

int pw_branch_open (pw_branch *b, const pw_branch_problem *problem, pw_error *error) {
  size_t n = (size_t)problem->unknowns + 1, m = (size_t)problem->equations + n, large = n > m ? n : m;
  *b = (pw_branch){ .problem = *problem, .bytes = n * sizeof (double), .ended = 1 };
  b->work_size = (int)(42 * large + 200); /* dgelsy needs 35 large + 32, with blocks of 32 */
  if (!(b->problem.rank_tolerance > 0)) b->problem.rank_tolerance = 1e-9;
  pw_branch_point *const point[] = {
    &b->reached, &b->previous, &b->found, &b->first, &b->next, &b->side[0], &b->side[1]
  };
  const size_t own = sizeof point / sizeof *point, points = own + PW_BRANCH_QUEUE;
  double *numbers; /* of all points */
  b->memory = PW_ALLOC_ARRAYS (PW_ARRAY (b->F, large), PW_ARRAY (b->J, m * n), PW_ARRAY (b->du, large),
                               PW_ARRAY (b->work, b->work_size), PW_ARRAY (b->trial, n), PW_ARRAY (b->condition, n),
                               PW_ARRAY (b->predicted, n), PW_ARRAY (b->pivot, n), PW_ARRAY (numbers, 2 * points * n));
  for (size_t i = 0; b->memory && i < points; i++, numbers += 2 * n) {
    pw_branch_point *p = i < own ? point[i] : &b->queue[i - own].point;
    p->u = numbers, p->tangent = numbers + n;
  }
  return b->memory ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
}

void pw_branch_close (pw_branch *b) {
  free (b->memory);
}

static void branch_copy (const pw_branch *b, const pw_branch_point *from, pw_branch_point *to) {
  memcpy (to->u, from->u, b->bytes);
  memcpy (to->tangent, from->tangent, b->bytes);
  to->residual = from->residual, to->interpolated = from->interpolated;
}

/* Queues a point before those that are farther along. */
static void branch_insert (pw_branch *b, const pw_branch_point *point, int event, double fraction, int unstable) {
  int i = b->queued++;
  for (; i > 0 && b->queue[i - 1].fraction > fraction; i--) {
    pw_branch_event last = b->queue[i];
    b->queue[i] = b->queue[i - 1];
    b->queue[i - 1] = last;
  }
  b->queue[i].event = event, b->queue[i].fraction = fraction, b->queue[i].unstable = unstable;
  branch_copy (b, point, &b->queue[i].point);
}

void pw_branch_end (pw_branch *b) {
  b->folded = b->steps = b->queued = b->returned = 0;
  b->ended = 1;
}

int pw_branch_start (pw_branch *b, const double *u, double direction, pw_error *error) {
  size_t n = (size_t)b->problem.unknowns + 1;
  memset (b->condition, 0, b->bytes);
  b->condition[n - 1] = direction > 0 ? 1 : -1;
  pw_branch_end (b);
  memmove (b->reached.u, u, b->bytes);
  int status = newton_tangent (b, b->reached.u, b->condition, b->reached.tangent, error);
  if (status != PW_OK) return status;
  b->reached.residual = b->residual, b->reached.interpolated = 0;
  b->ended = b->reached.tangent[n - 1] > 0 ? u[n - 1] >= 1 : u[n - 1] <= 0;
  branch_copy (b, &b->reached, &b->first);
  branch_insert (b, &b->reached, PW_BRANCH_POINT, 0, 0);
  return PW_OK;
}

static double branch_distance (const pw_branch *b, const double *x, const double *y) {
  double sum = 0;
  for (int j = 0; j <= b->problem.unknowns; j++) sum += pow (x[j] - y[j], 2);
  return sqrt (sum);
}

/* Corrects to->u on the plane perpendicular to a tangent, or if that is NULL at constant p; then sets to->tangent.
 * PW_RETRY if the correction is longer than `farthest`. */
static int branch_correct (pw_branch *b, const double *tangent, double farthest, pw_branch_point *to, pw_error *error) {
  memcpy (b->condition, tangent ? tangent : b->reached.tangent, b->bytes);
  memcpy (b->predicted, to->u, b->bytes);
  int status = newton_iterate (b, to->u, tangent ? b->condition : NULL, 0, error);
  if (status != PW_OK) return status;
  if (branch_distance (b, to->u, b->predicted) > farthest) return PW_RETRY;
  to->residual = b->residual, to->interpolated = 0;
  return newton_tangent (b, to->u, b->condition, to->tangent, error);
}

/* Whether two points are on one smooth branch: their tangents differ little, and the chord between them has the
 * direction of the sum of these.  Around a fold p changes as its slopes at both predict, by their mean: p of solutions
 * that scatter at a cusp does not.  A solution is accurate to about NEWTON_EXACT times the tolerance. */
static int branch_smooth (const pw_branch *b, const pw_branch_point *from, const pw_branch_point *to) {
  double chord = branch_distance (b, to->u, from->u), dot = 0, off = 0;
  for (int j = 0; j <= b->problem.unknowns; j++) dot += from->tangent[j] * to->tangent[j];
  for (int j = 0; j <= b->problem.unknowns; j++)
    off += pow ((to->u[j] - from->u[j]) / chord - (to->tangent[j] + from->tangent[j]) / sqrt (2 + 2 * dot), 2);
  const int p = b->problem.unknowns;
  double slope = from->tangent[p], end = to->tangent[p], change = (to->u[p] - from->u[p]) / chord;
  double error = BRANCH_BENT * (fabs (slope) + fabs (end)) / 2 + NEWTON_EXACT * b->problem.tolerance / chord;
  int is_parabolic = slope * end >= 0 || fabs (change - (slope + end) / 2) <= error;
  return dot >= BRANCH_TURN && sqrt (off) <= BRANCH_BENT && is_parabolic;
}

/* Whether the step to b->next passes an end of the range, or p of the first point, perhaps twice beside a fold.  A
 * shorter one comes so near that branch_step_to_end ends there. */
static int branch_passes_end (const pw_branch *b) {
  int n = b->problem.unknowns;
  double from = b->reached.u[n] - b->first.u[n], to = b->next.u[n] - b->first.u[n], slope = b->reached.tangent[n];
  int folded = slope * b->next.tangent[n] < 0 && b->step > BRANCH_FINE * b->max_change;
  if (!(b->next.u[n] >= 0 && b->next.u[n] <= 1)) return 1;
  if (from == 0) return folded && slope * to < 0;
  return from * to < 0 || (folded && from * (from + b->step * slope) < 0);
}

/* PW_RETRY if the step to b->next may not be made. */
static int branch_check (pw_branch *b, pw_error *error) {
  if (!branch_smooth (b, &b->reached, &b->next)) return PW_RETRY;
  return b->problem.check_step ? b->problem.check_step (b->problem.context, b->reached.u, b->next.u, error) : PW_OK;
}

static int branch_try (pw_branch *b, pw_error *error) {
  for (int j = 0; j <= b->problem.unknowns; j++) b->next.u[j] = b->reached.u[j] + b->step * b->reached.tangent[j];
  int status = branch_correct (b, b->reached.tangent, BRANCH_APART * b->step, &b->next, error);
  if (status != PW_OK) return status;
  return b->bounded && branch_passes_end (b) ? PW_RETRY : branch_check (b, error);
}

static void branch_accept (pw_branch *b) {
  int n = b->problem.unknowns;
  pw_branch_point oldest = b->previous;
  b->previous = b->reached;
  b->reached = b->next;
  b->next = oldest;
  b->folded = b->previous.tangent[n] * b->reached.tangent[n] < 0;
}

static double branch_longest_step (const pw_branch *b) {
  return b->max_change / fmax (fabs (b->reached.tangent[b->problem.unknowns]), BRANCH_STEEP);
}

/* Moves to the end of the range, or to p of the first point, if the next step would reach it: without steps
 * beyond the end, where the parameter may not be admissible.  PW_RETRY if it would not, or no point is found there. */
static int branch_step_to_end (pw_branch *b, pw_error *error) {
  int n = b->problem.unknowns;
  double slope = b->reached.tangent[n], p = b->reached.u[n], first = b->first.u[n];
  double end = (first - p) * slope > 0 ? first : slope > 0, step = (end - p) / slope;
  if (!(step > 0 && step <= fmin (b->step, branch_longest_step (b)))) return PW_RETRY;
  for (int j = 0; j < n; j++) b->next.u[j] = b->reached.u[j] + step * b->reached.tangent[j];
  b->next.u[n] = end;
  int status = branch_correct (b, NULL, BRANCH_APART * step, &b->next, error);
  if (status == PW_OK) status = branch_check (b, error);
  if (status != PW_OK) return status;
  branch_accept (b);
  b->ended = end == 0 || end == 1;
  return PW_OK;
}

int pw_branch_step (pw_branch *b, pw_error *error) {
  b->step = fmin (b->step, branch_longest_step (b));
  for (int status; (status = branch_try (b, error)) != PW_OK; b->step /= 2)
    if (status != PW_RETRY || b->step < 2 * b->min_step) return status;
  branch_accept (b);
  if (b->iterations <= NEWTON_BRANCH / 2) b->step *= BRANCH_GROW;
  return PW_OK;
}

/* The point at a fraction s of the way between two points: that of the cubic Hermite interpolation, corrected by
 * Newton's method if this converges nearby. */
static int branch_between (pw_branch *b, const pw_branch_point *from, const pw_branch_point *to, double s,
                           pw_branch_point *point, pw_error *error) {
  double chord = branch_distance (b, to->u, from->u), r = 1 - s;
  for (int j = 0; j <= b->problem.unknowns; j++)
    point->u[j] = r * r * ((1 + 2 * s) * from->u[j] + s * chord * from->tangent[j]) +
                  s * s * ((1 + 2 * r) * to->u[j] - r * chord * to->tangent[j]);
  int status = branch_correct (b, from->tangent, BRANCH_ASIDE * chord, point, error);
  if (status != PW_RETRY) return status;
  memcpy (point->u, b->predicted, b->bytes);
  memcpy (point->tangent, from->tangent, b->bytes);
  point->interpolated = 1;
  status = newton_evaluate (b, point->u, NULL, error);
  point->residual = newton_residual (b);
  return status;
}

/* The Illinois variant of regula falsi (Dowell & Jarratt 1971), every fourth step a bisection.  The bracket s[0], s[1]
 * consists of fractions of the cubic between b->side[0] and b->side[1].  Points to which Newton's method converges
 * become ends of this cubic if the branch is smooth there; `scale` is its length, relative to the step. */
int pw_branch_locate (pw_branch *b, pw_branch_test *test, void *context, pw_error *error) {
  pw_branch_point *point = &b->found;
  double s[2] = { 0, 1 }, f[2], middle, value, scale = 1;
  int status = test (context, &b->previous, &f[0], error), last = -1, failed = 0;
  if (status == PW_OK) status = test (context, &b->reached, &f[1], error);
  if (status != PW_OK) return status;
  branch_copy (b, &b->previous, &b->side[0]);
  branch_copy (b, &b->reached, &b->side[1]);
  branch_copy (b, fabs (f[0]) < fabs (f[1]) ? &b->previous : &b->reached, point);
  for (int i = 0; i < LOCATE_MOST && (s[1] - s[0]) * scale > b->event_accuracy; i++) {
    middle = s[1] - f[1] * (s[1] - s[0]) / (f[1] - f[0]);
    if (i % 4 == 3 || !(middle > s[0] && middle < s[1])) middle = (s[0] + s[1]) / 2;
    if (failed) middle = s[0] + (s[1] - s[0]) * fmod (0.618034 * i, 1); /* equidistributed */
    status = branch_between (b, &b->side[0], &b->side[1], middle, &b->next, error);
    if (status == PW_OK) status = test (context, &b->next, &value, error);
    failed |= status == PW_RETRY;
    if (status == PW_RETRY) continue;
    if (status != PW_OK) return status;
    branch_copy (b, &b->next, point);
    if (value == 0) break;
    int side = (value > 0) == (f[1] > 0);
    if (side == last) f[!side] /= 2;
    s[side] = middle, f[side] = value, last = side;
    if (point->interpolated || !branch_smooth (b, &b->side[0], point) || !branch_smooth (b, point, &b->side[1]))
      continue;
    branch_copy (b, point, &b->side[side]);
    scale *= side ? middle : 1 - middle;
    s[!side] = side ? s[0] / middle : (s[1] - middle) / (1 - middle);
    s[side] = side;
  }
  return PW_OK;
}

/* Where b->found is: pw_branch_event.fraction. */
static double branch_fraction (const pw_branch *b) {
  double part = 0, whole = 0;
  for (int j = 0; j <= b->problem.unknowns; j++) {
    part += (b->found.u[j] - b->previous.u[j]) * b->previous.tangent[j];
    whole += (b->reached.u[j] - b->previous.u[j]) * b->previous.tangent[j];
  }
  return fmin (part / whole, 1);
}

/* Sets the number of other unstable modes at a fold. */
static void branch_set_fold (pw_branch *b, int unstable) {
  for (int i = 0; i < b->queued; i++)
    if (b->queue[i].event == PW_BRANCH_FOLD) b->queue[i].unstable = unstable;
}

/* At a fold, one real mode changes its stability. */
int pw_branch_find_changes (pw_branch *b, int before, int now, pw_branch_locate_mode *locate, pw_error *error) {
  const int least = before < now ? before : now, most = before < now ? now : before;
  const double fold = b->folded ? b->queue[0].fraction : -1; /* -1: none */
  branch_set_fold (b, least);
  if (most - least <= b->folded) return PW_OK;
  for (int mode = least, event, modes; mode < most && b->queued < PW_BRANCH_QUEUE - 1; mode += modes) {
    int status = locate (b->problem.context, mode, now - before, &event, &modes, error);
    if (status != PW_OK) return status;
    if (event != PW_BRANCH_REAL || fabs (branch_fraction (b) - fold) > BRANCH_FOLD)
      branch_insert (b, &b->found, event, branch_fraction (b), mode);
    else
      branch_set_fold (b, mode);
  }
  return PW_OK;
}

/* pw_branch_test for folds. */
static int branch_slope_of_p (void *branch, const pw_branch_point *point, double *value, pw_error *error) {
  const pw_branch *b = branch;
  (void)error;
  *value = point->tangent[b->problem.unknowns];
  return PW_OK;
}

static int branch_closed (const pw_branch *b) {
  if (b->reached.u[b->problem.unknowns] != b->first.u[b->problem.unknowns]) return 0;
  return branch_distance (b, b->reached.u, b->first.u) <= PW_BRANCH_SAME ||
         (b->problem.same && b->problem.same (b->problem.context, b->first.u, b->reached.u));
}

/* A step in the range of p; queues its events and the point reached. */
static int branch_advance (pw_branch *b, pw_branch_find_events *find_events, pw_error *why, pw_error *error) {
  *why = (pw_error){ 0 };
  b->bounded = 1;
  if (b->steps++ > b->max_points)
    return pw_fail (why, PW_METHOD, "the branch has more than %d points", b->max_points), PW_RETRY;
  int status = branch_step_to_end (b, error);
  if (status == PW_RETRY) status = pw_branch_step (b, error);
  if (status == PW_OK && b->folded) {
    status = pw_branch_locate (b, branch_slope_of_p, b, error);
    if (status == PW_OK) branch_insert (b, &b->found, PW_BRANCH_FOLD, branch_fraction (b), 0);
  }
  if (status == PW_RETRY) pw_fail (why, PW_METHOD, "Newton's method fails at the smallest step");
  if (status == PW_OK) status = find_events (b->problem.context, error);
  if (status == PW_RETRY) pw_fail (why, PW_METHOD, "the next point cannot be evaluated");
  if (status != PW_OK) return status;
  *why = (pw_error){ 0 }; /* it may be that of longer steps that were refused */
  branch_insert (b, &b->reached, PW_BRANCH_POINT, 1, 0);
  if (branch_closed (b)) b->ended = 1;
  return PW_OK;
}

int pw_branch_next (pw_branch *b, pw_branch_find_events *find_events, pw_error *why, const pw_branch_event **next,
                    pw_error *error) {
  *next = NULL;
  if (b->steps == 0) *why = (pw_error){ 0 };
  if (b->returned == b->queued && !b->ended) {
    b->queued = b->returned = 0;
    int status = branch_advance (b, find_events, why, error);
    if (status == PW_RETRY) return b->ended = 1, b->queued = 0, PW_OK;
    if (status != PW_OK) return status;
  }
  if (b->returned < b->queued)
    *next = &b->queue[b->returned++];
  else if (b->steps > 0 && branch_closed (b))
    pw_fail (why, PW_METHOD, "it has returned to its first point"); /* unless an error has ended it before */
  return PW_OK;
}
