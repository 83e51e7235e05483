/* Values and exact derivatives of expressions.
 *
 * For derivatives, each operation propagates (value, first, second derivative) by the chain rule,
 *
 *   f' = f_x x' + f_y y',   f'' = f_xx x'^2 + 2 f_xy x' y' + f_yy y'^2 + f_x x'' + f_y y''
 *
 * where f_x is the partial derivative with respect to operand x, and the prime the derivative with respect to the
 * chosen variable (Griewank & Walther 2008, Evaluating Derivatives, chapter 13).  The derivatives decide comparisons
 * of equal numbers, so that an expression has the value just after a jump, that is for a slightly larger variable. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "expression.h"

#define SIDE_ROUND_OFF (16 * DBL_EPSILON) /* of a condition's operands */

/* ---- Derivatives of functions (Abramowitz & Stegun 1964, chapters 4 and 17) ---- */

#define PARTIALS_OF_ONE(name, first, second)                          \
  static pw_partials partials_##name (double x, double y, double f) { \
    (void)x, (void)y, (void)f;                                        \
    return (pw_partials){ .x = first, .xx = second };                 \
  }

PARTIALS_OF_ONE (sin, pw_cos (x), -f)
PARTIALS_OF_ONE (cos, -pw_sin (x), -f)
PARTIALS_OF_ONE (tan, 1 + f * f, 2 * f * (1 + f * f))
PARTIALS_OF_ONE (asin, 1 / sqrt ((1 - x) * (1 + x)), x / ((1 - x) * (1 + x) * sqrt ((1 - x) * (1 + x))))
PARTIALS_OF_ONE (acos, -1 / sqrt ((1 - x) * (1 + x)), -x / ((1 - x) * (1 + x) * sqrt ((1 - x) * (1 + x))))
PARTIALS_OF_ONE (atan, 1 / (1 + x * x), -2 * x / ((1 + x * x) * (1 + x * x)))
PARTIALS_OF_ONE (sinh, cosh (x), f)
PARTIALS_OF_ONE (cosh, sinh (x), f)
PARTIALS_OF_ONE (tanh, 1 / (cosh (x) * cosh (x)), -2 * f / (cosh (x) * cosh (x)))
PARTIALS_OF_ONE (exp, f, f)
PARTIALS_OF_ONE (log, 1 / x, -1 / (x * x))
PARTIALS_OF_ONE (log10, 1 / (x * log (10)), -1 / (x * x * log (10)))
PARTIALS_OF_ONE (sqrt, 0.5 / f, -0.25 / (f * x))

/* Of atan2 (y, x): member x of the result belongs to the first argument, which is y here. */
static pw_partials partials_atan2 (double y, double x, double f) {
  double r = x * x + y * y;
  (void)f;
  return (pw_partials){ x / r, -y / r, -2 * x * y / (r * r), (y * y - x * x) / (r * r), 2 * x * y / (r * r) };
}

static pw_partials partials_hypot (double x, double y, double f) {
  double c = x / f, s = y / f;
  return (pw_partials){ c, s, s * s / f, -c * s / f, c * c / f };
}

static double value_power (double x, double y) {
  return y == 2 ? x * x : y == 3 ? x * x * x : pow (x, y);
}

/* 0 if a is 0, even if b is infinite. */
static double partials_product (double a, double b) {
  return a == 0 ? 0 : a * b;
}

/* Derivatives with respect to x alone unless the exponent y varies. */
static pw_partials partials_power (double x, double y, double f, int exponent_varies) {
  pw_partials s = { .x = partials_product (y, value_power (x, y - 1)),
                    .xx = partials_product (y * (y - 1), value_power (x, y - 2)) };
  if (!exponent_varies) return s;
  double log_x = log (x);
  s.y = partials_product (f, log_x);
  s.xy = partials_product (s.x, log_x) + pow (x, y - 1);
  s.yy = partials_product (f, log_x * log_x);
  return s;
}

/* The remainder with the sign of the divisor: an angle modulo 2 pi lies from 0 to 2 pi. */
static double value_mod (double x, double y) {
  double r = fmod (x, y);
  return r != 0 && (r < 0) != (y < 0) ? r + y : r;
}

/* Of Jacobi's amplitude, whose parameter m is constant: d am/du = dn. */
static pw_partials partials_jacobi_am (double u, double m, double phi) {
  double s = pw_sin (phi), c = pw_cos (phi);
  (void)u;
  return (pw_partials){ .x = sqrt (1 - m * s * s), .xx = -m * s * c };
}

/* ---- List of functions and constants ---- */

/* The entries are pw_expression_function. */
#define FUNCTION_OF_ONE(name, f, trend, from, to) \
  { #name, PW_OP_FUNCTION_OF_ONE, 1, 1, f, NULL, partials_##name, trend, from, to, 0, 0 }
#define FUNCTION_OF_TWO(name, op, f) \
  { #name, op, 2, 2, NULL, f, partials_##name, PW_NOT_MONOTONIC, 0, 0, 0, 0 }
#define FUNCTION_WITHOUT_PARTIALS(name, op, least, most) \
  { #name, op, least, most, NULL, NULL, NULL, PW_NOT_MONOTONIC, 0, 0, 0, 0 }

const pw_expression_function pw_expression_functions[] = {
  { .name = "pi", .op = PW_OP_CONSTANT, .value = PW_PI },
  { .name = "e", .op = PW_OP_CONSTANT, .value = 2.71828182845904523536 },
  { .name = "deg", .op = PW_OP_CONSTANT, .value = PW_PI / 180 },
  FUNCTION_OF_ONE (sin, pw_sin, PW_NOT_MONOTONIC, -DBL_MAX, DBL_MAX),
  FUNCTION_OF_ONE (cos, pw_cos, PW_NOT_MONOTONIC, -DBL_MAX, DBL_MAX),
  { "tan", PW_OP_TAN, 1, 1, tan, NULL, partials_tan, PW_NOT_MONOTONIC, -DBL_MAX, DBL_MAX, 0, 0 },
  FUNCTION_OF_ONE (asin, asin, PW_INCREASING, -1, 1),
  FUNCTION_OF_ONE (acos, acos, PW_DECREASING, -1, 1),
  FUNCTION_OF_ONE (atan, atan, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (sinh, sinh, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (cosh, cosh, PW_NOT_MONOTONIC, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (tanh, tanh, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (exp, exp, PW_INCREASING, -INFINITY, INFINITY),
  FUNCTION_OF_ONE (log, log, PW_INCREASING, 0, INFINITY),
  FUNCTION_OF_ONE (log10, log10, PW_INCREASING, 0, INFINITY),
  FUNCTION_OF_ONE (sqrt, sqrt, PW_INCREASING, 0, INFINITY),
  FUNCTION_WITHOUT_PARTIALS (abs, PW_OP_ABS, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (floor, PW_OP_FLOOR, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (ceil, PW_OP_CEIL, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (round, PW_OP_ROUND, 1, 1),
  FUNCTION_WITHOUT_PARTIALS (sign, PW_OP_SIGN, 1, 1),
  FUNCTION_OF_TWO (atan2, PW_OP_ATAN2, atan2),
  FUNCTION_OF_TWO (hypot, PW_OP_HYPOT, hypot),
  { "jacobi_am", PW_OP_FUNCTION_OF_TWO, 2, 2, NULL, pw_jacobi_am, partials_jacobi_am, .constant = 2 },
  { "elliptic_K", PW_OP_FUNCTION_OF_ONE, 1, 1, pw_elliptic_K, .constant = 1 },
  FUNCTION_WITHOUT_PARTIALS (mod, PW_OP_MOD, 2, 2),
  FUNCTION_WITHOUT_PARTIALS (min, PW_OP_MIN, 2, 0),
  FUNCTION_WITHOUT_PARTIALS (max, PW_OP_MAX, 2, 0),
  { .name = NULL },
};

int pw_expression_find_function (const char *name) {
  for (int i = 0; pw_expression_functions[i].name; i++)
    if (*pw_expression_functions[i].name == *name && strcmp (pw_expression_functions[i].name, name) == 0) return i;
  return -1;
}

/* ---- Functions of paths ---- */

const char *const pw_path_functions[] = { "s", "x", "y", "heading", "curvature", "offset", NULL };

/* A function of a place: value, first and second derivative by the arc length, which the offset does not have. */
static void path_values (int function, const pw_path_place *p, double out[3]) {
  const double *k = p->curvature, value[][3] = { [PW_PATH_S] = { p->s, 1, 0 },
                                                 [PW_PATH_X] = { p->x, p->cos, -k[0] * p->sin },
                                                 [PW_PATH_Y] = { p->y, p->sin, k[0] * p->cos },
                                                 [PW_PATH_HEADING] = { p->heading, k[0], k[1] },
                                                 [PW_PATH_CURVATURE] = { k[0], k[1], k[2] },
                                                 [PW_PATH_OFFSET] = { p->offset, 0, 0 } };
  memcpy (out, value[function], sizeof value[function]);
}

static void path_at (const pw_expression_code *c, double s, double value[3]) {
  pw_path_place place;
  pw_path_at (c->path, s, &place);
  path_values (c->index, &place, value);
}

static pw_path_place path_nearest (const pw_expression_code *c, double x, double y, double near, double value[3]) {
  pw_path_place place;
  pw_path_nearest (c->path, x, y, near, &place);
  path_values (c->index, &place, value);
  return place;
}

/* Derivatives by (x, y) from those of the offset d and the arc length s: with t the direction, n to its left, k the
 * curvature and h = 1 - k d,
 *
 *   grad d = n,  Hess d = -k/h t t,   grad s = t/h,  Hess s = k/h^2 (n t + t n) + k' d/h^3 t t
 *
 * At a corner k is infinite: grad s = 0, -k/h = 1/d, and heading and offset are polar coordinates. */
static pw_partials path_partials (int function, const pw_path_place *p, const double value[3]) {
  double d = p->offset, k = p->curvature[0], h = 1 - k * d, tt, nt = 0, t = 0, n = 0; /* coefficients of t t, ... */
  if (function == PW_PATH_OFFSET)
    n = 1, tt = p->corner ? 1 / d : -k / h;
  else if (p->corner)
    t = function == PW_PATH_HEADING ? -1 / d : 0, nt = function == PW_PATH_HEADING ? 1 / (d * d) : 0, tt = 0;
  else
    t = value[1] / h, nt = value[1] * k / (h * h),
    tt = value[1] * p->curvature[1] * d / (h * h * h) + value[2] / (h * h);
  double C = p->cos, S = p->sin;
  return (pw_partials){ t * C - n * S, t * S + n * C, tt * C * C - 2 * nt * S * C, tt * S * C + nt * (C * C - S * S),
                        tt * S * S + 2 * nt * S * C };
}

/* ---- Values ---- */

static inline pw_order value_order (double a, double b) {
  return a < b ? PW_ORDER_LESS : a > b ? PW_ORDER_GREATER : a == b ? PW_ORDER_EQUAL : PW_ORDER_UNORDERED;
}

/* sign, floor, ceil, round */
static inline double value_step (int op, double x, int *may_jump) {
  double y = op == PW_OP_SIGN    ? (x > 0) - (x < 0)
             : op == PW_OP_FLOOR ? floor (x)
             : op == PW_OP_CEIL  ? ceil (x)
                                 : round (x);
  if (op == PW_OP_ROUND ? fabs (x - trunc (x)) == 0.5 : op == PW_OP_SIGN ? x == 0 : x == y) *may_jump = 1;
  return y;
}

/* The value of an operation of `right` alone or of `left` and `right`; *may_jump: 1 where it may jump. */
static inline double value_of (const pw_expression_code *c, double left, double right, int *may_jump) {
  double path[3];
  switch (c->op) {
  case PW_OP_NEGATE:
    return -right;
  case PW_OP_ABS:
    return fabs (right);
  case PW_OP_TAN:
  case PW_OP_FUNCTION_OF_ONE:
    return pw_expression_functions[c->index].of_one (right);
  case PW_OP_PATH_AT:
    if (pw_path_break (c->path, nextafter (right, -INFINITY)) == right) *may_jump = 1;
    path_at (c, right, path);
    return *path;
  case PW_OP_ADD:
    return left + right;
  case PW_OP_SUBTRACT:
    return left - right;
  case PW_OP_MULTIPLY:
    return left * right;
  case PW_OP_DIVIDE:
    if (right == 0) *may_jump = 1;
    return left / right;
  case PW_OP_POWER:
    if (left == 0 && right < 0) *may_jump = 1;
    return value_power (left, right);
  case PW_OP_MIN:
    return fmin (left, right);
  case PW_OP_MAX:
    return fmax (left, right);
  case PW_OP_MOD:
    left = value_mod (left, right);
    if (left == 0) *may_jump = 1;
    return left;
  case PW_OP_ATAN2:
    if (left == 0 && right <= 0) *may_jump = 1;
    return atan2 (left, right);
  case PW_OP_HYPOT:
  case PW_OP_FUNCTION_OF_TWO:
    return pw_expression_functions[c->index].of_two (left, right);
  }
  if (pw_expression_operands (c->op) == 1) return value_step (c->op, right, may_jump);
  pw_order order = value_order (left, right); /* the rest are comparisons */
  if (order == PW_ORDER_EQUAL) *may_jump = 1;
  return pw_expression_compare (c->op, order);
}

double pw_expression_apply (const pw_expression_code *c, double left, double right) {
  return value_of (c, left, right, &(int){ 0 });
}

/* `last` is the top of the stack; the values below it are in stack[1], stack[2], ...; stack[0] is unused. */
double pw_expression_run (const pw_expression_code *code, int codes, const double *variable, int *may_jump) {
  double stack[PW_EXPRESSION_STACK + 1], *top = stack, last = 0;
  for (const pw_expression_code *c = code, *end = code + codes; c < end; c++)
    if (c->op <= PW_OP_VARIABLE) {
      *top++ = last;
      last = c->op == PW_OP_CONSTANT ? c->value : variable[c->index];
    } else if (c->op >= PW_OP_SELECT) {
      double value[3] = { top[-2] != 0 ? top[-1] : last };
      top -= 2;
      if (c->op == PW_OP_PATH_NEAREST) path_nearest (c, top[0], top[1], last, value);
      last = *value;
    } else {
      double left = c->op >= PW_OP_ADD ? *--top : 0;
      last = value_of (c, left, last, may_jump);
    }
  return last;
}

/* ---- Sides of conditions on states ----
 *
 * A condition is an operation with jumps or kinks whose operands depend on states: a comparison, abs, sign, floor,
 * ceil, round, min, max or mod.  With its side fixed (the truth of the comparison, the sign of the operand of abs, the
 * value of floor, the smaller operand, the quotient), the expression is smooth and has a value on both sides. */

static double side_natural (const pw_expression_code *c, double a, double b) {
  if (c->op == PW_OP_ABS) return a < 0 ? -1 : 1;
  if (c->op == PW_OP_MIN) return isnan (a) || b < a;
  if (c->op == PW_OP_MAX) return isnan (a) || b > a;
  if (c->op == PW_OP_MOD) return rint ((a - value_mod (a, b)) / b);
  return pw_expression_apply (c, a, b);
}

static double side_value (int op, double side, double a, double b) {
  if (op == PW_OP_ABS) return side * a;
  if (op == PW_OP_MIN || op == PW_OP_MAX) return side != 0 ? b : a;
  return op == PW_OP_MOD ? a - side * b : side;
}

/* How far the operands are beyond the side, up to round-off; negative: they are on it. */
static double side_beyond (int op, double side, double a, double b) {
  switch (op) {
  case PW_OP_ABS:
    return -side * a;
  case PW_OP_SIGN:
    return side == 0 ? fabs (a) : -side * a;
  case PW_OP_FLOOR:
    return fmax (side - a, a - side - 1);
  case PW_OP_CEIL:
    return fmax (side - 1 - a, a - side);
  case PW_OP_ROUND:
    return fabs (a - side) - 0.5;
  case PW_OP_EQUAL:
  case PW_OP_UNEQUAL: /* that numbers become equal is no event: they differ at once */
    return side == (op == PW_OP_EQUAL) ? fabs (a - b) : -INFINITY;
  case PW_OP_MOD:
    return fmax (side - a / b, a / b - side - 1) * fabs (b);
  case PW_OP_MAX:
  case PW_OP_LESS:
  case PW_OP_LESS_EQUAL:
    return side != 0 ? a - b : b - a;
  default: /* min, > and >= */
    return side != 0 ? b - a : a - b;
  }
}

/* A value on the stack. */
typedef struct {
  double value, size;   /* size: of numbers of which it is the sum, for round-off */
  int of_states;        /* 1: it depends on states, or on time where that counts */
  int first, condition; /* its first operation among those with fixed sides; its first condition */
} side_number;

/* Replaces operations with a fixed side by others: those of operands a and b begin at `second`. */
static int side_fix_code (pw_expression_code *code, int n, int op, double side, int first, int second) {
  const pw_expression_code constant = { PW_OP_CONSTANT, 0, { side } };
  if (op == PW_OP_ABS) {
    if (side < 0) code[n++] = (pw_expression_code){ .op = PW_OP_NEGATE };
    return n;
  }
  if (op == PW_OP_MOD) { /* a - side b */
    code[n++] = constant;
    code[n++] = (pw_expression_code){ .op = PW_OP_MULTIPLY };
    code[n++] = (pw_expression_code){ .op = PW_OP_SUBTRACT };
    return n;
  }
  if (op != PW_OP_MIN && op != PW_OP_MAX) return code[first] = constant, first + 1;
  if (side == 0) return second;
  memmove (code + first, code + second, (size_t)(n - second) * sizeof *code);
  return first + n - second;
}

int pw_expression_sides (const pw_expression *x, int of_time, const double *variable, double *side, double *beyond,
                         pw_expression *fixed) {
  side_number stack[PW_EXPRESSION_STACK], *top = stack;
  int conditions = 0, n = 0;
  pw_expression_code *code = fixed ? fixed->code : NULL;
  for (const pw_expression_code *c = x->code, *end = c + x->codes; c < end; c++) {
    const int operands = pw_expression_operands (c->op),
              conditional = (c->op >= PW_OP_ABS && c->op <= PW_OP_ROUND) || (c->op >= PW_OP_LESS && c->op <= PW_OP_MAX);
    side_number *a = top -= operands, *b = a + (operands > 1), result = { .first = n, .condition = conditions };
    if (operands) result = *a;
    for (int i = 1; i < operands; i++) result.of_states |= a[i].of_states, result.size += a[i].size;
    if (operands == 0) {
      result.value = c->op == PW_OP_CONSTANT ? c->value : variable[c->index];
      result.size = fabs (result.value);
      result.of_states = c->op == PW_OP_VARIABLE && (of_time || c->index != PW_EXPRESSION_TIME);
      if (code) code[n++] = *c;
    } else if (conditional && result.of_states) {
      double *s = &side[conditions];
      if (beyond == NULL) *s = side_natural (c, a->value, b->value);
      if (beyond) beyond[conditions] = side_beyond (c->op, *s, a->value, b->value) - SIDE_ROUND_OFF * result.size;
      result.value = side_value (c->op, *s, a->value, b->value);
      if (c->op != PW_OP_ABS && c->op != PW_OP_MOD && c->op != PW_OP_MIN && c->op != PW_OP_MAX) result.size = fabs (*s);
      if (code) n = side_fix_code (code, n, c->op, *s, a->first, b->first);
      conditions++;
    } else if (c->op == PW_OP_SELECT) {
      const int which = a->value != 0 ? 1 : 2, other_end = which == 1 ? conditions : a[2].condition;
      for (int i = a[3 - which].condition; beyond && i < other_end; i++) beyond[i] = -INFINITY; /* does not matter */
      result.value = a[which].value, result.size = a[which].size;
      const int chosen = a[which].first, chosen_end = which == 1 ? a[2].first : n;
      if (code && a[1].first == a->first + 1 && code[a->first].op == PW_OP_CONSTANT) {
        memmove (code + a->first, code + chosen, (size_t)(chosen_end - chosen) * sizeof *code);
        n = a->first + chosen_end - chosen;
      } else if (code)
        code[n++] = *c;
    } else {
      double value[3] = { 0 };
      if (c->op == PW_OP_PATH_NEAREST)
        path_nearest (c, a[0].value, a[1].value, a[2].value, value);
      else
        *value = pw_expression_apply (c, a->value, b->value);
      result.value = *value;
      if (c->op == PW_OP_MULTIPLY) result.size = a->size * b->size;
      if (c->op == PW_OP_DIVIDE)
        result.size = a->size / fabs (b->value);
      else if (c->op != PW_OP_MULTIPLY && c->op != PW_OP_ADD && c->op != PW_OP_SUBTRACT && c->op != PW_OP_NEGATE)
        result.size = fabs (result.value);
      if (code) code[n++] = *c;
    }
    *top++ = result;
  }
  if (fixed) fixed->codes = n;
  return conditions;
}

/* ---- Derivatives of expressions ---- */

typedef struct {
  double v, d, dd; /* value, first and second derivative with respect to the variable */
  int varies;      /* 1: depends on the variable; 0: constant, or constant but for jumps, as floor (t) */
} jet;

/* The chain rule; f: the value.  Constant operands contribute 0, even where a partial derivative is infinite. */
static jet jet_chain (double f, const pw_partials *s, const jet *x, const jet *y) {
  jet r = { f, 0, 0, x->varies | y->varies };
  if (x->varies) r.d += s->x * x->d, r.dd += s->xx * x->d * x->d + s->x * x->dd;
  if (y->varies) r.d += s->y * y->d, r.dd += s->yy * y->d * y->d + s->y * y->dd;
  if (x->varies && y->varies) r.dd += 2 * s->xy * x->d * y->d;
  return r;
}

/* The sign just after: that of the first number that is not 0. */
static inline int jet_sign (const jet *x) {
  double first = x->v != 0 ? x->v : x->d != 0 ? x->d : x->dd;
  return (first > 0) - (first < 0);
}

/* The order of two numbers just after. */
static pw_order jet_order (const jet *x, const jet *y) {
  if (x->v != y->v) return value_order (x->v, y->v);
  return (pw_order)jet_sign (&(jet){ 0, x->d - y->d, x->dd - y->dd, 1 });
}

/* floor, ceil, round of x just after; `direction`: sign of the change of x. */
static double jet_step (int op, double x, int direction) {
  int may_jump = 0;
  double y = value_step (op, x, &may_jump);
  if (!may_jump || direction == 0) return y;
  return op == PW_OP_FLOOR ? y - (direction < 0) : (op == PW_OP_CEIL ? y : floor (x)) + (direction > 0);
}

/* abs, sign, floor, ceil, round. */
static jet jet_piecewise (int op, const jet *x, double *discrete) {
  int sign = jet_sign (x);
  *discrete = op == PW_OP_ABS || op == PW_OP_SIGN ? sign : jet_step (op, x->v, jet_sign (&(jet){ 0, x->d, x->dd, 1 }));
  return op == PW_OP_ABS ? (jet){ fabs (x->v), sign * x->d, sign * x->dd, x->varies } : (jet){ .v = *discrete };
}

/* x + factor y */
static jet jet_plus (const jet *x, double factor, const jet *y) {
  return (jet){ x->v + factor * y->v, x->d + factor * y->d, x->dd + factor * y->dd, x->varies | y->varies };
}

/* x - q y with an integer q, which is computed from the remainder so that both jump together. */
static jet jet_mod (const jet *x, const jet *y, double *q) {
  double r = value_mod (x->v, y->v);
  *q = rint ((x->v - r) / y->v);
  jet m = jet_plus (x, -*q, y);
  m.v = r;
  if (r != 0 || jet_sign (&m) * y->v >= 0) return m;
  m = jet_plus (&m, 1, y);
  *q -= 1;
  return m;
}

/* Just before a break of the path if the arc length falls. */
static jet jet_path_at (const pw_expression_code *c, const jet *s, double *discrete) {
  double value[3], at = s->v;
  if (jet_sign (&(jet){ 0, s->d, s->dd, 1 }) < 0) {
    double before = nextafter (at, -INFINITY);
    if (pw_path_break (c->path, before) == at) at = before;
  }
  path_at (c, at, value);
  *discrete = pw_path_break (c->path, at);
  return jet_chain (*value, &(pw_partials){ .x = value[1], .xx = value[2] }, s, &(jet){ 0 });
}

/* On `near` a minimum does not depend. */
static jet jet_path_nearest (const pw_expression_code *c, const jet *x, const jet *y, const jet *near) {
  double value[3];
  const pw_path_place place = path_nearest (c, x->v, y->v, near->v, value);
  pw_partials s = path_partials (c->index, &place, value);
  return jet_chain (*value, &s, x, y);
}

static jet jet_unary (const pw_expression_code *c, const jet *x, double *discrete) {
  if (c->op == PW_OP_NEGATE) return (jet){ -x->v, -x->d, -x->dd, x->varies };
  if (c->op == PW_OP_FUNCTION_OF_ONE || c->op == PW_OP_TAN) {
    if (c->op == PW_OP_TAN) *discrete = floor (x->v / PW_PI + 0.5);
    const pw_expression_function *f = &pw_expression_functions[c->index];
    double value = f->of_one (x->v);
    pw_partials s = f->partials (x->v, 0, value);
    return jet_chain (value, &s, x, &(jet){ 0 });
  }
  return c->op == PW_OP_PATH_AT ? jet_path_at (c, x, discrete) : jet_piecewise (c->op, x, discrete);
}

static jet jet_product (const jet *x, const jet *y) {
  return (jet){ x->v * y->v, y->v * x->d + x->v * y->d, y->v * x->dd + 2 * x->d * y->d + x->v * y->dd,
                x->varies | y->varies };
}

static jet jet_quotient (const jet *x, const jet *y) {
  double f = x->v / y->v, d = (x->d - f * y->d) / y->v;
  return (jet){ f, d, (x->dd - 2 * d * y->d - f * y->dd) / y->v, x->varies | y->varies };
}

/* A power or a function of two arguments. */
static jet jet_function (const pw_expression_code *c, const jet *x, const jet *y) {
  const pw_expression_function *f = &pw_expression_functions[c->index];
  int is_power = c->op == PW_OP_POWER;
  double value = is_power ? value_power (x->v, y->v) : f->of_two (x->v, y->v);
  pw_partials s = is_power ? partials_power (x->v, y->v, value, y->varies) : f->partials (x->v, y->v, value);
  return jet_chain (value, &s, x, y);
}

/* Jumps where y, the first argument, changes sign while x <= 0, and where x changes sign while y is 0.  At the origin
 * p = (x, y) = 0 the angle just after is that of p' or, if this is 0, of p''; its derivatives are unknown: NaN. */
static jet jet_atan2 (const pw_expression_code *c, const jet *y, const jet *x, double *discrete) {
  jet r = jet_function (c, y, x);
  int sign = jet_sign (y);
  *discrete = x->v <= 0 && sign <= 0 ? sign - 1 : 0; /* 0: x > 0 or y > 0, without a jump between them */
  double b = y->v, a = x->v;
  if (b == 0 && a == 0) b = y->d, a = x->d;
  if (b == 0 && a == 0) b = y->dd, a = x->dd;
  if (y->v == 0 && x->v <= 0) r.v = atan2 (sign ? copysign (b, sign) : b, a);
  return r;
}

/* Has a kink at the origin, p = (x, y) = 0.  At a distance h after it the value is |p' h + p'' h^2 / 2|, that is
 * |p'| h + p' p'' / |p'| h^2 / 2, or |p''| h^2 / 2 if p' is 0.  The pair of signs differs on its two sides. */
static jet jet_hypot (const pw_expression_code *c, const jet *x, const jet *y, double *discrete) {
  *discrete = jet_sign (x) + 3 * jet_sign (y);
  if (x->v != 0 || y->v != 0) return jet_function (c, x, y);
  double d = hypot (x->d, y->d);
  return (jet){ 0, d, d > 0 ? (x->d * x->dd + y->d * y->dd) / d : hypot (x->dd, y->dd), 1 };
}

static jet jet_binary (const pw_expression_code *c, const jet *x, const jet *y, double *discrete) {
  /* At a pole, the denominator or base 0 has the sign of its value just after. */
  jet after = c->op == PW_OP_DIVIDE ? *y : *x;
  if (after.v == 0) after.v = copysign (0, jet_sign (&after));
  switch (c->op) {
  case PW_OP_ADD:
    return jet_plus (x, 1, y);
  case PW_OP_SUBTRACT:
    return jet_plus (x, -1, y);
  case PW_OP_MULTIPLY:
    return jet_product (x, y);
  case PW_OP_DIVIDE:
    *discrete = jet_sign (y);
    return jet_quotient (x, &after);
  case PW_OP_POWER:
    *discrete = y->v < 0 && fabs (fmod (y->v, 2)) == 1 ? jet_sign (x) : 0;
    return jet_function (c, &after, y);
  case PW_OP_FUNCTION_OF_TWO:
    return jet_function (c, x, y);
  case PW_OP_ATAN2:
    return jet_atan2 (c, x, y, discrete);
  case PW_OP_HYPOT:
    return jet_hypot (c, x, y, discrete);
  case PW_OP_MOD:
    return jet_mod (x, y, discrete);
  }
  pw_order order = jet_order (x, y);
  *discrete = order;
  if (c->op == PW_OP_MIN || c->op == PW_OP_MAX) {
    pw_order order_of_first = c->op == PW_OP_MIN ? PW_ORDER_LESS : PW_ORDER_GREATER;
    int first = order == PW_ORDER_UNORDERED ? !isnan (x->v) : order == order_of_first;
    return first ? *x : *y;
  }
  *discrete = pw_expression_compare (c->op, order);
  return (jet){ .v = *discrete };
}

void pw_expression_run_jet (const pw_expression *expression, const double *variable, int by, double u[3],
                            double *discrete) {
  jet stack[PW_EXPRESSION_STACK], *top = stack;
  for (const pw_expression_code *c = expression->code, *end = c + expression->codes; c < end; c++) {
    int operands = pw_expression_operands (c->op);
    double side = 0; /* see `discrete` in expression.h */
    top -= operands;
    if (operands == 0)
      *top = c->op == PW_OP_CONSTANT ? (jet){ .v = c->value }
                                     : (jet){ variable[c->index], c->index == by, 0, c->index == by };
    else if (operands == 3)
      *top = c->op == PW_OP_PATH_NEAREST ? jet_path_nearest (c, top, top + 1, top + 2)
             : top[0].v != 0             ? top[1]
                                         : top[2];
    else if (!top[0].varies && !top[operands - 1].varies)
      *top = (jet){ .v = pw_expression_apply (c, top[0].v, top[operands - 1].v) };
    else
      *top = operands == 1 ? jet_unary (c, top, &side) : jet_binary (c, top, top + 1, &side);
    if (discrete) discrete[c - expression->code] = side;
    top++;
  }
  u[0] = top[-1].v, u[1] = top[-1].d, u[2] = top[-1].dd;
}

void pw_expression_derivatives (const pw_expression *expression, const double *variable, int by, double u[3]) {
  pw_expression_run_jet (expression, variable, by, u, NULL);
}

double pw_expression_value (const pw_expression *expression, const double *variable) {
  int may_jump = 0;
  double u[3], value = pw_expression_run (expression->code, expression->codes, variable, &may_jump);
  if (!may_jump || !expression->breaks) return value;
  pw_expression_derivatives (expression, variable, PW_EXPRESSION_TIME, u);
  return u[0];
}
