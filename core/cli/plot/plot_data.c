/* Data files of the figures: plain columns, a comment line with names and units at the top. */
#include <math.h>
#include "figure.h"
#include "plot.h"

static void data_number (FILE *f, double value, const char *before) {
  char text[32];
  fputs (before, f);
  fputs (pw_format (text, value, 10), f);
}

/* ---- Size ---- */

/* A point of a body in the world. */
static void data_point (const double *motion, const double *at, double out[2]) {
  double c = cos (motion[2]), s = sin (motion[2]);
  out[0] = motion[0] + c * at[0] - s * at[1];
  out[1] = motion[1] + s * at[0] + c * at[1];
}

static void data_extend (pw_plot_box *box, const double *point) {
  if (!isfinite (point[0]) || !isfinite (point[1])) return;
  box->x0 = fmin (box->x0, point[0]);
  box->x1 = fmax (box->x1, point[0]);
  box->y0 = fmin (box->y0, point[1]);
  box->y1 = fmax (box->y1, point[1]);
}

static void data_extend_sample (const pw_plots *p, int i, pw_plot_box *box) {
  for (int b = 0; b < p->bodies; b++) {
    const double *motion = pw_plot_motion (p, i, b);
    data_extend (box, motion);
    for (int k = 0; k < p->shape[b].count; k++) {
      double point[2];
      data_point (motion, p->shape[b].at[k], point);
      data_extend (box, point);
    }
  }
  for (int w = 0; w < p->wheels; w++) data_extend (box, pw_plot_wheel (p, i, w));
}

static const pw_plot_box data_empty = { INFINITY, -INFINITY, INFINITY, -INFINITY };

pw_plot_box pw_plot_box_of (const pw_plots *p, int n) {
  pw_plot_box box = data_empty;
  for (int i = 0; i < n; i++) data_extend_sample (p, i, &box);
  for (int g = 0; g < p->grounds; g++) data_extend (&box, p->ground[g]);
  return box;
}

pw_plot_box pw_plot_box_of_paths (const pw_plots *p, int n) {
  pw_plot_box box = data_empty;
  for (int i = 0; i < n; i++)
    if (p->wheels > 0)
      for (int w = 0; w < p->wheels; w++) data_extend (&box, pw_plot_wheel (p, i, w));
    else
      for (int b = 0; b < p->bodies; b++) data_extend (&box, pw_plot_motion (p, i, b));
  return box;
}

static double data_diagonal (pw_plot_box box) {
  return box.x1 >= box.x0 ? hypot (box.x1 - box.x0, box.y1 - box.y0) : 0;
}

double pw_plot_size (const pw_plots *p) {
  double size = data_diagonal (pw_plot_box_of (p, 1));
  return size > 0 ? size : pw_system_length (p->s);
}

int pw_plot_closeup (const pw_plots *p) {
  double size = pw_plot_size (p);
  if (p->wheels == 0 && !pw_plot_has (p, PLOT_BODIES)) return 0;
  if (data_diagonal (pw_plot_box_of (p, p->samples)) < 10 * size) return 0;
  pw_plot_box box = data_empty;
  int n = 0;
  while (n < p->samples) {
    data_extend_sample (p, n, &box);
    if (data_diagonal (box) > 4 * size) break;
    n++;
  }
  return n < 12 ? 0 : n;
}

/* ---- Files ---- */

/* One block per curve: time, the columns of the body or wheel, its number in the model. */
static int data_curves (const pw_plots *p, const pw_figures *f, const pw_curves *c, pw_error *error) {
  pw_output *o = c->count ? pw_figure_data (f, c->file, error) : NULL;
  if (o == NULL) return c->count ? PW_RESOURCE : PW_OK;
  FILE *out = pw_output_stream (o);
  for (int k = 0; k < c->count; k++) {
    int shown = pw_plot_pick (k, c->count, c->shown);
    fprintf (out, "%s# %s: %s, number\n", k ? "\n\n" : "", c->name (p, shown), c->columns);
    for (int i = 0; i < p->samples; i++) {
      const double *x = c->at (p, i, shown);
      data_number (out, pw_plot_sample (p, i)[PLOT_T], "");
      for (int j = 0; j < c->numbers; j++) data_number (out, x[j], " ");
      fprintf (out, " %d\n", pw_plot_pick (shown, c->shown, c->all) + 1);
    }
  }
  return pw_output_finish (o, error);
}

static int data_energy (const pw_plots *p, const pw_figures *f, pw_error *error) {
  pw_output *o = pw_figure_data (f, "energy.dat", error);
  if (o == NULL) return PW_RESOURCE;
  FILE *out = pw_output_stream (o);
  fputs ("# t [s], kinetic [J], potential [J], work [J], loss [J], projection [J], balance [J]", out);
  for (int i = 0; i < p->samples; i++)
    for (int k = 0; k < PLOT_FIRST; k++) data_number (out, pw_plot_sample (p, i)[k], k ? " " : "\n");
  fputs ("\n", out);
  return pw_output_finish (o, error);
}

static int data_ground (const pw_plots *p, const pw_figures *f, pw_error *error) {
  pw_output *o = p->grounds ? pw_figure_data (f, "ground.dat", error) : NULL;
  if (o == NULL) return p->grounds ? PW_RESOURCE : PW_OK;
  FILE *out = pw_output_stream (o);
  fputs ("# points of the ground: x [m], y [m]\n", out);
  for (int g = 0; g < p->grounds; g++) {
    data_number (out, p->ground[g][0], "");
    data_number (out, p->ground[g][1], " ");
    fputs ("\n", out);
  }
  return pw_output_finish (o, error);
}

/* ---- The mechanism: lines of "x y t", blank lines between polygons ---- */

static void data_vertex (FILE *f, const double *point, double t) {
  data_number (f, point[0], "");
  data_number (f, point[1], " ");
  data_number (f, t, " ");
  fputs ("\n", f);
}

/* A body without an outline: lines from each attachment point to the centre of mass and on to the next one. */
static void data_line (FILE *f, const pw_plot_body *shape, const double *motion, double t) {
  for (int k = 0; k < shape->count; k++) {
    double point[2];
    data_point (motion, shape->at[k], point);
    if (k != 1) data_vertex (f, k == 0 ? point : motion, t);
    data_vertex (f, k == 0 ? motion : point, t);
  }
  if (shape->count > 0) fputs ("\n", f);
}

/* A body with an outline: that, and lines from the centre of mass to attachment points inside. */
static void data_plate (FILE *f, const pw_plot_body *shape, const double *motion, double t) {
  double point[2];
  for (int k = 0; k <= shape->corners; k++) {
    data_point (motion, shape->corner[k % shape->corners], point);
    data_vertex (f, point, t);
  }
  fputs ("\n", f);
  for (int k = 0; k < shape->count; k++) {
    if (!pw_plot_inside (shape, k)) continue;
    data_point (motion, shape->at[k], point);
    data_vertex (f, motion, t);
    data_vertex (f, point, t);
    fputs ("\n", f);
  }
}

static void data_body (FILE *f, const pw_plots *p, int i, int body) {
  const double *motion = pw_plot_motion (p, i, body), t = pw_plot_sample (p, i)[PLOT_T];
  const pw_plot_body *shape = &p->shape[body];
  (shape->corners ? data_plate : data_line) (f, shape, motion, t);
}

static void data_wheel (FILE *f, const pw_plots *p, int i, int wheel, double half) {
  const double *contact = pw_plot_wheel (p, i, wheel), t = pw_plot_sample (p, i)[PLOT_T];
  if (!pw_plot_rolls (p, wheel)) return;
  double c = half * cos (contact[2]), s = half * sin (contact[2]);
  data_vertex (f, (double[]){ contact[0] - c, contact[1] - s }, t);
  data_vertex (f, (double[]){ contact[0] + c, contact[1] + s }, t);
  fputs ("\n", f);
}

/* Samples from one snapshot to the next, of the first n: the body with the longest path moves by about a third of the
 * size of the mechanism. */
static int data_stride (const pw_plots *p, int n) {
  double longest = 0;
  for (int b = 0; b < p->bodies; b++) {
    double path = 0;
    for (int i = 1; i < n; i++) {
      const double *from = pw_plot_motion (p, i - 1, b), *to = pw_plot_motion (p, i, b);
      path += hypot (to[0] - from[0], to[1] - from[1]);
    }
    longest = fmax (longest, path);
  }
  double images = fmin (fmax (3 * longest / pw_plot_size (p), PLOT_FEWEST), PLOT_IMAGES);
  int stride = (int)((n - 1) / images);
  return stride < 1 ? 1 : stride;
}

/* The head of a block, two blank lines after the previous one.  gnuplot counts blocks with data only, so an empty one
 * gets a point that is not drawn. */
static void data_begin_block (FILE *f, const pw_plots *p, int block) {
  static const char *const titles[] = { "bodies", "wheels", "bodies without attachments" };
  fprintf (f, "%s# %s: x [m], y [m], t [s]\n", block == PLOT_BODIES ? "" : "\n\n", titles[block]);
  if (!pw_plot_has (p, block)) fputs ("nan nan nan\n", f);
}

static void data_block (FILE *f, const pw_plots *p, int i, int block, double half) {
  for (int b = 0; b < p->bodies && block == PLOT_BODIES; b++) data_body (f, p, i, b);
  for (int w = 0; w < p->wheels && block == PLOT_WHEELS; w++) data_wheel (f, p, i, w, half);
  for (int b = 0; b < p->bodies && block == PLOT_CENTRES; b++)
    data_vertex (f, pw_plot_motion (p, i, b), pw_plot_sample (p, i)[PLOT_T]);
}

/* Three blocks: bodies, wheels, bodies without attachments; snapshots out of the first n samples. */
static int data_mechanism (const pw_plots *p, const pw_figures *f, const char *name, int n, pw_error *error) {
  pw_output *o = pw_figure_data (f, name, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *out = pw_output_stream (o);
  int stride = data_stride (p, n);
  double half_wheel = 0.06 * pw_plot_size (p);
  for (int block = PLOT_BODIES; block <= PLOT_CENTRES; block++) {
    data_begin_block (out, p, block);
    for (int i = 0; i < n; i += stride) data_block (out, p, i, block, half_wheel);
  }
  return pw_output_finish (o, error);
}

int pw_plot_has (const pw_plots *p, int block) {
  int b = 0, w = 0;
  while (w < p->wheels && !pw_plot_rolls (p, w)) w++;
  if (block == PLOT_WHEELS) return w < p->wheels;
  while (b < p->bodies && (p->shape[b].count == 0) != (block == PLOT_CENTRES)) b++;
  return b < p->bodies;
}

int pw_plot_write_data (const pw_plots *p, const pw_figures *f, int closeup, pw_error *error) {
  const pw_curves bodies = pw_plot_bodies (p), wheels = pw_plot_wheels (p);
  int status = data_curves (p, f, &bodies, error);
  if (status == PW_OK) status = data_curves (p, f, &wheels, error);
  if (status == PW_OK) status = data_energy (p, f, error);
  if (status == PW_OK) status = data_ground (p, f, error);
  if (status == PW_OK) status = data_mechanism (p, f, "mechanism.dat", p->samples, error);
  if (status == PW_OK && closeup > 0) status = data_mechanism (p, f, "mechanism-start.dat", closeup, error);
  return status;
}
