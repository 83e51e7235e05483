/* Requests to stop. */
#define _DEFAULT_SOURCE /* clocks of Linux */
#include <math.h>
#include <time.h>
#include "cli.h"

volatile sig_atomic_t pw_stop;

static void stop_on_signal (int number) {
  if (++pw_stop < 3) return;
  signal (number, SIG_DFL);
  raise (number);
}

/* Handles SIGINT and SIGTERM; a signal that the program was started to ignore, by nohup or in the background of a script,
 * stays ignored. */
static void stop_set (void (*handler) (int)) {
  static const int number[] = { SIGINT, SIGTERM };
  struct sigaction action = { .sa_handler = handler }, before;
  sigemptyset (&action.sa_mask);
  for (int i = 0; i < 2; i++)
    if (sigaction (number[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN) sigaction (number[i], &action, NULL);
}

void pw_stop_catch (void) {
  stop_set (stop_on_signal);
}

void pw_stop_release (void) {
  stop_set (SIG_DFL);
}

/* ---- Limits ---- */

void pw_limit_start (pw_limit *l) {
  l->start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
}

/* Reading the thread's clock takes a system call, so it is read only when a coarse clock has advanced: about 250 times
 * a second. */
int pw_limit_over (void *limit) {
  pw_limit *l = limit;
  if (pw_stop) return 1;
  if (isinf (l->most)) return 0;
  double now = pw_seconds (CLOCK_MONOTONIC_COARSE);
  if (now == l->read) return 0;
  l->read = now;
  return pw_seconds (CLOCK_THREAD_CPUTIME_ID) - l->start > l->most;
}

int pw_limit_fail (const pw_limit *l, double t, pw_error *error) {
  char limit[32], reached[32];
  if (pw_stop) return PW_RETRY;
  return pw_fail (error, PW_METHOD, "t = %s s: the limit of %s s of processor time is reached (--limit)",
                  pw_format (reached, t, 6), pw_format (limit, l->most, 6));
}
