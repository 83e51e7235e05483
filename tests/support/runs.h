/* Runs that several tests make; any error fails the test. */
#ifndef RUNS_H
#define RUNS_H

#include "pinwheel-analysis.h"

/* The system of tests/models/events/SCENE.yaml with parameters "NAME=VALUE NAME=VALUE". */
pw_system *runs_scene (const char *scene, const char *sets);

pw_run *runs_open (pw_system *s, const char *method, const pw_settings *settings);

/* Closes a run and frees its system. */
void runs_close (pw_run *r, pw_system *s);

/* Opens another run of the system, which continues from a checkpoint of r; method and settings are those of r. */
pw_run *runs_copy (pw_run *r, pw_system *s, const char *method, const pw_settings *settings);

/* Advances to t and samples the state there; arrays of the sample are valid until the next call. */
pw_sample runs_to (pw_run *r, double t);

/* The integrator of the i-th pair of an integrator and a stabilisation, whose name is written to `name`; "rk4+none" is
 * the first; NULL after the last. */
const pw_method *runs_method (int i, char name[40]);

/* A method of each adaptive integrator; the errors of some hundred steps, each within the tolerance, in one direction
 * are RUNS_STEPS times the tolerance. */
enum { RUNS_ADAPTIVE = 6 };
extern const char *const runs_adaptive[RUNS_ADAPTIVE];
#define RUNS_STEPS 1e3

/* Opens a run, advances it to t and closes it: the state there is written to q and v (coordinates numbers each), what
 * the run has cost to `statistics` unless that is NULL. */
void runs_state (pw_system *s, const char *method, const pw_settings *settings, double t, double *q, double *v,
                 pw_statistics *statistics);

/* Reads a reference table, whose caption lines begin with #: at most `lines` lines of `columns` numbers.  Returns the
 * number of lines. */
int runs_reference (const char *path, int lines, int columns, double *table);

#endif
