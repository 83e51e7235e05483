/* Bodies and elements: fills the definition structures through the field tables of their kinds, and passes them to
 * pw_add_body and pw_add, like a build function in C.  The core checks numbers, names and elements; this file adds a
 * position to its messages. */
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

/* ---- Names ---- */

/* Bodies and elements share one set of names. */
static int build_name (pw_yaml_builder *b, const pw_node *node, const char *what, const char **name, pw_error *error) {
  if (pw_yaml_text (b->y, node, what, name, error) != PW_OK) return error->status;
  int before = pw_names_add (&b->all, *name, b->named);
  if (before >= 0)
    return pw_yaml_fail (b->y, node->at, error, "%s \"%.60s\": line %d has given this name already", what, *name,
                         pw_yaml_line (b->y, b->node[before]->at));
  b->node[b->named++] = node;
  return PW_OK;
}

/* The core's message without its prefix "model NAME: ", at a position. */
static int build_refuse (const pw_yaml_builder *b, const pw_node *node, const pw_error *own, pw_error *error) {
  char prefix[200];
  int n = snprintf (prefix, sizeof prefix, "model %s: ", pw_model_name (b->m));
  const char *text = own->text;
  if (n > 0 && strncmp (text, prefix, (size_t)n) == 0) text += n;
  return own->status == PW_RESOURCE ? pw_fail (error, own->status, "%s", own->text)
                                    : pw_yaml_fail (b->y, node->at, error, "%s", text);
}

/* ---- Bodies ---- */

static int build_triple (pw_yaml_builder *b, const pw_node *node, const char *what, const char *const key[4],
                         double value[3], unsigned *specified, int first, pw_error *error) {
  const pw_node *v[4];
  char name[200];
  if (node == NULL) return PW_OK;
  if (pw_yaml_keys (b->y, node, 0, key, what, v, error) != PW_OK) return error->status;
  for (int i = 0; i < 3; i++) {
    snprintf (name, sizeof name, "%s: %s", what, key[i]);
    if (v[i] && pw_yaml_number (b->y, v[i], name, PW_REAL, b->x, &value[i], error) != PW_OK) return error->status;
    if (v[i]) *specified |= 1u << (first + i);
  }
  return PW_OK;
}

static int build_body (pw_yaml_builder *b, const pw_node *node, pw_error *error) {
  static const char *const key[] = { "name", "mass", "inertia", "start", "rate", NULL };
  static const char *const start[] = { "x", "y", "phi", NULL }, *const rate[] = { "vx", "vy", "omega", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  pw_body body = { .specified = PW_SPECIFIES_NOTHING };
  char what[3][160];
  if (pw_yaml_keys (b->y, node, 0, key, "a body", v, error) != PW_OK) return error->status;
  if (v[0] == NULL) return pw_yaml_fail (b->y, node->at, error, "a body needs a name");
  if (build_name (b, v[0], "body", &body.name, error) != PW_OK) return error->status;
  for (int i = 0; i < 2; i++) {
    snprintf (what[i], sizeof what[i], "body %.60s: %s", body.name, key[1 + i]);
    if (v[1 + i] &&
        pw_yaml_number (b->y, v[1 + i], what[i], PW_NONNEGATIVE, b->x, i ? &body.inertia : &body.mass, error) != PW_OK)
      return error->status;
  }
  snprintf (what[0], sizeof what[0], "start of body %.60s", body.name);
  snprintf (what[1], sizeof what[1], "rate of body %.60s", body.name);
  if (build_triple (b, v[3], what[0], start, body.start, &body.specified, 0, error) != PW_OK ||
      build_triple (b, v[4], what[1], rate, body.rate, &body.specified, 3, error) != PW_OK)
    return error->status;
  pw_error own = { 0 };
  if (pw_model_check_body (b->m, &body, &own) != PW_OK) return build_refuse (b, v[0], &own, error);
  pw_names_add (&b->bodies, body.name, 0);
  return pw_add_body (b->m, &body);
}

/* ---- Fields ---- */

static int build_body_name (pw_yaml_builder *b, const pw_node *node, const char *what, const char **name,
                            pw_error *error) {
  char hint[100];
  if (pw_yaml_text (b->y, node, what, name, error) != PW_OK) return error->status;
  if (strcmp (*name, "ground") == 0 || pw_names_find (&b->bodies, *name) >= 0) return PW_OK;
  pw_nearest near = { .sought = *name };
  pw_yaml_try_bodies (b, &near);
  pw_nearest_try (&near, "ground");
  return pw_yaml_fail (b->y, node->at, error, "%s: there is no body \"%.60s\"%s", what, *name,
                       pw_nearest_text (&near, hint, sizeof hint));
}

static int build_value (pw_yaml_builder *b, const pw_kind *kind, const pw_field *f, const pw_node *node,
                        const char *what, void *at, pw_error *error) {
  switch (f->type) {
  case PW_NUMBER:
    return pw_yaml_number (b->y, node, what, f->domain, b->x, at, error);
  case PW_POINT:
  case PW_VECTOR:
    return pw_yaml_pair (b, node, what, at, error);
  case PW_BODY:
    return build_body_name (b, node, what, at, error);
  case PW_SIGNAL:
    return pw_yaml_signal (b, kind, what, node, at, error);
  case PW_CHOICE:
    return pw_yaml_choice (b, node, what, f->choices, at, error);
  }
  return pw_yaml_fail (b->y, node->at, error, "%s cannot be given in a text model", what);
}

static int build_field (pw_yaml_builder *b, const pw_kind *kind, const pw_field *f, const pw_node *node,
                        const char *element, char *at, pw_error *error) {
  static const char *const plural[] = { "numbers", "points, each [x, y],", "vectors, each [x, y],", "bodies", "signals",
                                        "choices" };
  char what[200];
  int count = pw_field_count (f);
  snprintf (what, sizeof what, "%s %.60s: %s", kind->name, element, f->name);
  if (count == 1) return build_value (b, kind, f, node, what, at, error);
  if (pw_yaml_list (b->y, node, what, count, plural[f->type], error) != PW_OK) return error->status;
  for (const pw_node *n = node->first; n; n = n->next, at += pw_field_bytes (f->type))
    if (build_value (b, kind, f, n, what, at, error) != PW_OK) return error->status;
  return PW_OK;
}

/* ---- Elements ---- */

/* Whether a text contains a word. */
static int build_says (const char *text, const char *word) {
  const char *at = strlen (word) < 3 ? NULL : strstr (text, word);
  return at != NULL && (at == text || strchr (" (", at[-1]));
}

/* The element type that appears later in an element, as a key or as {kind: wheel, ...}; NULL if there is none. */
static const char *build_later_kind (const pw_node *first) {
  for (const pw_node *n = first; n; n = n->next->next) {
    int named = n->type == PW_YAML_SCALAR && (strcmp (n->text, "kind") == 0 || strcmp (n->text, "type") == 0);
    const pw_node *said = named ? n->next : n;
    for (const pw_kind *const *k = pw_kinds; *k && said->type == PW_YAML_SCALAR; k++)
      if (strcmp ((*k)->name, said->text) == 0) return (*k)->name;
  }
  return NULL;
}

static const pw_kind *build_kind (const pw_yaml_builder *b, const pw_node *node, pw_error *error) {
  char hint[100];
  const pw_node *first = node->type == PW_YAML_MAP ? node->first : NULL;
  if (first == NULL || first->type != PW_YAML_SCALAR) {
    pw_yaml_fail (b->y, node->at, error, "expected an element {KIND: NAME, ...}, found %s", pw_yaml_found (node));
    return NULL;
  }
  pw_nearest near = { .sought = first->text };
  for (const pw_kind *const *k = pw_kinds; *k; k++) {
    if (strcmp ((*k)->name, first->text) == 0) return *k;
    pw_nearest_try (&near, (*k)->name);
  }
  const char *kind = build_later_kind (first);
  if (kind) {
    pw_yaml_fail (b->y, first->at, error, "an element begins with its kind: write {%s: NAME, ...}", kind);
    return NULL;
  }
  for (const pw_kind *const *k = pw_kinds; *k && !near.near; k++) /* "revolute", "hinge" */
    if (build_says ((*k)->about, first->text)) near.best = (*k)->name, near.near = 1;
  pw_yaml_fail (b->y, first->at, error, "an element begins with its kind, and there is no kind \"%.60s\"%s",
                first->text, near.near ? pw_nearest_text (&near, hint, sizeof hint) : ": see pinwheel list kinds");
  return NULL;
}

static int build_fields (pw_yaml_builder *b, const pw_kind *kind, const pw_node *node, const char *name,
                         char *definition, pw_error *error) {
  const char *key[PW_YAML_KEYS + 1];
  const pw_node *v[PW_YAML_KEYS + 1];
  char what[100], text[160];
  int n = 0;
  for (const pw_field *f = kind->fields; f->name && n < PW_YAML_KEYS; f++) key[n++] = f->name;
  key[n] = NULL;
  snprintf (what, sizeof what, "a %s", kind->name);
  if (pw_yaml_keys (b->y, node, 1, key, what, v, error) != PW_OK) return error->status;
  for (int i = 0; i < n; i++) {
    const pw_field *f = &kind->fields[i];
    snprintf (text, sizeof text, "%s %.60s", kind->name, name);
    if (v[i] == NULL && (f->required || f->type == PW_BODY))
      return pw_yaml_fail (b->y, node->first->at, error, "%s needs \"%s\": %s", text, f->name,
                           f->about ? f->about : "");
    b->field = f, b->definition = definition;
    if (v[i] && build_field (b, kind, f, v[i], name, definition + f->offset, error) != PW_OK) return error->status;
  }
  return PW_OK;
}

static int build_element (pw_yaml_builder *b, const pw_node *node, char *definition, pw_error *error) {
  const char *name;
  pw_error own = { 0 };
  const pw_kind *kind = build_kind (b, node, error);
  if (kind == NULL || build_name (b, node->first->next, kind->name, &name, error) != PW_OK) return error->status;
  memset (definition, 0, kind->definition);
  memcpy (definition, &name, sizeof name);
  if (build_fields (b, kind, node, name, definition, error) != PW_OK) return error->status;
  pw_element e = { kind, definition };
  if (pw_model_check_element (b->m, &e, &own) != PW_OK) return build_refuse (b, node->first->next, &own, error);
  return pw_add (b->m, kind, definition);
}

/* ---- The model ---- */

static int build_all (pw_yaml_builder *b, char *definition, pw_error *error) {
  const pw_yaml *y = b->y;
  for (const pw_node *n = y->bodies ? y->bodies->first : NULL; n; n = n->next)
    if (build_body (b, n, error) != PW_OK) return error->status;
  for (const pw_node *n = y->elements ? y->elements->first : NULL; n; n = n->next)
    if (build_element (b, n, definition, error) != PW_OK) return error->status;
  return pw_yaml_reference (b, error);
}

/* Reads `let`: numbers defined from parameters and preceding definitions. */
static int build_let (pw_yaml_builder *b, pw_error *error) {
  char what[100];
  for (const pw_node *n = b->y->let ? b->y->let->first : NULL; n; n = n->next->next) {
    snprintf (what, sizeof what, "let %s", n->text);
    if (pw_yaml_number (b->y, n->next, what, PW_REAL, b->x, &b->let[b->lets], error) != PW_OK) return error->status;
    pw_scope_add (b->x, n->text, b->let[b->lets++]);
  }
  return PW_OK;
}

static int build_names (pw_yaml_builder *b, const double *value, pw_error *error) {
  const pw_yaml *y = b->y;
  b->x = pw_scope_open (y->parameters + (y->let ? y->let->count : 0));
  if (b->x == NULL) return pw_yaml_no_memory (y, error);
  for (int i = 0; i < y->parameters; i++) pw_scope_add (b->x, y->parameter[i].name, value[i]);
  return build_let (b, error);
}

static void build_free (void *arena) {
  pw_arena_free (arena);
  free (arena);
}

/* Data that live as long as the model: expressions, points of tables, the reference solution. */
static int build_keep (pw_yaml_builder *b, pw_error *error) {
  b->arena = calloc (1, sizeof *b->arena);
  if (b->arena == NULL || pw_model_keep (b->m, b->arena, build_free) != PW_OK) return pw_yaml_no_memory (b->y, error);
  b->reference = pw_arena_take (b->arena, sizeof *b->reference);
  pw_model_set_reference (b->m, b->reference);
  return b->reference ? PW_OK : pw_yaml_no_memory (b->y, error);
}

static int build_open (pw_yaml_builder *b, char **definition, pw_error *error) {
  const pw_yaml *y = b->y;
  if ((y->bodies && pw_yaml_list (y, y->bodies, "bodies", -1, "", error) != PW_OK) ||
      (y->elements && pw_yaml_list (y, y->elements, "elements", -1, "", error) != PW_OK))
    return error->status;
  size_t largest = 1, bodies = y->bodies ? (size_t)y->bodies->count : 0;
  size_t all = bodies + (y->elements ? (size_t)y->elements->count : 0);
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if ((*k)->definition > largest) largest = (*k)->definition;
  *definition = malloc (largest);
  b->node = malloc ((all + 1) * sizeof *b->node);
  b->let = malloc (((y->let ? (size_t)y->let->count : 0) + 1) * sizeof *b->let);
  if (*definition == NULL || b->node == NULL || b->let == NULL || pw_names_open (&b->bodies, bodies) != PW_OK ||
      pw_names_open (&b->all, all) != PW_OK)
    return pw_yaml_no_memory (y, error);
  return PW_OK;
}

void pw_yaml_build (pw_model *m, const void *parameters) {
  const void *table = pw_model_table (m);
  pw_yaml_builder b = { .y = table, .m = m, .parameter = parameters };
  pw_error *error = pw_model_error (m);
  char *definition = NULL;
  if (build_keep (&b, error) == PW_OK && build_open (&b, &definition, error) == PW_OK &&
      build_names (&b, parameters, error) == PW_OK)
    build_all (&b, definition, error);
  pw_scope_close (b.x);
  pw_names_close (&b.bodies);
  pw_names_close (&b.all);
  pw_names_close (&b.elements);
  free (b.node);
  free (b.let);
  free (definition);
}
