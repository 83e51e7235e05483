/* The multistep methods of SUNDIALS: errors of states and multipliers proportional to tolerances, numbers of steps
 * as their orders predict, stiff scenes. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "ladder.h"
#include "method.h"
#include "scene.h"
#include "system.h"

static const struct {
  const char *model;
  double t;
} multi_scenes[] = { { "ezyroller", 5 },           { "pendulum", 1 }, { "n-four-bar", 0.4 },
                     { "andrews-squeezer", 0.01 }, { "arm", 1 },      { "tractor", 2 } };

static const char *const multi_methods[] = { "ida+index2",      "ida+si1",  "ida+ggl",       "adams+none",
                                             "adams+baumgarte", "bdf+none", "bdf+baumgarte", "bdf+projection" };

enum { SCENES = sizeof multi_scenes / sizeof *multi_scenes, METHODS = sizeof multi_methods / sizeof *multi_methods };

static ladder_error multi_error (int scene, const char *method, double rtol) {
  double t = multi_scenes[scene].t;
  return ladder_solve (multi_scenes[scene].model, method, &(pw_settings){ .rtol = rtol, .span = t }, t);
}

/* Errors are proportional to the tolerance, with all constraint types. */
TEST (tolerances) {
  for (int i = 0; i < SCENES; i++)
    for (int m = 0; m < METHODS; m++) {
      ladder_error e[2];
      for (int k = 0; k < 2; k++) {
        double rtol = k ? 1e-10 : 1e-6;
        e[k] = multi_error (i, multi_methods[m], rtol);
        check_below (check_text ("%s, %s, rtol %g: positions", multi_scenes[i].model, multi_methods[m], rtol), e[k].q,
                     3e3 * rtol, "3000 rtol: errors of some hundred steps, and their growth");
        check_below (check_text ("%s, %s, rtol %g: velocities", multi_scenes[i].model, multi_methods[m], rtol), e[k].v,
                     3e3 * rtol, "3000 rtol");
      }
      check_below (multi_methods[m], e[1].q, e[0].q / 100, "four decades of tolerance give two of error at the least");
    }
}

/* Steps grow as rtol^(-1/(order + 1)): those of Adams, of orders to 12, more slowly than those of BDF, of orders to
 * 5. */
TEST (orders) {
  static const struct {
    const char *method;
    double slowest, fastest; /* orders with equal growth */
  } of[] = {
    { "bdf+projection", 3.5, 6.5 }, { "ida+si1", 3.5, 6.5 }, { "ida+index2", 3.5, 6.5 }, { "adams+none", 6, 12 }
  };
  for (size_t m = 0; m < sizeof of / sizeof *of; m++) {
    ladder_error loose = multi_error (0, of[m].method, 1e-7), tight = multi_error (0, of[m].method, 1e-12);
    double decades = log10 ((double)tight.cost.steps / (double)loose.cost.steps), order = 5 / decades - 1;
    check_below (of[m].method, of[m].slowest, order, "a high order");
    check_below (of[m].method, order, of[m].fastest, "its highest order, and a bit for the change of orders");
  }
}

/* Constraints enforced by each form: velocities by index2, positions too by ggl and si1, to the tolerance;
 * projection to round-off. */
TEST (residuals) {
  const double rtol = 1e-8;
  for (int i = 0; i < SCENES; i++) {
    const char *model = multi_scenes[i].model;
    pw_statistics two = multi_error (i, "ida+index2", rtol).cost, one = multi_error (i, "ida+si1", rtol).cost;
    pw_statistics bdf = multi_error (i, "bdf+projection", rtol).cost;
    check_below (model, fmax (two.velocity, one.velocity), 100 * rtol, "100 rtol");
    check_below (model, one.position, 10 * rtol, "10 rtol");
    check_below (model, two.position, 1e3 * rtol, "a drift of 1000 rtol");
    check_below (model, fmax (bdf.position, bdf.velocity), 32 * CHECK_EPS, "round-off of the projection");
  }
  check_below ("si1", 5 * multi_error (0, "ida+si1", rtol).cost.position,
               multi_error (0, "ida+index2", rtol).cost.position, "index2 lets positions drift");
}

/* The multipliers of si1 are derivatives of unknowns, and as accurate as multipliers that are unknowns. */
TEST (multipliers) {
  double ratio = 0;
  int count = 0;
  for (int i = 0; i < SCENES - 1; i++) /* not the tractor's, whose motion is prescribed */
    for (int k = 6; k <= 10; k += 2, count++) {
      double rtol = pow (10, -k), si1 = multi_error (i, "ida+si1", rtol).lambda;
      ratio += log (si1 / multi_error (i, "ida+ggl", rtol).lambda);
      check_below (multi_scenes[i].model, si1, 1e4 * rtol, "1e4 rtol, of the largest multiplier");
    }
  check_below ("multipliers of si1 over those of ggl", exp (ratio / count), 2, "on the average no worse than twice");
}

/* ---- Stiff scenes ---- */

/* The EzyRoller with a steering so stiff that it creeps back at 20/s, and that perturbed velocities decay at about
 * 1e4/s. */
static pw_system *multi_steering (void) {
  pw_model *m = scene_model (&scene_ezyroller, "m2", 0.1, "I2", 0.01, NULL);
  pw_add_rotational_spring (
      m, &(pw_rotational_spring){
             .name = "column", .body = { "steer", "frame" }, .stiffness = 1e4, .damping = 500, .angle = PW_PI });
  return scene_compile (m);
}

static pw_statistics multi_cost (pw_system *s, const char *method, double t, double *q) {
  double v[20];
  pw_statistics cost;
  runs_state (s, method, &(pw_settings){ .rtol = 1e-6, .span = t }, t, q, v, &cost);
  return cost;
}

/* Explicit methods must resolve modes that have decayed; implicit ones step over them, with the same result. */
TEST (stiff) {
  static const char *const method[] = { "ida+ggl",      "ida+si1",  "ida+index2",    "radau+ggl",     "radau+index2",
                                        "radau+index3", "bdf+none", "bdf+baumgarte", "bdf+projection" };
  double exact[20], q[20];
  pw_system *s = multi_steering ();
  pw_statistics by_hand = multi_cost (s, "erk8+projection", 2, exact);
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    pw_statistics cost = multi_cost (s, method[i], 2, q);
    check_below (method[i], 10 * (double)cost.steps, (double)by_hand.steps, "ten times fewer steps");
    for (int j = 0; j < pw_system_coordinates (s); j++) check_close (method[i], q[j], exact[j], 1e-3, "1000 rtol");
  }
  pw_system_free (s);
}

/* Several steps use the same matrix; functional iteration has none. */
TEST (cost) {
  pw_statistics bdf = multi_error (0, "bdf+projection", 1e-8).cost, adams = multi_error (0, "adams+none", 1e-8).cost;
  check_below ("matrices", (double)bdf.jacobians, 0.1 * (double)bdf.steps, "one in ten steps");
  check_below ("evaluations a step", (double)bdf.rhs, 2.5 * (double)bdf.steps,
               "an exact matrix: 1.1 iterations, 1 more");
  check_below ("evaluations a step", (double)adams.rhs, 3.5 * (double)adams.steps, "2 iterations, 1 more");
  assert_int_equal (adams.jacobians, 0);
}

/* ---- Prescribed motion ---- */

/* A step over a jump of a prescribed third derivative leaves the constraints before it is projected, and the
 * accelerations at its end are those of the displaced state.  An estimate that ignores displacements leaves errors of
 * up to 850 rtol here. */
TEST (lifted) {
  for (int i = 0; i < 10; i++) {
    double q[2][3], v[2][3];
    pw_system *s = scene_named ("tests/scenes/lifted.yaml", "kink", 0.26 + 0.01 * i);
    runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-13, .span = 0.6 }, 0.6, q[0], v[0], NULL);
    runs_state (s, "bdf+projection", &(pw_settings){ .rtol = 1e-9, .span = 0.6 }, 0.6, q[1], v[1], NULL);
    for (int j = 0; j < 3; j++) {
      check_close ("position", q[1][j], q[0][j], 250e-9, "250 rtol: 150 to 200 steps, and the growth of their errors");
      check_close ("velocity", v[1][j], v[0][j], 250e-9, "250 rtol");
    }
    pw_system_free (s);
  }
}

/* ---- Options ---- */

TEST (options) {
  double all = multi_error (1, "bdf+projection", 1e-8).cost.position;
  double some = multi_error (1, "bdf+projection:every=7", 1e-8).cost.position;
  check_below ("position residual, every step", all, 32 * CHECK_EPS, "round-off");
  check_below ("position residual, each 7 steps", 100 * CHECK_EPS, some, "drift between projections");
  double soft = multi_error (1, "bdf+baumgarte:alpha=1:beta=1", 1e-8).cost.position;
  double hard = multi_error (1, "bdf+baumgarte:alpha=30:beta=30", 1e-8).cost.position;
  check_below ("position residual with alpha = 30", 5 * hard, soft, "the stronger feedback leaves less");
  ladder_error identity = multi_error (0, "bdf+projection:metric=identity", 1e-8);
  check_below ("identity metric", identity.q, 3e-5, "3000 rtol");
  check_below ("identity metric", identity.cost.position, 32 * CHECK_EPS, "round-off");
}

/* Samples inside a step, some of them near singular configurations, change nothing in the run. */
TEST (sampled) {
  static const char *const method[] = { "adams", "bdf", "bdf+projection" };
  for (int i = 0; i < 3; i++) {
    pw_error error = { 0 };
    pw_sample x;
    pw_system *s = ladder_open ("n-four-bar");
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .rtol = 1e-4, .span = 2.5 });
    for (double before = 0; pw_run_time (r) < 2.5; before = pw_run_time (r)) {
      check_ok (pw_run_advance (r, 2.5, &error), &error);
      int near = r->near_singular;
      for (int k = 1; k < 10; k++)
        check_ok (pw_run_sample (r, before + k * (pw_run_time (r) - before) / 10, &x, &error), &error);
      assert_int_equal (r->near_singular, near);
    }
    pw_run_close (r);
    pw_system_free (s);
  }
}
