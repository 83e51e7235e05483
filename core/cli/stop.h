/* Requests to stop, by Ctrl-C or a limit of processor time, which commands check between steps. */
#ifndef PW_STOP_H
#define PW_STOP_H

#include <signal.h>
#include "pinwheel.h"

extern volatile sig_atomic_t pw_stop; /* requests so far */

/* Counts signals from here on.  The first requests a stop after the current step; since some senders signal a program
 * and its group as well, only the third ends the program, in case that step never ends. */
void pw_stop_catch (void);
/* Lets signals end the program again. */
void pw_stop_release (void);

/* The limit of a run's processor time, measured by the clock of its thread. */
typedef struct {
  double most;   /* [s]; INFINITY: no limit */
  double start;  /* of the thread's clock [s] */
  double looked; /* coarse clock when the thread's clock was last read [s] */
} pw_limit;

/* Starts the clock; call it when the run begins. */
void pw_limit_start (pw_limit *l);
/* 1 if the limit is exceeded or a signal has requested a stop.  For pw_settings.stop; the context is the limit. */
int pw_limit_over (void *limit);
/* The status of a run that was stopped (PW_STOPPED) at time t: PW_RETRY after a signal; else PW_METHOD with the
 * limit. */
int pw_limit_fail (const pw_limit *l, double t, pw_error *error);

#endif
