/* The head of a text model: version, description, default run settings, parameters.  They are stored in a plug-in's
 * table, so that text models can be used like compiled ones; the build function reads bodies and elements. */
#define _POSIX_C_SOURCE 200809L
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

#define YAML_AHEAD 1e6 /* indicators of one list or map in brackets; about 350 bytes each */

/* ---- Parameters ---- */

/* Reads a unique name that expressions can use. */
static int yaml_new_name (const pw_yaml *y, const pw_node *node, const char *what, pw_names *names, pw_error *error) {
  const char *name;
  if (pw_yaml_text (y, node, what, &name, error) != PW_OK) return error->status;
  if (!pw_expression_is_name (name))
    return pw_yaml_fail (y, node->at, error, "%s \"%.60s\": expected a letter, then letters, digits and _", what, name);
  if (strcmp (name, "t") == 0 || pw_expression_is_taken (name))
    return pw_yaml_fail (y, node->at, error, "%s \"%s\": this name is taken: %s", what, name,
                         *name == 't' && name[1] == 0 ? "it is the time" : "a function or constant");
  if (pw_names_add (names, name, 0) >= 0) return pw_yaml_fail (y, node->at, error, "a second %s \"%s\"", what, name);
  return PW_OK;
}

static int yaml_domain (const pw_yaml *y, const pw_node *domain, const pw_node *min, pw_domain *d, pw_error *error) {
  static const char *const name[] = { "real", "nonnegative", "positive", "count" };
  const char *text;
  char hint[100];
  *d = PW_REAL;
  if (min && (min->type != PW_YAML_SCALAR || strcmp (min->text, "0") != 0 || domain))
    return pw_yaml_fail (y, min->at, error,
                         "min: only 0 can be written, without a domain; \"domain: positive\" means > 0");
  if (min) *d = PW_NONNEGATIVE;
  if (domain == NULL) return PW_OK;
  if (pw_yaml_text (y, domain, "domain", &text, error) != PW_OK) return error->status;
  pw_nearest near = { .sought = text };
  for (int i = 0; i < 4; i++) {
    pw_nearest_try (&near, name[i]);
    if (strcmp (name[i], text) != 0) continue;
    *d = (pw_domain)i;
    return PW_OK;
  }
  return pw_yaml_fail (y, domain->at, error, "domain: expected real, nonnegative, positive or count%s",
                       pw_nearest_text (&near, hint, sizeof hint));
}

/* Refuses units other than SI units: 40 with the unit deg would mean 40 rad. */
static int yaml_unit (const pw_yaml *y, const pw_node *node, const pw_node *value, const char **unit, pw_error *error) {
  if (pw_yaml_text (y, node, "unit", unit, error) != PW_OK) return error->status;
  for (const pw_unit_name *other = pw_unit_names; other->name; other++) {
    const char *at = strcmp (other->factor, "1") ? strstr (*unit, other->name) : NULL,
               *after = at ? at + strlen (other->name) : NULL;
    int number = value->type == PW_YAML_SCALAR && pw_expression_number (value->text, &(double){ 0 });
    if (at == NULL || (at > *unit && isalpha ((unsigned char)at[-1])) || isalpha ((unsigned char)*after)) continue;
    return pw_yaml_fail (
        y, node->at, error,
        "unit: numbers are in SI units, angles in radians, and no unit converts a value; write \"value: "
        "%.30s%c%s%.2s, unit: %.*s%s%.30s\"",
        number ? value->text : "(..)", at > *unit && at[-1] == '/' ? '/' : '*', other->factor,
        *after == '^' ? after : "", (int)(at - *unit), *unit, other->si, after);
  }
  return PW_OK;
}

typedef struct {
  const pw_names *names;
  size_t at;
} yaml_search;

static int yaml_is_parameter (void *context, const char *name, size_t length, size_t at) {
  yaml_search *s = context;
  char text[64];
  snprintf (text, sizeof text, "%.*s", (int)length, name);
  s->at = at;
  return length < sizeof text && pw_names_find (s->names, text) >= 0;
}

/* A default must not depend on other parameters: --set would have to change it, too. */
static int yaml_default (const pw_yaml *y, const pw_node *node, const char *what, const pw_names *names,
                         pw_parameter *p, pw_error *error) {
  yaml_search s = { names, 0 };
  if (node->type == PW_YAML_SCALAR && pw_expression_names (node->text, yaml_is_parameter, &s))
    return pw_yaml_fail (y, pw_yaml_place (y, node, s.at), error,
                         "%s: a default is made of numbers; what follows from parameters belongs in let", what);
  return pw_yaml_number (y, node, what, p->domain, NULL, &p->value, error);
}

static int yaml_parameter (const pw_yaml *y, const pw_node *node, pw_names *names, pw_parameter *p, pw_error *error) {
  static const char *const key[] = { "name", "value", "unit", "about", "domain", "min", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  if (pw_yaml_keys (y, node, 0, key, "a parameter", v, error) != PW_OK) return error->status;
  if (v[0] == NULL) return pw_yaml_fail (y, node->at, error, "a parameter needs a name");
  if (yaml_new_name (y, v[0], "parameter", names, error) != PW_OK) return error->status;
  p->name = v[0]->text;
  p->unit = p->about = "";
  char what[100];
  snprintf (what, sizeof what, "parameter %s", p->name);
  if (v[1] == NULL) return pw_yaml_fail (y, node->at, error, "%s needs a value, its default", what);
  if (yaml_domain (y, v[4], v[5], &p->domain, error) != PW_OK ||
      (v[2] && yaml_unit (y, v[2], v[1], &p->unit, error) != PW_OK) ||
      (v[3] && pw_yaml_text (y, v[3], "about", &p->about, error) != PW_OK))
    return error->status;
  return yaml_default (y, v[1], what, names, p, error);
}

static int yaml_parameters (pw_yaml *y, const pw_node *list, pw_names *names, pw_error *error) {
  if (list && pw_yaml_list (y, list, "parameters", -1, "", error) != PW_OK) return error->status;
  int count = list ? list->count : 0;
  y->parameter = pw_arena_take (&y->arena, ((size_t)count + 1) * sizeof *y->parameter);
  if (y->parameter == NULL) return pw_yaml_no_memory (y, error);
  for (const pw_node *n = list ? list->first : NULL; n; n = n->next) {
    pw_parameter *p = y->parameter + y->parameters;
    if (yaml_parameter (y, n, names, p, error) != PW_OK) return error->status;
    p->offset = (size_t)y->parameters++ * sizeof (double);
  }
  y->table.parameters = y->parameter;
  y->table.parameters_size = (size_t)count * sizeof (double);
  return PW_OK;
}

/* ---- The rest of the head ---- */

static int yaml_run (pw_yaml *y, const pw_node *run, pw_error *error) {
  static const char *const key[] = { "t_end", "step", "rtol", "method", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  double *number[] = { &y->table.run.t_end, &y->table.run.step, &y->table.run.rtol };
  if (pw_yaml_keys (y, run, 0, key, "run", v, error) != PW_OK) return error->status;
  for (int i = 0; i < 3; i++)
    if (v[i] && pw_yaml_number (y, v[i], key[i], PW_POSITIVE, NULL, number[i], error) != PW_OK) return error->status;
  return v[3] ? pw_yaml_text (y, v[3], "method", &y->table.run.method, error) : PW_OK;
}

static int yaml_let_names (const pw_yaml *y, pw_names *names, pw_error *error) {
  if (y->let && y->let->type != PW_YAML_MAP)
    return pw_yaml_fail (y, y->let->at, error, "let: expected a map {NAME: NUMBER, ...}, found %s",
                         pw_yaml_found (y->let));
  for (const pw_node *n = y->let ? y->let->first : NULL; n; n = n->next->next)
    if (yaml_new_name (y, n, "name", names, error) != PW_OK) return error->status;
  return PW_OK;
}

static int yaml_version (const pw_yaml *y, const pw_node *version, pw_error *error) {
  if (version == NULL)
    return pw_yaml_fail (y, y->root->at, error, "\"pinwheel: 1\" is missing, the version of the format");
  if (version->type == PW_YAML_SCALAR && strcmp (version->text, "1") == 0) return PW_OK;
  return pw_yaml_fail (y, version->at, error,
                       "pinwheel: expected 1, the version of the format that this Pinwheel reads");
}

static int yaml_head (pw_yaml *y, pw_error *error) {
  static const char *const key[] = { "pinwheel", "about",    "run",   "parameters", "let",
                                     "bodies",   "elements", "truth", NULL };
  const pw_node *v[sizeof key / sizeof *key];
  pw_names names = { .size = 0 };
  if (y->root == NULL) return pw_yaml_fail (y, 0, error, "the file is empty; a model begins with \"pinwheel: 1\"");
  if (pw_yaml_keys (y, y->root, 0, key, "a model", v, error) != PW_OK || yaml_version (y, v[0], error) != PW_OK ||
      (v[1] && pw_yaml_text (y, v[1], "about", &y->table.about, error) != PW_OK) ||
      (v[2] && yaml_run (y, v[2], error) != PW_OK))
    return error->status;
  for (int i = 3; key[i]; i++)
    if (v[i] && v[i]->count > PW_YAML_ITEMS)
      return pw_yaml_fail (y, v[i]->at, error, "%s: %d entries; a model may have %d", key[i], v[i]->count,
                           PW_YAML_ITEMS);
  y->let = v[4];
  y->bodies = v[5];
  y->elements = v[6];
  y->reference = v[7];
  size_t count = (v[3] ? (size_t)v[3]->count : 0) + (v[4] ? (size_t)v[4]->count : 0);
  int status = pw_names_open (&names, count) == PW_OK ? PW_OK : pw_yaml_no_memory (y, error);
  if (status == PW_OK) status = yaml_parameters (y, v[3], &names, error);
  if (status == PW_OK) status = yaml_let_names (y, &names, error);
  pw_names_close (&names);
  return status;
}

/* ---- The file ---- */

static int yaml_read (pw_yaml *y, const char *path, size_t largest, pw_error *error) {
  if (pw_yaml_read_source (y, path, largest, error) != PW_OK || pw_yaml_read_tree (y, error) != PW_OK)
    return error->status;
  return yaml_head (y, error);
}

/* The folder of "/model.yaml" is "". */
static int yaml_paths (pw_yaml *y, const char *path, const char *shown) {
  const char *slash = strrchr (path, '/');
  y->path = strdup (shown);
  y->folder = slash ? strndup (path, (size_t)(slash - path)) : strdup (".");
  return y->path && y->folder ? PW_OK : PW_RESOURCE;
}

pw_yaml *pw_yaml_open (const char *path, const char *shown, size_t largest, pw_error *error) {
  pw_yaml *y = calloc (1, sizeof *y);
  if (y == NULL || yaml_paths (y, path, shown) != PW_OK) {
    pw_fail (error, PW_RESOURCE, "out of memory");
    pw_yaml_close (y);
    return NULL;
  }
  y->ahead = YAML_AHEAD * fmax (1, (double)largest / PW_FILE_LARGEST);
  y->table = (pw_plugin_table){ .abi = PW_ABI, .size = sizeof y->table, .build = pw_yaml_build };
  if (yaml_read (y, path, largest, error) == PW_OK) return y;
  pw_yaml_close (y);
  return NULL;
}

void pw_yaml_close (pw_yaml *y) {
  if (y == NULL) return;
  pw_arena_free (&y->arena);
  free (y->source);
  free (y->path);
  free (y->folder);
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
    const pw_node *value = node->type == PW_YAML_MAP ? n->next : NULL;
    if (value && n->type == PW_YAML_SCALAR && strcmp (n->text, "file") == 0 && value->type == PW_YAML_SCALAR) {
      char *path = pw_join (y->folder, value->text, "");
      stop = path ? each (context, path) : PW_RESOURCE;
      free (path);
    }
    if (!stop) stop = yaml_each_table (y, n, each, context);
  }
  return stop;
}

int pw_yaml_tables (const pw_yaml *y, int (*each) (void *context, const char *path), void *context) {
  return y->root ? yaml_each_table (y, y->root, each, context) : 0;
}
