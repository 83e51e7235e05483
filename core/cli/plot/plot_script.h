/* What the gnuplot scripts share: pages, texts, families of curves. */
#ifndef PW_PLOT_SCRIPT_H
#define PW_PLOT_SCRIPT_H

#include "plot.h"

enum {
  SCRIPT_WIDTH = 900,  /* of a picture [px] */
  SCRIPT_WIDER = 1000, /* of one with panels side by side */
  SCRIPT_LEFT = 96,    /* margins [px] */
  SCRIPT_RIGHT = 28,
  SCRIPT_TOP = 42,
  SCRIPT_BOTTOM = 66,
  SCRIPT_HEAD = 30, /* room for a panel's own title */
  SCRIPT_BAR = 100, /* room for a colour bar at the right */
  SCRIPT_FOOT = 94  /* room for one below */
};

/* A script being written: a picture and its margins [px]. */
typedef struct {
  pw_output *output;
  FILE *f;          /* its stream */
  const char *name; /* NAME.gp draws NAME.svg and NAME.png */
  int width, height, left, right, top, bottom;
} pw_script;

/* A panel of it [px], from the upper left. */
typedef struct {
  double x0, x1, y0, y1;
} pw_panel;

static inline int pw_script_numbered (const pw_curves *c) {
  return c->count > PLOT_KEYED;
}

/* Room for the rows of names at the top of a page. */
int pw_script_names (const pw_plots *p, const pw_curves *c);

/* Opens NAME.gp and writes what comes before the drawing; PW_MACHINE if that fails. */
int pw_script_open (pw_script *s, const pw_plots *p, pw_error *error);
/* Begins and ends the drawing, once the size of the picture is settled; the end completes the file. */
void pw_script_begin (const pw_script *s, const pw_plots *p, const char *title);
int pw_script_end (const pw_script *s, pw_error *error);

void pw_script_range (const pw_script *s, const char *axis, double from, double to);
void pw_script_panel (const pw_script *s, pw_panel panel);
/* The names' place, or the colour bar's: at the right of the panels, or below them. */
void pw_script_key (const pw_script *s, const pw_plots *p, const pw_curves *c);
/* A colour bar below a panel. */
void pw_script_bar (const pw_script *s, pw_panel panel, const char *label);

/* The plot command of a family: number y of each (0: x ... 5: omega) over number x, or over time if x is -1.  Untitled
 * after the first panel. */
void pw_script_draw (const pw_script *s, const pw_plots *p, const pw_curves *c, int x, int y, int titled);

/* The figures over time (plot_time.c) and in the plane (plot_plane.c). */
int pw_plot_velocities (const pw_plots *p, pw_error *error);
int pw_plot_angular (const pw_plots *p, pw_error *error);
int pw_plot_energy (const pw_plots *p, pw_error *error);
int pw_plot_paths (const pw_plots *p, pw_error *error);
int pw_plot_mechanism (const pw_plots *p, pw_error *error);

#endif
