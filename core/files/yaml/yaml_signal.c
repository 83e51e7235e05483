/* Signals in text models.
 *
 *   3, "2 * M0"                                    a constant
 *   {constant: 3}                                  the same
 *   {harmonic: {amplitude: 3, omega: 2}}           and ramp, smooth-step, pulse: their fields are in signal_form.c
 *   {table: {points: [[0, 1], [2, 3]]}}            points
 *   {table: {file: M.csv, columns: [t, M]}}        points of a file, by default in columns 1 and 2
 *   {table: {file: M.csv, time: t, columns: [M]}}  the same
 *   "M0 * cos (omega * t)"                         an expression of the time t; in forces also of states: BODY.phi
 *   {expression: .., rate: .., acceleration: ..}   the same; in constraints, its time derivatives may be given
 */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

/* ---- Points of tables, in the model ---- */

static int table_list (pw_reader *r, const char *label, const pw_node *list, double **times, pw_signal *s) {
  if (pw_yaml_list (r, list, label) != PW_OK) return r->error->status;
  size_t bytes = (size_t)list->count * sizeof (double);
  double *t = pw_arena_alloc (r->arena, bytes), *value = pw_arena_alloc (r->arena, bytes);
  if (t == NULL || value == NULL) return pw_yaml_no_memory (r);
  s->table.t = *times = t;
  s->table.value = value;
  for (const pw_node *n = list->first; n; n = n->next) {
    double point[2] = { 0 };
    const char *text = PW_PRINTED (240, "%s: point %d", label, s->table.count + 1);
    if (pw_yaml_pair (r, n, text, "numbers, [time, value]", point) != PW_OK) return r->error->status;
    t[s->table.count] = point[0];
    value[s->table.count++] = point[1];
  }
  return PW_OK;
}

/* ---- Points of tables: two columns of a file in the model's folder ---- */

static int table_has_parent (const char *name) {
  for (const char *part = name; part; part = strchr (part, '/'), part = part ? part + 1 : NULL)
    if (strncmp (part, "..", 2) == 0 && (part[2] == '/' || part[2] == 0)) return 1;
  return 0;
}

/* A model may only read files in its folder. */
static FILE *table_open (const pw_yaml *y, const char *name, const char **reason) {
  char joined[PW_PATH], path[PW_PATH];
  size_t n = strlen (y->folder); /* 0 for the root */
  *reason = "a table must be in the model's folder: its path is relative and has no \"..\"";
  if (*name == '/' || table_has_parent (name)) return NULL;
  if (realpath (pw_path (joined, "%s/%s", y->folder, name), path) == NULL) return *reason = strerror (errno), NULL;
  *reason = "it is a link that leads out of the model's folder";
  int is_inside = strncmp (path, y->folder, n) == 0 && (path[n] == '/' || path[n] == 0);
  return is_inside ? pw_open_input (path, reason) : NULL;
}

/* The unit of the current field.  Only a drive has "m or rad"; the choice before this field decides. */
static const char *table_unit (const pw_reader *r) {
  if (r->field->unit == NULL || strcmp (r->field->unit, "m or rad") != 0) return r->field->unit;
  const pw_field *choice = r->field;
  while (choice->type != PW_CHOICE) choice--;
  int chosen = *(const int *)(const void *)(r->definition + choice->offset);
  return strcmp (choice->choices[chosen], "angle") == 0 ? "rad" : "m";
}

/* The columns of times and values: `columns` has both or, if `time` is given, perhaps that of the values alone; NULL by
 * default. */
static int table_columns (pw_reader *r, const char *label, const pw_node *columns, const pw_node *time,
                          const char *column[2]) {
  const char *text = PW_PRINTED (240, "%s: columns", label);
  const int count = time && columns && columns->count != 2 ? 1 : 2;
  column[0] = column[1] = NULL;
  if (pw_yaml_list_of (r, columns, text, count, count == 1 ? "column, [value]" : "columns, [time, value]") != PW_OK)
    return r->error->status;
  const pw_node *first = columns ? columns->first : NULL;
  pw_yaml_text (r, time, PW_PRINTED (240, "%s: time", label), &column[0]);
  pw_yaml_text (r, count == 2 && first ? first->next : first, text, &column[1]);
  if (count == 1 || r->error->status != PW_OK) return r->error->status;
  if (time && first && first->type == PW_YAML_SCALAR && strcmp (first->text, column[0]) != 0)
    return pw_yaml_fail (r, first->at, "%s: the first one is that of the times, but time is \"%.60s\"", text,
                         column[0]);
  return pw_yaml_text (r, time ? NULL : first, text, &column[0]);
}

/* Leaves out rows without a time or value. */
static void table_skip_gaps (pw_points *table, double *t, double *value) {
  const int rows = table->count;
  table->count = 0;
  for (int i = 0; i < rows; i++) {
    if (isnan (t[i]) || isnan (value[i])) continue;
    t[table->count] = t[i];
    value[table->count++] = value[i];
  }
  table->skipped = rows - table->count;
}

static int table_file (pw_reader *r, const char *label, const pw_node *node, const pw_node *columns,
                       const pw_node *time, double **times, pw_signal *s) {
  const char *name, *reason, *column[2], *const unit[2] = { "s", table_unit (r) };
  pw_error cause = { 0 };
  if (table_columns (r, label, columns, time, column) != PW_OK) return r->error->status;
  if (pw_yaml_text (r, node, label, &name) != PW_OK) return r->error->status;
  errno = 0;
  FILE *f = table_open (r->y, name, &reason);
  if (f == NULL && pw_open_input_status () == PW_RESOURCE)
    return pw_fail (r->error, PW_RESOURCE, "%s: cannot read %s: %s", r->y->path, name, reason);
  if (f == NULL) return pw_yaml_fail (r, node->at, "%s: cannot read \"%.60s\": %s", label, name, reason);
  double *t = pw_columns_from_stream (f, name, column, unit, 2, PW_GAPS_REFUSED, &s->table.count, &cause);
  fclose (f);
  if (cause.status == PW_INPUT) return pw_yaml_fail (r, node->at, "%s: %s", label, cause.text);
  if (t == NULL || pw_model_keep (r->model, t, free) != PW_OK) return pw_yaml_no_memory (r);
  s->table.t = *times = t;
  s->table.value = t + s->table.count;
  table_skip_gaps (&s->table, t, t + s->table.count);
  return PW_OK;
}

/* Besides the fields of the form. */
static const char *const table_keys[] = { "points", "file", "columns", "time", "time_scale", "time_offset" };
enum { TABLE_KEYS = sizeof table_keys / sizeof *table_keys };

/* Converts the times to time_offset + time_scale t; whole numbers of ms since an epoch stay exact. */
static int table_times (pw_reader *r, const char *label, const pw_node *const v[2], int count, double *t) {
  double scale = 1, offset = 0;
  pw_yaml_number (r, v[0], PW_PRINTED (240, "%s: time_scale", label), PW_POSITIVE, &scale);
  pw_yaml_number (r, v[1], PW_PRINTED (240, "%s: time_offset", label), PW_REAL, &offset);
  for (int i = 0; i < count; i++) t[i] = scale * (t[i] + offset / scale);
  return r->error->status;
}

/* Reads points or columns of a file.  Limits the points of all tables together: many may read the same large file. */
static int table_points (pw_reader *r, const char *label, const pw_node *node, const pw_node *const v[TABLE_KEYS],
                         pw_signal *s) {
  const pw_node *points = v[0], *file = v[1], *columns = v[2], *time = v[3]; /* as table_keys */
  if ((points != NULL) == (file != NULL))
    return pw_yaml_fail (r, node->at, "%s: a table has either points or a file", label);
  if (points && columns) return pw_yaml_fail (r, columns->at, "%s: columns belong to a file", label);
  if (points && time) return pw_yaml_fail (r, time->at, "%s: a column of times belongs to a file", label);
  double *t = NULL;
  int status = points ? table_list (r, label, points, &t, s) : table_file (r, label, file, columns, time, &t, s);
  if (status == PW_OK) status = table_times (r, label, v + 4, s->table.count, t);
  if (status == PW_OK) r->points += s->table.count;
  if (status != PW_OK || r->points <= PW_YAML_MAX_POINTS) return status;
  return pw_yaml_fail (r, node->at, "%s: the tables up to here have more than %d points, the limit for a model", label,
                       PW_YAML_MAX_POINTS);
}

/* ---- Forms made of numbers ---- */

/* Reads the fields of a form, except a table's points; value: of each, or NULL. */
static int signal_fields (pw_reader *r, const pw_signal_form *form, const char *label, const pw_node *node,
                          const pw_node *const *value, pw_signal *signal) {
  for (int i = 0; form->fields[i].name; i++) {
    const pw_field *f = &form->fields[i];
    void *at = (char *)signal + f->offset;
    const char *text = PW_PRINTED (240, "%s: %s", label, f->name);
    if (value[i] == NULL && f->required) pw_yaml_fail (r, node->at, "%s is missing", text);
    if (f->type == PW_NUMBER) pw_yaml_number (r, value[i], text, f->domain, at);
    if (f->type == PW_CHOICE) pw_yaml_choice (r, value[i], text, f->choices, at);
    /* 0 in the structure stands for a scale that is not given, which is 1 */
    if (value[i] && form->type == PW_TABLE && strcmp (f->name, "scale") == 0 && signal->table.scale == 0)
      pw_yaml_fail (r, value[i]->at, "%s: 0 is not permitted", text);
  }
  return r->error->status;
}

/* Checks the signal as a whole; reports an error at the faulty point of a table, or at the signal. */
static int signal_check (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *node,
                         const pw_node *points, const pw_signal *signal) {
  char fault[300];
  int point, i = 0;
  if (*pw_signal_check (signal, kind, &point, fault, sizeof fault) == 0) return PW_OK;
  for (const pw_node *n = points ? points->first : NULL; n; n = n->next, i++)
    if (i == point) node = n;
  return pw_yaml_fail (r, node->at, "%s: %s", label, fault);
}

/* Reads a signal of one form; a table has more keys than fields. */
static int signal_read_form (pw_reader *r, const pw_kind *kind, const pw_signal_form *form, const char *label,
                             const pw_node *node, pw_signal *signal) {
  const char *key[PW_YAML_MAX_KEYS];
  const pw_node *v[PW_YAML_MAX_KEYS];
  int fields = 0, n, is_table = form->type == PW_TABLE;
  *signal = (pw_signal){ .type = form->type };
  for (const pw_field *f = form->fields; f->name; f++) key[fields++] = f->name;
  for (n = fields; is_table && n < fields + TABLE_KEYS; n++) key[n] = table_keys[n - fields];
  key[n] = NULL;
  if (pw_yaml_keys (r, node, key, PW_PRINTED (100, "a %s", form->name), v) != PW_OK ||
      signal_fields (r, form, label, node, v, signal) != PW_OK ||
      (is_table && table_points (r, label, node, v + fields, signal) != PW_OK))
    return r->error->status;
  return signal_check (r, kind, label, node, is_table ? v[fields] : NULL, signal);
}

/* Keys of a signal; those from SIGNAL_FORMS on are the names of the forms. */
enum { SIGNAL_CONSTANT, SIGNAL_EXPRESSION, SIGNAL_RATE, SIGNAL_ACCELERATION, SIGNAL_FORMS };

/* The keys of which a signal has one, for messages: "constant, expression, harmonic, ..." */
static char *signal_list (const char *const *key, char *buffer, size_t size) {
  size_t n = (size_t)snprintf (buffer, size, "%s, %s", key[SIGNAL_CONSTANT], key[SIGNAL_EXPRESSION]);
  for (key += SIGNAL_FORMS; *key && n < size; key++) n += (size_t)snprintf (buffer + n, size - n, ", %s", *key);
  return buffer;
}

/* A signal in braces, such as {harmonic: {...}}. */
static int signal_map (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *node, pw_signal *signal) {
  const char *key[PW_YAML_MAX_KEYS] = { "constant", "expression", "rate", "acceleration" };
  const pw_node *v[PW_YAML_MAX_KEYS];
  char list[100];
  int n = SIGNAL_FORMS, given = 0, form_key = SIGNAL_FORMS;
  for (const pw_signal_form *f = pw_signal_forms; f->name; f++) key[n++] = f->name;
  key[n] = NULL;
  if (pw_yaml_keys (r, node, key, "a signal", v) != PW_OK) return r->error->status;
  for (int i = 0; i < n; i++) {
    given += v[i] != NULL && i != SIGNAL_RATE && i != SIGNAL_ACCELERATION;
    if (v[i] && i >= SIGNAL_FORMS) form_key = i;
  }
  if (given != 1)
    return pw_yaml_fail (r, node->at, "%s: expected one of %s; found %s", label, signal_list (key, list, sizeof list),
                         given ? "several" : "none");
  if (!v[SIGNAL_EXPRESSION] && (v[SIGNAL_RATE] || v[SIGNAL_ACCELERATION]))
    return pw_yaml_fail (r, node->at, "%s: a rate or acceleration belongs to an expression", label);
  if (v[SIGNAL_CONSTANT]) return pw_yaml_number (r, v[SIGNAL_CONSTANT], label, PW_REAL, &signal->constant);
  if (v[SIGNAL_EXPRESSION]) return pw_yaml_time_signal (r, kind, label, v + SIGNAL_EXPRESSION, signal);
  return signal_read_form (r, kind, &pw_signal_forms[form_key - SIGNAL_FORMS], label, v[form_key], signal);
}

int pw_yaml_signal (pw_reader *r, const pw_kind *kind, const char *label, const pw_node *node, pw_signal *signal) {
  const pw_node *const v[3] = { node, NULL, NULL };
  if (node->type == PW_YAML_MAP) return signal_map (r, kind, label, node, signal);
  if (node->type == PW_YAML_SCALAR && pw_yaml_find_variable (node->text))
    return pw_yaml_time_signal (r, kind, label, v, signal);
  return pw_yaml_number (r, node, label, PW_REAL, &signal->constant);
}
