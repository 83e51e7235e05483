/* Planning of a large scene: patches, and what is stored before it is added to; see condense.h and large.h. */
#include <stdlib.h>
#include <string.h>
#include "condense.h"
#include "util.h"

/* What the values have seen while assembly and elimination are gone through. */
enum { CONDENSE_UNSEEN, CONDENSE_SEEN, CONDENSE_GAP };

typedef struct {
  pw_plan *c;
  pw_large *large;
  unsigned char *seen; /* of the first value of each block; of all values in a gap */
} condense_large;

/* A place in the values; its complement the first time. */
static int condense_once (condense_large *g, int at) {
  int first = g->seen[at] == CONDENSE_UNSEEN;
  if (first) g->seen[at] = CONDENSE_SEEN;
  return first ? ~at : at;
}

static void condense_gap (condense_large *g, int at, int count) {
  if (g->seen[at] == CONDENSE_UNSEEN) memset (g->seen + at, CONDENSE_GAP, (size_t)count);
}

static pw_piece condense_piece_at (condense_large *g, int index) {
  const pw_plan *c = g->c;
  const pw_plan_piece *x = &c->piece[index];
  const pw_plan_node *n = &c->node[c->node_of[index]];
  int D = g->large->ldl->column[g->large->ldl->place[c->node_of[index]]].at;
  return (pw_piece){ .J = (int)(x->J - g->large->base[n->row == PW_PLAN_EXTRA]),
                     .y = n->y,
                     .D = condense_once (g, D),
                     .step = (short)(n->size > 1 ? x->step : 0),
                     .size = (unsigned char)n->size,
                     .other = n->row == PW_PLAN_EXTRA };
}

/* Fills the patch of a kept body: the pieces of the rows, then its own. */
static void condense_kept (condense_large *g, int kept, pw_patch *p, int *piece, int *block) {
  const pw_plan *c = g->c;
  const pw_ldl *ldl = g->large->ldl;
  int own = ldl->place[kept];
  for (int x = c->start[p->j]; x < c->start[p->j + 1]; x++) {
    int place = ldl->place[c->node_of[c->list[x]]];
    g->large->piece[(*piece)++] = condense_piece_at (g, c->list[x]);
    g->large->block[(*block)++] =
        condense_once (g, place < own ? pw_ldl_find (ldl, own, place) : pw_ldl_find (ldl, place, own));
  }
  g->large->piece[(*piece)++] =
      (pw_piece){ .y = c->node[kept].y, .D = condense_once (g, ldl->column[own].at), .size = 3 };
  p->shape = PW_KEPT;
}

/* Fills a patch; *piece and *block count. */
static void condense_patch (condense_large *g, int j, pw_patch *p, int *piece, int *block) {
  const pw_plan *c = g->c;
  const pw_ldl *ldl = g->large->ldl;
  const int *list = c->list + c->start[j], *node = c->node_of;
  int count = c->start[j + 1] - c->start[j], longest = 0, units = 0;
  pw_piece *first = g->large->piece + *piece;
  *p = (pw_patch){ .j = j, .first = *piece, .block = *block, .width = (unsigned char)pw_plan_width (c, j) };
  p->column = pw_plan_column (c, ldl, j);
  if (pw_plan_kept (c, j) >= 0) {
    condense_kept (g, pw_plan_kept (c, j), p, piece, block);
    return;
  }
  *piece += count;
  for (int a = 0; a < count; a++) {
    first[a] = condense_piece_at (g, list[a]);
    if (first[a].size > longest) longest = first[a].size;
    units += c->piece[list[a]].unit;
    for (int b = a + 1; b < count; b++)
      g->large->block[(*block)++] =
          condense_once (g, pw_ldl_find (ldl, ldl->place[node[list[b]]], ldl->place[node[list[a]]]));
  }
  int is_short = p->width == 3 && longest <= 2;
  int link = is_short && count == 2 && units == 2 && c->k->inverse[j] == c->k->inverse[j + 1];
  p->shape = link ? PW_LINK : is_short ? PW_SHORT : PW_ANY;
}

/* Nothing is stored for a chain but what its ends share with the rest. */
static void condense_chain (condense_large *g, pw_chain *x) {
  const pw_column *first = &g->large->ldl->column[x->column], *last = first + x->bodies;
  x->first = g->seen[first->at] == CONDENSE_UNSEEN ? ~first->at : first->at;
  x->last = condense_once (g, last->at);
}

/* Elimination updates what the patches have to have stored by then. */
static const int *condense_eliminate (condense_large *g, const pw_column *c, const int *target) {
  const pw_ldl *l = g->large->ldl;
  condense_gap (g, c->at, pw_ldl_triangle (c->size) + c->size);
  for (int p = c[1].first - 1; p >= c->first; p--) {
    const pw_column *row = &l->column[l->below[p]];
    condense_gap (g, row->at, pw_ldl_triangle (row->size) + row->size);
    for (int q = c->first; q < p; q++) condense_gap (g, *target++, row->size * l->column[l->below[q]].size);
  }
  return target;
}

/* Runs of values in gaps; only counted while there is no array. */
static void condense_gaps (condense_large *g) {
  pw_large *l = g->large;
  l->gaps = 0;
  for (int at = 0; at < l->ldl->values; at++) {
    if (g->seen[at] != CONDENSE_GAP) continue;
    int begin = at;
    while (at < l->ldl->values && g->seen[at] == CONDENSE_GAP) at++;
    if (l->gap) l->gap[l->gaps] = (pw_gap){ begin, at - begin };
    l->gaps++;
  }
}

static int condense_fill_large (pw_plan *c, pw_large *l) {
  condense_large g = { c, l, calloc ((size_t)l->ldl->values + 1, 1) };
  const int *target = l->ldl->target;
  pw_chain *chain = l->chain;
  int piece = 0, block = 0, n = 0;
  if (g.seen == NULL) return PW_MACHINE;
  for (int j = 0; j <= l->ldl->nodes;) {
    for (; n < l->patches && (j == l->ldl->nodes || pw_plan_column (c, l->ldl, c->group[n]) <= j); n++)
      condense_patch (&g, c->group[n], &l->patch[n], &piece, &block);
    if (chain->column == j) {
      condense_chain (&g, chain);
      j += chain++->bodies;
      continue;
    }
    if (j < l->ldl->nodes) target = condense_eliminate (&g, &l->ldl->column[j], target);
    j++;
  }
  l->patch[n] = (pw_patch){ .first = piece, .block = block, .column = l->ldl->nodes };
  condense_gaps (&g);
  l->gap = malloc (((size_t)l->gaps + 1) * sizeof *l->gap);
  if (l->gap) condense_gaps (&g);
  free (g.seen);
  return l->gap ? PW_OK : PW_MACHINE;
}

static void condense_take_large (const pw_plan *c, pw_layout *l, pw_large *large) {
  large->patch = pw_take (l, (size_t)large->patches + 1, sizeof *large->patch);
  large->piece = pw_take (l, (size_t)(c->pieces - 2 * c->linked + c->keeps), sizeof *large->piece);
  large->block = pw_take (l, (size_t)(c->pairs - c->linked), sizeof *large->block);
  large->chain = pw_take (l, (size_t)c->chains + 1, sizeof *large->chain);
  large->keep = pw_take (l, 3 * (size_t)c->linked, sizeof *large->keep);
}

int pw_condense_large (pw_plan *c, pw_ldl *ldl) {
  pw_large *l = c->k->large = calloc (1, sizeof *l);
  if (l == NULL) {
    pw_ldl_close (ldl);
    return PW_MACHINE;
  }
  *l = (pw_large){ .ldl = ldl, .inverse = c->k->inverse };
  l->patches = c->groups - c->linked;
  l->chains = c->chains;
  l->base[0] = (const double *)(const void *)c->k->s;
  l->base[1] = (const double *)(const void *)c->k->reduce.memory;
  pw_layout lay = { NULL, 0 };
  condense_take_large (c, &lay, l);
  l->memory = malloc (lay.used + 1);
  if (l->memory == NULL) return PW_MACHINE;
  lay = (pw_layout){ l->memory, 0 };
  condense_take_large (c, &lay, l);
  memcpy (l->chain, c->chain, (size_t)c->chains * sizeof *l->chain);
  l->chain[l->chains] = (pw_chain){ .column = ldl->nodes + 1 };
  int status = condense_fill_large (c, l);
  pw_ldl_settle (ldl);
  return status;
}

void pw_large_close (pw_large *l) {
  if (l == NULL) return;
  pw_ldl_close (l->ldl);
  free (l->gap);
  free (l->memory);
  free (l);
}
