/* See saddle_scene.h. */
#include <math.h>
#include <stdlib.h>
#include "check.h"
#include "method.h"
#include "runs.h"
#include "saddle_scene.h"
#include "scene.h"

typedef struct {
  pw_run *run;
  const double *weight;
  int rows;
  unsigned random;
} trial;

double saddle_number (unsigned *random) {
  *random = *random * 1664525U + 1013904223U;
  return (double)(*random >> 8) / 8388608.0 - 1;
}

/* The errors of both equations, relative to their terms. */
static double saddle_error (const trial *x, const double *f, const double *gamma, const double *a,
                            const double *lambda) {
  const pw_system *s = x->run->s;
  double most = 0, size = 0, *left = calloc ((size_t)(s->coords + 3 + s->rows), sizeof *left);
  double *Ja = left + s->coords + 3;
  pw_add_JT (x->run->w, lambda, left);
  for (int j = 0; j < s->coords; j++) size = fmax (size, fabs (left[j]) + fabs (x->weight[j] * a[j]));
  for (int j = 0; j < s->coords; j++)
    most = fmax (most, fabs (left[j] + x->weight[j] * a[j] - (f ? f[j] : 0)) / (1 + size));
  pw_mul_J (x->run->w, a, Ja);
  size = 0;
  for (int i = 0; i < x->rows; i++) size = fmax (size, fabs (gamma[i]));
  for (int j = 0; j < s->coords; j++) size = fmax (size, fabs (a[j]));
  for (int i = 0; i < x->rows; i++)
    if (x->run->active == NULL || x->run->active[i]) most = fmax (most, fabs (Ja[i] - gamma[i]) / size);
  free (left);
  return most;
}

/* Factorises at a configuration with NaN angles, as after a far too large step, and returns to the former
 * configuration. */
static void saddle_spoil (trial *x, pw_saddle *k, unsigned *random) {
  pw_run *r = x->run;
  size_t coords = (size_t)r->s->coords;
  double *q = malloc (coords * sizeof *q);
  for (size_t j = 0; j < coords; j++) q[j] = r->q[j] + saddle_number (random);
  for (size_t j = 2; j < 3 * (size_t)r->s->bodies; j += 3)
    if (saddle_number (random) > 0.3) q[j] = NAN;
  assert_int_equal (pw_update_kinematics (r->w, r->t, q, r->v), PW_OK);
  pw_evaluate_J (r->w);
  pw_saddle_factor (k);
  assert_int_equal (pw_update_kinematics (r->w, r->t, r->q, r->v), PW_OK);
  pw_evaluate_J (r->w);
  free (q);
}

/* Solves with and without forces, after the factorisation and together with it; multipliers of inactive rows are 0. */
static double saddle_solve (trial *x) {
  const pw_system *s = x->run->s;
  size_t coords = (size_t)s->coords + 3, rows = (size_t)s->rows;
  double *f = calloc (3 * coords + 3 * rows + 1, sizeof *f), *a = f + coords, *gamma = a + coords;
  double *lambda = gamma + rows, worst = 0;
  pw_error error = { 0 };
  pw_saddle *k = pw_saddle_open (x->run->w, x->weight, x->rows, x->run->active, &error);
  check_ok (k ? PW_OK : error.status, &error);
  for (int pass = 0; pass < 4; pass++) {
    const double *force = pass & 1 ? f : NULL;
    if (pass > 0) saddle_spoil (x, k, &x->random);
    for (int j = 0; j < s->coords; j++) f[j] = saddle_number (&x->random);
    for (int i = 0; i < s->rows; i++) gamma[i] = saddle_number (&x->random), lambda[i] = 0;
    assert_int_equal (pw_saddle_factor (k), PW_OK);
    pw_saddle_solve (k, force, gamma, a, lambda);
    worst = fmax (worst, saddle_error (x, force, gamma, a, lambda));
    assert_int_equal (pw_saddle_factor_solve (k, force, gamma, a, lambda), PW_OK);
    worst = fmax (worst, saddle_error (x, force, gamma, a, lambda));
  }
  pw_saddle_close (k);
  free (f);
  return worst;
}

double saddle_scene (pw_system *s, double t_end, int all) {
  pw_error error = { 0 };
  pw_run *r = pw_run_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 }, &error);
  double worst = r ? 0 : -1;
  for (int moment = 0; r && moment < 2; moment++) {
    if (moment > 0) check_ok (pw_run_advance_to (r, t_end, t_end, &error), &error);
    assert_int_equal (pw_update_kinematics (r->w, r->t, r->q, r->v), PW_OK);
    pw_evaluate_J (r->w);
    for (int which = 0; which < 4; which += all ? 1 : 2) {
      trial x = { .run = r, .weight = which & 1 ? s->metric : s->mass, .random = (unsigned)(7 * which + moment) };
      x.rows = which & 2 ? s->holonomic : s->rows;
      int massless = 0;
      for (int j = 0; j < s->coords; j++) massless |= x.weight[j] == 0;
      if (massless && x.rows < s->rows) continue; /* not determined by these rows */
      worst = fmax (worst, saddle_solve (&x));
    }
  }
  if (r) pw_run_close (r);
  pw_system_free (s);
  return worst;
}
