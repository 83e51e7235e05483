/* A folder of figures: data files, gnuplot scripts made of templates (*.gp), and the figures drawn by gnuplot. */
#ifndef PW_FIGURE_H
#define PW_FIGURE_H

#include <stdio.h>
#include "cli.h"

enum {
  FIGURE_SCRIPTS = 8, /* drawn at a time, at most */
  FIGURE_WIDTH = 170, /* [mm]: both columns of a page */
  FIGURE_TITLE = 300, /* bytes of the title, at most */
  FIGURE_NAME = 20,   /* bytes of a name in the label of an axis, at most */
  FIGURE_PATH = 4096  /* longest path of a file, its end included */
};

typedef struct {
  const char *folder, *model;
  char incomplete[80]; /* ", incomplete: up to t = 3.2 s of 10 s", or "" */
  const char *about;   /* the title; NULL or "": the model's name */
  double width;        /* [mm]; 0: FIGURE_WIDTH */
} pw_figures;

/* ".dat", ".gp", then those of pictures; ended by NULL. */
extern const char *const pw_figure_endings[];

/* The option of commands that draw figures, and its value [mm] of "85mm", "8.5cm" or "3.3in"; NULL leaves *width
 * unchanged.  PW_INPUT unless it is between 50 and 500 mm. */
#define PW_WIDTH_OPTION                                    \
  PW_TEXT_OPTION (pw_cli_line, width, "width", 0, "WIDTH", \
                  "Width of figures, such as 85mm for one column (default 170mm)")
int pw_figure_width (const char *text, double *width, pw_error *error);
/* Figures of the model of a command line in a folder, of the width that it gives.  A status. */
int pw_figures_of (pw_figures *f, const pw_cli_line *line, const pw_cli_model *model, const char *folder,
                   pw_error *error);

/* Opens a file of a folder; a data file, with a comment if the run is incomplete.  NULL and PW_RESOURCE. */
pw_output *pw_figure_open_file (const char *folder, const char *name, pw_error *error);
pw_output *pw_figure_open_data (const pw_figures *f, const char *name, pw_error *error);

/* Locks the folder of the option -o, in which NAME.csv, NAME.json and the figure NAME will be written, for `files`,
 * which the caller closes.  Without a folder (NULL) it only refuses --width.  A status. */
int pw_figure_lock_folder (const pw_cli_line *line, const pw_cli_model *model, const char *folder, const char *name,
                           pw_files *files, pw_error *error);
/* Writes NAME.csv and NAME.json, with this value of pw_json.lines, into the folder.  A status. */
int pw_figure_write_tables (const char *folder, const char *name, int lines, const void *context,
                            int (*csv) (const void *context, FILE *f, pw_error *error),
                            void (*json) (const void *context, pw_json *j), pw_error *error);

/* Opens the script NAME.gp; write the variables of its template to it, then end it.  NULL and PW_RESOURCE if it cannot
 * be written. */
pw_output *pw_figure_begin (const pw_figures *f, const char *name, pw_error *error);
/* Adds the template and completes the script.  PW_OK or PW_RESOURCE. */
int pw_figure_end (pw_output *o, const char *template_name, pw_error *error);
/* Assign a text to VARIABLE; to VARIABLE[i]; "NAME [UNIT]", or "NAME" if the unit is "", to VARIABLE[i], or to VARIABLE
 * if i = 0. */
void pw_figure_text (FILE *f, const char *variable, const char *value);
void pw_figure_element (FILE *f, const char *variable, int i, const char *value);
void pw_figure_label (FILE *f, const char *variable, int i, const char *name, const char *unit);
/* A name of at most FIGURE_NAME bytes, shortened in the middle if need be. */
const char *pw_figure_name (const char *name, char buffer[FIGURE_NAME + 4]);
/* Writes and draws the figure of a command that has one, NAME: `data` writes NAME.dat, `variables` those of the
 * template of this name.  A status. */
int pw_figure_write (const pw_cli_line *line, const pw_cli_model *model, const char *folder, const char *name,
                     const void *context, int (*data) (const void *context, FILE *f, pw_error *error),
                     void (*variables) (const void *context, FILE *f), pw_error *error);

/* Runs gnuplot on NAME.gp for each of at most FIGURE_SCRIPTS names, a list ended by NULL; a missing gnuplot is reported
 * on standard error.  PW_RESOURCE if gnuplot fails; PW_INTERRUPTED, reported, if a signal ends it. */
int pw_figure_draw (const char *folder, const char *const *names, pw_error *error);
/* Removes the pictures of an earlier run and reports why none are drawn.  Returns PW_OK. */
int pw_figure_undrawn (const char *folder, const char *const *names, const char *why);
/* The status of a command that has drawn, with this status and error, and then completed its files, with `status`. */
int pw_figure_status (int drawn, const pw_error *drawing, int status, pw_error *error);

#endif
