/* Minimal velocities of a step: rates that satisfy the constraints by construction; equations in nullspace.c. */
#ifndef PW_NULLSPACE_H
#define PW_NULLSPACE_H

#include "method.h"

enum { PW_NULLSPACE_MOST = 256 }; /* rows: they are solved densely */

/* A row's entries at a body, or at an internal coordinate. */
typedef struct {
  int row;             /* among the active ones */
  const double *J;     /* as last swept */
  double reference[3]; /* of W^-1 J0^T */
} pw_nullspace_piece;

typedef struct {
  int j, width; /* first coordinate, how many */
  int first;    /* its first piece; behind its last one is the next panel's first */
} pw_nullspace_block;

typedef struct {
  int rows;                  /* active ones */
  int *place;                /* all rows: number among the active ones, or -1 */
  int panels;                /* bodies and internal coordinates */
  pw_nullspace_block *panel; /* panels + 2 */
  pw_nullspace_piece *piece;
  double *K;       /* rows x rows: J W^-1 J0^T, factorised in place */
  double *inverse; /* coords: of W */
  double *mu;      /* rows */
  double *eta;     /* all rows */
  double *v;       /* coords + 3: scratch */
  int *pivot;      /* rows */
  char *memory;
} pw_nullspace;

/* Refuses a scene with more than PW_NULLSPACE_MOST rows: PW_INPUT.  PW_RESOURCE. */
int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error);
void pw_nullspace_close (pw_nullspace *b);

/* A step begins at the state the run has reached.  PW_METHOD if a signal failed. */
int pw_nullspace_begin (pw_nullspace *b, pw_run *r);

/* The rates at (t, q) with the minimal velocities that v has, into v.  Leaves the system placed there, J swept.
 * PW_RETRY where the step has gone too far for its basis, or the configuration is singular. */
int pw_nullspace_velocities (pw_nullspace *b, pw_run *r, double t, const double *q, double *v);

/* Accelerations and multipliers where the rates have just been made so.  Returns as pw_run_accelerate. */
int pw_nullspace_accelerate (pw_run *r, const double *v, double *a, double *lambda);

/* The rates at the end of a step, onto the positions that g = 0 asks for if there is a projector; added (NULL: not
 * wanted) takes the energy that adds. */
int pw_nullspace_finalise (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v, double *added);

#endif
