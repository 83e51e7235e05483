/* Comparisons: errors against a reference solution and cost, over ladders of tolerances or steps. */
#ifndef PW_COMPARE_H
#define PW_COMPARE_H

#include "study.h"

enum { COMPARE_REPEATS = 99, COMPARE_PARTNERS = 3 };

/* The solution against which errors are measured, and how accurate it is. */
typedef struct {
  pw_motion motion;
  int known;                         /* 0: there is none */
  double uncertainty[MOTION_ERRORS]; /* 0 where nothing is compared */
  double size[MOTION_UNITS];         /* largest coordinate or velocity */
  char about[300];                   /* "erk8+projection, rtol 3e-14" or the file's name */
  int partners;                      /* methods it was compared with, and their distances from it */
  struct {
    char about[100];
    double error[MOTION_ERRORS];
  } partner[COMPARE_PARTNERS];
} pw_reference;

typedef struct {
  pw_study study;
  const char *rtol_text, *step_text, *repeats_text;
  double finest_step; /* of the ladder [s] */
  double repeats;     /* timed runs of a row, at most */
  pw_reference reference;
  pw_motion scratch; /* of the row being measured */
} pw_compare;

/* ---- compare_run.c ---- */

/* One run of a row; with a motion its samples are taken, and the ledger is kept.  As pw_study_run. */
int pw_compare_run (pw_compare *x, pw_row *r, pw_motion *motion, pw_error *error);

/* ---- reference.c ---- */

/* Finds the reference: a table, the exact solution of the model, or computed by methods; the table's end is that of the
 * comparison unless --t-end is given. */
int pw_reference_find (pw_compare *x, pw_error *error);

/* ---- compare_output.c ---- */

void pw_compare_print_reference (const pw_compare *x, FILE *f);
/* How the reference was found, as DIR/reference.csv. */
int pw_compare_write_reference (const pw_compare *x, pw_error *error);
void pw_compare_head (const pw_study *x, int group, int width, FILE *f);
void pw_compare_line (const pw_study *x, const pw_row *r, FILE *f);
void pw_compare_names (pw_text *t);
void pw_compare_cells (const pw_study *x, const pw_row *r, pw_text *t);
/* Work-precision diagrams. */
int pw_compare_figures (pw_study *x, pw_error *error);

#endif
