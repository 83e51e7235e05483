/* What a method with an implicit step works with; see implicit.h. */
#include "implicit.h"
#include <stdlib.h>

int pw_implicit_lay_out (pw_implicit *x, int size) {
  pw_tangent *t = &x->tangent;
  if (pw_tape_lay_out (&t->tape, size, &t->colptr, &t->rowind) != PW_OK) return PW_MACHINE;
  x->value = malloc (((size_t)t->colptr[size] + 1) * sizeof *x->value);
  return x->value ? pw_sparse_open (&x->sparse, size, t->colptr, t->rowind) : PW_MACHINE;
}

void pw_implicit_close (pw_implicit *x) {
  pw_between_close (&x->last);
  pw_sparse_close (&x->sparse);
  pw_tangent_close (&x->tangent);
  free (x->value);
  free (x->memory);
}
