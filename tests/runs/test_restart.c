/* Restarts: a run continues from its state, or from a state and with signals that the caller has changed. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

/* A restart from the state reached changes nothing; from another state, the run continues there. */
TEST (onwards) {
  static const char *const method[] = { "rk4+projection", "rk4+baumgarte",   "ida+ggl",       "ida+baumgarte",
                                        "ida+si1",        "adams+baumgarte", "bdf+baumgarte", "bdf+projection" };
  for (int i = 0; i < 8; i++) {
    pw_error error = { 0 };
    double q[6], v[6];
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_settings settings = { .step = 1e-3, .rtol = 1e-9, .span = 2, .ledger = 1 };
    runs_state (s, method[i], &settings, 2, q, v, NULL);
    pw_run *r = runs_open (s, method[i], &settings);
    runs_to (r, 1);
    pw_statistics before = *pw_run_statistics (r);
    check_ok (pw_run_restart (r, NULL, NULL, &error), &error);
    pw_sample now = runs_to (r, 2);
    const pw_statistics *cost = pw_run_statistics (r); /* counts from the beginning of the run */
    assert_true (cost->steps > before.steps && cost->rhs > before.rhs && cost->rejected >= before.rejected);
    double bound = i < 2 ? 1e-12 : 1e-5;
    for (int j = 0; j < 6; j++)
      check_close (method[i], now.q[j], q[j], bound, i < 2 ? "a step of the same size: round-off" : "1e4 rtol");
    check_close ("balance", now.balance, 0, i < 2 ? 1e-10 : 1e-5, "the ledger continues");
    double moved[6];
    for (int j = 0; j < 6; j++) moved[j] = now.q[j] + (j % 3 == 0 ? 10 : 0); /* both bodies 10 m to the side */
    check_ok (pw_run_restart (r, moved, NULL, &error), &error);
    now = runs_to (r, 2.5);
    assert_true (now.q[0] > 9);
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* Changed velocities change the power: the first step after a restart must use the new one. */
TEST (slower) {
  pw_error error = { 0 };
  double v[6];
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 2, .ledger = 1 });
  pw_sample before = runs_to (r, 2);
  double work = before.work, remaining = before.kinetic / 4;
  for (int j = 0; j < 6; j++) v[j] = before.v[j] / 2;
  check_ok (pw_run_restart (r, NULL, v, &error), &error);
  pw_sample now = runs_to (r, 2.001);
  check_close ("work of a step", now.work - work, now.kinetic - remaining, 1e-13, "error of one step, h^5");
  pw_run_close (r);
  pw_system_free (s);
}

/* A run whose constraints were lost continues from a state that satisfies them. */
TEST (lost) {
  pw_error error = { 0 };
  pw_sample x;
  pw_system *s = scene_named ("pendulum", NULL, 0);
  pw_run *r = runs_open (s, "ida+none", &(pw_settings){ .rtol = 1e-3, .span = 100 });
  assert_int_equal (pw_run_advance_to (r, 100, 100, &error), PW_METHOD);
  assert_non_null (strstr (error.text, "constraint drift"));
  double t = pw_run_time (r);
  error.status = PW_OK;
  check_ok (pw_run_restart (r, NULL, NULL, &error), &error);
  check_ok (pw_run_advance_to (r, t + 1, t + 1, &error), &error);
  check_ok (pw_run_sample (r, t + 1, &x, &error), &error);
  check_below ("residual", x.position, 0.1, "it may drift again, but less in a second");
  pw_run_close (r);
  pw_system_free (s);
}

/* A refused restart leaves the run unchanged, up to round-off. */
TEST (refused) {
  pw_system *s = scene_system (&scene_ezyroller, NULL), *same = scene_system (&scene_ezyroller, NULL);
  pw_settings settings = { .step = 1e-3, .span = 2, .ledger = 1 };
  pw_run *r = runs_open (s, "rk4+projection", &settings), *untouched = runs_open (same, "rk4+projection", &settings);
  pw_sample now = runs_to (r, 1);
  runs_to (untouched, 1);
  pw_error error = { 0 };
  double q[6];
  memcpy (q, now.q, sizeof q);
  q[4] = -1e150;
  assert_int_equal (pw_run_restart (r, q, NULL, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller: restart with steer.y = -1e+150: expected a magnitude below 1e+100");
  q[4] = NAN, error.status = PW_OK;
  assert_int_equal (pw_run_restart (r, q, NULL, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model ezyroller: restart with steer.y = nan: expected a magnitude below 1e+100");
  assert_int_equal (pw_run_advance (r, NAN, NULL), PW_INPUT);
  assert_int_equal (pw_run_advance_to (r, 2, NAN, NULL), PW_INPUT);
  assert_int_equal (pw_run_sample (r, NAN, &now, NULL), PW_INPUT);
  now = runs_to (r, 2);
  pw_sample other = runs_to (untouched, 2);
  for (int i = 0; i < 6; i++)
    check_close ("positions", now.q[i], other.q[i], 1e-13, "round-off: the matrix is factorised again");
  check_close ("balance", now.balance, other.balance, 1e-13, "round-off");
  pw_run_close (r), pw_run_close (untouched);
  pw_system_free (s), pw_system_free (same);
}

/* A torque that jumps at 0.5 s.  *context: 0: evaluations succeed; 1: until restart_next_jump is called, which makes it
 * 2; 2: they fail. */
static int restart_jump (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)x, (void)gradient;
  value[0] = t < 0.5 ? 0 : 0.1;
  return *(int *)context == 2;
}

static double restart_next_jump (void *context, double t) {
  if (*(int *)context) *(int *)context = 2;
  return t < 0.5 ? 0.5 : INFINITY;
}

/* A restart that is refused where the torque jumps: the next step still restarts the method there. */
TEST (refused_at_jump) {
  static const char *const method[] = { "galpha", "leapfrog", "erk8+projection", "ida+ggl", "bdf+projection" };
  const pw_settings settings = { .step = 1e-2 };
  pw_error error = { 0 };
  int fails = 0;
  pw_signal jump = { PW_FUNCTION,
                     .function = { .eval = restart_jump, .context = &fails, .breakpoint = restart_next_jump } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &jump, &error), &error);
  pw_system *s = scene_compile (m);
  for (int i = 0; i < 5; i++) {
    pw_run *r = runs_open (s, method[i], &settings), *untouched = runs_open (s, method[i], &settings);
    runs_to (r, 0.5), runs_to (untouched, 0.5);
    fails = 1;
    assert_int_equal (pw_run_restart (r, NULL, NULL, NULL), PW_METHOD);
    fails = 0;
    check_close (method[i], runs_to (r, 1).q[2], runs_to (untouched, 1).q[2], 1e-12, "round-off");
    assert_int_equal (pw_run_statistics (r)->steps, pw_run_statistics (untouched)->steps);
    pw_run_close (r), pw_run_close (untouched);
  }
  pw_system_free (s);
}

static const pw_method *restart_built_in;
static int restart_fails, restart_calls;

static int restart_or_fail (pw_run *r, pw_error *error) {
  restart_calls++;
  return restart_fails ? pw_fail (error, PW_METHOD, "no restart") : restart_built_in->restart (r, error);
}

/* A restart that the method refuses leaves the run as it was; each later step tries it again first. */
TEST (refused_by_method) {
  for (int i = 0; strcmp ((restart_built_in = pw_methods[i])->name, "rk4") != 0;) i++;
  pw_method refusing = *restart_built_in;
  refusing.name = "refusing", refusing.restart = restart_or_fail;
  const pw_method *const own[] = { &refusing, NULL };
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_settings settings = { .step = 1e-3, .span = 2, .ledger = 1, .methods = own };
  pw_run *r = runs_open (s, "refusing+projection", &settings), *untouched = runs_open (s, "rk4+projection", &settings);
  pw_sample now = runs_to (r, 1), before = runs_to (untouched, 1);
  pw_error error = { 0 };
  double v[6], given[6];
  memcpy (given, pw_run_initial (r)->v_given, sizeof given);
  for (int j = 0; j < 6; j++) v[j] = 3 * now.v[j];
  restart_fails = 1;
  assert_int_equal (pw_run_restart (r, NULL, v, &error), PW_METHOD);
  check_error (&error, PW_METHOD, "no restart");
  check_bits ("the report", pw_run_initial (r)->v_given, given, 6);
  error = (pw_error){ 0 };
  assert_int_equal (pw_run_advance (r, 2, &error), PW_METHOD);
  check_error (&error, PW_METHOD, "no restart");
  restart_fails = 0, now = runs_to (r, 1);
  check_bits ("velocities", now.v, before.v, 6);
  check_bits ("accelerations", now.a, before.a, 6);
  check_bits ("balance", &now.balance, &before.balance, 1);
  now = runs_to (r, 2), before = runs_to (untouched, 2);
  assert_int_equal (restart_calls, 3); /* the last one before the first step that succeeds */
  for (int j = 0; j < 6; j++)
    check_close ("positions", now.q[j], before.q[j], 1e-12, "steps end at other times by round-off");
  pw_run_close (r), pw_run_close (untouched);
  pw_system_free (s);
}

/* Energy added by the caller is not an error of the method: the balance contains only the latter, at once and later. */
TEST (kick) {
  pw_error error = { 0 };
  double v[6];
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 2, .ledger = 1 });
  pw_sample now = runs_to (r, 1);
  double kinetic = now.kinetic;
  for (int j = 0; j < 6; j++) v[j] = 3 * now.v[j];
  check_ok (pw_run_restart (r, NULL, v, &error), &error);
  check_ok (pw_run_sample (r, 1, &now, &error), &error);
  check_close ("kick", now.kinetic, 9 * kinetic, 1e-14, "round-off");
  check_close ("balance at once", now.balance, 0, 1e-10, "(h w)^4");
  check_close ("balance later", runs_to (r, 2).balance, 0, 1e-10, "(h w)^4");
  pw_run_close (r);
  pw_system_free (s);
}

/* The same where only the total energy is known. */
TEST (kick_without_ledger) {
  pw_error error = { 0 };
  double v[30];
  pw_system *s = scene_named ("n-four-bar", "N", 2);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
  pw_sample now = runs_to (r, 0.1);
  assert_int_equal (pw_system_ledger_entries (s), 0);
  assert_true (pw_system_coordinates (s) <= 30);
  for (int j = 0; j < pw_system_coordinates (s); j++) v[j] = 3 * now.v[j];
  check_ok (pw_run_restart (r, NULL, v, &error), &error);
  now = runs_to (r, 0.2);
  check_below ("energy", pw_run_energy_defect (r, &now), 1e-5, "(h w)^4 at w = 50 / s");
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- A torque that the caller changes between steps, as a controller does ---- */

static int restart_held (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)t, (void)x, (void)gradient;
  value[0] = *(double *)context;
  return 0;
}

static double restart_controlled (const char *method, double step) {
  pw_error error = { 0 };
  double u = 0;
  pw_signal torque = { PW_FUNCTION, .function = { .eval = restart_held, .context = &u } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .rtol = 1e-12, .span = 2 });
  for (int k = 0; k < 20; k++) {
    u = 0.1 * cos (0.4 * k);
    check_ok (pw_run_restart (r, NULL, NULL, &error), &error);
    check_ok (pw_run_advance_to (r, 0.1 * (k + 1), 0.1 * (k + 1), &error), &error);
  }
  double phi = runs_to (r, pw_run_time (r)).q[2];
  pw_run_close (r);
  pw_system_free (s);
  return phi;
}

/* If a signal fails in a restart, the error names it. */
TEST (signal_fails) {
  pw_error error = { 0 };
  double u = 0;
  pw_signal torque = { PW_FUNCTION, .function = { .eval = restart_held, .context = &u } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  u = NAN;
  assert_int_equal (pw_run_restart (r, NULL, NULL, &error), PW_METHOD);
  check_error (&error, PW_METHOD,
               "t = 0 s: a signal failed: torque rider: value is not a finite number, or its function failed");
  runs_close (r, s);
}

/* After a restart, the method uses the new value of a function, so that the order of the method is unchanged. */
TEST (controlled) {
  static const char *const method[] = { "rk4+projection", "galpha+ggl", "leapfrog" };
  static const double order[] = { 4, 2, 2 };
  double reference = restart_controlled ("erk8+projection", 0);
  for (int i = 0; i < 3; i++) {
    double coarse = restart_controlled (method[i], 0.02) - reference,
           fine = restart_controlled (method[i], 0.01) - reference;
    check_close (method[i], log2 (coarse / fine), order[i], 0.3, "order over one halving");
  }
}
