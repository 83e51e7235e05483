/* Printed tables. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "pinwheel-files.h"
#include "print_table.h"

int pw_table_pass (pw_table *t) {
  if (t->f == NULL) t->f = stdout;
  return t->pass++ < 2;
}

/* Characters of a UTF-8 text. */
static int table_length (const char *text) {
  int n = 0;
  for (; *text; text++) n += ((unsigned char)*text & 0xC0) != 0x80;
  return n;
}

int pw_cell (pw_table *t, int width, const char *text) {
  int n = table_length (text), *widest = &t->width[t->column++];
  if (*widest < abs (width)) *widest = abs (width);
  if (*widest < n) *widest = n;
  if (t->pass == 1) return 0;
  int blanks = *widest - n;
  fprintf (t->f, "%*s%s", t->pad + 2 + (width > 0 ? blanks : 0), "", text);
  t->pad = width > 0 ? 0 : blanks;
  t->indent += 2 + *widest;
  return 1;
}

int pw_cell_number (pw_table *t, int width, double value, int digits) {
  char text[32];
  return pw_cell (t, width, isnan (value) ? "" : pw_format (text, value, digits));
}

int pw_cell_unit (pw_table *t, int width, const char *name, const char *unit) {
  char text[350];
  snprintf (text, sizeof text, *unit ? "%s [%s]" : "%s", name, unit);
  return pw_cell (t, width, text);
}

void pw_row_end (pw_table *t) {
  if (t->pass == 2) fputc ('\n', t->f);
  t->column = t->pad = t->indent = 0;
}
