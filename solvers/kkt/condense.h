/* How a scene's rows are condensed: what saddle.c executes and condense.c plans.  For saddle.c and condense*.c only.
 *
 * Rows are grouped into nodes, runs of up to 3 rows of one element; the columns of a node fall into pieces, one for each
 * body or own coordinate with weight.  Two pieces in the same columns make a block of S = J W^-1 J^T.  Small scenes
 * know only rows (small.h), large ones nodes and pieces (large.h). */
#ifndef PW_CONDENSE_H
#define PW_CONDENSE_H

#include "large.h"
#include "reduce.h"
#include "small.h"

/* A row of a component with massless coordinates: its position and its values. */
typedef struct {
  int y;
  double *gamma, *lambda;
} pw_extra;

struct pw_saddle {
  pw_system *s;
  int rows, unknowns;
  pw_reduce reduce;
  double *inverse; /* coords + 3: 1 / weight; 0 for held ones and those without weight; the ground's 0 */
  double *force;   /* coords + 3: forces changed by `reduce` */
  double *y;       /* s->rows and `more`: gamma and lambda where there are more unknowns than rows */
  int more;        /* extras, and 3 for each kept body */
  pw_small *small; /* a small scene, */
  pw_small *plain; /* the same, if nothing is to be done before and after */
  pw_large *large; /* or a large one */
  pw_extra *extra;
  int extras;
  int *idle; /* rows that take no part */
  int idles;
  double pivot; /* squared, of `reduce` and a large scene's last factorisation */
  int pivot_row;
  double guard; /* squared: the least that is good */
  char *memory;
};

/* Plans everything but `reduce`, which is there.  Errors: PW_MACHINE. */
int pw_condense (struct pw_saddle *k, const double *weight, int rows, const unsigned char *active);

/* ---- Planning ---- */

enum { PW_PLAN_EXTRA = -1, PW_PLAN_KEPT = -2 };

/* Columns of a node. */
typedef struct {
  const double *J;
  int step, j, width;
  int unit; /* 1: two rows whose x and y columns are a multiple of the unit matrix */
} pw_plan_piece;

typedef struct {
  int size;               /* rows */
  int row;                /* the first global one; PW_PLAN_EXTRA: a row of a component; PW_PLAN_KEPT: a kept body */
  int rank;               /* order of elimination */
  int y;                  /* in the right-hand side */
  double *gamma, *lambda; /* of a row of a component */
} pw_plan_node;

/* Nodes and pieces; while the arrays are NULL they are only counted. */
typedef struct {
  struct pw_saddle *k;
  pw_plan_node *node;
  pw_plan_piece *piece;
  int *node_of; /* pieces */
  int nodes, pieces;
  int *start, *list; /* pieces by coordinate: list[start[j]] .. list[start[j + 1]] */
  int groups;        /* bodies, then own coordinates */
  int *group;        /* those in no chain: their first coordinates, in the order in which they are needed */
  int *begun;        /* the first column whose elimination changes a column */
  int *kept;         /* bodies: the node of one that is kept, or -1 */
  int keeps;
  pw_chain *chain;
  int chains, linked;       /* of these; bodies in them */
  unsigned char *is_linked; /* groups: 1 for a body in a chain */
  long pairs;               /* of nodes that meet */
} pw_plan;

/* The first coordinate of a group: bodies, then own coordinates. */
static inline int pw_plan_group (const pw_plan *c, int n) {
  int bodies = c->k->s->bodies;
  return n < bodies ? 3 * n : n + 2 * bodies;
}

/* 3 columns of a body, 1 of an own coordinate. */
static inline int pw_plan_width (const pw_plan *c, int j) {
  return j < 3 * c->k->s->bodies ? 3 : 1;
}

/* The first column whose elimination changes what a group assembles: that has to be done by then. */
int pw_plan_column (const pw_plan *c, const pw_ldl *ldl, int j);

/* The node of a kept body, or -1. */
static inline int pw_plan_kept (const pw_plan *c, int j) {
  return j < 3 * c->k->s->bodies ? c->kept[j / 3] : -1;
}

/* Finds the chains, and marks their inner columns; the pieces of each group are in the order of their columns.  PW_OK or
 * PW_MACHINE. */
int pw_condense_chains (pw_plan *c, pw_ldl *ldl);

/* Fills k->small, with room for c->groups blocks. */
void pw_condense_small (const pw_plan *c, const double *weight, pw_body_block *block);

/* Makes k->large; the pattern becomes its own.  Errors: PW_MACHINE. */
int pw_condense_large (pw_plan *c, pw_ldl *ldl);
void pw_large_close (pw_large *l);

#endif
