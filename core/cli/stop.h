/* Ctrl-C and its like: a request to come to an end, which commands look at between steps. */
#ifndef PW_STOP_H
#define PW_STOP_H

#include <signal.h>
#include "pinwheel.h"

extern volatile sig_atomic_t pw_stop; /* requests so far */

/* From here on signals are counted.  The first one asks for a stop after the current step; some senders signal a program
 * and its group as well, so it is the third one that ends it, should that step never end. */
void pw_stop_catch (void);
/* From here on they end the program again. */
void pw_stop_release (void);

/* The end that a run is asked to come to from outside: by signals, or by the processor time that its thread may take. */
typedef struct {
  double most;   /* [s]; INFINITY: any */
  double start;  /* of the thread's clock [s] */
  double looked; /* at a clock that costs less */
} pw_limit;

/* Starts the clock; due where the run begins. */
void pw_limit_start (pw_limit *l);
/* Has it run out, or was the program signalled?  For pw_settings.stop; the context is the limit. */
int pw_limit_over (void *limit);
/* What a run that was stopped (PW_STOPPED) at time t ends with: PW_RETRY after a signal; else PW_METHOD, with the limit. */
int pw_limit_fail (const pw_limit *l, double t, pw_error *error);

#endif
