/* Trees of text models as bytes, for programs without libfyaml: interactive pages.  A node is its type, whether it is
 * quoted, its offset and its count or, of a scalar, its size; then its entries or its text. */
#include <string.h>
#include "yaml.h"

typedef struct {
  unsigned char type, quoted, unused[2]; /* no padding, which would be written uninitialised */
  unsigned at, count;
} stored_head;

/* ---- Writing ---- */

static void stored_write (const pw_node *n, FILE *f) {
  int scalar = n->type == PW_YAML_SCALAR;
  stored_head h = { n->type, n->quoted, { 0 }, n->at, scalar ? (unsigned)strlen (n->text) : (unsigned)n->count };
  fwrite (&h, sizeof h, 1, f);
  if (scalar) fwrite (n->text, 1, h.count, f);
  for (const pw_node *entry = scalar ? NULL : n->first; entry; entry = entry->next) stored_write (entry, f);
}

void pw_yaml_write_tree (const pw_yaml *y, FILE *f) {
  if (y->root) stored_write (y->root, f);
}

/* ---- Reading ---- */

typedef struct {
  pw_yaml *y;
  const char *at, *end;
  int status; /* of the load; what is incomplete is PW_INPUT */
} stored_bytes;

static void *stored_alloc (stored_bytes *x, size_t size) {
  void *p = pw_arena_alloc (&x->y->arena, size);
  if (p == NULL) x->status = PW_RESOURCE;
  return p;
}

static pw_node *stored_read (stored_bytes *x, int depth) {
  stored_head h;
  if ((size_t)(x->end - x->at) < sizeof h || depth > PW_YAML_DEPTH) return NULL;
  memcpy (&h, x->at, sizeof h);
  x->at += sizeof h;
  pw_node *n = stored_alloc (x, sizeof *n), **to;
  if (n == NULL || h.count > (size_t)(x->end - x->at)) return NULL;
  *n = (pw_node){ .at = h.at, .count = (int)h.count, .type = h.type, .quoted = h.quoted };
  if (h.type == PW_YAML_SCALAR) {
    char *text = stored_alloc (x, (size_t)h.count + 1);
    if (text == NULL) return NULL;
    memcpy (text, x->at, h.count);
    n->text = text;
    n->count = 0;
    x->at += h.count;
    return n;
  }
  to = &n->first;
  for (unsigned i = 0; i < h.count * (h.type == PW_YAML_MAP ? 2 : 1); i++, to = &(*to)->next)
    if ((*to = stored_read (x, depth + 1)) == NULL) return NULL;
  return n;
}

int pw_yaml_load_tree (pw_yaml *y, const char *bytes, size_t size, pw_error *error) {
  stored_bytes x = { y, bytes, bytes + size, PW_INPUT };
  y->root = stored_read (&x, 0);
  return y->root ? PW_OK
                 : pw_fail (error, x.status, "%s: %s", y->path,
                            x.status == PW_INPUT ? "the stored tree is incomplete" : "out of memory");
}
