/* What figures keep of a run: evenly spaced samples of as many bodies and wheels as can be told apart. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "model.h"
#include "figure.h"
#include "plot.h"

const char *const pw_plot_names[] = { ".dat", ".gp", ".svg", ".png", NULL };

/* ---- What is drawn ---- */

static int plots_least (int a, int b) {
  return a < b ? a : b;
}

static int plots_count_wheels (const pw_system *s, int *largest) {
  int count = 0;
  *largest = 0;
  for (const pw_slab *k = s->slab; k < s->slab + s->slabs; k++) {
    if (k->kind->contact == NULL) continue;
    count += k->b.count;
    if (k->b.count > *largest) *largest = k->b.count;
  }
  return count;
}

static void plots_choose_wheels (pw_plots *p) {
  for (int i = 0; i < p->wheels; i++) {
    int n = pw_plot_pick (i, p->wheels, p->all_wheels), k = 0;
    while (p->s->slab[k].kind->contact == NULL || n >= p->s->slab[k].b.count) {
      if (p->s->slab[k].kind->contact) n -= p->s->slab[k].b.count;
      k++;
    }
    p->slab[i] = k;
    p->element[i] = n;
  }
}

const char *pw_plot_body_name (const pw_plots *p, int body) {
  return p->s->body_name[p->body[body]];
}

const char *pw_plot_wheel_name (const pw_plots *p, int wheel) {
  return p->s->slab[p->slab[wheel]].name[p->element[wheel]];
}

int pw_plot_rolls (const pw_plots *p, int wheel) {
  return pw_kind_acts (p->s->slab[p->slab[wheel]].kind);
}

const char *pw_plot_followed (const pw_plots *p) {
  int rolling = 0;
  for (int w = 0; w < p->wheels; w++) rolling += pw_plot_rolls (p, w);
  return p->wheels == 0         ? "paths of the centres of mass"
         : rolling == p->wheels ? "paths of the wheels"
         : rolling > 0          ? "paths of the wheels and markers"
                                : "paths of the markers";
}

/* Adds an attachment point unless the body has it already; its centre of mass is drawn anyway. */
static void plots_add_point (pw_plot_body *shape, const double *at) {
  if (shape->count == PLOT_POINTS || (at[0] == 0 && at[1] == 0)) return;
  for (int i = 0; i < shape->count; i++)
    if (shape->at[i][0] == at[0] && shape->at[i][1] == at[1]) return;
  memcpy (shape->at[shape->count++], at, 2 * sizeof *at);
}

/* The points of elements' definitions that go with their bodies. */
static int plots_shapes (pw_plots *p, const pw_model *m, pw_error *error) {
  pw_names shown;
  if (pw_names_open (&shown, (size_t)p->bodies) != PW_OK) return pw_fail (error, PW_MACHINE, "plots: out of memory");
  for (int i = 0; i < p->bodies; i++) pw_names_add (&shown, pw_plot_body_name (p, i), i);
  for (int i = 0; i < m->elements; i++) {
    const pw_element *e = &m->element[i];
    for (int n = 0; n < e->kind->bodies && !e->kind->each_body; n++) {
      const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
      const char *body = *(const char **)pw_field_at (e->kind, e->definition, PW_BODY, n);
      int b = pw_names_find (&shown, body);
      if (at && b >= 0) plots_add_point (&p->shape[b], at);
      if (at && strcmp (body, "ground") == 0 && p->grounds < PLOT_SHOWN)
        memcpy (p->ground[p->grounds++], at, 2 * sizeof *at);
    }
  }
  for (int b = 0; b < p->bodies; b++) pw_plot_outline (&p->shape[b]);
  pw_names_close (&shown);
  return PW_OK;
}

pw_curves pw_plot_bodies (const pw_plots *p) {
  int count = plots_least (p->bodies, PLOT_CURVES);
  return (pw_curves){ "motion.dat",
                      "t [s], x [m], y [m], phi [rad], vx [m/s], vy [m/s], omega [rad/s]",
                      "body",
                      count,
                      p->bodies,
                      p->s->bodies,
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

/* Numbers that the forces of the largest batch fill. */
static size_t plots_largest_force (const pw_system *s) {
  size_t largest = 0;
  for (const pw_slab *k = s->slab; k < s->slab + s->slabs; k++)
    if (k->kind->force && (size_t)k->b.count * (size_t)k->b.cols > largest)
      largest = (size_t)k->b.count * (size_t)k->b.cols;
  return largest;
}

static void plots_layout (pw_layout *l, pw_plots **plots, const pw_plots *sizes, int contacts) {
  size_t bodies = (size_t)sizes->bodies, wheels = (size_t)sizes->wheels;
  pw_plots *p = pw_take (l, 1, sizeof *p), none;
  if (p == NULL) p = &none;
  *p = *sizes;
  p->body = pw_take (l, bodies, sizeof *p->body);
  p->slab = pw_take (l, wheels, sizeof *p->slab);
  p->element = pw_take (l, wheels, sizeof *p->element);
  p->shape = pw_take (l, bodies, sizeof *p->shape);
  p->ground = pw_take (l, PLOT_SHOWN, sizeof *p->ground);
  p->data = pw_take (l, (size_t)p->wanted * (size_t)p->width, sizeof *p->data);
  p->pose = pw_take (l, (size_t)p->s->bodies + 1, sizeof *p->pose);
  p->contact = pw_take (l, 3 * (size_t)contacts, sizeof *p->contact);
  p->link = pw_take (l, (size_t)p->links, sizeof *p->link);
  p->block = pw_take (l, p->links ? plots_largest_force (p->s) : 0, sizeof *p->block);
  *plots = p == &none ? NULL : p;
}

static pw_plots *plots_allocate (const pw_plots *sizes, int contacts, pw_error *error) {
  pw_layout l = { NULL, 0 };
  pw_plots *p;
  plots_layout (&l, &p, sizes, contacts);
  l = (pw_layout){ calloc (1, l.used), 0 };
  if (l.base == NULL) {
    pw_fail (error, PW_MACHINE, "plots: out of memory");
    return NULL;
  }
  plots_layout (&l, &p, sizes, contacts);
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
  int contacts, all = plots_count_wheels (s, &contacts);
  pw_plots sizes = { .folder = folder, .lock = -1, .model = s->model, .s = s, .t_end = t_end };
  sizes.bodies = plots_least (s->bodies, PLOT_SHOWN);
  sizes.all_wheels = all;
  sizes.wheels = plots_least (all, PLOT_SHOWN);
  sizes.links = forces ? plots_least (m->elements, PLOT_SHOWN) : 0;
  sizes.width = PLOT_FIRST + 6 * sizes.bodies + 3 * sizes.wheels + 2 * sizes.links;
  sizes.wanted = plots_least (PLOT_SAMPLES, PLOT_NUMBERS / sizes.width);
  if (sizes.wanted < PLOT_FEW) sizes.wanted = PLOT_FEW;
  sizes.wanted++; /* both ends */
  pw_plots *p = NULL;
  if (folder == NULL || plots_try_folder (&sizes, error) == PW_OK) p = plots_allocate (&sizes, contacts, error);
  if (p == NULL && sizes.lock >= 0) close (sizes.lock);
  if (p == NULL) return NULL;
  for (int i = 0; i < p->bodies; i++) p->body[i] = pw_plot_pick (i, p->bodies, s->bodies);
  plots_choose_wheels (p);
  pw_plot_find_links (p, m);
  if (plots_shapes (p, m, error) == PW_OK) return p;
  pw_plots_close (p);
  return NULL;
}

void pw_plots_close (pw_plots *p) {
  if (p && p->lock >= 0) close (p->lock);
  free (p);
}

/* ---- Samples ---- */

double pw_plots_next (const pw_plots *p) {
  if (p->samples == p->wanted) return INFINITY;
  return p->samples + 1 == p->wanted ? p->t_end : p->t_end * p->samples / (p->wanted - 1);
}

/* Contacts of the wheels, from poses of our own: the system belongs to the run. */
static void plots_contacts (const pw_plots *p, const pw_sample *sample, double *out) {
  const pw_system *s = p->s;
  for (int b = 0; b < s->bodies; b++) {
    const double *q = sample->q + 3 * b, *v = sample->v + 3 * b;
    p->pose[b] = (pw_pose){ q[0], q[1], q[2], cos (q[2]), sin (q[2]), v[0], v[1], v[2] };
  }
  p->pose[s->bodies] = (pw_pose){ .cos = 1 };
  int filled = -1;
  for (int i = 0; i < p->wheels; i++, out += 3) {
    const pw_slab *k = &s->slab[p->slab[i]];
    if (p->slab[i] != filled) {
      pw_batch batch = k->b;
      batch.pose = p->pose;
      batch.q = sample->q + k->own;
      batch.v = sample->v + k->own;
      k->kind->contact (&batch, p->contact);
      filled = p->slab[i];
    }
    memcpy (out, p->contact + 3 * p->element[i], 3 * sizeof *out);
  }
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

void pw_plots_carry (pw_plots *p, pw_archive *a) {
  int samples = p->samples;
  pw_carry (a, &samples, sizeof samples);
  if (samples < 0 || samples > p->wanted) a->failed = 1;
  if (a->failed) return;
  p->samples = samples;
  pw_carry (a, p->data, (size_t)samples * (size_t)p->width * sizeof *p->data);
}
