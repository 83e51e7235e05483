/* pinwheel compare: accuracy and cost of methods.  A row is a method with a tolerance or step size: a run with samples
 * and energies gives its errors, further runs without them its processor time. */
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>
#include <math.h>
#include <string.h>
#include "reference.h"

enum { COMPARE_REPEATS = 99 }; /* the largest value of --repeats */
#define COMPARE_FEW 3          /* timed runs of a row, at least, unless --repeats is less or they exceed the limit */
#define COMPARE_ENOUGH 0.5     /* total processor time [s] of a row after which no further run is timed */
#define COMPARE_CLEAR 10   /* error over uncertainty of the reference, so that orders are accurate to log2 1.1 = 0.14 */
#define COMPARE_AGREE 0.1  /* largest relative difference of the last two orders in the asymptotic range */
#define COMPARE_DECADE 1.6 /* factor of the cost if a tolerance is divided by ten, of a method of order 5: 10^(1/5) */

/* Explicit and implicit, one-step and multistep methods, each with the stabilisation that suits it. */
static const char compare_default_methods[] = "rk4+projection,erk5+projection,erk8+projection,bdf+projection,"
                                              "ida+baumgarte,ida+ggl,radau+ggl,galpha+index3";

typedef struct {
  pw_study study;
  int table;     /* 1: --table */
  int concludes; /* 1: a conclusion is printed, since errors of coordinates are known */
  const char *rtol_text, *step_text, *repeats_text;
  double finest_step; /* of --step-ladder [s] */
  double repeats;     /* timed runs of a row, at most */
  pw_reference reference;
} pw_compare;

/* ---- Columns ---- */

/* Indices in compare_columns.  The counts that pw_study_record_run fills begin with the steps. */
enum {
  COLUMN_LEVEL = 2,
  COLUMN_T = 4,
  COLUMN_ERROR,
  COLUMN_ORDER = COLUMN_ERROR + MOTION_ERRORS + 1,
  COLUMN_POSITION,
  COLUMN_VELOCITY,
  COLUMN_BALANCE,
  COLUMN_STEPS,
  COLUMN_CPU = COLUMN_STEPS + 5,
  COLUMN_SPREAD,
  COLUMN_PERCENT,
  COLUMN_REPEATS
};

static const char *compare_ladder_name (const pw_row *row) {
  return row->adaptive ? "rtol" : "step";
}

static const char *compare_upper_bounds (const pw_row *row) {
  return row->bound_names;
}

static const pw_study_column compare_columns[] = {
  { "method", .text = pw_study_method },
  { "ladder", .text = compare_ladder_name },
  { "rung", NULL, "or step", 10, .format = "%.4g" },
  { "status", .text = pw_study_status },
  { "t", .unit = "s" },
  { "end.length", "m", "m", 10, .format = "%.1e" },
  { "end.angle", "rad", "rad", 10, .format = "%.1e" },
  { "end.speed", .unit = "m/s" },
  { "end.rate", .unit = "rad/s" },
  { "largest.length", "m", "m", 10, .format = "%.1e" },
  { "largest.angle", "rad", "rad", 10, .format = "%.1e" },
  { "largest.speed", .unit = "m/s" },
  { "largest.rate", .unit = "rad/s" },
  { "multiplier", NULL, "multipl.", 10, .format = "%.1e" },
  { "below", .text = compare_upper_bounds },
  { "order", NULL, "order", 6, .format = "%.1f" },
  { "residual.position", NULL, "position", 10, .format = "%.1e" },
  { "residual.velocity", NULL, "velocity", 9, .format = "%.1e" },
  { "balance", "J", "energy J", 10, .format = "%.1e" },
  { "steps", NULL, "steps", 10, .format = "%.0f" },
  { .name = "rejected" },
  { "rhs", NULL, "evaluat.", 10, .format = "%.0f" },
  { "jacobians", NULL, "Jacob.", 8, .format = "%.0f" },
  { "factorisations", NULL, "factor.", 9, .format = "%.0f" },
  { "cpu", "s", "median s", 10, .format = "%.2e" },
  { "spread", .unit = "s" },
  { NULL, NULL, "spread", 7, .format = "%.0f %%" },
  { .name = "repeats" },
};

/* Coordinates of a row's point in the figures; the last two are errors. */
enum { POINT_LEVEL, POINT_CPU, POINT_RHS, POINT_LENGTH, POINT_ANGLE, POINT_COORDINATES };

/* ---- Ladders: the tolerances or step sizes of a method ---- */

typedef struct {
  double from, to; /* from >= to > 0 */
} compare_ladder;

/* "FROM:TO", in either order, or a single level. */
static int compare_read_ladder (const char *option, const char *text, compare_ladder *ladder, pw_error *error) {
  if (text == NULL) return PW_OK;
  char first[40];
  size_t n = strcspn (text, ":");
  if (n >= sizeof first || strlen (text + n) > sizeof first)
    return pw_fail (error, PW_INPUT, "%s %.80s: expected FROM:TO", option, text);
  snprintf (first, sizeof first, "%.*s", (int)n, text);
  double from = 0, to = 0;
  int status = pw_cli_number (option, first, PW_POSITIVE, &from, error);
  if (status == PW_OK) status = pw_cli_number (option, text[n] ? text + n + 1 : first, PW_POSITIVE, &to, error);
  if (status != PW_OK) return status;
  *ladder = (compare_ladder){ fmax (from, to), fmin (from, to) };
  if (ladder->from / ladder->to > 1e30) return pw_fail (error, PW_INPUT, "%s %.80s: too long a ladder", option, text);
  return PW_OK;
}

/* Level i of a ladder, or 0 after its end; steps are halved, tolerances divided by ten and rounded to 12 digits. */
static double compare_level (compare_ladder ladder, int adaptive, int i) {
  double level = ldexp (ladder.from, -i);
  if (adaptive) pw_read_number (PW_DIGITS (ladder.from / pow (10, i), 12), &level);
  return level >= ladder.to * (1 - 1e-9) ? level : 0;
}

/* All rows are one group; those of a method are a curve, with a point each. */
enum { COMPARE_GROUP = 0, COMPARE_POINTS = 1 };

/* Adds a row for each level of each method. */
static int compare_plan_rows (pw_study *study, const compare_ladder ladders[2], pw_error *error) {
  for (int i = 0; i < study->methods; i++) {
    int adaptive = pw_cli_adaptive (study->method[i]);
    double level;
    for (int k = 0; (level = compare_level (ladders[adaptive], adaptive, k)) > 0; k++) {
      pw_row *row = pw_study_add (study, COMPARE_GROUP, i, study->method[i], COMPARE_POINTS, error);
      if (row == NULL) return PW_RESOURCE;
      row->adaptive = adaptive;
      row->coarser_levels = k;
      row->level = row->value[COLUMN_LEVEL] = level;
      row->value[COLUMN_REPEATS] = 0;
    }
  }
  return PW_OK;
}

static int compare_plan (pw_study *study, pw_error *error) {
  pw_compare *compare = (pw_compare *)study;
  compare_ladder ladders[2] = { { 0.1, 1e-4 }, { 1e-3, 1e-12 } }; /* steps, tolerances */
  study->t_end = pw_cli_defaults (pw_file_table (study->compiled.file)).t_end;
  study->cpu_limit = 10;
  compare->repeats = 9;
  int status = pw_cli_number ("--t-end", study->line.t_end, PW_POSITIVE, &study->t_end, error);
  if (status == PW_OK) status = pw_cli_number ("--limit", study->line.limit, PW_POSITIVE, &study->cpu_limit, error);
  if (status == PW_OK) status = pw_cli_number ("--repeats", compare->repeats_text, PW_COUNT, &compare->repeats, error);
  if (status == PW_OK && compare->repeats > COMPARE_REPEATS)
    return pw_fail (error, PW_INPUT, "--repeats %s: at most %d", compare->repeats_text, COMPARE_REPEATS);
  if (status == PW_OK) status = pw_study_read_methods (study, compare_default_methods, error);
  if (status == PW_OK) status = compare_read_ladder ("--step-ladder", compare->step_text, &ladders[0], error);
  if (status == PW_OK) status = compare_read_ladder ("--rtol-ladder", compare->rtol_text, &ladders[1], error);
  study->limit.seconds = study->cpu_limit;
  compare->finest_step = ladders[0].to;
  return status == PW_OK ? compare_plan_rows (study, ladders, error) : status;
}

/* ---- A row ---- */

/* Errors below the uncertainty of the reference are replaced by it, and marked. */
static void compare_set_errors (const pw_compare *compare, const pw_motion *motion, pw_row *row) {
  const pw_reference *reference = &compare->reference;
  double *error = &row->value[COLUMN_ERROR];
  if (!reference->known) return;
  pw_motion_errors (compare->study.compiled.system, &reference->motion, motion, error);
  for (int i = 0; i < MOTION_ERRORS; i++) {
    if (reference->uncertainty[i] == 0) error[i] = NAN;
    if (!(error[i] <= reference->uncertainty[i])) continue;
    error[i] = reference->uncertainty[i];
    row->upper_bounds |= 1u << (COLUMN_ERROR + i);
    strcat (strcat (row->bound_names, *row->bound_names ? " " : ""), compare_columns[COLUMN_ERROR + i].name);
  }
}

/* The order p of a row and the coarser one before it, with twice the step h, from error ~ h^p, with the largest error
 * of lengths or, if that is unknown, of angles.  NaN if an error is unknown, or if that of the row is less than
 * COMPARE_CLEAR times the uncertainty. */
static double compare_pair_order (const pw_compare *compare, const pw_row *row) {
  const pw_row *coarser = row - 1;
  const double *error = &row->value[COLUMN_ERROR];
  int error_index = isnan (error[MOTION_LARGEST]) ? MOTION_LARGEST + MOTION_ANGLE : MOTION_LARGEST;
  int known = coarser->state == ROW_DONE && row->state == ROW_DONE &&
              error[error_index] > COMPARE_CLEAR * compare->reference.uncertainty[error_index];
  return known ? log2 (coarser->value[COLUMN_ERROR + error_index] / error[error_index]) : NAN;
}

/* The observed order of convergence: only of fixed steps and in the asymptotic range, where the last two orders agree
 * and errors are well above the uncertainty of the reference; else NaN. */
static double compare_order (const pw_compare *compare, const pw_row *row) {
  if (row->adaptive || row->coarser_levels < 2) return NAN;
  double order = compare_pair_order (compare, row), coarser_order = compare_pair_order (compare, row - 1);
  return order > 0 && fabs (order - coarser_order) <= COMPARE_AGREE * order ? order : NAN;
}

/* Measures runs without samples; the processor time of the row is their median. */
static int compare_measure_times (pw_compare *compare, pw_row *row, pw_error *error) {
  double cpu[COMPARE_REPEATS], sum = 0;
  int n = 0;
  while (n < compare->repeats && !(n >= COMPARE_FEW && sum > COMPARE_ENOUGH) && sum <= compare->study.cpu_limit) {
    int status = pw_motion_run (&compare->study, row, NULL, error);
    if (status != PW_OK) return status;
    sum += cpu[n++] = row->cpu;
  }
  gsl_sort (cpu, 1, (size_t)n);
  row->cpu = gsl_stats_median_from_sorted_data (cpu, 1, (size_t)n);
  row->value[COLUMN_REPEATS] = n;
  if (n < 2) return PW_OK;
  row->value[COLUMN_SPREAD] = cpu[n - 1] - cpu[0];
  row->value[COLUMN_PERCENT] = 100 * row->value[COLUMN_SPREAD] / row->cpu;
  return PW_OK;
}

/* The processor time [s] of a row, predicted from the coarser levels of its method: a halved step doubles it; a
 * tolerance divided by ten costs the factor that the last one did, at first COMPARE_DECADE.  INFINITY after a run that
 * was stopped or skipped; 0, not predicted, for the first level and after a failure. */
static double compare_predicted_time (const pw_row *row) {
  const pw_row *coarser = row - 1;
  if (row->coarser_levels == 0 || coarser->state == ROW_FAILED || coarser->state == ROW_REFUSED) return 0;
  if (coarser->state != ROW_DONE) return INFINITY;
  if (!row->adaptive) return 2 * coarser->cpu;
  if (row->coarser_levels < 2 || coarser[-1].state != ROW_DONE) return COMPARE_DECADE * coarser->cpu;
  return fmax (coarser->cpu / coarser[-1].cpu, 1) * coarser->cpu;
}

/* A run with samples at the times of the reference, and its errors. */
static int compare_measure_errors (pw_compare *compare, pw_row *row, pw_error *error) {
  pw_study *study = &compare->study;
  pw_motion motion;
  int status = compare->reference.known
                   ? pw_motion_open_at (&motion, study->compiled.system, &compare->reference.motion, error)
                   : pw_motion_open (&motion, study->compiled.system, MOTION_SAMPLES, study->t_end, error);
  if (status != PW_OK) return status;
  status = pw_motion_run (study, row, &motion, error);
  if (status == PW_OK) compare_set_errors (compare, &motion, row);
  pw_motion_close (&motion);
  return status;
}

static int compare_measure (pw_study *study, pw_row *row, pw_error *error) {
  pw_compare *compare = (pw_compare *)study;
  pw_error run_error = { 0 };
  double predicted = compare_predicted_time (row);
  const char *limit = PW_DIGITS (study->cpu_limit, 4);
  if (predicted > study->cpu_limit) {
    row->state = ROW_SKIPPED;
    const char *text = isfinite (predicted) ? PW_PRINTED (60, ", about %.2g s", predicted) : "";
    snprintf (row->reason, sizeof row->reason, "too slow%s; the limit is %s s", text, limit);
    return PW_OK;
  }
  row->balance = NAN;
  int status = compare_measure_errors (compare, row, &run_error);
  if (status == PW_OK) status = compare_measure_times (compare, row, &run_error);
  if (row->state == ROW_STOPPED)
    snprintf (row->reason, sizeof row->reason, "too slow: the limit of %s s was reached at t = %s s", limit,
              PW_DIGITS (row->t, 4));
  status = pw_study_record_run (study, row, status, &run_error, error);
  row->value[COLUMN_ORDER] = compare_order (compare, row);
  if (row->state != ROW_REFUSED) {
    row->value[COLUMN_POSITION] = row->statistics.position;
    row->value[COLUMN_VELOCITY] = row->statistics.velocity;
    row->value[COLUMN_BALANCE] = row->balance;
  }
  row->value[COLUMN_CPU] = row->cpu;
  const double *largest = &row->value[COLUMN_ERROR + MOTION_LARGEST];
  const double point[] = { row->level, row->cpu, (double)row->statistics.rhs, largest[MOTION_LENGTH],
                           largest[MOTION_ANGLE] };
  if (row->state == ROW_DONE) memcpy (row->point, point, sizeof point);
  return status;
}

/* ---- The command ---- */

static int compare_begin (pw_study *study, pw_error *error) {
  pw_compare *compare = (pw_compare *)study;
  int status = pw_reference_find (&compare->reference, study, compare->finest_step, error);
  if (status == PW_OK && study->folder)
    status = pw_reference_write (&compare->reference, study->folder, compare_columns + COLUMN_ERROR, error);
  if (status != PW_OK) return status;
  study->run_share = 1 / (compare->repeats + 1);
  const double *largest = compare->reference.uncertainty + MOTION_LARGEST;
  compare->concludes = compare->reference.known && (largest[MOTION_LENGTH] > 0 || largest[MOTION_ANGLE] > 0);
  study->quiet = compare->concludes && !compare->table;
  pw_reference_print (&compare->reference, compare->table ? REFERENCE_CANDIDATES : 1);
  return PW_OK;
}

static void compare_conclude (const pw_study *study) {
  const pw_compare *compare = (const pw_compare *)study;
  if (compare->concludes && compare->table) putchar ('\n');
  if (compare->concludes) pw_conclusion_print (study, &compare->reference, COLUMN_ERROR + MOTION_LARGEST);
}

/* Work-precision diagrams of lengths and of angles, if their errors are known. */
static int compare_figures (pw_study *study, pw_error *error) {
  static const char *const name[] = { "work-precision", "work-precision-angles" };
  const pw_reference *reference = &((pw_compare *)study)->reference;
  int status = pw_study_write_data (study, COMPARE_GROUP, name[0],
                                    "tolerance or step, CPU time [s], right-hand side evaluations, largest error of "
                                    "lengths [m] and angles [rad]",
                                    POINT_COORDINATES, error);
  for (int unit = 0; status == PW_OK && unit < 2; unit++) {
    const char *variables = PW_PRINTED (100, "uncertainty = %.9g\nsize_of_motion = %.9g\n",
                                        reference->uncertainty[MOTION_LARGEST + unit], reference->size[unit]);
    if (pw_study_positive (study, COMPARE_GROUP, POINT_LENGTH + unit))
      status = pw_study_write_script (study, COMPARE_GROUP, name[unit], "work-precision", variables, error);
  }
  return status;
}

static void compare_close (pw_study *study) {
  pw_motion_close (&((pw_compare *)study)->reference.motion);
}

static int compare_command (void *options, pw_error *error) {
  static const char *const group[] = { "" };
  static const pw_study_type type = {
    .table_names = { "compare.csv", "truth.csv" },
    .row_noun = "rows",
    .group = group,
    .heading_above =
        "      rtol  error at the end    largest error       error of        residual of        error of     "
        "                                  CPU time",
    .column = compare_columns,
    .columns = sizeof compare_columns / sizeof *compare_columns,
    .runs_per_row = 9,
    .timed = 1,
    .time_column = COLUMN_T,
    .first_count_column = COLUMN_STEPS,
    .plan = compare_plan,
    .begin = compare_begin,
    .measure = compare_measure,
    .conclude = compare_conclude,
    .figures = compare_figures,
    .close = compare_close
  };
  return pw_study_command (options, &type, error);
}

static const struct poptOption compare_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_STUDY_METHODS_OPTION ("default: eight representative ones"),
  PW_FLAG_OPTION (pw_compare, table, "table", "Print every run, not only the conclusion"),
  PW_TEXT_OPTION (pw_compare, rtol_text, "rtol-ladder", 0, "FROM:TO",
                  "Tolerances of adaptive methods, by decades (default 1e-3:1e-12)"),
  PW_TEXT_OPTION (pw_compare, step_text, "step-ladder", 0, "FROM:TO",
                  "Step sizes of fixed-step methods [s], halved each time (default 0.1:1e-4)"),
  PW_TEXT_OPTION (pw_cli_line, limit, "limit", 0, "SECONDS",
                  "Processor time of a single run; runs expected to take longer are skipped (default 10)"),
  PW_TEXT_OPTION (
      pw_compare, repeats_text, "repeats", 0, "N",
      "Timed repetitions of each run, at most 99, of which the median is reported (default 9, or those that "
      "fit into half a second)"),
  PW_TEXT_OPTION (pw_study, jobs_text, "jobs", 'j', "N",
                  "Number of methods that run at a time, each on a physical core of its own (default: all cores)"),
  PW_TEXT_OPTION (pw_cli_line, t_end, "t-end", 't', "T", "Final time [s]"),
  PW_ENGINE_OPTION,
  PW_TEXT_OPTION (
      pw_study, reference_path, "reference", 0, "FILE.csv",
      "Measure errors against this table, with columns as in run -o, instead of the model's exact solution or a "
      "computed reference"),
  PW_ALIAS_OPTION (pw_study, reference_path, "truth"),
  PW_TEXT_OPTION (pw_study, folder, "output", 'o', "DIR", "Write tables and work-precision diagrams into a folder"),
  PW_WIDTH_OPTION,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_compare = {
  .name = "compare",
  .synopsis = "MODEL [OPTION...]",
  .summary = "compare the accuracy and cost of methods against a reference solution",
  .help = "Run a model by several methods, each with a ladder of tolerances or step sizes, and compare their errors "
          "against a reference solution with their processor times.",
  .options_size = sizeof (pw_compare),
  .function = compare_command,
  .options = compare_options,
};
