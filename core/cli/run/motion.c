/* Motions: their samples, and the errors of one motion relative to another. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "motion.h"

int pw_motion_open (pw_motion *motion, const pw_system *system, const pw_motion *at, int times, double t_end,
                    pw_error *error) {
  int width = 2 * pw_system_coordinates (system) + pw_system_rows (system);
  if (at) times = at->times;
  *motion = (pw_motion){ .t = calloc ((size_t)times * (size_t)(1 + width), sizeof *motion->t) };
  if (motion->t == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  motion->times = times, motion->width = width, motion->value = motion->t + times;
  if (at)
    memcpy (motion->t, at->t, (size_t)times * sizeof *motion->t);
  else
    pw_equal_times (t_end, times, motion->t);
  return PW_OK;
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
  int n = pw_system_coordinates (system) - pw_system_states (system), known = 0;
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
    if (is_state && pw_system_state_hidden (system, j)) continue;
    if (is_state) scale = 1;
    for (int k = 0; is_state && pw_system_state_hidden (system, j - states / 2) && k <= last; k++)
      scale = fmax (scale, fabs (pw_motion_at (reference, k)[j])); /* a first-order state may be larger than 1 */
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

#define MOTION_SAME_TIME 1e-9 /* relative to the final time: smaller differences of times are ignored */

/* A table like those of `pinwheel run -o`, in which columns may be missing. */
typedef struct {
  const char **name, **unit; /* of the time, then of the numbers of a sample */
  unsigned char *missing;    /* for each of these, 1 if there is no such column */
  double *value;             /* `rows` times, then as many numbers for each column that is not missing */
  int rows;
  pw_arena arena; /* of the names */
} motion_table;

/* Lists the time, the states and the reactions, and reads their columns; at least one of a state is needed. */
static int table_read (motion_table *table, const pw_system *system, const char *path, pw_error *error) {
  int states = 2 * pw_system_coordinates (system), count = 1 + states + pw_system_rows (system), known = 0;
  table->name = pw_arena_alloc (&table->arena, 2 * (size_t)count * sizeof *table->name);
  table->missing = pw_arena_alloc (&table->arena, (size_t)count);
  if (table->name == NULL || table->missing == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  table->unit = table->name + count;
  table->name[0] = "t", table->unit[0] = "s";
  for (int i = 1; i < count; i++) {
    const int is_state = i <= states, row = i - 1 - states;
    table->unit[i] = is_state ? pw_system_state_unit (system, i - 1) : pw_system_reaction_unit (system, row);
    table->name[i] = pw_arena_copy (&table->arena, is_state ? PW_NAME (pw_system_state_name, system, i - 1)
                                                            : PW_NAME (pw_system_reaction_name, system, row));
    if (table->name[i] == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  }
  table->value = pw_read_columns (path, table->name, table->unit, count, table->missing, &table->rows, error);
  for (int i = 1; table->value && i <= states; i++) known += !table->missing[i];
  if (table->value == NULL || known > 0) return error->status;
  free (pw_read_columns (path, table->name, table->unit, 2, NULL, &count, error)); /* names the nearest column */
  return pw_fail (error, PW_INPUT, "%s: no column is a state of the model", path);
}

/* The rows to compare: after 0, and up to t_end unless that is 0. */
static int table_has_row (const motion_table *table, int row, double t_end) {
  const double t = table->value[row];
  return t > 0 && !(t_end > 0 && t > t_end * (1 + MOTION_SAME_TIME));
}

/* Selects rows, evenly spaced and including the last one; times within round-off of the end are set to it. */
static int table_select (const motion_table *table, const pw_system *system, pw_motion *motion, double *t_end,
                         const char *path, pw_error *error) {
  const int states = 2 * pw_system_coordinates (system), room = table->rows;
  int rows = 0, row = 0, known = 0;
  double last = 0;
  for (int i = 0; i < room; i++)
    if (table_has_row (table, i, *t_end)) rows++, last = table->value[i];
  if (*t_end == 0) *t_end = last;
  if (rows == 0)
    return pw_fail (error, PW_INPUT, "%s: no row between 0 and the final time, t = %s s", path, PW_DIGITS (*t_end, 9));
  if (pw_motion_open (motion, system, NULL, rows < MOTION_SAMPLES ? rows : MOTION_SAMPLES, *t_end, error) != PW_OK)
    return error->status;
  for (int i = 0; i < room; i++) {
    const int k = motion->taken;
    if (!table_has_row (table, i, *t_end) || ++row < (int)((long long)rows * (k + 1) / motion->times)) continue;
    const double *column = table->value; /* its numbers */
    motion->t[k] = fabs (column[i] - *t_end) <= MOTION_SAME_TIME * *t_end ? *t_end : column[i];
    for (int j = 0; j < motion->width; j++) {
      if (!table->missing[1 + j]) column += room;
      const double value = table->missing[1 + j] ? NAN : column[i];
      pw_motion_at (motion, k)[j] = j < states ? value : -value; /* reactions are -lambda */
      known |= !isnan (value);
    }
    motion->taken++;
  }
  return known ? PW_OK : pw_fail (error, PW_INPUT, "%s: every value is nan", path);
}

int pw_motion_open_reference (pw_motion *motion, const pw_cli_model *compiled, const char *path, double *t_end,
                              pw_error *error) {
  const pw_system *system = compiled->system;
  motion_table table = { .rows = 0 };
  int n = pw_system_coordinates (system), status = PW_OK;
  if (path) {
    status = table_read (&table, system, path, error);
    if (status == PW_OK) status = table_select (&table, system, motion, t_end, path, error);
    free (table.value);
    pw_arena_free (&table.arena);
    return status;
  }
  status = pw_motion_open (motion, system, NULL, MOTION_SAMPLES, *t_end, error);
  for (; motion->taken < motion->times && status == PW_OK; motion->taken++) {
    double *state = pw_motion_at (motion, motion->taken);
    for (int j = 2 * n; j < motion->width; j++) state[j] = NAN; /* multipliers are not known */
    status = pw_system_reference (compiled->model, system, motion->t[motion->taken], state, state + n, error);
  }
  return status;
}
