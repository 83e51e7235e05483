/* Planning of a small scene: the order of its rows, and a panel for each body or own coordinate; see condense.h. */
#include "condense.h"
#include "skyline.h"

/* Puts the nodes in an order in which those of a panel are neighbours. */
static void condense_order_small (const pw_plan *c, int *place) {
  unsigned long long touched[PW_SMALL] = { 0 };
  int order[PW_SMALL], y = 0, bodies = c->k->s->bodies;
  for (int p = 0; p < c->pieces; p++) {
    int j = c->piece[p].j;
    touched[c->node_of[p]] |= 1ULL << (j < 3 * bodies ? j / 3 : j - 2 * bodies);
  }
  pw_small_order (c->nodes, touched, order);
  for (int i = 0; i < c->nodes; i++) {
    place[order[i]] = y;
    y += c->node[order[i]].size;
  }
}

/* Coordinates that are all without weight need no panel: their accelerations are found elsewhere. */
static void condense_fill_panels (const pw_plan *c, const double *weight, const int *place) {
  for (int n = 0; n < c->groups; n++) {
    int j = pw_plan_group (c, n), width = pw_plan_width (c, j), heavy = 0;
    for (int i = 0; i < width; i++) heavy |= weight[j + i] != 0;
    if (!heavy) continue;
    pw_panel *p = c->k->small->end++;
    *p = (pw_panel){ .w = c->k->inverse + j, .j = j, .width = width };
    for (int x = c->start[j]; x < c->start[j + 1]; x++) {
      const pw_plan_piece *piece = &c->piece[c->list[x]];
      int node = c->node_of[c->list[x]];
      pw_small_add_rows (c->k->small, p, place[node], c->node[node].size, piece->J, piece->step, piece->unit);
    }
    pw_small_close_panel (p);
  }
}

void pw_condense_small (const pw_plan *c, const double *weight, pw_panel *panel) {
  struct pw_saddle *k = c->k;
  pw_small *small = k->small;
  int place[PW_SMALL];
  *small = (pw_small){ .n = k->unknowns, .panel = panel, .end = panel, .guard = k->guard };
  condense_order_small (c, place);
  condense_fill_panels (c, weight, place);
  for (int i = 0; i < small->n; i++) small->begin[i] = i;
  for (const pw_panel *p = small->panel; p < small->end; p++)
    for (int r = 0; r < p->rows; r++)
      if (p->first < small->begin[p->first + p->at[r]]) small->begin[p->first + p->at[r]] = p->first;
  pw_skyline_open (small->begin, small->n);
  k->plain = k->reduce.components == 0 && k->idles == 0 ? small : NULL;
  for (int n = 0; n < c->nodes; n++)
    for (int r = 0; r < c->node[n].size; r++) small->row[place[n] + r] = c->node[n].y + r;
}
