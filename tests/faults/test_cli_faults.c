/* Every allocation of a command, and every call of its that has to do with files, is made to fail in turn: an error in
 * words and status 1, nothing left behind in memory, no file that looks whole and is not.
 *
 * The commands are called from inside; linked with --wrap for the functions of calls.c and alloc.c. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "alloc.h"
#include "calls.h"
#include "check.h"
#include "cli.h"
#include "faults.h"

static int faults_bad; /* calls after whose failure something was not as it should be */

static int faults_pair; /* 1: the command writes a table and a summary */

static int faults_exists (const char *name) {
  return access (cli_path (name), F_OK) == 0;
}

/* The command once more with one call failing; 1 if it came so far. */
static int faults_try (const char *command, long *count, long *fail, long n) {
  int free_fd = dup (0);
  close (free_fd);
  faults_prepare ();
  call.name = "allocation";
  call.folder_due = 0;
  call.reading = 0;
  call.count = alloc.count = 0;
  *fail = n;
  int status = faults_run (command), reached = *count >= n;
  *fail = 0;
  const char *said = cli_file ("log"), *broken = faults_broken ();
  int good = !reached ? status == 0 : (status == 1 || (call.reading && status == 2)) && strstr (said, "pinwheel: ");
  if (faults_exists ("o/a.csv") != faults_exists ("o/a.json") && faults_pair) broken = "one of a.csv and a.json";
  if (good && reached && fail == &alloc.fail) good = strstr (said, "out of memory") || strstr (said, strerror (ENOMEM));
  int fd = dup (0);
  close (fd);
  if (!reached && call.folder_due) broken = "the folder, which is not on the disk";
  if (good && !broken && alloc.live == 0 && fd == free_fd) return reached;
  print_error ("%s: %s %ld: status %d, %d blocks and %d files left open, not whole: %s\n%s", command, call.name, n,
               status, alloc.live, fd - free_fd, broken ? broken : "none", said);
  faults_bad++;
  alloc.live = 0;
  return reached;
}

static int faults_most; /* so many calls fail one after the other, then some of the rest */

static long faults_next (long n) {
  return n + (n < faults_most ? 1 : n / 4);
}

static void faults_each (const char *command) {
  long n = 1;
  faults_bad = call.unsynced = 0;
  while (faults_try (command, &call.count, &call.fail, n)) n = faults_next (n);
  long m = 1;
  while (faults_try (command, &alloc.count, &alloc.fail, m)) m = faults_next (m);
  print_message ("%s: %ld calls, %ld allocations\n", command, n, m);
  assert_int_equal (faults_bad + call.unsynced, 0);
}

static void faults_from (const char *start, const char *command) {
  faults_begin (start, command);
  faults_pair = strstr (command, " -o ") && strstr (command, " --json ");
  faults_each (command);
}

/* ---- Tests ---- */

TEST (run) {
  faults_most = 200;
  faults_from (":", "run ezyroller --t-end 0.02 -o @/o/a.csv --json @/o/a.json");
  mode_t before = umask (027); /* the file that is replaced has another mode than a new one */
  faults_from ("cp @/whole/a.csv @/start/a.csv", "run ezyroller --t-end 0.02 -o @/o/a.csv");
  umask (before);
  faults_from ("cp @/whole/a.csv @/truth.csv", "run ezyroller --t-end 0.02 --reference @/truth.csv");
}

#define FAULTS_RUN "run ezyroller --t-end 0.01 --step 0.001 --checkpoint-every 0.005 -o @/o/a.csv "

TEST (checkpoint) {
  faults_most = 200;
  faults_from (":", FAULTS_RUN "--checkpoint @/o/a.ck");
  faults_from ("cp @/whole/a.csv @/start/a.csv.part && cp @/whole/a.ck @/start", FAULTS_RUN "--resume @/o/a.ck");
}

TEST (plots) {
  faults_most = 30;
  faults_from (":", "run pendulum --t-end 0.01 --plots @/o --animate @/o/a.html");
}

TEST (sweep) {
  faults_most = 200;
#define FAULTS_SWEEP "sweep ezyroller --vary a=0.5,0.6 --t-end 0.01 --step 0.01 --jobs 1 -o @/o/a.csv"
  faults_from (":", FAULTS_SWEEP);
  faults_from (":", FAULTS_SWEEP " --part 1/2");
  faults_from ("cp @/whole/a.csv @/first.csv", FAULTS_SWEEP " --part 2/2");
  faults_from ("cp @/whole/a.csv @/second.csv", "sweep --merge @/first.csv @/second.csv -o @/o/a.csv");
}

TEST (drift) {
  faults_most = 30;
  faults_from (":", "drift ezyroller --t-end 0.1 --methods rk4+none --only-methods --plots @/o");
  faults_from (":", "steady n-trailer --starts 0 -o @/o/steady.csv --json @/o/steady.json --plots @/o");
}

TEST (reading) {
  faults_most = 100;
  cli_good ("pinwheel new @/own.c >@/new.txt");
  faults_from (":", "new @/o/mine.yaml");
  faults_from (":", "show tests/models/arm.yaml");
  faults_from (":", "show --yaml pendulum");
  faults_from (":", "show pendulum --matrices");
  faults_from (":", "show @/own.c");
  faults_most = 20;
  faults_from (":", "check pendulum --json @/o/a.json");
  faults_from (":", "linearise ezyroller --at 0.1 -o @/o/a");
}

/* The file that was opened is another process's complete one by the time it is locked: it is left alone. */
TEST (race) {
  char part[300], away[300];
  faults_begin (":", "run ezyroller --t-end 0.02 -o @/o/a.csv");
  faults_prepare ();
  cli_expand ("@/o/a.csv.part", part, sizeof part);
  cli_expand ("@/o/b.csv", away, sizeof away);
  call.moved = part;
  call.away = away;
  assert_int_equal (faults_run ("run ezyroller --t-end 0.02 -o @/o/a.csv"), 0);
  cli_good ("cmp @/o/a.csv @/whole/a.csv && [ ! -s @/o/b.csv ]");
}

const check_fixture fixture = { faults_setup, cli_teardown };
