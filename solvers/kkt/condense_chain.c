/* Finding the chains of a scene; see condense.h and block_ldl.h. */
#include <stdlib.h>
#include "condense.h"

/* The block of a column and the next one: the number of bodies and eliminated columns that add to it, and the body, if
 * it can be in a chain. */
typedef struct {
  int sources;
  pw_chain link;
} chain_between;

/* A body that links a column to the next one, which alone is below it; returns the column, or -1. */
static int chain_link (const pw_plan *c, const pw_block_ldl *l, int body, pw_chain *link) {
  int j = pw_group_first (c->k->s, body);
  const int *list = c->list + c->start[j];
  if (c->start[j + 1] - c->start[j] != 2) return -1;
  const pw_plan_contribution *a = &c->contribution[list[0]], *b = &c->contribution[list[1]];
  int column = l->place[a->node];
  if (!a->is_pin || !b->is_pin || c->k->inverse[j] != c->k->inverse[j + 1]) return -1;
  if (l->place[b->node] != column + 1 || l->column[column + 1].first - l->column[column].first != 1) return -1;
  *link = (pw_chain){ .column = column,
                      .bodies = 1,
                      .A = a->J,
                      .B = b->J,
                      .step = a->step,
                      .y = c->node[a->node].y,
                      .j = j,
                      .next_y = c->node[b->node].y - c->node[a->node].y };
  return column;
}

/* Appends the next body if its positions continue at the same strides. */
static int chain_add (pw_chain *chain, const pw_chain *last, const pw_chain *link) {
  int next_J = (int)(link->A - last->A), next_j = link->j - last->j;
  if (link->B - last->B != next_J || link->next_y != chain->next_y) return 0;
  if (chain->bodies > 1 && (next_J != chain->next_J || next_j != chain->next_j)) return 0;
  chain->next_J = next_J;
  chain->next_j = next_j;
  chain->bodies++;
  return 1;
}

/* Joins links to chains.  meet: columns: the contributions to each, 2 inside a chain. */
static void chain_join (pw_plan *c, pw_block_ldl *l, const chain_between *between, const int *meet) {
  c->chains = c->linked = 0;
  for (int p = 0; p < l->nodes;) {
    const chain_between *b = &between[p++];
    if (b->sources != 1 || b->link.bodies == 0) continue;
    pw_chain *chain = &c->chain[c->chains++];
    *chain = b->link;
    chain->factor = 3 * (c->linked + c->chains - 1);
    c->is_linked[b->link.j / 3] = 1;
    for (; p < l->nodes && between[p].sources == 1 && meet[p] == 2; p++) {
      if (between[p].link.bodies == 0) break;
      if (!chain_add (chain, &between[p - 1].link, &between[p].link)) break;
      c->is_linked[between[p].link.j / 3] = 1;
      l->column[p].in_chain = 1;
    }
    const pw_column *last = &l->column[chain->column + chain->bodies];
    chain->whole = chain->bodies > 1 && last[1].first == last->first;
    c->linked += chain->bodies;
  }
}

/* Counts fill-in between a column and the next one from columns eliminated earlier, which have both below them. */
static void chain_fill (const pw_block_ldl *l, chain_between *between) {
  for (int p = 0; p < l->nodes; p++)
    for (int i = l->column[p].first + 1; i < l->column[p + 1].first; i++)
      if (l->below[i] == l->below[i - 1] + 1) between[l->below[i - 1]].sources++;
}

/* Counts a body; its contributions are in the order of their columns. */
static void chain_count (const pw_plan *c, const pw_block_ldl *l, int body, chain_between *between) {
  int j = pw_group_first (c->k->s, body);
  for (int x = c->start[j] + 1; x < c->start[j + 1]; x++) {
    int column = l->place[c->contribution[c->list[x - 1]].node];
    if (l->place[c->contribution[c->list[x]].node] == column + 1) between[column].sources++;
  }
}

int pw_condense_chains (pw_plan *c, pw_block_ldl *l) {
  size_t nodes = (size_t)l->nodes + 1;
  chain_between *between = calloc (nodes, sizeof *between);
  int *meet = calloc (nodes, sizeof *meet);
  c->chain = malloc (nodes * sizeof *c->chain);
  c->is_linked = calloc ((size_t)c->groups + 1, 1);
  int status = between && meet && c->chain && c->is_linked ? PW_OK : PW_RESOURCE;
  for (int p = 0; p < c->contributions && status == PW_OK; p++) meet[l->place[c->contribution[p].node]]++;
  for (int body = 0; body < c->k->s->bodies && status == PW_OK; body++) {
    pw_chain link;
    int column = chain_link (c, l, body, &link);
    if (column >= 0) between[column].link = link;
    chain_count (c, l, body, between);
  }
  if (status == PW_OK) chain_fill (l, between);
  if (status == PW_OK) chain_join (c, l, between, meet);
  free (between);
  free (meet);
  return status;
}
