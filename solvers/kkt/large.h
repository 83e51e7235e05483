/* Large scenes: the condensed matrix is sparse, assembled body by body and factorised column by column in one pass.
 *
 * A patch is what meets at a body (or an own coordinate): the pieces of the constraint rows that touch it, a piece being
 * the columns there of one node of the factorisation.  Any two pieces of a patch give a block of S = J W^-1 J^T.
 *
 * Where very many nodes meet at a body, S would become dense.  The body is kept instead: its accelerations a_k are
 * unknowns too,
 *
 *     [ S    J_k ] [ lambda ]   [ J W^-1 f - gamma ]
 *     [ J_k^T -M ] [ -a_k   ] = [ f_k              ]      with S of all other bodies,
 *
 * quasi-definite, so that L D L^T goes without pivoting (Vanderbei 1995), with the node of -a_k after its rows, and
 * rows that touch nothing but kept bodies after that.  Its patch has the node itself as its last piece. */
#ifndef PW_LARGE_H
#define PW_LARGE_H

#include "chain.h"
#include "ldl.h"

typedef struct {
  int J;               /* first row and column, in base[other] */
  int y;               /* of its first row in the right-hand side */
  int D;               /* its node's diagonal block in the values; the complement if it is the first to store there */
  short step;          /* from row to row of J */
  unsigned char size;  /* rows */
  unsigned char other; /* which base */
} pw_piece;

typedef struct {
  int j;               /* first coordinate */
  int column;          /* needed before this column is eliminated: the patches are in this order */
  int first;           /* its pieces, in the order of their columns: from here to `first` of the next patch */
  int block;           /* its blocks: for each piece a, for the pieces b after it */
  unsigned char width; /* columns: 3, or 1 of an own coordinate */
  unsigned char shape; /* a pw_shape: short ones have 3 columns */
} pw_patch;

/* Values that an elimination updates before a patch has stored anything there. */
typedef struct {
  int at, count;
} pw_gap;

typedef struct {
  pw_ldl *ldl;
  const double *base[2]; /* J of the system; J~ of the components with massless coordinates */
  const double *inverse; /* diagonal of W^-1 */
  pw_patch *patch;       /* patches + 1: the last one ends the ranges */
  pw_piece *piece;
  int *block; /* where K_ba is in the values; the complement if it is stored, not added */
  pw_gap *gap;
  pw_chain *chain; /* chains + 1: the last one begins nowhere; their bodies are in no patch */
  double *keep;    /* of the chains' columns: D^-1, lower triangles */
  int patches, gaps, chains;
  double pivot; /* smallest pivot of the last factorisation, relative to the diagonal entry it came from */
  int row;      /* its position in the right-hand side */
  double least; /* a factorisation ends at the first pivot that is not larger: 0, but while it is planned */
  char *memory;
} pw_large;

/* S = J W^-1 J^T = L D L^T; stops at a pivot that is not larger than `least`. */
void pw_large_factor (pw_large *l);

/* y, which holds gamma, becomes lambda; a = W^-1 (f - J^T lambda).  f and a may be the same; f NULL: zero. */
void pw_large_solve (const pw_large *l, const double *f, double *y, double *a);

/* Both in one pass. */
void pw_large_both (pw_large *l, const double *f, double *y, double *a);

#endif
