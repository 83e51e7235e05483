/* weld: two bodies move as one, a string of points, a beam held by a wall. */
#include <math.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

/* ---- A sleigh of two welded parts, and of one body ---- */

/* Masses and inertias of the rear and the front part, and the vector from one centre of mass to the other. */
static const double weld_mass[2] = { 2, 0.5 }, weld_inertia[2] = { 0.3, 0.04 }, weld_apart[2] = { 0.7, 0.4 };

/* Adds the other elements; the rear part's centre of mass is at (x, y) in the frame of `body`. */
static void weld_equip (pw_model *m, const char *body, double x, double y) {
  pw_add_wheel (m, &(pw_wheel){ .name = "blade", .body = body, .at = { x - 0.3, y }, .heading = 0.2 });
  pw_add_torque (m, &(pw_torque){ .name = "rider",
                                  .body = { body, "ground" },
                                  .value = { PW_HARMONIC, .harmonic = { .amplitude = 0.8, .omega = 2 } } });
  pw_add_spring (
      m, &(pw_spring){
             .name = "rope", .body = { body, "ground" }, .at = { { x + 0.2, y + 0.1 }, { 2, 3 } }, .stiffness = 3 });
  pw_add_gravity (m, &(pw_gravity){ .name = "slope", .acceleration = { 0.4, -0.9 } });
}

SCENE (weld_two) {
  pw_add_body (m, &(pw_body){ .name = "rear", .mass = weld_mass[0], .inertia = weld_inertia[0] });
  pw_add_body (m, &(pw_body){ .name = "front",
                              .mass = weld_mass[1],
                              .inertia = weld_inertia[1],
                              .start = { weld_apart[0], weld_apart[1], 0.9 } });
  double c = cos (0.9), s = sin (0.9), x = weld_apart[0] - 0.1, y = weld_apart[1] - 0.2;
  pw_add_weld (m, &(pw_weld){ .name = "joint",
                              .body = { "rear", "front" },
                              .at = { { 0.1, 0.2 }, { -c * x - s * y, s * x - c * y } },
                              .angle = 0.9 });
  weld_equip (m, "rear", 0, 0);
}

/* share: the front part's share of the mass, by which the centre of mass of the sleigh is moved towards it. */
SCENE (weld_one) {
  double mass = weld_mass[0] + weld_mass[1], share = weld_mass[1] / mass;
  double x = share * weld_apart[0], y = share * weld_apart[1];
  double steiner = weld_mass[0] * share *
                   (weld_apart[0] * weld_apart[0] + weld_apart[1] * weld_apart[1]); /* reduced mass times d^2 */
  pw_add_body (m, &(pw_body){ .name = "sleigh",
                              .mass = mass,
                              .inertia = weld_inertia[0] + weld_inertia[1] + steiner,
                              .start = { x, y } });
  weld_equip (m, "sleigh", -x, -y);
}

static void weld_compare (const char *method, double bound, const char *reason) {
  const pw_settings settings = { .step = 1e-3, .rtol = 1e-10, .span = 3, .ledger = 1 };
  pw_system *two = scene_system (&weld_two_table, NULL), *one = scene_system (&weld_one_table, NULL);
  pw_run *r2 = runs_open (two, method, &settings), *r1 = runs_open (one, method, &settings);
  pw_sample x2 = runs_to (r2, 3), x1 = runs_to (r1, 3);
  double share = weld_mass[1] / (weld_mass[0] + weld_mass[1]);
  check_close ("phi", x2.q[2], x1.q[2], bound, reason);
  check_close ("angle between", x2.q[5] - x2.q[2], 0.9, bound, reason);
  check_close ("x", (1 - share) * x2.q[0] + share * x2.q[3], x1.q[0], bound, reason);
  check_close ("y", (1 - share) * x2.q[1] + share * x2.q[4], x1.q[1], bound, reason);
  check_close ("kinetic", x2.kinetic, x1.kinetic, 10 * bound, reason);
  check_close ("blade", trial_reaction (two, &x2, "blade.N"), trial_reaction (one, &x1, "blade.N"), 1e3 * bound,
               reason);
  check_close ("balance", x2.balance, 0, 1e3 * bound, reason);
  pw_run_close (r1), pw_run_close (r2);
  pw_system_free (one), pw_system_free (two);
}

TEST (one_body) {
  weld_compare ("rk4+projection", 1e-12, "the same steps: round-off of 3000");
  weld_compare ("ida+ggl", 1e-6, "1e4 rtol");
  weld_compare ("ida+baumgarte", 1e-6, "1e4 rtol");
}

/* ---- A string of welded points with mass but no inertia swings as one body ---- */

enum { WELD_POINTS = 12 };

static double weld_point_x (int i) {
  return 0.4 * i + 0.05 * sin (3. * i);
}

static double weld_point_y (int i) {
  return 0.23 * cos (2. * i);
}

SCENE (weld_string) {
  static const char *const name[WELD_POINTS] = { "p0", "p1", "p2", "p3", "p4",  "p5",
                                                 "p6", "p7", "p8", "p9", "p10", "p11" };
  static const char *const joint[WELD_POINTS] = { "w0", "w1", "w2", "w3", "w4",  "w5",
                                                  "w6", "w7", "w8", "w9", "w10", "w11" };
  for (int i = 0; i < WELD_POINTS; i++) {
    const double x = weld_point_x (i), y = weld_point_y (i);
    pw_add_body (m, &(pw_body){ .name = name[i], .mass = 1, .start = { x, y } });
    if (i == 0) pw_add_pin (m, &(pw_pin){ .name = "hook", .body = { name[0], "ground" }, .at = { { -x, -y } } });
    if (i == 0) continue;
    const double X = weld_point_x (i - 1), Y = weld_point_y (i - 1);
    pw_add_weld (m, &(pw_weld){ .name = joint[i],
                                .body = { name[i - 1], name[i] },
                                .at = { { 0.2 * i - X, 0.1 - Y }, { 0.2 * i - x, 0.1 - y } } });
  }
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

SCENE (weld_pendulum) {
  double x = 0, y = 0, inertia = 0;
  for (int i = 0; i < WELD_POINTS; i++) x += weld_point_x (i) / WELD_POINTS, y += weld_point_y (i) / WELD_POINTS;
  for (int i = 0; i < WELD_POINTS; i++)
    inertia += (weld_point_x (i) - x) * (weld_point_x (i) - x) + (weld_point_y (i) - y) * (weld_point_y (i) - y);
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = WELD_POINTS, .inertia = inertia, .start = { x, y } });
  pw_add_pin (m, &(pw_pin){ .name = "hook", .body = { "rod", "ground" }, .at = { { -x, -y } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

TEST (points) {
  static const char *const method[] = { "rk4+projection", "rk4+nullspace", "leapfrog", "galpha+ggl" };
  for (int i = 0; i < 4; i++) {
    pw_system *s = scene_system (&weld_string_table, NULL), *t = scene_system (&weld_pendulum_table, NULL);
    pw_run *r = runs_open (s, method[i], &(pw_settings){ .step = 2e-3, .span = 1 });
    pw_run *twin = runs_open (t, method[i], &(pw_settings){ .step = 2e-3, .span = 1 });
    pw_sample x = runs_to (r, 1), y = runs_to (twin, 1);
    double bound = i < 2 ? 1e-11 : 3e-5;
    check_close (method[i], trial_state (s, &x, "p11.phi"), y.q[2], bound,
                 i < 2 ? "the same steps: round-off" : "100 h^2 / 12 at a frequency of about 1/s");
    pw_run_close (r), pw_run_close (twin);
    pw_system_free (s), pw_system_free (t);
  }
}

/* ---- A beam held by a wall ---- */

SCENE (weld_beam) {
  pw_add_body (m, &(pw_body){ .name = "beam", .mass = 4, .inertia = 1, .start = { 1, 5, 0 } });
  pw_add_weld (m, &(pw_weld){ .name = "wall", .body = { "beam", "ground" }, .at = { { -1.5, 0 }, { 0, 5 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 2, -9.81 } });
}

/* The described position is half a metre too far to the left; the initial state satisfies the weld. */
TEST (beam) {
  pw_system *s = scene_system (&weld_beam_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 0.01 });
  assert_int_equal (pw_run_initial (r)->moved, 1);
  pw_sample x = runs_to (r, 1);
  double bound = 1e4 * CHECK_EPS;
  check_close ("x", x.q[0], 1.5, bound, "round-off of 100 steps");
  check_close ("y", x.q[1], 5, bound, "round-off of 100 steps");
  check_close ("Fx", trial_reaction (s, &x, "wall.Fx"), -4 * 2, 40 * bound, "weight");
  check_close ("Fy", trial_reaction (s, &x, "wall.Fy"), 4 * 9.81, 40 * bound, "weight");
  check_close ("M", trial_reaction (s, &x, "wall.M"), 4 * 9.81 * 1.5, 60 * bound, "weight times arm");
  runs_close (r, s);
}

TEST (methods) {
  trial (&weld_two_table, 3);
}
