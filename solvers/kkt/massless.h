/* Elimination of coordinates without weight: each is matched to a constraint row and substituted out of the others.
 *
 * The rows and coordinates concerned fall apart into components (a massless body and the joints around it).  Within
 * one, the matched rows p are P in the coordinates without weight, square and regular, and H in the others, and the
 * unmatched rows i are K and Z.  With  P = L U  and  Y = K P^-1,
 *
 *     mu = P^-T f_P,   f~ = f - H^T mu,   Z~ = Z - Y H,   gamma~_i = gamma_i - Y gamma_p
 *
 * make a system without these coordinates; from its solution follow
 *
 *     lambda_p = mu - Y^T lambda_i,       a_P = P^-1 (gamma_p - H a). */
#ifndef PW_MASSLESS_H
#define PW_MASSLESS_H

#include "system.h"

/* A body's three columns of one row, or an internal coordinate's one. */
typedef struct {
  const double *J; /* in the batch */
  int column;      /* local, in the component */
  int width;
} pw_massless_block;

/* The same where some of these columns are massive. */
typedef struct {
  const double *J;
  int slot, j; /* which row; global coordinate */
  int width, column;
} pw_massive_block;

typedef struct {
  int rows, cols, pivots;
  int groups;        /* bodies and internal coordinates touched */
  int *group;        /* first global coordinate of each */
  int *group_column; /* first local column of each */
  int *row;          /* global row; the pivots first, in order */
  int *pivot;        /* local column of each pivot */
  int *massless_j;   /* global coordinate of each pivot */
  double *scale;     /* scales a pivot by the largest entry of its row at the time of matching */
  double *least;     /* scaled pivot below which the rows are matched again */
  double worst;      /* smallest pivot, relative, at most 1 */
  double left;       /* smallest Z~ relative to its terms, at most 1; and its row */
  int left_row;
  int *global;               /* cols: global coordinate of a local column */
  unsigned char *massless;   /* cols: 1 for a coordinate without weight */
  double *unit;              /* cols: length scale of an angle, 1 of a length */
  pw_massless_block *block;  /* rows x PW_MASSLESS_BLOCKS; width 0 ends a row's */
  const double **from;       /* rows x pivots: the entries of P and K in the batches */
  pw_massive_block *massive; /* those of H, then those of Z */
  int massives, massives_h;  /* all, and those of H */
  double *P;                 /* pivots x pivots: L below the diagonal, U above it, the inverse of U's diagonal on it */
  double *Y;                 /* rows x pivots; from row `pivots` on */
  double *Z;                 /* rows x cols: Z~ from row `pivots` on; scratch while matching */
  double *gamma;             /* rows: of the pivots as given, then gamma~ */
  double *lambda;            /* rows: mu of the pivots, then lambda of the others */
} pw_component;

enum { PW_MASSLESS_BLOCKS = PW_MAX_BODIES + PW_MAX_INTERNAL };

typedef struct {
  int components;
  pw_component *component, *end;
  int *component_of_row; /* -1: untouched */
  char *memory;
} pw_massless;

/* Finds the components and matches at the configuration J was evaluated at.  Errors: PW_RESOURCE, PW_INPUT (with the
 * name of a coordinate that no row determines). */
int pw_massless_open (pw_massless *r, pw_workspace *w, const double *weight, int rows, const unsigned char *active,
                      pw_error *error);
void pw_massless_close (pw_massless *r);

/* Matches a component's massless coordinates to rows at the J last evaluated, with complete pivoting over their
 * columns. Returns how many pivots were found.  For massless.c and massless_open.c alone. */
int pw_massless_match (pw_component *c);

/* Eliminates with the J last evaluated, and matches again if a pivot has become much smaller than when it was
 * matched. Returns the smallest pivot squared, relative to its row, or of an unmatched row its remainder, if smaller;
 * 0 if singular. */
double pw_massless_factor (pw_massless *r);

/* The row of that smallest pivot. */
int pw_massless_weakest (const pw_massless *r);

/* First half of a solve: f becomes f~ at the coordinates with weight, gamma~ is kept in the components. */
void pw_massless_forward (pw_massless *r, const double *gamma, double *f);

/* Second half, from a of the coordinates with weight and lambda of the unmatched rows: a of the coordinates without
 * weight (0 on entry), and lambda of the matched rows. */
void pw_massless_backward (pw_massless *r, double *a, double *lambda);

#endif
