/* Elimination of coordinates without weight: each is matched to a constraint row and substituted out of the others.
 *
 * The rows and coordinates concerned fall apart into components (a massless body and the joints around it).  Within
 * one, the matched rows p are P in the coordinates without weight, square and regular, and H in the others, and the
 * rows i left over K and Z.  With  P = L U  and  Y = K P^-1,
 *
 *     mu = P^-T f_P,   f~ = f - H^T mu,   Z~ = Z - Y H,   gamma~_i = gamma_i - Y gamma_p
 *
 * make a system without these coordinates; from its solution follow
 *
 *     lambda_p = mu - Y^T lambda_i,       a_P = P^-1 (gamma_p - H a). */
#ifndef PW_REDUCE_H
#define PW_REDUCE_H

#include "system.h"

/* A run of columns of one row: a body's three or an element's own one. */
typedef struct {
  const double *J; /* in the slab */
  int column;      /* local, in the component */
  int width;
  int unit; /* 1, 2: the first, second row of a unit matrix or its opposite in the columns of x and y; else 0 */
} pw_reduce_piece;

/* The same of a group with weight. */
typedef struct {
  const double *J;
  int slot, j; /* which row; global coordinate */
  int width, unit, column;
} pw_reduce_heavy;

/* Two of them, rows of a unit matrix or its opposite in x and y of a body. */
typedef struct {
  const double *x, *y; /* their J */
  int slot_x, slot_y, j;
} pw_reduce_pair;

typedef struct {
  int rows, cols, pivots;
  int groups;        /* bodies and own coordinates touched */
  int *group;        /* first global coordinate of each */
  int *group_column; /* first local column of each */
  int *row;          /* global row; the pivots first, in order */
  int *pivot;        /* local column of each pivot */
  int *light;        /* global coordinate of each pivot */
  int pinned;        /* 1: three pivots, the first two a unit matrix up to signs */
  double *scale;     /* makes a pivot relative to the largest entry its row had when they were matched */
  double *least;     /* how small each of these may become before the rows are matched anew */
  double worst;      /* smallest pivot, relative, at most 1 */
  double left;       /* smallest Z~ relative to what it is the difference of, at most 1; and its row */
  int left_row;
  int *global;             /* cols: global coordinate of a local column */
  unsigned char *massless; /* cols: 1 for a coordinate without weight */
  double *unit;            /* cols: length scale of an angle, 1 of a length */
  pw_reduce_piece *piece;  /* rows x PW_REDUCE_PIECES; width 0 ends a row's */
  const double **from;     /* rows x pivots: the entries of P and K in the slabs */
  pw_reduce_heavy *heavy;  /* those of H, then those of Z */
  int heavies, heavies_h;  /* all, and those of H */
  pw_reduce_pair *pair;    /* those of H that go in pairs */
  pw_reduce_heavy *single; /* and those that do not */
  int pairs, singles;
  double *P;      /* pivots x pivots: L below the diagonal, U above it, the inverse of U's diagonal on it */
  double *Y;      /* rows x pivots; from row `pivots` on */
  double *Z;      /* rows x cols: Z~ from row `pivots` on; scratch while matching */
  double *gamma;  /* rows: of the pivots as given, then gamma~ */
  double *lambda; /* rows: mu of the pivots, then lambda of the others */
} pw_component;

enum { PW_REDUCE_PIECES = PW_MAX_BODIES + PW_MAX_OWN };

typedef struct {
  int components;
  pw_component *component, *end;
  int *component_of_row; /* -1: untouched */
  char *memory;
} pw_reduce;

/* Finds the components and matches at the pose J was swept at.  Errors: PW_MACHINE, PW_INPUT (a coordinate that no
 * row determines, by name). */
int pw_reduce_open (pw_reduce *r, pw_system *s, const double *weight, int rows, const unsigned char *active,
                    pw_error *error);
void pw_reduce_close (pw_reduce *r);

/* Matches a component's massless coordinates to rows at the J last swept, with complete pivoting over their columns.
 * Returns how many pivots were found.  For reduce.c and reduce_open.c alone. */
int pw_reduce_match (pw_component *c);

/* First half of a solve: f becomes f~ at the coordinates with weight, gamma~ is kept in the components.  fresh: eliminates
 * before that with the J last swept, and matches anew if a pivot has become much smaller than when it was matched.
 * Returns the smallest pivot squared, relative to its row, or what is left of a row over, if that is less; 0 if singular.
 * gamma NULL: only eliminates. */
double pw_reduce_forward (pw_reduce *r, int fresh, const double *gamma, double *f);

/* The row of that smallest pivot. */
int pw_reduce_weakest (const pw_reduce *r);

/* Second half, when a of the coordinates with weight and lambda of the rows left over are there: a of those without
 * (0 where it is stored so far), and lambda of the matched rows. */
void pw_reduce_backward (pw_reduce *r, double *a, double *lambda);

#endif
