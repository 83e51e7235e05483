/* Ranks the nodes of a scene with uncondensed bodies; see condense.h and block_ldl.h.
 *
 * Nodes of rank 0 are eliminated before the uncondensed bodies, as if these were at rest; those of rank 2 after them.
 * The matrix of rank 0 must be regular wherever the mechanism is.  A leg is a set of bodies joined by nodes that touch
 * neither uncondensed bodies nor the ground.  If a leg joins an uncondensed body to the ground, or to another
 * uncondensed body, and both its ends were at rest, the matrix would be singular where the leg is stretched.  So the
 * nodes at one end have rank 2.  Then multipliers of rank 0 that exert no force on the bodies of a leg exert none on
 * the body at its other end either, since the forces of a joint on its two bodies are opposite: dependent equations of
 * rank 0 are dependent in the whole mechanism.  Nodes of uncondensed bodies alone have rank 2, too: with these at rest
 * their equations would be empty. */
#include "condense.h"

typedef struct {
  pw_plan *plan;
  int *parent;  /* groups and the ground: union-find; uncondensed bodies and the ground are roots */
  int *leg;     /* groups: root of the group's leg */
  int *surplus; /* roots of legs: equations at uncondensed bodies less those at the ground */
} rank_plan;

/* The end of the contributions of node n: one after the last. */
static int rank_end (const pw_plan *plan, int n) {
  return n + 1 < plan->nodes ? plan->node[n + 1].first_contribution : plan->contributions;
}

/* The group of a leg that node n touches, or -1; *touches: 1 if the node touches an uncondensed body. */
static int rank_leg_group (const pw_plan *plan, int n, int *touches) {
  int found = -1;
  *touches = 0;
  for (int p = plan->node[n].first_contribution; p < rank_end (plan, n); p++)
    if (plan->uncondensed[plan->contribution[p].group] >= 0)
      *touches = 1;
    else
      found = plan->contribution[p].group;
  return found;
}

/* Joins the groups of node n, and the ground if the node is `grounded`.  Returns 0, without joining, if that would
 * connect two uncondensed bodies, or one with the ground. */
static int rank_join (rank_plan *x, int n) {
  const pw_plan *plan = x->plan;
  const int first = plan->node[n].first_contribution, end = rank_end (plan, n);
  int at_rest = plan->node[n].grounded ? plan->groups : -1, root = -1;
  for (int p = first; p < end; p++) {
    root = pw_root (x->parent, plan->contribution[p].group);
    if (root != plan->groups && plan->uncondensed[root] < 0) continue;
    if (at_rest >= 0 && at_rest != root) return 0;
    at_rest = root;
  }
  if (at_rest >= 0) root = at_rest;
  for (int p = first; p < end; p++) x->parent[pw_root (x->parent, plan->contribution[p].group)] = root;
  return 1;
}

/* Joins the legs and counts the equations at their ends. */
static void rank_find_legs (rank_plan *x) {
  const pw_plan *plan = x->plan;
  int touches;
  for (int g = 0; g <= plan->groups; g++) x->parent[g] = g;
  for (int n = 0; n < plan->nodes; n++) {
    (void)rank_leg_group (plan, n, &touches);
    if (!touches && !plan->node[n].grounded) rank_join (x, n);
  }
  for (int g = 0; g < plan->groups; g++) x->leg[g] = pw_root (x->parent, g);
  for (int n = 0; n < plan->nodes; n++) {
    int group = rank_leg_group (plan, n, &touches);
    if (group >= 0 && (touches || plan->node[n].grounded))
      x->surplus[x->leg[group]] += touches ? plan->node[n].size : -plan->node[n].size;
  }
}

int pw_condense_rank (pw_plan *plan) {
  size_t n = (size_t)plan->groups + 1;
  int *memory = pw_arena_alloc (&plan->arena, 3 * n * sizeof *memory), touches;
  if (memory == NULL) return PW_RESOURCE;
  rank_plan x = { .plan = plan, .parent = memory, .leg = memory + n, .surplus = memory + 2 * n };
  rank_find_legs (&x);
  for (int fewer = 0; fewer < 2; fewer++) /* of a leg to the ground, the end with fewer equations comes last */
    for (int i = 0; i < plan->nodes; i++) {
      int group = rank_leg_group (plan, i, &touches);
      if (!touches && (group < 0 || !plan->node[i].grounded)) continue;
      if (group < 0)
        plan->node[i].rank = 2;
      else if ((touches == (x.surplus[x.leg[group]] < 0)) == fewer)
        plan->node[i].rank = rank_join (&x, i) ? 0 : 2;
    }
  return PW_OK;
}
