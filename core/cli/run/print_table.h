/* Printed tables: columns as wide as their widest cell. */
#ifndef PW_PRINT_TABLE_H
#define PW_PRINT_TABLE_H

#include <stdio.h>

/* Write the rows in a loop, which is passed twice, first to measure the columns:
 *
 *     for (pw_table t = { 0 }; pw_table_pass (&t);)
 *       for (...) { pw_cell (&t, -8, name); pw_cell_number (&t, 13, value, 8); pw_row_end (&t); } */
typedef struct {
  FILE *f;               /* NULL: standard output */
  int pass;              /* 1: measures, 2: prints */
  int column, width[12]; /* the current column, of at most 12 */
  int pad;               /* blanks before the next cell */
  int indent;            /* characters of the row so far, with those blanks */
} pw_table;

int pw_table_pass (pw_table *table);
/* A cell after two blanks, of at least |width| characters, aligned to the right; width <= 0: to the left.  Returns 1 if
 * it is printed in this pass. */
int pw_cell (pw_table *table, int width, const char *text);
/* A number with this number of digits; empty if it is NaN. */
int pw_cell_number (pw_table *table, int width, double value, int digits);
/* A cell "NAME [UNIT]". */
int pw_cell_unit (pw_table *table, int width, const char *name, const char *unit);
void pw_row_end (pw_table *table);
/* A row of headings, or the rest of one, ended by NULL: the first in a cell of width `first`, others of `width`. */
void pw_head (pw_table *table, int first, int width, const char *const *heading);

#endif
