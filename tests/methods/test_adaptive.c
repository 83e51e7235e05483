/* erk5 and erk8: orders with fixed steps, errors proportional to tolerances, step-size control, failing runs. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

enum { ADAPT_COLUMNS = 6 };

/* The largest error of the EzyRoller's published states at 10 s. */
static double adaptive_error (const char *method, pw_settings settings, pw_statistics *cost) {
  double table[4 * ADAPT_COLUMNS], q[6], v[6];
  assert_int_equal (runs_reference ("tests/reference/ezyroller.txt", 4, ADAPT_COLUMNS, table), 4);
  const double *x = table + 3 * ADAPT_COLUMNS;
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  settings.span = 10;
  runs_state (s, method, &settings, 10, q, v, cost);
  pw_system_free (s);
  return fmax (fmax (fabs (q[0] - x[1]), fabs (q[1] - x[2])), fmax (fabs (q[2] - x[3]), fabs (q[5] - x[4])));
}

/* ---- Orders ---- */

static void adaptive_order (const char *integrator, int order, const double step[3], double band, const char *reason) {
  static const char *const rest[] = { "none", "projection", "projection:metric=identity" };
  for (int k = 0; k < 3; k++) {
    char method[80];
    double error[3];
    snprintf (method, sizeof method, "%s+%s:steps=fixed", integrator, rest[k]);
    for (int i = 0; i < 3; i++) error[i] = adaptive_error (method, (pw_settings){ .step = step[i] }, NULL);
    check_below ("round-off in the last error", 10 / step[2] * CHECK_EPS, error[2],
                 "one eps of each of 10 s / h steps");
    for (int i = 0; i < 2; i++) {
      check_close (check_text ("slope of %s from h = %g to %g", method, step[i], step[i + 1]),
                   log2 (error[i] / error[i + 1]), order, band, reason);
    }
  }
}

TEST (orders) {
  static const double step5[] = { 0.04, 0.02, 0.01 }, step8[] = { 0.2, 0.1, 0.05 };
  adaptive_order ("erk5", 5, step5, 0.3, "order 5, and the next power of h");
  adaptive_order ("erk8", 8, step8, 0.75, "order 8, and the next power of h: steps are large, or round-off shows");
}

/* ---- Tolerances ---- */

static const char *const adaptive_methods[] = { "erk5+none", "erk5+projection", "erk5+projection:metric=identity",
                                                "erk8+none", "erk8+projection", "erk8+projection:metric=identity" };
enum { ADAPT_METHODS = sizeof adaptive_methods / sizeof *adaptive_methods };

TEST (tolerances) {
  for (int i = 0; i < ADAPT_METHODS; i++) {
    double error[13];
    long steps = 0;
    for (int k = 4; k <= 12; k++) {
      char what[100];
      pw_statistics cost;
      double rtol = pow (10, -k);
      error[k] = adaptive_error (adaptive_methods[i], (pw_settings){ .rtol = rtol }, &cost);
      snprintf (what, sizeof what, "%s, rtol %g, error at 10 s", adaptive_methods[i], rtol);
      check_below (what, error[k], 100 * rtol, "100 rtol: errors of steps grow as neighbouring motions diverge");
      if (k > 4) check_below (what, error[k], error[k - 1], "less than with ten times the tolerance");
      assert_true (cost.steps > steps);
      check_below ("rejected", (double)cost.rejected, (double)cost.steps / 3 + 5, "a third of the steps");
      steps = cost.steps;
      if (strstr (adaptive_methods[i], "projection")) {
        check_below (what, cost.position, 16 * CHECK_EPS, "round-off of the projection");
        check_below (what, cost.velocity, 16 * CHECK_EPS, "round-off of the projection");
      }
    }
    check_close (adaptive_methods[i], log10 (error[5] / error[12]) / 7, 1, 0.15, "error in proportion to rtol");
    check_below (adaptive_methods[i], error[12], 1e-11, "10 rtol at rtol = 1e-12");
  }
}

/* The work grows with rtol^(-1/order): erk8 becomes cheaper relative to erk5 at tight tolerances. */
TEST (work) {
  const double rtol[] = { 1e-6, 1e-9, 1e-12 };
  double before = 1;
  for (int i = 0; i < 3; i++) {
    pw_statistics cost[2];
    adaptive_error ("erk5+projection", (pw_settings){ .rtol = rtol[i] }, &cost[0]);
    adaptive_error ("erk8+projection", (pw_settings){ .rtol = rtol[i] }, &cost[1]);
    double ratio = (double)cost[1].rhs / (double)cost[0].rhs;
    check_below ("evaluations of erk8 over those of erk5", ratio, before, "less than at the tolerance before");
    before = ratio;
  }
}

/* ---- Steps limited by stability ----
 *
 * One body follows a force through a stiff damper, m v' = k (cos w t - v), another swings on a spring whose accuracy
 * needs steps near the damper's limit of stability, 6.4 / k:  v = (k^2 cos w t + k w sin w t) / (k^2 + w^2) */

enum { ADAPTIVE_DAMPING = 400, ADAPTIVE_DRIVE = 2 };

typedef struct {
  double swing; /* [rad/s] */
} adaptive_edge;

static const pw_parameter adaptive_edge_list[] = {
  { PW_AT (adaptive_edge, swing), 20, "rad/s", "of the spring", PW_POSITIVE },
  { .name = NULL },
};

SCENE_WITH (adaptive_build_edge, adaptive_edge_list, adaptive_edge) {
  const double k = ADAPTIVE_DAMPING, w = ADAPTIVE_DRIVE, swing = p->swing;
  pw_add_body (m, &(pw_body){ .name = "led", .mass = 1, .inertia = 1, .rate = { k * k / (k * k + w * w) } });
  pw_add_body (m, &(pw_body){ .name = "swung", .mass = 1, .inertia = 1, .start = { 1 } });
  pw_add_drag (m, &(pw_drag){ .name = "oil", .body = "led", .linear = k });
  pw_add_force (
      m,
      &(pw_force){ .name = "lead", .body = "led", .fx = { PW_HARMONIC, .harmonic = { .amplitude = k, .omega = w } } });
  pw_add_spring (m, &(pw_spring){ .name = "spring", .body = { "swung", "ground" }, .stiffness = swing * swing });
}

TEST (edge) {
  const double k = ADAPTIVE_DAMPING, w = ADAPTIVE_DRIVE, t_end = 5;
  for (double swing = 10; swing < 25; swing += 1) {
    pw_error error = { 0 };
    pw_system *s = scene_system (&adaptive_build_edge_table, "swing", swing, NULL);
    pw_run *r = runs_open (s, "erk8+none", &(pw_settings){ .rtol = 1e-10, .span = t_end });
    double worst = 0;
    while (pw_run_time (r) < t_end) {
      pw_sample x;
      check_ok (pw_run_advance (r, t_end, &error), &error);
      check_ok (pw_run_sample (r, pw_run_time (r), &x, &error), &error);
      double v = (k * k * cos (w * x.t) + k * w * sin (w * x.t)) / (k * k + w * w);
      worst = fmax (worst, fabs (x.v[0] - v));
    }
    check_below ("rate", worst, 1e-7, "1e3 rtol, twice the largest; with the two estimates of DOP853 alone it is 5e-7");
    pw_run_close (r);
    pw_system_free (s);
  }
}

/* ---- Step-size control, with known error estimates ---- */

/* The pair of Dormand & Prince: times, stages, weights of the estimate (Hairer, Norsett & Wanner 1993, table
 * II.5.2). */
static const double adaptive_c[] = { 0, 1. / 5, 3. / 10, 4. / 5, 8. / 9, 1, 1 };
static const double adaptive_A[7][6] = {
  { 0 },
  { 1. / 5 },
  { 3. / 40, 9. / 40 },
  { 44. / 45, -56. / 15, 32. / 9 },
  { 19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729 },
  { 9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656 },
  { 35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84 },
};
static const double adaptive_e[] = { 71. / 57600, 0, -71. / 16695, 71. / 1920, -17253. / 339200, 22. / 525, -1. / 40 };

static int adaptive_power (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = 1e5 * t * t * t * t;
  value[1] = 4e5 * t * t * t;
  value[2] = 12e5 * t * t;
  return 0;
}

static double adaptive_height; /* of the bump [N] */

static int adaptive_bump (void *context, double t, const double *x, double value[3], double *gradient) {
  const double width = 0.01, z = (t - 1) / width, f = adaptive_height * exp (-z * z);
  (void)context, (void)x, (void)gradient;
  value[0] = f + 10 * cos (20 * t);
  value[1] = -2 * z / width * f - 200 * sin (20 * t);
  value[2] = (4 * z * z - 2) / (width * width) * f - 4000 * cos (20 * t);
  return 0;
}

/* The transverse motion makes the kinetic energy so large that, at first, errors of the state dominate those of
 * work. */
static void adaptive_pushed (pw_model *m, int (*eval) (void *, double, const double *, double *, double *)) {
  pw_add_body (m, &(pw_body){ .name = "puck", .mass = 1, .inertia = 1, .rate = { 3, 30, 0 } });
  pw_add_force (m, &(pw_force){ .name = "push", .body = "puck", .fx = { PW_FUNCTION, .function = { .eval = eval } } });
}

SCENE (adaptive_by_power) {
  adaptive_pushed (m, adaptive_power);
}

SCENE (adaptive_by_bump) {
  adaptive_pushed (m, adaptive_bump);
}

static double adaptive_step (pw_run *r, double t_end) {
  pw_error error = { 0 };
  double before = pw_run_time (r);
  check_ok (pw_run_advance (r, t_end, &error), &error);
  return pw_run_time (r) - before;
}

/* The error estimate of a step under the force 1e5 t^4: root mean square over 6 states, relative to |q| + L and
 * |v| + L / T. */
static double adaptive_estimate (double t, double h, const pw_sample *x, const pw_scale *scale) {
  double v = 0, q = 0;
  for (int i = 0; i < 7; i++) {
    double stage = 0;
    for (int j = 0; j < i; j++) stage += h * adaptive_A[i][j] * 1e5 * pow (t + adaptive_c[j] * h, 4);
    q += h * adaptive_e[i] * stage;
    v += h * adaptive_e[i] * 1e5 * pow (t + adaptive_c[i] * h, 4);
  }
  q /= fabs (x->q[0]) + scale->length;
  v /= fabs (x->v[0]) + scale->length / scale->time;
  return sqrt ((q * q + v * v) / 6);
}

/* h_new / h = 0.9 err^-(1/5 - 3/4 0.04) err_before^0.04, unless the error of the work is larger than that of the state
 * (Hairer, Norsett & Wanner 1993, section II.4). */
TEST (norm) {
  const double rtol = 1e-8, round_off = 1e-6;
  double before = 0, predicted = 0;
  int equal = 0;
  pw_system *s = scene_system (&adaptive_by_power_table, NULL);
  pw_run *r = runs_open (s, "erk5+none", &(pw_settings){ .rtol = rtol, .span = 1 });
  for (int n = 0; n < 40; n++) {
    double t = pw_run_time (r);
    long rejected = pw_run_statistics (r)->rejected;
    double h = adaptive_step (r, 1);
    pw_error error = { 0 };
    pw_sample x;
    check_ok (pw_run_sample (r, pw_run_time (r), &x, &error), &error);
    double now = adaptive_estimate (t, h, &x, pw_run_scale (r)) / rtol;
    equal += n > 1 && pw_run_statistics (r)->rejected == rejected && fabs (h - predicted) <= round_off * h;
    predicted = h * fmin (5, fmax (0.2, 0.9 * pow (now, -(0.2 - 0.03)) * pow (before, 0.04)));
    before = fmax (now, 1e-4);
  }
  print_message ("%d steps are as predicted by the norm\n", equal);
  check_below ("equal steps", 10, equal, "of 40; with another norm or other weights, no step is equal");
  pw_run_close (r);
  pw_system_free (s);
}

/* A narrow bump causes rejected steps, after which a step may be far smaller than needed: the next one is not
 * longer. */
TEST (after_rejection) {
  int found = 0;
  for (adaptive_height = 1e-3; adaptive_height < 1e6; adaptive_height *= 3) {
    pw_system *s = scene_system (&adaptive_by_bump_table, NULL);
    pw_run *r = runs_open (s, "erk5+none", &(pw_settings){ .rtol = 1e-8, .span = 2 });
    for (double last = INFINITY; pw_run_time (r) < 1.5;) {
      long rejected = pw_run_statistics (r)->rejected;
      double h = adaptive_step (r, 2);
      int none = pw_run_statistics (r)->rejected == rejected;
      if (none) check_below ("step after a rejection", h, last * (1 + 1e-9), "no growth; round-off of the times");
      found += !none;
      last = none ? INFINITY : h;
    }
    pw_run_close (r);
    pw_system_free (s);
  }
  check_below ("bumps", 10, found, "one for each of 19 bumps, a third as wide as the steps before them");
}

/* A step shortened at the requested time does not shorten later steps. */
TEST (after_cut) {
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  pw_run *r = runs_open (s, "erk5+projection", &(pw_settings){ .rtol = 1e-8, .span = 10 });
  double h = 0;
  while (pw_run_time (r) < 2) h = adaptive_step (r, 10);
  adaptive_step (r, pw_run_time (r) + 1e-6 * h);
  check_below ("half the step before the shortened one", 0.5 * h, adaptive_step (r, 10),
               "the motion is as smooth as before");
  pw_run_close (r);
  pw_system_free (s);
}

/* ---- Motion along the constraints ----
 *
 * The motion of a massless body is prescribed, so that there is no work and projection removes the whole error: only
 * the size of the projection limits steps, at rtol^(3/4).  With an estimate of order h^5, h is proportional to
 * rtol^(3/20). */

SCENE (adaptive_turned) {
  pw_add_body (m, &(pw_body){ .name = "arm", .start = { 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "O", .body = { "ground", "arm" }, .at = { { 0, 0 }, { -1, 0 } } });
  pw_add_drive (m, &(pw_drive){ .name = "motor",
                                .body = { "arm", "ground" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_HARMONIC, .harmonic = { .amplitude = 5, .omega = 0.5, .offset = -5 } } });
}

static double adaptive_steps (const char *method, double rtol, double t_end) {
  double q[3], v[3];
  pw_statistics cost;
  pw_system *s = scene_system (&adaptive_turned_table, NULL);
  runs_state (s, method, &(pw_settings){ .rtol = rtol, .span = t_end }, t_end, q, v, &cost);
  pw_system_free (s);
  return (double)cost.steps;
}

TEST (prescribed) {
  double few = adaptive_steps ("erk5+projection", 1e-4, 50), many = adaptive_steps ("erk5+projection", 1e-10, 50);
  check_close ("growth of steps", log10 (many / few) / 6, 0.15, 0.02, "rtol^(3/20); rtol^(1/10) without the root");
  check_below ("steps of bdf+projection", 300, adaptive_steps ("bdf+projection", 1e-4, 50),
               "half the measured number; if projection hid the error, h would grow without limit");
}

/* ---- Failing runs ---- */

/* omega' = omega^2, omega = 1 / (1 - t). */
static int adaptive_square (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)t;
  value[0] = x[0] * x[0];
  if (gradient) gradient[0] = 2 * x[0];
  return 0;
}

/* Fails after 0.7 s. */
static int adaptive_failing (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = 1;
  return t > 0.7;
}

static void adaptive_rotor (pw_model *m, pw_signal torque) {
  pw_add_body (m, &(pw_body){ .name = "rotor", .mass = 1, .inertia = 1, .rate = { 0, 0, 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "P", .body = { "ground", "rotor" } });
  pw_add_torque (m, &(pw_torque){ .name = "motor", .body = { "rotor", "ground" }, .value = torque });
}

SCENE (adaptive_exploding) {
  static const char *const reads[] = { "rotor.omega", NULL };
  adaptive_rotor (m, (pw_signal){ PW_FUNCTION, .function = { .eval = adaptive_square, .reads = reads } });
}

SCENE (adaptive_ending) {
  adaptive_rotor (m, (pw_signal){ PW_FUNCTION, .function = { .eval = adaptive_failing } });
}

/* The run fails with the time reached, at most `last`; the state there can be sampled. */
static void adaptive_stops (const char *method, const pw_plugin_table *table, double last, const char *cause) {
  char text[60];
  pw_error error = { 0 }, none = { 0 };
  pw_system *s = scene_system (table, NULL);
  pw_run *r = runs_open (s, method, &(pw_settings){ .rtol = 1e-8, .span = 2 });
  assert_int_equal (pw_run_advance_to (r, 2, 2, &error), PW_METHOD);
  assert_int_equal (error.status, PW_METHOD);
  snprintf (text, sizeof text, "t = %.6g s: ", pw_run_time (r));
  assert_memory_equal (error.text, text, strlen (text));
  assert_non_null (strstr (error.text, cause));
  check_below ("time reached", pw_run_time (r), last, "no state after the end of the motion");
  pw_sample now;
  check_ok (pw_run_sample (r, pw_run_time (r), &now, &none), &none);
  assert_true (isfinite (now.q[2]) && isfinite (now.v[2]));
  pw_run_close (r);
  pw_system_free (s);
}

TEST (stops) {
  for (int i = 0; i < ADAPT_METHODS; i++) {
    adaptive_stops (adaptive_methods[i], &adaptive_exploding_table, 1 + 100 * 1e-8,
                    "the tolerances require a step below ");
    adaptive_stops (adaptive_methods[i], &adaptive_ending_table, 0.7, "a signal failed");
  }
}

/* Tolerances that accept everything: the run ends at t_end, or with an error; one motion grows without bound. */
TEST (useless_tolerances) {
  static const double atol[] = { 0, 1e6 };
  for (int i = 0; i < ADAPT_METHODS; i++)
    for (int k = 0; k < 2; k++) {
      pw_error error = { 0 };
      pw_system *s = scene_system (&scene_ezyroller, NULL);
      pw_run *r = runs_open (s, adaptive_methods[i],
                             &(pw_settings){ .rtol = 0.5, .atol = atol[k], .span = 10, .max_steps = 1000 });
      int status = pw_run_advance_to (r, 10, 10, &error);
      assert_true ((status == PW_OK && pw_run_time (r) == 10) || (status == PW_METHOD && pw_run_time (r) < 10));
      if (status == PW_METHOD) assert_memory_equal (error.text, "t = ", 4);
      pw_run_close (r);
      pw_system_free (s);
    }
}
