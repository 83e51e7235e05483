/* Checks after each step that the run still follows the motion: that constraints are neither lost nor contradictory,
 * and that the motion has not jumped to another branch at a singular configuration.
 *
 * The sine (watchdog.h) changes by at most a multiple of the motion of the bodies (`lipschitz`), so it is computed
 * again only when the motion since could have made it small. */
#include <stdio.h>
#include <string.h>
#include "method.h"
#include "rank.h"

double pw_run_acceleration_norm (const pw_run *r) {
  const double per_angle = r->w->scale.time * r->w->scale.time, per_length = per_angle / r->s->scale.length;
  double norm = 0;
  for (int j = 0; j < r->s->coords; j++)
    norm = pw_larger_or_nan (norm, fabs (r->a[j]) * (pw_is_angle (r->s, j) ? per_angle : per_length));
  return norm;
}

/* The largest change of a body's coordinate in the last step, in units of the scene. */
static double watchdog_step_length (const pw_run *r) {
  double length = 0;
  for (int j = 0; j < 3 * r->s->bodies; j++)
    length = pw_larger (fabs (r->q[j] - r->watchdog.previous_q[j]) / pw_unit (r->s, j), length);
  return length;
}

/* ---- Following the motion ---- */

static void watchdog_record_sine (pw_run *r, double sine) {
  pw_watchdog *watch = &r->watchdog;
  watch->checked_sine = sine;
  watch->moved = 0;
  watch->largest_sine = fmax (watch->largest_sine, sine);
}

/* 1 if the sine may be below this value at the state reached or after a motion of this length from there. */
static int watchdog_reaches (const pw_run *r, double sine, double length) {
  const pw_watchdog *watch = &r->watchdog;
  return watch->saddle &&
         !(watch->checked_sine - r->thresholds.lipschitz * watch->largest_sine * (watch->moved + length) > sine);
}

/* The typical sine: the largest at a few irregular configurations, which need not satisfy the constraints. */
static void watchdog_sample_sines (pw_run *r) {
  const pw_system *s = r->s;
  pw_watchdog *watch = &r->watchdog;
  for (int n = 1; n <= 4; n++) {
    for (int j = 0; j < s->coords; j++)
      watch->previous_q[j] = r->q[j] + 0.5 * pw_unit (s, j) * pw_irregular (n, (j + 1) * n);
    if (pw_evaluate_J_at (r->w, r->t, watch->previous_q, r->v) != PW_OK) break;
    watch->largest_sine = fmax (watch->largest_sine, pw_watchdog_sine (r, NULL));
  }
  r->w->failed = NULL;
  (void)pw_evaluate_J_at (r->w, r->t, r->q, r->v);
}

void pw_watchdog_begin (pw_run *r) {
  pw_watchdog *watch = &r->watchdog;
  if (watch->saddle == NULL) return;
  if (watch->largest_sine == 0) watchdog_sample_sines (r);
  watchdog_record_sine (r, pw_watchdog_sine (r, NULL));
  watch->previous_t = r->t;
  watch->previous_sine = watch->checked_sine;
  watch->step_length = watch->sine_slope = 0;
  watch->sine_before_checked = NAN;
  watch->may_have_crossed = 0;
  watch->singular_ahead = 1;
  memcpy (watch->previous_q, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *watch->previous_q);
}

/* Checks the step to the state reached, where J is evaluated.  PW_METHOD if it has left its branch, or passed a change
 * point without resolving it; PW_RESOURCE. */
static int watchdog_follow (pw_run *r, pw_error *error) {
  pw_watchdog *watch = &r->watchdog;
  int status = PW_OK;
  if (watch->saddle == NULL) return PW_OK;
  watch->step_length = watchdog_step_length (r);
  watch->moved += watch->step_length;
  double near = r->thresholds.near * watch->largest_sine, ahead = r->thresholds.step_growth * watch->step_length;
  int may_be_near = watchdog_reaches (r, near, ahead);
  if (may_be_near) {
    double last = watch->moved == watch->step_length ? watch->checked_sine : NAN;
    watchdog_record_sine (r, pw_watchdog_sine (r, &watch->dependent_row));
    status = pw_change_point_check (r, watch->checked_sine, error);
    if (status == PW_OK) status = pw_change_point_resolve (r, last, error);
    if (status == PW_OK) status = pw_dead_point_passed (r, error);
    if (status != PW_OK) return status;
    watch->sine_before_checked = last;
  } else
    watch->sine_before_checked = NAN, watch->sine_slope = 0, watch->may_have_crossed = 0;
  if (may_be_near && watch->checked_sine < near) r->near_singular = 1;
  watch->singular_ahead = may_be_near && watchdog_reaches (r, near, ahead);
  watch->previous_t = r->t;
  watch->previous_sine = may_be_near ? watch->checked_sine : NAN;
  memcpy (watch->previous_q, r->q, 2 * ((size_t)r->s->coords + 3) * sizeof *watch->previous_q);
  return status;
}

/* ---- Lost constraints ---- */

static int watchdog_fail_lost (pw_run *r, int contradicts, pw_error *error) {
  pw_residuals now;
  char cause[60] = "constraint drift";
  pw_evaluate_residuals (r->w, NULL, &now);
  int in_position = isnan (now.position) || now.position > now.velocity;
  int row = in_position ? now.row_position : now.row_velocity;
  const char *element = row >= 0 ? PW_NAME (pw_system_row_name, r->s, row) : "a constraint", *advice = "";
  if (contradicts) {
    snprintf (cause, sizeof cause, "constraints contradict each other");
    if (row >= 0) advice = pw_advice_on_wheel (r->s, row);
  } else if (pw_stabilised_by (r, PW_UNSTABILISED))
    advice = r->fixed_steps ? "; a smaller step or a stabilisation reduces it"
                            : "; a smaller tolerance or a stabilisation reduces it";
  else if (r->fixed_steps)
    snprintf (cause, sizeof cause, "the step of %.6g s is too large", r->settings.step);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s: %s is violated by %.3g in %s (scaled)%s", r->t, cause, element,
                  in_position ? now.position : now.velocity, in_position ? "position" : "velocity", advice);
}

static int watchdog_exceeds (double position, double velocity, double limit) {
  return !(position <= limit && velocity <= limit);
}

/* 1 if a redundant row is violated by more than the residuals of the others explain: it contradicts them. */
static int watchdog_contradicts (pw_run *r) {
  pw_residuals all, enforced;
  pw_evaluate_residuals (r->w, NULL, &all);
  if (!watchdog_exceeds (all.position, all.velocity, r->thresholds.redundant_residual)) return 0;
  pw_evaluate_residuals (r->w, r->active, &enforced);
  double explained =
      r->thresholds.redundant_residual + r->thresholds.redundant_ratio * fmax (enforced.position, enforced.velocity);
  return watchdog_exceeds (all.position, all.velocity, explained);
}

/* ---- Branches ---- */

/* The residual of positions: scaled, or in units of L if that is larger. */
static double watchdog_residual (const pw_run *r) {
  return pw_larger (r->residuals.position, r->residuals.g / r->s->scale.length);
}

/* 1 if a constraint residual d may decide which branch is followed: if the sine s is below its regular value, and s^2
 * below d / ratio.  Drifted constraints, x y = d in place of x y = 0 (thresholds.c), connect branches that cross by a
 * turn, which a method follows however small its steps. */
static int watchdog_unresolved (pw_run *r, double residual, double ratio) {
  int row;
  double bound = fmin (sqrt (residual / ratio), r->thresholds.regular * r->watchdog.largest_sine);
  return bound > r->thresholds.rank_lost && watchdog_reaches (r, bound, 0) && pw_watchdog_sine (r, &row) < bound &&
         row < r->s->holonomic;
}

/* Fails where residuals may decide the branch and accelerations have grown, or residuals are large: the turn is then a
 * corner whose radius grows with the residual, so that its accelerations need not grow. */
static int watchdog_check_turn (pw_run *r, double norm, pw_error *error) {
  const pw_thresholds *limit = &r->thresholds;
  double residual = watchdog_residual (r), before = fmax (r->previous_norm, limit->turn_reference);
  if (!(norm <= limit->turn_growth * before) && watchdog_unresolved (r, residual, limit->drift_turn))
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: lost at a singular configuration: constraint residuals of %.2g (scaled) may lead to "
                    "another branch, with accelerations %.3g times those before; methods with projection pass",
                    r->t, residual, norm / before);
  if (!(residual <= limit->drift_far) && watchdog_unresolved (r, residual, limit->drift_any))
    return pw_fail (
        error, PW_METHOD,
        "t = %.6g s: lost at a singular configuration: constraint residuals of %.2g (scaled) do not tell one branch "
        "from another; methods with projection pass",
        r->t, residual);
  return PW_OK;
}

/* Accelerations of the physical motion do not grow at a singular configuration; in a jump to another branch they do, if
 * the dependent row is nonholonomic. */
static int watchdog_check_jump (pw_run *r, pw_error *error) {
  int row = -1;
  double norm = pw_run_acceleration_norm (r);
  if (r->near_singular) pw_watchdog_sine (r, &row);
  int may_jump = r->near_singular && (row < 0 || row >= r->s->holonomic || !isfinite (norm));
  if (may_jump && !(norm <= r->thresholds.jump_growth * r->reference_level))
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: lost at a singular configuration: the accelerations are %.3g times those before", r->t,
                    norm / r->reference_level);
  if (r->near_singular || watchdog_unresolved (r, watchdog_residual (r), r->thresholds.drift_near))
    return watchdog_check_turn (r, norm, error);
  r->reference_level = pw_larger (norm, r->reference_level);
  r->previous_norm = norm;
  return PW_OK;
}

int pw_run_watchdog (pw_run *r, pw_error *error) {
  pw_record_residuals (r);
  double lost = pw_stabilised_by (r, PW_UNSTABILISED) ? r->thresholds.lost_unstabilised : r->thresholds.lost;
  int contradicts = r->redundant && watchdog_contradicts (r);
  if (contradicts || watchdog_exceeds (r->residuals.position, r->residuals.velocity, lost))
    return watchdog_fail_lost (r, contradicts, error);
  int status = watchdog_follow (r, error);
  return status == PW_OK ? watchdog_check_jump (r, error) : status;
}
