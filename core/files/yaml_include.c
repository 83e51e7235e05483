/* Included files of text models. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

enum { INCLUDE_MOST = 1000 /* files of a model */ };

/* A file that is being read, and those that include it. */
typedef struct level {
  const struct level *up;
  const char *path; /* links resolved */
  int depth;
} level;

int pw_yaml_find (const pw_yaml *y, size_t at, const char *name, char path[PW_PATH], char from_model[PW_PATH],
                  const char **reason) {
  char part[PW_PATH], joined[PW_PATH];
  size_t n = strlen (y->folder); /* 0 for the root */
  pw_yaml_part (y, at, part);
  char *slash = strrchr (part, '/');
  *reason = "a file must be in the model's folder: its path is relative and has no \"..\"";
  if (*name == '/' || strstr (PW_PRINTED (PW_PATH + 2, "/%s/", name), "/../")) return 0;
  pw_path (from_model, "%.*s%s", slash ? (int)(slash - part) + 1 : 0, part, name);
  if (realpath (pw_path (joined, "%s/%s", y->folder, from_model), path) == NULL) return *reason = strerror (errno), 0;
  *reason = "it is a link that leads out of the model's folder";
  return strncmp (path, y->folder, n) == 0 && (path[n] == '/' || path[n] == 0);
}

/* Appends the text of a file, after a line with its path (pw_yaml_part). */
static int include_append (pw_yaml *y, const char *path, const char *from_model, size_t max_bytes, pw_error *error) {
  char shown[PW_PATH];
  const char *slash = strrchr (y->path, '/');
  pw_yaml file = { .path = pw_path (shown, "%.*s%s", slash ? (int)(slash - y->path) + 1 : 0, y->path, from_model) };
  int status = pw_yaml_read_source (&file, path, max_bytes > y->size ? max_bytes - y->size : 0, error);
  size_t n = strlen (from_model) + 3;
  char *source = status == PW_OK ? realloc (y->source, y->size + n + file.size + 1) : NULL;
  if (source) {
    snprintf (source + y->size, n + 1, "\n\f%s\n", from_model);
    memcpy (source + y->size + n, file.source, file.size + 1);
    y->source = source;
    y->begin = y->size + n;
    y->size = y->begin + file.size;
  }
  free (file.source);
  return status != PW_OK || source ? status : pw_yaml_no_memory (y, error);
}

static int include_all (pw_yaml *y, const pw_node *root, const level *up, size_t max_bytes, pw_error *error);

static int include_file (pw_yaml *y, pw_node *node, const level *up, size_t max_bytes, pw_error *error) {
  char path[PW_PATH], from_model[PW_PATH];
  const char *reason, *name = node->text;
  const size_t at = node->at;
  errno = 0;
  if (strlen (name) > 1000 || strchr (name, '\n'))
    return pw_yaml_fail (y, error, at, "file: expected the path of a file, of at most 1000 bytes in one line");
  if (!pw_yaml_find (y, at, name, path, from_model, &reason))
    return pw_yaml_fail (y, error, at, "file: cannot read \"%.60s\": %s", name, reason);
  for (const level *l = up; l; l = l->up)
    if (strcmp (l->path, path) == 0) return pw_yaml_fail (y, error, at, "file: \"%.60s\" includes itself", name);
  if (up->depth == PW_YAML_FILES)
    return pw_yaml_fail (y, error, at, "file: included files include each other at most %d deep", PW_YAML_FILES);
  if (y->files++ == INCLUDE_MOST)
    return pw_yaml_fail (y, error, at, "file: the files up to here are more than %d, the limit for a model",
                         INCLUDE_MOST);
  if (include_append (y, path, from_model, max_bytes, error) != PW_OK) return error->status;
  const pw_node *root = y->root;
  if (pw_yaml_read_tree (y, error) != PW_OK) return error->status;
  pw_node *next = node->next, *file = (pw_node *)(uintptr_t)y->root;
  y->root = root;
  if (file == NULL || file->type != PW_YAML_MAP)
    return pw_yaml_fail (y, error, y->begin, "a model begins with \"pinwheel: 1\", also in an included file");
  *node = *file;
  node->next = next;
  node->is_file = 1;
  return include_all (y, node, &(level){ up, path, up->depth + 1 }, max_bytes, error);
}

/* Reads the files in the list `include` of a file.  Reading the elements reports malformed entries later. */
static int include_all (pw_yaml *y, const pw_node *root, const level *up, size_t max_bytes, pw_error *error) {
  for (const pw_node *key = root && root->type == PW_YAML_MAP ? root->first : NULL; key; key = key->next->next) {
    const pw_node *list = key->next;
    if (key->type != PW_YAML_SCALAR || strcmp (key->text, "include") != 0 || list->type != PW_YAML_LIST) continue;
    for (const pw_node *entry = list->first; entry; entry = entry->next)
      for (pw_node *n = entry->type == PW_YAML_MAP ? entry->first : NULL; n; n = n->next->next)
        if (n->type == PW_YAML_SCALAR && strcmp (n->text, "file") == 0 && n->next->type == PW_YAML_SCALAR &&
            include_file (y, n->next, up, max_bytes, error) != PW_OK)
          return error->status;
  }
  return PW_OK;
}

int pw_yaml_read_files (pw_yaml *y, const char *path, const char *shown, size_t max_bytes, pw_error *error) {
  const char *slash = strrchr (path, '/');
  y->path = pw_arena_copy (&y->arena, shown);
  y->folder = pw_arena_copy (&y->arena, slash ? path : ".");
  if (y->path == NULL || y->folder == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  if (slash) y->folder[slash - path] = 0; /* "" for "/model.yaml" */
  int status = pw_yaml_read_source (y, path, max_bytes, error);
  if (status == PW_OK) status = pw_yaml_read_tree (y, error);
  return status == PW_OK ? include_all (y, y->root, &(level){ NULL, path, 1 }, max_bytes, error) : status;
}

/* Calls `each` with the path of every table named below a node. */
static int files_tables (const pw_yaml *y, const pw_node *node, pw_yaml_each *each, void *context) {
  char path[PW_PATH], part[PW_PATH];
  int stop = 0;
  for (const pw_node *n = node->type == PW_YAML_SCALAR ? NULL : node->first; n && !stop; n = n->next) {
    const pw_node *key = node->type == PW_YAML_MAP ? n : NULL;
    if (key) n = key->next; /* its value */
    const char *name = key && key->type == PW_YAML_SCALAR ? key->text : "";
    if (strcmp (name, "let") == 0 || strcmp (name, "set") == 0) continue; /* names of numbers */
    if ((strcmp (name, "file") == 0 || strcmp (name, "outline") == 0) && n->type == PW_YAML_SCALAR) {
      pw_yaml_part (y, n->at, part);
      char *slash = strrchr (part, '/');
      stop = each (context, pw_path (path, "%s/%.*s%s", y->folder, slash ? (int)(slash - part) + 1 : 0, part, n->text));
    } else
      stop = files_tables (y, n, each, context);
  }
  return stop;
}

int pw_yaml_tables (const pw_yaml *y, int with_included, pw_yaml_each *each, void *context) {
  char path[PW_PATH], part[PW_PATH];
  int stop = files_tables (y, y->root, each, context);
  for (const char *p = y->source; with_included && !stop && (p = strchr (p, '\f')) != NULL; p++) {
    pw_yaml_part (y, (size_t)(p + 1 - y->source), part);
    stop = each (context, pw_path (path, "%s/%s", y->folder, part));
  }
  return stop;
}

/* The value of a key of a map; NULL: it has none, or is no map. */
static const pw_node *include_value (const pw_node *map, const char *key) {
  const pw_node *k = map && map->type == PW_YAML_MAP ? map->first : NULL;
  while (k && (k->type != PW_YAML_SCALAR || strcmp (k->text, key) != 0)) k = k->next->next;
  return k ? k->next : NULL;
}

const char *pw_yaml_included_parameter (const pw_node *root, const char *name) {
  const pw_node *list = include_value (root, "include");
  for (const pw_node *entry = list && list->type == PW_YAML_LIST ? list->first : NULL; entry; entry = entry->next) {
    const pw_node *file = include_value (entry, "file"), *prefix = include_value (entry, "prefix"),
                  *parameters = include_value (file, "parameters");
    const size_t n = prefix && prefix->type == PW_YAML_SCALAR ? strlen (prefix->text) : 0;
    const char *own = n && strncmp (name, prefix->text, n) == 0 ? name + n : name;
    for (const pw_node *p = parameters && parameters->type == PW_YAML_LIST ? parameters->first : NULL; p; p = p->next) {
      const pw_node *known = include_value (p, "name");
      if (known && known->type == PW_YAML_SCALAR && strcmp (known->text, own) == 0) return known->text;
    }
    const char *below = pw_yaml_included_parameter (file, own);
    if (below) return below;
  }
  return NULL;
}
