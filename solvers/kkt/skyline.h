/* L D L^T of a symmetric matrix of n rows, kept in pairs from their first entry on.  Matrices are n x n, only their lower
 * triangles are used, of those only what lies within the skyline.  If n is odd the first row stands alone. */
#ifndef PW_SKYLINE_H
#define PW_SKYLINE_H

/* Widens a skyline, in which row i begins at column begin[i], to one that factors have room in. */
void pw_skyline_open (int *begin, int n);

/* L below the diagonal, D^-1 on it.  Returns 0 if a pivot is not above so much of its diagonal entry; if it is 0, what
 * comes after it is of no use. */
int pw_skyline_factor (const double *S, double *L, const int *begin, double least, int n);

/* y = (L D L^T)^-1 y */
void pw_skyline_solve (const double *L, const int *begin, double *y, int n);

#endif
