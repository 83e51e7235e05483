/* leapfrog: the reversible leapfrog for constrained systems, explicit in forces of positions, fixed step.  From t to
 * t' = t + h, with u the rates at half the step and (q*, t*) the mean of both ends,
 *
 *   M (u - v)  = h/2 (f (t, q, v) - J (q)^T lambda+)         g (t', q') = 0,    S (t*, q*) u = b (t*, q*)
 *   q' - q     = h u
 *   M (v' - u) = h/2 (f (t', q', v') - J (q')^T lambda-)     J (t', q') v' = eta (t', q')
 *
 * For holonomic rows this is RATTLE (Andersen 1983, Rattle: a "velocity" version of the Shake algorithm for molecular
 * dynamics calculations); for nonholonomic rows the discrete Lagrange-d'Alembert principle (Cortés & Martínez 2001,
 * Non-holonomic integrators) with a discrete constraint that is the same from either end, which makes the method
 * reversible (McLachlan & Perlmutter 2006, Integrators for nonholonomic mechanical systems).  Each line exchanged with
 * its counterpart, h for -h, is the same step backwards: the method is symmetric, so of order 2, and with forces even
 * in the rates it retraces its way when they are turned round.  lambda+ and lambda- only carry the step; accelerations and
 * multipliers reported are those of the equations of motion at its end.
 *
 * All equations are solved to round-off: for u and q' by Newton's iteration (leapfrog_drift.c), for v' and forces of the
 * rates by substitution.  None asks for M^-1: coordinates without mass follow from their rows, as everywhere. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "leapfrog_state.h"
#include "util.h"

enum { LEAPFROG_MOST = 100 }; /* substitutions for forces of the rates */

/* ---- Opening ---- */

static int leapfrog_restart (pw_run *r, pw_error *error) {
  leapfrog *d = r->data;
  (void)error;
  d->base = d->work.last.t0 = r->t;
  d->count = 0;
  return PW_OK;
}

static int leapfrog_allocate (leapfrog *d, const pw_system *s) {
  size_t n = (size_t)s->coords + 3, rows = (size_t)s->rows;
  const pw_array array[] = {
    { &d->u, n }, { &d->q1, n },     { &d->v1, n },    { &d->middle, n }, { &d->dv, n },
    { &d->f, n }, { &d->off, rows }, { &d->mu, rows }, { &d->eta, rows }, { &d->z, n + rows }
  };
  d->work.memory = pw_take_arrays (array, sizeof array / sizeof *array);
  return d->work.memory ? PW_OK : PW_MACHINE;
}

static int leapfrog_open (pw_run *r, pw_error *error) {
  leapfrog *d = r->data = calloc (1, sizeof *d);
  int status = d ? leapfrog_allocate (d, r->s) : PW_MACHINE;
  if (status == PW_OK) status = pw_tangent_open (&d->work.tangent, r);
  if (status == PW_OK) status = pw_leapfrog_open_matrix (r);
  if (status != PW_OK) return pw_fail (error, PW_MACHINE, "model %s: out of memory", r->s->model);
  status = pw_between_open (&d->work.last, r, 1, error);
  return status == PW_OK ? leapfrog_restart (r, error) : status;
}

static void leapfrog_close (pw_run *r) {
  pw_implicit_close (&r->data->work);
  free (r->data);
}

static void leapfrog_carry (pw_run *r, pw_archive *a) {
  leapfrog *d = r->data;
  pw_carry (a, &d->base, sizeof d->base);
  pw_carry_count (a, &d->count);
}

/* ---- Iterations ---- */

int pw_leapfrog_judge (leapfrog_progress *p) {
  const double round_off = 2 * DBL_EPSILON, magnified = 1e4 * DBL_EPSILON; /* by light bodies, or short ones */
  p->rate = p->done > 0 ? p->size / p->before : 1;
  if (!isfinite (p->size)) return -1;
  if (p->size <= round_off || (p->rate < 1 && p->size * p->rate / (1 - p->rate) <= 0.25 * round_off)) return 1;
  if (p->rate > 0.5 && p->size <= magnified * p->large) return 1;
  if (p->done > 3 && p->rate > 2) return -1;
  p->before = p->size;
  p->done++;
  return 0;
}

/* ---- Second half: v' ---- */

/* Places the system at (t, q, v), factorises the saddle there and takes note of a singular pose. */
static int leapfrog_factor (pw_run *r, double t, const double *q, const double *v) {
  int status = pw_place (r->w, t, q, v);
  if (status != PW_OK) return status;
  pw_sweep_J (r->w);
  r->statistics.factorisations++;
  status = pw_saddle_factor (r->saddle);
  if (status != PW_OK || pw_watchdog_near (r)) r->near = 1;
  return status;
}

/* One correction of v' for forces that have changed since the last one, which d->f holds.  PW_METHOD if a signal failed. */
static int leapfrog_kick (pw_run *r, double h, leapfrog_progress *p) {
  leapfrog *d = r->data;
  const pw_system *s = r->s;
  int status = pw_place_rates (r->w, d->v1);
  if (status != PW_OK) return status;
  pw_sweep_force (r->w, d->middle);
  for (int j = 0; j < s->coords; j++) {
    double f = d->middle[j];
    d->middle[j] = 0.5 * h * (f - d->f[j]);
    d->f[j] = f;
  }
  pw_mul_J (r->w, d->v1, d->off);
  pw_sweep_eta (r->w, d->eta);
  for (int i = 0; i < s->rows; i++) d->off[i] = d->eta[i] - d->off[i];
  pw_saddle_solve (r->saddle, d->middle, d->off, d->dv, d->mu);
  p->size = 0, p->large = 1;
  for (int j = 0; j < s->coords; j++) {
    d->v1[j] += d->dv[j];
    leapfrog_measure (p, d->dv[j], d->u[j], pw_unit (s, j) / r->w->scale.time);
  }
  return PW_OK;
}

static int leapfrog_finish (pw_run *r, double h, double t1) {
  leapfrog *d = r->data;
  leapfrog_progress p = { 0 };
  int status = leapfrog_factor (r, pw_before_breakpoint (r, t1), d->q1, d->u);
  if (status != PW_OK) return status;
  memcpy (d->v1, d->u, (size_t)r->s->coords * sizeof *d->v1);
  memset (d->f, 0, (size_t)r->s->coords * sizeof *d->f);
  for (int good = 0; !good;) {
    status = leapfrog_kick (r, h, &p);
    if (status != PW_OK) return status;
    good = p.done < LEAPFROG_MOST ? pw_leapfrog_judge (&p) : -1;
    if (good < 0) return PW_RETRY;
  }
  return pw_place_rates (r->w, d->v1);
}

/* ---- Advancing ---- */

static void leapfrog_accept (pw_run *r, double t1) {
  leapfrog *d = r->data;
  size_t n = (size_t)r->s->coords * sizeof (double);
  pw_between_keep (&d->work.last, r);
  memcpy (r->q, d->q1, n);
  memcpy (r->v, d->v1, n);
  pw_accelerate_placed (r, r->v, r->a, r->lambda);
  r->t = t1;
  pw_between_count (&d->work.last, r);
  r->statistics.steps++;
}

/* Where the iteration fails, the pose that the step begins with may be the reason. */
static int leapfrog_fail (pw_run *r, int status, double h, pw_error *error) {
  if (status == PW_MACHINE) return pw_fail (error, PW_MACHINE, "model %s: out of memory", r->s->model);
  if (status < 0) return pw_fail (error, PW_METHOD, "t = %.6g s: a signal failed", r->t);
  if (r->near || pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  return pw_fail (error, PW_METHOD, "t = %.6g s: the iteration does not converge; the step of %.6g s may be too large",
                  r->t, h);
}

static int leapfrog_advance (pw_run *r, double t_end, pw_error *error) {
  leapfrog *d = r->data;
  int whole;
  double t1 = pw_step_end (r, d->base, d->count, t_end, &whole), h = whole ? r->settings.step : t1 - r->t;
  r->near = 0;
  int status = pw_leapfrog_drift (r, h, t1);
  if (status == PW_OK) status = leapfrog_finish (r, h, t1);
  if (status != PW_OK) return leapfrog_fail (r, status, h, error);
  leapfrog_accept (r, t1);
  d->count++;
  if (!whole) d->base = t1, d->count = 0;
  return PW_OK;
}

static int leapfrog_at (pw_run *r, double t, pw_error *error) {
  return pw_between_at (&r->data->work.last, r, t, error);
}

static const pw_stabilisation leapfrog_stabilisations[] = {
  { "rattle", "positions and rates both enforced by the step's own multipliers (Andersen 1983)",
    PW_STABILISED_OTHERWISE },
  { .name = NULL },
};

static const pw_option leapfrog_options[] = { { .name = NULL } };

const pw_method pw_method_leapfrog = {
  .name = "leapfrog",
  .about = "reversible leapfrog of order 2, fixed step, for long runs (Andersen 1983, McLachlan & Perlmutter 2006)",
  .order = 2,
  .stabilisations = leapfrog_stabilisations,
  .options = leapfrog_options,
  .open = leapfrog_open,
  .advance = leapfrog_advance,
  .at = leapfrog_at,
  .restart = leapfrog_restart,
  .close = leapfrog_close,
  .carry = leapfrog_carry,
};
