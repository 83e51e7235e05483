/* What animations show of elements: the line between their points, and the force on a body at its point.
 *
 *   of a constraint, on body n of the element:  F = -sum_r J_r lambda_r,  the x and y columns of body n
 *   of a force kind:                            F = the x and y entries of body n in its generalised force */
#include <string.h>
#include "model.h"
#include "plot.h"

/* The number of a system's body among those shown, -1 for the ground, -2 for one that is not shown. */
static int links_shown (const pw_plots *p, int body) {
  if (body >= p->s->bodies) return -1;
  int b = (int)((long long)body * p->bodies / p->s->bodies);
  for (int near = b - 1; near <= b + 1; near++)
    if (near >= 0 && near < p->bodies && p->body[near] == body) return near;
  return -2;
}

int pw_plot_body_of_wheel (const pw_plots *p, int wheel) {
  const pw_slab *k = &p->s->slab[p->slab[wheel]];
  return links_shown (p, k->b.body[p->element[wheel] * k->kind->bodies]);
}

/* Fills a link; 0 if the element has no point, or a body that is not shown. */
static int links_fill (const pw_plots *p, const pw_element *e, int slab, int number, pw_plot_link *link) {
  const pw_slab *k = &p->s->slab[slab];
  *link = (pw_plot_link){ .slab = slab, .element = number, .force = -1 };
  for (int n = 0; n < e->kind->bodies && link->ends < 2; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int body = links_shown (p, k->b.body[number * e->kind->bodies + n]);
    if (at == NULL) continue;
    if (body == -2) return 0;
    if (link->force < 0 && body >= 0) link->force = link->ends, link->column = 3 * n;
    link->end[link->ends].body = body;
    memcpy (link->end[link->ends++].at, at, 2 * sizeof *at);
  }
  return link->force >= 0;
}

void pw_plot_find_links (pw_plots *p, const pw_model *m) {
  int most = p->links;
  p->links = 0;
  for (int slab = 0; slab < p->s->slabs; slab++) {
    const pw_kind *kind = p->s->slab[slab].kind;
    int number = 0;
    for (int i = 0; i < m->elements && p->links < most && !kind->each_body; i++)
      if (m->element[i].kind == kind) p->links += links_fill (p, &m->element[i], slab, number++, &p->link[p->links]);
  }
}

static void links_constraint (const pw_slab *k, const pw_plot_link *link, const double *lambda, double F[2]) {
  const double *J = k->J + (size_t)(link->element * k->kind->rows) * (size_t)k->b.cols + link->column;
  lambda += k->row + link->element * k->kind->rows;
  for (int r = 0; r < k->kind->rows; r++, J += k->b.cols) {
    F[0] -= J[0] * lambda[r];
    F[1] -= J[1] * lambda[r];
  }
}

void pw_plot_forces (const pw_plots *p, const pw_sample *sample, double *out) {
  int swept = -1;
  for (int i = 0; i < p->links; i++, out += 2) {
    const pw_plot_link *link = &p->link[i];
    const pw_slab *k = &p->s->slab[link->slab];
    out[0] = out[1] = 0;
    if (k->kind->rows > 0) links_constraint (k, link, sample->lambda, out);
    if (k->kind->force == NULL) continue;
    if (swept != link->slab) k->kind->force (&k->b, p->block);
    swept = link->slab;
    const double *block = p->block + (size_t)link->element * (size_t)k->b.cols + link->column;
    out[0] += block[0];
    out[1] += block[1];
  }
}
