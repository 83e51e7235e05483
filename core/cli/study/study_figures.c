/* Figures of studies: the points of rows, a line for each method or each value of an option. */
#include <math.h>
#include "study.h"

/* Points of a line, of which the numbers in `column` are positive; all of them if it is negative. */
static int figures_count (const pw_study_figure *g, int line, int column) {
  double value[STUDY_VALUES];
  int count = 0, drawn;
  for (const pw_row *r = g->study->row; r < g->study->row + g->study->rows; r++)
    for (int k = 0; r->group == g->group && r->line == line && (drawn = g->point (g->study, r, k, value)) >= 0; k++)
      count += drawn && (column < 0 || (value[column] > 0 && isfinite (value[column])));
  return count;
}

static int figures_lines (const pw_study_figure *g) {
  int lines = 0;
  for (const pw_row *r = g->study->row; r < g->study->row + g->study->rows; r++)
    if (r->group == g->group && r->line >= lines) lines = r->line + 1;
  return lines;
}

int pw_study_positive (const pw_study_figure *g, int column) {
  int count = 0;
  for (int line = 0; line < figures_lines (g); line++) count += figures_count (g, line, column);
  return count > 0;
}

static void figures_write_line (const pw_study_figure *g, int line, FILE *f) {
  double value[STUDY_VALUES];
  char text[32];
  int drawn;
  for (const pw_row *r = g->study->row; r < g->study->row + g->study->rows; r++)
    for (int k = 0; r->group == g->group && r->line == line && (drawn = g->point (g->study, r, k, value)) >= 0; k++) {
      for (int i = 0; drawn && i < g->columns; i++) /* only positive numbers have logarithms */
        fprintf (f, "%s%s", i ? " " : "", value[i] > 0 ? pw_format (text, value[i], 9) : "NaN");
      if (drawn) fputc ('\n', f);
    }
}

int pw_study_write_data (const pw_study_figure *g, const pw_figures *figures, pw_error *error) {
  char name[STUDY_NAME];
  snprintf (name, sizeof name, "%s.dat", g->name);
  pw_output *o = pw_figure_data (figures, name, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  fprintf (f, "# %s\n", g->heading);
  for (int line = 0, block = 0; line < figures_lines (g); line++) {
    if (figures_count (g, line, -1) == 0) continue;
    fprintf (f, "%s# %s\n", block++ ? "\n\n" : "", g->label (g->study, g->group, line, name));
    figures_write_line (g, line, f);
  }
  return pw_output_finish (o, error);
}

void pw_study_write_lines (const pw_study_figure *g, int spread, FILE *f) {
  char name[STUDY_NAME];
  int drawn = 0;
  for (int line = 0; line < figures_lines (g); line++) drawn += figures_count (g, line, -1) > 0;
  pw_figure_methods (f, drawn, spread);
  for (int line = 0, n = 0; line < figures_lines (g); line++)
    if (figures_count (g, line, -1) > 0)
      pw_figure_method (f, ++n, g->label (g->study, g->group, line, name),
                        g->group == 0 ? g->study->methods.method[line].name : NULL);
}
