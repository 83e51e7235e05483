/* `pinwheel periodic`: text, files, bad input. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

static const char oscillator[] =
    "pinwheel: 1\n"
    "parameters:\n"
    "  - {name: A, value: 0.2}\n"
    "  - {name: w, value: 0.8}\n"
    "  - {name: mu, value: 0}\n"
    "  - {name: n, value: 1, domain: count}\n"
    "bodies:\n"
    "  - {name: rod, mass: 1, inertia: 1}\n"
    "elements:\n"
    "  - {pin: O, body: [ground, rod], at: [[0, 0], [0, 0]]}\n"
    "  - {torque: drive, body: [rod, ground], value: {harmonic: {amplitude: A, omega: w}}}\n"
    "  - torque: law\n"
    "    body: [rod, ground]\n"
    "    value: \"mu > 0 ? mu*(1 - rod.phi^2)*rod.omega - rod.phi : -sin(rod.phi) - 0.1*rod.omega\"\n";

TEST (motion) {
  cli_write ("oscillator.yaml", oscillator);
  cli_good ("pinwheel periodic @/oscillator.yaml -o @/one/periodic.csv --json @/one/periodic.json --plots @/one");
  cli_shows ("oscillator: a periodic motion\n");
  cli_shows ("  period                       7.85398163 s, of the signals\n");
  cli_shows ("  Floquet multipliers          0.265099 +- 0.621016 i, modulus 0.675232\n");
  cli_shows ("stable: perturbations shrink to 0.675232 or less per period\n");
  const char *json = cli_file ("one/periodic.json");
  assert_true (cli_says (json, "model", "oscillator"));
  check_close ("phi", cli_number (json, "motions", "start", "rod.phi", NULL), 0.5982763426814, 1e-11, "run at 1e-12");
  check_close ("re", cli_number (json, "motions", "multipliers", "re", NULL), 0.265099104796, 2e-8,
               "steps of the derivatives: 1e-9 each");
  assert_non_null (cli_file ("one/periodic.dat"));
  assert_non_null (strstr (cli_file ("one/periodic.gp"), "\ny_1 = 'y [m]'\n"));
  assert_non_null (strstr (cli_file ("one/periodic.gp"), "\ny_3 = 'imaginary part'\nscale_3 = ''\n"));
}

/* A vehicle without multipliers but those of symmetries: a figure of its path. */
TEST (without_multipliers) {
  cli_write ("tricycle.yaml", "pinwheel: 1\nparameters: [{name: steer, value: 0.2}]\n"
                              "bodies: [{name: car, mass: 2, inertia: 1, rate: {vx: 1}}]\nelements:\n"
                              "  - {wheel: rear, body: car, at: [-0.4, 0]}\n"
                              "  - {wheel: front, body: car, at: [0.5, 0], heading: steer}\n"
                              "  - {speed: engine, body: car, at: [-0.4, 0], "
                              "value: {harmonic: {amplitude: 0.3, omega: 4, offset: 1}}}\n");
  cli_good ("pinwheel periodic @/tricycle.yaml -o @/path/periodic.csv --json @/path/periodic.json --plots @/path");
  assert_string_equal (cli_err, "");
  cli_good ("pinwheel periodic @/tricycle.yaml --vary steer=0.1:0.3 -o @/path/periodic.csv --json @/path/periodic.json "
            "--plots @/path");
  assert_string_equal (cli_err, "");
  assert_non_null (cli_file ("path/periodic.svg"));
  cli_write ("fixed.yaml", "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\nelements:\n"
                           "  - {weld: W, body: [a, ground], at: [[0, 0], [0, 0]]}\n");
  cli_good ("pinwheel periodic @/fixed.yaml --period 1");
  assert_string_equal (cli_err, "");
  assert_int_equal (strncmp (cli_out, "fixed: a periodic motion\n", 25), 0); /* no message of LAPACK */
}

/* Twice the period: the multipliers are squared. */
TEST (periods) {
  cli_good (
      "pinwheel periodic @/oscillator.yaml --periods 2 -o @/two/periodic.csv --json @/two/periodic.json --plots @/two");
  const char *json = cli_file ("two/periodic.json");
  check_close ("re", cli_number (json, "motions", "multipliers", "re", NULL),
               0.265099104796 * 0.265099104796 - 0.621015774681 * 0.621015774681, 4e-8,
               "steps of the derivatives: 1e-9 each");
  /* also where the branch begins, at a value without a signal that changes */
  cli_good ("pinwheel periodic @/oscillator.yaml --periods 2 --vary A=0:0.2 -o @/two/periodic.csv --json "
            "@/two/periodic.json --plots @/two");
  double period;
  assert_int_equal (sscanf (strchr (cli_file ("two/periodic.csv"), '\n'), "\n0,point,%lf", &period), 1);
  check_close ("period", period, 5 * PW_PI, 16 * CHECK_EPS * period, "twice 2 pi / 0.8");
}

TEST (free_period) {
  cli_good ("pinwheel periodic @/oscillator.yaml --set A=0 --set mu=1 --start rod.phi=2 --period free");
  cli_shows ("  period                       6.66328686 s, found\n");
  cli_shows ("  trivial multipliers          1, of a shift in time\n");
  cli_good ("pinwheel periodic @/oscillator.yaml --set A=0 --set mu=1 --start rod.phi=2 --period free --guess 6.7");
  cli_shows ("  period                       6.66328686 s, found\n");
}

/* A disc beside a pendulum that runs round: its angle is a symmetry. */
TEST (trivial) {
  cli_write ("disc.yaml", "pinwheel: 1\n"
                          "bodies:\n"
                          "  - {name: bob, mass: 1, start: {x: 0, y: -1}, rate: {vx: 5, omega: 5}}\n"
                          "  - {name: disc, mass: 1, inertia: 1}\n"
                          "elements:\n"
                          "  - {pin: pivot, body: [bob, ground], at: [[0, 1], [0, 0]]}\n"
                          "  - {gravity: gravity, acceleration: [0, -1]}\n"
                          "  - {friction: air, body: [bob, ground], viscous: 0.1}\n"
                          "  - {torque: drive, body: [bob, ground], value: 0.5}\n"
                          "  - {pin: axle, body: [disc, ground], at: [[0, 0], [3, 0]]}\n"
                          "  - {friction: bearing, body: [disc, ground], viscous: 0.1}\n");
  cli_good ("pinwheel periodic @/disc.yaml --period free");
  cli_shows ("  trivial multipliers          2, of symmetries and a shift in time\n");
  cli_shows ("  rotation per period          0 rad\n  relative to the whole        bob: 1 whole turn\n  mean speed ");
}

/* A flywheel on a driven pendulum, and rolling wheels: their free rotations are named, as the figure shows them. */
TEST (free_rotation) {
  cli_write ("flywheel.yaml",
             "pinwheel: 1\n"
             "bodies:\n"
             "  - {name: bob, mass: 1, inertia: 1, start: {y: -1}}\n"
             "  - {name: flywheel, mass: 1, inertia: 0.1, start: {y: -2}, rate: {omega: 2}}\n"
             "elements:\n"
             "  - {pin: pivot, body: [bob, ground], at: [[0, 1], [0, 0]]}\n"
             "  - {pin: axle, body: [flywheel, bob], at: [[0, 0], [0, -1]]}\n"
             "  - {gravity: gravity, acceleration: [0, -1]}\n"
             "  - {torque: drive, body: [bob, ground], value: {harmonic: {amplitude: 0.1, omega: 4}}}\n");
  cli_good ("pinwheel periodic @/flywheel.yaml -o @/flywheel/periodic.csv --json @/flywheel/periodic.json --plots "
            "@/flywheel");
  cli_shows ("  relative to the whole        flywheel: a free rotation by 3.14159 rad\n");
  const char *json = cli_file ("flywheel/periodic.json");
  check_close ("rotation", cli_number (json, "motions", "rotations", "flywheel", NULL), PW_PI, 1e-9,
               "2 rad/s for pi/2 s");
  check_close ("bob", cli_number (json, "motions", "rotations", "bob", NULL), 0, 0, "rounded");
  cli_write ("rolls.yaml", "pinwheel: 1\nbodies: [{name: car, mass: 2, inertia: 1, rate: {vx: 1}}]\nelements:\n"
                           "  - {rolling-wheel: rear, body: car, at: [-0.4, 0], radius: 0.1, inertia: 0.01}\n"
                           "  - {wheel: front, body: car, at: [0.5, 0]}\n"
                           "  - {speed: engine, body: car, at: [-0.4, 0], "
                           "value: {harmonic: {amplitude: 0.3, omega: 4, offset: 1}}}\n");
  cli_good ("pinwheel periodic @/rolls.yaml");
  cli_shows ("  relative to the whole        rear.spin: a free rotation by 15.708 rad\n");
}

/* A pendulum that runs round: its multiplier is exp (-0.1 T) (Liouville).  A spring counts the turns. */
TEST (turns) {
  cli_write ("running.yaml", "pinwheel: 1\n"
                             "parameters: [{name: k, value: 0}]\n"
                             "bodies:\n"
                             "  - {name: bob, mass: 1, start: {x: 0, y: -1}, rate: {vx: 5, omega: 5}}\n"
                             "elements:\n"
                             "  - {pin: pivot, body: [bob, ground], at: [[0, 1], [0, 0]]}\n"
                             "  - {gravity: gravity, acceleration: [0, -1]}\n"
                             "  - {friction: air, body: [bob, ground], viscous: 0.1}\n"
                             "  - {torque: drive, body: [bob, ground], value: 0.5}\n"
                             "  - {rotational-spring: spring, body: [ground, bob], stiffness: k}\n");
  cli_good ("pinwheel periodic @/running.yaml --period free -o @/running/periodic.csv --json @/running/periodic.json "
            "--plots @/running");
  const char *json = cli_file ("running/periodic.json");
  double T = cli_number (json, "motions", "period", NULL);
  check_close ("multiplier", cli_number (json, "motions", "multipliers", "re", NULL), exp (-0.1 * T), 2e-8,
               "steps of the derivatives: 1e-9 each");
  check_close ("turn",
               cli_number (json, "motions", "end", "bob.phi", NULL) -
                   cli_number (json, "motions", "start", "bob.phi", NULL),
               2 * PW_PI, 1e-9, "Newton to round-off");
  assert_int_equal (cli_run ("pinwheel periodic @/running.yaml --set k=1e-3 --period free"), 4);
  assert_non_null (strstr (cli_err, "bodies make whole turns in a period, on whose number forces depend"));
}

/* A stable gait that turns the vehicle by 3.84 rad in each period, as a run of 100 periods does, too. */
TEST (turning_gait) {
  cli_good ("pinwheel periodic tests/scenes/turning-gait.yaml");
  cli_shows ("  rotation per period          3.84049 rad\n");
  cli_shows ("     2.8869602\n");
}

/* The branch through both folds, and one row of the table for each point. */
TEST (branch) {
  int rows = 0, folds = 0;
  cli_good ("pinwheel periodic @/oscillator.yaml --vary A=0.1:0.35 -o @/branch/periodic.csv --json "
            "@/branch/periodic.json --plots @/branch");
  cli_shows ("  fold              0.255190316 ");
  cli_shows ("  fold              0.146046589 ");
  const char *csv = cli_file ("branch/periodic.csv");
  assert_int_equal (strncmp (csv, "A,event,period [s],displacement [m],rotation [rad],growing,residual,rod.x [m],", 76),
                    0);
  for (const char *line = strchr (csv, '\n') + 1; *line; line = strchr (line, '\n') + 1, rows++)
    folds += strncmp (strchr (line, ','), ",fold,", 6) == 0;
  assert_true (rows > 20);
  assert_int_equal (folds, 2);
  assert_non_null (strstr (cli_file ("branch/periodic.gp"), "\nx_1 = 'A'\n"));
}

/* All seven pairs of multipliers of seven oscillators are shown. */
TEST (pairs) {
  char text[4000];
  int n = snprintf (text, sizeof text, "pinwheel: 1\nbodies:\n");
  for (int i = 1; i <= 7; i++)
    n += snprintf (text + n, sizeof text - (size_t)n, "  - {name: b%d, mass: 1, inertia: 1}\n", i);
  n += snprintf (text + n, sizeof text - (size_t)n, "elements:\n");
  for (int i = 1; i <= 7; i++)
    n += snprintf (text + n, sizeof text - (size_t)n,
                   "  - {pin: p%d, body: [ground, b%d], at: [[0, 0], [0, 0]]}\n"
                   "  - {rotational-spring: s%d, body: [b%d, ground], stiffness: 0.%d, damping: 0.2}\n",
                   i, i, i, i, i);
  snprintf (text + n, sizeof text - (size_t)n,
            "  - {torque: T, body: [b1, ground], value: {harmonic: {amplitude: 1, omega: 1}}}\n");
  cli_write ("pairs.yaml", text);
  cli_good ("pinwheel periodic @/pairs.yaml");
  assert_null (strstr (cli_out, "..."));
  int pairs = 0;
  for (const char *at = cli_out; (at = strstr (at, " i, modulus ")) != NULL; at++) pairs++;
  assert_int_equal (pairs, 7);
}

/* A branch over the damping of a driven oscillator from 0 to 1, the end of its domain, and back. */
TEST (domain) {
  cli_write ("damped.yaml", "pinwheel: 1\nparameters: [{name: c, value: 0.5, domain: nonnegative}]\n"
                            "bodies: [{name: rod, mass: 1, inertia: 1}]\nelements:\n"
                            "  - {pin: O, body: [ground, rod], at: [[0, 0], [0, 0]]}\n"
                            "  - {rotational-spring: s, body: [rod, ground], stiffness: 3, damping: c}\n"
                            "  - {torque: drive, body: [rod, ground], value: {harmonic: {amplitude: 1, omega: 1}}}\n");
  cli_good ("pinwheel periodic @/damped.yaml --vary c=0:1");
  cli_shows ("  ends                        1      6.283185");
  cli_good ("pinwheel periodic @/damped.yaml --vary c=1:0");
  cli_shows ("  ends                        0      6.283185");
}

/* A driven pendulum loses its symmetry at A = 1.00431948, where det (M - 1) of its own equation, by RK4, vanishes. */
TEST (pitchfork) {
  cli_write ("driven.yaml",
             "pinwheel: 1\n"
             "parameters: [{name: A, value: 0.5}]\n"
             "bodies: [{name: bob, mass: 1, inertia: 1}]\n"
             "elements:\n"
             "  - {pin: pivot, body: [bob, ground], at: [[0, 0], [0, 0]]}\n"
             "  - {torque: weight, body: [bob, ground], value: -sin(bob.phi)}\n"
             "  - {friction: air, body: [bob, ground], viscous: 0.5}\n"
             "  - {torque: drive, body: [bob, ground], value: {harmonic: {amplitude: A, omega: 2/3}}}\n");
  static const char *const command[] = { "pinwheel periodic @/driven.yaml --vary A=0.5:1.2",
                                         "pinwheel periodic @/driven.yaml --vary A=0.9:1.2" };
  for (size_t k = 0; k < sizeof command / sizeof *command; k++) {
    cli_good (command[k]);
    cli_shows ("  branch point       1.004319");
    if (strstr (cli_out, "fold")) fail_msg ("a fold in\n%s", cli_out);
  }
}

/* The dampings of two oscillators vanish within one step, at p = 0.31 and 0.33. */
TEST (two_events) {
  int events = 0;
  cli_write ("two.yaml", "pinwheel: 1\n"
                         "parameters: [{name: p, value: 0.1}]\n"
                         "bodies: [{name: a, mass: 1, inertia: 1}, {name: b, mass: 1, inertia: 1}]\n"
                         "elements:\n"
                         "  - {pin: A, body: [a, ground], at: [[0, 0], [0, 0]]}\n"
                         "  - {pin: B, body: [b, ground], at: [[0, 0], [0, 0]]}\n"
                         "  - {torque: ta, body: [a, ground], value: -2*a.phi + (p - 0.31)*a.omega}\n"
                         "  - {torque: tb, body: [b, ground], value: -5*b.phi + (p - 0.33)*b.omega}\n"
                         "  - {torque: drive, body: [a, ground], value: {harmonic: {amplitude: 0.1, omega: 1}}}\n");
  cli_good (
      "pinwheel periodic @/two.yaml --vary p=0.1:2 -o @/two/periodic.csv --json @/two/periodic.json --plots @/two");
  for (const char *line = cli_file ("two/periodic.csv"); *line; line = strchr (line, '\n') + 1) {
    char *end;
    double p = strtod (line, &end);
    if (strncmp (end, ",Neimark-Sacker,", 16)) continue;
    check_close ("p", p, 0.31 + 0.02 * events++, 1e-7, "the accuracy of a location, steps of 0.1");
  }
  assert_int_equal (events, 2);
}

/* The heading of a wheel, and with it the consistent initial states, depend on the parameter. */
TEST (constraint) {
  cli_write (
      "gait.yaml",
      "pinwheel: 1\n"
      "parameters: [{name: off, value: 0.1}]\n"
      "bodies:\n"
      "  - {name: car, mass: 8, inertia: 1, start: {x: 0, y: 0, phi: 0}, rate: {vx: 1}}\n"
      "elements:\n"
      "  - {wheel: W, body: car, at: [0, 0]}\n"
      "  - {steered-wheel: S, body: car, at: [0.6, 0], heading: {harmonic: {amplitude: 0.2, omega: 2, offset: off}}}\n"
      "  - {force: push, body: car, fx: cos(car.phi), fy: sin(car.phi)}\n"
      "  - {drag: D, body: car, linear: 2, quadratic: 1}\n");
  cli_good ("pinwheel periodic @/gait.yaml --vary off=0.1:0.3");
  cli_shows ("  ends                      0.3");
}

/* Where the drive vanishes, no signal has a period: the branch keeps that of the motion before. */
TEST (vanishing_drive) {
  cli_good ("pinwheel periodic @/oscillator.yaml --vary A=0.2:0");
  cli_shows ("  ends                        0      7.853982                 0               0             0 ");
  cli_write ("still.yaml", "pinwheel: 1\nparameters: [{name: A, value: 0}]\n"
                           "bodies: [{name: rod, mass: 1, inertia: 1}]\nelements:\n"
                           "  - {pin: O, body: [ground, rod], at: [[0, 0], [0, 0]]}\n"
                           "  - {rotational-spring: s, body: [rod, ground], stiffness: 3, damping: 1}\n"
                           "  - {torque: drive, body: [rod, ground], value: {harmonic: {amplitude: A, omega: 1}}}\n");
  cli_write ("shaken.yaml", "pinwheel: 1\nparameters: [{name: A, value: 1}]\n"
                            "bodies: [{name: skate, mass: 1, inertia: 1}]\nelements:\n"
                            "  - {wheel: edge, body: skate, at: [0, 0]}\n"
                            "  - {drag: air, body: skate, linear: 1, turning: 1}\n"
                            "  - {force: hand, body: skate, fx: {harmonic: {amplitude: A, omega: 2*pi}}}\n");
  cli_good ("pinwheel periodic @/still.yaml --vary A=1:2");
  cli_shows ("  ends                        2      6.283185 ");
  cli_good ("pinwheel periodic @/still.yaml --vary A=0:2");
  cli_shows ("  begins                      0      6.283185 ");
  cli_shows ("  ends                        2      6.283185 ");
  cli_good ("pinwheel periodic @/shaken.yaml --vary A=0:1");
  cli_shows ("shaken: a branch of periodic motions up to 2 symmetries, A from 0 to 1, ");
  cli_shows ("  ends                        1             1 ");
}

/* Symmetries are those of the range: without the stiffness of the model's own value the body could be anywhere. */
TEST (symmetries_of_range) {
  cli_write ("held.yaml", "pinwheel: 1\nparameters: [{name: k, value: 0}]\n"
                          "bodies: [{name: bob, mass: 1, inertia: 1, start: {x: 0.3}, rate: {vx: 0.1}}]\nelements:\n"
                          "  - {spring: s, body: [bob, ground], at: [[0, 0], [-2, 0]], stiffness: k, length: 2}\n"
                          "  - {drag: air, body: bob, linear: 0.5}\n"
                          "  - {force: drive, body: bob, fx: {harmonic: {amplitude: 1, omega: 2}}}\n");
  cli_good ("pinwheel periodic @/held.yaml --vary k=0.5:1");
  cli_shows ("held: a branch of periodic motions up to 1 symmetry, k from 0.5 to 1, ");
  cli_shows ("  begins                    0.5      3.141593                 0 ");
  cli_shows ("  ends                        1      3.141593                 0 ");
}

TEST (limit) {
  cli_bad (
      "pinwheel periodic snakeboard --limit 1e-9 -o @/limit/periodic.csv --json @/limit/periodic.json --plots @/limit",
      4, "--limit 1e-9: stopped; results are incomplete");
  /* in the search, and on the branch: by far less than the 0.6 s and 1.3 s that these take without a limit */
  cli_bad ("pinwheel periodic snakeboard --limit 0.01", 4, "--limit 0.01: stopped; results are incomplete");
  cli_bad ("pinwheel periodic @/oscillator.yaml --vary w=0.5:1 --limit 0.03", 4,
           "--limit 0.03: stopped; results are incomplete");
}

TEST (bad) {
  static const cli_wrong each[] = {
    { "snakeboard --period 1.9", "model snakeboard: signal swing.value does not repeat after 1.9 s; if no period is "
                                 "given, that of the harmonic signals and pulses is used" },
    { "snakeboard --period 1e-308", "--period: expected at least 1e-100 s" },
    { "snakeboard --period free",
      "model snakeboard: signal swing.value changes with time, so the period cannot be free" },
    { "snakeboard --period fast", "--period: \"fast\" is not a number" },
    { "snakeboard --period -1", "--period -1: expected a number > 0" },
    { "snakeboard --periods 0", "--periods 0: expected a whole number >= 1" },
    { "snakeboard --periods 1e6", "--periods 1e6: expected at most 100000" },
    { "snakeboard --periods 2 --period 4", "--periods 2: not together with --period" },
    { "snakeboard --method rk4",
      "method rk4: periodic motions need one that controls its steps, such as erk8+projection" },
    { "snakeboard --guess 2", "--guess 2: only with --period free" },
    { "pendulum",
      "pendulum: no signal has a known period (those of expressions and tables are not known): give --period T, or "
      "--period free if no signal changes with time" },
    { "snakeboard --vary m=1", "--vary m=1: expected NAME=LOW:HIGH[:COUNT][:log], numbers" },
    { "snakeboard --vary m=0:1", "--vary m=0:1: expected a number > 0" },
    { "snakeboard --vary mm=1:3", "model snakeboard has no parameter \"mm\"; did you mean \"m\"?" },
    { "chain --set n=200 --period 1", "model chain has 600 coordinates; periodic motions are sought with at most 100" },
  };
  cli_bad_each ("periodic", each, sizeof each / sizeof *each);
  cli_write ("two.yaml", "pinwheel: 1\nbodies: [{name: b, mass: 1, inertia: 1}]\nelements:\n"
                         "  - {force: f, body: b, fx: {harmonic: {amplitude: 1, omega: 1}}}\n"
                         "  - {force: g, body: b, fx: {harmonic: {amplitude: 1, omega: sqrt(2)}}}\n");
  cli_bad ("pinwheel periodic @/two.yaml", 2,
           "two: the periods of its signals have no common multiple: give --period T");
  cli_bad ("pinwheel periodic @/oscillator.yaml --vary n=1:3", 2,
           "--vary n=1:3: n counts something and cannot vary continuously; use `pinwheel sweep`");
  cli_bad (
      "pinwheel periodic @/oscillator.yaml --period 2.5*pi --vary w=0.8:1", 2,
      "model oscillator: signal drive.value does not repeat after 7.85398163397 s; if no period is given, that of the "
      "harmonic signals and pulses is used");
}

/* Without losses the snakeboard is faster after each period; a pendulum at rest stays there. */
TEST (none) {
  assert_int_equal (
      cli_run ("pinwheel periodic snakeboard -o @/none/periodic.csv --json @/none/periodic.json --plots @/none"), 4);
  assert_non_null (strstr (cli_err,
                           "snakeboard: no periodic motion with period 2 s found: Newton's method, begun after this "
                           "many periods of a run, ends at this residual (in units of the scene, L and L/T): 0 ("));
  assert_non_null (strstr (cli_err, "add losses if the motion grows in every period"));
  assert_null (cli_file ("none/periodic.json"));
  cli_write ("grow.yaml", "pinwheel: 1\nparameters: [{name: w, value: pi}]\n"
                          "bodies: [{name: b, mass: 1, inertia: 1}]\nelements:\n  - {torque: T, body: [b, ground], "
                          "value: {harmonic: {amplitude: 1, omega: w, offset: 1}}}\n");
  assert_int_equal (cli_run ("pinwheel periodic @/grow.yaml --vary w=2:3"), 4);
  assert_non_null (strstr (cli_err, "no periodic motion with period 3.14159265 s found")); /* that of w = 2 */
  assert_int_equal (cli_run ("pinwheel periodic @/grow.yaml --vary w=2:3 --periods 3"), 4);
  assert_non_null (strstr (cli_err, "no periodic motion with period 9.42477796 s found"));
  assert_int_equal (cli_run ("pinwheel periodic @/grow.yaml --periods 5"), 4);
  assert_non_null (strstr (cli_err, "no periodic motion with period 10 s found"));
  assert_int_equal (cli_run ("pinwheel periodic @/oscillator.yaml --set A=0 --period free --guess 6"), 4);
  assert_non_null (strstr (cli_err, "Newton's method leads to a steady motion or an equilibrium"));
}

/* A force that changes with time, except in the initial state, and one that acts for a short time. */
TEST (vanishing) {
  cli_write ("grow.yaml", "pinwheel: 1\nbodies: [{name: m, mass: 1, inertia: 1, rate: {vx: 1}}]\nelements:\n"
                          "  - {force: f, body: m, fx: '-(1 + 0.5*cos (1.7*t))*m.x'}\n");
  cli_bad ("pinwheel periodic @/grow.yaml --period pi", 2,
           "model grow: signal f.fx does not repeat after 3.14159265359 s; if no period is given, that of the harmonic "
           "signals and pulses is used");
  cli_bad ("pinwheel periodic @/grow.yaml --period free", 2,
           "model grow: signal f.fx changes with time, so the period cannot be free");
  cli_write ("short.yaml", "pinwheel: 1\nbodies: [{name: m, mass: 1, inertia: 1}]\nelements:\n"
                           "  - {force: f, body: m, fx: {harmonic: {amplitude: 1, omega: 2*pi}}}\n"
                           "  - {force: g, body: m, fx: {pulse: {height: 1, start: 1.501, width: 0.002}}}\n");
  cli_bad (
      "pinwheel periodic @/short.yaml --period 1", 2,
      "model short: signal g.fx does not repeat after 1 s; if no period is given, that of the harmonic signals and "
      "pulses is used");
}

const check_fixture fixture = { cli_setup, cli_teardown };
