/* Vehicles of the gallery, compared with their reference solutions. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "gallery.h"
#include "system.h"
#include "trial.h"

TEST (wheeled_snake) {
  for (double n = 3; n <= 12; n += 3)
    gallery_energy (gallery_open ("wheeled-snake", "n", n, NULL), 5e-4, 4, 1e6 * H4, GALLERY_DRIVEN);
}

/* The circle on which a point of a body moves: it begins at (x0, 0) in x direction, with the centre to its left. */
static void gallery_circle (const pw_system *s, const pw_sample *x, const char *body, double along, double x0, double R,
                            double bound, const char *reason) {
  char name[32];
  double P[2];
  gallery_point (s, x, body, along, P);
  snprintf (name, sizeof name, "%s.phi", body);
  double phi = trial_state (s, x, name);
  check_close ("centre, x", P[0] - R * sin (phi), x0, bound, reason);
  check_close ("centre, y", P[1] + R * cos (phi), R, bound, reason);
}

TEST (car) {
  pw_system *s = gallery_open ("car", NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  assert_int_equal (pw_run_redundant (r), 2);
  const double R = 2.6 / tan (0.3);
  for (int t = 1; t <= 10; t++) {
    pw_sample x = runs_to (r, t);
    gallery_circle (s, &x, "car", -1.4, -1.4, R, 100 * H4, "100 h^4");
    check_close ("turned", trial_state (s, &x, "car.phi"), 5 / R * t, 100 * H4, "100 h^4");
  }
  runs_close (r, s);
}

/* Steered while driving: the four wheels are consistent at all times, and the car turns at u T / L. */
TEST (ackermann_car) {
  const double L = 2.6, k = tan (PW_PI * 25 / 180), w = 0.2 * PW_PI;
  pw_system *s = gallery_open ("ackermann-car", NULL);
  pw_run *r = gallery_run (s, 1e-3, 20);
  assert_int_equal (pw_run_redundant (r), 2);
  for (int t = 1; t <= 20; t++) {
    pw_sample x = runs_to (r, t);
    check_close ("turned", trial_state (s, &x, "car.phi"), 5 * k * sin (w * t) / (L * w), 10 * H4, "10 h^4");
    check_close ("rate", trial_state (s, &x, "car.omega"), 5 * k * cos (w * t) / L, 64 * CHECK_EPS, "round-off");
    check_below ("all four wheels", x.velocity, 64 * CHECK_EPS, "round-off, including redundant rows");
  }
  runs_close (r, s);
  s = gallery_open ("ackermann-car", "w", 0., "track", 2.4, NULL);
  r = gallery_run (s, 1e-3, 10);
  for (int t = 1; t <= 10; t++) {
    pw_sample x = runs_to (r, t);
    gallery_circle (s, &x, "car", -1.4, -1.4, L / k, 100 * H4, "100 h^4");
  }
  runs_close (r, s);
}

/* The headings of both front wheels, from the model's expressions: cot (outer) - cot (inner) = track / L. */
TEST (ackermann_angles) {
  pw_system *s = gallery_open ("ackermann-car", NULL);
  pw_workspace *w = pw_workspace_new (s, NULL);
  const pw_element_batch *k = w->batch;
  while (k->kind != &pw_kind_steered_wheel) k++;
  for (double t = 0; t < 10; t += 0.37) {
    pw_update_kinematics (w, t, s->q0, s->v0);
    double left = k->b.u[0], right = k->b.u[3];
    check_close ("cot - cot", (1 / tan (right) - 1 / tan (left)) * tan (right), 1.5 / 2.6 * tan (right), 64 * CHECK_EPS,
                 "round-off");
    assert_true (left * cos (0.2 * PW_PI * t) > 0);
  }
  pw_workspace_free (w);
  pw_system_free (s);
}

/* In a steady turn each axle moves on a circle given by Pythagoras, without forces in the hitches. */
TEST (car_two_trailers) {
  static const char *const body[] = { "car", "trailer1", "trailer2" };
  pw_system *s = gallery_open ("car-two-trailers", "w", 0., NULL);
  pw_run *r = gallery_run (s, 1e-3, 100);
  pw_sample x = runs_to (r, 100);
  double R = 2.5 / tan (PW_PI * 20 / 180), R2 = R * R;
  for (int i = 0; i < 3; i++, R2 -= 9) {
    double P[2];
    gallery_point (s, &x, body[i], 0, P);
    check_close (body[i], hypot (P[0], P[1] - R), sqrt (R2), 1e3 * H4, "1000 h^4: errors grow with time");
  }
  check_close ("hitch1", trial_reaction (s, &x, "hitch1.Fx") / 1e3, 0, 100 * H4, "no force in the hitches");
  check_close ("hitch2", trial_reaction (s, &x, "hitch2.Fy") / 1e3, 0, 100 * H4, "no force in the hitches");
  runs_close (r, s);
}

/* The final radius of the middle of the rear axle. */
static double gallery_tyres (double stiffness) {
  pw_system *s = gallery_open ("car-tyres", "stiffness", stiffness, NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  pw_sample x = runs_to (r, 10);
  double w = trial_state (s, &x, "car.omega"), phi = trial_state (s, &x, "car.phi");
  double radius =
      hypot (trial_state (s, &x, "car.vx") + 1.4 * w * sin (phi), trial_state (s, &x, "car.vy") - 1.4 * w * cos (phi)) /
      w;
  check_below ("dissipated", -x.loss, 0, "slip dissipates energy");
  runs_close (r, s);
  return radius;
}

TEST (car_tyres) {
  const double R = 2.6 / tan (0.3);
  double off[4], stiffness = 4e4;
  for (int i = 0; i < 4; i++, stiffness *= 2) off[i] = gallery_tyres (stiffness) - R;
  for (int i = 1; i < 4; i++) check_close ("order in 1 / C", log2 (off[i - 1] / off[i]), 1, 0.1, "first order");
  check_close ("extrapolated", 2 * off[3] - off[2], 0, fabs (off[3]) / 20, "the remainder is of second order");
}

TEST (differential_drive) {
  pw_system *s = gallery_open ("differential-drive", NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  assert_int_equal (pw_run_redundant (r), 1);
  pw_sample x = { 0 };
  for (int t = 1; t <= 10; t++) {
    x = runs_to (r, t);
    gallery_circle (s, &x, "robot", -0.05, 0, 0.15 * 1. / 0.2, 10 * H4, "10 h^4");
  }
  check_close ("turned", trial_state (s, &x, "robot.phi"), 10 * 0.2 / 0.3, 10 * H4, "10 h^4");
  check_close ("left wheel", trial_state (s, &x, "left.spin"), 10 * 0.4 / 0.08, 100 * H4, "100 h^4");
  check_close ("right wheel", trial_state (s, &x, "right.spin"), 10 * 0.6 / 0.08, 100 * H4, "100 h^4");
  check_close ("balance", x.balance, 0, 100 * H4, "100 h^4");
  runs_close (r, s);
}
