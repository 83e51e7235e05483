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
  size_t n = strspn (p, DIGITS), decimals = p[n] == '.' ? strspn (p + n + 1, DIGITS) : 0;
  if (n + decimals == 0) return 0;
  n += p[n] == '.' ? 1 + decimals : 0;
  size_t exponent = n + 1 + (p[n] != 0 && (p[n + 1] == '+' || p[n + 1] == '-'));
  size_t digits = p[n] == 'e' || p[n] == 'E' ? strspn (p + exponent, DIGITS) : 0;
  return digits ? exponent + digits : n;
}

int pw_expression_number (const char *text, double *value) {
  size_t sign = *text == '+' || *text == '-', n = pw_expression_number_size (text + sign);
  return n && text[sign + n] == 0 && pw_read_number (text, value) == PW_OK;
}

const pw_expression_constant_name *pw_expression_find_constant (const char *name) {
  const pw_expression_constant_name *c = pw_expression_constants;
  while (c->name && strcmp (c->name, name) != 0) c++;
  return c->name ? c : NULL;
}

int pw_expression_is_reserved (const char *text) {
  return pw_expression_find_constant (text) || pw_expression_find_function (text) >= 0;
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
    snprintf (name, PW_EXPRESSION_NAME, "%.*s", (int)n, p);
    if (n) return p;
  }
  return NULL;
}

/* ---- Named numbers ---- */

int pw_scope_open (pw_scope *s, int room, pw_arena *arena) {
  s->name = pw_arena_alloc (arena, ((size_t)room + 1) * sizeof *s->name);
  s->value = pw_arena_alloc (arena, ((size_t)room + 1) * sizeof *s->value);
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
