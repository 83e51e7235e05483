/* The probe of the self-tests: see probe.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "probe.h"

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

int pw_probe_open (pw_probe *x, pw_error *error) {
  x->kind = x->k->kind;
  x->elements = x->k->b.count, x->rows = x->kind->rows, x->cols = x->k->b.cols;
  size_t n = (size_t)x->s->coords, rows = (size_t)(x->elements * x->rows), cols = (size_t)x->cols;
  const pw_array array[] = {
    { &x->q, n },
    { &x->v, n },
    { &x->a, n },
    { &x->dq, n },
    { &x->dv, n },
    { &x->q_now, n },
    { &x->v_now, n },
    { &x->w, (size_t)x->elements * cols },
    { &x->lambda, rows },
    { &x->J, rows * cols + PW_PROBE_GUARD },
    { &x->eta, rows + PW_PROBE_GUARD },
  };
  x->memory = pw_alloc_arrays (array, sizeof array / sizeof *array);
  x->k->b.w = x->w, x->k->b.lambda = x->lambda;
  return x->memory ? PW_OK : pw_fail (error, PW_RESOURCE, "model %s: out of memory", x->s->model);
}

void pw_probe_update (pw_probe *x, pw_probe_move move, double h) {
  double step = move == PW_PROBE_MOTION ? h * x->tau : 0;
  for (int j = 0; j < x->s->coords; j++) {
    x->q_now[j] = x->q[j] + step * (x->v[j] + step * x->a[j] / 2) + (move == PW_PROBE_Q ? h * x->dq[j] : 0);
    x->v_now[j] = x->v[j] + step * x->a[j] + (move == PW_PROBE_V ? h * x->dv[j] : 0);
  }
  const double t = move == PW_PROBE_TIME || move == PW_PROBE_MOTION ? x->t + h * x->tau : x->t;
  x->failed |= pw_update_kinematics (x->work, t, x->q_now, x->v_now) != PW_OK;
}

/* ---- Functions ---- */

void pw_probe_evaluate (pw_probe *x, pw_batch_function *f, const char *name, int n, double *out) {
  for (int i = 0; i < n + PW_PROBE_GUARD; i++) out[i] = f ? NAN : 0;
  if (f == NULL) return;
  f (&x->k->b, out);
  if (!x->check_sizes) return;
  char where[120];
  int untouched = 0, beyond = 0;
  for (int i = 0; i < n; i++) untouched += !isfinite (out[i]);
  for (int i = n; i < n + PW_PROBE_GUARD; i++) beyond += !isnan (out[i]);
  snprintf (where, sizeof where, "%s: %d of %d entries missing or not finite, %d written beyond", name, untouched, n,
            beyond);
  pw_probe_record (x->report, "size", "each function fills exactly its array", untouched + beyond, 0, "exact", where);
}

void pw_probe_g (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->g, "g", x->elements * x->rows, out);
}

void pw_probe_eta (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->eta, "eta", x->elements * x->rows, out);
}

void pw_probe_gamma (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->gamma, "gamma", x->elements * x->rows, out);
}

void pw_probe_force (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->force, "force", x->elements * x->cols, out);
}

void pw_probe_Jw (pw_probe *x, double *out) {
  pw_probe_evaluate (x, x->kind->J, "J", x->elements * x->rows * x->cols, x->J);
  for (int i = 0; i < x->elements * x->rows; i++) {
    out[i] = 0;
    for (int c = 0; c < x->cols; c++) out[i] += x->J[i * x->cols + c] * x->w[i / x->rows * x->cols + c];
  }
}

void pw_probe_drift (pw_probe *x, double *out) {
  pw_probe_eta (x, x->eta);
  pw_probe_multiply_J (x, x->v_now, out);
  for (int i = 0; i < x->elements * x->rows; i++) out[i] -= x->eta[i];
}

/* ---- Products ---- */

int pw_probe_ground (const pw_probe *x, int e, int c) {
  return pw_global (x->k, e, c) >= x->s->coords;
}

double pw_probe_local (const pw_probe *x, const double *vector, int e, int c) {
  return pw_probe_ground (x, e, c) ? 0 : vector[pw_global (x->k, e, c)];
}

void pw_probe_multiply (const pw_probe *x, const double *block, int rows, const double *vector, double factor,
                        double *out, double *terms) {
  for (int i = 0; i < x->elements * rows; i++)
    for (int c = 0; c < x->cols; c++) {
      double term = factor * block[i * x->cols + c] * pw_probe_local (x, vector, i / rows, c);
      out[i] += term;
      if (terms) terms[i] += fabs (term);
    }
}

void pw_probe_multiply_J (pw_probe *x, const double *vector, double *out) {
  pw_probe_evaluate (x, x->kind->J, "J", x->elements * x->rows * x->cols, x->J);
  memset (out, 0, (size_t)(x->elements * x->rows) * sizeof *out);
  pw_probe_multiply (x, x->J, x->rows, vector, 1, out, NULL);
}
