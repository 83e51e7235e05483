/* Runs that several tests make; any error fails the test. */
#ifndef RUNS_H
#define RUNS_H

#include "pinwheel-analysis.h"

pw_run *runs_open (pw_system *s, const char *method, const pw_settings *settings);

/* Advances to t and samples the state there. */
pw_sample runs_to (pw_run *r, double t);

/* The integrator of the i-th method, i.e. integrator with stabilisation, of which `name` takes the name; "rk4+none" is
 * the first; NULL after the last. */
const pw_method *runs_method (int i, char name[40]);

/* The state at t of a run that is opened for it: q and v take the coordinates; statistics may be NULL. */
void runs_state (pw_system *s, const char *method, const pw_settings *settings, double t, double *q, double *v,
                 pw_statistics *statistics);

/* Reads a reference table, whose caption lines begin with #: at most `lines` lines of `columns` numbers.  Returns the
 * number of lines. */
int runs_reference (const char *path, int lines, int columns, double *table);

#endif
