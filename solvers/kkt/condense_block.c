/* Plans the block L D L^T: the pattern of S and the group blocks; see condense.h and block_ldl.h. */
#include <limits.h>
#include <string.h>
#include "condense.h"

/* ---- Pattern ---- */

static void condense_add_pair (pw_plan *plan, int a, int b) {
  plan->failed |= pw_grow (&plan->pair, (size_t)plan->pairs, &plan->pair_room, 2 * sizeof *plan->pair) != PW_OK;
  if (plan->failed) return;
  plan->pair[2 * plan->pairs] = a, plan->pair[2 * plan->pairs + 1] = b;
  plan->pairs++;
}

/* Lists the pairs of nodes that meet at a group, or, if that is an uncondensed body, each of them with its nodes. */
static void condense_pairs (pw_plan *plan) {
  for (int g = 0; g < plan->groups; g++) {
    int body = plan->uncondensed[g];
    for (int x = plan->start[g]; x < plan->start[g + 1]; x++) {
      int a = plan->contribution[plan->list[x]].node;
      if (body >= 0) condense_add_pair (plan, a, body), condense_add_pair (plan, a, body + 1);
      for (int y = plan->start[g]; y < x && body < 0; y++)
        condense_add_pair (plan, a, plan->contribution[plan->list[y]].node);
    }
  }
}

/* Sorts the contributions of each group by column; by insertion, since there are few. */
static void condense_sort_columns (const pw_plan *plan, const int *column_of_node) {
  for (int g = 0; g < plan->groups; g++) {
    int *list = plan->list + plan->start[g], count = plan->start[g + 1] - plan->start[g];
    for (int x = 1; x < count; x++)
      for (int y = x; y > 0; y--) {
        int a = list[y - 1], b = list[y];
        if (column_of_node[plan->contribution[a].node] <= column_of_node[plan->contribution[b].node]) break;
        list[y - 1] = b, list[y] = a;
      }
  }
}

/* ---- Groups ---- */

/* Fills the block p of group g; *contributions, *couplings: numbers of those filled so far. */
static void condense_group (const pw_plan *plan, pw_block_ldl *l, int g, pw_group_block *p, int *contributions,
                            int *couplings) {
  int j = pw_group_first (plan->saddle->s, g), body = plan->uncondensed[g];
  *p = (pw_group_block){ .j = j,
                         .first_contribution = *contributions,
                         .first_coupling = *couplings,
                         .width = (unsigned char)pw_group_width (plan->saddle->s, j),
                         .uncondensed = body >= 0 };
  for (int x = plan->start[g]; x < plan->start[g + 1]; x++) {
    const pw_plan_contribution *a = &plan->contribution[plan->list[x]];
    const pw_plan_node *n = &plan->node[a->node];
    l->contribution[(*contributions)++] =
        (pw_contribution){ a->J, n->unknown, l->column[l->column_of_node[a->node]].first_value, a->row_stride,
                           (short)n->size };
    if (body >= 0)
      for (int i = 0; i < 2; i++) l->coupling[(*couplings)++] = pw_block_find (l, a->node, body + i);
    else
      for (int y = x + 1; y < plan->start[g + 1]; y++)
        l->coupling[(*couplings)++] = pw_block_find (l, a->node, plan->contribution[plan->list[y]].node);
  }
  for (int i = body; body >= 0 && i < body + 2; i++)
    l->contribution[(*contributions)++] = (pw_contribution){ .unknown = plan->node[i].unknown,
                                                             .diagonal = l->column[l->column_of_node[i]].first_value,
                                                             .size = (short)plan->node[i].size };
}

/* Allocates and fills the groups' blocks, and the chains. */
static int condense_fill (const pw_plan *plan, pw_block_ldl *l) {
  int contributions = 0, couplings = 0, filled = 0, uncondensed = plan->saddle->extra / 3;
  l->inverse_weight = plan->saddle->inverse_weight;
  l->groups = plan->groups - plan->linked; /* bodies of chains have no block */
  for (pw_layout lay = { 0 }; pw_layout_pass (&lay, &l->memory);) {
    l->group = pw_layout_alloc (&lay, (size_t)l->groups + 1, sizeof *l->group);
    l->contribution = pw_layout_alloc (&lay, (size_t)(plan->contributions - 2 * plan->linked + 2 * uncondensed),
                                       sizeof *l->contribution);
    l->coupling = pw_layout_alloc (&lay, (size_t)(plan->pairs - plan->linked), sizeof *l->coupling);
    l->chain = pw_layout_alloc (&lay, (size_t)plan->chains + 1, sizeof *l->chain);
    l->chain_factor = pw_layout_alloc (&lay, 3 * (size_t)(plan->linked + plan->chains), sizeof *l->chain_factor);
  }
  if (l->memory == NULL) return PW_RESOURCE;
  memcpy (l->chain, plan->chain, (size_t)plan->chains * sizeof *l->chain);
  l->chain[plan->chains] = (pw_chain){ .first_column = l->nodes + 1 };
  for (int last = 0; last < 2; last++) /* uncondensed bodies last: they add to diagonals that the others store */
    for (int g = 0; g < plan->groups; g++)
      if (!plan->is_linked[g] && (plan->uncondensed[g] >= 0) == last)
        condense_group (plan, l, g, &l->group[filled++], &contributions, &couplings);
  l->group[filled] = (pw_group_block){ .first_contribution = contributions, .first_coupling = couplings };
  return PW_OK;
}

int pw_condense_block (pw_plan *plan) {
  condense_pairs (plan);
  if (plan->failed || plan->pairs >= INT_MAX / 2) return PW_RESOURCE;
  pw_block_ldl *l = plan->saddle->block = pw_block_open (plan->nodes, plan->node, plan->pairs, plan->pair);
  if (l == NULL) return PW_RESOURCE;
  condense_sort_columns (plan, l->column_of_node);
  int status = pw_condense_chains (plan, l);
  if (status == PW_OK) status = pw_block_lay_out (l);
  return status == PW_OK ? condense_fill (plan, l) : status;
}
