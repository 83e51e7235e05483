/* A method defined by the caller with pinwheel-method.h: symplectic Euler, with and without projection, with
 * Baumgarte's terms.  Its order in accuracy is in docs/method.c for another one. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "runs.h"
#include "scene.h"

static int own_open (pw_run *r, pw_error *error) {
  return pw_step_open (r, 2, error);
}

static int own_advance (pw_run *r, double t_end, pw_error *error) {
  const pw_reached x = pw_run_state (r);
  double h = pw_step_size (r, t_end), *q = pw_step_array (r, 0), *v = pw_step_array (r, 1);
  for (int j = 0; j < pw_system_coordinates (x.system); j++) q[j] = x.q[j] + h * (v[j] = x.v[j] + h * x.a[j]);
  return pw_step_accept (r, PW_OK, h, q, v, error);
}

static const pw_stabilisation own_stabilisations[] = { { "none", "", PW_UNSTABILISED },
                                                       { "projection", "", PW_PROJECTION },
                                                       { "baumgarte", "", PW_BAUMGARTE },
                                                       { .name = NULL } };
static const pw_option own_options[] = {
  { .name = "alpha", .with = "baumgarte", .value = 10, .domain = PW_NONNEGATIVE, .about = "" },
  { .name = "beta", .with = "baumgarte", .value = 10, .domain = PW_NONNEGATIVE, .about = "" },
  { .name = NULL }
};
static const pw_method own = { .name = "euler",
                               .about = "symplectic Euler",
                               .order = 1,
                               .stabilisations = own_stabilisations,
                               .options = own_options,
                               .open = own_open,
                               .advance = own_advance,
                               PW_STEP_FUNCTIONS };
static const pw_method own_incomplete = { .name = "incomplete",
                                          .stabilisations = own_stabilisations,
                                          .options = own_options,
                                          .open = own_open,
                                          PW_STEP_FUNCTIONS };
static const pw_method *const own_methods[] = { &own, &own_incomplete, NULL };

static const pw_settings own_settings = { .step = 1e-3, .methods = own_methods };

static pw_system *own_system (const pw_signal *torque) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  if (torque) check_ok (pw_model_set_signal (m, "rider", "value", torque, &error), &error);
  return scene_compile (m);
}

/* Projection keeps residuals at round-off; feedback reduces them. */
TEST (stabilisations) {
  static const char *const method[] = { "euler", "euler+baumgarte:alpha=50:beta=50", "euler+projection" };
  double off[3];
  for (int i = 0; i < 3; i++) {
    pw_system *s = own_system (NULL);
    pw_run *r = runs_open (s, method[i], &own_settings);
    runs_to (r, 1);
    off[i] = pw_run_statistics (r)->position;
    assert_int_equal (pw_run_statistics (r)->steps, 1000);
    pw_run_close (r);
    pw_system_free (s);
  }
  check_below ("with feedback", off[1], off[0] / 2, "it has to matter");
  check_below ("projected", off[2], 1e-14, "round-off");
  assert_true (off[0] > 1e-6);
}

/* Steps end at a discontinuity, with the accelerations before it, and at t_end; steps after it are multiples of the
 * given size. */
TEST (breakpoint) {
  const pw_signal pulse = { PW_PULSE, .pulse = { .height = 0.1, .start = 0.0104, .width = 0.02 } };
  pw_system *s = own_system (&pulse);
  pw_run *r = runs_open (s, "euler+projection", &own_settings);
  pw_error error = { 0 };
  int met = 0;
  pw_sample x;
  check_ok (pw_run_advance (r, 0.0005, &error), &error);
  check_ok (pw_run_advance (r, 0.02, &error), &error);
  check_close ("a step after a shortened one", pw_run_time (r), 0.0015, 1e-15, "a rounding");
  while (pw_run_time (r) < 0.02) {
    check_ok (pw_run_advance (r, 0.02, &error), &error);
    if (pw_run_time (r) != 0.0104) continue;
    met = 1;
    check_ok (pw_run_sample (r, 0.0102, &x, &error), &error);
    check_close ("before the pulse", x.v[2], 0, 1e-12, "at rest");
  }
  assert_true (met);
  check_close ("the end", pw_run_time (r), 0.02, 0, "the last step ends there");
  assert_int_equal (pw_run_statistics (r)->steps, 11 + 10);
  pw_run_close (r);
  pw_system_free (s);
}

/* A sample inside a step satisfies the constraints, and lies between the ends like a cubic. */
TEST (sample) {
  pw_system *s = own_system (NULL);
  pw_run *r = runs_open (s, "euler+projection", &own_settings);
  runs_to (r, 0.5);
  pw_sample x;
  pw_error error = { 0 };
  check_ok (pw_run_sample (r, 0.5, &x, &error), &error);
  double end = x.q[0], v = x.v[0];
  check_ok (pw_run_sample (r, 0.4995, &x, &error), &error);
  check_close ("halfway", x.q[0], end - 0.0005 * v, 1e-6,
               "h^2/8 of an acceleration below 1, and the method's own error");
  check_below ("residual", fmax (x.position, x.velocity), 1e-13, "it is projected");
  assert_int_equal (pw_run_sample (r, 0.49, &x, &error), PW_INPUT);
  pw_run_close (r);
  pw_system_free (s);
}

/* Samples inside a step contain a part of the energy that its projection adds: at its beginning, none. */
TEST (sample_projection) {
  pw_error error = { 0 };
  pw_sample x;
  pw_system *s = scene_named ("pendulum", NULL, 0);
  pw_run *r = runs_open (s, "euler+projection", &(pw_settings){ .step = 1e-2, .ledger = 1, .methods = own_methods });
  const pw_sample before = runs_to (r, 0.5);
  check_ok (pw_run_advance (r, 1, &error), &error);
  const pw_sample after = runs_to (r, pw_run_time (r));
  assert_true (fabs (after.projection - before.projection) > 1e-6);
  check_ok (pw_run_sample (r, 0.5, &x, &error), &error);
  check_close ("at the beginning", x.projection, before.projection, 0, "the end of the last step");
  check_close ("balance there", x.balance, before.balance, 1e-12, "round-off of a projection");
  check_ok (pw_run_sample (r, 0.505, &x, &error), &error);
  check_close ("halfway", x.projection, (before.projection + after.projection) / 2, 1e-12, "linear, with round-off");
  runs_close (r, s);
}

/* A run resumed from a checkpoint continues bit-identically. */
TEST (checkpoint) {
  pw_system *s = own_system (NULL);
  pw_run *r = runs_open (s, "euler+projection", &own_settings);
  runs_to (r, 0.1234);
  pw_run *loaded = runs_copy (r, s, "euler+projection", &own_settings);
  check_bits ("q", runs_to (loaded, 0.4).q, runs_to (r, 0.4).q, 6);
  pw_run_close (loaded);
  runs_close (r, s);
}

/* Only while a step is near a singular configuration is there no checkpoint. */
TEST (after_singular) {
  pw_error error = { 0 };
  pw_archive a = { 0 };
  pw_system *s = own_system (NULL);
  pw_run *r = runs_open (s, "euler+projection", &own_settings);
  r->near_singular = 1;
  assert_int_equal (pw_run_save (r, &a, &error), PW_RETRY);
  check_ok (pw_run_advance (r, 1, &error), &error);
  check_ok (pw_run_save (r, &a, &error), &error);
  pw_archive_free (&a);
  pw_run_close (r);
  pw_system_free (s);
}

TEST (errors) {
  pw_system *s = own_system (NULL);
  pw_error error = { 0 };
  assert_null (pw_run_open (s, "eulr", &own_settings, &error));
  check_error (&error, PW_INPUT, "there is no integrator \"eulr\"; did you mean \"euler\"?");
  error.status = PW_OK;
  assert_null (pw_run_open (s, "incomplete", &own_settings, &error));
  check_error (&error, PW_INPUT, "integrator incomplete: its table needs open, advance, at, restart and close");
  error.status = PW_OK;
  assert_null (pw_run_open (s, "euler", NULL, &error));
  assert_int_equal (error.status, PW_INPUT);
  pw_system_free (s);
}
