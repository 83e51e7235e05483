/* Scenes of few constraint equations: the condensed matrix S = J W^-1 J^T is dense.  All loops are unrolled: the
 * code is compiled for each number of equations. */
#ifndef PW_DENSE_H
#define PW_DENSE_H

/* The most equations of the dense path; tests set it to 0 so that all scenes take the sparse path. */
enum { PW_DENSE = 8 };
#ifndef PW_DENSE_MOST
#define PW_DENSE_MOST PW_DENSE
#endif

/* The constraint equations that touch a body, or an internal coordinate. */
typedef struct {
  const double *w;           /* diagonal of W^-1 in its columns */
  int j, width;              /* first coordinate; 3 columns of a body, 1 of an internal coordinate */
  int rows;                  /* equations */
  int at[PW_DENSE];          /* rows: their positions in S, ascending */
  const double *J[PW_DENSE]; /* rows: each equation's entries in these columns */
} pw_dense_block;

typedef struct {
  int n;
  pw_dense_block *block, *end;   /* one for each body and internal coordinate with weight */
  int row[PW_DENSE];             /* of gamma and lambda, at each position */
  double S[PW_DENSE * PW_DENSE]; /* n x n, its lower triangle */
  double L[PW_DENSE * PW_DENSE]; /* of L D L^T: L below the diagonal, D^-1 on it */
  double guard;                  /* a pivot of at most this part of its diagonal entry counts as 0 */
  int low;                       /* 1: a pivot was at most PW_DENSE_WATCH of its diagonal entry */
} pw_dense;

#define PW_DENSE_WATCH 0.01

/* S = J W^-1 J^T = L D L^T.  Returns 0 if a pivot is not above the guard: singular. */
int pw_dense_factor (pw_dense *k);

/* lambda, and a = W^-1 (f - J^T lambda).  f and a may be the same, gamma and lambda too; f NULL: zero. */
void pw_dense_solve (const pw_dense *k, const double *f, const double *gamma, double *a, double *lambda);

/* The smallest pivot relative to the diagonal entry it came from, at most 1, and its position, or -1. */
double pw_dense_pivot (const pw_dense *k, int *place);

#endif
