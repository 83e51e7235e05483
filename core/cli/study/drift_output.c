/* Output of drift: the tables, CSV files, figures. */
#include <math.h>
#include <string.h>
#include "drift.h"

#define TABLE_ROUND_OFF 1e-14 /* scaled residuals below have no meaningful growth */

static const char *const table_quantity[DRIFT_QUANTITIES] = { "position", "velocity", "balance" };

/* ---- Tables ---- */

/* The exponent of time with which the largest value of a quantity grows, from the middle of the run to its end: 0 if it is
 * bounded; NaN if there is none, or only round-off. */
static double table_growth (const pw_row *r, int quantity) {
  int known = quantity == DRIFT_BALANCE || r->most[quantity] > TABLE_ROUND_OFF;
  return r->state == ROW_DONE && known && r->early[quantity] > 0 ? log2 (r->most[quantity] / r->early[quantity]) : NAN;
}

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
static const char *table_power (double power, char text[16]) {
  if (isnan (power)) return "-";
  snprintf (text, 16, "t^%.1f", power < 0.05 ? 0 : power);
  return text;
}

void pw_drift_line (const pw_study *x, const pw_row *r, FILE *f) {
  char text[16];
  (void)x;
  if (r->state != ROW_DONE) return;
  for (int i = 0; i < DRIFT_QUANTITIES; i++)
    fprintf (f, "  %7.1e %8.1e %6s", r->most[i], r->end[i], table_power (table_growth (r, i), text));
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
    pw_text_number (t, table_growth (r, i));
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

static int plot_point (const pw_study *x, const pw_row *r, int k, double value[STUDY_VALUES]) {
  if (k >= (r->part ? DRIFT_PARTS : r->state == ROW_DONE)) return -1;
  value[0] = r->part ? x->t_end * (k + 1) / DRIFT_PARTS : r->along;
  for (int i = 0; i < DRIFT_QUANTITIES; i++) value[i + 1] = r->part ? r->part[k][i] : r->most[i];
  return value[1 + DRIFT_VELOCITY] >= 0;
}

static const char *plot_label (const pw_study *x, int group, int line, char text[STUDY_NAME]) {
  const pw_grid *beta = &((const pw_drift *)x)->beta;
  char number[32];
  if (group == DRIFT_METHODS) return x->methods.method[line].name;
  if (group == DRIFT_PROJECTION) return line ? "metric=identity" : "metric=mass";
  snprintf (text, STUDY_NAME, "beta = %s /s", pw_format (number, pw_grid_value (beta, 0, line), 6));
  return text;
}

/* With panels of the quantities that are not zero throughout, as the residual of position is without pins. */
static int plot_write_script (const pw_study_figure *g, const pw_figures *figures, pw_error *error) {
  pw_output *o = pw_figure_begin (figures, g->name, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  pw_figure_text (f, "title", plot_figure[g->group].title);
  pw_figure_text (f, "label_of_x", plot_figure[g->group].axis);
  pw_figure_number (f, "logarithmic", g->group != DRIFT_METHODS);
  fputs ("quantities = '", f);
  for (int i = 1; i <= DRIFT_QUANTITIES; i++)
    if (pw_study_positive (g, i)) fprintf (f, "%d ", i);
  fputs ("'\n", f);
  pw_study_write_lines (g, g->group == DRIFT_METHODS, f);
  return pw_figure_end (o, "drift", error);
}

int pw_drift_figures (pw_study *x, pw_error *error) {
  const pw_figures figures = { .folder = x->folder, .model = pw_file_name (x->m.file) };
  const char *drawn[DRIFT_GROUPS + 1] = { NULL };
  char heading[160];
  int status = table_write_times (x, error);
  for (int group = 0, n = 0; status == PW_OK && group < DRIFT_GROUPS; group++) {
    pw_study_figure g = { x, group, plot_figure[group].name, heading, 1 + DRIFT_QUANTITIES, plot_point, plot_label };
    snprintf (heading, sizeof heading, "%s, largest scaled residuals of position and velocity, energy balance [J]",
              plot_figure[group].axis);
    if (!pw_study_positive (&g, 1) && !pw_study_positive (&g, 2) && !pw_study_positive (&g, 3)) continue;
    status = pw_study_write_data (&g, &figures, error);
    if (status == PW_OK) status = plot_write_script (&g, &figures, error);
    drawn[n++] = g.name;
  }
  return status == PW_OK && drawn[0] ? pw_figure_draw (x->folder, drawn, error) : status;
}
