/* Requests to stop: pw_stop, set by signals or after an error in a thread, and limits of processor time. */
#define _DEFAULT_SOURCE /* CLOCK_MONOTONIC_COARSE */
#include <math.h>
#include <pthread.h>
#include <time.h>
#include <unistd.h>
#include "cli.h"

volatile sig_atomic_t pw_stop;
enum { STOP_NOW = 3 }; /* pw_stop when a signal ends the program, see pw_stop_catch */

static void stop_on_signal (int number) {
  if (++pw_stop < STOP_NOW) return;
  signal (number, SIG_DFL);
  raise (number);
}

static pthread_t stop_thread; /* of the command */

/* Outside of the loops that check pw_stop.  The command's thread blocks signals until it has removed temporary files;
 * then another one, as of a BLAS library, receives them. */
static void stop_at_once (int number) {
  static const char text[] = "pinwheel: interrupted\n";
  if (!pthread_equal (pthread_self (), stop_thread)) {
    pthread_kill (stop_thread, number);
    return;
  }
  ssize_t written = write (STDERR_FILENO, text, sizeof text - 1);
  (void)written;
  _exit (PW_INTERRUPTED);
}

/* Sets the handler of SIGINT and SIGTERM; a signal that the program was started to ignore, by nohup or in a script's
 * background, stays ignored.  SA_RESTART: a write that waits for the reader of a pipe goes on. */
static void stop_set (void (*handler) (int)) {
  static const int caught[] = { SIGINT, SIGTERM };
  struct sigaction action = { .sa_handler = handler, .sa_flags = SA_RESTART }, before;
  sigemptyset (&action.sa_mask);
  for (int i = 0; i < 2; i++)
    if (sigaction (caught[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN) sigaction (caught[i], &action, NULL);
}

void pw_stop_catch (void) {
  stop_set (stop_on_signal);
}

void pw_stop_release (void) {
  stop_thread = pthread_self ();
  stop_set (stop_at_once);
}

/* ---- Limits ---- */

void pw_limit_start (pw_limit *limit) {
  limit->start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
}

/* Reading the thread's clock takes a system call, so it is read only when a coarse clock, which does not, has advanced:
 * about 250 times a second. */
int pw_limit_over (void *context) {
  pw_limit *limit = context;
  if (pw_stop) return 1;
  if (isinf (limit->seconds)) return 0;
  double now = pw_seconds (CLOCK_MONOTONIC_COARSE);
  if (now == limit->last_check) return 0;
  if (pw_seconds (CLOCK_THREAD_CPUTIME_ID) - limit->start > limit->seconds) return 1; /* and in all later calls */
  limit->last_check = now;
  return 0;
}

int pw_limit_status (const pw_limit *limit, double t, pw_error *error) {
  if (pw_stop) return PW_RETRY;
  return pw_fail (error, PW_METHOD, "t = %s s: the limit of %s s of processor time is reached (--limit)",
                  PW_DIGITS (t, 6), PW_DIGITS (limit->seconds, 6));
}
