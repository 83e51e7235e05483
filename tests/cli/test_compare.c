/* pinwheel compare: rows and ladders, orders, references made and read, limits, failures, files, bad input;
 * its conclusion, the cost of each method for an error, relative to the cheapest. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

/* Columns of compare.csv, from 0. */
enum {
  METHOD,
  LADDER,
  LEVEL,
  STATUS,
  TIME,
  END,
  MOST = END + 4,
  MULTIPLIER = END + 8,
  BELOW,
  ORDER,
  POSITION,
  VELOCITY,
  BALANCE,
  STEPS,
  REJECTED,
  RHS,
  JACOBIANS,
  FACTORISATIONS,
  CPU,
  SPREAD,
  REPEATS,
  REASON
};

/* The cell of a row, from 0, of compare.csv in a folder; no text in quotes comes before it. */
static const char *compare_cell (const char *file, int row, int column) {
  static char cell[600];
  const char *at = cli_file (file);
  assert_non_null (at);
  for (int i = 0; i <= row; i++) {
    at = strchr (at, '\n');
    assert_non_null (at);
    at++;
  }
  for (int i = 0; i < column; i++) at = strchr (at, ',') + 1;
  snprintf (cell, sizeof cell, "%.*s", (int)strcspn (at, column == REASON ? "\n" : ",\n"), at);
  return cell;
}

static double compare_number (const char *file, int row, int column) {
  return strtod (compare_cell (file, row, column), NULL);
}

/* Rows are run once on the clock, and errors taken against the table that compare_setup makes, where neither
 * matters. */
#define ONCE " --repeats 1 --reference @/known.csv "
#define SHORT "--repeats 1 --t-end 2 --step-ladder 0.1:0.02 --rtol-ladder 1e-5:1e-7"

/* Rows come in the order of the methods, decades of tolerances, halves of steps. */
TEST (rows) {
  cli_good ("pinwheel compare ezyroller --methods rk4+projection,ida+ggl,erk5:steps=fixed " SHORT
            " --plots @/rows && cut -d, -f1-4 @/rows/compare.csv && ls @/rows");
  const char *table = strstr (cli_out, "method,ladder");
  assert_non_null (table);
  assert_string_equal (
      table, "method,ladder,rung,status\n"
             "rk4+projection,step,0.1,ok\n"
             "rk4+projection,step,0.05,ok\n"
             "rk4+projection,step,0.025,ok\n"
             "ida+ggl,rtol,1e-05,ok\n"
             "ida+ggl,rtol,1e-06,ok\n"
             "ida+ggl,rtol,1e-07,ok\n"
             "erk5:steps=fixed,step,0.1,ok\n"
             "erk5:steps=fixed,step,0.05,ok\n"
             "erk5:steps=fixed,step,0.025,ok\n"
             "compare.csv\ntruth.csv\nwork-precision-angles.dat\nwork-precision-angles.gp\nwork-precision-angles.pdf\n"
             "work-precision-angles.png\nwork-precision-angles.svg\nwork-precision.dat\nwork-precision.gp\n"
             "work-precision.pdf\nwork-precision.png\nwork-precision.svg\n");
}

/* Fixed-step methods converge at their order, against a reference that is better than all of them. */
TEST (orders) {
  cli_good ("pinwheel compare ezyroller --methods rk4+none,rk4+projection,erk5+projection:steps=fixed --t-end 2 "
            "--step-ladder 0.1:0.02 --repeats 3 --plots @/order");
  const double order[3] = { 4, 4, 5 };
  for (int m = 0; m < 3; m++)
    for (int column = MOST; column < MOST + 2; column++) {
      double slope = log2 (compare_number ("order/compare.csv", 3 * m + 1, column) /
                           compare_number ("order/compare.csv", 3 * m + 2, column));
      check_below ("order less slope", order[m] - slope, 0.5, "steps that are not small");
      if (column == MOST)
        check_close ("order", compare_number ("order/compare.csv", 3 * m + 2, ORDER), slope, 8 * CHECK_EPS,
                     "round-off");
    }
  for (int row = 0; row < 9; row++) {
    assert_string_equal (compare_cell ("order/compare.csv", row, BELOW), "");
    assert_true (compare_number ("order/compare.csv", row, MOST) >= compare_number ("order/compare.csv", row, END));
    assert_true (compare_number ("order/compare.csv", row, BALANCE) > 0);
    assert_true (compare_number ("order/compare.csv", row, REPEATS) == 3);
    if (row % 3 < 2) assert_string_equal (compare_cell ("order/compare.csv", row, ORDER), "nan");
  }
}

/* A method of the user's, by its name; without --methods in addition to the others; its order is 3. */
TEST (own_method) {
  cli_good ("pinwheel compare pendulum --method-file docs/method.c --methods kutta3+projection --t-end 2 "
            "--step-ladder 0.05:0.0125 --repeats 1 --plots @/own");
  check_close ("order", compare_number ("own/compare.csv", 2, ORDER), 3, 0.2, "steps that are not small");
  cli_good ("pinwheel compare ezyroller --method-file docs/method.c " SHORT
            " -o @/own.csv; cut -d, -f1 @/own.csv | uniq");
  cli_shows ("rk4+projection\n");
  cli_shows ("kutta3+none\nkutta3+projection\n");
  cli_good ("pinwheel drift ezyroller --method-file docs/method.c --methods all+projection --t-end 0.1 --only-methods");
  cli_shows ("kutta3+projection  ");
  cli_good ("pinwheel run ezyroller --method-file docs/method.c -m kutta3 --t-end 0.1 --json -");
  assert_true (cli_says (cli_out, "method", "kutta3"));
}

/* Steps that follow a tolerance are nowhere in an asymptotic range; here two orders of 8 agree. */
TEST (no_adaptive_order) {
  cli_good (
      "pinwheel compare pendulum --methods erk5+projection --rtol-ladder 1e-3:1e-6 --repeats 1 --plots @/adaptive");
  for (int row = 0; row < 4; row++) assert_string_equal (compare_cell ("adaptive/compare.csv", row, ORDER), "nan");
}

/* Outside the asymptotic range, here next to the reference's uncertainty, levels disagree and no order is given. */
TEST (no_order) {
  cli_good ("pinwheel compare ezyroller --methods erk5+projection:steps=fixed --t-end 2 --step-ladder 0.05:0.0125 "
            "--repeats 3 --plots @/round");
  assert_string_equal (compare_cell ("round/compare.csv", 2, BELOW), "");
  for (int row = 0; row < 3; row++) assert_string_equal (compare_cell ("round/compare.csv", row, ORDER), "nan");
}

/* The last row knows the reference's uncertainty only: what is not ten times that has no order, however well it
 * fits. */
TEST (uncertain_order) {
  cli_good ("pinwheel compare ezyroller --methods rk4+projection --t-end 2 --step-ladder 0.02:0.0003 --repeats 1 "
            "--plots @/uncertain >@/table");
  double uncertainty = compare_number ("uncertain/compare.csv", 6, MOST);
  assert_non_null (strstr (compare_cell ("uncertain/compare.csv", 6, BELOW), "largest.length"));
  for (int row = 2; row < 7; row++) {
    double most = compare_number ("uncertain/compare.csv", row, MOST);
    int known = strcmp (compare_cell ("uncertain/compare.csv", row, ORDER), "nan") != 0;
    assert_true (row > 3 ? !known || most > 10 * uncertainty : known);
  }
}

/* However long a run takes, it is repeated: one number has no spread. */
TEST (repeats) {
  cli_good ("pinwheel compare ezyroller --methods rk4+projection -t 2 --reference @/known.csv --step-ladder 4e-6:4e-6 "
            "--specialise never --limit 1000 --plots @/long >@/table");
  assert_true (compare_number ("long/compare.csv", 0, REPEATS) >= 2);
  assert_true (compare_number ("long/compare.csv", 0, SPREAD) >= 0);
}

/* What a row says about cost is what a run says: neither samples nor accounts are counted. */
TEST (row_is_run) {
  static const char *const method[] = { "rk4+projection", "erk8+projection", "ida+baumgarte" };
  for (int m = 0; m < 3; m++) {
    cli_good (check_text (
        "pinwheel compare ezyroller --methods %s --t-end 2 --rtol-ladder 1e-6 --step-ladder 0.01 --repeats 2 "
        "--reference @/known.csv --plots @/as-run "
        ">@/table\npinwheel run ezyroller --method %s --t-end 2 --rtol 1e-6 --step 0.01 --json -",
        method[m], method[m]));
    const struct {
      const char *group, *key;
      int column;
    } same[] = { { "statistics", "steps", STEPS },         { "statistics", "rhs", RHS },
                 { "statistics", "jacobians", JACOBIANS }, { "statistics", "factorisations", FACTORISATIONS },
                 { "residual", "position", POSITION },     { "residual", "velocity", VELOCITY } };
    assert_true (compare_number ("as-run/compare.csv", 0, REPEATS) == 2);
    for (size_t i = 0; i < sizeof same / sizeof *same; i++)
      assert_true (compare_number ("as-run/compare.csv", 0, same[i].column) ==
                   cli_number (cli_out, same[i].group, same[i].key, NULL));
  }
}

/* A run's own table as reference: the same method and level has no error but round-off; another one has that between
 * them. */
TEST (reference) {
  cli_good ("pinwheel compare ezyroller --methods rk4+projection --reference @/known.csv --repeats 1 --step-ladder "
            "0.05:0.025 "
            "--plots @/t");
  assert_non_null (strstr (cli_out, "as if it were exact"));
  assert_true (compare_number ("t/compare.csv", 0, TIME) == 2);
  assert_true (compare_number ("t/compare.csv", 0, MOST) > 1e-8);
  double below = compare_number ("t/compare.csv", 1, MOST);
  assert_true (below > 0 && below < 16 * CHECK_EPS); /* an error is no less than is known of it */
  assert_non_null (strstr (compare_cell ("t/compare.csv", 1, BELOW), "largest.length largest.angle"));
  /* a table with some columns compares these alone */
  cli_good ("cut -d, -f1,4 @/known.csv >@/few.csv && pinwheel compare ezyroller --methods rk4 --reference @/few.csv "
            "--repeats 1 --t-end "
            "1 --step-ladder 0.05 --plots @/few");
  cli_good (
      "cp @/few.csv @/few && pinwheel compare ezyroller --methods rk4 --reference @/few/few.csv --repeats 1 --t-end 1 "
      "--step-ladder 0.05 --plots @/few >@/table"); /* a file of the folder that is not written */
  assert_string_equal (compare_cell ("few/compare.csv", 0, END), "nan");
  assert_true (compare_number ("few/compare.csv", 0, END + 1) > 0);
  assert_string_equal (compare_cell ("few/compare.csv", 0, MULTIPLIER), "nan");
}

/* Where a signal jumps multipliers have two values.  Runge-Kutta methods show that behind, others that before: such a
 * sample is no error of theirs, and does not keep the reference from telling those at the other samples. */
TEST (jump) {
  cli_good ("pinwheel compare tests/scenes/shove.yaml --methods rk4+projection,ida+ggl --step-ladder 0.01 "
            "--rtol-ladder 1e-6 --repeats 1 --plots @/jump >@/table");
  for (int i = 0; i < 2; i++) {
    double error = compare_number ("jump/compare.csv", i, MULTIPLIER);
    assert_true (error > 0 && error < 1e-3); /* the jump is 1 */
  }
  cli_write ("jumps.yaml", "pinwheel: 1\nbodies: [{name: b, mass: 1, inertia: 1}]\nelements:\n"
                           "  - {pin: p, body: [b, ground], at: [[-1, 0], [-1, 0]]}\n"
                           "  - {torque: T, body: [b, ground], value: \"sign(sin(2*pi*t))\"}\n");
  cli_good (
      "pinwheel compare @/jumps.yaml -t 100 --methods rk4 --step-ladder 0.1 --repeats 1 --plots @/jumps >@/table && "
      "sed -n 's/.*uncertainty.*,//p' @/jumps/truth.csv");
  assert_string_equal (cli_out, "0\n"); /* every sample is at a jump: multipliers are not compared */
}

/* Eight methods by default; every integrator with one stabilisation. */
TEST (presets) {
  cli_good ("pinwheel compare ezyroller" ONCE
            "--t-end 0.5 --step-ladder 0.01 --rtol-ladder 1e-6 --plots @/usual >@/table; "
            "pinwheel compare ezyroller --methods all+ggl,rk4+all,all+ggl" ONCE "--t-end 0.5 --step-ladder 0.01 "
            "--rtol-ladder 1e-6 --plots @/ggl >@/table; tail -n +2 @/usual/compare.csv | wc -l; "
            "tail -n +2 @/ggl/compare.csv | cut -d, -f1");
  assert_string_equal (cli_out, "8\nida+ggl\nradau+ggl\ngalpha+ggl\nrk4+none\nrk4+baumgarte\nrk4+projection\n"
                                "rk4+nullspace\n");
}

/* Errors of multipliers are relative to the largest of their unit: masses a power of 2 as large change no digit. */
TEST (multiplier_scale) {
  double error[2];
  for (int i = 0; i < 2; i++) {
    cli_write (
        "double.yaml",
        check_text (
            "pinwheel: 1\nbodies:\n  - {name: a, mass: %d, start: {x: 1}}\n  - {name: b, mass: %d, start: {x: 2}}\n"
            "elements:\n  - {pin: A, body: [a, ground], at: [[-1, 0], [0, 0]]}\n"
            "  - {pin: B, body: [a, b], at: [[0, 0], [-1, 0]]}\n  - {gravity: g, acceleration: [0, -10]}\n",
            i ? 1024 : 1, i ? 1024 : 1));
    cli_good ("pinwheel compare @/double.yaml --methods rk4+projection --t-end 0.5 --step-ladder 0.02 --repeats 1 "
              "--plots @/double >@/table");
    error[i] = compare_number ("double/compare.csv", 0, MULTIPLIER);
  }
  assert_true (error[0] > 0 && error[1] == error[0]);
}

/* The reference of its own making agrees with digits computed in quadruple precision (tests/reference) as far as it
 * claims. */
TEST (own_reference) {
  const double x[3] = { 0.122485077560987708, -0.0509563103339871023, -0.0717230785643341303 };
  cli_good (
      "pinwheel compare ezyroller --methods rk4 --step-ladder 0.1 --t-end 2 --repeats 1 --plots @/own >@/table && "
      "head -2 @/own/truth.csv | tail -1 | cut -d, -f4,5; "
      "pinwheel run ezyroller --method erk8+projection --rtol 3e-14 --t-end 2 --json @/own.json >@/table");
  assert_non_null (strstr (cli_file ("own/truth.csv"), "erk8+projection, rtol 3e-14"));
  const char *at = strstr (cli_file ("own/truth.csv"), "\"uncertainty\",");
  assert_non_null (at);
  at += strlen ("\"uncertainty\",");
  double length = strtod (at, NULL), angle = strtod (strchr (at, ',') + 1, NULL);
  assert_true (length > 0 && length < 1e-11 && angle > 0 && angle < 1e-11);
  const char *json = cli_file ("own.json"), *const key[3] = { "x", "y", "phi" };
  for (int i = 0; i < 3; i++)
    check_close (key[i], cli_number (json, "bodies", "frame", key[i], NULL), x[i], 4 * (i < 2 ? length : angle),
                 "4 times the uncertainty stated");
}

/* All methods there are: each is a row, with a reason if it does not reach the end. */
TEST (all) {
  cli_good (
      "pinwheel compare ezyroller --methods all" ONCE "--t-end 0.5 --step-ladder 0.01 --rtol-ladder 1e-6 --plots @/all "
      ">@/table; pinwheel "
      "list methods | grep -c '^    +'; tail -n +2 @/all/compare.csv | wc -l; grep -vc ',\"\"$' @/all/compare.csv "
      "|| true");
  int methods = 0, rows = 0;
  assert_int_equal (sscanf (cli_out, "%d %d", &methods, &rows), 2);
  assert_int_equal (methods, rows);
}

/* The former name of an option still works, but is not documented. */
TEST (alias) {
  cli_good ("pinwheel compare ezyroller --methods rk4 --truth @/known.csv --repeats 1 --step-ladder 0.1");
  assert_non_null (strstr (cli_out, "known.csv, as if it were exact"));
  cli_good ("pinwheel run ezyroller -t 2 --truth @/known.csv --json - | grep known.csv");
  cli_good ("pinwheel compare --help && pinwheel run --help");
  assert_non_null (strstr (cli_out, "--reference=FILE.csv"));
  assert_null (strstr (cli_out, "--truth"));
  cli_bad ("pinwheel compare ezyroller --truht x", 2, "compare has no option \"--truht\"; see pinwheel compare --help");
}

TEST (limit) {
  int status = cli_run ("pinwheel compare ezyroller --methods rk4" ONCE
                        "--t-end 2 --step-ladder 0.01:1e-8 --limit 0.1 --plots @/l");
  assert_int_equal (status, 0);
  assert_string_equal (compare_cell ("l/compare.csv", 0, STATUS), "ok");
  assert_string_equal (compare_cell ("l/compare.csv", 18, STATUS), "not run");
  assert_string_equal (compare_cell ("l/compare.csv", 18, REASON), "\"too slow; the limit is 0.1 s\"");
  assert_string_equal (compare_cell ("l/compare.csv", 18, STEPS), "nan");
  status = cli_run ("pinwheel compare ezyroller --methods rk4" ONCE "--t-end 2 --step-ladder 1e-8 --limit 0.125 "
                    "--plots @/stop");
  assert_int_equal (status, 4);
  assert_string_equal (compare_cell ("stop/compare.csv", 0, STATUS), "stopped");
  assert_non_null (
      strstr (compare_cell ("stop/compare.csv", 0, REASON), "too slow: the limit of 0.125 s was reached at"));
}

/* The limit bounds the runs of the reference, too. */
TEST (limited_reference) {
  assert_int_equal (cli_run ("pinwheel compare ezyroller --methods rk4 --t-end 1e4 --repeats 1 --step-ladder 0.1 "
                             "--limit 0.01 --specialise never"),
                    4);
  assert_non_null (strstr (cli_out, "no two methods reach the end within --limit, so errors are unknown"));
}

/* Initial values changed by the constraints are reported, as by `run`. */
TEST (changed) {
  static const char *const command[] = { "compare", "drift --only-methods",
                                         "sensitivity --of sleigh.x --by sleigh.phi -m rk4", "linearise" };
  for (int i = 0; i < 4; i++) {
    cli_shell (check_text ("pinwheel %s chaplygin-sleigh --start sleigh.omega=0.5 %s", command[i],
                           i < 2 ? "-t 0.1 --methods rk4" : ""));
    assert_non_null (strstr (cli_err, "\n  sleigh.vy from 0.2 to 0.125 m/s (specified; otherwise wheel blade would be "
                                      "violated by 0.075 m/s)\n"));
  }
}

/* A failure keeps its row, its reason and the time reached; the others go on. */
TEST (failure) {
  cli_good ("pinwheel compare ezyroller --methods erk8+projection" ONCE
            "--t-end 1 --rtol-ladder 1e-14:1e-13 --plots @/f");
  assert_string_equal (compare_cell ("f/compare.csv", 0, STATUS), "ok");
  assert_string_equal (compare_cell ("f/compare.csv", 1, STATUS), "refused");
  assert_non_null (strstr (compare_cell ("f/compare.csv", 1, REASON), "round-off allows no less"));
  assert_string_equal (compare_cell ("f/compare.csv", 1, POSITION), "nan");
  cli_bad ("pinwheel compare ezyroller --methods erk8+projection" ONCE "--t-end 1 --rtol-ladder 1e-15 >@/out1", 4,
           "no method has reached the end; the last error: setting rtol = 1e-15: round-off allows no less than "
           "2.2e-14");
}

/* Interrupted in the middle: rows done stay. */
TEST (interrupt) {
  int status = cli_run (
      "\"${PINWHEEL:-build/pinwheel}\" compare ezyroller --methods rk4" ONCE
      "--t-end 2 --step-ladder 0.1:1e-8 --limit 100 --plots @/i &\n"
      "p=$!; while kill -0 $! 2>/dev/null && ! grep -q '^rk4' @/i/compare.csv.part 2>/dev/null; do sleep 0.05; done\n"
      "kill -TERM $p; wait $p; test $? = 130 && ls @/i");
  assert_int_equal (status, 0);
  assert_non_null (strstr (cli_out, "compare.csv.part\ntruth.csv\n"));
  assert_non_null (strstr (cli_err, "rows are done, and kept in"));
  assert_string_equal (compare_cell ("i/compare.csv.part", 0, STATUS), "ok");
}

/* Concurrent methods give the same rows in the same order, but for the times. */
TEST (jobs) {
  cli_good ("for j in 1 2 5; do\n"
            "  pinwheel compare pendulum --methods galpha+ggl,rk4,erk5,bdf,ida+none " SHORT
            " --jobs $j --plots @/j$j || exit 1\n"
            "  cut -d, -f1-24 @/j$j/compare.csv >@/j$j.csv\n"
            "done\n"
            "cmp @/j1.csv @/j2.csv && cmp @/j1.csv @/j5.csv");
  assert_non_null (strstr (cli_file ("j5.csv"), "\nida+none,rtol,1e-07,ok,2,"));
  cli_bad ("pinwheel compare pendulum --jobs 0.5", 2, "--jobs 0.5: expected a whole number >= 1");
}

/* Threads whose runs are timed never share a processor; on a machine with one core there is one of them.  Without /sys,
 * cores are not known: each processor counts as one. */
TEST (cores) {
  cli_good (
      "OPENBLAS_NUM_THREADS=1 \"${PINWHEEL:-build/pinwheel}\" compare ezyroller --specialise never --methods "
      "rk4,rk4+none,rk4+baumgarte" ONCE "--step-ladder 1e-8 --jobs 3 --limit 60 >@/cores.txt 2>&1 &\n"
      "cat /sys/devices/system/cpu/cpu[0-9]*/topology/thread_siblings_list 2>@/null | sort -u | wc -l >@/physical\n"
      "[ $(cat @/physical) -gt 0 ] || nproc >@/physical\n"
      "threads=$(cat @/physical); [ $threads -le 3 ] || threads=3\n"
      "for i in $(seq 200); do\n"
      "  sleep 0.05; cat /proc/$!/task/*/status | sed -n 's/^Cpus_allowed_list:.//p' >@/lists\n"
      "  [ $(sort -u @/lists | wc -l) -lt $threads ] || break\n"
      "done; kill $!; wait $!\n"
      "test -s @/lists");
  char *line = strdup (cli_file ("lists"));
  long threads = 0, physical = strtol (cli_file ("physical"), NULL, 10);
  cli_good ("tr ',' '\\n' <@/lists | sort | uniq -d | wc -l");
  assert_string_equal (cli_out, "0\n");
  for (const char *c = line; *c; c++) threads += *c == '\n';
  assert_true (threads <= physical);
  free (line);
}

TEST (bad) {
  const cli_wrong bad[] = {
    { "ezyrolle", "there is no model \"ezyrolle\"; did you mean \"ezyroller\"?" },
    { "ezyroller --methods rk5", "there is no integrator \"rk5\"; did you mean \"erk5\"?" },
    { "ezyroller --methods all,ida+gll", "integrator ida has no stabilisation \"gll\"; did you mean \"ggl\"?" },
    { "ezyroller --methods all+gll", "--methods all+gll: no integrator has this stabilisation; did you mean \"ggl\"?" },
    { "ezyroller --methods all+foo",
      "--methods all+foo: no integrator has this stabilisation; "
      "valid are none, baumgarte, projection, nullspace, index2, ggl, si1, index3, rattle" },
    { "ezyroller --methods rk5+all", "there is no integrator \"rk5\"; did you mean \"erk5\"?" },
    { "ezyroller --methods rk4,", "--methods \"rk4,\": a name is missing" },
    { "ezyroller --limt 3", "compare has no option \"--limt\"; did you mean \"--limit\"?" },
    { "ezyroller --limit 0", "--limit 0: expected a number > 0" },
    { "ezyroller --repeats 0.5", "--repeats 0.5: expected a whole number >= 1" },
    { "ezyroller --repeats 100", "--repeats 100: at most 99" },
    { "ezyroller --t-end nan", "--t-end nan: expected a finite number" },
    { "ezyroller --rtol-ladder 1e-3:x", "--rtol-ladder: \"x\" is not a number" },
    { "ezyroller --step-ladder 0:1", "--step-ladder 0: expected a number > 0" },
    { "ezyroller --step-ladder 1:1e-40", "--step-ladder 1:1e-40: too long a ladder" },
    { "ezyroller --set m=1", "model ezyroller has no parameter \"m\"; did you mean \"m1\"?" },
    { "ezyroller --reference @/none.csv", "@/none.csv: cannot be read: No such file or directory" },
    { "ezyroller --reference @/empty.csv", "@/empty.csv:0: the file is empty" },
    { "ezyroller --reference @/x.csv", "@/x.csv:1: there is no column \"t\"; valid are x, s" },
    { "ezyroller --reference @/y.csv", "@/y.csv:1: there is no column \"frame.x\"; did you mean \"fram.x\"?" },
    { "ezyroller --reference @/z.csv", "@/z.csv:2: column 2: expected a finite number, found \"one\"" },
    { "ezyroller --reference @/twice.csv", "@/twice.csv:1: columns 2 and 4 are both named \"frame.x\"" },
    { "ezyroller --reference @/back.csv", "@/back.csv:3: 0.5 comes after 1: expected increasing times" },
    { "ezyroller --reference @/inf.csv", "@/inf.csv:3: column 1: expected a finite number, found \"inf\"" },
    { "ezyroller --reference @/far.csv", "@/far.csv:3: column 2: expected a finite number, found \"-inf\"" },
    { "ezyroller --reference @/nan.csv", "@/nan.csv: every value is nan" },
    { "ezyroller --reference @/comma.csv", "@/comma.csv:2: expected 2 cells as in the first line, found 4; with "
                                           "decimal commas, separate cells by semicolons or tabs" },
    { "ezyroller --reference @/short.csv --t-end 2",
      "--reference @/short.csv: no row at the final time, t = 2 s; the last one before it is at 1 s" },
  };
  cli_write ("empty.csv", "");
  cli_write ("x.csv", "x,s\n0,0\n");
  cli_write ("y.csv", "t,fram.x\n0,0\n");
  cli_write ("z.csv", "t,frame.x\n1,one\n");
  cli_write ("twice.csv", "t,frame.x [m],a,frame.x [mm]\n1,0,0,0\n");
  cli_write ("back.csv", "t,frame.x\n1,0\n0.5,0\n");
  cli_write ("inf.csv", "t,frame.x\n1,0\ninf,0\n");
  cli_write ("far.csv", "\xEF\xBB\xBFt,frame.x\n1,nan\n2,-inf\n"); /* with a byte order mark */
  cli_write ("nan.csv", "t,frame.x,frame.y\n1,nan,nan\n2,nan,nan\n");
  cli_write ("comma.csv", "t,frame.x\n1,0,3,14\n"); /* decimal commas */
  cli_write ("short.csv", "t,frame.x\n1,0\n");
  cli_bad_each ("compare", bad, sizeof bad / sizeof *bad);
  cli_write ("file", "");
  cli_bad ("pinwheel compare ezyroller --plots @/file/x", 1, "cannot make the folder @/file/x: Not a directory");
}

/* ---- The conclusion ---- */

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

/* The table of a run. */
static int compare_setup (void) {
  if (cli_setup () != 0) return -1;
  return cli_run ("pinwheel run ezyroller --method rk4+projection --step 0.025 --t-end 2 --every 0.1 -o @/known.csv");
}

const check_fixture fixture = { compare_setup, cli_teardown };
