/* The figures of a run: its data files, and the values of the variables of its scripts. */
#include <math.h>
#include "plot.h"

/* The largest number of extrema of the angular velocity of a body; round-off does not count. */
static int figures_turns (const pw_plots *p) {
  int most = 0;
  for (int b = 0; b < p->bodies; b++) {
    double largest = 0;
    for (int i = 0; i < p->samples; i++) largest = fmax (largest, fabs (pw_plot_motion (p, i, b)[5]));
    int turns = 0, before = 0;
    for (int i = 1; i < p->samples; i++) {
      double change = pw_plot_motion (p, i, b)[5] - pw_plot_motion (p, i - 1, b)[5];
      int now = (change > 1e-6 * largest) - (change < -1e-6 * largest);
      turns += now * before < 0;
      if (now) before = now;
    }
    if (turns > most) most = turns;
  }
  return most;
}

/* The data, and a label for each curve unless there are too many, which are coloured by number. */
static void figures_curves (FILE *f, const pw_plots *p, pw_curves c) {
  pw_figure_text (f, "data", c.file);
  pw_figure_number (f, "curves", c.count);
  pw_figure_array (f, "label", c.count);
  for (int i = 0; i < c.count && c.count <= PLOT_NAMED; i++) pw_figure_element (f, "label", i + 1, c.name (p, i));
  pw_figure_text (f, "what", c.what);
  pw_figure_number (f, "numbers", c.all);
  pw_figure_number (f, "last", c.numbers + 2);
}

/* The panels: the whole run, and its beginning if that is drawn in detail. */
static void figures_panels (FILE *f, const pw_plots *p, int closeup, pw_plot_box (*box) (const pw_plots *p, int n)) {
  static const char *const side[] = { "x0", "x1", "y0", "y1" };
  char name[8];
  int panels = closeup > 0 ? 2 : 1;
  pw_figure_number (f, "panels", panels);
  if (closeup > 0) pw_figure_number (f, "t_detail", pw_plot_sample (p, closeup - 1)[PLOT_T]);
  for (int k = 0; k < 4; k++) pw_figure_array (f, side[k], panels);
  for (int i = 0; i < panels; i++) {
    pw_plot_box b = box (p, i ? closeup : p->samples);
    const double value[] = { b.x0, b.x1, b.y0, b.y1 };
    for (int k = 0; k < 4; k++) {
      snprintf (name, sizeof name, "%s[%d]", side[k], i + 1);
      pw_figure_number (f, name, b.x1 >= b.x0 ? value[k] : 0);
    }
  }
}

/* Blocks of the mechanism's data that are not empty, and those of the markers among the wheels. */
static void figures_mechanism (FILE *f, const pw_plots *p) {
  pw_curves c = pw_plot_wheels (p);
  fputs ("blocks = '", f);
  for (int block = PLOT_BODIES; block <= PLOT_CENTRES; block++)
    if (pw_plot_has (p, block)) fprintf (f, "%d ", block);
  fputs ("'\nmarkers = '", f);
  for (int k = 0; k < c.count; k++)
    if (!pw_plot_rolls (p, pw_plot_pick (k, c.count, c.shown))) fprintf (f, "%d ", k);
  fprintf (f, "'\nground = %d\n", p->grounds > 0);
}

static int figures_write (const pw_plots *p, const pw_figures *figures, const char *name, int closeup,
                          pw_error *error) {
  pw_output *o = pw_figure_begin (figures, name, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  pw_figure_number (f, "t_end", pw_plot_sample (p, p->samples - 1)[PLOT_T]);
  switch (*name) {
  case 'p': /* paths */
    pw_figure_text (f, "title", pw_plot_followed (p));
    figures_curves (f, p, p->wheels > 0 ? pw_plot_wheels (p) : pw_plot_bodies (p));
    figures_panels (f, p, closeup, pw_plot_box_of_paths);
    break;
  case 'a':                                           /* angular */
    pw_figure_number (f, "turns", figures_turns (p)); /* fall through */
  case 'v':                                           /* velocities */
    figures_curves (f, p, pw_plot_bodies (p));
    break;
  case 'm': /* mechanism */
    figures_mechanism (f, p);
    figures_panels (f, p, closeup, pw_plot_box_of);
  }
  return pw_figure_end (o, name, error);
}

int pw_plots_finish (pw_plots *p, int draw, pw_error *error) {
  static const char *const names[] = { "paths", "velocities", "angular", "energy", "mechanism", NULL };
  pw_figures figures = { .folder = p->folder, .model = p->model };
  char t[32], end[32];
  if (p->folder == NULL) return PW_OK;
  if (p->samples < 2) {
    pw_cli_say ("pinwheel: the run is too short for figures: none are drawn in %s\n", p->folder);
    return PW_OK;
  }
  if (p->samples < p->wanted)
    snprintf (figures.incomplete, sizeof figures.incomplete, ", incomplete: up to t = %s s of %s s",
              pw_format (t, pw_plot_sample (p, p->samples - 1)[PLOT_T], 4), pw_format (end, p->t_end, 4));
  int closeup = pw_plot_closeup (p), status = pw_plot_write_data (p, &figures, closeup, error);
  for (const char *const *name = names; status == PW_OK && *name; name++)
    status = figures_write (p, &figures, *name, closeup, error);
  return status == PW_OK && draw ? pw_figure_draw (p->folder, names, error) : status;
}
