/* pinwheel fit: parameters and initial values with which a model agrees best with measured data. */
#define _POSIX_C_SOURCE 200809L
#include "fit.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "parallel.h"

/* ---- The data: columns of a table and their standard deviations ---- */

/* Standard deviation of a column: a number, or if that is NaN the name of a column; without text 1. */
typedef struct {
  const char *text;
  double number;
} fit_sigma;

/* "a,b" in place: pointers to the names. */
static int data_names (pw_fit *x, pw_error *error) {
  size_t count = 2;
  for (const char *c = x->columns_text; *c; c++) count += *c == ',';
  x->names = strdup (x->columns_text);
  x->name = calloc (2 * count, sizeof *x->name);
  if (x->names == NULL || x->name == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  x->unit = x->name + count;
  for (char *at = x->names; at;) {
    char *comma = strchr (at, ',');
    pw_column c;
    if (comma) *comma = 0;
    if (pw_column_find (x->m.system, at, "--columns", &c, error) != PW_OK) return error->status;
    for (int i = 0; i < x->columns; i++)
      if (strcmp (x->name[i], at) == 0) return pw_fail (error, PW_INPUT, "--columns: %s is given twice", at);
    x->unit[x->columns] = pw_column_unit (x->m.system, c);
    x->name[x->columns++] = at;
    at = comma ? comma + 1 : NULL;
  }
  return PW_OK;
}

/* "COLUMN=VALUE" or "COLUMN=NAME" */
static int data_sigma (const pw_fit *x, const char *text, fit_sigma *s, pw_error *error) {
  const int size = (int)strcspn (text, "=");
  const char *value = text + size + 1;
  int i = 0;
  if (text[size] == 0) return pw_fail (error, PW_INPUT, "--sigma %s: expected COLUMN=VALUE or COLUMN=NAME", text);
  while (i < x->columns && (strncmp (x->name[i], text, (size_t)size) != 0 || x->name[i][size])) i++;
  if (i == x->columns) return pw_fail (error, PW_INPUT, "--sigma %.*s: it is not among --columns", size, text);
  if (s[i].text) return pw_fail (error, PW_INPUT, "--sigma %.*s is given twice", size, text);
  s[i] = (fit_sigma){ value, NAN };
  if (pw_read_expression (value, &s[i].number) == PW_OK && !(s[i].number > 0))
    return pw_fail (error, PW_INPUT, "--sigma %s: expected a number > 0", text);
  return PW_OK;
}

/* Without standard deviations, data of one unit have equal weights. */
static int data_weights (pw_fit *x, const fit_sigma *s, pw_error *error) {
  for (int i = 0; i < x->columns; i++) x->weighted |= s[i].text != NULL;
  for (int i = 0; i < x->columns; i++) {
    if (x->weighted && s[i].text == NULL)
      return pw_fail (error, PW_INPUT, "--sigma is given for other columns, but not for %s", x->name[i]);
    if (!x->weighted && strcmp (x->unit[i], x->unit[0]) != 0)
      return pw_fail (error, PW_INPUT,
                      "%s [%s] and %s [%s] have different units: add --sigma COLUMN=VALUE for each column", x->name[0],
                      x->unit[0], x->name[i], x->unit[i]);
  }
  return PW_OK;
}

/* Reads times, data, and columns of standard deviations. */
static int data_read (pw_fit *x, const fit_sigma *s, pw_error *error) {
  const size_t most = 1 + 2 * (size_t)x->columns;
  const char **column = calloc (2 * most, sizeof *column), **unit = column + most;
  int width = 1;
  if (column == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  column[0] = "t", unit[0] = "s";
  for (int i = 0; i < x->columns; i++) column[width] = x->name[i], unit[width++] = x->unit[i];
  for (int i = 0; i < x->columns; i++)
    if (s[i].text && isnan (s[i].number)) column[width] = s[i].text, unit[width++] = x->unit[i];
  x->table = pw_read_columns (x->data_path, column, unit, width, &x->rows, error);
  free (column);
  return x->table ? PW_OK : error->status;
}

static int data_table (pw_fit *x, const fit_sigma *s, pw_error *error) {
  if (data_read (x, s, error) != PW_OK) return error->status;
  size_t rows = (size_t)x->rows, cells = (size_t)x->columns * rows;
  x->t = x->table, x->value = x->table + rows;
  x->sigma = malloc ((cells + 1) * sizeof *x->sigma);
  if (x->sigma == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const double *next = x->value + cells;
  for (int i = 0; i < x->columns; i++) {
    const double *given = s[i].text && isnan (s[i].number) ? next : NULL;
    for (size_t k = 0; k < rows; k++) x->sigma[(size_t)i * rows + k] = given ? given[k] : s[i].text ? s[i].number : 1;
    if (given) next += rows;
  }
  return PW_OK;
}

/* A datum without a positive standard deviation is an error. */
static int data_check (pw_fit *x, pw_error *error) {
  if (x->rows == 0) return pw_fail (error, PW_INPUT, "--data %s: no rows", x->data_path);
  if (x->t[0] < 0)
    return pw_fail (error, PW_INPUT, "--data %s: time %g s is before the start of the run", x->data_path, x->t[0]);
  for (int i = 0; i < x->columns * x->rows; i++) {
    if (isnan (x->value[i])) continue;
    x->residuals++;
    if (!(x->sigma[i] > 0))
      return pw_fail (error, PW_INPUT,
                      "--data %s: the standard deviation of %s at t = %g s is %g; expected a number > 0", x->data_path,
                      x->name[i / x->rows], x->t[i % x->rows], x->sigma[i]);
  }
  return PW_OK;
}

static int fit_read (pw_fit *x, pw_error *error) {
  if (data_names (x, error) != PW_OK) return error->status;
  fit_sigma *s = calloc ((size_t)x->columns, sizeof *s);
  int status = s ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (const char **text = x->sigma_list; status == PW_OK && text && *text; text++)
    status = data_sigma (x, *text, s, error);
  if (status == PW_OK) status = data_weights (x, s, error);
  if (status == PW_OK) status = data_table (x, s, error);
  if (status == PW_OK) status = data_check (x, error);
  free (s);
  return status;
}

/* ---- The command ---- */

enum { FIT_TABLE = 2, FIT_SUMMARY }; /* in the list of files */

static int fit_options (pw_fit *x, pw_error *error) {
  double starts = 1;
  x->confidence = 0.95;
  if (x->data_path == NULL) return pw_fail (error, PW_INPUT, "no data: add --data FILE.csv");
  if (x->columns_text == NULL)
    return pw_fail (error, PW_INPUT, "nothing to compare: add --columns NAME,..., columns of the data such as frame.x");
  int status = pw_cli_number ("--confidence", x->confidence_text, PW_POSITIVE, &x->confidence, error);
  if (status == PW_OK && !(x->confidence < 1))
    status = pw_fail (error, PW_INPUT, "--confidence %s: expected a number between 0 and 1", x->confidence_text);
  if (status == PW_OK) status = pw_cli_number ("--starts", x->starts_text, PW_COUNT, &starts, error);
  if (status == PW_OK && starts > 1e5) status = pw_fail (error, PW_INPUT, "--starts: at most 100000");
  x->starts = (int)starts;
  if (status == PW_OK) status = pw_cli_check_csv (x->path, error);
  if (status == PW_OK) status = pw_cli_requires ("--width", x->line.width, "--plots DIR", x->plots_path != NULL, error);
  return status == PW_OK ? pw_parallel_jobs (x->jobs_text, &x->jobs, error) : status;
}

/* Runs end at the last datum. */
static int fit_open_data (pw_fit *x, pw_error *error) {
  int status = fit_read (x, error);
  if (status == PW_OK) status = pw_unknowns_open (&x->unknowns, &x->line, &x->m, error);
  if (status == PW_OK) status = pw_unknowns_read (&x->unknowns, x->free, error);
  if (status != PW_OK) return status;
  if (x->residuals < x->unknowns.count)
    return pw_fail (error, PW_INPUT, "--data %s has fewer data (%d) than there are unknowns (%d)", x->data_path,
                    x->residuals, x->unknowns.count);
  if (x->starts > 1 && x->unknowns.count > PW_UNKNOWNS_STARTED)
    return pw_fail (error, PW_INPUT, "--starts: at most %d unknowns", PW_UNKNOWNS_STARTED);
  x->unknowns.t_end = x->unknowns.settings.span = x->t[x->rows - 1];
  pw_unknowns_engine (&x->unknowns, 50);
  return PW_OK;
}

static int fit_open (pw_fit *x, pw_error *error) {
  static const char *const figures[] = { "fit.dat", "fit.gp", "fit.svg", "fit.png", "fit.pdf", NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--data", x->data_path, PW_READS, NULL },
                   { "-o", x->path, PW_WRITES, NULL },
                   { "--json", x->json_path, PW_WRITES, NULL },
                   { "--plots", x->plots_path, PW_WRITES_INTO, figures } };
  int status = fit_options (x, error);
  if (status == PW_OK) status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = fit_open_data (x, error);
  return status == PW_OK ? pw_files_open (&x->files, &x->line, &x->m, use, sizeof use / sizeof *use, error) : status;
}

/* Errors of the estimates are not known after Ctrl-C. */
static void fit_interrupt (pw_fit *x) {
  int n = x->unknowns.count;
  for (int i = 0; i < n; i++) x->deviation[i] = NAN;
  for (int i = 0; i < n * n; i++) x->covariance[i] = NAN;
  x->rank = n;
  x->interrupted = 1;
}

static int fit_search (pw_fit *x, pw_error *error) {
  pw_stop_catch ();
  pw_progress_count (&x->progress, pw_file_name (x->m.file), "iterations", 0, 20. * x->starts);
  int status = pw_fit_solve (x, error);
  pw_progress_end (&x->progress);
  pw_stop_release ();
  if (status != PW_RETRY) return status;
  if (x->iterations > 0) {
    fit_interrupt (x);
    return PW_OK;
  }
  pw_cli_say ("pinwheel: interrupted before the first iteration was done\n");
  return PW_INTERRUPTED;
}

static int fit_finish (pw_fit *x, pw_error *error) {
  FILE *table = pw_files_stream (&x->files, FIT_TABLE), *summary = pw_files_stream (&x->files, FIT_SUMMARY);
  pw_fit_print (x);
  pw_unknowns_report (&x->unknowns, x->estimate);
  int status = table ? pw_fit_table (x, table, error) : PW_OK;
  const char *word = x->interrupted ? "interrupted" : x->converged ? "ok" : "method";
  if (summary) pw_fit_json (x, word, summary);
  if (status == PW_OK) status = pw_files_finish (&x->files, error);
  if (status == PW_OK && x->plots_path) status = pw_fit_draw (x, error);
  if (x->interrupted) pw_cli_say ("pinwheel: interrupted; these are the values so far, without their errors\n");
  if (status == PW_OK && x->interrupted) return PW_INTERRUPTED;
  if (status == PW_OK && !x->converged)
    status = pw_fail (error, PW_METHOD,
                      "no minimum was found in %d iterations; begin nearer to it, by --set or --start", x->iterations);
  return status;
}

static int fit_command (void *options, pw_error *error) {
  pw_fit *x = options;
  int status = fit_open (x, error);
  if (status == PW_OK) status = fit_search (x, error);
  if (status == PW_OK) status = fit_finish (x, error);
  pw_files_close (&x->files);
  free (x->names);
  free (x->name);
  free (x->table);
  free (x->sigma);
  free (x->estimate);
  free (x->minimum);
  pw_unknowns_close (&x->unknowns);
  pw_cli_close_model (&x->m);
  return status;
}

static const struct poptOption fit_options_table[] = {
  PW_OPTION_GROUP ("Fit"),
  PW_TEXT_OPTION (pw_fit, data_path, "data", 0, "FILE.csv",
                  "Measured data: a table with the columns t and those of `run`, in any order; empty cells are gaps"),
  PW_TEXT_OPTION (pw_fit, columns_text, "columns", 0, "NAME,...", "Columns of the data to compare with the model"),
  PW_LIST_OPTION (pw_fit, free, "free", 0, "NAME[=LOW:HIGH]",
                  "Determine a parameter or an initial value, such as frame.vx, perhaps between bounds; repeatable"),
  PW_LIST_OPTION (pw_fit, sigma_list, "sigma", 0, "COLUMN=VALUE",
                  "Standard deviation of a column, a number or the name of a column of the data; repeatable"),
  PW_TEXT_OPTION (pw_fit, confidence_text, "confidence", 0, "P", "Probability of confidence intervals (default 0.95)"),
  PW_TEXT_OPTION (pw_fit, starts_text, "starts", 0, "N",
                  "Search from N points: the initial values, and others between the bounds (default 1)"),
  PW_TEXT_OPTION (pw_fit, jobs_text, "jobs", 'j', "N", "Number of concurrent runs (default: one per processor)"),
  PW_TEXT_OPTION (pw_fit, path, "output", 'o', "FILE.csv", "Write data, model values and residuals to this file"),
  PW_TEXT_OPTION (pw_fit, json_path, "json", 0, "FILE.json", "Write a summary"),
  PW_TEXT_OPTION (pw_fit, plots_path, "plots", 0, "DIR", "Write figures of data, model and residuals into a folder"),
  PW_WIDTH_OPTION,
  PW_OPTION_GROUP ("Integration"),
  PW_TEXT_OPTION (pw_cli_line, method, "method", 'm', "METHOD",
                  "Integrator and stabilisation, see `pinwheel list methods`"),
  PW_TEXT_OPTION (pw_cli_line, step, "step", 0, "H", "Step size of fixed-step methods [s]"),
  PW_TEXT_OPTION (pw_cli_line, rtol, "rtol", 0, "R", "Relative tolerance of adaptive methods"),
  PW_TEXT_OPTION (pw_cli_line, atol, "atol", 0, "A", "Absolute tolerance of every state"),
  PW_TEXT_OPTION (pw_cli_line, limit, "limit", 0, "SECONDS", "Stop a run after this much processor time"),
  PW_ENGINE_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_fit = {
  .name = "fit",
  .synopsis = "MODEL --data FILE.csv --columns NAME,... --free NAME[=LOW:HIGH]... [OPTION...]",
  .summary = "fit parameters and initial values to measured data",
  .help = "Determine parameters and initial values of a model by least squares, so that it agrees with measured data. "
          "Prints "
          "estimates with standard errors, confidence intervals and correlations, and unknowns that the data do not "
          "determine.",
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_fit),
  .function = fit_command,
  .options = fit_options_table,
};
