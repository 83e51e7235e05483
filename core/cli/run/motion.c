/* Motions: their samples, and the errors of one motion relative to another. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"

int pw_motion_open (pw_motion *motion, const pw_system *system, int times, double t_end, pw_error *error) {
  int width = 2 * pw_system_coordinates (system) + pw_system_rows (system);
  *motion = (pw_motion){ .t = calloc ((size_t)times * (size_t)(1 + width), sizeof *motion->t) };
  if (motion->t == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  motion->times = times, motion->width = width, motion->value = motion->t + times;
  for (int k = 0; k < times; k++) motion->t[k] = k + 1 < times ? t_end * (k + 1) / times : t_end;
  return PW_OK;
}

int pw_motion_open_at (pw_motion *motion, const pw_system *system, const pw_motion *other, pw_error *error) {
  int status = pw_motion_open (motion, system, other->times, 0, error);
  if (status == PW_OK) memcpy (motion->t, other->t, (size_t)motion->times * sizeof *motion->t);
  return status;
}

void pw_motion_close (pw_motion *motion) {
  free (motion->t);
  *motion = (pw_motion){ .times = 0 };
}

double pw_motion_next_time (const pw_motion *motion) {
  return motion->taken < motion->times ? motion->t[motion->taken] : INFINITY;
}

void pw_motion_add (pw_motion *motion, const pw_system *system, const pw_sample *sample) {
  size_t n = (size_t)pw_system_coordinates (system), rows = (size_t)pw_system_rows (system);
  double *values = pw_motion_at (motion, motion->taken++);
  memcpy (values, sample->q, n * sizeof *values);
  memcpy (values + n, sample->v, n * sizeof *values);
  if (rows) memcpy (values + 2 * n, sample->lambda, rows * sizeof *values);
}

int pw_motion_known (const pw_motion *motion, int j) {
  int known = 0;
  for (int k = 0; k < motion->taken; k++) known += !isnan (pw_motion_at (motion, k)[j]);
  return known;
}

void pw_motion_gaps (const pw_system *system, const pw_motion *reference, int least, char text[MOTION_GAPS]) {
  enum { LISTED = 3 }; /* coordinates, at most */
  char names[MOTION_GAPS - 80] = "", more[30] = "";
  int n = pw_system_coordinates (system), known = 0;
  for (int j = 0; j < n; j++) {
    size_t used = strlen (names);
    if (pw_motion_known (reference, j) >= least && ++known <= LISTED)
      snprintf (names + used, sizeof names - used, "%s%s", known > 1 ? ", " : "only ",
                PW_NAME (pw_system_state_name, system, j));
  }
  if (known > LISTED) snprintf (more, sizeof more, " and %d more", known - LISTED);
  snprintf (text, MOTION_GAPS, "%s%s of %d coordinates", known ? names : "none", more, n);
  if (known == n) *text = 0;
}

int pw_motion_unit (const pw_system *system, int state) {
  int is_velocity = state >= pw_system_coordinates (system);
  int angle = strncmp (pw_system_state_unit (system, state), "rad", 3) == 0;
  return (is_velocity ? MOTION_SPEED : MOTION_LENGTH) + angle;
}

/* The largest |multiplier|, in the first samples, of the constraint equations whose reaction has the same unit as that
 * of this row, since forces and moments cannot be compared with each other; 1 N or N m if all are zero or unknown. */
static double motion_largest_multiplier (const pw_system *system, const pw_motion *reference, int samples, int row) {
  double largest = 0;
  for (int j = 0; j < pw_system_rows (system); j++)
    if (strcmp (pw_system_reaction_unit (system, row), pw_system_reaction_unit (system, j)) == 0)
      for (int k = 0; k < samples; k++)
        largest = fmax (largest, fabs (pw_motion_at (reference, k)[2 * pw_system_coordinates (system) + j]));
  return largest > 0 ? largest : 1;
}

/* Increases *error, NaN at first, to a larger difference; one that is NaN, not known, makes it NaN for good. */
static void motion_include (double *error, int *compared, double difference) {
  if (!*compared || difference > *error || isnan (difference)) *error = difference;
  *compared = 1;
}

void pw_motion_errors (const pw_system *system, const pw_motion *reference, const pw_motion *motion,
                       double error[MOTION_ERRORS]) {
  int states = 2 * pw_system_coordinates (system), last = motion->taken - 1;
  int compared[MOTION_ERRORS] = { 0 }, jumps[MOTION_SAMPLES];
  const char *unit = NULL; /* of the multiplier before: neighbours mostly have the same */
  double scale = 1;
  for (int i = 0; i < MOTION_ERRORS; i++) error[i] = NAN;
  for (int k = 0; k <= last; k++) jumps[k] = pw_system_jumps (system, reference->t[k]);
  for (int j = 0; j < motion->width; j++) {
    int is_state = j < states, state_unit = is_state ? pw_motion_unit (system, j) : 0, end = MOTION_END + state_unit;
    int largest = is_state ? MOTION_LARGEST + state_unit : MOTION_MULTIPLIERS;
    if (!is_state && (unit == NULL || strcmp (unit, pw_system_reaction_unit (system, j - states)) != 0)) {
      unit = pw_system_reaction_unit (system, j - states);
      scale = motion_largest_multiplier (system, reference, motion->taken, j - states);
    }
    for (int k = 0; k <= last; k++) {
      double expected = pw_motion_at (reference, k)[j];
      double difference = fabs (pw_motion_at (motion, k)[j] - expected) / scale;
      /* at a jump multipliers have two values, and methods differ in which one they report */
      if (isnan (expected) || (!is_state && jumps[k])) continue;
      motion_include (&error[largest], &compared[largest], difference);
      if (is_state && k == last) motion_include (&error[end], &compared[end], difference);
    }
  }
}

/* Opens references: the solution of the model, or a file with a table like those of `pinwheel run -o`, in which columns
 * may be missing. */

#define FILE_SAME 1e-9 /* relative to the final time: smaller differences of times are ignored */

enum { FILE_LINE = 16 << 20 }; /* bytes of the longest line */

typedef struct {
  int index;     /* of its values in a sample of a motion; -1: not read */
  double factor; /* from the unit of the column to SI units; negative for reactions, which are -lambda */
} file_column;

typedef struct {
  const char *path;
  FILE *f;
  char *line; /* FILE_LINE bytes and the terminating 0 */
  long line_number;
  double time_unit; /* of the first column [s] */
  file_column *column;
  int columns, states; /* columns after the first; those of them that are states of the model */
  int known;           /* 1: a value is not nan */
  pw_names indices;    /* in a sample, of the names of states and reactions */
  pw_arena arena;      /* of line, column and names */
} file_reader;

/* ---- Lines ---- */

static int file_unreadable (const file_reader *reader, const char *why, pw_error *error) {
  return pw_fail (error, PW_INPUT, "--reference %s: cannot be read: %s", reader->path, why);
}

/* Reads a line, without its end; PW_RETRY at the end of the file. */
static int file_read_line (file_reader *reader, pw_error *error) {
  size_t size = 0;
  int c;
  errno = 0;
  while ((c = getc (reader->f)) != EOF && c != '\n') {
    if (c == 0) return file_unreadable (reader, "a table is text, and this has a byte 0", error);
    if (size == FILE_LINE)
      return pw_fail (error, PW_INPUT, "--reference %s: cannot be read: line %ld has more than %d MB", reader->path,
                      reader->line_number + 1, FILE_LINE >> 20);
    reader->line[size++] = (char)c;
  }
  if (ferror (reader->f)) return file_unreadable (reader, strerror (errno), error);
  while (size > 0 && reader->line[size - 1] == '\r') size--;
  reader->line[size] = 0;
  reader->line_number++;
  return c == EOF && size == 0 ? PW_RETRY : PW_OK;
}

/* The next line that is not empty; PW_RETRY at the end of the file. */
static int file_next_line (file_reader *reader, pw_error *error) {
  int status;
  do status = file_read_line (reader, error);
  while (status == PW_OK && *reader->line == 0);
  return status;
}

/* Splits off the next cell. */
static char *file_cell (char **rest) {
  char *cell = *rest, *comma = strchr (cell, ',');
  *rest = comma ? comma + 1 : cell + strlen (cell);
  if (comma) *comma = 0;
  return cell;
}

static int file_number (const file_reader *reader, const char *cell, double *value, pw_error *error) {
  if (pw_read_number (cell, value) == PW_OK) return PW_OK;
  return pw_fail (error, PW_INPUT, "--reference %s: line %ld: \"%.60s\" is not a number", reader->path,
                  reader->line_number, cell);
}

/* ---- Columns ---- */

/* Lists the names of states and reactions in the order of a sample. */
static int file_list_names (file_reader *reader, const pw_system *system) {
  int states = 2 * pw_system_coordinates (system), rows = pw_system_rows (system);
  if (pw_names_open (&reader->indices, (size_t)(states + rows)) != PW_OK) return PW_RESOURCE;
  for (int i = 0; i < states + rows; i++) {
    const char *name =
        i < states ? PW_NAME (pw_system_state_name, system, i) : PW_NAME (pw_system_reaction_name, system, i - states);
    const char *copy = pw_arena_copy (&reader->arena, name);
    if (copy == NULL) return PW_RESOURCE;
    pw_names_add (&reader->indices, copy, i);
  }
  return PW_OK;
}

/* Finds column i, such as "frame.x [m]", in a sample. */
static int file_find_column (file_reader *reader, int i, const pw_system *system, const char *cell, pw_error *error) {
  char name[300], text[260]; /* the unit, or why it is refused */
  file_column *column = reader->column + i;
  int states = 2 * pw_system_coordinates (system);
  snprintf (name, sizeof name, "%.*s", (int)pw_unit_split (cell, text, sizeof text), cell);
  int index = column->index = pw_names_find (&reader->indices, name), is_state = index < states;
  if (index < 0) return PW_OK;
  for (int k = 0; k < i; k++)
    if (reader->column[k].index == index)
      return pw_fail (error, PW_INPUT, "--reference %s: columns %d and %d are both named \"%.60s\"", reader->path,
                      k + 2, i + 2, name);
  const char *unit = is_state ? pw_system_state_unit (system, index) : pw_system_reaction_unit (system, index - states);
  if (pw_unit_check (cell, unit, &column->factor, text, sizeof text) != PW_OK)
    return pw_fail (error, PW_INPUT, "--reference %s: %s", reader->path, text);
  if (!is_state) column->factor = -column->factor;
  reader->states += is_state;
  return PW_OK;
}

static int file_read_columns (file_reader *reader, const pw_system *system, pw_error *error) {
  char text[260];
  int status = file_next_line (reader, error);
  if (status == PW_RETRY) return pw_fail (error, PW_INPUT, "--reference %s: the file is empty", reader->path);
  if (status != PW_OK) return status;
  for (const char *c = reader->line; *c; c++) reader->columns += *c == ',';
  reader->column = pw_arena_alloc (&reader->arena, ((size_t)reader->columns + 1) * sizeof *reader->column);
  if (reader->column == NULL || file_list_names (reader, system) != PW_OK)
    return pw_fail (error, PW_RESOURCE, "out of memory");
  char *rest = reader->line + (strncmp (reader->line, "\xEF\xBB\xBF", 3) ? 0 : 3); /* without a byte order mark */
  const char *first = file_cell (&rest);
  if (pw_unit_split (first, text, sizeof text) != 1 || *first != 't')
    return pw_fail (error, PW_INPUT, "--reference %s: the first column is \"%.60s\", expected \"t [s]\"", reader->path,
                    first);
  if (pw_unit_check (first, "s", &reader->time_unit, text, sizeof text) != PW_OK)
    return pw_fail (error, PW_INPUT, "--reference %s: %s", reader->path, text);
  for (int i = 0; i < reader->columns; i++)
    if (file_find_column (reader, i, system, file_cell (&rest), error) != PW_OK) return error->status;
  if (reader->states) return PW_OK;
  return pw_fail (error, PW_INPUT, "--reference %s: no column is a state of this model, such as \"%s\"", reader->path,
                  PW_NAME (pw_system_state_name, system, 0));
}

/* ---- Rows ---- */

/* Reads the next line, and its time [s] from the first cell; PW_RETRY at the end of the file. */
static int file_read_time (file_reader *reader, char **rest, double *t, pw_error *error) {
  int status = file_next_line (reader, error);
  if (status != PW_OK) return status;
  *rest = reader->line;
  status = file_number (reader, file_cell (rest), t, error);
  if (status == PW_OK) *t *= reader->time_unit;
  return status;
}

/* Counts the rows after 0 and up to *t_end, which becomes the time of the last row if it is 0. */
static int file_count_rows (file_reader *reader, double *t_end, int *rows, pw_error *error) {
  double t, last = 0, before = -INFINITY;
  char *rest;
  int status;
  for (*rows = 0; (status = file_read_time (reader, &rest, &t, error)) == PW_OK;) {
    if (!(t > before) || isinf (t))
      return pw_fail (error, PW_INPUT, "--reference %s: line %ld: times must be finite and increase", reader->path,
                      reader->line_number);
    before = t;
    if (t <= 0 || (*t_end > 0 && t > *t_end * (1 + FILE_SAME))) continue;
    last = t;
    ++*rows;
  }
  if (status != PW_RETRY) return status;
  if (*t_end == 0) *t_end = last;
  if (*rows > 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "--reference %s: no row between 0 and the final time, t = %s s", reader->path,
                  PW_DIGITS (*t_end, 9));
}

/* Reads the cells after the time into a sample of `width` numbers; NaN, unknown, where there is no column
 * or a cell is nan. */
static int file_read_sample (file_reader *reader, char *rest, double *sample, int width, pw_error *error) {
  for (int i = 0; i < width; i++) sample[i] = NAN;
  for (const file_column *column = reader->column; column < reader->column + reader->columns; column++) {
    const char *cell = file_cell (&rest);
    double value;
    if (column->index < 0) continue;
    if (file_number (reader, cell, &value, error) != PW_OK) return error->status;
    if (isinf (value))
      return pw_fail (error, PW_INPUT, "--reference %s: line %ld: \"%.60s\" is not finite", reader->path,
                      reader->line_number, cell);
    sample[column->index] = column->factor * value;
    reader->known |= !isnan (value);
  }
  if (*rest == 0) return PW_OK;
  return pw_fail (error, PW_INPUT, "--reference %s: line %ld has more cells than the first line", reader->path,
                  reader->line_number);
}

/* Selects as many of the rows as the motion has times, evenly spaced and including the last one; times within round-off
 * of the end are set to it. */
static int file_read_samples (file_reader *reader, int rows, double t_end, pw_motion *motion, pw_error *error) {
  char *rest;
  double t;
  for (int row = 0; motion->taken < motion->times;) {
    int k = motion->taken;
    int status = file_read_time (reader, &rest, &t, error);
    if (status != PW_OK) return status;
    if (t <= 0 || ++row < (int)((long long)rows * (k + 1) / motion->times)) continue;
    motion->t[k] = fabs (t - t_end) <= FILE_SAME * t_end ? t_end : t;
    status = file_read_sample (reader, rest, pw_motion_at (motion, k), motion->width, error);
    if (status != PW_OK) return status;
    motion->taken++;
  }
  return reader->known ? PW_OK : pw_fail (error, PW_INPUT, "--reference %s: every value is nan", reader->path);
}

/* Reads the file twice: rows are selected once their number is known. */
static int file_read (file_reader *reader, pw_motion *motion, const pw_system *system, double *t_end, pw_error *error) {
  int rows, status = file_read_columns (reader, system, error);
  if (status == PW_OK) status = file_count_rows (reader, t_end, &rows, error);
  if (status != PW_OK) return status;
  rewind (reader->f);
  reader->line_number = 0;
  status = file_next_line (reader, error);
  if (status == PW_OK)
    status = pw_motion_open (motion, system, rows < MOTION_SAMPLES ? rows : MOTION_SAMPLES, *t_end, error);
  return status == PW_OK ? file_read_samples (reader, rows, *t_end, motion, error) : status;
}

/* ---- Opening ---- */

/* The model's own reference solution; multipliers are not known. */
static int motion_of_model (pw_motion *motion, const pw_cli_model *compiled, double t_end, pw_error *error) {
  const pw_system *system = compiled->system;
  int n = pw_system_coordinates (system), status = pw_motion_open (motion, system, MOTION_SAMPLES, t_end, error);
  for (; motion->taken < motion->times && status == PW_OK; motion->taken++) {
    double *state = pw_motion_at (motion, motion->taken);
    for (int j = 2 * n; j < motion->width; j++) state[j] = NAN;
    status = pw_system_reference (compiled->model, system, motion->t[motion->taken], state, state + n, error);
  }
  return status;
}

int pw_motion_open_reference (pw_motion *motion, const pw_cli_model *compiled, const char *path, double *t_end,
                              pw_error *error) {
  if (path == NULL) return motion_of_model (motion, compiled, *t_end, error);
  const char *why;
  file_reader reader = { .path = path, .f = pw_open_input (path, &why) };
  int status = PW_OK;
  reader.line = pw_arena_alloc (&reader.arena, FILE_LINE + 1);
  if (reader.f == NULL)
    status = pw_fail (error, pw_open_input_status (), "--reference %s: cannot be read: %s", path, why);
  else if (reader.line == NULL)
    status = pw_fail (error, PW_RESOURCE, "--reference %s: out of memory", path);
  if (status == PW_OK) status = file_read (&reader, motion, compiled->system, t_end, error);
  if (status == PW_RETRY) status = file_unreadable (&reader, "another program has changed it", error);
  if (reader.f) fclose (reader.f);
  pw_names_close (&reader.indices);
  pw_arena_free (&reader.arena);
  return status;
}

/* Compares a run with a reference solution: opens the reference, and computes the errors of the run at its times. */

int pw_comparison_open (pw_comparison *comparison, const pw_cli_model *compiled, const char *path, int started,
                        double t_end, pw_error *error) {
  *comparison = (pw_comparison){ .errors = { .source = path ? path : "the model" } };
  if (path == NULL && !pw_model_has_reference (compiled->model)) return PW_OK;
  if (path == NULL && started) {
    pw_cli_say (
        "pinwheel: the model's reference solution holds for its own initial values: with --start errors are not "
        "computed\n");
    return PW_OK;
  }
  int status = pw_motion_open_reference (&comparison->reference, compiled, path, &t_end, error);
  if (status != PW_OK) return status;
  pw_motion_gaps (compiled->system, &comparison->reference, 1, comparison->gaps);
  return pw_motion_open_at (&comparison->motion, compiled->system, &comparison->reference, error);
}

void pw_comparison_close (pw_comparison *comparison) {
  pw_motion_close (&comparison->reference);
  pw_motion_close (&comparison->motion);
}

void pw_comparison_serialise (pw_comparison *comparison, pw_archive *archive) {
  pw_motion *motion = &comparison->motion;
  int taken = motion->taken;
  if (motion->times == 0) return;
  pw_archive_bytes (archive, &taken, sizeof taken);
  if (taken < 0 || taken > motion->times) archive->failed = 1;
  if (archive->failed) return;
  motion->taken = taken;
  pw_archive_bytes (archive, motion->value, (size_t)taken * (size_t)motion->width * sizeof *motion->value);
}

const pw_reference_error *pw_comparison_errors (pw_comparison *comparison, const pw_system *system) {
  double error[MOTION_ERRORS];
  pw_motion *motion = &comparison->motion;
  pw_reference_error *errors = &comparison->errors;
  if (motion->taken == 0) return NULL;
  pw_motion_errors (system, &comparison->reference, motion, error);
  errors->samples = motion->taken;
  errors->t = motion->t[motion->taken - 1];
  memcpy (errors->end, error + MOTION_END, sizeof errors->end);
  memcpy (errors->most, error + MOTION_LARGEST, sizeof errors->most);
  errors->reactions = error[MOTION_MULTIPLIERS];
  return errors;
}
