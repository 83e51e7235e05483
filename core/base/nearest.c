/* Suggestions of valid names for unknown ones, and the domains of numbers, for messages. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "util.h"

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
 * characters, or if one begins or ends with the other. */
static int nearest_is_near (const char *a, size_t n, const char *b, size_t m, size_t distance) {
  size_t longer = n > m ? n : m, shorter = n + m - longer;
  return 2 * distance < longer || (2 * distance == longer && distance <= 2) ||
         (shorter > 0 && (memcmp (a, b, shorter) == 0 || memcmp (a + n - shorter, b + m - shorter, shorter) == 0));
}

/* 1 if two names are equal except for capitals. */
static int nearest_equal (const char *a, const char *b) {
  while (*a && tolower ((unsigned char)*a) == tolower ((unsigned char)*b)) a++, b++;
  return *a == *b;
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
  size_t distance = nearest_equal (n->sought, candidate) ? 0 : nearest_distance (n->sought, candidate);
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
  const char *known;
  for (int i = 0; table && (known = *(const char *const *)(const void *)((const char *)table + (size_t)i * entry_size));
       i++) {
    if (strcmp (known, name) == 0) return i;
    pw_nearest_try (&near, known);
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
