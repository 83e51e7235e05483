/* Runge-Kutta methods with fixed steps, which end at multiples of the step size.  They are cut at t_end and at
 * breakpoints, and split where a stage or the end would land on a singular configuration. */
#include <math.h>
#include <string.h>
#include "rk_state.h"

/* The step to t1 in two parts, by way of t; leaves the new state in d->q, d->v.  With `keep` it accepts the first part
 * and omits the second.  *added: the energy added by projections. */
static int fixed_two_parts (pw_run *r, double t, double t1, int project, int keep, double *added) {
  *added = 0;
  int status = pw_rk_step (r, t - r->t, t, project, added);
  if (status != PW_OK) return status;
  pw_rk_accept (r, t - r->t, t, r->settings.ledger ? *added : 0);
  if (keep) return PW_OK;
  status = pw_rk_step (r, t1 - t, t1, project, added);
  pw_rk_revert (r);
  return status;
}

/* The distance of the state in d->q, d->v from the one in q_at, v_at, which it then replaces. */
static double fixed_compare (pw_run *r) {
  const struct pw_method_data *d = r->data;
  double most = pw_rk_distance (r);
  memcpy (r->q_at, d->q, pw_rk_block (r, 1));
  return most;
}

/* Tries divisions of the step to t1 in two parts of irregular sizes until the results of two of them agree; then
 * accepts the first part of the latter, which ends at *t > least. */
static int fixed_in_parts (pw_run *r, int status, double t1, int project, double least, double *t) {
  static const double part[] = { 0.382, 0.681, 0.209, 0.847, 0.127, 0.541, 0.943, 0.302, 0.764, 0.891 };
  const int parts = sizeof part / sizeof *part;
  double start = r->t, best = INFINITY, energy = fmax (r->energy_scene, r->exchanged), added;
  int choice = 0, known = status == PW_OK;
  if (known) fixed_compare (r);
  for (int i = 0; i < parts && best > r->limits.agree_best; i++) {
    if (start + part[i] * (t1 - start) <= least) continue;
    if (pw_run_asked (r)) return PW_STOPPED;
    status = fixed_two_parts (r, start + part[i] * (t1 - start), t1, project, 0, &added);
    r->statistics.rejected++;
    if (status < 0) return status;
    if (status != PW_OK) continue;
    double off = fmax (fixed_compare (r), fabs (added) / energy); /* energy of projections is an error, too */
    if (known && off < best) best = off, choice = i;
    known = 1;
  }
  if (!(best <= r->limits.agree)) return PW_RETRY;
  *t = start + part[choice] * (t1 - start);
  return fixed_two_parts (r, *t, t1, project, 1, &added);
}

/* A stage that lands on a singular configuration spoils the step, so the step is divided in two.  If its end lands
 * there, a longer step, up to `stop`, is divided so that the first part ends after t1. */
static int fixed_step_around (pw_run *r, int status, double t1, double stop, int project, double *t) {
  static const double beyond[] = { 0.62, 2.62, 7.62 };
  const int lengths = sizeof beyond / sizeof *beyond;
  status = fixed_in_parts (r, status, t1, project, r->t, t);
  for (int i = 0; i < lengths && status == PW_RETRY && t1 < stop; i++)
    status = fixed_in_parts (r, status, fmin (t1 + beyond[i] * r->settings.step, stop), project, t1, t);
  return status;
}

int pw_rk_advance_fixed (pw_run *r, double t_end, pw_error *error) {
  struct pw_method_data *d = r->data;
  int whole, project = d->projects && (r->statistics.steps + 1) % d->every == 0;
  double added = 0, t1 = pw_step_end (r, d->base, d->count, t_end, &whole),
         h = whole && !d->split ? r->settings.step : t1 - r->t;
  const int split = d->split;
  r->near = 0;
  int status = pw_rk_step (r, h, t1, project, r->settings.ledger ? &added : NULL);
  d->split = r->near && !d->split;
  double stop = whole ? fmin (t_end, r->breakpoint) : t1, t = t1;
  if (d->split) status = fixed_step_around (r, status, t1, stop, project, &t);
  if (r->stopped) {
    d->split = split;
    return PW_STOPPED;
  }
  if (status != PW_OK) return pw_rk_fail (r, status, r->settings.step, error);
  r->statistics.steps++;
  if (d->split) {
    if (t > t1) d->count = (long)floor ((t - d->base) / r->settings.step);
    return PW_OK;
  }
  pw_rk_accept (r, h, t1, added);
  d->count++;
  if (!whole) d->base = t1, d->count = 0;
  return PW_OK;
}
