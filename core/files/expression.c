/* Expressions by muParser.
 *
 * muParser 2.3.3 takes more than Pinwheel wants: assignments, lists of values, texts, a pi of 13 digits; and its messages
 * go through a buffer all threads share.  So an expression is first read word by word here, where every name is looked
 * up and whatever is not arithmetic is refused; what is left to muParser is syntax, of which it tells the place. */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <muParserDLL.h>
#include "expression.h"
#include "pinwheel.h"
#include "pinwheel-files.h"
#include "files.h"

enum { EXPRESSION_LONGEST = 4000 }; /* muParser stops at 5000 */

struct pw_expression {
  muParserHandle_t parser;
  int names, room;
  const char **name;
  pw_names table;
  struct {
    const char *text; /* NULL: nothing is kept here */
    double value;
  } kept[256]; /* by a hash of the text */
};

/* ---- What there is ---- */

static double expression_sign (double x) {
  return (x > 0) - (x < 0);
}

/* The remainder with the sign of the divisor: an angle modulo 2 pi lies in [0, 2 pi). */
static double expression_mod (double x, double y) {
  double r = fmod (x, y);
  return r != 0 && (r < 0) != (y < 0) ? r + y : r;
}

static double expression_min (const double *x, int n) {
  double least = x[0];
  for (int i = 1; i < n; i++) least = fmin (least, x[i]);
  return least;
}

static double expression_max (const double *x, int n) {
  double most = x[0];
  for (int i = 1; i < n; i++) most = fmax (most, x[i]);
  return most;
}

static const struct {
  const char *name;
  double (*one) (double);
  double (*two) (double, double);
  double (*many) (const double *, int);
} expression_function[] = {
  { "sin", sin, NULL, NULL },
  { "cos", cos, NULL, NULL },
  { "tan", tan, NULL, NULL },
  { "asin", asin, NULL, NULL },
  { "acos", acos, NULL, NULL },
  { "atan", atan, NULL, NULL },
  { "sinh", sinh, NULL, NULL },
  { "cosh", cosh, NULL, NULL },
  { "tanh", tanh, NULL, NULL },
  { "exp", exp, NULL, NULL },
  { "log", log, NULL, NULL },
  { "log10", log10, NULL, NULL },
  { "sqrt", sqrt, NULL, NULL },
  { "abs", fabs, NULL, NULL },
  { "floor", floor, NULL, NULL },
  { "ceil", ceil, NULL, NULL },
  { "round", round, NULL, NULL },
  { "sign", expression_sign, NULL, NULL },
  { "atan2", NULL, atan2, NULL },
  { "hypot", NULL, hypot, NULL },
  { "jacobi_am", NULL, pw_jacobi_am, NULL },
  { "elliptic_K", pw_elliptic_K, NULL, NULL },
  { "mod", NULL, expression_mod, NULL },
  { "min", NULL, NULL, expression_min },
  { "max", NULL, NULL, expression_max },
};
enum { EXPRESSION_FUNCTIONS = sizeof expression_function / sizeof *expression_function };

static const struct {
  const char *name;
  double value;
} expression_constant[] = { { "pi", PW_PI }, { "e", 2.71828182845904523536 }, { "deg", PW_PI / 180 } };
enum { EXPRESSION_CONSTANTS = sizeof expression_constant / sizeof *expression_constant };

/* ---- Words ---- */

static int expression_begins_name (char c) {
  return isalpha ((unsigned char)c) || c == '_';
}

/* A name may go on with a dot: frame.phi. */
static size_t expression_name_size (const char *p) {
  size_t n = 0;
  if (expression_begins_name (*p))
    while (expression_begins_name (p[n]) || isdigit ((unsigned char)p[n]) || (n && p[n] == '.')) n++;
  return n;
}

static size_t expression_digits (const char *p) {
  return strspn (p, "0123456789");
}

/* Digits, with a point among them or around, and an exponent; 0 if there is no number. */
static size_t expression_number_size (const char *p) {
  size_t whole = expression_digits (p), n = whole;
  if (p[n] == '.') {
    size_t part = expression_digits (p + n + 1);
    if (whole + part == 0) return 0;
    n += 1 + part;
  }
  if (n && (p[n] == 'e' || p[n] == 'E')) {
    size_t sign = p[n + 1] == '+' || p[n + 1] == '-', power = expression_digits (p + n + 1 + sign);
    if (power) n += 1 + sign + power;
  }
  return n;
}

int pw_expression_number (const char *text, double *value) {
  size_t sign = *text == '+' || *text == '-', n = expression_number_size (text + sign);
  return n && text[sign + n] == 0 && pw_read_number (text, value) == PW_OK;
}

static int expression_find_function (const char *name) {
  int i = 0;
  while (i < EXPRESSION_FUNCTIONS && strcmp (expression_function[i].name, name) != 0) i++;
  return i;
}

int pw_expression_is_taken (const char *text) {
  if (expression_find_function (text) < EXPRESSION_FUNCTIONS) return 1;
  for (int i = 0; i < EXPRESSION_CONSTANTS; i++)
    if (strcmp (expression_constant[i].name, text) == 0) return 1;
  return 0;
}

int pw_expression_is_name (const char *text) {
  size_t n = expression_name_size (text);
  return n && text[n] == 0 && n < 64 && strchr (text, '.') == NULL;
}

int pw_expression_names (const char *text, int (*each) (void *context, const char *name, size_t length, size_t at),
                         void *context) {
  for (const char *p = text; *p;) {
    size_t n = expression_name_size (p), number = n ? 0 : expression_number_size (p);
    int stop = n ? each (context, p, n, (size_t)(p - text)) : 0;
    if (stop) return stop;
    p += n ? n : number ? number : 1;
  }
  return 0;
}

/* ---- Reading word by word ---- */

static int expression_wrong (pw_expression_trouble *t, size_t at, const char *format, const char *a, const char *b) {
  t->at = at;
  snprintf (t->text, sizeof t->text, format, a, b);
  return PW_INPUT;
}

static int expression_unknown (const pw_expression *x, const char *name, size_t at, pw_expression_trouble *trouble) {
  char hint[100];
  pw_nearest near = { .sought = name };
  for (int i = 0; i < x->names; i++) pw_nearest_try (&near, x->name[i]);
  for (int i = 0; i < EXPRESSION_CONSTANTS; i++) pw_nearest_try (&near, expression_constant[i].name);
  for (int i = 0; i < EXPRESSION_FUNCTIONS; i++) pw_nearest_try (&near, expression_function[i].name);
  return expression_wrong (trouble, at, "there is no \"%s\"%s", name, pw_nearest_text (&near, hint, sizeof hint));
}

static int expression_read_name (const pw_expression *x, const char *text, size_t at, size_t n,
                                 pw_expression_trouble *trouble) {
  char name[64];
  snprintf (name, sizeof name, "%.*s", (int)n, text + at);
  int function = expression_find_function (name) < EXPRESSION_FUNCTIONS;
  const char *after = text + at + n + strspn (text + at + n, " \t\r\n");
  if (function && *after != '(')
    return expression_wrong (trouble, at, "\"%s\" is a function: write its argument in parentheses%s", name, "");
  if (!function && pw_names_find (&x->table, name) < 0 && !pw_expression_is_taken (name))
    return expression_unknown (x, name, at, trouble);
  if (!function && *after == '(')
    return expression_wrong (trouble, at, "\"%s\" is a number, not a function; a product is written with *%s", name,
                             "");
  return PW_OK;
}

/* Commas separate arguments; a group in parentheses without a function has none. */
typedef struct {
  int depth;
  unsigned char function[200];
  size_t at[200];
} expression_groups;

static int expression_read_sign (expression_groups *g, const char *text, size_t at, size_t *n, char before,
                                 pw_expression_trouble *trouble) {
  char c = text[at], next = text[at + 1];
  char shown[2] = { c, 0 };
  *n = 1;
  if (c == '(') {
    if (g->depth == 200) return expression_wrong (trouble, at, "too many parentheses%s%s", "", "");
    g->at[g->depth] = at;
    g->function[g->depth++] = before == 'f';
  } else if (c == ')') {
    if (g->depth-- == 0) return expression_wrong (trouble, at, "there is no \"(\" for this \")\"%s%s", "", "");
  } else if (c == ',') {
    if (g->depth == 0 || !g->function[g->depth - 1])
      return expression_wrong (trouble, at, "a comma belongs between the arguments of a function%s%s", "", "");
  } else if (next == '=' && strchr ("<>=!", c))
    *n = 2;
  else if (c == '*' && next == '*')
    return expression_wrong (trouble, at, "a power is written with ^%s%s", "", "");
  else if (c == '=')
    return expression_wrong (trouble, at, "\"=\" would assign; equality is written ==%s%s", "", "");
  else if ((c == '&' || c == '|') && next == c)
    *n = 2;
  else if (strchr ("+-*/^<>?:", c) == NULL)
    return expression_wrong (trouble, at, "\"%s\" does not belong in an expression%s",
                             c & 0x80 ? "a letter without ASCII code" : shown, "");
  return PW_OK;
}

static int expression_read (const pw_expression *x, const char *text, pw_expression_trouble *trouble) {
  expression_groups g = { .depth = 0 };
  char before = 0; /* 'f' a name, '0' a number, else the sign itself */
  size_t at = 0, n, end = 0;
  for (; text[at]; at += n) {
    int status = PW_OK;
    n = strspn (text + at, " \t\r\n");
    if (n) continue;
    size_t name = expression_name_size (text + at), number = expression_number_size (text + at);
    n = name ? name : number;
    int factor = n || (text[at] == '(' && before != 'f');
    if (factor && (before == 'f' || before == '0' || before == ')'))
      return expression_wrong (trouble, at, "an operator such as * is missing before \"%s\"%s",
                               (char[2]){ text[at], 0 }, "");
    if (name)
      status = expression_read_name (x, text, at, n, trouble);
    else if (!number)
      status = expression_read_sign (&g, text, at, &n, before, trouble);
    if (status != PW_OK) return status;
    before = name ? 'f' : number ? '0' : text[at];
    end = at + n;
  }
  if (end == 0) return expression_wrong (trouble, 0, "an expression is missing%s%s", "", "");
  if (g.depth) return expression_wrong (trouble, g.at[g.depth - 1], "there is no \")\" for this \"(\"%s%s", "", "");
  if (before != 'f' && before != '0' && before != ')')
    return expression_wrong (trouble, end - 1, "something is missing after \"%s\"%s", (char[2]){ before, 0 }, "");
  return PW_OK;
}

/* ---- muParser ---- */

/* muParser throws when it is refused memory, and not only where C is spared of it: it is called when there is enough.
 * What it catches itself becomes an error of some kind, or none. */
enum { EXPRESSION_RESERVE = 1 << 16, EXPRESSION_RESERVE_NAME = 1 << 12, EXPRESSION_RESERVE_BYTE = 1 << 10 };

pw_expression *pw_expression_open (int names) {
  pw_expression *x = calloc (1, sizeof *x);
  if (x == NULL || pw_reserve (EXPRESSION_RESERVE) != PW_OK) {
    free (x);
    return NULL;
  }
  errno = 0;
  x->room = names;
  x->name = calloc ((size_t)names + 1, sizeof *x->name);
  x->parser = mupCreate (muBASETYPE_FLOAT);
  if (x->name == NULL || x->parser == NULL || pw_names_open (&x->table, (size_t)names + 1) != PW_OK) {
    pw_expression_close (x);
    return NULL;
  }
  mupClearConst (x->parser);
  mupClearFun (x->parser);
  mupDefineNameChars (x->parser, "0123456789_abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.");
  for (int i = 0; i < EXPRESSION_CONSTANTS; i++)
    mupDefineConst (x->parser, expression_constant[i].name, expression_constant[i].value);
  for (int i = 0; i < EXPRESSION_FUNCTIONS; i++) {
    const char *name = expression_function[i].name;
    if (expression_function[i].one) mupDefineFun1 (x->parser, name, expression_function[i].one, 1);
    if (expression_function[i].two) mupDefineFun2 (x->parser, name, expression_function[i].two, 1);
    if (expression_function[i].many) mupDefineMultFun (x->parser, name, expression_function[i].many, 1);
  }
  if (errno != ENOMEM) return x;
  pw_expression_close (x);
  return NULL;
}

void pw_expression_close (pw_expression *x) {
  if (x == NULL) return;
  if (x->parser) mupRelease (x->parser);
  pw_names_close (&x->table);
  free (x->name);
  free (x);
}

int pw_expression_name (pw_expression *x, const char *name, const double *value) {
  if (x->names == x->room || pw_reserve (EXPRESSION_RESERVE_NAME) != PW_OK) return PW_MACHINE;
  errno = 0;
  x->name[x->names] = name;
  pw_names_add (&x->table, name, x->names++);
  mupDefineVar (x->parser, name, (double *)(size_t)value);
  int failed = mupError (x->parser) || errno == ENOMEM;
  mupErrorReset (x->parser);
  return failed ? PW_MACHINE : PW_OK;
}

/* Where muParser stopped; without its messages, which pass through a buffer that threads share. */
static int expression_stopped (const pw_expression *x, const char *text, pw_expression_trouble *trouble) {
  enum { TOO_MANY = 14, TOO_FEW = 15 }; /* ecTOO_MANY_PARAMS, ecTOO_FEW_PARAMS of muParserError.h */
  int code = mupGetErrorCode (x->parser), at = mupGetErrorPos (x->parser);
  size_t n = strlen (text), place = at < 0 ? 0 : (size_t)at < n ? (size_t)at : n ? n - 1 : 0;
  const char *why = code == TOO_MANY  ? "too many arguments"
                    : code == TOO_FEW ? "too few arguments"
                                      : "this does not belong here";
  return expression_wrong (trouble, place, "%s%s", why, "");
}

int pw_expression_set (pw_expression *x, const char *text, pw_expression_trouble *trouble) {
  if (strlen (text) > EXPRESSION_LONGEST)
    return expression_wrong (trouble, 0, "an expression of more than 4000 characters%s%s", "", "");
  if (expression_read (x, text, trouble) != PW_OK) return PW_INPUT;
  if (pw_reserve (EXPRESSION_RESERVE + EXPRESSION_RESERVE_BYTE * strlen (text)) != PW_OK) return PW_MACHINE;
  errno = 0;
  mupErrorReset (x->parser);
  mupSetExpr (x->parser, text);
  if (!mupError (x->parser)) mupEval (x->parser);
  if (errno == ENOMEM) return PW_MACHINE;
  return mupError (x->parser) ? expression_stopped (x, text, trouble) : PW_OK;
}

double pw_expression_value (pw_expression *x) {
  return mupEval (x->parser);
}

int pw_expression_fixed (pw_expression *x, const char *text, double *value, pw_expression_trouble *trouble) {
  unsigned h = 0;
  for (const char *p = text; *p; p++) h = 31 * h + (unsigned char)*p;
  h = (h ^ h >> 8 ^ h >> 16) & 255;
  if (x->kept[h].text == NULL || strcmp (x->kept[h].text, text) != 0) {
    int status = pw_expression_set (x, text, trouble);
    if (status != PW_OK) return status;
    x->kept[h].text = text;
    x->kept[h].value = pw_expression_value (x);
  }
  *value = x->kept[h].value;
  return PW_OK;
}

int pw_read_expression (const char *text, double *value) {
  pw_expression_trouble trouble;
  if (pw_read_number (text, value) == PW_OK) return PW_OK;
  pw_expression *x = pw_expression_open (0);
  int status = x ? pw_expression_set (x, text, &trouble) : PW_MACHINE;
  if (status == PW_OK) *value = pw_expression_value (x);
  pw_expression_close (x);
  return status;
}
