/* Output of comparisons: the table, CSV files, work-precision diagrams. */
#include <math.h>
#include <string.h>
#include "compare.h"

static const char *const table_column[MOTION_ERRORS] = { "end.length",    "end.angle",      "end.speed",
                                                         "end.rate",      "largest.length", "largest.angle",
                                                         "largest.speed", "largest.rate",   "multiplier" };
static const char *const table_unit[MOTION_ERRORS] = { "m", "rad", "m/s", "rad/s", "m", "rad", "m/s", "rad/s", NULL };

/* ---- To read ---- */

/* "1.2e-11", "<1.2e-11", "-" if unknown. */
static const char *table_number (double value, int below, char text[32]) {
  if (isnan (value)) return "-";
  snprintf (text, 32, "%s%.1e", below ? "<" : "", value);
  return text;
}

void pw_compare_print_reference (const pw_compare *x, FILE *f) {
  const pw_reference *t = &x->reference;
  char a[32], b[32];
  if (!t->known) {
    fprintf (f, "no two methods reach the end, so errors are unknown; --truth FILE.csv provides a reference\n\n");
    return;
  }
  pw_cli_print (f, "errors are measured against %s%s\n", t->about,
                x->study.reference_path ? ", as if it were exact" : "");
  for (int i = 0; i < t->partners; i++)
    fprintf (f, "  %s agrees with it to %s m, %s rad%s\n", t->partner[i].about,
             table_number (t->partner[i].error[MOTION_MOST + MOTION_LENGTH], 0, a),
             table_number (t->partner[i].error[MOTION_MOST + MOTION_ANGLE], 0, b),
             i == 0 ? ": the uncertainty of the reference" : "");
  fputc ('\n', f);
}

void pw_compare_head (const pw_study *x, int group, int w, FILE *f) {
  (void)x;
  (void)group;
  fprintf (f, "%-*s %9s  %-18s  %-18s %5s  %-17s  %-17s  %-35s  %s\n", w, "", "rtol", "error at the end",
           "largest error", "", "residual of", "error of", "", "CPU time");
  fprintf (f, "%-*s %9s  %8s  %8s  %8s  %8s %5s  %8s %8s  %8s %8s  %8s %9s %7s %8s  %8s %6s\n", w, "method", "or step",
           "m", "rad", "m", "rad", "order", "position", "velocity", "multipl.", "energy J", "steps", "evaluat.",
           "Jacob.", "factor.", "median s", "spread");
}

void pw_compare_line (const pw_study *x, const pw_row *r, FILE *f) {
  static const int shown[] = { MOTION_END, MOTION_END + 1, MOTION_MOST, MOTION_MOST + 1 };
  char text[32], spread[32] = "-";
  (void)x;
  fprintf (f, " %9s", pw_format (text, r->level, 4));
  if (r->state != ROW_DONE) return;
  for (int i = 0; i < 4; i++)
    fprintf (f, "  %8s", table_number (r->error[shown[i]], (int)(r->below >> shown[i] & 1), text));
  if (isnan (r->order))
    fprintf (f, " %5s", "-");
  else
    fprintf (f, " %5.1f", r->order);
  fprintf (f, "  %8s", table_number (r->statistics.position, 0, text));
  fprintf (f, " %8s", table_number (r->statistics.velocity, 0, text));
  fprintf (f, "  %8s", table_number (r->error[MOTION_LAMBDA], (int)(r->below >> MOTION_LAMBDA & 1), text));
  fprintf (f, " %8s", table_number (r->balance, 0, text));
  if (!isnan (r->spread)) snprintf (spread, sizeof spread, "%.0f %%", 100 * r->spread / r->cpu);
  fprintf (f, "  %8ld %9ld %7ld %8ld  %8.2e %6s", r->statistics.steps, r->statistics.rhs, r->statistics.jacobians,
           r->statistics.factorisations, r->cpu, spread);
}

/* ---- CSV ---- */

static void table_names (pw_text *t) {
  for (int i = 0; i < MOTION_ERRORS; i++) pw_text_name (t, table_column[i], table_unit[i]);
}

void pw_compare_names (pw_text *t) {
  pw_text_cell (t, "method,ladder,rung,status,t [s]");
  table_names (t);
  pw_text_cell (t, "below,order,residual.position,residual.velocity,balance [J],steps,rejected,rhs,jacobians,"
                   "factorisations,cpu [s],spread [s],repeats");
}

void pw_compare_cells (const pw_study *x, const pw_row *r, pw_text *t) {
  const pw_statistics *s = &r->statistics;
  int run = r->state != ROW_SKIPPED;
  (void)x;
  pw_text_cell (t, r->method);
  pw_text_cell (t, r->adaptive ? "rtol" : "step");
  pw_text_number (t, r->level);
  pw_text_cell (t, pw_study_status (r));
  pw_text_number (t, run ? r->t : NAN);
  for (int i = 0; i < MOTION_ERRORS; i++) pw_text_number (t, r->error[i]);
  pw_text_cell (t, "");
  for (int i = 0, n = 0; i < MOTION_ERRORS; i++) {
    if (!(r->below >> i & 1)) continue;
    if (n++) pw_text_add (t, " ");
    pw_text_add (t, table_column[i]);
  }
  const double rest[] = { r->order,
                          s->position,
                          s->velocity,
                          r->balance,
                          (double)s->steps,
                          (double)s->rejected,
                          (double)s->rhs,
                          (double)s->jacobians,
                          (double)s->factorisations,
                          r->cpu,
                          r->spread };
  for (size_t i = 0; i < sizeof rest / sizeof *rest; i++) pw_text_number (t, run ? rest[i] : NAN);
  pw_text_number (t, r->repeats);
}

int pw_compare_write_reference (const pw_compare *x, pw_error *error) {
  const pw_reference *r = &x->reference;
  pw_output *o = pw_study_open (&x->study, "truth.csv", error);
  if (o == NULL) return error->status;
  FILE *f = pw_output_stream (o);
  pw_text t = { .at = NULL };
  pw_text_cell (&t, "truth,against");
  table_names (&t);
  int status = pw_text_line (&t, f, x->study.folder, error);
  for (int i = -1; status == PW_OK && r->known && i < r->partners; i++) {
    pw_text_quoted (&t, r->about);
    pw_text_quoted (&t, i < 0 ? "uncertainty" : r->partner[i].about);
    for (int k = 0; k < MOTION_ERRORS; k++) pw_text_number (&t, i < 0 ? r->uncertainty[k] : r->partner[i].error[k]);
    status = pw_text_line (&t, f, x->study.folder, error);
  }
  return pw_text_end (o, status, error);
}

/* ---- Diagrams: error against CPU time and against evaluations, a line for each method ---- */

static int plot_point (const pw_study *x, const pw_row *r, int k, double value[STUDY_VALUES]) {
  (void)x;
  if (k > 0) return -1;
  value[0] = r->level;
  value[1] = r->cpu;
  value[2] = (double)r->statistics.rhs;
  value[3] = r->error[MOTION_MOST + MOTION_LENGTH];
  value[4] = r->error[MOTION_MOST + MOTION_ANGLE];
  return r->state == ROW_DONE && r->cpu > 0 && r->statistics.rhs > 0;
}

static const char *plot_label (const pw_study *x, int group, int line, char text[STUDY_NAME]) {
  (void)group;
  (void)text;
  return x->methods.method[line].name;
}

static int plot_write_script (const pw_study_figure *g, const pw_figures *figures, const char *name, int unit,
                              pw_error *error) {
  const pw_reference *reference = &((const pw_compare *)g->study)->reference;
  pw_output *o = pw_figure_begin (figures, name, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  pw_figure_text (f, "title", unit ? "work-precision diagram of angles" : "work-precision diagram");
  pw_figure_text (f, "label_of_error", unit ? "largest error of an angle [rad]" : "largest error of a coordinate [m]");
  pw_figure_number (f, "column_of_error", 4 + unit);
  pw_figure_number (f, "uncertainty", reference->uncertainty[MOTION_MOST + unit]);
  pw_figure_number (f, "size_of_motion", reference->size[unit]);
  pw_study_write_lines (g, 0, f);
  return pw_figure_end (o, "work-precision", error);
}

/* A diagram of lengths and one of angles, if their errors are known. */
int pw_compare_figures (pw_study *x, pw_error *error) {
  static const char *const names[] = { "work-precision", "work-precision-angles" };
  const pw_figures figures = { .folder = x->folder, .model = pw_file_name (x->m.file) };
  const pw_study_figure g = { .study = x,
                              .name = names[0],
                              .heading =
                                  "tolerance or step, CPU time [s], right-hand side evaluations, largest error of "
                                  "lengths [m] and angles [rad]",
                              .columns = STUDY_VALUES,
                              .point = plot_point,
                              .label = plot_label };
  const char *drawn[3] = { NULL };
  int status = pw_study_write_data (&g, &figures, error);
  for (int unit = 0, n = 0; status == PW_OK && unit < 2; unit++) {
    if (!pw_study_positive (&g, 3 + unit)) continue;
    drawn[n++] = names[unit];
    status = plot_write_script (&g, &figures, names[unit], unit, error);
  }
  return status == PW_OK && drawn[0] ? pw_figure_draw (x->folder, drawn, error) : status;
}
