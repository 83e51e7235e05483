/* Terms: values that generated code has when it runs, and the statements that compute them. */
#ifndef PW_ELIMINATION_H_
#define PW_ELIMINATION_H_
#include <stdio.h>
#include "system.h"

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
pw_term pw_term_named (pw_term_type type, const char *array, int i, double value); /* array[i] */
/* "-x3": the term with its sign, in the buffer unless it is 0. */
const char *pw_term_text (pw_term a, char buffer[24]);

/* Symbolic elimination of the saddle-point system [ M J^T ; J 0 ] of a scene, in an order fixed when the code is
 * generated: massless coordinates with the constraint equations that determine them, coordinates with mass, constraint
 * equations by least fill-in (Duff, Erisman & Reid 2017, chapters 5 and 7). */

typedef struct {
  int coordinates, n;      /* unknowns: the coordinates, then the constraint equations */
  pw_term *K, *L;          /* n x n: K, column p as it was when unknown p was eliminated; L of K = L D L^T */
  pw_term *inverse;        /* n: reciprocal pivots */
  int *order, *partner;    /* n: unknowns in their order; partner of a 2 x 2 pivot, or -1 */
  int *step;               /* n: position in the order; n: not eliminated yet; n + 1: takes no part */
  int pivots;              /* entries of `order` so far */
  int factors;             /* entries of F, an array of the generated code */
  const pw_term *original; /* n x n: K before the elimination; the caller's */
} pw_elimination;

/* K: n x n, symmetric, n = coordinates + rows; takes_part: rows, 0 for an equation that is ignored.
 * Writes the statements of the factorisation; the last of them store in F what the solution needs.  PW_RETRY if a
 * massless coordinate is determined by no equation, or an equation has no pivot; PW_RESOURCE.  Close in every case. */
int pw_elimination_open (pw_elimination *ldl, const pw_system *s, const pw_term *K, const unsigned char *takes_part,
                         pw_emitter *emitter);
void pw_elimination_close (pw_elimination *ldl);

/* Writes the statements that solve K x = right; x replaces the n terms of `right`. */
void pw_elimination_solve (const pw_elimination *ldl, pw_emitter *emitter, pw_term *right);

#endif
