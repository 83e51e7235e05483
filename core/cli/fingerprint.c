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

const char *pw_fingerprint_end (const char *magic, const char *at, const char *end) {
  static const char last[] = "\nend\n";
  size_t size = (size_t)(end - at), n = strlen (magic);
  if (size < n || memcmp (at, magic, n) != 0) return NULL;
  const char *found = memmem (at, size, last, strlen (last));
  return found ? found + strlen (last) : NULL;
}

/* The rest, of *size bytes, of the first line that begins with the `length` bytes of `front`, "KEY = ". */
static const char *fingerprint_find (const char *at, const char *end, const char *front, size_t length, size_t *size) {
  for (const char *newline; (newline = memchr (at, '\n', (size_t)(end - at))) != NULL; at = newline + 1) {
    if ((size_t)(newline - at) < length || memcmp (at, front, length) != 0) continue;
    *size = (size_t)(newline - at) - length;
    return at + length;
  }
  return NULL;
}

const char *pw_fingerprint_value (const char *at, const char *end, const char *key, size_t *size) {
  const char *front = PW_PRINTED (100, "%s = ", key);
  return fingerprint_find (at, end, front, strlen (front), size);
}

/* Describes the first entry of `a` that `b` does not have, or has with another value; 0 if there is none. */
static int fingerprint_missing (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size) {
  enum { SHOWN = 120 }; /* characters of a value, at most */
  for (const char *line = a.begin, *end; (end = memchr (line, '\n', (size_t)(a.end - line))); line = end + 1) {
    const char *equals = memmem (line, (size_t)(end - line), " = ", 3);
    if (equals == NULL) continue; /* the first and the last line */
    size_t key = (size_t)(equals - line), own_size = (size_t)(end - equals) - 3, other_size;
    if (ignored && strlen (ignored) == key && memcmp (ignored, line, key) == 0) continue;
    const char *own = equals + 3, *other = fingerprint_find (b.begin, b.end, line, key + 3, &other_size);
    if (other && other_size == own_size && memcmp (other, own, own_size) == 0) continue;
    if (other == NULL) other = "not set", other_size = strlen (other);
    int shown = own_size < SHOWN ? (int)own_size : SHOWN, other_shown = other_size < SHOWN ? (int)other_size : SHOWN;
    snprintf (text, size, "%.*s is %.*s %s and %.*s %s", (int)key, line, shown, own, a.where, other_shown, other,
              b.where);
    return 1;
  }
  return 0;
}

int pw_fingerprint_differ (pw_fingerprint a, pw_fingerprint b, const char *ignored, char *text, size_t size) {
  return fingerprint_missing (a, b, ignored, text, size) || fingerprint_missing (b, a, ignored, text, size);
}
