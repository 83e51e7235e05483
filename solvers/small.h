/* Small scenes.  The condensed matrix is dense, and up to 8 rows everything between J, f, gamma and a, lambda is one
 * straight piece of code, compiled for each number of rows; with more, rows are factorised from their first entry on.
 *
 * A panel holds the rows that touch a body (or an own coordinate): what they do to each other through it.  Rows are put
 * in an order in which those of a panel are neighbours; where that is not possible, the ones between read zeros or are
 * left out. */
#ifndef PW_SMALL_H
#define PW_SMALL_H

enum { PW_SMALL = 24, PW_SMALL_UNROLLED = 8 }; /* rows; up to the latter in straight code */

/* The most rows of a small scene; with 0, for tests, all are large ones. */
#ifndef PW_SMALL_MOST
#define PW_SMALL_MOST PW_SMALL
#endif

#define PW_SMALL_WATCH 0.01

typedef struct {
  const double *w;                 /* diagonal of W^-1 in its columns */
  double *S, *y;                   /* in those of all, the entries of its first row */
  int j, width;                    /* first coordinate, columns */
  int first, rows;                 /* first position, positions from there */
  int gaps;                        /* 1: not all of them are neighbours */
  unsigned shape;                  /* which columns its rows have, where that is compiled apart (small.c); else 0 */
  unsigned char columns[PW_SMALL]; /* of each row, as bits */
  unsigned char at[PW_SMALL];      /* how far behind the first each row is, if there are gaps */
  const double *J[PW_SMALL];       /* each row, at these columns */
} pw_panel;

typedef struct {
  int n;
  pw_panel *panel, *end;         /* one for every body and own coordinate with weight */
  int row[PW_SMALL];             /* of gamma and lambda, at each position */
  int begin[PW_SMALL];           /* the first column of each row of S that is not zero */
  double S[PW_SMALL * PW_SMALL]; /* n x n, its lower triangle */
  double L[PW_SMALL * PW_SMALL]; /* of L D L^T: L below the diagonal, D^-1 on it */
  double y[PW_SMALL];            /* right-hand side, then lambda, at each position */
  double guard;                  /* a pivot not above so much of its diagonal entry is taken for 0 */
  int low;                       /* 1: one was not above PW_SMALL_WATCH of it, so that it is worth asking */
} pw_small;

/* ---- Factorising and solving ---- */

/* S = J W^-1 J^T = L D L^T.  Returns 0 if a pivot is not above the guard: singular. */
int pw_small_factor (pw_small *k);

/* lambda, and a = W^-1 (f - J^T lambda).  f and a may be the same, gamma and lambda too; f NULL:
 * zero. */
void pw_small_solve (pw_small *k, const double *f, const double *gamma, double *a, double *lambda);

/* Both in one pass; a and lambda are left alone if it returns 0. */
int pw_small_both (pw_small *k, const double *f, const double *gamma, double *a, double *lambda);

/* The smallest pivot relative to the diagonal entry it came from, and its position. */
double pw_small_pivot (const pw_small *k, int *place);

#endif
