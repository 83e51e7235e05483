/* Where the search for steady motions begins: the initial state, states that forces lead to, random states. */
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "steady_parts.h"
#include "util.h"

enum { START_STEPS = 300 };               /* of a relaxation, at most */
static const double START_FAR = 0.2,      /* longest of its steps, in units of the scene */
    START_GROW = 1.1, START_SHRINK = 0.4; /* factors of the next step */

/* A random number between -1 and 1. */
static double start_random (uint64_t *state) {
  return (double)(int64_t)pw_random_bits (state) * 0x1p-63;
}

/* Makes the positions x->q consistent, if possible. */
static int start_assemble (pw_steady *x, pw_projector *p) {
  double *q = x->scratch[0];
  memcpy (q, x->q, (size_t)x->n * sizeof *q);
  int status = pw_project_positions (p, x->system.run, x->settings.t, q, x->v);
  if (status == PW_OK) memcpy (x->q, q, (size_t)x->n * sizeof *q);
  return status;
}

/* The accelerations in the moving frame at x->q, x->rates; returns the largest, divided by the unit of its coordinate
 * [1/s^2], or NaN if they are not determined. */
static double start_accelerate (pw_steady *x, double *a) {
  pw_linearisation *l = &x->system.linearisation;
  double most = 0;
  pw_steady_velocities (x, x->rates, x->q, x->v);
  if (pw_run_accelerate (x->system.run, x->settings.t, x->q, x->v, l->a, l->lambda) != PW_OK) return NAN;
  memcpy (a, l->a, (size_t)x->n * sizeof *a);
  pw_linear_turn (l, -x->rates[PW_RATE_TURN], x->v, a);
  for (int j = 0; j < x->n; j++) most = pw_larger_or_nan (most, fabs (a[j]) / pw_unit (x->s, j));
  return most;
}

/* Moves positions along the accelerations, at constant rates: towards a minimum of the potential, if forces have one.
 * Steps become longer while the direction of the accelerations changes by less than 90 degrees, otherwise shorter. */
static void start_relax (pw_steady *x, pw_projector *p) {
  double *a = x->scratch[1], *before = x->scratch[2], most = start_accelerate (x, a), step = START_FAR / most;
  for (int i = 0; i < START_STEPS && most > 0 && isfinite (step); i++) {
    double dot = 0;
    for (int j = 0; j < x->n; j++) x->q[j] += fmin (step, START_FAR / most) * a[j];
    if (start_assemble (x, p) != PW_OK) return;
    memcpy (before, a, (size_t)x->n * sizeof *a);
    most = start_accelerate (x, a);
    for (int j = 0; j < x->n; j++) dot += a[j] * before[j] / (pw_unit (x->s, j) * pw_unit (x->s, j));
    step *= dot > 0 ? START_GROW : START_SHRINK;
  }
}

int pw_steady_start (pw_steady *x, int attempt, double *u, pw_error *error) {
  int status = pw_steady_nearest (x, x->start, x->start + x->n, u, error);
  uint64_t state = (uint64_t)attempt * 0xd1342543de82ef95; /* of the random numbers; far apart between attempts */
  double wide = attempt % 2 ? 1 : 0.2;                     /* of lengths L, angles pi, rates 2 / T */
  const int relaxed = attempt == 1 || attempt % 4 == 2, consistent = relaxed || attempt % 4 == 3;
  pw_projector p;
  for (int j = 0; attempt > 1 && j < pw_steady_unknowns (x); j++)
    u[j] += wide * start_random (&state) * (j >= x->n ? 2 : pw_is_angle (x->s, j) ? PW_PI : 1);
  if (status != PW_OK || !consistent) return status;
  pw_steady_state (x, u);
  if (pw_evaluate_J_at (x->system.run->w, x->settings.t, x->q, x->v) != PW_OK) return PW_OK; /* as it is */
  if (pw_projector_open (&p, x->system.run, x->s->metric, x->s->metric, &x->why) != PW_OK)
    return pw_fail_memory (x->s, error);
  if (start_assemble (x, &p) == PW_OK && relaxed) start_relax (x, &p);
  pw_projector_close (&p);
  for (int j = 0; j < x->n; j++) u[j] = x->q[j] / pw_unit (x->s, j);
  return PW_OK;
}
