/* The words of an expression: functions, constants, names, numbers. */
#include <ctype.h>
#include <math.h>
#include <string.h>
#include "expression_parts.h"
#include "pinwheel.h"
#include "pinwheel-files.h"

/* ---- What there is ---- */

static double words_sign (double x) {
  return (x > 0) - (x < 0);
}

/* The remainder with the sign of the divisor: an angle modulo 2 pi lies in [0, 2 pi). */
static double words_mod (double x, double y) {
  double r = fmod (x, y);
  return r != 0 && (r < 0) != (y < 0) ? r + y : r;
}

static double words_min (const double *x, int n) {
  double least = x[0];
  for (int i = 1; i < n; i++) least = fmin (least, x[i]);
  return least;
}

static double words_max (const double *x, int n) {
  double most = x[0];
  for (int i = 1; i < n; i++) most = fmax (most, x[i]);
  return most;
}

const pw_expression_function pw_expression_functions[] = {
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
  { "sign", words_sign, NULL, NULL },
  { "atan2", NULL, atan2, NULL },
  { "hypot", NULL, hypot, NULL },
  { "jacobi_am", NULL, pw_jacobi_am, NULL },
  { "elliptic_K", pw_elliptic_K, NULL, NULL },
  { "mod", NULL, words_mod, NULL },
  { "min", NULL, NULL, words_min },
  { "max", NULL, NULL, words_max },
  { .name = NULL },
};

const pw_expression_constant pw_expression_constants[] = {
  { "pi", PW_PI }, { "e", 2.71828182845904523536 }, { "deg", PW_PI / 180 }, { .name = NULL }
};

/* ---- Words ---- */

static int words_begins_name (char c) {
  return isalpha ((unsigned char)c) || c == '_';
}

size_t pw_expression_name_size (const char *p) {
  size_t n = 0;
  if (words_begins_name (*p))
    while (words_begins_name (p[n]) || isdigit ((unsigned char)p[n]) || (n && p[n] == '.')) n++;
  return n;
}

static size_t words_digits (const char *p) {
  return strspn (p, "0123456789");
}

size_t pw_expression_number_size (const char *p) {
  size_t whole = words_digits (p), n = whole;
  if (p[n] == '.') {
    size_t part = words_digits (p + n + 1);
    if (whole + part == 0) return 0;
    n += 1 + part;
  }
  if (n && (p[n] == 'e' || p[n] == 'E')) {
    size_t sign = p[n + 1] == '+' || p[n + 1] == '-', power = words_digits (p + n + 1 + sign);
    if (power) n += 1 + sign + power;
  }
  return n;
}

int pw_expression_number (const char *text, double *value) {
  size_t sign = *text == '+' || *text == '-', n = pw_expression_number_size (text + sign);
  return n && text[sign + n] == 0 && pw_read_number (text, value) == PW_OK;
}

int pw_expression_is_function (const char *name) {
  const pw_expression_function *f = pw_expression_functions;
  while (f->name && strcmp (f->name, name) != 0) f++;
  return f->name != NULL;
}

int pw_expression_is_taken (const char *text) {
  const pw_expression_constant *c = pw_expression_constants;
  while (c->name && strcmp (c->name, text) != 0) c++;
  return c->name || pw_expression_is_function (text);
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
