/* Names and numbers in a text, and named numbers. */
#include <string.h>
#include "expression_parts.h"
#include "pinwheel-files.h"

#define DIGITS "0123456789"
#define LETTERS "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"

size_t pw_expression_name_size (const char *p) {
  return strspn (p, LETTERS) ? strspn (p, LETTERS DIGITS ".") : 0;
}

size_t pw_expression_number_size (const char *p) {
  size_t whole = strspn (p, DIGITS), decimals = p[whole] == '.' ? strspn (p + whole + 1, DIGITS) : 0;
  if (whole + decimals == 0) return 0;
  const char *end = p + whole + (p[whole] == '.' ? 1 + decimals : 0); /* of the mantissa */
  if (*end != 'e' && *end != 'E') return (size_t)(end - p);
  const char *exponent = end + 1 + (end[1] == '+' || end[1] == '-');
  size_t digits = strspn (exponent, DIGITS);
  return (size_t)(digits ? exponent + digits - p : end - p);
}

int pw_expression_number (const char *text, double *value) {
  size_t sign = *text == '+' || *text == '-', n = pw_expression_number_size (text + sign);
  return n && text[sign + n] == 0 && pw_read_number (text, value) == PW_OK;
}

int pw_expression_is_reserved (const char *text) {
  return pw_expression_find_function (text) >= 0;
}

int pw_expression_is_name (const char *text) {
  size_t n = pw_expression_name_size (text);
  return n && text[n] == 0 && n < 64 && strchr (text, '.') == NULL;
}

const char *pw_expression_next_name (const char **rest, char name[PW_EXPRESSION_NAME]) {
  while (**rest) {
    const char *p = *rest;
    size_t n = pw_expression_name_size (p), number = n ? 0 : pw_expression_number_size (p);
    *rest += n ? n : number ? number : 1;
    if (n == 0) continue;
    snprintf (name, PW_EXPRESSION_NAME, "%.*s", (int)n, p);
    return p;
  }
  return NULL;
}

/* ---- Named numbers ---- */

int pw_scope_open (pw_scope *s, int room, pw_arena *arena) {
  size_t n = (size_t)room + 1; /* never an empty allocation */
  s->name = pw_arena_alloc (arena, n * sizeof *s->name);
  s->value = pw_arena_alloc (arena, n * sizeof *s->value);
  return s->name && s->value ? pw_names_open (&s->index, (size_t)room) : PW_RESOURCE;
}

void pw_scope_close (pw_scope *s) {
  pw_names_close (&s->index);
}

void pw_scope_add (pw_scope *s, const char *name, double value) {
  s->name[s->names] = name;
  s->value[s->names] = value;
  pw_names_add (&s->index, name, s->names++);
}
