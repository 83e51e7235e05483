/* pinwheel fit: parameters and initial values with which a model agrees best with measured data. */
#define _POSIX_C_SOURCE 200809L
#include "fit.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "parallel.h"

/* ---- The data: columns of a table and their standard deviations ---- */

#define FIT_LONGER 100. /* data that last longer than this many runs of the model have other units of time */

/* The standard deviation of a column of data as given by --sigma: a number, or the name of a column of the table. */
typedef struct {
  const char *text; /* NULL: not given */
  double number;    /* NaN: the text is the name of a column of the table */
} fit_sigma;

/* Splits "NAME,..." of --columns. */
static int data_read_columns (pw_fit *fit, pw_error *error) {
  size_t count = 2; /* one name more than commas, and NULL at the end */
  for (const char *text = fit->columns_text; *text; text++) count += *text == ',';
  char *name = pw_arena_copy (&fit->arena, fit->columns_text);
  fit->column_name = pw_arena_alloc (&fit->arena, 2 * count * sizeof *fit->column_name);
  if (name == NULL || fit->column_name == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  fit->column_unit = fit->column_name + count;
  while (name) {
    char *comma = strchr (name, ',');
    pw_column column;
    if (comma) *comma = 0;
    if (pw_column_find (fit->model.system, name, "--columns", &column, error) != PW_OK) return error->status;
    for (int i = 0; i < fit->columns; i++)
      if (strcmp (fit->column_name[i], name) == 0)
        return pw_fail (error, PW_INPUT, "--columns: %s is given twice", name);
    fit->column_unit[fit->columns] = pw_column_unit (fit->model.system, column);
    fit->column_name[fit->columns++] = name;
    name = comma ? comma + 1 : NULL;
  }
  return PW_OK;
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
  if (last > FIT_LONGER * t_end && fit->line.t_end == NULL)
    return pw_fail (error, PW_INPUT,
                    FIT_TIMES " last far longer than the run, which ends at %.6g s: give --time-scale 1e-3 if they are "
                              "in ms, else --t-end",
                    fit->data_path, first, last, t_end);
  return PW_OK;
}

/* Reports which part of the run the data cover, and what is not used. */
static void data_report (const pw_fit *fit) {
  const double t_end = fit->t_end, covered = fmin (fit->last, t_end) - fit->first;
  const int empty = fit->columns * fit->rows - fit->residuals;
  if (covered < 0.9 * t_end || (fit->last > t_end * (1 + 1e-9) && fit->line.t_end == NULL))
    pw_cli_say ("pinwheel: " FIT_TIMES " cover %.3g %% of the run, which ends at %.6g s%s\n", fit->data_path,
                fit->first, fit->last, 100 * covered / t_end, t_end,
                fit->line.t_end ? "" : "; runs end at the last datum");
  if (empty || fit->untimed || fit->late)
    pw_cli_say ("pinwheel: --data %s: left out are %s, %s without a time, %s after --t-end\n", fit->data_path,
                PW_COUNTED (empty, "empty cell"), PW_COUNTED (fit->untimed, "row"), PW_COUNTED (fit->late, "row"));
}

/* Converts the times to seconds, and copies the rows of the table that have one, up to --t-end. */
static int data_keep_rows (pw_fit *fit, double *table, int columns, pw_error *error) {
  const double t_end = fit->line.t_end ? fit->t_end * (1 + 1e-9) : INFINITY;
  double scale = 1, offset = 0;
  int rows = fit->rows, kept = 0, timed = 0;
  fit->table = pw_arena_alloc (&fit->arena, (size_t)columns * (size_t)rows * sizeof *table);
  if (fit->table == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (pw_cli_number ("--time-scale", fit->time_scale_text, PW_POSITIVE, &scale, error) != PW_OK ||
      pw_cli_number ("--time-offset", fit->time_offset_text, PW_REAL, &offset, error) != PW_OK)
    return error->status;
  for (int i = 0; i < rows; i++) {
    table[i] = scale * (table[i] + offset / scale);
    kept += table[i] <= t_end;
    if (isnan (table[i])) continue;
    if (timed++ == 0) fit->first = table[i];
    fit->last = table[i];
  }
  for (int i = 0, k = 0; i < rows; i++) {
    if (!(table[i] <= t_end)) continue;
    for (int j = 0; j < columns; j++) fit->table[j * kept + k] = table[j * rows + i];
    k++;
  }
  fit->rows = kept, fit->untimed = rows - timed, fit->late = timed - kept;
  return timed ? data_check_times (fit, error) : pw_fail (error, PW_INPUT, "--data %s: no rows", fit->data_path);
}

/* Reads times, data, and columns of standard deviations. */
static int data_read_table (pw_fit *fit, const fit_sigma *given, pw_error *error) {
  const size_t most = 1 + 2 * (size_t)fit->columns;
  const char **column = pw_arena_alloc (&fit->arena, 2 * most * sizeof *column);
  int count = 1;
  if (column == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const char **unit = column + most;
  column[0] = fit->time_name ? fit->time_name : "t", unit[0] = "s";
  for (int i = 0; i < fit->columns; i++) column[count] = fit->column_name[i], unit[count++] = fit->column_unit[i];
  for (int i = 0; i < fit->columns; i++)
    if (isnan (given[i].number)) column[count] = given[i].text, unit[count++] = fit->column_unit[i];
  double *table = pw_read_columns (fit->data_path, column, unit, count, &fit->rows, error);
  int status = table ? data_keep_rows (fit, table, count, error) : error->status;
  free (table);
  return status;
}

/* Reads the data, and sets the standard deviation of each datum. */
static int data_read (pw_fit *fit, const fit_sigma *given, pw_error *error) {
  if (data_read_table (fit, given, error) != PW_OK) return error->status;
  size_t rows = (size_t)fit->rows, cells = (size_t)fit->columns * rows;
  fit->t = fit->table, fit->data = fit->table + rows;
  fit->sigma = pw_arena_alloc (&fit->arena, cells * sizeof *fit->sigma);
  if (fit->sigma == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const double *next = fit->data + cells;
  for (int i = 0; i < fit->columns; i++) {
    const double *column = isnan (given[i].number) ? next : NULL, all = given[i].text ? given[i].number : 1;
    for (size_t k = 0; k < rows; k++) fit->sigma[(size_t)i * rows + k] = column ? column[k] : all;
    if (column) next += rows;
  }
  return PW_OK;
}

/* Counts the data, each of which needs a positive standard deviation. */
static int data_check (pw_fit *fit, pw_error *error) {
  for (int i = 0; i < fit->columns * fit->rows; i++) {
    if (isnan (fit->data[i])) continue;
    fit->residuals++;
    if (!(fit->sigma[i] > 0))
      return pw_fail (error, PW_INPUT,
                      "--data %s: the standard deviation of %s at t = %g s is %g; expected a number > 0",
                      fit->data_path, fit->column_name[i / fit->rows], fit->t[i % fit->rows], fit->sigma[i]);
  }
  return PW_OK;
}

static int fit_read_data (pw_fit *fit, pw_error *error) {
  if (data_read_columns (fit, error) != PW_OK) return error->status;
  fit_sigma *given = pw_arena_alloc (&fit->arena, (size_t)fit->columns * sizeof *given);
  int status = given ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory");
  for (const char **text = fit->sigma_texts; status == PW_OK && text && *text; text++)
    status = data_read_sigma (fit, *text, given, error);
  if (status == PW_OK) status = data_check_sigma (fit, given, error);
  if (status == PW_OK) status = data_read (fit, given, error);
  return status == PW_OK ? data_check (fit, error) : status;
}

/* ---- The command ---- */

#define FIT_RUNS 50. /* usual number of runs of a search, to choose the engine */

enum { FIT_TABLE = 2, FIT_SUMMARY }; /* indices in the list of files of fit_open */

static int fit_options (pw_fit *fit, pw_error *error) {
  double starts = 1;
  fit->confidence = 0.95;
  if (fit->data_path == NULL) return pw_fail (error, PW_INPUT, "no data: add --data FILE.csv");
  if (fit->columns_text == NULL)
    return pw_fail (error, PW_INPUT, "nothing to compare: add --columns NAME,..., columns of the data such as frame.x");
  int status = pw_cli_number ("--confidence", fit->confidence_text, PW_POSITIVE, &fit->confidence, error);
  if (status == PW_OK && !(fit->confidence < 1))
    status = pw_fail (error, PW_INPUT, "--confidence %s: expected a number between 0 and 1", fit->confidence_text);
  if (status == PW_OK) status = pw_cli_number ("--starts", fit->starts_text, PW_COUNT, &starts, error);
  if (status == PW_OK && starts > 1e5) status = pw_fail (error, PW_INPUT, "--starts: at most 100000");
  fit->starts = (int)starts;
  if (status == PW_OK) status = pw_cli_check_csv (fit->table_path, error);
  if (status == PW_OK)
    status = pw_cli_requires ("--width", fit->line.width, "--plots DIR", fit->plots_path != NULL, error);
  return status == PW_OK ? pw_parallel_jobs (fit->jobs_text, &fit->jobs, error) : status;
}

/* Reads the data and the unknowns; runs end at the time of the last row. */
static int fit_open_data (pw_fit *fit, pw_error *error) {
  int status = pw_unknowns_open (&fit->unknowns, &fit->line, &fit->model, error);
  fit->t_end = fit->unknowns.t_end;
  if (status == PW_OK) status = fit_read_data (fit, error);
  if (status == PW_OK) status = pw_unknowns_read (&fit->unknowns, fit->free, error);
  if (status != PW_OK) return status;
  if (fit->residuals < fit->unknowns.count)
    return pw_fail (error, PW_INPUT, "--data %s has fewer data (%d) than there are unknowns (%d)", fit->data_path,
                    fit->residuals, fit->unknowns.count);
  fit->unknowns.t_end = fit->unknowns.settings.span = fit->t[fit->rows - 1];
  return pw_unknowns_engine (&fit->unknowns, FIT_RUNS, fit->starts, error);
}

static int fit_open (pw_fit *fit, pw_error *error) {
  static const char *const figures[] = { "fit.dat", "fit.gp", "fit.svg", "fit.png", "fit.pdf", NULL };
  pw_use use[] = { PW_CLI_MODEL_USE,
                   { "--data", fit->data_path, PW_READS, NULL },
                   { "-o", fit->table_path, PW_WRITES, pw_cli_csv },
                   { "--json", fit->json_path, PW_WRITES, pw_cli_json },
                   { "--plots", fit->plots_path, PW_WRITES_INTO, figures } };
  int status = fit_options (fit, error);
  if (status == PW_OK) status = pw_cli_open (&fit->model, &fit->line, error);
  if (status == PW_OK) status = fit_open_data (fit, error);
  return status == PW_OK ? pw_files_open (&fit->files, &fit->line, &fit->model, use, sizeof use / sizeof *use, error)
                         : status;
}

static int fit_search (pw_fit *fit, pw_error *error) {
  pw_stop_catch ();
  pw_progress_start (&fit->progress, pw_file_name (fit->model.file), "", 0, 1);
  int status = pw_fit_solve (fit, error);
  pw_progress_end (&fit->progress);
  pw_stop_release ();
  fit->interrupted = status == PW_RETRY;
  if (!fit->interrupted) return status;
  if (fit->iterations > 0) return PW_OK;
  pw_cli_say ("pinwheel: interrupted before the first iteration was done\n");
  return PW_INTERRUPTED;
}

static int fit_finish (pw_fit *fit, pw_error *error) {
  FILE *table = pw_files_stream (&fit->files, FIT_TABLE), *summary = pw_files_stream (&fit->files, FIT_SUMMARY);
  pw_error drawing = { 0 };
  data_report (fit);
  pw_fit_print (fit);
  pw_unknowns_report (&fit->unknowns, fit->estimate);
  const int drawn = fit->plots_path ? pw_fit_draw (fit, &drawing) : PW_OK;
  const char *word = pw_cli_status_word (drawn != PW_OK || fit->converged ? drawn : PW_METHOD);
  int status = table ? pw_fit_table (fit, table, error) : PW_OK;
  if (summary) pw_fit_json (fit, fit->interrupted ? "interrupted" : word, summary);
  if (status == PW_OK) status = pw_files_finish (&fit->files, error);
  status = pw_figure_status (drawn, &drawing, status, error);
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
  if (status == PW_OK) status = fit_search (fit, error);
  if (status == PW_OK) status = fit_finish (fit, error);
  pw_files_close (&fit->files);
  pw_arena_free (&fit->arena);
  pw_unknowns_close (&fit->unknowns);
  pw_cli_close_model (&fit->model);
  return status;
}

static const struct poptOption fit_options_table[] = {
  PW_OPTION_GROUP ("Fit"),
  PW_TEXT_OPTION (pw_fit, data_path, "data", 0, "FILE.csv",
                  "Measured data: a table with t and columns named as those of `run`; empty cells are gaps"),
  PW_TEXT_OPTION (pw_fit, time_name, "time", 0, "NAME", "Column of the times in the data (default t)"),
  PW_TEXT_OPTION (pw_fit, time_scale_text, "time-scale", 0, "K", "Factor of these times, 1e-3 for ms"),
  PW_TEXT_OPTION (pw_fit, time_offset_text, "time-offset", 0, "T", "Added to the scaled times [s]"),
  PW_TEXT_OPTION (pw_fit, columns_text, "columns", 0, "NAME,...", "Columns of the data to compare with the model"),
  PW_LIST_OPTION (pw_fit, free, "free", 0, "NAME[=LOW:HIGH]",
                  "Determine a parameter or initial value, such as frame.vx, within bounds if given; repeatable"),
  PW_LIST_OPTION (pw_fit, sigma_texts, "sigma", 0, "COLUMN=VALUE",
                  "Standard deviation of a column, a number or the name of a column of the data; repeatable"),
  PW_TEXT_OPTION (pw_fit, confidence_text, "confidence", 0, "P", "Probability of confidence intervals (default 0.95)"),
  PW_TEXT_OPTION (pw_fit, starts_text, "starts", 0, "N",
                  "Search from N points: the initial values, and others between the bounds (default 1)"),
  PW_TEXT_OPTION (pw_fit, jobs_text, "jobs", 'j', "N", "Number of concurrent runs (default: one per processor)"),
  PW_TEXT_OPTION (pw_fit, table_path, "output", 'o', "FILE.csv", "Write data, model values and residuals to this file"),
  PW_TEXT_OPTION (pw_fit, json_path, "json", 0, "FILE.json", "Write a summary"),
  PW_TEXT_OPTION (pw_fit, plots_path, "plots", 0, "DIR", "Write figures of data, model and residuals into a folder"),
  PW_WIDTH_OPTION,
  PW_OPTION_GROUP ("Integration"),
  PW_TEXT_OPTION (pw_cli_line, method, "method", 'm', "METHOD",
                  "Integrator and stabilisation, see `pinwheel list methods`"),
  PW_TEXT_OPTION (pw_cli_line, t_end, "t-end", 't', "T", "Leave out data after this time [s]"),
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
          "Prints estimates with standard errors, confidence intervals and correlations, and unknowns that the data do "
          "not determine.",
  .options_size = sizeof (pw_fit),
  .function = fit_command,
  .options = fit_options_table,
};
