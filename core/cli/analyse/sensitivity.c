/* The command `sensitivity`: derivatives of outputs of a run with respect to parameters and initial values. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "figure.h"
#include "print_table.h"
#include "report.h"
#include "sensitivity.h"
#include "text.h"

enum {
  SENSITIVITY_DIGITS = 9,   /* of numbers in the text */
  SENSITIVITY_UNIT = 64,    /* longest unit, its end included */
  SENSITIVITY_NAME = 10000, /* likewise the name of a column of the table; longer names are cut off */
  SENSITIVITY_ROWS = 1000,  /* of the table after the first, unless --every is given */
  SENSITIVITY_REPEATED = 5  /* computations with better steps of the differences, at most */
};

typedef struct {
  pw_cli_line line;
  const char **by; /* of --by, ended by NULL */
  const char *every, *folder;
  pw_cli_model m;
  pw_files files;
  pw_sensitivity sens;
  double cpu; /* processor time of the computation [s] */
} sensitivity;

/* ---- Text ---- */

/* The unit of a derivative, "m per kg"; "" if it has none, or the output is a formula, whose unit is unknown. */
static const char *sensitivity_unit (const pw_sensitivity *sens, int output, int unknown, char unit[SENSITIVITY_UNIT]) {
  char of[SENSITIVITY_UNIT / 2];
  const char *by = sens->unknowns.list[unknown].unit;
  pw_outcome_unit (&sens->outcomes, output, of, sizeof of);
  if (sens->outcomes.outcome[output].formula) return strcpy (unit, "");
  snprintf (unit, SENSITIVITY_UNIT, *by ? "%s per %s" : "%s", *of || *by == 0 ? of : "1", by);
  return unit;
}

typedef struct {
  double derivative, error;
  double elasticity; /* relative change of the output per relative change of the unknown; NaN: there is none */
} sensitivity_result;

/* The error is that of the differences and of the integration of derivatives, plus that of the run, which is estimated
 * by the change of the derivative with larger tolerances. */
static sensitivity_result sensitivity_of (const pw_sensitivity *sens, int output, int unknown) {
  const double largest = 1e12; /* elasticities above it are those of an output that is 0 but for round-off */
  double derivative = pw_sensitivity_derivative (sens, output, unknown, sens->run_slope),
         error = fabs (pw_sensitivity_derivative (sens, output, unknown, sens->run_slope_error)),
         value = sens->unknowns.list[unknown].value,
         elasticity = derivative * value / pw_outcome_value (&sens->outcomes, output, NULL);
  if (sens->loose) error += fabs (derivative - sens->loose[output * sens->unknowns.count + unknown]);
  if (value == 0 || !(fabs (elasticity) < largest)) elasticity = NAN;
  return (sensitivity_result){ derivative, error, elasticity };
}

static void sensitivity_print (const pw_sensitivity *sens) {
  char unit[SENSITIVITY_UNIT];
  printf ("%s by %s to t = %.9g s\n", pw_file_name (sens->unknowns.m->file), sens->unknowns.method,
          pw_run_time (sens->base.run));
  for (int o = 0; o < sens->outcomes.outcomes && !sens->stopped; o++) {
    pw_outcome_unit (&sens->outcomes, o, unit, sizeof unit);
    pw_cli_print (stdout, "\n%s = %s %s\n", sens->of[o], PW_DIGITS (pw_outcome_value (&sens->outcomes, o, NULL), 12),
                  unit);
    for (pw_table table = { 0 }; pw_table_pass (&table);) {
      pw_cell (&table, -14, "by");
      pw_cell (&table, 12, "value");
      pw_cell (&table, 12, "derivative");
      pw_cell (&table, -8, "unit");
      pw_head (&table, 12, 12, (const char *[]){ "error", "elasticity", NULL });
      for (int p = 0; p < sens->unknowns.count; p++) {
        const sensitivity_result result = sensitivity_of (sens, o, p);
        const pw_unknown *u = &sens->unknowns.list[p];
        pw_cell_unit (&table, -14, u->name, u->unit);
        pw_cell_number (&table, 12, u->value, SENSITIVITY_DIGITS);
        pw_cell (&table, 12, isnan (result.derivative) ? "none" : PW_DIGITS (result.derivative, SENSITIVITY_DIGITS));
        pw_cell (&table, -8, sensitivity_unit (sens, o, p, unit));
        pw_cell_number (&table, 12, result.error, 2);
        pw_cell_number (&table, 12, result.elasticity, 5);
        pw_row_end (&table);
      }
    }
  }
}

/* 1 if the error exceeds 1 % of the derivative and, times the size of the unknown, 1 % of the output and 1e-6 in SI
 * units. */
static int sensitivity_is_uncertain (const pw_sensitivity *sens, int output, int unknown) {
  const sensitivity_result result = sensitivity_of (sens, output, unknown);
  return result.error > 0.01 * fabs (result.derivative) &&
         result.error * sens->unknowns.list[unknown].size >
             fmax (0.01 * fabs (pw_outcome_value (&sens->outcomes, output, NULL)), 1e-6);
}

static void sensitivity_warn (const pw_sensitivity *sens) {
  char list[1000] = "";
  size_t used = 0;
  for (int o = 0; o < sens->outcomes.outcomes && !sens->stopped; o++)
    for (int p = 0; p < sens->unknowns.count && used < sizeof list; p++)
      if (sensitivity_is_uncertain (sens, o, p))
        used += (size_t)snprintf (list + used, sizeof list - used, "%s%s by %s", used ? ", " : "", sens->of[o],
                                  sens->unknowns.list[p].name);
  if (used)
    pw_cli_say ("pinwheel: derivatives with errors above 1 %%, which the motion amplifies or the steps of the run "
                "cause: %s%s\n",
                list, used < sizeof list ? "" : " ...");
}

/* ---- Files ---- */

static void sensitivity_json (const void *context, pw_json *j) {
  const sensitivity *cmd = context;
  const pw_sensitivity *sens = &cmd->sens;
  char unit[SENSITIVITY_UNIT];
  pw_json_open (j, NULL, '{');
  pw_json_text (j, "model", pw_file_name (sens->unknowns.m->file));
  pw_json_text (j, "method", sens->unknowns.method);
  pw_json_number (j, "t_end", pw_run_time (sens->base.run));
  pw_json_flag (j, "complete", !sens->stopped);
  pw_json_number (j, "cpu_seconds", cmd->cpu);
  pw_json_open (j, "outputs", '[');
  for (int o = 0; o < sens->outcomes.outcomes && !sens->stopped; o++) {
    pw_json_open (j, NULL, '{');
    pw_json_text (j, "output", sens->of[o]);
    pw_json_text (j, "unit", pw_outcome_unit (&sens->outcomes, o, unit, sizeof unit));
    pw_json_number (j, "value", pw_outcome_value (&sens->outcomes, o, NULL));
    pw_json_open (j, "derivatives", '[');
    for (int p = 0; p < sens->unknowns.count; p++) {
      const sensitivity_result result = sensitivity_of (sens, o, p);
      pw_json_open (j, NULL, '{');
      pw_json_text (j, "by", sens->unknowns.list[p].name);
      pw_json_number (j, "value", sens->unknowns.list[p].value);
      pw_json_text (j, "unit", sensitivity_unit (sens, o, p, unit));
      pw_json_number (j, "derivative", result.derivative);
      pw_json_number (j, "error", result.error);
      pw_json_number (j, "elasticity", result.elasticity);
      pw_json_close (j, '}');
    }
    pw_json_close (j, ']');
    pw_json_close (j, '}');
  }
  pw_json_close (j, ']');
  pw_json_close (j, '}');
}

/* Adds a cell "NAME [UNIT]", in quotes if the name contains a comma. */
static void sensitivity_cell (pw_text *t, const char *name, const char *unit) {
  char text[SENSITIVITY_NAME + SENSITIVITY_UNIT];
  snprintf (text, sizeof text, *unit ? "%s [%s]" : "%s", name, unit);
  (strchr (name, ',') ? pw_text_quoted : pw_text_cell) (t, text);
}

static int sensitivity_csv (const void *context, FILE *f, pw_error *error) {
  const sensitivity *cmd = context;
  const pw_sensitivity *sens = &cmd->sens;
  char unit[SENSITIVITY_UNIT];
  pw_text t = { 0 };
  pw_text_cell (&t, "t [s]");
  for (int o = 0; o < sens->outcomes.outcomes; o++) {
    if (!pw_sensitivity_in_table (sens, o)) continue;
    sensitivity_cell (&t, sens->of[o], pw_outcome_unit (&sens->outcomes, o, unit, sizeof unit));
    for (int p = 0; p < sens->unknowns.count; p++)
      sensitivity_cell (&t, PW_PRINTED (SENSITIVITY_NAME, "d(%s)/d(%s)", sens->of[o], sens->unknowns.list[p].name),
                        sensitivity_unit (sens, o, p, unit));
  }
  int status = pw_text_line (&t, f, cmd->folder, error);
  for (int i = 0; i < sens->rows && status == PW_OK; i++) {
    for (int k = 0; k < sens->columns; k++)
      pw_text_number (&t, sens->row[(size_t)i * (size_t)sens->columns + (size_t)k]);
    status = pw_text_line (&t, f, cmd->folder, error);
  }
  return status;
}

/* The label of a curve of sensitivity_data. */
static void sensitivity_label (const pw_sensitivity *sens, int output, int unknown, char *label, size_t size) {
  char unit[SENSITIVITY_UNIT], buffer[FIGURE_NAME + 4];
  const char *name = pw_figure_name (sens->unknowns.list[unknown].name, buffer);
  if (sens->unknowns.list[unknown].value != 0) {
    pw_outcome_unit (&sens->outcomes, output, unit, sizeof unit);
    snprintf (label, size, *unit ? "%s × ∂/∂%s [%s]" : "%s × ∂/∂%s", name, name, unit);
  } else {
    sensitivity_unit (sens, output, unknown, unit);
    snprintf (label, size, *unit ? "∂/∂%s [%s]" : "∂/∂%s", name, unit);
  }
}

/* Writes a block for each derivative, times the value of the unknown unless that is 0, so that unknowns can be
 * compared. */
static int sensitivity_data (const void *context, FILE *f, pw_error *error) {
  const pw_sensitivity *sens = &((const sensitivity *)context)->sens;
  const double *row = sens->row;
  size_t columns = (size_t)sens->columns;
  (void)error;
  for (int c = 1; c < sens->columns; c++) {
    int p = (c - 1) % (1 + sens->unknowns.count) - 1; /* -1: the output itself */
    if (p < 0) continue;
    double factor = sens->unknowns.list[p].value != 0 ? sens->unknowns.list[p].value : 1;
    for (int k = 0; k < sens->rows; k++)
      fprintf (f, "%.9g %.9g\n", row[(size_t)k * columns], row[(size_t)k * columns + (size_t)c] * factor);
    fputs ("\n\n", f);
  }
  return PW_OK;
}

static void sensitivity_variables (const void *context, FILE *f) {
  const pw_sensitivity *sens = &((const sensitivity *)context)->sens;
  int panels = 0;
  fprintf (f, "unknowns = %d\nt_end = %.10g\n", sens->unknowns.count, sens->unknowns.t_end);
  for (int i = 0; i < sens->outcomes.outcomes; i++) panels += pw_sensitivity_in_table (sens, i);
  fprintf (f, "panels = %d\narray output[%d]\narray label[%d]\n", panels, panels, panels * sens->unknowns.count);
  for (int i = 0, k = 0; i < sens->outcomes.outcomes; i++) {
    char label[300];
    if (!pw_sensitivity_in_table (sens, i)) continue;
    pw_figure_element (f, "output", ++k, sens->of[i]);
    for (int p = 0; p < sens->unknowns.count; p++) {
      sensitivity_label (sens, i, p, label, sizeof label);
      pw_figure_element (f, "label", (k - 1) * sens->unknowns.count + p + 1, label);
    }
  }
}

static int sensitivity_write (const sensitivity *cmd, pw_error *error) {
  int status = pw_figure_write_tables (cmd->folder, "sensitivity", 5, cmd, sensitivity_csv, sensitivity_json, error);
  if (status != PW_OK || cmd->sens.columns < 2 || cmd->sens.rows < 2) return status;
  return pw_figure_write (&cmd->line, &cmd->m, cmd->folder, "sensitivity", cmd, sensitivity_data, sensitivity_variables,
                          error);
}

/* ---- The command ---- */

static int sensitivity_open (sensitivity *cmd, pw_error *error) {
  pw_sensitivity *sens = &cmd->sens;
  int status = pw_cli_open (&cmd->m, &cmd->line, error);
  if (status == PW_OK) status = pw_unknowns_open (&sens->unknowns, &cmd->line, &cmd->m, error);
  if (status == PW_OK) status = pw_unknowns_engine (&sens->unknowns, 1, 1, error);
  if (status != PW_OK) return status;
  if (cmd->folder) sens->row_interval = sens->unknowns.t_end / SENSITIVITY_ROWS;
  status = pw_cli_requires ("--every", cmd->every, "-o DIR", cmd->folder != NULL, error);
  if (status == PW_OK) status = pw_cli_number ("--every", cmd->every, PW_POSITIVE, &sens->row_interval, error);
  if (status != PW_OK) return status;
  if (cmd->by == NULL) return pw_fail (error, PW_INPUT, "--by is missing: expected a parameter or an initial value");
  if (sens->of == NULL) return pw_fail (error, PW_INPUT, "--of is missing: expected an output, such as frame.x");
  return pw_unknowns_differentiated (&sens->unknowns, cmd->by, error);
}

/* Sets better steps of the differences for parameters; 1 if there are any. */
static int sensitivity_improve_steps (pw_sensitivity *sens) {
  int better = 0;
  for (int p = 0; p < sens->unknowns.count && !sens->stopped; p++) {
    pw_unknown *u = &sens->unknowns.list[p];
    double used = sens->direction[p].step, step = pw_variation_better_step (sens->variation, p);
    u->last_step = fabs (used);
    if (u->size == 0) u->size = u->last_step / PW_UNKNOWN_STEP;
    if (u->parameter == NULL || step == used) continue;
    u->step = fabs (step);
    better = 1;
  }
  return better;
}

/* The problem without its results. */
static pw_sensitivity sensitivity_copy (const pw_sensitivity *sens) {
  return (pw_sensitivity){ .of = sens->of, .unknowns = sens->unknowns, .row_interval = sens->row_interval };
}

/* Computes all derivatives again, with the steps now set. */
static int sensitivity_repeat (pw_sensitivity *sens, pw_progress *progress, pw_error *error) {
  pw_sensitivity_close (sens);
  *sens = sensitivity_copy (sens);
  return pw_sensitivity_compute (sens, NULL, progress, error);
}

#define SENSITIVITY_LOOSE 10. /* factor of the larger tolerances with which the error of a run is estimated */

/* Computes the derivatives with larger tolerances.  They are NaN if that fails; PW_RETRY after Ctrl-C. */
static int sensitivity_loosen (pw_sensitivity *sens, pw_progress *progress, pw_error *error) {
  int outputs = sens->outcomes.outcomes, unknowns = sens->unknowns.count;
  pw_sensitivity other = sensitivity_copy (sens);
  other.no_error = 1;
  other.row_interval = 0;
  other.unknowns.settings.rtol = fmin (0.1, SENSITIVITY_LOOSE * sens->unknowns.settings.rtol); /* must be below 1 */
  other.unknowns.settings.atol *= SENSITIVITY_LOOSE;
  sens->loose = pw_arena_alloc (&sens->arena, (size_t)(outputs * unknowns) * sizeof *sens->loose);
  if (sens->loose == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_sensitivity_compute (&other, NULL, progress, error);
  if (status == PW_OK && other.stopped)
    status = pw_limit_status (&other.base.limit, pw_run_time (other.base.run), error);
  for (int i = 0; i < outputs * unknowns; i++)
    sens->loose[i] =
        status == PW_OK ? pw_sensitivity_derivative (&other, i / unknowns, i % unknowns, other.run_slope) : NAN;
  pw_sensitivity_close (&other);
  return status;
}

/* Estimates the part of the errors that the error of the run causes. */
static int sensitivity_estimate_run_error (pw_sensitivity *sens, pw_progress *progress, pw_error *error) {
  if (sens->stopped || pw_cli_adaptive (sens->unknowns.method) == 0) return PW_OK;
  int status = sensitivity_loosen (sens, progress, error);
  if (status == PW_OK || status == PW_RESOURCE || status == PW_RETRY) return status;
  pw_cli_say ("pinwheel: errors are unknown: the run with %g times the tolerances fails: %s\n", SENSITIVITY_LOOSE,
              error->text);
  *error = (pw_error){ 0 };
  return PW_OK;
}

static int sensitivity_compute (pw_sensitivity *sens, pw_error *error) {
  pw_progress progress;
  pw_stop_catch ();
  pw_progress_start (&progress, pw_file_name (sens->unknowns.m->file), "s", 0, sens->unknowns.t_end);
  int status = pw_sensitivity_compute (sens, NULL, &progress, error);
  for (int i = 0; i < SENSITIVITY_REPEATED && status == PW_OK && sensitivity_improve_steps (sens); i++) {
    status = sensitivity_repeat (sens, &progress, error);
    if (status == PW_OK || status == PW_RESOURCE || pw_limit_over (&sens->base.limit)) continue; /* or after Ctrl-C */
    for (int p = 0; p < sens->unknowns.count; p++) sens->unknowns.list[p].step = sens->unknowns.list[p].last_step;
    *error = (pw_error){ 0 }; /* such as that of a model that refuses the value of a neighbour */
    status = sensitivity_repeat (sens, &progress, error);
    break;
  }
  if (status == PW_OK) status = sensitivity_estimate_run_error (sens, &progress, error);
  pw_progress_end (&progress);
  pw_stop_release ();
  return status;
}

static int sensitivity_check (const pw_sensitivity *sens, pw_error *error) {
  for (int o = 0; o < sens->outcomes.outcomes && !sens->stopped; o++)
    if (!isfinite (pw_outcome_value (&sens->outcomes, o, NULL)))
      return pw_fail (error, PW_METHOD, "%.300s is not a finite number at the end of the run", sens->of[o]);
  return PW_OK;
}

static int sensitivity_command (void *options, pw_error *error) {
  sensitivity *cmd = options;
  pw_sensitivity *sens = &cmd->sens;
  int status = sensitivity_open (cmd, error);
  if (status == PW_OK)
    status = pw_figure_lock_folder (&cmd->line, &cmd->m, cmd->folder, "sensitivity", &cmd->files, error);
  if (status == PW_OK)
    pw_report_model (&cmd->m), status = pw_report_initial_state (&cmd->m, cmd->sens.unknowns.limit, error);
  const double start = pw_seconds (CLOCK_PROCESS_CPUTIME_ID);
  if (status == PW_OK) status = sensitivity_compute (sens, error);
  const int without_errors = status == PW_RETRY && sens->loose; /* interrupted when all derivatives were known */
  if (without_errors) status = PW_OK;
  cmd->cpu = pw_seconds (CLOCK_PROCESS_CPUTIME_ID) - start;
  if (status == PW_OK) status = sensitivity_check (sens, error);
  if (status == PW_OK) sensitivity_print (sens), sensitivity_warn (sens);
  if (status == PW_OK && cmd->folder) status = sensitivity_write (cmd, error);
  if (status == PW_OK && sens->stopped)
    status = pw_limit_status (&sens->base.limit, pw_run_time (sens->base.run), error);
  if (status == PW_OK && without_errors) status = PW_RETRY;
  pw_files_close (&cmd->files);
  pw_sensitivity_close (sens);
  pw_unknowns_close (&sens->unknowns);
  pw_cli_close_model (&cmd->m);
  return status == PW_RETRY ? pw_cli_incomplete (&cmd->line, error) : status;
}

static const struct poptOption sensitivity_options[] = {
  PW_OPTION_GROUP ("Sensitivity"),
  PW_LIST_OPTION (sensitivity, sens.of, "of", 0, "OUTPUT",
                  "A column of the table of `run` at the end, or its max:, min:, mean:, integral: or rms:, such as "
                  "max:B.Fx; or an expression of these; repeatable"),
  PW_LIST_OPTION (sensitivity, by, "by", 0, "NAME",
                  "A parameter, or the initial value of a state, such as body.vx; repeatable"),
  PW_TEXT_OPTION (sensitivity, every, "every", 0, "DT",
                  "Time between rows of the table [s] (default a thousandth of the final time)"),
  PW_TEXT_OPTION (sensitivity, folder, "output", 'o', "DIR",
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
          "with the error of these and, if the method controls its error, of the run.",
  .options_size = sizeof (sensitivity),
  .function = sensitivity_command,
  .options = sensitivity_options,
};
