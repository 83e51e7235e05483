/* Reads keys, lists, texts and numbers from the tree. */
#include <string.h>
#include "yaml.h"

const char *pw_yaml_found (const pw_node *node) {
  return node->type == PW_YAML_LIST ? "a list" : node->type == PW_YAML_MAP ? "a map" : "text";
}

/* ---- Maps ---- */

/* A hint for a key that is not a plain name, or "". */
static const char *read_key_hint (const char *text, const char *const *key) {
  for (int i = 0; key[i]; i++) {
    size_t n = strlen (key[i]);
    if (strncmp (text, key[i], n) == 0 && text[n] == ':') return "; a space goes after the colon";
    if (strncmp (text, key[i], n) == 0 && text[n] == ' ') return "; a colon goes after the key";
  }
  if (*text && strspn (text, "0123456789") == strlen (text)) return "; decimals are written with a point";
  if (strpbrk (text, "()*/^")) return "; an expression with commas goes between double quotes";
  return "";
}

static int read_key (const pw_reader *r, const pw_node *node, const char *const *key, const char *owner,
                     const pw_node **value) {
  if (node->type != PW_YAML_SCALAR)
    return pw_yaml_fail (r, node->at, "expected a key of %s, found %s", owner, pw_yaml_found (node));
  for (int i = 0; key[i]; i++) {
    if (strcmp (key[i], node->text) != 0) continue;
    if (value[i]) return pw_yaml_fail (r, node->at, "\"%s\" appears twice", key[i]);
    value[i] = node->next;
    int empty = node->next->type == PW_YAML_SCALAR && !node->next->quoted && *node->next->text == 0;
    return empty ? pw_yaml_fail (r, node->at, "\"%s\" has no value", key[i]) : PW_OK;
  }
  pw_nearest near = { .sought = node->text };
  for (int i = 0; key[i]; i++) pw_nearest_try (&near, key[i]);
  const char *hint = read_key_hint (node->text, key);
  return pw_yaml_fail (r, node->at, "%s has no \"%.60s\"%s", owner, node->text, *hint ? hint : pw_nearest_text (&near));
}

int pw_yaml_keys_from (const pw_reader *r, const pw_node *first, const char *const *key, const char *owner,
                       const pw_node **value) {
  for (int i = 0; key[i]; i++) value[i] = NULL;
  for (const pw_node *n = first; n && r->error->status == PW_OK; n = n->next->next) read_key (r, n, key, owner, value);
  return r->error->status;
}

int pw_yaml_keys (const pw_reader *r, const pw_node *map, const char *const *key, const char *owner,
                  const pw_node **value) {
  if (map && map->type != PW_YAML_MAP) {
    char form[100] = "{";
    for (size_t i = 0, n = 1; key[i]; i++, n = strlen (form))
      snprintf (form + n, sizeof form - n, "%s: ..%s", key[i], key[i + 1] ? ", " : "}");
    pw_yaml_fail (r, map->at, "expected a map %s for %s, found %s", form, owner, pw_yaml_found (map));
    map = NULL;
  }
  return pw_yaml_keys_from (r, map ? map->first : NULL, key, owner, value);
}

int pw_yaml_list (const pw_reader *r, const pw_node *node, const char *label) {
  if (node && node->type != PW_YAML_LIST)
    pw_yaml_fail (r, node->at, "%s: expected a list, found %s", label, pw_yaml_found (node));
  return r->error->status;
}

int pw_yaml_list_of (const pw_reader *r, const pw_node *node, const char *label, int count, const char *items) {
  if (node && node->type != PW_YAML_LIST)
    pw_yaml_fail (r, node->at, "%s: expected a list of %d %s, found %s", label, count, items, pw_yaml_found (node));
  else if (node && node->count != count)
    pw_yaml_fail (r, node->at, "%s: expected a list of %d %s, found one of %d", label, count, items, node->count);
  return r->error->status;
}

/* ---- Scalars ---- */

int pw_yaml_text (const pw_reader *r, const pw_node *node, const char *label, const char **text) {
  if (node == NULL) return r->error->status;
  if (node->type != PW_YAML_SCALAR || *node->text == 0)
    return pw_yaml_fail (r, node->at, "%s: expected text, found %s", label,
                         node->type == PW_YAML_SCALAR ? "none" : pw_yaml_found (node));
  *text = node->text;
  return r->error->status;
}

size_t pw_yaml_offset (const pw_yaml *y, const pw_node *node, size_t offset) {
  size_t at = node->at + (node->quoted != 0), n = strlen (node->text);
  return at + n <= y->size && strncmp (y->source + at, node->text, n) == 0 ? at + offset : node->at;
}

const char *pw_yaml_find_variable (const char *text) {
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    if (strcmp (name, "t") == 0 || strchr (name, '.')) return p;
  return NULL;
}

int pw_yaml_number (const pw_reader *r, const pw_node *node, const char *label, pw_domain domain, double *value) {
  pw_expression_error error;
  if (node == NULL || r->error->status != PW_OK) return r->error->status;
  if (node->type != PW_YAML_SCALAR)
    return pw_yaml_fail (r, node->at, "%s: expected a number, found %s", label, pw_yaml_found (node));
  int status =
      pw_expression_number (node->text, value) ? PW_OK : pw_expression_constant (r->scope, node->text, value, &error);
  if (status == PW_RESOURCE) return pw_yaml_no_memory (r);
  if (status != PW_OK)
    return pw_yaml_fail (r, pw_yaml_offset (r->y, node, error.at), "%s: %s", label,
                         pw_yaml_find_variable (node->text) == node->text + error.at
                             ? "only the value of a signal may depend on the time t or on states"
                             : error.text);
  const char *expected = pw_domain_check (domain, *value);
  return *expected ? pw_yaml_fail (r, node->at, "%s = %g: expected %s", label, *value, expected) : PW_OK;
}

/* ---- Pairs, choices, bodies ---- */

int pw_yaml_pair (const pw_reader *r, const pw_node *node, const char *label, const char *items, double *value) {
  if (node == NULL || pw_yaml_list_of (r, node, label, 2, items) != PW_OK) return r->error->status;
  pw_yaml_number (r, node->first, label, PW_REAL, value);
  return pw_yaml_number (r, node->first->next, label, PW_REAL, value + 1);
}

int pw_yaml_choice (const pw_reader *r, const pw_node *node, const char *label, const char *const *choices,
                    int *value) {
  char hint[PW_HINT];
  const char *text = "";
  if (node == NULL || pw_yaml_text (r, node, label, &text) != PW_OK) return r->error->status;
  int i = pw_find_name (choices, sizeof *choices, text, hint);
  if (i < 0) return pw_yaml_fail (r, node->at, "%s: there is no choice \"%.60s\"%s", label, text, hint);
  *value = i;
  return PW_OK;
}

void pw_yaml_suggest_bodies (const pw_reader *r, pw_nearest *near) {
  int bodies;
  const pw_body *body = pw_model_bodies (r->model, &bodies);
  for (int i = 0; i < bodies; i++) pw_nearest_try (near, body[i].name);
}
