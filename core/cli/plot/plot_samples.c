/* Samples for figures: equally spaced in time, for a limited number of bodies and wheels. */
#include <stdlib.h>
#include <string.h>
#include "plot.h"

const char *pw_plot_name (const pw_plots *plots, const pw_tracks *tracks, int k) {
  return tracks == &plots->bodies ? pw_system_body_name (plots->system, tracks->system_index[k])
                                  : pw_system_element (plots->system, tracks->system_index[k]).name;
}

int pw_plot_rolls (const pw_plots *plots, int wheel) {
  return pw_kind_acts (pw_system_element (plots->system, plots->wheels.system_index[wheel]).kind);
}

/* A zeroed array; NULL, with plots->out_of_memory set. */
static void *plot_array (pw_plots *plots, int count, size_t size) {
  void *array = pw_arena_alloc (&plots->arena, (size_t)count * size);
  if (array == NULL) plots->out_of_memory = 1;
  return array;
}

static void plot_open_tracks (pw_plots *plots, pw_tracks *tracks, int count) {
  tracks->count = count;
  tracks->drawn = count < PLOT_DRAWN ? count : PLOT_DRAWN;
  tracks->curves = count < PLOT_CURVES ? count : PLOT_CURVES;
  tracks->offset = plots->sample_size;
  plots->sample_size += tracks->numbers * tracks->drawn;
  tracks->system_index = plot_array (plots, tracks->drawn, sizeof *tracks->system_index);
}

static int plot_allocate (pw_plots *plots, pw_error *error) {
  pw_tracks *bodies = &plots->bodies, *wheels = &plots->wheels;
  *bodies = (pw_tracks){ .file = "motion.dat",
                         .columns = "t [s], x [m], y [m], phi [rad], vx [m/s], vy [m/s], omega [rad/s]",
                         .noun = "body",
                         .numbers = 6 };
  *wheels = (pw_tracks){
    .file = "wheels.dat", .columns = "t [s], x [m], y [m], heading [rad]", .noun = "wheel", .numbers = 3
  };
  pw_model_elements (plots->model, &plots->links);
  if (plots->links > PLOT_DRAWN) plots->links = PLOT_DRAWN;
  plots->sample_size = PLOT_FIRST;
  plot_open_tracks (plots, bodies, pw_system_bodies (plots->system));
  plot_open_tracks (plots, wheels, pw_system_contacts (plots->system));
  plots->sample_size += plots->with_forces ? 2 * plots->links : 0;
  plots->outputs = pw_system_states (plots->system) + pw_system_outputs (plots->system);
  if (plots->outputs > PLOT_OUTPUTS) plots->outputs = PLOT_OUTPUTS;
  plots->sample_size += plots->outputs;
  int most = PLOT_NUMBERS / plots->sample_size;
  plots->planned = 1 + (most < PLOT_FEW ? PLOT_FEW : most < PLOT_INTERVALS ? most : PLOT_INTERVALS);
  plots->body_index = plot_array (plots, bodies->count + 1, sizeof *plots->body_index);
  plots->shape = plot_array (plots, bodies->drawn, sizeof *plots->shape);
  plots->ground = plot_array (plots, PLOT_DRAWN, sizeof *plots->ground);
  plots->disc = plot_array (plots, PLOT_DRAWN, sizeof *plots->disc);
  plots->data = plot_array (plots, plots->planned, (size_t)plots->sample_size * sizeof *plots->data);
  plots->contact = plot_array (plots, wheels->count, sizeof *plots->contact);
  plots->paths = pw_model_reference_text (plots->model)->paths;
  if (plots->paths > PLOT_PATHS) plots->paths = PLOT_PATHS;
  plots->path = plot_array (plots, plots->paths, sizeof *plots->path);
  plots->link = plot_array (plots, plots->links, sizeof *plots->link);
  plots->forces =
      plot_array (plots, plots->with_forces ? pw_system_force_size (plots->system) : 0, sizeof *plots->forces);
  return plots->out_of_memory ? pw_fail (error, PW_RESOURCE, "plots: out of memory") : PW_OK;
}

/* The points of the paths: those of a polyline, unless there are too many; else at equal distances. */
static int plot_find_paths (pw_plots *plots, pw_error *error) {
  const pw_path_text *text = pw_model_reference_text (plots->model)->path;
  for (pw_plot_path *path = plots->path; path < plots->path + plots->paths; path++, text++) {
    pw_path *p = pw_path_open (text->x, text->y, text->count, text->interpolation, text->closed, error);
    pw_path_place at;
    if (p == NULL) return error->status;
    const int corners = text->interpolation == PW_LINEAR ? text->count + (text->closed != 0) : PLOT_PATH + 1;
    path->points = corners > PLOT_PATH ? PLOT_PATH : corners;
    for (int i = 0; i < path->points; i++) {
      pw_path_at (p, pw_path_length (p) * i / (path->points - 1), &at);
      path->point[i][0] = corners > PLOT_PATH ? at.x : text->x[i % text->count];
      path->point[i][1] = corners > PLOT_PATH ? at.y : text->y[i % text->count];
    }
    pw_path_close (p);
  }
  return PW_OK;
}

pw_plots *pw_plots_open (const char *folder, int forces, const pw_model *model, const pw_system *system, double t_end,
                         pw_error *error) {
  pw_plots *plots = malloc (sizeof *plots);
  if (plots == NULL) return pw_fail (error, PW_RESOURCE, "plots: out of memory"), NULL;
  *plots = (pw_plots){
    .figures = { .folder = folder, .model = pw_system_name (system), .about = pw_model_table (model)->about },
    .model = model,
    .system = system,
    .t_end = t_end,
    .with_forces = forces
  };
  pw_tracks *bodies = &plots->bodies, *wheels = &plots->wheels;
  pw_output *probe = NULL; /* an error before the run if the folder cannot be written */
  if (folder && pw_folder_open (&plots->folder, folder, error) == PW_OK)
    probe = pw_figure_open_data (&plots->figures, "motion.dat", error);
  if (probe) pw_output_discard (probe);
  if ((folder == NULL || probe) && plot_allocate (plots, error) == PW_OK && plot_find_paths (plots, error) == PW_OK)
    plots->workspace = pw_workspace_new (system, error);
  if (plots->workspace == NULL) return pw_plots_close (plots), NULL;
  /* the bodies, and the elements with a contact point, that are drawn, evenly from all */
  for (int b = 0; b < bodies->count; b++) plots->body_index[b] = PLOT_HIDDEN;
  plots->body_index[bodies->count] = PLOT_GROUND;
  for (int i = 0; i < bodies->drawn; i++)
    plots->body_index[bodies->system_index[i] = pw_plot_pick (i, bodies->drawn, bodies->count)] = i;
  for (int e = 0, contacts = 0, i = 0; i < wheels->drawn; e++)
    if (pw_system_element (system, e).contact >= 0 && contacts++ == pw_plot_pick (i, wheels->drawn, wheels->count))
      wheels->system_index[i++] = e;
  pw_plot_find_shapes (plots);
  return plots;
}

int pw_plots_style (pw_plots *plots, const char *width, const char *colour, pw_error *error) {
  plots->by_time = colour && strcmp (colour, "time") == 0;
  if (colour && !plots->by_time && strcmp (colour, "body") != 0)
    return pw_fail (error, PW_INPUT, "--colour %.40s: expected body or time", colour);
  return pw_figure_width (width, &plots->figures.width, error);
}

void pw_plots_close (pw_plots *plots) {
  if (plots == NULL) return;
  if (plots->figures.folder) pw_folder_close (&plots->folder); /* pages have no folders */
  pw_workspace_free (plots->workspace);
  pw_arena_free (&plots->arena);
  free (plots);
}

/* Fx, Fy of each link [N]; 0 if its force is not drawn. */
static void plot_forces (const pw_plots *plots, const pw_sample *sample, double *out) {
  if (pw_workspace_forces (plots->workspace, sample->t, sample->q, sample->v, sample->lambda, plots->forces, NULL) !=
      PW_OK)
    return;
  for (int i = 0; i < plots->links; i++, out += 2) {
    const pw_plot_link *link = &plots->link[i];
    const double *force = plots->forces + link->force_offset, *more = plots->forces + link->companion_offset;
    for (int k = 0; k < 2; k++)
      out[k] = link->force_end < 0 ? 0 : force[k] + (link->companion_offset < 0 ? 0 : more[k]);
  }
}

/* A rectangle [m]. */
typedef struct {
  double x0, x1, y0, y1;
} plot_box;
#define PLOT_EMPTY ((plot_box){ INFINITY, -INFINITY, INFINITY, -INFINITY })

static void box_extend (plot_box *box, const double *point) {
  if (!isfinite (point[0]) || !isfinite (point[1])) return;
  *box = (plot_box){ fmin (box->x0, point[0]), fmax (box->x1, point[0]), fmin (box->y0, point[1]),
                     fmax (box->y1, point[1]) };
}

/* x, y and angle of a disc at sample i, in the inertial frame [m], [rad]. */
static void plot_disc_centre (const pw_plots *plots, int i, const pw_plot_disc *disc, double out[3]) {
  const double *placement =
      disc->body < 0 ? (const double[3]){ 0 } : pw_plot_track (plots, i, &plots->bodies, disc->body);
  pw_plot_point (placement, disc->at, out);
  out[2] = placement[2];
}

/* Extends a box by the discs of the ground, or by those of bodies at sample i. */
static void box_extend_discs (plot_box *box, const pw_plots *plots, int i, int ground) {
  for (const pw_plot_disc *disc = plots->disc; disc < plots->disc + plots->discs; disc++) {
    double at[3], r = disc->at[2];
    if ((disc->body == PLOT_GROUND) != ground) continue;
    plot_disc_centre (plots, i, disc, at);
    box_extend (box, (const double[]){ at[0] - r, at[1] - r });
    box_extend (box, (const double[]){ at[0] + r, at[1] + r });
  }
}

/* The smallest box around the points of the ground. */
static plot_box box_ground (const pw_plots *plots) {
  plot_box box = PLOT_EMPTY;
  for (int g = 0; g < plots->grounds; g++) box_extend (&box, plots->ground[g]);
  box_extend_discs (&box, plots, 0, 1);
  return box;
}

/* Extends a box by points of a body at this placement. */
static void box_extend_points (plot_box *box, const double *placement, const double (*at)[2], int count) {
  for (int n = 0; n < count; n++) {
    double point[2];
    pw_plot_point (placement, at[n], point);
    box_extend (box, point);
  }
}

/* Extends a box by all attachment points, centres of mass and wheels of sample i; returns its diagonal [m]. */
static double box_extend_all (plot_box *box, const pw_plots *plots, int i) {
  for (int k = 0; k < plots->bodies.drawn; k++) {
    const double *motion = pw_plot_track (plots, i, &plots->bodies, k);
    const pw_plot_body *shape = &plots->shape[k];
    box_extend (box, motion);
    box_extend_points (box, motion, (const double (*)[2])shape->attachment, shape->attachments);
    box_extend_points (box, motion, shape->corner, shape->corners);
  }
  for (int w = 0; w < plots->wheels.drawn; w++) box_extend (box, pw_plot_track (plots, i, &plots->wheels, w));
  box_extend_discs (box, plots, i, 0);
  return box->x1 >= box->x0 ? hypot (box->x1 - box->x0, box->y1 - box->y0) : 0;
}

/* The unit of symbols, relative to the size of the mechanism or, if that is less, 4 times the reach of its bodies. */
#define SHAPES_UNIT 0.035

/* Sets size and symbol_unit from the first sample. */
static void plot_measure (pw_plots *plots) {
  plot_box box = box_ground (plots);
  double reach = 0, size = box_extend_all (&box, plots, 0); /* reach: farthest point of a body */
  for (const pw_plot_body *shape = plots->shape; shape < plots->shape + plots->bodies.drawn; shape++) {
    for (int k = 0; k < shape->attachments; k++)
      reach = fmax (reach, hypot (shape->attachment[k][0], shape->attachment[k][1]));
    for (int k = 0; k < shape->corners; k++) reach = fmax (reach, hypot (shape->corner[k][0], shape->corner[k][1]));
  }
  for (const pw_plot_disc *disc = plots->disc; disc < plots->disc + plots->discs; disc++)
    if (disc->body >= 0) reach = fmax (reach, hypot (disc->at[0], disc->at[1]) + disc->at[2]);
  plots->size = size > 0 ? size : pw_system_length (plots->system);
  plots->symbol_unit = SHAPES_UNIT * (reach > 0 ? fmin (plots->size, 4 * reach) : plots->size);
}

double pw_plots_next (const pw_plots *plots) {
  if (plots->samples == plots->planned) return INFINITY;
  return plots->samples + 1 == plots->planned ? plots->t_end : plots->t_end * plots->samples / (plots->planned - 1);
}

void pw_plots_add (pw_plots *plots, const pw_sample *sample) {
  if (plots->samples == plots->planned) return;
  int i = plots->samples++;
  const double first[] = { sample->t,    sample->kinetic,    sample->potential, sample->work,
                           sample->loss, sample->projection, sample->balance };
  memcpy (pw_plot_sample (plots, i), first, sizeof first);
  for (int b = 0; b < plots->bodies.drawn; b++) {
    double *motion = pw_plot_track (plots, i, &plots->bodies, b);
    memcpy (motion, sample->q + 3 * plots->bodies.system_index[b], 3 * sizeof *motion);
    memcpy (motion + 3, sample->v + 3 * plots->bodies.system_index[b], 3 * sizeof *motion);
  }
  /* the status is PW_OK: the sample needed the same evaluation */
  if (plots->wheels.drawn)
    pw_workspace_contact_points (plots->workspace, sample->t, sample->q, sample->v, plots->contact, NULL);
  for (int w = 0; w < plots->wheels.drawn; w++)
    memcpy (pw_plot_track (plots, i, &plots->wheels, w),
            plots->contact[pw_system_element (plots->system, plots->wheels.system_index[w]).contact],
            sizeof *plots->contact);
  const int states = pw_system_states (plots->system);
  const double *state = sample->v + pw_system_coordinates (plots->system) - states;
  for (int o = 0; o < plots->outputs; o++)
    pw_plot_sample (plots, i)[plots->sample_size - plots->outputs + o] = o < states       ? state[o]
                                                                         : sample->output ? sample->output[o - states]
                                                                                          : NAN;
  if (i == 0) plot_measure (plots);
  if (plots->with_forces && plots->links > 0)
    plot_forces (plots, sample, pw_plot_track (plots, i, &plots->wheels, plots->wheels.drawn));
}

void pw_plots_last (pw_plots *plots, const pw_sample *sample) {
  if (plots->samples == 0 || pw_plot_sample (plots, plots->samples - 1)[PLOT_T] < sample->t)
    pw_plots_add (plots, sample);
  plots->planned = plots->samples;
}

void pw_plots_events (pw_plots *plots, const pw_run *run) {
  const pw_event *event = pw_run_events (run, &plots->events);
  plots->event = pw_arena_alloc (&plots->arena, (size_t)plots->events * sizeof *plots->event);
  if (plots->event == NULL) plots->events = 0;
  for (int i = 0; i < plots->events; i++) { /* those of a companion: of the element that it accompanies */
    const int row = event[i].row;
    const pw_element_info own = pw_system_element (plots->system, pw_system_row_element (plots->system, row));
    const pw_plot_link *link = pw_plot_accompanied (plots, &own);
    plots->event[i] = event[i];
    plots->event[i].row = link ? pw_system_element (plots->system, link->element).row : row;
  }
}

void pw_plots_serialise (pw_plots *plots, pw_archive *archive) {
  int samples = plots->samples;
  pw_archive_bytes (archive, &samples, sizeof samples);
  if (samples < 0 || samples > plots->planned) archive->failed = 1;
  if (archive->failed) return;
  plots->samples = samples;
  pw_archive_bytes (archive, plots->data, (size_t)samples * (size_t)plots->sample_size * sizeof *plots->data);
  if (samples > 0) plot_measure (plots);
}

/* The figures of a run: data files, plain columns with a comment line of names and units at the top, and scripts. */

enum {
  FIGURES_NAMED = 12,     /* curves with a name each, at most */
  FIGURES_COLOURS = 8,    /* of bodies */
  FIGURES_SNAPSHOTS = 60, /* at most, before their stride is rounded down */
  FIGURES_FEWEST = 8,     /* snapshots, at least */
  FIGURES_CLOSEUP = 12,   /* samples of a close-up, at least */
  FIGURES_SIDES = 96      /* of the polygon of a disc */
};
#define FIGURES_FAR 10    /* extent of a motion with a close-up, at least, in sizes of the mechanism (pw_plots.size) */
#define FIGURES_NEAR 4    /* extent of the close-up, at most, in sizes of the mechanism */
#define FIGURES_WHEEL 1.6 /* half the length of a wheel, in units of symbols */

/* Numbers separated by spaces, then an end. */
static void data_row (FILE *f, const double *value, int count, const char *end) {
  for (int i = 0; i < count; i++) fprintf (f, "%s%s", i ? " " : "", PW_DIGITS (value[i], 10));
  fputs (end, f);
}

/* Number of initial samples in a close-up, a separate panel for a mechanism that travels so far that it is small in a
 * figure of the whole run; 0: none.  A single point has no size. */
static int data_closeup (const pw_plots *plots) {
  plot_box all = box_ground (plots), first = PLOT_EMPTY;
  double diagonal = 0;
  int n = 0, extended = plots->wheels.drawn > 0;
  for (int b = 0; b < plots->bodies.drawn; b++)
    extended |= plots->shape[b].attachments > 0 || plots->shape[b].corners > 0;
  if (!extended) return 0;
  for (int i = 0; i < plots->samples; i++) diagonal = box_extend_all (&all, plots, i);
  if (diagonal < FIGURES_FAR * plots->size) return 0;
  while (n < plots->samples && box_extend_all (&first, plots, n) <= FIGURES_NEAR * plots->size) n++;
  return n < FIGURES_CLOSEUP ? 0 : n;
}

/* One block per curve: time, the numbers of the body or wheel, its number among all of them, from 1. */
static int data_tracks (const pw_plots *plots, const pw_tracks *tracks, pw_error *error) {
  pw_output *o = tracks->curves ? pw_figure_open_data (&plots->figures, tracks->file, error) : NULL;
  if (o == NULL) return tracks->curves ? PW_RESOURCE : PW_OK;
  FILE *out = pw_output_stream (o);
  for (int c = 0; c < tracks->curves; c++) {
    int k = pw_plot_pick (c, tracks->curves, tracks->drawn);
    fprintf (out, "%s# %s: %s, number\n", c ? "\n\n" : "", pw_plot_name (plots, tracks, k), tracks->columns);
    for (int i = 0; i < plots->samples; i++) {
      data_row (out, pw_plot_sample (plots, i), 1, " ");
      data_row (out, pw_plot_track (plots, i, tracks, k), tracks->numbers, " ");
      fprintf (out, "%d\n", pw_plot_pick (k, tracks->drawn, tracks->count) + 1);
    }
  }
  return pw_output_finish (o, error);
}

/* ---- The mechanism: lines "x y t body", blank ones between polygons; body: from 1; 0: element; -1: not drawn ---- */

static void data_vertex (FILE *f, const double *at, double t, int body, const char *end) {
  data_row (f, (const double[]){ at[0], at[1], t, body + 1 }, 4, end);
}

static void data_segment (FILE *f, const double *from, const double *to, double t, int body) {
  data_vertex (f, from, t, body, "\n");
  data_vertex (f, to, t, body, "\n\n");
}

/* Discs of sample i: polygons, those of bodies with a line from the centre, which shows that they turn. */
static void data_discs (FILE *f, const pw_plots *plots, int i) {
  double t = pw_plot_sample (plots, i)[PLOT_T], at[3], point[2];
  for (const pw_plot_disc *disc = plots->disc; disc < plots->disc + plots->discs; disc++) {
    plot_disc_centre (plots, i, disc, at);
    if (disc->body >= 0) data_vertex (f, at, t, disc->body, "\n");
    for (int k = 0; k <= FIGURES_SIDES; k++) {
      pw_plot_point (at,
                     (const double[]){ disc->at[2] * cos (k * 2 * PW_PI / FIGURES_SIDES),
                                       disc->at[2] * sin (k * 2 * PW_PI / FIGURES_SIDES) },
                     point);
      data_vertex (f, point, t, disc->body, k < FIGURES_SIDES ? "\n" : "\n\n");
    }
  }
}

/* Bodies of sample i: their discs, their outlines, and lines from the centre of mass to the attachment points inside,
 * all of them if there is no outline. */
static void data_bodies (FILE *f, const pw_plots *plots, int i) {
  double t = pw_plot_sample (plots, i)[PLOT_T], point[2];
  data_discs (f, plots, i);
  for (int b = 0; b < plots->bodies.drawn; b++) {
    const pw_plot_body *shape = &plots->shape[b];
    const double *motion = pw_plot_track (plots, i, &plots->bodies, b);
    for (int k = 0; k <= shape->corners && shape->corners; k++) {
      pw_plot_point (motion, shape->corner[k % shape->corners], point);
      data_vertex (f, point, t, b, k < shape->corners ? "\n" : "\n\n");
    }
    for (int k = 0; k < shape->attachments; k++) {
      if (!pw_plot_inside (shape, k)) continue;
      pw_plot_point (motion, shape->attachment[k], point);
      data_segment (f, motion, point, t, b);
    }
  }
}

/* Wheels of sample i: lines along their headings. */
static void data_wheels (FILE *f, const pw_plots *plots, int i) {
  for (int w = 0; w < plots->wheels.drawn; w++) {
    if (!pw_plot_rolls (plots, w)) continue;
    const double *contact = pw_plot_track (plots, i, &plots->wheels, w), half = FIGURES_WHEEL * plots->symbol_unit;
    double end[2][2];
    pw_plot_point (contact, (const double[]){ -half, 0 }, end[0]);
    pw_plot_point (contact, (const double[]){ half, 0 }, end[1]);
    data_segment (f, end[0], end[1], pw_plot_sample (plots, i)[PLOT_T],
                  plots->body_index[pw_system_element (plots->system, plots->wheels.system_index[w]).body[0]]);
  }
}

/* Bodies of sample i that are points: without attachment points, or with mass but no inertia. */
static void data_centres (FILE *f, const pw_plots *plots, int i) {
  for (int b = 0; b < plots->bodies.drawn; b++)
    if ((plots->shape[b].attachments == 0 && plots->shape[b].corners == 0) || plots->shape[b].is_point_mass)
      data_vertex (f, pw_plot_track (plots, i, &plots->bodies, b), pw_plot_sample (plots, i)[PLOT_T], b, "\n");
}

/* Massless straight elements such as rods at sample i: their symbols begin with a stroke from one end to the other. */
static void data_rods (FILE *f, const pw_plots *plots, int i) {
  double end[2][2];
  for (const pw_plot_link *l = plots->link; l < plots->link + plots->links; l++) {
    if (l->ends != 2 || l->kind->level != PW_HOLONOMIC || !l->kind->symbol ||
        strncmp (l->kind->symbol, "0 0 0 1 0 0", 11) != 0)
      continue;
    for (int n = 0; n < 2; n++) pw_plot_end (plots, i, l, n, end[n]);
    data_segment (f, end[0], end[1], pw_plot_sample (plots, i)[PLOT_T], -1);
  }
}

/* The number of samples from one snapshot to the next, of the first n: the body with the longest path moves by about a
 * third of the size of the mechanism. */
static int data_stride (const pw_plots *plots, int n) {
  double longest = 0;
  for (int b = 0; b < plots->bodies.drawn; b++) {
    double path = 0;
    for (int i = 1; i < n; i++) {
      const double *from = pw_plot_track (plots, i - 1, &plots->bodies, b),
                   *to = pw_plot_track (plots, i, &plots->bodies, b);
      path += hypot (to[0] - from[0], to[1] - from[1]);
    }
    longest = fmax (longest, path);
  }
  int stride = (int)((n - 1) / fmin (fmax (3 * longest / plots->size, FIGURES_FEWEST), FIGURES_SNAPSHOTS));
  return stride < 1 ? 1 : stride;
}

/* Blocks: snapshots out of the first n samples; then the last of these samples; then its symbols, open and closed
 * strokes.  gnuplot does not count blocks without data, so each begins with a point that is not drawn. */
static int data_mechanism (const pw_plots *plots, const char *name, int n, pw_error *error) {
  static const struct {
    const char *title;
    void (*write) (FILE *f, const pw_plots *plots, int i);
  } block[] = {
    { "bodies", data_bodies }, { "wheels", data_wheels }, { "point masses", data_centres }, { "rods", data_rods }
  };
  static const char first[] = "nan nan nan nan\n\n";
  pw_output *o = pw_figure_open_data (&plots->figures, name, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  int stride = data_stride (plots, n);
  for (int last = 0; last < 2; last++)
    for (int k = 0; k < 4; k++) {
      fprintf (f, "%s# %s, %s: x [m], y [m], t [s], number of the body\n%s", last || k ? "\n\n" : "", block[k].title,
               last ? "at the end" : "before", first);
      for (int i = last ? n - 1 : 0; i < n - !last; i += stride) block[k].write (f, plots, i);
    }
  for (int closed = 0; closed < 2; closed++) {
    fprintf (f, "\n\n# symbols, %s\n%s", closed ? "closed" : "open", first);
    for (const pw_plot_link *link = plots->link; link < plots->link + plots->links; link++) {
      pw_plot_stroke stroke[PLOT_STROKES];
      double point[PLOT_VERTICES][2];
      int strokes = pw_plot_strokes (plots, link, n, stroke);
      for (const pw_plot_stroke *s = stroke; s < stroke + strokes; s++) {
        if (s->closed != closed) continue;
        pw_plot_place (plots, n - 1, link, s, point);
        for (int k = 0; k < s->vertices; k++)
          data_vertex (f, point[k], pw_plot_sample (plots, n - 1)[PLOT_T], -1, k < s->vertices - 1 ? "\n" : "\n\n");
      }
    }
  }
  return pw_output_finish (o, error);
}

/* Points of the ground, or of the paths of the model, with blank lines between these. */
static int data_points (const pw_plots *plots, int ground, pw_error *error) {
  if (ground ? plots->grounds == 0 : plots->paths == 0) return PW_OK;
  pw_output *o = pw_figure_open_data (&plots->figures, ground ? "ground.dat" : "model-paths.dat", error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  fprintf (f, "# %s: x [m], y [m]\n", ground ? "points of the ground" : "paths of the model");
  for (int i = 0; ground && i < plots->grounds; i++) data_row (f, plots->ground[i], 2, "\n");
  for (const pw_plot_path *path = plots->path; !ground && path < plots->path + plots->paths; path++)
    for (int i = 0; i < path->points; i++) data_row (f, path->point[i], 2, i < path->points - 1 ? "\n" : "\n\n");
  return pw_output_finish (o, error);
}

/* ---- Scripts of paths and mechanism ---- */

static int figures_write (const pw_plots *plots, const char *name, int closeup, pw_error *error) {
  const int mechanism = strcmp (name, "mechanism") == 0;
  pw_output *o = pw_figure_begin (&plots->figures, name, error);
  if (o == NULL) return PW_RESOURCE;
  FILE *f = pw_output_stream (o);
  fprintf (f, "t_end = %.9g\nt_closeup = %.9g\n", pw_plot_sample (plots, plots->samples - 1)[PLOT_T],
           closeup > 0 ? pw_plot_sample (plots, closeup - 1)[PLOT_T] : 0);
  const pw_tracks *tracks = plots->wheels.drawn ? &plots->wheels : &plots->bodies;
  pw_figure_text (f, "data", tracks->file);
  pw_figure_text (f, "what", tracks->noun);
  fprintf (f, "curves = %d\nnumbers = %d\nnumber_column = %d\narray label[%d]\n", tracks->curves, tracks->count,
           tracks->numbers + 2, tracks->curves);
  for (int i = 0; i < tracks->curves && tracks->curves <= FIGURES_NAMED; i++) /* labels unless there are too many */
    pw_figure_text (f, PW_PRINTED (30, "label[%d]", i + 1), pw_plot_name (plots, tracks, i));
  fputs ("markers = '", f); /* which of the curves, from 0, are paths of markers */
  for (int i = 0; i < tracks->curves && tracks == &plots->wheels; i++)
    if (!pw_plot_rolls (plots, pw_plot_pick (i, tracks->curves, tracks->drawn))) fprintf (f, "%d ", i);
  fputs ("'\n", f);
  fprintf (f, "ground = %d\nby_time = %d\nmodel_paths = %d\n", plots->grounds > 0, plots->by_time, plots->paths);
  if (!mechanism) return pw_figure_end (o, name, error);
  /* the names of bodies unless there are too many, and the colours of those with an area, 0: of the ground */
  int bodies = plots->bodies.drawn, named = bodies <= FIGURES_NAMED ? bodies : 0, area[FIGURES_COLOURS + 1] = { 0 };
  fprintf (f, "bodies = %d\narray body[%d]\n", named, bodies);
  for (int b = 0; b < bodies; b++) area[b % FIGURES_COLOURS + 1] |= plots->shape[b].corners > 0;
  for (int d = 0; d < plots->discs; d++)
    area[plots->disc[d].body < 0 ? 0 : plots->disc[d].body % FIGURES_COLOURS + 1] = 1;
  fputs ("areas = '", f);
  for (int c = 0; c <= FIGURES_COLOURS; c++)
    if (area[c]) fprintf (f, "%d ", c);
  fputs ("'\n", f);
  for (int b = 0; b < named; b++)
    pw_figure_text (f, PW_PRINTED (30, "body[%d]", b + 1), pw_plot_name (plots, &plots->bodies, b));
  return pw_figure_end (o, name, error);
}

/* ---- Curves over time ---- */

int pw_plot_marked (const pw_plots *plots, int row, int *end) {
  const int rows = pw_system_rows (plots->system);
  for (; row < rows; row = *end) {
    char element[PW_NAME_BYTES];
    int marked = 0;
    pw_system_row_name (plots->system, row, element, sizeof element);
    for (*end = row + 1; *end < rows; ++*end)
      if (strcmp (PW_NAME (pw_system_row_name, plots->system, *end), element) != 0) break;
    for (const pw_event *e = plots->event; e < plots->event + plots->events; e++)
      marked |= e->row >= row && e->row < *end;
    if (marked) return row;
  }
  return -1;
}

/* A panel from a time to the end of the run; number: the label of a scale of colours, or NULL. */
static void figures_panel (pw_curves *c, const pw_plots *plots, const char *label, double from, const char *number) {
  const double t_end = pw_plot_sample (plots, plots->samples - 1)[PLOT_T];
  pw_curves_panel (c, &(pw_panel){ .x_label = "t [s]",
                                   .y_label = label,
                                   .z_label = number,
                                   .x = { from, t_end },
                                   .type = from == 0 ? PW_PANEL_BELOW : 0 });
}

static void figures_events (pw_curves *c, const pw_plots *plots) {
  for (int end, row = 0; (row = pw_plot_marked (plots, row, &end)) >= 0; row = end) {
    pw_curves_add (c, "event", PW_NAME (pw_system_row_name, plots->system, row));
    for (const pw_event *e = plots->event; e < plots->event + plots->events; e++)
      if (e->row >= row && e->row < end) pw_curves_point (c, e->t, INFINITY, 0);
  }
}

static void figures_curve (pw_curves *c, const pw_plots *plots, const char *label, int place, int number) {
  pw_curves_add (c, number ? "graded" : "line", label);
  for (int i = 0; i < plots->samples; i++)
    pw_curves_point (c, pw_plot_sample (plots, i)[PLOT_T], pw_plot_sample (plots, i)[place], number);
}

/* A panel with a curve of a number of each body; more than FIGURES_NAMED curves are coloured by the body's number. */
static void figures_bodies (pw_curves *c, const pw_plots *plots, const char *label, int number, double from) {
  const pw_tracks *bodies = &plots->bodies;
  const int named = bodies->curves <= FIGURES_NAMED;
  figures_panel (c, plots, label, from, named ? NULL : "number of the body");
  for (int i = 0; i < bodies->curves; i++) {
    const int k = pw_plot_pick (i, bodies->curves, bodies->drawn);
    figures_curve (c, plots, named ? pw_plot_name (plots, bodies, k) : NULL,
                   bodies->offset + bodies->numbers * k + number,
                   named ? 0 : pw_plot_pick (k, bodies->drawn, bodies->count) + 1);
  }
  figures_events (c, plots);
}

/* The part of the run, 0 to 1, that shows angular velocities which oscillate often in detail: with at most 12 extrema,
 * but not less than 2 %; 0: they do not. */
static double figures_detail (const pw_plots *plots) {
  int most = 0;
  for (int i = 0; i < plots->bodies.curves; i++) {
    const int place =
        plots->bodies.offset + plots->bodies.numbers * pw_plot_pick (i, plots->bodies.curves, plots->bodies.drawn) + 5;
    double largest = 0, sign = 0;
    int extrema = 0;
    for (int k = 0; k < plots->samples; k++) largest = fmax (largest, fabs (pw_plot_sample (plots, k)[place]));
    for (int k = 1; k < plots->samples; k++) {
      const double change = pw_plot_sample (plots, k)[place] - pw_plot_sample (plots, k - 1)[place];
      if (fabs (change) <= 1e-6 * largest) continue; /* round-off */
      extrema += change * sign < 0;
      sign = change;
    }
    if (extrema > most) most = extrema;
  }
  return most < 30 ? 0 : most <= 60 ? 0.2 : most <= 120 ? 0.1 : most <= 240 ? 0.05 : 0.02;
}

static void figures_velocities (pw_curves *c, const pw_plots *plots) {
  figures_bodies (c, plots, "vx [m/s]", 3, 0);
  figures_bodies (c, plots, "vy [m/s]", 4, 0);
}

static void figures_angular (pw_curves *c, const pw_plots *plots) {
  const double detail = figures_detail (plots), t_end = pw_plot_sample (plots, plots->samples - 1)[PLOT_T];
  figures_bodies (c, plots, "ω [rad/s]", 5, 0);
  if (detail > 0) figures_bodies (c, plots, "ω [rad/s]", 5, t_end * (1 - detail));
}

static void figures_energy (pw_curves *c, const pw_plots *plots) {
  static const struct {
    const char *label;
    int place, optional;
  } curve[] = { { "kinetic", PLOT_KINETIC, 0 },
                { "potential", PLOT_POTENTIAL, 1 },
                { "dissipated", PLOT_LOSS, 1 },
                { "work", PLOT_WORK, 0 } };
  figures_panel (c, plots, "energy, work [J]", 0, NULL);
  for (int k = 0; k < 4; k++) {
    int shown = !curve[k].optional;
    for (int i = 0; i < plots->samples; i++) shown |= pw_plot_sample (plots, i)[curve[k].place] != 0;
    if (shown) figures_curve (c, plots, curve[k].label, curve[k].place, 0);
  }
  figures_events (c, plots);
  figures_panel (c, plots, "balance [J]", 0, NULL);
  figures_curve (c, plots, NULL, PLOT_BALANCE, 0);
  figures_events (c, plots);
}

const char *pw_plot_output (const pw_plots *plots, int o, char buffer[PW_NAME_BYTES], const char **unit) {
  const pw_system *s = plots->system;
  const int states = pw_system_states (s), state = 2 * pw_system_coordinates (s) - states + o;
  *unit = o < states ? pw_system_state_unit (s, state) : pw_system_output_unit (s, o - states);
  return o < states ? pw_system_state_name (s, state, buffer, PW_NAME_BYTES) : pw_system_output_name (s, o - states);
}

/* A panel for each first-order state and output; no figure without them. */
static void figures_outputs (pw_curves *c, const pw_plots *plots) {
  for (int o = 0; o < plots->outputs; o++) {
    char buffer[PW_NAME_BYTES];
    const char *unit, *name = pw_plot_output (plots, o, buffer, &unit);
    figures_panel (c, plots, PW_FIGURE_LABEL (name, unit), 0, NULL);
    figures_curve (c, plots, NULL, plots->sample_size - plots->outputs + o, 0);
    figures_events (c, plots);
  }
}

int pw_plots_finish (pw_plots *plots, int draw, pw_error *error) {
  const char *names[] = { "paths", "mechanism", "velocities", "angular", "energy", plots->outputs ? "outputs" : NULL,
                          NULL };
  static void (*const curves[]) (pw_curves * c, const pw_plots *plots) = { figures_velocities, figures_angular,
                                                                           figures_energy, figures_outputs };
  const char *folder = plots->figures.folder;
  if (folder == NULL) return PW_OK;
  if (plots->samples < 2) {
    pw_cli_say ("pinwheel: the run is too short for figures: none are drawn in %s\n", folder);
    return PW_OK;
  }
  if (plots->samples < plots->planned)
    snprintf (plots->figures.incomplete, sizeof plots->figures.incomplete, ", incomplete: up to t = %s s of %s s",
              PW_DIGITS (pw_plot_sample (plots, plots->samples - 1)[PLOT_T], 4), PW_DIGITS (plots->t_end, 4));
  int closeup = data_closeup (plots), status = data_tracks (plots, &plots->bodies, error);
  if (status == PW_OK) status = data_tracks (plots, &plots->wheels, error);
  for (int ground = 1; ground >= 0 && status == PW_OK; ground--) status = data_points (plots, ground, error);
  if (status == PW_OK) status = data_mechanism (plots, "mechanism.dat", plots->samples, error);
  if (status == PW_OK && closeup > 0) status = data_mechanism (plots, "mechanism-closeup.dat", closeup, error);
  for (int i = 0; i < 2 && status == PW_OK; i++) status = figures_write (plots, names[i], closeup, error);
  for (int i = 0; i < 4 && status == PW_OK; i++) {
    const char *const title[] = { "velocities of the centres of mass",
                                  figures_detail (plots) > 0 ? "angular velocities, and their last part in detail"
                                                             : "angular velocities",
                                  "energy, work and their balance", "outputs" };
    pw_curves c;
    status = pw_curves_begin (&c, &plots->figures, i < 3 ? names[2 + i] : "outputs", title[i], error);
    if (status == PW_OK) curves[i](&c, plots);
    if (status == PW_OK) status = pw_curves_close (&c, error);
  }
  if (status != PW_OK) return status;
  return draw ? pw_figure_draw (folder, names, error) : pw_figure_undrawn (folder, names, "the run was interrupted");
}
