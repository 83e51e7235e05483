/* Sparse factorisations by KLU; see sparse.h. */
#include "pinwheel.h"
#include "sparse.h"

/* A function of KLU for the numbers of x. */
#define SPARSE_KLU(x, function, ...) \
  ((x)->numbers == PW_SPARSE_REAL ? klu_l_##function (__VA_ARGS__) : klu_zl_##function (__VA_ARGS__))

int pw_sparse_open (pw_sparse *x, pw_sparse_numbers numbers, int n, int64_t *colptr, int64_t *rowind) {
  *x = (pw_sparse){ .numbers = numbers, .colptr = colptr, .rowind = rowind };
  if (!klu_l_defaults (&x->common)) return PW_RESOURCE;
  x->symbolic = klu_l_analyze (n, colptr, rowind, &x->common);
  return x->symbolic ? PW_OK : PW_RESOURCE;
}

void pw_sparse_forget_pivots (pw_sparse *x) {
  if (x->factors) SPARSE_KLU (x, free_numeric, &x->factors, &x->common);
}

void pw_sparse_close (pw_sparse *x) {
  pw_sparse_forget_pivots (x);
  if (x->symbolic) klu_l_free_symbolic (&x->symbolic, &x->common);
}

/* Factorises with the previous pivots; returns 0 if there are none, or if they have become inaccurate. */
static int sparse_refactor (pw_sparse *x, double *value) {
  if (x->factors == NULL) return 0;
  if (!SPARSE_KLU (x, refactor, x->colptr, x->rowind, value, x->symbolic, x->factors, &x->common)) return 0;
  return SPARSE_KLU (x, rcond, x->symbolic, x->factors, &x->common) && x->common.rcond > x->least_pivot_ratio;
}

int pw_sparse_factor (pw_sparse *x, double *value) {
  if (sparse_refactor (x, value)) return PW_OK;
  pw_sparse_forget_pivots (x);
  x->factors = SPARSE_KLU (x, factor, x->colptr, x->rowind, value, x->symbolic, &x->common);
  if (x->factors == NULL) return x->common.status == KLU_SINGULAR ? PW_SINGULAR : PW_RESOURCE;
  if (!SPARSE_KLU (x, rcond, x->symbolic, x->factors, &x->common)) return PW_RESOURCE;
  x->least_pivot_ratio = 0.01 * x->common.rcond; /* two digits may be lost */
  return x->common.rcond > 0 ? PW_OK : PW_SINGULAR;
}

int pw_sparse_solve (pw_sparse *x, double *right) {
  return SPARSE_KLU (x, solve, x->symbolic, x->factors, x->symbolic->n, 1, right, &x->common) ? PW_OK : PW_RESOURCE;
}
