/* What a text model knows about its motion: `truth`, a map of states to expressions of the time. */
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

/* Evaluators of all expressions, and what they see. */
typedef struct {
  int states;
  double t;
  pw_expression *x[];
} truth_evaluators;

static void truth_close (void *context) {
  truth_evaluators *e = context;
  for (int i = 0; i < e->states; i++) pw_expression_close (e->x[i]);
  free (e);
}

static double truth_eval (void *context, int i, double t) {
  truth_evaluators *e = context;
  e->t = t;
  return pw_expression_value (e->x[i]);
}

/* ---- Expressions ---- */

static int truth_expression (const pw_yaml_builder *b, const pw_node *node, const char *state, truth_evaluators *e,
                             pw_error *error) {
  const pw_truth_text *t = &b->m->truth;
  pw_expression_trouble trouble;
  const char *text;
  char what[100];
  snprintf (what, sizeof what, "truth of %.60s", state);
  if (pw_yaml_text (b->y, node, what, &text, error) != PW_OK) return error->status;
  pw_expression *x = e->x[e->states++] = pw_expression_open (t->names + 1);
  int failed = x == NULL;
  for (int i = 0; !failed && i < t->names; i++) failed = pw_expression_name (x, t->name[i], &t->value[i]) != PW_OK;
  if (failed || pw_expression_name (x, "t", &e->t) != PW_OK) return pw_yaml_no_memory (b->y, error);
  int status = pw_expression_set (x, text, &trouble);
  if (status == PW_INPUT)
    return pw_yaml_fail (b->y, pw_yaml_place (b->y, node, trouble.at), error, "%s: %s", what, trouble.text);
  return status == PW_OK ? PW_OK : pw_yaml_no_memory (b->y, error);
}

/* The names that expressions may use, and their values, in the model's arena. */
static int truth_names (pw_yaml_builder *b, pw_truth_text *t, pw_error *error) {
  size_t names = (size_t)b->y->parameters + (size_t)b->lets, states = (size_t)b->y->truth->count;
  t->state = pw_arena_take (&b->m->arena, (states + 1) * sizeof *t->state);
  t->text = pw_arena_take (&b->m->arena, (states + 1) * sizeof *t->text);
  t->name = pw_arena_take (&b->m->arena, (names + 1) * sizeof *t->name);
  t->value = pw_arena_take (&b->m->arena, (names + 1) * sizeof *t->value);
  if (t->state == NULL || t->text == NULL || t->name == NULL || t->value == NULL)
    return pw_yaml_no_memory (b->y, error);
  for (int i = 0; i < b->y->parameters; i++, t->names++) {
    t->name[t->names] = b->y->parameter[i].name;
    t->value[t->names] = b->parameter[i];
  }
  const pw_node *n = b->y->let ? b->y->let->first : NULL;
  for (int i = 0; i < b->lets; i++, n = n->next->next, t->names++) {
    t->name[t->names] = n->text;
    t->value[t->names] = b->let[i];
  }
  return PW_OK;
}

static int truth_entries (pw_yaml_builder *b, pw_truth_text *t, pw_names *seen, pw_error *error) {
  truth_evaluators *e = t->context;
  for (const pw_node *n = b->y->truth->first; n; n = n->next->next) {
    if (strchr (n->text, '.') == NULL)
      return pw_yaml_fail (b->y, n->at, error, "truth: expected a state such as BODY.phi, found \"%.60s\"", n->text);
    const pw_yaml_reading reading = { .node = n, .what = "truth" };
    if (pw_yaml_state (b, &reading, n->text, 0, error) != PW_OK) return error->status;
    if (pw_names_add (seen, n->text, 0) >= 0)
      return pw_yaml_fail (b->y, n->at, error, "truth: a second \"%s\"", n->text);
    if (truth_expression (b, n->next, n->text, e, error) != PW_OK) return error->status;
    t->state[t->states] = n->text;
    t->text[t->states++] = n->next->text;
  }
  return PW_OK;
}

int pw_yaml_truth (pw_yaml_builder *b, pw_error *error) {
  const pw_node *map = b->y->truth;
  pw_truth_text *t = &b->m->truth;
  pw_names seen = { .size = 0 };
  if (map == NULL) return PW_OK;
  if (map->type != PW_YAML_MAP)
    return pw_yaml_fail (b->y, map->at, error, "truth: expected a map {STATE: EXPRESSION, ...}, found %s",
                         pw_yaml_found (map));
  if (truth_names (b, t, error) != PW_OK) return error->status;
  truth_evaluators *e = calloc (1, sizeof *e + (size_t)map->count * sizeof *e->x);
  if (e == NULL) return pw_yaml_no_memory (b->y, error);
  t->context = e;
  t->eval = truth_eval;
  t->close = truth_close;
  int status = pw_names_open (&seen, (size_t)map->count) == PW_OK ? PW_OK : pw_yaml_no_memory (b->y, error);
  if (status == PW_OK) status = truth_entries (b, t, &seen, error);
  pw_names_close (&seen);
  return status;
}
