/* The saddle-point system, condensed to the constraint equations; bodies at which many meet are not (block_ldl.h).
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

/* A pivot is 1 minus a squared cosine.  Round-off leaves the pivot of a dependent row at about eps / s^2, with s the
 * smallest sine of the rows before it: at this one if s = 0.07.  With a smaller s such a row passes, but its sine is
 * below `rank_suspect` (thresholds.c), where opening a run computes the rank. */
#define SADDLE_ROUND_OFF (200 * DBL_EPSILON)

pw_saddle *pw_saddle_open (pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                           pw_error *error) {
  int status = PW_RESOURCE;
  pw_saddle *saddle = calloc (1, sizeof *saddle);
  if (saddle) {
    *saddle = (pw_saddle){ .s = w->s, .w = w, .rows = rows, .pivot = INFINITY, .pivot_row = -1, .dependent_row = -1 };
    status = pw_massless_open (&saddle->massless, w, weight, rows, active, error);
    if (status == PW_OK) status = pw_condense (saddle, weight, active);
  }
  if (status == PW_OK) return saddle;
  pw_saddle_close (saddle);
  pw_fail (error, status, "model %s: out of memory", w->s->model);
  return NULL;
}

void pw_saddle_close (pw_saddle *saddle) {
  if (saddle == NULL) return;
  pw_massless_close (&saddle->massless);
  pw_block_close (saddle->block);
  free (saddle->y);
  free (saddle->memory);
  free (saddle);
}

void pw_saddle_postpone (pw_saddle *saddle, double pivot) {
  saddle->postponed = pivot;
}

int pw_saddle_factor (pw_saddle *saddle) {
  saddle->postponed = 0;
  saddle->pivot_row = saddle->dependent_row;
  if (saddle->block == NULL) return saddle->pivot = 0, PW_RETRY;
  saddle->pivot = saddle->massless.components ? pw_massless_factor (&saddle->massless) : INFINITY;
  if (!(saddle->pivot > SADDLE_ROUND_OFF)) return PW_RETRY;
  pw_block_factor (saddle->block);
  if (!(saddle->block->least_pivot >= saddle->pivot)) {
    const int row = saddle->block->least_unknown;
    saddle->pivot = saddle->block->least_pivot;
    saddle->pivot_row = row >= 0 && row < saddle->s->rows && saddle->massless.component_of_row[row] < 0 ? row : -1;
  }
  return saddle->pivot > SADDLE_ROUND_OFF ? PW_OK : PW_RETRY;
}

int pw_saddle_sine_below (pw_saddle *saddle, double sine) {
  if (sine * sine <= saddle->postponed) return 0;
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  return !(saddle->pivot >= sine * sine);
}

double pw_saddle_sine (pw_saddle *saddle, int *row) {
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  if (row) *row = saddle->pivot_row;
  return saddle->pivot > 0 ? sqrt (fmin (saddle->pivot, 1)) : 0;
}

void pw_saddle_solve (pw_saddle *saddle, const double *f, const double *gamma, double *a, double *lambda) {
  const size_t bytes = (size_t)saddle->rows * sizeof *lambda;
  double *y = saddle->extra ? saddle->y : lambda;
  if (saddle->postponed > 0) pw_saddle_factor (saddle);
  if (y != gamma) memcpy (y, gamma, bytes);
  for (int i = 0; i < saddle->extra; i++) y[saddle->s->rows + i] = 0;
  if (saddle->massless.components) {
    for (int j = 0; j < saddle->s->coords; j++) saddle->force[j] = f ? f[j] : 0;
    f = saddle->force;
    pw_massless_forward (&saddle->massless, saddle->force, y);
  }
  pw_block_solve (saddle->block, f, y, a);
  if (y != lambda) memcpy (lambda, y, bytes);
  for (int i = 0; i < saddle->inactive_count; i++) lambda[saddle->inactive[i]] = 0;
  if (saddle->massless.components) pw_massless_backward (&saddle->massless, a, lambda);
}
