/* pinwheel sweep: the grid, rows and runs, failures, bad input. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

#define GRID "--vary omega=1:4:4 --vary M0=0.05,0.1,0.2 --t-end 0.05"

/* ---- The grid and its rows ---- */

TEST (order) {
  cli_good ("pinwheel sweep ezyroller " GRID " -o @/order.csv && cut -d, -f1-4 @/order.csv | sed -n '1,5p;13p'");
  assert_string_equal (cli_out, "omega [rad/s],M0 [N m],status,t [s]\n"
                                "1,0.05,ok,0.05\n"
                                "1,0.1,ok,0.05\n"
                                "1,0.2,ok,0.05\n"
                                "2,0.05,ok,0.05\n"
                                "4,0.2,ok,0.05\n");
  cli_good ("ls @ | grep -c '^order'; wc -l <@/order.csv");
  assert_string_equal (cli_out, "1\n13\n");
}

/* The fourth value of 0:1:11 is 0.3, ends are exact, and decades of a logarithmic range are; large numbers do not
 * overflow. */
TEST (ranges) {
  cli_good ("pinwheel sweep ezyroller --vary M0=0:1:11 --t-end 0.001 -o @/lin.csv && sed -n 5p @/lin.csv | cut -d, "
            "-f1,2");
  assert_string_equal (cli_out, "0.3,ok\n");
  cli_good ("pinwheel sweep ezyroller --vary M0=1e-3:10:5:log --t-end 0.001 -o @/log.csv && cut -d, -f1 @/log.csv");
  const double expected[5] = { 1e-3, 1e-2, 0.1, 1, 10 };
  const char *at = strchr (cli_out, '\n') + 1;
  for (int i = 0; i < 5; i++, at = strchr (at, '\n') + 1)
    check_close ("decade", strtod (at, NULL), expected[i], expected[i] * 2 * CHECK_EPS, "round-off of pow");
  cli_good ("pinwheel sweep ezyroller --vary "
            "'M0=max(1,2),(3+0.00000000000000000000000000000000000000000000000000000000000000)' "
            "--t-end 0.001 -o @/list.csv && cut -d, -f1,2 @/list.csv | tail -n 2");
  assert_string_equal (cli_out, "2,ok\n3,ok\n");
  cli_good ("pinwheel sweep ezyroller --vary M0=-1:-1:1 --t-end 0.001 -o @/one.csv && wc -l <@/one.csv");
  assert_string_equal (cli_out, "2\n");
  cli_write ("unused.yaml", "pinwheel: 1\nabout: a parameter without effect\nparameters: [{name: a, value: 1}]\n"
                            "bodies: [{name: p, mass: 1, inertia: 1}]\n");
  cli_good ("pinwheel sweep @/unused.yaml --vary a=1e308:1.5e308:3 -t 0.1 -o @/large.csv && cut -d, -f1,2 "
            "@/large.csv | sed -n 3p");
  assert_string_equal (cli_out, "1.25e+308,ok\n");
}

/* A row is what the run says, digit by digit. */
TEST (row_is_run) {
  static const char *const method[] = { "rk4+projection --step 2e-3", "ida+ggl --rtol 1e-8" };
  for (int i = 0; i < 2; i++) {
    cli_shell (check_text (
        "o='--method %s --t-end 1.5 --set M0=0.2 --start frame.vx=0.3'\n"
        "pinwheel sweep ezyroller --vary omega=2,3 --vary frame.omega=0.1,0.4 $o -o @/row.csv || exit 1\n"
        "pinwheel run ezyroller --set omega=3 --start frame.omega=0.1 $o --every 1.5 -o @/run.csv 2>/dev/null\n"
        "sed -n '1p;4p' @/row.csv | cut -d, -f4-16 >@/a\n sed -n '1p;$p' @/run.csv | cut -d, -f1-13 >@/b\n"
        "cmp @/a @/b && pinwheel run ezyroller --set omega=3 --start frame.omega=0.1 $o --json - 2>/dev/null",
        method[i]));
    const char *row = cli_file ("row.csv");
    for (int line = 0; line < 3; line++) row = strchr (row, '\n') + 1;
    for (int comma = 0; comma < 17; comma++) row = strchr (row, ',') + 1;
    char *next;
    double position = strtod (row, &next), velocity = strtod (next + 1, &next);
    double steps = strtod (next + 1, &next), rhs = strtod (next + 1, NULL);
    assert_true (position == cli_number (cli_out, "residual", "position", NULL));
    assert_true (velocity == cli_number (cli_out, "residual", "velocity", NULL));
    assert_true (steps == cli_number (cli_out, "statistics", "steps", NULL));
    assert_true (rhs == cli_number (cli_out, "statistics", "rhs", NULL));
  }
}

/* Start values have a column of their own name, apart from the final state's. */
TEST (start_values) {
  cli_shell ("pinwheel sweep ezyroller --vary frame.vx=0,1 --t-end 0.01 -o @/start.csv && head -1 @/start.csv | cut "
             "-d, -f1-5");
  assert_string_equal (cli_out, "start.frame.vx [m/s],status,t [s],frame.x [m],frame.y [m]\n");
}

/* Varied and given initial values that the constraints change are counted, with the largest change. */
TEST (changed_values) {
  assert_int_equal (
      cli_run ("pinwheel sweep ezyroller --vary frame.vy=0,1,2 --start frame.omega=0 --t-end 0.01 -o @/v.csv"), 0);
  assert_string_equal (
      cli_err, "pinwheel: in 2 of 3 runs given initial values were changed to satisfy the constraints, at worst "
               "frame.omega from 0 to 4 rad/s\n");
  cli_good ("pinwheel sweep ezyroller --vary frame.vy=0,1,2 --t-end 0.01 -o @/v.csv");
}

/* Bodies may come and go with a count; where there is none there is no number. */
TEST (counts) {
  cli_shell ("pinwheel sweep tests/scenes/chain.c --vary links=2,1,3 --t-end 0.01 -o @/count.csv\n"
             "head -1 @/count.csv | tr , '\\n' | grep -c link; cut -d, -f1,2,15,16,21 @/count.csv");
  const char *expected = "19\nlinks,status,link2.omega [rad/s],link3.x [m],link3.omega [rad/s]\n2,ok,";
  assert_int_equal (strncmp (cli_out, expected, strlen (expected)), 0);
  assert_non_null (strstr (cli_out, ",nan,nan\n1,ok,nan,nan,nan\n3,ok,"));
}

TEST (cpu) {
  cli_shell ("pinwheel sweep ezyroller " GRID " --cpu -o @/cpu.csv && head -1 @/cpu.csv | grep -o 'rhs,.*'");
  assert_string_equal (cli_out, "rhs,cpu [s],reason\n");
}

/* Why runs that are measured or limited one by one have no lanes, nor those of a scene that cannot run by itself. */
TEST (no_lanes) {
  assert_int_equal (cli_run ("pinwheel sweep ezyroller " GRID " --lanes 4 --cpu -o @/cpu.csv"), 0);
  assert_string_equal (cli_err, "pinwheel: one run after the other: --cpu measures each run\n");
  assert_int_equal (cli_run ("pinwheel sweep ezyroller " GRID " --lanes 4 --limit 60 -o @/cpu.csv"), 0);
  assert_string_equal (cli_err, "pinwheel: one run after the other: --limit stops each run by itself\n");
  cli_write ("locked.yaml", "pinwheel: 1\nabout: three wheels that lock\nbodies:\n"
                            "  - {name: b, mass: 1, inertia: 1, rate: {vx: 1}}\nelements:\n"
                            "  - {wheel: A, body: b, at: [1, 0]}\n  - {wheel: B, body: b, at: [0, 1], heading: 1}\n"
                            "  - {wheel: C, body: b, at: [-1, 0], heading: 2}\n");
  assert_int_equal (cli_run ("pinwheel sweep @/locked.yaml --vary b.vx=0,0 --t-end 0.1 --lanes 4 --specialise always "
                             "-o @/locked.csv"),
                    0);
  assert_string_equal (cli_err, "pinwheel: one run after the other: the scene's initial state is refused\n");
}

/* ---- Compiled systems ---- */

/* A model that counts how often it is built. */
static const char sweep_counted[] =
    "#include <stdio.h>\n#include <stdlib.h>\n#include \"pinwheel.h\"\n"
    "static const pw_parameter p[] = { { \"l\", 0, 1, \"m\", \"length\", PW_POSITIVE }, { 0 } };\n"
    "static void build (pw_model *m, const void *l) {\n"
    "  FILE *f = fopen (getenv (\"COUNTED\"), \"a\");\n"
    "  fputs (\"x\\n\", f), fclose (f);\n"
    "  pw_add_body (m, &(pw_body){ .name = \"b\", .mass = 1, .inertia = *(const double *)l });\n}\n"
    "PW_MODEL (.about = \"\", .parameters = p, .parameters_size = sizeof (double), .build = build);\n";

/* Once for the columns, then once for each of two lengths, whichever
 * quantity varies fastest.  One worker, so that the second length is not compiled while the first is still in use. */
TEST (shared) {
  cli_write ("counted.c", sweep_counted);
  cli_shell ("export COUNTED=@/counted; s='pinwheel sweep @/counted.c --t-end 0.01'\n"
             "for v in '--vary l=1,2 --vary b.omega=0,1,2' '--vary b.omega=0,1,2 --vary l=1,2'; do rm -f @/counted\n"
             "$s $v -j 1 -o @/one.csv && wc -l <@/counted && $s $v -j 3 -o @/three.csv && cmp @/one.csv @/three.csv || "
             "exit 1\n"
             "done");
  assert_string_equal (cli_out, "3\n3\n");
}

/* A misspelt state is reported once a model has been compiled, which has all states but for counts. */
TEST (misspelt_state) {
  cli_write ("counted.c", sweep_counted);
  assert_int_equal (
      cli_run ("rm -f @/counted; export COUNTED=@/counted; pinwheel sweep @/counted.c --t-end 0.01 --vary "
               "l=1:2:50 --vary b.omgea=0,1 -o @/wrong.csv; s=$?; wc -l <@/counted; exit $s"),
      2);
  assert_non_null (strstr (cli_err, "did you mean \"b.omega\"?"));
  assert_string_equal (cli_out, "1\n");
}

/* ---- Runs that fail ---- */

TEST (failures) {
  assert_int_equal (cli_run ("pinwheel sweep tests/scenes/chain.c --vary pull=-1,2,-3 --t-end 0.01 -o @/fail.csv"), 0);
  assert_string_equal (cli_err,
                       "pinwheel: 2 of 3 runs failed, the first of them: model chain: the spring \"pulls\", -1 N/m "
                       "does not\n");
  cli_good ("grep -o ',nan,\"model.*' @/fail.csv; cut -d, -f1-3 @/fail.csv | sed -n '2,4p'");
  assert_string_equal (cli_out, ",nan,\"model chain: the spring \"\"pulls\"\", -1 N/m does not\"\n"
                                ",nan,\"model chain: the spring \"\"pulls\"\", -3 N/m does not\"\n"
                                "-1,input,nan\n2,ok,0.01\n-3,input,nan\n");
}

TEST (all_fail) {
  cli_bad ("pinwheel sweep ezyroller --vary omega=1,2 --set c=0 --set d=0 --t-end 0.01 -o @/all.csv", 2,
           "all 2 runs failed, the first one: model ezyroller: steer.phi has no inertia, and no constraint determines "
           "how it moves, although wheel C depends on it; give it inertia, or constrain it");
  assert_non_null (cli_file ("all.csv"));
  cli_bad ("pinwheel sweep tests/scenes/chain.c --vary pull=-1,-2 --t-end 0.01 -o @/none.csv", 2,
           "model chain: the spring\n\"pulls\", -1 N/m does not");
  assert_null (cli_file ("none.csv"));
  assert_int_equal (
      cli_run ("pinwheel sweep ezyroller --vary omega=1,2 --set c=0 --set d=0 --t-end 0.01 --part 1/2 -o @/all.csv"),
      0);
}

/* A run that fails on the way says how far it came. */
TEST (fails_late) {
  assert_int_equal (
      cli_run ("pinwheel sweep ezyroller --vary M0=0.1,1e300 --method rk4+none --t-end 0.05 -o @/late.csv"), 0);
  assert_int_equal (strncmp (cli_err, "pinwheel: 1 of 2 runs failed, the first of them: ", 49), 0);
  cli_good ("cut -d, -f2,3 @/late.csv | sed -n 3p");
  assert_int_equal (strncmp (cli_out, "method,", 7), 0);
  assert_true (strtod (cli_out + 7, NULL) < 0.05);
}

/* ---- Bad input: said before anything is computed ---- */

TEST (bad_input) {
  static const cli_wrong bad[] = {
    { "", "nothing is varied: add --vary NAME=LOW:HIGH[:COUNT][:log] or NAME=V1,V2,..." },
    { "--vary omga=1,2", "model ezyroller has no parameter \"omga\"; did you mean \"omega\"?" },
    { "--vary frame.vz=1,2", "model ezyroller has no state \"frame.vz\"; did you mean \"frame.vx\"?" },
    { "--vary omega=1,x", "--vary omega=1,x: \"x\" is not a finite number" },
    { "--vary omega=1,,2", "--vary omega=1,,2: \"\" is not a finite number" },
    { "--vary omega=1,inf", "--vary omega=1,inf: \"inf\" is not a finite number" },
    { "--vary omega=1:x", "--vary omega=1:x: expected NAME=LOW:HIGH[:COUNT][:log], numbers" },
    { "--vary omega=1:2:3:4", "--vary omega=1:2:3:4: expected NAME=LOW:HIGH[:COUNT][:log], numbers" },
    { "--vary omega=1:2:2.5", "--vary omega=1:2:2.5: expected a count that is a whole number >= 1" },
    { "--vary omega=1:2:1", "--vary omega=1:2:1: a range with two different ends needs at least 2 values" },
    { "--vary omega=0:2:3:log", "--vary omega=0:2:3:log: the ends of a logarithmic range must be > 0" },
    { "--vary omega", "--vary omega: expected NAME=LOW:HIGH[:COUNT][:log] or a list NAME=V1,V2,..." },
    { "--vary omega=1:2:2e8", "--vary omega=1:2:2e8: too many values: at most 1e8 rows" },
    { "--vary omega=1:2:20000 --vary M0=1:2:30000",
      "the grid has 600000000 rows: at most 1e8; use coarser ranges, or several sweeps" },
    { "--vary m1=1:-1:3", "model ezyroller: parameter m1 = 0: expected a number > 0" },
    { "--vary omega=1,2 --vary omega=3,4", "--vary omega is given twice" },
    { "--vary omega=1,2 --set omega=3", "omega is given by --vary and by --set" },
    { "--vary frame.x=1,2 --start frame.x=3", "frame.x is given by --vary and by --start" },
    { "--vary omega=1,2 --set q=3",
      "model ezyroller has no parameter \"q\"; valid are a, b, c, d, m1, I1, m2, I2, M0, omega" },
    { "--vary omega=1,2 --start frame.q=3",
      "model ezyroller has no state \"frame.q\"; valid are x, y, phi, vx, vy, omega" },
    { "--vary omega=1,2 --jobs 0", "--jobs 0: expected a whole number >= 1" },
    { "--vary omega=1,2 --part 3/2", "--part 3/2: expected I/N, whole numbers with 1 <= I <= N <= 1000000" },
    { "--vary omega=1,2 --part 1/3", "--part 1/3: more parts than the 2 rows of the grid" },
    { "--vary omega=1,2 --step 0", "--step 0: expected a number > 0" },
    { "--vary omega=1,2 --stp 1", "sweep has no option \"--stp\"; did you mean \"--step\"?" },
  };
  cli_bad_each ("sweep ezyroller -o @/bad.csv", bad, sizeof bad / sizeof *bad);
  cli_bad ("pinwheel sweep ezyroller " GRID, 2, "nowhere to write the table: add -o FILE.csv");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o -", 2,
           "-o -: a sweep needs a file, next to which it keeps what it has done");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o /none/x.csv", 1,
           "cannot write /none/x.csv.part: No such file or directory");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o /dev/full", 1,
           "cannot write /dev/full: it is a character device, not a regular file");
  cli_good ("ls @ | grep -c '^bad' || true");
  assert_string_equal (cli_out, "0\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
