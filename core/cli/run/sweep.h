/* The plan of a sweep: everything that its runs have in common; its journal and its table (sweep_plan.c). */
#ifndef PW_SWEEP_H
#define PW_SWEEP_H

#include <stdint.h>
#include <sys/types.h>
#include "cli.h"
#include "outcome.h"

/* ---- The grid: all combinations of the values of the varied quantities (axes), one per row ----
 *
 * Rows are numbered from 0 in the order of the table, in which the last axis varies fastest.  A sweep computes all
 * rows, or those of one part: part i of n has the rows i - 1, i - 1 + n, i - 1 + 2 n, ... */

enum { PW_AXIS_VALUES = 11 /* of a range without COUNT */ };
#define PW_GRID_MAX_ROWS 1e8 /* larger grids are refused: a journal needs 8 bytes of memory per row */

/* A varied quantity: a parameter of the model or the initial value of a state. */
typedef struct {
  char *name;
  char *text;                    /* of its values, "1:10:100" or "1,2,5", as written */
  pw_range range;                /* without a list */
  double *value;                 /* of a list; NULL: a range */
  long count;                    /* number of values */
  long stride;                   /* number of rows from one value to the next */
  const pw_parameter *parameter; /* NULL: the initial value of a state; set by pw_plan_open, like the unit */
  const char *unit;
} pw_axis;

typedef struct {
  pw_axis *axis;
  int axes;
  long rows;
} pw_grid;

/* Reads "NAME=RANGE" or "NAME=V1,V2,..."; the arrays of the axis are in the arena.  PW_INPUT with the reason,
 * PW_RESOURCE. */
int pw_axis_read (pw_axis *axis, const char *text, pw_arena *arena, pw_error *error);
double pw_axis_value (const pw_axis *axis, long i); /* i from 0 */

double pw_grid_value (const pw_grid *grid, int i, long row); /* of axis i */

/* The row that is computed k-th, from 0: rows with the same parameters follow each other and share a compiled model. */
long pw_grid_scheduled_row (const pw_grid *grid, long k);
/* The number, from 0, of a row's combination of parameters, without regard to its initial values. */
long pw_grid_parameter_index (const pw_grid *grid, long row);

/* ---- The plan ---- */

#define PW_SWEEP_MAGIC "pinwheel sweep 1\n" /* the first line of a fingerprint */

typedef struct {
  /* from the command line */
  const pw_cli_line *line;
  const char *method;
  pw_settings settings;
  pw_limit limit;  /* of each run */
  int with_cpu;    /* 1: a column with each run's processor time */
  int with_error;  /* 1: columns with the stated errors of states */
  const char **of; /* --of: outputs, ended by NULL; NULL: none */
  int outputs;     /* their number */
  double *drawn;   /* rows x outputs, or states if there are none: set by pw_sweep_finish; NULL: not wanted */
  int part, parts; /* --part; 1, 1 if it is not given */
  pw_specialise specialise;
  int lanes; /* --lanes, runs that a thread advances at once by vector instructions; 0: not given */
  /* set by pw_plan_open */
  pw_grid grid;
  pw_cli_engine engine;      /* of the first row that can be built, so that it does not depend on the part */
  pw_scene_code *lanes_code; /* the same for several runs at once; NULL: none */
  struct pw_column {
    const char *name, *unit;
    int is_known; /* of an output: 1 if the table has this column anyway */
  } * column;     /* of the states of all bodies and elements */
  int columns;
  struct pw_column *output; /* outputs: of each */
  int by_steps;             /* 1: outputs or the condition of --until need each step */
  size_t column_room;       /* entries of `column` that are allocated */
  pw_names column_of;       /* from a state's name to the index of its column */
  pw_arena arena;           /* of the grid and of names */
  uint64_t tables_sum;      /* a checksum of the points of all tables of models built so far; 0: there are none */
  pw_text heading;          /* the table's first line, without its end */
  pw_text fingerprint;      /* the first lines of a journal or part: everything that determines the rows */
} pw_plan;

/* The number of columns that are drawn: outputs; without any, the first states. */
enum { PW_PLAN_DRAWN = 12 };
int pw_plan_drawn (const pw_plan *plan);

/* Matches the ranges ("NAME=RANGE") to the model, whose file is open in plan->line, and finds
 * the columns by compiling models of the grid.  Errors: PW_INPUT, PW_RESOURCE.  Close the plan in every case. */
int pw_plan_open (pw_plan *plan, const char **ranges, pw_error *error);
void pw_plan_close (pw_plan *plan);

/* Builds and compiles the model of a row; compiled->file stays NULL.  Close it in every case.  May be called by several
 * threads at once. */
int pw_plan_compile (const pw_plan *plan, long row, pw_cli_model *compiled, pw_error *error);

/* What a row of the table shows. */
typedef struct {
  long number; /* in the grid */
  int status;
  const char *reason;    /* "" without an error */
  const pw_run *run;     /* NULL: it could not be opened */
  const pw_sample *last; /* NULL: there is none */
  int coordinates;       /* of its system */
  const int *state;      /* index of the state in each column; -1: the system does not have it; unused without `last` */
  const double *error;   /* stated errors of its states at the end; NULL: not known */
  const pw_outcomes *of; /* its outputs; NULL: not known */
  double cpu;            /* [s] */
} pw_plan_row;

/* Appends the cells of a row, nan where there is no run or no sample; if the row is NULL, the heading.  No end of the
 * line is added. */
void pw_plan_cells (const pw_plan *plan, const pw_plan_row *row, pw_text *text);

/* ---- The journal ---- */

/* The rows done, in the order of completion, in a file next to the table, from which a sweep that was stopped
 * continues. */
typedef struct {
  char *table_path; /* links followed */
  char *path;       /* of the journal: that of the table and ".part" */
  int descriptor;   /* of the journal, locked; -1: not open */
  int begun;        /* 1: this process has written the fingerprint, in a new file or where it was incomplete */
  off_t *offset;    /* in the journal, of the line of row r of the part: offset[r / parts]; 0: missing */
  long rows, done;  /* numbers of these rows; of those in the journal */
  off_t size;       /* bytes of the journal's complete lines */
  pw_text line;     /* the line that is written */
} pw_journal;

/* Opens the journal of the table at `path`, or creates it.  It is truncated at the first line that is incomplete,
 * damaged, repeated or of another part.  Close it in every case.
 * Errors: PW_RESOURCE if it cannot be written or another process has it, PW_INPUT if it belongs to another sweep. */
int pw_journal_open (pw_journal *journal, const pw_plan *plan, const char *path, pw_error *error);
/* Appends a row of the grid: the exit status of its run, 0 to 4, and its line of the table, `text`, without a newline.
 * One thread at a time.  PW_RESOURCE: the journal is unchanged. */
int pw_journal_add (pw_journal *journal, const pw_plan *plan, long row, int status, const char *text, pw_error *error);
/* Closes the journal; removes it if it was begun here and has no rows. */
void pw_journal_close (pw_journal *journal);

/* ---- The table ---- */

/* How the runs of a table ended. */
typedef struct {
  long rows, failed; /* runs; those that failed */
  int status;        /* exit status of the first that failed */
  char reason[300];  /* from its row */
} pw_tally;

/* Writes the table of a complete journal, or its part, and removes the journal. */
int pw_sweep_finish (pw_journal *journal, const pw_plan *plan, pw_tally *tally, pw_error *error);
/* Writes the table at `path` from all parts of a sweep. */
int pw_sweep_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error);

#endif
