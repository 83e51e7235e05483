/* The hatchet planimeter of the gallery: the turn of a knife edge whose point is led round a circle. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

#define H4 1e-12 /* h^4 at h = 1 ms */

static double planimeter_phi (void) {
  return cli_number (cli_out, "bodies", "rod", "phi", NULL);
}

/* k = 0.6, sqrt (1 - k^2) = 0.8: five rounds turn the rod by 5 2 pi (1 - 0.8), and it is where it was. */
static void test_comes_back (void **state) {
  (void)state;
  cli_good ("pinwheel run hatchet-planimeter --json -");
  check_close ("phi", planimeter_phi (), 6.28318530717958648, 100 * H4, "100 h^4");
  check_close ("x", cli_number (cli_out, "bodies", "rod", "x", NULL), 0.025, 100 * H4, "100 h^4");
  check_close ("y", cli_number (cli_out, "bodies", "rod", "y", NULL), 0, 100 * H4, "100 h^4");
  check_close ("omega", cli_number (cli_out, "bodies", "rod", "omega", NULL), 0.6 * 3.14159265358979324, 100 * H4,
               "100 h^4");
  check_close ("truth", cli_number (cli_out, "truth", "largest", "angle", NULL), 0, 100 * H4, "100 h^4");
}

/* k = 0.28, sqrt (1 - k^2) = 0.96: a small circle is read off nearly as its area in units of L^2, pi k^2. */
static void test_area (void **state) {
  (void)state;
  cli_good ("pinwheel run hatchet-planimeter --set r=0.07 --t-end 50 --json -");
  double turn = planimeter_phi () / 25, area = 3.14159265358979324 * 0.28 * 0.28;
  check_close ("turn", turn, 2 * 3.14159265358979324 * 0.04, 100 * H4, "100 h^4");
  check_close ("area", turn, area * (1 + 0.28 * 0.28 / 4), area * pow (0.28, 4) / 8 * 1.1,
               "2 pi (1 - sqrt (1 - k^2)) = pi k^2 (1 + k^2/4 + k^4/8 + ...)");
}

/* With r > L it turns no longer: the hatchet is drawn behind on a circle of radius sqrt (r^2 - L^2). */
static void test_drawn_behind (void **state) {
  (void)state;
  cli_good ("pinwheel run hatchet-planimeter --set r=0.65 --json - -o @/drawn.csv");
  check_close ("omega", cli_number (cli_out, "bodies", "rod", "omega", NULL), 3.14159265358979324, 100 * H4, "100 h^4");
  cli_good (
      "pinwheel run hatchet-planimeter --set r=0.65 --every 10 -o @/drawn.csv && head -1 @/drawn.csv | tr , '\\n' | "
      "grep -n edge.x | cut -d: -f1 >@/column && tail -1 @/drawn.csv | cut -d, -f$(cat @/column) >@/x && "
      "tail -1 @/drawn.csv | cut -d, -f$(($(cat @/column) + 1)) >@/y");
  double x = atof (cli_file ("x")), y = atof (cli_file ("y"));
  check_close ("radius", hypot (x, y), 0.6, 100 * H4, "0.65, 0.25 and 0.6: a right angle");
}

/* Where the drives lead the rod does not depend on its mass: without any nothing pulls, and all reactions are 0. */
static void test_without_mass (void **state) {
  (void)state;
  static const char *const method[] = { "rk4+projection", "erk8+nullspace", "adams+none", "bdf+projection",
                                        "ida+none",       "ida+baumgarte",  "ida+index2", "ida+ggl",
                                        "ida+si1",        "radau+ggl",      "galpha+ggl", "leapfrog" };
  for (size_t i = 0; i < sizeof method / sizeof *method; i++) {
    int fixed = strchr ("gl", method[i][0]) || method[i][1] == 'k';
    char command[200];
    snprintf (command, sizeof command, "pinwheel run hatchet-planimeter --set m=0 --t-end 2 --method %s --%s --json -",
              method[i], fixed ? "step=1e-3" : "rtol=1e-8");
    cli_good (command);
    check_close (method[i], cli_number (cli_out, "truth", "largest", "angle", NULL), 0, fixed ? 100 * 1e-6 : 1e4 * 1e-8,
                 "100 h^2, or 1e4 rtol");
    check_close (method[i], cli_number (cli_out, "reactions", "hatchet.N", NULL), 0, 1e-15, "no mass, no force");
  }
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_comes_back),
    cmocka_unit_test (test_area),
    cmocka_unit_test (test_drawn_behind),
    cmocka_unit_test (test_without_mass),
  };
  return cmocka_run_group_tests (tests, cli_setup, cli_teardown);
}
