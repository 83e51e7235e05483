/* Fingerprints: lines "KEY = VALUE" with everything that determines the results of a run or a sweep.  Checkpoints and
 * journals of sweeps begin with one, so that results of different runs are never mixed. */
#define _GNU_SOURCE /* memmem */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include "fingerprint.h"
#include "util.h"

/* ---- Writing ---- */

void pw_fingerprint_line (pw_text *t, const char *key, const char *name, const char *value) {
  pw_text_add (t, key);
  if (name) pw_text_add (t, " "), pw_text_add (t, name);
  pw_text_add (t, " = ");
  for (; *value; value++) pw_text_add_bytes (t, *value == '\n' ? " " : value, 1); /* an entry has one line */
  pw_text_add (t, "\n");
}

void pw_fingerprint_number (pw_text *t, const char *key, const char *name, double value) {
  char number[32];
  pw_fingerprint_line (t, key, name, pw_format (number, value, 17));
}

int pw_fingerprint_file (pw_text *t, const char *key, const char *name, const char *path, pw_error *error) {
  char block[4096];
  uint64_t sum = PW_CHECK;
  const char *reason;
  FILE *f = pw_open_input (path, &reason);
  if (f == NULL) return pw_fail (error, pw_open_input_status (), "cannot read %s: %s", path, reason);
  for (size_t n; (n = fread (block, 1, sizeof block, f)) > 0;) sum = pw_check_sum (sum, block, n);
  int code = ferror (f) ? errno : 0;
  fclose (f);
  if (code) return pw_fail (error, PW_RESOURCE, "cannot read %s: %s", path, strerror (code));
  pw_fingerprint_line (t, key, NULL, PW_PRINTED (200, "%.150s, contents %016llx", name, (unsigned long long)sum));
  return PW_OK;
}

int pw_fingerprint_run (pw_text *t, const char *magic, const pw_file *file, uint64_t table_sum, const char *method,
                        const pw_settings *settings, pw_error *error) {
  pw_text_add (t, magic);
  pw_fingerprint_line (t, "version", NULL, PW_VERSION);
  int status = pw_fingerprint_file (t, "model", pw_file_name (file), pw_file_path (file), error);
  if (table_sum)
    pw_fingerprint_line (t, "tables", NULL, PW_PRINTED (40, "contents %016llx", (unsigned long long)table_sum));
  pw_fingerprint_line (t, "method", NULL, method);
  pw_fingerprint_number (t, "t-end", NULL, settings->span);
  pw_fingerprint_number (t, "step", NULL, settings->step);
  pw_fingerprint_number (t, "rtol", NULL, settings->rtol);
  pw_fingerprint_number (t, "atol", NULL, settings->atol);
  return status;
}

uint64_t pw_fingerprint_tables (uint64_t sum, const pw_model *m) {
  int elements;
  const pw_element *e = pw_model_elements (m, &elements);
  for (const pw_element *end = e + elements; e < end; e++)
    for (int i = 0; i < e->kind->signals; i++) {
      const pw_signal *s = pw_field_at (e->kind, e->definition, PW_SIGNAL, i);
      if (s->type != PW_TABLE) continue;
      size_t bytes = (size_t)s->table.count * sizeof (double);
      sum = pw_check_sum (pw_check_sum (sum ? sum : PW_CHECK, s->table.t, bytes), s->table.value, bytes);
      const double map[2] = { s->table.scale, s->table.offset };
      if (map[0] != 0 || map[1] != 0) sum = pw_check_sum (sum, map, sizeof map);
    }
  return sum;
}

void pw_fingerprint_initial (pw_text *t, const char **starts) {
  for (; starts && *starts; starts++) {
    size_t n = strcspn (*starts, "=");
    const char **later = starts + 1;
    while (*later && strncmp (*later, *starts, n + 1) != 0) later++;
    if (*later) continue;
    pw_fingerprint_line (t, "start", PW_PRINTED (200, "%.*s", (int)n, *starts), *starts + n + 1);
  }
}

/* ---- Reading ---- */

static const char fingerprint_last[] = "end\n", fingerprint_equals[] = " = ";

/* A line: key and value, the key NULL if it has none. */
typedef struct {
  const char *key, *value;
  size_t key_size, value_size;
} fingerprint_entry;

/* Reads the line at *at, which moves to the next one; 0 at the end, or if the line has no end. */
static int fingerprint_read (const char **at, const char *end, fingerprint_entry *e) {
  const char *line = *at, *newline = line < end ? memchr (line, '\n', (size_t)(end - line)) : NULL;
  const size_t size = sizeof fingerprint_equals - 1;
  *e = (fingerprint_entry){ .key = NULL };
  if (newline == NULL) return 0;
  *at = newline + 1;
  const char *equals = memmem (line, (size_t)(newline - line), fingerprint_equals, size);
  if (equals)
    *e = (fingerprint_entry){ line, equals + size, (size_t)(equals - line), (size_t)(newline - equals) - size };
  return 1;
}

const char *pw_fingerprint_end (const char *magic, const char *at, const char *end) {
  size_t n = strlen (magic), last = sizeof fingerprint_last - 1;
  fingerprint_entry e;
  if ((size_t)(end - at) < n || memcmp (at, magic, n) != 0) return NULL;
  for (const char *line = at; fingerprint_read (&at, end, &e); line = at)
    if ((size_t)(at - line) == last && memcmp (line, fingerprint_last, last) == 0) return at;
  return NULL;
}

static int fingerprint_is_key (const fingerprint_entry *e, const char *key, size_t size) {
  return e->key && e->key_size == size && memcmp (e->key, key, size) == 0;
}

/* Finds a key; 0 if there is none. */
static int fingerprint_find (const char *at, const char *end, const char *key, size_t size, fingerprint_entry *e) {
  while (fingerprint_read (&at, end, e))
    if (fingerprint_is_key (e, key, size)) return 1;
  return 0;
}

const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size) {
  fingerprint_entry e;
  if (!fingerprint_find (at, end, key, strlen (key), &e)) return NULL;
  *size = e.value_size;
  return e.value;
}

/* Describes the first entry of `a` that `b` does not have, or has with another value; 0 if there is none. */
static int fingerprint_missing (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size) {
  enum { SHOWN = 120 }; /* characters of a value, at most */
  fingerprint_entry own, other;
  for (const char *at = a.begin; fingerprint_read (&at, a.end, &own);) {
    if (own.key == NULL || (ignored && fingerprint_is_key (&own, ignored, strlen (ignored)))) continue;
    if (!fingerprint_find (b.begin, b.end, own.key, own.key_size, &other))
      other.value = "not set", other.value_size = strlen (other.value);
    else if (other.value_size == own.value_size && memcmp (other.value, own.value, own.value_size) == 0)
      continue;
    int shown = own.value_size < SHOWN ? (int)own.value_size : SHOWN,
        other_shown = other.value_size < SHOWN ? (int)other.value_size : SHOWN;
    snprintf (text, size, "%.*s is %.*s %s and %.*s %s", (int)own.key_size, own.key, shown, own.value, a.where,
              other_shown, other.value, b.where);
    return 1;
  }
  return 0;
}

int pw_fingerprint_differ (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size) {
  return fingerprint_missing (a, b, ignored, text, size) || fingerprint_missing (b, a, ignored, text, size);
}
