/* Outputs of runs as functions of unknowns, and their derivatives, for `sensitivity`, `fit` and `optimise`.  There are
 * P unknowns; comments on arrays begin with their sizes. */
#ifndef PW_SENSITIVITY_H
#define PW_SENSITIVITY_H

#include "outcome.h"
#include "cli.h"
#include "unknowns.h"

/* Outputs of the runs of unknowns. */
typedef struct {
  const pw_unknowns *unknowns;
  const char *option; /* "--of", in messages */
  const char **of;    /* count: texts */
  int count;
  const char *method; /* NULL: that of the unknowns, with their settings */
  double rtol;        /* with a method */
  long max_steps;     /* likewise; 0: that of the settings */
  const double *t;    /* rows: times of a table, see pw_outcome_table; NULL: none */
  int rows;
} pw_run_outputs;

/* Runs the model with these values of the unknowns; stores the outputs, unless `value` is NULL, and the table, count x
 * rows.  Called by several threads at once.  A status; PW_RETRY after Ctrl-C. */
int pw_run_outputs_at (const pw_run_outputs *outputs, const double *x, double *value, double *table, pw_error *error);

/* Relative noise of outputs as functions of the unknowns: the tolerance of an adaptive method, or round-off with fixed
 * steps. */
double pw_unknowns_noise (const pw_unknowns *u);

typedef struct {
  pw_run_outputs outputs; /* with the method of the runs that are compared */
  int jobs;               /* threads */
  pw_progress *progress;
  /* results */
  pw_outcomes outcomes;      /* of the run, for texts and units */
  double *value;             /* count: of the run by the method of the unknowns */
  double *table;             /* count x rows; NaN for outputs that are not in the table */
  pw_derivative *derivative; /* P x (count + count x rows): of the outputs, then of the table */
  /* private */
  pthread_mutex_t lock;
  int runs;
  pw_arena arena;
} pw_sensitivity;

/* Makes the run, and differentiates the outputs at the values of the unknowns.  Set the members up to `progress`
 * before, the method excepted, the others to zero.  Close it in every case.  Errors: those of the run; PW_INPUT if
 * constraints determine an initial value, or a parameter changes the number of bodies; PW_RETRY after Ctrl-C. */
int pw_sensitivity_compute (pw_sensitivity *sens, pw_error *error);
void pw_sensitivity_close (pw_sensitivity *sens); /* but not its unknowns */
/* The derivative of an output, or of its value in a row of the table, with respect to an unknown; row -1: output. */
const pw_derivative *pw_sensitivity_of (const pw_sensitivity *sens, int output, int unknown, int row);

#endif
