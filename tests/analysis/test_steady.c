/* Steady motions with closed forms: found, followed, and their stability. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "gallery.h"
#include "runs.h"
#include "scene.h"
#include "steady_case.h"
#include "search.h"

static int held (const pw_system *s, const char *name) {
  pw_error error = { 0 };
  int i = pw_system_find_held (s, name, &error);
  if (i < 0) check_ok (i, &error);
  return i;
}

static void steady_hold (steady *t, const char *name, double value) {
  t->hold[t->set.holds++] = (pw_initial_value){ held (t->s, name), value };
}

static double value_of (const steady *t, const char *name, const pw_steady_motion *m) {
  return pw_system_held_value (t->s, held (t->s, name), m->q, m->v);
}

/* ---- Trailers ---- */

/* From a turn of another radius and speed: R_i^2 = R_(i-1)^2 - L_i^2. */
TEST (turn) {
  const double L[] = { 0.6, 0.8 };
  double R = 2, w = 1.5;
  steady t = { .s = gallery_open ("n-trailer", "w", 0.7, "R", 5., NULL), .set.vary = -1 };
  steady_hold (&t, "tractor.omega", w);
  steady_hold (&t, "tractor.radius", R);
  steady_open (&t);
  assert_int_equal (pw_steady_symmetries (t.x), 3);
  pw_steady_motion m = steady_solve (&t, 0, 0);
  assert_int_equal (m.family, 0);
  assert_int_equal (m.unstable, 0);
  assert_int_equal (m.linear->steady, PW_STEADY);
  for (int i = 0; i < 2; i++) {
    R = sqrt (R * R - L[i] * L[i]);
    check_close ("radius", value_of (&t, i ? "trailer2.radius" : "trailer1.radius", &m), R, 1e-12,
                 "Newton to round-off");
  }
  check_close ("x", m.q[0], pw_system_initial_q (t.s)[0], 1e-14, "displaced back to where it was");
  steady_close (&t);
}

/* Straight ahead hinges decay at u / L_i, backwards they grow. */
TEST (straight) {
  for (double u = -3; u < 4; u += 6) {
    steady t = { .s = gallery_open ("n-trailer", "R", 5., NULL), .set.vary = -1 };
    steady_hold (&t, "tractor.speed", u);
    steady_hold (&t, "trailer1.curvature", 0);
    steady_open (&t);
    pw_steady_motion m = steady_solve (&t, 0, 0);
    assert_int_equal (m.unstable, u < 0 ? 2 : 0);
    steady_expect (m.linear, -u / 0.6, 0);
    steady_expect (m.linear, -u / 0.8, 0);
    steady_close (&t);
  }
}

/* Each trailer is stable or folded back: four motions, with 0, 1, 1, 2 growing modes. */
TEST (folded) {
  int found[2][2] = { { 0 } };
  steady t = { .s = gallery_open ("n-trailer", NULL), .set.vary = -1 };
  steady_hold (&t, "tractor.speed", 2);
  steady_hold (&t, "tractor.radius", 2);
  steady_open (&t);
  for (int k = 0; k <= 30; k++) {
    pw_steady_motion m;
    pw_error error = { 0 };
    int status = pw_steady_solve (t.x, k, 0, &m, &error);
    if (status == PW_RETRY) continue;
    check_ok (status, &error);
    double r1 = value_of (&t, "trailer1.radius", &m), r2 = value_of (&t, "trailer2.radius", &m);
    check_close ("R1", fabs (r1), 1.90787840283389, 1e-9, "references");
    check_close ("R2", fabs (r2), 1.73205080756888, 1e-9, "references");
    assert_int_equal (m.unstable, (r1 < 0) + (r2 < 0));
    found[r1 < 0][r2 < 0] = 1;
  }
  for (int i = 0; i < 4; i++) assert_true (found[i / 2][i % 2]);
  steady_close (&t);
}

/* Speed and turn rate are free: the nearest motion is that of the model, and both are suggested, with their values. */
TEST (family) {
  pw_initial_value more[4];
  steady t = { .s = gallery_open ("n-trailer", NULL), .set.vary = -1 };
  steady_open (&t);
  pw_steady_motion m = steady_solve (&t, 0, 0);
  assert_int_equal (m.family, 2);
  check_close ("omega", value_of (&t, "tractor.omega", &m), 1, 1e-14, "the initial state is steady");
  assert_int_equal (pw_steady_suggest (t.x, more, 4), 2);
  assert_int_equal (more[0].state, held (t.s, "tractor.speed"));
  assert_int_equal (more[1].state, held (t.s, "tractor.omega"));
  check_close ("speed", more[0].value, 2, 1e-14, "the initial state is steady");
  steady_close (&t);
}

/* Derivatives of what is held by the state, against central differences. */
TEST (held) {
  static const char *const names[] = { "trailer1.speed", "trailer1.radius", "trailer1.curvature", "trailer1.vx" };
  const double step = 1e-6;
  double dq[9], dv[9], r[2];
  steady t = { .s = gallery_open ("n-trailer", NULL), .set.vary = -1 };
  steady_open (&t);
  pw_steady *x = t.x;
  for (int j = 0; j < 9; j++) dq[j] = cos (3 * j), dv[j] = sin (4 * j + 1);
  for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
    pw_initial_value hold = { held (t.s, names[k]), 0.7 };
    for (int side = 0; side < 3; side++) {
      double h = side < 2 ? (2 * side - 1) * step : 0;
      for (int j = 0; j < 9; j++) x->q[j] = sin (j) + h * dq[j], x->v[j] = cos (2 * j) + h * dv[j];
      if (side < 2) r[side] = pw_hold_residual (x, &hold, NULL, NULL); /* last, the state itself */
    }
    check_close (names[k], pw_hold_residual (x, &hold, dq, dv), (r[1] - r[0]) / (2 * step), 1e-9, "differences");
  }
  steady_close (&t);
}

/* Mirrored turns differ; displaced ones do not. */
TEST (same) {
  double q[9], v[9], other[9], turned[9], c = cos (1.2), s = sin (1.2);
  steady t = { .s = gallery_open ("n-trailer", NULL), .set.vary = -1 };
  steady_open (&t);
  pw_steady_motion m = steady_solve (&t, 0, 0);
  memcpy (q, m.q, sizeof q), memcpy (v, m.v, sizeof v);
  for (int j = 0; j < 9; j += 3) {
    other[j] = 5 + c * q[j] - s * q[j + 1], other[j + 1] = -3 + s * q[j] + c * q[j + 1], other[j + 2] = q[j + 2] + 1.2;
    turned[j] = c * v[j] - s * v[j + 1], turned[j + 1] = s * v[j] + c * v[j + 1], turned[j + 2] = v[j + 2];
  }
  assert_true (pw_steady_same (t.x, q, v, other, turned));
  other[8] -= 2 * PW_PI;
  assert_true (pw_steady_same (t.x, q, v, other, turned));
  other[8] += 1e-3;
  assert_false (pw_steady_same (t.x, q, v, other, turned));
  steady_close (&t);
}

/* ---- A car on tyres ---- */

/* In a turn so slight that it is linear: u / (L + K u^2) per steering angle, with the understeer gradient
 * K = m (b Cr - a Cf) / (L Cf Cr). */
TEST (understeer) {
  double C = 8e4, a = 1.2, b = 1.4, L = a + b, u = 30, steer = 1e-5, K = 1000 * (b * C - a * C) / (L * C * C);
  steady t = { .s = gallery_open ("car-tyres", "steer", steer, "u", u, NULL), .set.vary = -1 };
  steady_open (&t);
  pw_steady_motion m = steady_solve (&t, 0, 0);
  check_close ("yaw rate gain", value_of (&t, "car.omega", &m) / steer, u / (L + K * u * u), 1e-6,
               "relative 1e-7: the tyre's speed constant; steer^2");
  steady_close (&t);
}

static pw_system *car_at (void *context, double u, pw_error *error) {
  (void)context, (void)error;
  return gallery_open ("car-tyres", "steer", 0., "a", 1.4, "b", 1.2, "u", u, NULL);
}

/* v sqrt (v^2 + s^2) = L^2 Cf Cr / (m (Cf a - Cr b)) = 52^2, with the tyre's speed constant s = 0.01 m/s. */
TEST (critical_speed) {
  double s2 = 1e-4, exact = sqrt ((sqrt (s2 * s2 + 4 * pow (52, 4)) - s2) / 2);
  steady t = { .s = car_at (NULL, 20, NULL), .set = { .vary = -1, .compile = car_at, .first = 20, .last = 60 } };
  steady_open (&t);
  pw_steady_motion m = steady_solve (&t, 0, 20);
  assert_int_equal (m.unstable, 0);
  branch_events e = steady_follow (&t, &m, 1);
  assert_int_equal (e.count[PW_STEADY_REAL], 1);
  assert_int_equal (e.count[PW_STEADY_FOLD] + e.count[PW_STEADY_OSCILLATION], 0);
  assert_true (e.count[PW_STEADY_POINT] >= 50);
  check_close ("critical speed", e.at[PW_STEADY_REAL][0], exact, 1e-8, "located to 1e-9 of a step of 0.8 m/s");
  steady_close (&t);
}

/* ---- Refusals ---- */

TEST (refused) {
  pw_error error = { 0 };
  pw_steady_motion m;
  pw_system *s = gallery_open ("snakeboard", NULL);
  for (int k = 0; k < 2; k++) { /* 0: the default span */
    const pw_steady_settings set = { .vary = -1, .span = 10 * k };
    error = (pw_error){ 0 };
    assert_null (pw_steady_open (s, &set, &error));
    check_error (&error, PW_INPUT,
                 "model snakeboard: signal swing.value changes with time, so that there are no steady motions; "
                 "`pinwheel periodic` finds periodic ones");
  }
  pw_system_free (s);
  error = (pw_error){ 0 };
  steady t = { .s = gallery_open ("theo-jansen", NULL), .set.vary = -1 };
  steady_open (&t);
  assert_int_equal (pw_steady_solve (t.x, 0, 0, &m, &error), PW_RETRY);
  assert_int_equal (error.status, PW_OK);
  assert_true (m.residual > 0.1 && m.linear == NULL);
  steady_close (&t);
}

/* A constant value; what it stores as derivatives is meaningless for a force. */
static int constant_value (void *context, double t, const double *x, double *value, double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = 1, value[1] = t, value[2] = t;
  return 0;
}

SCENE (pushed) {
  pw_add_body (m, &(pw_body){ .name = "a", .mass = 1, .inertia = 1 });
  pw_add_spring (m, &(pw_spring){ .name = "s", .body = { "a", "ground" }, .stiffness = 1 });
  pw_add_torque (m, &(pw_torque){ .name = "T",
                                  .body = { "a", "ground" },
                                  .value = { PW_FUNCTION, .function = { .eval = constant_value } } });
}

TEST (constant) {
  pw_error error = { 0 };
  const double zero[3] = { 0 };
  steady t = { .s = scene_system (&pushed_table, NULL), .set.vary = -1 };
  steady_open (&t);
  assert_int_equal (pw_steady_follow (t.x, zero, zero, 0, 1, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "first = last = 0: expected a range");
  steady_close (&t);
}

static pw_system *trailers_at (void *context, double n, pw_error *error) {
  (void)context;
  if (n != floor (n)) return pw_fail (error, PW_INPUT, "%g trailers", n), NULL;
  return gallery_open ("n-trailer", "n", n, NULL);
}

TEST (bodies) {
  pw_error error = { 0 };
  pw_steady_motion m;
  steady t = { .s = trailers_at (NULL, 2, NULL), .set = { .vary = -1, .compile = trailers_at, .first = 2, .last = 4 } };
  steady_open (&t);
  assert_int_equal (pw_steady_solve (t.x, 0, 3, &m, &error), PW_INPUT);
  check_error (&error, PW_INPUT, "model n-trailer: the parameter changes the number of bodies or constraint equations");
  steady_close (&t);
}

/* ---- Discs on a fixed axis ---- */

typedef struct {
  double count, pinned, k; /* k: stiffness of the spring between the first disc and the ground */
} discs;

static const pw_parameter discs_parameters[] = { { PW_AT (discs, count), 1, "", "", PW_COUNT },
                                                 { PW_AT (discs, pinned), 1, "", "", PW_REAL },
                                                 { PW_AT (discs, k), 0, "N m/rad", "", PW_REAL },
                                                 { .name = NULL } };

SCENE_WITH (discs_build, discs_parameters, discs) {
  static const char *const name[] = { "one", "two" };
  for (int i = 0; i < p->count; i++) {
    pw_add_body (m, &(pw_body){ .name = name[i], .mass = 1, .inertia = 1 });
    if (p->pinned != 0) pw_add_pin (m, &(pw_pin){ .name = i ? "pin2" : "pin1", .body = { name[i], "ground" } });
  }
  if (p->k > 0)
    pw_add_rotational_spring (
        m, &(pw_rotational_spring){ .name = "spring", .body = { "one", "ground" }, .stiffness = p->k });
}

/* A rotation of the whole about the axis less those of the discs displaces nothing and is no symmetry.  Symmetries: the
 * angle of each disc without a spring; x, y and the angle of a free disc. */
TEST (concentric) {
  static const struct {
    double count, pinned, k;
    int symmetries;
  } scene[] = { { 1, 1, 3, 0 }, { 1, 1, 0, 1 }, { 2, 1, 3, 1 }, { 2, 1, 0, 2 }, { 1, 0, 0, 3 } };
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    steady t = { .s = scene_system (&discs_build_table, "count", scene[i].count, "pinned", scene[i].pinned, "k",
                                    scene[i].k, NULL),
                 .set.vary = -1 };
    steady_open (&t);
    assert_int_equal (pw_steady_symmetries (t.x), scene[i].symmetries);
    steady_close (&t);
  }
}

/* Settings and arguments out of range are named. */
TEST (settings) {
  static const pw_initial_value beyond = { 9, 0 }, below = { -5, 0 }, undefined = { 0, NAN }, fixed = { 2, 0 };
  static const struct {
    pw_steady_settings set;
    const char *text;
  } wrong[] = {
    { { .hold = &beyond, .holds = 1 }, "setting hold: quantity 9 = 0: expected one from 0 to 8 and a finite value" },
    { { .hold = &below, .holds = 1 }, "setting hold: quantity -5 = 0: expected one from 0 to 8 and a finite value" },
    { { .hold = &undefined, .holds = 1 }, "setting hold: quantity 0 = nan: expected one from 0 to 8 and a finite" },
    { { .holds = 1 }, "setting holds = 1: expected the number of entries of `hold`" },
    { { .vary = 0 }, "setting vary = 0: expected -1 or an index of `hold`, below holds = 0" },
    { { .hold = &fixed, .holds = 1, .vary = 7 },
      "setting vary = 7: expected -1 or an index of `hold`, below holds = 1" },
    { { .vary = -1, .points = -3 }, "setting points = -3: expected a number > 0" },
    { { .vary = -1, .first = NAN }, "settings first = nan, last = 0: expected finite numbers" },
  };
  steady t = { .s = scene_system (&pushed_table, NULL), .set = { .vary = -1, .last = 1 } };
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    pw_error error = { 0 };
    assert_null (pw_steady_open (t.s, &wrong[i].set, &error));
    assert_int_equal (error.status, PW_INPUT);
    assert_non_null (strstr (error.text, wrong[i].text));
  }
  steady_open (&t);
  pw_steady_motion m;
  pw_error e[4] = { { 0 } };
  assert_int_equal (pw_steady_solve (t.x, -1, 0, &m, &e[0]), PW_INPUT);
  check_error (&e[0], PW_INPUT, "attempt = -1: expected a number >= 0");
  assert_int_equal (pw_steady_solve (t.x, 0, NAN, &m, &e[1]), PW_INPUT);
  check_error (&e[1], PW_INPUT, "parameter = nan: expected a finite number");
  const double zero[3] = { 0 };
  assert_int_equal (pw_steady_follow (t.x, zero, zero, 0, 0, &e[2]), PW_INPUT);
  check_error (&e[2], PW_INPUT, "direction = 0: expected 1 or -1");
  assert_int_equal (pw_steady_follow (t.x, zero, zero, INFINITY, 1, &e[3]), PW_INPUT);
  check_error (&e[3], PW_INPUT, "parameter = inf: expected a finite number");
  steady_close (&t);
}

/* The result NULL of a failed call is refused by the next, and the first error stays. */
TEST (missing) {
  pw_error error = { 0 };
  pw_steady_motion m;
  pw_linear l;
  assert_null (pw_steady_open (NULL, &(pw_steady_settings){ .vary = -1 }, &error));
  check_error (&error, PW_INPUT, "a system is missing");
  assert_int_equal (pw_steady_solve (NULL, 0, 0, &m, &error), PW_INPUT);
  assert_int_equal (pw_steady_follow (NULL, NULL, NULL, 0, 1, &error), PW_INPUT);
  assert_int_equal (pw_steady_next (NULL, &m, &error), PW_INPUT);
  assert_int_equal (pw_run_linearise (NULL, 100, &l, &error), PW_INPUT);
  pw_linear_free (&l);
  assert_int_equal (pw_differentiate (NULL, NULL, NULL, &error), PW_INPUT);
  assert_int_equal (pw_system_find_state (NULL, "x", &error), PW_INPUT);
  assert_int_equal (pw_system_find_held (NULL, "a.x", &error), PW_INPUT);
  check_error (&error, PW_INPUT, "a system is missing");
}
