/* Explicit Runge-Kutta on q' = v, v' = a(t, q, v).
 *
 *   q_i = q + h sum_j A_ij v_j,   v_i = v + h sum_j A_ij a_j,   j < i;   new: with b in place of A
 *
 * The ledger's rates are integrated with the same stages.  After each step the state may be projected; its
 * accelerations are evaluated immediately, as the first stage of the next step, so that they are always available. */
#include <math.h>
#include <string.h>
#include "rk_step.h"
#include "unroll.h"

/* Entries i and i + 1 of y + sum_j f_j k_j. */
PW_INLINE void rk_two (double *restrict out, const double *y, double *const *k, const double *f, int m, long i) {
  double a = y[i], b = y[i + 1];
  PW_UNROLL for (int j = 0; j < m; j++) {
    a += f[j] * k[j][i];
    b += f[j] * k[j][i + 1];
  }
  out[i] = a;
  out[i + 1] = b;
}

/* The current state + h sum_j w_j (V_j, A_j); the arrays have room for one more entry.  m, the number of weights, is a
 * constant in the inlined copies. */
PW_INLINE void rk_combine_by (const pw_run *r, double *q, double *v, const pw_rk_row *w, double h, int m) {
  const struct pw_method_data *d = r->data;
  const double *q0 = r->q, *v0 = r->v;
  double *V[PW_RK_STAGES], *A[PW_RK_STAGES], f[PW_RK_STAGES];
  PW_UNROLL for (int j = 0; j < m; j++) V[j] = d->V[w->stage[j]], A[j] = d->A[w->stage[j]], f[j] = h * w->weight[j];
  for (long i = 0, n = r->s->coords; i < n; i += 2) {
    rk_two (q, q0, V, f, m, i);
    rk_two (v, v0, A, f, m, i);
  }
}

PW_NOINLINE void rk_combine_any (const pw_run *r, double *q, double *v, const pw_rk_row *w, double h) {
  rk_combine_by (r, q, v, w, h, w->count);
}

static void rk_combine (const pw_run *r, double *q, double *v, const pw_rk_row *w, double h) {
  if (w->count == 1)
    rk_combine_by (r, q, v, w, h, 1);
  else if (w->count == 4)
    rk_combine_by (r, q, v, w, h, 4);
  else
    rk_combine_any (r, q, v, w, h);
}

void pw_rk_ledger (const pw_run *r, double *out, const double *y, double h) {
  const struct pw_method_data *d = r->data;
  const pw_rk_row *w = &d->row[0];
  for (int i = 0; i < r->s->entries; i++) {
    double sum = y[i];
    for (int j = 0; j < w->count; j++) sum += h * w->weight[j] * d->R[w->stage[j]][i];
    out[i] = sum;
  }
}

/* Accelerations and rates of the ledger of a stage at the positions d->q. */
static inline int rk_stage (pw_run *r, double t, double *v, double *a, double *rate) {
  struct pw_method_data *d = r->data;
  int status;
  if (d->null_space) {
    status = pw_nullspace_velocities (&d->nullspace, r, t, d->q, v);
    if (status == PW_OK) status = pw_nullspace_accelerate (r, v, a, d->lambda);
  } else {
    status = pw_run_accelerate (r, t, d->q, v, a, d->lambda);
  }
  if (status == PW_OK) pw_ledger_rates (r, d->lambda, rate);
  return status;
}

/* Zero-order hold: signals of forces keep their values at the beginning of the step.  Kinematics are updated first,
 * since a sample or a rejected step may have changed them. */
static int rk_hold (pw_run *r) {
  int status = pw_update_kinematics (r->w, r->t, r->q, r->v);
  pw_hold_signals (r->w, status == PW_OK);
  return status;
}

/* 1 if the squares of all entries are finite. */
static int rk_finite (const pw_run *r, const double *q, const double *v) {
  double sum = 0;
  for (int j = 0; j < r->s->coords; j++) sum += q[j] * q[j] + v[j] * v[j];
  return sum < 1e300;
}

/* The same as rk_stages, by specialised code: 1; 0 if there is none, or it refuses a stage. */
static int rk_stages_specialised (pw_run *r, double h) {
  struct pw_method_data *d = r->data;
  double t[PW_RK_STAGES];
  if (r->specialised == NULL || d->held || d->null_space) return 0;
  for (int i = 1; i < d->tableau->stages; i++) t[i] = pw_before_breakpoint (r, r->t + d->tableau->c[i] * h);
  return pw_specialised_stages (
      r, &(pw_scene_step){ d->tableau->stages, d->row, h, t, r->q, d->V, d->A, d->R, d->q, d->v, d->lambda });
}

/* Evaluates stages 1, 2, ...; stage 0 is the current state.  Then combines them to the new
 * state.  Returns what pw_run_accelerate returns. */
static int rk_stages (pw_run *r, double h) {
  struct pw_method_data *d = r->data;
  const pw_tableau *b = d->tableau;
  d->V[0] = r->v, d->A[0] = r->a, d->R[0] = r->rate;
  if (rk_stages_specialised (r, h)) return PW_OK;
  int status = d->held ? rk_hold (r) : PW_OK;
  for (int i = 1; i < b->stages && status == PW_OK; i++) {
    rk_combine (r, d->q, d->V[i], &d->row[i], h);
    double t = pw_before_breakpoint (r, r->t + b->c[i] * h);
    status = rk_stage (r, t, d->V[i], d->A[i], d->R[i]);
  }
  if (d->held) pw_hold_signals (r->w, 0);
  if (status != PW_OK) return status;
  rk_combine (r, d->q, d->v, &d->row[0], h);
  return rk_finite (r, d->q, d->v) ? PW_OK : PW_RETRY;
}

/* Projects the new state and evaluates its accelerations; *added grows by the energy this adds. */
static int rk_project (pw_run *r, double t, double *added) {
  struct pw_method_data *d = r->data;
  const pw_system *s = r->s;
  int status = PW_OK;
  double before = 0;
  if (added) {
    status = pw_update_kinematics (r->w, t, d->q, d->v);
    before = pw_kinetic (s, d->v) + pw_potential (r->w);
  }
  if (status == PW_OK) status = pw_project_state (&d->projector, r, t, d->q, d->v, d->a, d->lambda);
  if (status == PW_OK && added) *added += pw_kinetic (s, d->v) + pw_potential (r->w) - before;
  return status;
}

/* From the state reached to its successor at t1 = t + h, in d->q, d->v, d->a, d->lambda. */
int pw_rk_step (pw_run *r, double h, double t1, int project, double *added) {
  struct pw_method_data *d = r->data;
  int status = d->null_space ? pw_nullspace_begin (&d->nullspace, r) : PW_OK;
  if (status == PW_OK) status = rk_stages (r, h);
  if (status != PW_OK) return status;
  if (project) return rk_project (r, t1, added);
  if (!d->null_space) return pw_run_accelerate (r, t1, d->q, d->v, d->a, d->lambda);
  status =
      pw_nullspace_finalise (&d->nullspace, d->projects_positions ? &d->projector : NULL, r, t1, d->q, d->v, added);
  return status == PW_OK ? pw_nullspace_accelerate (r, d->v, d->a, d->lambda) : status;
}

void pw_rk_keep (pw_run *r) {
  pw_rk_begin *last = &r->data->last;
  size_t entries = (size_t)r->s->entries * sizeof (double);
  last->t = r->t, last->projected = r->projected;
  memcpy (last->q, r->q, pw_rk_block (r, 0));
  memcpy (last->ledger, r->ledger, entries);
  memcpy (last->rate, r->rate, entries);
}

void pw_rk_accept (pw_run *r, double h, double t1, double added) {
  struct pw_method_data *d = r->data;
  pw_rk_keep (r);
  memcpy (r->q, d->q, pw_rk_block (r, 1));
  r->t = t1;
  pw_rk_ledger (r, r->ledger, d->last.ledger, h);
  r->projected += added;
  pw_ledger_rates (r, r->lambda, r->rate);
}

double pw_rk_distance (const pw_run *r) {
  const pw_system *s = r->s;
  const struct pw_method_data *d = r->data;
  double most = 0;
  for (int j = 0; j < s->coords; j++) {
    double q = fabs (d->q[j] - r->q_at[j]), v = r->w->scale.time * fabs (d->v[j] - r->v_at[j]);
    most = pw_larger_or_nan (most, pw_larger_or_nan (q, v) / pw_unit (s, j));
  }
  return most;
}

int pw_rk_fail (pw_run *r, int status, double h, pw_error *error) {
  int finite = rk_finite (r, r->data->q, r->data->v) && rk_finite (r, r->q, r->v);
  int against =
      (r->data->projects || r->data->projects_positions) && finite ? r->data->projector.contradicting_row : -1;
  char element[120];
  if (status < 0) return pw_fail_signal (r->t, error);
  if (against >= 0) /* a redundant equation contradicts the others */
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s contradicts the other constraints", r->t,
                    pw_system_row_name (r->s, against, element, sizeof element));
  if (finite && pw_watchdog_near_state (r)) return pw_fail_singular (r, r->t, error);
  if (!finite && h < 1e-12 * fabs (r->t))
    return pw_fail (error, PW_METHOD, "t = %.6g s: the next state is not finite, however small the step", r->t);
  return pw_fail (error, PW_METHOD, "t = %.6g s: the step of %.6g s is too large: %s", r->t, h,
                  r->data->split        ? "near a singular configuration no two divisions of it agree"
                  : !finite             ? "the state is no longer finite"
                  : r->data->null_space ? "the basis of the velocities does not stay valid"
                  : r->data->projects   ? "the projection does not converge"
                                        : "a stage of it lands in a singular configuration");
}
