/* Terms: values that generated code has when it runs, and the statements that compute them. */
#ifndef PW_SYMBOLIC_H
#define PW_SYMBOLIC_H

#include <stdio.h>

typedef enum { PW_TERM_ZERO, PW_TERM_ONE, PW_TERM_CONSTANT, PW_TERM_VARIABLE } pw_term_type;

/* sign times 0, 1, a value that is constant during a run (M[0], J[3], or C[2] computed by `prepare`), or a variable. */
typedef struct {
  pw_term_type type;
  int sign;
  char name[20]; /* as printed without the sign: "C[3]", "x12", "J[7]" */
  double value;  /* at the initial state, including the sign, to choose pivots; 1 for f and g of solutions */
} pw_term;

/* Where statements go. */
typedef struct {
  FILE *prepare, *code;     /* those that compute constants; the others, of the function being written */
  int constants, variables; /* how many C[0], C[1], ... and x0, x1, ... there are so far */
} pw_emitter;

static inline pw_term pw_term_zero (void) {
  return (pw_term){ PW_TERM_ZERO, 1, "0", 0 };
}
static inline pw_term pw_term_negative (pw_term a) {
  a.sign = -a.sign;
  a.value = -a.value;
  return a;
}
pw_term pw_term_named (pw_term_type type, const char *array, int i, double value); /* array[i] */

/* Write a statement unless none is needed, and return the term of its result. */
pw_term pw_emit_product (pw_emitter *emitter, pw_term a, pw_term b);               /* a b */
pw_term pw_emit_difference (pw_emitter *emitter, pw_term a, pw_term b, pw_term c); /* a - b c */
pw_term pw_emit_quotient (pw_emitter *emitter, pw_term a, pw_term b);              /* a / b */

/* "-x3": the term with its sign, in the buffer unless it is 0. */
const char *pw_term_text (pw_term a, char buffer[24]);

#endif
