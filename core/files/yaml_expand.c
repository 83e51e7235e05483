/* Expansion of text models: the copies of an entry with the key `repeat`. */
#include <math.h>
#include <string.h>
#include "yaml.h"

/* ---- Copies ----
 *
 * A copy differs from the entry in the texts with braces alone, "link{i - 1}": the entry is copied once, with a list of
 * these texts, which are replaced for each copy. */

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

/* Copies the nodes from one on, except the pair of the key `repeat`, into a list or map. */
static int copy_nodes (pw_copies *c, const pw_node *from, pw_node **to) {
  int status = PW_OK;
  for (const pw_node *n = from; n && status == PW_OK; n = n->next) {
    if (n == c->repeat) {
      n = n->next;
      continue;
    }
    if ((*to = pw_arena_alloc (c->arena, sizeof **to)) == NULL) return PW_RESOURCE;
    **to = *n;
    (*to)->next = NULL;
    if (n->type != PW_YAML_SCALAR)
      (*to)->first = NULL, status = copy_nodes (c, n->first, &(*to)->first);
    else if (strchr (n->text, '{'))
      status = copy_text (c, n, *to);
    else
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
  char text[4 * COPY_TEXT]; /* a number of at most 11 bytes replaces at least 3 */
  c->i = i;
  for (const struct pw_copy_text *t = c->text; t; t = t->next) {
    char *end = text;
    for (const copy_part *p = t->first; p; p = p->next) {
      memcpy (end, p->bytes, p->size);
      end += p->size;
      if (p->number == NULL) continue;
      double value = copy_value (c, p->number) + 0; /* not -0 */
      if (!(fabs (value) <= COPY_NUMBER && value == floor (value)))
        return copy_fail (c, t->source, (size_t)(p->bytes - t->source->text) + p->size,
                          "the value in braces is %g for %s = %d: expected a whole number", value, c->counter, i);
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

/* ---- Expressions that are kept as text ---- */

const char *pw_copies_expression (const pw_copies *c, const char *text, pw_arena *arena) {
  char name[PW_EXPRESSION_NAME];
  size_t room = 1;
  for (const char *rest = text, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    room += strcmp (name, c->counter) == 0;
  if (room == 1) return text;
  char *copy = pw_arena_alloc (arena, strlen (text) + room * 16), *end = copy;
  const char *from = text;
  for (const char *rest = text, *p; copy && (p = pw_expression_next_name (&rest, name)) != NULL;) {
    if (strcmp (name, c->counter) != 0) continue;
    end += sprintf (end, "%.*s(%d)", (int)(p - from), from, c->i);
    from = rest;
  }
  return copy ? strcpy (end, from), copy : NULL;
}
