/* Small scenes: up to 8 rows.  The condensed matrix is dense, and everything between J, f, gamma and a, lambda is one
 * straight piece of code, compiled for each number of rows.
 *
 * A panel holds the rows that touch a body (or an own coordinate): what they do to each other through it. */
#ifndef PW_SMALL_H
#define PW_SMALL_H

enum { PW_SMALL = 8 };

typedef struct {
  int j, width, rows;         /* first coordinate, columns, rows that touch them */
  int shape;                  /* rows if there are 3 columns and at most 4 rows, else 0 */
  int y[PW_SMALL];            /* position of each row, ascending */
  const double *J[PW_SMALL];  /* each row, at these columns */
} pw_panel;

typedef struct {
  int n, panels;
  pw_panel *panel;            /* one for every body and own coordinate */
  const double *inverse;      /* diagonal of W^-1 */
  double L[PW_SMALL * PW_SMALL]; /* of L D L^T: L below the diagonal, D^-1 on it */
  double pivot;               /* smallest pivot relative to the diagonal entry it came from */
  int place;                  /* its position */
} pw_small;

/* S = J W^-1 J^T = L D L^T; stops at a pivot that is not positive. */
void pw_small_factor (pw_small *k);

/* y, which holds -gamma, becomes lambda; a = W^-1 (f - J^T lambda).  f and a may be the same; f NULL: zero. */
void pw_small_solve (const pw_small *k, const double *f, double *y, double *a);

/* Both in one pass. */
void pw_small_both (pw_small *k, const double *f, double *y, double *a);

#endif
