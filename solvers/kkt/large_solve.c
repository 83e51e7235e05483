/* A large scene solved when it is factorised; see large.c for the equations. */
#include "large_parts.h"

static void large_forward_column (const pw_large *l, const pw_column *c, double *y) {
  const pw_column *column = l->ldl->column;
  const double *L = l->ldl->value + c->at + pw_ldl_triangle (c->size) + c->size;
  for (int p = c->first; p < c[1].first; p++) {
    const pw_column *row = column + l->ldl->below[p];
    large_forward_any (row->size, y + row->y, L, y + c->y, c->size);
    L += row->size * c->size;
  }
}

/* sum -= L^T x */
static inline void large_backward (int ki, double *sum, const double *L, const double *x, int kj) {
  sum[0] -= ki == 2 ? L[0] * x[0] + L[kj] * x[1] : L[0] * x[0];
  if (kj == 2) sum[1] -= ki == 2 ? L[1] * x[0] + L[3] * x[1] : L[1] * x[0];
}

static inline void large_backward_column (int kj, const pw_large *l, const pw_column *c, double *y) {
  const pw_column *column = l->ldl->column;
  const double *D = l->ldl->value + c->at, *L = D + pw_ldl_triangle (kj) + kj;
  double *to = y + c->y, sum[2] = { -D[0] * to[0], 0 };
  if (kj == 2) sum[0] -= D[1] * to[1], sum[1] = -D[1] * to[0] - D[2] * to[1];
  for (int p = c->first; p < c[1].first; p++) {
    const pw_column *row = column + l->ldl->below[p];
    LARGE_SHORT (row->size, large_backward, sum, L, y + row->y, kj);
    L += row->size * kj;
  }
  to[0] = sum[0];
  if (kj == 2) to[1] = sum[1];
}

static void large_backward_any (const pw_large *l, const pw_column *c, double *y) {
  const pw_column *column = l->ldl->column;
  int kj = c->size;
  const double *D = l->ldl->value + c->at, *L = D + pw_ldl_triangle (kj) + kj;
  double *to = y + c->y, sum[PW_LDL_NODE] = { 0 };
  for (int i = 0; i < kj; i++)
    for (int n = 0; n < kj; n++) sum[i] -= large_entry (D, i, n) * to[n];
  for (int p = c->first; p < c[1].first; p++) {
    const pw_column *row = column + l->ldl->below[p];
    for (int i = 0; i < row->size; i++)
      for (int j = 0; j < kj; j++) sum[j] -= *L++ * y[row->y + i];
  }
  memcpy (to, sum, (size_t)kj * sizeof *to);
}

/* force -= J^T y */
static inline large_three large_scatter (int size, large_three force, const double *J, int step, const double *y) {
  const double *K = J + step;
  if (size == 1) return (large_three){ force.x - J[0] * y[0], force.y - J[1] * y[0], force.z - J[2] * y[0] };
  return (large_three){ force.x - (J[0] * y[0] + K[0] * y[1]), force.y - (J[1] * y[0] + K[1] * y[1]),
                        force.z - (J[2] * y[0] + K[2] * y[1]) };
}

static inline void large_accelerate_link (const pw_large *l, const pw_patch *p, const double *f, const double *y,
                                          double *a) {
  const pw_piece *pu = l->piece + p->first, *pv = pu + 1;
  const double *w = l->inverse + p->j, *yu = y + pu->y, *yv = y + pv->y;
  const large_arm u = large_read_arm (large_J (l, pu), pu->step), v = large_read_arm (large_J (l, pv), pv->step);
  double X = -(u.s * yu[0] + v.s * yv[0]), Y = -(u.s * yu[1] + v.s * yv[1]);
  double T = -(u.x * yu[0] + u.y * yu[1] + v.x * yv[0] + v.y * yv[1]);
  if (f) X += f[p->j], Y += f[p->j + 1], T += f[p->j + 2];
  a += p->j;
  a[0] = X * w[0], a[1] = Y * w[1], a[2] = T * w[2];
}

static inline void large_accelerate (const pw_large *l, const pw_patch *p, const double *f, const double *y,
                                     double *a) {
  const double *w = l->inverse + p->j;
  large_three force = { 0 };
  if (f) force = (large_three){ f[p->j], f[p->j + 1], f[p->j + 2] };
  for (const pw_piece *x = l->piece + p->first; x < l->piece + p[1].first; x++)
    force = LARGE_SHORT (x->size, large_scatter, force, large_J (l, x), x->step, y + x->y);
  a += p->j;
  a[0] = force.x * w[0], a[1] = force.y * w[1], a[2] = force.z * w[2];
}

static void large_accelerate_any (const pw_large *l, const pw_patch *p, const double *f, const double *y, double *a) {
  for (int n = 0; n < 3 && p->shape == PW_KEPT; n++) a[p->j + n] = -y[l->piece[p[1].first - 1].y + n];
  if (p->shape == PW_KEPT) return;
  for (int n = 0; n < p->width; n++) {
    double force = f ? f[p->j + n] : 0;
    for (const pw_piece *x = l->piece + p->first; x < l->piece + p[1].first; x++)
      for (int i = 0; i < x->size; i++) force -= large_J (l, x)[i * x->step + n] * y[x->y + i];
    a[p->j + n] = l->inverse[p->j + n] * force;
  }
}

static inline void large_backward_node (const pw_large *l, const pw_column *c, double *y) {
  if (c->shape == PW_ANY)
    large_backward_any (l, c, y);
  else
    LARGE_SHORT (c->size, large_backward_column, l, c, y);
}

static inline void large_accelerate_patch (const pw_large *l, const pw_patch *p, const double *f, const double *y,
                                           double *a) {
  if (p->shape == PW_LINK)
    large_accelerate_link (l, p, f, y, a);
  else if (p->shape != PW_SHORT)
    large_accelerate_any (l, p, f, y, a);
  else
    large_accelerate (l, p, f, y, a);
}

/* The nodes of a patch come behind the column before which it was assembled. */
void pw_large_up (const pw_large *l, const double *f, double *y, double *a) {
  const pw_patch *p = l->patch + l->patches;
  const pw_chain *chain = l->chain + l->chains;
  for (int j = l->ldl->nodes; j > 0;) {
    if (chain > l->chain && chain[-1].column + chain[-1].bodies == j) {
      pw_large_chain_up (l, --chain, f, y, a);
      j = chain->column;
    } else
      large_backward_node (l, &l->ldl->column[--j], y);
    while (p > l->patch && p[-1].column >= j) large_accelerate_patch (l, --p, f, y, a);
  }
  while (p > l->patch) large_accelerate_patch (l, --p, f, y, a);
}

void pw_large_solve (const pw_large *l, const double *f, double *y, double *a) {
  const pw_chain *chain = l->chain;
  for (const pw_patch *p = l->patch; f && p < l->patch + l->patches; p++) large_patch (l, p, f, y, LARGE_RIGHT);
  for (int j = 0; j < l->ldl->nodes;)
    if (chain->column == j) {
      pw_large_chain_forward (l, chain, f, y);
      j += chain++->bodies;
    } else
      large_forward_column (l, &l->ldl->column[j++], y);
  pw_large_up (l, f, y, a);
}
