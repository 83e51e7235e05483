/* The reports of `pinwheel fit`. */
#include "fit.h"
#include <gsl/gsl_cdf.h>
#include <math.h>
#include <stdlib.h>
#include "figure.h"
#include "print_table.h"
#include "states.h"
#include "text.h"

enum { REPORT_DIGITS = 7, REPORT_CORRELATIONS = 9, REPORT_PANELS = 4, REPORT_OPTIONS = 4000 };

static double report_correlation (const pw_fit *x, int i, int j) {
  int n = x->unknowns.count;
  double size = sqrt (x->covariance[i * n + i] * x->covariance[j * n + j]);
  return size > 0 && isfinite (x->deviation[i]) && isfinite (x->deviation[j]) ? x->covariance[i * n + j] / size : NAN;
}

/* The lower (-1) or upper end of the confidence interval; NaN without one. */
static double report_end (const pw_fit *x, int i, int side) {
  return isfinite (x->deviation[i]) ? x->estimate[i] + side * pw_fit_quantile (x) * x->deviation[i] : NAN;
}

static const char *report_bound (const pw_fit *x, int i) {
  const pw_unknown *u = x->unknowns.list + i;
  const double value = x->estimate[i], near = PW_FIT_INSIDE * u->scale;
  return value - u->low < near ? "at its lower bound" : u->high - value < near ? "at its upper bound" : "";
}

/* Root mean square of the residuals of a column; the number of its data. */
static double report_rms (const pw_fit *x, int column, int *count) {
  double sum = 0;
  *count = 0;
  for (int k = column * x->rows; k < (column + 1) * x->rows; k++)
    if (!isnan (x->value[k])) sum += pow (x->model[k] - x->value[k], 2), ++*count;
  return sqrt (sum / *count);
}

/* ---- Text ---- */

static void report_unknowns (const pw_fit *x) {
  char head[80];
  snprintf (head, sizeof head, "%g %% confidence:  from", 100 * x->confidence);
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -12, "free");
    pw_cell (&t, 12, "initially");
    pw_cell (&t, 12, "estimate");
    pw_cell (&t, 14, "standard error");
    pw_cell (&t, 12, head);
    pw_cell (&t, 12, "to");
    pw_row_end (&t);
    for (int i = 0; i < x->unknowns.count; i++) {
      pw_cell_unit (&t, -12, x->unknowns.list[i].name, x->unknowns.list[i].unit);
      pw_cell_number (&t, 12, x->unknowns.list[i].value, REPORT_DIGITS);
      pw_cell_number (&t, 12, x->estimate[i], REPORT_DIGITS);
      pw_cell_number (&t, 14, isfinite (x->deviation[i]) ? x->deviation[i] : NAN, 3);
      pw_cell_number (&t, 12, report_end (x, i, -1), REPORT_DIGITS);
      pw_cell_number (&t, 12, report_end (x, i, 1), REPORT_DIGITS);
      pw_cell (&t, -1, isinf (x->deviation[i]) ? "not determined by the data" : report_bound (x, i));
      pw_row_end (&t);
    }
  }
}

static void report_correlations (const pw_fit *x) {
  int n = x->unknowns.count;
  if (n < 2 || n > REPORT_CORRELATIONS) return;
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);)
    for (int i = 0; i < n; i++) {
      pw_cell (&t, -12, i ? x->unknowns.list[i].name : "correlations");
      for (int j = 0; j < n - 1; j++)
        if (i == 0)
          pw_cell (&t, 8, x->unknowns.list[j].name);
        else if (j < i)
          pw_cell_number (&t, 8, round (1e4 * report_correlation (x, i, j)) / 1e4 + 0, 4);
      pw_row_end (&t);
    }
}

static void report_columns (const pw_fit *x) {
  putchar ('\n');
  for (pw_table t = { 0 }; pw_table_pass (&t);) {
    pw_cell (&t, -12, "data");
    pw_cell (&t, 8, "number");
    pw_cell (&t, 12, "rms residual");
    pw_row_end (&t);
    for (int i = 0; i < x->columns; i++) {
      int count;
      double rms = report_rms (x, i, &count);
      pw_cell_unit (&t, -12, x->name[i], x->unit[i]);
      pw_cell_number (&t, 8, count, 9);
      pw_cell_number (&t, 12, rms, 4);
      pw_row_end (&t);
    }
  }
}

/* 1 if a combination of unknowns that changes no datum contains unknown i. */
static int report_contains (const pw_fit *x, int combination, int i) {
  return fabs (x->vectors[i * x->unknowns.count + combination]) > PW_FIT_PART;
}

/* Changes of the unknowns along a singular vector; that of the first one is its estimate, if this is not 0. */
static void report_ratio (const pw_fit *x, int combination) {
  double scale = 0;
  for (int i = 0; i < x->unknowns.count; i++) {
    double change = x->vectors[i * x->unknowns.count + combination] / x->length[i];
    if (!report_contains (x, combination, i)) continue;
    printf (scale != 0 ? " : " : ": changes in the ratio ");
    if (scale == 0) scale = (x->estimate[i] != 0 ? x->estimate[i] : 1) / change;
    printf ("%.3g", change * scale);
  }
  puts (" have no effect");
}

static void report_undetermined (const pw_fit *x) {
  for (int k = x->rank; k < x->unknowns.count; k++) {
    int count = 0;
    for (int i = 0; i < x->unknowns.count; i++)
      if (report_contains (x, k, i))
        pw_cli_print (stdout, "%s%s", count++ ? ", " : "\nThe data do not determine ", x->unknowns.list[i].name);
    if (count == 1)
      puts (", which has no effect");
    else
      report_ratio (x, k);
  }
}

/* 1 if a search ended at the best minimum, up to round-off and the tolerances of searches. */
static int report_same (const pw_fit *x, const double *minimum) {
  return *minimum <= x->chi2 + 1e-6 * x->chi2 + 1e-12 * x->initial_chi2;
}

/* Searches that ended at the best minimum, and the next best one. */
static void report_minima (const pw_fit *x) {
  char options[REPORT_OPTIONS];
  const double *next = NULL;
  int same = 0;
  for (int i = 0; i < x->starts; i++) {
    const double *minimum = x->minimum + i * (1 + x->unknowns.count);
    same += report_same (x, minimum);
    if (!report_same (x, minimum) && isfinite (*minimum) && (next == NULL || *minimum < *next)) next = minimum;
  }
  if (x->starts > 1) printf ("%d of %d searches end at this minimum", same, x->starts);
  if (next && pw_unknowns_options (&x->unknowns, next + 1, options, sizeof options))
    printf ("; the next one is %.6g at %s", *next, options);
  if (x->starts > 1) putchar ('\n');
}

void pw_fit_print (const pw_fit *x) {
  char options[REPORT_OPTIONS];
  int freedom = pw_fit_freedom (x);
  report_unknowns (x);
  report_columns (x);
  if (x->weighted)
    printf ("\nchi^2 %.6g with %d degrees of freedom (initially %.6g); it is larger with probability %.2g\n", x->chi2,
            freedom, x->initial_chi2, freedom > 0 ? gsl_cdf_chisq_Q (x->chi2, freedom) : 1);
  else
    printf ("\nsum of squares %.6g with %d degrees of freedom (initially %.6g)\n", x->chi2, freedom, x->initial_chi2);
  report_correlations (x);
  report_undetermined (x);
  printf ("\n%ld runs, %d iterations, derivatives by %s\n", x->runs, x->iterations,
          x->by_differences ? "differences of runs" : "the variational equations");
  report_minima (x);
  if (pw_unknowns_options (&x->unknowns, x->estimate, options, sizeof options)) printf ("\n%s\n", options);
}

/* ---- Files ---- */

static void report_json_unknown (const pw_fit *x, pw_json *j, int i) {
  const pw_unknown *u = x->unknowns.list + i;
  j->line = 1;
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "name", u->name);
  pw_json_text (j, "unit", u->unit);
  pw_json_number (j, "initial", u->value);
  pw_json_number (j, "value", x->estimate[i]);
  pw_json_number (j, "standard_error", x->deviation[i]);
  pw_json_number (j, "from", report_end (x, i, -1));
  pw_json_number (j, "to", report_end (x, i, 1));
  if (x->interrupted)
    pw_json_text (j, "determined", NULL);
  else
    pw_json_flag (j, "determined", !isinf (x->deviation[i]));
  pw_json_flag (j, "bound", *report_bound (x, i) != 0);
  pw_json_close (j, '}');
}

static void report_json_columns (const pw_fit *x, pw_json *j) {
  j->line = 1;
  pw_json_open (j, "columns", '[');
  for (int i = 0; i < x->columns; i++) {
    int count;
    double rms = report_rms (x, i, &count);
    j->line = 1;
    pw_json_open (j, NULL, '{');
    pw_json_text (j, "name", x->name[i]);
    pw_json_text (j, "unit", x->unit[i]);
    pw_json_number (j, "data", count);
    pw_json_number (j, "rms", rms);
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

/* Rows of a square matrix of the unknowns. */
static void report_json_matrix (const pw_fit *x, pw_json *j, const char *key, int correlation) {
  int n = x->unknowns.count;
  pw_json_open (j, key, '[');
  for (int i = 0; i < n; i++) {
    j->line = 1;
    pw_json_open (j, NULL, '[');
    for (int k = 0; k < n; k++)
      pw_json_number (j, NULL, correlation ? report_correlation (x, i, k) : x->covariance[i * n + k]);
    pw_json_close (j, ']');
  }
  pw_json_close (j, ']');
}

/* Where each search ended. */
static void report_json_minima (const pw_fit *x, pw_json *j) {
  int n = x->unknowns.count;
  pw_json_open (j, "searches", '[');
  for (const double *minimum = x->minimum; minimum < x->minimum + x->starts * (1 + n); minimum += 1 + n) {
    j->line = 1;
    pw_json_open (j, NULL, '{');
    pw_json_number (j, "chi2", *minimum);
    pw_numbers_json (j, "values", minimum + 1, n);
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
}

void pw_fit_json (const pw_fit *x, const char *status, FILE *f) {
  pw_json json = { .f = f, .lines = 2 }, *j = &json;
  char options[REPORT_OPTIONS];
  pw_json_open (j, NULL, '{');
  pw_json_number (j, "schema", 1);
  pw_json_text (j, "model", pw_file_name (x->m.file));
  pw_json_text (j, "status", status);
  pw_json_text (j, "data", x->data_path);
  pw_json_text (j, "options",
                pw_unknowns_options (&x->unknowns, x->estimate, options, sizeof options) ? options : NULL);
  pw_json_text (j, "method", x->unknowns.method);
  pw_json_number (j, "residuals", x->residuals);
  pw_json_number (j, "freedom", pw_fit_freedom (x));
  pw_json_flag (j, "weighted", x->weighted);
  pw_json_number (j, "chi2", x->chi2);
  pw_json_number (j, "confidence", x->confidence);
  pw_json_number (j, "rank", x->rank);
  pw_json_number (j, "runs", (double)x->runs);
  pw_json_number (j, "iterations", x->iterations);
  pw_json_text (j, "derivatives", x->by_differences ? "differences" : "variational");
  pw_json_open (j, "unknowns", '[');
  for (int i = 0; i < x->unknowns.count; i++) report_json_unknown (x, j, i);
  pw_json_close (j, ']');
  report_json_columns (x, j);
  report_json_matrix (x, j, "covariance", 0);
  report_json_matrix (x, j, "correlation", 1);
  report_json_minima (x, j);
  pw_json_close (j, '}');
}

int pw_fit_table (const pw_fit *x, FILE *f, pw_error *error) {
  static const char *const part[] = { "", ".model", ".residual", ".sigma" };
  pw_text t = { .chars = NULL };
  char name[300];
  pw_text_name (&t, "t", "s");
  for (int i = 0; i < x->columns; i++)
    for (int k = 0; k < 4; k++) {
      snprintf (name, sizeof name, "%s%s", x->name[i], part[k]);
      pw_text_name (&t, name, x->unit[i]);
    }
  int status = pw_text_line (&t, f, x->path, error);
  for (int row = 0; row < x->rows && status == PW_OK; row++) {
    pw_text_number (&t, x->t[row]);
    for (int i = 0; i < x->columns; i++) {
      int k = i * x->rows + row;
      const double value[] = { x->value[k], x->model[k], x->model[k] - x->value[k], x->weighted ? x->sigma[k] : NAN };
      for (int c = 0; c < 4; c++) pw_text_number (&t, value[c]);
    }
    status = pw_text_line (&t, f, x->path, error);
  }
  return status;
}

/* ---- Figures ---- */

/* A block per column: t, data, standard deviation, model. */
static int report_data (const void *context, FILE *f, pw_error *error) {
  const pw_fit *x = context;
  char number[32];
  (void)error;
  fputs ("# t [s], data, standard deviation, model; a block per column\n", f);
  for (int i = 0; i < x->columns; i++) {
    for (int k = 0; k < x->rows; k++) {
      int c = i * x->rows + k;
      const double value[] = { x->t[k], x->value[c], x->weighted ? x->sigma[c] : 0, x->model[c] };
      for (int v = 0; v < 4; v++) fprintf (f, "%s%s", v ? " " : "", pw_format (number, value[v], 12));
      fputc ('\n', f);
    }
    fputs ("\n\n", f);
  }
  return PW_OK;
}

static void report_variables (const void *context, FILE *f) {
  const pw_fit *x = context;
  int panels = x->columns < REPORT_PANELS ? x->columns : REPORT_PANELS;
  fprintf (f, "panels = %d\nweighted = %d\narray label[%d]\n", panels, x->weighted, panels);
  for (int i = 0; i < panels; i++) pw_figure_label (f, "label", i + 1, x->name[i], x->unit[i]);
}

int pw_fit_draw (const pw_fit *x, pw_error *error) {
  return pw_figure_write (&x->line, &x->m, x->plots_path, "fit", x, report_data, report_variables, error);
}
