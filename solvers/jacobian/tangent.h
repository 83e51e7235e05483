/* Adds derivatives of the equations of motion to a sparse matrix: for the linearisation, J and the second-order blocks
 * (system.h) of all elements; for the Newton matrices of implicit methods, the rows of these equations:
 *
 *   momentum        M a + J^T lambda - f
 *   accelerations   J a - gamma + 2 alpha (J v - eta) + beta^2 g   (nonholonomic: + alpha (J v - eta))
 *
 * with Baumgarte's alpha and beta.  Some methods have further multipliers mu, one for each of the first mu_count
 * active equations (dae.h). */
#ifndef PW_TANGENT_H
#define PW_TANGENT_H

#include "method.h"
#include "scatter.h"
#include "system.h"

typedef struct {
  pw_run *run;
  int rows, holonomic; /* active equations; holonomic ones */
  int *row_index;      /* all equations: index among the active ones, or -1 */
  int *row;            /* rows: index among all equations */
  double *lambda;      /* all equations: scratch for pw_tangent_expand */
  double *D;           /* coords: 1 for lengths, 1/L^2 for angles (dae.h) */
  double *block;       /* scratch: the largest block of a batch, or its force_u */
  double *direction;   /* scratch: the largest count x cols */
  pw_scatter_map scatter;
  char *memory;
} pw_tangent;

int pw_tangent_open (pw_tangent *x, pw_run *r); /* PW_OK or PW_RESOURCE; close it in every case */
void pw_tangent_close (pw_tangent *x);

/* ---- From values of the active equations to those of all, and back ---- */

/* Fills `all`, which is returned: multipliers of the first `count` active equations, 0 for the others. */
const double *pw_tangent_expand (const pw_tangent *x, const double *active, int count, double *all);
/* out (coords + 3) = J^T times the same multipliers, with the J last evaluated.  Overwrites x->lambda. */
void pw_tangent_multiply_JT (const pw_tangent *x, const double *active, int count, double *out);
/* Values of the first `count` active equations from those of all. */
void pw_tangent_compress (const pw_tangent *x, const double *all, int count, double *active);

/* ---- Adding to the matrix that `scatter` records or fills ---- */

/* Where and how a block is added.  Its rows are coordinates or constraint equations. */
typedef struct {
  int row, col;               /* row and column of the matrix for coordinate or equation 0 */
  int rows;                   /* constraint equations included: all, s->rows, or the holonomic ones, s->holonomic */
  double factor;              /* of blocks of forces and (J^T lambda)_q, and of what holonomic equations add */
  double factor_nonholonomic; /* of what nonholonomic equations add: to J, J^T, and blocks whose rows they are */
  const double *row_scale;    /* further factors, one for each row from `row` on; NULL: 1 */
  const int *row_index;       /* equations: new index of each, -1: omitted; NULL: indices do not change */
  const double *direction;    /* coordinates: w of the block (J w)_q; NULL for other blocks */
  const double *lambda;       /* equations: multipliers of the block (J^T lambda)_q; NULL for other blocks */
} pw_placement;

/* Adds a block of every batch, at the kinematics last updated. */
void pw_tangent_add_block (pw_tangent *x, pw_block block, const pw_placement *put);
/* Adds J^T, with the J last evaluated; its columns are constraint equations. */
void pw_tangent_add_JT (pw_tangent *x, const pw_placement *put);
/* Adds -(derivative of the force with respect to signals) x (derivative of signals with respect to states): rows from
 * `row` on, q in columns from col_q on, v in columns from col_v on. */
void pw_tangent_add_signals (pw_tangent *x, int row, int col_q, int col_v);

/* Adds a block whose rows are the active constraint equations, from a row and column on, times the factors `holonomic`
 * and `nonholonomic`; w: the vector of the block (J w)_q. */
void pw_tangent_add_equations (pw_tangent *x, pw_block block, int row, int col, const double *w, double holonomic,
                               double nonholonomic);
/* Adds in the same way the active rows of J: of all equations (rows = s->rows), or of the holonomic ones
 * (s->holonomic). */
void pw_tangent_add_J (pw_tangent *x, int rows, int row, int col, double holonomic, double nonholonomic);

/* Where the parts of the equations are in the matrix, and factors of derivatives. */
typedef struct {
  int momentum, constraint; /* first row of each */
  int q, v, a, lambda;      /* first column of each; a may share its columns with v */
  double a_factor;          /* of derivatives with respect to a */
  double lambda_factor;     /* of those with respect to lambda */
} pw_tangent_layout;

/* Add the rows of one part at the current configuration, where J is evaluated; lambda: all equations. */
void pw_tangent_add_momentum (pw_tangent *x, const pw_tangent_layout *to, const double *lambda);
void pw_tangent_add_accelerations (pw_tangent *x, const pw_tangent_layout *to, const double *v, const double *a);

#endif
