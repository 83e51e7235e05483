/* A least-squares fit and its results. */
#ifndef PW_FIT_H
#define PW_FIT_H

#include "outcome.h"
#include "progress.h"
#include "sensitivity.h"

typedef struct {
  pw_cli_line line;
  const char *data_path, *columns_text, *path, *json_path, *plots_path, *confidence_text, *starts_text, *jobs_text;
  const char **free, **sigma_list;
  pw_cli_model m;
  pw_files files;
  pw_unknowns unknowns;
  double confidence;
  int jobs, starts;
  /* data: `columns` arrays of `rows` each, one after the other */
  char *names;               /* copy of the text of --columns */
  const char **name, **unit; /* columns */
  double *table;             /* as read: times, data, columns with standard deviations */
  int columns, rows;
  const double *t, *value; /* rows [s]; columns x rows, NaN: none */
  double *sigma;           /* columns x rows: standard deviations */
  int weighted;            /* 1: they are given; else 1 */
  int residuals;           /* data */
  /* results */
  double *minimum;          /* starts x (1 + unknowns): sum of squares, INFINITY if a search failed, and values */
  double *estimate, *model; /* unknowns; columns x rows */
  double *deviation;        /* unknowns: standard errors; INFINITY: not identifiable, NaN: no degrees of freedom */
  double *covariance;       /* unknowns x unknowns */
  double *singular,
      *vectors;   /* unknowns: singular values of the scaled Jacobian, the largest one first; in columns: vectors */
  double *length; /* unknowns: lengths of the columns of the Jacobian; 0: no effect */
  int rank;       /* singular values that differ from 0 */
  double chi2;    /* sum of squares of (model - data) / sigma */
  double initial_chi2;
  int by_differences; /* 1: derivatives are those of runs, since the variational equations could not be used */
  int converged, iterations;
  int interrupted; /* 1: by Ctrl-C; the values are those reached, their errors NaN */
  long runs;
  pw_progress progress;
} pw_fit;

/* In units of the scale: an unknown that is nearer to a bound is at it; no search begins so near. */
#define PW_FIT_INSIDE 1e-3

/* Smallest component of an undetermined combination of unknowns that counts. */
#define PW_FIT_PART 0.1

/* Runs the model with values of the unknowns; out: columns x rows.  A status; PW_RETRY after Ctrl-C. */
int pw_fit_run (const pw_fit *x, const double *unknowns, double *out, pw_error *error);

/* The derivatives of all model values by each unknown at x, unknowns arrays of columns x rows; model: values there.
 * By the variational equations, or if a derivative does not exist by central differences of concurrent runs. */
int pw_fit_jacobian (pw_fit *x, const double *at, const double *model, double *jacobian, pw_error *error);
/* Relative error of these derivatives. */
double pw_fit_noise (const pw_fit *x);

/* Minimises the sum of squares from the initial values.  A status; x->converged. */
int pw_fit_solve (pw_fit *x, pw_error *error);

/* Degrees of freedom; the factor of confidence intervals: of the normal distribution, or Student's. */
int pw_fit_freedom (const pw_fit *x);
double pw_fit_quantile (const pw_fit *x);

void pw_fit_print (const pw_fit *x);
void pw_fit_json (const pw_fit *x, const char *status, FILE *f);
int pw_fit_table (const pw_fit *x, FILE *f, pw_error *error);
int pw_fit_draw (const pw_fit *x, pw_error *error);

#endif
