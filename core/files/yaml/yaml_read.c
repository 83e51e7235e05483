/* Reads keys, lists, texts and numbers from the tree. */
#include <string.h>
#include "yaml.h"

const char *pw_yaml_found (const pw_node *node) {
  return node->type == PW_YAML_LIST ? "a list" : node->type == PW_YAML_MAP ? "a map" : "text";
}

static int read_empty (const pw_node *n) {
  return n->type == PW_YAML_SCALAR && !n->quoted && *n->text == 0;
}

/* ---- Maps ---- */

/* A hint for a key that is not a plain name, or "". */
static const char *read_slip (const char *text, const char *const *key) {
  for (int i = 0; key[i]; i++) {
    size_t n = strlen (key[i]);
    if (strncmp (text, key[i], n) == 0 && text[n] == ':') return "; a space goes after the colon";
    if (strncmp (text, key[i], n) == 0 && text[n] == ' ') return "; a colon goes after the key";
  }
  if (strspn (text, "0123456789") == strlen (text)) return "; decimals are written with a point";
  if (strpbrk (text, "()*/^")) return "; an expression with commas goes between double quotes";
  return "";
}

static int read_key (const pw_yaml *y, const pw_node *node, const char *const *key, const char *what,
                     const pw_node **value, pw_error *error) {
  char hint[100];
  if (node->type != PW_YAML_SCALAR)
    return pw_yaml_fail (y, node->at, error, "expected a key of %s, found %s", what, pw_yaml_found (node));
  pw_nearest near = { .sought = node->text };
  for (int i = 0; key[i]; i++) {
    pw_nearest_try (&near, key[i]);
    if (strcmp (key[i], node->text) != 0) continue;
    if (value[i]) return pw_yaml_fail (y, node->at, error, "\"%s\" is there twice", key[i]);
    if (read_empty (node->next)) return pw_yaml_fail (y, node->at, error, "\"%s\" has no value", key[i]);
    value[i] = node->next;
    return PW_OK;
  }
  const char *slip = read_slip (node->text, key);
  return pw_yaml_fail (y, node->at, error, "%s has no \"%.60s\"%s", what, node->text,
                       *slip ? slip : pw_nearest_text (&near, hint, sizeof hint));
}

/* "{x: .., y: ..}" */
static void read_form (const char *const *key, char *text, size_t size) {
  size_t used = 0;
  for (int i = 0; key[i] && used < size; i++)
    used += (size_t)snprintf (text + used, size - used, "%s%s: ..", i ? ", " : "{", key[i]);
  if (used < size) snprintf (text + used, size - used, "}");
}

int pw_yaml_keys (const pw_yaml *y, const pw_node *map, int skip, const char *const *key, const char *what,
                  const pw_node **value, pw_error *error) {
  if (map->type != PW_YAML_MAP) {
    char form[100];
    read_form (key, form, sizeof form);
    return pw_yaml_fail (y, map->at, error, "expected a map %s for %s, found %s", form, what, pw_yaml_found (map));
  }
  for (int i = 0; key[i]; i++) value[i] = NULL;
  const pw_node *n = map->first;
  while (n && skip-- > 0) n = n->next->next;
  for (; n; n = n->next->next)
    if (read_key (y, n, key, what, value, error) != PW_OK) return error->status;
  return PW_OK;
}

int pw_yaml_list (const pw_yaml *y, const pw_node *node, const char *what, int count, const char *items,
                  pw_error *error) {
  if (node->type != PW_YAML_LIST && count >= 0)
    return pw_yaml_fail (y, node->at, error, "%s: expected a list of %d %s, found %s", what, count, items,
                         pw_yaml_found (node));
  if (node->type != PW_YAML_LIST)
    return pw_yaml_fail (y, node->at, error, "%s: expected a list, found %s", what, pw_yaml_found (node));
  if (count >= 0 && node->count != count)
    return pw_yaml_fail (y, node->at, error, "%s: expected a list of %d %s, found one of %d", what, count, items,
                         node->count);
  return PW_OK;
}

/* ---- Scalars ---- */

int pw_yaml_text (const pw_yaml *y, const pw_node *node, const char *what, const char **text, pw_error *error) {
  if (node->type != PW_YAML_SCALAR)
    return pw_yaml_fail (y, node->at, error, "%s: expected text, found %s", what, pw_yaml_found (node));
  if (*node->text == 0) return pw_yaml_fail (y, node->at, error, "%s: expected text, found none", what);
  *text = node->text;
  return PW_OK;
}

size_t pw_yaml_place (const pw_yaml *y, const pw_node *node, size_t offset) {
  size_t at = node->at + (node->quoted != 0), n = strlen (node->text);
  return at + n <= y->size && strncmp (y->source + at, node->text, n) == 0 ? at + offset : node->at;
}

static int read_moves (void *context, const char *name, size_t length, size_t at) {
  if ((length != 1 || *name != 't') && memchr (name, '.', length) == NULL) return 0;
  if (context) *(size_t *)context = at;
  return 1;
}

int pw_yaml_moves (const char *text, size_t *at) {
  return pw_expression_names (text, read_moves, at);
}

/* Reports why an expression is not a number. */
static int read_trouble (const pw_yaml *y, const pw_node *node, const char *what, const pw_expression_trouble *trouble,
                         pw_error *error) {
  size_t at;
  if (pw_yaml_moves (node->text, &at) && at == trouble->at)
    return pw_yaml_fail (y, pw_yaml_place (y, node, at), error,
                         "%s: only the value of a signal may depend on the time t or on states", what);
  return pw_yaml_fail (y, pw_yaml_place (y, node, trouble->at), error, "%s: %s", what, trouble->text);
}

int pw_yaml_number (const pw_yaml *y, const pw_node *node, const char *what, pw_domain domain, const pw_scope *x,
                    double *value, pw_error *error) {
  pw_expression_trouble trouble;
  if (node->type != PW_YAML_SCALAR)
    return pw_yaml_fail (y, node->at, error, "%s: expected a number, found %s", what, pw_yaml_found (node));
  int status =
      pw_expression_number (node->text, value) ? PW_OK : pw_expression_constant (x, node->text, value, &trouble);
  if (status == PW_RESOURCE) return pw_yaml_no_memory (y, error);
  if (status != PW_OK) return read_trouble (y, node, what, &trouble, error);
  const char *expected = pw_domain_check (domain, *value);
  if (*expected) return pw_yaml_fail (y, node->at, error, "%s = %g: expected %s", what, *value, expected);
  return PW_OK;
}

/* ---- Pairs, choices, bodies ---- */

int pw_yaml_pair (pw_yaml_builder *b, const pw_node *node, const char *what, double *value, pw_error *error) {
  if (pw_yaml_list (b->y, node, what, 2, "numbers, [x, y]", error) != PW_OK ||
      pw_yaml_number (b->y, node->first, what, PW_REAL, b->x, value, error) != PW_OK)
    return error->status;
  return pw_yaml_number (b->y, node->first->next, what, PW_REAL, b->x, value + 1, error);
}

int pw_yaml_choice (pw_yaml_builder *b, const pw_node *node, const char *what, const char *const *choices, int *value,
                    pw_error *error) {
  char hint[100];
  const char *text;
  if (pw_yaml_text (b->y, node, what, &text, error) != PW_OK) return error->status;
  pw_nearest near = { .sought = text };
  for (int i = 0; choices[i]; i++) {
    pw_nearest_try (&near, choices[i]);
    if (strcmp (choices[i], text) != 0) continue;
    *value = i;
    return PW_OK;
  }
  return pw_yaml_fail (b->y, node->at, error, "%s: there is no choice \"%.60s\"%s", what, text,
                       pw_nearest_text (&near, hint, sizeof hint));
}

void pw_yaml_try_bodies (const pw_yaml_builder *b, pw_nearest *near) {
  int bodies;
  const pw_body *body = pw_model_bodies (b->m, &bodies);
  for (int i = 0; i < bodies; i++) pw_nearest_try (near, body[i].name);
}
