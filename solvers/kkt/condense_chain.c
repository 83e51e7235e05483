/* Finds the chains of a scene; see condense.h and block_ldl.h. */
#include "condense.h"

/* A column, and the block between it and the next one. */
typedef struct {
  int contributions; /* to the column; 2 inside a chain */
  int sources;       /* bodies and eliminated columns that add to the block */
  pw_chain link;     /* one of these bodies as a chain of one; link.bodies is 0 if none can be in a chain */
} chain_between;

/* Fills link for a body whose two nodes are a column and the next one, the only row below it.  Returns the column; -1
 * if the body cannot be in a chain. */
static int chain_link (const pw_plan *plan, const pw_block_ldl *l, int body, pw_chain *link) {
  const int j = 3 * body, *list = plan->list + plan->start[body];
  if (plan->start[body + 1] - plan->start[body] != 2) return -1;
  const pw_plan_contribution *a = &plan->contribution[list[0]], *b = &plan->contribution[list[1]];
  int column = l->column_of_node[a->node];
  if (!a->is_pin || !b->is_pin || plan->saddle->inverse_weight[j] != plan->saddle->inverse_weight[j + 1]) return -1;
  if (l->column_of_node[b->node] != column + 1 ||
      l->column[column + 1].first_below - l->column[column].first_below != 1)
    return -1;
  *link = (pw_chain){ .first_column = column,
                      .bodies = 1,
                      .J_first = a->J,
                      .J_second = b->J,
                      .row_stride = a->row_stride,
                      .unknown = plan->node[a->node].unknown,
                      .j = j,
                      .unknown_stride = plan->node[b->node].unknown - plan->node[a->node].unknown };
  return column;
}

/* Appends the body of link, after that of last, if it continues the chain at the same strides; returns whether it
 * does. */
static int chain_add (pw_chain *chain, const pw_chain *last, const pw_chain *link) {
  int J_stride = (int)(link->J_first - last->J_first), j_stride = link->j - last->j;
  if (link->J_second - last->J_second != J_stride || link->unknown_stride != chain->unknown_stride) return 0;
  if (chain->bodies > 1 && (J_stride != chain->J_stride || j_stride != chain->j_stride)) return 0;
  chain->J_stride = J_stride;
  chain->j_stride = j_stride;
  chain->bodies++;
  return 1;
}

/* Joins links to chains. */
static void chain_join (pw_plan *plan, pw_block_ldl *l, const chain_between *between) {
  for (int p = 0; p < l->nodes;) {
    const chain_between *b = &between[p++];
    if (b->sources != 1 || b->link.bodies == 0) continue;
    pw_chain *chain = &plan->chain[plan->chains++];
    *chain = b->link;
    chain->first_factor = 3 * (plan->linked + plan->chains - 1);
    plan->is_linked[b->link.j / 3] = 1;
    for (; p < l->nodes && between[p].sources == 1 && between[p].contributions == 2; p++) {
      if (between[p].link.bodies == 0) break;
      if (!chain_add (chain, &between[p - 1].link, &between[p].link)) break;
      plan->is_linked[between[p].link.j / 3] = 1;
      l->column[p].in_chain = 1;
    }
    const pw_block_column *last = &l->column[chain->first_column + chain->bodies];
    chain->includes_last = chain->bodies > 1 && last[1].first_below == last->first_below;
    plan->linked += chain->bodies;
  }
}

/* Counts as sources the columns eliminated earlier that have both a column and the next one below them: fill-in. */
static void chain_fill (const pw_block_ldl *l, chain_between *between) {
  for (int p = 0; p < l->nodes; p++)
    for (int i = l->column[p].first_below + 1; i < l->column[p + 1].first_below; i++)
      if (l->below[i] == l->below[i - 1] + 1) between[l->below[i - 1]].sources++;
}

/* Counts a body as a source; its contributions are in the order of their columns. */
static void chain_count (const pw_plan *plan, const pw_block_ldl *l, int body, chain_between *between) {
  for (int x = plan->start[body] + 1; x < plan->start[body + 1]; x++) {
    int column = l->column_of_node[plan->contribution[plan->list[x - 1]].node];
    if (l->column_of_node[plan->contribution[plan->list[x]].node] == column + 1) between[column].sources++;
  }
}

int pw_condense_chains (pw_plan *plan, pw_block_ldl *l) {
  size_t nodes = (size_t)l->nodes;
  chain_between *between = pw_arena_alloc (&plan->arena, nodes * sizeof *between);
  plan->chain = pw_arena_alloc (&plan->arena, nodes * sizeof *plan->chain);
  plan->is_linked = pw_arena_alloc (&plan->arena, (size_t)plan->groups);
  if (!between || !plan->chain || !plan->is_linked) return PW_RESOURCE;
  for (int p = 0; p < plan->contributions; p++) between[l->column_of_node[plan->contribution[p].node]].contributions++;
  for (int body = 0; body < plan->saddle->s->bodies; body++) {
    pw_chain link;
    int column = chain_link (plan, l, body, &link);
    if (column >= 0) between[column].link = link;
    chain_count (plan, l, body, between);
  }
  chain_fill (l, between);
  chain_join (plan, l, between);
  return PW_OK;
}
