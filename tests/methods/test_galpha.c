/* galpha: order 2 in positions, velocities and multipliers from the first step on; residuals; small steps; samples.
 * */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "implicit.h"
#include "ladder.h"
#include "runs.h"
#include "scene.h"
#include "system.h"

static const struct {
  const char *model;
  double h, t;
  ladder_depth depth; /* without multipliers where the motion is prescribed */
} galpha_scene[] = {
  { "ezyroller", 0.01, 2, LADDER_LAMBDA },  { "n-trailer", 0.01, 1, LADDER_LAMBDA },
  { "pendulum", 0.01, 1, LADDER_LAMBDA },   { "n-four-bar", 0.01, 0.4, LADDER_LAMBDA },
  { "arm", 0.004, 1, LADDER_LAMBDA },       { "tractor", 0.01, 1, LADDER_Q },
  { "snakeboard", 0.01, 1, LADDER_LAMBDA }, { "redundant-parallelogram", 0.01, 0.5, LADDER_LAMBDA }
};
enum { GALPHA_SCENES = sizeof galpha_scene / sizeof *galpha_scene };

TEST (order) {
  static const char *const method[] = { "galpha+index3", "galpha+ggl", "galpha+index3:rho=0", "galpha+ggl:rho=0.5" };
  for (int i = 0; i < GALPHA_SCENES; i++)
    for (int k = 0; k < 4; k++)
      ladder_expect (galpha_scene[i].model, method[k], galpha_scene[i].h, galpha_scene[i].t, 2, 0.2,
                     galpha_scene[i].depth);
  ladder_expect ("ezyroller", "galpha+ggl:rho=1", 0.01, 2, 2, 0.2, LADDER_LAMBDA);
}

/* After three steps, before the effect of the initial values has decayed. */
TEST (start) {
  static const char *const model[] = { "n-trailer", "n-four-bar", "arm", "snakeboard", "redundant-parallelogram" };
  for (int i = 0; i < 10; i++) {
    const char *method = i % 2 ? "galpha+ggl" : "galpha+index3";
    double h = 0.004, coarse = ladder_run (model[i / 2], method, h, 3 * h).lambda;
    double fine = ladder_run (model[i / 2], method, h / 4, 3 * h / 4).lambda;
    check_below (model[i / 2], fine, coarse / 10, "multipliers after 3 steps: order 2 has 1/16, order 1 has 1/4");
  }
}

/* The last step is shortened; the order is unchanged. */
TEST (cut) {
  for (int i = 0; i < 2; i++)
    for (int k = 0; k < 2; k++) {
      const char *method = i ? "galpha+ggl" : "galpha+index3", *model = k ? "n-four-bar" : "arm";
      double h = 0.004, t = 0.3 + h / 12;
      ladder_error coarse = ladder_run (model, method, h, t), fine = ladder_run (model, method, h / 4, t);
      check_below (method, fine.q, coarse.q / 10, "order 2 has 1/16");
      check_below (method, fine.v, coarse.v / 10, "order 2 has 1/16");
      check_below (method, fine.lambda, coarse.lambda / 10, "order 2 has 1/16");
    }
}

/* ---- Residuals, small steps, large steps ---- */

TEST (residuals) {
  for (int i = 0; i < GALPHA_SCENES; i++) {
    double h = galpha_scene[i].h, t = 20 * h;
    pw_statistics coarse = ladder_run (galpha_scene[i].model, "galpha+index3", h, t).cost;
    pw_statistics fine = ladder_run (galpha_scene[i].model, "galpha+index3", h / 2, t).cost;
    pw_statistics ggl = ladder_run (galpha_scene[i].model, "galpha+ggl", h, t).cost;
    check_below ("index3: position", coarse.position, 64 * CHECK_EPS, "round-off");
    check_below ("index3: velocities", fine.velocity, coarse.velocity / 3 + 64 * CHECK_EPS, "order 2 has 1/4");
    check_below ("ggl: position", ggl.position, 64 * CHECK_EPS, "round-off");
    check_below ("ggl: velocities", ggl.velocity, 1e4 * CHECK_EPS,
                 "Newton's iteration to round-off of the positions over h");
    check_below ("evaluations of a step", (double)ggl.rhs / (double)ggl.steps, 4, "Newton's iteration converges");
  }
  check_below ("nonholonomic rows alone", ladder_run ("chaplygin-sleigh", "galpha+index3", 0.01, 1).cost.velocity,
               64 * CHECK_EPS, "round-off");
}

/* Small steps impair neither the iteration nor the multipliers, except for the round-off eps L of positions in
 * index 3, an acceleration of eps L / (beta h^2). */
TEST (small_steps) {
  static const char *const model[] = { "ezyroller", "n-four-bar", "arm", "n-trailer" };
  for (int i = 0; i < 4; i++)
    for (int k = 3; k <= 5; k++) {
      double h = pow (10, -k);
      ladder_error index3 = ladder_run (model[i], "galpha+index3", h, 50 * h);
      ladder_error ggl = ladder_run (model[i], "galpha+ggl", h, 50 * h);
      check_below (model[i], index3.lambda, 100 * h * h + 100 * CHECK_EPS / (h * h), "100 (h/s)^2, 100 eps/h^2");
      check_below (model[i], ggl.lambda, 100 * h * h + 100 * CHECK_EPS / h, "100 (h/s)^2, 100 eps/h");
      check_below ("evaluations of a step", (double)index3.cost.rhs, 3 * 50 + 3, "Newton's iteration converges");
      check_below ("evaluations of a step", (double)ggl.cost.rhs, 3 * 50 + 3, "Newton's iteration converges");
    }
}

/* The condition number of Newton's matrix after some steps of size h, as estimated by KLU. */
static double galpha_condition (const char *model, const char *method, double h) {
  pw_system *s = ladder_open (model);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = h, .span = 1 });
  runs_to (r, 3 * h);
  pw_implicit *x = (pw_implicit *)r->data;
  pw_sparse *k = &x->sparse;
  klu_l_condest (k->colptr, x->dae.tangent.scatter.value, k->symbolic, k->factors, &k->common);
  double condition = k->common.condest;
  pw_run_close (r);
  pw_system_free (s);
  return condition;
}

TEST (condition) {
  static const char *const model[] = { "ezyroller", "n-four-bar", "arm" };
  for (int i = 0; i < 6; i++) {
    const char *method = i % 2 ? "galpha+ggl" : "galpha+index3";
    double coarse = galpha_condition (model[i / 2], method, 1e-3), fine = galpha_condition (model[i / 2], method, 1e-6);
    check_close (model[i / 2], log10 (fine / coarse), 0, 0.5, "the same at every step, but for the pose");
  }
}

static void galpha_stops (const char *model, const char *method, double step, const char *cause) {
  pw_error error = { 0 };
  pw_system *s = ladder_open (model);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = step, .span = 100 });
  assert_int_equal (pw_run_advance_to (r, 100, 100, &error), PW_METHOD);
  if (strstr (error.text, cause) == NULL) fail_msg ("%s", error.text);
  pw_run_close (r);
  pw_system_free (s);
}

TEST (large_steps) {
  galpha_stops ("ezyroller", "galpha+index3", 3,
                "t = 0 s: the iteration does not converge; the step of 3 s may be too large");
  galpha_stops ("ezyroller", "galpha+ggl", 3, "the step of 3 s may be too large");
  galpha_stops ("pendulum", "galpha+index3", 1, "the step of 1 s is too large: pin pivot is violated");
}

/* ---- Samples, also of leapfrog ---- */

/* Samples inside steps are as accurate as the ends of steps and satisfy the constraints; the energy balances, and
 * sampling changes nothing. */
TEST (samples) {
  static const char *const method[] = { "galpha+index3", "galpha+ggl", "leapfrog" };
  for (int i = 0; i < 3; i++) {
    double off[2] = { 0 }, force[2] = { 0 }, balance[2] = { 0 }, q[2][6];
    for (int k = 0; k < 2; k++) {
      double h = k ? 0.0025 : 0.01;
      pw_system *s = ladder_open ("arm"), *S = ladder_open ("arm");
      pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = h, .span = 1, .ledger = 1 });
      pw_run *exact = runs_open (S, "erk8+projection", &(pw_settings){ .rtol = 1e-12, .span = 1 });
      for (double t = 0.0237; t < 1; t += 0.0411) {
        pw_error error = { 0 };
        pw_sample x, y = runs_to (exact, t);
        check_ok (pw_run_advance_to (r, t, 1, &error), &error);
        check_ok (pw_run_sample (r, t, &x, &error), &error);
        check_below ("sample's position", x.position, 64 * CHECK_EPS, "round-off");
        check_below ("velocities of a sample", x.velocity, i ? 64 * CHECK_EPS : h * h * 100, "round-off; 100 (h/s)^2");
        balance[k] = fmax (balance[k], fabs (x.balance));
        for (int j = 0; j < 6; j++) off[k] = fmax (off[k], fmax (fabs (x.q[j] - y.q[j]), fabs (x.v[j] - y.v[j])));
        for (int j = 0; j < 5; j++) force[k] = fmax (force[k], fabs (x.lambda[j] - y.lambda[j]));
      }
      memcpy (q[k], runs_to (r, 1).q, sizeof q[k]);
      pw_run_close (r);
      pw_run_close (exact);
      if (k == 0) { /* without samples and ledger */
        double Q[6], v[6];
        runs_state (s, method[i], &(pw_settings){ .step = h, .span = 1 }, 1, Q, v, NULL);
        check_bits ("positions without samples", q[0], Q, 6);
      }
      pw_system_free (s);
      pw_system_free (S);
    }
    check_below ("states of samples", off[1], off[0] / 10, "order 2 has 1/16");
    check_below ("multipliers of samples", force[1], force[0] / 10, "order 2 has 1/16");
    check_below ("balance of samples", balance[1], balance[0] / 10, "order 2 has 1/16");
  }
}

/* A torque that jumps at 1/3 s: a step ends there, and the order is unchanged. */
static int galpha_switched (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = t < 1. / 3 ? 0.1 : -0.2;
  return 0;
}

static double galpha_breakpoint (void *context, double t) {
  (void)context;
  return t < 1. / 3 ? 1. / 3 : INFINITY;
}

static void galpha_switched_run (const char *method, pw_settings settings, double t, double *state, double *lambda) {
  pw_error error = { 0 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = galpha_switched, .breakpoint = galpha_breakpoint } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, method, &settings);
  pw_sample x = runs_to (r, t);
  memcpy (state, x.q, 6 * sizeof *state);
  memcpy (state + 6, x.v, 6 * sizeof *state);
  memcpy (lambda, x.lambda, 4 * sizeof *lambda);
  pw_run_close (r);
  pw_system_free (s);
}

TEST (breakpoint) {
  static const char *const method[] = { "galpha+index3", "galpha+ggl", "leapfrog" };
  double x[12], l[4];
  galpha_switched_run ("erk8+projection", (pw_settings){ .rtol = 1e-12, .span = 1 }, 0.5, x, l);
  for (int i = 0; i < 3; i++) {
    double off[2] = { 0 }, force[2] = { 0 };
    for (int k = 0; k < 2; k++) {
      double y[12], m[4];
      galpha_switched_run (method[i], (pw_settings){ .step = k ? 0.005 : 0.02, .span = 1 }, 0.5, y, m);
      for (int j = 0; j < 12; j++) off[k] = fmax (off[k], fabs (y[j] - x[j]));
      for (int j = 0; j < 4; j++) force[k] = fmax (force[k], fabs (m[j] - l[j]));
    }
    check_below ("states", off[1], off[0] / 10, "order 2 has 1/16");
    check_below ("multipliers", force[1], force[0] / 10, "order 2 has 1/16");
  }
}

/* A pendulum whose torque jumps: the multipliers have order 2 from the first step after the jump on. */
SCENE (galpha_pushed) {
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 0.5, .start = { 0.5 } });
  pw_add_pin (m, &(pw_pin){ .name = "pivot", .body = { "arm", "ground" }, .at = { { -0.5, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  pw_add_torque (m, &(pw_torque){ .name = "push",
                                  .body = { "arm", "ground" },
                                  .value = { PW_PULSE, .pulse = { .height = 3, .start = 1. / 3 } } });
}

TEST (restart) {
  pw_system *s = scene_system (&galpha_pushed_table, NULL);
  for (int i = 0; i < 2; i++) {
    const char *method = i ? "galpha+ggl" : "galpha+index3";
    double off[2] = { 0 };
    for (int k = 0; k < 2; k++) {
      double h = k ? 0.0025 : 0.01, t = 1. / 3 + 3 * h;
      pw_run *r = runs_open (s, method, &(pw_settings){ .step = h, .span = 1 });
      pw_run *exact = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 1e-12, .span = 1 });
      pw_sample x = runs_to (r, t), y = runs_to (exact, t);
      for (int j = 0; j < 2; j++) off[k] = fmax (off[k], fabs (x.lambda[j] - y.lambda[j]));
      pw_run_close (r), pw_run_close (exact);
    }
    check_below (method, off[1], off[0] / 10, "order 2 has 1/16, order 1 has 1/4");
  }
  pw_system_free (s);
}

/* ---- Damping ---- */

SCENE (galpha_stiff) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 1, .start = { 0, 0, 0.01 } });
  pw_add_rotational_spring (m, &(pw_rotational_spring){ .name = "k", .body = { "rotor", "ground" }, .stiffness = 1e8 });
}

/* A vibration of 1e4 rad/s at a step of 0.01 s is reduced to about rho by each step; with rho = 1 it is not damped.
 * */
TEST (damping) {
  static const double rho[] = { 0.2, 0.6, 1 };
  pw_system *s = scene_system (&galpha_stiff_table, NULL);
  for (int i = 0; i < 3; i++) {
    char method[40];
    snprintf (method, sizeof method, "galpha:rho=%g", rho[i]);
    pw_run *r = runs_open (s, method, &(pw_settings){ .step = 0.01, .span = 1 });
    double energy[2];
    for (int k = 0; k < 2; k++) {
      pw_sample x = runs_to (r, k ? 0.3 : 0.1);
      energy[k] = x.kinetic + x.potential;
    }
    if (rho[i] < 1) check_below (method, energy[1], energy[0] * pow (rho[i], 20), "rho^2 in energy, of 20 steps one");
    if (rho[i] == 1) check_close (method, energy[1] / energy[0], 1, 0.1, "no damping");
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* ---- A vibration of 1000 times the frequency that the step resolves ---- */

SCENE (galpha_fast) {
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 1, .start = { 0, 0, 1e-3 } });
  pw_add_rotational_spring (m, &(pw_rotational_spring){ .name = "k", .body = { "arm", "ground" }, .stiffness = 1e10 });
}

/* It never exceeds its initial size, and in the end each step reduces it to rho. */
TEST (no_overshoot) {
  static const char *const method[] = { "galpha+ggl:rho=0.3", "galpha+ggl:rho=0.5", "galpha+index3:rho=0.8",
                                        "galpha+ggl:rho=1" };
  static const double rho[] = { 0.3, 0.5, 0.8, 1 };
  for (int i = 0; i < 4; i++) {
    pw_system *s = scene_system (&galpha_fast_table, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 0.01, .span = 1 });
    double before = 0, most = 0;
    for (int k = 1; k <= 60; k++) {
      double phi = fabs (runs_to (r, 0.01 * k).q[2]);
      most = fmax (most, phi);
      if (k == 40) before = phi;
      if (k == 60 && rho[i] < 0.8)
        check_close ("left by a step", pow (phi / before, 1. / 20), rho[i], 0.05 * rho[i],
                     "a double root: a power of k besides");
    }
    check_below (method[i], most, 1e-3 * (1 + 1e-9), "as it starts");
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* ---- A step that fails once ---- */

static int failing_now;

static int failing_torque (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = failing_now && t > 0.1002 ? NAN : 10 * sin (10 * t);
  return 0;
}

static void failing_build (pw_model *m, const void *parameters) {
  (void)parameters;
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add_pin (m, &(pw_pin){ .name = "hub", .body = { "disc", "ground" } });
  pw_torque torque = { .name = "torque", .body = { "disc", "ground" } };
  torque.value = (pw_signal){ .type = PW_FUNCTION, .function = { .eval = failing_torque } };
  pw_add_torque (m, &torque);
}

/* The next step, of another size, does not begin with what the failed one has computed. */
TEST (failing) {
  static const pw_parameter none[] = { { .name = NULL } };
  static const pw_plugin_table table = SCENE_TABLE_WITH (failing_build, none, 0);
  double phi[2];
  for (int fails = 0; fails < 2; fails++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&table, NULL);
    pw_run *r = runs_open (s, "galpha+ggl", &(pw_settings){ .step = 0.01, .span = 1 });
    check_ok (pw_run_advance_to (r, 0.1, 1, &error), &error);
    failing_now = fails;
    if (fails) assert_int_equal (pw_run_advance (r, 0.1003, &error), PW_METHOD);
    failing_now = 0, error.status = PW_OK;
    phi[fails] = runs_to (r, 0.2).q[2];
    pw_run_close (r);
    pw_system_free (s);
  }
  check_close ("angle", phi[1], phi[0], 1e-6, "h^3: that of a new initialisation");
}
