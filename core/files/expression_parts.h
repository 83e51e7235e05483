/* Between the files of expressions: their words (expression_words.c), and how they are read (expression_read.c). */
#ifndef PW_EXPRESSION_PARTS_H
#define PW_EXPRESSION_PARTS_H

#include "expression.h"
#include "files.h"

/* A function of one argument, of two, or of one and more. */
typedef struct {
  const char *name;
  double (*one) (double);
  double (*two) (double, double);
  double (*many) (const double *, int);
} pw_expression_function;

typedef struct {
  const char *name;
  double value;
} pw_expression_constant;

/* Both ended by a NULL name. */
extern const pw_expression_function pw_expression_functions[];
extern const pw_expression_constant pw_expression_constants[];
int pw_expression_is_function (const char *name);

/* How long the name at p is, which may go on with a dot: frame.phi; 0 if there is none. */
size_t pw_expression_name_size (const char *p);
/* Digits, with a point among them or around, and an exponent; 0 if there is no number. */
size_t pw_expression_number_size (const char *p);

/* The names an expression may use besides functions and constants. */
typedef struct {
  int names, room;
  const char **name;
  pw_names table;
} pw_expression_scope;

/* PW_INPUT with the trouble if the text is no expression over these names.  Which arguments a function takes, and the like,
 * is not looked at. */
int pw_expression_read (const pw_expression_scope *x, const char *text, pw_expression_trouble *trouble);

/* Fills the trouble with two texts in a format; returns PW_INPUT. */
int pw_expression_wrong (pw_expression_trouble *t, size_t at, const char *format, const char *a, const char *b);

#endif
