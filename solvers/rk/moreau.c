/* moreau: time stepping without events, fixed step (Moreau 1988, Unilateral contact and dry friction in finite freedom
 * dynamics; Jean 1999, The non-smooth contact dynamics method; Acary & Brogliato 2008, Numerical methods for nonsmooth
 * dynamical systems).  A step of size h from (t, q, v), theta = 1/2:
 *
 *   a1 = a (t + h/2, q + h/2 v, v + h/2 a1)       with the predicted multipliers lambda0 of limited equations
 *   v* = v + h a1,   q* = q + h/2 (v + v*)
 *   M (v' - v*) + J(q*)^T x = 0                   x: impulses of limited equations, and of all others
 *   q' = q + h/2 (v + v')
 *
 * With u = J(q*) v - eta before the step, v projected there, and u' after it, of limited equations that may be active:
 *
 *   h lo < h lambda0 + x < h hi: u' + e u = 0;   at h hi: u' + e u >= 0;   at h lo: u' + e u <= 0
 *
 * e: Newton's restitution if u approaches the limit, else 0.  May be active: velocity constraints; position constraints
 * that held in the last step, or whose g at q* is on the wrong side.  Multipliers of the last step are predicted for
 * equations that held, limits for those that slide, and 0 after an impact.  Thus x is of order h^2 between events, and
 * the method of order 2 there.  Each event costs an error of order h, since it takes effect at the end of a step.  The
 * number of steps does not depend on the number of events.
 *
 * Then q' and v' are projected; q' also onto limited equations that hold or are violated.  Multipliers of limited
 * equations, h lambda0 + x over h, are means over the step: those of an impact grow with 1/h.
 *
 * Samples inside a step: v linear between its ends, q its integral, both projected. */
#include <stdlib.h>
#include <string.h>
#include "dense_output.h"
#include "events.h"

static const double MOREAU_ROUND_OFF = 1e4 * DBL_EPSILON; /* of corrections, which small masses magnify */
enum { MOREAU_MOST = 30 }; /* fixed-point iterations for the velocities in the middle of a step */

struct pw_method_data {
  pw_dense_output last;       /* of the last step, for its start and its projector */
  double *q, *v, *a, *lambda; /* coords + 3; the same; the same; rows */
  double *f, *da, *mu;        /* coords + 3: forces; correction of a; rows: of lambda */
  double *rate;               /* entries: powers in the middle of the step */
};

static int moreau_open (pw_run *r, pw_error *error) {
  pw_method_data *d = r->data = calloc (1, sizeof *d);
  const size_t n = (size_t)r->s->coords + 3, rows = (size_t)r->s->rows;
  if (d == NULL) return pw_fail_memory (r->s, error);
  d->last.arrays =
      PW_ALLOC_ARRAYS (PW_ARRAY (d->rate, r->entries), PW_ARRAY (d->q, n), PW_ARRAY (d->v, n), PW_ARRAY (d->a, n),
                       PW_ARRAY (d->f, n), PW_ARRAY (d->da, n), PW_ARRAY (d->lambda, rows), PW_ARRAY (d->mu, rows));
  int status = pw_impulses_open (r, error);
  return status == PW_OK ? pw_dense_output_open (r, PW_DENSE_POSITIONS_AND_VELOCITIES, error) : status;
}

/* q = q + h/2 (v + d->v) from the state reached. */
static void moreau_positions (pw_run *r, double h) {
  pw_method_data *d = r->data;
  for (int j = 0; j < r->s->coords; j++) d->q[j] = r->q[j] + 0.5 * h * (r->v[j] + d->v[j]);
}

/* Adds to d->a and d->lambda what the forces at the velocities d->v change, after those in d->f; *change: by how much
 * the velocities in the middle change, in units of the scene. */
static int moreau_correct (pw_run *r, double h, double *change) {
  pw_method_data *d = r->data;
  const int status = pw_update_velocities (r->w, d->v);
  if (status != PW_OK) return status;
  pw_evaluate_force (r->w, d->da);
  for (int j = 0; j < r->s->coords; j++) {
    const double f = d->da[j];
    d->da[j] -= d->f[j], d->f[j] = f;
  }
  memset (d->mu, 0, (size_t)r->s->rows * sizeof *d->mu);
  pw_saddle_solve (r->saddle, d->da, d->mu, d->da, d->mu);
  *change = 0;
  for (int j = 0; j < r->s->coords; j++) {
    d->a[j] += d->da[j];
    *change = pw_larger_or_nan (*change, fabs (0.5 * h * d->da[j]) / pw_velocity_unit (r, j, r->v[j]));
  }
  for (int i = 0; i < r->s->rows; i++) d->lambda[i] += d->mu[i];
  return PW_OK;
}

/* The accelerations in the middle, with forces at the velocities d->v there, by fixed-point iteration to a thousandth
 * of the first change, of order h^2.  Constraints have the velocities v + h/2 a.  PW_RETRY if it does not converge:
 * forces change too fast for the step. */
static int moreau_middle (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const double *a = pw_impulses_predict (r) ? NULL : r->a, t = pw_before_breakpoint (r, r->t + 0.5 * h);
  double first = 0, largest = 1, change;
  for (int j = 0; j < r->s->coords; j++) {
    d->q[j] = r->q[j] + 0.5 * h * r->v[j];
    d->v[j] = r->v[j] + (a ? 0.5 * h * a[j] : 0);
  }
  int status = pw_run_accelerate (r, t, d->q, d->v, d->a, d->lambda);
  if (status != PW_OK || r->s->forces == 0) return status;
  pw_evaluate_force (r->w, d->f);
  for (int i = 0; i < MOREAU_MOST; i++) {
    for (int j = 0; j < r->s->coords; j++) {
      const double unit = pw_velocity_unit (r, j, r->v[j]), next = r->v[j] + 0.5 * h * d->a[j];
      if (i == 0) first = fmax (first, fabs (next - d->v[j]) / unit), largest = fmax (largest, fabs (next) / unit);
      d->v[j] = next;
    }
    status = moreau_correct (r, h, &change);
    if (status != PW_OK || change <= fmax (1e-3 * first, MOREAU_ROUND_OFF * largest)) return status;
  }
  return PW_RETRY;
}

/* q*, v*; and the ledger with the powers in the middle of the step. */
static int moreau_move (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const int status = moreau_middle (r, h);
  if (status != PW_OK) return status;
  pw_ledger_rates (r, d->lambda, d->rate);
  for (int i = 0; i < r->entries; i++) r->ledger[i] += h * d->rate[i];
  for (int j = 0; j < r->s->coords; j++) d->v[j] = r->v[j] + h * d->a[j];
  moreau_positions (r, h);
  return pw_is_finite_state (r, d->q, d->v) ? PW_OK : PW_RETRY;
}

/* q', v', projected, with accelerations and multipliers. */
static int moreau_finish (pw_run *r, double t, double *added_energy) {
  pw_method_data *d = r->data;
  if (r->events == NULL) return pw_project_state (&d->last.projector, r, t, d->q, d->v, d->a, d->lambda, added_energy);
  int status = pw_update_kinematics (r->w, t, d->q, d->v);
  if (status != PW_OK) return status;
  const double before = pw_energy (r, d->v);
  status = pw_impulses_project (r, &d->last.projector, t, d->q, d->v);
  if (status == PW_OK) status = pw_project_velocities (&d->last.projector, r, d->v);
  if (status != PW_OK) return status;
  if (added_energy) *added_energy += pw_energy (r, d->v) - before;
  pw_run_accelerate_updated (r, d->v, d->a, d->lambda);
  return PW_OK;
}

static int moreau_fail (pw_run *r, int status, double h, pw_error *error) {
  memcpy (r->ledger, r->data->last.start.ledger, (size_t)r->entries * sizeof *r->ledger);
  if (error && error->status != PW_OK) return error->status;
  if (status < 0) return pw_fail_signal (r->t, error);
  if (pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the step of %.6g s is too large: its velocities are not found, or its end not projected",
                  r->t, h);
}

static int moreau_advance (pw_run *r, double t_end, pw_error *error) {
  pw_method_data *d = r->data;
  int whole;
  const double t1 = pw_step_end (r, t_end, &whole), h = t1 - r->t, t = pw_before_breakpoint (r, t1);
  const size_t n = (size_t)r->s->coords * sizeof (double);
  double added_energy = 0;
  pw_store_start (&d->last.start, r);
  int status = moreau_move (r, h);
  if (status == PW_OK && r->events) {
    status = pw_impulses_solve (r, &d->last.projector, h, t, d->q, d->v, d->a, error);
    moreau_positions (r, h);
  }
  if (status == PW_OK) status = moreau_finish (r, t, r->settings.ledger ? &added_energy : NULL);
  if (status != PW_OK) return moreau_fail (r, status, h, error);
  r->t = t1;
  r->projected += added_energy;
  memcpy (r->q, d->q, n);
  memcpy (r->v, d->v, n);
  memcpy (r->a, d->a, n);
  memcpy (r->lambda, d->lambda, (size_t)r->s->rows * sizeof *r->lambda);
  pw_ledger_rates (r, r->lambda, r->rate);
  if (r->events) pw_run_set_reference_level (r); /* impacts accelerate without limit */
  r->statistics.steps++;
  pw_count_step (r, whole, t1);
  return PW_OK;
}

static int moreau_interpolate (pw_run *r, double t) {
  pw_method_data *d = r->data;
  const pw_step_start *start = &d->last.start;
  const double *q0 = start->q, *v0 = q0 + (r->v - r->q), *a0 = q0 + (r->a - r->q), *lambda0 = q0 + (r->lambda - r->q);
  const double h = r->t - start->t, x = (t - start->t) / h;
  for (int j = 0; j < r->s->coords; j++) {
    const double projected = r->q[j] - q0[j] - 0.5 * h * (v0[j] + r->v[j]);
    r->q_at[j] = q0[j] + h * x * (v0[j] + 0.5 * x * (r->v[j] - v0[j])) + x * projected;
    r->v_at[j] = v0[j] + x * (r->v[j] - v0[j]);
    r->a_at[j] = a0[j] + x * (r->a[j] - a0[j]);
  }
  for (int i = 0; i < r->s->rows; i++) r->lambda_at[i] = lambda0[i] + x * (r->lambda[i] - lambda0[i]);
  for (int i = 0; i < r->entries; i++) r->ledger_at[i] = start->ledger[i] + x * (r->ledger[i] - start->ledger[i]);
  r->projected_at = start->projected + x * (r->projected - start->projected);
  int status = pw_project_positions (&d->last.projector, r, t, r->q_at, r->v_at);
  return status == PW_OK ? pw_project_velocities (&d->last.projector, r, r->v_at) : status;
}

static int moreau_at (pw_run *r, double t, pw_error *error) {
  return pw_sample_last_step (r, r->data->last.start.t, t, moreau_interpolate, error);
}

const pw_method pw_method_moreau = {
  .name = "moreau",
  .about =
      "time stepping over events, which are not located; order 2, at events 1; fixed step (Moreau 1988, Jean 1999)",
  .order = 2,
  .locates_no_events = 1,
  .stabilisations =
      (const pw_stabilisation[]){
          { "projection", "projection onto the constraints after each step (Lubich 1991, Eich 1993)", PW_PROJECTION },
          { .name = NULL },
      },
  .options = (const pw_option[]){ { .name = NULL } },
  .open = moreau_open,
  .advance = moreau_advance,
  .at = moreau_at,
  .restart = pw_step_restart,
  .close = pw_step_close,
  .serialise = pw_step_serialise,
};
