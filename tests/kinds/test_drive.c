/* drive: a pendulum with a shaken pivot, a bead moved along a turning rod, a flywheel, initial conditions. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "scene.h"
#include "trial.h"

#define DRIVE_HARMONIC(A, w, p, o)                                                  \
  {                                                                                 \
    PW_HARMONIC, .harmonic = {.amplitude = A, .omega = w, .phase = p, .offset = o } \
  }

/* ---- A pendulum on a shaken cart, against the one equation of its angle th from the vertical ----
 *
 *   (I + m l^2) th'' = -m l (g sin th + X'' cos th),  X = A cos (w t): position of the cart of mass M, and the pivot */

static const struct { double M, m, I, l, g, A, w, th; } drive_p = { 3, 0.8, 0.02, 0.4, 9.81, 0.15, 5, 0.3 };

SCENE (drive_shaken) {
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = drive_p.M, .inertia = 1, .start = { drive_p.A } });
  pw_add_body (m, &(pw_body){ .name = "bob",
                              .mass = drive_p.m,
                              .inertia = drive_p.I,
                              .start = { drive_p.A + drive_p.l * sin (drive_p.th), -drive_p.l * cos (drive_p.th),
                                         drive_p.th } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "cart", "bob" }, .at = { { 0, 0 }, { 0, drive_p.l } } });
  pw_add_drive (m, &(pw_drive){ .name = "shaker",
                                .body = { "cart", "ground" },
                                .what = PW_DRIVE_X,
                                .value = DRIVE_HARMONIC (drive_p.A, drive_p.w, 0, 0) });
  pw_add_drive (m, &(pw_drive){ .name = "rail", .body = { "cart", "ground" }, .what = PW_DRIVE_Y });
  pw_add_drive (m, &(pw_drive){ .name = "guide", .body = { "cart", "ground" }, .what = PW_DRIVE_ANGLE });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -drive_p.g } });
}

/* th'' */
static long double drive_swing (long double t, long double th) {
  long double J = drive_p.I + (long double)drive_p.m * drive_p.l * drive_p.l;
  long double a = -(long double)drive_p.A * drive_p.w * drive_p.w * cosl (drive_p.w * t);
  return -(long double)drive_p.m * drive_p.l * (drive_p.g * sinl (th) + a * cosl (th)) / J;
}

/* The angle and its rate at t_end, by Nystroem's method of order 4 in extended precision. */
static void drive_pendulum (long double t_end, long double *th, long double *w) {
  enum { STEPS = 20000 };
  long double h = t_end / STEPS;
  *th = drive_p.th, *w = 0;
  for (int i = 0; i < STEPS; i++) {
    long double t = i * h, k1 = drive_swing (t, *th), middle = *th + h / 2 * *w + h * h / 8 * k1;
    long double k2 = drive_swing (t + h / 2, middle), k3 = drive_swing (t + h, *th + h * *w + h * h / 2 * k2);
    *th += h * *w + h * h / 6 * (k1 + 2 * k2);
    *w += h / 6 * (k1 + 4 * k2 + k3);
  }
}

static void drive_shake (const char *method, double bound, const char *reason) {
  const double t = 3, l = drive_p.l, m = drive_p.m, w = drive_p.w;
  long double reference, rate;
  drive_pendulum (t, &reference, &rate);
  double th = (double)reference, om = (double)rate, om2 = (double)drive_swing (t, reference);
  double X2 = -drive_p.A * w * w * cos (w * t);
  pw_system *s = scene_system (&drive_shaken_table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .step = 1e-3, .rtol = 1e-10, .span = t, .ledger = 1 });
  pw_sample x = runs_to (r, t);
  check_close ("theta", trial_state (s, &x, "bob.phi"), th, bound, reason);
  check_close ("theta'", trial_state (s, &x, "bob.omega"), om, 10 * bound, reason);
  check_close ("X", trial_state (s, &x, "cart.x"), drive_p.A * cos (w * t), bound, reason);
  check_close ("X'", trial_state (s, &x, "cart.vx"), -drive_p.A * w * sin (w * t), bound, reason);
  check_close ("shaker", trial_reaction (s, &x, "shaker.F"),
               (drive_p.M + m) * X2 + m * l * (om2 * cos (th) - om * om * sin (th)), 1e3 * bound, reason);
  check_close ("rail", trial_reaction (s, &x, "rail.F"),
               (drive_p.M + m) * drive_p.g + m * l * (om2 * sin (th) + om * om * cos (th)), 1e3 * bound, reason);
  check_close ("balance", x.balance, 0, 1e3 * bound, reason);
  assert_true (fabs (x.work) > 0.1);
  runs_close (r, s);
}

TEST (shaken) {
  drive_shake ("rk4+projection", 1e-9, "(h w)^4 at h = 1e-3 and w = 5/s");
  drive_shake ("rk4+baumgarte", 1e-9, "(h w)^4 at h = 1e-3 and w = 5/s");
  drive_shake ("ida+ggl", 1e-6, "1e4 rtol");
  drive_shake ("ida+baumgarte", 1e-6, "1e4 rtol");
}

/* ---- A bead moved along a rod that turns freely at the rate w ----
 *
 * The bead, of mass m and inertia i, is at (x, b) in the frame of the rod, x = r + A sin (s t), b = 0.1 m.
 * L = (I + i + m (x^2 + b^2)) w - m b x' is constant. */

static const struct { double I, m, i, r, A, s, w; } drive_b = { 0.6, 0.5, 0.03, 0.7, 0.3, 4, 2 };

SCENE (drive_bead) {
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 1, .inertia = drive_b.I, .rate = { 0, 0, drive_b.w } });
  pw_add_body (m, &(pw_body){ .name = "bead",
                              .mass = drive_b.m,
                              .inertia = drive_b.i,
                              .start = { drive_b.r, 0.1, 0.5 },
                              .rate = { drive_b.A * drive_b.s - 0.1 * drive_b.w, drive_b.r * drive_b.w, drive_b.w } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "rod", "ground" } });
  pw_add_drive (m, &(pw_drive){ .name = "along",
                                .body = { "bead", "rod" },
                                .at = { { 0, 0 }, { 0.2, 0.1 } },
                                .what = PW_DRIVE_X,
                                .value = DRIVE_HARMONIC (drive_b.A, drive_b.s, -PW_PI / 2, drive_b.r - 0.2) });
  pw_add_drive (
      m,
      &(pw_drive){ .name = "aside", .body = { "bead", "rod" }, .at = { { 0, 0 }, { 0.2, 0.1 } }, .what = PW_DRIVE_Y });
  pw_add_drive (
      m,
      &(pw_drive){ .name = "turn", .body = { "bead", "rod" }, .what = PW_DRIVE_ANGLE, .value = { .constant = 0.5 } });
}

TEST (bead) {
  pw_system *s = scene_system (&drive_bead_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  check_below ("start", pw_run_initial (r)->velocity, 16 * CHECK_EPS, "given consistently");
  double b2 = 0.1 * 0.1, J0 = drive_b.I + drive_b.i + drive_b.m * (drive_b.r * drive_b.r + b2);
  double L = J0 * drive_b.w + drive_b.m * -0.1 * drive_b.A * drive_b.s;
  for (int i = 1; i <= 10; i++) {
    double t = 0.3 * i, x0 = drive_b.r + drive_b.A * sin (drive_b.s * t),
           v0 = drive_b.A * drive_b.s * cos (drive_b.s * t);
    pw_sample x = runs_to (r, t);
    double w = (L + drive_b.m * 0.1 * v0) / (drive_b.I + drive_b.i + drive_b.m * (x0 * x0 + b2));
    check_close ("rod", trial_state (s, &x, "rod.omega"), w, 1e-9, "(h w)^4 at h = 1e-3 and w = 4/s");
    check_close ("distance", hypot (x.q[3], x.q[4]), hypot (x0, 0.1), 1e-12, "the constraint");
    check_close ("angle", x.q[5] - x.q[2], 0.5, 1e-12, "the constraint");
    /* m (x'' - w^2 x - w' b) is the force along the rod; w' from L' = 0 */
    double a0 = -drive_b.A * drive_b.s * drive_b.s * sin (drive_b.s * t),
           J = drive_b.I + drive_b.i + drive_b.m * (x0 * x0 + b2);
    double w1 = (drive_b.m * 0.1 * a0 - 2 * drive_b.m * x0 * v0 * w) / J;
    check_close ("along", trial_reaction (s, &x, "along.F"), drive_b.m * (a0 - w * w * x0 - w1 * 0.1), 1e-8,
                 "10 (h w)^4 at h = 1e-3 and w = 4/s");
    check_close ("aside", trial_reaction (s, &x, "aside.F"), drive_b.m * (w1 * x0 + 2 * w * v0 - w * w * 0.1), 1e-8,
                 "10 (h w)^4 at h = 1e-3 and w = 4/s");
    check_close ("balance", x.balance, 0, 1e-9, "(h w)^4");
  }
  runs_close (r, s);
}

/* ---- A flywheel driven relative to a free platform: the sum of their angular momenta is 0 ---- */

SCENE (drive_flywheel) {
  pw_add_body (m, &(pw_body){ .name = "flywheel", .mass = 1, .inertia = 0.2, .start = { 0.3 } });
  pw_add_body (m, &(pw_body){ .name = "platform", .mass = 4, .inertia = 0.6, .start = { 0.3 } });
  pw_add_pin (m, &(pw_pin){ .name = "axle", .body = { "flywheel", "platform" } });
  pw_add_drive (m, &(pw_drive){ .name = "motor",
                                .body = { "flywheel", "platform" },
                                .what = PW_DRIVE_ANGLE,
                                .value = DRIVE_HARMONIC (-3, 2, 0, 3) });
}

TEST (flywheel) {
  pw_system *s = scene_system (&drive_flywheel_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .ledger = 1 });
  pw_sample x = runs_to (r, 1.3);
  double angle = 3 - 3 * cos (2.6), bound = 1e-11;
  const char *reason = "(h w)^4 at h = 1e-3 and w = 2/s";
  check_close ("flywheel", x.q[2], angle * 0.6 / 0.8, bound, reason);
  check_close ("platform", x.q[5], -angle * 0.2 / 0.8, bound, reason);
  for (int row = 0; row < pw_system_rows (s); row++) {
    char name[40];
    int moment = strcmp (pw_system_reaction_name (s, row, name, sizeof name), "motor.F") == 0;
    assert_string_equal (pw_system_reaction_unit (s, row), moment ? "N m" : "N");
  }
  check_close ("moment", trial_reaction (s, &x, "motor.F"), 0.2 * 12 * cos (2.6) * 0.6 / 0.8, bound, reason);
  check_close ("work", x.work, x.kinetic, bound, reason);
  runs_close (r, s);
}

/* ---- Initial states, invalid signals ---- */

/* A run that begins at t = 0.7 s has the drive's position and velocity at that time. */
TEST (start) {
  pw_system *s = scene_system (&drive_shaken_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .t = 0.7 });
  pw_sample x = runs_to (r, 0.7);
  double bound = 64 * CHECK_EPS;
  check_close ("X", x.q[0], drive_p.A * cos (drive_p.w * 0.7), bound, "the constraint");
  check_close ("X'", x.v[0], -drive_p.A * drive_p.w * sin (drive_p.w * 0.7), bound, "the constraint");
  runs_close (r, s);
}

static int drive_follow (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t, (void)gradient;
  value[0] = x[0];
  return 0;
}

TEST (refused) {
  static const char *const reads[] = { "bob.phi", NULL };
  pw_error error = { 0 };
  pw_signal follow = { PW_FUNCTION, .function = { .eval = drive_follow, .reads = reads } };
  pw_model *m = scene_model (&drive_shaken_table, NULL);
  check_ok (pw_model_set_signal (m, "shaker", "value", &follow, &error), &error);
  scene_refused (m, "model scene: drive shaker: value: the signal of this constraint may depend on the time only");
}

TEST (methods) {
  trial (&drive_shaken_table, 2);
  trial (&drive_bead_table, 2);
}
