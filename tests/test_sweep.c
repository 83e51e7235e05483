/* Sweeps from outside: the grid, rows and runs, failures, journals cut anywhere, kills, parts, bad input. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

#define GRID "--vary omega=lin:1:4:4 --vary M0=0.05,0.1,0.2 --t-end 0.05"

/* A shell command that must succeed, whatever it says. */
static void sweep_shell (const char *command) {
  int status = cli_run (command);
  if (status != 0) print_error ("%s\nends with %d:\n%s%s", command, status, cli_out, cli_err);
  assert_int_equal (status, 0);
}

/* ---- The grid and its rows ---- */

static void test_order (void **state) {
  (void)state;
  cli_good ("pinwheel sweep ezyroller " GRID " -o @/order.csv && cut -d, -f1-4 @/order.csv | sed -n '1,5p;13p'");
  assert_string_equal (cli_out, "omega [rad/s],M0 [N m],status,t [s]\n"
                                "1,0.050000000000000003,ok,0.050000000000000003\n"
                                "1,0.10000000000000001,ok,0.050000000000000003\n"
                                "1,0.20000000000000001,ok,0.050000000000000003\n"
                                "2,0.050000000000000003,ok,0.050000000000000003\n"
                                "4,0.20000000000000001,ok,0.050000000000000003\n");
  cli_good ("ls @ | grep -c '^order'; wc -l <@/order.csv");
  assert_string_equal (cli_out, "1\n13\n");
}

/* The fourth value of lin:0:1:11 is 0.3, ends are exact, and decades of a logarithmic range are. */
static void test_ranges (void **state) {
  (void)state;
  cli_good (
      "pinwheel sweep ezyroller --vary M0=lin:0:1:11 --t-end 0.001 -o @/lin.csv && sed -n 5p @/lin.csv | cut -c1-24");
  assert_string_equal (cli_out, "0.29999999999999999,ok,0\n");
  cli_good ("pinwheel sweep ezyroller --vary M0=log:1e-3:10:5 --t-end 0.001 -o @/log.csv && cut -d, -f1 @/log.csv");
  const double expected[5] = { 1e-3, 1e-2, 0.1, 1, 10 };
  const char *at = strchr (cli_out, '\n') + 1;
  for (int i = 0; i < 5; i++, at = strchr (at, '\n') + 1)
    check_close ("decade", strtod (at, NULL), expected[i], expected[i] * 2 * CHECK_EPS, "round-off of pow");
  cli_good ("pinwheel sweep ezyroller --vary M0=lin:-1:-1:1 --t-end 0.001 -o @/one.csv && wc -l <@/one.csv");
  assert_string_equal (cli_out, "2\n");
}

/* A row is what the run says, digit by digit. */
static void test_row_is_run (void **state) {
  (void)state;
  static const char *const method[] = { "rk4+projection --step 2e-3", "ida+ggl --rtol 1e-8" };
  for (int i = 0; i < 2; i++) {
    char command[900];
    snprintf (command, sizeof command,
              "o='--method %s --t-end 1.5 --set M0=0.2 --start frame.vx=0.3'\n"
              "pinwheel sweep ezyroller --vary omega=2,3 --vary frame.omega=0.1,0.4 $o -o @/row.csv || exit 1\n"
              "pinwheel run ezyroller --set omega=3 --start frame.omega=0.1 $o --every 1.5 -o @/run.csv 2>/dev/null\n"
              "sed -n '1p;4p' @/row.csv | cut -d, -f4-16 >@/a\n sed -n '1p;$p' @/run.csv | cut -d, -f1-13 >@/b\n"
              "cmp @/a @/b && pinwheel run ezyroller --set omega=3 --start frame.omega=0.1 $o --json - 2>/dev/null",
              method[i]);
    sweep_shell (command);
    const char *row = cli_file ("row.csv");
    for (int line = 0; line < 3; line++) row = strchr (row, '\n') + 1;
    for (int comma = 0; comma < 17; comma++) row = strchr (row, ',') + 1;
    double position = strtod (row, (char **)&row), velocity = strtod (row + 1, (char **)&row);
    double steps = strtod (row + 1, (char **)&row), rhs = strtod (row + 1, NULL);
    assert_true (position == cli_number (cli_out, "residual", "position", NULL));
    assert_true (velocity == cli_number (cli_out, "residual", "velocity", NULL));
    assert_true (steps == cli_number (cli_out, "statistics", "steps", NULL));
    assert_true (rhs == cli_number (cli_out, "statistics", "rhs", NULL));
  }
}

/* Start values have a column of their own name, apart from the final state's. */
static void test_start_values (void **state) {
  (void)state;
  sweep_shell ("pinwheel sweep ezyroller --vary frame.vx=0,1 --t-end 0.01 -o @/start.csv && head -1 @/start.csv | cut "
               "-d, -f1-5");
  assert_string_equal (cli_out, "start.frame.vx [m/s],status,t [s],frame.x [m],frame.y [m]\n");
}

/* Bodies may come and go with a count; where there is none there is no number. */
static void test_counts (void **state) {
  (void)state;
  sweep_shell ("pinwheel sweep tests/scenes/chain.c --vary links=2,1,3 --t-end 0.01 -o @/count.csv\n"
               "head -1 @/count.csv | tr , '\\n' | grep -c link; cut -d, -f1,2,15,16,21 @/count.csv");
  const char *expected = "19\nlinks,status,link2.omega [rad/s],link3.x [m],link3.omega [rad/s]\n2,ok,";
  assert_int_equal (strncmp (cli_out, expected, strlen (expected)), 0);
  assert_non_null (strstr (cli_out, ",nan,nan\n1,ok,nan,nan,nan\n3,ok,"));
}

static void test_cpu (void **state) {
  (void)state;
  sweep_shell ("pinwheel sweep ezyroller " GRID " --cpu -o @/cpu.csv && head -1 @/cpu.csv | grep -o 'rhs,.*'");
  assert_string_equal (cli_out, "rhs,cpu [s],reason\n");
}

/* ---- Runs that fail ---- */

static void test_failures (void **state) {
  (void)state;
  assert_int_equal (cli_run ("pinwheel sweep tests/scenes/chain.c --vary pull=-1,2,-3 --t-end 0.01 -o @/fail.csv"), 0);
  assert_string_equal (cli_err,
                       "pinwheel: 2 of 3 runs failed, the first of them: model chain: the spring \"pulls\", -1 N/m "
                       "does not\n");
  cli_good ("grep -o ',nan,\"model.*' @/fail.csv; cut -d, -f1-3 @/fail.csv | sed -n '2,4p'");
  assert_string_equal (cli_out, ",nan,\"model chain: the spring \"\"pulls\"\", -1 N/m does not\"\n"
                                ",nan,\"model chain: the spring \"\"pulls\"\", -3 N/m does not\"\n"
                                "-1,input,nan\n2,ok,0.01\n-3,input,nan\n");
}

static void test_all_fail (void **state) {
  (void)state;
  cli_bad (
      "pinwheel sweep ezyroller --vary omega=1,2 --set c=0 --set d=0 --t-end 0.01 -o @/all.csv", 2,
      "all 2 runs failed, the first one: model ezyroller: steer.phi has no mass, and no constraint determines how it "
      "moves; give it mass, or constrain it");
  assert_non_null (cli_file ("all.csv"));
  cli_bad ("pinwheel sweep tests/scenes/chain.c --vary pull=-1,-2 --t-end 0.01 -o @/none.csv", 2,
           "model chain: the spring\n\"pulls\", -1 N/m does not");
  assert_null (cli_file ("none.csv"));
  assert_int_equal (
      cli_run ("pinwheel sweep ezyroller --vary omega=1,2 --set c=0 --set d=0 --t-end 0.01 --part 1/2 -o @/all.csv"),
      0);
}

/* A run that fails on the way says how far it came. */
static void test_fails_late (void **state) {
  (void)state;
  assert_int_equal (
      cli_run ("pinwheel sweep ezyroller --vary M0=0.1,1e300 --method rk4+none --t-end 0.05 -o @/late.csv"), 0);
  assert_int_equal (strncmp (cli_err, "pinwheel: 1 of 2 runs failed, the first of them: ", 49), 0);
  cli_good ("cut -d, -f2,3 @/late.csv | sed -n 3p");
  assert_int_equal (strncmp (cli_out, "method,", 7), 0);
  assert_true (strtod (cli_out + 7, NULL) < 0.05);
}

/* ---- The same table whatever happens ---- */

static void test_jobs (void **state) {
  (void)state;
  sweep_shell ("for m in rk4+projection ida+ggl ida+baumgarte; do for j in 1 2 3 7; do\n"
               "  pinwheel sweep ezyroller " GRID " -m $m -j $j -o @/jobs.csv && cksum <@/jobs.csv || exit 1\n"
               "done | sort -u | wc -l; done");
  assert_string_equal (cli_out, "1\n1\n1\n");
}

/* A journal cut after any byte, as a kill may leave it: the part is a complete journal with another name. */
static void test_cut_journal (void **state) {
  (void)state;
  sweep_shell ("s='pinwheel sweep ezyroller " GRID " --part 1/2 -o @/cut.csv'; $s || exit 1\n"
               "cp @/cut.csv @/whole; size=$(wc -c <@/whole); n=0\n"
               "while [ $n -le $size ]; do\n"
               "  head -c $n @/whole >@/cut.csv.part; $s 2>/dev/null || exit 1\n"
               "  cmp @/cut.csv @/whole || exit 1\n"
               "  [ ! -e @/cut.csv.part ] || exit 1\n"
               "  n=$((n + 61)); done");
}

/* Rows in another order, a row twice, a damaged one, a forgotten half-sorted table. */
static void test_odd_journal (void **state) {
  (void)state;
  sweep_shell ("s='pinwheel sweep ezyroller " GRID " --part 2/2 -o @/odd.csv'; $s || exit 1\n"
               "cp @/odd.csv @/whole; head=$(grep -n '^end$' @/whole | cut -d: -f1)\n"
               "front () { head -$head @/whole; }; rows () { tail -n +$((head + 1)) @/whole; }\n"
               "try () { $s || exit 1; cmp @/odd.csv @/whole || exit 1; }\n"
               "{ front; rows | sort -r; } >@/odd.csv.part; try\n"
               "{ front; rows | head -2; rows; } >@/odd.csv.part; try\n"
               "{ front; rows | sed '3s/ok,0/ok,1/'; } >@/odd.csv.part; try\n"
               "{ front; rows | head -3; printf 'zzz'; } >@/odd.csv.part; echo x >@/odd.csv.sorted; try\n");
  const char *expected = ": 6 of 6 runs are done\n";
  assert_non_null (strstr (cli_err, expected));
  assert_non_null (strstr (strstr (cli_err, expected) + 1, ": 2 of 6 runs are done\n"));
}

/* Ctrl-C, and kills at odd moments, until it is through. */
static void test_kills (void **state) {
  (void)state;
  const char *sweep = "p=\"${PINWHEEL:-build/pinwheel}\"\n"
                      "s='sweep ezyroller --vary omega=lin:1:4:10 --vary M0=0.05,0.1,0.2,0.3 --t-end 4'\n";
  char command[1500];
  snprintf (
      command, sizeof command,
      "%s\"$p\" $s -j 1 -o @/whole.csv || exit 1\n"
      "\"$p\" $s -o @/kill.csv &\n"
      "until grep -q '^[0-9]' @/kill.csv.part 2>/dev/null; do sleep 0.01; done; kill -INT $!; kill -TERM $!; wait $!; "
      "echo $?; ls @/kill.csv*",
      sweep);
  sweep_shell (command);
  char expected[200];
  cli_expand ("130\n@/kill.csv.part\n", expected, sizeof expected);
  assert_string_equal (cli_out, expected);
  assert_non_null (strstr (cli_err, "; the same command goes on from there\n"));
  snprintf (
      command, sizeof command,
      "%si=3; while [ $i -lt 60 ]; do i=$((i + 1))\n"
      "\"$p\" $s -o @/kill.csv 2>/dev/null & sleep $(printf 0.%%02d $i)\n"
      "kill -KILL $! 2>/dev/null; wait $! 2>/dev/null && break\n"
      "done; [ -e @/kill.csv ] || \"$p\" $s -o @/kill.csv; cmp @/kill.csv @/whole.csv && [ ! -e @/kill.csv.part ]",
      sweep);
  sweep_shell (command);
}

static void test_journal_of_another (void **state) {
  (void)state;
  sweep_shell ("pinwheel sweep ezyroller " GRID " --part 1/2 -o @/other.csv && mv @/other.csv @/other.csv.part");
  const char *last = "; finish that one with its own command, or remove the file";
  char text[600];
#define OTHER(options, what)                                                                   \
  snprintf (text, sizeof text, "@/other.csv.part belongs to another sweep: %s%s", what, last); \
  cli_bad ("pinwheel sweep ezyroller " options " -o @/other.csv", 2, text)
  OTHER (GRID, "part is 1/2 there and 1/1 here");
  OTHER (GRID " --part 1/2 --step 0.002", "step is 0.001 there and 0.002 here");
  OTHER (GRID " --part 1/2 --set a=0.75", "parameter a is 0.5 there and 0.75 here");
  OTHER (GRID " --part 1/2 --start frame.x=1", "start frame.x is 1 here and not set there");
  OTHER (GRID " --part 1/2 -m ida+ggl", "method is rk4+projection there and ida+ggl here");
  OTHER ("--vary omega=lin:1:4:4 --vary M0=0.05,0.1,0.3 --t-end 0.05 --part 1/2",
         "vary M0 is 0.05,0.1,0.2 there and 0.05,0.1,0.3 here");
  OTHER ("--vary M0=0.05,0.1,0.2 --vary omega=lin:1:4:4 --t-end 0.05 --part 1/2",
         "order is omega,M0 there and M0,omega here");
#undef OTHER
  cli_write ("mine.csv.part", "t [s],x [m]\n0,1\n");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o @/mine.csv", 2,
           "@/mine.csv.part is there already and is no journal of a sweep: remove it if it is not needed");
  assert_string_equal (cli_file ("mine.csv.part"), "t [s],x [m]\n0,1\n");
}

static void test_lock (void **state) {
  (void)state;
  sweep_shell (
      "\"${PINWHEEL:-build/pinwheel}\" sweep ezyroller --vary omega=lin:1:4:400 --t-end 50 -o @/lock.csv & first=$!\n"
      "while [ ! -s @/lock.csv.part ]; do sleep 0.02; done\n"
      "pinwheel sweep ezyroller --vary omega=lin:1:4:400 --t-end 50 -o @/lock.csv; echo $?; kill -KILL $first");
  assert_string_equal (cli_out, "2\n");
  char expected[200];
  cli_expand ("pinwheel: another process is at work on @/lock.csv.part\n", expected, sizeof expected);
  assert_non_null (strstr (cli_err, expected));
}

/* ---- Parts ---- */

static void test_parts (void **state) {
  (void)state;
  sweep_shell ("pinwheel sweep ezyroller " GRID " -o @/one.csv || exit 1\n"
               "for n in 1 4 5 12; do rm -f @/part*; i=1; while [ $i -le $n ]; do\n"
               "  pinwheel sweep ezyroller " GRID " --part $i/$n -o @/part$i.csv || exit 1; i=$((i + 1)); done\n"
               "  [ $n = 1 ] || pinwheel sweep --merge @/part*.csv -o @/part1.csv.all || exit 1\n"
               "  [ $n = 1 ] || cmp @/part1.csv.all @/one.csv || exit 1\n"
               "done");
}

static void test_bad_parts (void **state) {
  (void)state;
  sweep_shell ("for i in 1 2 3; do pinwheel sweep ezyroller " GRID " --part $i/3 -o @/p$i.csv || exit 1; done\n"
               "pinwheel sweep ezyroller " GRID " --step 2e-3 --part 2/3 -o @/q2.csv\n"
               "pinwheel sweep ezyroller " GRID
               " --part 2/4 -o @/r2.csv; cp @/p2.csv @/copy.csv; head -n -1 @/p3.csv >@/short.csv");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p3.csv -o @/m.csv", 2, "part 2 of 3 is missing");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv -o @/m.csv", 2, "part 3 of 3 is missing");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv @/copy.csv -o @/m.csv", 2,
           "@/p2.csv and @/copy.csv are both part 2 of 3");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/q2.csv @/p3.csv -o @/m.csv", 2,
           "@/p1.csv and @/q2.csv are parts of different sweeps: step is 0.001 in the first and 0.002 in the second");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/r2.csv @/p3.csv -o @/m.csv", 2,
           "@/p1.csv is one of 3 parts, @/r2.csv one of 4");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv @/short.csv -o @/m.csv", 2,
           "@/short.csv is not complete: row 12 is missing; finish that part first");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/none.csv -o @/m.csv", 2,
           "cannot open the part @/none.csv: No such file or directory");
  cli_bad ("pinwheel sweep --merge Makefile -o @/m.csv", 2,
           "Makefile is no part of a sweep: parts are written by --part I/N");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv @/p3.csv -o @/p2.csv", 2,
           "@/p2.csv is a part and would be written over");
  cli_bad ("pinwheel sweep --merge @/p1.csv -o @/m.csv --jobs 2", 2,
           "--jobs has no place beside --merge: the parts say what they are");
  cli_good ("ls @ | grep -c '^m.csv' || true");
  assert_string_equal (cli_out, "0\n");
}

/* ---- Bad input: said before anything is computed ---- */

/* A table in a file is as much of the model as the model's own file. */
static void test_changed_table (void **state) {
  (void)state;
  cli_write ("table.yaml", "pinwheel: 1\nparameters: [{name: I, value: 1, domain: positive}]\n"
                           "bodies: [{name: a, mass: 1, inertia: I}]\n"
                           "elements: [{torque: T, body: [a, ground], value: {table: {file: table.csv}}}]\n");
  sweep_shell ("GRID='--vary I=1,2 --t-end 1'\n"
               "printf '0,0\\n1,1\\n' >@/table.csv; pinwheel sweep @/table.yaml $GRID --part 1/2 -o @/t1.csv\n"
               "printf '0,0\\n1,2\\n' >@/table.csv; pinwheel sweep @/table.yaml $GRID --part 2/2 -o @/t2.csv");
  cli_run ("pinwheel sweep --merge @/t1.csv @/t2.csv -o @/t.csv");
  assert_non_null (strstr (cli_err, "tables is contents "));
  sweep_shell ("printf '0,0\\n1,1\\n' >@/table.csv\n"
               "pinwheel sweep @/table.yaml --vary I=1,2 --t-end 1 --part 2/2 -o @/t3.csv && "
               "pinwheel sweep --merge @/t1.csv @/t3.csv -o @/t.csv");
}

static void test_bad_input (void **state) {
  (void)state;
  static const struct {
    const char *options, *message;
  } bad[] = {
    { "", "nothing is varied: add --vary NAME=lin:FIRST:LAST:COUNT, log:..., or V1,V2,..." },
    { "--vary omga=1,2", "model ezyroller has no parameter \"omga\"; did you mean \"omega\"?" },
    { "--vary frame.vz=1,2", "model ezyroller has no state \"frame.vz\"; did you mean \"frame.vx\"?" },
    { "--vary omega=1,x", "--vary omega=1,x: \"x\" is not a finite number" },
    { "--vary omega=1,,2", "--vary omega=1,,2: \"\" is not a finite number" },
    { "--vary omega=1,inf", "--vary omega=1,inf: \"inf\" is not a finite number" },
    { "--vary omega=lin:1:2", "--vary omega=lin:1:2: expected lin:FIRST:LAST:COUNT, three numbers" },
    { "--vary omega=log:1:2:3:4", "--vary omega=log:1:2:3:4: expected log:FIRST:LAST:COUNT, three numbers" },
    { "--vary omega=lin:1:2:2.5", "--vary omega=lin:1:2:2.5: expected a count that is a whole number >= 1" },
    { "--vary omega=lin:1:2:1", "--vary omega=lin:1:2:1: a range with two different ends has at least 2 values" },
    { "--vary omega=log:0:2:3", "--vary omega=log:0:2:3: the ends of a logarithmic range must be > 0" },
    { "--vary omega=1:2:3", "--vary omega=1:2:3: a range begins with lin: or log:" },
    { "--vary omega", "--vary omega: expected NAME=lin:FIRST:LAST:COUNT, log:..., or a list v1,v2,..." },
    { "--vary omega=lin:1:2:2e8", "--vary omega=lin:1:2:2e8: too many values: at most 1e8 rows" },
    { "--vary omega=lin:1:2:20000 --vary M0=lin:1:2:30000",
      "the grid has 600000000 rows: at most 1e8; take coarser ranges, or several sweeps" },
    { "--vary m1=lin:1:-1:3", "model ezyroller: parameter m1 = 0: expected a number > 0" },
    { "--vary omega=1,2 --vary omega=3,4", "--vary omega is given twice" },
    { "--vary omega=1,2 --set omega=3", "omega is given by --vary and by --set" },
    { "--vary frame.x=1,2 --start frame.x=3", "frame.x is given by --vary and by --start" },
    { "--vary omega=1,2 --set q=3",
      "model ezyroller has no parameter \"q\"; valid are a, b, c, d, m1, I1, m2, I2, M0, omega" },
    { "--vary omega=1,2 --start frame.q=3",
      "model ezyroller has no state \"frame.q\"; valid are x, y, phi, vx, vy, omega" },
    { "--vary omega=1,2 --jobs 0", "--jobs 0: expected a whole number >= 1" },
    { "--vary omega=1,2 --part 3/2", "--part 3/2: expected I/N, whole numbers with 1 <= I <= N <= 1000000" },
    { "--vary omega=1,2 --part 1/3", "--part 1/3: the grid has only 2 rows" },
    { "--vary omega=1,2 --step 0", "--step 0: expected a number > 0" },
    { "--vary omega=1,2 --stp 1", "sweep has no option \"--stp\"; did you mean \"--step\"?" },
  };
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    char command[300];
    snprintf (command, sizeof command, "pinwheel sweep ezyroller %s -o @/bad.csv", bad[i].options);
    cli_bad (command, 2, bad[i].message);
  }
  cli_bad ("pinwheel sweep ezyroller " GRID, 2, "nowhere to write the table: add -o FILE.csv");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o -", 2,
           "-o -: a sweep needs a file, next to which it keeps what it has done");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o /none/x.csv", 1,
           "cannot write /none/x.csv.part: No such file or directory");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o /dev/full", 1,
           "cannot write /dev/full: a sweep needs a regular file, next to which it keeps its journal");
  cli_good ("ls @ | grep -c '^bad' || true");
  assert_string_equal (cli_out, "0\n");
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_order),         cmocka_unit_test (test_ranges),
    cmocka_unit_test (test_row_is_run),    cmocka_unit_test (test_start_values),
    cmocka_unit_test (test_counts),        cmocka_unit_test (test_cpu),
    cmocka_unit_test (test_failures),      cmocka_unit_test (test_all_fail),
    cmocka_unit_test (test_fails_late),    cmocka_unit_test (test_jobs),
    cmocka_unit_test (test_cut_journal),   cmocka_unit_test (test_odd_journal),
    cmocka_unit_test (test_kills),         cmocka_unit_test (test_journal_of_another),
    cmocka_unit_test (test_lock),          cmocka_unit_test (test_parts),
    cmocka_unit_test (test_bad_parts),     cmocka_unit_test (test_bad_input),
    cmocka_unit_test (test_changed_table),
  };
  return cmocka_run_group_tests_name ("sweeps", tests, cli_setup, cli_teardown);
}
