/* Adds J and the second-order blocks of a scene's elements to a sparse matrix, for the Newton matrices of implicit
 * methods and the linearisation. */
#ifndef PW_NEWTON_H
#define PW_NEWTON_H

#include "system.h"
#include "scatter.h"

/* Scratch for the blocks of one system. */
typedef struct {
  double *block;     /* room for the largest block of a batch */
  double *direction; /* largest count x cols */
} pw_newton_scratch;

int pw_newton_open (pw_newton_scratch *n, const pw_system *s); /* PW_OK or PW_RESOURCE */
void pw_newton_close (pw_newton_scratch *n);

/* Where and how a block is added.  Its rows are coordinates or constraint equations. */
typedef struct {
  int row, col;               /* the row and column of the matrix for the block's first ones */
  int rows;                   /* constraint equations included: all, s->rows, or the holonomic ones, s->holonomic */
  double factor;              /* of blocks of forces and (J^T lambda)_q, and of what holonomic equations add */
  double factor_nonholonomic; /* of what nonholonomic equations add: to J, J^T, and blocks whose rows they are */
  const double *row_scale;    /* further factors, one for each row from `row` on; NULL: 1 */
  const int *row_index;       /* equations: new index of each, -1: omitted; NULL: indices do not change */
  const double *direction;    /* coordinates: w of the block (J w)_q; NULL for other blocks */
  const double *lambda;       /* equations: multipliers of the block (J^T lambda)_q; NULL for other blocks */
} pw_placement;

/* Adds a block of every batch, at the kinematics last updated. */
void pw_newton_add_block (pw_newton_scratch *n, pw_workspace *w, pw_scatter_map *t, pw_block block,
                          const pw_placement *put);

/* Add the J last evaluated, with constraint equations as rows, and J^T, with these as columns. */
void pw_newton_add_J (const pw_workspace *w, pw_scatter_map *t, const pw_placement *put);
void pw_newton_add_JT (const pw_workspace *w, pw_scatter_map *t, const pw_placement *put);

/* Adds -(derivative of the force by signals) x (derivative of signals by states): rows from `row` on, q in columns from
 * col_q on, v in columns from col_v on. */
void pw_newton_add_signals (pw_newton_scratch *n, pw_workspace *w, pw_scatter_map *t, int row, int col_q, int col_v);

#endif
