/* Checks that the state reached is still on the motion: constraints lost or contradictory, a jump to another branch
 * at a singular configuration. */
#include <stdio.h>
#include "method.h"

double pw_run_acceleration_norm (const pw_run *r) {
  const pw_system *s = r->s;
  const double *a = r->a, *own = a + 3 * s->bodies;
  double linear = 0, angular = 0, per = r->w->scale.time * r->w->scale.time;
  for (; a < own; a += 3) {
    linear = pw_largest (linear, fabs (a[0]));
    linear = pw_largest (linear, fabs (a[1]));
    angular = pw_largest (angular, fabs (a[2]));
  }
  for (; a < r->a + s->coords; a++) angular = pw_largest (angular, fabs (*a));
  return pw_largest (linear * (per / s->scale.length), angular * per);
}

static int branch_fail_lost (pw_run *r, pw_error *error) {
  pw_residuals now;
  char element[120] = "a constraint", cause[60] = "constraint drift";
  pw_evaluate_residuals (r->w, NULL, &now);
  int row = now.position > now.velocity ? now.row_position : now.row_velocity;
  if (row >= 0) pw_system_row_name (r->s, row, element, sizeof element);
  const char *advice = "";
  if (row >= 0 && r->active && !r->active[row])
    snprintf (cause, sizeof cause, "constraints contradict each other");
  else if (pw_stabilised_by (r, PW_UNSTABILISED))
    advice = pw_fixed_steps (r) ? "; a smaller step or a stabilisation reduces it"
                                : "; a smaller tolerance or a stabilisation reduces it";
  else if (pw_fixed_steps (r))
    snprintf (cause, sizeof cause, "the step of %.6g s is too large", r->settings.step);
  return pw_fail (error, PW_METHOD, "t = %.6g s: %s: %s is violated by %.3g in position and %.3g in rate (scaled)%s",
                  r->t, cause, element, now.position, now.velocity, advice);
}

/* The constraint residual, in units of the scene. */
static double branch_residual (const pw_run *r) {
  return pw_larger (r->known.position, r->known.g / r->s->scale.length);
}

/* 1 if a constraint residual `off` may decide which branch is followed: if the sine s of the smallest angle between
 * rows, below its regular value, is not much larger than the square root of the residual.
 *
 * Where two branches of a motion cross, the constraints are x y = 0 in suitable coordinates, and s = |(x, y)|.  With
 * a residual d they are x y = d: the branches do not cross but turn into each other, where s^2 is about 2 d.  A
 * method that follows the drifted constraints follows the turn, however small its steps. */
static int branch_unresolved (pw_run *r, double off, double part) {
  int row;
  double bound = fmin (sqrt (off / part), r->limits.regular * r->geometry.typical);
  return bound > r->limits.rank && pw_watchdog_reaches (r, bound, 0) && pw_watchdog_sine (r, &row) < bound &&
         row < r->s->holonomic;
}

/* Such a turn is a rounded corner, the wider the larger the residual: its accelerations need not jump. */
static int branch_check_turn (pw_run *r, double now, pw_error *error) {
  const pw_watchdog *limit = &r->limits;
  double off = branch_residual (r), before = fmax (r->before, limit->least_turn);
  if (!(now <= limit->turn * before) && branch_unresolved (r, off, limit->drift_turn))
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: lost at a singular configuration: constraints off by %.2g (scaled) may lead to "
                    "another branch, with "
                    "%.3g times the accelerations of before; methods with projection pass",
                    r->t, r->known.position, now / before);
  if (!(off <= limit->drift_far) && branch_unresolved (r, off, limit->drift_any))
    return pw_fail (
        error, PW_METHOD,
        "t = %.6g s: lost at a singular configuration: constraints off by %.2g (scaled) tell no branch from another; "
        "methods with projection pass",
        r->t, r->known.position);
  return PW_OK;
}

/* 1 near a singular configuration of nonholonomic rows, or if the state is not finite. */
static int branch_near_rows (pw_run *r) {
  int row;
  if (!r->near) return 0;
  pw_watchdog_sine (r, &row);
  return row < 0 || row >= r->s->holonomic || !isfinite (pw_run_acceleration_norm (r));
}

/* Accelerations of the physical motion do not grow at a singular configuration; in a jump to another branch they do. */
static int branch_check_jump (pw_run *r, pw_error *error) {
  double now = pw_run_acceleration_norm (r);
  if (branch_near_rows (r) && !(now <= r->limits.jump * r->reference_level))
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: lost at a singular configuration: the accelerations are %.3g times those before", r->t,
                    now / r->reference_level);
  if (r->near || branch_unresolved (r, branch_residual (r), r->limits.drift_near))
    return branch_check_turn (r, now, error);
  r->reference_level = pw_larger (now, r->reference_level);
  r->before = now;
  return PW_OK;
}

/* 1 if a redundant row is violated by more than the residuals of the others explain: it contradicts them. */
static int branch_contradicts (pw_run *r) {
  const double round_off = r->limits.follows;
  pw_residuals all, enforced;
  pw_evaluate_residuals (r->w, NULL, &all);
  if (all.position <= round_off && all.velocity <= round_off) return 0;
  pw_evaluate_residuals (r->w, r->active, &enforced);
  double explained = round_off + r->limits.magnified * fmax (enforced.position, enforced.velocity);
  return !(all.position <= explained && all.velocity <= explained);
}

int pw_run_watchdog (pw_run *r, pw_error *error) {
  const pw_statistics *s = &r->statistics;
  pw_note_residuals (r);
  if (!(s->position <= r->limits.lost && s->velocity <= r->limits.lost)) {
    double lost = pw_stabilised_by (r, PW_UNSTABILISED) ? r->limits.lost_unstabilised : r->limits.lost;
    if (!(s->position <= lost && s->velocity <= lost)) return branch_fail_lost (r, error);
  }
  if (r->redundant && branch_contradicts (r)) return branch_fail_lost (r, error);
  int status = pw_watchdog_follow (r, error);
  return status == PW_OK ? branch_check_jump (r, error) : status;
}
