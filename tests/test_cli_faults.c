/* Every allocation of a command, and every call of its that has to do with files, is made to fail in turn: an error in words
 * and status 1, nothing left behind in memory, no file that looks whole and is not.
 *
 * The commands are called from inside; linked with --wrap for the functions below and those of alloc.c. */
#define _XOPEN_SOURCE 700
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "alloc.h"
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"
#include "../core/cli/cli.h"
#include "../core/cli/stop.h"

static struct {
  long count;       /* calls so far */
  long fail;        /* the one that fails; 0: none */
  const char *name; /* of that */
  int reading;      /* 1: it was to read, and what cannot be read is wrong input */
  int synced;       /* 1: the file opened last has been brought to the disk */
} call;

static int faults_bad; /* calls after whose failure something was not as it should be */

static int call_fails (const char *name, int reading) {
  if (call.fail == 0 || ++call.count != call.fail) return 0;
  call.name = name;
  call.reading = reading;
  return 1;
}

/* ---- Calls that fail ---- */

#define CALL(failed, why, type, name, parameters, arguments)                                 \
  type __real_##name parameters;                                                             \
  type __wrap_##name parameters;                                                             \
  type __wrap_##name parameters {                                                            \
    return call_fails (#name, why == EIO) ? (errno = why, failed) : __real_##name arguments; \
  }

CALL (-1, ENOSPC, int, ftruncate, (int fd, off_t size), (fd, size))
CALL (-1, ENOSPC, ssize_t, pwrite, (int fd, const void *p, size_t size, off_t at), (fd, p, size, at))
CALL (-1, EROFS, int, mkdir, (const char *path, mode_t mode), (path, mode))
CALL (EMFILE, EMFILE, int, posix_spawn_file_actions_init, (posix_spawn_file_actions_t * a), (a))
CALL (EMFILE, EMFILE, int, posix_spawn_file_actions_addopen,
      (posix_spawn_file_actions_t * a, int fd, const char *path, int flags, mode_t mode), (a, fd, path, flags, mode))
CALL (EMFILE, EMFILE, int, posix_spawn_file_actions_adddup2, (posix_spawn_file_actions_t * a, int from, int to),
      (a, from, to))
CALL (EAGAIN, EAGAIN, int, posix_spawnp,
      (pid_t * child, const char *file, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *with,
       char *const argv[], char *const environment[]),
      (child, file, actions, with, argv, environment))
CALL (NULL, ENOMEM, char *, realpath, (const char *path, char *where), (path, where))
CALL (NULL, EMFILE, DIR *, opendir, (const char *path), (path))
CALL (-1, EIO, int, fseek, (FILE * f, long at, int from), (f, at, from))
CALL (-1, EIO, long, ftell, (FILE * f), (f))
CALL (-1, EIO, int, fseeko, (FILE * f, off_t at, int from), (f, at, from))

static int call_is (FILE *f, int mode) {
  return (fcntl (fileno (f), F_GETFL) & O_ACCMODE) == mode;
}

/* A file with something in it: closing an empty one brings nothing to the disk. */
static int call_is_written (FILE *f) {
  return f != stdout && f != stderr && !call_is (f, O_RDONLY) && ftello (f) > 0;
}

FILE *__real_fopen (const char *path, const char *mode);
FILE *__wrap_fopen (const char *path, const char *mode);
FILE *__wrap_fopen (const char *path, const char *mode) {
  if (*mode == 'w') call.synced = 0;
  if (!call_fails ("fopen", *mode == 'r')) return __real_fopen (path, mode);
  errno = EMFILE;
  return NULL;
}

int __real_fclose (FILE *f);
int __wrap_fclose (FILE *f);
int __wrap_fclose (FILE *f) {
  int fails = call_is_written (f) && call_fails ("fclose", 0), status = __real_fclose (f);
  if (fails) errno = EDQUOT;
  return fails ? EOF : status;
}

int __real_fflush (FILE *f);
int __wrap_fflush (FILE *f);
int __wrap_fflush (FILE *f) {
  if (f == NULL || !call_is_written (f) || !call_fails ("fflush", 0)) return __real_fflush (f);
  errno = ENOSPC;
  return EOF;
}

/* From here on the disk is full. */
size_t __real_fwrite (const void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fwrite (const void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fwrite (const void *p, size_t size, size_t count, FILE *f) {
  if (f == stdout || f == stderr || !call_fails ("fwrite", 0)) return __real_fwrite (p, size, count, f);
  int full = open ("/dev/full", O_WRONLY);
  assert_true (full >= 0 && dup2 (full, fileno (f)) >= 0);
  close (full);
  __real_fwrite (p, size, count, f);
  __real_fflush (f);
  errno = ENOSPC;
  return 0;
}

/* A stream that is only read remembers the failure if it is written to. */
static void call_spoil (FILE *f) {
  if (call_is (f, O_RDONLY)) fputc (' ', f);
  errno = EIO;
}

size_t __real_fread (void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fread (void *p, size_t size, size_t count, FILE *f);
size_t __wrap_fread (void *p, size_t size, size_t count, FILE *f) {
  if (!call_fails ("fread", 1)) return __real_fread (p, size, count, f);
  call_spoil (f);
  return 0;
}

ssize_t __real_getline (char **line, size_t *room, FILE *f);
ssize_t __wrap_getline (char **line, size_t *room, FILE *f);
ssize_t __wrap_getline (char **line, size_t *room, FILE *f) {
  if (!call_fails ("getline", 1)) return __real_getline (line, room, f);
  call_spoil (f);
  return -1;
}

/* A checkpoint is on the disk before it takes the place of the one before it. */
int __real_rename (const char *from, const char *to);
int __wrap_rename (const char *from, const char *to);
int __wrap_rename (const char *from, const char *to) {
  size_t n = strlen (to);
  if (!call.synced && n > 3 && strcmp (to + n - 3, ".ck") == 0) faults_bad++;
  if (!call_fails ("rename", 0)) return __real_rename (from, to);
  errno = EROFS;
  return -1;
}

/* A folder need not take it. */
int __real_fsync (int fd);
int __wrap_fsync (int fd);
int __wrap_fsync (int fd) {
  struct stat info;
  call.synced = 1;
  if ((fstat (fd, &info) == 0 && S_ISDIR (info.st_mode)) || !call_fails ("fsync", 0)) return __real_fsync (fd);
  errno = EIO;
  return -1;
}

/* ---- Files ---- */

static size_t faults_slurp (const char *folder, const char *name, char *text, size_t room) {
  char path[600];
  snprintf (path, sizeof path, "%s/%s", folder, name);
  FILE *f = fopen (path, "rb");
  if (f == NULL) return room; /* as no file has it */
  size_t size = fread (text, 1, room - 1, f);
  text[size] = 0;
  fclose (f);
  return size;
}

static int faults_ends (const char *text, const char *end) {
  size_t n = strlen (text), m = strlen (end);
  return n >= m && strcmp (text + n - m, end) == 0;
}

static int faults_lines (const char *text) {
  int n = 0;
  while ((text = strchr (text, '\n')) != NULL) text++, n++;
  return n;
}

/* 1 if a file of @/o is whole by what it holds, or has as many lines as the one in @/whole; times make others differ. */
static int faults_whole (const char *o, const char *whole, const char *name) {
  static char text[1 << 20], same[1 << 20];
  char path[600];
  pw_checkpoint c;
  size_t size = faults_slurp (o, name, text, sizeof text);
  if (faults_ends (name, ".part")) return 1;
  if (faults_ends (name, ".json")) return faults_ends (text, "\n}\n");
  if (faults_ends (name, ".html")) return faults_ends (text, "</html>\n");
  if (faults_ends (name, ".dat") && strncmp (text, "# incomplete: ", 14) == 0) return 1;
  if (!faults_ends (name, ".ck"))
    return faults_slurp (whole, name, same, sizeof same) > 0 && faults_lines (text) == faults_lines (same) &&
           text[size - 1] == '\n';
  snprintf (path, sizeof path, "%s/%s", o, name);
  int status = pw_checkpoint_read (path, &c, &(pw_error){ 0 });
  pw_checkpoint_free (&c);
  return status == PW_OK;
}

/* The first file of @/o that looks whole and is not, or NULL. */
static const char *faults_broken (void) {
  static char name[300];
  char o[300], whole[300];
  const char *broken = NULL;
  snprintf (o, sizeof o, "%s/o", cli_folder);
  snprintf (whole, sizeof whole, "%s/whole", cli_folder);
  DIR *d = opendir (o);
  for (const struct dirent *e; d && (e = readdir (d)) != NULL;) {
    if (*e->d_name == '.' || broken) continue;
    if (faults_whole (o, whole, e->d_name)) continue;
    snprintf (name, sizeof name, "%s", e->d_name);
    broken = name;
  }
  if (d) closedir (d);
  return broken;
}

static void faults_empty (const char *folder) {
  char path[600];
  DIR *d = opendir (folder);
  for (const struct dirent *e; d && (e = readdir (d)) != NULL;) {
    if (*e->d_name == '.') continue;
    snprintf (path, sizeof path, "%s/%s", folder, e->d_name);
    remove (path);
  }
  if (d) closedir (d);
}

/* @/o as it was before the command: what is in @/start. */
static void faults_prepare (void) {
  static char text[1 << 20];
  char o[300], start[300], path[600];
  snprintf (o, sizeof o, "%s/o", cli_folder);
  snprintf (start, sizeof start, "%s/start", cli_folder);
  faults_empty (o);
  DIR *d = opendir (start);
  for (const struct dirent *e; d && (e = readdir (d)) != NULL;) {
    if (*e->d_name == '.') continue;
    size_t size = faults_slurp (start, e->d_name, text, sizeof text);
    snprintf (path, sizeof path, "%s/%s", o, e->d_name);
    FILE *f = fopen (path, "wb");
    assert_true (f && fwrite (text, 1, size, f) == size && fclose (f) == 0);
  }
  if (d) closedir (d);
}

/* ---- Commands ---- */

typedef int faults_function (int argc, const char **argv);

static faults_function *faults_command (const char *name) {
  static const struct {
    const char *name;
    faults_function *function;
  } each[] = { { "run", pw_cli_run },     { "sweep", pw_cli_sweep }, { "compare", pw_cli_compare },
               { "drift", pw_cli_drift }, { "new", pw_cli_new },     { "show", pw_cli_show },
               { "check", pw_cli_check }, { "list", pw_cli_list } };
  for (size_t i = 0; i < sizeof each / sizeof *each; i++)
    if (strcmp (name, each[i].name) == 0) return each[i].function;
  return NULL;
}

/* Runs a command as far as it gets, with what it prints in @/log; its status. */
static int faults_run (const char *command) {
  char text[1000], path[300], *rest;
  const char *argv[40];
  int argc = 0;
  cli_expand (command, text, sizeof text);
  for (char *w = strtok_r (text, " ", &rest); w; w = strtok_r (NULL, " ", &rest)) argv[argc++] = w;
  argv[argc] = NULL;
  snprintf (path, sizeof path, "%s/log", cli_folder);
  __real_fflush (NULL);
  int out = dup (1), err = dup (2), log = open (path, O_WRONLY | O_CREAT | O_TRUNC, 0666),
      null = open ("/dev/null", O_WRONLY);
  dup2 (null, 1);
  dup2 (log, 2);
  pw_stop = 0;
  call.count = alloc.count = 0;
  int status = faults_command (argv[0]) (argc, argv);
  __real_fflush (NULL);
  dup2 (out, 1);
  dup2 (err, 2);
  close (out);
  close (err);
  close (null);
  close (log);
  return status;
}

/* The command once more with one call failing; 1 if it came so far. */
static int faults_try (const char *command, long *count, long *fail, long n) {
  int free_fd = dup (0);
  close (free_fd);
  faults_prepare ();
  call.name = "allocation";
  call.reading = 0;
  *fail = n;
  int status = faults_run (command), reached = *count >= n;
  *fail = 0;
  const char *said = cli_file ("log"), *broken = faults_broken ();
  int good = !reached ? status == 0 : (status == 1 || (call.reading && status == 2)) && strstr (said, "pinwheel: ");
  if (good && reached && fail == &alloc.fail) good = strstr (said, "out of memory") || strstr (said, strerror (ENOMEM));
  int fd = dup (0);
  close (fd);
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
  faults_bad = 0;
  while (faults_try (command, &call.count, &call.fail, n)) n = faults_next (n);
  long m = 1;
  while (faults_try (command, &alloc.count, &alloc.fail, m)) m = faults_next (m);
  print_message ("%s: %ld calls, %ld allocations\n", command, n, m);
  assert_int_equal (faults_bad, 0);
}

/* What the command leaves when nothing fails, in @/whole; before it there is what `start` puts into @/start. */
static void faults_from (const char *start, const char *command) {
  char text[1500];
  snprintf (text, sizeof text, "rm -rf @/o @/start; mkdir -p @/o @/start; %s; rm -rf @/whole", start);
  cli_good (text);
  faults_prepare ();
  int status = faults_run (command);
  if (status != 0) print_error ("%s: %s", command, cli_file ("log"));
  assert_int_equal (status, 0);
  cli_good ("cp -r @/o @/whole");
  faults_each (command);
}

/* ---- Tests ---- */

static void test_run (void **state) {
  (void)state;
  faults_most = 200;
  faults_from (":", "run ezyroller --t-end 0.02 -o @/o/a.csv --json @/o/a.json");
  faults_from ("cp @/whole/a.csv @/truth.csv", "run ezyroller --t-end 0.02 --truth @/truth.csv");
}

#define FAULTS_RUN "run ezyroller --t-end 0.01 --step 0.001 --checkpoint-every 0.005 -o @/o/a.csv "

static void test_checkpoint (void **state) {
  (void)state;
  faults_most = 200;
  faults_from (":", FAULTS_RUN "--checkpoint @/o/a.ck");
  faults_from ("cp @/whole/a.csv @/start/a.csv.part && cp @/whole/a.ck @/start", FAULTS_RUN "--resume @/o/a.ck");
}

static void test_plots (void **state) {
  (void)state;
  faults_most = 30;
  faults_from (":", "run pendulum --t-end 0.01 --plots @/o --animate @/o/a.html");
  faults_from (":", "run pendulum --t-end 0.01 --step 0.01 --animate @/o/a.gif");
}

static void test_sweep (void **state) {
  (void)state;
  faults_most = 200;
#define FAULTS_SWEEP "sweep ezyroller --vary a=0.5,0.6 --t-end 0.01 --step 0.01 --jobs 1 -o @/o/a.csv"
  faults_from (":", FAULTS_SWEEP);
  faults_from (":", FAULTS_SWEEP " --part 1/2");
  faults_from ("cp @/whole/a.csv @/first.csv", FAULTS_SWEEP " --part 2/2");
  faults_from ("cp @/whole/a.csv @/second.csv", "sweep --merge @/first.csv @/second.csv -o @/o/a.csv");
}

static void test_drift (void **state) {
  (void)state;
  faults_most = 30;
  faults_from (":", "drift ezyroller --t-end 0.1 --methods rk4+none --only-methods -o @/o");
}

static void test_reading (void **state) {
  (void)state;
  faults_most = 100;
  cli_good ("pinwheel new @/own.c >@/new.txt");
  faults_from (":", "new @/o/mine.yaml");
  faults_from (":", "show tests/models/arm.yaml");
  faults_from (":", "show --yaml pendulum");
  faults_from (":", "show pendulum --matrices");
  faults_from (":", "show @/own.c");
  faults_most = 20;
  faults_from (":", "check pendulum --json @/o/a.json");
}

/* Programs that the commands ask for, at no cost: gnuplot draws nothing, the compiler has compiled the EzyRoller. */
static int faults_setup (void **state) {
  static const char gnuplot[] = "#!/bin/sh\nf=${3#cd ?}\necho frames >\"${f%?}/animation.gif\"\n",
                    compiler[] = "#!/bin/sh\nwhile [ \"$1\" != -o ]; do shift; done\n/bin/cp \"$MODEL\" \"$2\"\n";
  char text[400];
  const char *build = getenv ("BUILD");
  if (cli_setup (state) != 0) return -1;
  cli_write ("gnuplot", gnuplot);
  cli_write ("cc", compiler);
  cli_run ("chmod +x @/gnuplot @/cc");
  cli_expand ("@/cc", text, sizeof text);
  setenv ("CC", text, 1);
  snprintf (text, sizeof text, "%s/models/ezyroller.so", build ? build : "build");
  setenv ("MODEL", text, 1);
  snprintf (text, sizeof text, "%s:%s", cli_folder, getenv ("PATH"));
  return setenv ("PATH", text, 1);
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_run),   cmocka_unit_test (test_checkpoint), cmocka_unit_test (test_plots),
    cmocka_unit_test (test_sweep), cmocka_unit_test (test_drift),      cmocka_unit_test (test_reading),
  };
  return cmocka_run_group_tests (tests, faults_setup, cli_teardown);
}
