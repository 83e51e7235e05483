/* External texts: UTF-8 without control characters, which could move a terminal's cursor; suggestions of names; domains
 * of numbers; streams into memory. */
#define _GNU_SOURCE /* fopencookie, strcasecmp */
#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "util.h"

int pw_utf8_size (const char *text) {
  /* The smallest code of each number of following bytes; a smaller one is encoded in too many bytes. */
  static const unsigned least[] = { 0, 0x80, 0x800, 0x10000 };
  const unsigned char *p = (const unsigned char *)text;
  /* The first byte is 0xxxxxxx, 110xxxxx, 1110xxxx or 11110xxx, the following ones are 10xxxxxx. */
  int following = p[0] < 0x80 ? 0 : p[0] >> 5 == 6 ? 1 : p[0] >> 4 == 14 ? 2 : p[0] >> 3 == 30 ? 3 : -1;
  if (following < 0) return 0;
  unsigned code = following ? p[0] & (0x3Fu >> following) : p[0];
  for (int i = 1; i <= following; i++) {
    if (p[i] >> 6 != 2) return 0;
    code = code << 6 | (p[i] & 0x3Fu);
  }
  int surrogate = code >= 0xD800 && code < 0xE000;
  return code < least[following] || code > 0x10FFFF || surrogate ? 0 : following + 1;
}

int pw_control (const char *text) {
  const unsigned char *p = (const unsigned char *)text;
  if (p[0] == '\n' || p[0] == '\t') return 0;
  return p[0] < ' ' || p[0] == 0x7F ? p[0] : p[0] == 0xC2 && p[1] >= 0x80 && p[1] < 0xA0 ? p[1] : 0;
}

int pw_is_text (const char *text) {
  for (int n; *text; text += n)
    if (*text >= ' ' && *text < 0x7F)
      n = 1; /* as most are */
    else if ((n = pw_utf8_size (text)) == 0 || pw_control (text))
      return 0;
  return 1;
}

int pw_is_line (const char *text) {
  return pw_is_text (text) && text[strcspn (text, "\n\t")] == 0;
}

void pw_text_sanitise (char *text) {
  for (int n; *text; text += n) {
    n = pw_utf8_size (text);
    int replace = n == 0 || pw_control (text);
    if (n == 0) n = 1;
    if (replace) memset (text, '?', (size_t)n);
  }
}

char *pw_print (char *buffer, size_t size, const char *format, ...) {
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (buffer, size, format, arguments);
  va_end (arguments);
  return buffer;
}

char *pw_print_part (char *buffer, size_t size, const char *text, size_t n) {
  if (n > size - 1) n = size - 1;
  memcpy (buffer, text, n);
  buffer[n] = '\0';
  return buffer;
}

char *pw_join (char *buffer, size_t size, const char *first, ...) {
  char *end = buffer, *last = buffer + size - 1;
  va_list more;
  va_start (more, first);
  for (const char *text = first; text; text = va_arg (more, const char *))
    for (; *text && end < last; text++) *end++ = *text;
  va_end (more);
  *end = '\0';
  return buffer;
}

/* Edit distance, in which exchanging neighbours is one change (Damerau 1964, optimal string alignment), keeping three
 * rows of the table; for a candidate longer than a row, its length. */
static size_t nearest_distance (const char *a, const char *b) {
  size_t row[3][64], n = strlen (b), i = 0;
  if (n >= sizeof *row / sizeof **row) return n;
  for (size_t j = 0; j <= n; j++) row[0][j] = j;
  for (; a[i]; i++) {
    size_t *next = row[(i + 1) % 3], *last = row[i % 3], *before = row[(i + 2) % 3];
    next[0] = i + 1;
    for (size_t j = 0; j < n; j++) {
      size_t least = (next[j] < last[j + 1] ? next[j] : last[j + 1]) + 1, substitute = last[j] + (a[i] != b[j]);
      int exchanged = i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j];
      if (substitute < least) least = substitute;
      next[j + 1] = exchanged && before[j - 1] + 1 < least ? before[j - 1] + 1 : least;
    }
  }
  return row[i % 3][n];
}

/* Two names are near if less than half of the longer one has to change, or exactly half where that is at most two
 * characters, or if one begins or ends with the other; a single character only beside a sign, as in body.y and u[0]. */
static int nearest_is_near (const char *a, size_t n, const char *b, size_t m, size_t distance) {
  const size_t longer = n > m ? n : m, shorter = n + m - longer;
  const char *name = n > m ? a : b;
  const int begins = shorter > 0 && memcmp (a, b, shorter) == 0,
            ends = shorter > 0 && memcmp (a + n - shorter, b + m - shorter, shorter) == 0;
  if (2 * distance < longer || (2 * distance == longer && distance <= 2)) return 1;
  if (shorter > 1) return begins || ends;
  return (begins && !isalnum ((unsigned char)name[1])) ||
         (ends && longer > 1 && !isalnum ((unsigned char)name[longer - 2]));
}

static void nearest_append (pw_nearest *n, const char *candidate) {
  size_t used = strlen (n->all), more = strlen (candidate);
  if (n->overflow || strstr (PW_PRINTED (96, ", %s,", n->all), PW_PRINTED (96, ", %s,", candidate))) return;
  n->overflow = used + more + 3 > sizeof n->all;
  if (n->overflow) return;
  if (used) memcpy (n->all + used, ", ", 2), used += 2;
  memcpy (n->all + used, candidate, more + 1);
}

void pw_nearest_try (pw_nearest *n, const char *candidate) {
  size_t a = strlen (n->sought), b = strlen (candidate), length = a > b ? a : b;
  size_t distance = strcasecmp (n->sought, candidate) == 0 ? 0 : nearest_distance (n->sought, candidate);
  nearest_append (n, candidate);
  if (*n->best && distance * n->length >= n->distance * length) return;
  snprintf (n->best, sizeof n->best, "%s", candidate);
  n->distance = distance;
  n->length = length;
  n->near = nearest_is_near (n->sought, a, candidate, b, distance);
}

const char *pw_nearest_text (pw_nearest *n) {
  *n->hint = 0;
  if (*n->best && n->near)
    snprintf (n->hint, sizeof n->hint, "; did you mean \"%s\"?", n->best);
  else if (*n->best && !n->overflow)
    snprintf (n->hint, sizeof n->hint, "; valid %s %s", strchr (n->all, ',') ? "are" : "is", n->all);
  return n->hint;
}

int pw_find_name (const void *table, size_t entry_size, const char *name, char hint[PW_HINT]) {
  pw_nearest near = { .sought = name };
  for (int pass = 0; pass < 2 && table; pass++) { /* suggestions, which cost more, are for unknown names only */
    const char *entry = table, *known;
    for (int i = 0; (known = *(const char *const *)(const void *)entry); i++, entry += entry_size)
      if (pass)
        pw_nearest_try (&near, known);
      else if (strcmp (known, name) == 0)
        return i;
  }
  strcpy (hint, pw_nearest_text (&near));
  return -1;
}

const char *const pw_domain_names[] = {
  [PW_REAL] = "real",   [PW_NONNEGATIVE] = "nonnegative", [PW_POSITIVE] = "positive",
  [PW_COUNT] = "count", [PW_FRACTION] = "fraction",       NULL
};

const char *pw_domain_text (pw_domain domain) {
  static const char *const text[] = {
    [PW_REAL] = "", [PW_NONNEGATIVE] = ">= 0", [PW_POSITIVE] = "> 0", [PW_COUNT] = "1, 2, ...", [PW_FRACTION] = "0 to 1"
  };
  return text[domain];
}

const char *pw_domain_check (pw_domain domain, double value) {
  if (!isfinite (value)) return "a finite number";
  if (domain == PW_NONNEGATIVE && value < 0) return "a number >= 0";
  if (domain == PW_POSITIVE && value <= 0) return "a number > 0";
  if (domain == PW_COUNT && (value < 1 || value != floor (value))) return "a whole number >= 1";
  if (domain == PW_COUNT && value > 1e9) return "a whole number up to 1e9";
  if (domain == PW_FRACTION && (value < 0 || value > 1)) return "a number from 0 to 1";
  return "";
}

/* Streams into memory that report if any part of the text is missing.  open_memstream of glibc 2.36 does not: if memory
 * is exhausted, it drops what is written, and the error indicator stays 0. */

static ssize_t stream_write (void *cookie, const char *bytes, size_t count) {
  pw_stream *t = cookie;
  if (pw_grow (&t->text, t->size + count, &t->room, 1) != PW_OK) return 0;
  memcpy (t->text + t->size, bytes, count);
  t->size += count;
  t->text[t->size] = 0;
  return (ssize_t)count;
}

FILE *pw_stream_open (pw_stream *t) {
  *t = (pw_stream){ .text = calloc (1, 1), .room = 1 };
  return t->text ? fopencookie (t, "w", (cookie_io_functions_t){ .write = stream_write }) : NULL;
}

int pw_stream_close (FILE *f, pw_stream *t) {
  int failed = f == NULL || ferror (f);
  if (f && fclose (f) != 0) failed = 1;
  if (!failed) return PW_OK;
  free (t->text);
  *t = (pw_stream){ .text = NULL };
  return PW_RESOURCE;
}
