/* Reads columns of numbers from a CSV file.
 *
 * Tabs, semicolons, commas or blanks separate the cells: the separator is the one by which the second line, or the only
 * one, has most numbers.  Unless it is a comma, numbers may have decimal commas.  A cell in double quotes may contain
 * the separator, and "" for a quote (RFC 4180), but no line end.  A first line without numbers names the columns,
 * "NAME" or "NAME [unit]"; numbers are converted to SI units.  Blank lines and lines that begin with # are skipped. */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

enum { COLUMNS_MAX_BYTES = 256 << 20, COLUMNS_MAX_LINES = 4000000, COLUMNS_CELL = 1000 };

typedef struct {
  int index;     /* of its cell in each line, from 0 */
  double factor; /* to SI units */
} columns_source;

typedef struct {
  const char *shown;      /* path for messages */
  char *rest;             /* text not yet read */
  int line;               /* number of the last line read */
  int cells;              /* per line */
  const char **cell;      /* where those of the last line split begin */
  columns_source *source; /* of each column to read */
  int increases;          /* 1: the first one is the time, which increases */
  int columns;
  pw_gaps gaps;
  unsigned char *missing; /* receives 1 for a column that the file does not have; NULL: it must have all */
  const char *separator;  /* one of columns_separators */
  int comma, point;       /* numbers of the last lines with a decimal comma or point, or 0 */
  pw_error *error;
} columns;

#define columns_fail(c, ...) \
  pw_fail ((c)->error, PW_INPUT, "%.80s:%d: %s", (c)->shown, (c)->line, PW_PRINTED (300, __VA_ARGS__))

/* Characters that end a cell; several blanks are one separator. */
static const char *const columns_separators[] = { "\t\n", ";\n", ",\n", " \t\n" };

static const char *columns_blanks (const char *separator) {
  return *separator == ' ' ? " \t" : " ";
}

/* The end of the cell that begins here: the next separator outside quotes, or the end of the line.  Between blanks, a
 * unit in brackets belongs to the name before it. */
static const char *columns_cell_end (const char *cell, const char *separator) {
  const char *p = cell + strspn (cell, columns_blanks (separator));
  if (*p == '"') /* to the closing quote, which is not doubled */
    for (p++; *p && (*p != '"' || p[1] == '"'); p++) p += *p == '"';
  p += strcspn (p, separator);
  const char *unit = *separator == ' ' ? p + strspn (p, " \t") : "";
  const char *close = *unit == '[' ? strchr (unit, ']') : *unit == '(' ? strchr (unit, ')') : NULL;
  return close ? close + strcspn (close, separator) : p;
}

/* Copies the cell that begins here, if need be cut, to the buffer, without surrounding blanks and quotes.  Returns its
 * end. */
static const char *columns_cell (const char *separator, const char *line, char *buffer, size_t size) {
  const char *end = columns_cell_end (line, separator), *const next = end;
  line += strspn (line, columns_blanks (separator));
  while (line < end && strchr (" \r", end[-1])) end--;
  int quoted = end - line > 1 && *line == '"' && end[-1] == '"';
  if (quoted) line++, end--;
  size_t n = 0;
  for (; line < end && n + 1 < size; line++) {
    buffer[n++] = *line;
    line += quoted && line[0] == '"' && line[1] == '"';
  }
  buffer[n] = 0;
  return next;
}

/* Reads a number; if commas do not separate cells, also with a decimal comma. */
static int columns_read (const char *separator, char *cell, double *value) {
  char *comma = *separator == ',' ? NULL : strchr (cell, ',');
  if (comma && comma > cell && strspn (comma - 1, "0123456789") == 1 && strspn (comma + 1, "0123456789") > 0)
    *comma = '.';
  int status = pw_read_number (cell, value);
  if (comma) *comma = ','; /* for messages */
  return status;
}

static int columns_count (const char *separator, const char *line) {
  int n = 1;
  while (*(line = columns_cell_end (line, separator)) && *line != '\n') line++, n++;
  return n;
}

/* Counts the cells that are numbers, and subtracts a little for each one that is neither a number nor empty. */
static double columns_numbers (const char *separator, const char *line) {
  char cell[100];
  double count = 0, value;
  for (;; line++) {
    line = columns_cell (separator, line, cell, sizeof cell);
    if (*cell) count += columns_read (separator, cell, &value) == PW_OK ? 1 : -1e-6;
    if (*line == 0 || *line == '\n') return count;
  }
}

/* The first line from here that is neither blank nor a comment, or the end of the text; counts the lines passed. */
static char *columns_skip (char *text, int *lines) {
  while (*text && (*text == '#' || strchr ("\n", text[strspn (text, " \t\r")]))) {
    text += strcspn (text, "\n");
    text += *text == '\n';
    ++*lines;
  }
  return text;
}

/* Finds the separator: the one by which the second line, or the only one, has most numbers; without numbers, the one by
 * which the first line has most cells. */
static const char *columns_find_separator (char *text) {
  char *first = columns_skip (text, &(int){ 0 }), *second = columns_skip (first + strcspn (first, "\n"), &(int){ 0 });
  const char *best = NULL;
  double most = 0;
  for (int by_numbers = 1; best == NULL; by_numbers--)
    for (int i = 0; i < 4; i++) {
      const char *separator = columns_separators[i];
      double count =
          by_numbers ? columns_numbers (separator, *second ? second : first) : columns_count (separator, first);
      if (count > most) most = count, best = separator;
    }
  return best;
}

/* The next line that is neither blank nor a comment, or NULL. */
static char *columns_line (columns *c) {
  char *line = columns_skip (c->rest, &c->line), *end = line + strcspn (line, "\n");
  c->rest = *end ? end + 1 : end;
  if (*line == 0) return NULL;
  c->line++;
  *end = 0;
  while (strchr (*c->separator == '\t' ? " \r" : " \t\r", end[-1])) *--end = 0;
  return line;
}

/* Finds where the cells of a line begin; returns their number, which may exceed that of the first line. */
static int columns_split (columns *c, const char *line) {
  for (int n = 0;; line++) {
    if (n < c->cells) c->cell[n] = line;
    line = columns_cell_end (line, c->separator), n++;
    if (*line == 0 || *line == '\n') return n;
  }
}

/* Finds a column from its number, or its name, with or without unit, if the first line names the columns (named: 1). */
static int columns_find (const columns *c, int named, const char *name, int *index) {
  char cell[COLUMNS_CELL], unit[100], *end;
  pw_nearest near = { .sought = name };
  const size_t length = strlen (name);
  long number = strtol (name, &end, 10);
  if (*end == 0 && number >= 1 && number <= c->cells) return *index = (int)number - 1, PW_OK;
  if (*end == 0)
    return columns_fail (c, "there is no column %.20s: the line has %d cell%s%s", name, c->cells,
                         c->cells == 1 ? "" : "s",
                         c->cells == 1 ? "; separate cells by commas, semicolons, tabs or blanks" : "");
  *index = -1;
  for (int i = 0; named && i < c->cells; i++) {
    const char *begin = c->cell[i] + strspn (c->cell[i], " \t\"");
    if (c->missing && strncmp (begin, name, length) != 0) continue; /* the number of names may be large */
    columns_cell (c->separator, c->cell[i], cell, sizeof cell);
    int matches = strcmp (cell, name) == 0;
    cell[pw_unit_split (cell, unit, sizeof unit)] = 0;
    matches |= strcmp (cell, name) == 0;
    pw_nearest_try (&near, cell);
    if (matches && *index >= 0)
      return columns_fail (c, "columns %d and %d are both named \"%.60s\"", *index + 1, i + 1, name);
    if (matches) *index = i;
  }
  if (*index >= 0 || c->missing) return PW_OK;
  if (!named) return columns_fail (c, "there are no names of columns before the numbers, so no \"%.60s\"", name);
  return columns_fail (c, "there is no column \"%.60s\"%s", name, pw_nearest_text (&near));
}

/* Its index is -1 if the column may be missing and is. */
static int columns_open (const columns *c, int named, const char *name, const char *unit, columns_source *source) {
  char cell[COLUMNS_CELL], reason[260];
  source->factor = 1;
  if (columns_find (c, named, name, &source->index) != PW_OK) return PW_INPUT;
  if (source->index < 0) return PW_OK;
  columns_cell (c->separator, c->cell[source->index], cell, sizeof cell);
  if (strlen (cell) == sizeof cell - 1) return columns_fail (c, "the name of column %d is too long", source->index + 1);
  if (!named || pw_unit_check (cell, unit, &source->factor, reason, sizeof reason) == PW_OK) return PW_OK;
  return columns_fail (c, "%s", reason);
}

/* A table has either decimal commas or decimal points; where both occur, some separate thousands. */
static int columns_check_decimals (columns *c, const char *cell, int is_comma, columns_source source) {
  if (is_comma) c->comma = c->line;
  if (!is_comma && strchr (cell, '.')) c->point = c->line;
  if (c->comma == 0 || c->point == 0) return PW_OK;
  return columns_fail (c, "column %d: a decimal %s, but line %d has a decimal %s: use one of them", source.index + 1,
                       is_comma ? "comma" : "point", is_comma ? c->point : c->comma, is_comma ? "point" : "comma");
}

/* A number in SI units; NaN for an empty cell or, if it may be a gap, for nan. */
static int columns_number (columns *c, columns_source source, pw_gaps gaps, double *value) {
  char cell[COLUMNS_CELL];
  columns_cell (c->separator, c->cell[source.index], cell, sizeof cell);
  const char *comma = strchr (cell, ',');
  int number = strlen (cell) < sizeof cell - 1 && columns_read (c->separator, cell, value) == PW_OK; /* not cut */
  if (*cell == 0 && gaps == PW_GAPLESS) return columns_fail (c, "column %d has no number", source.index + 1);
  if (*cell == 0 || (gaps == PW_GAPS_ALLOWED && number && isnan (*value))) return *value = NAN, PW_OK;
  if (!number || !isfinite (*value))
    return columns_fail (c, "column %d: expected a finite number, found \"%.40s\"%s", source.index + 1, cell,
                         comma == NULL          ? ""
                         : *c->separator == ',' ? "; with decimal commas, separate cells by semicolons or tabs"
                                                : "; nothing may separate thousands");
  if (columns_check_decimals (c, cell, comma != NULL, source) != PW_OK) return PW_INPUT;
  *value *= source.factor;
  if (isfinite (*value)) return PW_OK;
  return columns_fail (c, "column %d: \"%.40s\" is too large in SI units", source.index + 1, cell);
}

/* Reads this line and all that follow into columns of `room` numbers; *rows: the number of lines read. */
static int columns_rows (columns *c, char *line, double *value, size_t room, int *rows) {
  double last = -INFINITY; /* time */
  for (int n = 0; line; line = columns_line (c), *rows = ++n) {
    int cells = columns_split (c, line);
    if (cells != c->cells)
      return columns_fail (c, "expected %d cells as in the first line, found %d%s", c->cells, cells,
                           cells > c->cells && *c->separator == ','
                               ? "; with decimal commas, separate cells by semicolons or tabs"
                               : "");
    for (int k = 0; k < c->columns; k++)
      if (columns_number (c, c->source[k], k == 0 && c->increases ? PW_GAPS_REFUSED : c->gaps,
                          &value[(size_t)k * room + (size_t)n]) != PW_OK)
        return PW_INPUT;
    if (c->increases && value[n] <= last)
      return columns_fail (c, "%.9g comes after %.9g: expected increasing times", value[n], last);
    if (!isnan (value[n])) last = value[n];
  }
  return PW_OK;
}

/* The names x and y for the columns to read, if the file has both. */
static int columns_xy (columns *c, const char *const **column) {
  static const char *const xy[] = { "x", "y" };
  unsigned char *const missing = c->missing;
  int index[2] = { -1, -1 };
  c->missing = &(unsigned char){ 0 };
  int status = columns_find (c, 1, xy[0], &index[0]);
  if (status == PW_OK) status = columns_find (c, 1, xy[1], &index[1]);
  c->missing = missing;
  if (index[0] >= 0 && index[1] >= 0) *column = xy;
  return status;
}

/* Which column to read: the one that is given, else the first two, of which the second is not the time. */
static int columns_select (columns *c, char *line, int named, const char *const *column, const char *const *unit) {
  const int whole = strchr (line, '.') == NULL && strchr (c->rest, '.') == NULL;
  if (!named && *c->separator == ',' && c->cells > 2 && c->cells % 2 == 0 && whole && !column[0] && !column[1])
    return columns_fail (c,
                         "without names, %d cells of whole numbers: with decimal commas, separate cells by semicolons "
                         "or tabs; otherwise write columns: [1, 2]",
                         c->cells);
  if (named && c->gaps == PW_GAPLESS && !column[0] && columns_xy (c, &column) != PW_OK) return PW_INPUT;
  unsigned char *missing = c->missing;
  int found = 0;
  for (int k = 0; k < c->columns; k++) {
    const char *other = k && c->source[0].index == 1 ? "1" : "2";
    c->missing = k ? missing : NULL;
    if (columns_open (c, named, column[k] ? column[k] : k ? other : "1", unit[k], &c->source[found]) != PW_OK)
      return PW_INPUT;
    if (missing) missing[k] = c->source[found].index < 0;
    found += c->source[found].index >= 0;
  }
  c->columns = found;
  return PW_OK;
}

/* Stores the columns in *value, one after the other; the caller frees it in every case. */
static int columns_all (columns *c, const char *const *column, const char *const *unit, double **value, int *rows) {
  size_t lines = 1;
  for (const char *p = c->rest; (p = strchr (p, '\n')) != NULL && p[1]; p++) lines++;
  c->separator = columns_find_separator (c->rest);
  char *line = columns_line (c);
  if (line == NULL) return columns_fail (c, "the file is empty");
  if (lines > COLUMNS_MAX_LINES) return columns_fail (c, "more than %d lines", COLUMNS_MAX_LINES);
  c->cells = columns_count (c->separator, line);
  int named = columns_numbers (c->separator, line) < 0.5;
  c->cell = malloc ((size_t)c->cells * sizeof *c->cell);
  if (c->cell == NULL) return pw_fail (c->error, PW_RESOURCE, "%s: out of memory", c->shown);
  columns_split (c, line);
  if (columns_select (c, line, named, column, unit) != PW_OK) return PW_INPUT;
  *value = malloc ((size_t)c->columns * lines * sizeof **value);
  if (*value == NULL) return pw_fail (c->error, PW_RESOURCE, "%s: out of memory", c->shown);
  if (columns_rows (c, named ? columns_line (c) : line, *value, lines, rows) != PW_OK) return PW_INPUT;
  size_t n = (size_t)*rows;
  for (size_t k = 1; k < (size_t)c->columns; k++) memmove (*value + k * n, *value + k * lines, n * sizeof **value);
  return PW_OK;
}

double *pw_columns_from_stream (FILE *f, const char *shown, const char *const *column, const char *const *unit,
                                int width, pw_gaps gaps, unsigned char *missing, int *rows, pw_error *error) {
  static const char byte_order_mark[] = "\xEF\xBB\xBF"; /* which some programs write */
  char *text;
  size_t size;
  double *value = NULL;
  *rows = 0;
  int status = pw_read_rest (f, COLUMNS_MAX_BYTES, shown, "the limit for a table", &text, &size, error);
  columns c = { .shown = shown, .rest = text, .columns = width, .gaps = gaps, .missing = missing, .error = error };
  c.source = calloc ((size_t)width, sizeof *c.source);
  c.increases = unit[0] && strcmp (unit[0], "s") == 0;
  if (status == PW_OK && c.source == NULL) status = pw_fail (error, PW_RESOURCE, "%s: out of memory", shown);
  if (status == PW_OK && strlen (text) != size)
    status = pw_fail (error, PW_INPUT, "%.80s: a table is text, and this has a byte 0", shown);
  if (status == PW_OK && strncmp (text, byte_order_mark, 3) == 0) c.rest += 3;
  if (status == PW_OK) status = columns_all (&c, column, unit, &value, rows);
  free (text);
  free (c.cell);
  free (c.source);
  if (status == PW_OK) return value;
  free (value);
  return NULL;
}

double *pw_read_columns (const char *path, const char *const *column, const char *const *unit, int width,
                         unsigned char *missing, int *rows, pw_error *error) {
  const char *why;
  if (pw_require (path, "the name of a table", error) != PW_OK) return NULL;
  FILE *f = pw_open_input (path, &why);
  if (f == NULL) {
    pw_fail (error, pw_open_input_status (), "%s: cannot be read: %s", path, why);
    return NULL;
  }
  double *value = pw_columns_from_stream (f, path, column, unit, width, PW_GAPS_ALLOWED, missing, rows, error);
  fclose (f);
  return value;
}

/* Units in the headers of tables: conversion to SI units and check of the dimension.
 *
 * A unit is a product of names with optional powers: "N mm", "m/s^2", "km/h".  A slash divides by the single name after
 * it.  Angles are a separate dimension, since 1/s could mean turns or radians. */

/* The name km/h, and parentheses, are for messages of yaml.c, which take the first name of this list in a text. */
#define deg (PW_PI / 180)
#define pi PW_PI
#define UNIT(name, factor, si) \
  { name, #factor, factor, si }
const pw_unit_name pw_unit_names[] = {
  UNIT ("m", 1, "m"),
  UNIT ("kg", 1, "kg"),
  UNIT ("s", 1, "s"),
  UNIT ("rad", 1, "rad"),
  UNIT ("N", 1, "kg m/s^2"),
  UNIT ("J", 1, "kg m^2/s^2"),
  UNIT ("W", 1, "kg m^2/s^3"),
  UNIT ("degrees", deg, "rad"),
  UNIT ("degree", deg, "rad"),
  UNIT ("deg", deg, "rad"),
  UNIT ("°", deg, "rad"),
  UNIT ("grad", (pi / 200), "rad"),
  UNIT ("gon", (pi / 200), "rad"),
  UNIT ("mrad", 1e-3, "rad"),
  UNIT ("rev", (2 * pi), "rad"),
  UNIT ("rpm", (pi / 30), "rad/s"),
  UNIT ("km/h", (1 / 3.6), "m/s"),
  UNIT ("mph", 0.44704, "m/s"),
  UNIT ("ft", 0.3048, "m"),
  UNIT ("mi", 1609.344, "m"),
  UNIT ("um", 1e-6, "m"),
  UNIT ("\xC2\xB5m", 1e-6, "m"), /* the micro sign, then the Greek letter */
  UNIT ("\xCE\xBCm", 1e-6, "m"),
  UNIT ("mm", 1e-3, "m"),
  UNIT ("cm", 1e-2, "m"),
  UNIT ("dm", 0.1, "m"),
  UNIT ("km", 1e3, "m"),
  UNIT ("us", 1e-6, "s"),
  UNIT ("\xC2\xB5s", 1e-6, "s"),
  UNIT ("\xCE\xBCs", 1e-6, "s"),
  UNIT ("ms", 1e-3, "s"),
  UNIT ("min", 60, "s"),
  UNIT ("h", 3600, "s"),
  UNIT ("mN", 1e-3, "N"),
  UNIT ("kN", 1e3, "N"),
  UNIT ("MN", 1e6, "N"),
  UNIT ("Nm", 1, "N m"),
  UNIT ("kNm", 1e3, "N m"),
  UNIT ("Nmm", 1e-3, "N m"),
  UNIT ("g", 1e-3, "kg"),
  UNIT ("mg", 1e-6, "kg"),
  UNIT ("ug", 1e-9, "kg"),
  UNIT ("\xC2\xB5g", 1e-9, "kg"),
  UNIT ("\xCE\xBCg", 1e-9, "kg"),
  UNIT ("lb", 0.45359237, "kg"),
  UNIT ("lbf", 4.4482216152605, "N"),
  UNIT ("kJ", 1e3, "J"),
  UNIT ("kW", 1e3, "W"),
  UNIT ("in", 0.0254, "m"), /* the last: yaml.c takes other units first, since it may be a preposition */
  { .name = NULL },
};
#undef UNIT
#undef pi
#undef deg

enum { UNITS_BASE = 4 }; /* base units, first in the list */

/* A unit: its factor to SI units, and its dimension as powers of the base units. */
typedef struct {
  double factor;
  int power[UNITS_BASE];
} units_value;

static int units_read (const char *text, units_value *u);

static int units_multiply (const char *name, size_t n, int power, units_value *u) {
  units_value one = { .factor = 1 };
  const pw_unit_name *unit = pw_unit_names;
  while (unit->name && !(strlen (unit->name) == n && memcmp (unit->name, name, n) == 0)) unit++;
  if (unit->name == NULL && !(n == 1 && *name == '1')) return PW_INPUT;
  if (unit < pw_unit_names + UNITS_BASE)
    one.power[unit - pw_unit_names] = 1;
  else if (unit->name) {
    units_read (unit->si, &one);
    one.factor *= unit->value;
  }
  u->factor *= power == 1 ? one.factor : pow (one.factor, power);
  for (int k = 0; k < UNITS_BASE; k++) u->power[k] += power * one.power[k];
  return PW_OK;
}

const char *pw_unit_power (const char *p, int *power) {
  static const char square[] = "\xC2\xB2", cube[] = "\xC2\xB3";
  char *end;
  *power = strncmp (p, square, 2) == 0 ? 2 : strncmp (p, cube, 2) == 0 ? 3 : 1;
  if (*power > 1) return p + 2;
  const int caret = *p == '^';
  p += caret;
  if (!isdigit ((unsigned char)*p) && !(*p == '-' && isdigit ((unsigned char)p[1]))) return *power = !caret, p;
  long value = strtol (p, &end, 10);
  *power = value > -10 && value < 10 ? (int)value : 0;
  return end;
}

/* Reads a product of names with powers; a slash divides by the next name only.  PW_INPUT if the text is none. */
static int units_read (const char *text, units_value *u) {
  static const char ends[] = " */^0123456789-\xC2"; /* of a name; the last begins a raised digit or a middle dot */
  static const char dot[] = "\xC2\xB7";
  int divide = 0, names = 0;
  *u = (units_value){ .factor = 1 };
  for (const char *p = text; *p;) {
    int power;
    size_t symbol = strncmp (p, "°", 2) == 0 || strncmp (p, "µ", 2) == 0 ? 2 : 0; /* begins with \xC2, too */
    size_t n = symbol + strcspn (p + symbol, ends);
    if (n == 0 && *p == '1' && !isdigit ((unsigned char)p[1])) n = 1; /* as in 1/s; other numbers are no units */
    if (n > 0) {
      const char *after = pw_unit_power (p + n, &power);
      if (power == 0 || units_multiply (p, n, divide ? -power : power, u) != PW_OK) return PW_INPUT;
      divide = 0, names++;
      p = after;
    }
    size_t separators = strspn (p, " *");
    p += separators;
    if (*p == '/' && !divide)
      divide = 1, p++, separators++;
    else if (strncmp (p, dot, 2) == 0)
      p += 2, separators++;
    p += strspn (p, " ");
    if (separators == 0 && *p) return PW_INPUT;
  }
  return divide || names == 0 ? PW_INPUT : PW_OK;
}

int pw_unit_factor (const char *unit, const char *wanted, double *factor) {
  units_value given, expected;
  *factor = 1;
  if (units_read (unit, &given) != PW_OK) return PW_INPUT;
  *factor = given.factor;
  if (wanted == NULL || units_read (wanted, &expected) != PW_OK) return PW_OK;
  return memcmp (given.power, expected.power, sizeof given.power) == 0 ? PW_OK : PW_RETRY;
}

size_t pw_unit_split (const char *cell, char *unit, size_t size) {
  size_t n = strlen (cell), name;
  double factor;
  *unit = 0;
  if (n < 2 || (cell[n - 1] != ']' && cell[n - 1] != ')')) return n;
  const char *open = strrchr (cell, cell[n - 1] == ']' ? '[' : '(');
  if (open == NULL) return n;
  const char *from = open + 1 + strspn (open + 1, " "), *end = cell + n - 1;
  while (end > from && end[-1] == ' ') end--;
  snprintf (unit, size, "%.*s", (int)(end - from < 90 ? end - from : 90), from);
  if (*open == '(' && pw_unit_factor (unit, NULL, &factor) != PW_OK) return *unit = 0, n; /* may be any remark */
  if (strcmp (unit, "-") == 0 || strcmp (unit, "1") == 0) *unit = 0;
  for (name = (size_t)(open - cell); name > 0 && cell[name - 1] == ' ';) name--;
  return name;
}

int pw_unit_check (const char *cell, const char *wanted, double *factor, char *why, size_t size) {
  char unit[100];
  *factor = 1;
  pw_unit_split (cell, unit, sizeof unit);
  int status = *unit ? pw_unit_factor (unit, wanted, factor) : PW_OK;
  if (status == PW_INPUT)
    snprintf (why, size, "column \"%.60s\": the unit \"%.40s\" is not known; expected %s, or one that converts to it",
              cell, unit, wanted ? wanted : "an SI unit");
  if (status == PW_RETRY)
    snprintf (why, size, "column \"%.60s\": the unit \"%.40s\" does not measure what %s does, which is expected", cell,
              unit, wanted);
  return status == PW_OK ? PW_OK : PW_INPUT;
}
