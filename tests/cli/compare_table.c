/* The table that `pinwheel compare` writes; see compare_table.h. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "compare_table.h"

const char *compare_cell (const char *file, int row, int column) {
  static char cell[600];
  const char *at = cli_file (file);
  assert_non_null (at);
  for (int i = 0; i <= row; i++) {
    at = strchr (at, '\n');
    assert_non_null (at);
    at++;
  }
  for (int i = 0; i < column; i++) at = strchr (at, ',') + 1;
  snprintf (cell, sizeof cell, "%.*s", (int)strcspn (at, column == REASON ? "\n" : ",\n"), at);
  return cell;
}

double compare_number (const char *file, int row, int column) {
  return strtod (compare_cell (file, row, column), NULL);
}
