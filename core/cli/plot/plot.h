/* Figures and animations of a run, from samples of it: paths, velocities, energies and snapshots of the motion, drawn
 * by gnuplot; a page for web browsers.
 *
 * The folder of figures gets data files (*.dat), gnuplot scripts (*.gp) and their output (*.svg, *.png, *.pdf).  A
 * script can be edited and run again there: gnuplot FILE.gp. */
#ifndef PW_PLOT_H
#define PW_PLOT_H

#include <math.h>
#include "figure.h"
#include "util.h"

typedef struct pw_plots pw_plots;

/* Prepares figures of a run from 0 to t_end in a folder, which is created if necessary; NULL: without figures.  With
 * `forces`, those of elements with points are kept as well.  System and texts must outlive them.  PW_RESOURCE if the
 * folder cannot be written or memory is exhausted. */
pw_plots *pw_plots_open (const char *folder, int forces, const pw_model *model, const pw_system *system, double t_end,
                         pw_error *error);
void pw_plots_close (pw_plots *plots);
/* Reads the values of --width and --colour, NULL if not given; PW_INPUT. */
int pw_plots_style (pw_plots *plots, const char *width, const char *colour, pw_error *error);

/* The time of the next sample [s]; INFINITY after the last one. */
double pw_plots_next (const pw_plots *plots);
/* Takes a sample with the ledger. */
void pw_plots_add (pw_plots *plots, const pw_sample *sample);
/* Saves or loads the samples taken so far. */
void pw_plots_serialise (pw_plots *plots, pw_archive *archive);

/* Does nothing without a folder.  Writes data and scripts and, if `draw`, runs gnuplot; after an interrupt (`draw` 0),
 * or without gnuplot, a notice says how to draw them.  PW_RESOURCE if a file cannot be written or gnuplot fails. */
int pw_plots_finish (pw_plots *plots, int draw, pw_error *error);

/* PW_INPUT unless the name of an animation ends in .html. */
int pw_animation_check (const char *option, const char *path, pw_error *error);
/* Writes the samples of a run, with forces, to the output of that path, which the caller completes; `reason`: why the
 * run did not reach its end, or "".  Returns 0 and reports it if the run is too short. */
int pw_animate (const pw_plots *plots, const char *path, pw_output *o, const char *method, const char *reason);

/* Writes the samples as a JavaScript object for begin(); energies only with forces. */
void pw_animation_run (FILE *f, const pw_plots *plots, const char *method, const char *reason);
/* Writes members of an object that do not change in time: shapes, names, links; the parameters of a model. */
void pw_animation_scene (pw_json *j, const pw_plots *plots);
void pw_animation_parameters (pw_json *j, const pw_model *model);
/* Writes animate.html with the lines of a panel of controls, ended by NULL; `begin` writes the statements that call
 * begin() with a run. */
void pw_animation_page (FILE *f, const char *const *panel, void (*begin) (FILE *f, const void *context),
                        const void *context);

/* ---- Private to this folder ---- */

enum {
  PLOT_SAMPLES = 1600,    /* samples of a small scene */
  PLOT_FEW = 240,         /* fewest samples of a large scene */
  PLOT_NUMBERS = 8000000, /* numbers stored, unless that is less than PLOT_FEW samples */
  PLOT_DRAWN = 1000,      /* bodies and wheels drawn at most: more cannot be distinguished */
  PLOT_VERTICES = 32,     /* of a line of a symbol, at most */
  PLOT_HATCHES = 60,      /* lines of the hatching of the ground, at most */
  PLOT_STROKES = 80,      /* lines of a symbol and of the ground at it, at most */
  PLOT_ATTACHMENTS = 24,  /* attachment points drawn of one body, at most */
  PLOT_CURVES = 60        /* bodies or wheels with a curve, at most */
};

/* In place of the index of a body among those drawn. */
enum { PLOT_GROUND = -1, PLOT_HIDDEN = -2 };

/* Columns of a sample: these, then x, y, phi, vx, vy, omega of each body drawn, then x, y, heading of each wheel drawn,
 * then the force of each link. */
enum { PLOT_T, PLOT_KINETIC, PLOT_POTENTIAL, PLOT_WORK, PLOT_LOSS, PLOT_PROJECTION, PLOT_BALANCE, PLOT_FIRST };

/* The motions of bodies, or of wheels: all elements with a contact point, markers too. */
typedef struct {
  const char *file, *columns, *noun; /* data file, its columns, "body" */
  int numbers, offset;               /* numbers of each in a sample; column of the first one */
  int count, drawn, curves;          /* number in the system; drawn; with a curve */
  int *system_index;                 /* drawn: their numbers in the system */
} pw_tracks;

/* Attachment points of a body, in its frame [m], and the convex outline of them and its centre of mass,
 * counter-clockwise; empty if they are collinear. */
typedef struct {
  int attachments, corners;
  int is_point; /* 1: a point mass, without inertia */
  double attachment[PLOT_ATTACHMENTS][2];
  double corner[PLOT_ATTACHMENTS + 1][2];
} pw_plot_body;

/* An element with points, or at the joint of its bodies: the bodies it connects, and the end at which its force is
 * drawn. */
typedef struct {
  int element; /* of the system */
  const pw_kind *kind;
  const void *definition;
  int wheel; /* its index among the wheels drawn; -1: none */
  int rail;  /* 1 if the last body has a line: a rail or slot */
  int ends;  /* 1 or 2 */
  struct {
    int body;     /* among those drawn, or PLOT_GROUND */
    double at[2]; /* in its frame [m] */
  } end[2];
  int force_end;    /* an end on a body; -1: at a joint of other elements, without its force */
  int force_offset; /* of that force among those of all elements */
} pw_plot_link;

/* A line of a symbol.  A vertex a, x, y, b is the point  p1 + a d + b d' + u (x e + y n), where p1 and p2 are the first
 * and the last end of the link, d = p2 - p1, d' is d turned to the left, u the unit of symbols, e the direction of the
 * symbol (plot_symbols.c) and n is e turned to the left.  `upright`: e is the x axis, and d = 0 if the first body is
 * the ground. */
typedef struct {
  int vertices, closed, upright;
  double vertex[PLOT_VERTICES][4];
} pw_plot_stroke;

struct pw_plots {
  pw_figures figures; /* their folder is NULL without figures */
  int by_time;        /* 1: colours show the time, 0: the bodies */
  int lock;           /* of the folder; -1: none */
  const pw_model *model;
  const pw_system *system;
  pw_workspace *workspace; /* for contact points and forces */
  double t_end;            /* [s] */
  int samples, planned;    /* taken so far; in all */
  int sample_size;         /* numbers of a sample */
  double size;             /* largest dimension of the initial configuration [m] */
  double symbol_unit;      /* u of symbols [m] */
  pw_tracks bodies, wheels;
  int links, grounds;   /* elements with points; points of the ground */
  int with_forces;      /* 1: the forces of links are kept */
  int *body_index;      /* of each body: its index among those drawn or PLOT_HIDDEN; PLOT_GROUND at the end */
  pw_plot_body *shape;  /* bodies drawn */
  double (*ground)[2];  /* grounds [m] */
  double *data;         /* planned x sample_size */
  double (*contact)[3]; /* scratch: wheels of the system */
  pw_plot_link *link;   /* links */
  double *forces;       /* scratch: of all elements */
  pw_arena arena;       /* of these arrays */
  int out_of_memory;    /* 1: one of them could not be allocated */
};

/* Sample i, and the numbers of track k in it. */
static inline double *pw_plot_sample (const pw_plots *plots, int i) {
  return plots->data + (size_t)i * (size_t)plots->sample_size;
}
static inline double *pw_plot_track (const pw_plots *plots, int i, const pw_tracks *tracks, int k) {
  return pw_plot_sample (plots, i) + tracks->offset + tracks->numbers * k;
}

/* Index of the i-th of `chosen` ones at equal distances among `all`. */
static inline int pw_plot_pick (int i, int chosen, int all) {
  return (int)((long long)i * all / chosen);
}

const char *pw_plot_name (const pw_plots *plots, const pw_tracks *tracks, int k);
/* 1 for a wheel, 0 for a marker. */
int pw_plot_rolls (const pw_plots *plots, int wheel);

/* Finds the attachment points of bodies and of the ground, and the links, up to the available number: elements with
 * points on the bodies drawn, and at joints of these. */
void pw_plot_find_shapes (pw_plots *plots);
/* 1 if attachment point k is not a corner of the outline. */
int pw_plot_inside (const pw_plot_body *shape, int k);
/* A rectangle [m]; begin with PLOT_EMPTY, or with one around the points of the ground. */
typedef struct {
  double x0, x1, y0, y1;
} pw_plot_box;
#define PLOT_EMPTY ((pw_plot_box){ INFINITY, -INFINITY, INFINITY, -INFINITY })
pw_plot_box pw_plot_ground (const pw_plots *plots);
/* Extends it by all attachment points, centres of mass and wheels of sample i; returns its diagonal [m]. */
double pw_plot_extend (pw_plot_box *box, const pw_plots *plots, int i);
/* Sets size and symbol_unit from the first sample. */
void pw_plot_measure (pw_plots *plots);
/* A point of a body in the inertial frame [m]; motion: x, y, phi. */
void pw_plot_point (const double *motion, const double *at, double out[2]);
/* End n of a link at sample i, in the inertial frame [m]. */
void pw_plot_end (const pw_plots *plots, int i, const pw_plot_link *link, int n, double out[2]);

/* Writes the strokes of a symbol, if there is one, and of the ground at it; returns their number.  Rails are as long as
 * the travel during the first `samples`. */
int pw_plot_strokes (const pw_plots *plots, const pw_plot_link *link, int samples, pw_plot_stroke stroke[PLOT_STROKES]);
/* The vertices of a stroke at sample i, in the inertial frame [m]. */
void pw_plot_place (const pw_plots *plots, int i, const pw_plot_link *link, const pw_plot_stroke *stroke,
                    double (*out)[2]);
/* The field `heading` of an element [rad]; 0 if it has none. */
double pw_plot_heading (const pw_plot_link *link);
/* Forces of the links [N], x and y each. */
void pw_plot_forces (const pw_plots *plots, const pw_sample *sample, double *out);

#endif
