/* The text of a model file, messages that point into it, hints in them, and its tree as bytes.
 *
 * The text is checked first: UTF-8, no control characters, no lines that begin with %: some hang libfyaml 0.7.12. */
#include <stdarg.h>
#include <string.h>
#include "yaml.h"

enum { SOURCE_SHOWN = 84 }; /* bytes of a line in a message */

/* The text of an included file follows those before it in the source, after a line of the character \f, which no file
 * contains, and its path from the folder of the model. */
const char *pw_yaml_part (const pw_yaml *y, size_t at, char path[PW_PATH]) {
  while (at > 0 && y->source[at - 1] != '\f') at--;
  const char *begin = y->source + at;
  size_t n = at ? strcspn (begin, "\n") : 0;
  pw_path (path, "%.*s", (int)n, begin);
  return at ? begin + n + 1 : begin;
}

int pw_yaml_line (const pw_yaml *y, size_t at) {
  char path[PW_PATH];
  int line = 1;
  for (const char *p = pw_yaml_part (y, at, path); (p = memchr (p, '\n', (size_t)(y->source + at - p))) != NULL; p++)
    line++;
  return line;
}

static int source_characters (const char *from, const char *to) {
  int n = 0;
  for (; from < to; from++) n += (*from & 0xC0) != 0x80;
  return n;
}

int pw_yaml_fail (const pw_yaml *y, pw_error *error, size_t at, const char *format, ...) {
  char text[220], shown[SOURCE_SHOWN + 4], part[PW_PATH], folder[PW_PATH];
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (text, sizeof text, format, arguments);
  va_end (arguments);
  if (at > y->size) at = y->size;
  /* What is shown of a long line is the part around the offset, cut between characters. */
  const char *caret = y->source + at, *end = y->source + y->size, *begin = caret;
  while (begin > y->source && begin[-1] != '\n') begin--;
  const char *from = caret - begin > SOURCE_SHOWN / 2 ? caret - SOURCE_SHOWN / 2 : begin;
  while (from < caret && (*from & 0xC0) == 0x80) from++;
  const char *to = from;
  while (to < end && *to != '\n' && *to != '\r' && to - from < SOURCE_SHOWN) to++;
  while (to > caret && (*to & 0xC0) == 0x80) to--;
  snprintf (shown, sizeof shown, "%s%.*s", from > begin ? "..." : "", (int)(to - from), from);
  for (char *tab = shown; (tab = strchr (tab, '\t')) != NULL;) *tab = ' '; /* one column, as in the line of the caret */
  const char *path = y->path, *slash = strrchr (path, '/');
  pw_yaml_part (y, at, part);
  if (*part) path = pw_path (folder, "%.*s%s", slash ? (int)(slash - path) + 1 : 0, path, part);
  size_t n = strlen (path);
  return pw_fail (error, PW_INPUT, "%s%s:%d:%d: error: %s\n  %s\n  %*s^", n > 100 ? "..." : "",
                  n > 100 ? path + n - 97 : path, pw_yaml_line (y, at), 1 + source_characters (begin, caret), text,
                  shown, source_characters (from, caret) + 3 * (from > begin), "");
}

int pw_yaml_no_memory (const pw_yaml *y, pw_error *error) {
  return pw_fail (error, PW_RESOURCE, "%s: out of memory", y->path);
}

const char *pw_yaml_key_hint (const char *text, const char *const *key) {
  for (int i = 0; key[i]; i++) {
    size_t n = strlen (key[i]);
    if (strncmp (text, key[i], n) == 0 && text[n] == ':') return "; a space goes after the colon";
    if (strncmp (text, key[i], n) == 0 && text[n] == ' ') return "; a colon goes after the key";
  }
  if (*text && strspn (text, "0123456789") == strlen (text)) return "; decimals are written with a point";
  if (strpbrk (text, "()*/^")) return "; an expression with commas goes between double quotes";
  return "";
}

/* Whether a word of a text begins with this prefix of at least 3 bytes. */
static int source_has_word (const char *text, const char *prefix) {
  for (const char *at = text; strlen (prefix) >= 3 && (at = strstr (at, prefix)) != NULL; at++)
    if (at == text || strchr (" (", at[-1])) return 1;
  return 0;
}

/* 1 if an element type has a field of this name. */
static int source_is_field (const char *name) {
  for (const pw_kind *const *k = pw_kinds; *k; k++)
    for (const pw_field *f = (*k)->fields; f->name; f++)
      if (strcmp (f->name, name) == 0) return 1;
  return 0;
}

pw_nearest pw_yaml_nearest_kind (const char *text) {
  pw_nearest near = { .sought = text };
  for (const pw_kind *const *k = pw_kinds; *k; k++) pw_nearest_try (&near, (*k)->name);
  /* "hinge" pin, "damper" spring; names of fields, as "angle", do not suggest a type */
  for (const pw_kind *const *k = pw_kinds; *k && !near.near && !source_is_field (text); k++)
    if (source_has_word ((*k)->about, text)) snprintf (near.best, sizeof near.best, "%s", (*k)->name), near.near = 1;
  return near;
}

int pw_yaml_check_source (const pw_yaml *y, pw_error *error) {
  const char *begin = y->source, *p = begin + y->begin, *end = begin + y->size;
  while (p < end) {
    size_t at = (size_t)(p - begin);
    int n = pw_utf8_size (p);
    if (n == 0)
      return pw_yaml_fail (y, error, at, "byte %02X is not UTF-8; a model file is text in UTF-8", (unsigned char)*p);
    if ((*p == 0 || pw_control (p)) && !(*p == '\r' && p[1] == '\n'))
      return pw_yaml_fail (y, error, at, "a control character, code %d, does not belong in a model file",
                           pw_control (p));
    if (*p == '%' && (at == 0 || p[-1] == '\n'))
      return pw_yaml_fail (y, error, at, "a line of a model file must not begin with %%");
    p += n;
  }
  return PW_OK;
}

int pw_yaml_read_source (pw_yaml *y, const char *path, size_t max_bytes, pw_error *error) {
  const char *why;
  FILE *f = pw_open_input (path, &why);
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "cannot open %s: %s", y->path, why);
  int status = pw_read_rest (f, max_bytes, y->path, "the limit for a model unless --max-file raises it", &y->source,
                             &y->size, error);
  fclose (f);
  if (status == PW_OK && strncmp (y->source, "\xEF\xBB\xBF", 3) == 0) { /* a byte order mark */
    y->size -= 3;
    memmove (y->source, y->source + 3, y->size + 1);
  }
  return status;
}

/* Trees of text models as bytes, for programs without libfyaml: interactive pages.  A node is its type, whether it is
 * quoted, its offset and its count or, of a scalar, its size; then its entries or its text. */

typedef struct {
  unsigned char type, quoted, is_file, unused[1]; /* no padding, which would be written uninitialised */
  unsigned at, count;
} stored_head;

static void stored_write (const pw_node *n, FILE *f) {
  int scalar = n->type == PW_YAML_SCALAR;
  stored_head h = { n->type, n->quoted, n->is_file,
                    { 0 },   n->at,     scalar ? (unsigned)strlen (n->text) : (unsigned)n->count };
  fwrite (&h, sizeof h, 1, f);
  if (scalar) fwrite (n->text, 1, h.count, f);
  for (const pw_node *entry = scalar ? NULL : n->first; entry; entry = entry->next) stored_write (entry, f);
}

void pw_yaml_write_tree (const pw_yaml *y, FILE *f) {
  if (y->root) stored_write (y->root, f);
}

/* NULL if the bytes are incomplete, and a->failed is set, or memory is short. */
static pw_node *stored_read (pw_archive *a, pw_arena *arena, int depth) {
  stored_head h = { 0 };
  pw_archive_bytes (a, &h, sizeof h);
  if (a->failed || depth > PW_YAML_DEPTH * PW_YAML_FILES || h.count > a->size - a->used) return a->failed = 1, NULL;
  pw_node *n = pw_arena_alloc (arena, sizeof *n), **to;
  if (n == NULL) return NULL;
  *n = (pw_node){ .at = h.at, .count = (int)h.count, .type = h.type, .quoted = h.quoted, .is_file = h.is_file };
  if (h.type == PW_YAML_SCALAR) {
    char *text = pw_arena_alloc (arena, (size_t)h.count + 1);
    if (text) pw_archive_bytes (a, text, h.count);
    n->text = text;
    n->count = 0;
    return text ? n : NULL;
  }
  to = &n->first;
  for (unsigned i = 0; i < h.count * (h.type == PW_YAML_MAP ? 2 : 1); i++, to = &(*to)->next)
    if ((*to = stored_read (a, arena, depth + 1)) == NULL) return NULL;
  return n;
}

int pw_yaml_load_tree (pw_yaml *y, char *bytes, size_t size, pw_error *error) {
  pw_archive a = { .at = (unsigned char *)bytes, .size = size, .loading = 1 };
  y->root = stored_read (&a, &y->arena, 0);
  if (y->root) return PW_OK;
  if (!a.failed) return pw_yaml_no_memory (y, error);
  return pw_fail (error, PW_INPUT, "%s: the stored tree is incomplete", y->path);
}
