/* pinwheel check: mobility, redundant constraint equations, massless bodies, consistent initial conditions, derivatives
 * of every element type in use, and the linearised equations of motion. */
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "check_report.h"
#include "report.h"

enum { CHECK_SEEDS = 5 /* random scenes of each element type */ };

PW_PRINTF (2, 3) static void check_add (pw_check_list *list, const char *format, ...) {
  va_list arguments;
  list->out_of_memory |= pw_grow (&list->text, (size_t)list->count, &list->room, sizeof *list->text) != PW_OK;
  if (list->out_of_memory) return;
  va_start (arguments, format);
  vsnprintf (list->text[list->count++], sizeof *list->text, format, arguments);
  va_end (arguments);
}

/* ---- Initial conditions ---- */

/* Opens a run by rk4+projection, whatever method the model selects. */
static void check_open_run (pw_check *check) {
  pw_run_defaults defaults = pw_cli_defaults (pw_file_table (check->model.file));
  pw_settings settings = { .span = defaults.t_end, .step = defaults.step };
  check->step = defaults.step;
  check->uses_rk4 = strncmp (defaults.method, "rk4", 3) == 0;
  check->run = pw_run_open (check->model.system, "rk4+projection", &settings, &check->run_error);
  if (check->run == NULL)
    check_add (&check->problem, "%s", check->run_error.text);
  else
    check->redundant = pw_report_redundancies (check->run);
}

/* Initial values specified by the model or given by the user that were changed by more than rounding. */
static void check_given_values (pw_check *check) {
  const pw_system *s = check->model.system;
  const pw_initial_report *initial = pw_run_initial (check->run);
  for (int i = 0; i < 2 * pw_system_coordinates (s); i++) {
    char reason[300];
    if (pw_initial_moved (s, initial, i) < 2 || !pw_initial_specified (initial, i)) continue;
    pw_state_change c = pw_cli_state_change (s, initial, i);
    if (fabs (c.consistent) < 1e-12 * fabs (c.given)) c.consistent = 0; /* round-off */
    pw_run_initial_reason (check->run, i, reason, sizeof reason);
    check_add (&check->finding, "%s %s = %s %s, which was changed to %s %s%s%s",
               pw_initial_given (initial, i) ? "--start gives" : "the model specifies", c.name, PW_DIGITS (c.given, 10),
               c.unit, PW_DIGITS (c.consistent, 10), c.unit, *reason ? "; otherwise " : "", reason);
  }
}

/* The model's reference solution must hold initially, up to round-off, unless the user gives initial values. */
static int check_reference (pw_check *check, pw_error *error) {
  int n = pw_system_coordinates (check->model.system);
  if (check->line.starts || !pw_model_has_reference (check->model.model)) return PW_OK;
  double *reference = malloc (2 * (size_t)n * sizeof *reference);
  if (reference == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_system_reference (check->model.model, check->model.system, 0, reference, reference + n, error);
  for (int i = 0; i < 2 * n && status == PW_OK; i++) {
    if (isnan (reference[i])) continue;
    check->reference_states++;
    const pw_state_change c = pw_cli_state_change (check->model.system, pw_run_initial (check->run), i);
    if (!(fabs (reference[i] - c.consistent) <= 1e-9 * (1 + fabs (c.consistent))))
      check_add (&check->problem, "the model's reference solution does not hold initially: %s is %s, not %s", c.name,
                 PW_DIGITS (c.consistent, 9), PW_DIGITS (reference[i], 9));
  }
  free (reference);
  return status;
}

/* Tables that do not cover the model's run, and rows of their files that are left out. */
static void check_tables (pw_check *check) {
  const pw_system *s = check->model.system;
  const double t_end = pw_cli_defaults (pw_file_table (check->model.file)).t_end;
  char notice[PW_NOTICE_BYTES];
  for (int i = 0; i < pw_system_signals (s); i++)
    if (*pw_system_table_notice (s, i, t_end, notice, sizeof notice)) check_add (&check->finding, "%s", notice);
}

/* ---- Element types ---- */

/* Tests an element type in random scenes; records the reason if none can be generated. */
static int check_random (pw_checked_kind *k, pw_error *error) {
  for (unsigned seed = 1; seed <= CHECK_SEEDS && !*k->untested; seed++) {
    pw_error own = { 0 };
    int status = pw_selftest (k->kind, seed, &k->random, &own);
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
static int check_list_kinds (pw_check *check, pw_error *error) {
  const pw_system *s = check->model.system;
  check->kind = calloc ((size_t)pw_system_elements (s) + 1, sizeof *check->kind);
  if (check->kind == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < pw_system_elements (s); i++) {
    const pw_kind *kind = pw_system_element (s, i).kind;
    if (check->kinds == 0 || check->kind[check->kinds - 1].kind != kind) check->kind[check->kinds++].kind = kind;
    check->kind[check->kinds - 1].count++;
  }
  return PW_OK;
}

/* Tests an element type in use; in the model only if the table of the type is consistent. */
static int check_kind (pw_check *check, pw_checked_kind *k, pw_error *error) {
  const pw_system *s = check->model.system;
  const pw_initial_report *initial = check->run ? pw_run_initial (check->run) : NULL;
  const double *q = initial ? initial->q : pw_system_initial_q (s), *v = initial ? initial->v : pw_system_initial_v (s);
  int status = check_random (k, error);
  const pw_selftest_check *fault = check_fault (&k->random);
  if (status == PW_OK && (fault == NULL || strcmp (fault->name, "table") != 0))
    status = pw_selftest_scene (s, check->run ? pw_run_scale (check->run)->time : 1, k->kind, 0, q, v, 1, &k->in_model,
                                error);
  if (fault == NULL) fault = check_fault (&k->in_model);
  if (fault)
    check_add (&check->problem, "element type %s fails its self-test: %s (%s)", k->kind->name, fault->about,
               fault->where);
  return status;
}

static int check_kinds (pw_check *check, pw_error *error) {
  int status = check_list_kinds (check, error);
  for (int i = 0; status == PW_OK && i < check->kinds; i++) status = check_kind (check, &check->kind[i], error);
  return status;
}

/* ---- Wheels ---- */

/* Wheels roll in the plane of the model.  Seen from above, no gravity acts in it, and on a slope of angle a that of
 * g sin (a), which is below CHECK_SLOPE up to 45 degrees. */
static const double CHECK_SLOPE = 7; /* m/s^2 */

static void check_gravity (pw_check *check, const pw_element *gravity, const pw_element *wheel) {
  const double *a = ((const pw_gravity *)gravity->definition)->acceleration, most = hypot (a[0], a[1]);
  if (most > CHECK_SLOPE)
    check_add (&check->finding,
               "gravity %s acts with %s m/s^2 in the plane in which %s %s rolls: seen from above, gravity is "
               "perpendicular to that plane and left out; on a slope of angle a it is 9.81 sin (a)",
               pw_element_name (gravity), PW_DIGITS (most, 4), wheel->kind->name, pw_element_name (wheel));
}

static void check_wheels (pw_check *check) {
  int count, prescribed = 0;
  const pw_linear *linear = &check->linear;
  const pw_element *element = pw_model_elements (check->model.model, &count), *wheel = NULL;
  for (const pw_element *e = element; e < element + count; e++) {
    if (wheel == NULL && e->kind->contact && (e->kind->rows || e->kind->force)) wheel = e;
    prescribed |= e->kind->eta != NULL;
  }
  if (wheel == NULL) return;
  for (const pw_element *e = element; e < element + count; e++)
    if (strcmp (e->kind->name, "gravity") == 0) check_gravity (check, e, wheel);
  if (check->run && linear->positions > 0 && linear->velocities == 0 && !prescribed)
    check_add (&check->finding, "the wheels allow no motion; wheels that slip sideways are of type tyre");
}

/* ---- Linearisation ---- */

/* The fastest eigenvalue, and the largest step of RK4 that is stable for all; both without rigid displacements. */
static void check_fastest (pw_check *check) {
  const pw_linear *linear = &check->linear;
  double most = 0;
  for (int i = 0; i < linear->unknowns; i++) {
    if (linear->rigid[i]) continue;
    check->rk4_limit = fmin (check->rk4_limit, pw_rk4_limit (linear->re[i], linear->im[i]));
    if (hypot (linear->re[i], linear->im[i]) <= most * (1 + 1e-12)) continue; /* not larger, up to round-off */
    most = hypot (linear->re[i], linear->im[i]);
    check->fastest = i;
  }
}

static int check_linear (pw_check *check, pw_error *error) {
  pw_error own = { 0 };
  int status = pw_run_linearise (check->run, CHECK_COORDINATES, &check->linear, &own);
  if (status == PW_METHOD || status == PW_INPUT) {
    check_add (&check->finding, "%s", own.text);
    return PW_OK;
  }
  if (status != PW_OK) *error = own;
  if (status != PW_OK || check->linear.A == NULL) return status;
  check_fastest (check);
  if (check->uses_rk4 && check->step > check->rk4_limit)
    check_add (&check->problem, "the model's step of %s s is too large for rk4, which is stable up to %s s",
               PW_DIGITS (check->step, 6), PW_DIGITS (check->rk4_limit, 3));
  const pw_linear *linear = &check->linear;
  if (linear->steady != PW_STEADY || linear->unknowns == 0 || !(linear->re[0] > 0)) return PW_OK;
  check->doubling_time = log (2) / linear->re[0];
  check_add (&check->finding, "the motion is unstable: a perturbation doubles in %s s",
             PW_DIGITS (check->doubling_time, CHECK_DIGITS));
  return PW_OK;
}

/* ---- The command ---- */

static int check_model (pw_check *check, pw_error *error) {
  int status = PW_OK;
  check->rk4_limit = check->doubling_time = INFINITY;
  check->fastest = -1;
  pw_report_model (&check->model);
  check_tables (check);
  check_open_run (check);
  if (check->run) {
    check_given_values (check);
    status = check_reference (check, error);
    if (status == PW_OK) status = check_linear (check, error);
  }
  if (status == PW_OK) check_wheels (check);
  if (status == PW_OK) status = check_kinds (check, error);
  int out_of_memory = check->problem.out_of_memory || check->finding.out_of_memory;
  return status == PW_OK && out_of_memory ? pw_fail (error, PW_RESOURCE, "out of memory") : status;
}

static void check_close (pw_check *check) {
  pw_linear_free (&check->linear);
  pw_run_close (check->run);
  free (check->redundant);
  free (check->kind);
  free (check->problem.text);
  free (check->finding.text);
  pw_cli_close_model (&check->model);
}

enum { CHECK_JSON = 1 }; /* index in the list of files of check_command */

static int check_command (void *options, pw_error *error) {
  pw_check *check = options;
  pw_files files = { .folder = { .made = 0 } };
  pw_use use[] = { PW_CLI_MODEL_USE, { "--json", check->json_path, PW_WRITES, pw_cli_json } };
  int status = pw_cli_open (&check->model, &check->line, error);
  if (status == PW_OK) status = pw_files_open (&files, &check->line, &check->model, use, 2, error);
  if (status == PW_OK) status = check_model (check, error);
  if (status == PW_OK) {
    FILE *json = pw_files_stream (&files, CHECK_JSON);
    if (json != stdout) pw_check_report (check, NULL);
    if (json) pw_check_report (check, &(pw_json){ .f = json });
    pw_files_finish (&files, error);
    if (check->problem.count) /* the exit status is that of a failed initialisation, otherwise that of bad input */
      pw_fail (error, check->run_error.status ? check->run_error.status : PW_INPUT, "%s%s", check->problem.text[0],
               check->problem.count > 1 ? "; and more, see above" : "");
  }
  pw_files_close (&files);
  check_close (check);
  return error->status;
}

static const struct poptOption check_options[] = {
  PW_OPTION_GROUP ("Output"),
  PW_TEXT_OPTION (pw_check, json_path, "json", 0, "FILE", "Write the report as JSON; - prints it instead of the text"),
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
  .options_size = sizeof (pw_check),
  .function = check_command,
  .options = check_options,
};
