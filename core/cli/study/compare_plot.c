/* Work-precision diagrams: error against CPU time and against evaluations, a line for each method. */
#include <math.h>
#include <string.h>
#include "compare.h"
#include "figure.h"

static int plot_drawn (const pw_compare *x, const pw_rung *r, int method) {
  return r->method == &x->list.method[method] && r->state == COMPARE_DONE && r->cpu > 0 && r->statistics.rhs > 0;
}

static int plot_count (const pw_compare *x, int method) {
  int count = 0;
  for (int i = 0; i < x->rows; i++) count += plot_drawn (x, &x->row[i], method);
  return count;
}

/* A block for each method that has a point, two empty lines between them. */
static int plot_write_data (const pw_compare *x, const pw_figures *figures, pw_error *error) {
  pw_output *o = pw_figure_data (figures, "work-precision.dat", error);
  if (o == NULL) return PW_MACHINE;
  FILE *f = pw_output_stream (o);
  fputs (
      "# tolerance or step, CPU time [s], right-hand side evaluations, largest error of lengths [m] and angles [rad]\n",
      f);
  for (int i = 0, block = 0; i < x->list.count; i++) {
    if (plot_count (x, i) == 0) continue;
    fprintf (f, "%s# %s\n", block++ ? "\n\n" : "", x->list.method[i].name);
    for (const pw_rung *r = x->row; r < x->row + x->rows; r++) {
      char number[32];
      if (!plot_drawn (x, r, i)) continue;
      fprintf (f, "%s ", pw_format (number, r->rung, 9));
      fprintf (f, "%s %ld", pw_format (number, r->cpu, 9), r->statistics.rhs);
      for (int k = 0; k < 2; k++) fprintf (f, " %s", pw_format (number, r->error[MOTION_MOST + k], 9));
      fputc ('\n', f);
    }
  }
  return pw_output_finish (o, error);
}

static int plot_write_script (const pw_compare *x, const pw_figures *figures, const char *name, int unit,
                              pw_error *error) {
  pw_output *o = pw_figure_begin (figures, name, error);
  if (o == NULL) return PW_MACHINE;
  FILE *f = pw_output_stream (o);
  int methods = 0;
  for (int i = 0; i < x->list.count; i++) methods += plot_count (x, i) > 0;
  pw_figure_text (f, "title", unit ? "work-precision diagram of angles" : "work-precision diagram");
  pw_figure_text (f, "label_of_error", unit ? "largest error of an angle [rad]" : "largest error of a coordinate [m]");
  pw_figure_number (f, "column_of_error", 4 + unit);
  pw_figure_number (f, "uncertainty", x->truth.uncertainty[MOTION_MOST + unit]);
  pw_figure_number (f, "size_of_motion", x->truth.size[unit]);
  pw_figure_methods (f, methods, 0);
  for (int i = 0, n = 0; i < x->list.count; i++)
    if (plot_count (x, i) > 0) pw_figure_method (f, ++n, x->list.method[i].name, x->list.method[i].name);
  return pw_figure_end (o, "work-precision", error);
}

/* Diagrams of lengths and of angles, as far as errors of them are known. */
int pw_compare_plot (const pw_compare *x, pw_error *error) {
  static const char *const names[] = { "work-precision", "work-precision-angles" };
  const pw_figures figures = { .folder = x->folder, .model = pw_file_name (x->m.file) };
  const char *drawn[3] = { NULL };
  int status = plot_write_data (x, &figures, error);
  for (int unit = 0, n = 0; status == PW_OK && unit < 2; unit++) {
    int known = 0;
    for (int i = 0; i < x->rows; i++) {
      const pw_rung *r = &x->row[i];
      known |= plot_drawn (x, r, (int)(r->method - x->list.method)) && isfinite (r->error[MOTION_MOST + unit]) &&
               r->error[MOTION_MOST + unit] > 0;
    }
    if (!known) continue;
    drawn[n++] = names[unit];
    status = plot_write_script (x, &figures, names[unit], unit, error);
  }
  return status == PW_OK && drawn[0] ? pw_figure_draw (x->folder, drawn, error) : status;
}
