/* Scenes of few constraint equations: the condensed matrix S = J W^-1 J^T is dense.  Up to PW_SMALL_UNROLLED equations
 * everything between J, f, gamma and a, lambda is one straight piece of code, compiled for each number of equations; beyond
 * that, equations are factorised from their first entry on (skyline.h). */
#ifndef PW_SMALL_H
#define PW_SMALL_H

enum { PW_SMALL = 24, PW_SMALL_UNROLLED = 8 }; /* equations; up to the latter in straight code */

/* The most equations of a small scene; tests set it to 0 so that all scenes take the sparse path. */
#ifndef PW_SMALL_MOST
#define PW_SMALL_MOST PW_SMALL
#endif

#define PW_SMALL_WATCH 0.01

/* The constraint equations that touch a body, or an internal coordinate. */
typedef struct {
  const double *w;           /* diagonal of W^-1 in its columns */
  int j, width;              /* first coordinate; 3 columns of a body, 1 of an internal coordinate */
  int rows;                  /* equations */
  int at[PW_SMALL];          /* rows: their positions in S, ascending */
  const double *J[PW_SMALL]; /* rows: each equation's entries in these columns */
} pw_body_block;

typedef struct {
  int n;
  pw_body_block *block, *end;    /* one for each body and internal coordinate with weight */
  int row[PW_SMALL];             /* of gamma and lambda, at each position */
  int begin[PW_SMALL];           /* the skyline: the first column of each row of S */
  double S[PW_SMALL * PW_SMALL]; /* n x n, its lower triangle */
  double L[PW_SMALL * PW_SMALL]; /* of L D L^T: L below the diagonal, D^-1 on it */
  double y[PW_SMALL];            /* right-hand side, then lambda, at each position */
  double guard;                  /* a pivot of at most this part of its diagonal entry counts as 0 */
  int low; /* 1: a pivot was at most PW_SMALL_WATCH of it, so that pw_small_pivot is worth its time */
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
