/* The gnuplot scripts of the figures: each stands alone and draws NAME.svg and NAME.png in its folder. */
#include <math.h>
#include <string.h>
#include "plot.h"

enum {
  SCRIPT_WIDTH = 900, /* of a picture [px] */
  SCRIPT_LEFT = 85,   /* margins [px] */
  SCRIPT_RIGHT = 30,
  SCRIPT_TOP = 46,
  SCRIPT_BOTTOM = 62,
  SCRIPT_BAR = 105, /* room for a colour bar */
  SCRIPT_LINE = 22, /* height of a row of keys */
  SCRIPT_NAME = 24  /* longest name in a key [bytes] */
};

/* Where a picture's panels are [px], from the upper left. */
typedef struct {
  int width, height, left, right, top, bottom;
} script_page;

/* ---- Texts ---- */

/* A name between single quotes, shortened to what a key can hold. */
static void script_name (FILE *f, const char *name) {
  size_t n = strlen (name), keep = n;
  if (n > SCRIPT_NAME) {
    keep = SCRIPT_NAME;
    while (keep > 0 && ((unsigned char)name[keep] & 0xC0) == 0x80) keep--; /* not inside a character */
  }
  fputc ('\'', f);
  for (size_t i = 0; i < keep; i++) {
    if (name[i] == '\'') fputc ('\'', f);
    fputc (name[i], f);
  }
  fputs (keep < n ? "…'" : "'", f);
}

static void script_range (FILE *f, const char *axis, double from, double to) {
  char a[32], b[32];
  fprintf (f, "set %srange [%s:%s]\n", axis, pw_format (a, from, 9), pw_format (b, to, 9));
}

/* Fraction of the picture at which a panel's edge lies, from the left or the bottom. */
static void script_margin (FILE *f, const char *side, double place) {
  char text[32];
  fprintf (f, "set %smargin at screen %s\n", side, pw_format (text, place, 4));
}

/* ---- What all scripts share ---- */

static FILE *script_open (const pw_plots *p, const char *name, pw_error *error) {
  char file[64];
  snprintf (file, sizeof file, "%s.gp", name);
  FILE *f = pw_plot_create (p, file, error);
  if (f == NULL) return NULL;
  fprintf (f, "# Figure of a Pinwheel run; after changes draw it again, in this folder, by:  gnuplot %s\n", file);
  fputs ("reset session\n"
         "set encoding utf8\n"
         "set border lw 0.8 lc rgb '#404040'\n"
         "set tics nomirror out scale 0.6\n"
         "set grid lt 1 lw 0.6 lc rgb '#dddddd'\n"
         "# dark blue, red, yellow, grey: apart for colour-blind readers and in greyscale; dashes help\n"
         "do for [i = 0:2] {\n"
         "  set linetype 4*i+1 lw 1.8 lc rgb '#004488'\n"
         "  set linetype 4*i+2 lw 1.8 lc rgb '#bb5566'\n"
         "  set linetype 4*i+3 lw 1.8 lc rgb '#ddaa33'\n"
         "  set linetype 4*i+4 lw 1.8 lc rgb '#888888'\n"
         "}\n"
         "do for [i = 1:12] { set linetype i dt (i == 1 ? 1 : i % 4 + 1) }\n"
         "# from dark to light, as bright in greyscale as in colour; the lightest end still stands out from the paper\n"
         "set palette defined (0 '#0d0887', 1 '#6a00a8', 2 '#b12a90', 3 '#e16462', 4 '#f6a13c')\n",
         f);
  return f;
}

static void script_begin (FILE *f, const char *name, const script_page *page) {
  fprintf (f,
           "do for [form in 'svg png'] {\n"
           "if (form eq 'svg') {\n"
           "set terminal svg size %d,%d noenhanced font 'DejaVu Sans,Helvetica,sans-serif,14' background rgb 'white'\n"
           "} else {\n"
           "set terminal pngcairo size %d,%d noenhanced font 'Sans,10.5' background rgb 'white'\n"
           "}\n"
           "set output '%s.'.form\n",
           page->width, page->height, page->width, page->height, name);
}

static int script_end (const pw_plots *p, const char *name, FILE *f, pw_error *error) {
  char file[64];
  snprintf (file, sizeof file, "%s.gp", name);
  fputs ("unset output\n}\n", f);
  return pw_plot_finish (p, file, f, error);
}

static void script_title (FILE *f, const pw_plots *p, const char *what) {
  fputs ("set title ", f);
  script_name (f, p->model);
  fprintf (f, ".': %s'\n", what);
}

/* The edges of panel i of n, one above the other. */
static void script_panel (FILE *f, const script_page *page, int i, int n) {
  const int gap = 16;
  double inner = page->height - page->top - page->bottom - (n - 1) * gap, top = page->top + i * (inner / n + gap);
  script_margin (f, "l", (double)page->left / page->width);
  script_margin (f, "r", 1 - (double)page->right / page->width);
  script_margin (f, "t", 1 - top / page->height);
  script_margin (f, "b", 1 - (top + inner / n) / page->height);
}

/* ---- Curves, one per body or wheel ---- */

/* A family of curves: `name` gives the name of each; above a dozen they are coloured by number instead. */
typedef struct {
  const char *file;
  int count;
  const char *(*name) (const pw_plots *p, int i);
  const char *what; /* "body", for the colour bar */
  int first, every; /* column of the first one's first number, and columns per curve */
} script_curves;

/* Makes room for the names above the panels, or for the colour bar at their right. */
static script_page script_room (const pw_plots *p, const script_curves *c, int height) {
  script_page page = { SCRIPT_WIDTH, height, SCRIPT_LEFT, SCRIPT_RIGHT, SCRIPT_TOP, SCRIPT_BOTTOM };
  if (c->count > PLOT_KEYED) {
    page.right = SCRIPT_BAR;
    return page;
  }
  size_t longest = 0;
  for (int i = 0; i < c->count; i++) {
    size_t n = strlen (c->name (p, i));
    if (n > longest) longest = n;
  }
  if (longest > SCRIPT_NAME) longest = SCRIPT_NAME;
  int in_a_row = (SCRIPT_WIDTH - SCRIPT_LEFT - SCRIPT_RIGHT) / (80 + 9 * (int)longest);
  if (in_a_row < 1) in_a_row = 1;
  int rows = (c->count + in_a_row - 1) / in_a_row;
  page.top += SCRIPT_LINE * rows;
  page.height += SCRIPT_LINE * (rows - 1);
  return page;
}

static void script_family (FILE *f, const script_curves *c) {
  if (c->count > PLOT_KEYED)
    fprintf (f,
             "unset key\nset cbrange [1:%d]\nset cblabel 'number of the %s drawn' offset 0.5\n"
             "set colorbox user origin screen 0.9,graph 0 size screen 0.02,graph 1\n",
             c->count, c->what);
  else
    fputs ("set key tmargin center horizontal samplen 4\n", f);
}

/* The plot command: y is the column offset of what is drawn, x of what it is drawn over (-1: time). */
static void script_draw (FILE *f, const pw_plots *p, const script_curves *c, int x, int y, int titled) {
  fputs ("plot ", f);
  if (c->count > PLOT_KEYED) {
    fprintf (f, "for [i = 0:%d] '%s' using ", c->count - 1, c->file);
    if (x < 0)
      fputs ("1", f);
    else
      fprintf (f, "%d+%d*i", c->first + x, c->every);
    fprintf (f, ":%d+%d*i:(i+1) with lines lw 1.2 lc palette\n", c->first + y, c->every);
    return;
  }
  for (int i = 0; i < c->count; i++) {
    int column = c->first + c->every * i;
    fprintf (f, "%s'%s' using %d:%d with lines lt %d ", i ? ", \\\n  " : "", c->file, x < 0 ? 1 : column + x,
             column + y, i + 1);
    fputs (titled ? "title " : "notitle", f);
    if (titled) script_name (f, c->name (p, i));
  }
  fputs ("\n", f);
}

static script_curves script_bodies (const pw_plots *p) {
  return (script_curves){ "motion.dat", p->bodies, pw_plot_body_name, "body", 2, 6 };
}

/* ---- The figures ---- */

static void script_time (FILE *f, const pw_plots *p) {
  script_range (f, "x", 0, pw_plot_sample (p, p->samples - 1)[PLOT_T]);
}

static int script_velocities (const pw_plots *p, pw_error *error) {
  script_curves c = script_bodies (p);
  script_page page = script_room (p, &c, 620);
  FILE *f = script_open (p, "velocities", error);
  if (f == NULL) return PW_MACHINE;
  script_time (f, p);
  script_begin (f, "velocities", &page);
  fputs ("set multiplot\n", f);
  script_family (f, &c);
  script_title (f, p, "velocities of the centres of mass");
  fputs ("set format x ''\nset ylabel 'vx [m/s]'\n", f);
  script_panel (f, &page, 0, 2);
  script_draw (f, p, &c, -1, 3, 1);
  fputs ("unset title\nunset colorbox\nset format x\nset xlabel 't [s]'\nset ylabel 'vy [m/s]'\n", f);
  script_panel (f, &page, 1, 2);
  script_draw (f, p, &c, -1, 4, 0);
  fputs ("unset xlabel\nunset multiplot\n", f);
  return script_end (p, "velocities", f, error);
}

static int script_angular (const pw_plots *p, pw_error *error) {
  script_curves c = script_bodies (p);
  script_page page = script_room (p, &c, 460);
  FILE *f = script_open (p, "angular", error);
  if (f == NULL) return PW_MACHINE;
  script_time (f, p);
  script_begin (f, "angular", &page);
  script_family (f, &c);
  script_title (f, p, "angular velocities");
  fputs ("set xlabel 't [s]'\nset ylabel 'omega [rad/s]'\n", f);
  script_panel (f, &page, 0, 1);
  script_draw (f, p, &c, -1, 5, 1);
  return script_end (p, "angular", f, error);
}

/* Largest absolute value of a number kept. */
static double script_largest (const pw_plots *p, int number) {
  double largest = 0;
  for (int i = 0; i < p->samples; i++) {
    double value = fabs (pw_plot_sample (p, i)[number]);
    if (isfinite (value)) largest = fmax (largest, value);
  }
  return largest;
}

/* "10⁻¹⁵ J" */
static void script_power_of_ten (FILE *f, int exponent) {
  static const char *const digits[] = { "⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹" };
  char text[16];
  snprintf (text, sizeof text, "%d", exponent);
  fputs ("10", f);
  for (const char *c = text; *c; c++) fputs (*c == '-' ? "⁻" : digits[*c - '0'], f);
  fputs (" J", f);
}

/* How far the account is from closing, in a unit of its own. */
static void script_balance (FILE *f, const pw_plots *p) {
  double largest = script_largest (p, PLOT_BALANCE);
  int exponent = largest > 0 ? (int)floor (log10 (largest)) : 0;
  if (exponent >= -2 && exponent <= 2) exponent = 0;
  fputs ("set ylabel 'balance [", f);
  if (exponent == 0)
    fputs ("J", f);
  else
    script_power_of_ten (f, exponent);
  fputs ("]'\n", f);
  if (largest == 0) fputs ("set yrange [-1:1]\n", f);
  fprintf (f, "plot 'energy.dat' using 1:($%d/1e%d) with lines lt 1 lw 1.2 notitle\n", PLOT_BALANCE + 1, exponent);
}

static int script_energy (const pw_plots *p, pw_error *error) {
  script_page page = { SCRIPT_WIDTH, 620, SCRIPT_LEFT, SCRIPT_RIGHT, SCRIPT_TOP + SCRIPT_LINE, SCRIPT_BOTTOM };
  FILE *f = script_open (p, "energy", error);
  if (f == NULL) return PW_MACHINE;
  script_time (f, p);
  script_begin (f, "energy", &page);
  fputs ("set multiplot\nset key tmargin center horizontal samplen 4\n", f);
  script_title (f, p, "energy and work");
  fputs ("set format x ''\nset ylabel 'energy, work [J]'\nset yrange [*:*]\n", f);
  script_panel (f, &page, 0, 2);
  fputs ("plot 'energy.dat' using 1:2 with lines lt 3 lw 5 title 'kinetic'", f);
  if (script_largest (p, PLOT_POTENTIAL) > 0) fputs (", \\\n  '' using 1:3 with lines lt 4 dt 1 title 'potential'", f);
  fputs (", \\\n  '' using 1:4 with lines lt 1 title 'work'", f);
  if (script_largest (p, PLOT_LOSS) > 0) fputs (", \\\n  '' using 1:5 with lines lt 2 title 'dissipated'", f);
  fputs ("\nunset title\nset format x\nset xlabel 't [s]'\n", f);
  script_panel (f, &page, 1, 2);
  script_balance (f, p);
  fputs ("unset xlabel\nunset multiplot\n", f);
  return script_end (p, "energy", f, error);
}

/* ---- Figures with equal axes ---- */

/* Ranges that fill the panel, and a panel that suits the ranges. */
static void script_equal (FILE *f, pw_plot_box box, script_page *page) {
  if (!(box.x1 >= box.x0)) box = (pw_plot_box){ 0, 0, 0, 0 };
  double w = box.x1 - box.x0, h = box.y1 - box.y0, x = (box.x0 + box.x1) / 2, y = (box.y0 + box.y1) / 2;
  double edge = 0.05 * fmax (w, h);
  if (edge == 0) edge = 1;
  w += 2 * edge, h += 2 * edge;
  h = fmax (h, 0.3 * w), w = fmax (w, 0.5 * h);
  double inner = page->width - page->left - page->right, high = inner * h / w;
  if (high > 720) { /* a tall picture is made narrower instead */
    high = 720;
    page->width = page->left + page->right + (int)(high * w / h);
  }
  page->height = page->top + page->bottom + (int)high;
  script_range (f, "x", x - w / 2, x + w / 2);
  script_range (f, "y", y - h / 2, y + h / 2);
  fputs ("set xlabel 'x [m]'\nset ylabel 'y [m]'\nset size ratio -1\n", f);
}

static int script_paths (const pw_plots *p, pw_error *error) {
  script_curves c = { "wheels.dat", p->wheels, pw_plot_wheel_name, "wheel", 2, 3 };
  if (p->wheels == 0) c = script_bodies (p);
  script_page page = script_room (p, &c, 0);
  FILE *f = script_open (p, "paths", error);
  if (f == NULL) return PW_MACHINE;
  script_equal (f, pw_plot_box_of_paths (p), &page);
  script_begin (f, "paths", &page);
  script_family (f, &c);
  script_title (f, p, p->wheels > 0 ? "paths of the wheels' contacts" : "paths of the centres of mass");
  script_panel (f, &page, 0, 1);
  script_draw (f, p, &c, 0, 1, 1);
  return script_end (p, "paths", f, error);
}

static int script_mechanism (const pw_plots *p, const char *name, const char *title, int n, pw_error *error) {
  script_page page = { SCRIPT_WIDTH, 0, SCRIPT_LEFT, SCRIPT_BAR, SCRIPT_TOP, SCRIPT_BOTTOM };
  FILE *f = script_open (p, name, error);
  if (f == NULL) return PW_MACHINE;
  script_equal (f, pw_plot_box_of (p, n), &page);
  script_range (f, "cb", 0, pw_plot_sample (p, n - 1)[PLOT_T]);
  script_begin (f, name, &page);
  fputs ("unset key\nset cblabel 't [s]'\nset colorbox\n", f);
  script_title (f, p, title);
  script_panel (f, &page, 0, 1);
  fprintf (f, "plot '%s.dat' index %d using 1:2:3 with points pt 7 ps 0.35 lc palette", name, PLOT_CENTRES);
  if (pw_plot_has (p, PLOT_BODIES))
    fprintf (f, ", \\\n  '' index %d using 1:2:3 with lines lw 1.2 lc palette", PLOT_BODIES);
  if (pw_plot_has (p, PLOT_WHEELS))
    fprintf (f, ", \\\n  '' index %d using 1:2:3 with lines lw 3 lc palette", PLOT_WHEELS);
  if (p->grounds > 0) fputs (", \\\n  'ground.dat' using 1:2 with points pt 9 ps 1.2 lc rgb 'black'", f);
  fputs ("\n", f);
  return script_end (p, name, f, error);
}

int pw_plot_write_scripts (const pw_plots *p, pw_error *error) {
  int status = script_paths (p, error);
  if (status == PW_OK) status = script_velocities (p, error);
  if (status == PW_OK) status = script_angular (p, error);
  if (status == PW_OK) status = script_energy (p, error);
  if (status == PW_OK) status = script_mechanism (p, "mechanism", "the mechanism along its way", p->samples, error);
  if (status == PW_OK && p->closeup > 0)
    status = script_mechanism (p, "mechanism-start", "the mechanism at the start", p->closeup, error);
  return status;
}
