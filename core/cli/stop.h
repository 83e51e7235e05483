/* Ctrl-C and its like: a request to come to an end, which commands look at between steps. */
#ifndef PW_STOP_H
#define PW_STOP_H

#include <signal.h>

extern volatile sig_atomic_t pw_stop; /* requests so far */

/* From here on signals are counted.  The first one asks for a stop after the current step; some senders signal a program
 * and its group as well, so it is the third one that ends it, should that step never end. */
void pw_stop_catch (void);
/* From here on they end the program again. */
void pw_stop_release (void);

#endif
