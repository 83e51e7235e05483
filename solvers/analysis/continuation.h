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
  /* Whether two solutions are the same, though their unknowns may differ by symmetries; NULL: these are compared. */
  int (*same) (void *context, const double *u, const double *other);
  void *context;
} pw_branch_equations;

/* A point of a branch.  Those of the caller have their own arrays. */
typedef struct {
  double *u, *tangent; /* unknowns + 1 each; the tangent has unit length */
  double residual;     /* largest |F_i| */
  int interpolated;    /* 1: on the cubic through two points, since Newton's method does not converge */
} pw_branch_point;

/* What a point is; users number their own events from PW_BRANCH_OTHER. */
enum { PW_BRANCH_POINT, PW_BRANCH_FOLD /* p has an extremum */, PW_BRANCH_OTHER };

typedef struct {
  pw_branch_point point;
  int event;
  double along; /* 0 at the point before, 1 at the point reached */
  int note;     /* of the caller: pw_branch_queue */
} pw_branch_event;

enum { PW_BRANCH_QUEUE = 8 };

static const double PW_BRANCH_SAME = 1e-6; /* largest difference of unknowns of points that are the same */

typedef struct {
  pw_branch_equations of;
  pw_branch_point at, before; /* the point reached, and the one before it */
  pw_branch_point found;      /* by pw_branch_locate */
  double step;                /* length of the next step */
  double most;                /* largest change of p that a step predicts */
  double least;               /* smallest step */
  double accuracy;            /* of events, relative to the step */
  int limit;                  /* points at most */
  int iterations;             /* of the last solution */
  double residual;            /* largest |F_i| there, or where the iteration stopped */
  int rank;                   /* of dF/dx (or of dF with the arclength condition) there */
  int folded;                 /* 1: p has an extremum between the last two points */
  /* Points of the last step not yet returned, in order; those before the last one are events. */
  pw_branch_event queue[PW_BRANCH_QUEUE];
  int queued, returned;
  /* private */
  int steps, ended;
  pw_branch_point first, next, side[2];
  int bounded; /* 1: steps beyond p = 0 to 1 or past p of the first point are refused */
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

/* Starts a branch at a solution, the first point: p increases along the tangent if direction > 0.  PW_RETRY at a fold. */
int pw_branch_start (pw_branch *b, const double *u, double direction, pw_error *error);

/* Moves to the next point.  The step length adapts to the curvature of the branch.  PW_RETRY if no step of length `least`
 * converges to a point nearby on a smooth branch.  Branches that bifurcate from it are not followed. */
int pw_branch_step (pw_branch *b, pw_error *error);

/* The next point or event of the branch in p = 0 to 1, or NULL after its last one: at an end of the range or, with the
 * reason in *why, at the first point of a closed branch, or where no step succeeds.  `events` (a status; context: that of the equations)
 * queues those of a step that are no folds; evaluations may leave their reason in *why. */
int pw_branch_next (pw_branch *b, int (*events) (void *context, pw_error *error), pw_error *why,
                    const pw_branch_event **next, pw_error *error);

/* Sets b->found to the point between the last two points where a test changes its sign; interpolated if Newton's method
 * does not converge nearby, as at bifurcations.  `test` (a status) sets *value.  Where it or F cannot be evaluated, as at
 * singular points, neighbouring points are tried. */
int pw_branch_locate (pw_branch *b,
                      int (*test) (void *context, const pw_branch_point *point, double *value, pw_error *error),
                      void *context, pw_error *error);
/* Where a point between the last two is (pw_branch_event.along). */
double pw_branch_along (const pw_branch *b, const pw_branch_point *point);
/* Queues b->found as an event. */
void pw_branch_queue (pw_branch *b, int event, int note);

#endif
