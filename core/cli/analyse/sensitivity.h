/* Derivatives of outputs of a run with respect to unknowns, for `sensitivity`, `fit` and `optimise`. */
#ifndef PW_SENSITIVITY_H
#define PW_SENSITIVITY_H

#include "outcome.h"
#include "progress.h"
#include "unknowns.h"

typedef struct {
  const char **of; /* the texts of the outputs, ended by NULL */
  pw_unknowns unknowns;
  double row_interval; /* between rows of the table [s]; 0: a few rows */
  int no_error;        /* 1: derivatives without errors */
  /* results */
  pw_outcomes outcomes;                /* of the run */
  double *run_slope, *run_slope_error; /* F x P: derivatives of the functionals of the run, and their errors */
  int rows, columns;                   /* of the table: t, then each output and its derivatives */
  double *row;                         /* rows x columns */
  double *loose;                       /* outputs x P: derivatives with larger tolerances; NULL: not computed */
  int stopped;                         /* 1: stopped before t_end, by Ctrl-C or the limit */
  pw_limit limit;                      /* of all runs */
  pw_unknown_run base;                 /* the run, at these values of the unknowns */
  pw_direction *direction;             /* P, of the unknowns */
  /* Of all F functionals of the outputs and all P unknowns, at the time last evaluated. */
  double *value;               /* 2 F: values; scratch: the gradient of an output */
  double *slope, *slope_error; /* F x P: derivatives, and their errors */
  /* private */
  double *unknown_value;      /* P: of the unknowns */
  pw_unknown_run *neighbours; /* 4 of each unknown */
  pw_variation *variation;
  pw_run *sampled;        /* the run of which samples are taken; NULL: base.run */
  int along_run;          /* 1: there are extrema or integrals */
  double last_breakpoint; /* before the time last evaluated [s] */
  double *before;         /* F + F P: values and derivatives before a jump */
  double *q;              /* scratch */
  char *memory;           /* of these arrays */
  size_t room;
} pw_sensitivity;

/* Prepares derivatives of the outputs with respect to the unknowns at these values; NULL: their own.  Begin with the
 * members up to `no_error`; close it in every case. */
int pw_sensitivity_open (pw_sensitivity *sens, const double *values, pw_error *error);
/* Begins a run with derivatives. */
int pw_sensitivity_start (pw_sensitivity *sens, pw_error *error);
/* Advances it to a time, and sets value, slope and slope_error there. */
int pw_sensitivity_at (pw_sensitivity *sens, double t, pw_error *error);
/* Computes all results: starts the run, advances it to the end, with extrema, integrals and the table. */
int pw_sensitivity_compute (pw_sensitivity *sens, pw_progress *progress, pw_error *error);
void pw_sensitivity_close (pw_sensitivity *sens);
/* 1 if an output has columns in the table: it is a function of columns at one time, without extrema and integrals. */
int pw_sensitivity_in_table (const pw_sensitivity *sens, int output);
/* The derivative of an output with respect to an unknown from those of the functionals: slope or run_slope; or its
 * error from theirs. */
double pw_sensitivity_derivative (const pw_sensitivity *sens, int output, int unknown, const double *slope);

#endif
