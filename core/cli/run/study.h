/* Studies: runs of one model by several methods.  A study is a table with a row for each method and its options or
 * tolerance, failures included.  study.c opens the model and the folder, performs the runs, and prints and writes the
 * rows as they are finished.  The commands compare and drift provide rows, measurements, columns and figures. */
#ifndef PW_STUDY_H
#define PW_STUDY_H

#include <pthread.h>
#include "figure.h"

enum {
  STUDY_NAME = 200,     /* longest name of a method with its options, end included */
  STUDY_COLUMNS = 32,   /* at most */
  STUDY_COORDINATES = 5 /* of a point in a figure, at most */
};

/* Done, or not begun; failed; refused on opening; stopped at the limit; not run, since it would exceed the limit. */
typedef enum { ROW_DONE, ROW_FAILED, ROW_REFUSED, ROW_STOPPED, ROW_SKIPPED } pw_row_state;

typedef struct {
  char method[STUDY_NAME]; /* with options */
  char label[STUDY_NAME];  /* of its curve in the figure: at first the method */
  int group;               /* the part of the table that contains it, which has a figure of its own */
  int curve;               /* the curve of this figure that contains its points; of compare, the index of its method */
  int adaptive;            /* 1: the step size follows a tolerance */
  double level;            /* of compare: tolerance, or step size [s] */
  int coarser_levels;      /* of compare: number of rows of its method before it */
  pw_row_state state;
  int measured;                 /* 1: the row is complete */
  int runs;                     /* that have reached the end */
  double progress;              /* part of its runs that is done, 0 to 1 */
  double t;                     /* time reached [s] */
  double cpu;                   /* processor time of the last run; at last, of compare, the median of timed runs [s] */
  double balance;               /* largest |energy balance| of the samples [J] */
  pw_statistics statistics;     /* of the last run */
  char reason[500];             /* of any state but ROW_DONE; else "" */
  double value[STUDY_COLUMNS];  /* NaN: unknown */
  unsigned upper_bounds;        /* bit i: value[i] is an upper bound */
  char bound_names[STUDY_NAME]; /* names of the columns of upper bounds */
  int points;                   /* in the figure; their coordinates are NaN if undefined */
  double (*point)[STUDY_COORDINATES];
} pw_row;

typedef struct pw_study pw_study;

/* A column of the table, which is in the CSV file, on the terminal, or both. */
typedef struct {
  const char *name, *unit;                 /* in the CSV file; name NULL: not there; unit NULL: none */
  const char *head;                        /* heading on the terminal; NULL: not there */
  int width;                               /* on the terminal, including spaces before it */
  const char *format;                      /* of numbers on the terminal: "%.1e" */
  const char *(*text) (const pw_row *row); /* the text; NULL: the column contains numbers */
} pw_study_column;

const char *pw_study_method (const pw_row *row);
const char *pw_study_status (const pw_row *row); /* "ok", "failed", ... */

/* The option --methods; `defaults` describes the methods without it. */
#define PW_STUDY_METHODS_OPTION(defaults)                                                                              \
  PW_TEXT_OPTION (pw_study, methods_text, "methods", 'm', "A,B,...|all",                                               \
                  "Methods, separated by commas; rk4+all: every stabilisation of rk4; all+ggl: every integrator with " \
                  "ggl; all: every method (" defaults ", and those of --method-file)"),                                \
      PW_METHOD_FILE_OPTION

/* What a command provides.  Functions return a status. */
typedef struct {
  const char *table_names[2];    /* CSV files in the folder: of the rows, and a further one or NULL */
  const char *row_noun;          /* in messages: "rows" */
  const char *const *group;      /* headings of the groups */
  const char *heading_above;     /* line above the headings of columns */
  const pw_study_column *column; /* those up to "status" are printed for every row */
  int columns;
  int runs_per_row;       /* approximately */
  int time_column;        /* of the time reached */
  int first_count_column; /* steps, then rejected, right-hand sides, Jacobians, factorisations */
  /* Reads options, once the model is open; adds the rows. */
  int (*plan) (pw_study *study, pw_error *error);
  /* Before the first row, with signals caught: prints the text above the table. */
  int (*begin) (pw_study *study, pw_error *error);
  int timed; /* 1: processor times are measured: rows of a method one after the other, methods on different cores */
  /* Measures a row by pw_study_run; pw_study_record_run records a failure of the method in the row. */
  int (*measure) (pw_study *study, pw_row *row, pw_error *error);
  /* After the last row: prints the conclusion; NULL: none. */
  void (*conclude) (const pw_study *study);
  /* After the last row, if there is a folder: further tables, data and scripts of figures. */
  int (*figures) (pw_study *study, pw_error *error);
  void (*close) (pw_study *study); /* NULL: nothing */
} pw_study_type;

struct pw_study {
  /* as given */
  pw_cli_line line;
  const char *methods_text, *reference_path, *folder, *table_path; /* folder: --plots */
  /* as understood */
  const pw_study_type *type;
  pw_cli_engine engine; /* of all runs */
  char (*method)[STUDY_NAME];
  int methods;
  int jobs; /* number of concurrent runs */
  pw_settings settings;
  pw_limit limit;   /* of a run with a visitor, checked in every step */
  double cpu_limit; /* of every run, checked between batches of steps [s]: ROW_STOPPED; INFINITY: the run fails */
  /* in progress */
  int quiet; /* 1: rows are not printed */
  pw_row *row;
  int rows, written; /* all; those written to the table */
  int headed;        /* 1 + the group of the heading printed last; 0: none */
  pthread_mutex_t mutex;
  pw_progress progress;
  double progress_sum;                     /* of all rows */
  double run_share;                        /* part of the progress of a row that each of its runs makes */
  pw_output *csv;                          /* NULL: none */
  const char *scripts[FIGURE_SCRIPTS + 1]; /* of figures, ended by NULL */
};

/* Runs a command whose options begin with a pw_study. */
int pw_study_command (pw_study *study, const pw_study_type *type, pw_error *error);

/* Reads --methods or, if it is not given, `otherwise` and all methods of --method-file: names separated by commas;
 * "all" stands for each integrator with each stabilisation, "rk4+all" for rk4 with each, "all+ggl" for each integrator
 * that has ggl.  A method named twice is used once.  PW_INPUT with the nearest valid name. */
int pw_study_read_methods (pw_study *study, const char *otherwise, pw_error *error);

/* Adds a row whose values and points are NaN; rows of a curve follow each other.  The pointer is valid until the next
 * row is added.  NULL and PW_RESOURCE. */
pw_row *pw_study_add (pw_study *study, int group, int curve, const char *method, int points, pw_error *error);

/* An observer of a run: `visit` is called after each step that reaches time `due`, which it may change. */
typedef struct pw_visitor {
  double due; /* [s]; 0: after each step */
  int (*visit) (struct pw_visitor *visitor, pw_run *run, pw_error *error);
  const pw_study *study;
  pw_row *row;
} pw_visitor;

/* One run of a row to the end or a limit: fills t, statistics, cpu, and if cpu_limit stops it, state.  The visitor may
 * be NULL.  Runs of different rows may be concurrent.  A status; PW_RETRY, without an error: stopped by cpu_limit or a
 * signal. */
int pw_study_run (pw_study *study, pw_row *row, const pw_settings *settings, pw_visitor *visitor, pw_error *error);
/* Performs tasks as pw_parallel does, those of a study that is timed as pw_parallel_timed, and ends their progress. */
int pw_study_parallel (pw_study *study, int count, pw_task *task, void *context, pw_error *error);
/* Begins to show the progress of `what`, which consists of `rows` rows called `unit`. */
void pw_study_begin_progress (pw_study *study, const char *what, const char *unit, int rows);
/* Shows that a part of a row is done, 0 to 1. */
void pw_study_progress (pw_study *study, pw_row *row, double part);
/* Stores the time reached, the counts and, if the last pw_study_run of the row failed, its failure: `status` and
 * `run_error` are what that returned.  Returns PW_OK, or the status that ends the study. */
int pw_study_record_run (const pw_study *study, pw_row *row, int status, const pw_error *run_error, pw_error *error);

/* Adds to a panel the curves of a group that have points: their coordinate y over x. */
void pw_study_add_curves (const pw_study *study, int group, pw_curves *c, int x, int y);
/* Completes a figure, to be drawn at the end, so its name must outlive the study. */
int pw_study_close_figure (pw_study *study, pw_curves *c, pw_error *error);

#endif
