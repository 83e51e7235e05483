/* Samples inside the steps of erk5 and erk8; steps that end at breakpoints and at requested times. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

static const char *const samples_methods[] = { "erk5+none", "erk5+projection", "erk5+projection:metric=identity",
                                               "erk8+none", "erk8+projection", "erk8+projection:metric=identity" };
enum { SAMPLES_METHODS = sizeof samples_methods / sizeof *samples_methods };

/* ---- Samples ---- */

/* Runs to t_end, optionally with two samples in every step; returns the state at t_end. */
static void samples_state (const char *method, double rtol, int look, double *q, double *v, double *ledger,
                           pw_statistics *cost) {
  const double t_end = 3;
  pw_error error = { 0 };
  pw_system *s = scene_system (&scene_ezyroller, "m2", 0.1, "I2", 0.01, NULL), *S;
  S = scene_system (&scene_ezyroller, "m2", 0.1, "I2", 0.01, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = rtol, .span = t_end, .ledger = 1 });
  pw_run *exact = runs_open (S, "erk8+projection", &(pw_settings){ .rtol = 1e-13, .span = t_end });
  for (double t0 = 0; pw_run_time (r) < t_end; t0 = pw_run_time (r)) {
    pw_sample now;
    check_ok (pw_run_advance (r, t_end, &error), &error);
    for (int k = 0; look && k < 2; k++) {
      double t = t0 + (k == 0 ? 0.37 : 0.9) * (pw_run_time (r) - t0);
      check_ok (pw_run_sample (r, t, &now, &error), &error);
      pw_sample there = runs_to (exact, t);
      for (int j = 0; j < 6; j++) {
        check_close (method, now.q[j], there.q[j], 100 * rtol, "100 rtol, as at the ends of steps");
        check_close (method, now.v[j], there.v[j], 100 * rtol, "100 rtol, as at the ends of steps");
      }
      check_close ("balance of a sample", now.balance, 0, 100 * rtol, "100 rtol");
      if (strstr (method, "projection"))
        check_below ("sample's residuals", now.position + now.velocity, 32 * CHECK_EPS, "round-off");
    }
  }
  pw_sample now = runs_to (r, t_end);
  memcpy (q, now.q, 6 * sizeof *q);
  memcpy (v, now.v, 6 * sizeof *v);
  memcpy (ledger, now.ledger, (size_t)pw_system_ledger_entries (s) * sizeof *ledger);
  *cost = *pw_run_statistics (r);
  pw_run_close (r);
  pw_run_close (exact);
  pw_system_free (s);
  pw_system_free (S);
}

TEST (samples) {
  for (int i = 0; i < SAMPLES_METHODS; i++)
    for (int k = 5; k <= 10; k++) {
      double q[2][6], v[2][6], ledger[2][4];
      pw_statistics cost[2];
      for (int look = 0; look < 2; look++)
        samples_state (samples_methods[i], pow (10, -k), look, q[look], v[look], ledger[look], &cost[look]);
      check_bits ("positions without samples", q[0], q[1], 6);
      check_bits ("velocities without samples", v[0], v[1], 6);
      check_bits ("work without samples", ledger[0], ledger[1], 1);
      assert_true (cost[0].steps == cost[1].steps && cost[0].rejected == cost[1].rejected);
    }
}

/* A sample is bit-identical to the end of a run that ends at its time: both make that last step. */
TEST (bits) {
  static const char *const method[] = { "erk5+none", "erk5+projection" };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_settings settings = { .rtol = 1e-9, .span = 2 };
    pw_system *s = scene_system (&scene_ezyroller, NULL), *S = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, method[i], &settings);
    for (double t0 = 0; pw_run_time (r) < 2; t0 = pw_run_time (r)) {
      double q[6], v[6], t;
      pw_sample now;
      check_ok (pw_run_advance (r, 2, &error), &error);
      check_ok (pw_run_sample (r, t = 0.4 * t0 + 0.6 * pw_run_time (r), &now, &error), &error);
      runs_state (S, method[i], &settings, t, q, v, NULL);
      check_bits ("positions of a run that ends there", now.q, q, 6);
      check_bits ("velocities of a run that ends there", now.v, v, 6);
    }
    assert_int_equal (pw_run_statistics (r)->rejected, 0); /* a run that ends there could have rejected a step */
    pw_run_close (r);
    pw_system_free (s);
    pw_system_free (S);
  }
}

/* ---- Ends of steps ---- */

/* A torque that jumps at 1/3 s. */
static int samples_switched (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = t < 1. / 3 ? 0.1 : -0.2;
  return 0;
}

static double samples_breakpoint (void *context, double t) {
  (void)context;
  return t < 1. / 3 ? 1. / 3 : INFINITY;
}

static pw_system *samples_switched_scene (double (*breakpoint) (void *context, double t)) {
  pw_error error = { 0 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = samples_switched, .breakpoint = breakpoint } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  return scene_compile (m);
}

/* A step ends where the torque jumps, and the jump causes no rejections. */
TEST (breakpoint) {
  const double rtol = 1e-8;
  for (int i = 0; i < SAMPLES_METHODS; i++) {
    pw_error error = { 0 };
    double q[6], v[6];
    int before = 0, there = 0;
    pw_system *s = samples_switched_scene (samples_breakpoint), *S = samples_switched_scene (samples_breakpoint);
    runs_state (S, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 }, 1, q, v, NULL);
    pw_run *r = runs_open (s, samples_methods[i], &(pw_settings){ .rtol = rtol, .span = 1, .ledger = 1 });
    while (pw_run_time (r) < 1) {
      check_ok (pw_run_advance (r, 1, &error), &error);
      there += pw_run_time (r) == 1. / 3;
      before += pw_run_time (r) > 0.3 && pw_run_time (r) < 1. / 3;
    }
    assert_int_equal (there, 1);
    check_below ("steps just before the switch", before, 2, "no approach in small steps");
    check_below ("rejected", (double)pw_run_statistics (r)->rejected, 4, "at most a few");
    pw_sample now = runs_to (r, 1);
    for (int j = 0; j < 6; j++) {
      check_close (samples_methods[i], now.q[j], q[j], 100 * rtol, "100 rtol");
      check_close (samples_methods[i], now.v[j], v[j], 100 * rtol, "100 rtol");
    }
    check_close ("balance", now.balance, 0, 100 * rtol, "100 rtol");
    pw_run_close (r);
    pw_system_free (s);
    pw_system_free (S);
  }
}

/* A step that ends at the jump can be sampled. */
TEST (across) {
  static const char *const method[] = { "erk5+none",       "erk5+projection", "erk8+none",
                                        "erk8+projection", "rk4+projection",  "ida+ggl" };
  for (int i = 0; i < 6; i++) {
    pw_error error = { 0 };
    pw_sample now;
    const double rtol = 1e-8;
    pw_system *s = samples_switched_scene (samples_breakpoint), *S = samples_switched_scene (samples_breakpoint);
    pw_settings settings = { .rtol = rtol, .step = 0.005, .span = 1 };
    pw_run *r = runs_open (s, method[i], &settings), *exact = runs_open (S, "rk4+projection", &(pw_settings){ 0 });
    for (int k = 1; k <= 24; k++) {
      double t = k / 24.;
      check_ok (pw_run_advance_to (r, t, 1, &error), &error);
      check_ok (pw_run_sample (r, t, &now, &error), &error);
      pw_sample there = runs_to (exact, t);
      for (int j = 0; j < 6; j++)
        check_close (method[i], now.q[j], there.q[j], 1e3 * rtol, "1e3 rtol; rk4 at its step");
      if (k != 8) /* except where they jump */
        for (int j = 0; j < 6; j++)
          check_close ("acceleration", now.a[j], there.a[j], 1e5 * rtol, "1e5 rtol: one derivative up");
    }
    pw_run_close (r);
    pw_run_close (exact);
    pw_system_free (s);
    pw_system_free (S);
  }
}

/* An end within round-off of the time reached counts as reached and does not change the next step. */
TEST (short_end) {
  for (int i = 0; i < SAMPLES_METHODS; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    pw_run *r = runs_open (s, samples_methods[i], &(pw_settings){ .rtol = 1e-8, .span = 2 });
    runs_to (r, 0.3);
    long steps = pw_run_statistics (r)->steps;
    assert_true (0.1 * 3 > 0.3);
    runs_to (r, 0.1 * 3);
    assert_int_equal (pw_run_statistics (r)->steps, steps);
    check_ok (pw_run_advance (r, 2, &error), &error);
    check_below ("half of a usual step of erk5", 0.03, pw_run_time (r) - 0.3, "step sizes are unchanged");
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* A recording ends at the last of its times, even if that is reached before t_end. */
TEST (record) {
  double times[] = { 0, 0.5 }, row[100];
  long recorded;
  pw_error error = { 0 };
  pw_system *s = scene_system (&scene_ezyroller, "m2", 0.1, "I2", 0.01, NULL);
  pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .span = 1 });
  assert_true (pw_run_record_width (r) <= 100);
  check_ok (pw_run_record (r, 1, times, 1, 9, row, &recorded, &error), &error);
  assert_true (recorded == 1 && row[0] == 0 && pw_run_time (r) == 0);
  times[1] = NAN;
  assert_int_equal (pw_run_record (r, 1, times, 2, 9, row, &recorded, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "times[1] = nan: expected a time");
  assert_int_equal (pw_run_record (r, NAN, NULL, 1, 9, row, &recorded, NULL), PW_INPUT);
  assert_int_equal (recorded, 0);
  error = (pw_error){ 0 };
  runs_close (r, s);
}

/* ---- Many samples in a step ---- */

/* 20 samples in each step of a run; of another one, some of them, which are steps.  Returns the number of coordinates
 * that differ; the largest difference over rtol is added to *worst. */
static int samples_many (pw_system *s, const char *method, double rtol, double *worst) {
  const double t_end = 1;
  pw_error error = { 0 };
  const pw_settings settings = { .rtol = rtol, .span = t_end, .ledger = 1 };
  pw_run *r = runs_open (s, method, &settings), *other = runs_open (s, method, &settings);
  pw_sample now, there;
  int differ = 0;
  for (double t0 = 0; pw_run_time (r) < t_end; t0 = pw_run_time (r)) {
    check_ok (pw_run_advance (r, t_end, &error), &error);
    check_ok (pw_run_advance (other, t_end, &error), &error);
    for (int j = 1; j <= 20; j++) {
      const double t = t0 + j * (pw_run_time (r) - t0) / 20.5;
      check_ok (pw_run_sample (r, t, &now, &error), &error);
      if (j % 5 != 4) continue;
      check_ok (pw_run_sample (other, t, &there, &error), &error);
      for (int n = 0; n < 6; n++) {
        differ += now.q[n] != there.q[n];
        *worst = fmax (*worst, fabs (now.q[n] - there.q[n]) / rtol);
        *worst = fmax (*worst, fabs (now.v[n] - there.v[n]) / rtol);
      }
      for (int n = 0; n < pw_system_ledger_entries (s); n++)
        *worst = fmax (*worst, fabs (now.ledger[n] - there.ledger[n]) / rtol);
      if (strstr (method, "projection"))
        check_below ("sample's residuals", now.position + now.velocity, 32 * CHECK_EPS, "round-off");
    }
  }
  now = runs_to (r, t_end), there = runs_to (other, t_end);
  check_bits ("positions with other samples", now.q, there.q, 6);
  check_bits ("work with other samples", now.ledger, there.ledger, pw_system_ledger_entries (s));
  pw_run_close (r);
  pw_run_close (other);
  return differ;
}

/* The later ones are interpolated and agree with steps, also where a force jumps inside a step; the run does not depend
 * on them. */
TEST (many) {
  for (int i = 0; i < SAMPLES_METHODS; i++)
    for (int k = 5; k <= 11; k += 3) {
      const double rtol = pow (10, -k);
      double worst = 0, worst_jump = 0;
      pw_system *s = scene_system (&scene_ezyroller, "m2", 0.1, "I2", 0.01, NULL), *S = samples_switched_scene (NULL);
      assert_true (samples_many (s, samples_methods[i], rtol, &worst) > 0);
      check_below (samples_methods[i], worst, 0.3, "a part of rtol");
      samples_many (S, samples_methods[i], rtol, &worst_jump);
      check_below (samples_methods[i], worst_jump, 5, "rtol, of which the errors of steps have up to 100");
      pw_system_free (s);
      pw_system_free (S);
    }
}
