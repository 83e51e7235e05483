/* gravity: free fall, a pendulum, a knife edge on an incline. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

/* ---- Free fall ---- */

static void gravity_fall (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "stone", .mass = 3, .inertia = 0.1, .start = { 1, 2 }, .rate = { 4, 5, 6 } });
  pw_add_body (m, &(pw_body){ .name = "wing", .start = { 1.5, 2 } });
  pw_add_weld (m, &(pw_weld){ .name = "W", .body = { "stone", "wing" }, .at = { { 0.5, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0.5, -9.81 } });
}

/* The centre of mass moves on a parabola, which classical Runge-Kutta follows exactly; the wing has no mass. */
static void test_fall (void **state) {
  (void)state;
  static const pw_plugin_table table = TRIAL_TABLE (gravity_fall);
  pw_system *s = scene_system (&table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.01, .ledger = 1 });
  pw_sample x = runs_to (r, 2);
  double bound = 200 * 8 * CHECK_EPS, size = 20;
  check_close ("x", trial_state (s, &x, "stone.x"), 1 + 4 * 2 + 0.5 * 0.5 * 4, size * bound, "round-off of 200 steps");
  check_close ("y", trial_state (s, &x, "stone.y"), 2 + 5 * 2 - 0.5 * 9.81 * 4, size * bound, "round-off of 200 steps");
  check_close ("phi", trial_state (s, &x, "stone.phi"), 12, size * bound, "round-off of 200 steps");
  check_close ("potential", x.potential, -3 * (0.5 * x.q[0] - 9.81 * x.q[1]), 1e3 * CHECK_EPS, "-m a . r");
  check_close ("balance", x.balance, 0, 1e3 * bound, "round-off of an energy of 1 kJ");
  for (int k = 0; k < s->slabs; k++)
    if (s->slab[k].kind == &pw_kind_gravity) assert_int_equal (s->slab[k].b.count, 1);
  pw_close (r);
  pw_free (s);
}

/* ---- Knife edge on an incline: x = k sin^2 wt, y = k (wt - sin (2wt) / 2), k = g sin alpha / 2w^2 ---- */

static void gravity_incline (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "skate", .mass = 2, .inertia = 0.3, .rate = { 0, 0, 1 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "edge", .body = "skate" });
  pw_add_gravity (m, &(pw_gravity){ .name = "slope", .acceleration = { 9.81 * 0.5, 0 } });
}

static void gravity_skate (const char *method, double bound, const char *reason) {
  static const pw_plugin_table table = TRIAL_TABLE (gravity_incline);
  pw_system *s = scene_system (&table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 10, .ledger = 1 });
  for (int t = 1; t <= 10; t++) {
    pw_sample x = runs_to (r, t);
    double k = 9.81 * 0.5 / 2;
    check_close ("x", x.q[0], k * sin (t) * sin (t), bound, reason);
    check_close ("y", x.q[1], k * (t - sin (2 * t) / 2), bound, reason);
    check_close ("|lambda|", fabs (x.lambda[0]), 2 * 2 * 9.81 * 0.5 * fabs (sin (t)), 20 * bound, reason);
    check_close ("balance", x.balance, 0, 20 * bound, reason);
    if (t < 10) continue;
    check_close ("x (10 s)", x.q[0], 0.7258393717013280771, bound, reason);
    check_close ("y (10 s)", x.q[1], 23.40550088629524659, bound, reason);
  }
  pw_close (r);
  pw_free (s);
}

static void test_incline (void **state) {
  (void)state;
  gravity_skate ("rk4+projection", 1e-10, "100 h^4 at h = 1e-3");
  gravity_skate ("ida+ggl", 1e-6, "1e4 rtol");
  gravity_skate ("ida+baumgarte", 1e-6, "1e4 rtol");
}

/* ---- A pendulum of a point mass on a massless rod, from the horizontal (IFToMM A01) ---- */

static void gravity_pendulum (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 1, .start = { 1, 0, 0 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "bob", "ground" }, .at = { { -1, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

static const pw_plugin_table gravity_pendulum_table = TRIAL_TABLE (gravity_pendulum);

static void test_pendulum (void **state) {
  (void)state;
  pw_system *s = scene_system (&gravity_pendulum_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  pw_sample x = runs_to (r, 10);
  check_close ("x", x.q[0], 0.2750874625761168601, 1e-9, "10 (h g/L)^4 at h = 1e-3, over 4 swings");
  check_close ("y", x.q[1], -0.9614192050991250643, 1e-9, "10 (h g/L)^4 at h = 1e-3, over 4 swings");
  check_close ("balance", x.balance, 0, 1e-9, "10 (h g/L)^4");
  pw_close (r);
  pw_free (s);
}

static void test_methods (void **state) {
  (void)state;
  trial (&gravity_pendulum_table, 3);
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_fall),
    cmocka_unit_test (test_incline),
    cmocka_unit_test (test_pendulum),
    cmocka_unit_test (test_methods),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
