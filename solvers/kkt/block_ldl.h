/* Block L D L^T factorisation of the condensed matrix S = J W^-1 J^T of a saddle-point system (saddle.h), sparse: nodes
 * of 1 or 2 unknowns, ordered and laid out once, assembled body by body and factorised column by column (Duff, Erisman
 * & Reid 2017, Direct Methods for Sparse Matrices, chapters 5, 10 and 12).  K: the blocks of S before elimination.
 *
 * A node is a constraint equation, or two with the same columns.  A body block collects the contributions of the nodes
 * that touch a body (or an internal coordinate), each being the node's columns there.  Any two contributions of a body
 * block couple their nodes.
 *
 * Many nodes meeting at one body would make S dense.  Such a body k is not condensed: its accelerations a_k are
 * unknowns, too,
 *
 *     [ S    J_k ] [ lambda ]   [ J W^-1 f - gamma ]
 *     [ J_k^T -M ] [ -a_k   ] = [ f_k              ]      with S of all other bodies,
 *
 * quasi-definite, so that L D L^T needs no pivoting (Vanderbei 1995, Symmetric quasi-definite matrices), with the nodes
 * of -a_k (rank 1) after the equations of rank 0 and before those of rank 2 (condense_rank.c).
 *
 * Chains are bodies one after another, each pinned to the one before and the one after.  Nothing else touches the pins
 * inside a chain, so their part of the matrix is block tridiagonal and need not be stored: with a body's arms a and b
 * to the pins c and c + 1 and the inverses m of its mass and i of its inertia
 *
 *   K_cc += m 1 + i a a^T,   K_(c+1)c = +-m 1 + i b a^T = K,   K_(c+1)(c+1) += m 1 + i b b^T
 *   L = K D_c^-1,   D_(c+1) = K_(c+1)(c+1) - L K^T,   y_(c+1) -= L y_c
 *   backwards:   y_c = -D_c^-1 (y_c + K^T y_(c+1)),   K^T y = +-m y + i (b . y) a
 *
 * where D and y are passed from pin to pin, and only the factors of D are stored.  If nothing is below the last pin,
 * the elimination proceeds from both ends to the middle. */
#ifndef PW_BLOCK_LDL_H
#define PW_BLOCK_LDL_H

#include "pinwheel.h"

enum {
  PW_BLOCK_NODE = 2, /* most unknowns in a node */
  PW_BLOCK_RANKS = 3 /* ranks of nodes: nodes of a lower rank are eliminated first */
};

/* The vector y holds the right-hand side, then the solution: unknowns lambda, and -a_k after them. */

/* The column of a node, in the order of elimination.  Its values follow one another: the lower triangle of the diagonal
 * block by rows, the diagonal entries before elimination, then the blocks below, each by rows. */
typedef struct {
  int first_value;        /* of its values */
  int unknown;            /* its first unknown in y */
  int first_below;        /* its first row below; ends at first_below of the next column */
  unsigned char size;     /* unknowns */
  unsigned char in_chain; /* 1: within a chain, where it has no values */
} pw_block_column;

/* The columns of a node at a body. */
typedef struct {
  const double *J; /* first row and column */
  int unknown;     /* that of its first row in y */
  int diagonal;    /* its node's diagonal block in the values */
  int row_stride;  /* from row to row of J */
  short size;      /* rows */
} pw_contribution;

typedef struct {
  int j;                  /* first coordinate */
  int first_contribution; /* in the order of their columns; ends at first_contribution of the next block */
  int first_coupling;     /* for each contribution a, for the contributions b after it: where K_ba is in the values */
  unsigned char width;    /* columns: 3, or 1 of an internal coordinate */
  unsigned char uncondensed; /* 1: its two nodes are the last contributions; couplings only with these */
} pw_body_block;

/* Positions are those of the first body and its pins; the others follow at equal strides. */
typedef struct {
  int first_column; /* of the first pin; those of the others follow */
  int bodies;       /* also the number of columns eliminated here, unless includes_last; the next one receives their
                     * last update */
  const double *J_first, *J_second;       /* J of the first and of the second pin in the body's columns */
  int row_stride;                         /* from row to row of J */
  int unknown;                            /* of the first pin in y */
  int j;                                  /* first coordinate */
  int J_stride, unknown_stride, j_stride; /* from body to body */
  int first_factor;                       /* the factors of its D; 3 from column to column */
  int includes_last;                      /* 1: nothing is below the last pin, which is eliminated here, too */
} pw_chain;

typedef struct {
  int nodes;
  pw_block_column *column; /* nodes + 1: the last one ends the ranges */
  int *below;              /* numbers of the columns that the rows below belong to, ascending in each column */
  int *target;             /* for each column, for its rows p descending, for its rows q < p: where K_pq is */
  int *column_of_node;
  double *value; /* K, then its factors */
  int values;
  const double *inverse_weight; /* diagonal of W^-1 */
  pw_body_block *body;          /* bodies + 1: the last one ends the ranges */
  pw_contribution *contribution;
  int *coupling;
  pw_chain *chain;      /* chains + 1: the last one is a sentinel; their bodies have no block */
  double *chain_factor; /* factors of D in the chains' columns */
  int bodies, chains;
  double least_pivot; /* smallest pivot of the last factorisation, relative to the diagonal entry it came from */
  int least_unknown;  /* the unknown that had it */
  char *pattern, *memory;
} pw_block_ldl;

/* ---- Planning (block_order.c) ---- */

typedef struct {
  int size;               /* unknowns */
  int rank;               /* 0 to PW_BLOCK_RANKS - 1 */
  int grounded;           /* 1: touches the ground or prescribed coordinates (pw_is_grounded) */
  int unknown;            /* its first unknown in y: its first row, or beyond the rows */
  int first_contribution; /* its last one is before first_contribution of the next node */
} pw_plan_node;

/* pair: 2 x pairs node numbers with a block between them, each unordered pair any number of times, the diagonal not
 * needed, fewer than 2^30.  The order is that of the nodes if it fills in no more than minimum degree does (AMD:
 * Amestoy, Davis & Duff 1996).  NULL if out of memory. */
pw_block_ldl *pw_block_open (int nodes, const pw_plan_node *node, long pairs, const int *pair);
void pw_block_close (pw_block_ldl *l);

/* Lays out the values.  PW_OK, or PW_RESOURCE if out of memory or there are 2^31 values or more. */
int pw_block_lay_out (pw_block_ldl *l);

/* Position of the block of columns p > q, with the rows of p. */
int pw_block_find (const pw_block_ldl *l, int p, int q);

/* Values of a diagonal block: its lower triangle, and the original diagonal. */
static inline int pw_block_diagonal (int size) {
  return size * (size + 3) / 2;
}

/* ---- Numbers ---- */

/* S = J W^-1 J^T = L D L^T; stops at a pivot that is not positive. */
void pw_block_factor (pw_block_ldl *l);

/* y, which holds gamma, becomes lambda; a = W^-1 (f - J^T lambda).  f and a may be the same; f NULL: zero. */
void pw_block_solve (const pw_block_ldl *l, const double *f, double *y, double *a);

/* The same for a chain, called in the order of its columns: elimination, which stops at a pivot that is not positive;
 * the right-hand side forwards; and backwards, with accelerations. */
void pw_chain_factor (pw_block_ldl *l, const pw_chain *c);
void pw_chain_forward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y);
void pw_chain_backward (const pw_block_ldl *l, const pw_chain *c, const double *f, double *y, double *a);

#endif
