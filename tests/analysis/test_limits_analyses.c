/* Analyses and restarts of scenes whose reactions have limits: linearisation, steady and periodic motions, derivatives
 * of runs through events. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "periodic_case.h"
#include "runs.h"
#include "scene.h"

/* ---- Linearisation and steady motions ---- */

typedef struct {
  double F, v0, limit;
} limits_block;

static const pw_parameter limits_parameters[] = { { PW_AT (limits_block, F), 2, "N", "", PW_REAL },
                                                  { PW_AT (limits_block, v0), 1, "m/s", "", PW_REAL },
                                                  { PW_AT (limits_block, limit), 0.5, "N", "", PW_POSITIVE },
                                                  { .name = NULL } };

/* A block with drag 3 N s/m and a force, on rough ground. */
SCENE_WITH (limits_build, limits_parameters, limits_block) {
  pw_add_body (m, &(pw_body){ .name = "block", .mass = 2, .inertia = 1, .rate = { p->v0 } });
  pw_add_slider (m, &(pw_slider){ .name = "S", .body = { "block", "ground" } });
  pw_add_sliding_friction (
      m, &(pw_sliding_friction){ .name = "R", .body = { "block", "ground" }, .limit = { .constant = p->limit } });
  pw_add_drag (m, &(pw_drag){ .name = "D", .body = "block", .linear = 3 });
  pw_add_force (m, &(pw_force){ .name = "F", .body = "block", .fx = { PW_CONSTANT, .constant = p->F } });
}

static pw_system *limits_scene (double F, double v0) {
  return scene_system (&limits_build_table, "F", F, "v0", v0, NULL);
}

/* Sliding at (F - limit)/3 m/s, where perturbations decay at 3/2 1/s; at rest friction holds: no velocity is free. */
TEST (linearise) {
  pw_error error = { 0 };
  pw_linear l;
  for (int holds = 0; holds < 2; holds++) {
    pw_system *s = limits_scene (holds ? 0.2 : 2, holds ? 0 : 0.5);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    check_ok (pw_run_linearise (r, 10, &l, &error), &error);
    assert_int_equal (l.steady, PW_STEADY);
    assert_int_equal (l.velocities, holds ? 0 : 1);
    if (!holds) check_close ("eigenvalue", l.re[1], -1.5, 1e-14, "round-off");
    pw_linear_free (&l);
    runs_close (r, s);
  }
}

static void limits_refused (double F, double v0, const char *message) {
  pw_error error = { 0 };
  pw_linear l;
  pw_system *s = limits_scene (F, v0);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_int_equal (pw_run_linearise (r, 10, &l, &error), PW_METHOD);
  check_error (&error, PW_METHOD, message);
  runs_close (r, s);
}

TEST (boundaries) {
  limits_refused (0.5, 0, "t = 0 s: sliding-friction R is at a limit of its reaction: -0.5, limit -0.5");
  limits_refused (2, 1e-8, "t = 0 s: sliding-friction R begins or ceases to hold: its velocity is 1e-08");
}

/* Limits that are not reached change nothing. */
TEST (far_from_limits) {
  pw_error error = { 0 };
  pw_linear l[2];
  for (int i = 0; i < 2; i++) {
    pw_system *s = runs_scene (i ? "ride-on" : "../ezyroller", i ? "" : "m2=0.1 I2=0.01");
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    (void)runs_to (r, 1);
    check_ok (pw_run_linearise (r, 10, &l[i], &error), &error);
    runs_close (r, s);
  }
  assert_int_equal (l[0].unknowns, l[1].unknowns);
  check_bits ("A", l[0].A, l[1].A, l[0].unknowns * l[0].unknowns);
  pw_linear_free (&l[0]);
  pw_linear_free (&l[1]);
}

/* The modes are those of the initial state; a motion that contradicts them is refused. */
TEST (steady) {
  for (int forwards = 0; forwards < 2; forwards++) {
    pw_error error = { 0 };
    pw_steady_motion m;
    pw_system *s = limits_scene (2, forwards ? 1 : -1);
    pw_steady *x = pw_steady_open (s, &(pw_steady_settings){ .vary = -1 }, &error);
    check_ok (error.status, &error);
    const int status = pw_steady_solve (x, 0, 0, &m, &error);
    if (forwards) {
      check_ok (status, &error);
      check_close ("speed", m.v[0], 0.5, 1e-12, "round-off");
      check_close ("eigenvalue", m.linear->re[1], -1.5, 1e-12, "round-off");
    } else
      check_error (&error, PW_METHOD,
                   "t = 0 s: sliding-friction R is on the wrong side of its limit: its velocity is -0.833");
    pw_steady_close (x);
    pw_system_free (s);
  }
}

/* ---- Periodic motions ---- */

/* Stick and slip: in the frame of the moving end of the spring the block is that of tests/runs/events.txt, whose events
 * recur after 3.22025671717... s; while it holds, perturbations vanish. */
TEST (stick_slip) {
  const double k = 4, v0 = 0.3, Fs = 1.2, Fk = 0.8;
  /* slip from x = Fs/k at rest: x'' = -k (x - Fk/k) in the moving frame, until the velocity is -v0 again */
  const double w = sqrt (k), slip = 2 / w * (PW_PI - atan ((Fs - Fk) / (v0 * w))), stick = 2 * (Fs - Fk) / k / v0;
  pw_system *s = runs_scene ("drag", "");
  pw_periodic *x = periodic_open (s, &(pw_periodic_settings){ .free = 1 });
  pw_periodic_orbit o = periodic_solve (x, 10, 0);
  check_close ("period", o.period, slip + stick, 1e-9, "errors of events, 1e-11, in Newton's method");
  check_close ("displacement", o.end[3] - o.q[3], v0 * o.period, 1e-9, "the same");
  for (int i = 0; i < o.multipliers - o.trivial; i++)
    check_below ("multiplier", hypot (o.re[i], o.im[i]), 1e-8, "0, by differences through events");
  pw_periodic_close (x);
  pw_system_free (s);
}

/* An oscillator x'' = -x + cos (w t) that hits its stop x = 0 once in each period T: between impacts
 *
 *     x = a cos s + b sin s + X cos (w t),  s = t - t0,  X = 1 / (1 - w^2),
 *
 * x = 0 at both ends and the velocities b - X w sin (w t0) after, -b - X w sin (w t0) before an impact give
 *
 *     a = -X cos (w t0),  b = a tan (T/2),  tan (w t0) = -tan (T/2) (1 - e) / (w (1 + e)).
 *
 * In a period areas of states contract by e^2. */
TEST (hammer) {
  const double w = 2.6, T = 2 * PW_PI / w, X = 1 / (1 - w * w), kappa = tan (T / 2);
  for (double e = 0.5; e < 0.75; e += 0.1) {
    const double t0 = (2 * PW_PI - atan (kappa * (1 - e) / (w * (1 + e)))) / w, a = -X * cos (w * t0), b = a * kappa;
    const double s = T - t0; /* from the impact before t = 0 */
    pw_system *system = runs_scene ("hammer", check_text ("bounce=%g", e));
    pw_periodic *x = periodic_open (system, &(pw_periodic_settings){ .period = 0 });
    pw_periodic_orbit o = periodic_solve (x, 0, 0);
    check_close ("period", o.period, T, 1e-14, "that of the force");
    check_close ("x", o.q[0], a * cos (s) + b * sin (s) + X, 1e-9, "errors of events, 1e-11, in Newton's method");
    check_close ("vx", o.v[0], -a * sin (s) + b * cos (s), 1e-9, "the same");
    assert_int_equal (o.multipliers - o.trivial, 2);
    check_close ("product of multipliers", o.re[0] * o.re[1] + o.im[0] * o.im[0] * (o.im[0] != 0), e * e, 1e-7,
                 "by differences through events");
    pw_periodic_close (x);
    pw_system_free (system);
  }
}

/* ---- Derivatives through events, within the errors that are stated ---- */

static void limits_derivatives (const char *arguments, const double *expected, int count) {
  double value[CLI_MOST], error[CLI_MOST];
  cli_good (check_text ("pinwheel sensitivity tests/models/events/%s --json @/sens/sensitivity.json --plots @/sens",
                        arguments));
  assert_int_equal (cli_sensitivity ("derivative", value), count);
  assert_int_equal (cli_sensitivity ("error", error), count);
  for (int i = 0; i < count; i++) {
    check_below (check_text ("%s: error of derivative %d", arguments, i), fabs (value[i] - expected[i]), error[i],
                 "the stated error");
    check_below (check_text ("%s: stated error %d", arguments, i), error[i], 1e-6 * fabs (expected[i]) + 1e-9,
                 "events to 1e-12, steps of 1e-4 and less");
  }
}

/* The block turns six times and stops at x0 - 14 lim / k; it loses k (x0^2 - x^2) / 2. */
TEST (derivatives_of_a_block) {
  static const double expected[] = { 1.4, -0.098, -1, 0.28, 0.4802, 9.8 };
  limits_derivatives ("block.yaml -t 8 --of block.x --of rub.loss --by lim --by k --by x0", expected, 6);
}

/* The ball's height after six bounces at t1 (1 + 2 e + ... + 2 e^5). */
TEST (derivatives_of_a_ball) {
  const double e = 0.8, g = 9.81, t1 = sqrt (2 / g);
  double tn = t1, dtn = 0;
  for (int j = 1; j < 6; j++) tn += 2 * t1 * pow (e, j), dtn += 2 * t1 * j * pow (e, j - 1);
  const double s = 3 - tn, v = pow (e, 6) * g * t1, derivative = 6 * v / e * s - (v - g * s) * dtn;
  limits_derivatives ("ball.yaml -t 3 --of ball.y --by bounce", &derivative, 1);
}

/* The columns of a run at its end. */
static double limits_value (const char *scene, const char *column, const char *parameter, double value, double t) {
  pw_error error = { 0 };
  pw_column c;
  double out;
  pw_system *s = runs_scene (scene, check_text ("%s=%.17g", parameter, value));
  pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 1e-13, .span = t });
  pw_sample x = runs_to (r, t);
  pw_workspace *w = pw_workspace_new (s, &error);
  check_ok (pw_system_find_column (s, column, &c, &error), &error);
  check_ok (pw_workspace_columns (w, &x, &c, 1, &out, &error), &error);
  pw_workspace_free (w);
  runs_close (r, s);
  return out;
}

/* Others against differences of order 4 of runs to 1e-13, with steps much smaller than those of the command. */
TEST (derivatives_of_others) {
  static const struct {
    const char *scene, *column, *parameter;
    double value, t;
  } of[] = { { "pendulum", "bob.phi", "bounce", 0.6, 5 }, { "tether", "disc.x", "I", 0.05, 5 },
             { "sleigh", "frame.y", "grip", 0.3, 10 },    { "clutch", "one.omega", "lim", 2, 15 },
             { "belt", "block.x", "Fk", 0.8, 20 },        { "wall", "upper.phi", "bounce", 0.5, 2 },
             { "ride-on", "frame.phi", "gA", 0.03, 5 } };
  for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
    const double h = 3e-5 * of[i].value;
    double value[4], derivative, error;
    for (int k = 0; k < 4; k++)
      value[k] =
          limits_value (of[i].scene, of[i].column, of[i].parameter, of[i].value + (k < 2 ? k - 2 : k - 1) * h, of[i].t);
    const double expected = (8 * (value[2] - value[1]) - (value[3] - value[0])) / (12 * h);
    cli_good (check_text ("pinwheel sensitivity tests/models/events/%s.yaml -t %g --of %s --set %s=%.17g --by %s "
                          "--json @/sens/sensitivity.json --plots @/sens",
                          of[i].scene, of[i].t, of[i].column, of[i].parameter, of[i].value, of[i].parameter));
    assert_int_equal (cli_sensitivity ("derivative", &derivative), 1);
    assert_int_equal (cli_sensitivity ("error", &error), 1);
    check_below (check_text ("%s by %s", of[i].scene, of[i].parameter), fabs (derivative - expected), error + 4e-12 / h,
                 "the stated error, and errors of runs over the step of the difference");
    check_below (of[i].scene, error, 1e-5 * fabs (expected) + 1e-7, "events to 1e-12, steps of 1e-4 and less");
  }
}

/* ---- Restarts ---- */

/* A restart from the state reached changes nothing but the rounding; a run continues from another state, where modes
 * are decided, and a refused restart leaves it where it was. */
TEST (restarts) {
  static const char *const method[] = { "erk8+projection", "rk4+projection", "radau+ggl", "bdf+projection" };
  for (int i = 0; i < 4; i++)
    for (double t = 0.2; t < 1.5; t += 0.31) {
      pw_error error = { 0 };
      const pw_settings set = { .step = 1e-3, .rtol = 1e-10, .span = 2 };
      pw_system *s = runs_scene ("ride-on", "gA=0.008 gC=0.2");
      pw_run *r = runs_open (s, method[i], &set), *other = runs_open (s, method[i], &set);
      (void)runs_to (r, t);
      (void)runs_to (other, t);
      check_ok (pw_run_restart (r, NULL, NULL, &error), &error);
      pw_sample now = runs_to (r, 2), expected = runs_to (other, 2);
      for (int j = 0; j < 6; j++) {
        check_close (method[i], now.q[j], expected.q[j], 1e-6, "1e4 rtol");
        check_close (method[i], now.v[j], expected.v[j], 1e-6, "1e4 rtol");
      }
      check_close ("balance", now.balance, 0, 1e-6, "the ledger continues");
      pw_run_close (other);
      runs_close (r, s);
    }
}

TEST (restart_elsewhere) {
  static const char *const method[] = { "erk8+projection", "ida+ggl", "moreau" };
  for (int i = 0; i < 3; i++) {
    pw_error error = { 0 };
    pw_system *s = limits_scene (2, 1);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 3, .ledger = 1 });
    (void)runs_to (r, 1);
    double q[3] = { NAN, 0, 0 }, v[3] = { -1, 0, 0 };
    assert_int_equal (pw_run_restart (r, q, v, &error), PW_INPUT);
    error = (pw_error){ 0 };
    pw_sample x = runs_to (r, 1.5);
    const double bound = i == 2 ? 1e-6 : 1e-8;
    check_close (method[i], x.v[0], 0.5 + 0.5 * exp (-1.5 * 1.5), bound, "errors of the method, h^2 of moreau");
    check_ok (pw_run_restart (r, NULL, v, &error), &error);
    /* v' = (2.5 - 3 v)/2 from -1 to 0, then (1.5 - 3 v)/2 */
    const double stops = log ((5. / 6 + 1) / (5. / 6)) / 1.5;
    x = runs_to (r, 3);
    check_close (method[i], x.v[0], 0.5 - 0.5 * exp (-1.5 * (1.5 - stops)), i == 2 ? 1e-3 : 1e-8,
                 "errors of the method; of moreau at an event, h");
    check_close ("balance", x.balance, 0, i == 2 ? 1e-5 : 1e-8, "the ledger continues");
    runs_close (r, s);
  }
}
const check_fixture fixture = { cli_setup, cli_teardown };
