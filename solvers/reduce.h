/* Elimination of coordinates without weight: each is matched to a constraint row and substituted out of the others.
 *
 * The rows and coordinates concerned fall apart into components (a massless body and the joints around it).  Within
 * one, with the pivots (row p, column c_p) in order,
 *
 *     J~ = T J,  T unit lower triangular,  J~_{i c_p} = 0 for i > p,       lambda = T^T lambda~
 *
 * so that f_c = sum_{p' <= p} J~_{p' c_p} lambda~_p' gives the multipliers of the pivot rows by forward substitution,
 * the other rows no longer see the massless coordinates, and J~_p a = gamma~_p gives these by back substitution. */
#ifndef PW_REDUCE_H
#define PW_REDUCE_H

#include "system.h"

/* A run of columns of one row: a body's three or an element's own one. */
typedef struct {
  const double *J; /* in the slab */
  int column;      /* local, in the component */
  int width;
} pw_reduce_piece;

typedef struct {
  int rows, cols, pivots;
  int groups;             /* bodies and own coordinates touched */
  int *group;             /* first global coordinate of each */
  int *group_column;      /* first local column of each */
  int *row;               /* global row; the pivots first, in order */  int *pivot;            /* local column of each pivot */
  double *matched;       /* size of each pivot when it was matched */
  double worst;          /* smallest pivot relative to its row when they were matched */
  int heavies, *heavy;   /* local columns with weight */
  int *global;            /* cols: global coordinate of a local column */
  unsigned char *light;   /* cols: 1 for a coordinate without weight */
  double *unit;           /* cols: length scale of an angle, 1 of a length */
  pw_reduce_piece *piece; /* rows x PW_REDUCE_PIECES; width 0 ends a row's */
  double *Z;              /* rows x cols: J~ */
  double *factor;         /* rows x pivots: T^-1 */
  double *gamma;          /* rows scratch */
  double *lambda;         /* rows scratch: lambda~ */
} pw_component;

enum { PW_REDUCE_PIECES = PW_MAX_BODIES + PW_MAX_OWN };

typedef struct {
  int components;
  pw_component *component;
  int *component_of_row; /* -1: untouched */
  char *memory;
} pw_reduce;

/* Finds the components and matches at the pose J was swept at.  Errors: PW_MACHINE, PW_INPUT (a coordinate that no
 * row determines, by name). */
int pw_reduce_open (pw_reduce *r, pw_system *s, const double *weight, int rows, const unsigned char *active,
                    pw_error *error);
void pw_reduce_close (pw_reduce *r);

/* Eliminates with the J last swept; matches anew if a pivot has become much smaller than when it was matched.  Returns
 * the smallest pivot squared, relative to its row, at the last matching; 0 if singular. */
double pw_reduce_factor (pw_reduce *r);

/* First half of a solve: gamma~ and lambda~ of the pivot rows are kept in the components, f -= J~_R^T lambda~_R for
 * the coordinates with weight. */
void pw_reduce_forward (pw_reduce *r, const double *gamma, double *f);

/* Second half, when a of the coordinates with weight and lambda~ of the other rows are there: a of those without,
 * and lambda. */
void pw_reduce_backward (pw_reduce *r, double *a, double *lambda);

#endif
