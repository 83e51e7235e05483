/* Enclosures of the values of an expression, by interval arithmetic
 * (Moore, Kearfott & Cloud 2009, Introduction to Interval Analysis, chapter 5). */
#include <float.h>
#include <math.h>
#include "expression_parts.h"
#include "pinwheel.h"

static const pw_range range_nan = { .lo = INFINITY, .hi = -INFINITY, .nan = 1 };

static const pw_range range_all = { .lo = -INFINITY, .hi = INFINITY, .nan = 1 };

static pw_range range_constant (double value) {
  return isnan (value) ? range_nan : (pw_range){ value, value, 0, 0, 0 };
}

static int range_contains (const pw_range *x, double value) {
  return x->lo <= value && value <= x->hi;
}

static int range_is (const pw_range *x, double value) {
  return x->lo == value && x->hi == value && !x->nan;
}

static int range_unbounded (const pw_range *x) {
  return x->lo == -INFINITY || x->hi == INFINITY;
}

/* Outward rounding by a few units in the last place; infinite bounds stay infinite. */
static pw_range range_rounded (double lo, double hi) {
  if (isnan (lo) || isnan (hi)) return range_all;
  return (pw_range){ lo - fmin (4 * DBL_EPSILON * fabs (lo), DBL_MAX) - DBL_MIN,
                     hi + fmin (4 * DBL_EPSILON * fabs (hi), DBL_MAX) + DBL_MIN, 0, 0, 0 };
}

static double range_product (double a, double b) {
  return a == 0 || b == 0 ? 0 : a * b;
}

static double range_quotient (double a, double b) {
  return a / b;
}

/* The range of f at the corners, for an f monotonic in each argument. */
static pw_range range_corners (double (*f) (double, double), const pw_range *x, const pw_range *y) {
  double a = f (x->lo, y->lo), b = f (x->lo, y->hi), c = f (x->hi, y->lo), d = f (x->hi, y->hi);
  if (isnan (a) || isnan (b) || isnan (c) || isnan (d)) return range_all;
  return range_rounded (fmin (fmin (a, b), fmin (c, d)), fmax (fmax (a, b), fmax (c, d)));
}

/* infinity - infinity is NaN. */
static pw_range range_sum (const pw_range *x, const pw_range *y) {
  pw_range r = range_rounded (x->lo + y->lo, x->hi + y->hi);
  r.nan |= (x->lo == -INFINITY && y->hi == INFINITY) || (x->hi == INFINITY && y->lo == -INFINITY);
  return r;
}

/* 0 times infinity is NaN. */
static pw_range range_multiply (const pw_range *x, const pw_range *y) {
  pw_range r = range_corners (range_product, x, y);
  r.nan |= (range_contains (x, 0) && range_unbounded (y)) || (range_unbounded (x) && range_contains (y, 0));
  return r;
}

/* All numbers, with a jump at a pole. */
static pw_range range_pole (int jumps, int nan) {
  return (pw_range){ -INFINITY, INFINITY, jumps, 0, nan };
}

/* 0/0 is NaN. */
static pw_range range_divide (const pw_range *x, const pw_range *y) {
  return range_contains (y, 0) ? range_pole (y->lo < y->hi, range_contains (x, 0))
                               : range_corners (range_quotient, x, y);
}

static pw_range range_abs (const pw_range *x) {
  if (x->lo >= 0) return range_rounded (x->lo, x->hi);
  pw_range r = x->hi <= 0 ? range_rounded (-x->hi, -x->lo) : range_rounded (0, fmax (-x->lo, x->hi));
  r.breaks = x->hi > 0;
  return r;
}

/* The values at both ends, extended to 1 or -1 if an extremum lies between them. */
static pw_range range_sin (double lo, double hi, double shift) {
  const double turn = 2 * PW_PI, slack = 8 * DBL_EPSILON * (fabs (lo) + fabs (hi) + 1);
  pw_range r = { -1, 1, 0, 0, 0 };
  if (!(hi - lo < turn) || !(slack < 0.1)) return r;
  double a = pw_sin (lo + shift), b = pw_sin (hi + shift);
  double top = PW_PI / 2 - shift, bottom = top - PW_PI;
  if (floor ((hi + slack - top) / turn) == floor ((lo - slack - top) / turn)) r.hi = fmin (1, fmax (a, b) + slack);
  if (floor ((hi + slack - bottom) / turn) == floor ((lo - slack - bottom) / turn))
    r.lo = fmax (-1, fmin (a, b) - slack);
  return r;
}

static pw_range range_cosh (const pw_range *x) {
  pw_range r = range_abs (x);
  return range_rounded (cosh (fmax (0, r.lo)), cosh (r.hi));
}

static pw_range range_tan (const pw_range *x) {
  const double slack = 8 * DBL_EPSILON * (fabs (x->lo) + fabs (x->hi) + 1);
  if (floor ((x->lo - slack) / PW_PI + 0.5) != floor ((x->hi + slack) / PW_PI + 0.5)) return range_pole (1, 0);
  return range_rounded (tan (x->lo), tan (x->hi));
}

/* A function of one argument in its domain. */
static pw_range range_in_domain (const pw_expression_function *f, const pw_range *x) {
  if (f->one == pw_sin) return range_sin (x->lo, x->hi, 0);
  if (f->one == pw_cos) return range_sin (x->lo, x->hi, PW_PI / 2);
  if (f->one == cosh) return range_cosh (x);
  if (f->one == tan) return range_tan (x);
  return f->trend == PW_INCREASING ? range_rounded (f->one (x->lo), f->one (x->hi))
                                   : range_rounded (f->one (x->hi), f->one (x->lo));
}

/* NaN outside the domain. */
static pw_range range_one_argument (const pw_expression_function *f, const pw_range *x) {
  pw_range part = { fmax (x->lo, f->from), fmin (x->hi, f->to), 0, 0, 0 };
  if (part.lo > part.hi) return range_nan;
  pw_range r = range_in_domain (f, &part);
  r.nan |= part.lo > x->lo || part.hi < x->hi;
  return r;
}

/* An integer power; an even one has its minimum at 0. */
static pw_range range_integer_power (const pw_range *x, double n) {
  int even = fmod (n, 2) == 0;
  if (n < 0 && range_contains (x, 0)) return range_pole (!even, 0);
  pw_range b = even ? range_abs (x) : *x;
  if (even) b.lo = fmax (0, b.lo);
  return range_corners (pow, &b, &(pw_range){ n, n, 0, 0, 0 });
}

/* Powers of negative numbers are NaN unless the exponent is an integer.  Infinite powers jump at -1 and 1. */
static pw_range range_power (const pw_range *x, const pw_range *y) {
  if (isinf (y->lo) || isinf (y->hi)) return (pw_range){ .lo = 0, .hi = INFINITY, .breaks = 1, .nan = 1 };
  if (y->lo == y->hi && y->lo == rint (y->lo)) return range_integer_power (x, y->lo);
  if (x->lo < 0 && y->lo < y->hi) return range_all;
  if (x->hi < 0) return range_nan;
  pw_range r = range_corners (pow, &(pw_range){ fmax (0, x->lo), x->hi, 0, 0, 0 }, y);
  r.nan |= x->lo < 0;
  return r;
}

/* The angle of (x, y) jumps on the negative x axis. */
static pw_range range_atan2 (const pw_range *y, const pw_range *x) {
  if (x->lo <= 0 && y->lo <= 0 && y->hi >= 0) return (pw_range){ .lo = -PW_PI, .hi = PW_PI, .breaks = 1 };
  return range_corners (atan2, y, x);
}

/* hypot, or jacobi_am (x, y), which is monotonic in each argument, and NaN for y > 1. */
static pw_range range_two_arguments (const pw_expression_function *f, const pw_range *x, const pw_range *y) {
  pw_range a = range_abs (x), b = range_abs (y), below = { y->lo, fmin (y->hi, 1), 0, 0, 0 };
  if (f->two == hypot) return range_rounded (hypot (fmax (0, a.lo), fmax (0, b.lo)), hypot (a.hi, b.hi));
  if (y->lo > 1) return range_nan;
  pw_range r = range_corners (f->two, x, &below);
  r.nan |= y->hi > 1;
  return r;
}

/* ---- Operations with jumps or kinks ---- */

/* floor, ceil, round: one integer, or a break.  The interval is closed and includes the value just after a jump at
 * either end, in either direction. */
static pw_range range_integer (int op, const pw_range *x) {
  double shift = op == PW_OP_ROUND ? 0.5 : 0;
  pw_range r = { ceil (x->lo + shift), floor (x->hi + shift), 0, 0, 0 };
  *(op == PW_OP_CEIL ? &r.hi : &r.lo) += op == PW_OP_CEIL ? 1 : -1;
  r.breaks = !(r.lo == r.hi);
  return r;
}

/* The sign of NaN is 0. */
static pw_range range_sign (const pw_range *x) {
  if (x->lo > x->hi) return range_constant (0);
  return (pw_range){ x->lo > 0 ? 1 - x->nan : -1, x->hi < 0 ? x->nan - 1 : 1, range_contains (x, 0) || x->nan, 0, 0 };
}

static pw_range range_mod (const pw_range *x, const pw_range *y) {
  pw_range q = range_divide (x, y), n = range_integer (PW_OP_FLOOR, &q);
  double most = fmax (fabs (y->lo), fabs (y->hi));
  int nan = range_contains (y, 0) || range_unbounded (x);
  if (n.breaks) return (pw_range){ y->lo < 0 ? -most : 0, y->hi > 0 ? most : 0, 1, 0, nan };
  pw_range part = range_corners (range_product, &n, y);
  return range_rounded (x->lo - part.hi, x->hi - part.lo);
}

/* order: -1, 0, 1, or 2 if an operand is NaN; 3: unknown. */
static pw_range range_compare (int op, const pw_range *x, const pw_range *y) {
  static const pw_range either = { 0, 1, 1, 0, 0 };
  int nan = x->nan | y->nan, empty = x->lo > x->hi || y->lo > y->hi;
  int order = empty                                                ? 2
              : x->hi < y->lo                                      ? -1
              : x->lo > y->hi                                      ? 1
              : x->lo == x->hi && y->lo == y->hi && x->lo == y->lo ? 0
                                                                   : 3;
  int value = pw_expression_compare (op, order);
  if (order == 3 || (nan && value != pw_expression_compare (op, 2))) return either;
  return (pw_range){ value, value, 0, 0, 0 };
}

/* An operand that decides the result hides breaks of the other one. */
static pw_range range_logical (int op, const pw_range *x, const pw_range *y) {
  double alone = op == PW_OP_OR; /* 1 decides ||, 0 decides && */
  const pw_range *decides = x->lo == alone && x->hi == alone ? x : y->lo == alone && y->hi == alone ? y : NULL;
  if (decides) return *decides;
  return (pw_range){ op == PW_OP_OR ? fmax (x->lo, y->lo) : fmin (x->lo, y->lo),
                     op == PW_OP_OR ? fmax (x->hi, y->hi) : fmin (x->hi, y->hi), x->breaks | y->breaks,
                     x->states | y->states, 0 };
}

/* The minimum of NaN and a number is the number. */
static pw_range range_min (const pw_range *x, const pw_range *y) {
  if (y->lo > y->hi || (x->hi < y->lo && !x->nan)) return *x;
  if (x->lo > x->hi || (y->hi < x->lo && !y->nan)) return *y;
  int states = x->states | y->states;
  double hi = x->nan | y->nan ? fmax (x->hi, y->hi) : fmin (x->hi, y->hi);
  return (pw_range){ fmin (x->lo, y->lo), hi, x->breaks | y->breaks | !states, states, x->nan & y->nan };
}

static pw_range range_negative (const pw_range *x) {
  return (pw_range){ -x->hi, -x->lo, x->breaks, x->states, x->nan };
}

static pw_range range_max (const pw_range *x, const pw_range *y) {
  pw_range a = range_negative (x), b = range_negative (y), r = range_min (&a, &b);
  return range_negative (&r);
}

static pw_range range_select (const pw_range *condition, const pw_range *x, const pw_range *y) {
  if (condition->lo > 0) return *x;
  if (condition->hi < 1) return *y;
  return (pw_range){ fmin (x->lo, y->lo), fmax (x->hi, y->hi), condition->breaks | x->breaks | y->breaks,
                     condition->states | x->states | y->states, x->nan | y->nan };
}

/* ---- Operations ---- */

/* x: one or two operands. */
static pw_range range_operation (const pw_expression_code *c, const pw_range *x) {
  const pw_range *y = x + 1;
  switch (c->op) {
  case PW_OP_NEGATE:
    return range_negative (x);
  case PW_OP_ABS:
    return range_abs (x);
  case PW_OP_SIGN:
    return range_sign (x);
  case PW_OP_FLOOR:
  case PW_OP_CEIL:
  case PW_OP_ROUND:
    return range_integer (c->op, x);
  case PW_OP_TAN:
  case PW_OP_ONE:
    return range_one_argument (&pw_expression_functions[c->which], x);
  case PW_OP_ADD:
    return range_sum (x, y);
  case PW_OP_SUBTRACT:
    return range_sum (x, &(pw_range){ -y->hi, -y->lo, 0, 0, 0 });
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
    return range_two_arguments (&pw_expression_functions[c->which], x, y);
  default:
    return range_compare (c->op, x, y);
  }
}

/* The result of an operation of one or two operands without their breaks.  Degenerate intervals are evaluated exactly,
 * so that equal numbers stay equal.  NaN stays NaN, except in comparisons, in sign, and in x^0 and 1^y. */
static pw_range range_result (const pw_expression_code *c, const pw_range *x, int operands) {
  const pw_range *last = x + operands - 1;
  if (range_is (x, x->lo) && range_is (last, last->lo))
    return range_constant (pw_expression_apply (c, x->lo, last->lo));
  if (c->op == PW_OP_POWER && (range_is (x, 1) || range_is (last, 0))) return (pw_range){ 1, 1, 0, 0, 0 };
  int keeps = c->op != PW_OP_SIGN && !(c->op >= PW_OP_LESS && c->op <= PW_OP_UNEQUAL);
  if (keeps && (x->lo > x->hi || last->lo > last->hi)) return range_nan;
  pw_range r = range_operation (c, x);
  r.nan |= keeps && (x->nan || last->nan);
  return r;
}

/* Ignores breaks whose time depends on states.  An operation that jumps has no breaks where it has one value; mod and atan2 also
 * vary between their jumps. */
static pw_range range_apply (const pw_expression_code *c, const pw_range *x, int operands) {
  if (c->op == PW_OP_AND || c->op == PW_OP_OR) return range_logical (c->op, x, x + 1);
  if (c->op == PW_OP_MIN || c->op == PW_OP_MAX) return (c->op == PW_OP_MIN ? range_min : range_max) (x, x + 1);
  if (c->op == PW_OP_SELECT) return range_select (x, x + 1, x + 2);
  pw_range r = range_result (c, x, operands);
  if (r.lo > r.hi) return r;
  int constant = range_is (&r, r.lo) && c->op != PW_OP_MOD && c->op != PW_OP_ATAN2 && pw_expression_jumps (c->op);
  r.states = !constant && (x[0].states || (operands == 2 && x[1].states));
  r.breaks &= !r.states;
  r.breaks |= !constant && (x[0].breaks || (operands == 2 && x[1].breaks));
  return r;
}

pw_range pw_expression_range (const pw_expression *x, const unsigned char *noisy, double lo, double hi) {
  pw_range stack[PW_EXPRESSION_STACK], *top = stack;
  for (const pw_expression_code *c = x->code, *end = c + x->codes; c < end; c++) {
    int operands = pw_expression_operands (c->op), before = 0;
    top -= operands;
    for (int i = 0; i < operands; i++) before |= top[i].breaks;
    if (operands)
      *top = range_apply (c, top, operands);
    else if (c->op == PW_OP_CONSTANT)
      *top = range_constant (c->value);
    else
      *top = c->which == 0 ? (pw_range){ .lo = lo, .hi = hi } /* time */
                           : (pw_range){ .lo = -DBL_MAX, .hi = DBL_MAX, .states = 1 };
    if (noisy[c - x->code]) top->breaks &= before;
    top++;
  }
  return top[-1];
}
