/* Planning of the block L D L^T: the pattern of S, body blocks, uncondensed bodies; see condense.h and block_ldl.h. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include "condense.h"
#include "util.h"

/* ---- Pattern ---- */

/* The first of the two nodes of an uncondensed body, or -1. */
static int condense_own_nodes (const pw_plan *c, int j) {
  return j < 3 * c->k->s->bodies ? c->uncondensed[j / 3] : -1;
}

static void condense_add_pair (pw_plan *c, int a, int b) {
  c->failed |= pw_grow (&c->pair, (size_t)c->pairs, &c->pair_room, 2 * sizeof *c->pair) != PW_OK;
  if (c->failed) return;
  c->pair[2 * c->pairs] = a, c->pair[2 * c->pairs + 1] = b;
  c->pairs++;
}

/* Pairs of nodes that meet in a group, or with an uncondensed body. */
static void condense_pairs (pw_plan *c) {
  for (int n = 0; n < c->groups; n++) {
    int j = pw_group_first (c->k->s, n), own = condense_own_nodes (c, j);
    for (int x = c->start[j]; x < c->start[j + 1]; x++) {
      int a = c->contribution[c->list[x]].node;
      if (own >= 0) condense_add_pair (c, a, own), condense_add_pair (c, a, own + 1);
      for (int y = c->start[j]; y < x && own < 0; y++) condense_add_pair (c, a, c->contribution[c->list[y]].node);
    }
  }
}

/* The contributions of each group in the order of their columns (few: by insertion). */
static void condense_sort_columns (const pw_plan *c, const int *place) {
  for (int n = 0; n < c->groups; n++) {
    int j = pw_group_first (c->k->s, n), *list = c->list + c->start[j], count = c->start[j + 1] - c->start[j];
    for (int x = 1; x < count; x++)
      for (int y = x; y > 0; y--) {
        int a = list[y - 1], b = list[y];
        if (place[c->contribution[a].node] <= place[c->contribution[b].node]) break;
        list[y - 1] = b, list[y] = a;
      }
  }
}

/* ---- Body blocks ---- */

static int condense_coupling (const pw_block_ldl *l, int a, int b) {
  int p = l->place[a], q = l->place[b];
  return p > q ? pw_block_find (l, p, q) : pw_block_find (l, q, p);
}

/* Fills the block of a group; *contributions and *couplings count. */
static void condense_body (const pw_plan *c, pw_block_ldl *l, int j, pw_body_block *p, int *contributions,
                           int *couplings) {
  int own = condense_own_nodes (c, j);
  *p = (pw_body_block){ .j = j,
                        .first = *contributions,
                        .coupling = *couplings,
                        .width = (unsigned char)pw_group_width (c->k->s, j),
                        .uncondensed = own >= 0 };
  for (int x = c->start[j]; x < c->start[j + 1]; x++) {
    const pw_plan_contribution *a = &c->contribution[c->list[x]];
    const pw_plan_node *n = &c->node[a->node];
    l->contribution[(*contributions)++] =
        (pw_contribution){ a->J, n->y, l->column[l->place[a->node]].at, a->step, (short)n->size };
    if (own >= 0)
      for (int i = 0; i < 2; i++) l->coupling[(*couplings)++] = condense_coupling (l, a->node, own + i);
    else
      for (int y = x + 1; y < c->start[j + 1]; y++)
        l->coupling[(*couplings)++] = condense_coupling (l, a->node, c->contribution[c->list[y]].node);
  }
  for (int i = own; own >= 0 && i < own + 2; i++)
    l->contribution[(*contributions)++] =
        (pw_contribution){ .y = c->node[i].y, .D = l->column[l->place[i]].at, .size = (short)c->node[i].size };
}

/* 0 for a body of a chain, and for a group without mass, whose accelerations massless.c computes. */
static int condense_has_block (const pw_plan *c, int n) {
  int j = pw_group_first (c->k->s, n), width = pw_group_width (c->k->s, j), has_weight = 0;
  for (int i = 0; i < width; i++) has_weight |= c->weight[j + i] != 0;
  return has_weight && !c->is_linked[n];
}

static int condense_fill (const pw_plan *c, pw_block_ldl *l) {
  int contributions = 0, couplings = 0, body = 0, uncondensed = c->k->more / 3;
  l->inverse = c->k->inverse;
  for (int n = 0; n < c->groups; n++) l->bodies += condense_has_block (c, n);
  l->chains = c->chains;
  for (pw_layout lay = { 0 }; pw_layout_pass (&lay, &l->memory);) {
    l->body = pw_layout_alloc (&lay, (size_t)l->bodies + 1, sizeof *l->body);
    l->contribution =
        pw_layout_alloc (&lay, (size_t)(c->contributions - 2 * c->linked + 2 * uncondensed), sizeof *l->contribution);
    l->coupling = pw_layout_alloc (&lay, (size_t)(c->pairs - c->linked), sizeof *l->coupling);
    l->chain = pw_layout_alloc (&lay, (size_t)c->chains + 1, sizeof *l->chain);
    l->chain_factor = pw_layout_alloc (&lay, 3 * (size_t)(c->linked + c->chains), sizeof *l->chain_factor);
  }
  if (l->memory == NULL) return PW_RESOURCE;
  memcpy (l->chain, c->chain, (size_t)c->chains * sizeof *l->chain);
  l->chain[l->chains] = (pw_chain){ .column = l->nodes + 1 };
  for (int last = 0; last < 2; last++) /* uncondensed bodies last: they add to diagonals that the others store */
    for (int n = 0; n < c->groups; n++) {
      int first = pw_group_first (c->k->s, n);
      if (condense_has_block (c, n) && (condense_own_nodes (c, first) >= 0) == last)
        condense_body (c, l, first, &l->body[body++], &contributions, &couplings);
    }
  l->body[body] = (pw_body_block){ .first = contributions, .coupling = couplings };
  return PW_OK;
}

/* ---- Opening ---- */

int pw_condense_block (pw_plan *c) {
  condense_pairs (c);
  if (c->failed || c->pairs >= INT_MAX / 2) return PW_RESOURCE;
  pw_block_ldl *l = c->k->block = pw_block_open (c->nodes, c->node, c->pairs, c->pair);
  if (l == NULL) return PW_RESOURCE;
  condense_sort_columns (c, l->place);
  int status = pw_condense_chains (c, l);
  if (status == PW_OK) status = pw_block_lay_out (l);
  return status == PW_OK ? condense_fill (c, l) : status;
}
