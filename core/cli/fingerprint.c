/* Fingerprints: lines "KEY = VALUE" with everything that determines the results of a run or a sweep.  Files that can be
 * continued begin with one, so that results of different runs are never mixed. */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include "fingerprint.h"
#include "util.h"

/* ---- Writing ---- */

void pw_fingerprint_line (pw_text *t, const char *key, const char *of, const char *value) {
  pw_text_add (t, key);
  if (of) pw_text_add (t, " "), pw_text_add (t, of);
  pw_text_add (t, " = ");
  pw_text_add (t, value);
  pw_text_add (t, "\n");
}

void pw_fingerprint_number (pw_text *t, const char *key, const char *of, double value) {
  char number[32];
  pw_fingerprint_line (t, key, of, pw_format (number, value, 17));
}

int pw_fingerprint_file (pw_text *t, const char *key, const char *name, const char *path, pw_error *error) {
  char text[200], block[4096];
  uint64_t h = PW_CHECK;
  const char *reason;
  FILE *f = pw_open_input (path, &reason);
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "cannot read %s: %s", path, reason);
  for (size_t n; (n = fread (block, 1, sizeof block, f)) > 0;) h = pw_check_sum (h, block, n);
  int why = ferror (f) ? errno : 0;
  fclose (f);
  if (why) return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", path, strerror (why));
  snprintf (text, sizeof text, "%.150s, contents %016llx", name, (unsigned long long)h);
  pw_fingerprint_line (t, key, NULL, text);
  return PW_OK;
}

int pw_fingerprint_run (pw_text *t, const char *magic, const pw_file *file, uint64_t tables, const char *method,
                        const pw_settings *s, pw_error *error) {
  char text[200];
  pw_text_add (t, magic);
  pw_fingerprint_line (t, "version", NULL, PW_VERSION);
  int status = pw_fingerprint_file (t, "model", pw_file_name (file), pw_file_path (file), error);
  snprintf (text, sizeof text, "contents %016llx", (unsigned long long)tables);
  if (tables) pw_fingerprint_line (t, "tables", NULL, text);
  pw_fingerprint_line (t, "method", NULL, method);
  pw_fingerprint_number (t, "t-end", NULL, s->span);
  pw_fingerprint_number (t, "step", NULL, s->step);
  pw_fingerprint_number (t, "rtol", NULL, s->rtol);
  pw_fingerprint_number (t, "atol", NULL, s->atol);
  return status;
}

uint64_t pw_check_tables (uint64_t sum, const pw_model *m) {
  int elements;
  const pw_element *e = pw_model_elements (m, &elements);
  for (const pw_element *end = e + elements; e < end; e++)
    for (int i = 0; i < e->kind->signals; i++) {
      const pw_signal *s = pw_field_at (e->kind, e->definition, PW_SIGNAL, i);
      if (s->type != PW_TABLE) continue;
      size_t bytes = (size_t)s->table.count * sizeof (double);
      sum = pw_check_sum (pw_check_sum (sum ? sum : PW_CHECK, s->table.t, bytes), s->table.value, bytes);
      const double line[2] = { s->table.scale, s->table.offset };
      if (line[0] != 0 || line[1] != 0) sum = pw_check_sum (sum, line, sizeof line);
    }
  return sum;
}

void pw_fingerprint_initial (pw_text *t, const char **starts) {
  for (; starts && *starts; starts++) {
    char name[200];
    snprintf (name, sizeof name, "%.*s", (int)strcspn (*starts, "="), *starts);
    pw_fingerprint_line (t, "start", name, *starts + strcspn (*starts, "=") + 1);
  }
}

/* ---- Reading ---- */

static const char fingerprint_last[] = "end\n";

/* The next line, or NULL at the end or if it is not whole. */
static const char *fingerprint_next (const char *at, const char *end) {
  const char *newline = at < end ? memchr (at, '\n', (size_t)(end - at)) : NULL;
  return newline ? newline + 1 : NULL;
}

const char *pw_fingerprint_end (const char *magic, const char *at, const char *end) {
  size_t n = strlen (magic), last = sizeof fingerprint_last - 1;
  if ((size_t)(end - at) < n || memcmp (at, magic, n) != 0) return NULL;
  for (const char *next; (next = fingerprint_next (at, end)) != NULL; at = next)
    if ((size_t)(next - at) == last && memcmp (at, fingerprint_last, last) == 0) return next;
  return NULL;
}

/* The key's size in a line; 0 if the line has none. */
static size_t fingerprint_key (const char *line, const char *next) {
  for (const char *c = line; c + 3 < next; c++)
    if (memcmp (c, " = ", 3) == 0) return (size_t)(c - line);
  return 0;
}

static const char *fingerprint_find (const char *at, const char *end, const char *key, size_t key_size, size_t *size) {
  for (const char *next; (next = fingerprint_next (at, end)) != NULL; at = next)
    if (fingerprint_key (at, next) == key_size && memcmp (at, key, key_size) == 0) {
      *size = (size_t)(next - at) - key_size - 4;
      return at + key_size + 3;
    }
  return NULL;
}

const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size) {
  return fingerprint_find (at, end, key, strlen (key), size);
}

/* Looks for the first line of `a` that is not in `b`. */
static int fingerprint_missing (const char *a, const char *a_end, const char *b, const char *b_end, int parts,
                                const char *words[2], char *text, size_t size) {
  for (const char *next; (next = fingerprint_next (a, a_end)) != NULL; a = next) {
    size_t n = fingerprint_key (a, next), value = (size_t)(next - a) - n - 4, other;
    if (n == 0 || (!parts && n == 4 && memcmp (a, "part", 4) == 0)) continue;
    const char *found = fingerprint_find (b, b_end, a, n, &other);
    if (found && other == value && memcmp (found, a + n + 3, value) == 0) continue;
    int shown = value < 120 ? (int)value : 120, seen = found && other < 120 ? (int)other : found ? 120 : 0;
    snprintf (text, size, "%.*s is %.*s %s and %.*s %s", (int)n, a, shown, a + n + 3, words[0], found ? seen : 7,
              found ? found : "not set", words[1]);
    return 1;
  }
  return 0;
}

int pw_fingerprint_differ (const char *a, const char *a_end, const char *b, const char *b_end, int parts,
                           const char *words[2], char *text, size_t size) {
  const char *turned[2] = { words[1], words[0] };
  return fingerprint_missing (a, a_end, b, b_end, parts, words, text, size) ||
         fingerprint_missing (b, b_end, a, a_end, parts, turned, text, size);
}
