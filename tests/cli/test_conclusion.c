/* The conclusion of `pinwheel compare`: the cost of each method for an error, relative to the cheapest. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "compare_table.h"

/* A word, from 0, of the line of the conclusion that begins with a name. */
static const char *compare_word (const char *name, int word) {
  static char text[80];
  char line[100];
  snprintf (line, sizeof line, "\n%s ", name);
  const char *at = strstr (cli_out, line);
  assert_non_null (at);
  at += strlen (line);
  for (int i = 0;; i++) {
    at += strspn (at, " ");
    size_t n = strcspn (at, " \n");
    snprintf (text, sizeof text, "%.*s", (int)n, at);
    if (i == word) return text;
    at += n;
  }
}

/* The processor time of the method with rows `from` to `to` - 1 for an error, in a pendulum of 1 m: errors of lengths
 * and angles count alike.  NaN if it is not reached. */
static double compare_cost (const char *file, int from, int to, double error) {
  double before = 0, least = NAN;
  for (int row = from; row < to; row++) {
    double length = compare_number (file, row, MOST), angle = compare_number (file, row, MOST + 1),
           here = fmax (length, angle), cpu = compare_number (file, row, CPU), cost = cpu;
    if (here <= error && before > error) {
      double cpu_before = compare_number (file, row - 1, CPU), part = log (error / before) / log (here / before);
      cost = fmin (cpu, exp (log (cpu_before) + part * log (cpu / cpu_before)));
    }
    if (here <= error) least = fmin (least, cost); /* NaN: none so far */
    before = here;
  }
  return least;
}

/* Costs are interpolated between rows and relative to the cheapest; rows appear only on demand. */
TEST (costs) {
  static const char *const error[] = { "1e-3", "1e-6", "1e-9" };
  const int rows = 6; /* of each method; the second one does not reach 6 digits, none reaches 9 */
  cli_good ("pinwheel compare pendulum --methods erk5+projection,ida+ggl --t-end 10 --rtol-ladder 1e-3:1e-8 "
            "--repeats 1 --plots @/end");
  assert_null (strstr (cli_out, "residual of"));
  assert_non_null (strstr (cli_out, "the largest error of a coordinate at 100 times up to 10 s, relative to\n1 m "
                                    "(lengths), 1 rad (angles). The reference has 14."));
  for (int k = 0; k < 3; k++) {
    double erk5 = compare_cost ("end/compare.csv", 0, rows, strtod (error[k], NULL));
    assert_string_equal (compare_word ("cheapest", k), k < 2 ? "erk5+projection" : "-");
    assert_string_equal (compare_word ("erk5+projection", k), k < 2 ? "1.0" : "not");
    if (k < 2) check_close ("time", strtod (compare_word ("its time", 2 * k), NULL), 1e3 * erk5, 51 * erk5, "2 digits");
  }
  double ratio = strtod (compare_word ("ida+ggl", 0), NULL),
         known =
             compare_cost ("end/compare.csv", rows, 2 * rows, 1e-3) / compare_cost ("end/compare.csv", 0, rows, 1e-3);
  check_close ("ratio", ratio, known, known < 9.95 ? 0.0501 : 0.501, "the digits printed");
  assert_string_equal (compare_word ("ida+ggl", 1), "not");
  assert_string_equal (compare_word ("ida+ggl", 3), "not");
  cli_good ("pinwheel compare pendulum --methods rk4+projection --table --t-end 1 --step-ladder 0.1:0.05 --repeats 1");
  assert_non_null (strstr (cli_out, "residual of"));
  assert_non_null (strstr (cli_out, "\nrk4+projection      0.05 "));
  assert_non_null (strstr (cli_out, "\ncheapest "));
}

/* Nothing is extrapolated: a cost below the loosest level is a bound, and what the limit ends keeps the levels
 * before. */
TEST (bounds) {
  cli_good ("pinwheel compare pendulum --methods rk4+projection --t-end 1 --step-ladder 0.01:1e-9 --limit 0.05 "
            "--repeats 1");
  assert_string_equal (compare_word ("rk4+projection", 0), "<1.0");
  assert_string_equal (compare_word ("rk4+projection", 2), "1.0");
  assert_non_null (strstr (cli_out, "\n< marks an upper bound: "));
  assert_non_null (strstr (cli_out, "\nstopped by the limit of 0.05 s: rk4+projection from "));
  /* the run with steps of 0.05 s fails: how many digits it would have is unknown */
  cli_write ("fails.c", "#include <math.h>\n#include \"pinwheel.h\"\nstatic _Thread_local double before;\n"
                        "static int force (void *c, double t, const double *x, double *u, double *g) {\n"
                        "  double stage = t - before;\n"
                        "  (void)c, (void)x, (void)g;\n"
                        "  before = t, u[0] = u[1] = u[2] = 0;\n"
                        "  return fabs (stage - 0.025) < 1e-9;\n"
                        "}\n"
                        "static void build (pw_model *m, const void *p) {\n"
                        "  (void)p;\n"
                        "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1,\n"
                        "    .start = { 1, 0, 0 } });\n"
                        "  pw_add_spring (m, &(pw_spring){ .name = \"s\", .stiffness = 1,\n"
                        "    .body = { \"a\", \"ground\" } });\n"
                        "  pw_add_force (m, &(pw_force){ .name = \"F\", .body = \"a\",\n"
                        "    .fx = { PW_FUNCTION, .function = { .eval = force } } });\n"
                        "}\n"
                        "PW_MODEL (.about = \"fails\", .build = build);\n");
  cli_good ("pinwheel compare @/fails.c --methods rk4+none --t-end 2 --step-ladder 0.1:0.025 --repeats 1");
  assert_non_null (strstr (cli_out, "\nrk4+none: 1 of 3 runs fail, first at step 0.05: "));
  assert_string_equal (compare_word ("rk4+none", 1), "<1.0");
}

/* A chaotic motion is not known to 9 digits: the conclusion does not compare methods there. */
TEST (uncertain) {
  cli_write ("chaos.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, start: {x: 1}}\n"
                           "  - {name: b, mass: 1, start: {x: 2}}\nelements:\n"
                           "  - {pin: A, body: [a, ground], at: [[-1, 0], [0, 0]]}\n"
                           "  - {pin: B, body: [a, b], at: [[0, 0], [-1, 0]]}\n"
                           "  - {gravity: g, acceleration: [0, -10]}\n");
  cli_good ("pinwheel compare @/chaos.yaml --methods erk8+projection --t-end 20 --rtol-ladder 1e-12 --repeats 1");
  assert_string_equal (compare_word ("cheapest", 2), "-");
  assert_non_null (strstr (cli_out, " uncertain\n"));
  assert_non_null (strstr (cli_out, "not accurate enough to distinguish methods"));
}

/* One line for each method with failures. */
TEST (failures) {
  cli_good ("pinwheel compare pendulum --methods erk5+none,erk5+projection --t-end 20 --rtol-ladder 1e-3:1e-5 "
            "--repeats 1");
  const char *line = strstr (cli_out, "\nerk5+none: 1 of 3 runs fail, first at rtol 0.001: t = 7.0");
  assert_non_null (line);
  assert_non_null (strstr (line, "pin pivot"));
  assert_null (strstr (cli_out, "\nerk5+projection: "));
}

/* Without a coordinate to compare there is no conclusion, but rows. */
TEST (none) {
  cli_write ("speed.csv", "t,frame.vx\n1,0\n2,0\n");
  cli_good ("pinwheel compare ezyroller --methods rk4 --reference @/speed.csv --repeats 1 --step-ladder 0.1");
  assert_null (strstr (cli_out, "cheapest"));
  assert_non_null (strstr (cli_out, "\n  it contains none of 6 coordinates\n"));
  assert_non_null (strstr (cli_out, "\nrk4          0.1 "));
}

const check_fixture fixture = { cli_setup, cli_teardown };
