/* `pinwheel sensitivity`: closed forms, outputs against differences of runs, files, refusals. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* The numbers in the last row of sensitivity.csv. */
static int sensitivity_last (double *value) {
  const char *text = cli_file ("sens/sensitivity.csv");
  assert_non_null (text);
  size_t n = strlen (text) - 1;
  while (text[n - 1] != '\n') n--;
  int count = 0;
  for (const char *at = text + n; at && count < CLI_MOST; at = strchr (at, ',')) {
    if (*at == ',') at++;
    value[count++] = strtod (at, NULL);
  }
  return count;
}

/* ---- Closed forms ---- */

/* theta = (k/a) (gd (s t + c) - gd (c)), k^2 = I/m + a^2, A^2 = u0^2 + k^2 w0^2, s = a A/k^2, c = artanh (u0/A), at t
 * = 20, differentiated with 30 digits. */
TEST (sleigh) {
  static const double expected[] = { -2.19064940477924161196941078323, 4.38129880955848322393882156646,
                                     -23.1682436429820667965804011701, -3.52690525296758368801569681518,
                                     -1.6156668371657765493636643037 };
  double x[CLI_MOST], error[CLI_MOST];
  cli_good ("pinwheel sensitivity chaplygin-sleigh --of sleigh.phi --by m --by I --by a --by u0 --by w0 -o "
            "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens");
  assert_int_equal (sensitivity_last (x), 7);
  for (int i = 0; i < 5; i++)
    check_close ("derivative", x[2 + i], expected[i], 1e-8 * fabs (expected[i]),
                 "steps of 1e-9, about 20 of them matter");
  assert_int_equal (cli_sensitivity ("error", error), 5);
  for (int i = 0; i < 5; i++) {
    check_below ("derivative", fabs (x[2 + i] - expected[i]), error[i], "the estimate is that of order 4");
    check_below ("error", error[i], 2e-8 * fabs (expected[i]), "twice steps of 1e-9, about 20 of them matter");
  }
  assert_non_null (strstr (cli_out, "  a [m]                   0.25   -23.1682436  rad per m"));
}

/* The motion of a pendulum is a function of t sqrt (g/l): dphi/dl = -omega t / (2 l), dphi/dg = omega t / (2 g). */
TEST (pendulum) {
  double x[CLI_MOST];
  cli_good ("pinwheel sensitivity pendulum --of bob.phi --of bob.omega --by l --by g -o @/sens/sensitivity.csv --json "
            "@/sens/sensitivity.json --plots @/sens --method erk8+projection "
            "--rtol 1e-11");
  assert_int_equal (sensitivity_last (x), 7);
  check_close ("dphi/dl", x[2], -x[4] * 10 / 2, 2e-8 * fabs (x[2]), "steps of 1e-9, 10 s");
  check_close ("dphi/dg", x[3], x[4] * 10 / (2 * 9.81), 2e-8 * fabs (x[3]), "steps of 1e-9, 10 s");
}

/* x = g sin (alpha) sin^2 (w t) / (2 w^2) on the incline: blade and gravity. */
TEST (incline) {
  double x[CLI_MOST], s = sin (10), k = s * s / 2, y = (10 - sin (20) / 2) / 2;
  cli_good ("pinwheel sensitivity knife-edge-incline --of skate.x --of skate.y --by g --by alpha --by w -o "
            "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens");
  assert_int_equal (sensitivity_last (x), 9);
  check_close ("dx/dg", x[2], 0.5 * k, 1e-8, "steps of 1e-9, 10 s");
  check_close ("dx/dalpha", x[3], 9.81 * cos (PW_PI / 6) * k, 1e-8, "steps of 1e-9, 10 s");
  check_close ("dx/dw", x[4], 9.81 / 2 * (10 * s * cos (10) - 2 * k), 1e-7, "steps of 1e-9, a derivative of 30");
  check_close ("dy/dg", x[6], 0.5 * y, 1e-8, "steps of 1e-9, 10 s");
}

/* A torque that no step resolves, so late that steps vanish in the round-off of the time. */
TEST (late) {
  cli_write ("late.yaml", "pinwheel: 1\nrun: {t_end: 2e5, method: rk4, step: 1e3}\nparameters: [{name: p, value: 1}]\n"
                          "bodies: [{name: b, mass: 1, inertia: 1, rate: {omega: 1e4}}]\nelements:\n"
                          "  - {torque: T, body: [b, ground], value: \"p*1e12*max(0, t - 1e5)*sin(1e15*t)\"}\n");
  assert_int_equal (cli_run ("pinwheel sensitivity @/late.yaml --of b.phi --by p --limit 20"), 4);
  assert_non_null (strstr (cli_err, "pinwheel: t = "));
}

/* ---- Outputs of every type, against differences of runs ---- */

static const char sensitivity_outputs[] = " --of frame.x --of rider.work --of A.N --of B.Fx --of A.x --of kinetic "
                                          "--of max:frame.omega --of max:C.N --of min:frame.y --of mean:kinetic "
                                          "--of rms:frame.vx --of integral:frame.x --of 'frame.x / max:rider.work' ";

static void sensitivity_values (const char *name, double value, double *out) {
  char command[800];
  snprintf (command, sizeof command,
            "pinwheel sensitivity ezyroller -t 3%s--by M0 --%s=%.17g -o @/sens/sensitivity.csv --json "
            "@/sens/sensitivity.json --plots @/sens",
            sensitivity_outputs, name, value);
  double all[CLI_MOST];
  cli_shell (command); /* initial values changed by the constraints are reported */
  assert_int_equal (cli_sensitivity ("value", all), 26);
  for (int i = 0; i < 13; i++) out[i] = all[2 * i]; /* each output's, then that of M0 */
}

static void sensitivity_compare (const char *by, const char *name, double value, double step) {
  double derivative[CLI_MOST], x[4][13];
  cli_good (check_text ("pinwheel sensitivity ezyroller -t 3%s--by %s -o @/sens/sensitivity.csv --json "
                        "@/sens/sensitivity.json --plots @/sens",
                        sensitivity_outputs, by));
  assert_int_equal (cli_sensitivity ("derivative", derivative), 13);
  for (int k = 0; k < 4; k++) sensitivity_values (name, value + (k < 2 ? k - 2 : k - 1) * step, x[k]);
  for (int i = 0; i < 13; i++) {
    double one = (x[2][i] - x[1][i]) / (2 * step), two = (x[3][i] - x[0][i]) / (4 * step),
           by_runs = (4 * one - two) / 3;
    check_close (by, derivative[i], by_runs, fabs (one - two) / 10 + 1e-7 * fabs (by_runs) + 1e-8,
                 "extrapolated differences of runs");
  }
}

TEST (outputs) {
  sensitivity_compare ("a", "set=a", 0.5, 1e-3);
  sensitivity_compare ("M0", "set=M0", 0.1, 1e-4);
  sensitivity_compare ("frame.phi", "start=frame.phi", 0, 1e-3);
}

/* phi = exp (s - 40 + z) t^2 / 2: differences are extrapolated, on both sides of s, and on one side of z = 0, the end
 * of its domain.  A drive along cos t does the work I sin^2 (t) / 2: by the derivative of its multiplier. */
TEST (parameters) {
  double x[CLI_MOST], error[CLI_MOST];
  cli_write (
      "wheels.yaml",
      "pinwheel: 1\nparameters:\n  - {name: s, value: 40}\n  - {name: z, value: 0, domain: nonnegative}\n"
      "  - {name: I, value: 3, unit: kg m^2}\n"
      "bodies:\n  - {name: free, mass: 1, inertia: 1}\n  - {name: driven, mass: 1, inertia: I, start: {phi: 1}}\n"
      "elements:\n  - {torque: T, body: [free, ground], value: exp(s - 40 + z)}\n"
      "  - {drive: D, body: [driven, ground], what: angle, value: {harmonic: {amplitude: 1, omega: 1}}}\n");
  cli_good ("pinwheel sensitivity @/wheels.yaml --of free.phi --of D.work --by s --by z --by I -t 2 -o "
            "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens");
  assert_int_equal (cli_sensitivity ("derivative", x), 6);
  assert_int_equal (cli_sensitivity ("error", error), 6);
  check_close ("dphi/ds", x[0], 2, error[0], "the claim");
  check_below ("error", error[0], 1e-8, "eight digits");
  check_close ("dphi/dz", x[1], 2, error[1], "the claim");
  check_below ("error", error[1], 1e-7, "one-sided formulas, with larger weights");
  check_close ("dwork/dI", x[5], pow (sin (2), 2) / 2, 1e-9, "steps of 1e-9");
}

/* Integrals over 200 periods, against differences. */
TEST (oscillation) {
  double x[2], value[2][CLI_MOST];
  cli_write ("fast.yaml",
             "pinwheel: 1\nparameters:\n  - {name: c, value: 0.05, unit: N s/m}\n"
             "bodies:\n  - {name: a, mass: 1, inertia: 1, start: {x: 1.1}}\n"
             "elements:\n  - {spring: S, body: [ground, a], at: [[0, 0], [0, 0]], stiffness: 3943.84, damping: c, "
             "length: 1}\n");
  cli_good ("pinwheel sensitivity @/fast.yaml --of rms:a.vx --of mean:kinetic --by c -t 20 -o @/sens/sensitivity.csv "
            "--json @/sens/sensitivity.json --plots @/sens --every 20");
  assert_int_equal (cli_sensitivity ("derivative", x), 2);
  for (int i = 0; i < 2; i++) {
    cli_good (i ? "pinwheel sensitivity @/fast.yaml --of rms:a.vx --of mean:kinetic --by c -t 20 -o "
                  "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens --set c=0.0505"
                : "pinwheel sensitivity @/fast.yaml --of rms:a.vx --of mean:kinetic --by c -t 20 -o "
                  "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens --set c=0.0495");
    assert_int_equal (cli_sensitivity ("value", value[i]), 4);
  }
  for (int i = 0; i < 2; i++)
    check_close ("derivative", x[i], (value[1][2 * i] - value[0][2 * i]) / 0.001, 1e-4 * fabs (x[i]),
                 "differences: (dc t)^2 / 24");
}

/* Integrals of reactions, which jump at breakpoints that move, against differences. */
TEST (jumping_integrals) {
  static const char command[] =
      "pinwheel sensitivity @/rod.yaml --of integral:A.Fx --of rms:A.Fx --of mean:A.Fy --of F.work "
      "--by s --by w -o @/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens -m erk8+projection --rtol "
      "1e-11 --set s=%g --set w=%g";
  double x[CLI_MOST], value[2][CLI_MOST];
  char text[400];
  cli_write ("rod.yaml", "pinwheel: 1\nrun: {t_end: 2}\nparameters:\n  - {name: s, value: 0.5, unit: s}\n"
                         "  - {name: w, value: 0.7, unit: s}\n"
                         "bodies:\n  - {name: rod, mass: 1, inertia: 0.1, start: {x: 1}}\n"
                         "elements:\n  - {pin: A, body: [ground, rod], at: [[0, 0], [-1, 0]]}\n"
                         "  - {force: F, body: rod, fx: {pulse: {height: 3, start: s, width: w}}}\n"
                         "  - {gravity: g, acceleration: [0, -9.81]}\n");
  snprintf (text, sizeof text, command, 0.5, 0.7);
  cli_good (text);
  assert_int_equal (cli_sensitivity ("derivative", x), 8);
  for (int p = 0; p < 2; p++) {
    for (int i = 0; i < 2; i++) {
      double h = i ? 1e-4 : -1e-4;
      snprintf (text, sizeof text, command, p == 0 ? 0.5 + h : 0.5, p == 1 ? 0.7 + h : 0.7);
      cli_good (text);
      assert_int_equal (cli_sensitivity ("value", value[i]), 12); /* each output's, then those of s and w */
    }
    for (int o = 0; o < 4; o++)
      check_close ("derivative", x[2 * o + p], (value[1][3 * o] - value[0][3 * o]) / 2e-4, 1e-5, "differences of 1e-4");
  }
  static const char *const methods[] = { "adams", "bdf", "ida", "radau", "galpha", "leapfrog" };
  for (size_t k = 0; k < sizeof methods / sizeof *methods; k++) {
    double other[CLI_MOST];
    snprintf (text, sizeof text, command, 0.5, 0.7);
    char *at = strstr (text, "erk8+projection");
    snprintf (at, sizeof text - (size_t)(at - text), "%s --rtol 1e-8", methods[k]);
    cli_shell (text);
    assert_int_equal (cli_sensitivity ("derivative", other), 8);
    for (int i = 0; i < 8; i++)
      check_close (methods[k], other[i], x[i], 2e-3 * (1 + fabs (x[i])), "steps of 1 ms with order 2");
  }
}

/* A breakpoint that moves: the accelerations before it and after it differ, whatever the times of rows. */
TEST (pulse) {
  double x[2][CLI_MOST];
  cli_write (
      "pulse.yaml",
      "pinwheel: 1\nparameters:\n  - {name: s, value: 0.5, unit: s}\n"
      "bodies:\n  - {name: block, mass: 2, inertia: 0.1, start: {x: 0.8}}\nelements:\n"
      "  - {force: F, body: block, at: [0, 0], fx: {pulse: {height: 2, start: s, width: 0.5}}}\n"
      "  - {spring: K, body: [block, ground], at: [[0, 0], [0, 0]], stiffness: 60, damping: 2.4, length: 0.8}\n");
  for (int i = 0; i < 2; i++) {
    cli_good (i ? "pinwheel sensitivity @/pulse.yaml --of K.loss --by s -t 2 --every 0.05 -o @/sens/sensitivity.csv "
                  "--json @/sens/sensitivity.json --plots @/sens"
                : "pinwheel sensitivity @/pulse.yaml --of K.loss --by s -t 2 --every 0.001 -o @/sens/sensitivity.csv "
                  "--json @/sens/sensitivity.json --plots @/sens");
    assert_int_equal (sensitivity_last (x[i]), 3);
    check_close ("loss", x[i][2], -0.0511971431, 1e-9, "extrapolated differences of runs, 9 digits");
  }
  cli_write ("spin.yaml",
             "pinwheel: 1\nparameters:\n  - {name: M, value: 1, unit: N m}\n"
             "bodies:\n  - {name: block, mass: 1, inertia: 1}\nelements:\n"
             "  - {torque: T, body: [block, ground], value: {pulse: {height: M, start: 0.35, width: 0.3}}}\n");
  cli_good ("pinwheel sensitivity @/spin.yaml --of mean:block.omega --by M -t 1 --every 1e9 -o @/sens/sensitivity.csv "
            "--json @/sens/sensitivity.json --plots @/sens");
  assert_int_equal (cli_sensitivity ("derivative", x[0]), 1);
  check_close ("mean", x[0][0], 0.15, 1e-9, "0.3 s of angular acceleration at 0.5 s, whatever the rows of the table");
}

/* A maximum between two breakpoints, however near the next one is: for p < t < q the motion is x = 0.1 cos 2t + 0.25
 * sin 2t + (1 - cos 2 (t - p)) / 4, so that dx/dp = -sin (2 (t - p)) / 2. */
TEST (extremum) {
  const double p = 0.4, t = (PW_PI - atan ((1 - sin (2 * p)) / (cos (2 * p) - 0.4))) / 2;
  double slope[2];
  cli_write ("steps.yaml", "pinwheel: 1\nparameters: [{name: p, value: 0.4}, {name: q, value: 1.2}]\n"
                           "bodies: [{name: a, mass: 1, inertia: 1, start: {x: 0.1}, rate: {vx: 0.5}}]\nelements:\n"
                           "  - {force: s, body: a, fx: -4*a.x}\n"
                           "  - {force: f, body: a, fx: {pulse: {height: 1, start: p, width: 100}}}\n"
                           "  - {force: g, body: a, fx: {pulse: {height: -1, start: q, width: 100}}}\n");
  for (int i = 0; i < 2; i++) {
    cli_good (i ? "pinwheel sensitivity @/steps.yaml --of max:a.x --by p -t 4 -m erk8+none --rtol 1e-9 -o "
                  "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens"
                : "pinwheel sensitivity @/steps.yaml --of max:a.x --by p -t 4 -m erk8+none --rtol 1e-9 --set q=1.4 "
                  "-o @/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens");
    assert_int_equal (cli_sensitivity ("derivative", slope + i), 1);
    check_close ("slope", slope[i], -sin (2 * (t - p)) / 2, 1e-7, "rtol 1e-9");
  }
}

/* A reaction h + 5 t for 0.2 s <= t < 0.5 s, else 5 t: at a breakpoint, where the run ends; largest just before one. */
TEST (beside_breakpoint) {
  double slope[2];
  cli_write ("held.yaml", "pinwheel: 1\nparameters: [{name: h, value: 3}]\n"
                          "bodies: [{name: rod, mass: 1, inertia: 0.1, start: {x: 1}}]\nelements:\n"
                          "  - {pin: A, body: [ground, rod], at: [[0, 0], [-1, 0]]}\n"
                          "  - {force: F, body: rod, fx: 5*t}\n"
                          "  - {force: P, body: rod, fx: {pulse: {height: h, start: 0.2, width: 0.3}}}\n");
  for (int i = 0; i < 2; i++) {
    cli_good (i ? "pinwheel sensitivity @/held.yaml --of max:A.Fx --by h -t 0.55 -o @/sens/sensitivity.csv --json "
                  "@/sens/sensitivity.json --plots @/sens"
                : "pinwheel sensitivity @/held.yaml --of A.Fx --by h -t 0.2 -o @/sens/sensitivity.csv --json "
                  "@/sens/sensitivity.json --plots @/sens");
    assert_int_equal (cli_sensitivity ("derivative", slope + i), 1);
    check_close ("slope", slope[i], 1, 1e-9, "round-off of differences");
  }
}

/* ---- Files ---- */

TEST (files) {
  cli_good ("pinwheel sensitivity pendulum --of bob.x --of max:bob.x --by l -t 1 --every 0.25 -o "
            "@/sens/sensitivity.csv --json @/sens/sensitivity.json --plots @/sens");
  const char *csv = cli_file ("sens/sensitivity.csv"), *head = "t [s],bob.x [m],d(bob.x)/d(l) [m per m]\n";
  int lines = 0;
  assert_int_equal (strncmp (csv, head, strlen (head)), 0);
  for (; *csv; csv++) lines += *csv == '\n';
  assert_int_equal (lines, 6); /* without columns for the maximum */
  const char *json = cli_file ("sens/sensitivity.json");
  assert_true (cli_says (json, "model", "pendulum"));
  assert_true (cli_says (json, "output", "bob.x"));
  assert_true (cli_says (json, "unit", "m"));
  cli_good ("pinwheel sensitivity roller-racer --of rear.x --of seat.x --by a -t 3 -o @/sens/sensitivity.csv --json "
            "@/sens/sensitivity.json --plots @/sens");
  double x[2];
  assert_int_equal (cli_sensitivity ("error", x), 2);
  check_close ("error of a contact point", x[0] / x[1], 1, 0.1, "0.1 m from the centre of mass");
  assert_non_null (strstr (json, "\"complete\": true"));
  assert_non_null (cli_file ("sens/sensitivity.svg"));
  cli_good ("pinwheel sensitivity pendulum --of 2*bob.x --by l -t 1 -o @/sens/sensitivity.csv --json "
            "@/sens/sensitivity.json --plots @/sens");
  assert_non_null (strstr (cli_file ("sens/sensitivity.gp"), "label_1 = 'l × ∂/∂l'\n"));
}

/* ---- The command ---- */

/* Outputs that differ after 400 characters have different columns. */
TEST (long_names) {
  char sum[600] = "bob.phi";
  while (strlen (sum) < 400) strcat (sum, "+bob.phi");
  char column[2000];
  cli_good (check_text ("pinwheel sensitivity pendulum --of %s --of %s-1 --by m -t 0.1 -o @/sens/sensitivity.csv "
                        "--json @/sens/sensitivity.json --plots @/sens",
                        sum, sum));
  snprintf (column, sizeof column, "t [s],%s,d(%s)/d(m),%s-1,d(%s-1)/d(m)\n", sum, sum, sum, sum);
  assert_int_equal (strncmp (cli_file ("sens/sensitivity.csv"), column, strlen (column)), 0);
}

/* Ctrl-C at a certain evaluation, in any of the runs: it is no failure of that run, and the result is not taken for
 * complete. */
static void sensitivity_interrupt (const char *reads) {
  int status = 130, interrupted = 0, calls = 4000;
  cli_write ("stop.c",
             "#include <signal.h>\n#include <stdlib.h>\n#include \"pinwheel.h\"\n"
             "typedef struct { double k; } numbers;\n"
             "static const pw_parameter list[] = { { PW_AT (numbers, k), 1 }, { .name = NULL } };\n"
             "static const char *const reads[] = { \"a.vx\", NULL };\n"
             "static long calls;\n"
             "static int force (void *c, double t, const double *x, double *u, double *g) {\n"
             "  (void)c, (void)x;\n"
             "  if (g) *g = 0;\n"
             "  u[0] = t, u[1] = 1, u[2] = 0;\n"
             "  if (++calls == atol (getenv (\"CALLS\"))) raise (SIGINT);\n"
             "  return 0;\n"
             "}\n"
             "static void build (pw_model *m, const void *p) {\n"
             "  pw_add_body (m, &(pw_body){ .name = \"a\", .mass = 1, .inertia = 1, .start = { 1, 0, 0 } });\n"
             "  pw_add_force (m, &(pw_force){ .name = \"F\", .body = \"a\",\n"
             "    .fx = { PW_FUNCTION,\n"
             "            .function = { .eval = force, .reads = getenv (\"READS\") ? reads : NULL } } });\n"
             "  pw_add_spring (m, &(pw_spring){ .name = \"s\", .body = { \"a\", \"ground\" },\n"
             "                                  .stiffness = ((const numbers *)p)->k });\n"
             "}\n"
             "PW_MODEL (.about = \"interrupts\", .parameters = list, .parameters_size = sizeof (numbers),\n"
             "          .run = { .t_end = 20, .method = \"erk5+projection\" }, .build = build);\n");
  char command[200], complete[2000];
  snprintf (command, sizeof command, "%s CALLS=0 pinwheel sensitivity @/stop.c --of max:a.x --by k --jobs 1", reads);
  cli_good (command);
  snprintf (complete, sizeof complete, "%.1999s", cli_out);
  for (; status == 130; calls += 4000) {
    snprintf (command, sizeof command, "%s CALLS=%d pinwheel sensitivity @/stop.c --of max:a.x --by k --jobs 1", reads,
              calls);
    status = cli_run (command);
    if (status == 130) assert_non_null (strstr (cli_err, "pinwheel: interrupted; results are incomplete\n"));
    interrupted += status == 130;
  }
  assert_int_equal (status, 0); /* it ended before */
  assert_string_equal (cli_err, "");
  assert_true (interrupted > 5 && strcmp (cli_out, complete) == 0);
}

/* The second force depends on the state. */
TEST (interrupt) {
  sensitivity_interrupt ("");
  sensitivity_interrupt ("READS=1");
}

TEST (refusals) {
  static const cli_wrong each[] = {
    { "pendulum --by l", "--of is missing: expected an output, such as frame.x" },
    { "pendulum --of bob.x", "--by is missing: expected a parameter or an initial value" },
    { "pendulum --of bob.z --by l", "--of bob.z: no column \"bob.z\"; did you mean \"bob.x\"?" },
    { "pendulum --of bob.x --by ll", "model pendulum has no parameter \"ll\"; did you mean \"l\"?" },
    { "pendulum --of bob.x --by bob.z", "model pendulum has no state \"bob.z\"; valid are x, y, phi, vx, vy, omega" },
    { "pendulum --of bob.x --by l --by l", "--by l is given twice" },
    { "pendulum --of bob.phi --by bob.x --by bob.phi", "--by bob.x: it cannot change while the other initial values of "
                                                       "--by and --start are kept: constraints determine it" },
    { "chain --of link1.x --by n", "n is a count (10): derivatives need a number that varies continuously" },
    { "slider-crank --of crank.phi --by g",
      "g changes the number of bodies or elements: derivatives with respect to it do not exist" },
    { "pendulum --of bob.x --by l --method rk4:inputs=held",
      "derivatives need inputs=stage: held inputs depend on the steps" },
  };
  cli_bad_each ("sensitivity", each, sizeof each / sizeof *each);
  cli_bad ("pinwheel sensitivity pendulum --of 'sqrt(-bob.x^2-1)' --by l -t 1", 4,
           "sqrt(-bob.x^2-1) is not a finite number at the end of the run");
  cli_run ("pinwheel sensitivity pendulum --of bob.x --by l -t 1 --method rk4+none --rtol 1e-9");
  assert_string_equal (cli_err, "pinwheel: --rtol has no effect: rk4+none takes steps of --step\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
