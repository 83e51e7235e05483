/* pinwheel check: mobility, redundant constraint equations, massless bodies, consistent initial conditions, derivatives
 * of every element type in use, and the linearised equations of motion. */
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "pinwheel-analysis.h"
#include "pinwheel-selftest.h"
#include "cli.h"
#include "outcome.h"

enum {
  CHECK_COORDINATES = 400, /* above this number computations of cubic cost are omitted */
  CHECK_DIGITS = 5,
  CHECK_SEEDS = 5 /* random scenes of each element type */
};

/* The self-test of an element type in use. */
typedef struct {
  const pw_kind *kind;
  int count;                           /* elements */
  pw_selftest_report random, in_model; /* of elements in random scenes; of those in this model */
  char untested[500];                  /* why there is no test in random scenes, or "" */
} pw_checked_kind;

/* A constraint equation with limits, in the run of the model. */
typedef struct {
  int row, mode;  /* mode: at the start */
  double used, t; /* the largest part of the limit that the reaction uses, and when [s]; NaN: there is none */
  double first;   /* time of the first event [s]; NaN: there is none */
  double events;  /* their number; NaN: not known */
} pw_checked_limit;

/* Messages; `room`: number of those for which there is memory. */
typedef struct {
  int count, out_of_memory; /* out_of_memory 1: one could not be added */
  size_t room;
  char (*text)[700];
} pw_check_list;

/* Problems make the check fail; findings do not: the model can be run, but may not be what was intended. */
typedef struct {
  pw_cli_line line;
  const char *json_path; /* NULL: not given */
  pw_run *run;           /* NULL: initialisation failed with `run_error` */
  pw_error run_error;
  pw_linear linear;       /* at the initial state; A is NULL if it was not computed */
  const char **redundant; /* a description of each redundant constraint equation, ended by NULL; or NULL */
  pw_checked_kind *kind;  /* kinds: the element types in use */
  int kinds;
  pw_checked_limit *limit; /* limits */
  int limits;
  int reference_states; /* states of the model's reference solution, compared with the initial state */
  double step;          /* the model's step size [s] */
  int uses_rk4;         /* 1: the model's method is rk4 */
  double rk4_limit;     /* the largest stable step of RK4 [s]; INFINITY: all are stable */
  int fastest;          /* the eigenvalue of largest modulus except rigid displacements; -1: none, or all 0 */
  double doubling_time; /* of the fastest growing perturbation [s]; INFINITY: none grows, or the motion is not steady */
  pw_check_list problem, finding;
} pw_check;

PW_PRINTF (2, 3) static void check_add (pw_check_list *list, const char *format, ...) {
  va_list arguments;
  list->out_of_memory |= pw_grow (&list->text, (size_t)list->count, &list->room, sizeof *list->text) != PW_OK;
  if (list->out_of_memory) return;
  va_start (arguments, format);
  vsnprintf (list->text[list->count++], sizeof *list->text, format, arguments);
  va_end (arguments);
}

/* Initial values specified by the model or given by the user that were changed by more than rounding. */
static void check_given_values (pw_check *check) {
  const pw_system *s = check->line.m.system;
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
  int n = pw_system_coordinates (check->line.m.system);
  if (check->line.starts || !pw_model_has_reference (check->line.m.model)) return PW_OK;
  double *reference = malloc (2 * (size_t)n * sizeof *reference);
  if (reference == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  int status = pw_system_reference (check->line.m.model, check->line.m.system, 0, reference, reference + n, error);
  for (int i = 0; i < 2 * n && status == PW_OK; i++) {
    if (isnan (reference[i])) continue;
    check->reference_states++;
    const pw_state_change c = pw_cli_state_change (check->line.m.system, pw_run_initial (check->run), i);
    if (!(fabs (reference[i] - c.consistent) <= 1e-9 * (1 + fabs (c.consistent))))
      check_add (&check->problem, "the model's reference solution does not hold initially: %s is %s, not %s", c.name,
                 PW_DIGITS (c.consistent, 9), PW_DIGITS (reference[i], 9));
  }
  free (reference);
  return status;
}

/* The first check that fails, or NULL. */
static const pw_selftest_check *check_fault (const pw_selftest_report *report) {
  for (int i = 0; i < report->checks; i++)
    if (report->check[i].failed) return &report->check[i];
  return NULL;
}

/* Tests an element type in use; in the model only if the table of the type is consistent. */
static int check_kind (pw_check *check, pw_checked_kind *k, pw_error *error) {
  const pw_system *s = check->line.m.system;
  const pw_initial_report *initial = check->run ? pw_run_initial (check->run) : NULL;
  const double *q = initial ? initial->q : pw_system_initial_q (s), *v = initial ? initial->v : pw_system_initial_v (s);
  int status = PW_OK;
  for (unsigned seed = 1; seed <= CHECK_SEEDS && !*k->untested; seed++) { /* unless no scene can be generated */
    pw_error own = { 0 };
    status = pw_selftest (k->kind, seed, &k->random, &own);
    if (status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
    if (status != PW_OK) snprintf (k->untested, sizeof k->untested, "%s", own.text), status = PW_OK;
  }
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

enum { CHECK_LIMIT_OUTPUTS = 4, CHECK_LIMIT_SECONDS = 10 /* of processor time */ };

/* Modes at the start, and what the run of the model uses of the limits. */
static int check_limits (pw_check *check, pw_error *error) {
  static const char *const prefix[CHECK_LIMIT_OUTPUTS] = { "max:", "min:", "event:", "events:" };
  const pw_system *s = check->line.m.system;
  const char *method = check->line.m.defaults.method;
  const int n = pw_system_limited (s);
  pw_arena *arena = &check->line.arena;
  const char **text = pw_arena_alloc (arena, (CHECK_LIMIT_OUTPUTS * (size_t)n + 1) * sizeof *text);
  check->limit = pw_arena_alloc (arena, ((size_t)n + 1) * sizeof *check->limit);
  if (text == NULL || check->limit == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int row = 0; row < pw_system_rows (s) && n > 0; row++) {
    const pw_bounds *bounds = pw_system_limits (s, row);
    if (bounds == NULL || bounds->circle == 2 || bounds->least == bounds->most) continue; /* the last: no brake */
    for (int k = 0; k < CHECK_LIMIT_OUTPUTS; k++) {
      const char *name = PW_NAME (pw_system_reaction_name, s, row);
      const char **of = &text[CHECK_LIMIT_OUTPUTS * check->limits + k];
      *of = pw_arena_copy (arena, PW_PRINTED (PW_NAME_BYTES + 10, "%s%s", prefix[k], name));
      if (*of == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
    }
    check->limit[check->limits++] = (pw_checked_limit){ row, pw_run_mode (check->run, row), NAN, NAN, NAN, NAN };
  }
  if (n == 0) return PW_OK;
  pw_outcomes set;
  pw_settings settings;
  pw_limit seconds;
  pw_error own = { 0 };
  int status = pw_outcomes_open (&set, s, "check", text, CHECK_LIMIT_OUTPUTS * check->limits, NULL, error);
  pw_cli_settings (&check->line, &check->line.m.defaults, &settings, &seconds);
  seconds.seconds = CHECK_LIMIT_SECONDS;
  if (status == PW_OK && pw_outcomes_run (&set, method, &settings, settings.span, NULL, &own) != PW_OK)
    check_add (&check->finding, "what the run uses of the limits of reactions is not known: %s", own.text);
  for (int i = 0; status == PW_OK && own.status == PW_OK && i < check->limits; i++) {
    pw_checked_limit *l = &check->limit[i];
    const int first = CHECK_LIMIT_OUTPUTS * i;
    const pw_bounds *bounds = pw_system_limits (s, l->row);
    l->first = pw_outcome_value (&set, first + 2), l->events = pw_outcome_value (&set, first + 3);
    if (bounds->circle) continue; /* a reaction is only a part of what is limited */
    for (int side = 0; side < 2; side++) {
      const pw_functional *f = &set.functional[set.outcome[first + side].term[0]];
      const double most = side ? bounds->most : bounds->least, used = -f->value / most; /* reactions are -lambda */
      if (isfinite (most) && most != 0 && !(used <= l->used)) l->used = used, l->t = f->t;
    }
  }
  pw_outcomes_close (&set);
  return own.status == PW_RESOURCE ? pw_fail (error, own.status, "%s", own.text) : status;
}

/* Wheels roll in the plane of the model.  Seen from above, no gravity acts in it, and on a slope of angle a that of
 * g sin (a), which is below CHECK_SLOPE up to 45 degrees. */
static const double CHECK_SLOPE = 7; /* m/s^2 */

static void check_wheels (pw_check *check) {
  int count, prescribed = 0;
  const pw_linear *linear = &check->linear;
  const pw_element *element = pw_model_elements (check->line.m.model, &count), *wheel = NULL;
  for (const pw_element *e = element; e < element + count; e++) {
    if (wheel == NULL && e->kind->contact && (e->kind->rows || e->kind->force)) wheel = e;
    prescribed |= e->kind->eta != NULL;
  }
  if (wheel == NULL) return;
  for (const pw_element *e = element; e < element + count; e++)
    if (strcmp (e->kind->name, "gravity") == 0) {
      const double *a = ((const pw_gravity *)e->definition)->acceleration, most = hypot (a[0], a[1]);
      if (most > CHECK_SLOPE)
        check_add (&check->finding,
                   "gravity %s acts with %s m/s^2 in the plane in which %s %s rolls: seen from above, gravity is "
                   "perpendicular to that plane and left out; on a slope of angle a it is 9.81 sin (a)",
                   pw_element_name (e), PW_DIGITS (most, 4), wheel->kind->name, pw_element_name (wheel));
    }
  if (check->run && linear->positions > 0 && linear->velocities == 0 && !prescribed)
    check_add (&check->finding, "the wheels allow no motion; wheels that slip sideways are of type tyre");
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
  /* the fastest eigenvalue, and the largest step of RK4 that is stable for all; both without rigid displacements */
  const pw_linear *linear = &check->linear;
  double most = 0;
  for (int i = 0; i < linear->unknowns; i++) {
    if (linear->rigid[i]) continue;
    check->rk4_limit = fmin (check->rk4_limit, pw_rk4_limit (linear->re[i], linear->im[i]));
    if (hypot (linear->re[i], linear->im[i]) <= most * (1 + 1e-12)) continue; /* not larger, up to round-off */
    most = hypot (linear->re[i], linear->im[i]);
    check->fastest = i;
  }
  if (check->uses_rk4 && check->step > check->rk4_limit)
    check_add (&check->problem, "the model's step of %s s is too large for rk4, which is stable up to %s s",
               PW_DIGITS (check->step, 6), PW_DIGITS (check->rk4_limit, 3));
  if (linear->steady != PW_STEADY || linear->unknowns == 0 || !(linear->re[0] > 0)) return PW_OK;
  check->doubling_time = log (2) / linear->re[0];
  check_add (&check->finding, "the motion is unstable: a perturbation doubles in %s s",
             PW_DIGITS (check->doubling_time, CHECK_DIGITS));
  return PW_OK;
}

/* ---- The report: entries, each with a key in JSON, a label and words in text ---- */

enum { REPORT_LISTED = 8, REPORT_EIGENVALUES = 60 }; /* items of a list; lines of eigenvalues: in the text, at most */

/* They are written as JSON, or as text if j is NULL; pw_json_* do nothing then. */

/* Begins a line of JSON for the next item. */
static void report_line (pw_json *j) {
  if (j) j->line = 1;
}

/* Begins an object or a list. */
static void report_section (pw_json *j, const char *key, char bracket, const char *title) {
  if (j == NULL && title) printf ("\n%s\n", title);
  report_line (j);
  pw_json_open (j, key, bracket);
}

/* Prints in the text only. */
PW_PRINTF (2, 3) static void report_print (pw_json *j, const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  if (j == NULL) vprintf (format, arguments);
  va_end (arguments);
}

/* A number in JSON, unless the key is NULL; a line in the text, unless the label is NULL. */
PW_PRINTF (5, 6)
static void report_entry (pw_json *j, const char *key, double value, const char *label, const char *format, ...) {
  va_list arguments;
  if (key) pw_json_number (j, key, value);
  if (j || label == NULL) return;
  printf ("  %-34s ", label);
  va_start (arguments, format);
  vprintf (format, arguments);
  va_end (arguments);
  putchar ('\n');
}

/* A line in the text only. */
#define report_text(j, ...) report_entry (j, NULL, 0, __VA_ARGS__)

/* An item of a list: a string in JSON, unless it is NULL; a line in the text, if it is one of the first REPORT_LISTED.
 * `listed` counts all items. */
static void report_item (pw_json *j, int *listed, const char *string, const char *line) {
  if (string) pw_json_text (j, NULL, string);
  if ((*listed)++ < REPORT_LISTED) report_print (j, "    %s\n", line);
}

static void report_end_list (pw_json *j, int listed) {
  pw_json_close (j, ']');
  if (listed > REPORT_LISTED) report_print (j, "    and %d more\n", listed - REPORT_LISTED);
}

/* Why results of the linearisation are missing. */
static const char *report_why_not_computed (const pw_linear *linear) {
  static char text[80];
  snprintf (text, sizeof text, "%d coordinates, the limit is %d", linear->coordinates, CHECK_COORDINATES);
  return linear->coordinates > CHECK_COORDINATES ? text : "the linearisation fails, see the findings";
}

static void report_mobility (pw_json *j, const pw_check *check) {
  const pw_system *s = check->line.m.system;
  const pw_linear *linear = &check->linear;
  int coords = pw_system_coordinates (s), rows = pw_system_rows (s), holonomic = pw_system_holonomic (s), listed = 0;
  report_section (j, "mobility", '{', "Mobility");
  pw_json_number (j, "bodies", pw_system_bodies (s));
  report_entry (j, "coordinates", coords, "coordinates", "%d", coords);
  report_entry (j, "rows", rows, "constraint equations", "%d (%d on positions, %d on velocities)", rows, holonomic,
                rows - holonomic);
  pw_json_number (j, "holonomic_rows", holonomic);
  const struct {
    const char *key, *label;
    int value;
  } count[] = { { "configuration", "degrees of freedom, configuration", linear->positions },
                { "velocity", "degrees of freedom, velocity", linear->velocities },
                { "rank", "rank of J", linear->rank } };
  const int known = check->run && linear->rank + linear->positions > 0; /* all are 0 without a linearisation */
  for (int i = 0; i < 3; i++)
    report_entry (j, count[i].key, known ? (double)count[i].value : NAN, known ? count[i].label : NULL, "%d",
                  count[i].value);
  double length = check->run ? pw_run_scale (check->run)->length : NAN;
  const char *label = linear->rank > 0 ? "smallest singular value of J" : NULL;
  if (isnan (linear->least))
    report_entry (j, "least_singular_value", NAN, label, "not computed: %s", report_why_not_computed (linear));
  else
    report_entry (j, "least_singular_value", check->run ? linear->least : NAN, label,
                  "%s, rows scaled to length 1, angles multiplied by L = %s m", PW_DIGITS (linear->least, CHECK_DIGITS),
                  PW_DIGITS (length, CHECK_DIGITS));
  pw_json_number (j, "length_scale", length);
  pw_json_close (j, '}');
  report_section (j, "redundant", '[', NULL);
  if (check->run) report_text (j, "redundant constraint equations", "%d", pw_run_redundant (check->run));
  for (const char *const *text = check->redundant; text && *text; text++) report_item (j, &listed, *text, *text);
  report_end_list (j, listed);
}

static void report_mass (pw_json *j, const pw_check *check) {
  static const char *const lack[] = { NULL, "no mass", "no inertia", "neither mass nor inertia" };
  /* the error of solvers/matrices/saddle.c; after other errors it is not known if the matrix is singular */
  int is_singular = strstr (check->run_error.text, "no constraint determines how it moves") != NULL;
  const char *condition = is_singular                         ? "singular"
                          : check->run == NULL                ? NULL
                          : pw_run_redundant (check->run) > 0 ? "regular without the redundant constraint equations"
                                                              : "regular";
  const pw_system *s = check->line.m.system;
  const double *M = pw_system_mass (s);
  int lacking = 0, listed = 0;
  for (int b = 0; b < pw_system_bodies (s); b++) lacking += M[3 * b] == 0 || M[3 * b + 2] == 0;
  report_section (j, "massless", '[', "Mass"); /* also those with mass but no inertia */
  report_text (j, "bodies without mass or inertia", "%d", lacking);
  for (int b = 0; b < pw_system_bodies (s); b++) {
    int which = (M[3 * b] == 0) + 2 * (M[3 * b + 2] == 0);
    const char *name = pw_system_body_name (s, b);
    if (which == 0) continue;
    const char *unturned = pw_system_unturned (s, b) ? ": nothing turns it, its angle is left out of the motion" : "";
    report_item (j, &listed, name, PW_PRINTED (300, "%s has %s%s", name, lack[which], unturned));
  }
  report_end_list (j, listed);
  report_section (j, "unturned", '[', NULL); /* those of them whose angle is left out */
  for (int b = 0; b < pw_system_bodies (s); b++)
    if (pw_system_unturned (s, b)) pw_json_text (j, NULL, pw_system_body_name (s, b));
  pw_json_close (j, ']');
  report_text (j, "saddle-point matrix", "%s%s", condition ? condition : "not known", is_singular ? "; see below" : "");
  report_line (j);
  pw_json_text (j, "saddle_point", condition);
}

static void report_initial (pw_json *j, const pw_check *check) {
  static const char title[] = "Initial conditions";
  int listed = 0, n = pw_system_coordinates (check->line.m.system);
  if (check->run == NULL) {
    report_line (j);
    pw_json_text (j, "start", NULL);
    report_print (j, "\n%s\n  FAILED: %s\n", title, check->run_error.text);
    return;
  }
  const pw_initial_report *initial = pw_run_initial (check->run);
  report_section (j, "start", '{', title);
  pw_json_print (j, "moved: %d, freed: %i, changes: [", initial->moved, initial->released);
  if (initial->moved == 0)
    report_print (j, "  consistent as described\n");
  else
    report_print (j, "  %d value%s changed%s\n", initial->moved, initial->moved == 1 ? " was" : "s were",
                  initial->released ? ", including given ones" : "");
  for (int i = 0; i < 2 * n; i++)
    if (pw_initial_moved (check->line.m.system, initial, i)) {
      const pw_state_change c = pw_cli_state_change (check->line.m.system, pw_run_initial (check->run), i);
      pw_json_print (j, "{state: %s, from: %g, to: %g}", c.name, c.given, c.consistent);
      report_item (j, &listed, NULL,
                   PW_PRINTED (500, "%-20s from %s to %s, by %s %s", c.name, PW_DIGITS (c.given, 10),
                               PW_DIGITS (c.consistent, 10), PW_DIGITS (c.consistent - c.given, 3), c.unit));
    }
  report_end_list (j, listed);
  pw_json_close (j, '}');
  if (check->reference_states)
    report_print (j, "  compared with the reference solution of the model in %s\n",
                  PW_COUNTED (check->reference_states, "state"));
}

static void report_outputs (pw_json *j, const pw_check *check) {
  const pw_system *s = check->line.m.system;
  pw_sample sample;
  if (check->run == NULL || pw_system_outputs (s) == 0) return;
  if (pw_run_sample (check->run, pw_run_time (check->run), &sample, NULL) != PW_OK) return;
  report_section (j, "outputs", '{', "Outputs at the initial state");
  for (int i = 0; i < pw_system_outputs (s); i++)
    report_entry (j, pw_system_output_name (s, i), sample.output[i], pw_system_output_name (s, i), "%s %s",
                  PW_DIGITS (sample.output[i], CHECK_DIGITS), pw_system_output_unit (s, i));
  pw_json_close (j, '}');
}

/* The checks that failed, in `scenes`: "random scenes" or "this model". */
static void report_failures (pw_json *j, const pw_selftest_report *report, const char *scenes) {
  for (const pw_selftest_check *c = report->check; c < report->check + report->checks; c++) {
    if (!c->failed) continue;
    report_print (j, "    in %s: %s does not hold: off by %s, the bound is %s\n      %s\n", scenes, c->about,
                  PW_DIGITS (c->error, 2), PW_DIGITS (c->bound, 2), c->where);
    pw_json_print (j, "{check: %s, in: %s, expected: %s, error: %g, bound: %g, where: %s}", c->name, scenes, c->about,
                   c->error, c->bound, c->where);
  }
}

static char *report_eigenvalue (const pw_linear *linear, int i, char buffer[100]) {
  snprintf (buffer, 100, linear->im[i] != 0 ? "%s +- %s i 1/s" : "%s 1/s", PW_DIGITS (linear->re[i], CHECK_DIGITS),
            PW_DIGITS (fabs (linear->im[i]), CHECK_DIGITS));
  return buffer;
}

static void report_eigenvalues (const pw_linear *linear) {
  char text[100];
  for (int i = 0, lines = 0, same; i < linear->unknowns; i += same, lines++) {
    if (lines == REPORT_EIGENVALUES) {
      printf ("    and %d more\n", linear->unknowns - i);
      return;
    }
    for (same = 1; i + same < linear->unknowns && linear->re[i + same] == linear->re[i] &&
                   fabs (linear->im[i + same]) == fabs (linear->im[i]) && linear->rigid[i + same] == linear->rigid[i];)
      same++; /* equal eigenvalues, those of conjugate pairs included */
    int multiplicity = linear->im[i] != 0 ? same / 2 : same;
    const char *times = multiplicity > 1 ? PW_PRINTED (30, ", %d times", multiplicity) : "";
    report_text (NULL, i == 0 ? "eigenvalues, rightmost first" : "", "%s%s%s", report_eigenvalue (linear, i, text),
                 times, linear->rigid[i] ? ": rigid displacement" : "");
  }
}

static void report_motion (pw_json *j, const pw_linear *linear) {
  static const char *const steady[] = { "steady", "accelerated", "changing" };
  pw_json_text (j, "motion", steady[linear->steady]);
  report_entry (j, "acceleration", linear->acceleration, linear->steady == PW_ACCELERATED ? "motion" : NULL,
                "not steady: accelerations of %s m/s^2 in the co-moving frame", PW_DIGITS (linear->acceleration, 3));
  if (linear->steady == PW_CHANGING)
    report_text (j, "motion", "not steady: the equations change with time or along the motion");
  if (linear->steady != PW_STEADY) report_text (j, "", "the eigenvalues are not stability exponents");
  report_entry (j, "turn_rate", linear->twist[2], linear->twist[2] != 0 ? "co-moving frame" : NULL, "turns at %s rad/s",
                PW_DIGITS (linear->twist[2], CHECK_DIGITS));
  pw_json_number (j, "symmetries", linear->symmetries);
}

static void report_stability (pw_json *j, const pw_check *check) {
  const pw_linear *linear = &check->linear;
  double rightmost = -INFINITY; /* real part [1/s] */
  for (int i = 0; i < linear->unknowns; i++)
    if (!linear->rigid[i]) rightmost = fmax (rightmost, linear->re[i]);
  const char *label = linear->steady == PW_STEADY && isfinite (rightmost) ? "stability" : NULL;
  if (rightmost == 0)
    report_text (j, label, "neutral: no perturbation grows exponentially, not all decay");
  else
    report_text (j, label, "%s in %s s",
                 rightmost > 0 ? "unstable, doubles" : "stable, the slowest perturbation halves",
                 PW_DIGITS (log (2) / fabs (rightmost), CHECK_DIGITS));
  pw_json_number (j, "doubling_time", check->doubling_time);
}

static void report_fastest (pw_json *j, const pw_check *check) {
  const pw_linear *linear = &check->linear;
  int found = check->fastest >= 0;
  double re = found ? linear->re[check->fastest] : 0, im = found ? fabs (linear->im[check->fastest]) : 0,
         size = hypot (re, im);
  double ratio = !found ? NAN : re != 0 ? -re / size : 0;
  char text[100];
  if (found) report_text (j, "fastest eigenvalue", "%s", report_eigenvalue (linear, check->fastest, text));
  report_entry (j, "frequency_hz", im / (2 * PW_PI), im != 0 ? "its frequency" : NULL,
                "%s Hz, undamped it would be %s Hz", PW_DIGITS (im / (2 * PW_PI), CHECK_DIGITS),
                PW_DIGITS (size / (2 * PW_PI), CHECK_DIGITS));
  report_entry (j, "damping", ratio, im != 0 ? "its damping" : NULL, "%s of critical", PW_DIGITS (ratio, CHECK_DIGITS));
  if (found && im == 0)
    report_text (j, re < 0 ? "it decays by a factor of e in" : "it grows by a factor of e in", "%s s",
                 PW_DIGITS (1 / size, CHECK_DIGITS));
  if (found && isinf (check->rk4_limit))
    report_text (j, "RK4 is stable", "with any step: no mode decays or oscillates");
  else if (found)
    report_text (j, "RK4 is stable up to a step of", "%s s; the model's step is %s s", PW_DIGITS (check->rk4_limit, 3),
                 PW_DIGITS (check->step, 6));
  pw_json_number (j, "rk4_step", check->rk4_limit);
}

static void report_linear (pw_json *j, const pw_check *check) {
  const pw_linear *linear = &check->linear;
  if (linear->A == NULL) report_line (j), pw_json_text (j, "linearisation", NULL);
  if (check->run == NULL || (j && linear->A == NULL)) return;
  report_section (j, "linearisation", '{', "Linearised at the initial state");
  report_entry (j, "unknowns", linear->unknowns, "unknowns", "%d", linear->unknowns);
  if (linear->A == NULL) {
    report_text (j, "eigenvalues", "not computed: %s", report_why_not_computed (linear));
    return;
  }
  report_motion (j, linear);
  /* eigenvalues of rigid displacements are not 0 in a frame that turns */
  if (j == NULL && check->fastest < 0 && linear->twist[2] == 0)
    report_text (j, "eigenvalues", linear->unknowns ? "all 0: nothing vibrates, grows or decays" : "none");
  else if (j == NULL)
    report_eigenvalues (linear);
  report_stability (j, check);
  report_fastest (j, check);
  report_section (j, "eigenvalues", '[', NULL);
  for (int i = 0; i < linear->unknowns; i++)
    pw_json_numbers (j, NULL, (const double[]){ linear->re[i], linear->im[i] }, 2);
  pw_json_print (j, "]}");
}

static void report_limits (pw_json *j, const pw_check *check) {
  const pw_system *s = check->line.m.system;
  if (check->limits == 0) return;
  report_section (j, "limits", '[', "Limits of reactions, in the run of the model");
  for (const pw_checked_limit *l = check->limit; l < check->limit + check->limits; l++) {
    const char *reaction = PW_NAME (pw_system_reaction_name, s, l->row),
               *mode = pw_system_mode_name (s, l->row, l->mode);
    pw_json_print (j, "\n{reaction: %s, element: %s, mode: %s, events: %g, first: %g, used: %g, t: %g}", reaction,
                   PW_NAME (pw_system_row_name, s, l->row), mode, l->events, l->first, l->used, l->t);
    if (l->events > 0)
      report_text (j, reaction, "%s at the start; %s, the first at t = %s s", mode, PW_COUNTED (l->events, "event"),
                   PW_DIGITS (l->first, 6));
    else if (l->used >= 0)
      report_text (j, reaction, "%s and uses %s %% of its limit at most, at t = %s s", mode,
                   PW_DIGITS (100 * l->used, 3), PW_DIGITS (l->t, 4));
    else
      report_text (j, reaction, "%s at the start%s", mode, l->events == 0 ? "; no events" : "");
  }
  pw_json_close (j, ']');
}

static void report_list (pw_json *j, const char *key, const char *one, const pw_check_list *list) {
  if (list->count > 0) report_print (j, "\n%d %s\n", list->count, list->count == 1 ? one : key);
  report_section (j, key, '[', NULL);
  for (int i = 0; i < list->count; i++) {
    pw_json_text (j, NULL, list->text[i]);
    if (i < REPORT_LISTED) report_print (j, "  %s\n", list->text[i]);
  }
  if (list->count > REPORT_LISTED) report_print (j, "  and %d more\n", list->count - REPORT_LISTED);
  pw_json_close (j, ']');
}

static void report_lists (pw_json *j, const pw_check *check) {
  report_list (j, "problems", "problem", &check->problem);
  report_list (j, "findings", "finding", &check->finding);
}

/* Writes the report: as JSON to j, or as text to standard output if j is NULL. */
static void report_write (const pw_check *check, pw_json *j) {
  const char *about = pw_file_table (check->line.m.file)->about;
  pw_json_print (j, "{schema: %d, model: %s, status: %s", 1, pw_file_name (check->line.m.file),
                 check->problem.count ? "failed" : "ok");
  if (j) report_lists (j, check);
  report_print (j, "%s: %s\n", pw_file_name (check->line.m.file), about ? about : "");
  report_mobility (j, check);
  report_mass (j, check);
  report_initial (j, check);
  report_outputs (j, check);
  report_section (j, "kinds", '[',
                  "Self-test of the element types in use: each function against differences of other functions");
  for (const pw_checked_kind *k = check->kind; k < check->kind + check->kinds; k++) {
    pw_json_print (j, "\n{kind: %s, elements: %d, checks: %d, failed: [", k->kind->name, k->count,
                   k->random.checks + k->in_model.checks);
    report_text (j, PW_PRINTED (100, "%s (%s)", k->kind->name, PW_COUNTED (k->count, "element")),
                 "%s: %d checks in random scenes, %d in this model",
                 k->random.failed + k->in_model.failed ? "FAILED" : "good", k->random.checks, k->in_model.checks);
    if (*k->untested) report_print (j, "    not tested in random scenes: %s\n", k->untested);
    report_failures (j, &k->random, "random scenes");
    report_failures (j, &k->in_model, "this model");
    pw_json_print (j, "]}");
  }
  pw_json_close (j, ']');
  report_limits (j, check);
  report_linear (j, check);
  report_line (j);
  pw_json_close (j, '}');
  if (check->problem.count + check->finding.count == 0) report_print (j, "\nNo problems found\n");
  if (j == NULL) report_lists (j, check);
}

/* ---- The command ---- */

static int check_model (pw_check *check, pw_error *error) {
  const pw_system *s = check->line.m.system;
  const pw_run_defaults *defaults = &check->line.m.defaults;
  const pw_settings settings = { .span = defaults->t_end, .step = defaults->step };
  char notice[PW_NOTICE_BYTES];
  int status = PW_OK;
  check->rk4_limit = check->doubling_time = INFINITY;
  check->fastest = -1;
  pw_report_model (&check->line.m);
  for (int i = 0; i < pw_system_signals (s); i++) /* tables that do not cover the run, rows that are left out */
    if (*pw_system_table_notice (s, i, defaults->t_end, notice, sizeof notice))
      check_add (&check->finding, "%s", notice);
  check->step = defaults->step;
  check->uses_rk4 = strncmp (defaults->method, "rk4", 3) == 0;
  /* whatever method the model selects */
  check->run = pw_run_open (s, "rk4+projection", &settings, &check->run_error);
  if (check->run == NULL) check_add (&check->problem, "%s", check->run_error.text);
  if (check->run) {
    check->redundant = pw_report_redundancies (check->run);
    check_given_values (check);
    status = check_reference (check, error);
    if (status == PW_OK) status = check_limits (check, error);
    if (status == PW_OK) status = check_linear (check, error);
  }
  if (status == PW_OK) check_wheels (check);
  check->kind = calloc ((size_t)pw_system_elements (s) + 1, sizeof *check->kind);
  if (status == PW_OK && check->kind == NULL) status = pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; check->kind && i < pw_system_elements (s); i++) { /* those of a type are consecutive */
    const pw_kind *kind = pw_system_element (s, i).kind;
    if (check->kinds == 0 || check->kind[check->kinds - 1].kind != kind) check->kind[check->kinds++].kind = kind;
    check->kind[check->kinds - 1].count++;
  }
  for (int i = 0; status == PW_OK && i < check->kinds; i++) status = check_kind (check, &check->kind[i], error);
  int out_of_memory = check->problem.out_of_memory || check->finding.out_of_memory;
  return status == PW_OK && out_of_memory ? pw_fail (error, PW_RESOURCE, "out of memory") : status;
}

static int check_command (void *options, pw_error *error) {
  pw_check *check = options;
  pw_use use[] = { PW_CLI_MODEL_USE, { "--json", check->json_path, PW_WRITES, pw_cli_json } };
  int status = pw_cli_open (&check->line, error);
  if (status == PW_OK) status = pw_files_open (&check->line, use, 2, error);
  if (status == PW_OK) status = check_model (check, error);
  if (status == PW_OK) {
    FILE *json = pw_files_stream (&check->line, 1);
    if (json != stdout) report_write (check, NULL);
    if (json) report_write (check, &(pw_json){ .f = json });
    pw_files_finish (&check->line, error);
    if (check->problem.count) /* the exit status is that of a failed initialisation, otherwise that of bad input */
      pw_fail (error, check->run_error.status ? check->run_error.status : PW_INPUT, "%s%s", check->problem.text[0],
               check->problem.count > 1 ? "; and more, see above" : "");
  }
  pw_linear_free (&check->linear);
  pw_run_close (check->run);
  free (check->redundant);
  free (check->kind);
  free (check->problem.text);
  free (check->finding.text);
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
