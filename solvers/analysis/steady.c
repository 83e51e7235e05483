/* The search for steady motions, and their branches.
 *
 * The system has symmetries: displacements of the whole, and of angles on which nothing depends.  S_k (q) is the
 * velocity of a displacement along the k-th one at unit rate.  A steady motion has the velocities v = xi_1 S_1 (q) +
 * xi_2 S_2 (q) + ... with constant xi.  In the frame that moves with it its velocities are constant: with the angular
 * velocity w of the whole and W (x, y, phi) = w (-y, x, 0) for each body,
 *
 *     g (q, t) = 0,   J v = eta,   a (q, v) = W v,   A - value B = 0 for what is held (steady_symmetries.c).
 *
 * The unknowns are u = (q, xi), both scaled by units of the scene, and on a branch the parameter.  There are more
 * equations than unknowns, and they depend on each other, since symmetries and conservation laws make steady motions
 * families; continuation.h solves them by least squares.  Their exact derivatives are those of the linearisation
 * (linear.c) for the variations dq, dv = W dq + dxi_k S_k.  On a branch, corrections are orthogonal to the
 * symmetries that leave what is held unchanged.
 *
 * (Relative equilibria: Marsden & Ratiu 1999, Introduction to Mechanics and Symmetry.) */
#include <lapacke.h>
#include <stdlib.h>
#include "search.h"
#include "rank.h"

enum {
  STEADY_WORK = 40,             /* numbers of work space of LAPACK's dgelsy per unknown */
  STEADY_MAX_COORDINATES = 400, /* since the cost is cubic */
  STEADY_POINTS = 50,           /* of a branch, by default */
  STEADY_BREAKPOINTS = 1000     /* that are followed to find the last one */
};
static const double STEADY_EXACT = 1e-9, /* largest residual of a solution, in units of the scene */
    STEADY_SLOW = 1e-4,     /* rates that may be round-off at a double root: more than the root of STEADY_EXACT */
    STEADY_CRAWL = 1e-2,    /* the same at a root of higher order */
    STEADY_REGULAR = 1e-13, /* Newton's method ends at smaller residuals unless the root is of higher order */
    SUGGEST_CHANGE = 1e-8,  /* a quantity is worth holding if the square of its change along the family, without the */
    SUGGEST_LEFT = 1e-6;    /* part that is held already, exceeds SUGGEST_CHANGE, and SUGGEST_LEFT x the whole square */

enum { SIGNAL_TIMES = 16 };             /* times at which signals are compared, and as many between breakpoints */
static const double SIGNAL_SAME = 1e-8; /* largest difference of equal signals, relative to their largest value */

typedef struct {
  pw_run *r;
  double *state;                /* 2 n: q, v */
  double *values;               /* count: at the first of two times */
  double *largest, *difference; /* count: largest magnitude and difference so far */
  int count;                    /* value and two derivatives of each signal */
} signal_comparison;

/* Compares signals at two times, in the run's state (number 0) or one up to a unit of the scene away (number 1), since
 * a signal may be multiplied by a state that is 0.  A status; in the second state signals may fail. */
static int signals_compare (signal_comparison *x, int number, double t0, double t1) {
  pw_run *r = x->r;
  pw_workspace *w = r->w;
  double *q = x->state, *v = q + r->s->coords;
  pw_irregular_state (r, number, number, q, v);
  int status = pw_update_kinematics (w, t0, q, v);
  if (status == PW_OK && x->count) memcpy (x->values, w->u, (size_t)x->count * sizeof *w->u);
  if (status == PW_OK) status = pw_update_kinematics (w, t1, q, v);
  for (int i = 0; status == PW_OK && i < x->count; i++) {
    if (i % 3 > 0 && r->s->source[i / 3].of_force) continue; /* these derivatives are meaningless */
    x->difference[i] = pw_larger_or_nan (x->difference[i], fabs (w->u[i] - x->values[i]));
    x->largest[i] = fmax (x->largest[i], fmax (fabs (x->values[i]), fabs (w->u[i])));
  }
  return number > 0 ? PW_OK : status;
}

int pw_signals_change (pw_run *r, double t, double period, double span, int *changed, pw_error *error) {
  signal_comparison x = { .r = r, .count = 3 * r->s->sources };
  size_t count = (size_t)x.count;
  double at = t, breakpoint = t, end = t + span;
  int status = PW_OK;
  x.values = calloc (3 * count + 2 * (size_t)r->s->coords + 1, sizeof *x.values);
  if (x.values == NULL) return pw_fail_memory (r->s, error);
  x.largest = x.values + count, x.difference = x.largest + count, x.state = x.difference + count;
  for (int k = 1; status == PW_OK && k <= 2 * SIGNAL_TIMES && isfinite (at); k++) {
    double part = k / (double)SIGNAL_TIMES;
    at = period > 0 ? t + span * fmod (0.618034 * k, 1) /* golden ratio: equidistributed */
                    : t + span * part * part;           /* denser at first */
    if (k > SIGNAL_TIMES) {
      /* the middle between the first two breakpoints after the last one, or between the first one and the end */
      breakpoint = pw_next_breakpoint (r->w, 1, breakpoint);
      at = breakpoint < end ? breakpoint + (fmin (pw_next_breakpoint (r->w, 1, breakpoint), end) - breakpoint) / 2
                            : INFINITY;
    }
    for (int number = 0; number < 2 && status == PW_OK && isfinite (at); number++)
      status = signals_compare (&x, number, period > 0 ? at : t, period > 0 ? at + period : at);
  }
  *changed = -1;
  for (int i = x.count; i-- > 0;)
    if (!(x.difference[i] <= SIGNAL_SAME * x.largest[i])) *changed = i / 3;
  free (x.values);
  return status == PW_OK ? PW_OK : pw_run_annotate_error (r, pw_fail_signal (at, error), error);
}

const pw_system *pw_parametric_at (pw_parametric *x, double value, pw_error *why) {
  const pw_system *s = x->described;
  if (x->compile == NULL) return s;
  if (x->own == NULL || x->value != value) {
    pw_system_free (x->own);
    *why = (pw_error){ 0 };
    x->value = value;
    x->own = x->compile (x->context, value, why);
    if (x->own == NULL || why->status != PW_OK) {
      pw_fail (why, PW_INPUT, "there is no system at %.9g", value);
      pw_system_free (x->own);
      return x->own = NULL;
    }
  }
  const pw_system *own = x->own;
  if (own->coords == s->coords && own->rows == s->rows && own->holonomic == s->holonomic && own->bodies == s->bodies)
    return own;
  pw_fail (why, PW_INPUT, "model %s: the parameter changes the number of bodies or constraint equations", own->model);
  return NULL;
}

static void steady_close_system (pw_steady_system *x) {
  pw_linear_close (&x->linearisation);
  if (x->run) pw_run_close (x->run);
  pw_system_free (x->own);
  memset (x, 0, sizeof *x);
}

/* Opens a run at the last solution, which is not made consistent for other values of the parameter; or if there is none
 * or that fails, consistent, or at rest in its configuration. */
static int steady_open_run (pw_steady *x, const pw_system *s) {
  const pw_settings settings = {
    .t = x->settings.t, .span = x->settings.span, .initial = x->solution, .initials = x->solved ? 2 * x->n : 0
  };
  if (x->solved) x->system.run = pw_run_open_inconsistent (s, "rk4+none", &settings, &(pw_error){ 0 });
  if (x->system.run == NULL) x->system.run = pw_run_open (s, "rk4+projection", &settings, &x->why);
  if (x->system.run == NULL && x->why.status == PW_INITIAL && x->solved) {
    for (int j = x->n; j < 2 * x->n; j++) x->solution[j].value = 0;
    x->why = (pw_error){ 0 };
    x->system.run = pw_run_open (s, "rk4+projection", &settings, &x->why);
  }
  if (x->system.run == NULL) return x->why.status;
  int status = pw_linear_open (&x->system.linearisation, x->system.run, PW_LINEAR_BASES);
  return status == PW_OK ? PW_OK : pw_fail_memory (s, &x->why);
}

/* Opens x->system for a value of the parameter, unless it is open for it.  A status, with x->why if it fails;
 * PW_INPUT: its sizes differ; PW_RETRY: none at this value (x->why has the status of the error). */
static int steady_open_system (pw_steady *x, double value) {
  if (x->system.run && (x->parametric.compile == NULL || x->system.value == value)) return PW_OK;
  int i = 0; /* of the recent system with this value, or the oldest one, which changes places with the present one */
  while (i < PW_STEADY_RECENT - 1 && !(x->recent[i].run && x->recent[i].value == value)) i++;
  const pw_steady_system found = x->recent[i];
  memmove (x->recent + 1, x->recent, (size_t)i * sizeof found);
  x->recent[0] = x->system, x->system = found;
  if (x->system.run && x->system.value == value) return PW_OK;
  steady_close_system (&x->system);
  x->why = (pw_error){ 0 };
  const pw_system *s = pw_parametric_at (&x->parametric, value, &x->why);
  const int refused = s == NULL && x->parametric.own;
  const int status = s ? steady_open_run (x, s) : x->why.status;
  x->system.value = value, x->system.own = x->parametric.own, x->parametric.own = NULL;
  if (status != PW_OK) steady_close_system (&x->system);
  return status == PW_OK || status == PW_RESOURCE || refused ? status : PW_RETRY;
}

/* Numbers of unknowns, without the parameter, and of equations. */
static int steady_unknowns (const pw_steady *x) {
  return x->n + x->symmetries;
}
static int steady_equations (const pw_steady *x) {
  return x->holonomic + x->m + x->n + x->settings.holds + x->symmetries;
}

static double steady_parameter (const pw_steady *x, const double *u) {
  return x->settings.first + (x->settings.last - x->settings.first) * u[x->n + x->symmetries];
}

/* Sets x->q, x->v and x->rates to those of the unknowns u, and in x->hold the value that varies. */
static void steady_state (pw_steady *x, const double *u) {
  for (int j = 0; j < x->n; j++) x->q[j] = u[j] * pw_unit (x->s, j);
  pw_steady_combine (x, u + x->n, x->T, x->rates);
  pw_steady_velocities (x, x->rates, x->q, x->v);
  if (x->settings.vary >= 0) x->hold[x->settings.vary].value = steady_parameter (x, u);
}

/* pw_branch_problem.same */
static int steady_same_motion (void *steady, const double *u, const double *other) {
  pw_steady *x = steady;
  size_t n = (size_t)x->n;
  double *q = x->null_space, *v = q + n;
  steady_state (x, u);
  memcpy (q, x->q, n * sizeof *q), memcpy (v, x->v, n * sizeof *v);
  steady_state (x, other);
  return pw_steady_distance (x, q, v, x->q, x->v) <= PW_BRANCH_SAME;
}

/* Sets u, except the parameter, to the motion along symmetries at q with velocities nearest to v, by least squares.
 * PW_METHOD if LAPACK fails. */
static int steady_nearest (pw_steady *x, const double *q, const double *v, double *u, pw_error *error) {
  int n = x->n, columns = x->symmetries, rank;
  double *S = x->F, *right = S + n * columns, *work = right + n + columns;
  memset (x->branch.pivot, 0, (size_t)columns * sizeof *x->branch.pivot);
  for (int j = 0; j < n; j++) u[j] = q[j] / pw_unit (x->s, j), right[j] = v[j] / pw_unit (x->s, j) * x->T;
  for (int k = 0; k < columns; k++) {
    pw_steady_velocities (x, x->symmetry + k * pw_steady_rate_count (x->s), q, S + k * n);
    for (int j = 0; j < n; j++) S[k * n + j] /= pw_unit (x->s, j);
  }
  if (columns && LAPACKE_dgelsy_work (LAPACK_COL_MAJOR, n, columns, 1, S, n, right, n > columns ? n : columns,
                                      x->branch.pivot, PW_STEADY_RANK, &rank, work, STEADY_WORK * (n + columns)))
    return pw_fail (error, PW_METHOD, "the symmetries cannot be separated");
  memcpy (u + n, right, (size_t)columns * sizeof *u);
  return PW_OK;
}

/* The unit of the residual of an equation: INFINITY if it is not enforced, since its reaction is at a limit. */
static double steady_row_unit (const pw_steady *x, int i) {
  const pw_run *r = x->system.run;
  return r->enforced && !r->enforced[i] ? INFINITY : x->norm[i] * x->L;
}

/* The residuals g, J v - eta, a - W v of x->system in the state x->q, x->v, at which its accelerations have been
 * evaluated. */
static void steady_residual (pw_steady *x, double *F) {
  pw_linearisation *l = &x->system.linearisation;
  pw_workspace *w = x->system.run->w;
  double acceleration = x->T * x->T / x->L;
  pw_evaluate_g (w, F);
  for (int i = 0; i < x->holonomic; i++) F[i] /= steady_row_unit (x, i);
  F += x->holonomic;
  pw_mul_J (w, x->v, F);
  if (x->s->rheonomic) pw_evaluate_eta (w, l->row_scratch);
  for (int i = 0; i < x->m; i++)
    F[i] = (F[i] - (x->s->rheonomic ? l->row_scratch[i] : 0)) * x->T / steady_row_unit (x, i);
  F += x->m;
  memcpy (F, l->a, (size_t)x->n * sizeof *F);
  pw_linear_turn (l, -x->rates[PW_RATE_TURN], x->v, F);
  for (int j = 0; j < x->n; j++) F[j] *= pw_length_factor (x->s, j) * acceleration;
}

/* The change of the residuals by the variation (dq, dv) in l->dx and the change dw of the angular velocity w. */
static void steady_change (pw_steady *x, double dw, double *F) {
  pw_linearisation *l = &x->system.linearisation;
  int n = x->n;
  double *dq = l->dx, *dv = l->dx + n;
  pw_mul_J (x->system.run->w, dq, l->row_scratch);
  for (int i = 0; i < x->holonomic; i++) *F++ = l->row_scratch[i] / steady_row_unit (x, i);
  pw_linear_vary (l);
  pw_mul_J (x->system.run->w, dv, l->row_scratch);
  for (int i = 0; i < x->m; i++) *F++ = (l->row_scratch[i] + l->product[n + x->m + i]) * x->T / steady_row_unit (x, i);
  pw_linear_turn (l, -x->rates[PW_RATE_TURN], dv, l->da);
  pw_linear_turn (l, -dw, x->v, l->da);
  for (int j = 0; j < n; j++) *F++ = l->da[j] * pw_length_factor (x->s, j) * x->T * x->T / x->L;
  for (int i = 0; i < x->settings.holds; i++) *F++ = pw_hold_residual (x, x->hold + i, dq, dv);
}

/* The conditions that dq is orthogonal to the free symmetries. */
static void steady_conditions (pw_steady *x, double *dF) {
  int equations = steady_equations (x);
  dF += equations - x->symmetries;
  for (int i = 0; i < x->free_symmetries; i++) {
    double square = 0;
    pw_steady_combine (x, x->free_symmetry + i * x->symmetries, 1, x->combined);
    pw_steady_velocities (x, x->combined, x->q, x->dq);
    for (int j = 0; j < x->n; j++) x->dq[j] /= pw_unit (x->s, j), square += x->dq[j] * x->dq[j];
    for (int j = 0; j < x->n; j++) dF[j * equations + i] = x->dq[j] / sqrt (square);
  }
}

/* Derivatives with respect to the unknowns q and xi. */
static void steady_columns (pw_steady *x, double *dF) {
  pw_linearisation *l = &x->system.linearisation;
  int n = x->n, equations = steady_equations (x);
  for (int c = 0; c < steady_unknowns (x); c++, dF += equations) {
    const double *symmetry = x->symmetry + (c < n ? 0 : c - n) * pw_steady_rate_count (x->s); /* only for c >= n */
    memset (l->dx, 0, 2 * (size_t)n * sizeof *l->dx);
    if (c < n) {
      l->dx[c] = pw_unit (x->s, c);
      pw_linear_turn (l, x->rates[PW_RATE_TURN], l->dx, l->dx + n);
    } else {
      pw_steady_velocities (x, symmetry, x->q, l->dx + n);
      for (int j = n; j < 2 * n; j++) l->dx[j] /= x->T;
    }
    steady_change (x, c < n ? 0 : symmetry[PW_RATE_TURN] / x->T, dF);
  }
}

/* pw_branch_problem.evaluate */
static int steady_evaluate (void *steady, const double *u, double *F, double *dF, pw_error *error) {
  pw_steady *x = steady;
  int first_held = steady_equations (x) - x->symmetries - x->settings.holds;
  int status = steady_open_system (x, steady_parameter (x, u));
  if (status < 0) pw_fail (error, status, "%s", x->why.text);
  if (status != PW_OK) return status;
  pw_linearisation *l = &x->system.linearisation;
  steady_state (x, u);
  status = dF ? pw_linear_evaluate (l, x->settings.t, x->q, x->v)
              : pw_run_accelerate (x->system.run, x->settings.t, x->q, x->v, l->a, l->lambda);
  if (status != PW_OK) {
    x->why = (pw_error){ 0 };
    if (status > 0) pw_fail_singular (x->system.run, x->settings.t, &x->why);
    return PW_RETRY;
  }
  steady_residual (x, F);
  for (int i = 0; i < x->settings.holds; i++) F[first_held + i] = pw_hold_residual (x, x->hold + i, NULL, NULL);
  if (dF == NULL) return PW_OK;
  steady_columns (x, dF);
  steady_conditions (x, dF);
  return PW_OK;
}

/* Evaluates the rows of J at u, of length 1 (m x n); active (m, or NULL): 1 for independent ones. */
static int steady_rows (pw_steady *x, const double *u, double *rows, unsigned char *active, pw_error *error) {
  int status = steady_open_system (x, steady_parameter (x, u));
  if (status < 0) pw_fail (error, status, "%s", x->why.text);
  if (status != PW_OK) return status;
  pw_run *r = x->system.run;
  steady_state (x, u);
  if (pw_evaluate_J_at (r->w, x->settings.t, x->q, x->v) != PW_OK) return PW_RETRY;
  pw_rank_rows (r->w, rows, NULL);
  for (int i = 0; active && i < x->m; i++) active[i] = r->active == NULL || r->active[i];
  return PW_OK;
}

/* 1 if det (A B^T) < 0 for the active rows of A and B (m x n): between them, J has lost rank.  G: m x m, scratch. */
static int steady_loses_rank (const pw_steady *x, const unsigned char *active, const double *A, const double *B,
                              double *G, int *pivot) {
  int rank = 0, negative = 0;
  for (int i = 0; i < x->m; i++) rank += active[i];
  for (int i = 0, row = 0; i < x->m; i++) {
    for (int k = 0, column = 0; active[i] && k < x->m; k++) {
      double sum = 0;
      for (int j = 0; active[k] && j < x->n; j++) sum += A[i * x->n + j] * B[k * x->n + j];
      if (active[k]) G[row * rank + column++] = sum;
    }
    row += active[i];
  }
  if (rank == 0 || LAPACKE_dgetrf (LAPACK_ROW_MAJOR, rank, rank, G, rank, pivot) != 0) return rank > 0;
  for (int i = 0; i < rank; i++) negative ^= (G[i * rank + i] < 0) ^ (pivot[i] != i + 1);
  return negative;
}

/* pw_branch_problem.check_step: no step passes a value of the parameter at which constraint equations become dependent;
 * x->why names one.  Eigenvalues may be infinite there. */
static int steady_check_step (void *steady, const double *from, const double *to, pw_error *error) {
  pw_steady *x = steady;
  const size_t m = (size_t)x->m, entries = m * (size_t)x->n;
  double *A = malloc ((2 * entries + m * m + 1) * sizeof *A + m * (1 + sizeof (int)));
  if (A == NULL) return pw_fail_memory (x->s, error);
  double *B = A + entries, *G = B + entries;
  int *pivot = (int *)(G + m * m), row = -1;
  unsigned char *active = (unsigned char *)(pivot + m);
  int status = steady_rows (x, from, A, active, error), redundant = status == PW_OK ? x->system.run->redundant : 0;
  if (status == PW_OK) status = steady_rows (x, to, B, NULL, error);
  pw_run *r = x->system.run;
  if (status == PW_OK && (r->redundant > redundant || steady_loses_rank (x, active, A, B, G, pivot))) {
    status = PW_RETRY;
    if (r->redundant > redundant)
      row = r->redundant_row[0];
    else
      pw_watchdog_sine (r, &row);
    x->why = (pw_error){ 0 };
    pw_fail (&x->why, PW_METHOD, "the constraints become singular: %s depends on other constraints",
             row >= 0 ? PW_NAME (pw_system_row_name, x->s, row) : "one of them");
  }
  free (A);
  return status;
}

enum { START_STEPS = 300 };               /* of a relaxation, at most */
static const double START_FAR = 0.2,      /* longest of its steps, in units of the scene */
    START_GROW = 1.1, START_SHRINK = 0.4, /* factors of the next step */
    START_STILL = 1e-10;                  /* accelerations that count as round-off, in units of the scene */

/* Makes the positions x->q consistent, if possible. */
static int start_assemble (pw_steady *x, pw_projector *p) {
  double *q = x->scratch[0];
  memcpy (q, x->q, (size_t)x->n * sizeof *q);
  int status = pw_project_positions (p, x->system.run, x->settings.t, q, x->v);
  if (status == PW_OK) memcpy (x->q, q, (size_t)x->n * sizeof *q);
  return status;
}

/* The accelerations in the moving frame at x->q, x->rates; returns the largest, divided by the unit of its coordinate
 * [1/s^2], or NaN if they are not determined. */
static double start_accelerate (pw_steady *x, double *a) {
  pw_linearisation *l = &x->system.linearisation;
  double most = 0;
  pw_steady_velocities (x, x->rates, x->q, x->v);
  if (pw_run_accelerate (x->system.run, x->settings.t, x->q, x->v, l->a, l->lambda) != PW_OK) return NAN;
  memcpy (a, l->a, (size_t)x->n * sizeof *a);
  pw_linear_turn (l, -x->rates[PW_RATE_TURN], x->v, a);
  for (int j = 0; j < x->n; j++) most = pw_larger_or_nan (most, fabs (a[j]) / pw_unit (x->s, j));
  return most;
}

/* Moves positions along the accelerations, at constant rates: towards a minimum of the potential, if forces have one.
 * Steps become longer while the direction of the accelerations changes by less than 90 degrees, otherwise shorter. */
static void start_relax (pw_steady *x, pw_projector *p) {
  const double time = pw_run_scale (x->system.run)->time, still = START_STILL / (time * time);
  double *a = x->scratch[1], *before = x->scratch[2], most = start_accelerate (x, a), step = START_FAR / most;
  for (int i = 0; i < START_STEPS && most > still && isfinite (step); i++) {
    double dot = 0;
    for (int j = 0; j < x->n; j++) x->q[j] += fmin (step, START_FAR / most) * a[j];
    if (start_assemble (x, p) != PW_OK) return;
    memcpy (before, a, (size_t)x->n * sizeof *a);
    most = start_accelerate (x, a);
    for (int j = 0; j < x->n; j++) dot += a[j] * before[j] / (pw_unit (x->s, j) * pw_unit (x->s, j));
    step *= dot > 0 ? START_GROW : START_SHRINK;
  }
}

/* The unknowns, except the parameter, with which an attempt begins; x->system is open.  Attempt 0: the initial
 * state; 1: a state to which forces lead from there; then random states, even attempts near the initial one, odd ones
 * anywhere.  Of these, by attempt modulo 4: 0 and 1 need not be consistent; 2: a state to which forces lead as in
 * attempt 1; 3: consistent. */
static int steady_start (pw_steady *x, int attempt, double *u, pw_error *error) {
  int status = steady_nearest (x, x->start, x->start + x->n, u, error);
  uint64_t state = (uint64_t)attempt * 0xd1342543de82ef95; /* of the random numbers; far apart between attempts */
  double wide = attempt % 2 ? 1 : 0.2;                     /* of lengths L, angles pi, rates 2 / T */
  const int relaxed = attempt == 1 || attempt % 4 == 2, consistent = relaxed || attempt % 4 == 3;
  pw_projector p;
  for (int j = 0; attempt > 1 && j < steady_unknowns (x); j++)
    u[j] += wide * (double)(int64_t)pw_random_bits (&state) * 0x1p-63 *
            (j >= x->n               ? 2
             : pw_is_angle (x->s, j) ? PW_PI
                                     : 1);
  if (status != PW_OK || !consistent) return status;
  steady_state (x, u);
  if (pw_evaluate_J_at (x->system.run->w, x->settings.t, x->q, x->v) != PW_OK) return PW_OK; /* as it is */
  if (pw_projector_open (&p, x->system.run, x->s->metric, x->s->metric, &x->why) != PW_OK)
    return pw_fail_memory (x->s, error);
  if (start_assemble (x, &p) == PW_OK && relaxed) start_relax (x, &p);
  pw_projector_close (&p);
  for (int j = 0; j < x->n; j++) u[j] = x->q[j] / pw_unit (x->s, j);
  return PW_OK;
}

int pw_check_search (double first, double last, int points, pw_error *error) {
  if (!isfinite (first) || !isfinite (last))
    return pw_fail (error, PW_INPUT, "settings first = %g, last = %g: expected finite numbers", first, last);
  if (points < 0) return pw_fail (error, PW_INPUT, "setting points = %d: expected a number > 0", points);
  return PW_OK;
}

static int steady_arrays (pw_steady *x) {
  size_t n = (size_t)x->n, m = (size_t)x->m, rates = (size_t)pw_steady_rate_count (x->s), unknowns = n + rates;
  size_t holds = (size_t)x->settings.holds;
  x->memory = PW_ALLOC_ARRAYS (PW_ARRAY (x->symmetry, rates * rates), PW_ARRAY (x->free_symmetry, rates * rates),
                               PW_ARRAY (x->norm, m), PW_ARRAY (x->start, 2 * n), PW_ARRAY (x->q, n + 3),
                               PW_ARRAY (x->v, n + 3), PW_ARRAY (x->rates, rates), PW_ARRAY (x->combined, rates),
                               PW_ARRAY (x->u, unknowns + 1), PW_ARRAY (x->F, n * rates + (1 + STEADY_WORK) * unknowns),
                               PW_ARRAY (x->scratch[0], n), PW_ARRAY (x->scratch[1], n), PW_ARRAY (x->scratch[2], n),
                               PW_ARRAY (x->dq, n), PW_ARRAY (x->dv, n),
                               PW_ARRAY (x->null_space, (unknowns + 1) * (unknowns + 1)), PW_ARRAY (x->solution, 2 * n),
                               PW_ARRAY (x->hold, holds + n));
  if (x->memory == NULL) return PW_RESOURCE;
  if (holds) memcpy (x->hold, x->settings.hold, holds * sizeof *x->hold);
  for (int j = 0; j < 2 * x->n; j++) x->solution[j].state = j;
  return PW_OK;
}

/* PW_INPUT if a signal changes with time within the span: the message names the first one and, if no signal changes
 * after the last breakpoint, the time of this breakpoint, rounded up. */
static int steady_constant (pw_steady *x, pw_error *error) {
  pw_run *r = x->system.run;
  char text[32];
  const double span = r->settings.span; /* with its default */
  int changed, later, status = pw_signals_change (r, x->settings.t, 0, span, &changed, error);
  if (status != PW_OK || changed < 0) return status;
  const char *name = PW_NAME (pw_system_signal_name, x->s, changed);
  double last = x->settings.t, next = last; /* the last breakpoint of signals within the span */
  for (int i = 0; i < STEADY_BREAKPOINTS && next <= x->settings.t + span; i++)
    last = next, next = pw_next_breakpoint (r->w, 1, last);
  status = pw_signals_change (r, last, 0, span, &later, error);
  if (status != PW_OK) return status;
  snprintf (text, sizeof text, "%.9g", last);
  if (strtod (text, NULL) < last) snprintf (text, sizeof text, "%.9g", last * (1 + 1e-8));
  if (later < 0)
    return pw_fail (error, PW_INPUT,
                    "model %s: signal %s changes with time, but after %s s no signal does: give --at %s", x->s->model,
                    name, text, text);
  return pw_fail (
      error, PW_INPUT,
      "model %s: signal %s changes with time, so that there are no steady motions; `pinwheel periodic` finds "
      "periodic ones",
      x->s->model, name);
}

static int steady_begin (pw_steady *x, pw_error *error) {
  if (steady_open_system (x, x->settings.first) != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  const pw_run *r = x->system.run;
  x->L = x->s->scale.length;
  x->T = r->w->scale.time;
  memcpy (x->start, r->q, (size_t)x->n * sizeof *r->q);
  memcpy (x->start + x->n, r->v, (size_t)x->n * sizeof *r->v);
  if (x->s->bodies) memcpy (x->origin, r->q, sizeof x->origin);
  return PW_OK;
}

/* Checks the signals and sets the symmetries and x->norm, all within the range: at its ends, for instance without
 * gravity, there may be more symmetries.  Leaves the system open at the first value. */
static int steady_symmetries (pw_steady *x, int may_change, pw_error *error) {
  const double first = x->settings.first;
  int status = steady_open_system (x, pw_value_within (first, x->settings.last));
  if (status != PW_OK) status = steady_open_system (x, first);
  if (status != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  if (!may_change) status = steady_constant (x, error);
  if (status != PW_OK) return status;
  status = pw_steady_find_symmetries (x);
  if (status == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (status != PW_OK) return pw_fail_singular (x->system.run, x->settings.t, error);
  for (int i = 0; i < x->m; i++) x->norm[i] = x->system.linearisation.norm[i] > 0 ? x->system.linearisation.norm[i] : 1;
  status = steady_open_system (x, first);
  return status == PW_OK ? PW_OK : pw_fail (error, x->why.status, "%s", x->why.text);
}

static int steady_open_branch (pw_steady *x, pw_error *error) {
  const pw_branch_problem problem = { .unknowns = steady_unknowns (x),
                                      .equations = steady_equations (x),
                                      .tolerance = STEADY_EXACT,
                                      .evaluate = steady_evaluate,
                                      .same = steady_same_motion,
                                      .check_step = steady_check_step,
                                      .context = x };
  return pw_branch_open (&x->branch, &problem, error);
}

/* may_change: 1: signals may change with time. */
static pw_steady *steady_open (const pw_system *s, const pw_steady_settings *settings, int may_change,
                               pw_error *error) {
  pw_steady *x = calloc (1, sizeof *x);
  if (x == NULL) return pw_fail_memory (s, error), NULL;
  x->s = s, x->settings = *settings;
  x->parametric = (pw_parametric){ .described = s, .compile = settings->compile, .context = settings->context };
  x->n = s->coords, x->m = s->rows, x->holonomic = s->holonomic;
  if (x->settings.points == 0) x->settings.points = STEADY_POINTS;
  int status = PW_OK;
  if (x->n > STEADY_MAX_COORDINATES)
    status = pw_fail (error, PW_INPUT, "model %s has %d coordinates; steady motions are sought with at most %d",
                      s->model, x->n, STEADY_MAX_COORDINATES);
  if (status == PW_OK && steady_arrays (x) != PW_OK) status = pw_fail_memory (s, error);
  if (status == PW_OK) status = steady_begin (x, error);
  for (int j = 0; j < x->n && status == PW_OK && !may_change; j++) {
    /* angles that nothing turns keep their velocities */
    int held = !pw_is_unturned (s, j);
    for (int i = 0; i < x->settings.holds; i++) held |= x->hold[i].state == x->n + j;
    if (!held) x->hold[x->settings.holds++] = (pw_initial_value){ .state = x->n + j, .value = x->start[x->n + j] };
  }
  if (status == PW_OK) status = steady_symmetries (x, may_change, error);
  if (status == PW_OK) status = steady_open_branch (x, error);
  if (status == PW_OK) return x;
  pw_steady_close (x);
  return NULL;
}

static int steady_check_settings (const pw_system *s, const pw_steady_settings *set, pw_error *error) {
  const int most = 2 * s->coords + PW_HOLD_OF_BODY * s->bodies - 1;
  if (pw_check_search (set->first, set->last, set->points, error) != PW_OK) return PW_INPUT;
  if (set->holds < 0 || (set->holds > 0 && set->hold == NULL))
    return pw_fail (error, PW_INPUT, "setting holds = %d: expected the number of entries of `hold`", set->holds);
  for (const pw_initial_value *x = set->hold, *end = x + set->holds; x < end; x++)
    if (x->state < 0 || x->state > most || !isfinite (x->value))
      return pw_fail (error, PW_INPUT, "setting hold: quantity %d = %g: expected one from 0 to %d and a finite value",
                      x->state, x->value, most);
  if (set->vary >= -1 && set->vary < set->holds) return PW_OK;
  return pw_fail (error, PW_INPUT, "setting vary = %d: expected -1 or an index of `hold`, below holds = %d", set->vary,
                  set->holds);
}

void pw_steady_close (pw_steady *x) {
  if (x == NULL) return;
  steady_close_system (&x->system);
  for (int i = 0; i < PW_STEADY_RECENT; i++) steady_close_system (&x->recent[i]);
  pw_branch_close (&x->branch);
  pw_linear_free (&x->linear);
  free (x->memory);
  free (x);
}

pw_steady *pw_steady_open (const pw_system *s, const pw_steady_settings *settings, pw_error *error) {
  if (pw_require (s, "a system", error) != PW_OK || pw_require (settings, "settings", error) != PW_OK) return NULL;
  if (steady_check_settings (s, settings, error) != PW_OK) return NULL;
  return steady_open (s, settings, 0, error);
}

pw_steady *pw_steady_open_symmetries (const pw_system *s, const pw_steady_settings *settings, pw_error *error) {
  return steady_open (s, settings, 1, error);
}

const char *pw_steady_reason (const pw_steady *x) {
  return x ? x->why.text : "";
}

int pw_steady_symmetries (const pw_steady *x) {
  return x ? x->symmetries - pw_steady_hidden_symmetries (x) : 0;
}

/* The motion of the unknowns u, which become x->solution, with its linearisation; sets x->neutral.  A status. */
static int steady_motion_at (pw_steady *x, const double *u, pw_steady_motion *out, pw_error *error) {
  int status = steady_open_system (x, steady_parameter (x, u));
  if (status != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  pw_run *r = x->system.run;
  steady_state (x, u);
  x->solved = 1;
  for (int j = 0; j < x->n; j++) x->solution[j].value = x->q[j], x->solution[x->n + j].value = x->v[j];
  memcpy (r->q, x->q, (size_t)x->n * sizeof *r->q);
  memcpy (r->v, x->v, (size_t)x->n * sizeof *r->v);
  pw_linear_free (&x->linear);
  status = pw_run_linearise (r, STEADY_MAX_COORDINATES, &x->linear, error);
  if (status != PW_OK) return status;
  out->parameter = steady_parameter (x, u);
  out->q = x->q, out->v = x->v;
  out->linear = &x->linear;
  out->unstable = x->neutral = 0;
  for (int i = 0; i < x->linear.unknowns; i++) {
    out->unstable += x->linear.re[i] > 0 && !x->linear.rigid[i];
    x->neutral += x->linear.re[i] == 0;
  }
  return PW_OK;
}

/* Sets x->null_space to the directions in which solutions form a family, without those of free symmetries.  Returns
 * their number, or a status < 0. */
static int steady_family (pw_steady *x) {
  int unknowns = steady_unknowns (x), equations = steady_equations (x);
  pw_error none = { 0 };
  int status = pw_steady_find_free_symmetries (x);
  if (status != PW_OK) return status;
  memset (x->branch.J, 0, (size_t)equations * ((size_t)unknowns + 1) * sizeof *x->branch.J);
  status = steady_evaluate (x, x->u, x->branch.F, x->branch.J, &none);
  if (status != PW_OK) return status == PW_RESOURCE ? status : PW_METHOD;
  return pw_null_space (equations, unknowns, x->branch.J, PW_STEADY_RANK, x->null_space);
}

/* Replaces rates below the accuracy of a multiple root by rest, if that is a solution, too: then 1. */
static int steady_rest (pw_steady *x) {
  size_t bytes = ((size_t)steady_unknowns (x) + 1) * sizeof *x->u;
  pw_error none = { 0 };
  double most = 0;
  for (int k = x->n; k < steady_unknowns (x); k++) most = fmax (most, fabs (x->u[k]));
  if (most == 0 || most > (x->branch.residual > STEADY_REGULAR ? STEADY_CRAWL : STEADY_SLOW)) return 0;
  memcpy (x->null_space, x->u, bytes);
  memset (x->u + x->n, 0, (size_t)x->symmetries * sizeof *x->u);
  if (pw_branch_solve (&x->branch, x->u, &none) == PW_OK) return 1;
  memcpy (x->u, x->null_space, bytes);
  return 0;
}

static int steady_converge (pw_steady *x, int attempt, double parameter, pw_steady_motion *out, pw_error *error) {
  const double range = x->settings.last - x->settings.first;
  x->free_symmetries = 0;
  int status = steady_start (x, attempt, x->u, error);
  if (status != PW_OK) return status;
  x->u[steady_unknowns (x)] = range != 0 ? (parameter - x->settings.first) / range : 0;
  status = pw_branch_solve (&x->branch, x->u, error);
  out->iterations = x->branch.iterations;
  out->residual = x->branch.residual;
  if ((status == PW_OK || status == PW_RETRY) && steady_rest (x))
    status = PW_OK, out->iterations = x->branch.iterations, out->residual = x->branch.residual;
  steady_state (x, x->u);
  return status;
}

/* Removes symmetries that the solution reached does not have: then PW_RETRY. */
static int steady_lose_symmetries (pw_steady *x, pw_error *error) {
  const int symmetries = x->symmetries, status = pw_steady_keep_symmetries (x);
  if (status == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (status != PW_OK || x->symmetries == symmetries) return PW_OK;
  pw_branch before = x->branch;
  const int opened = steady_open_branch (x, error);
  pw_branch_close (opened == PW_OK ? &before : &x->branch);
  if (opened == PW_OK) return PW_RETRY;
  x->branch = before;
  return opened;
}

int pw_steady_solve (pw_steady *x, int attempt, double parameter, pw_steady_motion *out, pw_error *error) {
  *out = (pw_steady_motion){ .parameter = parameter, .residual = INFINITY };
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  if (attempt < 0) return pw_fail (error, PW_INPUT, "attempt = %d: expected a number >= 0", attempt);
  if (pw_check_parameter (parameter, error) != PW_OK) return PW_INPUT;
  if (steady_open_system (x, parameter) != PW_OK) return pw_fail (error, x->why.status, "%s", x->why.text);
  int status, known;
  do {
    status = steady_converge (x, attempt, parameter, out, error);
    out->q = x->q, out->v = x->v;
    if (status != PW_OK) return status;
    known = steady_lose_symmetries (x, error);
  } while (known == PW_RETRY);
  if (known != PW_OK) return known;
  out->family = steady_family (x);
  if (out->family == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (out->family < 0) return pw_fail (error, PW_METHOD, "the family of the steady motion cannot be determined");
  pw_steady_move_to_start (x, x->q, x->v);
  status = steady_nearest (x, x->q, x->v, x->u, error);
  return status == PW_OK ? steady_motion_at (x, x->u, out, error) : status;
}

/* Whether holding a quantity makes the family smaller.  `basis` has `count` orthonormal rows of length `family`, the
 * changes of what is held already along its directions, in units of the scene; that of this quantity becomes the next
 * row.  relative: 1: the change of an angle less that of the angle of the first body. */
static int suggest_helps (pw_steady *x, const pw_initial_value *hold, int relative, int family, double *basis,
                          int count) {
  double *row = basis + count * family, left = 0, whole = 0; /* squares */
  const double *z = x->null_space;
  for (int i = 0; i < family; i++, z += steady_unknowns (x)) {
    pw_steady_combine (x, z + x->n, x->T, x->combined);
    pw_steady_velocities (x, x->combined, x->q, x->dv);
    for (int j = 0; j < x->n; j++) x->dq[j] = z[j] * pw_unit (x->s, j);
    pw_linear_turn (&x->system.linearisation, x->rates[PW_RATE_TURN], x->dq, x->dv);
    row[i] = pw_hold_residual (x, hold, x->dq, x->dv) - (relative ? x->dq[2] : 0);
    whole += row[i] * row[i];
  }
  for (int k = 0; k < count; k++) {
    double dot = 0;
    for (int i = 0; i < family; i++) dot += row[i] * basis[k * family + i];
    for (int i = 0; i < family; i++) row[i] -= dot * basis[k * family + i];
  }
  for (int i = 0; i < family; i++) left += row[i] * row[i];
  for (int i = 0; i < family; i++) row[i] /= sqrt (left);
  return left > SUGGEST_CHANGE && left > SUGGEST_LEFT * whole;
}

/* Candidate c to hold, as numbered by pw_system_find_held: speed and angular velocity of the first body; angles of
 * bodies; internal coordinates; positions; speed and angular velocity of every body. */
static int suggest_candidate (const pw_steady *x, int c) {
  int n = x->n, bodies = x->s->bodies;
  if (c < 2) return c == 0 ? 2 * n : n + 2;
  if ((c -= 2) < bodies) return 3 * c + 2;
  if ((c -= bodies) < n - 3 * bodies) return 3 * bodies + c;
  if ((c -= n - 3 * bodies) < 2 * bodies) return c / 2 * 3 + c % 2;
  c -= 2 * bodies;
  return c % 2 ? n + c / 2 * 3 + 2 : 2 * n + c / 2 * PW_HOLD_OF_BODY;
}

int pw_steady_suggest (pw_steady *x, pw_initial_value *hold, int most) {
  int family = x ? steady_family (x) : PW_INPUT, count = 0, held = 0;
  int turns = 0, anchored = 0; /* 1: the whole can turn; the angle of the first body is held, to which others relate */
  if (family < 0) return family;
  double *basis = calloc ((size_t)family * ((size_t)family + 1) + 1, sizeof *basis);
  if (basis == NULL) return PW_RESOURCE;
  for (int k = 0; k < x->free_symmetries; k++)
    for (int i = 0; i < x->symmetries; i++)
      turns |=
          x->free_symmetry[k * x->symmetries + i] * x->symmetry[i * pw_steady_rate_count (x->s) + PW_RATE_TURN] != 0;
  for (int c = 0; c < 2 + x->n + 2 * x->s->bodies && held < family && count < most; c++) {
    pw_initial_value try = { .state = suggest_candidate (x, c) };
    int placed = try.state < 3 * x->s->bodies; /* 1: a position or an angle of a body */
    int relative = turns && placed && try.state % 3 == 2;
    if (turns && placed && !relative) continue;
    if (!suggest_helps (x, &try, relative, family, basis, held)) continue;
    if (relative && !anchored && count < most)
      hold[count++] = (pw_initial_value){ .state = 2, .value = x->q[2] }, anchored = 1;
    if (count == most) break;
    try.value = pw_system_held_value (x->s, try.state, x->q, x->v);
    hold[count++] = try;
    held++;
  }
  free (basis);
  return count;
}

static const double BRANCH_MIN_STEP = 1e-7, /* in scaled unknowns; the range of the parameter is 1 */
    BRANCH_ACCURACY = 1e-9;                 /* of events, relative to the step */
enum { BRANCH_MAX_POINTS = 100 /* as a multiple of those that the settings ask for */ };

int pw_steady_follow (pw_steady *x, const double *q, const double *v, double parameter, int direction,
                      pw_error *error) {
  pw_error ignored = { 0 };
  if (error == NULL) error = &ignored;
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  pw_branch_end (&x->branch);
  if (pw_require (q, "q", error) != PW_OK || pw_require (v, "v", error) != PW_OK) return PW_INPUT;
  const double first = x->settings.first, last = x->settings.last;
  if (pw_check_branch (direction, first, last, error) != PW_OK || pw_check_parameter (parameter, error) != PW_OK)
    return PW_INPUT;
  pw_steady_motion motion;
  x->free_symmetries = 0;
  int status = steady_nearest (x, q, v, x->u, error);
  x->u[steady_unknowns (x)] = (parameter - first) / (last - first);
  if (status == PW_OK) status = pw_branch_solve (&x->branch, x->u, error);
  if (status == PW_OK) status = steady_motion_at (x, x->u, &motion, error);
  if (status == PW_OK) status = pw_steady_find_free_symmetries (x);
  if (status == PW_OK) status = pw_branch_start (&x->branch, x->u, direction, error);
  if (status == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (status != PW_OK)
    return status < 0 && error->status ? status : pw_fail (error, PW_METHOD, "the branch cannot be followed from here");
  x->unstable = motion.unstable;
  x->branch.max_change = 1.0 / x->settings.points, x->branch.step = x->branch.max_change / 4;
  x->branch.min_step = BRANCH_MIN_STEP, x->branch.event_accuracy = BRANCH_ACCURACY;
  x->branch.max_points = BRANCH_MAX_POINTS * x->settings.points;
  return PW_OK;
}

/* The real part of eigenvalue number `sought` of those whose real part is not 0, without rigid displacements, and its
 * imaginary part; -1 if there are fewer. */
static double branch_eigenvalue (const pw_steady *x, int sought, double *im) {
  const pw_linear *l = &x->linear;
  for (int i = 0; i < l->unknowns; i++) {
    if (l->re[i] == 0 || l->rigid[i]) continue;
    if (sought-- == 0) return *im = l->im[i], l->re[i];
  }
  return *im = 0, -1;
}

/* pw_branch_test.  If as many eigenvalues have real part 0 as at both ends of the step (x->neutral_at_ends): the real
 * part that changes its sign; if more have: 0; otherwise 1 if more than `sought` modes grow, or else -1. */
static int branch_test (void *steady, const pw_branch_point *point, double *value, pw_error *error) {
  pw_steady *x = steady;
  pw_steady_motion motion;
  double im;
  int status = steady_motion_at (x, point->u, &motion, error);
  if (status != PW_OK) return status;
  *value = motion.unstable > x->sought ? 1 : -1;
  if (x->neutral_at_ends == x->neutral) *value = branch_eigenvalue (x, x->sought, &im);
  if (x->neutral_at_ends >= 0 && x->neutral_at_ends < x->neutral) *value = 0;
  return PW_OK;
}

/* Whether a conjugate pair changes the sign of its real part at the point located; in the step `changing` modes do. */
static int branch_pair (const pw_steady *x, int changing) {
  double im;
  branch_eigenvalue (x, x->sought, &im);
  if (x->neutral_at_ends < 0) return im != 0 || changing == 2;
  return x->neutral > x->neutral_at_ends ? x->neutral - x->neutral_at_ends >= 2 : im != 0;
}

/* pw_branch_locate_mode: changes of the sign of a real part. */
static int branch_locate (void *steady, int mode, int change, int *event, int *modes, pw_error *error) {
  pw_steady *x = steady;
  x->sought = mode;
  int status = pw_branch_locate (&x->branch, branch_test, x, error);
  if (status != PW_OK) return status;
  const int pair = branch_pair (x, abs (change));
  *event = pair ? PW_STEADY_OSCILLATION : PW_STEADY_REAL, *modes = 1 + pair;
  return PW_OK;
}

/* pw_branch_find_events */
static int branch_events (void *steady, pw_error *error) {
  pw_steady *x = steady;
  pw_steady_motion motion;
  int before = x->unstable, neutral = x->neutral, status = steady_motion_at (x, x->branch.reached.u, &motion, error);
  if (status != PW_OK) return status;
  x->unstable = motion.unstable;
  x->neutral_at_ends = neutral == x->neutral ? neutral : -1;
  neutral = x->neutral;
  status = pw_branch_find_changes (&x->branch, before, x->unstable, branch_locate, error);
  x->neutral = neutral;
  return status;
}

int pw_steady_next (pw_steady *x, pw_steady_motion *out, pw_error *error) {
  int status = pw_require (x, "a search", error);
  *out = (pw_steady_motion){ .event = PW_STEADY_END };
  if (status != PW_OK) return status;
  const pw_branch_event *next;
  status = pw_branch_next (&x->branch, branch_events, &x->why, &next, error);
  if (next == NULL) return status;
  int neutral = x->neutral;
  out->event = (pw_steady_event)next->event;
  out->iterations = x->branch.iterations;
  out->residual = next->point.residual;
  status = steady_motion_at (x, next->point.u, out, error);
  if (next->event != PW_BRANCH_POINT) out->unstable = next->unstable;
  x->neutral = neutral;
  return status;
}
