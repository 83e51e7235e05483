/* The built-in signals: ramps, smooth steps, pulses and tables; their derivatives, jumps and kinks, and which elements
 * accept them. */
#include <float.h>
#include <math.h>
#include "check.h"
#include "scene.h"
#include "system.h"
#include "trial.h"

/* ---- Shapes ---- */

enum { SHAPES_POINTS = 6 };

static const double shapes_t[] = { 0.4, 1.1, 1.5, 2.6, 3, 4.2 }, shapes_y[] = { -1, 0.5, 0.7, -0.3, 0.2, 0.9 };

#define TABLE(how, at)                                                                                               \
  {                                                                                                                  \
    PW_TABLE, .table = {.t = shapes_t, .value = shapes_y, .count = SHAPES_POINTS, .interpolation = how, .ends = at } \
  }

static const pw_signal shapes_ramp = { PW_RAMP, .ramp = { 0.3, -1.2, 0.7, 1.9 } };
static const pw_signal shapes_smooth = { PW_SMOOTH_STEP, .ramp = { 0.3, -1.2, 0.7, 1.9 } };
static const pw_signal shapes_pulse = { PW_PULSE, .pulse = { 2, 0.7, 0.3, 0, -0.5 } };
static const pw_signal shapes_pulses = { PW_PULSE, .pulse = { 2, 0.7, 0.3, 1.1, -0.5 } };
static const pw_signal shapes_for_ever = { PW_PULSE, .pulse = { .height = 2, .start = 0.7 } };
static const pw_signal shapes_linear = TABLE (PW_LINEAR, PW_ENDS_FREE);
static const pw_signal shapes_free = TABLE (PW_CUBIC, PW_ENDS_FREE);
static const pw_signal shapes_rest = TABLE (PW_CUBIC, PW_ENDS_REST);

/* A signal as a compiled system stores it; until the next call. */
static pw_source shapes_source (const pw_signal *s) {
  static double spline[2 * SHAPES_POINTS];
  pw_source source = { .signal = *s, .spline = spline };
  if (s->type == PW_TABLE) pw_table_spline (s, spline);
  return source;
}

static void shapes_at (pw_source *source, double t, double u[3]) {
  source->u = u;
  assert_int_equal (pw_signal_eval (source, t), 0);
}

/* Between breakpoints, rate and acceleration are the derivatives of the value. */
static void shapes_derivatives (const pw_signal *s) {
  const double h = 1e-4;
  pw_source source = shapes_source (s);
  for (double t = 0.033; t < 5; t += 0.1) {
    double u[3], up[3], down[3];
    if (pw_signal_breakpoint (s, 0, t - 2 * h) < t + 2 * h) continue;
    shapes_at (&source, t, u);
    shapes_at (&source, t + h, up);
    shapes_at (&source, t - h, down);
    check_close ("rate", u[1], (up[0] - down[0]) / (2 * h), 1e-6,
                 "central differences: h^2 third derivative, at most 30");
    check_close ("acceleration", u[2], (up[1] - down[1]) / (2 * h), 1e-6, "the same");
  }
}

/* Checks the first `count` breakpoints: all derivatives are continuous from the right, those up to order `smooth` also
 * from the left (-1: not even the value). */
static void shapes_breaks (const pw_signal *s, int count, int smooth) {
  pw_source source = shapes_source (s);
  double t = 0, u[3], before[3], after[3];
  for (int i = 0; i < count; i++) {
    double next = pw_signal_breakpoint (s, 0, t);
    assert_true (next > t && isfinite (next));
    int jumps = 0;
    shapes_at (&source, next, u);
    shapes_at (&source, nextafter (next, -INFINITY), before);
    shapes_at (&source, nextafter (next, INFINITY), after);
    for (int k = 0; k < 3; k++) {
      check_close ("just after", after[k], u[k], 1e-13, "continuous from the right");
      if (k <= smooth) check_close ("just before", before[k], u[k], 1e-13, "continuous up to order `smooth`");
      jumps |= fabs (before[k] - u[k]) > 1e-6;
    }
    assert_true (jumps || smooth == 2);
    t = next;
  }
  if (s->pulse.period == 0 || s->type != PW_PULSE) assert_true (isinf (pw_signal_breakpoint (s, 0, t)));
}

TEST (forms) {
  static const struct {
    const pw_signal *s;
    int breaks, smooth;
  } shape[] = {
    { &shapes_ramp, 2, 0 },     { &shapes_smooth, 2, 2 },    { &shapes_pulse, 2, -1 },
    { &shapes_pulses, 30, -1 }, { &shapes_for_ever, 1, -1 }, { &shapes_linear, SHAPES_POINTS, 0 },
    { &shapes_free, 2, 0 },     { &shapes_rest, 2, 1 },
  };
  for (size_t i = 0; i < sizeof shape / sizeof *shape; i++) {
    shapes_derivatives (shape[i].s);
    shapes_breaks (shape[i].s, shape[i].breaks, shape[i].smooth);
  }
}

static void shapes_is (const pw_signal *s, double t, double value) {
  pw_source source = shapes_source (s);
  double u[3];
  shapes_at (&source, t, u);
  check_close ("value", u[0], value, 8 * DBL_EPSILON, "round-off");
}

TEST (values) {
  shapes_is (&shapes_ramp, -9, 0.3);
  shapes_is (&shapes_ramp, 0.7 + 1.9 / 4, 0.3 - 1.5 / 4);
  shapes_is (&shapes_ramp, 1e9, -1.2);
  shapes_is (&shapes_smooth, 0.7, 0.3);
  shapes_is (&shapes_smooth, 0.7 + 1.9 / 4, 0.3 - 1.5 * (10. / 64 - 15. / 256 + 6. / 1024));
  shapes_is (&shapes_smooth, 2.7, -1.2);
  shapes_is (&shapes_pulse, 0.6, -0.5);
  shapes_is (&shapes_pulse, 0.8, 1.5);
  shapes_is (&shapes_pulse, 1.9, -0.5);
  shapes_is (&shapes_pulses, 0.8 + 7 * 1.1, 1.5);
  shapes_is (&shapes_pulses, 1.1 + 7 * 1.1, -0.5);
  shapes_is (&shapes_for_ever, 1e9, 2);
  shapes_is (&shapes_linear, 0, -1);
  shapes_is (&shapes_linear, 1.3, 0.6);
  shapes_is (&shapes_linear, 9, 0.9);
  for (int i = 0; i < SHAPES_POINTS; i++) {
    shapes_is (&shapes_free, shapes_t[i], shapes_y[i]);
    shapes_is (&shapes_rest, shapes_t[i], shapes_y[i]);
  }
}

/* A pulse begins and ends exactly at its breakpoints, however the quotient of times is rounded. */
TEST (many_pulses) {
  pw_signal s = { PW_PULSE, .pulse = { .height = 1, .start = 0.1, .width = 0.05, .period = 0.1 } };
  pw_source source = { .signal = s };
  double t = 0, u[3];
  for (int i = 0; i < 20000; i++) {
    t = pw_signal_breakpoint (&s, 0, t);
    shapes_at (&source, t, u);
    assert_true (u[0] == (i % 2 == 0));
    shapes_at (&source, nextafter (t, 0), u);
    assert_true (u[0] == (i % 2 == 1));
  }
  check_close ("the last one", t, 0.1 + 9999 * 0.1 + 0.05, 4 * DBL_EPSILON * 1000, "no sum of periods: round-off");
}

/* ---- Splines ---- */

/* Points between the ends of a cubic table, where its third derivative jumps, are breakpoints only with kinks. */
TEST (knots) {
  for (int i = 0; i < SHAPES_POINTS - 1; i++) {
    assert_true (pw_signal_breakpoint (&shapes_rest, 1, shapes_t[i]) == shapes_t[i + 1]);
    assert_true (pw_signal_breakpoint (&shapes_rest, 0, shapes_t[i]) == shapes_t[SHAPES_POINTS - 1]);
  }
  assert_true (pw_signal_breakpoint (&shapes_rest, 1, shapes_t[0] - 1) == shapes_t[0]);
  assert_true (isinf (pw_signal_breakpoint (&shapes_rest, 1, shapes_t[SHAPES_POINTS - 1])));
}

/* A spline with free ends through points of a cubic polynomial is that polynomial. */
TEST (cubic) {
  double y[SHAPES_POINTS], u[3];
  pw_signal s = shapes_free;
  for (int n = 4; n <= SHAPES_POINTS; n++) {
    for (int i = 0; i < n; i++) y[i] = 1 + shapes_t[i] * (-2 + shapes_t[i] * (0.5 + 0.3 * shapes_t[i]));
    s.table.value = y;
    s.table.count = n;
    pw_source source = shapes_source (&s);
    for (double t = shapes_t[0]; t < shapes_t[n - 1]; t += 0.07) {
      shapes_at (&source, t, u);
      check_close ("value", u[0], 1 + t * (-2 + t * (0.5 + 0.3 * t)), 1e-13, "round-off of a few operations");
      check_close ("acceleration", u[2], 1 + 1.8 * t, 1e-12, "the same, over h^2");
    }
  }
}

/* With ends at rest, two points give 3 x^2 - 2 x^3; rates at the ends are 0. */
TEST (rest) {
  static const double t[] = { 1, 3 }, y[] = { 2, 7 };
  pw_signal s = { PW_TABLE, .table = { t, y, 2, PW_CUBIC, PW_ENDS_REST, 0, 0, 0 } };
  pw_source source = shapes_source (&s);
  double u[3];
  for (double x = 0; x < 1; x += 0.1) {
    shapes_at (&source, 1 + 2 * x, u);
    check_close ("value", u[0], 2 + 5 * x * x * (3 - 2 * x), 1e-14, "round-off");
  }
  source = shapes_source (&shapes_rest);
  shapes_at (&source, shapes_t[0], u);
  check_close ("rate at the first point", u[1], 0, 1e-14, "round-off");
  shapes_at (&source, nextafter (shapes_t[SHAPES_POINTS - 1], 0), u);
  check_close ("rate at the last point", u[1], 0, 1e-13, "round-off");
}

/* ---- Which elements accept which signals ---- */

/* A car: steered by a ramp, its speed a table; a trailer turned by a motor with pulses, a disc turned by a smooth step,
 * a boom by a cubic table. */
SCENE (shapes_car) {
  static const double t[] = { 0.15, 0.8, 1.3 }, y[] = { 1, 1.6, 1.2 };
  pw_add_body (m, &(pw_body){ .name = "car", .mass = 3, .inertia = 0.4, .rate = { 1 } });
  pw_add_body (m, &(pw_body){ .name = "trailer", .mass = 1, .inertia = 0.1, .start = { -1.2 }, .rate = { 1 } });
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 0.2, .inertia = 0.05 });
  pw_add_body (m, &(pw_body){ .name = "boom", .mass = 0.3, .inertia = 0.02, .start = { 0.2 } });
  pw_add_pin (m, &(pw_pin){ .name = "H", .body = { "car", "trailer" }, .at = { { -0.6 }, { 0.6 } } });
  pw_add_pin (m, &(pw_pin){ .name = "D", .body = { "car", "disc" } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "car", "boom" }, .at = { { 0 }, { -0.2 } } });
  pw_add_wheel (m, &(pw_wheel){ .name = "rear", .body = "car", .at = { -0.3 } });
  pw_add_steered_wheel (
      m, &(pw_steered_wheel){
             .name = "front", .body = "car", .at = { 0.4 }, .heading = { PW_RAMP, .ramp = { 0, 0.4, 0.21, 0.5 } } });
  pw_add_speed (m, &(pw_speed){ .name = "engine",
                                .body = "car",
                                .at = { -0.3 },
                                .value = { PW_TABLE, .table = { t, y, 3, PW_LINEAR, 0, 0, 0, 0 } } });
  pw_add_motor (m, &(pw_motor){ .name = "tow",
                                .body = { "trailer", "car" },
                                .stiffness = 3,
                                .damping = 0.5,
                                .angle = { PW_PULSE, .pulse = { 0.3, 0.13, 0.2, 0.7, -0.1 } } });
  pw_add_drive (m, &(pw_drive){ .name = "turn",
                                .body = { "disc", "car" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_SMOOTH_STEP, .ramp = { 0, 2, 0.17, 0.9 } } });
  pw_add_drive (m, &(pw_drive){ .name = "swing",
                                .body = { "boom", "car" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_TABLE, .table = { t, y, 3, PW_CUBIC, PW_ENDS_REST, 0, 0, 0 } } });
}

TEST (methods) {
  trial (&shapes_car_table, 2);
}

/* The signal of a torque, of a velocity constraint, of a position constraint. */
enum { SHAPES_FORCE, SHAPES_VELOCITY, SHAPES_POSITION };

static void shapes_refused (int level, pw_signal value, const char *text) {
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  if (level == SHAPES_FORCE)
    pw_add_torque (m, &(pw_torque){ .name = "X", .body = { "frame", "ground" }, .value = value });
  if (level == SHAPES_VELOCITY)
    pw_add_steered_wheel (m, &(pw_steered_wheel){ .name = "X", .body = "frame", .heading = value });
  if (level == SHAPES_POSITION)
    pw_add_drive (m, &(pw_drive){ .name = "X", .body = { "frame", "ground" }, .what = PW_DRIVE_ANGLE, .value = value });
  scene_refused (m, text);
}

#define SHAPES_KINKS(what)                                                                                       \
  "model ezyroller: drive X: value: " what " has kinks, and a prescribed position must not: use a smooth-step, " \
  "a cubic table with ends at rest, a harmonic"

TEST (refused) {
  shapes_refused (SHAPES_POSITION, shapes_ramp, SHAPES_KINKS ("a ramp"));
  shapes_refused (SHAPES_POSITION, shapes_linear, SHAPES_KINKS ("a linear table"));
  shapes_refused (SHAPES_POSITION, shapes_free, SHAPES_KINKS ("a cubic table with free ends"));
  shapes_refused (SHAPES_POSITION, shapes_pulse,
                  "model ezyroller: drive X: value: a pulse has jumps, and a prescribed position must not: use a "
                  "smooth-step, a cubic table with ends at rest, a harmonic");
  shapes_refused (
      SHAPES_VELOCITY, shapes_pulse,
      "model ezyroller: steered-wheel X: heading: a pulse jumps, and the signal of a velocity constraint must "
      "not: use a ramp or smooth-step");
}

static pw_signal shapes_points (const double *t, const double *y, int count, int interpolation) {
  return (pw_signal){ PW_TABLE, .table = { t, y, count, interpolation, 0, 0, 0, 0 } };
}

TEST (faults) {
  static const double t[] = { 0, 1, 1, 2 }, y[] = { 0, 1, NAN, 2 };
#define FAULT "model ezyroller: torque X: value: "
  shapes_refused (SHAPES_FORCE, shapes_points (t, t, 4, PW_LINEAR),
                  FAULT "point 3 is at t = 1 s, after one at 1 s: expected increasing times");
  shapes_refused (SHAPES_FORCE, shapes_points (shapes_y, t, 4, PW_CUBIC),
                  FAULT "point 4 is at t = -0.3 s, after one at 0.7 s: expected increasing times");
  shapes_refused (SHAPES_FORCE, shapes_points (shapes_t, y, 4, PW_LINEAR),
                  FAULT "point 3 is (1.5, nan): expected finite numbers");
  shapes_refused (SHAPES_FORCE, (pw_signal){ PW_TABLE, .table = { t, t, 4, PW_LINEAR, 0, 1e308, 1e308, 0 } },
                  FAULT "point 2: offset + scale * 1 is not finite");
  static const double adjacent[] = { 0, 1e-200 };
  shapes_refused (SHAPES_FORCE, (pw_signal){ PW_TABLE, .table = { adjacent, t, 2, PW_CUBIC, PW_ENDS_REST, 0, 0, 0 } },
                  "model ezyroller: element X: the derivatives of the table are not finite at t = 0 s");
  shapes_refused (SHAPES_FORCE, shapes_points (t, t, 1, PW_LINEAR),
                  FAULT "a linear table needs at least 2 points, found 1");
  shapes_refused (SHAPES_FORCE, shapes_points (NULL, t, 3, PW_LINEAR),
                  FAULT "a linear table needs at least 2 points, found 0");
  shapes_refused (SHAPES_FORCE, shapes_points (t, t, -7, PW_LINEAR),
                  FAULT "a linear table needs at least 2 points, found -7");
  shapes_refused (SHAPES_FORCE, shapes_points (t, t, 3, PW_CUBIC),
                  FAULT "a cubic table with free ends needs at least 4 points, found 3");
  shapes_refused (SHAPES_FORCE, shapes_points (t, t, 3, 7), FAULT "interpolation = 7: expected 0 or 1");
  shapes_refused (SHAPES_FORCE, (pw_signal){ PW_RAMP, .ramp = { .to = 1 } },
                  FAULT "duration = 0: expected a number > 0");
  shapes_refused (SHAPES_FORCE, (pw_signal){ PW_PULSE, .pulse = { .height = 1, .width = -1 } },
                  FAULT "width = -1: expected a number >= 0");
  shapes_refused (SHAPES_FORCE, (pw_signal){ PW_PULSE, .pulse = { .height = 1, .width = 2, .period = 2 } },
                  FAULT "a pulse every 2 s: expected a width > 0 and < 2 s, found 2 s");
}
