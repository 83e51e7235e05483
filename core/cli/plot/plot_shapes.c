/* Shapes of bodies in figures and animations, and the elements drawn between them (links), with their forces. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "plot.h"

/* The unit of symbols, relative to the size of the mechanism or, if that is less, 4 times the reach of its bodies. */
#define SHAPES_UNIT 0.035

/* ---- Outlines ---- */

/* Twice the area of the triangle a b c, positive if they turn to the left. */
static double shapes_doubled_area (const double *a, const double *b, const double *c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Points by x, then y, for qsort. */
static int shapes_order (const void *a, const void *b) {
  const double *p = a, *q = b;
  return p[0] != q[0] ? (p[0] > q[0]) - (p[0] < q[0]) : (p[1] > q[1]) - (p[1] < q[1]);
}

/* The convex hull by monotone chains (Andrew 1979): below from left to right, then above from right to left. */
static void shapes_outline (pw_plot_body *shape) {
  double point[PLOT_ATTACHMENTS + 1][2] = { { 0, 0 } }, hull[2 * PLOT_ATTACHMENTS + 2][2], size = 0;
  int n = shape->attachments + 1, corners = 0;
  memcpy (point + 1, shape->attachment, (size_t)shape->attachments * sizeof *point);
  qsort (point, (size_t)n, sizeof *point, shapes_order);
  for (int i = 0; i < n; i++) size = fmax (size, hypot (point[i][0], point[i][1]));
  for (int i = 0, least = 2; i < 2 * n - 1; i++) {
    const double *next = point[i < n ? i : 2 * n - 2 - i];
    if (i == n) least = corners + 1;
    while (corners >= least && shapes_doubled_area (hull[corners - 2], hull[corners - 1], next) <= 1e-9 * size * size)
      corners--;
    if (i < 2 * n - 2) memcpy (hull[corners++], next, sizeof *hull);
  }
  shape->corners = corners < 3 ? 0 : corners;
  memcpy (shape->corner, hull, (size_t)shape->corners * sizeof *hull);
}

int pw_plot_inside (const pw_plot_body *shape, int k) {
  for (int i = 0; i < shape->corners; i++)
    if (memcmp (shape->corner[i], shape->attachment[k], sizeof shape->attachment[k]) == 0) return 0;
  return 1;
}

/* Adds an attachment point unless it is there already; the centre of mass is always drawn. */
static void shapes_add_point (pw_plot_body *shape, const double *at) {
  if (shape->attachments == PLOT_ATTACHMENTS || (at[0] == 0 && at[1] == 0)) return;
  for (int i = 0; i < shape->attachments; i++)
    if (shape->attachment[i][0] == at[0] && shape->attachment[i][1] == at[1]) return;
  memcpy (shape->attachment[shape->attachments++], at, 2 * sizeof *at);
}

/* The points of an element on the bodies drawn and on the ground. */
static void shapes_add_points (pw_plots *plots, const pw_element *e, const int *bodies) {
  for (int n = 0; n < e->kind->bodies; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int b = plots->body_index[bodies[n]];
    if (at && b >= 0) shapes_add_point (&plots->shape[b], at);
    if (at && b == PLOT_GROUND && plots->grounds < PLOT_DRAWN)
      memcpy (plots->ground[plots->grounds++], at, 2 * sizeof *at);
  }
}

/* ---- Links ---- */

/* Adds an end at the joint of two bodies, the first one's end of an earlier link between them; 0 if there is none. */
static int shapes_add_joint (const pw_plots *plots, int first, int second, pw_plot_link *link) {
  for (const pw_plot_link *l = plots->link; l < plots->link + plots->links; l++)
    for (int n = 0; n < 2 && l->ends == 2 && !l->rail; n++)
      if (l->end[n].body == first && l->end[1 - n].body == second) {
        link->end[link->ends++] = l->end[n];
        return 1;
      }
  return 0;
}

/* Places an element without points at the joints of its bodies with the last one; 0 if it cannot be drawn there. */
static int shapes_at_joints (const pw_plots *plots, const pw_element *e, const int *bodies, pw_plot_link *link) {
  int last = plots->body_index[bodies[e->kind->bodies - 1]];
  for (int n = 0; n < e->kind->bodies - 1 && link->ends < 2; n++)
    if (!shapes_add_joint (plots, plots->body_index[bodies[n]], last, link)) return 0;
  return e->kind->symbol && link->ends > 0;
}

/* 1 if the two points of an element are optional and not given. */
static int shapes_without_points (const pw_element *e) {
  const pw_field *f = e->kind->fields;
  while (f->name && f->type != PW_POINT) f++;
  const double *at =
      f->name && !f->required && f->count == 2 ? pw_field_at (e->kind, e->definition, PW_POINT, 0) : NULL;
  return at && at[0] == 0 && at[1] == 0 && at[2] == 0 && at[3] == 0;
}

/* The index among the wheels drawn of the contact point of an element; -1: none. */
static int shapes_wheel (const pw_plots *plots, int element) {
  int w = 0;
  while (w < plots->wheels.drawn && plots->wheels.system_index[w] != element) w++;
  return w < plots->wheels.drawn ? w : -1;
}

/* Fills a link; 0 if the element has no place, or one of its bodies is not drawn. */
static int shapes_link (const pw_plots *plots, const pw_element *e, int element, pw_plot_link *link) {
  const pw_element_info info = pw_system_element (plots->system, element);
  *link = (pw_plot_link){ .element = element,
                          .kind = e->kind,
                          .definition = e->definition,
                          .rail = e->kind->symbol && strstr (e->kind->symbol, "inf"),
                          .force_end = -1,
                          .wheel = shapes_wheel (plots, element) };
  for (int n = 0; n < e->kind->bodies && link->ends < 2; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int body = plots->body_index[info.body[n]];
    if (at == NULL) continue;
    if (body == PLOT_HIDDEN) return 0;
    if (link->force_end < 0 && body >= 0) link->force_end = link->ends, link->force_offset = info.force + 3 * n;
    link->end[link->ends].body = body;
    memcpy (link->end[link->ends++].at, at, 2 * sizeof *at);
  }
  pw_plot_link joint = *link;
  joint.ends = 0;
  if ((link->ends == 0 || shapes_without_points (e)) && shapes_at_joints (plots, e, info.body, &joint)) {
    *link = joint;
    if (link->force_end >= link->ends) link->force_end = -1; /* the end that is not at the joint */
    return 1;
  }
  return link->force_end >= 0;
}

/* A system has its elements sorted by type; those of a type are in the order of the model. */
void pw_plot_find_shapes (pw_plots *plots) {
  int most = plots->links, elements, next = 0;
  const pw_element *e = pw_model_elements (plots->model, &elements);
  const double *mass = pw_system_mass (plots->system);
  const pw_kind *last = NULL;
  plots->links = 0;
  for (int i = 0; i < pw_system_elements (plots->system); i++) {
    const pw_element_info info = pw_system_element (plots->system, i);
    if (info.kind->each_body) continue;
    if (info.kind != last) next = 0;
    last = info.kind;
    while (e[next].kind != last) next++;
    shapes_add_points (plots, &e[next], info.body);
    if (plots->links < most) plots->links += shapes_link (plots, &e[next], i, &plots->link[plots->links]);
    next++;
  }
  for (int b = 0; b < plots->bodies.drawn; b++) {
    const double *M = mass + 3 * plots->bodies.system_index[b];
    plots->shape[b].is_point_mass = M[0] > 0 && M[2] == 0;
    shapes_outline (&plots->shape[b]);
  }
}

void pw_plot_forces (const pw_plots *plots, const pw_sample *sample, double *out) {
  if (pw_workspace_forces (plots->workspace, sample->t, sample->q, sample->v, sample->lambda, plots->forces, NULL) !=
      PW_OK)
    return;
  for (int i = 0; i < plots->links; i++, out += 2)
    if (plots->link[i].force_end < 0)
      out[0] = out[1] = 0;
    else
      memcpy (out, plots->forces + plots->link[i].force_offset, 2 * sizeof *out);
}

/* ---- Sizes ---- */

void pw_plot_point (const double *placement, const double *at, double out[2]) {
  double c = cos (placement[2]), s = sin (placement[2]);
  out[0] = placement[0] + c * at[0] - s * at[1];
  out[1] = placement[1] + s * at[0] + c * at[1];
}

static void box_extend (pw_plot_box *box, const double *point) {
  if (!isfinite (point[0]) || !isfinite (point[1])) return;
  *box = (pw_plot_box){ fmin (box->x0, point[0]), fmax (box->x1, point[0]), fmin (box->y0, point[1]),
                        fmax (box->y1, point[1]) };
}

pw_plot_box pw_plot_ground (const pw_plots *plots) {
  pw_plot_box box = PLOT_EMPTY;
  for (int g = 0; g < plots->grounds; g++) box_extend (&box, plots->ground[g]);
  return box;
}

double pw_plot_extend (pw_plot_box *box, const pw_plots *plots, int i) {
  for (int k = 0; k < plots->bodies.drawn; k++) {
    const double *motion = pw_plot_track (plots, i, &plots->bodies, k);
    box_extend (box, motion);
    for (int n = 0; n < plots->shape[k].attachments; n++) {
      double point[2];
      pw_plot_point (motion, plots->shape[k].attachment[n], point);
      box_extend (box, point);
    }
  }
  for (int w = 0; w < plots->wheels.drawn; w++) box_extend (box, pw_plot_track (plots, i, &plots->wheels, w));
  return box->x1 >= box->x0 ? hypot (box->x1 - box->x0, box->y1 - box->y0) : 0;
}

void pw_plot_measure (pw_plots *plots) {
  pw_plot_box box = pw_plot_ground (plots);
  double reach = 0, size = pw_plot_extend (&box, plots, 0); /* reach: farthest attachment point of a body */
  for (int b = 0; b < plots->bodies.drawn; b++)
    for (int k = 0; k < plots->shape[b].attachments; k++)
      reach = fmax (reach, hypot (plots->shape[b].attachment[k][0], plots->shape[b].attachment[k][1]));
  plots->size = size > 0 ? size : pw_system_length (plots->system);
  plots->symbol_unit = SHAPES_UNIT * (reach > 0 ? fmin (plots->size, 4 * reach) : plots->size);
}
