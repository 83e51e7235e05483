/* Reads keys, lists, texts and numbers from the tree. */
#include <stdarg.h>
#include <string.h>
#include "yaml.h"

const char *pw_yaml_found (const pw_node *node) {
  return node->type == PW_YAML_LIST ? "a list" : node->type == PW_YAML_MAP ? "a map" : "text";
}

/* ---- Maps ---- */

/* A hint for a key that is not a plain name, or "". */
static const char *read_key_hint (const char *text, const char *const *key) {
  for (int i = 0; key[i]; i++) {
    size_t n = strlen (key[i]);
    if (strncmp (text, key[i], n) == 0 && text[n] == ':') return "; a space goes after the colon";
    if (strncmp (text, key[i], n) == 0 && text[n] == ' ') return "; a colon goes after the key";
  }
  if (*text && strspn (text, "0123456789") == strlen (text)) return "; decimals are written with a point";
  if (strpbrk (text, "()*/^")) return "; an expression with commas goes between double quotes";
  return "";
}

static int read_key (const pw_reader *r, const pw_node *node, const char *const *key, const char *owner,
                     const pw_node **value) {
  if (node->type != PW_YAML_SCALAR)
    return pw_yaml_fail (r, node->at, "expected a key of %s, found %s", owner, pw_yaml_found (node));
  for (int i = 0; key[i]; i++) {
    if (strcmp (key[i], node->text) != 0) continue;
    if (value[i]) return pw_yaml_fail (r, node->at, "\"%s\" appears twice", key[i]);
    value[i] = node->next;
    int empty = node->next->type == PW_YAML_SCALAR && !node->next->quoted && *node->next->text == 0;
    return empty ? pw_yaml_fail (r, node->at, "\"%s\" has no value", key[i]) : PW_OK;
  }
  pw_nearest near = { .sought = node->text };
  for (int i = 0; key[i]; i++) pw_nearest_try (&near, key[i]);
  const char *hint = read_key_hint (node->text, key);
  return pw_yaml_fail (r, node->at, "%s has no \"%.60s\"%s", owner, node->text, *hint ? hint : pw_nearest_text (&near));
}

int pw_yaml_keys_from (const pw_reader *r, const pw_node *first, const char *const *key, const char *owner,
                       const pw_node **value) {
  for (int i = 0; key[i]; i++) value[i] = NULL;
  for (const pw_node *n = first; n && r->error->status == PW_OK; n = n->next->next) read_key (r, n, key, owner, value);
  return r->error->status;
}

int pw_yaml_keys (const pw_reader *r, const pw_node *map, const char *const *key, const char *owner,
                  const pw_node **value) {
  if (map && map->type != PW_YAML_MAP) {
    char form[100] = "{";
    for (size_t i = 0, n = 1; key[i]; i++, n = strlen (form))
      snprintf (form + n, sizeof form - n, "%s: ..%s", key[i], key[i + 1] ? ", " : "}");
    pw_yaml_fail (r, map->at, "expected a map %s for %s, found %s", form, owner, pw_yaml_found (map));
    map = NULL;
  }
  return pw_yaml_keys_from (r, map ? map->first : NULL, key, owner, value);
}

int pw_yaml_list (const pw_reader *r, const pw_node *node, const char *label) {
  if (node && node->type != PW_YAML_LIST)
    pw_yaml_fail (r, node->at, "%s: expected a list, found %s", label, pw_yaml_found (node));
  return r->error->status;
}

int pw_yaml_list_of (const pw_reader *r, const pw_node *node, const char *label, int count, const char *items) {
  if (node && node->type != PW_YAML_LIST)
    pw_yaml_fail (r, node->at, "%s: expected a list of %d %s, found %s", label, count, items, pw_yaml_found (node));
  else if (node && node->count != count)
    pw_yaml_fail (r, node->at, "%s: expected a list of %d %s, found one of %d", label, count, items, node->count);
  return r->error->status;
}

/* ---- Scalars ---- */

int pw_yaml_text (const pw_reader *r, const pw_node *node, const char *label, const char **text) {
  if (node == NULL) return r->error->status;
  if (node->type != PW_YAML_SCALAR || *node->text == 0)
    return pw_yaml_fail (r, node->at, "%s: expected text, found %s", label,
                         node->type == PW_YAML_SCALAR ? "none" : pw_yaml_found (node));
  *text = node->text;
  return r->error->status;
}

size_t pw_yaml_offset (const pw_yaml *y, const pw_node *node, size_t offset) {
  size_t at = node->at + (node->quoted != 0), n = strlen (node->text);
  return at + n <= y->size && strncmp (y->source + at, node->text, n) == 0 ? at + offset : node->at;
}

const char *pw_yaml_find_variable (const char *text) {
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    if (strcmp (name, "t") == 0 || strchr (name, '.')) return p;
  return NULL;
}

int pw_yaml_number (const pw_reader *r, const pw_node *node, const char *label, pw_domain domain, double *value) {
  pw_expression_error error;
  if (node == NULL || r->error->status != PW_OK) return r->error->status;
  if (node->type != PW_YAML_SCALAR)
    return pw_yaml_fail (r, node->at, "%s: expected a number, found %s", label, pw_yaml_found (node));
  int status =
      pw_expression_number (node->text, value) ? PW_OK : pw_expression_constant (r->scope, node->text, value, &error);
  if (status == PW_RESOURCE) return pw_yaml_no_memory (r);
  if (status != PW_OK)
    return pw_yaml_fail (r, pw_yaml_offset (r->y, node, error.at), "%s: %s", label,
                         pw_yaml_find_variable (node->text) == node->text + error.at
                             ? "only the value of a signal may depend on the time t or on states"
                             : error.text);
  const char *expected = pw_domain_check (domain, *value);
  return *expected ? pw_yaml_fail (r, node->at, "%s = %g: expected %s", label, *value, expected) : PW_OK;
}

/* ---- Pairs, choices, bodies ---- */

int pw_yaml_pair (const pw_reader *r, const pw_node *node, const char *label, const char *items, double *value) {
  if (node == NULL || pw_yaml_list_of (r, node, label, 2, items) != PW_OK) return r->error->status;
  pw_yaml_number (r, node->first, label, PW_REAL, value);
  return pw_yaml_number (r, node->first->next, label, PW_REAL, value + 1);
}

int pw_yaml_choice (const pw_reader *r, const pw_node *node, const char *label, const char *const *choices,
                    int *value) {
  char hint[PW_HINT];
  const char *text = "";
  if (node == NULL || pw_yaml_text (r, node, label, &text) != PW_OK) return r->error->status;
  int i = pw_find_name (choices, sizeof *choices, text, hint);
  if (i < 0) return pw_yaml_fail (r, node->at, "%s: there is no choice \"%.60s\"%s", label, text, hint);
  *value = i;
  return PW_OK;
}

void pw_yaml_suggest_bodies (const pw_reader *r, pw_nearest *near) {
  int bodies;
  const pw_body *body = pw_model_bodies (r->model, &bodies);
  for (int i = 0; i < bodies; i++) pw_nearest_try (near, body[i].name);
}

/* The text of a model file, and messages that point into it.
 *
 * The text is checked first: UTF-8, no control characters, no lines that begin with %: some hang libfyaml 0.7.12. */

enum { SOURCE_SHOWN = 84 }; /* bytes of a line in a message */

/* ---- Messages ---- */

int pw_yaml_line (const pw_yaml *y, size_t at) {
  int line = 1;
  for (const char *p = y->source; (p = memchr (p, '\n', (size_t)(y->source + at - p))) != NULL; p++) line++;
  return line;
}

static int source_characters (const char *from, const char *to) {
  int n = 0;
  for (; from < to; from++) n += (*from & 0xC0) != 0x80;
  return n;
}

/* The beginning of the line at an offset, and the part from *from to *to that is shown: of a long line the part around
 * the offset, cut between characters. */
static void source_window (const pw_yaml *y, size_t at, const char **begin, const char **from, const char **to) {
  const char *caret = y->source + at, *end = y->source + y->size;
  *begin = caret;
  while (*begin > y->source && (*begin)[-1] != '\n') --*begin;
  *from = caret - *begin > SOURCE_SHOWN / 2 ? caret - SOURCE_SHOWN / 2 : *begin;
  while (*from < caret && (**from & 0xC0) == 0x80) ++*from;
  *to = *from;
  while (*to < end && **to != '\n' && **to != '\r' && *to - *from < SOURCE_SHOWN) ++*to;
  while (*to > caret && (**to & 0xC0) == 0x80) --*to;
}

int pw_yaml_fail (const pw_reader *r, size_t at, const char *format, ...) {
  const pw_yaml *y = r->y;
  char text[220], shown[SOURCE_SHOWN + 4];
  const char *begin, *from, *to;
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (text, sizeof text, format, arguments);
  va_end (arguments);
  if (at > y->size) at = y->size;
  source_window (y, at, &begin, &from, &to);
  snprintf (shown, sizeof shown, "%s%.*s", from > begin ? "..." : "", (int)(to - from), from);
  for (char *tab = shown; (tab = strchr (tab, '\t')) != NULL;) *tab = ' '; /* one column, as in the line of the caret */
  size_t n = strlen (y->path);
  return pw_fail (r->error, PW_INPUT, "%s%s:%d:%d: error: %s\n  %s\n  %*s^", n > 100 ? "..." : "",
                  n > 100 ? y->path + n - 97 : y->path, pw_yaml_line (y, at),
                  1 + source_characters (begin, y->source + at), text, shown,
                  source_characters (from, y->source + at) + 3 * (from > begin), "");
}

int pw_yaml_no_memory (const pw_reader *r) {
  return pw_fail (r->error, PW_RESOURCE, "%s: out of memory", r->y->path);
}

/* ---- Checks of the text ---- */

static int source_check (const pw_reader *r) {
  const char *begin = r->y->source, *p = begin, *end = begin + r->y->size;
  while (p < end) {
    size_t at = (size_t)(p - begin);
    int n = pw_utf8_size (p);
    if (n == 0) return pw_yaml_fail (r, at, "byte %02X is not UTF-8; a model file is text in UTF-8", (unsigned char)*p);
    if ((*p == 0 || pw_control (p)) && !(*p == '\r' && p[1] == '\n'))
      return pw_yaml_fail (r, at, "a control character, code %d, does not belong in a model file", pw_control (p));
    if (*p == '%' && (at == 0 || p[-1] == '\n'))
      return pw_yaml_fail (r, at, "a line of a model file must not begin with %%");
    p += n;
  }
  return PW_OK;
}

int pw_yaml_read_source (pw_yaml *y, const char *path, size_t max_bytes, pw_error *error) {
  const char *why;
  FILE *f = pw_open_input (path, &why);
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "cannot open the model file %s: %s", y->path, why);
  int status = pw_read_rest (f, max_bytes, y->path, "the limit for a model unless --max-file raises it", &y->source,
                             &y->size, error);
  fclose (f);
  if (status == PW_OK && strncmp (y->source, "\xEF\xBB\xBF", 3) == 0) { /* a byte order mark */
    y->size -= 3;
    memmove (y->source, y->source + 3, y->size + 1);
  }
  return status == PW_OK ? source_check (&(pw_reader){ .y = y, .error = error }) : status;
}

void pw_yaml_write_source (const pw_yaml *y, FILE *f) {
  fwrite (y->source, 1, y->size, f);
}

/* Trees of text models as bytes, for programs without libfyaml: interactive pages.  A node is its type, whether it is
 * quoted, its offset and its count or, of a scalar, its size; then its entries or its text. */

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
