/* Derivatives of outputs with closed forms: conditions on velocities and positions, contacts, friction, reactions,
 * kinks in parameters.  Each is within its stated error, which is small. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* Writes a model of a body of 1 kg on a slider along x. */
static void derivatives_write (const char *parameters, double v0, const char *force) {
  cli_write ("line.yaml", check_text ("pinwheel: 1\nparameters: [%s]\nbodies: [{name: b, mass: 1, inertia: 1, rate: "
                                      "{vx: %.17g}}]\nelements:\n  - {slider: s, body: [b, ground], at: [[0, 0], [0, "
                                      "0]]}\n  - {force: F, body: b, %s}\n",
                                      parameters, v0, force));
}

/* Checks the derivatives of a sensitivity command of it, of the first output by all parameters, ... */
static void derivatives_check (const char *options, int count, const double *expected, double of_expected) {
  double x[CLI_MOST], error[CLI_MOST];
  cli_shell (check_text ("pinwheel sensitivity @/line.yaml %s -o @/sens/sensitivity.csv --json @/sens/sensitivity.json "
                         "--plots @/sens --every 100",
                         options));
  assert_int_equal (cli_sensitivity ("derivative", x), count);
  assert_int_equal (cli_sensitivity ("error", error), count);
  for (int i = 0; i < count; i++) {
    check_close (options, x[i], expected[i], error[i] + of_expected, "the claim");
    check_below (options, error[i], 1e-5 * fmax (fabs (expected[i]), 1), "five digits");
  }
}

/* Thrust -f while v > w, then -g: dv/dw = 1 - g/f, dx/dw = (T - t1) (1 - g/f); f while v < u, then g. */
TEST (switching_velocity) {
  const double f = 3, g = 1, w = 0.4, v0 = 1.3, T = 1.7, t1 = (v0 - w) / f, k = 1 - g / f, x = (T - t1) * k,
               y = t1 + (T - t1) * g / f, expected[] = { k, g / f, x, y, x, y };
  derivatives_write ("{name: f, value: 3}, {name: g, value: 1}, {name: w, value: 0.4}", v0, "fx: 'b.vx > w ? -f : -g'");
  derivatives_check ("--of b.vx --of b.x --of integral:b.vx --by w --by b.vx -t 1.7", 6, expected, 0);
  derivatives_check ("--of b.vx --of b.x --of integral:b.vx --by w --by b.vx -t 1.7 -m bdf", 6, expected, 0);
  const double up[] = { k, (T - (w + 0.5) / f) * k };
  derivatives_write ("{name: f, value: 3}, {name: g, value: 1}, {name: u, value: 0.4}", -0.5, "fx: 'b.vx < u ? f : g'");
  derivatives_check ("--of b.vx --of b.x --by u -t 1.7", 2, up, 0);
}

/* Force a, from x > c on force b: dv/dc = (a - b) / v_c. */
TEST (position) {
  const double a = 2, b = 0.5, c = 0.7, vc = sqrt (1 + 2 * a * c), expected = (a - b) / vc;
  derivatives_write ("{name: p, value: 2}, {name: q, value: 0.5}, {name: c, value: 0.7}", 1, "fx: 'b.x > c ? q : p'");
  derivatives_check ("--of b.vx --by c -t 1.5", 1, &expected, 0);
}

/* -k max (0, x - 1): after the contact x = 1 - v0 (T - 1/v0 - pi / sqrt k). */
TEST (contact) {
  for (double k = 1e2; k < 1e9; k *= 100) {
    const double T = 4, by_v = -(T - PW_PI / sqrt (k)), by_k = -PW_PI / 2 * pow (k, -1.5),
                 expected[] = { by_v, by_k, by_v, by_k };
    derivatives_write (check_text ("{name: k, value: %.17g}", k), 1, "fx: '-k*max (0, b.x - 1)'");
    derivatives_check ("--of b.x --of integral:b.vx --by b.vx --by k -t 4 -m rk4 --step 1e-4", 4, expected, 0);
  }
}

/* Two equal bodies exchange their velocities in a contact. */
TEST (exchange) {
  const double expected[] = { 0, 1, 1, 0 };
  cli_write ("line.yaml", "pinwheel: 1\nparameters: [{name: u, value: 1}, {name: w, value: -0.3}]\nbodies:\n"
                          "  - {name: a, mass: 1, inertia: 1, rate: {vx: u}}\n"
                          "  - {name: b, mass: 1, inertia: 1, start: {x: 1}, rate: {vx: w}}\nelements:\n"
                          "  - {force: A, body: a, fx: '-1e4*max (0, a.x + 0.2 - b.x)'}\n"
                          "  - {force: B, body: b, fx: '1e4*max (0, a.x + 0.2 - b.x)'}\n");
  derivatives_check ("--of a.vx --of b.vx --by u --by w -t 2", 4, expected, 0);
}

/* Friction stops the body at v0^2 / (2 mu): by mu -v0^2 / (2 mu^2), by v0 v0 / mu. */
TEST (friction) {
  const double expected[] = { -2, 2 };
  cli_write ("line.yaml",
             "pinwheel: 1\nparameters: [{name: mu, value: 0.5}]\n"
             "bodies: [{name: b, mass: 1, inertia: 1, rate: {vx: 1}}]\nelements:\n"
             "  - {slider: s, body: [b, ground], at: [[0, 0], [0, 0]]}\n"
             "  - {sliding-friction: f, body: [b, ground], at: [[0, 0], [0, 0]], limit: mu, speed: 1e-4}\n");
  derivatives_check ("--of b.x --by mu --by b.vx -t 3", 2, expected, 1e-7); /* the way at speeds below 1e-4 m/s */
}

/* A cos (w t + p) across the slider: its reaction alone feels it; all outputs are proportional to A. */
TEST (reaction) {
  static const char *const methods[] = { "rk4", "erk8", "radau", "bdf", "ida", "galpha" };
  const double A = 2, w = 3, p = 0.4, T = 2.3, s = sin (w * T + p),
               square = 0.5 + (sin (2 * (w * T + p)) - sin (2 * p)) / (4 * w * T),
               expected[] = { -(s - sin (p)) / w, -A / w * (T * cos (w * T + p) - (s - sin (p)) / w), sqrt (square),
                              A / (2 * sqrt (square)) *
                                  (cos (2 * (w * T + p)) / (2 * w) -
                                   (sin (2 * (w * T + p)) - sin (2 * p)) / (4 * w * w * T)) };
  derivatives_write ("{name: A, value: 2}, {name: w, value: 3}, {name: p, value: 0.4}", 0, "fy: 'A*cos (w*t + p)'");
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
    derivatives_check (check_text ("--of integral:s.N --of rms:s.N --by A --by w -t 2.3 --step 1e-3 -m %s", methods[i]),
                       4, expected, 0);
}

/* A gust, a bump that reflects the body, and their values. */
TEST (gust) {
  const double root = sqrt (PW_PI / 1000), expected[] = { root * 1.9, -50 * root };
  derivatives_write ("{name: a, value: 50}, {name: c, value: 1}", 0, "fx: 'a*exp (-1000*(t - c)^2)'");
  derivatives_check ("--of b.x --by a --by c -t 2.9", 2, expected, 0);
  const double minus = -1;
  derivatives_write ("{name: a, value: 200}", 1, "fx: '-a*exp (-1000*(b.x - 1)^2)'");
  derivatives_check ("--of b.vx --by b.vx -t 3", 1, &minus, 0);
}

/* max (p, 1) at 1 and beside it; a jump. */
TEST (kink) {
  double x, error;
  derivatives_write ("{name: p, value: 1}", 0, "fx: 'max (p, 1)'");
  cli_shell ("pinwheel sensitivity @/line.yaml --of b.x --by p -t 2 -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  assert_non_null (strstr (cli_out, "  no derivative at p = 1: 0 from below, 2 from above\n"));
  cli_sensitivity ("derivative", &x);
  assert_true (isnan (x));
  for (int i = 1; i < 8; i++)
    for (int side = -1; side <= 1; side += 2) {
      const double away = side * pow (10, -i);
      cli_shell (check_text ("pinwheel sensitivity @/line.yaml --of b.x --by p -t 2 -o @/sens/sensitivity.csv --json "
                             "@/sens/sensitivity.json --plots @/sens --set p=%.17g",
                             1 + away));
      cli_sensitivity ("derivative", &x);
      cli_sensitivity ("error", &error);
      check_close ("beside the kink", x, side > 0 ? 2 : 0, error, "the claim");
      check_below ("its error", error, 1e-2, "round-off of 2 m over steps of 1e-8");
    }
  derivatives_write ("{name: p, value: 1}", 0, "fx: 'p >= 1 ? 1 : 2'");
  cli_shell ("pinwheel sensitivity @/line.yaml --of b.x --by p -t 2 -o @/sens/sensitivity.csv --json "
             "@/sens/sensitivity.json --plots @/sens");
  cli_sensitivity ("derivative", &x);
  assert_true (isnan (x));
}

/* A parameter of 0, or small beside what it is added to; one that neighbours below refuse. */
TEST (sizes) {
  static const char *const value[] = { "0", "1e-12", "1e-6", "1", "1e6" };
  const double expected = 0.5 * 1.5 * 1.5;
  for (size_t i = 0; i < sizeof value / sizeof *value; i++) {
    derivatives_write (check_text ("{name: p, value: %s}", value[i]), 1, "fx: '100 + p'");
    derivatives_check ("--of b.x --by p -t 1.5", 1, &expected, 0);
  }
  derivatives_write ("{name: p, value: 1}", 1, "fx: '3*p + 0*sqrt (p - 1)'");
  const double three = 3 * expected;
  derivatives_check ("--of b.x --by p -t 1.5", 1, &three, 0);
}

/* Neighbours of large steps, b < 0, slide along the jump, with steps without end: they are given up. */
TEST (sliding_neighbours) {
  const double expected[] = { 0, 0 };
  derivatives_write ("{name: a, value: 2}, {name: b, value: 0.77}, {name: c, value: 5}", 0.2, "fx: 'b.vx > c ? b : a'");
  derivatives_check ("--of b.x --of rms:b.vx --by b -t 1.4", 2, expected, 0);
}

const check_fixture fixture = { cli_setup_undrawn, cli_teardown };
