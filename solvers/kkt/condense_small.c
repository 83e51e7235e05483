/* Planning of a scene of few constraint equations: a block for each body and internal coordinate; see condense.h. */
#include "condense.h"
#include "skyline.h"

/* ---- Order ---- */

static int condense_bits (unsigned long long x) {
  int n = 0;
  for (; x; x &= x - 1) n++;
  return n;
}

/* An order of the nodes in which those that touch the same body (a bit of `touched`) are near each other: next is always
 * the one that adds fewest bodies and shares most with those before it. */
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

/* Positions of the nodes, those of one body near each other. */
static void condense_order (const pw_plan *c, int *place) {
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

/* ---- Blocks ---- */

/* Adds an equation, keeping positions ascending. */
static void condense_add_row (pw_body_block *b, int position, const double *J) {
  int r = b->rows++;
  for (; r > 0 && b->at[r - 1] > position; r--) b->at[r] = b->at[r - 1], b->J[r] = b->J[r - 1];
  b->at[r] = position;
  b->J[r] = J;
}

static void condense_fill_block (const pw_plan *c, pw_body_block *b, const int *place) {
  for (int x = c->start[b->j]; x < c->start[b->j + 1]; x++) {
    const pw_plan_piece *piece = &c->piece[c->list[x]];
    int node = c->node_of[c->list[x]];
    for (int r = 0; r < c->node[node].size; r++) condense_add_row (b, place[node] + r, piece->J + r * piece->step);
  }
}

/* Coordinates that are all without weight need no block: their accelerations are found elsewhere. */
static void condense_fill_blocks (const pw_plan *c, const double *weight, const int *place) {
  pw_small *small = c->k->small;
  for (int n = 0; n < c->groups; n++) {
    int j = pw_plan_group (c, n), width = pw_plan_width (c, j), has_weight = 0;
    for (int i = 0; i < width; i++) has_weight |= weight[j + i] != 0;
    if (!has_weight) continue;
    *small->end = (pw_body_block){ .w = c->k->inverse + j, .j = j, .width = width };
    condense_fill_block (c, small->end++, place);
  }
}

static void condense_skyline (pw_small *small) {
  for (int i = 0; i < small->n; i++) small->begin[i] = i;
  for (const pw_body_block *b = small->block; b < small->end; b++)
    for (int r = 0; r < b->rows; r++)
      if (b->at[0] < small->begin[b->at[r]]) small->begin[b->at[r]] = b->at[0];
  pw_skyline_open (small->begin, small->n);
}

void pw_condense_small (const pw_plan *c, const double *weight, pw_body_block *block) {
  struct pw_saddle *k = c->k;
  pw_small *small = k->small;
  int place[PW_SMALL];
  *small = (pw_small){ .n = k->unknowns, .block = block, .end = block, .guard = k->guard };
  condense_order (c, place);
  condense_fill_blocks (c, weight, place);
  condense_skyline (small);
  k->plain = k->reduce.components == 0 && k->idles == 0 ? small : NULL;
  for (int n = 0; n < c->nodes; n++)
    for (int r = 0; r < c->node[n].size; r++) small->row[place[n] + r] = c->node[n].y + r;
}
