/* Dense LDL^T of up to 8 unknowns, unrolled for each size. */
#ifndef PW_LDL_SMALL_H
#define PW_LDL_SMALL_H

enum { PW_LDL_SMALL = 8 };

/* S: n x n row-major, lower triangle, overwritten by L below the diagonal and 1/D on it.  Returns the smallest pivot
 * relative to the diagonal entry it came from, and its place; stops at one that is not positive. */
double pw_ldl_small_factor (double *S, int n, int *place);

/* Solves in place. */
void pw_ldl_small_solve (const double *S, int n, double *y);

#endif
