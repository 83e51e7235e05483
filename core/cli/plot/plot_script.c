/* Parts of gnuplot scripts.  Each script stands alone and draws NAME.svg and NAME.png in its folder. */
#include <string.h>
#include "plot_script.h"

enum {
  SCRIPT_LINE = 22, /* height of a row of names [px] */
  SCRIPT_NAME = 24  /* longest name in a key [bytes] */
};

/* ---- Texts ---- */

/* A name inside single quotes, shortened to what a key can hold. */
static void script_text (FILE *f, const char *name) {
  size_t n = strlen (name), keep = n;
  if (n > SCRIPT_NAME) {
    keep = SCRIPT_NAME;
    while (keep > 0 && ((unsigned char)name[keep] & 0xC0) == 0x80) keep--; /* not inside a character */
  }
  for (size_t i = 0; i < keep; i++) {
    if (name[i] == '\'') fputc ('\'', f);
    fputc (name[i], f);
  }
  if (keep < n) fputs ("…", f);
}

void pw_script_range (const pw_script *s, const char *axis, double from, double to) {
  char a[32], b[32];
  fprintf (s->f, "set %srange [%s:%s]\n", axis, pw_format (a, from, 9), pw_format (b, to, 9));
}

/* Fraction of the picture at which a panel's edge lies, from the left or the bottom. */
static void script_margin (const pw_script *s, const char *side, double place) {
  char text[32];
  fprintf (s->f, "set %smargin at screen %s\n", side, pw_format (text, place, 4));
}

void pw_script_panel (const pw_script *s, pw_panel panel) {
  script_margin (s, "l", panel.x0 / s->width);
  script_margin (s, "r", panel.x1 / s->width);
  script_margin (s, "t", 1 - panel.y0 / s->height);
  script_margin (s, "b", 1 - panel.y1 / s->height);
}

/* ---- Beginning and end ---- */

static const char script_look[] =
    "set encoding utf8\n"
    "set border lw 0.8 lc rgb '#404040'\n"
    "set tics nomirror out scale 0.6\n"
    "set grid lt 1 lw 0.6 lc rgb '#dddddd'\n"
    "set ylabel offset 0.7,0\n"
    "set offsets 0,0,graph 0.04,graph 0.04\n"
    "set xzeroaxis lt 1 lw 0.8 lc rgb '#999999'\n"
    "# dark blue, red, yellow, grey: apart for colour-blind readers and in greyscale; dashes help\n"
    "do for [i = 0:11] {\n"
    "  eval sprintf('set linetype %d lw 1.8 dt %s lc rgb \"%s\"', i + 1, \\\n"
    "               word('1 (14,4) (5,3) (16,4,4,4)', (i + i/4) % 4 + 1), \\\n"
    "               word('#004488 #bb5566 #cc9911 #888888', i % 4 + 1))\n"
    "}\n"
    "# from dark to light, in greyscale as in colour; the lightest end still stands out from the paper\n"
    "set palette defined (0 '#0d0887', 1 '#6a00a8', 2 '#b12a90', 3 '#e16462', 4 '#f6a13c')\n";

int pw_script_open (pw_script *s, const pw_plots *p, pw_error *error) {
  char file[64];
  snprintf (file, sizeof file, "%s.gp", s->name);
  s->output = pw_plot_create (p, file, error);
  if (s->output == NULL) return PW_MACHINE;
  s->f = pw_output_stream (s->output);
  fprintf (s->f, "# A figure of a Pinwheel run.  After changes draw it again, in this folder, by:  gnuplot %s\n", file);
  fprintf (s->f, "reset session\n%s", script_look);
  return PW_OK;
}

void pw_script_begin (const pw_script *s, const pw_plots *p, const char *title) {
  fprintf (s->f,
           "do for [form in 'svg png'] {\n"
           "if (form eq 'svg') {\n"
           "set terminal svg size %d,%d noenhanced font 'DejaVu Sans,Helvetica,sans-serif,13' background rgb 'white'\n"
           "} else {\n"
           "set terminal pngcairo size %d,%d noenhanced font 'Sans,10.5' background rgb 'white'\n"
           "}\n"
           "set output '%s.'.form\n",
           s->width, s->height, s->width, s->height, s->name);
  fputs ("set multiplot title '", s->f);
  script_text (s->f, p->model);
  char early[80] = "";
  int incomplete = pw_plot_incomplete (p, early, sizeof early);
  fprintf (s->f, ": %s%s%s' font (form eq 'svg' ? ',16' : ',13')\n", title, incomplete ? ", " : "", early);
}

int pw_script_end (const pw_script *s, pw_error *error) {
  fputs ("unset multiplot\nunset output\n}\n", s->f);
  return pw_output_finish (s->output, error);
}

/* ---- Families of curves ---- */

/* Names that fit side by side. */
static int script_columns (const pw_plots *p, const pw_curves *c) {
  size_t longest = 0;
  for (int i = 0; i < c->count; i++) {
    size_t n = strlen (c->name (p, i));
    if (n > longest) longest = n;
  }
  if (longest > SCRIPT_NAME) longest = SCRIPT_NAME;
  int columns = (SCRIPT_WIDTH - SCRIPT_LEFT - SCRIPT_RIGHT) / (80 + 9 * (int)longest);
  return columns < 1 ? 1 : columns;
}

int pw_script_names (const pw_plots *p, const pw_curves *c) {
  if (pw_script_numbered (c)) return 0;
  int columns = script_columns (p, c);
  return SCRIPT_LINE * ((c->count + columns - 1) / columns);
}

void pw_script_key (const pw_script *s, const pw_plots *p, const pw_curves *c) {
  char y[32];
  if (pw_script_numbered (c))
    fprintf (s->f,
             "unset key\nset cbrange [1:%d]\nset cblabel 'number of the %s'\n"
             "set colorbox user origin screen 0.9,graph 0 size screen 0.02,graph 1\n",
             c->all, c->what);
  else
    fprintf (s->f, "set key at screen 0.5,screen %s center top horizontal maxcols %d samplen 3.5\n",
             pw_format (y, 1 - (double)(SCRIPT_TOP - 8) / s->height, 4), script_columns (p, c));
}

void pw_script_bar (const pw_script *s, pw_panel panel, const char *label) {
  char y[32], h[32];
  fprintf (s->f, "set colorbox horizontal user origin graph 0,screen %s size graph 1,screen %s\nset cblabel '%s'\n",
           pw_format (y, 1 - (panel.y1 + SCRIPT_BOTTOM + 14) / s->height, 4), pw_format (h, 12.0 / s->height, 4),
           label);
}

void pw_script_draw (const pw_script *s, const pw_plots *p, const pw_curves *c, int x, int y, int titled) {
  FILE *f = s->f;
  if (pw_script_numbered (c)) {
    fprintf (f, "plot '%s' using %d:%d:%d with lines lw 1.2 dt 1 lc palette\n", c->file, x + 2, y + 2, c->numbers + 2);
    return;
  }
  for (int i = 0; i < c->count; i++) {
    fprintf (f, "%s'%s' index %d using %d:%d with lines lt %d ", i ? ", \\\n  " : "plot ", c->file, i, x + 2, y + 2,
             i + 1);
    fputs (titled ? "title '" : "notitle", f);
    if (titled) script_text (f, c->name (p, i)), fputs ("'", f);
  }
  fputs ("\n", f);
}

/* ---- All figures ---- */

int pw_plot_write_scripts (const pw_plots *p, pw_error *error) {
  int status = pw_plot_paths (p, error);
  if (status == PW_OK) status = pw_plot_velocities (p, error);
  if (status == PW_OK) status = pw_plot_angular (p, error);
  if (status == PW_OK) status = pw_plot_energy (p, error);
  return status == PW_OK ? pw_plot_mechanism (p, error) : status;
}
