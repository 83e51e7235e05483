/* A step of an explicit Runge-Kutta method with the coefficients A, b on q' = v, v' = a (t, q, v).
 *
 *   stage i      q_i = q + h sum_j A_ij v_j,   v_i = v + h sum_j A_ij a_j,   j < i
 *   new state    q + h sum_j b_j v_j,          v + h sum_j b_j a_j
 *
 * The rates of work and losses are integrated with the same stages.  The new state may be projected.  Its accelerations
 * are evaluated immediately, as stage 0 of the next step, so that they are always available. */
#include <math.h>
#include <string.h>
#include "rk_step.h"

/* (q, v) = the state reached + h sum_j weight_j (v_j, a_j), with the weights of a row of the tableau. */
static void rk_combine (const pw_run *r, double *q, double *v, const pw_rk_row *row, double h) {
  const pw_method_data *d = r->data;
  const int n = r->s->coords;
  memcpy (q, r->q, (size_t)n * sizeof *q);
  memcpy (v, r->v, (size_t)n * sizeof *v);
  for (int j = 0; j < row->count; j++) {
    pw_add_scaled (q, d->stage_v[row->stage[j]], h * row->weight[j], n);
    pw_add_scaled (v, d->stage_a[row->stage[j]], h * row->weight[j], n);
  }
}

void pw_rk_ledger (const pw_run *r, double *end, const double *beginning, double h) {
  const pw_method_data *d = r->data;
  const pw_rk_row *b = &d->row[0];
  for (int i = 0; i < r->entries; i++) {
    double sum = beginning[i];
    for (int j = 0; j < b->count; j++) sum += h * b->weight[j] * d->stage_rate[b->stage[j]][i];
    end[i] = sum;
  }
}

/* Accelerations of a stage at the positions d->q and the velocities v, which the null-space method replaces, and the
 * rates of the ledger. */
static inline int rk_evaluate_stage (pw_run *r, double t, double *v, double *a, double *rate) {
  pw_method_data *d = r->data;
  int status;
  if (d->uses_nullspace) {
    status = pw_nullspace_velocities (&d->nullspace, r, t, d->q, v);
    if (status == PW_OK) status = pw_nullspace_accelerate (r, v, a, d->lambda);
  } else {
    status = pw_run_accelerate (r, t, d->q, v, a, d->lambda);
  }
  if (status == PW_OK) pw_ledger_rates (r, d->lambda, rate);
  return status;
}

/* Does what rk_stages does by specialised code: 1; 0 if none suits, or it refuses a stage. */
static int rk_stages_specialised (pw_run *r, double h) {
  pw_method_data *d = r->data;
  double t[PW_RK_STAGES];
  if (r->specialised == NULL || d->holds_signals || d->uses_nullspace) return 0;
  for (int i = 1; i < d->tableau->stages; i++) t[i] = pw_before_breakpoint (r, r->t + d->tableau->c[i] * h);
  return pw_specialised_stages (r, &(pw_scene_step){ d->tableau->stages, d->row, h, t, r->q, d->stage_v, d->stage_a,
                                                     d->stage_rate, d->q, d->v, d->lambda });
}

/* Evaluates stages 1, 2, ...; stage 0 is the state reached.  Then combines them into the new state.  Returns as
 * pw_run_accelerate. */
static int rk_stages (pw_run *r, double h) {
  pw_method_data *d = r->data;
  const pw_tableau *tableau = d->tableau;
  d->stage_v[0] = r->v, d->stage_a[0] = r->a, d->stage_rate[0] = r->rate;
  if (rk_stages_specialised (r, h)) return PW_OK;
  int status = PW_OK;
  if (d->holds_signals) { /* since a sample or a rejected step, the workspace may be at another state */
    status = pw_update_kinematics (r->w, r->t, r->q, r->v);
    pw_hold_signals (r->w, status == PW_OK);
  }
  for (int i = 1; i < tableau->stages && status == PW_OK; i++) {
    rk_combine (r, d->q, d->stage_v[i], &d->row[i], h);
    double t = pw_before_breakpoint (r, r->t + tableau->c[i] * h);
    status = rk_evaluate_stage (r, t, d->stage_v[i], d->stage_a[i], d->stage_rate[i]);
  }
  if (d->holds_signals) pw_hold_signals (r->w, 0);
  if (status != PW_OK) return status;
  rk_combine (r, d->q, d->v, &d->row[0], h);
  return pw_is_finite_state (r, d->q, d->v) ? PW_OK : PW_RETRY;
}

int pw_rk_step (pw_run *r, double h, double t1, int project, double *added_energy) {
  pw_method_data *d = r->data;
  int status = d->uses_nullspace ? pw_nullspace_begin (&d->nullspace, r) : PW_OK;
  if (status == PW_OK) status = rk_stages (r, h);
  if (status != PW_OK) return status;
  if (project) return pw_project_state (&d->projector, r, t1, d->q, d->v, d->a, d->lambda, added_energy);
  if (!d->uses_nullspace) return pw_run_accelerate (r, t1, d->q, d->v, d->a, d->lambda);
  status = pw_nullspace_finalise (&d->nullspace, d->nullspace_projects ? &d->projector : NULL, r, t1, d->q, d->v,
                                  added_energy);
  return status == PW_OK ? pw_nullspace_accelerate (r, d->v, d->a, d->lambda) : status;
}

void pw_rk_accept (pw_run *r, double h, double t1, double added_energy) {
  pw_method_data *d = r->data;
  pw_store_start (&d->last, r);
  memcpy (r->q, d->q, pw_state_length (r->s) * sizeof *r->q);
  r->t = t1;
  pw_rk_ledger (r, r->ledger, d->last.ledger, h);
  r->projected += added_energy;
  pw_ledger_rates (r, r->lambda, r->rate);
}

double pw_rk_distance (const pw_run *r) {
  const pw_system *s = r->s;
  const pw_method_data *d = r->data;
  double most = 0;
  for (int j = 0; j < s->coords; j++) {
    double q = fabs (d->q[j] - r->q_at[j]), v = r->w->scale.time * fabs (d->v[j] - r->v_at[j]);
    most = pw_larger_or_nan (most, pw_larger_or_nan (q, v) / pw_unit (s, j));
  }
  return most;
}

int pw_rk_fail (pw_run *r, int status, double t, double h, int divided, pw_error *error) {
  int finite = pw_is_finite_state (r, r->data->q, r->data->v) && pw_is_finite_state (r, r->q, r->v);
  int has_projector = r->data->projects || r->data->nullspace_projects;
  int contradictory = has_projector && finite ? r->data->projector.contradictory_row : -1;
  if (status < 0) return pw_fail_signal (t, error);
  if (contradictory >= 0)
    return pw_fail (error, PW_METHOD, "t = %.6g s: %s contradicts the other constraints", t,
                    PW_NAME (pw_system_row_name, r->s, contradictory));
  if (finite && pw_watchdog_near_state (r)) return pw_fail_singular (r, t, error);
  if (!finite && h < 1e-12 * fabs (t)) /* some 4000 eps */
    return pw_fail (error, PW_METHOD, "t = %.6g s: the next state is not finite, however small the step", t);
  return pw_fail (error, PW_METHOD, "t = %.6g s: the step of %.6g s is too large: %s", t, h,
                  divided                   ? "near a singular configuration, where no two divisions of it agree"
                  : !finite                 ? "the state is no longer finite"
                  : r->data->uses_nullspace ? "the basis of the velocities does not stay valid"
                  : r->data->projects       ? "the projection does not converge"
                                            : "a stage of it lands in a singular configuration");
}
