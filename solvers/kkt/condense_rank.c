/* Ranks of the nodes in a scene with uncondensed bodies; see condense.h and block_ldl.h.
 *
 * Nodes of rank 0 are eliminated before the uncondensed bodies, as if these were at rest; those of rank 2 after them.
 * The former must be regular wherever the mechanism is.  With a leg between an uncondensed body and the ground, or
 * another uncondensed body, they are not: at rest at both ends, it is singular where it is stretched.  So the nodes at
 * one end have rank 2. Then multipliers of rank 0 without force on the bodies of a leg exert none on the body at its
 * end either, since joints exert no resultant force and moment: dependent equations of rank 0 are dependent in the
 * whole mechanism.
 *
 * A leg is a set of bodies joined by nodes that touch neither uncondensed bodies nor the ground. */
#include <stdlib.h>
#include "condense.h"
#include "util.h"

typedef struct {
  pw_plan *c;
  int *parent;  /* groups, the ground: union-find; uncondensed bodies and the ground are roots */
  int *leg;     /* groups: the leg's root */
  int *surplus; /* legs: equations at uncondensed bodies less those at the ground */
} rank_plan;

static int rank_group (const pw_plan *c, int contribution) {
  return pw_group_of (c->k->s, c->contribution[contribution].j);
}

static int rank_is_uncondensed (const pw_plan *c, int group) {
  return group < c->k->s->bodies && c->uncondensed[group] >= 0;
}

/* The end of the contributions of node n. */
static int rank_end (const pw_plan *c, int n) {
  return n + 1 < c->nodes ? c->node[n + 1].first : c->contributions;
}

/* The group of a leg that node n touches, or -1; *touches: it touches an uncondensed body. */
static int rank_leg_group (const pw_plan *c, int n, int *touches) {
  int found = -1;
  *touches = 0;
  for (int p = c->node[n].first; p < rank_end (c, n); p++)
    if (rank_is_uncondensed (c, rank_group (c, p)))
      *touches = 1;
    else
      found = rank_group (c, p);
  return found;
}

/* Joins the groups of node n, with the ground if it is `grounded`.  Returns 0 if that would connect two of the
 * uncondensed bodies and the ground. */
static int rank_join (rank_plan *x, int n) {
  const pw_plan *c = x->c;
  const int first = c->node[n].first, end = rank_end (c, n);
  int at_rest = c->node[n].grounded ? c->groups : -1, root = -1;
  for (int p = first; p < end; p++) {
    root = pw_root (x->parent, rank_group (c, p));
    if (root != c->groups && !rank_is_uncondensed (c, root)) continue;
    if (at_rest >= 0 && at_rest != root) return 0;
    at_rest = root;
  }
  if (at_rest >= 0) root = at_rest;
  for (int p = first; p < end; p++) x->parent[pw_root (x->parent, rank_group (c, p))] = root;
  return 1;
}

/* Joins the legs and counts the equations at their ends. */
static void rank_find_legs (rank_plan *x) {
  const pw_plan *c = x->c;
  int touches;
  for (int g = 0; g <= c->groups; g++) x->parent[g] = g;
  for (int n = 0; n < c->nodes; n++) {
    (void)rank_leg_group (c, n, &touches);
    if (!touches && !c->node[n].grounded) rank_join (x, n);
  }
  for (int g = 0; g < c->groups; g++) x->leg[g] = pw_root (x->parent, g);
  for (int n = 0; n < c->nodes; n++) {
    int group = rank_leg_group (c, n, &touches);
    if (group >= 0 && (touches || c->node[n].grounded))
      x->surplus[x->leg[group]] += touches ? c->node[n].size : -c->node[n].size;
  }
}

int pw_condense_rank (pw_plan *c) {
  size_t n = (size_t)c->groups + 1;
  int *memory = calloc (3 * n, sizeof *memory), touches;
  rank_plan x = { c, memory, memory + n, memory + 2 * n };
  if (memory == NULL) return PW_RESOURCE;
  rank_find_legs (&x);
  for (int fewer = 0; fewer < 2; fewer++) /* the end of a leg with fewer equations comes last */
    for (int i = 0; i < c->nodes; i++) {
      int group = rank_leg_group (c, i, &touches);
      if (!touches && (group < 0 || !c->node[i].grounded)) continue;
      if (group < 0)
        c->node[i].rank = 2;
      else if ((touches == (x.surplus[x.leg[group]] < 0)) == fewer)
        c->node[i].rank = rank_join (&x, i) ? 0 : 2;
    }
  free (memory);
  return PW_OK;
}
