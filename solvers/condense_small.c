/* Planning of a small scene: the order of its rows, and a panel for each body or own coordinate; see condense.h. */
#include "condense.h"
#include "skyline.h"
#include "small_shapes.h"

/* ---- Order ---- */

static int condense_bits (unsigned long long x) {
  int n = 0;
  for (; x; x &= x - 1) n++;
  return n;
}

/* An order of the nodes in which those that touch the same panel (a bit of `touched`) are near each other: next is always
 * the one that begins fewest panels and shares most with those before it. */
static void condense_sort_nodes (int nodes, const unsigned long long *touched, int *order) {
  unsigned long long begun = 0;
  unsigned done = 0;
  for (int i = 0; i < nodes; i++) {
    int best = -1, least = 0;
    for (int n = 0; n < nodes; n++) {
      int cost = condense_bits (touched[n] & ~begun) - condense_bits (touched[n] & begun);
      if ((done >> n & 1) == 0 && (best < 0 || cost < least)) best = n, least = cost;
    }
    order[i] = best;
    done |= 1U << best;
    begun |= touched[best];
  }
}

/* Puts the nodes in an order in which those of a panel are neighbours. */
static void condense_order_small (const pw_plan *c, int *place) {
  unsigned long long touched[PW_SMALL] = { 0 };
  int order[PW_SMALL], y = 0, bodies = c->k->s->bodies;
  for (int p = 0; p < c->pieces; p++) {
    int j = c->piece[p].j;
    touched[c->node_of[p]] |= 1ULL << (j < 3 * bodies ? j / 3 : j - 2 * bodies);
  }
  condense_sort_nodes (c->nodes, touched, order);
  for (int i = 0; i < c->nodes; i++) {
    place[order[i]] = y;
    y += c->node[order[i]].size;
  }
}

/* ---- Panels ---- */

/* 1 if a panel's rows have no columns that those of the shape do not have. */
static int condense_fits (const pw_panel *p, unsigned shape) {
  if (p->rows != small_rows (shape)) return 0;
  for (int r = 0; r < p->rows; r++)
    if (p->columns[r] & ~small_columns (shape, r)) return 0;
  return 1;
}

static unsigned condense_shape (const pw_panel *p) {
#define SMALL_SHAPE(shape) \
  if (p->width == 3 && condense_fits (p, shape)) return shape;
  SMALL_SHAPES
#undef SMALL_SHAPE
  return 0;
}

/* Adds rows to a panel, whose position `first` is the first one's: their first column is at J, the next row `step`
 * further on.  unit: they are two, and their x and y columns a multiple of the unit matrix. */
static void condense_add_rows (pw_small *k, pw_panel *p, int first, int rows, const double *J, int step, int unit) {
  static const double zero[3] = { 0, 0, 0 };
  pw_panel was = *p;
  int from = was.rows > 0 && was.first < first ? was.first : first;
  int end = was.rows > 0 && was.first + was.rows > first + rows ? was.first + was.rows : first + rows;
  for (int i = from; i < end; i++) {
    int old = i - was.first, new = i - first;
    if (new >= 0 && new < rows) {
      p->J[i - from] = J + new *step;
      p->columns[i - from] = (unsigned char)(!unit ? 7 : new == 0 ? 5 : 6);
    } else {
      p->J[i - from] = old >= 0 && old < was.rows ? was.J[old] : zero;
      p->columns[i - from] = old >= 0 && old < was.rows ? was.columns[old] : 0;
    }
  }
  p->first = from;
  p->rows = end - from;
  p->S = k->S + from * (k->n + 1);
  p->y = k->y + from;
}

/* After the last rows. */
static void condense_close_panel (pw_panel *p) {
  int rows = 0;
  p->shape = condense_shape (p);
  for (int r = 0; r < p->rows; r++) {
    if (p->columns[r] == 0 && p->shape == 0) continue;
    p->J[rows] = p->J[r];
    p->columns[rows] = p->columns[r];
    p->at[rows++] = (unsigned char)r;
  }
  p->gaps = rows < p->rows;
  p->rows = rows;
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
      condense_add_rows (c->k->small, p, place[node], c->node[node].size, piece->J, piece->step, piece->unit);
    }
    condense_close_panel (p);
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
