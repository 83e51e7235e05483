/* Sparse factorisations by KLU; see sparse.h. */
#include <amd.h>
#include <math.h>
#include <stdlib.h>
#include "sparse.h"
#include "util.h"

/* Unknowns from which on they are ordered in pairs: in smaller matrices KLU's own order is as good. */
enum { SPARSE_PAIRED = 100 };

/* A function of KLU for the numbers of x. */
#define SPARSE_KLU(x, function, ...) \
  ((x)->numbers == PW_SPARSE_REAL ? klu_l_##function (__VA_ARGS__) : klu_zl_##function (__VA_ARGS__))

int pw_sparse_open (pw_sparse *x, pw_sparse_numbers numbers, int n, int64_t *colptr, int64_t *rowind) {
  *x = (pw_sparse){ .numbers = numbers, .n = n, .colptr = colptr, .rowind = rowind };
  if (!klu_l_defaults (&x->common)) return PW_RESOURCE;
  if (n >= SPARSE_PAIRED) {
    x->common.btf = 0; /* its permutation of the rows would separate the pairs */
    return PW_OK;
  }
  x->symbolic = klu_l_analyze (n, colptr, rowind, &x->common);
  return x->symbolic ? PW_OK : PW_RESOURCE;
}

/* Minimum degree presumes that the pivots are those of the diagonal.  Unknowns without a diagonal entry, such as
 * multipliers, have none until unknowns coupled with them are eliminated.  Each is paired with that one whose entries
 * in its row and in its column are largest, and eliminated right after it (Duff & Pralet 2005, Strategies for scaling
 * and pivoting for sparse symmetric indefinite problems). */

/* The size of an entry; -1 if it is not in the pattern. */
static double sparse_size (const pw_sparse *x, const double *value, int64_t row, int64_t col) {
  for (int64_t i = x->colptr[col]; i < x->colptr[col + 1]; i++)
    if (x->rowind[i] == row)
      return x->numbers == PW_SPARSE_REAL ? fabs (value[i]) : fabs (value[2 * i]) + fabs (value[2 * i + 1]);
  return -1;
}

/* partner: of each unknown, the other one of its pair, or -1. */
static void sparse_pair (const pw_sparse *x, const double *value, int64_t *partner) {
  for (int64_t i = 0; i < x->n; i++) partner[i] = -1;
  for (int64_t i = 0; i < x->n; i++) {
    double largest = 0;
    if (sparse_size (x, value, i, i) >= 0) continue;
    for (int64_t k = x->colptr[i]; k < x->colptr[i + 1]; k++) {
      const int64_t j = x->rowind[k];
      if (partner[j] >= 0 || sparse_size (x, value, j, j) < 0) continue;
      double size = sparse_size (x, value, i, j) * sparse_size (x, value, j, i);
      if (size > largest) largest = size, partner[i] = j;
    }
    if (partner[i] >= 0) partner[partner[i]] = i;
  }
}

/* Orders the pairs and the other unknowns, here nodes, by approximate minimum degree (AMD). */
static int sparse_analyse (pw_sparse *x, const double *value) {
  const size_t n = (size_t)x->n + 1;
  int64_t *partner, *node, *member, *first, *order, *list, nodes = 0, count = 0, *memory;
  memory = partner = malloc ((5 * n + (size_t)x->colptr[x->n]) * sizeof *memory);
  if (memory == NULL) return PW_RESOURCE;
  node = partner + n, member = node + n, first = member + n, order = first + n, list = order + n;
  sparse_pair (x, value, partner);
  for (int64_t i = 0; i < x->n; i++) {
    if (partner[i] >= 0 && sparse_size (x, value, i, i) < 0) continue; /* the second of a pair */
    if (partner[i] >= 0) node[partner[i]] = nodes;
    node[i] = nodes;
    member[nodes++] = i;
  }
  for (int64_t m = 0; m < nodes; m++) {
    first[m] = count;
    for (int64_t i = member[m]; i >= 0; i = i == member[m] ? partner[i] : -1)
      for (int64_t k = x->colptr[i]; k < x->colptr[i + 1]; k++) list[count++] = node[x->rowind[k]];
  }
  first[nodes] = count;
  const int ordered = amd_l_order (nodes, first, list, order, NULL, NULL) >= 0;
  count = 0;
  for (int64_t m = 0; ordered && m < nodes; m++) /* node is not needed any more */
    for (int64_t i = member[order[m]]; i >= 0; i = i == member[order[m]] ? partner[i] : -1) node[count++] = i;
  if (ordered) x->symbolic = klu_l_analyze_given (x->n, x->colptr, x->rowind, node, node, &x->common);
  free (memory);
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
  if (x->symbolic == NULL && sparse_analyse (x, value) != PW_OK) return PW_RESOURCE;
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
