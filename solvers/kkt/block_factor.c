/* Assembly and elimination of the block L D L^T; see block_ldl.h.
 *
 *   for each body:      K_ba += J_b W^-1 J_a^T  for its contributions a, and b from a on
 *   for each column j:  D = K_jj,  L_pj = K_pj D^-1,  K_pq -= L_pj K_qj^T  for all p >= q below j
 *
 * The elimination is right-looking, with all positions known in advance.  The rows p are in descending order, so that
 * the K_qj that they need have not been replaced by L_qj yet.  D is stored as its factors. */
#include <string.h>
#include "block_parts.h"
#include "unroll.h"

/* ---- Assembly ---- */

/* K += B R^T, kb x ka, with B = J_b, whose rows are `stride` apart, and R = J_a W^-1. */
PW_INLINE void block_couple (int kb, int ka, int width, double *K, const block_row *R, const double *B, int stride) {
  K[0] += block_product (width, R[0], B);
  if (ka == 2) K[1] += block_product (width, R[1], B);
  if (kb == 2) K[ka] += block_product (width, R[0], B + stride);
  if (ka == 2 && kb == 2) K[3] += block_product (width, R[1], B + stride);
}

/* Adds the products of a contribution of ka rows with itself and with those after it; coupling: indices in `value` of
 * the latter. */
PW_INLINE void block_contribute (int ka, int width, const pw_block_ldl *l, const pw_group_block *p,
                                 const pw_contribution *a, const int *coupling) {
  const double *A = a->J, *w = l->inverse_weight + p->j;
  double *D = l->value + a->diagonal;
  block_row R[2] = { block_weigh (width, A, w) };
  if (ka == 2) R[1] = block_weigh (width, A + a->row_stride, w);
  D[0] += block_product (width, R[0], A);
  if (ka == 2) D[1] += block_product (width, R[1], A), D[2] += block_product (width, R[1], A + a->row_stride);
  D[ka == 2 ? 3 : 1] = D[0];
  if (ka == 2) D[4] = D[2];
  for (const pw_contribution *b = a + 1; b < l->contribution + p[1].first_contribution; b++)
    BLOCK_SIZE (b->size, block_couple, ka, width, l->value + *coupling++, R, b->J, b->row_stride);
}

/* The pivot of an acceleration in -W_k; -1 of one that is 0 or massless, whose column of J is left out. */
static inline double block_inertia (double inverse_weight) {
  return inverse_weight > 0 ? -1 / inverse_weight : -1;
}

/* Adds an uncondensed body: -W_k, and its columns of J.  The original diagonal entries of the equations eliminated
 * after the body grow as if it were condensed. */
static void block_uncondensed (const pw_block_ldl *l, const pw_group_block *p) {
  const pw_contribution *own = l->contribution + p[1].first_contribution - 2;
  const double *w = l->inverse_weight + p->j;
  const int *coupling = l->coupling + p->first_coupling;
  double *D = l->value + own[0].diagonal, *inertia = l->value + own[1].diagonal;
  D[0] = D[3] = block_inertia (w[0]), D[2] = D[4] = block_inertia (w[1]),
  inertia[0] = inertia[1] = block_inertia (w[2]);
  for (const pw_contribution *a = l->contribution + p->first_contribution; a < own; a++)
    for (int n = 0; n < 3; n += 2) { /* its first node has the columns 0 and 1, its second one column 2 */
      double *K = l->value + *coupling++, *original = l->value + a->diagonal + a->size * (a->size + 1) / 2;
      int later = a->diagonal > own->diagonal, size = n == 0 ? 2 : 1;
      for (int i = 0; i < a->size; i++)
        for (int c = 0; c < size; c++) {
          double J = w[n + c] > 0 ? a->J[i * a->row_stride + n + c] : 0;
          K[later ? i * size + c : c * a->size + i] = J;
          if (later) original[i] += J * w[n + c] * J;
        }
    }
}

static void block_assemble (const pw_block_ldl *l) {
  memset (l->value, 0, (size_t)l->values * sizeof *l->value);
  for (const pw_group_block *p = l->group, *last = p + l->groups; p < last; p++) {
    const int *coupling = l->coupling + p->first_coupling;
    const pw_contribution *a = l->contribution + p->first_contribution,
                          *end = l->contribution + p[1].first_contribution;
    if (p->uncondensed)
      block_uncondensed (l, p);
    else if (p->width == 3)
      for (; a < end; coupling += end - ++a) BLOCK_SIZE (a->size, block_contribute, 3, l, p, a, coupling);
    else
      for (; a < end; coupling += end - ++a) BLOCK_SIZE (a->size, block_contribute, 1, l, p, a, coupling);
  }
}

/* ---- Elimination ---- */

typedef struct {
  double xx, xy, yx, yy;
} block_square;

/* Replaces the lower triangle of a diagonal block of k unknowns by its factors L D L^T: 1 / d_1, l_21, 1 / d_2. */
static inline void block_pivot (int k, double *D, pw_block_ldl *l, int unknown) {
  double a = D[0], b = D[1], minor = k == 2 ? a * D[2] - b * b : 0;
  block_track_pivot (l, a, D[k == 2 ? 3 : 1], unknown);
  D[0] = 1 / a;
  if (k == 1) return;
  block_track_pivot (l, minor, fabs (a) * D[4], unknown + 1);
  D[1] = b * D[0], D[2] = a / minor;
}

/* L = A D^-1: A ki x kj. */
static inline block_square block_scale (int ki, int kj, const double *A, const double *D) {
  block_pair x = block_divide (kj, D, A[0], kj == 2 ? A[1] : 0), y = { 0 };
  if (ki == 2) y = block_divide (kj, D, A[kj], kj == 2 ? A[3] : 0);
  return (block_square){ x.x, x.y, y.x, y.y };
}

/* D -= L A^T for the lower triangle of a diagonal block: L ki x kj, A ki x kj. */
static inline void block_subtract_diagonal (int ki, double *D, block_square L, const double *A, int kj) {
  D[0] -= block_dot (kj, L.xx, L.xy, A);
  if (ki == 2) D[1] -= block_dot (kj, L.yx, L.yy, A), D[2] -= block_dot (kj, L.yx, L.yy, A + kj);
}

/* T -= L A^T: L ki x kj, A kq x kj. */
static inline void block_subtract (int kq, double *T, block_square L, const double *A, int ki, int kj) {
  T[0] -= block_dot (kj, L.xx, L.xy, A);
  if (kq == 2) T[1] -= block_dot (kj, L.xx, L.xy, A + kj);
  if (ki == 2) T[kq] -= block_dot (kj, L.yx, L.yy, A);
  if (ki == 2 && kq == 2) T[3] -= block_dot (kj, L.yx, L.yy, A + kj);
}

/* Eliminates row p of a column j: subtracts L_pj K_qj^T from the blocks K_pq, then replaces K_pj by L_pj.  A: K_pj; B:
 * the column's first block below the diagonal; target: indices in `value` of K_pq. */
PW_INLINE void block_eliminate_row (int ki, const pw_block_ldl *l, const pw_block_column *c, int p, double *A,
                                    const double *B, const double *D, const int *target, int kj) {
  const pw_block_column *column = l->column;
  block_square L = block_scale (ki, kj, A, D);
  for (int q = c->first_below; q < p; q++) {
    int kq = column[l->below[q]].size;
    BLOCK_SIZE (kq, block_subtract, l->value + *target++, L, B, ki, kj);
    B += kq * kj;
  }
  block_subtract_diagonal (ki, l->value + column[l->below[p]].first_value, L, A, kj);
  A[0] = L.xx;
  if (kj == 2) A[1] = L.xy;
  if (ki == 2) A[kj] = L.yx;
  if (ki == 2 && kj == 2) A[3] = L.yy;
}

/* Finds the targets of row p of a long column; to be called for its rows in descending order. */
static const int *block_find_targets (const pw_block_ldl *l, const pw_block_column *c, int p) {
  int *at = l->cursor, *row = at + (c[1].first_below - c->first_below);
  for (int q = c->first_below; q < p; q++, at++, row++) {
    const pw_block_column *d = &l->column[l->below[q]];
    if (p + 1 == c[1].first_below) *at = d[1].first_value, *row = d[1].first_below;
    do *at -= d->size * l->column[l->below[--*row]].size;
    while (l->below[*row] != l->below[p]);
  }
  return l->cursor;
}

/* Eliminates a column of kj unknowns; returns the next column's targets. */
PW_INLINE const int *block_eliminate (int kj, pw_block_ldl *l, const pw_block_column *c, const int *target) {
  double *D = l->value + c->first_value, *B = D + pw_block_diagonal_values (kj), *A = l->value + c[1].first_value;
  const int is_long = c[1].first_below - c->first_below > PW_BLOCK_LISTED;
  block_pivot (kj, D, l, c->unknown);
  for (int p = c[1].first_below - 1; p >= c->first_below; p--) {
    int ki = l->column[l->below[p]].size;
    A -= ki * kj;
    BLOCK_SIZE (ki, block_eliminate_row, l, c, p, A, B, D, is_long ? block_find_targets (l, c, p) : target, kj);
    if (!is_long) target += p - c->first_below;
  }
  return target;
}

void pw_block_factor (pw_block_ldl *l) {
  const pw_chain *chain = l->chain;
  const int *target = l->target;
  l->least_pivot = INFINITY;
  l->least_unknown = -1;
  block_assemble (l);
  for (int j = 0; j < l->nodes && l->least_pivot > 0;)
    if (chain->first_column == j) {
      pw_chain_factor (l, chain);
      j += chain->bodies + chain->includes_last;
      chain++;
    } else {
      const pw_block_column *c = &l->column[j++];
      target = BLOCK_SIZE (c->size, block_eliminate, l, c, target);
    }
}
