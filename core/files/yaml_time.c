/* Signals by expressions of time, and of states, in text models.
 *
 * Such an expression becomes a function signal.  Its context in the model is a recipe, from which each compiled system makes
 * evaluators of its own, since it may run in a thread of its own and outlive the model. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "signal.h"
#include "yaml.h"

enum { TIME_STATES = 16 };

/* As the model has it; all of it in the model's arena. */
typedef struct {
  const pw_yaml *y;
  const char *text[3];                /* value, rate, acceleration; NULL: not given */
  const char *reads[TIME_STATES + 1]; /* BODY.phi and the like */
  int states;                         /* so many */
  int values;                         /* parameters, and what `let` defines */
  double value[];                     /* of them */
} time_recipe;

/* As a system has it. */
typedef struct {
  pw_expression *x[3];       /* evaluators of the recipe's texts */
  double t;                  /* what they see as t, */
  double state[TIME_STATES]; /* as BODY.phi */
  int states;
  double value[]; /* as parameters, and what `let` defines */
} time_function;

static void time_close (void *context) {
  time_function *f = context;
  for (int i = 0; f && i < 3; i++) pw_expression_close (f->x[i]);
  free (f);
}

/* What an expression may name: the parameters, what `let` defines, the time, states. */
static int time_names (const time_recipe *r, time_function *f, pw_expression *x) {
  int failed = 0, n = 0;
  for (int i = 0; i < r->y->parameters; i++) failed |= pw_expression_name (x, r->y->parameter[i].name, &f->value[n++]);
  for (const pw_node *node = r->y->let ? r->y->let->first : NULL; node; node = node->next->next)
    failed |= pw_expression_name (x, node->text, &f->value[n++]);
  failed |= pw_expression_name (x, "t", &f->t);
  for (int i = 0; i < r->states; i++) failed |= pw_expression_name (x, r->reads[i], &f->state[i]);
  return failed ? PW_MACHINE : PW_OK;
}

/* Makes the evaluator of text i; PW_INPUT with the trouble, or PW_MACHINE. */
static int time_evaluator (const time_recipe *r, time_function *f, int i, pw_expression_trouble *trouble) {
  f->x[i] = pw_expression_open (r->values + 1 + r->states);
  if (f->x[i] == NULL || time_names (r, f, f->x[i]) != PW_OK) return PW_MACHINE;
  return pw_expression_set (f->x[i], r->text[i], trouble);
}

static time_function *time_empty (const time_recipe *r) {
  time_function *f = calloc (1, sizeof *f + (size_t)r->values * sizeof *f->value);
  if (f == NULL) return NULL;
  f->states = r->states;
  memcpy (f->value, r->value, (size_t)r->values * sizeof *f->value);
  return f;
}

static void *time_open (void *context) {
  const time_recipe *r = context;
  time_function *f = time_empty (r);
  pw_expression_trouble trouble;
  for (int i = 0; f && i < 3; i++)
    if (r->text[i] && time_evaluator (r, f, i, &trouble) != PW_OK) {
      time_close (f);
      return NULL;
    }
  return f;
}

static int time_eval (void *context, double t, const double *x, double value[3], double *gradient) {
  time_function *f = context;
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
  time_recipe *recipe;
  time_function *f; /* to try it out */
  const pw_node *node;
  const char *what;
  int forced;
  pw_error *error;
} time_reader;

/* Notes a state the expression reads. */
static int time_note (void *context, const char *name, size_t length, size_t at) {
  time_reader *r = context;
  time_recipe *f = r->recipe;
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
  if (f->states == TIME_STATES || length >= sizeof text)
    return pw_yaml_fail (r->b->y, pw_yaml_place (r->b->y, r->node, at), r->error, "%s: more than %d states", r->what,
                         TIME_STATES);
  f->reads[f->states] = pw_arena_text (&r->b->m->arena, text);
  if (f->reads[f->states] == NULL) return pw_yaml_no_memory (r->b->y, r->error);
  f->states++;
  return PW_OK;
}

static int time_expression (time_reader *r, int i) {
  const pw_yaml *y = r->b->y;
  pw_expression_trouble trouble;
  if (pw_yaml_text (y, r->node, r->what, &r->recipe->text[i], r->error) != PW_OK ||
      pw_expression_names (r->node->text, time_note, r) != PW_OK)
    return r->error->status;
  int status = time_evaluator (r->recipe, r->f, i, &trouble);
  if (status == PW_INPUT)
    return pw_yaml_fail (y, pw_yaml_place (y, r->node, trouble.at), r->error, "%s: %s", r->what, trouble.text);
  return status == PW_OK ? PW_OK : pw_yaml_no_memory (y, r->error);
}

/* ---- Derivatives by time ---- */

static double time_at (time_function *f, int i, double t) {
  f->t = t;
  return pw_expression_value (f->x[i]);
}

/* Central differences of text i, extrapolated (Richardson), and their round-off. */
static double time_difference (time_function *f, int i, double t, double h, double *round_off) {
  double up = time_at (f, i, t + h), down = time_at (f, i, t - h);
  double near = (up - down) / (2 * h), far = (time_at (f, i, t + 2 * h) - time_at (f, i, t - 2 * h)) / (4 * h);
  *round_off = 1000 * DBL_EPSILON * (fabs (up) + fabs (down)) / h;
  return (4 * near - far) / 3;
}

/* Compares a derivative with differences of what it should be the derivative of, at some times.  A wrong formula is off by
 * about its own size; a right one agrees for one of the step sizes however fast the signal is. */
static int time_check (time_reader *r, int i, const char *name) {
  static const double time[] = { 0.3, 1.7, 4.1 };
  for (int k = 0; k < 3; k++) {
    double t = time[k], given = time_at (r->f, i, t), found = NAN;
    int good = !isfinite (given);
    for (double h = 1.0 / (1 << 10); h > 1e-8 && !good; h /= 16) {
      double round_off;
      found = time_difference (r->f, i - 1, t, h, &round_off);
      good = !isfinite (found) || fabs (found - given) <= 1e-3 * (fabs (found) + fabs (given)) + round_off;
    }
    if (!good)
      return pw_yaml_fail (r->b->y, r->node->at, r->error, "%s: the %s at t = %g s is %.6g, but differences give %.6g",
                           r->what, name, t, given, found);
  }
  return PW_OK;
}

/* Reads value, rate and acceleration as far as the kind needs them. */
static int time_all (time_reader *r, const pw_kind *kind, const pw_node *const v[3]) {
  static const char *const key[] = { "expression", "rate", "acceleration" };
  int needed = r->forced ? 1 : kind->level == PW_HOLONOMIC ? 3 : 2;
  for (int i = 0; i < 3; i++) {
    if (v[i] == NULL && i < needed)
      return pw_yaml_fail (r->b->y, v[0]->at, r->error,
                           "%s: a constraint needs the derivatives by time: write {expression: .., rate: ..%s}",
                           r->what, needed > 2 ? ", acceleration: .." : "");
    if (v[i] == NULL) continue;
    r->node = v[i];
    if (time_expression (r, i) != PW_OK) return r->error->status;
    if (i > 0 && r->f->x[i - 1] && !r->recipe->states && time_check (r, i, key[i]) != PW_OK) return r->error->status;
  }
  return PW_OK;
}

int pw_yaml_of_time (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *const v[3],
                     pw_signal *signal, pw_error *error) {
  int parameters = b->y->parameters, values = parameters + b->lets;
  for (int i = 0; i < 3; i++) b->evaluators += v[i] ? PW_YAML_EVALUATOR + values : 0;
  if (b->evaluators > PW_YAML_WORDS)
    return pw_yaml_fail (
        b->y, v[0]->at, error,
        "%s: the signals by expressions up to here, each of which knows %d parameters and definitions, "
        "need more memory than a model may have",
        what, values);
  time_recipe *r = pw_arena_take (&b->m->arena, sizeof *r + (size_t)values * sizeof *r->value);
  if (r == NULL) return pw_yaml_no_memory (b->y, error);
  r->y = b->y;
  r->values = values;
  memcpy (r->value, b->parameter, (size_t)parameters * sizeof *r->value);
  memcpy (r->value + parameters, b->let, (size_t)b->lets * sizeof *r->value);
  time_reader reader = { b, r, time_empty (r), NULL, what, pw_kind_forced (kind), error };
  int status = reader.f ? time_all (&reader, kind, v) : pw_yaml_no_memory (b->y, error);
  time_close (reader.f);
  *signal = (pw_signal){ PW_FUNCTION, .function = { .eval = time_eval, .context = r } };
  signal->function.open = time_open;
  signal->function.close = time_close;
  if (r->states) signal->function.reads = r->reads;
  signal->function.differenced = r->states > 0;
  return status;
}
