/* Figures of a drift: residuals and energy balance, a panel each, against time, Baumgarte's alpha, the projection's
 * frequency. */
#include <math.h>
#include <string.h>
#include "drift.h"
#include "plot_script.h"

enum {
  PLOT_PANEL = 220, /* height of a panel [px] */
  PLOT_GAP = 16,    /* between two */
  PLOT_KEY_ROW = 22 /* of a row of names */
};

typedef struct {
  pw_drift_group group;
  const char *name, *title, *axis;
  int logarithmic; /* the axis */
} plot_figure;

/* What the points of a figure span, and how many lines there are. */
typedef struct {
  double x0, x1, y0[DRIFT_QUANTITIES], y1[DRIFT_QUANTITIES];
  int lines;
} plot_span;

/* ---- Points ---- */

static int plot_points (const pw_drift_row *r) {
  return r->part ? DRIFT_PARTS : r->status == PW_OK;
}

/* Point k of a row: where it is, and its quantities. */
static const double *plot_point (const pw_drift *x, const pw_drift_row *r, int k, double *along) {
  *along = r->part ? x->t_end * (k + 1) / DRIFT_PARTS : r->along;
  return r->part ? r->part[k] : r->most;
}

/* A line of a figure without a single point is left out. */
static int plot_drawn (const pw_drift *x, pw_drift_group group, int line) {
  for (const pw_drift_row *r = x->row; r < x->row + x->rows; r++)
    for (int k = 0; r->group == group && r->line == line && k < plot_points (r); k++) {
      double along;
      if (plot_point (x, r, k, &along)[DRIFT_VELOCITY] >= 0) return 1;
    }
  return 0;
}

static plot_span plot_measure (const pw_drift *x, const plot_figure *figure) {
  plot_span s = { .x0 = INFINITY, .x1 = -INFINITY };
  for (int i = 0; i < DRIFT_QUANTITIES; i++) s.y0[i] = INFINITY, s.y1[i] = 0;
  for (const pw_drift_row *r = x->row; r < x->row + x->rows; r++) {
    if (r->group != figure->group) continue;
    if (r->line >= s.lines) s.lines = r->line + 1;
    for (int k = 0; k < plot_points (r); k++) {
      double along;
      const double *value = plot_point (x, r, k, &along);
      if (figure->logarithmic && along <= 0) continue;
      s.x0 = fmin (s.x0, along);
      s.x1 = fmax (s.x1, along);
      for (int i = 0; i < DRIFT_QUANTITIES; i++)
        if (value[i] > 0 && isfinite (value[i])) {
          s.y0[i] = fmin (s.y0[i], value[i]);
          s.y1[i] = fmax (s.y1[i], value[i]);
        }
    }
  }
  return s;
}

static int plot_write_data (const pw_drift *x, const plot_figure *figure, int lines, const pw_plots *p,
                            pw_error *error) {
  char file[60], text[32];
  snprintf (file, sizeof file, "%s.dat", figure->name);
  pw_output *o = pw_plot_create (p, file, error);
  if (o == NULL) return PW_MACHINE;
  FILE *f = pw_output_stream (o);
  fprintf (f, "# %s, worst scaled residuals of position and velocity, energy balance [J]\n", figure->axis);
  for (int line = 0, block = 0; line < lines; line++) {
    if (!plot_drawn (x, figure->group, line)) continue;
    fputs (block++ ? "\n\n" : "", f);
    for (const pw_drift_row *r = x->row; r < x->row + x->rows; r++)
      for (int k = 0; r->group == figure->group && r->line == line && k < plot_points (r); k++) {
        double along;
        const double *value = plot_point (x, r, k, &along);
        if (!(value[DRIFT_VELOCITY] >= 0)) continue;
        fputs (pw_format (text, along, 9), f);
        for (int i = 0; i < DRIFT_QUANTITIES; i++) /* what is zero has no logarithm */
          fprintf (f, " %s", value[i] > 0 ? pw_format (text, value[i], 6) : "NaN");
        fputc ('\n', f);
      }
  }
  return pw_output_finish (o, error);
}

/* ---- Lines ---- */

/* Looks of a line, and its name. */
static void plot_line (const pw_drift *x, const plot_figure *figure, int line, int titled, FILE *f) {
  static const char *const colour[] = { "#004488", "#bb5566", "#997700", "#000000" };
  static const int mark[] = { 7, 4, 9, 12, 5, 6, 2, 8 };
  static const char *const dash[] = { "1", "(14,6)", "(14,5,3,5)", "(4,4)" };
  char text[32];
  if (figure->group == DRIFT_METHODS) {
    fputs ("with linespoints lw 1.6 ps 0.8 ", f);
    pw_contestants_style (&x->list, line, 1, f);
    fprintf (f, " pi %d ", 17 + 3 * (line % 5));
  } else
    fprintf (f, "with linespoints lw 1.6 ps 0.9 dt %s lc rgb '%s' pt %d ", dash[line % 4], colour[line % 4],
             mark[line % 8]);
  if (!titled)
    fputs ("notitle", f);
  else if (figure->group == DRIFT_METHODS)
    fprintf (f, "title '%s'", x->list.method[line].name);
  else if (figure->group == DRIFT_BAUMGARTE)
    fprintf (f, "title 'beta = %s /s'", pw_format (text, pw_grid_value (&x->beta, 0, line), 6));
  else
    fprintf (f, "title 'metric=%s'", line ? "identity" : "mass");
}

static int plot_columns (const pw_drift *x, const plot_figure *figure) {
  size_t longest = 15;
  for (int i = 0; figure->group == DRIFT_METHODS && i < x->list.count; i++)
    if (strlen (x->list.method[i].name) > longest) longest = strlen (x->list.method[i].name);
  int columns = (SCRIPT_WIDTH - SCRIPT_LEFT - SCRIPT_RIGHT) / (80 + 8 * (int)longest);
  return columns < 1 ? 1 : columns;
}

static void plot_panel (const pw_drift *x, const plot_figure *figure, const plot_span *span, int quantity, int titled,
                        FILE *f) {
  for (int line = 0, block = 0; line < span->lines; line++) {
    if (!plot_drawn (x, figure->group, line)) continue;
    fprintf (f, "%s'%s.dat' index %d using 1:%d ", block ? ", \\\n  " : "plot ", figure->name, block, quantity + 2);
    plot_line (x, figure, line, titled, f);
    block++;
  }
  fputc ('\n', f);
}

/* ---- Figures ---- */

/* Panels for what is not zero throughout, as the residual of position where nothing is pinned. */
static void plot_panels (const pw_drift *x, const plot_figure *figure, const plot_span *span, const pw_script *s) {
  static const char *const label[] = { "position residual", "velocity residual", "energy balance [J]" };
  int last = -1, n = 0;
  for (int i = 0; i < DRIFT_QUANTITIES; i++)
    if (span->y1[i] > 0) last = i;
  fputs ("set format x ''\nunset xlabel\n", s->f);
  for (int i = 0; i <= last; i++) {
    if (!(span->y1[i] > 0)) continue;
    double y = s->top + n * (PLOT_PANEL + PLOT_GAP);
    if (i == last) fprintf (s->f, "set format x\nset xlabel '%s'\n", figure->axis);
    fprintf (s->f, "set ylabel '%s'\n", label[i]);
    pw_script_range (s, "y", pow (10, floor (log10 (span->y0[i]) - 0.2)), pow (10, ceil (log10 (span->y1[i]) + 0.2)));
    pw_script_panel (s, (pw_panel){ SCRIPT_LEFT + 8, s->width - SCRIPT_RIGHT, y, y + PLOT_PANEL });
    plot_panel (x, figure, span, i, n == 0, s->f);
    n++;
  }
}

static int plot_one (const pw_drift *x, const plot_figure *figure, const plot_span *span, const pw_plots *p,
                     pw_error *error) {
  char y[32];
  int columns = plot_columns (x, figure), panels = 0, names = 0;
  for (int i = 0; i < DRIFT_QUANTITIES; i++) panels += span->y1[i] > 0;
  for (int i = 0; i < span->lines; i++) names += plot_drawn (x, figure->group, i);
  pw_script s = { .name = figure->name,
                  .width = SCRIPT_WIDTH,
                  .top = SCRIPT_TOP + PLOT_KEY_ROW * ((names + columns - 1) / columns) + 4 };
  s.height = s.top + panels * (PLOT_PANEL + PLOT_GAP) - PLOT_GAP + SCRIPT_BOTTOM;
  if (pw_script_open (&s, p, error) != PW_OK) return PW_MACHINE;
  fprintf (s.f, "set logscale %s\nset format y '1e%%T'\nunset offsets\nunset xzeroaxis\n",
           figure->logarithmic ? "xy" : "y");
  double wide = figure->logarithmic ? 1.15 : 1;
  pw_script_range (&s, "x", figure->logarithmic ? span->x0 / wide : 0, span->x1 * wide);
  pw_script_begin (&s, p, figure->title);
  fprintf (s.f, "set key at screen 0.5,screen %s center top horizontal maxcols %d samplen 5\n",
           pw_format (y, 1 - (double)(SCRIPT_TOP - 6) / s.height, 4), columns);
  plot_panels (x, figure, span, &s);
  return pw_script_end (&s, error);
}

int pw_drift_plot (const pw_drift *x, pw_error *error) {
  static const plot_figure figure[] = {
    { DRIFT_METHODS, "drift", "drift of the constraints and the energy", "t [s]", 0 },
    { DRIFT_BAUMGARTE, "drift-baumgarte", "the worst of the run, by Baumgarte''s parameters", "alpha [1/s]", 1 },
    { DRIFT_PROJECTION, "drift-projection", "the worst of the run, by how often it is projected",
      "steps per projection (every)", 1 },
  };
  const pw_plots p = { .folder = x->folder, .model = pw_file_name (x->m.file) };
  const char *script[4] = { NULL };
  char name[3][40];
  int scripts = 0, status = PW_OK;
  for (int i = 0; status == PW_OK && i < 3; i++) {
    plot_span span = plot_measure (x, &figure[i]);
    if (span.y1[DRIFT_POSITION] + span.y1[DRIFT_VELOCITY] + span.y1[DRIFT_BALANCE] <= 0) continue;
    status = plot_write_data (x, &figure[i], span.lines, &p, error);
    if (status == PW_OK) status = plot_one (x, &figure[i], &span, &p, error);
    snprintf (name[scripts], sizeof name[scripts], "%s.gp", figure[i].name);
    script[scripts] = name[scripts];
    scripts++;
  }
  if (status != PW_OK || scripts == 0) return status;
  return pw_plot_gnuplot (x->folder, script, error);
}
