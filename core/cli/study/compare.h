/* Comparisons from inside: one model by several methods, each over a ladder of tolerances or steps.
 *
 *   methods (compare_methods.c) -> truth (compare_truth.c) -> rows (compare_row.c) -> table, CSV, diagrams
 *
 * An error is the distance of two motions (motion.h). */
#ifndef PW_COMPARE_H
#define PW_COMPARE_H

#include <stdio.h>
#include "cli.h"
#include "contestants.h"
#include "motion.h"
#include "progress.h"

enum { COMPARE_REPEATS = 99, COMPARE_PARTNERS = 3 };

typedef struct {
  double from, to; /* from > to > 0 */
} pw_ladder;

typedef enum { COMPARE_DONE, COMPARE_FAILED, COMPARE_REFUSED, COMPARE_STOPPED, COMPARE_SLOW } pw_row_state;

/* A rung of a method's ladder. */
typedef struct {
  const pw_contestant *method;
  double rung;                 /* tolerance, or step [s] */
  pw_row_state state;          /* refused: not begun; stopped: at the limit; slow: not run */
  double t;                    /* reached [s] */
  double error[MOTION_ERRORS]; /* NaN: not known; at the truth's uncertainty: no more than this */
  unsigned below;              /* bit i: error i is no more than the truth's uncertainty */
  double order;                /* observed: how fast the largest error falls with the number of steps; NaN: not known */
  double balance;              /* largest |energy balance| of the samples [J] */
  pw_statistics statistics;    /* of a run without samples and ledger */
  double cpu, spread;          /* of such runs: median; largest less smallest [s] */
  int repeats;
  char reason[500];
} pw_rung;

/* Against what errors are taken, and how far it can be trusted. */
typedef struct {
  pw_motion motion;
  int known;                         /* 0: there is none */
  double uncertainty[MOTION_ERRORS]; /* 0 where nothing is compared */
  double size[MOTION_UNITS];         /* largest coordinate or rate */
  char about[300];                   /* "erk8+projection, rtol 3e-14" or the file's name */
  int partners;                      /* methods it was held against, and how far they are from it */
  struct {
    char about[100];
    double error[MOTION_ERRORS];
  } partner[COMPARE_PARTNERS];
} pw_truth;

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *methods_text, *rtol_text, *step_text, *repeats_text, *truth_path, *folder;
  int lock; /* of the folder; -1: none */
  /* as understood */
  pw_cli_model m;
  pw_contestants list;
  pw_ladder ladder[2]; /* of steps, of tolerances */
  double t_end, limit; /* [s] */
  double repeats;      /* of a run on the clock, at most */
  /* under way */
  pw_truth truth;
  pw_rung *row;
  int rows, rungs; /* done, and in all */
  pw_progress progress;
  pw_output *csv; /* NULL: none is wanted */
} pw_compare;

/* ---- compare_methods.c ---- */

/* Reads the list of methods, "all" among them, and the ladders.  PW_INPUT with the nearest valid name. */
int pw_compare_methods (pw_compare *x, pw_error *error);
/* Rung i of a ladder, or 0 above its end; fixed steps are halved, tolerances go down by decades. */
double pw_compare_rung (const pw_ladder *ladder, int adaptive, int i);

/* ---- compare_row.c ---- */

/* One run of a method to the end, or the limit.  With a motion, its samples are taken and accounts are kept.  PW_RETRY:
 * interrupted, or r->state is COMPARE_STOPPED. */
int pw_compare_run (pw_compare *x, pw_rung *r, pw_motion *motion, pw_error *error);
/* The observed order of convergence at a tolerance level with `before` levels of its method before it: only in the asymptotic
 * range, where the last two orders agree and errors are well above the reference's uncertainty; else NaN. */
double pw_compare_order (const pw_compare *x, const pw_rung *r, int before);
/* Fills a row: errors, then times.  PW_RETRY if interrupted; PW_MACHINE, PW_START; a method's failure is in the row. */
int pw_compare_row (pw_compare *x, pw_rung *r, pw_motion *scratch, pw_error *error);

/* ---- compare_truth.c ---- */

/* The truth of a table, of the model itself, or made by methods; a table's end is that of the comparison where none was
 * given. */
int pw_truth_find (pw_compare *x, pw_error *error);
void pw_truth_close (pw_truth *t);

/* ---- compare_table.c ---- */

void pw_compare_truth_line (const pw_compare *x, FILE *f);
void pw_compare_head (const pw_compare *x, FILE *f);
void pw_compare_line (const pw_compare *x, const pw_rung *r, FILE *f);
int pw_compare_csv_head (const pw_compare *x, pw_error *error);
int pw_compare_csv_line (const pw_compare *x, const pw_rung *r, pw_error *error);
/* How the truth was found, as DIR/truth.csv. */
int pw_compare_csv_truth (const pw_compare *x, pw_error *error);

/* ---- compare_plot.c ---- */

/* Data, scripts and pictures, into the folder. */
int pw_compare_plot (const pw_compare *x, pw_error *error);

#endif
