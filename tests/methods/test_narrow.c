/* Signals that are narrow compared with the steps: adaptive methods find them, fixed steps that do not are counted. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "runs.h"
#include "scene.h"

const check_fixture fixture = { .setup = cli_setup, .teardown = cli_teardown };

#define NARROW_BODY "pinwheel: 1\nbodies:\n  - {name: b, mass: 1, inertia: 1%s}\nelements:\n  - %s\n"

static pw_system *narrow_scene (const char *rest, const char *element) {
  cli_write ("narrow.yaml", check_text (NARROW_BODY, rest, element));
  return scene_named (cli_path ("narrow.yaml"), NULL, 0);
}

/* The position of b at t, of several bodies that of the last one; v: its velocity. */
static double narrow_run (pw_system *s, const char *method, const pw_settings *settings, double t, double *v,
                          pw_statistics *statistics) {
  double q[12], rates[12];
  const int x = 3 * pw_system_bodies (s) - 3;
  runs_state (s, method, settings, t, q, rates, statistics);
  *v = rates[x];
  return q[x];
}

/* F = 50 exp (-b (t - c)^2): v = 50 sqrt (pi/b), x = v (T - c). */
TEST (gusts) {
  const double width[] = { 1e3, 1e5, 1e6, 1e8 }, at[] = { 1, 0.3, 2.2 / 3 };
  for (int w = 0; w < 4; w++)
    for (int k = 0; k < 3; k++) {
      const pw_settings settings = { .span = 2.9, .rtol = 1e-8 };
      pw_system *s =
          narrow_scene ("", check_text ("{force: F, body: b, fx: '50*exp (-%g*(t - %.17g)^2)'}", width[w], at[k]));
      const double v = 50 * sqrt (PW_PI / width[w]);
      for (int m = 0; m < RUNS_ADAPTIVE; m++) {
        double found, x = narrow_run (s, runs_adaptive[m], &settings, 2.9, &found, NULL);
        check_close (runs_adaptive[m], x, v * (2.9 - at[k]), RUNS_STEPS * settings.rtol * 2.9, "steps");
        check_close (runs_adaptive[m], found, v, RUNS_STEPS * settings.rtol, "steps");
      }
      pw_system_free (s);
    }
}

/* cos (w t): x = (1 - cos w t) / w^2. */
TEST (harmonic) {
  const double w = 2000 * PW_PI, T = 0.5003;
  pw_system *s = narrow_scene ("", "{force: F, body: b, fx: {harmonic: {amplitude: 1, omega: 2000*pi}}}");
  pw_settings settings = { .span = T, .rtol = 1e-7 };
  pw_statistics statistics;
  double v;
  for (int m = 0; m < RUNS_ADAPTIVE; m++)
    check_close (runs_adaptive[m], narrow_run (s, runs_adaptive[m], &settings, T, &v, NULL), (1 - cos (w * T)) / w / w,
                 RUNS_STEPS * settings.rtol * T, "steps");
  const double step[] = { 1e-3, 2.5e-4 };
  for (int k = 0; k < 2; k++) {
    narrow_run (s, "rk4+none", &(pw_settings){ .span = T, .step = step[k] }, T, &v, &statistics);
    check_close ("unresolved", (double)statistics.unresolved, k == 0 ? (double)statistics.steps : 0, 0, "counts");
  }
  pw_system_free (s);
}

/* Peaks in a table, in pulses, in prescribed motions: against fixed steps of 1e-5 s, which resolve them. */
TEST (other_forms) {
  static const char *const element[] = {
    "{force: F, body: b, fx: {table: {interpolation: cubic, ends: rest, points: [[0, 0], [0.5, 0], [0.9, 0], [0.99, "
    "0], [1, 50], [1.01, 0], [1.1, 0], [2, 0], [3, 0]]}}}",
    "{force: F, body: b, fx: {pulse: {height: 50, start: 1, width: 1e-4}}}",
    "{speed: S, body: b, value: 50*exp (-1e5*(t - 1)^2)}",
    "{drive: D, body: [b, ground], what: x, value: 0.02*tanh (1000*(t - 1))}\n  - {speed: S, body: b, heading: "
    "90*deg, value: t}",
    "{steered-wheel: W, body: b, at: [1, 0], heading: 0.5*exp (-1e5*(t - 1)^2)}",
  };
  const pw_settings settings = { .span = 1.6, .rtol = 1e-8 }, fixed = { .span = 1.6, .step = 1e-5 };
  for (int i = 0; i < 5; i++) {
    pw_system *s = narrow_scene (i == 4 ? ", rate: {vx: 1}" : "", element[i]);
    pw_statistics statistics;
    double v, v0, x0 = narrow_run (s, "rk4+projection", &fixed, 1.6, &v0, &statistics);
    assert_int_equal (statistics.unresolved, 0);
    for (int m = 0; m < RUNS_ADAPTIVE; m++) {
      const double x = narrow_run (s, runs_adaptive[m], &settings, 1.6, &v, NULL);
      check_close (check_text ("%s, %d", runs_adaptive[m], i), x, x0, 10 * RUNS_STEPS * settings.rtol, "steps");
      check_close (check_text ("%s, %d", runs_adaptive[m], i), v, v0, 10 * RUNS_STEPS * settings.rtol, "steps");
    }
    pw_system_free (s);
  }
}

/* A force of the position, -a exp (-b (x - 1)^2): the body is reflected if a sqrt (pi/b) > v0^2/2, and else this
 * work slows it down. */
TEST (bumps) {
  const double b[] = { 1e3, 1e5, 1e6 }, work[] = { 0.3, 0.8, 11 };
  for (int k = 0; k < 9; k++) {
    const double width = b[k / 3], a = work[k % 3] * sqrt (width / PW_PI);
    const pw_settings settings = { .span = 3, .rtol = 1e-8 };
    pw_system *s = narrow_scene (", rate: {vx: 1}",
                                 check_text ("{force: F, body: b, fx: '-%.17g*exp (-%g*(b.x - 1)^2)'}", a, width));
    const double after = work[k % 3] > 0.5 ? -1 : sqrt (1 - 2 * work[k % 3]);
    for (int m = 0; m < RUNS_ADAPTIVE; m++) {
      double v;
      narrow_run (s, runs_adaptive[m], &settings, 3, &v, NULL);
      check_close (check_text ("%s, %g, %g", runs_adaptive[m], width, a), v, after, RUNS_STEPS * settings.rtol,
                   "steps");
    }
    pw_statistics statistics;
    double v;
    narrow_run (s, "rk4+none", &(pw_settings){ .span = 3, .step = 0.1 }, 3, &v, &statistics);
    assert_true (statistics.unresolved > 0);
    pw_system_free (s);
  }
}

/* The notice, and runs without a reason for it. */
TEST (notice) {
  cli_write ("narrow.yaml", check_text (NARROW_BODY, "",
                                        "{force: F, body: b, fx: {harmonic: {amplitude: 1, omega: "
                                        "2000*pi}}}"));
  cli_shell ("pinwheel run @/narrow.yaml -m rk4 --step 1e-3 -t 0.1");
  assert_string_equal (cli_err, "pinwheel: 100 of 100 steps did not resolve force F: fx, which changes more within a "
                                "step than the step sees: take shorter steps, or a method with adaptive ones\n");
  cli_good ("pinwheel run @/narrow.yaml -m rk4 --step 1e-4 -t 0.1");
  cli_write ("narrow.yaml",
             check_text (NARROW_BODY, "", "{drive: D, body: [b, ground], what: angle, value: 0*sin (9*t)}"));
  cli_good ("pinwheel run @/narrow.yaml -m rk4 --step 1e-2 -t 0.1"); /* a signal of 0 changes nothing */
}
