/* The head of a text model: version, description, default run settings, parameters.  They are stored in a plug-in's
 * table, so that text models can be used like compiled ones; the build function reads bodies and elements. */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

#define YAML_MAX_AHEAD 1e6 /* pw_yaml.max_ahead for the default limit of bytes: each indicator takes 350 bytes */
enum { YAML_UNIT = 400 /* bytes of a unit of up to 60 characters with SI units in place of others, and its end */ };

/* ---- Parameters ---- */

/* Reads a unique name that expressions can use. */
static int yaml_new_name (const pw_reader *r, const pw_node *node, const char *label, pw_names *names) {
  const char *name;
  if (pw_yaml_text (r, node, label, &name) != PW_OK) return r->error->status;
  if (!pw_expression_is_name (name))
    return pw_yaml_fail (r, node->at, "%s \"%.60s\": expected a letter, then letters, digits and _, at most 63 in all",
                         label, name);
  if (strcmp (name, "t") == 0 || pw_expression_is_reserved (name))
    return pw_yaml_fail (r, node->at, "%s \"%s\": this name is reserved: %s", label, name,
                         *name == 't' && name[1] == 0 ? "it is the time" : "a function or constant");
  return pw_names_add (names, name, 0) >= 0 ? pw_yaml_fail (r, node->at, "a second %s \"%s\"", label, name) : PW_OK;
}

/* `domain: positive`, or `min: 0`. */
static int yaml_domain (const pw_reader *r, const pw_node *domain, const pw_node *min, pw_domain *d) {
  int chosen = min ? PW_NONNEGATIVE : PW_REAL;
  if (min && (min->type != PW_YAML_SCALAR || strcmp (min->text, "0") != 0 || domain))
    return pw_yaml_fail (r, min->at, "min: only 0 can be written, without a domain; \"domain: positive\" means > 0");
  int status = pw_yaml_choice (r, domain, "domain", pw_domain_names, &chosen);
  *d = (pw_domain)chosen;
  return status;
}

/* Whether a UTF-8 character is a letter, not a sign like those of multiplication (·, U+22C5) or a raised digit. */
static int yaml_is_letter (const char *character) {
  const unsigned char first = (unsigned char)*character;
  if (first < 0xC3 || strncmp (character, "×", 2) == 0) return isalpha (first) || strncmp (character, "µ", 2) == 0;
  return first != 0xE2; /* U+2000 to U+2FFF */
}

/* The first place where a name is a word of its own in a text, or NULL. */
static const char *yaml_find_word (const char *text, const char *name) {
  for (const char *at = strstr (text, name), *before; at; at = strstr (at + 1, name)) {
    for (before = at; before > text && ((unsigned char)*--before & 0xC0) == 0x80;) continue;
    if ((at == text || !yaml_is_letter (before)) && !yaml_is_letter (at + strlen (name))) return at;
  }
  return NULL;
}

/* The first of pw_unit_names that is not an SI unit and occurs in a text, and its place; NULL: there is none. */
static const pw_unit_name *yaml_other_unit (const char *unit, const char **at) {
  for (const pw_unit_name *other = pw_unit_names; other->name; other++) {
    if (strcmp (other->factor, "1") == 0 || (strchr (other->name, '/') && strcmp (other->name, unit) != 0)) continue;
    if ((*at = yaml_find_word (unit, other->name)) != NULL) return other;
  }
  return NULL;
}

/* Replaces the other unit, at a place in the unit, by SI units.  conversion: of a value, "*deg" or "/1e-3^2". */
static void yaml_replace_unit (char unit[YAML_UNIT], const pw_unit_name *other, const char *at, char conversion[40]) {
  char text[YAML_UNIT];
  const char *before = at, *after = at + strlen (other->name);
  int power;
  pw_unit_power (after, &power);
  while (before > unit && before[-1] == ' ') before--;
  const int divides = before > unit && before[-1] == '/';
  const int product = strpbrk (other->si, " /") && (divides || power != 1);
  snprintf (text, sizeof text, "%.*s%s%s%s%s", (int)(at - unit), unit, product ? "(" : "", other->si,
            product ? ")" : "", after);
  memcpy (unit, text, sizeof text);
  snprintf (conversion, 40, power == 1 ? "%c%s" : "%c%s^%d", divides ? '/' : '*', other->factor, power);
}

/* Refuses a unit that contains this other unit than an SI unit, and says how to convert the value. */
static int yaml_refuse_unit (const pw_reader *r, const pw_node *node, const pw_node *value, const pw_unit_name *other,
                             const char *unit) {
  static const char why[] = "unit: numbers are in SI units, angles in radians, and no unit converts a value";
  char si[YAML_UNIT], conversion[40];
  const char *at;
  double factor;
  int replaced = 0, number = value->type == PW_YAML_SCALAR && strlen (value->text) <= 30 &&
                             pw_expression_number (value->text, &(double){ 0 });
  if (strlen (unit) > 60 || pw_unit_factor (unit, NULL, &factor) != PW_OK) { /* not understood as a whole */
    pw_unit_factor (other->name, other->si, &factor);
    return pw_yaml_fail (r, node->at, "%s; convert it with 1 %s = %.15g %s, and write %s instead", why, other->name,
                         factor, other->si, other->si);
  }
  snprintf (si, sizeof si, "%s", unit);
  for (; (other = yaml_other_unit (si, &at)) != NULL; replaced++) yaml_replace_unit (si, other, at, conversion);
  if (replaced > 1) snprintf (conversion, sizeof conversion, "*%.15g", factor);
  return pw_yaml_fail (r, node->at, "%s; write \"value: %s%s, unit: %s\"", why, number ? value->text : "(..)",
                       conversion, si);
}

/* Reads the unit of a parameter; refuses a known one that is not an SI unit: 40 with the unit deg would mean 40 rad. */
static int yaml_unit (const pw_reader *r, const pw_node *node, const pw_node *value, const char **unit) {
  const char *at;
  if (node == NULL || pw_yaml_text (r, node, "unit", unit) != PW_OK) return r->error->status;
  const char *in = strstr (*unit, " in "); /* "persons in lane": no inches, unless it is a product of units */
  const pw_unit_name *other = yaml_other_unit (*unit, &at);
  if (other == NULL || (in && at == in + 1 && pw_unit_factor (*unit, NULL, &(double){ 0 }) != PW_OK)) return PW_OK;
  return yaml_refuse_unit (r, node, value, other, *unit);
}

/* A default must not depend on other parameters: --set would have to change it, too. */
static int yaml_default (const pw_reader *r, const pw_node *node, const char *label, const pw_names *names,
                         pw_parameter *p) {
  const char *text = node->type == PW_YAML_SCALAR ? node->text : "";
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *at; (at = pw_expression_next_name (&rest, name)) != NULL;)
    if (pw_names_find (names, name) >= 0)
      return pw_yaml_fail (r, pw_yaml_offset (r->y, node, (size_t)(at - text)),
                           "%s: a default is made of numbers; what follows from parameters belongs in let", label);
  return pw_yaml_number (r, node, label, p->domain, &p->value);
}

static int yaml_parameter (const pw_reader *r, const pw_node *node, pw_names *names, pw_parameter *p) {
  static const char *const key[] = { "name", "value", "unit", "about", "domain", "min", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  if (pw_yaml_keys (r, node, key, "a parameter", v) != PW_OK) return r->error->status;
  const pw_node *name = v[0], *value = v[1], *unit = v[2], *about = v[3], *domain = v[4], *min = v[5];
  if (name == NULL) return pw_yaml_fail (r, node->at, "a parameter needs a name");
  if (yaml_new_name (r, name, "parameter", names) != PW_OK) return r->error->status;
  p->name = name->text;
  p->unit = p->about = "";
  const char *label = PW_PRINTED (100, "parameter %s", p->name);
  if (value == NULL) return pw_yaml_fail (r, node->at, "%s needs a value, its default", label);
  yaml_domain (r, domain, min, &p->domain);
  yaml_unit (r, unit, value, &p->unit);
  pw_yaml_text (r, about, "about", &p->about);
  return yaml_default (r, value, label, names, p);
}

static int yaml_parameters (pw_yaml *y, const pw_reader *r, const pw_node *list, pw_names *names) {
  if (pw_yaml_list (r, list, "parameters") != PW_OK) return r->error->status;
  int count = list ? list->count : 0;
  pw_parameter *p = pw_arena_alloc (&y->arena, ((size_t)count + 1) * sizeof *p);
  if (p == NULL) return pw_yaml_no_memory (r);
  y->table.parameters = p;
  for (const pw_node *n = list ? list->first : NULL; n; n = n->next, p++) {
    if (yaml_parameter (r, n, names, p) != PW_OK) return r->error->status;
    p->offset = (size_t)y->parameter_count++ * sizeof (double);
  }
  y->table.parameters_size = (size_t)count * sizeof (double);
  return PW_OK;
}

/* ---- The rest of the head ---- */

static void yaml_run (pw_yaml *y, const pw_reader *r, const pw_node *run) {
  static const char *const key[] = { "t_end", "step", "rtol", "method", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  double *number[] = { &y->table.run.t_end, &y->table.run.step, &y->table.run.rtol };
  pw_yaml_keys (r, run, key, "run", v);
  for (int i = 0; i < 3; i++) pw_yaml_number (r, v[i], key[i], PW_POSITIVE, number[i]);
  pw_yaml_text (r, v[3], key[3], &y->table.run.method);
}

static int yaml_let_names (const pw_reader *r, const pw_node *let, pw_names *names) {
  if (let && let->type != PW_YAML_MAP)
    return pw_yaml_fail (r, let->at, "let: expected a map {NAME: NUMBER, ...}, found %s", pw_yaml_found (let));
  for (const pw_node *n = let ? let->first : NULL; n && r->error->status == PW_OK; n = n->next->next)
    yaml_new_name (r, n, "name", names);
  return r->error->status;
}

static int yaml_version (const pw_reader *r, const pw_node *version) {
  if (version == NULL) return pw_yaml_fail (r, r->y->root->at, "\"pinwheel: 1\" is missing, the version of the format");
  if (version->type == PW_YAML_SCALAR && strcmp (version->text, "1") == 0) return r->error->status;
  return pw_yaml_fail (r, version->at, "pinwheel: expected 1, the version of the format that this Pinwheel reads");
}

static int yaml_head (pw_yaml *y, const pw_reader *r) {
  static const char *const key[] = { "pinwheel", "about",    "run",   "parameters", "let",
                                     "bodies",   "elements", "truth", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  pw_names names = { .size = 0 };
  if (y->root == NULL) return pw_yaml_fail (r, 0, "the file is empty; a model begins with \"pinwheel: 1\"");
  if (pw_yaml_keys (r, y->root, key, "a model", v) != PW_OK) return r->error->status;
  yaml_version (r, v[0]);
  pw_yaml_text (r, v[1], "about", &y->table.about);
  yaml_run (y, r, v[2]);
  const pw_node *parameters = v[3];
  /* the key of the reference solution is "truth" */
  y->let = v[4], y->bodies = v[5], y->elements = v[6], y->reference = v[7];
  for (int i = 3; key[i]; i++) /* from "parameters" on: lists and maps */
    if (v[i] && v[i]->count > PW_YAML_MAX_ITEMS)
      pw_yaml_fail (r, v[i]->at, "%s: %d entries; a model may have %d", key[i], v[i]->count, PW_YAML_MAX_ITEMS);
  size_t count = (size_t)(parameters ? parameters->count : 0) + (size_t)(y->let ? y->let->count : 0);
  if (r->error->status == PW_OK && pw_names_open (&names, count) != PW_OK) pw_yaml_no_memory (r);
  if (r->error->status == PW_OK) yaml_parameters (y, r, parameters, &names);
  if (r->error->status == PW_OK) yaml_let_names (r, y->let, &names);
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
  y->max_ahead = YAML_MAX_AHEAD * fmax (1, (double)max_bytes / PW_FILE_DEFAULT_BYTES);
  y->table = (pw_plugin_table){ .abi = PW_ABI, .size = sizeof y->table, .build = pw_yaml_build };
  if (pw_yaml_read_source (y, path, max_bytes, error) == PW_OK && pw_yaml_read_tree (y, error) == PW_OK &&
      yaml_head (y, &(pw_reader){ .y = y, .error = error }) == PW_OK)
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

const pw_plugin_table *pw_yaml_table (const pw_yaml *y) {
  return &y->table;
}

/* Calls `each` with the path of every file named below a node, until it returns non-zero, which is returned. */
static int yaml_each_table (const pw_yaml *y, const pw_node *node, int (*each) (void *context, const char *path),
                            void *context) {
  int stop = 0;
  for (const pw_node *n = node->type == PW_YAML_SCALAR ? NULL : node->first; n && !stop; n = n->next) {
    const pw_node *key = node->type == PW_YAML_MAP ? n : NULL;
    if (key) n = key->next; /* its value */
    if (key && key->type == PW_YAML_SCALAR && strcmp (key->text, "file") == 0 && n->type == PW_YAML_SCALAR) {
      char path[PW_PATH];
      stop = each (context, pw_path (path, "%s/%s", y->folder, n->text));
    } else
      stop = yaml_each_table (y, n, each, context);
  }
  return stop;
}

int pw_yaml_tables (const pw_yaml *y, int (*each) (void *context, const char *path), void *context) {
  return y->elements ? yaml_each_table (y, y->elements, each, context) : 0; /* in let, "file" is the name of a number */
}

/* Bodies and elements: fills the definition structures through the field tables of their types, and passes them to
 * pw_add_body and pw_add, like a build function in C.  The core checks them; its messages get a position. */

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
