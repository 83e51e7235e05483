/* Saturating forces, such as friction, which change by their own magnitude within a small range of velocities: bounds
 * on tolerances and on the use of Newton matrices.
 *
 * With a Newton matrix evaluated inside that range, at rest, where the force is steep, and used where it has saturated,
 * corrections are about as small as the range, however large the residual is: the iteration would seem to converge with
 * the force of another state.  So tolerances stay below the range, and a matrix is reused only while no state has moved
 * by more than the range of the state where it was evaluated. */
#include <math.h>
#include <string.h>
#include "method.h"

#define TOLERANCES_PART 0.1 /* largest error of a state over its change that changes a force by the force itself */

/* The root mean square of n errors in units of their tolerances may be 1, so a single error may be sqrt (n) times its
 * tolerance. */
void pw_bound_tolerances (pw_run *r) {
  int coords = r->s->coords, n = 2 * coords;
  if (!r->s->saturates) return;
  pw_evaluate_saturation (r->w, r->tolerance_bound);
  for (int j = 0; j < n; j++) {
    double y = j < coords ? r->q[j] : r->v[j - coords];
    r->matrix_outdated |= fabs (y - r->matrix_state[j]) > r->matrix_range[j];
    r->tolerance_bound[j] *= TOLERANCES_PART / sqrt (n);
  }
}

double pw_saturation_range (const pw_run *r, int state) {
  return r->tolerance_bound[state] * sqrt (2 * r->s->coords) / TOLERANCES_PART;
}

void pw_matrix_evaluated (pw_run *r, const double *q, const double *v) {
  int coords = r->s->coords;
  r->matrix_outdated = 0;
  if (!r->s->saturates) return;
  memcpy (r->matrix_state, q, (size_t)coords * sizeof *q);
  memcpy (r->matrix_state + coords, v, (size_t)coords * sizeof *v);
  pw_evaluate_saturation (r->w, r->matrix_range);
}

double pw_first_step (const pw_run *r) {
  double T = r->w->scale.time, h = 0.5 * T * sqrt (r->settings.rtol);
  for (int j = 0, n = r->s->coords; j < n; j++) {
    if (r->v[j] != 0) h = fmin (h, fmax (r->tolerance_bound[j] / fabs (r->v[j]), 1e-9 * T));
    if (r->a[j] != 0) h = fmin (h, fmax (r->tolerance_bound[n + j] / fabs (r->a[j]), 1e-9 * T));
  }
  return h;
}

int pw_run_saturation (pw_run *r, double *least, char *element, size_t size) {
  if (!r->s->saturates) return -1;
  double *at_rest = r->scratch;
  for (int j = 0; j < r->s->coords; j++) at_rest[j] = 0;
  (void)pw_update_kinematics (r->w, r->t, r->q, r->v); /* since a sample, the workspace may be at another state */
  pw_hold_signals (r->w, 1);                           /* a signal that reads velocities may have no value at rest */
  (void)pw_update_kinematics (r->w, r->t, r->q, at_rest);
  int state = pw_find_saturation (r->w, least, element, size);
  pw_hold_signals (r->w, 0);
  (void)pw_update_kinematics (r->w, r->t, r->q, r->v);
  return state;
}
