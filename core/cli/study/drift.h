/* Drift: how far a long run leaves the constraints and the energy balance, by method and stabilisation. */
#ifndef PW_DRIFT_H
#define PW_DRIFT_H

#include "study.h"
#include "sweep_grid.h"

enum { DRIFT_PARTS = 200 }; /* of a run: each has a point in the figures */

/* The methods, then the effect of the options of two stabilisations. */
enum { DRIFT_METHODS, DRIFT_BAUMGARTE, DRIFT_PROJECTION, DRIFT_GROUPS };

typedef struct {
  pw_study study;
  const char **vary;
  int only_methods;
  pw_grid alpha, beta, every; /* one axis each */
} pw_drift;

/* ---- drift_output.c ---- */

void pw_drift_print_title (const pw_study *x);
void pw_drift_head (const pw_study *x, int group, int width, FILE *f);
void pw_drift_line (const pw_study *x, const pw_row *r, FILE *f);
void pw_drift_names (pw_text *t);
void pw_drift_cells (const pw_study *x, const pw_row *r, pw_text *t);
/* Residuals and energy balance against time as DIR/drift-time.csv, and the figures. */
int pw_drift_figures (pw_study *x, pw_error *error);

#endif
