/* Independent constraint equations (rank.c, independent.c), and the redundant ones as combinations of them
 * (independent.c). */
#ifndef PW_RANK_H
#define PW_RANK_H

#include "run.h"
#include "system.h"

struct pw_run;

/* Most entries, rows x coordinates, of a dense matrix: 320 MB. */
#define PW_RANK_MAX_ENTRIES 4e7

/* The factor by which coordinate j becomes a length: 1, or L for an angle. */
double pw_length_factor (const pw_system *s, int j);

/* All rows of the J last evaluated, dense (rows x coords), as derivatives with respect to these lengths, normalised to
 * length 1; `norm` (rows, or NULL): their former lengths; empty rows stay 0. */
void pw_rank_rows (const pw_workspace *w, double *rows, double *norm);

/* Weights of a metric of lengths: the squares of these factors. */
void pw_length_weights (const pw_system *s, double *weight);

/* The n-th of a sequence of irregular numbers in [-1, 1], without symmetries that a scene could share: sines of
 * multiples of the golden angle.  Another phase, an arbitrary number, gives another sequence. */
static inline double pw_irregular (double phase, int n) {
  return pw_sin (phase + 2.39996 * n);
}

/* Independent rows of J.  Those that belong to every maximal independent set are found by their pattern; of the others,
 * an orthonormal basis is kept. */
typedef struct {
  struct pw_run *run;    /* whose settings.stop ends the selection (r->stopped), or NULL */
  unsigned char *active; /* rows: 1 for the independent ones */
  int rank;              /* number of rows in the basis */
  int *kept;             /* rank: their indices */
  double *rows;          /* rows x coords: those kept are the basis, the others scratch */
  double *norm;          /* rows: scratch */
  int coords;            /* columns in which the others have entries */
  int *first, *column;   /* rows + 1: the first entry of each row; column of each entry of J */
  double *value;         /* of these entries */
  int *count, *queue;    /* columns: number of remaining rows with an entry; scratch */
  long *sum;             /* columns: sum of the indices of these rows */
  char *memory;
} pw_row_basis;
int pw_row_basis_open (pw_row_basis *b, const pw_system *s); /* PW_OK or PW_RESOURCE */
void pw_row_basis_close (pw_row_basis *b);

/* Selects at most `max_holonomic` holonomic equations, and at most `max_rows` in all, by Gram-Schmidt on the J last
 * evaluated, rows of length 1: those of which a part longer than tol is independent of the ones kept before.  Holonomic
 * equations come first, since a nonholonomic one must not replace a holonomic one; of each kind the most independent
 * ones, in order where they are about equal.  Returns the rank. */
int pw_row_basis_select (pw_row_basis *b, const pw_workspace *w, double tol, int max_holonomic, int max_rows);

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
