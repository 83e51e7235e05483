/* Ranks the nodes of a scene with uncondensed bodies; see condense.h and block_ldl.h.
 *
 * Nodes of rank 0 are eliminated before the uncondensed bodies, as if these were at rest; those of rank 2 after them.
 * The matrix of rank 0 must be regular wherever the mechanism is.  A leg is a set of bodies joined by nodes that touch
 * neither uncondensed bodies nor the ground.  If a leg joins an uncondensed body to the ground, or to another
 * uncondensed body, and both its ends were at rest, the matrix would be singular where the leg is stretched.  So the
 * nodes at one end have rank 2: at the ground, or at one of the two bodies.  Then multipliers of rank 0 that exert no
 * force on the bodies of a leg exert none on the body at its other end either, since the forces of a joint on its two
 * bodies are opposite: dependent equations of rank 0 are dependent in the whole mechanism.  Nodes of uncondensed bodies
 * alone have rank 2, too: with these at rest their equations would be empty.  The rolling equation of a wheel has rank
 * 0: no other equation contains the wheel's spin. */
#include "condense.h"

/* The end of the contributions of node n: one after the last. */
static int rank_end (const pw_plan *plan, int n) {
  return n + 1 < plan->nodes ? plan->node[n + 1].first_contribution : plan->contributions;
}

/* 1 if node n touches the ground, or prescribed coordinates of a condensed body, which are at rest as well. */
static int rank_is_grounded (const pw_plan *plan, int n) {
  int grounded = plan->node[n].grounded;
  for (int p = plan->node[n].first_contribution; p < rank_end (plan, n); p++)
    grounded |= plan->contribution[p].is_prescribed && plan->uncondensed[plan->contribution[p].group] < 0;
  return grounded;
}

/* 1 for a node that touches an uncondensed body; of the others 2 if it is grounded, else 0. */
static int rank_turn (const pw_plan *plan, int n) {
  for (int p = plan->node[n].first_contribution; p < rank_end (plan, n); p++)
    if (plan->uncondensed[plan->contribution[p].group] >= 0) return 1;
  return rank_is_grounded (plan, n) ? 2 : 0;
}

/* Joins the groups of node n, and the ground if the node is grounded.  Returns 0, without joining, if that would
 * connect two uncondensed bodies, or one with the ground, or if the node touches uncondensed bodies alone.  parent:
 * groups and the ground: union-find, in which uncondensed bodies and the ground are roots. */
static int rank_join (const pw_plan *plan, int *parent, int n) {
  const int first = plan->node[n].first_contribution, end = rank_end (plan, n);
  int at_rest = rank_is_grounded (plan, n) ? plan->groups : -1, root = -1, moves = first == end;
  if (plan->node[n].rolls && plan->contribution[end - 1].group >= plan->saddle->s->bodies) return 1;
  for (int p = first; p < end; p++) {
    moves |= plan->uncondensed[plan->contribution[p].group] < 0;
    root = pw_root (parent, plan->contribution[p].group);
    if (root != plan->groups && plan->uncondensed[root] < 0) continue;
    if (at_rest >= 0 && at_rest != root) return 0;
    at_rest = root;
  }
  if (!moves) return 0;
  if (at_rest >= 0) root = at_rest;
  for (int p = first; p < end; p++) parent[pw_root (parent, plan->contribution[p].group)] = root;
  return 1;
}

int pw_condense_rank (pw_plan *plan) {
  int *parent = pw_arena_alloc (&plan->arena, ((size_t)plan->groups + 1) * sizeof *parent);
  if (parent == NULL) return PW_RESOURCE;
  for (int g = 0; g <= plan->groups; g++) parent[g] = g;
  for (int turn = 0; turn < 3; turn++) /* the legs, then their ends at uncondensed bodies, then those at the ground */
    for (int n = 0; n < plan->nodes; n++)
      if (rank_turn (plan, n) == turn && !rank_join (plan, parent, n)) plan->node[n].rank = 2;
  return PW_OK;
}
