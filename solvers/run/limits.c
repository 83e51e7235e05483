/* Limits that end a run: the caller's request, the number of attempted steps of an adaptive method, coordinates too
 * large for double precision to resolve the scene.  Unbounded growth of velocities is reported.
 *
 * With the unit u of a coordinate (L, or 1 rad) and the round-off eps, q has an error of eps |q|.  From eps |q| = 0.01
 * u on, round-off alone violates a constraint by a residual with which it counts as lost (1e-2, scaled), and changes
 * directions of forces by 0.01 rad.
 *
 * A constant torque or force that nothing opposes accelerates a scene from rest to the speed N u/T in the time N T (T:
 * the time scale of its initial accelerations), and turns it by N^2/2.  Growth beyond N = 1e3, some 80,000 turns,
 * is reported.  It may be intended, so it is not an error; but the number of steps grows with the number of turns, like
 * the square of the time. */
#include <float.h>
#include <stdio.h>
#include "method.h"

#define LIMITS_RESOLVED 1e-2 /* in u: error eps |q| beyond which a run fails */
#define LIMITS_FAST 1e3      /* in u / T: speeds beyond which growth is reported */
#define LIMITS_GROWTH 0.25   /* exponent p of t^p above which a velocity counts as growing */

/* The largest velocity at the state reached, in u / T; *state: its index among the states. */
static double limits_speed (const pw_run *r, int *state) {
  const pw_system *s = r->s;
  double most = 0;
  *state = s->coords;
  for (int j = 0; j < s->coords; j++) {
    double speed = fabs (r->v[j]) * r->w->scale.time / pw_unit (s, j);
    if (speed > most) most = speed, *state = s->coords + j;
  }
  return most;
}

double pw_run_growth (const pw_run *r, int *state, double *power) {
  double now = limits_speed (r, state), span = r->t - r->settings.t;
  /* the last record may be of this moment, the one before is at half its time or less */
  *power = r->earlier_record.time > 0 && r->earlier_record.speed > 0
               ? log (now / r->earlier_record.speed) / log (span / r->earlier_record.time)
               : 0;
  return now > LIMITS_FAST && *power > LIMITS_GROWTH ? now : 0;
}

/* Records the largest speed whenever the elapsed time has doubled.  Returns 1 at such a time. */
static int limits_record_speed (pw_run *r) {
  int state;
  double span = r->t - r->settings.t;
  if (span < 2 * r->speed_record.time) return 0;
  r->earlier_record = r->speed_record;
  r->speed_record.time = span, r->speed_record.speed = limits_speed (r, &state);
  return 1;
}

static int limits_fail_steps (const pw_run *r, pw_error *error) {
  const pw_statistics *now = &r->statistics;
  char grows[240] = "";
  int state;
  double power, growth = pw_run_growth (r, &state, &power);
  if (growth > 0)
    snprintf (grows, sizeof grows,
              "; the motion grows without bound: %s = %.3g %s, %.2g times the scene's own speed, as t^%.1f",
              PW_NAME (pw_system_state_name, r->s, state), r->v[state - r->s->coords],
              pw_system_state_unit (r->s, state), growth, power);
  return pw_fail (error, PW_METHOD,
                  "t = %.6g s: the limit max-steps is reached: %ld attempted steps, %ld of them rejected%s", r->t,
                  now->steps + now->rejected, now->rejected, grows);
}

int pw_run_check_limits (pw_run *r, pw_error *error) {
  if (pw_run_stop_requested (r)) return PW_STOPPED;
  if (r->statistics.steps + r->statistics.rejected < r->settings.max_steps || r->fixed_steps) return PW_OK;
  return limits_fail_steps (r, error);
}

int pw_run_check_resolution (pw_run *r, pw_error *error) {
  const pw_system *s = r->s;
  if (!limits_record_speed (r) && r->statistics.steps % PW_CHECK_INTERVAL != 0) return PW_OK;
  for (int j = 0; j < s->coords; j++) {
    double round_off = fabs (r->q[j]) * DBL_EPSILON;
    if (!(round_off > LIMITS_RESOLVED * pw_unit (s, j))) continue;
    if (r->fixed_steps && fabs (r->v[j]) * r->settings.step > 0.1 * fabs (r->q[j])) /* within a few steps */
      return pw_fail (error, PW_METHOD,
                      "t = %.6g s: the step of %.6g s is too large: the state grows beyond all bounds", r->t,
                      r->settings.step);
    return pw_fail (error, PW_METHOD,
                    "t = %.6g s: the motion has grown beyond what numbers resolve: %s = %.3g %s, known to %.2g only",
                    r->t, PW_NAME (pw_system_state_name, s, j), r->q[j], pw_system_state_unit (s, j), round_off);
  }
  return PW_OK;
}
