/* Every allocation of the process is refused in turn, those of the libraries below Pinwheel and of the C library among
 * them: an error in words and status 1, or the whole result if it could be done without; no file that looks whole and
 * is not.  Then there is only so much memory, less and less: the same.
 *
 * malloc, calloc, realloc and free of this program are those that all of its libraries use.  Each attempt is a process
 * of its own, so that a crash is one attempt that failed.  Here some allocations are left out; slow_memory.c has all
 * of them. */
#define _GNU_SOURCE /* dladdr */
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <malloc.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include "alloc.h"
#include "check.h"
#include "cli.h"
#include "faults.h"

#ifndef MEMORY_STRIDE
#define MEMORY_STRIDE 23 /* from one allocation to the next, after the first ones */
#endif

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__ || !defined __GLIBC__
#define MEMORY_OF_OTHERS 1 /* a sanitizer has its own malloc */
#elif defined __has_feature
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define MEMORY_OF_OTHERS 1
#endif
#endif

enum { MEMORY_FRAMES = 40, MEMORY_SAID = 200000 };

/* What the process of an attempt and the one that watches it both see. */
static struct memory_state {
  long count;                 /* allocations so far */
  long fail;                  /* the one that is refused; 0: none */
  long live, limit;           /* bytes in use, and how many there may be; 0: any number */
  int refused;                /* so many */
  int frames;                 /* who asked for the first of them */
  void *frame[MEMORY_FRAMES]; /* return addresses, the innermost first */
  int status;                 /* of the command; -1 as long as it runs */
  int left;                   /* blocks of Pinwheel's own that were not released */
} * memory;

/* ---- Allocations ---- */

#ifndef MEMORY_OF_OTHERS

void *__libc_malloc (size_t size);
void *__libc_calloc (size_t count, size_t size);
void *__libc_realloc (void *old, size_t size);
void __libc_free (void *p);

static int memory_refuses (size_t size) {
  if (memory == NULL || (memory->fail == 0 && memory->limit == 0)) return 0;
  if (++memory->count != memory->fail && (memory->limit == 0 || memory->live + (long)size <= memory->limit)) return 0;
  if (memory->refused++ == 0) memory->frames = backtrace (memory->frame, MEMORY_FRAMES);
  errno = ENOMEM;
  return 1;
}

static void *memory_keep (void *p) {
  if (memory) memory->live += (long)malloc_usable_size (p);
  return p;
}

static void memory_drop (void *p) {
  if (memory) memory->live -= (long)malloc_usable_size (p);
}

void *malloc (size_t size) {
  return memory_refuses (size) ? NULL : memory_keep (__libc_malloc (size));
}

void *calloc (size_t count, size_t size) {
  return memory_refuses (count * size) ? NULL : memory_keep (__libc_calloc (count, size));
}

void *realloc (void *old, size_t size) {
  if (memory_refuses (size)) return NULL;
  memory_drop (old);
  return memory_keep (__libc_realloc (old, size));
}

void free (void *p) {
  memory_drop (p);
  __libc_free (p);
}

#endif

/* ---- What may happen ---- */

/* Calls of libraries that crash when they are refused memory.  Each is made only when there is enough
 * (pw_check_memory), so that they crash if one allocation fails where the memory is not exhausted, as here;
 * docs/design.md lists them. */
static int memory_is_fenced (const char *function) {
  static const char *const fenced[] = { "fy_parser_set_input_callback", "SUNContext_Create", "N_VClone", "CVodeInit" };
  for (size_t i = 0; i < sizeof fenced / sizeof *fenced; i++)
    if (strcmp (function, fenced[i]) == 0) return 1;
  return 0;
}

/* 1 if the first allocation that was refused is one of a fenced call; with `shown`, says whose it was. */
static int memory_fenced (int shown) {
  int fenced = 0;
  for (int i = 1; i < memory->frames; i++) {
    Dl_info d;
    if (dladdr (memory->frame[i], &d) == 0 || d.dli_sname == NULL) continue;
    fenced |= memory_is_fenced (d.dli_sname);
    if (shown) print_error ("    %s\n", d.dli_sname);
  }
  return fenced;
}

/* popt ends the program by itself, with status 1. */
static int memory_ended (int how, const char *said) {
  return WIFEXITED (how) && WEXITSTATUS (how) == 1 && strcmp (said, "virtual memory exhausted.\n") == 0;
}

static int memory_told (const char *said) {
  return memory->status == 1 && strstr (said, "pinwheel: ") &&
         (strstr (said, "out of memory") || strstr (said, strerror (ENOMEM)));
}

/* ---- Attempts ---- */

static int memory_run (const char *command, long fail, long limit) {
  faults_prepare ();
  *memory = (struct memory_state){ .status = -1 };
  fflush (NULL);
  pid_t child = fork ();
  assert_true (child >= 0);
  if (child == 0) {
    for (const int *s = (int[]){ SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGALRM, SIGTERM, 0 }; *s; s++) signal (*s, SIG_DFL);
    alarm (300);
    memory->limit = limit;
    memory->fail = fail;
    int status = faults_run (command);
    memory->fail = memory->limit = 0;
    memory->left = alloc.live;
    memory->status = status;
    _exit (0);
  }
  int how = 0;
  assert_true (waitpid (child, &how, 0) == child);
  memory->fail = memory->limit = 0; /* popt may have ended the child before it did that */
  return how;
}

/* What is to be the same to the byte: the table of a run, or what is printed. */
static int memory_keeps (char *text) {
  const char *now = cli_file ("o/a.csv");
  if (now == NULL) now = cli_file ("printed");
  int same = now && strcmp (now, text) == 0;
  if (now && *text == 0) snprintf (text, MEMORY_SAID, "%s", now);
  return same;
}

/* One attempt; 1 if an allocation was refused. */
static int memory_try (const char *command, long fail, long limit, char *whole, int *bad) {
  int how = memory_run (command, fail, limit);
  const char *broken = faults_broken ();
  int same = whole == NULL || memory->status != 0 || memory_keeps (whole);
  const char *said = cli_file ("log");
  int good = memory->status == 0 || memory_told (said) || memory_ended (how, said) ||
             (limit == 0 && WIFSIGNALED (how) && WTERMSIG (how) != SIGALRM && memory_fenced (0));
  if (good && !broken && same && memory->left == 0) return memory->refused > 0;
  print_error (
      "%s: allocation %ld, limit %ld: wait status %d, status %d, %d blocks left, not whole: %s, the same: %d\n%s",
      command, fail, limit, how, memory->status, memory->left, broken ? broken : "none", same, said);
  memory_fenced (1);
  ++*bad;
  return memory->refused > 0;
}

/* `exact`: 1 if its table, or what it prints without one, is always the same. */
static void memory_each (int exact, const char *command) {
  static char text[MEMORY_SAID];
  char *whole = exact ? text : NULL;
  int bad = 0;
  long n = 1, limit = 1 << 12, attempts = 0;
#ifdef MEMORY_OF_OTHERS
  skip ();
#endif
  faults_begin (":", command);
  *text = 0;
  if (exact) memory_keeps (text);
  for (; memory_try (command, n, 0, whole, &bad); attempts++) n += n < MEMORY_STRIDE ? 1 : MEMORY_STRIDE;
  for (; memory_try (command, 0, limit, whole, &bad); attempts++) limit += limit / 12;
  print_message ("%s: %ld allocations, %ld kB, %ld attempts\n", command, n, limit >> 10, attempts);
  assert_int_equal (bad, 0);
}

/* ---- Tests ---- */

TEST (reading) {
  memory_each (1, "list kinds");
  memory_each (1, "show tests/models/arm.yaml");
  memory_each (1, "show --yaml pendulum");
  memory_each (1, "show --c pendulum");
  memory_each (1, "check pendulum --json @/o/a.json");
  memory_each (1, "linearise n-trailer --at 0.1 -o @/o/a");
  memory_each (1, "linearise car-tyres --animate @/o/a.html");
  cli_run ("pinwheel page pendulum -o @/a.html");
  if (strstr (cli_err, "built without the engine") == NULL) memory_each (1, "page pendulum -o @/o/a.html");
  memory_each (1, "sensitivity pendulum --of bob.x --of max:bob.y --by l --by bob.phi --t-end 0.02 --jobs 1");
  memory_each (1, "new @/o/mine.yaml");
}

TEST (run) {
  memory_each (1, "run ezyroller --t-end 0.02 -o @/o/a.csv --json @/o/a.json");
  memory_each (1, "run tests/models/signals.yaml --t-end 0.02 -o @/o/a.csv --json @/o/a.json");
  memory_each (1, "run ezyroller --method ida+ggl --t-end 0.02 --energy -o @/o/a.csv");
  memory_each (1, "run ezyroller --method bdf+projection --t-end 0.02 --energy -o @/o/a.csv");
}

TEST (studies) {
  memory_each (0, "sweep ezyroller --vary a=0.5,0.6 --t-end 0.01 --step 0.01 --jobs 1 -o @/o/a.csv");
  memory_each (0, "drift ezyroller --t-end 0.1 --methods rk4+none --only-methods --plots @/o");
  memory_each (0, "steady n-trailer --starts 0 -o @/o/steady.csv --json @/o/steady.json --plots @/o");
  memory_each (0, "periodic pendulum --period free -o @/o/periodic.csv --json @/o/periodic.json --plots @/o");
  memory_each (0, "compare pendulum --t-end 0.01 --methods rk4 --step-ladder 0.01:0.005 --plots @/o");
}

/* One job: threads would allocate in any order. */
TEST (searches) {
  cli_write ("d.csv", "t,bob.x,bob.y\n0,0.5,-0.8\n0.01,0.5,-0.79\n0.02,0.49,-0.8\n");
  memory_each (1, "fit pendulum --data @/d.csv --columns bob.x,bob.y --free l=0.5:2 --jobs 1 "
                  "-o @/o/a.csv --json @/o/a.json");
  memory_each (0,
               "optimise pendulum --minimise bob.x --free l=0.5:2 --free m=1:2 --free g=9:10 --starts 1 --t-end 0.01 "
               "--jobs 1 -o @/o/a.yaml --json @/o/a.json");
  memory_each (0, "optimise pendulum --maximise max:bob.x --free l=0.5:2 --subject-to bob.y<=0 --starts 1 --t-end 0.01 "
                  "--jobs 1 -o @/o/a.yaml");
}

static int memory_setup (void) {
#ifndef MEMORY_OF_OTHERS
  void *frame[4];
  backtrace (frame, 4); /* it loads what it needs */
  setrlimit (RLIMIT_CORE, &(struct rlimit){ 0, 0 });
  memory = mmap (NULL, sizeof *memory, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return -1;
#endif
  return faults_setup ();
}

const check_fixture fixture = { memory_setup, cli_teardown };
