/* Parts of text models: copies of a repeated entry, files that a model reads, places of included files in the plane. */
#define _XOPEN_SOURCE 700 /* realpath */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "yaml.h"
#include "pinwheel.h"

/* ---- Copies ----
 *
 * A copy differs from the entry in the texts with braces, "link{i - 1}", alone: the entry is copied once, with a list of
 * these texts, which are replaced for each copy. */

enum { COPY_TEXT = 4000 /* bytes of a text with braces, at most */ };
#define COPY_NUMBER 1e9 /* largest number in braces */

/* Part of a text: some bytes, then a number in braces unless it is the last part. */
typedef struct copy_part {
  struct copy_part *next;
  const char *bytes;
  int size;
  const pw_expression *number; /* or NULL */
} copy_part;

struct pw_copy_text {
  struct pw_copy_text *next;
  const pw_node *source; /* in the entry */
  pw_node *node;         /* in the copy */
  copy_part *first;
};

/* Records an error at an offset of a text. */
#define copy_fail(c, node, offset, ...) \
  ((c)->faulty = node, (c)->fault.at = offset, pw_print ((c)->fault.text, sizeof (c)->fault.text, __VA_ARGS__), PW_INPUT)

/* Divides the text at *rest into bytes and a number; *rest is NULL after the last part. */
static int copy_part_read (pw_copies *c, const pw_node *source, const char **rest, copy_part *part) {
  const char *const variable[] = { c->counter, NULL }, *open = strchr (*rest, '{');
  part->bytes = *rest;
  part->size = (int)(open ? (size_t)(open - *rest) : strlen (*rest));
  *rest = NULL;
  if (open == NULL) return PW_OK;
  const size_t at = (size_t)(open - source->text) + 1, size = strcspn (open + 1, "}");
  if (open[1 + size] == 0) return copy_fail (c, source, at - 1, "\"{\" without \"}\"");
  *rest = open + size + 2;
  const char *number = PW_PRINTED (COPY_TEXT + 1, "%.*s", (int)size, open + 1);
  int status = pw_expression_read (c->scope, variable, number, c->arena, &part->number, &c->fault);
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

/* Copies the nodes from one on, except the pair of the key `repeat`, if skip_repeat is 1, into a list or map. */
static int copy_nodes (pw_copies *c, const pw_node *from, int skip_repeat, pw_node **to) {
  int status = PW_OK;
  for (const pw_node *n = from; n && status == PW_OK; n = n->next) {
    if (skip_repeat && n == c->repeat) {
      n = n->next;
      continue;
    }
    if ((*to = pw_arena_alloc (c->arena, sizeof **to)) == NULL) return PW_RESOURCE;
    **to = *n;
    (*to)->next = NULL;
    if (n->type != PW_YAML_SCALAR)
      (*to)->first = NULL, status = copy_nodes (c, n->first, 0, &(*to)->first);
    else if (strchr (n->text, '{'))
      status = copy_text (c, n, *to);
    else
      (*to)->count = ++c->scalars;
    to = &(*to)->next;
  }
  return status;
}

const pw_node *pw_copies_repeat (const pw_node *entry) {
  for (const pw_node *n = entry->type == PW_YAML_MAP ? entry->first : NULL; n; n = n->next->next)
    if (n->type == PW_YAML_SCALAR && strcmp (n->text, "repeat") == 0) return n;
  return NULL;
}

int pw_copies_open (pw_copies *c, const pw_node *entry) {
  if ((c->entry = pw_arena_alloc (c->arena, sizeof *c->entry)) == NULL) return PW_RESOURCE;
  *c->entry = *entry;
  c->entry->next = c->entry->first = NULL;
  c->entry->count--;
  int status = copy_nodes (c, entry->first, 1, &c->entry->first);
  c->number = pw_arena_alloc (c->arena, ((size_t)c->scalars + 1) * sizeof *c->number);
  return status == PW_OK && c->number == NULL ? PW_RESOURCE : status;
}

int pw_copies_number (pw_copies *c, const pw_node *node, double i, double *value) {
  const char *const variable[] = { c->counter, NULL };
  const pw_expression **x = &c->number[node->count];
  if (*x == NULL && pw_expression_read (c->scope, variable, node->text, c->arena, x, &c->fault) != PW_OK) return 0;
  *value = pw_expression_value (*x, &i);
  return 1;
}

int pw_copies_set (pw_copies *c, double i) {
  char text[4 * COPY_TEXT]; /* a number of at most 11 bytes replaces at least 3 */
  for (const struct pw_copy_text *t = c->text; t; t = t->next) {
    char *end = text;
    for (const copy_part *p = t->first; p; p = p->next) {
      memcpy (end, p->bytes, (size_t)p->size);
      end += p->size;
      if (p->number == NULL) continue;
      double value = pw_expression_value (p->number, &i) + 0; /* not -0 */
      if (!(fabs (value) <= COPY_NUMBER && value == floor (value)))
        return copy_fail (c, t->source, (size_t)(p->bytes - t->source->text) + (size_t)p->size,
                          "the value in braces is %g, not a whole number of at most %g", value, COPY_NUMBER);
      end += snprintf (end, 20, "%ld", (long)value);
    }
    *end = 0;
    c->bytes += (double)(end - text);
    if ((t->node->text = pw_arena_copy (c->arena, text)) == NULL) return PW_RESOURCE;
  }
  return PW_OK;
}

/* ---- Files ---- */

char *pw_yaml_path (const pw_yaml *y, const char *name, char path[PW_PATH]) {
  return pw_path (path, "%s/%s", y->folder, name);
}

int pw_yaml_find (const pw_yaml *y, const char *name, char path[PW_PATH], const char **reason) {
  char joined[PW_PATH];
  const char *top = y->model->folder;
  size_t n = strlen (top); /* 0 for the root */
  *reason = "it must be in the model's folder: its path is relative and has no \"..\"";
  if (*name == '/' || strstr (PW_PRINTED (PW_PATH + 2, "/%s/", name), "/../")) return 0;
  if (realpath (pw_yaml_path (y, name, joined), path) == NULL) return *reason = strerror (errno), 0;
  *reason = "it is a link that leads out of the model's folder";
  return strncmp (path, top, n) == 0 && (path[n] == '/' || path[n] == 0);
}

pw_yaml *pw_yaml_included (const pw_yaml *y, const char *name) {
  char path[PW_PATH];
  pw_yaml_path (y, name, path);
  for (pw_yaml *file = y->model->next; file; file = file->next)
    if (strcmp (file->file, path) == 0) return file;
  return NULL;
}

/* ---- Places ---- */

pw_place pw_place_in (const pw_place *around, double x, double y, double phi) {
  pw_place p = { .at = { x, y }, .phi = phi, .cos = 1 };
  if (around) {
    pw_place_point (around, p.at);
    p.phi += around->phi;
  }
  if (p.phi != 0) pw_sin_cos (p.phi, &p.sin, &p.cos);
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
