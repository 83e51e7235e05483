/* Elimination of coordinates without weight (saddle.h), called massless; the others are massive.  Each massless one is
 * matched to a constraint row and substituted out of the other rows.
 *
 * The rows and coordinates concerned form independent components, such as a massless body and its joints.  In each,
 * Gaussian elimination of the massless columns, with the matched rows p as pivot rows, leaves
 *
 *     [ P H ]   [ L 0 ] [ U H' ]       P, H: matched rows in the massless and in the massive columns
 *     [ K Z ] = [ R 1 ] [ 0 Z' ]       K, Z: unmatched rows i
 *
 * With  f_P  the forces at the massless coordinates,  w = U^-T f_P,  f~ = f - H'^T w,  gamma~ = [ L 0 ; R 1 ]^-1 gamma,
 * the rows Z' and the massive coordinates form a system without the massless ones.  Its solution yields
 *
 *     a_P = U^-1 (gamma~_p - H' a),       lambda_p = L^-T (w - R^T lambda_i). */
#ifndef PW_MASSLESS_H
#define PW_MASSLESS_H

#include "system.h"

enum { PW_MASSLESS_GROUPS = PW_MAX_BODIES + PW_MAX_INTERNAL }; /* most groups of one element */

/* Groups of coordinates: each body's three, then each internal coordinate alone.  Their number. */
static inline int pw_groups (const pw_system *s) {
  return s->coords - 2 * s->bodies;
}
/* The group of coordinate j. */
static inline int pw_group_of (const pw_system *s, int j) {
  return j < 3 * s->bodies ? j / 3 : j - 2 * s->bodies;
}
/* The first coordinate of a group. */
static inline int pw_group_first (const pw_system *s, int group) {
  return group < s->bodies ? 3 * group : group + 2 * s->bodies;
}
/* The number of coordinates in the group that begins with coordinate j. */
static inline int pw_group_width (const pw_system *s, int j) {
  return j < 3 * s->bodies ? 3 : 1;
}

/* The number of columns in the group that begins with local column x of an element. */
static inline int pw_group_columns (const pw_kind *kind, int x) {
  return x < 3 * kind->bodies ? 3 : 1;
}

/* 1 if an element's equations may change under a rigid displacement of its bodies: it touches the ground, acts on
 * fewer than two bodies, or is nonholonomic. */
static inline int pw_is_grounded (const pw_system *s, const pw_element_batch *k, int e) {
  int grounded = k->kind->bodies < 2 || k->row >= s->holonomic;
  for (int b = 0; b < k->kind->bodies; b++) grounded |= k->column[e * k->kind->bodies + b] >= s->coords;
  return grounded;
}

/* A group of a component, whose coordinates are numbered as its local columns. */
typedef struct {
  int j, width; /* first global coordinate; 3 of a body, or 1 */
  int column;   /* first local column */
} pw_massless_group;

/* A row of a component.  Entries in columns of angles are multiplied by 1 / L before they are compared with others. */
typedef struct {
  int equation;          /* its constraint equation */
  int pivot_column;      /* matched rows: the local column of the coordinate */
  double largest;        /* largest entry when last matched */
  double pivot_scale;    /* matched rows: factor that makes the pivot relative to `largest` */
  double rematch_below;  /* matched rows: the relative pivot below which the component is matched again */
  double squared_terms;  /* unmatched rows: sum of squares: entries, and what is subtracted from the massive ones */
  double gamma;          /* gamma~ */
  double lambda;         /* the multiplier; of matched rows w before that */
  const double **source; /* groups: its entries in the batch, or zeros */
} pw_massless_row;

typedef struct {
  int rows, cols, groups;
  int pivots;   /* matched rows */
  int grounded; /* 1: one of its elements is (pw_is_grounded) */
  pw_massless_group *group;
  int *global;                   /* cols: global coordinate */
  unsigned char *is_massless;    /* cols: 1 for a coordinate without weight */
  int *massive, massives;        /* local columns of the others */
  double *squared_scale;         /* cols: 1, or for an angle 1 / L^2 */
  double *massive_squared_scale; /* cols: the same, 0 for a massless coordinate */
  pw_massless_row *row;          /* the matched ones first, in the order of elimination */
  int *unknown; /* rows: index in gamma and lambda for the unmatched row i, whichever row that is after matching again;
                 * -1: its multiplier is 0 */
  double *A;    /* rows x stride: U, with inverses on its diagonal, and H', or 0 and Z'; then L, or R */
  int first_L_column; /* of L and R in A: cols rounded up to an even number */
  int stride;         /* from row to row of A */
  double least_pivot; /* the smallest pivot relative to its row, or norm of a row of Z' relative to its terms */
} pw_component;

typedef struct {
  int components;
  pw_component *component, *end;
  int *component_of_row; /* s->rows; -1: inactive, or without massless coordinates */
  char *memory;
} pw_massless;

/* Finds the components and matches them with the J last evaluated; weight, rows, active: as for pw_saddle_open.  PW_OK,
 * PW_RESOURCE, or PW_INPUT with the error that names a coordinate that no row determines.  Close it in every case. */
int pw_massless_open (pw_massless *m, pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                      pw_error *error);
void pw_massless_close (pw_massless *m);

/* Matches a component's massless coordinates to rows at the J last evaluated, with complete pivoting over their
 * columns, and eliminates them.  Returns the number of pivots found. */
int pw_massless_match (pw_component *c);

/* 1 if an entry of row i of Z' is larger than what round-off leaves of its terms; column: local. */
int pw_massless_is_entry (const pw_component *c, int i, int column);

/* Eliminates with the J last evaluated, and matches again if a pivot has become much smaller than when it was matched.
 * Returns the square of the least of all `least_pivot`, at most 1; 0 if singular. */
double pw_massless_factor (pw_massless *m);

/* First half of a solution: f becomes f~ at the massive coordinates, gamma becomes gamma~ at `unknown` of unmatched
 * rows. */
void pw_massless_forward (pw_massless *m, double *f, double *gamma);

/* Second half: from a of the massive coordinates and lambda at `unknown` of unmatched rows, a of the massless
 * coordinates and lambda of all rows. */
void pw_massless_backward (pw_massless *m, double *a, double *lambda);

#endif
