/* Eigenvalues of a small dense matrix, and its relatives. */
#ifndef PW_EIGEN_H
#define PW_EIGEN_H

/* The n eigenvalues re + i im of a real n x n matrix A (row-major, destroyed), fastest (largest) first; of a conjugate
 * pair the one with im > 0 comes first.  PW_OK, or PW_RETRY if the iteration does not converge or A is not finite. */
int pw_eigenvalues (int n, double *A, double *re, double *im);

/* The singular values of n vectors of length m, one behind the other (destroyed), in no order. */
void pw_singular_values (int n, int m, double *vector, double *sigma);

#endif
