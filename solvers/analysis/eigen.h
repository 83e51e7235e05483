/* Eigenvalues of a small dense matrix, and its relatives. */
#ifndef PW_EIGEN_H
#define PW_EIGEN_H

/* Scales row i by 1 / f and column i by f, a power of 2, until both are about as large; the eigenvalues stay. */
void pw_eigen_balance (int n, double *A);

/* The n eigenvalues re + i im of a real n x n matrix A (row-major, destroyed), conjugate pairs side by side, that with im > 0
 * first.  PW_OK, or PW_RETRY if the iteration does not converge or A is not finite. */
int pw_eigenvalues (int n, double *A, double *re, double *im);

/* The singular values of n vectors of length m, one behind the other (destroyed), in no order. */
void pw_singular_values (int n, int m, double *vector, double *sigma);

#endif
