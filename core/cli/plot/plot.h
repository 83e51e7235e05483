/* Figures and animations of a run, from samples of it: paths, velocities, energies and snapshots of the motion, drawn
 * by gnuplot; a page for web browsers.
 *
 * The folder of figures gets data files (*.dat), gnuplot scripts (*.gp) and their output (*.svg, *.png, *.pdf).  A
 * script can be edited and run again there: gnuplot FILE.gp. */
#ifndef PW_PLOT_H
#define PW_PLOT_H

#include <math.h>
#include "figure.h"

typedef struct pw_plots pw_plots;

/* Prepares to store samples of a run from t = 0 to t_end [s] for figures in a folder, which is created if necessary;
 * folder NULL: for an animation alone.  forces: 1 if the animation shows the forces of elements.  Folder, model and
 * system must outlive the result.  NULL and the error if the folder cannot be written or memory is exhausted. */
pw_plots *pw_plots_open (const char *folder, int forces, const pw_model *model, const pw_system *system, double t_end,
                         pw_error *error);
void pw_plots_close (pw_plots *plots);
/* Reads the values of --width and --colour, NULL if not given.  PW_OK or PW_INPUT. */
int pw_plots_style (pw_plots *plots, const char *width, const char *colour, pw_error *error);

/* The time of the next sample [s]; INFINITY after the last one. */
double pw_plots_next (const pw_plots *plots);
/* Stores a sample, if there is room; its energies are complete only with pw_settings.ledger. */
void pw_plots_add (pw_plots *plots, const pw_sample *sample);
/* Stores the last sample of a run that ends before t_end as it should. */
void pw_plots_last (pw_plots *plots, const pw_sample *sample);
/* Stores the events of a run that has ended, which curves mark; none if memory is exhausted. */
void pw_plots_events (pw_plots *plots, const pw_run *run);
/* Saves or loads the samples stored so far. */
void pw_plots_serialise (pw_plots *plots, pw_archive *archive);

/* Writes data and scripts into the folder and, if `draw`, runs gnuplot; after an interrupt (`draw` 0), or if gnuplot is
 * not installed, a notice says how to draw the figures.  Without a folder it does nothing, with fewer than two samples
 * it only prints a notice.  PW_RESOURCE if a file cannot be written or gnuplot fails; PW_INTERRUPTED. */
int pw_plots_finish (pw_plots *plots, int draw, pw_error *error);

/* PW_INPUT unless the path of an animation, the value of an option, ends in .html. */
int pw_animation_check (const char *option, const char *path, pw_error *error);
/* Writes the page of an animation to an output, which the caller completes; `path` names it in a notice, `reason` says
 * why the run did not reach its end, or is "".  Returns 1; 0, with the notice, if there are fewer than two samples. */
int pw_animate (const pw_plots *plots, const char *path, pw_output *o, const char *method, const char *reason);

/* Writes the samples as the JavaScript object `run` of animate.html; forces and energies only if pw_plots_open was
 * called with `forces`. */
void pw_animation_run (FILE *f, const pw_plots *plots, const char *method, const char *reason);
/* Write members of that object: the shapes and names of what moves; the parameters of a model. */
void pw_animation_scene (pw_json *j, const pw_plots *plots);
void pw_animation_parameters (pw_json *j, const pw_model *model);
/* Writes animate.html with a panel of additional controls, HTML lines ended by NULL; `begin` writes the JavaScript
 * that calls begin() with a run, at once or later. */
void pw_animation_page (FILE *f, const char *const *panel, void (*begin) (FILE *f, const void *context),
                        const void *context);

/* ---- Private to this folder ---- */

enum {
  PLOT_INTERVALS = 1600,  /* intervals between the samples of a run, at most */
  PLOT_FEW = 240,         /* the same at least, for a large scene */
  PLOT_NUMBERS = 8000000, /* numbers stored at most, unless that permits fewer than PLOT_FEW intervals */
  PLOT_DRAWN = 1000,      /* bodies, and wheels, drawn at most: more cannot be distinguished */
  PLOT_VERTICES = 32,     /* of a stroke, at most */
  PLOT_HATCHES = 60,      /* strokes of the hatching of the ground, at most */
  PLOT_STROKES = 80,      /* of a symbol and of the ground at it, at most */
  PLOT_ATTACHMENTS = 24,  /* attachment points drawn of one body, at most */
  PLOT_CURVES = 60,       /* bodies, or wheels, with a curve, at most */
  PLOT_PATHS = 20,        /* paths of the model drawn, at most */
  PLOT_PATH = 500,        /* points of each, at most */
  PLOT_OUTPUTS = 12       /* first-order states and outputs with a panel, at most */
};

/* In place of the index of a body among those drawn: the ground, a body that is not drawn. */
enum { PLOT_GROUND = -1, PLOT_HIDDEN = -2 };

/* Columns of a sample: these, then x, y, phi, vx, vy, omega of each body drawn, then x, y, heading of each wheel drawn,
 * then, with forces, Fx, Fy of each link, then first-order states and outputs. */
enum { PLOT_T, PLOT_KINETIC, PLOT_POTENTIAL, PLOT_WORK, PLOT_LOSS, PLOT_PROJECTION, PLOT_BALANCE, PLOT_FIRST };

/* The motions of bodies, or of "wheels": all elements with a contact point, which include markers. */
typedef struct {
  const char *file, *columns, *noun; /* data file, its columns, "body" or "wheel" */
  int numbers, offset;               /* numbers of each in a sample; column of the first one */
  int count, drawn, curves;          /* number in the system; drawn; with a curve */
  int *system_index;                 /* drawn: their indices among the bodies, or elements, of the system */
} pw_tracks;

/* Attachment points of a body, in its frame [m], and its outline: that of the model, or else the convex hull of them
 * and the centre of mass, counter-clockwise, without corners if they are collinear. */
typedef struct {
  int attachments, corners;
  int is_point_mass; /* 1: it has mass but no inertia */
  double attachment[PLOT_ATTACHMENTS][2];
  const double (*corner)[2];
  double hull[PLOT_ATTACHMENTS + 1][2];
} pw_plot_body;

/* A disc of a body, drawn or the ground: x, y of its centre in the body's frame, radius [m]. */
typedef struct {
  int body;
  double at[3];
} pw_plot_disc;

/* An end of a link. */
typedef struct {
  int body;     /* among those drawn, or PLOT_GROUND */
  double at[2]; /* in its frame [m] */
} pw_plot_end_of;

/* An element that is drawn, between points of its bodies, or without such points at the joints of its bodies with each
 * other. */
typedef struct {
  int element; /* of the system */
  const pw_kind *kind;
  const void *definition;
  int wheel; /* its index among the wheels drawn; -1: none */
  int rail;  /* 1 if the symbol contains a rail, a line of the last body, or a length in its frame */
  int ends;  /* 1 or 2 */
  pw_plot_end_of end[2];
  int force_end;        /* the end at which its force is drawn, on a body; -1: its force is not drawn */
  int force_offset;     /* of that force in the result of pw_workspace_forces */
  int companion_offset; /* of that of its companion, which is added to it; -1: it has none */
} pw_plot_link;

/* A stroke of a symbol, a polygonal line.  A vertex a, x, y, b is the point  p1 + a d + b d' + u (x e + y n), where p1
 * and p2 are the first and the last end of the link, d = p2 - p1, d' is d turned to the left by 90 degrees, u the unit
 * of symbols, e the direction of the symbol (plot_shapes.c) and n is e turned to the left by 90 degrees. */
typedef struct {
  int vertices;
  int closed;  /* 1: the last vertex is the first one, and the area inside hides what is below */
  int upright; /* 1: e is the x axis, and d = 0 if the first body is the ground */
  double vertex[PLOT_VERTICES][4];
} pw_plot_stroke;

/* A path of the model, in gray below the scene. */
typedef struct {
  int points;
  double point[PLOT_PATH][2]; /* [m] */
} pw_plot_path;

struct pw_plots {
  pw_figures figures; /* their folder is NULL without figures */
  int by_time;        /* 1: colours show the time, 0: the bodies */
  pw_folder folder;   /* none without figures */
  const pw_model *model;
  const pw_system *system;
  pw_workspace *workspace; /* for contact points and forces */
  double t_end;            /* [s] */
  int samples, planned;    /* stored so far; in all */
  pw_event *event;         /* events */
  int events;
  int sample_size;    /* numbers of a sample */
  int outputs;        /* first-order states and outputs drawn: the last numbers of a sample */
  double size;        /* diagonal of the box around the initial configuration [m] */
  double symbol_unit; /* u of symbols [m] */
  pw_tracks bodies, wheels;
  int links, grounds;   /* elements drawn, before pw_plot_find_shapes at most; points of the ground */
  int with_forces;      /* 1: the forces of links are kept */
  int paths;            /* of the model, drawn */
  pw_plot_path *path;   /* paths */
  int *body_index;      /* of each body: its index among those drawn or PLOT_HIDDEN; PLOT_GROUND at the end */
  pw_plot_body *shape;  /* of the bodies drawn */
  double (*ground)[2];  /* grounds [m] */
  int discs;            /* of bodies and the ground */
  pw_plot_disc *disc;   /* discs */
  double *data;         /* planned x sample_size: the samples */
  double (*contact)[3]; /* scratch: of the wheels of the system */
  pw_plot_link *link;   /* links */
  double *forces;       /* scratch: of all elements */
  pw_arena arena;       /* of these arrays */
  int out_of_memory;    /* 1: one of them could not be allocated */
};

/* Sample i; in it, the numbers of body or wheel k of those drawn. */
static inline double *pw_plot_sample (const pw_plots *plots, int i) {
  return plots->data + (size_t)i * (size_t)plots->sample_size;
}
static inline double *pw_plot_track (const pw_plots *plots, int i, const pw_tracks *tracks, int k) {
  return pw_plot_sample (plots, i) + tracks->offset + tracks->numbers * k;
}

/* The index of the i-th of `chosen` items spread evenly over `all`. */
static inline int pw_plot_pick (int i, int chosen, int all) {
  return (int)((long long)i * all / chosen);
}

/* The first constraint equation of an element with events, from `row` on; *end: the one after its last; or -1. */
int pw_plot_marked (const pw_plots *plots, int row, int *end);

/* The name of body or wheel k of those drawn. */
const char *pw_plot_name (const pw_plots *plots, const pw_tracks *tracks, int k);
/* 1 for a wheel, 0 for a marker, of those drawn. */
int pw_plot_rolls (const pw_plots *plots, int wheel);

/* The link of the element that a companion accompanies; NULL if it is not drawn, or this is no companion. */
pw_plot_link *pw_plot_accompanied (const pw_plots *plots, const pw_element_info *companion);
/* Fills shape, ground and link, as far as they have room. */
void pw_plot_find_shapes (pw_plots *plots);
/* 1 if attachment point k is not a corner of the hull. */
int pw_plot_inside (const pw_plot_body *shape, int k);
/* A point of a body in the inertial frame [m]; placement: x, y, phi of the body; at: the point in its frame. */
void pw_plot_point (const double *placement, const double *at, double out[2]);
/* End n of a link at sample i, in the inertial frame [m]. */
void pw_plot_end (const pw_plots *plots, int i, const pw_plot_link *link, int n, double out[2]);

/* The name of a first-order state or output that is drawn, and its unit, "" if it has none. */
const char *pw_plot_output (const pw_plots *plots, int o, char buffer[PW_NAME_BYTES], const char **unit);

/* Fills in the strokes of a link's symbol, if it has one, and of the ground at it; returns their number.  Rails are as
 * long as the travel during the first `samples` samples. */
int pw_plot_strokes (const pw_plots *plots, const pw_plot_link *link, int samples, pw_plot_stroke stroke[PLOT_STROKES]);
/* The vertices of a stroke at sample i, in the inertial frame [m]. */
void pw_plot_place (const pw_plots *plots, int i, const pw_plot_link *link, const pw_plot_stroke *stroke,
                    double (*out)[2]);
/* The field `heading` of an element [rad]; 0 if it has none. */
double pw_plot_heading (const pw_plot_link *link);

#endif
