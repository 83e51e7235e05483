/* Reads text models from the tree of a file: bodies and elements, through the field tables of their types; first-order
 * states; the head, parameters and default run settings, which is stored in a plug-in's table, so that text models can
 * be used like compiled ones; included files. */
#include <math.h>
#include <stdlib.h>
#include "yaml_read.h"

#define MAX_AHEAD 1e6 /* pw_yaml.max_ahead for the default limit of bytes: each indicator takes 350 bytes */

/* ---- Reference solution: `truth`, a map of states to expressions of time, or a list of such maps ---- */

static double reference_eval (void *context, int i, double t) {
  const pw_expression *const *x = context;
  return pw_expression_value (x[i], &t);
}

static int reference_state (pw_reader *r, const pw_node *n) {
  static const char *const time[] = { "t", NULL };
  pw_reference_text *t = r->reference;
  pw_node text;
  const char *name;
  if (pw_yaml_text (r, n, "truth", &name) != PW_OK) return r->error->status;
  const pw_expression **x = t->context;
  if (!pw_is_state_name (r, name))
    return read_fail (r, n->at, "truth: expected a state such as BODY.phi, found \"%.60s\"", name);
  r->label = "truth";
  if (pw_check_state_name (r, n, name, 0) != PW_OK) return r->error->status;
  if (pw_names_add (&r->truth, name, 0) >= 0) return read_fail (r, n->at, "truth: a second \"%s\"", name);
  r->label = PW_PRINTED (100, "truth of %.60s", name);
  t->state[t->states] = name;
  if (pw_yaml_rename (r, n->next, &text) != PW_OK) return r->error->status;
  int status = pw_yaml_expression (r, &text, time, &t->text[t->states], &x[t->states]);
  t->states += status == PW_OK;
  return status;
}

static int reference_entry (pw_reader *r, const pw_node *map) {
  if (map->type != PW_YAML_MAP)
    return read_fail (r, map->at, "truth: expected a map {STATE: EXPRESSION, ...}, found %s", pw_node_found (map));
  for (const pw_node *n = map->first; n && r->error->status == PW_OK; n = n->next->next)
    if (pw_count_entry (r, n) == PW_OK) reference_state (r, n);
  return r->error->status;
}

static int read_reference (pw_reader *r) {
  pw_reference_text *t = r->reference;
  int bodies, elements;
  pw_model_bodies (r->model, &bodies);
  const pw_element *e = pw_model_elements (r->model, &elements);
  size_t room = 6 * (size_t)bodies + 1; /* all states */
  for (int i = 0; i < elements; i++) room += 2 * (size_t)e[i].kind->internal;
  t->eval = reference_eval;
  if (r->y->reference || r->operations > 0) /* expressions may use names, whose values `show` writes */
    t->names = r->numbers, t->name = r->scope->name, t->value = r->scope->value;
  if (r->y->reference == NULL) return PW_OK;
  const pw_expression **x;
  if (!PW_ARENA_ARRAYS (r->arena, PW_ARRAY (t->state, room), PW_ARRAY (t->text, room), PW_ARRAY (x, room)) ||
      pw_names_open (&r->truth, room) != PW_OK)
    return read_no_memory (r);
  t->context = x;
  return pw_yaml_entries (r, r->y->reference, reference_entry);
}

/* ---- Places of included files ---- */

/* A frame in the plane. */
typedef struct pw_place {
  double at[2], phi; /* [m], [rad] */
  double cos, sin;
} pw_place;

/* Turns a vector from the frame to the world (sign 1), or back (-1). */
static void place_turn (const pw_place *p, int sign, double v[2]) {
  const double x = v[0], y = v[1], s = sign * p->sin;
  if (p->phi == 0) return; /* so that no bit changes */
  v[0] = p->cos * x - s * y;
  v[1] = s * x + p->cos * y;
}

/* The point in the world of a point in the frame. */
static void place_point (const pw_place *p, double v[2]) {
  place_turn (p, 1, v);
  v[0] += p->at[0], v[1] += p->at[1];
}

static void place_back (const pw_place *p, double v[2]) {
  v[0] -= p->at[0], v[1] -= p->at[1];
  place_turn (p, -1, v);
}

/* The frame at (x, y) and phi in that around it; NULL: in the world. */
static pw_place place_in (const pw_place *around, const double at[2], double phi) {
  pw_place p = { .at = { at[0], at[1] }, .phi = phi, .cos = 1 };
  if (around) {
    place_point (around, p.at);
    p.phi += around->phi;
  }
  if (p.phi != 0) p.cos = cos (p.phi), p.sin = sin (p.phi);
  return p;
}

/* Moves the initial state of a body from a frame, or NULL, to the world.  Returns "", or the pair of which only one
 * value is specified, so that it cannot be turned. */
static const char *place_body (const pw_place *p, pw_body *body) {
  for (int i = 0; p && p->phi != 0 && i < 6; i += 3)
    if ((body->specified >> i & 1) != (body->specified >> (i + 1) & 1)) return i ? "vx and vy" : "x and y";
  if (p) place_point (p, body->start), place_turn (p, 1, body->rate);
  body->start[2] += p ? p->phi : 0;
  return "";
}

/* Makes a body a uniform bar between two points. */
static void place_bar (pw_body *body, const double from[2], const double to[2]) {
  const double dx = to[0] - from[0], dy = to[1] - from[1];
  body->inertia = body->mass * (dx * dx + dy * dy) / 12;
  body->start[0] = (from[0] + to[0]) / 2, body->start[1] = (from[1] + to[1]) / 2, body->start[2] = atan2 (dy, dx);
  body->specified |= 7;
}

/* The name of body i of an element, or NULL. */
static const char *place_body_of (const pw_kind *kind, const char *definition, int i) {
  const char *name = NULL;
  for (const pw_field *f = kind->fields; f->name; f++)
    if (f->type == PW_BODY && i < pw_field_count (f))
      memcpy (&name, definition + f->offset + (size_t)i * pw_field_bytes (PW_BODY), sizeof name);
  return name;
}

/* A field that may be a direction in the ground, which a frame, or NULL, turns; or NULL. */
static const char *place_direction (const pw_place *p, const pw_kind *kind, const char *definition) {
  const char *body = place_body_of (kind, definition, 0), *second = place_body_of (kind, definition, 1);
  if (p == NULL || p->phi == 0 || kind == &pw_kind_state) return NULL;
  if (body && strcmp (body, "ground") != 0 && (second == NULL || strcmp (second, "ground") != 0)) return NULL;
  for (const pw_field *f = kind->fields; f->name; f++)
    if (f->type == PW_SIGNAL || f->type == PW_CHOICE || f->type == PW_VECTOR ||
        (f->type == PW_NUMBER && f->domain == PW_REAL))
      return f->name;
  return NULL;
}

/* ---- Bodies ----
 *
 * Bodies and elements are passed to pw_add_body and pw_add, like those of a build function in C.  The core checks them;
 * its messages get a position. */

/* A uniform bar between two points: {bar: NAME, from: [x, y], to: [x, y], mass: M}. */
static int build_bar (pw_reader *r, const pw_node *name, const pw_node *from, const pw_node *to, pw_body *body) {
  double a[2], b[2];
  const char *label = PW_JOINED (160, "bar ", body->name);
  if (from == NULL || to == NULL) return read_fail (r, name->at, "%s needs two points, \"from\" and \"to\"", label);
  if (pw_yaml_pair (r, from, label, "numbers, [x, y]", a) != PW_OK ||
      pw_yaml_pair (r, to, label, "numbers, [x, y]", b) != PW_OK)
    return r->error->status;
  if (a[0] == b[0] && a[1] == b[1]) return read_fail (r, to->at, "%s: its two points are the same", label);
  place_bar (body, a, b);
  return PW_OK;
}

static int build_body (pw_reader *r, const pw_node *node) {
  static const char *const keys[] = { "name", "mass", "inertia", "start", "rate", "outline", NULL };
  static const char *const bar_keys[] = { "bar", "mass", "from", "to", "rate", "outline", NULL };
  static const char *const state[][4] = { { "x", "y", "phi", NULL }, { "vx", "vy", "omega", NULL } };
  const pw_node *v[sizeof keys / sizeof *keys];
  pw_body body = { .specified = PW_SPECIFIES_NOTHING };
  pw_error cause = { 0 };
  int bodies, is_bar = 0;
  for (const pw_node *n = node->type == PW_YAML_MAP ? node->first : NULL; n; n = n->next->next)
    is_bar |= pw_node_is (n, "bar");
  const char *const *key = is_bar ? bar_keys : keys;
  if (pw_yaml_keys (r, node, key, is_bar ? "a bar" : "a body", v) != PW_OK) return r->error->status;
  const pw_node *name = v[0];
  if (name == NULL) return read_fail (r, node->at, "a body needs a name");
  if (pw_build_name (r, name, "body", &body.name) != PW_OK) return r->error->status;
  for (int i = 0; i < (is_bar ? 1 : 2); i++) {
    const char *label = PW_JOINED (160, "body ", body.name, ": ", key[1 + i]);
    pw_yaml_number (r, v[1 + i], label, PW_NONNEGATIVE, i ? &body.inertia : &body.mass);
  }
  if (is_bar && build_bar (r, name, v[2], v[3], &body) != PW_OK) return r->error->status;
  for (int i = is_bar; i < 2; i++) {
    const char *label = PW_JOINED (160, key[3 + i], " of body ", body.name);
    const pw_node *given[4];
    pw_yaml_keys (r, v[3 + i], state[i], label, given);
    for (int k = 0; k < 3; k++) {
      if (given[k] == NULL) continue;
      double *value = (i ? body.rate : body.start) + k;
      pw_yaml_number (r, given[k], PW_JOINED (200, label, ": ", state[i][k]), PW_REAL, value);
      body.specified |= 1u << (3 * i + k);
    }
  }
  if (r->error->status != PW_OK || pw_yaml_outline (r, v[5], &body) != PW_OK) return r->error->status;
  const char *alone = place_body (r->place, &body);
  if (*alone)
    return read_fail (r, name->at, "body %.60s: in a file placed at an angle, %s are given both or neither", body.name,
                      alone);
  if (pw_model_check_body (r->model, &body, &cause) != PW_OK) return pw_build_fail (r, name, &cause);
  pw_model_bodies (r->model, &bodies);
  pw_names_add (&r->bodies, body.name, bodies);
  return pw_add_body (r->model, &body);
}

/* ---- Elements ---- */

static int build_body_name (const pw_reader *r, const pw_node *node, const char **name) {
  if (pw_yaml_text (r, node, r->label, name) != PW_OK) return r->error->status;
  if (strcmp (*name, "ground") == 0) return PW_OK;
  if ((*name = pw_yaml_prefixed (r, *name)) == NULL) return read_no_memory (r);
  if (pw_names_find (&r->bodies, *name) >= 0) return PW_OK;
  pw_nearest near = { .sought = *name };
  pw_suggest_bodies (r, &near);
  pw_nearest_try (&near, "ground");
  return read_fail (r, node->at, "%s: there is no body \"%.60s\"%s", r->label, *name, pw_nearest_text (&near));
}

/* A point of body i: [x, y] in its frame, or {world: [x, y]} where it is at the start. */
static int build_point (pw_reader *r, const pw_node *node, int i, double to[2]) {
  static const char *const key[] = { "world", NULL };
  const pw_node *world = NULL;
  const char *name = place_body_of (r->kind, r->definition, i);
  if (node->type == PW_YAML_MAP && pw_yaml_keys (r, node, key, "a point", &world) != PW_OK) return r->error->status;
  if (pw_yaml_pair (r, world ? world : node, r->label, "numbers, [x, y]", to) != PW_OK || name == NULL)
    return r->error->status;
  if (r->place && (world || strcmp (name, "ground") == 0)) place_point (r->place, to);
  if (world == NULL || strcmp (name, "ground") == 0) return PW_OK;
  int bodies;
  const pw_body *body = pw_model_bodies (r->model, &bodies) + pw_names_find (&r->bodies, name);
  if ((body->specified & 7) != 7)
    return read_fail (r, node->at, "%s: a point of the world needs x, y and phi in the start of body %s", r->label,
                      name);
  const pw_place place = place_in (NULL, body->start, body->start[2]);
  place_back (&place, to);
  return PW_OK;
}

static int build_path (pw_reader *r, const pw_node *node, pw_path **to) {
  const pw_scope *s = r->scope;
  const char *name;
  if (pw_yaml_text (r, node, r->label, &name) != PW_OK) return r->error->status;
  const int found = pw_names_find (&s->index, name);
  if (found >= 0 && s->path[found]) return *to = s->path[found], PW_OK;
  pw_nearest near = { .sought = name };
  for (int i = 0; i < s->names; i++)
    if (s->path[i]) pw_nearest_try (&near, s->name[i]);
  return read_fail (r, node->at, "%s: there is no path \"%.60s\"%s", r->label, name, pw_nearest_text (&near));
}

static int build_value (pw_reader *r, const pw_node *node, int i, void *to) {
  switch (r->field->type) {
  case PW_NUMBER:
    return pw_yaml_number (r, node, r->label, r->field->domain, to);
  case PW_POINT:
    return build_point (r, node, i, to);
  case PW_VECTOR:
    return pw_yaml_pair (r, node, r->label, "numbers, [x, y]", to);
  case PW_BODY:
    return build_body_name (r, node, to);
  case PW_SIGNAL:
    pw_yaml_signal (r, node, to);
    ((pw_signal *)to)->specified = r->field->limit;
    return r->error->status;
  case PW_CHOICE:
    return pw_yaml_choice (r, node, r->label, r->field->choices, to);
  case PW_TEXT:
    return pw_yaml_text (r, node, r->label, to);
  case PW_TRACK:
    return build_path (r, node, to);
  }
  return read_fail (r, node->at, "%s cannot be given in a text model", r->label);
}

static int build_field (pw_reader *r, const pw_node *node, const char *element) {
  static const char *const plural[] = { [PW_NUMBER] = "numbers",
                                        [PW_POINT] = "points, each [x, y]",
                                        [PW_VECTOR] = "vectors, each [x, y]",
                                        [PW_BODY] = "bodies",
                                        [PW_SIGNAL] = "signals",
                                        [PW_CHOICE] = "choices",
                                        [PW_TEXT] = "texts",
                                        [PW_TRACK] = "paths" };
  const pw_field *f = r->field;
  char *to = r->definition + f->offset;
  int count = pw_field_count (f);
  r->label = PW_JOINED (200, r->kind->name, " ", element, ": ", f->name);
  if (f->given) *(int *)(void *)(r->definition + f->given) = 1;
  if (count == 1) return build_value (r, node, 0, to);
  const int world = f->type == PW_POINT && node->type == PW_YAML_MAP; /* one point of all bodies */
  if (!world && pw_yaml_list_of (r, node, r->label, count, plural[f->type]) != PW_OK) return r->error->status;
  const pw_node *n = world ? node : node->first;
  if (!world && (f->type == PW_POINT || f->type == PW_VECTOR) && n->type == PW_YAML_SCALAR)
    return read_fail (r, node->at, "%s: expected %d %s, found numbers", r->label, count, plural[f->type]);
  for (int i = 0; i < count; i++, to += pw_field_bytes (f->type), n = world ? n : n->next) build_value (r, n, i, to);
  return r->error->status;
}

/* Whether a word of a text begins with this prefix of at least 3 bytes. */
static int kind_has_word (const char *text, const char *prefix) {
  for (const char *at = text; strlen (prefix) >= 3 && (at = strstr (at, prefix)) != NULL; at++)
    if (at == text || strchr (" (", at[-1])) return 1;
  return 0;
}

/* 1 if an element type has a field of this name. */
static int kind_has_field (const char *name) {
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    for (const pw_field *f = (*k)->fields; f->name; f++)
      if (strcmp (f->name, name) == 0) return 1;
  return 0;
}

/* The element type whose name is near, or in whose description a word begins with the text. */
static pw_nearest kind_nearest (const char *text) {
  pw_nearest near = { .sought = text };
  for (const pw_kind *const *k = pw_kinds; *k; k++) pw_nearest_try (&near, (*k)->name);
  /* "hinge" pin, "damper" spring; names of fields, as "angle", do not suggest a type */
  for (const pw_kind *const *k = pw_kinds; *k && !near.near && !kind_has_field (text); k++)
    if (kind_has_word ((*k)->about, text)) snprintf (near.best, sizeof near.best, "%s", (*k)->name), near.near = 1;
  return near;
}

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
  pw_nearest near = kind_nearest (first->text);
  return read_fail (r, first->at, "an element begins with its type, and there is no type \"%.60s\"%s", first->text,
                    near.near ? pw_nearest_text (&near) : ": see pinwheel list kinds");
}

/* Adds an element of the type r->kind with the fields in the pairs from `first` on, to which the keys of a first-order
 * state add `name`; at: where an error of the whole is reported. */
static int build_fields (pw_reader *r, const pw_node *at, const pw_node *node, const char *name, const pw_node *first) {
  const char *key[PW_MAX_KEYS];
  const pw_node *v[PW_MAX_KEYS];
  const pw_kind *kind = r->kind;
  pw_error cause = { 0 };
  int n = 0, index;
  memset (r->definition, 0, kind->definition);
  memcpy (r->definition, &name, sizeof name);
  for (const pw_field *f = kind->fields; f->name && n < PW_MAX_KEYS - 2; f++) key[n++] = f->name;
  key[n] = kind == &pw_kind_state ? "name" : NULL, key[n + 1] = NULL;
  pw_yaml_keys_from (r, first, key, PW_JOINED (100, *kind->name == 'o' ? "an " : "a ", kind->name), v);
  for (int i = 0; i < n && r->error->status == PW_OK; i++) {
    const pw_field *f = r->field = &kind->fields[i];
    if (v[i])
      build_field (r, v[i], name);
    else if (f->required || f->type == PW_BODY)
      read_fail (r, at->at, "%s %.60s needs \"%s\": %s", kind->name, name, f->name, f->about ? f->about : "");
  }
  if (r->error->status != PW_OK) return r->error->status;
  const char *direction = place_direction (r->place, kind, r->definition);
  if (direction)
    return read_fail (r, node->at,
                      "%s %.60s: its \"%s\" refers to the ground, which does not turn with a file placed at an angle",
                      kind->name, name, direction);
  pw_element e = { kind, r->definition };
  if (pw_model_check_element (r->model, &e, &cause) != PW_OK) return pw_build_fail (r, node, &cause);
  pw_model_elements (r->model, &index);
  if (kind->contact && !kind->each_body) pw_names_add (&r->contacts, name, index);
  for (int i = 0; kind != &pw_kind_state && pw_kinds[i]; i++)
    if (pw_kinds[i] == kind) pw_names_add (&r->elements, name, i);
  return pw_add (r->model, kind, r->definition);
}

static int build_element (pw_reader *r, const pw_node *node) {
  const char *name;
  if (build_kind (r, node) != PW_OK) return r->error->status;
  const pw_node *first = node->first;
  if (pw_build_name (r, first->next, r->kind->name, &name) != PW_OK) return r->error->status;
  return build_fields (r, first, first->next, name, first->next->next);
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

/* Indexes the name of a state, which signals of any element may read; expressions can use it. */
static int index_state (pw_reader *r, const pw_node *n) {
  const pw_node *node = state_name (r, n);
  const char *name, *own;
  if (node == NULL || pw_build_name (r, node, "state", &name) != PW_OK) return r->error->status;
  if (pw_yaml_name (r, node, "state", &own) != PW_OK) return r->error->status;
  pw_names_add (&r->states, name, 0);
  if (pw_names_find (&r->scope->index, own) >= 0)
    return read_fail (r, node->at, "state \"%s\": a parameter or number of let has this name", name);
  return PW_OK;
}

static int build_state (pw_reader *r, const pw_node *node) {
  const pw_node *name = state_name (r, node);
  const char *text = pw_yaml_prefixed (r, name->text), *unit;
  for (const pw_node *n = node->first; n; n = n->next->next)
    if (pw_node_is (n, "unit") && pw_yaml_si_unit (r, n->next, &unit) != PW_OK) return r->error->status;
  r->kind = &pw_kind_state;
  return text ? build_fields (r, name, name, text, node->first) : read_no_memory (r);
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
  if (pw_yaml_name (r, name, "parameter", &p->name) != PW_OK) return r->error->status;
  if (pw_names_add (names, p->name, 0) >= 0) return read_fail (r, name->at, "a second parameter \"%s\"", p->name);
  p->unit = p->about = "";
  const char *label = PW_JOINED (100, "parameter ", p->name);
  if (value == NULL) return read_fail (r, node->at, "%s needs a value, its default", label);
  if (min && (!pw_node_is (min, "0") || domain))
    return read_fail (r, min->at, "min: only 0 can be written, without a domain; \"domain: positive\" means > 0");
  pw_yaml_choice (r, domain, "domain", pw_domain_names, &chosen);
  p->domain = (pw_domain)chosen;
  if (unit && pw_yaml_text (r, unit, "unit", &p->unit) == PW_OK) pw_yaml_check_unit (r->y, unit, value, r->error);
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

/* The settings of a preset as words NAME=VALUE. */
static int head_settings (pw_yaml *y, const pw_reader *r, const pw_node *map, pw_preset *p) {
  char text[1000] = "";
  if (map->type != PW_YAML_MAP)
    return read_fail (r, map->at, "settings: expected a map {method: .., step: .., NAME: NUMBER, ...}, found %s",
                      pw_node_found (map));
  for (const pw_node *n = map->first; n; n = n->next->next) {
    const char *name, *value;
    if (pw_yaml_text (r, n, "settings", &name) != PW_OK || pw_yaml_text (r, n->next, name, &value) != PW_OK)
      return r->error->status;
    if (strpbrk (name, " =") || strchr (value, ' '))
      return read_fail (r, n->at, "settings: %s: expected a name and a number or method", name);
    append (text, "%s%s=%s", *text ? " " : "", name, value);
  }
  if (strlen (text) + 1 == sizeof text) return read_fail (r, map->at, "settings: more than %zu bytes", sizeof text - 2);
  p->settings = pw_arena_copy (&y->arena, text);
  return p->settings ? PW_OK : read_no_memory (r);
}

static int head_presets (pw_yaml *y, const pw_reader *r, const pw_node *list) {
  static const char *const key[] = { "name", "about", "settings", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  if (list == NULL || pw_yaml_list (r, list, "presets") != PW_OK) return r->error->status;
  pw_preset *p = pw_arena_alloc (&y->arena, ((size_t)list->count + 1) * sizeof *p);
  if (p == NULL) return read_no_memory (r);
  y->table.presets = p;
  for (const pw_node *n = list->first; n; n = n->next, p++) {
    if (pw_yaml_keys (r, n, key, "a preset", v) != PW_OK) return r->error->status;
    if (v[0] == NULL || v[2] == NULL) return read_fail (r, n->at, "a preset needs a name and settings");
    p->about = "";
    pw_yaml_text (r, v[0], "name", &p->name);
    pw_yaml_text (r, v[1], "about", &p->about);
    if (head_settings (y, r, v[2], p) != PW_OK) return r->error->status;
  }
  return r->error->status;
}

static int read_head (pw_yaml *y, const pw_reader *r) {
  static const char *const key[] = { "pinwheel", "about",  "run",     "parameters", "let",   "bodies",  "elements",
                                     "truth",    "states", "include", "outputs",    "paths", "presets", NULL };
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
  const pw_node *parameters = v[3];
  /* the key of the reference solution is "truth" */
  y->let = v[4], y->bodies = v[5], y->elements = v[6], y->reference = v[7], y->states = v[8];
  y->include = v[9], y->outputs = v[10], y->paths = v[11];
  for (int i = 5; key[i]; i++)
    if (i != 7) pw_yaml_list (r, v[i], key[i]);
  for (int i = 3; key[i]; i++) /* from "parameters" on: lists and maps */
    if (v[i] && v[i]->count > PW_MAX_ITEMS)
      read_fail (r, v[i]->at, "%s: %d entries; a model may have %d", key[i], v[i]->count, PW_MAX_ITEMS);
  size_t count = parameters ? (size_t)parameters->count : 0;
  if (r->error->status == PW_OK && pw_names_open (&names, count) != PW_OK) read_no_memory (r);
  if (r->error->status == PW_OK) head_parameters (y, r, parameters, &names);
  if (r->error->status == PW_OK) head_presets (y, r, v[12]);
  pw_names_close (&names);
  return r->error->status;
}

/* ---- The model ---- */

static int build_let (pw_reader *r, const pw_node *map) {
  const char *name;
  double value;
  if (map->type != PW_YAML_MAP)
    return read_fail (r, map->at, "let: expected a map {NAME: NUMBER, ...}, found %s", pw_node_found (map));
  for (const pw_node *n = map->first; n; n = n->next->next) {
    if (pw_count_entry (r, n) != PW_OK || pw_yaml_name (r, n, "name", &name) != PW_OK) return r->error->status;
    if (pw_names_find (&r->scope->index, name) >= 0) return read_fail (r, n->at, "a second name \"%s\"", name);
    if (pw_yaml_number (r, n->next, PW_PRINTED (100, "let %s", name), PW_REAL, &value) != PW_OK)
      return r->error->status;
    if (pw_scope_reserve (r->scope, r->scope->names + 1, r->arena) != PW_OK) return read_no_memory (r);
    pw_scope_add (r->scope, name, value);
  }
  return PW_OK;
}

static read_entry build_include; /* it builds a model in this one */

/* Builds all lists of a file; included files come first, so that elements can connect their bodies. */
static int build_lists (pw_reader *r, const double *parameter) {
  const pw_yaml *y = r->y;
  for (int i = 0; i < y->parameter_count; i++) pw_scope_add (r->scope, y->table.parameters[i].name, parameter[i]);
  pw_yaml_entries (r, y->let, build_let);
  r->numbers = r->scope->names;
  pw_yaml_entries (r, y->paths, pw_yaml_path);
  pw_yaml_entries (r, y->states, index_state);
  pw_yaml_entries (r, y->include, build_include);
  for (int i = 0; y->include && i < r->scope->names && r->error->status == PW_OK; i++)
    if (pw_names_find (&r->states, r->scope->name[i]) >= 0)
      read_fail (r, y->include->at, "include: a state of a file has the name \"%s\" of a parameter or number of let",
                 r->scope->name[i]);
  if (r->error->status == PW_OK) pw_yaml_outputs (r);
  pw_yaml_entries (r, y->bodies, build_body);
  pw_yaml_entries (r, y->elements, build_element);
  return pw_yaml_entries (r, y->states, build_state);
}

/* Stores the parameters of an included file: their defaults, or numbers in `set`. */
static int include_parameters (pw_reader *r, const pw_yaml *file, const pw_node *set, double *value) {
  const pw_parameter *p = file->table.parameters;
  for (int i = 0; i < file->parameter_count; i++) value[i] = p[i].value;
  if (set && set->type != PW_YAML_MAP)
    return read_fail (r, set->at, "set: expected a map {PARAMETER: NUMBER, ...}, found %s", pw_node_found (set));
  for (const pw_node *n = set ? set->first : NULL; n && r->error->status == PW_OK; n = n->next->next) {
    const char *name = "";
    pw_nearest near = { .sought = "" };
    int i = 0;
    if (pw_yaml_text (r, n, "set", &name) != PW_OK) return r->error->status;
    for (near.sought = name; i < file->parameter_count && strcmp (p[i].name, name) != 0; i++)
      pw_nearest_try (&near, p[i].name);
    if (i == file->parameter_count)
      return read_fail (r, n->at, "set: the file has no parameter \"%.60s\"%s", name, pw_nearest_text (&near));
    pw_yaml_number (r, n->next, PW_PRINTED (100, "set: %s", name), p[i].domain, &value[i]);
  }
  return r->error->status;
}

static int include_build (pw_reader *r, pw_yaml *file, const pw_node *set, const char *prefix, const pw_place *place) {
  const pw_reader outer = *r;
  pw_scope scope = { 0 };
  double *value = NULL;
  r->copies = NULL, r->scope = NULL;
  read_head (file, r);
  r->copies = outer.copies, r->scope = outer.scope;
  if (r->error->status == PW_OK) value = pw_arena_alloc (r->arena, ((size_t)file->parameter_count + 1) * sizeof *value);
  if (value == NULL || pw_scope_reserve (&scope, file->parameter_count, r->arena) != PW_OK) read_no_memory (r);
  if (r->error->status == PW_OK && include_parameters (r, file, set, value) == PW_OK) {
    r->y = file, r->copies = NULL, r->scope = &scope, r->prefix = prefix, r->place = place;
    build_lists (r, value);
    for (int i = 0; i < scope.names && r->error->status == PW_OK; i++) /* expressions of the outer file may use them */
      if (scope.path[i] && (i == 0 || scope.path[i] != scope.path[i - 1])) /* not a path's second name */
        pw_yaml_name_path (r, outer.scope, outer.prefix, scope.name[i], scope.path[i]);
    r->y = outer.y, r->copies = outer.copies, r->scope = outer.scope, r->prefix = outer.prefix, r->place = outer.place,
    r->numbers = outer.numbers;
    r->has_index = 0; /* elements of the outer file come later */
  }
  pw_scope_close (&scope);
  return r->error->status;
}

/* An included file: {file: NAME, prefix: TEXT, set: {PARAMETER: NUMBER, ...}, at: [x, y], phi: ANGLE}. */
static int build_include (pw_reader *r, const pw_node *node) {
  static const char *const key[] = { "file", "prefix", "set", "at", "phi", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  const char *prefix = "";
  double at[2] = { 0 }, phi = 0;
  if (pw_yaml_keys (r, node, key, "an included file", v) != PW_OK) return r->error->status;
  if (v[0] == NULL) return read_fail (r, node->at, "an included file needs \"file\", its path");
  if (!v[0]->is_file)
    return read_fail (r, v[0]->at, "file: expected the path of a file, found %s", pw_node_found (v[0]));
  pw_yaml_text (r, v[1], "prefix", &prefix);
  pw_yaml_pair (r, v[3], "at", "numbers, [x, y]", at);
  if (pw_yaml_number (r, v[4], "phi", PW_REAL, &phi) != PW_OK || pw_count_entry (r, node) != PW_OK)
    return r->error->status;
  if (*prefix && !pw_expression_is_name (prefix))
    return read_fail (r, v[1]->at, "prefix \"%.60s\": expected a letter, then letters, digits and _", prefix);
  const pw_place place = place_in (r->place, at, phi);
  pw_yaml file = *r->y; /* the same source, with other lists */
  file.arena = (pw_arena){ 0 };
  file.root = v[0], file.parameter_count = 0;
  prefix = pw_yaml_prefixed (r, prefix);
  int status = prefix ? include_build (r, &file, v[2], prefix, &place) : read_no_memory (r);
  pw_arena_free (&file.arena);
  return status;
}

static void build_free (void *arena) {
  pw_arena_free (arena);
  free (arena);
}

/* Allocates the memory for building, and the arena for what lives as long as the model. */
static int build_open (pw_reader *r) {
  const pw_yaml *y = r->y;
  size_t largest = 1;
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    if ((*k)->definition > largest) largest = (*k)->definition;
  r->arena = calloc (1, sizeof *r->arena);
  if (r->arena == NULL || pw_model_keep (r->model, r->arena, build_free) != PW_OK) return read_no_memory (r);
  r->reference = pw_arena_alloc (r->arena, sizeof *r->reference);
  pw_model_set_reference (r->model, r->reference);
  r->definition = malloc (largest);
  if (r->reference && r->definition && pw_scope_reserve (r->scope, y->parameter_count, r->arena) == PW_OK)
    return pw_count_entry (r, y->root); /* opens the tables of names */
  return read_no_memory (r);
}

/* The build function; the parameters are numbers in the order of the table. */
static void build_model (pw_model *m, const void *parameters) {
  const void *table = pw_model_table (m);
  pw_scope scope = { 0 };
  pw_reader r = { .y = table, .model = m, .scope = &scope, .prefix = "", .error = pw_model_error (m) };
  if (build_open (&r) == PW_OK && build_lists (&r, parameters) == PW_OK && pw_add_outputs (&r) == PW_OK)
    read_reference (&r);
  pw_scope_close (&scope);
  pw_names_close (&r.bodies);
  pw_names_close (&r.states);
  pw_names_close (&r.truth);
  pw_names_close (&r.names);
  pw_names_close (&r.elements);
  pw_names_close (&r.contacts);
  pw_names_close (&r.outputs);
  free (r.output);
  free (r.definition);
}

void pw_yaml_close (pw_yaml *y) {
  if (y == NULL) return;
  pw_arena_free (&y->arena);
  free (y->source);
  free (y);
}

pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t max_bytes, pw_error *error) {
  pw_yaml *y = calloc (1, sizeof *y);
  if (y == NULL) return pw_fail (error, PW_RESOURCE, "out of memory"), NULL;
  y->max_ahead = MAX_AHEAD * fmax (1, (double)max_bytes / PW_FILE_DEFAULT_BYTES);
  y->table = (pw_plugin_table){ .abi = PW_ABI, .size = sizeof y->table, .build = build_model };
  if (pw_yaml_read_files (y, path, shown, max_bytes, error) == PW_OK &&
      read_head (y, &(pw_reader){ .y = y, .error = error }) == PW_OK)
    return y;
  pw_yaml_close (y);
  return NULL;
}
