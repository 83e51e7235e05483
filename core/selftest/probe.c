/* The probe of the self-tests: see probe.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "probe.h"

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
