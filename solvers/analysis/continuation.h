/* Newton's method for underdetermined or degenerate equations, and continuation of their solutions in a parameter by
 * pseudo-arclength.
 *
 * The equations are F (x, p) = 0 with u = (x, p); the caller scales them so that all entries of u and F are of
 * comparable size.  Corrections are least-squares solutions of smallest norm, with a decision on the rank: F may have
 * redundant equations, and solutions need not be isolated.  To continue a branch, solutions at constant p should be
 * isolated: add for each symmetry an equation with residual 0 whose derivatives make corrections orthogonal to it.
 *
 * (Keller 1977, Numerical solution of bifurcation and nonlinear eigenvalue problems; Allgower & Georg 1990, Numerical
 * Continuation Methods.) */
#ifndef PW_CONTINUATION_H
#define PW_CONTINUATION_H

#include "pinwheel.h"

typedef struct {
  int unknowns, equations; /* entries of x and of F */
  double tolerance;        /* solutions have |F_i| <= tolerance */
  double rank_tolerance;   /* smaller singular values, relative to the largest one, count as 0; default 1e-9 */
  /* Evaluates F (equations) and, unless dF is NULL, its derivatives with respect to x, by columns: equations x
   * unknowns; both are 0 on entry.  A status; PW_RETRY, with or without an error: F cannot be evaluated at u. */
  int (*evaluate) (void *context, const double *u, double *F, double *dF, pw_error *error);
  /* Whether two solutions are the same up to symmetries; NULL: only if their unknowns are. */
  int (*same) (void *context, const double *u, const double *other);
  /* PW_RETRY, with the reason left to the caller of pw_branch_next in *why, if the step between two solutions must not
   * be made, so that the branch ends before it; or another status.  NULL: all may be made. */
  int (*check_step) (void *context, const double *from, const double *to, pw_error *error);
  void *context;
} pw_branch_problem;

/* A point of a branch. */
typedef struct {
  double *u, *tangent; /* unknowns + 1 each; the tangent has unit length */
  double residual;     /* largest |F_i| */
  int interpolated;    /* 1: on the cubic through two points: Newton's method did not converge nearby */
} pw_branch_point;

/* What a point is: p has an extremum; a real mode changes its stability; users number their own events from
 * PW_BRANCH_OTHER. */
enum { PW_BRANCH_POINT, PW_BRANCH_FOLD, PW_BRANCH_REAL, PW_BRANCH_OTHER };

typedef struct {
  pw_branch_point point;
  int event;       /* PW_BRANCH_POINT, ... */
  double fraction; /* of the step: 0 at the point before, 1 at the point reached */
  int unstable;    /* unstable modes at an event, without those that change */
} pw_branch_event;

enum { PW_BRANCH_QUEUE = 8 }; /* points and events of a step, at most */

static const double PW_BRANCH_SAME = 1e-6; /* the largest difference of unknowns of points that count as the same */

typedef struct {
  pw_branch_problem problem;
  pw_branch_point reached, previous; /* the last two points */
  pw_branch_point found;             /* by pw_branch_locate */
  /* Set these before the first step; afterwards `step` is adapted. */
  double step;           /* length of the next step */
  double max_change;     /* of p by a step, as predicted along the tangent */
  double min_step;       /* shortest step */
  double event_accuracy; /* of pw_branch_event.fraction */
  int max_points;        /* of a branch */

  int iterations;  /* of the last solution */
  double residual; /* largest |F_i| there, or where the iteration stopped; INFINITY: it could not begin */
  int folded;      /* 1: p has an extremum between the last two points */
  /* Points of the last step, in order; those before the last one are events.  `returned` of them have been returned. */
  pw_branch_event queue[PW_BRANCH_QUEUE];
  int queued, returned;
  /* private; F, J and pivot serve callers as scratch, too */
  int steps, ended;
  pw_branch_point first, next, side[2];
  int bounded; /* 1: steps beyond p = 0 to 1 or past p of the first point are refused */
  double *F, *J, *du, *trial, *work, *condition, *predicted;
  size_t bytes; /* of u */
  int *pivot, work_size;
  char *memory;
} pw_branch;

/* Finds events between the last two points, without folds, by pw_branch_find_changes.  PW_RETRY ends the branch. */
typedef int pw_branch_find_events (void *context, pw_error *error);
/* Sets *value to a function of the branch whose zero is an event; PW_RETRY where it cannot be evaluated. */
typedef int pw_branch_test (void *context, const pw_branch_point *point, double *value, pw_error *error);
/* Sets b->found to where mode number `mode` of the unstable ones becomes stable or unstable, *event to what happens
 * there, *modes to the number of modes that change there.  change: of the number of unstable modes by the step. */
typedef int pw_branch_locate_mode (void *context, int mode, int change, int *event, int *modes, pw_error *error);

/* Errors: PW_RESOURCE.  Close it in every case. */
int pw_branch_open (pw_branch *b, const pw_branch_problem *problem, pw_error *error);
void pw_branch_close (pw_branch *b);

/* Newton's method from u = (x, p) at constant p, with steps shortened until |F| decreases; first with the damping of
 * Levenberg and Marquardt, which leads to the nearest of solutions that are not isolated, and if that fails without it.
 * PW_RETRY if it does not converge: u is where it stopped. */
int pw_branch_solve (pw_branch *b, double *u, pw_error *error);

/* Ends the branch, if any: no points follow until pw_branch_start has succeeded. */
void pw_branch_end (pw_branch *b);

/* Starts a branch at a solution: p increases along the tangent if direction > 0.  PW_RETRY at a fold. */
int pw_branch_start (pw_branch *b, const double *u, double direction, pw_error *error);

/* Moves to the next point.  The step length adapts to the curvature of the branch.  PW_RETRY if no step down to
 * min_step converges to a point nearby on a smooth branch.  Branches that bifurcate from it are not followed. */
int pw_branch_step (pw_branch *b, pw_error *error);

/* The next point or event of the branch in p = 0 to 1, or NULL after its last one: at an end of the range or, with the
 * reason in *why, at the first point of a closed branch, after max_points, or where no step succeeds; evaluations may
 * leave their reason in *why.  find_events is called with problem.context. */
int pw_branch_next (pw_branch *b, pw_branch_find_events *find_events, pw_error *why, const pw_branch_event **next,
                    pw_error *error);

/* Sets b->found to the point between the last two points where a test changes its sign; interpolated if Newton's method
 * does not converge nearby, as at bifurcations.  Where the test or F cannot be evaluated, as at singular points,
 * neighbouring points are tried. */
int pw_branch_locate (pw_branch *b, pw_branch_test *test, void *context, pw_error *error);
/* Queues the changes of stability in the last step, at whose ends `before` and `now` modes are unstable.  A fold near
 * which a real mode changes its stability is one event.  `locate` is called with problem.context. */
int pw_branch_find_changes (pw_branch *b, int before, int now, pw_branch_locate_mode *locate, pw_error *error);

#endif
