/* Signals in text models.
 *
 *   3, "2 * M0"                                    a constant
 *   {constant: 3}                                  the same
 *   {harmonic: {amplitude, omega, phase, offset}}  and the other forms made of numbers (signal_form.c)
 *   "M0 * cos (omega * t)"                         an expression of the time t; of states, BODY.phi, for forces
 *   {expression: .., rate: .., acceleration: ..}   the same for constraints, which need time derivatives
 */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

/* ---- Points of tables, in the model ---- */

static int table_list (pw_yaml_builder *b, const char *what, const pw_node *list, pw_signal *s, pw_error *error) {
  char text[240];
  if (pw_yaml_list (b->y, list, what, -1, "", error) != PW_OK) return error->status;
  size_t bytes = (size_t)list->count * sizeof (double);
  double *t = pw_arena_take (b->arena, bytes), *value = pw_arena_take (b->arena, bytes);
  if (t == NULL || value == NULL) return pw_yaml_no_memory (b->y, error);
  s->table.t = t;
  s->table.value = value;
  for (const pw_node *n = list->first; n; n = n->next, s->table.count++) {
    double point[2];
    snprintf (text, sizeof text, "%s: point %d", what, s->table.count + 1);
    if (pw_yaml_list (b->y, n, text, 2, "numbers, [time, value]", error) != PW_OK ||
        pw_yaml_pair (b, n, text, point, error) != PW_OK)
      return error->status;
    t[s->table.count] = point[0];
    value[s->table.count] = point[1];
  }
  return PW_OK;
}

/* ---- Points of tables: two columns of a file in the model's own folder ---- */

static int table_climbs (const char *name) {
  for (const char *part = name; part; part = strchr (part, '/'), part = part ? part + 1 : NULL)
    if (strncmp (part, "..", 2) == 0 && (part[2] == '/' || part[2] == 0)) return 1;
  return 0;
}

/* The file's own path if it lies below the folder, links resolved; malloced. */
static char *table_below (const char *folder, const char *name, const char **why) {
  char *joined = pw_join (folder, name, ""), *path = joined ? realpath (joined, NULL) : NULL;
  size_t n = strcmp (folder, "/") == 0 ? 0 : strlen (folder);
  *why = joined == NULL ? "out of memory" : strerror (errno);
  free (joined);
  if (path == NULL || (strncmp (path, folder, n) == 0 && (path[n] == '/' || path[n] == 0))) return path;
  *why = "it is a link that leads out of the model's folder";
  free (path);
  return NULL;
}

/* A model may only read files from its own folder. */
static FILE *table_open (const pw_yaml *y, const char *name, const char **why) {
  *why = "a table lies in the model's own folder, so its path is relative and has no \"..\"";
  if (*name == '/' || table_climbs (name)) return NULL;
  char *path = table_below (y->folder, name, why);
  FILE *f = path ? pw_open_input (path, why) : NULL;
  free (path);
  return f;
}

static int table_columns (pw_yaml_builder *b, const pw_node *list, const char *what, const char *column[2],
                          pw_error *error) {
  char text[240];
  snprintf (text, sizeof text, "%s: columns", what);
  if (list == NULL) return PW_OK;
  if (pw_yaml_list (b->y, list, text, 2, "columns, [time, value]", error) != PW_OK ||
      pw_yaml_text (b->y, list->first, text, &column[0], error) != PW_OK)
    return error->status;
  return pw_yaml_text (b->y, list->first->next, text, &column[1], error);
}

/* The unit of the current field.  For "m or rad" the element's choice decides: rad for an angle. */
static const char *table_unit (const pw_yaml_builder *b) {
  if (b->field->unit == NULL || strcmp (b->field->unit, "m or rad") != 0) return b->field->unit;
  const pw_field *choice = b->field;
  while (choice->type != PW_CHOICE) choice--; /* precedes a field with two units */
  int chosen = *(const int *)(const void *)(b->definition + choice->offset);
  return strcmp (choice->choices[chosen], "angle") == 0 ? "rad" : "m";
}

static int table_file (pw_yaml_builder *b, const char *what, const pw_node *node, const char *const column[2],
                       pw_signal *s, pw_error *error) {
  const char *name, *why, *const unit[2] = { "s", table_unit (b) };
  double *value[2];
  pw_error own = { 0 };
  if (pw_yaml_text (b->y, node, what, &name, error) != PW_OK) return error->status;
  errno = 0;
  FILE *f = table_open (b->y, name, &why);
  if (f == NULL && errno == ENOMEM) return pw_yaml_no_memory (b->y, error);
  if (f == NULL) return pw_yaml_fail (b->y, node->at, error, "%s: cannot read \"%.60s\": %s", what, name, why);
  int status = pw_columns_read (f, name, column, unit, b->arena, value, &s->table.count, &own);
  fclose (f);
  s->table.t = value[0];
  s->table.value = value[1];
  if (status == PW_INPUT) return pw_yaml_fail (b->y, node->at, error, "%s: %s", what, own.text);
  return status == PW_OK ? PW_OK : pw_yaml_no_memory (b->y, error);
}

static int table_read (pw_yaml_builder *b, const char *what, const pw_node *node, const pw_node *const v[3],
                       pw_signal *s, pw_error *error) {
  const char *column[2] = { "1", "2" };
  if ((v[0] != NULL) + (v[1] != NULL) != 1)
    return pw_yaml_fail (b->y, node->at, error, "%s: a table has either points or a file", what);
  if (v[0] && v[2]) return pw_yaml_fail (b->y, v[2]->at, error, "%s: columns belong to a file", what);
  if (v[0]) return table_list (b, what, v[0], s, error);
  if (table_columns (b, v[2], what, column, error) != PW_OK) return error->status;
  return table_file (b, what, v[1], column, s, error);
}

/* Limits the total number of points, since many tables may read one file. */
static int table_points (pw_yaml_builder *b, const char *what, const pw_node *node, const pw_node *const v[3],
                         pw_signal *s, pw_error *error) {
  int status = table_read (b, what, node, v, s, error);
  if (status == PW_OK) b->points += s->table.count;
  if (status != PW_OK || b->points <= PW_YAML_POINTS) return status;
  return pw_yaml_fail (b->y, node->at, error, "%s: the tables up to here have more than %d points, the most of a model",
                       what, PW_YAML_POINTS);
}

/* ---- Forms made of numbers ---- */

/* Reads the fields of a form, except a table's points. */
static int signal_fields (pw_yaml_builder *b, const pw_signal_form *form, const char *what, const pw_node *node,
                          const pw_node *const *v, pw_signal *signal, pw_error *error) {
  char text[240];
  for (int i = 0; form->fields[i].name; i++) {
    const pw_field *f = &form->fields[i];
    void *at = (char *)signal + f->offset;
    snprintf (text, sizeof text, "%s: %s", what, f->name);
    if (v[i] == NULL && f->required) return pw_yaml_fail (b->y, node->at, error, "%s is missing", text);
    if (v[i] && f->type == PW_NUMBER && pw_yaml_number (b->y, v[i], text, f->domain, b->x, at, error) != PW_OK)
      return error->status;
    if (v[i] && f->type == PW_CHOICE && pw_yaml_choice (b, v[i], text, f->choices, at, error) != PW_OK)
      return error->status;
  }
  return PW_OK;
}

/* Checks the signal as a whole; reports an error at the point of the table concerned, or at the signal. */
static int signal_fault (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node,
                         const pw_node *points, const pw_signal *signal, pw_error *error) {
  char fault[300];
  int point;
  if (*pw_signal_check (signal, kind, &point, fault, sizeof fault) == 0) return PW_OK;
  for (const pw_node *n = points ? points->first : NULL; n && point >= 0; n = n->next)
    if (point-- == 0) node = n;
  return pw_yaml_fail (b->y, node->at, error, "%s: %s", what, fault);
}

static int signal_form (pw_yaml_builder *b, const pw_kind *kind, const pw_signal_form *form, const char *what,
                        const pw_node *node, pw_signal *signal, pw_error *error) {
  const char *key[PW_YAML_KEYS];
  char about[100];
  const pw_node *v[PW_YAML_KEYS], *points = NULL;
  int n = 0;
  *signal = (pw_signal){ .type = form->type };
  for (const pw_field *f = form->fields; f->name; f++) key[n++] = f->name;
  if (form->type == PW_TABLE)
    key[n] = "points", key[n + 1] = "file", key[n + 2] = "columns", key[n + 3] = NULL;
  else
    key[n] = NULL;
  snprintf (about, sizeof about, "a %s", form->name);
  if (pw_yaml_keys (b->y, node, 0, key, about, v, error) != PW_OK ||
      signal_fields (b, form, what, node, v, signal, error) != PW_OK)
    return error->status;
  if (form->type == PW_TABLE) {
    int scale = 0;
    while (strcmp (key[scale], "scale") != 0) scale++;
    if (v[scale] && signal->table.scale == 0)
      return pw_yaml_fail (b->y, v[scale]->at, error, "%s: scale: 0 would leave nothing of the table", what);
  }
  if (form->type == PW_TABLE && table_points (b, what, node, v + n, signal, error) != PW_OK) return error->status;
  if (form->type == PW_TABLE) points = v[n];
  return signal_fault (b, kind, what, node, points, signal, error);
}

enum { SIGNAL_CONSTANT, SIGNAL_EXPRESSION, SIGNAL_RATE, SIGNAL_ACCELERATION, SIGNAL_FORMS };

/* "constant, expression, harmonic, ..." */
static char *signal_list (const char *const *key, char *buffer, size_t size) {
  size_t n = (size_t)snprintf (buffer, size, "%s, %s", key[SIGNAL_CONSTANT], key[SIGNAL_EXPRESSION]);
  for (key += SIGNAL_FORMS; *key && n < size; key++) n += (size_t)snprintf (buffer + n, size - n, ", %s", *key);
  return buffer;
}

/* {TYPE: ..} */
static int signal_map (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node,
                       pw_signal *signal, pw_error *error) {
  const char *key[PW_YAML_KEYS] = { "constant", "expression", "rate", "acceleration" };
  const pw_node *v[PW_YAML_KEYS];
  char list[100];
  int n = SIGNAL_FORMS, given = 0, form = -1;
  for (const pw_signal_form *f = pw_signal_forms; f->name; f++) key[n++] = f->name;
  key[n] = NULL;
  if (pw_yaml_keys (b->y, node, 0, key, "a signal", v, error) != PW_OK) return error->status;
  for (int i = 0; i < n; i++) {
    given += v[i] != NULL && i != SIGNAL_RATE && i != SIGNAL_ACCELERATION;
    if (v[i] && i >= SIGNAL_FORMS) form = i;
  }
  if (given != 1)
    return pw_yaml_fail (b->y, node->at, error, "%s: expected one of %s; found %s", what,
                         signal_list (key, list, sizeof list), given ? "several" : "none");
  if (!v[SIGNAL_EXPRESSION] && (v[SIGNAL_RATE] || v[SIGNAL_ACCELERATION]))
    return pw_yaml_fail (b->y, node->at, error, "%s: a rate or acceleration belongs to an expression", what);
  if (v[SIGNAL_CONSTANT])
    return pw_yaml_number (b->y, v[SIGNAL_CONSTANT], what, PW_REAL, b->x, &signal->constant, error);
  if (v[SIGNAL_EXPRESSION]) return pw_yaml_of_time (b, kind, what, v + SIGNAL_EXPRESSION, signal, error);
  return signal_form (b, kind, &pw_signal_forms[form - SIGNAL_FORMS], what, v[form], signal, error);
}

int pw_yaml_signal (pw_yaml_builder *b, const pw_kind *kind, const char *what, const pw_node *node, pw_signal *signal,
                    pw_error *error) {
  const pw_node *const v[3] = { node, NULL, NULL };
  if (node->type == PW_YAML_MAP) return signal_map (b, kind, what, node, signal, error);
  if (node->type == PW_YAML_SCALAR && pw_yaml_moves (node->text, NULL))
    return pw_yaml_of_time (b, kind, what, v, signal, error);
  return pw_yaml_number (b->y, node, what, PW_REAL, b->x, &signal->constant, error);
}
