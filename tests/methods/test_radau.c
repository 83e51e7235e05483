/* radau: orders of its three forms, published digits, breakpoints, stiff scenes, samples, matrices. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "ladder.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

/* ---- Orders ---- */

static const struct {
  const char *model;
  double h, t;
  ladder_depth depth; /* without multipliers where they depend only on prescribed motions */
} radau_scene[] = { { "ezyroller", 0.1, 2, LADDER_LAMBDA },
                    { "n-trailer", 0.1, 1, LADDER_LAMBDA },
                    { "pendulum", 0.05, 1, LADDER_LAMBDA },
                    { "n-four-bar", 0.05, 0.4, LADDER_LAMBDA },
                    { "arm", 0.05, 1, LADDER_LAMBDA },
                    { "tractor", 0.1, 1, LADDER_V },
                    { "snakeboard", 0.1, 1, LADDER_LAMBDA },
                    { "redundant-parallelogram", 0.05, 0.5, LADDER_LAMBDA },
                    { "chaplygin-sleigh", 0.4, 4, LADDER_LAMBDA } };
enum { RADAU_SCENES = sizeof radau_scene / sizeof *radau_scene };

/* Order 5 of positions and velocities in index 2 (Hairer, Lubich & Roche 1989: 2 s - 1 with s = 3 stages); multipliers
 * are computed from these. */
TEST (order) {
  for (int i = 0; i < RADAU_SCENES; i++) {
    ladder_expect (radau_scene[i].model, "radau+ggl:steps=fixed", radau_scene[i].h, radau_scene[i].t, 5, 0.5,
                   radau_scene[i].depth);
    ladder_expect (radau_scene[i].model, "radau+index2:steps=fixed", radau_scene[i].h, radau_scene[i].t, 5, 0.5,
                   radau_scene[i].depth);
  }
}

/* Index 3: positions 2 s - 1 = 5, velocities s = 3, and so the multipliers computed from both; without holonomic
 * constraints it is index 2. */
TEST (order_index3) {
  for (int i = 0; i < RADAU_SCENES; i++) {
    const char *model = radau_scene[i].model, *method = "radau+index3:steps=fixed";
    int second = strcmp (model, "tractor") == 0 || strcmp (model, "chaplygin-sleigh") == 0;
    double h = radau_scene[i].h, t = radau_scene[i].t;
    if (second) {
      ladder_expect (model, method, h, t, 5, 0.5, LADDER_V);
      continue;
    }
    ladder_error first = ladder_run (model, method, h, t), coarse = ladder_run (model, method, h / 2, t),
                 fine = ladder_run (model, method, h / 4, t);
    check_below (model, fine.q, first.q / pow (4, 4.5), "positions: order 5 has 4^-5, order 4 has 4^-4");
    check_close (model, log2 (coarse.v / fine.v), 3, 0.3, "velocities: the order 3, and the next power of h");
    check_below (model, fine.lambda, first.lambda / pow (4, 2.5), "multipliers: order 3 has 4^-3, order 2 has 4^-2");
    check_below (model, fine.cost.position, 64 * CHECK_EPS, "positions enforced to round-off");
  }
}

/* With step-size control: small steps after a turn correct positions that Newton's iteration has left within its
 * tolerance, by velocities of that size over the step. */
TEST (small_steps_index3) {
  double q[2][3 * 8], v[3 * 8];
  pw_system *s = ladder_open ("n-four-bar");
  int n = pw_system_coordinates (s);
  assert_true (n <= 3 * 8);
  runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-12, .span = 1 }, 1, q[0], v, NULL);
  runs_state (s, "radau+index3", &(pw_settings){ .rtol = 1e-8, .span = 1 }, 1, q[1], v, NULL);
  for (int j = 0; j < n; j++) check_close ("n-four-bar", q[1][j], q[0][j], 1e-4, "1e4 rtol");
  pw_system_free (s);
}

/* Near a singular configuration Newton's iteration ends in round-off that exceeds the tolerance of its corrections. */
TEST (magnified_round_off) {
  double q[2][3 * 8], v[3 * 8];
  pw_system *s = ladder_open ("n-four-bar");
  runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-12, .span = 1 }, 1, q[0], v, NULL);
  runs_state (s, "radau", &(pw_settings){ .rtol = 1e-11, .span = 1 }, 1, q[1], v, NULL);
  for (int j = 0; j < pw_system_coordinates (s); j++) check_close ("n-four-bar", q[1][j], q[0][j], 1e-8, "1e3 rtol");
  pw_system_free (s);
}

/* Of a distance of 1e4 L, which the small coordinates of a pendulum there contain, too. */
SCENE (radau_build_distant) {
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 1, .inertia = 0.1, .start = { 1e4, 0, 0 }, .rate = { 0, 3, 3 } });
  pw_add_pin (m, &(pw_pin){ .name = "pivot", .body = { "rod", "ground" }, .at = { { -1, 0 }, { 1e4 - 1, 0 } } });
}

TEST (distant) {
  static const char *const method[] = { "radau:steps=fixed", "radau+index3:steps=fixed" };
  for (int i = 0; i < 2; i++) {
    pw_system *s = scene_system (&radau_build_distant_table, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-2, .span = 1 });
    check_close (method[i], runs_to (r, 1).q[2], 3, 1e-9, "the angle has a round-off of 1e4 eps");
    runs_close (r, s);
  }
}

/* Velocities have the round-off of positions over h, 3e-13 m/s, which must not add up in 3200 steps. */
TEST (round_off_index3) {
  check_below ("roller-racer", ladder_run ("roller-racer", "radau+index3:steps=fixed", 6.25e-4, 2).q, 3e-11,
               "100 times the round-off of velocities, over 2 s");
}

/* Constraints enforced by each form. */
TEST (residuals) {
  for (int i = 0; i < RADAU_SCENES; i++) {
    const char *model = radau_scene[i].model;
    double h = radau_scene[i].h / 4, t = radau_scene[i].t;
    pw_statistics ggl = ladder_run (model, "radau+ggl:steps=fixed", h, t).cost;
    pw_statistics index2 = ladder_run (model, "radau+index2:steps=fixed", h, t).cost;
    check_below (model, ggl.position, 64 * CHECK_EPS, "round-off");
    check_below (model, fmax (ggl.velocity, index2.velocity), 1e3 * CHECK_EPS, "round-off of the iteration");
    double drift = ladder_run (model, "radau+index2:steps=fixed", h / 2, t).cost.position;
    check_below (model, drift, index2.position / 16 + 64 * CHECK_EPS, "a drift of order 5 has 1/32");
  }
}

/* ---- Tolerances ---- */

static const char *const radau_forms[] = { "radau+ggl", "radau+index2", "radau+index3" };

TEST (digits) {
  static const char *const name[] = { "K1.phi", "K3.phi", "K5.phi", "K7.phi" };
  static const double digits[] = { 15.8107711951537, 0.0408222401196458, 0.524409965879954, 1.04808074104194 };
  double table[4 * 6], q[6], v[6];
  assert_int_equal (runs_reference ("tests/reference/ezyroller.txt", 4, 6, table), 4);
  const double *x = table + 3 * 6;
  for (int i = 0; i < 3; i++) {
    pw_system *s = scene_system (&scene_ezyroller, NULL);
    runs_state (s, radau_forms[i], &(pw_settings){ .rtol = 1e-10, .span = 10 }, 10, q, v, NULL);
    double off[] = { q[0] - x[1], q[1] - x[2], q[2] - x[3], q[5] - x[4] };
    for (int j = 0; j < 4; j++) check_close (radau_forms[i], off[j], 0, 1e3 * 1e-10, "1e3 rtol");
    pw_system_free (s);
    s = ladder_open ("andrews-squeezer");
    pw_run *r = runs_open (s, radau_forms[i], &(pw_settings){ .rtol = 1e-10, .span = 0.03 });
    pw_sample end = runs_to (r, 0.03);
    for (int j = 0; j < 4; j++)
      check_close (name[j], trial_state (s, &end, name[j]), digits[j], 1e4 * 1e-10, "1e4 rtol");
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* Errors are proportional to the tolerance, and matrices are factorised no more often than they change. */
TEST (tolerances) {
  static const char *const model[] = { "ezyroller", "pendulum", "arm", "snakeboard" };
  for (int i = 0; i < 4; i++)
    for (int k = 0; k < 3; k++)
      for (int digits = 4; digits <= 10; digits += 3) {
        double rtol = pow (10, -digits);
        ladder_error e = ladder_solve (model[i], radau_forms[k], &(pw_settings){ .rtol = rtol, .span = 2 }, 2);
        pw_statistics n = e.cost;
        check_below (model[i], e.q, 1e3 * rtol, "1e3 rtol");
        if (k < 2) check_below (model[i], e.v, 1e3 * rtol, "1e3 rtol");
        check_below ("factorisations", (double)n.factorisations, 2.0 * (double)(n.steps + n.rejected + n.jacobians),
                     "a real and a complex one for a step size, and for a Jacobian");
        check_below ("Jacobians", (double)n.jacobians, (double)(n.steps + n.rejected) + 1, "one for a step");
        check_below ("evaluations of a step", (double)n.rhs, 21.0 * (double)(n.steps + n.rejected),
                     "seven iterations at most, of three stages each");
      }
}

/* The controller predicts the error of a step from the two before it (Gustafsson 1994): few steps are rejected where
 * the motion repeats. */
TEST (step_sizes) {
  static const char *const model[] = { "pendulum", "wheeled-snake" };
  for (int i = 0; i < 2; i++) {
    pw_statistics n = ladder_solve (model[i], "radau+ggl", &(pw_settings){ .rtol = 1e-4, .span = 5 }, 5).cost;
    check_below (model[i], (double)n.rejected, (double)n.steps / 10, "one step in ten");
  }
}

/* ---- Breakpoints ---- */

static int radau_switched (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = t < 1. / 3 ? 0.1 : -0.2;
  return 0;
}

static double radau_breakpoint (void *context, double t) {
  (void)context;
  return t < 1. / 3 ? 1. / 3 : INFINITY;
}

static void radau_switched_run (const char *method, pw_settings settings, double *x) {
  pw_error error = { 0 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = radau_switched, .breakpoint = radau_breakpoint } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  pw_system *s = scene_compile (m);
  runs_state (s, method, &settings, 1. / 3 + 0.3, x, x + 6, NULL);
  pw_system_free (s);
}

/* Steps end where the torque jumps; the order is unchanged after it. */
TEST (switched) {
  double exact[12], x[12], off[2] = { 0 };
  radau_switched_run ("erk8+projection", (pw_settings){ .rtol = 1e-13, .span = 1 }, exact);
  for (int k = 0; k < 2; k++) {
    radau_switched_run ("radau:steps=fixed", (pw_settings){ .step = k ? 0.05 : 0.1, .span = 1 }, x);
    for (int j = 0; j < 12; j++) off[k] = fmax (off[k], fabs (x[j] - exact[j]));
  }
  check_below ("error at h = 0.05", off[1], off[0] / 20, "order 5 has 1/32, a step across the switch 1/2");
  check_below ("error at h = 0.1", off[0], 1e-5, "h^5");
}

/* ---- Stiff scenes ---- */

SCENE (radau_stiff) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 1, .start = { 0, 0, 0.01 } });
  pw_add_rotational_spring (m, &(pw_rotational_spring){ .name = "k", .body = { "rotor", "ground" }, .stiffness = 1e8 });
}

/* A vibration of 1e4 rad/s at a step of 0.01 s: y = 100, of which a step leaves |R (i y)| -> 3 / y. */
TEST (damping) {
  pw_system *s = scene_system (&radau_stiff_table, NULL);
  pw_run *r = runs_open (s, "radau:steps=fixed", &(pw_settings){ .step = 0.01, .span = 1 });
  double phi = runs_to (r, 0.04).q[2];
  check_below ("angle after four steps", fabs (phi), 0.01 * pow (6. / 100, 4), "twice 3 / y in each step");
  pw_run_close (r);
  pw_system_free (s);
}

/* Samples stay between the values at the ends of steps that do not resolve a decay of 1e8 /s. */
SCENE (radau_brake) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1, .rate = { 0, 0, 1 } });
  pw_add_friction (m, &(pw_friction){ .name = "f", .body = { "disc", "ground" }, .viscous = 1e8 });
}

TEST (unresolved_samples) {
  static const char *const method[] = { "radau", "radau:steps=fixed" };
  for (int i = 0; i < 2; i++) {
    pw_system *s = scene_system (&radau_brake_table, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 0.01, .span = 1 });
    for (int k = 1; k <= 200; k++) {
      pw_error error = { 0 };
      pw_sample x;
      check_ok (pw_run_advance_to (r, 0.0005 * k, 0.1, &error), &error);
      check_ok (pw_run_sample (r, 0.0005 * k, &x, &error), &error);
      check_close ("angle", x.q[2], 0, 0.01, "1 rad/s for the first step of 0.01 s");
      check_close ("angular velocity", x.v[2], 0, 1, "not above the initial one");
    }
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* A block pulled by slightly more than dry friction, smoothed over 1e-8 m/s, begins to slide at the right time:
 * while it rests, corrections are small because of an inaccurate matrix, not of a small residual. */
static double radau_pulled (double pull, double rtol) {
  pw_system *s = gallery_open ("benchmarks/hard/models/sliding-block.yaml", "v0", 0., "pull", pull, NULL);
  double q[3], v[3];
  runs_state (s, "radau", &(pw_settings){ .rtol = rtol, .span = 6 }, 6, q, v, NULL);
  pw_system_free (s);
  return q[0];
}

TEST (pulled) {
  static const double pull[] = { 1.001, 1.1, 1.3 };
  for (int i = 0; i < 3; i++) {
    double exact = radau_pulled (pull[i], 1e-9);
    for (int digits = 5; digits <= 7; digits++)
      check_close ("position", radau_pulled (pull[i], pow (10, -digits)), exact, 10 * pow (10, -digits), "10 rtol");
  }
}

/* ---- Samples ---- */

/* The largest error of states and energy balance at times inside steps of the arm. */
static void radau_sampled (const char *method, double h, double *q, double *v, double *lambda, double *balance) {
  pw_system *s = ladder_open ("arm"), *S = ladder_open ("arm");
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = h, .span = 1, .ledger = 1 });
  pw_run *exact = runs_open (S, "erk8+projection", &(pw_settings){ .rtol = 1e-13, .span = 1 });
  *q = *v = *lambda = *balance = 0;
  for (double t = 0.0237; t < 1; t += 0.0411) {
    pw_error error = { 0 };
    pw_sample x, y = runs_to (exact, t);
    check_ok (pw_run_advance_to (r, t, 1, &error), &error);
    check_ok (pw_run_sample (r, t, &x, &error), &error);
    for (int j = 0; j < 6; j++) *q = fmax (*q, fabs (x.q[j] - y.q[j])), *v = fmax (*v, fabs (x.v[j] - y.v[j]));
    for (int i = 0; i < 5; i++) *lambda = fmax (*lambda, fabs (x.lambda[i] - y.lambda[i]));
    *balance = fmax (*balance, fabs (x.balance));
    int enforced = strstr (method, "index2") == NULL;
    if (enforced) check_below ("position of a sample", x.position, 64 * CHECK_EPS, "projected: round-off");
  }
  pw_run_close (r);
  pw_run_close (exact);
  pw_system_free (s);
  pw_system_free (S);
}

/* Samples inside steps are as accurate as ends of steps; work is integrated with an error of order h^4. */
TEST (samples) {
  static const char *const method[] = { "radau+ggl:steps=fixed", "radau+index2:steps=fixed" };
  for (int i = 0; i < 2; i++) {
    double q[2], v[2], lambda[2], balance[2];
    for (int k = 0; k < 2; k++) radau_sampled (method[i], k ? 0.0125 : 0.05, &q[k], &v[k], &lambda[k], &balance[k]);
    check_below ("positions of samples", q[1], q[0] / pow (4, 4.5), "order 5 has 4^-5, that of the stages 4^-4");
    check_below ("velocities of samples", v[1], v[0] / pow (4, 4.5), "order 5 has 4^-5, that of the stages 4^-4");
    check_below ("multipliers of samples", lambda[1], lambda[0] / pow (4, 4.5), "computed from these");
    check_below ("balance of samples", balance[1], balance[0] / pow (4, 3.5), "order 4 has 4^-4");
  }
}

/* In index3 the multipliers of the stages have errors of about sqrt (rtol), but not the work of drives. */
TEST (work_index3) {
  pw_system *s = ladder_open ("snakeboard");
  pw_run *r = runs_open (s, "radau+index3", &(pw_settings){ .rtol = 1e-7, .span = 1, .ledger = 1, .max_steps = 1000 });
  check_close ("balance", runs_to (r, 1).balance, 0, 1e-7, "rtol x 1 J");
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- Large steps ---- */

TEST (large_steps) {
  pw_error error = { 0 };
  pw_system *s = ladder_open ("pendulum");
  pw_run *r = runs_open (s, "radau:steps=fixed", &(pw_settings){ .step = 3, .span = 100 });
  assert_int_equal (pw_run_advance_to (r, 100, 100, &error), PW_METHOD);
  check_error (&error, PW_METHOD, "t = 0 s: the iteration does not converge; the step of 3 s may be too large");
  pw_run_close (r);
  pw_system_free (s);
}
