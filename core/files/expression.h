/* Expressions: numbers written as arithmetic over names, evaluated by muParser.
 *
 *   operators   + - * / ^, < <= > >= == !=, && ||, CONDITION ? THEN : ELSE, parentheses
 *   functions   sin cos tan asin acos atan atan2 sinh cosh tanh exp log log10 sqrt abs sign floor ceil round hypot mod min max
 *               jacobi_am (u, m), elliptic_K (m)
 *   constants   pi, e, deg = pi / 180
 *
 * An evaluator belongs to one thread at a time. */
#ifndef PW_EXPRESSION_H
#define PW_EXPRESSION_H

#include <stddef.h>

typedef struct pw_expression pw_expression;

/* What is wrong with an expression, and where in it. */
typedef struct {
  size_t at; /* offset in bytes */
  char text[240];
} pw_expression_trouble;

/* An evaluator that knows functions and constants; NULL without memory.  `names`: how many more there may be. */
pw_expression *pw_expression_open (int names);
void pw_expression_close (pw_expression *x);

/* Makes a name known: the value is read at each evaluation.  The text must stay.  PW_OK or PW_MACHINE. */
int pw_expression_name (pw_expression *x, const char *name, const double *value);

/* Takes an expression.  PW_INPUT with the trouble if it is not one, PW_MACHINE. */
int pw_expression_set (pw_expression *x, const char *text, pw_expression_trouble *trouble);

/* The value of the expression taken last, which may be non-finite. */
double pw_expression_value (pw_expression *x);

/* The value of an expression over names whose values never change: a text that comes again is not evaluated again.  The
 * text must stay.  Returns as pw_expression_set. */
int pw_expression_fixed (pw_expression *x, const char *text, double *value, pw_expression_trouble *trouble);

/* Whether a text can be a name: a letter or _, then letters, digits and _; neither a function nor a constant. */
int pw_expression_is_name (const char *text);
/* Whether functions or constants have this name. */
int pw_expression_is_taken (const char *text);

/* Calls `each` with every name in an expression, functions and constants too, until it returns non-zero; returns that. */
int pw_expression_names (const char *text, int (*each) (void *context, const char *name, size_t length, size_t at),
                         void *context);

/* Whether a text is nothing but a number; its value may overflow to infinity. */
int pw_expression_number (const char *text, double *value);

#endif
