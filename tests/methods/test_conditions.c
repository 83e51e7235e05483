/* Conditions on states in signals: steps end where they change, and every method keeps its order. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "runs.h"
#include "scene.h"
#include "util.h"

const check_fixture fixture = { .setup = cli_setup, .teardown = cli_teardown };

/* A body of 1 kg with a force along x. */
static pw_system *conditions_scene (double x, double v, const char *force) {
  cli_write ("conditions.yaml",
             check_text ("pinwheel: 1\nbodies:\n  - {name: b, mass: 1, inertia: 1, start: {x: %.17g}, "
                         "rate: {vx: %.17g}}\nelements:\n  - {force: F, body: b, fx: '%s'}\n",
                         x, v, force));
  return scene_named (cli_path ("conditions.yaml"), NULL, 0);
}

/* x'' = -x - sign (x'): half turns about -1 and 1. */
static void conditions_oscillator (double T, double *x, double *v) {
  *x = 12, *v = 6;
  for (double t = 0;;) {
    const double centre = *v > 0 || (*v == 0 && *x < 0) ? -1 : 1, A = hypot (*x - centre, *v);
    const double phase = atan2 (-*v, *x - centre), end = t + (phase < 0 ? -phase : PW_PI - phase);
    const double to = phase + fmin (T, end) - t;
    *x = centre + A * cos (to), *v = end < T ? 0 : -A * sin (to);
    if (end >= T) return;
    t = end;
  }
}

/* A velocity threshold, a gear change, a stiff wall, a Coulomb oscillator: closed forms. */
TEST (closed_forms) {
  double x_end, v_end;
  conditions_oscillator (7, &x_end, &v_end);
  const struct {
    double x, v, T, x_end, v_end;
    int changes;
    const char *force;
  } of[] = {
    { 0, 1.3, 1.7, 0.3 * 1.3 - 0.135 + 0.4 * 1.4 - 0.98, -1, 1, "b.vx > 0.4 ? -3 : -1" },
    { 0, 0, 2, 1.0 / 6 + 5.0 / 3 + 25.0 / 18, 1 + 5.0 / 3, 1, "b.vx < 1 ? 3 : 1" },
    { 0, 1, 2.2, 1 - (2.2 - 1 - PW_PI / 1000), -1, 2, "-1e6*max (0, b.x - 1)" },
    { 12, 6, 7, x_end, v_end, 3, "-b.x - sign (b.vx)" },
  };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    const pw_settings settings = { .span = of[i].T, .rtol = 1e-9 };
    pw_system *s = conditions_scene (of[i].x, of[i].v, of[i].force);
    for (int m = 0; m < RUNS_ADAPTIVE; m++) {
      double q[3], v[3];
      pw_statistics statistics;
      runs_state (s, runs_adaptive[m], &settings, of[i].T, q, v, &statistics);
      const double bound = RUNS_STEPS * settings.rtol * (1 + fabs (of[i].x));
      check_close (runs_adaptive[m], q[0], of[i].x_end, bound, "steps");
      check_close (runs_adaptive[m], v[0], of[i].v_end, bound, "steps");
      check_close (runs_adaptive[m], (double)statistics.conditions, of[i].changes, 0, "all, and no others");
    }
    pw_system_free (s);
  }
}

/* Halved steps divide the error by 2^p. */
TEST (orders) {
  static const struct {
    const char *method;
    double order, step;
  } of[] = { { "rk4+none", 4, 0.1 },
             { "leapfrog+rattle", 2, 0.02 },
             { "galpha+ggl", 2, 0.02 },
             { "erk5+none:steps=fixed", 5, 0.1 },
             { "radau+ggl:steps=fixed", 5, 0.4 } };
  double x, v;
  pw_system *s = conditions_scene (12, 6, "-b.x - sign (b.vx)");
  conditions_oscillator (7, &x, &v);
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    double error[2];
    for (int k = 0; k < 2; k++) {
      double q[3], rates[3];
      runs_state (s, of[i].method, &(pw_settings){ .span = 7, .step = ldexp (of[i].step, -k) }, 7, q, rates, NULL);
      error[k] = hypot (q[0] - x, rates[0] - v);
    }
    check_close (of[i].method, log2 (error[0] / error[1]), of[i].order, 0.5, "higher terms");
  }
  pw_system_free (s);
}

static double conditions_between (uint64_t *r, double low, double high) {
  return low + (high - low) * ldexp ((double)(pw_random_bits (r) >> 11), -53);
}

/* Random conditions on an oscillating body: a run with a hundredth of the step finds the same changes. */
TEST (random) {
  int changes = 0;
  uint64_t r = 1;
  for (int i = 0; i < 50; i++) {
    char force[600] = "-9*b.x - 0.1*b.vx + cos (2*t)", term[100];
    for (int k = 0; k < 3; k++) {
      static const char *const form[] = { "%.3f*sign (b.x - %.3f)",
                                          "%.3f*abs (b.vx - %.3f)",
                                          "%.3f*max (0, b.x - %.3f)",
                                          "%.3f*floor (3*b.x + %.3f)",
                                          "(b.x + %.3f*b.vx > %.3f ? 1 : 0)",
                                          "%.3f*mod (b.x + 0.2*b.phi + %.3f, 1)",
                                          "(b.x > %.3f && b.vx < %.3f ? 2*b.x : 0.3)",
                                          "%.3f*min (b.x, b.vx, %.3f)" };
      const int which = (int)conditions_between (&r, 0, 7.999);
      const double a = conditions_between (&r, 0.2, 1.5), b = conditions_between (&r, -0.5, 0.5);
      snprintf (term, sizeof term, form[which], a, b);
      snprintf (force + strlen (force), sizeof force - strlen (force), " + %s", term);
    }
    pw_system *s = conditions_scene (conditions_between (&r, -1, 1), conditions_between (&r, -3, 3), force);
    const char *const method[] = { "rk4+none", "rk4+none", "erk8+none", "adams+none" };
    double q[4][3];
    pw_statistics n[4];
    int slides = 0;
    for (int k = 0; k < 4 && !slides; k++) {
      const pw_settings settings = { .span = 3, .step = k == 0 ? 2e-2 : 2e-4, .rtol = 1e-9 };
      pw_error error = { 0 };
      pw_run *run = pw_run_open (s, method[k], &settings, &error);
      assert_non_null (run);
      while (pw_run_time (run) < 3 && !slides) slides = pw_run_advance (run, 3, &error) != PW_OK;
      if (slides && strstr (error.text, "slides along it") == NULL) fail_msg ("%s: %s", force, error.text);
      pw_sample end;
      check_ok (pw_run_sample (run, pw_run_time (run), &end, &error), &(pw_error){ 0 });
      memcpy (q[k], end.q, sizeof q[k]);
      n[k] = *pw_run_statistics (run);
      pw_run_close (run);
    }
    for (int k = 0; k < 4 && !slides; k++) {
      check_close (check_text ("%s, %s", method[k], force), (double)n[k].conditions, (double)n[1].conditions, 0, "all");
      check_close (check_text ("%s, %s", method[k], force), q[k][0], q[1][0], k == 0 ? 1e-4 : 1e-5, "steps");
    }
    changes += slides ? 0 : (int)n[1].conditions;
    pw_system_free (s);
  }
  assert_true (changes > 300);
}

/* Where both sides lead back, the run stops; at rest without a force it stays. */
TEST (sliding) {
  static const char *const force[] = { "-0.5*sign (b.vx)", "0.2 - 0.5*sign (b.vx)", "-(b.x + b.vx > 0 ? 1 : -1)" };
  for (int i = 0; i < 3; i++)
    for (int m = 0; m < RUNS_ADAPTIVE; m++) {
      pw_error error = { 0 };
      pw_system *s = conditions_scene (i == 2 ? 0.5 : 0, i == 1 ? 0 : 0.5, force[i]);
      pw_run *r = pw_run_open (s, runs_adaptive[m], &(pw_settings){ .span = 10, .rtol = 1e-8 }, &error);
      int status = r ? PW_OK : PW_INPUT;
      while (status == PW_OK && pw_run_time (r) < 10) status = pw_run_advance (r, 10, &error);
      assert_int_equal (status, PW_METHOD);
      assert_non_null (strstr (error.text, "force F: fx: on both sides of a condition it leads back to it"));
      assert_true (pw_run_statistics (r)->steps < 1000);
      pw_run_close (r);
      pw_system_free (s);
    }
}

/* An expression that has a value on one side only, nested conditions, conditions that do not matter. */
TEST (sides) {
  static const char *const force[] = { "b.x > 0 ? -1 - b.x^2.5 : 0.5", "abs (abs (b.x - 0.3) - 0.2) - b.x",
                                       "b.x > 5 ? sign (b.vx) : -b.x", "t > 1 && b.x > 0.2 ? -2 : -0.1" };
  for (int i = 0; i < 4; i++) {
    pw_system *s = conditions_scene (-0.1, 1, force[i]);
    double q[2][3], v[2][3];
    pw_statistics n;
    runs_state (s, "erk8+none", &(pw_settings){ .span = 3, .rtol = 1e-10 }, 3, q[0], v[0], &n);
    runs_state (s, "rk4+none", &(pw_settings){ .span = 3, .step = 1e-3 }, 3, q[1], v[1], NULL);
    check_close (force[i], q[0][0], q[1][0], i == 0 ? 1e-3 : 1e-8, i == 0 ? "a step" : "tolerance, step^4");
    if (i == 2) assert_int_equal (n.conditions, 0);
    pw_system_free (s);
  }
}

/* A run that is continued from a checkpoint gives the same bits. */
TEST (checkpoint) {
  pw_system *s = conditions_scene (12, 6, "-b.x - sign (b.vx) + 100*max (0, -b.x - 3)");
  const pw_settings settings = { .span = 7, .step = 1e-3 };
  for (int m = -1; m < RUNS_ADAPTIVE; m++)
    for (int k = 1; k < 40; k += 3) {
      const char *method = m < 0 ? "rk4+none" : runs_adaptive[m];
      pw_error error = { 0 };
      pw_run *r = runs_open (s, method, &settings);
      for (int i = 0; i < (m < 0 ? 83 * k : k); i++) check_ok (pw_run_advance (r, 7, &error), &error);
      pw_run *loaded = runs_copy (r, s, method, &settings);
      check_close (method, runs_to (loaded, 7).q[0], runs_to (r, 7).q[0], 0, "to the bit");
      pw_run_close (loaded);
      pw_run_close (r);
    }
  pw_system_free (s);
}
