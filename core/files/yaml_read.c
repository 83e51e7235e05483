/* Reads keys, lists with their copies, texts, numbers and names of text models. */
#include <math.h>
#include <stdlib.h>
#include "yaml_read.h"

/* Copies of an entry with the key `repeat`, for one value of a counter after another. */
typedef struct pw_copies {
  pw_arena *arena;       /* given */
  const pw_scope *scope; /* given: names besides the counter in numbers */
  const pw_node *repeat; /* given: the key */
  const char *counter;   /* given: its name */
  int i;                 /* its value */
  pw_node *entry;        /* the copy, without the key */
  struct pw_copy_text *text, **last;
  double bytes;          /* of the texts of all copies so far */
  const pw_node *faulty; /* after PW_INPUT: the text, and the error in it */
  pw_expression_error fault;
} pw_copies;

/* Copies differ only in texts with braces, such as "link{i - 1}".  The entry is therefore copied once, with a list of
 * these texts.  For each value of the counter only they are replaced. */
struct pw_copy_text {
  struct pw_copy_text *next;
  const pw_node *source; /* in the entry */
  pw_node *node;         /* in the copy */
};

enum { COPY_TEXT = 4000 /* bytes of a text with braces, at most */ };
#define COPY_NUMBER 1e9 /* largest number in braces */

/* Records an error at an offset of a text. */
#define copy_fail(c, node, offset, ...)                                                                         \
  ((c)->faulty = node, (c)->fault.at = offset, pw_print ((c)->fault.text, sizeof (c)->fault.text, __VA_ARGS__), \
   PW_INPUT)

/* The value of an expression, perhaps of the counter of copies, which is not its first variable: that is the time. */
static int copy_value (const pw_copies *c, const pw_scope *s, const char *text, double *value,
                       pw_expression_error *error) {
  return pw_expression_constant (s, c ? (const char *const[]){ "", c->counter, NULL } : NULL,
                                 (const double[]){ 0, c ? c->i : 0 }, text, value, error);
}

static int copy_text (pw_copies *c, const pw_node *source, pw_node *node) {
  struct pw_copy_text *t = *c->last = pw_arena_alloc (c->arena, sizeof *t);
  if (t == NULL) return PW_RESOURCE;
  if (strlen (source->text) > COPY_TEXT)
    return copy_fail (c, source, 0, "a text with braces has at most %d bytes", COPY_TEXT);
  *t = (struct pw_copy_text){ NULL, source, node };
  c->last = &t->next;
  return PW_OK;
}

/* The key `repeat` of an entry, or NULL. */
static const pw_node *copies_repeat (const pw_node *entry) {
  for (const pw_node *n = entry->type == PW_YAML_MAP ? entry->first : NULL; n; n = n->next->next)
    if (n->type == PW_YAML_SCALAR && strcmp (n->text, "repeat") == 0) return n;
  return NULL;
}

/* Copies `from` and the nodes after it, except the key `repeat` and its value, to the list *to. */
static int copy_nodes (pw_copies *c, const pw_node *from, pw_node **to) {
  int status = PW_OK;
  for (const pw_node *n = from; n && status == PW_OK; n = n->next) {
    if (n == c->repeat) {
      n = n->next;
      continue;
    }
    if (copies_repeat (n)) return copy_fail (c, copies_repeat (n), 0, "repeat: inside another repeat");
    if ((*to = pw_arena_alloc (c->arena, sizeof **to)) == NULL) return PW_RESOURCE;
    **to = *n;
    (*to)->next = NULL;
    if (n->type != PW_YAML_SCALAR && !n->is_file) /* the entries of a file are no copies */
      (*to)->first = NULL, status = copy_nodes (c, n->first, &(*to)->first);
    else if (n->type == PW_YAML_SCALAR && strchr (n->text, '{'))
      status = copy_text (c, n, *to);
    to = &(*to)->next;
  }
  return status;
}

static int copies_open (pw_copies *c, const pw_node *entry) {
  if ((c->entry = pw_arena_alloc (c->arena, sizeof *c->entry)) == NULL) return PW_RESOURCE;
  *c->entry = *entry;
  c->entry->next = c->entry->first = NULL;
  c->entry->count--;
  return copy_nodes (c, entry->first, &c->entry->first);
}

/* Writes the number in the braces that open at *at in a text, and moves *at behind them. */
static int copies_write_number (pw_copies *c, const pw_node *source, const char **at, char number[20]) {
  const char *begin = *at + 1;
  const size_t offset = (size_t)(begin - source->text), size = strcspn (begin, "}");
  double value = 0;
  if (begin[size] == 0) return copy_fail (c, source, offset - 1, "there is no \"}\" for this \"{\"");
  int status = copy_value (c, c->scope, pw_print_part ((char[COPY_TEXT + 1]){ 0 }, COPY_TEXT + 1, begin, size), &value,
                           &c->fault);
  c->faulty = source, c->fault.at += offset;
  if (status != PW_OK) return status;
  value += 0;                                                          /* not -0 */
  if (!(value >= 0 && value <= COPY_NUMBER && value == floor (value))) /* -1 would be a difference: "z-1" */
    return copy_fail (c, source, offset - 1, "the value in braces is %g for %s = %d: expected a whole number >= 0",
                      value, c->counter, c->i);
  *at = begin + size + 1;
  snprintf (number, 20, "%ld", (long)value);
  return PW_OK;
}

/* Makes c->entry the copy for this value.  Its texts stay in the arena. */
static int copies_set (pw_copies *c, int i) {
  char text[4 * COPY_TEXT]; /* at most 11 bytes of a number replace at least 3, "{i}" */
  c->i = i;
  for (const struct pw_copy_text *t = c->text; t; t = t->next) {
    char *end = text;
    for (const char *from = t->source->text; *from;) {
      const size_t n = strcspn (from, "{");
      memcpy (end, from, n);
      *(end += n) = 0, from += n;
      const int status = *from ? copies_write_number (c, t->source, &from, end) : PW_OK;
      if (status != PW_OK) return status;
      end += strlen (end);
    }
    c->bytes += (double)(end - text);
    if ((t->node->text = pw_arena_copy (c->arena, text)) == NULL) return PW_RESOURCE;
  }
  return PW_OK;
}

/* What replaces a name, or NULL. */
static const char *rename_of (const pw_reader *r, const pw_copies *c, const char *prefix, const char *name,
                              char to[200]) {
  if (c && strcmp (name, c->counter) == 0) return pw_print (to, 200, "(%d)", c->i);
  if (*prefix == 0) return NULL;
  pw_print (to, 200, "%s%s", prefix, name);
  if (strchr (name, '.') || pw_names_find (&r->states, to) >= 0 || pw_names_find (&r->outputs, to) >= 0) return to;
  int i = pw_names_find (&r->scope->index, name);
  return i < 0 || r->scope->path[i] ? NULL : pw_print (to, 200, "(%.17g)", r->scope->value[i]);
}

const char *pw_yaml_renamed (const pw_reader *r, const pw_copies *c, const char *prefix, const char *text) {
  char name[PW_EXPRESSION_NAME], to[200];
  size_t size = strlen (text) + 1;
  int changes = 0;
  for (const char *rest = text; pw_expression_next_word (&rest, name) != NULL;)
    if (rename_of (r, c, prefix, name, to)) size += strlen (to), changes++;
  if (changes == 0) return text;
  char *copy = pw_arena_alloc (r->arena, size), *end = copy;
  const char *from = text;
  for (const char *rest = text, *p; copy && (p = pw_expression_next_word (&rest, name)) != NULL;) {
    if (rename_of (r, c, prefix, name, to) == NULL) continue;
    end += sprintf (end, "%.*s%s", (int)(p - from), from, to);
    from = rest;
  }
  return copy ? strcpy (end, from), copy : NULL;
}

const char *pw_node_found (const pw_node *node) {
  return node->type == PW_YAML_LIST ? "a list" : node->type == PW_YAML_MAP ? "a map" : "text";
}

int pw_node_is (const pw_node *node, const char *text) {
  return node->type == PW_YAML_SCALAR && strcmp (node->text, text) == 0;
}

/* A hint for a text in place of one of these keys, which end with NULL; or "". */
static const char *key_hint (const char *text, const char *const *key) {
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
    return read_fail (r, node->at, "expected a key of %s, found %s", owner, pw_node_found (node));
  for (int i = 0; key[i]; i++) {
    if (strcmp (key[i], node->text) != 0) continue;
    if (value[i]) return read_fail (r, node->at, "\"%s\" appears twice", key[i]);
    value[i] = node->next;
    return pw_node_is (node->next, "") && !node->next->quoted ? read_fail (r, node->at, "\"%s\" has no value", key[i])
                                                              : PW_OK;
  }
  pw_nearest near = { .sought = node->text };
  for (int i = 0; key[i]; i++) pw_nearest_try (&near, key[i]);
  const char *hint = key_hint (node->text, key);
  return read_fail (r, node->at, "%s has no \"%.60s\"%s", owner, node->text, *hint ? hint : pw_nearest_text (&near));
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
    char form[300] = "{";
    for (int i = 0; key[i]; i++) append (form, "%s: ..%s", key[i], key[i + 1] ? ", " : "}");
    read_fail (r, map->at, "expected a map %s for %s, found %s", form, owner, pw_node_found (map));
    map = NULL;
  }
  return pw_yaml_keys_from (r, map ? map->first : NULL, key, owner, value);
}

int pw_yaml_list (const pw_reader *r, const pw_node *node, const char *label) {
  if (node && node->type != PW_YAML_LIST)
    read_fail (r, node->at, "%s: expected a list, found %s", label, pw_node_found (node));
  return r->error->status;
}

int pw_yaml_list_of (const pw_reader *r, const pw_node *node, const char *label, int count, const char *items) {
  if (node && node->type != PW_YAML_LIST)
    read_fail (r, node->at, "%s: expected a list of %d %s, found %s", label, count, items, pw_node_found (node));
  else if (node && node->count != count)
    read_fail (r, node->at, "%s: expected a list of %d %s, found one of %d", label, count, items, node->count);
  return r->error->status;
}

const char *pw_yaml_prefixed (const pw_reader *r, const char *name) {
  char *text = *r->prefix ? pw_arena_alloc (r->arena, strlen (r->prefix) + strlen (name) + 1) : NULL;
  return *r->prefix == 0 ? name : text ? strcat (strcpy (text, r->prefix), name) : NULL;
}

int pw_yaml_text (const pw_reader *r, const pw_node *node, const char *label, const char **text) {
  if (node == NULL) return r->error->status;
  if (node->type != PW_YAML_SCALAR || *node->text == 0)
    return read_fail (r, node->at, "%s: expected text, found %s", label,
                      node->type == PW_YAML_SCALAR ? "none" : pw_node_found (node));
  *text = node->text;
  return r->error->status;
}

size_t pw_source_offset (const pw_yaml *y, const pw_node *node, size_t offset) {
  size_t at = node->at + (node->quoted != 0), n = strlen (node->text);
  return at + n <= y->size && strncmp (y->source + at, node->text, n) == 0 ? at + offset : node->at;
}

int pw_is_state_name (const pw_reader *r, const char *name) {
  return strchr (name, '.') || (r->states.slot && pw_names_find (&r->states, name) >= 0);
}

const char *pw_signal_argument (const pw_reader *r) {
  return r->kind && r->kind->of_coordinate ? "s" : "t";
}

/* The first name of the time t, or another argument of a signal, or of a state in an expression, or NULL. */
static const char *find_variable (const pw_reader *r, const char *text) {
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    if (strcmp (name, pw_signal_argument (r)) == 0 ||
        pw_is_state_name (r, PW_PRINTED (200, "%s%s", r->prefix ? r->prefix : "", name)))
      return p;
  return NULL;
}

int pw_yaml_name (const pw_reader *r, const pw_node *node, const char *label, const char **name) {
  if (pw_yaml_text (r, node, label, name) != PW_OK) return r->error->status;
  if (!pw_expression_is_name (*name))
    return read_fail (r, node->at, "%s \"%.60s\": expected a letter, then letters, digits and _, at most 63 in all",
                      label, *name);
  if (strcmp (*name, "t") == 0 || pw_expression_is_reserved (*name))
    return read_fail (r, node->at, "%s \"%s\": this name is reserved: %s", label, *name,
                      strcmp (*name, "t") == 0 ? "it is the time" : "a function or constant");
  return PW_OK;
}

/* Replaces the text of an error at an unknown name by the suggestion of a first-order state or output, if its name is
 * near and the parser suggests nothing. */
static void suggest_state (const pw_reader *r, const char *text, pw_expression_error *error) {
  char name[PW_EXPRESSION_NAME];
  const char *rest = text + error->at;
  if (strncmp (error->text, "there is no \"", 13) != 0 || strstr (error->text, "did you mean")) return;
  if (pw_expression_next_name (&rest, name) != text + error->at) return;
  pw_nearest near = { .sought = name };
  for (const struct pw_name *e = r->states.slot, *end = e + r->states.size; e < end; e++)
    if (e->name) pw_nearest_try (&near, e->name);
  for (int i = 0; i < r->output_count; i++) pw_nearest_try (&near, r->output[i]->output.name);
  if (near.near) snprintf (error->text, sizeof error->text, "there is no \"%.60s\"%s", name, pw_nearest_text (&near));
}

/* Replaces the text of an error at a unit after a number by one that says that the field measures something else. */
static void refuse_unit (const pw_reader *r, const char *text, pw_expression_error *error) {
  const size_t sign = *text == '+' || *text == '-', n = sign + pw_number_size (text + sign);
  const char *unit = text + n + strspn (text + n, " ");
  if (n > sign && error->at == (size_t)(unit - text) && pw_names_find (&r->scope->index, unit) < 0 &&
      pw_unit_factor (unit, r->field->unit, &(double){ 0 }) == PW_RETRY)
    snprintf (error->text, sizeof error->text, "expected a number in %s, which %.40s does not measure", r->field->unit,
              unit);
}

int pw_yaml_varies (const pw_reader *r, const char *text) {
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text; pw_expression_next_name (&rest, name) != NULL;)
    if (r->outputs.slot && pw_names_find (&r->outputs, PW_JOINED (200, r->prefix, name)) >= 0) return 1;
  return find_variable (r, text) != NULL;
}

int pw_yaml_number (const pw_reader *r, const pw_node *node, const char *label, pw_domain domain, double *value) {
  pw_expression_error error;
  if (node == NULL || r->error->status != PW_OK) return r->error->status;
  if (node->type != PW_YAML_SCALAR)
    return read_fail (r, node->at, "%s: expected a number, found %s", label, pw_node_found (node));
  int status = copy_value (r->copies, r->scope, node->text, value, &error);
  if (status == PW_RESOURCE) return read_no_memory (r);
  if (status == PW_INPUT) suggest_state (r, node->text, &error);
  if (status == PW_INPUT && r->field && r->scope && label == r->label) refuse_unit (r, node->text, &error);
  if (status != PW_OK)
    return read_fail (r, pw_source_offset (r->y, node, error.at), "%s: %s", label,
                      find_variable (r, node->text) == node->text + error.at
                          ? "only the value of a signal may depend on the time t or on states"
                          : error.text);
  const char *expected = pw_domain_check (domain, *value);
  if (*expected == 0) return PW_OK;
  return read_fail (r, node->at, "%s = %g: expected %s", label, isnan (*value) ? (double)NAN : *value, expected);
}

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
  if (i < 0) return read_fail (r, node->at, "%s: there is no choice \"%.60s\"%s", label, text, hint);
  *value = i;
  return PW_OK;
}

int pw_find_kind_key (const pw_node *node) {
  for (int i = 0; pw_kinds[i]; i++)
    if (pw_node_is (node, pw_kinds[i]->name)) return i;
  return -1;
}

void pw_suggest_bodies (const pw_reader *r, pw_nearest *near) {
  int bodies;
  const pw_body *body = pw_model_bodies (r->model, &bodies);
  for (int i = 0; i < bodies; i++) pw_nearest_try (near, body[i].name);
}

int pw_count_entry (pw_reader *r, const pw_node *node) {
  const size_t room = (size_t)++r->entries;
  if (r->entries > PW_MAX_ENTRIES)
    return read_fail (r, node->at, "the lists and copies up to here have more than %d entries, the limit for a model",
                      PW_MAX_ENTRIES);
  return pw_names_reserve (&r->bodies, room) == PW_OK && pw_names_reserve (&r->names, room) == PW_OK &&
                 pw_names_reserve (&r->states, room) == PW_OK && pw_names_reserve (&r->elements, room) == PW_OK &&
                 pw_names_reserve (&r->contacts, room) == PW_OK && pw_names_reserve (&r->outputs, room) == PW_OK
             ? PW_OK
             : read_no_memory (r);
}

static int read_repeat (pw_reader *r, const pw_node *repeat, const char **counter, int *count) {
  const pw_node *map = repeat->next;
  double number = 0;
  if (map->type != PW_YAML_MAP || map->count != 1)
    return read_fail (r, map->at, "repeat: expected a map {COUNTER: NUMBER}, such as {i: 3}, found %s",
                      map->type == PW_YAML_MAP ? "one with another number of entries" : pw_node_found (map));
  if (pw_yaml_name (r, map->first, "repeat", counter) != PW_OK) return r->error->status;
  if (pw_names_find (&r->scope->index, *counter) >= 0 || pw_is_state_name (r, *counter))
    return read_fail (r, map->first->at, "repeat: a parameter, number of let or state has the name \"%s\"", *counter);
  const char *label = PW_PRINTED (100, "repeat: %s", *counter);
  if (pw_yaml_number (r, map->first->next, label, PW_NONNEGATIVE, &number) != PW_OK) return r->error->status;
  if (number > MAX_COPIES || number != floor (number))
    return read_fail (r, map->first->next->at, "%s = %.15g: expected a whole number from 0 to %d", label, number,
                      MAX_COPIES);
  *count = (int)number;
  return PW_OK;
}

/* Calls `each` with an entry or, if that is {list: [..]}, with those of the list. */
static int read_copy (pw_reader *r, const pw_node *entry, read_entry *each) {
  const pw_node *list = entry->first && pw_node_is (entry->first, "list") ? entry->first->next : NULL;
  if (list == NULL) return each (r, entry);
  if (pw_yaml_list (r, list, "list") != PW_OK) return r->error->status;
  if (list->next) return read_fail (r, list->next->at, "a repeated list has no other keys");
  for (const pw_node *n = list->first; n && r->error->status == PW_OK; n = n->next) each (r, n);
  return r->error->status;
}

static int read_copies (pw_reader *r, const pw_node *entry, const pw_node *repeat, read_entry *each) {
  pw_copies c = { .scope = r->scope, .arena = r->arena, .repeat = repeat, .last = &c.text }, *outer = r->copies;
  int count = 0, status;
  r->copies = NULL; /* also where an entry of another list is being read */
  if (read_repeat (r, repeat, &c.counter, &count) != PW_OK) return r->error->status;
  status = count ? copies_open (&c, entry) : PW_OK;
  for (int i = 1; i <= count && status == PW_OK && r->error->status == PW_OK; i++) {
    if ((status = copies_set (&c, i)) != PW_OK) break;
    r->copies = &c;
    if (r->copied + c.bytes > MAX_COPIED)
      read_fail (r, entry->at, "the copies up to here have texts of more than %g MB, the limit for a model",
                 MAX_COPIED / 1e6);
    else
      read_copy (r, c.entry, each);
    r->copies = NULL;
  }
  if (status == PW_INPUT) read_fail (r, pw_source_offset (r->y, c.faulty, c.fault.at), "%s", c.fault.text);
  if (status == PW_RESOURCE) read_no_memory (r);
  r->copied += c.bytes;
  r->copies = outer;
  return r->error->status;
}

int pw_yaml_entries (pw_reader *r, const pw_node *list, read_entry *each) {
  const pw_node *first = list && list->type == PW_YAML_LIST ? list->first : list;
  for (const pw_node *n = first; n && r->error->status == PW_OK; n = n == list ? NULL : n->next) {
    const pw_node *repeat = copies_repeat (n);
    if (repeat)
      read_copies (r, n, repeat, each);
    else
      each (r, n);
  }
  return r->error->status;
}

/* ---- Expressions of time and, in forces, of states: BODY.phi, ELEMENT.spin ---- */

int pw_yaml_rename (pw_reader *r, const pw_node *node, pw_node *renamed) {
  const char *text = "";
  if (pw_yaml_text (r, node, r->label, &text) != PW_OK) return r->error->status;
  *renamed = *node;
  renamed->text = pw_yaml_renamed (r, r->copies, r->prefix, text);
  return renamed->text ? PW_OK : read_no_memory (r);
}

int pw_yaml_expression (pw_reader *r, const pw_node *node, const char *const *variable, const char **text,
                        const pw_expression **expression) {
  pw_expression_error error;
  if (pw_yaml_text (r, node, r->label, text) != PW_OK) return r->error->status;
  int status = pw_expression_read (r->scope, variable, *text, r->arena, expression, &error);
  if (status == PW_INPUT) suggest_state (r, *text, &error);
  if (status == PW_INPUT) return expression_fail (r, node, error.at, "%s", error.text);
  if (status != PW_OK) return read_no_memory (r);
  if ((r->operations += (*expression)->codes) <= PW_MAX_OPERATIONS) return PW_OK;
  return read_fail (r, node->at, "%s: the expressions up to here have more than %d operations, the limit for a model",
                    r->label, PW_MAX_OPERATIONS);
}

static int index_element (pw_reader *r, const pw_node *n) {
  const pw_node *key = n->type == PW_YAML_MAP ? n->first : NULL;
  int kind = key && key->next->type == PW_YAML_SCALAR ? pw_find_kind_key (key) : -1;
  const char *name = kind < 0 ? NULL : pw_yaml_prefixed (r, key->next->text);
  if (++r->indexed > PW_MAX_ENTRIES) return read_fail (r, n->at, "more than %d elements", PW_MAX_ENTRIES);
  if (kind < 0) return PW_OK; /* an error that is reported later */
  if (name == NULL || pw_names_reserve (&r->elements, (size_t)(r->entries + r->indexed)) != PW_OK)
    return read_no_memory (r);
  pw_names_add (&r->elements, name, kind);
  return PW_OK;
}

int pw_index_elements (pw_reader *r) {
  if (r->has_index) return PW_OK;
  r->has_index = 1;
  return pw_yaml_entries (r, r->y->elements, index_element);
}

static int state_of_element (pw_reader *r, const pw_node *node, const char *owner, const char *part, size_t at) {
  char list[200] = "";
  if (pw_index_elements (r) != PW_OK) return r->error->status;
  int found = pw_names_find (&r->elements, owner);
  if (found < 0) {
    pw_nearest near = { .sought = owner };
    pw_suggest_bodies (r, &near);
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

const char *const pw_body_states[6] = { "x", "y", "phi", "vx", "vy", "omega" };

int pw_body_state (const char *part) {
  int i = 0;
  while (i < 6 && strcmp (pw_body_states[i], part) != 0) i++;
  return i < 6 ? i : -1;
}

int pw_check_state_name (pw_reader *r, const pw_node *node, const char *name, size_t at) {
  size_t n = strcspn (name, ".");
  if (name[n] == 0 && pw_is_state_name (r, name)) return PW_OK;
  const char *owner = PW_PART (name, n);
  if (pw_names_find (&r->bodies, owner) < 0) return state_of_element (r, node, owner, name + n + 1, at);
  if (pw_body_state (name + n + 1) >= 0) return PW_OK;
  return expression_fail (r, node, at + n + 1, "a body's states are x, y, phi, vx, vy and omega, not \"%.30s\"",
                          name + n + 1);
}

int pw_build_name (pw_reader *r, const pw_node *node, const char *label, const char **name) {
  char part[PW_PATH];
  if (pw_count_entry (r, node) != PW_OK || pw_yaml_text (r, node, label, name) != PW_OK) return r->error->status;
  if (strchr (*name, '{'))
    return read_fail (r, node->at, "%s \"%.60s\": braces belong to an entry with the key repeat", label, *name);
  if ((*name = pw_yaml_prefixed (r, *name)) == NULL) return read_no_memory (r);
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

int pw_build_fail (const pw_reader *r, const pw_node *node, const pw_error *cause) {
  const char *prefix = PW_PRINTED (200, "model %s: ", pw_model_name (r->model)), *text = cause->text;
  if (cause->status == PW_RESOURCE) return pw_fail (r->error, cause->status, "%s", text);
  if (strncmp (text, prefix, strlen (prefix)) == 0) text += strlen (prefix);
  return read_fail (r, node->at, "%s", text);
}
