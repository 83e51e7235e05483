/* The values of expressions. */
#include <math.h>
#include "expression_parts.h"

static inline int value_order (double a, double b, int *tie) {
  if (a == b) *tie = 1;
  return a < b ? -1 : a > b ? 1 : a == b ? 0 : 2;
}

static inline double value_jump (int op, double x, int *tie) {
  double y = op == PW_OP_SIGN    ? (x > 0) - (x < 0)
             : op == PW_OP_FLOOR ? floor (x)
             : op == PW_OP_CEIL  ? ceil (x)
                                 : round (x);
  if (op == PW_OP_ROUND ? fabs (x - trunc (x)) == 0.5 : op == PW_OP_SIGN ? x == 0 : x == y) *tie = 1;
  return y;
}

static double value_mod (double a, double b, int *tie) {
  double r = pw_expression_mod (a, b);
  if (r == 0) *tie = 1;
  return r;
}

static double value_atan2 (double y, double x, int *tie) {
  if (y == 0 && x < 0) *tie = 1;
  return atan2 (y, x);
}

/* Of two numbers, the second being x; of one, x. */
static inline double value_of (const pw_expression_code *c, double a, double x, int *tie) {
  switch (c->op) {
  case PW_OP_NEGATE:
    return -x;
  case PW_OP_ABS:
    return fabs (x);
  case PW_OP_ONE:
    return pw_expression_functions[c->which].one (x);
  case PW_OP_ADD:
    return a + x;
  case PW_OP_SUBTRACT:
    return a - x;
  case PW_OP_MULTIPLY:
    return a * x;
  case PW_OP_DIVIDE:
    return a / x;
  case PW_OP_POWER:
    return pw_expression_power (a, x);
  case PW_OP_AND:
    return a != 0 && x != 0;
  case PW_OP_OR:
    return a != 0 || x != 0;
  case PW_OP_MIN:
    return fmin (a, x);
  case PW_OP_MAX:
    return fmax (a, x);
  case PW_OP_MOD:
    return value_mod (a, x, tie);
  case PW_OP_ATAN2:
    return value_atan2 (a, x, tie);
  case PW_OP_TWO:
    return pw_expression_functions[c->which].two (a, x);
  }
  if (pw_expression_operands (c->op) == 1) return value_jump (c->op, x, tie);
  return pw_expression_truth (c->op, value_order (a, x, tie));
}

double pw_expression_apply (const pw_expression_code *c, double a, double x) {
  int tie;
  return value_of (c, a, x, &tie);
}

/* x is the top of the stack. */
double pw_expression_run (const pw_expression_code *code, int codes, const double *variable, int *tie) {
  double stack[PW_EXPRESSION_STACK + 1], *top = stack, x = 0;
  for (const pw_expression_code *c = code, *end = code + codes; c < end; c++)
    if (c->op <= PW_OP_VARIABLE) {
      *top++ = x;
      x = c->op == PW_OP_CONSTANT ? c->value : variable[c->which];
    } else if (c->op == PW_OP_SELECT) {
      top -= 2;
      x = top[0] != 0 ? top[1] : x;
    } else {
      double a = c->op >= PW_OP_ADD ? *--top : 0;
      x = value_of (c, a, x, tie);
    }
  return x;
}

double pw_expression_value (const pw_expression *x, const double *variable) {
  int tie = 0;
  double u[3], value = pw_expression_run (x->code, x->codes, variable, &tie);
  if (!tie || !x->breaks) return value;
  pw_expression_run_jet (x->code, x->codes, variable, 0, u, NULL);
  return u[0];
}
