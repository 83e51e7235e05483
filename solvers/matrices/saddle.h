/* The saddle-point system  [ W J^T ; J 0 ] (a, lambda) = (f, gamma)  of a scene, with W diagonal.
 *
 * W is the mass matrix for accelerations and impulses, or a metric for projections.  An entry of W, a weight, may be 0
 * (a coordinate without mass: eliminated through a constraint row matched to it) or INFINITY (a prescribed coordinate:
 * it does not move; a row of prescribed coordinates alone is ignored, its multiplier is 0).  Coordinates with weight
 * are condensed out, except those of bodies at which many rows meet; the remaining system is factorised as a sparse
 * symmetric matrix whose order and pattern are laid out once.  Nothing is allocated after opening. */
#ifndef PW_SADDLE_H
#define PW_SADDLE_H

#include "system.h"

/* Private, except for tests. */
typedef struct pw_saddle {
  int (*run) (struct pw_saddle *saddle, int factors, const double *f, const double *gamma, double *a, double *lambda);
  const pw_system *s;
  const pw_workspace *w; /* contains J */
  int rows;              /* of J: all, or the holonomic ones */
  double postponed;      /* > 0: not factorised yet; the pivots are at least this (pw_saddle_postpone) */
  int components;        /* of rows and massless coordinates */
  struct pw_component *component;
  int *component_of_row;      /* s->rows; -1: inactive, or without massless coordinates */
  double *inverse_weight;     /* coords + 3: 1 / weight; 0 for prescribed and massless coordinates, and the ground's */
  double *force;              /* coords: f~ of saddle.c */
  int extra;                  /* unknowns besides the multipliers of rows: 3 for each uncondensed body */
  double *y;                  /* s->rows + extra: right-hand side and solution; NULL without extra unknowns */
  struct pw_block_ldl *block; /* S, sparse, or */
  struct pw_dense *dense;     /* dense; both are NULL if there is a dependent_row: nothing is planned then */
  int dependent_row;          /* one that depends on others in every configuration; -1: none */
  int *inactive;              /* rows outside massless components whose multiplier is 0 */
  int inactive_count;
  double pivot; /* smallest when last factorised: of S, the squared sine of the angle between a row and those before
                 * it; of massless coordinates, see massless_forward_all */
  char *memory;
} pw_saddle;

/* rows: number of rows of J included (all, or the holonomic ones); of these only those with active[i] != 0 if active is
 * given.  J must be evaluated at a typical configuration.  weight: coords.  The saddle refers to w, but not to weight
 * and active, after opening.  NULL on errors: PW_RESOURCE; PW_INPUT if a coordinate without weight is determined by no
 * row. */
pw_saddle *pw_saddle_open (pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                           pw_error *error);
void pw_saddle_close (pw_saddle *saddle); /* may be NULL */

/* Factorises with the J last evaluated.  Returns PW_OK, or PW_RETRY if the smallest pivot is the round-off of a
 * dependent row, or NaN.  If more rows were included than the coordinates of some bodies allow to be independent,
 * nothing has been planned: then it always returns PW_RETRY, and there are no solutions. */
int pw_saddle_factor (pw_saddle *saddle);

/* J has been evaluated by specialised code, which found pivots of at least `pivot`, a squared sine: the saddle will be
 * factorised when the factors are needed, with the J evaluated last by then. */
void pw_saddle_postpone (pw_saddle *saddle, double pivot);

/* Solves for a (coords) and lambda (rows; 0 for inactive ones).  f may be NULL: zero.  a and f may be the same array,
 * and so may lambda and gamma. */
void pw_saddle_solve (pw_saddle *saddle, const double *f, const double *gamma, double *a, double *lambda);

/* Factorises, and then solves unless it returns PW_RETRY; a and lambda are arbitrary in that case. */
static inline int pw_saddle_factor_solve (pw_saddle *saddle, const double *f, const double *gamma, double *a,
                                          double *lambda) {
  return saddle->run (saddle, 1, f, gamma, a, lambda);
}

/* 1 if pw_saddle_sine is below this sine. */
static inline int pw_saddle_sine_below (pw_saddle *saddle, double sine) {
  const double square = sine * sine;
  if (square <= saddle->postponed) return 0;
  if (saddle->postponed > 0) (void)pw_saddle_factor (saddle);
  return !(saddle->pivot >= square);
}

/* The square root of the smallest pivot, at most 1; 0 if that is not positive.  It is the sine of the angle between a
 * row and those before it, or a relative pivot of a coordinate without weight: small near a singular configuration.
 * *row (unless NULL): that row, or -1 for one that contains coordinates without weight, or if there is none. */
double pw_saddle_sine (pw_saddle *saddle, int *row);

#endif
