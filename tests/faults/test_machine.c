/* Failures of the system: files that cannot be written or extended, closed pipes, Ctrl-C at any moment, programs
 * that are missing, names with blanks and umlauts.  What is left is whole, or carries another name. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"

#define MACHINE "\"${PINWHEEL:-build/pinwheel}\" "

/* Commands that write files, all of them into the folder @/o. */
static const char *const machine_writers[] = {
  "run ezyroller --t-end 2 -o @/o/a.csv --json @/o/a.json",
  "run ezyroller --t-end 2 -m erk5+projection --every 0.002 -o @/o/a.csv --checkpoint @/o/a.ck --checkpoint-every 0.3",
  "run ezyroller --t-end 1 --plots @/o",
  "sweep ezyroller --t-end 0.1 --vary omega=1:3:100 --jobs 2 -o @/o/a.csv",
  "compare ezyroller --t-end 0.5 --methods rk4 --limit 5 --step-ladder 0.1:0.025 --plots @/o",
  "drift ezyroller --t-end 0.5 --methods rk4+none,rk4+projection --only-methods --plots @/o",
  "new @/o/mine.yaml",
};
enum { MACHINE_WRITERS = sizeof machine_writers / sizeof *machine_writers };

/* Runs a writer in a shell prepared by `before`; there is no gnuplot, figures take too long. */
static int machine_write (const char *before, const char *writer) {
  char text[1500];
  snprintf (text, sizeof text, "mkdir -p @/o; (%s; PATH=@; exec " MACHINE "%s) >@/out1 2>@/log", before, writer);
  return cli_run (text);
}

/* The writer's files when nothing fails, in @/whole. */
static void machine_whole (const char *writer) {
  cli_run ("rm -rf @/o @/whole");
  int status = machine_write (":", writer);
  if (status != 0) print_error ("%s: %s", writer, cli_file ("log"));
  assert_int_equal (status, 0);
  cli_good ("mv @/o @/whole");
}

/* Files under their own names are whole: of as many lines as those in @/whole; or they say that they are not.  A
 * checkpoint may be of any time; that it is whole is tested where it is resumed. */
static void machine_check_whole (const char *writer) {
  cli_run ("for f in @/o/*; do case $f in *.part | *.sorted | *.ck | */\\*) continue ;; esac\n"
           "  head -1 $f | grep -q '^# incomplete: ' || [ \"$(wc -l <$f)\" = \"$(wc -l <@/whole/${f##*/})\" ] || echo "
           "${f##*/}\n"
           "done");
  if (*cli_out) print_error ("%s: not whole: %s", writer, cli_out);
  assert_string_equal (cli_out, "");
}

/* As on a disk that is full: no file may grow beyond so many blocks of 512 bytes. */
TEST (full) {
  for (int i = 0; i < MACHINE_WRITERS; i++) {
    machine_whole (machine_writers[i]);
    int failed = 0;
    for (int blocks = 0; blocks < 120; blocks = 4 * blocks + 1) {
      char limit[60];
      cli_run ("rm -rf @/o");
      snprintf (limit, sizeof limit, "ulimit -f %d", blocks);
      int status = machine_write (limit, machine_writers[i]);
      assert_true (status == 0 || status == 1);
      failed += status == 1;
      machine_check_whole (machine_writers[i]);
      const char *said = cli_file ("log");
      if (status == 1 && blocks > 0) assert_non_null (strstr (said, "pinwheel: cannot write "));
    }
    assert_true (failed > 0);
  }
}

/* /dev/full takes nothing; a folder that cannot be written; a folder in the place of a file. */
TEST (unwritable) {
  const char *folder = getuid () == 0 ? "@/file" : "@/closed"; /* root may write everywhere but below a file */
  const char *const option[] = { "run ezyroller -o %s/x.csv",
                                 "run ezyroller --json %s/x.json",
                                 "run ezyroller --plots %s/x",
                                 "run ezyroller --checkpoint %s/x.ck",
                                 "sweep ezyroller --vary a=0.5,0.6 -o %s/x.csv",
                                 "compare ezyroller -o %s/x",
                                 "drift ezyroller -o %s/x",
                                 "new %s/x.c" };
  cli_good ("mkdir -p @/closed; chmod a-w @/closed; touch @/file");
  for (size_t i = 0; i < sizeof option / sizeof *option; i++) {
    char text[500], command[300];
    snprintf (command, sizeof command, option[i], folder);
    snprintf (text, sizeof text, "pinwheel %s --t-end 1e6 >@/log", command);
    if (strncmp (option[i], "new", 3) == 0) snprintf (text, sizeof text, "pinwheel %s >@/log", command);
    int status = cli_run (text);
    if (status != 1) print_error ("%s: %d: %s", command, status, cli_err);
    assert_int_equal (status, 1);
    assert_non_null (strstr (cli_err, "pinwheel: cannot "));
    assert_non_null (strstr (cli_err, "/x"));
  }
  if (access ("/dev/full", W_OK) != 0) return;
  cli_bad ("pinwheel run ezyroller -t 1 --json /dev/full", 1, "cannot write /dev/full: No space left on device");
  cli_bad ("pinwheel run ezyroller -t 1 -o - >/dev/full", 1, "cannot write standard output: No space left on device");
  cli_bad ("pinwheel run ezyroller -t 1 >/dev/full", 1, "cannot write to standard output: No space left on device");
  cli_bad ("pinwheel compare ezyroller --methods rk4 --t-end 0.1 --step-ladder 0.1:0.05 >/dev/full", 1,
           "cannot write to standard output: No space left on device");
}

/* A reader that has seen enough: nothing is said, the status is that of a process ended by SIGPIPE. */
TEST (closed_pipe) {
  const char *const command[] = { "run ezyroller -o -", "run ezyroller --json -", "run ezyroller", "list",
                                  "show chain",         "show --yaml pendulum",   "list methods" };
  for (size_t i = 0; i < sizeof command / sizeof *command; i++) {
    cli_good (check_text ("{ sleep 0.05; pinwheel %s; echo $? >@/status; } | true", command[i]));
    if (strcmp (cli_file ("status"), "141\n") != 0) print_error ("%s: %s", command[i], cli_file ("status"));
    assert_string_equal (cli_file ("status"), "141\n");
  }
  cli_good ("{ pinwheel run ezyroller -o - --json @/pipe.json; echo $? >@/status; } | head -3 | wc -l");
  assert_string_equal (cli_out, "3\n");
  assert_string_equal (cli_file ("status"), "141\n");
  assert_true (cli_says (cli_file ("pipe.json"), "status", "machine"));
}

/* Ctrl-C after any time: files under their own names are whole, and the status is 130 unless all was done. */
TEST (interrupted) {
  for (int i = 0; i + 1 < MACHINE_WRITERS; i++) {
    machine_whole (machine_writers[i]);
    for (int after = 1; after < 100; after = 3 * after + 2) {
      char text[900];
      snprintf (
          text, sizeof text,
          "rm -rf @/o; mkdir @/o; PATH=$PATH:/none timeout --preserve-status -s INT 0.%03d sh -c 'PATH=@; exec " MACHINE
          "%s' >@/log 2>&1",
          after, machine_writers[i]);
      int status = cli_run (text);
      if (status != 0 && status != 130 && status != 124)
        print_error ("%s: %d: %s", machine_writers[i], status, cli_file ("log"));
      assert_true (status == 0 || status == 130);
      machine_check_whole (machine_writers[i]);
    }
  }
}

/* ---- Programs that are missing or fail ---- */

TEST (no_compiler) {
  cli_good ("pinwheel new @/own.c >@/log");
  assert_int_equal (cli_run ("unset CC; PATH=/none pinwheel run @/own.c"), 2);
  assert_non_null (strstr (cli_err, "cannot run the C compiler \"cc\" that the file "));
}

/* A parent that ignores SIGCHLD leaves no exit status of the children. */
TEST (ignored_children) {
  cli_good ("mkdir -p @/fine; printf '#!/bin/sh\n' >@/fine/gnuplot; chmod +x @/fine/gnuplot; echo 'int x = ;' >@/x.c");
  cli_good ("PATH=@/fine:$PATH env --ignore-signal=CHLD \"${PINWHEEL:-build/pinwheel}\" run ezyroller -t 1 --plots @/p "
            ">@/log");
  assert_int_equal (cli_run ("env --ignore-signal=CHLD \"${PINWHEEL:-build/pinwheel}\" run @/x.c"), 2);
  assert_non_null (strstr (cli_err, "x.c does not compile"));
  pw_error error = { 0 };
  signal (SIGCHLD, SIG_IGN);
  pw_file *file = pw_file_open (cli_path ("x.c"), &error);
  signal (SIGCHLD, SIG_DFL);
  assert_null (file);
  assert_int_equal (error.status, PW_INPUT);
  assert_non_null (strstr (error.text, "x.c does not compile"));
}

TEST (gnuplot) {
  const struct {
    const char *program, *message;
    int status;
  } each[] = {
    { "rm -f @/bin/gnuplot", "gnuplot was not found, so no figures are drawn; data and scripts are in @/p", 0 },
    { "printf '#!/bin/sh\\nexit 3\\n' >@/bin/gnuplot", "gnuplot failed with exit status 3; ", 1 },
    { "printf '#!/bin/sh\\n>@/p/paths.svg; kill -9 $$\\n' >@/bin/gnuplot", "gnuplot was ended by signal 9; ", 1 },
    { "echo >@/bin/gnuplot; chmod a-x @/bin/gnuplot", "cannot run gnuplot: ", 1 },
  };
  for (size_t i = 0; i < sizeof each / sizeof *each; i++) {
    char message[300];
    int status = cli_run (
        check_text ("rm -rf @/bin @/p; mkdir -p @/bin @/p; echo old >@/p/paths.svg; touch @/bin/gnuplot; chmod +x "
                    "@/bin/gnuplot\n%s\n"
                    "PATH=@/bin pinwheel run ezyroller --t-end 1 --plots @/p >@/log",
                    each[i].program));
    cli_expand (each[i].message, message, sizeof message);
    if (strstr (cli_err, message) == NULL) print_error ("%s: %s", each[i].program, cli_err);
    assert_non_null (strstr (cli_err, message));
    assert_int_equal (status, each[i].status);
    cli_good ("test -s @/p/motion.dat; ls @/p | grep -c 'part$\\|svg$\\|png$' || true");
    assert_string_equal (cli_out, "0\n"); /* neither an old figure nor half a new one */
  }
}

/* ---- Names ---- */

TEST (names) {
  cli_good (
      "mkdir -p '@/ein Ordner/größer & \"so\"'; cp tests/models/arm.yaml '@/ein Ordner/größer & \"so\"/der Arm.yaml'");
  cli_run (
      "p=$PWD/; case $PINWHEEL in /*) p= ;; esac; p=$p${PINWHEEL:-build/pinwheel}\n"
      "cd '@/ein Ordner/größer & \"so\"'\n"
      "\"$p\" new own.c >log 2>err || cat err; mv own.c 'mein Ä.c'\n"
      "for m in './der Arm.yaml' './mein Ä.c' ezyroller; do for c in --checkpoint --resume; do\n"
      "  \"$p\" run \"$m\" --t-end 0.2 -o 'Tabelle ü.csv' --json 'Daten é.json' $c 'Stand 1' >log 2>err || cat err\n"
      "done; done\n"
      "\"$p\" sweep ezyroller --vary a=0.5,0.6 --t-end 0.1 -o 'Reihe ö.csv' >log 2>err || cat err\n"
      "PATH=/none \"$p\" run ezyroller --t-end 0.2 --plots 'Bilder (1)' >log 2>err || cat err\n"
      "ls -d 'Tabelle ü.csv' 'Daten é.json' 'Stand 1' 'Reihe ö.csv' 'Bilder (1)/motion.dat' | wc -l");
  assert_string_equal (cli_out, "5\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
