/* Figures of a drift: residuals and energy balance, a panel each, against time, Baumgarte's alpha, the interval between
 * projections. */
#include <math.h>
#include <string.h>
#include "drift.h"
#include "figure.h"

static const struct {
  const char *name, *title, *axis;
} plot_figure[DRIFT_GROUPS] = {
  { "drift", "drift of the constraints and of the energy", "t [s]" },
  { "drift-baumgarte", "largest drift by Baumgarte's parameters", "alpha [1/s]" },
  { "drift-projection", "largest drift by the interval between projections", "steps per projection (every)" },
};

/* ---- Points ---- */

static int plot_points (const pw_drift_row *r) {
  return r->part ? DRIFT_PARTS : r->status == PW_OK;
}

/* Point k of a row: its abscissa, and its quantities; NULL if it has none. */
static const double *plot_point (const pw_drift *x, const pw_drift_row *r, int k, double *along) {
  const double *value = r->part ? r->part[k] : r->most;
  *along = r->part ? x->t_end * (k + 1) / DRIFT_PARTS : r->along;
  return value[DRIFT_VELOCITY] >= 0 ? value : NULL;
}

/* Whether a line of a figure has a point. */
static int plot_drawn (const pw_drift *x, int group, int line) {
  double along;
  for (const pw_drift_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; (int)r->group == group && r->line == line && k < plot_points (r); k++)
      if (plot_point (x, r, k, &along)) return 1;
  return 0;
}

/* Whether a quantity is positive anywhere in a figure; that of positions is zero without pins. */
static int plot_positive (const pw_drift *x, int group, int quantity) {
  double along;
  for (const pw_drift_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; (int)r->group == group && k < plot_points (r); k++) {
      const double *value = plot_point (x, r, k, &along);
      if (value && value[quantity] > 0 && isfinite (value[quantity])) return 1;
    }
  return 0;
}

/* Lines that a figure may have. */
static int plot_lines (const pw_drift *x, int group) {
  return group == DRIFT_METHODS ? x->list.count : group == DRIFT_BAUMGARTE ? (int)x->beta.rows : 2;
}

/* ---- Files ---- */

static void plot_write_line (const pw_drift *x, int group, int line, FILE *f) {
  char text[32];
  for (const pw_drift_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; (int)r->group == group && r->line == line && k < plot_points (r); k++) {
      double along;
      const double *value = plot_point (x, r, k, &along);
      if (value == NULL) continue;
      fputs (pw_format (text, along, 9), f);
      for (int i = 0; i < DRIFT_QUANTITIES; i++) /* zero has no logarithm */
        fprintf (f, " %s", value[i] > 0 ? pw_format (text, value[i], 6) : "NaN");
      fputc ('\n', f);
    }
}

static int plot_write_data (const pw_drift *x, const pw_figures *figures, int group, pw_error *error) {
  char name[60];
  snprintf (name, sizeof name, "%s.dat", plot_figure[group].name);
  pw_output *o = pw_figure_data (figures, name, error);
  if (o == NULL) return PW_MACHINE;
  FILE *f = pw_output_stream (o);
  fprintf (f, "# %s, largest scaled residuals of position and velocity, energy balance [J]\n", plot_figure[group].axis);
  for (int line = 0, block = 0; line < plot_lines (x, group); line++) {
    if (!plot_drawn (x, group, line)) continue;
    fputs (block++ ? "\n\n" : "", f);
    plot_write_line (x, group, line, f);
  }
  return pw_output_finish (o, error);
}

static void plot_label (const pw_drift *x, int group, int line, int n, FILE *f) {
  const char *method = group == DRIFT_METHODS ? x->list.method[line].name : NULL;
  char label[60], beta[32];
  snprintf (label, sizeof label, "metric=%s", line ? "identity" : "mass");
  if (group == DRIFT_BAUMGARTE)
    snprintf (label, sizeof label, "beta = %s /s", pw_format (beta, pw_grid_value (&x->beta, 0, line), 6));
  pw_figure_method (f, n, method ? method : label, method);
}

static int plot_write_script (const pw_drift *x, const pw_figures *figures, int group, pw_error *error) {
  pw_output *o = pw_figure_begin (figures, plot_figure[group].name, error);
  if (o == NULL) return PW_MACHINE;
  FILE *f = pw_output_stream (o);
  int drawn = 0;
  for (int line = 0; line < plot_lines (x, group); line++) drawn += plot_drawn (x, group, line);
  pw_figure_text (f, "title", plot_figure[group].title);
  pw_figure_text (f, "label_of_x", plot_figure[group].axis);
  pw_figure_number (f, "logarithmic", group != DRIFT_METHODS);
  fputs ("quantities = '", f);
  for (int i = 0; i < DRIFT_QUANTITIES; i++)
    if (plot_positive (x, group, i)) fprintf (f, "%d ", i + 1);
  fputs ("'\n", f);
  pw_figure_methods (f, drawn, group == DRIFT_METHODS);
  for (int line = 0, n = 0; line < plot_lines (x, group); line++)
    if (plot_drawn (x, group, line)) plot_label (x, group, line, ++n, f);
  return pw_figure_end (o, "drift", error);
}

int pw_drift_plot (const pw_drift *x, pw_error *error) {
  const pw_figures figures = { .folder = x->folder, .model = pw_file_name (x->m.file) };
  const char *drawn[DRIFT_GROUPS + 1] = { NULL };
  int status = PW_OK;
  for (int group = 0, n = 0; status == PW_OK && group < DRIFT_GROUPS; group++) {
    int panels = 0;
    for (int i = 0; i < DRIFT_QUANTITIES; i++) panels += plot_positive (x, group, i);
    if (panels == 0) continue;
    status = plot_write_data (x, &figures, group, error);
    if (status == PW_OK) status = plot_write_script (x, &figures, group, error);
    drawn[n++] = plot_figure[group].name;
  }
  return status == PW_OK && drawn[0] ? pw_figure_draw (x->folder, drawn, error) : status;
}
