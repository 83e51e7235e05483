/* Numbers by which a run is differentiated: parameters and initial values, with the neighbouring runs. */
#ifndef PW_SENSITIVITY_DIRECTION_H
#define PW_SENSITIVITY_DIRECTION_H

#include "cli.h"
#include "pinwheel-analysis.h"

/* A number that varies.  Begin with the name, and parameter and state from pw_unknown_find. */
typedef struct {
  const char *name;              /* "length", "body.vx" */
  const pw_parameter *parameter; /* NULL: the initial value of a state */
  int state;                     /* its number; -1 for a parameter */
  double value;
  char unit[16];
} pw_unknown;

/* Finds the number of this name, and its value in a model of the command line with its system and a run of that.
 * Errors: PW_INPUT for an unknown name, with the nearest one, and for a parameter that is a count. */
int pw_unknown_find (pw_unknown *u, const pw_cli_model *m, const pw_run *r, const char *name, pw_error *error);

/* A run of the command line's model with these unknowns at their values, `at` of them (or -1) changed by `by`. */
typedef struct {
  pw_model *model;
  pw_system *system;
  pw_run *run;
} pw_unknown_run;
int pw_unknown_open (pw_unknown_run *x, const pw_cli_line *l, const pw_file *file, const pw_unknown *list, int count,
                     int at, double by, const char *method, const pw_settings *settings, pw_error *error);
void pw_unknown_close (pw_unknown_run *x);

/* Directions along all unknowns, with their neighbours; x has room for 4 of each unknown.  pw_unknown_close them also
 * after an error. */
int pw_unknown_directions (pw_direction *d, pw_unknown_run *x, const pw_cli_line *l, const pw_file *file,
                           const pw_unknown *list, int count, const char *method, const pw_settings *settings,
                           pw_error *error);

#endif
