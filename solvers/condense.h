/* How a scene's rows are condensed: what saddle.c executes and condense.c plans.  For these two files only.
 *
 * Rows are grouped into nodes, runs of up to 3 rows of one element; the columns of a node fall into pieces, one for each
 * body or own coordinate with weight.  Two pieces in the same columns make a term of S = J W^-1 J^T.  Terms and pieces
 * of the common shapes (1 or 2 rows of an element, 3 columns) are kept in short forms, each shape in one run, so that
 * the loops over them have no branches; all others in a wide form. */
#ifndef PW_CONDENSE_H
#define PW_CONDENSE_H

#include "ldl.h"

#include "reduce.h"
#include "small.h"

/* Rows of A, rows of B; D: a node with itself, where the lower triangle is enough. */
typedef enum { PW_TERM_D1, PW_TERM_D2, PW_TERM_11, PW_TERM_12, PW_TERM_21, PW_TERM_22, PW_TERM_SHAPES } pw_term_shape;

/* block += J_a W^-1 J_b^T; J by offset from the system, in doubles. */
typedef struct {
  int A, B;             /* first row, first column */
  int to;               /* in the values of the factorisation */
  int j;                /* coordinate */  short step_a, step_b; /* from row to row */
  int step_t;           /* from row to row of the block */
} pw_term;

typedef struct {
  const double *A, *B;  int to, j, step_a, step_b, step_t;
  signed char a, b, width; /* rows of A, rows of B, columns */
} pw_wide_term;

/* 1 or 2 rows by 3 columns of J, at coordinate j and position y of the right-hand side. */
typedef struct {
  int J, j, y, step;
} pw_piece;

typedef struct {
  const double *J;
  int j, y, step;
  signed char size, width;
} pw_wide_piece;

/* Where a position of the right-hand side comes from and goes to, where that is not a row. */
typedef struct {
  int y;
  double *gamma, *lambda;
} pw_extra;

struct pw_saddle {
  pw_system *s;
  const double *base;       /* the system, as doubles */
  int rows, unknowns;
  pw_reduce reduce;
  pw_ldl *ldl;
  double *value;            /* of the factorisation */
  size_t values;
  double *inverse;          /* coords + 3: 1 / weight; 0 for held ones and those without weight; the ground's 0 */
  double *force, *z;        /* coords + 3 */
  double *y;                /* unknowns */
  pw_term *term;            /* by shape: first[shape] .. first[shape + 1] */
  int first[PW_TERM_SHAPES + 1];
  pw_wide_term *wide;
  int wides;
  pw_piece *piece;          /* those of 1 row, then those of 2 */
  int pieces1, pieces;
  pw_wide_piece *wide_piece;
  int wide_pieces;
  int *row_of;              /* unknowns: row, or -1 for an extra */
  pw_extra *extra;
  int extras;  pw_small *small;          /* a small scene: used instead of ldl, terms and pieces; else NULL */
  pw_small *plain;          /* the same if that is all there is: no components, no idle rows; else NULL */
  int *idle;                /* rows that take no part */
  int idles;
  int *row_of_node;         /* first row of a node, or -1 */
  double pivot;             /* squared, of the last factorisation */  int pivot_row;
  double guard;             /* squared: the least that is good */
  char *memory;
};

/* Plans everything but `reduce`, which is there.  Errors: PW_MACHINE. */
int pw_condense (struct pw_saddle *k, const double *weight, int rows, const unsigned char *active, pw_error *error);

#endif
