/* Eigenvalues, singular values, and the linearisation of scenes whose vibrations are known. */
#include <math.h>
#include "eigen.h"
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

/* ---- Matrices ---- */

/* A = H D H with the reflection H = I - 2 w w^T / w^T w. */
static void linear_turned (int n, double *A) {
  double w[40], square = 0;
  for (int i = 0; i < n; i++) w[i] = sin (1 + 2.7 * i), square += w[i] * w[i];
  for (int side = 0; side < 2; side++)
    for (int k = 0; k < n; k++) {
      double dot = 0;
      for (int i = 0; i < n; i++) dot += w[i] * (side ? A[i * n + k] : A[k * n + i]);
      for (int i = 0; i < n; i++) *(side ? &A[i * n + k] : &A[k * n + i]) -= 2 * dot / square * w[i];
    }
}

static void test_known_eigenvalues (void **state) {
  static const double known[][2] = { { -5, 4 }, { -5, -4 }, { 6, 0 }, { 0, 3 }, { 0, -3 }, { -2, 0 }, { 1e-9, 0 } };
  double A[49] = { 0 }, re[7], im[7];
  (void)state;
  for (int i = 0; i < 7; i++) {
    A[i * 8] = known[i][0];
    if (known[i][1] > 0) A[i * 8 + 1] = known[i][1], A[i * 8 + 7] = -known[i][1];
  }
  linear_turned (7, A);
  assert_int_equal (pw_eigenvalues (7, A, re, im), PW_OK);
  for (int i = 0; i < 7; i++) {
    double nearest = INFINITY;
    for (int k = 0; k < 7; k++) nearest = fmin (nearest, hypot (re[k] - known[i][0], im[k] - known[i][1]));
    check_below ("nearest", nearest, 100 * CHECK_EPS * 7, "100 eps of the largest");
  }
}

/* The sums of powers of the eigenvalues are the traces of the powers. */
static void test_random_eigenvalues (void **state) {
  enum { N = 40 };
  static double A[N * N], B[N * N], re[N], im[N];
  double trace = 0, square = 0, sum = 0, squares = 0, size = 0;
  (void)state;
  for (int i = 0; i < N * N; i++) A[i] = B[i] = ldexp (sin (1.0 + 7.1 * i * i), i % 3 * (i / N % 5));
  for (int i = 0; i < N; i++) trace += A[i * N + i];
  for (int i = 0; i < N * N; i++) square += A[i] * A[i % N * N + i / N], size = fmax (size, fabs (A[i]));
  assert_int_equal (pw_eigenvalues (N, B, re, im), PW_OK);
  for (int i = 0; i < N; i++) {
    sum += re[i], squares += re[i] * re[i] - im[i] * im[i];
    if (im[i] > 0) check_close ("pair", im[i + 1], -im[i], 0, "exact");
  }
  check_close ("trace", sum, trace, 100 * N * CHECK_EPS * size, "100 N eps");
  check_close ("trace of the square", squares, square, 100 * N * N * CHECK_EPS * size * size, "100 N^2 eps");
}

/* Small singular values are as exact as large ones; of a defective matrix, eps^(1/3) is all that is known. */
static void test_singular_values (void **state) {
  double x[9] = { 3, 0, 0, 0, 1e-9, 0, 0, 0, 1 }, sigma[3], re[3], im[3];
  double nilpotent[9] = { 0, 1, 0, 0, 0, 1, 0, 0, 0 };
  double nan[1] = { NAN };
  (void)state;
  for (int i = 0; i < 3; i++) { /* turned in the plane of the first two entries */
    double u = x[3 * i], v = x[3 * i + 1];
    x[3 * i] = 0.6 * u - 0.8 * v, x[3 * i + 1] = 0.8 * u + 0.6 * v;
  }
  pw_singular_values (3, 3, x, sigma);
  check_close ("largest", sigma[0], 3, 16 * CHECK_EPS, "round-off");
  check_close ("least", sigma[1], 1e-9, 1e-9 * 16 * CHECK_EPS, "round-off of its own size");
  assert_int_equal (pw_eigenvalues (3, nilpotent, re, im), PW_OK);
  check_below ("nilpotent", hypot (re[0], im[0]), 10 * cbrt (CHECK_EPS), "eps^(1/3)");
  assert_int_equal (pw_eigenvalues (1, nan, re, im), PW_RETRY);
}

/* ---- Scenes ---- */

static pw_linear linear_of (const pw_plugin_table *table) {
  pw_error error = { 0 };
  pw_linear l;
  pw_system *s = scene_system (table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  check_ok (pw_linearise (r, 100, &l, &error), &error);
  for (int i = 1; i < l.unknowns; i++) assert_true (l.re[i] <= l.re[i - 1]);
  pw_close (r);
  pw_free (s);
  return l;
}

static void linear_expect (const pw_linear *l, int i, double re, double im) {
  double bound = 1e-9 * (hypot (re, im) + 1);
  check_close ("re", l->re[i], re, bound, "exact blocks; 0 may be defective at a distance");
  check_close ("im", l->im[i], im, bound, "exact blocks; 0 may be defective at a distance");
}

static void linear_pendulum (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 2, .inertia = 0.5, .start = { 0, -0.7, -PW_PI / 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "bob", "ground" }, .at = { { -0.7, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

static void test_pendulum (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (linear_pendulum);
  (void)state;
  pw_linear l = linear_of (&table);
  assert_int_equal (l.positions, 1);
  assert_int_equal (l.velocities, 1);
  assert_int_equal (l.unknowns, 2);
  assert_int_equal (l.rank, 2);
  linear_expect (&l, 0, 0, sqrt (2 * 9.81 * 0.7 / (0.5 + 2 * 0.49)));
  linear_expect (&l, 1, 0, -sqrt (2 * 9.81 * 0.7 / (0.5 + 2 * 0.49)));
  check_close ("least", l.least, 1, 16 * CHECK_EPS, "perpendicular rows");
  pw_linear_close (&l);
}

static void linear_oscillator (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "block", .mass = 1.5, .inertia = 0.1, .start = { 0.8 } });
  pw_add_spring (
      m, &(pw_spring){ .name = "S", .body = { "ground", "block" }, .stiffness = 60, .damping = 2.4, .length = 0.8 });
}

static void test_oscillator (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (linear_oscillator);
  (void)state;
  pw_linear l = linear_of (&table);
  assert_int_equal (l.unknowns, 6);
  assert_true (isnan (l.least));
  linear_expect (&l, 4, -0.8, sqrt (60 / 1.5 - 0.64));
  linear_expect (&l, 5, -0.8, -sqrt (60 / 1.5 - 0.64));
  for (int i = 0; i < 4; i++) linear_expect (&l, i, 0, 0);
  pw_linear_close (&l);
}

/* A link pinned to an arm that turns steadily swings about the radius: w^2 = m R l W^2 / (I + m l^2). */
static void linear_rotor (pw_model *m, const void *parameters) {
  const double R = 0.9, l = 0.4, W = 7;
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 1, .rate = { 0, 0, W } });
  pw_add_body (
      m,
      &(pw_body){ .name = "link", .mass = 2, .inertia = 0.1, .start = { R + l, 0, 0 }, .rate = { 0, (R + l) * W, W } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "arm", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "arm", "link" }, .at = { { R, 0 }, { -l, 0 } } });
  pw_add_speed (
      m, &(pw_speed){
             .name = "turn", .body = "arm", .at = { 1, 0 }, .heading = PW_PI / 2, .value = { PW_CONSTANT, { W } } });
}

static void test_rotor (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (linear_rotor);
  (void)state;
  pw_linear l = linear_of (&table);
  assert_int_equal (l.positions, 2);
  assert_int_equal (l.velocities, 1);
  linear_expect (&l, 0, 0, 7 * sqrt (2 * 0.9 * 0.4 / (0.1 + 2 * 0.16)));
  linear_expect (&l, 2, 0, 0);
  pw_linear_close (&l);
}

/* The Chaplygin sleigh runs straight, mass behind: (I + m a^2) w' = -m a u w grows. */
static void linear_sleigh (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "sleigh", .mass = 3, .inertia = 0.5, .start = { 0, 0, 0.3 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "blade", .body = "sleigh", .at = { -0.2, 0 } });
  pw_add_speed (m, &(pw_speed){ .name = "tow", .body = "sleigh", .at = { -0.2, 0 }, .value = { PW_CONSTANT, { -4 } } });
}

static void test_sleigh (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (linear_sleigh);
  (void)state;
  pw_linear l = linear_of (&table);
  assert_int_equal (l.positions, 3);
  assert_int_equal (l.velocities, 1);
  linear_expect (&l, 0, 3 * 0.2 * 4 / (0.5 + 3 * 0.04), 0);
  for (int i = 1; i < 4; i++) check_below ("the others", hypot (l.re[i], l.im[i]), 1e-4, "0, defective: eps^(1/3)");
  pw_linear_close (&l);
}

/* Twin wheels are one row; of massless bodies nothing is left over. */
static void linear_twins (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "axle", .mass = 1, .inertia = 1 });
  for (int i = 0; i < 2; i++)
    pw_add_wheel (m, &(pw_wheel){ .name = i ? "right" : "left", .body = "axle", .at = { 0, 0.5 - i } });
}

static void test_rank (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (linear_twins);
  (void)state;
  pw_linear l = linear_of (&table);
  assert_int_equal (l.positions, 3);
  assert_int_equal (l.velocities, 2);
  assert_int_equal (l.rank, 1);
  pw_linear_close (&l);
  l = linear_of (&scene_ezyroller);
  assert_int_equal (l.positions, 4);
  assert_int_equal (l.velocities, 2);
  assert_int_equal (l.rank, 4);
  assert_true (l.re != NULL && l.least > 0.1);
  pw_linear_close (&l);
}

static void test_large (void **state) {
  static const pw_plugin_table table = TRIAL_TABLE (linear_pendulum);
  pw_error error = { 0 };
  pw_linear l;
  (void)state;
  pw_system *s = scene_system (&table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  check_ok (pw_linearise (r, 2, &l, &error), &error);
  assert_true (l.re == NULL && l.velocities == 1);
  pw_linear_close (&l);
  pw_close (r);
  pw_free (s);
}

/* ---- RK4 ---- */

static void test_rk4_limit (void **state) {
  (void)state;
  check_close ("damped", pw_rk4_limit (-2, 0), 2.785293563405282 / 2, 1e-9, "root of |R| = 1 on the negative axis");
  check_close ("undamped", pw_rk4_limit (0, 10), sqrt (8) / 10, 1e-6, "root 2 sqrt 2, which is flat: 1e-12 in |R|");
  check_close ("growing and turning", pw_rk4_limit (3, 10), sqrt (8) / 10, 1e-6, "as undamped");
  assert_true (isinf (pw_rk4_limit (3, 0)) && isinf (pw_rk4_limit (0, 0)));
  assert_true (pw_rk4_limit (-1, 1) > 1.5 && pw_rk4_limit (-1, 1) < 3);
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_known_eigenvalues),
    cmocka_unit_test (test_random_eigenvalues),
    cmocka_unit_test (test_singular_values),
    cmocka_unit_test (test_pendulum),
    cmocka_unit_test (test_oscillator),
    cmocka_unit_test (test_rotor),
    cmocka_unit_test (test_sleigh),
    cmocka_unit_test (test_rank),
    cmocka_unit_test (test_large),
    cmocka_unit_test (test_rk4_limit),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
