/* The saddle-point system, condensed to the constraint equations.
 *
 *   S lambda = J W^-1 f - gamma,  S = J W^-1 J^T,     a = W^-1 (f - J^T lambda)
 *
 * (Golub & Greif 2003, On solving block-structured indefinite linear systems.)  Equations that share no coordinate with
 * weight do not meet in S, so S has the pattern of the mechanism: a chain is block tridiagonal.  Coordinates without
 * weight are eliminated first, in massless.c. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "saddle.h"
#include "condense.h"

/* A pivot is 1 minus a squared cosine.  Round-off leaves a dependent row about eps / s^2, with s the smallest sine of
 * the rows before it: this for an s of 0.07.  With a smaller s, the rank is computed (`suspect` in singular.c). */
#define SADDLE_ROUND_OFF (200 * DBL_EPSILON)

pw_saddle *pw_saddle_open (pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                           pw_error *error) {
  int status = PW_RESOURCE;
  pw_saddle *k = calloc (1, sizeof *k);
  if (k) {
    *k = (pw_saddle){ .s = w->s, .w = w, .rows = rows, .pivot = INFINITY, .pivot_row = -1 };
    status = pw_massless_open (&k->massless, w, weight, rows, active, error);
    if (status == PW_OK) status = pw_condense (k, weight, active);
  }
  if (status == PW_OK) return k;
  pw_saddle_close (k);
  pw_fail (error, status, "model %s: out of memory", w->s->model);
  return NULL;
}

void pw_saddle_close (pw_saddle *k) {
  if (k == NULL) return;
  pw_massless_close (&k->massless);
  pw_block_close (k->block);
  free (k->y);
  free (k->memory);
  free (k);
}

/* ---- Factorising ---- */

void pw_saddle_postpone (pw_saddle *k, double pivot) {
  k->postponed = pivot;
}

int pw_saddle_factor (pw_saddle *k) {
  k->postponed = 0;
  k->pivot_row = -1;
  k->pivot = k->massless.components ? pw_massless_factor (&k->massless) : INFINITY;
  if (!(k->pivot > SADDLE_ROUND_OFF)) return PW_RETRY;
  pw_block_factor (k->block);
  if (!(k->block->pivot >= k->pivot)) {
    const int row = k->block->row;
    k->pivot = k->block->pivot;
    k->pivot_row = row >= 0 && row < k->s->rows && k->massless.component_of_row[row] < 0 ? row : -1;
  }
  return k->pivot > SADDLE_ROUND_OFF ? PW_OK : PW_RETRY;
}

int pw_saddle_sine_below (pw_saddle *k, double sine) {
  if (sine * sine <= k->postponed) return 0;
  if (k->postponed > 0) pw_saddle_factor (k);
  return !(k->pivot >= sine * sine);
}

double pw_saddle_sine (pw_saddle *k, int *row) {
  if (k->postponed > 0) pw_saddle_factor (k);
  *row = k->pivot_row;
  return k->pivot > 0 ? sqrt (fmin (k->pivot, 1)) : 0;
}

/* ---- Solving ---- */

void pw_saddle_solve (pw_saddle *k, const double *f, const double *gamma, double *a, double *lambda) {
  const size_t bytes = (size_t)k->rows * sizeof *lambda;
  double *y = k->more ? k->y : lambda;
  if (k->postponed > 0) pw_saddle_factor (k);
  if (y != gamma) memcpy (y, gamma, bytes);
  for (int i = 0; i < k->more; i++) y[k->s->rows + i] = 0;
  if (k->massless.components) {
    for (int j = 0; j < k->s->coords; j++) k->force[j] = f ? f[j] : 0;
    f = k->force;
    pw_massless_forward (&k->massless, k->force, y);
  }
  pw_block_solve (k->block, f, y, a);
  if (y != lambda) memcpy (lambda, y, bytes);
  for (int i = 0; i < k->inactives; i++) lambda[k->inactive[i]] = 0;
  if (k->massless.components) pw_massless_backward (&k->massless, a, lambda);
}
