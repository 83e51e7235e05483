/* A reference from a file: a table with the columns of `pinwheel run -o`; missing columns are not compared. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"
#include "util.h"

#define FILE_SAME 1e-9 /* relative to the end: smaller differences of times are ignored */

typedef struct {
  const char *path;
  FILE *f;
  char *line;
  size_t room;
  long number;   /* of the line */
  int *place;    /* columns after the first: index in a motion, or -1 */
  double *sign;  /* factor to SI units; negative for reactions, which are -lambda */
  double second; /* unit of the time [s] */
  int columns, known;
  pw_names index; /* in a motion, of states and reactions */
  pw_arena names;
} file_reader;

/* ---- Lines ---- */

enum { FILE_LINE = 16 << 20 }; /* bytes of the longest line */

static int file_unreadable (const file_reader *in, const char *why, pw_error *error) {
  return pw_fail (error, PW_INPUT, "--reference %s: cannot be read: %s", in->path, why);
}

/* Doubles the room for a line. */
static int file_grow (file_reader *in, pw_error *error) {
  size_t room = in->room ? 2 * in->room : 1 << 12;
  if (room > FILE_LINE)
    return pw_fail (error, PW_INPUT, "--reference %s: cannot be read: line %ld has more than %d MB", in->path,
                    in->number + 1, FILE_LINE >> 20);
  char *more = realloc (in->line, room);
  if (more == NULL) return pw_fail (error, PW_RESOURCE, "--reference %s: out of memory", in->path);
  in->line = more;
  in->room = room;
  return PW_OK;
}

/* Reads up to the end of the line; PW_RETRY at the end of the file. */
static int file_read_line (file_reader *in, pw_error *error) {
  size_t used = 0;
  do {
    if (in->room - used < 2 && file_grow (in, error) != PW_OK) return error->status;
    errno = 0;
    if (fgets (in->line + used, (int)(in->room - used), in->f) == NULL) {
      if (!feof (in->f)) return file_unreadable (in, strerror (errno), error);
      return used > 0 ? PW_OK : PW_RETRY;
    }
    if (in->line[used] == 0) return file_unreadable (in, "a table is text, and this has a byte 0", error);
    used += strlen (in->line + used);
  } while (in->line[used - 1] != '\n');
  return PW_OK;
}

/* The next line that is not empty, without its end; PW_RETRY at the end of the file. */
static int file_line (file_reader *in, pw_error *error) {
  for (;;) {
    int status = file_read_line (in, error);
    if (status != PW_OK) return status;
    size_t n = strlen (in->line);
    while (n > 0 && strchr ("\r\n", in->line[n - 1])) in->line[--n] = 0;
    in->number++;
    if (n > 0) return PW_OK;
  }
}

/* Splits off the next cell. */
static char *file_cell (char **rest) {
  char *cell = *rest, *comma = strchr (cell, ',');
  *rest = comma ? comma + 1 : cell + strlen (cell);
  if (comma) *comma = 0;
  return cell;
}

static int file_number (const file_reader *in, const char *cell, double *value, pw_error *error) {
  if (pw_read_number (cell, value) == PW_OK) return PW_OK;
  return pw_fail (error, PW_INPUT, "--reference %s: line %ld: \"%.60s\" is not a number", in->path, in->number, cell);
}

/* ---- Columns ---- */

static int file_index (file_reader *in, const pw_system *s) {
  char name[300];
  int states = 2 * pw_system_coordinates (s), rows = pw_system_rows (s);
  if (pw_names_open (&in->index, (size_t)(states + rows)) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < states + rows; i++) {
    if (i < states)
      pw_system_state_name (s, i, name, sizeof name);
    else
      pw_system_reaction_name (s, i - states, name, sizeof name);
    const char *copy = pw_arena_copy (&in->names, name);
    if (copy == NULL) return PW_RESOURCE;
    pw_names_add (&in->index, copy, i);
  }
  return PW_OK;
}

/* Finds column i, such as "frame.x [m]", in a motion. */
static int file_column (file_reader *in, int i, const pw_system *s, const char *cell, pw_error *error) {
  char name[300], unit[260];
  double factor;
  int states = 2 * pw_system_coordinates (s);
  snprintf (name, sizeof name, "%.*s", (int)pw_unit_split (cell, unit, sizeof unit), cell);
  int place = in->place[i] = pw_names_find (&in->index, name), is_state = place < states;
  if (place < 0) return PW_OK;
  const char *wanted = is_state ? pw_system_state_unit (s, place) : pw_system_reaction_unit (s, place - states);
  if (pw_unit_check (cell, wanted, &factor, unit, sizeof unit) != PW_OK)
    return pw_fail (error, PW_INPUT, "--reference %s: %s", in->path, unit);
  in->sign[i] = is_state ? factor : -factor;
  in->known += is_state;
  return PW_OK;
}

static int file_columns (file_reader *in, const pw_system *s, pw_error *error) {
  char example[300], unit[260], *rest;
  int status = file_line (in, error);
  if (status == PW_RETRY) return pw_fail (error, PW_INPUT, "--reference %s: the file is empty", in->path);
  if (status != PW_OK) return status;
  for (const char *c = in->line; *c; c++) in->columns += *c == ',';
  in->place = calloc ((size_t)in->columns + 1, sizeof *in->place);
  in->sign = calloc ((size_t)in->columns + 1, sizeof *in->sign);
  if (in->place == NULL || in->sign == NULL || file_index (in, s) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  rest = in->line;
  const char *first = file_cell (&rest);
  if (pw_unit_split (first, unit, sizeof unit) != 1 || *first != 't')
    return pw_fail (error, PW_INPUT, "--reference %s: the first column is \"%.60s\", expected \"t [s]\"", in->path,
                    first);
  if (pw_unit_check (first, "s", &in->second, unit, sizeof unit) != PW_OK)
    return pw_fail (error, PW_INPUT, "--reference %s: %s", in->path, unit);
  for (int i = 0; i < in->columns; i++)
    if (file_column (in, i, s, file_cell (&rest), error) != PW_OK) return error->status;
  if (in->known) return PW_OK;
  return pw_fail (error, PW_INPUT, "--reference %s: no column is a state of this model, such as \"%s\"", in->path,
                  pw_system_state_name (s, 0, example, sizeof example));
}

/* ---- Rows ---- */

/* The next line's time; PW_RETRY at the end. */
static int file_time (file_reader *in, char **rest, double *t, pw_error *error) {
  int status = file_line (in, error);
  if (status != PW_OK) return status;
  *rest = in->line;
  status = file_number (in, file_cell (rest), t, error);
  if (status == PW_OK) *t *= in->second;
  return status;
}

/* Rows from the start to the end, which is the time of the last row if it is not given. */
static int file_count (file_reader *in, double *t_end, int whole, int *rows, pw_error *error) {
  double t, last = 0, before = -INFINITY;
  char *rest;
  int status;
  for (*rows = 0; (status = file_time (in, &rest, &t, error)) == PW_OK;) {
    if (!(t > before) || isinf (t))
      return pw_fail (error, PW_INPUT, "--reference %s: line %ld: times must be finite and increase", in->path,
                      in->number);
    before = t;
    if (t <= 0 || (*t_end > 0 && t > *t_end * (1 + FILE_SAME))) continue;
    last = t;
    ++*rows;
  }
  if (status != PW_RETRY) return status;
  if (*t_end == 0) *t_end = last;
  char end[32], reached[32];
  if (*rows == 0 && !whole)
    return pw_fail (error, PW_INPUT, "--reference %s: no row between 0 and the final time, t = %s s", in->path,
                    pw_format (end, *t_end, 9));
  if (*rows > 0 && (!whole || fabs (last - *t_end) <= FILE_SAME * *t_end)) return PW_OK;
  return pw_fail (error, PW_INPUT,
                  "--reference %s: no row at the final time, t = %s s; the last one before it is at %s s", in->path,
                  pw_format (end, *t_end, 9), pw_format (reached, last, 9));
}

static int file_row (file_reader *in, char *rest, double *x, int width, pw_error *error) {
  for (int i = 0; i < width; i++) x[i] = NAN;
  for (int i = 0; i < in->columns; i++) {
    const char *cell = file_cell (&rest);
    double value;
    if (in->place[i] < 0) continue;
    int status = file_number (in, cell, &value, error);
    if (status != PW_OK) return status;
    x[in->place[i]] = in->sign[i] * value;
  }
  return PW_OK;
}

/* Selects as many rows as there are samples, evenly spaced and including the last one; times within round-off of the
 * end are set to it. */
static int file_rows (file_reader *in, int rows, double t_end, pw_motion *m, pw_error *error) {
  char *rest;
  double t;
  for (int row = 0, k = 0; k < m->samples;) {
    int status = file_time (in, &rest, &t, error);
    if (status != PW_OK) return status;
    if (t <= 0 || ++row < (int)((long long)rows * (k + 1) / m->samples)) continue;
    m->t[k] = fabs (t - t_end) <= FILE_SAME * t_end ? t_end : t;
    status = file_row (in, rest, m->x + k++ * m->width, m->width, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}

static int file_read (file_reader *in, pw_motion *m, const pw_system *s, double *t_end, int whole, pw_error *error) {
  int rows;
  int status = file_columns (in, s, error);
  if (status == PW_OK) status = file_count (in, t_end, whole, &rows, error);
  if (status != PW_OK) return status;
  rewind (in->f);
  in->number = 0;
  status = file_line (in, error);
  if (status == PW_OK) status = pw_motion_open (m, s, rows < MOTION_SAMPLES ? rows : MOTION_SAMPLES, *t_end, error);
  return status == PW_OK ? file_rows (in, rows, *t_end, m, error) : status;
}

int pw_motion_read (pw_motion *m, const pw_system *s, const char *path, double *t_end, int whole, pw_error *error) {
  const char *why;
  file_reader in = { .path = path, .f = pw_open_input (path, &why) };
  if (in.f == NULL) return pw_fail (error, pw_open_input_status (), "--reference %s: cannot be read: %s", path, why);
  int status = file_read (&in, m, s, t_end, whole, error);
  if (status == PW_RETRY) status = file_unreadable (&in, "another program has changed it", error);
  fclose (in.f);
  free (in.line);
  free (in.place);
  free (in.sign);
  pw_names_close (&in.index);
  pw_arena_free (&in.names);
  return status;
}
