/* A least-squares fit for `pinwheel fit`: its options, data and results. */
#ifndef PW_FIT_H
#define PW_FIT_H

#include "sensitivity.h"

typedef struct {
  pw_cli_line line;
  const char *data_path, *columns_text, *table_path, *json_path, *plots_path, *confidence_text, *starts_text,
      *jobs_text;
  const char **free, **sigma_texts;
  pw_cli_model model;
  pw_files files;
  pw_unknowns unknowns;
  double confidence;
  int jobs, starts;
  /* data; arrays "columns x rows" have the rows of the first column, then those of the second one, ... */
  char *columns_copy;                      /* copy of columns_text, split into names */
  const char **column_name, **column_unit; /* columns, ended by NULL */
  double *table;                           /* as read: times, data, columns of standard deviations */
  int columns, rows;
  const double *t;    /* rows [s] */
  const double *data; /* columns x rows; NaN: none */
  double *sigma;      /* columns x rows: standard deviations of the data, in their units; 1 if not weighted */
  int weighted;       /* 1: standard deviations are given */
  int residuals;      /* number of data */
  /* results */
  double *minima;         /* starts x (1 + unknowns): sum of squares, INFINITY if the search failed, and values */
  double *estimate;       /* unknowns */
  double *fitted;         /* columns x rows: values of the model at the estimate */
  double *standard_error; /* unknowns; INFINITY: not determined by the data, NaN: no degrees of freedom */
  double *covariance;     /* unknowns x unknowns */
  /* of the Jacobian of the residuals, its columns scaled to length 1, at the estimate: */
  double *singular_value;  /* unknowns, the largest one first */
  double *singular_vector; /* unknowns x unknowns: right singular vectors, in columns */
  double *column_length;   /* unknowns: before scaling; 0: the unknown has no effect */
  int rank;                /* singular values that differ from 0 */
  double chi2;             /* sum of squares of the residuals (model - data) / sigma */
  double initial_chi2;
  int by_differences; /* 1: derivatives are differences of runs, since the variational equations could not be used */
  int converged, iterations;
  int interrupted; /* 1: by Ctrl-C; the estimate is the best so far, its standard errors are NaN */
  long runs;
  pw_progress progress;
} pw_fit;

/* In units of the scale: an unknown that is nearer to a bound is at it; no search begins nearer. */
#define PW_FIT_MARGIN 1e-3

/* Least component with which an unknown belongs to a combination that the data do not determine, a singular vector. */
#define PW_FIT_COMPONENT 0.1

/* Runs the model with values of the unknowns; out: columns x rows.  A status; PW_RETRY after Ctrl-C. */
int pw_fit_run (const pw_fit *fit, const double *unknowns, double *out, pw_error *error);

/* The derivatives of all model values by each unknown: unknowns x (columns x rows), where the model has these values.
 * By the variational equations; if a derivative does not exist, by central differences of concurrent runs. */
int pw_fit_jacobian (pw_fit *fit, const double *unknowns, const double *values, double *jacobian, pw_error *error);
/* Relative error of these derivatives. */
double pw_fit_derivative_error (const pw_fit *fit);

/* Minimises the sum of squares from all starts.  A status; sets fit->converged. */
int pw_fit_solve (pw_fit *fit, pw_error *error);

/* Degrees of freedom; half the width of confidence intervals in standard errors, by the normal distribution if standard
 * deviations are given, else by Student's. */
int pw_fit_freedom (const pw_fit *fit);
double pw_fit_quantile (const pw_fit *fit);

/* Reports (fit_report.c): text, JSON, the table of data and residuals, figures. */
void pw_fit_print (const pw_fit *fit);
void pw_fit_json (const pw_fit *fit, const char *status, FILE *f);
int pw_fit_table (const pw_fit *fit, FILE *f, pw_error *error);
int pw_fit_draw (const pw_fit *fit, pw_error *error);

#endif
