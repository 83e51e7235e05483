/* Sparse factorisations by KLU; see sparse.h. */
#include "pinwheel.h"
#include "sparse.h"

struct pw_sparse_field {
  klu_l_numeric *(*factor) (int64_t *, int64_t *, double *, klu_l_symbolic *, klu_l_common *);
  int64_t (*refactor) (int64_t *, int64_t *, double *, klu_l_symbolic *, klu_l_numeric *, klu_l_common *);
  int64_t (*rcond) (klu_l_symbolic *, klu_l_numeric *, klu_l_common *);
  int64_t (*solve) (klu_l_symbolic *, klu_l_numeric *, int64_t, int64_t, double *, klu_l_common *);
  int64_t (*release) (klu_l_numeric **, klu_l_common *);
};
static const struct pw_sparse_field sparse_real = { klu_l_factor, klu_l_refactor, klu_l_rcond, klu_l_solve,
                                                    klu_l_free_numeric };
static const struct pw_sparse_field sparse_complex = { klu_zl_factor, klu_zl_refactor, klu_zl_rcond, klu_zl_solve,
                                                       klu_zl_free_numeric };

int pw_sparse_open (pw_sparse *k, int complex, int n, int64_t *colptr, int64_t *rowind) {
  *k = (pw_sparse){ .field = complex ? &sparse_complex : &sparse_real, .colptr = colptr, .rowind = rowind };
  if (!klu_l_defaults (&k->common)) return PW_RESOURCE;
  k->order = klu_l_analyze (n, colptr, rowind, &k->common);
  return k->order ? PW_OK : PW_RESOURCE;
}

void pw_sparse_forget (pw_sparse *k) {
  if (k->factors) k->field->release (&k->factors, &k->common);
}

void pw_sparse_close (pw_sparse *k) {
  pw_sparse_forget (k);
  if (k->order) klu_l_free_symbolic (&k->order, &k->common);
}

/* Refactorises with the present pivots, if they are still good. */
static int sparse_refactor (pw_sparse *k, double *value) {
  if (k->factors == NULL) return 0;
  if (!k->field->refactor (k->colptr, k->rowind, value, k->order, k->factors, &k->common)) return 0;
  return k->field->rcond (k->order, k->factors, &k->common) && k->common.rcond > k->least;
}

int pw_sparse_factor (pw_sparse *k, double *value) {
  if (sparse_refactor (k, value)) return PW_OK;
  pw_sparse_forget (k);
  k->factors = k->field->factor (k->colptr, k->rowind, value, k->order, &k->common);
  if (k->factors == NULL) return k->common.status == KLU_OUT_OF_MEMORY ? PW_RESOURCE : PW_INPUT;
  if (!k->field->rcond (k->order, k->factors, &k->common)) return PW_RESOURCE;
  k->least = 0.01 * k->common.rcond; /* two digits may be lost */
  return k->common.rcond > 0 ? PW_OK : PW_INPUT;
}

int pw_sparse_solve (pw_sparse *k, double *x) {
  return k->field->solve (k->order, k->factors, k->order->n, 1, x, &k->common) ? PW_OK : PW_RESOURCE;
}
