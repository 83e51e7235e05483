/* A time limit for every test program: after LIMIT seconds (1200 by default) it ends its children, says its name and
 * fails.
 *
 * So that they can be found, a test program and its children are a process group of their own. */
#define _GNU_SOURCE /* program_invocation_short_name */
#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif

static void limit_say (const char *text) {
  ssize_t n = write (STDOUT_FILENO, text, strlen (text));
  (void)n;
}

/* Who ends the program ends its children, too. */
static void limit_end (int number) {
  if (number == SIGALRM) {
    limit_say ("\n[  FAILED  ] ");
    limit_say (program_invocation_short_name);
    limit_say (": takes longer than its time limit\n");
  }
  kill (0, SIGKILL);
  _exit (1);
}

__attribute__ ((constructor)) void limit_begin (void);
void limit_begin (void) {
  const char *text = getenv ("LIMIT");
  int seconds = text ? atoi (text) : 0;
  signal (SIGINT, SIG_DFL); /* ignored in what a shell starts in the background */
  if (getpgrp () != getpid () && setpgid (0, 0) != 0) return;
  signal (SIGALRM, limit_end);
  signal (SIGTERM, limit_end);
#ifdef __linux__
  prctl (PR_SET_PDEATHSIG, SIGTERM); /* Ctrl-C at a terminal reaches whoever has started it, which is another group */
#endif
  alarm (seconds > 0 ? (unsigned)seconds : 1200);
}
