/* Derivatives of motions that pass states where accelerations jump, or change within a short time: closed forms,
 * differences of runs, refusals. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* Without force up to x = w, then with -F: with the time s = t - w/v after that, x = w + v s - F s^2 / 2, the work
 * -F (v s - F s^2 / 2) and the mean of the work (1/t) times the integral of that, by v, F and w. */
TEST (closed_form) {
  static const char *const methods[] = { "rk4 --step 1e-4",   "erk5 --rtol 1e-9",  "erk8 --rtol 1e-9",
                                         "radau --rtol 1e-9", "adams --rtol 1e-9", "bdf --rtol 1e-9" };
  const double F = 0.3, s = 1,
               expected[] = { 2 - F, -0.5, F, -F * (2 - F), -(1 - F), F * (1 - F), -0.2025, -0.2, 0.1275 };
  double x[CLI_MOST], error[CLI_MOST];
  cli_write ("jump.yaml", "pinwheel: 1\nparameters: [{name: F, value: 0.3}, {name: w, value: 1}]\n"
                          "bodies:\n  - {name: a, mass: 1, inertia: 1, rate: {vx: 1}}\n"
                          "elements:\n  - {force: f, body: a, fx: 'a.x > w ? -F : 0'}\n");
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    cli_shell (check_text ("pinwheel sensitivity @/jump.yaml --of a.x --of f.work --of mean:f.work --by a.vx --by F "
                           "--by w -t 2 -o @/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens -m %s",
                           methods[i]));
    assert_string_equal (cli_err, "");
    assert_int_equal (cli_sensitivity ("derivative", x), 9);
    assert_int_equal (cli_sensitivity ("error", error), 9);
    for (int k = 0; k < 9; k++) check_close (methods[i], x[k], expected[k], error[k], "the claim");
    for (int k = 0; k < 9; k++) check_below (methods[i], error[k], 1e-6 * s, "six digits");
  }
}

/* The smallest velocity, v^2 = v0^2 - 2 at the jump of a force from -1 to 1. */
TEST (extremum) {
  double x[2], error[2];
  cli_write ("least.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1, rate: {vx: 2}}\n"
                           "elements:\n  - {force: f, body: a, fx: 'a.x > 1 ? 1 : -1'}\n");
  cli_shell ("pinwheel sensitivity @/least.yaml --of min:a.vx --by a.vx -t 2 -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  cli_sensitivity ("derivative", x);
  cli_sensitivity ("error", error);
  check_close ("least velocity", x[0], sqrt (2), error[0], "v0 / v");
  check_below ("error", error[0], 1e-6, "six digits");
}

/* Derivatives of outputs of a model by a parameter against extrapolated differences of accurate runs. */
static void jumps_compare (const char *file, const char *outputs, const char *by, double value, double step) {
  static const char command[] =
      "pinwheel sensitivity @/%s --every 1 %s --by %s --set %s=%.17g -o @/sens/sensitivity.csv --json "
      "@/sens/sensitivity.json --plots @/sens -m erk8 --rtol 1e-11 --atol "
      "1e-13";
  double derivative[CLI_MOST], x[4][CLI_MOST];
  cli_shell (check_text (command, file, outputs, by, by, value));
  int count = cli_sensitivity ("derivative", derivative);
  assert_true (count > 0);
  for (int k = 0; k < 4; k++) {
    cli_shell (check_text (command, file, outputs, by, by, value + (k < 2 ? k - 2 : k - 1) * step));
    assert_int_equal (cli_sensitivity ("value", x[k]), 2 * count);
  }
  for (int i = 0; i < count; i++) {
    double one = (x[2][2 * i] - x[1][2 * i]) / (2 * step), two = (x[3][2 * i] - x[0][2 * i]) / (4 * step);
    check_close (by, derivative[i], (4 * one - two) / 3, fabs (one - two) + 1e-6 * fabs (one) + 1e-9,
                 "extrapolated differences of runs");
  }
}

/* A reaction that is largest just after a breakpoint that moves, and a velocity with a kink there. */
TEST (breakpoint) {
  cli_write ("rod.yaml", "pinwheel: 1\nrun: {t_end: 2}\nparameters: [{name: s, value: 0.5, unit: s}]\n"
                         "bodies:\n  - {name: rod, mass: 1, inertia: 0.1, start: {x: 1}}\n"
                         "elements:\n  - {pin: A, body: [ground, rod], at: [[0, 0], [-1, 0]]}\n"
                         "  - {force: F, body: rod, fx: 't > s ? 300*exp (-20*(t - s)) : 0'}\n"
                         "  - {gravity: g, acceleration: [0, -9.81]}\n");
  jumps_compare ("rod.yaml", "--of max:A.Fx --of min:rod.omega --of max:A.Fy", "s", 0.5, 1e-4);
}

/* A vehicle whose steering torque switches; a block with friction by sign (vx), at rest at the start; a bouncing ball,
 * of which only the derivative of the force jumps. */
TEST (differences) {
  static const char outputs[] = "--of b.y --of t.work --of mean:p.Fx --of rms:a.vx --of max:a.vx --of kinetic";
  cli_write ("switch.yaml",
             "pinwheel: 1\nrun: {t_end: 0.6}\nparameters: [{name: amp, value: 5}, {name: h, value: 0.2}]\nbodies:\n"
             "  - {name: a, mass: 1, inertia: 1, start: {x: 0}, rate: {vx: 1}}\n"
             "  - {name: b, mass: 0.5, inertia: 0.1, start: {x: 1}, rate: {vx: 1}}\nelements:\n"
             "  - {pin: p, body: [a, b], at: [[0.5, 0], [-0.5, 0]]}\n  - {wheel: w, body: a, at: [-0.3, 0]}\n"
             "  - {torque: t, body: [b, a], value: '(b.phi - a.phi > h ? -amp : amp) - 0.5*(b.omega - a.omega)'}\n");
  jumps_compare ("switch.yaml", outputs, "amp", 5, 1e-3);
  jumps_compare ("switch.yaml", outputs, "h", 0.2, 1e-4);
  cli_write ("sign.yaml", "pinwheel: 1\nrun: {t_end: 3}\nparameters: [{name: k, value: 100}]\n"
                          "bodies:\n  - {name: a, mass: 1, inertia: 1, start: {x: 1}}\nelements:\n"
                          "  - {slider: s, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                          "  - {force: f, body: a, fx: '-k*a.x - 0.5*sign(a.vx)'}\n");
  jumps_compare ("sign.yaml", "--of a.x --of a.vx --of f.work --of integral:a.x --of min:a.x", "k", 100, 1e-2);
  cli_write ("ball.yaml", "pinwheel: 1\nrun: {t_end: 2}\nparameters: [{name: k, value: 1e4}]\n"
                          "bodies:\n  - {name: a, mass: 1, inertia: 1, start: {y: 1}}\nelements:\n"
                          "  - {gravity: g, acceleration: [0, -9.81]}\n"
                          "  - {force: f, body: a, fy: 'a.y < 0 ? -k*a.y : 0'}\n");
  jumps_compare ("ball.yaml", "--of a.y --of a.vy", "k", 1e4, 1);
}

/* Friction that reverses within 1 mm/s: each method resolves it, or the error shows that it does not. */
TEST (narrow_friction) {
  static const char *const methods[] = { "rk4",      "erk5", "erk8",  "erk8 --rtol 1e-4 --atol 1e-4",
                                         "leapfrog", "bdf",  "adams", "bdf --rtol 1e-4 --atol 1e-4",
                                         "galpha",   "ida",  "radau", "radau --rtol 1e-4 --atol 1e-4" };
  double expected, x, error;
  cli_write ("friction.yaml",
             "pinwheel: 1\nrun: {t_end: 10}\nparameters: [{name: k, value: 100}]\n"
             "bodies:\n  - {name: a, mass: 1, inertia: 1, start: {x: 1}}\nelements:\n"
             "  - {slider: s, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
             "  - {spring: S, body: [a, ground], at: [[0, 0], [-5, 0]], stiffness: k, length: 5}\n"
             "  - {sliding-friction: f, body: [a, ground], at: [[0, 0], [0, 0]], limit: 0.5, speed: 0.001}\n");
  jumps_compare ("friction.yaml", "--of a.x", "k", 100, 1e-2);
  cli_shell ("pinwheel sensitivity @/friction.yaml --every 1 --of a.x --by k -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens -m erk8 --rtol 1e-11 --atol 1e-13");
  assert_int_equal (cli_sensitivity ("derivative", &expected), 1);
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    cli_shell (check_text ("pinwheel sensitivity @/friction.yaml --every 1 --of a.x --by k -o @/sens/sensitivity.csv "
                           "--json @/sens/sensitivity.json --plots @/sens -m %s",
                           methods[i]));
    assert_int_equal (cli_sensitivity ("derivative", &x), 1);
    assert_int_equal (cli_sensitivity ("error", &error), 1);
    check_below (methods[i], fabs (x - expected), 10 * error + 0.01 * expected,
                 "ten times the error, or below the notice");
  }
}

/* A motion that ends sliding along a jump, or starts at one: x (2) = 2 v + 1 for v > 0, (2 + v / 1.5)^2 / 4 below. */
TEST (refusals) {
  cli_write ("stop.yaml", "pinwheel: 1\nparameters: [{name: F, value: 0}, {name: v, value: 0.5}]\n"
                          "bodies:\n  - {name: a, mass: 1, inertia: 1, rate: {vx: v}}\nelements:\n"
                          "  - {slider: s, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                          "  - {force: f, body: a, fx: 'F - 0.5*sign(a.vx)'}\n");
  assert_int_equal (cli_run ("pinwheel sensitivity @/stop.yaml --of a.x --by F -t 1.2 -m erk8 --limit 20"), 4);
  assert_non_null (
      strstr (cli_err, "pinwheel: t = 1 s: force f: fx: on both sides of a condition it leads back to it"));
  assert_int_equal (cli_run ("pinwheel sensitivity @/stop.yaml --of a.x --by F -t 2 -m rk4"), 4);
  assert_non_null (
      strstr (cli_err, "pinwheel: t = 1 s: force f: fx: on both sides of a condition it leads back to it"));
  cli_shell ("pinwheel sensitivity @/stop.yaml --set F=1 --set v=0 --of a.x --by v -t 2 -o @/sens/sensitivity.csv "
             "--json @/sens/sensitivity.json --plots @/sens");
  assert_non_null (strstr (cli_out, "  no derivative at v = 0: 0.66667 from below, 2 from above\n"));
  assert_non_null (strstr (cli_file ("sens/sensitivity.json"), "\"derivative\": null"));
  cli_shell ("pinwheel sensitivity @/stop.yaml --set F=1 --set v=0 --of a.x --by F -t 2 -m erk8 -o "
             "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens");
  double x;
  assert_int_equal (cli_sensitivity ("derivative", &x), 1);
  check_close ("da.x/dF", x, 2, 1e-6, "t^2/2");
}

/* A motion that turns around twice, from many initial velocities and with steps of many sizes: whether a state lies on
 * the surface, or samples near it are accurate, must not matter. */
TEST (crossings) {
  static const char *const methods[] = { "erk8 --rtol 1e-9", "erk8 --rtol 1e-6", "erk5 --rtol 1e-4",
                                         "bdf --rtol 1e-7" };
  double expected, x;
  cli_write ("turns.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1, start: {x: 0.44}}\nelements:\n"
                           "  - {slider: s, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                           "  - {force: f, body: a, fx: '-20*a.x - 0.5*sign(a.vx) - 0.3*a.vx'}\n"
                           "  - {force: g, body: a, fx: {harmonic: {amplitude: 5, omega: 3}}}\n");
  for (int i = 0; i < 20; i++)
    for (size_t k = 0; k < sizeof methods / sizeof *methods; k++) {
      cli_shell (check_text ("pinwheel sensitivity @/turns.yaml -t 2 --every 1 --of a.x --by a.vx --start a.vx=%.17g "
                             "-m %s -o @/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens",
                             0.24 + 1e-3 * i, methods[k]));
      assert_int_equal (cli_sensitivity ("derivative", &x), 1);
      if (k == 0) expected = x;
      check_close (methods[k], x, expected, 1e-3 * fabs (expected), "ten times the largest tolerance");
    }
}

/* Floquet multipliers of a forced oscillator with friction, against differences of the map over a period. */
TEST (periodic) {
  double map[4][2], J[2][2];
  const double x0 = 0.43974888, v0 = 0.24544215, step = 1e-4;
  char command[400];
  cli_write ("forced.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1, start: {x: 1}}\nelements:\n"
                            "  - {slider: s, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {force: f, body: a, fx: '-20*a.x - 0.5*sign(a.vx) - 0.3*a.vx'}\n"
                            "  - {force: g, body: a, fx: {harmonic: {amplitude: 5, omega: 3}}}\n");
  for (int k = 0; k < 4; k++) {
    snprintf (
        command, sizeof command,
        "pinwheel run @/forced.yaml -t 2*pi/3 -m erk8 --rtol 1e-11 --atol 1e-13 --start a.x=%.17g --start a.vx=%.17g "
        "--json @/f.json",
        x0 + (k == 0   ? step
              : k == 1 ? -step
                       : 0),
        v0 + (k == 2   ? step
              : k == 3 ? -step
                       : 0));
    cli_shell (command);
    const char *json = cli_file ("f.json");
    map[k][0] = cli_number (json, "bodies", "a", "x", NULL), map[k][1] = cli_number (json, "bodies", "a", "vx", NULL);
  }
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++) J[i][j] = (map[2 * j][i] - map[2 * j + 1][i]) / (2 * step);
  cli_shell ("pinwheel periodic @/forced.yaml --period 2*pi/3 -m erk8 --rtol 1e-9 -o @/per/periodic.csv --json "
             "@/per/periodic.json --plots @/per");
  const char *at = strstr (cli_out, "modulus ");
  assert_non_null (at);
  check_close ("modulus", strtod (at + 8, NULL), sqrt (J[0][0] * J[1][1] - J[0][1] * J[1][0]), 1e-5,
               "six digits, and differences of 1e-4");
}

/* Accelerations that jump at a state have no linearisation there. */
TEST (linearise) {
  cli_bad ("pinwheel linearise @/forced.yaml --start a.vx=0", 4,
           "t = 0 s: accelerations jump with a.vx at this state, or fail beside it: it has no linearisation");
  cli_shell ("pinwheel linearise @/forced.yaml --start a.vx=1");
  cli_shell ("pinwheel check @/forced.yaml");
  assert_non_null (strstr (cli_out, "accelerations jump with a.vx at this state"));
}

const check_fixture fixture = { cli_setup_undrawn, cli_teardown };
