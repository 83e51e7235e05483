/* Bodies and elements: fills the definition structures through the field tables of their types, and passes them to
 * pw_add_body and pw_add, like a build function in C.  The core checks them; its messages get a position. */
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

/* Reads the name of a body or element, which must be unique. */
static int build_name (pw_reader *r, const pw_node *node, const char *label, const char **name) {
  if (pw_yaml_text (r, node, label, name) != PW_OK) return r->error->status;
  int before = pw_names_add (&r->names, *name, (int)node->at); /* a file has less than INT_MAX bytes */
  if (before < 0) return PW_OK;
  return pw_yaml_fail (r, node->at, "%s \"%.60s\": line %d already uses this name", label, *name,
                       pw_yaml_line (r->y, (size_t)before));
}

/* Reports an error of the core at a node, without its prefix "model NAME: ". */
static int build_fail (const pw_reader *r, const pw_node *node, const pw_error *cause) {
  char prefix[200];
  int n = snprintf (prefix, sizeof prefix, "model %s: ", pw_model_name (r->model));
  const char *text = cause->text;
  if (n > 0 && strncmp (text, prefix, (size_t)n) == 0) text += n;
  return cause->status == PW_RESOURCE ? pw_fail (r->error, cause->status, "%s", cause->text)
                                      : pw_yaml_fail (r, node->at, "%s", text);
}

/* ---- Bodies ---- */

/* Reads three initial coordinates or velocities; sets bit first_bit + i of *specified if value i is given. */
static void build_triple (const pw_reader *r, const pw_node *node, const char *label, const char *const key[4],
                          double value[3], unsigned *specified, int first_bit) {
  const pw_node *v[4];
  pw_yaml_keys (r, node, key, label, v);
  for (int i = 0; i < 3; i++) {
    if (v[i] == NULL) continue;
    pw_yaml_number (r, v[i], PW_PRINTED (200, "%s: %s", label, key[i]), PW_REAL, &value[i]);
    *specified |= 1u << (first_bit + i);
  }
}

static int build_body (pw_reader *r, const pw_node *node) {
  static const char *const key[] = { "name", "mass", "inertia", "start", "rate", NULL };
  static const char *const state[][4] = { { "x", "y", "phi", NULL }, { "vx", "vy", "omega", NULL } };
  const pw_node *v[sizeof key / sizeof *key];
  pw_body body = { .specified = PW_SPECIFIES_NOTHING };
  pw_error cause = { 0 };
  if (pw_yaml_keys (r, node, key, "a body", v) != PW_OK) return r->error->status;
  const pw_node *name = v[0];
  if (name == NULL) return pw_yaml_fail (r, node->at, "a body needs a name");
  if (build_name (r, name, "body", &body.name) != PW_OK) return r->error->status;
  for (int i = 0; i < 2; i++) {
    const char *label = PW_PRINTED (160, "body %.60s: %s", body.name, key[1 + i]);
    pw_yaml_number (r, v[1 + i], label, PW_NONNEGATIVE, i ? &body.inertia : &body.mass);
  }
  for (int i = 0; i < 2; i++) {
    const char *label = PW_PRINTED (160, "%s of body %.60s", key[3 + i], body.name);
    build_triple (r, v[3 + i], label, state[i], i ? body.rate : body.start, &body.specified, 3 * i);
  }
  if (r->error->status != PW_OK) return r->error->status;
  if (pw_model_check_body (r->model, &body, &cause) != PW_OK) return build_fail (r, name, &cause);
  pw_names_add (&r->bodies, body.name, 0);
  return pw_add_body (r->model, &body);
}

/* ---- Fields ---- */

static int build_body_name (const pw_reader *r, const pw_node *node, const char *label, const char **name) {
  if (pw_yaml_text (r, node, label, name) != PW_OK) return r->error->status;
  if (strcmp (*name, "ground") == 0 || pw_names_find (&r->bodies, *name) >= 0) return PW_OK;
  pw_nearest near = { .sought = *name };
  pw_yaml_suggest_bodies (r, &near);
  pw_nearest_try (&near, "ground");
  return pw_yaml_fail (r, node->at, "%s: there is no body \"%.60s\"%s", label, *name, pw_nearest_text (&near));
}

static int build_value (pw_reader *r, const pw_kind *kind, const pw_field *f, const pw_node *node, const char *label,
                        void *to) {
  switch (f->type) {
  case PW_NUMBER:
    return pw_yaml_number (r, node, label, f->domain, to);
  case PW_POINT:
  case PW_VECTOR:
    return pw_yaml_pair (r, node, label, "numbers, [x, y]", to);
  case PW_BODY:
    return build_body_name (r, node, label, to);
  case PW_SIGNAL:
    return pw_yaml_signal (r, kind, label, node, to);
  case PW_CHOICE:
    return pw_yaml_choice (r, node, label, f->choices, to);
  }
  return pw_yaml_fail (r, node->at, "%s cannot be given in a text model", label);
}

static int build_field (pw_reader *r, const pw_kind *kind, const pw_field *f, const pw_node *node, const char *element,
                        char *to) {
  static const char *const plural[] = { [PW_NUMBER] = "numbers",
                                        [PW_POINT] = "points, each [x, y],",
                                        [PW_VECTOR] = "vectors, each [x, y],",
                                        [PW_BODY] = "bodies",
                                        [PW_SIGNAL] = "signals",
                                        [PW_CHOICE] = "choices" };
  const char *label = PW_PRINTED (200, "%s %.60s: %s", kind->name, element, f->name);
  int count = pw_field_count (f);
  if (count == 1) return build_value (r, kind, f, node, label, to);
  if (pw_yaml_list_of (r, node, label, count, plural[f->type]) != PW_OK) return r->error->status;
  for (const pw_node *n = node->first; n; n = n->next, to += pw_field_bytes (f->type))
    build_value (r, kind, f, n, label, to);
  return r->error->status;
}

/* ---- Elements ---- */

/* Whether a word of a text begins with this prefix of at least 3 bytes. */
static int build_has_word (const char *text, const char *prefix) {
  for (const char *at = text; strlen (prefix) >= 3 && (at = strstr (at, prefix)) != NULL; at++)
    if (at == text || strchr (" (", at[-1])) return 1;
  return 0;
}

/* 1 if an element type has a field of this name. */
static int build_is_field (const char *name) {
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    for (const pw_field *f = (*k)->fields; f->name; f++)
      if (strcmp (f->name, name) == 0) return 1;
  return 0;
}

/* The element type that appears later in an element, as a key or as {kind: wheel, ...}; NULL if there is none. */
static const char *build_later_type (const pw_node *first) {
  for (const pw_node *n = first; n; n = n->next->next) {
    int named = n->type == PW_YAML_SCALAR && (strcmp (n->text, "kind") == 0 || strcmp (n->text, "type") == 0);
    const pw_node *kind = named ? n->next : n;
    for (const pw_kind *const *k = pw_kinds; *k && kind->type == PW_YAML_SCALAR; k++)
      if (strcmp ((*k)->name, kind->text) == 0) return (*k)->name;
  }
  return NULL;
}

static const pw_kind *build_kind (const pw_reader *r, const pw_node *node) {
  const pw_node *first = node->type == PW_YAML_MAP ? node->first : NULL;
  if (first == NULL || first->type != PW_YAML_SCALAR)
    return pw_yaml_fail (r, node->at, "expected an element {TYPE: NAME, ...}, found %s", pw_yaml_found (node)), NULL;
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if (strcmp ((*k)->name, first->text) == 0) return *k;
  pw_nearest near = { .sought = first->text };
  for (const pw_kind *const *k = pw_kinds; *k; k++) pw_nearest_try (&near, (*k)->name);
  const char *kind = build_later_type (first);
  if (kind) return pw_yaml_fail (r, first->at, "an element begins with its type: write {%s: NAME, ...}", kind), NULL;
  /* Words of descriptions suggest a type: "hinge" pin, "damper" spring; names of fields, as "angle", do not. */
  for (const pw_kind *const *k = pw_kinds; *k && !near.near && !build_is_field (first->text); k++)
    if (build_has_word ((*k)->about, first->text))
      snprintf (near.best, sizeof near.best, "%s", (*k)->name), near.near = 1;
  pw_yaml_fail (r, first->at, "an element begins with its type, and there is no type \"%.60s\"%s", first->text,
                near.near ? pw_nearest_text (&near) : ": see pinwheel list kinds");
  return NULL;
}

static int build_fields (pw_reader *r, const pw_kind *kind, const pw_node *node, const char *name) {
  const char *key[PW_YAML_MAX_KEYS + 1];
  const pw_node *v[PW_YAML_MAX_KEYS + 1];
  int n = 0;
  for (const pw_field *f = kind->fields; f->name && n < PW_YAML_MAX_KEYS; f++) key[n++] = f->name;
  key[n] = NULL;
  if (pw_yaml_keys_from (r, node->first->next->next, key, PW_PRINTED (100, "a %s", kind->name), v) != PW_OK)
    return r->error->status;
  for (int i = 0; i < n && r->error->status == PW_OK; i++) {
    const pw_field *f = r->field = &kind->fields[i];
    if (v[i])
      build_field (r, kind, f, v[i], name, r->definition + f->offset);
    else if (f->required || f->type == PW_BODY)
      pw_yaml_fail (r, node->first->at, "%s %.60s needs \"%s\": %s", kind->name, name, f->name,
                    f->about ? f->about : "");
  }
  return r->error->status;
}

static int build_element (pw_reader *r, const pw_node *node) {
  const char *name;
  pw_error cause = { 0 };
  const pw_kind *kind = build_kind (r, node);
  if (kind == NULL || build_name (r, node->first->next, kind->name, &name) != PW_OK) return r->error->status;
  memset (r->definition, 0, kind->definition);
  memcpy (r->definition, &name, sizeof name);
  if (build_fields (r, kind, node, name) != PW_OK) return r->error->status;
  pw_element e = { kind, r->definition };
  if (pw_model_check_element (r->model, &e, &cause) != PW_OK) return build_fail (r, node->first->next, &cause);
  return pw_add (r->model, kind, r->definition);
}

/* ---- The model ---- */

/* Defines the parameters, then the numbers of `let`, which may depend on parameters and preceding numbers. */
static int build_let (pw_reader *r, const double *parameter) {
  const pw_yaml *y = r->y;
  double value;
  for (int i = 0; i < y->parameter_count; i++) pw_scope_add (r->scope, y->table.parameters[i].name, parameter[i]);
  for (const pw_node *n = y->let ? y->let->first : NULL; n; n = n->next->next) {
    if (pw_yaml_number (r, n->next, PW_PRINTED (100, "let %s", n->text), PW_REAL, &value) != PW_OK)
      return r->error->status;
    pw_scope_add (r->scope, n->text, value);
  }
  return PW_OK;
}

static int build_all (pw_reader *r, const double *parameter) {
  const pw_yaml *y = r->y;
  if (build_let (r, parameter) != PW_OK) return r->error->status;
  for (const pw_node *n = y->bodies ? y->bodies->first : NULL; n; n = n->next)
    if (build_body (r, n) != PW_OK) return r->error->status;
  for (const pw_node *n = y->elements ? y->elements->first : NULL; n; n = n->next)
    if (build_element (r, n) != PW_OK) return r->error->status;
  return pw_yaml_reference (r);
}

static void build_free (void *arena) {
  pw_arena_free (arena);
  free (arena);
}

/* Allocates the memory for building, and the arena for what lives as long as the model. */
static int build_open (pw_reader *r) {
  const pw_yaml *y = r->y;
  size_t largest = 1, bodies = y->bodies ? (size_t)y->bodies->count : 0, lets = y->let ? (size_t)y->let->count : 0;
  size_t all = bodies + (y->elements ? (size_t)y->elements->count : 0);
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if ((*k)->definition > largest) largest = (*k)->definition;
  r->arena = calloc (1, sizeof *r->arena);
  if (r->arena == NULL || pw_model_keep (r->model, r->arena, build_free) != PW_OK) return pw_yaml_no_memory (r);
  r->reference = pw_arena_alloc (r->arena, sizeof *r->reference);
  pw_model_set_reference (r->model, r->reference);
  r->definition = malloc (largest);
  if (r->reference && r->definition && pw_scope_open (r->scope, y->parameter_count + (int)lets, r->arena) == PW_OK &&
      pw_names_open (&r->bodies, bodies) == PW_OK && pw_names_open (&r->names, all) == PW_OK)
    return PW_OK;
  return pw_yaml_no_memory (r);
}

void pw_yaml_build (pw_model *m, const void *parameters) {
  const void *table = pw_model_table (m);
  pw_scope scope = { 0 };
  pw_reader r = { .y = table, .model = m, .scope = &scope, .error = pw_model_error (m) };
  pw_yaml_list (&r, r.y->bodies, "bodies");
  if (pw_yaml_list (&r, r.y->elements, "elements") == PW_OK && build_open (&r) == PW_OK) build_all (&r, parameters);
  pw_scope_close (&scope);
  pw_names_close (&r.bodies);
  pw_names_close (&r.names);
  pw_names_close (&r.elements);
  free (r.definition);
}
