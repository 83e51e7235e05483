/* `pinwheel sensitivity` and its results. */
#ifndef PW_SENSITIVITY_H
#define PW_SENSITIVITY_H

#include "outcome.h"
#include "progress.h"
#include "unknowns.h"

typedef struct {
  pw_cli_line line;
  const char **of, **by; /* as given, ended by NULL */
  const char *every, *folder;
  pw_cli_model m;
  pw_files files;
  pw_limit limit; /* of all runs */
  pw_unknowns unknowns;
  double *at;                 /* values of the unknowns */
  double dt;                  /* time between rows [s]; 0: a few rows */
  pw_unknown_run base, *near; /* the run; 4 neighbours of each unknown */
  pw_direction *direction;
  pw_variation *variation;
  pw_run *sampled;      /* the run of which samples are taken; NULL: base.run */
  int along;            /* 1: there are extrema or integrals */
  double passed;        /* the last breakpoint before the time last evaluated [s] */
  pw_outcomes outcomes; /* of the run */
  /* Of all functionals F of the outputs and unknowns P at the time last evaluated, and of the run. */
  int no_error;          /* 1: derivatives without errors */
  double *value;         /* 2 F: values; the gradient of an output (scratch) */
  double *slope, *error; /* F x P: derivatives, and their errors */
  double *end_slope, *end_error;
  double *before; /* F + F P: values and derivatives before a jump */
  int rows;       /* the table: t, then each output and its derivatives */
  double *row;    /* rows x columns */
  size_t room;
  int columns;
  double cpu;  /* [s] */
  int stopped; /* 1: stopped before t_end */
} pw_sensitivity;

/* Prepares derivatives of the outputs sens->of, ended by NULL, with respect to sens->unknowns at these values; NULL:
 * their own.  Close it in every case. */
int pw_sensitivity_open (pw_sensitivity *sens, const double *at, pw_error *error);
/* Begins a run with derivatives; then advances to a time, and sets value, slope and error of all columns there.  A
 * status. */
int pw_sensitivity_start (pw_sensitivity *sens, pw_error *error);
int pw_sensitivity_at (pw_sensitivity *sens, double t, pw_error *error);
/* All of it, with extrema, integrals and the table.  A status. */
int pw_sensitivity_compute (pw_sensitivity *sens, pw_progress *progress, pw_error *error);
void pw_sensitivity_close (pw_sensitivity *sens);
/* 1 if an output has columns in the table: it is a function of columns at one time, without extrema and integrals. */
int pw_sensitivity_in_table (const pw_sensitivity *sens, int output);
/* The derivative of an output by an unknown from those of the functionals, and its error. */
double pw_sensitivity_derivative (const pw_sensitivity *sens, int output, int unknown, const double *slope);

#endif
