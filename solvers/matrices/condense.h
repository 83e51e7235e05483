/* Condensation of a saddle-point system to its constraint equations: planned by condense*.c, carried out by block_*.c.
 *
 * Equations are grouped into nodes of 1 or 2 with the same columns.  A node contributes to a group of its coordinates
 * (massless.h) if at least one coordinate of that group has a finite weight other than 0.  An uncondensed body
 * (block_ldl.h) adds two nodes of its own, for -a_k.  Coupled, i.e. with a block in the matrix, are two nodes that
 * contribute to the same condensed group, and the two nodes of an uncondensed body with every node that contributes to
 * it. */
#ifndef PW_CONDENSE_H
#define PW_CONDENSE_H

#include "block_ldl.h"
#include "massless.h"
#include "util.h"

struct pw_saddle {
  const pw_system *s;
  const pw_workspace *w; /* contains J */
  int rows;              /* of J: all, or the holonomic ones */
  double postponed;      /* > 0: not factorised yet; the pivots are at least this (pw_saddle_postpone) */
  pw_massless massless;
  double *inverse_weight; /* coords + 3: 1 / weight; 0 for prescribed and massless coordinates, and the ground's */
  double *force;          /* coords: f~ of massless.h */
  int extra;              /* unknowns besides the multipliers of rows: 3 for each uncondensed body */
  double *y;              /* s->rows + extra: right-hand side and solution; NULL without extra unknowns */
  pw_block_ldl *block;    /* NULL if there is a dependent_row: nothing is planned then */
  int dependent_row;      /* one that depends on others in every configuration; -1: none */
  int *inactive;          /* rows outside massless components whose multiplier is 0 */
  int inactive_count;
  double pivot;  /* smallest when last factorised: of `block`, the squared sine of the angle between a row and those
                  * before it; of `massless`, see pw_massless_factor */
  int pivot_row; /* that row; -1: none, or one of a massless component */
  char *memory;
};

/* Plans everything but `massless`, which must be open.  weight, active: as for pw_saddle_open.  Errors: PW_RESOURCE. */
int pw_condense (struct pw_saddle *saddle, const double *weight, const unsigned char *active);

/* The contribution of a node to a group. */
typedef struct {
  const double *J; /* its entry in the node's first row and the group's first column */
  int node;
  int row_stride; /* from row to row of J */
  int group;
  int is_pin;        /* 1: both rows of a pin, whose x and y columns are the unit matrix or its negative */
  int is_prescribed; /* 1: some of the group's coordinates are prescribed */
} pw_plan_contribution;

typedef struct {
  struct pw_saddle *saddle;
  const double *weight;
  pw_plan_node *node;
  pw_plan_contribution *contribution; /* those of a node follow one another */
  int *pair;                          /* 2 x pairs: coupled nodes */
  int nodes, contributions;
  long pairs;
  size_t node_room, contribution_room, pair_room; /* number of entries for which each has room */
  int failed;                                     /* 1: out of memory */
  int groups;
  int *start, *list; /* contributions to group g: list[start[g]] to list[start[g + 1] - 1] */
  int *uncondensed;  /* groups: first of the two nodes of an uncondensed body, or -1 */
  pw_chain *chain;
  int chains, linked;       /* number of chains; number of bodies in them */
  unsigned char *is_linked; /* groups: 1 for a body in a chain */
  pw_arena arena;           /* contains the arrays whose length is known beforehand */
} pw_plan;

/* Ranks the nodes of a scene with uncondensed bodies.  PW_OK or PW_RESOURCE. */
int pw_condense_rank (pw_plan *plan);

/* Opens and lays out saddle->block, without factorising.  Errors: PW_RESOURCE. */
int pw_condense_block (pw_plan *plan);

/* Finds the chains, and marks their inner columns (in_chain).  The contributions to each group in plan->list must be
 * sorted by the columns of their nodes in l.  PW_OK or PW_RESOURCE. */
int pw_condense_chains (pw_plan *plan, pw_block_ldl *l);

#endif
