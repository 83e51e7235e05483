/* Newton's method for underdetermined or degenerate equations, and continuation of their solutions in a parameter by
 * pseudo-arclength.
 *
 * The equations are F (x, p) = 0 with u = (x, p), in units of the caller: all entries of u and F are dimensionless and
 * of comparable size.  Every linear system is solved by least squares with the smallest norm and a decision on the rank,
 * so that F may have redundant equations, and solutions need not be isolated.  To continue a branch, solutions at
 * constant p should be isolated: add one equation for each symmetry, such as "corrections are orthogonal to the orbit
 * of the group", with residual 0.
 *
 * (Keller 1977, Numerical solution of bifurcation and nonlinear eigenvalue problems; Allgower & Georg 1990, Numerical
 * Continuation Methods.) */
#ifndef PW_CONTINUATION_H
#define PW_CONTINUATION_H

#include "pinwheel.h"

typedef struct {
  int unknowns, equations; /* entries of x and of F */
  double tolerance;        /* solutions have |F_i| <= tolerance */
  double rank;             /* smaller singular values, relative to the largest one, count as 0; default 1e-9 */
  /* Evaluates F (equations) and, unless dF is NULL, its derivatives with respect to u by columns: equations x
   * (unknowns + 1); both are 0 before.  A status; PW_RETRY, with or without an error: F cannot be evaluated there. */
  int (*evaluate) (void *context, const double *u, double *F, double *dF, pw_error *error);
  void *context;
} pw_branch_equations;

/* A point of a branch. */
typedef struct {
  double *u, *tangent; /* unknowns + 1 each; the tangent has unit length */
  double residual;     /* largest |F_i| */
  int interpolated;    /* 1: on the cubic through two points, since Newton's method does not converge */
} pw_branch_point;

typedef struct {
  pw_branch_equations of;
  pw_branch_point at, before; /* the point reached, and the one before it */
  double step;                /* length of the next step */
  double most;                /* largest change of p that a step predicts */
  double least;               /* smallest step */
  int iterations;             /* of the last solution */
  double residual;            /* largest |F_i| there, or where the iteration stopped */
  int rank;                   /* of dF/dx (or of dF with the arclength condition) there */
  int folded;                 /* 1: p has an extremum between the last two points */
  /* private */
  pw_branch_point next, end, side[2];
  double limit; /* of p, sought */
  double *F, *J, *du, *trial, *work, *condition, *predicted;
  int *pivot, room;
  char *memory;
} pw_branch;

/* Errors: PW_RESOURCE.  Close it in every case. */
int pw_branch_open (pw_branch *b, const pw_branch_equations *of, pw_error *error);
void pw_branch_close (pw_branch *b);

/* Newton's method from u = (x, p) at constant p, with steps shortened until |F| decreases; first with the damping of
 * Levenberg and Marquardt, which leads to the nearest of solutions that are not isolated, then without.  PW_RETRY, and
 * *u is where it stopped, if it does not converge. */
int pw_branch_solve (pw_branch *b, double *u, pw_error *error);

/* Starts a branch at a solution: p increases along the tangent if direction > 0.  PW_RETRY at a fold. */
int pw_branch_start (pw_branch *b, const double *u, double direction, pw_error *error);

/* The next point.  The step length adapts to the curvature of the branch.  PW_RETRY if no step of length `least`
 * converges to a point nearby on a smooth branch.  Branches that bifurcate from it are not followed. */
int pw_branch_step (pw_branch *b, pw_error *error);

/* The point between the last two points where a test changes its sign, to `accuracy` of their distance; interpolated if
 * Newton's method does not converge nearby, as at bifurcations.  `test` (a status) sets *value; *point has its own arrays. */
int pw_branch_locate (pw_branch *b,
                      int (*test) (void *context, const pw_branch_point *point, double *value, pw_error *error),
                      void *context, double accuracy, pw_branch_point *point, pw_error *error);

/* If the point reached is beyond the range 0 to 1 of p: moves it back to its end, and sets *ended. */
int pw_branch_at_end (pw_branch *b, int *ended, pw_error *error);
/* 1 if the last step has passed the point `first`, in the same direction: the branch is closed. */
int pw_branch_closed (const pw_branch *b, const pw_branch_point *first);

/* Copies a point to one with its own arrays. */
void pw_branch_copy (const pw_branch *b, const pw_branch_point *from, pw_branch_point *to);

/* For pw_branch_locate: the last entry of the tangent. */
int pw_branch_fold (void *context, const pw_branch_point *point, double *value, pw_error *error);

#endif
