/* pinwheel drift: residuals of stabilisations, effects of their options, files, failures, bad input. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* Columns of drift.csv, from 0. */
enum {
  GROUP,
  METHOD,
  ALPHA,
  BETA,
  EVERY,
  STATUS,
  TIME,
  POSITION,
  POSITION_LAST,
  POSITION_GROWTH,
  VELOCITY,
  VELOCITY_LAST,
  VELOCITY_GROWTH,
  BALANCE,
  BALANCE_LAST,
  BALANCE_GROWTH,
  STEPS
};

/* The cell of the row of a method, whose name is whole. */
static const char *drift_cell (const char *file, const char *method, int column) {
  static char cell[300];
  char name[100];
  const char *at = cli_file (file);
  assert_non_null (at);
  snprintf (name, sizeof name, ",%s,", method);
  at = strstr (at, name);
  if (at == NULL) fail_msg ("%s has no row of %s", file, method);
  at++;
  for (int i = METHOD; i < column; i++) at = strchr (at, ',') + 1;
  snprintf (cell, sizeof cell, "%.*s", (int)strcspn (at, ",\n"), at);
  return cell;
}

static double drift_number (const char *file, const char *method, int column) {
  return strtod (drift_cell (file, method, column), NULL);
}

/* A conservative pendulum's accelerations alone: velocities drift linearly, positions quadratically; projected they
 * stay at round-off, and with feedback within bounds. */
TEST (growth) {
  cli_good ("pinwheel drift pendulum --t-end 40 --step 0.005 --methods rk4+none,rk4+baumgarte,rk4+projection "
            "--only-methods --plots @/growth");
  const char *f = "growth/drift.csv";
  check_close ("growth of position", drift_number (f, "rk4+none", POSITION_GROWTH), 2, 0.2, "a few swings");
  check_close ("growth of velocity", drift_number (f, "rk4+none", VELOCITY_GROWTH), 1, 0.2, "a few swings");
  check_below ("growth with feedback", drift_number (f, "rk4+baumgarte", POSITION_GROWTH), 0.2, "stationary");
  assert_true (drift_number (f, "rk4+baumgarte", POSITION) < 0.1 * drift_number (f, "rk4+none", POSITION));
  check_below ("projected position", drift_number (f, "rk4+projection", POSITION), 16 * CHECK_EPS, "round-off");
  check_below ("projected velocity", drift_number (f, "rk4+projection", VELOCITY), 16 * CHECK_EPS, "round-off");
  assert_string_equal (drift_cell (f, "rk4+projection", POSITION_GROWTH), "nan");
  for (int q = POSITION; q <= BALANCE; q += 3)
    assert_true (drift_number (f, "rk4+none", q) >= drift_number (f, "rk4+none", q + 1));
}

/* The worst of all steps is what a run reports of itself. */
TEST (row_is_run) {
  static const char *const method[] = { "rk4+baumgarte", "erk8+none", "ida+ggl" };
  for (int m = 0; m < 3; m++) {
    char command[500];
    snprintf (
        command, sizeof command,
        "pinwheel drift snakeboard --methods %s --t-end 2 --step 0.01 --rtol 1e-5 --only-methods --plots @/as >@/out1; "
        "pinwheel run snakeboard --method %s --t-end 2 --step 0.01 --rtol 1e-5 --json -",
        method[m], method[m]);
    cli_good (command);
    const int column[2] = { POSITION, VELOCITY };
    const char *const key[2] = { "position", "velocity" };
    for (int i = 0; i < 2; i++) {
      double reported = cli_number (cli_out, "residual", key[i], NULL);
      check_close (key[i], drift_number ("as/drift.csv", method[m], column[i]), reported, 1e-14,
                   "a sample of ida's polynomial, round-off away from its step's end");
    }
    assert_true (drift_number ("as/drift.csv", method[m], STEPS) == cli_number (cli_out, "statistics", "steps", NULL));
  }
}

/* Every stabilisation of an integrator, each once; by default those of three. */
TEST (all_of_one) {
  cli_good ("pinwheel drift pendulum --t-end 0.1 --methods rk4+none,rk4+all --only-methods --plots @/one >@/out1; "
            "tail -n +2 @/one/drift.csv | cut -d, -f2");
  assert_string_equal (cli_out, "rk4+none\nrk4+baumgarte\nrk4+projection\nrk4+nullspace\n");
  cli_good ("pinwheel drift pendulum --t-end 0.1 --only-methods --plots @/usual >@/out1; "
            "tail -n +2 @/usual/drift.csv | cut -d, -f2 | sed 's/+.*//' | uniq");
  assert_string_equal (cli_out, "rk4\nida\ngalpha\n");
}

/* What the options do: seldom projections leave more, and a grid of alpha and beta has all its rows. */
TEST (options) {
  cli_good ("pinwheel drift pendulum --t-end 2 --step 0.01 --methods rk4+projection --vary alpha=0,5 --vary "
            "beta=1:100:3:log --vary every=1,4,16 --plots @/options && tail -n +2 @/options/drift.csv | cut -d, -f1 | "
            "uniq -c "
            "| tr -s ' ' && ls @/options");
  assert_non_null (
      strstr (cli_out,
              " 1 methods\n 6 baumgarte\n 6 projection\n"
              "drift-baumgarte.dat\ndrift-baumgarte.gp\ndrift-baumgarte.pdf\ndrift-baumgarte.png\n"
              "drift-baumgarte.svg\ndrift-projection.dat\ndrift-projection.gp\n"
              "drift-projection.pdf\ndrift-projection.png\ndrift-projection.svg\ndrift-time.csv\ndrift.csv\ndrift.dat\n"
              "drift.gp\ndrift.pdf\ndrift.png\ndrift.svg\n"));
  assert_null (strstr (cli_err, ".gp")); /* gnuplot has nothing to report, although 0 has no place on the axis */
  const char *f = "options/drift.csv";
  assert_true (drift_number (f, "rk4+baumgarte:alpha=5:beta=10", ALPHA) == 5);
  assert_true (drift_number (f, "rk4+baumgarte:alpha=5:beta=10", BETA) == 10);
  double one = drift_number (f, "rk4+projection:metric=mass:every=1", POSITION),
         four = drift_number (f, "rk4+projection:metric=mass:every=4", POSITION),
         sixteen = drift_number (f, "rk4+projection:metric=mass:every=16", POSITION);
  check_below ("projected always", one, 16 * CHECK_EPS, "round-off");
  assert_true (four > 100 * one && sixteen > four);
  assert_true (drift_number (f, "rk4+projection:metric=identity:every=4", EVERY) == 4);
}

/* Where options of a stabilisation vary, the integrator keeps its own, not those of its stabilisation in --methods. */
TEST (integrator_options) {
  cli_good ("pinwheel drift pendulum --t-end 1 --step 0.01 --vary alpha=5 --vary beta=10 --vary every=4 "
            "--methods galpha+ggl,erk5+projection:every=2:steps=fixed:inputs=held --plots @/own");
  const char *f = "own/drift.csv";
  assert_true (drift_number (f, "erk5+baumgarte:alpha=5:beta=10:steps=fixed:inputs=held", STEPS) == 100);
  assert_true (drift_number (f, "erk5+projection:metric=mass:every=4:steps=fixed:inputs=held", STEPS) == 100);
}

/* Each method of the curves against time has its points, the last one at the end. */
TEST (times) {
  cli_good (
      "pinwheel drift pendulum --t-end 2 --step 0.01 --methods rk4+none,ida+ggl --only-methods --plots @/times "
      ">@/out1; "
      "grep -c '^rk4+none,' @/times/drift-time.csv; grep '^ida+ggl,' @/times/drift-time.csv | tail -1 | cut -d, -f2");
  assert_string_equal (cli_out, "200\n2\n");
}

/* A run that fails is a row with its reason; the others go on. */
TEST (failure) {
  cli_good (
      "pinwheel drift ezyroller --t-end 2 --step 0.02 --methods rk4+none --vary alpha=10,1000 --vary beta=10 --vary "
      "every=1 --plots @/f");
  assert_string_equal (drift_cell ("f/drift.csv", "rk4+baumgarte:alpha=10:beta=10", STATUS), "ok");
  assert_string_equal (drift_cell ("f/drift.csv", "rk4+baumgarte:alpha=1000:beta=10", STATUS), "failed");
  double t = drift_number ("f/drift.csv", "rk4+baumgarte:alpha=1000:beta=10", TIME);
  assert_true (t > 0 && t < 2);
  assert_non_null (strstr (cli_out, "failed: t = "));
}

/* Interrupted in the middle: rows done stay. */
TEST (interrupt) {
  int status =
      cli_run ("\"${PINWHEEL:-build/pinwheel}\" drift ezyroller --t-end 4 --step 1e-3 --vary every=1,2 --plots @/i &\n"
               "p=$!; while kill -0 $! 2>/dev/null && ! grep -q '^methods,rk4' @/i/drift.csv.part 2>/dev/null; do "
               "sleep 0.02; done\n"
               "kill -TERM $p; wait $p; test $? = 130 && ls @/i");
  if (status != 0) return; /* it was quicker than the signal: nothing to see */
  assert_non_null (strstr (cli_out, "drift.csv.part\n"));
  assert_non_null (strstr (cli_err, "runs are done, and kept in"));
  assert_string_equal (drift_cell ("i/drift.csv.part", "rk4+none", STATUS), "ok");
}

/* Rows after the one that an interruption has stopped are below the heading of their group. */
TEST (interrupt_gap) {
  int status = cli_run ("\"${PINWHEEL:-build/pinwheel}\" drift ezyroller --t-end 2000 --step 0.1 --rtol 1e-12 --jobs 2 "
                        "--methods ida+ggl,rk4+projection --only-methods &\n"
                        "sleep 1; kill -TERM $!; wait $!");
  const char *row = strstr (cli_out, "\nrk4+projection ");
  assert_true (status == 0 || status == 130);
  if (status == 0 || row == NULL) return; /* all runs, or none of rk4, ended before the signal: nothing to see */
  assert_non_null (strstr (cli_out, "\nmethods "));
  assert_true (strstr (cli_out, "\nmethods ") < row);
}

/* No figure against alpha if it is 0, which a logarithmic axis does not show. */
TEST (alpha_zero) {
  cli_good ("pinwheel drift pendulum --t-end 0.1 --step 0.01 --methods rk4 --vary alpha=0 --vary beta=1 --vary every=1 "
            "--plots @/zero && test ! -e @/zero/drift-baumgarte.gp");
}

/* Rows that have been written are kept, and named. */
TEST (kept) {
  assert_int_equal (cli_run ("(ulimit -f 2; pinwheel drift pendulum --t-end 1 --step 0.01 --plots @/full)"), 1);
  assert_non_null (strstr (cli_err, "pinwheel: the runs so far are kept in "));
  assert_non_null (cli_file ("full/drift.csv.part"));
  assert_int_equal (cli_run ("(ulimit -f 20; pinwheel drift pendulum --only-methods --t-end 1 --plots @/time)"), 1);
  assert_non_null (strstr (cli_err, "time/drift-time.csv.part\n"));
}

TEST (bad) {
  const cli_wrong bad[] = {
    { "ezyrolle", "there is no model \"ezyrolle\"; did you mean \"ezyroller\"?" },
    { "ezyroller --methods rk4+nome", "integrator rk4 has no stabilisation \"nome\"; did you mean \"none\"?" },
    { "ezyroller --methods rk5+all", "there is no integrator \"rk5\"; did you mean \"erk5\"?" },
    { "ezyroller --methods rk4+none+all", "method \"rk4+none+all\": expected INTEGRATOR+STABILISATION:OPTION=VALUE" },
    { "ezyroller --step 0", "--step 0: expected a number > 0" },
    { "ezyroller --vary alfa=1", "--vary alfa=1: alpha, beta and every can be varied; did you mean \"alpha\"?" },
    { "ezyroller --vary alpha=-1", "--vary alpha=-1: expected a number >= 0" },
    { "ezyroller --vary every=1.5", "--vary every=1.5: expected a whole number >= 1" },
    { "ezyroller --methods rk4 --vary alpha=1:1e6:100000", "400015 runs are too many; vary less" },
    { "ezyroller --only-methods --vary alpha=1", "--vary alpha=1: not with --only-methods" },
    { "ezyroller --stp 3", "drift has no option \"--stp\"; did you mean \"--step\"?" },
  };
  cli_bad_each ("drift", bad, sizeof bad / sizeof *bad);
  int status =
      cli_run ("pinwheel drift ezyroller --t-end 2 --step 0.02 --methods rk4+baumgarte:alpha=1000 --only-methods");
  assert_int_equal (status, 4);
  assert_non_null (strstr (cli_err, "pinwheel: no method has reached the end; the last error: t = "));
}

/* Concurrent runs, the longest of which begins first, appear in their order with the same numbers. */
TEST (jobs) {
  cli_good (
      "pinwheel drift pendulum --t-end 2 --methods ida+ggl,rk4+projection,erk5+none,bdf+projection --only-methods "
      "--jobs 1 --plots @/jobs1");
  cli_good (
      "pinwheel drift pendulum --t-end 2 --methods ida+ggl,rk4+projection,erk5+none,bdf+projection --only-methods "
      "--jobs 3 --plots @/jobs3");
  char *one = strdup (cli_file ("jobs1/drift.csv"));
  assert_string_equal (cli_file ("jobs3/drift.csv"), one);
  free (one);
  cli_bad ("pinwheel drift pendulum --jobs 0", 2, "--jobs 0: expected a whole number >= 1");
}

const check_fixture fixture = { cli_setup, cli_teardown };
