/* Runs: failures and the state after them, scenes without constraints, systems shared by runs, samples, stopping.
 * */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "toys.h"

/* ---- Failures during a run ---- */

typedef struct {
  double until;
} runs_fuse;

static int runs_burns (void *context, double t, const double *x, double value[3], double *gradient) {
  const runs_fuse *f = context;
  (void)x, (void)gradient;
  value[0] = 0.1;
  return t > f->until;
}

static pw_system *runs_fused (runs_fuse *fuse) {
  pw_error error = { 0 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = runs_burns, .context = fuse } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  return scene_compile (m);
}

/* A failing signal stops the run; the error contains the time reached, at which the run can still be sampled. */
TEST (signal_fails) {
  static const char *const method[] = { "rk4+projection", "rk4+none", "ida+ggl", "ida+baumgarte" };
  for (int i = 0; i < 4; i++) {
    runs_fuse fuse = { 0.5 };
    pw_error error = { 0 };
    pw_system *s = runs_fused (&fuse);
    pw_run *r = runs_open (s, method[i], NULL);
    assert_int_equal (pw_run_advance_to (r, 1, 1, &error), PW_METHOD);
    double t = pw_run_time (r);
    assert_true (t > 0.3 && t <= 0.5);
    assert_non_null (strstr (error.text, "a signal failed"));
    assert_int_equal (strncmp (error.text, "t = ", 4), 0);
    check_close ("time in the message", strtod (error.text + 4, NULL), t, 1e-5, "six digits");
    pw_sample sample;
    error.status = PW_OK;
    check_ok (pw_run_sample (r, t, &sample, &error), &error);
    pw_run_close (r);
    assert_null (pw_run_open (s, "rk5", NULL, &error)); /* other runs of the system are not affected */
    assert_null (strstr (error.text, "finite"));
    pw_system_free (s);
  }
}

static int runs_fails_once (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)t;
  value[0] = 0.1 * x[0];
  if (gradient) gradient[0] = 0.1;
  return --*(int *)context == 0;
}

/* Whichever evaluation fails, of a residual or of a Newton matrix, the error says so. */
TEST (signal_fails_anywhere) {
  static const char *const method[] = { "ida+ggl", "bdf+none", "bdf+projection" }, *const reads[] = { "steer.phi",
                                                                                                      NULL };
  for (int i = 0; i < 3; i++)
    for (int n = 1; n <= 30; n++) {
      int left = 0;
      pw_error error = { 0 };
      pw_model *m = scene_model (&scene_ezyroller, NULL);
      pw_signal torque = { PW_FUNCTION, .function = { .eval = runs_fails_once, .context = &left, .reads = reads } };
      check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
      pw_system *s = scene_compile (m);
      pw_run *r = runs_open (s, method[i], NULL);
      left = n;
      assert_int_equal (pw_run_advance_to (r, 1, 1, &error), PW_METHOD);
      assert_non_null (strstr (error.text, "a signal failed"));
      pw_run_close (r);
      pw_system_free (s);
    }
}

TEST (signal_fails_at_once) {
  runs_fuse fuse = { -1 };
  pw_error error = { 0 };
  pw_system *s = runs_fused (&fuse);
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  check_error (&error, PW_METHOD,
               "t = 0 s: a signal failed: torque rider: value is not a finite number, or its function failed");
  pw_system_free (s);
}

/* A spring too stiff for the step size. */
SCENE (runs_stiff) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1, .start = { 2, 0, 0 } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1, .start = { 2, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "a", "b" } });
  pw_add (m, &toy_kind_spring,
          &(toy_spring){
              .name = "k", .body = { "a", "ground" }, .at = { { 0.1, 0.2 }, { 0 } }, .stiffness = 1e9, .length = 1 });
}

TEST (too_large_a_step) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&runs_stiff_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.1 });
  assert_int_equal (pw_run_advance_to (r, 100, 100, &error), PW_METHOD);
  assert_non_null (strstr (error.text, "s: the step of 0.1 s is too large: the "));
  assert_true (pw_run_time (r) < 100);
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- An undetermined body ---- */

SCENE (runs_loose) {
  pw_add_body (m, &(pw_body){ .name = "loose" });
}

SCENE (runs_hanging) {
  runs_loose (m, parameter);
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "loose", "ground" } });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "loose", "ground" } });
}

/* Of a pinned body only the angle is not determined. */
TEST (massless) {
  static const struct {
    const pw_plugin_table *table;
    const char *reports;
  } scene[] = {
    { &runs_loose_table,
      "model scene: loose.x has no mass, and no constraint determines how it moves; give it mass, or constrain it" },
    { &runs_hanging_table,
      "model scene: loose.phi has no inertia, and no constraint determines how it moves, although torque T depends on "
      "it; give it inertia, or constrain it" },
  };
  for (size_t k = 0; k < sizeof scene / sizeof *scene; k++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (scene[k].table, NULL);
    assert_null (pw_run_open (s, "rk4", NULL, &error));
    check_error (&error, PW_INPUT, scene[k].reports);
    pw_system_free (s);
  }
}

/* ---- Scenes without holonomic or nonholonomic rows, or both ---- */

static void runs_free (pw_model *m, const void *parameters) {
  const double *with = parameters;
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 2, .inertia = 0.5, .rate = { with[1] > 0 ? 0 : 3, 0, 0 } });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "disc", "ground" }, .value = { .constant = 0.25 } });
  if (with[0] > 0) pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "disc", "ground" } });
  if (with[1] > 0) pw_add_wheel (m, &(pw_wheel){ .name = "W", .body = "disc" });
}

/* A constant torque turns a disc that is free, pinned at its centre, or on a wheel there: phi = (T/I) t^2 / 2. */
TEST (few_rows) {
  static const pw_parameter list[] = { { .name = "pin" },
                                       { .name = "wheel", .offset = sizeof (double) },
                                       { .name = NULL } };
  static const pw_plugin_table table = SCENE_TABLE_WITH (runs_free, list, 2 * sizeof (double));
  for (int with = 0; with < 3; with++) {
    pw_system *s = scene_system (&table, "pin", with & 1 ? 1.0 : 0.0, "wheel", with & 2 ? 1.0 : 0.0, NULL);
    const pw_method *m;
    char name[40];
    for (int i = 0; (m = runs_method (i, name)) != NULL; i++) {
      pw_run *r = runs_open (s, name, &(pw_settings){ .step = 1e-2, .rtol = 1e-8, .span = 2, .ledger = 1 });
      pw_sample now = runs_to (r, 2);
      double bound = m->adaptive ? 1e3 * 1e-8 : 1000 * CHECK_EPS;
      const char *reason = m->adaptive ? "1e3 rtol" : "exact for a parabola: round-off over 200 steps";
      check_close ("angle", now.q[2], 0.25 / 0.5 * 2 * 2 / 2, bound, reason);
      check_close ("x", now.q[0], with == 0 ? 3 * 2 : 0, bound, reason);
      check_close ("work", now.work, 0.25 * now.q[2], bound, reason);
      pw_run_close (r);
    }
    pw_system_free (s);
  }
}

/* ---- Redundant constraints ---- */

SCENE (runs_twice) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 2, .inertia = 0.5 });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "disc", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "Q", .body = { "ground", "disc" } });
}

TEST (twice) {
  char text[200];
  pw_system *s = scene_system (&runs_twice_table, NULL);
  pw_run *r = runs_open (s, "rk4", NULL);
  assert_int_equal (pw_run_redundant (r), 2);
  assert_string_equal (pw_run_redundancy (r, 0, text, sizeof text), "pins P and Q: the same x constraint");
  assert_string_equal (pw_run_redundancy (r, 1, text, sizeof text), "pins P and Q: the same y constraint");
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- Runs that share a system ---- */

/* Runs advanced alternately on one system have the same results as alone. */
TEST (shared) {
  static const char *const method[] = { "rk4+projection", "ida+ggl", "bdf+projection", "galpha+ggl",
                                        "rk4:inputs=held" };
  enum { METHODS = sizeof method / sizeof *method };
  double alone[METHODS][2][6];
  pw_run *r[METHODS];
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  for (int i = 0; i < METHODS; i++) {
    r[i] = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .span = 1 + i });
    for (int k = 1; k <= 10; k++) runs_to (r[i], 0.1 * k);
    pw_sample x = runs_to (r[i], 1);
    memcpy (alone[i][0], x.q, sizeof alone[i][0]);
    memcpy (alone[i][1], x.v, sizeof alone[i][1]);
    pw_run_close (r[i]);
  }
  for (int i = 0; i < METHODS; i++) r[i] = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .span = 1 + i });
  for (int k = 1; k <= 10; k++)
    for (int i = 0; i < METHODS; i++) runs_to (r[i], 0.1 * k);
  for (int i = 0; i < METHODS; i++) {
    pw_sample x = runs_to (r[i], 1);
    check_bits ("q", x.q, alone[i][0], 6);
    check_bits ("v", x.v, alone[i][1], 6);
    pw_run_close (r[i]);
  }
  pw_system_free (s);
}

TEST (missing) {
  pw_error e[] = { { 0 }, { 0 }, { 0 }, { 0 }, { 0 }, { 0 }, { 0 } };
  pw_sample sample;
  assert_null (pw_run_open (NULL, "rk4", NULL, &e[0]));
  check_error (&e[0], PW_INPUT, "a system is missing");
  assert_int_equal (pw_run_advance (NULL, 1, &e[1]), PW_INPUT);
  assert_int_equal (pw_run_advance_to (NULL, 1, 1, &e[2]), PW_INPUT);
  assert_int_equal (pw_run_sample (NULL, 1, &sample, &e[3]), PW_INPUT);
  assert_int_equal (pw_run_restart (NULL, NULL, NULL, &e[4]), PW_INPUT);
  for (int i = 1; i < 5; i++) check_error (&e[i], PW_INPUT, "a run is missing");
  pw_run *none[] = { NULL, NULL };
  int status[] = { PW_OK, PW_OK };
  pw_runs_advance (none, 2, (double[]){ 1, 1 }, NULL, NULL, status, NULL);
  assert_true (status[0] == PW_INPUT && status[1] == PW_INPUT);
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_run *r = runs_open (s, "rk4", NULL);
  assert_int_equal (pw_run_sample (r, 0, NULL, &e[5]), PW_INPUT);
  check_error (&e[5], PW_INPUT, "a sample is missing");
  char text[40] = "x";
  assert_string_equal (pw_run_redundancy (r, pw_run_redundant (r), text, sizeof text), "");
  assert_int_equal (pw_method_parse ("rk4", NULL, NULL, NULL, NULL), PW_OK);
  pw_run_close (r);
  pw_run_close (runs_open (s, "rk4", &(pw_settings){ .step = 1e308 })); /* 1000 of these, the default span, overflow */
  assert_int_equal (pw_system_find_held (NULL, "frame.x", &e[6]), PW_INPUT);
  check_error (&e[6], PW_INPUT, "a system is missing");
  pw_system_free (s);
}

/* ---- Sampling ---- */

TEST (outside) {
  static const char *const method[] = { "rk4+projection", "ida+ggl" };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_sample sample;
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, method[i], NULL);
    runs_to (r, 0.5);
    assert_int_equal (pw_run_sample (r, 0.1, &sample, &error), PW_INPUT);
    assert_non_null (strstr (error.text, "lies outside the last step"));
    error.status = PW_OK;
    assert_int_equal (pw_run_sample (r, 0.6, &sample, &error), PW_INPUT);
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* A run does not pass t_end; t_end can be increased. */
TEST (t_end) {
  static const char *const method[] = { "rk4+projection", "ida+ggl" };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 0.03 });
    while (pw_run_time (r) < 0.1) check_ok (pw_run_advance (r, 0.1, &error), &error);
    assert_true (pw_run_time (r) == 0.1);
    check_ok (pw_run_advance (r, 0.1, &error), &error);
    assert_true (pw_run_time (r) == 0.1);
    runs_to (r, 0.25);
    assert_true (pw_run_time (r) == 0.25);
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* ---- A torque that becomes NaN ---- */

static int runs_wild (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)x, (void)gradient;
  value[0] = t < *(double *)context ? 0.1 : NAN;
  return 0;
}

static pw_system *runs_wild_system (double *from) {
  pw_error error = { 0 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = runs_wild, .context = from } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  return scene_compile (m);
}

/* Every method stops before it; none takes ever smaller steps without end. */
TEST (wild) {
  static const char *const method[] = { "rk4+projection", "erk5+projection", "erk8",       "adams",   "bdf+projection",
                                        "ida+ggl",        "ida+baumgarte",   "galpha+ggl", "leapfrog" };
  double from = 0.5;
  for (int i = 0; i < 9; i++) {
    pw_error error = { 0 };
    pw_system *s = runs_wild_system (&from);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .span = 1 });
    assert_int_equal (pw_run_advance_to (r, 1, 1, &error), PW_METHOD);
    assert_true (pw_run_time (r) > 0.4 && pw_run_time (r) <= 0.51);
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* A force that is initially infinite. */
SCENE (runs_strong) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1, .start = { 100, 0, 0 } });
  pw_add_spring (m, &(pw_spring){ .name = "k", .body = { "a", "ground" }, .stiffness = 1e308 });
}

/* A mass too small for a force. */
SCENE (runs_weak) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1 });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = 1e-309 });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "b", "ground" }, .value = { .constant = 1 } });
}

TEST (weak_start) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&runs_weak_table, NULL);
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  check_error (&error, PW_METHOD, "t = 0 s: the acceleration of b.phi is not finite");
  pw_system_free (s);
}

TEST (wild_start) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&runs_strong_table, NULL);
  assert_null (pw_run_open (s, "erk8+projection", NULL, &error));
  check_error (&error, PW_METHOD, "t = 0 s: force of spring k is not finite");
  pw_system_free (s);
}
