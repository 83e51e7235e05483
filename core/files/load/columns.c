/* Reads columns of numbers from a CSV file.
 *
 * The separator is a comma if the first line has one outside quotes, else a semicolon if it has one, else a tab.  A
 * cell in double quotes may contain it, and "" for a quote (RFC 4180), but no line end.  A first line without numbers
 * names the columns, "NAME" or "NAME [unit]"; numbers are converted to SI units.  Blank lines and lines that begin with
 * # are skipped. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "files.h"

enum { COLUMNS_MAX_BYTES = 64 << 20, COLUMNS_MAX_LINES = 1000000, COLUMNS_CELL = 1000 };

typedef struct {
  int index;     /* of its cell in each line, from 0 */
  double factor; /* to SI units */
} columns_source;

typedef struct {
  const char *shown;      /* path for messages */
  char *rest;             /* text not yet read */
  int line;               /* number of the last line read */
  int cells;              /* per line */
  columns_source *source; /* of each column to read; the first one is the time */
  int columns;
  pw_gaps gaps;      /* in all but the time */
  char separator[2]; /* "" before the first line */
  pw_error *error;
} columns;

#define columns_fail(c, ...) \
  pw_fail ((c)->error, PW_INPUT, "%.80s:%d: %s", (c)->shown, (c)->line, PW_PRINTED (300, __VA_ARGS__))

/* ---- Lines and cells ---- */

/* The end of the cell that begins here: the next of the separators outside quotes, or the end of the line. */
static const char *columns_cell_end (const char *cell, const char *separators) {
  const char *p = cell + strspn (cell, " ");
  if (*p == '"') /* to the closing quote, which is not doubled */
    for (p++; *p && (*p != '"' || p[1] == '"'); p++) p += *p == '"';
  return p + strcspn (p, separators);
}

static char columns_find_separator (const char *line) {
  static const char separators[] = ",;\t";
  int semicolon = 0;
  for (const char *end = columns_cell_end (line, separators); *end; end = columns_cell_end (end + 1, separators)) {
    if (*end == ',') return ',';
    semicolon |= *end == ';';
  }
  return semicolon ? ';' : '\t';
}

/* The next line that is neither blank nor a comment, or NULL. */
static char *columns_line (columns *c) {
  while (*c->rest) {
    char *line = c->rest, *end = line + strcspn (line, "\n");
    c->rest = *end ? end + 1 : end;
    c->line++;
    *end = 0;
    if (*line == '#' || line[strspn (line, " \t\r")] == 0) continue;
    if (*c->separator == 0) *c->separator = columns_find_separator (line);
    while (strchr (*c->separator == '\t' ? " \r" : " \t\r", end[-1])) *--end = 0;
    return line;
  }
  return NULL;
}

static int columns_count (const columns *c, const char *line) {
  int n = 1;
  while (*(line = columns_cell_end (line, c->separator))) line++, n++;
  return n;
}

/* Copies the cell that begins here, if need be cut, to the buffer, without surrounding blanks and quotes.  Returns the
 * beginning of the next one. */
static const char *columns_cell (const columns *c, const char *line, char *buffer, size_t size) {
  const char *end = columns_cell_end (line, c->separator), *next = end + 1;
  while (line < end && *line == ' ') line++;
  while (line < end && end[-1] == ' ') end--;
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

/* Copies cell i (from 0) of a line in the same way. */
static void columns_cell_at (const columns *c, const char *line, int i, char *buffer, size_t size) {
  while (i-- > 0) line = columns_cell_end (line, c->separator) + 1;
  columns_cell (c, line, buffer, size);
}

/* Whether a line names the columns: none of its cells is a number. */
static int columns_are_names (const columns *c, const char *line) {
  char cell[100];
  double value;
  for (int i = 0; i < c->cells; i++) {
    line = columns_cell (c, line, cell, sizeof cell);
    if (pw_read_number (cell, &value) == PW_OK) return 0;
  }
  return 1;
}

/* ---- Selection of columns ---- */

/* Finds a column from its number, or its name, with or without unit, if the first line names the columns (named: 1). */
static int columns_find (const columns *c, const char *first, int named, const char *name, int *index) {
  char cell[COLUMNS_CELL], unit[100], *end;
  pw_nearest near = { .sought = name };
  long number = strtol (name, &end, 10);
  if (*end == 0 && number >= 1 && number <= c->cells) return *index = (int)number - 1, PW_OK;
  if (*end == 0)
    return columns_fail (c, "there is no column %.20s: the line has %d cell%s", name, c->cells,
                         c->cells == 1 ? "" : "s");
  *index = -1;
  for (int i = 0; named && i < c->cells; i++) {
    first = columns_cell (c, first, cell, sizeof cell);
    int matches = strcmp (cell, name) == 0;
    cell[pw_unit_split (cell, unit, sizeof unit)] = 0;
    matches |= strcmp (cell, name) == 0;
    pw_nearest_try (&near, cell);
    if (matches && *index >= 0)
      return columns_fail (c, "columns %d and %d are both named \"%.60s\"", *index + 1, i + 1, name);
    if (matches) *index = i;
  }
  if (*index >= 0) return PW_OK;
  if (!named) return columns_fail (c, "there are no names of columns before the numbers, so no \"%.60s\"", name);
  return columns_fail (c, "there is no column \"%.60s\"%s", name, pw_nearest_text (&near));
}

static int columns_open (const columns *c, const char *first, int named, const char *name, const char *unit,
                         columns_source *source) {
  char cell[COLUMNS_CELL], reason[260];
  source->factor = 1;
  if (columns_find (c, first, named, name, &source->index) != PW_OK) return PW_INPUT;
  columns_cell_at (c, first, source->index, cell, sizeof cell);
  if (strlen (cell) == sizeof cell - 1) return columns_fail (c, "the name of column %d is too long", source->index + 1);
  if (!named || pw_unit_check (cell, unit, &source->factor, reason, sizeof reason) == PW_OK) return PW_OK;
  return columns_fail (c, "%s", reason);
}

/* ---- Numbers ---- */

/* A number in SI units; with gaps allowed, NaN for an empty cell or nan. */
static int columns_number (const columns *c, const char *line, columns_source source, pw_gaps gaps, double *value) {
  char cell[COLUMNS_CELL];
  columns_cell_at (c, line, source.index, cell, sizeof cell);
  int number = strlen (cell) < sizeof cell - 1 && pw_read_number (cell, value) == PW_OK; /* not cut */
  if (gaps == PW_GAPS_ALLOWED && (*cell == 0 || (number && isnan (*value)))) return *value = NAN, PW_OK;
  if (!number || !isfinite (*value))
    return columns_fail (c, "column %d: expected a finite number, found \"%.40s\"", source.index + 1, cell);
  *value *= source.factor;
  if (isfinite (*value)) return PW_OK;
  return columns_fail (c, "column %d: \"%.40s\" is too large in SI units", source.index + 1, cell);
}

/* Reads this line and all that follow into columns of `room` numbers; *rows: the number of lines read. */
static int columns_rows (columns *c, char *line, double *value, size_t room, int *rows) {
  for (int n = 0; line; line = columns_line (c), *rows = ++n) {
    int cells = columns_count (c, line);
    if (cells != c->cells) return columns_fail (c, "expected %d cells as in the first line, found %d", c->cells, cells);
    for (int k = 0; k < c->columns; k++)
      if (columns_number (c, line, c->source[k], k ? c->gaps : PW_GAPS_REFUSED, &value[(size_t)k * room + (size_t)n]) !=
          PW_OK)
        return PW_INPUT;
    if (n > 0 && !(value[n] > value[n - 1]))
      return columns_fail (c, "%.9g comes after %.9g: expected increasing times", value[n], value[n - 1]);
  }
  return PW_OK;
}

/* Stores the columns in *value, one after the other; the caller frees it in every case. */
static int columns_all (columns *c, const char *const *column, const char *const *unit, double **value, int *rows) {
  size_t lines = 1;
  for (const char *p = c->rest; (p = strchr (p, '\n')) != NULL && p[1]; p++) lines++;
  char *line = columns_line (c);
  if (line == NULL) return columns_fail (c, "the file is empty");
  if (lines > COLUMNS_MAX_LINES) return columns_fail (c, "more than %d lines", COLUMNS_MAX_LINES);
  c->cells = columns_count (c, line);
  int named = columns_are_names (c, line);
  for (int k = 0; k < c->columns; k++)
    if (columns_open (c, line, named, column[k], unit[k], &c->source[k]) != PW_OK) return PW_INPUT;
  *value = malloc ((size_t)c->columns * lines * sizeof **value);
  if (*value == NULL) return pw_fail (c->error, PW_RESOURCE, "%s: out of memory", c->shown);
  if (columns_rows (c, named ? columns_line (c) : line, *value, lines, rows) != PW_OK) return PW_INPUT;
  size_t n = (size_t)*rows;
  for (size_t k = 1; k < (size_t)c->columns; k++) memmove (*value + k * n, *value + k * lines, n * sizeof **value);
  return PW_OK;
}

double *pw_columns_from_stream (FILE *f, const char *shown, const char *const *column, const char *const *unit,
                                int width, pw_gaps gaps, int *rows, pw_error *error) {
  static const char byte_order_mark[] = "\xEF\xBB\xBF"; /* which some programs write */
  char *text;
  size_t size;
  double *value = NULL;
  *rows = 0;
  int status = pw_read_rest (f, COLUMNS_MAX_BYTES, shown, "the limit for a table", &text, &size, error);
  columns c = { .shown = shown, .rest = text, .columns = width, .gaps = gaps, .error = error };
  c.source = calloc ((size_t)width, sizeof *c.source);
  if (status == PW_OK && c.source == NULL) status = pw_fail (error, PW_RESOURCE, "%s: out of memory", shown);
  if (status == PW_OK && strlen (text) != size)
    status = pw_fail (error, PW_INPUT, "%.80s: a table is text, and this has a byte 0", shown);
  if (status == PW_OK && strncmp (text, byte_order_mark, 3) == 0) c.rest += 3;
  if (status == PW_OK) status = columns_all (&c, column, unit, &value, rows);
  free (text);
  free (c.source);
  if (status == PW_OK) return value;
  free (value);
  return NULL;
}

double *pw_read_columns (const char *path, const char *const *column, const char *const *unit, int width, int *rows,
                         pw_error *error) {
  const char *why;
  if (pw_require (path, "the name of a table", error) != PW_OK) return NULL;
  FILE *f = pw_open_input (path, &why);
  if (f == NULL) {
    pw_fail (error, pw_open_input_status (), "%s: cannot be read: %s", path, why);
    return NULL;
  }
  double *value = pw_columns_from_stream (f, path, column, unit, width, PW_GAPS_ALLOWED, rows, error);
  fclose (f);
  return value;
}
