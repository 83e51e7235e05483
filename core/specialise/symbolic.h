/* Values known only when the generated code runs, and the statements that compute them. */
#ifndef PW_SYMBOLIC_H
#define PW_SYMBOLIC_H

#include <stdio.h>

typedef enum { PW_TERM_ZERO, PW_TERM_ONE, PW_TERM_CONSTANT, PW_TERM_VARIABLE } pw_term_type;

/* sign times 0, 1, a constant (computed once) or a variable. */
typedef struct {
  pw_term_type type;
  int sign;
  char name[20]; /* as printed without the sign: "C[3]", "x12", "J[7]" */
  double value;  /* with the sign, at the initial state */
} pw_term;

/* Where statements go: those of constants into `prepare`, the others into the function being written. */
typedef struct {
  FILE *prepare, *code;
  char *const *prepared; /* text of the former */
  int constants, variables;
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

pw_term pw_emit_product (pw_emitter *emitter, pw_term a, pw_term b);               /* a b */
pw_term pw_emit_difference (pw_emitter *emitter, pw_term a, pw_term b, pw_term c); /* a - b c */
pw_term pw_emit_quotient (pw_emitter *emitter, pw_term a, pw_term b);              /* a / b */

/* A name as part of a comment. */
void pw_emit_name (FILE *out, const char *name);

/* "-x3": the term with its sign, in the buffer. */
const char *pw_term_text (pw_term a, char buffer[24]);

#endif
