/* An expression read word by word: every name is looked up, and what is not arithmetic is refused at its place. */
#include <stdio.h>
#include <string.h>
#include "expression_parts.h"
#include "pinwheel.h"
#include "util.h"

int pw_expression_wrong (pw_expression_trouble *t, size_t at, const char *format, const char *a, const char *b) {
  t->at = at;
  snprintf (t->text, sizeof t->text, format, a, b);
  return PW_INPUT;
}

static int read_unknown (const pw_expression_scope *x, const char *name, size_t at, pw_expression_trouble *trouble) {
  char hint[100];
  pw_nearest near = { .sought = name };
  for (int i = 0; i < x->names; i++) pw_nearest_try (&near, x->name[i]);
  for (const pw_expression_constant *c = pw_expression_constants; c->name; c++) pw_nearest_try (&near, c->name);
  for (const pw_expression_function *f = pw_expression_functions; f->name; f++) pw_nearest_try (&near, f->name);
  if (strcmp (name, "T") == 0) pw_nearest_try (&near, "t"); /* the time, a name in some expressions only */
  return pw_expression_wrong (trouble, at, "there is no \"%s\"%s", name, pw_nearest_text (&near, hint, sizeof hint));
}

static int read_name (const pw_expression_scope *x, const char *text, size_t at, size_t n,
                      pw_expression_trouble *trouble) {
  char name[64];
  snprintf (name, sizeof name, "%.*s", (int)n, text + at);
  int function = pw_expression_is_function (name);
  const char *after = text + at + n + strspn (text + at + n, " \t\r\n");
  if (function && *after != '(')
    return pw_expression_wrong (trouble, at, "\"%s\" is a function: write its argument in parentheses%s", name, "");
  if (!function && pw_names_find (&x->table, name) < 0 && !pw_expression_is_taken (name))
    return read_unknown (x, name, at, trouble);
  if (!function && *after == '(')
    return pw_expression_wrong (trouble, at, "\"%s\" is a number, not a function; a product is written with *%s", name,
                                "");
  return PW_OK;
}

/* Commas separate arguments; a group in parentheses without a function has none. */
typedef struct {
  int depth;
  unsigned char function[200];
  size_t at[200];
} read_groups;

static int read_sign (read_groups *g, const char *text, size_t at, size_t *n, char before,
                      pw_expression_trouble *trouble) {
  char c = text[at], next = text[at + 1];
  char shown[2] = { c, 0 };
  *n = 1;
  if (c == '(') {
    if (g->depth == 200) return pw_expression_wrong (trouble, at, "too many parentheses%s%s", "", "");
    g->at[g->depth] = at;
    g->function[g->depth++] = before == 'f';
  } else if (c == ')') {
    if (g->depth-- == 0) return pw_expression_wrong (trouble, at, "there is no \"(\" for this \")\"%s%s", "", "");
  } else if (c == ',') {
    if (g->depth == 0 || !g->function[g->depth - 1])
      return pw_expression_wrong (trouble, at, "a comma belongs between the arguments of a function%s%s", "", "");
  } else if (next == '=' && strchr ("<>=!", c))
    *n = 2;
  else if (c == '*' && next == '*')
    return pw_expression_wrong (trouble, at, "a power is written with ^%s%s", "", "");
  else if (c == '=')
    return pw_expression_wrong (trouble, at, "\"=\" would assign; equality is written ==%s%s", "", "");
  else if ((c == '&' || c == '|') && next == c)
    *n = 2;
  else if (strchr ("+-*/^<>?:", c) == NULL)
    return pw_expression_wrong (trouble, at, "\"%s\" does not belong in an expression%s",
                                c & 0x80 ? "a letter without ASCII code" : shown, "");
  return PW_OK;
}

int pw_expression_read (const pw_expression_scope *x, const char *text, pw_expression_trouble *trouble) {
  read_groups g = { .depth = 0 };
  char before = 0; /* 'f' a name, '0' a number, else the sign itself */
  size_t at = 0, n, end = 0;
  for (; text[at]; at += n) {
    int status = PW_OK;
    n = strspn (text + at, " \t\r\n");
    if (n) continue;
    size_t name = pw_expression_name_size (text + at), number = pw_expression_number_size (text + at);
    n = name ? name : number;
    int factor = n || (text[at] == '(' && before != 'f');
    if (factor && (before == 'f' || before == '0' || before == ')'))
      return pw_expression_wrong (trouble, at, "an operator such as * is missing before \"%s\"%s",
                                  (char[2]){ text[at], 0 }, "");
    if (name)
      status = read_name (x, text, at, n, trouble);
    else if (!number)
      status = read_sign (&g, text, at, &n, before, trouble);
    if (status != PW_OK) return status;
    before = name ? 'f' : number ? '0' : text[at];
    end = at + n;
  }
  if (end == 0) return pw_expression_wrong (trouble, 0, "an expression is missing%s%s", "", "");
  if (g.depth) return pw_expression_wrong (trouble, g.at[g.depth - 1], "there is no \")\" for this \"(\"%s%s", "", "");
  if (before != 'f' && before != '0' && before != ')')
    return pw_expression_wrong (trouble, end - 1, "something is missing after \"%s\"%s", (char[2]){ before, 0 }, "");
  return PW_OK;
}
