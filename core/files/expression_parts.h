/* The operations and functions of expressions: interface between the files of this folder. */
#ifndef PW_EXPRESSION_PARTS_H
#define PW_EXPRESSION_PARTS_H

#include "expression.h"

/* Limits: depth of the stack, variables, operations. */
enum { PW_EXPRESSION_STACK = 1000, PW_EXPRESSION_VARIABLES = 32, PW_EXPRESSION_CODES = 8000 };

/* Operations, ordered by their number of operands: 0, 1, 2, 3.  The functions below depend on the order, too. */
typedef enum {
  PW_OP_CONSTANT,
  PW_OP_VARIABLE,
  PW_OP_NEGATE,
  PW_OP_ABS,
  PW_OP_SIGN,
  PW_OP_FLOOR,
  PW_OP_CEIL,
  PW_OP_ROUND,
  PW_OP_TAN,
  PW_OP_FUNCTION_OF_ONE, /* a smooth function of one argument */
  PW_OP_PATH_AT,         /* a function of the point of a path at an arc length */
  PW_OP_ADD,
  PW_OP_SUBTRACT,
  PW_OP_MULTIPLY,
  PW_OP_DIVIDE,
  PW_OP_POWER,
  PW_OP_LESS,
  PW_OP_LESS_EQUAL,
  PW_OP_GREATER,
  PW_OP_GREATER_EQUAL,
  PW_OP_EQUAL,
  PW_OP_UNEQUAL,
  PW_OP_MOD,
  PW_OP_MIN,
  PW_OP_MAX,
  PW_OP_ATAN2,
  PW_OP_HYPOT,
  PW_OP_FUNCTION_OF_TWO, /* a smooth function of two arguments */
  PW_OP_SELECT,          /* condition ? x : y; the condition is 1 or 0.  a && b is a ? b : 0, a || b is a ? 1 : b */
  PW_OP_PATH_NEAREST     /* a function of the point of a path nearest to a point; the third operand: pw_path_nearest */
} pw_expression_op;

static inline int pw_expression_operands (int op) {
  return op >= PW_OP_SELECT ? 3 : op >= PW_OP_ADD ? 2 : op >= PW_OP_NEGATE ? 1 : 0;
}

/* Whether an operation has jumps between finite values. */
static inline int pw_expression_jumps (int op) {
  return (op >= PW_OP_SIGN && op <= PW_OP_ROUND) || (op >= PW_OP_LESS && op <= PW_OP_UNEQUAL) || op == PW_OP_MOD ||
         op == PW_OP_ATAN2 || op == PW_OP_PATH_AT;
}

static inline int pw_expression_has_path (int op) {
  return op == PW_OP_PATH_AT || op == PW_OP_PATH_NEAREST;
}

/* Whether an operation has jumps, poles or kinks. */
static inline int pw_expression_breaks (int op) {
  return pw_expression_jumps (op) || op == PW_OP_ABS || op == PW_OP_MIN || op == PW_OP_MAX || op == PW_OP_TAN ||
         op == PW_OP_DIVIDE || op == PW_OP_POWER || op == PW_OP_HYPOT;
}

/* The order of two numbers; UNORDERED: one of them is NaN. */
typedef enum { PW_ORDER_LESS = -1, PW_ORDER_EQUAL, PW_ORDER_GREATER, PW_ORDER_UNORDERED } pw_order;

/* The value of a comparison, 1 or 0, of two numbers in this order. */
static inline int pw_expression_compare (int op, pw_order order) {
  int equal = order == PW_ORDER_EQUAL && (op == PW_OP_LESS_EQUAL || op == PW_OP_GREATER_EQUAL || op == PW_OP_EQUAL);
  int less = order == PW_ORDER_LESS && (op == PW_OP_LESS || op == PW_OP_LESS_EQUAL);
  int greater = order == PW_ORDER_GREATER && (op == PW_OP_GREATER || op == PW_OP_GREATER_EQUAL);
  return equal || less || greater || (order != PW_ORDER_EQUAL && op == PW_OP_UNEQUAL);
}

/* ---- Functions (evaluation.c) ---- */

/* First and second partial derivatives of a function f (x, y), or of f (x). */
typedef struct {
  double x, y, xx, xy, yy;
} pw_partials;

/* Monotonicity of a function of one argument, for interval arithmetic. */
typedef enum { PW_INCREASING, PW_DECREASING, PW_NOT_MONOTONIC } pw_trend;

/* A function or constant. */
typedef struct {
  const char *name;
  short op; /* PW_OP_FUNCTION_OF_ONE, PW_OP_FUNCTION_OF_TWO, or an operation of its own; PW_OP_CONSTANT of a constant */
  short least, most; /* arguments; most = 0: any number */
  double (*of_one) (double);
  double (*of_two) (double, double);
  pw_partials (*partials) (double x, double y, double f); /* f: the value at (x, y) */
  pw_trend trend;
  double from, to; /* domain of a function of one argument, NaN outside */
  double value;    /* of a constant, without arguments */
  int constant;    /* the argument that must be a constant, from 1; 0: none */
} pw_expression_function;

extern const pw_expression_function pw_expression_functions[]; /* and constants; ends with a NULL name */

/* A function of a point of a path: pw_expression_code.index. */
typedef enum { PW_PATH_S, PW_PATH_X, PW_PATH_Y, PW_PATH_HEADING, PW_PATH_CURVATURE, PW_PATH_OFFSET } pw_path_function;
extern const char *const pw_path_functions[]; /* their names, in this order; ends with NULL */

/* The index of a function or constant, or -1. */
int pw_expression_find_function (const char *name);

/* ---- Evaluation ---- */

/* The value of operations; *may_jump becomes 1 if one of them may jump there, as at equal numbers or poles. */
double pw_expression_run (const pw_expression_code *code, int codes, const double *variable, int *may_jump);
/* The value of an operation of `right` alone or of `left` and `right`, other than functions of the nearest point. */
double pw_expression_apply (const pw_expression_code *c, double left, double right);
/* As pw_expression_derivatives.  discrete, unless NULL, receives for each operation a number that differs on the two
 * sides of each of its breakpoints: the value of floor, the sign of the operand of abs. */
void pw_expression_run_jet (const pw_expression *expression, const double *variable, int by, double u[3],
                            double *discrete);

/* ---- Enclosures (range.c) ---- */

/* Enclosure of a value over an interval of time. */
typedef struct {
  double lo, hi; /* of the numbers among the values; lo > hi: all are NaN */
  int breaks;    /* 1: may break, that is jump or have a kink, at a time independent of states */
  int of_states; /* 1: depends on states, and so may the times of its breaks */
  int nan;       /* 1: the value may be NaN */
} pw_range;

/* The range over a time interval, without breaks of operations that are marked in `noisy`, one mark per operation. */
pw_range pw_expression_range (const pw_expression *expression, const unsigned char *noisy, double lo, double hi);
/* Whether the last of these operations, a part of an expression, may jump at some time in some state: atan2 (x, 1) and
 * sign (x^2 + 1) do not. */
pw_jumps pw_expression_may_jump (const pw_expression_code *code, int codes);

#endif
