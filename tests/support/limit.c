/* A time limit for every test program: after LIMIT seconds of the environment, 1200 by default, it prints its name,
 * ends its children and fails.  For that, a test program and its children are a process group of their own. */
#define _GNU_SOURCE /* program_invocation_short_name */
#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif

static void limit_print (const char *text) {
  ssize_t n = write (STDOUT_FILENO, text, strlen (text));
  (void)n;
}

/* On SIGALRM and SIGTERM: ends the process group. */
static void limit_end (int number) {
  if (number == SIGALRM) {
    limit_print ("\n[  FAILED  ] ");
    limit_print (program_invocation_short_name);
    limit_print (": takes longer than its time limit\n");
  }
  kill (0, SIGKILL);
  _exit (1);
}

__attribute__ ((constructor)) void limit_begin (void);
void limit_begin (void) {
  const char *text = getenv ("LIMIT");
  int seconds = text ? atoi (text) : 0;
  signal (SIGINT, SIG_DFL); /* a shell lets its background processes ignore it */
  if (getpgrp () != getpid () && setpgid (0, 0) != 0) return;
  signal (SIGALRM, limit_end);
  signal (SIGTERM, limit_end);
#ifdef __linux__
  /* Ctrl-C reaches only the group of the parent process: its end must end this program. */
  prctl (PR_SET_PDEATHSIG, SIGTERM);
#endif
  alarm (seconds > 0 ? (unsigned)seconds : 1200);
}
