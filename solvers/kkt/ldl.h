/* The pattern of a block L D L^T factorisation of a symmetric matrix: nodes of 1 to 3 unknowns, ordered and laid out
 * once.  The numbers are filled in and factorised by large.c.
 *
 * The values of a column follow one another: the lower triangle of the diagonal block by rows, what the entries on the
 * diagonal were before anything was eliminated, then the blocks below, each by rows. */
#ifndef PW_LDL_H
#define PW_LDL_H

#include "pinwheel.h"

enum { PW_LDL_NODE = 3, PW_LDL_RANKS = 3 }; /* most unknowns in a node; ranks */

/* Which code is made for a column, or for what meets at a body: PW_LINK for a column within a chain (chain.h), and for
 * two pins at a body; PW_SHORT where no node has more than 2; PW_KEPT where the body is an unknown itself; PW_ANY what is
 * left. */
typedef enum { PW_ANY, PW_SHORT, PW_LINK, PW_KEPT } pw_shape;

/* A node, in the order of elimination. */
typedef struct {
  int at;              /* its values */
  int y;               /* its first unknown in the right-hand side */
  int first;           /* its rows below: from here to `first` of the next column */
  unsigned char size;  /* unknowns */
  unsigned char shape; /* a pw_shape */
} pw_column;

typedef struct {
  int nodes;
  pw_column *column; /* nodes + 1: the last one ends the ranges */
  int *below;        /* numbers of the columns that the rows below belong to, ascending in each column */
  int *target;       /* for each column, for its rows p descending, q < p: where K_pq is */
  double *value;
  int values;
  int *place; /* column of each node; until pw_ldl_settle */
  char *memory;
} pw_ldl;

/* nodes: how many; size: unknowns of each; y: where they are in the right-hand side; rank: those of a
 * higher one come later; pair: 2 x pairs node numbers with
 * a block between them, each unordered pair any number of times, the diagonal not needed.  The order is that of the
 * nodes if it fills in no more than minimum degree does (AMD: Amestoy, Davis & Duff 1996).
 * NULL if memory is out. */
pw_ldl *pw_ldl_open (int nodes, const int *size, const int *y, const int *rank, long pairs, const int *pair);
void pw_ldl_close (pw_ldl *l);

/* Lays out the values; columns of shape PW_LINK get none, the others their shape.  PW_OK, or PW_MACHINE if memory is out or
 * there are 2^31 values or more. */
int pw_ldl_lay_out (pw_ldl *l);

/* Where the block of columns p > q is, rows those of p. */
int pw_ldl_find (const pw_ldl *l, int p, int q);

/* Planning is over: `place` is freed. */
void pw_ldl_settle (pw_ldl *l);

/* Values of a diagonal block: its lower triangle, and what the diagonal was. */
static inline int pw_ldl_triangle (int size) {
  return size * (size + 1) / 2;
}

#endif
