/* Expressions: arithmetic on numbers, named numbers and variables.
 *
 *   operators   + - * / ^, < <= > >= == !=, && ||, CONDITION ? THEN : ELSE, parentheses
 *   functions   sin cos tan asin acos atan atan2 sinh cosh tanh exp log log10 sqrt abs sign floor ceil round hypot mod
 *               min max jacobi_am (u, m), elliptic_K (m)
 *   constants   pi, e, deg = pi / 180
 *   paths       PATH.x (s), .y, .heading, .curvature: at an arc length; PATH.offset (x, y), .s, .x, .y, .heading,
 *               .curvature: at the place nearest to a point, of all or, PATH.s (x, y, near), next to an arc length
 *
 * A scope defines the named numbers.  The first variable is the time, except in formulas.  Expressions are immutable:
 * any number of threads may evaluate them. */
#ifndef PW_EXPRESSION_H
#define PW_EXPRESSION_H

#include "util.h"

typedef struct {
  size_t at; /* offset in bytes */
  char text[240];
} pw_expression_error;

enum { PW_EXPRESSION_TIME = 0 };

/* Named numbers and paths, and names that stand for expressions of variables. */
typedef struct {
  int names;
  const char **name; /* names */
  double *value;     /* names */
  pw_path **path;    /* names: NULL for a number */
  pw_names index;    /* the index of each name */
  int room;          /* names for which there is memory */
  /* The text of the expression that a name stands for, which is read in place of the name, or NULL.  Variables have
   * precedence.  May be NULL. */
  const char *(*expand) (void *context, const char *name);
  void *context;
} pw_scope;

/* Makes room for `room` names in an arena; the scope must be { 0 } at first.  PW_OK or PW_RESOURCE. */
int pw_scope_reserve (pw_scope *s, int room, pw_arena *arena);
void pw_scope_close (pw_scope *s); /* names and numbers stay in the arena */

/* Adds a name, to which the scope keeps a pointer; there must be room. */
void pw_scope_add (pw_scope *s, const char *name, double value);
void pw_scope_add_path (pw_scope *s, const char *name, pw_path *path);
/* The path whose name precedes the dot, or NULL. */
pw_path *pw_scope_path (const pw_scope *s, const char *name);

/* One operation of an expression; it replaces its operands, the last ones on a stack, by its value. */
typedef struct {
  short op;    /* pw_expression_op */
  short index; /* of the variable or function */
  union {
    double value;  /* of a constant */
    pw_path *path; /* of a function of a path */
  };
} pw_expression_code;

/* Jumps as states change: NEVER; RARELY: where an angle turns or another place of a smooth path becomes the nearest. */
typedef enum { PW_JUMPS_NEVER, PW_JUMPS_RARELY, PW_JUMPS } pw_jumps;

/* An expression: its syntax tree in postfix order. */
typedef struct {
  int codes;  /* operations */
  int breaks; /* 1: may have jumps or kinks in time */
  pw_jumps jumps;
  const char *jump; /* part, of jump_size bytes, of the caller's text that may jump as states change; or NULL */
  int jump_size;
  int unlocated; /* 1: where it does so is not found as that of a condition: a jump of atan2 or of a path */
  pw_expression_code code[];
} pw_expression;

/* Size of an expression in bytes, by which it may be copied.  The paths of a scope must outlive its expressions and
 * their copies, unless these share them; a copy that does releases them. */
size_t pw_expression_size (const pw_expression *expression);
void pw_expression_share_paths (const pw_expression *expression);
void pw_expression_release_paths (const pw_expression *expression);
/* Reads an expression of a scope and at most 32 variables, which end with NULL, into an arena; scope and `variable` may
 * be NULL.  PW_INPUT, error; PW_RESOURCE. */
int pw_expression_read (const pw_scope *s, const char *const *variable, const char *text, pw_arena *arena,
                        const pw_expression **expression, pw_expression_error *error);
/* The same of an expression that is evaluated once: its value for these values of the variables, which may be
 * non-finite.  The scope may be NULL, and so may variables and values. */
int pw_expression_constant (const pw_scope *s, const char *const *variable, const double *values, const char *text,
                            double *value, pw_expression_error *error);

/* The value, which may be non-finite; at a jump in time, that just after it. */
double pw_expression_value (const pw_expression *expression, const double *variable);
/* The value and its first two derivatives with respect to variable `by`; just after it at a jump or kink, as this
 * variable grows.  NaN or infinite are derivatives that those of operands do not determine: of sqrt and atan2 at 0. */
void pw_expression_derivatives (const pw_expression *expression, const double *variable, int by, double u[3]);
/* The first time after t at which the value, or a time derivative, may jump whatever the other variables are; INFINITY
 * if there is none.  If the search would take too long, or jumps are too frequent for steps to end at each
 * (range.c): a time after t up to which there are no others.  Not found are jumps whose times depend on other
 * variables, and kinks at the end of a function's domain, as of sqrt (t^2). */
double pw_expression_breakpoint (const pw_expression *expression, double t);
/* The number of conditions on states, and with of_time 1 on time (evaluation.c); `side`: the side of each one, of which
 * there are at most `codes`.  beyond NULL: stores the sides at these variables and, unless `fixed` is NULL, makes
 * `fixed`, with room for codes + 2 conditions operations, the expression with these sides: paths remain those of x.
 * Otherwise stores how far each condition is beyond its side, where it matters. */
int pw_expression_sides (const pw_expression *x, int of_time, const double *variable, double *side, double *beyond,
                         pw_expression *fixed);
/* Bounds of the value for all values of the variables between lo and hi, infinite if they are unknown. */
void pw_expression_bounds (const pw_expression *expression, int variables, const double *lo, const double *hi,
                           double bounds[2]);
/* Whether the value may change much within a small range of its variables: not a polynomial of low degree. */
int pw_expression_may_be_narrow (const pw_expression *expression);

/* Whether a text has the form of a name: a letter or _, then letters, digits and _, at most 63 bytes. */
int pw_expression_is_name (const char *text);
/* Whether a function or constant has this name. */
int pw_expression_is_reserved (const char *text);

/* Copies the next name in the text of an expression, also that of a function or constant, but not PATH.FUNCTION, to the
 * buffer, cut to its size, and moves *rest after it.  Returns its position, or NULL after the last name. */
enum { PW_EXPRESSION_NAME = 100 };
const char *pw_expression_next_name (const char **rest, char name[PW_EXPRESSION_NAME]);
/* The same, also of PATH.FUNCTION. */
const char *pw_expression_next_word (const char **rest, char name[PW_EXPRESSION_NAME]);
/* Whether a text is a single number; its value may overflow to infinity. */
int pw_expression_number (const char *text, double *value);

/* ---- Operations and functions, for the files that read and evaluate expressions ---- */

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

/* The value of operations; *may_jump becomes 1 if one of them may jump there, as at equal numbers or poles. */
double pw_expression_run (const pw_expression_code *code, int codes, const double *variable, int *may_jump);
/* The value of an operation of `right` alone or of `left` and `right`, other than functions of the nearest point. */
double pw_expression_apply (const pw_expression_code *c, double left, double right);
/* As pw_expression_derivatives.  discrete, unless NULL, receives for each operation a number that differs on the two
 * sides of each of its breakpoints: the value of floor, the sign of the operand of abs. */
void pw_expression_run_jet (const pw_expression *expression, const double *variable, int by, double u[3],
                            double *discrete);

/* Whether the last of these operations, a part of an expression, may jump at some time in some state: atan2 (x, 1) and
 * sign (x^2 + 1) do not. */
pw_jumps pw_expression_may_jump (const pw_expression_code *code, int codes);

#endif
