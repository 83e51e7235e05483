/* The null-space method: velocity constraints satisfied to round-off, order of the integrator, independence of the
 * basis. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "ladder.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

#define DRIFT "nullspace:positions=drift"

TEST (order) {
  static const struct {
    const char *model;
    double h, t;
    ladder_depth depth; /* without multipliers where the motion is prescribed */
  } scene[] = { { "ezyroller", 0.04, 4, LADDER_LAMBDA }, { "n-trailer", 0.04, 2, LADDER_LAMBDA },
                { "pendulum", 0.01, 1, LADDER_LAMBDA },  { "n-four-bar", 0.01, 0.4, LADDER_LAMBDA },
                { "arm", 0.01, 1, LADDER_LAMBDA },       { "tractor", 0.04, 2, LADDER_V } };
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    ladder_expect (scene[i].model, "rk4+nullspace", scene[i].h, scene[i].t, 4, 0.35, scene[i].depth);
    ladder_expect (scene[i].model, "rk4+" DRIFT, scene[i].h, scene[i].t, 4, 0.35, scene[i].depth);
  }
  ladder_expect ("ezyroller", "erk5+nullspace:steps=fixed", 0.03, 10, 5, 0.45, LADDER_Q);
  ladder_expect ("ezyroller", "erk8+nullspace:steps=fixed", 0.2, 10, 8, 1, LADDER_Q);
}

/* Velocities satisfy every row to round-off at any step size; positions are projected, or drift with the order of
 * the method. */
TEST (residuals) {
  static const char *const model[] = {
    "ezyroller", "n-trailer", "pendulum", "arm", "tractor", "redundant-parallelogram", "andrews-squeezer"
  };
  for (size_t i = 0; i < sizeof model / sizeof *model; i++) {
    double h = strcmp (model[i], "andrews-squeezer") == 0 ? 1e-5 : 0.02, t = 10 * h;
    ladder_error drift = ladder_run (model[i], "rk4+" DRIFT, h, t);
    ladder_error closed = ladder_run (model[i], "rk4+nullspace", h, t);
    check_below (model[i], drift.cost.velocity, 32 * CHECK_EPS, "round-off");
    check_below (model[i], closed.cost.velocity, 32 * CHECK_EPS, "round-off");
    check_below (model[i], closed.cost.position, 32 * CHECK_EPS, "round-off of the projection");
  }
  double coarse = ladder_run ("ezyroller", "rk4+" DRIFT, 0.02, 4).cost.position;
  double fine = ladder_run ("ezyroller", "rk4+" DRIFT, 0.01, 4).cost.position;
  check_close ("drift at h = 0.02 over that at h = 0.01", log2 (coarse / fine), 4, 0.2, "order 4");
  assert_true (fine > 1e3 * CHECK_EPS);
}

TEST (tolerances) {
  static const char *const method[] = { "erk5+nullspace", "erk8+nullspace", "erk5+" DRIFT, "erk8+" DRIFT };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++)
    for (int k = 5; k <= 11; k += 3) {
      double rtol = pow (10, -k), q[2][6], v[2][6];
      pw_system *s = ladder_open ("ezyroller");
      runs_state (s, method[i], &(pw_settings){ .rtol = rtol, .span = 10 }, 10, q[0], v[0], NULL);
      runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-13, .span = 10 }, 10, q[1], v[1], NULL);
      for (int j = 0; j < 6; j++) check_close (method[i], q[0][j], q[1][j], 100 * rtol, "100 rtol");
      pw_system_free (s);
    }
}

/* The energy balances, including the work of drives and the energy added by projections; the ledger does not change
 * the run. */
TEST (ledger) {
  double q[2][6], v[2][6];
  for (int ledger = 0; ledger < 2; ledger++) {
    pw_system *s = ladder_open ("arm");
    pw_run *r = runs_open (s, "rk4+nullspace", &(pw_settings){ .step = 2e-3, .span = 1, .ledger = ledger });
    pw_sample x = runs_to (r, 0.9991);
    if (ledger) check_close ("balance", x.balance, 0, 40 * pow (2e-3 * 10, 4), "40 J (10/s h)^4");
    check_below ("sample's residuals", x.position + x.velocity, 64 * CHECK_EPS, "round-off");
    memcpy (q[ledger], x.q, sizeof q[0]);
    memcpy (v[ledger], x.v, sizeof v[0]);
    pw_run_close (r);
    pw_system_free (s);
  }
  check_bits ("positions without ledger", q[0], q[1], 6);
  check_bits ("velocities without ledger", v[0], v[1], 6);
}

/* ---- Refused scenes ---- */

SCENE (nullspace_chain) {
  static char body[200][8], pin[200][8];
  for (int i = 0; i < 129; i++) {
    snprintf (body[i], sizeof body[i], "b%d", i);
    snprintf (pin[i], sizeof pin[i], "p%d", i);
    pw_add_body (m, &(pw_body){ .name = body[i], .mass = 1, .inertia = 0.1, .start = { i, 0, 0 } });
    pw_add_pin (m, &(pw_pin){ .name = pin[i],
                              .body = { i ? body[i - 1] : "ground", body[i] },
                              .at = { { i ? 0.5 : -0.5, 0 }, { -0.5, 0 } } });
  }
}

TEST (refused) {
  pw_error error = { 0 };
  pw_system *s = scene_system (&nullspace_chain_table, NULL);
  assert_null (pw_run_open (s, "erk5+nullspace", NULL, &error));
  check_error (
      &error, PW_INPUT,
      "model scene: stabilisation nullspace works with dense matrices, for up to 256 constraint rows, and this "
      "scene has 258; use erk5+projection");
  pw_system_free (s);
}

/* A step over which the null space turns too far fails with a message. */
TEST (large_step) {
  pw_error error = { 0 };
  pw_system *s = ladder_open ("pendulum");
  pw_run *r = runs_open (s, "rk4+nullspace", &(pw_settings){ .step = 3, .span = 100 });
  int status = pw_run_advance_to (r, 100, 100, &error);
  assert_int_equal (status, PW_METHOD);
  assert_non_null (strstr (error.text, "the step of 3 s is too large"));
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- Massless coordinates and welded bodies ---- */

/* A cart on a wheel with an arm and a spring at its tip; the arm in one piece, or in two welded pieces with the
 * spring at a massless bracket pinned twice to the second. */
static void nullspace_cart (pw_model *m, int parts) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = 2, .inertia = 0.3, .rate = { 1, 0, 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "wheel", .body = "cart", .at = { -0.4, 0 } });
  pw_add_body (m, &(pw_body){ .name = "arm",
                              .mass = parts ? 0.3 : 1,
                              .inertia = parts ? 0.02 : 0.06,
                              .start = { 0.8, 0, 0 },
                              .rate = { 1, 1.5, 3 } });
  pw_add_pin (m, &(pw_pin){ .name = "joint", .body = { "cart", "arm" }, .at = { { 0.3, 0 }, { -0.5, 0 } } });
  pw_add_torque (m, &(pw_torque){ .name = "motor",
                                  .body = { "arm", "cart" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.8, .omega = 3 } } });
  const char *holder = parts ? "bracket" : "arm";
  pw_add_spring (m, &(pw_spring){ .name = "spring",
                                  .body = { "ground", holder },
                                  .at = { { 0, 2 }, { 0.5, 0 } },
                                  .stiffness = 8,
                                  .length = 1 });
  if (!parts) return;
  pw_add_body (
      m, &(pw_body){ .name = "rest", .mass = 0.7, .inertia = 0.04, .start = { 0.8, 0, 0 }, .rate = { 1, 1.5, 3 } });
  pw_add_weld (m, &(pw_weld){ .name = "weld", .body = { "arm", "rest" }, .at = { { 0.2, 0.1 }, { 0.2, 0.1 } } });
  pw_add_body (m, &(pw_body){ .name = "bracket", .start = { 0.8, 0, 0 }, .rate = { 1, 1.5, 3 } });
  pw_add_pin (m, &(pw_pin){ .name = "bolt1", .body = { "rest", "bracket" }, .at = { { 0.3, 0.1 }, { 0.3, 0.1 } } });
  pw_add_pin (m, &(pw_pin){ .name = "bolt2", .body = { "rest", "bracket" }, .at = { { 0.1, -0.2 }, { 0.1, -0.2 } } });
}

SCENE (nullspace_whole) {
  nullspace_cart (m, 0);
}

SCENE (nullspace_parts) {
  nullspace_cart (m, 1);
}

TEST (parts) {
  pw_system *s = scene_system (&nullspace_whole_table, NULL), *twin = scene_system (&nullspace_parts_table, NULL);
  double q[12], v[12], Q[12], V[12];
  runs_state (s, "rk4+nullspace", &(pw_settings){ .step = 0.01, .span = 1 }, 1, q, v, NULL);
  runs_state (twin, "rk4+nullspace", &(pw_settings){ .step = 0.01, .span = 1 }, 1, Q, V, NULL);
  for (int j = 0; j < 6; j++) {
    check_close ("positions", Q[j], q[j], 1e-10, "round-off of 100 steps, magnified by small weights");
    check_close ("velocities", V[j], v[j], 1e-10, "round-off of 100 steps, magnified by small weights");
  }
  pw_system_free (s), pw_system_free (twin);
}
