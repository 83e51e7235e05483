/* The points of a table in a text model: a list of [time, value], or two columns of a file in the model's own folder. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

/* ---- In the model ---- */

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

/* ---- In a file ---- */

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

/* A model that is passed on can read what is passed on with it, nothing else. */
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

/* The unit of the field that is read.  "m or rad" is that of the word a choice of the element has: an angle's, or not. */
static const char *table_unit (const pw_yaml_builder *b) {
  if (b->field->unit == NULL || strcmp (b->field->unit, "m or rad") != 0) return b->field->unit;
  const pw_field *choice = b->field;
  while (choice->type != PW_CHOICE) choice--; /* a field with two units has it before */
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

int pw_yaml_each_table (const pw_yaml *y, const pw_node *node, int (*each) (void *context, const char *path),
                        void *context) {
  int stop = 0;
  for (const pw_node *n = node->type == PW_YAML_SCALAR ? NULL : node->first; n && !stop; n = n->next) {
    const pw_node *value = node->type == PW_YAML_MAP ? n->next : NULL;
    if (value && n->type == PW_YAML_SCALAR && strcmp (n->text, "file") == 0 && value->type == PW_YAML_SCALAR) {
      char *path = pw_join (y->folder, value->text, "");
      stop = path ? each (context, path) : PW_MACHINE;
      free (path);
    }
    if (!stop) stop = pw_yaml_each_table (y, n, each, context);
  }
  return stop;
}

/* Many tables may be read from one file. */
int pw_yaml_points (pw_yaml_builder *b, const char *what, const pw_node *node, const pw_node *const v[3], pw_signal *s,
                    pw_error *error) {
  int status = table_read (b, what, node, v, s, error);
  if (status == PW_OK) b->points += s->table.count;
  if (status != PW_OK || b->points <= PW_YAML_POINTS) return status;
  return pw_yaml_fail (b->y, node->at, error, "%s: the tables up to here have more than %d points, the most of a model",
                       what, PW_YAML_POINTS);
}
