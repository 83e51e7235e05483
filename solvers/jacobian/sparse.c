/* Sparse factorisations by KLU; see sparse.h. */
#include "pinwheel.h"
#include "sparse.h"

struct pw_klu_functions {
  klu_l_numeric *(*factor) (int64_t *, int64_t *, double *, klu_l_symbolic *, klu_l_common *);
  int64_t (*refactor) (int64_t *, int64_t *, double *, klu_l_symbolic *, klu_l_numeric *, klu_l_common *);
  int64_t (*rcond) (klu_l_symbolic *, klu_l_numeric *, klu_l_common *);
  int64_t (*solve) (klu_l_symbolic *, klu_l_numeric *, int64_t, int64_t, double *, klu_l_common *);
  int64_t (*release) (klu_l_numeric **, klu_l_common *);
};
static const struct pw_klu_functions sparse_functions[] = {
  [PW_SPARSE_REAL] = { klu_l_factor, klu_l_refactor, klu_l_rcond, klu_l_solve, klu_l_free_numeric },
  [PW_SPARSE_COMPLEX] = { klu_zl_factor, klu_zl_refactor, klu_zl_rcond, klu_zl_solve, klu_zl_free_numeric }
};

int pw_sparse_open (pw_sparse *x, pw_sparse_numbers numbers, int n, int64_t *colptr, int64_t *rowind) {
  *x = (pw_sparse){ .klu = &sparse_functions[numbers], .colptr = colptr, .rowind = rowind };
  if (!klu_l_defaults (&x->common)) return PW_RESOURCE;
  x->symbolic = klu_l_analyze (n, colptr, rowind, &x->common);
  return x->symbolic ? PW_OK : PW_RESOURCE;
}

void pw_sparse_forget_pivots (pw_sparse *x) {
  if (x->factors) x->klu->release (&x->factors, &x->common);
}

void pw_sparse_close (pw_sparse *x) {
  pw_sparse_forget_pivots (x);
  if (x->symbolic) klu_l_free_symbolic (&x->symbolic, &x->common);
}

/* Factorises with the previous pivots; returns 0 if there are none, or if they have become inaccurate. */
static int sparse_refactor (pw_sparse *x, double *value) {
  if (x->factors == NULL) return 0;
  if (!x->klu->refactor (x->colptr, x->rowind, value, x->symbolic, x->factors, &x->common)) return 0;
  return x->klu->rcond (x->symbolic, x->factors, &x->common) && x->common.rcond > x->least_rcond;
}

int pw_sparse_factor (pw_sparse *x, double *value) {
  if (sparse_refactor (x, value)) return PW_OK;
  pw_sparse_forget_pivots (x);
  x->factors = x->klu->factor (x->colptr, x->rowind, value, x->symbolic, &x->common);
  if (x->factors == NULL) return x->common.status == KLU_OUT_OF_MEMORY ? PW_RESOURCE : PW_INPUT;
  if (!x->klu->rcond (x->symbolic, x->factors, &x->common)) return PW_RESOURCE;
  x->least_rcond = 0.01 * x->common.rcond; /* two digits may be lost */
  return x->common.rcond > 0 ? PW_OK : PW_INPUT;
}

int pw_sparse_solve (pw_sparse *x, double *right) {
  return x->klu->solve (x->symbolic, x->factors, x->symbolic->n, 1, right, &x->common) ? PW_OK : PW_RESOURCE;
}
