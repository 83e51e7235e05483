/* pinwheel drift: how constraint residuals and the energy balance grow in a long run, by method and stabilisation, and
 * how that depends on Baumgarte's alpha and beta and on the metric and frequency of projections. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "drift.h"
#include "util.h"

/* ---- What is varied ---- */

/* Reads one "NAME=RANGE" into a grid of one axis. */
static int drift_axis (pw_grid *g, const char *text, pw_error *error) {
  const char *const list[] = { text, NULL };
  pw_grid_free (g);
  int status = pw_grid_read (g, list, error);
  for (long i = 0; status == PW_OK && i < g->rows; i++) {
    double value = pw_grid_value (g, 0, i);
    const char *expected = pw_domain_check (strcmp (g->axis->name, "every") == 0 ? PW_COUNT : PW_NONNEGATIVE, value);
    if (*expected)
      status = pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: expected %s", g->axis->name, g->axis->range, expected);
  }
  return status;
}

static int drift_vary (pw_drift *x, const char *text, pw_error *error) {
  const struct {
    const char *name;
    pw_grid *grid;
  } known[] = { { "alpha", &x->alpha }, { "beta", &x->beta }, { "every", &x->every } };
  char name[60], hint[100];
  snprintf (name, sizeof name, "%.*s", (int)strcspn (text, "="), text);
  pw_nearest near = { .sought = name };
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
    if (strcmp (known[i].name, name) == 0) return drift_axis (known[i].grid, text, error);
    pw_nearest_try (&near, known[i].name);
  }
  return pw_fail (error, PW_INPUT, "--vary %.100s: alpha, beta and every can be varied%s", text,
                  pw_nearest_text (&near, hint, sizeof hint));
}

/* The defaults, then the options. */
static int drift_axes (pw_drift *x, pw_error *error) {
  static const char *const usual[] = { "alpha=1,3,10,30,100,300,1000", "beta=1,10,100,1000", "every=1,2,5,10,20,50,100",
                                       NULL };
  int status = PW_OK;
  for (const char *const *v = usual; status == PW_OK && *v; v++) status = drift_vary (x, *v, error);
  for (const char **v = x->vary; status == PW_OK && v && *v; v++) status = drift_vary (x, *v, error);
  return status;
}

/* ---- Rows ---- */

static int drift_has_option (const pw_method *method, const char *name) {
  for (const pw_option *o = method->options; o && o->name; o++)
    if (strcmp (o->name, name) == 0) return 1;
  return 0;
}

/* The first integrator in the list that has an option; rk4 if none has. */
static const char *drift_integrator (const pw_drift *x, const char *option) {
  for (int i = 0; i < x->study.methods.count; i++) {
    const pw_method *method;
    int stabilisation;
    if (pw_method_parse (x->study.methods.method[i].name, &method, &stabilisation, NULL) == PW_OK &&
        drift_has_option (method, option))
      return method->name;
  }
  return "rk4";
}

static void drift_plan_baumgarte (pw_drift *x) {
  const char *integrator = drift_integrator (x, "alpha");
  char a[32], b[32];
  for (long j = 0; j < x->beta.rows; j++)
    for (long i = 0; i < x->alpha.rows; i++) {
      pw_row *r = &x->study.row[x->study.rows++];
      *r = (pw_row){ .group = DRIFT_BAUMGARTE,
                     .line = (int)j,
                     .along = pw_grid_value (&x->alpha, 0, i),
                     .beta = pw_grid_value (&x->beta, 0, j) };
      snprintf (r->method, sizeof r->method, "%s+baumgarte:alpha=%s:beta=%s", integrator, pw_format (a, r->along, 9),
                pw_format (b, r->beta, 9));
    }
}

static void drift_plan_projection (pw_drift *x) {
  static const char *const metric[] = { "mass", "identity" };
  const char *integrator = drift_integrator (x, "every");
  for (int j = 0; j < 2; j++)
    for (long i = 0; i < x->every.rows; i++) {
      pw_row *r = &x->study.row[x->study.rows++];
      *r = (pw_row){ .group = DRIFT_PROJECTION, .line = j, .along = pw_grid_value (&x->every, 0, i), .beta = NAN };
      snprintf (r->method, sizeof r->method, "%s+projection:metric=%s:every=%.0f", integrator, metric[j], r->along);
    }
}

/* The methods have the parts of a run, too, for figures against time. */
static int drift_plan_rows (pw_drift *x, pw_error *error) {
  pw_study *s = &x->study;
  double most = s->methods.count + (double)x->alpha.rows * (double)x->beta.rows + 2 * (double)x->every.rows;
  if (most > 10000) return pw_fail (error, PW_INPUT, "%.0f runs are too many; vary less", most);
  if (pw_study_allocate (s, (int)most, error) != PW_OK) return error->status;
  for (int i = 0; i < s->methods.count; i++) {
    pw_row *r = &s->row[s->rows++];
    *r = (pw_row){ .group = DRIFT_METHODS, .line = i, .along = NAN, .beta = NAN };
    strcpy (r->method, s->methods.method[i].name);
    r->part = calloc (DRIFT_PARTS, sizeof *r->part);
    if (r->part == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  }
  if (x->only_methods) return PW_OK;
  drift_plan_baumgarte (x);
  drift_plan_projection (x);
  return PW_OK;
}

static int drift_plan (pw_study *s, pw_error *error) {
  pw_drift *x = (pw_drift *)s;
  const char *methods = s->methods_text ? s->methods_text : "rk4+all,ida+all,galpha+all";
  pw_run_defaults d = pw_cli_defaults (pw_file_table (s->m.file));
  if (d.rtol == 0) d.rtol = 1e-6;
  int status = pw_cli_settings (&s->line, &d, &s->t_end, &s->settings, &s->limit, error);
  s->settings.ledger = 1;
  if (status == PW_OK) status = pw_study_methods_read (&s->methods, methods, error);
  if (status == PW_OK) status = drift_axes (x, error);
  return status == PW_OK ? drift_plan_rows (x, error) : status;
}

/* ---- Runs ---- */

static void drift_raise (double *most, double value) {
  if (!(value <= *most)) *most = value;
}

/* The part of the run that a time belongs to, its end included. */
static int drift_part (const pw_study *x, double t) {
  int k = (int)ceil (t / x->t_end * DRIFT_PARTS - 1e-9) - 1;
  return k < 0 ? 0 : k < DRIFT_PARTS ? k : DRIFT_PARTS - 1;
}

/* After every accepted step, since between steps a projected method shows nothing of what it corrects. */
static int drift_visit (pw_study_visitor *v, pw_run *run, pw_error *error) {
  pw_row *r = v->row;
  pw_sample sample;
  int status = pw_run_sample (run, pw_run_time (run), &sample, error), k = drift_part (v->study, pw_run_time (run));
  if (status != PW_OK) return status;
  const double value[DRIFT_QUANTITIES] = { sample.position, sample.velocity, fabs (sample.balance) };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    drift_raise (&r->most[i], value[i]);
    if (k < DRIFT_PARTS / 2) drift_raise (&r->early[i], value[i]);
    if (k == DRIFT_PARTS - 1) r->end[i] = fmax (r->end[i], value[i]);
    if (r->part) r->part[k][i] = fmax (r->part[k][i], value[i]);
  }
  return PW_OK;
}

static int drift_measure (pw_study *x, pw_row *r, pw_error *error) {
  pw_error own = { 0 };
  pw_study_visitor v = { .visit = drift_visit, .study = x, .row = r };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    r->end[i] = NAN;
    for (int k = 0; r->part && k < DRIFT_PARTS; k++) r->part[k][i] = NAN;
  }
  return pw_study_outcome (r, pw_study_run (x, r, &v, &own), &own, error);
}

/* ---- The command ---- */

static int drift_begin (pw_study *x, pw_error *error) {
  (void)error;
  pw_drift_print_title (x);
  return PW_OK;
}

static void drift_close (pw_study *s) {
  pw_drift *x = (pw_drift *)s;
  for (int i = 0; i < s->rows; i++) free (s->row[i].part);
  pw_grid_free (&x->alpha);
  pw_grid_free (&x->beta);
  pw_grid_free (&x->every);
}

static int drift_command (void *options, pw_error *error) {
  static const pw_study_type type = { .tables = { "drift.csv", "drift-time.csv" },
                                      .unit = "runs",
                                      .plan = drift_plan,
                                      .begin = drift_begin,
                                      .measure = drift_measure,
                                      .head = pw_drift_head,
                                      .line = pw_drift_line,
                                      .names = pw_drift_names,
                                      .cells = pw_drift_cells,
                                      .figures = pw_drift_figures,
                                      .close = drift_close };
  return pw_study_command (options, &type, error);
}

static const struct poptOption drift_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_TEXT_OPTION (
      pw_study, methods_text, "methods", 'm', "A,B,...|all",
      "Methods, separated by commas; rk4+all: every stabilisation of rk4; all: of every integrator (default "
      "rk4+all,ida+all,galpha+all)"),
  PW_STEP_OPTIONS,
  PW_LIST_OPTION (
      pw_drift, vary, "vary", 'v', "OPTION=RANGE",
      "Values of an option: alpha or beta [1/s] of baumgarte, every [steps] of projection; repeatable. RANGE: "
      "V1,V2,..., lin:FIRST:LAST:COUNT or log:FIRST:LAST:COUNT"),
  PW_FLAG_OPTION (pw_drift, only_methods, "only-methods", "Omit the dependence of drift on options"),
  PW_TEXT_OPTION (pw_study, folder, "output", 'o', "DIR", "Write tables and figures into a folder"),
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
  .least = 1,
  .most = 1,
  .size = sizeof (pw_drift),
  .function = drift_command,
  .options = drift_options,
};
