/* The thresholds of the watchdog: a change of each one changes a result. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "bars.h"
#include "check.h"
#include "method.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

/* The effect on a run: it stops EARLIER or LATER; FEWER or MORE steps are rejected. */
typedef enum { WATCHDOG_EARLIER, WATCHDOG_LATER, WATCHDOG_FEWER, WATCHDOG_MORE } watchdog_effect;

#define WATCHDOG_LIMIT(x) #x, offsetof(pw_thresholds, x)

static const struct {
  const char *name;
  size_t at;     /* offset in pw_thresholds */
  double factor; /* of the threshold */
  watchdog_effect effect;
  const char *model, *parameter;
  double value; /* of the parameter */
  const char *method;
  double tolerance, t; /* rtol, or fixed step [s]; end of the run [s] */
} watchdog_limit[] = {
  { WATCHDOG_LIMIT (lost), 4, WATCHDOG_LATER, "slider-crank", NULL, 0, "ida+ggl", 1e-2, 4 },
  { WATCHDOG_LIMIT (lost_unstabilised), 0.5, WATCHDOG_EARLIER, "pendulum", NULL, 0, "ida+none", 1e-3, 100 },
  { WATCHDOG_LIMIT (redundant_ratio), 0, WATCHDOG_EARLIER, "redundant-parallelogram", NULL, 0, "adams+none", 1e-4, 2 },
  { WATCHDOG_LIMIT (redundant_residual), 0, WATCHDOG_EARLIER, "redundant-parallelogram", NULL, 0, "rk4+projection",
    1e-2, 2 },
  { WATCHDOG_LIMIT (near), 2, WATCHDOG_MORE, "n-four-bar", NULL, 0, "rk4+projection", 1e-3, 2 },
  { WATCHDOG_LIMIT (step_growth), 0, WATCHDOG_FEWER, "n-four-bar", NULL, 0, "rk4+projection", 1e-2, 2 },
  { WATCHDOG_LIMIT (agree_best), 1e5, WATCHDOG_FEWER, "n-four-bar", NULL, 0, "rk4+projection", 1e-3, 4 },
  { WATCHDOG_LIMIT (agree), 1e-6, WATCHDOG_EARLIER, "n-four-bar", NULL, 0, "rk4+projection", 1e-3, 4 },
  { WATCHDOG_LIMIT (ends_singular), 0, WATCHDOG_EARLIER, "n-four-bar", NULL, 0, "rk4+projection", 7.842e-4, 4 },
  { WATCHDOG_LIMIT (regular), 0, WATCHDOG_LATER, "n-four-bar", "N", 1, "erk8+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (turn_growth), 4, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (turn_reference), 1e4, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (drift_turn), 1e3, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (drift_near), 1e3, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (drift_far), 0.5, WATCHDOG_EARLIER, "n-four-bar", "N", 1, "adams+none", 1e-3, 4 },
  { WATCHDOG_LIMIT (drift_any), 0.5, WATCHDOG_EARLIER, "n-four-bar", "N", 1, "adams+none", 1e-3, 4 },
  { WATCHDOG_LIMIT (lipschitz), 0, WATCHDOG_LATER, "slider-crank", "l2", 1.00001, "bdf+projection", 1e-5, 4 },
  { WATCHDOG_LIMIT (low), 0, WATCHDOG_LATER, "slider-crank", "l2", 1.00001, "bdf+projection", 1e-5, 4 },
  { WATCHDOG_LIMIT (unresolved), 8, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "ida+ggl", 1e-4, 4 },
  { WATCHDOG_LIMIT (stride), 30, WATCHDOG_LATER, "slider-crank", "l2", 1.00001, "bdf+projection", 1e-5, 4 },
  { WATCHDOG_LIMIT (floor), 100, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "bdf+projection", 1e-4, 4 },
  { WATCHDOG_LIMIT (progress), 20, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "rk4+projection", 1e-2, 4 },
  { WATCHDOG_LIMIT (crossing), 0, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "leapfrog", 1e-2, 4 },
  { WATCHDOG_LIMIT (straight), 2.1, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "rk4+projection", 1e-2, 4 },
  { WATCHDOG_LIMIT (resolved), 8, WATCHDOG_LATER, "slider-crank", "l2", 1.001, "leapfrog", 1e-2, 4 },
};

/* The time at which a run stops, and its rejected steps, with one threshold multiplied by the factor. */
static void watchdog_measure (int i, double factor, double *t, long *rejected) {
  pw_error error = { 0 };
  pw_system *s = scene_named (watchdog_limit[i].model, watchdog_limit[i].parameter, watchdog_limit[i].value);
  pw_run *r = runs_open (s, watchdog_limit[i].method,
                         &(pw_settings){ .rtol = watchdog_limit[i].tolerance,
                                         .step = watchdog_limit[i].tolerance,
                                         .span = watchdog_limit[i].t });
  *(double *)(void *)((char *)&r->thresholds + watchdog_limit[i].at) *= factor;
  pw_run_advance_to (r, watchdog_limit[i].t, watchdog_limit[i].t, &error);
  *t = pw_run_time (r);
  *rejected = pw_run_statistics (r)->rejected;
  print_message ("%s times %g: t = %g, %ld rejected: %s\n", watchdog_limit[i].name, factor, *t, *rejected, error.text);
  runs_close (r, s);
}

TEST (limits) {
  int bad = 0;
  for (size_t i = 0; i < sizeof watchdog_limit / sizeof *watchdog_limit; i++) {
    double t[2];
    long rejected[2];
    watchdog_measure ((int)i, 1, &t[0], &rejected[0]);
    watchdog_measure ((int)i, watchdog_limit[i].factor, &t[1], &rejected[1]);
    int good[] = { t[1]<t[0], t[1]> t[0], rejected[1]<rejected[0], rejected[1]> rejected[0] }; /* by effect */
    if (!good[watchdog_limit[i].effect]) print_error ("%s has no effect\n", watchdog_limit[i].name), bad++;
  }
  assert_int_equal (bad, 0);
}

/* A step that has failed fails again. */
TEST (again) {
  pw_error first = { 0 }, second = { 0 };
  pw_system *s = scene_named ("n-four-bar", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 4 });
  r->thresholds.agree *= 1e-6;
  assert_int_equal (pw_run_advance_to (r, 4, 4, &first), PW_METHOD);
  assert_int_equal (pw_run_advance (r, 4, &second), PW_METHOD);
  check_error (&second, PW_METHOD, first.text);
  runs_close (r, s);
}

/* ---- Thresholds that such runs do not reveal ---- */

/* Sets the state of r to a rhombus of bars of 1 m at this angle, in motion. */
static void watchdog_bend (pw_run *r, double angle) {
  double c = cos (angle), n = sin (angle);
  const double q[] = { 0.5 * c, 0.5 * n, angle, 0.5 + c, n, 0, 1 + 0.5 * c, 0.5 * n, angle };
  const double v[] = { -0.5 * n, 0.5 * c, 1, -n, c, 0, -0.5 * n, 0.5 * c, 1 };
  memcpy (r->q, q, sizeof q);
  memcpy (r->v, v, sizeof v);
  r->watchdog.singular_ahead = 1;
}

/* The state reached is examined, not that at which the run's matrix was factorised last. */
TEST (near_state) {
  static const char *const method[] = { "rk4+projection", "erk5+projection" };
  for (int i = 0; i < 2; i++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&bars_table, NULL);
    pw_run *r = runs_open (s, method[i], NULL);
    watchdog_bend (r, 1e-4);
    assert_int_equal (pw_watchdog_near_state (r), 1);
    pw_fail_singular (r, 0, &error);
    assert_non_null (strstr (error.text, "near a singular configuration: pin "));
    watchdog_bend (r, 1);
    assert_int_equal (pw_watchdog_near_state (r), 0);
    runs_close (r, s);
  }
}

/* A tree of joints has no singular configuration: the sine is 1, without a row. */
TEST (tree) {
  int row = 7;
  pw_system *s = scene_named ("pendulum", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_null (r->watchdog.saddle);
  check_close ("sine", pw_watchdog_sine (r, &row), 1, 0, "never singular");
  assert_int_equal (row, -1);
  runs_close (r, s);
}

/* Residual |J a - gamma| of accelerations evaluated at this angle. */
static double watchdog_residual (pw_run *r, double angle) {
  double gamma[8], Ja[8], most = 0;
  watchdog_bend (r, angle);
  assert_int_equal (pw_run_accelerate (r, 0, r->q, r->v, r->a, r->lambda), PW_OK);
  pw_evaluate_gamma (r->w, gamma);
  pw_mul_J (r->w, r->a, Ja);
  for (int i = 0; i < r->s->rows; i++) most = fmax (most, fabs (Ja[i] - gamma[i]));
  return most;
}

/* Residual |J v| of arbitrary velocities after projection at this angle. */
static double watchdog_projected (pw_run *r, double angle) {
  pw_projector p;
  pw_error error = { 0 };
  double v[9], Jv[8], most = 0;
  check_ok (pw_projector_open (&p, r, NULL, NULL, &error), &error);
  watchdog_bend (r, angle);
  for (int j = 0; j < 9; j++) v[j] = sin (1 + j);
  assert_int_equal (pw_update_kinematics (r->w, 0, r->q, v), PW_OK);
  pw_evaluate_J (r->w);
  assert_int_equal (pw_project_velocities (&p, r, v), PW_OK);
  pw_mul_J (r->w, v, Jv);
  for (int i = 0; i < r->s->rows; i++) most = fmax (most, fabs (Jv[i]));
  pw_projector_close (&p);
  return most;
}

TEST (evaluations) {
  pw_system *s = scene_system (&bars_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  const double angle = 1e-4;
  double refined = watchdog_residual (r, angle), sine = r->watchdog.evaluated_sine,
         projected = watchdog_projected (r, angle);
  r->thresholds.refine = 0;
  check_below ("projected", projected, 0.1 * watchdog_projected (r, angle), "eps / s instead of eps / s^2");
  check_below ("refined", refined, 0.1 * watchdog_residual (r, angle), "eps / s instead of eps / s^2");
  r->refused_sine = 2 * sine;
  watchdog_bend (r, angle);
  assert_int_equal (pw_run_accelerate (r, 0, r->q, r->v, r->a, r->lambda), PW_RETRY);
  r->refused_sine = 0.5 * sine;
  assert_int_equal (pw_run_accelerate (r, 0, r->q, r->v, r->a, r->lambda), PW_OK);
  assert_true (r->thresholds.rank_lost == pw_watchdog_thresholds.rank_lost);
  runs_close (r, s);
}

TEST (jump) {
  pw_system *s = scene_named ("chaplygin-sleigh", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  pw_error error = { 0 };
  r->near_singular = 1;
  r->a[0] =
      1.5 * r->thresholds.jump_growth * r->reference_level * s->scale.length / (r->w->scale.time * r->w->scale.time);
  assert_int_equal (pw_run_watchdog (r, &error), PW_METHOD);
  assert_non_null (strstr (error.text, "lost at a singular configuration: the accelerations are 150 times"));
  r->thresholds.jump_growth *= 2;
  error = (pw_error){ 0 };
  r->near_singular = 1;
  check_ok (pw_run_watchdog (r, &error), &error);
  runs_close (r, s);
}

/* A redundant row whose residual is the largest does not contradict the others if theirs are of the same size. */
TEST (drift) {
  pw_error error = { 0 };
  char row[120];
  pw_system *s = scene_named ("redundant-parallelogram", NULL, 0);
  pw_run *r = runs_open (s, "rk4+none", NULL);
  int n;
  pw_system_row_name (s, r->redundant_row[0], row, sizeof row);
  assert_int_equal (sscanf (row, "pin B%d", &n), 1);
  r->q[3 * n] += 0.15, r->q[3 * n + 1] += 0.15; /* the crank, */
  r->q[0] -= 0.3, r->q[1] -= 0.3;               /* and the coupler */
  assert_int_equal (pw_evaluate_J_at (r->w, r->t, r->q, r->v), PW_OK);
  pw_forget_residuals (r);
  assert_int_equal (pw_run_watchdog (r, &error), PW_METHOD);
  assert_non_null (strstr (error.text, "constraint drift: pin B"));
  runs_close (r, s);
}

TEST (masses) {
  pw_error error = { 0 };
  pw_system *s = scene_named ("n-four-bar", "m", 0.7 * pw_watchdog_thresholds.extreme);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_int_equal (pw_watchdog_check_values (r, &error), PW_OK);
  r->thresholds.extreme /= 2;
  assert_int_equal (pw_watchdog_check_values (r, &error), PW_INPUT);
  runs_close (r, s);
}

/* The acceleration norm is in units of the scene: independent of the torque on a disc. */
static void watchdog_build_disc (pw_model *m, const void *parameter) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add_pin (m, &(pw_pin){ .name = "hub", .body = { "disc", "ground" } });
  pw_add_torque (m, &(pw_torque){ .name = "motor",
                                  .body = { "disc", "ground" },
                                  .value = { .constant = *(const double *)parameter } });
}

TEST (acceleration_norm) {
  static const pw_parameter list[] = { { .name = "torque", .value = 1 }, { .name = NULL } };
  static const pw_plugin_table table = SCENE_TABLE_WITH (watchdog_build_disc, list, sizeof (double));
  for (int k = 0; k <= 6; k += 2) {
    pw_system *s = scene_system (&table, "torque", pow (10, k), NULL);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    check_close ("acceleration norm", pw_run_acceleration_norm (r), 1, 16 * CHECK_EPS, "round-off");
    runs_close (r, s);
  }
}
