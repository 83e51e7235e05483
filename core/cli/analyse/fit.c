/* pinwheel fit: parameters and initial values with which a model agrees best with measured data. */
#define _POSIX_C_SOURCE 200809L
#include <gsl/gsl_blas.h>
#include <gsl/gsl_cdf.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_linalg.h>
#include <gsl/gsl_multifit_nlinear.h>
#include <stdlib.h>
#include <string.h>
#include "unknowns.h"
#include "figure.h"

/* A least-squares fit for `pinwheel fit`: its options, data and results.  Comments on arrays begin with their sizes;
 * arrays "columns x rows" have the rows of the first column, then those of the second one, ... */

/* What a column is compared with: the values along the run, at the times of its rows; or, in each row, a number that
 * the run yields, the time of an event or another one. */
typedef enum { FIT_ALONG, FIT_EVENT, FIT_NUMBER } fit_kind;

typedef struct {
  pw_cli_line line;
  const char *data_path, *columns_text, *time_name;
  pw_cli_given confidence_given, starts_given, time_scale, time_offset;
  const char **free, **sigma_texts;
  pw_unknowns unknowns;
  double confidence; /* probability of confidence intervals */
  int jobs, starts;
  /* data */
  const char **column_name, **column_unit; /* columns, ended by NULL */
  fit_kind *column_kind;                   /* columns */
  double *table;                           /* times, data, columns of standard deviations */
  int columns, rows;                       /* of the data */
  int timed;                               /* rows with a time, which come first; the others have outputs alone */
  int untimed, late;                       /* rows that are left out: without a time, after --t-end */
  double first, last;                      /* times in the table, those after --t-end included [s] */
  double t_end;                            /* of the run of the model, or --t-end [s] */
  const double *t;                         /* timed [s] */
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
#define FIT_MARGIN 1e-3

/* An unknown belongs to a combination that the data do not determine, a singular vector, if its component is larger. */
#define FIT_COMPONENT 0.01

static int fit_degrees_of_freedom (const pw_fit *fit) {
  return fit->residuals - fit->rank;
}

/* ---- The data: columns of a table and their standard deviations ---- */

#define FIT_LONGER 100. /* data that last longer than this many runs of the model have other units of time */

/* The standard deviation of a column of data as given by --sigma: a number, or the name of a column of the table. */
typedef struct {
  const char *text; /* NULL: not given */
  double number;    /* NaN: the text is the name of a column of the table */
} fit_sigma;

/* Splits "NAME,..." of --columns; commas in parentheses belong to a name. */
static int data_split_columns (pw_fit *fit, pw_error *error) {
  size_t count = 2; /* one name more than commas, and NULL at the end */
  for (const char *text = fit->columns_text; *text; text++) count += *text == ',';
  char *name = pw_arena_copy (&fit->line.arena, fit->columns_text);
  fit->column_name = pw_arena_alloc (&fit->line.arena, 2 * count * sizeof *fit->column_name);
  fit->column_kind = pw_arena_alloc (&fit->line.arena, count * sizeof *fit->column_kind);
  if (name == NULL || fit->column_name == NULL || fit->column_kind == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  fit->column_unit = fit->column_name + count;
  for (int more = 1; more; name++) {
    fit->column_name[fit->columns++] = name;
    name += pw_cli_part (name, ',');
    more = *name;
    *name = 0;
    for (int i = 0; i < fit->columns - 1; i++)
      if (strcmp (fit->column_name[i], fit->column_name[fit->columns - 1]) == 0)
        return pw_fail (error, PW_INPUT, "--columns: %s is given twice", fit->column_name[i]);
  }
  return PW_OK;
}

/* Reads --columns: outputs, of which columns of `run`, and functions of these, are values along the run. */
static int data_read_columns (pw_fit *fit, pw_error *error) {
  pw_outcomes set = { .system = NULL };
  char unit[PW_NAME_BYTES];
  int status = data_split_columns (fit, error);
  if (status == PW_OK)
    status = pw_outcomes_open (&set, fit->line.m.system, "--columns", fit->column_name, fit->columns, NULL, error);
  for (int i = 0; i < fit->columns && status == PW_OK; i++) {
    const pw_outcome *o = set.outcome + i;
    const int is_event = o->formula == NULL && set.functional[o->term[0]].type == PW_EVENT;
    fit->column_kind[i] = pw_outcome_is_final (&set, i) ? FIT_ALONG : is_event ? FIT_EVENT : FIT_NUMBER;
    fit->column_unit[i] = pw_arena_copy (&fit->line.arena, pw_outcome_unit (&set, i, unit, sizeof unit));
    if (fit->column_unit[i] == NULL) status = pw_fail (error, PW_RESOURCE, "out of memory");
    for (int k = 0; k < o->terms; k++)
      if (set.functional[o->term[k]].type == PW_EVENTS)
        status = pw_fail (error, PW_INPUT,
                          "--columns %s: a number of events does not change gradually; compare the times of events, "
                          "event:NAME and event N:NAME",
                          o->text);
  }
  pw_outcomes_close (&set);
  return status;
}

static int data_along (const pw_fit *fit) {
  int count = 0;
  for (int i = 0; i < fit->columns; i++) count += fit->column_kind[i] == FIT_ALONG;
  return count;
}

/* Reads "COLUMN=VALUE" or "COLUMN=NAME" of --sigma. */
static int data_read_sigma (const pw_fit *fit, const char *text, fit_sigma *given, pw_error *error) {
  const int length = (int)strcspn (text, "="); /* of the column's name */
  const char *value = text + length + 1;
  int i = 0;
  if (text[length] == 0) return pw_fail (error, PW_INPUT, "--sigma %s: expected COLUMN=VALUE or COLUMN=NAME", text);
  while (i < fit->columns && (strncmp (fit->column_name[i], text, (size_t)length) != 0 || fit->column_name[i][length]))
    i++;
  if (i == fit->columns) return pw_fail (error, PW_INPUT, "--sigma %.*s: it is not among --columns", length, text);
  if (given[i].text) return pw_fail (error, PW_INPUT, "--sigma %.*s is given twice", length, text);
  given[i] = (fit_sigma){ value, NAN };
  if (pw_read_expression (value, &given[i].number) == PW_OK && !(given[i].number > 0 && isfinite (given[i].number)))
    return pw_fail (error, PW_INPUT, "--sigma %s: expected a finite number > 0", text);
  return PW_OK;
}

/* Checks that standard deviations are given for all columns or, if all have the same unit, for none. */
static int data_check_sigma (pw_fit *fit, const fit_sigma *given, pw_error *error) {
  for (int i = 0; i < fit->columns; i++) fit->weighted |= given[i].text != NULL;
  for (int i = 0; i < fit->columns; i++) {
    if (fit->weighted && given[i].text == NULL)
      return pw_fail (error, PW_INPUT, "--sigma is given for other columns, but not for %s", fit->column_name[i]);
    if (!fit->weighted && strcmp (fit->column_unit[i], fit->column_unit[0]) != 0)
      return pw_fail (error, PW_INPUT,
                      "%s [%s] and %s [%s] have different units: add --sigma COLUMN=VALUE for each column",
                      fit->column_name[0], fit->column_unit[0], fit->column_name[i], fit->column_unit[i]);
  }
  return PW_OK;
}

#define FIT_TIMES "--data %s: its times, from %.15g to %.15g s,"

/* Refuses times that are not those of the run, which does not begin before 0. */
static int data_check_times (const pw_fit *fit, pw_error *error) {
  const double t_end = fit->t_end, first = fit->first, last = fit->last;
  if (first < 0)
    return pw_fail (error, PW_INPUT, FIT_TIMES " begin before the run: --time-offset %.15g lets them begin at 0",
                    fit->data_path, first, last, -first);
  if (first > t_end)
    return pw_fail (error, PW_INPUT,
                    FIT_TIMES " are after the run, which ends at %.6g s: give --t-end, or --time-offset %.15g, which "
                              "lets them begin at 0",
                    fit->data_path, first, last, t_end, -first);
  if (last > FIT_LONGER * t_end && fit->line.t_end.text == NULL)
    return pw_fail (error, PW_INPUT,
                    FIT_TIMES " last far longer than the run, which ends at %.6g s: give --time-scale 1e-3 if they are "
                              "in ms, else --t-end",
                    fit->data_path, first, last, t_end);
  return PW_OK;
}

static void data_report (const pw_fit *fit) {
  const double t_end = fit->t_end, covered = fmin (fit->last, t_end) - fit->first;
  int empty = 0;
  if (fit->timed == 0) return;
  for (int i = 0; i < fit->columns * fit->rows; i++)
    empty += fit->column_kind[i / fit->rows] == FIT_ALONG && i % fit->rows < fit->timed && isnan (fit->data[i]);
  if (covered < 0.9 * t_end || (fit->last > t_end * (1 + 1e-9) && fit->line.t_end.text == NULL))
    pw_cli_say ("pinwheel: " FIT_TIMES " cover %.3g %% of the run, which ends at %.6g s%s\n", fit->data_path,
                fit->first, fit->last, 100 * covered / t_end, t_end,
                fit->line.t_end.text || data_along (fit) < fit->columns ? "" : "; runs end at the last datum");
  if (empty || fit->untimed || fit->late)
    pw_cli_say ("pinwheel: --data %s: left out are %s, %s without a time, %s after --t-end\n", fit->data_path,
                PW_COUNTED (empty, "empty cell"), PW_COUNTED (fit->untimed, "row"), PW_COUNTED (fit->late, "row"));
}

/* Converts times to seconds.  time: 1 for a column with times, of rows or events, or with their deviations. */
static void data_convert_times (pw_fit *fit, double *table, const unsigned char *time, int columns) {
  const double scale = pw_cli_given_or (fit->time_scale, 1), offset = fit->time_offset.number;
  for (int i = 0; i < columns * fit->rows; i++) {
    const int column = i / fit->rows;
    if (time[column]) table[i] = scale * (table[i] + (column > fit->columns ? 0 : offset / scale));
  }
}

static int data_is_along (const pw_fit *fit, int j) {
  return j > 0 && j <= fit->columns && fit->column_kind[j - 1] == FIT_ALONG;
}

/* Copies the rows of the table that have a time, up to --t-end; after them, if there are outputs, the others without
 * time and data along the run. */
static int data_keep_rows (pw_fit *fit, const double *table, int columns, pw_error *error) {
  const double t_end = fit->line.t_end.text ? fit->t_end * (1 + 1e-9) : INFINITY;
  const int rows = fit->rows, along = data_along (fit), outputs = along < fit->columns;
  int with_time = 0;
  fit->table = pw_arena_alloc (&fit->line.arena, (size_t)columns * (size_t)rows * sizeof *table);
  if (fit->table == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < rows; i++) {
    int is_along = 0; /* 1: the row has a datum along the run */
    for (int j = 1; j <= fit->columns; j++) is_along |= data_is_along (fit, j) && !isnan (table[j * rows + i]);
    if (table[i] <= t_end)
      fit->timed++;
    else if (!outputs || is_along)
      ++*(isnan (table[i]) ? &fit->untimed : &fit->late);
    if (isnan (table[i])) continue;
    if (with_time++ == 0) fit->first = table[i];
    fit->last = table[i];
  }
  if (outputs == 0) fit->rows = fit->timed;
  for (int i = 0, next[2] = { 0, fit->timed }; i < rows; i++) {
    const int other = !(table[i] <= t_end);
    if (other && !outputs) continue;
    double *to = fit->table + next[other]++;
    for (int j = 0; j < columns; j++)
      to[j * fit->rows] = other && (j == 0 || data_is_along (fit, j)) ? NAN : table[j * rows + i];
  }
  if (rows == 0 || (along && with_time == 0)) return pw_fail (error, PW_INPUT, "--data %s: no rows", fit->data_path);
  return along ? data_check_times (fit, error) : PW_OK;
}

/* Reads times, data, and columns of standard deviations.  Outputs alone need no times. */
static int data_read_table (pw_fit *fit, const fit_sigma *given, pw_error *error) {
  const size_t most = 1 + 2 * (size_t)fit->columns;
  const char **column = pw_arena_alloc (&fit->line.arena, 2 * most * sizeof *column);
  unsigned char *time = pw_arena_alloc (&fit->line.arena, most);
  const int along = data_along (fit);
  int count = 1;
  if (column == NULL || time == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const char **unit = column + most;
  column[0] = !along ? fit->column_name[0] : fit->time_name ? fit->time_name : "t", unit[0] = along ? "s" : NULL;
  time[0] = 1;
  for (int i = 0; i < fit->columns; i++, count++) {
    column[count] = fit->column_name[i], unit[count] = fit->column_unit[i];
    time[count] = fit->column_kind[i] == FIT_EVENT;
  }
  for (int i = 0; i < fit->columns; i++)
    if (isnan (given[i].number))
      column[count] = given[i].text, time[count] = time[1 + i], unit[count++] = fit->column_unit[i];
  double *table = pw_read_columns (fit->data_path, column, unit, count, NULL, &fit->rows, error);
  int status = table ? PW_OK : error->status;
  if (table) data_convert_times (fit, table, time, count);
  for (int i = 0; i < fit->rows && status == PW_OK && !along; i++) table[i] = NAN;
  if (status == PW_OK) status = data_keep_rows (fit, table, count, error);
  free (table);
  return status;
}

/* Reads the data, sets the standard deviation of each datum, which must be positive, and counts the data. */
static int fit_read_data (pw_fit *fit, pw_error *error) {
  if (data_read_columns (fit, error) != PW_OK) return error->status;
  fit_sigma *given = pw_arena_alloc (&fit->line.arena, (size_t)fit->columns * sizeof *given);
  int status = given ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (const char **text = fit->sigma_texts; status == PW_OK && text && *text; text++)
    status = data_read_sigma (fit, *text, given, error);
  if (status == PW_OK) status = data_check_sigma (fit, given, error);
  if (status == PW_OK) status = data_read_table (fit, given, error);
  if (status != PW_OK) return status;
  const int rows = fit->rows, cells = fit->columns * rows;
  fit->t = fit->table, fit->data = fit->table + rows;
  fit->sigma = pw_arena_alloc (&fit->line.arena, (size_t)cells * sizeof *fit->sigma);
  if (fit->sigma == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const double *next = fit->data + cells; /* columns of standard deviations */
  for (int i = 0; i < cells; i++) {
    const fit_sigma *of = given + i / rows;
    fit->sigma[i] = isnan (of->number) ? *next++ : of->text ? of->number : 1;
    if (isnan (fit->data[i])) continue;
    fit->residuals++;
    if (!(fit->sigma[i] > 0))
      return pw_fail (error, PW_INPUT, "--data %s: the standard deviation of %s%s is %g; expected a number > 0",
                      fit->data_path, fit->column_name[i / rows],
                      i % rows < fit->timed ? PW_PRINTED (40, " at t = %g s", fit->t[i % rows]) : "", fit->sigma[i]);
    if (fit->column_kind[i / rows] == FIT_EVENT && fit->data[i] > fit->t_end)
      return pw_fail (error, PW_INPUT, "--data %s: %s at %.9g s is after the run, which ends at %.6g s: give --t-end",
                      fit->data_path, fit->column_name[i / rows], fit->data[i], fit->t_end);
  }
  return PW_OK;
}

/* ---- Runs: the model's values at the times of the data, and derivatives of these values ---- */

#define FIT_RTOL 1e-8 /* largest relative tolerance of runs that are compared */

/* Runs the model with these values of the unknowns, with its own settings, or if rtol > 0 with this tolerance; out:
 * columns x rows, 0 where a row has no datum of an output.  A status; PW_RETRY after Ctrl-C. */
static int fit_run (const pw_fit *fit, const double *unknowns, double rtol, double *out, pw_error *error) {
  const size_t columns = (size_t)fit->columns, timed = (size_t)fit->timed;
  double *value = malloc (columns * (1 + timed) * sizeof *value), *along = value + columns;
  const pw_run_outputs outputs = { .unknowns = &fit->unknowns,
                                   .method = rtol > 0 ? fit->unknowns.method : NULL,
                                   .rtol = rtol,
                                   .option = "--columns",
                                   .of = fit->column_name,
                                   .count = fit->columns,
                                   .t = fit->timed ? fit->t : NULL,
                                   .rows = fit->timed };
  int status = value ? pw_run_outputs_at (&outputs, unknowns, value, along, error)
                     : pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < fit->columns * fit->rows && status == PW_OK; i++) {
    const int c = i / fit->rows, row = i % fit->rows, known = !isnan (fit->data[i]);
    if (fit->column_kind[c] == FIT_ALONG)
      out[i] = row < fit->timed ? along[c * fit->timed + row] : 0;
    else
      out[i] = known ? value[c] : 0;
    if (known && isnan (out[i]))
      status = pw_fail (error, PW_METHOD, "--columns %s: %s in the run to %.6g s", fit->column_name[c],
                        fit->column_kind[c] == FIT_EVENT ? "there is no such event" : "it has no value",
                        fit->unknowns.settings.span);
  }
  free (value);
  return status;
}

static int fit_own (void *fit, const double *x, double rtol, double *value, pw_error *error) {
  (void)rtol;
  return fit_run (fit, x, 0, value, error);
}

static int fit_accurate (void *fit, const double *x, double rtol, double *value, pw_error *error) {
  return fit_run (fit, x, rtol, value, error);
}

/* Derivatives of the model's values, `values` at these unknowns, with respect to each unknown: jacobian is unknowns x
 * (columns x rows).  By central differences of concurrent runs.  Sets fit->derivative_error.  A status; PW_RETRY after
 * Ctrl-C. */
static int fit_jacobian (pw_fit *fit, const double *unknowns, const double *values, double *jacobian, pw_error *error) {
  const int n = fit->unknowns.count, cells = fit->columns * fit->rows;
  const double own = pw_unknowns_noise (&fit->unknowns), noise = fmin (own, FIT_RTOL);
  pw_derivative *derivative = malloc ((size_t)n * (size_t)cells * sizeof *derivative);
  const pw_difference_settings d = { .evaluate = noise < own ? fit_accurate : fit_own,
                                     .context = fit,
                                     .outputs = cells,
                                     .rtol = noise,
                                     .neighbours = 2,
                                     .value = noise < own ? NULL : values,
                                     .jobs = fit->jobs };
  int status = derivative ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = pw_unknowns_differentiate (&fit->unknowns, unknowns, d, derivative, error);
  for (int i = 0; i < n * cells && status == PW_OK; i++) jacobian[i] = derivative[i].value;
  for (int j = 0; j < n; j++) fit->derivative_error[j] = pow (noise, 2. / 3);
  fit->runs += 2 * (long)n;
  free (derivative);
  return status;
}

/* The solution of a least-squares fit, by GSL's Levenberg-Marquardt method, and the errors of the estimate.
 *
 * The method does not know bounds: it varies a vector u, and the value of an unknown is (James & Roos 1975, MINUIT)
 *
 *   low + (high - low) (1 + sin u) / 2      between two bounds
 *   low + scale (sqrt (1 + u^2) - 1)        above a lower bound
 *   scale u                                 without bounds */

/* An unknown has no effect if the norm of its column of the Jacobian, times its scale, relative to the largest such
 * product, is below this. */
#define SOLVE_EFFECT 1e-9
#define SOLVE_GRADIENT 1e-4 /* largest cosine between the residuals and a column of the Jacobian at a minimum */
#define SOLVE_RANK 1e-6  /* singular values of the scaled Jacobian count as 0 below it, relative to the largest one */
#define SOLVE_EXACT 1e-8 /* norm of the residuals of an exact fit, relative to the initial one */
#define SOLVE_ROUND_OFF 1e-12 /* the same, relative to the norm of the data: round-off of a run */
#define SOLVE_TOLERANCE 1e-10 /* of GSL: relative step in u, and gradient */
enum { SOLVE_ITERATIONS = 100 /* of a search, at most */, SOLVE_USUAL = 20 /* to show progress */ };

typedef struct {
  pw_fit *fit;
  double *u;          /* unknowns: where a search begins and ends */
  double *last_value; /* unknowns: in the last run */
  double *values;     /* columns x rows: of the model, in the last run */
  double *jacobian;   /* unknowns x (columns x rows) */
  int known;          /* 1: the last run succeeded */
  int status;         /* PW_OK, or else the fit ends, with `error` */
  pw_error *error;
  int searches; /* that have ended */
  double worst; /* largest norm of the residuals of the runs of this search that succeeded */
  double least; /* sum of squares at the best end of a search, fit->estimate; INFINITY: none is completed yet */
} fit_solver;

/* ---- Bounds: an unknown with an upper bound has a lower one, too ---- */

static double solve_value (const pw_unknown *unknown, double u) {
  if (isfinite (unknown->high)) return unknown->low + (unknown->high - unknown->low) * (1 + sin (u)) / 2;
  if (isfinite (unknown->low)) return unknown->low + unknown->scale * (sqrt (1 + u * u) - 1);
  return u * unknown->scale;
}

/* The derivative of the value with respect to u. */
static double solve_slope (const pw_unknown *unknown, double u) {
  if (isfinite (unknown->high)) return (unknown->high - unknown->low) * cos (u) / 2;
  if (isfinite (unknown->low)) return unknown->scale * u / sqrt (1 + u * u);
  return unknown->scale;
}

/* u of a value where a search begins, moved away from bounds, at which solve_slope is 0. */
static double solve_start (const pw_unknown *unknown, double value) {
  double range = isfinite (unknown->high) ? unknown->high - unknown->low : unknown->scale,
         part = fmax ((value - unknown->low) / range, FIT_MARGIN);
  if (isfinite (unknown->high)) return asin (2 * fmin (part, 1 - FIT_MARGIN) - 1);
  return isfinite (unknown->low) ? sqrt ((1 + part) * (1 + part) - 1) : value / unknown->scale;
}

/* ---- The search: residuals, minimum, errors of the estimates ---- */

/* Ends the fit if memory is short, after Ctrl-C, or if what failed is `essential`: no search can do without it. */
static void solve_fail (fit_solver *solver, int essential, const pw_error *error, int status) {
  if (status == PW_OK || !(essential || status == PW_RETRY || status == PW_RESOURCE)) return;
  solver->status = status;
  *solver->error = *error;
}

/* The sum of squares of (values - data) / sigma, or of data / sigma if `values` is NULL. */
static double solve_sum (const pw_fit *fit, const double *values) {
  double sum = 0;
  for (int i = 0; i < fit->columns * fit->rows; i++)
    if (!isnan (fit->data[i])) sum += pow (((values ? values[i] : 0) - fit->data[i]) / fit->sigma[i], 2);
  return sum;
}

/* Runs the model at u, unless the last run was there.  If the first run of the fit fails, the fit ends.  A status. */
static int solve_run (fit_solver *solver, const gsl_vector *u) {
  pw_fit *fit = solver->fit;
  int same = solver->known;
  pw_error own = { 0 };
  for (int i = 0; i < fit->unknowns.count; i++) {
    double value = solve_value (fit->unknowns.list + i, gsl_vector_get (u, (size_t)i));
    same &= value == solver->last_value[i];
    solver->last_value[i] = value;
  }
  if (same) return PW_OK;
  int status = fit_run (fit, solver->last_value, 0, solver->values, &own);
  if (status == PW_OK && !isfinite (solve_sum (fit, solver->values)))
    status = pw_fail (&own, PW_METHOD, "the sum of the squares of the residuals is not finite");
  solver->known = status == PW_OK;
  fit->runs++;
  solve_fail (solver, fit->runs == 1, &own, status);
  return status;
}

/* The residuals (model - data) / sigma.  They are large for a run that failed, so that GSL tries a shorter step. */
static int solve_residuals (const gsl_vector *u, void *context, gsl_vector *f) {
  fit_solver *solver = context;
  const pw_fit *fit = solver->fit;
  int failed = solve_run (solver, u) != PW_OK;
  if (solver->status != PW_OK) return GSL_EBADFUNC;
  for (int i = 0, k = 0; i < fit->columns * fit->rows; i++) {
    if (isnan (fit->data[i])) continue;
    double residual = failed ? 10 * solver->worst + 1 : (solver->values[i] - fit->data[i]) / fit->sigma[i];
    gsl_vector_set (f, (size_t)k++, residual);
  }
  if (!failed) solver->worst = fmax (solver->worst, sqrt (solve_sum (fit, solver->values)));
  return GSL_SUCCESS;
}

/* Derivatives of the residuals with respect to u at u; or if u is NULL, with respect to the unknowns at the estimate.
 * Without derivatives a search ends; the fit ends if no search is completed. */
static int solve_derivatives (const gsl_vector *u, void *context, gsl_matrix *J) {
  fit_solver *solver = context;
  pw_fit *fit = solver->fit;
  int cells = fit->columns * fit->rows;
  pw_error own = { 0 };
  if (u && solve_run (solver, u) != PW_OK) return GSL_EBADFUNC;
  const double *value = u ? solver->last_value : fit->estimate, *values = u ? solver->values : fit->fitted;
  int status = fit_jacobian (fit, value, values, solver->jacobian, &own);
  solve_fail (solver, u == NULL || !isfinite (solver->least), &own, status);
  if (status != PW_OK) return GSL_EBADFUNC;
  for (int j = 0; j < fit->unknowns.count; j++) {
    double slope = u ? solve_slope (fit->unknowns.list + j, gsl_vector_get (u, (size_t)j)) : 1;
    for (int i = 0, k = 0; i < cells; i++)
      if (!isnan (fit->data[i]))
        gsl_matrix_set (J, (size_t)k++, (size_t)j,
                        solver->jacobian[(size_t)j * (size_t)cells + (size_t)i] * slope / fit->sigma[i]);
  }
  return GSL_SUCCESS;
}

static void solve_store (fit_solver *solver, double chi2) {
  pw_fit *fit = solver->fit;
  fit->chi2 = chi2;
  memcpy (fit->estimate, solver->last_value, (size_t)fit->unknowns.count * sizeof *fit->estimate);
  memcpy (fit->fitted, solver->values, (size_t)fit->columns * (size_t)fit->rows * sizeof *fit->fitted);
}

/* After iteration i.  `moved`: 1 if the last run is the position reached, the result if Ctrl-C comes before a search is
 * completed. */
static void solve_progress (fit_solver *solver, int i, int moved, const gsl_multifit_nlinear_workspace *w) {
  const double norm = gsl_blas_dnrm2 (gsl_multifit_nlinear_residual (w)), usual = SOLVE_USUAL,
               part = i < usual ? 0.9 * i / usual : 1 - 0.1 * usual / i; /* of the search that is done */
  if (isnan (solver->fit->initial_chi2)) solver->fit->initial_chi2 = norm * norm;
  if (!isfinite (solver->least) && moved) solve_store (solver, norm * norm);
  snprintf (solver->fit->progress.note, sizeof solver->fit->progress.note, "iteration %d, residual %.6g",
            solver->fit->iterations, norm);
  pw_progress_at (&solver->fit->progress, (solver->searches + part) / solver->fit->starts);
}

/* Iterates from u, where the last run was made.  Unlike gsl_multifit_nlinear_driver, it ends when derivatives cannot be
 * evaluated (GSL_EBADFUNC).  An iteration that rejects many steps (GSL_ENOPROG) ends the search only if it is the
 * first: the next one begins with a new damping parameter. */
static int solve_iterate (fit_solver *solver, gsl_vector *u, gsl_multifit_nlinear_fdf *f,
                          gsl_multifit_nlinear_workspace *w) {
  int info, status = gsl_multifit_nlinear_init (u, f, w), more = status == GSL_SUCCESS;
  if (more) solve_progress (solver, 0, 1, w);
  for (int i = 1; i <= SOLVE_ITERATIONS && more; i++) {
    status = gsl_multifit_nlinear_iterate (w);
    if (solver->status != PW_OK) break;
    solver->fit->iterations++;
    if (status != GSL_SUCCESS && (status != GSL_ENOPROG || i == 1)) break;
    solve_progress (solver, i, status == GSL_SUCCESS, w);
    more = gsl_multifit_nlinear_test (SOLVE_TOLERANCE, SOLVE_TOLERANCE, 0, &info, w) == GSL_CONTINUE;
  }
  return status;
}

/* Stores where a search has ended, perhaps without converging: sum of squares, values.  The best end is the result. */
static void solve_keep (fit_solver *solver, double *end) {
  *end = solve_sum (solver->fit, solver->values);
  memcpy (end + 1, solver->last_value, (size_t)solver->fit->unknowns.count * sizeof *solver->last_value);
  if (!(*end < solver->least)) return;
  solver->least = *end;
  solve_store (solver, *end);
}

/* A search from the values in end + 1, which its result replaces, see fit->ends; *end is INFINITY without a result. */
static void solve_search (fit_solver *solver, gsl_multifit_nlinear_workspace *w, double *end) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count;
  gsl_multifit_nlinear_fdf f = {
    .f = solve_residuals, .df = solve_derivatives, .n = (size_t)fit->residuals, .p = n, .params = solver
  };
  gsl_vector_view view = gsl_vector_view_array (solver->u, n);
  gsl_vector *u = &view.vector;
  for (size_t i = 0; i < n; i++) solver->u[i] = solve_start (fit->unknowns.list + i, end[1 + i]);
  *end = INFINITY;
  solver->worst = 0;
  if (solve_run (solver, u) != PW_OK) return;
  int status = solve_iterate (solver, u, &f, w);
  if (solver->status != PW_OK) return;
  if (status != GSL_SUCCESS && status != GSL_ENOPROG) return;
  gsl_vector_memcpy (u, gsl_multifit_nlinear_position (w));
  if (solve_run (solver, u) == PW_OK) solve_keep (solver, end);
}

static void solve_searches (fit_solver *solver) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count, starts = (size_t)fit->starts;
  const gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters ();
  gsl_multifit_nlinear_workspace *w =
      gsl_multifit_nlinear_alloc (gsl_multifit_nlinear_trust, &parameters, (size_t)fit->residuals, n);
  double *start = pw_unknowns_starts (&fit->unknowns, fit->starts, 1);
  fit->ends = pw_arena_alloc (&fit->line.arena, starts * (1 + n) * sizeof *fit->ends);
  if (w == NULL || start == NULL || fit->ends == NULL)
    solver->status = pw_fail (solver->error, PW_RESOURCE, "out of memory");
  solver->least = INFINITY;
  for (size_t i = 0; i < starts && solver->status == PW_OK; i++) {
    fit->ends[i * (1 + n)] = INFINITY;
    memcpy (fit->ends + i * (1 + n) + 1, start + i * n, n * sizeof *start);
  }
  for (; solver->searches < fit->starts && solver->status == PW_OK; solver->searches++)
    solve_search (solver, w, fit->ends + (size_t)solver->searches * (1 + n));
  free (start);
  if (w) gsl_multifit_nlinear_free (w);
  if (solver->status == PW_OK && !isfinite (solver->least))
    solver->status = pw_fail (solver->error, PW_METHOD,
                              "no search could be completed; begin nearer to a minimum, by --set or --start");
}

/* Scales the columns of J to length 1, or to 0 for an unknown without effect. */
static void solve_scale (pw_fit *fit, gsl_matrix *J) {
  double largest = 0, *length = fit->column_length;
  int n = fit->unknowns.count;
  for (int j = 0; j < n; j++) {
    gsl_vector_view column = gsl_matrix_column (J, (size_t)j);
    length[j] = gsl_blas_dnrm2 (&column.vector);
    largest = fmax (largest, length[j] * fit->unknowns.list[j].scale);
  }
  for (int j = 0; j < n; j++) {
    gsl_vector_view column = gsl_matrix_column (J, (size_t)j);
    if (!(length[j] * fit->unknowns.list[j].scale > SOLVE_EFFECT * largest)) length[j] = 0;
    gsl_vector_scale (&column.vector, length[j] > 0 ? 1 / length[j] : 0);
  }
}

/* At a minimum the residuals are very small or orthogonal to the columns of J, which have length 1; unknowns at a bound
 * do not count. */
static int solve_converged (const pw_fit *fit, const gsl_matrix *J) {
  double norm = sqrt (fit->chi2);
  int orthogonal = 1;
  for (int j = 0; j < fit->unknowns.count; j++) {
    const pw_unknown *unknown = fit->unknowns.list + j;
    double dot = 0, near = FIT_MARGIN * unknown->scale;
    if (fit->estimate[j] - unknown->low < near || unknown->high - fit->estimate[j] < near) continue;
    for (int i = 0, k = 0; i < fit->columns * fit->rows; i++)
      if (!isnan (fit->data[i]))
        dot += gsl_matrix_get (J, (size_t)k++, (size_t)j) * (fit->fitted[i] - fit->data[i]) / fit->sigma[i];
    orthogonal &= fabs (dot) <= fmax (SOLVE_GRADIENT, fit->derivative_error[j]) * norm;
  }
  return orthogonal ||
         norm < fmax (SOLVE_EXACT * sqrt (fit->initial_chi2), SOLVE_ROUND_OFF * sqrt (solve_sum (fit, NULL)));
}

/* J D^-1 = U S V^T, where D has the lengths of the columns of J: the covariance of the unknowns is
 * variance D^-1 V S^-2 V^T D^-1, over the singular values that differ from 0.  The variance of the residuals is 1 if
 * standard deviations are given, else it is estimated. */
static void solve_covariance (pw_fit *fit) {
  const double *length = fit->column_length;
  int n = fit->unknowns.count;
  double error = 0;
  for (int j = 0; j < n; j++) error = fmax (error, fit->derivative_error[j]);
  double least = fmax (SOLVE_RANK, 10 /* a margin */ * error) * fit->singular_value[0];
  for (fit->rank = 0; fit->rank < n && fit->singular_value[fit->rank] > least;) fit->rank++;
  int freedom = fit_degrees_of_freedom (fit);
  double variance = fit->weighted ? 1 : freedom > 0 ? fit->chi2 / freedom : NAN;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      double sum = 0;
      for (int k = 0; k < fit->rank; k++)
        sum += fit->singular_vector[i * n + k] * fit->singular_vector[j * n + k] /
               (fit->singular_value[k] * fit->singular_value[k]);
      fit->covariance[i * n + j] = length[i] > 0 && length[j] > 0 ? variance * sum / (length[i] * length[j]) : 0;
    }
  for (int i = 0; i < n; i++) {
    fit->standard_error[i] = sqrt (fit->covariance[i * n + i]);
    for (int k = fit->rank; k < n; k++)
      if (fabs (fit->singular_vector[i * n + k]) > FIT_COMPONENT) fit->standard_error[i] = INFINITY;
  }
}

static void solve_errors (fit_solver *solver) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count;
  gsl_matrix *J = gsl_matrix_alloc ((size_t)fit->residuals, n);
  gsl_matrix_view V = gsl_matrix_view_array (fit->singular_vector, n, n);
  gsl_vector_view S = gsl_vector_view_array (fit->singular_value, n);
  if (J == NULL) solver->status = pw_fail (solver->error, PW_RESOURCE, "out of memory");
  if (J && solve_derivatives (NULL, solver, J) == GSL_SUCCESS) {
    solve_scale (fit, J);
    fit->converged = solve_converged (fit, J);
    gsl_linalg_SV_decomp_jacobi (J, &V.matrix, &S.vector);
    solve_covariance (fit);
  }
  if (J) gsl_matrix_free (J);
}

static int solve_open (fit_solver *solver) {
  pw_fit *fit = solver->fit;
  size_t n = (size_t)fit->unknowns.count, cells = (size_t)fit->columns * (size_t)fit->rows;
  solver->last_value = pw_arena_alloc (&fit->line.arena, (2 * n + (1 + n) * cells) * sizeof *solver->last_value);
  fit->estimate = pw_arena_alloc (&fit->line.arena, (5 * n + 2 * n * n + cells) * sizeof *fit->estimate);
  if (solver->last_value == NULL || fit->estimate == NULL) return pw_fail (solver->error, PW_RESOURCE, "out of memory");
  solver->u = solver->last_value + n, solver->values = solver->u + n, solver->jacobian = solver->values + cells;
  fit->standard_error = fit->estimate + n, fit->singular_value = fit->standard_error + n,
  fit->column_length = fit->singular_value + n, fit->derivative_error = fit->column_length + n;
  fit->covariance = fit->derivative_error + n;
  fit->singular_vector = fit->covariance + n * n, fit->fitted = fit->singular_vector + n * n;
  /* the errors are not known until solve_covariance; nor are combinations of unknowns that are not determined */
  for (size_t i = 0; i < n; i++) fit->standard_error[i] = NAN;
  for (size_t i = 0; i < n * n; i++) fit->covariance[i] = NAN;
  fit->rank = fit->unknowns.count;
  return PW_OK;
}

/* Minimises the sum of squares from all starts and sets the results.  A status; PW_RETRY after Ctrl-C. */
static int fit_solve (pw_fit *fit, pw_error *error) {
  fit_solver solver = { .fit = fit, .error = error };
  fit->initial_chi2 = NAN;
  pw_stop_catch ();
  pw_progress_start (&fit->progress, pw_file_name (fit->line.m.file), "", 0, 1);
  solver.status = solve_open (&solver);
  if (solver.status == PW_OK) solve_searches (&solver);
  if (solver.status == PW_OK) solve_errors (&solver);
  pw_progress_end (&fit->progress);
  pw_stop_release ();
  return solver.status;
}

/* ---- Reports: text, files, the figure ---- */

enum {
  REPORT_DIGITS = 7,
  REPORT_CORRELATIONS = 9, /* unknowns whose correlations fit in a line, at most */
  REPORT_PANELS = 4        /* of a figure, at most: one for each column */
};

static double report_covariance (const pw_fit *fit, int i, int j) {
  return fit->covariance[i * fit->unknowns.count + j];
}

/* NaN if either unknown is not determined. */
static double report_correlation (const pw_fit *fit, int i, int j) {
  double size = sqrt (report_covariance (fit, i, i) * report_covariance (fit, j, j));
  return size > 0 && isfinite (fit->standard_error[i]) && isfinite (fit->standard_error[j])
             ? report_covariance (fit, i, j) / size
             : NAN;
}

/* The lower (side -1) or upper (side 1) end of the confidence interval of unknown i, from the normal distribution if
 * standard deviations are given, else from Student's; NaN if there is none. */
static double report_interval_end (const pw_fit *fit, int i, int side) {
  const double tail = (1 - fit->confidence) / 2,
               quantile = fit->weighted ? gsl_cdf_gaussian_Qinv (tail, 1)
                                        : gsl_cdf_tdist_Qinv (tail, fmax (fit_degrees_of_freedom (fit), 1));
  return isfinite (fit->standard_error[i]) ? fit->estimate[i] + side * quantile * fit->standard_error[i] : NAN;
}

/* "at its lower bound", "at its upper bound"; "" if the estimate of unknown i is at neither. */
static const char *report_bound (const pw_fit *fit, int i) {
  const pw_unknown *unknown = fit->unknowns.list + i;
  const double value = fit->estimate[i], near = FIT_MARGIN * unknown->scale;
  return value - unknown->low < near ? "at its lower bound" : unknown->high - value < near ? "at its upper bound" : "";
}

/* The root mean square of model - data in a column, and the number of its data. */
static double report_rms (const pw_fit *fit, int column, int *count) {
  double sum = 0;
  *count = 0;
  for (int k = column * fit->rows; k < (column + 1) * fit->rows; k++)
    if (!isnan (fit->data[k])) sum += pow (fit->fitted[k] - fit->data[k], 2), ++*count;
  return sqrt (sum / *count);
}

static void report_unknowns (const pw_fit *fit) {
  const char *from = PW_PRINTED (80, "%g %% confidence:  from", 100 * fit->confidence);
  const char *const head[] = { "free", "initially", "estimate", "standard error", from, "to", NULL };
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_head (&t, -12, 12, head);
    for (int i = 0; i < fit->unknowns.count; i++) {
      pw_cell_unit (&t, -12, fit->unknowns.list[i].name, fit->unknowns.list[i].unit);
      pw_cell_number (&t, 12, fit->unknowns.list[i].value, REPORT_DIGITS);
      pw_cell_number (&t, 12, fit->estimate[i], REPORT_DIGITS);
      pw_cell_number (&t, 12, isfinite (fit->standard_error[i]) ? fit->standard_error[i] : NAN, 3);
      pw_cell_number (&t, 12, report_interval_end (fit, i, -1), REPORT_DIGITS);
      pw_cell_number (&t, 12, report_interval_end (fit, i, 1), REPORT_DIGITS);
      pw_cell (&t, -1, isinf (fit->standard_error[i]) ? "not determined by the data" : report_bound (fit, i));
      pw_row_end (&t);
    }
  }
}

static void report_correlations (const pw_fit *fit) {
  int n = fit->unknowns.count;
  if (n < 2 || n > REPORT_CORRELATIONS) return;
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < n; i++) {
      pw_cell (&t, -12, i ? fit->unknowns.list[i].name : "correlations");
      for (int j = 0; j < n - 1; j++)
        if (i == 0)
          pw_cell (&t, 8, fit->unknowns.list[j].name);
        else if (j < i)
          pw_cell_number (&t, 8, round (1e4 * report_correlation (fit, i, j)) / 1e4 + 0 /* not -0 */, 4);
      pw_row_end (&t);
    }
}

static void report_columns (const pw_fit *fit) {
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -12, "data");
    pw_head (&t, 8, 12, (const char *[]){ "number", "rms residual", NULL });
    for (int i = 0; i < fit->columns; i++) {
      int count;
      double rms = report_rms (fit, i, &count);
      pw_cell_unit (&t, -12, fit->column_name[i], fit->column_unit[i]);
      pw_cell_number (&t, 8, count, 9);
      pw_cell_number (&t, 12, rms, 4);
      pw_row_end (&t);
    }
  }
}

/* 1 if unknown i belongs to a combination, the singular vector of this number. */
static int report_contains (const pw_fit *fit, int combination, int i) {
  return fabs (fit->singular_vector[i * fit->unknowns.count + combination]) > FIT_COMPONENT;
}

/* Prints combinations of unknowns that change no model value: singular vectors with the singular value 0. */
static void report_undetermined (const pw_fit *fit) {
  for (int k = fit->rank; k < fit->unknowns.count; k++) {
    int count = 0;
    for (int i = 0; i < fit->unknowns.count; i++)
      if (report_contains (fit, k, i))
        pw_cli_print (stdout, "%s%s", count++ ? ", " : "\nThe data do not determine ", fit->unknowns.list[i].name);
    if (count == 1) {
      puts (", which has no effect");
      continue;
    }
    /* the ratio of the changes along the vector; the change of the first one is its estimate, or 1 if this is 0 */
    double scale = 0;
    for (int i = 0; i < fit->unknowns.count; i++) {
      double change = fit->singular_vector[i * fit->unknowns.count + k] / fit->column_length[i];
      if (!report_contains (fit, k, i)) continue;
      printf (scale != 0 ? " : " : ": changes in the ratio ");
      if (scale == 0) scale = (fit->estimate[i] != 0 ? fit->estimate[i] : 1) / change;
      printf ("%.3g", change * scale);
    }
    puts (" have no effect");
  }
}

/* 1 if a search ended at the estimate, up to round-off and the tolerances of searches. */
static int report_is_best (const pw_fit *fit, const double *end) {
  return *end <= fit->chi2 + 1e-6 * fit->chi2 + 1e-12 * fit->initial_chi2;
}

/* Prints how many searches ended at the estimate, and the best other end, where that search need not have converged. */
static void report_ends (const pw_fit *fit) {
  char options[PW_UNKNOWNS_OPTIONS];
  const double *next = NULL;
  int equal = 0;
  for (int i = 0; i < fit->starts; i++) {
    const double *end = fit->ends + i * (1 + fit->unknowns.count);
    equal += report_is_best (fit, end);
    if (!report_is_best (fit, end) && isfinite (*end) && (next == NULL || *end < *next)) next = end;
  }
  if (fit->starts > 1) printf ("%d of %d searches end at this estimate", equal, fit->starts);
  if (next && pw_unknowns_options (&fit->unknowns, next + 1, options))
    printf ("; the best other end is %.6g at %s", *next, options);
  if (fit->starts > 1) putchar ('\n');
}

static void fit_print (const pw_fit *fit) {
  char options[PW_UNKNOWNS_OPTIONS];
  int dof = fit_degrees_of_freedom (fit);
  report_unknowns (fit);
  report_columns (fit);
  if (fit->weighted)
    printf ("\nchi^2 %.6g with %s of freedom (initially %.6g); it is larger with probability %.2g\n", fit->chi2,
            PW_COUNTED (dof, "degree"), fit->initial_chi2, dof > 0 ? gsl_cdf_chisq_Q (fit->chi2, dof) : 1);
  else
    printf ("\nsum of squares %.6g with %s of freedom (initially %.6g)\n", fit->chi2, PW_COUNTED (dof, "degree"),
            fit->initial_chi2);
  report_correlations (fit);
  report_undetermined (fit);
  printf ("\n%s, %s, derivatives by differences of runs\n", PW_COUNTED (fit->runs, "run"),
          PW_COUNTED (fit->iterations, "iteration"));
  report_ends (fit);
  if (pw_unknowns_options (&fit->unknowns, fit->estimate, options)) printf ("\n%s\n", options);
}

static void report_json_matrix (const pw_fit *fit, pw_json *j, const char *key,
                                double (*entry) (const pw_fit *fit, int i, int j)) {
  int n = fit->unknowns.count;
  pw_json_open (j, key, '[');
  for (int i = 0; i < n; i++) {
    pw_json_open (j, NULL, '[');
    for (int k = 0; k < n; k++) pw_json_number (j, NULL, entry (fit, i, k));
    pw_json_close (j, ']');
  }
  pw_json_close (j, ']');
}

static void fit_json (const void *context, pw_json *j) {
  const pw_fit *fit = context;
  char options[PW_UNKNOWNS_OPTIONS];
  pw_json_print (j, "{schema: %d, model: %s, status: %s, data: %s, options: %s, method: %s", 1,
                 pw_file_name (fit->line.m.file), pw_results_word (&fit->line, fit->interrupted, fit->converged),
                 fit->data_path, pw_unknowns_options (&fit->unknowns, fit->estimate, options), fit->unknowns.method);
  pw_json_print (j, "residuals: %d, freedom: %d, weighted: %i, chi2: %g, confidence: %g, rank: %d, runs: %ld",
                 fit->residuals, fit_degrees_of_freedom (fit), fit->weighted, fit->chi2, fit->confidence, fit->rank,
                 fit->runs);
  pw_json_print (j, "derivatives: %s, iterations: %d, unknowns: [", "differences", fit->iterations);
  for (int i = 0; i < fit->unknowns.count; i++) {
    const pw_unknown *u = fit->unknowns.list + i;
    pw_json_print (j, "{name: %s, unit: %s, initial: %g, value: %g, standard_error: %g, from: %g, to: %g", u->name,
                   u->unit, u->value, fit->estimate[i], fit->standard_error[i], report_interval_end (fit, i, -1),
                   report_interval_end (fit, i, 1));
    if (fit->interrupted)
      pw_json_text (j, "determined", NULL);
    else
      pw_json_flag (j, "determined", !isinf (fit->standard_error[i]));
    pw_json_print (j, "bound: %i}", *report_bound (fit, i) != 0);
  }
  pw_json_print (j, "], columns: [");
  for (int i = 0; i < fit->columns; i++) {
    int count;
    double rms = report_rms (fit, i, &count);
    pw_json_print (j, "{name: %s, unit: %s, data: %d, rms: %g}", fit->column_name[i], fit->column_unit[i], count, rms);
  }
  pw_json_close (j, ']');
  report_json_matrix (fit, j, "covariance", report_covariance);
  report_json_matrix (fit, j, "correlation", report_correlation);
  const int n = fit->unknowns.count;
  pw_json_open (j, "searches", '[');
  for (const double *end = fit->ends; end < fit->ends + fit->starts * (1 + n); end += 1 + n) {
    pw_json_print (j, "{chi2: %g", *end);
    pw_json_numbers (j, "values", end + 1, n);
    pw_json_close (j, '}');
  }
  pw_json_print (j, "]}");
}

static void fit_table (const void *context, pw_cells *t) {
  const pw_fit *fit = context;
  static const char *const part[] = { "", ".model", ".residual", ".sigma" };
  if (fit->timed) pw_cells_name (t, "t", "s");
  for (int i = 0; i < fit->columns; i++)
    for (int k = 0; k < 4; k++)
      pw_cells_name (t, PW_PRINTED (300, "%s%s", fit->column_name[i], part[k]), fit->column_unit[i]);
  pw_cells_end (t);
  for (int row = 0; row < fit->rows; row++) {
    if (fit->timed) pw_cells_number (t, fit->t[row]);
    for (int i = 0; i < fit->columns; i++) {
      int k = i * fit->rows + row,
          known = !isnan (fit->data[k]) || (fit->column_kind[i] == FIT_ALONG && row < fit->timed);
      const double value[] = { fit->data[k], known ? fit->fitted[k] : NAN, fit->fitted[k] - fit->data[k],
                               fit->weighted && known ? fit->sigma[k] : NAN };
      for (int c = 0; c < 4; c++) pw_cells_number (t, value[c]);
    }
    pw_cells_end (t);
  }
}

/* Data and model of each column along the run, below them the residuals. */
static void fit_draw (const void *context, pw_curves *c) {
  const pw_fit *fit = context;
  const int along = data_along (fit), several = along > 1;
  const char *style = fit->weighted ? "bars" : "data", *label = fit->weighted ? "data ± σ" : "data";
  for (int i = 0, panels = 0; i < fit->columns && panels < REPORT_PANELS; i++) {
    if (fit->column_kind[i] != FIT_ALONG) continue;
    panels++;
    const double *t = fit->t, *data = fit->data + i * fit->rows, *fitted = fit->fitted + i * fit->rows,
                 *sigma = fit->sigma + i * fit->rows;
    pw_panel panel = { .x_label = "t [s]",
                       .y_label = PW_FIGURE_LABEL (fit->column_name[i], fit->column_unit[i]),
                       .x = { t[0], t[fit->timed - 1] },
                       .aspect = several ? 0.6 : 0.45,
                       .type = several ? PW_PANEL_HALF : 0 };
    pw_curves_panel (c, &panel);
    pw_curves_add (c, style, label);
    for (int k = 0; k < fit->timed; k++) pw_curves_point (c, t[k], data[k], sigma[k]);
    pw_curves_add (c, "model", "model");
    for (int k = 0; k < fit->timed; k++) pw_curves_point (c, t[k], fitted[k], 0);
    panel.y_label = "residual", panel.type |= PW_PANEL_BELOW, panel.aspect *= 0.6;
    pw_curves_panel (c, &panel);
    pw_curves_add (c, style, label);
    for (int k = 0; k < fit->timed; k++) pw_curves_point (c, t[k], fitted[k] - data[k], sigma[k]);
  }
}

/* ---- The command ---- */

#define FIT_RUNS 50. /* usual number of runs of a search, to choose the engine */

static const pw_results fit_results = {
  .name = "fit",
  .title = "data and fitted model",
  .lines = 2,
  .table = fit_table,
  .json = fit_json,
  .draw = fit_draw,
};

static int fit_options (pw_fit *fit, pw_error *error) {
  fit->confidence = pw_cli_given_or (fit->confidence_given, 0.95);
  fit->starts = (int)pw_cli_given_or (fit->starts_given, 1), fit->jobs = pw_parallel_jobs (&fit->line);
  if (fit->data_path == NULL) return pw_fail (error, PW_INPUT, "no data: add --data FILE.csv");
  if (fit->columns_text == NULL)
    return pw_fail (error, PW_INPUT, "nothing to compare: add --columns NAME,..., columns of the data such as frame.x");
  if (!(fit->confidence < 1))
    return pw_fail (error, PW_INPUT, "--confidence %s: expected a number between 0 and 1", fit->confidence_given.text);
  return PW_OK;
}

static int fit_open (pw_fit *fit, pw_error *error) {
  int status = fit_options (fit, error);
  if (status == PW_OK) status = pw_cli_open (&fit->line, error);
  if (status == PW_OK) status = pw_unknowns_open (&fit->unknowns, &fit->line, error);
  fit->t_end = fit->unknowns.settings.span;
  if (status == PW_OK) status = fit_read_data (fit, error);
  if (status == PW_OK) status = pw_unknowns_read (&fit->unknowns, "--free", fit->free, error);
  if (status != PW_OK) return status;
  if (fit->residuals < fit->unknowns.count)
    return pw_fail (error, PW_INPUT, "--data %s has fewer data (%d) than there are unknowns (%d)", fit->data_path,
                    fit->residuals, fit->unknowns.count);
  if (fit->line.plots && fit->timed == 0)
    return pw_fail (error, PW_INPUT, "--plots: a figure has curves over time, and none of --columns is one");
  /* runs end at the time of the last row, but those with outputs not before their final time */
  const double last = fit->timed ? fit->t[fit->timed - 1] : 0;
  fit->unknowns.settings.span = data_along (fit) == fit->columns ? last : fmax (last, fit->t_end);
  status = pw_unknowns_engine (&fit->unknowns, FIT_RUNS, fit->starts, error);
  if (status != PW_OK) return status;
  return pw_results_open (&fit->line, &fit_results, pw_cli_tables, (pw_use){ "--data", fit->data_path, PW_READS, NULL },
                          error);
}

static int fit_finish (pw_fit *fit, pw_error *error) {
  data_report (fit);
  fit_print (fit);
  pw_unknowns_report (&fit->unknowns, fit->estimate);
  int status = pw_results_write (&fit->line, &fit_results, fit, error);
  if (fit->interrupted) pw_cli_say ("pinwheel: interrupted; these are the values so far, without their errors\n");
  if (status == PW_OK && fit->interrupted) return PW_INTERRUPTED;
  if (status == PW_OK && !fit->converged)
    status = pw_fail (error, PW_METHOD, "no minimum was found in %s; begin nearer to it, by --set or --start",
                      PW_COUNTED (fit->iterations, "iteration"));
  return status;
}

static int fit_command (void *options, pw_error *error) {
  pw_fit *fit = options;
  int status = fit_open (fit, error);
  if (status == PW_OK) status = fit_solve (fit, error);
  fit->interrupted = status == PW_RETRY;
  if (fit->interrupted) status = fit->iterations > 0 ? PW_OK : PW_INTERRUPTED;
  if (status == PW_INTERRUPTED) pw_cli_say ("pinwheel: interrupted before the first iteration was done\n");
  if (status == PW_OK) status = fit_finish (fit, error);
  pw_unknowns_close (&fit->unknowns);
  return status;
}

static const struct poptOption fit_options_table[] = {
  PW_OPTION_GROUP ("Fit"),
  PW_TEXT_OPTION (
      pw_fit, data_path, "data", 0, "FILE.csv",
      "Measured data, used up to --t-end: a table with t and columns named as those of `run`, in any order and "
      "unit; empty cells and nan are gaps"),
  PW_TEXT_OPTION (pw_fit, time_name, "time", 0, "NAME", "Column of the times in the data (default t)"),
  PW_NUMBER_OPTION (pw_fit, time_scale, "time-scale", 0, "K", PW_POSITIVE, "Factor of these times, 1e-3 for ms"),
  PW_NUMBER_OPTION (pw_fit, time_offset, "time-offset", 0, "T", PW_REAL, "Added to the scaled times [s]"),
  PW_TEXT_OPTION (
      pw_fit, columns_text, "columns", 0, "NAME,...",
      "Columns of the data to compare with the model: columns of `run`; or, in any row, other outputs of a run, such "
      "as event:A, event 2:A, max:B.Fx"),
  PW_LIST_OPTION (
      pw_fit, free, "free", 0, "NAME[=LOW:HIGH[:log]]",
      "Determine a parameter or initial value, such as frame.vx, from the model's value on, within bounds or "
      "its domain; repeatable"),
  PW_LIST_OPTION (pw_fit, sigma_texts, "sigma", 0, "COLUMN=VALUE",
                  "Standard deviation of a column, a number or the name of a column of the data; repeatable"),
  PW_NUMBER_OPTION (pw_fit, confidence_given, "confidence", 0, "P", PW_POSITIVE,
                    "Probability of confidence intervals (default 0.95)"),
  PW_NUMBER_OPTION (
      pw_fit, starts_given, "starts", 0, "N", PW_COUNT,
      "Search from the model's values and from N - 1 points between the bounds, without bounds within the "
      "value's own size of it (default 1)"),
  PW_JOBS_OPTION ("Number of concurrent runs (default: one per processor)"),
  PW_RESULTS_OPTIONS ("Write data, model values and residuals", "Write a summary",
                      "Write figures of data, model and residuals"),
  PW_METHOD_OPTIONS,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_fit = {
  .name = "fit",
  .synopsis = "MODEL --data FILE.csv --columns NAME,... --free NAME[=LOW:HIGH]... [OPTION...]",
  .summary = "fit parameters and initial values to measured data",
  .help = "Determine parameters and initial values of a model by least squares, so that it agrees with measured data. "
          "Prints estimates with standard errors, confidence intervals and correlations, and unknowns that the data do "
          "not determine.",
  .options_size = sizeof (pw_fit),
  .function = fit_command,
  .options = fit_options_table,
};
