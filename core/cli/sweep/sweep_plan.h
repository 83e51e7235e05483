/* The plan of a sweep: everything that its runs have in common.
 *
 * A sweep computes all rows of the grid, numbered from 0, or those of one part: part i of n has the rows i - 1,
 * i - 1 + n, i - 1 + 2 n, ... */
#ifndef PW_SWEEP_PLAN_H
#define PW_SWEEP_PLAN_H

#include <stdint.h>
#include "cli.h"
#include "sweep_grid.h"
#include "text.h"

#define PW_SWEEP_MAGIC "pinwheel sweep 1\n" /* the first line of a fingerprint */

typedef struct {
  /* from the command line */
  const pw_cli_line *line;
  pw_file *file;
  const char *method;
  pw_settings settings;
  double t_end;    /* [s] */
  pw_limit limit;  /* of each run */
  int with_cpu;    /* 1: a column with each run's processor time */
  int part, parts; /* --part; 1, 1 if it is not given */
  pw_specialise specialise;
  int lanes; /* --lanes, runs that a thread advances at once by vector instructions; 0: not given */
  /* set by pw_plan_open */
  pw_grid grid;
  pw_cli_engine engine;      /* of the first row that can be built, so that it does not depend on the part */
  pw_scene_code *lanes_code; /* the same for several runs at once; NULL: none */
  struct pw_column {
    const char *name, *unit;
  } * column; /* of the states of all bodies and elements */
  int columns;
  size_t column_room;  /* entries of `column` that are allocated */
  pw_names column_of;  /* from a state's name to the index of its column */
  pw_arena arena;      /* of the grid and of names */
  uint64_t tables_sum; /* a checksum of the points of all tables of models built so far; 0: there are none */
  pw_text heading;     /* the table's first line, without its end */
  pw_text fingerprint; /* the first lines of a journal or part: everything that determines the rows */
} pw_plan;

/* Matches the ranges ("NAME=RANGE") to the model, whose file is open in plan->file and stays the caller's, and finds
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
  double cpu;            /* [s] */
} pw_plan_row;

/* Appends the cells of a row, nan where there is no run or no sample; if the row is NULL, the heading.  No end of the
 * line is added. */
void pw_plan_cells (const pw_plan *plan, const pw_plan_row *row, pw_text *text);

#endif
