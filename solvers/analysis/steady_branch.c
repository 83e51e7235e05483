/* Branches of steady motions: points, folds and changes of stability. */
#include <math.h>
#include <stdlib.h>
#include "steady_parts.h"
#include "util.h"

static const double BRANCH_MIN_STEP = 1e-7, /* in scaled unknowns; the range of the parameter is 1 */
    BRANCH_ACCURACY = 1e-9;                 /* of events, relative to the step */
enum { BRANCH_MAX_POINTS = 100 /* as a multiple of those that the settings ask for */ };

int pw_steady_follow (pw_steady *x, const double *q, const double *v, double parameter, int direction,
                      pw_error *error) {
  pw_error ignored = { 0 };
  if (error == NULL) error = &ignored;
  if (pw_require (x, "a search", error) != PW_OK) return PW_INPUT;
  pw_branch_end (&x->branch);
  if (pw_require (q, "q", error) != PW_OK || pw_require (v, "v", error) != PW_OK) return PW_INPUT;
  const double first = x->settings.first, last = x->settings.last;
  if (pw_check_branch (direction, first, last, error) != PW_OK || pw_check_parameter (parameter, error) != PW_OK)
    return PW_INPUT;
  pw_steady_motion motion;
  x->free_symmetries = 0;
  int status = pw_steady_nearest (x, q, v, x->u, error);
  x->u[pw_steady_unknowns (x)] = (parameter - first) / (last - first);
  if (status == PW_OK) status = pw_branch_solve (&x->branch, x->u, error);
  if (status == PW_OK) status = pw_steady_motion_at (x, x->u, &motion, error);
  if (status == PW_OK) status = pw_steady_find_free_symmetries (x);
  if (status == PW_OK) status = pw_branch_start (&x->branch, x->u, direction, error);
  if (status == PW_RESOURCE) return pw_fail_memory (x->s, error);
  if (status != PW_OK)
    return status < 0 && error->status ? status : pw_fail (error, PW_METHOD, "the branch cannot be followed from here");
  x->unstable = motion.unstable;
  x->branch.max_change = 1.0 / x->settings.points, x->branch.step = x->branch.max_change / 4;
  x->branch.min_step = BRANCH_MIN_STEP, x->branch.event_accuracy = BRANCH_ACCURACY;
  x->branch.max_points = BRANCH_MAX_POINTS * x->settings.points;
  return PW_OK;
}

/* ---- Events ---- */

/* The real part of eigenvalue number `sought` of those whose real part is not 0, without rigid displacements, and its
 * imaginary part; -1 if there are fewer. */
static double branch_eigenvalue (const pw_steady *x, int sought, double *im) {
  const pw_linear *l = &x->linear;
  for (int i = 0; i < l->unknowns; i++) {
    if (l->re[i] == 0 || l->rigid[i]) continue;
    if (sought-- == 0) return *im = l->im[i], l->re[i];
  }
  return *im = 0, -1;
}

/* pw_branch_test.  If as many eigenvalues have real part 0 as at both ends of the step (x->neutral_at_ends): the real
 * part that changes its sign; if more have: 0; otherwise 1 if more than `sought` modes grow, or else -1. */
static int branch_test (void *steady, const pw_branch_point *point, double *value, pw_error *error) {
  pw_steady *x = steady;
  pw_steady_motion motion;
  double im;
  int status = pw_steady_motion_at (x, point->u, &motion, error);
  if (status != PW_OK) return status;
  *value = motion.unstable > x->sought ? 1 : -1;
  if (x->neutral_at_ends == x->neutral) *value = branch_eigenvalue (x, x->sought, &im);
  if (x->neutral_at_ends >= 0 && x->neutral_at_ends < x->neutral) *value = 0;
  return PW_OK;
}

/* Whether a conjugate pair changes the sign of its real part at the point located; in the step `changing` modes do. */
static int branch_pair (const pw_steady *x, int changing) {
  double im;
  branch_eigenvalue (x, x->sought, &im);
  if (x->neutral_at_ends < 0) return im != 0 || changing == 2;
  return x->neutral > x->neutral_at_ends ? x->neutral - x->neutral_at_ends >= 2 : im != 0;
}

/* pw_branch_locate_mode: changes of the sign of a real part. */
static int branch_locate (void *steady, int mode, int change, int *event, int *modes, pw_error *error) {
  pw_steady *x = steady;
  x->sought = mode;
  int status = pw_branch_locate (&x->branch, branch_test, x, error);
  if (status != PW_OK) return status;
  const int pair = branch_pair (x, abs (change));
  *event = pair ? PW_STEADY_OSCILLATION : PW_STEADY_REAL, *modes = 1 + pair;
  return PW_OK;
}

/* pw_branch_find_events */
static int branch_events (void *steady, pw_error *error) {
  pw_steady *x = steady;
  pw_steady_motion motion;
  int before = x->unstable, neutral = x->neutral, status = pw_steady_motion_at (x, x->branch.reached.u, &motion, error);
  if (status != PW_OK) return status;
  x->unstable = motion.unstable;
  x->neutral_at_ends = neutral == x->neutral ? neutral : -1;
  neutral = x->neutral;
  status = pw_branch_find_changes (&x->branch, before, x->unstable, branch_locate, error);
  x->neutral = neutral;
  return status;
}

int pw_steady_next (pw_steady *x, pw_steady_motion *out, pw_error *error) {
  int status = pw_require (x, "a search", error);
  *out = (pw_steady_motion){ .event = PW_STEADY_END };
  if (status != PW_OK) return status;
  const pw_branch_event *next;
  status = pw_branch_next (&x->branch, branch_events, &x->why, &next, error);
  if (next == NULL) return status;
  int neutral = x->neutral;
  out->event = (pw_steady_event)next->event;
  out->iterations = x->branch.iterations;
  out->residual = next->point.residual;
  status = pw_steady_motion_at (x, next->point.u, out, error);
  if (next->event != PW_BRANCH_POINT) out->unstable = next->unstable;
  x->neutral = neutral;
  return status;
}
