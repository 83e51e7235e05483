/* The self-test of an element type in random scenes: most checks compare one function of its table with differences of
 * another. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"
#include "probe.h"

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
