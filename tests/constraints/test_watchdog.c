/* The watchdog: singular configurations (whatever the masses and the initial configuration), change points, drift,
 * extreme values. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "bars.h"
#include "check.h"
#include "method.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

/* ---- Scenes ---- */

/* A mass of 1 kg at a rod of 1 m, initially horizontal, pinned to a cart with almost no mass. */
typedef struct {
  double cart, scale, phi;
} watchdog_cart;

static const pw_parameter watchdog_cart_list[] = {
  { PW_AT (watchdog_cart, cart), 1e-6, "kg", "mass of the cart", PW_POSITIVE },
  { PW_AT (watchdog_cart, scale), 1, "", "factor of all masses", PW_POSITIVE },
  { PW_AT (watchdog_cart, phi), 0, "rad", "angle of the rod", PW_REAL },
  { .name = NULL },
};

SCENE_WITH (watchdog_build_cart, watchdog_cart_list, watchdog_cart) {
  double cart = p->cart * p->scale;
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = cart, .inertia = cart });
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = p->scale, .start = { cos (p->phi), sin (p->phi), p->phi } });
  pw_add_slider (m, &(pw_slider){ .name = "rail", .body = { "cart", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "hinge", .body = { "bob", "cart" }, .at = { { -1, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

/* ---- Regular scenes with very different masses ---- */

/* The time at which the rod has turned by theta: with e = m / (m + 1), theta'^2 (cos^2 + e sin^2) = 2 g sin, since the
 * centre of mass moves straight down.  Simpson's rule over the square root of theta. */
static long double watchdog_time (long double e, long double theta) {
  const int n = 200000;
  long double h = sqrtl (theta) / n, sum = 0;
  for (int i = 0; i <= n; i++) {
    long double u = h * i, x = u * u, c = cosl (x), s = sinl (x);
    long double f = 2 * sqrtl ((c * c + e * s * s) / (2 * 9.81L * (i == 0 ? 1 : s / x)));
    sum += f * (i == 0 || i == n ? 1 : i % 2 ? 4 : 2);
  }
  return sum * h / 3;
}

static double watchdog_angle (double cart, double t) {
  long double e = cart / (1 + (long double)cart), pi = 3.14159265358979323846L, quarter = watchdog_time (e, pi / 2);
  long double left = fmodl (t, 4 * quarter), low = 0, high = pi / 2;
  if (left > 2 * quarter) left = 4 * quarter - left;
  long double rest = left > quarter ? 2 * quarter - left : left;
  for (int i = 0; i < 45; i++) {
    long double middle = (low + high) / 2;
    *(watchdog_time (e, middle) < rest ? &low : &high) = middle;
  }
  return (double)(left > quarter ? pi - low : low);
}

static void watchdog_try_cart (const char *method, double cart, double scale, double exact, double bound) {
  pw_system *s = scene_system (&watchdog_build_cart_table, "cart", cart, "scale", scale, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = 1e-9, .span = 10 });
  pw_sample x = runs_to (r, 10);
  check_close (method, trial_state (s, &x, "cart.x"), (1 - cos (exact)) / (1 + cart), bound, "1e4 rtol");
  runs_close (r, s);
}

TEST (nearly_massless_cart) {
  static const char *const method[] = { "erk5+projection", "erk8+projection", "erk8+nullspace", "ida+ggl",
                                        "bdf+projection" };
  static const double cart[] = { 1e-6, 1e-3 };
  check_close ("quadrature", (double)watchdog_time (1e-6L / (1 + 1e-6L), 1.57079632679489661923L), 0.45152453568165885,
               1e-12, "QUADPACK");
  for (size_t k = 0; k < sizeof cart / sizeof *cart; k++) {
    double exact = watchdog_angle (cart[k], 10);
    for (size_t i = 0; i < sizeof method / sizeof *method; i++) watchdog_try_cart (method[i], cart[k], 1, exact, 1e-5);
    watchdog_try_cart ("erk8+projection", cart[k], 1e6, exact, 1e-5);
  }
  watchdog_try_cart ("erk8+projection", 1e-9, 1, watchdog_angle (1e-9, 10), 1e-5);
}

/* The sine is a property of J: it depends neither on masses nor on the initial configuration. */
TEST (sine) {
  double sine[3];
  static const double mass[] = { 1, 1e-8, 1e8 };
  for (int i = 0; i < 3; i++) {
    pw_system *s = scene_named ("slider-crank", "ms", mass[i]);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    sine[i] = pw_watchdog_sine (r, NULL);
    check_close ("largest", r->watchdog.largest_sine, sine[i], 0.3, "at any configuration but a singular one");
    runs_close (r, s);
  }
  check_bits ("sine", sine, sine + 1, 2);
}

/* ---- Change points ---- */

/* Runs to time t; returns the status and the angles of all bodies. */
static int watchdog_run (pw_system *s, const char *method, double tolerance, double t, double *phi, pw_error *error) {
  const pw_method *m;
  char name[40];
  int adaptive = 1, status;
  for (int i = 0; (m = runs_method (i, name)) != NULL; i++)
    if (strcmp (name, method) == 0) adaptive = m->adaptive;
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = adaptive ? tolerance : 0, .step = tolerance, .span = t });
  status = pw_run_advance_to (r, t, t, error);
  for (int j = 2; status == PW_OK && j < s->coords; j += 3) phi[j / 3] = r->q[j];
  pw_run_close (r);
  return status;
}

static const struct {
  const char *method;
  double tolerance;
} watchdog_runs[] = {
  { "bdf+projection", 1e-3 },  { "bdf+projection", 1e-5 },  { "bdf+projection", 1e-6 },  { "erk5+projection", 1e-3 },
  { "erk5+projection", 1e-4 }, { "erk5+projection", 1e-6 }, { "erk8+projection", 1e-3 }, { "erk8+projection", 1e-4 },
  { "erk8+projection", 1e-6 }, { "erk8+nullspace", 1e-3 },  { "ida+ggl", 1e-3 },         { "ida+ggl", 1e-6 },
  { "galpha+ggl", 1e-2 },      { "galpha+ggl", 1e-3 },      { "galpha+index3", 1e-2 },   { "leapfrog", 1e-2 },
  { "leapfrog", 1e-3 },        { "rk4+projection", 1e-2 },  { "rk4+projection", 1e-3 },  { "erk8+none", 1e-3 },
  { "erk5+baumgarte", 1e-3 },
};

enum { WATCHDOG_RUNS = sizeof watchdog_runs / sizeof *watchdog_runs };

/* The rod of a slider-crank, if longer than the crank, points backwards only on the wrong branch. */
TEST (close_branches_slider_crank) {
  static const double l2[] = { 1.00000001, 1.000003, 1.00001, 1.0001 };
  int reported = 0, finished = 0;
  for (size_t k = 0; k < sizeof l2 / sizeof *l2; k++)
    for (int i = 0; i < WATCHDOG_RUNS; i++) {
      pw_error error = { 0 };
      double phi[3];
      pw_system *s = scene_named ("slider-crank", "l2", l2[k]);
      int status = watchdog_run (s, watchdog_runs[i].method, watchdog_runs[i].tolerance, 1.5, phi, &error);
      if (status == PW_OK) assert_true (cos (phi[1]) > 0);
      if (status != PW_OK) assert_int_equal (status, PW_METHOD);
      reported += strstr (error.text, "change point") != NULL;
      finished += status == PW_OK;
      pw_system_free (s);
    }
  assert_true (reported > 30 && finished > 15);
}

/* Each run agrees with one of high accuracy, or stops. */
TEST (close_branches_four_bar) {
  static const struct {
    double a, b, c, d, g;
  } bars[] = { { 1, 1.00001, 1, 1, 0 },
               { 1, 0.99999, 1, 1, 9.81 },
               { 1, 2, 1, 2.00001, 0 },
               { 1, 1, 2.0001, 2, 0 },
               { 2, 1, 2.00001, 1, 9.81 } };
  int reported = 0;
  for (size_t k = 0; k < sizeof bars / sizeof *bars; k++) {
    pw_error none = { 0 };
    double exact[3];
    pw_system *s = scene_system (&bars_table, "a", bars[k].a, "b", bars[k].b, "c", bars[k].c, "d", bars[k].d, "g",
                                 bars[k].g, NULL);
    check_ok (watchdog_run (s, "erk8+projection", 1e-12, 2, exact, &none), &none);
    for (int i = 0; i < WATCHDOG_RUNS; i++) {
      pw_error error = { 0 };
      double phi[3], off = 0;
      int status = watchdog_run (s, watchdog_runs[i].method, watchdog_runs[i].tolerance, 2, phi, &error);
      for (int j = 0; status == PW_OK && j < 3; j++) off = fmax (off, fabs (remainder (phi[j] - exact[j], 2 * PW_PI)));
      check_below (watchdog_runs[i].method, off, 0.5, "other branches are off by 1 and more");
      reported += strstr (error.text, "change point") != NULL;
    }
    pw_system_free (s);
  }
  assert_true (reported > 30);
}

/* Nothing is reported where branches cross, or where they are far apart. */
TEST (no_change_point) {
  static const struct { double a, b, c, d; } bars[] = { { 1, 1, 1, 1 }, { 1, 2, 1, 2 }, { 1, 2.5, 2, 2 } };
  for (size_t k = 0; k < sizeof bars / sizeof *bars; k++) {
    pw_system *s = scene_system (&bars_table, "a", bars[k].a, "b", bars[k].b, "c", bars[k].c, "d", bars[k].d, NULL);
    for (int i = 0; i < WATCHDOG_RUNS - 2; i++) {
      pw_error error = { 0 };
      double phi[3];
      check_ok (watchdog_run (s, watchdog_runs[i].method, watchdog_runs[i].tolerance, 2, phi, &error), &error);
    }
    pw_system_free (s);
  }
}

enum { WATCHDOG_BARS = 9 };
static const double watchdog_bar = 2.5;

/* A parallelogram with cranks of 1 m at this angle; crossed: on the other branch, with pin C reflected at the line from
 * pin B to pin D. */
static void watchdog_bars_at (double phi, int crossed, double *q) {
  const double b = watchdog_bar, x = cos (phi), y = sin (phi);
  const double part = crossed ? 2 * b * (b - x) / ((b - x) * (b - x) + y * y) : 0;
  const double Cx = x + (crossed ? part * (b - x) - b : b), Cy = y - part * y;
  const double bars[WATCHDOG_BARS] = { x / 2,        y / 2,        phi,
                                       (x + Cx) / 2, (y + Cy) / 2, atan2 (Cy - y, Cx - x),
                                       (b + Cx) / 2, Cy / 2,       atan2 (Cy, Cx - b) };
  memcpy (q, bars, sizeof bars);
  q[8] += 2 * PW_PI * round ((phi - q[8]) / (2 * PW_PI));
}

/* Branches cross twice within a step: the motion must stay on its branch at the second crossing, too. */
TEST (two_crossings) {
  for (int crossed = 0; crossed < 2; crossed++) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&bars_table, "b", watchdog_bar, "d", watchdog_bar, NULL);
    pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
    r->watchdog.previous_sine = NAN;
    watchdog_bars_at (-0.3, 0, r->watchdog.previous_q);
    watchdog_bars_at (PW_PI + 0.3, crossed, r->q);
    assert_int_equal (pw_evaluate_J_at (r->w, r->t, r->q, r->v), PW_OK);
    double sine = pw_watchdog_sine (r, NULL);
    assert_int_equal (pw_change_point_check (r, sine, &error), crossed ? PW_METHOD : PW_OK);
    assert_true (!crossed || strstr (error.text, "the motion has left its branch"));
    runs_close (r, s);
  }
}

/* ---- A body that moves far in one step ---- */

static long watchdog_count;

/* 0; counts the evaluations. */
static int watchdog_torque (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t, (void)x, (void)gradient;
  watchdog_count++;
  value[0] = 0;
  return 0;
}

/* The four-bar linkage beside a free disc that turns by 1e5 rad in a step of 1e-3 s. */
static void watchdog_build_disc (pw_model *m, const void *parameters) {
  bars_table.build (m, parameters);
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1, .rate = { 0, 0, 1e8 } });
  pw_torque torque = { .name = "torque", .body = { "disc", "ground" } };
  torque.value = (pw_signal){ .type = PW_FUNCTION, .function = { .eval = watchdog_torque } };
  pw_add_torque (m, &torque);
}

TEST (fast_disc) {
  pw_plugin_table table = bars_table;
  table.build = watchdog_build_disc;
  pw_error error = { 0 };
  pw_system *s = scene_system (&table, NULL);
  watchdog_count = 0;
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
  for (int i = 0; i < 3; i++) check_ok (pw_run_advance (r, 1, &error), &error);
  check_close ("evaluations", (double)watchdog_count, 0, 1e4, "about a thousand in each step");
  runs_close (r, s);
}

/* ---- A signal that fails where only the watchdog evaluates it ---- */

static double watchdog_valid; /* the changes of the crank's initial angle with which the signal can be evaluated */

static int watchdog_fails_inside (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = fabs (x[0]) < 2.5 * watchdog_valid || fabs (x[0] - 1.2) < watchdog_valid || x[0] > 3 ? 0 : NAN;
  if (gradient) gradient[0] = 0;
  return 0;
}

static void watchdog_build_failing (pw_model *m, const void *parameters) {
  static const char *const reads[] = { "crank.phi", NULL };
  bars_table.build (m, parameters);
  pw_torque torque = { .name = "torque", .body = { "crank", "ground" } };
  torque.value = (pw_signal){ PW_FUNCTION, .function = { .eval = watchdog_fails_inside, .reads = reads } };
  pw_add_torque (m, &torque);
}

/* A later error does not mention this failure. */
TEST (failing_signal) {
  pw_error error = { 0 };
  pw_plugin_table table = bars_table;
  watchdog_valid = 0.2;
  table.build = watchdog_build_failing;
  pw_system *s = scene_system (&table, "b", watchdog_bar, "d", watchdog_bar, NULL);
  pw_run *r = runs_open (s, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 });
  assert_null (r->w->failed);
  watchdog_bars_at (-0.3, 0, r->watchdog.previous_q);
  watchdog_bars_at (PW_PI + 0.3, 0, r->q);
  assert_int_equal (pw_evaluate_J_at (r->w, r->t, r->q, r->v), PW_OK);
  check_ok (pw_change_point_check (r, pw_watchdog_sine (r, NULL), &error), &error);
  assert_null (r->w->failed);
  static const double flat[] = { 0.5, 0, 0, 2.25, 0, 0, 3, 0, 0 };
  pw_initial_value initial[WATCHDOG_BARS];
  for (int i = 0; i < WATCHDOG_BARS; i++) initial[i] = (pw_initial_value){ i, flat[i] };
  watchdog_valid = 0.01;
  assert_null (pw_run_open (s, "rk4", &(pw_settings){ .initial = initial, .initials = WATCHDOG_BARS }, &error));
  check_error (
      &error, PW_INITIAL,
      "model scene: the initial configuration is singular: pin B (B.Fx) follows from pin A, pin C, pin D, but not "
      "nearby; begin slightly off it");
  runs_close (r, s);
}

/* ---- Messages ---- */

static void watchdog_expect (const char *model, const char *parameter, double value, const char *method,
                             double tolerance, double t, const char *text) {
  pw_error error = { 0 };
  double phi[30];
  pw_system *s = scene_named (model, parameter, value);
  int status = watchdog_run (s, method, tolerance, t, phi, &error);
  if (text) assert_int_equal (status, PW_METHOD);
  if (text && strstr (error.text, text) == NULL) print_error ("%s\n", error.text);
  if (text) assert_non_null (strstr (error.text, text));
  assert_null (strstr (error.text, text && strstr (text, "singular") ? "drift" : "singular"));
  pw_system_free (s);
}

TEST (messages) {
  static const char *const drifting[] = { "ida+none", "adams+none", "bdf+none", "erk5+none", "adams+baumgarte" };
  for (size_t i = 0; i < sizeof drifting / sizeof *drifting; i++)
    for (double rtol = 1e-3; rtol > 5e-6; rtol /= 10)
      watchdog_expect ("pendulum", NULL, 0, drifting[i], rtol, 100, rtol > 5e-4 && i < 4 ? "constraint drift" : NULL);
  watchdog_expect ("slider-crank", "l2", 1.00001, "bdf+projection", 1e-5, 4, "change point");
  watchdog_expect ("slider-crank", "l2", 1.00001, "galpha+ggl", 1e-2, 4, "change point");
  watchdog_expect ("slider-crank", "l2", 1.000003, "erk8+projection", 1e-3, 4, "change point");
  watchdog_expect ("slider-crank", NULL, 0, "galpha+index3", 9e-6, 4, "singular configuration");
}

/* A small body at a pin, whose moment of inertia is too extreme for its size. */
static void watchdog_build_small (pw_model *m, const void *parameter) {
  pw_add_body (m, &(pw_body){ .name = "rod", .mass = 1, .inertia = *(const double *)parameter });
  pw_add_pin (m, &(pw_pin){ .name = "hinge", .body = { "rod", "ground" }, .at = { { 0, 0 }, { 0, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "end", .body = { "rod", "ground" }, .at = { { 1e-3, 0 }, { 1e-3, 0 } } });
}

/* The bounds in the message are in the units of the value, which is outside them. */
static void watchdog_try_inertia (double inertia) {
  static const pw_parameter list[] = { { .name = "inertia", .value = 1 }, { .name = NULL } };
  static const pw_plugin_table table = SCENE_TABLE_WITH (watchdog_build_small, list, sizeof (double));
  double value, low, high;
  pw_error error = { 0 };
  pw_system *s = scene_system (&table, "inertia", inertia, NULL);
  assert_null (pw_run_open (s, "rk4", NULL, &error));
  const char *is = strstr (error.text, "that goes with rod.phi is ");
  assert_non_null (is);
  assert_int_equal (sscanf (is, "that goes with rod.phi is %lf: expected 0, or %lf to %lf", &value, &low, &high), 3);
  assert_true (value == inertia && (value < low || value > high));
  pw_system_free (s);
}

TEST (extreme) {
  static const double mass[] = { 1e200, 1e-200 };
  pw_error error = { 0 }, beyond = { 0 };
  pw_system *far = scene_system (&watchdog_build_cart_table, "phi", 1e308, NULL);
  assert_null (pw_run_open (far, "bdf", NULL, &beyond));
  check_error (&beyond, PW_INPUT,
               "model scene: values too extreme: bob.phi is initially 1e+308: expected a magnitude below 1e+100");
  pw_system_free (far);
  watchdog_try_inertia (1e98);
  watchdog_try_inertia (1e-108);
  for (int i = 0; i < 2; i++) {
    pw_error refused = { 0 };
    pw_system *s = scene_named ("n-four-bar", "m", mass[i]);
    assert_null (pw_run_open (s, "rk4+projection", NULL, &refused));
    assert_int_equal (refused.status, PW_INPUT);
    assert_non_null (strstr (refused.text, "values too extreme: the mass or inertia that goes with crank0.x is"));
    pw_system_free (s);
  }
  pw_system *s = scene_system (&watchdog_build_cart_table, "cart", 1e-15, "phi", -PW_PI / 2, NULL);
  pw_run *r = pw_run_open (s, "rk4+projection", NULL, &error);
  if (r) pw_run_advance_to (r, 1, 1, &error);
  assert_int_equal (error.status, PW_METHOD);
  assert_non_null (strstr (error.text, "values too extreme: masses and inertias differ"));
  runs_close (r, s);
}
