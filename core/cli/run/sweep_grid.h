/* The grid of a sweep: all combinations of the values of its varied quantities (axes), one per row.  Rows are numbered
 * from 0 in the order of the table, in which the last axis varies fastest. */
#ifndef PW_SWEEP_GRID_H
#define PW_SWEEP_GRID_H

#include "util.h"

#define PW_GRID_MAX_ROWS 1e8 /* larger grids are refused: a journal needs 8 bytes of memory per row */

/* A varied quantity: a parameter of the model or the initial value of a state. */
typedef struct {
  char *name;
  char *range; /* "lin:1:10:100", as written */
  enum { PW_AXIS_LIST, PW_AXIS_LIN, PW_AXIS_LOG } type;
  double first, last;            /* of PW_AXIS_LIN and PW_AXIS_LOG */
  double *value;                 /* of PW_AXIS_LIST */
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

/* Reads "NAME=RANGE"; the arrays of the axis are in the arena.  PW_INPUT with the reason, PW_RESOURCE. */
int pw_axis_read (pw_axis *axis, const char *text, pw_arena *arena, pw_error *error);
double pw_axis_value (const pw_axis *axis, long i); /* i from 0 */

/* Reads a NULL-terminated list of "NAME=RANGE", likewise.  PW_INPUT also if there are too many rows. */
int pw_grid_read (pw_grid *grid, const char *const *ranges, pw_arena *arena, pw_error *error);
double pw_grid_value (const pw_grid *grid, int i, long row); /* of axis i */

/* The row that is computed k-th, from 0: rows with the same parameters follow each other and share a compiled model. */
long pw_grid_scheduled_row (const pw_grid *grid, long k);
/* The number, from 0, of a row's combination of parameters, without regard to its initial values. */
long pw_grid_parameter_index (const pw_grid *grid, long row);

#endif
