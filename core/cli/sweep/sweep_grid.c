/* Lists and ranges of values, and their grid. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "pinwheel-files.h"
#include "sweep_grid.h"
#include "util.h"

/* ---- Ranges ---- */

/* Reads the number in the first `size` bytes. */
static int grid_number (const char *text, size_t size, double *value) {
  char number[64];
  if (size >= sizeof number) return PW_INPUT;
  memcpy (number, text, size);
  number[size] = 0;
  return pw_read_expression (number, value) == PW_OK && isfinite (*value) ? PW_OK : PW_INPUT;
}

static int grid_fail (const pw_axis *a, const char *why, pw_error *error) {
  return pw_fail (error, PW_INPUT, "--vary %.100s=%.100s: %s", a->name, a->range, why);
}

/* "V1,V2,..." */
static int grid_list (pw_axis *a, pw_error *error) {
  char why[140];
  a->count = 1;
  for (const char *c = a->range; *c; c++) a->count += *c == ',';
  a->value = calloc ((size_t)a->count, sizeof *a->value);
  if (a->value == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  const char *c = a->range;
  for (long i = 0; i < a->count; i++) {
    size_t n = strcspn (c, ",");
    snprintf (why, sizeof why, "\"%.*s\" is not a finite number", n < 100 ? (int)n : 100, c);
    if (grid_number (c, n, a->value + i) != PW_OK) return grid_fail (a, why, error);
    c += n + 1;
  }
  return PW_OK;
}

/* Reads "A:B:N"; 0 if it is something else. */
static int grid_three (const char *c, double number[3]) {
  for (int i = 0; i < 3; i++) {
    size_t n = strcspn (c, ":");
    if (grid_number (c, n, number + i) != PW_OK || (c[n] == ':') != (i < 2)) return 0;
    c += n + 1;
  }
  return 1;
}

/* "A:B:N" after "lin:" or "log:" */
static int grid_range (pw_axis *a, pw_error *error) {
  double number[3];
  char why[80];
  snprintf (why, sizeof why, "expected %.3s:FIRST:LAST:COUNT, three numbers", a->range);
  if (!grid_three (a->range + 4, number)) return grid_fail (a, why, error);
  a->first = number[0];
  a->last = number[1];
  if (*pw_domain_check (PW_COUNT, number[2]))
    return grid_fail (a, "expected a count that is a whole number >= 1", error);
  if (number[2] > PW_GRID_ROWS) return grid_fail (a, "too many values: at most 1e8 rows", error);
  a->count = (long)number[2];
  if (a->count == 1 && a->first != a->last)
    return grid_fail (a, "a range with two different ends has at least 2 values", error);
  if (a->type == PW_AXIS_LOG && !(a->first > 0 && a->last > 0))
    return grid_fail (a, "the ends of a logarithmic range must be > 0", error);
  return PW_OK;
}

int pw_axis_read (pw_axis *a, const char *text, pw_error *error) {
  *a = (pw_axis){ .name = strdup (text) };
  if (a->name == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  char *equals = strchr (a->name, '=');
  if (equals == NULL || equals == a->name || equals[1] == 0)
    return pw_fail (error, PW_INPUT, "--vary %.200s: expected NAME=lin:FIRST:LAST:COUNT, log:..., or a list v1,v2,...",
                    text);
  *equals = 0;
  a->range = equals + 1;
  a->type = strncmp (a->range, "lin:", 4) == 0   ? PW_AXIS_LIN
            : strncmp (a->range, "log:", 4) == 0 ? PW_AXIS_LOG
                                                 : PW_AXIS_LIST;
  if (a->type == PW_AXIS_LIST && strchr (a->range, ':'))
    return grid_fail (a, "a range begins with lin: or log:", error);
  return a->type == PW_AXIS_LIST ? grid_list (a, error) : grid_range (a, error);
}

void pw_axis_free (pw_axis *a) {
  free (a->value);
  free (a->name);
  *a = (pw_axis){ .name = NULL };
}

/* The ends are exact, and intermediate values where possible: the fourth value of lin:0:1:11 is 0.3. */
double pw_axis_value (const pw_axis *a, long i) {
  if (a->type == PW_AXIS_LIST) return a->value[i];
  double n = (double)(a->count - 1), k = (double)i;
  if (i == 0 || a->first == a->last) return a->first;
  if (i == a->count - 1) return a->last;
  if (a->type == PW_AXIS_LIN) return (a->first * (n - k) + a->last * k) / n;
  return pow (10, (log10 (a->first) * (n - k) + log10 (a->last) * k) / n);
}

/* ---- The grid ---- */

double pw_grid_value (const pw_grid *g, int axis, long row) {
  const pw_axis *a = g->axis + axis;
  return pw_axis_value (a, row / a->stride % a->count);
}

long pw_grid_ordered (const pw_grid *g, long k) {
  long row = 0;
  for (int parameters = 0; parameters < 2; parameters++)
    for (const pw_axis *a = g->axis + g->axes; a-- > g->axis;) {
      if ((a->parameter != NULL) != parameters) continue;
      row += k % a->count * a->stride;
      k /= a->count;
    }
  return row;
}

long pw_grid_parameters (const pw_grid *g, long row) {
  long number = 0;
  for (const pw_axis *a = g->axis; a < g->axis + g->axes; a++)
    if (a->parameter) number = number * a->count + row / a->stride % a->count;
  return number;
}

static int grid_count (pw_grid *g, pw_error *error) {
  double rows = 1;
  for (int i = 0; i < g->axes; i++) rows *= (double)g->axis[i].count;
  if (rows > PW_GRID_ROWS)
    return pw_fail (error, PW_INPUT, "the grid has %.15g rows: at most 1e8; use coarser ranges, or several sweeps",
                    rows);
  g->rows = 1;
  for (int i = g->axes - 1; i >= 0; i--) {
    g->axis[i].stride = g->rows;
    g->rows *= g->axis[i].count;
  }
  return PW_OK;
}

int pw_grid_read (pw_grid *g, const char *const *ranges, pw_error *error) {
  int n = 0, status = PW_OK;
  while (ranges && ranges[n]) n++;
  *g = (pw_grid){ .axis = calloc ((size_t)n + 1, sizeof *g->axis) };
  if (g->axis == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  while (g->axes < n && status == PW_OK) {
    pw_axis *a = g->axis + g->axes++;
    status = pw_axis_read (a, ranges[a - g->axis], error);
    for (const pw_axis *other = g->axis; other < a && status == PW_OK; other++)
      if (strcmp (other->name, a->name) == 0)
        status = pw_fail (error, PW_INPUT, "--vary %.200s is given twice", a->name);
  }
  return status == PW_OK ? grid_count (g, error) : status;
}

void pw_grid_free (pw_grid *g) {
  for (int i = 0; i < g->axes; i++) pw_axis_free (g->axis + i);
  free (g->axis);
  *g = (pw_grid){ .axis = NULL };
}
