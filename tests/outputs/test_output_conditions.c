/* Integrals of outputs that jump or have kinks where states pass a value: closed forms. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* x = cos t; a block that friction stops at t = 1, on a slope so that its velocity at rest is round-off. */
static const char model[] =
    "pinwheel: 1\n"
    "bodies:\n"
    "  - {name: a, mass: 1, inertia: 1, start: {x: 1}}\n"
    "  - {name: b, mass: 1, inertia: 1, rate: {vx: 0.6, vy: 0.8}}\n"
    "elements:\n"
    "  - {spring: k, body: [a, ground], at: [[0, 0], [-10, 0]], stiffness: 1, length: 10}\n"
    "  - {slider: slope, body: [b, ground], at: [[0, 0], [0, 0]], heading: atan (4.0/3)}\n"
    "  - {sliding-friction: f, body: [b, ground], at: [[0, 0], [0, 0]], heading: atan (4.0/3), limit: 1}\n"
    "outputs:\n"
    "  - {name: beyond, value: 'a.x > 0.3 ? 1 : 0'}\n"
    "  - {name: side, value: 'sign (a.x - 0.3)'}\n"
    "  - {name: cut, value: 'max (a.x, 0.3)'}\n"
    "  - {name: both, value: 'beyond + cut'}\n"
    "  - {name: path, value: 'abs (b.vx)'}\n"
    "  - {name: slides, value: 'b.vx > 1e-6 ? 1 : 0'}\n"
    "  - {name: late, value: '(t > 10.0/3 ? t : floor (t))/100'}\n";

const check_fixture fixture = { cli_setup_undrawn, cli_teardown };

/* The number after a name in the output of the last command. */
static double conditions_printed (const char *name) {
  const char *found = strstr (cli_out, name);
  assert_non_null (found);
  return atof (found + strlen (name));
}

/* Steps end where conditions change, and while the block rests its velocity changes no side. */
TEST (closed_forms) {
  static const struct {
    const char *method;
    int fixed;
    double bound, steps;
    const char *reason;
  } of[] = { { "rk4+projection", 1, 5e-8, 1020, "8 digits are printed" },
             { "erk5+projection", 0, 1e-6, 180, "tens of steps" },
             { "erk8+projection", 0, 5e-8, 80, "8 digits are printed" },
             { "radau+ggl", 0, 1e-6, 160, "its own tolerance" },
             { "ida+ggl", 0, 1e-5, 400, "hundreds of steps" },
             { "adams+none", 0, 1e-5, 350, "hundreds of steps" },
             { "galpha+ggl", 1, 2e-4, 1020, "h^2" } };
  const double t = acos (0.3), beyond = 3 * t, cut = 3 + 3 * (sin (t) - 0.3 * t); /* x is beyond 0.3 for 3 t */
  const double expected[] = {
    beyond, 2 * beyond - 10, cut, beyond + cut, 0.3, 1 - 1e-6 / 0.6, (4 + 50 * (1 - 1. / 9)) / 100
  };
  static const char *const text[] = { "integral:beyond", "integral:side",   "integral:cut", "integral:both",
                                      "integral:path",   "integral:slides", "integral:late" };
  cli_write ("conditions.yaml", model);
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    cli_good (check_text ("pinwheel run @/conditions.yaml -t 10 -m %s --%s --json @/run.json --of integral:beyond --of "
                          "integral:side --of integral:cut --of integral:both --of integral:path --of integral:slides "
                          "--of integral:late",
                          of[i].method, of[i].fixed ? "step 1e-2" : "rtol 1e-8"));
    const double steps = cli_number (cli_file ("run.json"), "statistics", "steps", NULL) +
                         cli_number (cli_file ("run.json"), "statistics", "rejected", NULL);
    for (int k = 0; k < 7; k++)
      check_close (check_text ("%s, %s", of[i].method, text[k]), conditions_printed (text[k]), expected[k], of[i].bound,
                   of[i].reason);
    check_below (of[i].method, steps, of[i].steps, "of smooth integrands");
  }
}

/* What is not located is said: conditions on reactions, not those on states. */
TEST (not_located) {
  const char *text = check_text ("%s  - {name: presses, value: 'slope.N > 1 ? beyond : 0'}\n", model);
  cli_write ("conditions.yaml", text);
  cli_shell ("pinwheel run @/conditions.yaml -t 1 --of integral:beyond --of presses");
  assert_null (strstr (cli_err, "not located"));
  cli_shell ("pinwheel run @/conditions.yaml -t 1 --of mean:presses");
  assert_non_null (strstr (cli_err, "output presses has conditions on reactions"));
  cli_shell ("pinwheel sweep @/conditions.yaml --vary a.x=1:2:2 -t 1 --of mean:presses -o @/sweep.csv");
  assert_non_null (strstr (cli_err, "output presses has conditions on reactions"));
}

/* A ball that bounces lies on the ground at both ends of a step that contains a whole flight. */
TEST (whole_flight_in_a_step) {
  cli_write ("flight.yaml",
             "pinwheel: 1\n"
             "bodies:\n"
             "  - {name: b, mass: 1, inertia: 1, start: {y: 0.1}, rate: {vy: 5}}\n"
             "elements:\n"
             "  - {gravity: g, acceleration: [0, -10]}\n"
             "  - {contact: floor, body: [b, ground], at: [[0, 0], [0, 0]], radius: 0.1, restitution: 0.5}\n"
             "outputs:\n"
             "  - {name: air, value: 'b.y > 0.1 ? 1 : 0'}\n");
  static const char *const of[] = { "rk4+projection --step 1e-2", "rk4+none --step 2e-2", "radau+ggl --rtol 1e-10",
                                    "galpha+index3 --step 1e-2", "erk8+projection --rtol 1e-10" };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    cli_good (check_text ("pinwheel run @/flight.yaml -t 3 -m %s --of integral:air", of[i]));
    check_close (of[i], conditions_printed ("integral:air"), 2, 3e-4, "flights that are not resolved");
  }
}

/* A block that sticks to a cart: round-off of the difference of their states changes no side. */
TEST (states_that_stay_equal) {
  cli_write ("stuck.yaml",
             "pinwheel: 1\n"
             "bodies:\n"
             "  - {name: cart, mass: 1.3, inertia: 1, rate: {vx: 0.6, vy: 0.8}}\n"
             "  - {name: block, mass: 0.7, inertia: 1, rate: {vx: 0.6, vy: 0.8}}\n"
             "elements:\n"
             "  - {slider: s1, body: [cart, ground], at: [[0, 0], [0, 0]], heading: atan (4.0/3)}\n"
             "  - {slider: s2, body: [block, ground], at: [[0, 0], [0, 0]], heading: atan (4.0/3)}\n"
             "  - {force: f, body: cart, fx: sin (t), fy: -0.3*cart.vy}\n"
             "  - {sliding-friction: s, body: [block, cart], at: [[0, 0], [0, 0]], heading: atan (4.0/3), limit: 5}\n"
             "outputs:\n"
             "  - {name: faster, value: 'block.vx > cart.vx ? 1 : 0'}\n"
             "  - {name: ahead, value: 'block.x > cart.x ? 1 : 0'}\n");
  cli_good ("pinwheel run @/stuck.yaml -t 10 -m galpha+index3 --step 1e-2 --json @/run.json --of integral:faster --of "
            "integral:ahead");
  check_close ("conditions", cli_number (cli_file ("run.json"), "statistics", "conditions", NULL), 0, 0, "exact");
  check_close ("faster", conditions_printed ("integral:faster"), 0, 0, "exact");
  check_close ("ahead", conditions_printed ("integral:ahead"), 0, 0, "exact");
}

/* A block that rocks passes the angle 0 where its other corner hits the ground: that impact adds no energy, and the
 * block comes to rest as without integrals. */
TEST (condition_at_an_impact) {
  double steps[2];
  cli_write ("block.yaml",
             "pinwheel: 1\n"
             "bodies:\n"
             "  - {name: b, mass: 1, inertia: 3.3333e-6, start: {y: 0.00607, phi: 0.094}}\n"
             "elements:\n"
             "  - {gravity: g, acceleration: [0, -9.81]}\n"
             "  - {contact: l, body: [b, ground], at: [[-0.001, -0.003], [0, 0]], mu: 0.8}\n"
             "  - {contact: r, body: [b, ground], at: [[0.001, -0.003], [0, 0]], restitution: 0.3, mu: 0.3}\n"
             "outputs:\n"
             "  - {name: side, value: sign (b.phi)}\n");
  for (int i = 0; i < 2; i++) {
    cli_good (check_text ("pinwheel run @/block.yaml -t 0.38 -m erk8+projection --rtol 1e-8 --json @/run.json%s",
                          i ? " --of integral:b.phi" : ""));
    steps[i] = cli_number (cli_file ("run.json"), "statistics", "steps", NULL);
  }
  check_below ("steps", steps[1], 2 * steps[0], "of the run without integrals");
}
