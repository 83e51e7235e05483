/* Output of drift: the tables, CSV files, figures. */
#include <math.h>
#include <string.h>
#include "drift.h"
#include "figure.h"

static const char *const table_quantity[DRIFT_QUANTITIES] = { "position", "velocity", "balance" };

/* ---- To read ---- */

void pw_drift_print_title (const pw_study *x) {
  char t[32], h[32], rtol[32];
  printf (
      "%s, %s s, steps of %s s or rtol %s: the largest value of all steps and of the last %g %%, and its growth\n\n",
      pw_file_name (x->m.file), pw_format (t, x->t_end, 6), pw_format (h, x->settings.step, 6),
      pw_format (rtol, x->settings.rtol, 6), 100.0 / DRIFT_PARTS);
}

void pw_drift_head (const pw_study *x, int group, int w, FILE *f) {
  static const char *const about[DRIFT_GROUPS] = { "methods", "alpha and beta of Baumgarte",
                                                   "metric and frequency of projection" };
  (void)x;
  fprintf (f, "%s%-*s  %-23s  %-23s  %-23s\n", group ? "\n" : "", w, about[group], "residual of position",
           "residual of velocity", "energy balance [J]");
  fprintf (f, "%-*s", w, "");
  for (int i = 0; i < DRIFT_QUANTITIES; i++) fprintf (f, "  %7s %8s %6s", "largest", "last", "growth");
  fprintf (f, "  %8s %9s %8s\n", "steps", "evaluat.", "factor.");
}

/* "t^2.0" */
static const char *table_growth (double power, char text[16]) {
  if (isnan (power)) return "-";
  snprintf (text, 16, "t^%.1f", power < 0.05 ? 0 : power);
  return text;
}

void pw_drift_line (const pw_study *x, const pw_row *r, FILE *f) {
  char text[16];
  (void)x;
  if (r->state != ROW_DONE) return;
  for (int i = 0; i < DRIFT_QUANTITIES; i++)
    fprintf (f, "  %7.1e %8.1e %6s", r->most[i], r->end[i], table_growth (pw_drift_growth (r, i), text));
  fprintf (f, "  %8ld %9ld %8ld", r->statistics.steps, r->statistics.rhs, r->statistics.factorisations);
}

/* ---- CSV ---- */

void pw_drift_names (pw_text *t) {
  static const char *const what[] = { "largest.", "last.", "growth." };
  pw_text_cell (t, "group,method,alpha [1/s],beta [1/s],every [steps],status,t [s]");
  for (int i = 0; i < DRIFT_QUANTITIES; i++)
    for (int k = 0; k < 3; k++) {
      char name[40];
      snprintf (name, sizeof name, "%s%s", what[k], table_quantity[i]);
      pw_text_name (t, name, i == DRIFT_BALANCE && k < 2 ? "J" : NULL);
    }
  pw_text_cell (t, "steps,rejected,rhs,jacobians,factorisations");
}

void pw_drift_cells (const pw_study *x, const pw_row *r, pw_text *t) {
  static const char *const group[DRIFT_GROUPS] = { "methods", "baumgarte", "projection" };
  const pw_statistics *s = &r->statistics;
  const long count[] = { s->steps, s->rejected, s->rhs, s->jacobians, s->factorisations };
  (void)x;
  pw_text_cell (t, group[r->group]);
  pw_text_cell (t, r->method);
  pw_text_number (t, r->group == DRIFT_BAUMGARTE ? r->along : NAN);
  pw_text_number (t, r->beta);
  pw_text_number (t, r->group == DRIFT_PROJECTION ? r->along : NAN);
  pw_text_cell (t, pw_study_status (r));
  pw_text_number (t, r->t);
  for (int i = 0; i < DRIFT_QUANTITIES; i++) {
    pw_text_number (t, r->t > 0 ? r->most[i] : NAN);
    pw_text_number (t, r->end[i]);
    pw_text_number (t, pw_drift_growth (r, i));
  }
  for (size_t i = 0; i < sizeof count / sizeof *count; i++) pw_text_number (t, (double)count[i]);
}

static int table_times (const pw_study *x, FILE *f, pw_error *error) {
  pw_text t = { .at = NULL };
  pw_text_cell (&t, "method,t [s],position,velocity,balance [J]");
  int status = pw_text_line (&t, f, x->folder, error);
  for (const pw_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; status == PW_OK && r->part && k < DRIFT_PARTS; k++) {
      if (isnan (r->part[k][DRIFT_VELOCITY])) continue;
      pw_text_cell (&t, r->method);
      pw_text_number (&t, x->t_end * (k + 1) / DRIFT_PARTS);
      for (int i = 0; i < DRIFT_QUANTITIES; i++) pw_text_number (&t, r->part[k][i]);
      status = pw_text_line (&t, f, x->folder, error);
    }
  return status;
}

static int table_write_times (const pw_study *x, pw_error *error) {
  pw_output *o = pw_study_open (x, "drift-time.csv", error);
  return o ? pw_text_end (o, table_times (x, pw_output_stream (o), error), error) : error->status;
}

/* ---- Figures: a panel for each quantity, against time, alpha, or the interval between projections ---- */

static const struct {
  const char *name, *title, *axis;
} plot_figure[DRIFT_GROUPS] = {
  { "drift", "drift of the constraints and the energy", "t [s]" },
  { "drift-baumgarte", "largest drift by Baumgarte's parameters", "alpha [1/s]" },
  { "drift-projection", "largest drift by the interval between projections", "steps per projection (every)" },
};

static int plot_points (const pw_row *r) {
  return r->part ? DRIFT_PARTS : r->state == ROW_DONE;
}

/* Point k of a row: its abscissa, and its quantities; NULL if it has none. */
static const double *plot_point (const pw_study *x, const pw_row *r, int k, double *along) {
  const double *value = r->part ? r->part[k] : r->most;
  *along = r->part ? x->t_end * (k + 1) / DRIFT_PARTS : r->along;
  return value[DRIFT_VELOCITY] >= 0 ? value : NULL;
}

/* Whether a line of a figure has a point. */
static int plot_drawn (const pw_study *x, int group, int line) {
  double along;
  for (const pw_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; r->group == group && r->line == line && k < plot_points (r); k++)
      if (plot_point (x, r, k, &along)) return 1;
  return 0;
}

/* Whether a quantity is positive anywhere in a figure; that of positions is zero without pins. */
static int plot_positive (const pw_study *x, int group, int quantity) {
  double along;
  for (const pw_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; r->group == group && k < plot_points (r); k++) {
      const double *value = plot_point (x, r, k, &along);
      if (value && value[quantity] > 0 && isfinite (value[quantity])) return 1;
    }
  return 0;
}

/* Lines that a figure may have. */
static int plot_lines (const pw_study *x, int group) {
  return group == DRIFT_METHODS     ? x->methods.count
         : group == DRIFT_BAUMGARTE ? (int)((const pw_drift *)x)->beta.rows
                                    : 2;
}

static void plot_write_line (const pw_study *x, int group, int line, FILE *f) {
  char text[32];
  for (const pw_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; r->group == group && r->line == line && k < plot_points (r); k++) {
      double along;
      const double *value = plot_point (x, r, k, &along);
      if (value == NULL) continue;
      fputs (pw_format (text, along, 9), f);
      for (int i = 0; i < DRIFT_QUANTITIES; i++) /* zero has no logarithm */
        fprintf (f, " %s", value[i] > 0 ? pw_format (text, value[i], 6) : "NaN");
      fputc ('\n', f);
    }
}

static int plot_write_data (const pw_study *x, const pw_figures *figures, int group, pw_error *error) {
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

static void plot_label (const pw_study *x, int group, int line, int n, FILE *f) {
  const char *method = group == DRIFT_METHODS ? x->methods.method[line].name : NULL;
  char label[60], beta[32];
  snprintf (label, sizeof label, "metric=%s", line ? "identity" : "mass");
  if (group == DRIFT_BAUMGARTE)
    snprintf (label, sizeof label, "beta = %s /s",
              pw_format (beta, pw_grid_value (&((const pw_drift *)x)->beta, 0, line), 6));
  pw_figure_method (f, n, method ? method : label, method);
}

static int plot_write_script (const pw_study *x, const pw_figures *figures, int group, pw_error *error) {
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

int pw_drift_figures (pw_study *x, pw_error *error) {
  const pw_figures figures = { .folder = x->folder, .model = pw_file_name (x->m.file) };
  const char *drawn[DRIFT_GROUPS + 1] = { NULL };
  int status = table_write_times (x, error);
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
