/* The samples of a run for figures and animations, and their common parts. */
#ifndef PW_PLOT_H
#define PW_PLOT_H

#include <stdio.h>
#include "cli.h"
#include "figure.h"
#include "plots.h"

enum {
  PLOT_SAMPLES = 1600,    /* of a small scene */
  PLOT_FEW = 240,         /* of a large one, at least */
  PLOT_NUMBERS = 8000000, /* kept in all, unless that is less than PLOT_FEW samples */
  PLOT_SHOWN = 1000,      /* bodies and wheels drawn at most: more cannot be distinguished */
  PLOT_POINTS = 24,       /* attachment points drawn of one body, at most */
  PLOT_CURVES = 60,       /* bodies or wheels that get a curve, at most */
  PLOT_NAMED = 12,        /* curves that get a name each; more are coloured by number */
  PLOT_IMAGES = 60,       /* snapshots of the mechanism, at most */
  PLOT_FEWEST = 8         /* and at least */
};

/* Columns of a sample: these, then x, y, phi, vx, vy, omega of each body drawn, then x, y, heading of each wheel drawn,
 * then the force of each link. */
enum { PLOT_T, PLOT_KINETIC, PLOT_POTENTIAL, PLOT_WORK, PLOT_LOSS, PLOT_PROJECTION, PLOT_BALANCE, PLOT_FIRST };

/* Attachment points of a body, in its frame [m], and the convex outline of them and its centre of mass,
 * counter-clockwise; empty if they are collinear. */
typedef struct {
  int count, corners;
  double at[PLOT_POINTS][2];
  double corner[PLOT_POINTS + 1][2];
} pw_plot_body;

/* 1 if attachment point k is not a corner of the outline. */
int pw_plot_inside (const pw_plot_body *shape, int k);

/* An element with points: what it connects, and on which of its ends the force is shown. */
typedef struct {
  int element; /* of the system */
  int ends;    /* 1 or 2 */
  struct {
    int body;     /* among those drawn, -1: the ground */
    double at[2]; /* [m] */
  } end[2];
  int force, column; /* end, and the first column of its body */
} pw_plot_link;

/* A rectangle [m]. */
typedef struct {
  double x0, x1, y0, y1;
} pw_plot_box;

struct pw_plots {
  const char *folder, *model;
  int lock; /* of the folder; -1: none */
  const pw_system *s;
  pw_workspace *workspace; /* for contact points and forces */
  double t_end;
  int samples, wanted;  /* taken so far; planned */
  int width;            /* numbers per sample */
  int bodies, wheels;   /* drawn; markers are among the wheels */
  int links;            /* elements whose forces are kept */
  int grounds;          /* points of the ground */
  int all_wheels;       /* in the system */
  int *body;            /* bodies: index in the system */
  int *element;         /* wheels: which of the system's */
  pw_plot_body *shape;  /* bodies */
  double (*ground)[2];  /* grounds [m] */
  double *data;         /* wanted x width */
  double (*contact)[3]; /* scratch: all_wheels */
  pw_plot_link *link;   /* links */
  double *forces;       /* scratch: of all elements */
};

/* Sample i, and the parts of one. */
static inline double *pw_plot_sample (const pw_plots *p, int i) {
  return p->data + (size_t)i * (size_t)p->width;
}
static inline double *pw_plot_motion (const pw_plots *p, int i, int body) {
  return pw_plot_sample (p, i) + PLOT_FIRST + 6 * body;
}
static inline double *pw_plot_wheel (const pw_plots *p, int i, int wheel) {
  return pw_plot_sample (p, i) + PLOT_FIRST + 6 * p->bodies + 3 * wheel;
}

static inline double *pw_plot_force (const pw_plots *p, int i, int link) {
  return pw_plot_sample (p, i) + PLOT_FIRST + 6 * p->bodies + 3 * p->wheels + 2 * link;
}

/* Index of item i of `shown` items chosen at equal distances from `all`. */
static inline int pw_plot_pick (int i, int shown, int all) {
  return (int)((long long)i * all / shown);
}

/* A family of curves, one per body or wheel; above a dozen they are coloured by number instead of named. */
typedef struct {
  const char *file;      /* a block for each: time, numbers, number in the model */
  const char *columns;   /* "x [m], ..." */
  const char *what;      /* "body", for the colour bar */
  int count, shown, all; /* curves; bodies or wheels kept; in the system */
  int numbers;           /* kept of each */
  const char *(*name) (const pw_plots *p, int shown);
  double *(*at) (const pw_plots *p, int i, int shown); /* its numbers in sample i */
} pw_curves;

pw_curves pw_plot_bodies (const pw_plots *p);
pw_curves pw_plot_wheels (const pw_plots *p);

const char *pw_plot_body_name (const pw_plots *p, int body);
const char *pw_plot_wheel_name (const pw_plots *p, int wheel);
/* 1 for a wheel, 0 for a marker, which is kept among the wheels. */
int pw_plot_rolls (const pw_plots *p, int wheel);
/* Title of the paths drawn: "paths of the wheels and markers". */
const char *pw_plot_followed (const pw_plots *p);
/* The body a wheel belongs to, among those drawn; -1: the ground, -2: none of them. */
int pw_plot_body_of_wheel (const pw_plots *p, int wheel);

/* Finds the attachment points of bodies and of the ground, from the points of elements' definitions. */
int pw_plot_find_shapes (pw_plots *p, const pw_model *m, pw_error *error);

/* Finds elements with points on the bodies drawn, up to the available number. */
void pw_plot_find_links (pw_plots *p, const pw_model *m);
/* Their forces [N], x and y each. */
void pw_plot_forces (const pw_plots *p, const pw_sample *sample, double *out);

/* The smallest rectangle around all attachment points, centres of mass and wheels of samples 0 ... n - 1; around the
 * paths of the wheels (of the centres of mass if there are no wheels). */
pw_plot_box pw_plot_box_of (const pw_plots *p, int n);
pw_plot_box pw_plot_box_of_paths (const pw_plots *p, int n);

/* Largest dimension of the initial configuration [m]. */
double pw_plot_size (const pw_plots *p);

/* Blocks of the mechanism's data, and whether one has any content. */
enum { PLOT_BODIES, PLOT_WHEELS, PLOT_CENTRES };
int pw_plot_has (const pw_plots *p, int block);

/* Number of initial samples shown in a separate figure, if the mechanism travels so far that it is small in a figure of
 * the whole run: those that fit a figure a few times its size; 0: none.  A single point has no size. */
int pw_plot_closeup (const pw_plots *p);

/* Writes the data files. */
int pw_plot_write_data (const pw_plots *p, const pw_figures *f, int closeup, pw_error *error);

#endif
