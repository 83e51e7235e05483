/* Studies: one model by several methods, a run for each row of a table, failures included.  This part opens the model
 * and the folder, makes the runs, and writes table and CSV file as rows come; commands (compare.c, drift.c) state which
 * runs to make, what to measure, the columns and the figures. */
#ifndef PW_STUDY_H
#define PW_STUDY_H

#include <pthread.h>
#include "cli.h"
#include "figure.h"
#include "parallel.h"
#include "progress.h"
#include "text.h"

enum {
  STUDY_NAME = 200,     /* longest name of a method with its options, end included */
  STUDY_COLUMNS = 32,   /* at most */
  STUDY_COORDINATES = 5 /* of a point in a figure, at most */
};

/* Done; failed; refused when the run was opened; stopped at the time limit; not run, since it would exceed the limit. */
typedef enum { ROW_DONE, ROW_FAILED, ROW_REFUSED, ROW_STOPPED, ROW_SKIPPED } pw_row_state;

typedef struct {
  char method[STUDY_NAME]; /* with options */
  char label[STUDY_NAME];  /* label of its line in the figure */
  int group, line;         /* group of rows in the table; line in the figure of the group */
  int adaptive;            /* 1: the step size follows a tolerance */
  double level;            /* of compare: tolerance, or step size [s] */
  int before;              /* number of levels of its method before it */
  pw_row_state state;
  int measured;             /* 1: all is known */
  int runs;                 /* finished */
  double part;              /* that is done, as the progress counts it, of 1 */
  double t;                 /* reached [s] */
  double cpu;               /* of the last run [s] */
  double balance;           /* largest |energy balance| of the samples [J] */
  pw_statistics statistics; /* of the last run */
  char reason[500];
  double value[STUDY_COLUMNS]; /* NaN: unknown */
  unsigned below;              /* bit i: value i is an upper bound */
  char bounds[STUDY_NAME];     /* the names of those values */
  int points;                  /* number of points in the figure; undefined ones are NaN */
  double (*point)[STUDY_COORDINATES];
} pw_row;

typedef struct pw_study pw_study;

/* A column of the table, which is in the CSV file, on the terminal, or both. */
typedef struct {
  const char *name, *unit;               /* in the CSV file; NULL: not there; without unit */
  const char *head;                      /* on the terminal; NULL: not there */
  int width;                             /* on the terminal, including spaces before it */
  const char *format;                    /* of numbers on the terminal: "%.1e" */
  const char *(*text) (const pw_row *r); /* the text; NULL: the column contains numbers */
} pw_study_column;

const char *pw_study_method (const pw_row *r);
const char *pw_study_status (const pw_row *r); /* "ok", "failed", ... */

/* The option of the methods; `defaults` describes those without it. */
#define PW_STUDY_METHODS_OPTION(defaults)                                                                              \
  PW_TEXT_OPTION (pw_study, methods_text, "methods", 'm', "A,B,...|all",                                               \
                  "Methods, separated by commas; rk4+all: every stabilisation of rk4; all+ggl: every integrator with " \
                  "ggl; all: every method (" defaults ")")

/* What a command provides.  Functions return a status. */
typedef struct {
  const char *tables[2];    /* CSV files in the folder: rows, and a further one or NULL */
  const char *unit;         /* of the progress: "rows" */
  const char *const *group; /* headings of the groups */
  const char *above;        /* line above the heads of columns */
  const pw_study_column
      *column;     /* ended by one without name and head; those up to "status" are printed for every row */
  int runs;        /* approximate number per row */
  int time, steps; /* columns of the time reached, and of the first count of a run */
  /* Reads options, once the model is open; adds the rows. */
  int (*plan) (pw_study *x, pw_error *error);
  /* Before the first row, with signals caught: prints the text above the table. */
  int (*begin) (pw_study *x, pw_error *error);
  int timed; /* 1: the rows of a method are measured one after the other, and methods on different cores */
  /* Measures a row by pw_study_run; pw_study_outcome records a failure of the method in the row. */
  int (*measure) (pw_study *x, pw_row *r, pw_error *error);
  /* After the last row: prints the conclusion; NULL: none. */
  void (*conclude) (const pw_study *x);
  /* After the last row, if there is a folder: further tables, data and scripts of figures. */
  int (*figures) (pw_study *x, pw_error *error);
  void (*close) (pw_study *x);
} pw_study_type;

struct pw_study {
  pw_cli_line line;
  const char *methods_text, *reference_path, *folder, *jobs_text;
  /* read */
  const pw_study_type *type;
  pw_cli_engine engine; /* of all runs */
  pw_cli_model m;       /* the system is shared by all runs */
  char (*method)[STUDY_NAME];
  int methods;
  int jobs; /* concurrent runs */
  pw_settings settings;
  pw_limit limit; /* of a run */
  double t_end;   /* [s] */
  double cpu_end; /* CPU time of a run after which it is stopped between steps [s] */
  pw_figures figures;
  /* progress */
  int lock;  /* of the folder; -1: none */
  int quiet; /* 1: rows are not printed */
  pw_row *row;
  int rows, done; /* done: printed */
  pthread_mutex_t mutex;
  pw_progress progress;
  double finished;                       /* progress: the sum of `part` of all rows */
  double share;                          /* of each run in the progress of its row */
  pw_output *csv;                        /* NULL: none */
  const char *drawn[FIGURE_SCRIPTS + 1]; /* scripts */
};

/* ---- The study (study.c) ---- */

/* Runs a command whose options begin with a pw_study. */
int pw_study_command (pw_study *x, const pw_study_type *type, pw_error *error);

/* Reads --methods: names separated by commas; "all" stands for each integrator with each stabilisation, "rk4+all" for
 * rk4 with each, "all+ggl" for each integrator that has ggl.  A method named twice is used once.  PW_INPUT with the
 * nearest valid name. */
int pw_study_read_methods (pw_study *x, const char *text, pw_error *error);

/* Adds a row of a line of a group, without numbers.  Its label is its method unless it is set; rows of a line follow
 * each other.  NULL and PW_RESOURCE. */
pw_row *pw_study_add (pw_study *x, int group, int line, const char *method, int points, pw_error *error);

/* Called after each step of a run that reaches time `due`, which it may change. */
typedef struct pw_study_visitor {
  double due;
  int (*visit) (struct pw_study_visitor *v, pw_run *run, pw_error *error);
  const pw_study *study;
  pw_row *row;
} pw_study_visitor;

/* One run of a row to the end or a limit: fills t, statistics, cpu, and state if it is stopped by cpu_end; the visitor may
 * be NULL.  Runs of different rows may be concurrent.  PW_RETRY: stopped, or interrupted. */
int pw_study_run (pw_study *x, pw_row *r, const pw_settings *settings, pw_study_visitor *v, pw_error *error);
/* Performs tasks as pw_parallel does, those of a study that is timed as pw_parallel_timed, and ends their progress. */
int pw_study_parallel (pw_study *x, int count, pw_task *task, void *context, pw_error *error);
/* Begins to show the progress of `rows` rows. */
void pw_study_show (pw_study *x, const char *what, const char *unit, int rows);
/* Shows that a part of a row is done, of 1. */
void pw_study_part (pw_study *x, pw_row *r, double part);
/* Fills the time and the counts of the row, and a failure of pw_study_run.  Returns PW_OK, or the status that ends the
 * study. */
int pw_study_outcome (const pw_study *x, pw_row *r, int status, const pw_error *run_error, pw_error *error);

/* ---- Tables and figures (study_table.c) ---- */

/* Opens the CSV file with its first line. */
int pw_study_open_table (pw_study *x, pw_error *error);
/* Prints a row unless the study is quiet, and writes it into the CSV file. */
int pw_study_write_row (pw_study *x, const pw_row *r, pw_error *error);

/* 1 if a coordinate of the points of a group is positive somewhere. */
int pw_study_positive (const pw_study *x, int group, int coordinate);
/* Writes NAME.dat: a block for each line of a group that has points, two empty lines between them; `heading` names the
 * coordinates, `count` of them. */
int pw_study_write_data (const pw_study *x, int group, const char *name, const char *heading, int count,
                         pw_error *error);
/* Writes NAME.gp: `variables` in gnuplot's language, the labels of the group's lines, the template. */
int pw_study_write_script (pw_study *x, int group, const char *name, const char *template_name, const char *variables,
                           pw_error *error);

#endif
