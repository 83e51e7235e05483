/* Free parameters and initial values of a model, which `fit` and `optimise` determine. */
#ifndef PW_UNKNOWNS_H
#define PW_UNKNOWNS_H

#include "sensitivity.h"

typedef struct {
  pw_unknown_runs runs; /* settings: except stop, initial, specialised */
  char *names;          /* copies */
  const pw_cli_model *m;
  double t_end;
  double limit; /* of each run's processor time [s] */
  pw_cli_engine engine;
} pw_unknowns;

/* Reads a list of "NAME" or "NAME=LOW:HIGH", ended by NULL, the settings of runs and --specialise; `runs` is the expected
 * number of runs.  The line and the open model must outlive the unknowns.  PW_INPUT for an unknown name, a count, bounds
 * without the initial value between them or outside the domain.  Close them in every case. */
int pw_unknowns_open (pw_unknowns *u, const pw_cli_line *line, const pw_cli_model *m, const char **list, double runs,
                      pw_error *error);
void pw_unknowns_close (pw_unknowns *u);

/* The model with values of the unknowns, compiled, and settings of its runs; limit: its stop context.  PW_INPUT if the
 * model refuses the values; PW_RESOURCE.  Close the model by pw_cli_close_model in every case.  May be called by
 * several threads at once. */
int pw_unknowns_system (const pw_unknowns *u, const double *x, pw_cli_model *m, pw_settings *settings, pw_limit *limit,
                        pw_error *error);

/* Prepares derivatives with respect to all unknowns at these values, without their errors; outputs end with NULL.
 * Close it in every case. */
int pw_unknowns_differentiate (const pw_unknowns *u, const double *x, const char **outputs, pw_sensitivity *s,
                               pw_error *error);

/* Points where searches begin, `count` x unknowns: the values at the beginning, then Sobol's sequence between the user's
 * bounds, otherwise within a scale of the values, displaced by the seed.  Several
 * starts: at most PW_UNKNOWNS_STARTED unknowns, the limit of the sequence.  NULL if out of memory; free it. */
enum { PW_UNKNOWNS_STARTED = 40 };
double *pw_unknowns_starts (const pw_unknowns *u, int count, double seed);

/* A notice if the constraints change given initial values at these values of the unknowns. */
void pw_unknowns_report (const pw_unknowns *u, const double *x);

/* Options that set the values, "--set a=1 --start frame.vx=2".  0 if the text is too short. */
int pw_unknowns_options (const pw_unknowns *u, const double *x, char *text, size_t size);

#endif
