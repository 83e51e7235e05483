/* The plan of a sweep: data shared by its runs.
 *
 * A sweep computes all rows of the grid, or those of one part: part i of n has the rows i - 1, i - 1 + n, ... */
#ifndef PW_SWEEP_PLAN_H
#define PW_SWEEP_PLAN_H

#include <stdint.h>
#include "cli.h"
#include "sweep_grid.h"
#include "text.h"
#include "util.h"

#define PW_SWEEP_MAGIC "pinwheel sweep 1\n" /* the first line of a fingerprint */

typedef struct {
  /* from the command line; read only */
  const pw_cli_line *line;
  const char *method;
  pw_settings settings;
  double t_end;   /* [s] */
  pw_limit limit; /* of each run */
  int cpu;        /* 1: a column with each run's processor time */
  int part, parts;
  pw_specialise specialise;
  int lanes; /* as given; 0: not given */
  /* set by pw_plan_open */
  pw_file *file;
  pw_grid grid;
  pw_cli_engine engine; /* of the first row that can be built, so that it does not depend on the part */
  pw_scene_code *code;  /* the same for several runs at once; NULL: none */
  struct pw_column {
    const char *name, *unit;
  } * column; /* columns: the states of all bodies and elements */
  int columns;
  size_t room;
  pw_names index;      /* from a state's name to its column */
  pw_arena arena;      /* names */
  uint64_t tables;     /* a hash of the points of all tables of models built so far; 0: there are none */
  pw_text head;        /* the table's first line, without its end */
  pw_text fingerprint; /* the first lines of a journal or part: everything that determines the rows */
} pw_plan;

/* Matches the ranges ("NAME=RANGE") to the model, whose file is open in p->file and stays the caller's, and finds the
 * columns by compiling models of the grid.  Errors: PW_INPUT, PW_RESOURCE.  Close the plan in every case. */
int pw_plan_open (pw_plan *p, const char **ranges, pw_error *error);
void pw_plan_close (pw_plan *p);

/* Rows of the plan's part. */
static inline long pw_plan_rows (const pw_plan *p) {
  return p->grid.rows / p->parts + (p->grid.rows % p->parts >= p->part);
}

/* Builds and compiles the model of a row; m->file stays NULL.  Close the model in every case.  May be called by several
 * threads at once. */
int pw_plan_compile (const pw_plan *p, long row, pw_cli_model *m, pw_error *error);

#endif
