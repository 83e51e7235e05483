/* The models of the gallery against the truth each of them has. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include "check.h"
#include "pinwheel-files.h"
#include "scene.h"
#include "system.h"
#include "trial.h"
#include "verify.h"

#define H4 1e-12    /* h^4, the order of the method, at h = 1 ms */
#define HW4 1.6e-11 /* (h w)^4 at h = 2 us and a crank of w = 1000 rad/s */

/* A model by name, with parameters set: gallery_open ("chain", "n", 3., NULL). */
static pw_system *gallery_open (const char *model, ...) {
  pw_error error = { 0 };
  pw_file *f = pw_file_open (model, &error);
  check_ok (f ? PW_OK : error.status, &error);
  pw_model *m = pw_file_model (f, &error);
  check_ok (m ? PW_OK : error.status, &error);
  va_list list;
  va_start (list, model);
  for (const char *name; (name = va_arg (list, const char *)) != NULL;)
    check_ok (pw_set (m, name, va_arg (list, double), &error), &error);
  va_end (list);
  check_ok (pw_build (m, &error), &error);
  pw_system *s = scene_compile (m);
  pw_file_close (f);
  return s;
}

/* Runs with fixed steps to t. */
static pw_run *gallery_run (pw_system *s, double step, double t) {
  return runs_open (s, "rk4+projection", &(pw_settings){ .step = step, .span = t, .ledger = 1 });
}

static void gallery_close (pw_run *r, pw_system *s) {
  pw_close (r);
  pw_free (s);
}

/* ---- Closed forms ---- */

static void test_chaplygin_sleigh (void **state) {
  (void)state;
  pw_system *s = gallery_open ("chaplygin-sleigh", NULL);
  pw_run *r = gallery_run (s, 1e-3, 20);
  const double k2 = 0.5 + 0.25 * 0.25, A = sqrt (0.16 + k2 * 0.64), rate = 0.25 * A / k2, c = atanh (-0.4 / A);
  for (double t = 2; t < 20; t += 2) {
    pw_sample x = runs_to (r, t);
    double z = rate * t + c, gd = atan (sinh (z)) - atan (sinh (c));
    check_close ("theta", trial_state (s, &x, "sleigh.phi"), sqrt (k2) / 0.25 * gd, 100 * H4, "100 h^4");
    check_close ("w", trial_state (s, &x, "sleigh.omega"), A / sqrt (k2) / cosh (z), 100 * H4, "100 h^4");
  }
  pw_sample x = runs_to (r, 20);
  double phi = trial_state (s, &x, "sleigh.phi"), n = cos (phi), e = sin (phi);
  double u = n * trial_state (s, &x, "sleigh.vx") + e * trial_state (s, &x, "sleigh.vy");
  check_close ("theta", phi, 6.45795189339473933785, 100 * H4, "100 h^4");
  check_close ("u", u, 0.721096625581085413303, 100 * H4, "100 h^4");
  check_close ("x", trial_state (s, &x, "sleigh.x") - 0.25 * n, 8.013005665229505484, 100 * H4, "100 h^4");
  check_close ("y", trial_state (s, &x, "sleigh.y") - 0.25 * e, -2.351907635692708835, 100 * H4, "100 h^4");
  double w = trial_state (s, &x, "sleigh.omega");
  check_close ("N", trial_reaction (s, &x, "blade.N"), 0.5 * u * w / k2, 100 * H4, "m I u w / J, to 100 h^4");
  gallery_close (r, s);
}

static void test_knife_edge_incline (void **state) {
  (void)state;
  pw_system *s = gallery_open ("knife-edge-incline", NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  pw_sample x = runs_to (r, 10);
  check_close ("x", trial_state (s, &x, "skate.x"), 0.7258393717013280771, 100 * H4, "100 h^4");
  check_close ("y", trial_state (s, &x, "skate.y"), 23.40550088629524659, 100 * H4, "100 h^4");
  check_close ("N", fabs (trial_reaction (s, &x, "edge.N")), 9.81 * fabs (sin (10.)), 100 * H4, "100 h^4");
  gallery_close (r, s);
}

static void test_pendulum (void **state) {
  (void)state;
  pw_system *s = gallery_open ("pendulum", NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  pw_sample x = runs_to (r, 10);
  check_close ("x", trial_state (s, &x, "bob.x"), 0.2750874625761168601, 1000 * H4, "1000 h^4: 10 s at 4 rad/s");
  check_close ("y", trial_state (s, &x, "bob.y"), -0.9614192050991250643, 1000 * H4, "1000 h^4: 10 s at 4 rad/s");
  gallery_close (r, s);
}

/* The steady turn of n trailers: nothing changes but the angle, to round-off and what it adds up to. */
static void gallery_turn (int n, double longer, double ratio) {
  char name[32];
  pw_system *s = gallery_open ("n-trailer", "n", (double)n, "longer", longer, "ratio", ratio, NULL);
  pw_run *r = gallery_run (s, 1e-3, 5);
  pw_sample x = runs_to (r, 5);
  double R2 = 4, L = 0.6, m = 1;
  for (int i = 0; i <= n; i++) {
    snprintf (name, sizeof name, i ? "trailer%d.x" : "tractor.x", i);
    double X = trial_state (s, &x, name);
    snprintf (name, sizeof name, i ? "trailer%d.y" : "tractor.y", i);
    double Y = trial_state (s, &x, name);
    check_close ("radius", hypot (X, Y - 2), sqrt (R2), 10 * H4, "10 h^4 and round-off");
    snprintf (name, sizeof name, "A%d.N", i);
    check_close (name, trial_reaction (s, &x, name), m * sqrt (R2), 100 * H4, "100 h^4 and round-off");
    if (i > 0) {
      snprintf (name, sizeof name, "H%d.Fx", i);
      check_close (name, trial_reaction (s, &x, name), 0, 100 * H4, "hinges carry nothing, to 100 h^4");
      snprintf (name, sizeof name, "H%d.Fy", i);
      check_close (name, trial_reaction (s, &x, name), 0, 100 * H4, "hinges carry nothing, to 100 h^4");
    }
    R2 -= L * L;
    L += longer;
    m = i > 0 ? m * ratio : 2;
  }
  gallery_close (r, s);
}

static void test_n_trailer (void **state) {
  (void)state;
  gallery_turn (2, 0.2, 0.25);
  gallery_turn (8, 0, 0.9);
}

/* ---- Energy ---- */

/* What goes in is what is there; undriven, energy is kept.  The bound is h^4 times a power of the fastest rate: nothing
 * turns fast on a snakeboard, a chain whips at 10 / s, and motors settle light parts at some 30 / s. */
static void gallery_energy (pw_system *s, double step, double t, double bound, int driven) {
  pw_run *r = gallery_run (s, step, t);
  double start = runs_to (r, 0).kinetic;
  pw_sample x = runs_to (r, t);
  check_close ("balance", x.balance, 0, bound, "h^4 times a rate");
  check_close ("kinetic and potential", x.kinetic + x.potential, start + x.work, bound, "h^4 times a rate");
  if (driven)
    assert_true (x.work > 0.1);
  else
    check_close ("work", x.work, 0, 64 * CHECK_EPS, "nothing works");
  gallery_close (r, s);
}

static void test_chain (void **state) {
  (void)state;
  for (double n = 1; n <= 20; n *= 4) gallery_energy (gallery_open ("chain", "n", n, NULL), 2e-4, 1, n * 1e4 * H4, 0);
}

static void test_snakeboard (void **state) {
  (void)state;
  gallery_energy (gallery_open ("snakeboard", NULL), 1e-3, 10, 100 * H4, 1);
  gallery_energy (gallery_open ("snakeboard", "swing", 0., "steer", 0., "trim", 0.4, "u0", 1.5, NULL), 1e-3, 10,
                  100 * H4, 0);
}

static void test_roller_racer (void **state) {
  (void)state;
  gallery_energy (gallery_open ("roller-racer", NULL), 1e-3, 5, 1e6 * H4, 1);
  gallery_energy (gallery_open ("roller-racer", "stiffness", 0., "damping", 0., "u0", 1., NULL), 1e-3, 5, 1e3 * H4, 0);
}

/* ---- Mechanisms ---- */

static void test_andrews_squeezer (void **state) {
  static const char *const name[] = { "K1.phi", "K3.phi", "K5.phi", "K7.phi" };
  static const double digits[] = { 15.8107711951537, 0.0408222401196458, 0.524409965879954, 1.04808074104194 };
  (void)state;
  pw_system *s = gallery_open ("andrews-squeezer", NULL);
  pw_run *r = gallery_run (s, 2e-6, 0.03);
  pw_sample x = runs_to (r, 0.03);
  double beta = trial_state (s, &x, "K1.phi");
  for (int i = 0; i < 4; i++) check_close (name[i], trial_state (s, &x, name[i]), digits[i], 10 * HW4, "10 (h w)^4");
  check_close ("Theta", trial_state (s, &x, "K2.phi") - beta, -15.7563710584118, 10 * HW4, "10 (h w)^4");
  check_close ("Phi", trial_state (s, &x, "K4.phi") - digits[2], -0.534730116342080, 10 * HW4, "10 (h w)^4");
  check_close ("Omega", trial_state (s, &x, "K6.phi") - digits[3], 0.534730116342080, 10 * HW4, "10 (h w)^4");
  check_close ("work", x.work, 0.033 * (beta + 0.0617138900142764496), HW4, "torque times angle, to (h w)^4");
  check_close ("balance", x.balance, 0, 10 * HW4, "10 (h w)^4");
  gallery_close (r, s);
}

/* A point of a body in the world. */
static void gallery_point (const pw_system *s, const pw_sample *x, const char *body, double along, double p[2]) {
  char name[32];
  snprintf (name, sizeof name, "%s.phi", body);
  double phi = trial_state (s, x, name);
  snprintf (name, sizeof name, "%s.x", body);
  p[0] = trial_state (s, x, name) + along * cos (phi);
  snprintf (name, sizeof name, "%s.y", body);
  p[1] = trial_state (s, x, name) + along * sin (phi);
}

static void test_peaucellier (void **state) {
  (void)state;
  pw_system *s = gallery_open ("peaucellier", NULL);
  pw_run *r = gallery_run (s, 1e-3, 2);
  double low = 0, high = 0, P[2];
  for (double t = 0.05; t < 2; t += 0.05) {
    pw_sample x = runs_to (r, t);
    gallery_point (s, &x, "PC", -0.25, P);
    check_close ("x of P", P[0], 0.75 / 0.8, 64 * CHECK_EPS, "round-off of a projected state");
    check_close ("y of P", P[1], 0.75 / 0.8 * tan (0.6 * cos (PW_PI * t)), 64 * CHECK_EPS, "round-off");
    check_below ("closure", x.position, 16 * CHECK_EPS, "round-off");
    low = fmin (low, P[1]), high = fmax (high, P[1]);
  }
  assert_true (high > 0.5 && low < -0.5);
  gallery_close (r, s);
}

/* The loops stay closed, and after a turn the leg is where it was. */
static void test_theo_jansen (void **state) {
  (void)state;
  pw_system *s = gallery_open ("theo-jansen", NULL);
  pw_run *r = gallery_run (s, 1e-3, 2);
  pw_sample x = runs_to (r, 0);
  double foot = trial_state (s, &x, "shin.x"), shoulder = trial_state (s, &x, "shoulder.phi"), energy = x.kinetic;
  for (double t = 0.1; t < 2; t += 0.1) check_below ("closure", runs_to (r, t).position, 16 * CHECK_EPS, "round-off");
  x = runs_to (r, 2);
  check_close ("crank", trial_state (s, &x, "crank.phi"), -2 * PW_PI, 100 * H4, "100 h^4");
  check_close ("shin", trial_state (s, &x, "shin.x"), foot, 100 * H4, "100 h^4");
  check_close ("shoulder", trial_state (s, &x, "shoulder.phi"), shoulder, 100 * H4, "100 h^4");
  check_close ("kinetic", x.kinetic, energy, 100 * H4, "100 h^4");
  check_close ("balance", x.balance, 0, 100 * H4, "100 h^4");
  gallery_close (r, s);
}

/* ---- Vehicles ---- */

static void test_wheeled_snake (void **state) {
  (void)state;
  for (double n = 3; n <= 12; n += 3)
    gallery_energy (gallery_open ("wheeled-snake", "n", n, NULL), 5e-4, 4, 1e6 * H4, 1);
}

/* The circle on which a point of a body goes: it starts at (x0, 0), along x, with the centre to its left. */
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

static void test_car (void **state) {
  (void)state;
  pw_system *s = gallery_open ("car", NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  assert_int_equal (pw_run_redundant (r), 2);
  const double R = 2.6 / tan (0.3);
  for (int t = 1; t <= 10; t++) {
    pw_sample x = runs_to (r, t);
    gallery_circle (s, &x, "car", -1.4, -1.4, R, 100 * H4, "100 h^4");
    check_close ("turned", trial_state (s, &x, "car.phi"), 5 / R * t, 100 * H4, "100 h^4");
  }
  gallery_close (r, s);
}

/* Steered while it drives: all four wheels agree at every moment, and so the car turns at u T / L. */
static void test_ackermann_car (void **state) {
  (void)state;
  const double L = 2.6, k = tan (PW_PI * 25 / 180), w = 0.2 * PW_PI;
  pw_system *s = gallery_open ("ackermann-car", NULL);
  pw_run *r = gallery_run (s, 1e-3, 20);
  assert_int_equal (pw_run_redundant (r), 2);
  for (int t = 1; t <= 20; t++) {
    pw_sample x = runs_to (r, t);
    check_close ("turned", trial_state (s, &x, "car.phi"), 5 * k * sin (w * t) / (L * w), 10 * H4, "10 h^4");
    check_close ("rate", trial_state (s, &x, "car.omega"), 5 * k * cos (w * t) / L, 64 * CHECK_EPS, "round-off");
    check_below ("all four wheels", x.velocity, 64 * CHECK_EPS, "round-off: redundant rows count, too");
  }
  gallery_close (r, s);
  s = gallery_open ("ackermann-car", "w", 0., "track", 2.4, NULL);
  r = gallery_run (s, 1e-3, 10);
  for (int t = 1; t <= 10; t++) {
    pw_sample x = runs_to (r, t);
    gallery_circle (s, &x, "car", -1.4, -1.4, L / k, 100 * H4, "100 h^4");
  }
  gallery_close (r, s);
}

/* The headings of the two front wheels, as the model's expressions give them: cot (outer) - cot (inner) = track / L. */
static void test_ackermann_angles (void **state) {
  (void)state;
  pw_system *s = gallery_open ("ackermann-car", NULL);
  const pw_slab *k = s->slab;
  while (k->kind != &pw_kind_steered_wheel) k++;
  for (double t = 0; t < 10; t += 0.37) {
    pw_place (s, t, s->q0, s->v0);
    double left = k->b.u[0], right = k->b.u[3];
    check_close ("cot - cot", (1 / tan (right) - 1 / tan (left)) * tan (right), 1.5 / 2.6 * tan (right), 64 * CHECK_EPS,
                 "round-off");
    assert_true (left * cos (0.2 * PW_PI * t) > 0);
  }
  pw_free (s);
}

/* In a steady turn each axle ends on a circle that Pythagoras gives, and the hitches carry nothing. */
static void test_car_two_trailers (void **state) {
  static const char *const body[] = { "car", "trailer1", "trailer2" };
  (void)state;
  pw_system *s = gallery_open ("car-two-trailers", "w", 0., NULL);
  pw_run *r = gallery_run (s, 1e-3, 100);
  pw_sample x = runs_to (r, 100);
  double R = 2.5 / tan (PW_PI * 20 / 180), R2 = R * R;
  for (int i = 0; i < 3; i++, R2 -= 9) {
    double P[2];
    gallery_point (s, &x, body[i], 0, P);
    check_close (body[i], hypot (P[0], P[1] - R), sqrt (R2), 1e3 * H4, "1000 h^4: the way back grows with the time");
  }
  check_close ("hitch1", trial_reaction (s, &x, "hitch1.Fx") / 1e3, 0, 100 * H4, "hitches carry nothing");
  check_close ("hitch2", trial_reaction (s, &x, "hitch2.Fy") / 1e3, 0, 100 * H4, "hitches carry nothing");
  gallery_close (r, s);
}

/* The radius the middle of the rear axle ends on. */
static double gallery_tyres (double stiffness) {
  pw_system *s = gallery_open ("car-tyres", "stiffness", stiffness, NULL);
  pw_run *r = gallery_run (s, 1e-3, 10);
  pw_sample x = runs_to (r, 10);
  double w = trial_state (s, &x, "car.omega"), phi = trial_state (s, &x, "car.phi");
  double radius =
      hypot (trial_state (s, &x, "car.vx") + 1.4 * w * sin (phi), trial_state (s, &x, "car.vy") - 1.4 * w * cos (phi)) /
      w;
  check_below ("dissipated", -x.loss, 0, "tyres that slip take energy");
  gallery_close (r, s);
  return radius;
}

static void test_car_tyres (void **state) {
  (void)state;
  const double R = 2.6 / tan (0.3);
  double off[4], stiffness = 4e4;
  for (int i = 0; i < 4; i++, stiffness *= 2) off[i] = gallery_tyres (stiffness) - R;
  for (int i = 1; i < 4; i++) check_close ("order in 1 / C", log2 (off[i - 1] / off[i]), 1, 0.1, "first order");
  check_close ("extrapolated", 2 * off[3] - off[2], 0, fabs (off[3]) / 20, "what is left is of second order");
}

static void test_differential_drive (void **state) {
  (void)state;
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
  gallery_close (r, s);
}

/* ---- All of them ---- */

/* A model runs as it says it wants to be run; its start, made consistent, is the one described. */
static int gallery_default (void *context, const char *model, const char *path) {
  pw_error error = { 0 };
  pw_verification off;
  (void)context;
  print_message ("%s\n", model);
  pw_file *f = pw_file_open (path, &error);
  check_ok (f ? PW_OK : error.status, &error);
  pw_run_defaults run = pw_file_table (f)->run;
  pw_system *s = gallery_open (path, NULL);
  pw_run *r = runs_open (s, run.method, &(pw_settings){ .step = run.step, .span = run.t_end, .ledger = 1 });
  assert_int_equal (pw_run_start (r)->freed, 0);
  check_below ("start, positions", pw_run_start (r)->position, 64 * CHECK_EPS, "described to round-off");
  pw_sample x = runs_to (r, run.t_end);
  double size = 1 + fabs (x.kinetic) + fabs (x.potential) + fabs (x.work) + fabs (x.loss);
  check_below ("balance", fabs (x.balance) / size, 1e6 * H4, "h^4 times a rate");
  assert_int_equal (pw_verify (s, x.t, x.q, x.v, x.a, x.lambda, &off), PW_OK);
  check_below ("verifier, position", off.position.scaled, 1e4 * CHECK_EPS, "round-off of a projected state");
  check_below ("verifier, velocity", off.velocity.scaled, 1e4 * CHECK_EPS, "round-off of a projected state");
  check_below ("verifier, force", off.force.scaled, 1e4 * CHECK_EPS, "round-off of a projected state");
  gallery_close (r, s);
  pw_file_close (f);
  return 0;
}

static void test_defaults (void **state) {
  pw_error error = { 0 };
  (void)state;
  check_ok (pw_file_list (gallery_default, NULL, &error), &error);
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_chaplygin_sleigh),
    cmocka_unit_test (test_knife_edge_incline),
    cmocka_unit_test (test_pendulum),
    cmocka_unit_test (test_n_trailer),
    cmocka_unit_test (test_chain),
    cmocka_unit_test (test_snakeboard),
    cmocka_unit_test (test_roller_racer),
    cmocka_unit_test (test_andrews_squeezer),
    cmocka_unit_test (test_ackermann_car),
    cmocka_unit_test (test_ackermann_angles),
    cmocka_unit_test (test_car_two_trailers),
    cmocka_unit_test (test_peaucellier),
    cmocka_unit_test (test_theo_jansen),
    cmocka_unit_test (test_wheeled_snake),
    cmocka_unit_test (test_car),
    cmocka_unit_test (test_car_tyres),
    cmocka_unit_test (test_differential_drive),
    cmocka_unit_test (test_defaults),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
