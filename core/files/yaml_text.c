/* The text of a model file, messages that point into it, units of parameters, and its tree as bytes. */
#include <ctype.h>
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

/* Units of parameters must be SI units: 40 with the unit deg would mean 40 rad. */

enum { UNIT_BYTES = 400 /* of a unit of up to 60 characters with SI units in place of others, and its end */ };

/* Whether a UTF-8 character is a letter, not a sign like those of multiplication (·, U+22C5) or a raised digit. */
static int unit_is_letter (const char *character) {
  const unsigned char first = (unsigned char)*character;
  if (first < 0xC3 || strncmp (character, "×", 2) == 0) return isalpha (first) || strncmp (character, "µ", 2) == 0;
  return first != 0xE2; /* U+2000 to U+2FFF */
}

/* The first place where a name is a word of its own in a text, or NULL. */
static const char *unit_find_word (const char *text, const char *name) {
  for (const char *at = strstr (text, name), *before; at; at = strstr (at + 1, name)) {
    for (before = at; before > text && ((unsigned char)*--before & 0xC0) == 0x80;) continue;
    if ((at == text || !unit_is_letter (before)) && !unit_is_letter (at + strlen (name))) return at;
  }
  return NULL;
}

const pw_unit_name *pw_yaml_other_unit (const char *unit, const char **at) {
  for (const pw_unit_name *other = pw_unit_names; other->name; other++) {
    if (strcmp (other->factor, "1") == 0 || (strchr (other->name, '/') && strcmp (other->name, unit) != 0)) continue;
    if ((*at = unit_find_word (unit, other->name)) != NULL) return other;
  }
  return NULL;
}

/* Replaces the other unit, at a place in the unit, by SI units.  conversion: of a value, "*deg" or "/1e-3^2". */
static void unit_replace (char unit[UNIT_BYTES], const pw_unit_name *other, const char *at, char conversion[40]) {
  const char *before = at, *after = at + strlen (other->name);
  int power;
  pw_unit_power (after, &power);
  while (before > unit && before[-1] == ' ') before--;
  const int divides = before > unit && before[-1] == '/';
  const int product = strpbrk (other->si, " /") && (divides || power != 1);
  const char *text = PW_PRINTED (UNIT_BYTES, "%.*s%s%s%s%s", (int)(at - unit), unit, product ? "(" : "", other->si,
                                 product ? ")" : "", after);
  memcpy (unit, text, UNIT_BYTES);
  snprintf (conversion, 40, power == 1 ? "%c%s" : "%c%s^%d", divides ? '/' : '*', other->factor, power);
}

int pw_yaml_check_unit (const pw_yaml *y, const pw_node *node, const pw_node *value, pw_error *error) {
  static const char why[] = "unit: numbers are in SI units, angles in radians, and no unit converts a value";
  char si[UNIT_BYTES], conversion[40];
  const char *at, *unit = node->text, *in = strstr (unit, " in "); /* "persons in lane": no inches, unless a product */
  const pw_unit_name *other = pw_yaml_other_unit (unit, &at);
  double factor;
  int replaced = 0, number = value->type == PW_YAML_SCALAR && strlen (value->text) <= 30 &&
                             pw_expression_number (value->text, &(double){ 0 });
  if (other == NULL || (in && at == in + 1 && pw_unit_factor (unit, NULL, &factor) != PW_OK)) return PW_OK;
  if (strlen (unit) > 60 || pw_unit_factor (unit, NULL, &factor) != PW_OK) { /* not understood as a whole */
    pw_unit_factor (other->name, other->si, &factor);
    return pw_yaml_fail (y, error, node->at, "%s; convert it with 1 %s = %.15g %s, and write %s instead", why,
                         other->name, factor, other->si, other->si);
  }
  snprintf (si, sizeof si, "%s", unit);
  for (; (other = pw_yaml_other_unit (si, &at)) != NULL; replaced++) unit_replace (si, other, at, conversion);
  if (replaced > 1) snprintf (conversion, sizeof conversion, "*%.15g", factor);
  return pw_yaml_fail (y, error, node->at, "%s; write \"value: %s%s, unit: %s\"", why, number ? value->text : "(..)",
                       conversion, si);
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
