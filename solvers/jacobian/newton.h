/* Assembles the second-order blocks of a scene into a sparse matrix; shared by the Newton matrices of implicit
 * methods. */
#ifndef PW_NEWTON_H
#define PW_NEWTON_H

#include "system.h"
#include "scatter.h"

/* Scratch for the blocks of one system. */
typedef struct {
  double *block; /* largest count x rows x cols of any batch */
  double *w;     /* largest count x cols */
} pw_newton;

int pw_newton_open (pw_newton *n, const pw_system *s); /* PW_OK or PW_RESOURCE */
void pw_newton_close (pw_newton *n);

/* Where a block is added, and how: factor x block of every batch, rows from `row` on (constraint equations or
 * coordinates; row_scale, if given, multiplies each), columns from `col` on.  w: direction of jw_q (coords); lambda:
 * multipliers of jtl_q (rows); `rows`: number of constraint equations included. */
typedef struct {
  int row, col, rows;
  double factor; /* of holonomic equations, and of coordinates */
  double factor_nonholonomic;
  const double *row_scale;
  const int *map; /* rows: index of each constraint row in the matrix, or -1: omitted; NULL: unchanged indices */
  const double *w, *lambda;
} pw_placement;
void pw_newton_block (pw_newton *n, pw_workspace *w, pw_scatter_map *t, pw_block block, const pw_placement *put);

/* Adds factor x J, or `transposed`, with the J last evaluated. */
void pw_newton_J (const pw_workspace *w, pw_scatter_map *t, int transposed, const pw_placement *put);

/* Adds -(derivative of the force by signals) x (derivative of signals by states): rows from `row` on, q in columns from
 * `col` on, v in columns from `col_v` on. */
void pw_newton_signals (pw_newton *n, pw_workspace *w, pw_scatter_map *t, int row, int col, int col_v);

#endif
