/* Checks that every element type must pass; see trial.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "system.h"
#include "trial.h"
#include "pinwheel-selftest.h"

enum { TRIAL_COORDS = 40 };

double trial_state (const pw_system *s, const pw_sample *x, const char *name) {
  pw_error error = { 0 };
  int state = pw_system_find_state (s, name, &error);
  check_ok (state < 0 ? PW_INPUT : PW_OK, &error);
  return state < s->coords ? x->q[state] : x->v[state - s->coords];
}

double trial_reaction (const pw_system *s, const pw_sample *x, const char *name) {
  pw_error error = { 0 };
  int row = pw_system_find_reaction (s, name, &error);
  check_ok (row < 0 ? PW_INPUT : PW_OK, &error);
  return -x->lambda[row];
}

/* Sizes to which differences are relative: of the states, of the energy; at least 1. */
typedef struct {
  double state, energy;
} trial_size;

static trial_size trial_measure (const pw_system *s, const pw_sample *x) {
  trial_size size = { 1, 1 };
  for (int j = 0; j < s->coords; j++) size.state = fmax (size.state, fmax (fabs (x->q[j]), fabs (x->v[j])));
  size.energy += fabs (x->kinetic) + fabs (x->potential) + fabs (x->work) + fabs (x->loss);
  return size;
}

void trial_verify (const pw_system *s, const pw_run *r, const pw_sample *x, double bound, const char *reason) {
  pw_verification v;
  assert_int_equal (pw_verify (s, pw_run_scale (r), x->t, x->q, x->v, x->a, x->lambda, &v), PW_OK);
  check_below ("verifier, position", v.position.scaled, bound, reason);
  check_below ("verifier, velocity", v.velocity.scaled, bound, reason);
  check_below ("verifier, acceleration", v.acceleration.scaled, bound, reason);
  check_below ("verifier, force", v.force.scaled, bound, reason);
}

static void trial_compare (const pw_system *s, const char *method, const pw_sample *x, const double *reference,
                           double bound, const char *reason) {
  char name[60];
  for (int i = 0; i < 2 * s->coords; i++) {
    check_close (check_text ("%s %s", method, pw_system_state_name (s, i, name, sizeof name)),
                 i < s->coords ? x->q[i] : x->v[i - s->coords], reference[i], bound, reason);
  }
}

/* factor: the errors of the steps may add up to this multiple of rtol. */
static void trial_implicit (pw_system *s, const char *method, double factor, double t_end, const double *reference,
                            trial_size size) {
  const double rtol = 1e-9;
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = rtol, .span = t_end, .ledger = 1 });
  pw_sample x = runs_to (r, t_end);
  const pw_statistics *cost = pw_run_statistics (r);
  trial_compare (s, method, &x, reference, factor * rtol * size.state, "the sum of the errors of the steps");
  check_below (check_text ("%s: balance", method), fabs (x.balance), factor * rtol * size.energy,
               "the sum of the errors of the steps");
  check_below (check_text ("%s: rejected of %ld steps", method, cost->steps), (double)cost->rejected,
               10 + 0.1 * (double)cost->steps, "few rejections, since the Newton matrix is exact");
  pw_run_close (r);
}

void trial (const pw_plugin_table *table, double t_end) {
  double reference[2 * TRIAL_COORDS];
  pw_system *s = scene_system (table, NULL);
  assert_true (s->coords <= TRIAL_COORDS);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = t_end, .ledger = 1 });
  pw_sample x = runs_to (r, t_end);
  trial_size size = trial_measure (s, &x);
  memcpy (reference, x.q, (size_t)s->coords * sizeof *reference);
  memcpy (reference + s->coords, x.v, (size_t)s->coords * sizeof *reference);
  check_below ("balance", fabs (x.balance), 1e-9 * size.energy, "1000 h^4 at h = 1e-3");
  trial_verify (s, r, &x, 1e4 * CHECK_EPS, "round-off of a projected state");
  pw_run_close (r);
  trial_implicit (s, "ida+ggl", 1e3, t_end, reference, size);
  trial_implicit (s, "ida+baumgarte", 1e3, t_end, reference, size);
  trial_implicit (s, "radau+ggl", 1e3, t_end, reference, size);
  trial_implicit (s, "radau+index3", 1e3, t_end, reference, size);
  trial_implicit (s, "ida+si1", 1e3, t_end, reference, size);
  trial_implicit (s, "bdf+projection", 1e4, t_end, reference, size);
  trial_implicit (s, "bdf+baumgarte", 1e4, t_end, reference, size);
  pw_system_free (s);
}
