/* Solution with the factors; see block_ldl.h.  Of an uncondensed body k, y_k begins as -f_k and becomes -a_k.
 *
 *   for each body:                y_p -= J_p W^-1 f
 *   for each column j:            y_p -= L_pj y_j
 *   for each column j backwards:  y_j = -D^-1 y_j - sum_p L_pj^T y_p
 *   for each body:                a = W^-1 (f - sum_p J_p^T y_p) */
#include "block_parts.h"
#include "unroll.h"

/* ---- Bodies ---- */

/* y -= J z */
PW_INLINE void block_gather (int size, int width, double *y, const double *J, int row_stride, block_row z) {
  y[0] -= block_product (width, z, J);
  if (size == 2) y[1] -= block_product (width, z, J + row_stride);
}

/* z - J^T y */
PW_INLINE block_row block_scatter (int size, int width, const double *y, const double *J, int row_stride, block_row z) {
  const double *second = J + row_stride;
  z.x -= size == 2 ? J[0] * y[0] + second[0] * y[1] : J[0] * y[0];
  if (width == 3) z.y -= size == 2 ? J[1] * y[0] + second[1] * y[1] : J[1] * y[0];
  if (width == 3) z.angle -= size == 2 ? J[2] * y[0] + second[2] * y[1] : J[2] * y[0];
  return z;
}

/* y -= J W^-1 f for a body. */
PW_INLINE void block_right_of (int width, const pw_block_ldl *l, const pw_group_block *p, const double *f, double *y) {
  const block_row z = block_weigh (width, f + p->j, l->inverse_weight + p->j);
  for (const pw_contribution *a = l->contribution + p->first_contribution;
       a < l->contribution + p[1].first_contribution; a++)
    BLOCK_SIZE (a->size, block_gather, width, y + a->unknown, a->J, a->row_stride, z);
}

/* a = W^-1 (f - J^T y) for a body. */
PW_INLINE void block_accelerate (int width, const pw_block_ldl *l, const pw_group_block *p, const double *f,
                                 const double *y, double *a) {
  const double *w = l->inverse_weight + p->j;
  block_row z = { 0 };
  if (f) z = width == 3 ? (block_row){ f[p->j], f[p->j + 1], f[p->j + 2] } : (block_row){ .x = f[p->j] };
  for (const pw_contribution *x = l->contribution + p->first_contribution;
       x < l->contribution + p[1].first_contribution; x++)
    z = BLOCK_SIZE (x->size, block_scatter, width, y + x->unknown, x->J, x->row_stride, z);
  a[p->j] = w[0] * z.x;
  if (width == 3) a[p->j + 1] = w[1] * z.y, a[p->j + 2] = w[2] * z.angle;
}

/* ---- Columns ---- */

/* to -= L from, L: ki x kj, its rows kj apart */
PW_INLINE void block_forward (int ki, double *to, const double *L, const double *from, int kj) {
  to[0] -= block_dot (kj, from[0], from[kj - 1], L);
  if (ki == 2) to[1] -= block_dot (kj, from[0], from[kj - 1], L + kj);
}

PW_INLINE void block_forward_column (int kj, const pw_block_ldl *l, const pw_block_column *c, double *y) {
  const double *L = l->value + c->first_value + pw_block_diagonal_values (kj);
  for (int p = c->first_below; p < c[1].first_below; p++) {
    const pw_block_column *row = l->column + l->below[p];
    BLOCK_SIZE (row->size, block_forward, y + row->unknown, L, y + c->unknown, kj);
    L += row->size * kj;
  }
}

/* sum -= L^T x */
PW_INLINE void block_backward (int ki, double *sum, const double *L, const double *x, int kj) {
  sum[0] -= ki == 2 ? L[0] * x[0] + L[kj] * x[1] : L[0] * x[0];
  if (kj == 2) sum[1] -= ki == 2 ? L[1] * x[0] + L[3] * x[1] : L[1] * x[0];
}

PW_INLINE void block_backward_column (int kj, const pw_block_ldl *l, const pw_block_column *c, double *y) {
  const double *D = l->value + c->first_value, *L = D + pw_block_diagonal_values (kj);
  double *to = y + c->unknown;
  block_pair own = block_divide (kj, D, to[0], kj == 2 ? to[1] : 0);
  double sum[2] = { -own.x, -own.y };
  for (int p = c->first_below; p < c[1].first_below; p++) {
    const pw_block_column *row = l->column + l->below[p];
    BLOCK_SIZE (row->size, block_backward, sum, L, y + row->unknown, kj);
    L += row->size * kj;
  }
  to[0] = sum[0];
  if (kj == 2) to[1] = sum[1];
}

/* ---- All bodies and columns ---- */

static void block_right (const pw_block_ldl *l, const double *f, double *y) {
  for (const pw_group_block *p = l->group, *last = p + l->groups; p < last; p++)
    if (p->uncondensed)
      for (int n = 0; n < 3; n++)
        y[l->contribution[p[1].first_contribution - 2].unknown + n] -=
            l->inverse_weight[p->j + n] > 0 ? f[p->j + n] : 0;
    else
      BLOCK_WIDTH (p->width, block_right_of, l, p, f, y);
}

static void block_accelerations (const pw_block_ldl *l, const double *f, const double *y, double *a) {
  for (const pw_group_block *p = l->group, *last = p + l->groups; p < last; p++)
    if (p->uncondensed)
      for (int n = 0; n < 3; n++) a[p->j + n] = -y[l->contribution[p[1].first_contribution - 2].unknown + n];
    else
      BLOCK_WIDTH (p->width, block_accelerate, l, p, f, y, a);
}

void pw_block_solve (const pw_block_ldl *l, const double *f, double *y, double *a) {
  const pw_chain *chain = l->chain;
  const pw_block_column *c = l->column;
  if (f) block_right (l, f, y);
  for (int j = 0; j < l->nodes;)
    if (chain->first_column == j) {
      pw_chain_forward (l, chain, f, y);
      j += chain->bodies + chain->includes_last;
      chain++;
    } else {
      BLOCK_SIZE (c[j].size, block_forward_column, l, c + j, y);
      j++;
    }
  for (int j = l->nodes; j > 0;)
    if (chain > l->chain && chain[-1].first_column + chain[-1].bodies + chain[-1].includes_last == j) {
      pw_chain_backward (l, --chain, f, y, a);
      j = chain->first_column;
    } else {
      j--;
      BLOCK_SIZE (c[j].size, block_backward_column, l, c + j, y);
    }
  block_accelerations (l, f, y, a);
}
