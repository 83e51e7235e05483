/* The saddle-point system, condensed to the constraint rows.
 *
 *   S lambda = J W^-1 f - gamma,  S = J W^-1 J^T,     a = W^-1 (f - J^T lambda)
 *
 * (Golub & Greif 2003, On solving block-structured indefinite linear systems.)  Rows that share no coordinate with
 * weight do not meet in S, so S has the pattern of the mechanism: a chain is block tridiagonal.  Coordinates without
 * weight are eliminated before, in reduce.c. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "saddle.h"
#include "condense.h"

/* A pivot is 1 minus the square of a cosine: of a dependent row round-off leaves some eps. */
#define SADDLE_ROUND_OFF (200 * DBL_EPSILON)

pw_saddle *pw_saddle_open (pw_system *s, const double *weight, int rows, const unsigned char *active, pw_error *error) {
  int status = PW_MACHINE;
  pw_saddle *k = calloc (1, sizeof *k);
  if (k) {
    k->s = s;
    k->guard = SADDLE_ROUND_OFF;
    k->pivot = INFINITY;
    k->pivot_row = -1;
    status = pw_reduce_open (&k->reduce, s, weight, rows, active, error);
    if (status == PW_OK) status = pw_condense (k, weight, rows, active, error);
  }
  if (status == PW_OK) return k;
  pw_saddle_close (k);
  pw_fail (error, status, "model %s: out of memory", s->model);
  return NULL;
}

void pw_saddle_close (pw_saddle *k) {
  if (k == NULL) return;
  pw_reduce_close (&k->reduce);
  pw_ldl_close (k->ldl);
  free (k->inverse);
  free (k->memory);
  free (k);
}

/* ---- Assembly ---- */

/* A row of 3 columns. */
typedef struct {
  double x, y, z;
} saddle_row;

static inline saddle_row saddle_scaled (const double *J, const double *w) {
  return (saddle_row){ J[0] * w[0], J[1] * w[1], J[2] * w[2] };
}

static inline double saddle_dot (saddle_row a, const double *b) {
  return a.x * b[0] + a.y * b[1] + a.z * b[2];
}

/* Runs over the terms of a shape: names A, B, the scaled row(s) of A and the block T. */
#define SADDLE_EACH(shape)                                                                                             \
  for (const pw_term *t = k->term + k->first[shape], *end = k->term + k->first[shape + 1]; t < end; t++)
#define SADDLE_PARTS                                                                                                   \
  const double *A = k->base + t->A, *B = k->base + t->B, *w = k->inverse + t->j;                                       \
  double *T = k->value + t->to;                                                                                        \
  saddle_row a = saddle_scaled (A, w)

static void saddle_assemble_short (pw_saddle *k) {
  SADDLE_EACH (PW_TERM_D1) {
    SADDLE_PARTS;
    T[0] += saddle_dot (a, B);
  }
  SADDLE_EACH (PW_TERM_D2) {
    SADDLE_PARTS;
    saddle_row a1 = saddle_scaled (A + t->step_a, w);    T[0] += saddle_dot (a, B);
    T[t->step_t] += saddle_dot (a1, B);
    T[t->step_t + 1] += saddle_dot (a1, B + t->step_b);
}
  SADDLE_EACH (PW_TERM_11) {
    SADDLE_PARTS;
    T[0] += saddle_dot (a, B);
  }
  SADDLE_EACH (PW_TERM_12) {
    SADDLE_PARTS;
    T[0] += saddle_dot (a, B);
    T[1] += saddle_dot (a, B + t->step_b);
  }
  SADDLE_EACH (PW_TERM_21) {
    SADDLE_PARTS;    T[0] += saddle_dot (a, B);
    T[t->step_t] += saddle_dot (saddle_scaled (A + t->step_a, w), B);
}
  SADDLE_EACH (PW_TERM_22) {
    SADDLE_PARTS;
    saddle_row a1 = saddle_scaled (A + t->step_a, w);
    T[0] += saddle_dot (a, B);
    T[1] += saddle_dot (a, B + t->step_b);    T[t->step_t] += saddle_dot (a1, B);
    T[t->step_t + 1] += saddle_dot (a1, B + t->step_b);
}
}

static void saddle_assemble_wide (pw_saddle *k) {
  for (const pw_wide_term *t = k->wide; t < k->wide + k->wides; t++)
    for (int x = 0; x < t->a; x++)
      for (int y = 0; y < t->b; y++) {
        double sum = 0;
        for (int n = 0; n < t->width; n++) sum += t->A[x * t->step_a + n] * k->inverse[t->j + n] * t->B[y * t->step_b + n];
        k->value[t->to + x * t->step_t + y] += sum;
      }
}

/* Takes over the smallest pivot of the rows.  A row whose coordinates are all held, or all belong to the ground, leaves an empty
 * diagonal: singular. */
static int saddle_judge (pw_saddle *k, double pivot, int row) {
  if (!(pivot >= k->pivot)) {
    k->pivot = pivot;
    k->pivot_row = row;
  }
  return k->pivot > k->guard ? PW_OK : PW_RETRY;
}

/* Eliminates the coordinates without weight. */
static inline int saddle_begin (pw_saddle *k) {
  k->pivot_row = -1;
  k->pivot = INFINITY;
  if (k->reduce.components == 0) return PW_OK;
  k->pivot = pw_reduce_factor (&k->reduce);
  return k->pivot > k->guard ? PW_OK : PW_RETRY;
}

int pw_saddle_factor (pw_saddle *k) {
  int node;
  if (saddle_begin (k) != PW_OK) return PW_RETRY;
  if (k->small) return pw_small_factor (k->small) ? PW_OK : PW_RETRY;
  for (size_t i = 0; i < k->values; i++) k->value[i] = 0;
  saddle_assemble_short (k);
  if (k->wides) saddle_assemble_wide (k);
  double pivot = pw_ldl_factor (k->ldl, &node);
  return saddle_judge (k, pivot, node >= 0 ? k->row_of_node[node] : -1);
}

int pw_saddle_below (const pw_saddle *k, double sine) {
  int row;
  if (k->small && !k->small->low && sine * sine <= PW_SMALL_WATCH) return k->pivot < sine * sine;
  return pw_saddle_pivot (k, &row) < sine;
}

void pw_saddle_set_guard (pw_saddle *k, double guard) {
  k->guard = fmax (guard * guard, SADDLE_ROUND_OFF);
  if (k->small) k->small->guard = k->guard;
}

double pw_saddle_pivot (const pw_saddle *k, int *row) {
  int place;
  double pivot = k->pivot, small = k->small && pivot > k->guard ? pw_small_pivot (k->small, &place) : INFINITY;
  *row = k->pivot_row;
  if (!(small >= pivot)) {
    pivot = small;
    *row = place < 0 ? -1 : k->row_of[place];
  }
  return pivot > 0 ? sqrt (fmin (pivot, 1)) : 0;
}

/* ---- Small scenes ---- */

/* Where rows of components take part, gamma and lambda are copies with these at the end; y is of no other use here. */
static const double *saddle_small_gamma (pw_saddle *k, const double *gamma) {
  int rows = k->s->rows;
  if (k->extras == 0) return gamma;
  for (int i = 0; i < k->rows; i++) k->y[i] = gamma[i];
  for (int e = 0; e < k->extras; e++) k->y[rows + e] = *k->extra[e].gamma;
  return k->y;
}

static inline void saddle_small_finish (pw_saddle *k, double *a, double *lambda) {
  int rows = k->s->rows;
  for (int e = 0; e < k->extras; e++) *k->extra[e].lambda = k->y[rows + e];
  for (int i = 0; k->extras && i < k->unknowns; i++)
    if (k->row_of[i] >= 0) lambda[k->row_of[i]] = k->y[k->row_of[i]];
  for (int i = 0; i < k->idles; i++) lambda[k->idle[i]] = 0;
  if (k->reduce.components) pw_reduce_backward (&k->reduce, a, lambda);
}

/* Solves, and factorises before that if `fresh`. */
static inline int saddle_small (pw_saddle *k, int fresh, const double *f, const double *gamma, double *a,
                                double *lambda) {
  double *force = k->force, *l = k->extras ? k->y : lambda;
  if (fresh && saddle_begin (k) != PW_OK) return PW_RETRY;
  if (k->reduce.components) {
    if (f)
      memcpy (force, f, (size_t)k->s->coords * sizeof *f);
    else
      memset (force, 0, (size_t)k->s->coords * sizeof *force);
    pw_reduce_forward (&k->reduce, gamma, force);
    f = force;
  }
  gamma = saddle_small_gamma (k, gamma);
  if (!fresh)
    pw_small_solve (k->small, f, gamma, a, l);
  else if (!pw_small_both (k->small, f, gamma, a, l))
    return PW_RETRY;
  saddle_small_finish (k, a, lambda);
  return PW_OK;
}

/* ---- Solving ---- */

/* y = -gamma, in the order of positions */
static inline void saddle_right (pw_saddle *k, const double *gamma) {
  double *y = k->y;
  const int *row = k->row_of;
  if (k->extras == 0) {
    for (int i = 0; i < k->unknowns; i++) y[i] = -gamma[row[i]];
    return;
  }
  for (int i = 0; i < k->unknowns; i++)
    if (row[i] >= 0) y[i] = -gamma[row[i]];
  for (const pw_extra *x = k->extra; x < k->extra + k->extras; x++) y[x->y] = -*x->gamma;
}

/* y += J W^-1 f */
static void saddle_gather (pw_saddle *k, const double *force) {
  double *y = k->y, *z = k->z;
  for (int j = 0; j < k->s->coords; j++) z[j] = k->inverse[j] * force[j];
  const pw_piece *p = k->piece;
  for (; p < k->piece + k->pieces1; p++) {
    const double *J = k->base + p->J, *f = z + p->j;
    y[p->y] += J[0] * f[0] + J[1] * f[1] + J[2] * f[2];
  }
  for (; p < k->piece + k->pieces; p++) {
    const double *J = k->base + p->J, *K = J + p->step, *f = z + p->j;
    y[p->y] += J[0] * f[0] + J[1] * f[1] + J[2] * f[2];
    y[p->y + 1] += K[0] * f[0] + K[1] * f[1] + K[2] * f[2];
  }
  for (const pw_wide_piece *w = k->wide_piece; w < k->wide_piece + k->wide_pieces; w++)
    for (int x = 0; x < w->size; x++)
      for (int n = 0; n < w->width; n++) y[w->y + x] += w->J[x * w->step + n] * z[w->j + n];
}

/* f -= J^T y, a = W^-1 f */
static void saddle_scatter (pw_saddle *k, double *force, double *a) {
  const double *y = k->y;
  const pw_piece *p = k->piece;
  for (; p < k->piece + k->pieces1; p++) {
    const double *J = k->base + p->J, l = y[p->y];
    double *f = force + p->j;
    f[0] -= J[0] * l;
    f[1] -= J[1] * l;
    f[2] -= J[2] * l;
  }
  for (; p < k->piece + k->pieces; p++) {
    const double *J = k->base + p->J, *K = J + p->step, l = y[p->y], m = y[p->y + 1];
    double *f = force + p->j;
    f[0] -= J[0] * l + K[0] * m;
    f[1] -= J[1] * l + K[1] * m;
    f[2] -= J[2] * l + K[2] * m;
  }
  for (const pw_wide_piece *w = k->wide_piece; w < k->wide_piece + k->wide_pieces; w++)
    for (int x = 0; x < w->size; x++)
      for (int n = 0; n < w->width; n++) force[w->j + n] -= w->J[x * w->step + n] * y[w->y + x];
  for (int j = 0; j < k->s->coords; j++) a[j] = k->inverse[j] * force[j];
}

/* lambda out of y */
static inline void saddle_left (pw_saddle *k, double *lambda) {
  const double *y = k->y;
  const int *row = k->row_of;
  if (k->extras == 0)
    for (int i = 0; i < k->unknowns; i++) lambda[row[i]] = y[i];
  else {
    for (int i = 0; i < k->unknowns; i++)
      if (row[i] >= 0) lambda[row[i]] = y[i];
    for (const pw_extra *x = k->extra; x < k->extra + k->extras; x++) *x->lambda = y[x->y];
  }
  for (int i = 0; i < k->idles; i++) lambda[k->idle[i]] = 0;
}

void pw_saddle_solve (pw_saddle *k, const double *f, const double *gamma, double *a, double *lambda) {
  if (k->plain) {
    pw_small_solve (k->plain, f, gamma, a, lambda);
    return;
  }
  if (k->small) {
    saddle_small (k, 0, f, gamma, a, lambda);
    return;
  }
  for (int j = 0; j < k->s->coords; j++) k->force[j] = f ? f[j] : 0;
  if (k->reduce.components) pw_reduce_forward (&k->reduce, gamma, k->force);
  saddle_right (k, gamma);
  saddle_gather (k, k->force);
  pw_ldl_solve (k->ldl, k->y);
  saddle_scatter (k, k->force, a);
  saddle_left (k, lambda);
  if (k->reduce.components) pw_reduce_backward (&k->reduce, a, lambda);
}

int pw_saddle_factor_solve (pw_saddle *k, const double *f, const double *gamma, double *a, double *lambda) {
  if (k->plain) return pw_small_both (k->plain, f, gamma, a, lambda) ? PW_OK : PW_RETRY;
  if (k->small) return saddle_small (k, 1, f, gamma, a, lambda);
  int status = pw_saddle_factor (k);
  if (status == PW_OK) pw_saddle_solve (k, f, gamma, a, lambda);
  return status;
}
