/* What animations show of elements: the line between their points, and the force on a body at its point. */
#include <string.h>
#include "plot.h"

/* The number of a system's body among those shown, -1 for the ground, -2 for one that is not shown. */
static int links_shown (const pw_plots *p, int body) {
  if (body >= pw_count_bodies (p->s)) return -1;
  int b = (int)((long long)body * p->bodies / pw_count_bodies (p->s));
  for (int near = b - 1; near <= b + 1; near++)
    if (near >= 0 && near < p->bodies && p->body[near] == body) return near;
  return -2;
}

int pw_plot_body_of_wheel (const pw_plots *p, int wheel) {
  return links_shown (p, pw_system_element (p->s, p->element[wheel]).body[0]);
}

/* Fills a link; 0 if the element has no point, or a body that is not shown. */
static int links_fill (const pw_plots *p, const pw_element *e, int element, pw_plot_link *link) {
  const int *bodies = pw_system_element (p->s, element).body;
  *link = (pw_plot_link){ .element = element, .force = -1 };
  for (int n = 0; n < e->kind->bodies && link->ends < 2; n++) {
    const double *at = pw_field_at (e->kind, e->definition, PW_POINT, n);
    int body = links_shown (p, bodies[n]);
    if (at == NULL) continue;
    if (body == -2) return 0;
    if (link->force < 0 && body >= 0) link->force = link->ends, link->column = 3 * n;
    link->end[link->ends].body = body;
    memcpy (link->end[link->ends++].at, at, 2 * sizeof *at);
  }
  return link->force >= 0;
}

/* The elements of a kind are in the same order in the model and in the system. */
void pw_plot_find_links (pw_plots *p, const pw_model *m) {
  int most = p->links, all = pw_system_elements (p->s), elements, next = 0;
  const pw_element *e = pw_model_elements (m, &elements);
  const pw_kind *last = NULL;
  p->links = 0;
  for (int i = 0; i < all && p->links < most; i++) {
    const pw_kind *kind = pw_system_element (p->s, i).kind;
    if (kind->each_body) continue;
    if (kind != last) next = 0;
    last = kind;
    while (e[next].kind != kind) next++;
    p->links += links_fill (p, &e[next++], i, &p->link[p->links]);
  }
}

void pw_plot_forces (const pw_plots *p, const pw_sample *x, double *out) {
  if (pw_system_forces (p->s, x->t, x->q, x->v, x->lambda, p->forces, NULL) != PW_OK) return;
  for (int i = 0; i < p->links; i++, out += 2)
    memcpy (out, p->forces + pw_system_element (p->s, p->link[i].element).force + p->link[i].column, 2 * sizeof *out);
}
