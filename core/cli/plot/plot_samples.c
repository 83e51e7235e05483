/* Samples for figures: equally spaced in time, for a limited number of bodies and wheels. */
#include "plot.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *pw_plot_name (const pw_plots *plots, const pw_tracks *tracks, int k) {
  return tracks == &plots->bodies ? pw_system_body_name (plots->system, tracks->system_index[k])
                                  : pw_system_element (plots->system, tracks->system_index[k]).name;
}

int pw_plot_rolls (const pw_plots *plots, int wheel) {
  return pw_kind_acts (pw_system_element (plots->system, plots->wheels.system_index[wheel]).kind);
}

/* ---- Opening ---- */

/* A zeroed array; NULL, with plots->out_of_memory set. */
static void *plot_array (pw_plots *plots, int count, size_t size) {
  void *array = pw_arena_alloc (&plots->arena, (size_t)count * size);
  if (array == NULL) plots->out_of_memory = 1;
  return array;
}

/* Makes room for the numbers of tracks in a sample. */
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
  int most = PLOT_NUMBERS / plots->sample_size;
  plots->planned = 1 + (most < PLOT_FEW ? PLOT_FEW : most < PLOT_INTERVALS ? most : PLOT_INTERVALS);
  plots->body_index = plot_array (plots, bodies->count + 1, sizeof *plots->body_index);
  plots->shape = plot_array (plots, bodies->drawn, sizeof *plots->shape);
  plots->ground = plot_array (plots, PLOT_DRAWN, sizeof *plots->ground);
  plots->data = plot_array (plots, plots->planned, (size_t)plots->sample_size * sizeof *plots->data);
  plots->contact = plot_array (plots, wheels->count, sizeof *plots->contact);
  plots->link = plot_array (plots, plots->links, sizeof *plots->link);
  plots->forces =
      plot_array (plots, plots->with_forces ? pw_system_force_size (plots->system) : 0, sizeof *plots->forces);
  return plots->out_of_memory ? pw_fail (error, PW_RESOURCE, "plots: out of memory") : PW_OK;
}

/* Chooses the bodies, and the elements with a contact point, that are drawn, evenly from all. */
static void plot_choose (pw_plots *plots) {
  for (int b = 0; b < plots->bodies.count; b++) plots->body_index[b] = PLOT_HIDDEN;
  plots->body_index[plots->bodies.count] = PLOT_GROUND;
  for (int i = 0; i < plots->bodies.drawn; i++) {
    plots->bodies.system_index[i] = pw_plot_pick (i, plots->bodies.drawn, plots->bodies.count);
    plots->body_index[plots->bodies.system_index[i]] = i;
  }
  for (int e = 0, contacts = 0, i = 0; i < plots->wheels.drawn; e++)
    if (pw_system_element (plots->system, e).contact >= 0 &&
        contacts++ == pw_plot_pick (i, plots->wheels.drawn, plots->wheels.count))
      plots->wheels.system_index[i++] = e;
}

/* Locks the folder; an error before the run if it cannot be written. */
static int plot_try_folder (pw_plots *plots, pw_error *error) {
  if (pw_folder_open (&plots->folder, plots->figures.folder, error) != PW_OK) return error->status;
  pw_output *probe = pw_figure_open_data (&plots->figures, "motion.dat", error);
  if (probe) pw_output_discard (probe);
  return probe ? PW_OK : error->status;
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
  if ((folder == NULL || plot_try_folder (plots, error) == PW_OK) && plot_allocate (plots, error) == PW_OK)
    plots->workspace = pw_workspace_new (system, error);
  if (plots->workspace) {
    plot_choose (plots);
    pw_plot_find_shapes (plots);
    return plots;
  }
  pw_plots_close (plots);
  return NULL;
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

/* ---- Samples ---- */

double pw_plots_next (const pw_plots *plots) {
  if (plots->samples == plots->planned) return INFINITY;
  return plots->samples + 1 == plots->planned ? plots->t_end : plots->t_end * plots->samples / (plots->planned - 1);
}

static void plot_contacts (const pw_plots *plots, const pw_sample *sample, double *out) {
  if (pw_workspace_contact_points (plots->workspace, sample->t, sample->q, sample->v, plots->contact, NULL) != PW_OK)
    return; /* does not happen: the sample needed the same evaluation */
  for (int i = 0; i < plots->wheels.drawn; i++, out += 3)
    memcpy (out, plots->contact[pw_system_element (plots->system, plots->wheels.system_index[i]).contact],
            3 * sizeof *out);
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
  if (plots->wheels.drawn > 0) plot_contacts (plots, sample, pw_plot_track (plots, i, &plots->wheels, 0));
  if (i == 0) pw_plot_measure (plots);
  if (plots->with_forces && plots->links > 0)
    pw_plot_forces (plots, sample, pw_plot_track (plots, i, &plots->wheels, plots->wheels.drawn));
}

void pw_plots_serialise (pw_plots *plots, pw_archive *archive) {
  int samples = plots->samples;
  pw_archive_bytes (archive, &samples, sizeof samples);
  if (samples < 0 || samples > plots->planned) archive->failed = 1;
  if (archive->failed) return;
  plots->samples = samples;
  pw_archive_bytes (archive, plots->data, (size_t)samples * (size_t)plots->sample_size * sizeof *plots->data);
  if (samples > 0) pw_plot_measure (plots);
}
