/* `pinwheel steady`: the symmetries up to which motions are counted. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* A disc that spins freely on a car, listed first or last: its angle makes no other motion. */
TEST (spin) {
  static const char *const body[] = { "  - {name: disc, mass: 1, inertia: 0.1, rate: {vx: 1, omega: 2}}\n",
                                      "  - {name: car, mass: 2, inertia: 1, start: {x: -0.2}, rate: {vx: 1}}\n" };
  for (int k = 0; k < 2; k++) {
    cli_write ("spin.yaml",
               check_text ("pinwheel: 1\nbodies:\n%s%selements:\n  - {wheel: rear, body: car, at: [0, 0]}\n"
                           "  - {wheel: front, body: car, at: [0.5, 0], heading: 0.2}\n"
                           "  - {speed: engine, body: car, at: [0, 0], value: 1}\n"
                           "  - {pin: P, body: [disc, car], at: [[0, 0], [0.2, 0]]}\n",
                           body[k], body[1 - k]));
    cli_good ("pinwheel steady @/spin.yaml --hold disc.omega=2 --starts 10");
    cli_shows ("spin: 1 steady motion up to 4 symmetries, ");
  }
}

/* Seventy discs that turn freely: a symmetry each. */
TEST (many_symmetries) {
  char text[12000];
  int n = snprintf (text, sizeof text, "pinwheel: 1\nbodies:\n");
  for (int i = 0; i < 70; i++)
    n += snprintf (text + n, sizeof text - (size_t)n, "  - {name: d%d, mass: 1, inertia: 1}\n", i);
  n += snprintf (text + n, sizeof text - (size_t)n, "elements:\n");
  for (int i = 0; i < 70; i++)
    n += snprintf (text + n, sizeof text - (size_t)n, "  - {pin: p%d, body: [d%d, ground], at: [[0, 0], [0, 0]]}\n", i,
                   i);
  cli_write ("many.yaml", text);
  cli_good ("pinwheel steady @/many.yaml --starts 0");
  cli_shows ("many: 1 steady motion up to 70 symmetries, ");
}

/* One body on two springs, the truss of von Mises: it has fewer equations than a plane has displacements, and no
 * symmetry.  With k = 100 N/m, h = 3 m: fold and zero eigenvalues in closed form. */
TEST (one_body) {
  cli_write (
      "truss.yaml",
      "pinwheel: 1\nparameters: [{name: F, value: 0}]\nbodies: [{name: m, mass: 1, inertia: 1, start: {y: 3}}]\n"
      "elements:\n  - {spring: l, body: [m, ground], at: [[0, 0], [-1, 0]], stiffness: 100, length: 'hypot(1, 3)'}\n"
      "  - {spring: r, body: [m, ground], at: [[0, 0], [1, 0]], stiffness: 100, length: 'hypot(1, 3)'}\n"
      "  - {drag: D, body: m, linear: 0.2, turning: 0.2}\n"
      "  - {rotational-spring: q, body: [m, ground], stiffness: 1}\n  - {force: P, body: m, fy: -F}\n");
  cli_good ("pinwheel steady @/truss.yaml --vary F=-50:400 --starts 0");
  assert_non_null (strstr (cli_out, "truss: 2 branches of steady motions, F"));
  assert_non_null (strstr (cli_out, "fold               248.075599"));
  assert_non_null (strstr (cli_out, "zero eigenvalue    78.34980"));
  assert_non_null (strstr (cli_out, "zero eigenvalue    238.6312"));
}

/* Forces that do not change near the initial state, but elsewhere: a torque that saturates, a kerb, three lanes. */
TEST (flat_forces) {
  static const char head[] = "pinwheel: 1\nbodies: [{name: c, mass: 1, inertia: 1, rate: {vx: 1}}]\nelements:\n"
                             "  - {force: push, body: c, axes: body, fx: 1}\n"
                             "  - {drag: air, body: c, linear: 1, turning: 2}\n";
  cli_write ("helm.yaml", check_text ("%s  - {wheel: w, body: c, at: [0, 0]}\n"
                                      "  - {motor: helm, body: [c, ground], stiffness: 4, limit: 1, angle: 3}\n",
                                      head));
  cli_good ("pinwheel steady @/helm.yaml");
  cli_shows ("helm: 1 steady motion up to 2 symmetries");
  cli_shows ("             3     -0.989992       0.14112              0\n");
  cli_write ("kerb.yaml", check_text ("%s  - {force: kerb, body: c, fy: '0.3 - 20*max(0, c.y - 1)'}\n", head));
  cli_good ("pinwheel linearise @/kerb.yaml --steady --hold c.phi=0");
  cli_shows ("The motion is steady\n");
  cli_shows ("          -0.5           4.4441          0.7073");
  cli_write ("lanes.yaml",
             check_text ("%s  - {force: lane, body: c, fy: '-2*tanh((c.y + 8)*((c.y + 8)^2 - 9)/5)'}\n", head));
  cli_good ("pinwheel steady @/lanes.yaml --hold c.phi=0");
  cli_shows ("lanes: 1 steady motion up to 1 symmetry");
  cli_write ("circle.yaml",
             "pinwheel: 1\nrun: {t_end: 0.5}\n"
             "bodies: [{name: c, mass: 1, inertia: 1, start: {y: 1}, rate: {vx: -1, omega: 1}}]\nelements:\n"
             "  - {spring: s, body: [c, ground], at: [[0, 0], [0, 0]], stiffness: 1}\n"
             "  - {force: f, body: c, fy: 'max(0, -0.9 - c.y)'}\n");
  cli_good ("pinwheel linearise @/circle.yaml");
  cli_shows ("Not steady: the equations change with time or along the motion");
  /* a drive that turns steadily: less than a turn in the span */
  cli_write ("turn.yaml",
             "pinwheel: 1\nrun: {t_end: 1}\nbodies:\n  - {name: c, mass: 1, inertia: 1, rate: {omega: 1}}\n"
             "  - {name: d, mass: 1, inertia: 1, start: {x: 1}, rate: {vy: 1, omega: 1}}\nelements:\n"
             "  - {pin: p, body: [c, ground], at: [[0, 0], [0, 0]]}\n"
             "  - {pin: q, body: [c, d], at: [[0.5, 0], [-0.5, 0]]}\n"
             "  - {drive: w, body: [c, ground], what: angle, value: 1*t}\n");
  cli_good ("pinwheel linearise @/turn.yaml");
  assert_null (strstr (cli_out, "Not steady"));
}

/* Where the range begins there may be more symmetries: without stiffness or slope a body can be anywhere or have any
 * direction.  Branches have the symmetries within the range, and begin at its other end, or within it. */
TEST (more_symmetries) {
  cli_write ("held.yaml", "pinwheel: 1\nparameters: [{name: k, value: 0}]\n"
                          "bodies: [{name: bob, mass: 1, inertia: 1, start: {x: 0.3}, rate: {vx: 0.1}}]\nelements:\n"
                          "  - {spring: s, body: [bob, ground], at: [[0, 0], [-2, 0]], stiffness: k, length: 2}\n");
  cli_shell ("pinwheel steady @/held.yaml --hold bob.speed=0 --hold bob.omega=0 --vary k=0:1 --starts 5");
  cli_shows ("held: 1 branch of steady motions up to 2 symmetries, k from 0 to 1\n");
  cli_shows ("       1  begins                      1        0                0        0.159155\n");
  assert_int_equal (cli_run ("pinwheel steady @/held.yaml --hold bob.speed=0.1 --vary k=1:0.5 -o @/circle/steady.csv "
                             "--json @/circle/steady.json --plots @/circle"),
                    0);
  const char *json = cli_file ("circle/steady.json");
  double number[4];
  for (int i = 0; i < 4; i++)
    number[i] =
        cli_number (json, "motions", "state", (const char *[]){ "bob.x", "bob.y", "bob.vx", "bob.vy" }[i], NULL);
  const double r = hypot (number[0] + 2, number[1]), v = hypot (number[2], number[3]);
  check_close ("force", r - 2, v * v / r, 1e-9, "k (r - l) = m v^2 / r");
  assert_int_equal (cli_run ("pinwheel steady knife-edge-incline --set w=0 --start skate.phi=1.5 --vary alpha=0:0.3"),
                    0);
  assert_string_equal (cli_err, "pinwheel: holding skate.speed=0, as in the motion nearest to the initial state\n"
                                "pinwheel: alpha=0: no branch begins at a steady motion that is one of a family of "
                                "dimension 1\n");
  cli_shows ("knife-edge-incline: 2 branches of steady motions up to 2 symmetries, alpha from 0 to 0.3\n");
  cli_shows ("       1  begins                    0.3        0                                 \n");
  cli_shows ("       2  ends                        0        0                                 \n");
  cli_write ("step.yaml", "pinwheel: 1\nparameters: [{name: k, value: 0}]\n"
                          "bodies: [{name: bob, mass: 1, inertia: 1, start: {x: 0.3}, rate: {vx: 0.1}}]\nelements:\n"
                          "  - {spring: s, body: [bob, ground], at: [[0, 0], [-2, 0]], stiffness: 'k > 0.9 ? 1 : 0', "
                          "length: 2}\n");
  cli_shell ("pinwheel steady @/step.yaml --hold bob.speed=0.1 --vary k=1:0"); /* fewer where it begins */
  cli_shows ("step: 1 branch of steady motions up to 1 symmetry, k from 1 to 0\n");
  cli_shows ("       1  ends              0.900010099 ");
  assert_int_equal (cli_run ("pinwheel steady chaplygin-sleigh --vary a=0:0.2"), 0);
  cli_shows ("       1  begins                      0.2        1 ");
  cli_shell ("pinwheel steady knife-edge-incline --set w=0 --start skate.phi=1.5 --vary alpha=0:pi");
  cli_shows ("knife-edge-incline: 4 branches of steady motions up to 2 symmetries, alpha from 0 to 3.14159265\n");
}

/* A symmetry may turn the whole and keep, or turn by another angle, single bodies: an arm beside a disc on a torsion
 * spring, or beside two geared discs, on one axis.  Symmetries may change the angle of the first body alone: gears. */
TEST (one_axis) {
  static const char *const scene[][3] = {
    { "  - {rotational-spring: S, body: [disc, ground], stiffness: 5}\n", "arm.omega=1", "1 symmetry" },
    { "  - {pin: P, body: [other, ground], at: [[0, 0], [0, 0]]}\n"
      "  - {gear: G, body: [disc, other, ground], ratio: -2}\n",
      "arm.omega=1 --hold disc.omega=1", "2 symmetries" },
    { "  - {pin: P, body: [other, arm], at: [[0, 0], [-1, 1]]}\n  - {gear: G, body: [other, disc, arm], ratio: -2}\n",
      "arm.omega=1 --hold disc.omega=0", "2 symmetries" },
  };
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    char line[300];
    cli_write ("axis.yaml", check_text ("pinwheel: 1\nbodies:\n  - {name: disc, mass: 1, inertia: 1}\n%s"
                                        "  - {name: arm, mass: 1, inertia: 1, start: {x: 1}}\nelements:\n"
                                        "  - {pin: C, body: [disc, ground], at: [[0, 0], [0, 0]]}\n"
                                        "  - {pin: A, body: [arm, ground], at: [[-1, 0], [0, 0]]}\n%s",
                                        i ? "  - {name: other, mass: 1, inertia: 1}\n" : "", scene[i][0]));
    snprintf (line, sizeof line, "pinwheel steady @/axis.yaml --starts 5 --hold %s", scene[i][1]);
    cli_good (line);
    snprintf (line, sizeof line, "axis: 1 steady motion up to %s,", scene[i][2]);
    cli_shows (line);
  }
}

const check_fixture fixture = { cli_setup, cli_teardown };
