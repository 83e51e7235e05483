/* Null-space velocities of a step, whose velocities satisfy the constraints by construction; equations in nullspace.c. */
#ifndef PW_NULLSPACE_H
#define PW_NULLSPACE_H

#include "method.h"

enum { PW_NULLSPACE_MOST = 256 }; /* constraint equations: their matrix is dense */

typedef struct {
  int rows;          /* active ones */
  int *place;        /* all equations: index among the active ones, or -1 */
  double *reference; /* coords x rows: W^-1 J0^T */
  double *K;         /* rows x rows: J W^-1 J0^T, factorised in place */
  double *mu;        /* rows */
  double *eta;       /* all equations */
  double *v;         /* coords + 3: scratch */
  int *pivot;        /* rows */
  char *memory;
} pw_nullspace;

/* PW_INPUT if the scene has more than PW_NULLSPACE_MOST independent constraint equations; PW_RESOURCE. */
int pw_nullspace_open (pw_nullspace *b, pw_run *r, pw_error *error);
void pw_nullspace_close (pw_nullspace *b);

/* Begins a step at the current state of the run.  PW_METHOD if a signal failed. */
int pw_nullspace_begin (pw_nullspace *b, pw_run *r);

/* Replaces v by the velocities at (t, q) with the same null-space velocities; updates kinematics and J.  PW_RETRY if the
 * step is too large for its basis, or the configuration is singular; PW_METHOD if a signal failed. */
int pw_nullspace_velocities (pw_nullspace *b, pw_run *r, double t, const double *q, double *v);

/* Accelerations and multipliers right after pw_nullspace_velocities.  Returns as pw_run_accelerate. */
int pw_nullspace_accelerate (pw_run *r, const double *v, double *a, double *lambda);

/* Velocities at the end of a step, after projecting positions onto g = 0 if there is a projector; *added grows by the
 * energy this adds, unless added is NULL. */
int pw_nullspace_finalise (pw_nullspace *b, pw_projector *p, pw_run *r, double t, double *q, double *v, double *added);

#endif
