/* The stability part of the report of `check`. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

TEST (text) {
  cli_good ("pinwheel check pendulum --set I=2 --set theta=1.5707963267948966");
  cli_shows ("  stability                          unstable, doubles in 0.38331 s\n");
  cli_shows ("\n1 finding\n  the motion is unstable: a perturbation doubles in 0.38331 s\n");
  assert_null (strstr (cli_out, "No problems found"));
  cli_good ("pinwheel check n-trailer");
  cli_shows ("  co-moving frame                    turns at 1 rad/s\n");
  cli_shows ("rightmost first       0 +- 1 i 1/s: rigid displacement\n");
  cli_shows (" -2.3344 1/s\n");
  cli_shows ("\nNo problems found\n");
  cli_good ("pinwheel check peaucellier");
  cli_shows ("  eigenvalues                        none\n");
  cli_good ("pinwheel check pendulum");
  cli_shows ("not steady: accelerations of 9.81 m/s^2 in the co-moving frame\n");
  cli_shows ("the eigenvalues are not stability exponents\n");
  cli_good ("pinwheel check pendulum --set I=2 --set theta=1.5707963267948966 --json -");
  cli_shows ("\"motion\": \"steady\"");
  check_close ("doubling", cli_number (cli_out, "linearisation", "doubling_time", NULL), log (2) / sqrt (9.81 / 3),
               1e-12, "1e4 eps");
}

/* An entry of A overflows. */
TEST (infinite) {
  cli_write ("stiff.yaml", "pinwheel: 1\nbodies: [{name: b, mass: 1e-10, inertia: 1}]\n"
                           "elements: [{force: f, body: b, fx: -1e300*b.x}]\n");
  cli_good ("pinwheel check @/stiff.yaml");
  cli_shows ("  eigenvalues                        not computed: the linearisation fails, see the findings\n");
}

/* Initial conditions whose given angle cannot be kept, and others whose omitted values follow. */
TEST (finding) {
  static const char *const body =
      "pinwheel: 1\nbodies:\n  - {name: rod, mass: 1, inertia: 1, start: {%s}, rate: {%s}}\n"
      "elements:\n  - {pin: P, body: [rod, ground], at: [[-1, 0], [0, 0]]}\n";
  cli_write ("rod.yaml", check_text (body, "x: 1", "vy: 3, vx: 0.25, omega: 3"));
  cli_good ("pinwheel check @/rod.yaml");
  cli_shows ("\n1 finding\n  the model specifies rod.vx = 0.25 m/s, which was changed to 0 m/s; otherwise pin P "
             "would be violated by 0.25 m/s\n");
  cli_good ("pinwheel check @/rod.yaml --json -");
  cli_shows ("\"findings\": [\"the model specifies rod.vx");
  cli_write ("rod.yaml", check_text (body, "x: 1", "vy: 3, omega: 3"));
  cli_good ("pinwheel check @/rod.yaml");
  cli_shows ("\nNo problems found\n");
  cli_good ("pinwheel check @/rod.yaml --start rod.vx=0.25");
  cli_shows ("\n1 finding\n  --start gives rod.vx = 0.25 m/s, which was changed to 0 m/s; otherwise pin P would "
             "be violated by 0.25 m/s\n");
}

/* Hundreds of defective zeros, which round-off spreads over a circle: the QR algorithm converges, and they are
 * shown as 0. */
TEST (many_zeros) {
  cli_good ("pinwheel check chain --set n=130");
  cli_shows ("  eigenvalues                        all 0: nothing vibrates, grows or decays\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
