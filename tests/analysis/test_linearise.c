/* `pinwheel linearise`: text, files, bad input. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

static const char *const linearise_block =
    "pinwheel: 1\nbodies:\n  - {name: block, mass: 1.5, inertia: 0.1, start: {x: 0.8}}\n"
    "elements:\n  - {slider: rail, body: [block, ground], at: [[0, 0], [0, 0]], heading: 0}\n"
    "  - {spring: s, body: [block, ground], at: [[0, 0], [0, 0]], stiffness: 60, damping: 2.4, length: 0.8}\n"
    "  - {force: F, body: block, at: [0, 0]}\n";

/* An oscillator: c = 0.8/s, m = 1.5 kg, k = 60 N/m. */
TEST (oscillator) {
  double x[4], y[4];
  char head[100], rows[3][40];
  cli_write ("block.yaml", linearise_block);
  cli_good ("pinwheel linearise @/block.yaml --input F.fx --output block.x -o @/block");
  cli_shows ("The motion is steady\n");
  cli_shows ("  mode    real [1/s]  imaginary [1/s]  frequency [Hz]       damping  doubles in [s]  halves in [s]\n"
             "     1          -0.8           6.2738          0.9985       0.12649                        0.86643\n");
  cli_shows ("  block           1 at 0 deg             0             0\n");
  assert_int_equal (sscanf (cli_file ("block.csv"), "%99[^\n] %39[^,],%lf,%lf,%lf %39[^,],%lf,%lf,%lf %39[^,],%lf,%lf",
                            head, rows[0], &x[0], &x[1], &x[2], rows[1], &y[0], &y[1], &y[2], rows[2], &x[3], &y[3]),
                    12);
  assert_string_equal (head, "row,x1 [m],x2 [m],F.fx [N]");
  assert_string_equal (rows[2], "block.x [m]");
  check_close ("trace", x[0] + y[1], -2.4 / 1.5, 1e-14, "round-off");
  check_close ("determinant", x[0] * y[1] - x[1] * y[0], 60 / 1.5, 1e-13, "round-off");
  check_close ("static response", (x[3] * x[1] * y[2] - y[3] * x[0] * y[2]) / (x[1] * y[0]), -1.0 / 60, 1e-16,
               "C A^-1 B = -1/k");
  const char *json = cli_file ("block.json");
  check_close ("damping", cli_number (json, "eigenvalues", "damping", NULL), 0.8 / sqrt (40), 1e-14, "round-off");
  check_close ("frequency", cli_number (json, "eigenvalues", "frequency_hz", NULL), sqrt (40 - 0.64) / (2 * PW_PI),
               1e-14, "round-off");
  check_close ("halves", cli_number (json, "eigenvalues", "halving_time", NULL), log (2) / 0.8, 1e-14, "round-off");
  assert_true (cli_says (json, "motion", "steady"));
  assert_non_null (strstr (json, "\"doubling_time\": null"));
  cli_good ("pinwheel linearise @/block.yaml --input F.fy --input F.fx --output block.x -o @/both");
  assert_int_equal (sscanf (cli_file ("both.csv"), "%99[^\n] %39[^,],%*f,%*f,%*f,%*f %39[^,],%*f,%*f,%lf,%lf", head,
                            rows[0], rows[1], &x[0], &x[1]),
                    5);
  assert_string_equal (head, "row,x1 [m],x2 [m],F.fy [N],F.fx [N]");
  check_close ("across", x[0], 0, 1e-15, "the rail takes it");
  check_close ("along", x[1], y[2], 0, "the same input");
}

/* A body on 22 wheels, whose spins the text does not show all. */
TEST (internal) {
  char text[4000] = "pinwheel: 1\nbodies: [{name: car, mass: 1, inertia: 1}]\nelements:\n"
                    "  - {spring: S, body: [ground, car], at: [[-10, 0], [0, 0]], stiffness: 350, length: 10}\n";
  size_t used = strlen (text);
  for (int i = 0; i < 22; i++)
    used += (size_t)snprintf (text + used, sizeof text - used,
                              "  - {rolling-wheel: w%d, body: car, at: [%d, 0], radius: 0.1, inertia: 0.01}\n", i, i);
  cli_write ("wheels.yaml", text);
  cli_good ("pinwheel linearise @/wheels.yaml");
  cli_shows ("  w19.spin [rad] ");
  cli_shows ("  and 2 more internal coordinates\n");
}

/* The archive begins with A.npy, whose 128 bytes of head describe a 2 x 2 matrix: trace and determinant as above. */
TEST (npz) {
  char head[30 + 5 + 128];
  double A[4];
  cli_write ("block.yaml", linearise_block);
  cli_good ("pinwheel linearise @/block.yaml -o @/block");
  FILE *f = fopen (cli_path ("block.npz"), "rb");
  assert_non_null (f);
  assert_int_equal (fread (head, sizeof head, 1, f), 1);
  assert_int_equal (fread (A, sizeof A, 1, f), 1);
  fclose (f);
  assert_memory_equal (head, "PK\3\4\x14\0\0\x08", 8); /* version 2.0, names in UTF-8 */
  assert_memory_equal (head + 30, "A.npy\x93NUMPY\1\0\x76\0{'descr': '", 5 + 10 + 11);
  assert_memory_equal (head + 30 + 5 + 22, "f8', 'fortran_order': False, 'shape': (2, 2), }", 46);
  check_close ("trace", A[0] + A[3], -2.4 / 1.5, 1e-14, "round-off");
  check_close ("determinant", A[0] * A[3] - A[1] * A[2], 60 / 1.5, 1e-13, "round-off");
  cli_good ("grep -a -q \"'shape': (2,), }\" @/block.npz"); /* eigenvalues */
  cli_shell ("! command -v python3 >@/log || python3 -m zipfile -t @/block.npz >@/log");
  assert_null (strstr (cli_file ("log"), "corrupt"));
  cli_good ("pinwheel linearise pendulum -o @/pendulum"); /* without inputs */
  cli_good ("grep -a -q \"'shape': (2, 0), }\" @/pendulum.npz");
}

/* The eigenvalues are those of `check`; a steady motion has them at every time; the inverted pendulum grows. */
TEST (times) {
  cli_good ("pinwheel check n-trailer");
  cli_shows (" -3.2056 1/s\n");
  cli_good ("pinwheel linearise n-trailer");
  cli_shows ("     7       -3.2056");
  cli_good ("pinwheel linearise n-trailer --at 0.7");
  cli_shows ("n-trailer at t = 0.7 s: 7 minimal coordinates, 5 of positions and 2 of velocities\n"
             "The frame turns at 1 rad/s\nThe motion is steady\n");
  cli_shows ("     7       -3.2056");
  cli_good ("pinwheel linearise pendulum --set I=2 --set theta=1.5707963267948966");
  cli_shows ("     1        1.8083");
  cli_shows ("0.38331");
  cli_good ("pinwheel linearise ezyroller --at 0.3");
  cli_shows ("the eigenvalues are not stability exponents\n");
}

/* Two masses on a spring that whirl at W = 1.5 rad/s, neither of which turns: the frame is that of their positions,
 * and the frequency of the only mode is (3 W^2 + k/mu)^(1/2), k/mu = 15 1/s^2. */
TEST (whirl) {
  cli_write ("whirl.yaml",
             "pinwheel: 1\nlet: {mu: 2/3, r: '10*0.5/(10 - mu*1.5^2)'}\nbodies:\n"
             "  - {name: a, mass: 1, inertia: 0.1, start: {x: 2*r/3}, rate: {vy: r}}\n"
             "  - {name: b, mass: 2, inertia: 0.3, start: {x: -r/3}, rate: {vy: -r/2}}\n"
             "elements:\n  - {spring: S, body: [a, b], at: [[0, 0], [0, 0]], stiffness: 10, length: 0.5}\n");
  cli_good ("pinwheel linearise @/whirl.yaml");
  assert_non_null (strstr (cli_out, "The motion is steady"));
  assert_non_null (strstr (cli_out, "     1             0           4.6637         0.74225"));
  /* one mass, W^2 = 0.6/s^2, which turns at another rate: (3 W^2 + k/m)^(1/2) */
  cli_write ("orbit.yaml",
             "pinwheel: 1\nbodies:\n"
             "  - {name: a, mass: 1, inertia: 0.1, start: {x: 1}, rate: {vy: sqrt(0.6), omega: 0.3}}\n"
             "elements:\n  - {spring: S, body: [ground, a], at: [[0, 0], [0, 0]], stiffness: 3, length: 0.8}\n");
  cli_good ("pinwheel linearise @/orbit.yaml");
  cli_shows ("The frame turns at 0.7746 rad/s\nThe motion is steady\n");
  cli_shows ("     1             0           2.1909         0.34869");
}

TEST (bad) {
  static const cli_wrong each[] = {
    { "n-trailer --output tractor.q",
      "model n-trailer has no state \"tractor.q\"; valid are x, y, phi, vx, vy, omega" },
    { "ezyroller --input ride", "model ezyroller has no signal \"ride\"; did you mean \"rider.value\"?" },
    { "n-trailer --input rider", "model n-trailer has no signal \"rider\"" },
    { "n-trailer --output tracto.x", "model n-trailer has no state \"tracto.x\"; did you mean \"tractor.x\"?" },
    { "hatchet-planimeter --input x",
      "--input x.value is the signal of a constraint; only signals of forces can be inputs" },
    { "ezyroller --at -1", "--at -1: expected a number >= 0" },
    { "ezyroller --at soon", "--at: \"soon\" is not a number" },
    { "pendulum -o ''", "-o : expected the name of a file, .csv, .npz or .json" },
    { "pendulum -o ./", "-o ./: expected the name of a file, .csv, .npz or .json" },
    { "peaucellier -o @/none", "peaucellier has no degrees of freedom: there is nothing to linearise" },
    { "chain --set n=200", "chain has 600 coordinates; linearise takes at most 400" },
  };
  cli_bad_each ("linearise", each, sizeof each / sizeof *each);
  cli_good ("pinwheel linearise snakeboard -o @/board >/dev/null");
  assert_null (strstr (cli_file ("board.json"), "\"im\": -0,"));
  cli_bad ("pinwheel linearise pendulum --at 1 --limit 1e-9", 4,
           "t = 0 s: the limit of 1e-09 s of processor time is reached (--limit)");
  cli_bad ("pinwheel linearise pendulum --limit 1", 2, "--limit 1: only with --at or --steady");
  cli_bad ("pinwheel show pendulum --limit 1", 2, "--limit 1: only with --at");
  cli_bad ("pinwheel show pendulum --at 1 --limit 1e-9", 4,
           "t = 0 s: the limit of 1e-09 s of processor time is reached (--limit)");
  assert_null (cli_file ("none.json"));
  assert_null (cli_file ("none.csv"));
  assert_null (cli_file ("none.json.part"));
  assert_null (cli_file ("none.npz.part"));
  cli_write ("fails.yaml", "pinwheel: 1\nbodies:\n  - {name: rod, mass: 1, inertia: 1}\nelements:\n"
                           "  - {pin: P, body: [rod, ground], at: [[0, 0], [0, 0]]}\n"
                           "  - {torque: T, body: [rod, ground], value: {expression: \"1/(1 - t)\"}}\n");
  cli_bad ("pinwheel linearise @/fails.yaml --at 1.5 -o @/none", 4,
           "t = 0.999 s: a signal failed: torque T: value is not a finite number");
  assert_null (cli_file ("none.csv"));
  cli_bad ("pinwheel linearise slider-crank --set theta=pi/2", 3,
           "model slider-crank: the initial configuration is singular: pin B (B.Fy) follows from pin A, pin C, drive "
           "guide, but not nearby; begin slightly off it");
  cli_write ("block.yaml", linearise_block);
  cli_bad ("pinwheel linearise @/block.yaml -o @/no/such", 1, "cannot write @/no/such.json: No such file or directory");
}

/* One run for each mode that moves, a pair once, of finite numbers; no file without such modes. */
TEST (page) {
  int runs = 0;
  cli_write ("block.yaml", linearise_block);
  cli_good ("pinwheel linearise @/block.yaml --animate @/modes.html");
  const char *page = cli_file ("modes.html");
  for (const char *at = page; (at = strstr (at, "\"method\": \"mode ")) != NULL; at++) runs++;
  assert_int_equal (runs, 1);
  assert_non_null (strstr (page, "\"method\": \"mode 1: -0.8 1/s, 0.9985 Hz, growth is not shown\""));
  assert_non_null (strstr (page, "<select id=\"mode\">"));
  assert_null (strstr (page, "NaN"));
  const char *motion = strstr (page, "\"motion\": [");
  double first[6], second[6];
  assert_int_equal (sscanf (motion, "\"motion\": [ %lf, %lf, %lf, %lf, %lf, %lf, %lf, %lf, %lf, %lf, %lf, %lf", first,
                            first + 1, first + 2, first + 3, first + 4, first + 5, second, second + 1, second + 2,
                            second + 3, second + 4, second + 5),
                    12);
  double size = first[0] - 0.8, step = 3 * 2 * PW_PI / 180, rate = sqrt (40 - 0.64);
  assert_true (size > 0.01 && size < 0.1);
  check_close ("next x", second[0], 0.8 + size * cos (step), 1e-8, "9 digits");
  check_close ("next vx", second[3], -size * rate * sin (step), 1e-8, "9 digits");
  cli_good ("pinwheel linearise stanley --animate @/outputs.html"); /* outputs have no values in modes */
  assert_non_null (strstr (cli_file ("outputs.html"), "\"output\": [\n    null, null,"));
  cli_bad ("pinwheel linearise car --animate @/none.html", 2, "--animate @/none.html: there is no mode with a shape");
  assert_null (cli_file ("none.html"));
  cli_bad ("pinwheel linearise @/block.yaml --animate @/none.gif", 2,
           "--animate @/none.gif: expected a name that ends in .html");
}

const check_fixture fixture = { cli_setup, cli_teardown };
