/* Independent constraint equations, and the redundant ones as combinations of them. */
#ifndef PW_RANK_H
#define PW_RANK_H

#include "system.h"

struct pw_run;

/* Most entries, rows x coordinates, of a dense matrix: 320 MB. */
#define PW_RANK_MAX_ENTRIES 4e7

/* The factor by which coordinate j becomes a length: 1, or L for an angle. */
static inline double pw_length_factor (const pw_system *s, int j) {
  return pw_is_angle (s, j) ? s->scale.length : 1;
}

/* The length of a row of the J last evaluated, as derivatives with respect to these lengths. */
double pw_rank_norm (const pw_workspace *w, int row);

/* All rows of the J last evaluated, dense (rows x coords), as derivatives with respect to these lengths, normalised to
 * length 1; `norm` (rows, or NULL): their former lengths; empty rows stay 0. */
void pw_rank_rows (const pw_workspace *w, double *rows, double *norm);

/* Weights of a metric of lengths: the squares of these factors. */
static inline void pw_length_weights (const pw_system *s, double *weight) {
  for (int j = 0; j < s->coords; j++) weight[j] = pw_length_factor (s, j) * pw_length_factor (s, j);
}

/* The n-th of a sequence of irregular numbers in [-1, 1], without symmetries that a scene could share: sines of
 * multiples of the golden angle.  Another phase, an arbitrary number, gives another sequence. */
static inline double pw_irregular (double phase, int n) {
  return pw_sin (phase + 2.39996 * n);
}

/* Names the elements of the rows with which[i] = wanted, the first four and the number of the others. */
void pw_list_elements (const pw_system *s, const unsigned char *which, int wanted, char *list, size_t size);

/* Selects r->active, a maximal set of independent rows, for the run at its consistent initial state.  The saddle must
 * be open, and opened again afterwards.  r->active stays NULL if all rows are independent: then pw_rank_reselect,
 * _independence and _least_norm must not be called.  Errors: PW_RESOURCE; PW_INITIAL if the rank is higher nearby: the
 * initial configuration is singular; PW_METHOD if a signal failed; PW_STOPPED without a text. */
int pw_rank_open (struct pw_run *r, pw_error *error);

/* Selects r->active again with the J last evaluated.  Returns 1 if another set of the same rank is now active, else 0.
 * Saddle and method of the run still use the previous set.  Errors: PW_RESOURCE. */
int pw_rank_reselect (struct pw_run *r);

/* Conditioning of the active equations: 1 over their largest coefficient in a sum of the redundant ones with irregular
 * weights (rows of norm 1); 0 if NaN.  Redundant equations have about the residuals of the active ones over this.
 * J must be evaluated and the run's saddle factorised at the configuration. */
double pw_rank_independence (struct pw_run *r);

/* Saves or loads r->active; the number of redundant equations must not change.  Saddle and method still use the
 * previous set. */
void pw_rank_serialise (struct pw_run *r, pw_archive *a);

/* The unit of a row's multiplier, from the J last evaluated: 1 for a force, L for a moment (a row without entries in x
 * and y columns). */
double pw_rank_multiplier_unit (const pw_workspace *w, int row);

/* Multipliers of all equations from those of the active ones: those of least norm (moments divided by L) with the same
 * J^T lambda.  J must be evaluated and the run's saddle factorised at the configuration. */
void pw_rank_least_norm (struct pw_run *r, double *lambda);

#endif
