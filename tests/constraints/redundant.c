/* See redundant.h. */
#include <math.h>
#include "check.h"
#include "redundant.h"
#include "scene.h"
#include "trial.h"

static const char *const redundant_fixed[] = { "rk4+none",       "rk4+baumgarte",
                                               "rk4+projection", "rk4+projection:metric=identity",
                                               "rk4+nullspace",  NULL };
static const char *const redundant_second[] = { "galpha+index3", "galpha+ggl", "leapfrog", NULL }; /* of order 2 */
static const char *const redundant_adaptive[] = {
  "ida+none",     "ida+baumgarte", "ida+ggl",         "ida+index2", "ida+si1",       "adams+none",     "radau+ggl",
  "radau+index2", "radau+index3",  "adams+baumgarte", "bdf+none",   "bdf+baumgarte", "bdf+projection", NULL
};

void redundant_end (const pw_plugin_table *table, const char *method, double rtol, double t, const char *const *name,
                    double *end, double step) {
  pw_system *s = scene_system (table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .rtol = rtol, .span = t });
  pw_sample x = runs_to (r, t);
  for (int i = 0; name[i]; i++) end[i] = trial_state (s, &x, name[i]);
  runs_close (r, s);
}

double redundant_distance (const double *a, const double *b, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax (most, fabs (a[i] - b[i]));
  return most;
}

void redundant_twins (const pw_plugin_table *table, const pw_plugin_table *twin, double t, double step,
                      const char *const *name) {
  double a[REDUNDANT_COORDS], b[REDUNDANT_COORDS], exact[REDUNDANT_COORDS];
  const double rtol = 1e-8;
  int n = 0;
  while (name[n]) n++;
  assert_true (n <= REDUNDANT_COORDS);
  redundant_end (twin, "rk4+projection", rtol, t, name, exact, step);
  for (int i = 0; redundant_fixed[i]; i++) {
    redundant_end (table, redundant_fixed[i], rtol, t, name, a, step);
    redundant_end (twin, redundant_fixed[i], rtol, t, name, b, step);
    check_below (redundant_fixed[i], redundant_distance (a, b, n), 1e-12,
                 "round-off: the same motion by the same steps");
  }
  for (int i = 0; redundant_second[i]; i++) {
    redundant_end (table, redundant_second[i], rtol, t, name, a, step);
    redundant_end (twin, redundant_second[i], rtol, t, name, b, step);
    check_below (redundant_second[i], redundant_distance (a, b, n), redundant_distance (b, exact, n),
                 "the twin's own error: ggl weights angles by the length of the scene");
  }
  for (int i = 0; redundant_adaptive[i]; i++) {
    redundant_end (table, redundant_adaptive[i], rtol, t, name, a, step);
    redundant_end (twin, redundant_adaptive[i], rtol, t, name, b, step);
    check_below (redundant_adaptive[i], redundant_distance (a, b, n), 10 * redundant_distance (b, exact, n),
                 "10 times the twin's own error");
  }
}

void redundant_expect_reports (const pw_plugin_table *table, const char *const *text) {
  char buffer[500];
  int n = 0;
  while (text[n]) n++;
  pw_system *s = scene_system (table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_int_equal (pw_run_redundant (r), n);
  for (int i = 0; i < n; i++) assert_string_equal (pw_run_redundancy (r, i, buffer, sizeof buffer), text[i]);
  runs_close (r, s);
}
