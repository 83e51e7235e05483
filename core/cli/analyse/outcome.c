/* Outputs of analyses: columns of the table of `run` by name, and texts of outputs; functionals: functional.c. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include "outcome.h"
#include "util.h"

/* ---- Columns ---- */

/* Columns that are one number of a sample. */
static const struct {
  const char *name, *unit;
  size_t offset; /* in pw_sample */
} outcome_scalars[PW_COLUMN_TYPES] = {
  [PW_COLUMN_TIME] = { "t", "s", offsetof (pw_sample, t) },
  [PW_COLUMN_POSITION] = { "residual.position", "", offsetof (pw_sample, position) },
  [PW_COLUMN_VELOCITY] = { "residual.velocity", "", offsetof (pw_sample, velocity) },
  [PW_COLUMN_KINETIC] = { "kinetic", "J", offsetof (pw_sample, kinetic) },
  [PW_COLUMN_POTENTIAL] = { "potential", "J", offsetof (pw_sample, potential) },
  [PW_COLUMN_PROJECTION] = { "projection", "J", offsetof (pw_sample, projection) },
  [PW_COLUMN_BALANCE] = { "balance", "J", offsetof (pw_sample, balance) },
  [PW_COLUMN_WORK] = { "work", "J", offsetof (pw_sample, work) },
  [PW_COLUMN_LOSS] = { "loss", "J", offsetof (pw_sample, loss) },
};

static int outcome_count_columns (const pw_system *s, pw_column_type type) {
  if (type == PW_COLUMN_STATE) return 2 * pw_system_coordinates (s);
  if (type == PW_COLUMN_CONTACT) return 2 * pw_system_contacts (s);
  if (type == PW_COLUMN_REACTION) return pw_system_rows (s);
  return type == PW_COLUMN_LEDGER ? pw_system_ledger_entries (s) : 1;
}

static const char *outcome_name (const pw_system *s, pw_column c, char *buffer, size_t size) {
  if (c.type == PW_COLUMN_STATE) return pw_system_state_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_REACTION) return pw_system_reaction_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_LEDGER) return pw_system_ledger_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_CONTACT) return pw_system_contact_name (s, c.index, buffer, size);
  return outcome_scalars[c.type].name;
}

const char *pw_column_unit (const pw_system *s, pw_column c) {
  if (c.type == PW_COLUMN_STATE) return pw_system_state_unit (s, c.index);
  if (c.type == PW_COLUMN_REACTION) return pw_system_reaction_unit (s, c.index);
  return c.type == PW_COLUMN_CONTACT ? "m" : c.type == PW_COLUMN_LEDGER ? "J" : outcome_scalars[c.type].unit;
}

int pw_column_find (const pw_system *s, const char *name, const char *origin, pw_column *c, pw_error *error) {
  char buffer[300];
  pw_nearest near = { .sought = name };
  for (*c = (pw_column){ 0 }; c->type < PW_COLUMN_TYPES; c->type++)
    for (c->index = 0; c->index < outcome_count_columns (s, c->type); c->index++) {
      const char *known = outcome_name (s, *c, buffer, sizeof buffer);
      if (strcmp (known, name) == 0) return PW_OK;
      pw_nearest_try (&near, known);
    }
  return pw_fail (error, PW_INPUT, "%s: no column \"%.100s\"%s", origin, name, pw_nearest_text (&near));
}

double pw_column_value (const pw_system *s, pw_column c, const pw_sample *sample) {
  int n = pw_system_coordinates (s);
  if (c.type == PW_COLUMN_STATE) return c.index < n ? sample->q[c.index] : sample->v[c.index - n];
  if (c.type == PW_COLUMN_REACTION) return 0 - sample->lambda[c.index]; /* the reaction is -lambda; not -0 */
  if (c.type == PW_COLUMN_LEDGER) return sample->ledger ? sample->ledger[c.index] : NAN;
  if (c.type == PW_COLUMN_CONTACT) return NAN;
  return *(const double *)((const char *)sample + outcome_scalars[c.type].offset);
}

/* ---- Texts ---- */

static const char *const outcome_prefix[] = { "final:", "max:", "min:", "mean:", "integral:", "rms:" };

/* Reads the prefix of a functional at the beginning of a text, final: without one; *text is moved to the column. */
static pw_functional_type outcome_type (const char **text) {
  for (int i = 0; i <= PW_RMS; i++) {
    size_t n = strlen (outcome_prefix[i]);
    if (strncmp (*text, outcome_prefix[i], n) == 0) return *text += n, (pw_functional_type)i;
  }
  return PW_FINAL;
}

/* The index of a functional, which is added unless it is there; -1 if out of memory. */
static int outcome_add_functional (pw_outcomes *set, pw_functional_type type, pw_column c) {
  for (int i = 0; i < set->functionals; i++) {
    const pw_functional *f = set->functional + i;
    if (f->type == type && f->column.type == c.type && f->column.index == c.index) return i;
  }
  pw_functional *more = realloc (set->functional, ((size_t)set->functionals + 1) * sizeof *more);
  if (more == NULL) return -1;
  set->functional = more;
  set->functional[set->functionals] = (pw_functional){ .type = type, .column = c };
  set->ledger |= c.type > PW_COLUMN_POTENTIAL;
  set->extrema += pw_is_extremum (type), set->integrals += pw_is_integral (type);
  return set->functionals++;
}

/* The variable that stands for term i in a formula, "column1": names in formulas have no dots. */
enum { OUTCOME_VARIABLE = 20 };
static const char *outcome_variable (char name[OUTCOME_VARIABLE], int i) {
  snprintf (name, OUTCOME_VARIABLE, "column%d", i + 1);
  return name;
}

static int outcome_is_diagnostic (pw_column_type type) {
  return type == PW_COLUMN_POSITION || type == PW_COLUMN_VELOCITY || type == PW_COLUMN_PROJECTION ||
         type == PW_COLUMN_BALANCE;
}

/* Adds the functional `name`, [TYPE:]NAME, to an output, unless it is there, and writes the name of its variable.
 * next: the character after it in the text of the output, for the message about an unknown TYPE. */
static int outcome_add_term (pw_outcomes *set, pw_outcome *o, const char *origin, const char *name, char next,
                             char variable[OUTCOME_VARIABLE], pw_error *error) {
  pw_column c;
  pw_functional_type type = outcome_type (&name);
  pw_error own = { 0 };
  if (pw_column_find (set->system, name, origin, &c, &own) != PW_OK)
    return next == ':'
               ? pw_fail (error, PW_INPUT,
                          "%s: no \"%s:\"; valid are final:, max:, min:, mean:, integral: and rms:", origin, name)
               : pw_fail (error, PW_INPUT, "%s", own.text);
  if (pw_is_integral (type) && outcome_is_diagnostic (c.type))
    return pw_fail (error, PW_INPUT, "%s: %s describes the integration, not the motion: it has no %s", origin, name,
                    type == PW_INTEGRAL ? "integral" : "mean");
  if (type == PW_RMS && pw_column_is_integrated (c.type))
    return pw_fail (error, PW_INPUT,
                    "%s: no rms: of work and losses; valid are final:, max:, min:, mean: and integral:", origin);
  int f = outcome_add_functional (set, type, c), i = 0;
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
  pw_column c;
  if (strspn (text, OUTCOME_LETTERS) == 0) return 0;
  outcome_type (&at);
  size_t prefix = (size_t)(at - text), word = strspn (at, OUTCOME_LETTERS "0123456789."),
         longest = strspn (at, OUTCOME_LETTERS "0123456789.-");
  for (int i = 0; i < 3 && prefix == 0; i++)
    if (strlen (constant[i]) == word && strncmp (constant[i], at, word) == 0) return 0;
  if (at[word + strspn (at + word, " ")] == '(') return 0;
  for (size_t n = longest; n > 0; n--)
    if (n < sizeof name && (n == longest || at[n] == '-')) {
      snprintf (name, sizeof name, "%.*s", (int)n, at);
      if (pw_column_find (s, name, "", &c, NULL) == PW_OK) return prefix + n;
    }
  return prefix + longest;
}

/* Length of what the formula contains unchanged: a function or constant, a number up to the sign of
 * its exponent, or another character. */
static size_t outcome_copied_length (const char *text) {
  size_t n = strspn (text, OUTCOME_LETTERS "0123456789.");
  return n ? n : 1;
}

/* Makes the formula of an output from its text, with variables in place of columns. */
static int outcome_read_formula (pw_outcomes *set, pw_outcome *o, const char *origin, pw_error *error) {
  char text[4000], name[300];
  size_t used = 0;
  for (const char *at = o->text; *at;) {
    char variable[OUTCOME_VARIABLE];
    size_t n = outcome_term_length (set->system, at), size = n ? 0 : outcome_copied_length (at);
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
  return o->formula ? PW_OK : pw_fail (error, own.status, "%s: %s", origin, own.text);
}

/* Reads an output.  A single column, which may have any name, is no formula. */
static int outcome_read (pw_outcomes *set, pw_outcome *o, const char *option, pw_error *error) {
  char variable[OUTCOME_VARIABLE];
  const char *origin = PW_PRINTED (300, "%s %.200s", option, o->text);
  if (*o->text == 0) return pw_fail (error, PW_INPUT, "%s is empty: expected a column, such as frame.x", option);
  pw_error own = { 0 };
  int status = outcome_add_term (set, o, origin, o->text, 0, variable, &own);
  if (status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
  return status == PW_OK ? PW_OK : outcome_read_formula (set, o, origin, error);
}

int pw_outcomes_open (pw_outcomes *set, const pw_system *s, const char *option, const char *const *text, int count,
                      pw_error *error) {
  *set = (pw_outcomes){ .system = s, .outcome = calloc ((size_t)count + 1, sizeof *set->outcome) };
  set->contact = calloc ((size_t)pw_system_contacts (s) + 1, sizeof *set->contact);
  set->workspace = pw_workspace_new (s, error);
  if (set->outcome == NULL || set->contact == NULL || set->workspace == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  for (; set->outcomes < count; set->outcomes++) {
    set->outcome[set->outcomes].text = text[set->outcomes];
    int status = outcome_read (set, set->outcome + set->outcomes, option, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}

void pw_outcomes_close (pw_outcomes *set) {
  for (int i = 0; i < set->outcomes; i++) pw_formula_close (set->outcome[i].formula);
  free (set->outcome);
  free (set->functional);
  free (set->contact);
  pw_workspace_free (set->workspace);
  *set = (pw_outcomes){ .system = NULL };
}

/* ---- Values ---- */

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
  const char *unit = o->formula ? "" : pw_column_unit (set->system, f->column);
  int is_integral = !o->formula && f->type == PW_INTEGRAL, of_time = strcmp (unit, "s") == 0;
  snprintf (buffer, size, "%s%s", unit, !is_integral ? "" : of_time ? "^2" : *unit ? " s" : "s");
  return buffer;
}
