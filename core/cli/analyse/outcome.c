/* Columns by name, and the texts of outputs. */
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
  size_t at; /* in pw_sample */
} outcome_single[PW_COLUMN_TYPES] = {
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

static int outcome_columns (const pw_system *s, pw_column_type type) {
  if (type == PW_COLUMN_STATE) return 2 * pw_system_coordinates (s);
  if (type == PW_COLUMN_CONTACT) return 2 * pw_system_contacts (s);
  if (type == PW_COLUMN_REACTION) return pw_system_rows (s);
  return type == PW_COLUMN_LEDGER ? pw_system_ledger_entries (s) : 1;
}

/* Name of the element with a contact point. */
static const char *outcome_contact (const pw_system *s, int contact) {
  int e = 0;
  while (pw_system_element (s, e).contact != contact) e++;
  return pw_system_element (s, e).name;
}

static const char *outcome_name (const pw_system *s, pw_column c, char *buffer, size_t size) {
  if (c.type == PW_COLUMN_STATE) return pw_system_state_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_REACTION) return pw_system_reaction_name (s, c.index, buffer, size);
  if (c.type == PW_COLUMN_LEDGER) return pw_system_ledger_name (s, c.index, buffer, size);
  if (c.type != PW_COLUMN_CONTACT) return outcome_single[c.type].name;
  snprintf (buffer, size, "%s.%c", outcome_contact (s, c.index / 2), "xy"[c.index % 2]);
  return buffer;
}

const char *pw_column_unit (const pw_system *s, pw_column c) {
  if (c.type == PW_COLUMN_STATE) return pw_system_state_unit (s, c.index);
  if (c.type == PW_COLUMN_REACTION) return pw_system_reaction_unit (s, c.index);
  return c.type == PW_COLUMN_CONTACT ? "m" : c.type == PW_COLUMN_LEDGER ? "J" : outcome_single[c.type].unit;
}

int pw_column_find (const pw_system *s, const char *name, const char *what, pw_column *c, pw_error *error) {
  char buffer[300];
  pw_nearest near = { .sought = name };
  for (*c = (pw_column){ 0 }; c->type < PW_COLUMN_TYPES; c->type++)
    for (c->index = 0; c->index < outcome_columns (s, c->type); c->index++) {
      const char *known = outcome_name (s, *c, buffer, sizeof buffer);
      if (strcmp (known, name) == 0) return PW_OK;
      pw_nearest_try (&near, known);
    }
  return pw_fail (error, PW_INPUT, "%s: no column \"%.100s\"%s", what, name, pw_nearest_text (&near));
}

double pw_column_value (const pw_system *s, pw_column c, const pw_sample *x) {
  int n = pw_system_coordinates (s);
  if (c.type == PW_COLUMN_STATE) return c.index < n ? x->q[c.index] : x->v[c.index - n];
  if (c.type == PW_COLUMN_REACTION) return 0 - x->lambda[c.index];
  if (c.type == PW_COLUMN_LEDGER) return x->ledger ? x->ledger[c.index] : NAN;
  if (c.type == PW_COLUMN_CONTACT) return NAN;
  return *(const double *)((const char *)x + outcome_single[c.type].at);
}

/* ---- Texts ---- */

static const char *const outcome_prefix[] = { "final:", "max:", "min:", "mean:", "integral:", "rms:" };

/* The functional at the beginning of a text; *text is moved to the column. */
static pw_functional_type outcome_type (const char **text) {
  for (int i = 0; i <= PW_RMS; i++) {
    size_t n = strlen (outcome_prefix[i]);
    if (strncmp (*text, outcome_prefix[i], n) == 0) return *text += n, (pw_functional_type)i;
  }
  return PW_FINAL;
}

/* The index of a functional, which is new or known; -1 if out of memory. */
static int outcome_add (pw_outcomes *x, pw_functional_type type, pw_column c) {
  for (int i = 0; i < x->functionals; i++) {
    const pw_functional *f = x->functional + i;
    if (f->type == type && f->column.type == c.type && f->column.index == c.index) return i;
  }
  pw_functional *more = realloc (x->functional, ((size_t)x->functionals + 1) * sizeof *more);
  if (more == NULL) return -1;
  x->functional = more;
  x->functional[x->functionals] = (pw_functional){ .type = type, .column = c };
  x->ledger |= c.type == PW_COLUMN_LEDGER || c.type >= PW_COLUMN_PROJECTION;
  return x->functionals++;
}

/* Name of the variable of term i in a formula. */
enum { OUTCOME_VARIABLE = 20 };
static const char *outcome_variable (char name[OUTCOME_VARIABLE], int i) {
  snprintf (name, OUTCOME_VARIABLE, "column%d", i + 1);
  return name;
}

/* Adds [TYPE:]NAME to an output, followed by `next` in its text, and the name of its variable in the formula to a text. */
static int outcome_term (pw_outcomes *x, pw_outcome *o, const char *what, const char *name, char next,
                         char variable[OUTCOME_VARIABLE], pw_error *error) {
  pw_column c;
  pw_functional_type type = outcome_type (&name);
  pw_error own = { 0 };
  if (pw_column_find (x->system, name, what, &c, &own) != PW_OK)
    return next == ':' ? pw_fail (error, PW_INPUT,
                                  "%s: no \"%s:\"; valid are final:, max:, min:, mean:, integral: and rms:", what, name)
                       : pw_fail (error, PW_INPUT, "%s", own.text);
  int f = outcome_add (x, type, c), i = 0;
  if (f < 0) return pw_fail (error, PW_RESOURCE, "out of memory");
  while (i < o->terms && o->term[i] != f) i++;
  if (i == PW_FORMULA_NAMES) return pw_fail (error, PW_INPUT, "%s: more than %d columns", what, PW_FORMULA_NAMES);
  if (i == o->terms) o->term[o->terms++] = f;
  outcome_variable (variable, i);
  return PW_OK;
}

#define OUTCOME_LETTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"

/* Length of [TYPE:]NAME at the beginning of a text; 0 if it begins with something else, a function or a constant.  Names
 * may contain "-": the longest column decides, and if there is none, the longest name. */
static size_t outcome_length (const pw_system *s, const char *text) {
  static const char *const constant[] = { "pi", "e", "deg" };
  const char *at = text;
  char name[300];
  pw_column c;
  if (strspn (text, OUTCOME_LETTERS) == 0) return 0;
  outcome_type (&at);
  size_t type = (size_t)(at - text), word = strspn (at, OUTCOME_LETTERS "0123456789."),
         all = strspn (at, OUTCOME_LETTERS "0123456789.-");
  for (int i = 0; i < 3 && type == 0; i++)
    if (strlen (constant[i]) == word && strncmp (constant[i], at, word) == 0) return 0;
  if (at[word + strspn (at + word, " ")] == '(') return 0;
  for (size_t n = all; n > 0; n--)
    if (n < sizeof name && (n == all || at[n] == '-')) {
      snprintf (name, sizeof name, "%.*s", (int)n, at);
      if (pw_column_find (s, name, "", &c, NULL) == PW_OK) return type + n;
    }
  return type + all;
}

/* Length of what is copied to the formula: a function or constant, a number, or another character. */
static size_t outcome_copied (const char *text) {
  size_t n = strspn (text, OUTCOME_LETTERS "0123456789."), sign = text[n] == '+' || text[n] == '-';
  if (n > 1 && strchr ("0123456789.", *text) && strchr ("eE", text[n - 1]) && sign) n += 1;
  return n ? n : 1;
}

/* Replaces columns by variables of a formula. */
static int outcome_formula (pw_outcomes *x, pw_outcome *o, const char *what, pw_error *error) {
  char text[4000], name[300];
  size_t used = 0;
  for (const char *at = o->text; *at;) {
    char variable[OUTCOME_VARIABLE];
    size_t n = outcome_length (x->system, at), size = n ? 0 : outcome_copied (at);
    if (n >= sizeof name || used + size + sizeof variable > sizeof text)
      return pw_fail (error, PW_INPUT, "%s: the expression is too long", what);
    snprintf (name, sizeof name, "%.*s", (int)n, at);
    int status = n ? outcome_term (x, o, what, name, at[n], variable, error) : PW_OK;
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
  return o->formula ? PW_OK : pw_fail (error, own.status, "%s: %s", what, own.text);
}

/* A single column may have any name. */
static int outcome_read (pw_outcomes *x, pw_outcome *o, const char *option, pw_error *error) {
  char what[300], variable[OUTCOME_VARIABLE];
  snprintf (what, sizeof what, "%s %.200s", option, o->text);
  if (*o->text == 0) return pw_fail (error, PW_INPUT, "%s is empty: expected a column, such as frame.x", option);
  pw_error own = { 0 };
  int status = outcome_term (x, o, what, o->text, 0, variable, &own);
  if (status == PW_RESOURCE) return pw_fail (error, status, "%s", own.text);
  return status == PW_OK ? PW_OK : outcome_formula (x, o, what, error);
}

int pw_outcomes_open (pw_outcomes *x, const pw_system *s, const char *option, const char *const *text, int count,
                      pw_error *error) {
  *x = (pw_outcomes){ .system = s, .outcome = calloc ((size_t)count + 1, sizeof *x->outcome) };
  x->contact = calloc ((size_t)pw_system_contacts (s) + 1, sizeof *x->contact);
  x->workspace = pw_workspace_new (s, error);
  if (x->outcome == NULL || x->contact == NULL || x->workspace == NULL)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  for (; x->outcomes < count; x->outcomes++) {
    x->outcome[x->outcomes].text = text[x->outcomes];
    int status = outcome_read (x, x->outcome + x->outcomes, option, error);
    if (status == PW_OK) continue;
    pw_formula_close (x->outcome[x->outcomes].formula);
    return status;
  }
  return PW_OK;
}

void pw_outcomes_close (pw_outcomes *x) {
  for (int i = 0; i < x->outcomes; i++) pw_formula_close (x->outcome[i].formula);
  free (x->outcome);
  free (x->functional);
  free (x->contact);
  pw_workspace_free (x->workspace);
  *x = (pw_outcomes){ .system = NULL };
}

/* ---- Values ---- */

double pw_outcome_value (const pw_outcomes *x, int outcome, double *gradient) {
  const pw_outcome *o = x->outcome + outcome;
  double value[PW_FORMULA_NAMES] = { 0 };
  for (int i = 0; i < o->terms; i++) value[i] = x->functional[o->term[i]].value;
  for (int i = 0; gradient && i < x->functionals; i++) gradient[i] = 0;
  for (int i = 0; gradient && i < o->terms; i++)
    gradient[o->term[i]] = o->formula ? pw_formula_derivative (o->formula, value, i) : 1;
  return o->formula ? pw_formula_value (o->formula, value) : value[0];
}

const char *pw_outcome_unit (const pw_outcomes *x, int outcome, char *buffer, size_t size) {
  const pw_outcome *o = x->outcome + outcome;
  const pw_functional *f = x->functional + o->term[0];
  const char *unit = o->formula ? "" : pw_column_unit (x->system, f->column);
  snprintf (buffer, size, "%s%s", unit, o->formula || f->type != PW_INTEGRAL ? "" : *unit ? " s" : "s");
  return buffer;
}
