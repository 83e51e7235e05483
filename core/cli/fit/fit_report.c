/* The reports of `pinwheel fit`. */
#include "fit.h"
#include <gsl/gsl_cdf.h>
#include <math.h>
#include "figure.h"
#include "print_table.h"
#include "text.h"

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

/* Half the width of confidence intervals in standard errors: from the normal distribution if standard deviations are
 * given, else from Student's. */
static double report_quantile (const pw_fit *fit) {
  double tail = (1 - fit->confidence) / 2;
  return fit->weighted ? gsl_cdf_gaussian_Qinv (tail, 1)
                       : gsl_cdf_tdist_Qinv (tail, fmax (pw_fit_degrees_of_freedom (fit), 1));
}

/* The lower (side -1) or upper (side 1) end of the confidence interval of unknown i; NaN if there is none. */
static double report_interval_end (const pw_fit *fit, int i, int side) {
  return isfinite (fit->standard_error[i]) ? fit->estimate[i] + side * report_quantile (fit) * fit->standard_error[i]
                                           : NAN;
}

/* "at its lower bound", "at its upper bound"; "" if the estimate of unknown i is at neither. */
static const char *report_bound (const pw_fit *fit, int i) {
  const pw_unknown *unknown = fit->unknowns.list + i;
  const double value = fit->estimate[i], near = PW_FIT_MARGIN * unknown->scale;
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

/* ---- Text ---- */

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
    pw_cell (&t, 8, "number");
    pw_cell (&t, 12, "rms residual");
    pw_row_end (&t);
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
  return fabs (fit->singular_vector[i * fit->unknowns.count + combination]) > PW_FIT_COMPONENT;
}

/* Prints the ratio of changes of the unknowns along a singular vector; the change of the first one is its estimate, or
 * 1 if this is 0. */
static void report_ratio (const pw_fit *fit, int combination) {
  double scale = 0;
  for (int i = 0; i < fit->unknowns.count; i++) {
    double change = fit->singular_vector[i * fit->unknowns.count + combination] / fit->column_length[i];
    if (!report_contains (fit, combination, i)) continue;
    printf (scale != 0 ? " : " : ": changes in the ratio ");
    if (scale == 0) scale = (fit->estimate[i] != 0 ? fit->estimate[i] : 1) / change;
    printf ("%.3g", change * scale);
  }
  puts (" have no effect");
}

/* Prints combinations of unknowns that change no model value: singular vectors with the singular value 0. */
static void report_undetermined (const pw_fit *fit) {
  for (int k = fit->rank; k < fit->unknowns.count; k++) {
    int count = 0;
    for (int i = 0; i < fit->unknowns.count; i++)
      if (report_contains (fit, k, i))
        pw_cli_print (stdout, "%s%s", count++ ? ", " : "\nThe data do not determine ", fit->unknowns.list[i].name);
    if (count == 1)
      puts (", which has no effect");
    else
      report_ratio (fit, k);
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

void pw_fit_print (const pw_fit *fit) {
  char options[PW_UNKNOWNS_OPTIONS];
  int dof = pw_fit_degrees_of_freedom (fit);
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

/* ---- Files ---- */

static void report_json_unknown (const pw_fit *fit, pw_json *j, int i) {
  const pw_unknown *u = fit->unknowns.list + i;
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "name", u->name);
  pw_json_text (j, "unit", u->unit);
  pw_json_number (j, "initial", u->value);
  pw_json_number (j, "value", fit->estimate[i]);
  pw_json_number (j, "standard_error", fit->standard_error[i]);
  pw_json_number (j, "from", report_interval_end (fit, i, -1));
  pw_json_number (j, "to", report_interval_end (fit, i, 1));
  if (fit->interrupted)
    pw_json_text (j, "determined", NULL);
  else
    pw_json_flag (j, "determined", !isinf (fit->standard_error[i]));
  pw_json_flag (j, "bound", *report_bound (fit, i) != 0);
  pw_json_close (j, '}');
}

static void report_json_columns (const pw_fit *fit, pw_json *j) {
  pw_json_open (j, "columns", '[');
  for (int i = 0; i < fit->columns; i++) {
    int count;
    double rms = report_rms (fit, i, &count);
    pw_json_open (j, NULL, '{');
    pw_json_text (j, "name", fit->column_name[i]);
    pw_json_text (j, "unit", fit->column_unit[i]);
    pw_json_number (j, "data", count);
    pw_json_number (j, "rms", rms);
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

/* Writes a matrix, unknowns x unknowns, with these entries. */
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

/* Writes pw_fit.ends. */
static void report_json_ends (const pw_fit *fit, pw_json *j) {
  int n = fit->unknowns.count;
  pw_json_open (j, "searches", '[');
  for (const double *end = fit->ends; end < fit->ends + fit->starts * (1 + n); end += 1 + n) {
    pw_json_open (j, NULL, '{');
    pw_json_number (j, "chi2", *end);
    pw_json_numbers (j, "values", end + 1, n);
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

void pw_fit_json (const pw_fit *fit, const char *status, FILE *f) {
  pw_json json = { .f = f, .lines = 2 }, *j = &json;
  char options[PW_UNKNOWNS_OPTIONS];
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (fit->model.file));
  pw_json_text (j, "status", status);
  pw_json_text (j, "data", fit->data_path);
  pw_json_text (j, "options", pw_unknowns_options (&fit->unknowns, fit->estimate, options));
  pw_json_text (j, "method", fit->unknowns.method);
  pw_json_number (j, "residuals", fit->residuals);
  pw_json_number (j, "freedom", pw_fit_degrees_of_freedom (fit));
  pw_json_flag (j, "weighted", fit->weighted);
  pw_json_number (j, "chi2", fit->chi2);
  pw_json_number (j, "confidence", fit->confidence);
  pw_json_number (j, "rank", fit->rank);
  pw_json_number (j, "runs", (double)fit->runs);
  pw_json_text (j, "derivatives", "differences");
  pw_json_number (j, "iterations", fit->iterations);
  pw_json_open (j, "unknowns", '[');
  for (int i = 0; i < fit->unknowns.count; i++) report_json_unknown (fit, j, i);
  pw_json_close (j, ']');
  report_json_columns (fit, j);
  report_json_matrix (fit, j, "covariance", report_covariance);
  report_json_matrix (fit, j, "correlation", report_correlation);
  report_json_ends (fit, j);
  pw_json_close (j, '}');
}

int pw_fit_table (const pw_fit *fit, FILE *f, pw_error *error) {
  static const char *const part[] = { "", ".model", ".residual", ".sigma" };
  pw_text t = { .chars = NULL };
  pw_text_name (&t, "t", "s");
  for (int i = 0; i < fit->columns; i++)
    for (int k = 0; k < 4; k++)
      pw_text_name (&t, PW_PRINTED (300, "%s%s", fit->column_name[i], part[k]), fit->column_unit[i]);
  int status = pw_text_line (&t, f, fit->table_path, error);
  for (int row = 0; row < fit->rows && status == PW_OK; row++) {
    pw_text_number (&t, fit->t[row]);
    for (int i = 0; i < fit->columns; i++) {
      int k = i * fit->rows + row;
      const double value[] = { fit->data[k], fit->fitted[k], fit->fitted[k] - fit->data[k],
                               fit->weighted ? fit->sigma[k] : NAN };
      for (int c = 0; c < 4; c++) pw_text_number (&t, value[c]);
    }
    status = pw_text_line (&t, f, fit->table_path, error);
  }
  return status;
}

/* ---- Figures ---- */

static int report_data (const void *context, FILE *f, pw_error *error) {
  const pw_fit *fit = context;
  (void)error;
  fputs ("# t [s], data, standard deviation, model; a block per column\n", f);
  for (int i = 0; i < fit->columns; i++) {
    for (int k = 0; k < fit->rows; k++) {
      int c = i * fit->rows + k;
      const double value[] = { fit->t[k], fit->data[c], fit->weighted ? fit->sigma[c] : 0, fit->fitted[c] };
      for (int v = 0; v < 4; v++) fprintf (f, "%s%s", v ? " " : "", PW_DIGITS (value[v], 12));
      fputc ('\n', f);
    }
    fputs ("\n\n", f);
  }
  return PW_OK;
}

static void report_variables (const void *context, FILE *f) {
  const pw_fit *fit = context;
  int panels = fit->columns < REPORT_PANELS ? fit->columns : REPORT_PANELS;
  fprintf (f, "panels = %d\nweighted = %d\narray label[%d]\n", panels, fit->weighted, panels);
  for (int i = 0; i < panels; i++) pw_figure_label (f, "label", i + 1, fit->column_name[i], fit->column_unit[i]);
}

int pw_fit_draw (const pw_fit *fit, pw_error *error) {
  return pw_figure_write (&fit->line, &fit->model, fit->plots_path, "fit", fit, report_data, report_variables, error);
}
