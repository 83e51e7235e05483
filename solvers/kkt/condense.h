/* Condensation of a saddle-point system to its constraint equations: planned by condense*.c, carried out by saddle.c.
 *
 * Equations are grouped into nodes of 1 or 2 with the same columns.  A node has a contribution at each body or internal
 * coordinate of its equations whose weight, its entry of W (saddle.h), is not 0.  Two contributions at the same body or
 * coordinate make a block of S = J W^-1 J^T. */
#ifndef PW_CONDENSE_H
#define PW_CONDENSE_H

#include "block_ldl.h"
#include "massless.h"

struct pw_saddle {
  const pw_system *s;
  const pw_workspace *w; /* contains J */
  int rows;              /* of J: all, or the holonomic ones */
  double postponed;      /* > 0: not factorised yet; specialised code has found pivots of at least this */
  pw_massless massless;
  double *inverse_weight; /* coords + 3: 1 / weight; 0 for prescribed ones and those without weight, and the ground's */
  double *force;          /* coords: forces changed by `massless` */
  int extra;              /* unknowns besides the multipliers of rows: 3 for each uncondensed body */
  double *y;              /* s->rows + extra: right-hand side and solution; NULL without extra unknowns */
  pw_block_ldl *block;
  int *inactive; /* rows that are not enforced */
  int inactive_count;
  double pivot;  /* smallest pivot of `massless` and `block` when last factorised, the squared sine between a row and
                    those before it */
  int pivot_row; /* its row; -1: none, or of a massless component */
  char *memory;
};

/* Plans everything but `massless`, which must be open.  weight: coords; active: s->rows, 0 for rows not enforced, or
 * NULL: all are.  Errors: PW_RESOURCE. */
int pw_condense (struct pw_saddle *saddle, const double *weight, const unsigned char *active);

/* ---- Planning ---- */

/* A node's columns at a body or internal coordinate, whose first coordinate is j. */
typedef struct {
  const double *J;
  int node;
  int row_stride; /* from row to row of J */
  int j;
  int is_pin; /* 1: both rows of a pin, whose x and y columns are a multiple of the unit matrix */
} pw_plan_contribution;

typedef struct {
  struct pw_saddle *saddle;
  const double *weight;
  pw_plan_node *node;
  pw_plan_contribution *contribution; /* those of a node follow one another */
  int *pair;                          /* 2 x pairs: nodes with a common coordinate */
  int nodes, contributions;
  long pairs;
  size_t node_room, contribution_room, pair_room; /* allocated */
  int failed;                                     /* 1: out of memory */
  int *start, *list; /* contributions by coordinate: list[start[j]] .. list[start[j + 1] - 1] */
  int groups;        /* number of bodies and internal coordinates */
  int *uncondensed;  /* bodies: first of the two nodes of an uncondensed body, or -1 */
  pw_chain *chain;
  int chains, linked;       /* number of chains; number of bodies in them */
  unsigned char *is_linked; /* groups: 1 for a body in a chain */
} pw_plan;

/* Ranks the nodes of a scene with uncondensed bodies.  PW_OK or PW_RESOURCE. */
int pw_condense_rank (pw_plan *plan);

/* Makes the saddle's block L D L^T.  Errors: PW_RESOURCE. */
int pw_condense_block (pw_plan *plan);

/* Finds the chains, and marks their inner columns.  Requires plan->list sorted within each group by the columns of the
 * nodes in l.
 * PW_OK or PW_RESOURCE. */
int pw_condense_chains (pw_plan *plan, pw_block_ldl *l);

#endif
