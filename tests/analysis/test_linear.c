/* Linearisation of scenes with known frequencies. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

static pw_linear linear_of (const pw_plugin_table *table) {
  pw_error error = { 0 };
  pw_linear l;
  pw_system *s = scene_system (table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  check_ok (pw_run_linearise (r, 100, &l, &error), &error);
  for (int i = 1; i < l.unknowns; i++) assert_true (l.re[i] <= l.re[i - 1]);
  for (int i = 0; i < l.unknowns; i++) assert_false (l.im[i] == 0 && signbit (l.im[i]));
  pw_run_close (r);
  pw_system_free (s);
  return l;
}

static void linear_expect (const pw_linear *l, int i, double re, double im) {
  double bound = 1e-9 * (hypot (re, im) + 1);
  check_close ("re", l->re[i], re, bound, "exact blocks; 0 may be defective at a distance");
  check_close ("im", l->im[i], im, bound, "exact blocks; 0 may be defective at a distance");
}

SCENE (linear_pendulum) {
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 2, .inertia = 0.5, .start = { 0, -0.7, -PW_PI / 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "bob", "ground" }, .at = { { -0.7, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

TEST (pendulum) {
  pw_linear l = linear_of (&linear_pendulum_table);
  assert_int_equal (l.positions, 1);
  assert_int_equal (l.velocities, 1);
  assert_int_equal (l.unknowns, 2);
  assert_int_equal (l.rank, 2);
  linear_expect (&l, 0, 0, sqrt (2 * 9.81 * 0.7 / (0.5 + 2 * 0.49)));
  linear_expect (&l, 1, 0, -sqrt (2 * 9.81 * 0.7 / (0.5 + 2 * 0.49)));
  check_close ("least", l.least, 1, 16 * CHECK_EPS, "perpendicular rows");
  pw_linear_free (&l);
}

/* Two rows at an angle have the singular values sqrt (1 +- cos). */
SCENE (linear_oblique) {
  pw_add_body (m, &(pw_body){ .name = "block", .mass = 1, .inertia = 1 });
  for (int i = 0; i < 2; i++)
    pw_add_speed (m, &(pw_speed){ .name = i ? "oblique" : "along", .body = "block", .heading = 0.6 * i });
}

TEST (least) {
  pw_linear l = linear_of (&linear_oblique_table);
  check_close ("least", l.least, sqrt (1 - cos (0.6)), 16 * CHECK_EPS, "two rows");
  pw_linear_free (&l);
}

SCENE (linear_oscillator) {
  pw_add_body (m, &(pw_body){ .name = "block", .mass = 1.5, .inertia = 0.1, .start = { 0.8 } });
  pw_add_spring (
      m, &(pw_spring){ .name = "S", .body = { "ground", "block" }, .stiffness = 60, .damping = 2.4, .length = 0.8 });
}

TEST (oscillator) {
  pw_linear l = linear_of (&linear_oscillator_table);
  assert_int_equal (l.unknowns, 6);
  assert_true (isnan (l.least));
  linear_expect (&l, 4, -0.8, sqrt (60 / 1.5 - 0.64));
  linear_expect (&l, 5, -0.8, -sqrt (60 / 1.5 - 0.64));
  for (int i = 0; i < 4; i++) linear_expect (&l, i, 0, 0);
  pw_linear_free (&l);
}

/* A link pinned to an arm that turns steadily oscillates about the radius: w^2 = m R l W^2 / (I + m l^2). */
SCENE (linear_rotor) {
  const double R = 0.9, l = 0.4, W = 7;
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 1, .rate = { 0, 0, W } });
  pw_add_body (
      m,
      &(pw_body){ .name = "link", .mass = 2, .inertia = 0.1, .start = { R + l, 0, 0 }, .rate = { 0, (R + l) * W, W } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "arm", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "arm", "link" }, .at = { { R, 0 }, { -l, 0 } } });
  pw_add_speed (
      m,
      &(pw_speed){ .name = "turn", .body = "arm", .at = { 1, 0 }, .heading = PW_PI / 2, .value = { .constant = W } });
}

TEST (rotor) {
  pw_linear l = linear_of (&linear_rotor_table);
  assert_int_equal (l.positions, 2);
  assert_int_equal (l.velocities, 1);
  linear_expect (&l, 0, 0, 7 * sqrt (2 * 0.9 * 0.4 / (0.1 + 2 * 0.16)));
  linear_expect (&l, 2, 0, 0);
  pw_linear_free (&l);
}

/* The Chaplygin sleigh runs straight, centre of mass behind the wheel: (I + m a^2) w' = -m a u w grows. */
SCENE (linear_sleigh) {
  pw_add_body (m, &(pw_body){ .name = "sleigh", .mass = 3, .inertia = 0.5, .start = { 0, 0, 0.3 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "blade", .body = "sleigh", .at = { -0.2, 0 } });
  pw_add_speed (m, &(pw_speed){ .name = "tow", .body = "sleigh", .at = { -0.2, 0 }, .value = { .constant = -4 } });
}

TEST (sleigh) {
  pw_linear l = linear_of (&linear_sleigh_table);
  assert_int_equal (l.positions, 3);
  assert_int_equal (l.velocities, 1);
  linear_expect (&l, 0, 3 * 0.2 * 4 / (0.5 + 3 * 0.04), 0);
  for (int i = 1; i < 4; i++) check_below ("the others", hypot (l.re[i], l.im[i]), 1e-4, "0, defective: eps^(1/3)");
  pw_linear_free (&l);
}

/* Twin wheels count as one row; massless bodies add no eigenvalues. */
SCENE (linear_twins) {
  pw_add_body (m, &(pw_body){ .name = "axle", .mass = 1, .inertia = 1 });
  for (int i = 0; i < 2; i++)
    pw_add_wheel (m, &(pw_wheel){ .name = i ? "right" : "left", .body = "axle", .at = { 0, 0.5 - i } });
}

TEST (rank) {
  pw_linear l = linear_of (&linear_twins_table);
  assert_int_equal (l.positions, 3);
  assert_int_equal (l.velocities, 2);
  assert_int_equal (l.rank, 1);
  pw_linear_free (&l);
  l = linear_of (&scene_ezyroller);
  assert_int_equal (l.positions, 4);
  assert_int_equal (l.velocities, 2);
  assert_int_equal (l.rank, 4);
  assert_true (l.re != NULL && l.least > 0.1);
  pw_linear_free (&l);
}

TEST (large) {
  pw_error error = { 0 };
  pw_linear l;
  pw_system *s = scene_system (&linear_pendulum_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  check_ok (pw_run_linearise (r, 2, &l, &error), &error);
  assert_true (l.re == NULL && l.velocities == 1);
  pw_linear_free (&l);
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- Signals that jump or fail beside the state ---- */

static int linear_sign (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = (x[0] > 0) - (x[0] < 0);
  if (gradient) gradient[0] = 0;
  return 0;
}

/* x^2, which fails for x < 0. */
static int linear_half (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = x[0] * x[0];
  if (gradient) gradient[0] = 2 * x[0];
  return x[0] < 0;
}

static void linear_add_block (pw_model *m, pw_function force) {
  pw_add_body (m, &(pw_body){ .name = "block", .mass = 1, .inertia = 1 });
  pw_add_force (m, &(pw_force){ .name = "F", .body = "block", .fx = { PW_FUNCTION, .function = force } });
}

static const char *const linear_reads[] = { "block.vx", NULL };

SCENE (linear_jumping) {
  linear_add_block (m, (pw_function){ .eval = linear_sign, .reads = linear_reads });
}

SCENE (linear_one_sided) {
  linear_add_block (m, (pw_function){ .eval = linear_half, .reads = linear_reads });
}

/* Neither state has a linearisation; the workspace is left at it, not at a state beside it. */
TEST (jump) {
  static const pw_plugin_table *const table[] = { &linear_jumping_table, &linear_one_sided_table };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_linear l;
    pw_system *s = scene_system (table[i], NULL);
    pw_run *r = runs_open (s, "rk4", NULL);
    assert_int_equal (pw_run_linearise (r, 100, &l, &error), PW_METHOD);
    assert_non_null (strstr (error.text, "accelerations jump with block.vx"));
    assert_true (r->w->configuration[0].vx == 0);
    pw_linear_free (&l);
    runs_close (r, s);
  }
}

/* ---- RK4 ---- */

TEST (rk4_limit) {
  check_close ("damped", pw_rk4_limit (-2, 0), 2.785293563405282 / 2, 1e-9, "root of |R| = 1 on the negative axis");
  check_close ("undamped", pw_rk4_limit (0, 10), sqrt (8) / 10, 1e-6, "root 2 sqrt 2, which is flat: 1e-12 in |R|");
  check_close ("growing and turning", pw_rk4_limit (3, 10), sqrt (8) / 10, 1e-6, "as undamped");
  assert_true (isinf (pw_rk4_limit (3, 0)) && isinf (pw_rk4_limit (0, 0)) && isinf (pw_rk4_limit (-1e-320, 0)));
  assert_true (pw_rk4_limit (-1, 1) > 1.5 && pw_rk4_limit (-1, 1) < 3);
}
