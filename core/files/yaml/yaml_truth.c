/* What a text model knows about its motion: `truth`, a map of states to expressions of the time. */
#include <string.h>
#include "yaml.h"

static double truth_eval (void *context, int i, double t) {
  const pw_expression *const *x = context;
  return pw_expression_value (x[i], &t);
}

/* ---- Expressions ---- */

static int truth_expression (const pw_yaml_builder *b, const pw_node *node, const char *state, const pw_expression **x,
                             pw_error *error) {
  static const char *const time[] = { "t", NULL };
  pw_expression_trouble trouble;
  const char *text;
  char what[100];
  snprintf (what, sizeof what, "truth of %.60s", state);
  if (pw_yaml_text (b->y, node, what, &text, error) != PW_OK) return error->status;
  int status = pw_expression_read (b->x, time, text, b->arena, x, &trouble);
  if (status == PW_INPUT)
    return pw_yaml_fail (b->y, pw_yaml_place (b->y, node, trouble.at), error, "%s: %s", what, trouble.text);
  return status == PW_OK ? PW_OK : pw_yaml_no_memory (b->y, error);
}

int pw_yaml_keep_names (pw_yaml_builder *b, pw_error *error) {
  pw_truth_text *t = b->truth;
  size_t names = (size_t)b->y->parameters + (size_t)b->lets;
  if (t->name) return PW_OK;
  t->name = pw_arena_take (b->arena, (names + 1) * sizeof *t->name);
  t->value = pw_arena_take (b->arena, (names + 1) * sizeof *t->value);
  if (t->name == NULL || t->value == NULL) return pw_yaml_no_memory (b->y, error);
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
  const pw_expression **x = t->context;
  for (const pw_node *n = b->y->truth->first; n; n = n->next->next) {
    if (strchr (n->text, '.') == NULL)
      return pw_yaml_fail (b->y, n->at, error, "truth: expected a state such as BODY.phi, found \"%.60s\"", n->text);
    const pw_yaml_reading reading = { .node = n, .what = "truth" };
    if (pw_yaml_state (b, &reading, n->text, 0, error) != PW_OK) return error->status;
    if (pw_names_add (seen, n->text, 0) >= 0)
      return pw_yaml_fail (b->y, n->at, error, "truth: a second \"%s\"", n->text);
    if (truth_expression (b, n->next, n->text, &x[t->states], error) != PW_OK) return error->status;
    t->state[t->states] = n->text;
    t->text[t->states++] = n->next->text;
  }
  return PW_OK;
}

int pw_yaml_truth (pw_yaml_builder *b, pw_error *error) {
  const pw_node *map = b->y->truth;
  pw_truth_text *t = b->truth;
  pw_names seen = { .size = 0 };
  if (map == NULL) return PW_OK;
  if (map->type != PW_YAML_MAP)
    return pw_yaml_fail (b->y, map->at, error, "truth: expected a map {STATE: EXPRESSION, ...}, found %s",
                         pw_yaml_found (map));
  if (pw_yaml_keep_names (b, error) != PW_OK) return error->status;
  t->state = pw_arena_take (b->arena, ((size_t)map->count + 1) * sizeof *t->state);
  t->text = pw_arena_take (b->arena, ((size_t)map->count + 1) * sizeof *t->text);
  t->context = pw_arena_take (b->arena, ((size_t)map->count + 1) * sizeof (pw_expression *));
  if (t->state == NULL || t->text == NULL || t->context == NULL) return pw_yaml_no_memory (b->y, error);
  t->eval = truth_eval;
  int status = pw_names_open (&seen, (size_t)map->count) == PW_OK ? PW_OK : pw_yaml_no_memory (b->y, error);
  if (status == PW_OK) status = truth_entries (b, t, &seen, error);
  pw_names_close (&seen);
  return status;
}
