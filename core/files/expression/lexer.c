/* The words of an expression: names and numbers. */
#include <ctype.h>
#include <string.h>
#include "expression_parts.h"
#include "pinwheel-files.h"

static int lexer_begins_name (char c) {
  return isalpha ((unsigned char)c) || c == '_';
}

size_t pw_expression_name_size (const char *p) {
  size_t n = 0;
  if (lexer_begins_name (*p))
    while (lexer_begins_name (p[n]) || isdigit ((unsigned char)p[n]) || (n && p[n] == '.')) n++;
  return n;
}

static size_t lexer_digits (const char *p) {
  return strspn (p, "0123456789");
}

size_t pw_expression_number_size (const char *p) {
  size_t whole = lexer_digits (p), n = whole;
  if (p[n] == '.') {
    size_t part = lexer_digits (p + n + 1);
    if (whole + part == 0) return 0;
    n += 1 + part;
  }
  if (n && (p[n] == 'e' || p[n] == 'E')) {
    size_t sign = p[n + 1] == '+' || p[n + 1] == '-', power = lexer_digits (p + n + 1 + sign);
    if (power) n += 1 + sign + power;
  }
  return n;
}

int pw_expression_number (const char *text, double *value) {
  size_t sign = *text == '+' || *text == '-', n = pw_expression_number_size (text + sign);
  return n && text[sign + n] == 0 && pw_read_number (text, value) == PW_OK;
}

int pw_expression_is_taken (const char *text) {
  const pw_expression_constant_name *c = pw_expression_constants;
  while (c->name && strcmp (c->name, text) != 0) c++;
  return c->name || pw_expression_find (text) >= 0;
}

int pw_expression_is_name (const char *text) {
  size_t n = pw_expression_name_size (text);
  return n && text[n] == 0 && n < 64 && strchr (text, '.') == NULL;
}

int pw_expression_names (const char *text, int (*each) (void *context, const char *name, size_t length, size_t at),
                         void *context) {
  for (const char *p = text; *p;) {
    size_t n = pw_expression_name_size (p), number = n ? 0 : pw_expression_number_size (p);
    int stop = n ? each (context, p, n, (size_t)(p - text)) : 0;
    if (stop) return stop;
    p += n ? n : number ? number : 1;
  }
  return 0;
}
