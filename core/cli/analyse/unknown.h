/* Numbers that analyses vary: parameters and initial values, with the runs by which they differentiate. */
#ifndef PW_UNKNOWN_H
#define PW_UNKNOWN_H

#include "cli.h"
#include "pinwheel-analysis.h"

typedef struct {
  const char *name;              /* "length", "body.vx" */
  const pw_parameter *parameter; /* NULL: the initial value of a state */
  int state;                     /* its number; -1 for a parameter */
  double value;                  /* at the beginning */
  char unit[16];
  /* for searches: */
  double low, high; /* bounds; infinite without one */
  double scale;     /* size of typical changes: the distance of the bounds, else |value|, else 1 */
  int given;        /* 1: the bounds are the user's */
} pw_unknown;

/* Finds the number of this name in an open model, and its value there.  Errors: PW_INPUT for an unknown name, with the nearest
 * one. */
int pw_unknown_find (pw_unknown *u, const pw_cli_model *m, const char *name, pw_error *error);

/* Runs of a command line's model with values x of `count` unknowns. */
typedef struct {
  const pw_cli_line *line;
  const pw_file *file;
  pw_unknown *list;
  int count;
  const char *method;
  pw_settings settings;
} pw_unknown_runs;

/* The model, compiled.  PW_INPUT if it refuses the values; PW_RESOURCE.  Close it by pw_cli_close_model in every case.  May be
 * called by several threads at once. */
int pw_unknown_system (pw_cli_model *m, const pw_unknown_runs *r, const double *x, pw_error *error);

/* A run of it.  Close it in every case. */
typedef struct {
  pw_cli_model m;
  pw_run *run;
} pw_unknown_run;
int pw_unknown_open (pw_unknown_run *to, const pw_unknown_runs *r, const double *x, pw_error *error);
void pw_unknown_close (pw_unknown_run *x);

/* Directions of the run along all unknowns, with their neighbours; x is used for these and restored.  near: room for 4 runs of
 * each unknown, without specialised code.  Close all of them also after an error. */
int pw_unknown_directions (pw_direction *d, const pw_unknown_runs *r, double *x, pw_unknown_run *run,
                           pw_unknown_run *near, pw_error *error);

#endif
