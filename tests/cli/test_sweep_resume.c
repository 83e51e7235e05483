/* Sweeps that are stopped, resumed and put together: journals cut anywhere, kills, locks, parts. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

#define GRID "--vary omega=1:4:4 --vary M0=0.05,0.1,0.2 --t-end 0.05"

/* ---- The same table whatever happens ---- */

TEST (jobs) {
  cli_shell ("for m in rk4+projection ida+ggl ida+baumgarte; do for j in 1 2 3 7; do\n"
             "  pinwheel sweep ezyroller " GRID " -m $m -j $j -o @/jobs.csv && cksum <@/jobs.csv || exit 1\n"
             "done | sort -u | wc -l; done");
  assert_string_equal (cli_out, "1\n1\n1\n");
}

/* A journal cut after any byte, as a kill may leave it: the part is a complete journal with another name. */
TEST (cut_journal) {
  cli_shell ("s='pinwheel sweep ezyroller " GRID " --part 1/2 -o @/cut.csv'; $s || exit 1\n"
             "cp @/cut.csv @/whole; size=$(wc -c <@/whole); n=0\n"
             "while [ $n -le $size ]; do\n"
             "  head -c $n @/whole >@/cut.csv.part; $s 2>/dev/null || exit 1\n"
             "  cmp @/cut.csv @/whole || exit 1\n"
             "  [ ! -e @/cut.csv.part ] || exit 1\n"
             "  n=$((n + 61)); done");
}

/* Rows in another order, a row twice, a damaged one, rows of another part, a forgotten half-sorted table. */
TEST (odd_journal) {
  cli_shell ("s='pinwheel sweep ezyroller " GRID " --part 2/2 -o @/odd.csv'; $s || exit 1\n"
             "cp @/odd.csv @/whole; head=$(grep -n '^end$' @/whole | cut -d: -f1)\n"
             "front () { head -$head @/whole; }; rows () { tail -n +$((head + 1)) @/whole; }\n"
             "try () { $s || exit 1; cmp @/odd.csv @/whole || exit 1; }\n"
             "{ front; rows | sort -r; } >@/odd.csv.part; try\n"
             "{ front; rows | head -2; rows; } >@/odd.csv.part; try\n"
             "pinwheel sweep ezyroller " GRID " --part 1/2 -o @/first.csv || exit 1\n"
             "{ front; sed '1,/^end$/d' @/first.csv; } >@/odd.csv.part; try\n"
             "{ front; rows | sed '3s/ok,0/ok,1/'; } >@/odd.csv.part; try\n"
             "{ front; rows | head -3; printf 'zzz'; } >@/odd.csv.part; echo x >@/odd.csv.sorted; try\n");
  const char *expected = ": 6 of 6 runs are done\n";
  assert_non_null (strstr (cli_err, expected));
  assert_non_null (strstr (strstr (cli_err, expected) + 1, ": 2 of 6 runs are done\n"));
}

/* A signal, and kills at odd moments, until it is through. */
TEST (kills) {
  const char *sweep = "p=\"${PINWHEEL:-build/pinwheel}\"\n"
                      "s='sweep ezyroller --vary omega=1:4:10 --vary M0=0.05,0.1,0.2,0.3 --t-end 4'\n";
  cli_shell (check_text ("%s\"$p\" $s -j 1 -o @/whole.csv || exit 1\n"
                         "\"$p\" $s -o @/kill.csv &\n"
                         "while kill -0 $! && ! grep -q '^[0-9]' @/kill.csv.part; do sleep 0.01; done 2>/dev/null; "
                         "kill -TERM $!; wait $!; "
                         "echo $?; ls @/kill.csv*",
                         sweep));
  char expected[200];
  cli_expand ("130\n@/kill.csv.part\n", expected, sizeof expected);
  assert_string_equal (cli_out, expected);
  assert_non_null (strstr (cli_err, "; the same command continues from there\n"));
  cli_shell (check_text ("%si=3; while [ $i -lt 60 ]; do i=$((i + 1))\n"
                         "\"$p\" $s -o @/kill.csv 2>/dev/null & sleep $(printf 0.%%02d $i)\n"
                         "kill -KILL $! 2>/dev/null; wait $! 2>/dev/null && break\n"
                         "done; \"$p\" $s -o @/kill.csv; cmp @/kill.csv @/whole.csv && [ ! -e @/kill.csv.part ]",
                         sweep));
}

TEST (journal_of_another) {
  cli_shell ("pinwheel sweep ezyroller " GRID " --part 1/2 -o @/other.csv && mv @/other.csv @/other.csv.part");
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
  OTHER ("--vary omega=1:4:4 --vary M0=0.05,0.1,0.3 --t-end 0.05 --part 1/2",
         "vary M0 is 0.05,0.1,0.2 there and 0.05,0.1,0.3 here");
  OTHER ("--vary M0=0.05,0.1,0.2 --vary omega=1:4:4 --t-end 0.05 --part 1/2",
         "order is omega,M0 there and M0,omega here");
#undef OTHER
  cli_write ("mine.csv.part", "t [s],x [m]\n0,1\n");
  cli_bad ("pinwheel sweep ezyroller " GRID " -o @/mine.csv", 2,
           "@/mine.csv.part exists and is not the journal of a sweep: remove it if it is not needed");
  assert_string_equal (cli_file ("mine.csv.part"), "t [s],x [m]\n0,1\n");
}

TEST (lock) {
  cli_shell (
      "\"${PINWHEEL:-build/pinwheel}\" sweep ezyroller --vary omega=1:4:400 --t-end 50 -o @/lock.csv & first=$!\n"
      "while kill -0 $! 2>/dev/null && [ ! -s @/lock.csv.part ]; do sleep 0.02; done\n"
      "pinwheel sweep ezyroller --vary omega=1:4:400 --t-end 50 -o @/lock.csv; echo $?; kill -KILL $first");
  assert_string_equal (cli_out, "1\n");
  char expected[200];
  cli_expand ("pinwheel: cannot write @/lock.csv.part: another process is writing it\n", expected, sizeof expected);
  assert_non_null (strstr (cli_err, expected));
}

/* ---- Parts ---- */

TEST (parts) {
  cli_shell ("pinwheel sweep ezyroller " GRID " -o @/one.csv || exit 1\n"
             "for n in 1 4 5 12; do rm -f @/part*; i=1; while [ $i -le $n ]; do\n"
             "  pinwheel sweep ezyroller " GRID " --part $i/$n -o @/part$i.csv || exit 1; i=$((i + 1)); done\n"
             "  [ $n = 1 ] || pinwheel sweep --merge @/part*.csv -o @/part1.csv.all || exit 1\n"
             "  [ $n = 1 ] || cmp @/part1.csv.all @/one.csv || exit 1\n"
             "done");
}

TEST (bad_parts) {
  cli_shell ("for i in 1 2 3; do pinwheel sweep ezyroller " GRID " --part $i/3 -o @/p$i.csv || exit 1; done\n"
             "pinwheel sweep ezyroller " GRID " --step 2e-3 --part 2/3 -o @/q2.csv\n"
             "pinwheel sweep ezyroller " GRID
             " --part 2/4 -o @/r2.csv; cp @/p2.csv @/copy.csv; head -n -1 @/p3.csv >@/short.csv\n"
             "for i in 1 2; do pinwheel sweep ezyroller --vary \"frame.vx=1,\n$i\" --t-end 0.01 --part $i/2"
             " -o @/n$i.csv; done");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p3.csv -o @/m.csv", 2, "part 2 of 3 is missing");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv -o @/m.csv", 2, "part 3 of 3 is missing");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv @/copy.csv -o @/m.csv", 2,
           "@/p2.csv and @/copy.csv are both part 2 of 3");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/q2.csv @/p3.csv -o @/m.csv", 2,
           "@/p1.csv and @/q2.csv are parts of different sweeps: step is 0.001 in the first and 0.002 in the second");
  cli_bad ("pinwheel sweep --merge @/n1.csv @/n2.csv -o @/m.csv", 2,
           "@/n1.csv and @/n2.csv are parts of different sweeps: vary frame.vx is 1, 1 in the first and 1, 2 in the "
           "second");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/r2.csv @/p3.csv -o @/m.csv", 2,
           "@/p1.csv is one of 3 parts, @/r2.csv one of 4");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv @/short.csv -o @/m.csv", 2,
           "@/short.csv is not complete: row 12 is missing; finish that part first");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/none.csv -o @/m.csv", 2,
           "cannot open the part @/none.csv: No such file or directory");
  cli_bad ("pinwheel sweep --merge Makefile -o @/m.csv", 2,
           "Makefile is not a part of a sweep: parts are written by --part I/N");
  cli_bad ("pinwheel sweep --merge @/p1.csv @/p2.csv @/p3.csv -o @/p2.csv", 2,
           "-o @/p2.csv would overwrite the part, @/p2.csv");
  cli_bad ("pinwheel sweep --merge @/p1.csv -o @/m.csv --jobs 2", 2,
           "--jobs cannot be combined with --merge: the parts define the sweep");
  cli_bad ("pinwheel sweep --merge @/p1.csv -o @/m.csv --max-file 2", 2,
           "--max-file cannot be combined with --merge: the parts define the sweep");
  cli_good ("ls @ | grep -c '^m.csv' || true");
  assert_string_equal (cli_out, "0\n");
}

/* A table in a file is as much of the model as the model's own file. */
TEST (changed_table) {
  cli_write ("table.yaml", "pinwheel: 1\nparameters: [{name: I, value: 1, domain: positive}]\n"
                           "bodies: [{name: a, mass: 1, inertia: I}]\n"
                           "elements: [{torque: T, body: [a, ground], value: {table: {file: table.csv}}}]\n");
  cli_shell ("GRID='--vary I=1,2 --t-end 1'\n"
             "printf '0,0\\n1,1\\n' >@/table.csv; pinwheel sweep @/table.yaml $GRID --part 1/2 -o @/t1.csv\n"
             "printf '0,0\\n1,2\\n' >@/table.csv; pinwheel sweep @/table.yaml $GRID --part 2/2 -o @/t2.csv");
  cli_run ("pinwheel sweep --merge @/t1.csv @/t2.csv -o @/t.csv");
  assert_non_null (strstr (cli_err, "tables is contents "));
  cli_shell ("printf '0,0\\n1,1\\n' >@/table.csv\n"
             "pinwheel sweep @/table.yaml --vary I=1,2 --t-end 1 --part 2/2 -o @/t3.csv && "
             "pinwheel sweep --merge @/t1.csv @/t3.csv -o @/t.csv");
}

const check_fixture fixture = { cli_setup, cli_teardown };
