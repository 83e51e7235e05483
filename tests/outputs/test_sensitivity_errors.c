/* `pinwheel sensitivity`: steps of differences, and errors, those of the run included. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* A parameter that is small compared with what it is added to, in a force or a length, and one over whose usual step
 * the force is not linear: other steps are found, and the error contains what remains. */
TEST (steps) {
  static const char *const value[] = { "1e-6", "1e-8", "1e-10", "1e-12" }, *const place[] = { "1e3", "1e4", "1e5" };
  char command[300];
  double x, error, expected = 0;
  cli_write ("small.yaml",
             "pinwheel: 1\nrun: {t_end: 2, method: erk8, rtol: 1e-11}\n"
             "parameters: [{name: p, value: 0}, {name: dl, value: 0, unit: m}]\n"
             "bodies: [{name: b, mass: 1, inertia: 1}, {name: c, mass: 1, inertia: 0.1, start: {x: 1 + dl}}]\n"
             "elements:\n  - {torque: T, body: [b, ground], value: {expression: 100*sin(3*t) + p}}\n"
             "  - {pin: P, body: [ground, c], at: [[0, 0], [-1 - dl, 0]]}\n"
             "  - {gravity: G, acceleration: [0, -9.81]}\n");
  for (int dl = 0; dl < 2; dl++)
    for (int i = -1; i < 4; i++) {
      snprintf (command, sizeof command,
                "pinwheel sensitivity @/small.yaml --of %s --by %s --set %s=%s -o @/sens/sensitivity.csv --json "
                "@/sens/sensitivity.json --plots @/sens",
                dl ? "c.phi" : "b.omega", dl ? "dl" : "p", dl ? "dl" : "p", i < 0 ? "0" : value[i]);
      cli_shell (command);
      cli_sensitivity ("derivative", &x);
      cli_sensitivity ("error", &error);
      if (i < 0) expected = dl ? x : 2;
      check_close (command, x, expected, 1e-6 * fabs (expected), "differences accurate to 1e-7, over 2 s");
      check_close ("within its error", x, expected, error + 1e-8, "the claim");
    }
  for (int i = 0; i < 3; i++) {
    cli_write (
        "large.yaml",
        check_text ("pinwheel: 1\nrun: {t_end: 2, method: erk8, rtol: 1e-11}\nparameters: [{name: x0, value: %s}]\n"
                    "bodies: [{name: b, mass: 1, inertia: 1, start: {x: %s}}]\n"
                    "elements:\n  - {force: F, body: b, fx: '-sin(20*(b.x - x0))'}\n",
                    place[i], place[i]));
    cli_shell ("pinwheel sensitivity @/large.yaml --of b.x --by x0 -o @/sens/sensitivity.csv --json "
               "@/sens/sensitivity.json --plots @/sens");
    cli_sensitivity ("derivative", &x);
    cli_sensitivity ("error", &error);
    check_close (place[i], x, 1 - cos (2 * sqrt (20)), error, "a linear oscillation near x0");
    check_below (place[i], error, 1e-2, "round-off of x0 over a step of 1e-2 m, in which the force is linear");
  }
}

/* A mass on which initial velocities depend by round-off only, which no longer step would show better; a parameter
 * without effect on a stiff motion, whose error must not grow. */
TEST (no_effect) {
  double x[2], error[2];
  cli_write ("mass.yaml",
             "pinwheel: 1\nrun: {t_end: 0.3, method: erk8, rtol: 1e-9}\nparameters: [{name: m, value: 1}]\n"
             "bodies: [{name: A, mass: m, inertia: 0.1, start: {phi: 0.5}, rate: {omega: 1}}]\n"
             "elements:\n  - {pin: a, body: [ground, A], at: [[0, 0], [-0.4, 0]]}\n"
             "  - {gravity: g, acceleration: [0, -9.81]}\n");
  cli_shell ("pinwheel sensitivity @/mass.yaml --of A.phi --by m -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  assert_int_equal (cli_sensitivity ("derivative", x), 1);
  check_close ("mass", x[0], -0.239878189, 1e-8, "differences of DOP853 in another program");
  cli_write ("none.yaml", "pinwheel: 1\nrun: {t_end: 2, method: erk8, rtol: 1e-9}\nparameters: [{name: p, value: 3}]\n"
                          "bodies: [{name: B, mass: 1, inertia: 0.1, rate: {vx: 1}}]\n"
                          "elements:\n  - {force: F, body: B, fx: '-1e6*(B.x - t) - 1e3*(B.vx - 1)', fy: '0*p'}\n");
  cli_shell ("pinwheel sensitivity @/none.yaml --of B.x --of B.y --by p -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  assert_int_equal (cli_sensitivity ("derivative", x), 2);
  assert_int_equal (cli_sensitivity ("error", error), 2);
  for (int i = 0; i < 2; i++) assert_true (x[i] == 0);
  check_below ("error", error[0], 1e-12, "round-off of 2 m over steps of 0.03");
  assert_true (error[1] == 0);
}

/* A fast or heavy body whose energy does not depend on the parameter. */
TEST (energies) {
  double x[2];
  cli_write ("energy.yaml",
             "pinwheel: 1\nrun: {t_end: 2, method: erk8, rtol: 1e-11}\nparameters: [{name: F, value: 0.001, unit: N}]\n"
             "bodies:\n  - {name: heavy, mass: 1e5, inertia: 1, start: {y: 100}, rate: {vx: 100}}\n"
             "  - {name: light, mass: 1, inertia: 1, rate: {vx: 0.01}}\n"
             "elements:\n  - {force: T, body: light, fy: F}\n  - {gravity: g, acceleration: [0, -9.81]}\n");
  cli_shell ("pinwheel sensitivity @/energy.yaml --of kinetic --of potential --by F -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  assert_int_equal (cli_sensitivity ("derivative", x), 2);
  check_close ("kinetic", x[0], (0.001 - 9.81) * 4, 1e-8, "F - m g, by t^2, and the error of the run");
  check_close ("potential", x[1], 9.81 * 2, 1e-5,
               "m g t^2 / 2, and round-off of 9.81e7 J in differences along the state");
  cli_write ("flight.yaml", "pinwheel: 1\nrun: {t_end: 1}\nparameters: [{name: m, value: 2}]\n"
                            "bodies: [{name: b, mass: m, inertia: 1, rate: {vx: 3}}]\n");
  cli_shell ("pinwheel sensitivity @/flight.yaml --of kinetic --by m -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  assert_int_equal (cli_sensitivity ("derivative", x), 1);
  check_close ("kinetic by mass", x[0], 4.5, 1e-9, "v^2 / 2, and round-off of differences");
}

/* x (1) of m x'' + c x' + k x = sin 3t, x (0) = 0.1, x' (0) = 0, for the numbers of test_run_error: a particular
 * solution and C_1 exp (r_1 t) + C_2 exp (r_2 t). */
static double damped_position (double m) {
  const double c = 31.1, k = 350.7, d = sqrt (c * c - 4 * k * m), r1 = (d - c) / (2 * m), r2 = -(d + c) / (2 * m);
  const double e = k - 9 * m, f = 3 * c, size = e * e + f * f; /* particular solution: (e sin 3t - f cos 3t) / size */
  const double x = 0.1 + f / size, v = -3 * e / size, C1 = (v - r2 * x) / (r1 - r2), C2 = x - C1;
  return (e * sin (3) - f * cos (3)) / size + C1 * exp (r1) + C2 * exp (r2);
}

/* The error contains that of the run: mass and stiffness act through the run's accelerations, whose errors stiffness
 * magnifies. */
TEST (run_error) {
  static const char *const method[] = { "bdf+projection --rtol 1e-6", "bdf --rtol 1e-5",  "radau+ggl --rtol 1e-8",
                                        "ida+ggl --rtol 1e-6",        "erk5 --rtol 1e-4", "bdf" };
  const double m = 0.3, h = 1e-4 * m;
  double expected = (8 * (damped_position (m + h) - damped_position (m - h)) -
                     (damped_position (m + 2 * h) - damped_position (m - 2 * h))) /
                    (12 * h);
  cli_write (
      "damped.yaml",
      "pinwheel: 1\nrun: {t_end: 1}\nparameters: [{name: m, value: 0.3}]\n"
      "bodies: [{name: B, mass: m, inertia: 1, start: {x: 0.1}}]\n"
      "elements:\n  - {slider: R, body: [B, ground], at: [[0, 0], [0, 0]]}\n  - {force: F, body: B, fx: sin (3*t)}\n"
      "  - {spring: S, body: [ground, B], at: [[-10, 0], [0, 0]], stiffness: 350.7, damping: 31.1, length: 10}\n");
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    double x, error;
    cli_shell (check_text ("pinwheel sensitivity @/damped.yaml --of B.x --by m -o @/sens/sensitivity.csv --json "
                           "@/sens/sensitivity.json --plots @/sens --method %s",
                           method[i]));
    cli_sensitivity ("derivative", &x);
    cli_sensitivity ("error", &error);
    check_close (method[i], x, expected, error, "the claim");
    check_below (method[i], error, 2000 * fabs (x - expected) + 1e-9, "the order of the real one");
  }
}

/* A light body that follows its force within 1e-5 s, as the derivative (2 x 9 / k^2 at most) shows: by accelerations
 * of the equations instead of those of the run it would be 0.004 at rtol 1e-6, 0.06 at 1e-4. */
TEST (light_body) {
  static const char *const method[] = { "bdf --rtol 1e-6", "bdf --rtol 1e-4", "radau+ggl --rtol 1e-8" };
  cli_write (
      "light.yaml",
      "pinwheel: 1\nrun: {t_end: 1}\nparameters: [{name: m, value: 0.0286}]\n"
      "bodies: [{name: B, mass: m, inertia: 1}]\n"
      "elements:\n  - {slider: R, body: [B, ground], at: [[0, 0], [0, 0]]}\n  - {force: F, body: B, fx: sin (3*t)}\n"
      "  - {spring: S, body: [ground, B], at: [[-10, 0], [0, 0]], stiffness: 1.9e5, damping: 4430, length: 10}\n");
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    double x;
    cli_shell (check_text ("pinwheel sensitivity @/light.yaml --of B.x --by m -o @/sens/sensitivity.csv --json "
                           "@/sens/sensitivity.json --plots @/sens --method %s",
                           method[i]));
    cli_sensitivity ("derivative", &x);
    check_below (method[i], fabs (x), 1e-4, "the error of the run's velocities, over m");
  }
}

/* The angle of a double pendulum by its initial value: steps of the run have no error, those of derivatives do.  Exact
 * values: extrapolation (Gragg, Bulirsch, Stoer) with 30 digits. */
TEST (own_error) {
  static const char *const method[] = { "rk4+projection --step 1e-4", "rk4+projection --step 1e-4 --every 0.1",
                                        "rk4+projection --step 1e-4 --every 0.01", "erk8 --rtol 1e-12" };
  static const double exact[] = { 2.67724679526883532, -0.467773208803388543 }; /* after 3 s and 4 s */
  cli_write ("double.yaml",
             "pinwheel: 1\nparameters: [{name: p, value: 1.5}]\nbodies:\n"
             "  - {name: a, mass: 1, inertia: 0.1, start: {x: 0.5*sin (p), y: -0.5*cos (p), phi: p - pi/2}}\n"
             "  - {name: b, mass: 1, inertia: 0.1, start: {x: sin (p) + 0.5, y: -cos (p), phi: 0}}\n"
             "elements:\n  - {pin: O, body: [ground, a], at: [[0, 0], [-0.5, 0]]}\n"
             "  - {pin: P, body: [a, b], at: [[0.5, 0], [-0.5, 0]]}\n"
             "  - {gravity: G, acceleration: [0, -9.81]}\n");
  for (int i = 0; i < 2; i++)
    for (size_t k = 0; k < sizeof method / sizeof *method; k++) {
      double x, error;
      cli_shell (check_text ("pinwheel sensitivity @/double.yaml --of a.phi --by p -o @/sens/sensitivity.csv --json "
                             "@/sens/sensitivity.json --plots @/sens --t-end %d --method %s",
                             3 + i, method[k]));
      cli_sensitivity ("derivative", &x);
      cli_sensitivity ("error", &error);
      check_close (method[k], x, exact[i], error, "the claim");
      check_below (method[k], error, 1e-6, "the tolerance, amplified");
    }
}

/* A chain of ten rods amplifies the errors of runs by 1e9 in 3 s; a double pendulum by 1e8 in 20 s (differences of runs
 * in 80-bit numbers), and by more than all digits in 40 s. */
TEST (chaos) {
  double x, error;
  cli_shell ("pinwheel sensitivity chain --of link1.x --by l -o @/sens/sensitivity.csv --json @/sens/sensitivity.json "
             "--plots @/sens");
  cli_sensitivity ("derivative", &x);
  cli_sensitivity ("error", &error);
  assert_true (error > 0.01 * fabs (x));
  assert_string_equal (cli_err, "pinwheel: derivatives with errors above 1 %: link1.x by l\n");
  cli_write ("double.yaml",
             "pinwheel: 1\nparameters: [{name: l, value: 1}]\n"
             "bodies:\n  - {name: a, mass: 1, inertia: 0.1, start: {x: l}}\n"
             "  - {name: b, mass: 1, inertia: 0.1, start: {x: 3*l}}\n"
             "elements:\n  - {pin: A, body: [ground, a], at: [[0, 0], [-l, 0]]}\n"
             "  - {pin: B, body: [a, b], at: [[l, 0], [-l, 0]]}\n  - {gravity: g, acceleration: [0, -9.81]}\n");
  cli_shell ("pinwheel sensitivity @/double.yaml --of b.x --by l -t 20 -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  cli_sensitivity ("derivative", &x);
  cli_sensitivity ("error", &error);
  check_close ("20 s", x, 9.0481e6, error, "the claim");
  cli_shell ("pinwheel sensitivity @/double.yaml --of b.x --by l -t 40 -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  cli_sensitivity ("derivative", &x);
  assert_true (isnan (x));
  assert_non_null (strstr (cli_out, "unknown"));
}

const check_fixture fixture = { cli_setup_undrawn, cli_teardown };
