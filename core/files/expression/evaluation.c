/* Values and exact derivatives of expressions.
 *
 * For derivatives, each operation propagates (value, first, second derivative) by the chain rule,
 *
 *   f' = f_x x' + f_y y',   f'' = f_xx x'^2 + 2 f_xy x' y' + f_yy y'^2 + f_x x'' + f_y y''
 *
 * where f_x is the partial derivative with respect to operand x, and the prime the derivative with respect to the
 * chosen variable (Griewank & Walther 2008, Evaluating Derivatives, chapter 13).  The derivatives decide comparisons
 * of equal numbers, so that an expression has the value just after a jump, that is for a slightly larger variable. */
#include <math.h>
#include "expression_parts.h"
#include "pinwheel.h"

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

/* See pw_expression_apply; sets *may_jump to 1 where the operation may jump. */
static inline double value_of (const pw_expression_code *c, double left, double right, int *may_jump) {
  switch (c->op) {
  case PW_OP_NEGATE:
    return -right;
  case PW_OP_ABS:
    return fabs (right);
  case PW_OP_TAN:
  case PW_OP_FUNCTION_OF_ONE:
    return pw_expression_functions[c->index].of_one (right);
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
    return pw_expression_power (left, right);
  case PW_OP_MIN:
    return fmin (left, right);
  case PW_OP_MAX:
    return fmax (left, right);
  case PW_OP_MOD:
    left = pw_expression_mod (left, right);
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
    } else if (c->op == PW_OP_SELECT) {
      top -= 2;
      last = top[0] != 0 ? top[1] : last;
    } else {
      double left = c->op >= PW_OP_ADD ? *--top : 0;
      last = value_of (c, left, last, may_jump);
    }
  return last;
}

/* ---- Derivatives ---- */

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

/* ---- Derivatives of operations with jumps or kinks ---- */

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
  double r = pw_expression_mod (x->v, y->v);
  *q = rint ((x->v - r) / y->v);
  jet m = jet_plus (x, -*q, y);
  m.v = r;
  if (r != 0 || jet_sign (&m) * y->v >= 0) return m;
  m = jet_plus (&m, 1, y);
  *q -= 1;
  return m;
}

/* ---- Operations ---- */

static jet jet_unary (const pw_expression_code *c, const jet *x, double *discrete) {
  if (c->op == PW_OP_NEGATE) return (jet){ -x->v, -x->d, -x->dd, x->varies };
  if (c->op == PW_OP_FUNCTION_OF_ONE || c->op == PW_OP_TAN) {
    if (c->op == PW_OP_TAN) *discrete = floor (x->v / PW_PI + 0.5);
    const pw_expression_function *f = &pw_expression_functions[c->index];
    double value = f->of_one (x->v);
    pw_partials s = f->partials (x->v, 0, value);
    return jet_chain (value, &s, x, &(jet){ 0 });
  }
  return jet_piecewise (c->op, x, discrete);
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
  int power = c->op == PW_OP_POWER;
  double value = power ? pw_expression_power (x->v, y->v) : f->of_two (x->v, y->v);
  pw_partials s = power ? pw_expression_power_partials (x->v, y->v, value, y->varies) : f->partials (x->v, y->v, value);
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
    double side = 0; /* see `discrete` in expression_parts.h */
    top -= operands;
    if (operands == 0)
      *top = c->op == PW_OP_CONSTANT ? (jet){ .v = c->value }
                                     : (jet){ variable[c->index], c->index == by, 0, c->index == by };
    else if (operands == 3)
      *top = top[0].v != 0 ? top[1] : top[2];
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
