/* The grid of a sweep: varied quantities and their values.  Its rows are numbered in the order of the table, the last
 * quantity fastest. */
#ifndef PW_SWEEP_GRID_H
#define PW_SWEEP_GRID_H

#include "pinwheel.h"

#define PW_GRID_ROWS 1e8 /* larger grids are refused */

/* One varied quantity. */
typedef struct {
  char *name;
  const char *range; /* "lin:1:10:100", as written */
  enum { PW_AXIS_LIST, PW_AXIS_LIN, PW_AXIS_LOG } type;
  double first, last; /* of PW_AXIS_LIN and PW_AXIS_LOG */
  double *value;      /* PW_AXIS_LIST: count */
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

/* Reads "NAME=RANGE".  PW_INPUT with the wrong text and the expected one.  Free the axis in every case. */
int pw_axis_read (pw_axis *a, const char *text, pw_error *error);
void pw_axis_free (pw_axis *a);
double pw_axis_value (const pw_axis *a, long i);

/* Reads a NULL-terminated list of "NAME=RANGE".  PW_INPUT also for too many rows.  Free the grid in every case. */
int pw_grid_read (pw_grid *g, const char *const *ranges, pw_error *error);
void pw_grid_free (pw_grid *g);
double pw_grid_value (const pw_grid *g, int axis, long row);

/* The k-th row in the order of execution, in which rows with the same parameters are consecutive. */
long pw_grid_ordered (const pw_grid *g, long k);
/* The index of a row's combination of parameters. */
long pw_grid_parameters (const pw_grid *g, long row);

#endif
