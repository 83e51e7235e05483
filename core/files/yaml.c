/* Reads text models from the tree of a file: bodies and elements, through the field tables of their types; first-order
 * states; the head, parameters and default run settings, which is stored in a plug-in's table, so that text models can
 * be used like compiled ones. */
#include <math.h>
#include <stdlib.h>
#include "yaml_read.h"

#define MAX_AHEAD 1e6 /* pw_yaml.max_ahead for the default limit of bytes: each indicator takes 350 bytes */

/* ---- Reference solution: `truth`, a map of states to expressions of time ---- */

static double reference_eval (void *context, int i, double t) {
  const pw_expression *const *x = context;
  return pw_expression_value (x[i], &t);
}

static int reference_entry (pw_reader *r, const pw_node *n, pw_names *seen) {
  static const char *const time[] = { "t", NULL };
  pw_reference_text *t = r->reference;
  const pw_expression **x = t->context;
  const char *name;
  if (pw_yaml_text (r, n, "truth", &name) != PW_OK) return r->error->status;
  if (!pw_is_state_name (r, name))
    return read_fail (r, n->at, "truth: expected a state such as BODY.phi, found \"%.60s\"", name);
  r->label = "truth";
  if (pw_check_state_name (r, n, name, 0) != PW_OK) return r->error->status;
  if (pw_names_add (seen, name, 0) >= 0) return read_fail (r, n->at, "truth: a second \"%s\"", name);
  r->label = PW_PRINTED (100, "truth of %.60s", name);
  t->state[t->states] = name;
  int status = pw_yaml_expression (r, n->next, time, &t->text[t->states], &x[t->states]);
  t->states += status == PW_OK;
  return status;
}

/* Reads the reference solution, after bodies and elements. */
static int read_reference (pw_reader *r) {
  const pw_node *map = r->y->reference;
  pw_reference_text *t = r->reference;
  pw_names seen = { .size = 0 };
  if (map || r->operations > 0) /* expressions may use names, whose values `show` writes */
    t->names = r->numbers, t->name = r->scope->name, t->value = r->scope->value;
  if (map == NULL) return r->error->status;
  if (map->type != PW_YAML_MAP)
    return read_fail (r, map->at, "truth: expected a map {STATE: EXPRESSION, ...}, found %s", pw_node_found (map));
  size_t room = (size_t)map->count + 1;
  t->state = pw_arena_alloc (r->arena, room * sizeof *t->state);
  t->text = pw_arena_alloc (r->arena, room * sizeof *t->text);
  t->context = pw_arena_alloc (r->arena, room * sizeof (pw_expression *));
  t->eval = reference_eval;
  if (t->state == NULL || t->text == NULL || t->context == NULL || pw_names_open (&seen, room) != PW_OK)
    return read_no_memory (r);
  for (const pw_node *n = map->first; n && r->error->status == PW_OK; n = n->next->next) reference_entry (r, n, &seen);
  pw_names_close (&seen);
  return r->error->status;
}

/* ---- Bodies ----
 *
 * Bodies and elements are passed to pw_add_body and pw_add, like those of a build function in C.  The core checks them;
 * its messages get a position. */

static int build_body (pw_reader *r, const pw_node *node) {
  static const char *const key[] = { "name", "mass", "inertia", "start", "rate", NULL };
  static const char *const state[][4] = { { "x", "y", "phi", NULL }, { "vx", "vy", "omega", NULL } };
  const pw_node *v[sizeof key / sizeof *key];
  pw_body body = { .specified = PW_SPECIFIES_NOTHING };
  pw_error cause = { 0 };
  if (pw_yaml_keys (r, node, key, "a body", v) != PW_OK) return r->error->status;
  const pw_node *name = v[0];
  if (name == NULL) return read_fail (r, node->at, "a body needs a name");
  if (pw_build_name (r, name, "body", &body.name) != PW_OK) return r->error->status;
  for (int i = 0; i < 2; i++) {
    const char *label = PW_PRINTED (160, "body %.60s: %s", body.name, key[1 + i]);
    pw_yaml_number (r, v[1 + i], label, PW_NONNEGATIVE, i ? &body.inertia : &body.mass);
  }
  for (int i = 0; i < 2; i++) {
    const char *label = PW_PRINTED (160, "%s of body %.60s", key[3 + i], body.name);
    const pw_node *given[4];
    pw_yaml_keys (r, v[3 + i], state[i], label, given);
    for (int k = 0; k < 3; k++) {
      if (given[k] == NULL) continue;
      double *value = (i ? body.rate : body.start) + k;
      pw_yaml_number (r, given[k], PW_PRINTED (200, "%s: %s", label, state[i][k]), PW_REAL, value);
      body.specified |= 1u << (3 * i + k);
    }
  }
  if (r->error->status != PW_OK) return r->error->status;
  if (pw_model_check_body (r->model, &body, &cause) != PW_OK) return pw_build_fail (r, name, &cause);
  pw_names_add (&r->bodies, body.name, 0);
  return pw_add_body (r->model, &body);
}

/* ---- Elements ---- */

static int build_body_name (const pw_reader *r, const pw_node *node, const char **name) {
  if (pw_yaml_text (r, node, r->label, name) != PW_OK) return r->error->status;
  if (strcmp (*name, "ground") == 0 || pw_names_find (&r->bodies, *name) >= 0) return PW_OK;
  pw_nearest near = { .sought = *name };
  pw_suggest_bodies (r, &near);
  pw_nearest_try (&near, "ground");
  return read_fail (r, node->at, "%s: there is no body \"%.60s\"%s", r->label, *name, pw_nearest_text (&near));
}

static int build_value (pw_reader *r, const pw_node *node, void *to) {
  switch (r->field->type) {
  case PW_NUMBER:
    return pw_yaml_number (r, node, r->label, r->field->domain, to);
  case PW_POINT:
  case PW_VECTOR:
    return pw_yaml_pair (r, node, r->label, "numbers, [x, y]", to);
  case PW_BODY:
    return build_body_name (r, node, to);
  case PW_SIGNAL:
    return pw_yaml_signal (r, node, to);
  case PW_CHOICE:
    return pw_yaml_choice (r, node, r->label, r->field->choices, to);
  case PW_TEXT:
    return pw_yaml_text (r, node, r->label, to);
  }
  return read_fail (r, node->at, "%s cannot be given in a text model", r->label);
}

static int build_field (pw_reader *r, const pw_node *node, const char *element) {
  static const char *const plural[] = { [PW_NUMBER] = "numbers",
                                        [PW_POINT] = "points, each [x, y],",
                                        [PW_VECTOR] = "vectors, each [x, y],",
                                        [PW_BODY] = "bodies",
                                        [PW_SIGNAL] = "signals",
                                        [PW_CHOICE] = "choices",
                                        [PW_TEXT] = "texts" };
  const pw_field *f = r->field;
  char *to = r->definition + f->offset;
  int count = pw_field_count (f);
  r->label = PW_PRINTED (200, "%s %.60s: %s", r->kind->name, element, f->name);
  if (count == 1) return build_value (r, node, to);
  if (pw_yaml_list_of (r, node, r->label, count, plural[f->type]) != PW_OK) return r->error->status;
  for (const pw_node *n = node->first; n; n = n->next, to += pw_field_bytes (f->type)) build_value (r, n, to);
  return r->error->status;
}

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

/* Finds the element type, the first key. */
static int build_kind (pw_reader *r, const pw_node *node) {
  const pw_node *first = node->type == PW_YAML_MAP ? node->first : NULL;
  if (first == NULL || first->type != PW_YAML_SCALAR)
    return read_fail (r, node->at, "expected an element {TYPE: NAME, ...}, found %s", pw_node_found (node));
  int kind = pw_find_kind_key (first);
  r->kind = kind < 0 ? NULL : pw_kinds[kind];
  if (r->kind == &pw_kind_state)
    return read_fail (r, first->at, "a state is not an element: list it under \"states\", {name: NAME, rate: ..}");
  if (r->kind) return PW_OK;
  for (const pw_node *n = first; n; n = n->next->next) { /* a type that appears later, also as {kind: wheel, ...} */
    kind = pw_find_kind_key (pw_node_is (n, "kind") || pw_node_is (n, "type") ? n->next : n);
    if (kind >= 0)
      return read_fail (r, first->at, "an element begins with its type: write {%s: NAME, ...}", pw_kinds[kind]->name);
  }
  pw_nearest near = { .sought = first->text };
  for (const pw_kind *const *k = pw_kinds; *k; k++) pw_nearest_try (&near, (*k)->name);
  /* Words of descriptions suggest a type: "hinge" pin, "damper" spring; names of fields, as "angle", do not. */
  for (const pw_kind *const *k = pw_kinds; *k && !near.near && !build_is_field (first->text); k++)
    if (build_has_word ((*k)->about, first->text))
      snprintf (near.best, sizeof near.best, "%s", (*k)->name), near.near = 1;
  return read_fail (r, first->at, "an element begins with its type, and there is no type \"%.60s\"%s", first->text,
                    near.near ? pw_nearest_text (&near) : ": see pinwheel list kinds");
}

/* Adds an element of the type r->kind with the fields in the pairs from `first` on, to which the keys of a first-order
 * state add `name`; at: where an error of the whole is reported. */
static int build_fields (pw_reader *r, const pw_node *at, const pw_node *name, const pw_node *first) {
  const char *key[PW_MAX_KEYS];
  const pw_node *v[PW_MAX_KEYS];
  const pw_kind *kind = r->kind;
  pw_error cause = { 0 };
  int n = 0, index;
  memset (r->definition, 0, kind->definition);
  memcpy (r->definition, &name->text, sizeof name->text);
  for (const pw_field *f = kind->fields; f->name && n < PW_MAX_KEYS - 2; f++) key[n++] = f->name;
  key[n] = kind == &pw_kind_state ? "name" : NULL, key[n + 1] = NULL;
  pw_yaml_keys_from (r, first, key, PW_PRINTED (100, "a %s", kind->name), v);
  for (int i = 0; i < n && r->error->status == PW_OK; i++) {
    const pw_field *f = r->field = &kind->fields[i];
    if (v[i])
      build_field (r, v[i], name->text);
    else if (f->required || f->type == PW_BODY)
      read_fail (r, at->at, "%s %.60s needs \"%s\": %s", kind->name, name->text, f->name, f->about ? f->about : "");
  }
  if (r->error->status != PW_OK) return r->error->status;
  pw_element e = { kind, r->definition };
  if (pw_model_check_element (r->model, &e, &cause) != PW_OK) return pw_build_fail (r, name, &cause);
  pw_model_elements (r->model, &index);
  if (kind->contact && !kind->each_body) pw_names_add (&r->contacts, name->text, index);
  return pw_add (r->model, kind, r->definition);
}

static int build_element (pw_reader *r, const pw_node *node) {
  const char *name;
  if (build_kind (r, node) != PW_OK) return r->error->status;
  const pw_node *first = node->first;
  if (pw_build_name (r, first->next, r->kind->name, &name) != PW_OK) return r->error->status;
  return build_fields (r, first, first->next, first->next->next);
}

/* ---- First-order states: a list of {name, rate, start, unit} ---- */

/* The node of a state's name, or NULL after an error. */
static const pw_node *state_name (const pw_reader *r, const pw_node *node) {
  if (node->type != PW_YAML_MAP)
    return read_fail (r, node->at, "expected a state {name: NAME, rate: ..}, found %s", pw_node_found (node)), NULL;
  for (const pw_node *n = node->first; n; n = n->next->next)
    if (pw_node_is (n, "name")) return n->next;
  return read_fail (r, node->at, "a state needs a name"), NULL;
}

/* Indexes the names of all states, which signals of any element may read; expressions can use them. */
static int index_states (pw_reader *r) {
  for (const pw_node *n = r->y->states ? r->y->states->first : NULL; n && r->error->status == PW_OK; n = n->next) {
    const pw_node *node = state_name (r, n);
    const char *name;
    if (node == NULL || pw_build_name (r, node, "state", &name) != PW_OK) return r->error->status;
    if (pw_yaml_name (r, node, "state", &r->states) != PW_OK) return r->error->status;
    if (pw_names_find (&r->scope->index, name) >= 0)
      return read_fail (r, node->at, "state \"%s\": a parameter or number of let has this name", name);
  }
  return r->error->status;
}

static int build_state (pw_reader *r, const pw_node *node) {
  const pw_node *name = state_name (r, node);
  r->kind = &pw_kind_state;
  return build_fields (r, name, name, node->first);
}

/* ---- The model ---- */

static int build_all (pw_reader *r, const double *parameter) {
  const pw_yaml *y = r->y;
  double value;
  for (int i = 0; i < y->parameter_count; i++) pw_scope_add (r->scope, y->table.parameters[i].name, parameter[i]);
  for (const pw_node *n = y->let ? y->let->first : NULL; n; n = n->next->next) {
    if (pw_yaml_number (r, n->next, PW_PRINTED (100, "let %s", n->text), PW_REAL, &value) != PW_OK)
      return r->error->status;
    pw_scope_add (r->scope, n->text, value);
  }
  r->numbers = r->scope->names;
  for (const pw_node *n = y->paths ? y->paths->first : NULL; n; n = n->next)
    if (pw_yaml_path (r, n) != PW_OK) return r->error->status;
  if (index_states (r) != PW_OK) return r->error->status;
  if (pw_yaml_outputs (r) != PW_OK) return r->error->status;
  for (const pw_node *n = y->bodies ? y->bodies->first : NULL; n; n = n->next)
    if (build_body (r, n) != PW_OK) return r->error->status;
  for (const pw_node *n = y->elements ? y->elements->first : NULL; n; n = n->next)
    if (build_element (r, n) != PW_OK) return r->error->status;
  for (const pw_node *n = y->states ? y->states->first : NULL; n; n = n->next)
    if (build_state (r, n) != PW_OK) return r->error->status;
  if (pw_add_outputs (r) != PW_OK) return r->error->status;
  return read_reference (r);
}

static void build_free (void *arena) {
  pw_arena_free (arena);
  free (arena);
}

/* Allocates the memory for building, and the arena for what lives as long as the model. */
static int build_open (pw_reader *r) {
  const pw_yaml *y = r->y;
  size_t largest = 1, bodies = y->bodies ? (size_t)y->bodies->count : 0, lets = y->let ? (size_t)y->let->count : 0;
  size_t elements = y->elements ? (size_t)y->elements->count : 0, outputs = y->outputs ? (size_t)y->outputs->count : 0;
  size_t states = y->states ? (size_t)y->states->count : 0, paths = y->paths ? (size_t)y->paths->count : 0;
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if ((*k)->definition > largest) largest = (*k)->definition;
  r->arena = calloc (1, sizeof *r->arena);
  if (r->arena == NULL || pw_model_keep (r->model, r->arena, build_free) != PW_OK) return read_no_memory (r);
  r->reference = pw_arena_alloc (r->arena, sizeof *r->reference);
  pw_model_set_reference (r->model, r->reference);
  r->definition = malloc (largest);
  if (r->reference) r->reference->path = pw_arena_alloc (r->arena, (paths + 1) * sizeof *r->reference->path);
  if (r->reference && r->reference->path && r->definition &&
      pw_scope_open (r->scope, y->parameter_count + (int)(lets + paths + outputs), r->arena) == PW_OK &&
      pw_names_open (&r->bodies, bodies) == PW_OK && pw_names_open (&r->contacts, elements) == PW_OK &&
      pw_names_open (&r->states, states) == PW_OK &&
      pw_names_open (&r->names, bodies + elements + states + paths + outputs) == PW_OK)
    return PW_OK;
  return read_no_memory (r);
}

/* The build function; the parameters are numbers in the order of the table. */
static void build_model (pw_model *m, const void *parameters) {
  const void *table = pw_model_table (m);
  pw_scope scope = { 0 };
  pw_reader r = { .y = table, .model = m, .scope = &scope, .error = pw_model_error (m) };
  pw_yaml_list (&r, r.y->paths, "paths");
  pw_yaml_list (&r, r.y->bodies, "bodies");
  pw_yaml_list (&r, r.y->states, "states");
  pw_yaml_list (&r, r.y->outputs, "outputs");
  if (pw_yaml_list (&r, r.y->elements, "elements") == PW_OK && build_open (&r) == PW_OK) build_all (&r, parameters);
  pw_scope_close (&scope);
  pw_names_close (&r.bodies);
  pw_names_close (&r.states);
  pw_names_close (&r.names);
  pw_names_close (&r.elements);
  pw_names_close (&r.contacts);
  pw_names_close (&r.outputs);
  free (r.definition);
}

/* ---- The head ---- */

/* A default must not depend on other parameters: --set would have to change it, too. */
static int head_default (const pw_reader *r, const pw_node *node, const char *label, const pw_names *names,
                         pw_parameter *p) {
  const char *text = node->type == PW_YAML_SCALAR ? node->text : "";
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *at; (at = pw_expression_next_name (&rest, name)) != NULL;)
    if (pw_names_find (names, name) >= 0)
      return read_fail (r, pw_source_offset (r->y, node, (size_t)(at - text)),
                        "%s: a default is made of numbers; what follows from parameters belongs in let", label);
  return pw_yaml_number (r, node, label, p->domain, &p->value);
}

static int head_parameter (const pw_reader *r, const pw_node *node, pw_names *names, pw_parameter *p) {
  static const char *const key[] = { "name", "value", "unit", "about", "domain", "min", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  if (pw_yaml_keys (r, node, key, "a parameter", v) != PW_OK) return r->error->status;
  const pw_node *name = v[0], *value = v[1], *unit = v[2], *about = v[3], *domain = v[4], *min = v[5];
  int chosen = min ? PW_NONNEGATIVE : PW_REAL;
  if (name == NULL) return read_fail (r, node->at, "a parameter needs a name");
  if (pw_yaml_name (r, name, "parameter", names) != PW_OK) return r->error->status;
  p->name = name->text;
  p->unit = p->about = "";
  const char *label = PW_PRINTED (100, "parameter %s", p->name);
  if (value == NULL) return read_fail (r, node->at, "%s needs a value, its default", label);
  if (min && (!pw_node_is (min, "0") || domain))
    return read_fail (r, min->at, "min: only 0 can be written, without a domain; \"domain: positive\" means > 0");
  pw_yaml_choice (r, domain, "domain", pw_domain_names, &chosen);
  p->domain = (pw_domain)chosen;
  pw_yaml_unit (r, unit, value, &p->unit);
  pw_yaml_text (r, about, "about", &p->about);
  return head_default (r, value, label, names, p);
}

static int head_parameters (pw_yaml *y, const pw_reader *r, const pw_node *list, pw_names *names) {
  if (pw_yaml_list (r, list, "parameters") != PW_OK) return r->error->status;
  size_t count = list ? (size_t)list->count : 0;
  pw_parameter *p = pw_arena_alloc (&y->arena, (count + 1) * sizeof *p);
  if (p == NULL) return read_no_memory (r);
  y->table.parameters = p;
  for (const pw_node *n = list ? list->first : NULL; n; n = n->next, p++) {
    if (head_parameter (r, n, names, p) != PW_OK) return r->error->status;
    p->offset = (size_t)y->parameter_count++ * sizeof (double);
  }
  y->table.parameters_size = count * sizeof (double);
  return PW_OK;
}

static int read_head (pw_yaml *y, const pw_reader *r) {
  static const char *const key[] = { "pinwheel", "about", "run",    "parameters", "let",   "bodies",
                                     "elements", "truth", "states", "outputs",    "paths", NULL };
  static const char *const run_key[] = { "t_end", "step", "rtol", "method", NULL };
  const pw_node *v[sizeof key / sizeof *key], *run[sizeof run_key / sizeof *run_key];
  double *number[] = { &y->table.run.t_end, &y->table.run.step, &y->table.run.rtol };
  pw_names names = { .size = 0 };
  if (y->root == NULL) return read_fail (r, 0, "the file is empty; a model begins with \"pinwheel: 1\"");
  if (pw_yaml_keys (r, y->root, key, "a model", v) != PW_OK) return r->error->status;
  if (v[0] == NULL) return read_fail (r, y->root->at, "\"pinwheel: 1\" is missing, the version of the format");
  if (!pw_node_is (v[0], "1"))
    return read_fail (r, v[0]->at, "pinwheel: expected 1, the version of the format that this Pinwheel reads");
  pw_yaml_text (r, v[1], "about", &y->table.about);
  pw_yaml_keys (r, v[2], run_key, "run", run);
  for (int i = 0; i < 3; i++) pw_yaml_number (r, run[i], run_key[i], PW_POSITIVE, number[i]);
  pw_yaml_text (r, run[3], run_key[3], &y->table.run.method);
  const pw_node *parameters = v[3], *let = v[4];
  /* the key of the reference solution is "truth" */
  y->let = let, y->bodies = v[5], y->elements = v[6], y->reference = v[7], y->states = v[8], y->outputs = v[9];
  y->paths = v[10];
  for (int i = 3; key[i]; i++) /* from "parameters" on: lists and maps */
    if (v[i] && v[i]->count > PW_MAX_ITEMS)
      read_fail (r, v[i]->at, "%s: %d entries; a model may have %d", key[i], v[i]->count, PW_MAX_ITEMS);
  size_t count = (size_t)(parameters ? parameters->count : 0) + (size_t)(let ? let->count : 0);
  if (r->error->status == PW_OK && pw_names_open (&names, count) != PW_OK) read_no_memory (r);
  if (r->error->status == PW_OK) head_parameters (y, r, parameters, &names);
  if (r->error->status == PW_OK && let && let->type != PW_YAML_MAP)
    read_fail (r, let->at, "let: expected a map {NAME: NUMBER, ...}, found %s", pw_node_found (let));
  for (const pw_node *n = let ? let->first : NULL; n && r->error->status == PW_OK; n = n->next->next)
    pw_yaml_name (r, n, "name", &names);
  pw_names_close (&names);
  return r->error->status;
}

/* ---- The file ---- */

pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t max_bytes, pw_error *error) {
  const char *slash = strrchr (path, '/');
  pw_yaml *y = calloc (1, sizeof *y);
  if (y) y->path = pw_arena_copy (&y->arena, shown);
  if (y) y->folder = pw_arena_copy (&y->arena, slash ? path : ".");
  if (y && y->folder && slash) y->folder[slash - path] = 0; /* "" for "/model.yaml" */
  if (y == NULL || y->path == NULL || y->folder == NULL) {
    pw_fail (error, PW_RESOURCE, "out of memory");
    pw_yaml_close (y);
    return NULL;
  }
  y->max_ahead = MAX_AHEAD * fmax (1, (double)max_bytes / PW_FILE_DEFAULT_BYTES);
  y->table = (pw_plugin_table){ .abi = PW_ABI, .size = sizeof y->table, .build = build_model };
  if (pw_yaml_read_source (y, path, max_bytes, error) == PW_OK && pw_yaml_read_tree (y, error) == PW_OK &&
      read_head (y, &(pw_reader){ .y = y, .error = error }) == PW_OK)
    return y;
  pw_yaml_close (y);
  return NULL;
}

void pw_yaml_close (pw_yaml *y) {
  if (y == NULL) return;
  pw_arena_free (&y->arena);
  free (y->source);
  free (y);
}

int pw_yaml_tables (const pw_yaml *y, const pw_node *node, int (*each) (void *context, const char *path),
                    void *context) {
  int stop = 0;
  for (const pw_node *n = node == NULL || node->type == PW_YAML_SCALAR ? NULL : node->first; n && !stop; n = n->next) {
    const pw_node *key = node->type == PW_YAML_MAP ? n : NULL;
    if (key) n = key->next; /* its value */
    if (key && pw_node_is (key, "file") && n->type == PW_YAML_SCALAR) {
      char path[PW_PATH];
      stop = each (context, pw_path (path, "%s/%s", y->folder, n->text));
    } else
      stop = pw_yaml_tables (y, n, each, context);
  }
  return stop;
}
