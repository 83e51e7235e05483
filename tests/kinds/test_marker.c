/* marker: a point that appears in tables and figures, without effect on the motion. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

#define MARKER_ARM                                               \
  "pinwheel: 1\n"                                                \
  "bodies:\n"                                                    \
  "  - {name: arm, mass: 2, inertia: 0.1, start: {x: 0.3}}\n"    \
  "elements:\n"                                                  \
  "  - {pin: O, body: [ground, arm], at: [[0, 0], [-0.3, 0]]}\n" \
  "  - {gravity: g, acceleration: [0, -9.81]}\n"

#define MARKER_TIP "  - {marker: tip, body: arm, at: [40, -3]}\n"

/* Tolerances and residuals refer to the length of the scene, which a distant marker does not change. */
TEST (without_effect) {
  char *bare;
  cli_write ("arm.yaml", MARKER_ARM);
  cli_good ("pinwheel run @/arm.yaml --t-end 2 --method erk5+projection --energy -o @/bare.csv");
  bare = strdup (cli_file ("bare.csv"));
  cli_write ("arm.yaml", MARKER_ARM MARKER_TIP);
  cli_good ("pinwheel run @/arm.yaml --t-end 2 --method erk5+projection --energy -o @/marked.csv");
  cli_good ("sed 's/,tip.x .m.,tip.y .m.//' @/marked.csv | head -1 >@/head");
  assert_int_equal (strncmp (bare, cli_file ("head"), strlen (cli_file ("head"))), 0);
  cli_good ("sed 1d @/marked.csv | cut -d, -f1-7,10- >@/rest"); /* without the two columns of the marker */
  assert_string_equal (strchr (bare, '\n') + 1, cli_file ("rest"));
  free (bare);
}

/* P = r + R(phi) s */
TEST (place) {
  double t, x, y, phi, vx, vy, omega, px, py;
  cli_write ("arm.yaml", MARKER_ARM MARKER_TIP);
  cli_good ("pinwheel run @/arm.yaml --t-end 1 -o @/marked.csv && tail -1 @/marked.csv >@/last");
  const char *row = cli_file ("last");
  assert_int_equal (sscanf (row, "%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &t, &x, &y, &phi, &vx, &vy, &omega, &px, &py),
                    9);
  check_close ("x", px, x + 40 * cos (phi) + 3 * sin (phi), 1e-13, "round-off of 40 m");
  check_close ("y", py, y + 40 * sin (phi) - 3 * cos (phi), 1e-13, "round-off of 40 m");
}

#define MARKER_WHEELS "# wheels, before: x [m], y [m], t [s], number of the body\n"

/* Figures show its path, and, other than for wheels, no heading. */
TEST (figures) {
  cli_write ("arm.yaml", MARKER_ARM MARKER_TIP);
  assert_int_equal (cli_run ("pinwheel run @/arm.yaml -t 1 --plots @/plots --animate @/arm.html"), 0);
  assert_non_null (strstr (cli_file ("plots/paths.svg"), "paths of the markers<"));
  assert_non_null (strstr (cli_file ("plots/mechanism.gp"), "\nmarkers = '0 '\n"));
  assert_non_null (strstr (cli_file ("plots/mechanism.dat"), MARKER_WHEELS "nan nan nan nan\n\n\n"));
  assert_non_null (strstr (cli_file ("arm.html"), "{\"name\": \"tip\", \"body\": 0, \"rolls\": false}"));
  cli_write ("arm.yaml", MARKER_ARM MARKER_TIP "  - {tyre: T, body: arm, at: [0.3, 0], stiffness: 1, speed: 0.1}\n");
  assert_int_equal (cli_run ("pinwheel run @/arm.yaml -t 1 --plots @/plots --animate @/arm.html"), 0);
  assert_non_null (strstr (cli_file ("plots/paths.svg"), "paths of the wheels and markers<"));
  assert_non_null (strstr (cli_file ("plots/mechanism.dat"), MARKER_WHEELS));
  assert_null (strstr (cli_file ("plots/mechanism.dat"), MARKER_WHEELS "nan nan nan nan\n\n\n"));
  assert_non_null (strstr (cli_file ("arm.html"), "{\"name\": \"T\", \"body\": 0, \"rolls\": true}"));
}

const check_fixture fixture = { cli_setup, cli_teardown };
