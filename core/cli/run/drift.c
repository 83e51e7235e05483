/* pinwheel drift: how constraint residuals and the energy defect grow in a long run, by method and stabilisation, and
 * how that depends on Baumgarte's alpha and beta and on the metric and frequency of projections. */
#include <math.h>
#include <string.h>
#include "study.h"

#define DRIFT_ROUND_OFF 1e-14                   /* scaled residuals below it are round-off: they have no growth */
enum { DRIFT_PARTS = 200, DRIFT_ROWS = 10000 }; /* parts of a run, each a point in the figures; rows at most */

/* What is measured: the scaled residuals of positions and velocities, and |balance| of a sample [J], the energy defect.
 * Three values of each: the largest of all steps, the largest of the last part, and the growth (drift_finish). */
enum { DRIFT_POSITION, DRIFT_VELOCITY, DRIFT_BALANCE, DRIFT_QUANTITIES };
enum { DRIFT_LARGEST, DRIFT_LAST, DRIFT_GROWTH, DRIFT_VALUES };

/* Groups of rows: the methods, then two stabilisations with different values of their options. */
enum { DRIFT_METHODS, DRIFT_BAUMGARTE, DRIFT_PROJECTION, DRIFT_GROUPS };
static const char *const drift_group[DRIFT_GROUPS] = { "methods", "baumgarte", "projection" };

/* The options that are varied, and their values unless --vary gives others. */
enum { DRIFT_ALPHA, DRIFT_BETA, DRIFT_EVERY, DRIFT_OPTIONS };
static const char *const drift_option[] = { "alpha", "beta", "every", NULL };
static const char *const drift_default_values[] = { "alpha=1,3,10,30,100,300,1000", "beta=1,10,100,1000",
                                                    "every=1,2,5,10,20,50,100" };

typedef struct {
  pw_study study;
  const char **vary;
  int only_methods;
  pw_axis axis[DRIFT_OPTIONS]; /* values of the options */
} pw_drift;

/* Indices in drift_columns: COLUMN_ALPHA + an option; COLUMN_QUANTITY: the first value of the first quantity. */
enum { COLUMN_ALPHA = 2, COLUMN_BETA = COLUMN_ALPHA + DRIFT_BETA, COLUMN_T = 6, COLUMN_QUANTITY, COLUMN_STEPS = 16 };

static const char *drift_group_name (const pw_row *row) {
  return drift_group[row->group];
}

static const pw_study_column drift_columns[] = {
  { "group", .text = drift_group_name },
  { "method", .text = pw_study_method },
  { "alpha", .unit = "1/s" },
  { "beta", .unit = "1/s" },
  { "every", .unit = "steps" },
  { "status", .text = pw_study_status },
  { "t", .unit = "s" },
  { "largest.position", NULL, "largest", 9, .format = "%.1e" },
  { "last.position", NULL, "last", 9, .format = "%.1e" },
  { "growth.position", NULL, "growth", 7, .format = "t^%.1f" },
  { "largest.velocity", NULL, "largest", 9, .format = "%.1e" },
  { "last.velocity", NULL, "last", 9, .format = "%.1e" },
  { "growth.velocity", NULL, "growth", 7, .format = "t^%.1f" },
  { "largest.balance", "J", "largest", 9, .format = "%.1e" },
  { "last.balance", "J", "last", 9, .format = "%.1e" },
  { "growth.balance", NULL, "growth", 7, .format = "t^%.1f" },
  { "steps", NULL, "steps", 10, .format = "%.0f" },
  { .name = "rejected" },
  { "rhs", NULL, "evaluat.", 10, .format = "%.0f" },
  { .name = "jacobians" },
  { "factorisations", NULL, "factor.", 9, .format = "%.0f" },
};

/* Reads "OPTION=RANGE". */
static int drift_read_values (pw_drift *drift, const char *text, pw_error *error) {
  char hint[PW_HINT];
  const char *name = PW_PART (text, strcspn (text, "="));
  int option = pw_find_name (drift_option, sizeof *drift_option, name, hint);
  if (option < 0) return pw_fail (error, PW_INPUT, "--vary %.100s: alpha, beta and every can be varied%s", text, hint);
  pw_axis *axis = &drift->axis[option];
  int status = pw_axis_read (axis, text, &drift->study.line.arena, error);
  for (long i = 0; status == PW_OK && i < axis->count; i++) {
    const char *expected = pw_domain_check (option == DRIFT_EVERY ? PW_COUNT : PW_NONNEGATIVE, pw_axis_value (axis, i));
    if (*expected)
      status = pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: expected %s", axis->name, axis->text, expected);
  }
  return status;
}

/* Forms the method of a stabilisation with its options and the first integrator of --methods that has `option`, else
 * rk4.  Options given there are kept if they do not belong to a stabilisation. */
static void drift_method (char method[STUDY_NAME], const pw_study *study, int option, const char *stabilisation) {
  const pw_method *integrator;
  char hint[PW_HINT];
  snprintf (method, STUDY_NAME, "rk4+%s", stabilisation);
  for (int i = 0; i < study->methods; i++) {
    if (pw_method_parse (study->method[i], study->line.methods, &integrator, NULL, NULL) != PW_OK ||
        pw_find_name (integrator->options, sizeof *integrator->options, drift_option[option], hint) < 0)
      continue;
    snprintf (method, STUDY_NAME, "%s+%s", integrator->name, stabilisation);
    for (const pw_option *o = integrator->options; o->name; o++) {
      const char *given = o->with ? NULL : strstr (study->method[i], PW_PRINTED (60, ":%s=", o->name));
      size_t end = strlen (method);
      if (given) snprintf (method + end, STUDY_NAME - end, "%.*s", 1 + (int)strcspn (given + 1, ":"), given);
    }
    return;
  }
}

/* Adds a row for a value of an option, which is also the abscissa of its point in the figure. */
static int drift_add (pw_drift *drift, int group, int curve, const char *stabilisation, const char *label, int option,
                      double value, pw_error *error) {
  char method[STUDY_NAME];
  drift_method (method, &drift->study, option, stabilisation);
  pw_row *row = pw_study_add (&drift->study, group, curve, method, 1, error);
  if (row == NULL) return PW_RESOURCE;
  snprintf (row->label, sizeof row->label, "%s", label);
  row->point[0][0] = row->value[COLUMN_ALPHA + option] = value;
  if (group == DRIFT_BAUMGARTE) row->value[COLUMN_BETA] = pw_axis_value (&drift->axis[DRIFT_BETA], curve);
  return PW_OK;
}

static int drift_plan_rows (pw_drift *drift, pw_error *error) {
  static const char *const metric[] = { "metric=mass", "metric=identity" };
  pw_study *study = &drift->study;
  const pw_axis *axis = drift->axis;
  double runs = study->methods + (double)axis[DRIFT_ALPHA].count * (double)axis[DRIFT_BETA].count +
                2 * (double)axis[DRIFT_EVERY].count;
  if (runs > DRIFT_ROWS) return pw_fail (error, PW_INPUT, "%.0f runs are too many; vary less", runs);
  for (int i = 0; i < study->methods; i++) {
    pw_row *row = pw_study_add (study, DRIFT_METHODS, i, study->method[i], DRIFT_PARTS, error);
    if (row == NULL) return PW_RESOURCE;
    for (int k = 0; k < DRIFT_PARTS; k++) row->point[k][0] = study->settings.span * (k + 1) / DRIFT_PARTS;
  }
  int status = PW_OK;
  /* pairs of alpha and beta; the figure has a curve for each beta */
  for (int j = 0; !drift->only_methods && j < axis[DRIFT_BETA].count; j++)
    for (long i = 0; i < axis[DRIFT_ALPHA].count && status == PW_OK; i++) {
      double alpha = pw_axis_value (&axis[DRIFT_ALPHA], i), beta = pw_axis_value (&axis[DRIFT_BETA], j);
      const char *label = PW_PRINTED (60, "beta = %s /s", PW_DIGITS (beta, 6));
      const char *stabilisation =
          PW_PRINTED (80, "baumgarte:alpha=%s:beta=%s", PW_DIGITS (alpha, 9), PW_DIGITS (beta, 9));
      status = drift_add (drift, DRIFT_BAUMGARTE, j, stabilisation, label, DRIFT_ALPHA, alpha, error);
    }
  /* intervals between projections; the figure has a curve for each metric */
  for (int j = 0; !drift->only_methods && j < 2; j++)
    for (long i = 0; i < axis[DRIFT_EVERY].count && status == PW_OK; i++) {
      double every = pw_axis_value (&axis[DRIFT_EVERY], i);
      const char *stabilisation = PW_PRINTED (80, "projection:%s:every=%.0f", metric[j], every);
      status = drift_add (drift, DRIFT_PROJECTION, j, stabilisation, metric[j], DRIFT_EVERY, every, error);
    }
  return status;
}

static int drift_plan (pw_study *study, pw_error *error) {
  pw_drift *drift = (pw_drift *)study;
  pw_run_defaults defaults = study->line.m.defaults;
  if (defaults.rtol == 0) defaults.rtol = PW_RTOL;
  pw_cli_settings (&study->line, &defaults, &study->settings, &study->limit);
  study->settings.ledger = 1;
  int status = pw_study_read_methods (study, "rk4+all,ida+all,galpha+all", error);
  for (int i = 0; status == PW_OK && i < DRIFT_OPTIONS; i++)
    status = drift_read_values (drift, drift_default_values[i], error);
  if (status == PW_OK && drift->only_methods && drift->vary)
    status = pw_fail (error, PW_INPUT, "--vary %s: not with --only-methods", *drift->vary);
  for (const char **v = drift->vary; status == PW_OK && v && *v; v++) status = drift_read_values (drift, *v, error);
  return status == PW_OK ? drift_plan_rows (drift, error) : status;
}

typedef struct {
  pw_visitor base;
  double first_half[DRIFT_QUANTITIES]; /* largest values up to t_end / 2 */
} drift_visitor;

/* Raises a maximum; NaN if either number is. */
static void drift_raise_largest (double *largest, double value) {
  if (!isnan (*largest) && !(value <= *largest)) *largest = value;
}

/* Called after every accepted step: samples inside a step of a method with projection show no drift.  Last values and
 * points are NaN until a step ends in their part; fmax ignores that NaN. */
static int drift_visit (pw_visitor *visitor, pw_run *run, pw_error *error) {
  pw_row *row = visitor->row;
  pw_sample sample;
  int status = pw_run_sample (run, pw_run_time (run), &sample, error);
  /* the part of the run; a time on the border of two parts, up to round-off, belongs to the earlier one */
  int part = (int)ceil (pw_run_time (run) / visitor->study->settings.span * DRIFT_PARTS - 1e-9) - 1;
  part = part < 0 ? 0 : part < DRIFT_PARTS ? part : DRIFT_PARTS - 1;
  if (status != PW_OK) return status;
  const double now[DRIFT_QUANTITIES] = { sample.position, sample.velocity, fabs (sample.balance) };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    double *value = &row->value[COLUMN_QUANTITY + DRIFT_VALUES * i];
    drift_raise_largest (&value[DRIFT_LARGEST], now[i]);
    if (part < DRIFT_PARTS / 2) drift_raise_largest (&((drift_visitor *)visitor)->first_half[i], now[i]);
    if (part == DRIFT_PARTS - 1) value[DRIFT_LAST] = fmax (value[DRIFT_LAST], now[i]);
    if (row->group == DRIFT_METHODS) row->point[part][1 + i] = fmax (row->point[part][1 + i], now[i]);
  }
  return PW_OK;
}

/* The growth p of a quantity that is proportional to t^p, from its largest values in the first half and in the whole
 * run; 0 if the largest is in the first half, NaN for a residual that is round-off.  The point of a row with a value of
 * an option has the largest value as ordinate. */
static void drift_finish (pw_row *row, int quantity, double first_half) {
  double *value = &row->value[COLUMN_QUANTITY + DRIFT_VALUES * quantity], largest = value[DRIFT_LARGEST];
  int known = quantity == DRIFT_BALANCE || largest > DRIFT_ROUND_OFF;
  if (row->state == ROW_DONE && known && first_half > 0) value[DRIFT_GROWTH] = log2 (largest / first_half);
  if (row->state == ROW_DONE && row->group != DRIFT_METHODS) row->point[0][1 + quantity] = largest;
  if (row->t == 0) value[DRIFT_LARGEST] = NAN;
}

static int drift_measure (pw_study *study, pw_row *row, pw_error *error) {
  pw_error run_error = { 0 };
  drift_visitor visitor = { .base = { .visit = drift_visit, .study = study, .row = row } };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) row->value[COLUMN_QUANTITY + DRIFT_VALUES * i] = 0;
  int status = pw_study_run (study, row, &study->settings, &visitor.base, &run_error);
  status = pw_study_record_run (study, row, status, &run_error, error);
  for (int i = 0; i < DRIFT_QUANTITIES; i++) drift_finish (row, i, visitor.first_half[i]);
  return status;
}

static int drift_begin (pw_study *study, pw_error *error) {
  (void)error;
  printf (
      "%s, %s s, steps of %s s or rtol %s: the largest value of all steps and of the last %g %%, and its growth\n\n",
      pw_file_name (study->line.m.file), PW_DIGITS (study->settings.span, 6), PW_DIGITS (study->settings.step, 6),
      PW_DIGITS (study->settings.rtol, 6), 100.0 / DRIFT_PARTS);
  return PW_OK;
}

/* DIR/drift-time.csv: the largest values in each part of the runs of methods. */
static int drift_write_times (const pw_study *study, pw_error *error) {
  pw_output *output = pw_figure_open_file (study->folder, "drift-time.csv", error);
  if (output == NULL) return error->status;
  pw_cells line = { .f = pw_output_stream (output) };
  pw_cells_text (&line, "method,t [s],position,velocity,balance [J]");
  pw_cells_end (&line);
  for (const pw_row *row = study->row; row < study->row + study->rows; row++)
    for (int k = 0; row->group == DRIFT_METHODS && k < row->points; k++) {
      if (isnan (row->point[k][1])) continue;
      pw_cells_text (&line, row->method);
      for (int i = 0; i <= DRIFT_QUANTITIES; i++) pw_cells_number (&line, row->point[k][i]);
      pw_cells_end (&line);
    }
  return pw_output_finish (output, error);
}

/* A panel for each quantity, against time, alpha > 0, or the interval between projections. */
static int drift_figures (pw_study *study, pw_error *error) {
  static const char *const name[] = { "drift", "drift-baumgarte", "drift-projection" },
                           *const title[] = { "drift of the constraints and the energy",
                                              "largest drift by Baumgarte's parameters",
                                              "largest drift by the interval between projections" },
                           *const axis[] = { "t [s]", "α [1/s]", "steps per projection (every)" },
                           *const label[] = { "position residual", "velocity residual", "energy defect [J]" };
  int status = drift_write_times (study, error);
  for (int group = 0; status == PW_OK && group < DRIFT_GROUPS; group++) {
    pw_curves c;
    status = pw_curves_open (&c, &study->line, study->folder, name[group], title[group], error);
    if (status != PW_OK) return status;
    for (int i = 0; i < DRIFT_QUANTITIES; i++) {
      pw_panel panel = { .x_label = axis[group], .y_label = label[i], .type = PW_PANEL_BELOW | PW_PANEL_LOG_Y };
      if (group == DRIFT_METHODS)
        panel.x[1] = study->settings.span;
      else
        panel.type |= PW_PANEL_LOG_X;
      pw_curves_panel (&c, &panel);
      pw_study_add_curves (study, group, &c, 0, 1 + i);
    }
    status = pw_study_close_figure (study, &c, error);
  }
  return status;
}

static int drift_command (void *options, pw_error *error) {
  static const char *const group[] = { "methods", "alpha and beta of Baumgarte", "metric and frequency of projection" };
  static const pw_study_type type = { .table_names = { "drift.csv", "drift-time.csv" },
                                      .row_noun = "runs",
                                      .group = group,
                                      .heading_above =
                                          "  residual of position     residual of velocity      energy defect [J]",
                                      .column = drift_columns,
                                      .columns = sizeof drift_columns / sizeof *drift_columns,
                                      .runs_per_row = 1,
                                      .time_column = COLUMN_T,
                                      .first_count_column = COLUMN_STEPS,
                                      .plan = drift_plan,
                                      .begin = drift_begin,
                                      .measure = drift_measure,
                                      .figures = drift_figures };
  return pw_study_command (options, &type, error);
}

static const struct poptOption drift_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_STUDY_METHODS_OPTION ("default rk4+all,ida+all,galpha+all"),
  PW_STEP_OPTIONS,
  PW_LIST_OPTION (
      pw_drift, vary, "vary", 'v', "OPTION=RANGE",
      "Values of an option: alpha and beta [1/s] of baumgarte, in all pairs (default 1 to 1000), every [steps] of "
      "projection, in both metrics (default 1 to 100); repeatable. RANGE: V1,V2,... or LOW:HIGH[:COUNT][:log]"),
  PW_JOBS_OPTION ("Number of concurrent runs (default: one per processor)"),
  PW_FLAG_OPTION (pw_drift, only_methods, "only-methods", "Omit the dependence of drift on options"),
  PW_TEXT_OPTION (pw_study, table_path, "output", 'o', "FILE.csv", "Write the table of all runs"),
  PW_TEXT_OPTION (pw_study, folder, "plots", 0, "DIR", "Write tables and figures into a folder"),
  PW_WIDTH_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_drift = {
  .name = "drift",
  .synopsis = "MODEL [OPTION...]",
  .summary = "compare the drift of constraints and energy in long runs, by stabilisation",
  .help =
      "Compare how constraint residuals and the energy defect grow during a long run, by method and stabilisation, and "
      "how they depend on the parameters of Baumgarte stabilisation and projection.",
  .options_size = sizeof (pw_drift),
  .function = drift_command,
  .options = drift_options,
};
