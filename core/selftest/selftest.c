/* The self-test of an element type in random scenes: most checks compare one function of its table with differences of
 * another. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"
#include "selftest.h"

/* Central differences with a step of about eps^(1/3) = 6e-6 have an error of the order eps^(2/3) times the function's
 * size, from truncation and from round-off alike (Dennis & Schnabel 1983, section 5.6).  All numbers in the scene are
 * of the order 1, so the sizes of a function and of its third derivative are about the same. */
#define SELFTEST_STEP 0x1p-17
#define SELFTEST_BOUND (100 * cbrt (DBL_EPSILON) * cbrt (DBL_EPSILON))
static const char selftest_reason[] = "100 eps^(2/3) of the largest term: central differences";

/* The numbers that a function fills, with guards. */
typedef double selftest_numbers[PW_PROBE_OUT + PW_PROBE_GUARD];

static double selftest_largest (int n, const double *y) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (y[i]));
  return most;
}

/* The derivatives of n values of f along a move.  Returns the largest value. */
static double selftest_derivative (pw_probe *probe, pw_probe_function *f, pw_probe_move move, int n,
                                   double *derivative) {
  selftest_numbers plus, minus;
  pw_probe_update (probe, move, SELFTEST_STEP);
  f (probe, plus);
  pw_probe_update (probe, move, -SELFTEST_STEP);
  f (probe, minus);
  pw_probe_update (probe, move, 0);
  for (int i = 0; i < n; i++) derivative[i] = (plus[i] - minus[i]) / (2 * SELFTEST_STEP);
  return selftest_largest (n, plus);
}

/* Compares elements x rows x cols entries, except columns of the ground, for which there is no reference, relative to
 * the larger of 1 + size and the largest reference; size: the largest value of the function differenced. */
static void selftest_compare (pw_probe *probe, pw_check check, int rows, int cols, double size, const double *value,
                              const double *reference) {
  int n = probe->elements * rows * cols, at = 0;
  double worst = -1, scale = fmax (1 + size, selftest_largest (n, reference));
  for (int i = 0; i < n; i++) {
    if (cols == probe->cols && pw_probe_ground (probe, i / (rows * cols), i % cols)) continue;
    double error = fabs (value[i] - reference[i]) / scale;
    if (isnan (error)) error = INFINITY;
    if (error > worst) worst = error, at = i;
  }
  char where[120];
  snprintf (where, sizeof where, "%s, row %d, column %d: %.9g, expected %.9g", probe->batch->name[at / (rows * cols)],
            at / cols % rows, at % cols, value[at], reference[at]);
  pw_probe_record (probe->report, check, worst, SELFTEST_BOUND, selftest_reason, where);
}

/* ---- First-order checks ---- */

static void selftest_holonomic (pw_probe *probe) {
  selftest_numbers value, reference = { 0 }, derivative;
  double size = 0;
  int n = probe->elements * probe->rows;
  for (int j = 0; j < probe->s->coords; j++) {
    for (int i = 0; i < probe->s->coords; i++) probe->dq[i] = i == j;
    size = selftest_derivative (probe, pw_probe_g, PW_PROBE_Q, n, derivative);
    for (int i = 0; i < n * probe->cols; i++)
      if (pw_global (probe->batch, i / (probe->rows * probe->cols), i % probe->cols) == j)
        reference[i] = derivative[i / probe->cols];
  }
  pw_probe_J (probe, value);
  selftest_compare (probe, PW_CHECK_J, probe->rows, probe->cols, size, value, reference);

  size = selftest_derivative (probe, pw_probe_g, PW_PROBE_TIME, n, reference);
  for (int i = 0; i < n; i++) reference[i] = -reference[i];
  pw_probe_eta (probe, value);
  selftest_compare (probe, PW_CHECK_eta, probe->rows, 1, size, value, reference);

  pw_probe_g (probe, reference);
  pw_probe_g_size (probe, value);
  /* a sufficient g_size is its own reference */
  for (int i = 0; i < n; i++) reference[i] = fmax (value[i], fabs (reference[i]));
  selftest_compare (probe, PW_CHECK_g_size, probe->rows, 1, size, value, reference);
}

static void selftest_gamma (pw_probe *probe) {
  selftest_numbers value, gamma, reference;
  int n = probe->elements * probe->rows;
  double size = selftest_derivative (probe, pw_probe_drift, PW_PROBE_MOTION, n, reference);
  pw_probe_multiply_J (probe, probe->a, value);
  pw_probe_gamma (probe, gamma);
  for (int i = 0; i < n; i++) value[i] -= gamma[i];
  selftest_compare (probe, PW_CHECK_gamma, probe->rows, 1, size, value, reference);
}

/* Adds h to signal u of each element. */
static void selftest_shift (pw_probe *probe, int u, double h) {
  for (int e = 0; e < probe->elements; e++) probe->batch->u[3 * (e * probe->kind->signals + u)] += h;
}

static void selftest_force_u (pw_probe *probe) {
  selftest_numbers value, reference, plus, minus;
  int signals = probe->kind->signals, n = probe->elements * probe->cols;
  for (int u = 0; u < signals; u++) {
    selftest_shift (probe, u, SELFTEST_STEP);
    pw_probe_force (probe, plus);
    selftest_shift (probe, u, -2 * SELFTEST_STEP);
    pw_probe_force (probe, minus);
    selftest_shift (probe, u, SELFTEST_STEP);
    for (int i = 0; i < n; i++) reference[i * signals + u] = (plus[i] - minus[i]) / (2 * SELFTEST_STEP);
  }
  pw_probe_evaluate (probe, probe->kind->force_u, "force_u", n * signals, value);
  selftest_compare (probe, PW_CHECK_force_u, probe->cols * signals, 1, selftest_largest (n, plus), value, reference);
}

static void selftest_constant (pw_probe *probe) {
  selftest_numbers before, after;
  int n = probe->elements * probe->cols, changed = 0;
  pw_probe_force (probe, before);
  pw_probe_update (probe, PW_PROBE_MOTION, 1);
  pw_probe_force (probe, after);
  pw_probe_update (probe, PW_PROBE_MOTION, 0);
  for (int i = 0; i < n; i++) changed += before[i] != after[i];
  pw_probe_record (probe->report, PW_CHECK_constant, changed, 0, "exact", "");
}

/* ---- Second-order blocks ---- */

static void selftest_block (pw_probe *probe, pw_block block, pw_check check, double size) {
  selftest_numbers value, reference;
  int rows = pw_block_rows (probe->kind, block);
  pw_batch_function *function = pw_block_function (probe->kind, block);
  if (function == pw_by_differences) return; /* it would be compared with itself */
  pw_probe_evaluate (probe, function, pw_check_name (check), probe->elements * rows * probe->cols, value);
  for (int e = 0; e < probe->elements; e++)
    pw_difference (probe->workspace, probe->batch, e, block, reference + e * rows * probe->cols);
  selftest_compare (probe, check, rows, probe->cols, size, value, reference);
}

static void selftest_blocks (pw_probe *probe) {
  selftest_numbers J, gamma, force;
  int n = probe->elements * probe->rows;
  pw_probe_update (probe, PW_PROBE_TIME, 0);
  pw_probe_J (probe, J);
  pw_probe_gamma (probe, gamma);
  pw_probe_force (probe, force);
  double size_J = selftest_largest (n * probe->cols, J), size_gamma = selftest_largest (n, gamma);
  if (probe->rows > 0) {
    selftest_block (probe, PW_JW_Q, PW_CHECK_jw_q, size_J);
    selftest_block (probe, PW_ETA_Q, PW_CHECK_eta_q, 0);
    selftest_block (probe, PW_GAMMA_Q, PW_CHECK_gamma_q, size_gamma);
    selftest_block (probe, PW_GAMMA_V, PW_CHECK_gamma_v, size_gamma);
  }
  double size_force = selftest_largest (probe->elements * probe->cols, force);
  selftest_block (probe, PW_FORCE_Q, PW_CHECK_force_q, size_force);
  selftest_block (probe, PW_FORCE_V, PW_CHECK_force_v, size_force);
}

/* Makes a check at velocities multiplied by a factor. */
static void selftest_at_speed (pw_probe *probe, double factor, void (*check) (pw_probe *probe)) {
  double v[PW_SCENE_COORDS];
  memcpy (v, probe->v, (size_t)probe->s->coords * sizeof *v);
  for (int j = 0; j < probe->s->coords; j++) probe->v[j] *= factor;
  pw_probe_update (probe, PW_PROBE_TIME, 0);
  check (probe);
  memcpy (probe->v, v, (size_t)probe->s->coords * sizeof *v);
}

/* Near rest, squares of velocities underflow to 0 and their inverses are infinite; results must still be finite. */
static void selftest_rest (pw_probe *probe) {
  static const pw_block blocks[] = { PW_GAMMA_Q, PW_GAMMA_V, PW_FORCE_Q, PW_FORCE_V };
  selftest_numbers out;
  pw_probe_evaluate (probe, probe->kind->gamma, "gamma near rest", probe->elements * probe->rows, out);
  pw_probe_evaluate (probe, probe->kind->force, "force near rest", probe->elements * probe->cols, out);
  pw_probe_evaluate (probe, probe->kind->loss, "loss near rest", probe->elements, out);
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    pw_batch_function *function = pw_block_function (probe->kind, blocks[i]);
    int n = probe->elements * pw_block_rows (probe->kind, blocks[i]) * probe->cols;
    if (function != pw_by_differences) pw_probe_evaluate (probe, function, "a derivative near rest", n, out);
  }
}

/* ---- Saturation ---- */

/* The change of the force of element e from `rest` when local velocity c changes from 0 to v. */
static double selftest_change (pw_probe *probe, int e, int c, double v, const double *rest) {
  selftest_numbers force;
  double change = 0;
  int j = pw_global (probe->batch, e, c);
  probe->v[j] = v;
  pw_probe_update (probe, PW_PROBE_TIME, 0);
  pw_probe_force (probe, force);
  probe->v[j] = 0;
  for (int i = e * probe->cols; i < (e + 1) * probe->cols; i++) change = fmax (change, fabs (force[i] - rest[i]));
  return change;
}

/* From rest, a hundredth of the declared saturation velocity, or of a large velocity if none is declared, must
 * change the force by at most half of the change by the whole velocity. */
static void selftest_saturation (pw_probe *probe) {
  const double large = 1000;
  selftest_numbers declared, rest;
  int cols = probe->cols;
  pw_probe_force (probe, rest);
  for (int i = 0; i < probe->elements * 2 * cols; i++) declared[i] = INFINITY;
  if (probe->kind->saturation) probe->kind->saturation (&probe->batch->b, declared);
  for (int i = 0; i < probe->elements * cols; i++) {
    int e = i / cols, c = i % cols;
    if (pw_probe_ground (probe, e, c)) continue;
    double velocity = declared[(2 * e + 1) * cols + c]; /* after the changes of coordinates of element e */
    if (!isfinite (velocity)) velocity = large;
    double all = selftest_change (probe, e, c, velocity, rest);
    double part = selftest_change (probe, e, c, velocity / 100, rest);
    if (all < 1e-9 * (1 + selftest_largest (probe->elements * cols, rest))) continue; /* round-off */
    pw_probe_record (probe->report, PW_CHECK_saturation, part / all, 0.5,
                     "a hundredth of the velocity, half of the change", probe->batch->name[e]);
  }
}

/* ---- Energy ---- */

/* x . y of n numbers */
static double selftest_dot (int n, const double *x, const double *y) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

/* Satisfies J v = eta of element e by the change of v of least norm: its rows of J are made orthogonal (Gram-Schmidt).
 * Returns 0 if they are dependent. */
static int selftest_satisfy (pw_probe *probe, int e) {
  double row[PW_MAX_ROWS][PW_MAX_COLS + 1], square[PW_MAX_ROWS]; /* row: of J, with the entry of J v - eta at its end */
  const int n = probe->cols;
  selftest_numbers off;
  pw_probe_update (probe, PW_PROBE_TIME, 0);
  pw_probe_drift (probe, off);
  for (int r = 0; r < probe->rows; r++) {
    for (int c = 0; c < n; c++) row[r][c] = pw_probe_ground (probe, e, c) ? 0 : probe->J[(e * probe->rows + r) * n + c];
    row[r][n] = off[e * probe->rows + r];
    for (int p = 0; p < r; p++) {
      double along = selftest_dot (n, row[p], row[r]) / square[p];
      for (int c = 0; c <= n; c++) row[r][c] -= along * row[p][c];
    }
    square[r] = selftest_dot (n, row[r], row[r]);
    if (!(square[r] > 1e-6)) return 0; /* entries of J are of the order 1 */
    for (int c = 0; c < n; c++)
      if (!pw_probe_ground (probe, e, c)) probe->v[pw_global (probe->batch, e, c)] -= row[r][c] * row[r][n] / square[r];
  }
  return 1;
}

/* The power of the forces of element e on its bodies, including constraint forces -J^T lambda, must equal the supplied
 * power minus losses and the rate of its potential energy.  A type without the function `power` supplies -lambda . eta
 * by its constraints. */
static void selftest_power_of (pw_probe *probe, int e) {
  selftest_numbers derivative, force, power, loss, Jv;
  double sum = 0, size = selftest_derivative (probe, pw_probe_energy, PW_PROBE_MOTION, probe->elements, derivative);
  pw_probe_force (probe, force);
  pw_probe_power (probe, power);
  pw_probe_loss (probe, loss);
  size = fmax (size, fmax (fabs (power[e]), fabs (loss[e])));
  for (int c = 0; c < probe->cols; c++) sum += force[e * probe->cols + c] * pw_probe_local (probe, probe->v, e, c);
  if (probe->rows > 0) {
    pw_probe_multiply_J (probe, probe->v, Jv);
    pw_probe_eta (probe, probe->eta);
  }
  for (int r = e * probe->rows; r < (e + 1) * probe->rows; r++) {
    sum -= probe->lambda[r] * Jv[r];
    if (probe->kind->power == NULL) power[e] -= probe->lambda[r] * probe->eta[r];
  }
  double error = fabs (sum + derivative[e] - power[e] + loss[e]) / (1 + size + fabs (sum));
  char where[120];
  snprintf (where, sizeof where, "%s: %.9g, expected %.9g", probe->batch->name[e], sum,
            power[e] - loss[e] - derivative[e]);
  pw_probe_record (probe->report, PW_CHECK_power, error, SELFTEST_BOUND, selftest_reason, where);
  if (probe->kind->loss) pw_probe_record (probe->report, PW_CHECK_loss, fmax (-loss[e], 0), 0, "exact", where);
}

static void selftest_power (pw_probe *probe) {
  double v[PW_SCENE_COORDS];
  if (!probe->kind->force && !probe->kind->energy && !probe->kind->power && !probe->kind->loss) return;
  for (int e = 0; e < probe->elements; e++) {
    memcpy (v, probe->v, (size_t)probe->s->coords * sizeof *v);
    if (probe->rows == 0 || selftest_satisfy (probe, e)) selftest_power_of (probe, e);
    memcpy (probe->v, v, (size_t)probe->s->coords * sizeof *v);
  }
}

/* Bodies near the corners of a square, everything else at random. */
static void selftest_randomise (pw_probe *probe, pw_random *r) {
  static const double corner[PW_SCENE_BODIES][2] = { { 2, 2 }, { -2, 2 }, { -2, -2 }, { 2, -2 } };
  probe->t = pw_random_between (r, 0.1, 3);
  probe->tau = 1;
  for (int j = 0; j < probe->s->coords; j++) {
    probe->q[j] = pw_random_between (r, -0.5, 0.5);
    if (pw_is_angle (probe->s, j))
      probe->q[j] = pw_random_between (r, -3, 3);
    else
      probe->q[j] += corner[j / 3][j % 3];
    probe->v[j] = pw_random_between (r, -1.5, 1.5);
    probe->a[j] = pw_random_between (r, -1.5, 1.5);
  }
  for (int i = 0; i < probe->elements * probe->cols; i++) probe->w[i] = pw_random_between (r, -1.5, 1.5);
  for (int i = 0; i < probe->elements * probe->rows; i++) probe->lambda[i] = pw_random_between (r, -1.5, 1.5);
}

static void selftest_all (pw_probe *probe) {
  selftest_numbers out;
  pw_probe_update (probe, PW_PROBE_TIME, 0);
  if (probe->kind->level == PW_HOLONOMIC) selftest_holonomic (probe);
  if (probe->rows > 0) selftest_gamma (probe);
  if (probe->kind->signals > 0) selftest_force_u (probe);
  if (probe->kind->constant) selftest_constant (probe);
  selftest_blocks (probe);
  selftest_at_speed (probe, 1e-310, selftest_rest);
  if (probe->kind->force && !probe->kind->constant) selftest_at_speed (probe, 0, selftest_saturation);
  selftest_power (probe);
  pw_probe_evaluate (probe, probe->kind->contact, "contact", 3 * probe->elements, out);
}

int pw_selftest (const pw_kind *kind, unsigned seed, pw_selftest_report *report, pw_error *error) {
  char buffer[200];
  if (pw_require (kind, "an element type", error) != PW_OK || pw_require (report, "a report", error) != PW_OK)
    return PW_INPUT;
  const char *fault = pw_kind_check (kind, buffer, sizeof buffer);
  pw_probe_record (report, PW_CHECK_table, *fault != 0, 0, "exact", fault);
  if (*fault) return PW_OK;
  pw_random random = { seed };
  pw_error cause = { 0 };
  pw_system *s = pw_random_scene (kind, &random, &cause);
  if (s == NULL) return pw_fail (error, cause.status, "%s", cause.text);
  pw_workspace *w = pw_workspace_new (s, error);
  pw_probe probe = { .s = s, .workspace = w, .batch = w ? w->batch : NULL, .check_sizes = 1, .report = report };
  int status = w ? pw_probe_open (&probe, error) : PW_RESOURCE;
  if (status == PW_OK) {
    selftest_randomise (&probe, &random);
    selftest_all (&probe);
  }
  free (probe.memory);
  pw_workspace_free (w);
  pw_system_free (s);
  return status;
}

/* The self-test of an element type in a scene that uses it, with the scene's elements, signals, parameters and
 * configuration.
 *
 * The scene moves randomly around the configuration, in its units.  The type's derivatives along that motion are
 * compared with differences over steps from 2^-8 to 2^-20; for each entry the least error counts.  A correct formula
 * agrees with one of them whatever its scale; a wrong one differs from all by about its magnitude. */

#define SCENE_BOUND 1e-5
static const char scene_reason[] = "1e-5 of the sum of all terms: the best of several differences";

typedef struct {
  pw_probe probe;
  int width; /* largest number of values per element in any comparison; arrays have elements x width entries */
  double *plus, *minus, *derivative; /* a function after steps forwards and backwards; its derivative by differences */
  double *value, *terms;             /* what is compared with it; the sum of the absolute values of its terms */
  double *size;                      /* in the check of J: g_size; in other checks: 0 */
  double *error, *expected;          /* the least error of all steps; the derivative by differences of that step */
  double *block;                     /* elements x width x width */
  char *memory;
} scene_test;

/* ---- Comparing ---- */

/* The largest of `terms` in the element of entry k: the round-off of test->value is proportional to it. */
static double scene_largest_term (const scene_test *test, int k, int rows) {
  double most = 0;
  for (int i = k - k % rows; i < k - k % rows + rows; i++) most = fmax (most, test->terms[i]);
  return most;
}

/* Updates the least error of each entry by differences with step h. */
static void scene_differences (scene_test *test, pw_probe_function *f, pw_probe_move move, int rows, double h) {
  int n = test->probe.elements * rows;
  static const double weight[] = { 4. / 3, -1. / 3 }; /* of steps h and 2 h: Richardson extrapolation */
  for (int k = 0; k < n; k++) test->derivative[k] = 0;
  for (int i = 0; i < 2; i++) {
    double far = ldexp (h, i);
    pw_probe_update (&test->probe, move, far);
    f (&test->probe, test->plus);
    pw_probe_update (&test->probe, move, -far);
    f (&test->probe, test->minus);
    for (int k = 0; k < n; k++) test->derivative[k] += weight[i] * (test->plus[k] - test->minus[k]) / (2 * far);
  }
  for (int k = 0; k < n; k++) {
    double noise = /* round-off of f, divided by h, and of test->value; 256: a factor for the number of operations */
        256 * DBL_EPSILON * ((fabs (test->plus[k]) + test->size[k]) / h + scene_largest_term (test, k, rows));
    double excess = fabs (test->value[k] - test->derivative[k]) - noise;
    double error = fmax (0, excess) / (test->terms[k] + fabs (test->derivative[k]) + DBL_MIN);
    if (isfinite (excess) && error < test->error[k]) test->error[k] = error, test->expected[k] = test->derivative[k];
  }
}

/* Compares test->value, `rows` per element, with the derivative of f, given test->terms and test->size.  Clears these
 * three arrays. */
static void scene_compare (scene_test *test, pw_check check, int rows, pw_probe_function *f, pw_probe_move move) {
  int n = test->probe.elements * rows, at = 0;
  char where[120] = "";
  for (int k = 0; k < n; k++) test->error[k] = INFINITY, test->expected[k] = NAN;
  for (int power = -8; power >= -20; power -= 4) scene_differences (test, f, move, rows, ldexp (1, power));
  pw_probe_update (&test->probe, PW_PROBE_Q, 0);
  for (int k = 0; k < n; k++)
    if (!(test->error[k] <= test->error[at])) at = k;
  if (n > 0)
    snprintf (where, sizeof where, "%s %s, row %d: %.9g, expected %.9g", test->probe.kind->name,
              test->probe.batch->name[at / rows], at % rows, test->value[at], test->expected[at]);
  pw_probe_record (test->probe.report, check, n > 0 ? test->error[at] : 0, SCENE_BOUND, scene_reason, where);
  for (int i = 0; i < test->probe.elements * test->width; i++) test->value[i] = test->terms[i] = test->size[i] = 0;
}

static void scene_holonomic (scene_test *test) {
  pw_probe_J (&test->probe, test->block);
  pw_probe_multiply (&test->probe, test->block, test->probe.rows, test->probe.dq, 1, test->value, test->terms);
  pw_probe_g_size (&test->probe, test->size);
  scene_compare (test, PW_CHECK_J, test->probe.rows, pw_probe_g, PW_PROBE_Q);
  pw_probe_eta (&test->probe, test->value);
  for (int i = 0; i < test->probe.elements * test->probe.rows; i++) test->value[i] *= -test->probe.tau;
  scene_compare (test, PW_CHECK_eta, test->probe.rows, pw_probe_g, PW_PROBE_TIME);
}

static void scene_acceleration (scene_test *test) {
  int n = test->probe.elements * test->probe.rows;
  double tau = test->probe.tau, *gamma = test->derivative; /* not used before the comparison */
  pw_probe_gamma (&test->probe, gamma);
  pw_probe_J (&test->probe, test->block);
  pw_probe_multiply (&test->probe, test->block, test->probe.rows, test->probe.a, tau, test->value, test->terms);
  for (int i = 0; i < n; i++) test->value[i] -= tau * gamma[i], test->terms[i] += fabs (tau * gamma[i]);
  scene_compare (test, PW_CHECK_gamma, test->probe.rows, pw_probe_drift, PW_PROBE_MOTION);
}

static void scene_block (scene_test *test, pw_block block, pw_check check, pw_probe_function *f) {
  int rows = pw_block_rows (test->probe.kind, block);
  pw_probe_move move = block == PW_GAMMA_V || block == PW_FORCE_V ? PW_PROBE_V : PW_PROBE_Q;
  if (pw_evaluate_block (test->probe.workspace, test->probe.batch, block, test->block))
    pw_probe_multiply (&test->probe, test->block, rows, move == PW_PROBE_V ? test->probe.dv : test->probe.dq, 1,
                       test->value, test->terms);
  scene_compare (test, check, rows, f, move);
}

static void scene_signals (pw_probe *probe, double *out) {
  for (int i = 0; i < probe->elements * probe->kind->signals; i++) out[i] = probe->batch->u[3 * i];
}

/* Compares the gradients of signals that read states. */
static void scene_gradients (scene_test *test, pw_probe_move move) {
  int signals = test->probe.kind->signals, coords = test->probe.s->coords;
  for (int i = 0; i < test->probe.elements * signals; i++) {
    const pw_source *source = &test->probe.batch->source[i];
    for (int k = 0; k < source->reads; k++) {
      int j = source->state[k], velocity = j >= coords;
      if (velocity != (move == PW_PROBE_V)) continue;
      double gradient = source->x[source->reads + k];
      double term = gradient * (velocity ? test->probe.dv[j - coords] : test->probe.dq[j]);
      test->value[i] += term, test->terms[i] += fabs (term);
    }
  }
  scene_compare (test, PW_CHECK_gradient, signals, scene_signals, move);
}

static void scene_all (scene_test *test) {
  const pw_kind *kind = test->probe.kind;
  pw_probe_update (&test->probe, PW_PROBE_Q, 0);
  if (kind->level == PW_HOLONOMIC) scene_holonomic (test);
  if (kind->rows > 0) {
    scene_acceleration (test);
    scene_block (test, PW_JW_Q, PW_CHECK_jw_q, pw_probe_Jw);
    scene_block (test, PW_ETA_Q, PW_CHECK_eta_q, pw_probe_eta);
    scene_block (test, PW_GAMMA_Q, PW_CHECK_gamma_q, pw_probe_gamma);
    scene_block (test, PW_GAMMA_V, PW_CHECK_gamma_v, pw_probe_gamma);
  }
  if (kind->force_u && test->probe.s->state_dependent) {
    scene_gradients (test, PW_PROBE_Q);
    scene_gradients (test, PW_PROBE_V);
  }
  pw_hold_signals (test->probe.workspace, 1); /* force_q and force_v exclude the dependence of signals on the state */
  scene_block (test, PW_FORCE_Q, PW_CHECK_force_q, pw_probe_force);
  scene_block (test, PW_FORCE_V, PW_CHECK_force_v, pw_probe_force);
  pw_hold_signals (test->probe.workspace, 0);
}

/* ---- The motion ---- */

static int scene_randomise (pw_probe *probe, const double *q, const double *v, pw_random *r, pw_error *error) {
  double T = probe->workspace->scale.time, *w = probe->v_now; /* w of jw_q; not used before the update */
  for (int j = 0; j < probe->s->coords; j++) {
    double unit = pw_unit (probe->s, j);
    probe->q[j] = q[j];
    probe->v[j] = v[j] + unit / T * pw_random_between (r, -1, 1);
    probe->a[j] = unit / T / T * pw_random_between (r, -1, 1);
    probe->dq[j] = unit * pw_random_between (r, -1, 1);
    probe->dv[j] = unit / T * pw_random_between (r, -1, 1);
    w[j] = unit * pw_random_between (r, -1, 1);
  }
  for (int i = 0; i < probe->elements * probe->cols; i++)
    probe->w[i] = pw_probe_local (probe, w, i / probe->cols, i % probe->cols);
  for (int i = 0; i < probe->elements * probe->rows; i++) probe->lambda[i] = pw_random_between (r, -1, 1);
  /* no signal has a breakpoint between the times used, which are later than one that is too near for differences */
  double next = pw_next_breakpoint (probe->workspace, 0, probe->t);
  if (next - probe->t < 1e-6 * fabs (probe->t)) probe->t = next, next = pw_next_breakpoint (probe->workspace, 0, next);
  char signal[PW_NAME_BYTES];
  if (isnan (next))
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s: its breakpoint function returned a time that is not later",
                    probe->t, pw_failed_signal (probe->workspace, signal, sizeof signal));
  probe->tau = fmin (T, next - probe->t) / 2;
  probe->t += probe->tau;
  return PW_OK;
}

static int scene_open (scene_test *test, pw_error *error) {
  if (pw_probe_open (&test->probe, error) != PW_OK) return PW_RESOURCE;
  test->width = test->probe.cols > test->probe.rows ? test->probe.cols : test->probe.rows;
  if (test->width < PW_MAX_SIGNALS) test->width = PW_MAX_SIGNALS;
  size_t values = (size_t)(test->probe.elements * test->width), n = values + PW_PROBE_GUARD;
  const pw_array array[] = {
    { &test->plus, n },  { &test->minus, n },    { &test->derivative, n },
    { &test->value, n }, { &test->terms, n },    { &test->error, n },
    { &test->size, n },  { &test->expected, n }, { &test->block, values * (size_t)test->width + PW_PROBE_GUARD },
  };
  test->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  return test->memory ? PW_OK : pw_fail_memory (test->probe.s, error);
}

int pw_selftest_scene (const pw_system *s, double T, const pw_kind *kind, double t, const double *q, const double *v,
                       unsigned seed, pw_selftest_report *report, pw_error *error) {
  pw_random random = { seed };
  pw_workspace *w = pw_workspace_new (s, error);
  if (w == NULL) return s ? PW_RESOURCE : PW_INPUT;
  w->scale.time = T;
  scene_test test = { .probe = { .s = s, .workspace = w, .batch = w->batch, .t = t, .report = report } };
  pw_probe *probe = &test.probe;
  const pw_element_batch *end = w->batch + s->batches;
  while (probe->batch < end && probe->batch->kind != kind) probe->batch++;
  int used = probe->batch < end && probe->batch->b.count > 0, status = used ? scene_open (&test, error) : PW_OK;
  if (used && status == PW_OK) status = scene_randomise (probe, q, v, &random, error);
  if (used && status == PW_OK) {
    scene_all (&test);
    if (probe->failed) status = pw_fail_evaluation (w, probe->t, error);
  }
  if (status != PW_OK) *report = (pw_selftest_report){ 0 }; /* checks with a failed signal mean nothing */
  free (test.memory);
  free (probe->memory);
  pw_workspace_free (w);
  return status;
}

/* The probe of the self-tests: see selftest.h. */

static const struct {
  const char *name, *about; /* as in pw_selftest_check */
} probe_checks[] = {
#define PW_PROBE_CHECK(name, about) { #name, about },
  PW_PROBE_CHECKS
};
_Static_assert(sizeof probe_checks / sizeof *probe_checks <= PW_SELFTEST_CHECKS, "a report has room for all checks");

const char *pw_check_name (pw_check check) {
  return probe_checks[check].name;
}

void pw_probe_record (pw_selftest_report *r, pw_check check, double error, double bound, const char *reason,
                      const char *where) {
  pw_selftest_check *c = r->check;
  while (c < r->check + r->checks && strcmp (c->name, probe_checks[check].name) != 0) c++;
  if (c == r->check + r->checks) {
    r->checks++;
    *c = (pw_selftest_check){ probe_checks[check].name, probe_checks[check].about, -1, bound, reason, .failed = 0 };
  }
  if (isnan (error)) error = INFINITY;
  if (!(error <= bound) && !c->failed) c->failed = 1, r->failed++;
  if (error <= c->error) return;
  c->error = error;
  snprintf (c->where, sizeof c->where, "%s", where);
}

int pw_probe_open (pw_probe *probe, pw_error *error) {
  probe->kind = probe->batch->kind;
  probe->elements = probe->batch->b.count, probe->rows = probe->kind->rows, probe->cols = probe->batch->b.cols;
  size_t n = (size_t)probe->s->coords, rows = (size_t)(probe->elements * probe->rows), cols = (size_t)probe->cols;
  const pw_array array[] = {
    { &probe->q, n },
    { &probe->v, n },
    { &probe->a, n },
    { &probe->dq, n },
    { &probe->dv, n },
    { &probe->q_now, n },
    { &probe->v_now, n },
    { &probe->w, (size_t)probe->elements * cols },
    { &probe->lambda, rows },
    { &probe->J, rows * cols + PW_PROBE_GUARD },
    { &probe->eta, rows + PW_PROBE_GUARD },
  };
  probe->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  probe->batch->b.w = probe->w, probe->batch->b.lambda = probe->lambda;
  return probe->memory ? PW_OK : pw_fail_memory (probe->s, error);
}

void pw_probe_update (pw_probe *probe, pw_probe_move move, double h) {
  double step = move == PW_PROBE_MOTION ? h * probe->tau : 0;
  for (int j = 0; j < probe->s->coords; j++) {
    probe->q_now[j] =
        probe->q[j] + step * (probe->v[j] + step * probe->a[j] / 2) + (move == PW_PROBE_Q ? h * probe->dq[j] : 0);
    probe->v_now[j] = probe->v[j] + step * probe->a[j] + (move == PW_PROBE_V ? h * probe->dv[j] : 0);
  }
  const double t = move == PW_PROBE_TIME || move == PW_PROBE_MOTION ? probe->t + h * probe->tau : probe->t;
  probe->failed |= pw_update_kinematics (probe->workspace, t, probe->q_now, probe->v_now) != PW_OK;
}

/* ---- Functions ---- */

void pw_probe_evaluate (pw_probe *probe, pw_batch_function *f, const char *name, int n, double *out) {
  for (int i = 0; i < n + PW_PROBE_GUARD; i++) out[i] = f ? NAN : 0;
  if (f == NULL) return;
  f (&probe->batch->b, out);
  if (!probe->check_sizes) return;
  char where[120];
  int untouched = 0, beyond = 0;
  for (int i = 0; i < n; i++) untouched += !isfinite (out[i]);
  for (int i = n; i < n + PW_PROBE_GUARD; i++) beyond += !isnan (out[i]);
  snprintf (where, sizeof where, "%s: %d of %d entries missing or not finite, %d written beyond", name, untouched, n,
            beyond);
  pw_probe_record (probe->report, PW_CHECK_size, untouched + beyond, 0, "exact", where);
}

/* pw_probe_g, ...: the function of this name, which fills `count` numbers. */
#define PROBE_FUNCTION(function, count)                                      \
  void pw_probe_##function (pw_probe *probe, double *out) {                  \
    pw_probe_evaluate (probe, probe->kind->function, #function, count, out); \
  }
PROBE_FUNCTION (g, probe->elements * probe->rows)
PROBE_FUNCTION (g_size, probe->elements * probe->rows)
PROBE_FUNCTION (eta, probe->elements * probe->rows)
PROBE_FUNCTION (J, probe->elements * probe->rows * probe->cols)
PROBE_FUNCTION (gamma, probe->elements * probe->rows)
PROBE_FUNCTION (force, probe->elements * probe->cols)
PROBE_FUNCTION (energy, probe->elements)
PROBE_FUNCTION (power, probe->elements)
PROBE_FUNCTION (loss, probe->elements)

void pw_probe_Jw (pw_probe *probe, double *out) {
  pw_probe_J (probe, probe->J);
  for (int i = 0; i < probe->elements * probe->rows; i++) {
    out[i] = 0;
    for (int c = 0; c < probe->cols; c++)
      out[i] += probe->J[i * probe->cols + c] * probe->w[i / probe->rows * probe->cols + c];
  }
}

void pw_probe_drift (pw_probe *probe, double *out) {
  pw_probe_eta (probe, probe->eta);
  pw_probe_multiply_J (probe, probe->v_now, out);
  for (int i = 0; i < probe->elements * probe->rows; i++) out[i] -= probe->eta[i];
}

/* ---- Products ---- */

int pw_probe_ground (const pw_probe *probe, int e, int c) {
  return pw_global (probe->batch, e, c) >= probe->s->coords;
}

double pw_probe_local (const pw_probe *probe, const double *vector, int e, int c) {
  return pw_probe_ground (probe, e, c) ? 0 : vector[pw_global (probe->batch, e, c)];
}

void pw_probe_multiply (const pw_probe *probe, const double *block, int rows, const double *vector, double factor,
                        double *out, double *terms) {
  for (int i = 0; i < probe->elements * rows; i++)
    for (int c = 0; c < probe->cols; c++) {
      double term = factor * block[i * probe->cols + c] * pw_probe_local (probe, vector, i / rows, c);
      out[i] += term;
      if (terms) terms[i] += fabs (term);
    }
}

void pw_probe_multiply_J (pw_probe *probe, const double *vector, double *out) {
  pw_probe_J (probe, probe->J);
  memset (out, 0, (size_t)(probe->elements * probe->rows) * sizeof *out);
  pw_probe_multiply (probe, probe->J, probe->rows, vector, 1, out, NULL);
}

/* Second-order blocks of a scene that are computed by differences, and non-zero ones that are NULL in the table. */

static const char *const differences_name[PW_BLOCKS] = {
  [PW_JW_Q] = "jw_q",       [PW_JTL_Q] = "jw_q",      [PW_ETA_Q] = "eta_q",     [PW_GAMMA_Q] = "gamma_q",
  [PW_GAMMA_V] = "gamma_v", [PW_FORCE_Q] = "force_q", [PW_FORCE_V] = "force_v",
};

/* The batch of the i-th block that is computed by differences, and which *block of it, a pw_block; NULL if there are
 * fewer.  PW_JTL_Q is not counted: a type gives it by jw_q. */
static const pw_element_batch *differences_find (const pw_system *s, int i, int *block) {
  for (const pw_element_batch *k = s->batch; k < s->batch + s->batches; k++)
    for (*block = 0; *block < PW_BLOCKS; ++*block)
      if (*block != PW_JTL_Q && pw_block_function (k->kind, (pw_block)*block) == pw_by_differences && i-- == 0)
        return k;
  return NULL;
}

int pw_system_differences (const pw_system *s) {
  int block, count = 0;
  while (differences_find (s, count, &block)) count++;
  return count;
}

char *pw_system_difference_name (const pw_system *s, int i, char *buffer, size_t size) {
  int block;
  const pw_element_batch *k = differences_find (s, i, &block);
  if (size > 0) buffer[0] = 0;
  if (k) snprintf (buffer, size, "%s of element type %s", differences_name[block], k->kind->name);
  return buffer;
}

/* ---- Missing blocks ---- */

/* Tests each block of the first, the last and a middle element of the batch: 1 if one is missing, with its name. */
static int differences_test (const pw_workspace *w, pw_element_batch *k, char *buffer, size_t size) {
  const int element[] = { 0, k->b.count - 1, k->b.count / 2 };
  for (int block = 0; block < PW_BLOCKS; block++)
    for (int i = 0; i < 3 && k->b.count > 0; i++) {
      if (!pw_block_missing (w, k, element[i], (pw_block)block)) continue;
      snprintf (buffer, size, "%s of element type %s", differences_name[block], k->kind->name);
      return 1;
    }
  return 0;
}

/* Searches a batch, with random k->b.w, multipliers and signals.  Returns as pw_find_missing_block. */
static int differences_search (pw_workspace *w, pw_element_batch *k, pw_random *random, char *buffer, size_t size) {
  int cols = k->b.count * k->b.cols, rows = k->b.count * k->kind->rows;
  double *x = malloc (((size_t)cols + (size_t)rows + 1) * sizeof *x);
  if (x == NULL) return PW_RESOURCE;
  for (int i = 0; i < cols + rows; i++) x[i] = pw_random_between (random, -1, 1);
  for (int i = 0; i < 3 * k->b.count * k->kind->signals; i++) k->u[i] = pw_random_between (random, -1, 1);
  k->b.w = x, k->b.lambda = x + cols;
  int found = differences_test (w, k, buffer, size);
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
