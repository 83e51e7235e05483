/* Reference solutions of comparisons: a table, the exact solution of the model, or else computed by independent
 * methods at tight tolerances.  Of the two that agree best, the first is the reference; their distance is its
 * uncertainty. */
#ifndef PW_REFERENCE_H
#define PW_REFERENCE_H

#include "motion.h"
#include "study.h"

enum { REFERENCE_CANDIDATES = 4 };

typedef struct {
  pw_motion motion;
  int known;                         /* 0: there is no reference */
  double uncertainty[MOTION_ERRORS]; /* 0 where nothing is compared */
  double size[MOTION_UNITS];         /* largest coordinate or velocity */
  char about[300];                   /* "erk8+projection, rtol 3e-14" or the file's name */
  int partners;                      /* methods it was compared with, and their distances from it */
  struct {
    char about[100];
    double error[MOTION_ERRORS];
  } partner[REFERENCE_CANDIDATES - 1];
} pw_reference;

/* One run of a row at its level; with a motion its samples are taken, and the ledger is kept.  As pw_study_run. */
int pw_motion_run (pw_study *x, pw_row *r, pw_motion *motion, pw_error *error);

/* Finds the reference; `step` is the smallest of the comparison.  The end of a table is that of the comparison unless
 * --t-end is given.  Close its motion in every case. */
int pw_reference_find (pw_reference *ref, pw_study *x, double step, pw_error *error);

/* Prints the reference and its uncertainty; `measured`: it is a table; `all`: its distances from all other solutions. */
void pw_reference_print (const pw_reference *ref, int measured, int all);
/* FOLDER/truth.csv: the uncertainty of the reference, and its distances from other solutions; `of`: columns of the errors. */
int pw_reference_write (const pw_reference *ref, const char *folder, const pw_study_column *of, pw_error *error);

/* ---- The conclusion of a comparison (conclusion.c) ---- */

/* Prints the processor time of each method for 3, 6 and 9 correct digits against a known reference, and failures.
 * `column` of the rows is the largest error of lengths; that of angles follows. */
void pw_conclusion_print (const pw_study *s, const pw_reference *ref, int column);

#endif
