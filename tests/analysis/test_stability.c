/* Exponents of perturbations of steady motions, compared with closed forms and perturbed runs; unsteady motions are
 * reported. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

static pw_linear stability_of (const pw_plugin_table *table) {
  const pw_settings settings = { .span = 10 };
  pw_error error = { 0 };
  pw_linear l;
  pw_system *s = scene_system (table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &settings);
  check_ok (pw_run_linearise (r, 100, &l, &error), &error);
  for (int i = 1; i < l.unknowns; i++) assert_true (l.re[i] <= l.re[i - 1]);
  pw_run_close (r);
  pw_system_free (s);
  return l;
}

/* An eigenvalue that is not a rigid displacement, and its conjugate, are found. */
static void stability_has (const pw_linear *l, double re, double im, double bound, const char *reason) {
  double nearest = INFINITY, other = INFINITY;
  for (int i = 0; i < l->unknowns; i++) {
    if (l->rigid[i]) continue;
    nearest = fmin (nearest, hypot (l->re[i] - re, l->im[i] - im));
    other = fmin (other, hypot (l->re[i] - re, l->im[i] + im));
  }
  check_below ("eigenvalue", nearest, bound, reason);
  check_below ("conjugate", other, bound, reason);
}

/* |w| from the eigenvalues +-i w of translations of the whole in a frame that turns at the rate w. */
static double stability_turn (const pw_linear *l) {
  double squares = 0;
  for (int i = 0; i < l->unknowns; i++) squares += l->rigid[i] * l->im[i] * l->im[i];
  return sqrt (squares / 2);
}

static int stability_zeros (const pw_linear *l) {
  int zeros = 0;
  for (int i = 0; i < l->unknowns; i++) zeros += l->re[i] == 0 && l->im[i] == 0 && !l->rigid[i];
  return zeros;
}

/* ---- A tractor with prescribed speed and turn rate, and trailers hitched on axles: -w R_i / L_i, straight -u /
 * L_i ---- */

enum { WHEEL, TWINS, ROLLING, LIGHT };

static struct {
  double u, w, L[3];
  int axle;
} train;

/* An axle as a knife edge, as two (one is redundant), or as two rolling wheels, which have spin angles. */
static void stability_axle (pw_model *m, const char *body, int i) {
  char name[2][20];
  for (int side = 0; side < (train.axle == TWINS || train.axle == ROLLING ? 2 : 1); side++) {
    double at = train.axle == TWINS || train.axle == ROLLING ? 0.4 - 0.8 * side : 0;
    snprintf (name[side], sizeof name[side], "%c%d", "AB"[side], i);
    if (train.axle == ROLLING)
      pw_add_rolling_wheel (
          m, &(pw_rolling_wheel){ .name = name[side], .body = body, .at = { 0, at }, .radius = 0.3, .inertia = 0.02 });
    else
      pw_add_wheel (m, &(pw_wheel){ .name = name[side], .body = body, .at = { 0, at } });
  }
}

/* With LIGHT trailers, the mass is in a load welded to each axle. */
static void stability_vehicle (pw_model *m, int i, const double start[3]) {
  double w = train.w, R = w != 0 ? train.u / w : 0;
  char name[20], load[20], weld[20];
  int light = train.axle == LIGHT && i > 0;
  pw_body body = { .name = name, .mass = light ? 0 : 1.3, .inertia = light ? 0 : 0.2 };
  snprintf (name, sizeof name, "body%d", i);
  memcpy (body.start, start, sizeof body.start);
  body.rate[0] = w != 0 ? -w * (start[1] - R) : train.u, body.rate[1] = w * start[0], body.rate[2] = w;
  pw_add_body (m, &body);
  stability_axle (m, name, i);
  if (!light) return;
  snprintf (load, sizeof load, "load%d", i), snprintf (weld, sizeof weld, "weld%d", i);
  body.name = load, body.mass = 1.3, body.inertia = 0.2;
  pw_add_body (m, &body);
  pw_add_weld (m, &(pw_weld){ .name = weld, .body = { name, load } });
}

SCENE (stability_train) {
  double R = train.w != 0 ? train.u / train.w : 0, turned = -PW_PI / 2, x = 0, radius = R;
  char hitch[20], body[2][20];
  for (int i = 0; i < 4; i++) {
    if (i > 0 && train.w == 0) x -= train.L[i - 1];
    if (i > 0 && train.w != 0) {
      radius = sqrt (radius * radius - train.L[i - 1] * train.L[i - 1]);
      turned -= atan2 (train.L[i - 1], radius);
    }
    double start[3] = { x, 0, 0 };
    if (train.w != 0)
      start[0] = radius * cos (turned), start[1] = R + radius * sin (turned), start[2] = turned + PW_PI / 2;
    stability_vehicle (m, i, start);
    if (i == 0) continue;
    snprintf (hitch, sizeof hitch, "hitch%d", i);
    snprintf (body[0], sizeof body[0], "body%d", i), snprintf (body[1], sizeof body[1], "body%d", i - 1);
    pw_add_pin (m, &(pw_pin){ .name = hitch, .body = { body[0], body[1] }, .at = { { train.L[i - 1], 0 } } });
  }
  pw_add_speed (m, &(pw_speed){ .name = "drive", .body = "body0", .value = { .constant = train.u } });
  pw_add_speed (
      m, &(pw_speed){
             .name = "turn", .body = "body0", .at = { 1, 0 }, .heading = PW_PI / 2, .value = { .constant = train.w } });
}

TEST (trailers) {
  static const double motion[][2] = { { 2, 0 }, { -2, 0 }, { 3, 0.5 }, { 3, 1e-3 }, { 0.02, 0.004 } };
  for (size_t k = 0; k < sizeof motion / sizeof *motion; k++)
    for (train.axle = WHEEL; train.axle <= LIGHT; train.axle++) {
      double L[3] = { 0.6, 0.8, 2.5 }, u = motion[k][0], w = motion[k][1], R = w != 0 ? u / w : 0;
      train.u = u, train.w = w;
      memcpy (train.L, L, sizeof L);
      pw_linear l = stability_of (&stability_train_table);
      assert_int_equal (l.steady, PW_STEADY);
      assert_int_equal (l.symmetries, 3);
      check_close ("rate of turn", l.twist[2], w, 1e-12 * fabs (w), "round-off");
      check_close ("translations", stability_turn (&l), fabs (w), 1e-12 * fabs (w), "round-off");
      for (int i = 0; i < 3; i++) {
        if (w != 0) R = sqrt (R * R - L[i] * L[i]);
        stability_has (&l, w != 0 ? -w * R / L[i] : -u / L[i], 0, 1e-9 * fabs (u),
                       "exact derivatives; redundant rows cost digits");
      }
      assert_int_equal (stability_zeros (&l), train.axle == ROLLING ? 8 : 0);
      pw_linear_free (&l);
    }
}

/* Trailers of equal length, straight ahead: a defective eigenvalue, which round-off would split. */
TEST (defective) {
  train.axle = WHEEL, train.u = 2, train.w = 0;
  for (int i = 0; i < 3; i++) train.L[i] = 2;
  pw_linear l = stability_of (&stability_train_table);
  for (int i = 3; i < 6; i++) {
    check_close ("re", l.re[i], -1, 1e-4, "a Jordan block of three: eps^(1/3)");
    assert_true (l.im[i] == 0);
  }
  pw_linear_free (&l);
}

/* ---- The Chaplygin sleigh, free: -m a u / J, J = I + m a^2, with the blade a behind the centre of mass ---- */

static double sleigh;

SCENE (stability_sleigh) {
  pw_add_body (m, &(pw_body){ .name = "sleigh",
                              .mass = 3,
                              .inertia = 0.5,
                              .start = { 1e5, -2e5, 0.4 },
                              .rate = { 2 * cos (0.4), 2 * sin (0.4), 0 } });
  pw_add_wheel (m, &(pw_wheel){ .name = "blade", .body = "sleigh", .at = { -sleigh, 0 } });
}

TEST (sleigh) {
  for (int side = -1; side <= 1; side += 2) {
    sleigh = 0.2 * side;
    pw_linear l = stability_of (&stability_sleigh_table);
    assert_int_equal (l.steady, PW_STEADY);
    assert_int_equal (l.symmetries, 3);
    assert_int_equal (stability_zeros (&l), 1);
    stability_has (&l, -3 * sleigh * 2 / (0.5 + 3 * 0.04), 0, 1e-12, "1e4 eps");
    pw_linear_free (&l);
  }
}

/* ---- A car as a single track with linear tyres ---- */

static const double car_m = 1500, car_I = 2500, car_a = 1.6, car_b = 1, car_C = 40000;
static double car_v;

SCENE (stability_car) {
  pw_add_body (m, &(pw_body){ .name = "car", .mass = car_m, .inertia = car_I, .rate = { car_v, 0, 0 } });
  pw_add_tyre (m, &(pw_tyre){ .name = "front", .body = "car", .at = { car_a, 0 }, .stiffness = car_C, .speed = 1e-3 });
  pw_add_tyre (m, &(pw_tyre){ .name = "rear", .body = "car", .at = { -car_b, 0 }, .stiffness = car_C, .speed = 1e-3 });
}

/* Sideslip and yaw: the eigenvalues of a 2 x 2 matrix.  The tyre's regularising speed changes them by (1e-3 / v)^2 =
 * 4e-9. */
TEST (car) {
  double L = car_a + car_b, moment = car_C * (car_a - car_b);
  double critical = sqrt (car_C * car_C * L * L / (car_m * moment));
  for (int k = -1; k <= 1; k++) {
    double v = car_v = critical * (1 + 0.1 * k), a = -2 * car_C / (car_m * v), b = -moment / (car_m * v) - v;
    double c = -moment / (car_I * v), d = -car_C * (car_a * car_a + car_b * car_b) / (car_I * v);
    double half = (a + d) / 2, root = sqrt (half * half - a * d + b * c);
    pw_linear l = stability_of (&stability_car_table);
    assert_int_equal (l.steady, PW_STEADY);
    assert_int_equal (l.symmetries, 3);
    stability_has (&l, half + root, 0, 1e-7, "10 times the change by the regularising speed");
    stability_has (&l, half - root, 0, 1e-7, "10 times the change by the regularising speed");
    if (k != 0) assert_int_equal (l.re[0] > 0, k > 0);
    pw_linear_free (&l);
  }
}

/* ---- Symmetries and elements that break them; unsteady motions ---- */

static struct {
  int pinned, gravity, spring, torque, drag;
  double phi, v, omega;
} scene;

/* A torque that depends on the position of the body. */
static int stability_reader (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = -2 * x[0];
  if (gradient) gradient[0] = -2;
  return 0;
}

/* The same with a time-dependent stiffness: at phi = 0 there is no acceleration (Mathieu's equation). */
static int stability_mathieu (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context;
  value[0] = -(2 + sin (t)) * x[0];
  if (gradient) gradient[0] = -(2 + sin (t));
  return 0;
}

static const char *const stability_reads[] = { "body.phi", NULL };
static const pw_signal stability_torques[] = {
  { .constant = 0 },
  { PW_HARMONIC, .harmonic = { 1, 3, -PW_PI / 2, 0 } },
  { PW_SMOOTH_STEP, .ramp = { .from = 0, .to = 1, .start = 3, .duration = 1 } },
  { PW_FUNCTION, .function = { .eval = stability_reader, .reads = stability_reads } },
  { PW_FUNCTION, .function = { .eval = stability_mathieu, .reads = stability_reads } },
  { PW_PULSE, .pulse = { .height = 100, .start = 7.0003, .width = 0.01 } },
};

SCENE (stability_scene) {
  pw_add_body (m, &(pw_body){ .name = "body",
                              .mass = 2,
                              .inertia = 2,
                              .start = { 3 + 0.7 * cos (scene.phi), 4 + 0.7 * sin (scene.phi), scene.phi },
                              .rate = { -0.7 * scene.omega * sin (scene.phi),
                                        0.7 * scene.omega * cos (scene.phi) + scene.v, scene.omega } });
  if (scene.pinned)
    pw_add_pin (m, &(pw_pin){ .name = "pin", .body = { "body", "ground" }, .at = { { -0.7, 0 }, { 3, 4 } } });
  if (scene.gravity) pw_add_gravity (m, &(pw_gravity){ .name = "gravity", .acceleration = { 0, -9.81 } });
  if (scene.drag) pw_add_drag (m, &(pw_drag){ .name = "drag", .body = "body", .linear = 4, .turning = 1 });
  if (scene.spring)
    pw_add_spring (
        m,
        &(pw_spring){ .name = "spring", .body = { "body", "ground" }, .at = { { 0, 0 }, { 3, 7 } }, .stiffness = 5 });
  if (scene.torque)
    pw_add_torque (
        m, &(pw_torque){ .name = "torque", .body = { "body", "ground" }, .value = stability_torques[scene.torque] });
}

TEST (scenes) {
  const double J = 2 + 2 * 0.49, g = 9.81;
  const struct {
    int pinned, gravity, spring, torque, drag;
    double phi, v, omega;
    pw_steadiness steady;
    int symmetries;
    double square; /* square of the fastest eigenvalue: negative for a frequency, positive for growth */
  } each[] = {
    { .phi = 0.3, .v = 2, .steady = PW_STEADY, .symmetries = 3 },
    { .pinned = 1, .phi = 0.3, .omega = 5, .steady = PW_STEADY, .symmetries = 1 },
    { .pinned = 1, .gravity = 1, .phi = PW_PI / 2, .steady = PW_STEADY, .square = 2 * g * 0.7 / J },
    { .pinned = 1, .gravity = 1, .phi = -PW_PI / 2, .steady = PW_STEADY, .square = -2 * g * 0.7 / J },
    { .pinned = 1, .gravity = 1, .phi = 0.3, .steady = PW_ACCELERATED },
    { .pinned = 1, .gravity = 1, .drag = 1, .phi = -PW_PI / 2, .omega = 1e-3, .steady = PW_ACCELERATED },
    { .gravity = 1, .drag = 1, .phi = 0.3, .v = -g * 2 / 4, .steady = PW_STEADY, .symmetries = 2 },
    { .gravity = 1, .phi = 0.3, .steady = PW_ACCELERATED, .symmetries = 2 },
    { .pinned = 1, .spring = 1, .phi = PW_PI / 2, .steady = PW_STEADY, .square = -5 * 3 * 0.7 / J },
    { .torque = 1, .phi = 0.3, .v = 2, .steady = PW_CHANGING, .symmetries = 3 },
    { .torque = 2, .phi = 0.3, .v = 2, .steady = PW_CHANGING, .symmetries = 3 },
    { .pinned = 1, .torque = 3, .phi = 0, .steady = PW_STEADY, .square = -2 / J },
    { .pinned = 1, .torque = 4, .phi = 0, .steady = PW_CHANGING, .square = -2 / J },
    { .torque = 5, .phi = 0.3, .v = 2, .steady = PW_CHANGING, .symmetries = 3 },
    { .torque = 3, .phi = 0, .v = 1, .steady = PW_STEADY, .symmetries = 2, .square = -1 },
  };
  for (size_t i = 0; i < sizeof each / sizeof *each; i++) {
    scene.pinned = each[i].pinned, scene.gravity = each[i].gravity, scene.spring = each[i].spring;
    scene.torque = each[i].torque, scene.drag = each[i].drag;
    scene.phi = each[i].phi, scene.v = each[i].v, scene.omega = each[i].omega;
    pw_linear l = stability_of (&stability_scene_table);
    if ((int)l.steady != (int)each[i].steady || l.symmetries != each[i].symmetries)
      fail_msg ("scene %zu: steady %d, %d symmetries", i, l.steady, l.symmetries);
    double s = sqrt (fabs (each[i].square));
    if (s > 0) stability_has (&l, each[i].square > 0 ? s : 0, each[i].square > 0 ? 0 : s, 1e-9, "1e7 eps");
    pw_linear_free (&l);
  }
}

/* ---- n-trailer, perturbed: two hinges, which come to rest with two exponents ---- */

/* The angles of both hinges at equal time intervals; they determine the positions of the trailers. */
static void stability_hinges (double disturbance, double out[2][5]) {
  const pw_settings settings = { .rtol = 1e-12 };
  pw_error error = { 0 };
  pw_system *s = scene_named ("n-trailer", NULL, 0);
  (void)error;
  double q[9], v[9];
  for (int k = 0; k < 5; k++) {
    pw_run *r = runs_open (s, "erk8+projection", &settings);
    const pw_initial_report *start = pw_run_initial (r);
    memcpy (q, start->q, sizeof q);
    memcpy (v, start->v, sizeof v);
    q[8] += disturbance;
    check_ok (pw_run_restart (r, q, v, &error), &error);
    pw_sample x = runs_to (r, 0.2 + 0.3 * k);
    for (int i = 0; i < 2; i++) out[i][k] = x.q[3 * i + 5] - x.q[3 * i + 2];
    pw_run_close (r);
  }
  pw_system_free (s);
}

/* Differences of runs with opposite perturbations satisfy d'' - s d' + p d = 0 over equal time intervals, with s
 * and p the sum and the product of both exponentials; permanent changes cancel in the differences (Prony 1795). */
TEST (disturbed) {
  double up[2][5], down[2][5], d[2][4];
  pw_error error = { 0 };
  pw_linear l;
  stability_hinges (1e-4, up);
  stability_hinges (-1e-4, down);
  for (int i = 0; i < 2; i++)
    for (int k = 0; k < 4; k++) d[i][k] = up[i][k + 1] - up[i][k] - down[i][k + 1] + down[i][k];
  double det = d[0][1] * d[1][0] - d[1][1] * d[0][0];
  double sum = (d[0][2] * d[1][0] - d[1][2] * d[0][0]) / det, product = -(d[0][1] * d[1][2] - d[1][1] * d[0][2]) / det;
  double root = sqrt (sum * sum / 4 - product);
  pw_system *s = scene_named ("n-trailer", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  check_ok (pw_run_linearise (r, 100, &l, &error), &error);
  assert_int_equal (l.steady, PW_STEADY);
  assert_int_equal (stability_zeros (&l), 2);
  stability_has (&l, log (sum / 2 + root) / 0.3, 0, 1e-5,
                 "third order of the disturbance, 1e-8, over what is left of it");
  stability_has (&l, log (sum / 2 - root) / 0.3, 0, 1e-5, "the same");
  pw_linear_free (&l);
  pw_run_close (r);
  pw_system_free (s);
}
