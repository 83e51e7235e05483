/* The data of `pinwheel fit`: columns of a table and their standard deviations. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fit_parts.h"

/* Standard deviation of a column: a number, or the name of a column. */
typedef struct {
  char *column, *text;
  double number;
} fit_sigma;

/* "a,b" in place: pointers to the names. */
static int data_names (pw_fit *x, pw_error *error) {
  int count = 1;
  for (const char *c = x->columns_text; *c; c++) count += *c == ',';
  x->names = strdup (x->columns_text);
  x->name = calloc ((size_t)count + 1, sizeof *x->name);
  if (x->names == NULL || x->name == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (char *at = x->names; at;) {
    char *comma = strchr (at, ',');
    pw_column c;
    if (comma) *comma = 0;
    if (pw_column_find (x->m.system, at, "--columns", &c, error) != PW_OK) return error->status;
    for (int i = 0; i < x->columns; i++)
      if (strcmp (x->name[i], at) == 0) return pw_fail (error, PW_INPUT, "--columns: %s is given twice", at);
    x->name[x->columns++] = at;
    at = comma ? comma + 1 : NULL;
  }
  return PW_OK;
}

/* "COLUMN=VALUE" or "COLUMN=NAME"; the texts are changed. */
static int data_sigma (const pw_fit *x, char *text, fit_sigma *s, pw_error *error) {
  char *equals = strchr (text, '=');
  if (equals == NULL) return pw_fail (error, PW_INPUT, "--sigma %s: expected COLUMN=VALUE or COLUMN=NAME", text);
  *equals = 0;
  int i = 0;
  while (i < x->columns && strcmp (x->name[i], text) != 0) i++;
  if (i == x->columns) return pw_fail (error, PW_INPUT, "--sigma %s: it is not among --columns", text);
  if (s[i].text) return pw_fail (error, PW_INPUT, "--sigma %s is given twice", text);
  double number = NAN;
  if (pw_read_expression (equals + 1, &number) == PW_OK && !(number > 0))
    return pw_fail (error, PW_INPUT, "--sigma %s=%s: expected a number > 0", text, equals + 1);
  s[i] = (fit_sigma){ .column = text, .text = equals + 1, .number = number };
  return PW_OK;
}

/* Without standard deviations, data of one unit have equal weights. */
static int data_units (const pw_fit *x, pw_error *error) {
  pw_column first, c;
  if (pw_column_find (x->m.system, x->name[0], "--columns", &first, error) != PW_OK) return error->status;
  for (int i = 1; i < x->columns; i++) {
    if (pw_column_find (x->m.system, x->name[i], "--columns", &c, error) != PW_OK) return error->status;
    const char *a = pw_column_unit (x->m.system, first), *b = pw_column_unit (x->m.system, c);
    if (strcmp (a, b) != 0)
      return pw_fail (error, PW_INPUT,
                      "%s [%s] and %s [%s] have different units: add --sigma COLUMN=VALUE for each column", x->name[0],
                      a, x->name[i], b);
  }
  return PW_OK;
}

/* Times, data, standard deviations; into x->table. */
static int data_table (pw_fit *x, const fit_sigma *s, pw_error *error) {
  int width = 1, at = 0;
  const char **column = calloc (2 * (size_t)x->columns + 1, sizeof *column),
             **unit = calloc (2 * (size_t)x->columns + 1, sizeof *unit);
  if (column && unit) {
    column[0] = "t", unit[0] = "s";
    for (int pass = 0; pass < 2; pass++)
      for (int i = 0; i < x->columns; i++) {
        pw_column c;
        if (pass == 1 && !(s[i].text && isnan (s[i].number))) continue;
        pw_column_find (x->m.system, x->name[i], "", &c, NULL);
        column[width] = pass ? s[i].text : x->name[i];
        unit[width++] = pw_column_unit (x->m.system, c);
      }
    x->table = pw_read_columns (x->data_path, column, unit, width, &x->rows, error);
  } else
    pw_fail (error, PW_RESOURCE, "out of memory");
  free (column);
  free (unit);
  if (x->table == NULL) return error->status;
  size_t rows = (size_t)x->rows, cells = (size_t)x->columns * rows;
  x->t = x->table, x->value = x->table + rows;
  x->sigma = malloc ((cells + 1) * sizeof *x->sigma);
  if (x->sigma == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
  for (int i = 0; i < x->columns; i++) {
    const double *given = s[i].text && isnan (s[i].number) ? x->value + cells + (size_t)at++ * rows : NULL;
    for (size_t k = 0; k < rows; k++) x->sigma[(size_t)i * rows + k] = given ? given[k] : s[i].text ? s[i].number : 1;
  }
  return PW_OK;
}

/* A datum without a positive standard deviation is an error. */
static int data_check (pw_fit *x, pw_error *error) {
  if (x->rows == 0) return pw_fail (error, PW_INPUT, "--data %s: no rows", x->data_path);
  if (x->t[0] < 0)
    return pw_fail (error, PW_INPUT, "--data %s: time %g s is before the start of the run", x->data_path, x->t[0]);
  for (int i = 0; i < x->columns * x->rows; i++) {
    if (isnan (x->value[i])) continue;
    x->residuals++;
    if (!(x->sigma[i] > 0))
      return pw_fail (error, PW_INPUT,
                      "--data %s: the standard deviation of %s at t = %g s is %g; expected a number > 0", x->data_path,
                      x->name[i / x->rows], x->t[i % x->rows], x->sigma[i]);
  }
  return PW_OK;
}

int pw_fit_read (pw_fit *x, pw_error *error) {
  if (data_names (x, error) != PW_OK) return error->status;
  fit_sigma *s = calloc ((size_t)x->columns, sizeof *s);
  int status = s ? PW_OK : pw_fail (error, PW_RESOURCE, "out of memory"), given = 0;
  for (const char **text = x->sigma_list; status == PW_OK && text && *text; text++) {
    char *copy = strdup (*text);
    status = copy ? data_sigma (x, copy, s, error) : pw_fail (error, PW_RESOURCE, "out of memory");
    if (status != PW_OK) free (copy);
  }
  for (int i = 0; s && i < x->columns; i++) given += s[i].text != NULL;
  x->weighted = given > 0;
  for (int i = 0; status == PW_OK && given && i < x->columns; i++)
    if (s[i].text == NULL)
      status = pw_fail (error, PW_INPUT, "--sigma is given for other columns, but not for %s", x->name[i]);
  if (status == PW_OK && !given) status = data_units (x, error);
  if (status == PW_OK) status = data_table (x, s, error);
  if (status == PW_OK) status = data_check (x, error);
  for (int i = 0; s && i < x->columns; i++) free (s[i].column);
  free (s);
  return status;
}
