/* Limits that end a run: max_steps, the caller's stop function inside steps and samples, states beyond what
 * numbers resolve; and motions that grow without bound, which are reported. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

static const char *const limits_adaptive[] = { "erk5+projection", "erk8+projection", "adams", "bdf+projection",
                                               "ida+ggl",         "ida+baumgarte",   NULL };

/* ---- Attempted steps ---- */

/* The run ends after that many attempted steps, with a message; SUNDIALS finishes the step it is in. */
TEST (max_steps) {
  for (const char *const *method = limits_adaptive; *method; method++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, *method, &(pw_settings){ .rtol = 1e-8, .max_steps = 60 });
    assert_int_equal (pw_run_advance_to (r, 100, 100, &error), PW_METHOD);
    const pw_statistics *done = pw_run_statistics (r);
    assert_non_null (strstr (error.text, "s: the limit max-steps is reached: "));
    assert_true (done->steps + done->rejected >= 60 && done->steps + done->rejected < 80 && pw_run_time (r) > 0);
    pw_sample sample;
    check_ok (pw_run_sample (r, pw_run_time (r), &sample, &(pw_error){ 0 }), NULL); /* what there is so far stays */
    pw_run_close (r);
    pw_system_free (s);
  }
}

TEST (max_steps_of_fixed_steps) {
  static const char *const method[] = { "rk4+projection", "erk5+projection:steps=fixed", "galpha", "leapfrog" };
  for (int i = 0; i < 4; i++) {
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 0.01, .max_steps = 10 });
    runs_to (r, 1);
    assert_int_equal (pw_run_statistics (r)->steps, 100);
    pw_run_close (r);
    pw_system_free (s);
  }
}

TEST (bad_max_steps) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  assert_null (pw_run_open (s, "erk5", &(pw_settings){ .max_steps = -1 }, &error));
  check_error (&error, PW_INPUT, "setting max_steps = -1: expected a number > 0");
  pw_system_free (s);
}

/* ---- The caller's wish ---- */

/* Stops at the call of this number, once. */
static int limits_stop (void *context) {
  return --*(int *)context == 0;
}

/* Wherever a run is stopped, it goes on when it is advanced again, and nothing but the last digits of a method that has
 * to start anew, or of steps that were tried with another size, shows it. */
TEST (stop) {
  static const char *const one_step[] = { "rk4+projection", "galpha", "leapfrog", "erk8+projection", NULL };
  for (int k = 0; k < 2; k++)
    for (const char *const *method = k ? limits_adaptive : one_step; *method; method++)
      for (int stop = 1; stop < 400; stop = 2 * stop + 1) {
        int calls = stop, stopped = 0;
        double whole[12], q[6], v[6];
        pw_error error = { 0 };
        pw_settings settings = { .rtol = 1e-8, .step = 0.01 };
        pw_system *s = scene_system (&scene_ezyroller, NULL);
        runs_state (s, *method, &settings, 1, whole, whole + 6, NULL);
        settings.stop = limits_stop, settings.stop_context = &calls;
        pw_run *r = runs_open (s, *method, &settings);
        for (int status = 0; status != PW_OK || pw_run_time (r) < 1;) {
          double before = pw_run_time (r);
          status = pw_run_advance (r, 1, &error);
          if (status != PW_STOPPED) check_ok (status, &error);
          assert_true (status == PW_OK || pw_run_time (r) == before);
          stopped += status == PW_STOPPED;
        }
        pw_sample sample = runs_to (r, 1);
        memcpy (q, sample.q, sizeof q), memcpy (v, sample.v, sizeof v);
        assert_int_equal (stopped, calls <= 0);
        double bound = k ? 1e-5 : 1e-12;
        const char *reason = k ? "a thousand times the tolerance" : "the same steps, to round-off";
        for (int j = 0; j < 6; j++) check_close (*method, q[j], whole[j], bound, reason);
        pw_run_close (r);
        pw_system_free (s);
      }
}

static int limits_asked (void *context) {
  return *(int *)context;
}

/* A sample inside a step is refused, the state reached is there. */
TEST (stop_samples) {
  char name[40];
  for (int i = 0; runs_method (i, name); i++) {
    int asked = 0;
    pw_sample sample;
    pw_error error = { 0 };
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, name, &(pw_settings){ .stop = limits_asked, .stop_context = &asked });
    runs_to (r, 0.1);
    double now = pw_run_time (r);
    check_ok (pw_run_advance (r, 1, &error), &error);
    asked = 1;
    assert_int_equal (pw_run_sample (r, (now + pw_run_time (r)) / 2, &sample, &error), PW_STOPPED);
    check_ok (pw_run_sample (r, pw_run_time (r), &sample, &error), &error);
    assert_int_equal (pw_run_advance (r, 1, &error), PW_STOPPED);
    assert_int_equal (error.status, PW_OK);
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* SUNDIALS tries one step many times: a stop function that says yes from its second call on ends it inside. */
static int limits_inside (void *context) {
  return ++*(int *)context > 1;
}

TEST (stop_inside) {
  for (const char *const *method = limits_adaptive + 2; *method; method++) {
    int calls = 0;
    pw_error error = { 0 };
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, *method, &(pw_settings){ .stop = limits_inside, .stop_context = &calls });
    assert_int_equal (pw_run_advance (r, 1, &error), PW_STOPPED);
    assert_true (error.status == PW_OK && calls == 2 && pw_run_time (r) == 0);
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* ---- Growth ---- */

static const pw_parameter limits_list[] = { { .name = "torque" }, { .name = NULL } };

/* A rotor on a pin with a constant torque; without it, it only turns. */
SCENE_WITH (limits_rotor, limits_list, double) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 1, .rate = { 0, 0, *p != 0 ? 0 : 5000 } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "rotor", "ground" } });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "rotor", "ground" }, .value = { .constant = *p } });
}

/* At 4.5e13 rad an angle is known to 0.01 rad. */
TEST (beyond_numbers) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&limits_rotor_table, "torque", 0., NULL);
  pw_run *r = runs_open (s, "erk5+projection", &(pw_settings){ .span = 1 });
  assert_int_equal (pw_run_advance_to (r, 1e12, 1e12, &error), PW_METHOD);
  assert_non_null (strstr (error.text, "s: the motion has grown beyond what numbers resolve: rotor.phi = "));
  assert_true (pw_run_time (r) > 4.4e13 / 5000 &&
               pw_run_time (r) < 5 * 4.6e13 / 5000); /* a step grows fivefold at most */
  pw_run_close (r);
  pw_system_free (s);
}
