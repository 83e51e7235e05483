/* Reads text models from the tree of a file: keys and numbers; signals; bodies and elements, through the field tables
 * of their types; the head, parameters and default run settings, which is stored in a plug-in's table, so that text
 * models can be used like compiled ones.
 *
 * After an error, functions with the same reader return its status, and only the first error is recorded: a sequence of
 * calls needs one check.  `label` ("torque T: value") begins their messages.  A NULL node is absent. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "expression.h"
#include "yaml.h"

/* Limits of one model, about 1 GB each, so that a small file cannot use all memory: entries of each list, such as
 * bodies, elements, parameters; points of all tables; operations of all expressions; copies of an entry; all entries,
 * with copies and included files; bytes of texts in copies. */
enum { MAX_ITEMS = 1000000, MAX_POINTS = 20000000, MAX_OPERATIONS = 30000000 };
enum { MAX_COPIES = 100000, MAX_ENTRIES = 2000000 };
#define MAX_COPIED 4e8
#define MAX_AHEAD 1e6 /* pw_yaml.max_ahead for the default limit of bytes: each indicator takes 350 bytes */

enum { MAX_KEYS = 40 /* known keys of a map, and the end of their list */ };

/* What functions share while a file is read or a model is built from it. */
typedef struct {
  const pw_yaml *y;
  pw_error *error;
  pw_scope *scope;       /* parameters and what `let` defines so far, or NULL */
  pw_copies *copies;     /* of the entry being read, or NULL */
  const char *prefix;    /* of names in an included file, or "" */
  const pw_place *place; /* of the included file, or NULL */
  /* for building */
  pw_model *model;
  pw_arena *arena;              /* lives as long as the model */
  pw_reference_text *reference; /* the model's */
  pw_names bodies;              /* names of bodies so far, to their indices */
  pw_names states;              /* names of all first-order states */
  pw_names names;               /* of bodies and elements so far, to their offsets in the source */
  pw_names truth;               /* states in the reference solution so far */
  pw_names elements;     /* of elements with states so far, or more (state_elements), to the index of their types */
  const pw_kind *kind;   /* of the element being read */
  const pw_field *field; /* of it */
  const char *label;     /* of that field, for messages */
  char *definition;      /* of the element, with all preceding fields */
  double points;         /* of all tables so far */
  double operations;     /* of all expressions so far */
  int entries;           /* of all lists so far, and copies of them */
  int has_index;         /* 1: `elements` has those of this file */
  int indexed;           /* elements that were indexed, with copies */
  double copied;         /* bytes of texts in copies before r->copies */
} reader;

#define read_fail(r, at, ...) pw_yaml_fail ((r)->y, (r)->error, at, __VA_ARGS__)

/* Appends to a text in an array, as far as it fits. */
#define append(text, ...) pw_print (text + strlen (text), sizeof text - strlen (text), __VA_ARGS__)

static int read_no_memory (const reader *r) {
  return pw_yaml_no_memory (r->y, r->error);
}

/* ---- Keys and lists ---- */

/* What a node is, for messages. */
static const char *node_found (const pw_node *node) {
  return node->type == PW_YAML_LIST ? "a list" : node->type == PW_YAML_MAP ? "a map" : "text";
}

static int node_is (const pw_node *node, const char *text) {
  return node->type == PW_YAML_SCALAR && strcmp (node->text, text) == 0;
}

static int read_key (const reader *r, const pw_node *node, const char *const *key, const char *owner,
                     const pw_node **value) {
  if (node->type != PW_YAML_SCALAR)
    return read_fail (r, node->at, "expected a key of %s, found %s", owner, node_found (node));
  for (int i = 0; key[i]; i++) {
    if (strcmp (key[i], node->text) != 0) continue;
    if (value[i]) return read_fail (r, node->at, "\"%s\" appears twice", key[i]);
    value[i] = node->next;
    return node_is (node->next, "") && !node->next->quoted ? read_fail (r, node->at, "\"%s\" has no value", key[i])
                                                           : PW_OK;
  }
  pw_nearest near = { .sought = node->text };
  for (int i = 0; key[i]; i++) pw_nearest_try (&near, key[i]);
  const char *hint = pw_yaml_key_hint (node->text, key);
  return read_fail (r, node->at, "%s has no \"%.60s\"%s", owner, node->text, *hint ? hint : pw_nearest_text (&near));
}

/* Finds known keys (ending with NULL) in the pairs from a node on: value[i] becomes the value of key[i], or NULL.
 * Other keys, repeated keys and empty values are refused; `owner` ("a body") is for messages. */
static int read_keys_from (const reader *r, const pw_node *first, const char *const *key, const char *owner,
                           const pw_node **value) {
  for (int i = 0; key[i]; i++) value[i] = NULL;
  for (const pw_node *n = first; n && r->error->status == PW_OK; n = n->next->next) read_key (r, n, key, owner, value);
  return r->error->status;
}

/* The same in a map. */
static int read_keys (const reader *r, const pw_node *map, const char *const *key, const char *owner,
                      const pw_node **value) {
  if (map && map->type != PW_YAML_MAP) {
    char form[160] = "{";
    for (int i = 0; key[i]; i++) append (form, "%s: ..%s", key[i], key[i + 1] ? ", " : "}");
    read_fail (r, map->at, "expected a map %s for %s, found %s", form, owner, node_found (map));
    map = NULL;
  }
  return read_keys_from (r, map ? map->first : NULL, key, owner, value);
}

static int read_list (const reader *r, const pw_node *node, const char *label) {
  if (node && node->type != PW_YAML_LIST)
    read_fail (r, node->at, "%s: expected a list, found %s", label, node_found (node));
  return r->error->status;
}

/* Refuses anything but a list of `count` entries, which are `items` ("bodies"). */
static int read_list_of (const reader *r, const pw_node *node, const char *label, int count, const char *items) {
  if (node && node->type != PW_YAML_LIST)
    read_fail (r, node->at, "%s: expected a list of %d %s, found %s", label, count, items, node_found (node));
  else if (node && node->count != count)
    read_fail (r, node->at, "%s: expected a list of %d %s, found one of %d", label, count, items, node->count);
  return r->error->status;
}

/* ---- Texts and numbers ---- */

/* A name of the file as it is in the model, or NULL if out of memory. */
static const char *read_prefixed (const reader *r, const char *name) {
  char *text = *r->prefix ? pw_arena_alloc (r->arena, strlen (r->prefix) + strlen (name) + 1) : NULL;
  return *r->prefix == 0 ? name : text ? strcat (strcpy (text, r->prefix), name) : NULL;
}

/* A scalar's text, not empty. */
static int read_text (const reader *r, const pw_node *node, const char *label, const char **text) {
  if (node == NULL) return r->error->status;
  if (node->type != PW_YAML_SCALAR || *node->text == 0)
    return read_fail (r, node->at, "%s: expected text, found %s", label,
                      node->type == PW_YAML_SCALAR ? "none" : node_found (node));
  *text = node->text;
  return r->error->status;
}

/* Converts an offset in a scalar's text to one in the source; that of the node if the source spells it otherwise. */
static size_t source_offset (const pw_yaml *y, const pw_node *node, size_t offset) {
  size_t at = node->at + (node->quoted != 0), n = strlen (node->text);
  return at + n <= y->size && strncmp (y->source + at, node->text, n) == 0 ? at + offset : node->at;
}

/* Whether a name in the model is that of a state: BODY.phi, or a first-order state. */
static int is_state (const reader *r, const char *name) {
  return strchr (name, '.') || (r->states.slot && pw_names_find (&r->states, name) >= 0);
}

/* The first name of the time t or of a state in an expression, or NULL. */
static const char *find_variable (const reader *r, const char *text) {
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    if (strcmp (name, "t") == 0 || is_state (r, PW_PRINTED (200, "%s%s", r->prefix ? r->prefix : "", name))) return p;
  return NULL;
}

/* Reads a name that expressions can use. */
static int read_name (const reader *r, const pw_node *node, const char *label, const char **name) {
  if (read_text (r, node, label, name) != PW_OK) return r->error->status;
  if (!pw_expression_is_name (*name))
    return read_fail (r, node->at, "%s \"%.60s\": expected a letter, then letters, digits and _, at most 63 in all",
                      label, *name);
  if (strcmp (*name, "t") == 0 || pw_expression_is_reserved (*name))
    return read_fail (r, node->at, "%s \"%s\": this name is reserved: %s", label, *name,
                      strcmp (*name, "t") == 0 ? "it is the time" : "a function or constant");
  return PW_OK;
}

/* Replaces the text of an error at an unknown name by the suggestion of a first-order state, if its name is near and
 * the parser suggests nothing. */
static void suggest_state (const reader *r, const char *text, pw_expression_error *error) {
  char name[PW_EXPRESSION_NAME];
  const char *rest = text + error->at;
  if (strncmp (error->text, "there is no \"", 13) != 0 || strstr (error->text, "did you mean")) return;
  if (pw_expression_next_name (&rest, name) != text + error->at) return;
  pw_nearest near = { .sought = name };
  for (const struct pw_name *e = r->states.slot, *end = e + r->states.size; e < end; e++)
    if (e->name) pw_nearest_try (&near, e->name);
  if (near.near) snprintf (error->text, sizeof error->text, "there is no \"%.60s\"%s", name, pw_nearest_text (&near));
}

/* A number of a domain: an expression of the names in r->scope. */
static int read_number (const reader *r, const pw_node *node, const char *label, pw_domain domain, double *value) {
  pw_expression_error error;
  if (node == NULL || r->error->status != PW_OK) return r->error->status;
  if (node->type != PW_YAML_SCALAR)
    return read_fail (r, node->at, "%s: expected a number, found %s", label, node_found (node));
  int status = r->copies ? pw_copies_number (r->copies, node, value, &error)
                         : pw_expression_constant (r->scope, node->text, value, &error);
  if (status == PW_RESOURCE) return read_no_memory (r);
  if (status == PW_INPUT) suggest_state (r, node->text, &error);
  if (status != PW_OK)
    return read_fail (r, source_offset (r->y, node, error.at), "%s: %s", label,
                      find_variable (r, node->text) == node->text + error.at
                          ? "only the value of a signal may depend on the time t or on states"
                          : error.text);
  const char *expected = pw_domain_check (domain, *value);
  return *expected ? read_fail (r, node->at, "%s = %g: expected %s", label, *value, expected) : PW_OK;
}

/* Two numbers: a list of `items`, "numbers, [x, y]". */
static int read_pair (const reader *r, const pw_node *node, const char *label, const char *items, double *value) {
  if (node == NULL || read_list_of (r, node, label, 2, items) != PW_OK) return r->error->status;
  read_number (r, node->first, label, PW_REAL, value);
  return read_number (r, node->first->next, label, PW_REAL, value + 1);
}

/* One of `choices`, which end with NULL, as its index. */
static int read_choice (const reader *r, const pw_node *node, const char *label, const char *const *choices,
                        int *value) {
  char hint[PW_HINT];
  const char *text = "";
  if (node == NULL || read_text (r, node, label, &text) != PW_OK) return r->error->status;
  int i = pw_find_name (choices, sizeof *choices, text, hint);
  if (i < 0) return read_fail (r, node->at, "%s: there is no choice \"%.60s\"%s", label, text, hint);
  *value = i;
  return PW_OK;
}

/* The index of the element type that a scalar names, or -1. */
static int find_kind (const pw_node *node) {
  for (int i = 0; pw_kinds[i]; i++)
    if (node_is (node, pw_kinds[i]->name)) return i;
  return -1;
}

/* Adds the names of all bodies so far to the valid names of a suggestion. */
static void suggest_bodies (const reader *r, pw_nearest *near) {
  int bodies;
  const pw_body *body = pw_model_bodies (r->model, &bodies);
  for (int i = 0; i < bodies; i++) pw_nearest_try (near, body[i].name);
}

/* ---- Entries of lists, and their copies ---- */

/* Counts an entry, for which the tables of names get room. */
static int count_entry (reader *r, const pw_node *node) {
  const size_t room = (size_t)++r->entries;
  if (r->entries > MAX_ENTRIES)
    return read_fail (r, node->at, "the lists and copies up to here have more than %d entries, the limit for a model",
                      MAX_ENTRIES);
  return pw_names_reserve (&r->bodies, room) == PW_OK && pw_names_reserve (&r->names, room) == PW_OK &&
                 pw_names_reserve (&r->states, room) == PW_OK && pw_names_reserve (&r->elements, room) == PW_OK
             ? PW_OK
             : read_no_memory (r);
}

/* Reads `repeat`, {COUNTER: NUMBER}. */
static int read_repeat (reader *r, const pw_node *repeat, const char **counter, int *count) {
  const pw_node *map = repeat->next;
  double number = 0;
  if (map->type != PW_YAML_MAP || map->count != 1)
    return read_fail (r, map->at, "repeat: expected a map {COUNTER: NUMBER}, such as {i: 3}, found %s",
                      map->type == PW_YAML_MAP ? "one with another number of entries" : node_found (map));
  if (read_name (r, map->first, "repeat", counter) != PW_OK) return r->error->status;
  if (pw_names_find (&r->scope->index, *counter) >= 0 || is_state (r, *counter))
    return read_fail (r, map->first->at, "repeat: a parameter, number of let or state has the name \"%s\"", *counter);
  const char *label = PW_PRINTED (100, "repeat: %s", *counter);
  if (read_number (r, map->first->next, label, PW_NONNEGATIVE, &number) != PW_OK) return r->error->status;
  if (number > MAX_COPIES || number != floor (number))
    return read_fail (r, map->first->next->at, "%s = %.15g: expected a whole number from 0 to %d", label, number,
                      MAX_COPIES);
  *count = (int)number;
  return PW_OK;
}

typedef int read_entry (reader *r, const pw_node *entry);

/* Calls `each` with an entry or, if that is {list: [..]}, with those of the list. */
static int read_copy (reader *r, const pw_node *entry, read_entry *each) {
  const pw_node *list = entry->first && node_is (entry->first, "list") ? entry->first->next : NULL;
  if (list == NULL) return each (r, entry);
  if (read_list (r, list, "list") != PW_OK) return r->error->status;
  if (list->next) return read_fail (r, list->next->at, "a repeated list has no other keys");
  for (const pw_node *n = list->first; n && r->error->status == PW_OK; n = n->next) each (r, n);
  return r->error->status;
}

/* Calls `each` with the copies of an entry. */
static int read_copies (reader *r, const pw_node *entry, const pw_node *repeat, read_entry *each) {
  pw_copies c = { .scope = r->scope, .arena = r->arena, .repeat = repeat }, *outer = r->copies;
  int count = 0, status;
  r->copies = NULL; /* also where an entry of another list is being read */
  if (read_repeat (r, repeat, &c.counter, &count) != PW_OK) return r->error->status;
  status = count ? pw_copies_open (&c, entry) : PW_OK;
  for (int i = 1; i <= count && status == PW_OK && r->error->status == PW_OK; i++) {
    if ((status = pw_copies_set (&c, i)) != PW_OK) break;
    r->copies = &c;
    if (r->copied + c.bytes > MAX_COPIED)
      read_fail (r, entry->at, "the copies up to here have texts of more than %g MB, the limit for a model",
                 MAX_COPIED / 1e6);
    else
      read_copy (r, c.entry, each);
    r->copies = NULL;
  }
  if (status == PW_INPUT) read_fail (r, source_offset (r->y, c.faulty, c.fault.at), "%s", c.fault.text);
  if (status == PW_RESOURCE) read_no_memory (r);
  r->copied += c.bytes;
  r->copies = outer;
  return r->error->status;
}

/* Calls `each` with the entries of a list, or a map in its place, until an error. */
static int read_entries (reader *r, const pw_node *list, read_entry *each) {
  const pw_node *first = list && list->type == PW_YAML_LIST ? list->first : list;
  for (const pw_node *n = first; n && r->error->status == PW_OK; n = n == list ? NULL : n->next) {
    const pw_node *repeat = pw_yaml_repeat (n);
    if (repeat)
      read_copies (r, n, repeat, each);
    else
      each (r, n);
  }
  return r->error->status;
}

/* ---- Expressions of time and, in forces, of states: BODY.phi, ELEMENT.spin ---- */

/* Reports an error at an offset of the expression, or name, in a node. */
#define expression_fail(r, node, at, ...) \
  read_fail (r, source_offset ((r)->y, node, at), "%s: %s", (r)->label, PW_PRINTED (300, __VA_ARGS__))

/* The node of an expression with the names as they are in the model. */
static int read_renamed (reader *r, const pw_node *node, pw_node *renamed) {
  const pw_renames names = { r->copies, r->prefix, &r->states, r->scope };
  const char *text = "";
  if (read_text (r, node, r->label, &text) != PW_OK) return r->error->status;
  *renamed = *node;
  renamed->text = pw_yaml_renamed (&names, text, r->arena);
  return renamed->text ? PW_OK : read_no_memory (r);
}

/* Reads an expression; `variable`: names, which end with NULL. */
static int read_expression (reader *r, const pw_node *node, const char *const *variable, const char **text,
                            const pw_expression **expression) {
  pw_expression_error error;
  if (read_text (r, node, r->label, text) != PW_OK) return r->error->status;
  int status = pw_expression_read (r->scope, variable, *text, r->arena, expression, &error);
  if (status == PW_INPUT) suggest_state (r, *text, &error);
  if (status == PW_INPUT) return expression_fail (r, node, error.at, "%s", error.text);
  if (status != PW_OK) return read_no_memory (r);
  if ((r->operations += (*expression)->codes) <= MAX_OPERATIONS) return PW_OK;
  return read_fail (r, node->at, "%s: the expressions up to here have more than %d operations, the limit for a model",
                    r->label, MAX_OPERATIONS);
}

static int index_element (reader *r, const pw_node *n) {
  const pw_node *key = n->type == PW_YAML_MAP ? n->first : NULL;
  int kind = key && key->next->type == PW_YAML_SCALAR ? find_kind (key) : -1;
  const char *name = kind < 0 ? NULL : read_prefixed (r, key->next->text);
  if (++r->indexed > MAX_ENTRIES) return read_fail (r, n->at, "more than %d elements", MAX_ENTRIES);
  if (kind < 0) return PW_OK; /* an error that is reported later */
  if (name == NULL || pw_names_reserve (&r->elements, (size_t)(r->entries + r->indexed)) != PW_OK)
    return read_no_memory (r);
  pw_names_add (&r->elements, name, kind);
  return PW_OK;
}

/* Indexes all elements of the file, including those not built yet, besides those of files built before. */
static int state_elements (reader *r) {
  if (r->has_index) return PW_OK;
  r->has_index = 1;
  return read_entries (r, r->y->elements, index_element);
}

static int state_of_element (reader *r, const pw_node *node, const char *owner, const char *part, size_t at) {
  char list[200] = "";
  if (state_elements (r) != PW_OK) return r->error->status;
  int found = pw_names_find (&r->elements, owner);
  if (found < 0) {
    pw_nearest near = { .sought = owner };
    suggest_bodies (r, &near);
    for (const struct pw_name *e = r->elements.slot, *end = e + r->elements.size; e < end; e++)
      if (e->name && pw_kinds[e->value]->internal > 0) pw_nearest_try (&near, e->name);
    return expression_fail (r, node, at, "there is no body \"%s\"%s", owner, pw_nearest_text (&near));
  }
  const pw_kind *kind = pw_kinds[found];
  if (kind->internal == 0) return expression_fail (r, node, at, "%s %s has no states", kind->name, owner);
  for (int i = 0; i < kind->internal; i++) {
    const pw_quantity *state = &kind->coordinate[i];
    if (strcmp (part, state->name) == 0 || strcmp (part, state->rate) == 0) return PW_OK;
    append (list, "%s%s, %s", i ? ", " : "", state->name, state->rate);
  }
  return expression_fail (r, node, at + strlen (owner) + 1, "the states of %s %s are %s, not \"%.30s\"", kind->name,
                          owner, list, part);
}

/* The number of a body's state, 0 to 5 for x to omega, or -1. */
static int state_of_body (const char *part) {
  static const char *const parts[] = { "x", "y", "phi", "vx", "vy", "omega" };
  int i = 0;
  while (i < 6 && strcmp (parts[i], part) != 0) i++;
  return i < 6 ? i : -1;
}

/* Checks that a name with a dot, or that of a first-order state, at an offset of the expression, names a state. */
static int state_check (reader *r, const pw_node *node, const char *name, size_t at) {
  size_t n = strcspn (name, ".");
  if (name[n] == 0 && is_state (r, name)) return PW_OK;
  const char *owner = PW_PRINTED (100, "%.*s", (int)n, name);
  if (pw_names_find (&r->bodies, owner) < 0) return state_of_element (r, node, owner, name + n + 1, at);
  if (state_of_body (name + n + 1) >= 0) return PW_OK;
  return expression_fail (r, node, at + n + 1, "a body's states are x, y, phi, vx, vy and omega, not \"%.30s\"",
                          name + n + 1);
}

/* Whether the name of a state is that of a velocity, not of a coordinate or a first-order state. */
static int is_velocity (const reader *r, const char *name) {
  const char *dot = strchr (name, '.'), *part = dot ? dot + 1 : "";
  const char *owner = PW_PRINTED (100, "%.*s", dot ? (int)(dot - name) : 0, name);
  if (dot == NULL) return 0;
  if (pw_names_find (&r->bodies, owner) >= 0) return state_of_body (part) >= 3;
  const int kind = pw_names_find (&r->elements, owner);
  for (int i = 0; kind >= 0 && i < pw_kinds[kind]->internal; i++)
    if (strcmp (part, pw_kinds[kind]->coordinate[i].rate) == 0) return 1;
  return 0;
}

/* ---- Signals that are expressions ---- */

/* Adds a state, at an offset of the expression, unless it is known already. */
static int signal_add_state (reader *r, const pw_node *node, pw_signal_function *f, const char *name, size_t at) {
  for (int i = 1; i <= f->states; i++)
    if (strcmp (f->name[i], name) == 0) return PW_OK;
  if (f->derivatives > 1 || (f->derivatives && !pw_kind_signals_feedback (r->kind)))
    return expression_fail (r, node, at, "\"%s\": the signal of a position constraint depends on the time t alone",
                            name);
  if (state_check (r, node, name, at) != PW_OK) return r->error->status;
  if (f->derivatives && is_velocity (r, name))
    return expression_fail (r, node, at,
                            "\"%s\": the signal of a velocity constraint depends on positions and first-order states, "
                            "not on velocities; use a state that follows it, {name: NAME, rate: (%s - NAME)/TIME}",
                            name, name);
  if (f->states == PW_SIGNAL_STATES) return expression_fail (r, node, at, "more than %d states", PW_SIGNAL_STATES);
  f->name[f->states + 1] = pw_arena_copy (r->arena, name);
  return f->name[++f->states] ? PW_OK : read_no_memory (r);
}

static int signal_expression (reader *r, const pw_node *written, pw_signal_function *f, int i) {
  pw_node copy;
  const pw_node *node = &copy;
  char name[PW_EXPRESSION_NAME];
  if (read_renamed (r, written, &copy) != PW_OK) return r->error->status;
  const char *source = node->text;
  for (const char *rest = source, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    if (is_state (r, name) && signal_add_state (r, node, f, name, (size_t)(p - source)) != PW_OK)
      return r->error->status;
  if (read_expression (r, node, f->name, &f->text.part[i], &f->expression[i]) != PW_OK) return r->error->status;
  const pw_expression *expression = f->expression[i];
  if (expression->jump == NULL || f->text.jump) return PW_OK;
  char *jump = pw_arena_alloc (r->arena, (size_t)expression->jump_size + 1);
  f->text.jump = jump ? memcpy (jump, expression->jump, (size_t)expression->jump_size) : NULL;
  return jump ? PW_OK : read_no_memory (r);
}

/* Makes a signal from expressions: value; rate and acceleration, or NULL. */
static int signal_of_time (reader *r, const pw_node *const node[3], pw_signal *signal) {
  static const char *const key[] = { "expression", "rate", "acceleration" };
  char fault[PW_SIGNAL_FAULT] = "";
  pw_signal_function *f = pw_arena_alloc (r->arena, sizeof *f);
  if (f == NULL) return read_no_memory (r);
  f->name[0] = "t";
  f->derivatives = pw_kind_signals_force (r->kind) ? 0 : r->kind->level == PW_HOLONOMIC ? 2 : 1;
  *signal = (pw_signal){ PW_FUNCTION, .function = { .eval = pw_yaml_signal_eval, .context = f, .text = &f->text } };
  signal->function.open = pw_yaml_signal_open;
  signal->function.close = free;
  for (int i = 0; i < 3; i++) {
    if (node[i] == NULL) continue;
    if (signal_expression (r, node[i], f, i) != PW_OK) return r->error->status;
    if (f->expression[i]->breaks) signal->function.breakpoint = pw_yaml_signal_breakpoint;
    if (i > 0 && f->derivatives && f->states)
      return read_fail (r, node[i]->at, "%s: a %s belongs to an expression of the time alone", r->label, key[i]);
    if (i > 0 && !f->states && *pw_yaml_signal_check_derivative (f, i, key[i], fault))
      return read_fail (r, node[i]->at, "%s: %s", r->label, fault);
  }
  if (f->states) signal->function.reads = f->name + 1;
  if (f->derivatives && *pw_yaml_signal_check_continuity (f, fault))
    return read_fail (r, node[0]->at, "%s: %s", r->label, fault);
  return PW_OK;
}

/* ---- Signals ----
 *
 *   3, "2 * M0"                                    a constant
 *   {constant: 3}                                  the same
 *   {harmonic: {amplitude: 3, omega: 2}}           and ramp, smooth-step, pulse: their fields are in signal.c
 *   {table: {points: [[0, 1], [2, 3]]}}            points
 *   {table: {file: M.csv, columns: [t, M]}}        points of a file, by default in columns 1 and 2
 *   {table: {file: M.csv, time: t, columns: [M]}}  the same
 *   "M0 * cos (omega * t)"                         an expression of the time t; in forces also of states: BODY.phi
 *   {expression: .., rate: .., acceleration: ..}   the same; in constraints, its time derivatives may be given */

/* Points in the model.  Returns their times, NULL after an error. */
static double *table_list (reader *r, const pw_node *list, pw_signal *s) {
  if (read_list (r, list, r->label) != PW_OK) return NULL;
  size_t bytes = (size_t)list->count * sizeof (double);
  double *t = pw_arena_alloc (r->arena, bytes), *value = pw_arena_alloc (r->arena, bytes);
  if (t == NULL || value == NULL) return read_no_memory (r), NULL;
  s->table.t = t;
  s->table.value = value;
  for (const pw_node *n = list->first; n; n = n->next) {
    double point[2] = { 0 };
    const char *label = PW_PRINTED (240, "%s: point %d", r->label, s->table.count + 1);
    if (read_pair (r, n, label, "numbers, [time, value]", point) != PW_OK) return NULL;
    t[s->table.count] = point[0];
    value[s->table.count++] = point[1];
  }
  return t;
}

/* The unit of the current field.  Only a drive has "m or rad"; the choice before this field decides. */
static const char *table_unit (const reader *r) {
  const pw_field *choice = r->field;
  if (choice->unit == NULL || strcmp (choice->unit, "m or rad") != 0) return choice->unit;
  while (choice->type != PW_CHOICE) choice--;
  int chosen = *(const int *)(const void *)(r->definition + choice->offset);
  return strcmp (choice->choices[chosen], "angle") == 0 ? "rad" : "m";
}

/* The columns of times and values: `columns` has both or, if `time` is given, perhaps that of the values alone; NULL by
 * default. */
static int table_columns (reader *r, const pw_node *columns, const pw_node *time, const char *column[2]) {
  const char *label = PW_PRINTED (240, "%s: columns", r->label);
  const int count = time && columns && columns->count != 2 ? 1 : 2;
  column[0] = column[1] = NULL;
  if (read_list_of (r, columns, label, count, count == 1 ? "column, [value]" : "columns, [time, value]") != PW_OK)
    return r->error->status;
  const pw_node *first = columns ? columns->first : NULL;
  read_text (r, time, PW_PRINTED (240, "%s: time", r->label), &column[0]);
  read_text (r, count == 2 && first ? first->next : first, label, &column[1]);
  if (count == 1 || r->error->status != PW_OK) return r->error->status;
  if (time && first && first->type == PW_YAML_SCALAR && strcmp (first->text, column[0]) != 0)
    return read_fail (r, first->at, "%s: the first one is that of the times, but time is \"%.60s\"", label, column[0]);
  return read_text (r, time ? NULL : first, label, &column[0]);
}

/* Points in two columns of a file; rows without a time or value are left out.  Returns the times, or NULL. */
static double *table_file (reader *r, const pw_node *node, const pw_node *columns, const pw_node *time, pw_signal *s) {
  char path[PW_PATH], from_model[PW_PATH];
  const char *name, *reason, *column[2], *const unit[2] = { "s", table_unit (r) };
  pw_error cause = { 0 };
  int rows;
  if (table_columns (r, columns, time, column) != PW_OK || read_text (r, node, r->label, &name) != PW_OK) return NULL;
  errno = 0;
  FILE *f = pw_yaml_find (r->y, node->at, name, path, from_model, &reason) ? pw_open_input (path, &reason) : NULL;
  if (f == NULL && pw_open_input_status () == PW_RESOURCE)
    return pw_fail (r->error, PW_RESOURCE, "%s: cannot read %s: %s", r->y->path, name, reason), NULL;
  if (f == NULL) return read_fail (r, node->at, "%s: cannot read \"%.60s\": %s", r->label, name, reason), NULL;
  double *t = pw_columns_from_stream (f, name, column, unit, 2, PW_GAPS_REFUSED, NULL, &rows, &cause);
  fclose (f);
  if (cause.status == PW_INPUT) return read_fail (r, node->at, "%s: %s", r->label, cause.text), NULL;
  if (t == NULL || pw_model_keep (r->model, t, free) != PW_OK) return read_no_memory (r), NULL;
  double *value = t + rows;
  int count = 0;
  for (int i = 0; i < rows; i++) {
    if (isnan (t[i]) || isnan (value[i])) continue;
    t[count] = t[i];
    value[count++] = value[i];
  }
  s->table.t = t, s->table.value = value, s->table.count = count, s->table.skipped = rows - count;
  return t;
}

/* Besides the fields of the form. */
static const char *const table_keys[] = { "points", "file", "columns", "time", "time_scale", "time_offset" };
enum { TABLE_KEYS = sizeof table_keys / sizeof *table_keys };

/* Reads points or columns of a file; the times become time_offset + time_scale t, where whole numbers of ms since an
 * epoch stay exact.  Limits the points of all tables together: many may read the same large file. */
static int table_points (reader *r, const pw_node *node, const pw_node *const v[TABLE_KEYS], pw_signal *s) {
  const pw_node *points = v[0], *file = v[1], *columns = v[2], *time = v[3]; /* as table_keys */
  double scale = 1, offset = 0;
  if ((points != NULL) == (file != NULL))
    return read_fail (r, node->at, "%s: a table has either points or a file", r->label);
  if (points && columns) return read_fail (r, columns->at, "%s: columns belong to a file", r->label);
  if (points && time) return read_fail (r, time->at, "%s: a column of times belongs to a file", r->label);
  double *t = points ? table_list (r, points, s) : table_file (r, file, columns, time, s);
  if (t == NULL) return r->error->status;
  read_number (r, v[4], PW_PRINTED (240, "%s: time_scale", r->label), PW_POSITIVE, &scale);
  read_number (r, v[5], PW_PRINTED (240, "%s: time_offset", r->label), PW_REAL, &offset);
  for (int i = 0; i < s->table.count; i++) t[i] = scale * (t[i] + offset / scale);
  r->points += s->table.count;
  if (r->error->status != PW_OK || r->points <= MAX_POINTS) return r->error->status;
  return read_fail (r, node->at, "%s: the tables up to here have more than %d points, the limit for a model", r->label,
                    MAX_POINTS);
}

/* Reads the fields of a form, except a table's points; value: of each, or NULL. */
static int signal_fields (reader *r, const pw_signal_form *form, const pw_node *node, const pw_node *const *value,
                          pw_signal *signal) {
  for (int i = 0; form->fields[i].name; i++) {
    const pw_field *f = &form->fields[i];
    void *at = (char *)signal + f->offset;
    const char *label = PW_PRINTED (240, "%s: %s", r->label, f->name);
    if (value[i] == NULL && f->required) read_fail (r, node->at, "%s is missing", label);
    if (f->type == PW_NUMBER) read_number (r, value[i], label, f->domain, at);
    if (f->type == PW_CHOICE) read_choice (r, value[i], label, f->choices, at);
    /* 0 in the structure stands for a scale that is not given, which is 1 */
    if (value[i] && form->type == PW_TABLE && strcmp (f->name, "scale") == 0 && signal->table.scale == 0)
      read_fail (r, value[i]->at, "%s: 0 is not permitted", label);
  }
  return r->error->status;
}

/* Reads a signal of one form; a table has more keys than fields.  An error of the whole is reported at the faulty point
 * of a table, or at the signal. */
static int signal_form (reader *r, const pw_signal_form *form, const pw_node *node, pw_signal *signal) {
  const char *key[MAX_KEYS];
  const pw_node *v[MAX_KEYS];
  char fault[300];
  int fields = 0, n, point, is_table = form->type == PW_TABLE;
  *signal = (pw_signal){ .type = form->type };
  for (const pw_field *f = form->fields; f->name; f++) key[fields++] = f->name;
  for (n = fields; is_table && n < fields + TABLE_KEYS; n++) key[n] = table_keys[n - fields];
  key[n] = NULL;
  if (read_keys (r, node, key, PW_PRINTED (100, "a %s", form->name), v) != PW_OK ||
      signal_fields (r, form, node, v, signal) != PW_OK ||
      (is_table && table_points (r, node, v + fields, signal) != PW_OK))
    return r->error->status;
  if (*pw_signal_check (signal, r->kind, &point, fault, sizeof fault) == 0) return PW_OK;
  const pw_node *faulty = is_table && v[fields] && point >= 0 ? v[fields]->first : NULL;
  for (int i = 0; faulty && i < point; i++) faulty = faulty->next;
  return read_fail (r, (faulty ? faulty : node)->at, "%s: %s", r->label, fault);
}

/* Keys of a signal in braces, such as {harmonic: {...}}; those from SIGNAL_FORMS on are the names of the forms. */
enum { SIGNAL_CONSTANT, SIGNAL_EXPRESSION, SIGNAL_RATE, SIGNAL_ACCELERATION, SIGNAL_FORMS };

static int signal_map (reader *r, const pw_node *node, pw_signal *signal) {
  const char *key[MAX_KEYS] = { "constant", "expression", "rate", "acceleration" };
  const pw_node *v[MAX_KEYS];
  char list[100] = "constant, expression";
  int n = SIGNAL_FORMS, given = 0, form = 0;
  for (const pw_signal_form *f = pw_signal_forms; f->name; f++) {
    append (list, ", %s", f->name);
    key[n++] = f->name;
  }
  key[n] = NULL;
  if (read_keys (r, node, key, "a signal", v) != PW_OK) return r->error->status;
  for (int i = 0; i < n; i++) {
    given += v[i] != NULL && i != SIGNAL_RATE && i != SIGNAL_ACCELERATION;
    if (v[i] && i >= SIGNAL_FORMS) form = i;
  }
  if (given != 1)
    return read_fail (r, node->at, "%s: expected one of %s; found %s", r->label, list, given ? "several" : "none");
  if (!v[SIGNAL_EXPRESSION] && (v[SIGNAL_RATE] || v[SIGNAL_ACCELERATION]))
    return read_fail (r, node->at, "%s: a rate or acceleration belongs to an expression", r->label);
  if (v[SIGNAL_CONSTANT]) return read_number (r, v[SIGNAL_CONSTANT], r->label, PW_REAL, &signal->constant);
  if (v[SIGNAL_EXPRESSION]) return signal_of_time (r, v + SIGNAL_EXPRESSION, signal);
  return signal_form (r, &pw_signal_forms[form - SIGNAL_FORMS], v[form], signal);
}

static int read_signal (reader *r, const pw_node *node, pw_signal *signal) {
  if (node->type == PW_YAML_MAP) return signal_map (r, node, signal);
  if (node->type == PW_YAML_SCALAR && find_variable (r, node->text))
    return signal_of_time (r, (const pw_node *const[3]){ node, NULL, NULL }, signal);
  return read_number (r, node, r->label, PW_REAL, &signal->constant);
}

/* ---- Reference solution: `truth`, a map of states to expressions of time, or a list of such maps ---- */

static double reference_eval (void *context, int i, double t) {
  const pw_expression *const *x = context;
  return pw_expression_value (x[i], &t);
}

static int reference_state (reader *r, const pw_node *n) {
  static const char *const time[] = { "t", NULL };
  pw_reference_text *t = r->reference;
  pw_node text;
  const char *name;
  if (read_text (r, n, "truth", &name) != PW_OK) return r->error->status;
  const pw_expression **x = t->context;
  if (!is_state (r, name))
    return read_fail (r, n->at, "truth: expected a state such as BODY.phi, found \"%.60s\"", name);
  r->label = "truth";
  if (state_check (r, n, name, 0) != PW_OK) return r->error->status;
  if (pw_names_add (&r->truth, name, 0) >= 0) return read_fail (r, n->at, "truth: a second \"%s\"", name);
  r->label = PW_PRINTED (100, "truth of %.60s", name);
  t->state[t->states] = name;
  if (read_renamed (r, n->next, &text) != PW_OK) return r->error->status;
  int status = read_expression (r, &text, time, &t->text[t->states], &x[t->states]);
  t->states += status == PW_OK;
  return status;
}

static int reference_entry (reader *r, const pw_node *map) {
  if (map->type != PW_YAML_MAP)
    return read_fail (r, map->at, "truth: expected a map {STATE: EXPRESSION, ...}, found %s", node_found (map));
  for (const pw_node *n = map->first; n && r->error->status == PW_OK; n = n->next->next)
    if (count_entry (r, n) == PW_OK) reference_state (r, n);
  return r->error->status;
}

/* Reads the reference solution, after bodies and elements. */
static int read_reference (reader *r) {
  pw_reference_text *t = r->reference;
  int bodies, elements;
  pw_model_bodies (r->model, &bodies);
  const pw_element *e = pw_model_elements (r->model, &elements);
  size_t room = 6 * (size_t)bodies + 1; /* all states */
  for (int i = 0; i < elements; i++) room += 2 * (size_t)e[i].kind->internal;
  t->eval = reference_eval;
  if (r->y->reference || r->operations > 0) /* expressions may use names, whose values `show` writes */
    t->names = r->scope->names, t->name = r->scope->name, t->value = r->scope->value;
  if (r->y->reference == NULL) return PW_OK;
  t->state = pw_arena_alloc (r->arena, room * sizeof *t->state);
  t->text = pw_arena_alloc (r->arena, room * sizeof *t->text);
  t->context = pw_arena_alloc (r->arena, room * sizeof (pw_expression *));
  if (t->state == NULL || t->text == NULL || t->context == NULL || pw_names_open (&r->truth, room) != PW_OK)
    return read_no_memory (r);
  return read_entries (r, r->y->reference, reference_entry);
}

/* ---- Bodies ----
 *
 * Bodies and elements are passed to pw_add_body and pw_add, like those of a build function in C.  The core checks them;
 * its messages get a position. */

/* Reads the name of a body or element, which must be unique. */
static int build_name (reader *r, const pw_node *node, const char *label, const char **name) {
  char part[PW_PATH];
  if (count_entry (r, node) != PW_OK || read_text (r, node, label, name) != PW_OK) return r->error->status;
  if (strchr (*name, '{'))
    return read_fail (r, node->at, "%s \"%.60s\": braces belong to an entry with the key repeat", label, *name);
  if ((*name = read_prefixed (r, *name)) == NULL) return read_no_memory (r);
  int before = pw_names_add (&r->names, *name, (int)node->at); /* files have less than INT_MAX bytes */
  if (before < 0) return PW_OK;
  if ((size_t)before == node->at && r->copies)
    return read_fail (r, node->at, "%s \"%.60s\": copies have the same name: write \"%.60s{%s}\"", label, *name,
                      node->text, r->copies->counter);
  pw_yaml_part (r->y, (size_t)before, part);
  return read_fail (r, node->at, "%s \"%.60s\": line %d%s%.60s already uses this name%s", label, *name,
                    pw_yaml_line (r->y, (size_t)before), *part ? " of " : "", part,
                    *part ? "; include it with another prefix" : "");
}

/* Reports an error of the core at a node, without its prefix "model NAME: ". */
static int build_fail (const reader *r, const pw_node *node, const pw_error *cause) {
  const char *prefix = PW_PRINTED (200, "model %s: ", pw_model_name (r->model)), *text = cause->text;
  if (cause->status == PW_RESOURCE) return pw_fail (r->error, cause->status, "%s", text);
  if (strncmp (text, prefix, strlen (prefix)) == 0) text += strlen (prefix);
  return read_fail (r, node->at, "%s", text);
}

/* A uniform bar between two points: {bar: NAME, from: [x, y], to: [x, y], mass: M}. */
static int build_bar (reader *r, const pw_node *name, const pw_node *from, const pw_node *to, pw_body *body) {
  double a[2], b[2];
  const char *label = PW_PRINTED (160, "bar %.60s", body->name);
  if (from == NULL || to == NULL) return read_fail (r, name->at, "%s needs two points, \"from\" and \"to\"", label);
  if (read_pair (r, from, label, "numbers, [x, y]", a) != PW_OK ||
      read_pair (r, to, label, "numbers, [x, y]", b) != PW_OK)
    return r->error->status;
  if (a[0] == b[0] && a[1] == b[1]) return read_fail (r, to->at, "%s: its two points are the same", label);
  pw_place_bar (body, a, b);
  return PW_OK;
}

static int build_body (reader *r, const pw_node *node) {
  static const char *const keys[] = { "name", "mass", "inertia", "start", "rate", NULL };
  static const char *const bar_keys[] = { "bar", "mass", "from", "to", "rate", NULL };
  static const char *const state[][4] = { { "x", "y", "phi", NULL }, { "vx", "vy", "omega", NULL } };
  const pw_node *v[sizeof keys / sizeof *keys];
  pw_body body = { .specified = PW_SPECIFIES_NOTHING };
  pw_error cause = { 0 };
  int bodies, is_bar = 0;
  for (const pw_node *n = node->type == PW_YAML_MAP ? node->first : NULL; n; n = n->next->next)
    is_bar |= node_is (n, "bar");
  const char *const *key = is_bar ? bar_keys : keys;
  if (read_keys (r, node, key, is_bar ? "a bar" : "a body", v) != PW_OK) return r->error->status;
  const pw_node *name = v[0];
  if (name == NULL) return read_fail (r, node->at, "a body needs a name");
  if (build_name (r, name, "body", &body.name) != PW_OK) return r->error->status;
  for (int i = 0; i < (is_bar ? 1 : 2); i++) {
    const char *label = PW_PRINTED (160, "body %.60s: %s", body.name, key[1 + i]);
    read_number (r, v[1 + i], label, PW_NONNEGATIVE, i ? &body.inertia : &body.mass);
  }
  if (is_bar && build_bar (r, name, v[2], v[3], &body) != PW_OK) return r->error->status;
  for (int i = is_bar; i < 2; i++) {
    const char *label = PW_PRINTED (160, "%s of body %.60s", key[3 + i], body.name);
    const pw_node *given[4];
    read_keys (r, v[3 + i], state[i], label, given);
    for (int k = 0; k < 3; k++) {
      if (given[k] == NULL) continue;
      double *value = (i ? body.rate : body.start) + k;
      read_number (r, given[k], PW_PRINTED (200, "%s: %s", label, state[i][k]), PW_REAL, value);
      body.specified |= 1u << (3 * i + k);
    }
  }
  if (r->error->status != PW_OK) return r->error->status;
  const char *alone = pw_place_body (r->place, &body);
  if (*alone)
    return read_fail (r, name->at, "body %.60s: in a file placed at an angle, %s are given both or neither", body.name,
                      alone);
  if (pw_model_check_body (r->model, &body, &cause) != PW_OK) return build_fail (r, name, &cause);
  pw_model_bodies (r->model, &bodies);
  pw_names_add (&r->bodies, body.name, bodies);
  return pw_add_body (r->model, &body);
}

/* ---- Elements ---- */

static int build_body_name (const reader *r, const pw_node *node, const char **name) {
  if (read_text (r, node, r->label, name) != PW_OK) return r->error->status;
  if (strcmp (*name, "ground") == 0) return PW_OK;
  if ((*name = read_prefixed (r, *name)) == NULL) return read_no_memory (r);
  if (pw_names_find (&r->bodies, *name) >= 0) return PW_OK;
  pw_nearest near = { .sought = *name };
  suggest_bodies (r, &near);
  pw_nearest_try (&near, "ground");
  return read_fail (r, node->at, "%s: there is no body \"%.60s\"%s", r->label, *name, pw_nearest_text (&near));
}

/* A point of body i: [x, y] in its frame, or {world: [x, y]} where it is at the start. */
static int build_point (reader *r, const pw_node *node, int i, double to[2]) {
  static const char *const key[] = { "world", NULL };
  const pw_node *world = NULL;
  const char *name = pw_place_body_of (r->kind, r->definition, i);
  if (node->type == PW_YAML_MAP && read_keys (r, node, key, "a point", &world) != PW_OK) return r->error->status;
  if (read_pair (r, world ? world : node, r->label, "numbers, [x, y]", to) != PW_OK || name == NULL)
    return r->error->status;
  if (r->place && (world || strcmp (name, "ground") == 0)) pw_place_point (r->place, to);
  if (world == NULL || strcmp (name, "ground") == 0) return PW_OK;
  int bodies;
  const pw_body *body = pw_model_bodies (r->model, &bodies) + pw_names_find (&r->bodies, name);
  if ((body->specified & 7) != 7)
    return read_fail (r, node->at, "%s: a point of the world needs x, y and phi in the start of body %s", r->label,
                      name);
  const pw_place place = pw_place_in (NULL, body->start, body->start[2]);
  pw_place_back (&place, to);
  return PW_OK;
}

static int build_value (reader *r, const pw_node *node, int i, void *to) {
  switch (r->field->type) {
  case PW_NUMBER:
    return read_number (r, node, r->label, r->field->domain, to);
  case PW_POINT:
    return build_point (r, node, i, to);
  case PW_VECTOR:
    return read_pair (r, node, r->label, "numbers, [x, y]", to);
  case PW_BODY:
    return build_body_name (r, node, to);
  case PW_SIGNAL:
    return read_signal (r, node, to);
  case PW_CHOICE:
    return read_choice (r, node, r->label, r->field->choices, to);
  case PW_TEXT:
    return read_text (r, node, r->label, to);
  }
  return read_fail (r, node->at, "%s cannot be given in a text model", r->label);
}

static int build_field (reader *r, const pw_node *node, const char *element) {
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
  if (count == 1) return build_value (r, node, 0, to);
  const int world = f->type == PW_POINT && node->type == PW_YAML_MAP; /* one point of all bodies */
  if (!world && read_list_of (r, node, r->label, count, plural[f->type]) != PW_OK) return r->error->status;
  const pw_node *n = world ? node : node->first;
  for (int i = 0; i < count; i++, to += pw_field_bytes (f->type), n = world ? n : n->next) build_value (r, n, i, to);
  return r->error->status;
}

/* Finds the element type, the first key. */
static int build_kind (reader *r, const pw_node *node) {
  const pw_node *first = node->type == PW_YAML_MAP ? node->first : NULL;
  if (first == NULL || first->type != PW_YAML_SCALAR)
    return read_fail (r, node->at, "expected an element {TYPE: NAME, ...}, found %s", node_found (node));
  int kind = find_kind (first);
  r->kind = kind < 0 ? NULL : pw_kinds[kind];
  if (r->kind == &pw_kind_state)
    return read_fail (r, first->at, "a state is not an element: list it under \"states\", {name: NAME, rate: ..}");
  if (r->kind) return PW_OK;
  for (const pw_node *n = first; n; n = n->next->next) { /* a type that appears later, also as {kind: wheel, ...} */
    kind = find_kind (node_is (n, "kind") || node_is (n, "type") ? n->next : n);
    if (kind >= 0)
      return read_fail (r, first->at, "an element begins with its type: write {%s: NAME, ...}", pw_kinds[kind]->name);
  }
  pw_nearest near = pw_yaml_nearest_kind (first->text);
  return read_fail (r, first->at, "an element begins with its type, and there is no type \"%.60s\"%s", first->text,
                    near.near ? pw_nearest_text (&near) : ": see pinwheel list kinds");
}

/* Adds an element of the type r->kind with the fields in the pairs from `first` on, to which the keys of a first-order
 * state add `name`; at: where an error of the whole is reported. */
static int build_fields (reader *r, const pw_node *at, const pw_node *node, const char *name, const pw_node *first) {
  const char *key[MAX_KEYS];
  const pw_node *v[MAX_KEYS];
  const pw_kind *kind = r->kind;
  pw_error cause = { 0 };
  int n = 0;
  memset (r->definition, 0, kind->definition);
  memcpy (r->definition, &name, sizeof name);
  for (const pw_field *f = kind->fields; f->name && n < MAX_KEYS - 2; f++) key[n++] = f->name;
  key[n] = kind == &pw_kind_state ? "name" : NULL, key[n + 1] = NULL;
  read_keys_from (r, first, key, PW_PRINTED (100, "a %s", kind->name), v);
  for (int i = 0; i < n && r->error->status == PW_OK; i++) {
    const pw_field *f = r->field = &kind->fields[i];
    if (v[i])
      build_field (r, v[i], name);
    else if (f->required || f->type == PW_BODY)
      read_fail (r, at->at, "%s %.60s needs \"%s\": %s", kind->name, name, f->name, f->about ? f->about : "");
  }
  if (r->error->status != PW_OK) return r->error->status;
  const char *direction = pw_place_direction (r->place, kind, r->definition);
  if (direction)
    return read_fail (r, node->at,
                      "%s %.60s: its \"%s\" refers to the ground, which does not turn with a file placed at an angle",
                      kind->name, name, direction);
  pw_element e = { kind, r->definition };
  if (pw_model_check_element (r->model, &e, &cause) != PW_OK) return build_fail (r, node, &cause);
  for (int i = 0; kind->internal > 0 && kind != &pw_kind_state && pw_kinds[i]; i++)
    if (pw_kinds[i] == kind) pw_names_add (&r->elements, name, i);
  return pw_add (r->model, kind, r->definition);
}

static int build_element (reader *r, const pw_node *node) {
  const char *name;
  if (build_kind (r, node) != PW_OK) return r->error->status;
  const pw_node *first = node->first;
  if (build_name (r, first->next, r->kind->name, &name) != PW_OK) return r->error->status;
  return build_fields (r, first, first->next, name, first->next->next);
}

/* ---- First-order states: a list of {name, rate, start, unit} ---- */

/* The node of a state's name, or NULL after an error. */
static const pw_node *state_name (const reader *r, const pw_node *node) {
  if (node->type != PW_YAML_MAP)
    return read_fail (r, node->at, "expected a state {name: NAME, rate: ..}, found %s", node_found (node)), NULL;
  for (const pw_node *n = node->first; n; n = n->next->next)
    if (node_is (n, "name")) return n->next;
  return read_fail (r, node->at, "a state needs a name"), NULL;
}

/* Indexes the name of a state, which signals of any element may read; expressions can use it. */
static int index_state (reader *r, const pw_node *n) {
  const pw_node *node = state_name (r, n);
  const char *name, *own;
  if (node == NULL || build_name (r, node, "state", &name) != PW_OK) return r->error->status;
  if (read_name (r, node, "state", &own) != PW_OK) return r->error->status;
  pw_names_add (&r->states, name, 0);
  if (pw_names_find (&r->scope->index, own) >= 0)
    return read_fail (r, node->at, "state \"%s\": a parameter or number of let has this name", name);
  return PW_OK;
}

static int build_state (reader *r, const pw_node *node) {
  const pw_node *name = state_name (r, node);
  const char *text = read_prefixed (r, name->text);
  r->kind = &pw_kind_state;
  return text ? build_fields (r, name, name, text, node->first) : read_no_memory (r);
}

/* ---- The head ---- */

/* A default must not depend on other parameters: --set would have to change it, too. */
static int head_default (const reader *r, const pw_node *node, const char *label, const pw_names *names,
                         pw_parameter *p) {
  const char *text = node->type == PW_YAML_SCALAR ? node->text : "";
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *at; (at = pw_expression_next_name (&rest, name)) != NULL;)
    if (pw_names_find (names, name) >= 0)
      return read_fail (r, source_offset (r->y, node, (size_t)(at - text)),
                        "%s: a default is made of numbers; what follows from parameters belongs in let", label);
  return read_number (r, node, label, p->domain, &p->value);
}

static int head_parameter (const reader *r, const pw_node *node, pw_names *names, pw_parameter *p) {
  static const char *const key[] = { "name", "value", "unit", "about", "domain", "min", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  if (read_keys (r, node, key, "a parameter", v) != PW_OK) return r->error->status;
  const pw_node *name = v[0], *value = v[1], *unit = v[2], *about = v[3], *domain = v[4], *min = v[5];
  int chosen = min ? PW_NONNEGATIVE : PW_REAL;
  if (name == NULL) return read_fail (r, node->at, "a parameter needs a name");
  if (read_name (r, name, "parameter", &p->name) != PW_OK) return r->error->status;
  if (pw_names_add (names, p->name, 0) >= 0) return read_fail (r, name->at, "a second parameter \"%s\"", p->name);
  p->unit = p->about = "";
  const char *label = PW_PRINTED (100, "parameter %s", p->name);
  if (value == NULL) return read_fail (r, node->at, "%s needs a value, its default", label);
  if (min && (!node_is (min, "0") || domain))
    return read_fail (r, min->at, "min: only 0 can be written, without a domain; \"domain: positive\" means > 0");
  read_choice (r, domain, "domain", pw_domain_names, &chosen);
  p->domain = (pw_domain)chosen;
  if (unit && read_text (r, unit, "unit", &p->unit) == PW_OK) pw_yaml_check_unit (r->y, unit, value, r->error);
  read_text (r, about, "about", &p->about);
  return head_default (r, value, label, names, p);
}

static int head_parameters (pw_yaml *y, const reader *r, const pw_node *list, pw_names *names) {
  if (read_list (r, list, "parameters") != PW_OK) return r->error->status;
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

static int read_head (pw_yaml *y, const reader *r) {
  static const char *const key[] = { "pinwheel", "about", "run",    "parameters", "let", "bodies",
                                     "elements", "truth", "states", "include",    NULL };
  static const char *const run_key[] = { "t_end", "step", "rtol", "method", NULL };
  const pw_node *v[sizeof key / sizeof *key], *run[sizeof run_key / sizeof *run_key];
  double *number[] = { &y->table.run.t_end, &y->table.run.step, &y->table.run.rtol };
  pw_names names = { .size = 0 };
  if (y->root == NULL) return read_fail (r, 0, "the file is empty; a model begins with \"pinwheel: 1\"");
  if (read_keys (r, y->root, key, "a model", v) != PW_OK) return r->error->status;
  if (v[0] == NULL) return read_fail (r, y->root->at, "\"pinwheel: 1\" is missing, the version of the format");
  if (!node_is (v[0], "1"))
    return read_fail (r, v[0]->at, "pinwheel: expected 1, the version of the format that this Pinwheel reads");
  read_text (r, v[1], "about", &y->table.about);
  read_keys (r, v[2], run_key, "run", run);
  for (int i = 0; i < 3; i++) read_number (r, run[i], run_key[i], PW_POSITIVE, number[i]);
  read_text (r, run[3], run_key[3], &y->table.run.method);
  const pw_node *parameters = v[3];
  /* the key of the reference solution is "truth" */
  y->let = v[4], y->bodies = v[5], y->elements = v[6], y->reference = v[7], y->states = v[8];
  y->include = v[9];
  for (int i = 5; key[i]; i++)
    if (i != 7) read_list (r, v[i], key[i]);
  for (int i = 3; key[i]; i++) /* from "parameters" on: lists and maps */
    if (v[i] && v[i]->count > MAX_ITEMS)
      read_fail (r, v[i]->at, "%s: %d entries; a model may have %d", key[i], v[i]->count, MAX_ITEMS);
  size_t count = parameters ? (size_t)parameters->count : 0;
  if (r->error->status == PW_OK && pw_names_open (&names, count) != PW_OK) read_no_memory (r);
  if (r->error->status == PW_OK) head_parameters (y, r, parameters, &names);
  pw_names_close (&names);
  return r->error->status;
}

/* ---- The model ---- */

/* Adds the numbers of a map {NAME: NUMBER, ...} to the scope. */
static int build_let (reader *r, const pw_node *map) {
  const char *name;
  double value;
  if (map->type != PW_YAML_MAP)
    return read_fail (r, map->at, "let: expected a map {NAME: NUMBER, ...}, found %s", node_found (map));
  for (const pw_node *n = map->first; n; n = n->next->next) {
    if (count_entry (r, n) != PW_OK || read_name (r, n, "name", &name) != PW_OK) return r->error->status;
    if (pw_names_find (&r->scope->index, name) >= 0) return read_fail (r, n->at, "a second name \"%s\"", name);
    if (read_number (r, n->next, PW_PRINTED (100, "let %s", name), PW_REAL, &value) != PW_OK) return r->error->status;
    if (pw_scope_reserve (r->scope, r->scope->names + 1, r->arena) != PW_OK) return read_no_memory (r);
    pw_scope_add (r->scope, name, value);
  }
  return PW_OK;
}

static read_entry build_include; /* it builds a model in this one */

/* Builds all lists of a file; included files come first, so that elements can connect their bodies. */
static int build_lists (reader *r, const double *parameter) {
  const pw_yaml *y = r->y;
  for (int i = 0; i < y->parameter_count; i++) pw_scope_add (r->scope, y->table.parameters[i].name, parameter[i]);
  read_entries (r, y->let, build_let);
  read_entries (r, y->states, index_state);
  read_entries (r, y->include, build_include);
  for (int i = 0; y->include && i < r->scope->names && r->error->status == PW_OK; i++)
    if (pw_names_find (&r->states, r->scope->name[i]) >= 0)
      read_fail (r, y->include->at, "include: a state of a file has the name \"%s\" of a parameter or number of let",
                 r->scope->name[i]);
  read_entries (r, y->bodies, build_body);
  read_entries (r, y->elements, build_element);
  return read_entries (r, y->states, build_state);
}

/* Stores the parameters of an included file: their defaults, or numbers in `set`. */
static int include_parameters (reader *r, const pw_yaml *file, const pw_node *set, double *value) {
  const pw_parameter *p = file->table.parameters;
  for (int i = 0; i < file->parameter_count; i++) value[i] = p[i].value;
  if (set && set->type != PW_YAML_MAP)
    return read_fail (r, set->at, "set: expected a map {PARAMETER: NUMBER, ...}, found %s", node_found (set));
  for (const pw_node *n = set ? set->first : NULL; n && r->error->status == PW_OK; n = n->next->next) {
    const char *name = "";
    pw_nearest near = { .sought = "" };
    int i = 0;
    if (read_text (r, n, "set", &name) != PW_OK) return r->error->status;
    for (near.sought = name; i < file->parameter_count && strcmp (p[i].name, name) != 0; i++)
      pw_nearest_try (&near, p[i].name);
    if (i == file->parameter_count)
      return read_fail (r, n->at, "set: the file has no parameter \"%.60s\"%s", name, pw_nearest_text (&near));
    read_number (r, n->next, PW_PRINTED (100, "set: %s", name), p[i].domain, &value[i]);
  }
  return r->error->status;
}

/* Builds the lists of an included file in the model. */
static int include_build (reader *r, pw_yaml *file, const pw_node *set, const char *prefix, const pw_place *place) {
  const reader outer = *r;
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
    r->y = outer.y, r->copies = outer.copies, r->scope = outer.scope, r->prefix = outer.prefix, r->place = outer.place;
    r->has_index = 0; /* elements of the outer file come later */
  }
  pw_scope_close (&scope);
  return r->error->status;
}

/* An included file: {file: NAME, prefix: TEXT, set: {PARAMETER: NUMBER, ...}, at: [x, y], phi: ANGLE}. */
static int build_include (reader *r, const pw_node *node) {
  static const char *const key[] = { "file", "prefix", "set", "at", "phi", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  const char *prefix = "";
  double at[2] = { 0 }, phi = 0;
  if (read_keys (r, node, key, "an included file", v) != PW_OK) return r->error->status;
  if (v[0] == NULL) return read_fail (r, node->at, "an included file needs \"file\", its path");
  if (!v[0]->is_file) return read_fail (r, v[0]->at, "file: expected the path of a file, found %s", node_found (v[0]));
  read_text (r, v[1], "prefix", &prefix);
  read_pair (r, v[3], "at", "numbers, [x, y]", at);
  if (read_number (r, v[4], "phi", PW_REAL, &phi) != PW_OK || count_entry (r, node) != PW_OK) return r->error->status;
  if (*prefix && !pw_expression_is_name (prefix))
    return read_fail (r, v[1]->at, "prefix \"%.60s\": expected a letter, then letters, digits and _", prefix);
  const pw_place place = pw_place_in (r->place, at, phi);
  pw_yaml file = *r->y; /* the same source, with other lists */
  file.arena = (pw_arena){ 0 };
  file.root = v[0], file.parameter_count = 0;
  prefix = read_prefixed (r, prefix);
  int status = prefix ? include_build (r, &file, v[2], prefix, &place) : read_no_memory (r);
  pw_arena_free (&file.arena);
  return status;
}

static void build_free (void *arena) {
  pw_arena_free (arena);
  free (arena);
}

/* Allocates the memory for building, and the arena for what lives as long as the model. */
static int build_open (reader *r) {
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
    return count_entry (r, y->root); /* opens the tables of names */
  return read_no_memory (r);
}

/* The build function; the parameters are numbers in the order of the table. */
static void build_model (pw_model *m, const void *parameters) {
  const void *table = pw_model_table (m);
  pw_scope scope = { 0 };
  reader r = { .y = table, .model = m, .scope = &scope, .prefix = "", .error = pw_model_error (m) };
  if (build_open (&r) == PW_OK && build_lists (&r, parameters) == PW_OK) read_reference (&r);
  pw_scope_close (&scope);
  pw_names_close (&r.bodies);
  pw_names_close (&r.states);
  pw_names_close (&r.truth);
  pw_names_close (&r.names);
  pw_names_close (&r.elements);
  free (r.definition);
}

/* ---- The file ---- */

pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t max_bytes, pw_error *error) {
  pw_yaml *y = calloc (1, sizeof *y);
  if (y == NULL) return pw_fail (error, PW_RESOURCE, "out of memory"), NULL;
  y->max_ahead = MAX_AHEAD * fmax (1, (double)max_bytes / PW_FILE_DEFAULT_BYTES);
  y->table = (pw_plugin_table){ .abi = PW_ABI, .size = sizeof y->table, .build = build_model };
  if (pw_yaml_read_files (y, path, shown, max_bytes, error) == PW_OK &&
      read_head (y, &(reader){ .y = y, .error = error }) == PW_OK)
    return y;
  pw_yaml_close (y);
  return NULL;
}
