/* speed, pfaffian: a sled with a prescribed speed, pfaffian elements in place of other types. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

#define SPEED_HARMONIC(A, w, o)                                         \
  {                                                                     \
    PW_HARMONIC, .harmonic = {.amplitude = A, .omega = w, .offset = o } \
  }

/* ---- A sled that turns at the rate w while its speed is u = o + A cos (s t): v = u e(w t), e a unit vector ----
 *
 *   F = m u' along e,  N = m u w across it,  work = m (u^2 - u(0)^2) / 2 */

static const struct { double m, w, A, s, o, psi; } speed_s = { 1.3, 0.7, 0.8, 2, 0.5, 0.6 };

typedef struct {
  double pfaffian; /* see speed_list */
} speed_parameters;

static const pw_parameter speed_list[] = {
  { PW_AT (speed_parameters, pfaffian), 0, "", "1: pfaffian elements in place of speed and wheel", PW_NONNEGATIVE },
  { .name = NULL },
};

SCENE_WITH (speed_sled, speed_list, speed_parameters) {
  int pfaffian = p->pfaffian > 0;
  double c = cos (speed_s.psi), s = sin (speed_s.psi), u = speed_s.o + speed_s.A;
  const pw_signal signal = SPEED_HARMONIC (speed_s.A, speed_s.s, speed_s.o);
  pw_add_body (m, &(pw_body){ .name = "sled",
                              .mass = speed_s.m,
                              .inertia = 0.2,
                              .start = { 0, 0, -speed_s.psi },
                              .rate = { u, 0, speed_s.w } });
  if (pfaffian) {
    pw_add_pfaffian (m,
                     &(pw_pfaffian){ .name = "push", .body = { "sled", "ground" }, .a = { c, s, 0 }, .value = signal });
    pw_add_pfaffian (m, &(pw_pfaffian){ .name = "edge", .body = { "sled", "ground" }, .a = { -s, c, 0 } });
    return;
  }
  pw_add_speed (m, &(pw_speed){ .name = "push", .body = "sled", .heading = speed_s.psi, .value = signal });
  pw_add_wheel (m, &(pw_wheel){ .name = "edge", .body = "sled", .heading = speed_s.psi });
}

/* The position at t: the integral of u e(w t). */
static void speed_position (double t, double out[2]) {
  double p = speed_s.s + speed_s.w, q = speed_s.w - speed_s.s, w = speed_s.w, A = speed_s.A / 2, o = speed_s.o;
  out[0] = A * (sin (p * t) / p + sin (q * t) / q) + o * sin (w * t) / w;
  out[1] = A * ((1 - cos (p * t)) / p + (1 - cos (q * t)) / q) + o * (1 - cos (w * t)) / w;
}

static void speed_follow (const char *method, double pfaffian, double bound, const char *reason) {
  pw_system *s = scene_system (&speed_sled_table, "pfaffian", pfaffian, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 3, .ledger = 1 });
  check_below ("start", pw_run_initial (r)->velocity, 16 * CHECK_EPS, "given consistently");
  for (int i = 1; i <= 3; i++) {
    double t = i, r_t[2], u0 = speed_s.o + speed_s.A, u = speed_s.o + speed_s.A * cos (speed_s.s * t),
           a = -speed_s.A * speed_s.s * sin (speed_s.s * t);
    pw_sample x = runs_to (r, t);
    speed_position (t, r_t);
    check_close ("x", x.q[0], r_t[0], bound, reason);
    check_close ("y", x.q[1], r_t[1], bound, reason);
    check_close ("speed", hypot (x.v[0], x.v[1]), fabs (u), bound, reason);
    check_close ("force", trial_reaction (s, &x, "push.F"), speed_s.m * a, 100 * bound, reason);
    check_close ("across", trial_reaction (s, &x, pfaffian > 0 ? "edge.F" : "edge.N"), speed_s.m * u * speed_s.w,
                 100 * bound, reason);
    check_close ("work", x.work, speed_s.m * (u * u - u0 * u0) / 2, 10 * bound, reason);
    check_close ("balance", x.balance, 0, 10 * bound, reason);
  }
  runs_close (r, s);
}

TEST (sled) {
  for (int pfaffian = 0; pfaffian < 2; pfaffian++) {
    speed_follow ("rk4+projection", pfaffian, 1e-10, "(h w)^4 at h = 1e-3 and w = 2/s");
    speed_follow ("ida+ggl", pfaffian, 1e-6, "1e4 rtol");
  }
}

/* ---- Two bodies: a prescribed velocity of one, rotations coupled as by a gear ---- */

static const struct { double m[2], I[2], A, s, ratio; } speed_p = { { 1, 3 }, { 0.2, 0.7 }, 0.6, 1.5, -2.5 };

SCENE (speed_pair) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = speed_p.m[0], .inertia = speed_p.I[0], .rate = { speed_p.A } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = speed_p.m[1], .inertia = speed_p.I[1], .start = { 1, 2, 0.3 } });
  pw_add_pfaffian (m, &(pw_pfaffian){ .name = "push",
                                      .body = { "ground", "a" },
                                      .b = { 1, 0, 0 },
                                      .value = SPEED_HARMONIC (speed_p.A, speed_p.s, 0) });
  pw_add_pfaffian (
      m, &(pw_pfaffian){ .name = "mesh", .body = { "a", "b" }, .a = { 0, 0, 1 }, .b = { 0, 0, -speed_p.ratio } });
  pw_add_torque (m, &(pw_torque){ .name = "T", .body = { "b", "ground" }, .value = { PW_CONSTANT, .constant = 0.5 } });
}

TEST (pair) {
  const double t = 2, i = speed_p.ratio, bound = 1e-11;
  const char *reason = "(h w)^4 at h = 1e-3 and w = 1.5/s";
  pw_system *s = scene_system (&speed_pair_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  pw_sample x = runs_to (r, t);
  double a = 0.5 / (speed_p.I[1] + i * i * speed_p.I[0]);
  check_close ("place", x.q[0], speed_p.A / speed_p.s * sin (speed_p.s * t), bound, reason);
  check_close ("force", trial_reaction (s, &x, "push.F"), -speed_p.m[0] * speed_p.A * speed_p.s * sin (speed_p.s * t),
               100 * bound, reason);
  check_close ("second angle", x.q[5], 0.3 + a * t * t / 2, bound, reason);
  check_close ("first angle", x.q[2], i * a * t * t / 2, bound, reason);
  check_close ("mesh", trial_reaction (s, &x, "mesh.F"), speed_p.I[0] * i * a, bound, reason);
  check_close ("balance", x.balance, 0, 10 * bound, reason);
  assert_string_equal (pw_system_reaction_unit (s, pw_system_find_reaction (s, "push.F", NULL)), "N");
  assert_string_equal (pw_system_reaction_unit (s, pw_system_find_reaction (s, "mesh.F", NULL)), "N m");
  runs_close (r, s);
}

SCENE (speed_nothing) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1 });
  pw_add_pfaffian (m, &(pw_pfaffian){ .name = "none", .body = { "a", "ground" } });
}

TEST (refused) {
  scene_refused (scene_model (&speed_nothing_table, NULL),
                 "model scene: pfaffian none: all numbers of a and b are 0: expected at least one that is not");
}

/* ---- By all methods: points off the centres of mass, rotating bodies, variable signals ---- */

SCENE (speed_tow) {
  pw_add_body (m, &(pw_body){ .name = "tug", .mass = 2, .inertia = 0.3, .rate = { 1, 0, 0.4 } });
  pw_add_body (m, &(pw_body){ .name = "raft", .mass = 1, .inertia = 0.2, .start = { -1, 0.2 }, .rate = { 1 } });
  pw_add_speed (
      m,
      &(pw_speed){
          .name = "screw", .body = "tug", .at = { -0.2, 0.15 }, .heading = 0.2, .value = SPEED_HARMONIC (0.3, 2, 1) });
  pw_add_pfaffian (m, &(pw_pfaffian){ .name = "line",
                                      .body = { "tug", "raft" },
                                      .a = { 0.8, 0.3, 0.2 },
                                      .b = { -0.7, 0.4, 0.3 },
                                      .value = SPEED_HARMONIC (0.2, 3, 0) });
  pw_add_spring (m, &(pw_spring){ .name = "rope",
                                  .body = { "tug", "raft" },
                                  .at = { { -0.3, 0 }, { 0.3, 0.1 } },
                                  .stiffness = 5,
                                  .damping = 0.3,
                                  .length = 0.4 });
}

TEST (methods) {
  trial (&speed_tow_table, 1.5);
}
