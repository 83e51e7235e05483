/* Signals in text models.
 *
 *   3, "2 * M0"                                    a constant
 *   {constant: 3}                                  the same
 *   {harmonic: {amplitude, omega, phase, offset}}  and the other forms made of numbers (signal_form.c)
 *   "M0 * cos (omega * t)"                         an expression of the time t; of states, BODY.phi, for forces
 *   {expression: .., rate: .., acceleration: ..}   the same for constraints, which need its derivatives by time
 *
 * An expression becomes a function signal.  Its context in the model is a recipe, from which each compiled system makes
 * evaluators of its own, since it may run in a thread of its own and outlive the model. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "signal.h"
#include "yaml.h"

enum { SIGNAL_STATES = 16 };

/* ---- Expressions of time ---- */

/* As the model has it; all of it in the model's arena. */
typedef struct {
  const pw_yaml *y;
  const char *text[3];                  /* value, rate, acceleration; NULL: not given */
  const char *reads[SIGNAL_STATES + 1]; /* BODY.phi and the like */
  int states;                           /* so many */
  int values;                           /* parameters, and what `let` defines */
  double value[];                       /* of them */
} signal_recipe;

/* As a system has it. */
typedef struct {
  pw_expression *x[3];         /* evaluators of the recipe's texts */
  double t;                    /* what they see as t, */
  double state[SIGNAL_STATES]; /* as BODY.phi */
  int states;
  double value[]; /* as parameters, and what `let` defines */
} signal_function;

static void signal_close (void *context) {
  signal_function *f = context;
  for (int i = 0; f && i < 3; i++) pw_expression_close (f->x[i]);
  free (f);
}

/* What an expression may name: the parameters, what `let` defines, the time, states. */
static int signal_names (const signal_recipe *r, signal_function *f, pw_expression *x) {
  int failed = 0, n = 0;
  for (int i = 0; i < r->y->parameters; i++) failed |= pw_expression_name (x, r->y->parameter[i].name, &f->value[n++]);
  for (const pw_node *node = r->y->let ? r->y->let->first : NULL; node; node = node->next->next)
    failed |= pw_expression_name (x, node->text, &f->value[n++]);
  failed |= pw_expression_name (x, "t", &f->t);
  for (int i = 0; i < r->states; i++) failed |= pw_expression_name (x, r->reads[i], &f->state[i]);
  return failed ? PW_MACHINE : PW_OK;
}

/* Makes the evaluator of text i; PW_INPUT with the trouble, or PW_MACHINE. */
static int signal_evaluator (const signal_recipe *r, signal_function *f, int i, pw_expression_trouble *trouble) {
  f->x[i] = pw_expression_open (r->values + 1 + r->states);
  if (f->x[i] == NULL || signal_names (r, f, f->x[i]) != PW_OK) return PW_MACHINE;
  return pw_expression_set (f->x[i], r->text[i], trouble);
}

static signal_function *signal_empty (const signal_recipe *r) {
  signal_function *f = calloc (1, sizeof *f + (size_t)r->values * sizeof *f->value);
  if (f == NULL) return NULL;
  f->states = r->states;
  memcpy (f->value, r->value, (size_t)r->values * sizeof *f->value);
  return f;
}

static void *signal_open (void *context) {
  const signal_recipe *r = context;
  signal_function *f = signal_empty (r);
  pw_expression_trouble trouble;
  for (int i = 0; f && i < 3; i++)
    if (r->text[i] && signal_evaluator (r, f, i, &trouble) != PW_OK) {
      signal_close (f);
      return NULL;
    }
  return f;
}

static int signal_eval (void *context, double t, const double *x, double value[3], double *gradient) {
  signal_function *f = context;
  f->t = t;
  for (int i = 0; i < f->states; i++) f->state[i] = x[i];
  int good = 1;
  for (int i = 0; i < 3; i++)
    if (f->x[i]) good &= isfinite (value[i] = pw_expression_value (f->x[i])) != 0;
  for (int i = 0; gradient && i < f->states; i++) {
    double h = cbrt (2.2e-16) * fmax (1, fabs (x[i])); /* the truncation and round-off of central differences balance */
    double up = f->state[i] = x[i] + h, down = x[i] - h;
    double above = pw_expression_value (f->x[0]);
    f->state[i] = down;
    gradient[i] = (above - pw_expression_value (f->x[0])) / (up - down);
    f->state[i] = x[i];
  }
  return good ? 0 : -1;
}

/* ---- Names in expressions ---- */

typedef struct {
  pw_yaml_builder *b;
  signal_recipe *recipe;
  signal_function *f; /* to try it out */
  const pw_node *node;
  const char *what;
  int forced;
  pw_error *error;
} signal_reader;

/* Notes a state the expression reads. */
static int signal_note (void *context, const char *name, size_t length, size_t at) {
  signal_reader *r = context;
  signal_recipe *f = r->recipe;
  char text[100];
  if (memchr (name, '.', length) == NULL) return PW_OK;
  snprintf (text, sizeof text, "%.*s", (int)length, name);
  for (int i = 0; i < f->states; i++)
    if (strcmp (f->reads[i], text) == 0) return PW_OK;
  if (!r->forced)
    return pw_yaml_fail (r->b->y, pw_yaml_place (r->b->y, r->node, at), r->error,
                         "%s: \"%s\": the signal of a constraint depends on the time t alone", r->what, text);
  if (pw_yaml_state (r->b, &(pw_yaml_reading){ r->node, r->what }, text, at, r->error) != PW_OK)
    return r->error->status;
  if (f->states == SIGNAL_STATES || length >= sizeof text)
    return pw_yaml_fail (r->b->y, pw_yaml_place (r->b->y, r->node, at), r->error, "%s: more than %d states", r->what,
                         SIGNAL_STATES);
  f->reads[f->states] = pw_arena_text (&r->b->m->arena, text);
  if (f->reads[f->states] == NULL) return pw_yaml_no_memory (r->b->y, r->error);
  f->states++;
  return PW_OK;
}

static int signal_expression (signal_reader *r, int i) {
  const pw_yaml *y = r->b->y;
  pw_expression_trouble trouble;
  if (pw_yaml_text (y, r->node, r->what, &r->recipe->text[i], r->error) != PW_OK ||
      pw_expression_names (r->node->text, signal_note, r) != PW_OK)
    return r->error->status;
  int status = signal_evaluator (r->recipe, r->f, i, &trouble);
  if (status == PW_INPUT)
    return pw_yaml_fail (y, pw_yaml_place (y, r->node, trouble.at), r->error, "%s: %s", r->what, trouble.text);
  return status == PW_OK ? PW_OK : pw_yaml_no_memory (y, r->error);
}

/* ---- Derivatives by time ---- */

static double signal_at (signal_function *f, int i, double t) {
  f->t = t;
  return pw_expression_value (f->x[i]);
}

/* Central differences of text i, extrapolated (Richardson), and their round-off. */
static double signal_difference (signal_function *f, int i, double t, double h, double *round_off) {
  double up = signal_at (f, i, t + h), down = signal_at (f, i, t - h);
  double near = (up - down) / (2 * h), far = (signal_at (f, i, t + 2 * h) - signal_at (f, i, t - 2 * h)) / (4 * h);
  *round_off = 1000 * DBL_EPSILON * (fabs (up) + fabs (down)) / h;
  return (4 * near - far) / 3;
}

/* Compares a derivative with differences of what it should be the derivative of, at some times.  A wrong formula is off by
 * about its own size; a right one agrees for one of the step sizes however fast the signal is. */
static int signal_check (signal_reader *r, int i, const char *name) {
  static const double time[] = { 0.3, 1.7, 4.1 };
  for (int k = 0; k < 3; k++) {
    double t = time[k], given = signal_at (r->f, i, t), found = NAN;
    int good = !isfinite (given);
    for (double h = 1.0 / (1 << 10); h > 1e-8 && !good; h /= 16) {
      double round_off;
      found = signal_difference (r->f, i - 1, t, h, &round_off);
      good = !isfinite (found) || fabs (found - given) <= 1e-3 * (fabs (found) + fabs (given)) + round_off;
    }
    if (!good)
      return pw_yaml_fail (r->b->y, r->node->at, r->error, "%s: the %s at t = %g s is %.6g, but differences give %.6g",
                           r->what, name, t, given, found);
  }
  return PW_OK;
}

/* Reads value, rate and acceleration as far as the kind needs them. */
static int signal_all (signal_reader *r, const pw_kind *kind, const pw_node *const v[3]) {
  static const char *const key[] = { "expression", "rate", "acceleration" };
  int needed = r->forced ? 1 : kind->level == PW_HOLONOMIC ? 3 : 2;
  for (int i = 0; i < 3; i++) {
    if (v[i] == NULL && i < needed)
      return pw_yaml_fail (r->b->y, v[0]->at, r->error,
                           "%s: a constraint needs the derivatives by time: write {expression: .., rate: ..%s}",
                           r->what, needed > 2 ? ", acceleration: .." : "");
    if (v[i] == NULL) continue;
    r->node = v[i];
    if (signal_expression (r, i) != PW_OK) return r->error->status;
    if (i > 0 && r->f->x[i - 1] && !r->recipe->states && signal_check (r, i, key[i]) != PW_OK) return r->error->status;
  }
  return PW_OK;
}

static int signal_of_time (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *const v[3],
                           pw_signal *signal, pw_error *error) {
  int parameters = b->y->parameters, values = parameters + b->lets;
  for (int i = 0; i < 3; i++) b->evaluators += v[i] ? PW_YAML_EVALUATOR + values : 0;
  if (b->evaluators > PW_YAML_WORDS)
    return pw_yaml_fail (
        b->y, v[0]->at, error,
        "%s: the signals by expressions up to here, each of which knows %d parameters and definitions, "
        "need more memory than a model may have",
        what, values);
  signal_recipe *r = pw_arena_take (&b->m->arena, sizeof *r + (size_t)values * sizeof *r->value);
  if (r == NULL) return pw_yaml_no_memory (b->y, error);
  r->y = b->y;
  r->values = values;
  memcpy (r->value, b->parameter, (size_t)parameters * sizeof *r->value);
  memcpy (r->value + parameters, b->let, (size_t)b->lets * sizeof *r->value);
  signal_reader reader = { b, r, signal_empty (r), NULL, what, pw_kind_forced (kind), error };
  int status = reader.f ? signal_all (&reader, kind, v) : pw_yaml_no_memory (b->y, error);
  signal_close (reader.f);
  *signal = (pw_signal){ PW_FUNCTION, .function = { .eval = signal_eval, .context = r } };
  signal->function.open = signal_open;
  signal->function.close = signal_close;
  if (r->states) signal->function.reads = r->reads;
  signal->function.differenced = r->states > 0;
  return status;
}

/* ---- The forms of a signal ---- */

/* Reads what a form is made of; a table's points besides. */
static int signal_fields (pw_yaml_builder *b, const pw_signal_form *form, const char *what, const pw_node *node,
                          const pw_node *const *v, pw_signal *signal, pw_error *error) {
  char text[240];
  for (int i = 0; form->fields[i].name; i++) {
    const pw_field *f = &form->fields[i];
    void *at = (char *)signal + f->offset;
    snprintf (text, sizeof text, "%s: %s", what, f->name);
    if (v[i] == NULL && f->required) return pw_yaml_fail (b->y, node->at, error, "%s is missing", text);
    if (v[i] && f->type == PW_NUMBER && pw_yaml_number (b->y, v[i], text, f->domain, b->x, at, error) != PW_OK)
      return error->status;
    if (v[i] && f->type == PW_CHOICE && pw_yaml_choice (b, v[i], text, f->choices, at, error) != PW_OK)
      return error->status;
  }
  return PW_OK;
}

/* What only the whole tells: at the point of the table that is meant, or at the signal. */
static int signal_fault (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node,
                         const pw_node *points, const pw_signal *signal, pw_error *error) {
  char fault[300];
  int point;
  if (*pw_signal_fault (signal, kind, &point, fault, sizeof fault) == 0) return PW_OK;
  for (const pw_node *n = points ? points->first : NULL; n && point >= 0; n = n->next)
    if (point-- == 0) node = n;
  return pw_yaml_fail (b->y, node->at, error, "%s: %s", what, fault);
}

static int signal_form (pw_yaml_builder *b, const pw_kind *kind, const pw_signal_form *form, const char *what,
                        const pw_node *node, pw_signal *signal, pw_error *error) {
  const char *key[PW_YAML_KEYS];
  char about[100];
  const pw_node *v[PW_YAML_KEYS], *points = NULL;
  int n = 0;
  *signal = (pw_signal){ .type = form->type };
  for (const pw_field *f = form->fields; f->name; f++) key[n++] = f->name;
  if (form->type == PW_TABLE)
    key[n] = "points", key[n + 1] = "file", key[n + 2] = "columns", key[n + 3] = NULL;
  else
    key[n] = NULL;
  snprintf (about, sizeof about, "a %s", form->name);
  if (pw_yaml_keys (b->y, node, 0, key, about, v, error) != PW_OK ||
      signal_fields (b, form, what, node, v, signal, error) != PW_OK)
    return error->status;
  if (form->type == PW_TABLE && pw_yaml_points (b, what, node, v + n, signal, error) != PW_OK) return error->status;
  if (form->type == PW_TABLE) points = v[n];
  return signal_fault (b, kind, what, node, points, signal, error);
}

enum { SIGNAL_CONSTANT, SIGNAL_EXPRESSION, SIGNAL_RATE, SIGNAL_ACCELERATION, SIGNAL_FORMS };

/* "constant, expression, harmonic, ..." */
static char *signal_list (const char *const *key, char *buffer, size_t size) {
  size_t n = (size_t)snprintf (buffer, size, "%s, %s", key[SIGNAL_CONSTANT], key[SIGNAL_EXPRESSION]);
  for (key += SIGNAL_FORMS; *key && n < size; key++) n += (size_t)snprintf (buffer + n, size - n, ", %s", *key);
  return buffer;
}

/* {TYPE: ..} */
static int signal_map (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node,
                       pw_signal *signal, pw_error *error) {
  const char *key[PW_YAML_KEYS] = { "constant", "expression", "rate", "acceleration" };
  const pw_node *v[PW_YAML_KEYS];
  char list[100];
  int n = SIGNAL_FORMS, given = 0, form = -1;
  for (const pw_signal_form *f = pw_signal_forms; f->name; f++) key[n++] = f->name;
  key[n] = NULL;
  if (pw_yaml_keys (b->y, node, 0, key, "a signal", v, error) != PW_OK) return error->status;
  for (int i = 0; i < n; i++) {
    given += v[i] != NULL && i != SIGNAL_RATE && i != SIGNAL_ACCELERATION;
    if (v[i] && i >= SIGNAL_FORMS) form = i;
  }
  if (given != 1)
    return pw_yaml_fail (b->y, node->at, error, "%s: expected one of %s; found %s", what,
                         signal_list (key, list, sizeof list), given ? "several" : "none");
  if (!v[SIGNAL_EXPRESSION] && (v[SIGNAL_RATE] || v[SIGNAL_ACCELERATION]))
    return pw_yaml_fail (b->y, node->at, error, "%s: a rate or acceleration belongs to an expression", what);
  if (v[SIGNAL_CONSTANT])
    return pw_yaml_number (b->y, v[SIGNAL_CONSTANT], what, PW_REAL, b->x, &signal->constant, error);
  if (v[SIGNAL_EXPRESSION]) return signal_of_time (b, kind, what, v + SIGNAL_EXPRESSION, signal, error);
  return signal_form (b, kind, &pw_signal_forms[form - SIGNAL_FORMS], what, v[form], signal, error);
}

int pw_yaml_signal (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node, pw_signal *signal,
                    pw_error *error) {
  const pw_node *const v[3] = { node, NULL, NULL };
  if (node->type == PW_YAML_MAP) return signal_map (b, kind, what, node, signal, error);
  if (node->type == PW_YAML_SCALAR && pw_yaml_moves (node->text, NULL))
    return signal_of_time (b, kind, what, v, signal, error);
  return pw_yaml_number (b->y, node, what, PW_REAL, b->x, &signal->constant, error);
}
