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
#include <string.h>
#include "probe.h"

#define SCENE_BOUND 1e-5
static const char scene_reason[] = "1e-5 of the sum of all terms: the best of several differences";

typedef enum { SCENE_Q, SCENE_V, SCENE_TIME, SCENE_MOTION } scene_move;

typedef struct {
  const pw_system *s;
  pw_workspace *work;
  pw_element_batch *k;
  double t, tau;                        /* the time, and its largest change */
  double *q, *v, *a, *dq, *dv, *w;      /* coords: the state and its motion; directions */
  double *q_now, *v_now;                /* coords: the current state */
  double *local, *lambda;               /* count x cols: w; count x rows */
  double *J, *block;                    /* count x largest block */
  double *plus, *minus, *derivative;    /* count x cols, or rows */
  double *value, *terms, *error, *size; /* the same: tested value, sum of |terms|, least error, reference size */
  pw_selftest_report *report;
  char *memory;
} scene;

typedef void scene_function (scene *x, double *out);

/* ---- Moving ---- */

static void scene_update (const scene *x, scene_move move, double h) {
  double step = move == SCENE_MOTION ? h * x->tau : 0;
  for (int j = 0; j < x->s->coords; j++) {
    x->q_now[j] = x->q[j] + step * (x->v[j] + step * x->a[j] / 2) + (move == SCENE_Q ? h * x->dq[j] : 0);
    x->v_now[j] = x->v[j] + step * x->a[j] + (move == SCENE_V ? h * x->dv[j] : 0);
  }
  pw_update_kinematics (x->work, move >= SCENE_TIME ? x->t + h * x->tau : x->t, x->q_now, x->v_now);
}

/* ---- Products ---- */

static double scene_local (const scene *x, const double *vector, int e, int c) {
  int j = pw_global (x->k, e, c);
  return j < x->s->coords ? vector[j] : 0;
}

/* out += factor x block x vector, element by element; terms, unless NULL, += absolute values of the terms. */
static void scene_multiply (const scene *x, const double *block, int rows, const double *vector, double factor,
                            double *out, double *terms) {
  int cols = x->k->b.cols;
  for (int i = 0; i < x->k->b.count * rows; i++)
    for (int c = 0; c < cols; c++) {
      double term = factor * block[i * cols + c] * scene_local (x, vector, i / rows, c);
      out[i] += term;
      if (terms) terms[i] += fabs (term);
    }
}

static void scene_zero (double *out, int n) {
  memset (out, 0, (size_t)n * sizeof *out);
}

static void scene_evaluate (scene *x, pw_batch_function *function, int rows, double *out) {
  scene_zero (out, x->k->b.count * rows);
  if (function) function (&x->k->b, out);
}

/* ---- Functions of the state ---- */

static void scene_g (scene *x, double *out) {
  scene_evaluate (x, x->k->kind->g, x->k->kind->rows, out);
}

static void scene_eta (scene *x, double *out) {
  scene_evaluate (x, x->k->kind->eta, x->k->kind->rows, out);
}

static void scene_gamma (scene *x, double *out) {
  scene_evaluate (x, x->k->kind->gamma, x->k->kind->rows, out);
}

static void scene_force (scene *x, double *out) {
  scene_evaluate (x, x->k->kind->force, x->k->b.cols, out);
}

static void scene_multiply_J (scene *x, const double *vector, double *out) {
  x->k->kind->J (&x->k->b, x->J);
  scene_zero (out, x->k->b.count * x->k->kind->rows);
  scene_multiply (x, x->J, x->k->kind->rows, vector, 1, out, NULL);
}

static void scene_Jw (scene *x, double *out) {
  scene_multiply_J (x, x->w, out);
}

/* J v - eta */
static void scene_drift (scene *x, double *out) {
  int rows = x->k->kind->rows;
  double *eta = x->block;
  scene_multiply_J (x, x->v_now, out);
  scene_eta (x, eta);
  for (int i = 0; i < x->k->b.count * rows; i++) out[i] -= eta[i];
}

/* ---- Comparing ---- */

/* The largest of the terms of the element of entry k: its derivatives with respect to positions multiply round-off of
 * these. */
static double scene_largest_term (const scene *x, int k, int rows) {
  double most = 0;
  for (int i = k - k % rows; i < k - k % rows + rows; i++) most = fmax (most, x->terms[i]);
  return most;
}

/* Updates the least error of each entry by differences with step h. */
static void scene_differences (scene *x, scene_function *f, scene_move move, int rows, double h) {
  int n = x->k->b.count * rows;
  static const double weight[] = { 4. / 3, -1. / 3 }; /* extrapolated (Richardson) */
  scene_zero (x->derivative, n);
  for (int i = 0; i < 2; i++) {
    double far = ldexp (h, i);
    scene_update (x, move, far);
    f (x, x->plus);
    scene_update (x, move, -far);
    f (x, x->minus);
    for (int k = 0; k < n; k++) x->derivative[k] += weight[i] * (x->plus[k] - x->minus[k]) / (2 * far);
  }
  for (int k = 0; k < n; k++) {
    double noise = 256 * DBL_EPSILON * ((fabs (x->plus[k]) + x->size[k]) / h + scene_largest_term (x, k, rows));
    double error =
        fmax (0, fabs (x->value[k] - x->derivative[k]) - noise) / (x->terms[k] + fabs (x->derivative[k]) + DBL_MIN);
    if (!(error >= x->error[k])) x->error[k] = error;
  }
}

/* Compares x->value, rows per element, with the derivative of f; x->terms and x->size belong to it. */
static void scene_compare (scene *x, const char *name, const char *about, int rows, scene_function *f,
                           scene_move move) {
  int n = x->k->b.count * rows, at = 0;
  char where[120] = "";
  for (int k = 0; k < n; k++) x->error[k] = INFINITY;
  for (int power = -8; power >= -20; power -= 4) scene_differences (x, f, move, rows, ldexp (1, power));
  scene_update (x, SCENE_Q, 0);
  for (int k = 0; k < n; k++)
    if (!(x->error[k] <= x->error[at])) at = k;
  if (n > 0)
    snprintf (where, sizeof where, "%s %s, row %d: %.9g, expected %.9g", x->k->kind->name, x->k->name[at / rows],
              at % rows, x->value[at], x->derivative[at]);
  pw_probe_record (x->report, name, about, n > 0 ? x->error[at] : 0, SCENE_BOUND, scene_reason, where);
}

/* Most values per element in any comparison. */
static int scene_max_values (const scene *x) {
  int width = x->k->b.cols > x->k->kind->rows ? x->k->b.cols : x->k->kind->rows;
  return width > PW_MAX_SIGNALS ? width : PW_MAX_SIGNALS;
}

/* Clears the arrays of a comparison. */
static void scene_clear (scene *x) {
  int n = x->k->b.count * scene_max_values (x);
  scene_zero (x->value, n);
  scene_zero (x->terms, n);
  scene_zero (x->size, n);
}

static void scene_holonomic (scene *x) {
  int rows = x->k->kind->rows, n = x->k->b.count * rows;
  scene_clear (x);
  scene_evaluate (x, x->k->kind->J, rows * x->k->b.cols, x->J);
  scene_multiply (x, x->J, rows, x->dq, 1, x->value, x->terms);
  scene_evaluate (x, x->k->kind->g_size, rows, x->size);
  scene_compare (x, "J", "J = dg/dq", rows, scene_g, SCENE_Q);
  scene_clear (x);
  scene_eta (x, x->value);
  for (int i = 0; i < n; i++) x->value[i] *= -x->tau;
  scene_compare (x, "eta", "eta = -dg/dt", rows, scene_g, SCENE_TIME);
}

static void scene_acceleration (scene *x) {
  int rows = x->k->kind->rows, n = x->k->b.count * rows;
  scene_clear (x);
  scene_gamma (x, x->derivative);
  scene_evaluate (x, x->k->kind->J, rows * x->k->b.cols, x->J);
  scene_multiply (x, x->J, rows, x->a, x->tau, x->value, x->terms);
  for (int i = 0; i < n; i++) x->value[i] -= x->tau * x->derivative[i], x->terms[i] += fabs (x->tau * x->derivative[i]);
  scene_compare (x, "gamma", "J a - gamma = d(J v - eta)/dt", rows, scene_drift, SCENE_MOTION);
}

static void scene_block (scene *x, pw_block block, const char *name, const char *about, scene_function *f) {
  int rows = pw_block_rows (x->k->kind, block);
  scene_move move = block == PW_GAMMA_V || block == PW_FORCE_V ? SCENE_V : SCENE_Q;
  scene_clear (x);
  x->k->b.w = x->local;
  x->k->b.lambda = x->lambda;
  if (pw_evaluate_block (x->work, x->k, block, x->block))
    scene_multiply (x, x->block, rows, move == SCENE_V ? x->dv : x->dq, 1, x->value, x->terms);
  scene_compare (x, name, about, rows, f, move);
}

/* Signals that read states: their gradients. */
static void scene_value (scene *x, double *out) {
  int n = x->k->b.count * x->k->kind->signals;
  for (int i = 0; i < n; i++) out[i] = x->k->u[3 * i];
}

static void scene_gradients (scene *x, scene_move move) {
  int signals = x->k->kind->signals, n = x->k->b.count * signals;
  scene_clear (x);
  for (int i = 0; i < n; i++) {
    const pw_source *source = &x->k->source[i];
    for (int k = 0; k < source->reads; k++) {
      int j = source->state[k], velocity = j >= x->s->coords;
      if (velocity != (move == SCENE_V)) continue;
      double term = source->x[source->reads + k] * (velocity ? x->dv[j - x->s->coords] : x->dq[j]);
      x->value[i] += term, x->terms[i] += fabs (term);
    }
  }
  scene_compare (x, "gradient", "gradient = d signal/d state", signals, scene_value, move);
}

static void scene_all (scene *x) {
  const pw_kind *kind = x->k->kind;
  scene_update (x, SCENE_Q, 0);
  if (kind->level == PW_HOLONOMIC) scene_holonomic (x);
  if (kind->rows > 0) {
    scene_acceleration (x);
    scene_block (x, PW_JW_Q, "jw_q", "jw_q = d(J w)/dq", scene_Jw);
    scene_block (x, PW_ETA_Q, "eta_q", "eta_q = d eta/dq", scene_eta);
    scene_block (x, PW_GAMMA_Q, "gamma_q", "gamma_q = d gamma/dq", scene_gamma);
    scene_block (x, PW_GAMMA_V, "gamma_v", "gamma_v = d gamma/dv", scene_gamma);
  }
  if (kind->force_u && x->s->state_dependent) {
    scene_gradients (x, SCENE_Q);
    scene_gradients (x, SCENE_V);
  }
  pw_hold_signals (x->work, 1); /* force_q and force_v exclude the dependence of signals on the state */
  scene_block (x, PW_FORCE_Q, "force_q", "force_q = d force/dq", scene_force);
  scene_block (x, PW_FORCE_V, "force_v", "force_v = d force/dv", scene_force);
  pw_hold_signals (x->work, 0);
}

/* ---- The motion ---- */

static void scene_randomise (scene *x, const double *q, const double *v, pw_random *r) {
  double T = x->work->scale.time;
  for (int j = 0; j < x->s->coords; j++) {
    double unit = pw_unit (x->s, j);
    x->q[j] = q[j];
    x->v[j] = v[j] + unit / T * pw_random_between (r, -1, 1);
    x->a[j] = unit / T / T * pw_random_between (r, -1, 1);
    x->dq[j] = unit * pw_random_between (r, -1, 1);
    x->dv[j] = unit / T * pw_random_between (r, -1, 1);
    x->w[j] = unit * pw_random_between (r, -1, 1);
  }
  for (int i = 0; i < x->k->b.count * x->k->b.cols; i++)
    x->local[i] = scene_local (x, x->w, i / x->k->b.cols, i % x->k->b.cols);
  for (int i = 0; i < x->k->b.count * x->k->kind->rows; i++) x->lambda[i] = pw_random_between (r, -1, 1);
  /* no breakpoint of a signal between the times used */
  x->tau = fmin (T, pw_next_breakpoint (x->work, 0, x->t) - x->t) / 2;
  x->t += x->tau;
}

static int scene_open (scene *x) {
  size_t n = (size_t)x->s->coords, width = (size_t)scene_max_values (x), each = (size_t)x->k->b.count * width;
  const pw_array array[] = {
    { &x->q, n },
    { &x->v, n },
    { &x->a, n },
    { &x->dq, n },
    { &x->dv, n },
    { &x->w, n },
    { &x->q_now, n },
    { &x->v_now, n },
    { &x->local, each },
    { &x->lambda, each },
    { &x->J, each * width },
    { &x->block, each * width },
    { &x->plus, each },
    { &x->minus, each },
    { &x->derivative, each },
    { &x->value, each },
    { &x->terms, each },
    { &x->error, each },
    { &x->size, each },
  };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  return x->memory ? PW_OK : PW_RESOURCE;
}

int pw_selftest_scene (const pw_system *s, double T, const pw_kind *kind, double t, const double *q, const double *v,
                       unsigned seed, pw_selftest_report *report, pw_error *error) {
  pw_random random = { seed };
  pw_workspace *w = pw_workspace_new (s, error);
  if (w == NULL) return PW_RESOURCE;
  int status = PW_OK;
  w->scale.time = T;
  for (pw_element_batch *k = w->batch; k < w->batch + s->batches && status == PW_OK; k++) {
    if (k->kind != kind || k->b.count == 0) continue;
    scene x = { .s = s, .work = w, .k = k, .t = t, .report = report };
    if (scene_open (&x) == PW_OK) {
      scene_randomise (&x, q, v, &random);
      scene_all (&x);
    } else
      status = pw_fail (error, PW_RESOURCE, "model %s: out of memory", s->model);
    free (x.memory);
  }
  pw_workspace_free (w);
  return status;
}
