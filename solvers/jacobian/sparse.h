/* A square sparse matrix, real or complex, factorised again and again (KLU: Davis & Palamadai Natarajan 2010): ordered
 * once, its pivots kept while they are good.  Complex numbers are pairs of doubles. */
#ifndef PW_SPARSE_H
#define PW_SPARSE_H

#include <stdint.h>
#include <klu.h>

typedef struct {
  const struct pw_sparse_field *field; /* KLU's functions for real or complex numbers */
  klu_l_common common;
  klu_l_symbolic *order;
  klu_l_numeric *factors;
  int64_t *colptr, *rowind; /* the pattern, the caller's */
  double least;             /* ratio of pivots below which they are selected again */
} pw_sparse;

/* n columns in compressed form; complex: 1 for complex numbers.  PW_OK or PW_RESOURCE. */
int pw_sparse_open (pw_sparse *k, int complex, int n, int64_t *colptr, int64_t *rowind);
void pw_sparse_close (pw_sparse *k);

/* PW_OK, PW_INPUT if the matrix is singular, PW_RESOURCE. */
int pw_sparse_factor (pw_sparse *k, double *value);

/* The next factorisation chooses its pivots again. */
void pw_sparse_forget (pw_sparse *k);

/* x = A^-1 x.  PW_OK or PW_RESOURCE. */
int pw_sparse_solve (pw_sparse *k, double *x);

#endif
