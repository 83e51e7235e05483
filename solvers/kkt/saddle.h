/* The saddle-point system  [ W J^T ; J 0 ] (a, lambda) = (f, gamma)  of a scene, with W diagonal.
 *
 * W is the mass matrix for accelerations and impulses, or a metric for projections.  An entry of W may be 0 (a
 * coordinate without mass: eliminated through a constraint row matched to it) or INFINITY (prescribed: it does not
 * move; a row of prescribed coordinates alone is ignored, its multiplier is 0). Coordinates with weight are
 * condensed out exactly; the rows left are factorised as a sparse symmetric matrix whose order and pattern are laid
 * out once.  Nothing is allocated after opening. */
#ifndef PW_SADDLE_H
#define PW_SADDLE_H

#include "system.h"

typedef struct pw_saddle pw_saddle;

/* rows: number of rows of J included (all, or the holonomic ones); of these only those with active[i] != 0 if active is
 * given.  J must be evaluated at a typical configuration.  weight: coords, copied.
 * Errors: PW_RESOURCE; PW_INPUT if a coordinate without weight is determined by no row. */
pw_saddle *pw_saddle_open (pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                           pw_error *error);
void pw_saddle_close (pw_saddle *k);

/* Factorises with the J last evaluated.  Returns PW_OK, or PW_RETRY if the smallest pivot is the round-off of a
 * dependent row. */
int pw_saddle_factor (pw_saddle *k);

/* J has been evaluated by specialised code, which found pivots of at least `pivot`, a squared sine: it is factorised
 * when it is needed. */
void pw_saddle_postpone (pw_saddle *k, double pivot);

/* Solves for a (coords) and lambda (rows; inactive ones get 0).  f may be NULL: zero.  a and f may be
 * the same, lambda and gamma too. */
void pw_saddle_solve (pw_saddle *k, const double *f, const double *gamma, double *a, double *lambda);

/* 1 if the smallest pivot of the last factorisation is below this sine. */
int pw_saddle_sine_below (pw_saddle *k, double sine);

/* The smallest pivot of the last factorisation, as the sine of the angle between a row and those before it: small near
 * a singular configuration; *row: that row, or -1 for one of coordinates without weight. */
double pw_saddle_sine (pw_saddle *k, int *row);

#endif
