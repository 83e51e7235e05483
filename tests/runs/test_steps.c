/* Beginnings and ends of steps, by every method: samples inside steps and at their beginning; ends at infinity or
 * just after the time reached; coincident discontinuities; bad breakpoints from functions. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

enum { STEPS_NAME = 80 };

/* The name of the i-th combination of integrator, stabilisation and inputs=held; NULL after the last one. */
static const char *steps_method (int i, char name[STEPS_NAME]) {
  for (int m = 0; pw_methods[m]; m++)
    for (const pw_stabilisation *x = pw_methods[m]->stabilisations; x->name; x++)
      for (int held = 0; held < 2; held++) {
        snprintf (name, STEPS_NAME, "%s+%s%s", pw_methods[m]->name, x->name, held ? ":inputs=held" : "");
        const pw_method *method;
        int number;
        if ((!held || pw_method_parse (name, NULL, &method, &number, NULL) == PW_OK) && i-- == 0) return name;
      }
  return NULL;
}

/* A pendulum, initially hanging, with a given torque. */
static pw_signal steps_torque[2];

SCENE (steps_build) {
  static const char *const name[] = { "T", "U" };
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 1, .inertia = 0.1, .start = { 0, -1, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "ground", "bob" }, .at = { { 0, 0 }, { 0, 1 } } });
  for (int i = 0; i < 2; i++)
    pw_add_torque (m, &(pw_torque){ .name = name[i], .body = { "bob", "ground" }, .value = steps_torque[i] });
}

static pw_system *steps_open (pw_signal one, pw_signal two) {
  steps_torque[0] = one, steps_torque[1] = two;
  return scene_system (&steps_build_table, NULL);
}

static const pw_signal steps_swing = { PW_HARMONIC, .harmonic = { .amplitude = 1, .omega = 30 } };

/* ---- Samples ---- */

static void steps_run (pw_system *s, const char *method, int looks, double q[3], double v[3]) {
  pw_error error = { 0 };
  pw_sample sample;
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 0.01, .rtol = 1e-4 });
  while (pw_run_time (r) < 0.3) {
    double before = pw_run_time (r);
    check_ok (pw_run_advance (r, 0.3, &error), &error);
    for (int i = 1; i <= looks; i++)
      check_ok (pw_run_sample (r, before + (pw_run_time (r) - before) * i / (looks + 1), &sample, &error), &error);
  }
  sample = runs_to (r, 0.3);
  memcpy (q, sample.q, 3 * sizeof *q);
  memcpy (v, sample.v, 3 * sizeof *v);
  pw_run_close (r);
}

/* Samples do not change a run, however many there are. */
TEST (looks) {
  char name[STEPS_NAME];
  pw_system *s = steps_open (steps_swing, (pw_signal){ 0 });
  for (int i = 0; steps_method (i, name); i++) {
    double q[3], v[3], q_seen[3], v_seen[3];
    steps_run (s, name, 0, q, v);
    steps_run (s, name, 2, q_seen, v_seen);
    check_bits ("positions", q_seen, q, 3);
    check_bits ("velocities", v_seen, v, 3);
  }
  pw_system_free (s);
}

/* Inside a step, held signals have the values of its beginning, also if a later time has been sampled: the angle of
 * the step is T t^2 / (2 I), T at its beginning. */
TEST (held_signal_sampled) {
  pw_error error = { 0 };
  pw_sample sample;
  pw_system *s = steps_open (steps_swing, (pw_signal){ 0 });
  pw_run *r = runs_open (s, "rk4+projection:inputs=held", &(pw_settings){ .step = 0.01 });
  check_ok (pw_run_advance (r, 1, &error), &error);
  for (int i = 3; i > 0; i--) {
    double t = 0.0025 * i;
    check_ok (pw_run_sample (r, t, &sample, &error), &error);
    check_close ("angle", sample.q[2], t * t / 2 / 1.1, 1e-12, "64 eps");
  }
  pw_run_close (r);
  pw_system_free (s);
}

/* The beginning of a step can be sampled. */
TEST (beginning) {
  char name[STEPS_NAME];
  pw_system *s = steps_open (steps_swing, (pw_signal){ 0 });
  for (int i = 0; steps_method (i, name); i++) {
    pw_error error = { 0 };
    pw_sample sample;
    pw_run *r = runs_open (s, name, &(pw_settings){ .step = 0.01 });
    check_ok (pw_run_advance (r, 1, &error), &error);
    assert_true (pw_run_time (r) > 0);
    check_ok (pw_run_sample (r, 0, &sample, &error), &error);
    check_close ("angle", sample.q[2], 0, 16 * DBL_EPSILON, "the start, projected");
    check_close ("rate", sample.v[2], 0, 16 * DBL_EPSILON, "the start, projected");
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* ---- Ends of runs ---- */

/* A run without an end takes the same steps as one with a distant end. */
TEST (endless) {
  char name[STEPS_NAME];
  pw_system *s = steps_open (steps_swing, (pw_signal){ 0 });
  for (int i = 0; steps_method (i, name); i++) {
    double t[2];
    for (int endless = 0; endless < 2; endless++) {
      pw_error error = { 0 };
      pw_run *r = runs_open (s, name, &(pw_settings){ .step = 0.01, .rtol = 1e-10 });
      for (int k = 0; k < 3; k++) check_ok (pw_run_advance (r, endless ? INFINITY : 1e3, &error), &error);
      t[endless] = pw_run_time (r);
      pw_run_close (r);
    }
    check_close (name, t[1], t[0], 0, "the same steps");
  }
  pw_system_free (s);
}

/* Two pulses begin at times that differ in the last digit; the run ends one digit later, or further on. */
TEST (adjacent_breakpoints) {
  char name[STEPS_NAME];
  const double one = 0.3, two = 0.1 + 0.2;
  assert_true (two > one);
  pw_system *s = steps_open ((pw_signal){ PW_PULSE, .pulse = { .height = 1, .start = one } },
                             (pw_signal){ PW_PULSE, .pulse = { .height = 1, .start = two } });
  for (int i = 0; steps_method (i, name); i++) {
    pw_run *r = runs_open (s, name, &(pw_settings){ .step = 0.01, .rtol = 1e-6, .ledger = 1 });
    check_close ("angle", runs_to (r, nextafter (two, 1)).q[2], 0, 16 * DBL_EPSILON, "nothing has happened yet");
    check_close ("angle", runs_to (r, 1).q[2], 2 / 1.1 * 0.7 * 0.7 / 2, 1e-4, "100 rtol; leapfrog, galpha: h^2");
    assert_true (pw_run_time (r) == 1);
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* One pulse ends and another one begins, in motion: both times are meant to be the same but differ in the last
 * digit.  Samples at such times are of the same state. */
TEST (adjacent_in_motion) {
  char name[STEPS_NAME];
  pw_error error = { 0 };
  pw_sample x;
  pw_system *s = steps_open ((pw_signal){ PW_PULSE, .pulse = { .height = 10, .start = 0.1, .width = 0.2 } },
                             (pw_signal){ PW_PULSE, .pulse = { .height = -10, .start = 0.3, .width = 0.5 } });
  for (int i = 0; steps_method (i, name); i++) {
    pw_run *r = runs_open (s, name, &(pw_settings){ .step = 0.01, .rtol = 1e-6 });
    const double end = runs_to (r, nextafter (0.1 + 0.2, 1)).q[2];
    check_ok (pw_run_sample (r, 0.1 + 0.2, &x, &error), &error);
    check_close (name, x.q[2], end, 1e-15, "round-off");
    check_close (name, runs_to (r, 1).q[2], 10 / 1.1 * (0.02 + 0.1 - 0.125 - 0.06), 1e-3, "1000 rtol; galpha: h^2");
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* No tiny step remains before the end, since round-off would dominate its multipliers. */
TEST (tiny_remainder) {
  static const char *const method[] = { "rk4+projection", "leapfrog", "galpha", "galpha+ggl", "radau:steps=fixed" };
  pw_system *s = scene_named ("pendulum", NULL, 0);
  for (int i = 0; i < 5; i++) {
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 0.01 });
    const double before = runs_to (r, 0.1).lambda[0];
    pw_run_close (r);
    r = runs_open (s, method[i], &(pw_settings){ .step = 0.01 });
    check_close (method[i], runs_to (r, 0.1 + 1e-10).lambda[0], before, 1e-2, "h^2: galpha starts anew");
    assert_int_equal (pw_run_statistics (r)->steps, 10);
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* ---- User functions ---- */

static int steps_breaks (void *context, double t, const double *x, double value[3], double *gradient) {
  const double *until = context;
  (void)x, (void)gradient;
  value[0] = t < *until ? 1 : NAN;
  return 0;
}

/* A function value that is not finite stops the run, or refuses a sample, with the name of the element. */
TEST (not_a_number) {
  char name[STEPS_NAME];
  double until = 0.25;
  pw_system *s = steps_open ((pw_signal){ PW_FUNCTION, .function = { .eval = steps_breaks, .context = &until } },
                             (pw_signal){ 0 });
  for (int i = 0; steps_method (i, name); i++) {
    pw_error error = { 0 };
    pw_run *r = runs_open (s, name, &(pw_settings){ .step = 0.01 });
    assert_int_equal (pw_run_advance_to (r, 1, 1, &error), PW_METHOD);
    assert_true (pw_run_time (r) > 0.1 && pw_run_time (r) <= until);
    assert_non_null (strstr (error.text, "torque T: value is not a finite number, or its function failed"));
    pw_run_close (r);
  }
  for (int i = 0; steps_method (i, name); i++) {
    if (strstr (name, "held")) continue; /* evaluates the signal at the beginning of the step only */
    pw_error error = { 0 };
    pw_sample sample;
    until = 1;
    pw_run *r = runs_open (s, name, &(pw_settings){ .step = 0.01 });
    for (int k = 0; k < 3; k++) check_ok (pw_run_advance (r, 1, &error), &error);
    double t = pw_run_time (r) * (1 - 1e-6);
    char text[100];
    snprintf (text, sizeof text,
              "t = %.6g s: a signal failed: torque T: value is not a finite number, or its function failed", t);
    until = 0;
    assert_int_equal (pw_run_sample (r, t, &sample, &error), PW_METHOD);
    check_error (&error, PW_METHOD, text);
    pw_run_close (r);
  }
  until = -1;
  pw_error error = { 0 };
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  check_error (&error, PW_METHOD,
               "t = 0 s: a signal failed: torque T: value is not a finite number, or its function failed");
  pw_system_free (s);
}

/* Where a function computes the next breakpoint from. */
typedef struct {
  double from, returned;
} steps_breakpoint;

static int steps_still (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t, (void)x, (void)gradient;
  value[0] = 1;
  return 0;
}

static double steps_bad_breakpoint (void *context, double t) {
  const steps_breakpoint *w = context;
  return t < w->from ? w->from : w->returned;
}

/* A function must return a breakpoint after the given time; otherwise the run would not advance. */
TEST (breakpoints_told) {
  static const double returned[] = { 0.125, 0, -INFINITY, NAN };
  steps_breakpoint wrong;
  pw_system *s = steps_open (
      (pw_signal){ PW_FUNCTION,
                   .function = { .eval = steps_still, .breakpoint = steps_bad_breakpoint, .context = &wrong } },
      (pw_signal){ 0 });
  for (int i = 0; i < 4; i++) {
    pw_error error = { 0 };
    wrong = (steps_breakpoint){ 0.125, returned[i] };
    pw_run *r = runs_open (s, "rk4", NULL);
    assert_int_equal (pw_run_advance_to (r, 1, 1, &error), PW_METHOD);
    check_error (&error, PW_METHOD,
                 "t = 0.125 s: torque T: value: its breakpoint function returned a time that is not later");
    wrong = (steps_breakpoint){ 0, returned[i] };
    error = (pw_error){ 0 };
    assert_int_equal (pw_run_restart (r, NULL, NULL, &error), PW_METHOD);
    pw_run_close (r);
    error = (pw_error){ 0 };
    if (returned[i] > 0) continue;
    assert_null (pw_run_open (s, "rk4", NULL, &error));
    check_error (&error, PW_METHOD,
                 "t = 0 s: torque T: value: its breakpoint function returned a time that is not later");
  }
  pw_system_free (s);
}

/* Fixed steps as short as a run accepts at a large time make progress. */
TEST (short_steps) {
  const double t = 1e6, step = 2e-9;
  pw_error error = { 0 };
  pw_system *s = scene_named ("pendulum", NULL, 0);
  pw_run *r = runs_open (s, "rk4", &(pw_settings){ .t = t, .step = step, .span = 1 });
  check_ok (pw_run_advance_to (r, t + 1500 * step, INFINITY, &error), &error);
  assert_int_equal (pw_run_statistics (r)->steps, 1500);
  pw_run_close (r);
  pw_system_free (s);
}
