/* Runs that several tests make; a failure ends the test with the error. */
#ifndef RUNS_H
#define RUNS_H

#include "pinwheel-analysis.h"

pw_run *runs_open (pw_system *s, const char *method, const pw_settings *settings);

/* Advances to t and samples the state there. */
pw_sample runs_to (pw_run *r, double t);

/* The i-th of every integrator with each of its stabilisations, "rk4+none" first: writes its name; NULL after the
 * last. */
const pw_method *runs_method (int i, char name[40]);

/* The state at t after a run of its own: q and v, coordinates each; the statistics may be NULL. */
void runs_state (pw_system *s, const char *method, const pw_settings *settings, double t, double *q, double *v,
                 pw_statistics *statistics);

/* Reads a reference table, whose caption lines begin with #: at most `lines` lines of `columns` numbers.  Returns the
 * number of lines. */
int runs_reference (const char *path, int lines, int columns, double *table);

#endif
