/* Command lines of the program: runs, tables, summaries, lists. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "runs.h"

/* ---- Runs ---- */

TEST (summary) {
  double table[4 * 6];
  assert_int_equal (runs_reference ("tests/reference/ezyroller.txt", 4, 6, table), 4);
  const double *x = table + 18;
  cli_good ("pinwheel run ezyroller --method rk4+projection --step 1e-3 --t-end 10 --energy --json -");
  const char *why = "(h omega)^4 / 10 at h = 1e-3";
  assert_true (cli_number (cli_out, "schema", NULL) == 1);
  assert_true (cli_says (cli_out, "model", "ezyroller") && cli_says (cli_out, "method", "rk4+projection"));
  assert_true (cli_says (cli_out, "status", "ok") && cli_says (cli_out, "reason", ""));
  assert_true (cli_number (cli_out, "t", NULL) == 10);
  check_close ("x1", cli_number (cli_out, "bodies", "frame", "x", NULL), x[1], 1e-11, why);
  check_close ("y1", cli_number (cli_out, "bodies", "frame", "y", NULL), x[2], 1e-11, why);
  check_close ("phi1", cli_number (cli_out, "bodies", "frame", "phi", NULL), x[3], 1e-11, why);
  check_close ("phi2", cli_number (cli_out, "bodies", "steer", "phi", NULL), x[4], 1e-11, why);
  double kinetic = cli_number (cli_out, "energy", "kinetic", NULL);
  check_close ("kinetic", kinetic, x[5], 1e-11, why);
  check_close ("work", cli_number (cli_out, "energy", "work", NULL), kinetic, 1e-12,
               "work of the torque = kinetic energy");
  check_close ("balance", cli_number (cli_out, "energy", "balance", NULL), 0, 1e-12, "the same");
  check_below ("position", cli_number (cli_out, "residual", "position", NULL), 16 * CHECK_EPS, "round-off");
  check_below ("velocity", cli_number (cli_out, "residual", "velocity", NULL), 16 * CHECK_EPS, "round-off");
  assert_true (cli_number (cli_out, "statistics", "steps", NULL) == 10000);
  assert_true (cli_number (cli_out, "statistics", "cpu_s", NULL) >= 0);
  check_close ("C.N", fabs (cli_number (cli_out, "reactions", "C.N", NULL)), 0.4, 64 * CHECK_EPS,
               "M / (c + d) at t = 10 s");
}

/* Numbers may be expressions, as in text models. */
TEST (numbers) {
  cli_good ("pinwheel run pendulum --set l=3/2 --t-end pi/10 --json -");
  check_close ("t", cli_number (cli_out, "t", NULL), 0.31415926535897932, CHECK_EPS, "pi / 10");
  cli_good ("pinwheel sweep knife-edge-incline --vary skate.phi=0,30*deg --t-end 0.01 -o @/turned.csv");
  assert_non_null (strstr (cli_file ("turned.csv"), "\n0.5235987755982988,"));
}

/* A step across the motion is said to be one; one that is the whole run, of something slow, is not. */
TEST (long_step) {
  assert_int_equal (cli_run ("pinwheel run pendulum --step 0.4 --t-end 4"), 0);
  assert_non_null (strstr (cli_err, "pinwheel: a step of 0.4 s is long for a motion that changes within 0.3"));
  cli_good ("pinwheel run pendulum --step 0.1 --t-end 1");
  cli_good ("pinwheel run pendulum --step 5 --t-end 0.1");
  cli_good ("pinwheel run pendulum --method erk5 --t-end 10");
}

/* Degrees where radians belong are noticed. */
TEST (degrees) {
  static const char model[] = "pinwheel: 1\nbodies:\n  - {name: skate, mass: 1, inertia: 1, start: {phi: %s}}\n"
                              "elements:\n  - {wheel: W, body: skate, at: [0, 0], heading: %s}\n"
                              "  - {steered-wheel: S, body: skate, at: [1, 0], heading: %s}\n";
  cli_write ("skate.yaml", check_text (model, "2*pi", "-90*deg", "pi/4"));
  cli_good ("pinwheel run @/skate.yaml --t-end 0.01");
  cli_good ("pinwheel run @/skate.yaml --t-end 0.01 --start skate.phi=-6");
  assert_int_equal (cli_run ("pinwheel run @/skate.yaml --t-end 0.01 --start skate.phi=400"), 0);
  assert_non_null (strstr (cli_err, "pinwheel: body skate: initial phi = 400 rad is more than a turn and ends at "));
  cli_good ("pinwheel run @/skate.yaml --t-end 0.01 --start skate.phi=373.883"); /* the end of a long run */
  cli_write ("skate.yaml", check_text (model, "30", "-90", "45"));
  assert_int_equal (cli_run ("pinwheel check @/skate.yaml"), 0);
  assert_non_null (strstr (cli_err, "pinwheel: body skate: initial phi = 30 rad is more than a turn"));
  assert_non_null (strstr (cli_err,
                           "pinwheel: wheel W: heading = -90 rad is more than a turn and ends at -116.6 degrees; "
                           "if degrees are meant, write \"*deg\" after the number\n"));
  assert_non_null (strstr (cli_err, "pinwheel: steered-wheel S: heading = 45 rad is more than a turn"));
}

TEST (no_energy) {
  cli_good ("pinwheel run ezyroller --t-end 0.1 --json @/summary.json");
  const char *json = cli_file ("summary.json");
  assert_non_null (json);
  json = strstr (json, "\"energy\"");
  assert_non_null (json);
  assert_int_equal (strncmp (json + 8 + strspn (json + 8, " \n:"), "null", 4), 0);
  assert_null (cli_file ("summary.json.part"));
}

/* Spin angles and rates stand below each other, whatever their wheels' names. */
TEST (own_columns) {
  cli_good ("pinwheel run differential-drive --t-end 0.1 2>/dev/null"); /* its wheels are on one axle */
  const char *left = strstr (cli_out, "\n  left.spin"), *right = strstr (cli_out, "\n  right.spin");
  assert_true (left != NULL && right != NULL);
  assert_int_equal (strstr (left, " rad ") - left, strstr (right, " rad ") - right);
  assert_int_equal (strstr (left, "left.spin_rate") - left, strstr (right, "right.spin_rate") - right);
  assert_int_equal (strstr (left, " rad/s") - left, strstr (right, " rad/s") - right);
}

TEST (defaults) {
  /* the last value of a name counts; without the notice that the frame was moved */
  cli_good ("pinwheel run ezyroller --set a=0.6 --start frame.phi=1 --start frame.phi=0.25 --t-end 0.001 --json - "
            "2>/dev/null");
  check_close ("phi", cli_number (cli_out, "bodies", "frame", "phi", NULL), 0.25, 1e-6, "half of 1 rad/s^2 x 1e-6 s^2");
  assert_true (cli_says (cli_out, "method", "rk4+projection")); /* the model's own */
}

/* Energy that comes from nowhere is reported, with --energy or without. */
TEST (unbalanced) {
  assert_int_equal (cli_run ("pinwheel run n-four-bar --method galpha+ggl --step 0.1 --json -"), 0);
  double part = cli_number (cli_out, "unbalanced", NULL);
  assert_true (part > 0.05 && part < 0.5);
  assert_non_null (strstr (cli_err, "pinwheel: the energy does not balance: 9.5 % of it is unaccounted for"));
  cli_good ("pinwheel run n-four-bar --json -");
  check_below ("unbalanced", cli_number (cli_out, "unbalanced", NULL), 1e-9, "kept over ten passes");
  cli_good ("pinwheel run ezyroller --t-end 1 --energy --json -");
  check_below ("unbalanced", cli_number (cli_out, "unbalanced", NULL), 1e-12, "the method's order");
  double asked = cli_number (cli_out, "unbalanced", NULL);
  cli_good ("pinwheel run ezyroller --t-end 1 --json -");
  assert_true (cli_number (cli_out, "unbalanced", NULL) == asked);
}

/* ---- Tables ---- */

static int cli_lines (const char *text) {
  int lines = 0;
  for (; *text; text++) lines += *text == '\n';
  return lines;
}

TEST (table) {
  cli_good ("pinwheel run ezyroller --t-end 1 --every 0.1 --energy -o @/run.csv");
  const char *csv = cli_file ("run.csv");
  assert_non_null (csv);
  assert_int_equal (cli_lines (csv), 12);
  static const char *const columns[] = { "t [s],",  "frame.x [m],", "frame.phi [rad],", "steer.omega [rad/s],",
                                         "A.x [m]", "A.y [m]",      "B.Fx [N]",         "C.N [N]",
                                         "[J]" };
  const char *end = strchr (csv, '\n');
  for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) {
    const char *at = strstr (csv, columns[i]);
    if (at == NULL || at > end) print_error ("no column %s\n", columns[i]);
    assert_true (at && at < end);
  }
  assert_int_equal (strncmp (csv, "t [s],", 6), 0);
  int columns_there = 1;
  for (const char *c = csv; c < end; c++) columns_there += *c == ',';
  for (const char *line = end + 1; *line; line = strchr (line, '\n') + 1) {
    int n = 1;
    for (const char *c = line; *c != '\n'; c++) n += *c == ',';
    assert_int_equal (n, columns_there);
  }
  assert_null (cli_file ("run.csv.part"));
}

/* With -o - the table alone is on standard output, the same to the byte; everything else is on standard error. */
TEST (table_on_stdout) {
  cli_good ("pinwheel run ezyroller --t-end 0.5 --every 0.05 -o @/a.csv");
  cli_good ("pinwheel run ezyroller --t-end 0.5 --every 0.05 -o -");
  assert_string_equal (cli_out, cli_file ("a.csv"));
  assert_int_equal (cli_lines (cli_out), 12);
}

/* Sampling alters no step: common rows are the same to the byte, however many there are between them. */
TEST (every) {
  cli_good ("pinwheel run ezyroller --method ida+ggl --t-end 2 --every 0.5 -o @/few.csv\n"
            "pinwheel run ezyroller --method ida+ggl --t-end 2 --every 0.0625 -o @/many.csv\n"
            "grep -cxFf @/few.csv @/many.csv");
  assert_int_equal (atoi (cli_out), 6); /* the header and t = 0, 0.5, ... 2 */
}

/* A locale with a decimal comma changes nothing. */
TEST (locale) {
  cli_good ("LC_ALL=C pinwheel run ezyroller --t-end 0.1 --every 0.05 -o @/c.csv");
  cli_good ("LC_ALL=de_DE.UTF-8 LC_NUMERIC=de_DE.UTF-8 pinwheel run ezyroller --t-end 0.1 --every 0.05 -o "
            "@/de.csv\ncmp @/c.csv @/de.csv");
}

/* ---- Columns ----
 *
 * An arm falls about a pin through oil, a bob hangs at rest, a cart rolls on a wheel with a coordinate of its own. */

#define CLI_COLUMNS                                                                                        \
  "pinwheel: 1\n"                                                                                          \
  "bodies:\n"                                                                                              \
  "  - {name: arm, mass: 2, inertia: 0.1, start: {x: 0.3}}\n"                                              \
  "  - {name: cart, mass: 1, inertia: 0.5, start: {y: 2, phi: 0.3}, rate: {vx: cos(0.3), vy: sin(0.3)}}\n" \
  "  - {name: bob, mass: 3, inertia: 0.1, start: {x: 5, y: -0.5}}\n"                                       \
  "elements:\n"                                                                                            \
  "  - {pin: O, body: [arm, ground], at: [[-0.3, 0], [0, 0]]}\n"                                           \
  "  - {pin: H, body: [bob, ground], at: [[0, 0.5], [5, 0]]}\n"                                            \
  "  - {rolling-wheel: W, body: cart, at: [0.1, 0], radius: 0.2, inertia: 0.3}\n"                          \
  "  - {drag: oil, body: arm, turning: 0.2}\n"                                                             \
  "  - {torque: twist, body: [cart, ground], value: 0.3}\n"                                                \
  "  - {gravity: g, acceleration: [0, -9.81]}\n"

/* The value of a column, by its whole heading, in a row from 0. */
static double cli_cell (const char *csv, int row, const char *heading) {
  size_t n = strlen (heading);
  int column = 0;
  const char *at = csv, *end = strchr (csv, '\n');
  while (at < end && !(strncmp (at, heading, n) == 0 && (at[n] == ',' || at[n] == '\n'))) {
    at += strcspn (at, ",\n") + 1;
    column++;
  }
  if (at >= end) print_error ("no column %s\n", heading);
  assert_true (at < end);
  for (at = csv; row >= 0; row--) at = strchr (at, '\n') + 1;
  while (column-- > 0) at = strchr (at, ',') + 1;
  return strtod (at, NULL);
}

static const char *cli_columns (const char *options) {
  cli_write ("columns.yaml", CLI_COLUMNS);
  cli_good (check_text ("pinwheel run @/columns.yaml --energy -o @/columns.csv %s", options));
  return cli_file ("columns.csv");
}

/* Velocities are what coordinates change by. */
TEST (state_columns) {
  static const char *const pairs[][2] = {
    { "arm.x [m]", "arm.vx [m/s]" },           { "arm.y [m]", "arm.vy [m/s]" },
    { "arm.phi [rad]", "arm.omega [rad/s]" },  { "cart.x [m]", "cart.vx [m/s]" },
    { "W.spin [rad]", "W.spin_rate [rad/s]" },
  };
  const char *csv = cli_columns ("-t 0.1 --every 0.01");
  for (int i = 0; i < 5; i++)
    for (int row = 1; row < 10; row++) {
      double slope = (cli_cell (csv, row + 1, pairs[i][0]) - cli_cell (csv, row - 1, pairs[i][0])) / 0.02;
      double v = cli_cell (csv, row, pairs[i][1]);
      check_close (pairs[i][1], v, slope, 0.01, "h^2 / 6 times a third derivative below 500");
    }
}

/* A bob at rest hangs by its weight: the reaction is the force on the first body.  The summary has the same sign. */
TEST (reaction_columns) {
  const char *csv = cli_columns ("-t 0.1 --every 0.1 --json @/columns.json");
  check_close ("H.Fx", cli_cell (csv, 1, "H.Fx [N]"), 0, 1e-12, "round-off");
  check_close ("H.Fy", cli_cell (csv, 1, "H.Fy [N]"), 3 * 9.81, 1e-12, "the weight of 3 kg, upwards");
  csv = cli_file ("columns.json");
  check_close ("H.Fy", cli_number (csv, "reactions", "H.Fy", NULL), 3 * 9.81, 1e-12, "the same");
}

/* K + V - (K + V)_0 = work - loss + projection + balance, of which steps too large leave something to the last two. */
TEST (ledger_columns) {
  const char *csv = cli_columns ("-m rk4+projection --step 0.05 -t 0.3 --every 0.1");
  double start = cli_cell (csv, 0, "kinetic [J]") + cli_cell (csv, 0, "potential [J]");
  assert_non_null (strstr (csv, ",kinetic [J],potential [J],"));
  for (int row = 1; row < 4; row++) {
    double energy = cli_cell (csv, row, "kinetic [J]") + cli_cell (csv, row, "potential [J]") - start;
    double work = cli_cell (csv, row, "W.work [J]") + cli_cell (csv, row, "twist.work [J]");
    double loss = cli_cell (csv, row, "oil.loss [J]"), phi = cli_cell (csv, row, "cart.phi [rad]") - 0.3;
    double projection = cli_cell (csv, row, "projection [J]"), balance = cli_cell (csv, row, "balance [J]");
    check_close ("energies", energy, work - loss + projection + balance, 1e-13, "round-off of 10 J");
    check_close ("work", cli_cell (csv, row, "twist.work [J]"), 0.3 * phi, 1e-5, "moment times angle, to h^4");
    check_below ("projection and balance are different", 1e-6, fabs (projection - balance), "10 % of either");
    assert_true (loss > 0);
  }
}

/* Numbers are read back as they were, and the last row is at t_end: 3 times 0.1 is not 0.3. */
TEST (last_row) {
  const char *csv = cli_columns ("-t 0.3 --every 0.1");
  assert_int_equal (cli_lines (csv), 5);
  assert_true (cli_cell (csv, 3, "t [s]") == 0.3);
  csv = cli_columns ("-t 0.1 --every 1e12"); /* from t = 0 on, however small the run is against the interval */
  assert_true (cli_lines (csv) == 2 && cli_cell (csv, 0, "t [s]") == 0);
  csv = cli_columns ("-t 0.4 --every 0.1");
  assert_true (cli_cell (csv, 3, "t [s]") == 3 * 0.1);
}

/* Nobody reads on: the exit status says so, nothing is said, and no temporary file is left. */
TEST (closed_pipe) {
  cli_run ("{ pinwheel run pendulum -t 100 --json @/pipe.json -o -; echo $? >@/status; } | head -1 >@/head\n"
           "ls @ | grep -c '^pipe.*[.]part$'");
  assert_string_equal (cli_file ("status"), "141\n");
  assert_true (cli_says (cli_file ("pipe.json"), "status", "machine"));
  assert_string_equal (cli_out, "0\n");
  assert_string_equal (cli_err, "");
  /* an error in another file is reported all the same */
  cli_run ("{ sleep 0.2; pinwheel run pendulum -t 0.1 -o @/none/x.csv; echo $? >@/status; } | true");
  assert_string_equal (cli_file ("status"), "1\n");
  assert_non_null (strstr (cli_err, "none/x.csv: No such file or directory\n"));
}

/* Steps and rejected ones are not mixed up. */
TEST (statistics) {
  cli_good ("pinwheel run ezyroller -m erk5+projection --rtol 1e-6 -t 10 --json -");
  double steps = cli_number (cli_out, "statistics", "steps", NULL);
  check_below ("rejected", cli_number (cli_out, "statistics", "rejected", NULL), steps / 3 + 5, "a third of the steps");
}

/* ---- Other commands ---- */

TEST (list) {
  cli_good ("pinwheel list");
  static const char *const expected[] = { "ezyroller", "rk4", "ida",   "projection", "ggl",     "baumgarte",
                                          "galpha",    "pin", "wheel", "torque",     "harmonic" };
  int lines = 0;
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) assert_non_null (strstr (cli_out, expected[i]));
  for (const char *c = cli_out; *c; c++) lines += *c == '\n';
  assert_in_range (lines, 10, 24); /* one screen */
  cli_good ("pinwheel list models");
  assert_non_null (strstr (cli_out, "ezyroller"));
  assert_null (strstr (cli_out, "baumgarte"));
  cli_good ("pinwheel list methods");
  assert_null (strstr (cli_out, "ezyroller"));
  assert_null (strstr (cli_out, "metric"));
  cli_good ("pinwheel list methods rk4 bdf");
  assert_non_null (strstr (cli_out, "    :metric=mass|identity  (default mass; with projection)\n"));
  assert_non_null (strstr (cli_out, "  bdf  (adaptive steps; --rtol, --atol)\n"));
  assert_null (strstr (cli_out, "galpha"));
  cli_good ("pinwheel list methods all");
  assert_non_null (strstr (cli_out, "    :rho=NUMBER  (default 0.8)\n"));
  cli_good ("pinwheel list kinds");
  assert_non_null (strstr (cli_out, "a knife edge"));
  assert_null (strstr (cli_out, "required"));
  cli_good ("pinwheel list kinds rolling-wheel drive");
  static const char *const items[] = { "- {rolling-wheel: NAME, body: BODY, at: [X, Y], radius: NUMBER}",
                                       "  radius        number [m]       required (> 0)  radius of the wheel",
                                       "  inertia       number [kg m^2]  0 (>= 0)        moment of inertia",
                                       "states such as BODY.phi",
                                       "  spin  rad  spin_rate  ",
                                       "- {drive: NAME, body: [BODY, BODY], what: x, value: SIGNAL}",
                                       "required: x | y | angle",
                                       "a signal is a number, an expression of t, or a form of" };
  for (size_t i = 0; i < sizeof items / sizeof *items; i++) assert_non_null (strstr (cli_out, items[i]));
}

/* All kinds: no line is too long, and whatever stands below each other begins in one column. */
TEST (list_columns) {
  cli_good ("pinwheel list kinds all");
  int column = 0, rows = 0;
  for (char *line = strtok (cli_out, "\n"); line; line = strtok (NULL, "\n")) {
    assert_true (strlen (line) <= 120);
    if (strncmp (line, "      ", 6) != 0 || line[6] == ' ') {
      column = line[4] == ' ' ? column : 0;
      continue;
    }
    const char *type = strstr (line + 6, "  ");
    assert_non_null (type);
    type += strspn (type, " ");
    if (column == 0) column = (int)(type - line);
    assert_int_equal (type - line, column);
    rows++;
  }
  assert_true (rows > 100);
}

TEST (show) {
  cli_good ("pinwheel show ezyroller --set a=0.75");
  static const char *const expected[] = { "frame",        "steer", "pin B", "wheel A", "wheel C",
                                          "torque rider", "omega", "rad/s", "0.75",    "N m" };
  for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) assert_non_null (strstr (cli_out, expected[i]));
  cli_good ("pinwheel show ezyroller --matrices");
  static const char *const named[] = { "frame.x", "steer.phi", "B.Fx", "B.Fy", "A.N", "C.N", "gamma" };
  for (size_t i = 0; i < sizeof named / sizeof *named; i++) assert_non_null (strstr (cli_out, named[i]));
  cli_good ("pinwheel show ezyroller --matrices --at 0.5");
  assert_non_null (strstr (cli_out, "0.5"));
}

/* gnuplot runs in a locale that knows all characters of the scripts, whatever the user's is. */
TEST (gnuplot_locale) {
  cli_write ("gnuplot", "#!/bin/sh\necho \"$LC_ALL\"\n");
  assert_int_equal (cli_run ("chmod +x @/gnuplot; PATH=\"@:$PATH\"; export LC_ALL=C; "
                             "pinwheel run ezyroller --t-end 0.1 --plots @/figures"),
                    0);
  assert_string_equal (cli_err, "C.UTF-8\n");
}

TEST (help) {
  static const char *const command[] = { "list", "show", "run", "new" };
  cli_good ("pinwheel");
  cli_good ("pinwheel --help");
  cli_good ("pinwheel --version");
  assert_int_equal (strncmp (cli_out, "pinwheel ", 9), 0);
  for (int i = 0; i < 5; i++) {
    const char *library = (const char *[]){ "\nSUNDIALS ", " KLU ", " LAPACK ", " GSL ", " NLopt " }[i],
               *at = strstr (cli_out, library);
    double major = 0;
    assert_non_null (at);
    assert_true (sscanf (at + strlen (library), "%lf", &major) == 1 && major > 0);
  }
  for (int i = 0; i < 4; i++) {
    cli_good (check_text ("pinwheel %s --help", command[i]));
    assert_non_null (strstr (cli_out, "--help"));
  }
}

/* `new` writes a model that runs as it is, and never over a file. */
TEST (new) {
  cli_good ("pinwheel new @/mine.c");
  cli_good ("pinwheel show @/mine.c");
  cli_good ("pinwheel run @/mine.c --t-end 1 --json -");
  assert_true (cli_says (cli_out, "status", "ok") && cli_says (cli_out, "model", "mine"));
  cli_bad ("pinwheel new @/mine.c", 2, "@/mine.c exists already and was not changed");
  cli_good ("mkdir '@/my models' \"@/it's\" && pinwheel new \"@/it's/car.c\"");
  assert_non_null (strstr (cli_out, "/it'\\''s/car.c'\n"));
  cli_good ("pinwheel new '@/my models/car.c'");
  assert_non_null (strstr (cli_out, "/my models/car.c'\n"));
}

const check_fixture fixture = { cli_setup, cli_teardown };
