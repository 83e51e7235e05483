/* Sparse factorisations by KLU; see sparse.h. */
#include "pinwheel.h"
#include "sparse.h"

int pw_sparse_open (pw_sparse *k, int n, int64_t *colptr, int64_t *rowind) {
  *k = (pw_sparse){ .colptr = colptr, .rowind = rowind };
  if (!klu_l_defaults (&k->common)) return PW_RESOURCE;
  k->order = klu_l_analyze (n, colptr, rowind, &k->common);
  return k->order ? PW_OK : PW_RESOURCE;
}

void pw_sparse_close (pw_sparse *k) {
  pw_sparse_forget (k);
  if (k->order) klu_l_free_symbolic (&k->order, &k->common);
}

/* Refactorises with the present pivots, if they are still good. */
static int sparse_refactor (pw_sparse *k, double *value) {
  if (k->factors == NULL) return 0;
  if (!klu_l_refactor (k->colptr, k->rowind, value, k->order, k->factors, &k->common)) return 0;
  return klu_l_rcond (k->order, k->factors, &k->common) && k->common.rcond > k->least;
}

int pw_sparse_factor (pw_sparse *k, double *value) {
  if (sparse_refactor (k, value)) return PW_OK;
  pw_sparse_forget (k);
  k->factors = klu_l_factor (k->colptr, k->rowind, value, k->order, &k->common);
  if (k->factors == NULL) return k->common.status == KLU_OUT_OF_MEMORY ? PW_RESOURCE : PW_RETRY;
  if (!klu_l_rcond (k->order, k->factors, &k->common)) return PW_RESOURCE;
  k->least = 0.01 * k->common.rcond;
  return k->common.rcond > 0 ? PW_OK : PW_RETRY;
}

int pw_sparse_solve (pw_sparse *k, double *x) {
  return klu_l_solve (k->order, k->factors, k->order->n, 1, x, &k->common) ? PW_OK : PW_RESOURCE;
}
