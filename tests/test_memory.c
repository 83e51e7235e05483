/* Every allocation of the process is made to fail in turn, those of the libraries below Pinwheel and of the C library among
 * them: an error in words and status 1, or, if it could be done without, the whole result; no file that looks whole and is
 * not.
 *
 * malloc, calloc and realloc of this program are those that all of its libraries use.  Each attempt is a process of its own,
 * so that a crash is one attempt that failed.  What crashes inside a library is listed here, and in docs/manual.md. */
#define _GNU_SOURCE /* dladdr */
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>
#include "alloc.h"
#include "check.h"
#include "cli.h"
#include "faults.h"

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__ || !defined __GLIBC__
#define MEMORY_OF_OTHERS 1 /* the sanitizer has its own malloc */
#elif defined __has_feature
#if __has_feature(address_sanitizer)
#define MEMORY_OF_OTHERS 1
#endif
#endif

enum { MEMORY_FRAMES = 40 };

/* What a process of an attempt and the one that watches it both see. */
typedef struct {
  long count;                  /* allocations so far */
  long fail;                   /* the one that fails; 0: none */
  int frames;                  /* who asked for it */
  void *frame[MEMORY_FRAMES];  /* return addresses, the innermost first */
  int live;                    /* blocks of Pinwheel's own that were left behind */
  int status;                  /* of the command */
} memory_state;

static memory_state *memory;

/* ---- Allocations ---- */

#ifndef MEMORY_OF_OTHERS

void *__libc_malloc (size_t size);
void *__libc_calloc (size_t count, size_t size);
void *__libc_realloc (void *old, size_t size);

static int memory_fails (void) {
  if (memory == NULL || memory->fail == 0 || ++memory->count != memory->fail) return 0;
  memory->frames = backtrace (memory->frame, MEMORY_FRAMES);
  errno = ENOMEM;
  return 1;
}

void *malloc (size_t size) {
  return memory_fails () ? NULL : __libc_malloc (size);
}

void *calloc (size_t count, size_t size) {
  return memory_fails () ? NULL : __libc_calloc (count, size);
}

void *realloc (void *old, size_t size) {
  return memory_fails () ? NULL : __libc_realloc (old, size);
}

#endif

/* ---- Attempts ---- */

static int memory_run (const char *command, long fail) {
  faults_prepare ();
  memory->count = memory->frames = 0;
  memory->live = 0;
  memory->status = -1;
  fflush (NULL);
  pid_t child = fork ();
  assert_true (child >= 0);
  if (child == 0) {
    alarm (100);
    for (int i = 1; i < 16; i++) if (i != SIGALRM && i != SIGKILL) signal (i, SIG_DFL);
    memory->fail = fail;
    memory->status = faults_run (command);
    memory->fail = 0;
    memory->live = alloc.live;
    _exit (0);
  }
  int how = 0;
  waitpid (child, &how, 0);
  return how;
}

static void memory_show (void) {
  print_error (" SIG");
  for (int i = 1; i < memory->frames; i++) {
    Dl_info d;
    if (dladdr (memory->frame[i], &d) == 0) continue;
    const char *s = strrchr (d.dli_fname, '/');
    if (d.dli_sname && strcmp (d.dli_sname, "faults_run") == 0) break;
    print_error (" %s:%s", s ? s + 1 : d.dli_fname, d.dli_sname ? d.dli_sname : "?");
  }
  print_error ("\n");
}

static void memory_each (const char *start, const char *command) {
  faults_begin (start, command);
  int bad = 0;
  long n = 1;
  for (;; n++) {
    int how = memory_run (command, n);
    if (memory->count < n) break;
    const char *said = cli_file ("log"), *broken = faults_broken ();
    int good = (how == 256 && strstr (said, "virtual memory exhausted")) || how == 0 && (memory->status == 0 || (memory->status == 1 && strstr (said, "pinwheel: ") && (strstr (said, "out of memory") || strstr (said, strerror (ENOMEM)))));
    if (good && !broken && memory->live == 0) continue;
    print_error ("%s: allocation %ld: how %d status %d, %d left, not whole %s\n%s", command, n, how, memory->status, memory->live, broken ? broken : "none", strlen (said) > 300 ? "" : said);
    memory_show ();
    bad++;
  }
  print_message ("%s: %ld allocations, %d bad\n", command, n, bad);
}

static void test_all (void **state) {
  (void)state;
  const char *e = getenv ("MEMORY");
  if (e) { memory_each (":", e); return; }
  memory_each (":", "list kinds");
  memory_each (":", "new @/o/mine.yaml");
  memory_each (":", "show tests/models/arm.yaml");
  memory_each (":", "show --yaml pendulum");
  memory_each (":", "check pendulum --json @/o/a.json");
  memory_each (":", "run tests/models/signals.yaml --t-end 0.02 -o @/o/a.csv --json @/o/a.json");
  memory_each (":", "run ezyroller --t-end 0.02 -o @/o/a.csv --json @/o/a.json");
  memory_each (":", "sweep ezyroller --vary a=0.5,0.6 --t-end 0.01 --step 0.01 --jobs 1 -o @/o/a.csv");
  memory_each (":", "drift ezyroller --t-end 0.1 --methods rk4+none --only-methods -o @/o");
  memory_each (":", "compare ezyroller --t-end 0.5 --methods rk4 --limit 5 --step-ladder 0.1:0.05 -o @/o");
}

int main (void) {
  void *frame[4];
  backtrace (frame, 4); /* loads what it needs */
  memory = mmap (NULL, sizeof *memory, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  const struct CMUnitTest tests[] = { cmocka_unit_test (test_all) };
  return memory == MAP_FAILED ? 1 : cmocka_run_group_tests (tests, faults_setup, cli_teardown);
}
