/* The condensed matrix S = J W^-1 J^T (saddle.h) of a scene of few equations as a dense one.
 *
 * The rows of a body are listed once.  In the x and y columns of a pin J is the unit matrix or its negative (points.h),
 * so that the products of these columns are constant.  Rows that are not in S, those of massless coordinates
 * (saddle.c), may act on a body, too: their multipliers are known before, their products J a are needed after. */
#ifndef PW_DENSE_H
#define PW_DENSE_H

enum { PW_DENSE = 10 }; /* most equations */

/* A row that is not in S, in the columns of a group: J a is subtracted from *right. */
typedef struct {
  const double *J, *multiplier;
  double *right;
} pw_dense_known;

/* A body or an internal coordinate with the rows that have entries in its columns. */
typedef struct pw_dense_group {
  /* The group's part of S, y and, if it has known rows, a; its part of a.  See dense.c. */
  void (*add) (const struct pw_dense_group *p, const double *w, const double *f, double *S, double *y, double *a);
  void (*accelerate) (const struct pw_dense_group *p, const double *w, const double *f, const double *y, double *a);
  int j, width;                                    /* first coordinate; columns: 3, or 1 */
  int rows, pins;                                  /* rows; pins, whose pairs of rows come first */
  const double *J[PW_DENSE];                       /* of each row, its entries */
  unsigned char row[PW_DENSE];                     /* of each row, its number in S */
  unsigned char at[PW_DENSE * (PW_DENSE + 1) / 2]; /* index in S of each row with each row up to itself */
  int known_rows;
  const pw_dense_known *known;
} pw_dense_group;

/* A matrix of an odd number of rows, 3 or more, has one more, that of the unit matrix, with the unknown of the first
 * row, which is stored after it. */
typedef struct pw_dense {
  /* Factorises S with the J last evaluated, if `factors`, whatever the pivots are.  Then, unless y is NULL, y, which
   * holds gamma, becomes lambda, and a = W^-1 (f - J^T lambda).  f and a may be the same; f NULL: zero. */
  void (*run) (struct pw_dense *d, int factors, const double *f, double *y, double *a);
  int n, groups;                 /* rows; groups */
  int unknown[PW_DENSE];         /* of each row: index in lambda */
  double S[PW_DENSE * PW_DENSE]; /* n x n: what is constant; then the diagonal entry of the row that is one more */
  double L[PW_DENSE * PW_DENSE]; /* n x n: L below the diagonal, D^-1 on it */
  double pivot[PW_DENSE];        /* of each row: D over the diagonal entry of S */
  double least_pivot;            /* the smallest */
  const double *inverse_weight;  /* diagonal of W^-1, owned by the saddle */
  double *zero, *scratch;        /* coords each, one allocation */
  pw_dense_known *known;         /* of all groups */
  pw_dense_group group[];
} pw_dense;

/* Room for these numbers of groups and of known rows of all groups; NULL: out of memory.  Next come the unknowns, a row
 * more if their number is odd, the groups with their rows, those of pins first, and the known rows. */
pw_dense *pw_dense_new (int groups, int known, int coords, const double *inverse_weight);
void pw_dense_pad (pw_dense *d);
void pw_dense_add_group (pw_dense *d, int j, int width);
/* Adds rows `first` to first + size - 1 of S, or of a pin both, to the last group; J: entries of the first in the
 * group's columns; stride: from row to row of J. */
void pw_dense_add_rows (pw_dense *d, int is_pin, int first, int size, const double *J, int stride);
void pw_dense_open (pw_dense *d);  /* selects the functions for the rows and groups described */
void pw_dense_close (pw_dense *d); /* d may be NULL */

/* Index in lambda of the unknown of the smallest pivot. */
int pw_dense_least_unknown (const pw_dense *d);

#endif
