/* Runs driven by the built-in signals: steps end at their jumps and kinks, so that every method keeps its order. */
#include <math.h>
#include <string.h>
#include "check.h"
#include "runs.h"
#include "scene.h"
#include "trial.h"

/* The EzyRoller with this torque of the rider. */
static pw_system *driven_scene (const pw_signal *torque) {
  pw_error error = { 0 };
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", torque, &error), &error);
  return scene_compile (m);
}

/* Its coordinates at 4 s. */
static void driven_run (const pw_signal *torque, const char *method, const pw_settings *settings, double *q,
                        pw_statistics *cost) {
  double v[6];
  pw_system *s = driven_scene (torque);
  runs_state (s, method, settings, 4, q, v, cost);
  pw_system_free (s);
}

/* The largest error of the coordinates at 4 s, with a fixed step or an rtol of this size. */
static double driven_error (const pw_signal *torque, const char *method, double size, const double *exact) {
  double q[6], worst = 0;
  driven_run (torque, method, &(pw_settings){ .step = size, .rtol = size, .span = 4 }, q, NULL);
  for (int j = 0; j < 6; j++) worst = fmax (worst, fabs (q[j] - exact[j]));
  return worst;
}

enum { DRIVEN_TORQUES = 6, DRIVEN_POINTS = 20 };
static double driven_wave_t[DRIVEN_POINTS], driven_wave_y[DRIVEN_POINTS];

/* The i-th signal of the torque [N m]. */
static pw_signal driven_torque (int i) {
  static const double little_t[] = { 0.31, 1.07, 1.9, 3.3 }, little_y[] = { 0, 0.2, -0.2, 0.1 };
  for (int k = 0; k < DRIVEN_POINTS; k++)
    driven_wave_t[k] = 0.21 * k, driven_wave_y[k] = 0.2 * sin (2 * driven_wave_t[k]);
  const pw_signal torque[] = {
    { PW_RAMP, .ramp = { 0, 0.2, 1 / 3., 1.77 } },
    { PW_PULSE, .pulse = { 0.2, 1 / 3., 0.41, 1.13, -0.1 } },
    { PW_TABLE, .table = { little_t, little_y, 4, PW_LINEAR, 0, 0, 0, 0 } },
    { PW_SMOOTH_STEP, .ramp = { 0, 0.2, 1 / 3., 1.77 } },
    { PW_TABLE, .table = { little_t, little_y, 4, PW_CUBIC, PW_ENDS_FREE, 0, 0, 0 } },
    { PW_TABLE, .table = { driven_wave_t, driven_wave_y, DRIVEN_POINTS, PW_CUBIC, PW_ENDS_REST, 0, 0, 0 } },
  };
  return torque[i];
}

/* The order is 4, although jumps and kinks do not lie at multiples of the step. */
TEST (order) {
  for (int i = 0; i < DRIVEN_TORQUES; i++) {
    double exact[6], error[3];
    pw_signal torque = driven_torque (i);
    driven_run (&torque, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 4 }, exact, NULL);
    for (int k = 0; k < 3; k++) error[k] = driven_error (&torque, "rk4+projection", 0.04 / (1 << k), exact);
    for (int k = 0; k < 2; k++)
      check_below ("error over that of twice the step", error[k + 1] / error[k], 1 / 9.,
                   "order 4 has 1/16, a step over a kink 1/4, over a jump 1/2");
  }
}

/* With inputs=held the torque is constant over a step. */
TEST (held) {
  for (int i = 0; i < DRIVEN_TORQUES; i++) {
    double exact[6];
    pw_signal torque = driven_torque (i);
    driven_run (&torque, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 4 }, exact, NULL);
    double coarse = driven_error (&torque, "rk4+projection:inputs=held", 2e-3, exact);
    double fine = driven_error (&torque, "rk4+projection:inputs=held", 1e-3, exact);
    if (torque.type == PW_PULSE)
      check_below ("error of held pulses", fine, 1e-8, "exact: they are constant between breakpoints");
    else
      check_close ("error over that of half the step", coarse / fine, 2, 0.2, "held: order 1");
  }
}

TEST (tolerances) {
  static const char *const method[] = { "erk5+projection", "erk8+projection", "ida+ggl", "ida+baumgarte", "radau+ggl" };
  for (int i = 0; i < DRIVEN_TORQUES; i++) {
    double exact[6];
    pw_signal torque = driven_torque (i);
    driven_run (&torque, "rk4+projection", &(pw_settings){ .step = 1e-3, .span = 4 }, exact, NULL);
    for (int k = 0; k < 5; k++) {
      double factor = k < 2 ? 100 : 1000;
      check_below (method[k], driven_error (&torque, method[k], 1e-8, exact), factor * 1e-8,
                   "100 rtol, of implicit methods 1000 rtol");
    }
  }
}

SCENE (driven_disc) {
  pw_add_body (m, &(pw_body){ .name = "disc", .mass = 1, .inertia = 2 });
  pw_add_torque (m, &(pw_torque){ .name = "push", .body = { "disc", "ground" } });
}

/* A pulse is not stepped over, however short it is and however large the steps before it are. */
TEST (short_pulse) {
  static const char *const method[] = { "erk5", "erk8", "rk4", "ida" };
  pw_signal force = { PW_PULSE, .pulse = { .height = 1000, .start = 70. / 3, .width = 1e-3 } };
  for (int i = 0; i < 4; i++) {
    double q[3], v[3];
    pw_error error = { 0 };
    pw_model *m = scene_model (&driven_disc_table, NULL);
    check_ok (pw_model_set_signal (m, "push", "value", &force, &error), &error);
    pw_system *s = scene_compile (m);
    runs_state (s, method[i], &(pw_settings){ .rtol = 1e-6, .step = 0.7, .span = 40 }, 40, q, v, NULL);
    check_close (method[i], v[2], 0.5, 1e-9, "torque times width over inertia: round-off of times");
    pw_system_free (s);
  }
}

/* The model copies the points of a table. */
TEST (copies) {
  double t[] = { 0, 1, 2, 3 }, y[] = { 0, 0.1, 0.2, 0.1 }, q[2][6], v[6];
  pw_signal torque = { PW_TABLE, .table = { t, y, 4, PW_CUBIC, 0, 0, 0, 0 } };
  pw_error error = { 0 };
  driven_run (&torque, "rk4", &(pw_settings){ .step = 0.01 }, q[0], NULL);
  pw_model *m = scene_model (&scene_ezyroller, NULL);
  check_ok (pw_model_set_signal (m, "rider", "value", &torque, &error), &error);
  memset (t, 0, sizeof t);
  memset (y, 0, sizeof y);
  pw_system *s = scene_compile (m);
  runs_state (s, "rk4", &(pw_settings){ .step = 0.01 }, 4, q[1], v, NULL);
  check_bits ("states", q[0], q[1], 6);
  pw_system_free (s);
}

/* A crank driven through the points of a cubic table, at which its acceleration has kinks. */
SCENE (driven_crank) {
  enum { POINTS = 41 };
  double t[POINTS], angle[POINTS];
  for (int i = 0; i < POINTS; i++) {
    double x = 2 * PW_PI * i / (POINTS - 1);
    t[i] = 0.1 * i;
    angle[i] = 1.2 * (cos (x) - 1) + 0.3 * (1 - cos (2 * x));
  }
  pw_add_body (m, &(pw_body){ .name = "arm", .mass = 1, .inertia = 0.1 });
  pw_add_body (m, &(pw_body){ .name = "bob", .mass = 1, .inertia = 0.1, .start = { 1 } });
  pw_add_pin (m, &(pw_pin){ .name = "A", .body = { "arm", "ground" } });
  pw_add_pin (m, &(pw_pin){ .name = "B", .body = { "arm", "bob" }, .at = { { 0.5, 0 }, { -0.5, 0 } } });
  pw_add_gravity (m, &(pw_gravity){ .name = "g", .acceleration = { 0, -9.81 } });
  pw_add_drive (m, &(pw_drive){ .name = "D",
                                .body = { "arm", "ground" },
                                .what = PW_DRIVE_ANGLE,
                                .value = { PW_TABLE, .table = { .t = t,
                                                                .value = angle,
                                                                .count = POINTS,
                                                                .interpolation = PW_CUBIC,
                                                                .ends = PW_ENDS_REST } } });
}

/* Methods of order > 2 end their steps at the kinks: few steps are rejected, and the error is below rtol = 1e-10.
 * Without that, a hundred would be rejected, and the error would be 2e-9. */
TEST (knots) {
  double exact[6], q[6], v[6];
  pw_statistics cost;
  pw_system *s = scene_system (&driven_crank_table, NULL);
  runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-13, .span = 4 }, 4, exact, v, NULL);
  runs_state (s, "erk8+projection", &(pw_settings){ .rtol = 1e-10, .span = 4 }, 4, q, v, &cost);
  assert_true (cost.rejected < 5 && cost.steps >= 40);
  check_close ("erk8", q[5], exact[5], 1e-11, "rtol / 10: the points are closer than the steps for rtol");
  runs_state (s, "erk8+projection:steps=fixed", &(pw_settings){ .step = 0.0097, .span = 4 }, 4, q, v, NULL);
  check_close ("erk8, fixed", q[5], exact[5], 1e-12, "round-off; 1e-8 if steps contained kinks");
  runs_state (s, "bdf+projection", &(pw_settings){ .rtol = 1e-6, .span = 4 }, 4, q, v, &cost);
  assert_true (cost.steps < 700); /* about 350; 900 if the method restarted at each point */
  pw_system_free (s);
}
