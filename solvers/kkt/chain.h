/* Chains within a large scene: bodies one after another, each pinned to the one before and the one behind.
 *
 * Nothing else touches the pins inside a chain, so their part of the matrix is block tridiagonal and need not be stored:
 * with a body's arms a and b to the pins c and c + 1 and the inverses m of its mass and i of its inertia
 *
 *   K_cc += m 1 + i a a^T,   K_(c+1)c = +-m 1 + i b a^T = K,   K_(c+1)(c+1) += m 1 + i b b^T
 *   L = K D_c^-1,   D_(c+1) = K_(c+1)(c+1) - L K^T,   y_(c+1) -= L y_c
 *   backwards:   y_c = D_c^-1 (y_c - K^T y_(c+1)),   K^T y = +-m y + i (b . y) a
 *
 * where D and y are carried from pin to pin, and D^-1 alone is kept. */
#ifndef PW_CHAIN_H
#define PW_CHAIN_H

/* Places are those of the first body; the others' follow at equal distances. */
typedef struct {
  int column;                 /* its first pin's; those of the others follow */
  int bodies;                 /* so many columns are eliminated here, the next one receives their last update */
  int A, B;                   /* J of the first and of the second pin in the body's columns, in base[0] */
  int step;                   /* from row to row of J */
  int y;                      /* of the first pin in the right-hand side */
  int j;                      /* first coordinate */
  int next_J, next_y, next_j; /* from body to body */
  int keep;                   /* its D^-1: lower triangle; 3 from column to column */
  int first, last;            /* diagonal blocks of the first column, and of that after the last one, in the values; the
                                 complement if nothing has been stored there before */
} pw_chain;

#endif
