/* friction, drag, rolling-resistance: bodies that slow down by laws with known solutions. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* The speed v after t where m v' = -L tanh (v / v0): sinh (v / v0) decays as exp (-L t / (m v0)). */
static double friction_coulomb (double v, double t, double m, double L, double v0) {
  return v0 * asinh (sinh (v / v0) * exp (-L * t / (m * v0)));
}

/* The same where m v' = -(c v + d v^2), v > 0. */
static double friction_air (double v, double t, double m, double c, double d) {
  if (c == 0) return v / (1 + d * v * t / m);
  double decay = exp (-c * t / m);
  return c * v * decay / (c + d * v * (1 - decay));
}

/* ---- A disc that rubs on another one: the relative rate is that of the inertia 1 / (1/I1 + 1/I2) ---- */

static const struct { double I[2], w, w0; } friction_d = { { 0.3, 0.9 }, 2, 0.5 };

typedef struct {
  double viscous, limit, speed, linear, quadratic;
} friction_parameters;

static const pw_parameter friction_list[] = {
  { PW_AT (friction_parameters, viscous), 0, "N m s/rad", "of the friction", PW_NONNEGATIVE },
  { PW_AT (friction_parameters, limit), 0, "N m", "of the friction", PW_NONNEGATIVE },
  { PW_AT (friction_parameters, speed), 0.5, "rad/s", "of the friction", PW_NONNEGATIVE },
  { PW_AT (friction_parameters, linear), 0, "", "of the drag", PW_NONNEGATIVE },
  { PW_AT (friction_parameters, quadratic), 0, "", "of the drag", PW_NONNEGATIVE },
  { .name = NULL },
};

SCENE_WITH (friction_discs, friction_list, friction_parameters) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = friction_d.I[0], .rate = { 0, 0, friction_d.w } });
  pw_add_body (m, &(pw_body){ .name = "b", .mass = 1, .inertia = friction_d.I[1] });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "a", "b" } });
  pw_add_friction (m, &(pw_friction){ .name = "rub",
                                      .body = { "b", "a" },
                                      .viscous = p->viscous,
                                      .limit = { .constant = p->limit },
                                      .speed = p->speed });
}

static void friction_rub (const char *method, double viscous, double limit, double bound, const char *reason) {
  pw_system *s = scene_system (&friction_discs_table, "viscous", viscous, "limit", limit, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2, .ledger = 1 });
  double I = friction_d.I[0] * friction_d.I[1] / (friction_d.I[0] + friction_d.I[1]);
  for (int i = 1; i <= 5; i++) {
    double t = 0.4 * i, w = friction_d.w * exp (-viscous * t / I);
    if (limit > 0) w = friction_coulomb (friction_d.w, t, I, limit, friction_d.w0);
    pw_sample x = runs_to (r, t);
    check_close ("rate", x.v[2] - x.v[5], w, bound, reason);
    check_close ("momentum", friction_d.I[0] * x.v[2] + friction_d.I[1] * x.v[5], friction_d.I[0] * friction_d.w, bound,
                 "the torques balance");
    check_close ("loss", x.loss, I * (friction_d.w * friction_d.w - w * w) / 2, bound, reason);
    check_close ("balance", x.balance, 0, bound, reason);
  }
  runs_close (r, s);
}

TEST (discs) {
  friction_rub ("rk4+projection", 0.4, 0, 1e-10, "(h k)^4 at h = 1e-3 and k = 2/s");
  friction_rub ("rk4+projection", 0, 0.3, 1e-10, "(h k)^4 at h = 1e-3 and k = 3/s");
  friction_rub ("ida+ggl", 0, 0.3, 1e-6, "1e4 rtol");
}

/* ---- A block that slides on a beam, both of them free ---- */

static const struct { double m[2], v, psi, w0; } friction_b = { { 0.7, 2.1 }, 1.8, 0.4, 0.3 };

SCENE_WITH (friction_beam, friction_list, friction_parameters) {
  double c = cos (friction_b.psi), s = sin (friction_b.psi);
  pw_add_body (m, &(pw_body){ .name = "block",
                              .mass = friction_b.m[0],
                              .inertia = 0.02,
                              .start = { 0, 0, 0.3 },
                              .rate = { friction_b.v * c, friction_b.v * s } });
  pw_add_body (m, &(pw_body){ .name = "beam", .mass = friction_b.m[1], .inertia = 0.5 });
  pw_add_slider (m, &(pw_slider){ .name = "S", .body = { "block", "beam" }, .heading = friction_b.psi, .angle = 0.3 });
  pw_add_sliding_friction (m, &(pw_sliding_friction){ .name = "rub",
                                                      .body = { "block", "beam" },
                                                      .heading = friction_b.psi,
                                                      .viscous = p->viscous,
                                                      .limit = { .constant = p->limit },
                                                      .speed = p->speed });
}

/* The line passes through both centres of mass: nothing turns, the relative velocity is that of the reduced mass. */
static void friction_slide (const char *method, double viscous, double limit, double bound, const char *reason) {
  pw_system *s = scene_system (&friction_beam_table, "viscous", viscous, "limit", limit, "speed", friction_b.w0, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2, .ledger = 1 });
  double M = friction_b.m[0] * friction_b.m[1] / (friction_b.m[0] + friction_b.m[1]);
  for (int i = 1; i <= 4; i++) {
    double t = 0.5 * i, w = friction_b.v * exp (-viscous * t / M);
    if (limit > 0) w = friction_coulomb (friction_b.v, t, M, limit, friction_b.w0);
    pw_sample x = runs_to (r, t);
    check_close ("speed along x", x.v[0] - x.v[3], w * cos (friction_b.psi), bound, reason);
    check_close ("speed along y", x.v[1] - x.v[4], w * sin (friction_b.psi), bound, reason);
    check_close ("loss", x.loss, M * (friction_b.v * friction_b.v - w * w) / 2, 10 * bound, reason);
    check_close ("balance", x.balance, 0, 10 * bound, reason);
  }
  runs_close (r, s);
}

TEST (slide) {
  friction_slide ("rk4+projection", 0.5, 0, 1e-10, "(h k)^4 at h = 1e-3 and k = 1/s");
  friction_slide ("rk4+projection", 0, 0.6, 1e-10, "(h k)^4 at h = 1e-3 and k = 4/s");
  friction_slide ("ida+ggl", 0, 0.6, 1e-6, "1e4 rtol");
}

static void friction_refused (double speed, const char *number) {
  scene_refused (scene_model (&friction_discs_table, "limit", 0.2, "speed", speed, NULL),
                 check_text ("model scene: friction rub: speed = %s: expected > 0, and limit / speed finite, since the "
                             "limit is smoothed below this speed",
                             number));
}

TEST (refused) {
  friction_refused (1e-309, "1e-309");
}

/* ---- Air drag: of the translation and of the rotation, each with its own coefficients ---- */

static const struct { double m, I, v, w, turning, turning_quadratic; } friction_a = { 1.4, 0.2, 3, -5, 0.1, 0.05 };

SCENE_WITH (friction_flight, friction_list, friction_parameters) {
  pw_add_body (m, &(pw_body){ .name = "ball",
                              .mass = friction_a.m,
                              .inertia = friction_a.I,
                              .rate = { 0.6 * friction_a.v, -0.8 * friction_a.v, friction_a.w } });
  pw_add_drag (m, &(pw_drag){ .name = "air",
                              .body = "ball",
                              .linear = p->linear,
                              .quadratic = p->quadratic,
                              .turning = friction_a.turning,
                              .turning_quadratic = friction_a.turning_quadratic });
}

static void friction_fly (const char *method, double linear, double quadratic, double bound, const char *reason) {
  pw_system *s = scene_system (&friction_flight_table, "linear", linear, "quadratic", quadratic, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2, .ledger = 1 });
  for (int i = 1; i <= 4; i++) {
    double t = 0.5 * i, v = friction_air (friction_a.v, t, friction_a.m, linear, quadratic),
           w = friction_air (-friction_a.w, t, friction_a.I, friction_a.turning, friction_a.turning_quadratic);
    pw_sample x = runs_to (r, t);
    check_close ("vx", x.v[0], 0.6 * v, bound, reason);
    check_close ("vy", x.v[1], -0.8 * v, bound, reason);
    check_close ("omega", x.v[2], -w, bound, reason);
    check_close (
        "loss", x.loss,
        (friction_a.m * (friction_a.v * friction_a.v - v * v) + friction_a.I * (friction_a.w * friction_a.w - w * w)) /
            2,
        10 * bound, reason);
    check_close ("balance", x.balance, 0, 10 * bound, reason);
  }
  runs_close (r, s);
}

TEST (flight) {
  friction_fly ("rk4", 0, 0.4, 1e-10, "(h k)^4 at h = 1e-3 and k = 2/s");
  friction_fly ("rk4", 0.5, 0, 1e-10, "(h k)^4 at h = 1e-3 and k = 2/s");
  friction_fly ("rk4", 0.3, 0.4, 1e-10, "(h k)^4 at h = 1e-3 and k = 2/s");
  friction_fly ("ida", 0.3, 0.4, 1e-6, "1e4 rtol");
}

/* ---- A cart that coasts to rest along its heading; a wheel at the same point prevents lateral motion ---- */

static const struct { double m, v, psi, L, v0; } friction_c = { 2, 1.5, 0.7, 1.2, 0.4 };

SCENE (friction_cart) {
  double c = cos (friction_c.psi), s = sin (friction_c.psi);
  pw_add_body (m, &(pw_body){ .name = "cart",
                              .mass = friction_c.m,
                              .inertia = 0.2,
                              .start = { 0, 0, 0.3 - friction_c.psi },
                              .rate = { friction_c.v * cos (0.3), friction_c.v * sin (0.3) } });
  pw_add_wheel (m, &(pw_wheel){ .name = "W", .body = "cart", .at = { 0.2 * c, 0.2 * s }, .heading = friction_c.psi });
  pw_add_rolling_resistance (m, &(pw_rolling_resistance){ .name = "R",
                                                          .body = "cart",
                                                          .at = { 0.2 * c, 0.2 * s },
                                                          .heading = friction_c.psi,
                                                          .limit = friction_c.L,
                                                          .speed = friction_c.v0 });
}

static void friction_coast (const char *method, double bound, const char *reason) {
  pw_system *s = scene_system (&friction_cart_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 3, .ledger = 1 });
  for (int i = 1; i <= 4; i++) {
    double t = i, v = friction_coulomb (friction_c.v, t, friction_c.m, friction_c.L, friction_c.v0);
    pw_sample x = runs_to (r, t);
    check_close ("vx", x.v[0], v * cos (0.3), bound, reason);
    check_close ("vy", x.v[1], v * sin (0.3), bound, reason);
    check_close ("loss", x.loss, friction_c.m * (friction_c.v * friction_c.v - v * v) / 2, 10 * bound, reason);
    check_close ("balance", x.balance, 0, 10 * bound, reason);
  }
  runs_close (r, s);
}

TEST (coast) {
  friction_coast ("rk4+projection", 1e-10, "(h k)^4 at h = 1e-3 and k = 1.5/s");
  friction_coast ("ida+ggl", 1e-6, "1e4 rtol");
}

/* ---- By all methods: a car and a trailer that are slowed down by all of these elements ---- */

SCENE (friction_car) {
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 3, .inertia = 0.4, .rate = { 2, 0.2, 0.5 } });
  pw_add_body (m, &(pw_body){ .name = "trailer", .mass = 1, .inertia = 0.1, .start = { -1 }, .rate = { 2 } });
  pw_add_pin (m, &(pw_pin){ .name = "H", .body = { "car", "trailer" }, .at = { { -0.5, 0 }, { 0.5, 0 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "W", .body = "trailer", .at = { -0.1, 0 } });
  pw_add_friction (
      m,
      &(pw_friction){
          .name = "hitch", .body = { "car", "trailer" }, .viscous = 0.05, .limit = { .constant = 0.2 }, .speed = 0.3 });
  pw_add_drag (
      m,
      &(pw_drag){
          .name = "air", .body = "car", .linear = 0.1, .quadratic = 0.2, .turning = 0.02, .turning_quadratic = 0.03 });
  pw_add_rolling_resistance (
      m, &(pw_rolling_resistance){
             .name = "R", .body = "trailer", .at = { -0.1, 0.2 }, .heading = 0.1, .limit = 0.6, .speed = 0.5 });
  pw_add_body (m, &(pw_body){ .name = "load", .mass = 0.4, .inertia = 0.01, .start = { 0, 0.2 }, .rate = { 2, 1 } });
  pw_add_slot (
      m, &(pw_slot){ .name = "rail", .body = { "load", "car" }, .at = { { 0.05, 0 }, { 0.05, 0.2 } }, .heading = 1.2 });
  pw_add_sliding_friction (m, &(pw_sliding_friction){ .name = "brake",
                                                      .body = { "load", "car" },
                                                      .at = { { 0.05, 0 }, { 0.05, 0.2 } },
                                                      .heading = 1.2,
                                                      .viscous = 0.3,
                                                      .limit = { .constant = 0.2 },
                                                      .speed = 0.3 });
  pw_add_rolling_resistance (
      m, &(pw_rolling_resistance){ .name = "F", .body = "car", .at = { 0.4, -0.2 }, .limit = 0.5, .speed = 0.3 });
}

TEST (methods) {
  trial (&friction_car_table, 2);
}
