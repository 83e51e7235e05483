/* Finding the chains of a large scene; see condense.h and chain.h. */
#include <stdlib.h>
#include "condense.h"

/* What is between a column and the next one: how much adds to their block of the matrix, bodies and columns eliminated
 * before, and a body that is alone in that, if it can be in a chain. */
typedef struct {
  int sources;
  pw_chain link;
} chain_between;

/* A body that links a column to the next one, which alone is below it; returns the column, or -1. */
static int chain_link (const pw_plan *c, const pw_ldl *ldl, int body, pw_chain *link) {
  int j = pw_plan_group (c, body);
  const int *list = c->list + c->start[j];
  if (c->start[j + 1] - c->start[j] != 2) return -1;
  const pw_plan_piece *a = &c->piece[list[0]], *b = &c->piece[list[1]];
  int u = c->node_of[list[0]], v = c->node_of[list[1]], column = ldl->place[u];
  if (!a->unit || !b->unit || a->step != b->step || c->k->inverse[j] != c->k->inverse[j + 1]) return -1;
  if (ldl->place[v] != column + 1 || ldl->column[column + 1].first - ldl->column[column].first != 1) return -1;
  const double *base = (const double *)(const void *)c->k->s;
  *link = (pw_chain){ .column = column,
                      .bodies = 1,
                      .A = (int)(a->J - base),
                      .B = (int)(b->J - base),
                      .step = a->step,
                      .y = c->node[u].y,
                      .j = j,
                      .next_y = c->node[v].y - c->node[u].y };
  return column;
}

/* Adds the body behind if its places follow at the same distances. */
static int chain_add (pw_chain *chain, const pw_chain *last, const pw_chain *link) {
  int next_J = link->A - last->A, next_j = link->j - last->j;
  if (link->B - last->B != next_J || link->step != chain->step || link->next_y != chain->next_y) return 0;
  if (chain->bodies > 1 && (next_J != chain->next_J || next_j != chain->next_j)) return 0;
  chain->next_J = next_J;
  chain->next_j = next_j;
  chain->bodies++;
  return 1;
}

/* Joins links to chains.  meet: columns: the pieces of each, 2 inside a chain. */
static void chain_join (pw_plan *c, pw_ldl *ldl, const chain_between *between, const int *meet) {
  c->chains = c->linked = 0;
  for (int p = 0; p < ldl->nodes;) {
    const chain_between *b = &between[p++];
    if (b->sources != 1 || b->link.bodies == 0) continue;
    pw_chain *chain = &c->chain[c->chains++];
    *chain = b->link;
    chain->keep = 3 * c->linked;
    c->is_linked[b->link.j / 3] = 1;
    for (; p < ldl->nodes && between[p].sources == 1 && meet[p] == 2; p++) {
      if (between[p].link.bodies == 0) break;
      if (!chain_add (chain, &between[p - 1].link, &between[p].link)) break;
      c->is_linked[between[p].link.j / 3] = 1;
      ldl->column[p].shape = PW_LINK;
    }
    c->linked += chain->bodies;
  }
}

/* Counts what columns eliminated earlier leave between a column and the next one: both are below them. */
static void chain_fill (const pw_ldl *ldl, chain_between *between) {
  for (int p = 0; p < ldl->nodes; p++)
    for (int i = ldl->column[p].first + 1; i < ldl->column[p + 1].first; i++)
      if (ldl->below[i] == ldl->below[i - 1] + 1) between[ldl->below[i - 1]].sources++;
}

/* Counts a body; its pieces are in the order of their columns. */
static void chain_count (const pw_plan *c, const pw_ldl *ldl, int body, chain_between *between) {
  int j = pw_plan_group (c, body);
  for (int x = c->start[j] + 1; x < c->start[j + 1]; x++) {
    int column = ldl->place[c->node_of[c->list[x - 1]]];
    if (ldl->place[c->node_of[c->list[x]]] == column + 1) between[column].sources++;
  }
}

int pw_condense_chains (pw_plan *c, pw_ldl *ldl) {
  size_t nodes = (size_t)ldl->nodes + 1;
  chain_between *between = calloc (nodes, sizeof *between);
  int *meet = calloc (nodes, sizeof *meet);
  c->chain = malloc (nodes * sizeof *c->chain);
  c->is_linked = calloc ((size_t)c->groups + 1, 1);
  int status = between && meet && c->chain && c->is_linked ? PW_OK : PW_MACHINE;
  for (int p = 0; p < c->pieces && status == PW_OK; p++) meet[ldl->place[c->node_of[p]]]++;
  for (int body = 0; body < c->k->s->bodies && status == PW_OK; body++) {
    pw_chain link;
    int column = chain_link (c, ldl, body, &link);
    if (column >= 0) between[column].link = link;
    chain_count (c, ldl, body, between);
  }
  if (status == PW_OK) chain_fill (ldl, between);
  if (status == PW_OK) chain_join (c, ldl, between, meet);
  free (between);
  free (meet);
  return status;
}
