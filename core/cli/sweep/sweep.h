/* Private to sweeps: a grid of runs, one row for each, and the files the rows go to.
 *
 * A grid's rows are numbered in the order of the table, the last varied quantity fastest.  A sweep computes all of
 * them, or those of one part: part i of n has the rows i - 1, i - 1 + n, i - 1 + 2 n, ... */
#ifndef PW_SWEEP_H
#define PW_SWEEP_H

#include <stdint.h>
#include <sys/types.h>
#include "cli.h"
#include "fingerprint.h"
#include "util.h"

/* ---- The grid (sweep_grid.c) ---- */

#define PW_GRID_ROWS 1e8 /* larger grids are refused */

/* One varied quantity. */
typedef struct {
  char *name;
  const char *range;                                    /* "lin:1:10:100", as written */
  enum { PW_AXIS_LIST, PW_AXIS_LIN, PW_AXIS_LOG } type; /* how its values are spaced */
  double first, last;                                   /* of PW_AXIS_LIN and PW_AXIS_LOG */
  double *value;                                        /* PW_AXIS_LIST: count */
  long count;
  long stride;                   /* rows between two of its values */
  const pw_parameter *parameter; /* NULL: it is the initial value of a state */
  const char *unit;
} pw_axis;

typedef struct {
  pw_axis *axis;
  int axes;
  long rows;
} pw_grid;

/* Reads a NULL-terminated list of "NAME=RANGE".  PW_INPUT with the text that is wrong and what was expected, also for
 * too many rows.  Free the grid in every case. */
int pw_grid_read (pw_grid *g, const char *const *ranges, pw_error *error);
void pw_grid_free (pw_grid *g);
double pw_axis_value (const pw_axis *a, long i);
static inline double pw_grid_value (const pw_grid *g, int axis, long row) {
  const pw_axis *a = g->axis + axis;
  return pw_axis_value (a, row / a->stride % a->count);
}

/* ---- The plan: what all runs share (sweep_plan.c) ---- */

typedef struct {
  /* from the command line; read only */
  const char *model, *method;
  const char **sets, **starts;
  pw_settings settings;
  double t_end; /* [s] */
  double limit; /* of each run's processor time [s]; INFINITY: none */
  int cpu;      /* 1: a column with each run's processor time */
  int part, parts;
  /* as found by pw_plan_open */
  pw_file *file;
  pw_grid grid;
  struct pw_column {
    const char *name, *unit;
  } * column; /* columns: the states of all bodies and elements */
  int columns, room;
  pw_names index;      /* from a state's name to its column */
  pw_arena arena;      /* names */
  uint64_t tables;     /* a hash of the points of all tables of scenes built so far; 0: there are none */
  pw_text head;        /* the table's first line, without its end */
  pw_text fingerprint; /* the first lines of a journal or part: everything that determines the rows */
} pw_plan;

/* Matches the ranges ("NAME=RANGE") to the model, whose file is open in p->file and stays the caller's, and finds the
 * columns by building scenes of the grid.  Errors: PW_INPUT, PW_RESOURCE.  Close the plan in every case. */
int pw_plan_open (pw_plan *p, const char **ranges, pw_error *error);
void pw_plan_close (pw_plan *p);

/* A row's model, built and compiled, m->file left NULL; close it in every case.  May be called by several threads at
 * once. */
int pw_plan_scene (const pw_plan *p, long row, pw_cli_model *m, pw_error *error);

/* The i-th of a system's 2 pw_system_coordinates states in the order of a table: six of each body, then internal
 * coordinates of elements. */
int pw_plan_state (const pw_system *s, int i);

/* How many rows the plan's part has, and which in the grid its k-th one is. */
static inline long pw_plan_rows (const pw_plan *p) {
  return p->grid.rows / p->parts + (p->grid.rows % p->parts >= p->part);
}
static inline long pw_plan_row (const pw_plan *p, long k) {
  return p->part - 1 + k * p->parts;
}

#define PW_SWEEP_MAGIC "pinwheel sweep 1\n" /* the first line of a fingerprint */

/* ---- One run (sweep_row.c) ---- */

/* Performs a run and appends its cells, without the end of the line.  Returns the status of the run, which has a row
 * even if it failed; PW_RETRY if pw_stop became non-zero; PW_RESOURCE with the error if the run was impossible.  May be
 * called by several threads at once. */
int pw_sweep_row (const pw_plan *p, long row, pw_text *text, pw_error *error);

/* ---- The journal (sweep_journal.c) ---- */

/* Rows in the order of completion, in a file next to the table, from which a sweep that was stopped continues. */
typedef struct {
  char *path;  /* of the table, links followed */
  char *part;  /* of the journal: path.part */
  int file;    /* the journal's, locked; -1: not open */
  int created; /* 1: by this process */
  off_t *line; /* pw_plan_rows: offset of each row's line; 0: missing */
  long rows, done;
  off_t size;
} pw_journal;

/* Opens the journal of the table at `path`, or creates it.  It is truncated at the first incomplete or damaged line.
 * Errors: PW_RESOURCE if it cannot be written, PW_INPUT if it belongs to another sweep or is in use by another
 * process. */
int pw_journal_open (pw_journal *j, const pw_plan *p, const char *path, pw_error *error);
/* Appends row k of the part; `text` is scratch.  One thread at a time.  PW_RESOURCE: the journal is unchanged. */
int pw_journal_add (pw_journal *j, const pw_plan *p, long k, int status, const char *cells, pw_text *text,
                    pw_error *error);
/* Closes the journal; removes it if it was created here and has no rows. */
void pw_journal_close (pw_journal *j);

/* How the runs of a table ended. */
typedef struct {
  long rows, failed;
  int status;       /* exit status of the first that failed */
  char reason[300]; /* from its row */
} pw_tally;

/* Writes the table of a complete journal, or its part, and removes the journal. */
int pw_table_finish (pw_journal *j, const pw_plan *p, pw_tally *tally, pw_error *error);
/* Writes the table at `path` from all parts of a sweep. */
int pw_table_merge (const char *const *parts, int count, const char *path, pw_tally *tally, pw_error *error);

#endif
