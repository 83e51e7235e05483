/* Expansion of text models: copies of an entry with the key `repeat`; included files and their places in the plane. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"

/* ---- Copies ----
 *
 * Copies differ only in texts with braces, such as "link{i - 1}".  The entry is therefore copied once, with a list of
 * these texts.  For each value of the counter only they are replaced. */

enum { COPY_TEXT = 4000 /* bytes of a text with braces, at most */ };
#define COPY_NUMBER 1e9 /* largest number in braces */

/* Part of a text: some bytes, then a number in braces unless it is the last part. */
typedef struct copy_part {
  struct copy_part *next;
  const char *bytes;
  size_t size;
  const pw_expression *number; /* or NULL */
} copy_part;

struct pw_copy_text {
  struct pw_copy_text *next;
  const pw_node *source; /* in the entry */
  pw_node *node;         /* in the copy */
  copy_part *first;
};

/* Records an error at an offset of a text. */
#define copy_fail(c, node, offset, ...)                                                                         \
  ((c)->faulty = node, (c)->fault.at = offset, pw_print ((c)->fault.text, sizeof (c)->fault.text, __VA_ARGS__), \
   PW_INPUT)

/* Reads an expression of the counter, which is not its first variable: that is the time. */
static int copy_expression (pw_copies *c, const char *text, const pw_expression **x, pw_expression_error *error) {
  return pw_expression_read (c->scope, (const char *const[]){ "", c->counter, NULL }, text, c->arena, x, error);
}

static double copy_value (const pw_copies *c, const pw_expression *x) {
  return pw_expression_value (x, (const double[2]){ 0, c->i });
}

/* Divides the text at *rest into bytes and a number; *rest is NULL after the last part. */
static int copy_part_read (pw_copies *c, const pw_node *source, const char **rest, copy_part *part) {
  const char *open = strchr (*rest, '{');
  part->bytes = *rest;
  part->size = open ? (size_t)(open - *rest) : strlen (*rest);
  *rest = NULL;
  if (open == NULL) return PW_OK;
  const size_t at = (size_t)(open - source->text) + 1, size = strcspn (open + 1, "}");
  if (open[1 + size] == 0) return copy_fail (c, source, at - 1, "there is no \"}\" for this \"{\"");
  *rest = open + size + 2;
  int status = copy_expression (c, PW_PRINTED (COPY_TEXT + 1, "%.*s", (int)size, open + 1), &part->number, &c->fault);
  c->faulty = source;
  c->fault.at += at;
  return status;
}

static int copy_text (pw_copies *c, const pw_node *source, pw_node *node) {
  struct pw_copy_text *t = pw_arena_alloc (c->arena, sizeof *t);
  copy_part **to = t ? &t->first : NULL;
  int status = PW_OK;
  if (t == NULL) return PW_RESOURCE;
  if (strlen (source->text) > COPY_TEXT)
    return copy_fail (c, source, 0, "a text with braces has at most %d bytes", COPY_TEXT);
  *t = (struct pw_copy_text){ c->text, source, node, NULL };
  c->text = t;
  for (const char *rest = source->text; rest && status == PW_OK; to = &(*to)->next) {
    if ((*to = pw_arena_alloc (c->arena, sizeof **to)) == NULL) return PW_RESOURCE;
    status = copy_part_read (c, source, &rest, *to);
  }
  return status;
}

/* Copies `from` and the nodes after it, except the key `repeat` and its value, to the list *to. */
static int copy_nodes (pw_copies *c, const pw_node *from, pw_node **to) {
  int status = PW_OK;
  for (const pw_node *n = from; n && status == PW_OK; n = n->next) {
    if (n == c->repeat) {
      n = n->next;
      continue;
    }
    if (pw_yaml_repeat (n)) return copy_fail (c, pw_yaml_repeat (n), 0, "repeat: inside another repeat");
    if ((*to = pw_arena_alloc (c->arena, sizeof **to)) == NULL) return PW_RESOURCE;
    **to = *n;
    (*to)->next = NULL;
    if (n->type != PW_YAML_SCALAR && !n->is_file) /* the entries of a file are no copies */
      (*to)->first = NULL, status = copy_nodes (c, n->first, &(*to)->first);
    else if (n->type == PW_YAML_SCALAR && strchr (n->text, '{'))
      status = copy_text (c, n, *to);
    else if (n->type == PW_YAML_SCALAR)
      (*to)->count = ++c->scalars;
    to = &(*to)->next;
  }
  return status;
}

const pw_node *pw_yaml_repeat (const pw_node *entry) {
  for (const pw_node *n = entry->type == PW_YAML_MAP ? entry->first : NULL; n; n = n->next->next)
    if (n->type == PW_YAML_SCALAR && strcmp (n->text, "repeat") == 0) return n;
  return NULL;
}

int pw_copies_open (pw_copies *c, const pw_node *entry) {
  if ((c->entry = pw_arena_alloc (c->arena, sizeof *c->entry)) == NULL) return PW_RESOURCE;
  *c->entry = *entry;
  c->entry->next = c->entry->first = NULL;
  c->entry->count--;
  int status = copy_nodes (c, entry->first, &c->entry->first);
  c->number = pw_arena_alloc (c->arena, ((size_t)c->scalars + 1) * sizeof *c->number);
  return status == PW_OK && c->number == NULL ? PW_RESOURCE : status;
}

int pw_copies_set (pw_copies *c, int i) {
  char text[4 * COPY_TEXT]; /* at most 11 bytes of a number replace at least 3, "{i}" */
  c->i = i;
  for (const struct pw_copy_text *t = c->text; t; t = t->next) {
    char *end = text;
    for (const copy_part *p = t->first; p; p = p->next) {
      memcpy (end, p->bytes, p->size);
      end += p->size;
      if (p->number == NULL) continue;
      double value = copy_value (c, p->number) + 0;                        /* not -0 */
      if (!(value >= 0 && value <= COPY_NUMBER && value == floor (value))) /* -1 would be a difference: "z-1" */
        return copy_fail (c, t->source, (size_t)(p->bytes - t->source->text) + p->size,
                          "the value in braces is %g for %s = %d: expected a whole number >= 0", value, c->counter, i);
      end += snprintf (end, 20, "%ld", (long)value);
    }
    *end = 0;
    c->bytes += (double)(end - text);
    if ((t->node->text = pw_arena_copy (c->arena, text)) == NULL) return PW_RESOURCE;
  }
  return PW_OK;
}

int pw_copies_number (pw_copies *c, const pw_node *node, double *value, pw_expression_error *error) {
  const pw_expression *own = NULL, **x = node->count ? &c->number[node->count] : &own;
  c->bytes += node->count ? 0 : (double)strlen (node->text);
  int status = *x ? PW_OK : copy_expression (c, node->text, x, error);
  if (status == PW_OK) *value = copy_value (c, *x);
  return status;
}

/* What replaces a name, or NULL. */
static const char *rename_of (const pw_renames *names, const char *name, char to[200]) {
  const pw_copies *c = names->copies;
  if (c && strcmp (name, c->counter) == 0) return pw_print (to, 200, "(%d)", c->i);
  if (*names->prefix == 0) return NULL;
  pw_print (to, 200, "%s%s", names->prefix, name);
  if (strchr (name, '.') || pw_names_find (names->states, to) >= 0 || pw_names_find (names->outputs, to) >= 0)
    return to;
  int i = pw_names_find (&names->scope->index, name);
  return i < 0 || names->scope->path[i] ? NULL : pw_print (to, 200, "(%.17g)", names->scope->value[i]);
}

const char *pw_yaml_renamed (const pw_renames *names, const char *text, pw_arena *arena) {
  char name[PW_EXPRESSION_NAME], to[200];
  size_t size = strlen (text) + 1;
  int changes = 0;
  for (const char *rest = text; pw_expression_next_word (&rest, name) != NULL;)
    if (rename_of (names, name, to)) size += strlen (to), changes++;
  if (changes == 0) return text;
  char *copy = pw_arena_alloc (arena, size), *end = copy;
  const char *from = text;
  for (const char *rest = text, *p; copy && (p = pw_expression_next_word (&rest, name)) != NULL;) {
    if (rename_of (names, name, to) == NULL) continue;
    end += sprintf (end, "%.*s%s", (int)(p - from), from, to);
    from = rest;
  }
  return copy ? strcpy (end, from), copy : NULL;
}

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

void pw_yaml_close (pw_yaml *y) {
  if (y == NULL) return;
  pw_arena_free (&y->arena);
  free (y->source);
  free (y);
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

pw_place pw_place_in (const pw_place *around, const double at[2], double phi) {
  pw_place p = { .at = { at[0], at[1] }, .phi = phi, .cos = 1 };
  if (around) {
    pw_place_point (around, p.at);
    p.phi += around->phi;
  }
  if (p.phi != 0) p.cos = cos (p.phi), p.sin = sin (p.phi);
  return p;
}

void pw_place_turn (const pw_place *p, int sign, double v[2]) {
  const double x = v[0], y = v[1], s = sign * p->sin;
  if (p->phi == 0) return; /* so that no bit changes */
  v[0] = p->cos * x - s * y;
  v[1] = s * x + p->cos * y;
}

void pw_place_point (const pw_place *p, double v[2]) {
  pw_place_turn (p, 1, v);
  v[0] += p->at[0], v[1] += p->at[1];
}

void pw_place_back (const pw_place *p, double v[2]) {
  v[0] -= p->at[0], v[1] -= p->at[1];
  pw_place_turn (p, -1, v);
}

const char *pw_place_body (const pw_place *p, pw_body *body) {
  for (int i = 0; p && p->phi != 0 && i < 6; i += 3)
    if ((body->specified >> i & 1) != (body->specified >> (i + 1) & 1)) return i ? "vx and vy" : "x and y";
  if (p) pw_place_point (p, body->start), pw_place_turn (p, 1, body->rate);
  body->start[2] += p ? p->phi : 0;
  return "";
}

void pw_place_bar (pw_body *body, const double from[2], const double to[2]) {
  const double dx = to[0] - from[0], dy = to[1] - from[1];
  body->inertia = body->mass * (dx * dx + dy * dy) / 12;
  body->start[0] = (from[0] + to[0]) / 2, body->start[1] = (from[1] + to[1]) / 2, body->start[2] = atan2 (dy, dx);
  body->specified |= 7;
}

const char *pw_place_body_of (const pw_kind *kind, const char *definition, int i) {
  const char *name = NULL;
  for (const pw_field *f = kind->fields; f->name; f++)
    if (f->type == PW_BODY && i < pw_field_count (f))
      memcpy (&name, definition + f->offset + (size_t)i * pw_field_bytes (PW_BODY), sizeof name);
  return name;
}

const char *pw_place_direction (const pw_place *p, const pw_kind *kind, const char *definition) {
  const char *body = pw_place_body_of (kind, definition, 0), *second = pw_place_body_of (kind, definition, 1);
  if (p == NULL || p->phi == 0 || kind == &pw_kind_state) return NULL;
  if (body && strcmp (body, "ground") != 0 && (second == NULL || strcmp (second, "ground") != 0)) return NULL;
  for (const pw_field *f = kind->fields; f->name; f++)
    if (f->type == PW_SIGNAL || f->type == PW_CHOICE || f->type == PW_VECTOR ||
        (f->type == PW_NUMBER && f->domain == PW_REAL))
      return f->name;
  return NULL;
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
