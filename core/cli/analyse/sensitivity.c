/* pinwheel sensitivity: derivatives of outputs of a run with respect to parameters and initial values. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "print_table.h"
#include "report.h"
#include "sensitivity.h"
#include "text.h"

/* ---- The terminal ---- */

enum { SENSITIVITY_DIGITS = 9, SENSITIVITY_UNIT = 64, SENSITIVITY_ROWS = 1000 };

/* "m per kg"; "" if both are numbers, and of a formula, whose unit is unknown. */
static const char *sensitivity_unit (const pw_sensitivity *x, int o, int p, char unit[SENSITIVITY_UNIT]) {
  char of[SENSITIVITY_UNIT / 2];
  const char *by = x->unknowns.list[p].unit;
  pw_outcome_unit (&x->outcomes, o, of, sizeof of);
  if (*of == 0 && x->outcomes.outcome[o].formula) return strcpy (unit, "");
  snprintf (unit, SENSITIVITY_UNIT, *by ? "%s per %s" : "%s", *of || *by == 0 ? of : "1", by);
  return unit;
}

/* Relative changes beyond this one are those of an output that is 0 but for round-off. */
static const double SENSITIVITY_ELASTIC = 1e12;

/* The derivative of an output, its error, and the relative change for a relative change of the unknown. */
static void sensitivity_result (const pw_sensitivity *x, int o, int p, double result[3]) {
  double by = x->unknowns.list[p].value;
  result[0] = pw_sensitivity_derivative (x, o, p, x->end_slope);
  result[1] = fabs (pw_sensitivity_derivative (x, o, p, x->end_error));
  result[2] = result[0] * by / pw_outcome_value (&x->outcomes, o, NULL);
  if (by == 0 || !(fabs (result[2]) < SENSITIVITY_ELASTIC)) result[2] = NAN;
}

static void sensitivity_print (const pw_sensitivity *x) {
  char value[32], unit[SENSITIVITY_UNIT], digits[32];
  static const char *const head[] = { "value", "derivative", "unit", "error", "elasticity", NULL };
  printf ("%s by %s to t = %.9g s\n", pw_file_name (x->m.file), x->unknowns.method, pw_run_time (x->base.run));
  for (int o = 0; o < x->outcomes.outcomes && !x->stopped; o++) {
    pw_outcome_unit (&x->outcomes, o, unit, sizeof unit);
    pw_cli_print (stdout, "\n%s = %s %s\n", x->of[o], pw_format (value, pw_outcome_value (&x->outcomes, o, NULL), 12),
                  unit);
    for (pw_table table = { 0 }; pw_table_pass (&table);) {
      pw_cell (&table, -14, "by");
      for (const char *const *h = head; *h; h++) pw_cell (&table, *h == head[2] ? -8 : 12, *h);
      pw_row_end (&table);
      for (int p = 0; p < x->unknowns.count; p++) {
        double result[3];
        sensitivity_result (x, o, p, result);
        pw_cell_unit (&table, -14, x->unknowns.list[p].name, x->unknowns.list[p].unit);
        pw_cell_number (&table, 12, x->unknowns.list[p].value, SENSITIVITY_DIGITS);
        pw_cell (&table, 12, isnan (result[0]) ? "none" : pw_format (digits, result[0], SENSITIVITY_DIGITS));
        pw_cell (&table, -8, sensitivity_unit (x, o, p, unit));
        pw_cell_number (&table, 12, result[1], 2);
        pw_cell_number (&table, 12, result[2], 5);
        pw_row_end (&table);
      }
    }
  }
}

/* 1 if the error exceeds 1 % of the derivative, and of the output (1e-6 at least, in SI units) for a change of the
 * unknown by its size, of which direction.step is 1e-5. */
static int sensitivity_is_uncertain (const pw_sensitivity *x, int o, int p) {
  double result[3], value = pw_outcome_value (&x->outcomes, o, NULL), size = 1e5 * fabs (x->direction[p].step);
  sensitivity_result (x, o, p, result);
  return result[1] > 0.01 * fabs (result[0]) && result[1] * size > fmax (0.01 * fabs (value), 1e-6);
}

static void sensitivity_warn (const pw_sensitivity *x) {
  char list[1000] = "";
  size_t used = 0;
  for (int o = 0; o < x->outcomes.outcomes && !x->stopped; o++)
    for (int p = 0; p < x->unknowns.count && used < sizeof list; p++)
      if (sensitivity_is_uncertain (x, o, p))
        used += (size_t)snprintf (list + used, sizeof list - used, "%s%s by %s", used ? ", " : "", x->of[o],
                                  x->unknowns.list[p].name);
  if (used)
    pw_cli_say ("pinwheel: derivatives with errors above 1 %%, which the motion amplifies or the steps of the run "
                "cause: %s%s\n",
                list, used < sizeof list ? "" : " ...");
}

/* ---- Files ---- */

static void sensitivity_json (const void *context, pw_json *j) {
  const pw_sensitivity *x = context;
  char unit[SENSITIVITY_UNIT];
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "model", pw_file_name (x->m.file));
  pw_json_text (j, "method", x->unknowns.method);
  pw_json_number (j, "t_end", pw_run_time (x->base.run));
  pw_json_flag (j, "complete", !x->stopped);
  pw_json_number (j, "cpu_seconds", x->cpu);
  pw_json_open (j, "outputs", '[');
  for (int o = 0; o < x->outcomes.outcomes && !x->stopped; o++) {
    pw_json_open (j, NULL, '{');
    pw_json_text (j, "output", x->of[o]);
    pw_json_text (j, "unit", pw_outcome_unit (&x->outcomes, o, unit, sizeof unit));
    pw_json_number (j, "value", pw_outcome_value (&x->outcomes, o, NULL));
    pw_json_open (j, "derivatives", '[');
    for (int p = 0; p < x->unknowns.count; p++) {
      double result[3];
      sensitivity_result (x, o, p, result);
      pw_json_open (j, NULL, '{');
      pw_json_text (j, "by", x->unknowns.list[p].name);
      pw_json_number (j, "value", x->unknowns.list[p].value);
      pw_json_text (j, "unit", sensitivity_unit (x, o, p, unit));
      pw_json_number (j, "derivative", result[0]);
      pw_json_number (j, "error", result[1]);
      pw_json_number (j, "elasticity", result[2]);
      pw_json_close (j, '}');
    }
    pw_json_close (j, ']');
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* A header's cell, in quotes if the output contains a comma. */
static void sensitivity_cell (pw_text *t, const char *name, const char *unit) {
  char text[400];
  snprintf (text, sizeof text, *unit ? "%s [%s]" : "%s", name, unit);
  (strchr (name, ',') ? pw_text_quoted : pw_text_cell) (t, text);
}

static int sensitivity_csv (const void *context, FILE *f, pw_error *error) {
  const pw_sensitivity *x = context;
  char unit[SENSITIVITY_UNIT], name[300];
  pw_text t = { 0 };
  pw_text_cell (&t, "t [s]");
  for (int o = 0; o < x->outcomes.outcomes; o++) {
    if (!pw_sensitivity_in_table (x, o)) continue;
    sensitivity_cell (&t, x->of[o], pw_outcome_unit (&x->outcomes, o, unit, sizeof unit));
    for (int p = 0; p < x->unknowns.count; p++) {
      snprintf (name, sizeof name, "d(%.140s)/d(%.140s)", x->of[o], x->unknowns.list[p].name);
      sensitivity_cell (&t, name, sensitivity_unit (x, o, p, unit));
    }
  }
  int status = pw_text_line (&t, f, x->folder, error);
  for (int i = 0; i < x->rows && status == PW_OK; i++) {
    for (int k = 0; k < x->columns; k++) pw_text_number (&t, x->row[(size_t)i * (size_t)x->columns + (size_t)k]);
    status = pw_text_line (&t, f, x->folder, error);
  }
  return status;
}

static void sensitivity_label (const pw_sensitivity *x, int o, int p, char *label, size_t size) {
  char unit[SENSITIVITY_UNIT];
  const char *name = x->unknowns.list[p].name;
  if (x->unknowns.list[p].value != 0) {
    pw_outcome_unit (&x->outcomes, o, unit, sizeof unit);
    snprintf (label, size, *unit ? "%.100s × ∂/∂%.100s [%s]" : "%.100s × ∂/∂%.100s", name, name, unit);
  } else {
    sensitivity_unit (x, o, p, unit);
    snprintf (label, size, *unit ? "∂/∂%.100s [%s]" : "∂/∂%.100s", name, unit);
  }
}

/* A block for each derivative. */
static int sensitivity_data (const void *context, FILE *f, pw_error *error) {
  const pw_sensitivity *x = context;
  const double *row = x->row;
  size_t columns = (size_t)x->columns;
  (void)error;
  for (int c = 1; c < x->columns; c++) {
    int p = (c - 1) % (1 + x->unknowns.count) - 1;
    if (p < 0) continue;
    double factor =
        x->unknowns.list[p].value != 0 ? x->unknowns.list[p].value : 1; /* so that unknowns can be compared */
    for (int k = 0; k < x->rows; k++)
      fprintf (f, "%.9g %.9g\n", row[(size_t)k * columns], row[(size_t)k * columns + (size_t)c] * factor);
    fputs ("\n\n", f);
  }
  return PW_OK;
}

static void sensitivity_variables (const void *context, FILE *f) {
  const pw_sensitivity *x = context;
  int panels = 0;
  fprintf (f, "unknowns = %d\nt_end = %.10g\n", x->unknowns.count, x->unknowns.t_end);
  for (int i = 0; i < x->outcomes.outcomes; i++) panels += pw_sensitivity_in_table (x, i);
  fprintf (f, "panels = %d\narray output[%d]\narray label[%d]\n", panels, panels, panels * x->unknowns.count);
  for (int i = 0, k = 0; i < x->outcomes.outcomes; i++) {
    char label[300];
    if (!pw_sensitivity_in_table (x, i)) continue;
    pw_figure_element (f, "output", ++k, x->of[i]);
    for (int p = 0; p < x->unknowns.count; p++) {
      sensitivity_label (x, i, p, label, sizeof label);
      pw_figure_element (f, "label", (k - 1) * x->unknowns.count + p + 1, label);
    }
  }
}

static int sensitivity_write (const pw_sensitivity *x, pw_error *error) {
  int status = pw_figure_tables (x->folder, "sensitivity", 5, x, sensitivity_csv, sensitivity_json, error);
  if (status != PW_OK || x->columns < 2 || x->rows < 2) return status;
  return pw_figure_write (&x->line, &x->m, x->folder, "sensitivity", x, sensitivity_data, sensitivity_variables, error);
}

/* ---- The command ---- */

/* An initial value is the consistent one. */
static int sensitivity_unknown (const pw_sensitivity *x, pw_unknown *u, const pw_run *r, const char *name,
                                pw_error *error) {
  int n = pw_system_coordinates (x->m.system), status = pw_unknown_find (u, &x->m, name, error);
  if (status == PW_OK && u->state >= 0)
    u->value = u->state < n ? pw_run_initial (r)->q[u->state] : pw_run_initial (r)->v[u->state - n];
  if (status != PW_OK || u->parameter == NULL || u->parameter->domain != PW_COUNT) return status;
  return pw_fail (error, PW_INPUT, "%s is a count (%g): derivatives need a number that varies continuously", name,
                  u->value);
}

/* Finds the unknowns with a run of their own, which has their values. */
static int sensitivity_unknowns (pw_sensitivity *x, pw_error *error) {
  pw_unknowns *u = &x->unknowns;
  if (x->by == NULL) return pw_fail (error, PW_INPUT, "--by is missing: expected a parameter or an initial value");
  if (x->of == NULL) return pw_fail (error, PW_INPUT, "--of is missing: expected an output, such as frame.x");
  while (x->by[u->count]) u->count++;
  u->list = calloc ((size_t)u->count, sizeof *u->list);
  if (u->list == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  pw_run *r = pw_run_open (x->m.system, u->method, &u->settings, error);
  int status = r ? PW_OK : error->status;
  for (int i = 0; i < u->count && status == PW_OK; i++) {
    status = sensitivity_unknown (x, &u->list[i], r, x->by[i], error);
    for (int k = 0; k < i && status == PW_OK; k++)
      if (strcmp (x->by[k], x->by[i]) == 0) status = pw_fail (error, PW_INPUT, "--by %s is given twice", x->by[i]);
  }
  pw_run_close (r);
  return status;
}

static int sensitivity_open (pw_sensitivity *x, pw_error *error) {
  int status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = pw_unknowns_open (&x->unknowns, &x->line, &x->m, error);
  if (status != PW_OK) return status;
  pw_unknowns_engine (&x->unknowns, 1);
  x->unknowns.settings.specialised = pw_cli_engine_code (&x->unknowns.engine);
  if (x->folder) x->dt = x->unknowns.t_end / SENSITIVITY_ROWS;
  status = pw_cli_requires ("--every", x->every, "-o DIR", x->folder != NULL, error);
  if (status == PW_OK) status = pw_cli_number ("--every", x->every, PW_POSITIVE, &x->dt, error);
  if (status == PW_OK) status = sensitivity_unknowns (x, error);
  return status == PW_OK ? pw_sensitivity_open (x, NULL, error) : status;
}

/* Computations with better steps of the differences, at most. */
enum { SENSITIVITY_REPEATED = 5 };

/* Sets better steps of the parameters' differences; 1 if there are any. */
static int sensitivity_steps (pw_sensitivity *x) {
  int better = 0;
  for (int p = 0; p < x->unknowns.count && !x->stopped; p++) {
    double step = pw_variation_better_step (x->variation, p);
    x->unknowns.list[p].last_step = fabs (x->direction[p].step);
    if (x->unknowns.list[p].parameter == NULL || step == x->direction[p].step) continue;
    x->unknowns.list[p].step = fabs (step);
    better = 1;
  }
  return better;
}

/* Computes all derivatives anew. */
static int sensitivity_again (pw_sensitivity *x, pw_progress *progress, pw_error *error) {
  pw_sensitivity_close (x);
  *x = (pw_sensitivity){ .line = x->line,
                         .of = x->of,
                         .by = x->by,
                         .every = x->every,
                         .folder = x->folder,
                         .m = x->m,
                         .files = x->files,
                         .unknowns = x->unknowns,
                         .dt = x->dt };
  int status = pw_sensitivity_open (x, NULL, error);
  return status == PW_OK ? pw_sensitivity_compute (x, progress, error) : status;
}

static int sensitivity_compute (pw_sensitivity *x, pw_error *error) {
  pw_progress progress;
  double begun = pw_cpu_clock ();
  pw_stop_catch ();
  pw_progress_start (&progress, pw_file_name (x->m.file), x->unknowns.t_end);
  int status = pw_sensitivity_compute (x, &progress, error);
  for (int i = 0; i < SENSITIVITY_REPEATED && status == PW_OK && sensitivity_steps (x); i++) {
    status = sensitivity_again (x, &progress, error);
    if (status == PW_OK || status == PW_RESOURCE) continue;
    for (int p = 0; p < x->unknowns.count; p++) x->unknowns.list[p].step = x->unknowns.list[p].last_step;
    *error = (pw_error){ 0 }; /* a model may refuse a longer step */
    status = sensitivity_again (x, &progress, error);
    break;
  }
  pw_progress_end (&progress);
  pw_stop_release ();
  x->cpu = pw_cpu_clock () - begun;
  return status;
}

static int sensitivity_check (const pw_sensitivity *x, pw_error *error) {
  for (int o = 0; o < x->outcomes.outcomes && !x->stopped; o++)
    if (!isfinite (pw_outcome_value (&x->outcomes, o, NULL)))
      return pw_fail (error, PW_METHOD, "%.300s is not a finite number at the end of the run", x->of[o]);
  return PW_OK;
}

static int sensitivity_command (void *options, pw_error *error) {
  pw_sensitivity *x = options;
  int status = sensitivity_open (x, error);
  if (status == PW_OK) status = pw_figure_results (&x->line, &x->m, x->folder, "sensitivity", &x->files, error);
  if (status == PW_OK) pw_report_model (x->m.model);
  if (status == PW_OK) status = sensitivity_compute (x, error);
  if (status == PW_OK) status = sensitivity_check (x, error);
  if (status == PW_OK) sensitivity_print (x), sensitivity_warn (x);
  if (status == PW_OK && x->folder) status = sensitivity_write (x, error);
  if (status == PW_OK && x->stopped) status = pw_limit_status (&x->limit, pw_run_time (x->base.run), error);
  pw_files_close (&x->files);
  pw_sensitivity_close (x);
  pw_unknowns_close (&x->unknowns);
  pw_cli_close_model (&x->m);
  return status == PW_RETRY ? pw_cli_incomplete (&x->line, error) : status;
}

static const struct poptOption sensitivity_options[] = {
  PW_OPTION_GROUP ("Sensitivity"),
  PW_LIST_OPTION (pw_sensitivity, of, "of", 0, "OUTPUT",
                  "A column of the table of `run` at the end, or its max:, min:, mean:, integral: or rms:, such as "
                  "max:B.Fx; or an expression of these; repeatable"),
  PW_LIST_OPTION (pw_sensitivity, by, "by", 0, "NAME",
                  "A parameter, or the initial value of a state, such as body.vx; repeatable"),
  PW_TEXT_OPTION (pw_sensitivity, every, "every", 0, "DT",
                  "Time between rows of the table [s] (default a thousandth of the final time)"),
  PW_TEXT_OPTION (pw_sensitivity, folder, "output", 'o', "DIR",
                  "Write sensitivity.csv (outputs and derivatives along the run), sensitivity.json and a figure into a "
                  "folder"),
  PW_WIDTH_OPTION,
  PW_METHOD_OPTIONS,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_sensitivity = {
  .name = "sensitivity",
  .synopsis = "MODEL --of OUTPUT --by NAME [OPTION...]",
  .summary = "differentiate outputs of a run with respect to parameters and initial values",
  .help = "Differentiate outputs of a run with respect to parameters and initial values, at the end and along the run, "
          "by the variational equations: exact in the states, by differences of compiled models in the parameters, "
          "with the error of these.",
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_sensitivity),
  .function = sensitivity_command,
  .options = sensitivity_options,
};
