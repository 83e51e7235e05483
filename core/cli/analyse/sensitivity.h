/* Derivatives of outputs of a run with respect to unknowns, for `sensitivity`, `fit` and `optimise`.  There are F
 * functionals and P unknowns; comments on arrays begin with their sizes. */
#ifndef PW_SENSITIVITY_H
#define PW_SENSITIVITY_H

#include "outcome.h"
#include "progress.h"
#include "unknowns.h"

typedef struct {
  const char **of; /* the texts of the outputs, ended by NULL */
  pw_unknowns unknowns;
  double row_interval; /* between rows of the table [s]; 0: 20 intervals */
  int no_error;        /* 1: neither errors nor a check that the constraints leave the unknowns free */
  /* results */
  pw_outcomes outcomes;                /* of the run */
  double *run_slope, *run_slope_error; /* F x P: derivatives of the functionals, and their errors; NaN: none exists */
  int rows, columns;                   /* of the table: t, then each output that is in it, with its derivatives */
  double *row;                         /* rows x columns */
  double *loose;                       /* outputs x P: derivatives with larger tolerances, NaN: failed; or NULL */
  int stopped;                         /* 1: stopped before t_end, by Ctrl-C or the limit */
  pw_unknown_run base;                 /* the run, at the given values of the unknowns; its limit is that of all runs */
  pw_direction *direction;             /* P */
  /* at the time last evaluated, where the columns of the functionals are their values[0]: */
  double *slope, *slope_error; /* F x P: derivatives of the columns, and their errors */
  /* private */
  double *gradient;           /* F: scratch, of an output */
  double *unknown_value;      /* P: the given values */
  pw_unknown_run *neighbours; /* 4 P: those of each direction */
  pw_variation *variation;
  pw_run *sampled;        /* the run of which samples are taken; NULL: base.run */
  double last_breakpoint; /* that has been reached [s] */
  double *before;         /* F + F P: values and derivatives before a jump */
  double *q;              /* coordinates: scratch */
  char *memory;           /* of gradient, slope, run_slope, their errors, before and q */
  pw_arena arena;         /* of loose, direction, unknown_value and neighbours */
  size_t room;            /* rows allocated */
} pw_sensitivity;

/* Begins the run with its derivatives at these values of the unknowns; NULL: their own.  Set the members up to
 * `no_error` before, the others to zero.  Close it in every case. */
int pw_sensitivity_start (pw_sensitivity *sens, const double *values, pw_error *error);
/* Advances the run to a time, and sets slope, slope_error and the functionals' values[0] there.  Returns as
 * pw_variation_advance. */
int pw_sensitivity_at (pw_sensitivity *sens, double t, pw_error *error);
/* Starts the run, advances it to the end, and computes all results except `loose`.  PW_OK with `stopped` if it is
 * stopped while it computes derivatives; the status of pw_outcomes_run if before. */
int pw_sensitivity_compute (pw_sensitivity *sens, const double *values, pw_progress *progress, pw_error *error);
void pw_sensitivity_close (pw_sensitivity *sens); /* but not its unknowns */
/* 1 if an output is in the table: it is a function of columns at one time, without extrema and integrals. */
int pw_sensitivity_in_table (const pw_sensitivity *sens, int output);
/* The derivative of an output with respect to an unknown from those of the functionals, slope or run_slope; or its
 * error from theirs, slope_error or run_slope_error. */
double pw_sensitivity_derivative (const pw_sensitivity *sens, int output, int unknown, const double *slope);

#endif
