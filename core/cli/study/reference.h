/* The reference solution of a comparison: a table, the exact solution of the model, or else a motion computed with a
 * tight tolerance.  The solution of the model is used if it contains all coordinates, its velocities if it contains
 * all of them.  Several methods compute one; of the two that agree best, the first is the reference, and their
 * distance is its uncertainty. */
#ifndef PW_REFERENCE_H
#define PW_REFERENCE_H

#include "motion.h"
#include "study.h"

enum { REFERENCE_CANDIDATES = 4 };

typedef struct {
  pw_motion motion;
  int known;                         /* 0: there is no reference */
  int from_table;                    /* 1: it is the table of --reference */
  int limited;                       /* 1: the limit of processor time has stopped a method that would compute it */
  double uncertainty[MOTION_ERRORS]; /* 0 where nothing is compared */
  double size[MOTION_UNITS];         /* largest coordinate or velocity */
  char gaps[MOTION_GAPS]; /* pw_motion_gaps of the table or, if a computed reference replaces it, of the model's own */
  char name[300];         /* "erk8+projection, rtol 3e-14", "the exact solution of the model" or a path */
  int partners;           /* number of other computed solutions, with their distances from this one */
  struct {
    char name[100];
    double error[MOTION_ERRORS];
  } partner[REFERENCE_CANDIDATES - 1];
} pw_reference;

/* One run of a row at its level, as pw_study_run.  Stores the samples of a motion and the largest energy balance;
 * motion NULL: without samples, for the measurement of times. */
int pw_motion_run (pw_study *study, pw_row *row, pw_motion *motion, pw_error *error);

/* Finds the reference.  step: the smallest step size of the comparison [s].  Sets the study's t_end to the end of a
 * table unless --t-end is given.  Close the motion of the reference in every case. */
int pw_reference_find (pw_reference *reference, pw_study *study, double step, pw_error *error);

/* Prints the reference, its uncertainty and its distances from the first `partners` other solutions. */
void pw_reference_print (const pw_reference *reference, int partners);
/* Writes FOLDER/truth.csv: the uncertainty of the reference, and its distances from all other solutions, under the
 * names and units of error_columns[0 to MOTION_ERRORS - 1]. */
int pw_reference_write (const pw_reference *reference, const char *folder, const pw_study_column *error_columns,
                        pw_error *error);

/* ---- The conclusion of a comparison (conclusion.c) ---- */

/* Prints the processor time of each method for numbers of digits that agree with a known reference, and failures.
 * error_column: index of the largest error of lengths in the values of a row; that of angles follows. */
void pw_conclusion_print (const pw_study *study, const pw_reference *reference, int error_column);

#endif
