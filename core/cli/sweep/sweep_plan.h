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
  const char *method;
  const char **sets, **starts;
  pw_settings settings;
  double t_end; /* [s] */
  double limit; /* of each run's processor time [s]; INFINITY: none */
  int cpu;      /* 1: a column with each run's processor time */
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

/* ---- Compiled systems: one for all rows with the same parameters ---- */

typedef struct {
  pw_cli_model m;             /* m.file is NULL */
  int *column;                /* 2 pw_system_coordinates: of each state */
  int *state;                 /* grid.axes: state whose initial value an axis varies; -1: it varies a parameter */
  const pw_specialised *code; /* for its runs; NULL: the general engine */
} pw_sweep_system;

/* Builds and compiles the model of a row.  Close the system in every case.  May be called by several threads at once. */
int pw_sweep_system_open (pw_sweep_system *x, const pw_plan *p, long row, pw_error *error);
void pw_sweep_system_close (pw_sweep_system *x);

/* ---- One run ---- */

/* The run of a row. */
typedef struct {
  const pw_plan *plan;
  const pw_sweep_system *system;
  long row;
  pw_run *run;
  pw_limit limit;
  double start;  /* of the thread's processor time [s] */
  double change; /* of its given initial values by the constraints; 0: none */
  char changed[PW_CHANGE_TEXT];
  int status; /* while it is not PW_OK, the run has ended */
  pw_error error;
} pw_sweep_run;

/* Opens the run of a row, with the system of its parameters; `error`: the reason if that could not be opened.  May be
 * called by several threads at once.  Close the run in every case. */
void pw_sweep_run_open (pw_sweep_run *x, const pw_plan *p, const pw_sweep_system *s, long row, const pw_error *error);
/* 1 if the run has failed or reached the end. */
int pw_sweep_run_ended (const pw_sweep_run *x);
/* Appends the cells of the row, without the end of the line.  Returns the status of the run, which has a row even if it
 * failed; PW_RETRY if pw_stop became non-zero; PW_RESOURCE with the error if the run was impossible. */
int pw_sweep_run_close (pw_sweep_run *x, pw_text *text);

#endif
