/* Suggestions of valid names for unknown ones, and the domains of numbers, for messages. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "util.h"

/* Edit distance (Levenshtein 1966), keeping one row of the table; the length of b if b is too long for the row. */
static size_t nearest_distance (const char *a, const char *b) {
  size_t row[64], n = strlen (b);
  if (n >= sizeof row / sizeof *row) return n;
  for (size_t j = 0; j <= n; j++) row[j] = j;
  for (size_t i = 0; a[i]; i++) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < n; j++) {
      size_t substitute = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      size_t least = (row[j] < diagonal ? row[j] : diagonal) + 1;
      row[j + 1] = substitute < least ? substitute : least;
    }
  }
  return row[n];
}

/* Two names are near if less than half of the longer one has to change, or exactly half where that is at most two
 * characters, or if one begins or ends with the other. */
static int nearest_is_near (const char *a, size_t n, const char *b, size_t m, size_t distance) {
  size_t longer = n > m ? n : m, shorter = n + m - longer;
  return 2 * distance < longer + (distance <= 2) ||
         (shorter > 0 && (memcmp (a, b, shorter) == 0 || memcmp (a + n - shorter, b + m - shorter, shorter) == 0));
}

/* 1 if two names are equal except for capitals. */
static int nearest_equal (const char *a, const char *b) {
  while (*a && tolower ((unsigned char)*a) == tolower ((unsigned char)*b)) a++, b++;
  return *a == *b;
}

static void nearest_append (pw_nearest *n, const char *candidate) {
  size_t used = strlen (n->all), more = strlen (candidate);
  n->overflow |= used + more + 3 > sizeof n->all;
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

const char *pw_domain_text (pw_domain domain) {
  static const char *const text[] = { "", ">= 0", "> 0", "1, 2, ...", "0 to 1" };
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
