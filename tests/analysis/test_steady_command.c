/* `pinwheel steady`, `pinwheel linearise --steady`: text, files, bad input. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* A turn of the n-trailer, and what to hold to select it. */
TEST (motion) {
  cli_good ("pinwheel steady n-trailer --starts 0 -o @/turn/steady.csv --json @/turn/steady.json --plots @/turn");
  cli_shows ("n-trailer: 1 steady motion up to 3 symmetries, from the initial state and 0 random ones\n");
  cli_shows (
      "Motion 1 is one of a family of dimension 2; to select one: --hold tractor.speed=2 --hold tractor.omega=1\n");
  const char *json = cli_file ("turn/steady.json");
  assert_true (cli_says (json, "model", "n-trailer"));
  assert_non_null (strstr (json, "\"parameter\": null"));
  check_close ("family", cli_number (json, "motions", "family", NULL), 2, 0, "a count");
  check_close ("omega", cli_number (json, "motions", "state", "trailer2.omega", NULL), 1, 1e-12, "Newton to round-off");
  assert_null (cli_file ("turn/steady.dat"));
  cli_good ("pinwheel steady n-trailer --starts 0 --hold tractor.speed=2*1.5 --hold tractor.curvature=1/4");
  cli_shows ("     1                    3                   0.75        0        0");
  assert_null (strstr (cli_out, "to select one"));
}

/* Options that select a motion are given in full. */
TEST (long_advice) {
  char text[1000];
  size_t n = (size_t)snprintf (text, sizeof text, "pinwheel: 1\nabout: free bodies\nbodies:\n");
  for (int i = 0; i < 6; i++)
    n +=
        (size_t)snprintf (text + n, sizeof text - n,
                          "  - {name: a_body_with_a_rather_long_name_%d, mass: 1, inertia: 1, start: {x: %d}}\n", i, i);
  cli_write ("free.yaml", text);
  cli_good ("pinwheel steady @/free.yaml --starts 0");
  cli_shows (" --hold a_body_with_a_rather_long_name_5.omega=0\n");
}

/* A trailer whose axle passes under the hitch, and two wheels of which one passes the other: the constraints are
 * singular there, and eigenvalues become infinite.  The branches end on both sides, without events. */
TEST (singular_constraints) {
  static const char *const model[] = {
    "pinwheel: 1\nparameters: [{name: d, value: 1, unit: m}]\nbodies:\n"
    "  - {name: car, mass: 10, inertia: 4, rate: {vx: 1}}\n"
    "  - {name: trailer, mass: 10, inertia: 4, start: {x: -1}, rate: {vx: 1}}\nelements:\n"
    "  - {wheel: rear, body: car, at: [0, 0]}\n"
    "  - {pin: hitch, body: [car, trailer], at: [[0, 0], [1, 0]]}\n"
    "  - {wheel: axle, body: trailer, at: [1 - d, 0]}\n",
    "pinwheel: 1\nparameters: [{name: d, value: 1, unit: m}]\nbodies:\n"
    "  - {name: car, mass: 10, inertia: 4, rate: {vx: 1}}\nelements:\n"
    "  - {wheel: rear, body: car, at: [0.3, 0]}\n"
    "  - {wheel: front, body: car, at: [0.3 + d, 0]}\n"
  };
  static const char *const range[] = { "1:-1", "-0.5:1", "0.7:-0.1" };
  for (int i = 0; i < 6; i++) {
    int ends = 0;
    cli_write ("singular.yaml", model[i / 3]);
    assert_int_equal (cli_run (check_text ("pinwheel steady @/singular.yaml --vary d=%s -o @/singular/steady.csv "
                                           "--json @/singular/steady.json --plots @/singular",
                                           range[i % 3])),
                      0);
    assert_null (strstr (cli_out, "zero eigenvalue"));
    for (const char *line = strstr (cli_out, "Branch "); line; line = strstr (line + 1, "Branch ")) {
      assert_non_null (strstr (line, "singular"));
      assert_true (strstr (line, "depends on other constraints") || strstr (line, " follows from ") ||
                   strstr (line, ": the same lateral constraint, except "));
      ends++;
    }
    assert_int_equal (ends, i < 3 ? 4 : 2);
    for (const char *line = strstr (cli_out, "  ends  "); line; line = strstr (line + 1, "  ends  "))
      check_below ("distance of an end from the singular constraints", fabs (strtod (line + 7, NULL)), 1e-5,
                   "steps of 1e-7 of the range, residuals over their sine");
  }
}

/* Number `column` (from 0) of a line of a table. */
static double table_number (const char *line, int column) {
  for (; column > 0; column--) line = strchr (line, ',') + 1;
  return strtod (line, NULL);
}

/* The car of the manual: the row of the event, and one row for each point. */
TEST (branch) {
  int rows = 0, events = 0;
  cli_good ("pinwheel steady car-tyres --set steer=0 --set a=1.4 --set b=1.2 --vary u=20:60 --starts 2 -o "
            "@/car/steady.csv --json @/car/steady.json --plots @/car");
  cli_shows ("car-tyres: 1 branch of steady motions up to 3 symmetries, u from 20 to 60\n");
  cli_shows ("       1  zero eigenvalue    51.9999995        0                0                \n");
  const char *csv = cli_file ("car/steady.csv");
  assert_int_equal (strncmp (csv, "branch,event,u [m/s],growing,residual,car.x [m],", 48), 0);
  for (const char *line = strchr (csv, '\n') + 1; *line; line = strchr (line, '\n') + 1, rows++) {
    double u = table_number (line, 2);
    check_close ("speed", table_number (line, 8), u, 1e-9, "the speed that is prescribed");
    events += strncmp (line, "1,zero eigenvalue,", 18) == 0;
    if (strncmp (line, "1,point,", 8) == 0) assert_int_equal ((int)table_number (line, 3), u > 52);
  }
  assert_true (rows > 50);
  assert_int_equal (events, 1);
  assert_non_null (cli_file ("car/steady.dat"));
  assert_non_null (strstr (cli_file ("car/steady.gp"), "\nx_1 = 'u [m/s]'\n"));
  assert_non_null (strstr (cli_file ("car/steady.gp"), "\ny_3 = 'imaginary part [1/s]'\nscale_3 = 'u [m/s]'\n"));
  assert_true (cli_says (cli_file ("car/steady.json"), "parameter", "u"));
}

/* What is held is varied; the rest is held as in the initial motion, which is reported. */
TEST (vary_held) {
  assert_int_equal (cli_run ("pinwheel steady n-trailer --vary tractor.curvature=0.1:0.5 --starts 0 -o "
                             "@/held/steady.csv --json @/held/steady.json --plots @/held"),
                    0);
  assert_string_equal (cli_err, "pinwheel: holding tractor.speed=2, as in the motion nearest to the initial state\n");
  const char *json = cli_file ("held/steady.json");
  check_close ("speed", cli_number (json, "held", "tractor.speed", NULL), 2, 1e-12, "that of the initial state");
  check_close ("omega", cli_number (json, "motions", "state", "tractor.omega", NULL), 0.2, 1e-9, "speed / radius");
}

/* A pitchfork at p = 1 of two curved branches, x = 3 sin p and (x - 3 sin p)^2 = p - 1. */
TEST (curved_pitchfork) {
  static const double last[] = { 1.5, 5, 9 };
  cli_write ("fork.yaml", "pinwheel: 1\nparameters: [{name: p, value: 0.2}]\n"
                          "bodies: [{name: b, mass: 1, inertia: 1, start: {x: 3*sin(p)}}]\nelements:\n"
                          "  - {force: f, body: b, fy: -b.y - b.vy, "
                          "fx: '(b.x - 3*sin(p))*(p - 1 - (b.x - 3*sin(p))^2) - b.vx'}\n"
                          "  - {rotational-spring: s, body: [b, ground], stiffness: 3, damping: 0.2}\n");
  for (size_t k = 0; k < sizeof last / sizeof *last; k++) {
    int events = 0;
    cli_good (check_text (
        "pinwheel steady @/fork.yaml --vary p=0.2:%g -o @/fork/steady.csv --json @/fork/steady.json --plots @/fork",
        last[k]));
    for (const char *line = strchr (cli_file ("fork/steady.csv"), '\n') + 1; *line; line = strchr (line, '\n') + 1) {
      double p = table_number (line, 2);
      check_close ("residual", table_number (line, 4), 0, 1e-9, "Newton's tolerance, or the cubic near the pitchfork");
      if (strncmp (line + 2, "point", 5) == 0) continue;
      check_close ("pitchfork", p, 1, 1e-6, "a cubic between points nearby");
      events++;
    }
    assert_int_equal (events, 2);
  }
}

/* Equilibria on the circle x^2 + p^2 = 1, which reaches neither end of the range: followed once around. */
TEST (closed_branch) {
  int points = 0, folds = 0;
  double beyond[2] = { 0 };
  cli_write ("circle.yaml", "pinwheel: 1\nparameters: [{name: p, value: 0.5}]\n"
                            "bodies: [{name: b, mass: 1, inertia: 1, start: {x: -0.8}}]\nelements:\n"
                            "  - {slider: rail, body: [b, ground], at: [[0, 0], [0, 0]]}\n"
                            "  - {force: f, body: b, at: [0, 0], fx: {expression: \"b.x^2 + p^2 - 1 - 0.5*b.vx\"}}\n");
  cli_good ("pinwheel steady @/circle.yaml --vary p=-2:2 --starts 0 -o @/circle/steady.csv --json @/circle/steady.json "
            "--plots @/circle");
  cli_shows ("circle: 1 branch of steady motions, p from -2 to 2\n");
  for (const char *line = strchr (cli_file ("circle/steady.csv"), '\n') + 1; *line; line = strchr (line, '\n') + 1) {
    double p = table_number (line, 2), x = table_number (line, 5);
    check_close ("x^2 + p^2", x * x + p * p, 1, 1e-9, "Newton's tolerance");
    if (strncmp (line, "1,fold,", 7) == 0) {
      check_close ("fold", fabs (p), 1, 1e-9, "quadratic in the distance along the branch");
      folds++;
    } else
      assert_int_equal ((int)table_number (line, 3), x > 0);
    beyond[0] = fmin (beyond[0], x), beyond[1] = fmax (beyond[1], x);
    points++;
  }
  assert_int_equal (folds, 2);
  assert_in_range (points, 50, 400);
  check_close ("far side", beyond[1] - beyond[0], 2, 0.02, "points at 1/50 of the range");
}

static int steady_lines (const char *start) {
  int count = 0;
  for (const char *line = strchr (cli_file ("turns/steady.csv"), '\n') + 1; *line; line = strchr (line, '\n') + 1)
    count += strncmp (line, start, strlen (start)) == 0;
  return count;
}

/* Branches are closed though the vehicle has moved, or a body turned, in a circuit; all motions at the value in the
 * model are on the same one.  A trailer of 1 m behind an axle: tan steer = 0.5 at the folds.  Where a spring winds up,
 * none is closed, and it is followed in both directions. */
TEST (turned_branch) {
  cli_write ("turned.yaml", "pinwheel: 1\nparameters: [{name: steer, value: 0}]\nbodies:\n"
                            "  - {name: tractor, mass: 2, inertia: 1, rate: {vx: 1}}\n"
                            "  - {name: trailer, mass: 1, inertia: 0.5, start: {phi: 0}}\nelements:\n"
                            "  - {wheel: rear, body: tractor, at: [0, 0]}\n"
                            "  - {wheel: front, body: tractor, at: [0.5, 0], heading: steer}\n"
                            "  - {speed: engine, body: tractor, at: [0, 0], value: 1}\n"
                            "  - {pin: hitch, body: [tractor, trailer], at: [[0, 0], [1, 0]]}\n"
                            "  - {wheel: axle, body: trailer, at: [0, 0]}\n");
  cli_good ("pinwheel steady @/turned.yaml --vary steer=-0.7:0.8 -o @/turns/steady.csv --json @/turns/steady.json "
            "--plots @/turns");
  cli_shows ("turned: 1 branch of ");
  cli_shows ("       1  fold              0.463647609        0 ");
  cli_shows ("       1  fold             -0.463647609        0 ");
  assert_int_equal (steady_lines ("1,fold,"), 2);
  cli_write ("arm.yaml", "pinwheel: 1\nparameters: [{name: T, value: 0}, {name: k, value: 0, domain: nonnegative}]\n"
                         "bodies: [{name: arm, mass: 1, inertia: 0.1, start: {phi: -pi/2}}]\nelements:\n"
                         "  - {pin: O, body: [arm, ground], at: [[-1, 0], [0, 0]]}\n"
                         "  - {gravity: g, acceleration: [0, -1]}\n"
                         "  - {torque: M, body: [arm, ground], value: T}\n"
                         "  - {rotational-spring: s, body: [arm, ground], stiffness: k, damping: 0.2}\n");
  cli_good (
      "pinwheel steady @/arm.yaml --vary T=-2:2 -o @/turns/steady.csv --json @/turns/steady.json --plots @/turns");
  cli_shows ("arm: 1 branch of ");
  cli_shows ("       1  fold                        1        0 ");
  assert_int_equal (steady_lines ("1,fold,"), 2);
  cli_good ("pinwheel steady @/arm.yaml --set k=0.02 --vary T=-3:3 --starts 0");
  cli_shows ("       1  ends                         3 ");
  cli_shows ("       2  ends                        -3 ");
}

/* Where the speed is 0, any angle of the trailer is an equilibrium, and no velocities are left: there the eigenvalue
 * -u/1.3 of the trailer changes its sign, and -m a u/(I + m a^2) of the sleigh, whatever the range. */
TEST (standstill) {
  static const char *const each[] = { "trailer.yaml --vary u=-3:3", "trailer.yaml --vary u=3:-2",
                                      "trailer.yaml --vary u=-5:1", "sleigh.yaml --vary u=-1:2",
                                      "sleigh.yaml --vary u=-3:1" };
  cli_write ("trailer.yaml", "pinwheel: 1\nparameters: [{name: u, value: -1}]\nbodies:\n"
                             "  - {name: tractor, mass: 2, inertia: 1, rate: {vx: u}}\n"
                             "  - {name: trailer, mass: 1, inertia: 0.5, start: {phi: 0}}\nelements:\n"
                             "  - {wheel: rear, body: tractor, at: [0, 0]}\n"
                             "  - {wheel: front, body: tractor, at: [0.5, 0]}\n"
                             "  - {speed: engine, body: tractor, at: [0, 0], value: u}\n"
                             "  - {pin: hitch, body: [tractor, trailer], at: [[0, 0], [1.3, 0]]}\n"
                             "  - {wheel: axle, body: trailer, at: [0, 0]}\n");
  cli_write ("sleigh.yaml",
             "pinwheel: 1\nparameters: [{name: u, value: 2}]\n"
             "bodies: [{name: s, mass: 2, inertia: 0.4, rate: {vx: u}}]\nelements:\n"
             "  - {speed: e, body: s, at: [-0.3, 0], value: u}\n  - {wheel: w, body: s, at: [-0.3, 0]}\n");
  for (size_t k = 0; k < sizeof each / sizeof *each; k++) {
    int events = 0;
    cli_good (check_text (
        "pinwheel steady @/%s --starts 0 -o @/still/steady.csv --json @/still/steady.json --plots @/still", each[k]));
    for (const char *line = strchr (cli_file ("still/steady.csv"), '\n') + 1; *line; line = strchr (line, '\n') + 1) {
      if (strncmp (line, "1,point,", 8) == 0) continue;
      assert_int_equal (strncmp (line, "1,zero eigenvalue,", 18), 0);
      check_close ("u", table_number (line, 2), 0, 1e-9, "located to 1e-9 of a step of 0.1 m/s");
      check_close ("growing", table_number (line, 3), 0, 0, "without the one that changes");
      events++;
    }
    assert_int_equal (events, 1);
  }
  cli_good ("pinwheel steady @/trailer.yaml --vary u=-3:0 --starts 0");
  cli_shows ("       1  ends                        0 ");
}

/* Without modes but rigid displacements there is a figure, too, and no message of gnuplot. */
TEST (without_modes) {
  cli_write ("tricycle.yaml", "pinwheel: 1\nparameters: [{name: steer, value: 0.2}]\n"
                              "bodies: [{name: car, mass: 2, inertia: 1, rate: {vx: 1}}]\nelements:\n"
                              "  - {wheel: rear, body: car, at: [-0.4, 0]}\n"
                              "  - {wheel: front, body: car, at: [0.5, 0], heading: steer}\n"
                              "  - {speed: engine, body: car, at: [-0.4, 0], value: 1}\n");
  cli_good ("pinwheel steady @/tricycle.yaml --vary steer=-0.5:0.5 -o @/tricycle/steady.csv --json "
            "@/tricycle/steady.json --plots @/tricycle");
  assert_string_equal (cli_err, "");
  const char *svg = cli_file ("tricycle/steady.svg");
  assert_true (svg && strstr (svg, "unstable") && !strstr (svg, "stability changes") && !strstr (svg, "fold"));
}

/* Signals that stop changing: from then on there are steady motions. */
TEST (ramp) {
  cli_write ("ramp.yaml", "pinwheel: 1\nrun: {t_end: 5}\nbodies: [{name: car, mass: 2, inertia: 1, rate: {vx: 1}}]\n"
                          "elements:\n  - {wheel: rear, body: car, at: [-0.4, 0]}\n"
                          "  - {steered-wheel: front, body: car, at: [0.5, 0], "
                          "heading: {ramp: {to: 0.2, start: 1/3, duration: 2}}}\n"
                          "  - {drag: D, body: car, linear: 0.5, turning: 0.1}\n"
                          "  - {force: F, body: car, axes: body, fx: {pulse: {height: 1, start: 1, width: 0.5}}}\n"
                          "  - {force: G, body: car, axes: body, fx: 1}\n");
  cli_bad ("pinwheel steady @/ramp.yaml", 2,
           "model ramp: signal front.heading changes with time, but after 2.33333336 s no signal does: give --at "
           "2.33333336");
  cli_good ("pinwheel steady @/ramp.yaml --at 2.33333336 --starts 0");
  cli_shows ("     1          1.96413           0.442387 ");
}

/* The ends of branches are those of the range to the last bit; the motion is found once, whatever angle it is found
 * at. */
TEST (ends) {
  cli_good ("pinwheel steady pendulum --vary l=0.7:1.3 --starts 0 -o @/ends/steady.csv --json @/ends/steady.json "
            "--plots @/ends");
  const char *line = strchr (cli_file ("ends/steady.csv"), '\n') + 1;
  assert_true (table_number (line, 2) == 0.7);
  for (const char *next; *(next = strchr (line, '\n') + 1);) line = next;
  assert_true (table_number (line, 2) == 1.3);
  cli_good ("pinwheel steady @/circle.yaml --vary p=0.5:2 --starts 0 -o @/ends/steady.csv --json @/ends/steady.json "
            "--plots @/ends");
  line = strchr (cli_file ("ends/steady.csv"), '\n') + 1;
  for (const char *next; *(next = strchr (line, '\n') + 1);) line = next;
  assert_true (table_number (line, 2) == 0.5);
  cli_write ("damped.yaml", "pinwheel: 1\nparameters: [{name: c_d, value: 0.5, domain: nonnegative}]\n"
                            "bodies: [{name: rod, mass: 1, inertia: 1}]\nelements:\n"
                            "  - {pin: O, body: [ground, rod], at: [[0, 0], [0, 0]]}\n"
                            "  - {rotational-spring: s, body: [rod, ground], stiffness: 3, damping: c_d}\n");
  cli_good ("pinwheel steady @/damped.yaml --vary c_d=1:0 --starts 0 -o @/ends/steady.csv --json @/ends/steady.json "
            "--plots @/ends");
  cli_shows ("damped: 1 branch of steady motions");
  assert_non_null (strstr (cli_file ("ends/steady.svg"), ">c_d<")); /* plain text, without a subscript */
  line = strchr (cli_file ("ends/steady.csv"), '\n') + 1;
  for (const char *next; *(next = strchr (line, '\n') + 1);) line = next;
  assert_true (table_number (line, 2) == 0);
  cli_good ("pinwheel steady pendulum --starts 60");
  cli_shows ("pendulum: 2 steady motions, ");
}

/* At rest the resistance and its derivative are 0: the velocity is exactly 0 as well. */
TEST (rest) {
  cli_write ("rest.yaml", "pinwheel: 1\nbodies: [{name: b, mass: 1, inertia: 1, rate: {vx: 1}}]\nelements:\n"
                          "  - {slider: rail, body: [b, ground], at: [[0, 0], [0, 0]]}\n"
                          "  - {drag: air, body: b, quadratic: 1}\n");
  cli_good ("pinwheel steady @/rest.yaml --starts 5 -o @/rest/steady.csv --json @/rest/steady.json --plots @/rest");
  cli_shows ("rest: 1 steady motion up to 1 symmetry, ");
  check_close ("speed", cli_number (cli_file ("rest/steady.json"), "motions", "state", "b.vx", NULL), 0, 0, "exact");
  /* there residuals grow with the third power of velocities, so that Newton's method ends before it reaches rest */
  cli_write ("axles.yaml", "pinwheel: 1\nbodies: [{name: b, mass: 2, inertia: 0.4, rate: {vx: 0.2, omega: 0.3}}]\n"
                           "elements:\n  - {wheel: w, body: b, at: [-0.5, -0.2]}\n"
                           "  - {tyre: f, body: b, at: [0.2, 0.3], heading: 0.3, stiffness: 8, speed: 0.5}\n");
  cli_good ("pinwheel steady @/axles.yaml");
  cli_shows ("axles: 1 steady motion up to 3 symmetries");
  cli_shows ("       1              0                0        1        0 ");
}

/* Straight ahead the hinges decay at u / L; the motion of the model is a turn. */
TEST (linearise) {
  cli_good ("pinwheel linearise n-trailer --steady --hold tractor.speed=3 --hold tractor.omega=0");
  cli_shows ("n-trailer, steady motion at t = 0 s: 7 minimal coordinates");
  cli_shows ("     6         -3.75 ");
  cli_shows ("     7            -5 ");
  cli_good ("pinwheel linearise pendulum --steady");
  cli_shows ("     1             0           3.1321 ");
  cli_bad ("pinwheel linearise theo-jansen --steady -o @/none", 4,
           "theo-jansen: no steady motion is reached from the initial state: the last residual is 1, in units of the "
           "scene; `pinwheel "
           "steady` also begins at random states");
  assert_null (cli_file ("none.json"));
}

/* Search and linearisation need constant signals for the same time, t_end after --at. */
TEST (linearise_later) {
  cli_write ("later.yaml", "pinwheel: 1\nrun: {t_end: 1}\nbodies: [{name: block, mass: 1, inertia: 1}]\nelements:\n"
                           "  - {slider: rail, body: [block, ground], at: [[0, 0], [0, 0]], heading: 0}\n"
                           "  - {drag: D, body: block, linear: 0.5, turning: 0.1}\n"
                           "  - {force: F, body: block, fx: {pulse: {height: 1, start: 7, width: 0.5}}}\n");
  cli_good ("pinwheel linearise @/later.yaml --steady --at 5");
  cli_shows ("The motion is steady\n");
  assert_int_equal (cli_run ("pinwheel linearise @/later.yaml --steady --at 6.5"), 2);
}

TEST (limit) {
  cli_bad ("pinwheel steady n-trailer --limit 1e-9 -o @/limit/steady.csv --json @/limit/steady.json --plots @/limit", 4,
           "--limit 1e-9: stopped; results are incomplete");
}

/* An oscillator on a car that turns at 1 rad/s: the frequency of a Hopf event is its own, not that of the frame. */
TEST (hopf_in_a_turn) {
  cli_write ("turn.yaml", "pinwheel: 1\nparameters: [{name: p, value: 0.2}]\nbodies:\n"
                          "  - {name: car, mass: 2, inertia: 1, rate: {vx: 3, omega: 1}}\n"
                          "  - {name: arm, mass: 1, inertia: 1, rate: {vx: 3, omega: 1}}\nelements:\n"
                          "  - {pin: P, body: [car, arm], at: [[0, 0], [0, 0]]}\n"
                          "  - {wheel: rear, body: car, at: [0, 0]}\n"
                          "  - {wheel: front, body: car, at: [1, 0], heading: atan(1/3)}\n"
                          "  - {speed: engine, body: car, at: [0, 0], value: 3}\n"
                          "  - {torque: s, body: [arm, car], "
                          "value: \"-0.25*(arm.phi - car.phi) - (p - 0.1)*(arm.omega - car.omega)\"}\n");
  cli_good ("pinwheel steady @/turn.yaml --vary p=-0.2:0.3 --starts 0");
  cli_shows ("        0                0       0.0795775\n");
}

/* A parameter of a model in C need not have a unit. */
TEST (without_unit) {
  cli_write ("unitless.c", "#include \"pinwheel.h\"\ntypedef struct { double v; } numbers;\n"
                           "static const pw_parameter list[] = { { PW_AT (numbers, v), 1 }, { .name = NULL } };\n"
                           "static void build (pw_model *m, const void *p) {\n"
                           "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1,\n"
                           "                              .rate = { ((const numbers *)p)->v, 0, 0 } });\n"
                           "  pw_add_wheel (m, &(pw_wheel){ .name = \"W\", .body = \"a\" });\n"
                           "}\n"
                           "PW_MODEL (.about = \"a wheel\", .parameters = list, .parameters_size = sizeof (numbers),\n"
                           "          .build = build);\n");
  cli_shell ("pinwheel steady @/unitless.c --vary v=1:2 --starts 0 -o @/unitless/steady.csv --json "
             "@/unitless/steady.json --plots @/unitless");
  assert_int_equal (strncmp (cli_file ("unitless/steady.csv"), "branch,event,v,growing,", 23), 0);
  cli_good ("pinwheel sensitivity @/unitless.c --of a.x --by v -t 1");
  cli_shows ("  v                          1             1  m ");
}

TEST (bad) {
  static const cli_wrong each[] = {
    { "n-trailer --hold tractor.radus=1",
      "model n-trailer has no state \"tractor.radus\"; did you mean \"tractor.radius\"?" },
    { "n-trailer --hold tractor.speed", "--hold tractor.speed: expected STATE=VALUE" },
    { "n-trailer --hold tractor.speed=fast", "--hold tractor.speed=fast: \"fast\" is not a number" },
    { "n-trailer --hold tractor.x=1 --hold tractor.x=2", "--hold tractor.x=2: tractor.x is held already" },
    { "n-trailer --vary m=1", "--vary m=1: expected NAME=LOW:HIGH[:COUNT][:log], numbers" },
    { "n-trailer --vary m=1:1", "--vary m=1:1: expected two different numbers" },
    { "n-trailer --vary m=0:1", "--vary m=0:1: expected a number > 0" },
    { "n-trailer --set m=1 --vary m=1:2", "m is given by --vary and by --set" },
    { "n-trailer --vary n=1:3", "--vary n=1:3: n counts something and cannot vary continuously; use `pinwheel sweep`" },
    { "n-trailer --vary mm=1:3", "model n-trailer has no parameter \"mm\"; did you mean \"m0\"?" },
    { "n-trailer --starts -1", "--starts -1: expected a whole number >= 0" },
    { "snakeboard", "model snakeboard: signal swing.value changes with time, so that there are no steady motions; "
                    "`pinwheel periodic` finds periodic ones" },
    { "chain --set n=200", "model chain has 600 coordinates; steady motions are sought with at most 400" },
  };
  cli_bad_each ("steady", each, sizeof each / sizeof *each);
  cli_bad ("pinwheel steady theo-jansen --starts 3", 4,
           "theo-jansen: no steady motion found: from the initial state the residual ends at 1, from 3 random states "
           "at 1 at "
           "best, in units of the scene (L, L/T, L/T^2); change what is held, or begin nearer to one (--start)");
  cli_bad ("pinwheel steady slider-crank --set theta=pi/2", 3,
           "model slider-crank: the initial configuration is singular: pin B (B.Fy) follows from pin A, pin C, drive "
           "guide, but not nearby; begin slightly off it");
  cli_bad ("pinwheel linearise n-trailer --hold tractor.speed=1", 2, "--hold needs --steady");
}

const check_fixture fixture = { cli_setup, cli_teardown };
