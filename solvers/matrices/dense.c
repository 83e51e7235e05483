/* Assembly, elimination and solution of a small dense matrix; see dense.h.
 *
 *   c_j = S_ij - sum_{k < j} c_k L_jk,   L_ij = c_j / d_j,   d_i = S_ii - sum_{k < i} c_k L_ik
 *
 * (Golub & Van Loan 2013, Matrix Computations, algorithm 4.1.2.)  The numbers of rows, of S and of the commonest
 * bodies, are constant where functions are inlined, so that all loops over them are unrolled. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "dense.h"
#include "util.h"

/* This file reads pairs of numbers shortly after storing them one by one: a vector load would stall until both stores
 * are complete. */
#ifndef __clang__
#pragma GCC optimize("no-tree-slp-vectorize")
#endif

/* f of a group less the forces of its known rows; a becomes that. */
PW_INLINE void dense_take_known (int width, int rows, const pw_dense_group *p, const double *f, double *a, double *F) {
  PW_UNROLL for (int k = 0; k < width; k++) F[k] = f[p->j + k];
  for (const pw_dense_known *known = p->known, *end = known + rows; known < end; known++)
    PW_UNROLL for (int k = 0; k < width; k++) F[k] -= known->J[k] * *known->multiplier;
  PW_UNROLL for (int k = 0; k < width; k++) a[p->j + k] = F[k];
}

/* Subtracts J a from `right` of the known rows; own: a of the group. */
PW_INLINE void dense_give_known (int width, int rows, const pw_dense_group *p, const double *own) {
  for (const pw_dense_known *known = p->known, *end = known + rows; known < end; known++) {
    const double *J = known->J;
    *known->right -= width == 3 ? J[0] * own[0] + J[1] * own[1] + J[2] * own[2] : J[0] * own[0];
  }
}

/* S += J W^-1 J^T but what is constant, y += J W^-1 f, for a body with these numbers of pins, other and known rows. */
PW_INLINE void dense_add (int pins, int others, int known, const pw_dense_group *p, const double *w, const double *f,
                          double *S, double *y, double *a) {
  double F[3], R[3], angle[PW_DENSE]; /* W^-1 f; a row of J W^-1; of pins: J in the column of the angle */
  const double *const f_own = f + p->j;
  w += p->j;
  if (known) dense_take_known (3, known, p, f, a, F);
  PW_UNROLL for (int k = 0; k < 3; k++) F[k] = (known ? F[k] : f_own[k]) * w[k];
  PW_UNROLL for (int r = 0; r < 2 * pins; r++) {
    const unsigned char *at = p->at + r * (r + 1) / 2;
    const double *J = p->J[r], weighted = J[2] * w[2];
    angle[r] = J[2];
    y[p->row[r]] += J[r % 2] * F[r % 2] + J[2] * F[2];
    PW_UNROLL for (int q = 0; q <= r; q++) S[at[q]] += weighted * angle[q];
  }
  PW_UNROLL for (int r = 2 * pins; r < 2 * pins + others; r++) {
    const unsigned char *at = p->at + r * (r + 1) / 2;
    const double *J = p->J[r];
    PW_UNROLL for (int k = 0; k < 3; k++) R[k] = J[k] * w[k];
    y[p->row[r]] += J[0] * F[0] + J[1] * F[1] + J[2] * F[2];
    PW_UNROLL for (int q = 0; q < 2 * pins; q++) S[at[q]] += R[q % 2] * p->J[q][q % 2] + R[2] * angle[q];
    PW_UNROLL for (int q = 2 * pins; q <= r; q++) {
      const double *to = p->J[q];
      S[at[q]] += R[0] * to[0] + R[1] * to[1] + R[2] * to[2];
    }
  }
}

/* a = W^-1 (f - J^T y) for the body. */
PW_INLINE void dense_accelerate (int pins, int others, int known, const pw_dense_group *p, const double *w,
                                 const double *f, const double *y, double *a) {
  const double *from = (known ? a : f) + p->j;
  double z[3] = { from[0], from[1], from[2] };
  PW_UNROLL for (int r = 0; r < 2 * pins + others; r++) {
    const double *J = p->J[r], multiplier = y[p->row[r]];
    PW_UNROLL for (int k = 0; k < 3; k++) if (r >= 2 * pins || k == r % 2 || k == 2) z[k] -= J[k] * multiplier;
  }
  PW_UNROLL for (int k = 0; k < 3; k++) a[p->j + k] = z[k] *= w[p->j + k];
  if (known) dense_give_known (3, known, p, z);
}

#define DENSE_BODY(name, pins, others, known)                                                                      \
  static void dense_add_##name (const pw_dense_group *p, const double *w, const double *f, double *S, double *y,   \
                                double *a) {                                                                       \
    dense_add (pins, others, known, p, w, f, S, y, a);                                                             \
  }                                                                                                                \
  static void dense_accelerate_##name (const pw_dense_group *p, const double *w, const double *f, const double *y, \
                                       double *a) {                                                                \
    dense_accelerate (pins, others, known, p, w, f, y, a);                                                         \
  }

/* The commonest bodies: X (name, pins, others, known). */
#define DENSE_BODIES(X) \
  X (0_1, 0, 1, 0)      \
  X (0_2, 0, 2, 0)      \
  X (1_0, 1, 0, 0)      \
  X (1_1, 1, 1, 0)      \
  X (1_2, 1, 2, 0)      \
  X (2_0, 2, 0, 0)      \
  X (2_1, 2, 1, 0)      \
  X (0_1_2, 0, 1, 2)    \
  X (1_1_2, 1, 1, 2)

DENSE_BODIES (DENSE_BODY)

/* S NULL: y alone. */
PW_INLINE void dense_add_width (int width, const pw_dense_group *p, const double *w, const double *f, double *S,
                                double *y, double *a) {
  const unsigned char *at = p->at;
  double F[3], R[3];
  w += p->j;
  dense_take_known (width, p->known_rows, p, f, a, F);
  PW_UNROLL for (int k = 0; k < width; k++) F[k] *= w[k];
  for (int r = 0; r < p->rows; r++) {
    const int first = r < 2 * p->pins ? 2 : 0; /* column whose products are not constant */
    PW_UNROLL for (int k = 0; k < width; k++) y[p->row[r]] += p->J[r][k] * F[k];
    PW_UNROLL for (int k = 0; k < width; k++) R[k] = k < first ? 0 : p->J[r][k] * w[k];
    for (int q = 0; q <= r && S; q++, at++) {
      double sum = 0;
      PW_UNROLL for (int k = 0; k < width; k++) sum += R[k] * p->J[q][k];
      S[*at] += sum;
    }
  }
}

static void dense_add_any (const pw_dense_group *p, const double *w, const double *f, double *S, double *y, double *a) {
  if (p->width == 3)
    dense_add_width (3, p, w, f, S, y, a);
  else
    dense_add_width (1, p, w, f, S, y, a);
}

PW_INLINE void dense_accelerate_width (int width, const pw_dense_group *p, const double *w, const double *f,
                                       const double *y, double *a) {
  const double *from = (p->known_rows > 0 ? a : f) + p->j;
  double z[3];
  PW_UNROLL for (int k = 0; k < width; k++) z[k] = from[k];
  for (int r = 0; r < p->rows; r++) PW_UNROLL for (int k = 0; k < width; k++) z[k] -= p->J[r][k] * y[p->row[r]];
  PW_UNROLL for (int k = 0; k < width; k++) a[p->j + k] = z[k] *= w[p->j + k];
  dense_give_known (width, p->known_rows, p, z);
}

static void dense_accelerate_any (const pw_dense_group *p, const double *w, const double *f, const double *y,
                                  double *a) {
  if (p->width == 3)
    dense_accelerate_width (3, p, w, f, y, a);
  else
    dense_accelerate_width (1, p, w, f, y, a);
}

/* L and D of S */
PW_INLINE void dense_factor (int n, pw_dense *d, const double *S) {
  double L[PW_DENSE * PW_DENSE], c[PW_DENSE], least = INFINITY;
  PW_UNROLL for (int i = 0; i < n; i++) {
    double pivot = S[i * n + i];
    PW_UNROLL for (int j = 0; j < i; j++) {
      c[j] = S[i * n + j];
      PW_UNROLL for (int k = 0; k < j; k++) c[j] -= c[k] * L[j * n + k];
    }
    PW_UNROLL for (int j = 0; j < i; j++) {
      d->L[i * n + j] = L[i * n + j] = c[j] * L[j * n + j];
      pivot -= c[j] * L[i * n + j];
    }
    d->L[i * n + i] = L[i * n + i] = 1 / pivot;
    d->pivot[i] = pivot / S[i * n + i];
    least = least < d->pivot[i] ? least : d->pivot[i]; /* after NaN all are NaN */
  }
  d->least_pivot = least;
}

PW_INLINE void dense_run (int n, pw_dense *d, int factors, const double *f, double *lambda, double *a) {
  const double *w = d->inverse_weight;
  const pw_dense_group *p, *end = d->group + d->groups;
  const int forces = f != NULL;
  double S[PW_DENSE * PW_DENSE], y[PW_DENSE];
  PW_UNROLL for (int i = 0; i < n; i++) y[i] = lambda ? -lambda[d->unknown[i]] : 0;
  if (!forces) f = d->zero;
  if (!lambda) a = d->scratch;
  if (factors) {
    memcpy (S, d->S, sizeof *S * (size_t)(n * n));
    for (p = d->group; p < end; p++) p->add (p, w, f, S, y, a);
    dense_factor (n, d, S);
  } else if (forces) {
    for (p = d->group; p < end; p++) dense_add_any (p, w, f, NULL, y, a);
  }
  if (lambda == NULL) return;
  PW_UNROLL for (int i = 1; i < n; i++) PW_UNROLL for (int j = 0; j < i; j++) y[i] -= d->L[i * n + j] * y[j];
  PW_UNROLL for (int i = 0; i < n; i++) y[i] *= d->L[i * n + i];
  PW_UNROLL for (int i = n - 1; i >= 0; i--) {
    lambda[d->unknown[i]] = y[i];
    PW_UNROLL for (int j = 0; j < i; j++) y[j] -= d->L[i * n + j] * y[i];
  }
  for (p = d->group; p < end; p++) p->accelerate (p, w, f, y, a);
}

#define DENSE_RUN(n)                                                                                 \
  static void dense_run_##n (pw_dense *d, int factors, const double *f, double *lambda, double *a) { \
    dense_run (n, d, factors, f, lambda, a);                                                         \
  }

DENSE_RUN (0)
DENSE_RUN (1)
DENSE_RUN (2)
DENSE_RUN (4)
DENSE_RUN (6)
DENSE_RUN (8)
DENSE_RUN (10)

pw_dense *pw_dense_new (int groups, int known, int coords, const double *inverse_weight) {
  pw_dense *d = calloc (1, sizeof *d + (size_t)groups * sizeof *d->group);
  if (d == NULL) return NULL;
  d->inverse_weight = inverse_weight;
  d->known = calloc ((size_t)known + 1, sizeof *d->known);
  d->zero = calloc (2 * (size_t)coords, sizeof *d->zero);
  if (d->known == NULL || d->zero == NULL) return pw_dense_close (d), NULL;
  d->scratch = d->zero + coords;
  return d;
}

void pw_dense_pad (pw_dense *d) {
  if (d->n <= 2 || d->n % 2 == 0) return;
  d->unknown[d->n++] = d->unknown[0];
  d->S[d->n * d->n - 1] = 1;
}

void pw_dense_add_group (pw_dense *d, int j, int width) {
  pw_dense_group *p = &d->group[d->groups++];
  p->j = j, p->width = width;
}

void pw_dense_add_rows (pw_dense *d, int is_pin, int first, int size, const double *J, int stride) {
  pw_dense_group *p = &d->group[d->groups - 1];
  p->pins += is_pin;
  for (int i = 0; i < size; i++, J += stride) {
    const int row = first + i, r = p->rows++;
    unsigned char *at = p->at + r * (r + 1) / 2;
    p->J[r] = J;
    p->row[r] = (unsigned char)row;
    for (int q = 0; q <= r; q++) {
      const int with = p->row[q];
      at[q] = (unsigned char)(row > with ? row * d->n + with : with * d->n + row);
      if (is_pin && (q & 1) == i) d->S[at[q]] += p->J[q][i] * J[i] * d->inverse_weight[p->j + i];
    }
  }
}

void pw_dense_open (pw_dense *d) {
  static void (*const run[]) (pw_dense *, int, const double *, double *,
                              double *) = { [0] = dense_run_0, [1] = dense_run_1, [2] = dense_run_2,  [4] = dense_run_4,
                                            [6] = dense_run_6, [8] = dense_run_8, [10] = dense_run_10 };
  d->run = run[d->n];
  for (pw_dense_group *p = d->group; p < d->group + d->groups; p++) {
    const int others = p->rows - 2 * p->pins;
    p->add = dense_add_any, p->accelerate = dense_accelerate_any;
#define DENSE_SELECT(name, all, more, known)                                       \
  if (p->width == 3 && p->pins == all && others == more && p->known_rows == known) \
    p->add = dense_add_##name, p->accelerate = dense_accelerate_##name;
    DENSE_BODIES (DENSE_SELECT)
  }
}

void pw_dense_close (pw_dense *d) {
  if (d == NULL) return;
  free (d->known);
  free (d->zero);
  free (d);
}

int pw_dense_least_unknown (const pw_dense *d) {
  for (int i = 0; i < d->n; i++)
    if (d->pivot[i] == d->least_pivot || isnan (d->pivot[i])) return d->unknown[i];
  return -1;
}
