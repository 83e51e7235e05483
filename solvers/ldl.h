/* Block LDL^T of a symmetric positive definite matrix whose pattern is fixed: nodes of 1 to 3 unknowns, ordered and
 * laid out once, factorised and solved many times without allocating. */
#ifndef PW_LDL_H
#define PW_LDL_H

#include "pinwheel.h"

enum { PW_LDL_NODE = 3 }; /* most unknowns in a node */

typedef struct pw_ldl pw_ldl;

/* nodes: how many; size: unknowns of each; pair: 2 x pairs node numbers with a block between them, each unordered pair
 * any number of times, the diagonal not needed.  Ordered by minimum degree (AMD: Amestoy, Davis & Duff 1996).
 * NULL with PW_MACHINE in the error if memory is out. */
pw_ldl *pw_ldl_open (int nodes, const int *size, long pairs, const int *pair, pw_error *error);
void pw_ldl_close (pw_ldl *l);

/* The values, to be zeroed and added into before each factorisation: the block of nodes i and j starts at `offset`, its
 * rows, `step` apart, being those of i, or of j if it is transposed.  Of diagonal blocks only the lower triangle is
 * read. */
typedef struct {
  int offset, step, transposed;
} pw_ldl_place;
double *pw_ldl_values (pw_ldl *l, size_t *count);
pw_ldl_place pw_ldl_block (const pw_ldl *l, int i, int j);

/* First position of node i in the right-hand side. */
int pw_ldl_position (const pw_ldl *l, int i);

/* Factorises in place.  Returns the smallest pivot relative to the diagonal entry it came from: the squared sine of
 * the angle between a row and those before it.  A value that is not positive means singular; then *node tells where. */
double pw_ldl_factor (pw_ldl *l, int *node);

/* Solves in place; y in the order of positions. */
void pw_ldl_solve (const pw_ldl *l, double *y);

#endif
