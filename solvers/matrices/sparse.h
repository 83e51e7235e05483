/* A square sparse matrix, real or complex, that is factorised repeatedly (KLU: Davis & Palamadai Natarajan 2010,
 * Algorithm 907): its unknowns are ordered once, at the latest with the first values, its pivots kept while they remain
 * accurate.  Row i belongs to unknown i: their common entry, if there is one, is the preferred pivot. */
#ifndef PW_SPARSE_H
#define PW_SPARSE_H

#include <stdint.h>
#include <klu.h>

/* A status besides those of pinwheel.h: the matrix is singular; with another step size it may not be. */
enum { PW_SINGULAR = 3 };

/* Complex numbers are pairs of doubles. */
typedef enum { PW_SPARSE_REAL, PW_SPARSE_COMPLEX } pw_sparse_numbers;

typedef struct {
  pw_sparse_numbers numbers;
  int n;
  klu_l_common common;
  klu_l_symbolic *symbolic; /* NULL: not ordered yet */
  klu_l_numeric *factors;   /* NULL: none, or forgotten */
  int64_t *colptr, *rowind; /* the pattern, the caller's */
  double least_pivot_ratio; /* ratio of the least to the largest pivot (KLU) below which pivots are selected again */
} pw_sparse;

/* n columns in compressed form.  PW_OK or PW_RESOURCE. */
int pw_sparse_open (pw_sparse *x, pw_sparse_numbers numbers, int n, int64_t *colptr, int64_t *rowind);
void pw_sparse_close (pw_sparse *x);

/* value: the nonzeros in the order of rowind.  PW_OK, PW_SINGULAR, PW_RESOURCE. */
int pw_sparse_factor (pw_sparse *x, double *value);

/* The next factorisation selects its pivots again. */
void pw_sparse_forget_pivots (pw_sparse *x);

/* Solves A x = b; `right` contains b, then x.  PW_OK or PW_RESOURCE. */
int pw_sparse_solve (pw_sparse *x, double *right);

#endif
