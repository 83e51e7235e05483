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

static inline double value_one (const pw_expression_code *c, double x, int *tie) {
  switch (c->op) {
  case PW_OP_NEGATE:
    return -x;
  case PW_OP_ABS:
    return fabs (x);
  case PW_OP_ONE:
    return pw_expression_functions[c->which].one (x);
  default:
    return value_jump (c->op, x, tie);
  }
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

static inline double value_two (const pw_expression_code *c, double a, double b, int *tie) {
  switch (c->op) {
  case PW_OP_ADD:
    return a + b;
  case PW_OP_SUBTRACT:
    return a - b;
  case PW_OP_MULTIPLY:
    return a * b;
  case PW_OP_DIVIDE:
    return a / b;
  case PW_OP_POWER:
    return pw_expression_power (a, b);
  case PW_OP_AND:
    return a != 0 && b != 0;
  case PW_OP_OR:
    return a != 0 || b != 0;
  case PW_OP_MIN:
    return fmin (a, b);
  case PW_OP_MAX:
    return fmax (a, b);
  case PW_OP_MOD:
    return value_mod (a, b, tie);
  case PW_OP_ATAN2:
    return value_atan2 (a, b, tie);
  case PW_OP_TWO:
    return pw_expression_functions[c->which].two (a, b);
  default:
    return pw_expression_truth (c->op, value_order (a, b, tie));
  }
}

double pw_expression_run (const pw_expression_code *code, int codes, const double *variable, int *tie) {
  double stack[PW_EXPRESSION_STACK], *top = stack;
  for (const pw_expression_code *c = code, *end = code + codes; c < end; c++) {
    int operands = pw_expression_operands (c->op);
    top -= operands;
    *top = operands == 2             ? value_two (c, top[0], top[1], tie)
           : operands == 1           ? value_one (c, top[0], tie)
           : operands == 3           ? top[0] != 0 ? top[1] : top[2]
                     : c->op == PW_OP_VARIABLE ? variable[c->which]
                                     : c->value;
    top++;
  }
  return top[-1];
}

double pw_expression_value (const pw_expression *x, const double *variable) {
  int tie = 0;
  double u[3], value = pw_expression_run (x->code, x->codes, variable, &tie);
  if (!tie || !x->breaks) return value;
  pw_expression_run_jet (x->code, x->codes, variable, 0, u, NULL);
  return u[0];
}
