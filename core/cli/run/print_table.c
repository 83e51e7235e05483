/* Prints tables: a first pass over the rows measures the columns, a second one prints. */
#include <math.h>
#include <stdlib.h>
#include "cli.h"
#include "print_table.h"

int pw_table_pass (pw_table *table) {
  if (table->f == NULL) table->f = stdout;
  return table->pass++ < 2;
}

/* Characters of a UTF-8 text. */
static int table_length (const char *text) {
  int length = 0;
  for (; *text; text++) length += ((unsigned char)*text & 0xC0) != 0x80;
  return length;
}

int pw_cell (pw_table *table, int width, const char *text) {
  int length = table_length (text), *widest = &table->width[table->column++];
  if (*widest < abs (width)) *widest = abs (width);
  if (*widest < length) *widest = length;
  if (table->pass == 1) return 0;
  int blanks = *widest - length;
  fprintf (table->f, "%*s%s", table->pad + 2 + (width > 0 ? blanks : 0), "", text);
  table->pad = width > 0 ? 0 : blanks;
  table->indent += 2 + *widest;
  return 1;
}

int pw_cell_number (pw_table *table, int width, double value, int digits) {
  return pw_cell (table, width, isnan (value) ? "" : PW_DIGITS (value, digits));
}

int pw_cell_unit (pw_table *table, int width, const char *name, const char *unit) {
  return pw_cell (table, width, PW_PRINTED (350, *unit ? "%s [%s]" : "%s", name, unit));
}

void pw_row_end (pw_table *table) {
  if (table->pass == 2) fputc ('\n', table->f);
  table->column = table->pad = table->indent = 0;
}

void pw_head (pw_table *table, int first, int width, const char *const *heading) {
  pw_cell (table, first, *heading);
  while (*++heading) pw_cell (table, width, *heading);
  pw_row_end (table);
}
