/* Runge-Kutta methods: samples inside the last step.  A sample is a step from the beginning of the last one, as
 * accurate as the method.
 *
 * Near a singular configuration a stage may land on it and spoil this step, even if the accepted step was good.  Then
 * several divisions in two parts are tried, and the one closest to another is taken. */
#include <math.h>
#include <string.h>
#include "dense_output.h"
#include "rk_state.h"

/* A state from which a step can begin, with the run's layout. */
typedef struct {
  double t, *q;
  double *ledger, *rate, projected;
} sample_begin;

/* A step to t: state in d->q, ledger in ledger_at, projected_at.  *near: 1 if an evaluation was near a singular
 * configuration. */
static int sample_step (pw_run *r, const sample_begin *from, double t, int *near) {
  struct pw_method_data *d = r->data;
  const pw_run reached = *r;
  const size_t n = (size_t)r->s->coords + 3;
  double added = 0, h = t - from->t;
  r->t = from->t, r->q = from->q, r->v = from->q + n, r->a = from->q + 2 * n, r->rate = from->rate;
  r->near = 0;
  r->refuse = 0;
  int status = pw_rk_step (r, h, t, d->projects, r->settings.ledger ? &added : NULL);
  *near = r->near;
  *r = reached;
  pw_rk_ledger (r, r->ledger_at, from->ledger, h);
  r->projected_at = from->projected + added;
  return status;
}

/* The same in two parts, by way of the time `by`. */
static int sample_two_parts (pw_run *r, const sample_begin *from, double by, double t) {
  struct pw_method_data *d = r->data;
  int near, status = sample_step (r, from, by, &near);
  if (status != PW_OK) return status;
  const sample_begin middle = { by, d->middle, d->ledger_middle, d->rate_middle, r->projected_at };
  memcpy (d->middle, d->q, pw_rk_block (r, 0));
  memcpy (d->ledger_middle, r->ledger_at, (size_t)r->s->entries * sizeof (double));
  pw_ledger_rates (r, d->lambda, d->rate_middle);
  return sample_step (r, &middle, t, &near);
}

/* Tries several divisions and leaves the best result in the sample arrays. */
static int sample_in_parts (pw_run *r, const sample_begin *from, int status, double t) {
  static const double part[] = { 0.382, 0.681, 0.209, 0.847, 0.541 };
  const int parts = sizeof part / sizeof *part;
  const struct pw_method_data *d = r->data;
  int known = status == PW_OK, choice = 0;
  double best = INFINITY;
  for (int i = 0; i < parts && best > r->limits.sample_best; i++) {
    status = sample_two_parts (r, from, from->t + part[i] * (t - from->t), t);
    if (status < 0) return status;
    if (status != PW_OK) continue;
    double off = known ? pw_rk_distance (r) : INFINITY;
    if (off < best) best = off, choice = i;
    memcpy (r->q_at, d->q, pw_rk_block (r, 1));
    known = 1;
  }
  if (!(best <= r->limits.sample)) return PW_RETRY;
  status = sample_two_parts (r, from, from->t + part[choice] * (t - from->t), t);
  memcpy (r->q_at, d->q, pw_rk_block (r, 1));
  return status;
}

int pw_rk_at (pw_run *r, double t, pw_error *error) {
  struct pw_method_data *d = r->data;
  if (t > r->t || t < d->t0) return pw_fail_outside (r, d->t0, t, error);
  if (t == r->t) {
    pw_show_reached (r);
    return PW_OK;
  }
  const sample_begin from = { d->t0, d->q0, d->ledger0, d->rate0, d->projected0 };
  int near, status = sample_step (r, &from, t, &near);
  memcpy (r->q_at, d->q, pw_rk_block (r, 1));
  if (near && status >= 0) status = sample_in_parts (r, &from, status, t);
  return status == PW_OK ? PW_OK : pw_rk_fail (r, status, t - d->t0, error);
}
