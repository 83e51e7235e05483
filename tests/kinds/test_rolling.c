/* rolling-wheel: a body on one driven wheel, a robot with two of them, a motor, initial states. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* ---- One driven wheel below the centre of mass ----
 *
 *   speed a t along the heading, phi = w t:  a = u r / (m r^2 + I) with the torque u and the inertia of the wheel, I */

typedef struct {
  double inertia;
} rolling_parameters;

static const pw_parameter rolling_list[] = {
  { PW_AT (rolling_parameters, inertia), 0.03, "kg m^2", "of the wheel", PW_NONNEGATIVE },
  { .name = NULL },
};

static const struct { double m, r, u, w, heading; } rolling_u = { 2, 0.15, 0.4, 0.9, 0.6 };

SCENE_WITH (rolling_unicycle, rolling_list, rolling_parameters) {
  pw_add_body (m, &(pw_body){ .name = "body", .mass = rolling_u.m, .inertia = 0.1, .rate = { 0, 0, rolling_u.w } });
  pw_add_rolling_wheel (m, &(pw_rolling_wheel){ .name = "wheel",
                                                .body = "body",
                                                .heading = rolling_u.heading,
                                                .radius = rolling_u.r,
                                                .inertia = p->inertia,
                                                .start = 0.5,
                                                .torque = { .constant = rolling_u.u } });
}

static void rolling_turn (const char *method, double inertia, double bound, const char *reason) {
  const double t = 3, w = rolling_u.w, r = rolling_u.r;
  double a = rolling_u.u * r / (rolling_u.m * r * r + inertia); /* along the heading */
  double along = a * (t * sin (w * t) / w + (cos (w * t) - 1) / (w * w));
  double aside = a * (sin (w * t) / (w * w) - t * cos (w * t) / w);
  double c = cos (rolling_u.heading), s = sin (rolling_u.heading);
  pw_system *system = scene_system (&rolling_unicycle_table, "inertia", inertia, NULL);
  pw_run *run = runs_open (system, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = t, .ledger = 1 });
  pw_sample x = runs_to (run, t);
  check_close ("x", x.q[0], c * along - s * aside, bound, reason);
  check_close ("y", x.q[1], s * along + c * aside, bound, reason);
  check_close ("spin", trial_state (system, &x, "wheel.spin"), 0.5 + a * t * t / (2 * r), 10 * bound, reason);
  check_close ("spin rate", trial_state (system, &x, "wheel.spin_rate"), a * t / r, 10 * bound, reason);
  check_close ("lateral force", trial_reaction (system, &x, "wheel.N"), rolling_u.m * a * t * w, 100 * bound, reason);
  check_close ("traction", trial_reaction (system, &x, "wheel.T"), rolling_u.m * a, 100 * bound, reason);
  check_close ("work", x.work, rolling_u.u * a * t * t / (2 * r), 10 * bound, reason);
  check_close ("balance", x.balance, 0, 10 * bound, reason);
  runs_close (run, system);
}

TEST (unicycle) {
  static const double inertia[] = { 0.03, 0 };
  for (int i = 0; i < 2; i++) {
    rolling_turn ("rk4+projection", inertia[i], 1e-11, "10 h^4 at h = 1e-3");
    rolling_turn ("rk4+baumgarte", inertia[i], 1e-11, "10 h^4 at h = 1e-3");
    rolling_turn ("ida+ggl", inertia[i], 1e-6, "1e4 rtol");
    rolling_turn ("ida+baumgarte", inertia[i], 1e-6, "1e4 rtol");
  }
}

/* ---- A robot with two driven wheels on one axle, centre of mass between them: it moves along a circle ----
 *
 *   v = a t, phi = b t^2 / 2:  (m + 2 I / r^2) a = (u1 + u2) / r,  (J + 2 I c^2 / r^2) b = c (u2 - u1) / r,
 *   with the torques u1, u2 and half the length of the axle, c
 *
 * Both wheels prevent lateral motion and share the lateral force; or the left one has all of it, since the right one
 * is in a massless hub that can slide along the axle. */

static const struct { double m, J, I, r, c, u1, u2; } rolling_r = { 10, 0.4, 0.02, 0.1, 0.25, 0.5, 0.8 };

static void rolling_two (pw_model *m, int hub) {
  pw_rolling_wheel wheel = { .name = "left",
                             .body = "robot",
                             .at = { 0, rolling_r.c },
                             .radius = rolling_r.r,
                             .inertia = rolling_r.I,
                             .torque = { .constant = rolling_r.u1 } };
  pw_add_body (m, &(pw_body){ .name = "robot", .mass = rolling_r.m, .inertia = rolling_r.J });
  pw_add_rolling_wheel (m, &wheel);
  wheel.name = "right";
  wheel.body = hub ? "hub" : "robot";
  wheel.at[1] = hub ? 0 : -rolling_r.c;
  wheel.torque.constant = rolling_r.u2;
  pw_add_rolling_wheel (m, &wheel);
}

SCENE (rolling_robot) {
  rolling_two (m, 0);
}

SCENE (rolling_hub) {
  rolling_two (m, 1);
  pw_add_body (m, &(pw_body){ .name = "hub", .start = { 0, -rolling_r.c } });
  pw_add_drive (m, &(pw_drive){ .name = "slot", .body = { "hub", "robot" }, .what = PW_DRIVE_X });
  pw_add_drive (m, &(pw_drive){ .name = "key", .body = { "hub", "robot" }, .what = PW_DRIVE_ANGLE });
}

/* shares: the parts of the lateral force that the left and the right wheel have. */
static void rolling_circle (const pw_plugin_table *table, const double shares[2], const char *method, double bound,
                            const char *reason) {
  const double t = 2, m = rolling_r.m, I = rolling_r.I, r = rolling_r.r, c = rolling_r.c;
  double a = (rolling_r.u1 + rolling_r.u2) / r / (m + 2 * I / (r * r));
  double b = c * (rolling_r.u2 - rolling_r.u1) / r / (rolling_r.J + 2 * I * c * c / (r * r));
  double phi = b * t * t / 2, distance = a * t * t / 2, lateral = m * a * t * b * t;
  pw_system *s = scene_system (table, NULL);
  pw_run *run = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = t, .ledger = 1 });
  pw_sample x = runs_to (run, t);
  check_close ("phi", x.q[2], phi, bound, reason);
  check_close ("x", x.q[0], a / b * sin (phi), bound, reason);
  check_close ("y", x.q[1], a / b * (1 - cos (phi)), bound, reason);
  check_close ("left", trial_state (s, &x, "left.spin"), (distance - c * phi) / r, 10 * bound, reason);
  check_close ("right", trial_state (s, &x, "right.spin"), (distance + c * phi) / r, 10 * bound, reason);
  check_close ("work", x.work, (rolling_r.u1 * (distance - c * phi) + rolling_r.u2 * (distance + c * phi)) / r,
               10 * bound, reason);
  check_close ("left force", trial_reaction (s, &x, "left.N"), shares[0] * lateral, 1e3 * bound, reason);
  check_close ("right force", trial_reaction (s, &x, "right.N"), shares[1] * lateral, 1e3 * bound, reason);
  check_close ("balance", x.balance, 0, 10 * bound, reason);
  runs_close (run, s);
}

static void rolling_every_method (const pw_plugin_table *table, const double shares[2]) {
  const pw_method *m;
  char method[40];
  for (int i = 0; (m = runs_method (i, method)) != NULL; i++)
    if (m->adaptive)
      rolling_circle (table, shares, method, 1e-6, "1e4 rtol");
    else
      rolling_circle (table, shares, method, 100 * pow (1e-3, m->order), "100 h^order at h = 1e-3");
}

TEST (robot) {
  static const double halves[] = { 0.5, 0.5 };
  char text[200];
  rolling_every_method (&rolling_robot_table, halves);
  pw_system *s = scene_system (&rolling_robot_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_int_equal (pw_run_redundant (r), 1);
  assert_string_equal (pw_run_redundancy (r, 0, text, sizeof text),
                       "rolling-wheels left and right: the same lateral constraint");
  runs_close (r, s);
}

TEST (hub) {
  static const double all[] = { 1, 0 };
  rolling_every_method (&rolling_hub_table, all);
}

/* ---- A motor whose torque k (w0 - w) falls with its speed: w = w0 (1 - exp (-k t / J)) ---- */

static int rolling_motor (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = 0.05 * (20 - x[0]);
  if (gradient) gradient[0] = -0.05;
  return 0;
}

static void rolling_speed (const char *method, double bound, const char *reason) {
  static const char *const reads[] = { "wheel.spin_rate", NULL };
  pw_error error = { 0 };
  pw_signal motor = { PW_FUNCTION, .function = { .eval = rolling_motor, .reads = reads } };
  pw_model *m = scene_model (&rolling_unicycle_table, NULL);
  check_ok (pw_model_set_signal (m, "wheel", "torque", &motor, &error), &error);
  check_ok (pw_model_set_initial (m, "body.omega", 0, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *run = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = 2 });
  pw_sample x = runs_to (run, 2);
  double J = rolling_u.m * rolling_u.r * rolling_u.r + 0.03;
  check_close ("speed", trial_state (s, &x, "wheel.spin_rate"), 20 * (1 - exp (-0.05 * 2 / J)), bound, reason);
  runs_close (run, s);
}

TEST (motor) {
  rolling_speed ("rk4+projection", 1e-11, "(h k / J)^4 at h = 1e-3");
  rolling_speed ("ida+ggl", 1e-6, "1e4 rtol");
}

/* ---- Initial states ---- */

SCENE (rolling_coast) {
  pw_add_body (m, &(pw_body){ .name = "body",
                              .mass = 1,
                              .inertia = 0.1,
                              .start = { 0, 0, PW_PI / 3 },
                              .rate = { 2 * cos (PW_PI / 3) - 0.5 * 0.4 * cos (PW_PI / 3),
                                        2 * sin (PW_PI / 3) - 0.5 * 0.4 * sin (PW_PI / 3), 0.5 } });
  pw_add_rolling_wheel (
      m, &(pw_rolling_wheel){ .name = "wheel", .body = "body", .at = { 0, -0.4 }, .radius = 0.2, .inertia = 0.05 });
}

/* A wheel without a given spin rate takes that with which it rolls; the velocity of the body does not change. */
TEST (start) {
  pw_system *s = scene_system (&rolling_coast_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_int_equal (pw_run_initial (r)->moved, 0);
  check_close ("spin rate", pw_run_initial (r)->v[3], 2 / 0.2, 64 * CHECK_EPS, "speed of the contact point / radius");
  runs_close (r, s);
}

/* A spin rate of 0 that is specified is kept, as any other: the body stops along the heading. */
TEST (specified) {
  for (int i = 0; i < 2; i++) {
    pw_model *m = scene_model (&rolling_unicycle_table, NULL);
    pw_body cart = { .name = "cart", .mass = 1, .inertia = 1, .rate = { 2 }, .specified = PW_SPECIFIES_NOTHING };
    pw_add_body (m, &cart);
    pw_add_rolling_wheel (
        m, &(pw_rolling_wheel){ .name = "roll", .body = "cart", .radius = 0.5, .inertia = 1, .specified = { 0, i } });
    pw_system *s = scene_compile (m);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    pw_sample x = runs_to (r, 0);
    const double spin = trial_state (s, &x, "roll.spin_rate"), along = trial_state (s, &x, "cart.vx");
    check_close ("rolling", along, 0.5 * spin, 1e-12, "round-off");
    check_close ("spin rate", spin, i ? 0 : 4, 1e-12, "round-off");
    runs_close (r, s);
  }
}

/* A large spin angle changes no motion, by any method. */
TEST (large_spin) {
  double q[2][4], v[2][4];
  char method[40];
  for (int i = 0; runs_method (i, method); i++) {
    for (int k = 0; k < 2; k++) {
      pw_error error = { 0 };
      pw_model *m = scene_model (&rolling_unicycle_table, NULL);
      check_ok (pw_model_set_initial (m, "wheel.spin", k ? 1e6 : 0.5, &error), &error);
      pw_system *s = scene_compile (m);
      runs_state (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-8 }, 2, q[k], v[k], NULL);
      pw_system_free (s);
    }
    for (int j = 0; j < 3; j++) check_close (method, q[1][j], q[0][j], 1e-3, "the method's error");
    check_close (method, q[1][3] - 1e6, q[0][3] - 0.5, 1e-2, "the method's error");
  }
}

/* A spin rate set by pw_model_set_initial is kept; the velocity of the body changes. */
TEST (given) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&rolling_unicycle_table, NULL);
  check_ok (pw_model_set_initial (m, "wheel.spin_rate", 4, &error), &error);
  pw_system *s = scene_compile (m);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_int_equal (pw_run_initial (r)->released, 0);
  check_close ("vx", pw_run_initial (r)->v[0], 4 * rolling_u.r * cos (rolling_u.heading), 64 * CHECK_EPS, "rolling");
  check_close ("vy", pw_run_initial (r)->v[1], 4 * rolling_u.r * sin (rolling_u.heading), 64 * CHECK_EPS, "rolling");
  runs_close (r, s);
}

/* ---- By all methods: a planar bicycle with a driven rear wheel and a free fork with trail ---- */

SCENE (rolling_bicycle) {
  pw_add_body (m, &(pw_body){ .name = "frame", .mass = 8, .inertia = 1.2, .rate = { 1, 0, 0 } });
  pw_add_body (m,
               &(pw_body){ .name = "fork", .mass = 1, .inertia = 0.02, .start = { 0.57, 0.03, 0.3 }, .rate = { 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "head", .body = { "frame", "fork" }, .at = { { 0.6, 0.04 }, { 0.03, 0 } } });
  pw_add_rolling_wheel (
      m, &(pw_rolling_wheel){ .name = "rear",
                              .body = "frame",
                              .at = { -0.4, 0 },
                              .radius = 0.3,
                              .inertia = 0.1,
                              .torque = { PW_HARMONIC, .harmonic = { .amplitude = 2, .omega = 1.5, .offset = 1 } } });
  pw_add_rolling_wheel (
      m, &(pw_rolling_wheel){ .name = "front", .body = "fork", .at = { -0.05, 0 }, .heading = 0.1, .radius = 0.25 });
}

TEST (methods) {
  trial (&rolling_bicycle_table, 2);
  trial (&rolling_hub_table, 2);
}
