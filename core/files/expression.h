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

/* ---- Reading ---- */

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
  short op;    /* pw_expression_op (expression_parts.h) */
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
/* The same of an expression without variables: its value, which may be non-finite.  The scope may be NULL. */
int pw_expression_constant (const pw_scope *s, const char *text, double *value, pw_expression_error *error);

/* ---- Values ---- */

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
/* The number of conditions on states (evaluation.c); `side`: the side of each one, of which there are at most `codes`.
 * beyond NULL: stores the sides at these variables and, unless `fixed` is NULL, makes `fixed`, with room for codes + 2
 * conditions operations, the expression with these sides: paths remain those of x.  Otherwise stores how far each
 * condition is beyond its side, where it matters. */
int pw_expression_sides (const pw_expression *x, const double *variable, double *side, double *beyond,
                         pw_expression *fixed);
/* Bounds of the value for all values of the variables between lo and hi, infinite if they are unknown. */
void pw_expression_bounds (const pw_expression *expression, int variables, const double *lo, const double *hi,
                           double bounds[2]);
/* Whether the value may change much within a small range of its variables: not a polynomial of low degree. */
int pw_expression_may_be_narrow (const pw_expression *expression);

/* ---- Words ---- */

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

#endif
