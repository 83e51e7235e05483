/* The watchdog: singular configurations independent of masses and of the initial one, change points, drift, extreme values;
 * and what each of its thresholds decides. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "method.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

/* ---- Scenes ---- */

/* A point mass of 1 kg on a rod of 1 m, horizontal at the start, below a cart that weighs hardly anything. */
typedef struct {
  double cart, scale, phi;
} watchdog_cart;

static const pw_parameter watchdog_cart_list[] = {
  { PW_AT (watchdog_cart, cart), 1e-6, "kg", "mass of the cart", PW_POSITIVE },
  { PW_AT (watchdog_cart, scale), 1, "", "times all masses", PW_POSITIVE },
  { PW_AT (watchdog_cart, phi), 0, "rad", "angle of the rod", PW_REAL },
  { .name = NULL },
};

static void watchdog_build_cart (pw_model *m, const void *parameter) {
  const watchdog_cart *p = parameter;
  double cart = p->cart * p->scale;
  pw_add_body (m, &(pw_body){ .name = "cart", .mass = cart, .inertia = cart });
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = p->scale, .start = { cos (p->phi), sin (p->phi), p->phi } });
  pw_add_slider (m, &(pw_slider){ .name = "rail", .body = { "cart", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "hinge", .body = { "bob", "cart" }, .at = { { -1, 0 }, { 0, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
}

static const pw_plugin_table watchdog_cart_table = { .abi = PW_ABI,
                                                     .size = sizeof (pw_plugin_table),
                                                     .parameters = watchdog_cart_list,
                                                     .parameters_size = sizeof (watchdog_cart),
                                                     .build = watchdog_build_cart };

/* A four-bar linkage, its crank and its rocker parallel at the start, so that it is consistent if a = c and b = d. */
typedef struct {
  double a, b, c, d, g;
} watchdog_bars;

static const pw_parameter watchdog_bars_list[] = {
  { PW_AT (watchdog_bars, a), 1, "m", "crank", PW_POSITIVE },
  { PW_AT (watchdog_bars, b), 1, "m", "coupler", PW_POSITIVE },
  { PW_AT (watchdog_bars, c), 1, "m", "rocker", PW_POSITIVE },
  { PW_AT (watchdog_bars, d), 1, "m", "ground", PW_POSITIVE },
  { PW_AT (watchdog_bars, g), 0, "m/s^2", "gravity", PW_REAL },
  { .name = NULL },
};

static void watchdog_build_bars (pw_model *m, const void *parameter) {
  const watchdog_bars *p = parameter;
  const double phi = 1.2, w = 4, c = cos (phi), s = sin (phi);
  pw_add_body (m, &(pw_body){ .name = "crank",
                              .mass = 1,
                              .inertia = p->a * p->a / 12,
                              .start = { p->a * c / 2, p->a * s / 2, phi },
                              .rate = { -p->a * s * w / 2, p->a * c * w / 2, w } });
  pw_add_body (m, &(pw_body){ .name = "coupler",
                              .mass = 1,
                              .inertia = p->b * p->b / 12,
                              .start = { p->a * c + p->b / 2, p->a * s, 0 },
                              .rate = { -p->a * s * w, p->a * c * w, 0 } });
  pw_add_body (m, &(pw_body){ .name = "rocker",
                              .mass = 1,
                              .inertia = p->c * p->c / 12,
                              .start = { p->d + p->c * c / 2, p->c * s / 2, phi },
                              .rate = { -p->c * s * w / 2, p->c * c * w / 2, w } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "ground", "crank" }, .at = { { 0, 0 }, { -p->a / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "crank", "coupler" }, .at = { { p->a / 2, 0 }, { -p->b / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "C", .body = { "coupler", "rocker" }, .at = { { p->b / 2, 0 }, { p->c / 2, 0 } } });
  pw_add_pin (m, &(pw_pin){ .name = "D", .body = { "ground", "rocker" }, .at = { { p->d, 0 }, { -p->c / 2, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -p->g } });
}

static const pw_plugin_table watchdog_bars_table = { .abi = PW_ABI,
                                                     .size = sizeof (pw_plugin_table),
                                                     .parameters = watchdog_bars_list,
                                                     .parameters_size = sizeof (watchdog_bars),
                                                     .build = watchdog_build_bars };

/* ---- Regular scenes with bodies of very different masses ---- */

/* The angle of the rod, 0 to pi and back, at time t: with e = m / (m + 1), theta'^2 (cos^2 + e sin^2) = 2 g sin, since the
 * centre of mass moves straight down; t by Simpson's rule over the root of theta, from which the angle is found. */
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
  pw_system *s = scene_system (&watchdog_cart_table, "cart", cart, "scale", scale, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = 1e-9, .span = 10 });
  pw_sample x = runs_to (r, 10);
  check_close (method, trial_state (s, &x, "cart.x"), (1 - cos (exact)) / (1 + cart), bound, "1e4 rtol");
  pw_run_close (r);
  pw_system_free (s);
}

static void test_light_cart (void **state) {
  static const char *const method[] = { "erk5+projection", "erk8+projection", "erk8+nullspace", "ida+ggl",
                                        "bdf+projection" };
  static const double cart[] = { 1e-6, 1e-3 };
  (void)state;
  check_close ("quadrature", (double)watchdog_time (1e-6L / (1 + 1e-6L), 1.57079632679489661923L), 0.45152453568165885,
               1e-12, "QUADPACK");
  for (size_t k = 0; k < sizeof cart / sizeof *cart; k++) {
    double exact = watchdog_angle (cart[k], 10);
    for (size_t i = 0; i < sizeof method / sizeof *method; i++) watchdog_try_cart (method[i], cart[k], 1, exact, 1e-5);
    watchdog_try_cart ("erk8+projection", cart[k], 1e6, exact, 1e-5);
  }
  watchdog_try_cart ("erk8+projection", 1e-9, 1, watchdog_angle (1e-9, 10), 1e-5);
}

/* The sine is a property of J: masses do not enter, nor does the configuration at the start. */
static void test_sine (void **state) {
  (void)state;
  double sine[3];
  static const double mass[] = { 1, 1e-8, 1e8 };
  for (int i = 0; i < 3; i++) {
    pw_system *s = scene_named ("slider-crank", "ms", mass[i]);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    sine[i] = pw_watchdog_sine (r, NULL);
    check_close ("largest", r->geometry.typical, sine[i], 0.3, "at any configuration but a singular one");
    pw_run_close (r);
    pw_system_free (s);
  }
  check_bits ("sine", sine, sine + 1, 2);
}

/* ---- Change points ---- */

/* What a run comes to: a status, and how far it is off, of all angles. */
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

/* On its own branch the rod of a slider-crank that is longer than the crank never points backwards. */
static void test_near_slider_crank (void **state) {
  static const double l2[] = { 1.00000001, 1.000003, 1.00001, 1.0001 };
  int reported = 0, finished = 0;
  (void)state;
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

/* By others the answer is that of a run of high accuracy, or the run stops. */
static void test_near_four_bar (void **state) {
  static const struct {
    double a, b, c, d, g;
  } bars[] = { { 1, 1.00001, 1, 1, 0 },
               { 1, 0.99999, 1, 1, 9.81 },
               { 1, 2, 1, 2.00001, 0 },
               { 1, 1, 2.0001, 2, 0 },
               { 2, 1, 2.00001, 1, 9.81 } };
  int reported = 0;
  (void)state;
  for (size_t k = 0; k < sizeof bars / sizeof *bars; k++) {
    pw_error none = { 0 };
    double exact[3];
    pw_system *s = scene_system (&watchdog_bars_table, "a", bars[k].a, "b", bars[k].b, "c", bars[k].c, "d", bars[k].d,
                                 "g", bars[k].g, NULL);
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

/* Where branches meet, and where none are near, nothing is reported. */
static void test_no_change_point (void **state) {
  static const struct { double a, b, c, d; } bars[] = { { 1, 1, 1, 1 }, { 1, 2, 1, 2 }, { 1, 2.5, 2, 2 } };
  (void)state;
  for (size_t k = 0; k < sizeof bars / sizeof *bars; k++) {
    pw_system *s =
        scene_system (&watchdog_bars_table, "a", bars[k].a, "b", bars[k].b, "c", bars[k].c, "d", bars[k].d, NULL);
    for (int i = 0; i < WATCHDOG_RUNS - 2; i++) {
      pw_error error = { 0 };
      double phi[3];
      check_ok (watchdog_run (s, watchdog_runs[i].method, watchdog_runs[i].tolerance, 2, phi, &error), &error);
    }
    pw_system_free (s);
  }
}

/* ---- Messages ---- */

static void watchdog_says (const char *model, const char *parameter, double value, const char *method, double tolerance,
                           double t, const char *text) {
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

static void test_messages (void **state) {
  static const char *const drifting[] = { "ida+none", "adams+none", "bdf+none", "erk5+none", "adams+baumgarte" };
  (void)state;
  for (size_t i = 0; i < sizeof drifting / sizeof *drifting; i++)
    for (double rtol = 1e-3; rtol > 5e-6; rtol /= 10)
      watchdog_says ("pendulum", NULL, 0, drifting[i], rtol, 100, rtol > 5e-4 && i < 4 ? "constraint drift" : NULL);
  watchdog_says ("slider-crank", "l2", 1.00001, "bdf+projection", 1e-6, 4, "change point");
  watchdog_says ("slider-crank", "l2", 1.00001, "galpha+ggl", 1e-2, 4, "change point");
  watchdog_says ("slider-crank", "l2", 1.000003, "erk8+projection", 1e-3, 4, "change point");
  watchdog_says ("slider-crank", NULL, 0, "galpha+ggl", 1e-4, 4, "near a singular configuration");
}

static void test_extreme (void **state) {
  static const double mass[] = { 1e200, 1e-200 };
  pw_error error = { 0 }, beyond = { 0 };
  (void)state;
  pw_system *far = scene_system (&watchdog_cart_table, "phi", 1e308, NULL);
  assert_null (pw_run_open (far, "bdf", NULL, &beyond));
  check_error (&beyond, PW_INPUT,
               "model scene: values too extreme: bob.phi is initially 1e+308: expected less than 1e+100");
  pw_system_free (far);
  for (int i = 0; i < 2; i++) {
    pw_error refused = { 0 };
    pw_system *s = scene_named ("n-four-bar", "m", mass[i]);
    assert_null (pw_run_open (s, "rk4+projection", NULL, &refused));
    assert_int_equal (refused.status, PW_INPUT);
    assert_non_null (strstr (refused.text, "values too extreme: the mass or inertia that goes with crank0.x is"));
    pw_system_free (s);
  }
  pw_system *s = scene_system (&watchdog_cart_table, "cart", 1e-15, "phi", -PW_PI / 2, NULL);
  pw_run *r = pw_run_open (s, "rk4+projection", NULL, &error);
  if (r) pw_run_advance_to (r, 1, 1, &error);
  assert_int_equal (error.status, PW_METHOD);
  assert_non_null (strstr (error.text, "values too extreme: masses and inertias differ"));
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- What each threshold decides ---- */

/* What is compared of a run with a threshold and of one with another. */
typedef enum { WATCHDOG_EARLIER, WATCHDOG_LATER, WATCHDOG_FEWER, WATCHDOG_MORE } watchdog_effect;

#define WATCHDOG_LIMIT(x) #x, offsetof(pw_watchdog, x)

/* EARLIER, LATER: stops at; FEWER, MORE: rejected steps. */
static const struct {
  const char *name;
  size_t at;
  double factor;
  watchdog_effect effect;
  const char *model, *parameter;
  double value;
  const char *method;
  double tolerance, t;
} watchdog_limit[] = {
  { WATCHDOG_LIMIT (lost), 4, WATCHDOG_LATER, "slider-crank", NULL, 0, "ida+ggl", 1e-2, 4 },
  { WATCHDOG_LIMIT (lost_unstabilised), 0.5, WATCHDOG_EARLIER, "pendulum", NULL, 0, "ida+none", 1e-3, 100 },
  { WATCHDOG_LIMIT (magnified), 0, WATCHDOG_EARLIER, "redundant-parallelogram", NULL, 0, "adams+none", 1e-4, 2 },
  { WATCHDOG_LIMIT (follows), 0, WATCHDOG_EARLIER, "redundant-parallelogram", NULL, 0, "rk4+projection", 1e-2, 2 },
  { WATCHDOG_LIMIT (near), 2, WATCHDOG_MORE, "n-four-bar", NULL, 0, "rk4+projection", 1e-3, 2 },
  { WATCHDOG_LIMIT (growth), 0, WATCHDOG_FEWER, "n-four-bar", NULL, 0, "rk4+projection", 1e-2, 2 },
  { WATCHDOG_LIMIT (agree_best), 1e5, WATCHDOG_FEWER, "n-four-bar", NULL, 0, "rk4+projection", 1e-3, 4 },
  { WATCHDOG_LIMIT (agree), 1e-6, WATCHDOG_EARLIER, "n-four-bar", NULL, 0, "rk4+projection", 1e-3, 4 },
  { WATCHDOG_LIMIT (regular), 0, WATCHDOG_LATER, "n-four-bar", "N", 1, "erk8+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (turn), 4, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (least_turn), 1e4, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (drift_turn), 1e3, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (drift_near), 1e3, WATCHDOG_LATER, "n-four-bar", "N", 1, "bdf+none", 1e-5, 4 },
  { WATCHDOG_LIMIT (drift_far), 0.5, WATCHDOG_EARLIER, "n-four-bar", "N", 1, "adams+none", 1e-3, 4 },
  { WATCHDOG_LIMIT (drift_any), 0.5, WATCHDOG_EARLIER, "n-four-bar", "N", 1, "adams+none", 1e-3, 4 },
  { WATCHDOG_LIMIT (lipschitz), 0, WATCHDOG_LATER, "slider-crank", "l2", 1.00001, "bdf+projection", 1e-6, 4 },
  { WATCHDOG_LIMIT (sag), 0, WATCHDOG_LATER, "slider-crank", "l2", 1.00001, "bdf+projection", 1e-6, 4 },
  { WATCHDOG_LIMIT (dip), 8, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "ida+ggl", 1e-4, 4 },
  { WATCHDOG_LIMIT (stride), 30, WATCHDOG_LATER, "slider-crank", "l2", 1.00001, "bdf+projection", 1e-6, 4 },
  { WATCHDOG_LIMIT (floor), 100, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "bdf+projection", 1e-4, 4 },
  { WATCHDOG_LIMIT (progress), 20, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "rk4+projection", 1e-2, 4 },
  { WATCHDOG_LIMIT (met), 0, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "leapfrog", 1e-2, 4 },
  { WATCHDOG_LIMIT (ahead), 2.1, WATCHDOG_EARLIER, "slider-crank", NULL, 0, "rk4+projection", 1e-2, 4 },
  { WATCHDOG_LIMIT (resolved), 8, WATCHDOG_LATER, "slider-crank", "l2", 1.001, "leapfrog", 1e-2, 4 },
};

/* When a run stops, and how many steps it has rejected. */
static void watchdog_measure (int i, double factor, double *t, long *rejected) {
  pw_error error = { 0 };
  const char *parameter = watchdog_limit[i].parameter;
  double value = watchdog_limit[i].value;
  pw_system *s = watchdog_limit[i].model ? scene_named (watchdog_limit[i].model, parameter, value)
                                         : scene_system (&watchdog_bars_table, parameter, value, NULL);
  pw_run *r = runs_open (s, watchdog_limit[i].method,
                         &(pw_settings){ .rtol = watchdog_limit[i].tolerance,
                                         .step = watchdog_limit[i].tolerance,
                                         .span = watchdog_limit[i].t });
  *(double *)(void *)((char *)&r->limits + watchdog_limit[i].at) *= factor;
  pw_run_advance_to (r, watchdog_limit[i].t, watchdog_limit[i].t, &error);
  *t = pw_run_time (r);
  *rejected = pw_run_statistics (r)->rejected;
  print_message ("%s times %g: t = %g, %ld rejected: %s\n", watchdog_limit[i].name, factor, *t, *rejected, error.text);
  pw_run_close (r);
  pw_system_free (s);
}

static void test_limits (void **state) {
  int bad = 0;
  (void)state;
  for (size_t i = 0; i < sizeof watchdog_limit / sizeof *watchdog_limit; i++) {
    double t[2];
    long rejected[2];
    watchdog_measure ((int)i, 1, &t[0], &rejected[0]);
    watchdog_measure ((int)i, watchdog_limit[i].factor, &t[1], &rejected[1]);
    int good[] = { t[1]<t[0], t[1]> t[0], rejected[1]<rejected[0], rejected[1]> rejected[0] };
    if (!good[watchdog_limit[i].effect]) print_error ("%s decides nothing\n", watchdog_limit[i].name), bad++;
  }
  assert_int_equal (bad, 0);
}

/* Thresholds that no run shows by when it stops. */

/* A rhombus of bars of 1 m at this angle, in r->q, with rates of its own. */
static void watchdog_bend (pw_run *r, double angle) {
  double c = cos (angle), n = sin (angle);
  const double q[] = { 0.5 * c, 0.5 * n, angle, 0.5 + c, n, 0, 1 + 0.5 * c, 0.5 * n, angle };
  const double v[] = { -0.5 * n, 0.5 * c, 1, -n, c, 0, -0.5 * n, 0.5 * c, 1 };
  memcpy (r->q, q, sizeof q);
  memcpy (r->v, v, sizeof v);
  r->geometry.alert = 1;
}

/* How far J a is from gamma after an evaluation at this angle. */
static double watchdog_residual (pw_run *r, double angle) {
  double gamma[8], Ja[8], most = 0;
  watchdog_bend (r, angle);
  assert_int_equal (pw_run_accelerate (r, 0, r->q, r->v, r->a, r->lambda), PW_OK);
  pw_evaluate_gamma (r->w, gamma);
  pw_mul_J (r->w, r->a, Ja);
  for (int i = 0; i < r->s->rows; i++) most = fmax (most, fabs (Ja[i] - gamma[i]));
  return most;
}

/* How far J v is from 0 after irregular velocities have been projected at this angle. */
static double watchdog_projected (pw_run *r, double angle) {
  pw_projector p;
  pw_error error = { 0 };
  double v[9], Jv[8], most = 0;
  check_ok (pw_projector_open (&p, r, NULL, NULL, &error), &error);
  watchdog_bend (r, angle);
  for (int j = 0; j < 9; j++) v[j] = sin (1 + j);
  assert_int_equal (pw_update_kinematics (r->w, 0, r->q, v), PW_OK);
  pw_evaluate_J (r->w);
  assert_int_equal (pw_project_velocities (&p, r, v), PW_OK);
  pw_mul_J (r->w, v, Jv);
  for (int i = 0; i < r->s->rows; i++) most = fmax (most, fabs (Jv[i]));
  pw_projector_close (&p);
  return most;
}

static void test_evaluations (void **state) {
  (void)state;
  pw_system *s = scene_system (&watchdog_bars_table, NULL);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  const double angle = 1e-4;
  double refined = watchdog_residual (r, angle), sine = r->geometry.sine, projected = watchdog_projected (r, angle);
  r->limits.refine = 0;
  check_below ("projected", projected, 0.1 * watchdog_projected (r, angle), "eps / s instead of eps / s^2");
  check_below ("refined", refined, 0.1 * watchdog_residual (r, angle), "eps / s instead of eps / s^2");
  r->refuse = 2 * sine;
  watchdog_bend (r, angle);
  assert_int_equal (pw_run_accelerate (r, 0, r->q, r->v, r->a, r->lambda), PW_RETRY);
  r->refuse = 0.5 * sine;
  assert_int_equal (pw_run_accelerate (r, 0, r->q, r->v, r->a, r->lambda), PW_OK);
  assert_true (r->limits.rank == pw_watchdog_limits.rank);
  pw_run_close (r);
  pw_system_free (s);
}

static void test_jump (void **state) {
  (void)state;
  pw_system *s = scene_named ("chaplygin-sleigh", NULL, 0);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  pw_error error = { 0 };
  r->near = 1;
  r->a[0] = 1.5 * r->limits.jump * r->reference_level * s->scale.length / (r->w->scale.time * r->w->scale.time);
  assert_int_equal (pw_run_watchdog (r, &error), PW_METHOD);
  assert_non_null (strstr (error.text, "lost at a singular configuration: the accelerations are 150 times"));
  r->limits.jump *= 2;
  error = (pw_error){ 0 };
  r->near = 1;
  check_ok (pw_run_watchdog (r, &error), &error);
  pw_run_close (r);
  pw_system_free (s);
}

static void test_masses (void **state) {
  (void)state;
  pw_error error = { 0 };
  pw_system *s = scene_named ("n-four-bar", "m", 0.7 * pw_watchdog_limits.extreme);
  pw_run *r = runs_open (s, "rk4+projection", NULL);
  assert_int_equal (pw_watchdog_check_values (r, &error), PW_OK);
  r->limits.extreme /= 2;
  assert_int_equal (pw_watchdog_check_values (r, &error), PW_INPUT);
  pw_run_close (r);
  pw_system_free (s);
}

/* Accelerations are judged in units of the scene: under another torque a disc turns as before, faster. */
static void watchdog_build_disc (pw_model *m, const void *parameter) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 1 });
  pw_add_pin (m, &(pw_pin){ .name = "hub", .body = { "disc", "ground" } });
  pw_add_torque (m, &(pw_torque){ .name = "motor",
                                  .body = { "disc", "ground" },
                                  .value = { .constant = *(const double *)parameter } });
}

static void test_agitation (void **state) {
  static const pw_parameter list[] = { { .name = "torque", .value = 1 }, { .name = NULL } };
  static const pw_plugin_table table = { .abi = PW_ABI,
                                         .size = sizeof (pw_plugin_table),
                                         .parameters = list,
                                         .parameters_size = sizeof (double),
                                         .build = watchdog_build_disc };
  (void)state;
  for (int k = 0; k <= 6; k += 2) {
    pw_system *s = scene_system (&table, "torque", pow (10, k), NULL);
    pw_run *r = runs_open (s, "rk4+projection", NULL);
    check_close ("agitation", pw_run_acceleration_norm (r), 1, 16 * CHECK_EPS, "round-off");
    pw_run_close (r);
    pw_system_free (s);
  }
}

int main (void) {
  const struct CMUnitTest tests[] = {
    cmocka_unit_test (test_light_cart),        cmocka_unit_test (test_sine),
    cmocka_unit_test (test_near_slider_crank), cmocka_unit_test (test_near_four_bar),
    cmocka_unit_test (test_no_change_point),   cmocka_unit_test (test_messages),
    cmocka_unit_test (test_extreme),           cmocka_unit_test (test_limits),
    cmocka_unit_test (test_evaluations),       cmocka_unit_test (test_jump),
    cmocka_unit_test (test_agitation),         cmocka_unit_test (test_masses),
  };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
