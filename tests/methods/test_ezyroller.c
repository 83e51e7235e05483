/* The EzyRoller, compared with published digits, closed forms, and a second formulation.
 *
 * Run from the top directory: the digits are in tests/reference/. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

enum { EZY_LINES = 4, EZY_COLUMNS = 6 };

/* The EzyRoller's torque for default parameters [N m]. */
static double ezy_torque (double t) {
  return 0.1 * cos (PW_PI * t);
}

/* The four states of the table, and the position of the other body, which follows from them. */
static void ezy_compare (const pw_sample *s, const double *line, double bound, const char *reason) {
  const double *x = line + 1;
  double steer[2] = { x[0] + 0.5 * cos (x[2]) + 0.125 * cos (x[3]), x[1] + 0.5 * sin (x[2]) + 0.125 * sin (x[3]) };
  const double reference[6] = { x[0], x[1], x[2], steer[0], steer[1], x[3] };
  for (int j = 0; j < 6; j++) {
    check_close (check_text ("coordinate %d at t = %g s", j, line[0]), s->q[j], reference[j], bound, reason);
  }
}

/* ---- Published digits, by each method ---- */

typedef struct {
  double state, energy, g, jv;
  const char *reason;
} ezy_bounds;

static void ezy_digits (const char *method, const pw_settings *settings, const ezy_bounds *bound) {
  double table[EZY_LINES * EZY_COLUMNS];
  assert_int_equal (runs_reference ("tests/reference/ezyroller.txt", EZY_LINES, EZY_COLUMNS, table), EZY_LINES);
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_run *r = runs_open (s, method, settings);
  for (int i = 0; i < EZY_LINES; i++) {
    const double *line = table + i * EZY_COLUMNS;
    pw_sample now = runs_to (r, line[0]);
    ezy_compare (&now, line, bound->state, bound->reason);
    check_close ("kinetic energy", now.kinetic, line[5], bound->state, bound->reason);
    check_close ("work", now.work, now.kinetic, bound->energy, "work of the torque = kinetic energy");
    check_close ("balance", now.balance, 0, bound->energy, "the same");
    assert_true (now.potential == 0 && now.loss == 0);
  }
  const pw_statistics *cost = pw_run_statistics (r);
  check_below ("worst |g| of the run", cost->g, bound->g, bound->reason);
  check_below ("worst |J v - eta| of the run", cost->jv, bound->jv, bound->reason);
  pw_run_close (r);
  pw_system_free (s);
}

TEST (rk4_projection) {
  ezy_digits ("rk4+projection", &(pw_settings){ .step = 1e-3, .span = 10, .ledger = 1 },
              &(ezy_bounds){ 1e-11, 1e-12, 60 * CHECK_EPS, 60 * CHECK_EPS,
                             "(h omega)^4 / 10 at h = 1e-3; residuals: 10 eps of terms of 6 m" });
}

/* The longest run of the README's table. */
TEST (hundred_seconds) {
  double table[(EZY_LINES + 1) * EZY_COLUMNS];
  const double *line = table + EZY_LINES * EZY_COLUMNS;
  assert_int_equal (runs_reference ("tests/reference/ezyroller.txt", EZY_LINES + 1, EZY_COLUMNS, table), EZY_LINES + 1);
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_run *r = runs_open (s, "erk8+projection", &(pw_settings){ .rtol = 3e-14, .span = 100 });
  pw_sample end = runs_to (r, line[0]);
  ezy_compare (&end, line, 2e-11, "rtol 3e-14, 90 m from the start");
  pw_run_close (r);
  pw_system_free (s);
}

TEST (rk4_identity) {
  ezy_digits ("rk4+projection:metric=identity", &(pw_settings){ .step = 1e-3, .span = 10, .ledger = 1 },
              &(ezy_bounds){ 1e-10, 1e-11, 60 * CHECK_EPS, 60 * CHECK_EPS,
                             "(h omega)^4 at h = 1e-3; residuals: 10 eps of terms of 6 m" });
}

TEST (rk4_none) {
  ezy_digits ("rk4+none", &(pw_settings){ .step = 1e-3, .span = 10, .ledger = 1 },
              &(ezy_bounds){ 1e-10, 1e-10, 1e-10, 1e-10, "(h omega)^4 at h = 1e-3, drift as well" });
}

TEST (rk4_baumgarte) {
  ezy_digits ("rk4+baumgarte", &(pw_settings){ .step = 1e-3, .span = 10, .ledger = 1 },
              &(ezy_bounds){ 1e-10, 1e-10, 1e-10, 1e-10, "(h omega)^4 at h = 1e-3, drift as well" });
}

TEST (ida_ggl) {
  ezy_digits ("ida+ggl", &(pw_settings){ .rtol = 1e-10, .atol = 1e-10, .span = 10, .ledger = 1 },
              &(ezy_bounds){ 1e-6, 1e-6, 1e-10, 1e-9, "1e4 rtol; |g| <= rtol, |J v| <= 10 rtol" });
}

TEST (ida_baumgarte) {
  ezy_digits ("ida+baumgarte", &(pw_settings){ .rtol = 1e-10, .atol = 1e-10, .span = 10, .ledger = 1 },
              &(ezy_bounds){ 1e-6, 1e-6, 1e-8, 1e-8, "1e4 rtol; residuals: 100 rtol" });
}

TEST (ida_none) {
  ezy_digits ("ida+none", &(pw_settings){ .rtol = 1e-10, .atol = 1e-10, .span = 10, .ledger = 1 },
              &(ezy_bounds){ 1e-6, 1e-6, 1e-6, 1e-6, "1e4 rtol, drift as well" });
}

/* ---- Multipliers ---- */

/* Body 2 is massless, so its moments balance: the forces at wheel C and at the hinge are M / (c + d). */
static void ezy_multiplier (const char *method, double bound, const char *reason) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-8, .span = 2 });
  for (int i = 0; i <= 20; i++) {
    pw_sample now = runs_to (r, 0.1 * i);
    check_close ("wheel C", fabs (now.lambda[3]), fabs (ezy_torque (0.1 * i)) / 0.25, bound, reason);
    check_close ("hinge B", hypot (now.lambda[0], now.lambda[1]), fabs (now.lambda[3]), bound, "the same force");
  }
  pw_run_close (r);
  pw_system_free (s);
}

TEST (multiplier) {
  ezy_multiplier ("rk4+projection", 16 * CHECK_EPS, "round-off of one solve with forces of 1 N");
  ezy_multiplier ("ida+ggl", 1e-7, "10 rtol: multipliers are outside the error test");
  ezy_multiplier ("ida+baumgarte", 1e-7, "10 rtol: multipliers are outside the error test");
}

/* ---- Unpowered, massless steering: the frame runs straight, tan(delta/2) = tan(delta0/2) exp(u t/(c+d)) ---- */

static void ezy_straight (const char *method, double bound, const char *reason) {
  static const char *const given[] = { "frame.x",  "frame.y",     "frame.phi", "frame.vx",
                                       "frame.vy", "frame.omega", "steer.phi" };
  static const double value[] = { 0, 0, 0, 1, 0, 0, PW_PI / 2 };
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, "M0", 0.0, NULL);
  for (int i = 0; i < 7; i++) check_ok (pw_model_set_initial (m, given[i], value[i], &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 1, .ledger = 1 });
  assert_int_equal (pw_run_initial (r)->released, 0);
  pw_sample now = runs_to (r, 1);
  check_close ("phi2(1)", now.q[5], 3.104965471129630, bound, reason);
  check_close ("x1(1)", now.q[0], 1, bound, reason);
  check_close ("y1(1)", now.q[1], 0, bound, reason);
  check_close ("phi1(1)", now.q[2], 0, bound, reason);
  check_close ("u(1)", now.v[0], 1, bound, reason);
  check_close ("energy", now.kinetic, 0.5, bound, "conserved");
  pw_run_close (r);
  pw_system_free (s);
}

TEST (straight) {
  ezy_straight ("rk4+projection", 1e-11, "h^4 (u/(c+d))^5 / 120 at h = 1e-3 is 9e-12");
  ezy_straight ("rk4+none", 2e-11, "twice h^4 (u/(c+d))^5 / 120 at h = 1e-3");
  ezy_straight ("ida+ggl", 1e-6, "1e4 rtol");
}

/* ---- A second formulation: reduced equations of the massless steering, other data ----
 *
 * delta = phi2 - phi1, L = a + b, h = c + d, T the torque on body 1, u the speed of A along body 1, w = phi1':
 *   phi2' = (u sin delta - L w cos delta)/h,  m1 u' = m1 a w^2 - T sin delta/h,
 *   (I1 + m1 a^2) w' = -m1 a u w + T (1 + L cos delta/h),  A' = u (cos phi1, sin phi1) */

typedef long double ezy_reduced[6]; /* A.x, A.y, phi1, phi2, u, w */

static const struct { double a, b, c, d, m1, I1, M0, omega; } ezy_other = { 0.6, 0.35, 0.15, 0.2, 1.3, 0.2, 0.15, 2.2 };

static void ezy_slope (long double t, const ezy_reduced y, ezy_reduced f) {
  long double a = ezy_other.a, L = a + ezy_other.b, h = (long double)ezy_other.c + ezy_other.d, m = ezy_other.m1,
              I = ezy_other.I1;
  long double T = ezy_other.M0 * cosl (ezy_other.omega * t), s = sinl (y[3] - y[2]), c = cosl (y[3] - y[2]), u = y[4],
              w = y[5];
  f[0] = u * cosl (y[2]);
  f[1] = u * sinl (y[2]);
  f[2] = w;
  f[3] = (u * s - L * w * c) / h;
  f[4] = a * w * w - T * s / h / m;
  f[5] = (-m * a * u * w + T * (1 + L * c / h)) / (I + m * a * a);
}

static void ezy_reduced_step (long double t, long double h, ezy_reduced y) {
  static const long double at[] = { 0, 0.5L, 0.5L, 1 }, weight[] = { 1 / 6.0L, 1 / 3.0L, 1 / 3.0L, 1 / 6.0L };
  ezy_reduced k[4], stage;
  for (int i = 0; i < 4; i++) {
    for (int j = 0; j < 6; j++) stage[j] = y[j] + (i ? h * at[i] * k[i - 1][j] : 0);
    ezy_slope (t + at[i] * h, stage, k[i]);
  }
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 6; j++) y[j] += h * weight[i] * k[i][j];
}

TEST (reduced) {
  enum { STEPS = 20000 };
  const double t_end = 7;
  ezy_reduced y = { -(long double)ezy_other.a, 0, 0, PW_PI, 0, 0 };
  for (int i = 0; i < STEPS; i++) ezy_reduced_step (i * (t_end / STEPS), t_end / STEPS, y);
  double x1 = (double)(y[0] + ezy_other.a * cosl (y[2])), y1 = (double)(y[1] + ezy_other.a * sinl (y[2]));
  double x2 = x1 + (double)(ezy_other.b * cosl (y[2]) + ezy_other.d * cosl (y[3]));
  double y2 = y1 + (double)(ezy_other.b * sinl (y[2]) + ezy_other.d * sinl (y[3]));
  const double reference[6] = { x1, y1, (double)y[2], x2, y2, (double)y[3] };
  double w = (double)y[5], u = (double)y[4], v_across = ezy_other.a * w;
  const char *const method[] = { "rk4+projection", "rk4+none", "ida+ggl", "ida+baumgarte" };
  for (int i = 0; i < 4; i++) {
    pw_system *s =
        scene_system (&scene_ezyroller, "a", ezy_other.a, "b", ezy_other.b, "c", ezy_other.c, "d", ezy_other.d, "m1",
                      ezy_other.m1, "I1", ezy_other.I1, "M0", ezy_other.M0, "omega", ezy_other.omega, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = t_end });
    pw_sample now = runs_to (r, t_end);
    double bound = i < 2 ? 1e-11 : 1e-6;
    const char *reason = i < 2 ? "(h omega)^4 at h = 1e-3" : "1e4 rtol";
    for (int j = 0; j < 6; j++) check_close (method[i], now.q[j], reference[j], bound, reason);
    check_close ("omega1", now.v[2], w, bound, reason);
    check_close ("kinetic energy", now.kinetic,
                 (ezy_other.m1 * (u * u + v_across * v_across) + ezy_other.I1 * w * w) / 2, bound, reason);
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* The opposite torque mirrors the motion about the x axis. */
TEST (mirror) {
  double q[6], v[6], Q[6], V[6];
  pw_system *s = scene_system (&scene_ezyroller, NULL), *S = scene_system (&scene_ezyroller, "M0", -0.1, NULL);
  runs_state (s, "rk4+projection", &(pw_settings){ .step = 1e-2 }, 3, q, v, NULL);
  runs_state (S, "rk4+projection", &(pw_settings){ .step = 1e-2 }, 3, Q, V, NULL);
  double bound = 1e4 * CHECK_EPS;
  for (int j = 0; j < 5; j++)
    check_close ("mirror", Q[j], j % 3 == 0 ? q[j] : -q[j], bound, "round-off over 300 steps");
  check_close ("mirror", Q[5] - PW_PI, -(q[5] - PW_PI), bound, "round-off over 300 steps");
  pw_system_free (s);
  pw_system_free (S);
}
