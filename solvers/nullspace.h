/* Minimal velocities of a step: rates that satisfy the constraints by construction; equations in nullspace.c. */
#ifndef PW_NULLSPACE_H
#define PW_NULLSPACE_H

#include "method.h"

enum { PW_NULLSPACE_MOST = 256 }; /* rows: they are solved densely */

typedef struct {
  int rows;          /* active ones */
  int *place;        /* all rows: number among the active ones, or -1 */
  double *reference; /* coords x rows: W^-1 J0^T */
  double *K, *scale; /* rows x rows: J W^-1 J0^T, factorised in place; rows: the largest entry of each */
  double *mu;        /* rows */
  double *jv, *eta;  /* all rows */
  int *pivot;        /* rows */
  char *memory;
} pw_nullspace;

/* Refuses a scene with more than PW_NULLSPACE_MOST rows: PW_INPUT.  PW_MACHINE. */
int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error);
void pw_nullspace_close (pw_nullspace *b);

/* A step begins at the state the run has reached.  PW_METHOD if a signal failed. */
int pw_nullspace_begin (pw_nullspace *b, pw_run *r);

/* The rates at (t, q) with the minimal velocities that v has, into v.  Leaves the system placed there, J swept.
 * PW_RETRY where the step has gone too far for its basis, or the pose is singular. */
int pw_nullspace_rates (pw_nullspace *b, pw_run *r, double t, const double *q, double *v);

/* The same at the end of a step, onto the positions that g = 0 asks for if there is a projector; added (NULL: not
 * wanted) takes the energy that adds. */
int pw_nullspace_settle (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v, double *added);

#endif
