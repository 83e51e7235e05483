/* Outputs of analyses: columns of the table of `run` by name, texts of outputs, and functionals of runs. */
#define _POSIX_C_SOURCE 200809L
#include <gsl/gsl_errno.h>
#include <gsl/gsl_min.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "outcome.h"
#include "cli.h"

static int outcome_column (const pw_system *s, const char *name, const char *origin, pw_column *c, pw_error *error) {
  pw_error own = { 0 };
  const int status = pw_system_find_column (s, name, c, &own);
  return status == PW_OK ? PW_OK : pw_fail (error, status, "%s: %s", origin, own.text);
}

static const char *const outcome_prefix[] = { "final:",    "max:", "min:",    "mean:",
                                              "integral:", "rms:", "events:", "event:" };
#define OUTCOME_PREFIXES "final:, max:, min:, mean:, integral:, rms:, at TIME:, events:, event: and event N:"

/* Reads the prefix of a functional at the beginning of a text, final: without one; *text is moved to the name after it.
 * Sets its type, and the time of "at TIME:" or the number of "event N:". */
static pw_functional outcome_type (const char **text) {
  for (int i = 0; i < PW_AT_TIME; i++) {
    const size_t n = strlen (outcome_prefix[i]);
    if (strncmp (*text, outcome_prefix[i], n) == 0)
      return *text += n, (pw_functional){ .type = (pw_functional_type)i, .number = i == PW_EVENT };
  }
  const int is_event = strncmp (*text, "event ", 6) == 0;
  const char *colon = strchr (*text, ':'), *begin = *text + (is_event ? 6 : 3);
  char number[40];
  double value;
  if (colon == NULL || !(is_event || strncmp (*text, "at ", 3) == 0)) return (pw_functional){ .type = PW_FINAL };
  snprintf (number, sizeof number, "%.*s", (int)fmin (sizeof number - 1, (double)(colon - begin)), begin);
  if (pw_read_number (number, &value) != PW_OK) return (pw_functional){ .type = PW_FINAL };
  *text = colon + 1;
  if (is_event)
    return (pw_functional){ .type = PW_EVENT, .number = *pw_domain_check (PW_COUNT, value) ? 0 : (long)value };
  return (pw_functional){ .type = PW_AT_TIME, .t = value };
}

/* Finds the constraint equations of "events:NAME" or "event:NAME", those with limits from the first to the last one. */
static int outcome_find_events (const pw_system *s, const char *name, const char *origin, pw_functional *f,
                                pw_error *error) {
  pw_nearest near = { .sought = name };
  char element[PW_NAME_BYTES] = "", reaction[PW_NAME_BYTES];
  for (int row = 0; row < pw_system_rows (s); row++) {
    if (pw_system_limits (s, row) == NULL) continue;
    const size_t n = strcspn (pw_system_reaction_name (s, row, reaction, sizeof reaction), ".");
    if (strlen (element) != n || strncmp (element, reaction, n) != 0) {
      snprintf (element, sizeof element, "%.*s", (int)n, reaction);
      pw_nearest_try (&near, element);
    }
    if (strcmp (reaction, name) != 0 && strcmp (element, name) != 0) continue;
    if (f->rows == 0) f->row = row;
    f->rows = row - f->row + 1;
  }
  if (f->rows) return PW_OK;
  if (pw_system_limited (s) == 0)
    return pw_fail (error, PW_INPUT, "%s: no reaction of the model has a limit, so there are no events", origin);
  return pw_fail (error, PW_INPUT, "%s: no element or reaction with a limit \"%.100s\"%s", origin, name,
                  pw_nearest_text (&near));
}

/* The functional "[TYPE:]NAME"; `origin` begins messages. */
static int outcome_functional (const pw_system *s, const char *text, const char *origin, pw_functional *f,
                               pw_error *error) {
  *f = outcome_type (&text);
  const int is_event = f->type == PW_EVENTS || f->type == PW_EVENT;
  int status = outcome_column (s, is_event ? "t" : text, origin, &f->column, error);
  if (f->type == PW_EVENT && f->number < 1) return pw_fail (error, PW_INPUT, "%s: events are counted from 1", origin);
  if (is_event) return outcome_find_events (s, text, origin, f, error);
  if (status == PW_OK || f->type != PW_FINAL || strcmp (text, "events") != 0) return status;
  *error = (pw_error){ 0 }, f->type = PW_EVENTS;
  return outcome_column (s, "t", origin, &f->column, error);
}

/* The index of a functional, which is added unless it is there; -1 if out of memory. */
static int outcome_add_functional (pw_outcomes *set, const pw_functional *added) {
  const pw_column c = added->column;
  for (int i = 0; i < set->functionals; i++) {
    const pw_functional *f = set->functional + i;
    if (f->type == added->type && f->column.type == c.type && f->column.index == c.index && f->t == added->t &&
        f->row == added->row && f->rows == added->rows && f->number == added->number)
      return i;
  }
  pw_functional *more = realloc (set->functional, ((size_t)set->functionals + 1) * sizeof *more);
  if (more == NULL) return -1;
  set->functional = more;
  set->functional[set->functionals] = *added;
  set->ledger |= c.type > PW_COLUMN_POTENTIAL && c.type < PW_COLUMN_OUTPUT;
  set->extrema += pw_is_extremum (added->type), set->integrals += pw_is_integral (added->type);
  return set->functionals++;
}

/* The variable that stands for term i in a formula, "column1": names in formulas have no dots. */
enum { OUTCOME_VARIABLE = 20 };
static const char *outcome_variable (char name[OUTCOME_VARIABLE], int i) {
  snprintf (name, OUTCOME_VARIABLE, "column%d", i + 1);
  return name;
}

/* Adds the functional `name`, [TYPE:]NAME, to an output, unless it is there, and writes the name of its variable.
 * next: the character after it in the text of the output, for the message about an unknown TYPE. */
static int outcome_add_term (pw_outcomes *set, pw_outcome *o, const char *origin, const char *name, char next,
                             char variable[OUTCOME_VARIABLE], pw_error *error) {
  pw_functional functional;
  pw_error own = { 0 };
  const int status = outcome_functional (set->system, name, origin, &functional, &own);
  outcome_type (&name); /* the column in the messages below */
  if (status != PW_OK)
    return next == ':' ? pw_fail (error, PW_INPUT, "%s: no \"%s:\"; valid are " OUTCOME_PREFIXES, origin, name)
                       : pw_fail (error, PW_INPUT, "%s", own.text);
  const pw_column c = functional.column;
  const pw_functional_type type = functional.type;
  if (pw_is_integral (type) && (c.type == PW_COLUMN_POSITION || c.type == PW_COLUMN_VELOCITY ||
                                c.type == PW_COLUMN_PROJECTION || c.type == PW_COLUMN_BALANCE))
    return pw_fail (error, PW_INPUT, "%s: %s describes the integration, not the motion: it has no %s", origin, name,
                    type == PW_INTEGRAL ? "integral" : "mean");
  const unsigned integrated = 1u << PW_COLUMN_LEDGER | 1u << PW_COLUMN_WORK | 1u << PW_COLUMN_LOSS;
  if (pw_is_integral (type) && c.type == PW_COLUMN_OUTPUT && pw_system_output_reads (set->system, c.index) & integrated)
    return pw_fail (
        error, PW_INPUT,
        "%s: %s reads works or losses, which are integrals themselves; valid are final:, max: and min:", origin, name);
  if (type == PW_RMS && pw_column_is_integrated (c.type))
    return pw_fail (error, PW_INPUT,
                    "%s: no rms: of work and losses; valid are final:, max:, min:, mean: and integral:", origin);
  int f = outcome_add_functional (set, &functional), i = 0;
  if (f < 0) return pw_fail (error, PW_RESOURCE, "out of memory");
  while (i < o->terms && o->term[i] != f) i++;
  if (i == PW_FORMULA_NAMES) return pw_fail (error, PW_INPUT, "%s: more than %d columns", origin, PW_FORMULA_NAMES);
  if (i == o->terms) o->term[o->terms++] = f;
  outcome_variable (variable, i);
  return PW_OK;
}

#define OUTCOME_LETTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"

/* Length of [TYPE:]NAME at the beginning of a text; 0 if it begins with something else, a function or a constant.
 * Names may contain "-", as differences do: the longest name that is a column is taken, and if there is none, the
 * longest name. */
static size_t outcome_term_length (const pw_system *s, const char *text) {
  static const char *const constant[] = { "pi", "e", "deg" };
  const char *at = text;
  char name[300];
  pw_functional f;
  if (strspn (text, OUTCOME_LETTERS) == 0) return 0;
  outcome_type (&at);
  size_t prefix = (size_t)(at - text), word = strspn (at, OUTCOME_LETTERS "0123456789."),
         longest = strspn (at, OUTCOME_LETTERS "0123456789.-");
  for (int i = 0; i < 3 && prefix == 0; i++)
    if (strlen (constant[i]) == word && strncmp (constant[i], at, word) == 0) return 0;
  if (at[word + strspn (at + word, " ")] == '(') return 0;
  for (size_t n = longest; n > 0; n--)
    if (prefix + n < sizeof name && (n == longest || at[n] == '-')) {
      snprintf (name, sizeof name, "%.*s", (int)(prefix + n), text);
      if (outcome_functional (s, name, "", &f, &(pw_error){ 0 }) == PW_OK) return prefix + n;
    }
  return prefix + longest;
}

/* Refuses a functional of an expression, "max:abs (A.N)", and one that is written as a function, "rms (A.N)". */
static int outcome_refuse_call (const char *text, const char *origin, pw_error *error) {
  const char *column = text;
  outcome_type (&column);
  if (column != text)
    return pw_fail (error, PW_INPUT, "%s: %.*s takes a column; for an expression, define an output of the model",
                    origin, (int)(column - text), text);
  for (int i = 0; i < PW_AT_TIME; i++) {
    const size_t n = strlen (outcome_prefix[i]) - 1;
    if (strncmp (text, outcome_prefix[i], n) == 0 && text[n + strspn (text + n, " ")] == '(' && i != PW_MAX &&
        i != PW_MIN)
      return pw_fail (error, PW_INPUT, "%s: write %s and the column", origin, outcome_prefix[i]);
  }
  return PW_OK;
}

static int outcome_read_formula (pw_outcomes *set, pw_outcome *o, const char *origin, pw_error *error) {
  char text[4000], name[300];
  size_t used = 0;
  for (const char *at = o->text; *at;) {
    char variable[OUTCOME_VARIABLE];
    /* else it contains unchanged: a function or constant, a number up to the sign of its exponent, another character */
    size_t n = outcome_term_length (set->system, at), word = strspn (at, OUTCOME_LETTERS "0123456789."),
           size = n      ? 0
                  : word ? word
                         : 1;
    if (n == 0 && outcome_refuse_call (at, origin, error) != PW_OK) return error->status;
    if (n >= sizeof name || used + size + sizeof variable > sizeof text)
      return pw_fail (error, PW_INPUT, "%s: the expression is too long", origin);
    snprintf (name, sizeof name, "%.*s", (int)n, at);
    int status = n ? outcome_add_term (set, o, origin, name, at[n], variable, error) : PW_OK;
    if (status != PW_OK) return status;
    memcpy (text + used, n ? variable : at, n ? strlen (variable) : size);
    used += n ? strlen (variable) : size;
    at += n + size;
  }
  text[used] = 0;
  char variables[PW_FORMULA_NAMES][OUTCOME_VARIABLE];
  const char *names[PW_FORMULA_NAMES + 1] = { NULL };
  for (int i = 0; i < PW_FORMULA_NAMES; i++) names[i] = outcome_variable (variables[i], i);
  pw_error own = { 0 };
  o->formula = pw_formula_open (text, names, &own);
  if (o->formula) return PW_OK;
  const int extremum =
      strcmp (own.text, "too few arguments") == 0 && (strstr (o->text, "max") || strstr (o->text, "min"));
  return pw_fail (error, own.status, "%s: %s%s", origin, own.text,
                  extremum ? "; extrema over the run are max:COLUMN and min:COLUMN" : "");
}

int pw_outcomes_open (pw_outcomes *set, const pw_system *s, const char *option, const char *const *text, int count,
                      const char *until, pw_error *error) {
  pw_error own = { 0 };
  *set = (pw_outcomes){ .system = s, .outcome = calloc ((size_t)count + 1, sizeof *set->outcome), .until = until };
  set->workspace = pw_workspace_new (s, error);
  set->value = calloc ((size_t)count + 1, sizeof *set->value);
  if (set->outcome == NULL || set->value == NULL || set->workspace == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  if (until && (set->condition = pw_condition_open (s, until, &own)) == NULL)
    return pw_fail (error, own.status, "--until %.200s: %s", until, own.text);
  set->ledger = until && pw_condition_needs_ledger (set->condition);
  for (; set->outcomes < count; set->outcomes++) {
    pw_outcome *o = set->outcome + set->outcomes;
    char variable[OUTCOME_VARIABLE];
    pw_error single = { 0 };
    o->text = text[set->outcomes];
    if (*o->text == 0) return pw_fail (error, PW_INPUT, "%s is empty: expected a column, such as frame.x", option);
    const char *origin = PW_PRINTED (300, "%s %.200s", option, o->text);
    /* a single column, which may have any name, is no formula */
    int status = outcome_add_term (set, o, origin, o->text, 0, variable, &single);
    if (status == PW_RESOURCE) return pw_fail (error, status, "%s", single.text);
    if (status != PW_OK) status = outcome_read_formula (set, o, origin, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}

void pw_outcomes_close (pw_outcomes *set) {
  for (int i = 0; i < set->outcomes; i++) pw_formula_close (set->outcome[i].formula);
  free (set->outcome);
  free (set->value);
  free (set->functional);
  pw_condition_close (set->condition);
  pw_workspace_free (set->workspace);
  *set = (pw_outcomes){ .system = NULL };
}

void pw_outcomes_report (const pw_outcomes *set) {
  for (const pw_functional *f = set->functional; f < set->functional + set->functionals; f++)
    if (pw_is_integral (f->type) && f->column.type == PW_COLUMN_OUTPUT &&
        pw_system_output_jumps (set->system, f->column.index))
      pw_cli_say ("pinwheel: output %s has conditions on reactions, energies or contact points, which are not located: "
                  "its integral may be wrong by what changes within a step; compare with smaller steps\n",
                  pw_system_output_name (set->system, f->column.index));
}

double pw_outcome_value (const pw_outcomes *set, int outcome) {
  const pw_outcome *o = set->outcome + outcome;
  double value[PW_FORMULA_NAMES] = { 0 };
  for (int i = 0; i < o->terms; i++) value[i] = set->functional[o->term[i]].value;
  return o->formula ? pw_formula_value (o->formula, value) : value[0];
}

int pw_outcome_is_final (const pw_outcomes *set, int outcome) {
  const pw_outcome *o = set->outcome + outcome;
  for (int i = 0; i < o->terms; i++)
    if (set->functional[o->term[i]].type != PW_FINAL) return 0;
  return 1;
}

const char *pw_outcome_unit (const pw_outcomes *set, int outcome, char *buffer, size_t size) {
  const pw_outcome *o = set->outcome + outcome;
  const pw_functional *f = set->functional + o->term[0];
  const char *unit = o->formula || f->type == PW_EVENTS ? "" : pw_system_column_unit (set->system, f->column);
  int is_integral = !o->formula && f->type == PW_INTEGRAL, of_time = strcmp (unit, "s") == 0;
  snprintf (buffer, size, "%s%s", unit, !is_integral ? "" : of_time ? "^2" : *unit ? " s" : "s");
  return buffer;
}

/* Functionals of columns, evaluated along a run.
 *
 * Integrals are entries of the run's ledger.  That of work or a loss W with the rate P, from the time t0 on, is
 * (t - t0) W - integral of (t - t0) P.
 *
 * For extrema each step is sampled at its middle and end.  With its beginning, a column has the values x0, xm and x1;
 * where its bend |x0 - 2 xm + x1| is below |x1 - x0| / 5, the parabola through them is monotonic: the extremum is at an
 * end.  Otherwise, if it may be beyond the extremum so far, the step is sampled at 5 times between and beside its ends:
 * values jump at breakpoints, where steps end, so that a step before a jump is always sampled so, and so are long
 * steps, in which three values say little.  Where these values are far from the parabola, as those of a reaction that
 * oscillates in a long step of a motionless scene, the step is halved.  The largest or least value is refined by
 * Brent's method between its neighbours. */

#define FUNCTIONAL_LINEAR 0.2  /* largest bend of a column that counts as monotonic, relative to |x1 - x0| */
#define FUNCTIONAL_CURVED 0.25 /* distance from the parabola from which on a step is halved, relative to the range */
#define FUNCTIONAL_LONG 0.02   /* steps longer than this part of the run are few, and always sampled at all times */
#define FUNCTIONAL_INSET 1e-6  /* distance from the ends of a step of the times beside them, relative to its size */
/* Brent's method ends when its interval has shrunk by this factor: nearer to the extremum, the column changes by less
 * than round-off. */
#define FUNCTIONAL_WIDTH 1e-8
enum {
  FUNCTIONAL_HALVINGS = 8,                  /* of a step, at most */
  FUNCTIONAL_MIDDLE = 4,                    /* index of the time in the middle of a step, see functional_times */
  FUNCTIONAL_END = PW_FUNCTIONAL_TIMES - 1, /* and at its end */
  FUNCTIONAL_OTHER = PW_FUNCTIONAL_TIMES,   /* index of any other time */
  FUNCTIONAL_ITERATIONS = 60                /* of Brent's method, at most; golden sections alone would need 39 */
};

/* A step of a run. */
typedef struct {
  pw_outcomes *set;
  pw_run *run;
  double t0, t1; /* its beginning and end [s] */
  int status;
  pw_error *error;
} functional_step;

/* Stores the columns in a sample as values[at] of their functionals. */
static int functional_read (pw_outcomes *set, const pw_sample *s, int at, pw_error *error) {
  for (pw_functional *f = set->functional; f < set->functional + set->functionals; f++) {
    const int status = pw_workspace_columns (set->workspace, s, &f->column, 1, &f->values[at], error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}

/* Stores the columns at t, a time in the step, as values[at], unless that or an earlier sample fails. */
static void functional_sample (functional_step *step, double t, int at) {
  pw_sample s;
  if (step->status == PW_OK) step->status = pw_run_sample (step->run, t, &s, step->error);
  if (step->status == PW_OK) step->status = functional_read (step->set, &s, at, step->error);
}

/* The column of a functional at time t in the step; NaN if that fails. */
static double functional_at (functional_step *step, const pw_functional *f, double t) {
  functional_sample (step, t, FUNCTIONAL_OTHER);
  return step->status == PW_OK ? f->values[FUNCTIONAL_OTHER] : NAN;
}

/* pw_settings.integrand, NaN where contact points cannot be evaluated. */
static void functional_integrands (void *context, const pw_sample *s, double *value) {
  pw_outcomes *set = context;
  const int status = functional_read (set, s, FUNCTIONAL_OTHER, NULL);
  for (const pw_functional *f = set->functional; f < set->functional + set->functionals; f++) {
    double x = status == PW_OK ? f->values[FUNCTIONAL_OTHER] : NAN;
    if (!pw_is_integral (f->type)) continue;
    *value++ = f->type == PW_RMS ? x * x : pw_column_is_integrated (f->column.type) ? (s->t - set->begin) * x : x;
  }
}

/* The value of a functional at the end of the run, where columns are their values[FUNCTIONAL_END]; integral: of its
 * integrand, over the span [s]. */
static double functional_of_integral (const pw_functional *f, double integral, double span) {
  if (pw_column_is_integrated (f->column.type)) integral = span * f->values[FUNCTIONAL_END] - integral;
  if (f->type == PW_INTEGRAL) return integral;
  return f->type == PW_MEAN ? integral / span : sqrt (fmax (integral / span, 0));
}

static void functional_update_extremum (pw_functional *f, double t, double value) {
  if (f->type == PW_MAX ? value > f->value : value < f->value) f->value = value, f->t = t;
}

typedef struct {
  functional_step *step;
  const pw_functional *f;
  double origin; /* of GSL's times [s]: their tolerance is relative, and t may be large */
} functional_search;

/* What is minimised at a time after the origin: the column, or for a maximum its negative. */
static double functional_signed (double after, void *context) {
  functional_search *search = context;
  double value = functional_at (search->step, search->f, search->origin + after);
  return search->f->type == PW_MAX ? -value : value;
}

/* Refines an extremum that lies between the first and the last of three times; value: what is minimised, at each of
 * them, the least at the second one. */
static void functional_refine (functional_step *step, pw_functional *f, const double t[3], const double value[3]) {
  functional_search search = { step, f, t[1] };
  gsl_function minimised = { functional_signed, &search };
  gsl_min_fminimizer *m = gsl_min_fminimizer_alloc (gsl_min_fminimizer_brent);
  if (m == NULL) {
    step->status = pw_fail (step->error, PW_RESOURCE, "out of memory");
    return;
  }
  int status =
      gsl_min_fminimizer_set_with_values (m, &minimised, 0, value[1], t[0] - t[1], value[0], t[2] - t[1], value[2]);
  for (int i = 0; i < FUNCTIONAL_ITERATIONS && status == GSL_SUCCESS; i++) {
    status = gsl_min_fminimizer_iterate (m);
    if (gsl_min_fminimizer_x_upper (m) - gsl_min_fminimizer_x_lower (m) < FUNCTIONAL_WIDTH * (t[2] - t[0])) break;
  }
  double least = gsl_min_fminimizer_f_minimum (m);
  if (step->status == PW_OK)
    functional_update_extremum (f, t[1] + gsl_min_fminimizer_x_minimum (m), f->type == PW_MAX ? -least : least);
  gsl_min_fminimizer_free (m);
}

/* The extremum over the step from values at all of its times.  It is refined if it is inside the step and may be beyond
 * the extremum so far: by assumption it is beyond these values by their range at most. */
static void functional_extremum (functional_step *step, pw_functional *f, const double *t, const double *value) {
  double y[PW_FUNCTIONAL_TIMES], range = 0;
  int best = 0;
  for (int i = 0; i < PW_FUNCTIONAL_TIMES; i++) {
    y[i] = f->type == PW_MAX ? -value[i] : value[i];
    if (y[i] < y[best]) best = i;
  }
  for (int i = 0; i < PW_FUNCTIONAL_TIMES; i++) range = fmax (range, y[i] - y[best]);
  int inside = best > 0 && best < FUNCTIONAL_END && y[best] < y[best - 1] && y[best] < y[best + 1];
  int may_lead = y[best] - range < (f->type == PW_MAX ? -f->value : f->value);
  functional_update_extremum (f, t[best], value[best]);
  if (inside && may_lead) functional_refine (step, f, t + best - 1, y + best - 1);
}

/* Times in a step, as parts of it: its beginning, just after it, five times between, just before the end, the end. */
static const double functional_part[PW_FUNCTIONAL_TIMES] = { 0,     FUNCTIONAL_INSET,     0.047, 0.231, 0.5, 0.769,
                                                             0.953, 1 - FUNCTIONAL_INSET, 1 };

/* 1 if the values at all times are near the parabola through those at the ends and in the middle. */
static int functional_is_smooth (const pw_functional *f) {
  const double *y = f->values, x0 = y[0], slope = 4 * y[FUNCTIONAL_MIDDLE] - 3 * x0 - y[FUNCTIONAL_END],
               bend = 2 * (x0 - 2 * y[FUNCTIONAL_MIDDLE] + y[FUNCTIONAL_END]);
  double most = x0, least = x0, distance = 0;
  for (int i = 2; i < FUNCTIONAL_END - 1; i++) { /* without those beside the ends, where values may jump */
    const double part = functional_part[i];
    most = fmax (most, y[i]), least = fmin (least, y[i]);
    distance = fmax (distance, fabs (y[i] - (x0 + part * (slope + part * bend))));
  }
  return !(distance > FUNCTIONAL_CURVED * (most - least));
}

/* 1 if the values at the ends and in the middle do not suffice: the column is not nearly linear, and in the step may be
 * beyond the extremum so far. */
static int functional_needs_nodes (const pw_functional *f) {
  double x0 = f->values[0], xm = f->values[FUNCTIONAL_MIDDLE], x1 = f->values[FUNCTIONAL_END],
         bend = fabs (x0 - 2 * xm + x1),
         lead = f->type == PW_MAX ? fmax (x0, fmax (xm, x1)) - f->value : f->value - fmin (x0, fmin (xm, x1));
  return pw_is_extremum (f->type) && bend > FUNCTIONAL_LINEAR * fabs (x1 - x0) && lead + bend + fabs (x1 - x0) > 0;
}

/* Updates the extrema after a step, or a part of one that may be halved so often. */
static void functional_extrema (functional_step *step, int halvings) {
  double t[PW_FUNCTIONAL_TIMES];
  int nodes = step->t1 - step->t0 > FUNCTIONAL_LONG * step->set->span || pw_system_jumps (step->set->system, step->t1),
      smooth = 1;
  pw_functional *const begin = step->set->functional, *const end = begin + step->set->functionals;
  for (int i = 0; i < FUNCTIONAL_END; i++) t[i] = step->t0 + functional_part[i] * (step->t1 - step->t0);
  t[FUNCTIONAL_END] = step->t1;
  functional_sample (step, t[FUNCTIONAL_MIDDLE], FUNCTIONAL_MIDDLE);
  functional_sample (step, step->t1, FUNCTIONAL_END);
  for (const pw_functional *f = begin; f < end; f++) nodes |= functional_needs_nodes (f);
  for (int i = 1; nodes && i < FUNCTIONAL_END; i++)
    if (i != FUNCTIONAL_MIDDLE) functional_sample (step, t[i], i);
  for (const pw_functional *f = begin; f < end && nodes; f++)
    smooth &= !pw_is_extremum (f->type) || functional_is_smooth (f);
  if (!smooth && halvings > 0) {
    const double last = step->t1;
    step->t1 = t[FUNCTIONAL_MIDDLE];
    functional_extrema (step, halvings - 1);
    step->t0 = step->t1, step->t1 = last;
    functional_extrema (step, halvings - 1);
    return;
  }
  for (pw_functional *f = begin; f < end && step->status == PW_OK; f++) {
    if (pw_is_extremum (f->type) && nodes) functional_extremum (step, f, t, f->values);
    if (pw_is_extremum (f->type) && !nodes) functional_update_extremum (f, step->t1, f->values[FUNCTIONAL_END]);
    f->values[0] = f->values[FUNCTIONAL_END];
  }
}

void pw_outcomes_settings (pw_outcomes *set, pw_settings *settings) {
  settings->ledger |= set->ledger;
  settings->integrals = set->integrals, settings->integrand = functional_integrands;
  settings->integrand_context = set;
}

/* Samples values at given times up to the end of the step that are not known yet. */
static void functional_values_at_times (functional_step *step) {
  for (pw_functional *f = step->set->functional; f < step->set->functional + step->set->functionals; f++)
    if (f->type == PW_AT_TIME && isnan (f->value) && f->t <= step->t1) f->value = functional_at (step, f, f->t);
}

static void functional_check_condition (functional_step *step) {
  double t = NAN;
  if (step->set->condition && step->status == PW_OK)
    step->status = pw_run_find_crossing (step->run, &step->set->crossing, &t, step->error);
  if (!isnan (t)) step->t1 = t, step->set->ended = 1;
}

int pw_outcomes_begin (pw_outcomes *set, pw_run *r, double t_end, pw_error *error) {
  const double t = pw_run_time (r);
  functional_step step = { set, r, t, t, PW_OK, error };
  set->begin = set->t = t, set->span = t_end - t, set->ended = 0;
  set->crossing = (pw_crossing){ .value = pw_condition_value, .context = set->condition };
  functional_sample (&step, t, 0);
  for (pw_functional *f = set->functional; f < set->functional + set->functionals; f++) {
    if (f->type == PW_AT_TIME && !(f->t >= t && f->t <= t_end))
      return pw_fail (error, PW_INPUT, "at %.15g: the run is from %.15g s to %.15g s", f->t, t, t_end);
    f->value = f->type == PW_AT_TIME ? NAN : f->values[0];
    if (f->type != PW_AT_TIME) f->t = t;
  }
  functional_values_at_times (&step);
  functional_check_condition (&step);
  return step.status;
}

int pw_outcomes_advance (pw_outcomes *set, pw_run *r, double t, double t_end, pw_error *error) {
  functional_step step = { set, r, set->t, set->t, PW_OK, error };
  for (const pw_functional *f = set->functional; f < set->functional + set->functionals; f++)
    if (f->type == PW_AT_TIME && f->t > set->t && f->t < t) t = f->t; /* the first time at which a value is sampled */
  step.status =
      set->extrema || set->condition ? pw_run_advance (r, t_end, error) : pw_run_advance_to (r, t, t_end, error);
  step.t1 = pw_run_time (r);
  functional_check_condition (&step);
  if (step.status == PW_OK && set->extrema) functional_extrema (&step, FUNCTIONAL_HALVINGS);
  functional_values_at_times (&step);
  set->t = step.t1;
  return step.status;
}

/* The number of events of a functional up to the end of the run, or the time of one; NaN: it has not occurred. */
static double functional_of_events (const pw_outcomes *set, const pw_functional *f, const pw_run *r) {
  int count;
  long number = 0;
  const pw_event *event = pw_run_events (r, &count);
  for (const pw_event *e = event; e < event + count && e->t <= set->t; e++) {
    if (f->rows && (e->row < f->row || e->row >= f->row + f->rows)) continue;
    if (++number == f->number) return e->t;
  }
  return f->type == PW_EVENTS ? (double)number : NAN;
}

int pw_outcomes_end (pw_outcomes *set, pw_run *r, pw_error *error) {
  pw_sample s;
  if (!set->ended) set->t = pw_run_time (r);
  if (pw_run_sample (r, set->t, &s, error) != PW_OK || functional_read (set, &s, FUNCTIONAL_END, error) != PW_OK)
    return error->status;
  for (pw_functional *f = set->functional; f < set->functional + set->functionals; f++) {
    if (pw_is_integral (f->type)) f->value = functional_of_integral (f, *s.integral++, set->t - set->begin);
    if (f->type == PW_FINAL) f->value = f->values[FUNCTIONAL_END];
    if (f->type == PW_EVENTS || f->type == PW_EVENT) f->value = functional_of_events (set, f, r);
  }
  return PW_OK;
}

int pw_outcomes_run (pw_outcomes *set, const char *method, const pw_settings *settings, double t_end,
                     const pw_outcome_table *table, pw_error *error) {
  pw_settings own = *settings;
  pw_outcomes_settings (set, &own);
  pw_run *r = pw_limit_open (set->system, method, &own, error);
  if (r == NULL) return error->status;
  functional_step step = { set, r, own.t, own.t, pw_outcomes_begin (set, r, t_end, error), error };
  for (int row = 0, rows = table ? table->rows : 0; step.status == PW_OK;) {
    for (; row < rows && table->t[row] <= set->t && step.status == PW_OK; row++) { /* at a time in the last step */
      functional_sample (&step, table->t[row], FUNCTIONAL_OTHER);
      for (pw_functional *f = set->functional; f < set->functional + set->functionals; f++)
        if (f->type == PW_FINAL) f->value = f->values[FUNCTIONAL_OTHER];
      for (int o = 0; o < set->outcomes; o++)
        table->value[o * rows + row] = pw_outcome_is_final (set, o) ? pw_outcome_value (set, o) : NAN;
    }
    if (step.status != PW_OK || set->ended || !(set->t < t_end)) break;
    step.status = pw_outcomes_advance (set, r, row < rows ? table->t[row] : t_end, t_end, error);
  }
  if (step.status == PW_OK) step.status = pw_outcomes_end (set, r, error);
  if (step.status == PW_STOPPED) step.status = pw_limit_status (settings->stop_context, set->t, error);
  if (step.status == PW_OK && set->condition && !set->ended)
    step.status = pw_fail (error, PW_METHOD, "--until %.200s: not true before the end of the run at t = %.15g s",
                           set->until, set->t);
  pw_run_close (r);
  return step.status;
}
