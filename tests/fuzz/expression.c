/* An expression of two variables: what is taken has the value and the derivatives that an evaluator of this file's own
 * finds, and no jump or kink between breakpoints; what is not has its trouble and a place in it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "expression.h"
#include "fuzz.h"
#include "pinwheel.h"

/* ---- An evaluator of its own: it computes while it reads, level by level ---- */

typedef struct {
  const char *p;
  long double variable[2]; /* x, speed */
  int wide;                /* 1: long double, for differences; 0: double, as the evaluator that is tested */
  int tie, bend;           /* something is just about to jump; has a kink here */
  long double least, most; /* divisors, arguments of powers; any number on the way */
} evaluator;

#define BOTH(e, f, x) ((e)->wide ? f##l (x) : (long double)f ((double)(x)))
#define BOTH_OF_TWO(e, f, x, y) ((e)->wide ? f##l (x, y) : (long double)f ((double)(x), (double)(y)))

static long double evaluator_choice (evaluator *e);

static int evaluator_next (evaluator *e, const char *word) {
  e->p += strspn (e->p, " \t\r\n");
  if (strncmp (e->p, word, strlen (word)) != 0) return 0;
  e->p += strlen (word);
  return 1;
}

static long double evaluator_note (evaluator *e, long double x) {
  if (!e->wide) x = (double)x;
  if (fabsl (x) > e->most) e->most = fabsl (x);
  return x;
}

static long double evaluator_mean (long double a, long double b) {
  for (int i = 0; i < 40; i++) {
    long double next = (a + b) / 2;
    b = sqrtl (a * b);
    a = next;
  }
  return a;
}

static long double evaluator_am (long double u, long double m) {
  if (m == 1) return atanl (sinhl (u)); /* the means do not converge */
  long double a[40] = { 1 }, ratio[40] = { 0 }, b = sqrtl (1 - m), angle;
  int n = 0;
  for (; n < 39 && fabsl (a[n] - b) > 1e-19L * a[n]; n++) {
    a[n + 1] = (a[n] + b) / 2;
    ratio[n + 1] = (a[n] - b) / 2 / a[n + 1];
    b = sqrtl (a[n] * b);
  }
  for (angle = ldexpl (a[n] * u, n); n > 0; n--) angle = (angle + asinl (ratio[n] * sinl (angle))) / 2;
  return angle;
}

static long double evaluator_whole (evaluator *e, const char *name, long double x) {
  long double down = floorl (x), up = ceill (x);
  if (strcmp (name, "round") == 0) {
    e->tie |= fabsl (x - truncl (x)) == 0.5L;
    return roundl (x);
  }
  e->tie |= down == x;
  return *name == 'f' ? down : up;
}

static long double evaluator_abs (evaluator *e, long double x) {
  e->bend |= x == 0;
  return fabsl (x);
}

static long double evaluator_one (evaluator *e, const char *name, long double x) {
  static const char *const names[] = { "sin",  "cos",  "tan", "asin", "acos",  "atan", "sinh",
                                       "cosh", "tanh", "exp", "log",  "log10", "sqrt", "abs" };
  int i = 0;
  while (i < 14 && strcmp (name, names[i]) != 0) i++;
  switch (i) {
  case 0:
    return e->wide ? sinl (x) : (long double)pw_sin ((double)x);
  case 1:
    return e->wide ? cosl (x) : (long double)pw_cos ((double)x);
  case 2:
    return BOTH (e, tan, x);
  case 3:
    return BOTH (e, asin, x);
  case 4:
    return BOTH (e, acos, x);
  case 5:
    return BOTH (e, atan, x);
  case 6:
    return BOTH (e, sinh, x);
  case 7:
    return BOTH (e, cosh, x);
  case 8:
    return BOTH (e, tanh, x);
  case 9:
    return BOTH (e, exp, x);
  case 10:
    return BOTH (e, log, x);
  case 11:
    return BOTH (e, log10, x);
  case 12:
    return BOTH (e, sqrt, x);
  case 13:
    return evaluator_abs (e, x);
  }
  if (strcmp (name, "elliptic_K") == 0)
    return !e->wide ? pw_elliptic_K ((double)x) : x <= 1 ? acosl (0) / evaluator_mean (1, sqrtl (1 - x)) : NAN;
  if (strcmp (name, "sign") != 0) return evaluator_whole (e, name, x);
  e->tie |= x == 0;
  return (x > 0) - (x < 0);
}

static long double evaluator_two (evaluator *e, const char *name, long double x, long double y) {
  e->bend |= x == y; /* hypot bends at 0, 0 */
  if (strcmp (name, "hypot") == 0) return BOTH_OF_TWO (e, hypot, x, y);
  if (strcmp (name, "min") == 0) return fminl (x, y);
  if (strcmp (name, "max") == 0) return fmaxl (x, y);
  if (strcmp (name, "jacobi_am") == 0)
    return !e->wide ? pw_jacobi_am ((double)x, (double)y) : y <= 1 ? evaluator_am (x, y) : NAN;
  if (strcmp (name, "atan2") == 0) {
    e->tie |= x == 0 && y <= 0;
    return BOTH_OF_TWO (e, atan2, x, y);
  }
  long double r = BOTH_OF_TWO (e, fmod, x, y); /* mod */
  e->tie |= r == 0;
  return r != 0 && (r < 0) != (y < 0) ? r + y : r;
}

static long double evaluator_call (evaluator *e, const char *name) {
  long double x = evaluator_choice (e);
  int more = 0;
  for (; evaluator_next (e, ","); more = 1) x = evaluator_note (e, evaluator_two (e, name, x, evaluator_choice (e)));
  evaluator_next (e, ")");
  return more || *name == 0 || strcmp (name, "min") == 0 || strcmp (name, "max") == 0 ? x : evaluator_one (e, name, x);
}

static long double evaluator_operand (evaluator *e) {
  char name[100] = "";
  if (evaluator_next (e, "(")) return evaluator_call (e, name);
  char *end;
  size_t n = strspn (e->p, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789.");
  if (strchr (".0123456789", *e->p)) {
    long double number = strtod (e->p, &end);
    e->p = end;
    return number;
  }
  if (n == 0 || n >= sizeof name) abort ();
  memcpy (name, e->p, n);
  e->p += n;
  if (evaluator_next (e, "(")) return evaluator_call (e, name);
  if (strcmp (name, "pi") == 0) return PW_PI;
  if (strcmp (name, "deg") == 0) return PW_PI / 180;
  if (strcmp (name, "e") == 0) return 2.71828182845904523536;
  return e->variable[strcmp (name, "speed") == 0];
}

static long double evaluator_power (evaluator *e);

static long double evaluator_signed (evaluator *e) {
  if (evaluator_next (e, "-")) return -evaluator_signed (e);
  if (evaluator_next (e, "+")) return evaluator_signed (e);
  return evaluator_power (e);
}

static long double evaluator_power (evaluator *e) {
  long double x = evaluator_note (e, evaluator_operand (e));
  if (!evaluator_next (e, "^")) return x;
  long double y = evaluator_signed (e);
  e->least = fminl (e->least, x);
  if (!e->wide && (y == 2 || y == 3)) return y == 2 ? (double)x * (double)x : (double)x * (double)x * (double)x;
  return evaluator_note (e, BOTH_OF_TWO (e, pow, x, y));
}

static long double evaluator_product (evaluator *e) {
  long double x = evaluator_signed (e);
  for (;;) {
    int times = evaluator_next (e, "*");
    if (!times && !evaluator_next (e, "/")) return x;
    long double y = evaluator_signed (e);
    if (!times) e->least = fminl (e->least, fabsl (y));
    x = evaluator_note (e, !e->wide ? (times ? (double)x * (double)y : (double)x / (double)y) : times ? x * y : x / y);
  }
}

static long double evaluator_sum (evaluator *e) {
  long double x = evaluator_product (e);
  for (;;) {
    int plus = evaluator_next (e, "+");
    if (!plus && !evaluator_next (e, "-")) return x;
    long double y = (plus ? 1 : -1) * evaluator_product (e);
    x = evaluator_note (e, e->wide ? x + y : (double)x + (double)y);
  }
}

static long double evaluator_compare (evaluator *e) {
  static const char *const sign[] = { "<=", ">=", "==", "!=", "<", ">" };
  long double x = evaluator_sum (e);
  for (;;) {
    int i = 0;
    while (i < 6 && !evaluator_next (e, sign[i])) i++;
    if (i == 6) return x;
    long double y = evaluator_sum (e);
    e->tie |= x == y;
    int reference[] = { x <= y, x >= y, x == y, x != y, x<y, x> y };
    x = reference[i];
  }
}

static long double evaluator_and (evaluator *e) {
  long double x = evaluator_compare (e);
  while (evaluator_next (e, "&&")) {
    long double y = evaluator_compare (e);
    e->tie |= x == 0 || y == 0;
    x = x != 0 && y != 0;
  }
  return x;
}

static long double evaluator_or (evaluator *e) {
  long double x = evaluator_and (e);
  while (evaluator_next (e, "||")) {
    long double y = evaluator_and (e);
    e->tie |= x == 0 || y == 0;
    x = x != 0 || y != 0;
  }
  return x;
}

static long double evaluator_choice (evaluator *e) {
  long double x = evaluator_or (e);
  if (!evaluator_next (e, "?")) return x;
  e->tie |= x == 0;
  long double yes = evaluator_choice (e);
  if (!evaluator_next (e, ":")) abort ();
  long double no = evaluator_choice (e);
  return x != 0 ? yes : no;
}

static long double evaluate (const char *text, const double *variable, int by, long double further, int wide,
                             evaluator *e) {
  *e = (evaluator){ .p = text, .variable = { variable[0], variable[1] }, .wide = wide, .least = 1 };
  e->variable[by] += further;
  long double value = evaluator_choice (e);
  if (e->p[strspn (e->p, " \t\r\n")]) abort ();
  return value;
}

static long double evaluate_at (const char *text, const double *variable, int by, long double further) {
  evaluator e;
  return evaluate (text, variable, by, further, 1, &e);
}

/* ---- What is compared ---- */

static void expression_differs (const char *what, const double *variable, int by, long double found,
                                long double expected) {
  fprintf (stderr, "%s at x = %.17g, speed = %.17g by %d: %.17Lg, expected %.17Lg\n", what, variable[0], variable[1],
           by, found, expected);
  abort ();
}

/* Whether two derivatives tell what is just after: not where terms cancel to a higher order, or have no derivative. */
static int expression_is_clear (const char *text) {
  static const char *const unclear[] = { "*", "/", "^", "sin", "cos", "tan", "exp", "log", "hypot", "K", "am", "sqrt" };
  for (size_t i = 0; i < sizeof unclear / sizeof *unclear; i++)
    if (strstr (text, unclear[i])) return 0;
  return 1;
}

/* To the bit, but where it jumps: there it is the value just after, if that is clear. */
static void expression_value (const pw_expression *x, const char *text, const double *variable) {
  evaluator e;
  double expected = (double)evaluate (text, variable, 0, 0, 0, &e), value = pw_expression_value (x, variable);
  if (value == expected || (isnan (value) && isnan (expected))) return;
  long double after = evaluate_at (text, variable, 0, 1e-7L), later = evaluate_at (text, variable, 0, 2e-7L);
  long double size = 1e-5L * (1 + fabsl (after));
  if (e.tie && (!expression_is_clear (text) || isnan (value) || !(fabsl (after - later) < size) || !(e.most < 1e6) ||
                !(e.least > 1e-3L)))
    return;
  if (e.tie && fabsl (value - after) < 10 * size) return;
  expression_differs ("value", variable, 0, value, e.tie ? after : expected);
}

/* A derivative by differences of three widths; 0 if they disagree, as they do near kinks, and where jumps of a rounded
 * value look like a slope. */
static int expression_difference (const char *text, const double *variable, int by, int order, long double *d,
                                  long double *error) {
  long double u[3];
  for (int i = 0; i < 3; i++) {
    long double h = i < 2 ? 1e-3L / (1 << i) : 1e-6L, a = evaluate_at (text, variable, by, -h),
                b = evaluate_at (text, variable, by, h);
    u[i] = order == 1 ? (b - a) / (2 * h) : (a - 2 * evaluate_at (text, variable, by, 0) + b) / (h * h);
  }
  *d = (4 * u[1] - u[0]) / 3;
  *error = fabsl (u[1] - u[0]);
  return *error <= 1e-4L * (1 + fabsl (*d)) && fabsl (u[2] - *d) <= 1e-3L * (1 + fabsl (*d));
}

static void expression_derivatives (const pw_expression *x, const char *text, const double *variable, int by) {
  double u[3];
  evaluator e;
  evaluate (text, variable, by, 0, 1, &e);
  pw_expression_derivatives (x, variable, by, u);
  if (isnan (u[0]) || e.tie || e.bend || !(e.most < 1e4L) || !(e.least > 1e-2L)) return;
  for (int order = 1; order <= 2; order++) {
    long double d, error;
    if (!expression_difference (text, variable, by, order, &d, &error)) return;
    if (!isfinite (u[order])) return; /* the chain rule has no value, which a run reports */
    if (fabsl (u[order] - d) > 2 * error + 1e-6L * (1 + fabsl (d) + e.most))
      expression_differs (order == 1 ? "first derivative" : "second derivative", variable, by, u[order], d);
  }
}

/* One-sided slope at t, of two widths that agree, or NAN. */
static long double expression_slope (const char *text, double t, long double h) {
  const double variable[] = { t, 0 };
  long double f = evaluate_at (text, variable, 0, 0), u[2];
  for (int i = 0; i < 2; i++) u[i] = (evaluate_at (text, variable, 0, h / (1 << i)) - f) / (h / (1 << i));
  return fabsl (u[0] - u[1]) < 1e-3L * (1 + fabsl (u[0])) ? u[1] : NAN;
}

/* Whether there is a jump or kink between two neighbouring numbers: values and slopes on both sides that differ. */
static int expression_broken (const char *text, double a, double b) {
  long double left = expression_slope (text, a, -1e-5L), right = expression_slope (text, b, 1e-5L);
  long double before = evaluate_at (text, (double[]){ a, 0 }, 0, 0),
              after = evaluate_at (text, (double[]){ b, 0 }, 0, 0);
  evaluator e;
  double jump =
      (double)(evaluate (text, (double[]){ b, 0 }, 0, 0, 0, &e) - evaluate (text, (double[]){ a, 0 }, 0, 0, 0, &e));
  if (isnan (left) || isnan (right)) return 0;
  if (fabsl (after - before) > 1e-2L * (1 + fabsl (after)))
    return jump != 0; /* else in long double alone: tanh (x) >= 1 */
  return fabsl (left - right) > 0.1L * (1 + fabsl (left));
}

/* Which way the expression has taken: its deviation from a straight line tells where to look. */
static void expression_between (const char *text, double a, double b) {
  const double first = a, last = b;
  while (nextafter (a, INFINITY) < b) {
    double middle = a + (b - a) / 2;
    long double fa = evaluate_at (text, (double[]){ a, 0 }, 0, 0), fb = evaluate_at (text, (double[]){ b, 0 }, 0, 0);
    long double fm = evaluate_at (text, (double[]){ middle, 0 }, 0, 0);
    if (!(fabsl (fm - fa) <= 1e6L) || !(fabsl (fb - fm) <= 1e6L)) return;
    if (fabsl (fm - fa) >= fabsl (fb - fm))
      b = middle;
    else
      a = middle;
  }
  if (a > first && b < last && expression_broken (text, a, b))
    expression_differs ("no breakpoint", (double[]){ b, 0 }, 0, a, b);
}

/* Not where breakpoints lie so close that some may be left out for a hundredth of 1 + t. */
static void expression_breakpoints (const pw_expression *x, const char *text) {
  double t = 0;
  int of_time = strstr (text, "speed") == NULL;
  for (int i = 0; i < 3 && t < 1e300; i++) {
    double next = pw_expression_breakpoint (x, t), end = fmin (next, t + 4);
    if (!(next > t)) abort ();
    for (int k = 0; of_time && x->breaks && k < 4 && end - t > 1.01e-2 * (1 + fabs (t)); k++)
      expression_between (text, t + (end - t) * (k + 0.01) / 4.1, t + (end - t) * (k + 1.01) / 4.1);
    t = next;
  }
}

static void expression_try (const pw_expression *x, const char *text) {
  static const double variable[][2] = { { 0.5, -2 }, { 1.25, 0.3 }, { 0, 1 }, { 2, 2 } };
  for (int i = 0; i < 4; i++) {
    double u[3], value = pw_expression_value (x, variable[i]);
    pw_expression_derivatives (x, variable[i], 0, u);
    if (u[0] != value && u[0] == u[0] && !x->breaks) abort ();
    expression_value (x, text, variable[i]);
    for (int by = 0; by < 2; by++) expression_derivatives (x, text, variable[i], by);
  }
  if (x->codes < 30 || x->codes % 16 == 0) expression_breakpoints (x, text); /* they take a hundred times as long */
}

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  static const char *const variable[] = { "x", "speed", NULL };
  char *text = fuzz_text (data, size);
  pw_arena arena = { 0 };
  pw_expression_error trouble = { 0 };
  const pw_expression *x;
  double value;
  char name[PW_EXPRESSION_NAME];
  if (pw_expression_read (NULL, variable, text, &arena, &x, &trouble) == PW_OK)
    expression_try (x, text);
  else if (trouble.at > strlen (text) || *trouble.text == 0)
    abort ();
  pw_expression_constant (NULL, NULL, NULL, text, &value, &trouble);
  for (const char *rest = text, *p; (p = pw_expression_next_name (&rest, name)) != NULL;)
    if (p < text || rest > text + strlen (text) || strncmp (p, name, strlen (name)) != 0) abort ();
  pw_expression_number (text, &value);
  pw_expression_is_name (text);
  pw_arena_free (&arena);
  free (text);
  return 0;
}

static fuzz_grammar expression_rules[] = {
  "e:$v`$n`($e)`-$e`$e$o$e`$e $o $e`$f($e)`$g($e,$e)`$e ? $e : "
  "$e`min($e,$e,$e)`max($e)`$f($e)`($e)$o($e)`($e$c$e)`x-$n`jacobi_am($e,$n)`elliptic_K($n)",
  "v:x`speed`x",
  "n:1`0`2`0.5`3`10`1e3`pi`deg`.25`7.5e-3`1.25`e",
  "o:+`-`*`/`^`$c",
  "c:<`<=`>`>=`==`!=`&&`||",
  "f:sin`cos`tan`asin`acos`atan`sinh`cosh`tanh`exp`log`log10`sqrt`abs`floor`ceil`round`sign",
  "g:atan2`hypot`mod`min`max",
  NULL
};

size_t LLVMFuzzerCustomMutator (uint8_t *data, size_t size, size_t most, unsigned seed) {
  return fuzz_mutate (expression_rules, data, size, most, seed);
}
