/* Writes the tables and figures of studies: rows on the terminal and in a CSV file, points of figures in data files. */
#include <math.h>
#include <string.h>
#include "study.h"

const char *pw_study_method (const pw_row *row) {
  return row->method;
}

const char *pw_study_status (const pw_row *row) {
  static const char *const status[] = { "ok", "failed", "refused", "stopped", "not run" };
  return status[row->state];
}

/* ---- CSV ---- */

/* Rows are written as they finish, to NAME.part, which remains if the study is stopped. */
int pw_study_open_table (pw_study *study, pw_error *error) {
  const pw_study_column *column = study->type->column;
  pw_text line = { .chars = NULL };
  study->csv = pw_figure_open_file (study->folder, study->type->table_names[0], error);
  if (study->csv == NULL) return error->status;
  for (int i = 0; i < study->type->columns; i++)
    if (column[i].name) pw_text_name (&line, column[i].name, column[i].unit);
  pw_text_cell (&line, "reason");
  return pw_text_line (&line, pw_output_stream (study->csv), study->folder, error);
}

static int table_write_csv (const pw_study *study, const pw_row *row, pw_error *error) {
  const pw_study_column *column = study->type->column;
  pw_text line = { .chars = NULL };
  for (int i = 0; i < study->type->columns; i++)
    if (column[i].text)
      pw_text_cell (&line, column[i].text (row));
    else if (column[i].name)
      pw_text_number (&line, row->value[i]);
  pw_text_quoted (&line, row->reason);
  return pw_text_line (&line, pw_output_stream (study->csv), study->folder, error);
}

/* ---- Terminal ---- */

/* The width of the first column, which contains the methods. */
static int table_width (const pw_study *study) {
  size_t width = strlen ("method");
  for (const pw_row *row = study->row; row < study->row + study->rows; row++)
    if (strlen (row->method) > width) width = strlen (row->method);
  return (int)width;
}

static void table_heading (pw_study *study, int group) {
  const pw_study_column *column = study->type->column;
  int width = table_width (study);
  printf ("%s%-*s%s\n%-*s", study->headed ? "\n" : "", width, study->type->group[group], study->type->heading_above,
          width, "method");
  for (int i = 0; i < study->type->columns; i++)
    if (column[i].head) printf ("%*s", column[i].width, column[i].head);
  putchar ('\n');
  study->headed = group + 1;
}

/* Prints a value, "-" if it is unknown, "<1e-9" if it is an upper bound. */
static void table_number (const pw_row *row, const pw_study_column *column, int value_index) {
  char text[32] = "<", *number = text + (row->upper_bounds >> value_index & 1);
  if (isnan (row->value[value_index]))
    strcpy (number, "-");
  else
    snprintf (number, sizeof text - 1, column->format, row->value[value_index]);
  printf ("%*s", column->width, text);
}

/* Prints a row: columns after the status only if its runs have reached the end, else the reason. */
static void table_print (const pw_study *study, const pw_row *row) {
  const pw_study_column *column = study->type->column;
  int shown = 1;
  printf ("%-*s", table_width (study), row->method);
  for (int i = 0; shown && i < study->type->columns; i++) {
    if (column[i].head) table_number (row, &column[i], i);
    if (column[i].text == pw_study_status) shown = row->state == ROW_DONE;
  }
  if (row->state != ROW_DONE) {
    printf ("  %s", pw_study_status (row));
    if (row->state == ROW_FAILED && strncmp (row->reason, "t = ", 4) != 0)
      printf (" at t = %s s", PW_DIGITS (row->t, 4));
    printf (": %s", row->reason);
  }
  putchar ('\n');
  fflush (stdout);
}

int pw_study_write_row (pw_study *study, const pw_row *row, pw_error *error) {
  if (!study->quiet && study->headed != row->group + 1) table_heading (study, row->group);
  if (!study->quiet) table_print (study, row);
  return study->csv ? table_write_csv (study, row, error) : PW_OK;
}

/* ---- Figures ---- */

/* The coordinates of the next defined point of a group, after point *point of *row; NULL after the last one.  A point
 * is defined if its coordinates 1, 2, ... are, which are set together. */
static const double *table_next_point (const pw_study *study, int group, const pw_row **row, int *point) {
  for (; *row < study->row + study->rows; ++*row, *point = -1)
    while ((*row)->group == group && ++*point < (*row)->points)
      if (!isnan ((*row)->point[*point][1])) return (*row)->point[*point];
  return NULL;
}

int pw_study_positive (const pw_study *study, int group, int coordinate) {
  const pw_row *row = study->row;
  const double *point;
  int k = -1;
  while ((point = table_next_point (study, group, &row, &k)) != NULL)
    if (point[coordinate] > 0 && isfinite (point[coordinate])) return 1;
  return 0;
}

int pw_study_write_data (const pw_study *study, int group, const char *name, const char *heading, int count,
                         pw_error *error) {
  pw_output *output = pw_figure_open_file (study->folder, PW_PRINTED (40, "%s.dat", name), error);
  if (output == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (output);
  const pw_row *row = study->row;
  const double *point;
  fprintf (f, "# %s\n", heading);
  for (int k = -1, curve = -1; (point = table_next_point (study, group, &row, &k)) != NULL; curve = row->curve) {
    if (row->curve != curve) fprintf (f, "%s# %s\n", curve < 0 ? "" : "\n\n", row->label);
    for (int i = 0; i < count; i++) /* only positive numbers have logarithms */
      fprintf (f, "%s%s", i ? " " : "", point[i] > 0 ? PW_DIGITS (point[i], 9) : "NaN");
    fputc ('\n', f);
  }
  return pw_output_finish (output, error);
}

/* Writes the labels of the curves that have points, with stabilisations if they are methods, unless f is NULL; returns
 * the number of these curves. */
static int table_write_labels (const pw_study *study, int group, FILE *f) {
  const pw_row *row = study->row;
  const pw_method *integrator;
  int stabilisation, curves = 0;
  for (int k = -1, curve = -1; table_next_point (study, group, &row, &k) != NULL; curve = row->curve) {
    if (row->curve == curve) continue;
    curves++;
    if (f == NULL) continue;
    int known = pw_method_parse (row->label, &integrator, &stabilisation, NULL) == PW_OK;
    pw_figure_element (f, "label", curves, row->label);
    pw_figure_element (f, "stabilisation", curves, known ? integrator->stabilisations[stabilisation].name : "");
  }
  return curves;
}

int pw_study_write_script (pw_study *study, int group, const char *name, const char *template_name,
                           const char *variables, pw_error *error) {
  pw_output *output = pw_figure_begin (&study->figures, name, error);
  int script = 0, curves = table_write_labels (study, group, NULL);
  if (output == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (output);
  fprintf (f, "%smethods = %d\narray label[%d]\narray stabilisation[%d]\n", variables, curves, curves, curves);
  table_write_labels (study, group, f);
  while (study->scripts[script]) script++;
  study->scripts[script] = name;
  return pw_figure_end (output, template_name, error);
}
