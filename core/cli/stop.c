/* Requests to stop. */
#define _POSIX_C_SOURCE 200809L
#include <string.h>
#include "stop.h"

volatile sig_atomic_t pw_stop;

static void stop_on_signal (int number) {
  if (++pw_stop < 3) return;
  signal (number, SIG_DFL);
  raise (number);
}

void pw_stop_catch (void) {
  struct sigaction action;
  memset (&action, 0, sizeof action);
  action.sa_handler = stop_on_signal;
  sigemptyset (&action.sa_mask);
  sigaction (SIGINT, &action, NULL);
  sigaction (SIGTERM, &action, NULL);
}

void pw_stop_release (void) {
  signal (SIGINT, SIG_DFL);
  signal (SIGTERM, SIG_DFL);
}
