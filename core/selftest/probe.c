/* The self-test's probe: a random state of a random scene, and the derivatives of an element type's functions there. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "probe.h"

/* Central differences with a step of about eps^(1/3) have an error of the order eps^(2/3) times the function's size,
 * from truncation and from round-off alike (Dennis & Schnabel 1983, section 5.6).  All numbers in the scene are of
 * the order 1, so the sizes of a function and of its third derivative are about the same. */
const char pw_probe_reason[] = "100 eps^(2/3) of the largest term: central differences";

/* ---- The report ---- */

double pw_probe_bound (void) {
  return 100 * cbrt (DBL_EPSILON) * cbrt (DBL_EPSILON);
}

void pw_probe_record (pw_selftest_report *r, const char *name, const char *about, double error, double bound,
                      const char *reason, const char *where) {
  pw_selftest_check *c = r->check;
  while (c < r->check + r->checks && strcmp (c->name, name) != 0) c++;
  if (c == r->check + r->checks) {
    r->checks++;
    *c = (pw_selftest_check){ .name = name, .about = about, .error = -1, .bound = bound, .reason = reason };
  }
  if (isnan (error)) error = INFINITY;
  if (!(error <= bound) && !c->failed) c->failed = 1, r->failed++;
  if (error <= c->error) return;
  c->error = error;
  snprintf (c->where, sizeof c->where, "%s", where);
}

int pw_probe_ground (const pw_probe *x, int e, int c) {
  return pw_global (x->k, e, c) >= x->s->coords;
}

void pw_probe_compare (pw_probe *x, const char *name, const char *about, int rows, int cols, const double *value,
                       const double *reference) {
  double size = 1 + x->size, worst = -1;
  int n = x->elements * rows * cols, at = 0;
  for (int i = 0; i < n; i++) size = fmax (size, fabs (reference[i]));
  for (int i = 0; i < n; i++) {
    if (cols == x->cols && pw_probe_ground (x, i / (rows * cols), i % cols)) continue;
    double error = fabs (value[i] - reference[i]) / size;
    if (isnan (error)) error = INFINITY;
    if (error > worst) worst = error, at = i;
  }
  char where[120];
  snprintf (where, sizeof where, "%s, row %d, column %d: %.9g, expected %.9g", x->k->name[at / (rows * cols)],
            at / cols % rows, at % cols, value[at], reference[at]);
  pw_probe_record (x->report, name, about, worst, pw_probe_bound (), pw_probe_reason, where);
}

/* ---- The state ---- */

/* Bodies near the corners of a square, everything else at random. */
void pw_probe_randomise (pw_probe *x, pw_random *r) {
  static const double corner[PW_SCENE_BODIES][2] = { { 2, 2 }, { -2, 2 }, { -2, -2 }, { 2, -2 } };
  x->t = pw_random_between (r, 0.1, 3);
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
  x->k->b.w = x->w;
  x->k->b.lambda = x->lambda;
}

/* ---- Functions of the state, and their derivatives ---- */

void pw_probe_evaluate (pw_probe *x, pw_batch_function *f, const char *name, int n, double *out) {
  for (int i = 0; i < n + PW_PROBE_GUARD; i++) out[i] = f ? NAN : 0;
  if (f == NULL) return;
  f (&x->k->b, out);
  char where[120];
  int untouched = 0, beyond = 0;
  for (int i = 0; i < n; i++) untouched += !isfinite (out[i]);
  for (int i = n; i < n + PW_PROBE_GUARD; i++) beyond += !isnan (out[i]);
  snprintf (where, sizeof where, "%s: %d of %d entries missing or not finite, %d written beyond", name, untouched, n,
            beyond);
  pw_probe_record (x->report, "size", "each function fills exactly its array", untouched + beyond, 0, "exact", where);
}

void pw_probe_update (pw_probe *x, int j, double h) {
  int motion = j == PW_PROBE_MOTION;
  for (int i = 0; i < x->s->coords; i++) {
    x->q_now[i] = x->q[i] + (motion ? h * (x->v[i] + h * x->a[i] / 2) : i == j ? h : 0);
    x->v_now[i] = x->v[i] + (motion ? h * x->a[i] : 0);
  }
  pw_update_kinematics (x->work, j < 0 ? x->t + h : x->t, x->q_now, x->v_now);
}

double pw_probe_local (const pw_probe *x, const double *vector, int e, int c) {
  return pw_probe_ground (x, e, c) ? 0 : vector[pw_global (x->k, e, c)];
}

void pw_probe_multiply_J (pw_probe *x, const double *w, double *out) {
  double J[PW_PROBE_OUT + PW_PROBE_GUARD];
  pw_probe_evaluate (x, x->kind->J, "J", x->elements * x->rows * x->cols, J);
  for (int i = 0; i < x->elements * x->rows; i++) {
    out[i] = 0;
    for (int c = 0; c < x->cols; c++) out[i] += J[i * x->cols + c] * pw_probe_local (x, w, i / x->rows, c);
  }
}

double pw_probe_largest (int n, const double *y) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (y[i]));
  return most;
}

void pw_probe_derivative (pw_probe *x, pw_probe_function *f, int j, int n, double *derivative) {
  double plus[PW_PROBE_OUT + PW_PROBE_GUARD], minus[PW_PROBE_OUT + PW_PROBE_GUARD];
  pw_probe_update (x, j, PW_PROBE_STEP);
  f (x, plus);
  pw_probe_update (x, j, -PW_PROBE_STEP);
  f (x, minus);
  pw_probe_update (x, j, 0);
  x->size = pw_probe_largest (n, plus);
  for (int i = 0; i < n; i++) derivative[i] = (plus[i] - minus[i]) / (2 * PW_PROBE_STEP);
}
