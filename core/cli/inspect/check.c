/* pinwheel check: mobility, redundant constraint equations, massless bodies, consistent initial conditions, derivatives
 * of every element type in use, and the linearised equations of motion. */
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "check_report.h"
#include "report.h"

enum { CHECK_SEEDS = 5 };

PW_PRINTF (2, 3) static void check_add (pw_check_list *l, const char *format, ...) {
  va_list list;
  va_start (list, format);
  if (l->count++ < (int)(sizeof l->text / sizeof *l->text))
    vsnprintf (l->text[l->count - 1], sizeof *l->text, format, list);
  va_end (list);
}

/* ---- Initial conditions ---- */

/* Opens a run by rk4+projection, whatever method the model selects. */
static void check_open (pw_check *x) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  pw_settings settings = { .span = d.t_end, .step = d.step };
  x->step = d.step;
  x->explicit_rk4 = strncmp (d.method, "rk4", 3) == 0;
  x->r = pw_run_open (x->m.system, "rk4+projection", &settings, &x->failure);
  if (x->r == NULL)
    check_add (&x->problem, "%s", x->failure.text);
  else
    x->redundant = pw_report_redundancies (x->r);
}

/* Initial values given by the model or the user that the consistent initialisation has changed. */
static void check_given (pw_check *x) {
  const pw_system *s = x->m.system;
  const pw_initial_report *initial = pw_run_initial (x->r);
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++) {
    char name[PW_STATE_NAME], a[32], b[32];
    double from, to;
    if (!pw_initial_moved (s, initial, i) || !pw_initial_specified (initial, i)) continue;
    pw_report_state (s, initial, i, name, &from, &to);
    if (fabs (to) < 1e-12 * fabs (from)) to = 0; /* round-off */
    check_add (&x->finding, "%s %s = %s %s, but the constraints require %s %s",
               pw_initial_given (initial, i) ? "--start gives" : "the model specifies", name, pw_format (a, from, 10),
               pw_system_state_unit (s, i), pw_format (b, to, 10), pw_system_state_unit (s, i));
  }
}

/* The model's reference solution must hold initially, unless the user gives initial values. */
static int check_reference (pw_check *x, pw_error *error) {
  int n = pw_system_coordinates (x->m.system);
  if (x->line.starts || !pw_system_has_reference (x->m.model)) return PW_OK;
  double *reference = malloc (2 * (size_t)n * sizeof *reference);
  if (reference == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_system_reference (x->m.model, x->m.system, 0, reference, reference + n, error);
  for (int i = 0; i < 2 * n && status == PW_OK; i++) {
    char name[PW_STATE_NAME], a[32], b[32];
    double from, to;
    if (isnan (reference[i])) continue;
    x->known++;
    pw_report_state (x->m.system, pw_run_initial (x->r), i, name, &from, &to);
    if (!(fabs (reference[i] - to) <= 1e-9 * (1 + fabs (to))))
      check_add (&x->problem, "the model's reference solution does not hold initially: %s is %s, not %s", name,
                 pw_format (a, to, 9), pw_format (b, reference[i], 9));
  }
  free (reference);
  return status;
}

/* ---- Element types ---- */

/* Tests an element type in random scenes; records the reason if none can be generated. */
static int check_alone (pw_checked_kind *k, pw_error *error) {
  for (unsigned seed = 1; seed <= CHECK_SEEDS && !*k->untested; seed++) {
    pw_error own = { 0 };
    int status = pw_selftest (k->kind, seed, &k->alone, &own);
    if (status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
    if (status != PW_OK) snprintf (k->untested, sizeof k->untested, "%s", own.text);
  }
  return PW_OK;
}

/* The first check that fails, or NULL. */
static const pw_selftest_check *check_fault (const pw_selftest_report *report) {
  for (int i = 0; i < report->checks; i++)
    if (report->check[i].failed) return &report->check[i];
  return NULL;
}

/* Elements of one type are consecutive in a system. */
static int check_list_kinds (pw_check *x, pw_error *error) {
  const pw_system *s = x->m.system;
  x->kind = calloc ((size_t)pw_system_elements (s) + 1, sizeof *x->kind);
  if (x->kind == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < pw_system_elements (s); i++) {
    const pw_kind *kind = pw_system_element (s, i).kind;
    if (x->kinds == 0 || x->kind[x->kinds - 1].kind != kind) x->kind[x->kinds++].kind = kind;
    x->kind[x->kinds - 1].count++;
  }
  return PW_OK;
}

/* Tests an element type in use; in the model only if its table is consistent. */
static int check_kind (pw_check *x, pw_checked_kind *k, pw_error *error) {
  const pw_system *s = x->m.system;
  const pw_initial_report *initial = x->r ? pw_run_initial (x->r) : NULL;
  const double *q = initial ? initial->q : pw_system_initial_q (s), *v = initial ? initial->v : pw_system_initial_v (s);
  int status = check_alone (k, error);
  const pw_selftest_check *fault = check_fault (&k->alone);
  if (status == PW_OK && (fault == NULL || strcmp (fault->name, "table") != 0))
    status = pw_selftest_scene (s, x->r ? pw_run_scale (x->r)->time : 1, k->kind, 0, q, v, 1, &k->inside, error);
  if (fault == NULL) fault = check_fault (&k->inside);
  if (fault)
    check_add (&x->problem, "element type %s fails its self-test: %s (%s)", k->kind->name, fault->about, fault->where);
  return status;
}

static int check_kinds (pw_check *x, pw_error *error) {
  int status = check_list_kinds (x, error);
  for (int i = 0; status == PW_OK && i < x->kinds; i++) status = check_kind (x, &x->kind[i], error);
  return status;
}

/* ---- Linearisation ---- */

static void check_fastest (pw_check *x) {
  const pw_linear *l = &x->linear;
  double most = 0;
  for (int i = 0; i < l->unknowns; i++) {
    if (l->rigid[i]) continue;
    x->limit = fmin (x->limit, pw_rk4_limit (l->re[i], l->im[i]));
    if (hypot (l->re[i], l->im[i]) <= most * (1 + 1e-12)) continue;
    most = hypot (l->re[i], l->im[i]);
    x->fastest = i;
  }
}

static int check_linear (pw_check *x, pw_error *error) {
  char a[32], b[32];
  pw_error own = { 0 };
  int status = pw_run_linearise (x->r, CHECK_MOST, &x->linear, &own);
  if (status == PW_METHOD) {
    check_add (&x->finding, "%s", own.text);
    return PW_OK;
  }
  if (status != PW_OK) *error = own;
  if (status != PW_OK || x->linear.A == NULL) return status;
  check_fastest (x);
  if (x->explicit_rk4 && x->step > x->limit)
    check_add (&x->problem, "the model's step of %s s is too large for rk4, which is stable up to %s s",
               pw_format (a, x->step, 6), pw_format (b, x->limit, 3));
  const pw_linear *l = &x->linear;
  if (l->steady != PW_STEADY || l->unknowns == 0 || !(l->re[0] > 0)) return PW_OK;
  x->doubling = log (2) / l->re[0];
  check_add (&x->finding, "the motion is unstable: a perturbation doubles in %s s",
             pw_format (a, x->doubling, CHECK_DIGITS));
  return PW_OK;
}

/* ---- */

static int check_model (pw_check *x, pw_error *error) {
  int status = PW_OK;
  x->limit = x->doubling = INFINITY;
  x->fastest = -1;
  pw_report_model (x->m.model);
  check_open (x);
  if (x->r) {
    check_given (x);
    status = check_reference (x, error);
    if (status == PW_OK) status = check_linear (x, error);
  }
  return status == PW_OK ? check_kinds (x, error) : status;
}

static void check_close (pw_check *x) {
  pw_linear_free (&x->linear);
  pw_run_close (x->r);
  free (x->redundant);
  free (x->kind);
  pw_cli_close_model (&x->m);
}

/* Opens the output file before anything is computed. */
static int check_open_json (pw_check *x, pw_output **o, pw_error *error) {
  pw_use use[] = { PW_CLI_MODEL_USE, { "--json", x->json, PW_WRITES, NULL } };
  if (x->json == NULL) return PW_OK;
  if (pw_cli_check_uses (&x->line, x->m.file, use, sizeof use / sizeof *use, error) != PW_OK) return error->status;
  *o = pw_output_open (x->json, error);
  return *o ? PW_OK : error->status;
}

static int check_command (void *options, pw_error *error) {
  pw_check *x = options;
  pw_output *o = NULL;
  if (pw_cli_open (&x->m, &x->line, error) == PW_OK && check_open_json (x, &o, error) == PW_OK &&
      check_model (x, error) == PW_OK) {
    if (o == NULL || pw_output_stream (o) != stdout) pw_check_report (x, NULL);
    if (o) pw_check_report (x, &(pw_json){ .f = pw_output_stream (o) });
    if (o) pw_output_finish (o, error);
    o = NULL;
    if (x->problem.count) /* the exit status is that of a failed initialisation, otherwise that of bad input */
      pw_fail (error, x->failure.status ? x->failure.status : PW_INPUT, "%s%s", x->problem.text[0],
               x->problem.count > 1 ? "; and more, see above" : "");
  }
  if (o) pw_output_discard (o);
  check_close (x);
  return error->status;
}

static const struct poptOption check_options[] = {
  PW_OPTION_GROUP ("Output"),
  PW_TEXT_OPTION (pw_check, json, "json", 0, "FILE", "Write the report as JSON; - prints it instead of the text"),
  PW_MODEL_OPTIONS, POPT_TABLEEND
};

const pw_command pw_cli_check = {
  .name = "check",
  .synopsis = "MODEL [OPTION...]",
  .summary = "check mobility, redundancy, initial conditions, derivatives and stability of a model",
  .help =
      "Check a model before running it: degrees of freedom, redundant constraint equations, massless bodies, "
      "consistency of the initial conditions, derivatives of every element type in use (against differences), and the "
      "eigenvalues of the linearised equations of motion. The exit status is non-zero if there is a problem.",
  .min_arguments = 1,
  .max_arguments = 1,
  .options_size = sizeof (pw_check),
  .function = check_command,
  .options = check_options,
};
