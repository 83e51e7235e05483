/* A folder of figures: data files, gnuplot scripts made of templates (*.gp), and the figures drawn by gnuplot. */
#ifndef PW_FIGURE_H
#define PW_FIGURE_H

#include "cli.h"

enum {
  FIGURE_SCRIPTS = 8, /* drawn at a time, at most */
  FIGURE_WIDTH = 170, /* [mm]: both columns of a page */
  FIGURE_TITLE = 300, /* bytes of the title, at most */
  FIGURE_NAME = 20,   /* bytes of a name in the label of an axis, at most */
  FIGURE_PATH = 4096, /* longest path of a file, its end included */
  FIGURE_ENDINGS = 5
};

typedef struct {
  const char *folder, *model;
  char incomplete[80]; /* ", incomplete: up to t = 3.2 s of 10 s", or "" */
  const char *about;   /* the title; NULL or "": the model's name */
  double width;        /* [mm]; 0: FIGURE_WIDTH */
} pw_figures;

/* ".dat", ".gp", then those of pictures; ended by NULL. */
extern const char *const pw_figure_endings[FIGURE_ENDINGS + 1];

/* The option of commands that draw figures, and its value [mm] of "85mm", "8.5cm" or "3.3in"; NULL leaves *width
 * unchanged.  PW_INPUT unless it is between 50 and 500 mm. */
#define PW_WIDTH_OPTION                                    \
  PW_TEXT_OPTION (pw_cli_line, width, "width", 0, "WIDTH", \
                  "Width of figures, such as 85mm for one column (default 170mm)")
int pw_figure_width (const char *text, double *width, pw_error *error);

/* Opens a file of a folder; a data file, with a comment if the run is incomplete.  NULL and PW_RESOURCE. */
pw_output *pw_figure_open_file (const char *folder, const char *name, pw_error *error);
pw_output *pw_figure_open_data (const pw_figures *f, const char *name, pw_error *error);

/* Opens the script NAME.gp; write the variables of its template to it, then end it.  NULL and PW_RESOURCE if it cannot
 * be written. */
pw_output *pw_figure_begin (const pw_figures *f, const char *name, pw_error *error);
/* Adds the template and completes the script.  PW_OK or PW_RESOURCE. */
int pw_figure_end (pw_output *o, const char *template_name, pw_error *error);
/* Assigns a text to a variable. */
void pw_figure_text (FILE *f, const char *variable, const char *value);
/* A name of at most FIGURE_NAME bytes, shortened in the middle if need be. */
const char *pw_figure_name (const char *name, char buffer[FIGURE_NAME + 4]);
/* The label of an axis, in a temporary buffer: "NAME [UNIT]", or "NAME" if the unit is "", the name shortened. */
#define PW_FIGURE_LABEL(name, unit) pw_figure_label (name, unit, (char[FIGURE_TITLE]){ 0 })
const char *pw_figure_label (const char *name, const char *unit, char buffer[FIGURE_TITLE]);
/* Runs gnuplot on NAME.gp for each of at most FIGURE_SCRIPTS names, a list ended by NULL; a missing gnuplot is reported
 * on standard error.  PW_RESOURCE if gnuplot fails; PW_INTERRUPTED, reported, if a signal ends it. */
int pw_figure_draw (const char *folder, const char *const *names, pw_error *error);
/* Removes the pictures of an earlier run and reports why none are drawn.  Returns PW_OK. */
int pw_figure_undrawn (const char *folder, const char *const *names, const char *why);

/* ---- Panels of curves (panels.gp) ---- */

enum {
  PW_PANEL_HALF = 1,  /* beside another panel, if the page is wide enough */
  PW_PANEL_BELOW = 2, /* below the panel before it, unless it is the first one, with the same x axis */
  PW_PANEL_LOG_X = 4,
  PW_PANEL_LOG_Y = 8,
  PW_PANEL_EQUAL = 16 /* both axes have the same unit */
};

typedef struct {
  const char *x_label, *y_label;
  const char *z_label;     /* of a scale of colours; NULL: none */
  double x[2], y[2], z[2]; /* ends of the axes; equal: those of the points, with a margin */
  double aspect;           /* height / width; 0: low and wide */
  int type;                /* a sum of PW_PANEL_... */
} pw_panel;

/* A figure in progress.  All but the error is private. */
typedef struct {
  pw_error error; /* of what adds curves: the figure is not written */
  const char *folder, *name;
  pw_output *data, *script;
  pw_panel panel;
  double range[3][2];                /* of the points of the panel: x, y, z */
  int panels, curves, blocks, ended; /* numbers of panels and curves, of curves with points, of those that have ended */
  int first;                         /* curve of the panel; 0: there is no panel yet */
  int points;                        /* of the curve */
  int interrupted;                   /* 1: after its last point */
  int bars;                          /* 1: z is a standard deviation */
} pw_curves;

/* Opens NAME.dat and NAME.gp in the folder, of the width that the command line gives, or as `figures` says.  Panels
 * and curves are added in turn, curves to the last panel, points to the last curve.  A panel without points is
 * omitted unless its axes are given, a figure without panels is not written.  PW_OK, PW_INPUT for the width, or
 * PW_RESOURCE. */
int pw_curves_open (pw_curves *c, const pw_cli_line *line, const char *folder, const char *name, const char *title,
                    pw_error *error);
int pw_curves_begin (pw_curves *c, const pw_figures *figures, const char *name, const char *title, pw_error *error);
void pw_curves_panel (pw_curves *c, const pw_panel *panel);
/* Styles are those of `look` in panels.gp; `method STABILISATION` with the method as label.  Labels are in a legend
 * above the panel unless they are NULL, or it would repeat an earlier one. */
void pw_curves_add (pw_curves *c, const char *style, const char *label);
/* z: on the scale of colours, the number of a colour, or a standard deviation.  A point with a NaN, or without a
 * logarithm, interrupts the curve.  The line of an event has y = INFINITY; a band below y has x = INFINITY. */
void pw_curves_point (pw_curves *c, double x, double y, double z);
/* A cell of a map, of style `cells`: the ends in x and in y, and z on the scale of colours; none if z is NaN. */
void pw_curves_cell (pw_curves *c, const double x[2], const double y[2], double z);
/* Completes the files, unless c->error is set.  A status. */
int pw_curves_close (pw_curves *c, pw_error *error);

/* ---- Results of commands: a table, a summary, a figure ---- */

/* Options of commands whose results are a table, a summary and figures. */
#define PW_SUMMARY_OPTIONS(json_help, plots_help)                                                    \
  PW_TEXT_OPTION (pw_cli_line, json, "json", 0, "FILE", json_help " as JSON; - is standard output"), \
      PW_TEXT_OPTION (pw_cli_line, plots, "plots", 0, "DIR", plots_help " into a folder"), PW_WIDTH_OPTION
#define PW_RESULTS_OPTIONS(table_help, json_help, plots_help)                                                 \
  PW_TEXT_OPTION (pw_cli_line, table, "output", 'o', "FILE.csv", table_help ", or as FILE.npz or FILE.json"), \
      PW_SUMMARY_OPTIONS (json_help, plots_help)

typedef struct {
  const char *name, *title; /* of the figure: "steady", "eigenvalues of steady motions" */
  int takes_folder; /* 1: -o DIR is understood, an old spelling of -o DIR/NAME.csv --json DIR/NAME.json --plots DIR */
  int lines;        /* pw_json.lines of the summary */
  /* NULL: the command writes the table itself, to a file that is not opened here */
  void (*table) (const void *context, pw_cells *c);
  void (*json) (const void *context, pw_json *j);
  void (*draw) (const void *context, pw_curves *c); /* with --plots: adds panels */
} pw_results;

/* Opens what they name.  tables: formats of the table; NULL: there will be none.  reads: a file that the command reads,
 * or without a path.  A status. */
int pw_results_open (pw_cli_line *line, const pw_results *r, const char *const *tables, pw_use reads, pw_error *error);
/* Draws figures, then writes table and summary, even if that has failed.  A status. */
int pw_results_write (pw_cli_line *line, const pw_results *r, const void *context, pw_error *error);
/* The status in the summary of a search: that of figures, unless it was interrupted or has not converged. */
const char *pw_results_word (const pw_cli_line *line, int interrupted, int converged);

#endif
