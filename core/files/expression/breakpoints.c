/* Breakpoints: times at which an expression jumps or has a kink.
 *
 * Interval arithmetic shows that no comparison or other discontinuous operation changes over a time interval, and that no
 * operand of it leaves the domain of a function, where comparisons with NaN become false; otherwise
 * the interval is bisected, the earlier half first, down to a relative width of 2^-36.  Bisection then finds the two
 * neighbouring numbers between which an operation changes: steps must end there
 * (Moore, Kearfott & Cloud 2009, Introduction to Interval Analysis, chapters 5 and 8).
 * Changes that cancel within this width, and changes by round-off only, are ignored.  While two compared numbers stay
 * equal, the width grows. */
#include <float.h>
#include <math.h>
#include "expression_parts.h"
#include "pinwheel.h"

/* Enclosure of a value over an interval of time. */
typedef struct {
  double lo, hi; /* of the numbers among the values; lo > hi: all are NaN */
  int breaks;    /* 1: may break (jump or have a kink) at a time independent of states */
  int states;    /* 1: the time of a break may depend on states */
  int nan;       /* 1: the value may be NaN */
} range;

static const range range_nan = { INFINITY, -INFINITY, 0, 0, 1 };

static const range range_any = { -INFINITY, INFINITY, 0, 0, 1 };

static int range_holds (const range *x, double value) {
  return x->lo <= value && value <= x->hi;
}

static int range_is (const range *x, double value) {
  return x->lo == value && x->hi == value && !x->nan;
}

static int range_unbounded (const range *x) {
  return x->lo == -INFINITY || x->hi == INFINITY;
}

/* Round-off of an operation: a few units in the last place, also of infinite bounds. */
static range range_of (double lo, double hi) {
  if (isnan (lo) || isnan (hi)) return range_any;
  return (range){ lo - fmin (4 * DBL_EPSILON * fabs (lo), DBL_MAX) - DBL_MIN,
                  hi + fmin (4 * DBL_EPSILON * fabs (hi), DBL_MAX) + DBL_MIN, 0, 0, 0 };
}

static double range_product (double a, double b) {
  return a == 0 || b == 0 ? 0 : a * b;
}

static double range_quotient (double a, double b) {
  return a / b;
}

/* The range of f at the corners, for an f monotonic in each argument. */
static range range_corners (double (*f) (double, double), const range *x, const range *y) {
  double a = f (x->lo, y->lo), b = f (x->lo, y->hi), c = f (x->hi, y->lo), d = f (x->hi, y->hi);
  if (isnan (a) || isnan (b) || isnan (c) || isnan (d)) return range_any;
  return range_of (fmin (fmin (a, b), fmin (c, d)), fmax (fmax (a, b), fmax (c, d)));
}

/* infinity - infinity is NaN. */
static range range_sum (const range *x, const range *y) {
  range r = range_of (x->lo + y->lo, x->hi + y->hi);
  r.nan |= (x->lo == -INFINITY && y->hi == INFINITY) || (x->hi == INFINITY && y->lo == -INFINITY);
  return r;
}

/* 0 times infinity is NaN. */
static range range_multiply (const range *x, const range *y) {
  range r = range_corners (range_product, x, y);
  r.nan |= (range_holds (x, 0) && range_unbounded (y)) || (range_unbounded (x) && range_holds (y, 0));
  return r;
}

/* All numbers, with a jump at a pole. */
static range range_pole (int jumps, int nan) {
  return (range){ -INFINITY, INFINITY, jumps, 0, nan };
}

/* 0/0 is NaN. */
static range range_divide (const range *x, const range *y) {
  return range_holds (y, 0) ? range_pole (y->lo < y->hi, range_holds (x, 0)) : range_corners (range_quotient, x, y);
}

static range range_abs (const range *x) {
  if (x->lo >= 0) return range_of (x->lo, x->hi);
  range r = x->hi <= 0 ? range_of (-x->hi, -x->lo) : range_of (0, fmax (-x->lo, x->hi));
  r.breaks = x->hi > 0;
  return r;
}

/* The values at both ends, extended to 1 or -1 if an extremum lies between them. */
static range range_sin (double lo, double hi, double shift) {
  const double turn = 2 * PW_PI, slack = 8 * DBL_EPSILON * (fabs (lo) + fabs (hi) + 1);
  range r = { -1, 1, 0, 0, 0 };
  if (!(hi - lo < turn) || !(slack < 0.1)) return r;
  double a = pw_sin (lo + shift), b = pw_sin (hi + shift);
  double top = PW_PI / 2 - shift, bottom = top - PW_PI;
  if (floor ((hi + slack - top) / turn) == floor ((lo - slack - top) / turn)) r.hi = fmin (1, fmax (a, b) + slack);
  if (floor ((hi + slack - bottom) / turn) == floor ((lo - slack - bottom) / turn))
    r.lo = fmax (-1, fmin (a, b) - slack);
  return r;
}

static range range_even (const range *x, double (*f) (double)) {
  range r = range_abs (x);
  return range_of (f (fmax (0, r.lo)), f (r.hi));
}

static range range_tan (const range *x) {
  const double slack = 8 * DBL_EPSILON * (fabs (x->lo) + fabs (x->hi) + 1);
  if (floor ((x->lo - slack) / PW_PI + 0.5) != floor ((x->hi + slack) / PW_PI + 0.5)) return range_pole (1, 0);
  return range_of (tan (x->lo), tan (x->hi));
}

static range range_monotonic (const pw_expression_function *f, const range *x) {
  if (f->one == pw_sin) return range_sin (x->lo, x->hi, 0);
  if (f->one == pw_cos) return range_sin (x->lo, x->hi, PW_PI / 2);
  if (f->one == cosh) return range_even (x, cosh);
  if (f->one == tan) return range_tan (x);
  return f->trend == PW_RISES ? range_of (f->one (x->lo), f->one (x->hi)) : range_of (f->one (x->hi), f->one (x->lo));
}

/* NaN outside the domain. */
static range range_smooth (const pw_expression_function *f, const range *x) {
  range part = { fmax (x->lo, f->from), fmin (x->hi, f->to), 0, 0, 0 };
  if (part.lo > part.hi) return range_nan;
  range r = range_monotonic (f, &part);
  r.nan |= part.lo > x->lo || part.hi < x->hi;
  return r;
}

/* An integer power; an even one has its minimum at 0. */
static range range_integer_power (const range *x, double n) {
  int even = fmod (n, 2) == 0;
  if (n < 0 && range_holds (x, 0)) return range_pole (!even, 0);
  range b = even ? range_abs (x) : *x;
  if (even) b.lo = fmax (0, b.lo);
  return range_corners (pow, &b, &(range){ n, n, 0, 0, 0 });
}

/* Powers of negative numbers are NaN unless the exponent is an integer. */
static range range_power (const range *x, const range *y) {
  if (range_is (y, rint (y->lo))) return range_integer_power (x, y->lo);
  if (x->lo < 0 && y->lo < y->hi) return range_any;
  if (x->hi < 0) return range_nan;
  range r = range_corners (pow, &(range){ fmax (0, x->lo), x->hi, 0, 0, 0 }, y);
  r.nan |= x->lo < 0;
  return r;
}

/* The angle of (x, y) jumps on the negative x axis. */
static range range_atan2 (const range *y, const range *x) {
  if (x->lo <= 0 && y->lo <= 0 && y->hi >= 0) return (range){ -PW_PI, PW_PI, 1, 0, 0 };
  return range_corners (atan2, y, x);
}

/* hypot, or jacobi_am (x, y), which is monotonic in each argument, and NaN for y > 1. */
static range range_pair (const pw_expression_function *f, const range *x, const range *y) {
  range a = range_abs (x), b = range_abs (y), below = { y->lo, fmin (y->hi, 1), 0, 0, 0 };
  if (f->two == hypot) return range_of (hypot (fmax (0, a.lo), fmax (0, b.lo)), hypot (a.hi, b.hi));
  if (y->lo > 1) return range_nan;
  range r = range_corners (f->two, x, &below);
  r.nan |= y->hi > 1;
  return r;
}

/* ---- Operations with jumps or kinks ---- */

/* floor, ceil, round: one integer, or a break.  The interval is closed and includes the value just after a jump at
 * either end, in either direction. */
static range range_whole (int op, const range *x) {
  double shift = op == PW_OP_ROUND ? 0.5 : 0;
  range r = { ceil (x->lo + shift), floor (x->hi + shift), 0, 0, 0 };
  *(op == PW_OP_CEIL ? &r.hi : &r.lo) += op == PW_OP_CEIL ? 1 : -1;
  r.breaks = !(r.lo == r.hi);
  return r;
}

/* The sign of NaN is 0. */
static range range_sign (const range *x) {
  if (x->lo > x->hi) return (range){ .nan = 0 };
  return (range){ x->lo > 0 ? 1 - x->nan : -1, x->hi < 0 ? x->nan - 1 : 1, range_holds (x, 0) || x->nan, 0, 0 };
}

static range range_mod (const range *x, const range *y) {
  range q = range_divide (x, y), n = range_whole (PW_OP_FLOOR, &q);
  double most = fmax (fabs (y->lo), fabs (y->hi));
  int nan = range_holds (y, 0) || range_unbounded (x);
  if (n.breaks) return (range){ y->lo < 0 ? -most : 0, y->hi > 0 ? most : 0, 1, 0, nan };
  range part = range_corners (range_product, &n, y);
  return range_of (x->lo - part.hi, x->hi - part.lo);
}

/* Comparisons with NaN have the value for the order 2. */
static range range_compare (int op, const range *x, const range *y) {
  static const range either = { 0, 1, 1, 0, 0 };
  int nan = x->nan | y->nan, empty = x->lo > x->hi || y->lo > y->hi;
  int order = empty                                                ? 2
              : x->hi < y->lo                                      ? -1
              : x->lo > y->hi                                      ? 1
              : x->lo == x->hi && y->lo == y->hi && x->lo == y->lo ? 0
                                                                   : 3;
  int value = pw_expression_compare (op, order);
  if (order == 3 || (nan && value != pw_expression_compare (op, 2))) return either;
  return (range){ value, value, 0, 0, 0 };
}

/* An operand that decides the result hides breaks of the other one. */
static range range_logical (int op, const range *x, const range *y) {
  double alone = op == PW_OP_OR; /* 1 decides ||, 0 decides && */
  const range *decides = x->lo == alone && x->hi == alone ? x : y->lo == alone && y->hi == alone ? y : NULL;
  if (decides) return *decides;
  return (range){ op == PW_OP_OR ? fmax (x->lo, y->lo) : fmin (x->lo, y->lo),
                  op == PW_OP_OR ? fmax (x->hi, y->hi) : fmin (x->hi, y->hi), x->breaks | y->breaks,
                  x->states | y->states, 0 };
}

/* The minimum of NaN and a number is the number. */
static range range_least (const range *x, const range *y) {
  if (y->lo > y->hi || (x->hi < y->lo && !x->nan)) return *x;
  if (x->lo > x->hi || (y->hi < x->lo && !y->nan)) return *y;
  int states = x->states | y->states;
  double hi = x->nan | y->nan ? fmax (x->hi, y->hi) : fmin (x->hi, y->hi);
  return (range){ fmin (x->lo, y->lo), hi, x->breaks | y->breaks | !states, states, x->nan & y->nan };
}

static range range_negative (const range *x) {
  return (range){ -x->hi, -x->lo, x->breaks, x->states, x->nan };
}

static range range_most (const range *x, const range *y) {
  range a = range_negative (x), b = range_negative (y), r = range_least (&a, &b);
  return range_negative (&r);
}

static range range_select (const range *condition, const range *x, const range *y) {
  if (condition->lo > 0) return *x;
  if (condition->hi < 1) return *y;
  return (range){ fmin (x->lo, y->lo), fmax (x->hi, y->hi), condition->breaks | x->breaks | y->breaks,
                  condition->states | x->states | y->states, x->nan | y->nan };
}

/* ---- Operations ---- */

static range range_one (const pw_expression_code *c, const range *x) {
  switch (c->op) {
  case PW_OP_NEGATE:
    return range_negative (x);
  case PW_OP_ABS:
    return range_abs (x);
  case PW_OP_SIGN:
    return range_sign (x);
  case PW_OP_TAN:
  case PW_OP_ONE:
    return range_smooth (&pw_expression_functions[c->which], x);
  default:
    return range_whole (c->op, x);
  }
}

static range range_two (const pw_expression_code *c, const range *x, const range *y) {
  switch (c->op) {
  case PW_OP_ADD:
    return range_sum (x, y);
  case PW_OP_SUBTRACT:
    return range_sum (x, &(range){ -y->hi, -y->lo, 0, 0, 0 });
  case PW_OP_MULTIPLY:
    return range_multiply (x, y);
  case PW_OP_DIVIDE:
    return range_divide (x, y);
  case PW_OP_POWER:
    return range_power (x, y);
  case PW_OP_MOD:
    return range_mod (x, y);
  case PW_OP_ATAN2:
    return range_atan2 (x, y);
  case PW_OP_TWO:
    return range_pair (&pw_expression_functions[c->which], x, y);
  default:
    return range_compare (c->op, x, y);
  }
}

static range range_constant (double value) {
  return isnan (value) ? range_nan : (range){ value, value, 0, 0, 0 };
}

/* Evaluates degenerate intervals exactly, so that equal numbers stay equal. */
static range range_known (const pw_expression_code *c, const range *x, int operands) {
  return range_constant (pw_expression_apply (c, x[0].lo, x[operands - 1].lo));
}

/* The result of an operation of one or two operands without their breaks.  NaN stays NaN, except in comparisons, in
 * sign, and in x^0 and 1^y. */
static range range_result (const pw_expression_code *c, const range *x, int operands) {
  const range *last = x + operands - 1;
  if (range_is (x, x->lo) && range_is (last, last->lo)) return range_known (c, x, operands);
  if (c->op == PW_OP_POWER && (range_is (x, 1) || range_is (last, 0))) return (range){ 1, 1, 0, 0, 0 };
  int keeps = c->op != PW_OP_SIGN && !(c->op >= PW_OP_LESS && c->op <= PW_OP_UNEQUAL);
  if (keeps && (x->lo > x->hi || last->lo > last->hi)) return range_nan;
  range r = operands == 1 ? range_one (c, x) : range_two (c, x, last);
  r.nan |= keeps && (x->nan || last->nan);
  return r;
}

/* Ignores breaks whose time depends on states; a constant value has no breaks. */
static range range_apply (const pw_expression_code *c, const range *x, int operands) {
  if (c->op == PW_OP_AND || c->op == PW_OP_OR) return range_logical (c->op, x, x + 1);
  if (c->op == PW_OP_MIN || c->op == PW_OP_MAX) return (c->op == PW_OP_MIN ? range_least : range_most) (x, x + 1);
  if (c->op == PW_OP_SELECT) return range_select (x, x + 1, x + 2);
  range r = range_result (c, x, operands);
  if (r.lo > r.hi) return r;
  int constant = range_is (&r, r.lo) && c->op != PW_OP_MOD && c->op != PW_OP_ATAN2 && pw_expression_jumps (c->op);
  r.states = !constant && (x[0].states || (operands == 2 && x[1].states));
  r.breaks &= !r.states;
  r.breaks |= !constant && (x[0].breaks || (operands == 2 && x[1].breaks));
  return r;
}

/* The range over a time interval, ignoring breaks of noisy operations. */
static range range_run (const pw_expression *x, const unsigned char *noisy, double lo, double hi) {
  range stack[PW_EXPRESSION_STACK], *top = stack;
  for (const pw_expression_code *c = x->code, *end = c + x->codes; c < end; c++) {
    int operands = pw_expression_operands (c->op), before = 0;
    top -= operands;
    for (int i = 0; i < operands; i++) before |= top[i].breaks;
    if (operands)
      *top = range_apply (c, top, operands);
    else if (c->op == PW_OP_CONSTANT)
      *top = range_constant (c->value);
    else
      *top = c->which == 0 ? (range){ lo, hi, 0, 0, 0 } : (range){ -DBL_MAX, DBL_MAX, 0, 1, 0 };
    if (noisy[c - x->code]) top->breaks &= before;
    top++;
  }
  return top[-1];
}

/* ---- The first breakpoint ---- */

typedef struct {
  const pw_expression *x;
  double from;
  int left;                                 /* remaining intervals */
  int equal;                                /* intervals of the least width without a change */
  int patience;                             /* number of these after which `narrow` doubles */
  double narrow;                            /* relative width below which intervals are not bisected */
  double until;                             /* end of the noise; INFINITY without noisy operations */
  unsigned char noisy[PW_EXPRESSION_CODES]; /* per operation: changes repeatedly */
} search;

/* Evaluates all discrete operations (comparisons and the like) at a time. */
static void search_evaluate (const search *s, double t, double *discrete) {
  double variable[PW_EXPRESSION_VARIABLES] = { t }, u[3];
  pw_expression_run_jet (s->x->code, s->x->codes, variable, 0, u, discrete);
}

static int search_changed (double a, double b) {
  return a != b && !(isnan (a) && isnan (b));
}

/* Whether an operation that is not noisy differs between two times. */
static int search_differ (const search *s, double a, double b) {
  double before[PW_EXPRESSION_CODES], after[PW_EXPRESSION_CODES];
  search_evaluate (s, a, before);
  search_evaluate (s, b, after);
  for (int i = 0; i < s->x->codes; i++)
    if (!s->noisy[i] && search_changed (before[i], after[i])) return 1;
  return 0;
}

/* Bisects to neighbouring numbers; returns the first one after the change. */
static double search_bisect (const search *s, double a, double b) {
  const double first = a;
  for (double middle = a + (b - a) / 2; middle > a && middle < b; middle = a + (b - a) / 2)
    if (search_differ (s, first, middle))
      b = middle;
    else
      a = middle;
  return b;
}

/* Marks operations as noisy that change so often between a and b or just after b that the cause is round-off of equal
 * numbers or the changes are too fast for any step; returns whether it marked any. */
static int search_mark_noisy (search *s, double a, double b) {
  const double width = 1e-6 * (1 + fabs (b));
  double value[2][PW_EXPRESSION_CODES];
  short changes[PW_EXPRESSION_CODES] = { 0 };
  int more = 0;
  search_evaluate (s, a, value[0]);
  for (int k = 1; k <= 512; k++) {
    search_evaluate (s, k <= 256 ? a + (b - a) * (k / 256.0) : b + width * (k / 256.0 - 1), value[k % 2]);
    for (int i = 0; i < s->x->codes; i++)
      if (search_changed (value[0][i], value[1][i]) && ++changes[i] > 8 && !s->noisy[i]) s->noisy[i] = 1, more = 1;
  }
  if (more) s->until = fmin (s->until, b + 1e-2 * (1 + fabs (b)));
  return more;
}

static double search_first (search *s, double a, double b) {
  if (s->left-- <= 0) return fmax (a, nextafter (s->from, INFINITY));
  if (!range_run (s->x, s->noisy, a, b).breaks) return INFINITY;
  if (b - a <= s->narrow * (fmax (fabs (a), fabs (b)) + s->narrow) + 1e-18) {
    if (search_differ (s, a, b)) return search_mark_noisy (s, a, b) ? search_first (s, a, b) : search_bisect (s, a, b);
    if (++s->equal % s->patience == 0) s->narrow = fmin (2 * s->narrow, 0x1p-10);
    return INFINITY;
  }
  double middle = a + (b - a) / 2, first = search_first (s, a, middle);
  return first < INFINITY ? first : search_first (s, middle, b);
}

/* At the limit of the search, or with noise, returns a time that is not a breakpoint; the next call continues there. */
double pw_expression_breakpoint (const pw_expression *x, double t) {
  const double latest = 1e18;
  search s = { .x = x, .from = t, .left = 400 + 4000000 / (100 + x->codes), .narrow = 0x1p-36, .until = INFINITY };
  s.patience = 1 + s.left / 120; /* 36 doublings, of two or three intervals each, before the limit */
  double a = t, found = INFINITY;
  if (!x->breaks) return INFINITY;
  for (double w = 1e-9 * (1 + fabs (t)); a < latest && found == INFINITY; w *= 2) {
    if (a >= s.until || (s.until == INFINITY && !range_run (x, s.noisy, a, latest).breaks)) break;
    found = search_first (&s, a, a + w);
    a += w;
  }
  return fmin (found, s.until);
}
