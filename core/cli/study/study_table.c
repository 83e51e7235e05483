/* Tables and figures of studies: rows on the terminal and in a CSV file, points of figures in data files. */
#include <math.h>
#include <string.h>
#include "study.h"

const char *pw_study_method (const pw_row *r) {
  return r->method;
}

const char *pw_study_status (const pw_row *r) {
  static const char *const status[] = { "ok", "failed", "refused", "stopped", "not run" };
  return status[r->state];
}

static int table_is_end (const pw_study_column *c) {
  return c->name == NULL && c->head == NULL;
}

/* ---- CSV ---- */

/* Rows are written as they finish, to NAME.part, which remains if the study is stopped. */
int pw_study_open_table (pw_study *x, pw_error *error) {
  pw_text t = { .chars = NULL };
  x->csv = pw_figure_open (x->folder, x->type->tables[0], error);
  if (x->csv == NULL) return error->status;
  for (const pw_study_column *c = x->type->column; !table_is_end (c); c++)
    if (c->name) pw_text_name (&t, c->name, c->unit);
  pw_text_cell (&t, "reason");
  return pw_text_line (&t, pw_output_stream (x->csv), x->folder, error);
}

static int table_write (const pw_study *x, const pw_row *r, pw_error *error) {
  pw_text t = { .chars = NULL };
  for (const pw_study_column *c = x->type->column; !table_is_end (c); c++)
    if (c->text)
      pw_text_cell (&t, c->text (r));
    else if (c->name)
      pw_text_number (&t, r->value[c - x->type->column]);
  pw_text_quoted (&t, r->reason);
  return pw_text_line (&t, pw_output_stream (x->csv), x->folder, error);
}

/* ---- Terminal ---- */

static int table_width (const pw_study *x) {
  size_t width = 6;
  for (const pw_row *r = x->row; r < x->row + x->rows; r++)
    if (strlen (r->method) > width) width = strlen (r->method);
  return (int)width;
}

static void table_heading (const pw_study *x, int group) {
  int width = table_width (x);
  printf ("%s%-*s%s\n%-*s", group ? "\n" : "", width, x->type->group[group], x->type->above, width, "method");
  for (const pw_study_column *c = x->type->column; !table_is_end (c); c++)
    if (c->head) printf ("%*s", c->width, c->head);
  putchar ('\n');
}

static void table_number (const pw_row *r, const pw_study_column *c, int i) {
  char text[32] = "<", *at = text + (r->below >> i & 1);
  if (isnan (r->value[i]))
    strcpy (at, "-");
  else
    snprintf (at, sizeof text - 1, c->format, r->value[i]);
  printf ("%*s", c->width, text);
}

/* Columns after the status are printed only for finished rows. */
static void table_print (const pw_study *x, const pw_row *r) {
  char t[32];
  int shown = 1;
  printf ("%-*s", table_width (x), r->method);
  for (const pw_study_column *c = x->type->column; shown && !table_is_end (c); c++) {
    if (c->head) table_number (r, c, (int)(c - x->type->column));
    if (c->text == pw_study_status) shown = r->state == ROW_DONE;
  }
  if (r->state != ROW_DONE) {
    printf ("  %s", pw_study_status (r));
    if (r->state == ROW_FAILED && strncmp (r->reason, "t = ", 4) != 0) printf (" at t = %s s", pw_format (t, r->t, 4));
    printf (": %s", r->reason);
  }
  putchar ('\n');
  fflush (stdout);
}

int pw_study_write_row (pw_study *x, const pw_row *r, pw_error *error) {
  if (!x->quiet && (r == x->row || r->group != r[-1].group)) table_heading (x, r->group);
  if (!x->quiet) table_print (x, r);
  return x->csv ? table_write (x, r, error) : PW_OK;
}

/* ---- Figures ---- */

/* The next defined point of a group, after point *k of *r; NULL after the last one.  Coordinate 0 may be set in advance, the
 * others are set together. */
static const double *table_next (const pw_study *x, int group, const pw_row **r, int *k) {
  for (; *r < x->row + x->rows; ++*r, *k = -1)
    while ((*r)->group == group && ++*k < (*r)->points)
      if (!isnan ((*r)->point[*k][1])) return (*r)->point[*k];
  return NULL;
}

int pw_study_positive (const pw_study *x, int group, int coordinate) {
  const pw_row *r = x->row;
  const double *point;
  int k = -1;
  while ((point = table_next (x, group, &r, &k)) != NULL)
    if (point[coordinate] > 0 && isfinite (point[coordinate])) return 1;
  return 0;
}

static const char *table_label (const pw_row *r) {
  return *r->label ? r->label : r->method;
}

int pw_study_write_data (const pw_study *x, int group, const char *name, const char *heading, int count,
                         pw_error *error) {
  char file[40], text[32];
  snprintf (file, sizeof file, "%s.dat", name);
  pw_output *o = pw_figure_open (x->folder, file, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  const pw_row *r = x->row;
  const double *point;
  fprintf (f, "# %s\n", heading);
  for (int k = -1, line = -1; (point = table_next (x, group, &r, &k)) != NULL; line = r->line) {
    if (r->line != line) fprintf (f, "%s# %s\n", line < 0 ? "" : "\n\n", table_label (r));
    for (int i = 0; i < count; i++) /* only positive numbers have logarithms */
      fprintf (f, "%s%s", i ? " " : "", point[i] > 0 ? pw_format (text, point[i], 9) : "NaN");
    fputc ('\n', f);
  }
  return pw_output_finish (o, error);
}

/* The labels of the lines that have points, with stabilisations if they are methods; with f NULL returns their number. */
static int table_labels (const pw_study *x, int group, FILE *f) {
  const pw_row *r = x->row;
  const pw_method *integrator;
  int stabilisation, n = 0;
  for (int k = -1, line = -1; table_next (x, group, &r, &k) != NULL; line = r->line) {
    if (r->line == line) continue;
    n++;
    if (f == NULL) continue;
    int known = pw_method_parse (table_label (r), &integrator, &stabilisation, NULL) == PW_OK;
    pw_figure_element (f, "label", n, table_label (r));
    pw_figure_element (f, "stabilisation", n, known ? integrator->stabilisations[stabilisation].name : "");
  }
  return n;
}

int pw_study_write_script (pw_study *x, int group, const char *name, const char *template_name, const char *variables,
                           pw_error *error) {
  pw_output *o = pw_figure_begin (&x->figures, name, error);
  int drawn = 0, lines = table_labels (x, group, NULL);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  fprintf (f, "%smethods = %d\narray label[%d]\narray stabilisation[%d]\n", variables, lines, lines, lines);
  table_labels (x, group, f);
  while (x->drawn[drawn]) drawn++;
  x->drawn[drawn] = name;
  return pw_figure_end (o, template_name, error);
}
