/* Drift from inside: how far a long run leaves the constraints and the energy balance, method by method.
 *
 *   options (drift.c) -> rows (drift_rows.c), one run each (drift_run.c) -> table, CSV (drift_table.c), figures
 *   (drift_plot.c) */
#ifndef PW_DRIFT_H
#define PW_DRIFT_H

#include <stdio.h>
#include "cli.h"
#include "contestants.h"
#include "progress.h"
#include "stop.h"
#include "sweep.h"

enum { DRIFT_PARTS = 200 }; /* of a run: each has a point in the figures */

/* What is looked at: scaled residuals, and the energy balance [J]. */
enum { DRIFT_POSITION, DRIFT_VELOCITY, DRIFT_BALANCE, DRIFT_QUANTITIES };

/* Methods side by side, then what the options of two stabilisations do. */
typedef enum { DRIFT_METHODS, DRIFT_BAUMGARTE, DRIFT_PROJECTION, DRIFT_GROUPS } pw_drift_group;

typedef struct {
  char method[200];
  pw_drift_group group;
  int line;     /* number of the curve it is on: of the method, of beta, of the metric */
  double along; /* alpha [1/s] or every [steps]; NaN for the methods */
  double beta;  /* [1/s]; NaN but for Baumgarte */

  int status;                       /* PW_OK, or what pw_open or pw_advance has returned */
  double t;                         /* reached [s] */
  double most[DRIFT_QUANTITIES];    /* of all accepted steps */
  double early[DRIFT_QUANTITIES];   /* of those of the first half of the time */
  double end[DRIFT_QUANTITIES];     /* of the last part */
  double (*part)[DRIFT_QUANTITIES]; /* DRIFT_PARTS, of the methods side by side; NaN where no step has ended */
  pw_statistics statistics;
  char reason[500];
} pw_drift_row;

typedef struct {
  /* as given */
  pw_cli_line line;
  const char *methods_text, *folder;
  int lock; /* of the folder; -1: none */
  const char **vary;
  int only_methods;
  /* as understood */
  pw_cli_model m;
  pw_contestants list;
  pw_grid alpha, beta, every; /* one axis each */
  pw_settings settings;
  pw_limit limit;
  double t_end; /* [s] */
  /* under way */
  pw_drift_row *row;
  int rows, done;
  pw_progress progress;
  pw_output *csv; /* NULL: none is wanted */
} pw_drift;

/* The power of time with which the worst of a quantity grows, from the middle of the run to its end: 0 if it stays
 * within bounds; NaN if there is none, or nothing but round-off. */
double pw_drift_growth (const pw_drift_row *r, int quantity);

/* ---- drift_rows.c ---- */

/* Makes the list of rows from methods and options.  PW_INPUT for an option there is none of, with the nearest name. */
int pw_drift_rows (pw_drift *x, pw_error *error);
void pw_drift_free_rows (pw_drift *x);

/* ---- drift_run.c ---- */

/* Fills a row.  PW_RETRY if interrupted; PW_MACHINE; a method's failure is in the row. */
int pw_drift_run (pw_drift *x, pw_drift_row *r, pw_error *error);

/* ---- drift_table.c ---- */

void pw_drift_head (const pw_drift *x, pw_drift_group group, FILE *f);
void pw_drift_line (const pw_drift *x, const pw_drift_row *r, FILE *f);
int pw_drift_csv_head (const pw_drift *x, pw_error *error);
int pw_drift_csv_line (const pw_drift *x, const pw_drift_row *r, pw_error *error);
/* The methods side by side against time, as DIR/drift-time.csv. */
int pw_drift_csv_time (const pw_drift *x, pw_error *error);

/* ---- drift_plot.c ---- */

/* Data, scripts and pictures, into the folder. */
int pw_drift_plot (const pw_drift *x, pw_error *error);

#endif
