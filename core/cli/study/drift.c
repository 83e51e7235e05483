/* pinwheel drift: how constraint residuals and the energy defect grow in a long run, by method and stabilisation, and
 * how that depends on Baumgarte's alpha and beta and on the metric and frequency of projections. */
#include <math.h>
#include <string.h>
#include "study.h"
#include "sweep_grid.h"
#include "util.h"

#define DRIFT_ROUND_OFF 1e-14                   /* the growth of smaller scaled residuals means nothing */
enum { DRIFT_PARTS = 200, DRIFT_MOST = 10000 }; /* parts of a run, each a point in the figures; limit of rows */

enum { DRIFT_POSITION, DRIFT_VELOCITY, DRIFT_BALANCE, DRIFT_QUANTITIES };

/* The methods, then the effect of the options of two stabilisations. */
enum { DRIFT_METHODS, DRIFT_BAUMGARTE, DRIFT_PROJECTION, DRIFT_GROUPS };
static const char *const drift_group[DRIFT_GROUPS] = { "methods", "baumgarte", "projection" };

/* Options whose effect is shown, and their values unless --vary gives them. */
enum { DRIFT_ALPHA, DRIFT_BETA, DRIFT_EVERY, DRIFT_OPTIONS };
static const char *const drift_option[] = { "alpha", "beta", "every", NULL };
static const char *const drift_usual[] = { "alpha=1,3,10,30,100,300,1000", "beta=1,10,100,1000",
                                           "every=1,2,5,10,20,50,100" };

typedef struct {
  pw_study study;
  const char **vary;
  int only_methods;
  pw_axis axis[DRIFT_OPTIONS]; /* values of the options */
} pw_drift;

/* ---- Columns: for each quantity the largest value of all steps and of the last part, and the growth ---- */

enum { COLUMN_ALPHA = 2, COLUMN_BETA, COLUMN_EVERY, COLUMN_T = 6, COLUMN_QUANTITY, COLUMN_STEPS = 16 };

static const char *drift_group_name (const pw_row *r) {
  return drift_group[r->group];
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
  { .name = NULL },
};

/* ---- Values of options ---- */

static int drift_vary (pw_drift *x, const char *text, pw_error *error) {
  char name[60], hint[PW_HINT];
  snprintf (name, sizeof name, "%.*s", (int)strcspn (text, "="), text);
  int option = pw_find_name (drift_option, sizeof *drift_option, name, hint);
  if (option < 0) return pw_fail (error, PW_INPUT, "--vary %.100s: alpha, beta and every can be varied%s", text, hint);
  pw_axis *a = &x->axis[option];
  pw_axis_free (a);
  int status = pw_axis_read (a, text, error);
  for (long i = 0; status == PW_OK && i < a->count; i++) {
    const char *expected = pw_domain_check (option == DRIFT_EVERY ? PW_COUNT : PW_NONNEGATIVE, pw_axis_value (a, i));
    if (*expected) status = pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: expected %s", a->name, a->range, expected);
  }
  return status;
}

/* ---- Rows ---- */

/* The first integrator in the list that has this option; rk4 if none has it. */
static const char *drift_integrator (const pw_study *x, const char *option) {
  const pw_method *method;
  int stabilisation;
  for (int i = 0; i < x->methods; i++)
    if (pw_method_parse (x->method[i], &method, &stabilisation, NULL) == PW_OK)
      for (const pw_option *o = method->options; o && o->name; o++)
        if (strcmp (o->name, option) == 0) return method->name;
  return "rk4";
}

/* Adds a row for a value of an option, which is also its abscissa in the figure. */
static int drift_add (pw_drift *x, int group, int line, const char *method, const char *label, int column, double value,
                      pw_error *error) {
  pw_row *r = pw_study_add (&x->study, group, line, method, 1, error);
  if (r == NULL) return PW_RESOURCE;
  snprintf (r->label, sizeof r->label, "%s", label);
  r->point[0][0] = r->value[column] = value;
  if (group == DRIFT_BAUMGARTE) r->value[COLUMN_BETA] = pw_axis_value (&x->axis[DRIFT_BETA], line);
  return PW_OK;
}

/* Pairs of alpha and beta; the figure has a line for each beta. */
static int drift_plan_baumgarte (pw_drift *x, pw_error *error) {
  const char *integrator = drift_integrator (&x->study, "alpha");
  const pw_axis *alphas = &x->axis[DRIFT_ALPHA], *betas = &x->axis[DRIFT_BETA];
  char a[32], b[32], method[STUDY_NAME], label[60];
  int status = PW_OK;
  for (long j = 0; j < betas->count; j++)
    for (long i = 0; i < alphas->count && status == PW_OK; i++) {
      double alpha = pw_axis_value (alphas, i), beta = pw_axis_value (betas, j);
      snprintf (label, sizeof label, "beta = %s /s", pw_format (b, beta, 6));
      snprintf (method, sizeof method, "%s+baumgarte:alpha=%s:beta=%s", integrator, pw_format (a, alpha, 9),
                pw_format (b, beta, 9));
      status = drift_add (x, DRIFT_BAUMGARTE, (int)j, method, label, COLUMN_ALPHA, alpha, error);
    }
  return status;
}

/* Intervals between projections; the figure has a line for each metric. */
static int drift_plan_projection (pw_drift *x, pw_error *error) {
  static const char *const metric[] = { "metric=mass", "metric=identity" };
  const char *integrator = drift_integrator (&x->study, "every");
  char method[STUDY_NAME];
  int status = PW_OK;
  for (int j = 0; j < 2; j++)
    for (long i = 0; i < x->axis[DRIFT_EVERY].count && status == PW_OK; i++) {
      double every = pw_axis_value (&x->axis[DRIFT_EVERY], i);
      snprintf (method, sizeof method, "%s+projection:%s:every=%.0f", integrator, metric[j], every);
      status = drift_add (x, DRIFT_PROJECTION, j, method, metric[j], COLUMN_EVERY, every, error);
    }
  return status;
}

static int drift_plan_rows (pw_drift *x, pw_error *error) {
  pw_study *s = &x->study;
  const pw_axis *a = x->axis;
  double most =
      s->methods + (double)a[DRIFT_ALPHA].count * (double)a[DRIFT_BETA].count + 2 * (double)a[DRIFT_EVERY].count;
  if (most > DRIFT_MOST) return pw_fail (error, PW_INPUT, "%.0f runs are too many; vary less", most);
  for (int i = 0; i < s->methods; i++) {
    pw_row *r = pw_study_add (s, DRIFT_METHODS, i, s->method[i], DRIFT_PARTS, error);
    if (r == NULL) return PW_RESOURCE;
    for (int k = 0; k < DRIFT_PARTS; k++) r->point[k][0] = s->t_end * (k + 1) / DRIFT_PARTS;
  }
  if (x->only_methods) return PW_OK;
  int status = drift_plan_baumgarte (x, error);
  return status == PW_OK ? drift_plan_projection (x, error) : status;
}

static int drift_plan (pw_study *s, pw_error *error) {
  pw_drift *x = (pw_drift *)s;
  pw_run_defaults d = pw_cli_defaults (pw_file_table (s->m.file));
  if (d.rtol == 0) d.rtol = 1e-6;
  int status = pw_cli_settings (&s->line, &d, &s->t_end, &s->settings, &s->limit, error);
  s->settings.ledger = 1;
  if (status == PW_OK)
    status = pw_study_read_methods (s, s->methods_text ? s->methods_text : "rk4+all,ida+all,galpha+all", error);
  for (int i = 0; status == PW_OK && i < DRIFT_OPTIONS; i++) status = drift_vary (x, drift_usual[i], error);
  for (const char **v = x->vary; status == PW_OK && v && *v; v++) status = drift_vary (x, *v, error);
  return status == PW_OK ? drift_plan_rows (x, error) : status;
}

/* ---- Runs ---- */

typedef struct {
  pw_study_visitor base;
  double early[DRIFT_QUANTITIES]; /* largest values in the first half of the time */
} drift_visitor;

/* The larger of both, NaN if one is. */
static void drift_raise (double *most, double value) {
  if (!isnan (*most) && !(value <= *most)) *most = value;
}

/* The part of the run that a time belongs to, its end included, up to round-off. */
static int drift_part (const pw_study *x, double t) {
  int k = (int)ceil (t / x->t_end * DRIFT_PARTS - 1e-9) - 1;
  return k < 0 ? 0 : k < DRIFT_PARTS ? k : DRIFT_PARTS - 1;
}

/* Called after every accepted step: samples inside a step of a method with projection show no drift. */
static int drift_visit (pw_study_visitor *v, pw_run *run, pw_error *error) {
  pw_row *r = v->row;
  pw_sample sample;
  int status = pw_run_sample (run, pw_run_time (run), &sample, error), k = drift_part (v->study, pw_run_time (run));
  if (status != PW_OK) return status;
  const double now[DRIFT_QUANTITIES] = { sample.position, sample.velocity, fabs (sample.balance) };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    double *value = &r->value[COLUMN_QUANTITY + 3 * i];
    drift_raise (&value[0], now[i]);
    if (k < DRIFT_PARTS / 2) drift_raise (&((drift_visitor *)v)->early[i], now[i]);
    if (k == DRIFT_PARTS - 1) value[1] = fmax (value[1], now[i]);
    if (r->points > 1) r->point[k][1 + i] = fmax (r->point[k][1 + i], now[i]);
  }
  return PW_OK;
}

/* The largest value, and the exponent of time with which it grows from the middle of the run to its end: 0 if it is
 * bounded; NaN if there is only round-off. */
static void drift_finish (pw_row *r, int quantity, double early) {
  double *value = &r->value[COLUMN_QUANTITY + 3 * quantity];
  int known = quantity == DRIFT_BALANCE || value[0] > DRIFT_ROUND_OFF;
  if (r->state == ROW_DONE && known && early > 0) value[2] = log2 (value[0] / early);
  if (r->state == ROW_DONE && r->points == 1) r->point[0][1 + quantity] = value[0];
  if (r->t == 0) value[0] = NAN;
}

static int drift_measure (pw_study *x, pw_row *r, pw_error *error) {
  pw_error own = { 0 };
  drift_visitor v = { .base = { .visit = drift_visit, .study = x, .row = r } };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) r->value[COLUMN_QUANTITY + 3 * i] = 0;
  int status = pw_study_outcome (x, r, pw_study_run (x, r, &x->settings, &v.base, &own), &own, error);
  for (int i = 0; i < DRIFT_QUANTITIES; i++) drift_finish (r, i, v.early[i]);
  return status;
}

/* ---- The command ---- */

static int drift_begin (pw_study *x, pw_error *error) {
  char t[32], h[32], rtol[32];
  (void)error;
  printf (
      "%s, %s s, steps of %s s or rtol %s: the largest value of all steps and of the last %g %%, and its growth\n\n",
      pw_file_name (x->m.file), pw_format (t, x->t_end, 6), pw_format (h, x->settings.step, 6),
      pw_format (rtol, x->settings.rtol, 6), 100.0 / DRIFT_PARTS);
  return PW_OK;
}

/* DIR/drift-time.csv: the largest values in each part of the runs of methods. */
static int drift_write_times (const pw_study *x, pw_error *error) {
  pw_output *o = pw_figure_open (x->folder, "drift-time.csv", error);
  if (o == NULL) return error->status;
  pw_text t = { .chars = NULL };
  pw_text_cell (&t, "method,t [s],position,velocity,balance [J]");
  int status = pw_text_line (&t, pw_output_stream (o), x->folder, error);
  for (const pw_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; status == PW_OK && r->points > 1 && k < r->points; k++) {
      if (isnan (r->point[k][1])) continue;
      pw_text_cell (&t, r->method);
      for (int i = 0; i <= DRIFT_QUANTITIES; i++) pw_text_number (&t, r->point[k][i]);
      status = pw_text_line (&t, pw_output_stream (o), x->folder, error);
    }
  return pw_cli_close_table (o, status, error);
}

/* A panel for each quantity that is not always zero, against time, alpha, or the interval between projections. */
static int drift_figures (pw_study *x, pw_error *error) {
  static const char *const name[] = { "drift", "drift-baumgarte", "drift-projection" };
  static const char *const axis[] = { "t [s]", "alpha [1/s]", "steps per projection (every)" };
  int status = drift_write_times (x, error);
  for (int group = 0; status == PW_OK && group < DRIFT_GROUPS; group++) {
    char variables[40] = "quantities = '", heading[160];
    for (int i = 1; i <= DRIFT_QUANTITIES; i++)
      if (pw_study_positive (x, group, i)) sprintf (strchr (variables, 0), "%d ", i);
    if (variables[strlen (variables) - 1] == '\'') continue;
    strcat (variables, "'\n");
    snprintf (heading, sizeof heading, "%s, largest scaled residuals of position and velocity, energy defect [J]",
              axis[group]);
    status = pw_study_write_data (x, group, name[group], heading, 1 + DRIFT_QUANTITIES, error);
    if (status == PW_OK) status = pw_study_write_script (x, group, name[group], "drift", variables, error);
  }
  return status;
}

static void drift_close (pw_study *s) {
  for (int i = 0; i < DRIFT_OPTIONS; i++) pw_axis_free (&((pw_drift *)s)->axis[i]);
}

static int drift_command (void *options, pw_error *error) {
  static const char *const group[] = { "methods", "alpha and beta of Baumgarte", "metric and frequency of projection" };
  static const pw_study_type type = { .tables = { "drift.csv", "drift-time.csv" },
                                      .unit = "runs",
                                      .group = group,
                                      .above = "  residual of position     residual of velocity      energy defect [J]",
                                      .column = drift_columns,
                                      .runs = 1,
                                      .time = COLUMN_T,
                                      .steps = COLUMN_STEPS,
                                      .plan = drift_plan,
                                      .begin = drift_begin,
                                      .measure = drift_measure,
                                      .figures = drift_figures,
                                      .close = drift_close };
  return pw_study_command (options, &type, error);
}

static const struct poptOption drift_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_STUDY_METHODS_OPTION ("default rk4+all,ida+all,galpha+all"),
  PW_STEP_OPTIONS,
  PW_LIST_OPTION (
      pw_drift, vary, "vary", 'v', "OPTION=RANGE",
      "Values of an option: alpha or beta [1/s] of baumgarte, every [steps] of projection; repeatable. RANGE: "
      "V1,V2,..., lin:FIRST:LAST:COUNT or log:FIRST:LAST:COUNT"),
  PW_TEXT_OPTION (pw_study, jobs_text, "jobs", 'j', "N", "Number of concurrent runs (default: one per processor)"),
  PW_FLAG_OPTION (pw_drift, only_methods, "only-methods", "Omit the dependence of drift on options"),
  PW_TEXT_OPTION (pw_study, folder, "output", 'o', "DIR", "Write tables and figures into a folder"),
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
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_drift),
  .function = drift_command,
  .options = drift_options,
};
