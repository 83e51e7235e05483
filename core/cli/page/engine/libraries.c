/* The functions of libraries that explicit methods call, for scenes small enough to run in a web page: AMD's
 * fill-reducing order, LAPACK's solution by a Cholesky factorisation, KLU's factorisation. */
#include <amd.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "pinwheel.h"
#include "sparse.h"

enum { LIBRARIES_NODES = 4000 }; /* of a graph, at most: it takes a byte for each pair of nodes */

/* Removes a node from a graph, given by its n x n adjacency matrix, and connects its neighbours with each other. */
static void eliminate (int n, unsigned char *edge, int node) {
  unsigned char *neighbour = edge + node * n;
  for (int i = 0; i < n; i++)
    if (neighbour[i])
      for (int j = 0; j < n; j++) edge[i * n + j] |= neighbour[j] && j != i;
  for (int i = 0; i < n; i++) neighbour[i] = edge[i * n + node] = 0;
}

static int degree (int n, const unsigned char *edge, int node) {
  int count = 0;
  for (int i = 0; i < n; i++) count += edge[node * n + i];
  return count;
}

/* The order of elimination by the minimum degree algorithm: always a node with the fewest neighbours. */
int amd_order (int n, const int Ap[], const int Ai[], int P[], double control[], double info[]) {
  (void)control, (void)info;
  unsigned char *edge = n <= LIBRARIES_NODES ? calloc ((size_t)n * (size_t)n + 1, 1) : NULL,
                *done = calloc ((size_t)n + 1, 1);
  for (int i = 0; edge && i < n; i++)
    for (int k = Ap[i]; k < Ap[i + 1]; k++) edge[i * n + Ai[k]] = edge[Ai[k] * n + i] = Ai[k] != i;
  for (int k = 0; edge && done && k < n; k++) {
    int best = -1, least = n + 1;
    for (int i = 0; i < n; i++)
      if (!done[i] && degree (n, edge, i) < least) least = degree (n, edge, best = i);
    eliminate (n, edge, P[k] = best);
    done[best] = 1;
  }
  int status = edge && done ? AMD_OK : AMD_OUT_OF_MEMORY;
  free (edge);
  free (done);
  return status;
}

/* Solves A x = b, A = U^T U, for the layout by columns, the upper triangle (uplo) and one right-hand side (nrhs). */
lapack_int LAPACKE_dposv_work (int layout, char uplo, lapack_int n, lapack_int nrhs, double *a, lapack_int lda,
                               double *b, lapack_int ldb) {
  (void)layout, (void)uplo, (void)nrhs, (void)ldb;
  for (int j = 0; j < n; j++)
    for (int i = 0; i <= j; i++) {
      double sum = a[i + j * lda];
      for (int k = 0; k < i; k++) sum -= a[k + i * lda] * a[k + j * lda];
      if (i == j && !(sum > 0)) return j + 1;
      a[i + j * lda] = i == j ? sqrt (sum) : sum / a[i + i * lda];
    }
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < i; k++) b[i] -= a[k + i * lda] * b[k];
    b[i] /= a[i + i * lda];
  }
  for (int i = n - 1; i >= 0; i--) {
    for (int k = i + 1; k < n; k++) b[i] -= a[i + k * lda] * b[k];
    b[i] /= a[i + i * lda];
  }
  return 0;
}

/* ---- Factorisation of a sparse matrix (sparse.h) as a dense one, by columns, with partial pivoting ---- */

int pw_sparse_open (pw_sparse *x, pw_sparse_numbers numbers, int n, int64_t *colptr, int64_t *rowind) {
  *x = (pw_sparse){ .numbers = numbers, .colptr = colptr, .rowind = rowind };
  x->symbolic = calloc (1, sizeof *x->symbolic);
  x->factors = n <= LIBRARIES_NODES ? calloc ((size_t)n * (size_t)(n + 1) + 1, sizeof (double)) : NULL;
  if (x->symbolic) x->symbolic->n = n;
  return x->symbolic && x->factors ? PW_OK : PW_RESOURCE;
}

void pw_sparse_close (pw_sparse *x) {
  free (x->symbolic);
  free (x->factors);
}

/* The factors, column by column, and after them the row of each pivot. */
int pw_sparse_factor (pw_sparse *x, double *value) {
  const int n = (int)x->symbolic->n;
  double *a = memset (x->factors, 0, (size_t)n * (size_t)(n + 1) * sizeof (double)), *row = a + n * n;
  for (int j = 0; j < n; j++)
    for (int64_t p = x->colptr[j]; p < x->colptr[j + 1]; p++) a[x->rowind[p] + j * n] = value[p];
  for (int k = 0; k < n; k++) {
    int best = k;
    for (int i = k + 1; i < n; i++)
      if (fabs (a[i + k * n]) > fabs (a[best + k * n])) best = i;
    if (!(fabs (a[best + k * n]) > 0)) return PW_SINGULAR;
    row[k] = best;
    for (int j = 0; j < n; j++) {
      const double swapped = a[best + j * n];
      a[best + j * n] = a[k + j * n], a[k + j * n] = swapped;
    }
    for (int i = k + 1; i < n; i++) a[i + k * n] /= a[k + k * n];
    for (int j = k + 1; j < n; j++)
      for (int i = k + 1; i < n && a[k + j * n] != 0; i++) a[i + j * n] -= a[i + k * n] * a[k + j * n];
  }
  return PW_OK;
}

int pw_sparse_solve (pw_sparse *x, double *right) {
  const int n = (int)x->symbolic->n;
  const double *a = (const double *)x->factors, *row = a + n * n;
  for (int k = 0; k < n; k++) {
    const int best = (int)row[k];
    const double swapped = right[best];
    right[best] = right[k], right[k] = swapped;
  }
  for (int k = 0; k < n; k++)
    for (int i = k + 1; i < n; i++) right[i] -= a[i + k * n] * right[k];
  for (int k = n - 1; k >= 0; k--) {
    right[k] /= a[k + k * n];
    for (int i = 0; i < k; i++) right[i] -= a[i + k * n] * right[k];
  }
  return PW_OK;
}
