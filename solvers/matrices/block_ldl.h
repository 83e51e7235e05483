/* Block L D L^T factorisation of the condensed matrix S = J W^-1 J^T of a saddle-point system (saddle.h), sparse: nodes
 * of 1 or 2 unknowns, ordered and laid out once, assembled body by body and factorised column by column (Duff, Erisman
 * & Reid 2017, Direct Methods for Sparse Matrices, chapters 5, 10 and 12).  K: the blocks of S before elimination.
 *
 * A node is a constraint equation, or two with the same columns.  Its contribution to a group, a body or an
 * internal coordinate, is its part of J in the group's columns.  A group block lists the contributions to a group; any
 * two of them couple their nodes.
 *
 * Many nodes meeting at one body would make S dense.  Such a body k is not condensed: its accelerations a_k are
 * unknowns, too,
 *
 *     [ S      J_k ] [ lambda ]   [ J W^-1 f - gamma ]
 *     [ J_k^T -W_k ] [ -a_k   ] = [ f_k              ]      with S of all other bodies,
 *
 * quasi-definite, so that L D L^T needs no pivoting (Vanderbei 1995, Symmetric quasi-definite matrices), with two nodes
 * of -a_k (x and y; the angle; rank 1) after the equations of rank 0 and before those of rank 2 (saddle.c).
 *
 * Chains are bodies one after another, each pinned to the one before and the one after.  Nothing else touches the pins
 * inside a chain, so their part of the matrix is block tridiagonal and need not be stored.  In a body's columns, J is
 * [ s 1  a ] at the pin c and [ s' 1  b ] at the pin c + 1, with signs s and s' and the unit matrix 1.  With the
 * inverses m of its mass and i of its inertia
 *
 *   K_cc += m 1 + i a a^T,   K_(c+1)c = s s' m 1 + i b a^T = K,   K_(c+1)(c+1) += m 1 + i b b^T
 *   L = K D_c^-1,   D_(c+1) = K_(c+1)(c+1) - L K^T,   y_(c+1) -= L y_c
 *   backwards:   y_c = -D_c^-1 (y_c + K^T y_(c+1)),   K^T y = s s' m y + i (b . y) a
 *
 * where D and y are passed from pin to pin; of the matrix, only the factors of D are stored.  If a chain has two bodies
 * or more and its last pin's column has no rows below the diagonal, both ends are eliminated towards the middle. */
#ifndef PW_BLOCK_LDL_H
#define PW_BLOCK_LDL_H

#include "util.h"

enum {
  PW_BLOCK_NODE = 2,   /* most unknowns in a node */
  PW_BLOCK_RANKS = 3,  /* ranks of nodes: nodes of a lower rank are eliminated first */
  PW_BLOCK_LISTED = 64 /* most rows below the diagonal of a column whose targets are stored: n (n - 1) / 2 for n rows */
};

/* The vector y holds the right-hand side, then the solution: unknowns lambda, and -a_k after them. */

/* The column of a node, in the order of elimination.  Its values follow one another: the lower triangle of the diagonal
 * block by rows, the diagonal entries before elimination, then the blocks below, each by rows. */
typedef struct {
  int first_value;        /* index in `value` */
  int unknown;            /* index in y of its first unknown */
  int first_below;        /* index in `below` of its first row; its rows end at first_below of the next column */
  unsigned char size;     /* unknowns */
  unsigned char in_chain; /* 1: of a pin inside a chain: it has no values */
} pw_block_column;

/* The contribution of a node to a group. */
typedef struct {
  const double *J; /* its entry in the first row and column; NULL: a node of -a_k */
  int unknown;     /* index in y of the node's first unknown */
  int diagonal;    /* index in `value` of the node's diagonal block */
  int row_stride;  /* from row to row of J */
  short size;      /* rows */
} pw_contribution;

typedef struct {
  int j;                     /* first coordinate */
  int first_contribution;    /* index of the first one, by column; they end at that of the next block */
  int first_coupling;        /* index of the first one: for each contribution a, for each b after it */
  unsigned char width;       /* columns: 3, or 1 of an internal coordinate */
  unsigned char uncondensed; /* 1: its last two contributions are the nodes of -a_k; couplings are with these only */
} pw_group_block;

/* Pointers and indices are those of the first body and its pins; the others follow at equal strides. */
typedef struct {
  int first_column;                       /* of the first pin; those of the others follow */
  int bodies;                             /* one less than pins */
  const double *J_first, *J_second;       /* J of the first and of the second pin in the body's columns */
  int row_stride;                         /* from row to row of J */
  int unknown;                            /* index in y of the first pin's first unknown */
  int j;                                  /* first coordinate */
  int J_stride, unknown_stride, j_stride; /* from body to body */
  int first_factor;                       /* index in `chain_factor`: 3 factors of D for each pin */
  int includes_last; /* 1: the last pin is eliminated with the chain; 0: it only receives the update by the others */
} pw_chain;

/* A column, and the block between it and the next one. */
typedef struct {
  int contributions; /* to the column; 2 inside a chain */
  int sources;       /* bodies and eliminated columns that add to the block */
  pw_chain link;     /* one of these bodies as a chain of one; link.bodies is 0 if none can be in a chain */
} pw_chain_between;

typedef struct pw_block_ldl {
  int nodes;
  pw_block_column *column; /* nodes + 1: the last one ends the ranges */
  int *below;              /* rows below the diagonal of each column, as numbers of columns, ascending */
  int *target; /* for each column, for its rows p descending, for its rows q < p: index in `value` of K_pq */
  int *cursor; /* of a column with more rows: for its rows q, index in `value` of K_pq; then index in `below` of p */
  int *column_of_node;
  double *value;                /* K, then its factors */
  int values;                   /* length of `value` */
  const double *inverse_weight; /* diagonal of W^-1, owned by the saddle */
  pw_group_block *group;        /* groups + 1: the last one ends the ranges */
  pw_contribution *contribution;
  int *coupling;        /* index in `value` of the block of nodes a and b */
  pw_chain *chain;      /* chains + 1, by ascending columns, the last one a sentinel; their bodies have no block */
  double *chain_factor; /* factors of D in the chains' columns */
  int groups;
  double least_pivot; /* smallest pivot of the last factorisation over its diagonal entry before elimination */
  int least_unknown;  /* index in y of its unknown; -1: there is none */
  /* allocations: of column, below and column_of_node; of value, target and cursor; of groups and chains */
  char *pattern, *numbers, *memory;
} pw_block_ldl;

typedef struct {
  int size;               /* unknowns */
  int rank;               /* 0 to PW_BLOCK_RANKS - 1 */
  int grounded;           /* 1: touches a group that does not move, or is_grounded in saddle.c */
  int rolls;              /* 1: the rolling equation of a wheel, alone */
  int unknown;            /* index in y of its first unknown: its first row, or beyond the rows for -a_k */
  int first_contribution; /* index of the first one; they end at that of the next node */
} pw_plan_node;

/* Orders the nodes and determines the pattern.  pair: 2 x pairs numbers of nodes that are coupled, in any order, with
 * repetition; pairs < 2^30.  Within each rank, the order is that of the nodes if L then has no more blocks than with
 * minimum degree in rank 0 (AMD: Amestoy, Davis & Duff 1996).  NULL if out of memory, or if minimum degree leaves
 * 2^30 blocks or more below the diagonal. */
pw_block_ldl *pw_block_open (int nodes, const pw_plan_node *node, long pairs, const int *pair);
void pw_block_close (pw_block_ldl *l); /* l may be NULL */

/* Joins the links to chains, at most one for each node, and marks their inner columns; is_linked[b] becomes 1 for each
 * body b in a chain.  Adds fill-in to the sources.  Returns the number of chains. */
int pw_block_join_chains (pw_block_ldl *l, pw_chain_between *between, pw_chain *chain, unsigned char *is_linked);

/* Lays out the values, after the chains have been joined.  PW_OK, or PW_RESOURCE if out of memory or there are 2^31
 * values or more. */
int pw_block_lay_out (pw_block_ldl *l);

/* Index in `value` of the block of two coupled nodes: rows of the one eliminated later.  After pw_block_lay_out. */
int pw_block_find (const pw_block_ldl *l, int a, int b);

/* Number of values of a diagonal block: its lower triangle, and its diagonal before elimination. */
static inline int pw_block_diagonal_values (int size) {
  return size * (size + 3) / 2;
}

/* Assembles S with the J last evaluated and factorises it; stops where least_pivot is not positive. */
void pw_block_factor (pw_block_ldl *l);
/* y, which holds gamma, then 0 for each -a_k, becomes lambda and -a_k; a = W^-1 (f - J^T lambda).  f and a may be the
 * same; f NULL: zero. */
void pw_block_solve (const pw_block_ldl *l, const double *f, double *y, double *a);

#endif
