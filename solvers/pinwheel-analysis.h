/* Analysis of motions, on top of pinwheel-solvers.h. */
#ifndef PINWHEEL_ANALYSIS_H
#define PINWHEEL_ANALYSIS_H

#include "pinwheel-solvers.h"

PW_BEGIN

/* ---- Mobility and linearisation at the state reached (linear.c) ---- */

/* Whether eigenvalues of the linearisation are growth rates of perturbations: only if the linearised equations are
 * constant along the motion, in a frame that moves with it. */
typedef enum {
  PW_STEADY,
  PW_ACCELERATED, /* no: the state accelerates in that frame */
  PW_CHANGING     /* no: the equations depend on time, or change along the motion, within the run's span */
} pw_steadiness;

/* Mobility and linearisation.  Singular values are those of the independent rows of J, each of length 1, angles in
 * units of the length scale.  Minimal coordinates x of a perturbation, in a frame that moves with the motion, obey
 * x' = A x. */
typedef struct {
  int coordinates;
  int positions;   /* degrees of freedom of configuration: coordinates less independent holonomic rows */
  int velocities;  /* of velocity: coordinates less independent rows */
  int rank;        /* of J */
  double least;    /* smallest singular value; NaN: not computed, or no rows */
  int unknowns;    /* of the linearisation: positions + velocities */
  double *A;       /* unknowns x unknowns, by rows [1/s], positions first; NULL: not computed, like all below */
  double *re, *im; /* its eigenvalues [1/s], the fastest growing first, of a conjugate pair that with im > 0; 0 if below
                      round-off */
  unsigned char *rigid; /* unknowns: 1 for rigid displacements of the whole, under which the equations are invariant */
  int symmetries;       /* number of symmetry directions among x, y, phi */
  pw_steadiness steady;
  double twist[3];     /* velocity of the frame [m/s, m/s, rad/s] */
  double acceleration; /* the largest in that frame; angles in units of the length scale [m/s^2] */
  /* Of pw_run_linear_modes, otherwise NULL; axes are those of the frame, which are the world's at this moment. */
  double *B;     /* unknowns x signals, by rows: x' = A x + B u, u added to the signals of forces [1/s m per unit of the
                    signal]; NaN for signals of constraints, which enter with their derivatives */
  double *basis; /* 2 coordinates x unknowns, by rows: perturbation of the states, numbered as in pw_system_find_state,
                    per m of x (angles in units of L, velocities of 1/T times that) */
  double *shape; /* unknowns x 2 coordinates complex numbers (re, im): the perturbation of the states in each mode; the
                    largest of the positions, angles times L, is 1 m; 0 for rigid displacements and for eigenvalues 0,
                    of which it is not unique */
} pw_linear;

/* Linearises at the state reached.  With more than `most` coordinates only the integers are filled: the cost of the
 * rest is cubic.  Free the result in every case.  Errors: PW_RESOURCE, PW_METHOD. */
int pw_run_linearise (pw_run *r, int most, pw_linear *l, pw_error *error);
/* The same with B, basis and shape, at about three times the cost. */
int pw_run_linear_modes (pw_run *r, int most, pw_linear *l, pw_error *error);
void pw_linear_free (pw_linear *l);

/* The largest h such that the classical Runge-Kutta method damps x' = (re + i im) x with every step up to h;
 * INFINITY if im = 0 and re >= 0. */
double pw_rk4_limit (double re, double im);

PW_END

#endif
