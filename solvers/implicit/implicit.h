/* What a method of our own with an implicit step works with: Newton's matrix and the last step. */
#ifndef PW_IMPLICIT_H
#define PW_IMPLICIT_H

#include "between.h"
#include "sparse.h"
#include "tangent.h"

typedef struct {
  pw_tangent tangent; /* its tape has recorded the matrix */
  pw_sparse sparse;   /* which solves with it */
  double *value;      /* of the matrix */
  pw_between last;
  char *memory; /* of the method's own arrays */
} pw_implicit;

/* Makes room for the matrix that was recorded, of this size.  PW_OK or PW_MACHINE. */
int pw_implicit_lay_out (pw_implicit *x, int size);
void pw_implicit_close (pw_implicit *x);

#endif
