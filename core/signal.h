/* Evaluation of signals. */
#ifndef PW_SIGNAL_H
#define PW_SIGNAL_H

#include "system.h"

/* Value, rate and acceleration at time t (the last two only if derivatives are asked for); the states a function
 * reads are in source->x.  Returns what the user's function returned: non-zero stops the run. */
int pw_signal_eval (const pw_source *source, double t, int derivatives, double u[3]);

/* First discontinuity after t, or INFINITY. */
double pw_signal_breakpoint (const pw_signal *s, double t);

#endif
