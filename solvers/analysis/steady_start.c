/* Where the search for steady motions begins: the initial state, states that forces lead to, random states. */
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "steady_parts.h"

/* START_FAR: longest first step of a relaxation, in units of the scene. */
enum { START_RELAXATIONS = 300 };
static const double START_FAR = 0.2;

/* Between -1 and 1 (Steele, Lea & Flood 2014, Fast splittable pseudorandom number generators). */
static double start_random (uint64_t *state) {
  uint64_t z = *state += 0x9e3779b97f4a7c15;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return (double)(int64_t)(z ^ (z >> 31)) * 0x1p-63;
}

/* Makes the positions x->q consistent, if possible. */
static int start_assemble (pw_steady *x, pw_projector *p) {
  memcpy (x->dq, x->q, (size_t)x->n * sizeof *x->q);
  int status = pw_project_positions (p, x->at[0].r, x->set.t, x->dq, x->v);
  if (status == PW_OK) memcpy (x->q, x->dq, (size_t)x->n * sizeof *x->q);
  return status;
}

/* The accelerations in the moving frame; returns the largest in units of the scene, NaN if there are none. */
static double start_accelerate (pw_steady *x, double *a) {
  pw_linearisation *l = &x->at[0].x;
  double most = 0;
  pw_steady_field (x, x->rates, x->q, x->v);
  if (pw_run_accelerate (x->at[0].r, x->set.t, x->q, x->v, l->a, l->lambda) != PW_OK) return NAN;
  memcpy (a, l->a, (size_t)x->n * sizeof *a);
  pw_linear_turn (l, -x->rates[2], x->v, a);
  for (int j = 0; j < x->n; j++) most = pw_larger_or_nan (most, fabs (a[j]) / pw_unit (x->s, j));
  return most;
}

/* Moves positions along the accelerations, at constant rates: to a minimum of the potential, if forces have one.  The steps
 * become longer while accelerations keep their direction, and shorter when they reverse. */
static void start_relax (pw_steady *x, pw_projector *p) {
  double *a = x->q0, *before = x->v0, most = start_accelerate (x, a), step = START_FAR / most;
  for (int i = 0; i < START_RELAXATIONS && most > 0 && isfinite (step); i++) {
    double dot = 0;
    for (int j = 0; j < x->n; j++) x->q[j] += fmin (step, START_FAR / most) * a[j];
    if (start_assemble (x, p) != PW_OK) return;
    memcpy (before, a, (size_t)x->n * sizeof *a);
    most = start_accelerate (x, a);
    for (int j = 0; j < x->n; j++) dot += a[j] * before[j] / (pw_unit (x->s, j) * pw_unit (x->s, j));
    step *= dot > 0 ? 1.1 : 0.4;
  }
}

int pw_steady_start (pw_steady *x, int k, double *u, pw_error *error) {
  int status = pw_steady_guess (x, x->start, x->start + x->n, u, error);
  uint64_t state = (uint64_t)k * 0xd1342543de82ef95;
  double wide = k % 2 ? 1 : 0.2;
  pw_projector p;
  for (int j = 0; k > 1 && j < pw_steady_unknowns (x); j++)
    u[j] += wide * start_random (&state) * (j >= x->n ? 2 : pw_is_angle (x->s, j) ? PW_PI : 1);
  if (status != PW_OK || (k != 1 && k % 4 < 2)) return status;
  pw_steady_state (x, u);
  if (pw_evaluate_J_at (x->at[0].r->w, x->set.t, x->q, x->v) != PW_OK) return PW_OK;
  if (pw_projector_open (&p, x->at[0].r, x->s->metric, x->s->metric, &x->why) != PW_OK)
    return pw_fail_memory (x->s, error);
  if (start_assemble (x, &p) == PW_OK && k % 4 < 3) start_relax (x, &p);
  pw_projector_close (&p);
  for (int j = 0; j < x->n; j++) u[j] = x->q[j] / pw_unit (x->s, j);
  return PW_OK;
}
