/* The self-tests of element types: in a random scene, and in a scene that uses the type.  Most checks compare one
 * function of its table with differences of another. */
#include <float.h>
#include <stdlib.h>
#include <string.h>
#include "selftest.h"

static const struct {
  const char *name, *about; /* as in pw_selftest_check */
} selftest_checks[] = {
  { "table", "consistent sizes, fields and functions" },
  { "size", "each function fills exactly its array" },
  { "J", "J = dg/dq" },
  { "eta", "eta = -dg/dt" },
  { "g_size", "g_size >= |g|" },
  { "gamma", "J a - gamma = d(J v - eta)/dt" },
  { "J_gamma", "J_gamma = J and gamma" },
  { "force_u", "force_u = d force/du" },
  { "J_u", "J_u = d J/du" },
  { "eta_u", "eta_u = d eta/du" },
  { "gamma_u", "gamma_u = d gamma/du" },
  { "constant", "a constant force does not change" },
  { "jw_q", "jw_q = d(J w)/dq" },
  { "eta_q", "eta_q = d eta/dq" },
  { "gamma_q", "gamma_q = d gamma/dq" },
  { "gamma_v", "gamma_v = d gamma/dv" },
  { "force_q", "force_q = d force/dq" },
  { "force_v", "force_v = d force/dv" },
  { "saturation", "saturation velocity of a saturating force" },
  { "power", "force . v = power - loss - d energy/dt" },
  { "loss", "loss >= 0" },
  { "gradient", "gradient = d signal/d state" },
};
_Static_assert(sizeof selftest_checks / sizeof *selftest_checks <= PW_SELFTEST_CHECKS, "a report has room for all");

/* The checks of blocks have the names of the functions that give them. */
static const char *const selftest_block_name[] = {
  [PW_JW_Q] = "jw_q",       [PW_JTL_Q] = "jw_q",      [PW_ETA_Q] = "eta_q",     [PW_GAMMA_Q] = "gamma_q",
  [PW_GAMMA_V] = "gamma_v", [PW_FORCE_Q] = "force_q", [PW_FORCE_V] = "force_v", [PW_G_Q] = "J",
};

/* Records the result of a check, keeping the worst. */
static void selftest_record (pw_selftest_report *r, const char *check, double error, double bound, const char *reason,
                             const char *where) {
  pw_selftest_check *c = r->check;
  while (c < r->check + r->checks && strcmp (c->name, check) != 0) c++;
  if (c == r->check + r->checks) {
    int i = 0;
    while (strcmp (selftest_checks[i].name, check) != 0) i++;
    r->checks++;
    *c = (pw_selftest_check){ check, selftest_checks[i].about, -1, bound, reason, .failed = 0 };
  }
  if (isnan (error)) error = INFINITY;
  if (!(error <= bound) && !c->failed) c->failed = 1, r->failed++;
  if (error <= c->error) return;
  c->error = error;
  snprintf (c->where, sizeof c->where, "%s", where);
}

enum { PROBE_GUARD = 8 }; /* guard numbers after an array, which must not change */

/* Moves by h: along dq; along dv; in time, by h tau; in time and along the motion q + v s + a s^2 / 2, s = h tau. */
typedef enum { PROBE_Q, PROBE_V, PROBE_TIME, PROBE_MOTION } probe_move;

/* The batch of one element type in a scene, at a state that is moved to compute differences. */
typedef struct {
  const pw_kind *kind;
  const pw_system *s;
  pw_workspace *workspace;
  pw_element_batch *batch;     /* of the element type, in the workspace */
  int elements, rows, cols;    /* rows and cols per element */
  double t, tau;               /* the time, and the unit of its changes [s] */
  double *q, *v, *a, *dq, *dv; /* coords: the state and its acceleration; directions of moves */
  double *q_now, *v_now;       /* coords: the state as moved by the last update */
  double *w, *lambda;          /* elements x cols, elements x rows: the vector w of jw_q, the multipliers */
  double *J, *eta;             /* at the moved state */
  int failed;                  /* 1: a signal failed */
  int check_sizes;             /* 1: also checks that each function fills exactly its array */
  pw_selftest_report *report;
  char *memory; /* of the arrays; the caller frees it in every case */

  /* Of the test in a scene: elements x width numbers; width: the most values of an element in any comparison. */
  int width;
  double *plus, *minus, *derivative; /* a function after steps forwards and backwards; its derivative by differences */
  double *value, *terms;             /* what is compared with it; the sum of the absolute values of its terms */
  double *size;                      /* in the check of J: g_size; in other checks: 0 */
  double *error, *expected;          /* the least error of all steps; the derivative by differences of that step */
  double *block;                     /* elements x width x width */
} probe;

typedef void probe_function (probe *x, double *out); /* `out` has room for PROBE_GUARD more numbers */

static int probe_open (probe *x, pw_error *error) {
  x->kind = x->batch->kind;
  x->elements = x->batch->b.count, x->rows = x->kind->rows, x->cols = x->batch->b.cols;
  x->width = x->cols > x->rows ? x->cols : x->rows;
  if (x->width < PW_MAX_SIGNALS) x->width = PW_MAX_SIGNALS;
  size_t n = (size_t)x->s->coords, rows = (size_t)(x->elements * x->rows), w = (size_t)(x->elements * x->cols);
  size_t J = rows * (size_t)x->cols + PROBE_GUARD, eta = rows + PROBE_GUARD;
  size_t m = (size_t)(x->elements * x->width) + PROBE_GUARD, block = m * (size_t)x->width;
  x->memory = PW_ALLOC_ARRAYS (PW_ARRAY (x->q, n), PW_ARRAY (x->v, n), PW_ARRAY (x->a, n), PW_ARRAY (x->dq, n),
                               PW_ARRAY (x->dv, n), PW_ARRAY (x->q_now, n), PW_ARRAY (x->v_now, n), PW_ARRAY (x->w, w),
                               PW_ARRAY (x->lambda, rows), PW_ARRAY (x->J, J), PW_ARRAY (x->eta, eta),
                               PW_ARRAY (x->plus, m), PW_ARRAY (x->minus, m), PW_ARRAY (x->derivative, m),
                               PW_ARRAY (x->value, m), PW_ARRAY (x->terms, m), PW_ARRAY (x->size, m),
                               PW_ARRAY (x->error, m), PW_ARRAY (x->expected, m), PW_ARRAY (x->block, block));
  x->batch->b.w = x->w, x->batch->b.lambda = x->lambda;
  return x->memory ? PW_OK : pw_fail_memory (x->s, error);
}

static void probe_update (probe *x, probe_move move, double h) {
  double step = move == PROBE_MOTION ? h * x->tau : 0;
  for (int j = 0; j < x->s->coords; j++) {
    x->q_now[j] = x->q[j] + step * (x->v[j] + step * x->a[j] / 2) + (move == PROBE_Q ? h * x->dq[j] : 0);
    x->v_now[j] = x->v[j] + step * x->a[j] + (move == PROBE_V ? h * x->dv[j] : 0);
  }
  const double t = move == PROBE_TIME || move == PROBE_MOTION ? x->t + h * x->tau : x->t;
  x->failed |= pw_update_kinematics (x->workspace, t, x->q_now, x->v_now) != PW_OK;
}

/* Calls a function of the type, which fills n numbers; NULL gives zeros.  name: of the function, for the report. */
static void probe_evaluate (probe *x, pw_batch_function *f, const char *name, int n, double *out) {
  for (int i = 0; i < n + PROBE_GUARD; i++) out[i] = f ? NAN : 0;
  if (f == NULL) return;
  f (&x->batch->b, out);
  if (!x->check_sizes) return;
  char where[120];
  int untouched = 0, beyond = 0;
  for (int i = 0; i < n; i++) untouched += !isfinite (out[i]);
  for (int i = n; i < n + PROBE_GUARD; i++) beyond += !isnan (out[i]);
  snprintf (where, sizeof where, "%s: %d of %d entries missing or not finite, %d written beyond", name, untouched, n,
            beyond);
  selftest_record (x->report, "size", untouched + beyond, 0, "exact", where);
}

/* probe_g, ...: the function of this name, which fills `count` numbers. */
#define PROBE_FUNCTION(function, count)                           \
  static void probe_##function (probe *x, double *out) {          \
    probe_evaluate (x, x->kind->function, #function, count, out); \
  }
PROBE_FUNCTION (g, x->elements * x->rows)
PROBE_FUNCTION (g_size, x->elements * x->rows)
PROBE_FUNCTION (eta, x->elements * x->rows)
PROBE_FUNCTION (J, x->elements * x->rows * x->cols)
PROBE_FUNCTION (gamma, x->elements * x->rows)
PROBE_FUNCTION (force, x->elements * x->cols)
PROBE_FUNCTION (energy, x->elements)
PROBE_FUNCTION (power, x->elements)
PROBE_FUNCTION (loss, x->elements)

static int probe_ground (const probe *x, int e, int c) {
  return pw_global (x->batch, e, c) >= x->s->coords;
}

static double probe_local (const probe *x, const double *vector, int e, int c) {
  return probe_ground (x, e, c) ? 0 : vector[pw_global (x->batch, e, c)];
}

/* out += factor x block x vector, element by element: the block has `rows` rows per element, the vector an entry for
 * each coordinate of the scene.  terms, unless NULL, += absolute values of the terms. */
static void probe_multiply (const probe *x, const double *block, int rows, const double *vector, double factor,
                            double *out, double *terms) {
  for (int i = 0; i < x->elements * rows; i++)
    for (int c = 0; c < x->cols; c++) {
      double term = factor * block[i * x->cols + c] * probe_local (x, vector, i / rows, c);
      out[i] += term;
      if (terms) terms[i] += fabs (term);
    }
}

static void probe_multiply_J (probe *x, const double *vector, double *out) {
  probe_J (x, x->J);
  memset (out, 0, (size_t)(x->elements * x->rows) * sizeof *out);
  probe_multiply (x, x->J, x->rows, vector, 1, out, NULL);
}

/* J w */
static void probe_Jw (probe *x, double *out) {
  probe_J (x, x->J);
  for (int i = 0; i < x->elements * x->rows; i++) {
    out[i] = 0;
    for (int c = 0; c < x->cols; c++) out[i] += x->J[i * x->cols + c] * x->w[i / x->rows * x->cols + c];
  }
}

/* J v - eta */
static void probe_drift (probe *x, double *out) {
  probe_eta (x, x->eta);
  probe_multiply_J (x, x->v_now, out);
  for (int i = 0; i < x->elements * x->rows; i++) out[i] -= x->eta[i];
}

/* Central differences with a step of about eps^(1/3) = 6e-6 have an error of the order eps^(2/3) times the function's
 * size, from truncation and from round-off alike (Dennis & Schnabel 1983, section 5.6).  All numbers in the scene are
 * of the order 1, so the sizes of a function and of its third derivative are about the same. */
#define SELFTEST_STEP 0x1p-17
#define SELFTEST_BOUND (100 * cbrt (DBL_EPSILON) * cbrt (DBL_EPSILON))
static const char selftest_reason[] = "100 eps^(2/3) of the largest term: central differences";

/* The numbers that a function fills, with guards. */
typedef double selftest_numbers[PW_SCENE_OUT + PROBE_GUARD];

static double selftest_largest (int n, const double *y) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (y[i]));
  return most;
}

/* The derivatives of n values of f along a move.  Returns the largest value. */
static double selftest_derivative (probe *x, probe_function *f, probe_move move, int n, double *derivative) {
  selftest_numbers plus, minus;
  probe_update (x, move, SELFTEST_STEP);
  f (x, plus);
  probe_update (x, move, -SELFTEST_STEP);
  f (x, minus);
  probe_update (x, move, 0);
  for (int i = 0; i < n; i++) derivative[i] = (plus[i] - minus[i]) / (2 * SELFTEST_STEP);
  return selftest_largest (n, plus);
}

/* Compares elements x rows x cols entries, except columns of the ground, for which there is no reference, relative to
 * the larger of 1 + size and the largest reference; size: the largest value of the function differenced. */
static void selftest_compare (probe *x, const char *check, int rows, int cols, double size, const double *value,
                              const double *reference) {
  int n = x->elements * rows * cols, at = 0;
  double worst = -1, scale = fmax (1 + size, selftest_largest (n, reference));
  for (int i = 0; i < n; i++) {
    if (cols == x->cols && probe_ground (x, i / (rows * cols), i % cols)) continue;
    double error = fabs (value[i] - reference[i]) / scale;
    if (isnan (error)) error = INFINITY;
    if (error > worst) worst = error, at = i;
  }
  char where[120];
  snprintf (where, sizeof where, "%s, row %d, column %d: %.9g, expected %.9g", x->batch->name[at / (rows * cols)],
            at / cols % rows, at % cols, value[at], reference[at]);
  selftest_record (x->report, check, worst, SELFTEST_BOUND, selftest_reason, where);
}

static void selftest_block (probe *x, pw_block block, double size) {
  selftest_numbers value, reference;
  int rows = pw_block_rows (x->kind, block);
  pw_batch_function *function = pw_block_function (x->kind, block);
  if (function == pw_by_differences) return; /* it would be compared with itself */
  probe_evaluate (x, function, selftest_block_name[block], x->elements * rows * x->cols, value);
  for (int e = 0; e < x->elements; e++)
    pw_difference (x->workspace, x->batch, e, block, reference + e * rows * x->cols);
  selftest_compare (x, selftest_block_name[block], rows, x->cols, size, value, reference);
}

static void selftest_holonomic (probe *x) {
  selftest_numbers value, reference;
  int n = x->elements * x->rows;
  double size = selftest_derivative (x, probe_g, PROBE_TIME, n, reference);
  for (int i = 0; i < n; i++) reference[i] = -reference[i];
  probe_eta (x, value);
  selftest_compare (x, "eta", x->rows, 1, size, value, reference);
  selftest_block (x, PW_G_Q, size);

  probe_g (x, reference);
  probe_g_size (x, value);
  /* a sufficient g_size is its own reference */
  for (int i = 0; i < n; i++) reference[i] = fmax (value[i], fabs (reference[i]));
  selftest_compare (x, "g_size", x->rows, 1, size, value, reference);
}

static void selftest_gamma (probe *x) {
  selftest_numbers value, gamma, reference;
  int n = x->elements * x->rows;
  double size = selftest_derivative (x, probe_drift, PROBE_MOTION, n, reference);
  probe_multiply_J (x, x->a, value);
  probe_gamma (x, gamma);
  for (int i = 0; i < n; i++) value[i] -= gamma[i];
  selftest_compare (x, "gamma", x->rows, 1, size, value, reference);
}

static void selftest_J_gamma (probe *x) {
  selftest_numbers J, gamma, both_J, both_gamma;
  int rows = x->elements * x->rows, differences = 0;
  probe_J (x, J);
  probe_gamma (x, gamma);
  x->kind->J_gamma (&x->batch->b, both_J, both_gamma);
  for (int i = 0; i < rows * x->cols; i++) differences += J[i] != both_J[i];
  for (int i = 0; i < rows; i++) differences += gamma[i] != both_gamma[i];
  selftest_record (x->report, "J_gamma", differences, 0, "exact", "");
}

static void selftest_shift (probe *x, int u, double h) {
  for (int e = 0; e < x->elements; e++) *x->batch->source[e * x->kind->signals + u].u += h;
}

/* The derivative by_u, called `name`, of f, which has `count` numbers per element, with respect to the signals. */
static void selftest_by_signals (probe *x, const char *name, pw_batch_function *by_u, probe_function *f, int count) {
  selftest_numbers value, reference, plus, minus;
  int signals = x->kind->signals, n = x->elements * count;
  for (int u = 0; u < signals; u++) {
    selftest_shift (x, u, SELFTEST_STEP);
    f (x, plus);
    selftest_shift (x, u, -2 * SELFTEST_STEP);
    f (x, minus);
    selftest_shift (x, u, SELFTEST_STEP);
    for (int i = 0; i < n; i++) reference[i * signals + u] = (plus[i] - minus[i]) / (2 * SELFTEST_STEP);
  }
  probe_evaluate (x, by_u, name, n * signals, value);
  selftest_compare (x, name, count * signals, 1, selftest_largest (n, plus), value, reference);
}

static void selftest_signals (probe *x) {
  const pw_kind *kind = x->kind;
  selftest_by_signals (x, "force_u", kind->force_u, probe_force, x->cols);
  if (!pw_kind_signals_feedback (kind)) return;
  selftest_by_signals (x, "J_u", kind->J_u, probe_J, x->rows * x->cols);
  selftest_by_signals (x, "eta_u", kind->eta_u, probe_eta, x->rows);
  selftest_by_signals (x, "gamma_u", kind->gamma_u, probe_gamma, x->rows);
}

static void selftest_constant (probe *x) {
  selftest_numbers before, after;
  int n = x->elements * x->cols, changed = 0;
  probe_force (x, before);
  probe_update (x, PROBE_MOTION, 1);
  probe_force (x, after);
  probe_update (x, PROBE_MOTION, 0);
  for (int i = 0; i < n; i++) changed += before[i] != after[i];
  selftest_record (x->report, "constant", changed, 0, "exact", "");
}

static void selftest_blocks (probe *x) {
  selftest_numbers J, gamma, force;
  int n = x->elements * x->rows;
  probe_update (x, PROBE_TIME, 0);
  probe_J (x, J);
  probe_gamma (x, gamma);
  probe_force (x, force);
  double size_J = selftest_largest (n * x->cols, J), size_gamma = selftest_largest (n, gamma);
  if (x->rows > 0) {
    selftest_block (x, PW_JW_Q, size_J);
    selftest_block (x, PW_ETA_Q, 0);
    selftest_block (x, PW_GAMMA_Q, size_gamma);
    selftest_block (x, PW_GAMMA_V, size_gamma);
  }
  double size_force = selftest_largest (x->elements * x->cols, force);
  selftest_block (x, PW_FORCE_Q, size_force);
  selftest_block (x, PW_FORCE_V, size_force);
}

static void selftest_at_speed (probe *x, double factor, void (*check) (probe *x)) {
  double v[PW_SCENE_COORDS];
  memcpy (v, x->v, (size_t)x->s->coords * sizeof *v);
  for (int j = 0; j < x->s->coords; j++) x->v[j] *= factor;
  probe_update (x, PROBE_TIME, 0);
  check (x);
  memcpy (x->v, v, (size_t)x->s->coords * sizeof *v);
}

/* Near rest, squares of velocities underflow to 0 and their inverses are infinite; results must still be finite. */
static void selftest_rest (probe *x) {
  static const pw_block blocks[] = { PW_GAMMA_Q, PW_GAMMA_V, PW_FORCE_Q, PW_FORCE_V };
  selftest_numbers out;
  probe_evaluate (x, x->kind->gamma, "gamma near rest", x->elements * x->rows, out);
  probe_evaluate (x, x->kind->force, "force near rest", x->elements * x->cols, out);
  probe_evaluate (x, x->kind->loss, "loss near rest", x->elements, out);
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    pw_batch_function *function = pw_block_function (x->kind, blocks[i]);
    int n = x->elements * pw_block_rows (x->kind, blocks[i]) * x->cols;
    if (function != pw_by_differences) probe_evaluate (x, function, "a derivative near rest", n, out);
  }
}

/* The change of the force of element e from `rest` when local velocity c changes from 0 to v. */
static double selftest_change (probe *x, int e, int c, double v, const double *rest) {
  selftest_numbers force;
  double change = 0;
  int j = pw_global (x->batch, e, c);
  x->v[j] = v;
  probe_update (x, PROBE_TIME, 0);
  probe_force (x, force);
  x->v[j] = 0;
  for (int i = e * x->cols; i < (e + 1) * x->cols; i++) change = fmax (change, fabs (force[i] - rest[i]));
  return change;
}

/* From rest, a hundredth of the declared saturation velocity, or of a large velocity if none is declared, must
 * change the force by at most half of the change by the whole velocity. */
static void selftest_saturation (probe *x) {
  const double large = 1000;
  selftest_numbers declared, rest;
  int cols = x->cols;
  probe_force (x, rest);
  for (int i = 0; i < x->elements * 2 * cols; i++) declared[i] = INFINITY;
  if (x->kind->saturation) x->kind->saturation (&x->batch->b, declared);
  for (int i = 0; i < x->elements * cols; i++) {
    int e = i / cols, c = i % cols;
    if (probe_ground (x, e, c)) continue;
    double velocity = declared[(2 * e + 1) * cols + c]; /* after the changes of coordinates of element e */
    if (!isfinite (velocity)) velocity = large;
    double all = selftest_change (x, e, c, velocity, rest);
    double part = selftest_change (x, e, c, velocity / 100, rest);
    if (all < 1e-9 * (1 + selftest_largest (x->elements * cols, rest))) continue; /* round-off */
    selftest_record (x->report, "saturation", part / all, 0.5, "a hundredth of the velocity, half of the change",
                     x->batch->name[e]);
  }
}

static double selftest_dot (int n, const double *x, const double *y) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

/* Satisfies J v = eta of element e by the change of v of least norm: its rows of J are made orthogonal (Gram-Schmidt).
 * Returns 0 if they are dependent. */
static int selftest_satisfy (probe *x, int e) {
  double row[PW_MAX_ROWS][PW_MAX_COLS + 1], square[PW_MAX_ROWS]; /* row: of J, with the entry of J v - eta at its end */
  const int n = x->cols;
  selftest_numbers off;
  probe_update (x, PROBE_TIME, 0);
  probe_drift (x, off);
  for (int r = 0; r < x->rows; r++) {
    for (int c = 0; c < n; c++) row[r][c] = probe_ground (x, e, c) ? 0 : x->J[(e * x->rows + r) * n + c];
    row[r][n] = off[e * x->rows + r];
    for (int p = 0; p < r; p++) {
      double along = selftest_dot (n, row[p], row[r]) / square[p];
      for (int c = 0; c <= n; c++) row[r][c] -= along * row[p][c];
    }
    square[r] = selftest_dot (n, row[r], row[r]);
    if (!(square[r] > 1e-6)) return 0; /* entries of J are of the order 1 */
    for (int c = 0; c < n; c++)
      if (!probe_ground (x, e, c)) x->v[pw_global (x->batch, e, c)] -= row[r][c] * row[r][n] / square[r];
  }
  return 1;
}

/* The power of the forces of element e on its bodies, including constraint forces -J^T lambda, must equal the supplied
 * power minus losses and the rate of its potential energy.  A type without the function `power` supplies -lambda . eta
 * by its constraints. */
static void selftest_power_of (probe *x, int e) {
  selftest_numbers derivative, force, power, loss, Jv;
  double sum = 0, size = selftest_derivative (x, probe_energy, PROBE_MOTION, x->elements, derivative);
  probe_force (x, force);
  probe_power (x, power);
  probe_loss (x, loss);
  size = fmax (size, fmax (fabs (power[e]), fabs (loss[e])));
  for (int c = 0; c < x->cols; c++) sum += force[e * x->cols + c] * probe_local (x, x->v, e, c);
  if (x->rows > 0) {
    probe_multiply_J (x, x->v, Jv);
    probe_eta (x, x->eta);
  }
  for (int r = e * x->rows; r < (e + 1) * x->rows; r++) {
    sum -= x->lambda[r] * Jv[r];
    if (x->kind->power == NULL) power[e] -= x->lambda[r] * x->eta[r];
  }
  double error = fabs (sum + derivative[e] - power[e] + loss[e]) / (1 + size + fabs (sum));
  char where[120];
  snprintf (where, sizeof where, "%s: %.9g, expected %.9g", x->batch->name[e], sum, power[e] - loss[e] - derivative[e]);
  selftest_record (x->report, "power", error, SELFTEST_BOUND, selftest_reason, where);
  if (x->kind->loss && x->kind->limits == NULL)
    selftest_record (x->report, "loss", fmax (-loss[e], 0), 0, "exact", where);
}

static void selftest_power (probe *x) {
  double v[PW_SCENE_COORDS];
  if (!x->kind->force && !x->kind->energy && !x->kind->power && !x->kind->loss && !x->kind->limits) return;
  for (int e = 0; e < x->elements; e++) {
    int slides = 0; /* velocity constraints that need not hold: their multipliers then have power */
    for (int r = 0; r < x->rows && x->kind->level == PW_NONHOLONOMIC; r++)
      slides |= pw_is_limited (x->s, x->batch->row + e * x->rows + r);
    memcpy (v, x->v, (size_t)x->s->coords * sizeof *v);
    if (x->rows == 0 || slides || selftest_satisfy (x, e)) selftest_power_of (x, e);
    memcpy (x->v, v, (size_t)x->s->coords * sizeof *v);
  }
}

/* Bodies near the corners of a square, everything else at random. */
static void selftest_randomise (probe *x, pw_random *r) {
  static const double corner[PW_SCENE_BODIES][2] = { { 2, 2 }, { -2, 2 }, { -2, -2 }, { 2, -2 } };
  x->t = pw_random_between (r, 0.1, 3);
  x->tau = 1;
  for (int j = 0; j < x->s->coords; j++) {
    x->q[j] =
        pw_is_angle (x->s, j) ? pw_random_between (r, -3, 3) : corner[j / 3][j % 3] + pw_random_between (r, -0.5, 0.5);
    x->v[j] = pw_random_between (r, -1.5, 1.5);
    x->a[j] = pw_random_between (r, -1.5, 1.5);
  }
  for (int i = 0; i < x->elements * x->cols; i++) x->w[i] = pw_random_between (r, -1.5, 1.5);
  for (int i = 0; i < x->elements * x->rows; i++) x->lambda[i] = pw_random_between (r, -1.5, 1.5);
}

static void selftest_all (probe *x) {
  selftest_numbers out;
  probe_update (x, PROBE_TIME, 0);
  if (x->kind->level == PW_HOLONOMIC) selftest_holonomic (x);
  if (x->rows > 0) selftest_gamma (x);
  if (x->kind->J_gamma) selftest_J_gamma (x);
  if (x->kind->signals > 0) selftest_signals (x);
  if (x->kind->constant) selftest_constant (x);
  selftest_blocks (x);
  selftest_at_speed (x, 1e-310, selftest_rest);
  if (x->kind->force && !x->kind->constant) selftest_at_speed (x, 0, selftest_saturation);
  if (!x->kind->first_order) selftest_power (x);
  probe_evaluate (x, x->kind->contact, "contact", 3 * x->elements, out);
}

int pw_selftest (const pw_kind *kind, unsigned seed, pw_selftest_report *report, pw_error *error) {
  char buffer[200];
  if (pw_require (kind, "an element type", error) != PW_OK || pw_require (report, "a report", error) != PW_OK)
    return PW_INPUT;
  const char *fault = pw_kind_check (kind, buffer, sizeof buffer);
  selftest_record (report, "table", *fault != 0, 0, "exact", fault);
  if (*fault) return PW_OK;
  pw_random random = { seed };
  pw_error cause = { 0 };
  pw_system *s = pw_random_scene (kind, &random, &cause);
  if (s == NULL) return pw_fail (error, cause.status, "%s", cause.text);
  pw_workspace *w = pw_workspace_new (s, error);
  probe x = { .s = s, .workspace = w, .batch = w ? w->batch : NULL, .check_sizes = 1, .report = report };
  int status = w ? probe_open (&x, error) : PW_RESOURCE;
  if (status == PW_OK) {
    selftest_randomise (&x, &random);
    selftest_all (&x);
  }
  free (x.memory);
  pw_workspace_free (w);
  pw_system_free (s);
  return status;
}

/* In a scene that uses the type, with its elements, signals, parameters and configuration: the scene moves randomly
 * around the configuration, in its units.  The type's derivatives along that motion are compared with differences over
 * steps from 2^-8 to 2^-20; for each entry the least error counts.  A correct formula agrees with one of them whatever
 * its scale; a wrong one differs from all by about its magnitude. */

#define SCENE_BOUND 1e-5
static const char scene_reason[] = "1e-5 of the sum of all terms: the best of several differences";

/* Updates the least error of each entry by differences with step h. */
static void scene_differences (probe *x, probe_function *f, probe_move move, int rows, double h) {
  int n = x->elements * rows;
  static const double weight[] = { 4. / 3, -1. / 3 }; /* of steps h and 2 h: Richardson extrapolation */
  for (int k = 0; k < n; k++) x->derivative[k] = 0;
  for (int i = 0; i < 2; i++) {
    double far = ldexp (h, i);
    probe_update (x, move, far);
    f (x, x->plus);
    probe_update (x, move, -far);
    f (x, x->minus);
    for (int k = 0; k < n; k++) x->derivative[k] += weight[i] * (x->plus[k] - x->minus[k]) / (2 * far);
  }
  for (int k = 0; k < n; k++) {
    double noise = /* round-off of f, divided by h, and of x->value; 256: a factor for the number of operations */
        256 * DBL_EPSILON * ((fabs (x->plus[k]) + x->size[k]) / h + selftest_largest (rows, x->terms + k - k % rows));
    double excess = fabs (x->value[k] - x->derivative[k]) - noise;
    double error = fmax (0, excess) / (x->terms[k] + fabs (x->derivative[k]) + DBL_MIN);
    if (isfinite (excess) && error < x->error[k]) x->error[k] = error, x->expected[k] = x->derivative[k];
  }
}

/* Compares x->value, `rows` per element, with the derivative of f, given x->terms and x->size.  Clears these
 * three arrays. */
static void scene_compare (probe *x, const char *check, int rows, probe_function *f, probe_move move) {
  int n = x->elements * rows, at = 0;
  char where[120] = "";
  for (int k = 0; k < n; k++) x->error[k] = INFINITY, x->expected[k] = NAN;
  for (int power = -8; power >= -20; power -= 4) scene_differences (x, f, move, rows, ldexp (1, power));
  probe_update (x, PROBE_Q, 0);
  for (int k = 0; k < n; k++)
    if (!(x->error[k] <= x->error[at])) at = k;
  if (n > 0)
    snprintf (where, sizeof where, "%s %s, row %d: %.9g, expected %.9g", x->kind->name, x->batch->name[at / rows],
              at % rows, x->value[at], x->expected[at]);
  selftest_record (x->report, check, n > 0 ? x->error[at] : 0, SCENE_BOUND, scene_reason, where);
  for (int i = 0; i < x->elements * x->width; i++) x->value[i] = x->terms[i] = x->size[i] = 0;
}

static void scene_block (probe *x, pw_block block, probe_function *f) {
  int rows = pw_block_rows (x->kind, block);
  probe_move move = block == PW_GAMMA_V || block == PW_FORCE_V ? PROBE_V : PROBE_Q;
  if (pw_evaluate_block (x->workspace, x->batch, block, x->block))
    probe_multiply (x, x->block, rows, move == PROBE_V ? x->dv : x->dq, 1, x->value, x->terms);
  scene_compare (x, selftest_block_name[block], rows, f, move);
}

static void scene_signals (probe *x, double *out) {
  for (int i = 0; i < x->elements * x->kind->signals; i++) out[i] = *x->batch->source[i].u;
}

static void scene_gradients (probe *x, probe_move move) {
  int signals = x->kind->signals, coords = x->s->coords;
  for (int i = 0; i < x->elements * signals; i++) {
    const pw_source *source = &x->batch->source[i];
    for (int k = 0; k < source->reads; k++) {
      int j = source->state[k], velocity = j >= coords;
      if (velocity != (move == PROBE_V)) continue;
      double gradient = source->of_coordinate ? source->u[1] : source->x[source->reads + k];
      double term = gradient * (velocity ? x->dv[j - coords] : x->dq[j]);
      x->value[i] += term, x->terms[i] += fabs (term);
    }
  }
  scene_compare (x, "gradient", signals, scene_signals, move);
}

static void scene_all (probe *x) {
  const pw_kind *kind = x->kind;
  const int n = x->elements * x->rows;
  double *gamma = x->derivative; /* not used before the comparison */
  probe_update (x, PROBE_Q, 0);
  if (kind->level == PW_HOLONOMIC) {
    probe_g_size (x, x->size);
    scene_block (x, PW_G_Q, probe_g);
    probe_eta (x, x->value);
    for (int i = 0; i < n; i++) x->value[i] *= -x->tau;
    scene_compare (x, "eta", x->rows, probe_g, PROBE_TIME);
  }
  if (kind->rows > 0) {
    probe_gamma (x, gamma);
    probe_J (x, x->block);
    probe_multiply (x, x->block, x->rows, x->a, x->tau, x->value, x->terms);
    for (int i = 0; i < n; i++) x->value[i] -= x->tau * gamma[i], x->terms[i] += fabs (x->tau * gamma[i]);
    scene_compare (x, "gamma", x->rows, probe_drift, PROBE_MOTION);
  }
  if (x->s->state_dependent) {
    scene_gradients (x, PROBE_Q);
    scene_gradients (x, PROBE_V);
  }
  pw_hold_signals (x->workspace, PW_HOLD_ALL); /* blocks exclude the dependence of signals on the state */
  if (kind->rows > 0) {
    scene_block (x, PW_JW_Q, probe_Jw);
    scene_block (x, PW_ETA_Q, probe_eta);
    scene_block (x, PW_GAMMA_Q, probe_gamma);
    scene_block (x, PW_GAMMA_V, probe_gamma);
  }
  scene_block (x, PW_FORCE_Q, probe_force);
  scene_block (x, PW_FORCE_V, probe_force);
  pw_hold_signals (x->workspace, PW_HOLD_NONE);
}

static int scene_randomise (probe *x, const double *q, const double *v, pw_random *r, pw_error *error) {
  double T = x->workspace->scale.time, *w = x->v_now; /* w of jw_q; not used before the update */
  for (int j = 0; j < x->s->coords; j++) {
    double unit = pw_unit (x->s, j);
    x->q[j] = q[j] + ldexp (unit, -10) * pw_random_between (r, -1, 1); /* beside kinks and jumps of signals at q */
    x->v[j] = v[j] + unit / T * pw_random_between (r, -1, 1);
    x->a[j] = unit / T / T * pw_random_between (r, -1, 1);
    x->dq[j] = unit * pw_random_between (r, -1, 1);
    x->dv[j] = unit / T * pw_random_between (r, -1, 1);
    w[j] = unit * pw_random_between (r, -1, 1);
  }
  for (int i = 0; i < x->elements * x->cols; i++) x->w[i] = probe_local (x, w, i / x->cols, i % x->cols);
  for (int i = 0; i < x->elements * x->rows; i++) x->lambda[i] = pw_random_between (r, -1, 1);
  /* no signal has a breakpoint between the times used, which are later than one that is too near for differences */
  double next = pw_next_breakpoint (x->workspace, 0, x->t);
  if (next - x->t < 1e-6 * fabs (x->t)) x->t = next, next = pw_next_breakpoint (x->workspace, 0, next);
  char signal[PW_NAME_BYTES];
  if (isnan (next))
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s: its breakpoint function returned a time that is not later", x->t,
                    pw_failed_signal (x->workspace, signal, sizeof signal));
  x->tau = fmin (T, next - x->t) / 2;
  x->t += x->tau;
  for (int i = 0; i < x->s->sources; i++) x->workspace->source[i].gradient = x->workspace->source[i].reads > 0;
  probe_update (x, PROBE_Q, 0);
  for (int j = x->s->mechanical; j < x->s->coords; j++) x->a[j] = pw_rate_source (x->workspace, j)->u[0];
  return PW_OK;
}

int pw_selftest_scene (const pw_system *s, double T, const pw_kind *kind, double t, const double *q, const double *v,
                       unsigned seed, pw_selftest_report *report, pw_error *error) {
  pw_random random = { seed };
  pw_workspace *w = pw_workspace_new (s, error);
  if (w == NULL) return s ? PW_RESOURCE : PW_INPUT;
  w->scale.time = T;
  probe x = { .s = s, .workspace = w, .batch = w->batch, .t = t, .report = report };
  while (x.batch < w->batch + s->batches && x.batch->kind != kind) x.batch++;
  int status = PW_OK;
  if (x.batch < w->batch + s->batches && x.batch->b.count > 0) {
    status = probe_open (&x, error);
    if (status == PW_OK) status = scene_randomise (&x, q, v, &random, error);
    if (status == PW_OK) scene_all (&x);
    if (x.failed) status = pw_fail_evaluation (w, x.t, error);
  }
  if (status != PW_OK) *report = (pw_selftest_report){ 0 }; /* checks with a failed signal mean nothing */
  free (x.memory);
  pw_workspace_free (w);
  return status;
}

static char *differences_name (const pw_kind *kind, int block, char *buffer, size_t size) {
  return pw_print (buffer, size, "%s of element type %s", selftest_block_name[block], kind->name);
}

/* "" after the last one.  PW_JTL_Q is not counted, a type gives it by jw_q; nor are those of built-in types. */
char *pw_system_difference_name (const pw_system *s, int i, char *buffer, size_t size) {
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++)
    for (int block = 0; block < PW_BLOCKS && !pw_kind_is_built_in (k->kind); block++)
      if (block != PW_JTL_Q && pw_block_function (k->kind, (pw_block)block) == pw_by_differences && i-- == 0)
        return differences_name (k->kind, block, buffer, size);
  return pw_print (buffer, size, "%s", "");
}

int pw_system_differences (const pw_system *s) {
  int count = 0;
  while (*PW_NAME (pw_system_difference_name, s, count)) count++;
  return count;
}

/* Searches the first, the last and a middle element of a batch, with random k->b.w, multipliers and signals.  Returns
 * as pw_find_missing_block. */
static int differences_search (pw_workspace *w, pw_element_batch *k, pw_random *random, char *buffer, size_t size) {
  const int element[] = { 0, k->b.count - 1, k->b.count / 2 };
  int cols = k->b.count * k->b.cols, rows = k->b.count * k->kind->rows, found = 0;
  double *x = malloc (((size_t)cols + (size_t)rows + 1) * sizeof *x);
  if (x == NULL) return PW_RESOURCE;
  for (int i = 0; i < cols + rows; i++) x[i] = pw_random_between (random, -1, 1);
  for (int i = 0; i < 3 * k->b.count * k->kind->signals; i++) k->source->u[i] = pw_random_between (random, -1, 1);
  k->b.w = x, k->b.lambda = x + cols;
  for (int i = 0; i < 3 * PW_BLOCKS && k->b.count > 0 && !found; i++) {
    found = pw_block_missing (w, k, element[i % 3], (pw_block)(i / 3));
    if (found) differences_name (k->kind, i / 3, buffer, size);
  }
  k->b.w = k->b.lambda = NULL;
  free (x);
  return found;
}

int pw_find_missing_block (pw_workspace *w, double t, const double *q, const double *v, char *buffer, size_t size) {
  const pw_system *s = w->s;
  const pw_source *failed = w->failed;
  pw_random random = { 1 };
  int not_built_in = 0, found = 0;
  for (pw_element_batch *k = w->batch; k < w->batch + s->batches; k++) not_built_in += !pw_kind_is_built_in (k->kind);
  if (not_built_in == 0) return 0;
  /* near the given state, at which blocks may vanish by chance or by symmetry */
  double *state = malloc ((2 * (size_t)s->coords + 1) * sizeof *state);
  if (state == NULL) return PW_RESOURCE;
  for (int i = 0; i < 2 * s->coords; i++) {
    int velocity = i >= s->coords, j = velocity ? i - s->coords : i;
    double unit = pw_unit (s, j) / (velocity ? w->scale.time : 1);
    state[i] = (velocity ? v[j] : q[j]) + 0.1 * unit * pw_random_between (&random, -1, 1);
  }
  (void)pw_update_kinematics (w, t, state, state + s->coords); /* signals may fail: random ones replace them */
  for (pw_element_batch *k = w->batch; found == 0 && k < w->batch + s->batches; k++)
    if (!pw_kind_is_built_in (k->kind)) found = differences_search (w, k, &random, buffer, size);
  free (state);
  w->failed = failed;
  w->t_signal = NAN; /* the search has changed the values of signals */
  return found;
}
