/* Enclosures of the values of an expression over an interval of time, and its possible jumps and kinks, by interval
 * arithmetic (Moore, Kearfott & Cloud 2009, Introduction to Interval Analysis, chapter 5). */
#include <float.h>
#include <math.h>
#include "expression.h"

/* Enclosure of a value over an interval of time. */
typedef struct {
  double lo, hi; /* of the numbers among the values; lo > hi: all are NaN */
  int breaks;    /* 1: may break, that is jump or have a kink, at a time independent of states */
  int of_states; /* 1: depends on states, and so may the times of its breaks */
  int nan;       /* 1: the value may be NaN */
} range;

static const range range_nan = { .lo = INFINITY, .hi = -INFINITY, .nan = 1 };
static const range range_all = { .lo = -INFINITY, .hi = INFINITY, .nan = 1 };
static const range range_pole = { .lo = -INFINITY, .hi = INFINITY, .breaks = 1 };

static range range_between (double lo, double hi) {
  return (range){ .lo = lo, .hi = hi };
}

static range range_constant (double value) {
  return isnan (value) ? range_nan : range_between (value, value);
}

static int range_contains (const range *x, double value) {
  return x->lo <= value && value <= x->hi;
}

static int range_is (const range *x, double value) {
  return x->lo == value && x->hi == value && !x->nan;
}

static int range_unbounded (const range *x) {
  return x->lo == -INFINITY || x->hi == INFINITY;
}

/* Outward rounding by a few units in the last place; infinite bounds stay infinite. */
static range range_rounded (double lo, double hi) {
  if (isnan (lo) || isnan (hi)) return range_all;
  return range_between (lo - fmin (4 * DBL_EPSILON * fabs (lo), DBL_MAX) - DBL_MIN,
                        hi + fmin (4 * DBL_EPSILON * fabs (hi), DBL_MAX) + DBL_MIN);
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
  if (isnan (a) || isnan (b) || isnan (c) || isnan (d)) return range_all;
  return range_rounded (fmin (fmin (a, b), fmin (c, d)), fmax (fmax (a, b), fmax (c, d)));
}

/* infinity - infinity is NaN. */
static range range_sum (const range *x, const range *y) {
  range r = range_rounded (x->lo + y->lo, x->hi + y->hi);
  r.nan |= (x->lo == -INFINITY && y->hi == INFINITY) || (x->hi == INFINITY && y->lo == -INFINITY);
  return r;
}

/* 0 times infinity is NaN. */
static range range_multiply (const range *x, const range *y) {
  range r = range_corners (range_product, x, y);
  r.nan |= (range_contains (x, 0) && range_unbounded (y)) || (range_unbounded (x) && range_contains (y, 0));
  return r;
}

/* 0/0 and inf/inf are NaN. */
static range range_divide (const range *x, const range *y) {
  if (!range_contains (y, 0)) return range_corners (range_quotient, x, y);
  range r = range_pole;
  r.breaks = y->lo < y->hi;
  r.nan = range_contains (x, 0) || (range_unbounded (x) && range_unbounded (y));
  return r;
}

static range range_abs (const range *x) {
  if (x->lo >= 0) return range_rounded (x->lo, x->hi);
  range r = x->hi <= 0 ? range_rounded (-x->hi, -x->lo) : range_rounded (0, fmax (-x->lo, x->hi));
  r.breaks = x->hi >= 0;
  return r;
}

/* sin (x + shift), x from lo to hi, bounded by its values there and extrema in between; `slack` exceeds round-off. */
static range range_sin (double lo, double hi, double shift) {
  const double turn = 2 * PW_PI, slack = 8 * DBL_EPSILON * (fabs (lo) + fabs (hi) + 1);
  range r = range_between (-1, 1);
  if (!(hi - lo < turn) || !(slack < 0.1)) return r;
  double a = pw_sin (lo + shift), b = pw_sin (hi + shift);
  double top = PW_PI / 2 - shift, bottom = top - PW_PI;
  if (floor ((hi + slack - top) / turn) == floor ((lo - slack - top) / turn)) r.hi = fmin (1, fmax (a, b) + slack);
  if (floor ((hi + slack - bottom) / turn) == floor ((lo - slack - bottom) / turn))
    r.lo = fmax (-1, fmin (a, b) - slack);
  return r;
}

static range range_tan (const range *x) {
  const double slack = 8 * DBL_EPSILON * (fabs (x->lo) + fabs (x->hi) + 1);
  if (floor ((x->lo - slack) / PW_PI + 0.5) != floor ((x->hi + slack) / PW_PI + 0.5)) return range_pole;
  return range_rounded (tan (x->lo), tan (x->hi));
}

static range range_in_domain (const pw_expression_function *f, const range *x) {
  if (f->of_one == pw_sin) return range_sin (x->lo, x->hi, 0);
  if (f->of_one == pw_cos) return range_sin (x->lo, x->hi, PW_PI / 2);
  const range size = range_abs (x);
  if (f->of_one == cosh) return range_rounded (cosh (fmax (0, size.lo)), cosh (size.hi));
  if (f->of_one == tan) return range_tan (x);
  return f->trend == PW_INCREASING ? range_rounded (f->of_one (x->lo), f->of_one (x->hi))
                                   : range_rounded (f->of_one (x->hi), f->of_one (x->lo));
}

/* NaN outside the domain. */
static range range_one_argument (const pw_expression_function *f, const range *x) {
  const range part = range_between (fmax (x->lo, f->from), fmin (x->hi, f->to));
  if (part.lo > part.hi) return range_nan;
  range r = range_in_domain (f, &part);
  r.nan |= part.lo > x->lo || part.hi < x->hi;
  return r;
}

/* An integer power.  n < 0: a pole at 0, where an odd power jumps; n >= 0: an even power has its minimum at 0. */
static range range_integer_power (const range *x, double n) {
  const range exponent = range_constant (n);
  int even = fmod (n, 2) == 0;
  if (n < 0 && range_contains (x, 0)) return even ? range_between (0, INFINITY) : range_pole;
  range base = even ? range_abs (x) : *x;
  if (even) base.lo = fmax (0, base.lo);
  return range_corners (pow, &base, &exponent);
}

/* Powers of negative numbers are NaN unless the exponent is an integer.  Infinite powers jump at -1 and 1. */
static range range_power (const range *x, const range *y) {
  if (isinf (y->lo) || isinf (y->hi)) {
    range r = range_between (x->lo < 0 ? -INFINITY : 0, INFINITY);
    r.breaks = r.nan = 1;
    return r;
  }
  if (y->lo == y->hi && y->lo == rint (y->lo)) return range_integer_power (x, y->lo);
  if (x->lo < 0 && y->lo < y->hi) return range_all;
  if (x->hi < 0) return range_nan;
  const range base = range_between (fmax (0, x->lo), x->hi);
  range r = range_corners (pow, &base, y);
  r.nan |= x->lo < 0;
  return r;
}

/* The angle of (x, y) jumps on the negative x axis. */
static range range_atan2 (const range *y, const range *x) {
  if (x->lo <= 0 && y->lo <= 0 && y->hi >= 0) return (range){ .lo = -PW_PI, .hi = PW_PI, .breaks = 1 };
  return range_corners (atan2, y, x);
}

/* Has a kink at the origin. */
static range range_hypot (const range *x, const range *y) {
  const range a = range_abs (x), b = range_abs (y);
  range r = range_rounded (hypot (fmax (0, a.lo), fmax (0, b.lo)), hypot (a.hi, b.hi));
  r.breaks = range_contains (x, 0) && range_contains (y, 0);
  return r;
}

/* floor, ceil, round: one integer, or a break; includes values just after a jump at an end, in either direction. */
static range range_integer (int op, const range *x) {
  double shift = op == PW_OP_ROUND ? 0.5 : 0;
  range r = range_between (ceil (x->lo + shift), floor (x->hi + shift));
  if (op == PW_OP_CEIL)
    r.hi += 1;
  else
    r.lo -= 1;
  r.breaks = !(r.lo == r.hi);
  return r;
}

/* The sign of NaN is 0. */
static range range_sign (const range *x) {
  if (x->lo > x->hi) return range_constant (0);
  return (range){ .lo = x->lo > 0 ? 1 - x->nan : -1,
                  .hi = x->hi < 0 ? x->nan - 1 : 1,
                  .breaks = range_contains (x, 0) || x->nan };
}

/* The remainder, between 0 and y: x - n y with n = floor (x / y). */
static range range_mod (const range *x, const range *y) {
  range quotient = range_divide (x, y), n = range_integer (PW_OP_FLOOR, &quotient);
  double most = fmax (fabs (y->lo), fabs (y->hi));
  int nan = range_contains (y, 0) || range_unbounded (x);
  if (n.breaks) return (range){ .lo = y->lo < 0 ? -most : 0, .hi = y->hi > 0 ? most : 0, .breaks = 1, .nan = nan };
  range part = range_corners (range_product, &n, y);
  return range_rounded (x->lo - part.hi, x->hi - part.lo);
}

static range range_compare (int op, const range *x, const range *y) {
  static const range either = { .lo = 0, .hi = 1, .breaks = 1 };
  int nan = x->nan | y->nan, only_nan = x->lo > x->hi || y->lo > y->hi;
  int equal = x->lo == x->hi && y->lo == y->hi && x->lo == y->lo;
  if (!only_nan && !equal && x->hi >= y->lo && x->lo <= y->hi) return either;
  pw_order order = only_nan        ? PW_ORDER_UNORDERED
                   : equal         ? PW_ORDER_EQUAL
                   : x->hi < y->lo ? PW_ORDER_LESS
                                   : PW_ORDER_GREATER;
  int value = pw_expression_compare (op, order);
  return nan && value != pw_expression_compare (op, PW_ORDER_UNORDERED) ? either : range_constant (value);
}

static range range_hull (const range *x, const range *y) {
  return (range){ .lo = fmin (x->lo, y->lo),
                  .hi = fmax (x->hi, y->hi),
                  .breaks = x->breaks | y->breaks,
                  .of_states = x->of_states | y->of_states,
                  .nan = x->nan | y->nan };
}

/* The minimum of NaN and a number is the number.  Where either operand can be the smaller one there may be a kink, and
 * a minimum that is constant in the interval may fall just after it. */
static range range_min (const range *x, const range *y) {
  if (y->lo > y->hi || (x->hi < y->lo && !x->nan)) return *x;
  if (x->lo > x->hi || (y->hi < x->lo && !y->nan)) return *y;
  range r = range_hull (x, y);
  if (!r.nan) r.hi = fmin (x->hi, y->hi);
  if (r.lo == r.hi && (x->lo < x->hi || y->lo < y->hi)) r.lo = range_rounded (r.lo, r.lo).lo;
  r.breaks |= !r.of_states;
  r.nan = x->nan & y->nan;
  return r;
}

static range range_negative (const range *x) {
  range r = *x;
  r.lo = -x->hi;
  r.hi = -x->lo;
  return r;
}

static range range_max (const range *x, const range *y) {
  range a = range_negative (x), b = range_negative (y), r = range_min (&a, &b);
  return range_negative (&r);
}

static range range_select (const range *condition, const range *x, const range *y) {
  if (condition->lo > 0) return *x;
  if (condition->hi < 1) return *y;
  range r = range_hull (x, y);
  if (range_is (&r, r.lo)) return r; /* the condition does not matter */
  r.breaks |= condition->breaks;
  r.of_states |= condition->of_states;
  return r;
}

/* At an arc length: x and y change at most as fast as it; a bound of the others is known between two corners alone. */
static range range_path_at (const pw_expression_code *c, const range *s) {
  const int unbounded = range_unbounded (s);
  double half = s->hi / 2 - s->lo / 2, middle = pw_expression_apply (c, 0, s->lo + half);
  range r = range_rounded (middle - half, middle + half);
  if (unbounded || c->index >= PW_PATH_HEADING) r.lo = -DBL_MAX, r.hi = DBL_MAX;
  r.breaks = unbounded || pw_path_break (c->path, s->lo) <= s->hi, r.nan = unbounded;
  return r;
}

/* Operations of one or two operands but min and max; only sign and comparisons consider NaN (range_result). */
static range range_operation (const pw_expression_code *c, const range *x) {
  const range *y = x + 1;
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
  case PW_OP_FUNCTION_OF_ONE:
    return range_one_argument (&pw_expression_functions[c->index], x);
  case PW_OP_PATH_AT:
    return range_path_at (c, x);
  case PW_OP_ADD:
    return range_sum (x, y);
  case PW_OP_SUBTRACT:
    return range_sum (x, (range[]){ range_negative (y) });
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
  case PW_OP_HYPOT:
    return range_hypot (x, y);
  case PW_OP_FUNCTION_OF_TWO:
    return y->lo > 1 ? range_nan : range_corners (pw_jacobi_am, x, y); /* jacobi_am increases with x */
  default:
    return range_compare (c->op, x, y);
  }
}

/* The result of an operation of one or two operands without their breaks.  Degenerate intervals are evaluated exactly,
 * so that equal numbers stay equal.  NaN stays NaN, except in comparisons, in sign, and in x^0 and 1^y. */
static range range_result (const pw_expression_code *c, const range *x, int operands) {
  const range *last = x + operands - 1;
  if (range_is (x, x->lo) && range_is (last, last->lo))
    return range_constant (pw_expression_apply (c, x->lo, last->lo));
  if (c->op == PW_OP_POWER && (range_is (x, 1) || range_is (last, 0))) return range_constant (1);
  int keeps_nan = c->op != PW_OP_SIGN && !(c->op >= PW_OP_LESS && c->op <= PW_OP_UNEQUAL);
  if (keeps_nan && (x->lo > x->hi || last->lo > last->hi)) return range_nan;
  range r = range_operation (c, x);
  r.nan |= keeps_nan && (x->nan || last->nan);
  return r;
}

/* Ignores breaks whose time depends on states.  Where an operation that jumps, and is constant between jumps (unlike
 * mod and atan2), has one value, breaks of its operands do not matter. */
static range range_apply (const pw_expression_code *c, const range *x, int operands) {
  if (c->op == PW_OP_MIN || c->op == PW_OP_MAX) return (c->op == PW_OP_MIN ? range_min : range_max) (x, x + 1);
  if (c->op == PW_OP_SELECT) return range_select (x, x + 1, x + 2);
  if (c->op == PW_OP_PATH_NEAREST) return (range){ -DBL_MAX, DBL_MAX, .of_states = 1, .nan = 1 };
  range r = range_result (c, x, operands);
  if (r.lo > r.hi) return r;
  int constant = range_is (&r, r.lo) && c->op != PW_OP_MOD && c->op != PW_OP_ATAN2 && pw_expression_jumps (c->op);
  r.of_states = !constant && (x[0].of_states || (operands == 2 && x[1].of_states));
  r.breaks &= !r.of_states;
  r.breaks |= !constant && (x[0].breaks || (operands == 2 && x[1].breaks));
  return r;
}

/* Evaluates operations on a stack; returns its top.  noisy may be NULL.  variable: ranges of the first `known`
 * variables; the others are states of which nothing is known. */
static range *range_run (const pw_expression_code *code, int codes, const unsigned char *noisy, const range *variable,
                         int known, range *top) {
  for (const pw_expression_code *c = code, *end = c + codes; c < end; c++) {
    int operands = pw_expression_operands (c->op), operands_break = 0;
    top -= operands;
    for (int i = 0; i < operands; i++) operands_break |= top[i].breaks;
    if (operands)
      *top = range_apply (c, top, operands);
    else if (c->op == PW_OP_CONSTANT)
      *top = range_constant (c->value);
    else
      *top = c->index < known ? variable[c->index] : (range){ .lo = -DBL_MAX, .hi = DBL_MAX, .of_states = 1 };
    if (noisy && noisy[c - code]) top->breaks &= operands_break;
    top++;
  }
  return top;
}

/* The range over a time interval, without breaks of operations that are marked in `noisy`, one mark per operation. */
static range range_of (const pw_expression *expression, const unsigned char *noisy, double lo, double hi) {
  range stack[PW_EXPRESSION_STACK], time = range_between (lo, hi);
  return range_run (expression->code, expression->codes, noisy, &time, 1, stack)[-1];
}

void pw_expression_bounds (const pw_expression *expression, int variables, const double *lo, const double *hi,
                           double bounds[2]) {
  range stack[PW_EXPRESSION_STACK], variable[PW_EXPRESSION_VARIABLES];
  for (int i = 0; i < variables; i++) variable[i] = range_between (lo[i], hi[i]);
  const range r = range_run (expression->code, expression->codes, NULL, variable, variables, stack)[-1];
  const int unknown = r.lo > r.hi || r.of_states || r.nan;
  bounds[0] = unknown ? -INFINITY : r.lo, bounds[1] = unknown ? INFINITY : r.hi;
}

int pw_expression_may_be_narrow (const pw_expression *expression) {
  for (int i = 0; i < expression->codes; i++) {
    const pw_expression_code *c = &expression->code[i];
    const int constant = i > 0 && c[-1].op == PW_OP_CONSTANT; /* the last operand */
    if (c->op == PW_OP_TAN || c->op == PW_OP_FUNCTION_OF_ONE || c->op == PW_OP_FUNCTION_OF_TWO ||
        c->op == PW_OP_ATAN2 || c->op == PW_OP_HYPOT)
      return 1;
    if ((c->op == PW_OP_DIVIDE && !constant) || (c->op == PW_OP_POWER && !(constant && fabs (c[-1].value - 2) <= 1)))
      return 1;
  }
  return 0;
}

pw_jumps pw_expression_may_jump (const pw_expression_code *code, int codes) {
  range stack[PW_EXPRESSION_STACK];
  const pw_expression_code *last = code + codes - 1;
  int operands = pw_expression_operands (last->op);
  if (last->op == PW_OP_PATH_NEAREST)
    return !pw_path_is_smooth (last->path) ? PW_JUMPS
           : last[-1].op == PW_OP_CONSTANT ? PW_JUMPS_RARELY
                                           : PW_JUMPS_NEVER;
  if (last->op == PW_OP_PATH_AT && (last->index < PW_PATH_HEADING || pw_path_is_smooth (last->path)))
    return last->index == PW_PATH_CURVATURE ? PW_JUMPS_RARELY : PW_JUMPS_NEVER; /* at the ends of an open path */
  const range time = range_between (-DBL_MAX, DBL_MAX), *top = range_run (code, codes - 1, NULL, &time, 1, stack);
  if (!pw_expression_jumps (last->op) || !range_result (last, top - operands, operands).breaks) return PW_JUMPS_NEVER;
  return last->op == PW_OP_ATAN2 ? PW_JUMPS_RARELY : PW_JUMPS;
}

/* Breakpoints: times at which an expression jumps or has a kink.
 *
 * An interval of time is excluded if interval arithmetic proves that in it, wherever the value depends on them, the
 * discrete parts of operations stay the same (the result of a comparison, the sign of the operand of abs, and so on),
 * and no operand of a comparison, sign, min or max becomes NaN at the end of a function's domain.
 * Otherwise it is bisected, the earlier half first, down to a least width, at first 2^-36 |t| (Moore, Kearfott &
 * Cloud 2009, Introduction to Interval Analysis, chapter 8).  If an operation differs between the ends of such an
 * interval, bisection finds the two adjacent floating-point numbers between which it changes: steps must end there.
 * Changes that cancel within the least width are ignored.  So are those of noisy operations, which change too often
 * for steps to end there.  The least width doubles where many intervals of that width could not be excluded although
 * nothing changes in them, as while two compared numbers stay equal. */

#define LATEST 1e18                  /* breakpoints after it are not found [s] */
#define FIRST_WIDTH 1e-9             /* of the first interval, relative to 1 s + |t|; each next one is twice as wide */
#define LEAST_WIDTH 0x1p-36          /* initial value of search.least_width */
#define GREATEST_LEAST_WIDTH 0x1p-10 /* to which it grows */
#define SMALLEST_INTERVAL 1e-18      /* [s]: not bisected either, for t near 0 */
enum { NOISE_CHANGES = 8 };          /* more changes in an interval of the least width and just after it are noise */
enum { NOISE_SAMPLES = 256 };        /* times in the interval at which changes are counted; as many again after it */
#define NOISE_WIDTH 1e-6             /* of the time after the interval, relative to 1 s + |t| */
#define NOISE_DURATION 1e-2          /* for which changes of a noisy operation are ignored, relative to 1 s + |t| */

typedef struct {
  const pw_expression *expression;
  double from;                              /* time at which the search begins */
  int remaining;                            /* intervals that may still be tested */
  int undecided;                            /* intervals so far of the least width, not excluded, without a change */
  int undecided_to_double;                  /* number of these after which the least width doubles */
  double least_width;                       /* w: intervals up to w (|t| + w 1 s) are not bisected; w^2: for t near 0 */
  double noise_end;                         /* time until which noisy operations are ignored; INFINITY: none is noisy */
  unsigned char noisy[PW_EXPRESSION_CODES]; /* 1: this operation is noisy */
} search;

/* Evaluates the discrete part of all operations at time t, with states 0 (pw_expression_run_jet). */
static void search_evaluate (const search *s, double t, double *discrete) {
  double variable[PW_EXPRESSION_VARIABLES] = { t }, u[3];
  pw_expression_run_jet (s->expression, variable, PW_EXPRESSION_TIME, u, discrete);
}

static int search_changed (double a, double b) {
  return a != b && !(isnan (a) && isnan (b));
}

/* Whether an operation that is not noisy differs between two times. */
static int search_differ (const search *s, double a, double b) {
  double before[PW_EXPRESSION_CODES], after[PW_EXPRESSION_CODES];
  search_evaluate (s, a, before);
  search_evaluate (s, b, after);
  for (int i = 0; i < s->expression->codes; i++)
    if (!s->noisy[i] && search_changed (before[i], after[i])) return 1;
  return 0;
}

/* Bisects to adjacent floating-point numbers; returns the one after the change. */
static double search_bisect (const search *s, double a, double b) {
  const double first = a;
  for (double middle = a + (b - a) / 2; middle > a && middle < b; middle = a + (b - a) / 2)
    if (search_differ (s, first, middle))
      b = middle;
    else
      a = middle;
  return b;
}

/* Marks operations as noisy by their changes between a and b and just after b.  Returns whether it marked any. */
static int search_mark_noisy (search *s, double a, double b) {
  const double after = NOISE_WIDTH * (1 + fabs (b));
  double value[2][PW_EXPRESSION_CODES];
  short changes[PW_EXPRESSION_CODES] = { 0 };
  int marked = 0;
  search_evaluate (s, a, value[0]);
  for (int k = 1; k <= 2 * NOISE_SAMPLES; k++) {
    double part = (double)k / NOISE_SAMPLES, t = part <= 1 ? a + (b - a) * part : b + after * (part - 1);
    search_evaluate (s, t, value[k % 2]);
    for (int i = 0; i < s->expression->codes; i++)
      if (search_changed (value[0][i], value[1][i]) && ++changes[i] > NOISE_CHANGES && !s->noisy[i])
        s->noisy[i] = 1, marked = 1;
  }
  if (marked) s->noise_end = fmin (s->noise_end, b + NOISE_DURATION * (1 + fabs (b)));
  return marked;
}

/* The first breakpoint between a and b, or INFINITY; at the limit of the search, a time up to which there is none. */
static double search_first (search *s, double a, double b) {
  if (s->remaining-- <= 0) return fmax (a, nextafter (s->from, INFINITY));
  if (!range_of (s->expression, s->noisy, a, b).breaks) return INFINITY;
  if (b - a <= s->least_width * (fmax (fabs (a), fabs (b)) + s->least_width) + SMALLEST_INTERVAL) {
    if (search_differ (s, a, b)) return search_mark_noisy (s, a, b) ? search_first (s, a, b) : search_bisect (s, a, b);
    if (++s->undecided % s->undecided_to_double == 0) s->least_width = fmin (2 * s->least_width, GREATEST_LEAST_WIDTH);
    return INFINITY;
  }
  double middle = a + (b - a) / 2, first = search_first (s, a, middle);
  return first < INFINITY ? first : search_first (s, middle, b);
}

double pw_expression_breakpoint (const pw_expression *expression, double t) {
  search s = { .expression = expression, .from = t, .least_width = LEAST_WIDTH, .noise_end = INFINITY };
  s.remaining = 400 + 4000000 / (100 + expression->codes); /* so that the time of a search has a bound */
  s.undecided_to_double = 1 + s.remaining / 120;           /* 26 doublings, 2^-36 to 2^-10, before the limit */
  double a = t, found = INFINITY;
  if (!expression->breaks) return INFINITY;
  for (double width = FIRST_WIDTH * (1 + fabs (t)); a < LATEST && found == INFINITY; width *= 2) {
    if (a >= s.noise_end || !range_of (expression, s.noisy, a, LATEST).breaks) break;
    found = search_first (&s, a, a + width);
    a += width;
  }
  return fmin (found, s.noise_end); /* noise_end is no breakpoint, but a new search begins there */
}
