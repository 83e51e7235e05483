/* pinwheel compare: the accuracy and the cost of methods.  A row for each method and level of its ladder of tolerances or
 * steps: one run with samples and the ledger, then timed runs of the method alone. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "compare.h"

#define COMPARE_FEW 3      /* timed runs at least, unless the limit forbids it; */
#define COMPARE_ENOUGH 0.5 /* more until they have taken this long [s] */
#define COMPARE_FINER 1.2  /* ratio of the numbers of steps that shows an order */
#define COMPARE_CLEAR 10   /* times the reference's uncertainty: halved steps then show an order to log2 1.1 = 0.14 */
#define COMPARE_AGREE 0.1  /* of an order: the largest difference of the last two in the asymptotic range */

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
  int levels[2] = { 0, 0 }, rows = 0;
  for (int k = 0; k < 2; k++)
    while (ladder_level (of[k], k, levels[k]) > 0) levels[k]++;
  for (int i = 0; i < x->methods.count; i++) rows += levels[x->methods.method[i].adaptive];
  int status = pw_study_allocate (x, rows, error);
  for (int i = 0; status == PW_OK && i < x->methods.count; i++) {
    const pw_study_method *m = &x->methods.method[i];
    for (int k = 0; k < levels[m->adaptive]; k++) {
      pw_row *r = &x->row[x->rows++];
      *r = (pw_row){ .line = i, .adaptive = m->adaptive, .level = ladder_level (of[m->adaptive], m->adaptive, k) };
      strcpy (r->method, m->name);
    }
  }
  return status;
}

static int compare_plan (pw_study *s, pw_error *error) {
  pw_compare *x = (pw_compare *)s;
  ladder of[2] = { { 0.1, 1e-4 }, { 1e-3, 1e-12 } }; /* steps, tolerances */
  s->t_end = pw_cli_defaults (pw_file_table (s->m.file)).t_end;
  s->limit.most = INFINITY; /* the clock is read between batches of steps only: timed runs are not slowed down */
  s->cpu_end = 10;
  x->repeats = 9;
  int status = pw_cli_number ("--t-end", s->line.t_end, PW_POSITIVE, &s->t_end, error);
  if (status == PW_OK) status = pw_cli_number ("--limit", s->line.limit, PW_POSITIVE, &s->cpu_end, error);
  if (status == PW_OK) status = pw_cli_number ("--repeats", x->repeats_text, PW_COUNT, &x->repeats, error);
  if (status == PW_OK && x->repeats > COMPARE_REPEATS)
    return pw_fail (error, PW_INPUT, "--repeats %s: at most %d", x->repeats_text, COMPARE_REPEATS);
  if (status == PW_OK) status = pw_study_methods_read (&s->methods, s->methods_text ? s->methods_text : "all", error);
  if (status == PW_OK) status = ladder_read ("--step-ladder", x->step_text, &of[0], error);
  if (status == PW_OK) status = ladder_read ("--rtol-ladder", x->rtol_text, &of[1], error);
  x->finest_step = of[0].to;
  return status == PW_OK ? compare_plan_rows (s, of, error) : status;
}

/* ---- A row ---- */

static void compare_unknown (pw_row *r) {
  for (int i = 0; i < MOTION_ERRORS; i++) r->error[i] = NAN;
  r->balance = r->spread = r->order = NAN;
}

/* An error below the uncertainty of the reference is no larger than that. */
static void compare_errors (pw_compare *x, pw_row *r) {
  const pw_reference *reference = &x->reference;
  if (!reference->known) return;
  pw_motion_distance (x->study.m.system, &reference->motion, &x->scratch, r->error);
  for (int i = 0; i < MOTION_ERRORS; i++) {
    if (reference->uncertainty[i] == 0) r->error[i] = NAN;
    if (!(r->error[i] <= reference->uncertainty[i])) continue;
    r->error[i] = reference->uncertainty[i];
    r->below |= 1u << i;
  }
}

/* log (error before / error) over log (steps / steps before); NaN where an error is unknown or may be the reference's by more
 * than a tenth, and where the numbers of steps are much the same. */
static double compare_order_of (const pw_compare *x, const pw_row *r) {
  const pw_row *before = r - 1;
  int i = isnan (r->error[MOTION_MOST]) ? MOTION_MOST + MOTION_ANGLE : MOTION_MOST;
  int known =
      before->state == ROW_DONE && r->state == ROW_DONE && r->error[i] > COMPARE_CLEAR * x->reference.uncertainty[i];
  double finer =
      r->adaptive ? (double)r->statistics.steps / (double)before->statistics.steps : before->level / r->level;
  return known && finer > COMPARE_FINER ? log (before->error[i] / r->error[i]) / log (finer) : NAN;
}

/* The observed order of convergence of a row with `before` levels of its method before it: only in the asymptotic range,
 * where the last two orders agree and errors are well above the uncertainty of the reference; else NaN. */
static double compare_order (const pw_compare *x, const pw_row *r, int before) {
  double order = before >= 2 ? compare_order_of (x, r) : NAN, last = before >= 2 ? compare_order_of (x, r - 1) : NAN;
  return order > 0 && fabs (order - last) <= COMPARE_AGREE * order ? order : NAN;
}

static int compare_numbers (const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static int compare_times (pw_compare *x, pw_row *r, pw_error *error) {
  double cpu[COMPARE_REPEATS], sum = 0;
  int n = 0;
  while (n < x->repeats && !(n >= COMPARE_FEW && sum > COMPARE_ENOUGH) && sum <= x->study.cpu_end) {
    int status = pw_compare_run (x, r, NULL, error);
    if (status != PW_OK) return status;
    sum += cpu[n++] = r->cpu;
    pw_progress_at (&x->study.progress, x->study.done + (n + 1.0) / (x->repeats + 1));
  }
  qsort (cpu, (size_t)n, sizeof *cpu, compare_numbers);
  r->repeats = n;
  r->cpu = n % 2 ? cpu[n / 2] : (cpu[n / 2 - 1] + cpu[n / 2]) / 2;
  r->spread = n > 1 ? cpu[n - 1] - cpu[0] : NAN;
  return PW_OK;
}

/* The CPU time of a row predicted from the `before` levels of its method before it: a halved step doubles it; the factor of a
 * decade is that of the last one, or at first that of a method of order 5. */
static double compare_predict (const pw_row *r, int before) {
  const pw_row *last = r - 1;
  if (before == 0 || last->state == ROW_FAILED || last->state == ROW_REFUSED) return 0;
  if (last->state != ROW_DONE) return INFINITY;
  if (!r->adaptive) return 2 * last->cpu;
  if (before < 2 || last[-1].state != ROW_DONE) return 1.6 * last->cpu;
  return fmax (last->cpu / last[-1].cpu, 1) * last->cpu;
}

static int compare_measure (pw_study *s, pw_row *r, pw_error *error) {
  pw_compare *x = (pw_compare *)s;
  pw_error own = { 0 };
  char limit[32], text[60] = "";
  int before = 0;
  while (r - before > s->row && r[-before - 1].line == r->line) before++;
  double predicted = compare_predict (r, before);
  compare_unknown (r);
  s->share = 1 / (x->repeats + 1);
  if (predicted > s->cpu_end) {
    r->state = ROW_SKIPPED;
    if (isfinite (predicted)) snprintf (text, sizeof text, ", about %.2g s", predicted);
    snprintf (r->reason, sizeof r->reason, "too slow%s; the limit is %s s", text, pw_format (limit, s->cpu_end, 4));
    return PW_OK;
  }
  int status = pw_compare_run (x, r, &x->scratch, &own);
  if (status == PW_OK) {
    compare_errors (x, r);
    status = compare_times (x, r, &own);
  }
  if (r->state == ROW_STOPPED)
    snprintf (r->reason, sizeof r->reason, "too slow: the limit of %s s was reached at t = %s s",
              pw_format (limit, s->cpu_end, 4), pw_format (text, r->t, 4));
  status = pw_study_outcome (r, status, &own, error);
  r->order = compare_order (x, r, before);
  return status;
}

/* ---- The command ---- */

static int compare_begin (pw_study *s, pw_error *error) {
  pw_compare *x = (pw_compare *)s;
  int status = pw_reference_find (x, error);
  if (status == PW_OK && s->folder) status = pw_compare_write_reference (x, error);
  const pw_motion *motion = &x->reference.motion;
  int samples = x->reference.known ? motion->samples : MOTION_SAMPLES;
  if (status == PW_OK) status = pw_motion_open (&x->scratch, s->m.system, samples, error);
  if (status != PW_OK) return status;
  pw_motion_times (&x->scratch, s->t_end);
  if (x->reference.known) memcpy (x->scratch.t, motion->t, (size_t)samples * sizeof *motion->t);
  pw_compare_print_reference (x, stdout);
  return PW_OK;
}

static void compare_close (pw_study *s) {
  pw_compare *x = (pw_compare *)s;
  pw_motion_close (&x->reference.motion);
  pw_motion_close (&x->scratch);
}

static int compare_command (void *options, pw_error *error) {
  static const pw_study_type type = { .tables = { "compare.csv", "truth.csv" },
                                      .unit = "rows",
                                      .plan = compare_plan,
                                      .begin = compare_begin,
                                      .measure = compare_measure,
                                      .head = pw_compare_head,
                                      .line = pw_compare_line,
                                      .names = pw_compare_names,
                                      .cells = pw_compare_cells,
                                      .figures = pw_compare_figures,
                                      .close = compare_close };
  return pw_study_command (options, &type, error);
}

static const struct poptOption compare_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_TEXT_OPTION (
      pw_study, methods_text, "methods", 'm', "A,B,...|all",
      "Methods, separated by commas; rk4+all: every stabilisation of rk4; all: of every integrator (default)"),
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
  PW_TEXT_OPTION (pw_cli_line, t_end, "t-end", 't', "T", "Final time [s]"),
  PW_TEXT_OPTION (
      pw_study, reference_path, "truth", 0, "FILE.csv",
      "Measure errors against this table, with columns as in run -o, instead of the model's exact solution or a "
      "computed reference"),
  PW_TEXT_OPTION (pw_study, folder, "output", 'o', "DIR", "Write tables and work-precision diagrams into a folder"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_compare = {
  .name = "compare",
  .synopsis = "MODEL [OPTION...]",
  .summary = "compare the accuracy and cost of methods against a reference solution",
  .help = "Run a model by several methods, each with a ladder of tolerances or step sizes, and compare their errors "
          "against "
          "a reference solution with their processor times.",
  .least = 1,
  .most = 1,
  .size = sizeof (pw_compare),
  .function = compare_command,
  .options = compare_options,
};
