/* Numbers of a large scene; see large.h.
 *
 *   for each column j in order:
 *     for the patches needed from here on:  K_ab += J_a W^-1 J_b^T,   y_a -= J_a W^-1 f
 *     D = K_jj,  L_pj = K_pj D^-1,  K_pq -= L_pj K_qj^T  for all p >= q below j,   y_p -= L_pj y_j
 *   for each column j backwards:   y_j = -D^-1 y_j - sum_p L_pj^T y_p
 *   for each patch:                a = W^-1 (f - sum_a J_a^T y_a)
 *
 * Right-looking, every place known in advance (Duff, Erisman & Reid 2017, Direct Methods for Sparse Matrices, chapters
 * 5 and 12).  D^-1 is kept explicitly: a node has at most 3 unknowns. */
#include "large_parts.h"

/* ---- Elimination of columns of 1 or 2 unknowns with such rows below ---- */

/* T -= L A^T: L ki x kj, A kq x kj. */
static inline void large_subtract (int kq, double *T, large_square L, const double *A, int ki, int kj) {
  T[0] -= large_dot_pair (kj, L.xx, L.xy, A);
  if (kq == 2) T[1] -= large_dot_pair (kj, L.xx, L.xy, A + kj);
  if (ki == 2) T[kq] -= large_dot_pair (kj, L.yx, L.yy, A);
  if (ki == 2 && kq == 2) T[3] -= large_dot_pair (kj, L.yx, L.yy, A + kj);
}

/* Row p of a column c: its updates, then L in place of K.  A: its block; B: the column's first block. */
static inline void large_row (int ki, const pw_large *l, const pw_column *c, int p, double *A, const double *B,
                              large_square D, const int *target, double *y, int kj) {
  double *value = l->ldl->value;
  const pw_column *column = l->ldl->column, *row = column + l->ldl->below[p];
  large_square L = large_scale (ki, kj, A, D);
  for (int q = c->first; q < p; q++) {
    int kq = column[l->ldl->below[q]].size;
    LARGE_SHORT (kq, large_subtract, value + *target++, L, B, ki, kj);
    B += kq * kj;
  }
  large_subtract_diagonal (ki, value + row->at, L, A, kj);
  A[0] = L.xx;
  if (kj == 2) A[1] = L.xy;
  if (ki == 2) A[kj] = L.yx;
  if (ki == 2 && kj == 2) A[3] = L.yy;
  if (y) large_forward (ki, y + row->y, A, y + c->y, kj);
}

/* A column of kj unknowns; returns the next column's targets. */
static inline const int *large_column (int kj, pw_large *l, const pw_column *c, const int *target, double *y) {
  double *D = l->ldl->value + c->at, *B = D + pw_ldl_triangle (kj) + kj, *A = l->ldl->value + c[1].at;
  large_square inverse = large_invert (kj, D, l, c->y);
  for (int p = c[1].first - 1; p >= c->first; target += p-- - c->first) {
    int ki = l->ldl->column[l->ldl->below[p]].size;
    A -= ki * kj;
    LARGE_SHORT (ki, large_row, l, c, p, A, B, inverse, target, y, kj);
  }
  return target;
}

/* ---- Any column ---- */

static void large_invert_any (pw_large *l, const pw_column *c) {
  double *D = l->ldl->value + c->at;
  if (c->size < 3) {
    (void)LARGE_SHORT (c->size, large_invert, D, l, c->y);
    return;
  }
  double a = D[0], b = D[1], c1 = D[2], d = D[3], e = D[4], g = D[5];
  double A = c1 * g - e * e, B = d * e - b * g, C = b * e - c1 * d, minor = a * c1 - b * b;
  double determinant = a * A + b * B + d * C, f = 1 / determinant;
  if (D[6] > 0) { /* not a body: those are negative */
    large_judge (l, a, D[6], c->y);
    large_judge (l, minor, fabs (a) * D[7], c->y + 1);
    large_judge (l, determinant, fabs (minor) * D[8], c->y + 2);
  }
  D[0] = A * f, D[1] = B * f, D[2] = (a * g - d * d) * f, D[3] = C * f, D[4] = (b * d - a * e) * f, D[5] = minor * f;
}

static const int *large_column_any (pw_large *l, const pw_column *c, const int *target, double *y) {
  const pw_column *column = l->ldl->column;
  int kj = c->size;
  double *value = l->ldl->value, *D = value + c->at, *A = value + c[1].at, L[PW_LDL_NODE * PW_LDL_NODE];
  large_invert_any (l, c);
  for (int p = c[1].first - 1; p >= c->first; p--) {
    const pw_column *row = column + l->ldl->below[p];
    const double *B = D + pw_ldl_triangle (kj) + kj;
    int ki = row->size;
    A -= ki * kj;
    for (int i = 0; i < ki; i++)
      for (int j = 0; j < kj; j++) {
        L[i * kj + j] = 0;
        for (int k = 0; k < kj; k++) L[i * kj + j] += A[i * kj + k] * large_entry (D, k, j);
      }
    for (int q = c->first; q <= p; q++) {
      int kq = column[l->ldl->below[q]].size;
      double *T = value + (q < p ? *target++ : row->at);
      for (int i = 0; i < ki; i++)
        for (int n = 0; n < (q < p ? kq : i + 1); n++, T++)
          for (int j = 0; j < kj; j++) *T -= L[i * kj + j] * B[n * kj + j];
      B += kq * kj;
    }
    memcpy (A, L, (size_t)(ki * kj) * sizeof *A);
    if (y) large_forward_any (ki, y + row->y, L, y + c->y, kj);
  }
  return target;
}

/* ---- Down ---- */

/* Assembly, elimination and, if there is a right-hand side y, that of y.  Returns 0 at a pivot that is too small. */
static inline int large_down (pw_large *l, const double *f, double *y, int what) {
  const pw_ldl *ldl = l->ldl;
  const pw_patch *p = l->patch, *last = p + l->patches;
  const pw_chain *chain = l->chain;
  const int *target = ldl->target;
  l->pivot = INFINITY;
  l->row = -1;
  for (const pw_gap *g = l->gap; g < l->gap + l->gaps; g++)
    memset (ldl->value + g->at, 0, (size_t)g->count * sizeof (double));
  for (int j = 0; j < ldl->nodes;) {
    const pw_column *c = &ldl->column[j];
    for (; p < last && p->column <= j; p++) large_patch (l, p, f, y, what);
    if (chain->column == j) {
      pw_large_chain_down (l, chain, f, y);
      j += chain++->bodies;
    } else {
      if (c->shape == PW_ANY)
        target = large_column_any (l, c, target, y);
      else
        target = LARGE_SHORT (c->size, large_column, l, c, target, y);
      j++;
    }
    if (!(l->pivot > l->least)) return 0;
  }
  return 1;
}

void pw_large_factor (pw_large *l) {
  large_down (l, NULL, NULL, LARGE_MATRIX);
}

void pw_large_both (pw_large *l, const double *f, double *y, double *a) {
  int done = f ? large_down (l, f, y, LARGE_MATRIX | LARGE_RIGHT) : large_down (l, NULL, y, LARGE_MATRIX);
  if (done) pw_large_up (l, f, y, a);
}
