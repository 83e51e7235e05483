/* Samples for figures: equally spaced in time, for a limited number of bodies and wheels. */
#include "plot.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

const char *pw_plot_name (const pw_plots *p, const pw_tracks *t, int k) {
  return t == &p->bodies ? pw_system_body_name (p->s, t->index[k]) : pw_system_element (p->s, t->index[k]).name;
}

int pw_plot_rolls (const pw_plots *p, int wheel) {
  return pw_kind_acts (pw_system_element (p->s, p->wheels.index[wheel]).kind);
}

/* ---- Opening ---- */

static int plot_least (int a, int b) {
  return a < b ? a : b;
}

/* Makes room for the numbers of tracks in a sample. */
static void plot_tracks (pw_plots *p, pw_tracks *t, int all) {
  t->all = all;
  t->shown = plot_least (all, PLOT_SHOWN);
  t->curves = plot_least (t->shown, PLOT_CURVES);
  t->offset = p->width;
  p->width += t->numbers * t->shown;
  t->index = pw_arena_alloc (&p->arena, (size_t)t->shown * sizeof *t->index);
}

static int plot_allocate (pw_plots *p, pw_error *error) {
  pw_model_elements (p->m, &p->links);
  p->links = plot_least (p->links, PLOT_SHOWN);
  p->bodies = (pw_tracks){ .file = "motion.dat",
                           .columns = "t [s], x [m], y [m], phi [rad], vx [m/s], vy [m/s], omega [rad/s]",
                           .what = "body",
                           .numbers = 6 };
  p->wheels = (pw_tracks){
    .file = "wheels.dat", .columns = "t [s], x [m], y [m], heading [rad]", .what = "wheel", .numbers = 3
  };
  p->width = PLOT_FIRST;
  plot_tracks (p, &p->bodies, pw_system_bodies (p->s));
  plot_tracks (p, &p->wheels, pw_system_contacts (p->s));
  p->width += p->with_forces ? 2 * p->links : 0;
  p->wanted = PLOT_NUMBERS / p->width;
  p->wanted = 1 + (p->wanted < PLOT_FEW ? PLOT_FEW : plot_least (p->wanted, PLOT_SAMPLES)); /* both ends */
  p->shown = pw_arena_alloc (&p->arena, ((size_t)p->bodies.all + 1) * sizeof *p->shown);
  p->shape = pw_arena_alloc (&p->arena, (size_t)p->bodies.shown * sizeof *p->shape);
  p->ground = pw_arena_alloc (&p->arena, PLOT_SHOWN * sizeof *p->ground);
  p->data = pw_arena_alloc (&p->arena, (size_t)p->wanted * (size_t)p->width * sizeof *p->data);
  p->contact = pw_arena_alloc (&p->arena, (size_t)p->wheels.all * sizeof *p->contact);
  p->link = pw_arena_alloc (&p->arena, (size_t)p->links * sizeof *p->link);
  p->forces = pw_arena_alloc (&p->arena, p->with_forces ? (size_t)pw_system_force_size (p->s) * sizeof *p->forces : 0);
  if (p->bodies.index && p->wheels.index && p->shown && p->shape && p->ground && p->data && p->contact && p->link &&
      p->forces)
    return PW_OK;
  return pw_fail (error, PW_RESOURCE, "plots: out of memory");
}

/* Bodies, and elements with a contact point, evenly chosen from all. */
static void plot_choose (pw_plots *p) {
  for (int b = 0; b < p->bodies.all; b++) p->shown[b] = PLOT_HIDDEN;
  p->shown[p->bodies.all] = PLOT_GROUND;
  for (int i = 0; i < p->bodies.shown; i++) {
    p->bodies.index[i] = pw_plot_pick (i, p->bodies.shown, p->bodies.all);
    p->shown[p->bodies.index[i]] = i;
  }
  for (int e = 0, n = 0, i = 0; i < p->wheels.shown; e++)
    if (pw_system_element (p->s, e).contact >= 0 && n++ == pw_plot_pick (i, p->wheels.shown, p->wheels.all))
      p->wheels.index[i++] = e;
}

/* Reports a folder that cannot be written before the run. */
static int plot_try_folder (pw_plots *p, pw_error *error) {
  p->lock = pw_cli_lock_folder (p->figures.folder, error);
  pw_output *probe = p->lock < 0 ? NULL : pw_figure_data (&p->figures, "motion.dat", error);
  if (probe) pw_output_discard (probe);
  return probe ? PW_OK : error->status;
}

pw_plots *pw_plots_open (const char *folder, int forces, const pw_model *m, const pw_system *s, double t_end,
                         pw_error *error) {
  pw_plots *p = malloc (sizeof *p);
  if (p == NULL) {
    pw_fail (error, PW_RESOURCE, "plots: out of memory");
    return NULL;
  }
  *p = (pw_plots){ .figures = { .folder = folder, .model = pw_system_name (s), .about = pw_model_table (m)->about },
                   .lock = -1,
                   .m = m,
                   .s = s,
                   .t_end = t_end,
                   .with_forces = forces };
  if ((folder == NULL || plot_try_folder (p, error) == PW_OK) && plot_allocate (p, error) == PW_OK)
    p->workspace = pw_workspace_new (s, error);
  if (p->workspace) {
    plot_choose (p);
    pw_plot_find_shapes (p);
    return p;
  }
  pw_plots_close (p);
  return NULL;
}

int pw_plots_style (pw_plots *p, const char *width, const char *colour, pw_error *error) {
  p->by_time = colour && strcmp (colour, "time") == 0;
  if (colour && !p->by_time && strcmp (colour, "body") != 0)
    return pw_fail (error, PW_INPUT, "--colour %.40s: expected body or time", colour);
  return pw_figure_width (width, &p->figures.width, error);
}

void pw_plots_close (pw_plots *p) {
  if (p == NULL) return;
  if (p->lock >= 0) close (p->lock);
  pw_workspace_free (p->workspace);
  pw_arena_free (&p->arena);
  free (p);
}

/* ---- Samples ---- */

double pw_plots_next (const pw_plots *p) {
  if (p->samples == p->wanted) return INFINITY;
  return p->samples + 1 == p->wanted ? p->t_end : p->t_end * p->samples / (p->wanted - 1);
}

static void plot_contacts (const pw_plots *p, const pw_sample *x, double *out) {
  if (pw_workspace_contact_points (p->workspace, x->t, x->q, x->v, p->contact, NULL) != PW_OK)
    return; /* already taken */
  for (int i = 0; i < p->wheels.shown; i++, out += 3)
    memcpy (out, p->contact[pw_system_element (p->s, p->wheels.index[i]).contact], 3 * sizeof *out);
}

void pw_plots_add (pw_plots *p, const pw_sample *x) {
  if (p->samples == p->wanted) return;
  int i = p->samples++;
  const double first[] = { x->t, x->kinetic, x->potential, x->work, x->loss, x->projection, x->balance };
  memcpy (pw_plot_sample (p, i), first, sizeof first);
  for (int b = 0; b < p->bodies.shown; b++) {
    double *motion = pw_plot_track (p, i, &p->bodies, b);
    memcpy (motion, x->q + 3 * p->bodies.index[b], 3 * sizeof *motion);
    memcpy (motion + 3, x->v + 3 * p->bodies.index[b], 3 * sizeof *motion);
  }
  if (p->wheels.shown > 0) plot_contacts (p, x, pw_plot_track (p, i, &p->wheels, 0));
  if (i == 0) pw_plot_measure (p);
  if (p->with_forces && p->links > 0) pw_plot_forces (p, x, pw_plot_track (p, i, &p->wheels, p->wheels.shown));
}

void pw_plots_serialise (pw_plots *p, pw_archive *a) {
  int samples = p->samples;
  pw_archive_bytes (a, &samples, sizeof samples);
  if (samples < 0 || samples > p->wanted) a->failed = 1;
  if (a->failed) return;
  p->samples = samples;
  pw_archive_bytes (a, p->data, (size_t)samples * (size_t)p->width * sizeof *p->data);
  if (samples > 0) pw_plot_measure (p);
}
