/* Signals: their values and derivatives, what they read, when they are evaluated. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "system.h"
#include "toys.h"
#include "trial.h"

TEST (constant) {
  double u[3];
  pw_source source = { .signal = { .constant = 2.5 }, .u = u };
  assert_int_equal (pw_signal_eval (&source, 7), 0);
  assert_true (u[0] == 2.5 && u[1] == 0 && u[2] == 0);
  assert_true (isinf (pw_signal_breakpoint (&source.signal, 0, 0)));
}

TEST (harmonic) {
  double A = 1.7, w = 2.3, p = 0.4, c = -0.6, t = 1.1, u[3], only[3];
  pw_source source = { .signal = { PW_HARMONIC, .harmonic = { .amplitude = A, .omega = w, .phase = p, .offset = c } },
                       .u = u };
  assert_int_equal (pw_signal_eval (&source, t), 0);
  double bound = 8 * CHECK_EPS * (A * w * w + fabs (c));
  check_close ("value", u[0], c + A * cos (w * t + p), bound, "round-off: 8 eps of the largest term");
  check_close ("rate", u[1], -A * w * sin (w * t + p), bound, "round-off: 8 eps of the largest term");
  check_close ("acceleration", u[2], -A * w * w * cos (w * t + p), bound, "round-off: 8 eps of the largest term");
  source.u = only, source.of_force = 1;
  assert_int_equal (pw_signal_eval (&source, t), 0);
  assert_true (only[0] == u[0] && only[1] == 0 && only[2] == 0);
}

/* ---- A function that reads states ---- */

typedef struct {
  int calls, fails;
  double t, x[2], breakpoint;
} signals_context;

/* u = t + 2 phi + 3 vx */
static int signals_eval (void *context, double t, const double *x, double value[3], double *gradient) {
  signals_context *c = context;
  c->calls++;
  c->t = t;
  memcpy (c->x, x, sizeof c->x);
  value[0] = t + 2 * x[0] + 3 * x[1];
  if (gradient) gradient[0] = 2, gradient[1] = 3;
  return c->fails;
}

/* The same without states. */
static int signals_of_time (void *context, double t, const double *x, double value[3], double *gradient) {
  signals_context *c = context;
  (void)x, (void)gradient;
  c->calls++;
  value[0] = t * t, value[1] = 2 * t, value[2] = 2;
  return c->fails;
}

static double signals_breakpoint (void *context, double t) {
  const signals_context *c = context;
  return t < c->breakpoint ? c->breakpoint : INFINITY;
}

/* The EzyRoller with another torque. */
static pw_system *signals_scene (const pw_signal *torque) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", torque, &error), &error);
  return scene_compile (m);
}

TEST (reads) {
  static const char *const reads[] = { "steer.phi", "frame.vx", NULL };
  signals_context c = { .breakpoint = 3 };
  pw_signal torque = {
    PW_FUNCTION, .function = { .eval = signals_eval, .context = &c, .reads = reads, .breakpoint = signals_breakpoint }
  };
  pw_system *s = signals_scene (&torque);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double q[6] = { 0, 0, 0.3, 0, 0, 0.7 }, v[6] = { 1.1, 0, 0, 0, 0, 0.9 }, f[9];
  assert_int_equal (pw_update_kinematics (w, 2, q, v), PW_OK);
  assert_true (c.calls == 1 && c.t == 2 && c.x[0] == 0.7 && c.x[1] == 1.1);
  pw_evaluate_force (w, f);
  assert_true (f[2] == 2 + 2 * 0.7 + 3 * 1.1 && f[5] == -f[2] && f[0] == 0);
  q[5] = 0.8;
  assert_int_equal (pw_update_kinematics (w, 2, q, v), PW_OK);
  assert_true (c.calls == 2 && c.x[0] == 0.8); /* another state at the same time */
  v[0] = 1.3, q[5] = 0.9;
  assert_int_equal (pw_update_velocities (w, v), PW_OK);
  assert_true (c.calls == 3 && c.t == 2 && c.x[0] == 0.8 && c.x[1] == 1.3); /* other velocities there */
  pw_evaluate_force (w, f);
  assert_true (f[2] == 2 + 2 * 0.8 + 3 * 1.3);
  c.fails = 1;
  assert_int_equal (pw_update_velocities (w, v), PW_METHOD);
  c.fails = 0;
  assert_true (pw_next_breakpoint (w, 0, 0) == 3 && isinf (pw_next_breakpoint (w, 0, 3)));
  c.fails = 1;
  assert_int_equal (pw_update_kinematics (w, 2.5, q, v), PW_METHOD);
  pw_error error = { 0 };
  assert_int_equal (pw_workspace_contact_points (w, 2.5, q, v, NULL, &error), PW_METHOD);
  check_error (&error, PW_METHOD,
               "t = 2.5 s: a signal failed: torque rider: value is not a finite number, or its function failed");
  pw_workspace_free (w);
  pw_system_free (s);
}

static int signals_of_angle (void *context, double t, const double *x, double value[3], double *gradient) {
  signals_context *c = context;
  (void)t, (void)gradient;
  c->calls++;
  value[0] = x[0];
  return 0;
}

/* New velocities do not evaluate signals that read none, or held ones. */
TEST (velocities) {
  static const char *const reads[][2] = { { "steer.phi", NULL }, { "steer.omega", NULL } };
  for (int velocity = 0; velocity < 2; velocity++) {
    signals_context c = { 0 };
    pw_signal torque = { PW_FUNCTION,
                         .function = { .eval = signals_of_angle, .context = &c, .reads = reads[velocity] } };
    pw_system *s = signals_scene (&torque);
    pw_workspace *w = pw_workspace_new (s, NULL);
    double q[6] = { 0 }, v[6] = { 0 };
    assert_int_equal (pw_update_kinematics (w, 2, q, v), PW_OK);
    assert_int_equal (pw_update_velocities (w, v), PW_OK);
    assert_int_equal (c.calls, 1 + velocity);
    pw_hold_signals (w, 1);
    assert_int_equal (pw_update_kinematics (w, 3, q, v), PW_OK);
    assert_int_equal (pw_update_velocities (w, v), PW_OK);
    assert_int_equal (c.calls, 1 + velocity);
    pw_workspace_free (w);
    pw_system_free (s);
  }
}

static signals_context signals_driven;

/* A signal of time alone is evaluated once for stages at the same time; a held one is not evaluated. */
TEST (sharing_and_hold) {
  signals_context c = { 0 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = signals_of_time, .context = &c } };
  pw_system *s = signals_scene (&torque);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double q[6] = { 0 }, v[6] = { 0 }, f[9];
  pw_update_kinematics (w, 2, q, v);
  pw_update_kinematics (w, 2, q, v);
  assert_int_equal (c.calls, 1);
  pw_hold_signals (w, 1);
  pw_update_kinematics (w, 3, q, v);
  pw_evaluate_force (w, f);
  assert_true (c.calls == 1 && f[2] == 4);
  pw_hold_signals (w, 0);
  pw_update_kinematics (w, 3, q, v);
  pw_evaluate_force (w, f);
  assert_true (c.calls == 2 && f[2] == 9);
  c.fails = 1;
  assert_int_equal (pw_update_kinematics (w, 4, q, v), PW_METHOD);
  c.fails = 0;
  assert_int_equal (pw_update_kinematics (w, 3, q, v), PW_OK); /* after a failure the signal is evaluated again */
  pw_evaluate_force (w, f);
  assert_true (f[2] == 9);
  pw_workspace_free (w);
  pw_system_free (s);
}

SCENE (signals_of_both) {
  static const char *const omega[] = { "disc.omega", NULL };
  static signals_context speed;
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add_torque (
      m, &(pw_torque){ .name = "A",
                       .body = { "disc", "ground" },
                       .value = { PW_FUNCTION, .function = { .eval = signals_of_time, .context = &signals_driven } } });
  pw_add_torque (
      m, &(pw_torque){
             .name = "B",
             .body = { "disc", "ground" },
             .value = { PW_FUNCTION, .function = { .eval = signals_of_angle, .context = &speed, .reads = omega } } });
}

/* New velocities do not evaluate signals of time alone, even if no time has been stored. */
TEST (velocities_without_time) {
  signals_driven = (signals_context){ 0 };
  pw_system *s = scene_system (&signals_of_both_table, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double q[3] = { 0 }, v[3] = { 0 };
  assert_int_equal (pw_update_kinematics (w, 2, q, v), PW_OK);
  pw_hold_signals (w, 0);
  assert_int_equal (pw_update_velocities (w, v), PW_OK);
  assert_int_equal (signals_driven.calls, 1);
  assert_int_equal (pw_update_kinematics (w, 2, q, v), PW_OK);
  assert_int_equal (signals_driven.calls, 2);
  pw_workspace_free (w);
  pw_system_free (s);
}

/* Jumps are found up to the round-off of sums of steps, also at the time 0; ramps of forces do not jump. */
TEST (jumps) {
  for (double start = -2; start <= 2; start += 2) {
    pw_signal torque = { PW_PULSE, .pulse = { .height = 1, .start = start } };
    pw_system *s = signals_scene (&torque);
    assert_true (pw_system_jumps (s, start) && pw_system_jumps (s, start + 1e-16) &&
                 pw_system_jumps (s, start - 1e-16));
    assert_true (!pw_system_jumps (s, start + 1e-9) && !pw_system_jumps (s, start - 1e-9));
    pw_system_free (s);
  }
  pw_system *s = signals_scene (&(pw_signal){ PW_RAMP, .ramp = { .to = 1, .start = 1, .duration = 1 } });
  assert_false (pw_system_jumps (s, 1));
  pw_system_free (s);
}

/* ---- A constraint, which needs the derivatives of its signal ---- */

SCENE (signals_build) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add (
      m, &toy_kind_drive,
      &(toy_drive){ .name = "motor",
                    .body = { "disc", "ground" },
                    .angle = { PW_FUNCTION, .function = { .eval = signals_of_time, .context = &signals_driven } } });
}

TEST (drive) {
  signals_driven = (signals_context){ 0 };
  pw_system *s = scene_system (&signals_build_table, NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  double q[3] = { 0, 0, 10 }, v[3] = { 0 }, y;
  pw_update_kinematics (w, 3, q, v);
  pw_evaluate_g (w, &y);
  assert_true (y == 10 - 9);
  pw_evaluate_eta (w, &y);
  assert_true (y == 6);
  pw_evaluate_gamma (w, &y);
  assert_true (y == 2);
  pw_hold_signals (w, 1); /* holds forces only */
  pw_update_kinematics (w, 4, q, v);
  pw_evaluate_g (w, &y);
  assert_true (y == 10 - 16);
  pw_workspace_free (w);
  pw_system_free (s);
}
