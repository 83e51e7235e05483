/* Symbolic elimination of the saddle-point system [ M J^T ; J 0 ] of a scene, in an order fixed when the code is
 * generated: massless coordinates with the constraint equations that determine them, coordinates with mass, constraint
 * equations by least fill-in (Duff, Erisman & Reid 2017, chapters 5 and 7). */
#ifndef PW_ELIMINATION_H
#define PW_ELIMINATION_H

#include "symbolic.h"
#include "system.h"

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
