/* Runs agree: between integrators, with and without ledger and samples, in other units; the independent verifier's
 * residuals are small. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "toys.h"
#include "pinwheel-selftest.h"

/* ---- Scenes, which together use all features of element types ---- */

/* A cart on a rolling wheel with an internal coordinate, with a damped spring to the ground, an arm driven by a
 * motor, and a free pendulum at its end. */
SCENE (agree_cart) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 2, .inertia = 0.3, .rate = { 0.5, 0, 0.4 } });
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 0.5, .inertia = 0.05, .start = { 0.8, 0, 0.3 } });
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 0.3, .inertia = 0.01, .start = { 1.3, 0.1, -0.4 } });
  pw_add (m, &toy_kind_roller,
          &(toy_roller){ .name = "W", .body = "cart", .at = { -0.2, 0.1 }, .radius = 0.15, .inertia = 0.02 });
  pw_add (m, &toy_kind_spring,
          &(toy_spring){ .name = "tie",
                         .body = { "ground", "cart" },
                         .at = { { -1, 0.5 }, { 0.1, 0 } },
                         .stiffness = 8,
                         .length = 1,
                         .damping = 0.3 });
  pw_add (m, &toy_kind_drive,
          &(toy_drive){ .name = "motor",
                        .body = { "arm", "cart" },
                        .angle = { PW_HARMONIC, .harmonic = { .amplitude = 0.6, .omega = 3, .phase = 0.5 } } });
  pw_add (m, &toy_kind_weight, &(toy_weight){ .name = "slope", .g = { 0.3, -0.8 } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "cart", "arm" }, .at = { { 0.4, 0 }, { -0.4, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "Q", .body = { "arm", "bob" }, .at = { { 0.3, 0 }, { -0.2, 0 } } });
}

/* A torque that depends on states: a steering with spring and damper. */
static int agree_steering (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context;
  value[0] = 0.1 * cos (PW_PI * t) + 0.02 * (x[1] - x[0] - PW_PI) + 0.01 * (x[3] - x[2]);
  if (gradient) gradient[0] = -0.02, gradient[1] = 0.02, gradient[2] = -0.01, gradient[3] = 0.01;
  return 0;
}

enum { AGREE_MASSLESS, AGREE_MASSIVE, AGREE_STATE_TORQUE, AGREE_CART, AGREE_SCENES };
static const char *const agree_names[] = { "massless", "massive", "state-dependent torque", "cart" };

static pw_system *agree_scene (int scene) {
  static const char *const reads[] = { "frame.phi", "steer.phi", "frame.omega", "steer.omega", NULL };
  pw_error error = { 0 };
  if (scene == AGREE_CART) return scene_system (&agree_cart_table, NULL);
  if (scene == AGREE_MASSLESS) return scene_system (&scene_ezyroller, NULL);
  pw_model *m = scene_model (&scene_ezyroller, "m2", 0.1, "I2", 0.01, NULL);
  pw_signal torque = { PW_FUNCTION, .function = { .eval = agree_steering, .reads = reads } };
  if (scene == AGREE_STATE_TORQUE) check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  return scene_compile (m);
}

enum { AGREE_MOST = 10 };

/* The largest frequency of the scenes is about 3/s: error of a method of order 4 after a few seconds. */
static double agree_order_4 (double h) {
  return pow (3 * h, 4);
}
static const char agree_reason[] = "(h omega)^4, omega = 3/s";

/* ---- Comparison of integrators ---- */

static const struct {
  const char *name;
  double factor; /* error in units of rtol */
} agree_methods[] = { { "rk4+none", 0 },
                      { "rk4+baumgarte", 0 },
                      { "rk4+projection:metric=identity", 0 },
                      { "rk4+projection:every=5", 0 },
                      { "ida+ggl", 1e3 },
                      { "radau+ggl", 1e3 },
                      { "radau+index2", 1e3 },
                      { "radau+index3", 1e3 },
                      { "ida+baumgarte", 1e3 },
                      { "ida+none", 1e3 },
                      { "ida+index2", 1e3 },
                      { "ida+si1", 1e3 },
                      { "adams+none", 1e3 },
                      { "adams+baumgarte", 1e3 },
                      { "bdf+none", 1e3 },
                      { "bdf+baumgarte", 1e3 },
                      { "bdf+projection", 1e3 },
                      { "bdf+projection:metric=identity:every=3", 1e3 } };

TEST (integrators) {
  const double rtol = 1e-9;
  for (int scene = 0; scene < AGREE_SCENES; scene++) {
    double q[AGREE_MOST], v[AGREE_MOST], Q[AGREE_MOST], V[AGREE_MOST];
    pw_system *s = agree_scene (scene);
    runs_state (s, "rk4+projection", &(pw_settings){ .step = 5e-4, .span = 3 }, 3, q, v, NULL);
    for (size_t i = 0; i < sizeof agree_methods / sizeof *agree_methods; i++) {
      runs_state (s, agree_methods[i].name, &(pw_settings){ .step = 1e-3, .rtol = rtol, .span = 3 }, 3, Q, V, NULL);
      double bound = agree_methods[i].factor > 0 ? agree_methods[i].factor * rtol : agree_order_4 (1e-3);
      const char *reason = agree_methods[i].factor > 0 ? "1e3 rtol" : agree_reason;
      for (int j = 0; j < pw_system_coordinates (s); j++) {
        char name[60];
        check_close (check_text ("%s, %s, %s", agree_names[scene], agree_methods[i].name,
                                 pw_system_state_name (s, j, name, sizeof name)),
                     Q[j], q[j], bound, reason);
      }
    }
    pw_system_free (s);
  }
}

/* ---- The ledger ---- */

/* The energy balances, and the ledger does not change the run. */
TEST (ledger) {
  static const char *const method[] = { "rk4+projection", "rk4+none",      "rk4+baumgarte",  "ida+ggl",
                                        "ida+baumgarte",  "ida+index2",    "ida+si1",        "adams+baumgarte",
                                        "bdf+none",       "bdf+baumgarte", "bdf+projection", "radau+ggl",
                                        "radau+index2",   "radau+index3" };
  for (int scene = 0; scene < AGREE_SCENES; scene++)
    for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
      pw_system *s = agree_scene (scene);
      pw_settings with = { .step = 1e-3, .rtol = 1e-9, .span = 3, .ledger = 1 }, without = with;
      without.ledger = 0;
      pw_run *r = runs_open (s, method[i], &with);
      pw_sample now = runs_to (r, 3);
      char what[60];
      snprintf (what, sizeof what, "balance of %s, %s", agree_names[scene], method[i]);
      check_close (what, now.balance, 0, i < 3 ? agree_order_4 (1e-3) : 1e3 * with.rtol,
                   i < 3 ? agree_reason : "1e3 rtol");
      double work = 0, loss = 0;
      for (int e = 0; e < pw_system_ledger_entries (s); e++)
        *(strstr (pw_system_ledger_name (s, e, what, sizeof what), ".work") ? &work : &loss) += now.ledger[e];
      assert_true (now.kinetic > 0 && now.loss >= 0 && now.work == work && now.loss == loss);
      double q[AGREE_MOST], v[AGREE_MOST];
      pw_statistics cost = *pw_run_statistics (r), other;
      memcpy (q, now.q, sizeof (double) * (size_t)pw_system_coordinates (s));
      memcpy (v, now.v, sizeof (double) * (size_t)pw_system_coordinates (s));
      pw_run_close (r);
      double Q[AGREE_MOST], V[AGREE_MOST];
      runs_state (s, method[i], &without, 3, Q, V, &other);
      check_bits ("positions without a ledger", Q, q, pw_system_coordinates (s));
      check_bits ("velocities without a ledger", V, v, pw_system_coordinates (s));
      assert_true (cost.steps == other.steps && cost.rejected == other.rejected && cost.rhs == other.rhs);
      pw_system_free (s);
    }
}

/* ---- Sampling ---- */

/* Samples at any time do not change the run, and satisfy the constraints as accurately as its steps. */
TEST (sampling) {
  static const char *const method[] = { "rk4+projection", "bdf+projection", "ida+ggl",    "radau+ggl",    "ida+si1",
                                        "rk4+none",       "ida+baumgarte",  "adams+none", "bdf+baumgarte" };
  for (int scene = 0; scene < AGREE_SCENES; scene++)
    for (int i = 0; i < 9; i++) {
      pw_system *s = agree_scene (scene);
      pw_settings settings = { .step = 1e-2, .rtol = 1e-7, .span = 2, .ledger = 1 };
      double q[AGREE_MOST], v[AGREE_MOST];
      pw_statistics plain;
      pw_error error = { 0 };
      pw_sample now;
      runs_state (s, method[i], &settings, 2, q, v, &plain);
      pw_run *r = runs_open (s, method[i], &settings);
      for (int k = 0; k <= 300; k++) { /* 0.00671 s does not divide the step */
        double t = 0.00671 * k < 2 ? 0.00671 * k : 2;
        check_ok (pw_run_advance_to (r, t, 2, &error), &error);
        check_ok (pw_run_sample (r, t, &now, &error), &error);
        assert_true (now.t == t);
        if (i > 4) continue;
        check_below ("position of a sample", now.position, i < 2 ? 16 * CHECK_EPS : 1e-6,
                     i < 2 ? "projected: round-off" : "10 rtol");
        check_below ("velocity of a sample", now.velocity, i < 2 ? 16 * CHECK_EPS : 1e-5,
                     i < 2 ? "projected: round-off" : "100 rtol");
      }
      now = runs_to (r, 2);
      check_bits ("positions", now.q, q, pw_system_coordinates (s));
      check_bits ("velocities", now.v, v, pw_system_coordinates (s));
      assert_int_equal (pw_run_statistics (r)->steps, plain.steps);
      assert_int_equal (pw_run_statistics (r)->rhs, plain.rhs);
      pw_run_close (r);
      pw_system_free (s);
    }
}

/* Samples inside steps are as accurate as the ends of steps. */
TEST (dense) {
  static const char *const method[] = { "rk4+projection", "ida+ggl", "radau+ggl" };
  for (int scene = 0; scene < AGREE_SCENES; scene++)
    for (int i = 0; i < 3; i++) {
      pw_system *s = agree_scene (scene);
      int n = pw_system_coordinates (s);
      pw_run *fine = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-4, .span = 1 });
      double q[10][AGREE_MOST], v[10][AGREE_MOST], t[10];
      for (int k = 0; k < 10; k++) {
        t[k] = 0.0957 * (k + 1);
        pw_sample now = runs_to (fine, t[k]);
        memcpy (q[k], now.q, (size_t)n * sizeof (double));
        memcpy (v[k], now.v, (size_t)n * sizeof (double));
      }
      pw_run_close (fine);
      pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .rtol = 1e-8, .span = 1 });
      for (int k = 0; k < 10; k++) {
        pw_error error = { 0 };
        pw_sample now;
        check_ok (pw_run_advance_to (r, t[k], 1, &error), &error);
        check_ok (pw_run_sample (r, t[k], &now, &error), &error);
        double bound = i == 0 ? agree_order_4 (1e-2) : 1e3 * 1e-8;
        for (int j = 0; j < n; j++) {
          check_close ("position of a sample", now.q[j], q[k][j], bound, i == 0 ? agree_reason : "1e3 rtol");
          check_close ("rate of a sample", now.v[j], v[k][j], 10 * bound, i == 0 ? "10 (h omega)^4" : "1e4 rtol");
        }
      }
      pw_run_close (r);
      pw_system_free (s);
    }
}

/* ---- The verifier ---- */

typedef struct {
  const char *method;
  double position, velocity, acceleration, force;
  const char *reason;
} agree_bound;

static void agree_verify (int scene, const agree_bound *bound) {
  pw_system *s = agree_scene (scene);
  pw_run *r = runs_open (s, bound->method, &(pw_settings){ .step = 1e-3, .rtol = 1e-9, .span = 2 });
  for (int k = 0; k <= 20; k++) {
    pw_sample now = runs_to (r, 0.1 * k);
    pw_verification v;
    assert_int_equal (pw_verify (s, pw_run_scale (r), now.t, now.q, now.v, now.a, now.lambda, &v), PW_OK);
    const struct {
      const char *name;
      const pw_worst_residual *verdict;
      double bound;
    } each[] = { { "g", &v.position, bound->position },
                 { "J v", &v.velocity, bound->velocity },
                 { "J a", &v.acceleration, bound->acceleration },
                 { "M a", &v.force, bound->force } };
    for (int i = 0; i < 4; i++) {
      check_below (check_text ("%s %s, %s at %s, t = %g", agree_names[scene], bound->method, each[i].name,
                               each[i].verdict->name, now.t),
                   each[i].verdict->scaled, each[i].bound, bound->reason);
      assert_true (each[i].verdict->name[0] != 0);
    }
    check_close ("the run's own position residual", now.position, v.position.scaled, 8 * CHECK_EPS + 0.5 * now.position,
                 "one formula");
  }
  pw_run_close (r);
  pw_system_free (s);
}

TEST (verifier) {
  static const agree_bound bounds[] = {
    { "rk4+projection", 16 * CHECK_EPS, 16 * CHECK_EPS, 64 * CHECK_EPS, 64 * CHECK_EPS,
      "round-off of the projection and of one solve" },
    { "rk4+none", 1e-10, 1e-10, 64 * CHECK_EPS, 64 * CHECK_EPS, "drift of order h^4; round-off of one solve" },
    { "radau+ggl", 1e-8, 1e-8, 64 * CHECK_EPS, 64 * CHECK_EPS, "10 rtol; round-off of one solve" },
    { "ida+ggl", 1e-8, 1e-8, 1e-4, 1e-4, "10 rtol; accelerations are one derivative up: 1e5 rtol" },
  };
  for (int scene = 0; scene < AGREE_SCENES; scene++)
    for (int i = 0; i < 4; i++) agree_verify (scene, &bounds[i]);
}

/* The verifier detects an error of 1e-6 in any number. */
TEST (verifier_detects_errors) {
  pw_system *s = agree_scene (AGREE_CART);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
  pw_sample now = runs_to (r, 0.5);
  int n = pw_system_coordinates (s), rows = pw_system_rows (s);
  double x[4][AGREE_MOST];
  const double *given[] = { now.q, now.v, now.a, now.lambda };
  for (int part = 0; part < 4; part++)
    for (int j = 0; j < (part == 3 ? rows : n); j++) {
      pw_verification v;
      for (int k = 0; k < 4; k++) memcpy (x[k], given[k], (size_t)(k == 3 ? rows : n) * sizeof (double));
      x[part][j] += 1e-6;
      assert_int_equal (pw_verify (s, pw_run_scale (r), now.t, x[0], x[1], x[2], x[3], &v), PW_OK);
      int noticed =
          v.position.scaled > 1e-9 || v.velocity.scaled > 1e-9 || v.acceleration.scaled > 1e-9 || v.force.scaled > 1e-9;
      assert_true (noticed || (part == 0 && j >= 3 * pw_system_bodies (s))); /* nothing depends on the spin angle */
    }
  x[0][0] = NAN;
  pw_verification v;
  assert_int_equal (pw_verify (s, pw_run_scale (r), now.t, x[0], now.v, now.a, now.lambda, &v), PW_OK);
  assert_true (isinf (v.position.scaled) && v.position.name[0]);
  memcpy (x[2], now.a, (size_t)n * sizeof (double));
  x[2][0] = INFINITY;
  assert_int_equal (pw_verify (s, pw_run_scale (r), now.t, now.q, now.v, x[2], now.lambda, &v), PW_OK);
  assert_true (isinf (v.acceleration.scaled) && isinf (v.force.scaled) && v.force.name[0]);
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- Units ---- */

/* The EzyRoller in units of 1/1024 m and 1/8 kg: all numbers differ only in the exponent. */
TEST (units) {
  const double L = 1024, m = 8, I = L * L * m;
  static const char *const method[] = { "rk4+projection", "rk4+none",  "rk4+baumgarte", "ida+ggl",
                                        "ida+baumgarte",  "radau+ggl", "radau+index3" };
  for (int massive = 0; massive < 2; massive++)
    for (int i = 0; i < 7; i++) {
      double m2 = 0.1 * massive, I2 = 0.01 * massive, q[6], v[6], Q[6], V[6];
      pw_system *s = scene_system (&scene_ezyroller, "m2", m2, "I2", I2, NULL);
      pw_system *S = scene_system (&scene_ezyroller, "a", 0.5 * L, "b", 0.5 * L, "c", 0.125 * L, "d", 0.125 * L, "m1",
                                   m, "I1", 0.1 * I, "m2", m2 * m, "I2", I2 * I, "M0", 0.1 * I, NULL);
      pw_settings settings = { .step = 1e-3, .rtol = 1e-8, .span = 2 };
      pw_statistics cost, Cost;
      runs_state (s, method[i], &settings, 2, q, v, &cost);
      runs_state (S, method[i], &settings, 2, Q, V, &Cost);
      for (int j = 0; j < 6; j++) Q[j] /= j % 3 < 2 ? L : 1, V[j] /= j % 3 < 2 ? L : 1;
      if (i < 3) {
        check_bits (method[i], Q, q, 6);
        check_bits (method[i], V, v, 6);
      }
      for (int j = 0; j < 6; j++) check_close (method[i], Q[j], q[j], 1e-4, "1e4 rtol");
      check_close ("steps", (double)Cost.steps, (double)cost.steps, 0.1 * (double)cost.steps, "the same to 10 %");
      check_below ("scaled residual", Cost.position, 2 * cost.position + 64 * CHECK_EPS,
                   "the same, whatever the units");
      pw_system_free (s);
      pw_system_free (S);
    }
}

/* The same with moments among the multipliers: two welded bodies, one a point mass, swing, in units of 1/1024 m. */
static double agree_length;

SCENE (agree_swing) {
  const double L = agree_length;
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 0.1 * L * L, .start = { 0.5 * L } });
  pw_add_body (m, &(pw_body){ .name = "tip", .mass = 0.5, .start = { L, 0.2 * L } });
  pw_add_pin (m, &(pw_pin){ .name = "pin", .body = { "arm", "ground" }, .at = { { -0.5 * L } } });
  pw_add_weld (m, &(pw_weld){ .name = "weld", .body = { "arm", "tip" }, .at = { { 0.5 * L }, { 0, -0.2 * L } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 * L } });
}

TEST (units_of_moments) {
  static const char *const method[] = { "ida+si1", "ida+ggl", "ida+baumgarte", "radau+ggl" };
  for (int i = 0; i < 4; i++) {
    pw_settings settings = { .rtol = 1e-8, .span = 1 };
    double q[6], v[6], Q[6], V[6];
    pw_statistics cost, Cost;
    agree_length = 1;
    pw_system *s = scene_system (&agree_swing_table, NULL);
    agree_length = 1024;
    pw_system *S = scene_system (&agree_swing_table, NULL);
    runs_state (s, method[i], &settings, 1, q, v, &cost);
    runs_state (S, method[i], &settings, 1, Q, V, &Cost);
    check_close ("angle", Q[2], q[2], 1e-4, "1e4 rtol");
    check_close ("steps", (double)Cost.steps, (double)cost.steps, 0.1 * (double)cost.steps, "the same to 10 %");
    pw_system_free (s);
    pw_system_free (S);
  }
}
