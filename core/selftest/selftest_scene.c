/* The self-test of an element type in a scene that uses it, with the scene's elements, signals, parameters and
 * configuration.
 *
 * The scene moves randomly around the configuration, in its units.  The type's derivatives along that motion are
 * compared with differences over steps from 2^-8 to 2^-20; for each entry the best one counts.  A correct formula
 * agrees with one of them whatever its scale; a wrong one differs from all by about its magnitude. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "probe.h"

#define SCENE_BOUND 1e-5
static const char scene_reason[] = "1e-5 of the sum of all terms: the best of several differences";

typedef struct {
  pw_probe p;
  int width; /* most values per element in any comparison */
  /* elements x width: values of a function, its derivative; tested value, sum of |terms|, least error, reference size */
  double *plus, *minus, *derivative, *value, *terms, *error, *size;
  double *block; /* elements x width x width */
  char *memory;
} scene;

/* ---- Comparing ---- */

/* The largest of the terms of the element of entry k: its derivatives with respect to positions multiply round-off of
 * these. */
static double scene_largest_term (const scene *x, int k, int rows) {
  double most = 0;
  for (int i = k - k % rows; i < k - k % rows + rows; i++) most = fmax (most, x->terms[i]);
  return most;
}

/* Updates the least error of each entry by differences with step h. */
static void scene_differences (scene *x, pw_probe_function *f, pw_probe_move move, int rows, double h) {
  int n = x->p.elements * rows;
  static const double weight[] = { 4. / 3, -1. / 3 }; /* extrapolated (Richardson) */
  for (int k = 0; k < n; k++) x->derivative[k] = 0;
  for (int i = 0; i < 2; i++) {
    double far = ldexp (h, i);
    pw_probe_update (&x->p, move, far);
    f (&x->p, x->plus);
    pw_probe_update (&x->p, move, -far);
    f (&x->p, x->minus);
    for (int k = 0; k < n; k++) x->derivative[k] += weight[i] * (x->plus[k] - x->minus[k]) / (2 * far);
  }
  for (int k = 0; k < n; k++) {
    double noise = 256 * DBL_EPSILON * ((fabs (x->plus[k]) + x->size[k]) / h + scene_largest_term (x, k, rows));
    double error =
        fmax (0, fabs (x->value[k] - x->derivative[k]) - noise) / (x->terms[k] + fabs (x->derivative[k]) + DBL_MIN);
    if (!(error >= x->error[k])) x->error[k] = error;
  }
}

/* Compares x->value, rows per element, with the derivative of f; x->terms and x->size belong to it.  Clears the three. */
static void scene_compare (scene *x, const char *name, const char *about, int rows, pw_probe_function *f,
                           pw_probe_move move) {
  int n = x->p.elements * rows, at = 0;
  char where[120] = "";
  for (int k = 0; k < n; k++) x->error[k] = INFINITY;
  for (int power = -8; power >= -20; power -= 4) scene_differences (x, f, move, rows, ldexp (1, power));
  pw_probe_update (&x->p, PW_PROBE_Q, 0);
  for (int k = 0; k < n; k++)
    if (!(x->error[k] <= x->error[at])) at = k;
  if (n > 0)
    snprintf (where, sizeof where, "%s %s, row %d: %.9g, expected %.9g", x->p.kind->name, x->p.k->name[at / rows],
              at % rows, x->value[at], x->derivative[at]);
  pw_probe_record (x->p.report, name, about, n > 0 ? x->error[at] : 0, SCENE_BOUND, scene_reason, where);
  for (int i = 0; i < x->p.elements * x->width; i++) x->value[i] = x->terms[i] = x->size[i] = 0;
}

static void scene_holonomic (scene *x) {
  int n = x->p.elements * x->p.rows;
  pw_probe_evaluate (&x->p, x->p.kind->J, "J", n * x->p.cols, x->block);
  pw_probe_multiply (&x->p, x->block, x->p.rows, x->p.dq, 1, x->value, x->terms);
  pw_probe_evaluate (&x->p, x->p.kind->g_size, "g_size", n, x->size);
  scene_compare (x, "J", "J = dg/dq", x->p.rows, pw_probe_g, PW_PROBE_Q);
  pw_probe_eta (&x->p, x->value);
  for (int i = 0; i < n; i++) x->value[i] *= -x->p.tau;
  scene_compare (x, "eta", "eta = -dg/dt", x->p.rows, pw_probe_g, PW_PROBE_TIME);
}

static void scene_acceleration (scene *x) {
  int n = x->p.elements * x->p.rows;
  double tau = x->p.tau;
  pw_probe_gamma (&x->p, x->derivative);
  pw_probe_evaluate (&x->p, x->p.kind->J, "J", n * x->p.cols, x->block);
  pw_probe_multiply (&x->p, x->block, x->p.rows, x->p.a, tau, x->value, x->terms);
  for (int i = 0; i < n; i++) x->value[i] -= tau * x->derivative[i], x->terms[i] += fabs (tau * x->derivative[i]);
  scene_compare (x, "gamma", "J a - gamma = d(J v - eta)/dt", x->p.rows, pw_probe_drift, PW_PROBE_MOTION);
}

static void scene_block (scene *x, pw_block block, const char *name, const char *about, pw_probe_function *f) {
  int rows = pw_block_rows (x->p.kind, block);
  pw_probe_move move = block == PW_GAMMA_V || block == PW_FORCE_V ? PW_PROBE_V : PW_PROBE_Q;
  if (pw_evaluate_block (x->p.work, x->p.k, block, x->block))
    pw_probe_multiply (&x->p, x->block, rows, move == PW_PROBE_V ? x->p.dv : x->p.dq, 1, x->value, x->terms);
  scene_compare (x, name, about, rows, f, move);
}

/* Signals that read states: their gradients. */
static void scene_signals (pw_probe *x, double *out) {
  for (int i = 0; i < x->elements * x->kind->signals; i++) out[i] = x->k->u[3 * i];
}

static void scene_gradients (scene *x, pw_probe_move move) {
  int signals = x->p.kind->signals, coords = x->p.s->coords;
  for (int i = 0; i < x->p.elements * signals; i++) {
    const pw_source *source = &x->p.k->source[i];
    for (int k = 0; k < source->reads; k++) {
      int j = source->state[k], velocity = j >= coords;
      if (velocity != (move == PW_PROBE_V)) continue;
      double term = source->x[source->reads + k] * (velocity ? x->p.dv[j - coords] : x->p.dq[j]);
      x->value[i] += term, x->terms[i] += fabs (term);
    }
  }
  scene_compare (x, "gradient", "gradient = d signal/d state", signals, scene_signals, move);
}

static void scene_all (scene *x) {
  const pw_kind *kind = x->p.kind;
  pw_probe_update (&x->p, PW_PROBE_Q, 0);
  if (kind->level == PW_HOLONOMIC) scene_holonomic (x);
  if (kind->rows > 0) {
    scene_acceleration (x);
    scene_block (x, PW_JW_Q, "jw_q", "jw_q = d(J w)/dq", pw_probe_Jw);
    scene_block (x, PW_ETA_Q, "eta_q", "eta_q = d eta/dq", pw_probe_eta);
    scene_block (x, PW_GAMMA_Q, "gamma_q", "gamma_q = d gamma/dq", pw_probe_gamma);
    scene_block (x, PW_GAMMA_V, "gamma_v", "gamma_v = d gamma/dv", pw_probe_gamma);
  }
  if (kind->force_u && x->p.s->state_dependent) {
    scene_gradients (x, PW_PROBE_Q);
    scene_gradients (x, PW_PROBE_V);
  }
  pw_hold_signals (x->p.work, 1); /* force_q and force_v exclude the dependence of signals on the state */
  scene_block (x, PW_FORCE_Q, "force_q", "force_q = d force/dq", pw_probe_force);
  scene_block (x, PW_FORCE_V, "force_v", "force_v = d force/dv", pw_probe_force);
  pw_hold_signals (x->p.work, 0);
}

/* ---- The motion ---- */

static void scene_randomise (pw_probe *x, const double *q, const double *v, pw_random *r) {
  double T = x->work->scale.time, *w = x->v_now; /* until the state is updated */
  for (int j = 0; j < x->s->coords; j++) {
    double unit = pw_unit (x->s, j);
    x->q[j] = q[j];
    x->v[j] = v[j] + unit / T * pw_random_between (r, -1, 1);
    x->a[j] = unit / T / T * pw_random_between (r, -1, 1);
    x->dq[j] = unit * pw_random_between (r, -1, 1);
    x->dv[j] = unit / T * pw_random_between (r, -1, 1);
    w[j] = unit * pw_random_between (r, -1, 1);
  }
  for (int i = 0; i < x->elements * x->cols; i++) x->w[i] = pw_probe_local (x, w, i / x->cols, i % x->cols);
  for (int i = 0; i < x->elements * x->rows; i++) x->lambda[i] = pw_random_between (r, -1, 1);
  /* no breakpoint of a signal between the times used */
  x->tau = fmin (T, pw_next_breakpoint (x->work, 0, x->t) - x->t) / 2;
  x->t += x->tau;
}

static int scene_open (scene *x, pw_error *error) {
  if (pw_probe_open (&x->p, error) != PW_OK) return PW_RESOURCE;
  x->width = x->p.cols > x->p.rows ? x->p.cols : x->p.rows;
  if (x->width < PW_MAX_SIGNALS) x->width = PW_MAX_SIGNALS;
  size_t values = (size_t)(x->p.elements * x->width), n = values + PW_PROBE_GUARD;
  const pw_array array[] = {
    { &x->plus, n },       { &x->minus, n },
    { &x->derivative, n }, { &x->value, n },
    { &x->terms, n },      { &x->error, n },
    { &x->size, n },       { &x->block, values * (size_t)x->width + PW_PROBE_GUARD },
  };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  return x->memory ? PW_OK : pw_fail (error, PW_RESOURCE, "model %s: out of memory", x->p.s->model);
}

/* Reports the signal, and no checks, which have compared its last values. */
static int scene_fail_signal (scene *x, pw_error *error) {
  char signal[160];
  *x->p.report = (pw_selftest_report){ 0 };
  return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed: %s is not a finite number", x->p.t,
                  pw_failed_signal (x->p.work, signal, sizeof signal));
}

int pw_selftest_scene (const pw_system *s, double T, const pw_kind *kind, double t, const double *q, const double *v,
                       unsigned seed, pw_selftest_report *report, pw_error *error) {
  pw_random random = { seed };
  pw_workspace *w = pw_workspace_new (s, error);
  if (w == NULL) return PW_RESOURCE;
  w->scale.time = T;
  scene x = { .p = { .s = s, .work = w, .k = w->batch, .t = t, .report = report } };
  while (x.p.k < w->batch + s->batches && x.p.k->kind != kind) x.p.k++;
  int used = x.p.k < w->batch + s->batches && x.p.k->b.count > 0, status = used ? scene_open (&x, error) : PW_OK;
  if (used && status == PW_OK) {
    scene_randomise (&x.p, q, v, &random);
    scene_all (&x);
    if (x.p.failed) status = scene_fail_signal (&x, error);
  }
  free (x.memory);
  free (x.p.memory);
  pw_workspace_free (w);
  return status;
}
