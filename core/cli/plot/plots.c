/* Samples for figures: equally spaced, of as many bodies and wheels as can be distinguished. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "figure.h"
#include "plot.h"
#include "util.h"

const char *const pw_plot_names[] = { ".dat", ".gp", ".svg", ".png", NULL };

/* ---- Names and families of curves ---- */

static int plots_least (int a, int b) {
  return a < b ? a : b;
}

/* Elements with a contact point, evenly chosen from all. */
static void plots_choose_wheels (pw_plots *p) {
  int n = 0, i = 0;
  for (int e = 0; i < p->wheels; e++)
    if (pw_system_element (p->s, e).contact >= 0 && n++ == pw_plot_pick (i, p->wheels, p->all_wheels))
      p->element[i++] = e;
}

const char *pw_plot_body_name (const pw_plots *p, int body) {
  return pw_system_body_name (p->s, p->body[body]);
}

const char *pw_plot_wheel_name (const pw_plots *p, int wheel) {
  return pw_system_element (p->s, p->element[wheel]).name;
}

int pw_plot_rolls (const pw_plots *p, int wheel) {
  return pw_kind_acts (pw_system_element (p->s, p->element[wheel]).kind);
}

const char *pw_plot_followed (const pw_plots *p) {
  int rolling = 0;
  for (int w = 0; w < p->wheels; w++) rolling += pw_plot_rolls (p, w);
  return p->wheels == 0         ? "paths of the centres of mass"
         : rolling == p->wheels ? "paths of the wheels"
         : rolling > 0          ? "paths of the wheels and markers"
                                : "paths of the markers";
}

pw_curves pw_plot_bodies (const pw_plots *p) {
  int count = plots_least (p->bodies, PLOT_CURVES);
  return (pw_curves){ "motion.dat",
                      "t [s], x [m], y [m], phi [rad], vx [m/s], vy [m/s], omega [rad/s]",
                      "body",
                      count,
                      p->bodies,
                      pw_system_bodies (p->s),
                      6,
                      pw_plot_body_name,
                      pw_plot_motion };
}

pw_curves pw_plot_wheels (const pw_plots *p) {
  int count = plots_least (p->wheels, PLOT_CURVES);
  return (pw_curves){
    "wheels.dat", "t [s], x [m], y [m], heading [rad]", "wheel", count, p->wheels, p->all_wheels, 3, pw_plot_wheel_name,
    pw_plot_wheel
  };
}

/* ---- One allocation ---- */

static void plots_layout (pw_layout *l, pw_plots **plots, const pw_plots *sizes) {
  size_t bodies = (size_t)sizes->bodies, wheels = (size_t)sizes->wheels;
  pw_plots *p = pw_take (l, 1, sizeof *p), none;
  if (p == NULL) p = &none;
  *p = *sizes;
  p->body = pw_take (l, bodies, sizeof *p->body);
  p->element = pw_take (l, wheels, sizeof *p->element);
  p->shape = pw_take (l, bodies, sizeof *p->shape);
  p->ground = pw_take (l, PLOT_SHOWN, sizeof *p->ground);
  p->data = pw_take (l, (size_t)p->wanted * (size_t)p->width, sizeof *p->data);
  p->contact = pw_take (l, (size_t)p->all_wheels, sizeof *p->contact);
  p->link = pw_take (l, (size_t)p->links, sizeof *p->link);
  p->forces = pw_take (l, p->links ? (size_t)pw_system_force_size (p->s) : 0, sizeof *p->forces);
  *plots = p == &none ? NULL : p;
}

static pw_plots *plots_allocate (const pw_plots *sizes, pw_error *error) {
  pw_layout l = { NULL, 0 };
  pw_plots *p;
  plots_layout (&l, &p, sizes);
  l = (pw_layout){ calloc (1, l.used), 0 };
  if (l.base == NULL) {
    pw_fail (error, PW_RESOURCE, "plots: out of memory");
    return NULL;
  }
  plots_layout (&l, &p, sizes);
  return p;
}

/* Reports a folder that cannot be written before the run. */
static int plots_try_folder (pw_plots *p, pw_error *error) {
  const pw_figures f = { .folder = p->folder };
  p->lock = pw_figure_folder (p->folder, error);
  pw_output *probe = p->lock < 0 ? NULL : pw_figure_data (&f, "motion.dat", error);
  if (probe) pw_output_discard (probe);
  return probe ? PW_OK : error->status;
}

pw_plots *pw_plots_open (const char *folder, int forces, const pw_model *m, const pw_system *s, double t_end,
                         pw_error *error) {
  pw_plots sizes = { .folder = folder, .lock = -1, .model = pw_system_name (s), .s = s, .t_end = t_end };
  int elements;
  pw_model_elements (m, &elements);
  sizes.bodies = plots_least (pw_system_bodies (s), PLOT_SHOWN);
  sizes.all_wheels = pw_system_contacts (s);
  sizes.wheels = plots_least (sizes.all_wheels, PLOT_SHOWN);
  sizes.links = forces ? plots_least (elements, PLOT_SHOWN) : 0;
  sizes.width = PLOT_FIRST + 6 * sizes.bodies + 3 * sizes.wheels + 2 * sizes.links;
  sizes.wanted = plots_least (PLOT_SAMPLES, PLOT_NUMBERS / sizes.width);
  if (sizes.wanted < PLOT_FEW) sizes.wanted = PLOT_FEW;
  sizes.wanted++; /* both ends */
  pw_plots *p = NULL;
  if (folder == NULL || plots_try_folder (&sizes, error) == PW_OK) p = plots_allocate (&sizes, error);
  if (p == NULL && sizes.lock >= 0) close (sizes.lock);
  if (p == NULL) return NULL;
  for (int i = 0; i < p->bodies; i++) p->body[i] = pw_plot_pick (i, p->bodies, pw_system_bodies (s));
  p->workspace = pw_workspace_new (s, error);
  plots_choose_wheels (p);
  pw_plot_find_links (p, m);
  if (p->workspace && pw_plot_find_shapes (p, m, error) == PW_OK) return p;
  pw_plots_close (p);
  return NULL;
}

void pw_plots_close (pw_plots *p) {
  if (p && p->lock >= 0) close (p->lock);
  if (p) pw_workspace_free (p->workspace);
  free (p);
}

/* ---- Samples ---- */

double pw_plots_next (const pw_plots *p) {
  if (p->samples == p->wanted) return INFINITY;
  return p->samples + 1 == p->wanted ? p->t_end : p->t_end * p->samples / (p->wanted - 1);
}

static void plots_contacts (const pw_plots *p, const pw_sample *x, double *out) {
  if (pw_workspace_contact_points (p->workspace, x->t, x->q, x->v, p->contact, NULL) != PW_OK)
    return; /* already taken */
  for (int i = 0; i < p->wheels; i++, out += 3)
    memcpy (out, p->contact[pw_system_element (p->s, p->element[i]).contact], 3 * sizeof *out);
}

void pw_plots_add (pw_plots *p, const pw_sample *sample) {
  if (p->samples == p->wanted) return;
  int i = p->samples++;
  double *to = pw_plot_sample (p, i);
  to[PLOT_T] = sample->t;
  to[PLOT_KINETIC] = sample->kinetic;
  to[PLOT_POTENTIAL] = sample->potential;
  to[PLOT_WORK] = sample->work;
  to[PLOT_LOSS] = sample->loss;
  to[PLOT_PROJECTION] = sample->projection;
  to[PLOT_BALANCE] = sample->balance;
  for (int b = 0; b < p->bodies; b++) {
    double *motion = pw_plot_motion (p, i, b);
    memcpy (motion, sample->q + 3 * p->body[b], 3 * sizeof *motion);
    memcpy (motion + 3, sample->v + 3 * p->body[b], 3 * sizeof *motion);
  }
  if (p->wheels > 0) plots_contacts (p, sample, pw_plot_wheel (p, i, 0));
  if (p->links > 0) pw_plot_forces (p, sample, pw_plot_force (p, i, 0));
}

void pw_plots_serialise (pw_plots *p, pw_archive *a) {
  int samples = p->samples;
  pw_archive_bytes (a, &samples, sizeof samples);
  if (samples < 0 || samples > p->wanted) a->failed = 1;
  if (a->failed) return;
  p->samples = samples;
  pw_archive_bytes (a, p->data, (size_t)samples * (size_t)p->width * sizeof *p->data);
}
