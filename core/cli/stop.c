/* Requests to stop: pw_stop, set by signals or after an error in a thread, and limits of processor time. */
#define _DEFAULT_SOURCE /* CLOCK_MONOTONIC_COARSE */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <time.h>
#include <unistd.h>
#include "cli.h"

_Static_assert(ATOMIC_INT_LOCK_FREE == 2, "a handler of signals may change only atomic objects without a lock");
atomic_int pw_stop;
static atomic_int stop_signals; /* since pw_stop_catch */
enum { STOP_NOW = 3 };          /* the signal that ends the program, see pw_stop_catch */

static void stop_on_signal (int number) {
  pw_stop = 1;
  if (++stop_signals < STOP_NOW) return;
  signal (number, SIG_DFL);
  raise (number);
}

static pthread_t stop_thread; /* of the command */

/* The handler outside the loops that check pw_stop.  While the command's thread blocks signals (build_defer, until
 * temporary files are removed), another thread, such as one of a BLAS library, may receive them; it passes them on to
 * the command's thread. */
static void stop_at_once (int number) {
  static const char text[] = "pinwheel: interrupted\n";
  if (!pthread_equal (pthread_self (), stop_thread)) {
    const int before = errno; /* of the interrupted thread */
    pthread_kill (stop_thread, number);
    errno = before;
    return;
  }
  ssize_t written = write (STDERR_FILENO, text, sizeof text - 1);
  (void)written;
  _exit (PW_INTERRUPTED);
}

/* Sets the handler of SIGINT and SIGTERM.  A signal that was already ignored when the program started, by trap '' or
 * because a script runs it in the background, stays ignored.  SA_RESTART: a write that waits for the reader of a pipe
 * goes on. */
static void stop_set (void (*handler) (int)) {
  static const int caught[] = { SIGINT, SIGTERM };
  struct sigaction action = { .sa_handler = handler, .sa_flags = SA_RESTART }, before;
  sigemptyset (&action.sa_mask);
  for (int i = 0; i < 2; i++)
    if (sigaction (caught[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN) sigaction (caught[i], &action, NULL);
}

void pw_stop_catch (void) {
  stop_signals = 0;
  stop_set (stop_on_signal);
}

int pw_stop_release (void) {
  stop_thread = pthread_self ();
  stop_set (stop_at_once);
  return stop_signals;
}

/* ---- Limits ---- */

void pw_limit_start (pw_limit *limit) {
  limit->start = pw_seconds (CLOCK_THREAD_CPUTIME_ID);
}

/* Reading the thread's clock takes a system call.  It is therefore read only when a coarse clock, which can be read
 * without one, has advanced: about 250 times a second. */
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

pw_run *pw_limit_open (const pw_system *s, const char *method, const pw_settings *settings, pw_error *error) {
  const pw_limit *limit = settings->stop_context;
  pw_error own = { 0 };
  pw_run *r = pw_run_open (s, method, settings, &own);
  if (own.status == PW_STOPPED && pw_stop)
    own = (pw_error){ .status = PW_RETRY };
  else if (own.status == PW_STOPPED) {
    own.status = PW_OK;
    pw_fail (&own, PW_METHOD,
             "model %s: the limit of %s s of processor time is reached before the first step (--limit)",
             pw_system_name (s), PW_DIGITS (limit->seconds, 6));
  }
  if (error->status == PW_OK) *error = own;
  return r;
}

int pw_limit_status (const pw_limit *limit, double t, pw_error *error) {
  if (pw_stop) return PW_RETRY;
  return pw_fail (error, PW_METHOD, "t = %s s: the limit of %s s of processor time is reached (--limit)",
                  PW_DIGITS (t, 6), PW_DIGITS (limit->seconds, 6));
}
