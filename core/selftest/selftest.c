/* The self-test of an element type: each check compares one function of its table with differences of another. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "model.h"
#include "probe.h"

/* ---- Functions to be differenced ---- */

static void selftest_g (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->g, "g", x->elements * x->rows, out);
}

static void selftest_energy (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->energy, "energy", x->elements, out);
}

static void selftest_force (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->force, "force", x->elements * x->cols, out);
}

/* J v - eta */
static void selftest_drift (pw_probe *x, double *out) {
  double eta[PW_PROBE_OUT + PW_PROBE_GUARD];
  pw_probe_evaluate (x, x->kind->eta, "eta", x->elements * x->rows, eta);
  pw_probe_multiply_J (x, x->v_now, out);
  for (int i = 0; i < x->elements * x->rows; i++) out[i] -= eta[i];
}

/* ---- First-order checks ---- */

static void selftest_holonomic (pw_probe *x) {
  double value[PW_PROBE_OUT + PW_PROBE_GUARD], reference[PW_PROBE_OUT], derivative[PW_PROBE_OUT];
  int n = x->elements * x->rows;
  for (int j = 0; j < x->s->coords; j++) {
    pw_probe_derivative (x, selftest_g, j, n, derivative);
    for (int i = 0; i < n * x->cols; i++)
      if (pw_global (x->k, i / (x->rows * x->cols), i % x->cols) == j) reference[i] = derivative[i / x->cols];
  }
  for (int i = 0; i < n * x->cols; i++)
    if (pw_probe_ground (x, i / (x->rows * x->cols), i % x->cols)) reference[i] = 0;
  pw_probe_evaluate (x, x->kind->J, "J", n * x->cols, value);
  pw_probe_compare (x, "J", "J = dg/dq", x->rows, x->cols, value, reference);

  pw_probe_derivative (x, selftest_g, PW_PROBE_TIME, n, reference);
  for (int i = 0; i < n; i++) reference[i] = -reference[i];
  pw_probe_evaluate (x, x->kind->eta, "eta", n, value);
  pw_probe_compare (x, "eta", "eta = -dg/dt", x->rows, 1, value, reference);

  selftest_g (x, reference);
  pw_probe_evaluate (x, x->kind->g_size, "g_size", n, value);
  for (int i = 0; i < n; i++) { /* a sufficient g_size is its own reference */
    double size = fabs (reference[i]);
    reference[i] = fmax (value[i], size);
  }
  pw_probe_compare (x, "g_size", "g_size >= |g|", x->rows, 1, value, reference);
}

static void selftest_gamma (pw_probe *x) {
  double value[PW_PROBE_OUT], gamma[PW_PROBE_OUT + PW_PROBE_GUARD], reference[PW_PROBE_OUT];
  int n = x->elements * x->rows;
  pw_probe_derivative (x, selftest_drift, PW_PROBE_MOTION, n, reference);
  pw_probe_multiply_J (x, x->a, value);
  pw_probe_evaluate (x, x->kind->gamma, "gamma", n, gamma);
  for (int i = 0; i < n; i++) value[i] -= gamma[i];
  pw_probe_compare (x, "gamma", "J a - gamma = d(J v - eta)/dt", x->rows, 1, value, reference);
}

static void selftest_force_u (pw_probe *x) {
  double value[PW_PROBE_OUT + PW_PROBE_GUARD], reference[PW_PROBE_OUT], plus[PW_PROBE_OUT + PW_PROBE_GUARD],
      minus[PW_PROBE_OUT + PW_PROBE_GUARD];
  int signals = x->kind->signals, n = x->elements * x->cols;
  for (int u = 0; u < signals; u++) {
    for (int e = 0; e < x->elements; e++) x->k->u[3 * (e * signals + u)] += PW_PROBE_STEP;
    selftest_force (x, plus);
    for (int e = 0; e < x->elements; e++) x->k->u[3 * (e * signals + u)] -= 2 * PW_PROBE_STEP;
    selftest_force (x, minus);
    for (int e = 0; e < x->elements; e++) x->k->u[3 * (e * signals + u)] += PW_PROBE_STEP;
    for (int i = 0; i < n; i++) reference[i * signals + u] = (plus[i] - minus[i]) / (2 * PW_PROBE_STEP);
  }
  x->size = pw_probe_largest (n, plus);
  pw_probe_evaluate (x, x->kind->force_u, "force_u", n * signals, value);
  pw_probe_compare (x, "force_u", "force_u = d force/du", x->cols * signals, 1, value, reference);
}

/* A force declared constant does not change with time and state. */
static void selftest_constant (pw_probe *x) {
  double before[PW_PROBE_OUT + PW_PROBE_GUARD], after[PW_PROBE_OUT + PW_PROBE_GUARD];
  int n = x->elements * x->cols, changed = 0;
  selftest_force (x, before);
  pw_probe_update (x, PW_PROBE_MOTION, 1);
  selftest_force (x, after);
  pw_probe_update (x, PW_PROBE_MOTION, 0);
  for (int i = 0; i < n; i++) changed += before[i] != after[i];
  pw_probe_record (x->report, "constant", "a constant force does not change", changed, 0, "exact", "");
}

/* ---- Second-order blocks ---- */

static void selftest_block (pw_probe *x, pw_block block, const char *name, const char *about, double size) {
  double value[PW_PROBE_OUT + PW_PROBE_GUARD], reference[PW_PROBE_OUT];
  int rows = pw_block_rows (x->kind, block);
  pw_batch_function *function = pw_block_function (x->kind, block);
  if (function == pw_by_differences)
    pw_evaluate_block (x->work, x->k, block, value);
  else
    pw_probe_evaluate (x, function, name, x->elements * rows * x->cols, value);
  for (int e = 0; e < x->elements; e++) pw_difference (x->work, x->k, e, block, reference + e * rows * x->cols);
  x->size = size;
  pw_probe_compare (x, name, about, rows, x->cols, value, reference);
}

static void selftest_blocks (pw_probe *x) {
  double J[PW_PROBE_OUT + PW_PROBE_GUARD], gamma[PW_PROBE_OUT + PW_PROBE_GUARD], force[PW_PROBE_OUT + PW_PROBE_GUARD];
  int n = x->elements * x->rows;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  x->k->b.w = x->w;
  x->k->b.lambda = x->lambda;
  pw_probe_evaluate (x, x->kind->J, "J", n * x->cols, J);
  pw_probe_evaluate (x, x->kind->gamma, "gamma", n, gamma);
  selftest_force (x, force);
  double sJ = pw_probe_largest (n * x->cols, J), sg = pw_probe_largest (n, gamma);
  if (x->rows > 0) {
    selftest_block (x, PW_JW_Q, "jw_q", "jw_q = d(J w)/dq", sJ);
    selftest_block (x, PW_ETA_Q, "eta_q", "eta_q = d eta/dq", 0);
    selftest_block (x, PW_GAMMA_Q, "gamma_q", "gamma_q = d gamma/dq", sg);
    selftest_block (x, PW_GAMMA_V, "gamma_v", "gamma_v = d gamma/dv", sg);
  }
  double sf = pw_probe_largest (x->elements * x->cols, force);
  selftest_block (x, PW_FORCE_Q, "force_q", "force_q = d force/dq", sf);
  selftest_block (x, PW_FORCE_V, "force_v", "force_v = d force/dv", sf);
}

/* Near rest, squares of velocities underflow to 0 and their inverses are infinite; results must still be finite. */
static void selftest_rest (pw_probe *x) {
  static const pw_block blocks[] = { PW_GAMMA_Q, PW_GAMMA_V, PW_FORCE_Q, PW_FORCE_V };
  double out[PW_PROBE_OUT + PW_PROBE_GUARD], v[PW_PROBE_COORDS];
  memcpy (v, x->v, sizeof v);
  for (int j = 0; j < x->s->coords; j++) x->v[j] *= 1e-310;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  pw_probe_evaluate (x, x->kind->gamma, "gamma near rest", x->elements * x->rows, out);
  pw_probe_evaluate (x, x->kind->force, "force near rest", x->elements * x->cols, out);
  pw_probe_evaluate (x, x->kind->loss, "loss near rest", x->elements, out);
  for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
    pw_batch_function *function = pw_block_function (x->kind, blocks[i]);
    int n = x->elements * pw_block_rows (x->kind, blocks[i]) * x->cols;
    if (function != pw_by_differences) pw_probe_evaluate (x, function, "a derivative near rest", n, out);
  }
  memcpy (x->v, v, sizeof v);
}

/* ---- Saturation ---- */

/* The change of the force of element e from `rest` when local velocity c changes from 0 to v. */
static double selftest_change (pw_probe *x, int e, int c, double v, const double *rest) {
  double force[PW_PROBE_OUT + PW_PROBE_GUARD], change = 0;
  int j = pw_global (x->k, e, c);
  x->v[j] = v;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  selftest_force (x, force);
  x->v[j] = 0;
  for (int i = e * x->cols; i < (e + 1) * x->cols; i++) change = fmax (change, fabs (force[i] - rest[i]));
  return change;
}

/* From rest, a hundredth of the declared saturation velocity, or of a large velocity if none is declared, must
 * change the force by less than half of what the whole velocity does. */
static void selftest_saturation (pw_probe *x) {
  const double large = 1000;
  double out[PW_PROBE_OUT], rest[PW_PROBE_OUT + PW_PROBE_GUARD], v[PW_PROBE_COORDS];
  memcpy (v, x->v, sizeof v);
  memset (x->v, 0, sizeof x->v);
  pw_probe_update (x, PW_PROBE_TIME, 0);
  selftest_force (x, rest);
  for (int i = 0; i < x->elements * 2 * x->cols; i++) out[i] = INFINITY;
  if (x->kind->saturation) x->kind->saturation (&x->k->b, out);
  for (int i = 0; i < x->elements * x->cols; i++) {
    int e = i / x->cols, c = i % x->cols;
    if (pw_probe_ground (x, e, c)) continue;
    double far = out[i + (e + 1) * x->cols], all = selftest_change (x, e, c, isfinite (far) ? far : large, rest);
    double part = selftest_change (x, e, c, (isfinite (far) ? far : large) / 100, rest);
    if (all < 1e-9 * (1 + pw_probe_largest (x->elements * x->cols, rest))) continue;
    pw_probe_record (x->report, "saturation", "saturation velocity of a saturating force", part / all, 0.5,
                     "a hundredth of the velocity, half of the change", x->k->name[e]);
  }
  memcpy (x->v, v, sizeof v);
}

/* ---- Energy ---- */

/* Changes v by the least norm to satisfy J v = eta of element e.  Returns 0 if its constraint equations are
 * dependent. */
static int selftest_satisfy (pw_probe *x, int e) {
  double J[PW_PROBE_OUT + PW_PROBE_GUARD], A[PW_MAX_ROWS][PW_MAX_ROWS] = { { 0 } }, b[PW_PROBE_OUT];
  int n = x->rows;
  pw_probe_update (x, PW_PROBE_TIME, 0);
  selftest_drift (x, b);
  pw_probe_evaluate (x, x->kind->J, "J", x->elements * n * x->cols, J);
  double *row = J + e * n * x->cols, *rest = b + e * n;
  for (int c = 0; c < x->cols; c++)
    for (int r = 0; r < n; r++) row[r * x->cols + c] *= !pw_probe_ground (x, e, c);
  for (int r = 0; r < n; r++)
    for (int i = 0; i < n; i++) {
      for (int c = 0; c < x->cols; c++) A[r][i] += row[r * x->cols + c] * row[i * x->cols + c];
    }
  for (int p = 0; p < n; p++) /* elimination: J J^T is positive definite */
    for (int r = p + 1; r < n; r++) {
      if (!(A[p][p] > 1e-6)) return 0;
      double factor = A[r][p] / A[p][p];
      for (int i = p; i < n; i++) A[r][i] -= factor * A[p][i];
      rest[r] -= factor * rest[p];
    }
  if (!(A[n - 1][n - 1] > 1e-6)) return 0;
  for (int p = n - 1; p >= 0; p--) {
    for (int i = p + 1; i < n; i++) rest[p] -= A[p][i] * rest[i];
    rest[p] /= A[p][p];
  }
  for (int c = 0; c < x->cols; c++)
    for (int r = 0; r < n && !pw_probe_ground (x, e, c); r++)
      x->v[pw_global (x->k, e, c)] -= row[r * x->cols + c] * rest[r];
  return 1;
}

/* The power of the forces of element e, including constraint forces -J^T lambda, must equal the supplied power minus
 * losses and the rate of its potential energy. */
static void selftest_power_of (pw_probe *x, int e) {
  double force[PW_PROBE_OUT + PW_PROBE_GUARD], drift[PW_PROBE_OUT], eta[PW_PROBE_OUT + PW_PROBE_GUARD];
  double derivative[PW_SCENE_BATCH], power[PW_SCENE_BATCH + PW_PROBE_GUARD], loss[PW_SCENE_BATCH + PW_PROBE_GUARD];
  pw_probe_derivative (x, selftest_energy, PW_PROBE_MOTION, x->elements, derivative);
  selftest_force (x, force);
  pw_probe_evaluate (x, x->kind->power, "power", x->elements, power);
  pw_probe_evaluate (x, x->kind->loss, "loss", x->elements, loss);
  double fed = 0, size = fmax (x->size, fmax (fabs (power[e]), fabs (loss[e])));
  for (int c = 0; c < x->cols; c++) fed += force[e * x->cols + c] * pw_probe_local (x, x->v, e, c);
  if (x->rows > 0) {
    pw_probe_multiply_J (x, x->v, drift);
    pw_probe_evaluate (x, x->kind->eta, "eta", x->elements * x->rows, eta);
  }
  for (int r = e * x->rows; r < (e + 1) * x->rows; r++) {
    fed -= x->lambda[r] * drift[r];
    if (x->kind->power == NULL) power[e] -= x->lambda[r] * eta[r];
  }
  double error = fabs (fed + derivative[e] - power[e] + loss[e]) / (1 + size + fabs (fed));
  char where[120];
  snprintf (where, sizeof where, "%s: %.9g, expected %.9g", x->k->name[e], fed, power[e] - loss[e] - derivative[e]);
  pw_probe_record (x->report, "power", "force . v = power - loss - d energy/dt", error, pw_probe_bound (),
                   pw_probe_reason, where);
  if (x->kind->loss) pw_probe_record (x->report, "loss", "loss >= 0", fmax (-loss[e], 0), 0, "exact", where);
}

static void selftest_power (pw_probe *x) {
  double v[PW_PROBE_COORDS];
  if (!x->kind->force && !x->kind->energy && !x->kind->power && !x->kind->loss) return;
  memcpy (v, x->v, sizeof v);
  for (int e = 0; e < x->elements; e++) {
    if (x->rows == 0 || selftest_satisfy (x, e)) selftest_power_of (x, e);
    memcpy (x->v, v, sizeof v);
  }
}

/* ---- */

static void selftest_all (pw_probe *x) {
  double out[3 * PW_SCENE_BATCH + PW_PROBE_GUARD];
  pw_probe_update (x, PW_PROBE_TIME, 0);
  if (x->kind->level == PW_HOLONOMIC) selftest_holonomic (x);
  if (x->rows > 0) selftest_gamma (x);
  if (x->kind->signals > 0) selftest_force_u (x);
  if (x->kind->constant) selftest_constant (x);
  selftest_blocks (x);
  selftest_rest (x);
  if (x->kind->force && !x->kind->constant) selftest_saturation (x);
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
  pw_workspace *w = pw_workspace_new (s, error);
  if (w == NULL) {
    pw_system_free (s);
    return PW_RESOURCE;
  }
  pw_probe x = { .kind = kind, .s = s, .work = w, .k = w->batch, .rows = kind->rows, .report = report };
  x.elements = s->batch->b.count;
  x.cols = s->batch->b.cols;
  for (int j = 3 * s->bodies; j < s->coords; j++)
    pw_probe_record (report, "table", "", !(s->mass[j] >= 0 && isfinite (s->mass[j])), 0, "exact",
                     "inertia of an internal coordinate");
  pw_probe_randomise (&x, &random);
  selftest_all (&x);
  pw_workspace_free (w);
  pw_system_free (s);
  return PW_OK;
}
