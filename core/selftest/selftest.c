/* The self-test of an element type in random scenes: each check compares one function of its table with differences of
 * another. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"
#include "probe.h"

/* Central differences with a step of about eps^(1/3) = 6e-6 have an error of the order eps^(2/3) times the function's
 * size, from truncation and from round-off alike (Dennis & Schnabel 1983, section 5.6).  All numbers in the scene are of
 * the order 1, so the sizes of a function and of its third derivative are about the same. */
#define SELFTEST_STEP 0x1p-17
static const char selftest_reason[] = "100 eps^(2/3) of the largest term: central differences";

static double selftest_bound (void) {
  return 100 * cbrt (DBL_EPSILON) * cbrt (DBL_EPSILON);
}

/* The numbers that a function fills, with guards. */
typedef double selftest_numbers[PW_PROBE_OUT + PW_PROBE_GUARD];

static double selftest_largest (int n, const double *y) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (y[i]));
  return most;
}

/* The derivatives of n values of f along a move.  Returns the largest value. */
static double selftest_derivative (pw_probe *x, pw_probe_function *f, pw_probe_move move, int n, double *derivative) {
  selftest_numbers plus, minus;
  pw_probe_update (x, move, SELFTEST_STEP);
  f (x, plus);
  pw_probe_update (x, move, -SELFTEST_STEP);
  f (x, minus);
  pw_probe_update (x, move, 0);
  for (int i = 0; i < n; i++) derivative[i] = (plus[i] - minus[i]) / (2 * SELFTEST_STEP);
  return selftest_largest (n, plus);
}

/* Compares elements x rows x cols entries, except the meaningless columns of the ground, relative to 1 + size or the
 * largest reference. */
static void selftest_compare (pw_probe *x, const char *name, const char *about, int rows, int cols, double size,
                              const double *value, const double *reference) {
  int n = x->elements * rows * cols, at = 0;
  double worst = -1, scale = fmax (1 + size, selftest_largest (n, reference));
  for (int i = 0; i < n; i++) {
    if (cols == x->cols && pw_probe_ground (x, i / (rows * cols), i % cols)) continue;
    double error = fabs (value[i] - reference[i]) / scale;
    if (isnan (error)) error = INFINITY;
    if (error > worst) worst = error, at = i;
  }
  char where[120];
  snprintf (where, sizeof where, "%s, row %d, column %d: %.9g, expected %.9g", x->k->name[at / (rows * cols)],
            at / cols % rows, at % cols, value[at], reference[at]);
  pw_probe_record (x->report, name, about, worst, selftest_bound (), selftest_reason, where);
}

/* ---- First-order checks ---- */

static void selftest_holonomic (pw_probe *x) {
  selftest_numbers value, reference = { 0 }, derivative;
  double size = 0;
  int n = x->elements * x->rows;
  for (int j = 0; j < x->s->coords; j++) {
    for (int i = 0; i < x->s->coords; i++) x->dq[i] = i == j;
    size = selftest_derivative (x, pw_probe_g, PW_PROBE_Q, n, derivative);
    for (int i = 0; i < n * x->cols; i++)
      if (pw_global (x->k, i / (x->rows * x->cols), i % x->cols) == j) reference[i] = derivative[i / x->cols];
  }
  pw_probe_evaluate (x, x->kind->J, "J", n * x->cols, value);
  selftest_compare (x, "J", "J = dg/dq", x->rows, x->cols, size, value, reference);

  size = selftest_derivative (x, pw_probe_g, PW_PROBE_TIME, n, reference);
  for (int i = 0; i < n; i++) reference[i] = -reference[i];
  pw_probe_eta (x, value);
  selftest_compare (x, "eta", "eta = -dg/dt", x->rows, 1, size, value, reference);

  pw_probe_g (x, reference);
  pw_probe_evaluate (x, x->kind->g_size, "g_size", n, value);
  for (int i = 0; i < n; i++) { /* a sufficient g_size is its own reference */
    double least = fabs (reference[i]);
    reference[i] = fmax (value[i], least);
  }
  selftest_compare (x, "g_size", "g_size >= |g|", x->rows, 1, size, value, reference);
}

static void selftest_gamma (pw_probe *x) {
  selftest_numbers value, gamma, reference;
  int n = x->elements * x->rows;
  double size = selftest_derivative (x, pw_probe_drift, PW_PROBE_MOTION, n, reference);
  pw_probe_multiply_J (x, x->a, value);
  pw_probe_gamma (x, gamma);
  for (int i = 0; i < n; i++) value[i] -= gamma[i];
  selftest_compare (x, "gamma", "J a - gamma = d(J v - eta)/dt", x->rows, 1, size, value, reference);
}

/* Adds h to signal u of each element. */
static void selftest_shift (pw_probe *x, int u, double h) {
  for (int e = 0; e < x->elements; e++) x->k->u[3 * (e * x->kind->signals + u)] += h;
}

static void selftest_force_u (pw_probe *x) {
  selftest_numbers value, reference, plus, minus;
  int signals = x->kind->signals, n = x->elements * x->cols;
  for (int u = 0; u < signals; u++) {
    selftest_shift (x, u, SELFTEST_STEP);
    pw_probe_force (x, plus);
    selftest_shift (x, u, -2 * SELFTEST_STEP);
    pw_probe_force (x, minus);
    selftest_shift (x, u, SELFTEST_STEP);
    for (int i = 0; i < n; i++) reference[i * signals + u] = (plus[i] - minus[i]) / (2 * SELFTEST_STEP);
  }
  pw_probe_evaluate (x, x->kind->force_u, "force_u", n * signals, value);
  selftest_compare (x, "force_u", "force_u = d force/du", x->cols * signals, 1, selftest_largest (n, plus), value,
                    reference);
}

/* A force declared constant does not change with time and state. */
static void selftest_constant (pw_probe *x) {
  selftest_numbers before, after;
  int n = x->elements * x->cols, changed = 0;
  pw_probe_force (x, before);
  pw_probe_update (x, PW_PROBE_MOTION, 1);
  pw_probe_force (x, after);
  pw_probe_update (x, PW_PROBE_MOTION, 0);
  for (int i = 0; i < n; i++) changed += before[i] != after[i];
  pw_probe_record (x->report, "constant", "a constant force does not change", changed, 0, "exact", "");
}

/* ---- Second-order blocks ---- */

static void selftest_block (pw_probe *x, pw_block block, const char *name, const char *about, double size) {
  selftest_numbers value, reference;
  int rows = pw_block_rows (x->kind, block);
  pw_batch_function *function = pw_block_function (x->kind, block);
  if (function == pw_by_differences)
    pw_evaluate_block (x->work, x->k, block, value);
  else
    pw_probe_evaluate (x, function, name, x->elements * rows * x->cols, value);
  for (int e = 0; e < x->elements; e++) pw_difference (x->work, x->k, e, block, reference + e * rows * x->cols);
  selftest_compare (x, name, about, rows, x->cols, size, value, reference);
}

static void selftest_blocks (pw_probe *x) {
  selftest_numbers J, gamma, force;
  int n = x->elements * x->rows;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  pw_probe_evaluate (x, x->kind->J, "J", n * x->cols, J);
  pw_probe_gamma (x, gamma);
  pw_probe_force (x, force);
  double size_J = selftest_largest (n * x->cols, J), size_gamma = selftest_largest (n, gamma);
  if (x->rows > 0) {
    selftest_block (x, PW_JW_Q, "jw_q", "jw_q = d(J w)/dq", size_J);
    selftest_block (x, PW_ETA_Q, "eta_q", "eta_q = d eta/dq", 0);
    selftest_block (x, PW_GAMMA_Q, "gamma_q", "gamma_q = d gamma/dq", size_gamma);
    selftest_block (x, PW_GAMMA_V, "gamma_v", "gamma_v = d gamma/dv", size_gamma);
  }
  double size_force = selftest_largest (x->elements * x->cols, force);
  selftest_block (x, PW_FORCE_Q, "force_q", "force_q = d force/dq", size_force);
  selftest_block (x, PW_FORCE_V, "force_v", "force_v = d force/dv", size_force);
}

/* Makes a check at velocities multiplied by a factor. */
static void selftest_at_speed (pw_probe *x, double factor, void (*check) (pw_probe *x)) {
  memcpy (x->dv, x->v, (size_t)x->s->coords * sizeof *x->v);
  for (int j = 0; j < x->s->coords; j++) x->v[j] *= factor;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  check (x);
  memcpy (x->v, x->dv, (size_t)x->s->coords * sizeof *x->v);
}

/* Near rest, squares of velocities underflow to 0 and their inverses are infinite; results must still be finite. */
static void selftest_rest (pw_probe *x) {
  static const pw_block blocks[] = { PW_GAMMA_Q, PW_GAMMA_V, PW_FORCE_Q, PW_FORCE_V };
  selftest_numbers out;
  pw_probe_evaluate (x, x->kind->gamma, "gamma near rest", x->elements * x->rows, out);
  pw_probe_evaluate (x, x->kind->force, "force near rest", x->elements * x->cols, out);
  pw_probe_evaluate (x, x->kind->loss, "loss near rest", x->elements, out);
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    pw_batch_function *function = pw_block_function (x->kind, blocks[i]);
    int n = x->elements * pw_block_rows (x->kind, blocks[i]) * x->cols;
    if (function != pw_by_differences) pw_probe_evaluate (x, function, "a derivative near rest", n, out);
  }
}

/* ---- Saturation ---- */

/* The change of the force of element e from `rest` when local velocity c changes from 0 to v. */
static double selftest_change (pw_probe *x, int e, int c, double v, const double *rest) {
  selftest_numbers force;
  double change = 0;
  int j = pw_global (x->k, e, c);
  x->v[j] = v;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  pw_probe_force (x, force);
  x->v[j] = 0;
  for (int i = e * x->cols; i < (e + 1) * x->cols; i++) change = fmax (change, fabs (force[i] - rest[i]));
  return change;
}

/* From rest, a hundredth of the declared saturation velocity, or of a large velocity if none is declared, must
 * change the force by less than half of what the whole velocity does. */
static void selftest_saturation (pw_probe *x) {
  const double large = 1000;
  selftest_numbers out, rest;
  pw_probe_force (x, rest);
  for (int i = 0; i < x->elements * 2 * x->cols; i++) out[i] = INFINITY;
  if (x->kind->saturation) x->kind->saturation (&x->k->b, out);
  for (int i = 0; i < x->elements * x->cols; i++) {
    int e = i / x->cols, c = i % x->cols;
    if (pw_probe_ground (x, e, c)) continue;
    double far = out[i + (e + 1) * x->cols], all = selftest_change (x, e, c, isfinite (far) ? far : large, rest);
    double part = selftest_change (x, e, c, (isfinite (far) ? far : large) / 100, rest);
    if (all < 1e-9 * (1 + selftest_largest (x->elements * x->cols, rest))) continue;
    pw_probe_record (x->report, "saturation", "saturation velocity of a saturating force", part / all, 0.5,
                     "a hundredth of the velocity, half of the change", x->k->name[e]);
  }
}

/* ---- Energy ---- */

static void selftest_energy (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->energy, "energy", x->elements, out);
}

/* x . y of n numbers */
static double selftest_dot (int n, const double *x, const double *y) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

/* Changes v by the least norm to satisfy J v = eta of element e, by rows made orthogonal (Gram & Schmidt).  Returns 0 if
 * its constraint equations are dependent. */
static int selftest_satisfy (pw_probe *x, int e) {
  double row[PW_MAX_ROWS][PW_MAX_COLS + 1], square[PW_MAX_ROWS]; /* row: of J, and of J v - eta */
  const int n = x->cols;
  selftest_numbers off;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  pw_probe_drift (x, off);
  for (int r = 0; r < x->rows; r++) {
    for (int c = 0; c < n; c++) row[r][c] = pw_probe_ground (x, e, c) ? 0 : x->J[(e * x->rows + r) * n + c];
    row[r][n] = off[e * x->rows + r];
    for (int p = 0; p < r; p++) {
      double along = selftest_dot (n, row[p], row[r]) / square[p];
      for (int c = 0; c <= n; c++) row[r][c] -= along * row[p][c];
    }
    square[r] = selftest_dot (n, row[r], row[r]);
    if (!(square[r] > 1e-6)) return 0;
    for (int c = 0; c < n; c++)
      if (!pw_probe_ground (x, e, c)) x->v[pw_global (x->k, e, c)] -= row[r][c] * row[r][n] / square[r];
  }
  return 1;
}

/* The power of the forces of element e, including constraint forces -J^T lambda, must equal the supplied power minus
 * losses and the rate of its potential energy. */
static void selftest_power_of (pw_probe *x, int e) {
  selftest_numbers derivative, force, power, loss, drift;
  double fed = 0, size = selftest_derivative (x, selftest_energy, PW_PROBE_MOTION, x->elements, derivative);
  pw_probe_force (x, force);
  pw_probe_evaluate (x, x->kind->power, "power", x->elements, power);
  pw_probe_evaluate (x, x->kind->loss, "loss", x->elements, loss);
  size = fmax (size, fmax (fabs (power[e]), fabs (loss[e])));
  for (int c = 0; c < x->cols; c++) fed += force[e * x->cols + c] * pw_probe_local (x, x->v, e, c);
  if (x->rows > 0) {
    pw_probe_multiply_J (x, x->v, drift);
    pw_probe_eta (x, x->eta);
  }
  for (int r = e * x->rows; r < (e + 1) * x->rows; r++) {
    fed -= x->lambda[r] * drift[r];
    if (x->kind->power == NULL) power[e] -= x->lambda[r] * x->eta[r];
  }
  double error = fabs (fed + derivative[e] - power[e] + loss[e]) / (1 + size + fabs (fed));
  char where[120];
  snprintf (where, sizeof where, "%s: %.9g, expected %.9g", x->k->name[e], fed, power[e] - loss[e] - derivative[e]);
  pw_probe_record (x->report, "power", "force . v = power - loss - d energy/dt", error, selftest_bound (),
                   selftest_reason, where);
  if (x->kind->loss) pw_probe_record (x->report, "loss", "loss >= 0", fmax (-loss[e], 0), 0, "exact", where);
}

static void selftest_power (pw_probe *x) {
  if (!x->kind->force && !x->kind->energy && !x->kind->power && !x->kind->loss) return;
  for (int e = 0; e < x->elements; e++) {
    memcpy (x->dv, x->v, (size_t)x->s->coords * sizeof *x->v);
    if (x->rows == 0 || selftest_satisfy (x, e)) selftest_power_of (x, e);
    memcpy (x->v, x->dv, (size_t)x->s->coords * sizeof *x->v);
  }
}

/* ---- */

/* Bodies near the corners of a square, everything else at random. */
static void selftest_randomise (pw_probe *x, pw_random *r) {
  static const double corner[PW_SCENE_BODIES][2] = { { 2, 2 }, { -2, 2 }, { -2, -2 }, { 2, -2 } };
  x->t = pw_random_between (r, 0.1, 3);
  x->tau = 1;
  for (int j = 0; j < x->s->coords; j++) {
    x->q[j] = pw_random_between (r, -0.5, 0.5);
    if (pw_is_angle (x->s, j))
      x->q[j] = pw_random_between (r, -3, 3);
    else
      x->q[j] += corner[j / 3][j % 3];
    x->v[j] = pw_random_between (r, -1.5, 1.5);
    x->a[j] = pw_random_between (r, -1.5, 1.5);
  }
  for (int i = 0; i < x->elements * x->cols; i++) x->w[i] = pw_random_between (r, -1.5, 1.5);
  for (int i = 0; i < x->elements * x->rows; i++) x->lambda[i] = pw_random_between (r, -1.5, 1.5);
}

static void selftest_all (pw_probe *x) {
  selftest_numbers out;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  if (x->kind->level == PW_HOLONOMIC) selftest_holonomic (x);
  if (x->rows > 0) selftest_gamma (x);
  if (x->kind->signals > 0) selftest_force_u (x);
  if (x->kind->constant) selftest_constant (x);
  selftest_blocks (x);
  selftest_at_speed (x, 1e-310, selftest_rest);
  if (x->kind->force && !x->kind->constant) selftest_at_speed (x, 0, selftest_saturation);
  selftest_power (x);
  pw_probe_evaluate (x, x->kind->contact, "contact", 3 * x->elements, out);
}

int pw_selftest (const pw_kind *kind, unsigned seed, pw_selftest_report *report, pw_error *error) {
  char buffer[200];
  const char *fault = pw_kind_check (kind, buffer, sizeof buffer);
  pw_probe_record (report, "table", "consistent sizes, fields and functions", *fault != 0, 0, "exact", fault);
  if (*fault) return PW_OK;
  pw_random random = { seed };
  pw_error cause = { 0 };
  pw_system *s = pw_random_scene (kind, &random, &cause);
  if (s == NULL) return pw_fail (error, cause.status, "%s", cause.text);
  for (int j = 3 * s->bodies; j < s->coords; j++)
    pw_probe_record (report, "table", "", !(s->mass[j] >= 0 && isfinite (s->mass[j])), 0, "exact",
                     "inertia of an internal coordinate");
  pw_workspace *w = pw_workspace_new (s, error);
  pw_probe x = { .s = s, .work = w, .k = w ? w->batch : NULL, .check_sizes = 1, .report = report };
  int status = w ? pw_probe_open (&x, error) : PW_RESOURCE;
  if (status == PW_OK) {
    selftest_randomise (&x, &random);
    selftest_all (&x);
  }
  free (x.memory);
  pw_workspace_free (w);
  pw_system_free (s);
  return status;
}
