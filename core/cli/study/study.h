/* Studies: one model by several methods, a run for each row of a table, failures included.  This part opens the model
 * and the folder, makes the runs, reports progress, and writes the table and CSV as rows come; commands (compare.c,
 * drift.c) state which runs to make, what to measure, and the columns and figures. */
#ifndef PW_STUDY_H
#define PW_STUDY_H

#include <stdio.h>
#include "cli.h"
#include "figure.h"
#include "motion.h"
#include "progress.h"
#include "text.h"

/* ---- Methods ---- */

enum { STUDY_NAME = 200 }; /* longest name of a method with its options, end included */

typedef struct {
  char name[STUDY_NAME]; /* "erk8+projection" */
  int adaptive;          /* 1: the step size follows a tolerance; 0: it is fixed */
} pw_study_method;

typedef struct {
  pw_study_method *method; /* free it */
  int count;
} pw_study_methods;

/* Reads --methods: names separated by commas; "all" stands for each integrator with each stabilisation, "rk4+all" for
 * rk4 with each.  A method named twice is used once.  PW_INPUT with the nearest valid name. */
int pw_study_methods_read (pw_study_methods *list, const char *text, pw_error *error);

/* ---- Rows ---- */

enum { DRIFT_POSITION, DRIFT_VELOCITY, DRIFT_BALANCE, DRIFT_QUANTITIES };

/* Done; failed; refused when the run was opened; stopped at the time limit; not run since it would reach that. */
typedef enum { ROW_DONE, ROW_FAILED, ROW_REFUSED, ROW_STOPPED, ROW_SKIPPED } pw_row_state;

typedef struct {
  char method[STUDY_NAME]; /* with options */
  int group;               /* of the table, from 0 */
  int line;                /* of the group's figure, from 0: number of the method, of beta, ... */
  pw_row_state state;
  double t;                 /* reached [s] */
  double cpu;               /* of the run; of compare: the median of its repetitions [s] */
  pw_statistics statistics; /* of the last run */
  char reason[500];
  union {
    struct { /* compare */
      int adaptive;
      double level;                /* tolerance, or step size [s] */
      double error[MOTION_ERRORS]; /* NaN: unknown; at the uncertainty of the reference: no larger than this */
      unsigned below;              /* bit i: error i is below the uncertainty of the reference */
      double order;                /* observed order of convergence; NaN: unknown */
      double balance;              /* largest |energy balance| of the samples [J] */
      double spread;               /* of the repetitions: largest less smallest CPU time [s] */
      int repeats;
    };
    struct {                            /* drift */
      double along;                     /* alpha [1/s] or every [steps]; NaN for the methods */
      double beta;                      /* [1/s]; NaN except with Baumgarte */
      double most[DRIFT_QUANTITIES];    /* of all accepted steps: scaled residuals, |energy balance| [J] */
      double early[DRIFT_QUANTITIES];   /* of those in the first half of the time */
      double end[DRIFT_QUANTITIES];     /* of those in the last part */
      double (*part)[DRIFT_QUANTITIES]; /* of each part, for methods without options varied; NaN without a step */
    };
  };
} pw_row;

/* ---- Studies ---- */

typedef struct pw_study pw_study;

/* What each command provides.  Functions return a status. */
typedef struct {
  const char *tables[2]; /* CSV files in the folder: that of the rows, and a further one */
  const char *unit;      /* of the progress: "rows" */
  /* Reads options, once the model is open; allocates and fills the rows. */
  int (*plan) (pw_study *x, pw_error *error);
  /* Before the first row, with signals caught: writes what precedes the table. */
  int (*begin) (pw_study *x, pw_error *error);
  /* Measures a row by pw_study_run; pw_study_outcome makes a method's failure a row. */
  int (*measure) (pw_study *x, pw_row *r, pw_error *error);
  /* Print the heading of a group, and a row after the name of its method. */
  void (*head) (const pw_study *x, int group, int width, FILE *f);
  void (*line) (const pw_study *x, const pw_row *r, FILE *f);
  /* Add the cells of the CSV's first line, and of a row, except the reason. */
  void (*names) (pw_text *t);
  void (*cells) (const pw_study *x, const pw_row *r, pw_text *t);
  /* After the last row, if there is a folder: further tables and figures. */
  int (*figures) (pw_study *x, pw_error *error);
  void (*close) (pw_study *x);
} pw_study_type;

struct pw_study {
  pw_cli_line line;
  const char *methods_text, *reference_path, *folder;
  /* read */
  const pw_study_type *type;
  pw_cli_model m;
  pw_study_methods methods;
  pw_settings settings;
  pw_limit limit; /* of settings.stop */
  double t_end;   /* [s] */
  double cpu_end; /* CPU time of a run after which it is stopped between steps [s] */
  /* under way */
  int lock; /* of the folder; -1: none */
  pw_row *row;
  int rows, done;
  pw_progress progress;
  double share;   /* of a run in the progress of its row */
  pw_output *csv; /* NULL: none */
};

/* Runs a command whose options begin with a pw_study. */
int pw_study_command (pw_study *x, const pw_study_type *type, pw_error *error);

/* Allocates rows that are zero. */
int pw_study_allocate (pw_study *x, int rows, pw_error *error);

/* Called after each step of a run that reaches time `due`, which it may change. */
typedef struct pw_study_visitor {
  double due;
  int (*visit) (struct pw_study_visitor *v, pw_run *run, pw_error *error);
  const pw_study *study;
  pw_row *row;
  pw_motion *motion; /* compare */
  int sample;        /* compare: the next one */
} pw_study_visitor;

/* One run of a row with the study's settings to the end or a limit: fills t, statistics, cpu, and state if it is
 * stopped by cpu_end; the visitor may be NULL.  PW_RETRY: stopped, or interrupted. */
int pw_study_run (pw_study *x, pw_row *r, pw_study_visitor *v, pw_error *error);
/* Puts a failure of pw_study_run into the row.  Returns PW_OK, or the status that ends the study. */
int pw_study_outcome (pw_row *r, int status, const pw_error *run_error, pw_error *error);

/* "ok", "failed", ... for CSV. */
const char *pw_study_status (const pw_row *r);

/* ---- Figures (study_figures.c) ---- */

enum { STUDY_VALUES = 5 };

/* Lines in a figure: those of a group of rows, whose lines of group 0 are the methods. */
typedef struct {
  const pw_study *study;
  int group;
  const char *name;    /* of the data, NAME.dat */
  const char *heading; /* names of the columns */
  int columns;
  /* The numbers of point k of a row: 1; 0 if it is not drawn, -1 if there are no more points. */
  int (*point) (const pw_study *x, const pw_row *r, int k, double value[STUDY_VALUES]);
  /* The label of a line; it may be written to the buffer. */
  const char *(*label) (const pw_study *x, int group, int line, char text[STUDY_NAME]);
} pw_study_figure;

/* 1 if a column, from 0, has positive numbers. */
int pw_study_positive (const pw_study_figure *g, int column);
/* Writes the data: a block for each line that has a point, two empty lines between them. */
int pw_study_write_data (const pw_study_figure *g, const pw_figures *figures, pw_error *error);
/* Writes the labels of these lines into a script; `spread` as pw_figure_methods. */
void pw_study_write_lines (const pw_study_figure *g, int spread, FILE *f);

/* Opens a further table of the folder; NULL and PW_RESOURCE. */
pw_output *pw_study_open (const pw_study *x, const char *name, pw_error *error);

#endif
