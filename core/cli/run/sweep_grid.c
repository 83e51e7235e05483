/* Reads the ranges of a sweep, and numbers the rows of the grid that they span. */
#include <math.h>
#include <string.h>
#include "pinwheel-files.h"
#include "sweep_grid.h"

/* ---- Axes ---- */

/* Reads the finite number or expression in the first `size` bytes of a text, which it restores. */
static int axis_read_number (char *text, size_t size, double *value) {
  const char after = text[size];
  text[size] = 0;
  int status = pw_read_expression (text, value);
  text[size] = after;
  return status == PW_OK && isfinite (*value) ? PW_OK : PW_INPUT;
}

static int axis_fail (const pw_axis *axis, const char *why, pw_error *error) {
  return pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: %s", axis->name, axis->range, why);
}

/* The length of the first value of a list, which ends at a comma outside parentheses. */
static size_t axis_value_length (const char *list) {
  size_t n = 0;
  for (int depth = 0; list[n] && (list[n] != ',' || depth > 0); n++) depth += (list[n] == '(') - (list[n] == ')');
  return n;
}

/* "V1,V2,..." */
static int axis_read_list (pw_axis *axis, pw_arena *arena, pw_error *error) {
  axis->count = 1;
  for (const char *c = axis->range; *(c += axis_value_length (c)); c++) axis->count++;
  axis->value = pw_arena_alloc (arena, (size_t)axis->count * sizeof *axis->value);
  if (axis->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  char *c = axis->range;
  for (long i = 0; i < axis->count; i++) {
    size_t n = axis_value_length (c);
    const char *why = PW_PRINTED (140, "\"%.*s\" is not a finite number", n < 100 ? (int)n : 100, c);
    if (axis_read_number (c, n, axis->value + i) != PW_OK) return axis_fail (axis, why, error);
    c += n + 1;
  }
  return PW_OK;
}

/* "lin:FIRST:LAST:COUNT" or "log:FIRST:LAST:COUNT" */
static int axis_read_range (pw_axis *axis, pw_error *error) {
  double number[3];
  char *c = strchr (axis->range, ':') + 1;
  const char *why = PW_PRINTED (80, "expected %.3s:FIRST:LAST:COUNT, three numbers", axis->range);
  for (int i = 0; i < 3; i++) {
    size_t n = strcspn (c, ":");
    if (axis_read_number (c, n, number + i) != PW_OK || (c[n] == ':') != (i < 2)) return axis_fail (axis, why, error);
    c += n + 1;
  }
  axis->first = number[0], axis->last = number[1];
  if (*pw_domain_check (PW_COUNT, number[2]))
    return axis_fail (axis, "expected a count that is a whole number >= 1", error);
  if (number[2] > PW_GRID_MAX_ROWS) return axis_fail (axis, "too many values: at most 1e8 rows", error);
  axis->count = (long)number[2];
  if (axis->count == 1 && axis->first != axis->last)
    return axis_fail (axis, "a range with two different ends needs at least 2 values", error);
  if (axis->type == PW_AXIS_LOG && !(axis->first > 0 && axis->last > 0))
    return axis_fail (axis, "the ends of a logarithmic range must be > 0", error);
  return PW_OK;
}

int pw_axis_read (pw_axis *axis, const char *text, pw_arena *arena, pw_error *error) {
  *axis = (pw_axis){ .name = pw_arena_copy (arena, text) };
  if (axis->name == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  char *equals = strchr (axis->name, '=');
  if (equals == NULL || equals == axis->name || equals[1] == 0)
    return pw_fail (error, PW_INPUT, "--vary %.200s: expected NAME=lin:FIRST:LAST:COUNT, log:..., or a list v1,v2,...",
                    text);
  *equals = 0, axis->range = equals + 1;
  axis->type = strncmp (axis->range, "lin:", 4) == 0   ? PW_AXIS_LIN
               : strncmp (axis->range, "log:", 4) == 0 ? PW_AXIS_LOG
                                                       : PW_AXIS_LIST;
  if (axis->type != PW_AXIS_LIST) return axis_read_range (axis, error);
  if (strchr (axis->range, ':')) return axis_fail (axis, "a range begins with lin: or log:", error);
  return axis_read_list (axis, arena, error);
}

/* The ends are exact.  Values between them are divided only once, so that they are rounded as little as possible: the
 * fourth value of lin:0:1:11 is 0.3. */
double pw_axis_value (const pw_axis *axis, long i) {
  if (axis->type == PW_AXIS_LIST) return axis->value[i];
  double last = (double)(axis->count - 1), k = (double)i;
  if (i == 0 || axis->first == axis->last) return axis->first;
  if (i == axis->count - 1) return axis->last;
  if (axis->type == PW_AXIS_LOG) return pow (10, (log10 (axis->first) * (last - k) + log10 (axis->last) * k) / last);
  double value = (axis->first * (last - k) + axis->last * k) / last;
  if (isfinite (value)) return value;
  return axis->first / last * (last - k) + axis->last / last * k; /* the products were too large */
}

/* ---- The grid ---- */

double pw_grid_value (const pw_grid *grid, int i, long row) {
  const pw_axis *axis = grid->axis + i;
  return pw_axis_value (axis, row / axis->stride % axis->count);
}

/* Initial values vary fastest, then parameters; the order among initial values and among parameters is the table's. */
long pw_grid_scheduled_row (const pw_grid *grid, long k) {
  long row = 0;
  for (int parameters = 0; parameters < 2; parameters++)
    for (const pw_axis *axis = grid->axis + grid->axes; axis-- > grid->axis;) {
      if ((axis->parameter != NULL) != parameters) continue;
      row += k % axis->count * axis->stride;
      k /= axis->count;
    }
  return row;
}

long pw_grid_parameter_index (const pw_grid *grid, long row) {
  long index = 0;
  for (const pw_axis *axis = grid->axis; axis < grid->axis + grid->axes; axis++)
    if (axis->parameter) index = index * axis->count + row / axis->stride % axis->count;
  return index;
}

static int grid_count_rows (pw_grid *grid, pw_error *error) {
  double rows = 1;
  for (int i = 0; i < grid->axes; i++) rows *= (double)grid->axis[i].count;
  if (rows > PW_GRID_MAX_ROWS)
    return pw_fail (error, PW_INPUT, "the grid has %.15g rows: at most 1e8; use coarser ranges, or several sweeps",
                    rows);
  grid->rows = 1;
  for (int i = grid->axes - 1; i >= 0; i--) {
    grid->axis[i].stride = grid->rows;
    grid->rows *= grid->axis[i].count;
  }
  return PW_OK;
}

int pw_grid_read (pw_grid *grid, const char *const *ranges, pw_arena *arena, pw_error *error) {
  int n = 0, status = PW_OK;
  while (ranges && ranges[n]) n++;
  *grid = (pw_grid){ .axis = pw_arena_alloc (arena, ((size_t)n + 1) * sizeof *grid->axis) };
  if (grid->axis == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  while (grid->axes < n && status == PW_OK) {
    pw_axis *axis = grid->axis + grid->axes++;
    status = pw_axis_read (axis, ranges[axis - grid->axis], arena, error);
    for (const pw_axis *other = grid->axis; other < axis && status == PW_OK; other++)
      if (strcmp (other->name, axis->name) == 0)
        status = pw_fail (error, PW_INPUT, "--vary %.200s is given twice", axis->name);
  }
  return status == PW_OK ? grid_count_rows (grid, error) : status;
}
