/* Expressions from their text, for tests of their values, derivatives and breakpoints. */
#ifndef EXPRESSIONS_H
#define EXPRESSIONS_H

#include "expression.h"

/* Reads over the parameter a = 3 and the variables t and frame.phi. */
int expression_read (const char *text, const pw_expression **x, pw_expression_error *trouble);

/* What must be an expression; its value. */
const pw_expression *expression_of (const char *text);
double expression_at (const char *text, double t, double phi);

/* Releases all expressions. */
int expression_teardown (void);

#endif
