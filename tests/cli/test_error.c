/* `run --error`: stated errors contain the true ones; where none can be stated, the reason is given. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "runs.h"

/* phi (t) = cos (sqrt (k) t). */
static const char oscillator[] = "pinwheel: 1\n"
                                 "parameters: [{name: k, value: 4, unit: N m/rad}]\n"
                                 "bodies: [{name: disc, mass: 1, inertia: 1, start: {phi: 1}}]\n"
                                 "elements:\n"
                                 "  - {pin: axle, body: [disc, ground], at: [[0, 0], [0, 0]]}\n"
                                 "  - {rotational-spring: s, body: [disc, ground], stiffness: k}\n";

/* A double pendulum, released high: chaotic. */
static const char chaotic[] = "pinwheel: 1\n"
                              "bodies:\n"
                              "  - {name: a, mass: 1, inertia: 0.1, start: {phi: 2.5}}\n"
                              "  - {name: b, mass: 1, inertia: 0.1, start: {phi: 2.8}}\n"
                              "elements:\n"
                              "  - {gravity: g, acceleration: [0, -9.81]}\n"
                              "  - {pin: A, body: [a, ground], at: [[-0.5, 0], [0, 0]]}\n"
                              "  - {pin: B, body: [a, b], at: [[0.5, 0], [-0.5, 0]]}\n";

/* Every method at two tolerances or steps: phi (t) = cos (2 t). */
TEST (contains) {
  char name[40], command[200];
  int outside = 0, runs = 0;
  cli_write ("oscillator.yaml", oscillator);
  for (int i = 0; runs_method (i, name); i++)
    for (int k = 0; k < 2; k++) {
      const double t = 3;
      snprintf (command, sizeof command,
                "pinwheel run @/oscillator.yaml -m %s -t 3 --error --json @/s.json -o @/o.csv --rtol %g --step %g",
                name, k ? 1e-7 : 1e-4, k ? 1e-3 : 1e-2);
      cli_shell (command);
      const char *json = cli_file ("s.json");
      double phi = cli_number (json, "bodies", "disc", "phi", NULL),
             rate = cli_number (json, "bodies", "disc", "omega", NULL);
      outside += fabs (phi - cos (2 * t)) > cli_number (json, "error", "end", "disc.phi", NULL);
      outside += fabs (rate + 2 * sin (2 * t)) > cli_number (json, "error", "end", "disc.omega", NULL);
      assert_true (cli_number (json, "error", "largest", "disc.phi", NULL) < 0.1);
      runs++;
    }
  assert_true (runs >= 50);
  printf ("# %d runs, %d errors larger than stated\n", runs, outside);
  assert_true (outside <= 1); /* 99 % of 112 numbers are promised */
}

/* Fixed steps far from round-off: the error of rk4 is 16/15 of the difference, so the statement is tight. */
TEST (tight) {
  cli_write ("oscillator.yaml", oscillator);
  cli_shell ("pinwheel run @/oscillator.yaml -m rk4+projection -t 3 --step 0.05 --error --json @/s.json -o @/o.csv");
  const char *json = cli_file ("s.json");
  double true_error = fabs (cli_number (json, "bodies", "disc", "phi", NULL) - cos (6.)),
         stated = cli_number (json, "error", "end", "disc.phi", NULL);
  assert_true (stated >= true_error && stated < 20 * true_error);
  assert_true (cli_says (json, "repeated", "half the step"));
}

TEST (chaos) {
  cli_write ("chaotic.yaml", chaotic);
  cli_shell ("pinwheel run @/chaotic.yaml -m rk4+projection -t 40 --step 0.02 --error --json @/s.json");
  cli_shows ("the error is unknown: ");
  assert_non_null (
      strstr (cli_file ("s.json"), "the motion is chaotic, takes another branch, or needs a smaller step"));
  assert_non_null (strstr (cli_file ("s.json"), "\"end\": null"));
}

/* The tolerance cannot be smaller: it is larger in the repetition. */
TEST (least_tolerance) {
  cli_shell ("pinwheel run n-trailer -m erk8+projection -t 2 --rtol 3e-14 --error");
  cli_shows ("stated error at 2 s, from a repetition with ten times the tolerance");
}

TEST (same_bits) {
  cli_good ("pinwheel run ezyroller -m erk8+projection -t 5 --every 0.1 -o @/a.csv");
  cli_shell ("pinwheel run ezyroller -m erk8+projection -t 5 --every 0.1 -o @/b.csv --error");
  cli_good ("cmp @/a.csv @/b.csv");
}

TEST (sweep) {
  cli_write ("oscillator.yaml", oscillator);
  cli_shell ("pinwheel sweep @/oscillator.yaml --vary k=4,9 -m erk5+projection -t 3 --error -o @/sweep.csv");
  double k, phi[2], stated[2];
  const char *line = cli_file ("sweep.csv");
  assert_non_null (strstr (line, "error.disc.phi [rad]"));
  for (int i = 0; i < 2; i++) {
    double x[12];
    line = strchr (line, '\n') + 1;
    assert_int_equal (sscanf (line, "%lf,ok,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &k, x, x + 1, x + 2, &phi[i],
                              x + 3, x + 4, x + 5, x + 6, x + 7, &stated[i]),
                      11);
    double error = fabs (phi[i] - cos (3 * sqrt (k)));
    assert_true (error <= stated[i] && stated[i] < 1e-3);
  }
}

TEST (refusals) {
  cli_shell ("pinwheel run ezyroller -t 1 --checkpoint @/c");
  cli_bad ("pinwheel run ezyroller -t 1 --resume @/c --error", 2,
           "--error compares the run from its beginning on: it cannot be combined with --resume");
}

const check_fixture fixture = { cli_setup, cli_teardown };
