/* The hatchet planimeter of the gallery: a rod of length L with a knife edge, whose point is moved round a circle of
 * radius r = k L five times in 10 s (test_area: 25 times in 50 s). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "check.h"
#include "cli.h"
#include "gallery.h"

static double planimeter_phi (void) {
  return cli_number (cli_out, "bodies", "rod", "phi", NULL);
}

/* k = 0.6: each round turns the rod by 2 pi (1 - sqrt (1 - k^2)) = 2 pi 0.2; after five of them it is back. */
TEST (comes_back) {
  cli_good ("pinwheel run hatchet-planimeter --json -");
  check_close ("phi", planimeter_phi (), 6.28318530717958648, 100 * H4, "100 h^4");
  check_close ("x", cli_number (cli_out, "bodies", "rod", "x", NULL), 0.025, 100 * H4, "100 h^4");
  check_close ("y", cli_number (cli_out, "bodies", "rod", "y", NULL), 0, 100 * H4, "100 h^4");
  check_close ("omega", cli_number (cli_out, "bodies", "rod", "omega", NULL), 0.6 * 3.14159265358979324, 100 * H4,
               "100 h^4");
  check_close ("truth", cli_number (cli_out, "truth", "largest", "angle", NULL), 0, 100 * H4, "100 h^4");
}

/* k = 0.28, sqrt (1 - k^2) = 0.96: the turn per round is nearly the area of a small circle in units of L^2, pi k^2. */
TEST (area) {
  cli_good ("pinwheel run hatchet-planimeter --set r=0.07 --t-end 50 --json -");
  double turn = planimeter_phi () / 25, area = 3.14159265358979324 * 0.28 * 0.28;
  check_close ("turn", turn, 2 * 3.14159265358979324 * 0.04, 100 * H4, "100 h^4");
  check_close ("area", turn, area * (1 + 0.28 * 0.28 / 4), area * pow (0.28, 4) / 8 * 1.1,
               "2 pi (1 - sqrt (1 - k^2)) = pi k^2 (1 + k^2/4 + k^4/8 + ...)");
}

/* With r > L the knife edge follows the point on a circle of radius sqrt (r^2 - L^2). */
TEST (long_radius) {
  cli_good ("pinwheel run hatchet-planimeter --set r=0.65 --json - -o @/drawn.csv");
  check_close ("omega", cli_number (cli_out, "bodies", "rod", "omega", NULL), 3.14159265358979324, 100 * H4, "100 h^4");
  cli_good (
      "pinwheel run hatchet-planimeter --set r=0.65 --every 10 -o @/drawn.csv && head -1 @/drawn.csv | tr , '\\n' | "
      "grep -n edge.x | cut -d: -f1 >@/column && tail -1 @/drawn.csv | cut -d, -f$(cat @/column) >@/x && "
      "tail -1 @/drawn.csv | cut -d, -f$(($(cat @/column) + 1)) >@/y");
  double x = atof (cli_file ("x")), y = atof (cli_file ("y"));
  check_close ("radius", hypot (x, y), 0.6, 100 * H4, "0.65, 0.25 and 0.6: a right angle");
}

/* The motion is prescribed and does not depend on the mass; without mass the reactions are 0. */
TEST (without_mass) {
  enum { FIXED = 3 }; /* methods with fixed steps, which come first */
  static const char *const method[] = { "rk4+projection", "galpha+ggl", "leapfrog",      "erk8+nullspace",
                                        "adams+none",     "ida+none",   "ida+baumgarte", "ida+index2",
                                        "ida+ggl",        "ida+si1",    "radau+ggl",     "bdf+projection" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    int fixed = i < FIXED;
    cli_good (check_text ("pinwheel run hatchet-planimeter --set m=0 --t-end 2 --method %s --%s --json -", method[i],
                          fixed ? "step=1e-3" : "rtol=1e-8"));
    check_close (method[i], cli_number (cli_out, "truth", "largest", "angle", NULL), 0, fixed ? 100 * 1e-6 : 1e4 * 1e-8,
                 "100 h^2, or 1e4 rtol");
    check_close (method[i], cli_number (cli_out, "reactions", "hatchet.N", NULL), 0, 1e-15, "no mass, no force");
  }
}

const check_fixture fixture = { cli_setup, cli_teardown };
