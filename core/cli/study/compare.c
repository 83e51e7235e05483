/* pinwheel compare: accuracy and cost of methods.  A row for each method and each tolerance or step: one run with samples
 * and ledger, then timed runs without. */
#include <gsl/gsl_sort.h>
#include <gsl/gsl_statistics.h>
#include <math.h>
#include <string.h>
#include "reference.h"

enum { COMPARE_REPEATS = 99 };
#define COMPARE_FEW 3      /* smallest number of timed runs within the limit */
#define COMPARE_ENOUGH 0.5 /* total time [s] after which no further run is timed */
#define COMPARE_FINER 1.2  /* ratio of the numbers of steps that shows an order */
#define COMPARE_CLEAR 10   /* error over uncertainty of the reference, for orders accurate to log2 1.1 = 0.14 */
#define COMPARE_AGREE 0.1  /* largest relative difference of the last two orders in the asymptotic range */

/* Explicit and implicit, one-step and multistep methods, each with the stabilisation that suits it. */
static const char compare_usual[] = "rk4+projection,erk5+projection,erk8+projection,bdf+projection,"
                                    "ida+baumgarte,ida+ggl,radau+ggl,galpha+index3";

typedef struct {
  pw_study study;
  int table;     /* --table */
  int concludes; /* errors of coordinates are known */
  const char *rtol_text, *step_text, *repeats_text;
  double finest_step; /* of the ladder [s] */
  double repeats;     /* timed runs of a row, at most */
  pw_reference reference;
} pw_compare;

/* ---- Columns ---- */

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

static const char *compare_ladder (const pw_row *r) {
  return r->adaptive ? "rtol" : "step";
}

static const char *compare_below (const pw_row *r) {
  return r->bounds;
}

static const pw_study_column compare_columns[] = {
  { "method", .text = pw_study_method },
  { "ladder", .text = compare_ladder },
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
  { "below", .text = compare_below },
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
  { .name = NULL },
};

/* ---- Ladders ---- */

typedef struct {
  double from, to; /* from > to > 0 */
} ladder;

/* "FROM:TO", in either order, or a single level. */
static int ladder_read (const char *option, const char *text, ladder *l, pw_error *error) {
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
  *l = (ladder){ fmax (from, to), fmin (from, to) };
  if (l->from / l->to > 1e30) return pw_fail (error, PW_INPUT, "%s %.80s: too long a ladder", option, text);
  return PW_OK;
}

/* Level i of a ladder, or 0 after its end; steps are halved, tolerances divided by ten and rounded to 12 digits: 1e-6. */
static double ladder_level (ladder l, int adaptive, int i) {
  char text[32];
  double level = ldexp (l.from, -i);
  if (adaptive) pw_read_number (pw_format (text, l.from / pow (10, i), 12), &level);
  return level >= l.to * (1 - 1e-9) ? level : 0;
}

/* A row for each level of each method. */
static int compare_plan_rows (pw_study *x, const ladder of[2], pw_error *error) {
  for (int i = 0; i < x->methods; i++) {
    int adaptive = pw_cli_adaptive (x->method[i]);
    double level;
    for (int k = 0; (level = ladder_level (of[adaptive], adaptive, k)) > 0; k++) {
      pw_row *r = pw_study_add (x, 0, i, x->method[i], 1, error);
      if (r == NULL) return PW_RESOURCE;
      r->adaptive = adaptive;
      r->before = k;
      r->level = r->value[COLUMN_LEVEL] = level;
      r->value[COLUMN_REPEATS] = 0;
    }
  }
  return PW_OK;
}

static int compare_plan (pw_study *s, pw_error *error) {
  pw_compare *x = (pw_compare *)s;
  ladder of[2] = { { 0.1, 1e-4 }, { 1e-3, 1e-12 } }; /* steps, tolerances */
  s->t_end = pw_cli_defaults (pw_file_table (s->m.file)).t_end;
  s->limit.seconds = INFINITY; /* the clock is read between batches of steps only: timed runs are not slowed down */
  s->cpu_end = 10;
  x->repeats = 9;
  int status = pw_cli_number ("--t-end", s->line.t_end, PW_POSITIVE, &s->t_end, error);
  if (status == PW_OK) status = pw_cli_number ("--limit", s->line.limit, PW_POSITIVE, &s->cpu_end, error);
  if (status == PW_OK) status = pw_cli_number ("--repeats", x->repeats_text, PW_COUNT, &x->repeats, error);
  if (status == PW_OK && x->repeats > COMPARE_REPEATS)
    return pw_fail (error, PW_INPUT, "--repeats %s: at most %d", x->repeats_text, COMPARE_REPEATS);
  if (status == PW_OK) status = pw_study_read_methods (s, s->methods_text ? s->methods_text : compare_usual, error);
  if (status == PW_OK) status = ladder_read ("--step-ladder", x->step_text, &of[0], error);
  if (status == PW_OK) status = ladder_read ("--rtol-ladder", x->rtol_text, &of[1], error);
  x->finest_step = of[0].to;
  return status == PW_OK ? compare_plan_rows (s, of, error) : status;
}

/* ---- A row ---- */

/* Errors below the uncertainty of the reference are replaced by it, and marked. */
static void compare_errors (const pw_compare *x, const pw_motion *motion, pw_row *r) {
  const pw_reference *reference = &x->reference;
  double *error = &r->value[COLUMN_ERROR];
  if (!reference->known) return;
  pw_motion_distance (x->study.m.system, &reference->motion, motion, error);
  for (int i = 0; i < MOTION_ERRORS; i++) {
    if (reference->uncertainty[i] == 0) error[i] = NAN;
    if (!(error[i] <= reference->uncertainty[i])) continue;
    error[i] = reference->uncertainty[i];
    r->below |= 1u << (COLUMN_ERROR + i);
    strcat (strcat (r->bounds, *r->bounds ? " " : ""), compare_columns[COLUMN_ERROR + i].name);
  }
}

/* log (error before / error) over log (steps / steps before); NaN if an error is unknown or below ten times the
 * uncertainty of the reference, or if the numbers of steps are nearly equal. */
static double compare_order_of (const pw_compare *x, const pw_row *r) {
  const pw_row *before = r - 1;
  const double *error = &r->value[COLUMN_ERROR];
  int i = isnan (error[MOTION_MOST]) ? MOTION_MOST + MOTION_ANGLE : MOTION_MOST;
  int known =
      before->state == ROW_DONE && r->state == ROW_DONE && error[i] > COMPARE_CLEAR * x->reference.uncertainty[i];
  double finer =
      r->adaptive ? (double)r->statistics.steps / (double)before->statistics.steps : before->level / r->level;
  return known && finer > COMPARE_FINER ? log (before->value[COLUMN_ERROR + i] / error[i]) / log (finer) : NAN;
}

/* The observed order of convergence: only in the asymptotic range, where the last two orders agree and errors are well
 * above the uncertainty of the reference; else NaN. */
static double compare_order (const pw_compare *x, const pw_row *r) {
  double order = r->before >= 2 ? compare_order_of (x, r) : NAN,
         last = r->before >= 2 ? compare_order_of (x, r - 1) : NAN;
  return order > 0 && fabs (order - last) <= COMPARE_AGREE * order ? order : NAN;
}

static int compare_times (pw_compare *x, pw_row *r, pw_error *error) {
  double cpu[COMPARE_REPEATS], sum = 0;
  int n = 0;
  while (n < x->repeats && !(n >= COMPARE_FEW && sum > COMPARE_ENOUGH) && sum <= x->study.cpu_end) {
    int status = pw_motion_run (&x->study, r, NULL, error);
    if (status != PW_OK) return status;
    sum += cpu[n++] = r->cpu;
  }
  gsl_sort (cpu, 1, (size_t)n);
  r->cpu = gsl_stats_median_from_sorted_data (cpu, 1, (size_t)n);
  r->value[COLUMN_REPEATS] = n;
  if (n < 2) return PW_OK;
  r->value[COLUMN_SPREAD] = cpu[n - 1] - cpu[0];
  r->value[COLUMN_PERCENT] = 100 * r->value[COLUMN_SPREAD] / r->cpu;
  return PW_OK;
}

/* The CPU time of a row predicted from the levels of its method before it: a halved step doubles it; the factor of a decade
 * is that of the last one, or at first that of a method of order 5. */
static double compare_predict (const pw_row *r) {
  const pw_row *last = r - 1;
  if (r->before == 0 || last->state == ROW_FAILED || last->state == ROW_REFUSED) return 0;
  if (last->state != ROW_DONE) return INFINITY;
  if (!r->adaptive) return 2 * last->cpu;
  if (r->before < 2 || last[-1].state != ROW_DONE) return 1.6 * last->cpu;
  return fmax (last->cpu / last[-1].cpu, 1) * last->cpu;
}

/* The run with samples at the times of the reference, and its errors. */
static int compare_sample (pw_compare *x, pw_row *r, pw_error *error) {
  pw_study *s = &x->study;
  pw_motion motion;
  int status = x->reference.known ? pw_motion_open_at (&motion, s->m.system, &x->reference.motion, error)
                                  : pw_motion_open (&motion, s->m.system, MOTION_SAMPLES, s->t_end, error);
  if (status != PW_OK) return status;
  status = pw_motion_run (s, r, &motion, error);
  if (status == PW_OK) compare_errors (x, &motion, r);
  pw_motion_close (&motion);
  return status;
}

static int compare_measure (pw_study *s, pw_row *r, pw_error *error) {
  pw_compare *x = (pw_compare *)s;
  pw_error own = { 0 };
  char limit[32], text[60] = "";
  double predicted = compare_predict (r);
  pw_format (limit, s->cpu_end, 4);
  if (predicted > s->cpu_end) {
    r->state = ROW_SKIPPED;
    if (isfinite (predicted)) snprintf (text, sizeof text, ", about %.2g s", predicted);
    snprintf (r->reason, sizeof r->reason, "too slow%s; the limit is %s s", text, limit);
    return PW_OK;
  }
  r->balance = NAN;
  int status = compare_sample (x, r, &own);
  if (status == PW_OK) status = compare_times (x, r, &own);
  if (r->state == ROW_STOPPED)
    snprintf (r->reason, sizeof r->reason, "too slow: the limit of %s s was reached at t = %s s", limit,
              pw_format (text, r->t, 4));
  status = pw_study_outcome (s, r, status, &own, error);
  r->value[COLUMN_ORDER] = compare_order (x, r);
  r->value[COLUMN_POSITION] = r->statistics.position;
  r->value[COLUMN_VELOCITY] = r->statistics.velocity;
  r->value[COLUMN_BALANCE] = r->balance;
  r->value[COLUMN_CPU] = r->cpu;
  const double *error_of = &r->value[COLUMN_ERROR + MOTION_MOST];
  const double point[STUDY_COORDINATES] = { r->level, r->cpu, (double)r->statistics.rhs, error_of[MOTION_LENGTH],
                                            error_of[MOTION_ANGLE] };
  if (r->state == ROW_DONE) memcpy (r->point, point, sizeof point);
  return status;
}

/* ---- The command ---- */

static int compare_begin (pw_study *s, pw_error *error) {
  pw_compare *x = (pw_compare *)s;
  int status = pw_reference_find (&x->reference, s, x->finest_step, error);
  if (status == PW_OK && s->folder)
    status = pw_reference_write (&x->reference, s->folder, compare_columns + COLUMN_ERROR, error);
  if (status != PW_OK) return status;
  s->share = 1 / (x->repeats + 1);
  const double *largest = x->reference.uncertainty + MOTION_MOST;
  x->concludes = x->reference.known && (largest[MOTION_LENGTH] > 0 || largest[MOTION_ANGLE] > 0);
  s->quiet = x->concludes && !x->table;
  pw_reference_print (&x->reference, s->reference_path != NULL, x->table);
  return PW_OK;
}

static void compare_conclude (const pw_study *s) {
  const pw_compare *x = (const pw_compare *)s;
  if (x->concludes && x->table) putchar ('\n');
  if (x->concludes) pw_conclusion_print (s, &x->reference, COLUMN_ERROR + MOTION_MOST);
}

/* Work-precision diagrams of lengths and of angles, if their errors are known. */
static int compare_figures (pw_study *x, pw_error *error) {
  static const char *const name[] = { "work-precision", "work-precision-angles" };
  const pw_reference *reference = &((pw_compare *)x)->reference;
  int status = pw_study_write_data (x, 0, name[0],
                                    "tolerance or step, CPU time [s], right-hand side evaluations, largest error of "
                                    "lengths [m] and angles [rad]",
                                    STUDY_COORDINATES, error);
  for (int unit = 0; status == PW_OK && unit < 2; unit++) {
    char variables[100];
    snprintf (variables, sizeof variables, "uncertainty = %.9g\nsize_of_motion = %.9g\n",
              reference->uncertainty[MOTION_MOST + unit], reference->size[unit]);
    if (pw_study_positive (x, 0, 3 + unit))
      status = pw_study_write_script (x, 0, name[unit], "work-precision", variables, error);
  }
  return status;
}

static void compare_close (pw_study *s) {
  pw_motion_close (&((pw_compare *)s)->reference.motion);
}

static int compare_command (void *options, pw_error *error) {
  static const char *const group[] = { "" };
  static const pw_study_type type = {
    .tables = { "compare.csv", "truth.csv" },
    .unit = "rows",
    .group = group,
    .above = "      rtol  error at the end    largest error       error of        residual of        error of     "
             "                                  CPU time",
    .column = compare_columns,
    .runs = 9,
    .timed = 1,
    .time = COLUMN_T,
    .steps = COLUMN_STEPS,
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
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_compare),
  .function = compare_command,
  .options = compare_options,
};
