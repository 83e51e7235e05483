/* pinwheel run --checkpoint, --resume: a run that is killed and resumed writes the same bytes; a file that does not
 * belong to the run, or is not whole, is refused. */
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

#define RESUME_RUN "run ezyroller --t-end 30 --energy --every 0.01 --checkpoint-every 0.5 "
#define RESUME_PROGRAM "${PINWHEEL:-build/pinwheel} "

/* Kills the run again and again until it gets through: with SIGKILL, after the given number of seconds. */
static void resume_killed (const char *method) {
  char command[2000];
  snprintf (command, sizeof command,
            "pinwheel " RESUME_RUN "-m %s -o @/whole.csv --json @/whole.json --checkpoint @/whole.ck", method);
  cli_good (command);
  snprintf (
      command, sizeof command,
      "rm -f @/killed.*; kills=0\n"
      "for wait in 0.03 0.05 0.08 0.12 0.2 60; do\n"
      "  resume=; [ ! -e @/killed.ck ] || resume='--resume @/killed.ck'\n"
      "  " RESUME_PROGRAM RESUME_RUN "-m %s -o @/killed.csv --json @/killed.json --checkpoint @/killed.ck $resume &\n"
      "  if [ $wait = 60 ]; then wait $!; else sleep $wait; kill -9 $! && kills=$((kills + 1)); wait $!; fi && break\n"
      "done 2>/dev/null; [ $kills -gt 0 ] && echo killed",
      method);
  cli_run (command);
  if (strcmp (cli_out, "killed\n") != 0) print_error ("%s: never killed\n%s", method, cli_err);
  assert_string_equal (cli_out, "killed\n");
  cli_good ("cmp @/whole.csv @/killed.csv && for f in whole killed; do grep -v cpu_s @/$f.json >@/$f; done && "
            "cmp @/whole @/killed && test ! -e @/killed.csv.part");
}

TEST (killed) {
  resume_killed ("rk4+projection");
  resume_killed ("erk8+projection --rtol 1e-12");
  resume_killed ("ida+ggl");
}

/* Saving disturbs no step of a one-step method; the summary counts the restarts of a multistep one. */
TEST (restarts) {
  cli_good ("pinwheel " RESUME_RUN "-m rk4 -o @/a.csv --json @/a.json --checkpoint @/a.ck");
  assert_true (cli_number (cli_file ("a.json"), "restarts", NULL) == 0);
  assert_true (cli_number (cli_file ("a.json"), "steps", NULL) == 30000);
  cli_good ("pinwheel " RESUME_RUN "-m ida+ggl -o @/a.csv --json @/a.json --checkpoint @/a.ck");
  assert_true (cli_number (cli_file ("a.json"), "restarts", NULL) == 59);
  cli_good ("pinwheel run ezyroller --t-end 30 -m ida+ggl --checkpoint @/a.ck | grep -q 'restarted at 9 checkpoints'");
}

/* Stopped by a signal: what there is to go on from, and that it does. */
TEST (interrupted) {
  cli_run ("rm -f @/a.*; " RESUME_PROGRAM RESUME_RUN "-m rk4 --step 1e-5 -o @/a.csv --checkpoint @/a.ck & "
           "while kill -0 $! 2>/dev/null && [ ! -e @/a.ck ]; do sleep 0.02; done; kill -TERM $!; wait $!; echo $?");
  assert_string_equal (cli_out, "130\n");
  assert_non_null (strstr (cli_err, "a.csv.part\n"));
  assert_non_null (strstr (cli_err, "/a.ck continues from t = "));
}

/* An interval far below the round-off of time: a checkpoint after every step. */
TEST (short_interval) {
  cli_good ("timeout -s KILL 20 " RESUME_PROGRAM "run ezyroller -t 0.02 --checkpoint-every 1e-20 --checkpoint @/s.ck");
}

/* With a row for every step, too, none is there twice; a run that had ended already, but for its checkpoint, goes
 * on. */
TEST (every_step) {
  static const char *const left[] = { "cp @/one.csv @/two.csv.part", "cp @/one.csv @/two.csv", NULL };
  cli_good ("pinwheel run ezyroller -t 2 --checkpoint-every 0.5 --checkpoint @/one.ck -o @/one.csv");
  for (const char *const *c = left; *c; c++) {
    char command[400];
    snprintf (
        command, sizeof command,
        "rm -f @/two.*; %s; cp @/one.ck @/two.ck\n"
        "pinwheel run ezyroller -t 2 --resume @/two.ck -o @/two.csv 2>@/said && cmp @/one.csv @/two.csv || exit 1\n"
        "ls @ | grep -c 'two.*part' || :",
        *c);
    cli_good (command);
    assert_string_equal (cli_out, "0\n");
  }
}

/* A state given twice has its last value. */
TEST (start_twice) {
#define RESUME_TWICE "pinwheel run ezyroller -t 2 -o @/t.csv --start frame.vx=1 --start frame.vx=0.1 "
  cli_shell (RESUME_TWICE "--checkpoint @/t.ck; mv @/t.csv @/t.csv.part; " RESUME_TWICE "--resume @/t.ck");
  cli_bad ("mv @/t.csv @/t.csv.part; " RESUME_TWICE "--start frame.vx=2 --resume @/t.ck", 2,
           "the checkpoint @/t.ck belongs to another run: start frame.vx is 0.1 there and 2 here");
}

/* ---- What is refused ---- */

#define RESUME_WITH(t_end, every) "run ezyroller --t-end " t_end " --checkpoint-every " every " -o @/b.csv "
#define RESUME_SHORT RESUME_WITH ("2", "0.5")

/* A checkpoint of a run that was stopped, with its table. */
static void resume_prepare (void) {
  cli_good ("rm -f @/b.*; pinwheel " RESUME_SHORT "--checkpoint @/b.ck; mv @/b.csv @/b.csv.part; cp @/b.ck @/good.ck");
}

static void resume_bad (const char *change, const char *option, const char *message) {
  resume_prepare ();
  cli_bad (check_text ("%s; pinwheel " RESUME_SHORT "%s --resume @/b.ck", change, option), 2, message);
  cli_good ("test -s @/b.csv.part");
}

TEST (other_run) {
#define OTHER "the checkpoint @/b.ck belongs to another run: "
  resume_bad (":", "--set a=0.6", OTHER "parameter a is 0.5 there and 0.6 here");
  resume_bad (":", "--step 2e-3", OTHER "step is 0.001 there and 0.002 here");
  resume_bad (":", "-m rk4+baumgarte", OTHER "method is rk4+projection there and rk4+baumgarte here");
  resume_prepare ();
  cli_bad ("pinwheel " RESUME_WITH ("3", "0.5") "--resume @/b.ck", 2, OTHER "t-end is 2 there and 3 here");
  cli_bad ("pinwheel " RESUME_WITH ("2", "1") "--resume @/b.ck", 2, OTHER "checkpoint-every is 0.5 there and 1 here");
  resume_bad (":", "--start frame.vx=1", OTHER "start frame.vx is 1 here and not set there");
  resume_bad (":", "--energy", OTHER "energy is not kept there and kept here");
  resume_prepare ();
  cli_run ("pinwheel run pendulum --t-end 2 --checkpoint-every 0.5 -o @/b.csv --resume @/b.ck");
  assert_non_null (strstr (cli_err, "b.ck belongs to another run: model is ezyroller, contents "));
  resume_prepare ();
  cli_run ("pinwheel " RESUME_SHORT "--method-file docs/method.c --resume @/b.ck");
  assert_non_null (strstr (cli_err, "b.ck belongs to another run: method-file is method, contents "));
}

TEST (other_file) {
  resume_bad ("rm @/b.ck", "", "cannot read the checkpoint @/b.ck: No such file or directory");
  resume_bad ("echo hello >@/b.ck", "", "@/b.ck is not a checkpoint of Pinwheel");
  resume_bad (": >@/b.ck", "", "@/b.ck is not a checkpoint of Pinwheel");
  resume_bad ("rm @/b.ck; mkdir @/b.ck", "",
              "cannot read the checkpoint @/b.ck: it is a directory, not a regular file");
  cli_good ("rmdir @/b.ck");
  resume_bad ("sed 1s/2/7/ @/good.ck >@/b.ck", "", "@/b.ck is a checkpoint of format 7; this Pinwheel reads format 2");
  resume_bad ("sed '1s/$/\r/' @/good.ck >@/b.ck", "", "the checkpoint @/b.ck is truncated or damaged");
  resume_bad ("printf 'pinwheel checkpoint 2' >@/b.ck", "", "the checkpoint @/b.ck is truncated or damaged");
  resume_bad ("printf x >>@/b.ck", "", "the checkpoint @/b.ck is damaged: its checksum is wrong");
  resume_bad ("rm @/b.csv.part; echo >@/b.csv.part", "",
              "cannot continue @/b.csv: @/b.csv.part is not the table that the checkpoint belongs to");
  resume_bad ("sed -i '$s/1/2/' @/b.csv.part; sed -i '1500s/1/2/' @/b.csv.part", "",
              "cannot continue @/b.csv: @/b.csv.part is not the table that the checkpoint belongs to");
}

/* A run that cannot be resumed leaves the summary of the one before it. */
TEST (summary) {
  resume_bad ("echo old >@/b.json; echo hello >@/b.ck", "--json @/b.json", "@/b.ck is not a checkpoint of Pinwheel");
  assert_string_equal (cli_file ("b.json"), "old\n");
  cli_good ("test ! -e @/b.json.part");
}

/* Cut anywhere, or with any one bit changed, it is refused. */
TEST (damaged) {
  static char text[20000], other[20000];
  resume_prepare ();
  FILE *f = fopen (cli_path ("good.ck"), "rb");
  assert_non_null (f);
  size_t size = fread (text, 1, sizeof text, f);
  fclose (f);
  for (int i = 0; i < 40; i++) {
    size_t at = size * (size_t)i / 40, length = i % 2 ? at : size;
    memcpy (other, text, size);
    other[at] = (char)(other[at] ^ (1 << i % 8));
    cli_write_bytes ("b.ck", other, length);
    int status = cli_run ("pinwheel " RESUME_SHORT "--resume @/b.ck");
    if (status != 2) print_error ("byte %zu, %zu bytes: status %d, %s", at, length, status, cli_err);
    assert_int_equal (status, 2);
    assert_non_null (strstr (cli_err, "checkpoint"));
  }
}

TEST (options) {
  cli_bad ("pinwheel run ezyroller --checkpoint-every 1", 2,
           "--checkpoint-every 1: --checkpoint FILE is needed to save to");
  cli_bad ("pinwheel run ezyroller --checkpoint @/c.ck --checkpoint-every -1", 2,
           "--checkpoint-every -1: expected a number > 0");
  cli_bad ("pinwheel run ezyroller --checkpoint @/c.ck -o -", 2,
           "--checkpoint: a table on standard output cannot be continued; write it to a file");
  cli_bad ("pinwheel run ezyroller --checkpoint @/c.ck -o /dev/null", 2,
           "/dev/null cannot be continued: it is not a regular file");
  cli_bad ("pinwheel run ezyroller --checkpoint @/c.ck --reference @/none.csv", 2,
           "cannot read @/none.csv: No such file or directory");
  cli_bad ("pinwheel run ezyroller --checkpoint @/none/c.ck", 1, "cannot write @/none/c.ck: No such file or directory");
}

const check_fixture fixture = { cli_setup, cli_teardown };
