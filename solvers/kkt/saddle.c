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
#include "unroll.h"

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
    if (status == PW_OK) status = pw_condense (k, weight, rows, active);
  }
  if (status == PW_OK) return k;
  pw_saddle_close (k);
  pw_fail (error, status, "model %s: out of memory", s->model);
  return NULL;
}

void pw_saddle_close (pw_saddle *k) {
  if (k == NULL) return;
  pw_reduce_close (&k->reduce);
  pw_large_close (k->large);
  free (k->inverse);
  free (k->memory);
  free (k);
}

/* ---- Factorising ---- */

/* Takes over the smallest pivot of the rows. */
static inline int saddle_judge_large (pw_saddle *k) {
  if (!(k->large->pivot >= k->pivot)) {
    k->pivot = k->large->pivot;
    k->pivot_row = k->large->row < k->s->rows ? k->large->row : -1;
  }
  return k->pivot > k->guard ? PW_OK : PW_RETRY;
}

/* Eliminates the coordinates without weight, if `fresh`, and from f and gamma, if given. */
static inline int saddle_begin (pw_saddle *k, int fresh, const double *gamma, double *f) {
  double pivot = k->reduce.components ? pw_reduce_forward (&k->reduce, fresh, gamma, f) : INFINITY;
  if (!fresh) return PW_OK;
  k->pivot_row = -1;
  k->pivot = pivot;
  return k->pivot > k->guard ? PW_OK : PW_RETRY;
}

int pw_saddle_factor (pw_saddle *k) {
  if (saddle_begin (k, 1, NULL, NULL) != PW_OK) return PW_RETRY;
  if (k->small) return pw_small_factor (k->small) ? PW_OK : PW_RETRY;
  pw_large_factor (k->large);
  return saddle_judge_large (k);
}

int pw_saddle_below (const pw_saddle *k, double sine) {
  int row;
  if (k->small && !k->small->low && sine * sine <= PW_SMALL_WATCH) return k->pivot < sine * sine;
  return pw_saddle_pivot (k, &row) < sine;
}

double pw_saddle_pivot (const pw_saddle *k, int *row) {
  double pivot = k->pivot;
  *row = k->pivot_row < 0 && k->reduce.components ? pw_reduce_weakest (&k->reduce) : k->pivot_row;
  if (k->small && pivot > k->guard) {
    int place;
    double small = pw_small_pivot (k->small, &place);
    if (small >= pivot) return sqrt (fmin (pivot, 1));
    pivot = small;
    *row = place < 0 || k->small->row[place] >= k->s->rows ? -1 : k->small->row[place];
  }
  return pivot > 0 ? sqrt (fmin (pivot, 1)) : 0;
}

/* ---- Solving ---- */

/* Where there are more unknowns than rows, those of components or of kept bodies, gamma and lambda are copies with these
 * at the end. */
static inline const double *saddle_more (pw_saddle *k, const double *gamma) {
  for (int i = 0; i < k->rows; i++) k->y[i] = gamma[i];
  for (int i = k->s->rows; i < k->s->rows + k->more; i++) k->y[i] = 0;
  for (const pw_extra *x = k->extra; x < k->extra + k->extras; x++) k->y[x->y] = *x->gamma;
  return k->y;
}

static inline void saddle_take_more (pw_saddle *k, double *lambda) {
  for (int i = 0; i < k->rows; i++) lambda[i] = k->y[i];
  for (const pw_extra *x = k->extra; x < k->extra + k->extras; x++) *x->lambda = k->y[x->y];
}

/* The large scene's part; lambda serves as its right-hand side. */
static inline int saddle_large (pw_saddle *k, int fresh, const double *f, const double *gamma, double *a,
                                double *lambda) {
  if (lambda != gamma) memcpy (lambda, gamma, (size_t)k->rows * sizeof *lambda);
  if (fresh)
    pw_large_both (k->large, f, lambda, a);
  else
    pw_large_solve (k->large, f, lambda, a);
  return fresh ? saddle_judge_large (k) : PW_OK;
}

/* Solves, and factorises before that if `fresh`; more: there are more unknowns than rows. */
PW_INLINE int saddle_solve (pw_saddle *k, int fresh, int more, const double *f, const double *gamma, double *a,
                            double *lambda) {
  double *force = k->force, *l = more ? k->y : lambda;
  int status = PW_OK;
  if (k->reduce.components) {
    if (f)
      memcpy (force, f, (size_t)k->s->coords * sizeof *f);
    else
      memset (force, 0, (size_t)k->s->coords * sizeof *force);
    f = force;
  }
  if (saddle_begin (k, fresh, gamma, force) != PW_OK) return PW_RETRY;
  if (more) gamma = saddle_more (k, gamma);
  if (k->small == NULL)
    status = saddle_large (k, fresh, f, gamma, a, l);
  else if (!fresh)
    pw_small_solve (k->small, f, gamma, a, l);
  else if (!pw_small_both (k->small, f, gamma, a, l))
    status = PW_RETRY;
  if (status != PW_OK) return status;
  if (more) saddle_take_more (k, lambda);
  for (int i = 0; i < k->idles; i++) lambda[k->idle[i]] = 0;
  if (k->reduce.components) pw_reduce_backward (&k->reduce, a, lambda);
  return PW_OK;
}

static int saddle_any (pw_saddle *k, int fresh, const double *f, const double *gamma, double *a, double *lambda) {
  if (k->more) return saddle_solve (k, fresh, 1, f, gamma, a, lambda);
  return fresh ? saddle_solve (k, 1, 0, f, gamma, a, lambda) : saddle_solve (k, 0, 0, f, gamma, a, lambda);
}

void pw_saddle_solve (pw_saddle *k, const double *f, const double *gamma, double *a, double *lambda) {
  if (k->plain)
    pw_small_solve (k->plain, f, gamma, a, lambda);
  else
    (void)saddle_any (k, 0, f, gamma, a, lambda);
}

int pw_saddle_factor_solve (pw_saddle *k, const double *f, const double *gamma, double *a, double *lambda) {
  if (k->plain) return pw_small_both (k->plain, f, gamma, a, lambda) ? PW_OK : PW_RETRY;
  return saddle_any (k, 1, f, gamma, a, lambda);
}
