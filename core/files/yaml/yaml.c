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
