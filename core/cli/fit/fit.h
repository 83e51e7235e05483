/* A least-squares fit for `pinwheel fit`: its options, data and results.  Comments on arrays begin with their sizes;
 * arrays "columns x rows" have the rows of the first column, then those of the second one, ... */
#ifndef PW_FIT_H
#define PW_FIT_H

#include "sensitivity.h"

typedef struct {
  pw_cli_line line;
  const char *data_path, *columns_text, *table_path, *json_path, *plots_path, *confidence_text, *starts_text,
      *jobs_text, *time_name, *time_scale_text, *time_offset_text;
  const char **free, **sigma_texts;
  pw_cli_model model;
  pw_files files;
  pw_unknowns unknowns;
  double confidence; /* probability of confidence intervals */
  int jobs, starts;
  /* data */
  pw_arena arena;                          /* of all arrays but the table */
  const char **column_name, **column_unit; /* columns, ended by NULL */
  double *table;                           /* times, data, columns of standard deviations */
  int columns, rows;                       /* of the data */
  int untimed, late;                       /* rows that are left out: without a time, after --t-end */
  double first, last;                      /* times in the table, those after --t-end included [s] */
  double t_end;                            /* of the run of the model, or --t-end [s] */
  const double *t;                         /* rows [s] */
  const double *data;                      /* columns x rows; NaN: none */
  double *sigma;                           /* columns x rows: standard deviations; 1 if not weighted */
  int weighted;                            /* 1: standard deviations are given */
  int residuals;                           /* number of data that are not NaN */
  /* results */
  double *ends;           /* starts x (1 + unknowns): sum of squares, values; without a result INFINITY, the start */
  double *estimate;       /* unknowns */
  double *fitted;         /* columns x rows: values of the model at the estimate */
  double *standard_error; /* unknowns; INFINITY: not determined by the data, NaN: not known */
  double *covariance;     /* unknowns x unknowns */
  /* of the Jacobian of the residuals at the estimate, its columns scaled to length 1: */
  double *derivative_error; /* unknowns: order of the relative error of each column */
  double *singular_value;   /* unknowns, the largest one first */
  double *singular_vector;  /* unknowns x unknowns: right singular vectors, in columns */
  double *column_length;    /* unknowns: before scaling; 0: the unknown has no effect */
  int rank;                 /* singular values that differ from 0 */
  double chi2;              /* sum of squares of the residuals (model - data) / sigma */
  double initial_chi2;      /* where the first search begins */
  int converged, iterations;
  int interrupted; /* 1: by Ctrl-C; the estimate is the best so far, its standard errors are NaN */
  long runs;
  pw_progress progress;
} pw_fit;

/* An unknown nearer to a bound than this, relative to its scale, counts as at the bound; no search begins nearer. */
#define PW_FIT_MARGIN 1e-3

/* An unknown belongs to a combination that the data do not determine, a singular vector, if its component is larger. */
#define PW_FIT_COMPONENT 0.01

/* Runs the model with these values of the unknowns; out: columns x rows.  A status; PW_RETRY after Ctrl-C. */
int pw_fit_run (const pw_fit *fit, const double *unknowns, double *out, pw_error *error);

/* Derivatives of the model's values, `values` at these unknowns, with respect to each unknown: jacobian is unknowns x
 * (columns x rows).  By central differences of concurrent runs.  Sets fit->derivative_error.  A status; PW_RETRY after
 * Ctrl-C. */
int pw_fit_jacobian (pw_fit *fit, const double *unknowns, const double *values, double *jacobian, pw_error *error);

/* Minimises the sum of squares from all starts and sets the results.  A status; PW_RETRY after Ctrl-C. */
int pw_fit_solve (pw_fit *fit, pw_error *error);

static inline int pw_fit_degrees_of_freedom (const pw_fit *fit) {
  return fit->residuals - fit->rank;
}

/* Reports (fit_report.c): text, JSON with this status ("ok", ...), the table of data and residuals, figures. */
void pw_fit_print (const pw_fit *fit);
void pw_fit_json (const pw_fit *fit, const char *status, FILE *f);
int pw_fit_table (const pw_fit *fit, FILE *f, pw_error *error);
int pw_fit_draw (const pw_fit *fit, pw_error *error);

#endif
