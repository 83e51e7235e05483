/* The self-test of an element type in a scene that uses it, with the scene's elements, signals, parameters and
 * configuration.
 *
 * The scene moves randomly around the configuration, in its units.  The type's derivatives along that motion are
 * compared with differences over steps from 2^-8 to 2^-20; for each entry the least error counts.  A correct formula
 * agrees with one of them whatever its scale; a wrong one differs from all by about its magnitude. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "probe.h"

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
