/* Work-precision diagrams: error against processor time and against right-hand sides, a line for each method. */
#include <math.h>
#include <string.h>
#include "compare.h"
#include "plot_script.h"

enum {
  PLOT_PANEL = 470, /* height of a panel [px] */
  PLOT_ROW = 22,    /* of a row of names */
  PLOT_LEFT = 84,
  PLOT_GAP = 44 /* between the panels */
};

#define PLOT_DATA "work-precision.dat"

/* Numbers of a line of the data, from 1. */
enum { PLOT_RUNG = 1, PLOT_CPU, PLOT_RHS, PLOT_ERROR };

/* What is drawn: one figure for lengths, one for angles. */
typedef struct {
  const char *name, *title, *label;
  int unit;
} plot_figure;

/* ---- Lines ---- */

static void plot_style (const pw_compare *x, int method, FILE *f) {
  fputs ("with linespoints lw 1.6 ps 0.9 ", f);
  pw_contestants_style (&x->list, method, 0, f);
}

/* ---- Data ---- */

static int plot_drawn (const pw_rung *r) {
  return r->state == COMPARE_DONE && r->cpu > 0 && r->statistics.rhs > 0;
}

static int plot_count (const pw_compare *x, int method) {
  int count = 0;
  for (int i = 0; i < x->rows; i++) count += x->row[i].method == &x->list.method[method] && plot_drawn (&x->row[i]);
  return count;
}

/* A block for each method that has a point, two empty lines between them. */
static int plot_write_data (const pw_compare *x, const pw_plots *p, pw_error *error) {
  pw_output *o = pw_plot_create (p, PLOT_DATA, error);
  if (o == NULL) return PW_MACHINE;
  FILE *f = pw_output_stream (o);
  fputs ("# rung, processor time [s], right-hand sides, largest error of lengths [m] and angles [rad]\n", f);
  for (int i = 0, block = 0; i < x->list.count; i++) {
    if (plot_count (x, i) == 0) continue;
    fprintf (f, "%s# %s\n", block++ ? "\n\n" : "", x->list.method[i].name);
    for (const pw_rung *r = x->row; r < x->row + x->rows; r++) {
      char number[32];
      if (r->method != &x->list.method[i] || !plot_drawn (r)) continue;
      fprintf (f, "%s ", pw_format (number, r->rung, 9));
      fprintf (f, "%s %ld", pw_format (number, r->cpu, 9), r->statistics.rhs);
      for (int k = 0; k < 2; k++) fprintf (f, " %s", pw_format (number, r->error[MOTION_MOST + k], 9));
      fputc ('\n', f);
    }
  }
  return pw_output_finish (o, error);
}

/* ---- Axes ---- */

/* What the numbers of all points span, of positive ones. */
static void plot_span (const pw_compare *x, int number, int unit, double *least, double *most) {
  *least = INFINITY, *most = 0;
  for (const pw_rung *r = x->row; r < x->row + x->rows; r++) {
    if (!plot_drawn (r)) continue;
    double value = number == PLOT_CPU   ? r->cpu
                   : number == PLOT_RHS ? (double)r->statistics.rhs
                                        : r->error[MOTION_MOST + unit];
    if (!(value > 0) || !isfinite (value)) continue;
    *least = fmin (*least, value);
    *most = fmax (*most, value);
  }
}

/* Errors from the truth's uncertainty to the size of the motion, beyond which a method has simply lost its way. */
static void plot_errors (const pw_compare *x, const pw_script *s, int unit) {
  double least, most, floor = x->truth.uncertainty[MOTION_MOST + unit];
  plot_span (x, PLOT_ERROR, unit, &least, &most);
  most = fmin (3 * most, fmax (10 * least, x->truth.size[unit]));
  pw_script_range (s, "y", least / 4, most);
  if (floor <= least / 4) return;
  char y[32];
  fprintf (s->f,
           "set object 1 rectangle from graph 0,graph 0 to graph 1,first %s behind fc rgb '#e8e8e8' fs noborder\n"
           "set label 1 'the truth cannot tell' at graph 0.02,first %s offset 0,-0.6 textcolor rgb '#555555'\n",
           pw_format (y, floor, 9), y);
}

static void plot_axis (const pw_compare *x, const pw_script *s, int number) {
  double least, most;
  plot_span (x, number, 0, &least, &most);
  pw_script_range (s, "x", least / 1.6, most * 1.6);
  fprintf (s->f, "set xlabel '%s'\n", number == PLOT_CPU ? "processor time [s]" : "right-hand sides");
}

/* ---- The figures ---- */

static void plot_lines (const pw_compare *x, const pw_script *s, int x_number, int unit) {
  for (int i = 0, block = 0; i < x->list.count; i++) {
    if (plot_count (x, i) == 0) continue;
    fprintf (s->f, "%s'%s' index %d using %d:%d ", block ? ", \\\n  " : "plot ", PLOT_DATA, block, x_number,
             PLOT_ERROR + unit);
    plot_style (x, i, s->f);
    fputs (" notitle", s->f);
    block++;
  }
  fputc ('\n', s->f);
}

/* The names have a panel of their own, as wide as both others: a key is laid out for the panel it belongs to. */
static void plot_key (const pw_compare *x, const pw_script *s, pw_panel panel, int columns) {
  char y[32];
  fprintf (s->f, "set key at screen 0.5,screen %s center top horizontal maxcols %d samplen 5\n",
           pw_format (y, 1 - (double)(SCRIPT_TOP - 6) / s->height, 4), columns);
  fputs ("set tics scale 0\nset format ''\nset border 0\nunset grid\n", s->f);
  pw_script_range (s, "x", 1, 10);
  pw_script_range (s, "y", 1, 10);
  pw_script_panel (s, panel);
  for (int i = 0, some = 0; i < x->list.count; i++) {
    if (plot_count (x, i) == 0) continue;
    fputs (some++ ? ", \\\n  NaN " : "plot NaN ", s->f);
    plot_style (x, i, s->f);
    fprintf (s->f, " title '%s'", x->list.method[i].name);
  }
  fputs ("\nset tics scale 0.6\nset format '1e%T'\nset border 31\nset grid back lt 1 lw 0.6 lc rgb '#dddddd'\n", s->f);
}

/* Columns of names, and room for their rows. */
static int plot_names (const pw_compare *x, int *rows) {
  size_t longest = 0;
  int count = 0, columns;
  for (int i = 0; i < x->list.count; i++) {
    if (plot_count (x, i) == 0) continue;
    count++;
    if (strlen (x->list.method[i].name) > longest) longest = strlen (x->list.method[i].name);
  }
  columns = (SCRIPT_WIDER - PLOT_LEFT) / (76 + 8 * (int)longest);
  if (columns < 1) columns = 1;
  *rows = (count + columns - 1) / columns;
  return columns;
}

static int plot_one (const pw_compare *x, const pw_plots *p, const plot_figure *figure, pw_error *error) {
  int rows, columns = plot_names (x, &rows);
  pw_script s = { .name = figure->name, .width = SCRIPT_WIDER, .top = SCRIPT_TOP + 4 + PLOT_ROW * rows };
  double width = (SCRIPT_WIDER - PLOT_LEFT - PLOT_GAP - SCRIPT_RIGHT) / 2.0;
  pw_panel left = { PLOT_LEFT, PLOT_LEFT + width, s.top, s.top + PLOT_PANEL };
  pw_panel right = { left.x1 + PLOT_GAP, left.x1 + PLOT_GAP + width, left.y0, left.y1 };
  s.height = s.top + PLOT_PANEL + SCRIPT_BOTTOM;
  if (pw_script_open (&s, p, error) != PW_OK) return PW_MACHINE;
  fputs ("set logscale xy\nset format '1e%T'\nunset offsets\nunset xzeroaxis\nset grid back\n", s.f);
  pw_script_begin (&s, p, figure->title);
  plot_key (x, &s, (pw_panel){ left.x0, right.x1, SCRIPT_TOP, s.top - 2 }, columns);
  fprintf (s.f, "set ylabel '%s'\n", figure->label);
  plot_errors (x, &s, figure->unit);
  plot_axis (x, &s, PLOT_CPU);
  pw_script_panel (&s, left);
  plot_lines (x, &s, PLOT_CPU, figure->unit);
  fputs ("unset ylabel\nset format y ''\nunset label 1\n", s.f);
  plot_axis (x, &s, PLOT_RHS);
  pw_script_panel (&s, right);
  plot_lines (x, &s, PLOT_RHS, figure->unit);
  fputs ("set format y '1e%T'\nunset xlabel\nunset object 1\n", s.f); /* the next picture begins as this one did */
  return pw_script_end (&s, error);
}

int pw_compare_plot (const pw_compare *x, pw_error *error) {
  static const plot_figure figure[] = {
    { "work-precision", "what accuracy costs", "largest error of a coordinate [m]", MOTION_LENGTH },
    { "work-precision-angles", "what accuracy of angles costs", "largest error of an angle [rad]", MOTION_ANGLE },
  };
  const pw_plots p = { .folder = x->folder, .model = pw_file_name (x->m.file) };
  const char *script[3] = { NULL };
  char name[2][40];
  int scripts = 0;
  int status = plot_write_data (x, &p, error);
  for (int i = 0; status == PW_OK && i < 2; i++) {
    double least, most;
    plot_span (x, PLOT_ERROR, figure[i].unit, &least, &most);
    if (!(most > 0)) continue;
    status = plot_one (x, &p, &figure[i], error);
    snprintf (name[scripts], sizeof name[scripts], "%s.gp", figure[i].name);
    script[scripts] = name[scripts];
    scripts++;
  }
  if (status != PW_OK || scripts == 0) return status;
  return pw_plot_gnuplot (x->folder, script, error);
}
