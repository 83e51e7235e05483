/* Orders of convergence: the error at 10 s over three halvings of the step. */
#include <math.h>
#include <stdio.h>
#include "check.h"
#include "runs.h"
#include "scene.h"

enum { ORDER_COLUMNS = 6 };

/* The largest error of the EzyRoller's published states at 10 s. */
static double order_error (const char *method, double step) {
  double table[4 * ORDER_COLUMNS], q[6], v[6], worst = 0;
  assert_int_equal (runs_reference ("tests/reference/ezyroller.txt", 4, ORDER_COLUMNS, table), 4);
  const double *x = table + 3 * ORDER_COLUMNS;
  pw_system *s = scene_system (&scene_ezyroller, NULL);
  runs_state (s, method, &(pw_settings){ .step = step, .span = 10 }, 10, q, v, NULL);
  worst = fmax (fmax (fabs (q[0] - x[1]), fabs (q[1] - x[2])), fmax (fabs (q[2] - x[3]), fabs (q[5] - x[4])));
  pw_system_free (s);
  return worst;
}

static void order_expect (const char *method, const double *step, double ratio, double margin, const char *reason) {
  double error[3];
  for (int i = 0; i < 3; i++) error[i] = order_error (method, step[i]);
  for (int i = 0; i < 2; i++) {
    check_close (check_text ("%s, error at h = %g over error at h = %g", method, step[i], step[i + 1]),
                 error[i] / error[i + 1], ratio, margin, reason);
  }
}

static const double order_steps[] = { 0.02, 0.01, 0.005 };

TEST (order_4) {
  order_expect ("rk4+none", order_steps, 16, 1, "order 4: 2^4, and the next power of h");
  order_expect ("rk4+projection", order_steps, 16, 1, "order 4: 2^4, and the next power of h");
  order_expect ("rk4+projection:metric=identity", order_steps, 16, 1.5, "order 4: 2^4, and the next power of h");
  order_expect ("rk4+projection:every=4", order_steps, 16, 1.5, "order 4: 2^4, and the next power of h");
  order_expect ("rk4+baumgarte", order_steps, 16, 1.5, "order 4: 2^4, and the next power of h");
}

/* Torques held over the step make any method first order. */
TEST (held) {
  static const double step[] = { 0.002, 0.001, 0.0005 };
  order_expect ("rk4+projection:inputs=held", step, 2, 0.1, "order 1: 2, and the next power of h");
  order_expect ("rk4+none:inputs=held", step, 2, 0.1, "order 1: 2, and the next power of h");
}

/* ---- A torque that jumps ---- */

static int order_switched (void *context, double t, const double *x, double value[3], double *gradient) {
  (void)context, (void)x, (void)gradient;
  value[0] = t < 1. / 3 ? 0.1 : -0.2;
  return 0;
}

static double order_breakpoint (void *context, double t) {
  (void)context;
  return t < 1. / 3 ? 1. / 3 : INFINITY;
}

/* The EzyRoller with that torque, 1 s. */
static void order_switched_run (const char *method, const pw_settings *settings, double *q, double *v,
                                pw_statistics *cost) {
  pw_error error = { 0 };
  pw_signal torque = { PW_FUNCTION, .function = { .eval = order_switched, .breakpoint = order_breakpoint } };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  pw_system *s = scene_compile (m);
  runs_state (s, method, settings, 1, q, v, cost);
  pw_system_free (s);
}

static double order_switched_error (const char *method, double step) {
  double x[2][6], v[6], worst = 0;
  for (int i = 0; i < 2; i++)
    order_switched_run (method, &(pw_settings){ .step = i == 0 ? step : 1e-3, .span = 1 }, x[i], v, NULL);
  for (int j = 0; j < 6; j++) worst = fmax (worst, fabs (x[0][j] - x[1][j]));
  return worst;
}

/* A step ends where a signal jumps and uses its value before; the next one begins with the value after the jump:
 * the order stays 4, errors follow the tolerances. */
TEST (switched) {
  double coarse = order_switched_error ("rk4+projection", 0.04), fine = order_switched_error ("rk4+projection", 0.02);
  check_below ("error at h = 0.02", fine, coarse / 8, "order 4 has 1/16; with the value after the jump it has 1/2");
  check_below ("error at h = 0.02", fine, 1e-5, "h^4 (torque / inertia)^2, about 8e-7");
  static const char *const ida[] = { "ida+ggl",        "ida+baumgarte", "ida+si1",      "adams+none",  "bdf+none",
                                     "bdf+projection", "radau+ggl",     "radau+index2", "radau+index3" };
  for (int i = 0; i < 9; i++) {
    double q[2][6], v[6];
    pw_statistics cost;
    order_switched_run (ida[i], &(pw_settings){ .rtol = 1e-8, .span = 1 }, q[0], v, &cost);
    order_switched_run ("rk4+projection", &(pw_settings){ .step = 1e-3, .span = 1 }, q[1], v, NULL);
    for (int j = 0; j < 6; j++) check_close (ida[i], q[0][j], q[1][j], 1e3 * 1e-8, "1e3 rtol");
    check_below ("steps", (double)cost.steps, 400, "not many more than without a switch");
  }
}
