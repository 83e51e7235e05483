/* The shapes of bodies in figures and animations, and the links between them: elements with points, and their forces. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "plot.h"

/* ---- Outlines ---- */

/* Twice the area of the triangle a b c, positive if they turn to the left. */
static double shapes_turn (const double *a, const double *b, const double *c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static int shapes_order (const void *a, const void *b) {
  const double *p = a, *q = b;
  return p[0] != q[0] ? (p[0] > q[0]) - (p[0] < q[0]) : (p[1] > q[1]) - (p[1] < q[1]);
}

/* The convex hull by monotone chains (Andrew 1979): below from left to right, then above from right to left. */
static void shapes_outline (pw_plot_body *shape) {
  double p[PLOT_POINTS + 1][2] = { { 0, 0 } }, hull[2 * PLOT_POINTS + 2][2], size = 0;
  int n = shape->count + 1, corners = 0;
  memcpy (p + 1, shape->at, (size_t)shape->count * sizeof *p);
  qsort (p, (size_t)n, sizeof *p, shapes_order);
  for (int i = 0; i < n; i++) size = fmax (size, hypot (p[i][0], p[i][1]));
  for (int i = 0, least = 2; i < 2 * n - 1; i++) {
    const double *next = p[i < n ? i : 2 * n - 2 - i];
    if (i == n) least = corners + 1;
    while (corners >= least && shapes_turn (hull[corners - 2], hull[corners - 1], next) <= 1e-9 * size * size)
      corners--;
    if (i < 2 * n - 2) memcpy (hull[corners++], next, sizeof *hull);
  }
  shape->corners = corners < 3 ? 0 : corners;
  memcpy (shape->corner, hull, (size_t)shape->corners * sizeof *hull);
}

int pw_plot_inside (const pw_plot_body *shape, int k) {
  for (int i = 0; i < shape->corners; i++)
    if (memcmp (shape->corner[i], shape->at[k], sizeof shape->at[k]) == 0) return 0;
  return 1;
}

/* Adds an attachment point unless it is there already; the centre of mass is always drawn. */
static void shapes_add_point (pw_plot_body *shape, const double *at) {
  if (shape->count == PLOT_POINTS || (at[0] == 0 && at[1] == 0)) return;
  for (int i = 0; i < shape->count; i++)
    if (shape->at[i][0] == at[0] && shape->at[i][1] == at[1]) return;
  memcpy (shape->at[shape->count++], at, 2 * sizeof *at);
}

/* The points of an element on the bodies drawn and on the ground. */
static void shapes_add_points (pw_plots *p, const pw_element *e, const int *bodies) {
  for (int n = 0; n < e->kind->bodies; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int b = p->shown[bodies[n]];
    if (at && b >= 0) shapes_add_point (&p->shape[b], at);
    if (at && b == PLOT_GROUND && p->grounds < PLOT_SHOWN) memcpy (p->ground[p->grounds++], at, 2 * sizeof *at);
  }
}

/* ---- Links ---- */

/* The joint of two bodies: the end of an earlier link on the first one. */
static int shapes_joint (const pw_plots *p, int one, int other, pw_plot_link *link) {
  for (const pw_plot_link *l = p->link; l < p->link + p->links; l++)
    for (int n = 0; n < 2 && l->ends == 2 && !l->rail; n++)
      if (l->end[n].body == one && l->end[1 - n].body == other) {
        link->end[link->ends++] = l->end[n];
        return 1;
      }
  return 0;
}

/* An element without points is at the joints of its bodies with the last one. */
static int shapes_at_joints (const pw_plots *p, const pw_element *e, const int *bodies, pw_plot_link *link) {
  int last = p->shown[bodies[e->kind->bodies - 1]];
  for (int n = 0; n < e->kind->bodies - 1 && link->ends < 2; n++)
    if (!shapes_joint (p, p->shown[bodies[n]], last, link)) return 0;
  return e->kind->symbol && link->ends > 0;
}

/* 1 if two points that may be omitted are omitted. */
static int shapes_omitted (const pw_element *e) {
  const pw_field *f = e->kind->fields;
  while (f->name && f->type != PW_POINT) f++;
  const double *at =
      f->name && !f->required && f->count == 2 ? pw_field_at (e->kind, e->definition, PW_POINT, 0) : NULL;
  return at && at[0] == 0 && at[1] == 0 && at[2] == 0 && at[3] == 0;
}

static int shapes_contact (const pw_plots *p, int element) {
  int w = 0;
  while (w < p->wheels.shown && p->wheels.index[w] != element) w++;
  return w < p->wheels.shown ? w : -1;
}

/* Fills a link; 0 if the element has no place, or a body that is not shown. */
static int shapes_link (const pw_plots *p, const pw_element *e, int element, pw_plot_link *link) {
  const pw_element_info info = pw_system_element (p->s, element);
  *link = (pw_plot_link){ .element = element,
                          .kind = e->kind,
                          .definition = e->definition,
                          .rail = e->kind->symbol && strstr (e->kind->symbol, "inf"),
                          .force = -1,
                          .contact = shapes_contact (p, element) };
  for (int n = 0; n < e->kind->bodies && link->ends < 2; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int body = p->shown[info.body[n]];
    if (at == NULL) continue;
    if (body == PLOT_HIDDEN) return 0;
    if (link->force < 0 && body >= 0) link->force = link->ends, link->offset = info.force + 3 * n;
    link->end[link->ends].body = body;
    memcpy (link->end[link->ends++].at, at, 2 * sizeof *at);
  }
  pw_plot_link joint = *link;
  joint.ends = 0;
  if ((link->ends == 0 || shapes_omitted (e)) && shapes_at_joints (p, e, info.body, &joint)) {
    *link = joint;
    return 1;
  }
  return link->force >= 0;
}

/* The elements of a kind are in the same order in the model and in the system. */
void pw_plot_find_shapes (pw_plots *p) {
  int most = p->links, elements, next = 0;
  const pw_element *e = pw_model_elements (p->m, &elements);
  const double *mass = pw_system_mass (p->s);
  const pw_kind *last = NULL;
  p->links = 0;
  for (int i = 0; i < pw_system_elements (p->s); i++) {
    const pw_element_info info = pw_system_element (p->s, i);
    if (info.kind->each_body) continue;
    if (info.kind != last) next = 0;
    last = info.kind;
    while (e[next].kind != last) next++;
    shapes_add_points (p, &e[next], info.body);
    if (p->links < most) p->links += shapes_link (p, &e[next], i, &p->link[p->links]);
    next++;
  }
  for (int b = 0; b < p->bodies.shown; b++) {
    const double *M = mass + 3 * p->bodies.index[b];
    p->shape[b].point = M[0] > 0 && M[2] == 0;
    shapes_outline (&p->shape[b]);
  }
}

void pw_plot_forces (const pw_plots *p, const pw_sample *x, double *out) {
  if (pw_workspace_forces (p->workspace, x->t, x->q, x->v, x->lambda, p->forces, NULL) != PW_OK) return;
  for (int i = 0; i < p->links; i++, out += 2)
    if (p->link[i].force < 0)
      out[0] = out[1] = 0;
    else
      memcpy (out, p->forces + p->link[i].offset, 2 * sizeof *out);
}

/* ---- The size of what figures show ---- */

void pw_plot_point (const double *motion, const double *at, double out[2]) {
  double c = cos (motion[2]), s = sin (motion[2]);
  out[0] = motion[0] + c * at[0] - s * at[1];
  out[1] = motion[1] + s * at[0] + c * at[1];
}

static void box_extend (pw_plot_box *b, const double *point) {
  if (!isfinite (point[0]) || !isfinite (point[1])) return;
  *b = (pw_plot_box){ fmin (b->x0, point[0]), fmax (b->x1, point[0]), fmin (b->y0, point[1]), fmax (b->y1, point[1]) };
}

pw_plot_box pw_plot_ground (const pw_plots *p) {
  pw_plot_box b = PLOT_EMPTY;
  for (int g = 0; g < p->grounds; g++) box_extend (&b, p->ground[g]);
  return b;
}

double pw_plot_extend (pw_plot_box *b, const pw_plots *p, int i) {
  for (int k = 0; k < p->bodies.shown; k++) {
    const double *motion = pw_plot_track (p, i, &p->bodies, k);
    box_extend (b, motion);
    for (int n = 0; n < p->shape[k].count; n++) {
      double point[2];
      pw_plot_point (motion, p->shape[k].at[n], point);
      box_extend (b, point);
    }
  }
  for (int w = 0; w < p->wheels.shown; w++) box_extend (b, pw_plot_track (p, i, &p->wheels, w));
  return b->x1 >= b->x0 ? hypot (b->x1 - b->x0, b->y1 - b->y0) : 0;
}

void pw_plot_measure (pw_plots *p) {
  pw_plot_box box = pw_plot_ground (p);
  double reach = 0, size = pw_plot_extend (&box, p, 0);
  for (int b = 0; b < p->bodies.shown; b++)
    for (int k = 0; k < p->shape[b].count; k++)
      reach = fmax (reach, hypot (p->shape[b].at[k][0], p->shape[b].at[k][1]));
  p->size = size > 0 ? size : pw_system_length (p->s);
  p->unit = 0.035 * (reach > 0 ? fmin (p->size, 4 * reach) : p->size);
}
