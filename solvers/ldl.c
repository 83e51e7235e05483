/* Block LDL^T.
 *
 *   for each node j in order:  D = K_jj,  L_pj = K_pj D^-1,  K_pq -= L_pj K_qj^T  for all p >= q below j
 *
 * right-looking, with the place of every K_pq looked up when the pattern is laid out (Duff, Erisman & Reid 2017,
 * Direct Methods for Sparse Matrices, chapters 5 and 12).  D^-1 is kept explicitly: a node has at most 3 unknowns. */
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <amd.h>
#include "ldl.h"
#include "util.h"

struct pw_ldl {
  int nodes, unknowns;
  size_t count;     /* of values */  int *order;        /* node at each place in the order */
  int *place;       /* place of each node */
  int *size;        /* unknowns of the node at each place */
  int *position;    /* first unknown of the node at each place */
  size_t *diagonal; /* nodes: where the diagonal block is; those below follow it */
  int *first;       /* nodes + 1: range in `below` of each column */
  int *below;       /* places of the rows of L, ascending in each column */
  size_t *offset;   /* where each of these blocks is */
  size_t *target;   /* for column j, for p descending, q = 0 .. p: where K_pq is */
  double *value;    /* count */
  double *was;      /* unknowns: the diagonal before the factorisation */
  char *memory;
};

/* ---- Pattern ---- */

/* Lists of places: the pattern of each column, first of K, then of L. */
typedef struct {
  int *first, *list;
} ldl_lists;

static int ldl_compare (const void *a, const void *b) {
  int x = *(const int *)a, y = *(const int *)b;
  return (x > y) - (x < y);
}

/* Sorted lists without repetition of the rows of each column, from pairs; `place` renumbers and may be NULL; `lower`
 * keeps rows below the diagonal only.  The lists are allocated here. */
static int ldl_collect (int nodes, long pairs, const int *pair, const int *place, int lower, ldl_lists *lists) {
  int *first = lists->first = calloc ((size_t)nodes + 2, sizeof (int));
  int *list = lists->list = malloc ((size_t)(2 * pairs + 1) * sizeof (int));
  if (first == NULL || list == NULL) return PW_MACHINE;
  for (int pass = 0; pass < 2; pass++) { /* counts column c in first[c + 2], then fills through first[c + 1] */
    for (long i = 0; i < 2 * pairs; i++) {
      int c = pair[i], r = pair[i ^ 1];
      if (place) c = place[c], r = place[r];
      if (c == r || (lower && r < c)) continue;
      if (pass == 0)
        first[c + 2]++;
      else
        list[first[c + 1]++] = r;
    }
    for (int c = 0; pass == 0 && c < nodes; c++) first[c + 2] += first[c + 1];
  }
  int to = 0, from = 0;
  for (int c = 0; c < nodes; c++) {
    int end = first[c + 1], previous = -1;
    qsort (list + from, (size_t)(end - from), sizeof (int), ldl_compare);
    first[c] = to;
    for (int i = from; i < end; i++)
      if (list[i] != previous) list[to++] = previous = list[i];
    from = end;
  }
  first[nodes] = to;
  return PW_OK;
}

static void ldl_lists_close (ldl_lists *l) {
  free (l->first);
  free (l->list);
  l->first = l->list = NULL;
}

/* Minimum degree order of the nodes' graph. */
static int ldl_order (int nodes, long pairs, const int *pair, int *order) {
  ldl_lists graph = { NULL, NULL };
  int status = ldl_collect (nodes, pairs, pair, NULL, 0, &graph);
  if (status == PW_OK && nodes > 0 && amd_order (nodes, graph.first, graph.list, order, NULL, NULL) < 0)
    status = PW_MACHINE;
  ldl_lists_close (&graph);
  return status;
}

/* Columns of L: those of K, and those of the children in the elimination tree without the child's parent.  Runs twice
 * by its caller: without `out` it counts. */
static int ldl_fill (int nodes, const ldl_lists *K, ldl_lists *L, size_t *targets) {
  size_t room = (size_t)K->first[nodes] + 16, used = 0;
  int *mark = malloc (((size_t)nodes + 1) * sizeof *mark), *child = malloc (((size_t)nodes + 1) * sizeof *child),
      *sibling = malloc (((size_t)nodes + 1) * sizeof *sibling);
  L->first = malloc (((size_t)nodes + 1) * sizeof *L->first);
  L->list = malloc (room * sizeof *L->list);
  int status = mark && child && sibling && L->first && L->list ? PW_OK : PW_MACHINE;
  for (int j = 0; j < nodes && status == PW_OK; j++) mark[j] = child[j] = -1;
  *targets = 0;
  if (status == PW_OK) L->first[0] = 0; /* also without any node */
  for (int j = 0; j < nodes && status == PW_OK; j++) {
    size_t most = (size_t)(K->first[j + 1] - K->first[j]);
    for (int c = child[j]; c >= 0; c = sibling[c]) most += (size_t)(L->first[c + 1] - L->first[c]);
    if (used + most > room) {
      room = 2 * room + most;
      int *more = realloc (L->list, room * sizeof *more);
      if (more == NULL) {
        status = PW_MACHINE;
        break;
      }
      L->list = more;
    }
    L->first[j] = (int)used;
    mark[j] = j;
    for (int i = K->first[j]; i < K->first[j + 1]; i++) mark[L->list[used++] = K->list[i]] = j;
    for (int c = child[j]; c >= 0; c = sibling[c])
      for (int i = L->first[c]; i < L->first[c + 1]; i++)
        if (mark[L->list[i]] != j) mark[L->list[used++] = L->list[i]] = j;
    size_t n = used - (size_t)L->first[j];
    L->first[j + 1] = (int)used;
    if (n == 0) continue;
    qsort (L->list + L->first[j], n, sizeof (int), ldl_compare);
    *targets += n * (n + 1) / 2;
    int parent = L->list[L->first[j]];
    sibling[j] = child[parent];
    child[parent] = j;
  }
  free (mark);
  free (child);
  free (sibling);
  return status;
}

/* ---- Layout ---- */

/* Where K_pq is, p >= q places. */
static size_t ldl_find (const pw_ldl *l, int p, int q) {
  if (p == q) return l->diagonal[p];
  int low = l->first[q], high = l->first[q + 1] - 1;
  while (low < high) {
    int middle = (low + high) / 2;
    if (l->below[middle] < p)
      low = middle + 1;
    else
      high = middle;
  }
  return l->offset[low];
}

static void ldl_place_blocks (pw_ldl *l) {
  size_t at = 0;
  for (int j = 0; j < l->nodes; j++) {
    l->diagonal[j] = at;
    at += (size_t)(l->size[j] * l->size[j]);
    for (int i = l->first[j]; i < l->first[j + 1]; i++) {
      l->offset[i] = at;
      at += (size_t)(l->size[l->below[i]] * l->size[j]);
    }
  }
  l->count = at;
  size_t *target = l->target;
  for (int j = 0; j < l->nodes; j++)
    for (int p = l->first[j + 1] - 1; p >= l->first[j]; p--)
      for (int q = l->first[j]; q <= p; q++) *target++ = ldl_find (l, l->below[p], l->below[q]);
}

static int ldl_lay_out (pw_ldl *l, const int *size, const int *order, const ldl_lists *L, size_t targets) {
  size_t n = (size_t)l->nodes, below = (size_t)L->first[l->nodes], values = 0, unknowns = 0;
  for (size_t j = 0; j < n; j++) {
    int k = size[order[j]];
    unknowns += (size_t)k;
    values += (size_t)(k * k);
    for (int i = L->first[j]; i < L->first[j + 1]; i++) values += (size_t)(k * size[order[L->list[i]]]);
  }  pw_layout lay = { NULL, 0 };
  for (int pass = 0; pass < 2; pass++) {
    l->order = pw_take (&lay, n, sizeof (int));
    l->place = pw_take (&lay, n, sizeof (int));
    l->size = pw_take (&lay, n, sizeof (int));
    l->position = pw_take (&lay, n + 1, sizeof (int));
    l->diagonal = pw_take (&lay, n, sizeof (size_t));
    l->first = pw_take (&lay, n + 1, sizeof (int));
    l->below = pw_take (&lay, below, sizeof (int));
    l->offset = pw_take (&lay, below, sizeof (size_t));
    l->target = pw_take (&lay, targets, sizeof (size_t));
    l->value = pw_take (&lay, values, sizeof (double));
    l->was = pw_take (&lay, unknowns, sizeof (double));
    if (pass == 1) break;
    l->memory = malloc (lay.used + 1);
    if (l->memory == NULL) return PW_MACHINE;
    lay = (pw_layout){ l->memory, 0 };
  }
  memcpy (l->first, L->first, (n + 1) * sizeof (int));
  memcpy (l->below, L->list, below * sizeof (int));
  l->unknowns = 0;
  for (int j = 0; j < l->nodes; j++) {
    l->order[j] = order[j];
    l->place[order[j]] = j;
    l->size[j] = size[order[j]];
    l->position[j] = l->unknowns;
    l->unknowns += l->size[j];
  }  ldl_place_blocks (l);
  return PW_OK;
}

pw_ldl *pw_ldl_open (int nodes, const int *size, long pairs, const int *pair, pw_error *error) {
  pw_ldl *l = calloc (1, sizeof *l);
  int *order = malloc (((size_t)nodes + 1) * sizeof *order), *place = malloc (((size_t)nodes + 1) * sizeof *place);
  ldl_lists K = { NULL, NULL }, L = { NULL, NULL };
  size_t targets;
  int status = l && order && place ? ldl_order (nodes, pairs, pair, order) : PW_MACHINE;
  if (status == PW_OK) {
    l->nodes = nodes;
    for (int j = 0; j < nodes; j++) place[order[j]] = j;
    status = ldl_collect (nodes, pairs, pair, place, 1, &K);
  }
  if (status == PW_OK) status = ldl_fill (nodes, &K, &L, &targets);
  if (status == PW_OK) status = ldl_lay_out (l, size, order, &L, targets);
  ldl_lists_close (&K);
  ldl_lists_close (&L);
  free (order);
  free (place);
  if (status == PW_OK) return l;
  pw_ldl_close (l);
  pw_fail (error, PW_MACHINE, "out of memory for the factorisation of %d constraints", nodes);
  return NULL;
}

void pw_ldl_close (pw_ldl *l) {
  if (l) free (l->memory);
  free (l);
}

double *pw_ldl_values (pw_ldl *l, size_t *count) {
  *count = l->count;
  return l->value;
}

pw_ldl_place pw_ldl_block (const pw_ldl *l, int i, int j) {
  int p = l->place[i], q = l->place[j], transposed = p < q;
  if (transposed) {
    int swap = p;
    p = q;
    q = swap;
  }
  return (pw_ldl_place){ (int)ldl_find (l, p, q), l->size[q], transposed };
}
int pw_ldl_position (const pw_ldl *l, int i) {
  return l->position[l->place[i]];
}

/* ---- Numbers ---- */

/* The smaller one, or what is not a number. */
static inline double ldl_least (double a, double b) {
  return a < b || a != a ? a : b;
}

/* Inverts a diagonal block in place; the worst pivot relative to `was`, the diagonal before the factorisation. */
static inline double ldl_invert (double *D, int k, const double *was) {
  if (k == 1) {
    double ratio = D[0] / was[0];
    D[0] = 1 / D[0];
    return ratio;
  }
  if (k == 2) {
    double a = D[0], b = D[2], c = D[3], determinant = a * c - b * b, f = 1 / determinant;
    D[0] = c * f, D[1] = D[2] = -b * f, D[3] = a * f;
    return ldl_least (a / was[0], determinant / (a * was[1]));
  }
  double a = D[0], b = D[3], c = D[4], d = D[6], e = D[7], g = D[8];
  double A = c * g - e * e, B = d * e - b * g, C = b * e - c * d, minor = a * c - b * b;
  double determinant = a * A + b * B + d * C, f = 1 / determinant;
  D[0] = A * f, D[1] = D[3] = B * f, D[2] = D[6] = C * f;
  D[4] = (a * g - d * d) * f, D[5] = D[7] = (b * d - a * e) * f, D[8] = minor * f;
  return ldl_least (ldl_least (a / was[0], minor / (a * was[1])), determinant / (minor * was[2]));
}

/* Sizes are constants where these are called, so that the loops vanish. */
#if defined(__GNUC__) && !defined(__clang__)
#define LDL_UNROLL _Pragma ("GCC unroll 3")
#else
#define LDL_UNROLL
#endif

/* T -= L A^T: L ki x kj, A kq x kj, T ki x kq. */
static inline void ldl_subtract (double *T, const double *L, const double *A, int ki, int kq, int kj) {
  LDL_UNROLL for (int i = 0; i < ki; i++) {
    LDL_UNROLL for (int q = 0; q < kq; q++) {
      double sum = L[i * kj] * A[q * kj];
      LDL_UNROLL for (int j = 1; j < kj; j++) sum += L[i * kj + j] * A[q * kj + j];
      T[i * kq + q] -= sum;
    }
  }
}

/* L = A D^-1: A ki x kj. */
static inline void ldl_scale (double *L, const double *A, const double *D, int ki, int kj) {
  LDL_UNROLL for (int i = 0; i < ki; i++) {
    LDL_UNROLL for (int j = 0; j < kj; j++) {
      double sum = A[i * kj] * D[j];
      LDL_UNROLL for (int k = 1; k < kj; k++) sum += A[i * kj + k] * D[k * kj + j];
      L[i * kj + j] = sum;
    }
  }
}

/* One block row of a column: L_p = A_p D^-1 in place, after K_pq -= L_p A_q^T for all q <= p. */
static inline const size_t *ldl_row (const pw_ldl *l, int first, int p, const double *D, int ki, int kj, const size_t *target) {
  double *value = l->value, *A = value + l->offset[p], L[PW_LDL_NODE * PW_LDL_NODE];
  ldl_scale (L, A, D, ki, kj);
  for (int q = first; q <= p; q++) {
    double *T = value + *target++;
    const double *B = value + l->offset[q];
    int kq = l->size[l->below[q]];
    if (kq == 2)
      ldl_subtract (T, L, B, ki, 2, kj);
    else if (kq == 1)
      ldl_subtract (T, L, B, ki, 1, kj);
    else
      ldl_subtract (T, L, B, ki, 3, kj);
  }
  LDL_UNROLL for (int i = 0; i < ki * kj; i++) A[i] = L[i];
  return target;
}

/* All updates of a column of kj unknowns. */
static inline const size_t *ldl_column (const pw_ldl *l, int j, int kj, const size_t *target) {
  const double *D = l->value + l->diagonal[j];
  int first = l->first[j];
  for (int p = l->first[j + 1] - 1; p >= first; p--) {
    int ki = l->size[l->below[p]];
    target = ki == 2   ? ldl_row (l, first, p, D, 2, kj, target)
             : ki == 1 ? ldl_row (l, first, p, D, 1, kj, target)
                       : ldl_row (l, first, p, D, 3, kj, target);
  }
  return target;
}

static void ldl_keep_diagonal (pw_ldl *l) {
  double *was = l->was;
  for (int j = 0; j < l->nodes; j++) {
    const double *D = l->value + l->diagonal[j];
    int k = l->size[j];
    for (int i = 0; i < k; i++) *was++ = D[i * (k + 1)];
  }
}

double pw_ldl_factor (pw_ldl *l, int *node) {  double worst = INFINITY;
  const size_t *target = l->target;
  ldl_keep_diagonal (l);
*node = -1;
  for (int j = 0; j < l->nodes; j++) {
    int k = l->size[j];
    double pivot = ldl_invert (l->value + l->diagonal[j], k, l->was + l->position[j]);
    if (!(pivot >= worst)) worst = pivot, *node = l->order[j];
    if (!(pivot > 0)) break;
    target = k == 1   ? ldl_column (l, j, 1, target)
             : k == 2 ? ldl_column (l, j, 2, target)
                      : ldl_column (l, j, 3, target);
  }
  return worst;
}

/* y_i -= L y_j for the blocks below, sizes as before. */
static inline void ldl_forward (double *to, const double *L, const double *from, int ki, int kj) {
  LDL_UNROLL for (int i = 0; i < ki; i++) {
    LDL_UNROLL for (int j = 0; j < kj; j++) to[i] -= L[i * kj + j] * from[j];
  }
}

static inline void ldl_forward_column (const pw_ldl *l, double *y, int j, int kj) {
  const double *from = y + l->position[j];
  for (int p = l->first[j]; p < l->first[j + 1]; p++) {
    int i = l->below[p], ki = l->size[i];
    double *to = y + l->position[i];
    const double *L = l->value + l->offset[p];
    if (ki == 2)
      ldl_forward (to, L, from, 2, kj);
    else if (ki == 1)
      ldl_forward (to, L, from, 1, kj);
    else
      ldl_forward (to, L, from, 3, kj);
  }
}

/* x_j = D^-1 y_j - sum_i L_ij^T x_i */
static inline void ldl_backward (double *sum, const double *L, const double *from, int ki, int kj) {
  LDL_UNROLL for (int i = 0; i < ki; i++) {
    LDL_UNROLL for (int j = 0; j < kj; j++) sum[j] -= L[i * kj + j] * from[i];
  }
}

static inline void ldl_backward_column (const pw_ldl *l, double *y, int j, int kj) {
  double *to = y + l->position[j], sum[PW_LDL_NODE];
  const double *D = l->value + l->diagonal[j];
  LDL_UNROLL for (int i = 0; i < kj; i++) {
    sum[i] = D[i * kj] * to[0];
    LDL_UNROLL for (int n = 1; n < kj; n++) sum[i] += D[i * kj + n] * to[n];
  }
  for (int p = l->first[j]; p < l->first[j + 1]; p++) {
    int i = l->below[p], ki = l->size[i];
    const double *from = y + l->position[i], *L = l->value + l->offset[p];
    if (ki == 2)
      ldl_backward (sum, L, from, 2, kj);
    else if (ki == 1)
      ldl_backward (sum, L, from, 1, kj);
    else
      ldl_backward (sum, L, from, 3, kj);
  }
  LDL_UNROLL for (int i = 0; i < kj; i++) to[i] = sum[i];
}

void pw_ldl_solve (const pw_ldl *l, double *y) {
for (int j = 0; j < l->nodes; j++) {
    int k = l->size[j];
    if (k == 2)
      ldl_forward_column (l, y, j, 2);
    else if (k == 1)
      ldl_forward_column (l, y, j, 1);
    else
      ldl_forward_column (l, y, j, 3);
  }
  for (int j = l->nodes - 1; j >= 0; j--) {
    int k = l->size[j];
    if (k == 2)
      ldl_backward_column (l, y, j, 2);
    else if (k == 1)
      ldl_backward_column (l, y, j, 1);
    else
      ldl_backward_column (l, y, j, 3);
  }
}
