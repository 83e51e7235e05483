/* Accelerations a and multipliers lambda of a run, with Baumgarte's terms if selected:
 *
 *   M a + J^T lambda = f
 *   J a = gamma - 2 alpha (J v - eta) - beta^2 g     for holonomic rows
 *   J a = gamma - alpha (J v - eta)                  for nonholonomic ones
 *
 * (Baumgarte 1972, Stabilization of constraints and integrals of motion in dynamical systems.) */
#include <math.h>
#include <string.h>
#include "method.h"

/* The first coords + 3 + rows numbers of r->scratch stay free for callers. */
void pw_run_gamma (pw_run *r, const double *v, double *gamma) {
  const pw_system *s = r->s;
  double *Jv = r->scratch + s->coords + 3 + s->rows, *eta = Jv + s->rows, *g = eta;
  pw_evaluate_gamma (r->w, gamma);
  if (r->alpha + r->beta == 0) return;
  pw_mul_J (r->w, v, Jv);
  pw_evaluate_eta (r->w, eta);
  for (int i = 0; i < s->rows; i++) gamma[i] -= (i < s->holonomic ? 2 : 1) * r->alpha * (Jv[i] - eta[i]);
  pw_evaluate_g (r->w, g);
  for (int i = 0; i < s->holonomic; i++) gamma[i] -= r->beta * r->beta * g[i];
}

/* Computes gamma and returns the forces at the current configuration: those computed into f, or the system's array of
 * constant forces if there are no others. */
static inline const double *dynamics_right_side (pw_run *r, const double *v, double *f, double *gamma) {
  pw_run_gamma (r, v, gamma);
  if (r->s->forces == 0) return r->s->constant;
  pw_evaluate_force (r->w, f);
  return f;
}

/* Iterative refinement (Wilkinson 1963): near a singular configuration the factorisation has an error of eps / sine^2
 * (thresholds.c); refinement reduces it to eps / sine. */
static void dynamics_refine (pw_run *r, const double *v, double *a, double *lambda) {
  const pw_system *s = r->s;
  double *f = r->scratch, *gamma = f + s->coords + 3;                                  /* residuals */
  double *da = r->w->scratch, *dlambda = da + s->coords + 3, *Jda = dlambda + s->rows; /* corrections */
  if (dynamics_right_side (r, v, f, gamma) != f) pw_evaluate_force (r->w, f);
  for (int j = 0; j < s->coords; j++) da[j] = a[j];
  for (int i = 0; i < s->rows; i++) dlambda[i] = lambda[i];
  for (int pass = 0; pass < 3; pass++) { /* the first solution is the correction of a = 0, lambda = 0 */
    for (int j = 0; j < s->coords; j++) f[j] -= s->mass[j] * da[j];
    for (int i = 0; i < s->rows; i++) dlambda[i] = -dlambda[i];
    pw_add_JT (r->w, dlambda, f);
    pw_mul_J (r->w, da, Jda);
    for (int i = 0; i < s->rows; i++) gamma[i] -= Jda[i];
    pw_saddle_solve (r->saddle, f, gamma, da, dlambda);
    for (int j = 0; j < s->coords; j++) a[j] += da[j];
    for (int i = 0; i < s->rows; i++) lambda[i] += dlambda[i];
  }
}

void pw_run_accelerate_updated (pw_run *r, const double *v, double *a, double *lambda) {
  const double *f = dynamics_right_side (r, v, r->scratch, lambda);
  r->statistics.rhs++;
  pw_saddle_solve (r->saddle, f, lambda, a, lambda);
  if (pw_saddle_sine_below (r->saddle, r->thresholds.refine)) dynamics_refine (r, v, a, lambda);
}

/* Factorises and solves, with gamma in the array of lambda; *near = 1 near a singular configuration, where the status
 * is PW_RETRY if the sine is at most r->refused_sine. */
static inline int dynamics_solve (pw_run *r, const double *v, double *a, double *lambda, int *near) {
  const double *f = dynamics_right_side (r, v, r->scratch, lambda);
  r->statistics.rhs++;
  r->statistics.factorisations++;
  int status = pw_saddle_factor (r->saddle);
  if (status == PW_OK) pw_saddle_solve (r->saddle, f, lambda, a, lambda);
  *near = pw_watchdog_near (r);
  if (*near && r->watchdog.evaluated_sine <= r->refused_sine) return PW_RETRY;
  if (status == PW_OK && pw_saddle_sine_below (r->saddle, r->thresholds.refine)) dynamics_refine (r, v, a, lambda);
  return status;
}

int pw_run_accelerate_evaluated (pw_run *r, const double *v, double *a, double *lambda) {
  int near;
  return dynamics_solve (r, v, a, lambda, &near);
}

int pw_run_accelerate (pw_run *r, double t, const double *q, const double *v, double *a, double *lambda) {
  if (pw_specialised_evaluate (r, t, q, v, a, lambda)) return PW_OK;
  int near, status = pw_evaluate_J_at (r->w, t, q, v);
  if (status != PW_OK) return status;
  status = dynamics_solve (r, v, a, lambda, &near);
  if (near) r->near_singular = 1;
  return status;
}

void pw_sample_reached (pw_run *r) {
  memcpy (r->q_at, r->q, pw_state_length (r->s) * sizeof *r->q);
  memcpy (r->ledger_at, r->ledger, (size_t)r->entries * sizeof (double));
  r->projected_at = r->projected;
  (void)pw_evaluate_J_at (r->w, r->t, r->q_at, r->v_at);
}

void pw_record_residuals (pw_run *r) {
  pw_residuals *now = &r->residuals;
  pw_statistics *largest = &r->statistics;
  pw_specialised_residuals (r);
  if (isnan (now->position)) pw_evaluate_position_residual (r->w, NULL, now);
  if (isnan (now->velocity)) pw_evaluate_velocity_residual (r->w, NULL, now);
  largest->position = pw_larger (largest->position, now->position);
  largest->velocity = pw_larger (largest->velocity, now->velocity);
  largest->g = pw_larger (largest->g, now->g);
  largest->jv = pw_larger (largest->jv, now->jv);
}
